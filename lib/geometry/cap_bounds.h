/* Bounds the winding numbers of the discs of a border (cap_tree.h) at a point, or at all points of
 * a box.
 *
 * The bounds are sums of half angles (halves of solid angles). The sum for all discs is 2 pi w_D,
 * where w_D is the winding number of the discs. An entry is the index of a node of the tree, and
 * means all triangles of the node. A node may be a stretch, that is, a path along a border loop. A
 * stretch has the triangles of its two halves, and one more triangle (geometry/cap_triangles.h). An
 * entry with the bit EBPO_CAP_TRIANGLE means only this triangle. */
#ifndef EBPO_GEOMETRY_CAP_BOUNDS_H
#define EBPO_GEOMETRY_CAP_BOUNDS_H

#include "core/workspace.h"
#include "geometry/cap_tree.h"

/* A box, or a point if the radius is 0. */
typedef struct ebpo_cap_box {
    double centre[3];
    double half[3]; /* upper bounds of half the sides */
    double radius;  /* upper bound of half the diagonal */
} ebpo_cap_box;
ebpo_cap_box ebpo_cap_box_of(const double low[3], const double high[3]);
static inline ebpo_cap_box ebpo_cap_point(const double p[3])
{
    return (ebpo_cap_box){ { p[0], p[1], p[2] }, { 0, 0, 0 }, 0 };
}

#define EBPO_CAP_TRIANGLE UINT32_C(0x80000000)

/* Lists of entries, one after another. The owner frees `entry` by ebpo_array_free. */
typedef struct ebpo_cap_lists {
    ebpo_workspace *workspace; /* owns `entry`; NULL: malloc */
    uint32_t *entry;
    uint64_t count, capacity;
} ebpo_cap_lists;

/* Makes the list of a box from the list entry[begin .. end) of a larger box, and appends it to
 * `lists`. Omits entries whose distance from the box is large compared with their size and the size
 * of the box. Adds the bounds of the omitted entries, which hold in the whole box, to *far.
 * Replaces entries that are larger than the box by their parts. Returns EBPO_E_MEMORY, or
 * EBPO_E_LIMIT if the list would have more than `most` entries; then appends nothing. */
ebpo_status ebpo_cap_lists_narrow(ebpo_cap_lists *lists, const ebpo_cap_tree *tree,
                                  const ebpo_cap_box *box, uint64_t begin, uint64_t end,
                                  uint64_t most, ebpo_bounded *far);

/* A cell that contains cells in which some points are inside and others may be outside, so a query
 * must decide for each point. The record has the sum of the bounds of far discs, and a list of
 * entries for the other discs: ebpo_node_table.disc[first .. first + count). */
typedef struct ebpo_near_cell {
    float far_middle, far_error; /* ebpo_bounded of the far discs */
    /* If no face touches the cell: the winding number k of the mesh with its caps, at the lowest
     * corner. If the cell is a leaf or a part of a leaf: the index of the ebpo_near_cell of the
     * whole leaf, whose list has all caps that may touch the leaf; -1: no cap touches the leaf. */
    int32_t winding;
    uint32_t first;
    uint16_t count;
    bool touched; /* true: a cap may touch the cell */
    uint8_t level;
} ebpo_near_cell;

/* Decides as ebpo_cap_decide does, at a point p of a cell. `disc`: the cell's list of entries. If
 * this list does not suffice, uses the whole tree. */
ebpo_cap_decision ebpo_cap_decide_near(const ebpo_cap_tree *tree, const ebpo_near_cell *cell,
                                       const uint32_t *disc, const double p[3], int32_t winding,
                                       const ebpo_cap_rule *rule);

/* Requests the nodes of a list from memory, before a loop over the list. */
static inline void ebpo_cap_list_prefetch(const ebpo_cap_tree *tree, const uint32_t *entry,
                                          uint64_t count)
{
    for (uint64_t i = 0; i < count; i++) {
        const ebpo_cap_node *n = &tree->node[entry[i] & ~EBPO_CAP_TRIANGLE];
        __builtin_prefetch(n);
        __builtin_prefetch(&n->slack);
    }
}

/* Returns false if certainly no cap of the list touches the box. */
bool ebpo_cap_list_near(const ebpo_cap_tree *tree, const uint32_t *entry, uint64_t count,
                        const double low[3], const double high[3]);

/* Returns the sum of the crossings of a path with the caps of an entry. A crossing is 1, -1 or 0,
 * as ebpo_axis_crossing defines it. The path leads from the lowest corner `low` of a cell to a
 * point p of the cell: along x, then y, then z. */
int32_t ebpo_cap_path_crossings(const ebpo_cap_tree *tree, uint32_t entry, const double low[3],
                                const double p[3]);

/* A front: entries that together have all discs, with the bound of each entry. Step by step, the
 * entries with the largest errors are replaced by their parts, so the sum of the bounds becomes
 * more accurate. */
enum { EBPO_CAP_FRONT = 256 };
typedef struct ebpo_cap_front {
    const ebpo_cap_tree *tree;
    ebpo_cap_box box;
    ebpo_bounded done; /* sum of the bounds of discs that are no longer among the entries */
    double stuck;      /* sum of the errors of entries that cannot be refined */
    bool touched;      /* true: a disc in `done` may touch the box */
    uint32_t count;
    uint32_t entry[EBPO_CAP_FRONT];
    ebpo_bounded bound[EBPO_CAP_FRONT];
} ebpo_cap_front;

/* Begins a front with a list of entries. `far`: the sum of the bounds of the discs that are not in
 * the list. */
void ebpo_cap_front_begin(ebpo_cap_front *front, const ebpo_cap_tree *tree, const ebpo_cap_box *box,
                          const uint32_t *entry, uint64_t count, ebpo_bounded far);
/* Begins a front with all discs. */
void ebpo_cap_front_begin_all(ebpo_cap_front *front, const ebpo_cap_tree *tree,
                              const ebpo_cap_box *box);
/* Returns the sum of the bounds of all discs. *apart: true if certainly no disc touches the box. */
ebpo_bounded ebpo_cap_front_sum(const ebpo_cap_front *front, bool *apart);
/* Replaces the entries with the largest errors by their parts. Returns false if no entry can be
 * replaced, or if the entries without parts have an error of pi, so that refining is useless. */
bool ebpo_cap_front_refine(ebpo_cap_front *front);

/* w_S is the winding number of the mesh without caps. Returns an upper bound of the difference of 2
 * pi w_S between the centre of a box and any point of the box. Returns INFINITY if no bound below
 * `most` is found. No face may touch the box, but a cap may cross it, because w_S does not jump at
 * caps. `entry`: list of the discs near the box (ebpo_cap_lists_narrow). If their borders alone
 * give no bound below `most`, the function does not visit the others. */
double ebpo_cap_variation(const ebpo_cap_tree *tree, const ebpo_cap_box *box, const uint32_t *entry,
                          uint64_t count, double most);

#endif
