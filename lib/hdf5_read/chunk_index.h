/* Inside lib/hdf5_read only: how an array is stored, and the table of its chunks. */
#ifndef EBPO_HDF5_READ_CHUNK_INDEX_H
#define EBPO_HDF5_READ_CHUNK_INDEX_H

#include "hdf5_read/head_state.h"

typedef enum ebpo_head_index {
    EBPO_INDEX_SINGLE = 1, /* one chunk */
    EBPO_INDEX_IMPLICIT,   /* one behind the other, set aside at once, without filters */
    EBPO_INDEX_FIXED       /* a table of as many as there are */
} ebpo_head_index;

typedef struct ebpo_head_layout {
    unsigned rank;     /* of the chunks */
    uint64_t chunk[3]; /* their size; the last is the element's */
    ebpo_head_index index;
    unsigned page_bits; /* FIXED: two to this many chunks are a page */
    bool single_filtered;
    uint64_t single_bytes; /* SINGLE with filters */
    uint32_t single_mask;
    uint64_t
        address; /* of the chunk, the chunks, the table; EBPO_NO_ADDRESS: nothing was written */
} ebpo_head_layout;

/* What is wrong, or NULL. `*foreign`: not wrong, but of a kind that only libhdf5 reads. */
const char *ebpo_head_read_layout(ebpo_head_cursor c, ebpo_head_layout *layout, bool *foreign);

/* What to look for. */
typedef struct ebpo_head_chunks {
    const ebpo_head_layout *layout;
    bool filtered;
    uint64_t count, whole, bound; /* chunks; bytes of one before its filters, and at most after */
    ebpo_chunk_place *place;      /* out: count of them */
    uint64_t stored;              /* out: bytes in all */
    uint64_t at;                  /* out: the chunk that is wrong; UINT64_MAX: none in particular */
} ebpo_head_chunks;

/* In one pass. What is wrong, or NULL. */
const char *ebpo_head_read_chunks(ebpo_head_state *s, ebpo_head_chunks *chunks);

#endif
