/* SPDX-License-Identifier: MIT
 * Exports levels, simplified surfaces and the mesh to formats of other programs. A level is
 * exported as the envelopes of its nodes, which are convex polyhedra that contain the parts of the
 * solid in the nodes' cells. ebpo_mesh_write_ply (mesh.h) writes PLY. Also adds caps to a mesh.
 */
#ifndef EBPO_EXPORT_H
#define EBPO_EXPORT_H

#include <ebpo/lod.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Format of an exported file. */
typedef enum ebpo_export_format {
    /*
     * XDMF 3, a spatial collection of grids. Each level is a grid of polyhedra with the data of
     * their nodes; the mesh is a grid of triangles. Arrays are in a second file, NAME.h5.
     */
    EBPO_EXPORT_XDMF,

    /*
     * VTKHDF 1.0, one unstructured grid of polygons. Each level and the mesh are separate
     * partitions.
     */
    EBPO_EXPORT_VTKHDF,

    /*
     * glTF 2.0 with a second file, NAME with extension .bin. Coordinates of GLTF, GLB, OBJ and STL
     * files are rounded to float32.
     */
    EBPO_EXPORT_GLTF,
    EBPO_EXPORT_GLB, /* glTF 2.0 in one file */
    EBPO_EXPORT_OBJ, /* by assimp: equal vertices become one, in the order of their first use */
    EBPO_EXPORT_STL, /* written by assimp, binary; only one level, or the mesh */

    /*
     * 3D Tiles 1.1 in a new folder: tileset.json, a tile for each patch of the simplified surface,
     * and, with ebpo_export_options.mesh, tiles with the model's faces, except in a subset by a
     * box. Tiles are GLB files as for ebpo_export_options.surface. The geometricError of a tile
     * with a patch is the greatest error (ebpo_patch.error plus rounding) of this tile and the
     * tiles below; that of a tile with faces is the rounding of the coordinates. Viewers show the
     * model's z axis upwards. The table of all patches and one patch at a time are in memory.
     */
    EBPO_EXPORT_TILES
} ebpo_export_format;

/*
 * Returns the name, which is the default extension: "xdmf", "vtkhdf", "gltf", "glb", "obj", "stl",
 * "tiles". The string is static. Returns NULL for invalid values.
 *
 * Threads: any.
 */
EBPO_API const char *ebpo_export_format_name(ebpo_export_format format);

/* Options of ebpo_export. */
typedef struct ebpo_export_options {
    size_t struct_size;

    /*
     * Levels to export, as closed polyhedra (ebpo_lod_level). If first_level > last_level, no
     * levels are exported.
     */
    int first_level, last_level;

    /*
     * True: exports the mesh. In XDMF and VTKHDF, the mesh is in the file's order, with source
     * indices. In other formats it is in the source's order if the file has source indices, else in
     * the file's order.
     *
     * Colours (colours.h) are exported if present. XDMF and VTKHDF: arrays `rgba` of 4 bytes, for
     * vertices and faces. glTF: attribute COLOR_0 in linear colours; it has alpha, although the
     * material is opaque. OBJ: red, green and blue after the coordinates of a vertex, 0 to 1. STL
     * has no colours; glTF and OBJ have no colours of faces.
     *
     * Levels have colours if the file has EBPO_PART_COLOURS: each vertex has the colour of its
     * node. These colours are exported in the same way. In VTKHDF, vertices and faces without
     * colours are white.
     */
    bool mesh;

    unsigned threads;

    ebpo_progress progress;

    /*
     * For glTF and OBJ: [vertex_count][4] colours for the mesh's vertices, as red, green, blue and
     * alpha, in the order of ebpo_file_read_source_mesh. NULL: the colours in the file. For other
     * formats, this member must be NULL (EBPO_E_ARGUMENT).
     */
    const uint8_t *vertex_colours;

    /*
     * GLB with `surface`: the greatest number of triangles. 0: no limit. With a limit, last_level
     * is ignored, and patches of any levels are chosen, so that the error is as small as this
     * number of triangles allows.
     */
    uint64_t triangles;

    /*
     * True: exports the simplified surface (EBPO_PART_SURFACE) as one mesh without cracks: the
     * patches of last_level, and the coarser patches that have no patches below. GLB only, with
     * 16-bit positions, 8-bit normals (KHR_mesh_quantization) and EXT_meshopt_compression; `mesh`
     * must be false. Nothing else of the file is read.
     */
    bool surface;

    uint8_t reserved[7];
} ebpo_export_options;

#define EBPO_EXPORT_OPTIONS_INIT                                                           \
    {                                                                                      \
        sizeof(ebpo_export_options), 0, -1, true, 0, { NULL, NULL }, NULL, 0, false, { 0 } \
    }

/* Statistics of an exported level, of the simplified surface, or of the mesh. */
typedef struct ebpo_export_block {
    int level;                    /* -1: the mesh */
    uint64_t nodes;               /* number of polyhedra; 0 for the mesh */
    uint64_t polygons;            /* number of polygons; for the mesh, number of triangles */
    uint64_t triangles, vertices; /* in the file; in OBJ, before equal vertices are joined */
    double volume;                /* volume of the envelopes; 0 for the mesh */
} ebpo_export_block;

/* Result of exporting colours. */
typedef enum ebpo_export_colours {
    EBPO_EXPORT_NO_COLOURS, /* the file has no colours of the exported data */
    EBPO_EXPORT_WRITTEN,    /* the colours were written */
    EBPO_EXPORT_OMITTED     /* the format does not support the colours */
} ebpo_export_colours;

/* Description of the files that ebpo_export wrote. */
typedef struct ebpo_export_report {
    size_t struct_size;

    /* Number of items of `block`. */
    int block_count;
    ebpo_export_block block[EBPO_LEVELS_MAX + 1];

    /*
     * glTF of levels and of the mesh: vertices are relative to this point, which is the translation
     * of the glTF nodes. 3D Tiles: the translation of the root tile. For all other exports 0. A
     * surface has no translation here, because the matrix of its glTF node contains the position;
     * programs that keep matrices as float32 round this position.
     */
    double origin[3];

    /* Maximum change of a coordinate by rounding to the format, in the model's unit. 0: exact. */
    double largest_change;

    /* ebpo_export_colours for vertices (mesh and levels) and for faces. */
    uint64_t vertex_colours, face_colours;

    /*
     * Simplified surface: in its `block`, `level` is the level of the deepest patch, and `nodes` is
     * the number of patches. `error`: each point of the surface is at most this far from the model,
     * and each point of the model is at most this far from the surface, including rounding. Tiles:
     * the error of the coarsest tile.
     */
    double error;

    /* 3D Tiles: numbers of tiles and of bytes of all files. */
    uint64_t tiles, bytes;
} ebpo_export_report;

#define EBPO_EXPORT_REPORT_INIT EBPO_SIZED(ebpo_export_report)

/*
 * Gets the name of the second file that ebpo_export writes besides `path`; "" if the format has no
 * second file. The name is stored in `out`, which has `space` bytes. Returns false if the name does
 * not fit, or if the format does not support the name (XDMF: ":" in the name; glTF: ".bin" at end).
 *
 * Threads: any.
 */
EBPO_API bool ebpo_export_second_file(ebpo_export_format format, const char *path, char *out,
                                      size_t space);

/*
 * Exports levels, a surface or the mesh to a file, which is replaced atomically. A second file is
 * replaced just before the first file. If the replacement of the first file fails (EBPO_E_IO), the
 * second file has already been replaced.
 *
 * For XDMF and VTKHDF, one level is in memory at a time; for other formats, all levels are.
 *
 * report   may be NULL
 *
 * 3D Tiles are written to a temporary folder beside `path`; the complete folder is renamed to
 * `path`, which must not exist.
 *
 * EBPO_E_ARGUMENT: a level is not valid, no data is selected, the format does not support the
 * selected data, or the coarsest surface has more triangles than options.triangles.
 * EBPO_E_UNSUPPORTED: the library was built without assimp. EBPO_E_ABSENT: the mesh or the surface
 * is requested, and the file has none. EBPO_E_LIMIT: more than 2^32 - 2 vertices or faces, a
 * coordinate beyond the range of float32 in a format that has float32 coordinates, or a GLB file of
 * 2^32 bytes or more. EBPO_E_IO. Also the errors of reading (base.h).
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_export(const ebpo_file *file, const char *path,
                                               ebpo_export_format format,
                                               const ebpo_export_options *options,
                                               ebpo_export_report *report, ebpo_error *error);

/*
 * Closes the holes of a surface: appends caps to a mesh that was read from `file`. The caps are
 * triangles over the points of the border (format-spec/border.md); they follow the faces. Their
 * vertices are new, so they have equal positions but other indices than those of the faces. The
 * mesh and its caps are in the mesh's workspace. Other data of the mesh (attributes) are freed.
 *
 * mesh     from ebpo_file_read_mesh or ebpo_file_read_source_mesh, or a zeroed struct for a mesh of
 *          the caps alone; unchanged on failure
 *
 * EBPO_E_ABSENT: the file has no border, or is a subset. EBPO_E_LIMIT: more than 2^32 - 2 vertices
 * or faces, or more caps than three times the file's faces plus the points of the border. Also the
 * errors of reading (base.h).
 *
 * Threads: one at a time per mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_add_caps(ebpo_mesh *mesh, const ebpo_file *file,
                                                      ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
