#include "extras/paint/met_faces.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/hash.h"

static uint64_t find(const ebpo_met_faces *met, uint64_t file_face)
{
    uint64_t at;
    EBPO_HASH_FIND(at, ebpo_hash_number(file_face), met->slots - 1,
                   met->slot[at] == 0 || met->face[met->slot[at] - 1].file_face == file_face);
    return at;
}

/* Twice as many slots, all faces in them. */
static bool grow_slots(ebpo_met_faces *met)
{
    uint64_t slots = ebpo_hash_slots(4 * (met->count + 1));
    uint32_t *slot = ebpo_alloc_zero(slots, sizeof *slot);
    if (!slot)
        return false;
    free(met->slot);
    met->slot = slot;
    met->slots = slots;
    for (uint64_t i = 0; i < met->count; i++)
        slot[find(met, met->face[i].file_face)] = (uint32_t)i + 1;
    return true;
}

ebpo_status ebpo_met_faces_add(ebpo_met_faces *met, const ebpo_reach_face *face, uint32_t *number,
                               ebpo_error *error)
{
    if (2 * (met->count + 1) > met->slots && !grow_slots(met))
        return ebpo_fail_memory(error, 4 * met->count * sizeof *met->slot);
    uint64_t at = find(met, face->file_face);
    if (met->slot[at] == 0) {
        if (met->count == UINT32_MAX - 1)
            return ebpo_fail(error, EBPO_E_LIMIT, "strokes reach more than 2^32 - 2 faces");
        if (!ebpo_grow(&met->face, &met->capacity, met->count + 1, sizeof *met->face))
            return ebpo_fail_memory(error, met->count * sizeof *met->face);
        ebpo_met_face *f = &met->face[met->count++];
        *f = (ebpo_met_face){ .face = face->face, .file_face = face->file_face };
        memcpy(f->corner, face->corner, sizeof f->corner);
        met->slot[at] = (uint32_t)met->count;
    }
    *number = met->slot[at] - 1;
    return EBPO_OK;
}

void ebpo_met_faces_free(ebpo_met_faces *met)
{
    free(met->face);
    free(met->slot);
    *met = (ebpo_met_faces){ 0 };
}
