/* Measures queries: each query separately, and all queries in a batch. */
#include "cli/bench/bench_run.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif

size_t bench_result_bytes(bench_query query)
{
    return query == BENCH_INSIDE     ? sizeof(ebpo_inside_result)
           : query == BENCH_DISTANCE ? sizeof(ebpo_distance_result)
                                     : sizeof(ebpo_ray_hit);
}

/* --- times --- */

static int compare_u64(const void *a, const void *b)
{
    uint64_t x, y;
    memcpy(&x, a, sizeof x);
    memcpy(&y, b, sizeof y);
    return (x > y) - (x < y);
}

uint64_t bench_clock_cost(void)
{
    enum { READINGS = 10001 };
    static uint64_t cost[READINGS];
    for (int i = 0; i < READINGS; i++) {
        uint64_t start = tool_clock();
        cost[i] = tool_clock() - start;
    }
    qsort(cost, READINGS, sizeof *cost, compare_u64);
    return cost[READINGS / 2];
}

/* --- queries --- */

static const ebpo_ray_hit no_hit = { .t = INFINITY, .face = EBPO_NO_FACE };

/* any_result and all_result write the result of a query for any hit, or for all hits, as one
 * ebpo_ray_hit: see bench_result. */
static ebpo_ray_hit any_result(bool any) { return any ? (ebpo_ray_hit){ .t = 0 } : no_hit; }

static ebpo_ray_hit all_result(const ebpo_ray_hit *hits, uint64_t count)
{
    return count ? (ebpo_ray_hit){ .t = (double)count, .face = hits[0].face } : no_hit;
}

static ebpo_status query_ray(bench_query query, const double *row, ebpo_context *context,
                             ebpo_ray_hit *out, ebpo_error *error)
{
    bool hit = false;
    const ebpo_ray_hit *hits;
    uint64_t count;
    ebpo_status status;
    if (query == BENCH_RAY_ALL) {
        status = ebpo_ray_all(context, row, row + 3, row[6], &hits, &count, error);
        *out = all_result(hits, count);
    } else if (query == BENCH_RAY_ANY) {
        status = ebpo_ray_any(context, row, row + 3, row[6], &hit, error);
        *out = any_result(hit);
    } else {
        status = ebpo_ray_first(context, row, row + 3, row[6], out, &hit, error);
        if (!hit)
            *out = no_hit;
    }
    return status;
}

static ebpo_status query_any_many(const bench_job *job, ebpo_context *context,
                                  const ebpo_ray_options *options, ebpo_ray_hit *out,
                                  ebpo_error *error)
{
    bool *any = malloc(job->count ? job->count : 1);
    if (!any)
        return EBPO_E_MEMORY;
    ebpo_status status =
        ebpo_ray_any_many(context, (const void *)job->rows, job->count, options, any, error);
    for (uint64_t i = 0; i < job->count && status == EBPO_OK; i++)
        out[i] = any_result(any[i]);
    free(any);
    return status;
}

static ebpo_status query_many_rays(const bench_job *job, ebpo_context *context, ebpo_ray_hit *out,
                                   ebpo_error *error)
{
    ebpo_ray_options options = EBPO_RAY_OPTIONS_INIT;
    const void *rays = job->rows;
    const ebpo_ray_hit *hits;
    const uint64_t *begin;
    options.threads = 1;
    if (job->query == BENCH_RAY)
        return ebpo_ray_first_many(context, rays, job->count, &options, out, error);
    if (job->query == BENCH_RAY_ANY)
        return query_any_many(job, context, &options, out, error);
    ebpo_status status =
        ebpo_ray_all_many(context, rays, job->count, &options, &hits, &begin, error);
    for (uint64_t i = 0; i < job->count && status == EBPO_OK; i++)
        out[i] = all_result(hits + begin[i], begin[i + 1] - begin[i]);
    return status;
}

static inline ebpo_status query_into(const bench_job *job, ebpo_context *context, uint64_t i,
                                     void *result_values, ebpo_error *error)
{
    const double *row = job->rows + i * (uint64_t)job->width;
    switch (job->query) {
    case BENCH_INSIDE:
        return ebpo_inside(context, row, &job->inside, (ebpo_inside_result *)result_values + i,
                           error);
    case BENCH_DISTANCE:
        return ebpo_distance(context, row, &job->distance,
                             (ebpo_distance_result *)result_values + i, error);
    default: return query_ray(job->query, row, context, (ebpo_ray_hit *)result_values + i, error);
    }
}

ebpo_status bench_run_query(const bench_job *job, ebpo_context *context, uint64_t number,
                            ebpo_error *error)
{
    return query_into(job, context, number, job->result_values, error);
}

/* Returns a quantile of ascending times: the least time t such that at least thousandths / 1000 of
 * all times are t or less. */
static uint64_t time_quantile(const uint64_t *sorted, uint64_t count, unsigned thousandths)
{
    uint64_t below = count / 1000 * thousandths + (count % 1000 * thousandths + 999) / 1000;
    return sorted[below ? below - 1 : 0];
}

ebpo_status bench_each(const bench_job *job, ebpo_context *context, uint64_t clock_cost,
                       bench_metrics *out, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    double sum = 0;
    uint64_t begin = tool_clock();
    for (uint64_t i = 0; i < job->count && status == EBPO_OK; i++) {
        if (job->rate > 0)
            tool_wait_until(begin + (uint64_t)((double)i / job->rate * 1e9));
        uint64_t start = tool_clock();
        status = bench_run_query(job, context, i, error);
        uint64_t took = tool_clock() - start;
        job->ns[i] = took > clock_cost ? took - clock_cost : 0;
    }
    if (status != EBPO_OK)
        return status;
    for (uint64_t i = 0; i < job->count; i++)
        sum += (double)job->ns[i];
    qsort(job->ns, job->count, sizeof *job->ns, compare_u64);
    out->mean = sum / (double)job->count;
    out->p50 = time_quantile(job->ns, job->count, 500);
    out->p99 = time_quantile(job->ns, job->count, 990);
    out->p999 = time_quantile(job->ns, job->count, 999);
    out->max = job->ns[job->count - 1];
    return EBPO_OK;
}

ebpo_status bench_batch(const bench_job *job, ebpo_context *context, void *result_values,
                        bench_metrics *out, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    uint64_t start = tool_clock();
    if (job->query == BENCH_INSIDE)
        status =
            ebpo_inside_many(context, job->rows, job->count, &job->inside, result_values, error);
    else if (job->query == BENCH_DISTANCE)
        status = ebpo_distance_many(context, job->rows, job->count, &job->distance, result_values,
                                    error);
    else
        status = query_many_rays(job, context, result_values, error);
    out->batch = (double)(tool_clock() - start) / (double)job->count;
    return status;
}

/* --- the system --- */

/* Returns the share of a file's pages that are in memory; -1: not known. */
static double share_in_memory(int fd, size_t bytes)
{
    size_t page = (size_t)sysconf(_SC_PAGESIZE), pages = (bytes + page - 1) / page, in_memory = 0;
    unsigned char *flags = pages ? malloc(pages) : NULL;
    void *mapped = flags ? mmap(NULL, bytes, PROT_READ, MAP_SHARED, fd, 0) : MAP_FAILED;
    double share = -1;
    if (mapped != MAP_FAILED && mincore(mapped, bytes, flags) == 0) {
        for (size_t i = 0; i < pages; i++)
            in_memory += flags[i] & 1;
        share = (double)in_memory / (double)pages;
    }
    if (mapped != MAP_FAILED)
        munmap(mapped, bytes);
    free(flags);
    return share;
}

double bench_drop_file(const char *path)
{
    struct stat st;
    double share = -1;
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0)
        return -1;
    fsync(fd); /* the system drops only pages that have been written to the disk */
#ifdef POSIX_FADV_DONTNEED
    if (posix_fadvise(fd, 0, 0, POSIX_FADV_DONTNEED) == 0 && fstat(fd, &st) == 0)
        share = share_in_memory(fd, (size_t)st.st_size);
#else
    (void)st, (void)share_in_memory; /* macOS cannot drop pages */
#endif
    close(fd);
    return share;
}

uint64_t bench_peak_memory(void)
{
    char line[256];
    unsigned long long kilobytes = 0;
    FILE *f = fopen("/proc/self/status", "r");
    while (f && fgets(line, sizeof line, f))
        if (sscanf(line, "VmHWM: %llu", &kilobytes) == 1)
            break;
    if (f)
        fclose(f);
    return (uint64_t)kilobytes * 1024;
}

void bench_reset_peak(void)
{
#ifdef EBPO_HAVE_MALLOC_TRIM
    malloc_trim(0);
#endif
    FILE *f = fopen("/proc/self/clear_refs", "w");
    if (f) {
        fputs("5\n", f); /* writing 5 resets VmHWM, the peak memory */
        fclose(f);
    }
}
