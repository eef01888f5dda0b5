/* Finds patches: sets of connected faces. */
#ifndef EBPO_COLLIDE_FACE_PATCHES_H
#define EBPO_COLLIDE_FACE_PATCHES_H

#include <stdbool.h>
#include <stdint.h>

#include "geometry/pose.h"
#include "query/accel.h"

/* A table that gives each corner an index; corners with equal coordinates have the same index (0
 * and -0 are equal). An empty table is zero. */
typedef struct ebpo_corner_ids {
    double (*at)[3]; /* [count] coordinates of each corner */
    uint64_t count, capacity;
    uint32_t *table; /* [table_size] hash table: a corner's index + 1; 0: free */
    uint64_t table_size;
} ebpo_corner_ids;

/* Finds or adds the corner x, and sets *id to its index. Returns false if memory is short or if the
 * table has 2^32 - 2 corners. */
bool ebpo_corner_id(ebpo_corner_ids *ids, const double x[3], uint32_t *id);
/* Makes the table large enough for `count` corners; this only saves time. Returns false if memory
 * is short. */
bool ebpo_corner_ids_reserve(ebpo_corner_ids *ids, uint64_t count);
void ebpo_corner_ids_free(ebpo_corner_ids *ids);

/* Finds the patches of the faces that a subtree owns (a subtree owns a face if no earlier subtree
 * lists the face). Faces of a patch are connected by corners with equal coordinates. Owned face i
 * has the index subtree->first_face + i in the file. (*out)[i] is the number of the first owned
 * face in the patch of owned face i. `omitted` has a bit for each face of the file. A face whose
 * bit is set is a separate patch and connects no other faces. slots: result of ebpo_face_slots. The
 * caller frees the result. */
EBPO_MUST_USE ebpo_status ebpo_face_patches(const ebpo_accel *subtree, const uint32_t *slots,
                                            const uint64_t *omitted, uint32_t **out,
                                            ebpo_error *error);

/* Finds the patches of a whole model at a pose. Faces of a patch are connected by edges (pairs of
 * equal posed corners) that exactly two faces with an area share. (*out)[i] is the least index of a
 * face in the patch of face i; all indices are indices in the file. A face without area is a
 * separate patch. slots: result of ebpo_face_slots. The caller frees the result. */
EBPO_MUST_USE ebpo_status ebpo_edge_patches(const ebpo_accel *whole, const uint32_t *slots,
                                            const ebpo_posing *posing, uint32_t **out,
                                            ebpo_error *error);

#endif
