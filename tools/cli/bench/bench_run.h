/* Measures the time of queries. */
#ifndef EBPO_TOOLS_BENCH_RUN_H
#define EBPO_TOOLS_BENCH_RUN_H

#include <ebpo/query.h>

#include "cli/tool_clock.h"

/* Queries from BENCH_RAY on are ray queries: the first hit, any hit, all hits. */
typedef enum bench_query {
    BENCH_INSIDE,
    BENCH_DISTANCE,
    BENCH_RAY,
    BENCH_RAY_ANY,
    BENCH_RAY_ALL
} bench_query;

/* Result of a query. A ray without a hit has the face EBPO_NO_FACE. For a ray with hits,
 * BENCH_RAY_ANY sets t and face to 0. BENCH_RAY_ALL sets t to the number of hits, and face to the
 * face of the first hit. */
typedef union bench_result {
    ebpo_inside_result inside;
    ebpo_distance_result distance;
    ebpo_ray_hit ray;
} bench_result;

/* Queries, with space for the results. */
typedef struct bench_job {
    bench_query query;
    ebpo_inside_options inside;
    ebpo_distance_options distance;
    const double *rows; /* [count][width]; a row of a ray query is an ebpo_ray */
    int width;          /* number of doubles in a row */
    uint64_t count;
    double rate;         /* single queries per second; 0: no limit */
    uint64_t *ns;        /* [count] nanoseconds of each query */
    void *result_values; /* [count] results, each a member of bench_result */
} bench_job;

/* Returns the size of a result in result_values. */
size_t bench_result_bytes(bench_query query);

typedef struct bench_metrics {
    double mean;
    uint64_t p50, p99, p999, max; /* nanoseconds per query, without the cost of the clock */
    double batch;                 /* nanoseconds per query in a batch */
} bench_metrics;

/* Returns the nanoseconds that reading the clock adds to a measurement: the median of 10,001
 * readings. */
uint64_t bench_clock_cost(void);

/* Runs query `number`, and writes its result to job->result_values. */
EBPO_MUST_USE ebpo_status bench_run_query(const bench_job *job, ebpo_context *context,
                                          uint64_t number, ebpo_error *error);
/* Runs and times each query separately. Sets all members of *out except `batch`. Sorts job->ns. */
EBPO_MUST_USE ebpo_status bench_each(const bench_job *job, ebpo_context *context,
                                     uint64_t clock_cost, bench_metrics *out, ebpo_error *error);
/* Runs all queries in a batch, by the functions for many points or rays, on one thread. Writes the
 * results to `result_values`, which has the size of job->result_values. */
EBPO_MUST_USE ebpo_status bench_batch(const bench_job *job, ebpo_context *context,
                                      void *result_values, bench_metrics *out, ebpo_error *error);

/* Requests that the system drops a file from the page cache. Returns the share of pages that are
 * still in memory; -1: not known. */
double bench_drop_file(const char *path);
/* Returns the peak memory of this process in bytes (Linux); 0: not known. If the system allows
 * resets, this is the peak since the last call of bench_reset_peak. */
uint64_t bench_peak_memory(void);
/* Resets the peak memory, if the system allows this. */
void bench_reset_peak(void);

#endif
