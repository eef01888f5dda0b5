/* ebpo box: finds the faces that intersect boxes. */
#include <stddef.h>

#include "cli/command.h"
#include "cli/commands/commands.h"
#include "cli/commands/query_run.h"

#include "cli/options/box.inc"

static ebpo_status compute_boxes(const query_job *job, query_worker *w, const double *rows,
                                 uint64_t count, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < count && status == EBPO_OK && !result_text_is_over(w->text); i++) {
        const uint64_t *faces;
        uint64_t found;
        status =
            ebpo_faces_in_box(w->context, rows + 6 * i, rows + 6 * i + 3, &faces, &found, error);
        if (status == EBPO_OK)
            results_box(w->text, job->form, faces, found);
    }
    return status;
}

static const char *box_columns(const query_job *job)
{
    (void)job;
    return "count,faces";
}

static const char *box_dtype(const query_job *job, unsigned *bytes)
{
    (void)job;
    *bytes = 0;
    return NULL; /* a result is a list of faces, which has no fixed size */
}

static const query_values standard = QUERY_VALUES_INIT;

static int run_box(void *given, const char **operand)
{
    query_values *v = given;
    query_job job = { .command = "box",
                      .values = v,
                      .kind = POINTS_BOXES,
                      .subtree_overhead = 0.25, /* measured, see docs/measured/queries.md */
                      .result = compute_boxes,
                      .columns = box_columns,
                      .dtype = box_dtype };
    return query_run(&job, operand[0], operand[1]);
}

const command command_box = { &spec, sizeof standard, &standard, run_box };
