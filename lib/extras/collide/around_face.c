/* Finds which sides of a posed face are in the interior of each of two models. The face belongs to
 * one of these models. All faces of both models that intersect the face cut it into pieces
 * (face_pieces.h). The winding numbers of both models at a point of a piece show which sides of the
 * piece are in which model.
 *
 * All decisions are exact: coordinates of points are fractions, and posed coordinates are the
 * doubles that geometry/pose.h defines. Only faces close to a point or face are read from the
 * models' hierarchies, so a model may be loaded subtree by subtree. Proofs:
 * docs/develop/collision.md, "Relation of two models". */
#include "core/strict_fp.h"

#include "extras/collide/around_face.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "extras/collide/posed_solid.h"
#include "geometry/vec3.h"
#include "geometry/predicates.h"
#include "geometry/level_nodes.h"

ebpo_status ebpo_two_models_begin(ebpo_two_models *two, ebpo_pair_faces *lookup, ebpo_error *error)
{
    const ebpo_collision *q = lookup->collision;
    ebpo_status status = EBPO_OK;
    *two = (ebpo_two_models){ 0 };
    for (int i = 0; i < 2 && status == EBPO_OK; i++) {
        int callers = (int)q->swapped ^ i; /* index of the query's model i in the caller's order */
        const ebpo_pose *pose = callers ? &q->options.pose_b : &q->options.pose_a;
        two->faces[i] = &lookup->side[callers];
        two->solid[i] = q->model[i]->info->solid;
        two->rule[i] = q->model[i]->info->rule;
        status = ebpo_posed_solid_make(&two->model[i], q->model[i], pose, error);
        if (status == EBPO_OK)
            status = ebpo_context_new(q->model[i], &two->context[i], error);
    }
    return status;
}

void ebpo_two_models_end(ebpo_two_models *two)
{
    for (int i = 0; i < 2; i++)
        ebpo_context_free(two->context[i]);
    ebpo_face_cuts_free(&two->pieces);
    ebpo_face_cuts_free(&two->others);
}

void ebpo_two_models_let_go(ebpo_two_models *two)
{
    for (int i = 0; i < 2; i++)
        ebpo_context_let_go(two->context[i]);
}

uint64_t ebpo_two_models_loads(const ebpo_two_models *two)
{
    uint64_t loads = 0;
    for (int i = 0; i < 2; i++)
        loads += two->context[i] ? two->context[i]->loaded : 0;
    return loads;
}

ebpo_status ebpo_two_models_face(const ebpo_two_models *two, int m, uint64_t face, double out[3][3],
                                 bool *has_area, ebpo_error *error)
{
    double unposed[3][3];
    ebpo_status status = ebpo_faces_by_number_get(two->faces[m], face, unposed, error);
    for (int k = 0; k < 3 && status == EBPO_OK; k++)
        ebpo_posing_apply(&two->model[m].posing, unposed[k], out[k]);
    *has_area = status == EBPO_OK && !ebpo_zero_area(out[0], out[1], out[2]);
    return status;
}

/* --- faces that intersect a face --- */

/* The search for the faces that cut a face. */
typedef struct cut_search {
    const ebpo_two_models *two;
    ebpo_face_cuts *pieces; /* receives the cuts */
    double low[3], high[3]; /* box of the cut face */
    int model;              /* index of the model whose faces are visited */
    uint64_t cut_index;     /* index of the cut face, which does not cut itself; EBPO_NO_FACE: the
                             * cut face belongs to the other model */
} cut_search;

/* Returns true if the box of the face t intersects the box of the cut face. */
static bool boxes_intersect(const cut_search *c, const double t[3][3])
{
    for (int k = 0; k < 3; k++)
        if (ebpo_max3(t[0][k], t[1][k], t[2][k]) < c->low[k] ||
            ebpo_min3(t[0][k], t[1][k], t[2][k]) > c->high[k])
            return false;
    return true;
}

/* Adds the cuts of those triangles whose boxes intersect the box of the cut face. Returns true, so
 * that all triangles are visited. */
static bool add_cuts(void *user, const ebpo_triangles *triangles)
{
    const cut_search *c = user;
    for (uint64_t i = 0; i < triangles->count; i++) {
        double t[3][3];
        if (triangles->file_faces[i] == c->cut_index)
            continue;
        for (int k = 0; k < 3; k++)
            ebpo_posing_apply(&c->two->model[c->model].posing, triangles->corners[i][k], t[k]);
        if (boxes_intersect(c, (const double(*)[3])t))
            ebpo_face_cuts_add(c->pieces, (const double(*)[3])t, c->model);
    }
    return true;
}

/* Cuts a face of model m, whose posed corners are `t`, by all faces that intersect it. */
static ebpo_status cut_face(ebpo_two_models *two, ebpo_face_cuts *pieces, int m, uint64_t face,
                            const double t[3][3], ebpo_error *error)
{
    cut_search c = { .two = two, .pieces = pieces };
    ebpo_status status = EBPO_OK;
    for (int k = 0; k < 3; k++) {
        c.low[k] = ebpo_min3(t[0][k], t[1][k], t[2][k]);
        c.high[k] = ebpo_max3(t[0][k], t[1][k], t[2][k]);
    }
    for (int i = 0; i < 2 && status == EBPO_OK; i++) {
        double low[3], high[3];
        ebpo_unpose_box(&two->model[i], c.low, c.high, low, high);
        c.model = i;
        c.cut_index = i == m ? face : EBPO_NO_FACE;
        status = ebpo_triangles_in_box(two->context[i], low, high, add_cuts, &c, error);
    }
    return status;
}

/* --- winding numbers --- */

/* A visit of all pieces of a face. */
typedef struct piece_visit {
    ebpo_two_models *two;
    const ebpo_face_cuts *pieces; /* the cuts of the face */
    int m;                        /* index of the model to which the face belongs */
    ebpo_around_fn visit;         /* the function that is called for each piece, and its argument */
    void *user;
    bool only_at_target; /* visit only pieces that contain the target of `pieces` */
} piece_visit;

/* ebpo_exact_winding shifts a point by an infinitesimal vector. Returns true if this vector leads
 * from a point of the face to the front of the face. */
static bool shift_is_front(const ebpo_face_cuts *f)
{
    int sign = 0;
    for (int k = 0; k < 3 && sign == 0; k++)
        sign = mpq_sgn(f->normal[k]);
    return sign > 0;
}

/* Sets *in to the sides of a piece that are in the interior of solid i. The winding number behind
 * the piece minus the winding number in front of it is `jump`. The face itself contributes 1 to
 * `jump` if it is a face of solid i. */
static ebpo_status sides_of_solid(const piece_visit *v, const ebpo_piece *piece, int i,
                                  unsigned *in, ebpo_error *error)
{
    ebpo_two_models *two = v->two;
    int32_t winding, jump = piece->jump[i] + (i == v->m);
    ebpo_status status =
        ebpo_exact_winding(&two->model[i], two->context[i], piece->x, &winding, error);
    int32_t front = shift_is_front(v->pieces) ? winding : winding - jump;
    *in = (ebpo_rule_inside(two->rule[i], front) ? EBPO_SIDE_FRONT : 0u) |
          (ebpo_rule_inside(two->rule[i], front + jump) ? EBPO_SIDE_BACK : 0u);
    return status;
}

/* Finds which sides of a piece are in each model, and calls the function v->visit. Returns
 * EBPO_E_CANCELLED if v->visit returns false, because v->visit needs no more pieces. */
static ebpo_status visit_around_piece(void *user, const ebpo_piece *piece, ebpo_error *error)
{
    const piece_visit *v = user;
    ebpo_around around;
    ebpo_status status = EBPO_OK;
    if (v->only_at_target && !piece->at_target)
        return EBPO_OK;
    for (int i = 0; i < 2 && status == EBPO_OK; i++) {
        if (v->two->solid[i])
            status = sides_of_solid(v, piece, i, &around.in[i], error);
        else
            around.in[i] = piece->covered[i] || i == v->m ? EBPO_SIDE_BOTH : 0;
    }
    if (status == EBPO_OK && !v->visit(v->user, &around))
        return EBPO_E_CANCELLED;
    return status;
}

/* Visits the pieces. EBPO_E_CANCELLED ends the visit early, which is not a failure. */
static ebpo_status visit_pieces(piece_visit *v, ebpo_face_cuts *pieces, ebpo_error *error)
{
    ebpo_status status = ebpo_face_pieces_visit(pieces, visit_around_piece, v, error);
    return status == EBPO_E_CANCELLED ? EBPO_OK : status;
}

ebpo_status ebpo_visit_around_face(ebpo_two_models *two, int m, uint64_t face, ebpo_around_fn visit,
                                   void *user, ebpo_error *error)
{
    double t[3][3];
    bool has_area;
    ebpo_status status = ebpo_two_models_face(two, m, face, t, &has_area, error);
    if (status != EBPO_OK || !has_area)
        return status;
    ebpo_face_cuts_begin(&two->pieces, (const double(*)[3])t, false);
    status = cut_face(two, &two->pieces, m, face, (const double(*)[3])t, error);
    piece_visit v = { two, &two->pieces, m, visit, user, false };
    return status == EBPO_OK ? visit_pieces(&v, &two->pieces, error) : status;
}

/* --- points of the models with their boundaries --- */

/* Faces of a model whose boxes may contain a point. */
typedef struct faces_at {
    uint64_t *face; /* [count] indices of the faces in the file */
    uint64_t count, capacity;
    bool no_memory; /* an allocation has failed */
} faces_at;

/* Adds the indices of triangles. Returns false if memory is short. */
static bool record_faces(void *user, const ebpo_triangles *triangles)
{
    faces_at *n = user;
    n->no_memory = !ebpo_grow(&n->face, &n->capacity, n->count + triangles->count, sizeof *n->face);
    for (uint64_t i = 0; i < triangles->count && !n->no_memory; i++)
        n->face[n->count++] = triangles->file_faces[i];
    return !n->no_memory;
}

/* Finds the faces of model m whose posed boxes may contain the point x. */
static ebpo_status find_faces(ebpo_two_models *two, int m, const mpq_t x[3], faces_at *n,
                              ebpo_error *error)
{
    double corner[2][3], low[3], high[3];
    for (int k = 0; k < 3; k++) {
        corner[0][k] = nextafter(mpq_get_d(x[k]), -INFINITY);
        corner[1][k] = nextafter(mpq_get_d(x[k]), INFINITY);
    }
    ebpo_unpose_box(&two->model[m], corner[0], corner[1], low, high);
    ebpo_status status = ebpo_triangles_in_box(two->context[m], low, high, record_faces, n, error);
    if (status == EBPO_OK && n->no_memory)
        status = ebpo_fail_memory(error, n->count * sizeof *n->face);
    return status;
}

/* Decides if model m contains a point, from the faces of model m that contain the point. */
typedef struct face_query {
    ebpo_two_models *two;
    int m;
    bool in; /* the model contains the point: a side of a piece that has the point is in the model
              */
    bool on; /* a face with an area contains the point */
} face_query;

/* Sets q->in if a side of a piece is in model m. Returns false then, because further pieces cannot
 * change the result. */
static bool record_side(void *user, const ebpo_around *around)
{
    face_query *q = user;
    q->in = around->in[q->m] != 0;
    return !q->in;
}

/* Examines a face that may contain the point x. Sets q->on if the face contains the point. Then
 * also sets q->in if a side of the face at the point is in the model. */
static ebpo_status query_face(face_query *q, uint64_t face, const mpq_t x[3], ebpo_error *error)
{
    double t[3][3];
    bool has_area;
    ebpo_two_models *two = q->two;
    ebpo_status status = ebpo_two_models_face(two, q->m, face, t, &has_area, error);
    if (status != EBPO_OK || !has_area)
        return status;
    ebpo_face_cuts_begin(&two->others, (const double(*)[3])t, true);
    if (!ebpo_face_cuts_target(&two->others, x))
        return EBPO_OK;
    q->on = true;
    q->in = !two->solid[q->m]; /* a surface contains all points of its faces */
    if (!q->in)
        status = cut_face(two, &two->others, q->m, face, (const double(*)[3])t, error);
    piece_visit v = { two, &two->others, q->m, record_side, q, true };
    return status == EBPO_OK && !q->in ? visit_pieces(&v, &two->others, error) : status;
}

/* Sets *has to true if model m or its boundary contains the point x. */
static ebpo_status has_point(ebpo_two_models *two, int m, const mpq_t x[3], bool *has,
                             ebpo_error *error)
{
    face_query q = { .two = two, .m = m };
    faces_at faces = { 0 };
    int32_t winding = 0;
    ebpo_status status = find_faces(two, m, x, &faces, error);
    for (uint64_t i = 0; i < faces.count && status == EBPO_OK && !q.in; i++)
        status = query_face(&q, faces.face[i], x, error);
    free(faces.face);
    if (status == EBPO_OK && !q.on && two->solid[m]) {
        status = ebpo_exact_winding(&two->model[m], two->context[m], x, &winding, error);
        q.in = ebpo_rule_inside(two->rule[m], winding);
    }
    *has = q.in;
    return status;
}

/* The search for a vertex of a face's pieces that both models contain. */
typedef struct common_point_search {
    ebpo_two_models *two;
    bool *has; /* output: both models contain a visited vertex */
} common_point_search;

/* Tests a vertex of the pieces; ends the visits with EBPO_E_CANCELLED if both models contain it. */
static ebpo_status test_vertex(void *user, const mpq_t x[3], ebpo_error *error)
{
    const common_point_search *c = user;
    bool in[2] = { false, false };
    ebpo_status status = has_point(c->two, 0, x, &in[0], error);
    if (status == EBPO_OK && in[0])
        status = has_point(c->two, 1, x, &in[1], error);
    *c->has = in[0] && in[1];
    return status == EBPO_OK && *c->has ? EBPO_E_CANCELLED : status;
}

ebpo_status ebpo_face_has_common_point(ebpo_two_models *two, int m, uint64_t face, bool *has,
                                       ebpo_error *error)
{
    double t[3][3];
    bool has_area;
    *has = false;
    ebpo_status status = ebpo_two_models_face(two, m, face, t, &has_area, error);
    if (status != EBPO_OK || !has_area)
        return status;
    ebpo_face_cuts_begin(&two->pieces, (const double(*)[3])t, true);
    status = cut_face(two, &two->pieces, m, face, (const double(*)[3])t, error);
    common_point_search c = { two, has };
    if (status == EBPO_OK)
        status = ebpo_face_pieces_vertices(&two->pieces, test_vertex, &c, error);
    return *has ? EBPO_OK : status;
}
