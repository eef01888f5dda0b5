/* Bounds the winding numbers of the discs of a border (cap_tree.h) at a point, or at all points of
 * a box.
 *
 * All functions return sums of half angles, that is 2 pi w_D. They work on entries: an entry is a
 * node of the tree, or with EBPO_CAP_TRIANGLE the triangle that belongs to a stretch alone. */
#ifndef EBPO_GEOMETRY_CAP_BOUNDS_H
#define EBPO_GEOMETRY_CAP_BOUNDS_H

#include "geometry/cap_tree.h"

/* A box, or a point if the radius is 0. */
typedef struct ebpo_cap_box {
    double centre[3], half[3];
    double radius; /* upper bound of half the diagonal */
} ebpo_cap_box;
ebpo_cap_box ebpo_cap_box_of(const double low[3], const double high[3]);
static inline ebpo_cap_box ebpo_cap_point(const double p[3])
{
    return (ebpo_cap_box){ { p[0], p[1], p[2] }, { 0, 0, 0 }, 0 };
}

#define EBPO_CAP_TRIANGLE UINT32_C(0x80000000)

/* Lists of entries, one after another. */
typedef struct ebpo_cap_lists {
    uint32_t *entry;
    uint64_t count, capacity;
} ebpo_cap_lists;

/* Appends the list of a box to `lists`: the list [begin, end), without the discs that are far from
 * the box compared with their size and the box's. Large discs are divided. Adds bounds of the
 * omitted discs, which hold in the whole box, to *far. Returns false without memory. */
bool ebpo_cap_lists_narrow(ebpo_cap_lists *lists, const ebpo_cap_tree *tree,
                           const ebpo_cap_box *box, uint64_t begin, uint64_t end,
                           ebpo_bounded *far);

/* A cell whose points are decided one by one: the bounds of far discs, and the list of the others,
 * ebpo_node_table.disc[first] and following. */
typedef struct ebpo_near_cell {
    float far_middle, far_error;
    /* In a cell without faces, k at its lowest corner. In a part of a leaf, the index of the leaf's
     * own record, whose list has all caps that may touch the leaf; -1: none touches it. */
    int32_t winding;
    uint32_t first;
    uint16_t count;
    bool touched; /* a cap may touch the cell */
} ebpo_near_cell;

/* Decides at a point of a cell like ebpo_cap_decide, mostly by `disc`, the cell's list, alone. */
ebpo_cap_decision ebpo_cap_decide_near(const ebpo_cap_tree *tree, const ebpo_near_cell *cell,
                                       const uint32_t *disc, const double p[3], int32_t winding,
                                       const ebpo_cap_rule *rule);

/* Returns the crossings of the caps of an entry, like ebpo_cap_crossings, on the way from the
 * lowest corner of a cell to a point in it: along x, then y, then z. */
int32_t ebpo_cap_path_crossings(const ebpo_cap_tree *tree, uint32_t entry, const double low[3],
                                const double p[3]);

/* A sum of bounds, of which the least certain ones are refined step by step. */
enum { EBPO_CAP_FRONT = 256 };
typedef struct ebpo_cap_front {
    const ebpo_cap_tree *tree;
    ebpo_cap_box box;
    ebpo_bounded done; /* sum of the discs that are not among the entries */
    double stuck;      /* sum of the errors of entries that cannot be refined */
    bool touched;      /* a disc in `done` may touch the box */
    uint32_t count;
    uint32_t entry[EBPO_CAP_FRONT];
    ebpo_bounded bound[EBPO_CAP_FRONT];
} ebpo_cap_front;

/* Begins with a list and the bounds of the omitted discs. */
void ebpo_cap_front_begin(ebpo_cap_front *front, const ebpo_cap_tree *tree, const ebpo_cap_box *box,
                          const uint32_t *entry, uint64_t count, ebpo_bounded far);
/* Begins with all discs. */
void ebpo_cap_front_begin_all(ebpo_cap_front *front, const ebpo_cap_tree *tree,
                              const ebpo_cap_box *box);
/* Returns the bounds of all discs. *apart: certainly no disc touches the box. */
ebpo_bounded ebpo_cap_front_sum(const ebpo_cap_front *front, bool *apart);
/* Refines the least certain entries. Returns false when this is not possible, or when entries that
 * cannot be refined have an error of pi. */
bool ebpo_cap_front_refine(ebpo_cap_front *front);

/* Returns an upper bound of the variation of 2 pi w_S between the centre of a box and any of its
 * points, if no face touches the box; INFINITY if there is no bound below `most`. Where a cap
 * crosses the box w_S has no jump, only k and w_D have. */
double ebpo_cap_variation(const ebpo_cap_tree *tree, const ebpo_cap_box *box, double most);

#endif
