/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: levels and the mesh in other programs' formats. PLY is
 * written by ebpo_mesh_write_ply (mesh.h).
 */
#ifndef EBPO_EXPORT_H
#define EBPO_EXPORT_H

#include <ebpo/lod.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum ebpo_export_format {
    /*
     * XDMF 3, a spatial collection of grids: each level is one grid of polyhedra
     * with their nodes' data, the mesh one of triangles. The numbers are in a
     * second file, NAME.h5.
     */
    EBPO_EXPORT_XDMF,

    /*
     * VTKHDF 1.0, one unstructured grid of polygons. Each level and the mesh are
     * partitions of their own.
     */
    EBPO_EXPORT_VTKHDF,

    /*
     * glTF 2.0, with a second file: NAME, its ending replaced by .bin. This
     * format and those below hold float32.
     */
    EBPO_EXPORT_GLTF,
    EBPO_EXPORT_GLB, /* glTF 2.0 in one file */
    EBPO_EXPORT_OBJ, /* by assimp; no material library */
    EBPO_EXPORT_STL  /* by assimp, binary; one level or the mesh, no more */
} ebpo_export_format;

/*
 * The name, which is the usual ending: "xdmf", "vtkhdf", "gltf", "glb", "obj",
 * "stl". A static string; NULL for other values.
 *
 * Threads: any.
 */
EBPO_API const char *ebpo_export_format_name(ebpo_export_format format);

typedef struct ebpo_export_options {
    size_t struct_size; /* EBPO_EXPORT_OPTIONS_INIT sets it */

    /*
     * Levels as ebpo_lod_level gives them, as closed polyhedra. With first_level
     * beyond last_level there are none.
     */
    int first_level, last_level;

    /*
     * The model as well. XDMF and VTKHDF hold it in the file's order with the
     * source's numbers, the others in the source's order if the file has maps.
     *
     * With its colours (colours.h), if it has any. XDMF and VTKHDF: arrays `rgba` of
     * 4 bytes, of vertices and of faces. glTF: COLOR_0, which is linear, alpha too,
     * though the material is opaque. OBJ: red, green and blue behind a vertex, 0 to
     * 1, as many programs read them. STL holds none, and glTF and OBJ none of faces.
     *
     * Levels likewise, if the file has colours of them: each vertex has that of its
     * node. In VTKHDF's arrays what has no colours is white.
     */
    bool mesh;

    /* 0: all cores. The result does not depend on it. */
    unsigned threads;

    ebpo_progress progress;

    /*
     * glTF and OBJ: colours of the mesh's vertices in place of its own, [vertex_count][4] red,
     * green, blue and alpha in the order of ebpo_file_read_source_mesh; NULL: its own. With other
     * formats: EBPO_E_ARGUMENT.
     */
    const uint8_t *vertex_colours;
} ebpo_export_options;

#define EBPO_EXPORT_OPTIONS_INIT                                          \
    {                                                                     \
        sizeof(ebpo_export_options), 0, -1, true, 0, { NULL, NULL }, NULL \
    }

/* A level, or the mesh, as it was written. */
typedef struct ebpo_export_block {
    int level;                    /* -1: the mesh */
    uint64_t nodes;               /* polyhedra; of the mesh: 0 */
    uint64_t polygons;            /* of the mesh: its triangles */
    uint64_t triangles, vertices; /* how many were written */
    double volume;                /* of the envelopes; of the mesh: 0 */
} ebpo_export_block;

/* What became of colours. */
typedef enum ebpo_export_colours {
    EBPO_EXPORT_NO_COLOURS, /* there are none in what was wanted */
    EBPO_EXPORT_WRITTEN,
    EBPO_EXPORT_LEFT_OUT /* the format has no place for them */
} ebpo_export_colours;

typedef struct ebpo_export_report {
    size_t struct_size; /* EBPO_EXPORT_REPORT_INIT sets it */

    /* How many of `block` there are. */
    int block_count;
    ebpo_export_block block[EBPO_LEVELS_MAX + 1];

    /*
     * glTF: vertices are relative to this point, which is the translation of the
     * nodes. Others: 0.
     */
    double origin[3];

    /*
     * How much rounding to the format has moved a coordinate at most. 0: every
     * bit was kept.
     */
    double largest_change;

    /* Of vertices, of the mesh and of levels, and of faces: ebpo_export_colours. */
    uint64_t vertex_colours, face_colours;
} ebpo_export_report;

#define EBPO_EXPORT_REPORT_INIT EBPO_SIZED(ebpo_export_report)

/*
 * The name of the second file that comes with `path`, in `room` bytes at `out`;
 * "" if there is none. False: there is no room for it, or the format does not
 * take this name (":" in an XDMF's).
 *
 * Threads: any.
 */
EBPO_API bool ebpo_export_second_file(ebpo_export_format format, const char *path, char *out,
                                      size_t room);

/*
 * Writes levels and the mesh to a file, which appears whole or not at all. A
 * second file is put in place just before it, so it may be new when putting the
 * first one in place fails (EBPO_E_IO).
 *
 * XDMF and VTKHDF hold one level in memory at a time, the others all of them.
 *
 * report   what was written; or NULL
 *
 * EBPO_E_ARGUMENT: no such level, nothing to write, or more than the format
 * holds. EBPO_E_UNSUPPORTED: the library was built without assimp. EBPO_E_ABSENT:
 * the mesh is wanted, and the file has none. EBPO_E_LIMIT: more than 2^32 - 2
 * vertices or faces, a coordinate beyond float32 in a format that holds these, or
 * a GLB of 2^32 bytes. EBPO_E_CANCELLED, EBPO_E_IO, EBPO_E_MEMORY, and the errors
 * of reading.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_export(const ebpo_file *file, const char *path,
                                               ebpo_export_format format,
                                               const ebpo_export_options *options,
                                               ebpo_export_report *report, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
