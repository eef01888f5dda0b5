/* A ring with one writer and one reader. `written` and `taken` count steps; each has one writer,
 * and is published by a release store after the step itself was written or read. */
#include "cli/commands/haptic_live.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "cli/command.h"
#include "cli/tool_clock.h"

/* CAPACITY: steps of the ring, 13 seconds at 5 kHz. BATCH: steps of one call of `take`. */
enum { CAPACITY = 1 << 16, BATCH = 256, PERIOD_NS = 4000000 };

struct haptic_live {
    haptic_live_fn take;
    void *user;
    pthread_t thread;
    atomic_bool ended; /* the loop has ended */
    uint64_t lost;
    _Alignas(64) atomic_uint_fast64_t written;
    _Alignas(64) atomic_uint_fast64_t taken;
    haptic_sample ring[CAPACITY];
};

/* Passes all steps that are in the ring. */
static void take_all(haptic_live *live)
{
    haptic_sample batch[BATCH];
    uint64_t at = atomic_load_explicit(&live->taken, memory_order_relaxed), count;
    uint64_t end = atomic_load_explicit(&live->written, memory_order_acquire);
    for (; at < end; at += count) {
        for (count = 0; count < BATCH && at + count < end; count++)
            batch[count] = live->ring[(at + count) % CAPACITY];
        atomic_store_explicit(&live->taken, at + count, memory_order_release);
        live->take(live->user, batch, count);
    }
}

static void *take_often(void *user)
{
    haptic_live *live = user;
    while (!atomic_load_explicit(&live->ended, memory_order_acquire)) {
        take_all(live);
        tool_wait_until(tool_clock() + PERIOD_NS);
    }
    take_all(live);
    return NULL;
}

haptic_live *haptic_live_begin(haptic_live_fn take, void *user)
{
    haptic_live *live = aligned_alloc(64, sizeof *live);
    if (!live)
        return NULL;
    memset(live, 0, sizeof *live); /* now, so that no step has a page fault for it */
    live->take = take;
    live->user = user;
    if (command_thread(&live->thread, take_often, live) == 0)
        return live;
    free(live);
    return NULL;
}

void haptic_live_push(haptic_live *live, const haptic_sample *sample)
{
    uint64_t at = atomic_load_explicit(&live->written, memory_order_relaxed);
    if (at - atomic_load_explicit(&live->taken, memory_order_acquire) == CAPACITY) {
        live->lost++;
        return;
    }
    live->ring[at % CAPACITY] = *sample;
    atomic_store_explicit(&live->written, at + 1, memory_order_release);
}

uint64_t haptic_live_end(haptic_live *live)
{
    if (!live)
        return 0;
    atomic_store_explicit(&live->ended, true, memory_order_release);
    pthread_join(live->thread, NULL);
    uint64_t lost = live->lost;
    free(live);
    return lost;
}
