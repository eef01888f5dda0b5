/* A file whose source counts each byte that is read or prefetched once, and can fail. */
#ifndef EBPO_TESTS_COUNTED_SOURCE_H
#define EBPO_TESTS_COUNTED_SOURCE_H

#include <ebpo/file.h>

typedef struct counted_source {
    uint8_t *data, *touched;
    uint64_t size, requested; /* bytes of the file; bytes requested */
    uint64_t batches;         /* prefetch hints */
    uint64_t alone;           /* reads of bytes that were not requested before */
    uint64_t failed;          /* reads during the failure */
    bool failing;
} counted_source;

/* Opens a file; `far`: the source takes prefetch hints. For one thread. Aborts if the file cannot
 * be opened. */
ebpo_file *counted_open(counted_source *c, const char *path, bool far);
void counted_close(counted_source *c, ebpo_file *file);

#endif
