/* Opens a file with a source that counts the requested bytes, each byte once, and that can fail. */
#ifndef EBPO_TESTS_COUNTED_SOURCE_H
#define EBPO_TESTS_COUNTED_SOURCE_H

#include <ebpo/file.h>

typedef struct counted_source {
    uint8_t *data, *touched;
    uint64_t size, requested; /* number of bytes of the file, and of requested bytes */
    uint64_t batches;         /* number of prefetch hints with bytes not requested before */
    uint64_t alone;           /* number of reads of bytes that were not requested before */
    uint64_t failed;          /* number of reads that failed */
    bool failing;             /* all reads fail */
} counted_source;

/* Opens a file, for use by one thread. Aborts if the file cannot be opened. far: the source accepts
 * prefetch hints. */
ebpo_file *counted_open(counted_source *c, const char *path, bool far);
void counted_close(counted_source *c, ebpo_file *file);

#endif
