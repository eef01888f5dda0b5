#include "cli/model_stats.h"

#include <inttypes.h>
#include <stddef.h>

static const struct sum {
    const char *name, *unit;
    size_t offset;
    enum { SUM_BOOL, SUM_INT, SUM_UINT, SUM_REAL, SUM_FIVE } kind;
} sums[] = {
    { "resident", "", offsetof(ebpo_model_stats, resident), SUM_BOOL },
    { "cut_level", "", offsetof(ebpo_model_stats, cut_level), SUM_INT },
    { "memory", "bytes", offsetof(ebpo_model_stats, memory), SUM_UINT },
    { "memory_peak", "bytes", offsetof(ebpo_model_stats, memory_peak), SUM_UINT },
    { "budget", "bytes", offsetof(ebpo_model_stats, budget), SUM_UINT },
    { "hits", "subtrees", offsetof(ebpo_model_stats, hits), SUM_UINT },
    { "loads", "subtrees", offsetof(ebpo_model_stats, loads), SUM_UINT },
    { "prefetched", "subtrees", offsetof(ebpo_model_stats, prefetched), SUM_UINT },
    { "evicted", "subtrees", offsetof(ebpo_model_stats, evicted), SUM_UINT },
    { "bytes_read", "bytes", offsetof(ebpo_model_stats, bytes_read), SUM_UINT },
    { "reads", "", offsetof(ebpo_model_stats, reads), SUM_UINT },
    { "open_seconds", "s", offsetof(ebpo_model_stats, open_seconds), SUM_REAL },
    { "load_seconds", "s", offsetof(ebpo_model_stats, load_seconds), SUM_REAL },
    { "leaves", "", offsetof(ebpo_model_stats, leaves), SUM_UINT },
    { "leaves_of_kind", "", offsetof(ebpo_model_stats, leaves_of_kind), SUM_FIVE },
    { "leaves_one_cell_face", "", offsetof(ebpo_model_stats, leaves_one_cell_face), SUM_UINT },
    { "distances", "", offsetof(ebpo_model_stats, distances), SUM_UINT },
    { "distance_subtrees", "subtrees", offsetof(ebpo_model_stats, distance_subtrees), SUM_UINT },
    { "distance_loads", "subtrees", offsetof(ebpo_model_stats, distance_loads), SUM_UINT },
    { "skeleton_bytes", "bytes", offsetof(ebpo_model_stats, skeleton_bytes), SUM_UINT },
    { "ties", "", offsetof(ebpo_model_stats, ties), SUM_UINT },
};
enum { SUMS = sizeof sums / sizeof *sums };

enum { SUM_TEXT = 112 };

static const char *sum_text(char out[SUM_TEXT], const struct sum *sum,
                            const ebpo_model_stats *stats)
{
    const char *field = (const char *)stats + sum->offset;
    const uint64_t *u = (const void *)field;
    switch (sum->kind) {
    case SUM_BOOL: return *(const bool *)field ? "yes" : "no";
    case SUM_INT: snprintf(out, SUM_TEXT, "%d", *(const int *)(const void *)field); break;
    case SUM_UINT: snprintf(out, SUM_TEXT, "%" PRIu64, *u); break;
    case SUM_REAL: snprintf(out, SUM_TEXT, "%.6f", *(const double *)(const void *)field); break;
    case SUM_FIVE:
        snprintf(out, SUM_TEXT, "%" PRIu64 "/%" PRIu64 "/%" PRIu64 "/%" PRIu64 "/%" PRIu64, u[0],
                 u[1], u[2], u[3], u[4]);
    }
    return out;
}

void stats_print(FILE *out, const ebpo_model_stats *stats)
{
    char text[SUM_TEXT];
    for (int i = 0; i < SUMS; i++)
        fprintf(out, "%s%s %s", i ? ", " : "", sums[i].name, sum_text(text, &sums[i], stats));
    fputc('\n', out);
}

void stats_table(FILE *out, const ebpo_model_stats *first, const ebpo_model_stats *last)
{
    char text[2][SUM_TEXT];
    for (int i = 0; i < SUMS; i++)
        fprintf(out, "%-18s %15s %15s%s%s\n", sums[i].name, sum_text(text[0], &sums[i], first),
                sum_text(text[1], &sums[i], last), sums[i].unit[0] ? " " : "", sums[i].unit);
}

void stats_json(json *j, const ebpo_model_stats *stats)
{
    for (int i = 0; i < SUMS; i++) {
        const char *field = (const char *)stats + sums[i].offset;
        switch (sums[i].kind) {
        case SUM_BOOL: json_bool(j, sums[i].name, *(const bool *)field); break;
        case SUM_INT: json_int(j, sums[i].name, *(const int *)(const void *)field); break;
        case SUM_UINT: json_uint(j, sums[i].name, *(const uint64_t *)(const void *)field); break;
        case SUM_REAL: json_real(j, sums[i].name, *(const double *)(const void *)field); break;
        case SUM_FIVE:
            json_array(j, sums[i].name);
            for (int k = 0; k < 5; k++)
                json_uint(j, NULL, ((const uint64_t *)(const void *)field)[k]);
            json_end(j);
        }
    }
}
