/* Delivers a file level by level, node by node in order of octcodes (locational codes), for
 * programs that show or process a model while it arrives.
 *
 * After a level is completed, only its node types and colours stay in memory, and its planes if
 * polygons are requested. These arrays are enough to find the nodes of the next level by a
 * depth-first walk from the root. The walk visits the groups (eight siblings) of a level, its nodes
 * of each type and its planes in the order in which the file stores them. So the position of an
 * item in its stored array is the number of such items that were visited before, and no tables of
 * positions are needed.
 *
 * Half-spaces and polygons are converted from cell coordinates to model coordinates. The offset of
 * a half-space is enlarged by a bound of the rounding errors. So each point of the cell that is in
 * the exact half-space (of the plane code) is also in the delivered half-space. Points on cell
 * faces get the faces' exact coordinates, so that neighbours agree to the last bit. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/stream.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "format/reader.h"
#include "format/schema.h"
#include "geometry/cells.h"
#include "geometry/level_nodes.h"
#include "levels/stream.h"

/* --- from cell to model coordinates --- */

/* Let p be a point in the model's coordinates, corner the lowest corner of the cell, size the
 * lengths of its sides, t its shortest side, and N = t n / size (for each coordinate). Then the
 * half-space of the plane code (n, d) is
 *     N . (p - corner) <= t d / 4096.
 * For any normal a, any factor f > 0, and p in the cell:
 *     a . p = a . corner + f N . (p - corner) + (a - f N) . (p - corner)
 *          <= a . corner + f t d / 4096 + sum |a - f N| size.
 * Here f is the computed 1 / |N| and a is the computed f N, so that |a - f N| <= 4 u |a|, where u
 * is DBL_EPSILON / 2. The sum of the other rounding errors of this function is less than 8 u S,
 * where S is sum |a| (|corner| + size). A caller that evaluates a . p makes an error of at most 4 u
 * S. The offset is raised by 32 u S, which is more than all of these errors, and by two small terms
 * for underflow. */
void ebpo_plane_to_world(const ebpo_box *box, ebpo_cell cell, const int32_t n[3], int32_t d,
                         double out[4])
{
    double corner[3], size[3], magnitude = 0, extent = 0, at = 0, square = 0;
    for (int k = 0; k < 3; k++) {
        corner[k] = ebpo_cell_face(box, k, cell.level, cell.at[k]);
        size[k] = box->size[k] / (double)(1u << cell.level);
    }
    double shortest = fmin(size[0], fmin(size[1], size[2]));
    for (int k = 0; k < 3; k++) {
        out[k] = (double)n[k] * (shortest / size[k]);
        square += out[k] * out[k];
    }
    double factor = 1 / sqrt(square);
    for (int k = 0; k < 3; k++) {
        out[k] *= factor;
        at += out[k] * corner[k];
        magnitude += fabs(out[k]) * (fabs(corner[k]) + size[k]);
        extent += fabs(corner[k]) + size[k];
    }
    out[3] = at + factor * shortest * ((double)d / 4096) +
             (16 * DBL_EPSILON * magnitude + 4 * DBL_MIN * extent + 64 * DBL_TRUE_MIN);
}

/* Converts the vertices of a polytope. Coordinates are rounded, but vertices on cell faces get the
 * exact coordinates of the cell faces, so that neighbours agree to the last bit. */
static void polytope_to_world(const ebpo_polytope *p, const ebpo_box *box, ebpo_cell cell,
                              double (*out)[3])
{
    uint8_t sides[EBPO_POLYTOPE_VERTICES];
    ebpo_polytope_sides(p, sides);
    for (int v = 0; v < p->vertex_count; v++)
        for (int k = 0; k < 3; k++)
            out[v][k] = ebpo_cell_face_point(box, cell, k, p->vertex[v][k], sides[v]);
}

/* --- filling in an ebpo_stream_node --- */

void ebpo_node_begin(ebpo_stream_node *out, const ebpo_box *box, uint64_t octcode,
                     ebpo_node_type type)
{
    ebpo_cell cell = ebpo_cell_of_octcode(octcode);
    *out = (ebpo_stream_node){ .octcode = octcode, .type = type, .colour = EBPO_COLOUR_OF_NOTHING };
    ebpo_cell_bounds(box, cell, out->min, out->max);
    if (type == EBPO_BLACK)
        out->volume = ebpo_cell_volume(box, cell.level);
}

void ebpo_node_add_planes(ebpo_stream_node *out, const ebpo_box *box, const uint32_t *codes,
                          unsigned count, ebpo_node_buffers *buffers)
{
    ebpo_cell cell = ebpo_cell_of_octcode(out->octcode);
    for (unsigned i = 0; i < count; i++) {
        int32_t n[3], d;
        if (ebpo_plane_decode(codes[i], n, &d))
            ebpo_plane_to_world(box, cell, n, d, buffers->planes[out->plane_count++]);
    }
    out->planes = (const double(*)[4])buffers->planes;
}

void ebpo_node_add_polygons(ebpo_stream_node *out, const ebpo_box *box, const ebpo_polytope *p,
                            ebpo_node_buffers *buffers)
{
    ebpo_cell cell = ebpo_cell_of_octcode(out->octcode);
    polytope_to_world(p, box, cell, buffers->vertices);
    for (int f = 0; f <= p->face_count; f++)
        buffers->polygon_first[f] = p->first[f];
    for (int i = 0; i < p->corner_count; i++)
        buffers->corners[i] = p->corner[i];
    out->volume = ebpo_polytope_volume(p) * ebpo_cell_volume(box, cell.level);
    out->vertex_count = (uint32_t)p->vertex_count;
    out->polygon_count = (uint32_t)p->face_count;
    out->vertices = (const double(*)[3])buffers->vertices;
    out->polygon_first = buffers->polygon_first;
    out->corners = buffers->corners;
}

/* --- walking the nodes of one level --- */

typedef struct level_walk_node {
    ebpo_octcode octcode;
    ebpo_node_type type;
    uint64_t rank;         /* position among the nodes of its type in the level */
    const uint32_t *codes; /* [code_count] the node's plane codes; NULL: none */
    unsigned code_count;
} level_walk_node;

typedef struct level_walk {
    /* [target + 1] owned by the caller; in levels above the target, only types, plane counts and
     * planes are used */
    const ebpo_level *level;
    /* target: level whose nodes are returned; depth: level of the next node to visit */
    int target, depth;
    bool pruned; /* the file is a subset with pruned nodes, which have empty groups of children */
    struct {     /* [level] state of the walk */
        /* how many groups, nodes of each type, and planes of gray nodes and leaves were visited */
        uint64_t group, rank[4], plane, leaf_plane;
        unsigned octant; /* next octant of the group */
        /* last visited node; in levels above `depth`, it is the ancestor of the next node */
        level_walk_node node;
    } at[EBPO_LEVELS_MAX];
} level_walk;

static void level_walk_begin(level_walk *walk, const ebpo_level *level, int target, bool pruned)
{
    memset(walk, 0, sizeof *walk);
    walk->level = level;
    walk->target = target;
    walk->pruned = pruned;
}

/* Visits the next node of level `depth`. The caller ensures that there is a next node. */
static level_walk_node *visit_next_node(level_walk *w, int depth)
{
    const ebpo_level *level = &w->level[depth];
    unsigned octant = w->at[depth].octant++;
    level_walk_node *node = &w->at[depth].node;
    node->octcode = depth ? ebpo_octcode_child(w->at[depth - 1].node.octcode, octant) : 1;
    node->type = ebpo_group_type(level->types[w->at[depth].group], octant);
    node->rank = w->at[depth].rank[node->type]++;
    node->codes = NULL;
    node->code_count = 0;
    if (node->type == EBPO_GRAY && level->plane_counts) {
        node->code_count = level->plane_counts[node->rank];
        node->codes = node->code_count ? level->planes + w->at[depth].plane : NULL;
        w->at[depth].plane += node->code_count;
    } else if (node->type == EBPO_LEAF && level->leaf_plane_counts) {
        node->code_count = level->leaf_plane_counts[node->rank];
        node->codes = node->code_count ? level->leaf_planes + w->at[depth].leaf_plane : NULL;
        w->at[depth].leaf_plane += node->code_count;
    }
    return node;
}

/* Sets *out to the next node of the target level. Returns false after the last node. */
static bool level_walk_next(level_walk *w, level_walk_node *out)
{
    for (;;) {
        int depth = w->depth;
        if (w->at[depth].octant == ebpo_group_octants(depth)) { /* level 0 has one octant */
            if (depth == 0)
                return false;
            w->at[depth].group++;
            w->at[depth].octant = 0;
            w->depth--;
            continue;
        }
        /* An empty group stores eight white types, but its nodes are not in the file. */
        if (w->pruned && depth && w->level[depth].types[w->at[depth].group] == 0) {
            w->at[depth].rank[EBPO_WHITE] += 8;
            w->at[depth].octant = 8;
            continue;
        }
        const level_walk_node *node = visit_next_node(w, depth);
        if (depth == w->target) {
            *out = *node;
            return true;
        }
        if (node->type == EBPO_GRAY)
            w->depth++;
    }
}

/* Returns the envelope of the node of level `depth` that was visited last. Computes it from the
 * envelopes of the node's ancestors, which are kept in `e`. */
static const ebpo_polytope *ancestor_envelope(const level_walk *w, int depth,
                                              ebpo_envelope_stack *e)
{
    const level_walk_node *node = &w->at[depth].node;
    const ebpo_polytope *held = ebpo_envelope_held(e, node->octcode);
    if (held)
        return held;
    if (depth)
        (void)ancestor_envelope(w, depth - 1, e);
    return ebpo_envelope_put(e, node->octcode, node->codes, node->code_count);
}

/* Returns the envelope, in cell coordinates, of the last node from level_walk_next. The envelope of
 * a gray node or leaf is the cube, cut by the planes of the node and of all its ancestors. The
 * envelope of a black node is the cube. The result is valid until the next call with `e`. */
static const ebpo_polytope *level_walk_envelope(const level_walk *w, const level_walk_node *node,
                                                ebpo_envelope_stack *e)
{
    return node->type == EBPO_BLACK ? ebpo_envelope_put_cube(e, node->octcode)
                                    : ancestor_envelope(w, w->target, e);
}

/* --- the stream --- */

enum { RANGE_NODES = 4096 }; /* number of nodes in a range; each range is processed by one thread */

struct ebpo_stream {
    const ebpo_file *file;
    const ebpo_info *info;
    ebpo_stream_options options;
    ebpo_box box;
    int level; /* last level read; -1: none */
    /* [level + 1] arrays of the levels read so far; arrays that are not needed any more are freed
     */
    ebpo_level kept[EBPO_LEVELS_MAX];
    uint64_t bytes; /* size of the header and of the levels read so far */
    /* volume of the leaves and black nodes in all levels up to `level` */
    double terminal_volume;
    level_walk walk;                /* returns the nodes of level `level` */
    ebpo_envelope_stack *envelopes; /* NULL if no polygons are requested */
    ebpo_node_buffers buffers;
};

ebpo_status ebpo_stream_new(const ebpo_file *file, const ebpo_stream_options *options,
                            ebpo_stream **out, ebpo_error *error)
{
    ebpo_stream_options wanted = EBPO_STREAM_OPTIONS_INIT;
    *out = NULL;
    ebpo_status status = EBPO_TAKE(ebpo_stream_options, &wanted, options, error);
    if (status != EBPO_OK)
        return status;
    ebpo_stream *s = ebpo_alloc_zero(1, sizeof *s);
    if (!s)
        return ebpo_fail_memory(error, sizeof *s);
    s->file = file;
    s->info = ebpo_file_info(file);
    s->options = wanted;
    s->level = -1;
    s->box = ebpo_root_box(s->info);
    s->bytes = s->info->head_bytes;
    if (s->options.polygons && !(s->envelopes = ebpo_alloc_zero(1, sizeof *s->envelopes))) {
        ebpo_stream_free(s);
        return ebpo_fail_memory(error, sizeof *s->envelopes);
    }
    *out = s;
    return EBPO_OK;
}

void ebpo_stream_free(ebpo_stream *s)
{
    if (!s)
        return;
    for (int i = 0; i <= s->level; i++)
        ebpo_level_free(&s->kept[i]);
    free(s->envelopes);
    free(s);
}

/* --- reading a level --- */

/* Frees the arrays of a completed level that the walk to deeper levels does not need. */
static void drop_unneeded_arrays(ebpo_level *level, bool planes)
{
    ebpo_level_drop(level, ~(uint32_t)(EBPO_NEEDS_ALWAYS | EBPO_NEEDS_COLOURS |
                                       (planes ? EBPO_NEEDS_PLANES : 0)));
}

static uint64_t sum_counts(const uint8_t *counts, uint64_t count)
{
    uint64_t sum = 0;
    for (uint64_t i = 0; counts && i < count; i++)
        sum += counts[i];
    return sum;
}

/* Checks the values that the walk needs: the numbers of groups, nodes and planes. `number` is the
 * level's number. */
static ebpo_status check_level(const ebpo_level *level, int number, uint64_t parents,
                               ebpo_error *error)
{
    uint64_t count[4];
    if (level->group_count != parents)
        return ebpo_fail(error, EBPO_E_FORMAT,
                         "level %d: %" PRIu64 " groups of siblings, but %" PRIu64
                         " parents; run ebpo verify",
                         number, level->group_count, parents);
    ebpo_groups_count_at(number, level->types, level->group_count, count);
    if (count[EBPO_GRAY] != level->gray_count || count[EBPO_LEAF] != level->leaf_count ||
        count[EBPO_BLACK] != level->black_count || count[EBPO_WHITE] != level->white_count)
        return ebpo_fail(error, EBPO_E_FORMAT,
                         "level %d: the node types and the node counts disagree; run ebpo verify",
                         number);
    if (sum_counts(level->plane_counts, level->gray_count) !=
            (level->plane_counts ? level->plane_count : 0) ||
        sum_counts(level->leaf_plane_counts, level->leaf_count) !=
            (level->leaf_plane_counts ? level->leaf_plane_count : 0))
        return ebpo_fail(error, EBPO_E_FORMAT,
                         "level %d: the sum of the nodes' plane counts is not the number of "
                         "planes; run ebpo verify",
                         number);
    return EBPO_OK;
}

/* --- volumes --- */

typedef struct volumes {
    /* volume of the gray nodes; volume of the leaves and black nodes */
    double gray, terminal_volume;
} volumes;

/* The job of computing the volume of a level. Its tasks are ranges of RANGE_NODES nodes. */
typedef struct job {
    const ebpo_stream *stream;
    int target; /* the level */
    /* [ranges] state of the walk before the first node of each range */
    level_walk *starts;
    volumes *sums;                  /* [ranges] */
    ebpo_envelope_stack *envelopes; /* [threads] */
} job;

static ebpo_status sum_ranges(void *context, uint64_t begin, uint64_t end, unsigned worker,
                              ebpo_error *error)
{
    const job *j = context;
    double cell = ebpo_cell_volume(&j->stream->box, j->target);
    (void)error;
    for (uint64_t i = begin; i < end; i++) {
        level_walk walk = j->starts[i];
        level_walk_node node;
        for (int k = 0; k < RANGE_NODES && level_walk_next(&walk, &node); k++)
            if (node.type != EBPO_WHITE)
                *(node.type == EBPO_GRAY ? &j->sums[i].gray : &j->sums[i].terminal_volume) +=
                    ebpo_polytope_volume(level_walk_envelope(&walk, &node, &j->envelopes[worker])) *
                    cell;
    }
    return EBPO_OK;
}

/* Finds the start of each range, by a walk that computes no envelopes. The ranges, and therefore
 * the rounding of the sum, do not depend on the number of threads. */
static void find_starts(job *j)
{
    level_walk walk;
    level_walk_node node;
    level_walk_begin(&walk, j->stream->kept, j->target, j->stream->info->pruned);
    uint64_t visited = 0;
    do {
        if (visited % RANGE_NODES == 0)
            j->starts[visited / RANGE_NODES] = walk;
        visited++;
    } while (level_walk_next(&walk, &node));
}

/* Computes the volumes of level `target`, which has `nodes` nodes, from the nodes' envelopes. */
static ebpo_status cut_volumes(const ebpo_stream *s, int target, uint64_t nodes, volumes *out,
                               ebpo_error *error)
{
    unsigned threads = ebpo_thread_count(s->options.threads);
    uint64_t ranges = nodes / RANGE_NODES + 1;
    job j = { s, target, ebpo_alloc(ranges, sizeof *j.starts),
              ebpo_alloc_zero(ranges, sizeof *j.sums),
              ebpo_alloc_zero(threads, sizeof *j.envelopes) };
    ebpo_status status = EBPO_OK;
    if (!j.starts || !j.sums || !j.envelopes) {
        status = ebpo_fail_memory(error, ranges * (sizeof *j.starts + sizeof *j.sums) +
                                             threads * sizeof *j.envelopes);
        goto done;
    }
    find_starts(&j);
    status = ebpo_parallel_for(threads, NULL, ranges, 1, sum_ranges, &j, NULL, "cutting envelopes",
                               error);
    for (uint64_t i = 0; i < ranges; i++) {
        out->gray += j.sums[i].gray;
        out->terminal_volume += j.sums[i].terminal_volume;
    }
done:
    free(j.starts);
    free(j.sums);
    free(j.envelopes);
    return status;
}

/* Returns the volumes that the file's header states for a level. */
static volumes stated_volumes(const ebpo_stream *s, int level)
{
    const ebpo_level_summary *summary = &s->info->level[level];
    return (volumes){ summary->gray_volume,
                      summary->leaf_volume +
                          (double)summary->black_count * ebpo_cell_volume(&s->box, level) };
}

/* --- advancing to the next level --- */

void ebpo_stream_prefetch(const ebpo_stream *s, int last)
{
    ebpo_hints e = EBPO_HINTS_INIT(s->file);
    for (int level = s->level + 1; level <= last && level < s->info->level_count; level++)
        ebpo_hint_level(&e, level, EBPO_PART_MESH);
    ebpo_hint_all(&e);
}

ebpo_status ebpo_stream_next_level(ebpo_stream *s, ebpo_stream_level *out, bool *more,
                                   ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    int next = s->level + 1;
    *more = false;
    if (next >= s->info->level_count)
        return EBPO_OK;
    ebpo_level *level = &s->kept[next];
    uint64_t parents = next ? s->kept[next - 1].gray_count : 1;
    ebpo_read_options read = ebpo_read_threads(s->options.threads);
    read.omitted_parts = EBPO_PART_MESH;
    ebpo_status status = ebpo_file_read_level(s->file, next, &read, level, error);
    if (status != EBPO_OK)
        return status;
    volumes v = stated_volumes(s, next);
    /* The header was checked when the file was opened, so pruned_count is at most the number of
     * parents. */
    uint64_t nodes = next ? 8 * (parents - s->info->level[next - 1].pruned_count) : 1;
    status = check_level(level, next, parents, error);
    if (status == EBPO_OK && s->options.polygons) {
        v = (volumes){ 0, 0 };
        status = cut_volumes(s, next, nodes, &v, error);
    }
    if (status != EBPO_OK) {
        ebpo_level_free(level);
        memset(level, 0, sizeof *level);
        return status;
    }
    if (next)
        drop_unneeded_arrays(&s->kept[next - 1], s->options.polygons);
    s->level = next;
    s->terminal_volume += v.terminal_volume;
    s->bytes += ebpo_reader_level_bytes(s->file, next) +
                (next == s->info->index_level ? s->info->chunk_index_bytes : 0);
    level_walk_begin(&s->walk, s->kept, next, s->info->pruned);
    *out = (ebpo_stream_level){ next, nodes, s->bytes, v.gray + s->terminal_volume };
    *more = true;
    return EBPO_OK;
}

/* --- returning nodes --- */

/* Returns the stored winding number of a node. If the file stores none, the winding number is 1 for
 * black nodes and 0 for other nodes. */
static int32_t winding_of(const ebpo_level *level, const level_walk_node *node)
{
    switch (node->type) {
    case EBPO_WHITE: return level->white_winding ? level->white_winding[node->rank] : 0;
    case EBPO_BLACK: return level->black_winding ? level->black_winding[node->rank] : 1;
    case EBPO_LEAF: return level->leaf_winding ? level->leaf_winding[node->rank] : 0;
    case EBPO_GRAY:
    default: return 0;
    }
}

/* Sets the colour of a node. A node that is not gray gets the colour of its parent, which was
 * visited before. */
static void add_colour(const ebpo_stream *s, const level_walk_node *node, ebpo_stream_node *out)
{
    bool gray = node->type == EBPO_GRAY;
    int level = s->level - !gray;
    const uint32_t *colours = level < 0 ? NULL : s->kept[level].gray_colours;
    out->coloured = colours != NULL;
    if (colours)
        out->colour = colours[gray ? node->rank : s->walk.at[level].node.rank];
}

ebpo_status ebpo_stream_next_node(ebpo_stream *s, ebpo_stream_node *out, bool *more,
                                  ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    level_walk_node node;
    *more = false;
    if (s->level < 0)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "no level has been read yet; call ebpo_stream_next_level first");
    if (!level_walk_next(&s->walk, &node))
        return EBPO_OK;
    ebpo_node_begin(out, &s->box, node.octcode, node.type);
    out->winding = winding_of(&s->kept[s->level], &node);
    add_colour(s, &node, out);
    if (s->options.planes || s->options.polygons)
        ebpo_node_add_planes(out, &s->box, node.codes, node.code_count, &s->buffers);
    if (s->options.polygons && node.type != EBPO_WHITE)
        ebpo_node_add_polygons(out, &s->box, level_walk_envelope(&s->walk, &node, s->envelopes),
                               &s->buffers);
    *more = true;
    return EBPO_OK;
}
