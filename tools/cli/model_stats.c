#include "cli/model_stats.h"

#include <inttypes.h>
#include <stddef.h>

/* The printed members of ebpo_model_stats. STAT_FIVE: an array of five uint64_t. */
static const struct stat_field {
    const char *name, *unit;
    size_t offset;
    enum { STAT_BOOL, STAT_INT, STAT_UINT, STAT_REAL, STAT_FIVE } kind;
} stat_fields[] = {
    { "resident", "", offsetof(ebpo_model_stats, resident), STAT_BOOL },
    { "cut_level", "", offsetof(ebpo_model_stats, cut_level), STAT_INT },
    { "memory", "bytes", offsetof(ebpo_model_stats, memory), STAT_UINT },
    { "memory_peak", "bytes", offsetof(ebpo_model_stats, memory_peak), STAT_UINT },
    { "budget", "bytes", offsetof(ebpo_model_stats, budget), STAT_UINT },
    { "hits", "subtrees", offsetof(ebpo_model_stats, hits), STAT_UINT },
    { "loads", "subtrees", offsetof(ebpo_model_stats, loads), STAT_UINT },
    { "prefetched", "subtrees", offsetof(ebpo_model_stats, prefetched), STAT_UINT },
    { "evicted", "subtrees", offsetof(ebpo_model_stats, evicted), STAT_UINT },
    { "bytes_read", "bytes", offsetof(ebpo_model_stats, bytes_read), STAT_UINT },
    { "reads", "", offsetof(ebpo_model_stats, reads), STAT_UINT },
    { "open_seconds", "s", offsetof(ebpo_model_stats, open_seconds), STAT_REAL },
    { "load_seconds", "s", offsetof(ebpo_model_stats, load_seconds), STAT_REAL },
    { "leaves", "", offsetof(ebpo_model_stats, leaves), STAT_UINT },
    { "leaves_of_kind", "", offsetof(ebpo_model_stats, leaves_of_kind), STAT_FIVE },
    { "leaves_one_cell_face", "", offsetof(ebpo_model_stats, leaves_one_cell_face), STAT_UINT },
    { "distances", "", offsetof(ebpo_model_stats, distances), STAT_UINT },
    { "distance_subtrees", "subtrees", offsetof(ebpo_model_stats, distance_subtrees), STAT_UINT },
    { "distance_loads", "subtrees", offsetof(ebpo_model_stats, distance_loads), STAT_UINT },
    { "skeleton_bytes", "bytes", offsetof(ebpo_model_stats, skeleton_bytes), STAT_UINT },
    { "ties", "", offsetof(ebpo_model_stats, ties), STAT_UINT },
};
enum { STAT_COUNT = sizeof stat_fields / sizeof *stat_fields };

enum { STAT_TEXT = 112 };

static const char *stat_text(char out[STAT_TEXT], const struct stat_field *stat_field,
                             const ebpo_model_stats *stats)
{
    const char *field = (const char *)stats + stat_field->offset;
    const uint64_t *u = (const void *)field;
    switch (stat_field->kind) {
    case STAT_BOOL: return *(const bool *)field ? "yes" : "no";
    case STAT_INT: snprintf(out, STAT_TEXT, "%d", *(const int *)(const void *)field); break;
    case STAT_UINT: snprintf(out, STAT_TEXT, "%" PRIu64, *u); break;
    case STAT_REAL: snprintf(out, STAT_TEXT, "%.6f", *(const double *)(const void *)field); break;
    case STAT_FIVE:
        snprintf(out, STAT_TEXT, "%" PRIu64 "/%" PRIu64 "/%" PRIu64 "/%" PRIu64 "/%" PRIu64, u[0],
                 u[1], u[2], u[3], u[4]);
    }
    return out;
}

void stats_print(FILE *out, const ebpo_model_stats *stats)
{
    char text[STAT_TEXT];
    for (int i = 0; i < STAT_COUNT; i++)
        fprintf(out, "%s%s %s", i ? ", " : "", stat_fields[i].name,
                stat_text(text, &stat_fields[i], stats));
    fputc('\n', out);
}

void stats_table(FILE *out, const ebpo_model_stats *first, const ebpo_model_stats *last)
{
    char text[2][STAT_TEXT];
    for (int i = 0; i < STAT_COUNT; i++)
        fprintf(out, "%-18s %15s %15s%s%s\n", stat_fields[i].name,
                stat_text(text[0], &stat_fields[i], first),
                stat_text(text[1], &stat_fields[i], last), stat_fields[i].unit[0] ? " " : "",
                stat_fields[i].unit);
}

void stats_json(json *j, const ebpo_model_stats *stats)
{
    for (int i = 0; i < STAT_COUNT; i++) {
        const char *field = (const char *)stats + stat_fields[i].offset;
        switch (stat_fields[i].kind) {
        case STAT_BOOL: json_bool(j, stat_fields[i].name, *(const bool *)field); break;
        case STAT_INT: json_int(j, stat_fields[i].name, *(const int *)(const void *)field); break;
        case STAT_UINT:
            json_uint(j, stat_fields[i].name, *(const uint64_t *)(const void *)field);
            break;
        case STAT_REAL:
            json_real(j, stat_fields[i].name, *(const double *)(const void *)field);
            break;
        case STAT_FIVE:
            json_array(j, stat_fields[i].name);
            for (int k = 0; k < 5; k++)
                json_uint(j, NULL, ((const uint64_t *)(const void *)field)[k]);
            json_end(j);
        }
    }
}
