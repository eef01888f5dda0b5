/* Counts the subtrees that contain intersecting faces while one model moves through another.
 *
 *     needed_crossing A.ebpo.h5 B.ebpo.h5 STEPS SIZE MEMORY
 *         the arguments and the poses of peers/crossing_ebpo
 *
 * A subtree is *needed* if it owns a face of an intersecting pair: every exact method must read
 * such a face. Prints for each step the number of pairs of faces, the needed subtrees of both
 * models, those of them that the previous step did not need, the subtrees in the visited pairs, and
 * the loads. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/collide.h>

#include "query/query_model.h"

static ebpo_error error = EBPO_ERROR_INIT;

static void check(ebpo_status status)
{
    if (status == EBPO_OK)
        return;
    fprintf(stderr, "needed_crossing: %s\n", error.message);
    exit(EXIT_FAILURE);
}

/* A subtree, and the file index of the first face that it owns. */
typedef struct owner {
    uint64_t first;
    uint32_t number;
} owner;

typedef struct moved_model {
    ebpo_file *file;
    ebpo_model *model;
    uint64_t count;               /* number of subtrees */
    owner *owners;                /* [count] by their first faces */
    bool *needed, *needed_before; /* [count] in this step, in the previous step */
    double middle[3], diagonal;
} moved_model;

static int by_first(const void *x, const void *y)
{
    const owner *p = x, *q = y;
    return (p->first > q->first) - (p->first < q->first);
}

static void *zeroed(uint64_t count, size_t size)
{
    void *out = calloc(count + 1, size);
    if (!out) {
        perror("needed_crossing");
        exit(EXIT_FAILURE);
    }
    return out;
}

static void open_model(moved_model *m, const char *path, uint64_t memory)
{
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_context *c;
    options.threads = 1;
    options.memory = memory;
    check(ebpo_open(path, &m->file, &error));
    check(ebpo_model_new(m->file, &options, &m->model, &error));
    if (!m->model->top) {
        fprintf(stderr, "needed_crossing: %s fits into the memory\n", path);
        exit(EXIT_FAILURE);
    }
    m->count = m->model->top->below_count;
    m->owners = zeroed(m->count, sizeof *m->owners);
    m->needed = zeroed(m->count, sizeof *m->needed);
    m->needed_before = zeroed(m->count, sizeof *m->needed_before);
    check(ebpo_context_new(m->model, &c, &error));
    for (uint32_t i = 0; i < m->count; i++) {
        ebpo_accel *subtree;
        check(ebpo_context_subtree(c, i, &subtree, &error));
        m->owners[i] = (owner){ subtree->first_face, i };
    }
    ebpo_context_free(c);
    qsort(m->owners, m->count, sizeof *m->owners, by_first);
    ebpo_model_free(m->model); /* a new model has no skeletons */
    check(ebpo_model_new(m->file, &options, &m->model, &error));
    const ebpo_info *info = ebpo_file_info(m->file);
    for (int k = 0; k < 3; k++) {
        m->middle[k] = info->box_origin[k] + info->box_size[k] / 2;
        m->diagonal = hypot(m->diagonal, info->box_size[k]);
    }
}

/* Marks the subtree that owns a face. Of several subtrees with the same first face, all but the
 * last own no face. */
static void mark_owner(moved_model *m, uint64_t face)
{
    uint64_t low = 0, high = m->count;
    while (high - low > 1) {
        uint64_t middle = low + (high - low) / 2;
        *(m->owners[middle].first <= face ? &low : &high) = middle;
    }
    m->needed[m->owners[low].number] = true;
}

typedef struct crossing {
    moved_model model[2];
    uint64_t pairs;
} crossing;

static bool mark_pairs(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    crossing *c = user;
    c->pairs += count;
    for (uint64_t i = 0; i < count; i++) {
        mark_owner(&c->model[0], pairs[i].file_face_a);
        mark_owner(&c->model[1], pairs[i].file_face_b);
    }
    return true;
}

static void run_step(crossing *c, ebpo_collider *collider, const ebpo_collide_options *options)
{
    ebpo_collider_stats before = EBPO_COLLIDER_STATS_INIT, after = EBPO_COLLIDER_STATS_INIT;
    uint64_t needed = 0, added = 0;
    check(ebpo_collider_get_stats(collider, &before));
    c->pairs = 0;
    check(ebpo_collide_all(collider, options, mark_pairs, c, &error));
    check(ebpo_collider_get_stats(collider, &after));
    for (int i = 0; i < 2; i++) {
        moved_model *m = &c->model[i];
        for (uint64_t k = 0; k < m->count; k++) {
            needed += m->needed[k];
            added += m->needed[k] && !m->needed_before[k];
        }
        memcpy(m->needed_before, m->needed, m->count * sizeof *m->needed);
        memset(m->needed, 0, m->count * sizeof *m->needed);
    }
    printf("%" PRIu64 " pairs, needed %" PRIu64 ", new %" PRIu64 ", in pairs %" PRIu64
           ", loads %" PRIu64 "\n",
           c->pairs, needed, added, after.subtrees - before.subtrees, after.loads - before.loads);
}

int main(int argc, char **argv)
{
    crossing c = { .pairs = 0 };
    ebpo_collider *collider;
    ebpo_collider_options alone = EBPO_COLLIDER_OPTIONS_INIT;
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    if (argc != 6) {
        fprintf(stderr, "usage: needed_crossing A.ebpo.h5 B.ebpo.h5 STEPS SIZE MEMORY\n");
        return 2;
    }
    moved_model *a = &c.model[0], *b = &c.model[1];
    open_model(a, argv[1], strtoull(argv[5], NULL, 10));
    open_model(b, argv[2], strtoull(argv[5], NULL, 10));
    alone.threads = 1;
    check(ebpo_collider_new(a->model, b->model, &alone, &collider, &error));
    int steps = atoi(argv[3]);
    double size = atof(argv[4]), scale = size > 0 ? size * a->diagonal / b->diagonal : 1,
           way = (ebpo_file_info(a->file)->box_size[0] +
                  scale * ebpo_file_info(b->file)->box_size[0]) /
                 2;
    options.pose_b.scale = scale;
    for (int i = 0; i <= steps; i++) {
        for (int k = 0; k < 3; k++)
            options.pose_b.translation[k] =
                a->middle[k] - scale * b->middle[k] + 0.01 * a->diagonal;
        options.pose_b.translation[0] += way * (1 - 2.0 * i / steps);
        run_step(&c, collider, &options);
    }
    ebpo_collider_free(collider);
    for (int i = 0; i < 2; i++) {
        ebpo_model_free(c.model[i].model);
        ebpo_close(c.model[i].file);
        free(c.model[i].owners);
        free(c.model[i].needed);
        free(c.model[i].needed_before);
    }
    return 0;
}
