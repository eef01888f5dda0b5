/* ebpo scene report: prints contacts of the instances of a scene, as JSON, CSV or words. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/commands/clash_list.h"
#include "cli/commands/clash_page.h"
#include "cli/commands/clash_pictures.h"
#include "cli/commands/scene_report.h"
#include "cli/commands/scene_run.h"
#include "cli/json.h"
#include "cli/progress.h"
#include "cli/words.h"

/* --- a contact --- */

/* Returns the name of the instance, which is valid until the scene is freed. */
static const char *scene_instance_name(const ebpo_scene *scene, uint64_t instance)
{
    ebpo_scene_instance i = EBPO_SCENE_INSTANCE_INIT;
    (void)ebpo_scene_get_instance(scene, instance, &i);
    return i.name;
}

/* Returns the word for an ebpo_relation; NULL: undecided. */
static const char *relation_word(int32_t relation)
{
    static const char *const words[] = { "disjoint",   "touching",   "intersecting",
                                         "a inside b", "b inside a", "equal" };
    return relation < EBPO_RELATION_UNDECIDED ? words[relation] : NULL;
}

/* --- JSON --- */

static void depth_json(json *j, const char *key, const ebpo_value_bounds *depth)
{
    json_object(j, key);
    json_real(j, "lo", depth->lo);
    json_real(j, "hi", depth->hi);
    json_end(j);
}

static void counts_json(json *j, const ebpo_scene_clash *m)
{
    json_uint(j, "touching", m->touching);
    json_uint(j, "coplanar", m->coplanar);
    json_uint(j, "crossing", m->crossing);
    if (m->contacts < UINT64_MAX)
        json_uint(j, "contacts", m->contacts);
    else
        json_null(j, "contacts");
}

static void scene_row_json(json *j, const scene_values *v, const ebpo_scene *scene,
                           const ebpo_scene_clash *m)
{
    const char *relation = relation_word(m->relation);
    json_object(j, NULL);
    json_text(j, "a", scene_instance_name(scene, m->a));
    json_text(j, "b", scene_instance_name(scene, m->b));
    json_text(j, "kind", clash_kind_word(m->kind));
    if (relation)
        json_text(j, "relation", relation);
    json_uint(j, "face_a", m->face_a);
    json_uint(j, "face_b", m->face_b);
    if (v->count)
        counts_json(j, m);
    json_real(j, "clearance", m->clearance);
    json_real(j, "distance", m->distance);
    if (v->locations) {
        json_reals(j, "location", m->location, 3);
        json_reals(j, "location_min", m->location_min, 3);
        json_reals(j, "location_max", m->location_max, 3);
    }
    if (v->depth > 0) {
        depth_json(j, "depth_of_a", &m->depth[0]);
        depth_json(j, "depth_of_b", &m->depth[1]);
    }
    json_end(j);
}

/* --- CSV --- */

static void scene_head_csv(const scene_values *v)
{
    printf("time,a,b,kind,distance,face_a,face_b%s%s%s%s\n",
           v->count ? ",touching,coplanar,crossing,contacts" : "",
           v->solids || v->depth > 0 ? ",relation" : "", v->locations ? ",x,y,z" : "",
           v->depth > 0 ? ",a_in_b_lo,a_in_b_hi,b_in_a_lo,b_in_a_hi" : "");
}

/* Writes the text in quotes; doubles the quotes within. A spreadsheet would read a text that begins
 * with =, +, - or @ as a formula, so the function writes a ' before such a text. It also writes a '
 * before a text that begins with '. So removing a leading ' always restores the text. */
static void csv_text(const char *text)
{
    putchar('"');
    if (*text && strchr("=+-@'", *text))
        putchar('\'');
    for (; *text; text++) {
        if (*text == '"')
            putchar('"');
        putchar(*text);
    }
    putchar('"');
}

/* Writes a number, or nothing if it is not known. */
static void csv_real(double x)
{
    char text[32];
    putchar(',');
    if (isfinite(x))
        fputs(words_real(x, text), stdout);
}

static void csv_count(uint64_t n)
{
    putchar(',');
    if (n < UINT64_MAX)
        printf("%llu", (unsigned long long)n);
}

static void scene_row_csv(const scene_values *v, const ebpo_scene *scene, double time,
                          const ebpo_scene_clash *m)
{
    const uint64_t counts[] = { m->touching, m->coplanar, m->crossing, m->contacts };
    char text[32];
    printf("%s,", words_real(time, text));
    csv_text(scene_instance_name(scene, m->a));
    putchar(',');
    csv_text(scene_instance_name(scene, m->b));
    printf(",%s,%s,%llu,%llu", clash_kind_word(m->kind), words_real(m->distance, text),
           (unsigned long long)m->face_a, (unsigned long long)m->face_b);
    for (int i = 0; i < 4 && v->count; i++)
        csv_count(counts[i]);
    if (v->solids || v->depth > 0)
        printf(",%s", relation_word(m->relation));
    for (int k = 0; k < 3 && v->locations; k++)
        csv_real(m->location[k]);
    for (int i = 0; i < 2 && v->depth > 0; i++) {
        csv_real(m->depth[i].hi < INFINITY ? m->depth[i].lo : NAN);
        csv_real(m->depth[i].hi);
    }
    putchar('\n');
}

/* --- words --- */

static void depth_words(const char *which, const ebpo_value_bounds *depth)
{
    if (depth->hi < INFINITY)
        printf("\t%s %.9g to %.9g deep", which, depth->lo, depth->hi);
}

static void scene_row_words(const scene_values *v, const ebpo_scene *scene, double time,
                            const ebpo_scene_clash *m)
{
    uint64_t pairs = m->touching + m->coplanar + m->crossing;
    printf("%.9g\t%s\t%s\t%s", time, clash_kind_word(m->kind), scene_instance_name(scene, m->a),
           scene_instance_name(scene, m->b));
    if (m->kind == EBPO_CLASH_ENCLOSED)
        printf("\t%s is inside",
               scene_instance_name(scene, m->relation == EBPO_A_INSIDE_B ? m->a : m->b));
    if (m->kind == EBPO_CLASH_NEAR)
        printf("\t%.9g of %.9g", m->distance, m->clearance);
    else if (v->count && pairs)
        printf("\t%llu %s of faces", (unsigned long long)pairs, pairs == 1 ? "pair" : "pairs");
    if (v->depth > 0) {
        depth_words("a", &m->depth[0]);
        depth_words("b", &m->depth[1]);
    }
    if (v->locations && isfinite(m->location[0]))
        printf("\tat %.9g %.9g %.9g", m->location[0], m->location[1], m->location[2]);
    putchar('\n');
}

/* State of a report: contacts in a scene at each of several times, called frames. */
typedef struct report {
    const scene_values *v;
    ebpo_scene *scene;
    ebpo_scene_clash_options clash_options;
    uint64_t found_clashes; /* number of clashes in all frames so far */
    uint64_t frames_found;  /* number of frames with clashes */
    uint64_t tested;        /* number of tested pairs of instances */
    scene_frame frame;      /* the current frame */
    uint64_t capacity;      /* capacity of frame.found_clashes */
    bool prints;            /* print rows on standard output */
    json j;
    const char *path;          /* path of the scene */
    uint64_t frames, reported; /* number of frames in all, and reported so far */
    /* The ending of v->out decides which of the next three members is set; the other two are NULL
     * or false. */
    ebpo_scene_report *record; /* .h5 */
    clash_strip *strip;        /* .png */
    bool page;                 /* .html */
    clash_list clashes;        /* all clashes, for the page */
} report;

/* --- a frame --- */

/* Copies the clashes into the frame; frame.found_clashes is NULL if there is not enough memory. */
static bool keep_clashes(void *user, const ebpo_scene_clash *found_clashes, uint64_t count)
{
    report *r = user;
    if (count > r->capacity) {
        free(r->frame.found_clashes);
        r->frame.found_clashes = malloc(count * sizeof *found_clashes);
        r->capacity = r->frame.found_clashes ? count : 0;
    }
    if (r->frame.found_clashes)
        memcpy(r->frame.found_clashes, found_clashes, count * sizeof *found_clashes);
    r->frame.count = count;
    return true;
}

static ebpo_status query_frame(report *r, double time, ebpo_error *error)
{
    ebpo_scene_stats before = EBPO_SCENE_STATS_INIT, after = EBPO_SCENE_STATS_INIT;
    scene_frame *f = &r->frame;
    double begun = progress_now();
    (void)ebpo_scene_get_stats(r->scene, &before);
    f->count = 0;
    f->cost = (ebpo_scene_frame){ .time = time };
    ebpo_status status = ebpo_scene_find_clashes(r->scene, time, &r->clash_options, keep_clashes, r,
                                                 &f->cost.tested, error);
    if (status == EBPO_OK && f->count && !f->found_clashes) {
        snprintf(error->message, sizeof error->message, "no memory for %llu clashes",
                 (unsigned long long)f->count);
        status = error->status = EBPO_E_MEMORY;
    }
    (void)ebpo_scene_get_stats(r->scene, &after);
    f->cost.nanoseconds = (uint64_t)((progress_now() - begun) * 1e9);
    f->cost.bytes_read = after.bytes_read - before.bytes_read;
    f->cost.models = after.models - before.models;
    f->cost.loads = after.loads - before.loads;
    r->tested += f->cost.tested;
    r->found_clashes += f->count;
    r->frames_found += f->count > 0;
    return status;
}

/* --- output of a frame --- */

static void frame_json(report *r)
{
    const ebpo_scene_frame *cost = &r->frame.cost;
    json_object(&r->j, NULL);
    json_real(&r->j, "time", cost->time);
    json_array(&r->j, "clashes");
    for (uint64_t i = 0; i < r->frame.count; i++)
        scene_row_json(&r->j, r->v, r->scene, &r->frame.found_clashes[i]);
    json_end(&r->j);
    json_uint(&r->j, "pairs_tested", cost->tested);
    json_real(&r->j, "seconds", (double)cost->nanoseconds * 1e-9);
    json_uint(&r->j, "bytes_read", cost->bytes_read);
    json_uint(&r->j, "models_read", cost->models);
    json_uint(&r->j, "loads", cost->loads);
    json_end(&r->j);
}

static void print_frame(report *r)
{
    const scene_frame *f = &r->frame;
    if (r->v->json)
        frame_json(r);
    for (uint64_t i = 0; i < f->count && !r->v->json; i++)
        (r->v->csv ? scene_row_csv : scene_row_words)(r->v, r->scene, f->cost.time,
                                                      &f->found_clashes[i]);
}

/* Returns true if the strip shows this frame. It shows all frames or, if there are more than
 * CLASH_TILES, frames at regular intervals. */
static bool is_pictured(const report *r)
{
    uint64_t n = r->reported, most = r->frames < CLASH_TILES ? r->frames : CLASH_TILES;
    return n == 0 || n * (most - 1) / (r->frames - 1) != (n - 1) * (most - 1) / (r->frames - 1);
}

static ebpo_status report_frame(report *r, ebpo_error *error)
{
    const scene_frame *f = &r->frame;
    ebpo_status status = EBPO_OK;
    if (r->prints)
        print_frame(r);
    if (r->record)
        status = ebpo_scene_report_add(r->record, &f->cost, f->found_clashes, f->count, error);
    if (r->page)
        status = clash_add(&r->clashes, f->cost.time, f->found_clashes, f->count, error);
    if (r->strip && is_pictured(r))
        status = clash_strip_add(r->strip, f->cost.time, f->found_clashes, f->count, error);
    r->reported++;
    return status;
}

static ebpo_status begin_strip(report *r, ebpo_error *error)
{
    const char *missing = clash_pictures_missing();
    int tiles = r->frames < CLASH_TILES ? (int)r->frames : CLASH_TILES;
    if (!missing)
        r->strip = clash_strip_new(r->scene, r->v->from, r->v->to, tiles, (unsigned)r->v->threads);
    if (r->strip)
        return EBPO_OK;
    snprintf(error->message, sizeof error->message, "%s: %s", r->v->out,
             missing ? missing : "no memory for the picture");
    return error->status = missing ? EBPO_E_UNSUPPORTED : EBPO_E_MEMORY;
}

static ebpo_status begin_report(report *r, ebpo_error *error)
{
    const char *out = r->v->out;
    if (r->prints && r->v->json) {
        json_begin(&r->j, stdout);
        json_object(&r->j, NULL);
        json_array(&r->j, "frames");
    } else if (r->prints && r->v->csv) {
        scene_head_csv(r->v);
    }
    if (out && words_end_with(out, ".png"))
        return begin_strip(r, error);
    return out && !r->page ? ebpo_scene_report_new(r->scene, out, &r->record, error) : EBPO_OK;
}

/* Pictures are drawn only for the worst clashes, at most this number. */
enum { PICTURES_MAX = 60 };

static ebpo_status write_page(report *r, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    clash_sort(&r->clashes);
    for (uint64_t i = 0; i < r->clashes.count && i < PICTURES_MAX && status == EBPO_OK; i++)
        status = clash_draw(r->scene, &r->clashes.clash[i], (unsigned)r->v->threads, error);
    return status == EBPO_OK ? clash_page(&r->clashes, r->scene, r->path, r->v->from, r->v->to,
                                          r->frames, r->v->out, error)
                             : status;
}

static ebpo_status finish_files(report *r, ebpo_error *error)
{
    if (r->record)
        return ebpo_scene_report_finish(r->record, error);
    if (r->strip)
        return clash_strip_write(r->strip, r->v->out, error);
    return r->page ? write_page(r, error) : EBPO_OK;
}

static void finish_report(report *r, double seconds)
{
    if (r->prints && r->v->json) {
        json_end(&r->j);
        json_uint(&r->j, "pairs_tested", r->tested);
        json_uint(&r->j, "pairs_clashing", r->found_clashes);
        json_real(&r->j, "seconds", seconds);
        json_finish(&r->j);
    } else if (!r->v->quiet) {
        char times[40], tested[40];
        words_plural(times, sizeof times, r->frames, "time", "times");
        words_plural(tested, sizeof tested, r->tested, "pair", "pairs");
        fprintf(stderr, "%s, %llu with contacts; %s tested, %llu in contact%s; %.3g s\n", times,
                (unsigned long long)r->frames_found, tested, (unsigned long long)r->found_clashes,
                r->clash_options.relate ? ""
                                        : " (enclosed instances are not checked without --solids)",
                seconds);
    }
}

/* --- all frames --- */

/* Returns the time of frame `n`; the last frame is at time v->to. */
static double time_of(const scene_values *v, uint64_t n, uint64_t frames)
{
    return n + 1 == frames ? v->to : v->from + v->step * (double)n;
}

static uint64_t frames_of(const scene_values *v)
{
    /* cmd_scene.c has checked that the number is not too large. The factor 1 - 2^-40 ignores
     * rounding errors, so that they do not add a frame. */
    return v->to > v->from ? 1 + (uint64_t)ceil((v->to - v->from) / v->step * (1 - 0x1p-40)) : 1;
}

ebpo_status scene_report(const scene_values *v, const char *path, ebpo_scene *scene,
                         ebpo_error *error)
{
    report r = { .v = v, .scene = scene, .clash_options = EBPO_SCENE_CLASH_OPTIONS_INIT };
    double begun = progress_now();
    progress_line line;
    r.path = path;
    r.frames = frames_of(v);
    r.page = v->out && words_end_with(v->out, ".html");
    r.prints = !v->out || v->csv || v->json;
    r.clash_options.count = v->count || r.page;
    r.clash_options.locations = v->locations || r.page;
    r.clash_options.relate = v->solids || v->depth > 0 || r.page;
    r.clash_options.depth = v->depth;
    r.clash_options.threads = (unsigned)v->threads;
    r.clash_options.progress = progress_start(&line, "scene", v->quiet);
    ebpo_status status = begin_report(&r, error);
    for (uint64_t n = 0; n < r.frames && status == EBPO_OK; n++) {
        status = query_frame(&r, time_of(v, n, r.frames), error);
        if (status == EBPO_OK)
            status = report_frame(&r, error);
    }
    if (status == EBPO_OK)
        status = finish_files(&r, error);
    progress_wipe(&line);
    if (status == EBPO_OK)
        finish_report(&r, progress_now() - begun);
    ebpo_scene_report_free(r.record);
    clash_strip_free(r.strip);
    clash_free(&r.clashes);
    free(r.frame.found_clashes);
    return status;
}
