#include "cli/words.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char *const rule_words[] = { "nonzero", "evenodd", "positive", NULL };
const char *selection_words[EBPO_SELECTION_COUNT + 1];
const char *const normals_words[] = { "spherical", "angle", NULL };
const char *const codec_words[] = { "zstd", "deflate", "none", NULL };
const char *const part_words[] = { "planes", "mesh", "maps", "leaf-planes", "attributes", NULL };

void words_init(void)
{
    for (int i = 0; i < EBPO_SELECTION_COUNT; i++)
        selection_words[i] = ebpo_selection_describe((ebpo_selection)i)->name;
}

static char *scaled(char *out, size_t capacity, double v, const char *unit)
{
    static const char prefix[] = " KMGTPE";
    int i = 0;
    while (v >= 999.5 && prefix[i + 1]) {
        v /= 1000;
        i++;
    }
    if (i == 0)
        snprintf(out, capacity, "%.0f%s%s", v, *unit ? " " : "", unit);
    else
        snprintf(out, capacity, "%.*f %c%s", v < 9.995 ? 2 : v < 99.95 ? 1 : 0, v, prefix[i], unit);
    return out;
}

char *words_count(char *out, size_t capacity, double v) { return scaled(out, capacity, v, ""); }

char *words_real(double x, char out[32])
{
    for (int digits = 1; digits <= 17; digits++) {
        snprintf(out, 32, "%.*g", digits, x);
        if (strtod(out, NULL) == x)
            break;
    }
    return out;
}

char *words_bytes(char *out, size_t capacity, uint64_t bytes)
{
    return scaled(out, capacity, (double)bytes, "B");
}

char *words_plural(char *out, size_t capacity, uint64_t count, const char *one, const char *many)
{
    snprintf(out, capacity, "%llu %s", (unsigned long long)count, count == 1 ? one : many);
    return out;
}

char *words_parts(char *out, size_t capacity, uint32_t parts)
{
    size_t used = 0;
    out[0] = 0;
    for (int i = 0; part_words[i]; i++)
        if (parts >> i & 1 && used < capacity)
            used += (size_t)snprintf(out + used, capacity - used, "%s%s", used ? ", " : "",
                                     part_words[i]);
    return out;
}

char *words_format(char *out, size_t capacity, int major, int minor)
{
    snprintf(out, capacity, "%d.%d", major, minor);
    return out;
}

const char *words_node_type(ebpo_node_type type)
{
    static const char *const words[] = { "white", "black", "leaf", "gray" };
    return words[type];
}

const char *words_rule(ebpo_rule rule) { return (unsigned)rule < 3 ? rule_words[rule] : "unknown"; }

const char *words_codec(ebpo_codec codec)
{
    return (unsigned)codec < 3 ? codec_words[codec] : "unknown";
}

bool words_end_with(const char *text, const char *end)
{
    size_t length = strlen(text), n = strlen(end);
    return length > n && strcmp(text + length - n, end) == 0;
}

void words_hex(const uint8_t digest[32], char out[65])
{
    for (int i = 0; i < 32; i++)
        snprintf(out + 2 * i, 3, "%02x", digest[i]);
}

bool words_read_unit(const char *text, const char *const *units, const uint64_t *factors,
                     uint64_t *out)
{
    char *end;
    errno = 0;
    unsigned long long v = strtoull(text, &end, 10);
    if (end == text || errno || text[0] < '0' || text[0] > '9')
        return false;
    for (int i = 0; units[i]; i++)
        if (strcmp(end, units[i]) == 0)
            return !__builtin_mul_overflow((uint64_t)v, factors[i], out);
    return false;
}

bool words_read_size(const char *text, uint64_t *out)
{
    static const char *const units[] = { "", "K", "M", "G", "T", "k", "m", "g", "t", NULL };
    static const uint64_t factors[] = { 1,        1u << 10,          1u << 20,
                                        1u << 30, UINT64_C(1) << 40, 1u << 10,
                                        1u << 20, 1u << 30,          UINT64_C(1) << 40 };
    return words_read_unit(text, units, factors, out);
}
