#include "mesh/textures.h"

#include <stdio.h>
#include <string.h>

#include "core/workspace.h"
#include "core/error.h"
#include "core/checksum.h"

enum { DIGEST = 32, STEP = 1 << 20 };

const char *ebpo_texture_array_name(ebpo_texture_array which)
{
    static const char *const names[EBPO_TEXTURE_ARRAYS] = { "name", "use", "sha256", "bytes" };
    return names[which];
}

static ebpo_attribute *find(const ebpo_attributes *all, ebpo_texture_array which)
{
    for (uint64_t i = 0; all && i < all->count; i++) {
        ebpo_attribute *a = &all->array[i];
        if (ebpo_attribute_is_of_textures(a) && a->type == EBPO_ATTRIBUTE_UINT8 &&
            a->list != EBPO_ATTRIBUTE_NO_LIST &&
            strcmp(a->names, ebpo_texture_array_name(which)) == 0)
            return a;
    }
    return NULL;
}

const ebpo_attribute *ebpo_textures_array(const ebpo_attributes *all, ebpo_texture_array which)
{
    return find(all, which);
}

ebpo_texture_bytes ebpo_texture_list(const ebpo_attribute *a, uint64_t row)
{
    if (!a || row >= a->rows)
        return (ebpo_texture_bytes){ NULL, 0 };
    uint64_t from = row * a->columns, to = from + a->columns;
    if (a->ends) {
        from = row ? a->ends[row - 1] : 0;
        to = a->ends[row];
    }
    return (ebpo_texture_bytes){ a->values ? a->values + from : NULL, to - from };
}

static ebpo_attribute *make(ebpo_attributes *to, ebpo_texture_array which)
{
    ebpo_attribute head = { .element = EBPO_TEXTURE_ELEMENT,
                            .type = EBPO_ATTRIBUTE_UINT8,
                            .list = EBPO_ATTRIBUTE_UINT32,
                            .columns = 1 };
    snprintf(head.names, sizeof head.names, "%s", ebpo_texture_array_name(which));
    return ebpo_attributes_add(to, &head);
}

static bool add_row(ebpo_workspace *workspace, ebpo_attribute *a, ebpo_texture_bytes list)
{
    uint64_t from = a->rows ? a->ends[a->rows - 1] : 0, end = from + list.count;
    if (!ebpo_attribute_reserve(workspace, a, a->rows + 1, end))
        return false;
    if (list.count)
        ebpo_array_copy(workspace, a->values + from, list.at, list.count);
    a->ends[a->rows++] = end;
    return true;
}

ebpo_status ebpo_textures_add(ebpo_attributes *to, bool keep,
                              const ebpo_texture_bytes list[EBPO_TEXTURE_ARRAYS], ebpo_error *error)
{
    for (int which = 0; which < (keep ? EBPO_TEXTURE_ARRAYS : EBPO_TEXTURE_BYTES); which++) {
        ebpo_attribute *a = find(to, (ebpo_texture_array)which);
        if (!a && !(a = make(to, (ebpo_texture_array)which)))
            return ebpo_fail_memory(error, sizeof *a);
        if (!add_row(to->workspace, a, list[which]))
            return ebpo_workspace_fail(to->workspace, list[which].count, error);
    }
    return EBPO_OK;
}

static bool is_digest(ebpo_texture_bytes bytes, ebpo_texture_bytes sha256,
                      ebpo_workspace *workspace)
{
    uint8_t digest[DIGEST];
    ebpo_sha256 state;
    ebpo_sha256_begin(&state);
    EBPO_FOR_PIECES(workspace, at, bytes.count, STEP)
        ebpo_sha256_add(&state, (const uint8_t *)bytes.at + at,
                        bytes.count - at < STEP ? (size_t)(bytes.count - at) : STEP);
    ebpo_sha256_end(&state, digest);
    return sha256.count == DIGEST && !ebpo_digest_differs(sha256.at, digest);
}

bool ebpo_textures_good(const ebpo_attributes *all)
{
    const ebpo_attribute *bytes = find(all, EBPO_TEXTURE_BYTES),
                         *sha256 = find(all, EBPO_TEXTURE_SHA256);
    for (uint64_t i = 0; bytes && i < bytes->rows; i++) {
        ebpo_texture_bytes list = ebpo_texture_list(bytes, i);
        if (list.count && !is_digest(list, ebpo_texture_list(sha256, i), all->workspace))
            return false;
    }
    return true;
}
