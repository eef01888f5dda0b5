/* Cuts one face along its intersections with other faces. For one thread. */
#ifndef EBPO_BOOLEAN_FACE_CUT_H
#define EBPO_BOOLEAN_FACE_CUT_H

#include "extras/boolean/face_list.h"
#include "extras/boolean/plane_arrangement.h"
#include "extras/boolean/plane_triangulation.h"

/* States that a triangle is covered: another face in the same plane contains the triangle. */
typedef struct ebpo_cover {
    uint32_t triangle;
    uint32_t face; /* the other face, listed (face_list.h) */
    bool opposite; /* the normals of both faces are opposite */
} ebpo_cover;

/* The triangles of a face, oriented as the face. A triangle that is covered by a face with a lower
 * index is omitted. */
typedef struct ebpo_face_pieces {
    ebpo_exact_point *point;
    uint32_t points;
    uint32_t (*triangle)[3]; /* corners as indices of points */
    uint32_t triangles;
    ebpo_cover *cover; /* sorted by triangle */
    uint32_t covers;
} ebpo_face_pieces;

void ebpo_face_pieces_free(ebpo_face_pieces *pieces);

/* Scratch memory for cutting one face after the other. */
typedef struct ebpo_face_cutter {
    const ebpo_face_list *faces;
    int unit;        /* coordinates are multiples of 2^unit */
    uint32_t face;   /* the face that is cut */
    int axis;        /* the face is seen against this axis (exact_point.h) */
    int orientation; /* the face is seen counter-clockwise: 1, clockwise: -1 */
    ebpo_arrangement_2d arrangement;
    ebpo_triangulation triangulation;
    ebpo_exact_point corner[2][3]; /* corners of the face, and of the other face of a pair */
    ebpo_exact_plane plane[2];     /* planes of both faces */
    ebpo_exact_point end[2][2];    /* [face of the pair] ends of the segment in which the face
                                      intersects the other face's plane */
    ebpo_exact_point copy;         /* used by add_point */
    uint32_t *coplanar;            /* other faces in the plane of the face */
    uint64_t coplanar_count, coplanar_capacity;
    uint32_t *kept; /* for each triangle of the triangulation: 0: omitted; else its index in the
                     * result + 1 */
    uint64_t kept_capacity;
    ebpo_cover *cover;
    uint64_t covers, cover_capacity;
    struct ebpo_triangle_box *box; /* boxes of the triangles, sorted by low[0] */
    uint64_t box_capacity;
} ebpo_face_cutter;

/* Makes an empty cutter. unit: all coordinates of faces with partners (face_list.h) are multiples
 * of 2^unit. */
void ebpo_face_cutter_init(ebpo_face_cutter *cutter, const ebpo_face_list *faces, int unit);
void ebpo_face_cutter_free(ebpo_face_cutter *cutter);

/* Cuts a face along its intersections with its partners, the faces that it intersects. Returns
 * false without memory. */
bool ebpo_face_cut(ebpo_face_cutter *cutter, uint32_t face, ebpo_face_pieces *out);

#endif
