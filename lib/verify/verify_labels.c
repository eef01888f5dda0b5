#include "core/strict_fp.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/wide.h"
#include "core/workspace.h"
#include "verify/verify_labels.h"
#include "verify/verify_geometry.h"

static void lists_unlisted(ebpo_tally *tally, const ebpo_twin_node *node, uint32_t face,
                           const char *text)
{
    ebpo_tally_violation(tally, EBPO_VERIFY_LISTS,
                         &(ebpo_verify_place){ node->code, face, EBPO_NO_PLANE }, "%s", text);
}

/* The list in ascending order: references, then the new range (the file's shape was checked). */
typedef struct face_list {
    const uint32_t *refs;
    uint32_t ref_count, new_count;
    uint64_t first;
} face_list;

static face_list list_of(const ebpo_twin_tree *view, const ebpo_twin_node *leaf)
{
    const ebpo_level *level = &view->tree->level[leaf->cell.level];
    face_list list = { .first = level->leaf_first[leaf->rank],
                       .new_count = level->leaf_new[leaf->rank] };
    list.refs = ebpo_twin_refs(view, leaf, &list.ref_count);
    return list;
}

/* Faces that touch a node ascend, as those of its parent do. */
static bool lists_among(const uint32_t *faces, uint64_t count, uint32_t face)
{
    uint64_t low = 0, high = count;
    while (low < high) {
        uint64_t middle = low + (high - low) / 2;
        if (faces[middle] < face)
            low = middle + 1;
        else
            high = middle;
    }
    return low < count && faces[low] == face;
}

/* A listed face that does not touch the leaf must touch it widened by 1/256: level-limited
 * distances rest on that. */
static void check_near(ebpo_tally *tally, const ebpo_twin_tree *view, const ebpo_twin_node *leaf,
                       uint32_t face)
{
    ebpo_frame frame = ebpo_frame_make(&view->box, leaf->cell);
    ebpo_corners corners;
    for (int k = 0; k < 3; k++) {
        double more = (frame.high[k] - frame.low[k]) * 0x1p-8;
        frame.low[k] -= more;
        frame.high[k] += more;
        frame.inverse[k] = 1 / (frame.high[k] - frame.low[k]);
    }
    ebpo_face_corners(&view->tree->mesh, face, &corners);
    if (!ebpo_face_touches(&frame, &corners, tally))
        lists_unlisted(tally, leaf, face, "the leaf lists a face that does not come near it");
}

static void check_spare(ebpo_tally *tally, const ebpo_twin_tree *view, const ebpo_twin_node *leaf,
                        const face_list *list, const uint32_t *faces, uint64_t count)
{
    EBPO_FOR_ITEMS_SCATTERED(view->workspace, i, 0, list->ref_count)
        if (!lists_among(faces, count, list->refs[i]))
            check_near(tally, view, leaf, list->refs[i]);
    EBPO_FOR_ITEMS_SCATTERED(view->workspace, i, 0, list->new_count)
        if (!lists_among(faces, count, (uint32_t)(list->first + i)))
            check_near(tally, view, leaf, (uint32_t)(list->first + i));
}

static void check_leaf(ebpo_tally *tally, const ebpo_twin_tree *view, const ebpo_twin_node *leaf,
                       const uint32_t *faces, uint64_t count)
{
    face_list list = list_of(view, leaf);
    uint64_t found = 0;
    uint32_t at = 0;
    EBPO_FOR_ITEMS(view->workspace, i, 0, count) {
        uint32_t face = faces[i];
        while (at < list.ref_count && list.refs[at] < face)
            at++;
        bool listed = (at < list.ref_count && list.refs[at] == face) ||
                      (face >= list.first && face - list.first < list.new_count);
        found += listed;
        if (!listed)
            lists_unlisted(tally, leaf, face, "the face touches the leaf, which does not list it");
    }
    EBPO_FOR_ITEMS(view->workspace, i, 1, list.ref_count)
        if (list.refs[i] <= list.refs[i - 1])
            lists_unlisted(tally, leaf, list.refs[i],
                           "the list names the face twice or not in order");
    if (list.ref_count && list.refs[list.ref_count - 1] >= list.first)
        lists_unlisted(tally, leaf, list.refs[list.ref_count - 1],
                       "the list refers to a face that is not below its first new face");
    tally->checks[EBPO_VERIFY_LISTS] += count + list.ref_count + list.new_count;
    uint64_t spare = (uint64_t)list.ref_count + list.new_count - found;
    tally->spare_entries += spare;
    if (spare)
        check_spare(tally, view, leaf, &list, faces, count);
}

void ebpo_check_terminal_lists(ebpo_tally *tally, const ebpo_twin_tree *view,
                               const ebpo_twin_node *node, const uint32_t *faces, uint64_t count)
{
    if (node->type == EBPO_LEAF) {
        check_leaf(tally, view, node, faces, count);
        return;
    }
    tally->checks[EBPO_VERIFY_LISTS] += count ? count : 1;
    EBPO_FOR_ITEMS(view->workspace, i, 0, count)
        lists_unlisted(tally, node, faces[i],
                       node->type == EBPO_WHITE ? "the face touches a white cell"
                                                : "the face touches a black cell");
}

enum { LIMIT_OF_LISTS = 1 << 16 };

/* Different faces listed below a node, as long as they are no more than `limit`: twice as many are
 * held, however many there are, or where that were many a bit for each of the mesh. */
typedef struct gathering {
    uint32_t *faces;
    uint8_t *seen; /* NULL where `faces` are held */
    uint64_t count, capacity, limit;
    bool more; /* than the limit */
    bool short_of_memory;
} gathering;

static int compare_numbers(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

static void keep_different(gathering *g)
{
    uint64_t kept = g->count > 0;
    if (g->count)
        qsort(g->faces, g->count, sizeof *g->faces, compare_numbers);
    for (uint64_t i = 1; i < g->count; i++)
        if (g->faces[i] != g->faces[kept - 1])
            g->faces[kept++] = g->faces[i];
    g->count = kept;
    g->more |= kept > g->limit;
}

static void lists_see(gathering *g, uint64_t face)
{
    uint8_t bit = (uint8_t)(1u << (face & 7));
    g->count += !(g->seen[face >> 3] & bit);
    g->seen[face >> 3] |= bit;
    g->more |= g->count > g->limit;
}

static void see_list(gathering *g, const face_list *list)
{
    for (uint32_t i = 0; i < list->ref_count; i++)
        lists_see(g, list->refs[i]);
    for (uint32_t i = 0; i < list->new_count; i++)
        lists_see(g, list->first + i);
}

/* A list names no face twice, so that one longer than the limit decides. */
static void gather_list(gathering *g, const face_list *list)
{
    uint64_t more = (uint64_t)list->ref_count + list->new_count;
    if (more > g->limit) {
        g->more = true;
        return;
    }
    if (g->seen) {
        see_list(g, list);
        return;
    }
    if (g->count + more > 2 * g->limit + 64)
        keep_different(g);
    if (!ebpo_grow(&g->faces, &g->capacity, g->count + more, sizeof *g->faces)) {
        g->short_of_memory = true;
        return;
    }
    for (uint32_t i = 0; i < list->ref_count; i++)
        g->faces[g->count++] = list->refs[i];
    for (uint32_t i = 0; i < list->new_count; i++)
        g->faces[g->count++] = (uint32_t)(list->first + i);
}

static void lists_gather(gathering *g, const ebpo_twin_tree *view, const ebpo_twin_node *node)
{
    if (g->more || g->short_of_memory)
        return;
    if (node->type == EBPO_LEAF) {
        face_list list = list_of(view, node);
        gather_list(g, &list);
    }
    for (unsigned octant = 0; node->type == EBPO_GRAY && octant < 8; octant++) {
        ebpo_twin_node child = ebpo_twin_child(view, node, octant);
        lists_gather(g, view, &child);
    }
}

bool ebpo_lists_more_faces(const ebpo_twin_tree *view, const ebpo_twin_node *node, uint64_t limit)
{
    gathering g = { .limit = limit };
    uint64_t faces = view->tree->mesh.face_count;
    if (limit >= faces)
        return false;
    if (limit > LIMIT_OF_LISTS) {
        g.seen = ebpo_array_zero(view->workspace, faces / 8 + 1, 1);
        g.short_of_memory = !g.seen;
    }
    lists_gather(&g, view, node);
    if (!g.seen)
        keep_different(&g);
    free(g.faces);
    ebpo_array_free(view->workspace, g.seen);
    /* memory that is short proves nothing against the file */
    return g.more || g.short_of_memory;
}

enum { SIDE_MAX = 2048, FACE_GRAIN = 1 << 14 };

/* A grid of columns seen along x: cell (y, z). */
typedef struct columns {
    const ebpo_mesh *mesh;
    double low[2], scale[2];
    uint64_t side;
    uint64_t *first;       /* [side * side + 1] of the column's points */
    ebpo_ray_point *point; /* column after column */
} columns;

bool ebpo_rays_add(ebpo_ray_points *points, const ebpo_ray_point *point)
{
    if (!ebpo_array_grow(points->workspace, &points->point, &points->capacity, points->count + 1,
                         sizeof *points->point))
        return false;
    points->point[points->count++] = *point;
    return true;
}

static columns grid_for(const ebpo_mesh *mesh, const ebpo_box *box, uint64_t count)
{
    columns c = { .mesh = mesh, .side = 1 };
    while (c.side < SIDE_MAX && c.side * c.side * 2 < count)
        c.side *= 2;
    for (int i = 0; i < 2; i++) {
        c.low[i] = box->origin[i + 1];
        c.scale[i] = 1 / box->size[i + 1];
    }
    return c;
}

/* Monotone, so that a point in a face's range of coordinates falls into its range of columns. */
static uint64_t column_of(const columns *c, int i, double x)
{
    double at = (x - c->low[i]) * c->scale[i] * (double)c->side;
    return at >= (double)c->side ? c->side - 1 : at > 0 ? (uint64_t)at : 0;
}

static uint64_t column_of_point(const columns *c, const ebpo_ray_point *p)
{
    return column_of(c, 1, p->at[2]) * c->side + column_of(c, 0, p->at[1]);
}

typedef struct column_range {
    uint64_t from[2], to[2];
} column_range;

static column_range columns_of_face(const columns *c, const ebpo_corners *face)
{
    column_range range;
    for (int i = 0; i < 2; i++) {
        double low = face->at[0][i + 1], high = low;
        for (int j = 1; j < 3; j++) {
            double x = face->at[j][i + 1];
            low = x < low ? x : low;
            high = x > high ? x : high;
        }
        range.from[i] = column_of(c, i, low);
        range.to[i] = column_of(c, i, high);
    }
    return range;
}

/* Sorts the points by column; those of a column keep their order, which nothing depends on. */
static ebpo_status sort_points(columns *c, ebpo_ray_points *points, ebpo_error *error)
{
    uint64_t cells = c->side * c->side;
    ebpo_ray_point *sorted = ebpo_array_alloc(points->workspace, points->count, sizeof *sorted);
    c->first = ebpo_alloc_zero(cells + 1, sizeof *c->first);
    if (!sorted || !c->first) {
        ebpo_array_free(points->workspace, sorted);
        return ebpo_workspace_fail(points->workspace, points->count * sizeof *sorted, error);
    }
    EBPO_FOR_ITEMS(points->workspace, i, 0, points->count)
        c->first[column_of_point(c, &points->point[i])]++;
    for (uint64_t i = 0, sum = 0; i <= cells; i++) {
        uint64_t own = c->first[i];
        c->first[i] = sum;
        sum += own;
    }
    EBPO_FOR_ITEMS_SCATTERED(points->workspace, i, 0, points->count)
        sorted[c->first[column_of_point(c, &points->point[i])]++] = points->point[i];
    /* each had moved on to the next one's beginning */
    memmove(c->first + 1, c->first, cells * sizeof *c->first);
    c->first[0] = 0;
    ebpo_array_free(points->workspace, points->point);
    points->point = c->point = sorted;
    points->capacity = points->count;
    return EBPO_OK;
}

/* Several threads may meet at one point. */
static void rays_look(const columns *c, const ebpo_corners *face, uint64_t begin, uint64_t end)
{
    for (uint64_t i = begin; i < end; i++) {
        int hit = ebpo_ray_hit(c->point[i].at, 0, face);
        if (hit)
            __atomic_fetch_add(&c->point[i].found, hit, __ATOMIC_RELAXED);
    }
}

static ebpo_status rays_follow(void *context, uint64_t begin, uint64_t end, unsigned worker,
                               ebpo_error *error)
{
    const columns *c = context;
    (void)worker;
    (void)error;
    uint64_t rows = 0; /* jumps */
    for (uint64_t f = begin; f < end; f++) {
        ebpo_corners face;
        ebpo_face_corners(c->mesh, f, &face);
        column_range r = columns_of_face(c, &face);
        /* the columns of a row stand side by side */
        for (uint64_t z = r.from[1]; z <= r.to[1]; z++) {
            rays_look(c, &face, c->first[z * c->side + r.from[0]],
                      c->first[z * c->side + r.to[0] + 1]);
            if (++rows % EBPO_ITEMS_SCATTERED == 0)
                ebpo_release_pages(c->mesh->workspace);
        }
    }
    return EBPO_OK;
}

ebpo_status ebpo_rays_follow(ebpo_ray_points *points, const ebpo_mesh *mesh, const ebpo_box *box,
                             unsigned threads, const ebpo_progress *progress, ebpo_error *error)
{
    columns c = grid_for(mesh, box, points->count);
    ebpo_status status = sort_points(&c, points, error);
    EBPO_FOR_ITEMS(points->workspace, i, 0, status == EBPO_OK ? points->count : 0)
        c.point[i].found = 0;
    if (status == EBPO_OK)
        status = ebpo_parallel_for(threads, mesh->workspace, mesh->face_count, FACE_GRAIN,
                                   rays_follow, &c, progress, "following rays", error);
    free(c.first);
    return status;
}

double ebpo_rays_work(const ebpo_mesh *mesh, const ebpo_box *box, uint64_t count)
{
    columns c = grid_for(mesh, box, count);
    uint64_t covered = 0; /* columns, over all faces */
    EBPO_FOR_ITEMS(mesh->workspace, f, 0, mesh->face_count) {
        ebpo_corners face;
        ebpo_face_corners(mesh, f, &face);
        column_range r = columns_of_face(&c, &face);
        covered += (r.to[0] - r.from[0] + 1) * (r.to[1] - r.from[1] + 1);
    }
    return (double)covered * (double)count / (double)(c.side * c.side);
}

enum { SAMPLES_LEAST = 4096, SAMPLES_MANY = 1 << 20, CELLS_ALL = 1 << 22 };
/* Points looked at by faces, in all: some seconds. */
static const double ray_work_affordable = 4e8;

static uint64_t usual_samples(const ebpo_twin_tree *view, uint64_t cells)
{
    uint64_t samples = cells <= CELLS_ALL ? cells : SAMPLES_MANY;
    return ebpo_rays_work(&view->tree->mesh, &view->box, samples) <= ray_work_affordable
               ? samples
               : SAMPLES_LEAST;
}

void ebpo_label_plan_make(ebpo_label_plan *plan, const ebpo_twin_tree *view, uint64_t samples)
{
    uint64_t all = 0, classes = 0;
    for (int l = 0; l < view->tree->info.level_count; l++) {
        const ebpo_level *level = &view->tree->level[l];
        plan->cells[l][EBPO_WHITE] = level->white_count;
        plan->cells[l][EBPO_BLACK] = level->black_count;
        plan->cells[l][EBPO_LEAF] = level->leaf_count;
        plan->cells[l][EBPO_GRAY] = 0;
        for (int type = 0; type < EBPO_GRAY; type++) {
            all += plan->cells[l][type];
            classes += plan->cells[l][type] > 0;
        }
    }
    if (samples == 0)
        samples = usual_samples(view, all);
    /* Half of the samples go to the classes evenly, so that small levels are seen too; half by
     * size. */
    for (int l = 0; l < view->tree->info.level_count; l++)
        for (int type = 0; type <= EBPO_GRAY; type++) {
            uint64_t cells = plan->cells[l][type];
            uint64_t share =
                cells == 0
                    ? 0
                    : samples / (2 * classes) +
                          (uint64_t)((double)samples / 2 * ((double)cells / (double)all)) + 1;
            plan->take[l][type] = samples >= all || share > cells ? cells : share;
        }
}

/* True for `take` of the `cells` ranks, evenly spread. */
static bool labels_planned(const ebpo_label_plan *plan, const ebpo_twin_node *node)
{
    uint64_t cells = plan->cells[node->cell.level][node->type],
             take = plan->take[node->cell.level][node->type];
    if (take >= cells)
        return true;
    /* (rank + 1) * take / cells is another integer than rank * take / cells */
    return ebpo_wide_modulo(ebpo_wide_product(node->rank, take), cells) >= cells - take;
}

static void corner_position(const ebpo_frame *frame, unsigned corner, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = corner >> k & 1 ? frame->high[k] : frame->low[k];
}

/* Changes of the winding number that one face makes along seven cell edges: a tree that reaches all
 * corners from corner 0. */
static const struct {
    unsigned char from, to, axis;
} edge_tree[7] = { { 0, 1, 0 }, { 0, 2, 1 }, { 0, 4, 2 }, { 2, 3, 0 },
                   { 4, 5, 0 }, { 4, 6, 1 }, { 6, 7, 0 } };

static void add_crossings(int64_t change[7], const ebpo_frame *frame, const ebpo_corners *face)
{
    for (int e = 0; e < 7; e++) {
        double from[3], to[3];
        corner_position(frame, edge_tree[e].from, from);
        corner_position(frame, edge_tree[e].to, to);
        change[e] +=
            ebpo_ray_hit(to, edge_tree[e].axis, face) - ebpo_ray_hit(from, edge_tree[e].axis, face);
    }
}

void ebpo_terminal_windings(ebpo_corner_windings *out, const ebpo_twin_tree *view,
                            const ebpo_twin_node *node, const ebpo_frame *frame,
                            const uint32_t *faces, uint64_t count)
{
    int64_t first = ebpo_twin_winding(view, node), change[7] = { 0 };
    for (int i = 0; i < 8; i++)
        out->at[i] = first;
    out->known = node->type == EBPO_LEAF && !view->has_mesh ? 1 : 255;
    if (node->type != EBPO_LEAF || !view->has_mesh)
        return;
    EBPO_FOR_ITEMS_SCATTERED(view->workspace, i, 0, count) {
        ebpo_corners face;
        ebpo_face_corners(&view->tree->mesh, faces[i], &face);
        add_crossings(change, frame, &face);
    }
    for (int e = 0; e < 7; e++)
        out->at[edge_tree[e].to] = out->at[edge_tree[e].from] + change[e];
}

void ebpo_check_terminal_label(ebpo_tally *tally, const ebpo_twin_tree *view,
                               const ebpo_twin_node *node)
{
    if (node->type == EBPO_LEAF)
        return;
    int64_t stored = ebpo_twin_winding(view, node);
    tally->checks[EBPO_VERIFY_LABELS]++;
    if (ebpo_twin_inside(view, stored) != (node->type == EBPO_BLACK))
        ebpo_tally_violation(tally, EBPO_VERIFY_LABELS,
                             &(ebpo_verify_place){ node->code, EBPO_NO_FACE, EBPO_NO_PLANE },
                             "%s, but winding number %" PRId64 " lies %s by the file's rule",
                             node->type == EBPO_BLACK ? "black" : "white", stored,
                             node->type == EBPO_BLACK ? "outside" : "inside");
}

bool ebpo_label_note(ebpo_ray_points *points, const ebpo_twin_tree *view,
                     const ebpo_twin_node *node, const ebpo_frame *frame,
                     const ebpo_label_plan *plan)
{
    if (!labels_planned(plan, node))
        return true;
    ebpo_ray_point p = { { frame->low[0], frame->low[1], frame->low[2] },
                         node->code,
                         ebpo_twin_winding(view, node),
                         0 };
    return ebpo_rays_add(points, &p);
}

void ebpo_check_rays(ebpo_tally *tally, const ebpo_ray_points *points)
{
    tally->checks[EBPO_VERIFY_LABELS] += points->count;
    EBPO_FOR_ITEMS(points->workspace, i, 0, points->count) {
        const ebpo_ray_point *p = &points->point[i];
        if (p->found != p->stored)
            ebpo_tally_violation(tally, EBPO_VERIFY_LABELS,
                                 &(ebpo_verify_place){ p->octcode, EBPO_NO_FACE, EBPO_NO_PLANE },
                                 "winding number %" PRId64
                                 " is stored, a ray through the mesh finds %" PRId64,
                                 p->stored, p->found);
    }
}

/* Number of the point, 0 .. 26, that a child's corner is. */
static int shared_point(unsigned octant, unsigned corner)
{
    int point = 0, step = 1;
    for (int k = 0; k < 3; k++, step *= 3)
        point += step * (int)((octant >> k & 1) + (corner >> k & 1));
    return point;
}

void ebpo_check_links(ebpo_tally *tally, const ebpo_twin_node *node,
                      const ebpo_corner_windings children[8], ebpo_corner_windings *out)
{
    int64_t value[27];
    bool known[27] = { false };
    *out = (ebpo_corner_windings){ { 0 }, 0 };
    for (unsigned octant = 0; octant < 8; octant++)
        for (unsigned corner = 0; corner < 8; corner++) {
            int point = shared_point(octant, corner);
            if (!(children[octant].known >> corner & 1))
                continue;
            int64_t here = children[octant].at[corner];
            tally->checks[EBPO_VERIFY_LABELS] += known[point];
            if (known[point] && value[point] != here) {
                ebpo_verify_place place = { ebpo_octcode_child(node->code, octant), EBPO_NO_FACE,
                                            EBPO_NO_PLANE };
                ebpo_tally_violation(tally, EBPO_VERIFY_LABELS, &place,
                                     "winding number %" PRId64
                                     " at corner %u, a neighbour gives %" PRId64
                                     " for the same point",
                                     here, corner, value[point]);
            }
            if (!known[point])
                value[point] = here;
            known[point] = true;
        }
    for (unsigned i = 0; i < 8; i++)
        if (children[i].known >> i & 1) {
            out->at[i] = children[i].at[i];
            out->known |= 1u << i;
        }
}

void ebpo_check_root_corners(ebpo_tally *tally, const ebpo_corner_windings *root)
{
    for (unsigned i = 0; i < 8; i++) {
        if (!(root->known >> i & 1))
            continue;
        tally->checks[EBPO_VERIFY_LABELS]++;
        if (root->at[i] != 0)
            ebpo_tally_violation(tally, EBPO_VERIFY_LABELS,
                                 &(ebpo_verify_place){ 1, EBPO_NO_FACE, EBPO_NO_PLANE },
                                 "corner %u of the root cell has winding number %" PRId64
                                 ", but lies outside",
                                 i, root->at[i]);
    }
}

unsigned ebpo_windings_inside(const ebpo_twin_tree *view, const ebpo_corner_windings *corners)
{
    unsigned inside = 0;
    for (unsigned i = 0; i < 8; i++)
        inside |= (unsigned)((corners->known >> i & 1) && ebpo_twin_inside(view, corners->at[i]))
                  << i;
    return inside;
}
