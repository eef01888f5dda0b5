/* Finds the relation of two posed models: disjoint, touching, intersecting, one inside the other,
 * or equal.
 *
 * The boundaries of two models divide space into parts. The relation depends on which kinds of
 * parts exist: parts inside both models, parts inside the first model only, and parts inside the
 * second model only. Each part is bounded by pieces of faces, so the parts are found around these
 * pieces (around_face.h).
 *
 * In nearly all cases a crossing pair of faces decides the relation. If it does not, all faces that
 * intersect the other model are examined, then one face of each patch without contact. A patch
 * without contact is a set of connected faces that do not intersect the other model, so the whole
 * patch is inside or outside the other model. A subtree is not loaded if the side of all its faces
 * without contact is known and adds no information. If the deadline passes, the relation is
 * undecided. A search runs in one thread. See docs/develop/collision.md, "Relation of two models".
 */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/os.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "extras/collide/around_face.h"
#include "extras/collide/face_patches.h"
#include "extras/collide/pair_faces.h"
#include "extras/collide/posed_solid.h"
#include "extras/collide/posed_subtrees.h"
#include "geometry/predicates.h"
#include "geometry/level_nodes.h"

/* --- patches without contact --- */

/* The patches without contact of the query's model m, subtree by subtree. A model that is entirely
 * in memory (a whole model) is a single subtree. A subtree owns a face if no earlier subtree lists
 * the face. */
typedef struct separate_patches {
    const ebpo_collision *collision;
    ebpo_two_models *two;
    int m;
    uint64_t subtrees; /* number of subtrees */
    uint64_t first;    /* index in the file of the first face that the current subtree owns */
    uint64_t count;    /* number of faces that the current subtree owns */
    uint32_t *patch;   /* [count] the patch of each owned face, as in ebpo_face_patches */
} separate_patches;

/* Begins with no current subtree. */
static void separate_patches_begin(separate_patches *u, const ebpo_collision *collision,
                                   ebpo_two_models *two, int m)
{
    const ebpo_model *model = collision->model[m];
    *u = (separate_patches){ .collision = collision, .two = two, .m = m };
    u->subtrees = model->whole ? 1 : model->top->below_count;
}

static void separate_patches_end(separate_patches *u) { free(u->patch); }

/* Finds the patches of a subtree, which becomes the current subtree. */
static ebpo_status find_patches(separate_patches *u, const ebpo_accel *subtree,
                                const uint32_t *slots, const uint64_t *intersecting,
                                ebpo_error *error)
{
    u->first = subtree->first_face;
    u->count = subtree->face_count - subtree->shared_count;
    return ebpo_face_patches(subtree, slots, intersecting, &u->patch, error);
}

/* Loads a subtree, finds its patches, and releases the subtree. intersecting: a bit for each face
 * of the model, 1: the face intersects the other model. */
static ebpo_status separate_patches_find(separate_patches *u, uint64_t number,
                                         const uint64_t *intersecting, ebpo_error *error)
{
    const ebpo_model *model = u->collision->model[u->m];
    ebpo_context *context = u->two->context[u->m];
    ebpo_accel *subtree;
    free(u->patch);
    u->patch = NULL;
    if (model->whole)
        return find_patches(u, model->whole, u->two->faces[u->m]->slots, intersecting, error);
    context->content = EBPO_ACCEL_FACES; /* other queries with this context need nodes */
    ebpo_status status = ebpo_context_subtree(context, (uint32_t)number, &subtree, error);
    context->content = EBPO_ACCEL_NODES;
    if (status != EBPO_OK)
        return status;
    uint32_t *slots = ebpo_face_slots(subtree);
    status = slots ? find_patches(u, subtree, slots, intersecting, error)
                   : ebpo_fail_memory(error, subtree->face_count * sizeof *slots);
    free(slots);
    ebpo_context_let_go(context);
    return status;
}

/* Sets *user to true if triangles are received. Returns false then, to end the search. */
static bool record_any(void *user, const ebpo_triangles *triangles)
{
    bool *any = user;
    *any |= triangles->count > 0;
    return !*any;
}

/* Sets *in to 1 if a ball in the world is entirely inside the other model, and to 0 if the ball is
 * entirely outside. Does not change *in if faces of the other model may intersect the ball. */
static ebpo_status side_of_ball(const separate_patches *u, const double middle[3], double radius,
                                int *in, ebpo_error *error)
{
    const ebpo_posed_solid *other = &u->two->model[!u->m];
    ebpo_context *context = u->two->context[!u->m];
    double low[3], high[3], p[3], uncertainty;
    bool has_faces = false;
    ebpo_inside_result inside;
    ebpo_unpose(other, middle, p, &uncertainty);
    double space = (radius / other->posing.scale + 2 * uncertainty) * (1 + 0x1p-20);
    for (int k = 0; k < 3; k++) {
        low[k] = nextafter(p[k] - space, -INFINITY);
        high[k] = nextafter(p[k] + space, INFINITY);
    }
    ebpo_status status = ebpo_triangles_in_box(context, low, high, record_any, &has_faces, error);
    if (status != EBPO_OK || has_faces)
        return status;
    status = ebpo_inside(context, p, NULL, &inside, error);
    *in = ebpo_rule_inside(u->two->rule[!u->m], inside.winding);
    return status;
}

/* Finds out if the faces without contact of a subtree are inside the other model. Sets *in to 1
 * (all are inside), 0 (all are outside) or -1 (unknown). The ball around the subtree's cell
 * contains a point of each face that the subtree owns. If no face of the other model intersects the
 * ball, the ball is entirely inside or outside the other model, and so is each face without
 * contact. */
static ebpo_status separate_patches_side(const separate_patches *u, uint64_t number, int *in,
                                         ebpo_error *error)
{
    const ebpo_model *model = u->collision->model[u->m];
    ebpo_posed_subtrees posed = { .model = model, .posing = u->collision->posing[u->m].posing };
    double corner[8][3], middle[3];
    *in = -1;
    if (model->whole)
        return EBPO_OK;
    ebpo_cell cell = model->top->below[number].cell;
    double radius = ebpo_posed_diagonal(&posed, cell) / 2 +
                    ebpo_posed_slack(&posed, cell, u->collision->max_coordinate);
    ebpo_posed_cell(&posed, cell, corner);
    for (int k = 0; k < 3; k++)
        middle[k] = corner[0][k] / 2 + corner[7][k] / 2;
    if (ebpo_posed_solid_near(&u->two->model[!u->m], middle, radius))
        return side_of_ball(u, middle, radius, in, error);
    *in = 0;
    return EBPO_OK;
}

/* --- the state of the search --- */

static const char stage[] = "relation"; /* for the progress function */

/* State of the search. Models are in the query's order. */
typedef struct relation_search {
    const ebpo_collision *collision;
    ebpo_pair_faces lookup; /* the look-up of faces by their indices */
    ebpo_two_models two;
    ebpo_relation_result *out;
    uint64_t *intersecting[2]; /* [model] a bit for each face, 1: it intersects the other model */
    uint64_t *seen[2];         /* [model] a bit for each face, 1: it has been examined */
    bool both;                 /* a point is inside both models */
    bool only[2];              /* [model] a point is inside this model and not in the other model */
    bool touch;                /* a common point exists */
    bool has_pieces;           /* the face that was visited last has an area, and so pieces */
    bool doubtful;      /* a piece of the face that was visited last is not part of its model */
    unsigned last[2];   /* ebpo_around.in of the piece that was visited last */
    uint64_t inspected; /* number of examined faces */
    bool late;          /* the deadline has passed */
    ebpo_status status; /* failure of a function that receives faces or pairs, and its error */
    ebpo_error *error;
} relation_search;

/* Returns true if one model is a solid and the other model is a surface. */
static bool is_mixed(const relation_search *r) { return r->two.solid[0] != r->two.solid[1]; }

/* Returns true if both models are surfaces. */
static bool are_surfaces(const relation_search *r) { return !r->two.solid[0] && !r->two.solid[1]; }

/* Returns true if no further face can change the relation. With a solid and a surface, only the
 * surface's points outside the solid matter. */
static bool is_decided(const relation_search *r)
{
    if (is_mixed(r))
        return r->both && r->only[r->two.solid[0]];
    return r->both && (are_surfaces(r) ? r->only[0] || r->only[1] : r->only[0] && r->only[1]);
}

/* Returns the number of faces of model m. */
static uint64_t face_count(const relation_search *r, int m)
{
    return r->collision->model[m]->info->face_count;
}

static bool has_bit(const uint64_t *bits, uint64_t i) { return bits[i / 64] >> i % 64 & 1; }

static void set_bit(uint64_t *bits, uint64_t i) { bits[i / 64] |= UINT64_C(1) << i % 64; }

/* --- examining faces --- */

/* A face of model m, whose pieces are visited. */
typedef struct visited_face {
    relation_search *r;
    int m;
} visited_face;

/* Records the kinds of the parts of space on both sides of a piece, for two solids. */
static void record_solids(relation_search *r, const ebpo_around *a)
{
    r->both |= (a->in[0] & a->in[1]) != 0;
    r->only[0] |= (a->in[0] & ~a->in[1]) != 0;
    r->only[1] |= (a->in[1] & ~a->in[0]) != 0;
}

/* Records the sides of a piece of a face. Returns false if the relation is decided. */
static bool record_piece(void *user, const ebpo_around *a)
{
    const visited_face *f = user;
    relation_search *r = f->r;
    unsigned in_other = a->in[!f->m]; /* sides of the piece that are in the other model */
    r->has_pieces = true;
    memcpy(r->last, a->in, sizeof r->last);
    if (r->two.solid[0] && r->two.solid[1])
        record_solids(r, a);
    else {
        r->both |= is_mixed(r) && in_other == EBPO_SIDE_BOTH;
        r->only[f->m] |= in_other == 0;
    }
    return !is_decided(r);
}

/* Examines a face if the face has not been examined. If one model is a solid and the other model is
 * a surface, examines only faces of the surface. Returns false if the search must end: the relation
 * is decided, the deadline has passed, or r->status is a failure. */
static bool inspect_face(relation_search *r, int m, uint64_t face)
{
    visited_face f = { r, m };
    if ((is_mixed(r) && r->two.solid[m]) || has_bit(r->seen[m], face))
        return true;
    set_bit(r->seen[m], face);
    r->status = ebpo_visit_around_face(&r->two, m, face, record_piece, &f, r->error);
    if (r->status == EBPO_OK && ++r->inspected % 64 == 0 &&
        !ebpo_progress_step(&r->collision->options.progress, stage, 0, 0, r->error))
        r->status = EBPO_E_CANCELLED;
    r->late |= ebpo_collision_is_late(r->collision);
    return r->status == EBPO_OK && !r->late && !is_decided(r);
}

/* Examines both faces of a pair, as inspect_face does. */
static bool inspect_pair(relation_search *r, const ebpo_face_pair *pair)
{
    const uint64_t face[2] = { pair->file_face_a, pair->file_face_b };
    bool swapped = r->collision->swapped;
    return inspect_face(r, 0, face[swapped]) && inspect_face(r, 1, face[!swapped]);
}

/* --- contacts --- */

/* Returns true if both faces of a pair have an area. After a failure, returns false and sets
 * r->status. */
static bool all_have_area(relation_search *r, const ebpo_face_pair *pair)
{
    ebpo_posed_pair faces;
    r->status = ebpo_pose_pair(&r->lookup, pair, &faces, r->error);
    for (int i = 0; i < 2 && r->status == EBPO_OK; i++) {
        const double(*t)[3] = (const double(*)[3])faces.corner[i];
        if (ebpo_zero_area(t[0], t[1], t[2]))
            return false;
    }
    return r->status == EBPO_OK;
}

/* Records an intersecting pair of faces of two surfaces. After a failure, returns false and sets
 * r->status. */
static bool record_pair(relation_search *r, const ebpo_face_pair *pair)
{
    r->both |= pair->kind != EBPO_PAIR_TOUCHING;
    r->touch = r->touch || r->both || all_have_area(r, pair);
    return r->status == EBPO_OK;
}

/* Marks the faces of intersecting pairs, and examines the faces that cross. Returns false if the
 * search must end. */
static bool receive_contacts(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    relation_search *r = user;
    bool swapped = r->collision->swapped, go_on = true;
    for (uint64_t i = 0; i < count && go_on; i++) {
        set_bit(r->intersecting[swapped], pairs[i].file_face_a);
        set_bit(r->intersecting[!swapped], pairs[i].file_face_b);
        if (are_surfaces(r))
            go_on = record_pair(r, &pairs[i]);
        else if (pairs[i].kind == EBPO_PAIR_CROSSING)
            go_on = inspect_pair(r, &pairs[i]);
    }
    return go_on;
}

/* Returns options for a query that this query makes: the query's options, with the time that
 * remains until the deadline. */
static ebpo_collide_options remaining_options(const relation_search *r)
{
    ebpo_collide_options options = r->collision->options;
    uint64_t now = ebpo_clock();
    if (r->collision->deadline != UINT64_MAX)
        options.deadline_ns = r->collision->deadline > now ? r->collision->deadline - now : 1;
    return options;
}

/* Finds all intersecting pairs, and passes them to `take`. If the deadline passes, sets r->late and
 * does not fail. */
static ebpo_status receive_pairs(relation_search *r, ebpo_pairs_fn take, ebpo_error *error)
{
    const ebpo_collision *q = r->collision;
    ebpo_collide_options options = remaining_options(r);
    ebpo_two_models_let_go(&r->two);
    ebpo_status status = ebpo_collide_all(q->collider, &options, take, r, error);
    if (status == EBPO_E_CANCELLED && ebpo_collision_is_late(q)) {
        r->late = true;
        status = EBPO_OK;
    }
    return status == EBPO_OK ? r->status : status;
}

/* Returns true if the search must continue: if there is no failure, the deadline has not passed,
 * and the relation is not decided. */
static bool must_continue(const relation_search *r)
{
    return r->status == EBPO_OK && !r->late && !is_decided(r);
}

/* Examines all faces that intersect the other model. */
static void inspect_intersecting(relation_search *r)
{
    for (int m = 0; m < 2; m++) {
        uint64_t count = face_count(r, m);
        for (uint64_t f = 0; f < count && must_continue(r); f++)
            if (has_bit(r->intersecting[m], f))
                (void)inspect_face(r, m, f);
    }
}

/* --- faces without contact --- */

/* Returns true if a patch without contact of model m adds no information. in: true if
 * the patch is inside the other model, false if it is outside the other model. */
static bool side_adds_nothing(const relation_search *r, int m, bool in)
{
    if (is_mixed(r))
        return in ? r->both : r->only[m];
    return in ? r->both && r->only[!m] : r->only[m];
}

/* Examines the faces without contact that a subtree owns, except the faces of patches that add no
 * information. done: a bit for each patch (by its first face), 1: the patch adds no information;
 * initially 0. */
static void inspect_untouched_faces(relation_search *r, const separate_patches *u, uint64_t *done)
{
    for (uint64_t i = 0; i < u->count && must_continue(r); i++) {
        if (has_bit(r->intersecting[u->m], u->first + i) || has_bit(done, u->patch[i]))
            continue;
        r->has_pieces = false;
        (void)inspect_face(r, u->m, u->first + i);
        if (r->has_pieces && side_adds_nothing(r, u->m, r->last[!u->m] != 0))
            set_bit(done, u->patch[i]);
    }
}

/* Returns a new array of `count` bits, which are 0; NULL if memory is short. */
static uint64_t *make_bits(uint64_t count) { return ebpo_alloc_zero(count / 64 + 1, 8); }

/* Fails because make_bits has returned NULL. */
static ebpo_status fail_bits(uint64_t count, ebpo_error *error)
{
    return ebpo_fail_memory(error, count / 8);
}

/* Loads a subtree and examines its faces without contact. */
static void inspect_subtree(relation_search *r, separate_patches *u, uint64_t number)
{
    r->status = separate_patches_find(u, number, r->intersecting[u->m], r->error);
    if (r->status != EBPO_OK)
        return;
    uint64_t *done = make_bits(u->count);
    if (done)
        inspect_untouched_faces(r, u, done);
    else
        r->status = fail_bits(u->count, r->error);
    free(done);
}

/* Returns true if the side of all faces without contact of a subtree is known and adds no
 * information, so that the subtree need not be loaded. */
static bool is_settled(relation_search *r, const separate_patches *u, uint64_t number)
{
    int in = -1;
    if (side_adds_nothing(r, u->m, true) || side_adds_nothing(r, u->m, false))
        r->status = separate_patches_side(u, number, &in, r->error);
    return in >= 0 && side_adds_nothing(r, u->m, in);
}

/* Examines the faces without contact of model m, subtree by subtree. */
static void inspect_patches(relation_search *r, int m)
{
    separate_patches u;
    if (is_mixed(r) && r->two.solid[m])
        return;
    separate_patches_begin(&u, r->collision, &r->two, m);
    for (uint64_t i = 0; i < u.subtrees && must_continue(r); i++) {
        if (!is_settled(r, &u, i) && r->status == EBPO_OK)
            inspect_subtree(r, &u, i);
        r->late |= ebpo_collision_is_late(r->collision);
    }
    separate_patches_end(&u);
}

/* --- common points of models whose interiors have no common point --- */

/* Sets r->doubtful if a piece is not part of the face's model. */
static bool record_doubtful_piece(void *user, const ebpo_around *a)
{
    const visited_face *f = user;
    f->r->has_pieces = true;
    f->r->doubtful |= a->in[f->m] == 0;
    return !f->r->doubtful;
}

/* Returns true if every piece of a face belongs to the face's model. Then a common point of this
 * face and another face also belongs to this model. */
static bool belongs_to_model(relation_search *r, int m, uint64_t face)
{
    visited_face f = { r, m };
    r->has_pieces = r->doubtful = false;
    if (r->status == EBPO_OK)
        r->status = ebpo_visit_around_face(&r->two, m, face, record_doubtful_piece, &f, r->error);
    return r->status == EBPO_OK && r->has_pieces && !r->doubtful;
}

/* Sets r->touch if both faces of an intersecting pair belong to their models. Returns false if the
 * search must end. */
static bool find_touching_faces(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    relation_search *r = user;
    bool swapped = r->collision->swapped;
    for (uint64_t i = 0; i < count && !r->touch && r->status == EBPO_OK && !r->late; i++) {
        const uint64_t face[2] = { pairs[i].file_face_a, pairs[i].file_face_b };
        r->touch = belongs_to_model(r, 0, face[swapped]) && belongs_to_model(r, 1, face[!swapped]);
        r->late |= ebpo_collision_is_late(r->collision);
    }
    return !r->touch && r->status == EBPO_OK && !r->late;
}

/* Sets r->touch if both models, including their boundaries, have a common point. */
static ebpo_status find_common_point(relation_search *r, ebpo_error *error)
{
    ebpo_status status = receive_pairs(r, find_touching_faces, error);
    uint64_t count = face_count(r, 0);
    for (uint64_t f = 0; f < count && status == EBPO_OK && !r->touch && !r->late; f++) {
        if (has_bit(r->intersecting[0], f))
            status = ebpo_face_has_common_point(&r->two, 0, f, &r->touch, error);
        r->late |= ebpo_collision_is_late(r->collision);
    }
    return status;
}

/* --- the relation --- */

/* Returns true if a face of model m that does not intersect the other model has an area. */
static bool has_separate_area(relation_search *r, int m)
{
    bool has = false;
    for (uint64_t f = 0; f < face_count(r, m) && r->status == EBPO_OK && !has; f++) {
        double t[3][3];
        if (!has_bit(r->intersecting[m], f))
            r->status = ebpo_two_models_face(&r->two, m, f, t, &has, r->error);
    }
    return has;
}

/* Returns true if both models are the same model at the same pose. */
static bool is_same(const ebpo_collision *q)
{
    return ebpo_same_model(q->model[0], q->model[1]) &&
           memcmp(&q->options.pose_a, &q->options.pose_b, sizeof q->options.pose_a) == 0;
}

/* Sets the result for two identical models: r->both becomes true if the model has a point. */
static void find_any(relation_search *r)
{
    uint64_t count = face_count(r, 0);
    r->out->contact = count > 0;
    if (are_surfaces(r))
        r->both = r->touch = has_separate_area(r, 0);
    for (uint64_t f = 0; f < count && must_continue(r) && !r->both; f++)
        (void)inspect_face(r, 0, f);
}

/* Finds an intersecting pair, and examines its faces. If the faces cross, they decide the relation
 * in nearly all cases. */
static ebpo_status inspect_first(relation_search *r, ebpo_error *error)
{
    const ebpo_collision *q = r->collision;
    ebpo_collide_options options = remaining_options(r);
    ebpo_face_pair pair;
    ebpo_status status = ebpo_collide_first(q->collider, &options, &pair, &r->out->contact, error);
    r->late |= r->out->contact < 0;
    if (status != EBPO_OK || r->out->contact != 1 || are_surfaces(r))
        return status;
    (void)inspect_pair(r, &pair);
    return r->status;
}

/* Examines the faces that intersect the other model. */
static ebpo_status inspect_contacts(relation_search *r, ebpo_error *error)
{
    ebpo_status status = receive_pairs(r, receive_contacts, error);
    for (int m = 0; m < 2 && r->both && are_surfaces(r) && must_continue(r); m++)
        r->only[m] = has_separate_area(r, m);
    if (status == EBPO_OK && (r->both || !are_surfaces(r)))
        inspect_intersecting(r);
    return status == EBPO_OK ? r->status : status;
}

/* Examines faces until the relation is decided. */
static ebpo_status examine_models(relation_search *r, ebpo_error *error)
{
    ebpo_status status = inspect_first(r, error);
    if (status == EBPO_OK && r->out->contact == 1 && must_continue(r))
        status = inspect_contacts(r, error);
    for (int m = 0; m < 2 && status == EBPO_OK && !are_surfaces(r); m++) {
        inspect_patches(r, m);
        status = r->status;
    }
    if (status == EBPO_OK && !r->late && !r->both && !are_surfaces(r) && r->out->contact == 1)
        status = find_common_point(r, error);
    return status;
}

/* Returns the relation of the query's first model to its second. */
static ebpo_relation relation_of(const relation_search *r)
{
    if (r->late)
        return EBPO_RELATION_UNDECIDED;
    if (are_surfaces(r))
        return !r->touch                    ? EBPO_DISJOINT
               : !r->both                   ? EBPO_TOUCHING
               : !r->only[0] && !r->only[1] ? EBPO_EQUAL
                                            : EBPO_INTERSECTING;
    for (int m = 0; m < 2; m++)
        if (is_mixed(r) && !r->two.solid[m] && !r->only[m] && (r->both || r->touch))
            return m ? EBPO_B_INSIDE_A : EBPO_A_INSIDE_B;
    if (!r->both)
        return r->touch ? EBPO_TOUCHING : EBPO_DISJOINT;
    if (is_mixed(r) || (r->only[0] && r->only[1]))
        return EBPO_INTERSECTING;
    return r->only[0] ? EBPO_B_INSIDE_A : r->only[1] ? EBPO_A_INSIDE_B : EBPO_EQUAL;
}

/* Returns the relation with the models exchanged. */
static ebpo_relation swap_relation(ebpo_relation r)
{
    return r == EBPO_A_INSIDE_B ? EBPO_B_INSIDE_A : r == EBPO_B_INSIDE_A ? EBPO_A_INSIDE_B : r;
}

/* Returns true if the boxes of both models are disjoint. */
static bool are_boxes_apart(const ebpo_two_models *two)
{
    const double *a = two->model[0].box, *b = two->model[1].box;
    return ebpo_box_gap(a, a + 3, b, b + 3) > 0;
}

/* Sets r->both, r->only and r->touch, from which relation_of computes the relation. */
static ebpo_status find_relation(relation_search *r, ebpo_error *error)
{
    const ebpo_collision *q = r->collision;
    ebpo_status status = ebpo_two_models_begin(&r->two, &r->lookup, error);
    if (status != EBPO_OK)
        return status;
    r->out->contact = are_boxes_apart(&r->two) ? 0 : -1;
    if (r->out->contact == 0)
        return EBPO_OK;
    for (int m = 0; m < 2; m++) {
        uint64_t count = face_count(r, m);
        r->intersecting[m] = make_bits(count);
        r->seen[m] = make_bits(count);
        if (!r->intersecting[m] || !r->seen[m])
            return fail_bits(count, error);
    }
    if (!is_same(q))
        return examine_models(r, error);
    find_any(r);
    return r->status;
}

/* Adds the loads of this query to the collider's count of loads. Sets the collider's count of bytes
 * to count_before plus the bytes that have been read since the beginning of this query. The sum
 * replaces the count, because the queries that this query has made have already increased the
 * count. At the beginning of this query, count_before was the collider's count of bytes, and
 * read_before was the number of bytes that had been read from the files. */
static void count_loads(const relation_search *r, uint64_t count_before, uint64_t read_before)
{
    ebpo_collider *c = r->collision->collider;
    c->loads += ebpo_two_models_loads(&r->two);
    c->bytes_read = count_before + ebpo_collision_bytes_read(r->collision) - read_before;
}

/* Frees the state of the search. */
static void end_search(relation_search *r)
{
    ebpo_two_models_end(&r->two);
    ebpo_pair_faces_end(&r->lookup);
    for (int m = 0; m < 2; m++) {
        free(r->intersecting[m]);
        free(r->seen[m]);
    }
}

ebpo_status ebpo_collide_relation(ebpo_collider *c, const ebpo_collide_options *options,
                                  ebpo_relation_result *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_collision q;
    *out = (ebpo_relation_result){ EBPO_RELATION_UNDECIDED, -1 };
    ebpo_status status = ebpo_collision_begin(&q, c, options, error);
    relation_search r = { .collision = &q, .out = out, .error = error };
    if (status == EBPO_OK)
        status = ebpo_pair_faces_begin(&r.lookup, &q, error);
    if (status != EBPO_OK)
        return status;
    uint64_t count_before = c->bytes_read, read_before = ebpo_collision_bytes_read(&q);
    status = find_relation(&r, error);
    ebpo_relation relation = relation_of(&r);
    out->relation = (int32_t)(q.swapped ? swap_relation(relation) : relation);
    count_loads(&r, count_before, read_before);
    end_search(&r);
    return status;
}
