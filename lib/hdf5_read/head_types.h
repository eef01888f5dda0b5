/* Inside lib/hdf5_read only: types, dimensions and filters as messages describe them. */
#ifndef EBPO_HDF5_READ_HEAD_TYPES_H
#define EBPO_HDF5_READ_HEAD_TYPES_H

#include "hdf5_read/head_cursor.h"

typedef enum ebpo_head_class {
    EBPO_CLASS_INTEGER,       /* little-endian, all bits of it */
    EBPO_CLASS_DOUBLE,        /* IEEE 754, little-endian, 64 bits */
    EBPO_CLASS_TEXT,          /* of fixed length, however it is padded */
    EBPO_CLASS_OTHER_INTEGER, /* big-endian, say */
    EBPO_CLASS_OTHER
} ebpo_head_class;

typedef struct ebpo_head_type {
    ebpo_head_class class;
    uint32_t size;
    bool is_signed;
} ebpo_head_type;

ebpo_head_type ebpo_head_read_type(ebpo_head_cursor c);

/* Dimensions. `values`: the product; 0 where there are none, or more than 64 bits count. */
typedef struct ebpo_head_space {
    unsigned rank; /* UINT32_MAX: nothing that can be read */
    bool fixed;    /* they cannot grow */
    uint64_t size[2], values;
} ebpo_head_space;

ebpo_head_space ebpo_head_read_space(ebpo_head_cursor c);

/* Filters in the order in which they are applied. */
enum { EBPO_HEAD_FILTERS = 3 };
typedef struct ebpo_head_filters {
    unsigned count; /* more than EBPO_HEAD_FILTERS: nothing of this format */
    struct {
        unsigned id, values, first; /* how many values, and the first one */
    } filter[EBPO_HEAD_FILTERS];
} ebpo_head_filters;

ebpo_head_filters ebpo_head_read_filters(ebpo_head_cursor c);

#endif
