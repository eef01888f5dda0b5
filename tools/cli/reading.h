/* Makes the options for reading parts of a file, from the value of --threads. */
#ifndef EBPO_TOOLS_READING_H
#define EBPO_TOOLS_READING_H

#include <ebpo/file.h>

static inline ebpo_read_options reading_options(int64_t threads, ebpo_workspace *workspace)
{
    ebpo_read_options options = EBPO_READ_OPTIONS_INIT;
    options.threads = (unsigned)threads;
    options.workspace = workspace;
    return options;
}

#endif
