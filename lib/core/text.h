/* Text as files hold it. */
#ifndef EBPO_CORE_TEXT_H
#define EBPO_CORE_TEXT_H

#include <stdbool.h>
#include <stdint.h>

/* True for UTF-8 without control characters. */
bool ebpo_text_ok(const char *text);

/* Returns the length of the mark of the order of bytes (UTF-8) that text begins with, or 0. */
uint64_t ebpo_text_mark(const void *text, uint64_t size);

#endif
