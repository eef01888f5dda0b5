#include "cli/commands/part_names.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/json.h"

enum { OWN_IN_FILE = 40, SPELT_MOST = 220 };

static bool is_safe(char c)
{
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
           c == '_';
}

void part_file_name(char out[PART_NAME_SIZE], const char *kind, int digits, uint64_t number,
                    const char *own)
{
    size_t size = (size_t)snprintf(out, PART_NAME_SIZE, "%s-%0*llu", kind, digits,
                                   (unsigned long long)number);
    if (!own || !*own || size + OWN_IN_FILE + 2 > PART_NAME_SIZE)
        return;
    out[size++] = '-';
    for (int i = 0; own[i] && i < OWN_IN_FILE; i++)
        out[size++] = is_safe(own[i]) ? own[i] : '_';
    out[size] = 0;
}

/* Words that stand for many instances. */
static bool is_selector(const char *own)
{
    return strcmp(own, "*") == 0 || strncmp(own, "layer:", 6) == 0 ||
           strncmp(own, "group:", 6) == 0;
}

/* Bytes of the character there; 0: a scene cannot have it. */
static int plain_length(const char *s)
{
    unsigned char c = (unsigned char)*s;
    return c < 0x20 || c == 0x7f ? 0 : json_utf8_length(s);
}

bool part_name_fits(const char *own)
{
    size_t size = strnlen(own, PART_SHOWN_SIZE);
    if (size == 0 || size >= PART_SHOWN_SIZE || is_selector(own))
        return false;
    for (const char *s = own; *s;) {
        int length = plain_length(s);
        if (length == 0)
            return false;
        s += length;
    }
    return true;
}

int part_compare_names(const void *a, const void *b)
{
    return strcmp(*(const char *const *)a, *(const char *const *)b);
}

/* Each byte that cannot be there as \xNN, as far as there is room. */
static size_t spell(char *out, const char *own)
{
    size_t size = 0;
    bool first = is_selector(own);
    for (const char *s = own; *s && size + 4 <= SPELT_MOST; first = false) {
        int length = first ? 0 : plain_length(s);
        if (length)
            memcpy(out + size, s, (size_t)length);
        else
            snprintf(out + size, 5, "\\x%02x", (unsigned char)*s);
        size += length ? (size_t)length : 4;
        s += length ? length : 1;
    }
    return size;
}

void part_shown_name(char out[PART_SHOWN_SIZE], const char *own, uint64_t number,
                     const char *const *taken, uint64_t taken_count)
{
    if (part_name_fits(own)) {
        snprintf(out, PART_SHOWN_SIZE, "%s", own);
        return;
    }
    size_t size = spell(out, own);
    size +=
        (size_t)snprintf(out + size, PART_SHOWN_SIZE - size, " #%llu", (unsigned long long)number);
    while (size + 1 < PART_SHOWN_SIZE &&
           bsearch(&out, taken, taken_count, sizeof *taken, part_compare_names)) {
        out[size++] = '#';
        out[size] = 0;
    }
}
