/* ebpo subset: writes a part of a file as a smaller file. */
#include <stddef.h>
#include <stdio.h>

#include "cli/command.h"
#include "cli/progress.h"
#include "cli/words.h"
#include "cli/commands/commands.h"
#include "cli/commands/subset_run.h"

#include "cli/options/subset.inc"

static const subset_values standard = SUBSET_VALUES_INIT;

static int run_subset(void *given, const char **operand)
{
    subset_values *v = given;
    ebpo_subset_options subset;
    int code = subset_options("subset", v, operand[0], operand[1], &subset);
    if (code != EXIT_OK)
        return code;
    if (!command_requires_hdf5("subset", operand[0]))
        return EXIT_FAILED;
    progress_line line;
    double begun = progress_now();
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    subset.progress = progress_start(&line, "subset", v->quiet);
    ebpo_status status = remote_open(&file, operand[0], &v->remote, &error);
    if (status == EBPO_OK)
        status =
            subset_set_parts(v, ebpo_file_info(file), remote_shown(operand[0]), &subset, &error);
    if (status == EBPO_OK)
        status = ebpo_subset(file, operand[1], &subset, &error);
    progress_wipe(&line);
    if (status == EBPO_OK) {
        traffic t = traffic_of(file);
        status =
            subset_report(v, operand[1], ebpo_file_info(file), &t, progress_now() - begun, &error);
        if (status == EBPO_OK && !v->json)
            remote_report(&t, &v->remote, false);
    }
    ebpo_close(file);
    return status == EBPO_OK ? EXIT_OK : command_failed("subset", &error);
}

const command command_subset = { &spec, sizeof standard, &standard, run_subset };
