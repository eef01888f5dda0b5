/* The arrays of the nodes that stay, copied from one level to another node by node: all that the
 * table of arrays lists, but for the types of groups. */
#ifndef EBPO_DERIVE_KEPT_NODES_H
#define EBPO_DERIVE_KEPT_NODES_H

#include "format/schema.h"

/* A row for each node. */
typedef struct ebpo_kept_column {
    const uint8_t *from;
    uint8_t *to;
    uint8_t size;
    int8_t usual; /* of nodes that are new */
} ebpo_kept_column;

/* So many items for each node: u8, or u32. */
typedef struct ebpo_kept_counts {
    ebpo_per per;
    const uint8_t *counts;
    uint8_t size;
} ebpo_kept_counts;

/* An array of such items; several may share their counts. */
typedef struct ebpo_kept_list {
    unsigned counts; /* which of the type's */
    const uint8_t *from;
    uint8_t *to;
    uint8_t size;
} ebpo_kept_list;

typedef struct ebpo_kept_nodes {
    const ebpo_level *from;
    ebpo_level *to;
    struct {
        ebpo_kept_column column[EBPO_LEVEL_ARRAYS];
        ebpo_kept_counts count[EBPO_LEVEL_ARRAYS];
        ebpo_kept_list list[EBPO_LEVEL_ARRAYS];
        unsigned columns, counts, lists;
    } of_type[4];
    uint64_t next[4];           /* of each type: the next node of `from` */
    uint64_t read[EBPO_COUNTS]; /* of each list: its next item */
} ebpo_kept_nodes;

/* Makes the arrays of `to` that are there for any of `needs`, with room for all of `from` and for
 * `more` nodes of each type (and, `more` gray ones being leaves before, for their planes). False:
 * out of memory. */
bool ebpo_kept_begin(ebpo_kept_nodes *kept, const ebpo_level *from, ebpo_level *to, uint32_t needs,
                     const uint64_t more[4]);

/* The next node of a type stays; is left out. */
void ebpo_kept_take(ebpo_kept_nodes *kept, ebpo_node_type type);
void ebpo_kept_pass(ebpo_kept_nodes *kept, ebpo_node_type type);
/* A node that is not one of `from`: usual values, empty lists. */
void ebpo_kept_add(ebpo_kept_nodes *kept, ebpo_node_type type);

#endif
