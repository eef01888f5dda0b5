/* Contact segments of all crossing pairs, in the order of pairs. */
#include "geom/strict_fp.h"

#include "collide/contacts.h"

#include <string.h>

#include "base/error.h"
#include "base/fp_env.h"
#include "collide/face_slots.h"
#include "pair/contact.h"

ebpo_status ebpo_collider_slots(ebpo_collider *c, ebpo_error *error)
{
    for (int i = 0; i < 2; i++) {
        if (!c->slots[i])
            c->slots[i] = ebpo_face_slots(c->model[i]->whole);
        if (!c->slots[i])
            return ebpo_fail_memory(error, c->model[i]->whole->face_count * sizeof(uint32_t));
    }
    return EBPO_OK;
}

void ebpo_pose_pair(const ebpo_collision *q, const ebpo_face_pair *pair, ebpo_posed_pair *out)
{
    const uint64_t face[2] = { pair->file_face_a, pair->file_face_b };
    for (int i = 0; i < 2; i++) {
        out->slot[i] = q->collider->slots[i][face[i]];
        ebpo_posed_triangle(q->collider->model[i]->whole, &q->posing[q->turned ^ i].posing,
                            out->slot[i], out->corner[i]);
    }
}

void ebpo_contact_of(const ebpo_posed_pair *faces, const ebpo_face_pair *pair,
                     ebpo_contact_segment *out)
{
    ebpo_contact_end end[2];
    ebpo_triangle_contact((const double(*)[3])faces->corner[0],
                          (const double(*)[3])faces->corner[1], end);
    *out = (ebpo_contact_segment){ .face_a = pair->face_a, .face_b = pair->face_b };
    for (int i = 0; i < 2; i++) {
        memcpy(out->point[i], end[i].point, sizeof out->point[i]);
        out->on_a[i] = (uint8_t)end[i].on_a;
        out->on_b[i] = (uint8_t)end[i].on_b;
    }
}

enum { SEGMENTS_AT_ONCE = 512 };

typedef struct telling {
    const ebpo_collision *question;
    ebpo_segments_fn take;
    void *user;
} telling;

static bool tell(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    const telling *t = user;
    ebpo_contact_segment out[SEGMENTS_AT_ONCE];
    uint64_t n = 0;
    for (uint64_t i = 0; i < count; i++) {
        ebpo_posed_pair faces;
        if (pairs[i].kind == EBPO_PAIR_CROSSING) {
            ebpo_pose_pair(t->question, &pairs[i], &faces);
            ebpo_contact_of(&faces, &pairs[i], &out[n++]);
        }
        if (n == SEGMENTS_AT_ONCE || (n > 0 && i + 1 == count)) {
            if (!t->take(t->user, out, n))
                return false;
            n = 0;
        }
    }
    return true;
}

ebpo_status ebpo_collide_contacts(ebpo_collider *c, const ebpo_collide_options *options,
                                  ebpo_segments_fn take, void *user, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_collision q;
    ebpo_status status = ebpo_collision_begin_whole(&q, c, options, error);
    if (status == EBPO_OK)
        status = ebpo_collider_slots(c, error);
    telling t = { &q, take, user };
    return status == EBPO_OK ? ebpo_collide_all(c, options, tell, &t, error) : status;
}
