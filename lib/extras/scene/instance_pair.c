/* Computes data of a pair of instances of a scene: the box of one instance in the coordinates of
 * the other instance at a given time, and bounds of the relative motion and of the distance of the
 * instances. Also bounds the distance of faces that the files omit.
 *
 * Boxes and lengths are rounded outwards, so that every bound is certain in spite of rounding. A
 * file that is a subset has all faces of a box (the kept box); up to six boxes around the kept box
 * contain the omitted faces. If two instances follow one route, their relative position changes
 * only by rounding and by changes of the route's scale.
 *
 * ebpo_scene_find_in_pairs evaluates a list of pairs on all cores. Each pair has a separate
 * collider, so that results do not depend on the number of threads. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "extras/collide/collider.h"
#include "extras/scene/instance_pair.h"
#include "geometry/pose.h"

/* Relative margin for sums of a few products, far greater than their rounding errors. */
static const double slack = 0x1p-44;

static const ebpo_scene_model_entry *model_of_instance(const ebpo_scene *scene, uint64_t instance)
{
    return &scene->models[scene->instances[instance].description.model];
}

/* Makes the posing of an instance for a given time: its checked pose with an error bound of the
 * rotation (geometry/pose.h). Fails with EBPO_E_ARGUMENT if the pose or posed coordinates are out
 * of range. */
static ebpo_status posing_of(const ebpo_scene *scene, uint64_t instance, double time,
                             ebpo_posing *out, ebpo_error *error)
{
    const ebpo_scene_model_entry *m = model_of_instance(scene, instance);
    double max_coordinate[3];
    ebpo_pose pose;
    for (int k = 0; k < 3; k++)
        max_coordinate[k] = fmax(fabs(m->min[k]), fabs(m->max[k]));
    ebpo_status status = ebpo_scene_pose(scene, instance, time, &pose, error);
    return status == EBPO_OK ? ebpo_posing_make(out, &pose, max_coordinate, error) : status;
}

/* The box of a model at a pose. The box's sides need not be parallel to the axes of the world. */
typedef struct posed_box {
    double middle[3];  /* centre of the box, in the world */
    double half[3][3]; /* [axis of the box] vector from the centre to the middle of a side */
    double size;       /* sum of the absolute values of all terms of the posed coordinates, for
                          bounds of their rounding errors */
} posed_box;

static void pose_box(const ebpo_posing *p, const ebpo_scene_model_entry *m, posed_box *out)
{
    double middle[3];
    for (int k = 0; k < 3; k++)
        middle[k] = m->min[k] / 2 + m->max[k] / 2;
    ebpo_posing_apply(p, middle, out->middle);
    out->size = 0;
    for (int i = 0; i < 3; i++) {
        out->size += fabs(p->translation[i]);
        for (int k = 0; k < 3; k++) {
            double max_coordinate = fmax(fabs(m->min[k]), fabs(m->max[k]));
            out->half[k][i] = p->matrix[i][k] * (m->max[k] / 2 - m->min[k] / 2);
            out->size += fabs(p->matrix[i][k]) * max_coordinate;
        }
    }
}

ebpo_status ebpo_scene_make_relative_box(const ebpo_scene *scene, uint64_t self, uint64_t other,
                                         double time, ebpo_scene_relative_box *out,
                                         ebpo_error *error)
{
    const ebpo_scene_model_entry *m = model_of_instance(scene, self);
    ebpo_posing posing, other_posing;
    posed_box b;
    ebpo_status status = posing_of(scene, self, time, &posing, error);
    if (status == EBPO_OK)
        status = posing_of(scene, other, time, &other_posing, error);
    if (status != EBPO_OK)
        return status;
    pose_box(&other_posing, model_of_instance(scene, other), &b);
    double scale = posing.scale, sizes = b.size, max_coordinate = 0;
    for (int i = 0; i < 3; i++) {
        sizes += fabs(posing.translation[i]);
        max_coordinate += fmax(fabs(m->min[i]), fabs(m->max[i]));
    }
    /* The transposed matrix is used as the inverse, which is not exact. `error_bound` bounds the
     * error of this inverse, including rounding, for points of the model's box. */
    double error_bound =
        (sizes + max_coordinate * scale) * slack / scale + 3 * posing.error_bound * max_coordinate;
    out->rounding = error_bound;
    for (int k = 0; k < 3; k++) {
        double middle = 0, half = error_bound;
        for (int i = 0; i < 3; i++)
            middle += posing.matrix[i][k] / scale * ((b.middle[i] - posing.translation[i]) / scale);
        for (int j = 0; j < 3; j++) {
            double sum = 0;
            for (int i = 0; i < 3; i++)
                sum += posing.matrix[i][k] / scale * (b.half[j][i] / scale);
            half += fabs(sum);
        }
        out->box.min[k] = middle - half;
        out->box.max[k] = middle + half;
    }
    out->unit = scale * (1 - 2 * posing.error_bound);
    return EBPO_OK;
}

double ebpo_scene_bounds_gap(const ebpo_scene_bounds *a, const ebpo_scene_bounds *b)
{
    double apart[3];
    for (int k = 0; k < 3; k++)
        apart[k] = fmax(fmax(a->min[k] - b->max[k], b->min[k] - a->max[k]), 0);
    return ebpo_scene_length_above(apart) * (1 - 8 * slack);
}

/* Returns false if the file of the instance's model has all faces. Otherwise sets *out to the kept
 * box: the file has all faces of the model in this box. The box is empty if the file guarantees no
 * box. */
static bool get_kept_box(const ebpo_scene *scene, uint64_t instance, ebpo_scene_bounds *out)
{
    const ebpo_info *info =
        ebpo_file_info(ebpo_scene_file(scene, scene->instances[instance].description.model));
    bool mesh = info->parts & EBPO_PART_MESH;
    if (mesh && !info->pruned)
        return false;
    for (int k = 0; k < 3; k++) {
        bool has_box = mesh && info->boxed && !info->cut_levels && !(info->kept_error > 0);
        out->min[k] = has_box ? info->kept_box[k] : INFINITY;
        out->max[k] = has_box ? info->kept_box[3 + k] : -INFINITY;
    }
    return true;
}

/* Returns a lower bound of the distance of the box `other` from the points of the box `all` that
 * are outside the box `kept`. These points are in up to six boxes, one for each face of `kept`. */
static double distance_outside(const ebpo_scene_bounds *all, const ebpo_scene_bounds *kept,
                               const ebpo_scene_bounds *other)
{
    double distance = INFINITY;
    for (int k = 0; k < 3; k++) {
        ebpo_scene_bounds beside = *all;
        beside.max[k] = fmin(kept->min[k], all->max[k]);
        if (all->min[k] < kept->min[k])
            distance = fmin(distance, ebpo_scene_bounds_gap(&beside, other));
        beside = *all;
        beside.min[k] = fmax(kept->max[k], all->min[k]);
        if (all->max[k] > kept->max[k])
            distance = fmin(distance, ebpo_scene_bounds_gap(&beside, other));
    }
    return distance;
}

/* Sets *distance to a lower bound of the distance between the instance `other` and the faces that
 * the file of the instance `self` omits; INFINITY if no faces are omitted. */
static ebpo_status bound_omitted(const ebpo_scene *scene, uint64_t self, uint64_t other,
                                 double time, double *distance, ebpo_error *error)
{
    const ebpo_scene_model_entry *m = model_of_instance(scene, self);
    ebpo_scene_bounds kept, all;
    ebpo_scene_relative_box other_box;
    *distance = INFINITY;
    if (!get_kept_box(scene, self, &kept))
        return EBPO_OK;
    memcpy(all.min, m->min, sizeof all.min);
    memcpy(all.max, m->max, sizeof all.max);
    ebpo_status status = ebpo_scene_make_relative_box(scene, self, other, time, &other_box, error);
    if (status == EBPO_OK)
        *distance = distance_outside(&all, &kept, &other_box.box) * other_box.unit;
    return status;
}

ebpo_status ebpo_scene_omitted(const ebpo_scene *scene, const ebpo_scene_pair *pair, double time,
                               double *distance, uint64_t *omitted_in, ebpo_error *error)
{
    /* from_a: lower bound of the distance between instance b and the faces that the file of a
     * omits; from_b: the same with a and b exchanged */
    double from_a, from_b;
    ebpo_status status = bound_omitted(scene, pair->a, pair->b, time, &from_a, error);
    if (status == EBPO_OK)
        status = bound_omitted(scene, pair->b, pair->a, time, &from_b, error);
    if (status != EBPO_OK)
        return status;
    *distance = fmin(from_a, from_b);
    *omitted_in = from_a <= from_b ? pair->a : pair->b;
    return EBPO_OK;
}

ebpo_status ebpo_scene_fail_omitted(const ebpo_scene *scene, const ebpo_scene_pair *pair,
                                    uint64_t omitted_in, double time, bool solids,
                                    ebpo_error *error)
{
    const ebpo_scene_model_entry *m = model_of_instance(scene, omitted_in);
    return ebpo_fail(
        error, EBPO_E_ABSENT,
        "instances '%.80s' and '%.80s' at time %.9g: the file of model '%.80s' is a subset or "
        "has no mesh, and the omitted part may change the result; query a scene with more of the "
        "model%s",
        scene->instances[pair->a].description.name, scene->instances[pair->b].description.name,
        time, m->name, solids ? ", such as a scene from ebpo scene pack --solids" : "");
}

static const ebpo_scene_route *route_of(const ebpo_scene *scene, uint64_t instance)
{
    uint64_t route = scene->instances[instance].description.route;
    return route == EBPO_SCENE_NONE ? NULL : &scene->routes[route];
}

/* Returns true if both instances follow one route, or two routes with the same keys. Their relative
 * position then changes only by rounding and by changes of the route's scale. */
static bool follows_one_route(const ebpo_scene *scene, const ebpo_scene_pair *pair)
{
    const ebpo_scene_route *a = route_of(scene, pair->a), *b = route_of(scene, pair->b);
    if (!a || !b)
        return false;
    return a == b || (a->count == b->count && a->jumps == b->jumps &&
                      memcmp(a->keys, b->keys, a->count * sizeof *a->keys) == 0);
}

/* Returns an upper bound of the change of the pair's distance that follows from the rounding of the
 * routes' poses; 0 if neither instance has a route. */
static double pair_rounding(const ebpo_scene *scene, const ebpo_scene_pair *pair)
{
    double sum = 0;
    for (int i = 0; i < 2; i++) {
        uint64_t instance = i ? pair->b : pair->a;
        const ebpo_scene_route *route = route_of(scene, instance);
        if (route)
            sum +=
                ebpo_scene_route_rounding(route,
                                          ebpo_scene_extent_of(scene, &scene->instances[instance]));
    }
    return sum;
}

/* Bounds the motion of a pair on one route. The pose of the route is the same for both instances,
 * to the last bit. So the distance of two points, one of each instance, is the route's scale times
 * the points' distance in the coordinates of the route. This distance changes only with the scale
 * and by rounding. */
static double motion_on_one_route(const ebpo_scene *scene, const ebpo_scene_pair *pair, double from,
                                  double to)
{
    ebpo_scene_extent a = ebpo_scene_extent_of(scene, &scene->instances[pair->a]);
    ebpo_scene_extent b = ebpo_scene_extent_of(scene, &scene->instances[pair->b]);
    return ebpo_scene_route_growth(route_of(scene, pair->a), from, to,
                                   (ebpo_scene_extent){ a.max_distance + b.max_distance,
                                                        a.size + b.size });
}

/* Sets *out to an upper bound of the change of the pair's distance between two times; INFINITY if a
 * route jumps between them. shares_route: result of follows_one_route. */
static ebpo_status pair_motion(const ebpo_scene *scene, const ebpo_scene_pair *pair,
                               bool shares_route, double from, double to, double *out,
                               ebpo_error *error)
{
    double a, b;
    ebpo_status status = ebpo_scene_motion(scene, pair->a, from, to, &a, error);
    if (status == EBPO_OK)
        status = ebpo_scene_motion(scene, pair->b, from, to, &b, error);
    if (status != EBPO_OK)
        return status;
    *out = (a + b) * (1 + 0x1p-50);
    if (shares_route && from < to)
        *out = fmin(*out, motion_on_one_route(scene, pair, from, to));
    return EBPO_OK;
}

double ebpo_scene_pair_next(const ebpo_scene *scene, const ebpo_scene_pair *pair, double from,
                            double to)
{
    double next = to;
    for (int i = 0; i < 2; i++) {
        const ebpo_scene_route *route = route_of(scene, i ? pair->b : pair->a);
        if (route)
            next = fmin(next, ebpo_scene_route_next(route, from, to));
    }
    return next;
}

/* --- lists of pairs --- */

static bool keep_pairs(void *user, const ebpo_scene_pair *pairs, uint64_t count)
{
    ebpo_scene_pairs_list *list = user;
    list->pairs = ebpo_alloc(count, sizeof *pairs);
    list->count = count;
    if (list->pairs)
        memcpy(list->pairs, pairs, count * sizeof *pairs);
    return true;
}

ebpo_status ebpo_scene_make_models(ebpo_scene *scene, const ebpo_scene_pair *pairs, uint64_t count,
                                   ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    ebpo_model *model;
    for (uint64_t i = 0; i < 2 * count && status == EBPO_OK; i++) {
        uint64_t instance = i % 2 ? pairs[i / 2].b : pairs[i / 2].a;
        status =
            ebpo_scene_model(scene, scene->instances[instance].description.model, &model, error);
    }
    return status;
}

ebpo_status ebpo_scene_keep_pairs(const ebpo_scene *scene, double from, double to,
                                  ebpo_scene_pairs_list *out, ebpo_error *error)
{
    *out = (ebpo_scene_pairs_list){ 0 };
    ebpo_status status = ebpo_scene_pairs(scene, from, to, keep_pairs, out, error);
    if (status == EBPO_OK && out->count && !out->pairs)
        status = ebpo_fail_memory(error, out->count * sizeof *out->pairs);
    return status;
}

/* Lists the pairs as ebpo_scene_keep_pairs does, and makes their models. On failure there is
 * nothing to free. */
static ebpo_status list_pairs(ebpo_scene *scene, double from, double to, ebpo_scene_pairs_list *out,
                              ebpo_error *error)
{
    ebpo_status status = ebpo_scene_keep_pairs(scene, from, to, out, error);
    if (status == EBPO_OK)
        status = ebpo_scene_make_models(scene, out->pairs, out->count, error);
    if (status != EBPO_OK) {
        free(out->pairs);
        *out = (ebpo_scene_pairs_list){ 0 };
    }
    return status;
}

/* Context of find_in_range. */
typedef struct pair_results {
    const ebpo_scene_search *search;
    const ebpo_scene_pair *pairs;
    char *results; /* [pairs] each of search->result_size bytes */
} pair_results;

static ebpo_status find_in_range(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    const pair_results *f = context;
    const ebpo_scene_search *s = f->search;
    ebpo_status status = EBPO_OK;
    (void)worker;
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++)
        status = s->find(s->context, &f->pairs[i], f->results + i * s->result_size, error);
    return status;
}

ebpo_status ebpo_scene_find_in_pairs(ebpo_scene *scene, double from, double to,
                                     const ebpo_scene_search *search, void **results,
                                     uint64_t *count, ebpo_error *error)
{
    ebpo_scene_pairs_list list;
    ebpo_status status = list_pairs(scene, from, to, &list, error);
    *count = list.count;
    *results = ebpo_alloc(list.count, search->result_size);
    if (status == EBPO_OK && !*results)
        status = ebpo_fail_memory(error, list.count * search->result_size);
    pair_results context = { search, list.pairs, *results };
    if (status == EBPO_OK)
        status =
            ebpo_parallel_for(ebpo_thread_count(search->threads), NULL, list.count, search->grain,
                              find_in_range, &context, search->progress, search->stage, error);
    free(list.pairs);
    return status;
}

static ebpo_model *opened_model(const ebpo_scene *scene, uint64_t instance)
{
    return scene->files[scene->models[scene->instances[instance].description.model].file].model;
}

static bool has_mesh(const ebpo_scene *scene, uint64_t instance)
{
    uint64_t model = scene->instances[instance].description.model;
    return ebpo_file_info(ebpo_scene_file(scene, model))->parts & EBPO_PART_MESH;
}

ebpo_status ebpo_scene_collider(const ebpo_scene *scene, const ebpo_scene_pair *pair,
                                unsigned threads, ebpo_collider **out, ebpo_error *error)
{
    ebpo_collider_options options = EBPO_COLLIDER_OPTIONS_INIT;
    options.threads = threads;
    *out = NULL;
    if (!has_mesh(scene, pair->a) || !has_mesh(scene, pair->b))
        return EBPO_OK;
    return ebpo_collider_of_parts(opened_model(scene, pair->a), opened_model(scene, pair->b),
                                  &options, out, error);
}

ebpo_status ebpo_scene_pose_pair(const ebpo_scene *scene, const ebpo_scene_pair *pair, double time,
                                 ebpo_collide_options *out, ebpo_error *error)
{
    ebpo_status status = ebpo_scene_pose(scene, pair->a, time, &out->pose_a, error);
    return status == EBPO_OK ? ebpo_scene_pose(scene, pair->b, time, &out->pose_b, error) : status;
}

/* Bounds the distance, at a given time, between the faces in the file of a and the faces in the
 * file of b; omitted faces are not considered. If there is no collider, one of the files has no
 * faces, and both bounds are INFINITY. */
static ebpo_status query_distance(ebpo_scene_evaluations *l, double time, double *lo, double *hi,
                                  ebpo_error *error)
{
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_collide_distance_options query = EBPO_COLLIDE_DISTANCE_OPTIONS_INIT;
    ebpo_collide_distance_result found = { .distance = { .lo = INFINITY, .hi = INFINITY } };
    query.tolerance = l->tolerance;
    /* A warm query begins with the result of the previous query of its collider, so lo and hi may
     * depend on the previous query. Each pair of instances has a separate collider, so that results
     * do not depend on the order in which pairs are evaluated. */
    query.warm = true;
    ebpo_status status = ebpo_scene_pose_pair(l->scene, l->pair, time, &options, error);
    if (status == EBPO_OK && l->collider)
        status = ebpo_collide_distance(l->collider, &options, &query, &found, error);
    *lo = found.distance.lo;
    *hi = found.distance.hi;
    return status;
}

ebpo_status ebpo_scene_evaluate(ebpo_scene_evaluations *l, double time, double *lo, double *hi,
                                ebpo_error *error)
{
    l->omitted_distance = INFINITY;
    ebpo_status status = query_distance(l, time, lo, hi, error);
    if (status == EBPO_OK)
        status = ebpo_scene_omitted(l->scene, l->pair, time, &l->omitted_distance, &l->omitted_in,
                                    error);
    *lo = fmin(*lo, l->omitted_distance);
    return status;
}

ebpo_status ebpo_scene_evaluations_begin(ebpo_scene_evaluations *l, const ebpo_scene *scene,
                                         const ebpo_scene_pair *pair, double tolerance,
                                         ebpo_error *error)
{
    *l = (ebpo_scene_evaluations){ .scene = scene, .pair = pair, .tolerance = tolerance / 4 };
    /* with a smaller tolerance, a query takes longer and only finds rounding errors of the poses */
    l->tolerance = fmax(l->tolerance, pair_rounding(scene, pair) / 16);
    l->shares_route = follows_one_route(scene, pair);
    return ebpo_scene_collider(scene, pair, 1, &l->collider, error);
}

ebpo_status ebpo_scene_evaluations_motion(const ebpo_scene_evaluations *l, double from, double to,
                                          double *out, ebpo_error *error)
{
    return pair_motion(l->scene, l->pair, l->shares_route, from, to, out, error);
}

bool ebpo_scene_is_within(double hi, double lo, double tolerance)
{
    return hi <= lo || (hi - lo) * (1 + 0x1p-52) <= tolerance;
}

ebpo_status ebpo_scene_take_approach_options(ebpo_scene_approach_options *checked,
                                             const ebpo_scene_approach_options *options,
                                             ebpo_error *error)
{
    ebpo_status status = EBPO_TAKE(ebpo_scene_approach_options, checked, options, error);
    if (status == EBPO_OK && !(checked->tolerance > 0 && checked->tolerance < INFINITY))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "expected a tolerance above 0, got %g",
                         checked->tolerance);
    if (!checked->max_evaluations)
        checked->max_evaluations = 10000;
    return status;
}
