/* Corners of faces, eight faces together. */
#include "geom/strict_fp.h"

#include <stdlib.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/huge_pages.h"
#include "base/parallel.h"
#include "accel/accel_parts.h"

typedef struct job {
    ebpo_accel *s;
    const ebpo_mesh *mesh;
    const ebpo_layout *layout;
} job;

static void fill_lane32(float *block, unsigned lane, const ebpo_mesh *mesh, uint32_t face)
{
    for (unsigned i = 0; i < 9; i++)
        block[i * EBPO_BLOCK + lane] =
            mesh->xyz32[3 * (uint64_t)mesh->faces[3 * (uint64_t)face + i / 3] + i % 3];
}

static void fill_lane64(double *block, unsigned lane, const ebpo_mesh *mesh, uint32_t face)
{
    for (unsigned i = 0; i < 9; i++) {
        uint64_t at = 3 * (uint64_t)mesh->faces[3 * (uint64_t)face + i / 3] + i % 3;
        block[i * EBPO_BLOCK + lane] = mesh->xyz64 ? mesh->xyz64[at] : (double)mesh->xyz32[at];
    }
}

static ebpo_status fill(void *context, uint64_t begin, uint64_t end, unsigned worker,
                        ebpo_error *error)
{
    (void)worker;
    (void)error;
    job *j = context;
    ebpo_accel *s = j->s;
    for (uint64_t b = begin; b < end; b++) {
        uint32_t first = j->layout->block_begin[b], last = j->layout->block_end[b];
        s->block_face[b] = first;
        for (unsigned lane = 0; lane < EBPO_BLOCK; lane++) {
            uint32_t face = lane < last - first ? first + lane : first;
            if (s->wide)
                fill_lane64(s->block64 + b * EBPO_BLOCK_NUMBERS, lane, j->mesh, face);
            else
                fill_lane32(s->block32 + b * EBPO_BLOCK_NUMBERS, lane, j->mesh, face);
        }
    }
    return EBPO_OK;
}

ebpo_status ebpo_accel_fill_blocks(ebpo_accel *s, const ebpo_slice *slice,
                                   const ebpo_layout *layout, unsigned threads, ebpo_error *error)
{
    uint64_t numbers = layout->block_count * EBPO_BLOCK_NUMBERS,
             size = s->wide ? sizeof(double) : sizeof(float);
    s->block_count = (uint32_t)layout->block_count;
    void *blocks = aligned_alloc(64, (numbers * size + 127) / 64 * 64);
    ebpo_prefer_huge_pages(blocks, numbers * size);
    if (s->wide)
        s->block64 = blocks;
    else
        s->block32 = blocks;
    s->block_face = ebpo_alloc(layout->block_count + 1, sizeof *s->block_face);
    if (!blocks || !s->block_face)
        return ebpo_fail_memory(error, numbers * size);
    s->block_face[layout->block_count] = (uint32_t)slice->mesh.face_count;
    job j = { s, &slice->mesh, layout };
    return ebpo_parallel_for(threads, NULL, layout->block_count, 1024, fill, &j, NULL, "open",
                             error);
}
