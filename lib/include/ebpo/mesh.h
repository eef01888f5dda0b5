/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: triangle meshes.
 *
 *   Reading    ebpo_mesh_read, ebpo_points_parse_ply
 *   Writing    ebpo_mesh_write_ply
 *   Ready to   ebpo_mesh_prepare, which does what follows in the best order
 *   build
 *   Checking   ebpo_mesh_check
 *   Order      ebpo_mesh_arrange
 *   Mending    ebpo_mesh_weld, ebpo_mesh_weld_within, ebpo_mesh_drop_duplicates,
 *              ebpo_mesh_orient, ebpo_mesh_flip, ebpo_mesh_fill_holes
 *   Parts      ebpo_components_new, ebpo_components_count, ebpo_components_get,
 *              ebpo_components_mesh, ebpo_components_free
 */
#ifndef EBPO_MESH_H
#define EBPO_MESH_H

#include <ebpo/workspace.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- meshes ---- */

/* Of the values of an attribute. */
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
 * An indexed triangle mesh: plain data. Members may be read, and set by callers
 * who make a mesh themselves. They clear the struct, allocate the arrays with
 * malloc, and free it by ebpo_mesh_free.
 *
 * At most 2^32 - 2 vertices and 2^32 - 2 faces.
 */
typedef struct ebpo_mesh {
    uint64_t vertex_count;
    uint64_t face_count;

    /*
     * [vertex_count][3] Exactly one of the two is set: xyz32 if the source holds
     * floats, or text that floats keep; xyz64 if it holds doubles, or text with more
     * digits (ebpo_mesh_read). The other is NULL.
     */
    float *xyz32;
    double *xyz64;

    /* [face_count][3] numbers of vertices, counter-clockwise seen from outside */
    uint32_t *faces;

    /*
     * What reading has done, in source faces: polygons of more than three corners,
     * how many of these were concave, triangle strips unrolled, and faces of fewer
     * than three corners left out.
     */
    uint64_t polygons_triangulated;
    uint64_t polygons_concave;
    uint64_t strips;
    uint64_t polygons_dropped;

    /* The file's name without folders; "" if not from a file. */
    char source_name[256];

    /* Of the file's bytes; zeros if not from a file. */
    uint8_t source_sha256[32];

    /* Bytes. */
    uint64_t source_size;

    /* "ply-ascii", "ply-le", "ply-be", "obj", "stl", "off" or "". */
    char source_format[16];

    /*
     * Set by ebpo_mesh_arrange and ebpo_mesh_drop_duplicates: which vertices and faces
     * of the source these are. NULL: they are those of the source, in its order.
     */
    struct ebpo_arrangement *arrangement;

    /*
     * What checking and building may use. NULL: as much memory as they like. The
     * arrays may be in it, or malloc's.
     */
    ebpo_workspace *workspace;

    /*
     * What else the file says of vertices and faces (`attributes` of
     * ebpo_mesh_read_options). The mesh owns it, and it goes where the mesh goes.
     * NULL: nothing.
     */
    struct ebpo_attributes *attributes;

    /*
     * Of the triangulated polygons, those whose outline crosses itself: they got the
     * triangles of least area, which is a guess. The first triangle of the first one.
     */
    uint64_t polygons_guessed;
    uint64_t first_guessed_face;
} ebpo_mesh;

/*
 * Frees the arrays and clears the struct.
 *
 * Threads: one per mesh.
 */
EBPO_API void ebpo_mesh_free(ebpo_mesh *mesh);

/*
 * What of the file's attributes could not be kept, in words; NULL: nothing was
 * lost, or none were asked for. Lives as long as the mesh.
 *
 * Threads: any, while nobody changes the mesh.
 */
EBPO_API const char *ebpo_mesh_attributes_lost(const ebpo_mesh *mesh);

/*
 * What reading the mesh itself left out or did not find, in words: values that a
 * PLY's header does not describe, texture coordinates that faces of an OBJ file name
 * and that are not there. Also where no attributes were asked for. NULL: nothing.
 * Lives as long as the mesh.
 *
 * Threads: any, while nobody changes the mesh.
 */
EBPO_API const char *ebpo_mesh_unread(const ebpo_mesh *mesh);

/*
 * 1: the mesh has attributes, or comments of a PLY; 0: it has none, though some may
 * have been lost.
 *
 * Threads: any, while nobody changes the mesh.
 */
EBPO_API int ebpo_mesh_has_attributes(const ebpo_mesh *mesh);

/* ---- reading and writing ---- */

typedef struct ebpo_mesh_read_options {
    size_t struct_size; /* EBPO_MESH_READ_OPTIONS_INIT sets it */

    /* 0: all cores. The result does not depend on it. */
    unsigned threads;

    ebpo_progress progress;

    /*
     * What the mesh keeps to, and so does all that is done with it. It is freed
     * after the mesh. NULL: as much memory as it takes.
     */
    ebpo_workspace *workspace;

    /*
     * 1: also reads what a PLY says of vertices, faces and other elements beyond
     * positions and corners, and its comments; of other formats colours, normals,
     * texture coordinates and names of materials; ebpo_build takes it over. Of images
     * that a PLY or the material libraries of an OBJ file name, the names, and digests
     * of those that are in the file's folder or below. 0: not.
     */
    uint64_t attributes;

    /* 1, with `attributes`: also the bytes of these images. 0: not. */
    uint64_t embed_textures;
} ebpo_mesh_read_options;

#define EBPO_MESH_READ_OPTIONS_INIT                                   \
    {                                                                 \
        sizeof(ebpo_mesh_read_options), 0, { NULL, NULL }, NULL, 0, 0 \
    }

/*
 * Reads a mesh: PLY, OBJ, STL or OFF. The format is recognised by the file's first
 * bytes, then by its name, then, as OBJ, by its first word.
 *
 * Polygons are triangulated, concave ones correctly, also those that touch themselves
 * (slits, bridges to holes, pinched corners). Of outlines that cross themselves, folded
 * quads among them, the triangles have the least area, up to 64 corners, and are
 * counted in `polygons_guessed`. Strips are unrolled. Positions keep every bit, and
 * text is rounded correctly: of PLY to the type in its header.
 * Text of the other formats has no type: positions are floats if each nearest float,
 * rounded to the last digit of its text, gives the text, else doubles, all of them. In
 * these formats vertices of one position are one, and those that no face names are left
 * out. Vertices of a PLY that no face names are left out if their coordinates are not
 * finite. ebpo_mesh_unread tells what could not be read, and by how much floats differ
 * from the text of a PLY at most.
 *
 * Safe on untrusted files. They are read as a whole, into an array of `workspace`: one that
 * another program changes meanwhile is EBPO_E_IO.
 *
 * EBPO_E_IO, EBPO_E_MEMORY, EBPO_E_CANCELLED. EBPO_E_FORMAT: no mesh, or a damaged
 * one. EBPO_E_LIMIT: too large. EBPO_E_UNSUPPORTED: a dialect that is not read, such
 * as binary OFF. On failure `out` is cleared.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_read(const char *path,
                                                  const ebpo_mesh_read_options *options,
                                                  ebpo_mesh *out, ebpo_error *error);

/*
 * The vertices alone of a PLY file that is in memory, of every kind that
 * ebpo_mesh_read takes. There may be no faces, and they are not looked at.
 * Coordinates may be NaN or infinite. Safe on untrusted bytes.
 *
 * name    for messages
 * xyz     [*count][3] doubles, exact: floats and integers are widened. Text of a
 *         float that does not keep its digits is the nearest double. Freed by free().
 *         On failure NULL.
 *
 * EBPO_E_FORMAT, EBPO_E_LIMIT, EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_points_parse_ply(const void *data, uint64_t size,
                                                         const char *name, double **xyz,
                                                         uint64_t *count, ebpo_error *error);

/*
 * Writes a binary little-endian PLY, which appears whole or not at all: vertices
 * as floats or doubles, as the mesh holds them, triangles as int32 or uint32. With
 * attributes: properties in the order and of the types of the PLY that they were
 * read from, and its comments; the mesh must then be in the order of its source.
 *
 * EBPO_E_ARGUMENT: the mesh is not valid. EBPO_E_IO, EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_write_ply(const ebpo_mesh *mesh, const char *path,
                                                       ebpo_error *error);

/* ---- checking ---- */

#define EBPO_FINDING_PLACES 4

/*
 * How many there are of one kind of finding, and where the first ones are:
 * numbers in the source, from 0.
 */
typedef struct ebpo_finding {
    uint64_t count;

    /* The first min(count, EBPO_FINDING_PLACES), ascending. */
    uint64_t place[EBPO_FINDING_PLACES];
} ebpo_finding;

/*
 * What a mesh is. Edges are undirected pairs of distinct vertex numbers. The place
 * of an edge is the lowest face that uses it; a face with two such edges is there
 * twice.
 */
typedef struct ebpo_mesh_report {
    /*
     * Each edge is used as often in one direction as in the other. That is what
     * makes a winding number well defined, and the mesh a solid: a wider class
     * than the theses' closed 2-manifolds.
     */
    bool balanced;

    /* A closed 2-manifold, consistently oriented: EBP 2017, section 3.1. */
    bool manifold;

    /* Edges that are used once. */
    ebpo_finding boundary_edges;

    /* Edges that are used more than twice. */
    ebpo_finding nonmanifold_edges;

    /* Edges that are used twice, both times in one direction. */
    ebpo_finding misoriented_edges;

    /*
     * Edges whose directions do not cancel: all of the above, less those that
     * cancel.
     */
    ebpo_finding unbalanced_edges;

    /*
     * Vertices whose faces form more than one fan (a chain across edges used
     * twice). The ends of non-manifold edges are such vertices too.
     */
    ebpo_finding bowtie_vertices;

    /* By an exact test; index_repeated_faces are among them. */
    ebpo_finding zero_area_faces;

    /* Faces that name a vertex twice. */
    ebpo_finding index_repeated_faces;

    /*
     * Faces of the same three distinct vertices as an earlier face, in any
     * rotation and orientation.
     */
    ebpo_finding repeated_faces;

    ebpo_finding unreferenced_vertices;

    /* Vertices at the position of an earlier vertex. */
    ebpo_finding repeated_positions;

    uint64_t edges;

    /* Parts of the mesh that share no vertex; vertices without faces not counted. */
    uint64_t components;

    /* Holes: closed chains of boundary edges, split where they pass a vertex twice. */
    uint64_t boundary_loops;

    /* The sum of the components' genus is known of a closed 2-manifold only. */
    bool genus_known;
    int64_t genus;

    /* In the source's unit squared. */
    double area;

    /*
     * In its unit cubed, signed: the integral of the winding number, see
     * ebpo_solid_volume_of (query.h). 0 for a surface.
     */
    double volume;

    /* The mean length of edges as EBP 2017, equation 3, takes it. */
    double mean_edge;

    /* Of the vertices that faces name. */
    double min[3], max[3];
} ebpo_mesh_report;

/*
 * Checks a mesh, and counts what is found.
 *
 * threads   0: all cores. The result does not depend on it.
 *
 * EBPO_E_FORMAT: a coordinate is NaN or infinite, a face names a vertex that is
 * not there, or there are no faces; the message says where. EBPO_E_ARGUMENT: the
 * struct is not valid. EBPO_E_LIMIT, EBPO_E_CANCELLED, EBPO_E_IO, EBPO_E_MEMORY.
 *
 * Threads: any, while nobody changes the mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_check(const ebpo_mesh *mesh, unsigned threads,
                                                   ebpo_progress progress, ebpo_mesh_report *report,
                                                   ebpo_error *error);

/*
 * Puts vertices and faces in the order of a Morton curve, so that neighbours in
 * space are neighbours in memory. What is checked or built then goes through
 * memory in order, which also lets it be larger than memory. The mesh keeps the
 * numbers they had; reports and files tell those. Where it was not done,
 * ebpo_build does it.
 *
 * Errors are those of ebpo_mesh_check for the struct, coordinates and faces, and
 * EBPO_E_LIMIT for coordinates too large for an exact grid. On failure the mesh is
 * as it was.
 *
 * Threads: one per mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_arrange(ebpo_mesh *mesh, unsigned threads,
                                                     ebpo_progress progress, ebpo_error *error);

/* ---- mending ---- */

/* What mending has done. It is recorded in the file. */
typedef struct ebpo_mend_record {
    /* What was asked for. */
    bool weld, orient, fill_holes, drop_duplicates;

    /* Vertices removed because an earlier one has their position. */
    uint64_t welded_vertices;

    uint64_t flipped_faces;

    /* Parts that cannot be oriented, or whose faces around an edge cannot alternate. */
    uint64_t unorientable_components;

    uint64_t filled_holes;

    /* They stand at the end of the list. */
    uint64_t added_faces;

    /* Chains of boundary edges that are no simple loops. */
    uint64_t unfilled_holes;

    /* Faces removed because an earlier one has their vertices. */
    uint64_t dropped_faces;

    /* Of these, those that looked the other way than the one that stays. */
    uint64_t dropped_opposite;

    /*
     * The distance that ebpo_mesh_weld_within was given, and the largest one that it
     * moved a vertex by; 0: it was not called.
     */
    double weld_distance;
    double weld_moved;

    /* Faces that it left without area: they name a vertex twice. */
    uint64_t collapsed_faces;
} ebpo_mend_record;

/*
 * The six functions below add their counts to `record`, which begins with zeros
 * and may be NULL. They use all cores, and the result does not depend on how many.
 *
 * EBPO_E_FORMAT: a face names a vertex that is not there. EBPO_E_LIMIT: more than
 * 2^32 - 2 faces. EBPO_E_MEMORY, EBPO_E_IO. On failure the mesh is as it was.
 */

/*
 * Merges vertices of one position (-0 equals 0), also those that no face names.
 * The first of each group stays, and the order is kept. Faces that then name a
 * vertex twice stay.
 *
 * Threads: one per mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_weld(ebpo_mesh *mesh, ebpo_mend_record *record,
                                                  ebpo_error *error);

/*
 * Merges vertices of one position as ebpo_mesh_weld does, then others that are within
 * a distance. Positions are gone through ascending by x, then y, then z: one stays
 * unless one that stays is within the distance of it. Every other vertex becomes the
 * nearest of those that stay (of several at one distance, the first). Distances are
 * compared exactly.
 *
 * So no vertex moves farther than the distance, chains of near vertices do not drift,
 * no two that stay are within the distance of each other, and the result depends on
 * positions alone, not on the order of vertices. A vertex that stays keeps its
 * position, number and attributes. Faces that then name a vertex twice stay, and are
 * counted in `collapsed_faces`.
 *
 * distance   in the mesh's unit, above 0, and less than the longest side of the box
 *            around all vertices
 *
 * EBPO_E_ARGUMENT: another distance, also one below 2^-49 of that side.
 * On failure the mesh is valid, and vertices of one position may have been merged.
 *
 * Threads: one per mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_weld_within(ebpo_mesh *mesh, double distance,
                                                         ebpo_mend_record *record,
                                                         ebpo_error *error);

/*
 * Removes faces that repeat another one: of all faces of the same three distinct
 * vertices, in any rotation and orientation, the first of the source stays. Those
 * are the ones that are counted in `repeated_faces`. The order is kept, and faces
 * keep their numbers in the source.
 *
 * Of two faces of one orientation the second one counts winding numbers and volume
 * twice; of two that look opposite ways, as the sides of a sheet and walls between
 * solids do, they cancel, so that a mesh may balance with both and not with one.
 * Whether it is better off is for ebpo_mesh_check to tell, and ebpo_mesh_try_repairs
 * tries it; `dropped_opposite` counts such.
 *
 * Attributes of faces stay as they are: by numbers of the source.
 *
 * EBPO_E_ARGUMENT: a component (ebpo_components_mesh) with repeated faces.
 *
 * Threads: one per mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_drop_duplicates(ebpo_mesh *mesh,
                                                             ebpo_mend_record *record,
                                                             ebpo_error *error);

/*
 * Counts the faces that ebpo_mesh_drop_duplicates would remove if vertices at one
 * position were one: those at the three positions of an earlier face. Where a report
 * has no `repeated_positions`, these are its `repeated_faces`.
 *
 * threads    0: all cores. The result does not depend on it.
 * out        how many, and the first ones
 * opposite   of these, those that look the other way than the face that would stay
 *
 * Errors are those of ebpo_mesh_weld. On failure both are 0.
 *
 * Threads: any, while nobody changes the mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_count_repeated(const ebpo_mesh *mesh, unsigned threads,
                                                            ebpo_finding *out, uint64_t *opposite,
                                                            ebpo_error *error);

/*
 * Makes neighbouring faces agree across edges that are used twice, and shells look
 * outwards, or inwards where they bound a cavity.
 *
 * A shell is a set of faces that is closed by itself (each edge is used by it as often
 * in one direction as in the other): faces connected by edges that are used twice, as
 * each of two cubes that share a vertex or an edge; else such sets joined around edges
 * that are used oftener, where faces of alternating direction close them, as in stacked
 * cubes. The order around an edge is decided exactly; of faces in one plane it is that
 * of their numbers. What alternates already stays as it is.
 *
 * A shell is turned to have a positive volume, or a negative one if it is within an odd
 * number of others. It is within one if its least and greatest vertices along each axis
 * are, where the winding number is not zero, which is decided exactly. Open parts are
 * turned so that most of their faces stay as they were. A part that cannot be oriented
 * is left alone and counted; so is one whose faces around an edge cannot alternate,
 * which is then turned without regard to that edge. So do not orient a mesh in which
 * solids are meant to be within others.
 *
 * Threads: one per mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_orient(ebpo_mesh *mesh, ebpo_mend_record *record,
                                                    ebpo_error *error);

/*
 * Turns every face. Adds to `flipped_faces` of the record, and says nothing of
 * having been asked for.
 *
 * Threads: one per mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_flip(ebpo_mesh *mesh, ebpo_mend_record *record,
                                                  ebpo_error *error);

/*
 * Closes each boundary loop, as counted in boundary_loops, by triangles over its
 * own vertices, which are appended at the end. No vertices are added.
 *
 * Loops of up to 256 edges get the triangulation of least area that, where
 * possible, makes no edge the mesh has already. Longer ones are closed ear by ear.
 * Chains that do not close, because orientations do not agree (ebpo_mesh_orient),
 * stay and are counted.
 *
 * Threads: one per mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_fill_holes(ebpo_mesh *mesh, ebpo_mend_record *record,
                                                        ebpo_error *error);

/* ---- all of it in one call ---- */

typedef struct ebpo_prepare_options {
    size_t struct_size; /* EBPO_PREPARE_OPTIONS_INIT sets it */

    /*
     * ebpo_mesh_weld, ebpo_mesh_drop_duplicates, ebpo_mesh_orient, ebpo_mesh_flip,
     * ebpo_mesh_fill_holes, in this order; where holes were filled, closed components are oriented
     * once more. STL is always welded, as its faces share no vertices.
     */
    bool weld;
    bool orient;
    bool fill_holes;

    /* 0: all cores. The result does not depend on it. */
    unsigned threads;

    ebpo_progress progress;

    /* 1: ebpo_mesh_flip too. */
    uint64_t flip;

    /* 1: ebpo_mesh_drop_duplicates too. */
    uint64_t drop_duplicates;

    /* Above 0: ebpo_mesh_weld_within this distance, in place of ebpo_mesh_weld. */
    double weld_distance;
} ebpo_prepare_options;

#define EBPO_PREPARE_OPTIONS_INIT                                                     \
    {                                                                                 \
        sizeof(ebpo_prepare_options), false, false, false, 0, { NULL, NULL }, 0, 0, 0 \
    }

typedef struct ebpo_prepared {
    size_t struct_size; /* EBPO_PREPARED_INIT sets it */

    /* Something was mended: the two reports may differ. */
    bool mended;

    /* What was mended. */
    ebpo_mend_record record;

    /* Of the mesh as it was given, and as it is now (for ebpo_build). */
    ebpo_mesh_report before;
    ebpo_mesh_report report;
} ebpo_prepared;

#define EBPO_PREPARED_INIT EBPO_SIZED(ebpo_prepared)

/*
 * Makes a mesh ready for ebpo_build: arranges it, mends it as asked, and checks it
 * before and after. Single calls give the same mesh and the same reports, but may
 * need more memory. A mesh too large for an exact grid is checked as well;
 * ebpo_build refuses it.
 *
 * Errors are those of the single calls. On failure `out` is cleared, and the mesh
 * is valid, with the steps that were done.
 *
 * Threads: one per mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_prepare(ebpo_mesh *mesh,
                                                     const ebpo_prepare_options *options,
                                                     ebpo_prepared *out, ebpo_error *error);

/* ---- components ---- */

/*
 * Faces that share vertices are a component. Of those, one that is closed (each
 * edge is used as often in one direction as in the other) and has a negative
 * volume is a cavity: it is put to the closed one of positive volume that has its
 * first vertex (of its first face in the source) inside, where the winding number
 * is not zero, which is decided exactly; of several, to the one of least volume. A
 * cavity in none of them, and what is open, stands alone.
 */
typedef struct ebpo_components ebpo_components;

typedef struct ebpo_component {
    size_t struct_size; /* EBPO_COMPONENT_INIT sets it */

    uint64_t vertex_count;
    uint64_t face_count;

    /* Least number of its faces in the source. */
    uint64_t first_face;

    bool closed;

    /* Those that were put to it. */
    uint64_t cavities;
} ebpo_component;

#define EBPO_COMPONENT_INIT EBPO_SIZED(ebpo_component)

/*
 * Finds them. They are in the order of their first faces in the source. Vertices
 * that no face names belong to none.
 *
 * mesh      borrowed until ebpo_components_free; it may not change
 * threads   0: all cores. The result does not depend on it.
 * out       freed by ebpo_components_free. On failure NULL.
 *
 * EBPO_E_FORMAT: no faces, or one names a vertex that is not there.
 * EBPO_E_ARGUMENT: the struct is not valid. EBPO_E_LIMIT, EBPO_E_CANCELLED,
 * EBPO_E_IO, EBPO_E_MEMORY.
 *
 * Threads: any, while nobody changes the mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_components_new(const ebpo_mesh *mesh, unsigned threads,
                                                       ebpo_progress progress,
                                                       ebpo_components **out, ebpo_error *error);

/*
 * NULL is fine.
 *
 * Threads: one per object.
 */
EBPO_API void ebpo_components_free(ebpo_components *components);

/*
 * How many; 0 for NULL.
 *
 * Threads: any.
 */
EBPO_API uint64_t ebpo_components_count(const ebpo_components *components);

/*
 * One of them, from 0.
 *
 * EBPO_E_ARGUMENT: there is none of that number, or `out` has no size.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_components_get(const ebpo_components *components,
                                                       uint64_t number, ebpo_component *out,
                                                       ebpo_error *error);

/*
 * One of them as a mesh, which keeps the numbers of the source: reports and files
 * made of it tell those of the whole. It is in the whole mesh's workspace. Mend
 * the whole mesh before: ebpo_mesh_weld, ebpo_mesh_drop_duplicates
 * and ebpo_mesh_fill_holes refuse a component in which they have something to do.
 *
 * out   freed by ebpo_mesh_free. On failure it is cleared.
 *
 * EBPO_E_ARGUMENT: there is none of that number. EBPO_E_IO, EBPO_E_MEMORY.
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
