/* All results of subsets equal those of the whole file, and missing data is reported. */
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <ebpo/lod.h>
#include <ebpo/stream.h>
#include <ebpo/subset.h>
#include <ebpo/verify.h>

#include "check_main.h"
#include "read_by.h"
#include "format/reader.h"
#include "query_support.h"
#include "derive/subset_parts.h"

static const query_variant standard = { "default", 4, 6, EBPO_RULE_NONZERO,
                                        EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS |
                                            EBPO_PART_LEAF_PLANES };

static void fine(ebpo_status status, const ebpo_error *error)
{
    ck_assert_msg(status == EBPO_OK, "%s: %s", ebpo_status_name(status), error->message);
}

/* --- a subset, opened in three modes --- */

enum { MODES = 3 };
typedef struct part {
    char path[120];
    ebpo_file *file;
    const ebpo_info *info;
    ebpo_model *model[MODES];
    ebpo_context *context[MODES];
} part;

static void part_open(part *p, ebpo_file *from, const char *path,
                      const ebpo_subset_options *options)
{
    ebpo_error error = EBPO_ERROR_INIT;
    memset(p, 0, sizeof *p);
    snprintf(p->path, sizeof p->path, "%s", path);
    fine(ebpo_subset(from, path, options, &error), &error);
    fine(ebpo_open(path, &p->file, &error), &error);
    p->info = ebpo_file_info(p->file);
    for (int mode = 0; mode < MODES; mode++) {
        ebpo_model_options o = EBPO_MODEL_OPTIONS_INIT;
        o.threads = 1;
        o.cut_level = mode == 0 ? -1 : mode;
        o.loading = mode == 2 ? EBPO_LOAD_NODES : EBPO_LOAD_CACHE;
        fine(ebpo_model_new(p->file, &o, &p->model[mode], &error), &error);
        fine(ebpo_context_new(p->model[mode], &p->context[mode], &error), &error);
    }
}

static void part_close(part *p)
{
    for (int mode = 0; mode < MODES; mode++) {
        ebpo_context_free(p->context[mode]);
        ebpo_model_free(p->model[mode]);
    }
    ebpo_close(p->file);
    unlink(p->path);
}

static void part_verify(part *p)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_verify_options o = EBPO_VERIFY_OPTIONS_INIT;
    ebpo_verify_report report = EBPO_VERIFY_REPORT_INIT;
    o.threads = 1;
    fine(ebpo_verify(p->file, &o, &report, &error), &error);
    ck_assert_msg(report.violations == 0, "%s %s %s %s %s %s", report.structure.first,
                  report.content.first, report.containment.first, report.nesting.first,
                  report.labels.first, report.lists.first);
}

/* --- one query to the whole and to the part --- */

typedef struct tally {
    uint64_t given, refused;
} tally;

static bool answered(tally *t, ebpo_status status, const ebpo_error *error)
{
    ck_assert_msg(status == EBPO_OK ||
                      (status == EBPO_E_ABSENT && strstr(error->message, "file omits nodes")) ||
                      (status == EBPO_E_ABSENT && strstr(error->message, "mesh")),
                  "%s: %s", ebpo_status_name(status), error->message);
    t->given += status == EBPO_OK;
    t->refused += status != EBPO_OK;
    return status == EBPO_OK;
}

static bool within(const double p[3], const ebpo_subset_options *o)
{
    return !o->boxed || (p[0] >= o->min[0] && p[0] <= o->max[0] && p[1] >= o->min[1] &&
                         p[1] <= o->max[1] && p[2] >= o->min[2] && p[2] <= o->max[2]);
}

static void query_exact(tally *t, query_model *m, part *p, int mode, const double point[3],
                        const ebpo_subset_options *cut, const query_truth *truth)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_inside_result whole, some;
    ebpo_distance_result far, near;
    bool complete = cut->last_level < 0 && p->info->parts & EBPO_PART_MESH;
    if (m->info.solid) {
        fine(ebpo_inside(m->context, point, NULL, &whole, &error), &error);
        ebpo_status status = ebpo_inside(p->context[mode], point, NULL, &some, &error);
        ck_assert_msg(!complete || !within(point, cut) || status == EBPO_OK,
                      "a point in the box was refused: %s", error.message);
        if (answered(t, status, &error))
            ck_assert_msg(whole.where == some.where && whole.winding == some.winding,
                          "%.17g %.17g %.17g: %d %d, the whole says %d %d", point[0], point[1],
                          point[2], some.where, some.winding, whole.where, whole.winding);
    }
    fine(ebpo_distance(m->context, point, NULL, &far, &error), &error);
    if (answered(t, ebpo_distance(p->context[mode], point, NULL, &near, &error), &error))
        ck_assert_msg(memcmp(&far.distance, &near.distance, 8) == 0 &&
                          (far.face == near.face || truth->ties > 1 ||
                           !(p->info->parts & EBPO_PART_MAPS)),
                      "%.17g %.17g %.17g: distance %.17g to %lld, the whole says %.17g to %lld",
                      point[0], point[1], point[2], near.distance, (long long)near.face,
                      far.distance, (long long)far.face);
}

static void query_limited(query_model *m, part *p, int mode, const double point[3],
                          const ebpo_subset_options *cut, const query_truth *truth)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_distance_options o = EBPO_DISTANCE_OPTIONS_INIT;
    bool equal = !cut->boxed && cut->parts & EBPO_PART_PLANES && p->info->parts & EBPO_PART_MESH;
    for (o.level = 0; o.level < m->info.level_count + 1; o.level++) {
        ebpo_inside_options inside_options = query_inside_like(&o);
        ebpo_inside_result some, whole;
        ebpo_distance_result near, far;
        bool same = equal && (cut->last_level < 0 || o.level <= cut->last_level);
        if (m->info.solid) {
            fine(ebpo_inside(p->context[mode], point, &inside_options, &some, &error), &error);
            fine(ebpo_inside(m->context, point, &inside_options, &whole, &error), &error);
            ck_assert_msg(some.where == EBPO_MAYBE || some.where == truth->where,
                          "level %d: class %d, expected %d", o.level, some.where, truth->where);
            ck_assert(some.where != EBPO_MAYBE || truth->distance <= some.doubt);
            if (same)
                ck_assert(some.where == whole.where && some.doubt == whole.doubt);
        }
        fine(ebpo_distance(p->context[mode], point, &o, &near, &error), &error);
        fine(ebpo_distance(m->context, point, &o, &far, &error), &error);
        ck_assert_msg(near.lo <= truth->distance && truth->distance <= near.hi,
                      "level %d: %.17g is not within %.17g and %.17g", o.level, truth->distance,
                      near.lo, near.hi);
        if (same)
            ck_assert(near.lo == far.lo && near.hi == far.hi);
        o.mode = EBPO_DISTANCE_ENVELOPE;
        fine(ebpo_distance(m->context, point, &o, &far, &error), &error);
        ebpo_status status = ebpo_distance(p->context[mode], point, &o, &near, &error);
        ck_assert_msg(status == EBPO_OK || (status == EBPO_E_ABSENT && !same), "%s", error.message);
        if (status == EBPO_OK && cut->parts & EBPO_PART_PLANES)
            ck_assert_msg(near.distance == far.distance,
                          "level %d: an envelope is %.17g away, in the whole file %.17g", o.level,
                          near.distance, far.distance);
        o.mode = EBPO_DISTANCE_EXACT;
    }
}

static void query_rays(tally *t, query_model *m, part *p, int mode, uint64_t seed)
{
    ebpo_error error = EBPO_ERROR_INIT;
    for (int i = 0; i < 20; i++) {
        double origin[3], direction[3], t_max;
        ebpo_ray_hit far, near;
        bool hit, too;
        const ebpo_ray_hit *all, *some;
        uint64_t count, found;
        query_make_ray(m, &seed, origin, direction, &t_max);
        fine(ebpo_ray_first(m->context, origin, direction, t_max, &far, &hit, &error), &error);
        if (answered(t,
                     ebpo_ray_first(p->context[mode], origin, direction, t_max, &near, &too,
                                    &error),
                     &error))
            /* among faces with equal t, the first face in the file is returned, which may be
             * another face in the subset */
            ck_assert(hit == too && (!hit || far.t == near.t));
        fine(ebpo_ray_all(m->context, origin, direction, t_max, &all, &count, &error), &error);
        if (answered(t,
                     ebpo_ray_all(p->context[mode], origin, direction, t_max, &some, &found,
                                  &error),
                     &error))
            ck_assert(count == found);
    }
}

static int compare_faces(const void *a, const void *b)
{
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

static void query_box(tally *t, query_model *m, part *p, int mode, const double min[3],
                      const double max[3], bool must)
{
    ebpo_error error = EBPO_ERROR_INIT;
    const uint64_t *all, *some;
    uint64_t count, found;
    fine(ebpo_faces_in_box(m->context, min, max, &all, &count, &error), &error);
    ebpo_status status = ebpo_faces_in_box(p->context[mode], min, max, &some, &found, &error);
    ck_assert_msg(!must || status == EBPO_OK, "the kept box is refused: %s", error.message);
    if (!answered(t, status, &error))
        return;
    ck_assert_uint_eq(count, found);
    /* the order of the results is that of the files */
    if (p->info->parts & EBPO_PART_MAPS && count) {
        uint64_t *a = malloc(count * sizeof *a), *b = malloc(count * sizeof *b);
        memcpy(a, all, count * sizeof *a);
        memcpy(b, some, count * sizeof *b);
        qsort(a, count, sizeof *a, compare_faces);
        qsort(b, count, sizeof *b, compare_faces);
        ck_assert(memcmp(a, b, count * sizeof *a) == 0);
        free(a);
        free(b);
    }
}

/* Reads levels in the ways used for drawing. */
static void stream_levels(part *p)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_stream *stream;
    ebpo_stream_options o = { sizeof(ebpo_stream_options), true, true, 1 };
    ebpo_stream_level level;
    bool more = true;
    fine(ebpo_stream_new(p->file, &o, &stream, &error), &error);
    for (fine(ebpo_stream_next_level(stream, &level, &more, &error), &error); more;
         fine(ebpo_stream_next_level(stream, &level, &more, &error), &error)) {
        ebpo_stream_node node;
        uint64_t nodes = 0;
        bool another = true;
        for (fine(ebpo_stream_next_node(stream, &node, &another, &error), &error); another;
             fine(ebpo_stream_next_node(stream, &node, &another, &error), &error))
            nodes++;
        ck_assert_uint_eq(nodes, level.node_count);
        ebpo_mesh mesh;
        double volume;
        fine(ebpo_lod_level(p->file, level.level, NULL, &mesh, &volume, &error), &error);
        ebpo_mesh_free(&mesh);
    }
    ebpo_stream_free(stream);
}

static void random_box(query_model *m, uint64_t *state, ebpo_subset_options *o)
{
    for (int k = 0; k < 3; k++) {
        double a = ebpo_test_random_unit(state), b = a + ebpo_test_random_unit(state) * 0.5;
        o->min[k] = m->info.box_origin[k] + a * m->info.box_size[k];
        o->max[k] = m->info.box_origin[k] + b * m->info.box_size[k];
        if (ebpo_test_random(state) % 4 == 0) { /* on a cell face */
            double step = m->info.box_size[k] / 4;
            o->min[k] = m->info.box_origin[k] + step * (double)(ebpo_test_random(state) % 4);
            o->max[k] = ebpo_test_random(state) % 2 ? o->min[k] : o->min[k] + step;
        }
    }
    o->boxed = true;
}

static void random_cut(query_model *m, uint64_t *state, ebpo_subset_options *o)
{
    static const uint32_t parts[] = { ~0u, ~0u, EBPO_PART_PLANES | EBPO_PART_LEAF_PLANES,
                                      EBPO_PART_PLANES | EBPO_PART_MESH,
                                      EBPO_PART_MESH | EBPO_PART_MAPS };
    *o = (ebpo_subset_options)EBPO_SUBSET_OPTIONS_INIT;
    o->threads = 1;
    o->parts = parts[ebpo_test_random(state) % 5];
    if (ebpo_test_random(state) % 3)
        random_box(m, state, o);
    if (ebpo_test_random(state) % 2)
        o->last_level = (int)(ebpo_test_random(state) % (uint64_t)m->info.level_count);
    if (o->last_level == m->info.level_count - 1)
        o->last_level = -1;
}

static void compare_one(query_model *m, uint64_t seed, tally *t)
{
    enum { POINTS = 24 };
    ebpo_subset_options o;
    part p;
    double points[3 * POINTS];
    query_truth truth[POINTS];
    char path[120];
    random_cut(m, &seed, &o);
    snprintf(path, sizeof path, "%s/part.ebpo.h5", m->folder);
    part_open(&p, m->file, path, &o);
    part_verify(&p);
    stream_levels(&p);
    query_make_points(m, POINTS, seed, points);
    for (int i = 0; i < POINTS && o.boxed; i += 2)
        for (int k = 0; k < 3; k++)
            points[3 * i + k] = o.min[k] + ebpo_test_random_unit(&seed) * (o.max[k] - o.min[k]);
    query_find_truths(m, points, POINTS, truth);
    for (int mode = 0; mode < MODES; mode++) {
        for (int i = 0; i < POINTS; i++) {
            query_limited(m, &p, mode, points + 3 * i, &o, &truth[i]);
            query_exact(t, m, &p, mode, points + 3 * i, &o, &truth[i]);
        }
        query_rays(t, m, &p, mode, seed + (uint64_t)mode);
        bool all = o.last_level < 0 && p.info->parts & EBPO_PART_MESH;
        if (o.boxed)
            query_box(t, m, &p, mode, o.min, o.max, all);
        ebpo_subset_options other = o;
        random_box(m, &seed, &other);
        query_box(t, m, &p, mode, other.min, other.max, all && !o.boxed);
    }
    part_close(&p);
}

START_TEST(test_subset_results_match_whole)
{
    tally t = { 0, 0 };
    uint64_t scaled = query_scaled(6);
    uint64_t models = query_scaled(24) < 6 ? 6 : query_scaled(24);
    for (uint64_t i = 0; i < models; i++) {
        query_model m;
        query_variant v = standard;
        v.rule = (ebpo_rule)(i % 3);
        v.leaf_faces = i % 2 ? 2 : 8;
        if (i % 4 == 3)
            v.parts &= ~(uint32_t)EBPO_PART_LEAF_PLANES;
        query_model_make(&m, "random",
                         i % 3 == 2 ? query_solid_make((int)(i % (uint64_t)query_solid_count()))
                                    : query_random_solid(i, i % 2),
                         &v);
        for (uint64_t k = 0; k < scaled; k++)
            compare_one(&m, 1000 * i + k, &t);
        query_model_free(&m);
    }
    ck_assert_msg(t.given > 100 && t.refused > 100, "%llu results, %llu refused",
                  (unsigned long long)t.given, (unsigned long long)t.refused);
}
END_TEST

START_TEST(test_full_subset_has_same_content)
{
    ebpo_error error = EBPO_ERROR_INIT;
    query_model m;
    query_model_make(&m, "torus", ebpo_test_torus(3, 1, 60, 30), &standard);
    char path[120];
    snprintf(path, sizeof path, "%s/all.ebpo.h5", m.folder);
    ebpo_subset_options o = EBPO_SUBSET_OPTIONS_INIT;
    for (int i = 0; i < 2; i++) {
        ebpo_file *file;
        o.boxed = i; /* around the whole model */
        for (int k = 0; k < 3; k++) {
            o.min[k] = -100;
            o.max[k] = 100;
        }
        fine(ebpo_subset(m.file, path, &o, &error), &error);
        fine(ebpo_open(path, &file, &error), &error);
        ck_assert(memcmp(ebpo_file_info(file)->content_sha256,
                         ebpo_file_info(m.file)->content_sha256, 32) == 0);
        ck_assert(!ebpo_file_info(file)->pruned);
        ebpo_close(file);
        char command[400];
        snprintf(command, sizeof command, "cmp '%s' '%s'", path, m.path);
        ck_assert_msg(system(command) == 0, "not the same bytes");
    }
    unlink(path);
    query_model_free(&m);
}
END_TEST

/* Compares nodes, planes and source faces; face indices may differ, as they come from the file of
 * origin. */
static void same_parts(const char *a, const char *b)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file[2];
    ebpo_tree tree[2];
    fine(ebpo_open(a, &file[0], &error), &error);
    fine(ebpo_open(b, &file[1], &error), &error);
    for (int i = 0; i < 2; i++)
        fine(ebpo_file_read_tree(file[i], READ_BY(1), &tree[i], &error), &error);
    ck_assert_int_eq(tree[0].info.level_count, tree[1].info.level_count);
    for (int l = 0; l < tree[0].info.level_count; l++) {
        const ebpo_level *x = &tree[0].level[l], *y = &tree[1].level[l];
        ck_assert(x->group_count == y->group_count &&
                  memcmp(x->types, y->types, x->group_count * sizeof *x->types) == 0);
        ck_assert(x->plane_count == y->plane_count &&
                  (x->plane_count == 0 || memcmp(x->planes, y->planes, x->plane_count * 4) == 0));
        ck_assert(x->pruned_count == y->pruned_count &&
                  x->new_count + x->ref_count == y->new_count + y->ref_count);
        ck_assert(x->gray_volume == y->gray_volume && x->leaf_volume == y->leaf_volume);
    }
    ck_assert(tree[0].mesh.face_count == tree[1].mesh.face_count &&
              tree[0].mesh.vertex_count == tree[1].mesh.vertex_count);
    ck_assert(memcmp(tree[0].info.subset_of, tree[1].info.subset_of, 32) == 0 &&
              memcmp(tree[0].info.kept_box, tree[1].info.kept_box, 48) == 0);
    uint64_t sum[2] = { 0, 0 };
    for (int i = 0; i < 2; i++) {
        for (uint64_t f = 0; f < tree[i].mesh.face_count; f++)
            sum[i] += (tree[i].face_source[f] + UINT64_C(1)) * UINT64_C(0x9e3779b97f4a7c15) >> 7;
        ebpo_tree_free(&tree[i]);
        ebpo_close(file[i]);
    }
    ck_assert_uint_eq(sum[0], sum[1]);
}

START_TEST(test_subset_of_subset_is_subset)
{
    ebpo_error error = EBPO_ERROR_INIT;
    uint64_t state = 7;
    query_model m;
    query_model_make(&m, "sphere", ebpo_test_sphere((double[3]){ 1, 2, 3 }, 2, 4), &standard);
    for (int i = 0; i < 12; i++) {
        char first[120], second[120], direct[120];
        ebpo_file *file;
        ebpo_subset_options outer = EBPO_SUBSET_OPTIONS_INIT, inner;
        snprintf(first, sizeof first, "%s/first.ebpo.h5", m.folder);
        snprintf(second, sizeof second, "%s/second.ebpo.h5", m.folder);
        snprintf(direct, sizeof direct, "%s/direct.ebpo.h5", m.folder);
        random_box(&m, &state, &outer);
        inner = outer;
        for (int k = 0; k < 3; k++)
            inner.max[k] =
                outer.min[k] + (outer.max[k] - outer.min[k]) * ebpo_test_random_unit(&state);
        inner.last_level = i % 3 == 0 ? 3 : -1;
        fine(ebpo_subset(m.file, direct, &inner, &error), &error);
        fine(ebpo_subset(m.file, first, &outer, &error), &error);
        fine(ebpo_open(first, &file, &error), &error);
        fine(ebpo_subset(file, second, &inner, &error), &error);
        ebpo_close(file);
        same_parts(direct, second);
        unlink(first);
        unlink(second);
        unlink(direct);
    }
    query_model_free(&m);
}
END_TEST

static ebpo_subset_options box_of(int last_level, const double min[3], const double max[3])
{
    ebpo_subset_options o = EBPO_SUBSET_OPTIONS_INIT;
    o.last_level = last_level;
    o.boxed = true;
    memcpy(o.min, min, sizeof o.min);
    memcpy(o.max, max, sizeof o.max);
    return o;
}

START_TEST(test_subset_bytes_same_for_any_threads)
{
    ebpo_error error = EBPO_ERROR_INIT;
    query_model m;
    query_model_make(&m, "torus", ebpo_test_torus(3, 1, 200, 80), &standard);
    char one[120], four[120], command[400];
    snprintf(one, sizeof one, "%s/one.ebpo.h5", m.folder);
    snprintf(four, sizeof four, "%s/four.ebpo.h5", m.folder);
    ebpo_subset_options o = box_of(-1, (double[3]){ 0, 0, -1 }, (double[3]){ 4, 4, 1 });
    o.threads = 1;
    fine(ebpo_subset(m.file, one, &o, &error), &error);
    o.threads = 4;
    fine(ebpo_subset(m.file, four, &o, &error), &error);
    snprintf(command, sizeof command, "cmp '%s' '%s'", one, four);
    ck_assert_int_eq(system(command), 0);
    unlink(one);
    unlink(four);
    query_model_free(&m);
}
END_TEST

/* A file that another program has put in the place of an open file is not replaced by a subset of
 * the old file. */
START_TEST(test_subset_of_replaced_file_is_refused)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_subset_options o = EBPO_SUBSET_OPTIONS_INIT, fit = EBPO_SUBSET_OPTIONS_INIT;
    query_model m;
    query_model_make(&m, "sphere", ebpo_test_sphere((double[3]){ 0, 0, 0 }, 1, 2), &standard);
    char path[120], link[120];
    snprintf(path, sizeof path, "%s/a.ebpo.h5", m.folder);
    snprintf(link, sizeof link, "%s/link.ebpo.h5", m.folder);
    fit.target_bytes = 1 << 30;
    ck_assert(symlink("a.ebpo.h5", link) == 0);
    for (int i = 0; i < 4; i++) {
        ebpo_file *file;
        fine(ebpo_file_repack(m.file, path, NULL, NULL, &error), &error);
        fine(ebpo_open(i == 3 ? link : path, &file, &error), &error);
        /* from here on, the open file is outdated */
        fine(ebpo_file_repack(file, path, NULL, NULL, &error), &error);
        ebpo_status status = i == 1   ? ebpo_subset(file, path, &o, &error)
                             : i == 2 ? ebpo_subset(file, path, &fit, &error)
                                      : ebpo_file_repack(file, path, NULL, NULL, &error);
        ck_assert_int_eq(status, EBPO_E_IO);
        ck_assert(strstr(error.message, "another program has changed the file since it was read") !=
                  NULL);
        ebpo_close(file);
        fine(ebpo_open(path, &file, &error), &error);
        fine(ebpo_subset(file, path, i == 2 ? &fit : &o, &error), &error);
        ebpo_close(file);
    }
    query_model_free(&m);
}
END_TEST

START_TEST(test_subset_of_empty_box_is_refused)
{
    ebpo_error error = EBPO_ERROR_INIT;
    query_model m;
    query_model_make(&m, "sphere", ebpo_test_sphere((double[3]){ 0, 0, 0 }, 1, 2), &standard);
    char path[120];
    snprintf(path, sizeof path, "%s/never.ebpo.h5", m.folder);
    ebpo_subset_options o = box_of(-1, (double[3]){ 5, 5, 5 }, (double[3]){ 6, 6, 6 });
    ck_assert_int_eq(ebpo_subset(m.file, path, &o, &error), EBPO_E_ARGUMENT);
    o.max[1] = 4;
    ck_assert_int_eq(ebpo_subset(m.file, path, &o, &error), EBPO_E_ARGUMENT);
    o.max[1] = NAN;
    ck_assert_int_eq(ebpo_subset(m.file, path, &o, &error), EBPO_E_ARGUMENT);
    o = (ebpo_subset_options)EBPO_SUBSET_OPTIONS_INIT;
    o.last_level = 21;
    ck_assert_int_eq(ebpo_subset(m.file, path, &o, &error), EBPO_E_ARGUMENT);
    ck_assert_int_eq(access(path, F_OK), -1);
    query_model_free(&m);
}
END_TEST

START_TEST(test_subset_measure_is_refused)
{
    ebpo_error error = EBPO_ERROR_INIT;
    query_model m;
    query_model_make(&m, "sphere", ebpo_test_sphere((double[3]){ 0, 0, 0 }, 1, 3), &standard);
    char path[120];
    snprintf(path, sizeof path, "%s/part.ebpo.h5", m.folder);
    ebpo_subset_options o = box_of(-1, (double[3]){ 0.5, 0.5, 0.5 }, (double[3]){ 1, 1, 1 });
    part p;
    part_open(&p, m.file, path, &o);
    ck_assert_msg(p.info->pruned && p.info->boxed && p.info->face_count < m.info.face_count,
                  "nothing was omitted");
    ebpo_mass mass = EBPO_MASS_INIT;
    ck_assert_int_eq(ebpo_measure(p.file, 1, &mass, &error), EBPO_E_ABSENT);
    part_close(&p);
    query_model_free(&m);
}
END_TEST

/* Changes bytes of the header one by one; checksums of HDF5 detect most changes. Then tests the
 * library with a file of wrong counts. */
START_TEST(test_damaged_subsets_are_harmless)
{
    ebpo_error error = EBPO_ERROR_INIT;
    query_model m;
    query_model_make(&m, "sphere", ebpo_test_sphere((double[3]){ 0, 0, 0 }, 1, 3), &standard);
    char path[120];
    snprintf(path, sizeof path, "%s/part.ebpo.h5", m.folder);
    ebpo_subset_options o = box_of(3, (double[3]){ 0.2, 0.2, 0.2 }, (double[3]){ 1, 1, 1 });
    o.codec = EBPO_CODEC_NONE;
    fine(ebpo_subset(m.file, path, &o, &error), &error);
    FILE *f = fopen(path, "rb");
    static uint8_t bytes[1 << 20], damaged[1 << 20];
    size_t size = fread(bytes, 1, sizeof bytes, f);
    fclose(f);
    unlink(path);
    uint64_t state = 3, opened = 0;
    for (uint64_t i = 0; i < query_scaled(3000) || (opened == 0 && i < 3000); i++) {
        ebpo_file *file;
        ebpo_tree tree;
        memcpy(damaged, bytes, size);
        damaged[ebpo_test_random(&state) % size] ^= (uint8_t)(1u << ebpo_test_random(&state) % 8);
        if (ebpo_open_memory(damaged, size, "damaged", &file, &error) != EBPO_OK)
            continue;
        opened++;
        if (ebpo_file_read_tree(file, READ_BY(1), &tree, &error) == EBPO_OK)
            ebpo_tree_free(&tree);
        (void)!ebpo_subset(file, path, &o, &error);
        ebpo_close(file);
    }
    unlink(path);
    ck_assert_uint_gt(opened, 0);
    query_model_free(&m);
}
END_TEST

/* Changes numbers in one chunk of an unfiltered file and its checksum, so that only checks of the
 * contents detect them. */
static void lie(ebpo_file *file, uint8_t *bytes, uint64_t *state)
{
    static uint8_t raw[EBPO_CHUNK_BYTES_MAX], stored[2 * EBPO_CHUNK_BYTES_MAX];
    const ebpo_array_in *a;
    do {
        uint64_t number = ebpo_test_random(state) % (EBPO_ARRAYS + 4 * EBPO_LEVEL_ARRAYS);
        a = number < EBPO_ARRAYS ? &file->root_array[number]
                                 : &file->level_array[(number - EBPO_ARRAYS) / EBPO_LEVEL_ARRAYS]
                                                     [(number - EBPO_ARRAYS) % EBPO_LEVEL_ARRAYS];
    } while (!a->present);
    size_t size = a->shape.chunk_rows * ebpo_shape_row_bytes(&a->shape), made = 0;
    ebpo_chunk_coder coder = { 0 };
    memcpy(raw, bytes + a->chunks[0].address, size);
    for (int i = 0; i < 3; i++)
        raw[ebpo_test_random(state) % size] =
            ebpo_test_random(state) % 3 ? 0 : (uint8_t)ebpo_test_random(state);
    ck_assert_int_eq(ebpo_chunk_encode(&coder, a->shape.pipeline, 0, a->shape.element_size, raw,
                                       size, stored, &made),
                     EBPO_OK);
    ck_assert_uint_eq(made, a->chunks[0].bytes);
    memcpy(bytes + a->chunks[0].address, stored, made);
    ebpo_chunk_coder_clear(&coder);
}

/* Runs everything that traverses a tree, and ignores errors. */
static void use_all(ebpo_file *file, const ebpo_subset_options *o)
{
    ebpo_tree tree;
    ebpo_verify_report report = EBPO_VERIFY_REPORT_INIT;
    ebpo_verify_options verify = EBPO_VERIFY_OPTIONS_INIT;
    ebpo_stream *stream;
    ebpo_stream_level level;
    ebpo_stream_node node;
    bool more = true;
    verify.threads = 1;
    (void)!ebpo_verify(file, &verify, &report, NULL);
    if (ebpo_subset_tree(&tree, file, o, NULL) == EBPO_OK)
        ebpo_tree_free(&tree);
    if (ebpo_stream_new(file, NULL, &stream, NULL) == EBPO_OK)
        while (ebpo_stream_next_level(stream, &level, &more, NULL) == EBPO_OK && more)
            while (ebpo_stream_next_node(stream, &node, &more, NULL) == EBPO_OK && more)
                continue;
    ebpo_stream_free(stream);
    for (int i = 0; i < ebpo_file_info(file)->level_count; i++) {
        ebpo_mesh mesh;
        if (ebpo_lod_level(file, i, NULL, &mesh, NULL, NULL) == EBPO_OK)
            ebpo_mesh_free(&mesh);
    }
    for (int cut = -1; cut < 4; cut++) {
        ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
        ebpo_model *model;
        ebpo_context *context;
        options.cut_level = cut;
        options.threads = 1;
        options.loading = cut == 3 ? EBPO_LOAD_NODES : EBPO_LOAD_CACHE;
        if (ebpo_model_new(file, &options, &model, NULL) != EBPO_OK)
            continue;
        ck_assert_int_eq(ebpo_context_new(model, &context, NULL), EBPO_OK);
        for (int i = 0; i < 12; i++) {
            double p[3] = { 0.1 * i, 0.4, 0.9 - 0.1 * i }, far[3] = { 9, 9, 9 };
            ebpo_inside_result where;
            ebpo_distance_result distance;
            const ebpo_ray_hit *hits;
            const uint64_t *faces;
            uint64_t count;
            ebpo_distance_options limited = EBPO_DISTANCE_OPTIONS_INIT;
            limited.level = i % 6;
            ebpo_inside_options inside_options = query_inside_like(&limited);
            (void)!ebpo_inside(context, p, NULL, &where, NULL);
            (void)!ebpo_inside(context, p, &inside_options, &where, NULL);
            (void)!ebpo_distance(context, p, NULL, &distance, NULL);
            (void)!ebpo_distance(context, p, &limited, &distance, NULL);
            limited.mode = EBPO_DISTANCE_ENVELOPE;
            (void)!ebpo_distance(context, p, &limited, &distance, NULL);
            limited = (ebpo_distance_options)EBPO_DISTANCE_OPTIONS_INIT;
            limited.mode = EBPO_DISTANCE_RECURSIVE;
            (void)!ebpo_distance(context, p, &limited, &distance, NULL);
            (void)!ebpo_ray_all(context, p, far, 10, &hits, &count, NULL);
            (void)!ebpo_faces_in_box(context, p, far, &faces, &count, NULL);
        }
        ebpo_context_free(context);
        ebpo_model_free(model);
    }
}

START_TEST(test_inconsistent_subsets_are_harmless)
{
    ebpo_error error = EBPO_ERROR_INIT;
    query_model m;
    uint64_t state = 5;
    query_model_make(&m, "sphere", ebpo_test_sphere((double[3]){ 0, 0, 0 }, 1, 2), &standard);
    static uint8_t bytes[1 << 20], lying[1 << 20];
    for (int kind = 0; kind < 3; kind++) {
        ebpo_subset_options o =
            box_of(kind == 1 ? 2 : -1, (double[3]){ 0.2, 0.2, 0.2 }, (double[3]){ 1, 1, 1 });
        o.boxed = kind != 1;
        o.parts = kind == 2 ? EBPO_PART_PLANES : ~0u;
        ebpo_file *file;
        char path[120];
        o.codec = EBPO_CODEC_NONE;
        o.threads = 1;
        snprintf(path, sizeof path, "%s/part.ebpo.h5", m.folder);
        fine(ebpo_subset(m.file, path, &o, &error), &error);
        FILE *f = fopen(path, "rb");
        size_t size = fread(bytes, 1, sizeof bytes, f);
        fclose(f);
        unlink(path);
        fine(ebpo_open_memory(bytes, size, "honest", &file, &error), &error);
        use_all(file, &o);
        for (uint64_t i = 0; i < query_scaled(150); i++) {
            ebpo_file *liar;
            memcpy(lying, bytes, size);
            for (uint64_t k = 0; k <= i % 3; k++)
                lie(file, lying, &state);
            fine(ebpo_open_memory(lying, size, "liar", &liar, &error), &error);
            use_all(liar, &o);
            ebpo_close(liar);
        }
        ebpo_close(file);
    }
    query_model_free(&m);
}
END_TEST

TEST_SUITE(subset)
{
    Suite *suite = suite_create("subset");
    TCase *tests = tcase_create("subset");
    tcase_set_timeout(tests, 600);
    tcase_add_test(tests, test_subset_results_match_whole);
    tcase_add_test(tests, test_full_subset_has_same_content);
    tcase_add_test(tests, test_subset_of_subset_is_subset);
    tcase_add_test(tests, test_subset_bytes_same_for_any_threads);
    tcase_add_test(tests, test_subset_of_replaced_file_is_refused);
    tcase_add_test(tests, test_subset_of_empty_box_is_refused);
    tcase_add_test(tests, test_subset_measure_is_refused);
    tcase_add_test(tests, test_damaged_subsets_are_harmless);
    tcase_add_test(tests, test_inconsistent_subsets_are_harmless);
    suite_add_tcase(suite, tests);
    return suite;
}
