/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: where a mesh has what checking it finds.
 *
 *   ebpo_mesh_places        all places, and a picture of them as a coloured PLY
 *   ebpo_finding_name       what a kind is called
 *   ebpo_finding_colour     and its colour in the picture
 */
#ifndef EBPO_PLACES_H
#define EBPO_PLACES_H

#include <ebpo/mesh.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Kinds of findings, as ebpo_mesh_report counts them. Where a face has several, the
 * picture shows the one that stands first here. */
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

#define EBPO_FINDING_KINDS 10

/*
 * The name of the report's member, such as "boundary_edges". NULL: there is no such kind.
 *
 * Threads: any.
 */
EBPO_API const char *ebpo_finding_name(int32_t kind);

/*
 * Red, green, blue, 0 to 255 each; grey for a number that is no kind.
 *
 * Threads: any.
 */
EBPO_API void ebpo_finding_colour(int32_t kind, uint8_t rgb[3]);

#define EBPO_NO_COMPONENT UINT32_MAX

/* One place. Numbers are those of the source, from 0. */
typedef struct ebpo_mesh_place {
    /* An ebpo_finding_kind. */
    int32_t kind;

    /* Faces that share vertices are a component; they are numbered by their lowest faces.
     * EBPO_NO_COMPONENT: no face names the vertex. */
    uint32_t component;

    /* The ends of an edge, the lower number first; of a vertex its number, twice; of a face its
     * first two corners. */
    uint64_t vertex[2];

    /* All faces that use the edge or the vertex; of a repeated face it and the first one of its
     * vertices; of another face that one. Ascending, lent until the callback returns. NULL:
     * none. */
    const uint64_t *faces;
    uint64_t face_count;

    /* The middle of the edge, the vertex, or the mean of the face's corners, rounded. */
    double point[3];
} ebpo_mesh_place;

/* False: enough. */
typedef bool (*ebpo_places_fn)(void *user, const ebpo_mesh_place *place);

typedef struct ebpo_places_options {
    size_t struct_size; /* EBPO_PLACES_OPTIONS_INIT sets it */

    /* 0: all cores. The result does not depend on it. */
    unsigned threads;

    ebpo_progress progress;

    /*
     * A binary PLY file to write, which appears whole or not at all: the mesh in the source's
     * order, but for faces that were dropped; positions as doubles; faces of places in the colours
     * of their kinds, all else grey (200, 200, 200). Its comments are the legend. Vertices have no
     * colours, as most programs would show these instead. NULL: none.
     */
    const char *ply;
} ebpo_places_options;

#define EBPO_PLACES_OPTIONS_INIT                             \
    {                                                        \
        sizeof(ebpo_places_options), 0, { NULL, NULL }, NULL \
    }

/*
 * Checks a mesh as ebpo_mesh_check does, and hands out every place that it counts: kind by kind,
 * within a kind by the lowest face, then by the vertices. Takes some 80 bytes a place of
 * the mesh's workspace while they are sorted, and 16 afterwards, beside what checking
 * takes; with `ply` at most 13 bytes of it for each face and vertex.
 *
 * take     NULL: nothing is handed out. When it returns false it is not called again, and the call
 *          succeeds; `ply` is whole nevertheless
 * report   what ebpo_mesh_check gives. NULL: not wanted
 *
 * EBPO_E_ARGUMENT: `options`. The errors of ebpo_mesh_check. EBPO_E_IO: `ply` cannot be written.
 *
 * Threads: any, while nobody changes the mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_places(const ebpo_mesh *mesh,
                                                    const ebpo_places_options *options,
                                                    ebpo_places_fn take, void *user,
                                                    ebpo_mesh_report *report, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
