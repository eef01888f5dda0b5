/* Decides if points are inside a surface with holes, by the surface's generalized winding number.
 * The border is the edges of the holes, which form loops. Caps are faces that close these loops. */
#ifndef EBPO_QUERY_HOLES_H
#define EBPO_QUERY_HOLES_H

#include <stdatomic.h>

#include <ebpo/query.h>

#include "geometry/cap_bounds.h"
#include "geometry/cells.h"
#include "query/accel.h"

/* The caps of a surface, and the rule. Any thread may use the struct. */
typedef struct ebpo_holes {
    ebpo_cap_tree caps;
    ebpo_cap_rule rule;
    _Atomic uint64_t ties;  /* number of decisions that were ties (ebpo_cap_decision) */
    _Atomic uint64_t terms; /* number of terms of all sums of bounds for marks so far */
} ebpo_holes;

/* Reads the border of a file with EBPO_PART_BORDER. */
EBPO_MUST_USE ebpo_status ebpo_holes_read(ebpo_holes **out, const ebpo_file *file, double threshold,
                                          ebpo_error *error);
void ebpo_holes_free(ebpo_holes *holes); /* accepts NULL */
uint64_t ebpo_holes_bytes(const ebpo_holes *holes);
/* Returns an upper bound of the bytes of a border in memory. Reading the border takes at most twice
 * as many bytes. */
static inline uint64_t ebpo_holes_estimate(const ebpo_info *info)
{
    return info->parts & EBPO_PART_BORDER ? 4096 + EBPO_CAPS_BYTES * info->border_points : 0;
}

/* Returns the maximum bytes that ebpo_holes_mark adds to the table of a whole model. */
static inline uint64_t ebpo_holes_marks_max(const ebpo_info *info)
{
    return info->parts & EBPO_PART_BORDER ? (UINT64_C(1) << 20) + 320 * info->border_points : 0;
}

/* Finds the nodes of a table in which all points have the same result, and marks all nodes of the
 * table. A uniform entry (white node) gets a marked entry (ebpo_marked_entry) in place of the
 * winding number at the node's lowest corner. A leaf in which the rule for the integer winding
 * number does not decide everywhere gets the cell_face EBPO_NEAR_BORDER; in other leaves it
 * decides, as in a solid. A uniform node whose points may have different results, or such a leaf,
 * is split into eight cells again and again, down to level `deepest`, and these cells are marked.
 * The data that are added to the table take at most `bytes`. Returns EBPO_E_LIMIT for winding
 * numbers beyond 2^25. */
typedef struct ebpo_marked_table {
    const ebpo_box *box; /* root cell of the model */
    ebpo_cell root;      /* cell of the table's root */
    ebpo_node_table *table;
    const ebpo_accel *accel; /* accel with this table; NULL: the table has no leaves */
    ebpo_cell_faces_fn *cell_faces;
    int deepest;
    uint64_t bytes;
} ebpo_marked_table;
EBPO_MUST_USE ebpo_status ebpo_holes_mark(ebpo_holes *holes, const ebpo_marked_table *marked,
                                          ebpo_error *error);
/* Returns the bytes that ebpo_holes_mark has added to a table. */
uint64_t ebpo_holes_marked_bytes(const ebpo_node_table *table);

/* The result for the points of a cell: a white or black node, a leaf near the border, or a part of
 * these. A marked entry has a mark and a value. For most marks, the value is the winding number at
 * the cell's lowest corner (ebpo_holes_mark). */
typedef enum ebpo_uniform_mark {
    /* a cell without faces */
    EBPO_MARK_OUT = 0,    /* all points are outside */
    EBPO_MARK_IN = 1,     /* all points are inside */
    EBPO_MARK_NEAR = 2,   /* points are decided one by one */
    EBPO_MARK_LISTED = 3, /* points are decided one by one; value: index of the ebpo_near_cell */
    EBPO_MARK_SPLIT = 4,  /* the cell has eight parts; value: index in ebpo_node_table.split */
    /* a leaf or a part of a leaf */
    EBPO_MARK_FACES = 5,      /* no cap touches the cell; the rule for the winding number decides */
    EBPO_MARK_FACES_NEAR = 6, /* points are decided one by one */
    EBPO_MARK_FACES_LISTED = 7 /* the same; value: index of the ebpo_near_cell */
} ebpo_uniform_mark;

/* ebpo_marked_entry makes a marked entry. ebpo_entry_mark and ebpo_marked_value return the mark and
 * the value of a marked entry. */
static inline int32_t ebpo_marked_entry(int32_t value, ebpo_uniform_mark mark)
{
    return value * 8 + (int32_t)mark;
}
static inline ebpo_uniform_mark ebpo_entry_mark(int32_t marked)
{
    return (ebpo_uniform_mark)((uint32_t)marked & 7);
}
static inline int32_t ebpo_marked_value(int32_t marked) { return (marked - (marked & 7)) / 8; }

/* Returns the marked entry of the part of a cell that contains the position `at` of level `fine`.
 * Goes down to the level `last` only. On entry, `marked` and *level are the cell's marked entry and
 * level; on return, *level is the part's level. */
static inline int32_t ebpo_marked_part(const ebpo_node_table *table, int32_t marked,
                                       const uint32_t at[3], int fine, int last, int *level)
{
    while (ebpo_entry_mark(marked) == EBPO_MARK_SPLIT && *level < last)
        marked = table->split[ebpo_marked_value(marked)][ebpo_octant_at(at, fine - ++*level)];
    return marked;
}

/* Returns the sum of the crossings with caps on the way from the lowest corner of a cell (`low`) to
 * a point p of the cell, along x, then y, then z. Both points are shifted as in format-spec,
 * section 10. */
int32_t ebpo_holes_crossings(const ebpo_holes *holes, const double low[3], const double p[3]);

/* Returns the same sum as ebpo_holes_crossings, but counts only the caps that may touch `cell`. */
int32_t ebpo_holes_list_crossings(const ebpo_holes *holes, const ebpo_node_table *table,
                                  const ebpo_near_cell *cell, const double low[3],
                                  const double p[3]);

/* ebpo_holes_where and ebpo_holes_where_in classify a point that is on no face. `winding` is the
 * winding number, at the point, of the closed mesh of surface and caps. ebpo_holes_where_in is
 * faster, but the point must be in `cell`. x: the point in the cell's coordinates, 0 .. 1 on each
 * axis, with an error of at most 2^-30. */
ebpo_where ebpo_holes_where(ebpo_holes *holes, const double p[3], int32_t winding);
ebpo_where ebpo_holes_where_in(ebpo_holes *holes, const ebpo_node_table *table,
                               const ebpo_near_cell *cell, const double p[3], const double x[3],
                               int32_t winding);

#endif
