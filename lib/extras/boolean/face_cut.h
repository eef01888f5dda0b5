/* Cuts one face along its intersections with other faces. For one thread. */
#ifndef EBPO_BOOLEAN_FACE_CUT_H
#define EBPO_BOOLEAN_FACE_CUT_H

#include "extras/boolean/face_list.h"
#include "extras/boolean/plane_arrangement.h"
#include "extras/boolean/plane_triangulation.h"

/* Another face in the same plane that covers a triangle. */
typedef struct ebpo_cover {
    uint32_t triangle;
    uint32_t face;
    bool opposite; /* the normals are opposite */
} ebpo_cover;

/* The triangles of a face, oriented as the face. Triangles that a face with a lower number covers
 * are omitted. */
typedef struct ebpo_face_pieces {
    ebpo_exact_point *point;
    uint32_t points;
    uint32_t (*triangle)[3]; /* corners as numbers of points */
    uint32_t triangles;
    ebpo_cover *cover; /* sorted by triangle */
    uint32_t covers;
} ebpo_face_pieces;

void ebpo_face_pieces_free(ebpo_face_pieces *pieces);

/* Scratch memory. */
typedef struct ebpo_face_cutter {
    const ebpo_face_list *faces;
    int unit;
    uint32_t face;
    int axis;        /* the face is seen against this axis */
    int orientation; /* 1: it is counter-clockwise */
    ebpo_arrangement_2d arrangement;
    ebpo_triangulation triangulation;
    ebpo_exact_point corner[2][3]; /* of the face, and of the other face */
    ebpo_exact_plane plane[2];     /* of both */
    ebpo_exact_point end[2][2],
        meeting;        /* ends of the segments where each is in the other's plane */
    uint32_t *coplanar; /* other faces in the plane of the face */
    uint64_t coplanar_count, coplanar_capacity;
    uint32_t *kept; /* triangles of the triangulation that are not omitted, as their numbers + 1 */
    uint64_t kept_capacity;
    ebpo_cover *cover;
    uint64_t covers, cover_capacity;
    bool *within; /* for each point: it is in the coplanar face */
    uint64_t within_capacity;
} ebpo_face_cutter;

/* unit: all coordinates of the faces with partners are multiples of 2^unit. */
void ebpo_face_cutter_init(ebpo_face_cutter *cutter, const ebpo_face_list *faces, int unit);
void ebpo_face_cutter_free(ebpo_face_cutter *cutter);

/* Cuts a face along its intersections with its partners. Returns false without memory. */
bool ebpo_face_cut(ebpo_face_cutter *cutter, uint32_t face, ebpo_face_pieces *out);

#endif
