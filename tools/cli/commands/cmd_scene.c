/* ebpo scene: queries rigid and animated instances of models. */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/command.h"
#include "cli/commands/commands.h"
#include "cli/commands/scene_plan.h"
#include "cli/commands/scene_report.h"
#include "cli/commands/scene_run.h"
#include "cli/json.h"
#include "cli/progress.h"
#include "cli/words.h"

/* --- contents, boxes and pairs --- */

/* Totals of a scene. */
typedef struct scene_sums {
    uint64_t bytes, faces; /* sums over model files; a file of several models counts once */
    uint64_t posed_faces;  /* sum of the faces of all instances */
} scene_sums;

static scene_sums sum_models(const ebpo_scene *scene, uint64_t models)
{
    scene_sums s = { 0 };
    for (uint64_t i = 0; i < models; i++) {
        ebpo_scene_model_facts m = EBPO_SCENE_MODEL_FACTS_INIT;
        const ebpo_file *file = ebpo_scene_file(scene, i);
        (void)ebpo_scene_get_model_facts(scene, i, &m);
        bool is_new_file = true;
        for (uint64_t k = 0; k < i && is_new_file; k++)
            is_new_file = ebpo_scene_file(scene, k) != file;
        s.bytes += is_new_file ? ebpo_file_info(file)->file_bytes : 0;
        s.faces += is_new_file ? ebpo_file_info(file)->face_count : 0;
        s.posed_faces += ebpo_file_info(file)->face_count * m.instances;
    }
    return s;
}

static void info_json(const char *path, const ebpo_scene *scene, const ebpo_scene_counts *c,
                      double box[2][3])
{
    json j;
    scene_sums s = sum_models(scene, c->models);
    json_begin(&j, stdout);
    json_object(&j, NULL);
    json_text(&j, "scene", path);
    json_uint(&j, "instances", c->instances);
    json_uint(&j, "fixed", c->fixed);
    json_uint(&j, "layers", c->layers);
    json_uint(&j, "groups", c->groups);
    json_uint(&j, "routes", c->routes);
    json_uint(&j, "poses", c->poses);
    json_uint(&j, "cameras", c->cameras);
    json_uint(&j, "ignored", c->ignored);
    json_uint(&j, "clearances", c->clearances);
    json_real(&j, "begin", c->begin);
    json_real(&j, "end", c->end);
    json_reals(&j, "min", box[0], 3);
    json_reals(&j, "max", box[1], 3);
    json_uint(&j, "bytes", s.bytes);
    json_uint(&j, "faces", s.faces);
    json_uint(&j, "posed_faces", s.posed_faces);
    json_array(&j, "models");
    for (uint64_t i = 0; i < c->models; i++) {
        ebpo_scene_model_facts m = EBPO_SCENE_MODEL_FACTS_INIT;
        (void)ebpo_scene_get_model_facts(scene, i, &m);
        json_object(&j, NULL);
        json_text(&j, "name", m.name);
        json_text(&j, "file", m.path);
        json_uint(&j, "instances", m.instances);
        json_uint(&j, "faces", ebpo_file_info(ebpo_scene_file(scene, i))->face_count);
        json_uint(&j, "bytes", ebpo_file_info(ebpo_scene_file(scene, i))->file_bytes);
        json_reals(&j, "min", m.min, 3);
        json_reals(&j, "max", m.max, 3);
        json_end(&j);
    }
    json_finish(&j);
}

static const char *count_words(char out[40], uint64_t count, const char *one, const char *many)
{
    return words_plural(out, 40, count, one, many);
}

static void info_words(const char *path, const ebpo_scene *scene, const ebpo_scene_counts *c,
                       double box[2][3])
{
    scene_sums s = sum_models(scene, c->models);
    char text[2][40];
    printf("%s: %s of %s\n", path, count_words(text[0], c->instances, "instance", "instances"),
           count_words(text[1], c->models, "model", "models"));
    printf("fixed      %s\nlayers     %llu\ngroups     %llu\nroutes     %llu, %s\n",
           count_words(text[0], c->fixed, "instance", "instances"), (unsigned long long)c->layers,
           (unsigned long long)c->groups, (unsigned long long)c->routes,
           count_words(text[1], c->poses, "pose", "poses"));
    printf("cameras    %llu\nignored    %s\nclearances %s\n", (unsigned long long)c->cameras,
           count_words(text[0], c->ignored, "rule", "rules"),
           count_words(text[1], c->clearances, "rule", "rules"));
    printf("time       %g to %g\n", c->begin, c->end);
    printf("box        %.9g %.9g %.9g to %.9g %.9g %.9g\n", box[0][0], box[0][1], box[0][2],
           box[1][0], box[1][1], box[1][2]);
    printf("faces      %llu in files, %llu in the scene\nbytes      %llu\n\n",
           (unsigned long long)s.faces, (unsigned long long)s.posed_faces,
           (unsigned long long)s.bytes);
    printf("%9s %11s %12s  model\n", "instances", "faces", "bytes");
    for (uint64_t i = 0; i < c->models; i++) {
        ebpo_scene_model_facts m = EBPO_SCENE_MODEL_FACTS_INIT;
        const ebpo_info *info = ebpo_file_info(ebpo_scene_file(scene, i));
        (void)ebpo_scene_get_model_facts(scene, i, &m);
        printf("%9llu %11llu %12llu  %s\n", (unsigned long long)m.instances,
               (unsigned long long)info->face_count, (unsigned long long)info->file_bytes, m.name);
    }
}

static ebpo_status scene_info(const scene_values *v, const char *path, ebpo_scene *scene,
                              ebpo_error *error)
{
    double box[2][3];
    ebpo_scene_counts c = EBPO_SCENE_COUNTS_INIT;
    (void)ebpo_scene_get_counts(scene, &c);
    ebpo_status status = ebpo_scene_box(scene, c.begin, c.end, box[0], box[1], error);
    if (status == EBPO_OK)
        (v->json ? info_json : info_words)(path, scene, &c, box);
    return status;
}

/* Checks the checksums of all models, and reports that the scene is valid. Other properties were
 * checked when the scene was opened. */
static ebpo_status scene_check(const scene_values *v, const char *path, ebpo_scene *scene,
                               ebpo_error *error)
{
    ebpo_scene_counts c = EBPO_SCENE_COUNTS_INIT;
    (void)ebpo_scene_get_counts(scene, &c);
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < c.models && status == EBPO_OK; i++)
        status = ebpo_file_check_content(ebpo_scene_file(scene, i), NULL, error);
    if (status == EBPO_OK && v->json) {
        json j;
        json_begin(&j, stdout);
        json_object(&j, NULL);
        json_text(&j, "scene", path);
        json_uint(&j, "models", c.models);
        json_finish(&j);
    } else if (status == EBPO_OK && !v->quiet)
        printf("%s: OK: %s, all contents match their checksums\n", path,
               words_plural((char[40]){ 0 }, 40, c.models, "model", "models"));
    return status;
}

static ebpo_status scene_boxes(const scene_values *v, const char *path, ebpo_scene *scene,
                               ebpo_error *error)
{
    json j;
    ebpo_status status = EBPO_OK;
    ebpo_scene_instance instance = EBPO_SCENE_INSTANCE_INIT;
    (void)path;
    json_begin(&j, stdout);
    if (v->json) {
        json_object(&j, NULL);
        json_array(&j, "boxes");
    }
    for (uint64_t i = 0; ebpo_scene_get_instance(scene, i, &instance) == EBPO_OK; i++) {
        double min[3], max[3];
        status = ebpo_scene_instance_box(scene, i, v->from, v->to, min, max, error);
        if (status != EBPO_OK)
            return status;
        if (v->json) {
            json_object(&j, NULL);
            json_text(&j, "instance", instance.name);
            json_reals(&j, "min", min, 3);
            json_reals(&j, "max", max, 3);
            json_end(&j);
        } else {
            const double box[] = { min[0], min[1], min[2], max[0], max[1], max[2] };
            words_print_reals(box, 6, " ");
            printf("\t%s\n", instance.name);
        }
    }
    if (v->json)
        json_finish(&j);
    return status;
}

typedef struct pair_print {
    const scene_values *v;
    const ebpo_scene *scene;
    json j;
} pair_print;

static bool print_pairs(void *user, const ebpo_scene_pair *pairs, uint64_t count)
{
    pair_print *p = user;
    for (uint64_t i = 0; i < count; i++) {
        ebpo_scene_instance a = EBPO_SCENE_INSTANCE_INIT, b = EBPO_SCENE_INSTANCE_INIT;
        (void)ebpo_scene_get_instance(p->scene, pairs[i].a, &a);
        (void)ebpo_scene_get_instance(p->scene, pairs[i].b, &b);
        if (p->v->json) {
            json_object(&p->j, NULL);
            json_text(&p->j, "a", a.name);
            json_text(&p->j, "b", b.name);
            json_real(&p->j, "clearance", pairs[i].clearance);
            json_end(&p->j);
        } else {
            printf("%s\t%s\t%s\n", a.name, b.name, words_real(pairs[i].clearance, (char[32]){ 0 }));
        }
    }
    return true;
}

static ebpo_status scene_pairs(const scene_values *v, const char *path, ebpo_scene *scene,
                               ebpo_error *error)
{
    pair_print p = { .v = v, .scene = scene };
    (void)path;
    json_begin(&p.j, stdout);
    if (v->json) {
        json_object(&p.j, NULL);
        json_array(&p.j, "pairs");
    }
    ebpo_status status = ebpo_scene_pairs(scene, v->from, v->to, print_pairs, &p, error);
    if (v->json)
        json_finish(&p.j);
    return status;
}

/* --- approaches: times when instances first come near each other, or least distances --- */

/* State while pairs of instances are printed. */
typedef struct pair_list {
    const scene_values *v;
    const ebpo_scene *scene;
    json j;                      /* used with --json */
    uint64_t reached, undecided; /* numbers of pairs that come near, and of undecided pairs */
    uint64_t evaluations;        /* number of times at which distances were computed */
    uint64_t approaches;         /* number of pairs */
} pair_list;

static const char *name_of(const pair_list *l, uint64_t instance)
{
    ebpo_scene_instance i = EBPO_SCENE_INSTANCE_INIT;
    (void)ebpo_scene_get_instance(l->scene, instance, &i);
    return i.name;
}

static const char *word_of(const ebpo_scene_approach_result *result)
{
    return result->reached > 0 ? "reached" : result->reached == 0 ? "apart" : "undecided";
}

static void approach_json(pair_list *l, const ebpo_scene_approach_result *result)
{
    json *j = &l->j;
    json_object(j, NULL);
    json_text(j, "a", name_of(l, result->a));
    json_text(j, "b", name_of(l, result->b));
    json_text(j, "result", word_of(result));
    json_real(j, "time", result->time);
    json_real(j, "distance_lo", result->lo);
    json_real(j, "distance_hi", result->hi);
    json_real(j, "clearance", result->clearance);
    json_uint(j, "evaluations", result->evaluations);
    json_end(j);
}

/* Prints an approach in one line, with all digits of the bounds. */
static void print_approach(const pair_list *l, const ebpo_scene_approach_result *result)
{
    char time[32], lo[32], hi[32];
    printf("%s\t%s\t%s\t%s\t", words_real(result->time, time), word_of(result),
           name_of(l, result->a), name_of(l, result->b));
    if (result->reached < 0)
        printf("%s to ", words_real(result->lo, lo));
    printf("%s\n", words_real(result->hi, hi));
}

static bool print_approaches(void *user, const ebpo_scene_approach_result *approaches,
                             uint64_t count)
{
    pair_list *l = user;
    l->approaches += count;
    for (uint64_t i = 0; i < count; i++) {
        const ebpo_scene_approach_result *result = &approaches[i];
        l->reached += result->reached > 0;
        l->undecided += result->reached < 0;
        l->evaluations += result->evaluations;
        if (l->v->json)
            approach_json(l, result);
        else
            print_approach(l, result);
    }
    return true;
}

/* Returns true if the interval is wider than requested. The reason is the limit of evaluations, or
 * data that files lack. */
static bool is_undecided(const pair_list *l, const ebpo_scene_least *result)
{
    return result->hi - result->lo > l->v->tolerance;
}

static void least_json(pair_list *l, const ebpo_scene_least *result)
{
    json *j = &l->j;
    json_object(j, NULL);
    json_text(j, "a", name_of(l, result->a));
    json_text(j, "b", name_of(l, result->b));
    json_real(j, "time", result->time);
    json_real(j, "distance_lo", result->lo);
    json_real(j, "distance_hi", result->hi);
    json_bool(j, "undecided", is_undecided(l, result));
    json_real(j, "clearance", result->clearance);
    json_uint(j, "evaluations", result->evaluations);
    json_end(j);
}

static void print_least(const pair_list *l, const ebpo_scene_least *result, bool undecided)
{
    char time[32], lo[32], hi[32];
    printf("%s\tleast\t%s\t%s\t%s to %s%s\n", words_real(result->time, time), name_of(l, result->a),
           name_of(l, result->b), words_real(result->lo, lo), words_real(result->hi, hi),
           undecided ? "\tundecided" : "");
}

static bool print_leasts(void *user, const ebpo_scene_least *list, uint64_t count)
{
    pair_list *l = user;
    l->approaches += count;
    for (uint64_t i = 0; i < count; i++) {
        const ebpo_scene_least *result = &list[i];
        l->reached += result->lo <= result->clearance;
        bool undecided = is_undecided(l, result);
        l->undecided += undecided;
        l->evaluations += result->evaluations;
        if (l->v->json)
            least_json(l, result);
        else
            print_least(l, result, undecided);
    }
    return true;
}

static ebpo_status scene_approach(const scene_values *v, const char *path, ebpo_scene *scene,
                                  ebpo_error *error)
{
    pair_list l = { .v = v, .scene = scene };
    ebpo_scene_approach_options approach_options = EBPO_SCENE_APPROACH_OPTIONS_INIT;
    progress_line line;
    double begun = progress_now();
    (void)path;
    approach_options.tolerance = v->tolerance;
    approach_options.threads = (unsigned)v->threads;
    approach_options.progress = progress_start(&line, "scene", v->quiet);
    json_begin(&l.j, stdout);
    if (v->json) {
        json_object(&l.j, NULL);
        json_array(&l.j, v->least ? "least" : "approaches");
    }
    ebpo_status status = v->least
                             ? ebpo_scene_least_distances(scene, v->from, v->to, &approach_options,
                                                          print_leasts, &l, error)
                             : ebpo_scene_approach(scene, v->from, v->to, &approach_options,
                                                   print_approaches, &l, error);
    progress_wipe(&line);
    if (status != EBPO_OK)
        return status;
    if (v->json)
        json_finish(&l.j);
    else if (!v->quiet)
        fprintf(stderr, "%s: %llu come near, %llu undecided; %llu evaluations; %.3g s\n",
                words_plural((char[40]){ 0 }, 40, l.approaches, "pair", "pairs"),
                (unsigned long long)l.reached, (unsigned long long)l.undecided,
                (unsigned long long)l.evaluations, progress_now() - begun);
    return status;
}

/* --- the command --- */

static const char *const purpose_words[] = { "collide", "view", "inside", "solids", NULL };

#include "cli/options/scene.inc"

/* Sets v->from and v->to. With --from, --to or --step, sets the given times; a missing --from is
 * the first time of the scene, and a missing --to the last time. With --time, sets both to this
 * time. Without any of these options, sets the first and the last time of the scene if `spans`,
 * otherwise sets both to the first time. Returns NULL, or a text that says what is wrong. */
static const char *set_times(scene_values *v, bool spans, const ebpo_scene *scene)
{
    ebpo_scene_counts c = EBPO_SCENE_COUNTS_INIT;
    (void)ebpo_scene_get_counts(scene, &c);
    bool span_given = !isnan(v->from) || !isnan(v->to) || v->step > 0;
    if (span_given && !isnan(v->time))
        return "--time cannot be used with --from, --to or --step";
    if (!span_given && !(spans && isnan(v->time))) {
        v->from = v->to = isnan(v->time) ? c.begin : v->time;
    } else {
        v->from = isnan(v->from) ? c.begin : v->from;
        v->to = isnan(v->to) ? c.end : v->to;
    }
    return v->from <= v->to ? NULL : "--from must not be after --to";
}

enum { FRAMES_MAX = 10000000 };

/* Checks the options of a report. Returns NULL, or a text that says what is wrong. */
static const char *check_report(const scene_values *v)
{
    if (v->json && v->csv)
        return "--json and --csv cannot be used together";
    if (v->out && !words_end_with(v->out, ".h5") && !words_end_with(v->out, ".html") &&
        !words_end_with(v->out, ".png"))
        return "--output of a report must end in .h5, .html or .png";
    if (v->to > v->from && !(v->step > 0))
        return "a report from one time to another needs --step";
    if (v->to > v->from && !((v->to - v->from) / v->step < FRAMES_MAX))
        return "--step is too small: a report has at most ten million times";
    return NULL;
}

/* Returns true, after a message, if the output is the scene file or the file of a model, or without
 * memory. */
static bool overwrites_input(const ebpo_scene *scene, const char *path, const char *out)
{
    ebpo_scene_model_facts m = EBPO_SCENE_MODEL_FACTS_INIT;
    bool overwrites = command_overwrites("scene", path, out);
    for (uint64_t i = 0; !overwrites && ebpo_scene_get_model_facts(scene, i, &m) == EBPO_OK; i++) {
        char *file = command_path_in_scene(path, m.path);
        overwrites =
            file ? command_overwrites("scene", file, out) : command_no_memory("scene") != EXIT_OK;
        free(file);
    }
    return overwrites;
}

static const struct {
    const char *name;
    ebpo_status (*run)(const scene_values *v, const char *path, ebpo_scene *scene,
                       ebpo_error *error);
} subcommands[] = {
    { "info", scene_info },   { "check", scene_check },   { "boxes", scene_boxes },
    { "pairs", scene_pairs }, { "report", scene_report }, { "approach", scene_approach },
    { "plan", scene_plan },   { "pack", scene_pack },
};
enum { SUBCOMMANDS = sizeof subcommands / sizeof *subcommands };

/* Returns true if the subcommand covers all times of the scene by default, not one time. */
static bool needs_span(int subcommand)
{
    return subcommands[subcommand].run == scene_approach ||
           subcommands[subcommand].run == scene_plan || subcommands[subcommand].run == scene_pack;
}

/* Sets the purpose of a plan. --solids and --depth, which are options of a report, have the effect
 * of --for solids. Returns NULL, or a text that says what is wrong. */
static const char *set_purpose(scene_values *v)
{
    if (!v->solids && !(v->depth > 0))
        return NULL;
    if (v->purpose != EBPO_SCENE_FOR_COLLIDE && v->purpose != EBPO_SCENE_FOR_RELATIONS)
        return "--solids and --depth cannot be used with --for view or --for inside";
    v->purpose = EBPO_SCENE_FOR_RELATIONS;
    return NULL;
}

/* Checks the options of the subcommand, and sets the options for loading. Returns NULL, or a text
 * that says what is wrong. */
static const char *check_options(int subcommand, scene_values *v, ebpo_load_options *load)
{
    uint64_t target;
    if (subcommands[subcommand].run == scene_approach && !(v->tolerance > 0))
        return "approach needs --tolerance";
    if (subcommands[subcommand].run == scene_pack && !v->out)
        return "pack needs -o DIR";
    if (v->target_size && (!words_read_size(v->target_size, &target) || !target))
        return "--target-size expects " WORDS_SIZE_EXPECTED;
    if (v->memory && !words_read_size(v->memory, &load->memory))
        return "--memory expects " WORDS_SIZE_EXPECTED;
    if (subcommands[subcommand].run == scene_plan || subcommands[subcommand].run == scene_pack)
        return set_purpose(v);
    return subcommands[subcommand].run == scene_report ? check_report(v) : NULL;
}

static int run_scene(void *given, const char **operand)
{
    scene_values *v = given;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_scene *scene = NULL;
    int subcommand = 0;
    while (subcommand < SUBCOMMANDS && strcmp(operand[0], subcommands[subcommand].name) != 0)
        subcommand++;
    if (subcommand == SUBCOMMANDS)
        return command_usage(
            "scene", "'%s' is not one of info, check, boxes, pairs, report, approach, plan, pack",
            operand[0]);
    ebpo_scene_options scene_options = EBPO_SCENE_OPTIONS_INIT;
    ebpo_load_options load = EBPO_LOAD_OPTIONS_INIT;
    load.max_expansion = (uint64_t)v->max_expansion;
    scene_options.allow_outside = v->outside;
    scene_options.remote = v->remote;
    const char *problem = NULL;
    ebpo_status status = ebpo_scene_open(operand[1], &scene_options, &scene, &error);
    if (status == EBPO_OK)
        problem = set_times(v, needs_span(subcommand), scene);
    if (status == EBPO_OK && !problem)
        problem = check_options(subcommand, v, &load);
    if (problem) {
        ebpo_scene_free(scene);
        return command_usage("scene", "%s", problem);
    }
    if (status == EBPO_OK && v->out && overwrites_input(scene, operand[1], v->out)) {
        ebpo_scene_free(scene);
        return EXIT_USAGE;
    }
    progress_line line;
    load.progress = progress_start(&line, "scene", v->quiet);
    if (status == EBPO_OK)
        status = ebpo_scene_load(scene, &load, &error);
    progress_wipe(&line);
    if (status == EBPO_OK)
        status = subcommands[subcommand].run(v, operand[1], scene, &error);
    ebpo_scene_free(scene);
    return status == EBPO_OK ? EXIT_OK : command_failed("scene", &error);
}

static const scene_values standard = SCENE_VALUES_INIT;

const command command_scene = { &spec, sizeof standard, &standard, run_scene };
