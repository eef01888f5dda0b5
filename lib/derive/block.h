/* What is exported: a level's envelopes with their nodes, or the mesh with its source's numbers;
 * and colours. */
#ifndef EBPO_DERIVE_BLOCK_H
#define EBPO_DERIVE_BLOCK_H

#include <ebpo/colours.h>
#include <ebpo/export.h>

#include "hdf5_write/h5.h"

typedef struct ebpo_block {
    int level; /* -1: the mesh */
    char name[24];
    ebpo_mesh mesh;
    ebpo_lod_nodes nodes; /* levels */
    ebpo_maps maps;       /* the mesh of a file with maps */
    ebpo_colours colours; /* if it has any; levels: of vertices */
    double volume;
} ebpo_block;

/* How many there are, and the i-th's level. */
int ebpo_block_count(const ebpo_export_options *options);
int ebpo_block_level(const ebpo_export_options *options, int i);

/* `level` -1: the mesh, in the file's order with the source's numbers, or in the source's order
 * where the maps are there. Freed by ebpo_block_free, on failure too. */
typedef enum ebpo_block_order { EBPO_FILE_ORDER, EBPO_SOURCE_ORDER } ebpo_block_order;
EBPO_MUST_USE ebpo_status ebpo_block_read(ebpo_block *out, const ebpo_file *file, int level,
                                          ebpo_block_order order,
                                          const ebpo_export_options *options, ebpo_error *error);
void ebpo_block_free(ebpo_block *block);
void ebpo_block_report(const ebpo_block *block, ebpo_export_report *report);

/* A number for each node, or for each polygon that of its node; of the mesh, for each triangle. */
typedef struct ebpo_column {
    const char *name;
    ebpo_h5_number number;
} ebpo_column;
enum {
    EBPO_COLUMN_OCTCODE,
    EBPO_COLUMN_LEVEL,
    EBPO_COLUMN_TYPE,
    EBPO_COLUMN_WINDING,
    EBPO_COLUMN_VOLUME,
    EBPO_COLUMN_SOURCE_FACE,
    EBPO_COLUMN_LOD,
    EBPO_COLUMNS,
    EBPO_COLUMNS_OF_NODES = EBPO_COLUMN_SOURCE_FACE
};
extern const ebpo_column ebpo_columns[EBPO_COLUMNS];

/* Vertex numbers of a polygon whose fan begins with this triangle. */
static inline uint32_t ebpo_polygon_corner(const uint32_t *triangle, unsigned i)
{
    return i < 2 ? triangle[i] : triangle[3 * (i - 2) + 2];
}

/* The values, to be freed; NULL when memory is short. */
void *ebpo_column_make(const ebpo_block *block, int column, bool polygons);
/* Numbers of the mesh's vertices in its source; levels: -1 each. I64, to be freed; NULL when memory
 * is short. */
void *ebpo_column_of_vertices(const ebpo_block *block);

#endif
