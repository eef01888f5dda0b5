#include "core/strict_fp.h"

#include "extras/collide/face_patches.h"

#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "extras/collide/corner_ids.h"
#include "extras/collide/joined_faces.h"

typedef struct joining {
    ebpo_corner_ids corners;
    uint32_t *user; /* of each corner: a face that has it */
    uint64_t users;
} joining;

static bool join_face(joining *j, uint32_t *patch, uint32_t face, const double t[3][3])
{
    for (int i = 0; i < 3; i++) {
        uint32_t id;
        uint64_t known = j->corners.count;
        if (!ebpo_corner_id(&j->corners, t[i], &id) ||
            !ebpo_grow(&j->user, &j->users, j->corners.count, sizeof *j->user))
            return false;
        if (id < known)
            ebpo_join_faces(patch, j->user[id], face);
        else
            j->user[id] = face;
    }
    return true;
}

ebpo_status ebpo_face_patches(const ebpo_accel *subtree, const uint32_t *slots,
                              const uint64_t *left_out, uint32_t **out, ebpo_error *error)
{
    joining j = { 0 };
    uint32_t count = subtree->face_count - subtree->outer_count;
    uint32_t *patch = ebpo_alloc(count, sizeof *patch);
    bool fine = patch != NULL;
    for (uint32_t f = 0; f < count && fine; f++)
        patch[f] = f;
    for (uint32_t f = 0; f < count && fine; f++) {
        double t[3][3];
        uint64_t number = subtree->first_face + f;
        if (left_out[number / 64] >> number % 64 & 1)
            continue;
        ebpo_accel_triangle(subtree, slots[subtree->outer_count + f], t);
        fine = join_face(&j, patch, f, (const double(*)[3])t);
    }
    for (uint32_t f = 0; f < count && fine; f++)
        patch[f] = ebpo_joined_first(patch, f);
    ebpo_corner_ids_free(&j.corners);
    free(j.user);
    if (!fine) {
        free(patch);
        return ebpo_fail_memory(error, count * sizeof *patch);
    }
    *out = patch;
    return EBPO_OK;
}
