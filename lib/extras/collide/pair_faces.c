/* Looks up the posed faces of pairs by their indices in the file, and computes the intersections of
 * crossing faces.
 *
 * If a model is entirely in memory (a whole model), an array gives the slot of each face: the
 * position of the face in the blocks of the accel (the acceleration structure). Faces of a partly
 * loaded model are read through the cache of chunks. ebpo_posing_apply poses the corners, as in all
 * exact tests. ebpo_collide_contacts returns the segments of all crossing pairs in the order of the
 * pairs. */
#include "core/strict_fp.h"

#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "extras/collide/face_pairs.h"
#include "extras/collide/pair_faces.h"

uint32_t *ebpo_face_slots(const ebpo_accel *subtree)
{
    uint32_t *slot = ebpo_alloc(subtree->face_count, sizeof *slot);
    if (!slot)
        return NULL;
    for (uint32_t n = 0; n < subtree->bound_count; n++)
        for (unsigned i = 0; i < subtree->bound[n].count; i++) {
            uint32_t block = subtree->bound[n].child[i];
            if (block == EBPO_NO_CHILD || !(block & EBPO_IS_BLOCK))
                continue;
            block &= ~EBPO_IS_BLOCK;
            const ebpo_meshlet *m = ebpo_accel_meshlet(subtree, block);
            for (uint32_t lane = 0; lane < m->faces; lane++)
                slot[m->face + lane] = block * EBPO_BLOCK + lane;
        }
    return slot;
}

void ebpo_faces_by_number_begin(ebpo_faces_by_number *f, const ebpo_model *model,
                                const uint32_t *slots)
{
    *f = (ebpo_faces_by_number){ .model = model, .slots = slots };
    if (model->whole)
        return;
    f->faces.array = ebpo_reader_array(model->file, EBPO_A_FACES, 0);
    f->vertices.array = ebpo_reader_array(model->file, EBPO_A_VERTICES, 0);
}

void ebpo_faces_by_number_end(ebpo_faces_by_number *f)
{
    if (!f->model || f->model->whole)
        return;
    ebpo_held_chunk_release(f->model->chunks, &f->faces);
    ebpo_held_chunk_release(f->model->chunks, &f->vertices);
}

ebpo_status ebpo_faces_by_number_vertex(ebpo_faces_by_number *f, uint64_t vertex, double out[3],
                                        ebpo_error *error)
{
    ebpo_status status = ebpo_held_chunk_move(f->model->chunks, &f->vertices, vertex, error);
    if (status != EBPO_OK)
        return status;
    uint64_t row = vertex - f->vertices.begin;
    if (f->model->info->double_coordinates) {
        memcpy(out, f->vertices.rows + row * 3 * sizeof(double), 3 * sizeof(double));
        return EBPO_OK;
    }
    float x[3];
    memcpy(x, f->vertices.rows + row * sizeof x, sizeof x);
    for (int k = 0; k < 3; k++)
        out[k] = (double)x[k];
    return EBPO_OK;
}

ebpo_status ebpo_faces_by_number_corners(ebpo_faces_by_number *f, uint64_t face, uint32_t out[3],
                                         ebpo_error *error)
{
    ebpo_status status = ebpo_held_chunk_move(f->model->chunks, &f->faces, face, error);
    if (status == EBPO_OK)
        memcpy(out, f->faces.rows + (face - f->faces.begin) * 3 * sizeof *out, 3 * sizeof *out);
    return status;
}

ebpo_status ebpo_faces_by_number_get(ebpo_faces_by_number *f, uint64_t face, double out[3][3],
                                     ebpo_error *error)
{
    uint32_t corner[3];
    if (f->model->whole) {
        ebpo_accel_triangle(f->model->whole, f->slots[face], out);
        return EBPO_OK;
    }
    ebpo_status status = ebpo_faces_by_number_corners(f, face, corner, error);
    for (int i = 0; i < 3 && status == EBPO_OK; i++)
        status = ebpo_faces_by_number_vertex(f, corner[i], out[i], error);
    return status;
}

/* --- contact segments --- */

/* Makes the arrays of slots for the collider's whole models, if they do not exist yet. Fails with
 * EBPO_E_MEMORY. */
static ebpo_status make_slots(ebpo_collider *c, ebpo_error *error)
{
    for (int i = 0; i < 2; i++) {
        if (!c->model[i]->whole)
            continue;
        if (!c->slots[i])
            c->slots[i] = ebpo_face_slots(c->model[i]->whole);
        if (!c->slots[i])
            return ebpo_fail_memory(error, c->model[i]->whole->face_count * sizeof(uint32_t));
    }
    return EBPO_OK;
}

ebpo_status ebpo_pair_faces_begin(ebpo_pair_faces *f, const ebpo_collision *q, ebpo_error *error)
{
    ebpo_collider *c = q->collider;
    f->collision = q;
    ebpo_status status = make_slots(c, error);
    for (int i = 0; i < 2 && status == EBPO_OK; i++)
        ebpo_faces_by_number_begin(&f->side[i], c->model[i], c->slots[i]);
    return status;
}

void ebpo_pair_faces_end(ebpo_pair_faces *f)
{
    for (int i = 0; i < 2; i++)
        ebpo_faces_by_number_end(&f->side[i]);
}

ebpo_status ebpo_pose_pair(ebpo_pair_faces *f, const ebpo_face_pair *pair, ebpo_posed_pair *out,
                           ebpo_error *error)
{
    const uint64_t face[2] = { pair->file_face_a, pair->file_face_b };
    for (int i = 0; i < 2; i++) {
        const ebpo_posing *posing = &f->collision->posing[f->collision->swapped ^ i].posing;
        ebpo_status status = ebpo_faces_by_number_get(&f->side[i], face[i], out->unposed[i], error);
        if (status != EBPO_OK)
            return status;
        for (int k = 0; k < 3; k++)
            ebpo_posing_apply(posing, out->unposed[i][k], out->corner[i][k]);
    }
    return EBPO_OK;
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

enum {
    SEGMENTS_AT_ONCE = 512
}; /* greatest number of segments in a call of the caller's function */

/* The caller's function that receives segments. */
typedef struct segment_receiver {
    ebpo_pair_faces faces; /* the look-up of faces */
    ebpo_segments_fn take; /* the function, and its argument */
    void *user;
    ebpo_status status; /* failure of reading faces, and its error */
    ebpo_error *error;
} segment_receiver;

/* Receives pairs from ebpo_collide_all, and passes the segments of the crossing pairs to the
 * caller. Returns false if the caller needs no more segments, or after a failure. */
static bool pass_segments(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    segment_receiver *r = user;
    ebpo_contact_segment out[SEGMENTS_AT_ONCE];
    uint64_t n = 0;
    for (uint64_t i = 0; i < count; i++) {
        ebpo_posed_pair faces;
        if (pairs[i].kind == EBPO_PAIR_CROSSING) {
            r->status = ebpo_pose_pair(&r->faces, &pairs[i], &faces, r->error);
            if (r->status != EBPO_OK)
                return false;
            ebpo_contact_of(&faces, &pairs[i], &out[n++]);
        }
        if (n == SEGMENTS_AT_ONCE || (n > 0 && i + 1 == count)) {
            if (!r->take(r->user, out, n))
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
    segment_receiver r = { .take = take, .user = user, .error = error };
    ebpo_status status = ebpo_collision_begin(&q, c, options, error);
    if (status == EBPO_OK)
        status = ebpo_pair_faces_begin(&r.faces, &q, error);
    if (status == EBPO_OK)
        status = ebpo_collide_all(c, options, pass_segments, &r, error);
    ebpo_pair_faces_end(&r.faces);
    return status == EBPO_OK ? r.status : status;
}
