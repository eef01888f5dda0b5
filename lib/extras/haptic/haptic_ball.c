/* Makes the object of a haptic session, computes the step of a ball, and places the proxy.
 *
 * A step moves the proxy towards the device (haptic_step.c); faces in contact with the proxy hold
 * it back. The step returns the force of a spring between proxy and device, with friction along the
 * surface. A step allocates no memory, takes no lock and reads no file: its data are made before
 * the step or come from the loading thread. A device position that is infinite or NaN is ignored.
 *
 * See docs/guide/haptic.md. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "extras/haptic/tool.h"
#include "extras/haptic/haptic_parts.h"
#include "geometry/vec3.h"
#include "query/query_model.h"

void ebpo_haptic_report(ebpo_haptic *t, const double device[3])
{
    for (int i = 0; i < 3; i++) {
        atomic_store_explicit(&t->proxy_reported[i], t->proxy[i], memory_order_relaxed);
        atomic_store_explicit(&t->device_reported[i], device[i], memory_order_relaxed);
    }
}

uint32_t ebpo_haptic_stopped(const ebpo_haptic *t)
{
    return atomic_load_explicit(&t->stopped, memory_order_acquire) ? EBPO_HAPTIC_STOPPED : 0;
}

static bool has_no_piece(const ebpo_haptic *t) { return t->walk.stage == EBPO_BALL_IDLE; }

/* Applies Coulomb friction. Without friction the proxy has slid from `from` to its position.
 * Friction shortens this path: the proxy stops where the tangential force is equal to the friction.
 * If the friction is greater on the whole path, the proxy stays at `from`. Both forces are
 * proportional to lengths, so lengths are compared. Returns bits of ebpo_haptic_flag. */
static uint32_t apply_friction(ebpo_haptic *t, const double from[3], const double device[3],
                               ebpo_ball_work *work)
{
    double slid[3], depth[3], goal[3];
    ebpo_vec3_subtract(t->proxy, from, slid);
    ebpo_vec3_subtract(device, t->proxy, depth);
    double length = sqrt(ebpo_vec3_dot(slid, slid));
    double friction = t->options.friction * sqrt(ebpo_vec3_dot(depth, depth));
    double fraction = length > friction ? 1 - friction / length : 0;
    for (int i = 0; i < 3; i++)
        goal[i] = from[i] + fraction * slid[i] + (fraction > 0 ? depth[i] : 0);
    ebpo_vec3_copy(from, t->proxy);
    t->path_count = 1;
    if (fraction > 0)
        return ebpo_haptic_move_ball(t, goal, work);
    if (length > 0 && memcmp(from, t->contact_position, sizeof t->contact_position) == 0)
        t->holding_planes = t->contact_planes; /* the proxy is back at `from` */
    return 0;
}

/* Computes the vector from the device to the proxy. If the proxy waits for the loading thread or
 * its path is incomplete, computes only the part of this vector that contacts cause. */
static void find_depth(const ebpo_haptic *t, const double device[3], uint32_t flags, double out[3])
{
    double want[3], motion[3];
    ebpo_vec3_subtract(t->proxy, device, out);
    if (!(flags & (EBPO_HAPTIC_WAITING | EBPO_HAPTIC_PATH_UNFINISHED)))
        return;
    ebpo_vec3_subtract(device, t->proxy, want);
    (void)ebpo_project_motion(&t->holding_planes, want, motion);
    ebpo_vec3_subtract(motion, want, out);
}

/* Removes the part of the force that pulls towards faces, without increasing the force. The vector
 * `depth` from device to proxy is not exactly along the faces' normals, because of the proxy's
 * remaining path, rounding of great coordinates, and friction. So damping perpendicular to this
 * vector may pull towards faces, and very high damping pulls with full force. near: t->away is
 * set. */
static void keep_from_faces(const ebpo_haptic *t, bool near, const double depth[3], double force[3])
{
    ebpo_held_planes planes = { .count = 0 };
    double wanted[3];
    /* the first contact may be an edge beside the ball, so the nearest face counts, too */
    if (near && ebpo_vec3_dot(t->away, depth) >= 0)
        ebpo_held_planes_add(&planes, t->away);
    /* if the spring itself pulls towards a face, this face is the other face of a narrow corner,
     * and does not count */
    for (int i = 0; i < t->holding_planes.count; i++)
        if (ebpo_vec3_dot(t->holding_planes.normal[i], depth) >= 0)
            ebpo_held_planes_add(&planes, t->holding_planes.normal[i]);
    ebpo_vec3_copy(force, wanted);
    (void)ebpo_project_motion(&planes, wanted, force);
}

void ebpo_haptic_count(ebpo_haptic *t, uint32_t flags, uint64_t work)
{
    ebpo_haptic_stats *s = &t->stats;
    s->step_count++;
    s->contacts += (flags & EBPO_HAPTIC_CONTACT) != 0;
    s->waiting += (flags & EBPO_HAPTIC_WAITING) != 0;
    s->path_unfinished += (flags & EBPO_HAPTIC_PATH_UNFINISHED) != 0;
    s->faces_omitted += (flags & EBPO_HAPTIC_FACES_OMITTED) != 0;
    s->stopped += (flags & EBPO_HAPTIC_STOPPED) != 0;
    s->work_max = work > s->work_max ? work : s->work_max;
    s->energy_max = fmax(s->energy_max, t->passive.energy);
}

void ebpo_haptic_step_ball(ebpo_haptic *t, const double device[3], ebpo_haptic_ball_result *out)
{
    EBPO_DEFAULT_FP;
    double at[3], from[3], moved[3], along_at[3];
    bool bad_input = false;
    ebpo_ball_work work = { 0 };
    if (t->options.kind != EBPO_HAPTIC_BALL) {
        *out = (ebpo_haptic_ball_result){ .face = EBPO_NO_FACE, .flags = EBPO_HAPTIC_WRONG_KIND };
        return;
    }
    for (int i = 0; i < 3; i++)
        bad_input |= !(fabs(device[i]) <= 0x1p200);
    ebpo_vec3_copy(bad_input ? t->device : device, at);
    *out = (ebpo_haptic_ball_result){ .flags = bad_input ? EBPO_HAPTIC_BAD_INPUT : 0 };
    ebpo_vec3_subtract(at, t->device, moved);
    ebpo_passive_moved(&t->passive, t->force, moved, 3);
    ebpo_vec3_copy(t->proxy, from);
    ebpo_vec3_copy(t->contact_position, along_at);
    ebpo_held_planes along = t->contact_planes;
    uint32_t flags = ebpo_haptic_move_ball(t, at, &work);
    if (t->touching && (flags & EBPO_HAPTIC_CONTACT) && t->options.friction > 0 &&
        has_no_piece(t)) {
        t->contact_planes = along;
        ebpo_vec3_copy(along_at, t->contact_position);
        flags |= apply_friction(t, from, at, &work);
    }
    out->work = work.faces;
    out->flags |= flags | ebpo_haptic_stopped(t);
    ebpo_haptic_find_nearest(t, out);
    t->touching = (flags & EBPO_HAPTIC_CONTACT) != 0;
    if (t->touching) {
        double depth[3];
        find_depth(t, at, flags, depth);
        ebpo_passive_push(&t->passive, t->options.damping / t->options.step_seconds, depth, moved,
                          3, out->force);
        keep_from_faces(t, out->face != EBPO_NO_FACE, depth, out->force);
        out->depth = sqrt(ebpo_vec3_dot(depth, depth));
    }
    ebpo_vec3_copy(t->proxy, out->proxy);
    ebpo_vec3_copy(out->force, t->force);
    ebpo_vec3_copy(at, t->device);
    if ((flags & EBPO_HAPTIC_WAITING) && has_no_piece(t))
        ebpo_haptic_try_previous_box(t);
    ebpo_haptic_count(t, out->flags, out->work);
    ebpo_haptic_report(t, at);
}

ebpo_status ebpo_haptic_get_stats(const ebpo_haptic *t, ebpo_haptic_stats *out)
{
    ebpo_haptic_stats s = t->stats;
    s.loads = atomic_load(&t->loads);
    s.too_many = atomic_load(&t->too_many);
    s.load_seconds = 1e-9 * (double)atomic_load(&t->load_ns);
    s.load_seconds_max = 1e-9 * (double)atomic_load(&t->load_ns_max);
    s.faces = t->box[t->current_box].count;
    s.memory = EBPO_HAPTIC_BOXES * ebpo_face_box_bytes(t->options.faces);
    s.energy = t->passive.energy;
    s.longest_step = t->passive.longest_step;
    if (t->options.kind == EBPO_HAPTIC_BALL)
        s.memory += ebpo_ball_walk_bytes(t->options.faces);
    if (t->tool)
        s.memory += ebpo_tool_bytes(t->tool);
    for (uint64_t i = 0; i < t->model_count; i++)
        s.memory += t->models[i].levels.count * sizeof *t->models[i].levels.node;
    return EBPO_GIVE(ebpo_haptic_stats, out, &s);
}

uint32_t ebpo_haptic_ball_path(const ebpo_haptic *t, double path[EBPO_HAPTIC_PATH_MAX][3])
{
    for (uint32_t i = 0; i < t->path_count; i++)
        ebpo_vec3_copy(t->path[i], path[i]);
    return t->path_count;
}

/* --- making the object --- */

static bool is_amount(double x) { return x >= 0 && x <= 0x1p200; }

static ebpo_status check_options(const ebpo_haptic_options *o, ebpo_error *error)
{
    if (!is_amount(o->radius) || !is_amount(o->skin) || !is_amount(o->search_radius))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "radius, skin and search radius must be 0 to 2^200");
    if (!is_amount(o->stiffness) || !is_amount(o->damping) || !is_amount(o->friction))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "stiffness, damping and friction must be 0 to 2^200");
    if (!is_amount(o->step_seconds) || o->step_seconds == 0)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "a haptic step must take more than 0 seconds, and 2^200 at most");
    if (o->kind > EBPO_HAPTIC_TOOL)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "unknown kind of haptic object");
    if (o->kind != EBPO_HAPTIC_BALL && o->radius != 0)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "only balls have a radius");
    if ((o->kind == EBPO_HAPTIC_TOOL) != (o->points != NULL && o->point_count > 0) ||
        o->point_count > EBPO_TOOL_POINTS)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "a tool needs 1 to %d points, other kinds none",
                         EBPO_TOOL_POINTS);
    for (uint64_t i = 0; i < 3 * o->point_count; i++)
        if (!(fabs(o->points[i / 3][i % 3]) <= 0x1p200))
            return ebpo_fail(error, EBPO_E_ARGUMENT, "point %llu of the tool is not finite",
                             (unsigned long long)(i / 3));
    if (o->faces < 64 || o->faces > 1 << 20)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "a box must have space for 64 to 2^20 faces");
    return EBPO_OK;
}

static const ebpo_info *info_of(const ebpo_haptic_part *part)
{
    return ebpo_file_info(part->of->model->file);
}

/* Returns the default search radius: the least of all instances. */
static double default_search_radius(const ebpo_haptic *t)
{
    double least = INFINITY;
    for (uint64_t i = 0; i < t->part_count; i++) {
        const ebpo_extent *e = &t->part[i].extent;
        least = fmin(least, 3 * ebpo_vec3_scaled_distance(e->min, e->max) /
                                sqrt(fmax(1, (double)info_of(&t->part[i])->face_count)));
    }
    return least;
}

/* Computes values that depend on the instances: their box, default lengths, tolerances, and the
 * size of boxes. */
static ebpo_status measure_parts(ebpo_haptic *t, ebpo_error *error)
{
    double most = 0, faces = 0;
    for (uint64_t i = 0; i < t->part_count; i++)
        faces += (double)info_of(&t->part[i])->face_count;
    t->root = t->part[0].extent;
    for (int i = 0; i < 3; i++) {
        for (uint64_t k = 1; k < t->part_count; k++) {
            t->root.min[i] = fmin(t->root.min[i], t->part[k].extent.min[i]);
            t->root.max[i] = fmax(t->root.max[i], t->part[k].extent.max[i]);
        }
        most = fmax(most, fmax(fabs(t->root.min[i]), fabs(t->root.max[i])));
    }
    t->diagonal = ebpo_vec3_scaled_distance(t->root.min, t->root.max);
    if (!(most <= 0x1p200 && t->diagonal >= 0x1p-200))
        return ebpo_fail(error, EBPO_E_UNSUPPORTED,
                         "coordinates are too large or too small for haptics");
    double wide = t->tool ? t->tool->radius * (1 + 0x1p-40) : t->options.radius;
    most += wide; /* positions of the device at contact */
    double least = fmax(0x1p-30 * t->diagonal, 0x1p-42 * most);
    if (t->options.skin == 0)
        t->options.skin = fmax((t->tool ? 0x1p-15 : 0x1p-20) * t->diagonal, least);
    if (t->options.skin < least)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the skin must be at least %g, for rounding of coordinates", least);
    if (t->options.search_radius == 0)
        t->options.search_radius = default_search_radius(t);
    t->options.search_radius = fmax(t->options.search_radius, 4 * t->options.skin);
    t->contact_distance = wide + t->options.skin;
    t->band = fmax(0x1p-24 * t->options.skin, 0x1p-48 * most);
    t->margin = wide + (t->tool ? 4 * t->options.skin : t->options.search_radius);
    t->max_piece = t->diagonal;
    t->half_side = fmin(1, sqrt((double)t->options.faces / fmax(1, faces))) * t->diagonal / 8;
    return EBPO_OK;
}

static ebpo_status make_buffers(ebpo_haptic *t, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < EBPO_HAPTIC_BOXES && status == EBPO_OK; i++)
        status = ebpo_face_box_new(&t->box[i], t->options.faces, error);
    if (status == EBPO_OK && t->options.kind == EBPO_HAPTIC_BALL)
        status = ebpo_ball_walk_new(&t->walk, t->options.faces, error);
    t->previous_box = 1;
    t->loader_box = 3;
    atomic_store(&t->waiting_box, 2);
    t->loader_result = 1;
    atomic_store(&t->waiting_result, 2);
    return status;
}

/* Checks that a ball or a tool may begin with a point at `place`: no face of an instance is within
 * contact_distance plus half a skin, and the point is not inside the solid. */
static ebpo_status check_point_in(const ebpo_haptic *t, const ebpo_haptic_part *part,
                                  const double place[3], double contact_distance, ebpo_error *error)
{
    ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
    ebpo_distance_result near;
    double p[3], uncertainty;
    ebpo_haptic_part_point(part, place, p, &uncertainty);
    options.max_distance = (contact_distance + t->options.skin / 2) / part->scale + uncertainty;
    ebpo_status status = ebpo_distance(part->of->placing, p, &options, &near, error);
    if (status == EBPO_OK && near.distance <= options.max_distance && near.distance >= 0)
        return ebpo_fail(
            error, EBPO_E_ARGUMENT,
            "at the initial position, the distance of the device from a face is %g; it "
            "must be greater than %g",
            near.distance * part->scale, options.max_distance * part->scale);
    if (status != EBPO_OK || !part->solid)
        return status;
    ebpo_inside_result inside;
    status = ebpo_inside(part->of->placing, p, NULL, &inside, error);
    return status != EBPO_OK || inside.where == EBPO_OUT
               ? status
               : ebpo_fail(error, EBPO_E_ARGUMENT, "the position is in the solid; begin outside");
}

/* Checks a point for all instances. */
static ebpo_status check_point(const ebpo_haptic *t, const double place[3], double contact_distance,
                               ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < t->part_count && status == EBPO_OK; i++)
        if (!t->part[i].is_posed ||
            ebpo_haptic_part_gap(&t->part[i], place) <= contact_distance + t->options.skin)
            status = check_point_in(t, &t->part[i], place, contact_distance, error);
    return status;
}

/* Checks the initial position. A probe may be anywhere; a tool begins without rotation. */
static ebpo_status check_place(ebpo_haptic *t, const double place[3], ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < 3; i++)
        if (!(fabs(place[i]) <= 0x1p200))
            return ebpo_fail(error, EBPO_E_ARGUMENT, "the position must be three finite numbers");
    if (t->options.kind == EBPO_HAPTIC_BALL)
        return check_point(t, place, t->contact_distance, error);
    for (uint64_t i = 0; t->tool && i < t->tool->count && status == EBPO_OK; i++) {
        double at[3];
        for (int k = 0; k < 3; k++)
            at[k] = place[k] + t->tool->point[i][k];
        status = check_point(t, at, t->options.skin, error);
    }
    return status;
}

/* Returns true if a box contains the proxy, and makes this box the current box. The previous box is
 * tested, too. It may be a box that ebpo_haptic_take_box rejected because of an earlier position of
 * the proxy. If such a box contains the new position, the loader makes no further box. */
static bool has_box(ebpo_haptic *t)
{
    if (ebpo_extent_holds(&t->box[t->current_box].allowed, t->proxy) || ebpo_haptic_take_box(t))
        return true;
    ebpo_haptic_try_previous_box(t);
    return ebpo_extent_holds(&t->box[t->current_box].allowed, t->proxy);
}

/* Waits until a box contains the proxy. */
static ebpo_status await_box(ebpo_haptic *t, ebpo_error *error)
{
    const struct timespec short_time = { 0, 100000 };
    while (!has_box(t)) {
        ebpo_status status = ebpo_haptic_check(t, error);
        if (status != EBPO_OK)
            return status;
        nanosleep(&short_time, NULL);
    }
    return EBPO_OK;
}

ebpo_status ebpo_haptic_reset(ebpo_haptic *t, const double place[3], ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    double proxy[3], device[3];
    ebpo_vec3_copy(t->proxy, proxy);
    ebpo_vec3_copy(t->device, device);
    ebpo_status status = check_place(t, place, error);
    if (status != EBPO_OK)
        return status;
    t->walk.stage = EBPO_BALL_IDLE; /* after a failure, too, the session continues without an
                                     * unfinished piece */
    ebpo_vec3_copy(place, t->proxy);
    ebpo_vec3_copy(place, t->device);
    ebpo_haptic_report(t, place);
    if (!t->has_thread)
        status = ebpo_haptic_loader_start(t, error);
    if (status == EBPO_OK)
        status = await_box(t, error);
    if (status != EBPO_OK) {
        ebpo_vec3_copy(proxy, t->proxy);
        ebpo_vec3_copy(device, t->device);
        ebpo_haptic_report(t, device);
        return status;
    }
    for (uint64_t i = 0; i < t->part_count; i++)
        t->part[i].probed_point.known = false;
    if (t->tool) {
        ebpo_rigid initial = { .rotation = { 0, 0, 0, 1 } };
        ebpo_vec3_copy(place, initial.place);
        ebpo_tool_put(t->tool, &initial);
    }
    t->touching = false;
    for (int i = 0; i < 3; i++)
        t->force[i] = 0;
    return EBPO_OK;
}

ebpo_status ebpo_haptic_check(ebpo_haptic *t, ebpo_error *error)
{
    pthread_mutex_lock(&t->mutex);
    ebpo_error failure = t->failure;
    pthread_mutex_unlock(&t->mutex);
    return failure.status == EBPO_OK ? EBPO_OK : ebpo_fail_with(error, &failure);
}

/* Makes the object for instances [count]; posed: as for ebpo_haptic_parts_new. */
static ebpo_status make_object(const ebpo_haptic_instance *instances, uint64_t count, bool posed,
                               const ebpo_haptic_options *options, const double place[3],
                               ebpo_haptic **out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_haptic_options checked = EBPO_HAPTIC_OPTIONS_INIT;
    *out = NULL;
    ebpo_status status = EBPO_TAKE(ebpo_haptic_options, &checked, options, error);
    if (status == EBPO_OK)
        status = check_options(&checked, error);
    if (status != EBPO_OK)
        return status;
    ebpo_haptic *t = ebpo_alloc_zero(1, sizeof *t);
    if (!t)
        return ebpo_fail_memory(error, sizeof *t);
    t->options = checked;
    t->failure = (ebpo_error)EBPO_ERROR_INIT;
    pthread_mutex_init(&t->mutex, NULL);
    t->passive.stiffness = checked.stiffness;
    if (checked.kind == EBPO_HAPTIC_TOOL)
        status = ebpo_tool_new(checked.points, checked.point_count, &t->tool, error);
    t->options.points = NULL; /* the caller may free the points */
    if (status == EBPO_OK)
        status = ebpo_haptic_parts_new(t, instances, count, posed, error);
    if (status == EBPO_OK)
        status = measure_parts(t, error);
    if (status == EBPO_OK)
        status = make_buffers(t, error);
    if (status == EBPO_OK)
        status = ebpo_haptic_reset(t, place, error);
    if (status == EBPO_OK)
        *out = t;
    else
        ebpo_haptic_free(t);
    return status;
}

ebpo_status ebpo_haptic_new(ebpo_model *model, const ebpo_haptic_options *options,
                            const double place[3], ebpo_haptic **out, ebpo_error *error)
{
    const ebpo_haptic_instance instance = { model, EBPO_POSE_INIT };
    return make_object(&instance, 1, false, options, place, out, error);
}

ebpo_status ebpo_haptic_new_posed(const ebpo_haptic_instance *instances, uint64_t count,
                                  const ebpo_haptic_options *options, const double place[3],
                                  ebpo_haptic **out, ebpo_error *error)
{
    return make_object(instances, count, true, options, place, out, error);
}

void ebpo_haptic_free(ebpo_haptic *t)
{
    if (!t)
        return;
    ebpo_haptic_loader_stop(t);
    for (int i = 0; i < EBPO_HAPTIC_BOXES; i++)
        ebpo_face_box_free(&t->box[i]);
    ebpo_ball_walk_free(&t->walk);
    ebpo_tool_free(t->tool);
    ebpo_haptic_parts_free(t);
    pthread_mutex_destroy(&t->mutex);
    free(t);
}
