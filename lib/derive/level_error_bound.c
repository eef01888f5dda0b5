/* Measures the error of a level: bounds of the largest distance by which its envelopes extend
 * beyond the model, and the mean distance, from samples. The envelope of a node is a convex
 * polyhedron that contains the part of the solid in the node's cell. Gray nodes have children,
 * leaves list faces, and black nodes are inside the solid. The level may be a level of a subset.
 * Distances are always measured to the whole model.
 *
 * A level's bounds are the largest bounds of its nodes. A short search for each node
 * (error_bound.h) shows for most nodes that they do not have the largest distance. The other nodes
 * are searched in the order of their upper bounds.
 *
 * Samples are points on the level's polygons. The area of the polygons is divided into equal parts,
 * with one sample in each part. A sample counts if its polygon is on the outside of the level: the
 * point slightly in front of the polygon must be in no other envelope. */
#include "core/strict_fp.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/error_bound.h>
#include <ebpo/lod.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "core/hash.h"
#include "derive/error_bound.h"
#include "derive/fragments.h"
#include "geometry/cells.h"
#include "query/query_model.h"

typedef struct sampling {
    const ebpo_error_bound_options *o;
    int level;
    ebpo_box box;
    ebpo_cell_frame frame;    /* frame of the root cell; `distance` and areas are in its unit */
    ebpo_mesh mesh;           /* the level's polygons as triangles */
    ebpo_lod_nodes nodes;     /* the nodes with these polygons */
    uint64_t *first_triangle; /* [node_count + 1] first triangle of each node */
    uint32_t *triangle;       /* [samples] index of the triangle that has the sample */
    double *distance;        /* [samples] distance from the model; NAN: the sample does not count */
    ebpo_context **contexts; /* [threads] */
    unsigned threads;
} sampling;

/* Returns random number `index`, between 0 and 1, of the sequence that `seed` selects. */
static double random_unit(uint64_t seed, uint64_t index)
{
    uint64_t number = seed * UINT64_C(0xd1342543de82ef95) + index + 1;
    return ebpo_random_unit(ebpo_random_mix(number * EBPO_RANDOM_STEP));
}

static const double *triangle_corner(const sampling *s, uint64_t triangle, int i)
{
    return s->mesh.xyz64 + 3 * (uint64_t)s->mesh.faces[3 * triangle + (uint64_t)i];
}

static double triangle_area(const sampling *s, uint64_t triangle)
{
    double u[3], v[3], n[3];
    for (int k = 0; k < 3; k++) {
        u[k] = ebpo_cell_frame_length(&s->frame, triangle_corner(s, triangle, 1)[k] -
                                                     triangle_corner(s, triangle, 0)[k]);
        v[k] = ebpo_cell_frame_length(&s->frame, triangle_corner(s, triangle, 2)[k] -
                                                     triangle_corner(s, triangle, 0)[k]);
    }
    for (int k = 0; k < 3; k++)
        n[k] = u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3];
    return .5 * sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
}

/* Divides the area into `samples` equal parts. Chooses a random position in each part, and stores
 * the triangle that has this position. */
static void distribute_samples(sampling *s)
{
    double total = 0, area_before = 0;
    uint64_t t = 0;
    for (uint64_t i = 0; i < s->mesh.face_count; i++)
        total += triangle_area(s, i);
    double area = s->mesh.face_count ? triangle_area(s, 0) : 0;
    for (uint64_t i = 0; i < s->o->samples; i++) {
        double at = ((double)i + random_unit(s->o->seed, 3 * i)) / (double)s->o->samples * total;
        while (area_before + area <= at && t + 1 < s->mesh.face_count) {
            area_before += area;
            area = triangle_area(s, ++t);
        }
        s->triangle[i] = (uint32_t)t;
    }
}

/* --- the envelope that contains a point --- */

/* Returns the index of the node to which a triangle belongs. */
static uint64_t node_of_triangle(const sampling *s, uint64_t triangle)
{
    uint64_t low = 0, high = s->nodes.node_count;
    while (high - low > 1) {
        uint64_t middle = low + (high - low) / 2;
        *(s->first_triangle[middle] <= triangle ? &low : &high) = middle;
    }
    return low;
}

/* Returns the index of the node with an octcode (locational code), or node_count if there is none.
 * Nodes are sorted by octcode. */
static uint64_t find_node(const sampling *s, uint64_t octcode)
{
    uint64_t low = 0, high = s->nodes.node_count;
    while (low < high) {
        uint64_t middle = low + (high - low) / 2;
        *(s->nodes.nodes[middle].octcode < octcode ? &low : &high) =
            s->nodes.nodes[middle].octcode < octcode ? middle + 1 : middle;
    }
    return low < s->nodes.node_count && s->nodes.nodes[low].octcode == octcode
               ? low
               : s->nodes.node_count;
}

/* Computes a triangle's normal in root cell coordinates, of length 1. Returns false if the triangle
 * has no area. */
static bool unit_normal(const sampling *s, uint64_t triangle, double n[3])
{
    double u[3], v[3], length = 0;
    for (int k = 0; k < 3; k++) {
        u[k] = (triangle_corner(s, triangle, 1)[k] - triangle_corner(s, triangle, 0)[k]) /
               s->box.size[k];
        v[k] = (triangle_corner(s, triangle, 2)[k] - triangle_corner(s, triangle, 0)[k]) /
               s->box.size[k];
    }
    for (int k = 0; k < 3; k++)
        n[k] = u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3];
    length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int k = 0; k < 3 && length > 0; k++)
        n[k] /= length;
    return length > 0;
}

/* Returns true if a point is behind the planes of all triangles of a node's envelope. */
static bool is_in_node_envelope(const sampling *s, uint64_t node, const double p[3])
{
    double slack = 1e-9 * ebpo_half_power(s->level);
    for (uint64_t t = s->first_triangle[node]; t < s->first_triangle[node + 1]; t++) {
        double n[3], in_front = 0; /* distance in front of the triangle's plane */
        if (!unit_normal(s, t, n))
            continue;
        for (int k = 0; k < 3; k++)
            in_front += n[k] * ((p[k] - triangle_corner(s, t, 0)[k]) / s->box.size[k]);
        if (in_front > slack)
            return false;
    }
    return true;
}

/* Returns true if a point is in the envelope of a node other than `excluded`. */
static bool is_in_other_envelope(const sampling *s, uint64_t excluded, const double p[3])
{
    double xi[3];
    for (int k = 0; k < 3; k++) {
        xi[k] = (p[k] - s->box.origin[k]) / s->box.size[k];
        if (!(xi[k] >= 0 && xi[k] < 1))
            return false;
    }
    for (int level = 0; level <= s->level; level++) {
        ebpo_cell cell = { level, { 0, 0, 0 } };
        for (int k = 0; k < 3; k++)
            cell.at[k] = (uint32_t)(xi[k] * (double)(1u << level));
        uint64_t node = find_node(s, ebpo_octcode_of_cell(cell));
        if (node < s->nodes.node_count)
            return node != excluded && is_in_node_envelope(s, node, p);
    }
    return false;
}

/* --- samples --- */

/* Chooses the point of sample i in the sample's triangle. Measures the point's distance from the
 * model, if the sample counts. */
static ebpo_status measure_sample(sampling *s, uint64_t i, ebpo_context *context, ebpo_error *error)
{
    double a = sqrt(random_unit(s->o->seed, 3 * i + 1)), b = random_unit(s->o->seed, 3 * i + 2),
           p[3], n[3], q[3]; /* q: p moved slightly outward */
    uint64_t t = s->triangle[i];
    s->distance[i] = NAN;
    if (!unit_normal(s, t, n))
        return EBPO_OK;
    for (int k = 0; k < 3; k++) {
        double step =
            fmax(1e-6 * ebpo_half_power(s->level) * s->box.size[k],
                 16 * DBL_EPSILON *
                     fmax(fabs(s->box.origin[k]), fabs(s->box.origin[k] + s->box.size[k])));
        p[k] = (1 - a) * triangle_corner(s, t, 0)[k] +
               a * ((1 - b) * triangle_corner(s, t, 1)[k] + b * triangle_corner(s, t, 2)[k]);
        q[k] = p[k] + n[k] * step;
    }
    if (is_in_other_envelope(s, node_of_triangle(s, t), q))
        return EBPO_OK;
    ebpo_distance_result result;
    ebpo_status status = ebpo_distance(context, p, NULL, &result, error);
    s->distance[i] = fmax(0, ebpo_cell_frame_length(&s->frame, result.distance));
    return status;
}

static ebpo_status sample_some(void *context, uint64_t begin, uint64_t end, unsigned worker,
                               ebpo_error *error)
{
    sampling *s = context;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++)
        status = measure_sample(s, i, s->contexts[worker], error);
    return status;
}

/* Computes the mean and the root mean square of the samples that count. */
static void sum_up(const sampling *s, ebpo_error_bound *out)
{
    double sum = 0, squares = 0;
    for (uint64_t i = 0; i < s->o->samples; i++)
        if (!isnan(s->distance[i])) {
            out->samples++;
            sum += s->distance[i];
            squares += s->distance[i] * s->distance[i];
        }
    if (!out->samples)
        return;
    out->mean = ldexp(sum / (double)out->samples, s->frame.exponent);
    out->rms = ldexp(sqrt(squares / (double)out->samples), s->frame.exponent);
}

/* Makes the arrays and contexts of the sampling, and finds the first triangle of each node. */
static ebpo_status reserve_space(sampling *s, ebpo_model *model, ebpo_error *error)
{
    uint64_t triangles = 0, polygon = 0;
    s->first_triangle = ebpo_alloc(s->nodes.node_count + 1, sizeof *s->first_triangle);
    s->triangle = ebpo_alloc(s->o->samples, sizeof *s->triangle);
    s->distance = ebpo_alloc(s->o->samples, sizeof *s->distance);
    s->contexts = ebpo_alloc_zero(s->threads, sizeof *s->contexts);
    if (!s->first_triangle || !s->triangle || !s->distance || !s->contexts)
        return ebpo_fail_memory(error, s->nodes.node_count * 8 + s->o->samples * 12);
    for (uint64_t i = 0; i < s->nodes.node_count; i++) {
        s->first_triangle[i] = triangles;
        for (uint32_t k = 0; k < s->nodes.nodes[i].polygon_count; k++)
            triangles += s->nodes.corners[polygon++] - 2u;
    }
    s->first_triangle[s->nodes.node_count] = triangles;
    ebpo_status status = EBPO_OK;
    for (unsigned i = 0; i < s->threads && status == EBPO_OK; i++)
        status = ebpo_context_new(model, &s->contexts[i], error);
    return status;
}

/* Sets out->mean, out->rms and out->samples. */
static ebpo_status error_bound_sample(ebpo_model *model, const ebpo_file *file, int level,
                                      const ebpo_error_bound_options *options,
                                      ebpo_error_bound *out, ebpo_error *error)
{
    sampling s = { .o = options,
                   .level = level,
                   .box = ebpo_model_box(model),
                   .threads = ebpo_thread_count(options->threads) };
    ebpo_lod_options lod = EBPO_LOD_OPTIONS_INIT;
    lod.threads = options->threads;
    ebpo_cell_frame_make(&s.frame, &s.box, (ebpo_cell){ 0, { 0, 0, 0 } });
    ebpo_status status = ebpo_lod_level_nodes(file, level, &lod, &s.mesh, &s.nodes, NULL, error);
    if (status == EBPO_OK)
        status = reserve_space(&s, model, error);
    if (status == EBPO_OK && s.mesh.face_count) {
        distribute_samples(&s);
        status = ebpo_parallel_for(s.threads, NULL, options->samples, 64, sample_some, &s,
                                   &options->progress, "sampling the level's surface", error);
        if (status == EBPO_OK)
            sum_up(&s, out);
    }
    for (unsigned i = 0; s.contexts && i < s.threads; i++)
        ebpo_context_free(s.contexts[i]);
    free(s.contexts);
    free(s.first_triangle);
    free(s.triangle);
    free(s.distance);
    ebpo_lod_nodes_free(&s.nodes);
    ebpo_mesh_free(&s.mesh);
    return status;
}

/* --- bounds --- */

/* BLOCK_MAX: maximum number of nodes that are searched with the same goal. QUERIES_MAX: maximum
 * number of queries for each node. Only nodes whose envelopes are flat and close to the model would
 * need more queries. */
enum { BLOCK_MAX = 512, QUERIES_MAX = 1 << 16 };

/* A node with an envelope of the level, and the bounds of its error. */
typedef struct level_node {
    ebpo_cell cell;
    ebpo_envelope_bound bound;
} level_node;

/* The search for the bounds of a level. */
typedef struct survey {
    const ebpo_lod_model *level_tree; /* tree of the file, which may be a subset */
    const ebpo_lod_model *model_tree; /* tree of the whole model; may be the same tree */
    int level;
    level_node *nodes; /* [count] */
    uint64_t count, capacity;
    uint64_t *order;        /* [count] indices of the nodes in the order of the search */
    ebpo_bounder *bounders; /* [threads] */
    unsigned threads;
    ebpo_bound_goal goal; /* goal of the searches in the current block */
    uint64_t first;       /* start of the current block in `order` */
    bool queries_used_up; /* true: the queries were used up before the tolerance was reached */
    const ebpo_progress *progress;
    ebpo_error *error;
} survey;

/* --- the nodes of the level --- */

static ebpo_status add_node(survey *s, const ebpo_node *node)
{
    if (!ebpo_grow(&s->nodes, &s->capacity, s->count + 1, sizeof *s->nodes))
        return ebpo_fail_memory(s->error, (s->count + 1) * sizeof *s->nodes);
    s->nodes[s->count++] = (level_node){ node->cell, { 0, INFINITY, { 0, 0, 0 }, 0 } };
    return EBPO_OK;
}

/* Lists the nodes at or below `node` that have an envelope of the level, except black nodes: gray
 * nodes of the level, leaves, and pruned nodes above the level. */
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

/* Searches one node with the goal s->goal. */
static ebpo_status bound_node(survey *s, ebpo_bounder *b, level_node *node, ebpo_error *error)
{
    ebpo_node found;
    ebpo_status status = EBPO_OK;
    (void)ebpo_tree_bounds(s->level_tree, node->cell, true, &found, &b->half_spaces);
    if (found.type == EBPO_LEAF && s->level_tree->leaf_source == EBPO_LEAF_DERIVED)
        status = ebpo_tree_derive(s->level_tree, &found, &b->scratch, &b->half_spaces, error);
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

/* A node of the list, and its upper bound, for sorting. */
typedef struct ranked {
    double hi;     /* upper bound of the node's error */
    uint64_t node; /* index of the node */
} ranked;

/* Puts greater upper bounds first. */
static int compare_upper_bounds(const void *a, const void *b)
{
    const ranked *x = a, *y = b;
    if (x->hi != y->hi)
        return x->hi < y->hi ? 1 : -1;
    return (x->node > y->node) - (x->node < y->node);
}

/* Sets s->order: nodes with greater upper bounds first. */
static ebpo_status sort_nodes(survey *s)
{
    ranked *list = ebpo_alloc(s->count, sizeof *list);
    if (!list)
        return ebpo_fail_memory(s->error, s->count * sizeof *list);
    for (uint64_t i = 0; i < s->count; i++)
        list[i] = (ranked){ s->nodes[i].bound.hi, i };
    if (s->count)
        qsort(list, s->count, sizeof *list, compare_upper_bounds);
    for (uint64_t i = 0; i < s->count; i++)
        s->order[i] = list[i].node;
    free(list);
    return EBPO_OK;
}

/* Raises the lower bound in *out to the largest lower bound of the nodes s->order[first] to
 * s->order[last - 1]. */
static void raise_lower_bound(const survey *s, uint64_t first, uint64_t last, ebpo_error_bound *out)
{
    for (uint64_t i = first; i < last; i++) {
        const ebpo_envelope_bound *b = &s->nodes[s->order[i]].bound;
        if (b->lo > out->lo) {
            out->lo = b->lo;
            memcpy(out->location, b->location, sizeof out->location);
        }
    }
}

static uint64_t count_queries(const survey *s)
{
    uint64_t sum = 0;
    for (uint64_t i = 0; i < s->count; i++)
        sum += s->nodes[i].bound.queries;
    return sum;
}

/* Searches the nodes block by block. All nodes of a block have the same goal. This goal depends
 * only on the results of earlier blocks, so results do not depend on the number of threads. */
static ebpo_status search_nodes(survey *s, const ebpo_error_bound_options *o, ebpo_error_bound *out)
{
    uint64_t done = 0, block = 4, queries_done = count_queries(s);
    ebpo_status status = EBPO_OK;
    s->goal.ratio = 1 + o->tolerance;
    while (done < s->count && status == EBPO_OK && (!o->queries || queries_done < o->queries)) {
        uint64_t size = 0;
        s->goal.enough = (1 + o->tolerance) * out->lo;
        while (size < block && done + size < s->count &&
               s->nodes[s->order[done + size]].bound.hi > s->goal.enough)
            size++;
        if (!size)
            break;
        s->goal.queries = o->queries ? (o->queries - queries_done) / size + 1 : QUERIES_MAX;
        s->first = done;
        uint64_t before = 0, after = 0;
        for (uint64_t i = 0; i < size; i++)
            before += s->nodes[s->order[done + i]].bound.queries;
        status = ebpo_parallel_for(s->threads, NULL, size, 1, bound_some, s, NULL, NULL, s->error);
        for (uint64_t i = 0; i < size; i++)
            after += s->nodes[s->order[done + i]].bound.queries;
        queries_done += after - before;
        raise_lower_bound(s, done, done + size, out);
        done += size;
        block = block < BLOCK_MAX ? 2 * block : block;
        if (status == EBPO_OK &&
            !ebpo_progress_step(s->progress, "bounding envelopes", done, s->count, s->error))
            status = EBPO_E_CANCELLED;
    }
    return status;
}

/* Lowers the upper bounds of all nodes to `at_most`, an upper bound of a coarser level (0: none).
 */
static void bound_by_coarser(survey *s, double at_most)
{
    for (uint64_t i = 0; i < s->count && at_most > 0; i++) {
        ebpo_envelope_bound *b = &s->nodes[i].bound;
        b->hi = fmax(b->lo, fmin(b->hi, at_most));
    }
}

/* Returns true if the queries were used up before the tolerance was reached. */
static bool has_used_up_queries(const survey *s, const ebpo_error_bound_options *o,
                                const ebpo_error_bound *out)
{
    if (out->hi <= (1 + o->tolerance) * out->lo)
        return false;
    bool queries_used_up = o->queries && out->queries >= o->queries;
    for (uint64_t i = 0; i < s->count && !o->queries && !queries_used_up; i++)
        queries_used_up = s->nodes[i].bound.queries >= QUERIES_MAX;
    return queries_used_up;
}

/* Bounds the error of level s->level. */
static ebpo_status bound_level(survey *s, const ebpo_error_bound_options *o, ebpo_error_bound *out)
{
    ebpo_level_nodes tree = ebpo_lod_model_nodes(s->level_tree);
    ebpo_node root = ebpo_level_root(&tree);
    free(s->order);
    s->order = NULL;
    s->count = 0;
    s->first = 0; /* a search in a finer level may have changed it */
    ebpo_status status = list_nodes(s, &tree, &root);
    if (status == EBPO_OK && !(s->order = ebpo_alloc(s->count, sizeof *s->order)))
        status = ebpo_fail_memory(s->error, s->count * sizeof *s->order);
    for (uint64_t i = 0; i < s->count && status == EBPO_OK; i++)
        s->order[i] = i;
    s->goal = (ebpo_bound_goal){ .too_much = INFINITY, .queries = 1 };
    if (status == EBPO_OK)
        status = ebpo_parallel_for(s->threads, NULL, s->count, 16, bound_some, s, s->progress,
                                   "measuring envelopes", s->error);
    bound_by_coarser(s, o->at_most);
    if (status == EBPO_OK)
        status = sort_nodes(s);
    if (status != EBPO_OK)
        return status;
    raise_lower_bound(s, 0, s->count, out);
    status = search_nodes(s, o, out);
    for (uint64_t i = 0; i < s->count; i++)
        out->hi = fmax(out->hi, s->nodes[i].bound.hi);
    out->queries = count_queries(s);
    s->queries_used_up = has_used_up_queries(s, o, out);
    return status;
}

/* If the queries were used up, improves the upper bound by the bounds of coarser levels. Each
 * envelope is within its parent's envelope, so no level has a larger error than a coarser level.
 * The search in a coarser level cuts envelopes in another way and may give a lower upper bound. */
static ebpo_status use_coarser_levels(survey *s, const ebpo_error_bound_options *o,
                                      ebpo_error_bound *out)
{
    ebpo_status status = EBPO_OK;
    while (s->queries_used_up && s->level > 0 && !(o->at_most > 0) && status == EBPO_OK) {
        ebpo_error_bound coarser = EBPO_ERROR_BOUND_INIT;
        s->level--;
        status = bound_level(s, o, &coarser);
        if (status == EBPO_OK)
            out->hi = fmax(out->lo, fmin(out->hi, coarser.hi));
        out->queries += coarser.queries;
    }
    return status;
}

/* --- the call --- */

static ebpo_status make_bounders(survey *s, ebpo_model *model)
{
    ebpo_status status = EBPO_OK;
    if (!(s->bounders = ebpo_alloc_zero(s->threads, sizeof *s->bounders)))
        return ebpo_fail_memory(s->error, s->threads * sizeof *s->bounders);
    for (unsigned i = 0; i < s->threads && status == EBPO_OK; i++)
        status = ebpo_bounder_make(&s->bounders[i], s->model_tree, model, s->error);
    return status;
}

/* Returns NULL if the file may be the model's file or a subset of it. Otherwise returns the name of
 * the properties that differ. Digests alone cannot decide: a subset of a subset contains only the
 * digest of the original file, and a subset with all nodes contains no digest of another file. */
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
        return "build parameters";
    return NULL;
}

static ebpo_status check_error_bound(const ebpo_info *info, const ebpo_info *model, int level,
                                     const ebpo_error_bound_options *o, ebpo_error *error)
{
    if (level < 0 || level >= info->level_count)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "there is no level %d; this file has levels 0 to %d", level,
                         info->level_count - 1);
    if (!(o->tolerance > 0) || !(o->tolerance <= 1e6))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "tolerance %g: give a number above 0 and at most 1e6, such as 0.05",
                         o->tolerance);
    if (!(o->at_most >= 0))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "at_most %g: give an upper bound from a coarser level, or 0", o->at_most);
    if (o->samples > UINT32_MAX)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "more than 4294967295 samples; use fewer: a million samples give the mean "
                         "to three digits");
    const char *differ = find_difference(info, model);
    if (differ)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the file is neither the model's file nor a subset of it: their %s "
                         "differ; open the model of the original file",
                         differ);
    return EBPO_OK;
}

ebpo_status ebpo_level_error_bound(ebpo_model *model, const ebpo_file *file, int level,
                                   const ebpo_error_bound_options *options, ebpo_error_bound *out,
                                   ebpo_error *error)
{
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    EBPO_DEFAULT_FP;
    ebpo_error_bound_options wanted = EBPO_ERROR_BOUND_OPTIONS_INIT;
    const ebpo_error_bound_options *o = &wanted;
    ebpo_error_bound found = EBPO_ERROR_BOUND_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_error_bound_options, &wanted, options, error);
    if (status == EBPO_OK)
        status = EBPO_CHECK_SIZED(ebpo_error_bound, out, error);
    if (status != EBPO_OK)
        return status;
    found.mean = found.rms = NAN;
    ebpo_lod_model whole_tree = { 0 }, file_tree = { 0 };
    survey s = { .level = level,
                 .threads = ebpo_thread_count(o->threads),
                 .progress = &o->progress,
                 .error = error,
                 .model_tree = &whole_tree,
                 .level_tree = &whole_tree };
    status = check_error_bound(ebpo_file_info(file), model->info, level, o, error);
    if (status == EBPO_OK)
        status = ebpo_tree_read_whole(&whole_tree, model->file, s.threads, error);
    if (status == EBPO_OK && file != model->file) {
        read.threads = s.threads;
        status = ebpo_lod_model_read(&file_tree, file, level, &read, error);
        s.level_tree = &file_tree;
    }
    if (status == EBPO_OK)
        status = make_bounders(&s, model);
    if (status == EBPO_OK)
        status = bound_level(&s, o, &found);
    if (status == EBPO_OK)
        status = use_coarser_levels(&s, o, &found);
    for (unsigned i = 0; s.bounders && i < s.threads; i++)
        ebpo_bounder_free(&s.bounders[i]);
    free(s.bounders);
    free(s.nodes);
    free(s.order);
    if (status == EBPO_OK && o->samples)
        status = error_bound_sample(model, file, level, o, &found, error);
    EBPO_GIVE(ebpo_error_bound, out, &found);
    ebpo_lod_model_free(&file_tree);
    ebpo_lod_model_free(&whole_tree);
    return status;
}
