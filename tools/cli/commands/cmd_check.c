/* ebpo check: what a mesh is, before anything is built from it. */
#include <stddef.h>
#include <stdio.h>

#include "cli/command.h"
#include "cli/memory_args.h"
#include "cli/mesh_advice.h"
#include "cli/mesh_findings.h"
#include "cli/mesh_input.h"
#include "cli/progress.h"
#include "cli/standard_files.h"
#include "cli/commands/check_places.h"
#include "cli/commands/commands.h"
#include "ebpo_config.h"

#if EBPO_HAVE_EXTRAS
#include "cli/commands/check_crossings.h"
#endif

typedef struct values {
    mending mend;
    bool require_solid, crossings, json, quiet;
    const char *out, *places;
    int64_t threads;
    memory_values memory;
} values;

#include "cli/options/check.inc"

/* The outermost object is left open. */
static void print_json(json *j, const mesh_input *p, const char *path)
{
    ebpo_solid_volume before = mesh_input_solid(p, false), after = mesh_input_solid(p, true);
    json_begin(j, stdout);
    json_object(j, NULL);
    json_text(j, "file", path);
    findings_json_source(j, "source", &p->as_read, p->unread);
    findings_json(j, "report", &p->prepared.before, &before);
    if (p->prepared.mended) {
        findings_json_mending(j, "mend", &p->prepared.record);
        findings_json(j, "report_after_mending", &p->prepared.report, &after);
    }
    advice_json(j, p);
}

static void print_reports(const values *v, const mesh_input *p, const char *path)
{
    ebpo_solid_volume before = mesh_input_solid(p, false), after = mesh_input_solid(p, true);
    findings_print(stdout, path, &p->as_read, &p->prepared.before, &before, v->crossings);
    advice_print(stdout, p);
    if (!p->prepared.mended)
        return;
    findings_print_mending(stdout, &p->prepared.record);
    findings_print(stdout, "after repair", &p->mesh, &p->prepared.report, &after, v->crossings);
}

static void print_words(const values *v, const mesh_input *p, const char *path)
{
    print_reports(v, p, path);
    advice_print_shells(stdout, p);
}

#if EBPO_HAVE_EXTRAS
static ebpo_status search_crossings(const values *v, mesh_input *p, ebpo_progress progress, json *j,
                                    progress_line *line, ebpo_error *error)
{
    ebpo_crossings_options how = EBPO_CROSSINGS_OPTIONS_INIT;
    how.threads = (unsigned)v->threads;
    how.progress = progress;
    how.ply = v->out;
    return check_crossings(&p->mesh, &p->prepared.report, &how, v->json ? j : NULL, v->quiet, line,
                           error);
}
#else
#define search_crossings(...) EBPO_OK /* --crossings is refused */
#endif

static ebpo_status report(const values *v, mesh_input *p, const char *path, ebpo_progress progress,
                          progress_line *line, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    json j;
    if (v->json)
        print_json(&j, p, path);
    else if (!v->quiet)
        print_words(v, p, path);
    command_flush("check");
    mesh_input_warn("check", path, p);
    advice_warn(stderr, "check", path, p);
    if (v->places) /* before crossings, which take the mesh */
        status = check_places(&p->mesh, v->places, (unsigned)v->threads, progress,
                              v->json ? &j : NULL, v->quiet, line, error);
    else if (v->json)
        json_null(&j, "places"); /* not asked for */
    if (status == EBPO_OK && v->crossings)
        status = search_crossings(v, p, progress, &j, line, error);
    else if (v->json)
        json_null(&j, "crossings"); /* not looked for */
    if (v->json)
        json_finish(&j);
    command_flush("check");
    return status;
}

static ebpo_status check(const values *v, const char *path, mesh_input *p,
                         ebpo_workspace *workspace, ebpo_error *error)
{
    progress_line line;
    ebpo_progress progress = progress_start(&line, "check", v->quiet);
    mending mend = v->mend;
    mend.advise = true;
    ebpo_status status =
        mesh_input_read(p, path, mend, READ_MESH, workspace, (unsigned)v->threads, progress, error);
    progress_wipe(&line);
    if (status != EBPO_OK)
        return status;
    status = report(v, p, standard_files_shown(path), progress, &line, error);
    ebpo_mesh_free(&p->mesh);
    return status;
}

static const values usual = { 0 };

static int run(void *given, const char **operand)
{
    values *v = given;
    if (!memory_good("check", &v->memory) || mending_check("check", v->mend) != EXIT_FINE)
        return EXIT_USAGE;
    if (v->crossings && !EBPO_HAVE_EXTRAS)
        return command_usage("check", "this program was built without --crossings "
                                      "(-Dextras=disabled); build it with -Dextras=enabled");
    if (v->out && !v->crossings)
        return command_usage("check", "--output shows what --crossings finds; give both");
    if (v->places && !check_places_good(v->places))
        return command_usage("check", "--places takes 'all', or a file whose name ends in .ply");
    const char *picture = v->places ? check_places_ply(v->places) : NULL;
    if (picture && command_overwrites("check", operand[0], picture))
        return EXIT_USAGE;
    if (picture && v->out && command_overwrites("check", v->out, picture))
        return EXIT_USAGE;
    if (v->out && command_overwrites("check", operand[0], v->out))
        return EXIT_USAGE;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_workspace *workspace = NULL;
    mesh_input p;
    ebpo_status status = v->out ? ebpo_check_output(v->out, &error) : EBPO_OK;
    if (status == EBPO_OK && picture)
        status = ebpo_check_output(picture, &error);
    if (status == EBPO_OK)
        status = memory_make(&workspace, &v->memory, &error);
    if (status == EBPO_OK)
        status = check(v, operand[0], &p, workspace, &error);
    ebpo_workspace_free(workspace);
    if (status != EBPO_OK)
        return command_failed("check", &error);
    return v->require_solid && p.doubts ? EXIT_NOT_SOLID : EXIT_FINE;
}

const command command_check = { &spec, sizeof usual, &usual, run };
