/* Declares data and functions of lod.c, which computes the polygons of a level, for other files:
 * polyhedra as triangles, the model that is read, and the planes of leaves. */
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

/* A piece: the polyhedra of nodes of one level, in the order in which one thread visits the nodes.
 */
typedef struct ebpo_polyhedra {
    double *xyz;     /* [vertex_count][3] */
    uint32_t *faces; /* [face_count][3], indices within the piece */
    uint64_t vertex_count, vertex_capacity, face_count, face_capacity;
    bool wants_nodes;     /* true: `nodes` and `corners` are filled as well */
    ebpo_lod_node *nodes; /* [node_count] nodes with polyhedra */
    uint8_t *corners;     /* [polygon_count] number of corners of each polygon */
    uint64_t node_count, node_capacity, polygon_count, polygon_capacity;
    double volume; /* volume of all polyhedra, in the cubed unit of the model */
} ebpo_polyhedra;

/* Appends the polytope of a node to the piece, with its polygons as triangle fans. `p`: the
 * polytope in cell coordinates. `cell`, `type`: cell and type of the node. If `cell_faces` is
 * false, omits the polygons on cell faces. */
EBPO_MUST_USE ebpo_status ebpo_polyhedra_add(ebpo_polyhedra *piece, const ebpo_polytope *p,
                                             const ebpo_box *box, ebpo_cell cell,
                                             ebpo_node_type type, bool cell_faces,
                                             ebpo_error *error);

/* Joins `count` pieces, in order, to a mesh with double coordinates, and frees the pieces. Returns
 * EBPO_E_LIMIT for more than 2^32 - 2 vertices or faces. `nodes`: gets the nodes of all pieces,
 * with winding numbers of 0; NULL if nodes are not wanted. If it is not NULL, `wants_nodes` must be
 * true in all pieces. */
EBPO_MUST_USE ebpo_status ebpo_polyhedra_join(ebpo_mesh *out, ebpo_lod_nodes *nodes,
                                              ebpo_polyhedra *const *pieces, uint64_t count,
                                              ebpo_error *error);

/* --- the model: levels, ranks (positions of nodes in the arrays of a level), and the faces from
 * which leaf planes are derived; several threads may read it at the same time --- */

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
    ebpo_mesh mesh;                          /* empty unless leaf_source is EBPO_LEAF_DERIVED */
    /* NULL: `mesh` has all faces of the file. Otherwise `mesh` has only the faces that leaves list,
     * and this array, [mesh.face_count], has their indices in the file, ascending */
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

/* Returns the model's levels and ranks as the structure from which cursors and searches read nodes.
 */
static inline ebpo_level_nodes ebpo_lod_model_nodes(const ebpo_lod_model *model)
{
    return (ebpo_level_nodes){ model->level, model->ranks, model->target + 1 };
}

/* Work space for the faces of one leaf; each thread needs a separate one. Initialise it with zeros,
 * and free it with free(faces). */
typedef struct ebpo_leaf_scratch {
    ebpo_triangle *faces;
    uint64_t capacity;
} ebpo_leaf_scratch;

/* Sets scratch->faces to the faces that a leaf lists, and *count to their number. `leaf`: rank of
 * the leaf among the leaves of the cell's level. */
EBPO_MUST_USE ebpo_status ebpo_lod_leaf_faces(const ebpo_lod_model *model, ebpo_cell cell,
                                              uint64_t leaf, ebpo_leaf_scratch *scratch,
                                              uint64_t *count, ebpo_error *error);

/* Returns a mask for ebpo_leaf_planes: bit i is set if corner i of a leaf's cell is inside the
 * solid. `winding`: winding number at the lowest corner of the cell. `faces`: [count] the leaf's
 * faces. */
unsigned ebpo_lod_inside_corners(const ebpo_box *box, ebpo_cell cell, ebpo_rule rule,
                                 int32_t winding, const ebpo_triangle *faces, uint64_t count);

/* Derives the planes of a leaf from its faces, and writes their codes to codes[0 .. *plane_count -
 * 1]. On entry, `envelope` is the parent's envelope cut to the leaf's cell; on return, it is the
 * leaf's envelope. */
EBPO_MUST_USE ebpo_status ebpo_lod_leaf_planes(const ebpo_lod_model *model, ebpo_cell cell,
                                               uint64_t leaf, ebpo_leaf_scratch *scratch,
                                               ebpo_polytope *envelope,
                                               uint32_t codes[EBPO_PLANES_MAX], int *plane_count,
                                               ebpo_error *error);

#endif
