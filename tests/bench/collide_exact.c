/* Compares pairs of faces and distances of two models with brute force in rational arithmetic
 * (tests/support/models_reference.h). This takes seconds per pose from 30,000 faces on.
 *
 *     collide_exact POSES A.ply|A.obj|... [...]
 *
 * Tests each model with itself and with the next one, at poses of sixteen kinds in turn. These
 * include identical models, quarter turns, halves, touching boxes, a gap of 1e-9, slight and deep
 * penetration, one model within the other, and separate models. Prints a table row for each two
 * models; fails if a result differs. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/collide.h>

#include "model_file.h"
#include "models_reference.h"

typedef struct reported {
    reference_found *intersected;
    uint64_t count, capacity;
} reported;

typedef struct counts {
    uint64_t pairs, missed, extra, apart, far_off;
} counts;

static bool keep(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    reported *t = user;
    if (t->count + count > t->capacity) {
        t->capacity = 2 * (t->count + count);
        t->intersected = realloc(t->intersected, t->capacity * sizeof *t->intersected);
        if (!t->intersected)
            abort();
    }
    for (uint64_t i = 0; i < count; i++)
        t->intersected[t->count++] =
            (reference_found){ pairs[i].file_face_a, pairs[i].file_face_b, (int)pairs[i].kind };
    return true;
}

static int order(const void *x, const void *y)
{
    const reference_found *p = x, *q = y;
    return p->a != q->a   ? (p->a > q->a) - (p->a < q->a)
           : p->b != q->b ? (p->b > q->b) - (p->b < q->b)
                          : (p->kind > q->kind) - (p->kind < q->kind);
}

/* Pairs of another kind count as missed, and as extra. */
static void compare(const reported *got, const reference_found *intersected, uint64_t count,
                    counts *out)
{
    uint64_t i = 0, n = 0;
    out->pairs += count;
    while (i < got->count || n < count) {
        int by = i == got->count ? 1
                 : n == count    ? -1
                                 : order(&got->intersected[i], &intersected[n]);
        out->extra += by < 0;
        out->missed += by > 0;
        i += by <= 0;
        n += by >= 0;
    }
}

static void inspect_distance(ebpo_collider *collider, const ebpo_collide_options *how,
                             const reference_faces f[2], bool intersect, counts *out)
{
    ebpo_collide_distance_result far;
    ebpo_error error = EBPO_ERROR_INIT;
    model_must(ebpo_collide_distance(collider, how, NULL, &far, &error), "distance", &error);
    if ((far.distance.hi == 0) != intersect || far.distance.lo != far.distance.hi)
        out->far_off++;
    else if (!intersect)
        out->far_off +=
            reference_models_distance(&f[0], &f[1], far.distance.hi, far.pair.file_face_a,
                                      far.pair.file_face_b) != NULL;
    out->apart += !intersect;
}

static void look(const query_model m[2], ebpo_collider *collider, int kind, uint64_t *state,
                 counts *out)
{
    ebpo_collide_options how = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    reference_faces f[2];
    reference_found *intersected;
    reported got = { 0 };
    reference_pose(kind, m[0].size, state, &how.pose_a, &how.pose_b);
    reference_faces_make(&f[0], &m[0], &how.pose_a);
    reference_faces_make(&f[1], &m[1], &how.pose_b);
    uint64_t count = reference_pairs(&f[0], &f[1], &intersected);
    model_must(ebpo_collide_all(collider, &how, keep, &got, &error), "all pairs", &error);
    if (got.count)
        qsort(got.intersected, got.count, sizeof *got.intersected, order);
    compare(&got, intersected, count, out);
    inspect_distance(collider, &how, f, count > 0, out);
    for (int i = 0; i < 2; i++)
        reference_faces_free(&f[i]);
    free(got.intersected);
    free(intersected);
}

static void read_model(const char *path, query_model *out)
{
    const char *name = strrchr(path, '/') ? strrchr(path, '/') + 1 : path;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh mesh;
    model_must(ebpo_mesh_read(path, NULL, &mesh, &error), path, &error);
    model_must(query_model_try(out, name, mesh, &query_variants[0], &error), path, &error);
}

static bool inspect_poses(const query_model m[2], int poses)
{
    ebpo_collider *collider;
    ebpo_error error = EBPO_ERROR_INIT;
    counts c = { 0 };
    uint64_t state = 1;
    model_must(ebpo_collider_new(m[0].model, m[1].model, NULL, &collider, &error), "collider",
               &error);
    for (int i = 0; i < poses; i++)
        look(m, collider, i % REFERENCE_POSES, &state, &c);
    ebpo_collider_free(collider);
    printf("| %s, %s | %" PRIu64 ", %" PRIu64 " | %d | %" PRIu64 " | %" PRIu64 " | %" PRIu64
           " | %" PRIu64 " | %" PRIu64 " |\n",
           m[0].name, m[1].name, m[0].mesh.face_count, m[1].mesh.face_count, poses, c.pairs,
           c.missed, c.extra, c.apart, c.far_off);
    fflush(stdout);
    return !(c.missed || c.extra || c.far_off);
}

int main(int argc, char **argv)
{
    int poses = argc > 2 ? atoi(argv[1]) : 0;
    bool fine = true;
    if (poses <= 0) {
        fprintf(stderr, "usage: collide_exact POSES MESH...\n");
        return 2;
    }
    printf("| models | faces | poses | pairs | missed | extra | apart | distances that differ |\n"
           "|---|---|---|---|---|---|---|---|\n");
    for (int i = 2; i < argc; i++) {
        query_model m[3];
        read_model(argv[i], &m[0]);
        read_model(argv[i], &m[1]);
        fine = inspect_poses(m, poses) && fine;
        query_model_free(&m[1]);
        if (i + 1 < argc) {
            read_model(argv[i + 1], &m[1]);
            fine = inspect_poses(m, poses) && fine;
            query_model_free(&m[1]);
        }
        query_model_free(&m[0]);
    }
    return fine ? 0 : 1;
}
