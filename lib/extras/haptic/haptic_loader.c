/* Loads boxes of faces ahead of the haptic device, and queries exact results for probes, in a
 * separate thread. A box is a set of loaded faces (face_box.h).
 *
 * A haptic step never waits for this thread. Boxes and results are passed through three or more
 * buffers whose indices are exchanged atomically. The loader writes its buffer, and swaps it with
 * the waiting buffer. The step swaps the waiting buffer with its own buffer. The position of the
 * device is predicted from its speed. If the faces of a box do not fit in its memory, a smaller box
 * is loaded. */
#include "core/strict_fp.h"

#include <errno.h>
#include <math.h>
#include <string.h>
#include <time.h>

#include "core/error.h"
#include "core/os.h"
#include "core/parallel.h"
#include "extras/haptic/haptic_parts.h"
#include "geometry/vec3.h"

/* Sets the nearest point of `out` to that of an instance if it is nearer. p: out->place in the
 * coordinates of the model. */
static ebpo_status query_distance(const ebpo_haptic_part *part, const double p[3],
                                  ebpo_probe_query *out, ebpo_error *error)
{
    ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
    ebpo_distance_result near;
    options.unsigned_distance = true;
    ebpo_status status = ebpo_distance(part->of->loading, p, &options, &near, error);
    if (status != EBPO_OK || !(near.distance * part->scale < out->distance))
        return status;
    out->distance = near.distance * part->scale;
    ebpo_vec3_copy(near.point, out->point);
    ebpo_vec3_copy(near.normal, out->normal);
    if (part->is_posed)
        ebpo_posing_apply(&part->posed.posing, near.point, out->point);
    for (int i = 0; i < 3 && part->is_posed; i++)
        out->normal[i] = ebpo_vec3_dot(part->posed.rotation[i], near.normal);
    return EBPO_OK;
}

/* Sets the side of out->place with respect to a solid. p: as for query_distance. */
static ebpo_status query_side(const ebpo_haptic_part *part, const double place[3],
                              const double p[3], ebpo_probe_side *out, ebpo_error *error)
{
    ebpo_status status;
    if (part->is_posed) {
        ebpo_posed_sides sides;
        status = ebpo_posed_solid_sides(&part->posed, part->of->loading, place, &sides, error);
        *out = (ebpo_probe_side){ sides.above, sides.on };
    } else {
        ebpo_inside_result inside;
        status = ebpo_inside(part->of->loading, p, NULL, &inside, error);
        *out = (ebpo_probe_side){ inside.winding, inside.where == EBPO_ON };
    }
    return status;
}

/* Queries distance and winding numbers at out->place, and sets the other members of *out. */
static ebpo_status query_probe(ebpo_haptic *t, ebpo_probe_query *out, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    out->distance = INFINITY;
    out->uncertainty = 0;
    for (uint64_t i = 0; i < t->part_count && status == EBPO_OK; i++) {
        const ebpo_haptic_part *part = &t->part[i];
        double p[3], uncertainty, gap = ebpo_haptic_part_gap(part, out->place);
        ebpo_haptic_part_point(part, out->place, p, &uncertainty);
        out->side[i] = (ebpo_probe_side){ 0, false };
        if (gap < out->distance) {
            out->uncertainty = fmax(out->uncertainty, uncertainty * part->scale);
            status = query_distance(part, p, out, error);
        }
        if (status == EBPO_OK && part->solid && gap == 0)
            status = query_side(part, out->place, p, &out->side[i], error);
    }
    out->valid = status == EBPO_OK;
    return status;
}

/* Queries distance and winding number at the probe's position, and passes them to the haptic step.
 * If the probe has not moved since the last query, only sets *moved to false. */
static ebpo_status query_position(ebpo_haptic *t, bool *moved, ebpo_error *error)
{
    ebpo_probe_query *known = &t->known[t->loader_result];
    for (int i = 0; i < 3; i++)
        known->place[i] = atomic_load_explicit(&t->device_reported[i], memory_order_relaxed);
    *moved = known->place[0] != t->last_query[0] || known->place[1] != t->last_query[1] ||
             known->place[2] != t->last_query[2];
    if (!*moved)
        return EBPO_OK;
    ebpo_status status = query_probe(t, known, error);
    if (status != EBPO_OK)
        return status;
    ebpo_vec3_copy(known->place, t->last_query);
    unsigned received =
        atomic_exchange_explicit(&t->waiting_result, t->loader_result | EBPO_HAPTIC_FRESH,
                                 memory_order_acq_rel);
    t->loader_result = received & ~(unsigned)EBPO_HAPTIC_FRESH;
    return EBPO_OK;
}

const ebpo_probe_query *ebpo_haptic_newest_probe_query(ebpo_haptic *t)
{
    if (atomic_load_explicit(&t->waiting_result, memory_order_relaxed) & EBPO_HAPTIC_FRESH) {
        unsigned received =
            atomic_exchange_explicit(&t->waiting_result, t->step_result, memory_order_acq_rel);
        t->step_result = received & ~(unsigned)EBPO_HAPTIC_FRESH;
    }
    return &t->known[t->step_result];
}

/* --- boxes --- */

static const double prediction_seconds = 0.05; /* a box is made for the device's position after this
                                                * time */
static const double speed_seconds = 0.02;      /* time over which the speed is measured */
/* Lengths in units of half a box's side. max_shift: greatest distance of the proxy from the middle
 * of a new box. reload_shift: motion of the middle after which another box is loaded. */
static const double max_shift = 0.6, reload_shift = 0.25;

static void sleep_briefly(void)
{
    const struct timespec half_a_millisecond = { 0, 500000 };
    nanosleep(&half_a_millisecond, NULL);
}

/* Predicts the position of the device. The device's speed is averaged over several haptic steps,
 * because between two calls of this function there is often one step or none. */
static void predict_device(ebpo_haptic *t, double out[3])
{
    uint64_t now = ebpo_clock();
    double seconds = 1e-9 * (double)(now - t->speed_time);
    bool measure = seconds >= speed_seconds;
    for (int i = 0; i < 3; i++) {
        double device = atomic_load_explicit(&t->device_reported[i], memory_order_relaxed);
        if (measure) {
            t->speed[i] = (device - t->speed_position[i]) / seconds;
            t->speed_position[i] = device;
        }
        out[i] = device + prediction_seconds * t->speed[i];
    }
    if (measure)
        t->speed_time = now;
}

/* Computes the positions of the ball's centre for which a new box must have all faces: a cube
 * around the proxy, shifted towards `goal`, the predicted position of the device. */
static void place_box(const ebpo_haptic *t, const double goal[3], ebpo_extent *out)
{
    for (int i = 0; i < 3; i++) {
        double proxy = atomic_load_explicit(&t->proxy_reported[i], memory_order_relaxed);
        double shift =
            fmin(fmax(goal[i] - proxy, -max_shift * t->half_side), max_shift * t->half_side);
        out->min[i] = proxy + shift - t->half_side;
        out->max[i] = proxy + shift + t->half_side;
    }
}

/* Returns true if the middle of `e` is so far from the middle of the newest box that a box for `e`
 * must be loaded. */
static bool is_far_from_newest(const ebpo_haptic *t, const ebpo_extent *e)
{
    for (int i = 0; i < 3; i++)
        if (!(fabs(e->min[i] + e->max[i] - t->newest_allowed.min[i] - t->newest_allowed.max[i]) <=
              2 * reload_shift * t->half_side))
            return true;
    return false;
}

/* Passes the loaded box to the haptic steps, and gets a free box in exchange. */
static void pass_box(ebpo_haptic *t, uint64_t began)
{
    uint64_t ns = ebpo_clock() - began;
    unsigned received = atomic_exchange_explicit(&t->waiting_box, t->loader_box | EBPO_HAPTIC_FRESH,
                                                 memory_order_acq_rel);
    t->loader_box = received & ~(unsigned)EBPO_HAPTIC_FRESH;
    atomic_fetch_add(&t->loads, 1);
    atomic_fetch_add(&t->load_ns, ns);
    if (ns > atomic_load(&t->load_ns_max))
        atomic_store(&t->load_ns_max, ns);
}

/* Loads a box around the proxy; tries smaller and smaller boxes until the faces fit. */
static ebpo_status load_boxes(ebpo_haptic *t, const double goal[3], ebpo_error *error)
{
    uint64_t began = ebpo_clock();
    ebpo_face_box *box = &t->box[t->loader_box];
    ebpo_extent allowed;
    for (bool fits = false; !fits;) {
        place_box(t, goal, &allowed);
        ebpo_status status = ebpo_haptic_parts_load(t, box, &allowed, &fits, error);
        if (status != EBPO_OK)
            return status;
        if (fits)
            break;
        atomic_fetch_add(&t->too_many, 1);
        t->half_side /= 2;
        if (!(t->half_side > t->contact_distance * 0x1p-10 + t->band))
            return ebpo_fail(
                error, EBPO_E_LIMIT,
                "more than %llu faces around one point; allow more "
                "(ebpo_haptic_options.faces), or use a smaller radius or search radius",
                (unsigned long long)t->options.faces);
    }
    t->newest_allowed = allowed;
    /* computed before pass_box, after which the haptic step owns the box */
    bool can_grow = box->count < box->capacity / 4;
    pass_box(t, began);
    if (can_grow)
        t->half_side = fmin(1.5 * t->half_side, t->diagonal);
    return EBPO_OK;
}

static void *loader_run(void *user)
{
    ebpo_haptic *t = user;
    ebpo_status status = EBPO_OK;
    ebpo_error error = EBPO_ERROR_INIT;
    while (status == EBPO_OK && !atomic_load(&t->stop)) {
        double goal[3];
        ebpo_extent allowed;
        predict_device(t, goal);
        place_box(t, goal, &allowed);
        bool moved = false;
        if (is_far_from_newest(t, &allowed))
            status = load_boxes(t, goal, &error);
        else if (t->options.kind == EBPO_HAPTIC_PROBE)
            status = query_position(t, &moved, &error);
        if (status == EBPO_OK && !moved)
            sleep_briefly();
    }
    if (status != EBPO_OK) {
        pthread_mutex_lock(&t->mutex);
        t->failure = error;
        pthread_mutex_unlock(&t->mutex);
        atomic_store(&t->stopped, true);
    }
    return NULL;
}

ebpo_status ebpo_haptic_loader_start(ebpo_haptic *t, ebpo_error *error)
{
    for (int i = 0; i < 3; i++) {
        t->newest_allowed.min[i] = t->newest_allowed.max[i] = NAN; /* NAN: no position is near */
        t->last_query[i] = NAN;
        t->speed_position[i] = atomic_load(&t->device_reported[i]);
    }
    t->speed_time = ebpo_clock();
    int failed = ebpo_thread_start(&t->thread, loader_run, t);
    t->has_thread = failed == 0;
    return failed ? ebpo_fail(error, EBPO_E_MEMORY, "cannot start the loading thread: %s",
                              strerror(failed))
                  : EBPO_OK;
}

void ebpo_haptic_loader_stop(ebpo_haptic *t)
{
    atomic_store(&t->stop, true);
    if (t->has_thread)
        pthread_join(t->thread, NULL);
    t->has_thread = false;
}
