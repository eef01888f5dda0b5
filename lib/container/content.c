#include "container/content.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"

/* Of chunks of faces as they are without subtrees. */
enum { PLAIN_FACE_ROWS = 4096, SKIPPED = PLAIN_FACE_ROWS / EBPO_FACE_BLOCK };

bool ebpo_content_has(const ebpo_info *info, ebpo_array_id id)
{
    if (id == EBPO_A_FACES_INDEX && info->subtree_level)
        return info->face_count > PLAIN_FACE_ROWS;
    return !(ebpo_schema[id].needs & EBPO_NEEDS_SUBTREES);
}

void ebpo_content_rows(const ebpo_info *info, ebpo_array_id id, uint64_t row, uint64_t rows,
                       size_t row_bytes, const uint8_t *bytes, ebpo_sha256 *state)
{
    if (id != EBPO_A_FACES_INDEX || !info->subtree_level) {
        ebpo_sha256_add(state, bytes, rows * row_bytes);
        return;
    }
    for (uint64_t i = 0; i < rows; i++)
        if ((row + i) % SKIPPED == 0)
            ebpo_sha256_add(state, bytes + i * row_bytes, row_bytes);
}

void ebpo_content_put(ebpo_content *content, const char *path, const uint8_t digest[32])
{
    if (!ebpo_grow(&content->entries, &content->capacity, content->count + 1,
                   sizeof *content->entries)) {
        content->short_of_memory = true;
        return;
    }
    ebpo_content_entry *entry = &content->entries[content->count++];
    snprintf(entry->path, sizeof entry->path, "%s", path);
    memcpy(entry->digest, digest, 32);
}

static int by_path(const void *a, const void *b)
{
    return strcmp(((const ebpo_content_entry *)a)->path, ((const ebpo_content_entry *)b)->path);
}

ebpo_status ebpo_content_end(ebpo_content *content, uint8_t digest[32], ebpo_error *error)
{
    if (content->short_of_memory)
        return ebpo_fail_memory(error, (content->count + 1) * sizeof *content->entries);
    ebpo_sha256 state;
    ebpo_sha256_begin(&state);
    if (content->count)
        qsort(content->entries, content->count, sizeof *content->entries, by_path);
    for (uint64_t i = 0; i < content->count; i++) {
        ebpo_sha256_add(&state, content->entries[i].path, strlen(content->entries[i].path) + 1);
        ebpo_sha256_add(&state, content->entries[i].digest, 32);
    }
    ebpo_sha256_end(&state, digest);
    return EBPO_OK;
}

void ebpo_content_free(ebpo_content *content)
{
    free(content->entries);
    memset(content, 0, sizeof *content);
}
