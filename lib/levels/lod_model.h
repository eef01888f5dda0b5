/* What a walk down the tree needs: the levels, their ranks, and the faces from which leaves derive
 * their planes. Read only while walking. */
#ifndef EBPO_LEVELS_LOD_MODEL_H
#define EBPO_LEVELS_LOD_MODEL_H

#include <ebpo/file.h>

#include "geometry/cell.h"
#include "geometry/polytope.h"
#include "geometry/level_nodes.h"
#include "construct/planes.h"

typedef enum ebpo_leaf_source {
    EBPO_LEAF_STORED,   /* planes from the file */
    EBPO_LEAF_DERIVED,  /* planes from the leaf's faces */
    EBPO_LEAF_INHERITED /* the file has neither: the parent's envelope in the leaf's cell */
} ebpo_leaf_source;

typedef struct ebpo_lod_model {
    const ebpo_info *info;
    ebpo_box box;
    int target; /* deepest level read */
    ebpo_leaf_source leaf_source;
    ebpo_level level[EBPO_LEVELS_MAX];
    ebpo_level_ranks ranks[EBPO_LEVELS_MAX];
    ebpo_mesh mesh; /* for EBPO_LEAF_DERIVED */
} ebpo_lod_model;

/* Reads levels 0 .. target. On failure nothing is left to free. */
EBPO_MUST_USE ebpo_status ebpo_lod_model_read(ebpo_lod_model *out, const ebpo_file *file,
                                              int target, const ebpo_read_options *read,
                                              ebpo_error *error);
void ebpo_lod_model_free(ebpo_lod_model *model);

/* Its nodes. */
static inline ebpo_level_nodes ebpo_lod_model_nodes(const ebpo_lod_model *model)
{
    return (ebpo_level_nodes){ model->level, model->ranks, model->target + 1 };
}

/* Room for the faces of one leaf; one for each thread, zero-initialised, freed with free(faces). */
typedef struct ebpo_leaf_scratch {
    ebpo_triangle *faces;
    uint64_t capacity;
} ebpo_leaf_scratch;

/* Cuts `envelope` (on entry the parent's in this cell) to that of leaf number `leaf` of the cell's
 * level. */
EBPO_MUST_USE ebpo_status ebpo_lod_leaf(const ebpo_lod_model *model, ebpo_cell cell, uint64_t leaf,
                                        ebpo_leaf_scratch *scratch, ebpo_polytope *envelope,
                                        ebpo_error *error);

/* The triangles that a leaf lists, in scratch->faces. */
EBPO_MUST_USE ebpo_status ebpo_lod_leaf_faces(const ebpo_lod_model *model, ebpo_cell cell,
                                              uint64_t leaf, ebpo_leaf_scratch *scratch,
                                              uint64_t *count, ebpo_error *error);

/* Which corners of a solid's leaf lie inside, for ebpo_leaf_planes; `winding`: at its lowest one.
 */
unsigned ebpo_lod_inside_corners(const ebpo_box *box, ebpo_cell cell, ebpo_rule rule,
                                 int32_t winding, const ebpo_triangle *faces, uint64_t count);

/* The planes that a leaf derives from its faces; `envelope` as in ebpo_lod_leaf. */
EBPO_MUST_USE ebpo_status ebpo_lod_leaf_planes(const ebpo_lod_model *model, ebpo_cell cell,
                                               uint64_t leaf, ebpo_leaf_scratch *scratch,
                                               ebpo_polytope *envelope,
                                               uint32_t codes[EBPO_PLANES_MAX], int *plane_count,
                                               ebpo_error *error);

#endif
