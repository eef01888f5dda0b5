/* Memory that making something may take, counted while it is made. */
#ifndef EBPO_CORE_ROOM_H
#define EBPO_CORE_ROOM_H

#include <inttypes.h>

#include "core/error.h"

/* One thread. `needed` is set by what is refused: so much might do, always more than `most`. */
typedef struct ebpo_room {
    uint64_t most, taken, needed;
} ebpo_room;

/* EBPO_E_LIMIT if there is no room for so much beside what is taken. NULL: no limit. */
EBPO_MUST_USE static inline ebpo_status ebpo_room_check(ebpo_room *room, uint64_t bytes,
                                                        ebpo_error *error)
{
    if (!room || (room->taken <= room->most && bytes <= room->most - room->taken))
        return EBPO_OK;
    uint64_t all = bytes > UINT64_MAX - room->taken ? UINT64_MAX : room->taken + bytes,
             grown = room->most + room->most / 4 + 1;
    room->needed = all > grown ? all : grown;
    return ebpo_fail(error, EBPO_E_LIMIT,
                     "the memory budget leaves %" PRIu64
                     " bytes for this, which takes up to %" PRIu64,
                     room->most, all);
}

/* The same, and takes it. */
EBPO_MUST_USE static inline ebpo_status ebpo_room_take(ebpo_room *room, uint64_t bytes,
                                                       ebpo_error *error)
{
    ebpo_status status = ebpo_room_check(room, bytes, error);
    if (room && status == EBPO_OK)
        room->taken += bytes;
    return status;
}

static inline void ebpo_room_give(ebpo_room *room, uint64_t bytes)
{
    if (room)
        room->taken -= bytes;
}

#endif
