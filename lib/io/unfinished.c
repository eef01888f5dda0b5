#include "io/unfinished.h"

#include <errno.h>
#include <limits.h>
#include <stdatomic.h>
#include <string.h>
#include <unistd.h>

/* Fixed storage and lock-free states, because a signal handler reads them. */
enum { SLOT_FREE, SLOT_TAKEN, SLOT_LIVE };
static struct slot {
    atomic_int state;
    char path[PATH_MAX];
} slots[EBPO_UNFINISHED_MOST];

int ebpo_unfinished_reserve(void)
{
    for (int i = 0; i < EBPO_UNFINISHED_MOST; i++) {
        int expected = SLOT_FREE;
        if (atomic_compare_exchange_strong(&slots[i].state, &expected, SLOT_TAKEN))
            return i;
    }
    return -1;
}

void ebpo_unfinished_set(int slot, const char *path)
{
    strcpy(slots[slot].path, path);
    atomic_store(&slots[slot].state, SLOT_LIVE);
}

void ebpo_unfinished_unset(int slot) { atomic_store(&slots[slot].state, SLOT_TAKEN); }

void ebpo_unfinished_forget(int slot)
{
    if (slot >= 0)
        atomic_store(&slots[slot].state, SLOT_FREE);
}

void ebpo_unfinished_remove(void)
{
    int saved = errno;
    for (int i = 0; i < EBPO_UNFINISHED_MOST; i++)
        if (atomic_load(&slots[i].state) == SLOT_LIVE)
            unlink(slots[i].path);
    errno = saved;
}
