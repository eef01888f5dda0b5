/* What all export formats share: blocks (a level's envelopes with their nodes, or the mesh with its
 * source's numbers; and colours), the job that a writer is called with, and the writers. */
#ifndef EBPO_DERIVE_EXPORT_JOB_H
#define EBPO_DERIVE_EXPORT_JOB_H

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
void ebpo_block_free(ebpo_block *block);

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

/* --- jobs and formats --- */

typedef struct ebpo_export_job ebpo_export_job;

/* What is known of a format: a row of the table in export.c. */
typedef struct ebpo_export_row {
    const char *name;          /* and the default ending of its files */
    const char *second_ending; /* of a second file; NULL: the format has one file */
    bool replaces_ending;      /* of the first file's name; else it is appended */
    bool holds_vertex_colours, holds_face_colours;
    bool takes_colours; /* ebpo_export_options.vertex_colours */
    bool one_block;     /* a file holds a single level, or the mesh */
    /* Fills the report. NULL: the build does not have the library that writes it. */
    ebpo_status (*write)(const ebpo_export_job *job, ebpo_error *error);
} ebpo_export_row;

/* `path` and `second` are the names that the files get. */
struct ebpo_export_job {
    const ebpo_file *file;
    const char *path, *second;
    ebpo_export_format format;
    const ebpo_export_row *row; /* of the format */
    const ebpo_export_options *options;
    ebpo_export_report *report;
};

/* Reads block i and enters it in the report. Freed by ebpo_block_free, on failure too;
 * EBPO_E_CANCELLED when the caller wants to stop. */
EBPO_MUST_USE ebpo_status ebpo_export_read_block(const ebpo_export_job *job, int i,
                                                 ebpo_block_order order, ebpo_block *out,
                                                 ebpo_error *error);

/* EBPO_E_LIMIT for what a format cannot count. GLB, of that many bytes of text and of numbers: its
 * sizes have 32 bits. OBJ and STL: assimp numbers corners in 32 bits. */
enum { EBPO_GLB_HEADS = 28 };
EBPO_MUST_USE ebpo_status ebpo_export_check_glb(const char *path, uint64_t text, uint64_t bin,
                                                ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_export_check_scene(const char *path, uint64_t vertices,
                                                  uint64_t faces, ebpo_error *error);

/* Vertices less the origin, [vertex_count][3] to be freed, NULL on failure (EBPO_E_MEMORY;
 * EBPO_E_LIMIT: a coordinate beyond float32). *largest_change becomes the largest change of a
 * coordinate, when that is more than it was. */
EBPO_MUST_USE ebpo_status ebpo_mesh_floats(float **out, const ebpo_mesh *mesh,
                                           const double origin[3], double *largest_change,
                                           ebpo_error *error);

/* The writers, one file each: export_NAME.c. */
EBPO_MUST_USE ebpo_status ebpo_export_xdmf(const ebpo_export_job *job, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_export_vtkhdf(const ebpo_export_job *job, ebpo_error *error);
/* glTF and GLB */
EBPO_MUST_USE ebpo_status ebpo_export_gltf(const ebpo_export_job *job, ebpo_error *error);
/* OBJ and STL; absent from a build without assimp */
EBPO_MUST_USE ebpo_status ebpo_export_assimp(const ebpo_export_job *job, ebpo_error *error);

#endif
