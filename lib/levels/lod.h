/* Declares what the computation of a level's polygons (lod.c) shares with other files: polyhedra as
 * triangles, the model that a walk reads, and the planes of leaves. */
#ifndef EBPO_LEVELS_LOD_H
#define EBPO_LEVELS_LOD_H

#include <ebpo/file.h>
#include <ebpo/lod.h>

#include "construct/planes.h"
#include "geometry/cap_tree.h"
#include "geometry/cells.h"
#include "geometry/level_nodes.h"
#include "geometry/polytope.h"

/* --- polyhedra as triangles, collected piece by piece and joined in a fixed order --- */

/* A piece: the polyhedra of the nodes that one walk of the octree visits at one level. */
typedef struct ebpo_polyhedra {
    double *xyz;     /* [vertex_count][3] */
    uint32_t *faces; /* [face_count][3], indices within the piece */
    uint64_t vertex_count, vertex_capacity, face_count, face_capacity;
    bool wants_nodes;     /* true: `nodes` and `corners` are filled as well */
    ebpo_lod_node *nodes; /* [node_count] nodes with polyhedra */
    uint8_t *corners;     /* [polygon_count] number of corners of each polygon */
    uint64_t node_count, node_capacity, polygon_count, polygon_capacity;
    double volume; /* of all polyhedra, in model units */
} ebpo_polyhedra;

/* Appends the polytope (cell coordinates) of a cell's node as triangle fans. With `cell_faces`
 * false, omits the polygons on cell faces. */
EBPO_MUST_USE ebpo_status ebpo_polyhedra_add(ebpo_polyhedra *piece, const ebpo_polytope *p,
                                             const ebpo_box *box, ebpo_cell cell,
                                             ebpo_node_type type, bool cell_faces,
                                             ebpo_error *error);

/* Joins `count` pieces, in order, to a mesh of double vertices, and frees the pieces. Returns
 * EBPO_E_LIMIT for more than 2^32 - 2 vertices or faces. `nodes` may be NULL; otherwise all pieces
 * must have nodes. Winding numbers in `nodes` are 0. */
EBPO_MUST_USE ebpo_status ebpo_polyhedra_join(ebpo_mesh *out, ebpo_lod_nodes *nodes,
                                              ebpo_polyhedra *const *pieces, uint64_t count,
                                              ebpo_error *error);

/* --- the model: levels, ranks (positions of nodes in the arrays of a level), and the faces from
 * which leaf planes are derived; a walk only reads it --- */

typedef enum ebpo_leaf_source {
    EBPO_LEAF_STORED,  /* planes from the file */
    EBPO_LEAF_DERIVED, /* planes from the leaf's faces */
    /* The file has neither planes of leaves nor faces. A leaf gets the parent's envelope, cut to
       the leaf's cell. */
    EBPO_LEAF_INHERITED
} ebpo_leaf_source;

typedef struct ebpo_lod_model {
    const ebpo_info *info;
    ebpo_box box; /* the root cell */
    int target;   /* deepest level read */
    ebpo_leaf_source leaf_source;
    ebpo_level level[EBPO_LEVELS_MAX];       /* [target + 1] */
    ebpo_level_ranks ranks[EBPO_LEVELS_MAX]; /* [target + 1] */
    ebpo_mesh mesh;                          /* empty except for EBPO_LEAF_DERIVED */
    /* [mesh.face_count] indices in the file of the faces of `mesh`, ascending, if `mesh` has only
     * the faces that leaves list; NULL: `mesh` has all faces of the file */
    uint32_t *picked;
    /* with border_inside and EBPO_LEAF_DERIVED: the caps, which show in which leaves planes of the
     * faces contain the inside; without a border in the file, no planes are derived */
    ebpo_cap_tree caps;
    bool has_caps;
} ebpo_lod_model;

/* Reads levels 0 .. target. After a failure there is nothing to free. */
EBPO_MUST_USE ebpo_status ebpo_lod_model_read(ebpo_lod_model *out, const ebpo_file *file,
                                              int target, const ebpo_read_options *read,
                                              ebpo_error *error);
void ebpo_lod_model_free(ebpo_lod_model *model);

/* Returns the model in the form in which cursors and searches read nodes. */
static inline ebpo_level_nodes ebpo_lod_model_nodes(const ebpo_lod_model *model)
{
    return (ebpo_level_nodes){ model->level, model->ranks, model->target + 1 };
}

/* Scratch memory for the faces of one leaf; each thread needs its own. Initialise with zeros; free
 * with free(faces). */
typedef struct ebpo_leaf_scratch {
    ebpo_triangle *faces;
    uint64_t capacity;
} ebpo_leaf_scratch;

/* Collects the triangles that a leaf lists, in scratch->faces. leaf: its rank among the leaves of
 * the cell's level. */
EBPO_MUST_USE ebpo_status ebpo_lod_leaf_faces(const ebpo_lod_model *model, ebpo_cell cell,
                                              uint64_t leaf, ebpo_leaf_scratch *scratch,
                                              uint64_t *count, ebpo_error *error);

/* Returns which corners of a leaf are inside the solid (bit i: corner i), for ebpo_leaf_planes.
 * `winding` is the winding number at the lowest corner of the leaf. */
unsigned ebpo_lod_inside_corners(const ebpo_box *box, ebpo_cell cell, ebpo_rule rule,
                                 int32_t winding, const ebpo_triangle *faces, uint64_t count);

/* Derives the planes of a leaf from its faces, as the codes codes[0 .. *plane_count - 1]. On entry
 * `envelope` is the parent's envelope cut to the leaf's cell, on return the leaf's envelope. */
EBPO_MUST_USE ebpo_status ebpo_lod_leaf_planes(const ebpo_lod_model *model, ebpo_cell cell,
                                               uint64_t leaf, ebpo_leaf_scratch *scratch,
                                               ebpo_polytope *envelope,
                                               uint32_t codes[EBPO_PLANES_MAX], int *plane_count,
                                               ebpo_error *error);

#endif
