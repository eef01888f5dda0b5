/* Defines the job of a query command: how the command evaluates rows of numbers, such as points,
 * and prints results. */
#ifndef EBPO_TOOLS_QUERY_JOB_H
#define EBPO_TOOLS_QUERY_JOB_H

#include <ebpo/catalogue.h>

#include "cli/results.h"
#include "cli/points.h"
#include "cli/query_args.h"

/* The data of a thread. */
typedef struct query_worker {
    ebpo_context *context; /* NULL until query_holding_enter */
    void *results;         /* results of rows, query_job.result_bytes each */
    uint64_t row_capacity; /* number of rows for which `results` has space */
    result_text *text;     /* output of the current block of rows */
} query_worker;

typedef struct query_job query_job;
struct query_job {
    const char *command;
    const query_values *values;
    points_kind kind;
    size_t result_bytes;     /* size of the result of one row */
    double subtree_overhead; /* see query_holding_open */
    /* Evaluates rows[count][points_width(kind)]: writes results of a fixed size to worker->results,
     * or prints lists to worker->text until result_text_is_over. Called after query_holding_enter;
     * the first call has no rows, so that an unsupported query is reported before the command waits
     * for input. */
    ebpo_status (*result)(const query_job *job, query_worker *worker, const double *rows,
                          uint64_t count, ebpo_error *error);
    /* Prints worker->results of these rows; does not use the model. NULL: all results are lists. */
    void (*print)(const query_job *job, query_worker *worker, const double *rows, uint64_t count);
    /* Returns the names of the columns of a result line. */
    const char *(*columns)(const query_job *job);
    /* Returns the NumPy type of a result for --npy and --raw, and sets *bytes to its size. Returns
     * NULL for lists, which have no type. */
    const char *(*dtype)(const query_job *job, unsigned *bytes);
    /* query_run sets the following members. */
    ebpo_inside_options inside;
    ebpo_distance_options distance;
    result_form form;
    const ebpo_sampler *sampler; /* sampler for --attribute; NULL: none */
    ebpo_catalogue *catalogue;   /* queried instead of a model; NULL: a model is queried */
    ebpo_catalogue_models *models;
    bool continues; /* the output continues that of another shard, and has no column names */
};

#endif
