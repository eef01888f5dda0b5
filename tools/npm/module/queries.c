/* Evaluates queries of many points, rays and boxes, for the WebAssembly module. Inputs are arrays
 * of doubles. There is one result array for each member of the library's result struct. Indices of
 * faces have 32 bits; UINT32_MAX is EBPO_NO_FACE. After EBPO_E_PENDING, the caller repeats the call
 * with the same arguments, and completed items are not evaluated again. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "module.h"

static uint32_t face_index(uint64_t face)
{
    return face == EBPO_NO_FACE ? UINT32_MAX : (uint32_t)face;
}

/* Index of the result array with the flags of completed items. */
enum { DONE = 15 };

static bool *done_flags(ebpo_js_object *object, uint32_t count)
{
    return ebpo_js_fixed(object, DONE, count, sizeof(bool));
}

/* Returns the number of completed items of a query. */
double EBPO_JS(ebpo_js_completed)(const ebpo_js_object *object)
{
    size_t completed = 0;
    for (size_t i = 0; i < object->array[DONE].bytes; i++)
        completed += object->array[DONE].data[i];
    return (double)completed;
}

/* Classifies points. Array 0: ebpo_where, int8. Array 1: winding numbers, int32. */
int EBPO_JS(ebpo_js_inside)(ebpo_js_object *object, const double *points, uint32_t count, int level)
{
    ebpo_inside_options options = EBPO_INSIDE_OPTIONS_INIT;
    options.level = level;
    options.done = done_flags(object, count);
    ebpo_inside_result *results = ebpo_js_fixed(object, 2, count, sizeof *results);
    int8_t *where = ebpo_js_fixed(object, 0, count, sizeof *where);
    int32_t *winding = ebpo_js_fixed(object, 1, count, sizeof *winding);
    if (!options.done || !results || !where || !winding)
        return EBPO_E_MEMORY;
    ebpo_status status =
        ebpo_inside_many(object->context, points, count, &options, results, &object->error);
    for (uint32_t i = 0; i < count && status == EBPO_OK; i++) {
        where[i] = (int8_t)results[i].where;
        winding[i] = results[i].winding;
    }
    return status;
}

/* Computes winding numbers. Array 0: lower and upper bound of each winding number, doubles. */
int EBPO_JS(ebpo_js_winding)(ebpo_js_object *object, const double *points, uint32_t count,
                             double width)
{
    ebpo_winding_bounds *bounds = ebpo_js_fixed(object, 0, count, sizeof *bounds);
    return bounds ? ebpo_winding(object->context, points, count, width, bounds, &object->error)
                  : EBPO_E_MEMORY;
}

/* Computes distances. Array 0: distances. Array 1: upper bounds. Array 2: nearest points [3]. Array
 * 3: normals [3]. Array 4: faces, uint32. Array 5: lower bounds. Arrays 0 to 3 and 5: doubles. */
int EBPO_JS(ebpo_js_distance)(ebpo_js_object *object, const double *points, uint32_t count,
                              int level, double max_distance, int is_unsigned)
{
    ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
    options.level = level;
    options.max_distance = max_distance;
    options.unsigned_distance = is_unsigned;
    options.done = done_flags(object, count);
    ebpo_distance_result *results = ebpo_js_fixed(object, 6, count, sizeof *results);
    double *distance = ebpo_js_fixed(object, 0, count, sizeof *distance);
    double *hi = ebpo_js_fixed(object, 1, count, sizeof *hi);
    double(*point)[3] = ebpo_js_fixed(object, 2, count, sizeof *point);
    double(*normal)[3] = ebpo_js_fixed(object, 3, count, sizeof *normal);
    uint32_t *face = ebpo_js_fixed(object, 4, count, sizeof *face);
    double *lo = ebpo_js_fixed(object, 5, count, sizeof *lo);
    if (!options.done || !results || !distance || !hi || !point || !normal || !face || !lo)
        return EBPO_E_MEMORY;
    ebpo_status status =
        ebpo_distance_many(object->context, points, count, &options, results, &object->error);
    for (uint32_t i = 0; i < count && status == EBPO_OK; i++) {
        const ebpo_distance_result *r = &results[i];
        distance[i] = r->distance;
        hi[i] = r->hi;
        lo[i] = r->lo;
        memcpy(point[i], r->point, sizeof r->point);
        memcpy(normal[i], r->normal, sizeof r->normal);
        face[i] = face_index(r->face);
    }
    return status;
}

static bool take_near_face(void *user, const ebpo_near_face *near)
{
    ebpo_js_object *object = user;
    uint32_t face = face_index(near->face);
    return ebpo_js_put(object, 0, &near->distance, sizeof near->distance) == EBPO_OK &&
           ebpo_js_put(object, 2, near->point, sizeof near->point) == EBPO_OK &&
           ebpo_js_put(object, 3, near->normal, sizeof near->normal) == EBPO_OK &&
           ebpo_js_put(object, 4, &face, sizeof face) == EBPO_OK;
}

/* Gets the faces within `radius` of a point. Arrays 0, 2, 3 and 4 are as in ebpo_js_distance.
 * `most`: maximum number of faces; 0: all faces. */
int EBPO_JS(ebpo_js_within)(ebpo_js_object *object, const double *point, double radius, double most)
{
    ebpo_within_options options = EBPO_WITHIN_OPTIONS_INIT;
    options.radius = radius;
    options.most = (uint64_t)most;
    ebpo_js_clear(object);
    object->error.status = EBPO_OK;
    ebpo_status status = ebpo_distance_within(object->context, point, &options, take_near_face,
                                              object, &object->error);
    return object->error.status == EBPO_E_MEMORY ? EBPO_E_MEMORY : status;
}

/* ---- rays ---- */

/* Converts rays from doubles [count][6] (origin and direction). Returns the rays, which are in
 * array 6; NULL when out of memory. */
static ebpo_ray *make_rays(ebpo_js_object *object, const double *lines, uint32_t count,
                           double t_max)
{
    ebpo_ray *rays = ebpo_js_fixed(object, 6, count, sizeof *rays);
    for (uint32_t i = 0; i < count && rays; i++) {
        memcpy(rays[i].origin, lines + 6 * (size_t)i, sizeof rays[i].origin);
        memcpy(rays[i].direction, lines + 6 * (size_t)i + 3, sizeof rays[i].direction);
        rays[i].t_max = t_max;
    }
    return rays;
}

/* Puts hits into result arrays. Array 0: t. Array 1: faces. Array 2: sides. */
static ebpo_status put_hits(ebpo_js_object *object, const ebpo_ray_hit *hits, uint64_t count)
{
    double *t = ebpo_js_fixed(object, 0, count, sizeof *t);
    uint32_t *face = ebpo_js_fixed(object, 1, count, sizeof *face);
    int8_t *side = ebpo_js_fixed(object, 2, count, sizeof *side);
    if (!t || !face || !side)
        return EBPO_E_MEMORY;
    for (uint64_t i = 0; i < count; i++) {
        t[i] = hits[i].t;
        face[i] = face_index(hits[i].face);
        side[i] = (int8_t)hits[i].side;
    }
    return EBPO_OK;
}

static ebpo_ray_options ray_options(int sides)
{
    ebpo_ray_options options = EBPO_RAY_OPTIONS_INIT;
    options.sides = (ebpo_ray_sides)sides;
    options.threads = 1;
    return options;
}

/* Gets the first hit of each ray, in the arrays of put_hits. */
int EBPO_JS(ebpo_js_ray_first)(ebpo_js_object *object, const double *lines, uint32_t count,
                               double t_max, int sides)
{
    ebpo_ray_options options = ray_options(sides);
    options.done = done_flags(object, count);
    ebpo_ray *rays = make_rays(object, lines, count, t_max);
    ebpo_ray_hit *hits = ebpo_js_fixed(object, 7, count, sizeof *hits);
    if (!options.done || !rays || !hits)
        return EBPO_E_MEMORY;
    ebpo_status status =
        ebpo_ray_first_many(object->context, rays, count, &options, hits, &object->error);
    return status == EBPO_OK ? put_hits(object, hits, count) : status;
}

/* Gets all hits of each ray, in the arrays of put_hits. Array 3: index of the first hit of each
 * ray, and at the end the number of all hits. */
int EBPO_JS(ebpo_js_ray_all)(ebpo_js_object *object, const double *lines, uint32_t count,
                             double t_max, int sides)
{
    const ebpo_ray_hit *hits = NULL;
    const uint64_t *begin = NULL;
    ebpo_ray_options options = ray_options(sides);
    ebpo_js_clear(object);
    ebpo_ray *rays = make_rays(object, lines, count, t_max);
    uint32_t *first = ebpo_js_extend(object, 3, (uint64_t)count + 1, sizeof *first);
    if (!rays || !first)
        return EBPO_E_MEMORY;
    ebpo_status status =
        ebpo_ray_all_many(object->context, rays, count, &options, &hits, &begin, &object->error);
    if (status != EBPO_OK)
        return status;
    for (uint32_t i = 0; i <= count; i++)
        first[i] = (uint32_t)begin[i];
    return put_hits(object, hits, begin[count]);
}

/* Array 0: for each ray, 1 if the ray hits a face, else 0; uint8. */
int EBPO_JS(ebpo_js_ray_any)(ebpo_js_object *object, const double *lines, uint32_t count,
                             double t_max, int sides)
{
    ebpo_ray_options options = ray_options(sides);
    options.done = done_flags(object, count);
    ebpo_ray *rays = make_rays(object, lines, count, t_max);
    bool *any = ebpo_js_fixed(object, 0, count, sizeof *any);
    if (!options.done || !rays || !any)
        return EBPO_E_MEMORY;
    return ebpo_ray_any_many(object->context, rays, count, &options, any, &object->error);
}

/* ---- queries of one point or ray: results are in `number` of the object ---- */

/* Returns the numbers of an object, which JavaScript reads. */
const double *EBPO_JS(ebpo_js_numbers)(const ebpo_js_object *object) { return object->number; }

/* Numbers: ebpo_where, winding number. */
int EBPO_JS(ebpo_js_inside_one)(ebpo_js_object *object, double x, double y, double z, int level)
{
    ebpo_inside_options options = EBPO_INSIDE_OPTIONS_INIT;
    ebpo_inside_result result = { .where = EBPO_OUT };
    options.level = level;
    ebpo_status status = ebpo_inside(object->context, (double[]){ x, y, z },
                                     level < 0 ? NULL : &options, &result, &object->error);
    object->number[0] = result.where;
    object->number[1] = result.winding;
    return status;
}

/* Numbers: distance, its bounds, point [3], normal [3], face. */
int EBPO_JS(ebpo_js_distance_one)(ebpo_js_object *object, double x, double y, double z, int level,
                                  double max_distance, int is_unsigned)
{
    ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
    ebpo_distance_result result = { .face = EBPO_NO_FACE };
    options.level = level;
    options.max_distance = max_distance;
    options.unsigned_distance = is_unsigned;
    ebpo_status status =
        ebpo_distance(object->context, (double[]){ x, y, z }, &options, &result, &object->error);
    object->number[0] = result.distance;
    object->number[1] = result.lo;
    object->number[2] = result.hi;
    memcpy(object->number + 3, result.point, sizeof result.point);
    memcpy(object->number + 6, result.normal, sizeof result.normal);
    object->number[9] = face_index(result.face);
    return status;
}

/* Numbers: t, face, side of the first hit. */
int EBPO_JS(ebpo_js_ray_one)(ebpo_js_object *object, double x, double y, double z, double dx,
                             double dy, double dz, double t_max, int sides)
{
    ebpo_ray ray = { .origin = { x, y, z }, .direction = { dx, dy, dz }, .t_max = t_max };
    ebpo_ray_options options = ray_options(sides);
    ebpo_ray_hit hit = { .t = INFINITY, .face = EBPO_NO_FACE };
    bool found;
    ebpo_status status =
        sides == EBPO_RAY_BOTH
            ? ebpo_ray_first(object->context, ray.origin, ray.direction, t_max, &hit, &found,
                             &object->error)
            : ebpo_ray_first_many(object->context, &ray, 1, &options, &hit, &object->error);
    object->number[0] = hit.t;
    object->number[1] = face_index(hit.face);
    object->number[2] = hit.side;
    return status;
}

/* ---- boxes ---- */

/* Gets the faces that intersect a box. Array 0: faces. `box`: [6] min, max. */
int EBPO_JS(ebpo_js_box_faces)(ebpo_js_object *object, const double *box)
{
    const uint64_t *faces = NULL;
    uint64_t count = 0;
    ebpo_js_clear(object);
    ebpo_status status =
        ebpo_faces_in_box(object->context, box, box + 3, &faces, &count, &object->error);
    uint32_t *out = status == EBPO_OK ? ebpo_js_extend(object, 0, count, sizeof *out) : NULL;
    if (!out)
        return status == EBPO_OK ? EBPO_E_MEMORY : status;
    for (uint64_t i = 0; i < count; i++)
        out[i] = face_index(faces[i]);
    return EBPO_OK;
}

/* Context of take_triangles, which stops the query after more than `most` triangles. */
typedef struct triangle_taking {
    ebpo_js_object *object;
    double most;
} triangle_taking;

static bool take_triangles(void *user, const ebpo_triangles *triangles)
{
    triangle_taking *taking = user;
    ebpo_js_object *object = taking->object;
    uint32_t *faces = ebpo_js_extend(object, 0, triangles->count, sizeof *faces);
    for (uint64_t i = 0; i < triangles->count && faces; i++)
        faces[i] = face_index(triangles->faces[i]);
    return faces &&
           ebpo_js_put(object, 1, triangles->corners,
                       (size_t)triangles->count * sizeof *triangles->corners) == EBPO_OK &&
           (double)object->array[0].bytes / sizeof *faces <= taking->most;
}

/* Gets the faces that intersect a box, and their corners. Array 0: faces. Array 1: corners [3][3],
 * doubles. Stops when there are more than `most` faces. */
int EBPO_JS(ebpo_js_box_triangles)(ebpo_js_object *object, const double *box, double most)
{
    triangle_taking taking = { object, most };
    ebpo_js_clear(object);
    object->error.status = EBPO_OK;
    ebpo_status status = ebpo_triangles_in_box(object->context, box, box + 3, take_triangles,
                                               &taking, &object->error);
    return object->error.status == EBPO_E_MEMORY ? EBPO_E_MEMORY : status;
}
