/* Chooses the planes of gray nodes, from the root down. A candidate is a plane that may be chosen.
 * It has a direction n. Its offset is the support of the solid along n: the greatest n . x over the
 * points x of the solid within the cell (supports.h). The directions are normals of the convex hull
 * of the solid within the cell:
 *
 * - If the solid within the cell is given by few points (supports.h), the directions are the
 *   normals of the facets of these points' hull.
 * - If there are many points, or if they span no volume, a hull grows in rounds. Each round finds
 *   the supports of the solid along the normals of the hull's facets, and adds the points of these
 *   supports (extreme points of the solid) to the hull. Normals of the faces below the node are
 *   tried, too: they are grouped in bins of the octahedral map, which maps a normal to 10 + 10
 *   bits. The mean of each bin is tried.
 *
 * The selection (selections.c) takes planes from the candidates. A support is rounded up, so a
 * plane never cuts off a part of the solid, however bad its direction is. A piece is a subtree that
 * one thread builds; the top is the set of the nodes above the pieces. This file also computes the
 * envelopes of the top, level by level, so that every piece gets the envelope of its root's parent.
 */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "construct/builder.h"
#include "construct/construct_stages.h"
#include "construct/planes.h"
#include "construct/pieces.h"
#include "construct/supports.h"
#include "core/alloc.h"
#include "core/error.h"
#include "core/hash.h"
#include "core/parallel.h"
#include "geometry/polytope.h"
#include "geometry/vec3.h"

/* --- candidates: normals of faces --- */

/* CANDIDATES_SAMPLE: maximum number of sampled normals. CANDIDATES_BINS: size of the table of bins.
 */
enum { CANDIDATES_SAMPLE = 4096, CANDIDATES_BINS = 16384 };

/* A bin: a square of the octahedral map, with the normals of the sample in this square. */
typedef struct normal_bin {
    uint32_t key;          /* 1 + position of the bin; 0: the entry of the table is free */
    uint32_t count;        /* number of normals in the bin */
    uint64_t sum_u, sum_v; /* sums of the normals' two coordinates in the map */
} normal_bin;

/* Memory of one thread, which is too large for its stack; initialised with zeros. */
typedef struct candidates_scratch {
    normal_bin table[CANDIDATES_BINS]; /* hash table; all bins are free between calls */
    uint32_t sample[CANDIDATES_SAMPLE];
    int slots[EBPO_PLANES_CANDIDATES]; /* indices in `table` of the bins that are not free */
} candidates_scratch;

/* Adds the normals of every `step`-th face to the sample, from face begin + *skip on. The faces are
 * entries[begin .. end - 1]. If `entries` is NULL, they are faces begin .. end - 1 of the branch's
 * list. Sets *skip to the number of faces to skip at the beginning of the next list. */
static void sample_faces(const ebpo_builder *b, const ebpo_branch *s, const uint32_t *entries,
                         uint64_t begin, uint64_t end, uint64_t *skip, uint64_t step,
                         uint32_t *sample, int *count)
{
    uint64_t i = begin + *skip;
    for (; i < end; i += step) {
        ebpo_triangle face;
        uint32_t normal;
        /* with a large step, each face is on another page of the workspace's files, so pages are
         * released more often */
        if (step > 64 && *count % 16 == 0)
            ebpo_release_pages(b->workspace);
        ebpo_branch_triangle(b, s, entries ? entries[i] : (uint32_t)i, &face);
        if (*count < CANDIDATES_SAMPLE && ebpo_face_normal_code(&b->box, &face, &normal))
            sample[(*count)++] = normal;
    }
    *skip = i - end;
}

/* Samples the normals of the faces below a node. Returns their number. */
static int sample_candidates(const ebpo_builder *b, const ebpo_branch *s,
                             const ebpo_build_detail *d, uint32_t *sample)
{
    int count = 0;
    uint64_t skip = 0, total = 0;
    if (s->list) {
        uint64_t step = (d->entry_end - d->entry_begin) / CANDIDATES_SAMPLE + 1;
        sample_faces(b, s, s->entries, d->entry_begin, d->entry_end, &skip, step, sample, &count);
        return count;
    }
    for (uint64_t i = d->entry_begin; i < d->entry_end; i++)
        total += b->piece[i].list_count;
    for (uint64_t i = d->entry_begin; i < d->entry_end; i++)
        sample_faces(b, &b->piece[i], NULL, 0, b->piece[i].list_count, &skip,
                     total / CANDIDATES_SAMPLE + 1, sample, &count);
    return count;
}

/* Removes the old bins from the table, and groups the sample in bins of `width` * `width` normals.
 * Returns false if more than `bins_max` bins would be occupied. *used: number of occupied bins,
 * before and after the call. `slots`: indices of these bins in the table. */
static bool fill_bins(normal_bin *table, int *used, int *slots, const uint32_t *sample, int count,
                      uint32_t width, int bins_max)
{
    for (int i = 0; i < *used; i++)
        table[slots[i]].key = 0;
    *used = 0;
    for (int i = 0; i < count; i++) {
        uint32_t u = sample[i] & 1023, v = sample[i] >> 10 & 1023,
                 key = 1 + u / width + (v / width << 10);
        uint64_t at;
        EBPO_HASH_FIND(at, ebpo_hash_number(key), CANDIDATES_BINS - 1,
                       !table[at].key || table[at].key == key);
        if (!table[at].key) {
            if (*used == bins_max)
                return false;
            table[at] = (normal_bin){ key, 0, 0, 0 };
            slots[(*used)++] = (int)at;
        }
        table[at].count++;
        table[at].sum_u += u;
        table[at].sum_v += v;
    }
    return true;
}

/* Makes a candidate of the mean of each bin, at most `bins_max`. The supports are not computed yet.
 * Returns the number of candidates. */
static int build_candidates(const ebpo_builder *b, candidates_scratch *scratch,
                            const ebpo_branch *s, const ebpo_build_detail *detail, int bins_max,
                            ebpo_candidate *out)
{
    normal_bin *table = scratch->table;
    int used = 0, count = sample_candidates(b, s, detail, scratch->sample);
    uint32_t width = 1;
    while (!fill_bins(table, &used, scratch->slots, scratch->sample, count, width, bins_max))
        width = width < 4 ? 4 : width + width / 2;
    for (int i = 0; i < used; i++) {
        normal_bin *t = &table[scratch->slots[i]];
        uint32_t u = (uint32_t)((t->sum_u + t->count / 2) / t->count),
                 v = (uint32_t)((t->sum_v + t->count / 2) / t->count);
        out[i] = (ebpo_candidate){ .normal = u | v << 10, .support = -1e300 };
        t->key = 0;
    }
    return used;
}

/* --- scratch memory and supports --- */

enum {
    /* down to this level, there are so few nodes that planes take hardly any bytes of the file */
    TOP_LEVELS = 4,
    MANY_LEVELS = 2,       /* down to this level (at most 73 nodes), a node may have twice as many
                            * planes, which round solids need */
    FACES_TRIED = 16,      /* maximum number of means of face normals that are tried */
    HULL_ROUNDS = 3,       /* maximum number of rounds */
    ROUND_TRIED_TOP = 160, /* maximum number of directions tried in a round, down to TOP_LEVELS */
    ROUND_TRIED = 24,      /* maximum number of directions tried in a round, on deeper levels */
    TABLE = 1024           /* entries of the table of normals */
};

struct ebpo_envelope_scratch {
    ebpo_supports supports;
    ebpo_candidate candidates[EBPO_PLANES_CANDIDATES];
    int count; /* number of candidates */
    /* normals that were tried, both of candidates and of useless planes */
    uint32_t tried[2 * EBPO_PLANES_CANDIDATES];
    int tried_count;
    uint32_t normals[TABLE]; /* hash table: 1 + normal; 0: free */
    /* known points of the solid in the cell, whose hull gives directions */
    double hull_points[EBPO_HULL_POINTS][3];
    int hull_point_count;
    ebpo_hull_facet facet[EBPO_HULL_FACETS]; /* facets of the hull */
    candidates_scratch of_faces;
};

ebpo_status ebpo_scratch_make(ebpo_envelope_scratch **out, ebpo_error *error)
{
    *out = ebpo_alloc_zero(1, sizeof **out);
    return *out ? EBPO_OK : ebpo_fail_memory(error, sizeof **out);
}

void ebpo_scratch_free(ebpo_envelope_scratch *scratch)
{
    if (scratch)
        ebpo_supports_free(&scratch->supports);
    free(scratch);
}

/* Returns a limit for the support of a useful plane with the normal n. A plane whose support is the
 * limit or more can remove neither the volume epsilon nor a needle (a long, thin portion of the
 * envelope). Reason: let V be the volume of a convex body, and H its width along n. A plane that
 * cuts off a part of height h removes at most the volume V (1 - (1 - h/H)^3) <= 3 V h / H. */
static double useful_support_limit(const ebpo_polytope *envelope, double volume, const int32_t n[3],
                                   double epsilon)
{
    double greatest = -1e300, least = 1e300;
    for (int i = 0; i < envelope->vertex_count; i++) {
        const double *v = envelope->vertex[i];
        double e = n[0] * v[0] + n[1] * v[1] + n[2] * v[2];
        greatest = e > greatest ? e : greatest;
        least = e < least ? e : least;
    }
    double length = sqrt((double)n[0] * n[0] + (double)n[1] * n[1] + (double)n[2] * n[2]);
    return greatest - fmin((greatest - least) * epsilon / (3 * volume), ebpo_needle * length);
}

/* Tries a direction: adds a candidate if its plane may be useful. The search for the support stops
 * as soon as it finds that the plane is useless. Sets `where` to the point with the greatest n . x
 * that the search found. */
static void try_normal(ebpo_envelope_scratch *s, uint32_t normal, const ebpo_polytope *envelope,
                       double volume, double epsilon, double where[3])
{
    int32_t n[3], d;
    ebpo_plane_code_decode(normal, n, &d);
    double limit = useful_support_limit(envelope, volume, n, epsilon);
    double support =
        ebpo_supports_find_from(&s->supports, n, limit, (const double(*)[3])s->hull_points,
                                s->hull_point_count, where);
    if (support < limit && s->count < EBPO_PLANES_CANDIDATES)
        s->candidates[s->count++] = (ebpo_candidate){ .normal = normal, .support = support };
    if (s->tried_count < 2 * EBPO_PLANES_CANDIDATES)
        s->tried[s->tried_count++] = normal;
}

/* --- directions of the hull --- */

/* Adds a point to the hull's points. Does nothing if one of these points is very close. */
static void add_hull_point(ebpo_envelope_scratch *s, const double where[3])
{
    static const double near_squared = 1e-12; /* squared distance, in cells */
    for (int i = 0; i < s->hull_point_count; i++) {
        double square = 0;
        for (int k = 0; k < 3; k++)
            square += (s->hull_points[i][k] - where[k]) * (s->hull_points[i][k] - where[k]);
        if (square < near_squared)
            return;
    }
    if (s->hull_point_count == EBPO_HULL_POINTS)
        return;
    for (int k = 0; k < 3; k++)
        s->hull_points[s->hull_point_count][k] = where[k];
    s->hull_point_count++;
}

/* Adds the extreme points of the solid along the directions from the cell's centre to the cell's
 * faces, edges and corners. So the hull has points on all sides, even if the normals of the model's
 * faces have only a few directions. */
static void add_points_around(ebpo_envelope_scratch *s)
{
    for (int i = 0; i < 27; i++) {
        double direction[3] = { i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1 }, where[3];
        uint32_t normal;
        int32_t n[3], d;
        if (!ebpo_plane_code_normal(direction, &normal) || !ebpo_plane_code_decode(normal, n, &d))
            continue;
        if (ebpo_supports_find_from(&s->supports, n, 1e300, (const double(*)[3])s->hull_points,
                                    s->hull_point_count, where) > -1e300)
            add_hull_point(s, where);
    }
}

static bool was_tried(const ebpo_envelope_scratch *s, uint32_t normal)
{
    for (int i = 0; i < s->tried_count; i++)
        if (s->tried[i] == normal)
            return true;
    return false;
}

/* Runs one round: computes the hull of the known points, and tries the normals of at most
 * `directions_max` facets, the largest facets first. Adds the extreme points that are beyond a
 * facet. Returns false if no point was added. */
static bool hull_round(ebpo_envelope_scratch *s, const ebpo_polytope *envelope, double volume,
                       double epsilon, int directions_max)
{
    /* least distance of an added point from the facet, in cells */
    static const double least_distance = 1e-3;
    int facets = ebpo_hull_facets((const double(*)[3])s->hull_points, s->hull_point_count, 1e-9,
                                  s->facet, EBPO_HULL_FACETS),
        before = s->hull_point_count;
    qsort(s->facet, (size_t)facets, sizeof *s->facet, ebpo_hull_by_area);
    for (int i = 0; i < facets && directions_max > 0; i++) {
        const ebpo_hull_facet *f = &s->facet[i];
        uint32_t normal;
        double where[3] = { 0, 0, 0 };
        if (!ebpo_plane_code_normal(f->n, &normal) || was_tried(s, normal))
            continue;
        try_normal(s, normal, envelope, volume, epsilon, where);
        directions_max--;
        if (ebpo_vec3_dot(f->n, where) > f->d + least_distance)
            add_hull_point(s, where);
    }
    return s->hull_point_count > before;
}

/* Runs rounds until a round adds no point, at most HULL_ROUNDS rounds. */
static void try_hull(ebpo_envelope_scratch *s, const ebpo_polytope *envelope, double volume,
                     double epsilon, int directions_max)
{
    for (int round = 0;
         round < HULL_ROUNDS && hull_round(s, envelope, volume, epsilon, directions_max); round++)
        ;
}

/* --- few points --- */

/* On levels deeper than TOP_LEVELS, a point is omitted if it is outside the hull found so far by
 * less than this distance (in cells). Such a point would only add directions that are nearly equal
 * to others. */
static const double hull_tolerance = 1e-3;

/* Makes all points of the solid in the cell the points of the hull. Returns false if there are too
 * many, or if some of these points are not in the array `point` but are a range of vertices. */
static bool use_all_points(ebpo_envelope_scratch *s)
{
    const ebpo_supports *from = &s->supports;
    if (from->begin < from->end || from->count > EBPO_HULL_POINTS)
        return false;
    for (uint64_t i = 0; i < from->count; i++) {
        for (int k = 0; k < 3; k++)
            s->hull_points[i][k] = from->point[i / 4][k][i % 4];
    }
    s->hull_point_count = (int)from->count;
    return true;
}

/* Adds a normal to the table. Returns false if the table already contains this normal. */
static bool new_normal(ebpo_envelope_scratch *s, uint32_t normal)
{
    uint64_t at;
    EBPO_HASH_FIND(at, ebpo_hash_number(normal), TABLE - 1,
                   !s->normals[at] || s->normals[at] == 1 + normal);
    if (s->normals[at])
        return false;
    s->normals[at] = 1 + normal;
    return true;
}

/* Makes candidates of the facets of the hull of the points. A point that is outside the hull found
 * so far by less than `tolerance` is omitted. Returns the volume of the hull, or -1 if the points
 * span no volume. */
static double hull_candidates(ebpo_envelope_scratch *s, double tolerance)
{
    int facets = ebpo_hull_facets((const double(*)[3])s->hull_points, s->hull_point_count,
                                  tolerance, s->facet, EBPO_HULL_FACETS);
    if (facets == 0)
        return -1;
    if (facets > EBPO_PLANES_CANDIDATES)
        qsort(s->facet, (size_t)facets, sizeof *s->facet, ebpo_hull_by_area);
    memset(s->normals, 0, sizeof s->normals);
    double volume = 0;
    for (int i = 0; i < facets; i++) {
        uint32_t normal;
        int32_t n[3], d;
        volume += s->facet[i].area * s->facet[i].d / 3;
        if (s->count == EBPO_PLANES_CANDIDATES || !ebpo_plane_code_normal(s->facet[i].n, &normal) ||
            !new_normal(s, normal))
            continue;
        /* the search begins at the facet's corners, which are about the farthest points, so it
         * skips most other points */
        double corner[3][3], where[3];
        for (int c = 0; c < 3; c++)
            ebpo_vec3_copy(s->hull_points[s->facet[i].corner[c]], corner[c]);
        ebpo_plane_code_decode(normal, n, &d);
        s->candidates[s->count++] =
            (ebpo_candidate){ .normal = normal,
                              .support =
                                  ebpo_supports_find_from(&s->supports, n, 1e300,
                                                          (const double(*)[3])corner, 3, where) };
    }
    return fmax(0, volume);
}

/* --- the node --- */

/* Returns the factor by which epsilon is multiplied for a node of levels 0 to TOP_LEVELS. `volume`:
 * volume of the node's envelope so far, in cells. The factor is small for two reasons: planes of
 * these levels take hardly any bytes, and even a solid that fills a thousandth of its cell needs
 * planes. */
static double top_factor(double volume) { return 0.1 * sqrt(fmax(0, volume)); }

/* Makes the candidates of a node with many points. */
static void choose_directions(const ebpo_builder *b, ebpo_envelope_scratch *s,
                              const ebpo_branch *branch, const ebpo_build_detail *detail, int level,
                              const ebpo_polytope *envelope, double volume, double epsilon)
{
    bool top = level <= TOP_LEVELS;
    ebpo_candidate faces[FACES_TRIED];
    int count = build_candidates(b, &s->of_faces, branch, detail, FACES_TRIED, faces);
    s->hull_point_count = 0;
    add_points_around(s);
    for (int i = 0; i < count; i++) {
        double where[3];
        try_normal(s, faces[i].normal, envelope, volume, epsilon, where);
        add_hull_point(s, where);
    }
    try_hull(s, envelope, volume, epsilon, top ? ROUND_TRIED_TOP : ROUND_TRIED);
}

/* Chooses the planes of a gray node from the root down. Returns their number, or -1 when out of
 * memory. */
static int choose_now(const ebpo_builder *b, ebpo_envelope_scratch *s, const ebpo_branch *branch,
                      const ebpo_build_detail *detail, ebpo_cell cell, int32_t winding,
                      ebpo_polytope *envelope, uint32_t *codes)
{
    if (!ebpo_supports_gather(&s->supports, b, branch, detail, cell, winding))
        return -1;
    double volume = ebpo_polytope_volume(envelope),
           epsilon = b->options->epsilon * (cell.level <= TOP_LEVELS ? top_factor(volume) : 1);
    ebpo_choice choice = { .candidates = s->candidates,
                           .codes_max =
                               cell.level <= MANY_LEVELS ? 2 * EBPO_PLANES_MAX : EBPO_PLANES_MAX,
                           .epsilon = epsilon,
                           .needle_length = ebpo_needle };
    s->count = s->tried_count = s->hull_point_count = 0;
    if (!(volume > 0))
        return 0;
    if (!use_all_points(s) ||
        (choice.hull_volume =
             hull_candidates(s, cell.level <= TOP_LEVELS ? 1e-9 : hull_tolerance)) < 0) {
        choose_directions(b, s, branch, detail, cell.level, envelope, volume, epsilon);
        choice.hull_volume = 0;
    }
    choice.count = s->count;
    return ebpo_select_greedy(envelope, &choice, codes);
}

int ebpo_gray_planes(const ebpo_builder *b, ebpo_envelope_scratch *s, const ebpo_branch *branch,
                     uint32_t detail, ebpo_cell cell, int32_t winding, ebpo_polytope *envelope,
                     uint32_t codes[EBPO_PLANES_STORED])
{
    int count;
    const uint32_t *proposed = ebpo_proposed(branch, detail, &count);
    if (!proposed)
        return choose_now(b, s, branch, &branch->details[detail], cell, winding, envelope, codes);
    memcpy(codes, proposed, (size_t)count * sizeof *codes);
    ebpo_planes_cut(envelope, codes, (uint64_t)count);
    return count;
}

/* --- the nodes above the pieces, level by level --- */

/* A gray node of the top, whose envelope is to be computed. */
typedef struct pending {
    uint32_t node; /* index in the top's nodes */
    ebpo_cell cell;
    int32_t winding; /* winding number at the lowest corner */
    /* before front_envelopes: the parent's envelope cut to the cell; afterwards: the envelope of
     * the node */
    ebpo_polytope *envelope;
} pending;

/* The gray nodes of one level of the top, which are processed together. */
typedef struct front {
    ebpo_builder *b;
    pending *nodes;
    uint64_t count, capacity;
} front;

static ebpo_status no_memory(const ebpo_builder *b, ebpo_error *error)
{
    return ebpo_workspace_fail_while(b->workspace, "while computing envelopes", error);
}

/* Chooses the planes and computes the envelopes of nodes of the front. */
static ebpo_status front_envelopes(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                   ebpo_error *error)
{
    front *w = context;
    ebpo_builder *b = w->b;
    (void)worker;
    ebpo_envelope_scratch *scratch = NULL;
    ebpo_status status = ebpo_scratch_make(&scratch, error);
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++) {
        pending *p = &w->nodes[i];
        uint32_t detail = b->top.nodes[p->node].detail;
        ebpo_top_envelope *t = &b->top_envelope[detail];
        if (b->options->parts & EBPO_PART_PLANES)
            t->count = ebpo_gray_planes(b, scratch, &b->top, detail, p->cell, p->winding,
                                        p->envelope, t->codes);
        t->volume = ebpo_polytope_volume(p->envelope) * ebpo_cell_volume(&b->box, p->cell.level);
        if (t->count < 0)
            status = no_memory(b, error);
    }
    ebpo_scratch_free(scratch);
    return status;
}

/* Cuts a node's envelope to the cells of its children. Gray children are added to the next front;
 * pieces get the envelope and their winding number. Returns false when out of memory. */
static bool pass_down(ebpo_builder *b, const pending *p, front *next)
{
    const ebpo_build_node *node = &b->top.nodes[p->node];
    int32_t offset[8];
    ebpo_child_windings(b, &b->top, p->cell, node->child, offset);
    for (uint32_t o = 0; o < 8; o++) {
        const ebpo_build_node *child = &b->top.nodes[node->child + o];
        ebpo_cell cell = ebpo_cell_child(p->cell, o);
        if (child->type == EBPO_WHITE &&
            ebpo_empty_type(b, cell, p->winding + offset[o]) != EBPO_LEAF)
            continue;
        ebpo_polytope *envelope = ebpo_array_alloc(b->workspace, 1, sizeof *envelope);
        if (!envelope)
            return false;
        ebpo_polytope_child(p->envelope, o, envelope);
        if (child->type == EBPO_WHITE) {
            b->top_envelope[node->detail].empty_volume[o] =
                ebpo_polytope_volume(envelope) * ebpo_cell_volume(&b->box, cell.level);
            ebpo_array_free(b->workspace, envelope);
            continue;
        }
        if (child->type == EBPO_LEAF) {
            b->piece[child->detail].above = envelope;
            b->piece[child->detail].winding = p->winding + offset[o];
            continue;
        }
        if (!ebpo_grow(&next->nodes, &next->capacity, next->count + 1, sizeof *next->nodes)) {
            ebpo_array_free(b->workspace, envelope);
            return false;
        }
        next->nodes[next->count++] =
            (pending){ node->child + o, cell, p->winding + offset[o], envelope };
    }
    return true;
}

static void front_free(front *w)
{
    for (uint64_t i = 0; i < w->count; i++)
        ebpo_array_free(w->b->workspace, w->nodes[i].envelope);
    free(w->nodes);
    *w = (front){ .b = w->b };
}

/* Makes the first front, which is the root; if the root is a piece, the front is empty. */
static ebpo_status front_begin(ebpo_builder *b, front *w, ebpo_error *error)
{
    ebpo_polytope *cube = ebpo_array_alloc(b->workspace, 1, sizeof *cube);
    if (!cube)
        return no_memory(b, error);
    ebpo_polytope_cube(cube);
    if (b->top.nodes[0].type == EBPO_LEAF) { /* a small model is one piece */
        b->piece[0].above = cube;
        return EBPO_OK;
    }
    if (!ebpo_grow(&w->nodes, &w->capacity, 1, sizeof *w->nodes)) {
        ebpo_array_free(b->workspace, cube);
        return no_memory(b, error);
    }
    w->nodes[w->count++] = (pending){ 0, b->top.cell, 0, cube };
    return EBPO_OK;
}

ebpo_status ebpo_build_top(ebpo_builder *b, ebpo_error *error)
{
    b->top_envelope = ebpo_alloc_zero(b->top.detail_count + 1, sizeof *b->top_envelope);
    if (!b->top_envelope)
        return no_memory(b, error);
    front current = { .b = b }, next = { .b = b };
    ebpo_status status = front_begin(b, &current, error);
    ebpo_pass pass = { &b->options->progress, 0, 0, b->top.detail_count };
    ebpo_progress progress = ebpo_pass_progress(&pass);
    while (status == EBPO_OK && current.count) {
        pass.begin = pass.end;
        pass.end += current.count;
        status = ebpo_parallel_for(b->threads, NULL, current.count, 1, front_envelopes, &current,
                                   &progress, "top envelopes", error);
        for (uint64_t i = 0; i < current.count && status == EBPO_OK; i++)
            if (!pass_down(b, &current.nodes[i], &next))
                status = no_memory(b, error);
        front_free(&current);
        current = next;
        next = (front){ .b = b };
    }
    front_free(&current);
    front_free(&next);
    return status;
}
