/* What a command for questions asks: how blocks are answered, and what answers look like. */
#ifndef EBPO_TOOLS_QUERY_JOB_H
#define EBPO_TOOLS_QUERY_JOB_H

#include <ebpo/catalogue.h>

#include "cli/answers.h"
#include "cli/points.h"
#include "cli/query_args.h"

/* Who answers: a thread with what is its own. */
typedef struct query_worker {
    ebpo_context *context;
    void *results; /* [row_room] of `result_bytes` */
    uint64_t row_room;
    answer_text *text; /* where answers go */
} query_worker;

typedef struct query_job query_job;
struct query_job {
    const char *command;
    const query_values *values;
    points_kind kind;
    size_t result_bytes; /* of the answer to one row */
    double parts_share;  /* as query_holding_open takes it */
    /* Answers rows[count][points_width(kind)], while the model is held: answers of one size go to
     * the results, lists are printed, until the text is over. Called with no rows first, so that
     * what cannot be answered at all is reported before the command waits for input. */
    ebpo_status (*answer)(const query_job *job, query_worker *worker, const double *rows,
                          uint64_t count, ebpo_error *error);
    /* Prints the results of these rows, without the model; NULL: all answers are lists. */
    void (*print)(const query_job *job, query_worker *worker, const double *rows, uint64_t count);
    const char *(*columns)(const query_job *job); /* names of what a line of answers holds */
    /* What --raw prints for an answer, as a NumPy type; NULL: lists have none. */
    const char *(*dtype)(const query_job *job, unsigned *bytes);
    ebpo_inside_options inside; /* these are set by query_run */
    ebpo_distance_options distance;
    answer_form form;
    const ebpo_sampler *sampler; /* of --attribute; NULL: none */
    ebpo_catalogue *catalogue;   /* is asked in place of a model; NULL: a model is asked */
    ebpo_catalogue_models *models;
    bool continues; /* answers go on behind those of another run: without names */
};

#endif
