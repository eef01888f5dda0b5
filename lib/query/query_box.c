/* The faces in a box. */
#include "core/strict_fp.h"

#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "query/box_walk.h"
#include "query/query_model.h"

/* Number in the file, and the one that is told. */
typedef struct pair {
    uint64_t file_face, source_face;
} pair;

typedef struct gathering {
    ebpo_box_walk walk; /* first */
    pair *list;
    uint64_t count, capacity;
} gathering;

static ebpo_status take_face_number(ebpo_box_walk *walk, const ebpo_accel *s, ebpo_error *error)
{
    gathering *g = (gathering *)walk;
    if (!ebpo_grow(&g->list, &g->capacity, g->count + walk->count, sizeof *g->list))
        return ebpo_fail_memory(error, (g->count + walk->count) * sizeof *g->list);
    for (uint64_t i = 0; i < walk->count; i++) {
        uint32_t local = ebpo_accel_slot_face(s, walk->slot[i]);
        g->list[g->count++] =
            (pair){ ebpo_accel_file_face(s, local), ebpo_accel_source_face(s, local) };
    }
    return EBPO_OK;
}

static int compare_pairs(const void *a, const void *b)
{
    const pair *x = a, *y = b;
    return (x->file_face > y->file_face) - (x->file_face < y->file_face);
}

static ebpo_status finish(gathering *g, const uint64_t **faces, uint64_t *count, ebpo_error *error)
{
    ebpo_context *c = g->walk.context;
    if (!ebpo_grow(&c->faces, &c->face_capacity, g->count, sizeof *c->faces))
        return ebpo_fail_memory(error, g->count * sizeof *g->list);
    if (g->count)
        qsort(g->list, g->count, sizeof *g->list, compare_pairs);
    for (uint64_t i = 0; i < g->count; i++)
        if (i == 0 || g->list[i].file_face != g->list[i - 1].file_face) /* subtrees share faces */
            c->faces[(*count)++] = g->list[i].source_face;
    *faces = c->faces;
    return EBPO_OK;
}

ebpo_status ebpo_faces_in_box(ebpo_context *context, const double min[3], const double max[3],
                              const uint64_t **faces, uint64_t *count, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    *faces = NULL;
    *count = 0;
    gathering g = { .walk = { .context = context, .min = min, .max = max, .take = take_face_number } };
    ebpo_status status = ebpo_check_box(min, max, error);
    if (status == EBPO_OK)
        status = ebpo_check_mesh(context->model, error);
    if (status == EBPO_OK)
        status = ebpo_box_walk_run(&g.walk, error);
    if (status == EBPO_OK)
        status = ebpo_box_walk_check(&g.walk, error);
    if (status == EBPO_OK)
        status = finish(&g, faces, count, error);
    free(g.list);
    return status;
}
