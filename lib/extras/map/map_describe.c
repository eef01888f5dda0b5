/* Statistics of distances. Sums are exact, so that they depend neither on order nor on threads. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "extras/map/map_sums.h"

static const double percents[EBPO_MAP_PERCENTILES] = { 1, 5, 25, 50, 75, 95, 99 };

double ebpo_map_percent(int index)
{
    return index >= 0 && index < EBPO_MAP_PERCENTILES ? percents[index] : NAN;
}

/* --- sums --- */

ebpo_map_sums *ebpo_map_sums_new(void)
{
    ebpo_map_sums *s = ebpo_alloc_zero(1, sizeof *s);
    if (s)
        s->stats = (ebpo_map_stats){ .min = INFINITY, .max = -INFINITY };
    return s;
}

/* In multiples of a power of two that suits its size, so that neither sums nor squares overflow or
 * vanish, and so that nothing depends on the order. */
static void add_to(ebpo_sum bins[EBPO_MAP_BINS], double value, bool square)
{
    double size = fabs(value);
    int bin = size < 0x1p-400 ? 0 : size < 0x1p400 ? 1 : 2;
    double scaled = ldexp(value, -EBPO_MAP_BIN_UNIT * (bin - 1));
    ebpo_sum_add(&bins[bin], square ? scaled * scaled : scaled);
}

/* Of the sum divided by count, as multiples of 2^unit. */
static double mean_of(const ebpo_sum bins[EBPO_MAP_BINS], bool square, uint64_t count, int unit)
{
    double sum = 0;
    for (int bin = 0; bin < EBPO_MAP_BINS; bin++)
        sum += ldexp(ebpo_sum_value(&bins[bin]) / (double)count,
                     EBPO_MAP_BIN_UNIT * (bin - 1) * (square ? 2 : 1) - unit);
    return sum;
}

void ebpo_map_sums_add(ebpo_map_sums *s, const double *values, uint64_t count)
{
    for (uint64_t i = 0; i < count; i++) {
        double d = values[i];
        if (!isfinite(d)) {
            s->stats.beyond++;
            continue;
        }
        s->stats.count++;
        s->stats.inside += d < 0;
        s->stats.on += d == 0;
        s->stats.min = fmin(s->stats.min, d);
        s->stats.max = fmax(s->stats.max, d);
        add_to(s->sum, d, false);
        add_to(s->sum_unsigned, fabs(d), false);
        add_to(s->squares, d, true);
    }
}

static ebpo_map_stats nothing(const ebpo_map_stats *s)
{
    ebpo_map_stats out = *s;
    out.min = out.max = out.farthest = out.mean = out.mean_unsigned = out.rms = out.deviation = NAN;
    return out;
}

ebpo_map_stats ebpo_map_sums_stats(const ebpo_map_sums *s)
{
    ebpo_map_stats out = s->stats.count ? s->stats : nothing(&s->stats);
    for (int i = 0; i < EBPO_MAP_PERCENTILES; i++)
        out.percentile[i] = out.percentile_unsigned[i] = NAN;
    if (!out.count)
        return out;
    int unit;
    out.farthest = fmax(fabs(out.min), fabs(out.max));
    frexp(out.farthest, &unit);
    double mean = mean_of(s->sum, false, out.count, unit),
           square = mean_of(s->squares, true, out.count, 2 * unit);
    out.mean = ldexp(mean, unit);
    out.mean_unsigned = ldexp(mean_of(s->sum_unsigned, false, out.count, unit), unit);
    out.rms = ldexp(sqrt(square), unit);
    out.deviation = ldexp(sqrt(fmax(square - mean * mean, 0)), unit);
    return out;
}

/* --- percentiles --- */

static int compare(const void *x, const void *y)
{
    const double a = *(const double *)x, b = *(const double *)y;
    return (a > b) - (a < b);
}

static void pick(double *sorted, uint64_t count, double out[EBPO_MAP_PERCENTILES])
{
    qsort(sorted, count, sizeof *sorted, compare);
    for (int i = 0; i < EBPO_MAP_PERCENTILES; i++) {
        double rank = ceil(percents[i] / 100 * (double)count);
        out[i] = sorted[rank < 1 ? 0 : (uint64_t)rank - 1];
    }
}

static ebpo_status add_percentiles(const double *values, uint64_t count, ebpo_map_stats *out,
                                   ebpo_error *error)
{
    double *sorted = ebpo_alloc(out->count, sizeof *sorted);
    uint64_t n = 0;
    if (!sorted)
        return ebpo_fail_memory(error, out->count * sizeof *sorted);
    for (uint64_t i = 0; i < count; i++)
        if (isfinite(values[i]))
            sorted[n++] = values[i];
    pick(sorted, n, out->percentile);
    for (uint64_t i = 0; i < n; i++)
        sorted[i] = fabs(sorted[i]);
    pick(sorted, n, out->percentile_unsigned);
    free(sorted);
    return EBPO_OK;
}

ebpo_status ebpo_map_describe(const double *values, uint64_t count, ebpo_map_stats *out,
                              ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_map_stats, out, error);
    if (status != EBPO_OK)
        return status;
    ebpo_map_sums *sums = ebpo_map_sums_new();
    if (!sums)
        return ebpo_fail_memory(error, sizeof *sums);
    ebpo_map_sums_add(sums, values, count);
    ebpo_map_stats filled = ebpo_map_sums_stats(sums);
    free(sums);
    if (filled.count)
        status = add_percentiles(values, count, &filled, error);
    if (status == EBPO_OK)
        status = EBPO_GIVE(ebpo_map_stats, out, &filled);
    return status;
}
