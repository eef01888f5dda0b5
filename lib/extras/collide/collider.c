/* Makes a collider: two models, options, and data that a query keeps for the following queries.
 *
 * All queries begin with ebpo_collision_begin. ebpo_collision_begin checks the options, and puts
 * the models in an order (the query's order) that does not change when the caller swaps the models.
 * So results do not depend on the caller's order.
 *
 * A collider belongs to one thread at a time. ebpo_collider_new refuses models that are subsets;
 * ebpo_collider_of_parts accepts them for callers that know which parts are omitted. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/os.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "extras/collide/collider.h"
#include "extras/collide/hierarchy_walk.h"
#include "extras/collide/posed_solid.h"
#include "query/query_model.h"

/* Refuses a subset, because faces that were omitted from it might also intersect. */
static ebpo_status check_complete(const ebpo_model *model, ebpo_error *error)
{
    if (!model->info->pruned)
        return EBPO_OK;
    return ebpo_fail_file(error, EBPO_E_ABSENT, model->file->in.shown,
                          "is a part of another file, and omitted faces might also intersect; "
                          "query the whole file, or put both models into a scene, which knows the "
                          "relevant faces (`ebpo scene`)");
}

ebpo_status ebpo_collider_new(ebpo_model *a, ebpo_model *b, const ebpo_collider_options *options,
                              ebpo_collider **out, ebpo_error *error)
{
    *out = NULL;
    ebpo_status status = check_complete(a, error);
    if (status == EBPO_OK)
        status = check_complete(b, error);
    return status == EBPO_OK ? ebpo_collider_of_parts(a, b, options, out, error) : status;
}

ebpo_status ebpo_collider_of_parts(ebpo_model *a, ebpo_model *b,
                                   const ebpo_collider_options *options, ebpo_collider **out,
                                   ebpo_error *error)
{
    ebpo_collider_options wanted = EBPO_COLLIDER_OPTIONS_INIT;
    *out = NULL;
    ebpo_status status = EBPO_TAKE(ebpo_collider_options, &wanted, options, error);
    if (status == EBPO_OK)
        status = ebpo_check_mesh(a, error);
    if (status == EBPO_OK)
        status = ebpo_check_mesh(b, error);
    if (status != EBPO_OK)
        return status;
    ebpo_collider *c = ebpo_alloc_lines(1, sizeof *c);
    if (!c)
        return ebpo_fail_memory(error, sizeof *c);
    c->model[0] = a;
    c->model[1] = b;
    c->options = wanted;
    if (!c->options.memory)
        c->options.memory = 64 << 20; /* the default in the public header */
    *out = c;
    return EBPO_OK;
}

void ebpo_collider_free(ebpo_collider *c)
{
    if (!c)
        return;
    ebpo_pair_walk_free(&c->walk);
    for (unsigned i = 0; c->walks && i < c->walk_count; i++)
        ebpo_pair_walk_free(&c->walks[i]);
    free(c->walks);
    ebpo_gap_free(c->gap);
    free(c->nearest);
    for (int i = 0; i < 2; i++) {
        ebpo_context_free(c->context[i]);
        free(c->slots[i]);
    }
    free(c);
}

void ebpo_collider_count(ebpo_collider *c, ebpo_pair_walk *w)
{
    c->node_pairs += w->node_pairs;
    c->block_pairs += w->block_pairs;
    c->exact += w->exact;
    w->node_pairs = w->block_pairs = w->exact = 0;
}

ebpo_status ebpo_collider_get_stats(const ebpo_collider *c, ebpo_collider_stats *out)
{
    ebpo_collider_stats stats = EBPO_COLLIDER_STATS_INIT;
    stats.node_pairs = c->node_pairs;
    stats.block_pairs = c->block_pairs;
    stats.exact = c->exact;
    stats.subtree_pairs = c->subtree_pairs;
    stats.subtrees = c->subtrees;
    stats.loads = c->loads;
    stats.bytes_read = c->bytes_read;
    return EBPO_GIVE(ebpo_collider_stats, out, &stats);
}

/* --- queries --- */

/* Returns true if the caller's A is the second model in the query's order. The models are ordered
 * by the hashes of the files' contents, then by the bits of the poses. Any order that does not
 * depend on the caller's order could be used. */
static bool comes_second(const ebpo_collider *c, const ebpo_collide_options *o)
{
    int by_file = memcmp(c->model[0]->info->content_sha256, c->model[1]->info->content_sha256,
                         sizeof c->model[0]->info->content_sha256);
    return (by_file ? by_file : memcmp(&o->pose_a, &o->pose_b, sizeof o->pose_a)) > 0;
}

/* Sets the posings of both models, and the bound of all posed coordinates. */
static ebpo_status make_posings(ebpo_collision *q, ebpo_error *error)
{
    ebpo_posing posing[2];
    q->max_coordinate = 0;
    for (int i = 0; i < 2; i++) {
        double max_coordinate[3];
        ebpo_model_extent(q->model[i], max_coordinate);
        const ebpo_pose *pose = (i == 1) != q->swapped ? &q->options.pose_b : &q->options.pose_a;
        ebpo_status status = ebpo_posing_make(&posing[i], pose, max_coordinate, error);
        if (status != EBPO_OK)
            return status;
        q->max_coordinate = fmax(q->max_coordinate, ebpo_posed_extent(&posing[i], max_coordinate));
    }
    for (int i = 0; i < 2; i++)
        ebpo_block_posing_make(&q->posing[i], &posing[i], q->max_coordinate);
    return EBPO_OK;
}

ebpo_status ebpo_collision_begin(ebpo_collision *out, ebpo_collider *c,
                                 const ebpo_collide_options *options, ebpo_error *error)
{
    out->options = (ebpo_collide_options)EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_collide_options, &out->options, options, error);
    if (status != EBPO_OK)
        return status;
    out->collider = c;
    out->swapped = comes_second(c, &out->options);
    out->model[0] = c->model[out->swapped];
    out->model[1] = c->model[!out->swapped];
    out->deadline = out->options.deadline_ns ? ebpo_clock() + out->options.deadline_ns : UINT64_MAX;
    return make_posings(out, error);
}

bool ebpo_collision_is_in_parts(const ebpo_collision *q)
{
    return !(q->model[0]->whole && q->model[1]->whole);
}

bool ebpo_collision_is_late(const ebpo_collision *q)
{
    return q->deadline != UINT64_MAX && ebpo_clock() >= q->deadline;
}

/* Counts the bytes of a file once if both models use the file. */
uint64_t ebpo_collision_bytes_read(const ebpo_collision *q)
{
    uint64_t bytes = 0;
    for (int i = 0; i < 2; i++) {
        ebpo_file_stats stats = EBPO_FILE_STATS_INIT;
        if ((i == 0 || q->model[0]->file != q->model[1]->file) &&
            ebpo_file_get_stats(q->model[i]->file, &stats) == EBPO_OK)
            bytes += stats.bytes_read;
    }
    return bytes;
}

ebpo_face_pair ebpo_collision_pair(const ebpo_collision *q, const ebpo_accel *first,
                                   const ebpo_accel *second, const ebpo_found_pair *pair)
{
    uint64_t file[2] = { ebpo_accel_file_face(first, pair->a),
                         ebpo_accel_file_face(second, pair->b) };
    int a = q->swapped, b = !q->swapped;
    return (ebpo_face_pair){ EBPO_NO_FACE, EBPO_NO_FACE, file[a], file[b], pair->kind, 0 };
}

ebpo_status ebpo_collision_find_sources(const ebpo_collision *q, ebpo_face_pair *pairs,
                                        uint64_t count, ebpo_error *error)
{
    const ebpo_model *a = q->model[q->swapped], *b = q->model[!q->swapped];
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++) {
        status = ebpo_model_source_face(a, pairs[i].file_face_a, &pairs[i].face_a, error);
        if (status == EBPO_OK)
            status = ebpo_model_source_face(b, pairs[i].file_face_b, &pairs[i].face_b, error);
    }
    return status;
}

void ebpo_pair_walk_begin(ebpo_pair_walk *w, const ebpo_accel_pair *pair)
{
    w->pair = pair;
    w->kernels = ebpo_walk_kernels_best();
    w->filter = ebpo_pair_kernels_best();
    w->top = w->group = w->found_count = 0;
    w->begin = 0;
    w->end = pair->accel[0]->face_count;
    for (int i = 0; i < EBPO_TURNED_NODES; i++)
        w->turned_node[0][i] = w->turned_node[1][i] = EBPO_NO_CHILD;
    ebpo_posed_faces_forget(w->posed);
}
