/* Blocks of files on servers, kept in a folder from one session to the next. Each block is a file
 * of its own, named by the digest of address and version and the block's number, and carries a
 * checksum. Written to a temporary name and renamed, so any number of processes may share the
 * folder. Nothing depends on it: what cannot be read, is damaged or cannot be written is as if it
 * were not there. Any thread. */
#ifndef EBPO_IO_DISK_H
#define EBPO_IO_DISK_H

#include <ebpo/base.h>

#include "io/answer.h"

enum {
    EBPO_DISK_BLOCK = 32768, /* usually */
    EBPO_DISK_BLOCK_LEAST = 4096,
    /* of the first request, after which whole blocks follow: opening needs some 50 KB (13 levels),
       and levels 0 to 4 come with it */
    EBPO_HTTP_HEAD = 131072
};
_Static_assert(EBPO_HTTP_HEAD % EBPO_DISK_BLOCK == 0, "blocks would begin within the head");

typedef struct ebpo_disk ebpo_disk;

/* Makes the folder, if its parent is there. EBPO_E_ARGUMENT when it cannot be written. `bytes`:
 * that the folder may hold; `block`: of a block. */
EBPO_MUST_USE ebpo_status ebpo_disk_open(ebpo_disk **out, const char *folder, uint64_t bytes,
                                         size_t block, const char *url,
                                         const ebpo_http_version *version, ebpo_error *error);
/* Bytes that the folder held when it was opened: of this version of this file, and others. */
void ebpo_disk_held(const ebpo_disk *disk, uint64_t *held, uint64_t *others);
void ebpo_disk_close(ebpo_disk *disk);

/* `size`: a block, less at the end of the file. False: not there. */
bool ebpo_disk_get(ebpo_disk *disk, uint64_t block, void *data, size_t size);
void ebpo_disk_put(ebpo_disk *disk, uint64_t block, const void *data, size_t size);

#endif
