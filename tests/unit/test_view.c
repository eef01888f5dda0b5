/* Tests nodes in the order of an observer against the ordinary stream, and against reference
 * implementations of every key. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <ebpo/ebpo.h>

#include "check_main.h"
#include "counted_source.h"
#include "model_file.h"
#include "random_tree.h"
#include "scratch.h"
#include "solids.h"

static const char *path;

static void make_folder(void)
{
    scratch_enter();
    path = scratch("x.ebpo.h5");
}

enum { DEFAULT = EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS, PRIORITIES = 4 };

/* --- files --- */

static void write_solid(ebpo_mesh mesh, uint32_t parts, uint32_t leaf_faces)
{
    ebpo_tree tree = model_build_parts(mesh, leaf_faces, parts);
    model_write(&tree, path, NULL);
}

static void write_random(int levels, unsigned gray_share, bool windings, bool leaf_planes)
{
    random_tree_options options = { 5, levels, gray_share, 1, true, false, windings, leaf_planes };
    ebpo_tree tree;
    random_tree_make(&tree, &options);
    model_write(&tree, path, NULL);
}

static ebpo_file *open_solid(const char *name, uint32_t leaf_faces)
{
    write_solid(ebpo_test_make(name), DEFAULT | EBPO_PART_LEAF_PLANES, leaf_faces);
    return model_open(path);
}

/* --- the reference implementation: all nodes by the ordinary stream, and simple computation of
 * keys --- */

typedef struct record {
    uint64_t octcode;
    ebpo_node_type type;
    int32_t winding;
    uint32_t plane_count, vertex_count;
    double min[3], max[3], volume, planes_sum, vertices_sum;
} record;

typedef struct records {
    record *at; /* records with ascending octcodes */
    uint64_t count;
} records;

static record record_of(const ebpo_stream_node *n)
{
    record r = { .octcode = n->octcode,
                 .type = n->type,
                 .winding = n->winding,
                 .plane_count = n->plane_count,
                 .vertex_count = n->vertex_count,
                 .volume = n->volume };
    memcpy(r.min, n->min, sizeof r.min);
    memcpy(r.max, n->max, sizeof r.max);
    for (uint32_t i = 0; i < n->plane_count; i++)
        for (int k = 0; k < 4; k++)
            r.planes_sum += (1 + i + k) * n->planes[i][k];
    for (uint32_t i = 0; i < n->vertex_count; i++)
        for (int k = 0; k < 3; k++)
            r.vertices_sum += (1 + i + (uint32_t)k) * n->vertices[i][k];
    return r;
}

static bool same(const record *a, const record *b)
{
    return a->octcode == b->octcode && a->type == b->type && a->winding == b->winding &&
           a->plane_count == b->plane_count && a->vertex_count == b->vertex_count &&
           memcmp(a->min, b->min, sizeof a->min) == 0 &&
           memcmp(a->max, b->max, sizeof a->max) == 0 && a->volume == b->volume &&
           a->planes_sum == b->planes_sum && a->vertices_sum == b->vertices_sum;
}

static records read_records(ebpo_file *file, bool polygons)
{
    ebpo_stream_options options = { sizeof(ebpo_stream_options), true, polygons, 1 };
    ebpo_stream *stream = NULL;
    ebpo_stream_level level;
    ebpo_stream_node node;
    records all = { NULL, 0 };
    bool more = true;
    ck_assert(ebpo_stream_new(file, &options, &stream, NULL) == EBPO_OK);
    while (ebpo_stream_next_level(stream, &level, &more, NULL) == EBPO_OK && more) {
        all.at = realloc(all.at, (all.count + level.node_count) * sizeof *all.at);
        while (ebpo_stream_next_node(stream, &node, &more, NULL) == EBPO_OK && more)
            all.at[all.count++] = record_of(&node);
    }
    ebpo_stream_free(stream);
    return all;
}

static uint64_t find(const records *all, uint64_t octcode)
{
    uint64_t low = 0, high = all->count;
    while (low < high) {
        uint64_t middle = (low + high) / 2;
        if (all->at[middle].octcode < octcode)
            low = middle + 1;
        else
            high = middle;
    }
    ck_assert(low < all->count && all->at[low].octcode == octcode);
    return low;
}

static int level_of(uint64_t octcode)
{
    int level = 0;
    for (; octcode > 1; octcode >>= 3)
        level++;
    return level;
}

static double plain_distance(const ebpo_observer *o, const record *r)
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        double nearest = fmin(fmax(o->eye[k], r->min[k]), r->max[k]);
        sum += (nearest - o->eye[k]) * (nearest - o->eye[k]);
    }
    return sqrt(sum);
}

static double plain_pixels(const ebpo_observer *o, const record *r)
{
    double diagonal = sqrt(pow(r->max[0] - r->min[0], 2) + pow(r->max[1] - r->min[1], 2) +
                           pow(r->max[2] - r->min[2], 2));
    return diagonal / plain_distance(o, r) * o->height / (2 * tan(o->fov * M_PI / 360));
}

static void plain_cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static double plain_dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Returns the least extent of the cell into a half-space of the view. A negative value means that
 * the cell is invisible. The result is relative to the distances. */
static double plain_reach(const ebpo_observer *o, const record *r)
{
    double right[3], up[3], least = INFINITY, length = sqrt(plain_dot(o->direction, o->direction));
    if (length == 0)
        return 1;
    plain_cross(o->direction, o->up, right);
    plain_cross(right, o->direction, up);
    double right_length = sqrt(plain_dot(right, right)), up_length = sqrt(plain_dot(up, up)),
           tangent = tan(o->fov * M_PI / 360);
    for (int cell_face = 0; cell_face < 5; cell_face++) {
        double most = -INFINITY, away = 0;
        for (int corner = 0; corner < 8; corner++) {
            double p[3];
            for (int k = 0; k < 3; k++)
                p[k] = (corner >> k & 1 ? r->max[k] : r->min[k]) - o->eye[k];
            double depth = plain_dot(p, o->direction) / length,
                   x = plain_dot(p, right) / right_length, y = plain_dot(p, up) / up_length;
            double wide = depth * tangent * o->width / o->height, high = depth * tangent;
            const double reach[5] = { wide - x, wide + x, high - y, high + y, depth };
            most = fmax(most, reach[cell_face]);
            away = fmax(away, sqrt(plain_dot(p, p)));
        }
        least = fmin(least, most / away);
    }
    return least;
}

/* Decides for two cells with disjoint interiors whether a ray from the eye passes a and then b.
 * Cells are boxes, so one separating coordinate decides against it, and if the nearer side belongs
 * to b on no axis, a is never behind. Sampled with rays: */
static bool ray_intersects(const double eye[3], const double direction[3], const record *r,
                           double *in, double *out)
{
    *in = 0;
    *out = INFINITY;
    for (int k = 0; k < 3; k++) {
        double a = (r->min[k] - eye[k]) / direction[k], b = (r->max[k] - eye[k]) / direction[k];
        *in = fmax(*in, fmin(a, b));
        *out = fmin(*out, fmax(a, b));
    }
    return *out > *in + 1e-9 * (1 + fabs(*in));
}

/* --- running a view --- */

static ebpo_observer observer_of(ebpo_file *file, uint64_t *random)
{
    const ebpo_info *info = ebpo_file_info(file);
    ebpo_observer o = EBPO_OBSERVER_INIT;
    bool everywhere = ebpo_test_random(random) % 4 == 0, inside = ebpo_test_random(random) % 4 == 0;
    for (int k = 0; k < 3; k++) {
        double middle = info->box_origin[k] + info->box_size[k] / 2;
        o.eye[k] =
            middle + (ebpo_test_random_unit(random) - 0.5) * info->box_size[k] * (inside ? 0.9 : 5);
        o.direction[k] =
            everywhere
                ? 0
                : middle + (ebpo_test_random_unit(random) - 0.5) * info->box_size[k] - o.eye[k];
        o.up[k] = ebpo_test_random_unit(random) - 0.5;
    }
    o.fov = 10 + 80 * ebpo_test_random_unit(random);
    o.width = 100 + (uint32_t)(ebpo_test_random(random) % 1000);
    return o;
}

static ebpo_view_options options_of(ebpo_priority priority, const ebpo_observer *observer)
{
    ebpo_view_options options = EBPO_VIEW_OPTIONS_INIT;
    options.priority = priority;
    options.observer = observer;
    options.windings = true;
    return options;
}

static ebpo_view_stream *new_view(ebpo_file *file, const ebpo_view_options *options)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_view_stream *stream = NULL;
    ck_assert_msg(ebpo_view_stream_new(file, options, &stream, &error) == EBPO_OK, "%s",
                  error.message);
    return stream;
}

static ebpo_view_end next(ebpo_view_stream *stream, ebpo_view_node *node)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_view_end end;
    ck_assert_msg(ebpo_view_stream_next(stream, node, &end, &error) == EBPO_OK, "%s",
                  error.message);
    return end;
}

/* State of a viewer: received nodes, and nodes that represent the model. */
typedef struct viewer {
    const records *all;
    const ebpo_observer *observer;
    ebpo_view_options options;
    uint8_t *come, *in_cut, *seen; /* [count], flags of nodes */
    uint64_t group[8], siblings, count, refined;
    uint64_t *order; /* [refined] octcodes in the order in which they were replaced */
} viewer;

static viewer viewer_new(const records *all, const ebpo_view_options *options)
{
    return (viewer){ .all = all,
                     .observer = options->observer,
                     .options = *options,
                     .come = calloc(all->count, 1),
                     .in_cut = calloc(all->count, 1),
                     .seen = calloc(all->count, 1),
                     .order = malloc(all->count * sizeof(uint64_t)) };
}

static void viewer_free(viewer *v)
{
    free(v->come);
    free(v->in_cut);
    free(v->seen);
    free(v->order);
}

static bool wanted(const viewer *v, uint64_t i)
{
    const record *r = &v->all->at[i];
    const ebpo_view_options *o = &v->options;
    return r->type == EBPO_GRAY && (o->level < 0 || level_of(r->octcode) < o->level) &&
           (o->pixels == 0 || plain_pixels(v->observer, r) > o->pixels) &&
           (isinf(o->distance) || plain_distance(v->observer, r) <= o->distance) &&
           (o->unseen == EBPO_UNSEEN_LAST || v->seen[i]);
}

/* Returns the reference key. The node with the minimum must come first; keys that are equal up to
 * rounding may come in any order. */
static double plain_key(const viewer *v, uint64_t i)
{
    const record *r = &v->all->at[i];
    switch (v->options.priority) {
    case EBPO_PRIORITY_DISTANCE: return plain_distance(v->observer, r);
    case EBPO_PRIORITY_PIXELS: return 1 / plain_pixels(v->observer, r);
    case EBPO_PRIORITY_LEVEL: return (double)r->octcode;
    default: return 0;
    }
}

/* Checks that no node that comes before `parent` is pending when `parent` is refined. */
static void expect_first(const viewer *v, uint64_t parent)
{
    double key = plain_key(v, parent);
    ck_assert(wanted(v, parent));
    for (uint64_t i = 0; i < v->all->count; i++) {
        if (!v->in_cut[i] || i == parent || !wanted(v, i))
            continue;
        ck_assert_msg(v->seen[parent] >= v->seen[i], "%llu, which is not seen, before %llu",
                      (unsigned long long)v->all->at[parent].octcode,
                      (unsigned long long)v->all->at[i].octcode);
        if (v->seen[parent] == v->seen[i])
            ck_assert_msg(plain_key(v, i) >= key * (1 - 1e-9), "%llu waits while %llu is refined",
                          (unsigned long long)v->all->at[i].octcode,
                          (unsigned long long)v->all->at[parent].octcode);
    }
}

static void take(viewer *v, const ebpo_view_node *n, bool check_order)
{
    uint64_t i = find(v->all, n->node.octcode), parent = n->node.octcode >> 3;
    record r = record_of(&n->node);
    ck_assert_msg(same(&r, &v->all->at[i]), "node %llu differs from the file",
                  (unsigned long long)r.octcode);
    ck_assert(!v->come[i] && n->level == level_of(r.octcode));
    if (v->observer) {
        double reach = plain_reach(v->observer, &r), pixels = plain_pixels(v->observer, &r);
        ck_assert(fabs(reach) < 1e-9 || n->seen == (reach > 0));
        ck_assert(fabs(n->distance - plain_distance(v->observer, &r)) <= 1e-9 * (1 + n->distance));
        ck_assert(n->pixels == pixels || fabs(n->pixels - pixels) <= 1e-9 * pixels);
    } else {
        ck_assert(n->seen && isnan(n->distance) && isnan(n->pixels));
    }
    v->come[i] = 1;
    v->seen[i] = n->seen;
    v->count++;
    if (parent && v->siblings == 0) {
        ck_assert_msg(v->in_cut[find(v->all, parent)], "a child before its parent is in the cut");
        if (check_order)
            expect_first(v, find(v->all, parent));
    }
    ck_assert(v->siblings == 0 || v->all->at[v->group[0]].octcode >> 3 == parent);
    v->group[v->siblings++] = i;
    ck_assert(n->complete == (v->siblings == (parent ? 8 : 1)));
    if (n->complete) {
        if (parent) {
            v->in_cut[find(v->all, parent)] = 0;
            v->order[v->refined++] = parent;
        }
        while (v->siblings)
            v->in_cut[v->group[--v->siblings]] = 1;
    }
}

/* --- the cut --- */

typedef struct cutter {
    const viewer *v;
    uint8_t *intersected;
    uint64_t count, types[4];
    double share; /* exact share of the root cell */
    const double *ray;
    double last_in;
    uint64_t stop;
} cutter;

static bool visit(void *user, const ebpo_view_node *n)
{
    cutter *c = user;
    uint64_t i = find(c->v->all, n->node.octcode);
    record r = record_of(&n->node);
    double in, out;
    ck_assert(same(&r, &c->v->all->at[i]) && n->complete && c->v->in_cut[i] && !c->intersected[i]);
    c->intersected[i] = 1;
    c->types[n->node.type]++;
    c->share += ldexp(1, -3 * n->level);
    if (c->ray && ray_intersects(c->v->observer->eye, c->ray, &r, &in, &out)) {
        ck_assert_msg(in >= c->last_in, "the cut is not front to back");
        c->last_in = out - 1e-9 * (1 + out);
    }
    return ++c->count != c->stop;
}

static void random_ray(uint64_t *random, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = ebpo_test_random_unit(random) - 0.5 + 1e-6;
}

/* Checks that the cut covers the root cell once, and equals the cut of a viewer that follows the
 * header. */
static void expect_cut(const viewer *v, ebpo_view_stream *stream, uint64_t *random)
{
    double ray[3];
    random_ray(random, ray);
    cutter c = { .v = v, .intersected = calloc(v->all->count, 1), .ray = v->observer ? ray : NULL };
    uint64_t kept = 0;
    ebpo_view_stats stats = EBPO_VIEW_STATS_INIT;
    ebpo_view_stream_cut(stream, visit, &c);
    for (uint64_t i = 0; i < v->all->count; i++)
        kept += v->in_cut[i];
    ck_assert_uint_eq(c.count, kept);
    /* the cells are different, cover as much as the root, and do not contain each other, as all
     * are in the cut of the viewer */
    ck_assert(c.share == (v->count ? 1 : 0));
    ebpo_view_stream_get_stats(stream, &stats);
    uint64_t waiting = 0;
    double pixels = 0;
    for (uint64_t i = 0; i < v->all->count; i++)
        if (v->in_cut[i]) {
            for (uint64_t above = v->all->at[i].octcode >> 3; above; above >>= 3)
                ck_assert(!v->in_cut[find(v->all, above)]);
            waiting += wanted(v, i);
            if (v->all->at[i].type == EBPO_GRAY && v->observer && v->seen[i])
                pixels = fmax(pixels, plain_pixels(v->observer, &v->all->at[i]));
        }
    ck_assert_uint_eq(stats.nodes, v->count);
    for (int k = 0; k < 4; k++)
        ck_assert_uint_eq(stats.cut[k], c.types[k]);
    ck_assert_uint_eq(stats.waiting, waiting);
    ck_assert(v->observer ? stats.pixels == pixels || fabs(stats.pixels - pixels) < 1e-9 * pixels
                          : isnan(stats.pixels));
    if (c.count > 2) { /* the stream may end early */
        cutter some = { .v = v, .intersected = calloc(v->all->count, 1), .stop = c.count / 2 };
        ebpo_view_stream_cut(stream, visit, &some);
        ck_assert_uint_eq(some.count, c.count / 2);
        free(some.intersected);
    }
    free(c.intersected);
}

/* --- tests --- */

static void expect_whole(ebpo_file *file, ebpo_priority priority, const ebpo_observer *observer,
                         bool polygons, bool check_order, uint64_t *random)
{
    records all = read_records(file, polygons);
    ebpo_view_options options = options_of(priority, observer);
    options.polygons = polygons;
    viewer v = viewer_new(&all, &options);
    ebpo_view_stream *stream = new_view(file, &options);
    ebpo_view_node node;
    expect_cut(&v, stream, random);
    while (next(stream, &node) == EBPO_VIEW_NODE) {
        take(&v, &node, check_order && all.count < 6000);
        if (ebpo_test_random(random) % (1 + all.count / 8) == 0)
            expect_cut(&v, stream, random);
    }
    ck_assert_int_eq(next(stream, &node), EBPO_VIEW_DONE);
    ck_assert_uint_eq(v.count, all.count);
    expect_cut(&v, stream, random);
    viewer_free(&v);
    free(all.at);
    ebpo_view_stream_free(stream);
}

START_TEST(test_view_stream_visits_all_nodes)
{
    if (!ebpo_test_wanted(_i))
        return;
    uint64_t random = 11 + (uint64_t)_i;
    for (int variant = 0; variant < 2; variant++) {
        write_solid(ebpo_test_solids[_i].make(),
                    variant ? DEFAULT | EBPO_PART_LEAF_PLANES : DEFAULT, 4);
        ebpo_file *file = model_open(path);
        for (int priority = 0; priority < PRIORITIES; priority++) {
            ebpo_observer observer = observer_of(file, &random);
            bool observed = priority != EBPO_PRIORITY_LEVEL || variant;
            expect_whole(file, (ebpo_priority)priority, observed ? &observer : NULL, variant == 1,
                         true, &random);
        }
        ebpo_close(file);
    }
}
END_TEST

START_TEST(test_view_of_multi_chunk_trees)
{
    uint64_t random = 5 + (uint64_t)_i;
    write_random(_i == 0 ? 8 : 5, 13, _i != 0, true); /* 8 levels: several chunks in most arrays */
    ebpo_file *file = model_open(path);
    ebpo_observer observer = observer_of(file, &random);
    expect_whole(file,
                 (ebpo_priority)(_i % PRIORITIES == 0 ? EBPO_PRIORITY_PIXELS : _i % PRIORITIES),
                 &observer, false, _i != 0, &random);
    ebpo_close(file);
}
END_TEST

static bool add_share(void *user, const ebpo_view_node *n)
{
    *(double *)user += ldexp(1, -3 * n->level);
    return true;
}

/* The file has no data below a pruned node. The node stays in the cut, because nothing else covers
 * its cell. */
START_TEST(test_view_cut_keeps_pruned_subset_nodes)
{
    ebpo_error error = EBPO_ERROR_INIT;
    uint64_t random = 3, pruned = 0;
    ebpo_file *whole = open_solid(_i % 2 ? "touching_at_vertex" : "sphere", 4);
    const ebpo_info *info = ebpo_file_info(whole);
    ebpo_subset_options options = EBPO_SUBSET_OPTIONS_INIT;
    options.last_level = _i < 2 ? info->level_count - 2 : -1;
    options.boxed = _i > 1;
    for (int k = 0; k < 3; k++) {
        options.min[k] = info->box_origin[k] + 0.2 * info->box_size[k];
        options.max[k] = info->box_origin[k] + 0.45 * info->box_size[k];
    }
    ck_assert_msg(ebpo_subset(whole, path, &options, &error) == EBPO_OK, "%s", error.message);
    ebpo_close(whole);
    ebpo_file *file = model_open(path);
    info = ebpo_file_info(file);
    for (int level = 0; level < info->level_count; level++)
        pruned += info->level[level].pruned_count;
    ck_assert_uint_gt(pruned, 0);
    records all = read_records(file, true);
    for (int priority = 0; priority < PRIORITIES; priority++) {
        ebpo_observer observer = observer_of(file, &random);
        ebpo_view_options view = options_of((ebpo_priority)priority, &observer);
        view.polygons = true;
        viewer v = viewer_new(&all, &view);
        ebpo_view_stream *stream = new_view(file, &view);
        ebpo_view_stats stats = EBPO_VIEW_STATS_INIT;
        ebpo_view_node node;
        double share = 0;
        while (next(stream, &node) == EBPO_VIEW_NODE)
            take(&v, &node, false);
        ck_assert_uint_eq(v.count, all.count);
        ebpo_view_stream_cut(stream, add_share, &share);
        ck_assert(share == 1);
        ebpo_view_stream_get_stats(stream, &stats);
        ck_assert_uint_eq(stats.waiting, 0);
        ck_assert_uint_eq(stats.cut[EBPO_GRAY], pruned);
        double pixels = 0;
        for (uint64_t i = 0; i < all.count; i++)
            if (v.in_cut[i] && v.seen[i] && all.at[i].type == EBPO_GRAY)
                pixels = fmax(pixels, plain_pixels(&observer, &all.at[i]));
        ck_assert(stats.pixels == pixels || fabs(stats.pixels - pixels) < 1e-9 * pixels);
        viewer_free(&v);
        ebpo_view_stream_free(stream);
    }
    free(all.at);
    ebpo_close(file);
}
END_TEST

/* For any ray from the eye: cells on the ray are refined in the order of the ray, each with all
 * nodes below it. */
START_TEST(test_view_front_to_back_follows_rays)
{
    uint64_t random = 77 + (uint64_t)_i;
    ebpo_file *file = open_solid(_i % 2 ? "torus" : "blob", 2);
    records all = read_records(file, false);
    ebpo_observer observer = observer_of(file, &random);
    memset(observer.direction, 0, sizeof observer.direction);
    ebpo_view_options options = options_of(EBPO_PRIORITY_FRONT_TO_BACK, &observer);
    ebpo_view_stream *stream = new_view(file, &options);
    viewer v = viewer_new(&all, &options);
    ebpo_view_node node;
    while (next(stream, &node) == EBPO_VIEW_NODE)
        take(&v, &node, true);
    uint64_t pairs = 0;
    for (int ray = 0; ray < 200; ray++) {
        double direction[3], in[2], out[2];
        for (int k = 0; k < 3; k++) /* through a random point in the root cell */
            direction[k] = all.at[0].min[k] +
                           ebpo_test_random_unit(&random) * (all.at[0].max[k] - all.at[0].min[k]) -
                           observer.eye[k];
        for (uint64_t a = 0; a < v.refined; a++) {
            if (!ray_intersects(observer.eye, direction, &all.at[find(&all, v.order[a])], &in[0],
                                &out[0]))
                continue;
            /* b is refined later, so b must not be before a */
            for (uint64_t b = a + 1; b < v.refined; b++)
                if (ray_intersects(observer.eye, direction, &all.at[find(&all, v.order[b])], &in[1],
                                   &out[1])) {
                    ck_assert_msg(out[1] > in[0] + 1e-9 * (1 + in[0]),
                                  "%llu is in front of %llu, and comes later",
                                  (unsigned long long)v.order[b], (unsigned long long)v.order[a]);
                    pairs++;
                }
        }
    }
    ck_assert_uint_gt(pairs, 1000);
    viewer_free(&v);
    free(all.at);
    ebpo_view_stream_free(stream);
    ebpo_close(file);
}
END_TEST

/* Nodes excluded by thresholds, computed from all nodes. */
START_TEST(test_view_thresholds_stop_refinement)
{
    uint64_t random = 300 + (uint64_t)_i;
    ebpo_file *file = open_solid("torus", 2);
    records all = read_records(file, false);
    for (int round = 0; round < 12; round++) {
        ebpo_observer observer = observer_of(file, &random);
        ebpo_view_options options = options_of((ebpo_priority)(round % PRIORITIES), &observer);
        options.pixels = round % 3 == 0 ? 200 * ebpo_test_random_unit(&random) : 0;
        options.distance =
            round % 3 == 1 ? plain_distance(&observer, &all.at[0]) + ebpo_test_random_unit(&random)
                           : INFINITY;
        options.level = round % 3 == 2 ? 3 : -1;
        options.unseen = round % 2 ? EBPO_UNSEEN_NEVER : EBPO_UNSEEN_LAST;
        viewer v = viewer_new(&all, &options);
        ebpo_view_stream *stream = new_view(file, &options);
        ebpo_view_node node;
        while (next(stream, &node) == EBPO_VIEW_NODE)
            take(&v, &node, true);
        for (uint64_t i = 0; i < all.count; i++) {
            uint64_t parent = all.at[i].octcode >> 3;
            ck_assert(v.come[i] == (parent == 0 || (v.come[find(&all, parent)] &&
                                                    wanted(&v, find(&all, parent)))));
        }
        expect_cut(&v, stream, &random);
        viewer_free(&v);
        ebpo_view_stream_free(stream);
    }
    free(all.at);
    ebpo_close(file);
}
END_TEST

START_TEST(test_view_moving_observer_changes_order)
{
    uint64_t random = 900 + (uint64_t)_i;
    ebpo_file *file = open_solid(_i % 2 ? "cavity" : "torus", 2);
    records all = read_records(file, false);
    ebpo_observer observer = observer_of(file, &random);
    ebpo_view_options options = options_of((ebpo_priority)(1 + _i % 3), &observer);
    viewer v = viewer_new(&all, &options);
    ebpo_view_stream *stream = new_view(file, &options);
    ebpo_view_node node;
    while (next(stream, &node) == EBPO_VIEW_NODE) {
        take(&v, &node, true);
        if (ebpo_test_random(&random) % 60 ||
            v.siblings) /* a change within a group is tested below */
            continue;
        observer = observer_of(file, &random);
        options.priority = (ebpo_priority)(ebpo_test_random(&random) % PRIORITIES);
        v.options = options;
        ck_assert(ebpo_view_stream_change(stream, &options, NULL) == EBPO_OK);
        for (uint64_t i = 0; i < all.count; i++)
            v.seen[i] = plain_reach(&observer, &all.at[i]) > -1e-13;
        expect_cut(&v, stream, &random);
    }
    ck_assert_uint_eq(v.count, all.count);
    viewer_free(&v);
    ebpo_view_stream_free(stream);
    /* A change within a group: the siblings come first, and no node is lost. */
    stream = new_view(file, &options);
    uint64_t count = 0, parent = 0;
    bool within = false;
    for (; next(stream, &node) == EBPO_VIEW_NODE; count++) {
        ck_assert(!within || node.node.octcode >> 3 == parent);
        parent = node.node.octcode >> 3;
        within = !node.complete;
        observer = observer_of(file, &random);
        ck_assert(ebpo_view_stream_change(stream, &options, NULL) == EBPO_OK);
    }
    ck_assert_uint_eq(count, all.count);
    ebpo_view_stream_free(stream);
    free(all.at);
    ebpo_close(file);
}
END_TEST

/* Returns the octcodes of a stream to its end. */
static uint64_t *sequence(ebpo_view_stream *stream, uint64_t *count, ebpo_view_end *end)
{
    uint64_t space = 1024, *out = malloc(space * sizeof *out);
    ebpo_view_node node;
    for (*count = 0; (*end = next(stream, &node)) == EBPO_VIEW_NODE;
         out[(*count)++] = node.node.octcode)
        if (*count == space)
            out = realloc(out, (space *= 2) * sizeof *out);
    return out;
}

START_TEST(test_view_byte_budget_truncates_sequence)
{
    uint64_t random = 40 + (uint64_t)_i, all_count, count = 0, bytes;
    write_random(7, 13, true, true);
    counted_source c;
    ebpo_file *file = counted_open(&c, path, false);
    ebpo_observer observer = observer_of(file, &random);
    ebpo_view_options options = options_of((ebpo_priority)(_i % PRIORITIES), &observer);
    ebpo_view_end end;
    ebpo_view_stream *stream = new_view(file, &options);
    uint64_t *all = sequence(stream, &all_count, &end);
    ck_assert_int_eq(end, EBPO_VIEW_DONE);
    ebpo_view_stream_free(stream);
    bytes = ebpo_test_file_stats(file).bytes_read;
    uint64_t needed = bytes, stops = 0;
    counted_close(&c, file);
    for (int far = 0; far < 2; far++) {
        file = counted_open(&c, path, far);
        bytes = ebpo_test_file_stats(file).bytes_read;
        options.bytes = bytes / 2;
        uint64_t opening = bytes; /* the budget does not limit the bytes of opening */
        stream = new_view(file, &options);
        for (count = 0;;) {
            uint64_t some_count, *some = sequence(stream, &some_count, &end);
            ck_assert_uint_le(count + some_count, all_count);
            ck_assert(some_count == 0 || memcmp(all + count, some, some_count * sizeof *some) == 0);
            count += some_count;
            free(some);
            bytes = ebpo_test_file_stats(file).bytes_read;
            uint64_t allowed = options.bytes < opening ? opening : options.bytes;
            ck_assert_msg(bytes <= allowed && c.requested <= allowed,
                          "%llu read, %llu requested, %llu allowed", (unsigned long long)bytes,
                          (unsigned long long)c.requested, (unsigned long long)allowed);
            if (end == EBPO_VIEW_DONE)
                break;
            ck_assert_int_eq(end, EBPO_VIEW_BYTES);
            stops++;
            options.bytes += 1 + ebpo_test_random(&random) % (needed / 20);
            ck_assert(ebpo_view_stream_change(stream, &options, NULL) == EBPO_OK);
        }
        ck_assert_uint_eq(count, all_count);
        ebpo_view_stream_free(stream);
        counted_close(&c, file);
    }
    ck_assert_uint_gt(stops, 20);
    free(all);
}
END_TEST

START_TEST(test_view_budgets_do_not_change_sequence)
{
    uint64_t random = 60, all_count, count, bytes[3] = { 0 };
    write_random(8, 13, false, true);
    ebpo_view_end end;
    ebpo_file *file = model_open(path);
    ebpo_observer observer = observer_of(file, &random);
    ebpo_view_options options = options_of(EBPO_PRIORITY_PIXELS, &observer);
    ebpo_view_stream *stream = new_view(file, &options);
    uint64_t *all = sequence(stream, &all_count, &end);
    bytes[0] = ebpo_test_file_stats(file).bytes_read;
    ebpo_view_stream_free(stream);
    ebpo_close(file);
    for (int variant = 1; variant < 3; variant++) {
        options.memory = variant == 1 ? 2 << 20 : 0;
        options.planes = options.windings = variant == 1;
        options.nodes = 5000;
        file = model_open(path);
        stream = new_view(file, &options);
        uint64_t *some = sequence(stream, &count, &end);
        ck_assert(end == EBPO_VIEW_NODES && count <= 5000 && count > 5000 - 8);
        ck_assert(memcmp(all, some, count * sizeof *some) == 0);
        free(some);
        options.nodes = 0;
        ck_assert(ebpo_view_stream_change(stream, &options, NULL) == EBPO_OK);
        uint64_t rest;
        some = sequence(stream, &rest, &end);
        ck_assert(end == EBPO_VIEW_DONE && count + rest == all_count &&
                  memcmp(all + count, some, rest * sizeof *some) == 0);
        free(some);
        bytes[variant] = ebpo_test_file_stats(file).bytes_read;
        ebpo_view_stream_free(stream);
        ebpo_close(file);
    }
    ck_assert_uint_ge(bytes[1], bytes[0]);
    ck_assert_uint_lt(bytes[2], bytes[0] / 2); /* neither planes nor winding numbers */
    free(all);
}
END_TEST

START_TEST(test_view_retry_and_independent_streams)
{
    uint64_t random = 70, all_count, count = 0;
    write_random(7, 13, false, true);
    counted_source c;
    ebpo_view_end end;
    ebpo_file *file = counted_open(&c, path, _i == 1);
    ebpo_observer observer = observer_of(file, &random);
    ebpo_view_options options = options_of(EBPO_PRIORITY_DISTANCE, &observer);
    ebpo_view_stream *stream = new_view(file, &options);
    uint64_t *all = sequence(stream, &all_count, &end), failed = 0;
    ebpo_view_stream_free(stream);
    stream = new_view(file, &options);
    options.priority = EBPO_PRIORITY_FRONT_TO_BACK;
    ebpo_view_stream *other = new_view(file, &options);
    ebpo_view_node node;
    for (;;) {
        ebpo_error error = EBPO_ERROR_INIT;
        c.failing = ebpo_test_random(&random) % 2;
        ebpo_status status = ebpo_view_stream_next(stream, &node, &end, &error);
        c.failing = false;
        if (status != EBPO_OK) {
            ck_assert(status == EBPO_E_IO && strstr(error.message, "the line is down"));
            failed++;
            continue;
        }
        if (end != EBPO_VIEW_NODE)
            break;
        ck_assert(node.node.octcode == all[count++]);
        (void)next(other, &node);
    }
    ck_assert_uint_eq(count, all_count);
    ck_assert_uint_gt(failed, 5);
    free(all);
    ebpo_view_stream_free(stream);
    ebpo_view_stream_free(other);
    ebpo_view_stream_free(NULL);
    counted_close(&c, file);
}
END_TEST

START_TEST(test_view_invalid_options_are_refused)
{
    ebpo_file *file = open_solid("cube", 4);
    ebpo_observer good = EBPO_OBSERVER_INIT, bad[9];
    ebpo_view_options standard = EBPO_VIEW_OPTIONS_INIT, o[9];
    ebpo_view_stream *stream = NULL;
    for (int i = 0; i < 9; i++)
        bad[i] = good;
    bad[0].eye[1] = NAN, bad[1].direction[0] = INFINITY, bad[2].fov = 180, bad[3].fov = 0,
    bad[4].width = 0, bad[5].height = 0;
    bad[6].direction[1] = -3; /* the direction is parallel to up */
    bad[7].direction[0] = 1, bad[7].up[1] = 0;
    bad[8].up[2] = NAN;
    for (int i = 0; i < 9; i++) {
        standard.observer = &bad[i];
        ck_assert_msg(ebpo_view_stream_new(file, &standard, &stream, NULL) == EBPO_E_ARGUMENT &&
                          !stream,
                      "observer %d", i);
    }
    standard.observer = &good;
    for (int i = 0; i < 9; i++)
        o[i] = standard;
    o[0].priority = (ebpo_priority)4, o[1].pixels = -1, o[2].pixels = INFINITY, o[3].distance = NAN,
    o[4].unseen = (ebpo_unseen)2;
    o[5].observer = NULL, o[5].priority = EBPO_PRIORITY_DISTANCE;
    o[6].observer = NULL, o[6].pixels = 1;
    o[7].observer = NULL, o[7].distance = 1;
    o[8].memory = 65536;
    for (int i = 0; i < 9; i++)
        ck_assert_msg(ebpo_view_stream_new(file, &o[i], &stream, NULL) == EBPO_E_ARGUMENT &&
                          !stream,
                      "options %d", i);
    ck_assert(ebpo_view_stream_new(file, NULL, &stream, NULL) == EBPO_OK);
    ebpo_view_node node, again;
    ck_assert_int_eq(next(stream, &node), EBPO_VIEW_NODE);
    for (int i = 0; i < 9; i++)
        ck_assert_int_eq(ebpo_view_stream_change(stream, &o[i], NULL), EBPO_E_ARGUMENT);
    standard.planes = !standard.planes;
    ck_assert_int_eq(ebpo_view_stream_change(stream, &standard, NULL), EBPO_E_ARGUMENT);
    (void)next(stream, &again);
    ck_assert_uint_ne(node.node.octcode, again.node.octcode);
    ebpo_view_stream_free(stream);
    ebpo_close(file);
}
END_TEST

TEST_SUITE(view)
{
    Suite *suite = suite_create("view");
    TCase *tests = tcase_create("view");
    tcase_set_timeout(tests, 900);
    tcase_add_checked_fixture(tests, make_folder, scratch_leave);
    tcase_add_loop_test(tests, test_view_stream_visits_all_nodes, 0, ebpo_test_solid_count);
    tcase_add_loop_test(tests, test_view_of_multi_chunk_trees, 0, 4);
    tcase_add_loop_test(tests, test_view_cut_keeps_pruned_subset_nodes, 0, 4);
    tcase_add_loop_test(tests, test_view_front_to_back_follows_rays, 0, 6);
    tcase_add_loop_test(tests, test_view_thresholds_stop_refinement, 0, 4);
    tcase_add_loop_test(tests, test_view_moving_observer_changes_order, 0, 6);
    tcase_add_loop_test(tests, test_view_byte_budget_truncates_sequence, 0, 4);
    tcase_add_test(tests, test_view_budgets_do_not_change_sequence);
    tcase_add_loop_test(tests, test_view_retry_and_independent_streams, 0, 2);
    tcase_add_test(tests, test_view_invalid_options_are_refused);
    suite_add_tcase(suite, tests);
    return suite;
}
