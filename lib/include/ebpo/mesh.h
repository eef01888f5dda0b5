/* EBP-Octree in HDF5: triangle meshes, reading, checking and mending them. */
#ifndef EBPO_MESH_H
#define EBPO_MESH_H

#include <ebpo/workspace.h>

#ifdef __cplusplus
extern "C" {
#endif

/* An indexed triangle mesh. Plain data: fields may be read, and set by callers who build one
 * themselves (allocate the arrays with malloc, free with ebpo_mesh_free). At most 2^32 - 2 vertices
 * and 2^32 - 2 faces. */
typedef struct ebpo_mesh {
    uint64_t vertex_count;
    uint64_t face_count;
    float *xyz32; /* [vertex_count][3], or NULL when the source holds doubles */
    /* [vertex_count][3], or NULL when the source holds floats; exactly one of the two is set */
    double *xyz64;
    uint32_t *faces; /* [face_count][3], vertex indices, counter-clockwise seen from outside */
    uint64_t polygons_triangulated; /* source faces with more than three corners */
    uint64_t polygons_concave;      /* of these, how many were concave (cut by ears) */
    uint64_t strips;                /* triangle strips unrolled */
    uint64_t polygons_dropped;      /* source faces with fewer than three corners, left out */
    char source_name[256];          /* file name without folders, "" if not from a file */
    uint8_t source_sha256[32];      /* of the source file's bytes; zero if not from a file */
    uint64_t source_size;           /* bytes */
    char source_format[16];         /* "ply-ascii", "ply-le", "ply-be", "obj", "stl", "off", "" */
    /* set by ebpo_mesh_arrange; NULL: in the source's order */
    struct ebpo_arrangement *arrangement;
    /* what checking and building may use; NULL: as much memory as they like. Its arrays may be in
     * it, or malloc's */
    ebpo_workspace *workspace;
} ebpo_mesh;

/* Frees the arrays and clears the struct. NULL is fine. */
EBPO_API void ebpo_mesh_free(ebpo_mesh *mesh);

typedef struct ebpo_mesh_read_options {
    size_t struct_size; /* EBPO_MESH_READ_OPTIONS_INIT sets it */
    unsigned threads;   /* 0: all cores; the result does not depend on it */
    ebpo_progress progress;
    /* the mesh keeps to it, and so does what is done with it; freed after the last of that. NULL:
     * none */
    ebpo_workspace *workspace;
} ebpo_mesh_read_options;
#define EBPO_MESH_READ_OPTIONS_INIT                             \
    {                                                           \
        sizeof(ebpo_mesh_read_options), 0, { NULL, NULL }, NULL \
    }

/* Reads a mesh; the format is told from the file's first bytes, then from its name.
 * PLY always; OBJ, STL and OFF when the library was built with assimp (else EBPO_E_UNSUPPORTED).
 * Polygons are triangulated, concave ones correctly; strips are unrolled. PLY positions keep every
 * bit and text is rounded correctly; assimp gives single precision, and for text now and then a
 * neighbour of the nearest float (lib/import/import.h has the figures). PLY is safe on untrusted
 * files. On failure `out` is cleared. `options` may be NULL. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_read(const char *path,
                                                  const ebpo_mesh_read_options *options,
                                                  ebpo_mesh *out, ebpo_error *error);

/* The vertices alone of a PLY file that is in memory, as doubles [*count][3] (exact: floats and
 * integers are widened), to be freed with free(). Every dialect that ebpo_mesh_read takes; faces
 * may be absent and are not looked at. Coordinates may be NaN or infinite. `name` is for messages.
 * Safe on untrusted bytes. On failure *xyz is NULL. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_points_parse_ply(const void *data, uint64_t size,
                                                         const char *name, double **xyz,
                                                         uint64_t *count, ebpo_error *error);

/* Writes a binary little-endian PLY: float or double vertices as the mesh holds them, int32 or
 * uint32 triangles. Appears whole or not at all (temporary name, fsync, rename). */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_write_ply(const ebpo_mesh *mesh, const char *path,
                                                       ebpo_error *error);

/* How many of one kind of finding, and where the first ones are (source numbers, from 0). */
#define EBPO_FINDING_PLACES 4
typedef struct ebpo_finding {
    uint64_t count;
    uint64_t place[EBPO_FINDING_PLACES]; /* the first min(count, 4), ascending */
} ebpo_finding;

/* What a mesh is. Edges are undirected pairs of distinct vertex indices. The place of an edge
 * finding is the lowest face that uses the edge (a face with two such edges is there twice).
 * Balanced: each edge is used as often in one direction as in the other; that is what makes a
 * winding number well defined (the solid), a wider class than the theses' closed 2-manifolds. */
typedef struct ebpo_mesh_report {
    bool balanced;
    /* closed 2-manifold, consistently oriented: EBP 2017, section 3.1 */
    bool manifold;
    ebpo_finding boundary_edges;    /* used once */
    ebpo_finding nonmanifold_edges; /* used more than twice */
    ebpo_finding misoriented_edges; /* used twice, both times in one direction */
    /* directions do not cancel (the union of the causes above, less what cancels) */
    ebpo_finding unbalanced_edges;
    /* faces around the vertex form more than one fan (chain across edges used twice); so the ends
     * of non-manifold edges count as well; place: vertex */
    ebpo_finding bowtie_vertices;
    ebpo_finding zero_area_faces;      /* exact test; includes index_repeated_faces */
    ebpo_finding index_repeated_faces; /* a face that names a vertex twice */
    /* same three distinct vertices as an earlier face, any rotation or orientation */
    ebpo_finding repeated_faces;
    ebpo_finding unreferenced_vertices;
    ebpo_finding repeated_positions; /* same position as an earlier vertex */
    uint64_t edges;
    uint64_t components; /* connected by shared vertices, faces only */
    /* holes: closed chains of boundary edges, split where they pass a vertex twice */
    uint64_t boundary_loops;
    bool genus_known; /* closed 2-manifold only */
    int64_t genus;    /* summed over the components */
    double area;
    double volume;         /* signed, integral of the winding number; 0 for a surface */
    double mean_edge;      /* EBP 2017, equation 3 */
    double min[3], max[3]; /* of referenced vertices */
} ebpo_mesh_report;

/* Checks a mesh. A NaN or infinite coordinate, an index out of range or a mesh without faces is
 * EBPO_E_FORMAT and named with its place; everything else is counted in the report. `threads` 0:
 * all cores. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_check(const ebpo_mesh *mesh, unsigned threads,
                                                   ebpo_progress progress, ebpo_mesh_report *report,
                                                   ebpo_error *error);

/* Puts vertices and faces in the order of a Morton curve, so that neighbours in space are
 * neighbours in memory: what is checked or built then goes through memory in order, which also lets
 * it be larger than memory. The mesh keeps what numbers they had; reports and files tell those.
 * ebpo_build does it itself where it was not done. Needs what ebpo_mesh_check needs, and has its
 * errors for coordinates and indices. `threads` 0: all cores; the result does not depend on it. On
 * failure the mesh is as it was. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_arrange(ebpo_mesh *mesh, unsigned threads,
                                                     ebpo_progress progress, ebpo_error *error);

/* What mending did; recorded in the file. */
typedef struct ebpo_mend_record {
    bool weld, orient, fill_holes; /* what was asked for */
    uint64_t welded_vertices;      /* removed because their position repeats an earlier one */
    uint64_t flipped_faces;
    uint64_t unorientable_components; /* left as they were */
    uint64_t filled_holes;
    uint64_t added_faces;    /* at the end of the face list */
    uint64_t unfilled_holes; /* boundary chains that are not simple loops */
} ebpo_mend_record;

/* The three functions add their counts to `record` (start from a zeroed one; it may be NULL). An
 * index out of range is EBPO_E_FORMAT. On failure the mesh is as it was. They use all cores;
 * results do not depend on how many. */

/* Merges vertices with identical positions (-0 equals 0), also unreferenced ones; the first of each
 * group stays, order is kept. Faces that then name a vertex twice stay. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_weld(ebpo_mesh *mesh, ebpo_mend_record *record,
                                                  ebpo_error *error);
/* Makes neighbouring faces agree, component by component (across edges used twice). A component
 * that already is consistent is left alone, also one with negative volume: that may be a cavity.
 * Another one is turned so that its signed volume is positive if it is closed (each of its edges
 * used twice), and so that the majority of its faces stays as it was if it is open. Non-orientable
 * components stay untouched and are counted. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_orient(ebpo_mesh *mesh, ebpo_mend_record *record,
                                                    ebpo_error *error);
/* Closes each boundary loop (as counted in boundary_loops) with triangles over its own vertices,
 * appended at the end; no vertices are added. Up to 256 edges: the triangulation of least area
 * that, where possible, makes no edge the mesh has already; beyond that, ear by ear. Chains that do
 * not close (orientations that do not agree: see ebpo_mesh_orient) stay and are counted. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_fill_holes(ebpo_mesh *mesh, ebpo_mend_record *record,
                                                        ebpo_error *error);

/* What is done to a mesh before it is built or judged. */
typedef struct ebpo_prepare_options {
    size_t struct_size; /* EBPO_PREPARE_OPTIONS_INIT sets it */
    bool weld;          /* ebpo_mesh_weld; done to every STL, whose faces share no vertices */
    bool orient;        /* then ebpo_mesh_orient */
    bool fill_holes;    /* then ebpo_mesh_fill_holes */
    unsigned threads;   /* 0: all cores; the result does not depend on it */
    ebpo_progress progress;
} ebpo_prepare_options;
#define EBPO_PREPARE_OPTIONS_INIT                                            \
    {                                                                        \
        sizeof(ebpo_prepare_options), false, false, false, 0, { NULL, NULL } \
    }

typedef struct ebpo_prepared {
    size_t struct_size;      /* EBPO_PREPARED_INIT sets it */
    bool mended;             /* a mending step ran: the two reports may differ */
    ebpo_mend_record record; /* what it did */
    ebpo_mesh_report before; /* of the mesh as it was given */
    ebpo_mesh_report report; /* of the mesh as it is now; for ebpo_build */
} ebpo_prepared;
#define EBPO_PREPARED_INIT EBPO_SIZED(ebpo_prepared)

/* Makes a mesh ready for ebpo_build, in one call: arranges it, mends it as asked, in the order
 * weld, orient, fill holes, and checks it before and after. All steps keep to the mesh's workspace;
 * mending and checking by single calls gives the same mesh and the same reports, but may need more
 * memory. A mesh too large for an exact grid is checked, too; ebpo_build refuses it.
 *
 * `options` may be NULL: no mending but that of STL. The mesh stays the caller's. Errors are those
 * of ebpo_mesh_check and the mending functions, and EBPO_E_CANCELLED; `out` is cleared then, and
 * the mesh is valid, with the steps that were done. Any thread; one call at a time for one mesh. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_prepare(ebpo_mesh *mesh,
                                                     const ebpo_prepare_options *options,
                                                     ebpo_prepared *out, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
