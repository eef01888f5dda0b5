/* EBP-Octree in HDF5: levels and the mesh in other programs' formats. ebpo_mesh_write_ply (mesh.h)
 * writes PLY. */
#ifndef EBPO_EXPORT_H
#define EBPO_EXPORT_H

#include <ebpo/lod.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum ebpo_export_format {
    /* XDMF 3, a spatial collection of grids: each level one grid of polyhedra with their nodes'
       data, the mesh one of triangles. Numbers in a second file, NAME.h5 */
    EBPO_EXPORT_XDMF,
    /* VTKHDF 1.0, one unstructured grid of polygons; each level and the mesh are a partition of
       their own */
    EBPO_EXPORT_VTKHDF,
    /* glTF 2.0, with a second file, NAME less its ending and with .bin. This and the following hold
       float32 */
    EBPO_EXPORT_GLTF,
    EBPO_EXPORT_GLB, /* glTF 2.0 in one file */
    EBPO_EXPORT_OBJ, /* through assimp, without a material library */
    EBPO_EXPORT_STL  /* through assimp, binary; one level or the mesh, no more */
} ebpo_export_format;

/* The name, which is the usual ending: "xdmf", "vtkhdf", "gltf", "glb", "obj", "stl". A static
 * string; NULL for other values. */
EBPO_API const char *ebpo_export_format_name(ebpo_export_format format);

typedef struct ebpo_export_options {
    size_t struct_size; /* EBPO_EXPORT_OPTIONS_INIT sets it */
    /* each level is what ebpo_lod_level gives: closed polyhedra; first > last: no level */
    int first_level, last_level;
    /* the model as well: XDMF and VTKHDF in the file's order, with the source's numbers; the others
     * in the source's order where the maps are there */
    bool mesh;
    unsigned threads; /* 0: all cores */
    ebpo_progress progress;
} ebpo_export_options;
#define EBPO_EXPORT_OPTIONS_INIT                                    \
    {                                                               \
        sizeof(ebpo_export_options), 0, -1, true, 0, { NULL, NULL } \
    }

/* A level, or the mesh, as it was written. */
typedef struct ebpo_export_block {
    int level;         /* -1: the mesh */
    uint64_t nodes;    /* polyhedra; the mesh: 0 */
    uint64_t polygons; /* the mesh: triangles */
    uint64_t triangles, vertices;
    double volume; /* of the envelopes; the mesh: 0 */
} ebpo_export_block;

typedef struct ebpo_export_report {
    size_t struct_size; /* EBPO_EXPORT_REPORT_INIT sets it */
    int block_count;
    ebpo_export_block block[EBPO_LEVELS_MAX + 1];
    /* glTF: vertices are relative to this point, which is the translation of the nodes; else 0 */
    double origin[3];
    /* of a coordinate, by rounding it to the format's: 0 when every bit was kept */
    double largest_change;
} ebpo_export_report;
#define EBPO_EXPORT_REPORT_INIT EBPO_SIZED(ebpo_export_report)

/* Name of the second file that comes with `path`, in room bytes at `out`; "" when there is none.
 * False: there is no room for it, or the format does not take this name (":" in an XDMF's). */
EBPO_API bool ebpo_export_second_file(ebpo_export_format format, const char *path, char *out,
                                      size_t room);

/* Writes the file: whole or not at all (temporary name, fsync, rename). So is a second file, which
 * is put in place just before it: when the first then fails (EBPO_E_IO), the second is new already.
 * XDMF and VTKHDF hold one level in memory at a time, the others all of them. `report` may be NULL.
 * EBPO_E_ARGUMENT: no such level, nothing to write, or more than the format holds;
 * EBPO_E_UNSUPPORTED: a build without assimp; EBPO_E_ABSENT: `mesh`, and the file has none;
 * EBPO_E_LIMIT: more than 2^32 - 2 vertices or faces, a coordinate beyond float32 in a format that
 * holds these, or a GLB beyond 2^32 bytes; EBPO_E_IO, EBPO_E_FORMAT, EBPO_E_MEMORY,
 * EBPO_E_CANCELLED as everywhere. `options` may be NULL. Any thread; the file may be in use
 * elsewhere. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_export(const ebpo_file *file, const char *path,
                                               ebpo_export_format format,
                                               const ebpo_export_options *options,
                                               ebpo_export_report *report, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
