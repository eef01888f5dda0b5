/* Declares what the writers of all export formats share: blocks, columns, the job of a writer, and
 * the writers. A block is what an export contains for one level (its envelopes) or for the mesh. */
#ifndef EBPO_DERIVE_EXPORT_JOB_H
#define EBPO_DERIVE_EXPORT_JOB_H

#include <stdio.h>

#include <ebpo/colours.h>
#include <ebpo/export.h>

#include "hdf5_write/h5.h"

typedef struct ebpo_block {
    int level; /* -1: the mesh */
    char name[24];
    ebpo_mesh mesh;       /* the mesh, or the polygons of the level's envelopes as triangles */
    ebpo_lod_nodes nodes; /* set for a level */
    ebpo_maps maps;       /* set for the mesh of a file with maps */
    ebpo_colours colours; /* set if there are colours; a level has colours of vertices */
    double volume;        /* volume of the level's envelopes */
} ebpo_block;

/* Returns the number of blocks; ebpo_block_level returns the level of block i. */
int ebpo_block_count(const ebpo_export_options *options);
int ebpo_block_level(const ebpo_export_options *options, int i);

/* Order of the faces and vertices in the block of the mesh. The source is the mesh file from which
 * the model was converted; source indices are positions in the source (part `maps` of a file). */
typedef enum ebpo_block_order {
    EBPO_FILE_ORDER,  /* order of the .ebpo.h5 file; block.maps has the source indices, if any */
    EBPO_SOURCE_ORDER /* order of the source, if the file has source indices; block.maps is empty */
} ebpo_block_order;

/* Frees a block, also after a failure. */
void ebpo_block_free(ebpo_block *block);

/* A column of values. It has one value for each node of a level, for each polygon of a level (the
 * value of the polygon's node), or for each triangle of the mesh. */
typedef struct ebpo_column {
    const char *name;
    ebpo_h5_number number; /* type of the values */
} ebpo_column;
enum {
    EBPO_COLUMN_OCTCODE,
    EBPO_COLUMN_LEVEL,
    EBPO_COLUMN_TYPE,
    EBPO_COLUMN_WINDING,
    EBPO_COLUMN_VOLUME,
    EBPO_COLUMN_SOURCE_FACE,
    EBPO_COLUMN_LOD, /* level of the block; EBPO_COLUMN_LEVEL: level of the node in the octree */
    EBPO_COLUMNS,
    EBPO_COLUMNS_OF_NODES = EBPO_COLUMN_SOURCE_FACE /* number of columns that nodes have */
};
extern const ebpo_column ebpo_columns[EBPO_COLUMNS];

/* Returns the vertex of corner i of a polygon, which is stored as a fan of triangles. `triangle` is
 * the first triangle of the fan. */
static inline uint32_t ebpo_polygon_corner(const uint32_t *triangle, unsigned i)
{
    return i < 2 ? triangle[i] : triangle[3 * (i - 2) + 2];
}

/* Returns the values of a column, to be freed by the caller; NULL when out of memory. `polygons`:
 * for a level, true: one value for each polygon; false: one value for each node. */
void *ebpo_column_make(const ebpo_block *block, int column, bool polygons);
/* Returns the source index of each vertex of the block's mesh as int64_t, to be freed by the
 * caller; NULL when out of memory. All values are -1 for a level, and if the file has no maps. */
void *ebpo_column_of_vertices(const ebpo_block *block);

/* --- jobs and formats --- */

typedef struct ebpo_export_job ebpo_export_job;

/* A format: a row of the table in export.c. */
typedef struct ebpo_export_row {
    const char *name; /* also the default ending of its files */
    /* the output is a folder with tiles of all levels of the simplified surface */
    bool folder;
    const char *second_ending; /* ending of a second file; NULL: the format has one file */
    /* true: second_ending replaces the ending of the first file's name; false: it is appended */
    bool replaces_ending;
    bool holds_vertex_colours, holds_face_colours;
    bool takes_colours; /* true: colours of the caller are written (options.vertex_colours) */
    bool one_block;     /* true: a file can have only one block */
    /* Writes the files and fills in the report. NULL: the build lacks the library for the format.
     */
    ebpo_status (*write)(const ebpo_export_job *job, ebpo_error *error);
} ebpo_export_row;

struct ebpo_export_job {
    const ebpo_file *file;
    const char *path, *second; /* names of the files to write; second is "" if there is one file */
    ebpo_export_format format;
    const ebpo_export_row *row; /* row of the format */
    const ebpo_export_options *options;
    ebpo_export_report *report;
};

/* Reads block i and adds it to the report. The caller frees the block by ebpo_block_free, also
 * after a failure. Returns EBPO_E_CANCELLED if the progress callback returns false. */
EBPO_MUST_USE ebpo_status ebpo_export_read_block(const ebpo_export_job *job, int i,
                                                 ebpo_block_order order, ebpo_block *out,
                                                 ebpo_error *error);

/* ebpo_export_check_glb and ebpo_export_check_assimp fail with EBPO_E_LIMIT for sizes that a format
 * cannot represent. GLB files have 32-bit sizes; `text` and `bin` are the sizes in bytes of the
 * JSON text and of the binary data. OBJ and STL files are written by assimp, which has 32-bit
 * indices of corners. */
enum { EBPO_GLB_HEADS = 28 }; /* size in bytes of the header and of the heads of the two chunks */
EBPO_MUST_USE ebpo_status ebpo_export_check_glb(const char *path, uint64_t text, uint64_t bin,
                                                ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_export_check_assimp(const char *path, uint64_t vertices,
                                                   uint64_t faces, ebpo_error *error);

/* Prints a number as JSON, in any locale. */
void ebpo_json_number(FILE *file, double x);
/* Prints numbers as a JSON array, after the text `before`. */
void ebpo_json_numbers(FILE *file, const char *before, const double *x, int count);

/* Sets 16-bit linear values for the 256 values of sRGB. */
void ebpo_linear_colours(uint16_t linear[256]);

/* Returns the point that becomes (0, 0, 0) in files with float32 coordinates. If the model is far
 * from zero, it is the middle of the root cell, rounded to float32; otherwise it is (0, 0, 0). */
void ebpo_choose_origin(const ebpo_info *info, double origin[3]);

/* Sets *out to the mesh's vertices minus the origin, as floats [vertex_count][3] to be freed by the
 * caller. Raises *largest_change to the largest rounding error of a coordinate. Errors:
 * EBPO_E_MEMORY; EBPO_E_LIMIT: a coordinate is out of range for float32. Then *out is NULL. */
EBPO_MUST_USE ebpo_status ebpo_mesh_floats(float **out, const ebpo_mesh *mesh,
                                           const double origin[3], double *largest_change,
                                           ebpo_error *error);

/* The writers, one file each: export_NAME.c. */
EBPO_MUST_USE ebpo_status ebpo_export_xdmf(const ebpo_export_job *job, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_export_vtkhdf(const ebpo_export_job *job, ebpo_error *error);
/* glTF and GLB */
EBPO_MUST_USE ebpo_status ebpo_export_gltf(const ebpo_export_job *job, ebpo_error *error);
/* GLB, if options.surface; and 3D Tiles */
EBPO_MUST_USE ebpo_status ebpo_export_surface(const ebpo_export_job *job, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_export_tiles(const ebpo_export_job *job, ebpo_error *error);
/* OBJ and STL; absent from a build without assimp */
EBPO_MUST_USE ebpo_status ebpo_export_assimp(const ebpo_export_job *job, ebpo_error *error);

#endif
