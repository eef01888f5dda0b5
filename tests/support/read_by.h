/* Options for reading with a number of threads. */
#ifndef EBPO_TESTS_READ_BY_H
#define EBPO_TESTS_READ_BY_H

#include <ebpo/file.h>

#define READ_BY(threads) (&(ebpo_read_options){ sizeof(ebpo_read_options), (threads), NULL, 0, 0 })

#endif
