/* Verifies labels, which are the winding numbers of cells and of their corners, by links (common
 * corners of cells must agree) and by rays (crossings with the whole mesh). */
#ifndef EBPO_VERIFY_VERIFY_LABELS_H
#define EBPO_VERIFY_VERIFY_LABELS_H

#include <ebpo/mesh.h>

#include "geometry/cells.h"
#include "verify/tally.h"
#include "verify/verify_geometry.h"
#include "verify/verify_tree.h"

/* --- winding numbers of many points by rays --- */

/* A point to check by rays: the lowest corner of a cell. */
typedef struct ebpo_ray_point {
    double at[3];
    uint64_t octcode; /* code of the cell */
    int64_t stored;   /* winding number in the file */
    int64_t found;    /* winding number by crossings, set by ebpo_rays_follow */
} ebpo_ray_point;

/* A list of points. A structure of zeros is an empty list. The caller frees `point` with
 * ebpo_array_free. */
typedef struct ebpo_ray_points {
    ebpo_workspace *workspace; /* workspace from which `point` is allocated, or NULL */
    ebpo_ray_point *point;
    uint64_t count, capacity;
} ebpo_ray_points;

/* Appends a point. Returns false when out of memory. */
EBPO_MUST_USE bool ebpo_rays_add(ebpo_ray_points *points, const ebpo_ray_point *point);

/* Sets `found` of all points to their exact winding numbers in the whole mesh. The points are
 * shifted as described in verify_geometry.h, and must be in the box. The mesh must not be empty,
 * and must have finite coordinates and valid indices. Changes the order of the points. */
EBPO_MUST_USE ebpo_status ebpo_rays_follow(ebpo_ray_points *points, const ebpo_mesh *mesh,
                                           const ebpo_box *box, unsigned threads,
                                           const ebpo_progress *progress, ebpo_error *error);

/* --- labels --- */

/* Winding numbers of a cell's corners. Bits 0, 1 and 2 of a corner's index are set for the upper
 * end in x, y and z. */
typedef struct ebpo_node_windings {
    int64_t at[8];
    unsigned known; /* bit i: at[i] is known. Without a mesh, only corner 0 of a leaf is known */
} ebpo_node_windings;

/* The cells to check by rays: an even sample of the cells of each level and type. */
typedef struct ebpo_label_plan {
    uint64_t cells[EBPO_LEVELS_MAX][4]; /* number of all cells, by level and type */
    uint64_t take[EBPO_LEVELS_MAX][4];  /* number of cells to check */
} ebpo_label_plan;

/* Chooses about `samples` cells. If `samples` is 0, chooses the default number that
 * ebpo_verify_options documents. */
void ebpo_label_plan_make(ebpo_label_plan *plan, const ebpo_reference_tree *view, uint64_t samples);

/* Computes the winding numbers of the corners of a leaf, white or black node. `faces`: [count]
 * indices of the faces that touch the node's cell. */
void ebpo_terminal_windings(ebpo_node_windings *out, const ebpo_reference_tree *view,
                            const ebpo_reference_node *node, const ebpo_frame *frame,
                            const uint32_t *faces, uint64_t count);

/* Checks that a white node is outside and a black node is inside by the file's rule. */
void ebpo_check_terminal_label(ebpo_tally *tally, const ebpo_reference_tree *view,
                               const ebpo_reference_node *node);

/* If the plan contains the cell, adds its lowest corner to the points to check by rays. Returns
 * false when out of memory. */
EBPO_MUST_USE bool ebpo_label_note(ebpo_ray_points *points, const ebpo_reference_tree *view,
                                   const ebpo_reference_node *node, const ebpo_frame *frame,
                                   const ebpo_label_plan *plan);
/* Compares the winding numbers that rays have found with the winding numbers in the file. */
void ebpo_check_rays(ebpo_tally *tally, const ebpo_ray_points *points);

/* Compares the winding numbers at common corners of the children of a gray node. Stores the winding
 * numbers of the node's corners in *out. */
void ebpo_check_links(ebpo_tally *tally, const ebpo_reference_node *node,
                      const ebpo_node_windings children[8], ebpo_node_windings *out);

/* Checks that the winding numbers of the root's corners are 0. */
void ebpo_check_root_corners(ebpo_tally *tally, const ebpo_node_windings *root);

/* Returns a mask: bit i is set if corner i is in the solid. */
unsigned ebpo_windings_inside(const ebpo_reference_tree *view, const ebpo_node_windings *corners);

#endif
