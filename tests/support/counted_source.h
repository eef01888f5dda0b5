/* A file behind a source that counts each byte once that is read or announced, and can fail. */
#ifndef EBPO_TESTS_COUNTED_SOURCE_H
#define EBPO_TESTS_COUNTED_SOURCE_H

#include <ebpo/file.h>

typedef struct counted_source {
    uint8_t *data, *touched;
    uint64_t size, asked; /* bytes of the file; of them touched */
    uint64_t batches;     /* announcements */
    uint64_t alone;       /* reads of what had not been touched before */
    uint64_t failed;      /* reads while it failed */
    bool failing;
} counted_source;

/* `far`: it wants to know what will be read. For one thread. Aborts when it cannot be opened. */
ebpo_file *counted_open(counted_source *c, const char *path, bool far);
void counted_close(counted_source *c, ebpo_file *file);

#endif
