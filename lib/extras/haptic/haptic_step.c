/* Moves the proxy in a haptic step towards the position of the device. The proxy is the centre of a
 * ball that stays outside of the model. Its path consists of straight pieces: a piece ends where
 * the ball comes into contact, and the next piece follows the contacts.
 *
 * Each piece is computed in two passes. The first pass finds by distances where the ball stops. The
 * second pass checks by exact arithmetic that the centre has crossed no face. If very many faces
 * are around the ball, a piece is completed in later haptic steps.
 *
 * This file also takes over the boxes (sets of loaded faces, face_box.h) of the loading thread, and
 * finds the nearest face. It computes the smooth normal, which changes continuously with the
 * position of the proxy. */
#include "core/strict_fp.h"

#include <math.h>
#include <string.h>

#include "extras/haptic/face_box.h"
#include "extras/haptic/haptic_parts.h"
#include "geometry/vec3.h"

static void swap_boxes(ebpo_haptic *t)
{
    unsigned before = t->current_box;
    t->current_box = t->previous_box;
    t->previous_box = before;
}

bool ebpo_haptic_take_box(ebpo_haptic *t)
{
    if (!(atomic_load_explicit(&t->waiting_box, memory_order_relaxed) & EBPO_HAPTIC_FRESH))
        return false;
    unsigned received =
        atomic_exchange_explicit(&t->waiting_box, t->previous_box, memory_order_acq_rel);
    t->previous_box = received & ~(unsigned)EBPO_HAPTIC_FRESH;
    if (!ebpo_extent_holds(&t->box[t->previous_box].allowed, t->proxy))
        return false; /* the box was made for another position */
    swap_boxes(t);
    t->stats.taken++;
    return true;
}

void ebpo_haptic_try_previous_box(ebpo_haptic *t)
{
    if (ebpo_extent_holds(&t->box[t->previous_box].allowed, t->proxy))
        swap_boxes(t);
}

/* --- the nearest face --- */

/* The search for the faces around the proxy. */
typedef struct face_search {
    ebpo_haptic *t;
    const ebpo_face_box *box;
    ebpo_near_queue queue;
    double search_radius; /* all faces closer to the ball than this distance have been found */
    double nearest;       /* distance from the centre to the nearest face */
    uint32_t visited_faces;
    uint32_t count; /* number of entries of t->found */
    ebpo_haptic_ball_result *out;
} face_search;

/* Adds the normal of a face to `sum`, weighted by the face's area and by a factor that decreases to
 * 0 at the search radius. The normal of a solid's face points outwards; the normal of a surface's
 * face is turned to the proxy's side. gap: distance of the face from the ball. */
static void add_normal(const face_search *a, uint32_t number, double gap, double sum[3])
{
    const double(*face)[3] = (const double(*)[3])a->box->corner[number];
    bool solid = a->t->part[a->box->instance[number]].solid;
    double e[3], f[3], n[3], d[3];
    double far = fmax(gap, 0) / a->search_radius, weight = (1 - far) * (1 - far);
    ebpo_vec3_subtract(face[1], face[0], e);
    ebpo_vec3_subtract(face[2], face[0], f);
    ebpo_vec3_subtract(a->t->proxy, face[0], d);
    ebpo_vec3_cross(e, f, n);
    if (!solid && ebpo_vec3_dot(n, d) < 0)
        weight = -weight;
    for (int i = 0; i < 3; i++)
        sum[i] += weight * n[i];
}

/* Adds a face to t->found if it is within the search radius, and updates the nearest face. */
static void add_face(face_search *a, uint64_t f)
{
    const double(*face)[3] = (const double(*)[3])a->box->corner[f];
    ebpo_face_near near;
    ebpo_face_nearest(a->t->proxy, face, &near);
    double gap = near.distance - a->t->options.radius;
    a->visited_faces++;
    if (!(gap < a->t->options.search_radius))
        return;
    a->t->found[a->count] = (uint32_t)f;
    a->t->gap[a->count++] = gap;
    if (near.distance >= a->nearest)
        return;
    a->nearest = near.distance;
    ebpo_vec3_copy(near.away, a->t->away);
    a->out->face = a->box->face[f];
    a->out->instance = a->box->instance[f];
    for (int i = 0; i < 3; i++) {
        a->out->weight[i] = near.weight[i];
        a->out->point[i] = a->t->proxy[i] - near.distance * near.away[i];
    }
}

/* Adds a node to the queue if faces in it may be within the search radius. */
static void push_node(face_search *a, uint64_t node)
{
    const ebpo_extent *e = &a->box->node[node];
    double off[3];
    for (int i = 0; i < 3; i++)
        off[i] = fmax(0, fmax(e->min[i] - a->t->proxy[i], a->t->proxy[i] - e->max[i]));
    double least = sqrt(ebpo_vec3_dot(off, off)) * (1 - 0x1p-48);
    if (least < a->t->options.radius + a->t->options.search_radius)
        ebpo_near_push(&a->queue, least, node);
}

/* Finds the faces around the ball, the nearest first. If there are too many, omits the farthest,
 * and reduces a->search_radius so that the normal uses only faces that are closer than every
 * omitted face. */
static void find_faces(face_search *a)
{
    for (uint32_t visits = 0; a->queue.count > 0; visits++) {
        if (visits >= EBPO_HAPTIC_VISITS ||
            a->visited_faces + EBPO_FACE_BOX_LEAF > EBPO_HAPTIC_FACES) {
            a->out->flags |= EBPO_HAPTIC_FACES_OMITTED;
            a->search_radius = fmin(a->search_radius, a->queue.item[0].key - a->t->options.radius);
            return;
        }
        uint64_t node = ebpo_near_pop(&a->queue).node;
        if (node < a->box->leaves) {
            push_node(a, 2 * node);
            push_node(a, 2 * node + 1);
            continue;
        }
        uint64_t f = (node - a->box->leaves) * EBPO_FACE_BOX_LEAF, end = f + EBPO_FACE_BOX_LEAF;
        for (; f < end && f < a->box->count; f++)
            add_face(a, f);
    }
}

/* Returns true if the box of the model is outside the search radius. */
static bool has_no_face_close(const ebpo_haptic *t)
{
    double wide = t->options.radius + t->options.search_radius;
    for (int i = 0; i < 3; i++)
        if (t->proxy[i] - wide > t->root.max[i] || t->proxy[i] + wide < t->root.min[i])
            return true;
    return false;
}

/* Computes the smooth normal: the normalised sum of the normals of the faces around the ball. If
 * the sum is 0 and the object is a ball (EBPO_HAPTIC_BALL), the result is the direction away from
 * the nearest face. */
static void report_normal(const face_search *a, double out[3])
{
    double sum[3] = { 0 };
    for (uint32_t i = 0; i < a->count; i++)
        if (a->t->gap[i] < a->search_radius)
            add_normal(a, a->t->found[i], a->t->gap[i], sum);
    double length = sqrt(ebpo_vec3_dot(sum, sum));
    if (!(length > 0) && a->count > 0 && a->t->options.kind == EBPO_HAPTIC_BALL) {
        ebpo_vec3_subtract(a->t->proxy, a->out->point, sum);
        length = sqrt(ebpo_vec3_dot(sum, sum));
    }
    for (int i = 0; i < 3; i++)
        out[i] = length > 0 ? sum[i] / length : 0;
}

void ebpo_haptic_find_nearest(ebpo_haptic *t, ebpo_haptic_ball_result *out)
{
    face_search a = { .t = t,
                      .box = &t->box[t->current_box],
                      .queue = { t->nearest_queue, 0 },
                      .search_radius = t->options.search_radius,
                      .nearest = INFINITY,
                      .out = out };
    out->face = EBPO_NO_FACE;
    if (!ebpo_extent_holds(&a.box->allowed, t->proxy)) {
        if (!has_no_face_close(t))
            out->flags |= EBPO_HAPTIC_FACES_OMITTED;
    } else if (a.box->count > 0) {
        push_node(&a, 1);
        find_faces(&a);
    }
    out->work += a.visited_faces;
    report_normal(&a, out->normal);
    out->depth = -fmin(t->options.search_radius, a.nearest - t->options.radius);
}

/* --- the path --- */

/* The path of the proxy in one haptic step. */
typedef struct path_step {
    ebpo_haptic *t;
    const double *goal;                   /* [3] */
    double motion[3], slack, least_slack; /* members of ebpo_ball_motion for the current piece */
    uint32_t flags;                       /* bits of ebpo_haptic_flag, for the caller */
    ebpo_ball_work *work;
} path_step;

static void box_of_path(const double p[3], const double motion[3], double wider, ebpo_extent *out)
{
    for (int i = 0; i < 3; i++) {
        out->min[i] = fmin(p[i], p[i] + motion[i]) - wider;
        out->max[i] = fmax(p[i], p[i] + motion[i]) + wider;
    }
}

static bool are_apart(const ebpo_extent *a, const ebpo_extent *b)
{
    for (int i = 0; i < 3; i++)
        if (a->min[i] > b->max[i] || a->max[i] < b->min[i])
            return true;
    return false;
}

static void shorten_motion(double motion[3], double fraction)
{
    for (int i = 0; i < 3; i++)
        motion[i] *= fraction;
}

/* Returns the fraction, 0 to 1, of the path from p that is in `e`; p must be in `e`. The fraction
 * is rounded down, so that the computed end is in `e`, too. */
static double fraction_inside(const double p[3], const double motion[3], const ebpo_extent *e)
{
    double fraction = 1;
    for (int i = 0; i < 3; i++) {
        double to = p[i] + motion[i];
        if (to > e->max[i])
            fraction = fmin(fraction, (e->max[i] - p[i]) / motion[i]);
        else if (to < e->min[i])
            fraction = fmin(fraction, (e->min[i] - p[i]) / motion[i]);
    }
    return fraction < 1 ? fmax(0, fraction * (1 - 0x1p-20)) : 1;
}

double ebpo_haptic_loaded_part(const ebpo_haptic *t, const double motion[3], double distance)
{
    const ebpo_extent *allowed = &t->box[t->current_box].allowed;
    ebpo_extent all;
    box_of_path(t->proxy, motion, distance, &all);
    if (are_apart(&all, &t->root))
        return 1;
    return ebpo_extent_holds(allowed, t->proxy) ? fraction_inside(t->proxy, motion, allowed) : 0;
}

/* Shortens the piece so that all faces around it are loaded. Returns false if no box contains the
 * proxy. */
static bool shorten_to_loaded(path_step *s)
{
    ebpo_haptic *t = s->t;
    double fraction = ebpo_haptic_loaded_part(t, s->motion, t->contact_distance + t->band);
    if (fraction < 1) {
        t->end_flags = EBPO_HAPTIC_WAITING;
        shorten_motion(s->motion, fraction);
    }
    if (fraction <= 0 && !ebpo_extent_holds(&t->box[t->current_box].allowed, t->proxy)) {
        s->flags |= EBPO_HAPTIC_WAITING;
        return false;
    }
    return true;
}

static bool vectors_differ(const double a[3], const double b[3])
{
    return a[0] != b[0] || a[1] != b[1] || a[2] != b[2];
}

/* Begins the next piece. Returns false if the proxy must stay at its position. */
static bool begin_piece(path_step *s)
{
    ebpo_haptic *t = s->t;
    ebpo_ball_walk *w = &t->walk;
    double want[3];
    (void)ebpo_haptic_take_box(t);
    if (memcmp(t->contact_position, t->proxy, sizeof t->contact_position) != 0)
        t->contact_planes.count = 0;
    ebpo_vec3_subtract(s->goal, t->proxy, want);
    s->slack = ebpo_project_motion(&t->contact_planes, want, s->motion);
    if (vectors_differ(s->motion, want))
        s->flags |= EBPO_HAPTIC_CONTACT;
    s->least_slack = 0x1p-44 * sqrt(ebpo_vec3_dot(want, want));
    double full_length = sqrt(ebpo_vec3_dot(s->motion, s->motion));
    if (full_length <= 0x1p-12 * t->options.skin)
        return false;
    t->end_flags = 0;
    if (!shorten_to_loaded(s))
        return false;
    /* s->slack and s->least_slack belong to the whole path to the device; scale them to this piece
     */
    double share = sqrt(ebpo_vec3_dot(s->motion, s->motion)) / full_length;
    const ebpo_face_box *box = &t->box[t->current_box];
    ebpo_vec3_copy(t->proxy, w->from);
    ebpo_vec3_copy(s->motion, w->motion);
    /* NULL: the whole piece is away from all faces (shorten_to_loaded) */
    w->box = ebpo_extent_holds(&box->allowed, t->proxy) ? box : NULL;
    w->contact_distance = t->contact_distance;
    w->band = t->band;
    w->slack = s->slack * share;
    w->least_slack = s->least_slack * share;
    ebpo_ball_begin(w);
    return true;
}

/* Makes space for more planes: drops the planes from which the last piece moved away. If the list
 * is still full, drops the last plane, because three planes are enough to hold the proxy. */
static void reserve_space(ebpo_held_planes *along, const double motion[3])
{
    double length = sqrt(ebpo_vec3_dot(motion, motion));
    int kept = 0;
    for (int i = 0; i < along->count; i++)
        if (ebpo_vec3_dot(along->normal[i], motion) <= 0x1p-30 * length)
            ebpo_vec3_copy(along->normal[i], along->normal[kept++]);
    along->count = kept < EBPO_PLANES_LIMIT ? kept : kept - 1;
}

/* Adds the contacts at the end of the piece to t->contact_planes. Drops earlier contacts if the
 * ball has moved. */
static void add_planes(ebpo_haptic *t)
{
    const ebpo_ball_walk *w = &t->walk;
    if (w->fraction > 0)
        t->contact_planes.count = 0;
    else if (t->contact_planes.count + w->contacts.count > EBPO_PLANES_LIMIT)
        reserve_space(&t->contact_planes, w->motion);
    for (int i = 0; i < w->contacts.count; i++)
        ebpo_held_planes_add(&t->contact_planes, w->contacts.normal[i]);
    ebpo_vec3_copy(t->proxy, t->contact_position);
}

/* Ends the piece: moves the proxy, and updates contacts and flags. Returns true if the ball is in
 * contact at the end, so that another piece along the contacts follows. */
static bool end_piece(path_step *s)
{
    ebpo_haptic *t = s->t;
    const ebpo_ball_walk *w = &t->walk;
    bool touches = !w->work_limited && w->fraction < 1;
    if (w->fraction > 0) {
        ebpo_vec3_copy(w->to, t->proxy);
        ebpo_vec3_copy(w->to, t->path[t->path_count++]);
    }
    if (touches)
        add_planes(t);
    s->flags |= touches           ? EBPO_HAPTIC_CONTACT
                : w->work_limited ? EBPO_HAPTIC_PATH_UNFINISHED
                                  : t->end_flags;
    t->holding_planes = t->contact_planes;
    t->has_complete_piece = true;
    return touches;
}

/* Returns EBPO_HAPTIC_CONTACT if no piece towards the current position of the device is complete
 * yet and the contacts of the last complete piece keep the proxy from the device. Returns 0 in
 * other cases. */
static uint32_t held_flags(const path_step *s)
{
    const ebpo_haptic *t = s->t;
    double want[3], motion[3];
    if (t->has_complete_piece)
        return 0;
    ebpo_vec3_subtract(s->goal, t->proxy, want);
    (void)ebpo_project_motion(&t->holding_planes, want, motion);
    return vectors_differ(motion, want) ? EBPO_HAPTIC_CONTACT : 0;
}

/* Follows pieces towards the goal. If an earlier haptic step began a piece, first completes this
 * piece, which leads to an earlier position of the device. Returns bits of ebpo_haptic_flag. */
static uint32_t follow_pieces(path_step *s)
{
    ebpo_haptic *t = s->t;
    bool resumed = t->walk.stage != EBPO_BALL_IDLE;
    for (int piece = 0; piece < EBPO_HAPTIC_PIECES; piece++) {
        if (t->walk.stage == EBPO_BALL_IDLE && !begin_piece(s))
            return s->flags;
        ebpo_ball_end end = ebpo_ball_continue(&t->walk, s->work);
        if (end == EBPO_BALL_UNFINISHED)
            return s->flags | EBPO_HAPTIC_PATH_UNFINISHED | held_flags(s);
        if (end == EBPO_BALL_CROSSED)
            return s->flags | EBPO_HAPTIC_PATH_UNFINISHED;
        if (!end_piece(s)) {
            if (!resumed)
                return s->flags;
            s->flags = 0; /* these flags describe the path to the earlier position */
            t->has_complete_piece = false;
        }
        resumed = false;
    }
    return s->flags | EBPO_HAPTIC_PATH_UNFINISHED;
}

uint32_t ebpo_haptic_move_ball(ebpo_haptic *t, const double goal[3], ebpo_ball_work *work)
{
    path_step s = { .t = t, .goal = goal, .work = work };
    double remaining[3];
    t->has_complete_piece = false;
    t->path_count = 0;
    ebpo_vec3_copy(t->proxy, t->path[t->path_count++]);
    uint32_t flags = follow_pieces(&s);
    ebpo_vec3_subtract(goal, t->proxy, remaining);
    bool arrived = sqrt(ebpo_vec3_dot(remaining, remaining)) <= 0x1p-12 * t->options.skin;
    return arrived ? flags & ~(uint32_t)EBPO_HAPTIC_CONTACT : flags;
}
