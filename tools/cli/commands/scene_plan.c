#include "cli/commands/scene_plan.h"

#include <stdio.h>

#include "cli/json.h"
#include "cli/progress.h"
#include "cli/words.h"

/* State of the command while it prints needs. A model's need is the data that queries on the scene
 * can use.
 */
typedef struct plan {
    const scene_values *v;
    const ebpo_scene *scene;
    json j;              /* used with --json */
    uint64_t bytes;      /* needed bytes of all files */
    uint64_t file_bytes; /* sizes of all files */
} plan;

static const char *name_of(const ebpo_scene *scene, uint64_t model)
{
    ebpo_scene_model_facts m = EBPO_SCENE_MODEL_FACTS_INIT;
    (void)ebpo_scene_get_model_facts(scene, model, &m);
    return m.name;
}

/* Returns true if no earlier model uses the model's file. So the bytes of a file are counted once.
 */
static bool is_first(const ebpo_scene *scene, uint64_t model)
{
    for (uint64_t i = 0; i < model; i++)
        if (ebpo_scene_file(scene, i) == ebpo_scene_file(scene, model))
            return false;
    return true;
}

static void need_json(json *j, const ebpo_scene *scene, const ebpo_scene_need *need)
{
    json_text(j, "model", name_of(scene, need->model));
    json_uint(j, "pairs_using", need->users);
    json_int(j, "last_level", need->last_level);
    json_uint(j, "levels", (uint64_t)need->level_count);
    json_array(j, "parts");
    for (int i = 0; part_words[i]; i++)
        if (need->parts >> i & 1)
            json_text(j, NULL, part_words[i]);
    json_end(j);
    json_bool(j, "boxed", need->boxed);
    json_reals(j, "min", need->min, 3);
    json_reals(j, "max", need->max, 3);
    json_uint(j, "subtrees", need->subtrees);
    json_uint(j, "total_subtrees", need->total_subtrees);
    json_uint(j, "bytes", need->bytes);
    json_uint(j, "file_bytes", need->file_bytes);
}

static void need_words(const plan *p, const ebpo_scene_need *n)
{
    char bytes[32], whole[32], parts[64], levels[32], subtrees[64];
    snprintf(levels, sizeof levels, "0 to %d of %d", n->last_level, n->level_count);
    snprintf(subtrees, sizeof subtrees, "%llu of %llu", (unsigned long long)n->subtrees,
             (unsigned long long)n->total_subtrees);
    printf("%10s %10s  %-13s %13s  %s: ", words_bytes(bytes, sizeof bytes, n->bytes),
           words_bytes(whole, sizeof whole, n->file_bytes), levels, subtrees,
           name_of(p->scene, n->model));
    printf("%s", n->parts ? words_parts(parts, sizeof parts, n->parts) : "nodes");
    if (n->boxed)
        printf("; within %.9g,%.9g,%.9g,%.9g,%.9g,%.9g", n->min[0], n->min[1], n->min[2], n->max[0],
               n->max[1], n->max[2]);
    putchar('\n');
}

static bool print_needs(void *user, const ebpo_scene_need *needs, uint64_t count)
{
    plan *p = user;
    if (!p->v->json)
        printf("%10s %10s  %-13s %13s  model: parts\n", "bytes", "file", "levels", "subtrees");
    for (uint64_t i = 0; i < count; i++) {
        bool first = is_first(p->scene, needs[i].model);
        p->bytes += first ? needs[i].bytes : 0;
        p->file_bytes += first ? needs[i].file_bytes : 0;
        if (!p->v->json) {
            need_words(p, &needs[i]);
            continue;
        }
        json_object(&p->j, NULL);
        need_json(&p->j, p->scene, &needs[i]);
        json_end(&p->j);
    }
    return true;
}

ebpo_status scene_plan(const scene_values *v, const char *path, ebpo_scene *scene,
                       ebpo_error *error)
{
    plan p = { .v = v, .scene = scene };
    ebpo_plan_options plan_options = EBPO_PLAN_OPTIONS_INIT;
    progress_line line;
    (void)path;
    plan_options.margin = v->margin;
    plan_options.purpose = v->purpose;
    plan_options.progress = progress_start(&line, "scene", v->quiet);
    json_begin(&p.j, stdout);
    if (v->json) {
        json_object(&p.j, NULL);
        json_real(&p.j, "from", v->from);
        json_real(&p.j, "to", v->to);
        json_array(&p.j, "models");
    }
    ebpo_status status =
        ebpo_scene_plan(scene, v->from, v->to, &plan_options, print_needs, &p, error);
    progress_wipe(&line);
    if (v->json) {
        json_end(&p.j);
        json_uint(&p.j, "bytes", p.bytes);
        json_uint(&p.j, "file_bytes", p.file_bytes);
        json_finish(&p.j);
    } else if (status == EBPO_OK && !v->quiet) {
        char bytes[32], whole[32];
        fprintf(stderr, "%s of %s are needed for times from %g to %g\n",
                words_bytes(bytes, sizeof bytes, p.bytes),
                words_bytes(whole, sizeof whole, p.file_bytes), v->from, v->to);
    }
    return status;
}

/* ---- packing ---- */

/* State while the written files are printed. */
typedef struct pack {
    const scene_values *v;
    const ebpo_scene *scene;
    json j;                /* used with --json */
    uint64_t bytes;        /* sizes of all written files */
    uint64_t source_bytes; /* sizes of the files from which they were made */
} pack;

static void packed_json(pack *p, const ebpo_scene_packed *m)
{
    char digest[65], source[65];
    words_hex(m->digest, digest);
    words_hex(m->source_digest, source);
    json_object(&p->j, NULL);
    json_text(&p->j, "model", name_of(p->scene, m->model));
    json_uint(&p->j, "bytes", m->bytes);
    json_uint(&p->j, "source_bytes", m->source_bytes);
    json_uint(&p->j, "bytes_read", m->bytes_read);
    json_real(&p->j, "max_error", m->max_error);
    json_bool(&p->j, "complete", m->complete);
    json_text(&p->j, "content_sha256", digest);
    json_text(&p->j, "subset_of", source);
    json_end(&p->j);
}

static void packed_words(const pack *p, const ebpo_scene_packed *m)
{
    char bytes[32], whole[32], read[32];
    printf("%10s %10s %10s  %s", words_bytes(bytes, sizeof bytes, m->bytes),
           words_bytes(whole, sizeof whole, m->source_bytes),
           words_bytes(read, sizeof read, m->bytes_read), name_of(p->scene, m->model));
    if (m->max_error > 0)
        printf(": with an error of at most %.6g", m->max_error);
    puts(m->complete ? "" : "; exact queries are refused");
}

static bool print_packed(void *user, const ebpo_scene_packed *models, uint64_t count)
{
    pack *p = user;
    if (!p->v->json && !p->v->quiet)
        printf("%10s %10s %10s  model\n", "bytes", "file", "read");
    for (uint64_t i = 0; i < count; i++) {
        bool first = is_first(p->scene, models[i].model);
        p->bytes += first ? models[i].bytes : 0;
        p->source_bytes += first ? models[i].source_bytes : 0;
        if (p->v->json)
            packed_json(p, &models[i]);
        else if (!p->v->quiet)
            packed_words(p, &models[i]);
    }
    return true;
}

static void report_packed(pack *p)
{
    if (p->v->json) {
        json_end(&p->j);
        json_uint(&p->j, "bytes", p->bytes);
        json_uint(&p->j, "source_bytes", p->source_bytes);
        json_finish(&p->j);
    } else if (!p->v->quiet) {
        char bytes[32], whole[32];
        fprintf(stderr,
                "packed %s of the models' %s for times from %g to %g; the scene is "
                "%s/packed.scene.json\n",
                words_bytes(bytes, sizeof bytes, p->bytes),
                words_bytes(whole, sizeof whole, p->source_bytes), p->v->from, p->v->to, p->v->out);
    }
}

ebpo_status scene_pack(const scene_values *v, const char *path, ebpo_scene *scene,
                       ebpo_error *error)
{
    pack p = { .v = v, .scene = scene };
    ebpo_pack_options pack_options = EBPO_PACK_OPTIONS_INIT;
    progress_line line;
    (void)path;
    pack_options.margin = v->margin;
    pack_options.purpose = v->purpose;
    pack_options.threads = (unsigned)v->threads;
    if (v->target_size) /* already checked by the command */
        (void)words_read_size(v->target_size, &pack_options.target_bytes);
    pack_options.progress = progress_start(&line, "scene", v->quiet);
    json_begin(&p.j, stdout);
    if (v->json) {
        json_object(&p.j, NULL);
        json_array(&p.j, "models");
    }
    ebpo_status status =
        ebpo_scene_pack(scene, v->out, v->from, v->to, &pack_options, print_packed, &p, error);
    progress_wipe(&line);
    if (status == EBPO_OK)
        report_packed(&p);
    return status;
}
