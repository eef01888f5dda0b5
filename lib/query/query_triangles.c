/* The triangles in a box, block by block. */
#include "core/strict_fp.h"

#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "query/box_walk.h"
#include "query/query_model.h"

typedef struct block {
    double corners[EBPO_TRIANGLES_MOST][3][3];
    uint64_t faces[EBPO_TRIANGLES_MOST], file_faces[EBPO_TRIANGLES_MOST];
} block;

typedef struct delivery {
    ebpo_box_walk walk; /* first */
    block *block;
    uint64_t count; /* in the block */
    ebpo_triangles_fn take;
    void *user;
} delivery;

static void hand_over(delivery *d)
{
    ebpo_triangles all = { .count = d->count,
                           .corners = (const double(*)[3][3])d->block->corners,
                           .faces = d->block->faces,
                           .file_faces = d->block->file_faces };
    if (d->count && !d->walk.enough)
        d->walk.enough = !d->take(d->user, &all);
    d->count = 0;
}

static ebpo_status take_triangle(ebpo_box_walk *walk, const ebpo_accel *s, ebpo_error *error)
{
    delivery *d = (delivery *)walk;
    (void)error;
    for (uint64_t i = 0; i < walk->count && !walk->enough; i++) {
        uint32_t local = ebpo_accel_slot_face(s, walk->slot[i]);
        double(*corners)[3] = d->block->corners[d->count];
        ebpo_accel_triangle(s, walk->slot[i], corners);
        if (!ebpo_box_walk_is_first(walk, local >= s->outer_count, (const double(*)[3])corners))
            continue;
        d->block->faces[d->count] = ebpo_accel_source_face(s, local);
        d->block->file_faces[d->count++] = ebpo_accel_file_face(s, local);
        if (d->count == EBPO_TRIANGLES_MOST)
            hand_over(d);
    }
    return EBPO_OK;
}

ebpo_status ebpo_triangles_in_box(ebpo_context *context, const double min[3], const double max[3],
                                  ebpo_triangles_fn function, void *user, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    delivery d = { .walk = { .context = context, .min = min, .max = max, .take = take_triangle },
                   .take = function,
                   .user = user };
    ebpo_status status = ebpo_check_box(min, max, error);
    if (status == EBPO_OK)
        status = ebpo_check_mesh(context->model, error);
    if (status == EBPO_OK)
        status = ebpo_box_walk_check(&d.walk, error); /* before the first triangle is given */
    if (status == EBPO_OK && !(d.block = ebpo_alloc(1, sizeof *d.block)))
        status = ebpo_fail_memory(error, sizeof *d.block);
    if (status == EBPO_OK)
        status = ebpo_box_walk_run(&d.walk, error);
    if (status == EBPO_OK)
        hand_over(&d);
    free(d.block);
    return status;
}
