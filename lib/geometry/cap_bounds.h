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

/* Bounds of a sum of half angles at the points p of a box: the sum is middle + slope . (p -
 * centre), within the error. */
typedef struct ebpo_cap_field {
    double centre[3]; /* of the box */
    ebpo_bounded at_centre;
    double slope[3];
} ebpo_cap_field;

#define EBPO_CAP_TRIANGLE UINT32_C(0x80000000)

/* Lists of entries, one after another. The owner frees `entry` by ebpo_array_free. */
typedef struct ebpo_cap_lists {
    ebpo_workspace *workspace; /* owns `entry`; NULL: malloc */
    uint32_t *entry;
    uint64_t count, capacity;
} ebpo_cap_lists;

/* Makes the list of a box from the list entry[begin .. end) of a larger box, and appends it to
 * `lists`. Omits entries whose distance from the box is large compared with their size and the size
 * of the box. *far: the bounds of the entries that are not in the list. It is moved to the box's
 * centre, and the bounds of the omitted entries are added. Replaces entries that are larger than
 * the box by their parts. Returns EBPO_E_MEMORY, or EBPO_E_LIMIT if the list would have more than
 * `most` entries; then appends nothing. */
ebpo_status ebpo_cap_lists_narrow(ebpo_cap_lists *lists, const ebpo_cap_tree *tree,
                                  const ebpo_cap_box *box, uint64_t begin, uint64_t end,
                                  uint64_t most, ebpo_cap_field *far);

/* An ebpo_cap_field in the coordinates x of a cell (0 .. 1 on each axis, accurate to 2^-30): the
 * sum is middle + slope . (2 x - 1), within the error. */
typedef struct ebpo_near_field {
    float middle, error, slope[3];
} ebpo_near_field;

/* A cell that contains cells in which some points are inside and others may be outside, so a query
 * must decide for each point. The record has a list of entries, ebpo_node_table.disc[first .. first
 * + count), and the bounds `far` of all discs that are not in the list. It also has the bounds
 * `most` of these discs and of the list's entries from `nearest` on, so most points are decided by
 * the first `nearest` entries alone. */
typedef struct ebpo_near_cell {
    ebpo_near_field far, most;
    /* The winding number k of the mesh with its caps, at the lowest corner. If the cell has several
     * leaves, the leaves have their own winding numbers, and this one is 0. */
    int32_t winding;
    uint32_t first;
    uint16_t count, nearest;
    uint8_t touching; /* only this many entries of the list, the first, may touch the cell */
    uint8_t level;
} ebpo_near_cell;
enum { EBPO_TOUCHING_ALL = UINT8_MAX }; /* in `touching`: all entries may touch the cell */

/* Returns the number of entries of a cell's list that may touch the cell. They are the first. */
static inline uint32_t ebpo_near_touching(const ebpo_near_cell *cell)
{
    return cell->touching == EBPO_TOUCHING_ALL ? cell->count : cell->touching;
}

/* Adds the bounds of an entry in the box to `sum`, whose centre is the box's, if the error is at
 * most `error`. Returns false otherwise. */
bool ebpo_cap_field_add(ebpo_cap_field *sum, const ebpo_cap_tree *tree, const ebpo_cap_box *box,
                        uint32_t entry, double error);

/* Decides as ebpo_cap_decide does, at a point p of a cell. x: p in the cell's coordinates. `disc`:
 * the cell's list of entries. If this list does not suffice, uses the whole tree. */
ebpo_cap_decision ebpo_cap_decide_near(const ebpo_cap_tree *tree, const ebpo_near_cell *cell,
                                       const uint32_t *disc, const double p[3], const double x[3],
                                       int32_t winding, const ebpo_cap_rule *rule);

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
    ebpo_bounded done; /* sum of the bounds of discs that are not among the entries */
    double done_slope[3];
    double stuck; /* sum of the errors of entries that cannot be refined */
    bool touched; /* true: a disc in `done` may touch the box */
    uint32_t count;
    uint32_t entry[EBPO_CAP_FRONT];
    ebpo_bounded bound[EBPO_CAP_FRONT]; /* as ebpo_cap_field.at_centre */
    double slope[EBPO_CAP_FRONT][3];    /* valid if the box is not a point */
} ebpo_cap_front;

/* Begins a front with a list of entries. `far`: the sum of the bounds of the discs that are not in
 * the list, with the centre of the box. */
void ebpo_cap_front_begin(ebpo_cap_front *front, const ebpo_cap_tree *tree, const ebpo_cap_box *box,
                          const uint32_t *entry, uint64_t count, const ebpo_cap_field *far);
/* Begins a front with all discs. */
void ebpo_cap_front_begin_all(ebpo_cap_front *front, const ebpo_cap_tree *tree,
                              const ebpo_cap_box *box);
/* The sum of the bounds of all discs, and what it says about the values in the box. */
typedef struct ebpo_cap_sum {
    ebpo_bounded all; /* contains the values at all points of the box */
    /* if > 0: at some points of the box the values are at least all.middle + spread, and at others
     * at most all.middle - spread */
    double spread;
    bool apart; /* certainly no disc touches the box */
} ebpo_cap_sum;
ebpo_cap_sum ebpo_cap_front_sum(const ebpo_cap_front *front);
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
