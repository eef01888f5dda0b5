/* Computes the exact volume of the result of a Boolean expression, if no face of an operand
 * intersects a face of another operand, and no operand intersects itself.
 *
 * Without such intersections, each patch of connected faces is entirely in or out of every other
 * operand. So the result is bounded by all faces of a patch, by all of them reversed, or by none of
 * them. The volumes below the bounding faces are summed without rounding (volume_sum.h), and the
 * sum is rounded once. If faces intersect, the result names a pair of intersecting faces as the
 * reason why there is no exact volume. Proof: docs/develop/booleans.md, "Exact volumes". */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "extras/boolean/boolean.h"
#include "extras/boolean/volume_sum.h"
#include "extras/collide/collider.h"
#include "extras/collide/face_patches.h"
#include "extras/collide/posed_solid.h"
#include "extras/collide/pair_faces.h"
#include "geometry/predicates.h"
#include "geometry/level_nodes.h"

/* --- the measurement --- */

static const char stage[] = "exact volume";

enum { PATCHES_GRAIN = 16, FACES_GRAIN = 1 << 14 };

/* The measurement of one expression. */
typedef struct measuring {
    const ebpo_boolean *b;
    ebpo_volume_options options;
    ebpo_exact_volume *out;
    uint64_t equal[EBPO_BOOLEAN_OPERANDS_MAX]; /* see ebpo_boolean_find_equal */
    ebpo_volume_sum *sum;                      /* [threads] */
} measuring;

/* Returns true if the expression uses operand i, and no earlier operand is equal. */
static bool is_first(const measuring *m, uint32_t i) { return m->equal[i] != 0; }

/* --- operands of the expression --- */

/* Bounds the volume by the box of the result. An empty box means an empty result. */
static void bound_by_box(measuring *m)
{
    double box[6], most = 1;
    ebpo_boolean_box(m->b, box);
    for (int k = 0; k < 3; k++) {
        double size = nextafter(box[3 + k] - box[k], INFINITY);
        most = box[k] > box[3 + k] ? 0 : nextafter(most * size, INFINITY);
        if (most == 0)
            break;
    }
    m->out->volume = ebpo_value_bounds_of(0, most);
}

/* Sets the reason why there is no exact volume, and the operands i and k that cause it. */
static void note_doubt(measuring *m, ebpo_volume_doubt why, uint32_t i, uint32_t k)
{
    m->out->doubt = why;
    m->out->operand[0] = i;
    m->out->operand[1] = k;
}

static void check_models(measuring *m)
{
    for (uint32_t i = 0; i < m->b->count && !m->out->doubt; i++) {
        const ebpo_model *model = m->b->solid[i].model;
        if (is_first(m, i) && model->info->pruned)
            note_doubt(m, EBPO_VOLUME_SUBSET, i, i);
        else if (is_first(m, i) && !model->whole)
            note_doubt(m, EBPO_VOLUME_IN_PARTS, i, i);
    }
}

/* --- intersecting faces --- */

static ebpo_status make_collider(const measuring *m, uint32_t i, uint32_t k,
                                 ebpo_collide_options *options, ebpo_collider **out,
                                 ebpo_error *error)
{
    ebpo_collider_options collider_options = EBPO_COLLIDER_OPTIONS_INIT;
    *options = (ebpo_collide_options)EBPO_COLLIDE_OPTIONS_INIT;
    collider_options.threads = m->b->threads;
    options->pose_a = m->b->pose[i];
    options->pose_b = m->b->pose[k];
    options->progress = m->options.progress;
    return ebpo_collider_new(m->b->solid[i].model, m->b->solid[k].model, &collider_options, out,
                             error);
}

static void name_faces(ebpo_exact_volume *out, const ebpo_face_pair *pair)
{
    out->file_face[0] = pair->file_face_a;
    out->file_face[1] = pair->file_face_b;
    out->face[0] = pair->face_a;
    out->face[1] = pair->face_b;
}

/* Sets m->out->doubt if faces of operands i and k intersect. */
static ebpo_status check_pair(measuring *m, uint32_t i, uint32_t k, ebpo_error *error)
{
    ebpo_collider *collider;
    ebpo_collide_options options;
    ebpo_face_pair pair;
    int32_t found = 0;
    const double *x = m->b->solid[i].box, *y = m->b->solid[k].box;
    if (ebpo_box_gap(x, x + 3, y, y + 3) > 0)
        return EBPO_OK;
    ebpo_status status = make_collider(m, i, k, &options, &collider, error);
    if (status != EBPO_OK)
        return status;
    status = ebpo_collide_first(collider, &options, &pair, &found, error);
    if (status == EBPO_OK && found) {
        note_doubt(m, EBPO_VOLUME_OPERANDS_INTERSECT, i, k);
        name_faces(m->out, &pair);
    }
    ebpo_collider_free(collider);
    return status;
}

static ebpo_status check_pairs(measuring *m, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (uint32_t i = 0; i < m->b->count && status == EBPO_OK; i++)
        for (uint32_t k = i + 1; k < m->b->count && status == EBPO_OK && !m->out->doubt; k++)
            if (is_first(m, i) && is_first(m, k))
                status = check_pair(m, i, k, error);
    return status;
}

/* --- one operand --- */

typedef struct operand {
    measuring *m;
    uint32_t number; /* index in m->b->solid */
    const ebpo_posed_solid *solid;
    uint32_t
        *slots; /* [face in the file] slot of the face in the model in memory (ebpo_face_slots) */
    uint32_t *patch; /* [face in the file] first face of its patch */
    uint32_t *head;  /* first faces of the patches */
    uint64_t heads;
    /* [first face of a patch] 1: the faces of the patch bound the result; -1: the reversed faces
     * do; 0: neither */
    int8_t *sign;
} operand;

static void pose_face(const operand *o, uint64_t face, double t[3][3])
{
    ebpo_posed_triangle(o->solid->model->whole, &o->solid->posing, o->slots[face], t);
}

static bool has_area(const operand *o, uint64_t face)
{
    double t[3][3];
    pose_face(o, face, t);
    return !ebpo_zero_area(t[0], t[1], t[2]);
}

static bool take_self(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    const operand *o = user;
    for (uint64_t i = 0; i < count && !o->m->out->doubt; i++) {
        if (!has_area(o, pairs[i].file_face_a) || !has_area(o, pairs[i].file_face_b))
            continue; /* a face without area changes no volume */
        note_doubt(o->m, EBPO_VOLUME_FACES_INTERSECT, o->number, o->number);
        name_faces(o->m->out, &pairs[i]);
    }
    return !o->m->out->doubt;
}

/* Sets o->m->out->doubt if faces of the operand intersect each other. */
static ebpo_status check_self(operand *o, ebpo_error *error)
{
    ebpo_collider *collider;
    ebpo_collide_options options;
    ebpo_status status = make_collider(o->m, o->number, o->number, &options, &collider, error);
    if (status != EBPO_OK)
        return status;
    status = ebpo_collide_self_posed(collider, &options, take_self, o, error);
    ebpo_collider_free(collider);
    return status;
}

/* --- patches that bound the result --- */

/* Computes the operand's winding number at the mean of the corners of a face, shifted by an
 * infinitesimal (ebpo_exact_winding). No other face contains this point, because faces of the
 * operand do not intersect. */
static ebpo_status own_winding(const operand *o, ebpo_context *context, const double t[3][3],
                               int32_t *winding, ebpo_error *error)
{
    mpq_t x[3], more;
    mpq_init(more);
    for (int k = 0; k < 3; k++) {
        mpq_init(x[k]);
        for (int i = 0; i < 3; i++) {
            mpq_set_d(more, t[i][k]);
            mpq_add(x[k], x[k], more);
        }
        mpq_set_ui(more, 3, 1);
        mpq_div(x[k], x[k], more);
    }
    ebpo_status status = ebpo_exact_winding(o->solid, context, (const mpq_t *)x, winding, error);
    mpq_clears(x[0], x[1], x[2], more, NULL);
    return status;
}

/* Computes the winding number on the side to which the normal points. */
static ebpo_status winding_in_front(const operand *o, unsigned worker, const double t[3][3],
                                    int32_t *front, ebpo_error *error)
{
    /* sign of the component of the normal along the infinitesimal shift. If the sign is -1, the
     * shifted point is behind the face, where the winding number is greater by 1. */
    int shifted = 0;
    for (int k = 0; k < 3 && shifted == 0; k++)
        shifted = ebpo_normal_sign(k, t[0], t[1], t[2]);
    ebpo_status status =
        own_winding(o, ebpo_boolean_context(o->m->b, worker, o->number), t, front, error);
    *front -= shifted < 0;
    return status;
}

/* Sets *in: a bit for each other operand that contains the point, which is a corner of a face. */
static ebpo_status find_around(const operand *o, unsigned worker, const double point[3],
                               uint64_t *in, ebpo_error *error)
{
    const measuring *m = o->m;
    ebpo_status status = EBPO_OK;
    *in = 0;
    for (uint32_t i = 0; i < m->b->count && status == EBPO_OK; i++) {
        ebpo_posed_sides sides;
        const ebpo_posed_solid *solid = &m->b->solid[i];
        if (i == o->number || !is_first(m, i))
            continue;
        status = ebpo_posed_solid_sides(solid, ebpo_boolean_context(m->b, worker, i), point, &sides,
                                        error);
        if (status == EBPO_OK && ebpo_rule_inside(solid->model->info->rule, sides.above))
            *in |= m->equal[i];
    }
    return status;
}

/* Returns 1 if a point with this winding number in the operand is in the result, else 0. around: a
 * bit for each other operand that contains the point. */
static int is_in(const operand *o, uint64_t around, int32_t winding)
{
    bool inside = ebpo_rule_inside(o->solid->model->info->rule, winding);
    uint64_t in = around | (inside ? o->m->equal[o->number] : 0);
    return ebpo_boolean_holds(o->m->b, in);
}

/* Computes the signs of patches (operand.sign). */
static ebpo_status query_patches(void *user, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    const operand *o = user;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++) {
        double t[3][3];
        int32_t front = 0;
        uint64_t around = 0;
        pose_face(o, o->head[i], t);
        status = winding_in_front(o, worker, (const double(*)[3])t, &front, error);
        if (status == EBPO_OK)
            status = find_around(o, worker, t[0], &around, error);
        o->sign[o->head[i]] = (int8_t)(is_in(o, around, front + 1) - is_in(o, around, front));
    }
    return status;
}

static ebpo_status add_faces(void *user, uint64_t begin, uint64_t end, unsigned worker,
                             ebpo_error *error)
{
    const operand *o = user;
    (void)error;
    for (uint64_t f = begin; f < end; f++) {
        double t[3][3];
        int sign = o->sign[o->patch[f]];
        if (sign == 0)
            continue;
        pose_face(o, f, t);
        ebpo_volume_sum_add(&o->m->sum[worker], (const double(*)[3])t, sign);
    }
    return EBPO_OK;
}

/* Lists the first faces of patches. A face without area forms a patch alone, which is not
 * listed. */
static ebpo_status find_heads(operand *o, uint64_t faces, ebpo_error *error)
{
    uint64_t capacity = 0;
    for (uint32_t f = 0; f < faces; f++) {
        if (o->patch[f] != f || !has_area(o, f))
            continue;
        if (!ebpo_grow(&o->head, &capacity, o->heads + 1, sizeof *o->head))
            return ebpo_fail_memory(error, (o->heads + 1) * sizeof *o->head);
        o->head[o->heads++] = f;
    }
    o->sign = ebpo_alloc_zero(faces, sizeof *o->sign);
    return o->sign ? EBPO_OK : ebpo_fail_memory(error, faces);
}

static ebpo_status add_patches(operand *o, ebpo_error *error)
{
    const ebpo_accel *whole = o->solid->model->whole;
    const ebpo_progress *progress = &o->m->options.progress;
    unsigned threads = o->m->b->threads;
    ebpo_status status = ebpo_edge_patches(whole, o->slots, &o->solid->posing, &o->patch, error);
    if (status == EBPO_OK)
        status = find_heads(o, whole->face_count, error);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(o->heads <= PATCHES_GRAIN ? 1 : threads, NULL, o->heads,
                                   PATCHES_GRAIN, query_patches, o, progress, stage, error);
    if (status == EBPO_OK)
        status =
            ebpo_parallel_for(whole->face_count <= FACES_GRAIN ? 1 : threads, NULL,
                              whole->face_count, FACES_GRAIN, add_faces, o, progress, stage, error);
    o->m->out->patches += o->heads;
    for (uint64_t i = 0; i < o->heads && status == EBPO_OK; i++)
        o->m->out->bounding += o->sign[o->head[i]] != 0;
    return status;
}

static ebpo_status add_operand(measuring *m, uint32_t number, ebpo_error *error)
{
    operand o = { .m = m, .number = number, .solid = &m->b->solid[number] };
    const ebpo_accel *whole = o.solid->model->whole;
    o.slots = ebpo_face_slots(whole);
    ebpo_status status = o.slots ? check_self(&o, error)
                                 : ebpo_fail_memory(error, whole->face_count * sizeof *o.slots);
    if (status == EBPO_OK && !m->out->doubt)
        status = add_patches(&o, error);
    free(o.slots);
    free(o.patch);
    free(o.head);
    free(o.sign);
    return status;
}

/* --- all operands --- */

static ebpo_status add_operands(measuring *m, ebpo_error *error)
{
    unsigned threads = m->b->threads;
    ebpo_status status = EBPO_OK;
    m->sum = ebpo_alloc(threads, sizeof *m->sum);
    if (!m->sum)
        return ebpo_fail_memory(error, threads * sizeof *m->sum);
    for (unsigned i = 0; i < threads; i++)
        ebpo_volume_sum_begin(&m->sum[i]);
    for (uint32_t i = 0; i < m->b->count && status == EBPO_OK && !m->out->doubt; i++) {
        ebpo_error cause = EBPO_ERROR_INIT;
        if (is_first(m, i) && add_operand(m, i, &cause) != EBPO_OK)
            status = ebpo_fail_operand(m->b->solid[i].model, i, &cause, error);
    }
    for (unsigned i = 1; i < threads; i++)
        ebpo_volume_sum_merge(&m->sum[0], &m->sum[i]);
    double scaled, volume;
    int64_t exponent;
    volume = ebpo_volume_sum_value(&m->sum[0], &scaled, &exponent);
    if (status == EBPO_OK && !m->out->doubt) {
        m->out->volume = ebpo_value_bounds_of(volume, volume);
        m->out->scaled = scaled;
        m->out->exponent = exponent;
    }
    for (unsigned i = 0; i < threads; i++)
        ebpo_volume_sum_end(&m->sum[i]);
    free(m->sum);
    return status;
}

ebpo_status ebpo_boolean_exact_volume(ebpo_boolean *boolean, const ebpo_volume_options *options,
                                      ebpo_exact_volume *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_exact_volume found = { .file_face = { EBPO_NO_FACE, EBPO_NO_FACE },
                                .face = { EBPO_NO_FACE, EBPO_NO_FACE } };
    measuring m = { .b = boolean, .options = EBPO_VOLUME_OPTIONS_INIT, .out = &found };
    ebpo_status status = EBPO_TAKE(ebpo_volume_options, &m.options, options, error);
    if (status == EBPO_OK)
        status = EBPO_CHECK_SIZED(ebpo_exact_volume, out, error);
    if (status != EBPO_OK)
        return status;
    ebpo_boolean_find_equal(m.b, m.equal);
    bound_by_box(&m);
    if (found.volume.hi > 0) {
        check_models(&m);
        if (!found.doubt)
            status = check_pairs(&m, error);
        if (status == EBPO_OK && !found.doubt)
            status = add_operands(&m, error);
    }
    return status == EBPO_OK ? EBPO_GIVE(ebpo_exact_volume, out, &found) : status;
}
