/* Measures the accuracy of results: makes queries that are hard to decide, and compares results
 * with rational arithmetic (tests/support/oracle.h, brute force). For models that are not large.
 *
 *     exact_judge make FILE.ebpo.h5 points|rays COUNT OUT.raw
 *     exact_judge judge FILE.ebpo.h5 QUERY POINTS.raw TMAX TOLERANCE RESULTS...
 *
 * Points are in turn on a vertex, on an edge and on a face (as exactly as doubles permit), in the
 * plane of a face, above a vertex, next to a vertex, between two vertices, and in a plane of the
 * octree.
 *
 * Rays go to a vertex, to the middle of an edge, from a vertex, along an axis through a vertex,
 * along an edge, in the plane of a face, from the middle of an edge, and from vertex to vertex.
 *
 * The files of results have the layout of peer.hpp. Prints JSON for each of them.
 * `decisions`: wrong inside results (without points on the surface, unless the program reports
 * these), hits, and numbers of hits.
 * `values`: distances or positions with an error above TOLERANCE, in the unit of the model.
 * `bits`: values that are not correctly rounded, or a wrong first face or sign. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/file.h>
#include <ebpo/query.h>

#include "model_file.h"
#include "geometry/cells.h"
#include "oracle.h"
#include "solids.h"

typedef struct subject {
    ebpo_mesh mesh;
    ebpo_maps maps;
    bool has_maps, solid;
    ebpo_box box;
    oracle *truth;
} subject;

typedef struct result {
    double value;
    int64_t face;
} result;

/* Differences between a result and the truth. */
typedef struct verdict {
    uint64_t decisions, values, bits;
} verdict;

typedef enum query { INSIDE, DISTANCE, RAY, RAY_ANY, RAY_ALL, QUERIES } query;
static const char *const queries[QUERIES] = { "inside", "distance", "ray", "ray-any", "ray-all" };

static void fail(const char *what)
{
    fprintf(stderr, "exact_judge: %s\n", what);
    exit(EXIT_FAILURE);
}

static void read_subject(subject *s, const char *path)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = model_open(path);
    model_must(ebpo_file_read_mesh(file, NULL, &s->mesh, &error), "reading the mesh", &error);
    s->has_maps = ebpo_file_read_maps(file, NULL, &s->maps, &error) == EBPO_OK;
    s->solid = ebpo_file_info(file)->solid;
    if (s->solid && ebpo_file_info(file)->rule != EBPO_RULE_NONZERO)
        fail("only the rule nonzero is supported");
    s->box = ebpo_root_box(ebpo_file_info(file));
    s->truth = oracle_make(&s->mesh);
    ebpo_close(file);
}

/* --- hard queries --- */

static uint64_t random_state = 1;

static uint64_t random_below(uint64_t most)
{
    random_state = random_state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (random_state >> 20) % most;
}

static double random_unit(void) { return (double)random_below(UINT64_C(1) << 24) * 0x1p-24; }

static void random_point(const subject *s, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = (float)(s->box.origin[k] + s->box.size[k] * random_unit());
}

static void corners(const subject *s, double out[3][3])
{
    uint64_t face = random_below(s->mesh.face_count);
    for (unsigned i = 0; i < 3; i++)
        ebpo_test_point(&s->mesh, s->mesh.faces[3 * face + i], out[i]);
}

/* u a + v b + w c */
static void mixed(double out[3], double u, const double a[3], double v, const double b[3], double w,
                  const double c[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = u * a[k] + v * b[k] + w * c[k];
}

static void hard_point(const subject *s, uint64_t turn, double p[3])
{
    double t[3][3], other[3][3];
    unsigned axis = (unsigned)random_below(3);
    corners(s, t);
    corners(s, other);
    mixed(p, 1, t[0], 0, t[1], 0, t[2]);
    switch (turn % 8) {
    case 0: break;
    case 1: mixed(p, 0.5, t[0], 0.5, t[1], 0, t[2]); break;
    case 2: mixed(p, 1 / 3., t[0], 1 / 3., t[1], 1 / 3., t[2]); break;
    case 3: mixed(p, 2, t[0], -1, t[1], 0, t[2]); break;
    case 4: p[axis] = s->box.origin[axis] + s->box.size[axis] * random_unit(); break;
    case 5: p[axis] = nextafter(p[axis], random_below(2) ? INFINITY : -INFINITY); break;
    case 6: mixed(p, 0.5, t[0], 0.5, other[0], 0, t[2]); break;
    default: p[axis] = s->box.origin[axis] + s->box.size[axis] * (double)random_below(65) / 64;
    }
}

static void hard_ray(const subject *s, uint64_t turn, double r[6])
{
    double t[3][3], other[3][3], *from = r, *along = r + 3, middle[3];
    unsigned axis = (unsigned)random_below(3);
    corners(s, t);
    corners(s, other);
    mixed(middle, 0.5, t[0], 0.5, t[1], 0, t[2]);
    random_point(s, from);
    switch (turn % 8) {
    case 0: mixed(along, 1, t[0], -1, from, 0, t[2]); break;
    case 1: mixed(along, 1, middle, -1, from, 0, t[2]); break;
    case 2: mixed(along, 1, from, -1, t[0], 0, t[2]); break;
    case 3: mixed(along, 0, t[0], 0, t[1], 0, t[2]); break;
    case 4: mixed(along, 1, t[1], -1, t[0], 0, t[2]); break;
    case 5: mixed(along, -2, t[0], 1, t[1], 1, t[2]); break;
    case 6: mixed(along, 1, from, -1, middle, 0, t[2]); break;
    default: mixed(along, 1, other[0], -1, t[0], 0, t[2]);
    }
    switch (turn % 8) {
    case 2:
    case 7: mixed(from, 1, t[0], 0, t[1], 0, t[2]); break;
    case 3:
        mixed(from, 1, t[0], 0, t[1], 0, t[2]);
        from[axis] = (float)(s->box.origin[axis] - s->box.size[axis]);
        along[axis] = 1;
        break;
    case 4: mixed(from, 2, t[0], -1, t[1], 0, t[2]); break;
    case 5: mixed(from, 3, t[0], -1, t[1], -1, t[2]); break;
    case 6: mixed(from, 1, middle, 0, t[1], 0, t[2]); break;
    default: break;
    }
}

static void run_query(const subject *s, bool rays, uint64_t count, const char *path)
{
    FILE *f = fopen(path, "wb");
    for (uint64_t i = 0; f && i < count; i++) {
        double row[6];
        do
            (rays ? hard_ray : hard_point)(s, i, row);
        while (rays && row[3] == 0 && row[4] == 0 && row[5] == 0);
        fwrite(row, sizeof *row, rays ? 6 : 3, f);
    }
    if (!f || fclose(f) != 0)
        fail("the queries cannot be written");
}

/* --- reference --- */

static void *read_file(const char *path, size_t *bytes)
{
    FILE *f = fopen(path, "rb");
    if (!f || fseek(f, 0, SEEK_END) != 0)
        fail("a file cannot be read");
    *bytes = (size_t)ftell(f);
    rewind(f);
    void *out = malloc(*bytes + 1);
    if (!out || fread(out, 1, *bytes, f) != *bytes)
        fail("a file cannot be read");
    fclose(f);
    return out;
}

static int64_t reported_face(const subject *s, uint32_t face)
{
    return s->has_maps ? s->maps.face_source[face] : face;
}

/* Returns the exact result. inside: the value is an ebpo_where. */
static result truth_of(const subject *s, query what, const double *q, double tmax)
{
    oracle_nearest near;
    const oracle_hit *hits;
    uint32_t count;
    if (what >= RAY) {
        oracle_ray(s->truth, q, q + 3, tmax, &hits, &count);
        if (count == 0)
            return (result){ INFINITY, -1 };
        if (what == RAY_ANY)
            return (result){ 0, 0 };
        return (result){ what == RAY ? hits[0].t : count, reported_face(s, hits[0].face) };
    }
    oracle_find_nearest(s->truth, q, &near);
    bool in = s->solid && !near.on && oracle_winding(s->truth, q) != 0;
    if (what == INSIDE)
        return (result){ near.on ? EBPO_ON : in ? EBPO_IN : EBPO_OUT, -1 };
    return (result){ in ? -near.distance : near.distance, reported_face(s, near.faces[0]) };
}

static result given(query what, const void *results, uint64_t i)
{
    if (what != INSIDE)
        return ((const result *)results)[i];
    return (result){ ((const uint8_t *)results)[i], -1 };
}

static void judge_one(query what, const result *truth, const result *reported, double tolerance,
                      verdict *v)
{
    bool on = what == INSIDE && truth->value == EBPO_ON;
    bool other = what == INSIDE || what == RAY_ALL ? truth->value != reported->value
                                                   : (truth->face < 0) != (reported->face < 0);
    v->bits += memcmp(&truth->value, &reported->value, sizeof reported->value) != 0 ||
               truth->face != reported->face;
    if (on && reported->value != EBPO_ON)
        return;
    v->decisions += other;
    if ((what == DISTANCE || what == RAY) && !other && truth->face >= 0)
        v->values += !(fabs(fabs(truth->value) - fabs(reported->value)) <= tolerance);
}

static double length(const double d[3]) { return sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]); }

static void judge(const subject *s, query what, const double *points, uint64_t count, double tmax,
                  double tolerance, char **paths, int files)
{
    void *results[16];
    verdict verdicts[16] = { { 0 } };
    size_t bytes, each = what == INSIDE ? 1 : sizeof(result);
    uint64_t on = 0;
    for (int k = 0; k < files; k++) {
        results[k] = read_file(paths[k], &bytes);
        if (bytes != count * each)
            fail("the numbers of results and queries differ");
    }
    for (uint64_t i = 0; i < count; i++) {
        const double *q = points + i * (what >= RAY ? 6 : 3);
        result truth = truth_of(s, what, q, tmax);
        double unit = what == RAY ? tolerance / length(q + 3) : tolerance;
        on += what == INSIDE ? truth.value == EBPO_ON : truth.value == 0;
        for (int k = 0; k < files; k++) {
            result reported = given(what, results[k], i);
            judge_one(what, &truth, &reported, unit, &verdicts[k]);
        }
    }
    printf("{\"count\": %" PRIu64 ", \"on\": %" PRIu64 ", \"results\": [", count, on);
    for (int k = 0; k < files; k++) {
        printf("%s{\"decisions\": %" PRIu64 ", \"values\": %" PRIu64 ", \"bits\": %" PRIu64 "}",
               k ? ", " : "", verdicts[k].decisions, verdicts[k].values, verdicts[k].bits);
        free(results[k]);
    }
    printf("]}\n");
}

static query query_of(const char *word)
{
    int i = 0;
    while (i < QUERIES && strcmp(word, queries[i]) != 0)
        i++;
    return (query)i;
}

int main(int argc, char **argv)
{
    bool makes = argc == 6 && strcmp(argv[1], "make") == 0,
         judges = argc >= 8 && argc <= 23 && strcmp(argv[1], "judge") == 0 &&
                  query_of(argv[3]) != QUERIES;
    subject s = { .has_maps = false };
    if (!makes && !judges) {
        fprintf(stderr, "usage: exact_judge make FILE.ebpo.h5 points|rays COUNT OUT.raw\n"
                        "       exact_judge judge FILE.ebpo.h5 QUERY POINTS.raw TMAX TOLERANCE "
                        "RESULTS...\n");
        return 2;
    }
    read_subject(&s, argv[2]);
    if (makes)
        run_query(&s, strcmp(argv[3], "rays") == 0, strtoull(argv[4], NULL, 10), argv[5]);
    else {
        query what = query_of(argv[3]);
        size_t bytes;
        double *points = read_file(argv[4], &bytes);
        judge(&s, what, points, bytes / (what >= RAY ? 48 : 24), strtod(argv[5], NULL),
              strtod(argv[6], NULL), argv + 7, argc - 7);
        free(points);
    }
    oracle_free(s.truth);
    ebpo_mesh_free(&s.mesh);
    if (s.has_maps)
        ebpo_maps_free(&s.maps);
    return 0;
}
