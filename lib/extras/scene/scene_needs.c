/* Finds the content of each model's file that the queries of a scene need in an interval of time: a
 * box for collisions and for inside tests, and the last level for views.
 *
 * Boxes are in the coordinates of the model, and contain all points that come near another
 * instance. They are computed for steps of time that are so short that no instance moves far. Boxes
 * are rounded outwards, so that the subset of a file with this box returns the same results as the
 * whole file.
 *
 * A view needs the levels up to the first level whose cells have a diagonal of at most one pixel. A
 * node's envelope and its content are both in its cell, so finer levels make no visible
 * difference. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "derive/subset_parts.h"
#include "extras/scene/instance_pair.h"
#include "extras/scene/scene_needs.h"

/* Greatest number of times that the interval between two keys (times at which a route gives a pose)
 * is halved. */
enum { HALVINGS = 12 };

/* The search for the points of the instance `self` that come near the instance `other`. */
typedef struct near_search {
    ebpo_scene_needs *needs;
    const ebpo_scene *scene;
    uint64_t self, other;
    double clearance; /* points within this distance are near; a length in the world */
    double margin;    /* greatest motion in one step, by which boxes are widened; a length in the
                       * world */
    ebpo_scene_file_need *need; /* need of the file of the instance `self` */
} near_search;

static ebpo_scene_file_need *need_of(const ebpo_scene_needs *n, uint64_t instance)
{
    return &n->files[n->scene->models[n->scene->instances[instance].description.model].file];
}

static const ebpo_scene_route *route_of(const ebpo_scene *scene, uint64_t instance)
{
    uint64_t route = scene->instances[instance].description.route;
    return route == EBPO_SCENE_NONE ? NULL : &scene->routes[route];
}

/* Computes an upper bound of the distance of the other instance from the point about which the
 * route of this instance rotates, divided by the route's scale. */
static ebpo_status bound_distance(const near_search *n, const ebpo_scene_route *route, double from,
                                  double to, double *distance)
{
    double min[3], max[3], far[3];
    ebpo_pose at[2]; /* pose of the route at `from` and at `to` */
    ebpo_scene_route_at(route, from, &at[0]);
    ebpo_scene_route_at(route, to, &at[1]);
    ebpo_status status =
        ebpo_scene_instance_box(n->scene, n->other, from, to, min, max, n->needs->error);
    for (int k = 0; k < 3; k++) {
        double low = fmin(at[0].translation[k], at[1].translation[k]),
               high = fmax(at[0].translation[k], at[1].translation[k]);
        far[k] = fmax(fabs(max[k] - low), fabs(high - min[k]));
    }
    *distance = ebpo_scene_length_above(far) / fmin(at[0].scale, at[1].scale);
    return status;
}

/* Bounds the motion of the other instance relative to this instance, in the world's unit. No key
 * may be between the two times. */
static ebpo_status relative_motion(const near_search *n, double from, double to, double *out)
{
    const ebpo_scene_route *route = route_of(n->scene, n->self);
    double distance = 0, motion_by_route = 0; /* motion caused by the route of this instance */
    ebpo_status status = ebpo_scene_motion(n->scene, n->other, from, to, out, n->needs->error);
    if (status == EBPO_OK && route && from < to) {
        status = bound_distance(n, route, from, to, &distance);
        ebpo_scene_extent extent = { distance, distance };
        motion_by_route = ebpo_scene_route_step(route, from, to, extent).length;
    }
    *out = (*out + motion_by_route) * (1 + 0x1p-40);
    return status;
}

/* Computes a box of the points of the model's box that may come near the other instance between two
 * times. *any is false if there are no such points. motion: bound of the relative motion between
 * the two times, in the world's unit. */
static ebpo_status near_box(const near_search *n, double from, double to, double motion,
                            ebpo_scene_bounds *out, bool *any)
{
    ebpo_scene_relative_box first, last;
    ebpo_status status =
        ebpo_scene_make_relative_box(n->scene, n->self, n->other, from, &first, n->needs->error);
    if (status == EBPO_OK)
        status =
            ebpo_scene_make_relative_box(n->scene, n->self, n->other, to, &last, n->needs->error);
    if (status != EBPO_OK)
        return status;
    /* The last term bounds the rounding errors of the boxes at all times between `from` and
     * `to`. */
    double grow =
        (n->clearance + n->margin + motion) / fmin(first.unit, last.unit) * (1 + 0x1p-40) +
        2 * fmax(first.rounding, last.rounding);
    *any = true;
    for (int k = 0; k < 3; k++) {
        double low = first.box.min[k] - grow, high = first.box.max[k] + grow;
        /* NaN after an overflow: the comparison is false, and the whole box is used */
        out->min[k] = low > n->need->whole.min[k] ? low : n->need->whole.min[k];
        out->max[k] = high < n->need->whole.max[k] ? high : n->need->whole.max[k];
        *any = *any && out->min[k] <= out->max[k];
    }
    return EBPO_OK;
}

/* Returns true if the needed box of a file contains a box. */
static bool is_within(const ebpo_scene_bounds *box, const ebpo_scene_file_need *need)
{
    bool within = need->any;
    for (int k = 0; k < 3; k++)
        within = within && box->min[k] >= need->box.min[k] && box->max[k] <= need->box.max[k];
    return within;
}

static void join_need_box(ebpo_scene_file_need *need, const ebpo_scene_bounds *box)
{
    if (!need->any)
        need->box = *box;
    need->any = true;
    for (int k = 0; k < 3; k++) {
        need->box.min[k] = fmin(need->box.min[k], box->min[k]);
        need->box.max[k] = fmax(need->box.max[k], box->max[k]);
    }
}

/* Adds the points of the model that come near the other instance between two times. While the
 * instances move by more than the margin, halves the interval, but at most `halvings` times. */
static ebpo_status add_near_between(const near_search *n, double from, double to, int halvings)
{
    double motion, middle = from + (to - from) / 2;
    ebpo_scene_bounds box;
    bool any = false;
    ebpo_status status = relative_motion(n, from, to, &motion);
    if (status == EBPO_OK)
        status = near_box(n, from, to, motion, &box, &any);
    if (status != EBPO_OK || !any || is_within(&box, n->need))
        return status;
    if (motion <= n->margin || halvings == 0 || !(middle > from && middle < to)) {
        join_need_box(n->need, &box);
        return EBPO_OK;
    }
    status = add_near_between(n, from, middle, halvings - 1);
    return status == EBPO_OK ? add_near_between(n, middle, to, halvings - 1) : status;
}

/* Adds the near points over the whole interval of time, from key to key of both routes. Each key
 * begins a new step, because routes may jump at keys. */
static ebpo_status add_near_steps(const near_search *n)
{
    const ebpo_scene_pair pair = { n->self, n->other, 0 };
    double to = n->needs->to;
    ebpo_status status = EBPO_OK;
    for (double at = n->needs->from; at < to && status == EBPO_OK;) {
        double next = ebpo_scene_pair_next(n->scene, &pair, at, to);
        status = add_near_between(n, at, nextafter(next, -INFINITY), HALVINGS);
        at = next;
    }
    return status == EBPO_OK ? add_near_between(n, to, to, HALVINGS) : status;
}

/* Returns the longest side of the instance's model, times the scale of its pose at a time. */
static double size_of(const ebpo_scene *scene, uint64_t instance, double time)
{
    const ebpo_scene_model_entry *m = &scene->models[scene->instances[instance].description.model];
    ebpo_pose pose = EBPO_POSE_INIT;
    double size = 0;
    if (ebpo_scene_pose(scene, instance, time, &pose, NULL) != EBPO_OK)
        return 0; /* add_near_steps computes the pose again and reports the error */
    for (int k = 0; k < 3; k++)
        size = fmax(size, m->max[k] - m->min[k]);
    return size * pose.scale;
}

/* Returns the default margin of a pair: 1/32 of the size of the smaller instance, or of the larger
 * instance if the smaller instance is a point. */
static double default_margin(const ebpo_scene_needs *needs, const ebpo_scene_pair *pair)
{
    double a = size_of(needs->scene, pair->a, needs->from);
    double b = size_of(needs->scene, pair->b, needs->from);
    return (fmin(a, b) > 0 ? fmin(a, b) : fmax(a, b)) / 32;
}

/* Adds both models of the pair completely, because either solid may contain the other instance. */
static void add_complete_models(ebpo_scene_needs *needs, const ebpo_scene_pair *pair)
{
    for (int i = 0; i < 2; i++) {
        ebpo_scene_file_need *need = need_of(needs, i ? pair->b : pair->a);
        need->users++;
        need->any = true;
        need->box = need->whole;
    }
}

static ebpo_status add_pair(ebpo_scene_needs *needs, const ebpo_scene_pair *pair)
{
    if (needs->options.purpose == EBPO_SCENE_FOR_RELATIONS) {
        add_complete_models(needs, pair);
        return EBPO_OK;
    }
    /* inside tests of points need only the box in which the instances overlap */
    bool inside = needs->options.purpose == EBPO_SCENE_FOR_INSIDE;
    double margin = needs->options.margin > 0 ? needs->options.margin : default_margin(needs, pair);
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < 2 && status == EBPO_OK; i++) {
        near_search n = { .needs = needs,
                          .scene = needs->scene,
                          .self = i ? pair->b : pair->a,
                          .other = i ? pair->a : pair->b,
                          .clearance = inside ? 0 : pair->clearance,
                          .margin = margin };
        n.need = need_of(needs, n.self);
        n.need->users++;
        status = add_near_steps(&n);
    }
    return status;
}

ebpo_status ebpo_scene_add_near(ebpo_scene_needs *needs)
{
    ebpo_scene_pairs_list list = { 0 };
    ebpo_status status =
        ebpo_scene_keep_pairs(needs->scene, needs->from, needs->to, &list, needs->error);
    for (uint64_t i = 0; i < list.count && status == EBPO_OK; i++) {
        status = add_pair(needs, &list.pairs[i]);
        if (status == EBPO_OK &&
            !ebpo_progress_step(&needs->options.progress, "finding the needed parts", i + 1,
                                list.count, needs->error))
            status = EBPO_E_CANCELLED;
    }
    free(list.pairs);
    return status;
}

/* Initialises the needs of files. If two models have the same file, the file has one need. */
static void begin_files(ebpo_scene_needs *needs)
{
    for (uint64_t i = 0; i < needs->scene->models_count; i++) {
        const ebpo_scene_model_entry *m = &needs->scene->models[i];
        ebpo_scene_file_need *need = &needs->files[m->file];
        memcpy(need->whole.min, m->min, sizeof m->min);
        memcpy(need->whole.max, m->max, sizeof m->max);
        need->box = need->whole;
        need->last_level = -1;
        need->parts = EBPO_PART_PLANES | EBPO_PART_MESH;
        if (needs->options.purpose == EBPO_SCENE_FOR_COLLIDE ||
            needs->options.purpose == EBPO_SCENE_FOR_RELATIONS)
            need->parts |= EBPO_PART_MAPS;
        if (needs->options.purpose == EBPO_SCENE_FOR_VIEW)
            need->parts = ebpo_profile_parts(EBPO_PROFILE_LOD);
    }
}

ebpo_status ebpo_scene_begin_needs(ebpo_scene_needs *needs)
{
    needs->files = ebpo_alloc_zero(needs->scene->files_count, sizeof *needs->files);
    if (!needs->files)
        return ebpo_fail_memory(needs->error, needs->scene->files_count * sizeof *needs->files);
    begin_files(needs);
    return EBPO_OK;
}

void ebpo_scene_end_needs(ebpo_scene_needs *needs)
{
    for (uint64_t i = 0; i < needs->scene->files_count; i++)
        if (!needs->files[i].any) {
            needs->files[i].last_level = 0;
            needs->files[i].parts &= EBPO_PART_PLANES;
        }
}

ebpo_subset_options ebpo_scene_need_options(const ebpo_scene_needs *needs, uint64_t file)
{
    const ebpo_scene_file_need *need = &needs->files[file];
    ebpo_subset_options o = EBPO_SUBSET_OPTIONS_INIT;
    o.parts = need->parts;
    o.last_level = need->last_level;
    for (int k = 0; k < 3; k++) {
        o.boxed = o.boxed || need->box.min[k] > need->whole.min[k] ||
                  need->box.max[k] < need->whole.max[k];
        o.min[k] = need->box.min[k];
        o.max[k] = need->box.max[k];
    }
    o.boxed = o.boxed && need->any;
    return o;
}

ebpo_status ebpo_scene_report_need(const ebpo_scene_needs *needs, uint64_t model,
                                   ebpo_scene_need *out)
{
    uint64_t number = needs->scene->models[model].file;
    const ebpo_scene_file_need *need = &needs->files[number];
    const ebpo_file *file = needs->scene->files[number].file;
    const ebpo_info *info = ebpo_file_info(file);
    ebpo_subset_options o = ebpo_scene_need_options(needs, number);
    ebpo_subset_reads reads;
    *out = (ebpo_scene_need)EBPO_SCENE_NEED_INIT;
    out->model = model;
    out->users = need->users;
    out->boxed = o.boxed;
    out->parts = info->parts & o.parts;
    out->last_level = o.last_level < 0 ? info->level_count - 1 : o.last_level;
    out->level_count = info->level_count;
    memcpy(out->min, need->box.min, sizeof out->min);
    memcpy(out->max, need->box.max, sizeof out->max);
    out->file_bytes = info->file_bytes;
    ebpo_status status = ebpo_subset_count_reads(file, &o, &reads, needs->error);
    out->bytes = reads.bytes;
    out->subtrees = reads.subtrees;
    out->total_subtrees = reads.total_subtrees;
    return status;
}

/* --- views --- */

/* Number of steps into which a camera's path between two keys is divided. */
enum { VIEW_STEPS = 16 };

/* The search for the levels that a camera can resolve. */
typedef struct view_search {
    ebpo_scene_needs *needs;
    const ebpo_scene_camera *camera;
    double pixel;          /* width of a pixel in the middle of the picture, at a distance of 1 */
    double corner_stretch; /* stretch_of at the corners of the picture */
} view_search;

/* Computes a box that contains the camera's eye at all times between two times. No key of the
 * camera's route may be between them. */
static void eye_box(const view_search *s, double from, double to, ebpo_scene_bounds *out)
{
    const ebpo_scene_camera *c = s->camera;
    ebpo_pose at;
    double length = 0;
    memcpy(out->min, c->eye, sizeof out->min);
    if (c->route != EBPO_SCENE_NONE) {
        const ebpo_scene_route *route = &s->needs->scene->routes[c->route];
        ebpo_scene_extent extent = { ebpo_scene_length_above(c->eye),
                                     ebpo_scene_length_above(c->eye) };
        ebpo_scene_route_at(route, from, &at);
        length = ebpo_scene_route_step(route, from, to, extent).length;
        for (int i = 0; i < 3; i++)
            out->min[i] =
                at.scale * ((at.rotation[i][0] * c->eye[0] + at.rotation[i][1] * c->eye[1]) +
                            at.rotation[i][2] * c->eye[2]) +
                at.translation[i];
    }
    for (int k = 0; k < 3; k++) {
        out->max[k] = out->min[k] + length;
        out->min[k] -= length;
    }
}

/* Returns the greatest scale of an instance between two times. Between two keys of its route, the
 * scale changes at constant speed or not at all. So the scale is greatest at a key or an end. */
static ebpo_status greatest_scale(const ebpo_scene *scene, uint64_t instance, double from,
                                  double to, double *scale, ebpo_error *error)
{
    const ebpo_scene_route *route = route_of(scene, instance);
    ebpo_status status = EBPO_OK;
    *scale = 0;
    for (double at = from; status == EBPO_OK;) {
        ebpo_pose pose;
        status = ebpo_scene_pose(scene, instance, at, &pose, error);
        *scale = status == EBPO_OK ? fmax(*scale, pose.scale) : *scale;
        if (!(at < to))
            break;
        at = route ? ebpo_scene_route_next(route, at, to) : to;
    }
    return status;
}

/* Computes a lower bound of the distance of an instance from the eye between two times, and the
 * instance's greatest scale. */
static ebpo_status distance_between(const view_search *s, uint64_t instance, double from, double to,
                                    double *distance, double *scale)
{
    ebpo_scene_bounds eye, box;
    eye_box(s, from, to, &eye);
    ebpo_status status = ebpo_scene_instance_box(s->needs->scene, instance, from, to, box.min,
                                                 box.max, s->needs->error);
    if (status == EBPO_OK)
        status = greatest_scale(s->needs->scene, instance, from, to, scale, s->needs->error);
    if (status == EBPO_OK)
        *distance = ebpo_scene_bounds_gap(&eye, &box);
    return status;
}

/* Returns true if a box is behind a camera that does not move. */
static bool is_behind(const view_search *s, const ebpo_scene_bounds *box)
{
    const ebpo_scene_camera *c = s->camera;
    double most = -INFINITY;
    for (int corner = 0; corner < 8; corner++) {
        double sum = 0;
        for (int k = 0; k < 3; k++)
            sum += (c->target[k] - c->eye[k]) *
                   ((corner >> k & 1 ? box->max[k] : box->min[k]) - c->eye[k]);
        most = fmax(most, sum);
    }
    return c->route == EBPO_SCENE_NONE && most < 0;
}

/* Returns how many times more pixels a cell of the box may cover than a cell in the middle of the
 * picture at the same distance. At an angle a from the camera's axis it is 1 / cos^2 a. The angle
 * is greatest at a corner of the box, or at a corner of the picture. */
static double stretch_of(const view_search *s, const ebpo_scene_bounds *box)
{
    const ebpo_scene_camera *c = s->camera;
    double axis[3], at[3], most = 1;
    for (int k = 0; k < 3; k++)
        axis[k] = c->target[k] - c->eye[k];
    double length = ebpo_scene_length_above(axis);
    for (int corner = 0; corner < 8 && c->route == EBPO_SCENE_NONE; corner++) {
        double depth = 0;
        for (int k = 0; k < 3; k++) {
            at[k] = (corner >> k & 1 ? box->max[k] : box->min[k]) - c->eye[k];
            depth += at[k] * (axis[k] / length);
        }
        double secant = ebpo_scene_length_above(at) / depth;
        /* the comparison is false for NaN and infinity */
        most = depth > 0 && secant * secant < s->corner_stretch ? fmax(most, secant * secant)
                                                                : s->corner_stretch;
        if (most >= s->corner_stretch)
            return s->corner_stretch;
    }
    return c->route == EBPO_SCENE_NONE ? most : s->corner_stretch;
}

/* Returns the first level whose cells have a diagonal of at most `size`; -1: no level before the
 * last one has such cells, so all levels are needed. */
static int level_for(const ebpo_info *info, double size)
{
    double cell = ebpo_scene_length_above(info->box_size);
    for (int level = 0; level < info->level_count - 1; level++, cell /= 2)
        if (cell <= size)
            return level;
    return -1;
}

/* Adds the levels of an instance that the camera can resolve between two times. The least distance
 * and the greatest stretch may be at different points and times, so the level may be finer than
 * needed, but not coarser. */
static ebpo_status add_instance_view(const view_search *s, uint64_t instance, double from,
                                     double to)
{
    const ebpo_scene *scene = s->needs->scene;
    uint64_t file = scene->models[scene->instances[instance].description.model].file;
    ebpo_scene_file_need *need = &s->needs->files[file];
    ebpo_scene_bounds box;
    double distance, scale;
    ebpo_status status =
        ebpo_scene_instance_box(scene, instance, from, to, box.min, box.max, s->needs->error);
    if (status != EBPO_OK || is_behind(s, &box))
        return status;
    status = distance_between(s, instance, from, to, &distance, &scale);
    if (status != EBPO_OK)
        return status;
    int level = level_for(ebpo_file_info(scene->files[file].file),
                          distance * s->pixel / stretch_of(s, &box) / scale);
    if (!need->any || (need->last_level >= 0 && (level < 0 || level > need->last_level)))
        need->last_level = level;
    need->any = true;
    return EBPO_OK;
}

static ebpo_status add_views_between(const view_search *s, double from, double to)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < s->needs->scene->instances_count && status == EBPO_OK; i++)
        status = add_instance_view(s, i, from, to);
    return status;
}

/* Adds the views over the whole interval, in steps from key to key of the camera's route. */
static ebpo_status add_views_along_route(const view_search *s)
{
    const ebpo_scene_needs *n = s->needs;
    const ebpo_scene_route *route =
        s->camera->route == EBPO_SCENE_NONE ? NULL : &n->scene->routes[s->camera->route];
    ebpo_status status = route ? EBPO_OK : add_views_between(s, n->from, n->to);
    for (double at = n->from; route && at < n->to && status == EBPO_OK;) {
        double next = ebpo_scene_route_next(route, at, n->to);
        for (int i = 0; i < VIEW_STEPS && status == EBPO_OK; i++)
            status = add_views_between(s, at + (next - at) * i / VIEW_STEPS,
                                       i + 1 < VIEW_STEPS ? at + (next - at) * (i + 1) / VIEW_STEPS
                                                          : nextafter(next, -INFINITY));
        at = next;
    }
    return status == EBPO_OK ? add_views_between(s, n->to, n->to) : status;
}

ebpo_status ebpo_scene_add_views(ebpo_scene_needs *needs)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < needs->scene->cameras_count && status == EBPO_OK; i++) {
        const ebpo_scene_camera *c = &needs->scene->cameras[i];
        double half = c->fov * (3.14159265358979323846 / 360); /* half of the field of view, rad */
        double aspect = (double)c->width / c->height, side = tan(half);
        view_search s = { needs, c, 2 * side / c->height, 1 + side * side * (1 + aspect * aspect) };
        status = add_views_along_route(&s);
        for (uint64_t f = 0; f < needs->scene->files_count; f++)
            needs->files[f].users++;
    }
    return status;
}
