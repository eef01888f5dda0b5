/* Questions under the clock. */
#ifndef EBPO_TOOLS_BENCH_RUN_H
#define EBPO_TOOLS_BENCH_RUN_H

#include <ebpo/query.h>

#include "cli/tool_clock.h"

/* Those from BENCH_RAY on are about rays: the first hit, any, all. */
typedef enum bench_query {
    BENCH_INSIDE,
    BENCH_DISTANCE,
    BENCH_RAY,
    BENCH_RAY_ANY,
    BENCH_RAY_ALL
} bench_query;

/* An answer to a ray: none has face EBPO_NO_FACE. For any hit, t and face are 0; for all, t is
 * their number and the face the first one's. */
typedef union bench_answer {
    ebpo_inside_result inside;
    ebpo_distance_result distance;
    ebpo_ray_hit ray;
} bench_answer;

/* What is asked, with room for the answers. */
typedef struct bench_job {
    bench_query query;
    ebpo_inside_options inside;
    ebpo_distance_options distance;
    const double *rows; /* of rays: as ebpo_ray */
    int width;          /* doubles a row */
    uint64_t count;
    double rate;   /* single questions a second; 0: as fast as they are answered */
    uint64_t *ns;  /* [count] */
    void *answers; /* [count] of one member of bench_answer */
} bench_job;

size_t bench_answer_bytes(bench_query query);

typedef struct bench_figures {
    double mean;
    uint64_t p50, p99, p999, max; /* nanoseconds a query, without the clock's own */
    double batch;                 /* nanoseconds a query, all asked at once */
} bench_figures;

/* What a reading of the clock adds to a time: the median of 10,001. */
uint64_t bench_clock_cost(void);

EBPO_MUST_USE ebpo_status bench_ask(const bench_job *job, ebpo_context *context, uint64_t number,
                                    ebpo_error *error);
/* Each query by itself, timed singly: all figures but `batch`. Sorts job->ns. */
EBPO_MUST_USE ebpo_status bench_singly(const bench_job *job, ebpo_context *context,
                                       uint64_t clock_cost, bench_figures *out, ebpo_error *error);
/* All at once through the functions for many points or rays, on one thread, into `answers`, of the
 * same room as job->answers. */
EBPO_MUST_USE ebpo_status bench_batch(const bench_job *job, ebpo_context *context, void *answers,
                                      bench_figures *out, ebpo_error *error);

/* Asks the system to forget what it holds of a file. Returns the share of the file's pages that it
 * still holds; -1 where that is not known. */
double bench_drop_file(const char *path);
/* The most memory that this process has had (Linux), since the last reset where the system allows
 * one; 0 where it is not known. */
uint64_t bench_peak_memory(void);
void bench_reset_peak(void);

#endif
