#include "core/text.h"

#include <string.h>

bool ebpo_text_ok(const char *text)
{
    const uint8_t *p = (const uint8_t *)text;
    while (*p) {
        unsigned more = *p < 0x80                 ? 0
                        : *p >= 0xc2 && *p < 0xe0 ? 1
                        : *p >= 0xe0 && *p < 0xf0 ? 2
                        : *p >= 0xf0 && *p < 0xf5 ? 3
                                                  : 9;
        if (more == 9 || *p < 0x20 || *p == 0x7f)
            return false;
        if ((*p == 0xe0 && p[1] < 0xa0) || (*p == 0xed && p[1] >= 0xa0) ||
            (*p == 0xf0 && p[1] < 0x90) || (*p == 0xf4 && p[1] >= 0x90) ||
            (*p == 0xc2 && p[1] < 0xa0))
            return false; /* overlong, surrogate, beyond Unicode, control */
        for (p++; more; more--, p++)
            if (*p < 0x80 || *p > 0xbf)
                return false;
    }
    return true;
}

uint64_t ebpo_text_mark(const void *text, uint64_t size)
{
    return size >= 3 && memcmp(text, "\xef\xbb\xbf", 3) == 0 ? 3 : 0;
}
