/* Makes models for tests of queries, and compares results with the oracle. */
#include "check_main.h"
#include "query_support.h"
#include "scratch.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#if defined __SANITIZE_ADDRESS__ || defined __SANITIZE_THREAD__
#define SANITIZED 1
#elif defined __has_feature
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define SANITIZED 1
#endif
#endif
#ifndef SANITIZED
#define SANITIZED 0
#endif

enum { SHOWN = 3 };

void *query_alloc(uint64_t count, size_t size)
{
    void *block = calloc(count + 1, size);
    if (!block)
        abort();
    return block;
}

uint64_t query_scaled(uint64_t count)
{
    double n = (double)count * ebpo_test_scale() * (SANITIZED ? 0.1 : 1);
    return n >= 1 ? (uint64_t)n : 1;
}

/* --- models --- */

ebpo_status query_build(ebpo_tree *tree, ebpo_mesh *mesh, const query_variant *variant,
                        ebpo_error *error)
{
    ebpo_mesh_report report;
    ebpo_status status = ebpo_mesh_check(mesh, 1, (ebpo_progress){ NULL, NULL }, &report, error);
    if (status != EBPO_OK) {
        ebpo_mesh_free(mesh);
        return status;
    }
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    options.leaf_faces = variant->leaf_faces;
    options.max_level = variant->max_level;
    options.rule = variant->rule;
    options.threads = 1;
    if (variant->parts)
        options.parts = variant->parts;
    return ebpo_build(mesh, &report, NULL, &options, tree, error);
}

static ebpo_status write_tree(query_model *m, ebpo_mesh mesh, const query_variant *variant,
                              ebpo_error *error)
{
    ebpo_tree tree;
    ebpo_status status = query_build(&tree, &mesh, variant, error);
    if (status != EBPO_OK)
        return status;
    ebpo_write_options write = EBPO_WRITE_OPTIONS_INIT;
    write.threads = 1;
    status = ebpo_tree_write(&tree, m->path, &write, error);
    m->info = tree.info;
    m->mesh = tree.mesh;
    m->face_source = tree.info.parts & EBPO_PART_MAPS ? tree.face_source : NULL;
    if (!m->face_source)
        free(tree.face_source);
    tree.face_source = NULL;
    memset(&tree.mesh, 0, sizeof tree.mesh);
    ebpo_tree_free(&tree);
    return status;
}

static void measure(query_model *m)
{
    double low[3] = { INFINITY, INFINITY, INFINITY }, high[3] = { -INFINITY, -INFINITY, -INFINITY };
    m->size = m->largest = 0;
    for (uint64_t i = 0; i < 3 * m->mesh.face_count; i++) {
        double p[3];
        ebpo_test_point(&m->mesh, m->mesh.faces[i], p);
        for (int k = 0; k < 3; k++) {
            low[k] = fmin(low[k], p[k]);
            high[k] = fmax(high[k], p[k]);
            m->size = fmax(m->size, high[k] - low[k]);
            m->largest = fmax(m->largest, fabs(p[k]));
        }
    }
    m->normal = query_alloc(m->mesh.face_count, sizeof *m->normal);
    for (uint32_t f = 0; f < m->mesh.face_count; f++)
        oracle_normal(m->judge, f, m->normal[f]);
}

ebpo_status query_model_try(query_model *m, const char *name, ebpo_mesh mesh,
                            const query_variant *variant, ebpo_error *error)
{
    memset(m, 0, sizeof *m);
    m->name = name;
    m->variant = variant->name;
    scratch_make(m->folder);
    snprintf(m->path, sizeof m->path, "%s/model.ebpo.h5", m->folder);
    ebpo_status status = write_tree(m, mesh, variant, error);
    if (status == EBPO_OK)
        status = ebpo_open(m->path, &m->file, error);
    if (status == EBPO_OK)
        status = ebpo_model_new(m->file, NULL, &m->model, error);
    if (status == EBPO_OK)
        status = ebpo_context_new(m->model, &m->context, error);
    if (status != EBPO_OK) {
        query_model_free(m);
        return status;
    }
    m->judge = oracle_make(&m->mesh);
    measure(m);
    return EBPO_OK;
}

void query_model_make(query_model *m, const char *name, ebpo_mesh mesh,
                      const query_variant *variant)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_msg(query_model_try(m, name, mesh, variant, &error) == EBPO_OK, "%s, %s: %s", name,
                  variant->name, error.message);
}

void query_model_free(query_model *m)
{
    ebpo_context_free(m->context);
    ebpo_model_free(m->model);
    ebpo_close(m->file);
    oracle_free(m->judge);
    ebpo_mesh_free(&m->mesh);
    free(m->face_source);
    free(m->normal);
    scratch_remove(m->folder);
}

/* --- reference --- */

static bool inside_by(ebpo_rule rule, int32_t winding)
{
    return rule == EBPO_RULE_NONZERO   ? winding != 0
           : rule == EBPO_RULE_EVENODD ? winding % 2 != 0
                                       : winding > 0;
}

void query_find_truths(query_model *m, const double *points, uint64_t count, query_truth *out)
{
    for (uint64_t i = 0; i < count; i++) {
        oracle_nearest near;
        query_truth *t = out + i;
        oracle_find_nearest(m->judge, points + 3 * i, &near);
        t->distance = near.distance;
        t->file_face = near.faces[0];
        t->ties = near.count;
        t->face = m->face_source ? m->face_source[t->file_face] : t->file_face;
        t->winding = 0;
        t->where = near.on ? EBPO_ON : EBPO_OUT;
        if (!near.on && m->info.solid) {
            t->winding = oracle_winding(m->judge, points + 3 * i);
            t->where = inside_by(m->info.rule, t->winding) ? EBPO_IN : EBPO_OUT;
        }
    }
}

/* --- comparisons --- */

static bool show(const query_model *m, const double *p, uint64_t *wrong)
{
    if ((*wrong)++ >= SHOWN)
        return false;
    fprintf(stderr, "%s, %s: point (%a, %a, %a): ", m->name, m->variant, p[0], p[1], p[2]);
    return true;
}

uint64_t query_wrong_inside(const query_model *m, const double *points, const query_truth *truth,
                            uint64_t count, const ebpo_inside_result *got)
{
    uint64_t wrong = 0;
    for (uint64_t i = 0; i < count; i++) {
        const query_truth *t = truth + i;
        if (got[i].where == t->where && got[i].winding == t->winding && got[i].doubt == 0)
            continue;
        if (show(m, points + 3 * i, &wrong))
            fprintf(stderr, "inside returns %d, winding %d, doubt %a; expected %d, winding %d\n",
                    got[i].where, got[i].winding, got[i].doubt, t->where, t->winding);
    }
    return wrong;
}

/* Returns true if the nearest point has the distance from the point, within some ulps of the
 * largest coordinate. */
static bool point_fits(const query_model *m, const double *p, const query_truth *t,
                       const ebpo_distance_result *got)
{
    long double sum = 0;
    double largest = m->largest;
    for (int k = 0; k < 3; k++) {
        long double d = (long double)got->point[k] - p[k];
        largest = fmax(largest, fabs(p[k]));
        sum += d * d;
    }
    double margin = 16 * DBL_EPSILON * largest + 16 * DBL_TRUE_MIN;
    return fabsl(sqrtl(sum) - t->distance) <= margin;
}

static bool normal_fits(const query_model *m, const query_truth *t, const ebpo_distance_result *got)
{
    const double *n = m->normal[t->file_face];
    for (int k = 0; k < 3; k++)
        if (!(fabs(n[k] - got->normal[k]) <= 4 * DBL_EPSILON * fabs(n[k])))
            return false;
    return true;
}

static const char *distance_fault(const query_model *m, const double *p, const query_truth *t,
                                  bool is_unsigned, const ebpo_distance_result *got)
{
    double expected = t->where == EBPO_IN && !is_unsigned ? -t->distance : t->distance;
    if (got->distance != expected)
        return fabs(got->distance) == t->distance ? "sign" : "distance";
    if (got->lo != t->distance || got->hi != t->distance)
        return "lo, hi";
    if (got->face != t->face)
        return "face";
    if (!point_fits(m, p, t, got))
        return "nearest point";
    if (!normal_fits(m, t, got))
        return "normal";
    return NULL;
}

uint64_t query_wrong_distance(const query_model *m, const double *points, const query_truth *truth,
                              uint64_t count, bool is_unsigned, const ebpo_distance_result *got)
{
    uint64_t wrong = 0;
    for (uint64_t i = 0; i < count; i++) {
        const char *fault = distance_fault(m, points + 3 * i, truth + i, is_unsigned, got + i);
        if (!fault || !show(m, points + 3 * i, &wrong))
            continue;
        const query_truth *t = truth + i;
        const double *n = m->normal[t->file_face];
        fprintf(stderr,
                "wrong %s: distance %a in [%a, %a], face %llu, point (%a, %a, %a), normal (%a, "
                "%a, %a); expected %a, where %d, face %llu (%u at this distance), normal (%a, "
                "%a, %a)\n",
                fault, got[i].distance, got[i].lo, got[i].hi, (unsigned long long)got[i].face,
                got[i].point[0], got[i].point[1], got[i].point[2], got[i].normal[0],
                got[i].normal[1], got[i].normal[2], t->distance, t->where,
                (unsigned long long)t->face, t->ties, n[0], n[1], n[2]);
    }
    return wrong;
}

uint64_t query_wrong_limited_inside(const query_model *m, const double *points,
                                    const query_truth *truth, uint64_t count,
                                    const ebpo_inside_result *got)
{
    uint64_t wrong = 0;
    for (uint64_t i = 0; i < count; i++) {
        const query_truth *t = truth + i;
        bool maybe =
            got[i].where == EBPO_MAYBE && got[i].winding == 0 && got[i].doubt >= t->distance;
        /* envelopes return winding number 0 for points outside */
        bool winding =
            got[i].winding == t->winding || (t->where == EBPO_OUT && got[i].winding == 0);
        bool certain = got[i].where == t->where && winding && got[i].doubt == 0;
        if (!maybe && !certain && show(m, points + 3 * i, &wrong))
            fprintf(stderr,
                    "limited inside returns %d, winding %d, doubt %a; expected %d, winding %d, "
                    "at distance %a\n",
                    got[i].where, got[i].winding, got[i].doubt, t->where, t->winding, t->distance);
    }
    return wrong;
}

static bool limited_distance_fits(const query_truth *t, const ebpo_distance_result *got)
{
    if (!(got->lo <= t->distance && t->distance <= got->hi && got->lo >= 0))
        return false;
    if (isnan(got->distance))
        return true;
    if (got->face != EBPO_NO_FACE && got->lo == got->hi && got->face != t->face)
        return false;
    return got->distance == (t->where == EBPO_IN ? -t->distance : t->distance);
}

uint64_t query_wrong_limited_distance(const query_model *m, const double *points,
                                      const query_truth *truth, uint64_t count,
                                      const ebpo_distance_result *got)
{
    uint64_t wrong = 0;
    for (uint64_t i = 0; i < count; i++)
        if (!limited_distance_fits(truth + i, got + i) && show(m, points + 3 * i, &wrong))
            fprintf(
                stderr,
                "limited distance returns %a in [%a, %a], face %llu; expected %a, where %d, face "
                "%llu\n",
                got[i].distance, got[i].lo, got[i].hi, (unsigned long long)got[i].face,
                truth[i].distance, truth[i].where, (unsigned long long)truth[i].face);
    return wrong;
}

/* --- rays --- */

uint64_t query_reported(const query_model *m, uint32_t face)
{
    return m->face_source ? m->face_source[face] : face;
}

static bool hit_fits(const query_model *m, const oracle_hit *expected, const ebpo_ray_hit *got)
{
    return got->face == query_reported(m, expected->face) && got->side == expected->side &&
           got->t == expected->t;
}

static void show_ray(const query_model *m, const query_ray *r)
{
    fprintf(stderr, "%s, %s: ray (%a, %a, %a) + t (%a, %a, %a), t <= %a: ", m->name, m->variant,
            r->origin[0], r->origin[1], r->origin[2], r->direction[0], r->direction[1],
            r->direction[2], r->t_max);
}

static bool hits_fit(const query_model *m, const query_ray *r, const oracle_hit *expected,
                     uint32_t n, const ebpo_ray_hit *got, uint64_t count)
{
    for (uint32_t i = 0; i < n && i < count; i++)
        if (!hit_fits(m, &expected[i], &got[i])) {
            show_ray(m, r);
            fprintf(stderr, "hit %u: t %a, face %llu, side %d; expected t %a, face %llu, side %d\n",
                    i, got[i].t, (unsigned long long)got[i].face, got[i].side, expected[i].t,
                    (unsigned long long)query_reported(m, expected[i].face), expected[i].side);
            return false;
        }
    if (count != n) {
        show_ray(m, r);
        fprintf(stderr, "%llu hits; expected %u\n", (unsigned long long)count, n);
    }
    return count == n;
}

/* Checks any hit, and the first face from each side. */
static bool query_sides(query_model *m, ebpo_context *context, const query_ray *r,
                        const oracle_hit *expected, uint32_t n)
{
    ebpo_ray ray = { .t_max = r->t_max };
    memcpy(ray.origin, r->origin, sizeof ray.origin);
    memcpy(ray.direction, r->direction, sizeof ray.direction);
    for (int side = -1; side <= 1; side++) {
        ebpo_ray_options options = EBPO_RAY_OPTIONS_INIT;
        ebpo_ray_hit first = { 0 };
        bool any = false;
        uint32_t i = 0;
        options.sides = side > 0 ? EBPO_RAY_FRONT : side < 0 ? EBPO_RAY_BACK : EBPO_RAY_BOTH;
        while (i < n && side && expected[i].facing != side)
            i++;
        if (ebpo_ray_first_many(context, &ray, 1, &options, &first, NULL) != EBPO_OK ||
            ebpo_ray_any_many(context, &ray, 1, &options, &any, NULL) != EBPO_OK ||
            any != (i < n) || (first.face != EBPO_NO_FACE) != any ||
            (any && !hit_fits(m, &expected[i], &first))) {
            show_ray(m, r);
            fprintf(stderr, "from side %d: any %d, first t %a, face %llu\n", side, any, first.t,
                    (unsigned long long)first.face);
            return false;
        }
    }
    bool any;
    return ebpo_ray_any(context, r->origin, r->direction, r->t_max, &any, NULL) == EBPO_OK &&
           any == (n > 0);
}

bool query_one_ray(query_model *m, ebpo_context *context, const query_ray *r)
{
    const oracle_hit *expected;
    const ebpo_ray_hit *hits;
    ebpo_ray_hit first;
    uint32_t n;
    uint64_t count;
    bool hit;
    ebpo_error error = EBPO_ERROR_INIT;
    oracle_ray(m->judge, r->origin, r->direction, r->t_max, &expected, &n);
    if (ebpo_ray_first(context, r->origin, r->direction, r->t_max, &first, &hit, &error) !=
            EBPO_OK ||
        ebpo_ray_all(context, r->origin, r->direction, r->t_max, &hits, &count, &error) !=
            EBPO_OK) {
        show_ray(m, r);
        fprintf(stderr, "%s\n", error.message);
        return false;
    }
    if (hit != (n > 0) || (n > 0 && !hit_fits(m, &expected[0], &first))) {
        show_ray(m, r);
        fprintf(stderr, "the first hit is wrong: %d, t %a, face %llu, side %d\n", hit, first.t,
                (unsigned long long)first.face, first.side);
        return false;
    }
    return hits_fit(m, r, expected, n, hits, count) && query_sides(m, context, r, expected, n);
}

void query_check_points(query_model *m, uint64_t count, uint64_t seed)
{
    enum { BATCH = 512 };
    double *points = query_alloc(count, 3 * sizeof *points);
    query_truth *truth = query_alloc(BATCH, sizeof *truth);
    ebpo_inside_result *inside = query_alloc(BATCH, sizeof *inside);
    ebpo_distance_result *distance = query_alloc(BATCH, sizeof *distance);
    ebpo_error error = EBPO_ERROR_INIT;
    uint64_t wrong = 0;
    query_make_points(m, count, seed, points);
    for (uint64_t at = 0; at < count && wrong == 0; at += BATCH) {
        const double *p = points + 3 * at;
        uint64_t n = count - at < BATCH ? count - at : BATCH;
        query_find_truths(m, p, n, truth);
        ck_assert_msg(ebpo_inside_many(m->context, p, n, NULL, inside, &error) == EBPO_OK,
                      "%s, %s: %s", m->name, m->variant, error.message);
        ck_assert_msg(ebpo_distance_many(m->context, p, n, NULL, distance, &error) == EBPO_OK,
                      "%s, %s: %s", m->name, m->variant, error.message);
        wrong += query_wrong_inside(m, p, truth, n, inside);
        wrong += query_wrong_distance(m, p, truth, n, false, distance);
    }
    ck_assert_msg(wrong == 0, "%s, %s, seed %llu: %llu wrong results", m->name, m->variant,
                  (unsigned long long)seed, (unsigned long long)wrong);
    free(points);
    free(truth);
    free(inside);
    free(distance);
}
