/* SPDX-License-Identifier: MIT
 * Locates the findings of a mesh check.
 *
 *   ebpo_mesh_findings    all findings, and their picture as a coloured PLY file
 *   ebpo_finding_name     name of a kind
 *   ebpo_finding_colour   colour of a kind in the picture
 */
#ifndef EBPO_FINDINGS_H
#define EBPO_FINDINGS_H

#include <ebpo/mesh.h>

#ifdef __cplusplus
extern "C" {
#endif

/*
 * Kinds of findings, as ebpo_mesh_report counts them. If a face has findings of several kinds, the
 * picture shows the first kind.
 */
typedef enum ebpo_finding_kind {
    EBPO_FOUND_BOUNDARY_EDGE,
    EBPO_FOUND_NONMANIFOLD_EDGE,
    EBPO_FOUND_MISORIENTED_EDGE,
    EBPO_FOUND_UNBALANCED_EDGE,
    EBPO_FOUND_REPEATED_FACE,
    EBPO_FOUND_INDEX_REPEATED_FACE,
    EBPO_FOUND_ZERO_AREA_FACE,
    EBPO_FOUND_BOWTIE_VERTEX,
    EBPO_FOUND_REPEATED_POSITION,
    EBPO_FOUND_UNREFERENCED_VERTEX
} ebpo_finding_kind;

/* Number of kinds. */
#define EBPO_FINDING_KINDS 10

/*
 * Returns the name of the member of ebpo_mesh_report that counts findings of a kind, such as
 * "boundary_edges". Returns NULL if the kind is not valid.
 *
 * Threads: any.
 */
EBPO_API const char *ebpo_finding_name(int32_t kind);

/*
 * Gets the colour of a kind in the picture: red, green and blue, 0 to 255 each. An invalid kind
 * gets grey.
 *
 * Threads: any.
 */
EBPO_API void ebpo_finding_colour(int32_t kind, uint8_t rgb[3]);

/* Value of `component` of ebpo_mesh_finding for an unreferenced vertex. */
#define EBPO_NO_COMPONENT UINT32_MAX

/* One finding. Indices are those of the source. */
typedef struct ebpo_mesh_finding {
    /* ebpo_finding_kind */
    int32_t kind;

    /*
     * Index of the component, which is a set of faces that are connected by vertices. Components
     * are in the order of their lowest face indices. EBPO_NO_COMPONENT: the vertex is unreferenced.
     */
    uint32_t component;

    /*
     * For an edge: its ends, the lower index first. For a vertex: its index, twice. For a face: its
     * first two corners.
     */
    uint64_t vertex[2];

    /*
     * [face_count] indices of faces, ascending; valid until the callback returns. For an edge or a
     * vertex: all faces that use the edge or vertex (NULL if there are none). For a repeated face:
     * this face, and the first face with the same vertices. For any other face: this face.
     */
    const uint64_t *faces;
    uint64_t face_count;

    /*
     * Middle of the edge, position of the vertex, or mean of the face's corners; rounded. In the
     * unit of the mesh.
     */
    double point[3];
} ebpo_mesh_finding;

/* Callback that gets a finding. The callback returns false to stop the call. */
typedef bool (*ebpo_findings_fn)(void *user, const ebpo_mesh_finding *finding);

/* Options of ebpo_mesh_findings. */
typedef struct ebpo_findings_options {
    size_t struct_size;

    unsigned threads;

    ebpo_progress progress;

    /*
     * Binary PLY file to write, which is replaced atomically; NULL: no file. The file contains the
     * mesh in the source's order, except faces that a repair dropped. Coordinates are doubles. A
     * face with findings has the colour of its kind; all other faces are grey (200, 200, 200).
     * Comments in the file explain the colours. Vertices have no colours, because most programs
     * would show the colours of vertices and not those of faces.
     */
    const char *ply;
} ebpo_findings_options;

#define EBPO_FINDINGS_OPTIONS_INIT                             \
    {                                                          \
        sizeof(ebpo_findings_options), 0, { NULL, NULL }, NULL \
    }

/*
 * Checks a mesh as ebpo_mesh_check does, and passes every counted finding to `take`. Findings are
 * sorted by kind, then by the lowest face, then by the vertices. The function takes memory from the
 * mesh's workspace: as much as ebpo_mesh_check, plus about 80 bytes per finding during sorting and
 * 16 bytes per finding afterwards. With `ply`, it takes at most 13 bytes more for each face and for
 * each vertex.
 *
 * take     may be NULL. Even if `take` returns false, the file `ply` is complete
 * report   receives the result of ebpo_mesh_check; may be NULL
 *
 * Errors are those of ebpo_mesh_check. EBPO_E_IO: also if `ply` cannot be written.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_findings(const ebpo_mesh *mesh,
                                                      const ebpo_findings_options *options,
                                                      ebpo_findings_fn take, void *user,
                                                      ebpo_mesh_report *report, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
