#include "ebpo_config.h"
#if EBPO_HAVE_EXTRAS
#include <ebpo/haptic.h>
#endif
#include "query_mix.h"

#include <math.h>
#include <string.h>

#include <ebpo/ebpo.h>

#include "solids.h"

/* --- hashes: FNV-1a --- */

static const uint64_t basis = 14695981039346656037u;

static uint64_t add(uint64_t hash, const void *data, size_t size)
{
    for (const uint8_t *b = data; size > 0; b++, size--)
        hash = (hash ^ *b) * 1099511628211u;
    return hash;
}

static uint64_t add_number(uint64_t hash, uint64_t n) { return add(hash, &n, sizeof n); }

/* --- query points --- */

/* Returns a point in the bounding box of the model, or slightly outside. */
static void point_of(const mix_session *a, uint64_t number, double point[3])
{
    const ebpo_info *info = ebpo_file_info(a->file);
    uint64_t state = number * 7919 + 1;
    for (int k = 0; k < 3; k++)
        point[k] =
            info->box_origin[k] + info->box_size[k] * (1.2 * ebpo_test_random_unit(&state) - 0.1);
}

static ebpo_ray ray_of(const mix_session *a, uint64_t number)
{
    ebpo_ray ray = { .t_max = INFINITY };
    double to[3];
    point_of(a, number, ray.origin);
    point_of(a, number + 1000003, to);
    for (int k = 0; k < 3; k++)
        ray.direction[k] = to[k] - ray.origin[k];
    return ray;
}

static void box_of(const mix_session *a, uint64_t number, double min[3], double max[3])
{
    const ebpo_info *info = ebpo_file_info(a->file);
    point_of(a, number, min);
    for (int k = 0; k < 3; k++)
        max[k] = min[k] + info->box_size[k] * (1 + (double)(number % 4)) / 16;
}

/* --- queries --- */

static ebpo_status query_inside(const mix_session *a, uint64_t number, uint64_t *hash,
                                ebpo_error *error)
{
    double point[3];
    ebpo_inside_result r;
    point_of(a, number, point);
    ebpo_status status = ebpo_inside(a->context, point, NULL, &r, error);
    if (status == EBPO_OK)
        *hash = add_number(add_number(*hash, (uint64_t)r.where), (uint64_t)r.winding);
    return status;
}

enum { MANY = 12 };

static ebpo_status query_inside_many(const mix_session *a, uint64_t number, uint64_t *hash,
                                     ebpo_error *error)
{
    double points[MANY][3];
    ebpo_inside_result r[MANY];
    for (uint64_t i = 0; i < MANY; i++)
        point_of(a, number * MANY + i, points[i]);
    ebpo_status status = ebpo_inside_many(a->context, points[0], MANY, NULL, r, error);
    for (int i = 0; i < MANY && status == EBPO_OK; i++)
        *hash = add_number(add_number(*hash, (uint64_t)r[i].where), (uint64_t)r[i].winding);
    return status;
}

static ebpo_status query_distance(const mix_session *a, uint64_t number, uint64_t *hash,
                                  ebpo_error *error)
{
    double point[3];
    ebpo_distance_result r;
    point_of(a, number, point);
    ebpo_status status = ebpo_distance(a->context, point, NULL, &r, error);
    if (status == EBPO_OK)
        *hash = add(*hash, &r, sizeof r);
    return status;
}

static ebpo_status query_distance_many(const mix_session *a, uint64_t number, uint64_t *hash,
                                       ebpo_error *error)
{
    double points[MANY][3];
    ebpo_distance_result r[MANY];
    for (uint64_t i = 0; i < MANY; i++)
        point_of(a, number * MANY + i, points[i]);
    ebpo_status status = ebpo_distance_many(a->context, points[0], MANY, NULL, r, error);
    if (status == EBPO_OK)
        *hash = add(*hash, r, sizeof r);
    return status;
}

static bool take_near(void *user, const ebpo_near_face *face)
{
    uint64_t *hash = user;
    *hash = add(*hash, &face->distance, sizeof face->distance);
    *hash = add_number(*hash, face->file_face);
    return true;
}

static ebpo_status query_within(const mix_session *a, uint64_t number, uint64_t *hash,
                                ebpo_error *error)
{
    ebpo_within_options options = EBPO_WITHIN_OPTIONS_INIT;
    double point[3];
    point_of(a, number, point);
    options.radius = ebpo_file_info(a->file)->box_size[0] / 4;
    options.most = 1 + number % 50;
    return ebpo_distance_within(a->context, point, &options, take_near, hash, error);
}

static uint64_t add_hit(uint64_t hash, const ebpo_ray_hit *hit)
{
    hash = add(hash, &hit->t, sizeof hit->t);
    return add_number(add_number(hash, hit->face), (uint64_t)hit->side);
}

static ebpo_status query_ray(const mix_session *a, uint64_t number, uint64_t *hash,
                             ebpo_error *error)
{
    ebpo_ray ray = ray_of(a, number);
    ebpo_ray_hit first;
    bool hit = false, any = false;
    ebpo_status status =
        ebpo_ray_first(a->context, ray.origin, ray.direction, ray.t_max, &first, &hit, error);
    if (status == EBPO_OK)
        status = ebpo_ray_any(a->context, ray.origin, ray.direction, ray.t_max, &any, error);
    if (status == EBPO_OK)
        *hash = hit ? add_hit(add_number(*hash, any), &first) : add_number(*hash, any);
    return status;
}

static ebpo_status query_ray_all(const mix_session *a, uint64_t number, uint64_t *hash,
                                 ebpo_error *error)
{
    ebpo_ray ray = ray_of(a, number);
    const ebpo_ray_hit *hits = NULL;
    uint64_t count = 0;
    ebpo_status status =
        ebpo_ray_all(a->context, ray.origin, ray.direction, ray.t_max, &hits, &count, error);
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++)
        *hash = add_hit(*hash, &hits[i]);
    return status;
}

static ebpo_status query_rays(const mix_session *a, uint64_t number, uint64_t *hash,
                              ebpo_error *error)
{
    ebpo_ray_options options = EBPO_RAY_OPTIONS_INIT;
    ebpo_ray rays[MANY];
    ebpo_ray_hit hits[MANY];
    options.threads = 2;
    for (uint64_t i = 0; i < MANY; i++)
        rays[i] = ray_of(a, number * MANY + i);
    ebpo_status status = ebpo_ray_first_many(a->context, rays, MANY, &options, hits, error);
    for (uint64_t i = 0; i < MANY && status == EBPO_OK; i++)
        *hash = add_number(*hash, hits[i].face);
    return status;
}

static ebpo_status query_box(const mix_session *a, uint64_t number, uint64_t *hash,
                             ebpo_error *error)
{
    double min[3], max[3];
    const uint64_t *faces = NULL;
    uint64_t count = 0, sum = 0;
    box_of(a, number, min, max);
    ebpo_status status = ebpo_faces_in_box(a->context, min, max, &faces, &count, error);
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++)
        sum += add_number(basis, faces[i]); /* the order of the faces is not fixed */
    *hash = add_number(add_number(*hash, count), sum);
    return status;
}

static bool take_triangles(void *user, const ebpo_triangles *t)
{
    uint64_t *sum = user;
    for (uint64_t i = 0; i < t->count; i++)
        *sum += add_number(add(basis, t->corners[i], sizeof t->corners[i]), t->faces[i]);
    return true;
}

static ebpo_status query_triangles(const mix_session *a, uint64_t number, uint64_t *hash,
                                   ebpo_error *error)
{
    double min[3], max[3];
    uint64_t sum = 0;
    box_of(a, number, min, max);
    ebpo_status status = ebpo_triangles_in_box(a->context, min, max, take_triangles, &sum, error);
    *hash = add_number(*hash, sum);
    return status;
}

/* --- files --- */

static uint64_t add_node(uint64_t hash, const ebpo_stream_node *node)
{
    hash = add_number(add_number(hash, node->octcode), (uint64_t)node->type);
    return add(hash, node->planes, node->plane_count * sizeof *node->planes);
}

static ebpo_status stream_levels(ebpo_stream *stream, int last, uint64_t *hash, ebpo_error *error)
{
    ebpo_stream_level level = { 0 };
    ebpo_stream_node node;
    ebpo_status status = EBPO_OK;
    bool more = true;
    ebpo_stream_prefetch(stream, last);
    for (int l = 0; l <= last && more && status == EBPO_OK; l++) {
        status = ebpo_stream_next_level(stream, &level, &more, error);
        for (bool next = more; next && status == EBPO_OK;) {
            status = ebpo_stream_next_node(stream, &node, &next, error);
            if (status == EBPO_OK && next)
                *hash = add_node(*hash, &node);
        }
    }
    return status;
}

static ebpo_status query_stream(const mix_session *a, uint64_t number, uint64_t *hash,
                                ebpo_error *error)
{
    ebpo_stream_options options = EBPO_STREAM_OPTIONS_INIT;
    ebpo_stream *stream;
    options.threads = 1;
    ebpo_status status = ebpo_stream_new(a->file, &options, &stream, error);
    if (status != EBPO_OK)
        return status;
    status = stream_levels(stream, (int)(number % 4), hash, error);
    ebpo_stream_free(stream);
    return status;
}

static ebpo_status view_nodes(ebpo_view_stream *stream, uint64_t *hash, ebpo_error *error)
{
    ebpo_view_end end = EBPO_VIEW_NODE;
    ebpo_view_node node;
    ebpo_status status = EBPO_OK;
    while (end == EBPO_VIEW_NODE && status == EBPO_OK) {
        status = ebpo_view_stream_next(stream, &node, &end, error);
        if (status == EBPO_OK && end == EBPO_VIEW_NODE)
            *hash = add_node(*hash, &node.node);
    }
    return status;
}

static ebpo_status query_view(const mix_session *a, uint64_t number, uint64_t *hash,
                              ebpo_error *error)
{
    ebpo_view_options options = EBPO_VIEW_OPTIONS_INIT;
    ebpo_observer observer = EBPO_OBSERVER_INIT;
    ebpo_view_stream *stream;
    point_of(a, number, observer.eye);
    options.priority = EBPO_PRIORITY_DISTANCE;
    options.observer = &observer;
    options.nodes = 50 + number % 200;
    options.memory = 1 << 20;
    ebpo_status status = ebpo_view_stream_new(a->file, &options, &stream, error);
    if (status != EBPO_OK)
        return status;
    status = view_nodes(stream, hash, error);
    ebpo_view_stream_free(stream);
    return status;
}

static ebpo_status query_subtree(const mix_session *a, uint64_t number, uint64_t *hash,
                                 ebpo_error *error)
{
    ebpo_subtree_options options = EBPO_SUBTREE_OPTIONS_INIT;
    ebpo_subtree_nodes nodes = EBPO_SUBTREE_NODES_INIT;
    ebpo_subtree_faces faces = EBPO_SUBTREE_FACES_INIT;
    ebpo_subtree *subtree;
    double point[3];
    point_of(a, number, point);
    uint64_t octcode = ebpo_octcode_at(ebpo_file_info(a->file), point, 3);
    options.or_leaf_above = true;
    ebpo_status status = ebpo_subtree_open(a->file, octcode, &options, &subtree, error);
    if (status == EBPO_E_ARGUMENT) { /* there is no such subtree */
        *hash = add_number(*hash, octcode);
        return EBPO_OK;
    }
    if (status != EBPO_OK)
        return status;
    status = ebpo_subtree_get_nodes(subtree, &nodes);
    if (status == EBPO_OK)
        status = ebpo_subtree_get_faces(subtree, &faces, error);
    if (status == EBPO_OK) {
        *hash = add(*hash, nodes.octcodes, nodes.node_count * sizeof *nodes.octcodes);
        *hash = add(*hash, faces.file_faces, faces.face_count * sizeof *faces.file_faces);
        *hash = faces.xyz64 ? add(*hash, faces.xyz64, 3 * faces.vertex_count * sizeof(double))
                            : add(*hash, faces.xyz32, 3 * faces.vertex_count * sizeof(float));
    }
    ebpo_subtree_close(subtree);
    return status;
}

static ebpo_status query_level(const mix_session *a, uint64_t number, uint64_t *hash,
                               ebpo_error *error)
{
    ebpo_read_options options = EBPO_READ_OPTIONS_INIT;
    ebpo_level level;
    options.threads = 1;
    int l = (int)(number % (uint64_t)ebpo_file_info(a->file)->level_count);
    ebpo_status status = ebpo_file_read_level(a->file, l, &options, &level, error);
    if (status != EBPO_OK)
        return status;
    *hash = add(*hash, level.types, level.group_count * sizeof *level.types);
    *hash = add(*hash, level.planes, level.plane_count * sizeof *level.planes);
    ebpo_level_free(&level);
    return status;
}

/* --- queries without a fixed result --- */

static ebpo_status query_counts(const mix_session *a, uint64_t number, uint64_t *hash,
                                ebpo_error *error)
{
    ebpo_model_stats model = EBPO_MODEL_STATS_INIT;
    ebpo_stored_sizes sizes = EBPO_STORED_SIZES_INIT;
    (void)number;
    *hash = 0;
    ebpo_status status = ebpo_model_get_stats(a->model, &model);
    return status == EBPO_OK ? ebpo_file_locate(a->file, &sizes, error) : status;
}

#if EBPO_HAVE_EXTRAS
/* Moves a haptic device through the model; its contacts depend on the loaded data. */
static ebpo_status query_haptic(const mix_session *a, uint64_t number, uint64_t *hash,
                                ebpo_error *error)
{
    enum { TICKS = 40 };
    const ebpo_info *info = ebpo_file_info(a->file);
    ebpo_haptic_options options = EBPO_HAPTIC_OPTIONS_INIT;
    ebpo_haptic_ball_result r;
    ebpo_haptic *touch;
    double hand[3], to[3];
    bool good = true;
    *hash = 0;
    for (int k = 0; k < 3; k++)
        hand[k] = info->box_origin[k] + 1.5 * info->box_size[k];
    point_of(a, number, to);
    options.faces = 256;
    ebpo_status status = ebpo_haptic_new(a->model, &options, hand, &touch, error);
    if (status != EBPO_OK)
        return status;
    for (int i = 0; i < TICKS; i++) {
        for (int k = 0; k < 3; k++)
            hand[k] += (to[k] - hand[k]) / 20;
        ebpo_haptic_step_ball(touch, hand, &r);
        good = good && isfinite(r.proxy[0] + r.force[0]);
    }
    status = ebpo_haptic_check(touch, error);
    ebpo_haptic_free(touch);
    return good ? status : EBPO_E_FORMAT; /* no query here returns this status for another reason */
}
#endif

/* --- */

typedef ebpo_status (*query_fn)(const mix_session *session, uint64_t number, uint64_t *hash,
                                ebpo_error *error);
static const query_fn run_query[MIX_KINDS] = {
    query_inside, query_inside_many, query_distance, query_distance_many, query_within,
    query_ray,    query_ray_all,     query_rays,     query_box,           query_triangles,
    query_stream, query_view,        query_subtree,  query_level,         query_counts,
#if EBPO_HAVE_EXTRAS
    query_haptic,
#endif
};
enum { RAYS = 7, TOUCH = 15 };
const char *const mix_names[MIX_KINDS] = {
    "inside", "inside, many", "distance", "distance, many", "within",  "ray",   "ray all", "rays",
    "box",    "triangles",    "stream",   "view",           "subtree", "level", "counts",
#if EBPO_HAVE_EXTRAS
    "touch",
#endif
};

bool mix_has_workers(int kind) { return kind == RAYS || kind == TOUCH; }

ebpo_status mix_query(const mix_session *session, int kind, uint64_t number, uint64_t *hash,
                      ebpo_error *error)
{
    *hash = basis;
    return run_query[kind](session, number, hash, error);
}
