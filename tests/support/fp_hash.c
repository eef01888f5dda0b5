/* Calls the library in a floating-point environment, and hashes the results. */
#include "fp_hash.h"
#include "core/endian.h"
#include "scratch.h"

#include <fenv.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <ebpo/error_bound.h>
#include <ebpo/lod.h>
#include <ebpo/stream.h>
#include <ebpo/subset.h>
#include <ebpo/verify.h>

#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

enum { FACES_MAX = 4000, FEW_FACES = 130 };

typedef struct hashing {
    const fp_setting *setting;
    bool kept;
    uint64_t *hash;
} hashing;

/* --- environments --- */

static unsigned control_bits(void)
{
#if defined(__SSE2__)
    return _mm_getcsr() & 0xffc0u;
#else
    return 0;
#endif
}

static unsigned begin_call(const hashing *h)
{
    fesetround(h->setting->rounding);
#if defined(__SSE2__)
    _mm_setcsr(_mm_getcsr() | h->setting->control_bits);
#endif
    return control_bits();
}

static void end_call(hashing *h, unsigned before)
{
    h->kept &= control_bits() == before && fegetround() == h->setting->rounding;
    fesetround(FE_TONEAREST);
#if defined(__SSE2__)
    _mm_setcsr(_mm_getcsr() & ~h->setting->control_bits);
#endif
}

#define CALL(status, call)                \
    do {                                  \
        unsigned before_ = begin_call(h); \
        status = call;                    \
        end_call(h, before_);             \
    } while (0)

/* --- hashes --- */

static void bytes(hashing *h, const void *data, size_t size)
{
    const unsigned char *p = data;
    for (size_t i = 0; i < size; i++)
        *h->hash = (*h->hash ^ p[i]) * 0x100000001b3;
}

/* Hashes a number in little-endian order. */
static void number(hashing *h, uint64_t x)
{
    x = ebpo_little64(x);
    bytes(h, &x, sizeof x);
}

static void words(hashing *h, const uint32_t *x, uint64_t count)
{
    for (uint64_t i = 0; i < count; i++) {
        uint32_t word = ebpo_little32(x[i]);
        bytes(h, &word, sizeof word);
    }
}

/* Hashes a double. All NaNs count as equal, as their bits depend on the compiler. */
static void real(hashing *h, double x)
{
    if (isnan(x))
        number(h, 0x7ff8);
    else {
        uint64_t bits;
        memcpy(&bits, &x, sizeof bits);
        number(h, bits);
    }
}

static void reals(hashing *h, const double *x, int count)
{
    for (int i = 0; i < count; i++)
        real(h, x[i]);
}

static void fail(const degenerate_case *c, const char *what, const ebpo_error *error)
{
    fprintf(stderr, "%s: %s: %s\n", c->name, what, error->message);
    exit(1);
}

/* --- content --- */

static void hash_report(hashing *h, const ebpo_mesh_report *r)
{
    reals(h, r->min, 3);
    reals(h, r->max, 3);
    real(h, r->area);
    real(h, r->volume);
    real(h, r->mean_edge);
    number(h, r->zero_area_faces.count);
    number(h, r->repeated_positions.count);
}

static void hash_info(hashing *h, const ebpo_info *info)
{
    bytes(h, info->content_sha256, sizeof info->content_sha256);
    reals(h, info->box_origin, 3);
    reals(h, info->box_size, 3);
    number(h, (uint64_t)info->level_count);
    for (int level = 0; level < info->level_count; level++) {
        real(h, info->level[level].gray_volume);
        real(h, info->level[level].leaf_volume);
    }
    hash_report(h, &info->report);
}

/* --- results --- */

static void hash_levels(hashing *h, const degenerate_case *c, ebpo_file *file)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_status status;
    for (int level = 0; level < ebpo_file_info(file)->level_count; level++) {
        ebpo_lod_options options = EBPO_LOD_OPTIONS_INIT;
        ebpo_mesh mesh;
        double volume;
        CALL(status, ebpo_lod_level(file, level, &options, &mesh, &volume, &error));
        if (status != EBPO_OK)
            fail(c, "level", &error);
        real(h, volume);
        for (uint64_t i = 0; i < 3 * mesh.vertex_count; i++)
            real(h, mesh.xyz64 ? mesh.xyz64[i] : (double)mesh.xyz32[i]);
        words(h, mesh.faces, 3 * mesh.face_count);
        ebpo_mesh_free(&mesh);
    }
}

static void hash_measures(hashing *h, const degenerate_case *c, ebpo_file *file)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_status status;
    ebpo_mass mass = EBPO_MASS_INIT;
    ebpo_verify_report report = EBPO_VERIFY_REPORT_INIT;
    CALL(status, ebpo_measure(file, 2, &mass, &error));
    if (status != EBPO_OK)
        fail(c, "measure", &error);
    real(h, mass.area);
    real(h, mass.integral);
    reals(h, mass.centroid, 3);
    reals(h, mass.inertia[0], 9);
    CALL(status, ebpo_verify(file, NULL, &report, &error));
    if (status != EBPO_OK)
        fail(c, "verify", &error);
    number(h, report.checks);
    number(h, report.violations);
}

static void hash_point(hashing *h, const degenerate_case *c, ebpo_context *context, bool solid,
                       const double p[3])
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_status status;
    for (int level = -1; level < 3; level += 3) { /* exact, and limited to level 2 */
        ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
        ebpo_inside_result inside;
        ebpo_distance_result distance;
        options.level = level;
        ebpo_inside_options inside_options = EBPO_INSIDE_OPTIONS_INIT;
        inside_options.level = level;
        if (solid) {
            CALL(status, ebpo_inside(context, p, &inside_options, &inside, &error));
            if (status != EBPO_OK)
                fail(c, "inside", &error);
            number(h, (uint64_t)inside.where << 32 | (uint32_t)inside.winding);
            real(h, inside.doubt);
        }
        CALL(status, ebpo_distance(context, p, &options, &distance, &error));
        if (status != EBPO_OK)
            fail(c, "distance", &error);
        real(h, distance.distance);
        real(h, distance.lo);
        real(h, distance.hi);
        reals(h, distance.point, 3);
        reals(h, distance.normal, 3);
        number(h, distance.face);
    }
}

static void hash_ray(hashing *h, const degenerate_case *c, ebpo_context *context,
                     const query_ray *r)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_status status;
    const ebpo_ray_hit *hits;
    const uint64_t *faces;
    uint64_t count;
    double low[3], high[3];
    CALL(status, ebpo_ray_all(context, r->origin, r->direction, r->t_max, &hits, &count, &error));
    if (status != EBPO_OK)
        fail(c, "ray", &error);
    number(h, count);
    for (uint64_t i = 0; i < count; i++) {
        real(h, hits[i].t);
        number(h, hits[i].face << 2 | (uint64_t)(hits[i].side + 1));
    }
    for (int k = 0; k < 3; k++) {
        low[k] = fmin(r->origin[k], r->origin[k] + r->direction[k] / 2);
        high[k] = fmax(r->origin[k], r->origin[k] + r->direction[k] / 2);
    }
    CALL(status, ebpo_faces_in_box(context, low, high, &faces, &count, &error));
    if (status != EBPO_OK)
        fail(c, "box", &error);
    number(h, count);
    for (uint64_t i = 0; i < count; i++)
        number(h, faces[i]);
}

/* Hashes error bounds of levels, and a subset selected by an error bound. */
static void hash_error_bounds(hashing *h, const degenerate_case *c, query_model *m)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_status status = EBPO_OK;
    ebpo_error_bound d = EBPO_ERROR_BOUND_INIT;
    if (m->mesh.face_count > FEW_FACES)
        return;
    for (int level = 0; level < m->info.level_count && level < 4 && status == EBPO_OK; level++) {
        ebpo_error_bound_options options = EBPO_ERROR_BOUND_OPTIONS_INIT;
        options.tolerance = 0.5;
        options.samples = 20;
        options.queries = 60;
        options.threads = 2;
        CALL(status, ebpo_level_error_bound(m->model, m->file, level, &options, &d, &error));
        number(h, (uint64_t)status);
        real(h, d.lo);
        real(h, d.hi);
        real(h, d.mean);
        real(h, d.rms);
        number(h, d.queries);
    }
    ebpo_subset_options options = EBPO_SUBSET_OPTIONS_INIT;
    char path[128];
    ebpo_file *file = NULL;
    options.max_error = d.hi;
    snprintf(path, sizeof path, "%s/subset.ebpo.h5", m->folder);
    if (status != EBPO_OK || !(d.hi > 0 && isfinite(d.hi)))
        return;
    CALL(status, ebpo_subset(m->file, path, &options, &error));
    if (status == EBPO_OK)
        status = ebpo_open(path, &file, &error);
    if (status != EBPO_OK)
        fail(c, "subset", &error);
    bytes(h, ebpo_file_info(file)->content_sha256, 32);
    ebpo_close(file);
    unlink(path);
}

static void hash_queries(hashing *h, const degenerate_case *c, query_model *m, uint64_t queries)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_status status;
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    CALL(status, ebpo_model_new(m->file, &options, &m->model, &error));
    if (status == EBPO_OK)
        CALL(status, ebpo_context_new(m->model, &m->context, &error));
    if (status != EBPO_OK)
        fail(c, "open", &error);
    double *points = query_alloc(queries, 3 * sizeof *points);
    query_make_points(m, queries, 9, points);
    for (uint64_t i = 0; i < queries; i++)
        if (isfinite(points[3 * i]) && isfinite(points[3 * i + 1]) && isfinite(points[3 * i + 2]))
            hash_point(h, c, m->context, m->info.solid, points + 3 * i);
    uint64_t state = 9;
    for (uint64_t i = 0; i < queries / 4; i++) {
        query_ray r;
        bool finite = true;
        query_make_ray(m, &state, r.origin, r.direction, &r.t_max);
        for (int k = 0; k < 3; k++)
            finite &= isfinite(r.origin[k]) && isfinite(r.direction[k]) &&
                      isfinite(r.origin[k] + r.direction[k]);
        if (finite)
            hash_ray(h, c, m->context, &r);
    }
    free(points);
    hash_error_bounds(h, c, m);
    ebpo_context_free(m->context);
    ebpo_model_free(m->model);
}

/* --- a case --- */

static ebpo_status check_mesh(hashing *h, const degenerate_case *c, ebpo_mesh *mesh,
                              ebpo_mesh_report *report, ebpo_build_options *options)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_status status;
    *mesh = c->make(c);
    CALL(status, ebpo_mesh_check(mesh, 2, (ebpo_progress){ NULL, NULL }, report, &error));
    if (status != EBPO_OK)
        ebpo_mesh_free(mesh);
    *options = (ebpo_build_options)EBPO_BUILD_OPTIONS_INIT;
    options->leaf_faces = c->leaf ? c->leaf : 16;
    options->max_level = c->levels ? c->levels - 1 : -1;
    options->rule = c->rule;
    options->threads = 2;
    return status;
}

/* Hashes the other selections, also with leaf planes. */
static void hash_selections(hashing *h, const degenerate_case *c)
{
    for (int i = 0; i < 5; i++) {
        static const ebpo_selection selections[] = { EBPO_SELECT_KMEDOIDS, EBPO_SELECT_KMEDOIDS,
                                                     EBPO_SELECT_OFFSET, EBPO_SELECT_RANDOM,
                                                     EBPO_SELECT_INHERIT };
        ebpo_error error = EBPO_ERROR_INIT;
        ebpo_mesh mesh;
        ebpo_mesh_report report;
        ebpo_build_options options;
        ebpo_tree tree;
        ebpo_status status = check_mesh(h, c, &mesh, &report, &options);
        if (status != EBPO_OK || mesh.face_count > FEW_FACES) {
            if (status == EBPO_OK)
                ebpo_mesh_free(&mesh);
            return;
        }
        options.select = selections[i];
        options.normals = i == 1 ? EBPO_NORMALS_ANGLE : EBPO_NORMALS_SPHERICAL;
        options.parts |= EBPO_PART_LEAF_PLANES;
        CALL(status, ebpo_build(&mesh, &report, NULL, &options, &tree, &error));
        number(h, (uint64_t)status);
        for (int level = 0; status == EBPO_OK && level < tree.info.level_count; level++) {
            const ebpo_level *l = &tree.level[level];
            words(h, l->planes, l->plane_count);
            words(h, l->leaf_planes, l->leaf_plane_count);
            real(h, l->gray_volume);
            real(h, l->leaf_volume);
        }
        if (status == EBPO_OK)
            ebpo_tree_free(&tree);
    }
}

static ebpo_status make_tree(hashing *h, const degenerate_case *c, ebpo_tree *tree)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh mesh;
    ebpo_mesh_report report;
    ebpo_build_options options;
    ebpo_status status = check_mesh(h, c, &mesh, &report, &options);
    if (status != EBPO_OK)
        return status;
    hash_report(h, &report);
    CALL(status, ebpo_build(&mesh, &report, NULL, &options, tree, &error));
    return status;
}

static void measure_mesh(query_model *m)
{
    double low[3] = { INFINITY, INFINITY, INFINITY }, high[3] = { -INFINITY, -INFINITY, -INFINITY };
    for (uint64_t i = 0; i < 3 * m->mesh.face_count; i++) {
        double p[3];
        ebpo_test_point(&m->mesh, m->mesh.faces[i], p);
        for (int k = 0; k < 3; k++) {
            low[k] = fmin(low[k], p[k]);
            high[k] = fmax(high[k], p[k]);
            m->size = fmax(m->size, high[k] - low[k]);
        }
    }
}

void fp_hash_case(const degenerate_case *c, const fp_setting *setting, uint64_t queries,
                  fp_hashes *out)
{
    hashing hashing_now = { setting, true, &out->content }, *h = &hashing_now;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_tree tree;
    query_model m = { .name = c->name };
    *out = (fp_hashes){ EBPO_OK, 0xcbf29ce484222325, 0xcbf29ce484222325, false };
    out->status = make_tree(h, c, &tree);
    out->kept = h->kept;
    number(h, (uint64_t)out->status);
    if (out->status != EBPO_OK)
        return;
    scratch_make(m.folder);
    snprintf(m.path, sizeof m.path, "%s/model.ebpo.h5", m.folder);
    ebpo_status status;
    CALL(status, ebpo_tree_write(&tree, m.path, NULL, &error));
    if (status == EBPO_OK)
        CALL(status, ebpo_open(m.path, &m.file, &error));
    if (status != EBPO_OK)
        fail(c, "file", &error);
    m.info = *ebpo_file_info(m.file);
    hash_info(h, &m.info);
    hash_selections(h, c);
    h->hash = &out->results;
    m.mesh = tree.mesh;
    measure_mesh(&m);
    hash_levels(h, c, m.file);
    hash_measures(h, c, m.file);
    hash_queries(h, c, &m, queries);
    ebpo_close(m.file);
    ebpo_tree_free(&tree);
    scratch_remove(m.folder);
    out->kept = h->kept;
}

bool fp_hash_takes(const degenerate_case *c)
{
    ebpo_mesh mesh = c->make(c);
    uint64_t count = mesh.face_count;
    ebpo_mesh_free(&mesh);
    return count <= FACES_MAX;
}
