/* ebpo check: what a mesh is, before anything is built from it. */
#include <stddef.h>
#include <stdio.h>

#include "cli/command.h"
#include "cli/memory_args.h"
#include "cli/mesh_findings.h"
#include "cli/mesh_input.h"
#include "cli/progress.h"
#include "cmd/commands.h"

typedef struct values {
    mending mend;
    bool require_solid, json, quiet;
    int64_t threads;
    memory_values memory;
} values;

static const arg_option options[] = {
    MENDING_OPTIONS(values, mend),
    OPTION_FLAG("require-solid", 0, values, require_solid,
                "exit with code 3 if the mesh is not a solid"),
    OPTION_THREADS(values, threads),
    MEMORY_OPTIONS(values, memory),
    OPTION_FLAG("json", 0, values, json, "print the report as JSON"),
    OPTION_FLAG("quiet", 'q', values, quiet, "no report, no progress: errors and warnings only"),
    { 0 },
};

static const arg_spec spec = {
    .command = "check",
    .operands = "IN.ply",
    .least = 1,
    .most = 1,
    .summary = "checks a mesh: solid or surface, and what is wrong with it and where",
    .text = "With mending options, also shows what the mesh would be after mending. Nothing is "
            "written.",
    .options = options,
};

static void print_json(const mesh_input *p, const char *path)
{
    json j;
    json_begin(&j, stdout);
    json_object(&j, NULL);
    json_text(&j, "file", path);
    findings_json_source(&j, "source", &p->as_read);
    findings_json(&j, "report", &p->prepared.before);
    if (p->prepared.mended) {
        findings_json_mending(&j, "mend", &p->prepared.record);
        findings_json(&j, "report_after_mending", &p->prepared.report);
    }
    json_finish(&j);
}

static void print_words(const mesh_input *p, const char *path)
{
    findings_print(stdout, path, &p->as_read, &p->prepared.before);
    if (!p->prepared.mended)
        return;
    findings_print_mending(stdout, &p->prepared.record);
    findings_print(stdout, "after mending", &p->mesh, &p->prepared.report);
}

static const values usual = { 0 };

static int run(void *given, const char **operand)
{
    values *v = given;
    if (!memory_good("check", &v->memory))
        return EXIT_USAGE;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_workspace *workspace = NULL;
    ebpo_status status = memory_make(&workspace, &v->memory, &error);
    if (status != EBPO_OK)
        return command_failed("check", &error);
    progress_line line;
    ebpo_progress progress = progress_start(&line, "check", v->quiet);
    mesh_input p;
    status =
        mesh_input_read(&p, operand[0], v->mend, workspace, (unsigned)v->threads, progress, &error);
    progress_wipe(&line);
    if (status != EBPO_OK) {
        ebpo_workspace_free(workspace);
        return command_failed("check", &error);
    }
    if (v->json)
        print_json(&p, operand[0]);
    else if (!v->quiet)
        print_words(&p, operand[0]);
    command_flush("check");
    findings_warn(stderr, "check", operand[0], &p.prepared.report, &p.prepared.record);
    ebpo_mesh_free(&p.mesh);
    ebpo_workspace_free(workspace);
    return v->require_solid && !p.prepared.report.balanced ? EXIT_NOT_SOLID : EXIT_FINE;
}

const command command_check = { &spec, sizeof usual, &usual, run };
