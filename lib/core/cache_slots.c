#include "core/cache_slots.h"

#include <stdlib.h>

#include "core/alloc.h"
#include "core/hash.h"

bool ebpo_cache_slots_make(ebpo_cache_slots *t)
{
    enum { BUCKETS = 64 };
    *t = (ebpo_cache_slots){ .bucket = ebpo_alloc_zero(BUCKETS, sizeof *t->bucket) };
    t->bucket_count = BUCKETS;
    return t->bucket != NULL;
}

static ebpo_cache_slot **bucket_of(ebpo_cache_slot **bucket, uint64_t bucket_count,
                                   const struct ebpo_cache *owner, uint64_t key)
{
    uint64_t hash = ebpo_hash_number(ebpo_hash_number((uintptr_t)owner) + key);
    return &bucket[hash & (bucket_count - 1)];
}

ebpo_cache_slot *ebpo_cache_slots_find(const ebpo_cache_slots *t, const struct ebpo_cache *owner,
                                       uint64_t key)
{
    ebpo_cache_slot *s = *bucket_of(t->bucket, t->bucket_count, owner, key);
    while (s && (s->key != key || s->owner != owner))
        s = s->chain;
    return s;
}

/* Without memory the chains stay long, and that is all. */
static void grow(ebpo_cache_slots *t)
{
    uint64_t count = 2 * t->bucket_count;
    ebpo_cache_slot **bucket = ebpo_alloc_zero(count, sizeof *bucket);
    if (!bucket)
        return;
    for (uint64_t i = 0; i < t->bucket_count; i++)
        for (ebpo_cache_slot *s = t->bucket[i], *next; s; s = next) {
            next = s->chain;
            ebpo_cache_slot **to = bucket_of(bucket, count, s->owner, s->key);
            s->chain = *to;
            *to = s;
        }
    free(t->bucket);
    t->bucket = bucket;
    t->bucket_count = count;
}

ebpo_cache_slot *ebpo_cache_slots_add(ebpo_cache_slots *t, struct ebpo_cache *owner, uint64_t key)
{
    ebpo_cache_slot *s = ebpo_alloc_zero(1, sizeof *s);
    if (!s)
        return NULL;
    if (t->count++ == t->bucket_count)
        grow(t);
    s->owner = owner;
    s->key = key;
    ebpo_cache_slot **to = bucket_of(t->bucket, t->bucket_count, owner, key);
    s->chain = *to;
    *to = s;
    return s;
}

void ebpo_cache_slots_take(ebpo_cache_slots *t, ebpo_cache_slot *s)
{
    ebpo_cache_slot **at = bucket_of(t->bucket, t->bucket_count, s->owner, s->key);
    while (*at != s)
        at = &(*at)->chain;
    *at = s->chain;
    t->count--;
}

void ebpo_cache_slots_link(ebpo_cache_slots *t, ebpo_cache_slot *s)
{
    s->older = t->newest;
    s->newer = NULL;
    *(t->newest ? &t->newest->newer : &t->oldest) = s;
    t->newest = s;
}

void ebpo_cache_slots_unlink(ebpo_cache_slots *t, ebpo_cache_slot *s)
{
    *(s->older ? &s->older->newer : &t->oldest) = s->newer;
    *(s->newer ? &s->newer->older : &t->newest) = s->older;
}
