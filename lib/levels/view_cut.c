/* Manages the cut of a view, and the order of refinement. A view delivers nodes of the octree to a
 * program, from coarse to fine. The cut consists of the delivered nodes without delivered children.
 *
 * - A viewpoint is a prepared observer. It gives the distance of a cell, the cell's size in pixels,
 *   the cell's visibility in the frustum, and the priority key of a node. Because of rounding, a
 *   cell that is just outside the frustum may count as visible.
 * - The partial tree holds the delivered groups (eight siblings each). A group is linked to its
 *   parent after all nodes of the group have been delivered.
 * - The frontier holds the gray nodes of the cut in a binary heap. The first node of the heap is
 *   refined next, that is, replaced in the cut by its children. Nodes are ordered by turn (visible,
 *   not visible, never refined), then by key, then by octcode (locational code). No two nodes have
 *   the same octcode, so the order is deterministic. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/hash.h"
#include "geometry/cells.h"
#include "geometry/vec3.h"
#include "levels/view_cut.h"

/* --- the observer --- */

/* An upper bound, with a large margin, of the relative rounding error of a sum of three products. A
 * cell that is outside the frustum by less than this error counts as visible. */
static const double SLACK = 1e-12;

/* Scales a vector of any length to length 1; returns false for (0, 0, 0). */
static bool normalise_vector(const double v[3], double out[3])
{
    double largest = fmax(fabs(v[0]), fmax(fabs(v[1]), fabs(v[2])));
    if (!(largest > 0))
        return false;
    for (int k = 0; k < 3; k++)
        out[k] = v[k] / largest;
    double length = sqrt(ebpo_vec3_dot(out, out));
    for (int k = 0; k < 3; k++)
        out[k] /= length;
    return true;
}

static bool all_finite(const double v[3])
{
    return isfinite(v[0]) && isfinite(v[1]) && isfinite(v[2]);
}

static ebpo_status check_observer(const ebpo_observer *o, ebpo_error *error)
{
    if (!all_finite(o->eye) || !all_finite(o->direction) || !all_finite(o->up))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the observer's eye, direction and up must be finite numbers");
    if (!(o->fov > 0 && o->fov < 180))
        return ebpo_fail(
            error, EBPO_E_ARGUMENT,
            "the observer's angle of view must be above 0 and below 180 degrees; it is %g", o->fov);
    if (o->width == 0 || o->height == 0)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "the observer's picture has no pixels");
    return EBPO_OK;
}

/* Computes the frustum's side planes, and the plane through the eye that is parallel to the
 * picture. The inward normals of the side planes are t * forward + side and t * forward - side.
 * Here `side` is the direction to the right or up, and t is the tangent of half the angle of view
 * in this direction. */
static ebpo_status make_frustum(ebpo_viewpoint *s, const ebpo_observer *o, double tangent,
                                ebpo_error *error)
{
    double forward[3], side[2][3], up[3];
    s->no_frustum = !normalise_vector(o->direction, forward);
    if (s->no_frustum)
        return EBPO_OK;
    if (!normalise_vector(o->up, up))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "the observer's upward direction is (0, 0, 0)");
    ebpo_vec3_cross(forward, up, side[0]);
    if (ebpo_vec3_dot(side[0], side[0]) < 1e-12 || !normalise_vector(side[0], side[0]))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the observer's upward direction is parallel to the viewing direction; "
                         "give another upward direction");
    ebpo_vec3_cross(side[0], forward, side[1]);
    double tangents[2] = { tangent * ((double)o->width / o->height), tangent };
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 3; k++) {
            s->inward[2 * i][k] = tangents[i] * forward[k] + side[i][k];
            s->inward[2 * i + 1][k] = tangents[i] * forward[k] - side[i][k];
        }
    memcpy(s->inward[4], forward, sizeof forward);
    return EBPO_OK;
}

ebpo_status ebpo_viewpoint_make(ebpo_viewpoint *out, const ebpo_box *box,
                                const ebpo_observer *observer, ebpo_error *error)
{
    memset(out, 0, sizeof *out);
    if (!observer)
        return EBPO_OK;
    ebpo_status status = check_observer(observer, error);
    if (status != EBPO_OK)
        return status;
    int exponent;
    /* the unit: the power of two above the longest side of the root cell */
    (void)frexp(fmax(box->size[0], fmax(box->size[1], box->size[2])), &exponent);
    out->has_observer = true;
    out->unit = ldexp(1, exponent);
    double root_diagonal2 = 0, tangent = tan(observer->fov * (3.14159265358979323846 / 360));
    for (int k = 0; k < 3; k++) {
        double side = box->size[k] / out->unit;
        root_diagonal2 += side * side;
        out->eye[k] = observer->eye[k];
    }
    for (int i = 0; i < EBPO_LEVELS_MAX; i++)
        out->diagonal2[i] = root_diagonal2 * ebpo_half_power(2 * i);
    out->focal = (double)observer->height / (2 * tangent);
    return make_frustum(out, observer, tangent, error);
}

ebpo_seen ebpo_viewpoint_see(const ebpo_viewpoint *s, const ebpo_box *box, ebpo_cell cell)
{
    ebpo_seen out = { 0, true };
    double low[3], high[3]; /* bounds of the cell, relative to the eye */
    if (!s->has_observer)
        return out;
    for (int k = 0; k < 3; k++) {
        low[k] = (ebpo_cell_face(box, k, cell.level, cell.at[k]) - s->eye[k]) / s->unit;
        high[k] = (ebpo_cell_face(box, k, cell.level, cell.at[k] + 1) - s->eye[k]) / s->unit;
        double away = low[k] > 0 ? low[k] : high[k] < 0 ? -high[k] : 0;
        out.distance2 += away * away;
    }
    for (int i = 0; i < 5 && !s->no_frustum && out.seen; i++) {
        double greatest = 0, magnitude = 0;
        for (int k = 0; k < 3; k++) {
            double a = s->inward[i][k] * low[k], b = s->inward[i][k] * high[k];
            greatest += a > b ? a : b;
            magnitude += fabs(a) + fabs(b);
        }
        out.seen = !(greatest < -SLACK * magnitude);
    }
    return out;
}

double ebpo_viewpoint_distance(const ebpo_viewpoint *s, double distance2)
{
    return s->has_observer ? sqrt(distance2) * s->unit : NAN;
}

double ebpo_viewpoint_length(const ebpo_viewpoint *s, double length, double distance2)
{
    return s->has_observer ? s->focal * (length / s->unit / sqrt(distance2)) : NAN;
}

double ebpo_viewpoint_pixels(const ebpo_viewpoint *s, int level, double distance2)
{
    return s->has_observer ? s->focal * sqrt(s->diagonal2[level] / distance2) : NAN;
}

unsigned ebpo_viewpoint_octant(const ebpo_viewpoint *s, const ebpo_box *box, ebpo_cell cell)
{
    unsigned octant = 0;
    for (int k = 0; k < 3 && s->has_observer; k++)
        octant |=
            (unsigned)(s->eye[k] >= ebpo_cell_face(box, k, cell.level + 1, 2 * cell.at[k] + 1))
            << k;
    return octant;
}

/* Returns a key for the order from front to back. The key has three bits for each node above this
 * node: the octant of the path to this node, XOR the octant of the eye (ebpo_viewpoint_octant). */
static uint64_t octants_key(const ebpo_viewpoint *s, const ebpo_box *box, ebpo_octcode octcode)
{
    int level = ebpo_octcode_level(octcode);
    ebpo_cell cell = ebpo_cell_of_octcode(octcode);
    uint64_t key = 0;
    for (int i = 0; i < level; i++) {
        int up = level - i;
        ebpo_cell ancestor = { i, { cell.at[0] >> up, cell.at[1] >> up, cell.at[2] >> up } };
        unsigned octant = octcode >> 3 * (up - 1) & 7;
        key |= (uint64_t)(octant ^ ebpo_viewpoint_octant(s, box, ancestor))
               << 3 * (EBPO_MAX_LEVEL - 1 - i);
    }
    return key;
}

/* Returns the bits of a nonnegative double as an integer. These integers have the same order as the
 * doubles. */
static uint64_t double_bits(double v)
{
    uint64_t out;
    memcpy(&out, &v, sizeof out);
    return out;
}

uint64_t ebpo_viewpoint_key(const ebpo_viewpoint *s, const ebpo_box *box, ebpo_priority priority,
                            ebpo_octcode octcode, double distance2)
{
    switch (priority) {
    case EBPO_PRIORITY_DISTANCE: return double_bits(distance2);
    case EBPO_PRIORITY_PIXELS:
        return ~double_bits(s->diagonal2[ebpo_octcode_level(octcode)] / distance2);
    case EBPO_PRIORITY_FRONT_TO_BACK: return octants_key(s, box, octcode);
    case EBPO_PRIORITY_LEVEL:
    default: return octcode;
    }
}

/* --- the partial tree --- */

void ebpo_partial_free(ebpo_partial *partial)
{
    free(partial->group);
    free(partial->codes);
    free(partial->winding);
    memset(partial, 0, sizeof *partial);
}

/* Reserves space for one more group with this number of plane codes. */
static ebpo_status reserve_space(ebpo_partial *g, unsigned codes, ebpo_error *error)
{
    if (g->group_count >= UINT32_MAX)
        return ebpo_fail(
            error, EBPO_E_LIMIT,
            "more nodes than a view can hold; set a deepest level, or a limit of nodes "
            "or bytes, in the view's options");
    if (!ebpo_grow(&g->group, &g->group_capacity, g->group_count + 1, sizeof *g->group) ||
        !ebpo_grow(&g->codes, &g->code_capacity, g->code_count + codes, sizeof *g->codes) ||
        (g->windings &&
         !ebpo_grow(&g->winding, &g->winding_capacity, g->group_count + 1, sizeof *g->winding)))
        return ebpo_fail_memory(error, (g->group_count + 1) * sizeof *g->group +
                                           (g->code_count + codes) * sizeof *g->codes);
    return EBPO_OK;
}

ebpo_status ebpo_partial_add(ebpo_partial *g, const ebpo_info *info, uint64_t parent,
                             const ebpo_group *read, ebpo_error *error)
{
    int level = parent ? ebpo_octcode_level(parent) + 1 : 0;
    uint64_t grays = ebpo_group_count(read->types, EBPO_GRAY, 8);
    /* In a damaged file, one group may be the children of many nodes. Without this check, such a
     * view would never end. */
    if (grays > info->level[level].gray_count - g->grays[level])
        return ebpo_fail(
            error, EBPO_E_FORMAT,
            "level %d: the index has more gray nodes than the header states; run ebpo verify",
            level);
    ebpo_status status = reserve_space(g, read->code_count, error);
    if (status != EBPO_OK)
        return status;
    ebpo_partial_group *out = &g->group[g->group_count];
    *out = (ebpo_partial_group){ .parent = parent,
                                 .first_gray = read->rank[EBPO_GRAY],
                                 .first_code = g->code_count,
                                 .types = read->types };
    memcpy(out->plane_count, read->plane_count, sizeof out->plane_count);
    if (read->code_count)
        memcpy(g->codes + g->code_count, read->codes, read->code_count * sizeof *g->codes);
    if (g->windings)
        memcpy(g->winding[g->group_count], read->winding, sizeof *g->winding);
    g->grays[level] += grays;
    g->code_count += read->code_count;
    g->group_count++;
    return EBPO_OK;
}

const uint32_t *ebpo_partial_codes(const ebpo_partial *g, ebpo_partial_node node, unsigned *count)
{
    const ebpo_partial_group *group = &g->group[node.group];
    uint64_t first = group->first_code;
    for (unsigned i = 0; i < node.octant; i++)
        first += group->plane_count[i];
    *count = group->plane_count[node.octant];
    return *count ? g->codes + first : NULL;
}

const ebpo_polytope *ebpo_partial_envelope(const ebpo_partial *g, ebpo_partial_node node,
                                           ebpo_envelope_stack *e)
{
    ebpo_octcode octcode = ebpo_partial_octcode(g, node);
    int level = ebpo_octcode_level(octcode);
    const ebpo_polytope *envelope = NULL;
    ebpo_partial_node at = { 0, 0 };
    if (ebpo_partial_type(g, node) == EBPO_BLACK)
        return ebpo_envelope_put_cube(e, octcode);
    for (int depth = 0; depth <= level; depth++) {
        /* octcode of the node's ancestor at this depth, or of the node itself if depth is `level`
         */
        ebpo_octcode ancestor = octcode >> 3 * (level - depth);
        if (depth == level)
            at = node; /* the node's group may not be linked to its parent yet */
        else if (depth)
            at =
                (ebpo_partial_node){ g->group[at.group].child[at.octant], (uint8_t)(ancestor & 7) };
        envelope = ebpo_envelope_held(e, ancestor);
        if (!envelope) {
            unsigned count;
            const uint32_t *codes = ebpo_partial_codes(g, at, &count);
            envelope = ebpo_envelope_put(e, ancestor, codes, count);
        }
    }
    return envelope;
}

/* --- the frontier --- */

/* Returns true if node `a` is refined before node `b`. */
static bool waits_before(const ebpo_waiting *a, const ebpo_waiting *b)
{
    if (a->turn != b->turn)
        return a->turn < b->turn;
    return a->key != b->key ? a->key < b->key : a->octcode < b->octcode;
}

void ebpo_frontier_free(ebpo_frontier *f)
{
    free(f->at);
    memset(f, 0, sizeof *f);
}

ebpo_status ebpo_frontier_reserve(ebpo_frontier *f, uint64_t more, ebpo_error *error)
{
    return ebpo_grow(&f->at, &f->capacity, f->count + more, sizeof *f->at)
               ? EBPO_OK
               : ebpo_fail_memory(error, (f->count + more) * sizeof *f->at);
}

/* Moves the node at index i down the heap, until all nodes below it in the heap are refined after
 * it. */
static void sink_down(ebpo_frontier *f, uint64_t i)
{
    ebpo_waiting node = f->at[i];
    for (uint64_t below = 2 * i + 1; below < f->count; below = 2 * i + 1) {
        if (below + 1 < f->count && waits_before(&f->at[below + 1], &f->at[below]))
            below++;
        if (!waits_before(&f->at[below], &node))
            break;
        f->at[i] = f->at[below];
        i = below;
    }
    f->at[i] = node;
}

void ebpo_frontier_push(ebpo_frontier *f, ebpo_waiting node)
{
    uint64_t i = f->count++;
    for (; i > 0 && waits_before(&node, &f->at[(i - 1) / 2]); i = (i - 1) / 2)
        f->at[i] = f->at[(i - 1) / 2];
    f->at[i] = node;
}

ebpo_waiting ebpo_frontier_pop(ebpo_frontier *f)
{
    ebpo_waiting top = f->at[0];
    f->at[0] = f->at[--f->count];
    if (f->count)
        sink_down(f, 0);
    return top;
}

void ebpo_frontier_restore(ebpo_frontier *f)
{
    for (uint64_t i = f->count / 2; i-- > 0;)
        sink_down(f, i);
}

/* Collects the blocks of the frontier's nodes in a hash table. For each block, the table has the
 * node that is refined first. When the table has EBPO_FRONTIER_BLOCKS blocks, nodes of further
 * blocks are skipped. At the end, the nodes of the table are sorted. */
unsigned ebpo_frontier_blocks(const ebpo_frontier *f, uint64_t span,
                              uint64_t best[EBPO_FRONTIER_BLOCKS])
{
    enum { SLOTS = 4 * EBPO_FRONTIER_BLOCKS };
    struct {
        uint64_t block;      /* 0: the slot is free */
        uint64_t first_node; /* index in f->at of the block's node that is refined first */
    } slot[SLOTS];
    unsigned count = 0;
    memset(slot, 0, sizeof slot);
    for (uint64_t i = 0; i < f->count; i++) {
        const ebpo_waiting *w = &f->at[i];
        if (w->turn == EBPO_TURN_NEVER)
            continue;
        /* The lower six bits of a block's number depend on the level and are not 0, so the number
         * is never 0. */
        uint64_t block =
            (w->child_group / span) << 6 | (uint64_t)(64 - __builtin_clzll(w->octcode));
        uint64_t at;
        EBPO_HASH_FIND(at, ebpo_hash_number(block), SLOTS - 1,
                       !slot[at].block || slot[at].block == block);
        if (!slot[at].block && count == EBPO_FRONTIER_BLOCKS)
            continue;
        count += !slot[at].block;
        if (!slot[at].block || waits_before(w, &f->at[slot[at].first_node]))
            slot[at].first_node = i;
        slot[at].block = block;
    }
    count = 0;
    for (unsigned at = 0; at < SLOTS; at++)
        if (slot[at].block) {
            unsigned i = count++;
            for (; i > 0 && waits_before(&f->at[slot[at].first_node], &f->at[best[i - 1]]); i--)
                best[i] = best[i - 1];
            best[i] = slot[at].first_node;
        }
    return count;
}
