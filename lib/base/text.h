/* Text as files hold it. */
#ifndef EBPO_BASE_TEXT_H
#define EBPO_BASE_TEXT_H

#include <stdbool.h>

/* True for UTF-8 without control characters. */
bool ebpo_text_ok(const char *text);

#endif
