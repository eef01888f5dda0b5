#include "cli/model_sums.h"

#include <inttypes.h>
#include <stddef.h>

static const struct sum {
    const char *name;
    size_t offset;
    enum { SUM_BOOL, SUM_INT, SUM_UINT, SUM_REAL, SUM_FIVE } kind;
} sums[] = {
    { "resident", offsetof(ebpo_model_stats, resident), SUM_BOOL },
    { "cut_level", offsetof(ebpo_model_stats, cut_level), SUM_INT },
    { "memory", offsetof(ebpo_model_stats, memory), SUM_UINT },
    { "memory_peak", offsetof(ebpo_model_stats, memory_peak), SUM_UINT },
    { "budget", offsetof(ebpo_model_stats, budget), SUM_UINT },
    { "hits", offsetof(ebpo_model_stats, hits), SUM_UINT },
    { "loads", offsetof(ebpo_model_stats, loads), SUM_UINT },
    { "prefetched", offsetof(ebpo_model_stats, prefetched), SUM_UINT },
    { "evicted", offsetof(ebpo_model_stats, evicted), SUM_UINT },
    { "bytes_read", offsetof(ebpo_model_stats, bytes_read), SUM_UINT },
    { "reads", offsetof(ebpo_model_stats, reads), SUM_UINT },
    { "open_seconds", offsetof(ebpo_model_stats, open_seconds), SUM_REAL },
    { "load_seconds", offsetof(ebpo_model_stats, load_seconds), SUM_REAL },
    { "leaves", offsetof(ebpo_model_stats, leaves), SUM_UINT },
    { "leaves_of_kind", offsetof(ebpo_model_stats, leaves_of_kind), SUM_FIVE },
    { "leaves_one_wall", offsetof(ebpo_model_stats, leaves_one_wall), SUM_UINT },
    { "distances", offsetof(ebpo_model_stats, distances), SUM_UINT },
    { "distance_subtrees", offsetof(ebpo_model_stats, distance_subtrees), SUM_UINT },
    { "distance_loads", offsetof(ebpo_model_stats, distance_loads), SUM_UINT },
    { "skeleton_bytes", offsetof(ebpo_model_stats, skeleton_bytes), SUM_UINT },
};
enum { SUMS = sizeof sums / sizeof *sums };

void stats_print(FILE *out, const ebpo_model_stats *stats)
{
    for (int i = 0; i < SUMS; i++) {
        const char *field = (const char *)stats + sums[i].offset;
        const uint64_t *u = (const void *)field;
        fprintf(out, "%s%s ", i ? ", " : "", sums[i].name);
        switch (sums[i].kind) {
        case SUM_BOOL: fputs(*(const bool *)field ? "yes" : "no", out); break;
        case SUM_INT: fprintf(out, "%d", *(const int *)(const void *)field); break;
        case SUM_UINT: fprintf(out, "%" PRIu64, *u); break;
        case SUM_REAL: fprintf(out, "%.6f", *(const double *)(const void *)field); break;
        case SUM_FIVE:
            fprintf(out, "%" PRIu64 "/%" PRIu64 "/%" PRIu64 "/%" PRIu64 "/%" PRIu64, u[0], u[1],
                    u[2], u[3], u[4]);
        }
    }
    fputc('\n', out);
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
