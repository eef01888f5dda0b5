/* The loop of the commands inside, distance, ray and box: batches of points in, their answers out.
 */
#ifndef EBPO_TOOLS_QUERY_RUN_H
#define EBPO_TOOLS_QUERY_RUN_H

#include "cli/answers.h"
#include "cli/points.h"
#include "cli/query_args.h"

typedef struct query_job query_job;
struct query_job {
    const char *command;
    const query_values *values;
    points_kind kind;
    /* Answers rows[count][points_width(kind)] and prints. Asked with no rows first, so that what
     * cannot be asked at all is said before input is waited for. */
    ebpo_status (*answer)(const query_job *job, ebpo_context *context, const double *rows,
                          uint64_t count, ebpo_error *error);
    void *results;              /* room for the answers of a batch, as `answer` wants it */
    ebpo_inside_options inside; /* these two are set by query_run */
    ebpo_distance_options distance;
    answer_form form;
};

/* Returns an exit code. `points` may be NULL. */
int query_run(query_job *job, const char *model, const char *points);

#endif
