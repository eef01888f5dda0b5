#include "format/idle_readers.h"

#include <stdlib.h>

#include "core/alloc.h"

/* At most so many wait, each with at most so much room for what is stored. */
enum { IDLE_MAX = 4, STORED_MAX = 1 << 18 };

void ebpo_idle_readers_make(ebpo_idle_readers *readers)
{
    *readers = (ebpo_idle_readers){ .first = NULL };
    pthread_mutex_init(&readers->lock, NULL);
}

static void free_reader(ebpo_idle_reader *r)
{
    ebpo_chunk_coder_clear(&r->reader.coder);
    free(r->reader.stored);
    free(r);
}

void ebpo_idle_readers_free(ebpo_idle_readers *readers)
{
    for (ebpo_idle_reader *r = readers->first, *next; r; r = next) {
        next = r->next;
        free_reader(r);
    }
    pthread_mutex_destroy(&readers->lock);
}

/* Its large members need no zeros. */
static ebpo_idle_reader *new_reader(void)
{
    ebpo_idle_reader *r = ebpo_alloc(1, sizeof *r);
    if (r) {
        r->reader.coder.zstd_in = r->reader.coder.zstd_out = NULL;
        r->reader.stored = NULL;
        r->reader.capacity = 0;
    }
    return r;
}

ebpo_idle_reader *ebpo_idle_readers_take(ebpo_idle_readers *readers)
{
    pthread_mutex_lock(&readers->lock);
    ebpo_idle_reader *r = readers->first;
    if (r) {
        readers->first = r->next;
        readers->count--;
    }
    pthread_mutex_unlock(&readers->lock);
    return r ? r : new_reader();
}

void ebpo_idle_readers_give(ebpo_idle_readers *readers, ebpo_idle_reader *r)
{
    if (!r)
        return;
    if (r->reader.capacity > STORED_MAX) {
        free(r->reader.stored);
        r->reader.stored = NULL;
        r->reader.capacity = 0;
    }
    pthread_mutex_lock(&readers->lock);
    bool keep = readers->count < IDLE_MAX;
    if (keep) {
        r->next = readers->first;
        readers->first = r;
        readers->count++;
    }
    pthread_mutex_unlock(&readers->lock);
    if (!keep)
        free_reader(r);
}
