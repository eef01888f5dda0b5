/* What is about to be written: the list of arrays. */
#ifndef EBPO_FORMAT_PLANNED_H
#define EBPO_FORMAT_PLANNED_H

#include <ebpo/file.h>

#include "mesh/attributes.h"
#include "format/schema.h"
#include "format/subtree_sums.h"
#include "hdf5_write/h5.h"

typedef struct ebpo_array_out {
    ebpo_array_id id;
    int level;
    char path[EBPO_PATH_BYTES];
    ebpo_shape shape; /* before ebpo_stored_shape */
    bool gates;       /* faces, stored across edges */
    /* native integers, row after row; NULL for arrays with a coding of their own */
    const void *values;
    uint8_t value_size;
    ebpo_h5_id handle;
    /* of attributes: whether they are written as columns, and whose rows they have: vertices',
     * faces', or else EBPO_A_ATTRIBUTE */
    bool columns;
    ebpo_array_id rows_of;
} ebpo_array_out;

/* What stands in the head of an array of attributes. */
typedef struct ebpo_attribute_plan {
    bool columns, items_columns, has_range;
    double range[2];
} ebpo_attribute_plan;

typedef struct ebpo_plan {
    const ebpo_tree *tree;
    ebpo_info info; /* as it will be in the file */
    ebpo_array_out *array;
    unsigned count;
    uint64_t *index[EBPO_LEVELS_MAX][EBPO_INDEXES];
    uint64_t *faces_index;             /* vertices seen before each chunk of faces */
    ebpo_subtree_sums subtrees;        /* nothing, if info.subtree_level is 0 */
    const ebpo_attributes *attributes; /* NULL: none are written */
    ebpo_attribute_plan *attribute;    /* [attributes->count] */
    uint8_t attributes_sha256[32];
} ebpo_plan;

#endif
