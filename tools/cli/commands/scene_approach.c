/* When instances of a scene first come near each other; and how near they come. */
#include <stdio.h>

#include "cli/json.h"
#include "cli/progress.h"
#include "cli/words.h"
#include "cli/commands/scene_report.h"

typedef struct listing {
    const scene_values *v;
    const ebpo_scene *scene;
    json j;
    uint64_t reached, open, looks, ways;
} listing;

static const char *name_of(const listing *l, uint64_t instance)
{
    ebpo_scene_instance i = EBPO_SCENE_INSTANCE_INIT;
    (void)ebpo_scene_get_instance(l->scene, instance, &i);
    return i.name;
}

static const char *word_of(const ebpo_scene_way *w)
{
    return w->reached > 0 ? "reached" : w->reached == 0 ? "apart" : "open";
}

static void way_json(listing *l, const ebpo_scene_way *w)
{
    json *j = &l->j;
    json_object(j, NULL);
    json_text(j, "a", name_of(l, w->a));
    json_text(j, "b", name_of(l, w->b));
    json_text(j, "result", word_of(w));
    json_real(j, "time", w->time);
    json_real(j, "distance_lo", w->lo);
    json_real(j, "distance_hi", w->hi);
    json_real(j, "clearance", w->clearance);
    json_uint(j, "looks", w->looks);
    json_end(j);
}

/* Bounds are bounds to their last digit. */
static void print_way(const listing *l, const ebpo_scene_way *w)
{
    char time[32], lo[32], hi[32];
    printf("%s\t%s\t%s\t%s\t", words_real(w->time, time), word_of(w), name_of(l, w->a),
           name_of(l, w->b));
    if (w->reached < 0)
        printf("%s to ", words_real(w->lo, lo));
    printf("%s\n", words_real(w->hi, hi));
}

static bool print_ways(void *user, const ebpo_scene_way *ways, uint64_t count)
{
    listing *l = user;
    l->ways += count;
    for (uint64_t i = 0; i < count; i++) {
        const ebpo_scene_way *w = &ways[i];
        l->reached += w->reached > 0;
        l->open += w->reached < 0;
        l->looks += w->looks;
        if (l->v->json)
            way_json(l, w);
        else
            print_way(l, w);
    }
    return true;
}

/* So many looks as are allowed, or what files lack, left more in doubt than was asked for. */
static bool is_open(const listing *l, const ebpo_scene_least *w)
{
    return w->hi - w->lo > l->v->tolerance;
}

static void least_json(listing *l, const ebpo_scene_least *w)
{
    json *j = &l->j;
    json_object(j, NULL);
    json_text(j, "a", name_of(l, w->a));
    json_text(j, "b", name_of(l, w->b));
    json_real(j, "time", w->time);
    json_real(j, "distance_lo", w->lo);
    json_real(j, "distance_hi", w->hi);
    json_bool(j, "open", is_open(l, w));
    json_real(j, "clearance", w->clearance);
    json_uint(j, "looks", w->looks);
    json_end(j);
}

static void print_least(const listing *l, const ebpo_scene_least *w, bool open)
{
    char time[32], lo[32], hi[32];
    printf("%s\tleast\t%s\t%s\t%s to %s%s\n", words_real(w->time, time), name_of(l, w->a),
           name_of(l, w->b), words_real(w->lo, lo), words_real(w->hi, hi), open ? "\topen" : "");
}

static bool print_leasts(void *user, const ebpo_scene_least *list, uint64_t count)
{
    listing *l = user;
    l->ways += count;
    for (uint64_t i = 0; i < count; i++) {
        const ebpo_scene_least *w = &list[i];
        l->reached += w->lo <= w->clearance;
        bool open = is_open(l, w);
        l->open += open;
        l->looks += w->looks;
        if (l->v->json)
            least_json(l, w);
        else
            print_least(l, w, open);
    }
    return true;
}

ebpo_status scene_approach(const scene_values *v, const char *path, ebpo_scene *scene,
                           ebpo_error *error)
{
    listing l = { .v = v, .scene = scene };
    ebpo_scene_way_options how = EBPO_SCENE_WAY_OPTIONS_INIT;
    progress_line line;
    double begun = progress_now();
    (void)path;
    how.tolerance = v->tolerance;
    how.threads = (unsigned)v->threads;
    how.progress = progress_start(&line, "scene", v->quiet);
    json_begin(&l.j, stdout);
    if (v->json) {
        json_object(&l.j, NULL);
        json_array(&l.j, v->least ? "least" : "approaches");
    }
    ebpo_status status =
        v->least ? ebpo_scene_least_distances(scene, v->from, v->to, &how, print_leasts, &l, error)
                 : ebpo_scene_approach(scene, v->from, v->to, &how, print_ways, &l, error);
    progress_wipe(&line);
    if (status != EBPO_OK)
        return status;
    if (v->json)
        json_finish(&l.j);
    else if (!v->quiet)
        fprintf(stderr, "%s: %llu come near, %llu open; %llu looks; %.3g s\n",
                words_plural((char[40]){ 0 }, 40, l.ways, "pair", "pairs"),
                (unsigned long long)l.reached, (unsigned long long)l.open,
                (unsigned long long)l.looks, progress_now() - begun);
    return status;
}
