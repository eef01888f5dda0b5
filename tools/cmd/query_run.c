#include "cmd/query_run.h"

#include <stdio.h>
#include <stdlib.h>

#include "cli/command.h"

static int answer_all(const query_job *job, ebpo_context *context, points *in, double *rows)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_status status = job->answer(job, context, rows, 0, &error);
    uint64_t count = 0;
    while (status == EBPO_OK && (count = points_next(in, rows)) > 0) {
        status = job->answer(job, context, rows, count, &error);
        if (!command_flush(job->command)) /* an answer that cannot be delivered ends the work */
            return EXIT_FAILED;
    }
    if (status != EBPO_OK)
        return command_failed(job->command, &error);
    return in->failed ? EXIT_FAILED : EXIT_FINE;
}

static void tell_stats(const query_job *job, const query_session *session)
{
    ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
    traffic t = traffic_of(session->file);
    ebpo_model_get_stats(session->model, &stats);
    stats_print(stderr, job->values->json, &stats);
    remote_tell(&t, &job->values->remote, job->values->json);
}

int query_run(query_job *job, const char *model, const char *path)
{
    const query_values *v = job->values;
    ebpo_model_options holding;
    query_session session = QUERY_SESSION_INIT;
    points in;
    if (!query_options_from(job->command, v, &holding, &job->inside, &job->distance))
        return EXIT_USAGE;
    job->form = v->json ? ANSWERS_JSON : v->raw ? ANSWERS_RAW : ANSWERS_TEXT;
    answers_begin(job->command);
    int code = EXIT_FAILED;
    double *rows = malloc(sizeof *rows * POINTS_BATCH * POINTS_WIDEST);
    bool opened = points_open(&in, job->command, path, job->kind, v->raw, v->tmax);
    if (!rows)
        (void)command_no_memory(job->command);
    else if (opened)
        code = query_open(&session, job->command, model, &holding, (int)v->level, &v->remote);
    if (session.context)
        code = answer_all(job, session.context, &in, rows);
    if (session.context && v->remote.stats)
        tell_stats(job, &session);
    query_close(&session);
    points_close(&in);
    free(rows);
    return code;
}
