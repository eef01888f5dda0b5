/* ebpo collide: finds intersecting faces of two models, and the distance between the models. */
#include <float.h>
#include <inttypes.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/collide.h>
#include <ebpo/http.h>
#include <ebpo/memory.h>

#include "cli/command.h"
#include "cli/commands/commands.h"
#include "cli/json.h"
#include "cli/model_memory.h"
#include "cli/pose_args.h"
#include "cli/progress.h"
#include "cli/query_args.h"
#include "cli/words.h"

/* --- measures: distance, depth and separation --- */

/* Values of the options for measures. */
typedef struct measure_values {
    bool distance, depth;
    double tolerance;       /* 0: not given */
    double at_least;        /* below 0: not given */
    const char *separation; /* the direction as text, X Y Z; NULL: not given */
    double direction[3];    /* `separation` as numbers, set by measures_fit */
} measure_values;

#define MEASURE_VALUES_INIT                        \
    {                                              \
        false, false, 0.0, -1.0, NULL, { 0, 0, 0 } \
    }

/* --- relation of models --- */

/* Names, indexed by ebpo_relation. */
static const char *const collide_relations[] = { "DISJOINT",   "TOUCHING",   "INTERSECTING",
                                                 "A_INSIDE_B", "B_INSIDE_A", "EQUAL",
                                                 "not known" };

/* Finds the relation of two models for which a query returned no intersecting faces. *relation: the
 * name of the ebpo_relation to print. It is NULL if the models are DISJOINT or if faces intersect,
 * because then no relation is printed. */
static ebpo_status find_relation(ebpo_collider *c, const ebpo_collide_options *collide_options,
                                 const char **relation, ebpo_error *error)
{
    ebpo_relation_result r;
    *relation = NULL;
    ebpo_status status = ebpo_collide_relation(c, collide_options, &r, error);
    if (status == EBPO_OK && r.relation != EBPO_DISJOINT && r.contact != 1)
        *relation = collide_relations[r.relation];
    if (status != EBPO_E_ABSENT && status != EBPO_E_LIMIT)
        return status;
    *error = (ebpo_error)EBPO_ERROR_INIT; /* not an error: the data is not in the subset */
    *relation = collide_relations[EBPO_RELATION_UNDECIDED];
    return EBPO_OK;
}

/* Prints the relation at the end of the line as " NAME", or as a member of JSON. If `relation` is
 * NULL, prints nothing. */
static void print_relation(bool as_json, const char *relation)
{
    bool undecided = relation == collide_relations[EBPO_RELATION_UNDECIDED];
    if (relation && as_json)
        printf(undecided ? ", \"relation\": null" : ", \"relation\": \"%s\"", relation);
    else if (relation)
        printf(" %s", relation);
}

/* --- options --- */

/* Reads three numbers separated by blanks or commas. */
static bool read_direction(const char *text, double out[3])
{
    for (int k = 0; k < 3; k++) {
        char *end;
        text += strspn(text, k ? " ,\t" : " \t");
        out[k] = strtod(text, &end);
        if (end == text)
            return false;
        text = end;
    }
    return text[strspn(text, " \t")] == '\0';
}

static bool measures_requested(const measure_values *f)
{
    return f->distance || f->depth || f->separation;
}

/* Checks the options for measures, and sets f->direction. Returns false, with a message on standard
 * error, if options cannot be combined or are invalid. all_or_self: --all or --self was given. */
static bool measures_fit(measure_values *f, bool all_or_self)
{
    const char *message = NULL;
    if ((measures_requested(f) && all_or_self) ||
        f->distance + f->depth + (f->separation != NULL) > 1 ||
        (!f->distance && !f->depth && f->tolerance > 0))
        message = "only one of --distance, --depth, --separation, --all and --self can be given; "
                  "--tolerance is only for --distance and --depth";
    else if (f->separation && !read_direction(f->separation, f->direction))
        message = "--separation expects a direction, three numbers 'X Y Z'";
    else if (f->at_least >= 0 && (!f->distance || f->tolerance > 0))
        message = "--at-least is for --distance, without --tolerance";
    else if (f->depth && !(f->tolerance > 0))
        message = "--depth needs a --tolerance greater than 0";
    if (message)
        (void)command_usage("collide", "%s", message);
    return !message;
}

/* Prints the two bounds. */
static void print_bounds(bool as_json, const ebpo_value_bounds *d)
{
    char lo[32], hi[32];
    if (as_json)
        printf("\"lo\": %s, \"hi\": %s", json_number(d->lo, lo), json_number(d->hi, hi));
    else
        printf("%s %s", words_real(d->lo, lo), words_real(d->hi, hi));
}

/* --- distance --- */

static void pair_to_json(const ebpo_collide_distance_result *c)
{
    printf(", \"face_a\": %" PRIu64 ", \"face_b\": %" PRIu64 ", \"point_a\": [", c->pair.face_a,
           c->pair.face_b);
    words_print_reals(c->point_a, 3, ", ");
    printf("], \"point_b\": [");
    words_print_reals(c->point_b, 3, ", ");
    putchar(']');
}

/* Prints the two nearest faces, if they are known. */
static void print_nearest_pair(bool as_json, const ebpo_collide_distance_result *c)
{
    if (c->pair.face_a == EBPO_NO_FACE)
        return;
    if (as_json)
        pair_to_json(c);
    else
        printf(" %" PRIu64 " %" PRIu64, c->pair.face_a, c->pair.face_b);
}

/* Prints the relation, unless `relation` is NULL, and ends the line. */
static void print_end(bool as_json, const char *relation)
{
    print_relation(as_json, relation);
    puts(as_json ? "}" : "");
}

static void print_distance(bool as_json, const ebpo_collide_distance_result *c,
                           const char *relation)
{
    printf("%s", as_json ? "{" : "");
    print_bounds(as_json, &c->distance);
    print_nearest_pair(as_json, c);
    print_end(as_json, relation);
}

static void print_at_least(bool as_json, const ebpo_collide_distance_result *c,
                           const char *relation)
{
    static const char *const words[2][3] = { { "not known", "no", "yes" },
                                             { "null", "false", "true" } };
    printf("%s%s", as_json ? "{\"at_least\": " : "", words[as_json][c->at_least + 1]);
    print_nearest_pair(as_json, c);
    print_end(as_json, relation);
}

static ebpo_status query_distance(const measure_values *f, bool as_json, ebpo_collider *c,
                                  const ebpo_collide_options *collide_options, ebpo_error *error)
{
    ebpo_collide_distance_options distance_options = EBPO_COLLIDE_DISTANCE_OPTIONS_INIT;
    ebpo_collide_distance_result result;
    distance_options.tolerance = f->tolerance;
    distance_options.at_least = f->at_least;
    ebpo_status status =
        ebpo_collide_distance(c, collide_options, &distance_options, &result, error);
    if (status != EBPO_OK)
        return status;
    /* If this is false, the printed line shows that faces intersect, or that this is not known. */
    bool apart = result.distance.lo > 0 || (result.at_least >= 0 && result.distance.hi > 0);
    const char *relation = NULL;
    if (apart)
        status = find_relation(c, collide_options, &relation, error);
    if (status != EBPO_OK)
        return status;
    if (f->at_least >= 0)
        print_at_least(as_json, &result, relation);
    else
        print_distance(as_json, &result, relation);
    return EBPO_OK;
}

/* --- depth --- */

static void print_depth(bool as_json, const char *name, bool solid, const ebpo_value_bounds *d)
{
    printf(as_json ? "\"%s\": " : "%s ", name);
    if (!solid) {
        printf(as_json ? "null" : "- -");
        return;
    }
    printf("%s", as_json ? "{" : "");
    print_bounds(as_json, d);
    printf("%s", as_json ? "}" : "");
}

static ebpo_status query_depth(const measure_values *f, bool as_json, ebpo_collider *c,
                               const ebpo_collide_options *collide_options, ebpo_error *error)
{
    ebpo_value_bounds depth[2] = { { 0, 0, 0, 0 }, { 0, 0, 0, 0 } };
    ebpo_status status[2];
    for (int i = 0; i < 2; i++) {
        status[i] = ebpo_collide_depth(c, collide_options, f->tolerance, i == 0 ? &depth[0] : NULL,
                                       i == 1 ? &depth[1] : NULL, error);
        if (status[i] != EBPO_OK && status[i] != EBPO_E_NOT_SOLID)
            return status[i];
    }
    if (status[0] != EBPO_OK && status[1] != EBPO_OK)
        return status[0];
    printf("%s", as_json ? "{" : "");
    print_depth(as_json, "a_in_b", status[0] == EBPO_OK, &depth[0]);
    printf("%s", as_json ? ", " : "\n");
    print_depth(as_json, "b_in_a", status[1] == EBPO_OK, &depth[1]);
    puts(as_json ? "}" : "");
    return EBPO_OK;
}

/* --- separation distance along a direction --- */

static ebpo_status query_separation(const measure_values *f, bool as_json, ebpo_collider *c,
                                    const ebpo_collide_options *collide_options, ebpo_error *error)
{
    static const char *const value_kinds[] = { "exact", "interval", "bound" };
    ebpo_separation separation;
    ebpo_status status =
        ebpo_collide_separation(c, collide_options, f->direction, &separation, error);
    if (status != EBPO_OK)
        return status;
    bool has_faces = separation.pair.face_a != EBPO_NO_FACE;
    printf("%s", as_json ? "{" : "");
    print_bounds(as_json, &separation.t);
    if (as_json)
        printf(", \"value_kind\": \"%s\"", value_kinds[separation.t.kind]);
    if (has_faces)
        printf(as_json ? ", \"face_a\": %" PRIu64 ", \"face_b\": %" PRIu64
                       : " %" PRIu64 " %" PRIu64,
               separation.pair.face_a, separation.pair.face_b);
    puts(as_json ? "}" : "");
    return EBPO_OK;
}

static ebpo_status query_measures(const measure_values *f, bool as_json, ebpo_collider *c,
                                  const ebpo_collide_options *collide_options, ebpo_error *error)
{
    return f->separation ? query_separation(f, as_json, c, collide_options, error)
           : f->distance ? query_distance(f, as_json, c, collide_options, error)
                         : query_depth(f, as_json, c, collide_options, error);
}

/* --- the command --- */

typedef struct collide_values {
    query_values query;
    const char *pose_a, *pose_b, *out;
    bool first, self, relation, quiet;
    uint64_t printed; /* number of pairs printed so far */
    measure_values measures;
} collide_values;

#include "cli/options/collide.inc"

/* Reads the value of the option --NAME. If the option was not given, `text` is NULL and *out does
 * not change. */
static bool read_pose(const char *name, const char *text, ebpo_pose *out)
{
    if (!text || pose_read(text, out))
        return true;
    (void)command_usage("collide",
                        "--%s '%s': expected a pose '" POSE_FORM
                        "' with a quaternion that is not 0",
                        name, text);
    return false;
}

/* --- results --- */

/* Words for an ebpo_pair_kind. */
static const char *const kinds[] = { "APART", "TOUCHING", "CROSSING", "COPLANAR" };

static void print_pair(bool as_json, const ebpo_face_pair *p)
{
    if (as_json)
        printf("{\"face_a\": %llu, \"face_b\": %llu, \"kind\": \"%s\"}\n",
               (unsigned long long)p->face_a, (unsigned long long)p->face_b, kinds[p->kind]);
    else
        printf("%llu %llu %s\n", (unsigned long long)p->face_a, (unsigned long long)p->face_b,
               kinds[p->kind]);
}

static bool take_pairs(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    collide_values *v = user;
    v->printed += count;
    for (uint64_t i = 0; i < count; i++)
        print_pair(v->query.json, &pairs[i]);
    return command_flush("collide");
}

/* JSON for a result -1 (not known), 0 (no) and 1 (yes); the index is the result + 1. */
static const char *const json_truths[] = { "null", "false", "true" };

/* Prints the line for models whose faces do not intersect. With --all, JSON has one object for
 * each pair; without pairs, it has one object if a relation is printed, otherwise none. */
static ebpo_status print_none(const collide_values *v, ebpo_collider *c,
                              const ebpo_collide_options *collide_options, ebpo_error *error)
{
    const char *relation;
    bool as_json = v->query.json;
    ebpo_status status = find_relation(c, collide_options, &relation, error);
    if (status != EBPO_OK || (as_json && v->query.all && !relation))
        return status;
    printf(as_json ? "{\"kind\": \"APART\"" : "none");
    print_relation(as_json, relation);
    puts(as_json ? "}" : "");
    return EBPO_OK;
}

static ebpo_status query_first(const collide_values *v, ebpo_collider *c,
                               const ebpo_collide_options *collide_options, ebpo_error *error)
{
    ebpo_face_pair pair;
    int32_t found;
    ebpo_status status = ebpo_collide_first(c, collide_options, &pair, &found, error);
    if (status != EBPO_OK)
        return status;
    if (found == 0)
        return print_none(v, c, collide_options, error);
    if (found == 1)
        print_pair(v->query.json, &pair);
    else
        puts(v->query.json ? "{\"kind\": null}" : "not known");
    return EBPO_OK;
}

static ebpo_status query_relation(const collide_values *v, ebpo_collider *c,
                                  const ebpo_collide_options *collide_options, ebpo_error *error)
{
    ebpo_relation_result r;
    ebpo_status status = ebpo_collide_relation(c, collide_options, &r, error);
    if (status != EBPO_OK)
        return status;
    if (!v->query.json)
        puts(collide_relations[r.relation]);
    else if (r.relation == EBPO_RELATION_UNDECIDED)
        printf("{\"relation\": null, \"contact\": %s}\n", json_truths[r.contact + 1]);
    else
        printf("{\"relation\": \"%s\", \"contact\": %s}\n", collide_relations[r.relation],
               json_truths[r.contact + 1]);
    return EBPO_OK;
}

/* Words for ebpo_level_result.common: -1 (not known), 0 (no) and 1 (yes); the index is the result
 * + 1. */
static const char *const common_words[] = { "possible", "apart", "meeting" };

static void print_levels(bool as_json, const ebpo_level_result *r)
{
    char lo[32], hi[32];
    if (as_json)
        printf("{\"common\": %s, \"contact\": %s, \"undecided_pairs\": %llu, \"lo\": %s, \"hi\": "
               "%s}\n",
               json_truths[r->common + 1], json_truths[r->contact + 1],
               (unsigned long long)r->undecided_pairs, json_number(r->distance.lo, lo),
               json_number(r->distance.hi, hi));
    else
        printf("%s %llu %s %s\n", common_words[r->common + 1],
               (unsigned long long)r->undecided_pairs, words_real(r->distance.lo, lo),
               words_real(r->distance.hi, hi));
}

static ebpo_status query_levels(const collide_values *v, ebpo_collider *c,
                                const ebpo_collide_options *collide_options, ebpo_error *error)
{
    ebpo_level_result r;
    ebpo_status status = ebpo_collide_levels(c, collide_options, &r, error);
    if (status == EBPO_OK)
        print_levels(v->query.json, &r);
    return status;
}

/* Prints every pair; if there are no pairs, prints "none" or the relation of the models. */
static ebpo_status query_pairs(collide_values *v, ebpo_collider *c,
                               const ebpo_collide_options *collide_options, ebpo_error *error)
{
    ebpo_status status = v->self ? ebpo_collide_self(c, collide_options, take_pairs, v, error)
                                 : ebpo_collide_all(c, collide_options, take_pairs, v, error);
    if (status != EBPO_OK || v->printed)
        return status;
    if (!v->self)
        return print_none(v, c, collide_options, error);
    if (!v->query.json)
        puts("none");
    return EBPO_OK;
}

/* Writes --output. The report goes to standard error, as results go to standard output. */
static ebpo_status write_pairs(const collide_values *v, ebpo_collider *c,
                               const ebpo_collide_options *collide_options, ebpo_error *error)
{
    bool ply = words_end_with(v->out, ".ply");
    const char *relation = NULL;
    ebpo_status status = ebpo_collide_write(c, collide_options,
                                            ply ? EBPO_PAIRS_PLY : EBPO_PAIRS_HDF5, v->out, error);
    if (v->quiet)
        return status;
    if (status == EBPO_OK)
        status = find_relation(c, collide_options, &relation, error);
    if (status == EBPO_OK)
        fprintf(stderr, "%s: %s%s%s\n", v->out,
                ply ? "both models, with intersecting faces in red"
                    : "all pairs of intersecting faces, and where they cross",
                relation ? "; no faces intersect; relation: " : "", relation ? relation : "");
    return status;
}

/* Runs the requested queries in order. */
static ebpo_status query_all(collide_values *v, ebpo_collider *c,
                             const ebpo_collide_options *collide_options, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    if (v->query.level >= 0)
        return query_levels(v, c, collide_options, error);
    if (v->relation)
        status = query_relation(v, c, collide_options, error);
    if (status == EBPO_OK && v->out)
        status = write_pairs(v, c, collide_options, error);
    if (status == EBPO_OK && measures_requested(&v->measures))
        return query_measures(&v->measures, v->query.json, c, collide_options, error);
    if (status == EBPO_OK && (v->query.all || v->self))
        return query_pairs(v, c, collide_options, error);
    bool has_query = v->relation || v->out;
    return status == EBPO_OK && (v->first || !has_query) ? query_first(v, c, collide_options, error)
                                                         : status;
}

static void json_stats(const ebpo_collider_stats *s)
{
    json j;
    json_begin(&j, stderr);
    json_object(&j, NULL);
    json_uint(&j, "node_pairs", s->node_pairs);
    json_uint(&j, "block_pairs", s->block_pairs);
    json_uint(&j, "exact", s->exact);
    json_uint(&j, "subtree_pairs", s->subtree_pairs);
    json_uint(&j, "subtrees", s->subtrees);
    json_uint(&j, "loads", s->loads);
    json_uint(&j, "bytes_read", s->bytes_read);
    json_finish(&j);
}

static void report_stats(const ebpo_collider *c, bool as_json)
{
    ebpo_collider_stats s = EBPO_COLLIDER_STATS_INIT;
    if (ebpo_collider_get_stats(c, &s) != EBPO_OK)
        return;
    if (as_json) {
        json_stats(&s);
        return;
    }
    fprintf(stderr, "%llu pairs of nodes, %llu of blocks; %llu of faces by the exact test\n",
            (unsigned long long)s.node_pairs, (unsigned long long)s.block_pairs,
            (unsigned long long)s.exact);
    if (s.subtree_pairs)
        fprintf(stderr, "%llu pairs of subtrees, from %llu subtrees; %llu loads, %llu bytes read\n",
                (unsigned long long)s.subtree_pairs, (unsigned long long)s.subtrees,
                (unsigned long long)s.loads, (unsigned long long)s.bytes_read);
}

static int query_collider(collide_values *v, ebpo_model *a, ebpo_model *b,
                          ebpo_collide_options *collide_options)
{
    ebpo_collider_options collider_options = EBPO_COLLIDER_OPTIONS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_collider *c = NULL;
    progress_line line;
    collider_options.threads = (unsigned)v->query.threads;
    ebpo_status status = ebpo_collider_new(a, b, &collider_options, &c, &error);
    collide_options->progress = progress_start(&line, "collide", v->quiet);
    if (status == EBPO_OK)
        status = query_all(v, c, collide_options, &error);
    progress_wipe(&line);
    if (c && v->query.remote.stats)
        report_stats(c, v->query.json);
    ebpo_collider_free(c);
    if (status != EBPO_OK)
        return command_failed("collide", &error);
    return command_flush("collide") ? EXIT_OK : EXIT_FAILED;
}

/* Makes the budget that both models share, of the size --memory. If both models fit completely into
 * this size, makes no budget. */
static ebpo_status share_memory(const query_session *a, const query_session *b,
                                ebpo_model_options *model_options, ebpo_error *error)
{
    ebpo_model_options unlimited = *model_options;
    ebpo_model_plan plan[2] = { EBPO_MODEL_PLAN_INIT, EBPO_MODEL_PLAN_INIT };
    unlimited.memory = 0;
    ebpo_status status = ebpo_model_memory(a->file, &unlimited, &plan[0], error);
    if (status == EBPO_OK)
        status = ebpo_model_memory(b->file, &unlimited, &plan[1], error);
    bool fits =
        model_options->cut_level < 0 && plan[0].whole + plan[1].whole <= model_options->memory;
    if (status != EBPO_OK || fits)
        return status;
    return ebpo_budget_new(model_options->memory, &model_options->budget, error);
}

/* Sets the memory of both models if --memory is not given. There is no limit if both models need at
 * most half of the free memory. Otherwise the limit is half of the free memory, or the least
 * memory that the models need if that is more. Remote files keep the default budget of the library.
 * `b` is NULL if both models are the same. */
static void default_memory(const query_session *a, const query_session *b,
                           const char *const path[2], ebpo_model_options *model_options)
{
    if (ebpo_is_url(path[0]) || (b && ebpo_is_url(path[1])))
        return;
    ebpo_model_plan plan[2] = { EBPO_MODEL_PLAN_INIT, EBPO_MODEL_PLAN_INIT };
    if (ebpo_model_memory(a->file, model_options, &plan[0], NULL) != EBPO_OK ||
        (b && ebpo_model_memory(b->file, model_options, &plan[1], NULL) != EBPO_OK))
        return; /* the error is reported when the models are made */
    uint64_t half = ebpo_free_memory() / 2;
    uint64_t least = plan[0].least + plan[1].least;
    if (plan[0].whole + plan[1].whole <= half)
        return;
    model_options->memory = half > least ? half : least;
    if (least > half)
        model_memory_report_least("collide", "both models", least, half);
}

static int open_models(query_session *a, query_session *b, const collide_values *v,
                       const char **operand, ebpo_model_options *model_options)
{
    ebpo_error error = EBPO_ERROR_INIT;
    const char *path[2] = { operand[0], operand[1] };
    bool same_model = v->self || strcmp(path[0], path[1]) == 0; /* the model is loaded only once */
    int level = (int)v->query.level;
    int code = query_open_file(a, "collide", path[0], model_options, level, &v->query.remote);
    if (code == EXIT_OK && !same_model)
        code = query_open_file(b, "collide", path[1], model_options, level, &v->query.remote);
    if (code == EXIT_OK && !v->query.memory && model_options->cut_level < 0)
        default_memory(a, same_model ? NULL : b, path, model_options);
    if (code == EXIT_OK && !same_model && model_options->memory &&
        share_memory(a, b, model_options, &error) != EBPO_OK)
        return command_failed("collide", &error);
    if (code == EXIT_OK)
        code = query_open_model(a, "collide", model_options);
    if (code == EXIT_OK && !same_model)
        code = query_open_model(b, "collide", model_options);
    return code;
}

static int run_collide(void *given, const char **operand)
{
    collide_values *v = given;
    ebpo_collide_options collide_options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_model_options model_options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_inside_options inside = EBPO_INSIDE_OPTIONS_INIT;
    ebpo_distance_options distance = EBPO_DISTANCE_OPTIONS_INIT;
    query_session a = QUERY_SESSION_INIT, b = QUERY_SESSION_INIT;
    if (v->self == (operand[1] != NULL))
        return command_usage("collide", "expected two models, or one model and --self");
    if (!measures_fit(&v->measures, v->query.all || v->self))
        return EXIT_USAGE;
    if (v->self && (v->query.all || v->pose_a || v->pose_b || v->relation || v->out))
        return command_usage("collide",
                             "--self takes neither --all nor poses, --relation or --output");
    if (v->first && (v->self || v->query.all || measures_requested(&v->measures)))
        return command_usage("collide", "--first takes neither --all, --self, --distance, --depth "
                                        "nor --separation");
    if (v->out && !words_end_with(v->out, ".h5") && !words_end_with(v->out, ".ply"))
        return command_usage("collide", "--output %s: expected a name that ends in .h5 or .ply",
                             v->out);
    if (v->query.level >= 0 && (v->first || v->self || v->query.all ||
                                measures_requested(&v->measures) || v->relation || v->out))
        return command_usage("collide", "--max-level allows no other query");
    if (!read_pose("pose-a", v->pose_a, &collide_options.pose_a) ||
        !read_pose("pose-b", v->pose_b, &collide_options.pose_b) ||
        !query_options_from("collide", &v->query, &model_options, &inside, &distance))
        return EXIT_USAGE;
    collide_options.deadline_ns = distance.deadline_ns;
    collide_options.level = distance.level;
    setvbuf(stdout, NULL, _IOFBF, 1 << 18);
    int code = open_models(&a, &b, v, operand, &model_options);
    if (code == EXIT_OK)
        code = query_collider(v, a.model, b.model ? b.model : a.model, &collide_options);
    query_close(&b);
    query_close(&a);
    ebpo_budget_free(model_options.budget);
    return code;
}

static const collide_values standard = { .query = QUERY_VALUES_INIT,
                                         .measures = MEASURE_VALUES_INIT };

const command command_collide = { &spec, sizeof standard, &standard, run_collide };
