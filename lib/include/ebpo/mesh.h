/* SPDX-License-Identifier: MIT
 * Reads, checks, repairs and splits triangle meshes.
 *
 *   Reading      ebpo_mesh_read, ebpo_points_parse_ply
 *   Writing      ebpo_mesh_write_ply
 *   Preparing    ebpo_mesh_prepare (arranges, repairs and checks, in the best order)
 *   Checking     ebpo_mesh_check
 *   Order        ebpo_mesh_arrange
 *   Repairing    ebpo_mesh_weld, ebpo_mesh_weld_within, ebpo_mesh_drop_duplicates,
 *                ebpo_mesh_orient, ebpo_mesh_flip, ebpo_mesh_fill_holes
 *   Components   ebpo_components_new, ebpo_components_count, ebpo_components_get,
 *                ebpo_components_mesh, ebpo_components_free
 */
#ifndef EBPO_MESH_H
#define EBPO_MESH_H

#include <ebpo/workspace.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- meshes ---- */

/* Type of the values of an attribute. */
typedef enum ebpo_attribute_type {
    EBPO_ATTRIBUTE_INT8,
    EBPO_ATTRIBUTE_UINT8,
    EBPO_ATTRIBUTE_INT16,
    EBPO_ATTRIBUTE_UINT16,
    EBPO_ATTRIBUTE_INT32,
    EBPO_ATTRIBUTE_UINT32,
    EBPO_ATTRIBUTE_FLOAT32,
    EBPO_ATTRIBUTE_FLOAT64
} ebpo_attribute_type;

/*
 * An indexed triangle mesh, as plain data, of at most 2^32 - 2 vertices and 2^32 - 2 faces. Callers
 * may read the members. To make a mesh, clear the struct, set the members, and allocate the arrays
 * with malloc. Free the mesh with ebpo_mesh_free.
 */
typedef struct ebpo_mesh {
    /* Number of vertices and of faces (triangles). */
    uint64_t vertex_count;
    uint64_t face_count;

    /*
     * [vertex_count][3] coordinates. Exactly one of the two arrays is set; the other array is NULL.
     * xyz32 is set if the source has floats, or text that floats represent (ebpo_mesh_read). xyz64
     * is set if the source has doubles, or text with more digits.
     */
    float *xyz32;
    double *xyz64;

    /* [face_count][3] vertex indices, counter-clockwise seen from outside */
    uint32_t *faces;

    /*
     * Number of faces of the source that reading changed, by kind.
     * - polygons_triangulated: polygons of more than three corners, which became triangles.
     * - polygons_concave: concave polygons among polygons_triangulated.
     * - strips: triangle strips, which became triangles.
     * - polygons_dropped: faces of fewer than three corners, which were omitted.
     */
    uint64_t polygons_triangulated;
    uint64_t polygons_concave;
    uint64_t strips;
    uint64_t polygons_dropped;

    /* Name of the mesh file without folders; "" if the mesh was not read from a file. */
    char source_name[256];

    /* SHA-256 of the file; zeros if the mesh was not read from a file. */
    uint8_t source_sha256[32];

    /* Size of the file in bytes. */
    uint64_t source_size;

    /* Format of the file: "ply-ascii", "ply-le", "ply-be", "obj", "stl", "off" or "". */
    char source_format[16];

    /*
     * Original indices of vertices and faces, set by ebpo_mesh_arrange and
     * ebpo_mesh_drop_duplicates. NULL: the mesh has all vertices and faces of the source, in the
     * source's order.
     */
    struct ebpo_arrangement *arrangement;

    /*
     * Workspace that limits the memory for checking and building. NULL: no limit. The arrays may be
     * allocated from the workspace or with malloc.
     */
    ebpo_workspace *workspace;

    /*
     * Other data of the file for vertices and faces (`attributes` of ebpo_mesh_read_options), owned
     * by the mesh. NULL: none.
     */
    struct ebpo_attributes *attributes;

    /*
     * polygons_guessed: number of triangulated polygons whose outline crosses itself, so that their
     * triangles are only a guess. first_guessed_face: index of the first triangle of the first
     * polygon of this kind.
     */
    uint64_t polygons_guessed;
    uint64_t first_guessed_face;
} ebpo_mesh;

/*
 * Frees the arrays and clears the struct.
 *
 * Threads: one at a time per mesh.
 */
EBPO_API void ebpo_mesh_free(ebpo_mesh *mesh);

/*
 * Returns a text that names the attributes of the file that could not be kept. NULL: all attributes
 * were kept, or no attributes were requested. The text is valid until the mesh is freed.
 *
 * Threads: any.
 */
EBPO_API const char *ebpo_mesh_attributes_lost(const ebpo_mesh *mesh);

/*
 * Returns a text that describes data of the file that was omitted, rounded or not found. Examples:
 * - values that the header of a PLY file does not describe
 * - coordinates of a PLY text file whose digits do not fit in a float, although the header declares
 *   floats; the text gives the largest rounding error
 * - texture coordinates to which faces of an OBJ file refer, but which the file does not contain
 * - data that was not read because no attributes were requested
 *
 * NULL: there is no such data. The text is valid until the mesh is freed.
 *
 * Threads: any.
 */
EBPO_API const char *ebpo_mesh_ignored(const ebpo_mesh *mesh);

/*
 * Returns 1 if the mesh has attributes or comments of a PLY file, else 0. Attributes that could not
 * be kept do not count.
 *
 * Threads: any.
 */
EBPO_API int ebpo_mesh_has_attributes(const ebpo_mesh *mesh);

/* ---- reading and writing ---- */

/* Options of ebpo_mesh_read. */
typedef struct ebpo_mesh_read_options {
    size_t struct_size;

    unsigned threads;

    ebpo_progress progress;

    /*
     * Workspace that limits the memory for the mesh, for checking it, and for building a tree from
     * it. Free the workspace after the mesh. NULL: no limit.
     */
    ebpo_workspace *workspace;

    /*
     * 1: also reads attributes, which ebpo_build stores. From PLY files: all properties of
     * vertices, faces and other elements, and comments. From other formats: colours, normals,
     * texture coordinates and names of materials. For PLY and OBJ files, attributes include the
     * names of the texture images to which the file or its material libraries refer. If an image is
     * in the file's folder or below, its digest is included, too. 0: reads no attributes.
     */
    uint64_t attributes;

    /*
     * 1: also reads the bytes of the texture images, if `attributes` is 1. 0: does not read these
     * bytes.
     */
    uint64_t embed_textures;
} ebpo_mesh_read_options;

#define EBPO_MESH_READ_OPTIONS_INIT                                   \
    {                                                                 \
        sizeof(ebpo_mesh_read_options), 0, { NULL, NULL }, NULL, 0, 0 \
    }

/*
 * Reads a PLY, OBJ, STL or OFF file. The format is recognised by the first bytes. If the first
 * bytes do not decide, the file name decides. If the name does not decide, the first word of the
 * file decides (OBJ).
 *
 * Polygons are triangulated, including concave polygons and polygons that touch themselves (slits,
 * bridges to holes, pinched corners). A polygon whose outline crosses itself, such as a folded
 * quad, is counted in `polygons_guessed`; if it has at most 64 corners, the triangulation of least
 * area is used. Triangle strips are converted to triangles.
 *
 * Binary coordinates keep every bit. Text of a PLY file is rounded correctly to the type in the
 * header. Text of other formats becomes floats if floats represent every coordinate, and doubles
 * otherwise. A float represents a coordinate if the nearest float, rounded to the digits of the
 * text, gives the text again. In OBJ, STL and OFF files, vertices of equal position are merged, and
 * unreferenced vertices are omitted. In PLY files, unreferenced vertices are omitted if their
 * coordinates are not finite. ebpo_mesh_ignored describes data that was omitted or rounded.
 *
 * Safe for untrusted files. The whole file is read into memory; with `workspace`, into an array of
 * the workspace, which may be a temporary file.
 *
 * EBPO_E_IO: also if another program changes the file during reading. EBPO_E_FORMAT: the file is
 * not a mesh, or is damaged. EBPO_E_LIMIT: the mesh has too many vertices or faces.
 * EBPO_E_UNSUPPORTED: the variant of the format is not supported, such as binary OFF. On failure
 * `out` is cleared.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_read(const char *path,
                                                  const ebpo_mesh_read_options *options,
                                                  ebpo_mesh *out, ebpo_error *error);

/*
 * Reads the vertices of a PLY file that is in memory. All variants that ebpo_mesh_read supports are
 * allowed. Faces are ignored and may be missing. Coordinates may be NaN or infinite. Safe for
 * untrusted data.
 *
 * name    name of the data for messages
 * xyz     [*count][3] coordinates, freed by free(). Binary floats and integers are converted
 *         exactly. If no float represents a text value of a float property (see ebpo_mesh_read),
 *         the result is the double nearest to the text
 *
 * EBPO_E_FORMAT, EBPO_E_LIMIT.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_points_parse_ply(const void *data, uint64_t size,
                                                         const char *name, double **xyz,
                                                         uint64_t *count, ebpo_error *error);

/*
 * Writes a binary little-endian PLY file, which is replaced atomically. Vertices are floats or
 * doubles as in the mesh; vertex indices of triangles are int32 or uint32. Attributes that were
 * read from a PLY file keep their order and types, and the comments of that file are also written.
 * A mesh with attributes must be in the order of its source.
 *
 * EBPO_E_ARGUMENT: the mesh is not valid. EBPO_E_IO.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_write_ply(const ebpo_mesh *mesh, const char *path,
                                                       ebpo_error *error);

/* ---- checking ---- */

/* Maximum number of locations in ebpo_finding. */
#define EBPO_FINDING_LOCATIONS 4

/*
 * Number of findings of one kind, and the source indices of the first findings. A *finding* is a
 * property of one edge, vertex or face that is often a defect, such as an edge that only one face
 * uses.
 */
typedef struct ebpo_finding {
    /* Number of findings of this kind. */
    uint64_t count;

    /* The min(count, EBPO_FINDING_LOCATIONS) least source indices, ascending. */
    uint64_t locations[EBPO_FINDING_LOCATIONS];
} ebpo_finding;

/*
 * Properties of a mesh. Edges are undirected pairs of distinct vertex indices. A face uses each of
 * its edges in one direction. The location of an edge is the least source index of the faces that
 * use the edge. If two edges of one kind have the same location, the index is listed twice.
 */
typedef struct ebpo_mesh_report {
    /*
     * True if each edge is used equally often in both directions. In this case winding numbers are
     * well defined, and the mesh is a solid. The theses (README.md) require a closed 2-manifold
     * (`manifold`).
     */
    bool balanced;

    /*
     * True for a closed, consistently oriented 2-manifold (EBP 2017, section 3.1).
     */
    bool manifold;

    /* Edges that are used once. */
    ebpo_finding boundary_edges;

    /* Edges that are used more than twice. */
    ebpo_finding nonmanifold_edges;

    /* Edges that are used twice in the same direction. */
    ebpo_finding misoriented_edges;

    /*
     * Edges that are not used equally often in both directions. Each of these edges also belongs to
     * boundary_edges, nonmanifold_edges or misoriented_edges.
     */
    ebpo_finding unbalanced_edges;

    /*
     * Vertices whose faces form more than one fan, including the ends of non-manifold edges. A fan
     * is a chain of faces connected by edges that are used twice.
     */
    ebpo_finding bowtie_vertices;

    /* Faces without area, by an exact test, including the faces of index_repeated_faces. */
    ebpo_finding zero_area_faces;

    /* Faces that use a vertex twice. */
    ebpo_finding index_repeated_faces;

    /*
     * Faces with the same three distinct vertices as an earlier face, in any rotation and
     * orientation.
     */
    ebpo_finding repeated_faces;

    /* Vertices that no face uses. */
    ebpo_finding unreferenced_vertices;

    /* Vertices at the position of an earlier vertex. */
    ebpo_finding repeated_positions;

    /* Number of edges. */
    uint64_t edges;

    /*
     * Number of components. A component is a set of faces that are connected by vertices.
     * Unreferenced vertices are not counted.
     */
    uint64_t components;

    /*
     * Number of holes. A hole is a closed chain of boundary edges; a chain that passes a vertex
     * twice is split there.
     */
    uint64_t boundary_loops;

    /* Sum of the genus of all components. genus_known: false if the mesh is not `manifold`. */
    bool genus_known;
    int64_t genus;

    /* Sum of the areas of all faces, in square units of the source. */
    double area;

    /*
     * Signed volume, in cubic units of the source: the integral of the winding number (see
     * ebpo_solid_volume_of in query.h). 0 for a surface.
     */
    double volume;

    /* Mean edge length as defined in EBP 2017, equation 3, in the unit of the source. */
    double mean_edge;

    /* Bounding box of the referenced vertices. */
    double min[3], max[3];
} ebpo_mesh_report;

/*
 * Checks a mesh and counts findings.
 *
 * EBPO_E_FORMAT: a coordinate is NaN or infinite, a vertex index is out of range, or the mesh has
 * no faces; the message gives the location. EBPO_E_ARGUMENT: the struct of the mesh is not valid.
 * EBPO_E_LIMIT, EBPO_E_IO.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_check(const ebpo_mesh *mesh, unsigned threads,
                                                   ebpo_progress progress, ebpo_mesh_report *report,
                                                   ebpo_error *error);

/*
 * Sorts vertices and faces along a Morton curve, so that neighbours in space are neighbours in
 * memory. With this order, checking and building access memory sequentially, so a mesh can be
 * larger than memory. The mesh keeps the source indices, which reports and files use. ebpo_build
 * calls this function if needed.
 *
 * Errors are those of ebpo_mesh_check. EBPO_E_LIMIT: a coordinate is beyond 2^1000, so that the
 * cell faces of an octree would not be exact doubles. On failure the mesh is unchanged.
 *
 * Threads: one at a time per mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_arrange(ebpo_mesh *mesh, unsigned threads,
                                                     ebpo_progress progress, ebpo_error *error);

/* ---- repairing ---- */

/* Repairs that were made. ebpo_build stores them in the file. */
typedef struct ebpo_repair_record {
    /* True for each repair that was requested. */
    bool weld, orient, fill_holes, drop_duplicates;

    /* Number of vertices that were merged into another vertex. */
    uint64_t welded_vertices;

    /* Number of faces that were reversed. */
    uint64_t flipped_faces;

    /*
     * Number of sets of faces that cannot be oriented, or whose faces around an edge cannot have
     * alternating directions (see ebpo_mesh_orient).
     */
    uint64_t unorientable_components;

    /* Number of holes that were closed by faces. */
    uint64_t filled_holes;

    /* Number of faces that fill holes. These faces are at the end of the mesh. */
    uint64_t added_faces;

    /* Number of chains of boundary edges that form no simple loop, and were not filled. */
    uint64_t unfilled_holes;

    /* Number of faces that were removed because an earlier face has the same vertices. */
    uint64_t dropped_faces;

    /* Number of dropped faces whose orientation is opposite to the orientation of the kept face. */
    uint64_t dropped_opposite;

    /*
     * Distance given to ebpo_mesh_weld_within, and greatest distance by which this function moved a
     * vertex. 0: the function was not called.
     */
    double weld_distance;
    double weld_moved;

    /*
     * Number of faces that use a vertex twice after ebpo_mesh_weld_within, and therefore have no
     * area.
     */
    uint64_t collapsed_faces;
} ebpo_repair_record;

/*
 * Rules for the repair functions: each function adds its counts to `record`, which the caller has
 * cleared; `record` may be NULL. The functions use all cores.
 *
 * EBPO_E_FORMAT: a vertex index is out of range. EBPO_E_LIMIT: more than 2^32 - 2 faces. EBPO_E_IO.
 * On failure the mesh is unchanged.
 */

/*
 * Merges vertices of equal position (-0 equals 0), including unreferenced vertices. Of all vertices
 * at one position, the first vertex stays; the order of vertices is kept. Faces that use a vertex
 * twice after merging are not removed.
 *
 * Threads: one at a time per mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_weld(ebpo_mesh *mesh, ebpo_repair_record *record,
                                                  ebpo_error *error);

/*
 * Merges vertices of equal position as ebpo_mesh_weld does, and then vertices that are within a
 * distance of each other. Positions are visited in ascending order of x, then y, then z. A vertex
 * is kept if no earlier kept vertex is within the distance. Each vertex that is not kept is merged
 * into the nearest kept vertex (if several are equally near, into the first). Distances are
 * compared exactly.
 *
 * No vertex moves farther than the distance, even in a chain of near vertices. No two kept vertices
 * are within the distance. The result does not depend on the order of vertices. A kept vertex keeps
 * its position, index and attributes. Faces that use a vertex twice after merging are not removed,
 * and are counted in `collapsed_faces`.
 *
 * distance   in the mesh's unit; above 0, and less than the longest side of the bounding box of all
 *            vertices
 *
 * EBPO_E_ARGUMENT: the distance is out of range, or below 2^-49 of the box's longest side. On
 * failure the mesh is valid; vertices of equal position may have been merged.
 *
 * Threads: one at a time per mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_weld_within(ebpo_mesh *mesh, double distance,
                                                         ebpo_repair_record *record,
                                                         ebpo_error *error);

/*
 * Removes repeated faces: of all faces with the same three distinct vertices, in any rotation and
 * orientation, the first face in the source stays. `repeated_faces` of ebpo_mesh_report counts the
 * removed faces. The order and the source indices are kept, and attributes of faces remain assigned
 * by source index.
 *
 * Repeated faces of the same orientation count twice in winding numbers and volume. Two faces of
 * opposite orientation cancel, for example the two sides of a sheet, or the boundary between two
 * solids. So a mesh may be balanced with both faces, but not with one of them. `dropped_opposite`
 * counts the removed faces of opposite orientation. ebpo_mesh_check and ebpo_mesh_try_repairs show
 * if removing faces makes the mesh open.
 *
 * EBPO_E_ARGUMENT: the mesh is a component (ebpo_components_mesh) and has repeated faces.
 *
 * Threads: one at a time per mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_drop_duplicates(ebpo_mesh *mesh,
                                                             ebpo_repair_record *record,
                                                             ebpo_error *error);

/*
 * Counts the faces that ebpo_mesh_drop_duplicates would remove after ebpo_mesh_weld: faces whose
 * corners are at the three positions of an earlier face. If repeated_positions of ebpo_mesh_report
 * is 0, the result is equal to repeated_faces of the report.
 *
 * out        number of these faces, and first source indices
 * opposite   number of these faces whose orientation is opposite to the orientation of the kept
 *            face
 *
 * Errors are those of ebpo_mesh_weld. On failure `out` and `opposite` are 0.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_count_repeated(const ebpo_mesh *mesh, unsigned threads,
                                                            ebpo_finding *out, uint64_t *opposite,
                                                            ebpo_error *error);

/*
 * Orients faces consistently. First, directions are made to agree: if an edge has exactly two
 * faces, both faces use the edge in opposite directions. Then shells are turned outwards, or
 * inwards if they bound a cavity.
 *
 * Here a *patch* is a set of faces that are connected by edges that are used twice. A patch is a
 * *shell* if it uses each edge equally often in both directions. So two cubes that share only a
 * vertex or an edge are two shells.
 *
 * A patch may be open at edges that are used more than twice. Example: each of two stacked cubes
 * has its own faces in the common square, so four faces use each side of the square. The square of
 * a cube is one patch, the other five sides of the cube are another patch, and both patches are
 * open. Patches are joined at edges that are used more than twice. The faces at such an edge are
 * sorted by their angle around the edge. In this order, each face gets the direction opposite to
 * the direction of the previous face. The angles are compared exactly; faces at the same angle are
 * ordered by source index. Faces that already alternate are unchanged. Joined patches are a shell
 * if they use each edge equally often in both directions.
 *
 * A shell gets a positive volume, or a negative volume if it is inside an odd number of other
 * shells. Shell A is inside shell B if the least and the greatest vertex of A along each axis are
 * inside B. A vertex is inside B if its exact winding number with respect to B is not zero.
 *
 * An open patch is oriented so that most of its faces are unchanged. A patch that cannot be
 * oriented is unchanged. If the faces of a set of joined patches cannot alternate around all edges,
 * the patches are separated again and oriented one by one. `unorientable_components` counts patches
 * that cannot be oriented, and sets that were separated. Do not orient a mesh in which solids
 * inside other solids are intended, because they become cavities.
 *
 * Threads: one at a time per mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_orient(ebpo_mesh *mesh, ebpo_repair_record *record,
                                                    ebpo_error *error);

/*
 * Reverses every face. Adds the number of faces to `flipped_faces` of the record. The record has no
 * flag for this step.
 *
 * Threads: one at a time per mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_flip(ebpo_mesh *mesh, ebpo_repair_record *record,
                                                  ebpo_error *error);

/*
 * Closes each boundary loop (boundary_loops of ebpo_mesh_report) by triangles between its vertices.
 * The triangles are appended at the end; no vertices are added.
 *
 * A loop of up to 256 edges gets the triangulation of least area. If possible, triangulations that
 * use an existing edge of the mesh are excluded. Longer loops are closed by ear clipping. Some
 * chains of boundary edges do not close, because orientations differ (see ebpo_mesh_orient). Such
 * chains are unchanged, and are counted in `unfilled_holes`.
 *
 * Threads: one at a time per mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_fill_holes(ebpo_mesh *mesh, ebpo_repair_record *record,
                                                        ebpo_error *error);

/* ---- all steps in one call ---- */

/* Options of ebpo_mesh_prepare. */
typedef struct ebpo_prepare_options {
    size_t struct_size;

    /*
     * True: the step is made. The order of all steps is ebpo_mesh_weld, ebpo_mesh_drop_duplicates,
     * ebpo_mesh_orient, ebpo_mesh_flip, ebpo_mesh_fill_holes. After holes were filled, closed
     * components are oriented again. A mesh from STL (`source_format`) is welded even if `weld` is
     * false. This does not change a mesh from ebpo_mesh_read, which has already merged vertices of
     * equal position.
     */
    bool weld;
    bool orient;
    bool fill_holes;

    unsigned threads;

    ebpo_progress progress;

    /* 1: also calls ebpo_mesh_flip. 0: does not call it. */
    uint64_t flip;

    /* 1: also calls ebpo_mesh_drop_duplicates. 0: does not call it. */
    uint64_t drop_duplicates;

    /* Above 0: calls ebpo_mesh_weld_within with this distance, and does not call ebpo_mesh_weld. */
    double weld_distance;
} ebpo_prepare_options;

#define EBPO_PREPARE_OPTIONS_INIT                                                     \
    {                                                                                 \
        sizeof(ebpo_prepare_options), false, false, false, 0, { NULL, NULL }, 0, 0, 0 \
    }

/* Result of ebpo_mesh_prepare. */
typedef struct ebpo_prepared {
    size_t struct_size;

    /* True if repairs were made. In this case `before` and `report` may differ. */
    bool was_repaired;

    /* Repairs that were made. */
    ebpo_repair_record record;

    /* before: report on the original mesh. report: report on the repaired mesh, for ebpo_build. */
    ebpo_mesh_report before;
    ebpo_mesh_report report;
} ebpo_prepared;

#define EBPO_PREPARED_INIT EBPO_SIZED(ebpo_prepared)

/*
 * Prepares a mesh for ebpo_build: arranges the mesh, repairs it as requested, and checks it before
 * and after the repairs. Calling the function of each step gives the same mesh and reports, but may
 * need more memory. A mesh with coordinates beyond 2^1000 (ebpo_mesh_arrange) is also checked, but
 * ebpo_build rejects it.
 *
 * Errors are those of the functions of the steps. On failure `out` is cleared; the mesh is valid
 * and includes the changes of the steps that were completed.
 *
 * Threads: one at a time per mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_prepare(ebpo_mesh *mesh,
                                                     const ebpo_prepare_options *options,
                                                     ebpo_prepared *out, ebpo_error *error);

/* ---- components ---- */

/*
 * Components of a mesh. Faces that share vertices are in one component. A component is closed if it
 * uses each edge equally often in both directions.
 *
 * A closed component of negative volume is a cavity. A cavity is joined to the closed component of
 * positive volume that surrounds it. A component surrounds a cavity if the component's exact
 * winding number is not zero at one vertex of the cavity: the first vertex of the cavity's first
 * face in the source. If several components surround a cavity, the component of least volume is
 * used. A cavity that no component surrounds stays a separate component.
 */
typedef struct ebpo_components ebpo_components;

/* Description of a component. */
typedef struct ebpo_component {
    size_t struct_size;

    uint64_t vertex_count;
    uint64_t face_count;

    /* Lowest source index of the component's faces. */
    uint64_t first_face;

    /* True if the component uses each edge equally often in both directions. */
    bool closed;

    /* Number of cavities that were joined to this component. */
    uint64_t cavities;
} ebpo_component;

#define EBPO_COMPONENT_INIT EBPO_SIZED(ebpo_component)

/*
 * Finds the components, in the order of their first faces in the source. Unreferenced vertices
 * belong to no component.
 *
 * mesh   borrowed until ebpo_components_free
 *
 * EBPO_E_FORMAT: the mesh has no faces, or a vertex index is out of range. EBPO_E_ARGUMENT: the
 * struct of the mesh is not valid. EBPO_E_LIMIT, EBPO_E_IO.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_components_new(const ebpo_mesh *mesh, unsigned threads,
                                                       ebpo_progress progress,
                                                       ebpo_components **out, ebpo_error *error);

/*
 * Frees the components.
 *
 * Threads: one at a time per object.
 */
EBPO_API void ebpo_components_free(ebpo_components *components);

/*
 * Returns the number of components; 0 for NULL.
 *
 * Threads: any.
 */
EBPO_API uint64_t ebpo_components_count(const ebpo_components *components);

/*
 * Gets component `number`, 0 to ebpo_components_count - 1.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_components_get(const ebpo_components *components,
                                                       uint64_t number, ebpo_component *out,
                                                       ebpo_error *error);

/*
 * Makes component `number` as a mesh, in the workspace of the whole mesh. The new mesh keeps the
 * source indices, which reports and files use. Repair the whole mesh before this call:
 * ebpo_mesh_weld, ebpo_mesh_drop_duplicates and ebpo_mesh_fill_holes reject a component that they
 * would change.
 *
 * out   freed by ebpo_mesh_free; cleared on failure
 *
 * EBPO_E_IO.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_components_mesh(const ebpo_components *components,
                                                        uint64_t number, ebpo_mesh *out,
                                                        ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
