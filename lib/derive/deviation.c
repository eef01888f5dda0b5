/* A level's bounds are those of its nodes. A short look at each gives bounds that dismiss most; the
 * others are searched in the order of what they may reach. */
#include "core/strict_fp.h"

#include <ebpo/deviation.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "core/sized.h"
#include "derive/bound.h"
#include "derive/samples.h"
#include "query/query_model.h"

/* of one node: what is left to find then lies in flat places, close to the model */
enum { BLOCK_MOST = 512, QUESTIONS_MOST = 1 << 16 };

typedef struct level_node {
    ebpo_cell cell;
    ebpo_reach_bound bound;
} level_node;

typedef struct survey {
    const ebpo_lod_model *tree, *whole; /* of the file, of the model's file; perhaps the same */
    int level;
    level_node *nodes;
    uint64_t count, capacity, *order;
    ebpo_bounder *bounders; /* [threads] */
    unsigned threads;
    ebpo_bound_goal goal;
    uint64_t first; /* of `order`, of the block at hand */
    bool spent;     /* questions, before the tolerance was met */
    const ebpo_progress *progress;
    ebpo_error *error;
} survey;

/* --- the level's nodes --- */

static ebpo_status add_node(survey *s, const ebpo_node *node)
{
    if (!ebpo_grow(&s->nodes, &s->capacity, s->count + 1, sizeof *s->nodes))
        return ebpo_fail_memory(s->error, (s->count + 1) * sizeof *s->nodes);
    s->nodes[s->count++] = (level_node){ node->cell, { 0, INFINITY, { 0, 0, 0 }, 0 } };
    return EBPO_OK;
}

static ebpo_status list_nodes(survey *s, const ebpo_level_nodes *tree, const ebpo_node *node)
{
    if (node->type == EBPO_LEAF)
        return add_node(s, node);
    if (node->type != EBPO_GRAY)
        return EBPO_OK;
    if (node->cell.level == s->level || node->pruned)
        return add_node(s, node);
    ebpo_status status = EBPO_OK;
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++) {
        ebpo_node child = ebpo_level_child(tree, node, octant);
        status = list_nodes(s, tree, &child);
    }
    return status;
}

/* --- bounds of nodes --- */

static ebpo_status bound_node(survey *s, ebpo_bounder *b, level_node *node, ebpo_error *error)
{
    ebpo_node own;
    ebpo_status status = EBPO_OK;
    (void)ebpo_tree_bounds(s->tree, node->cell, true, &own, &b->halves);
    if (own.type == EBPO_LEAF && s->tree->leaf_source == EBPO_LEAF_DERIVED)
        status = ebpo_tree_derive(s->tree, &own, &b->scratch, &b->halves, error);
    if (status != EBPO_OK)
        return status;
    return s->goal.ratio > 0 ? ebpo_bound_closely(b, node->cell, &s->goal, &node->bound, error)
                             : ebpo_bound_envelope(b, node->cell, &s->goal, &node->bound, error);
}

static ebpo_status bound_some(void *context, uint64_t begin, uint64_t end, unsigned worker,
                              ebpo_error *error)
{
    survey *s = context;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++)
        status = bound_node(s, &s->bounders[worker], &s->nodes[s->order[s->first + i]], error);
    return status;
}

typedef struct ranked {
    double hi;
    uint64_t node;
} ranked;

static int farthest_first(const void *a, const void *b)
{
    const ranked *x = a, *y = b;
    if (x->hi != y->hi)
        return x->hi < y->hi ? 1 : -1;
    return (x->node > y->node) - (x->node < y->node);
}

static ebpo_status sort_nodes(survey *s)
{
    ranked *list = ebpo_alloc(s->count, sizeof *list);
    if (!list)
        return ebpo_fail_memory(s->error, s->count * sizeof *list);
    for (uint64_t i = 0; i < s->count; i++)
        list[i] = (ranked){ s->nodes[i].bound.hi, i };
    if (s->count)
        qsort(list, s->count, sizeof *list, farthest_first);
    for (uint64_t i = 0; i < s->count; i++)
        s->order[i] = list[i].node;
    free(list);
    return EBPO_OK;
}

/* What nodes first .. last - 1 in the order have brought. */
static void gather_survey(const survey *s, uint64_t first, uint64_t last, ebpo_deviation *out)
{
    for (uint64_t i = first; i < last; i++) {
        const ebpo_reach_bound *b = &s->nodes[s->order[i]].bound;
        if (b->lo > out->lo) {
            out->lo = b->lo;
            memcpy(out->place, b->place, sizeof out->place);
        }
    }
}

static uint64_t count_questions(const survey *s)
{
    uint64_t sum = 0;
    for (uint64_t i = 0; i < s->count; i++)
        sum += s->nodes[i].bound.questions;
    return sum;
}

/* Blocks are what is decided together, for any number of threads: what one block finds is known to
 * the next. */
static ebpo_status search_nodes(survey *s, const ebpo_deviation_options *o, ebpo_deviation *out)
{
    uint64_t done = 0, block = 4, asked = count_questions(s);
    ebpo_status status = EBPO_OK;
    s->goal.ratio = 1 + o->tolerance;
    while (done < s->count && status == EBPO_OK && (!o->questions || asked < o->questions)) {
        uint64_t size = 0;
        s->goal.enough = (1 + o->tolerance) * out->lo;
        while (size < block && done + size < s->count &&
               s->nodes[s->order[done + size]].bound.hi > s->goal.enough)
            size++;
        if (!size)
            break;
        s->goal.questions = o->questions ? (o->questions - asked) / size + 1 : QUESTIONS_MOST;
        s->first = done;
        uint64_t before = 0, after = 0;
        for (uint64_t i = 0; i < size; i++)
            before += s->nodes[s->order[done + i]].bound.questions;
        status = ebpo_parallel_for(s->threads, NULL, size, 1, bound_some, s, NULL, NULL, s->error);
        for (uint64_t i = 0; i < size; i++)
            after += s->nodes[s->order[done + i]].bound.questions;
        asked += after - before;
        gather_survey(s, done, done + size, out);
        done += size;
        block = block < BLOCK_MOST ? 2 * block : block;
        if (status == EBPO_OK &&
            !ebpo_progress_step(s->progress, "bounding envelopes", done, s->count, s->error))
            status = EBPO_E_CANCELLED;
    }
    return status;
}

/* What a coarser level is certain of holds for what lies in it. */
static void bound_by_coarser(survey *s, double at_most)
{
    for (uint64_t i = 0; i < s->count && at_most > 0; i++) {
        ebpo_reach_bound *b = &s->nodes[i].bound;
        b->hi = fmax(b->lo, fmin(b->hi, at_most));
    }
}

static bool has_spent(const survey *s, const ebpo_deviation_options *o, const ebpo_deviation *out)
{
    if (out->hi <= (1 + o->tolerance) * out->lo)
        return false;
    bool spent = o->questions && out->questions >= o->questions;
    for (uint64_t i = 0; i < s->count && !spent; i++)
        spent = s->nodes[i].bound.questions >= QUESTIONS_MOST;
    return spent;
}

static ebpo_status bound_level(survey *s, const ebpo_deviation_options *o, ebpo_deviation *out)
{
    ebpo_level_nodes tree = ebpo_lod_model_nodes(s->tree);
    ebpo_node root = ebpo_level_root(&tree);
    free(s->order);
    s->order = NULL;
    s->count = 0;
    s->first = 0; /* where the search of a finer level ended */
    ebpo_status status = list_nodes(s, &tree, &root);
    if (status == EBPO_OK && !(s->order = ebpo_alloc(s->count, sizeof *s->order)))
        status = ebpo_fail_memory(s->error, s->count * sizeof *s->order);
    for (uint64_t i = 0; i < s->count && status == EBPO_OK; i++)
        s->order[i] = i;
    s->goal = (ebpo_bound_goal){ 0, INFINITY, 0, 1 };
    if (status == EBPO_OK)
        status = ebpo_parallel_for(s->threads, NULL, s->count, 16, bound_some, s, s->progress,
                                   "looking at envelopes", s->error);
    bound_by_coarser(s, o->at_most);
    if (status == EBPO_OK)
        status = sort_nodes(s);
    if (status != EBPO_OK)
        return status;
    gather_survey(s, 0, s->count, out);
    status = search_nodes(s, o, out);
    for (uint64_t i = 0; i < s->count; i++)
        out->hi = fmax(out->hi, s->nodes[i].bound.hi);
    out->questions = count_questions(s);
    s->spent = has_spent(s, o, out);
    return status;
}

/* Envelopes nest, so no level reaches farther than the one before, which has other pieces to cut
 * and may have got on better. */
static ebpo_status ask_coarser(survey *s, const ebpo_deviation_options *o, ebpo_deviation *out)
{
    ebpo_status status = EBPO_OK;
    while (s->spent && s->level > 0 && !(o->at_most > 0) && status == EBPO_OK) {
        ebpo_deviation coarser = EBPO_DEVIATION_INIT;
        s->level--;
        status = bound_level(s, o, &coarser);
        if (status == EBPO_OK)
            out->hi = fmax(out->lo, fmin(out->hi, coarser.hi));
        out->questions += coarser.questions;
    }
    return status;
}

/* --- --- */

static ebpo_status make_bounders(survey *s, ebpo_model *model)
{
    ebpo_status status = EBPO_OK;
    if (!(s->bounders = ebpo_alloc_zero(s->threads, sizeof *s->bounders)))
        return ebpo_fail_memory(s->error, s->threads * sizeof *s->bounders);
    for (unsigned i = 0; i < s->threads && status == EBPO_OK; i++)
        status = ebpo_bounder_make(&s->bounders[i], s->whole, model, s->error);
    return status;
}

/* What shows that the file is no subset of the model's; NULL: nothing. Digests cannot, as subsets
 * of subsets name only the first file, or none when all nodes were kept. */
static const char *find_difference(const ebpo_info *info, const ebpo_info *model)
{
    if (memcmp(info->box_origin, model->box_origin, sizeof info->box_origin) != 0 ||
        memcmp(info->box_size, model->box_size, sizeof info->box_size) != 0)
        return "root cells";
    if (memcmp(info->content_sha256, model->content_sha256, sizeof info->content_sha256) == 0 ||
        (info->pruned &&
         memcmp(info->subset_of, model->content_sha256, sizeof info->subset_of) == 0))
        return NULL;
    if (memcmp(info->source_sha256, model->source_sha256, sizeof info->source_sha256) != 0 ||
        info->source_vertex_count != model->source_vertex_count ||
        info->source_face_count != model->source_face_count)
        return "sources";
    if (info->solid != model->solid || info->rule != model->rule ||
        info->max_level != model->max_level || info->leaf_faces != model->leaf_faces ||
        info->epsilon != model->epsilon || info->selection != model->selection ||
        info->percent != model->percent || info->k_root != model->k_root ||
        info->seed != model->seed)
        return "ways of building";
    return NULL;
}

static ebpo_status check_deviation(const ebpo_info *info, const ebpo_info *model, int level,
                         const ebpo_deviation_options *o, ebpo_error *error)
{
    if (level < 0 || level >= info->level_count)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "there is no level %d; this file has levels 0 to %d", level,
                         info->level_count - 1);
    if (!(o->tolerance > 0) || !(o->tolerance <= 1e6))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "tolerance %g: give a number above 0, such as 0.05", o->tolerance);
    if (!(o->at_most >= 0))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "at_most %g: give what a coarser level reaches at most, or 0", o->at_most);
    if (o->samples > UINT32_MAX)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "more than 4294967295 samples; a million give the mean to three digits");
    const char *differ = find_difference(info, model);
    if (differ)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the file is neither the model's nor a subset of it: their %s differ; "
                         "open the model of the file it was taken from",
                         differ);
    return EBPO_OK;
}

ebpo_status ebpo_deviation_level(ebpo_model *model, const ebpo_file *file, int level,
                                 const ebpo_deviation_options *options, ebpo_deviation *out,
                                 ebpo_error *error)
{
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    EBPO_DEFAULT_FP;
    ebpo_deviation_options wanted = EBPO_DEVIATION_OPTIONS_INIT;
    const ebpo_deviation_options *o = &wanted;
    ebpo_deviation found = EBPO_DEVIATION_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_deviation_options, &wanted, options, error);
    if (status == EBPO_OK)
        status = EBPO_CHECK_SIZED(ebpo_deviation, out, error);
    if (status != EBPO_OK)
        return status;
    found.mean = found.rms = NAN;
    ebpo_lod_model whole = { 0 }, own = { 0 };
    survey s = { .level = level,
                 .threads = ebpo_thread_count(o->threads),
                 .progress = &o->progress,
                 .error = error,
                 .whole = &whole,
                 .tree = &whole };
    status = check_deviation(ebpo_file_info(file), model->info, level, o, error);
    if (status == EBPO_OK)
        status = ebpo_tree_read_whole(&whole, model->file, s.threads, error);
    if (status == EBPO_OK && file != model->file) {
        read.threads = s.threads;
        status = ebpo_lod_model_read(&own, file, level, &read, error);
        s.tree = &own;
    }
    if (status == EBPO_OK)
        status = make_bounders(&s, model);
    if (status == EBPO_OK)
        status = bound_level(&s, o, &found);
    if (status == EBPO_OK)
        status = ask_coarser(&s, o, &found);
    for (unsigned i = 0; s.bounders && i < s.threads; i++)
        ebpo_bounder_free(&s.bounders[i]);
    free(s.bounders);
    free(s.nodes);
    free(s.order);
    if (status == EBPO_OK && o->samples)
        status = ebpo_deviation_sample(model, file, level, o, &found, error);
    EBPO_GIVE(ebpo_deviation, out, &found);
    ebpo_lod_model_free(&own);
    ebpo_lod_model_free(&whole);
    return status;
}
