/* Faces put together: of each the first one that it is joined with. Arrays are the caller's. */
#ifndef EBPO_COLLIDE_JOINED_FACES_H
#define EBPO_COLLIDE_JOINED_FACES_H

#include <stdint.h>

/* Of the faces joined so far; paths get shorter. At first first[face] = face. */
static inline uint32_t ebpo_joined_first(uint32_t *first, uint32_t face)
{
    while (first[face] != face) {
        first[face] = first[first[face]];
        face = first[face];
    }
    return face;
}

static inline void ebpo_join_faces(uint32_t *first, uint32_t a, uint32_t b)
{
    a = ebpo_joined_first(first, a);
    b = ebpo_joined_first(first, b);
    first[a > b ? a : b] = a > b ? b : a;
}

#endif
