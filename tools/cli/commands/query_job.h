/* Defines the job of a query command: how it evaluates blocks and prints results. */
#ifndef EBPO_TOOLS_QUERY_JOB_H
#define EBPO_TOOLS_QUERY_JOB_H

#include <ebpo/catalogue.h>

#include "cli/results.h"
#include "cli/points.h"
#include "cli/query_args.h"

/* A thread with its own data. */
typedef struct query_worker {
    ebpo_context *context;
    void *results; /* [row_capacity] of `result_bytes` */
    uint64_t row_capacity;
    result_text *text; /* output */
} query_worker;

typedef struct query_job query_job;
struct query_job {
    const char *command;
    const query_values *values;
    points_kind kind;
    size_t result_bytes;     /* size of the result of one row */
    double subtree_overhead; /* see query_holding_open */
    /* Evaluates rows[count][points_width(kind)], after query_holding_enter: writes results of a
     * fixed size to `results`, or prints lists until result_text_is_over. Called with no rows
     * first, so that an unsupported query is reported before the command waits for input. */
    ebpo_status (*result)(const query_job *job, query_worker *worker, const double *rows,
                          uint64_t count, ebpo_error *error);
    /* Prints the results of these rows; does not use the model. NULL: all results are lists. */
    void (*print)(const query_job *job, query_worker *worker, const double *rows, uint64_t count);
    /* Returns the names of the columns of a result line. */
    const char *(*columns)(const query_job *job);
    /* Returns the NumPy type of a result for --raw; NULL: lists have none. */
    const char *(*dtype)(const query_job *job, unsigned *bytes);
    /* query_run sets the following members. */
    ebpo_inside_options inside;
    ebpo_distance_options distance;
    result_form form;
    const ebpo_sampler *sampler; /* sampler for --attribute; NULL: none */
    ebpo_catalogue *catalogue;   /* queried instead of a model; NULL: a model is queried */
    ebpo_catalogue_models *models;
    bool continues; /* results are appended to those of another run: no column names */
};

#endif
