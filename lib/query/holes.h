/* Decides points inside a surface with holes, by its generalized winding number. Caps are faces
 * that close the loops of the border. */
#ifndef EBPO_QUERY_HOLES_H
#define EBPO_QUERY_HOLES_H

#include <stdatomic.h>

#include <ebpo/query.h>

#include "geometry/cap_bounds.h"
#include "geometry/cells.h"
#include "query/accel.h"

/* The caps of a surface, and the rule. Any thread. */
typedef struct ebpo_holes {
    ebpo_cap_tree caps;
    ebpo_cap_rule rule;
    _Atomic uint64_t ties; /* number of decisions that were ties */
} ebpo_holes;

/* Reads the border of a file with EBPO_PART_BORDER. */
EBPO_MUST_USE ebpo_status ebpo_holes_read(ebpo_holes **out, const ebpo_file *file, double threshold,
                                          ebpo_error *error);
void ebpo_holes_free(ebpo_holes *holes); /* accepts NULL */
uint64_t ebpo_holes_bytes(const ebpo_holes *holes);
/* Returns an upper bound of the bytes of a border in memory. Twice of this also holds it while it
 * is read. */
static inline uint64_t ebpo_holes_estimate(const ebpo_info *info)
{
    return info->parts & EBPO_PART_BORDER ? 4096 + EBPO_CAPS_BYTES * info->border_points : 0;
}

/* Returns the maximum bytes of marks of a whole model. */
static inline uint64_t ebpo_holes_marks_max(const ebpo_info *info)
{
    return info->parts & EBPO_PART_BORDER ? (UINT64_C(1) << 17) + 320 * info->border_points : 0;
}

/* Decides what is constant in the cells of a table's nodes, and marks these nodes. Uniform entries
 * get a number of ebpo_marked_entry in place of the winding number at their lowest corner. A leaf
 * with cell_face EBPO_NEAR_BORDER is decided point by point; in other leaves the rule for the
 * integer winding number decides, as in a solid. Uniform nodes that are not decided are split into
 * groups of eight cells, down to level `deepest`. The data that are added to the table take at most
 * `bytes`. Returns EBPO_E_LIMIT for winding numbers beyond 2^25. */
typedef struct ebpo_marked_table {
    const ebpo_box *box;
    ebpo_cell root;
    ebpo_node_table *table;
    const ebpo_accel *accel; /* of the table; NULL: the table has no leaves */
    ebpo_cell_faces_fn *cell_faces;
    int deepest;
    uint64_t bytes;
} ebpo_marked_table;
EBPO_MUST_USE ebpo_status ebpo_holes_mark(const ebpo_holes *holes, const ebpo_marked_table *marked,
                                          ebpo_error *error);
/* Returns the bytes that were added to a table. */
uint64_t ebpo_holes_marked_bytes(const ebpo_node_table *table);

/* Results for all points of a cell without faces. */
typedef enum ebpo_uniform_mark {
    EBPO_MARK_OUT = 0,
    EBPO_MARK_IN = 1,
    EBPO_MARK_NEAR = 2,   /* decided point by point */
    EBPO_MARK_LISTED = 3, /* the same; the value is the index of its ebpo_near_cell */
    EBPO_MARK_SPLIT = 4   /* has parts; the value is their index in ebpo_node_table.split */
} ebpo_uniform_mark;

static inline int32_t ebpo_marked_entry(int32_t value, ebpo_uniform_mark mark)
{
    return value * 8 + (int32_t)mark;
}
static inline ebpo_uniform_mark ebpo_entry_mark(int32_t marked)
{
    return (ebpo_uniform_mark)((uint32_t)marked & 7);
}
static inline int32_t ebpo_marked_value(int32_t marked) { return (marked - (marked & 7)) / 8; }

/* Returns the mark of a part of a cell: that at position `at` of level `fine`. *level: in, the
 * level of the cell; out, that of the part. */
static inline int32_t ebpo_marked_part(const ebpo_node_table *table, int32_t marked,
                                       const uint32_t at[3], int fine, int *level)
{
    while (ebpo_entry_mark(marked) == EBPO_MARK_SPLIT)
        marked = table->split[ebpo_marked_value(marked)][ebpo_octant_at(at, fine - ++*level)];
    return marked;
}

/* Returns the crossings of caps on the way from the lowest corner of a cell to a point in it, both
 * shifted: along x, then y, then z. */
int32_t ebpo_holes_crossings(const ebpo_holes *holes, const double low[3], const double p[3]);

/* The same, of the caps that may touch a cell. */
int32_t ebpo_holes_list_crossings(const ebpo_holes *holes, const ebpo_node_table *table,
                                  const ebpo_near_cell *cell, const double low[3],
                                  const double p[3]);

/* Classifies a point that is on no face; `winding` is the winding number of surface and caps. The
 * second function is faster, for a point of a cell. */
ebpo_where ebpo_holes_where(ebpo_holes *holes, const double p[3], int32_t winding);
ebpo_where ebpo_holes_where_in(ebpo_holes *holes, const ebpo_node_table *table,
                               const ebpo_near_cell *cell, const double p[3], int32_t winding);

#endif
