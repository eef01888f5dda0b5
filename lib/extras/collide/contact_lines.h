/* Numbers of corners: equal coordinates, equal numbers (0 and -0 are equal). */
#ifndef EBPO_COLLIDE_CONTACT_LINES_H
#define EBPO_COLLIDE_CONTACT_LINES_H

#include <stdbool.h>
#include <stdint.h>

/* Zero at first. */
typedef struct ebpo_corner_ids {
    double (*at)[3]; /* [count] */
    uint64_t count, capacity;
    uint32_t *table; /* open addressing: number and 1, 0: free */
    uint64_t table_size;
} ebpo_corner_ids;

/* False: no memory, or 2^32 - 2 corners. */
bool ebpo_corner_id(ebpo_corner_ids *ids, const double x[3], uint32_t *id);
void ebpo_corner_ids_free(ebpo_corner_ids *ids);

#endif
