/* The faces in a box, with a tree of boxes over them: what a tick works on. Made by the loading
 * thread, never changed while a tick has it. */
#ifndef EBPO_HAPTIC_FACE_BOX_H
#define EBPO_HAPTIC_FACE_BOX_H

#include <ebpo/query.h>

enum { EBPO_FACE_BOX_LEAF = 8 };

typedef struct ebpo_extent {
    double min[3], max[3];
} ebpo_extent;

static inline bool ebpo_extent_holds(const ebpo_extent *e, const double p[3])
{
    for (int i = 0; i < 3; i++)
        if (!(p[i] >= e->min[i] && p[i] <= e->max[i]))
            return false;
    return true;
}

typedef struct ebpo_face_box {
    /* Of every ball whose centre is in it, all faces within the margin are there. */
    ebpo_extent centres;
    ebpo_extent loaded;               /* all faces that meet it are there */
    uint64_t count, capacity, leaves; /* leaves: a power of two */
    double (*corner)[3][3];           /* [capacity] */
    uint64_t *face;                   /* [capacity] as callers are told */
    ebpo_extent *node;                /* [2 leaves] the root is 1, children of n are 2 n, 2 n + 1 */
} ebpo_face_box;

EBPO_MUST_USE ebpo_status ebpo_face_box_new(ebpo_face_box *out, uint64_t capacity,
                                            ebpo_error *error);
void ebpo_face_box_free(ebpo_face_box *box);
uint64_t ebpo_face_box_bytes(uint64_t capacity);
uint64_t ebpo_face_box_leaves(uint64_t capacity); /* of its tree, at most */

/* Loads what is within `margin` of the centres. *fits is false if that is more than there is room
 * for. The order of faces is the file's, along a curve: so the tree needs no sorting. */
EBPO_MUST_USE ebpo_status ebpo_face_box_load(ebpo_face_box *box, ebpo_context *context,
                                             const ebpo_extent *centres, double margin, bool *fits,
                                             ebpo_error *error);

/* Faces whose boxes meet `around`, into found[most]; false: there are more, or more than *visits
 * nodes would have to be looked at, which is less by those that were. */
bool ebpo_face_box_find(const ebpo_face_box *box, const ebpo_extent *around, uint32_t *found,
                        uint32_t most, uint32_t *visits, uint32_t *count);

/* Of what is in `around`, no point is closer to a face of the box than this; after so many nodes it
 * says less. *visits counts them. */
double ebpo_face_box_clearance(const ebpo_face_box *box, const ebpo_extent *around,
                               uint32_t most_visits, uint64_t *visits);

#endif
