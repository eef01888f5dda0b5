/* Bounds the winding numbers of the discs of a border (cap_tree.h) at a point, or at all points of
 * a box.
 *
 * All functions return sums of half angles (halves of solid angles), that is 2 pi w_D. They work on
 * entries. An entry is the index of a node of the tree, and stands for all triangles of the node.
 * With the bit EBPO_CAP_TRIANGLE it stands for the one triangle of a stretch that does not belong
 * to the stretch's halves (geometry/cap_triangles.h). */
#ifndef EBPO_GEOMETRY_CAP_BOUNDS_H
#define EBPO_GEOMETRY_CAP_BOUNDS_H

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

/* Lists of entries, one after another. */
typedef struct ebpo_cap_lists {
    uint32_t *entry;
    uint64_t count, capacity;
} ebpo_cap_lists;

/* Makes the list of a box from the list entry[begin .. end) of a larger box, and appends it to
 * `lists`. Omits discs whose distance from the box is large compared with their size and the size
 * of the box, and adds their bounds, which hold in the whole box, to *far. Divides large discs.
 * Returns false when memory is short. */
bool ebpo_cap_lists_narrow(ebpo_cap_lists *lists, const ebpo_cap_tree *tree,
                           const ebpo_cap_box *box, uint64_t begin, uint64_t end,
                           ebpo_bounded *far);

/* A cell in which some points are inside and others may be outside, so that a query decides for its
 * point: the bounds of far discs, and the list of the other discs, which are
 * ebpo_node_table.disc[first .. first + count). */
typedef struct ebpo_near_cell {
    float far_middle, far_error; /* ebpo_bounded of the far discs */
    /* In a cell without faces: the winding number k at its lowest corner. In a part of a leaf: the
     * index of the leaf's own ebpo_near_cell, whose list has all caps that may touch the leaf; -1:
     * no cap touches the leaf. */
    int32_t winding;
    uint32_t first;
    uint16_t count;
    bool touched; /* a cap may touch the cell */
} ebpo_near_cell;

/* Decides as ebpo_cap_decide does, at a point of a cell. `disc` is the cell's list, which usually
 * suffices. */
ebpo_cap_decision ebpo_cap_decide_near(const ebpo_cap_tree *tree, const ebpo_near_cell *cell,
                                       const uint32_t *disc, const double p[3], int32_t winding,
                                       const ebpo_cap_rule *rule);

/* Returns the crossings of the caps of an entry, as ebpo_cap_crossings does, with the path from the
 * lowest corner `low` of a cell to a point p of the cell: along x, then y, then z. */
int32_t ebpo_cap_path_crossings(const ebpo_cap_tree *tree, uint32_t entry, const double low[3],
                                const double p[3]);

/* A sum of the bounds of entries, in which the entries with the largest errors are replaced by
 * their parts step by step. */
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

/* Begins with a list of entries, and `far`, the bounds of the discs that are not in the list. */
void ebpo_cap_front_begin(ebpo_cap_front *front, const ebpo_cap_tree *tree, const ebpo_cap_box *box,
                          const uint32_t *entry, uint64_t count, ebpo_bounded far);
/* Begins with all discs. */
void ebpo_cap_front_begin_all(ebpo_cap_front *front, const ebpo_cap_tree *tree,
                              const ebpo_cap_box *box);
/* Returns the bounds of all discs. *apart: certainly no disc touches the box. */
ebpo_bounded ebpo_cap_front_sum(const ebpo_cap_front *front, bool *apart);
/* Replaces the entries with the largest errors by their parts. Returns false if no entry can be
 * replaced, or if the entries without parts have an error of pi, so that refining is useless. */
bool ebpo_cap_front_refine(ebpo_cap_front *front);

/* Returns an upper bound of the variation of 2 pi w_S between the centre of a box and any of its
 * points, if no face touches the box; INFINITY if there is no bound below `most`. A cap may cross
 * the box: at a cap k and w_D jump, but w_S does not. */
double ebpo_cap_variation(const ebpo_cap_tree *tree, const ebpo_cap_box *box, double most);

#endif
