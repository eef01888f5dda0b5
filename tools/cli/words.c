#include "cli/words.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/numbers.h"

/* Number of words of a table, without the final NULL. */
#define WORD_COUNT(words) (sizeof(words) / sizeof *(words)-1)

const char *const rule_words[] = { "nonzero", "evenodd", "positive", NULL };
const char *selection_words[EBPO_SELECTION_COUNT + 1];
const char *const normals_words[] = { "spherical", "angle", NULL };
const char *const codec_words[] = { "zstd", "deflate", "none", NULL };
const char *const part_words[] = { "planes",  "mesh",   "maps",    "leaf-planes", "attributes",
                                   "colours", "border", "surface", NULL };

void words_init(void)
{
    for (int i = 0; i < EBPO_SELECTION_COUNT; i++)
        selection_words[i] = ebpo_selection_describe((ebpo_selection)i)->name;
}

static char *print_scaled(char *out, size_t capacity, double v, const char *unit)
{
    static const char prefix[] = " kMGTPE";
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

char *words_count(char *out, size_t capacity, double v)
{
    return print_scaled(out, capacity, v, "");
}

char *words_real(double x, char out[32])
{
    *number_write(out, x) = 0;
    return out;
}

void words_print_reals(const double *v, int count, const char *between)
{
    for (int i = 0; i < count; i++)
        printf("%s%s", i ? between : "", words_real(v[i], (char[32]){ 0 }));
}

char *words_bytes(char *out, size_t capacity, uint64_t bytes)
{
    return print_scaled(out, capacity, (double)bytes, "B");
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

bool words_read_colour(const char *text, uint32_t *out)
{
    size_t length = strlen(text), digits = strspn(text, "0123456789abcdefABCDEF");
    if (length != digits || (length != 6 && length != 8))
        return false;
    uint32_t value = (uint32_t)strtoul(text, NULL, 16);
    *out = length == 8 ? value : value << 8 | 255;
    return true;
}

char *words_colour(char out[8], uint32_t colour)
{
    snprintf(out, 8, "#%02x%02x%02x", colour & 255, colour >> 8 & 255, colour >> 16 & 255);
    return out;
}

const char *words_node_type(ebpo_node_type type)
{
    static const char *const words[] = { "white", "black", "leaf", "gray" };
    return words[type];
}

const char *words_rule(ebpo_rule rule)
{
    return (unsigned)rule < WORD_COUNT(rule_words) ? rule_words[rule] : "unknown";
}

const char *words_codec(ebpo_codec codec)
{
    return (unsigned)codec < WORD_COUNT(codec_words) ? codec_words[codec] : "unknown";
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

/* Reads a decimal number. *whole: the number before the point. The digits after the point are from
 * *fraction to *end. Returns false for other text. */
static bool read_amount(const char *text, const char **end, uint64_t *whole, const char **fraction)
{
    char *stop;
    errno = 0;
    *whole = strtoull(text, &stop, 10);
    if (stop == text || errno || *text < '0' || *text > '9')
        return false;
    *end = *fraction = stop;
    if (*stop != '.')
        return true;
    *fraction = stop + 1;
    *end = *fraction + strspn(*fraction, "0123456789");
    return *end > *fraction;
}

/* Returns the decimal fraction 0.DIGITS times the factor, rounded down. Evaluates the digits from
 * the last one to the first one, in integers. */
static uint64_t fraction_of(const char *digits, const char *end, uint64_t factor)
{
    uint64_t sum = 0;
    while (end-- > digits)
        sum = ((uint64_t)(*end - '0') * factor + sum) / 10;
    return sum;
}

/* Returns the factor of "", "K", "MB", "GiB" and the like; 0: no unit. */
static uint64_t size_factor(const char *unit)
{
    static const char letters[] = "KMGT", small[] = "kmgt";
    uint64_t factor = 1;
    const char *at = *unit ? strchr(letters, *unit) : NULL;
    long power = at ? at - letters + 1 : 0;
    if (*unit && !at && (at = strchr(small, *unit)) != NULL)
        power = at - small + 1;
    unit += power > 0;
    bool binary = power > 0 && *unit == 'i';
    unit += binary;
    for (long i = 0; i < power; i++)
        factor *= binary ? 1024 : 1000;
    return *unit == 0 || strcmp(unit, "B") == 0 ? factor : 0;
}

bool words_read_size(const char *text, uint64_t *out)
{
    uint64_t whole, bytes;
    const char *fraction, *end;
    if (!read_amount(text, &end, &whole, &fraction))
        return false;
    uint64_t factor = size_factor(end);
    return factor > 0 && !__builtin_mul_overflow(whole, factor, &bytes) &&
           !__builtin_add_overflow(bytes, fraction_of(fraction, end, factor), out);
}

/* Reads "3", "3-" or "0-5". Returns the end of the text that was read; NULL for other text. */
static const char *read_run(const char *text, int *first, int *last, bool *to_end)
{
    char *end;
    if (*text < '0' || *text > '9')
        return NULL;
    long from = strtol(text, &end, 10), to = from;
    *to_end = *end == '-' && (end[1] < '0' || end[1] > '9');
    if (*to_end)
        to = EBPO_LEVELS_MAX - 1;
    else if (*end == '-')
        to = strtol(end + 1, &end, 10);
    if (from > to || to >= EBPO_LEVELS_MAX)
        return NULL;
    *first = (int)from;
    *last = (int)to;
    return end + *to_end;
}

bool words_read_levels(const char *text, word_levels *out)
{
    *out = (word_levels){ 0 };
    for (;; text++) {
        int first, last;
        bool to_end;
        text = read_run(text, &first, &last, &to_end);
        if (!text || (*text && *text != ','))
            return false;
        for (int i = first; i <= last; i++)
            out->set |= 1u << i;
        out->to_end |= to_end;
        if (!*text)
            break;
    }
    for (out->first = 0; !(out->set >> out->first & 1); out->first++)
        ;
    for (out->last = EBPO_LEVELS_MAX - 1; !(out->set >> out->last & 1); out->last--)
        ;
    uint32_t run = out->set >> out->first;
    out->is_contiguous = (run & (run + 1)) == 0;
    return true;
}

const char *words_file_name(const char *path)
{
    const char *last = strrchr(path, '/');
#ifdef _WIN32
    const char *other = strrchr(last ? last : path, '\\');
    last = other ? other : last;
#endif
    return last ? last + 1 : path;
}
