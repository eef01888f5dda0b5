/* Which vertices blocks have. A mesh has half as many vertices as faces, and a run of blocks meets
 * most of them again and again: what is measured of a run is measured at each vertex once. */
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"
#include "accel/accel_parts.h"

/* Of a vertex: its place in the order, and the last block that has it. */
typedef struct mark {
    uint32_t place, block;
} mark;
static const uint32_t NONE = UINT32_MAX;

static void mark_face(ebpo_block_points *p, mark *marks, uint32_t block, const uint32_t corner[3],
                      uint64_t *older)
{
    uint32_t *count = &p->first[block + 1];
    for (int i = 0; i < 3; i++) {
        mark *m = &marks[corner[i]];
        if (m->block == block)
            continue;
        if (m->place == NONE) {
            m->place = *count;
            p->order[(*count)++] = corner[i];
        } else {
            p->older[(*older)++] = m->place;
        }
        m->block = block;
    }
}

static bool mark_blocks(ebpo_block_points *p, mark *marks, const ebpo_mesh *mesh,
                        const ebpo_layout *layout)
{
    uint64_t older = 0;
    p->first[0] = 0;
    p->first_older[0] = 0;
    for (uint64_t b = 0; b < layout->block_count; b++) {
        if (!ebpo_grow(&p->older, &p->older_capacity, older + 3 * EBPO_BLOCK, sizeof *p->older))
            return false;
        p->first[b + 1] = p->first[b];
        for (uint64_t face = layout->block_begin[b]; face < layout->block_end[b]; face++)
            mark_face(p, marks, (uint32_t)b, mesh->faces + 3 * face, &older);
        p->first_older[b + 1] = older;
    }
    return true;
}

ebpo_status ebpo_block_points_make(ebpo_block_points *out, const ebpo_mesh *mesh,
                                   const ebpo_layout *layout, ebpo_error *error)
{
    *out = (ebpo_block_points){ .mesh = mesh };
    mark *marks = ebpo_alloc(mesh->vertex_count, sizeof *marks);
    out->order = ebpo_alloc(mesh->vertex_count, sizeof *out->order);
    out->first = ebpo_alloc(layout->block_count + 1, sizeof *out->first);
    out->first_older = ebpo_alloc(layout->block_count + 1, sizeof *out->first_older);
    bool made = marks && out->order && out->first && out->first_older;
    if (made) {
        memset(marks, 0xff, mesh->vertex_count * sizeof *marks);
        made = mark_blocks(out, marks, mesh, layout);
    }
    free(marks);
    if (made)
        return EBPO_OK;
    ebpo_block_points_free(out);
    return ebpo_fail_memory(error, mesh->vertex_count * sizeof *marks);
}

void ebpo_block_points_free(ebpo_block_points *points)
{
    free(points->order);
    free(points->first);
    free(points->older);
    free(points->first_older);
    memset(points, 0, sizeof *points);
}
