/* ebpo info: what a file is and holds. Reads the head only. */
#include <stddef.h>
#include <stdio.h>

#include "cli/command.h"
#include "cli/file_facts.h"
#include "cli/remote_args.h"
#include "cmd/commands.h"

typedef struct values {
    bool json, arrays;
    remote_values remote;
} values;

static const arg_option options[] = {
    OPTION_FLAG("json", 0, values, json, "print the facts as JSON"),
    OPTION_FLAG("arrays", 0, values, arrays, "list the arrays of the file as well"),
    REMOTE_OPTIONS(values, remote),
    { 0 },
};

static const arg_spec spec = {
    .command = "info",
    .operands = "FILE",
    .least = 1,
    .most = 1,
    .summary = "describes a file: its contents, bytes by part, and a table of levels",
    .text = "Only the head of the file is read. FILE is an .ebpo.h5 file or its URL; for meshes "
            "use 'ebpo check'.",
    .options = options,
};

static const values usual = { .remote = REMOTE_VALUES_INIT };

static int run(void *given, const char **operand)
{
    values *v = given;
    if (!command_wants_hdf5("info", operand[0]))
        return EXIT_FAILED;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    ebpo_stored_sizes stored = EBPO_STORED_SIZES_INIT;
    ebpo_status status = remote_open(&file, operand[0], &v->remote, &error);
    if (status == EBPO_OK)
        status = ebpo_file_locate(file, &stored, &error);
    if (status != EBPO_OK) {
        ebpo_close(file);
        return command_failed("info", &error);
    }
    const ebpo_info *info = ebpo_file_info(file);
    traffic t = traffic_of(file);
    if (v->json) {
        json j;
        json_begin(&j, stdout);
        json_object(&j, NULL);
        facts_json(&j, remote_shown(operand[0]), info, &stored);
        if (v->arrays)
            facts_arrays_json(&j, file);
        remote_json(&j, &t, &v->remote);
        json_finish(&j);
    } else {
        facts_print(stdout, remote_shown(operand[0]), info, &stored);
        putchar('\n');
        facts_table(stdout, info, &stored);
        if (v->arrays)
            facts_arrays(stdout, file);
        remote_tell(&t, &v->remote, false);
    }
    ebpo_close(file);
    return EXIT_FINE;
}

const command command_info = { &spec, sizeof usual, &usual, run };
