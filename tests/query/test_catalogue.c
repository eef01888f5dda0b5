/* Catalogues: what many models say as one, beside each of them by itself; parts with caps beside
 * the whole; budgets that hold few of the models; and files that say what is not true. */
#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/catalogue.h>

#include "catalogue/catalogue_boxes.h"
#include "check_main.h"
#include "query_kit.h"

enum { MODELS = 32, POINTS = 1440, RAYS = 800 };

static query_model model[MODELS];
static ebpo_catalogue_entry entry[MODELS];
static double *points; /* [POINTS][3] */
static ebpo_ray *rays; /* [RAYS] */

static ebpo_mesh box_mesh(double x, double y, double z, double size)
{
    const double low[3] = { x, y, z }, high[3] = { x + size, y + size, z + size };
    return ebpo_test_box(low, high, 16);
}

/* Some overlap, some touch, one is there twice; all have about as many faces. */
static ebpo_mesh mesh_of(int i)
{
    const double centre[3] = { 0.25 * i, 0.25 * (i % 3), 0.125 * (i % 5) };
    return i == 11      ? box_mesh(0, 0, 0, 1)
           : i % 4 == 0 ? box_mesh(centre[0], centre[1], centre[2], 1)
           : i % 4 == 1 ? ebpo_test_sphere(centre, 0.75, 4)
           : i % 4 == 2 ? box_mesh(centre[0], 0, 0, 0.5)
                        : ebpo_test_sphere(centre, 1.5, 4);
}

static void make_models(void)
{
    uint64_t seed = 7;
    for (int i = 0; i < MODELS; i++) {
        query_model_make(&model[i], "catalogue", mesh_of(i), &query_variants[0]);
        ebpo_catalogue_entry_of(model[i].file, model[i].path, &entry[i]);
    }
    points = query_room(POINTS, 3 * sizeof *points);
    rays = query_room(RAYS, sizeof *rays);
    for (int i = 0; i < MODELS; i++)
        query_make_points(&model[i], POINTS / MODELS, seed + (uint64_t)i,
                          points + 3 * (POINTS / MODELS) * i);
    for (int i = 0; i < RAYS; i++) {
        ebpo_ray *r = &rays[i];
        query_make_ray(&model[i % MODELS], &seed, r->origin, r->direction, &r->t_max);
        for (int k = 0; k < 3; k++)
            if (!isfinite(r->direction[k]))
                r->direction[k] = copysign(1e308, r->direction[k]);
    }
}

static void free_models(void)
{
    for (int i = 0; i < MODELS; i++)
        query_model_free(&model[i]);
    free(points);
    free(rays);
}

/* --- what is asked, and what each model says --- */

typedef struct asked {
    ebpo_catalogue *catalogue;
    ebpo_catalogue_models *models;
} asked;

static asked ask_entries(const ebpo_catalogue_entry *entries, uint64_t count, uint64_t memory)
{
    asked a = { NULL, NULL };
    ebpo_catalogue_models_options o = EBPO_CATALOGUE_MODELS_OPTIONS_INIT;
    o.memory = memory;
    o.threads = 1;
    ASSERT_OK(ebpo_catalogue_new(entries, count, NULL, &a.catalogue, error));
    ASSERT_OK(ebpo_catalogue_models_new(&o, &a.models, error));
    return a;
}

static void end_asking(asked *a)
{
    ebpo_catalogue_models_free(a->models);
    ebpo_catalogue_free(a->catalogue);
}

static ebpo_catalogue_ask_options on_threads(unsigned threads)
{
    ebpo_catalogue_ask_options o = EBPO_CATALOGUE_ASK_OPTIONS_INIT;
    o.threads = threads;
    return o;
}

static void judge_inside(const ebpo_inside_result *got)
{
    for (int p = 0; p < POINTS; p++) {
        int32_t winding = 0;
        bool in = false, on = false;
        for (int i = 0; i < MODELS; i++) {
            ebpo_inside_result told;
            ASSERT_OK(ebpo_inside(model[i].context, points + 3 * p, NULL, &told, error));
            winding += told.winding;
            in |= told.where == EBPO_IN;
            on |= told.where == EBPO_ON;
        }
        ck_assert_int_eq(got[p].winding, winding);
        ck_assert_int_eq(got[p].where, in ? EBPO_IN : on ? EBPO_ON : EBPO_OUT);
    }
}

static void judge_distance(const ebpo_distance_result *got, const uint64_t *nearest,
                           double max_distance, const ebpo_inside_result *where)
{
    ebpo_distance_options o = EBPO_DISTANCE_OPTIONS_INIT;
    o.unsigned_distance = true;
    for (int p = 0; p < POINTS; p++) {
        ebpo_distance_result best = { .distance = INFINITY, .face = EBPO_NO_FACE };
        uint64_t first = EBPO_CATALOGUE_NO_MODEL;
        for (int i = 0; i < MODELS; i++) {
            ebpo_distance_result told;
            ASSERT_OK(ebpo_distance(model[i].context, points + 3 * p, &o, &told, error));
            if (told.distance < best.distance && told.distance <= max_distance) {
                best = told;
                first = (uint64_t)i;
            }
        }
        bool in = where && where[p].where == EBPO_IN && isfinite(best.distance);
        ck_assert_double_eq(got[p].distance, in ? -best.distance : best.distance);
        ck_assert_uint_eq(got[p].face, best.face);
        ck_assert_uint_eq(nearest[p], first);
        ck_assert(first == EBPO_CATALOGUE_NO_MODEL ||
                  memcmp(got[p].point, best.point, sizeof best.point) == 0);
    }
}

static void judge_rays(const ebpo_ray_hit *got, const uint64_t *met)
{
    for (int r = 0; r < RAYS; r++) {
        ebpo_ray_hit best = { INFINITY, EBPO_NO_FACE, 0 };
        uint64_t first = EBPO_CATALOGUE_NO_MODEL;
        for (int i = 0; i < MODELS; i++) {
            ebpo_ray_hit told;
            bool hit;
            ASSERT_OK(ebpo_ray_first(model[i].context, rays[r].origin, rays[r].direction,
                                     rays[r].t_max, &told, &hit, error));
            if (hit && (told.t < best.t || best.face == EBPO_NO_FACE)) {
                best = told;
                first = (uint64_t)i;
            }
        }
        if (isinf(best.t) && best.face != EBPO_NO_FACE)
            continue; /* several may be beyond doubles */
        ck_assert_double_eq(got[r].t, best.t);
        ck_assert_uint_eq(got[r].face, best.face);
        ck_assert_int_eq(got[r].side, best.side);
        ck_assert_uint_eq(met[r], first);
    }
}

static void ask_everything(asked *a, unsigned threads)
{
    ebpo_catalogue_ask_options o = on_threads(threads);
    ebpo_inside_result *inside = query_room(POINTS, sizeof *inside);
    ebpo_distance_result *distance = query_room(POINTS, sizeof *distance);
    ebpo_ray_hit *hits = query_room(RAYS, sizeof *hits);
    uint64_t *number = query_room(POINTS, sizeof *number);
    ASSERT_OK(ebpo_catalogue_inside(a->catalogue, a->models, points, POINTS, &o, inside, error));
    judge_inside(inside);
    ASSERT_OK(ebpo_catalogue_distance(a->catalogue, a->models, points, POINTS, &o, distance, number,
                                      error));
    judge_distance(distance, number, INFINITY, inside);
    o.max_distance = 0.25;
    o.unsigned_distance = true;
    ASSERT_OK(ebpo_catalogue_distance(a->catalogue, a->models, points, POINTS, &o, distance, number,
                                      error));
    judge_distance(distance, number, 0.25, NULL);
    ASSERT_OK(ebpo_catalogue_ray(a->catalogue, a->models, rays, RAYS, &o, hits, number, error));
    judge_rays(hits, number);
    free(inside);
    free(distance);
    free(hits);
    free(number);
}

START_TEST(models_are_asked_as_one)
{
    asked a = ask_entries(entry, MODELS, 0);
    ask_everything(&a, 1);
    ask_everything(&a, 3);
    end_asking(&a);
}
END_TEST

/* So much that eight models are asked at a time, and not all of them stay. */
static uint64_t little_memory(void)
{
    uint64_t most = 0;
    for (int i = 0; i < MODELS; i++) {
        ebpo_model_plan plan = EBPO_MODEL_PLAN_INIT;
        ASSERT_OK(ebpo_model_memory(model[i].file, NULL, &plan, error));
        most = plan.least > most ? plan.least : most;
    }
    return 8 * most;
}

static ebpo_catalogue_models_stats stats_of(const asked *a, ebpo_model_stats *sums)
{
    ebpo_catalogue_models_stats stats = EBPO_CATALOGUE_MODELS_STATS_INIT;
    *sums = (ebpo_model_stats)EBPO_MODEL_STATS_INIT;
    ck_assert_int_eq(ebpo_catalogue_models_get_stats(a->models, &stats, sums), EBPO_OK);
    return stats;
}

START_TEST(models_are_closed_and_opened_again)
{
    ebpo_model_stats sums;
    uint64_t memory = little_memory();
    asked a = ask_entries(entry, MODELS, memory);
    ask_everything(&a, 1);
    ebpo_catalogue_models_stats stats = stats_of(&a, &sums);
    ck_assert_uint_gt(stats.closed, 0);
    ck_assert_uint_gt(stats.opened, MODELS);
    ck_assert_uint_eq(stats.opened, stats.closed + stats.open);
    ck_assert_uint_le(sums.memory, memory);
    ck_assert_uint_eq(sums.budget, memory);
    ask_everything(&a, 4);
    ebpo_catalogue_models_set_memory(a.models, 0);
    ask_everything(&a, 2);
    ebpo_catalogue_models_close_idle(a.models);
    ck_assert_uint_eq(stats_of(&a, &sums).open, 0);
    ck_assert_uint_eq(sums.memory, 0);
    end_asking(&a);
}
END_TEST

START_TEST(a_budget_may_be_too_small)
{
    ebpo_error said = EBPO_ERROR_INIT;
    ebpo_inside_result out[1];
    const double middle[3] = { 0.5, 0.5, 0.5 };
    asked a = ask_entries(entry, MODELS, 1000);
    ck_assert_int_eq(ebpo_catalogue_inside(a.catalogue, a.models, middle, 1, NULL, out, &said),
                     EBPO_E_LIMIT);
    ck_assert_ptr_nonnull(strstr(said.message, "one part in 8"));
    end_asking(&a);
}
END_TEST

/* --- parts --- */

/* The box of one side, 0 to 1 or 1 to 2 along x, as it is between caps at x = 1. */
static ebpo_mesh half_box(int side, bool capped)
{
    const double low[3] = { side, 0, 0 }, high[3] = { side + 1, 1, 1 };
    ebpo_mesh mesh = ebpo_test_box(low, high, 2);
    uint64_t kept = 0;
    for (uint64_t f = 0; f < mesh.face_count && !capped; f++) {
        bool cap = true;
        for (int k = 0; k < 3; k++)
            cap &= mesh.xyz64[3 * mesh.faces[3 * f + k]] == 1;
        if (!cap)
            memmove(mesh.faces + 3 * kept++, mesh.faces + 3 * f, 3 * sizeof *mesh.faces);
    }
    mesh.face_count = capped ? mesh.face_count : kept;
    return mesh;
}

static void write_numbers(const char *path, uint64_t count, int64_t first)
{
    char head[119];
    int length =
        snprintf(head, sizeof head, "{'descr': '<i8', 'fortran_order': False, 'shape': (%llu,), }",
                 (unsigned long long)count);
    FILE *out = fopen(path, "wb");
    ck_assert_ptr_nonnull(out);
    fwrite("\x93NUMPY\x01\0\x76\0", 1, 10, out);
    fprintf(out, "%s%*s\n", head, 117 - length, "");
    for (uint64_t i = 0; i < count; i++) {
        int64_t number = first + (int64_t)i;
        for (int byte = 0; byte < 8; byte++)
            fputc((int)(number >> (8 * byte) & 255), out);
    }
    fclose(out);
}

typedef struct halves {
    query_model closed[2], open[2], whole;
    ebpo_catalogue_entry entry[2];
    asked a;
} halves;

static void make_halves(halves *h)
{
    ebpo_catalogue_options o = EBPO_CATALOGUE_OPTIONS_INIT;
    const double low[3] = { 0, 0, 0 }, high[3] = { 2, 1, 1 };
    query_model_make(&h->whole, "whole", ebpo_test_box(low, high, 2), &query_variants[0]);
    for (int i = 0; i < 2; i++) {
        ebpo_catalogue_entry *e = &h->entry[i];
        const char *numbers = scratch(i ? "1.npy" : "0.npy");
        query_model_make(&h->closed[i], "half", half_box(i, true), &query_variants[0]);
        query_model_make(&h->open[i], "surface", half_box(i, false), &query_variants[0]);
        ebpo_catalogue_entry_of(h->closed[i].file, h->closed[i].path, e);
        e->surface = h->open[i].path;
        memcpy(e->surface_digest, ebpo_file_info(h->open[i].file)->content_sha256, 32);
        e->numbers = numbers;
        write_numbers(numbers, h->open[i].mesh.face_count, 1000 * (i + 1));
    }
    o.parts = true;
    ASSERT_OK(ebpo_catalogue_new(h->entry, 2, &o, &h->a.catalogue, error));
    ASSERT_OK(ebpo_catalogue_models_new(NULL, &h->a.models, error));
}

static void free_halves(halves *h)
{
    end_asking(&h->a);
    for (int i = 0; i < 2; i++) {
        query_model_free(&h->closed[i]);
        query_model_free(&h->open[i]);
    }
    query_model_free(&h->whole);
}

/* A grid that has points on faces, on the cap, on its border, and elsewhere. */
static uint64_t grid_points(double *out)
{
    uint64_t count = 0;
    for (int x = -1; x <= 9; x++)
        for (int y = -1; y <= 5; y++)
            for (int z = -1; z <= 5; z++, count++) {
                out[3 * count] = x * 0.25;
                out[3 * count + 1] = y * 0.25;
                out[3 * count + 2] = z * 0.25;
            }
    return count;
}

START_TEST(parts_answer_as_the_whole)
{
    halves h;
    double at[3 * 11 * 7 * 7];
    ebpo_inside_result got[11 * 7 * 7], expected[11 * 7 * 7];
    ebpo_distance_result near[11 * 7 * 7], nearest[11 * 7 * 7];
    uint64_t number[11 * 7 * 7], count = grid_points(at);
    make_halves(&h);
    ASSERT_OK(ebpo_catalogue_inside(h.a.catalogue, h.a.models, at, count, NULL, got, error));
    ASSERT_OK(ebpo_inside_many(h.whole.context, at, count, NULL, expected, error));
    ASSERT_OK(
        ebpo_catalogue_distance(h.a.catalogue, h.a.models, at, count, NULL, near, number, error));
    ASSERT_OK(ebpo_distance_many(h.whole.context, at, count, NULL, nearest, error));
    for (uint64_t i = 0; i < count; i++) {
        ck_assert_int_eq(got[i].where, expected[i].where);
        ck_assert_int_eq(got[i].winding, expected[i].winding);
        ck_assert_double_eq(near[i].distance, nearest[i].distance);
        ck_assert_uint_le(number[i], 1);
        ck_assert_uint_eq(near[i].face / 1000, number[i] + 1);
    }
    ebpo_ray through = { { -1, 0.3, 0.4 }, { 1, 0, 0 }, INFINITY },
             back = { { 3, 0.3, 0.4 }, { -1, 0, 0 }, INFINITY };
    ebpo_ray_hit hit;
    ASSERT_OK(
        ebpo_catalogue_ray(h.a.catalogue, h.a.models, &through, 1, NULL, &hit, number, error));
    ck_assert(hit.t == 1 && hit.face / 1000 == 1 && number[0] == 0 && hit.side == 1);
    through.origin[0] = 0.5; /* no cap is in the way */
    ASSERT_OK(
        ebpo_catalogue_ray(h.a.catalogue, h.a.models, &through, 1, NULL, &hit, number, error));
    ck_assert(hit.t == 1.5 && hit.face / 1000 == 2 && number[0] == 1 && hit.side == -1);
    ASSERT_OK(ebpo_catalogue_ray(h.a.catalogue, h.a.models, &back, 1, NULL, &hit, number, error));
    ck_assert(hit.t == 1 && number[0] == 1);
    free_halves(&h);
}
END_TEST

START_TEST(caps_alone_are_no_surface)
{
    ebpo_error said = EBPO_ERROR_INIT;
    ebpo_catalogue_entry caps = entry[0];
    ebpo_inside_result where;
    ebpo_distance_result distance;
    uint64_t number;
    const double middle[3] = { 0.5, 0.5, 0.5 };
    caps.unseen = true;
    asked a = ask_entries(&caps, 1, 0);
    ASSERT_OK(ebpo_catalogue_inside(a.catalogue, a.models, middle, 1, NULL, &where, error));
    ck_assert_int_eq(where.where, EBPO_IN);
    ck_assert_int_eq(ebpo_catalogue_distance(a.catalogue, a.models, middle, 1, NULL, &distance,
                                             &number, &said),
                     EBPO_E_ABSENT);
    end_asking(&a);
}
END_TEST

/* --- files --- */

static char *text_of(const char *path)
{
    FILE *in = fopen(path, "rb");
    ck_assert_ptr_nonnull(in);
    char *text = query_room(1 << 16, 1);
    size_t size = fread(text, 1, (1 << 16) - 1, in);
    text[size] = 0;
    fclose(in);
    return text;
}

START_TEST(files_are_read_as_they_were_written)
{
    ebpo_catalogue_entry some[3] = { entry[0], entry[1], entry[2] };
    ebpo_catalogue_options o = EBPO_CATALOGUE_OPTIONS_INIT;
    ebpo_catalogue *made, *read;
    ebpo_catalogue_facts facts = EBPO_CATALOGUE_FACTS_INIT;
    char *path = strdup(scratch("c.json"));
    some[0].min[0] = -0.1;
    some[0].min[1] = 5e-324 - 1;
    some[0].max[0] = 123456789012345678;
    some[0].max[1] = 1.7976931348623157e308;
    some[1].path = "sub/quote\" \\ \n.h5";
    some[1].unseen = true;
    some[2].surface = "other.h5";
    some[2].numbers = "/n.npy";
    some[2].file_bytes = 0;
    o.parts = true;
    o.rule = EBPO_RULE_EVENODD;
    o.folder = scratch(NULL);
    ASSERT_OK(ebpo_catalogue_new(some, 3, &o, &made, error));
    ASSERT_OK(ebpo_catalogue_save(made, path, error));
    ASSERT_OK(ebpo_catalogue_open(path, NULL, &read, error));
    ck_assert_int_eq(ebpo_catalogue_get_facts(read, &facts), EBPO_OK);
    ck_assert(facts.count == 3 && facts.parts && facts.rule == EBPO_RULE_EVENODD);
    ck_assert_str_eq(facts.path, path);
    for (uint64_t i = 0; i < 3; i++) {
        const ebpo_catalogue_entry *a = ebpo_catalogue_get_entry(made, i),
                                   *b = ebpo_catalogue_get_entry(read, i);
        ck_assert_str_eq(a->path, b->path);
        ck_assert(memcmp(a->min, b->min, sizeof a->min) == 0 &&
                  memcmp(a->max, b->max, sizeof a->max) == 0 &&
                  memcmp(a->digest, b->digest, sizeof a->digest) == 0);
        ck_assert(a->solid == b->solid && a->unseen == b->unseen && a->rule == b->rule);
        ck_assert(!a->surface == !b->surface && (!a->surface || !strcmp(a->surface, b->surface)));
        ck_assert(!a->numbers == !b->numbers && (!a->numbers || !strcmp(a->numbers, b->numbers)));
        ck_assert(i == 2 || a->face_count == b->face_count);
    }
    ck_assert_ptr_null(ebpo_catalogue_get_entry(read, 3));
    char *text = text_of(path);
    ck_assert_ptr_nonnull(strstr(text, "\"path\": \"sub/quote\\\" \\\\ \\u000a.h5\""));
    ck_assert_ptr_nonnull(strstr(text, "\"surface\": \"other.h5\""));
    ck_assert_ptr_nonnull(strstr(text, "[-0.1, -1, "));
    ck_assert_ptr_nonnull(strstr(text, "[1.2345678901234568e+17, 1.7976931348623157e+308, "));
    free(text);
    ebpo_catalogue_free(made);
    ebpo_catalogue_free(read);
    free(path);
}
END_TEST

START_TEST(entries_that_are_none_are_refused)
{
    ebpo_error said = EBPO_ERROR_INIT;
    ebpo_catalogue *made;
    ck_assert_int_eq(ebpo_catalogue_new(entry, 0, NULL, &made, &said), EBPO_E_ARGUMENT);
    for (int i = 0; i < 5; i++) {
        ebpo_catalogue_entry e = entry[0];
        e.path = i == 0 ? NULL : i == 1 ? "" : e.path;
        e.min[1] = i == 2 ? NAN : i == 3 ? 1e9 : e.min[1];
        e.surface = i == 4 ? "" : NULL;
        ck_assert_int_eq(ebpo_catalogue_new(&e, 1, NULL, &made, &said), EBPO_E_ARGUMENT);
    }
    ebpo_catalogue_entry e = entry[0];
    e.path = "\xff.h5";
    ASSERT_OK(ebpo_catalogue_new(&e, 1, NULL, &made, error));
    ck_assert_int_eq(ebpo_catalogue_save(made, scratch("no.json"), &said), EBPO_E_ARGUMENT);
    ebpo_catalogue_free(made);
}
END_TEST

/* Opens a catalogue whose text has `from` replaced by `to`, and asks it about the middle. */
static ebpo_status ask_changed(const char *text, const char *from, const char *to,
                               ebpo_error *error)
{
    const char *path = scratch("changed.json"), *at = strstr(text, from);
    const double middle[3] = { 0.5, 0.5, 0.5 };
    ebpo_catalogue *c;
    ebpo_catalogue_models *models = NULL;
    ebpo_distance_result out;
    uint64_t number;
    ck_assert_msg(at != NULL, "no %s", from);
    FILE *file = fopen(path, "wb");
    fprintf(file, "%.*s%s%s", (int)(at - text), text, to, at + strlen(from));
    fclose(file);
    ebpo_status status = ebpo_catalogue_open(path, NULL, &c, error);
    if (status == EBPO_OK)
        status = ebpo_catalogue_models_new(NULL, &models, error);
    if (status == EBPO_OK)
        status = ebpo_catalogue_distance(c, models, middle, 1, NULL, &out, &number, error);
    ebpo_catalogue_models_free(models);
    ebpo_catalogue_free(c);
    return status;
}

static const struct {
    const char *from, *to;
    ebpo_status status;
    const char *says;
} hostile[] = {
    { "ebpo-catalogue", "ebpo-catalogue", EBPO_OK, "" },
    { "ebpo-catalogue", "catalogue", EBPO_E_FORMAT, "there is no \"format\"" },
    { "\"version\": 1", "\"version\": 2", EBPO_E_VERSION, "version 2" },
    { "\"version\": 1", "\"version\": true", EBPO_E_VERSION, "version 0" },
    { "\"version\": 1", "\"version\": 1, \"parts\": 1", EBPO_E_FORMAT, "parts is true or false" },
    { "\"version\": 1", "\"version\": 1, \"rule\": \"no\"", EBPO_E_FORMAT, "rule is" },
    { "\"version\": 1", "\"version\": 1, \"more\": [{}]", EBPO_OK, "" },
    { "\"models\"", "\"others\"", EBPO_E_FORMAT, "one model at least" },
    { "\"path\"", "\"paths\"", EBPO_E_FORMAT, "models[0]: has no path" },
    { "\"path\": \"", "\"path\": \"\\ud800", EBPO_E_FORMAT, "line 6" },
    { "\"path\": \"", "\"path\": \"\\u0000", EBPO_E_FORMAT, "line 6" },
    { "\"path\": \"", "\"path\": \"nowhere", EBPO_E_IO, "nowhere" },
    { "\"path\": \"", "\"path\": 1, \"was\": \"", EBPO_E_FORMAT, "path is no text" },
    { "\"content_sha256\": \"", "\"content_sha256\": \"X", EBPO_E_FORMAT, "no digest" },
    { "\"solid\": true", "\"solid\": 1", EBPO_E_FORMAT, "solid is true or false" },
    { "\"box_min\": [0,", "\"box_min\": [false,", EBPO_E_FORMAT, "two corners" },
    { "\"box_min\": [0,", "\"box_min\": [0, 0,", EBPO_E_FORMAT, "two corners" },
    { "\"box_min\": [0,", "\"box_min\": [NaN,", EBPO_E_FORMAT, "line" },
    { "\"box_min\": [0,", "\"box_min\": [1e999,", EBPO_E_FORMAT, "overflow" },
    { "\"box_min\": [0,", "\"box_min\": [9,", EBPO_E_FORMAT, "box_min is above box_max" },
    { "\"box_min\": [0,", "\"box_min\": [0.25,", EBPO_E_FORMAT, "not within the box" },
    { "\"pruned\": false", "\"numbers\": \"none.npy\"", EBPO_E_FORMAT, "none.npy" },
    { "\"pruned\": false", "\"numbers\": \"few.npy\"", EBPO_E_FORMAT, "3 numbers of 3072 faces" },
    { "\"pruned\": false", "\"numbers\": \"low.npy\"", EBPO_E_FORMAT, "negative" },
    { "\"pruned\": false", "\"surface\": \"x\"", EBPO_E_FORMAT, "surface_sha256 is no digest" },
    { "\"pruned\": false", "\"surface\": null", EBPO_E_ABSENT, "caps alone" },
};

START_TEST(what_a_file_says_wrongly_is_noticed)
{
    ebpo_error said = EBPO_ERROR_INIT;
    const char *path = scratch("told.json");
    asked a = ask_entries(entry, 1, 0);
    ASSERT_OK(ebpo_catalogue_save(a.catalogue, path, error));
    end_asking(&a);
    write_numbers(scratch("few.npy"), 3, 0);
    write_numbers(scratch("low.npy"), model[0].mesh.face_count, -99999);
    char *text = text_of(path);
    for (size_t i = 0; i < sizeof hostile / sizeof hostile[0]; i++) {
        ebpo_status status = ask_changed(text, hostile[i].from, hostile[i].to, &said);
        ck_assert_msg(status == hostile[i].status && strstr(said.message, hostile[i].says),
                      "%s: %d, %s", hostile[i].to, (int)status, said.message);
        said = (ebpo_error)EBPO_ERROR_INIT;
    }
    /* another digest, of the right form */
    char *digest = strstr(text, "sha256\": \"") + 10;
    *digest = *digest == '0' ? '1' : '0';
    ck_assert_int_eq(ask_changed(text, "\"version\": 1", "\"version\": 1", &said), EBPO_E_FORMAT);
    ck_assert_ptr_nonnull(strstr(said.message, "is not the file that"));
    char deep[5000];
    memset(deep, '[', sizeof deep - 1);
    deep[sizeof deep - 1] = 0;
    ck_assert_int_eq(ask_changed(deep, "[", "[", &said), EBPO_E_FORMAT);
    free(text);
}
END_TEST

/* --- functions of the caller --- */

typedef struct opener {
    atomic_int opened, closed;
    int fails; /* which opening; 0: none */
} opener;

static ebpo_status open_counted(void *user, const char *path, ebpo_file **out, ebpo_error *error)
{
    opener *o = user;
    if (++o->opened == o->fails) {
        o->opened--;
        error->status = EBPO_E_IO;
        snprintf(error->message, sizeof error->message, "the tape is torn");
        return EBPO_E_IO;
    }
    return ebpo_open(path, out, error);
}

static void close_counted(void *user, ebpo_file *file)
{
    ((opener *)user)->closed++;
    ebpo_close(file);
}

START_TEST(files_are_opened_by_the_caller)
{
    ebpo_error said = EBPO_ERROR_INIT;
    opener o = { .fails = 3 };
    ebpo_catalogue_options how = EBPO_CATALOGUE_OPTIONS_INIT;
    ebpo_catalogue_models_options few = EBPO_CATALOGUE_MODELS_OPTIONS_INIT;
    ebpo_inside_result *out = query_room(POINTS, sizeof *out);
    asked a;
    how.open_file = open_counted;
    how.close_file = close_counted;
    how.user = &o;
    few.memory = little_memory();
    ASSERT_OK(ebpo_catalogue_new(entry, MODELS, &how, &a.catalogue, error));
    ASSERT_OK(ebpo_catalogue_models_new(&few, &a.models, error));
    ck_assert_int_eq(ebpo_catalogue_inside(a.catalogue, a.models, points, POINTS, NULL, out, &said),
                     EBPO_E_IO);
    ck_assert_str_eq(said.message, "the tape is torn");
    o.fails = 0;
    ask_everything(&a, 2);
    ck_assert_int_gt(o.closed, 0);
    end_asking(&a);
    ck_assert_int_eq(o.opened, o.closed);
    free(out);
}
END_TEST

static bool stop_at_once(void *user, const char *stage, uint64_t done, uint64_t total)
{
    (void)stage;
    (void)done;
    (void)total;
    ++*(int *)user;
    return false;
}

START_TEST(questions_are_checked_and_may_be_stopped)
{
    ebpo_error said = EBPO_ERROR_INIT;
    ebpo_catalogue_ask_options o = on_threads(1);
    ebpo_inside_result *out = query_room(POINTS, sizeof *out);
    ebpo_distance_result distance;
    ebpo_ray ray = { { 9, 9, 9 }, { 0, 0, 0 }, 1 };
    ebpo_ray_hit hit;
    uint64_t number;
    int calls = 0;
    asked a = ask_entries(entry, MODELS, 0);
    ebpo_model_stats sums;
    double far[6] = { 99, 99, 99, 99, NAN, 99 };
    ck_assert_int_eq(ebpo_catalogue_inside(a.catalogue, a.models, far, 2, &o, out, &said),
                     EBPO_E_ARGUMENT);
    ck_assert_ptr_nonnull(strstr(said.message, "point 1 "));
    ck_assert_int_eq(ebpo_catalogue_ray(a.catalogue, a.models, &ray, 1, &o, &hit, &number, &said),
                     EBPO_E_ARGUMENT);
    o.max_distance = -1;
    ck_assert_int_eq(ebpo_catalogue_distance(a.catalogue, a.models, far, 1, &o, &distance, &number,
                                             &said),
                     EBPO_E_ARGUMENT);
    o.max_distance = INFINITY;
    ASSERT_OK(ebpo_catalogue_inside(a.catalogue, a.models, far, 1, &o, out, error));
    ck_assert_int_eq(out[0].where, EBPO_OUT);
    ck_assert_uint_eq(stats_of(&a, &sums).opened, 0);
    o.progress = (ebpo_progress){ stop_at_once, &calls };
    ck_assert_int_eq(ebpo_catalogue_inside(a.catalogue, a.models, points, POINTS, &o, out, &said),
                     EBPO_E_CANCELLED);
    ck_assert_int_eq(calls, 1);
    end_asking(&a);
    free(out);
}
END_TEST

/* --- boxes --- */

enum { BOXES = 300 };

static double least_distance(const ebpo_catalogue_box *b, const double p[3])
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        double d = fmax(fmax(b->min[k] - p[k], p[k] - b->max[k]), 0);
        sum += d * d;
    }
    return sqrt(sum);
}

static double most_distance(const ebpo_catalogue_box *b, const double p[3])
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        double d = fmax(b->max[k] - p[k], p[k] - b->min[k]);
        sum += d * d;
    }
    return sqrt(sum);
}

static bool is_named(const ebpo_catalogue_pairs *pairs, uint32_t box)
{
    for (uint64_t i = 0; i < pairs->count; i++)
        if (pairs->pair[i].box == box)
            return true;
    return false;
}

START_TEST(boxes_that_are_left_out_do_not_matter)
{
    ebpo_catalogue_box boxes[BOXES];
    uint32_t number[BOXES];
    ebpo_catalogue_boxes tree;
    ebpo_catalogue_pairs pairs = { NULL, 0, 0 };
    uint64_t seed = 1, named = 0, needed = 0;
    for (uint32_t i = 0; i < BOXES; i++) {
        number[i] = i;
        for (int k = 0; k < 3; k++) {
            double size = ebpo_test_random_unit(&seed);
            boxes[i].min[k] = 2 * ebpo_test_random_unit(&seed) - 1;
            boxes[i].max[k] = boxes[i].min[k] + 0.1 * size * size;
        }
    }
    ck_assert(ebpo_catalogue_boxes_make(&tree, boxes, number, BOXES));
    for (int turn = 0; turn < 500; turn++) {
        double p[3], reach = INFINITY;
        for (int k = 0; k < 3; k++)
            p[k] = turn % 2 ? boxes[turn % BOXES].min[k] : 2.4 * ebpo_test_random_unit(&seed) - 1.2;
        pairs.count = 0;
        ck_assert(ebpo_catalogue_boxes_holding(&tree, p, 0, &pairs));
        for (uint32_t i = 0; i < BOXES; i++) {
            ck_assert_int_eq(is_named(&pairs, i), least_distance(&boxes[i], p) == 0);
            reach = fmin(reach, most_distance(&boxes[i], p));
        }
        pairs.count = 0;
        ck_assert(ebpo_catalogue_boxes_near(&tree, p, INFINITY, 0, &pairs));
        for (uint32_t i = 0; i < BOXES; i++) {
            bool near = least_distance(&boxes[i], p) <= reach;
            ck_assert(!near || is_named(&pairs, i));
            needed += near;
        }
        named += pairs.count;
    }
    ck_assert_uint_lt(10 * named, 11 * needed);
    free(pairs.pair);
    ebpo_catalogue_boxes_free(&tree);
}
END_TEST

Suite *test_suite(void)
{
    Suite *suite = suite_create("catalogue");
    TCase *all = tcase_create("catalogue");
    tcase_set_timeout(all, 600);
    tcase_add_unchecked_fixture(all, make_models, free_models);
    tcase_add_checked_fixture(all, scratch_enter, scratch_leave);
    tcase_add_test(all, models_are_asked_as_one);
    tcase_add_test(all, models_are_closed_and_opened_again);
    tcase_add_test(all, a_budget_may_be_too_small);
    tcase_add_test(all, parts_answer_as_the_whole);
    tcase_add_test(all, caps_alone_are_no_surface);
    tcase_add_test(all, files_are_read_as_they_were_written);
    tcase_add_test(all, entries_that_are_none_are_refused);
    tcase_add_test(all, what_a_file_says_wrongly_is_noticed);
    tcase_add_test(all, files_are_opened_by_the_caller);
    tcase_add_test(all, questions_are_checked_and_may_be_stopped);
    tcase_add_test(all, boxes_that_are_left_out_do_not_matter);
    suite_add_tcase(suite, all);
    return suite;
}
