#include "format/outer_blocks.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "format/schema.h"

ebpo_status ebpo_outer_blocks_make(ebpo_outer_blocks *out, const ebpo_info *info, ebpo_error *error)
{
    uint64_t faces = info->face_count / EBPO_FACE_BLOCK + 1,
             vertices = info->vertex_count / EBPO_VERTEX_BLOCK + 1;
    *out = (ebpo_outer_blocks){ .round = 1 };
    out->face_round = ebpo_alloc_zero(faces, sizeof *out->face_round);
    out->vertex_round = ebpo_alloc_zero(vertices, sizeof *out->vertex_round);
    out->face_block = ebpo_alloc(faces, sizeof *out->face_block);
    out->vertex_block = ebpo_alloc(vertices, sizeof *out->vertex_block);
    if (!out->face_round || !out->vertex_round || !out->face_block || !out->vertex_block)
        return ebpo_fail_memory(error, (faces + vertices) * 8);
    return EBPO_OK;
}

void ebpo_outer_blocks_free(ebpo_outer_blocks *blocks)
{
    free(blocks->face_round);
    free(blocks->vertex_round);
    free(blocks->face_block);
    free(blocks->vertex_block);
}

static void list_block(uint32_t *rounds, uint32_t round, uint64_t block, uint32_t *blocks,
                 uint64_t *count)
{
    if (rounds[block] == round)
        return;
    rounds[block] = round;
    blocks[(*count)++] = (uint32_t)block;
}

static void use_face(ebpo_outer_blocks *b, const ebpo_mesh *mesh, const ebpo_outer_range *own,
                     uint64_t face)
{
    for (int k = 0; k < 3; k++) {
        uint32_t vertex = mesh->faces[3 * face + (uint64_t)k];
        if (vertex < own->vertex)
            list_block(b->vertex_round, b->round, vertex / EBPO_VERTEX_BLOCK, b->vertex_block,
                 &b->vertex_blocks);
    }
}

void ebpo_outer_blocks_refer(ebpo_outer_blocks *b, const ebpo_mesh *mesh,
                             const ebpo_outer_range *own, const uint32_t *refs, uint64_t count)
{
    for (uint64_t i = 0; i < count; i++)
        if (refs[i] < own->face) {
            list_block(b->face_round, b->round, refs[i] / EBPO_FACE_BLOCK, b->face_block,
                 &b->face_blocks);
            use_face(b, mesh, own, refs[i]);
        }
}

void ebpo_outer_blocks_use(ebpo_outer_blocks *b, const ebpo_mesh *mesh, const ebpo_outer_range *own)
{
    for (uint64_t face = own->face; face < own->face_end; face++)
        use_face(b, mesh, own, face);
}

static int compare_descending(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x < y) - (x > y);
}

static uint64_t take_blocks(uint32_t *blocks, uint64_t count, uint64_t from, uint32_t *out)
{
    uint64_t taken = 0;
    if (count)
        qsort(blocks, count, sizeof *blocks, compare_descending);
    for (uint64_t i = 0; i < count; i++)
        if (blocks[i] <= from)
            out[taken++] = (uint32_t)(from - blocks[i]);
    return taken;
}

void ebpo_outer_blocks_take(ebpo_outer_blocks *b, const ebpo_outer_range *own, uint32_t *out,
                            const uint64_t *before, uint64_t *after)
{
    uint64_t faces = take_blocks(b->face_block, b->face_blocks, own->face / EBPO_FACE_BLOCK, out);
    uint64_t vertices =
        take_blocks(b->vertex_block, b->vertex_blocks, own->vertex / EBPO_VERTEX_BLOCK, out + faces);
    after[EBPO_S_OUTER_FACES] = before[EBPO_S_OUTER_FACES] + faces;
    after[EBPO_S_OUTER_VERTICES] = before[EBPO_S_OUTER_VERTICES] + vertices;
    b->face_blocks = b->vertex_blocks = 0;
    b->round++;
}
