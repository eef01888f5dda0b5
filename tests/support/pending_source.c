#include "pending_source.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A larger number of round trips is a livelock. */
enum { ROUNDS_MAX = 5000 };

static void must(bool good, const char *what, const ebpo_error *error)
{
    if (good)
        return;
    fprintf(stderr, "%s: %s\n", what, error->message);
    abort();
}

void pending_begin(pending_source *p, const char *path, uint64_t memory)
{
    ebpo_error error = EBPO_ERROR_INIT;
    FILE *f = fopen(path, "rb");
    must(f && fseek(f, 0, SEEK_END) == 0, path, &error);
    *p = (pending_source){ .size = (uint64_t)ftell(f) };
    rewind(f);
    p->data = malloc(p->size);
    must(p->data && fread(p->data, 1, p->size, f) == p->size, path, &error);
    fclose(f);
    must(ebpo_async_new(p->size, "pending", "1", memory, &p->async, &error) == EBPO_OK,
         "ebpo_async_new", &error);
    p->operation = ebpo_async_begin(p->async);
    p->last_call = ebpo_async_begin(p->async);
}

void pending_end(pending_source *p)
{
    ebpo_async_free(p->async);
    free(p->data);
}

static ebpo_status open_once(pending_source *p, uint64_t head, ebpo_file **file, ebpo_error *error)
{
    ebpo_source source = EBPO_SOURCE_INIT;
    ebpo_status status = ebpo_async_source(p->async, &source, error);
    if (head && head < source.prefetched)
        source.prefetched = head;
    return status == EBPO_OK ? ebpo_open_source(&source, "pending", file, error) : status;
}

ebpo_file *pending_open(pending_source *p, uint64_t head)
{
    ebpo_file *file = NULL;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_status status;
    do
        status = open_once(p, head, &file, &error);
    while (pending_again(p, status));
    must(status == EBPO_OK, "ebpo_open_source", &error);
    return file;
}

/* Ends the operation. The bytes that the last call used stay until the next call ends too. */
static void restart(pending_source *p)
{
    ebpo_async_end(p->async, p->operation);
    p->operation = p->last_call;
    p->last_call = ebpo_async_begin(p->async);
}

static bool supply_needed(pending_source *p, ebpo_status status, bool progress)
{
    ebpo_error error = EBPO_ERROR_INIT;
    const ebpo_range *range;
    size_t count;
    uint64_t end = 0;
    if (status != EBPO_E_PENDING) {
        restart(p);
        restart(p);
        return false;
    }
    must(ebpo_async_needed(p->async, &range, &count, &error) == EBPO_OK, "needed", &error);
    must(count > 0 && p->rounds++ < ROUNDS_MAX, "a pending call needs no bytes", &error);
    p->requests += count;
    if (progress) {
        restart(p);
    } else {
        ebpo_async_end(p->async, p->last_call);
        p->last_call = ebpo_async_begin(p->async);
    }
    for (size_t i = 0; i < count; i++) {
        must(range[i].size && range[i].offset >= end, "the ranges are not in order", &error);
        end = range[i].offset + range[i].size;
        must(end <= p->size, "a range is beyond the end", &error);
        p->fetched += range[i].size;
        must(ebpo_async_supply(p->async, range[i].offset, range[i].size, p->data + range[i].offset,
                               "1", &error) == EBPO_OK,
             "supply", &error);
    }
    if (ebpo_async_bytes(p->async) > p->peak)
        p->peak = ebpo_async_bytes(p->async);
    return true;
}

bool pending_again(pending_source *p, ebpo_status status)
{
    return supply_needed(p, status, false);
}

bool pending_progress(pending_source *p, ebpo_status status)
{
    return supply_needed(p, status, true);
}
