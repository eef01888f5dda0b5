/* The object of a haptic session: its options and memory, the step of a ball, and where the hand
 * is put.
 *
 * A step moves the proxy towards the hand (touch_step.c), and returns the force of a spring
 * between them, with friction along the surface, held back by the planes that the proxy touches. A
 * step takes no memory, no lock and no file access: all that it uses is made before or is handed
 * over by the loading thread. A hand at infinity or NaN stays where it was.
 *
 * Source: docs/guide/touch.md. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "extras/haptic/tool.h"
#include "extras/haptic/touch_parts.h"
#include "geometry/vec3.h"
#include "query/query_model.h"

void ebpo_touch_tell(ebpo_touch *t, const double hand[3])
{
    for (int i = 0; i < 3; i++) {
        atomic_store_explicit(&t->proxy_told[i], t->proxy[i], memory_order_relaxed);
        atomic_store_explicit(&t->hand_told[i], hand[i], memory_order_relaxed);
    }
}

uint32_t ebpo_touch_stopped(const ebpo_touch *t)
{
    return atomic_load_explicit(&t->stopped, memory_order_acquire) ? EBPO_TOUCH_STOPPED : 0;
}

static bool move_stands(const ebpo_touch *t) { return t->walk.stage == EBPO_BALL_STANDS; }

/* Coulomb: the proxy, which slid from `from` without friction, follows only as far as the
 * tangential part of the spring is more than friction takes. */
static uint32_t move_rub(ebpo_touch *t, const double from[3], const double hand[3],
                         ebpo_ball_work *work)
{
    double slid[3], depth[3], goal[3];
    ebpo_vec3_subtract(t->proxy, from, slid);
    ebpo_vec3_subtract(hand, t->proxy, depth);
    double length = sqrt(ebpo_vec3_dot(slid, slid));
    double holds = t->options.friction * sqrt(ebpo_vec3_dot(depth, depth));
    double part = length > holds ? 1 - holds / length : 0;
    for (int i = 0; i < 3; i++)
        goal[i] = from[i] + part * slid[i] + (part > 0 ? depth[i] : 0);
    ebpo_vec3_copy(from, t->proxy);
    t->way_count = 1;
    if (part > 0)
        return ebpo_touch_go(t, goal, work);
    if (length > 0 && memcmp(from, t->along_at, sizeof t->along_at) == 0)
        t->planes = t->along; /* it is there again */
    return 0;
}

/* From the hand to the proxy; where the proxy waits, what faces hold back of that. */
static void find_depth(const ebpo_touch *t, const double hand[3], uint32_t flags, double out[3])
{
    double want[3], way[3];
    ebpo_vec3_subtract(t->proxy, hand, out);
    if (!(flags & (EBPO_TOUCH_WAITS | EBPO_TOUCH_SHORT)))
        return;
    ebpo_vec3_subtract(hand, t->proxy, want);
    (void)ebpo_hold_back(&t->planes, want, way);
    ebpo_vec3_subtract(way, want, out);
}

/* The way from hand to proxy is not quite along the faces' normals: by what the proxy has still to
 * go, by rounding far from 0, and by friction, which puts it askew. Damping across that way may
 * pull towards faces, and huge damping with all force: what does so is taken out, and the force no
 * greater. What was touched first may be the edge of a face that the ball is beside, by next to
 * nothing: so the nearest face counts, too. A face that the spring itself pulls to is another one
 * of a narrow corner. */
static void keep_from_faces(const ebpo_touch *t, bool near, const double depth[3], double force[3])
{
    ebpo_held_planes off = { .count = 0 };
    double wanted[3];
    if (near && ebpo_vec3_dot(t->away, depth) >= 0)
        ebpo_held_planes_add(&off, t->away);
    for (int i = 0; i < t->planes.count; i++)
        if (ebpo_vec3_dot(t->planes.normal[i], depth) >= 0)
            ebpo_held_planes_add(&off, t->planes.normal[i]);
    ebpo_vec3_copy(force, wanted);
    (void)ebpo_hold_back(&off, wanted, force);
}

void ebpo_touch_count(ebpo_touch *t, uint32_t flags, uint64_t work)
{
    ebpo_touch_stats *s = &t->stats;
    s->ticks++;
    s->contacts += (flags & EBPO_TOUCH_CONTACT) != 0;
    s->waits += (flags & EBPO_TOUCH_WAITS) != 0;
    s->shorts += (flags & EBPO_TOUCH_SHORT) != 0;
    s->partly += (flags & EBPO_TOUCH_PARTLY) != 0;
    s->stopped += (flags & EBPO_TOUCH_STOPPED) != 0;
    s->work_most = work > s->work_most ? work : s->work_most;
    s->given_most = fmax(s->given_most, t->passive.given);
}

void ebpo_touch_move(ebpo_touch *t, const double hand[3], ebpo_touch_result *out)
{
    EBPO_DEFAULT_FP;
    double at[3], from[3], moved[3], along_at[3];
    bool astray = false;
    ebpo_ball_work work = { 0 };
    if (t->options.kind != EBPO_TOUCH_BALL) {
        *out = (ebpo_touch_result){ .face = EBPO_NO_FACE, .flags = EBPO_TOUCH_OTHER };
        return;
    }
    for (int i = 0; i < 3; i++)
        astray |= !(fabs(hand[i]) <= 0x1p200);
    ebpo_vec3_copy(astray ? t->hand : hand, at);
    *out = (ebpo_touch_result){ .flags = astray ? EBPO_TOUCH_ASTRAY : 0 };
    ebpo_vec3_subtract(at, t->hand, moved);
    ebpo_passive_moved(&t->passive, t->force, moved, 3);
    ebpo_vec3_copy(t->proxy, from);
    ebpo_vec3_copy(t->along_at, along_at);
    ebpo_held_planes along = t->along;
    uint32_t flags = ebpo_touch_go(t, at, &work);
    if (t->touching && (flags & EBPO_TOUCH_CONTACT) && t->options.friction > 0 && move_stands(t)) {
        t->along = along;
        ebpo_vec3_copy(along_at, t->along_at);
        flags |= move_rub(t, from, at, &work);
    }
    out->work = work.faces;
    out->flags |= flags | ebpo_touch_stopped(t);
    ebpo_touch_look(t, out);
    t->touching = (flags & EBPO_TOUCH_CONTACT) != 0;
    if (t->touching) {
        double depth[3];
        find_depth(t, at, flags, depth);
        ebpo_passive_push(&t->passive, t->options.damping / t->options.tick, depth, moved, 3,
                          out->force);
        keep_from_faces(t, out->face != EBPO_NO_FACE, depth, out->force);
        out->depth = sqrt(ebpo_vec3_dot(depth, depth));
    }
    ebpo_vec3_copy(t->proxy, out->proxy);
    ebpo_vec3_copy(out->force, t->force);
    ebpo_vec3_copy(at, t->hand);
    if ((flags & EBPO_TOUCH_WAITS) && move_stands(t))
        ebpo_touch_try_other(t);
    ebpo_touch_count(t, out->flags, out->work);
    ebpo_touch_tell(t, at);
}

ebpo_status ebpo_touch_get_stats(const ebpo_touch *t, ebpo_touch_stats *out)
{
    ebpo_touch_stats s = t->stats;
    s.loads = atomic_load(&t->loads);
    s.too_many = atomic_load(&t->too_many);
    s.load_seconds = 1e-9 * (double)atomic_load(&t->load_ns);
    s.load_seconds_most = 1e-9 * (double)atomic_load(&t->load_ns_most);
    s.faces = t->box[t->at].count;
    s.memory = EBPO_TOUCH_BOXES * ebpo_face_box_bytes(t->options.faces);
    s.given = t->passive.given;
    s.step_most = t->passive.step_most;
    if (t->options.kind == EBPO_TOUCH_BALL)
        s.memory += ebpo_ball_walk_bytes(t->options.faces);
    if (t->tool)
        s.memory += ebpo_tool_bytes(t->tool);
    return EBPO_GIVE(ebpo_touch_stats, out, &s);
}

uint32_t ebpo_touch_way(const ebpo_touch *t, double way[EBPO_TOUCH_WAY_MOST][3])
{
    for (uint32_t i = 0; i < t->way_count; i++)
        ebpo_vec3_copy(t->way[i], way[i]);
    return t->way_count;
}

/* --- making the object --- */

static bool is_amount(double x) { return x >= 0 && x <= 0x1p200; }

static ebpo_status check_options(const ebpo_touch_options *o, ebpo_error *error)
{
    if (!is_amount(o->radius) || !is_amount(o->skin) || !is_amount(o->look))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "radius, skin and look must be 0 to 2^200");
    if (!is_amount(o->stiffness) || !is_amount(o->damping) || !is_amount(o->friction))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "stiffness, damping and friction must be 0 to 2^200");
    if (!is_amount(o->tick) || o->tick == 0)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "a tick must take more than 0 seconds, and 2^200 at most");
    if (o->kind > EBPO_TOUCH_TOOL)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "there is no such kind of hand");
    if (o->kind != EBPO_TOUCH_BALL && o->radius != 0)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "only balls have a radius");
    if ((o->kind == EBPO_TOUCH_TOOL) != (o->points != NULL && o->point_count > 0) ||
        o->point_count > EBPO_TOOL_POINTS)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "a tool has 1 to %d points, and only a tool has",
                         EBPO_TOOL_POINTS);
    for (uint64_t i = 0; i < 3 * o->point_count; i++)
        if (!(fabs(o->points[i / 3][i % 3]) <= 0x1p200))
            return ebpo_fail(error, EBPO_E_ARGUMENT, "point %llu of the tool is not finite",
                             (unsigned long long)(i / 3));
    if (o->faces < 64 || o->faces > 1 << 20)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "a box must have room for 64 to 2^20 faces");
    return EBPO_OK;
}

/* What depends on the model: its box, and how close the ball may come to faces. */
static ebpo_status new_measure(ebpo_touch *t, ebpo_error *error)
{
    const ebpo_info *info = ebpo_file_info(t->model->file);
    double most = 0;
    t->solid = info->solid;
    for (int i = 0; i < 3; i++) {
        double low = info->box_origin[i], high = low + info->box_size[i];
        double wider = 0x1p-50 * (fabs(low) + fabs(high)); /* what the sum has lost */
        t->root.min[i] = low - wider;
        t->root.max[i] = high + wider;
        most = fmax(most, fmax(fabs(t->root.min[i]), fabs(t->root.max[i])));
    }
    t->diagonal = ebpo_vec3_scaled_distance(t->root.min, t->root.max);
    if (!(most <= 0x1p200 && t->diagonal >= 0x1p-200))
        return ebpo_fail(error, EBPO_E_UNSUPPORTED,
                         "coordinates are too large or too small to be touched");
    double wide = t->tool ? t->tool->radius * (1 + 0x1p-40) : t->options.radius;
    most += wide; /* where the hand may be when it touches */
    double least = fmax(0x1p-30 * t->diagonal, 0x1p-42 * most);
    if (t->options.skin == 0)
        t->options.skin = fmax((t->tool ? 0x1p-15 : 0x1p-20) * t->diagonal, least);
    if (t->options.skin < least)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the skin must be at least %g, for rounding of coordinates", least);
    if (t->options.look == 0)
        t->options.look = 3 * t->diagonal / sqrt(fmax(1, (double)info->face_count));
    t->options.look = fmax(t->options.look, 4 * t->options.skin);
    t->reach = wide + t->options.skin;
    t->band = fmax(0x1p-24 * t->options.skin, 0x1p-48 * most);
    t->margin = wide + (t->tool ? 4 * t->options.skin : t->options.look);
    t->stride = t->diagonal;
    t->half = fmin(1, sqrt((double)t->options.faces / fmax(1, (double)info->face_count))) *
              t->diagonal / 8;
    return EBPO_OK;
}

static ebpo_status make_parts(ebpo_touch *t, ebpo_error *error)
{
    ebpo_status status = ebpo_context_new(t->model, &t->asking, error);
    if (status == EBPO_OK)
        status = ebpo_context_new(t->model, &t->loading, error);
    for (int i = 0; i < EBPO_TOUCH_BOXES && status == EBPO_OK; i++)
        status = ebpo_face_box_new(&t->box[i], t->options.faces, error);
    if (status == EBPO_OK && t->options.kind == EBPO_TOUCH_BALL)
        status = ebpo_ball_walk_new(&t->walk, t->options.faces, error);
    t->seen = 1;
    t->own = 3;
    atomic_store(&t->between, 2);
    t->own_known = 1;
    atomic_store(&t->known_between, 2);
    if (status == EBPO_OK && t->options.kind == EBPO_TOUCH_PROBE)
        status = ebpo_held_levels_read(t->model->file, &t->levels, error);
    return status;
}

static ebpo_status check_point(ebpo_touch *t, const double place[3], double reach,
                               ebpo_error *error)
{
    ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
    ebpo_distance_result near;
    options.max_distance = reach + t->options.skin / 2;
    ebpo_status status = ebpo_distance(t->asking, place, &options, &near, error);
    if (status == EBPO_OK && near.distance <= options.max_distance && near.distance >= 0)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the hand is %g from a face there; it must be farther than %g",
                         near.distance, options.max_distance);
    if (status != EBPO_OK || !t->solid)
        return status;
    ebpo_inside_result inside;
    status = ebpo_inside(t->asking, place, NULL, &inside, error);
    return status != EBPO_OK || inside.where == EBPO_OUT
               ? status
               : ebpo_fail(error, EBPO_E_ARGUMENT, "the place is in the solid; begin outside");
}

/* Anywhere for a probe; a tool with its axes along the model's. */
static ebpo_status check_place(ebpo_touch *t, const double place[3], ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < 3; i++)
        if (!(fabs(place[i]) <= 0x1p200))
            return ebpo_fail(error, EBPO_E_ARGUMENT, "the place must be three finite numbers");
    if (t->options.kind == EBPO_TOUCH_BALL)
        return check_point(t, place, t->reach, error);
    for (uint64_t i = 0; t->tool && i < t->tool->count && status == EBPO_OK; i++) {
        double at[3];
        for (int k = 0; k < 3; k++)
            at[k] = place[k] + t->tool->point[i][k];
        status = check_point(t, at, t->options.skin, error);
    }
    return status;
}

/* The box before counts, too: it may be the last one that was loaded, which a tick has laid aside
 * as it was made for another place, and then there comes no other for this one. */
static bool has_box(ebpo_touch *t)
{
    if (ebpo_extent_holds(&t->box[t->at].centres, t->proxy) || ebpo_touch_take_box(t))
        return true;
    ebpo_touch_try_other(t);
    return ebpo_extent_holds(&t->box[t->at].centres, t->proxy);
}

/* Until a box holds the proxy. */
static ebpo_status await_box(ebpo_touch *t, ebpo_error *error)
{
    const struct timespec short_time = { 0, 100000 };
    while (!has_box(t)) {
        ebpo_status status = ebpo_touch_check(t, error);
        if (status != EBPO_OK)
            return status;
        nanosleep(&short_time, NULL);
    }
    return EBPO_OK;
}

ebpo_status ebpo_touch_place(ebpo_touch *t, const double place[3], ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    double proxy[3], hand[3];
    ebpo_vec3_copy(t->proxy, proxy);
    ebpo_vec3_copy(t->hand, hand);
    ebpo_status status = check_place(t, place, error);
    if (status != EBPO_OK)
        return status;
    t->walk.stage = EBPO_BALL_STANDS; /* also where this fails: it goes on from where it is */
    ebpo_vec3_copy(place, t->proxy);
    ebpo_vec3_copy(place, t->hand);
    ebpo_touch_tell(t, place);
    if (!t->has_thread)
        status = ebpo_touch_loader_start(t, error);
    if (status == EBPO_OK)
        status = await_box(t, error);
    if (status != EBPO_OK) {
        ebpo_vec3_copy(proxy, t->proxy);
        ebpo_vec3_copy(hand, t->hand);
        ebpo_touch_tell(t, hand);
        return status;
    }
    t->side.known = false;
    if (t->tool) {
        ebpo_rigid there = { .turn = { 0, 0, 0, 1 } };
        ebpo_vec3_copy(place, there.place);
        ebpo_tool_put(t->tool, &there);
    }
    t->touching = false;
    for (int i = 0; i < 3; i++)
        t->force[i] = 0;
    return EBPO_OK;
}

ebpo_status ebpo_touch_check(ebpo_touch *t, ebpo_error *error)
{
    pthread_mutex_lock(&t->mutex);
    ebpo_error failure = t->failure;
    pthread_mutex_unlock(&t->mutex);
    return failure.status == EBPO_OK ? EBPO_OK : ebpo_fail_with(error, &failure);
}

ebpo_status ebpo_touch_new(ebpo_model *model, const ebpo_touch_options *options,
                           const double place[3], ebpo_touch **out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_touch_options own = EBPO_TOUCH_OPTIONS_INIT;
    *out = NULL;
    ebpo_status status = EBPO_TAKE(ebpo_touch_options, &own, options, error);
    if (status == EBPO_OK)
        status = check_options(&own, error);
    if (status != EBPO_OK)
        return status;
    ebpo_touch *t = ebpo_alloc_zero(1, sizeof *t);
    if (!t)
        return ebpo_fail_memory(error, sizeof *t);
    t->model = model;
    t->options = own;
    t->failure = (ebpo_error)EBPO_ERROR_INIT;
    pthread_mutex_init(&t->mutex, NULL);
    t->passive.stiffness = own.stiffness;
    if (own.kind == EBPO_TOUCH_TOOL)
        status = ebpo_tool_new(own.points, own.point_count, &t->tool, error);
    t->options.points = NULL; /* the caller's */
    if (status == EBPO_OK)
        status = new_measure(t, error);
    if (status == EBPO_OK)
        status = make_parts(t, error);
    if (status == EBPO_OK)
        status = ebpo_touch_place(t, place, error);
    if (status == EBPO_OK)
        *out = t;
    else
        ebpo_touch_free(t);
    return status;
}

void ebpo_touch_free(ebpo_touch *t)
{
    if (!t)
        return;
    ebpo_touch_loader_stop(t);
    for (int i = 0; i < EBPO_TOUCH_BOXES; i++)
        ebpo_face_box_free(&t->box[i]);
    ebpo_ball_walk_free(&t->walk);
    ebpo_held_levels_free(&t->levels);
    ebpo_tool_free(t->tool);
    ebpo_context_free(t->asking);
    ebpo_context_free(t->loading);
    pthread_mutex_destroy(&t->mutex);
    free(t);
}
