/* Labels: winding numbers of the cells' corners, verified by links and by rays (verify_labels.c).
 */
#ifndef EBPO_VERIFY_VERIFY_LABELS_H
#define EBPO_VERIFY_VERIFY_LABELS_H

#include <ebpo/mesh.h>

#include "geometry/cells.h"
#include "verify/tally.h"
#include "verify/verify_geometry.h"
#include "verify/verify_tree.h"

/* --- rays: winding numbers of many points --- */

/* A point with its winding numbers. */
typedef struct ebpo_ray_point {
    double at[3];
    uint64_t octcode; /* code of the cell whose lowest corner it is */
    int64_t stored;   /* its winding number in the file */
    int64_t found;    /* set by ebpo_rays_follow */
} ebpo_ray_point;

/* Points in order of appearance. A list of zeros is empty; free `point` with ebpo_array_free. */
typedef struct ebpo_ray_points {
    ebpo_workspace *workspace; /* quota of the list, or NULL */
    ebpo_ray_point *point;
    uint64_t count, capacity;
} ebpo_ray_points;

/* Returns false without memory. */
EBPO_MUST_USE bool ebpo_rays_add(ebpo_ray_points *points, const ebpo_ray_point *point);

/* Sets `found` of all points: their exact winding numbers, shifted, over the whole mesh. The points
 * must be in the box; the mesh must not be empty, with finite coordinates and indices in range.
 * Sorts the points into columns. */
EBPO_MUST_USE ebpo_status ebpo_rays_follow(ebpo_ray_points *points, const ebpo_mesh *mesh,
                                           const ebpo_box *box, unsigned threads,
                                           const ebpo_progress *progress, ebpo_error *error);

/* --- labels --- */

/* Winding numbers of a cell's corners (bit 0 x, bit 1 y, bit 2 z). */
typedef struct ebpo_node_windings {
    int64_t at[8];
    unsigned known; /* bit i: at[i] is set; not all are in a file without mesh */
} ebpo_node_windings;

/* The cells that are checked by rays: about every n-th of each level and type. */
typedef struct ebpo_label_plan {
    uint64_t cells[EBPO_LEVELS_MAX][4], take[EBPO_LEVELS_MAX][4];
} ebpo_label_plan;

/* Chooses the cells. With 0 samples, the default of ebpo_verify_options is used. */
void ebpo_label_plan_make(ebpo_label_plan *plan, const ebpo_reference_tree *view, uint64_t samples);

/* Computes corner windings of a leaf, white or black node; `faces`: the `count` faces that touch
 * it. */
void ebpo_terminal_windings(ebpo_node_windings *out, const ebpo_reference_tree *view,
                            const ebpo_reference_node *node, const ebpo_frame *frame,
                            const uint32_t *faces, uint64_t count);

/* Checks that white is outside and black inside. */
void ebpo_check_terminal_label(ebpo_tally *tally, const ebpo_reference_tree *view,
                               const ebpo_reference_node *node);

/* Adds the cell's lowest corner, if planned, to the points that are checked by rays. Returns false
 * without memory. */
EBPO_MUST_USE bool ebpo_label_note(ebpo_ray_points *points, const ebpo_reference_tree *view,
                                   const ebpo_reference_node *node, const ebpo_frame *frame,
                                   const ebpo_label_plan *plan);
/* Compares the rays' results with the file. */
void ebpo_check_rays(ebpo_tally *tally, const ebpo_ray_points *points);

/* Compares the children of a gray node with each other and returns the node's corners. */
void ebpo_check_links(ebpo_tally *tally, const ebpo_reference_node *node,
                      const ebpo_node_windings children[8], ebpo_node_windings *out);

/* Checks that the root's corners are outside. */
void ebpo_check_root_corners(ebpo_tally *tally, const ebpo_node_windings *root);

/* Returns a mask; bit i is set if corner i is in the solid. */
unsigned ebpo_windings_inside(const ebpo_reference_tree *view, const ebpo_node_windings *corners);

#endif
