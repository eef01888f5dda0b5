#include "counted_source.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool mark_requested(counted_source *c, uint64_t offset, uint64_t size)
{
    uint64_t before = c->requested;
    for (uint64_t i = offset; i < offset + size; i++) {
        c->requested += !c->touched[i];
        c->touched[i] = 1;
    }
    return c->requested > before;
}

static ebpo_status read_counted(void *user, uint64_t offset, uint64_t size, void *data,
                                ebpo_error *error)
{
    counted_source *c = user;
    if (c->failing) {
        c->failed++;
        error->status = EBPO_E_IO;
        strcpy(error->message, "the line is down");
        return EBPO_E_IO;
    }
    c->alone += mark_requested(c, offset, size);
    memcpy(data, c->data + offset, size);
    return EBPO_OK;
}

static void expect_counted(void *user, const ebpo_range *ranges, size_t count)
{
    counted_source *c = user;
    bool any = false;
    for (size_t i = 0; i < count; i++)
        any |= mark_requested(c, ranges[i].offset, ranges[i].size);
    c->batches += any;
}

ebpo_file *counted_open(counted_source *c, const char *path, bool far)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    FILE *f = fopen(path, "rb");
    if (!f || fseek(f, 0, SEEK_END) != 0)
        abort();
    *c = (counted_source){ .size = (uint64_t)ftell(f) };
    rewind(f);
    c->data = malloc(c->size);
    c->touched = calloc(c->size, 1);
    if (!c->data || !c->touched || fread(c->data, 1, c->size, f) != c->size)
        abort();
    fclose(f);
    ebpo_source source = {
        .struct_size = sizeof(ebpo_source), .user = c, .size = c->size, .read = read_counted
    };
    if (far) {
        source.prefetch = expect_counted;
        source.prefetched = c->size < 4096 ? c->size : 4096;
    }
    if (ebpo_open_source(&source, "counted", &file, &error) != EBPO_OK) {
        fprintf(stderr, "%s\n", error.message);
        abort();
    }
    return file;
}

void counted_close(counted_source *c, ebpo_file *file)
{
    ebpo_close(file);
    free(c->data);
    free(c->touched);
}
