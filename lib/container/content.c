#include "container/content.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"

void ebpo_content_add(ebpo_content *content, const void *data, size_t bytes)
{
    if (!content->open)
        ebpo_sha256_begin(&content->state);
    content->open = true;
    ebpo_sha256_add(&content->state, data, bytes);
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

void ebpo_content_end_array(ebpo_content *content, const char *path)
{
    uint8_t digest[32];
    ebpo_sha256_end(&content->state, digest);
    content->open = false;
    ebpo_content_put(content, path, digest);
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
