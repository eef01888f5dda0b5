/* ebpo check: reports the properties of a mesh before building. With --findings it also reports the
 * positions of findings (defects, see ebpo/findings.h). */
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include <ebpo/findings.h>

#include "cli/command.h"
#include "cli/commands/commands.h"
#include "cli/json.h"
#include "cli/memory_args.h"
#include "cli/mesh_advice.h"
#include "cli/mesh_findings.h"
#include "cli/mesh_input.h"
#include "cli/progress.h"
#include "cli/standard_files.h"
#include "ebpo_config.h"

#if EBPO_HAVE_EXTRAS
#include "cli/commands/check_crossings.h"
#endif

/* --- positions of findings --- */

typedef struct finding_printer {
    json *j;                            /* findings are printed here as JSON; NULL: no JSON */
    bool words;                         /* if `j` is NULL: print findings in words */
    progress_line *line;                /* wiped before printing */
    uint64_t count[EBPO_FINDING_KINDS]; /* number of findings of each kind so far */
} finding_printer;

/* Returns true if `to` is "all" or the name of a PLY file. */
static bool is_findings_target(const char *to)
{
    size_t length = strlen(to);
    return strcmp(to, "all") == 0 || (length > 4 && strcasecmp(to + length - 4, ".ply") == 0);
}

/* Returns the path of the PLY file that `to` names; NULL: `to` is "all". */
static const char *findings_ply_path(const char *to) { return strcmp(to, "all") == 0 ? NULL : to; }

static void finding_json(json *j, const ebpo_mesh_finding *p)
{
    json_object(j, NULL);
    json_text(j, "kind", ebpo_finding_name(p->kind));
    if (p->component == EBPO_NO_COMPONENT)
        json_null(j, "component");
    else
        json_uint(j, "component", p->component);
    json_array(j, "faces");
    for (uint64_t i = 0; i < p->face_count; i++)
        json_uint(j, NULL, p->faces[i]);
    json_end(j);
    json_array(j, "vertices");
    for (int i = 0; i < (p->vertex[0] == p->vertex[1] ? 1 : 2); i++)
        json_uint(j, NULL, p->vertex[i]);
    json_end(j);
    json_reals(j, "point", p->point, 3);
    json_end(j);
}

enum { FACES_SHOWN = 8 }; /* faces of a finding that are printed in words */

static void finding_words(const ebpo_mesh_finding *p)
{
    printf("    at %.9g %.9g %.9g", p->point[0], p->point[1], p->point[2]);
    if (p->component != EBPO_NO_COMPONENT)
        printf(", component %lu", (unsigned long)p->component);
    if (p->vertex[0] == p->vertex[1])
        printf(", vertex %llu", (unsigned long long)p->vertex[0]);
    else
        printf(", vertices %llu %llu", (unsigned long long)p->vertex[0],
               (unsigned long long)p->vertex[1]);
    for (uint64_t i = 0; i < p->face_count && i < FACES_SHOWN; i++)
        printf("%s %llu",
               i                    ? ""
               : p->face_count == 1 ? ", face"
                                    : ", faces",
               (unsigned long long)p->faces[i]);
    puts(p->face_count > FACES_SHOWN ? " ..." : "");
}

static bool take_finding(void *user, const ebpo_mesh_finding *p)
{
    finding_printer *t = user;
    bool first = t->count[p->kind]++ == 0;
    if (!t->j && !t->words)
        return true;
    progress_wipe(t->line);
    if (t->j) {
        finding_json(t->j, p);
    } else {
        if (first)
            printf("  %s:\n", findings_plural(ebpo_finding_name(p->kind)));
        finding_words(p);
    }
    return true;
}

static void print_legend(const char *path, const uint64_t count[EBPO_FINDING_KINDS])
{
    printf("  positions of findings, in colours: %s\n", path);
    for (int kind = 0; kind < EBPO_FINDING_KINDS; kind++) {
        uint8_t rgb[3];
        ebpo_finding_colour(kind, rgb);
        if (count[kind])
            printf("    %3u %3u %3u  %llu %s\n", rgb[0], rgb[1], rgb[2],
                   (unsigned long long)count[kind], findings_plural(ebpo_finding_name(kind)));
    }
}

/* Finds the positions of findings. If `to` names a PLY file, writes the mesh with coloured findings
 * there. If `j` is not NULL, prints all positions as a member of the open JSON object. If `j` is
 * NULL, prints the legend of the PLY file or, without a file, all positions in words; if `quiet`,
 * prints nothing. */
static ebpo_status check_findings(const ebpo_mesh *mesh, const char *to, unsigned threads,
                                  ebpo_progress progress, json *j, bool quiet, progress_line *line,
                                  ebpo_error *error)
{
    ebpo_findings_options search = EBPO_FINDINGS_OPTIONS_INIT;
    finding_printer t = { .j = j, .line = line };
    search.threads = threads;
    search.progress = progress;
    search.ply = findings_ply_path(to);
    t.words = !quiet && !search.ply;
    if (j)
        json_array(j, "locations");
    ebpo_status status = ebpo_mesh_findings(mesh, &search, take_finding, &t, NULL, error);
    progress_wipe(line);
    if (j)
        json_end(j);
    else if (status == EBPO_OK && search.ply && !quiet)
        print_legend(search.ply, t.count);
    return status;
}

/* --- the command --- */

typedef struct values {
    repair_request repairs_wanted;
    bool require_solid, crossings, json, quiet;
    const char *out;      /* PLY file of --crossings; NULL: none */
    const char *findings; /* "all", or the name of a PLY file; NULL: not requested */
    int64_t threads;
    memory_values memory;
} values;

#include "cli/options/check.inc"

/* Prints the reports as JSON; the outermost object stays open. */
static void print_json(json *j, const mesh_input *p, const char *path)
{
    ebpo_solid_volume before = mesh_input_solid(p, false), after = mesh_input_solid(p, true);
    json_begin(j, stdout);
    json_object(j, NULL);
    json_text(j, "file", path);
    findings_json_source(j, "source", &p->as_read, p->unread);
    findings_json(j, "report", &p->prepared.before, &before);
    if (p->prepared.was_repaired) {
        findings_json_repair(j, "repair", &p->prepared.record);
        findings_json(j, "report_after_repair", &p->prepared.report, &after);
    }
    advice_json(j, p);
}

static void print_reports(const values *v, const mesh_input *p, const char *path)
{
    ebpo_solid_volume before = mesh_input_solid(p, false), after = mesh_input_solid(p, true);
    findings_print(stdout, path, &p->as_read, &p->prepared.before, &before, v->crossings);
    advice_print(stdout, p);
    if (!p->prepared.was_repaired)
        return;
    findings_print_repair(stdout, &p->prepared.record);
    findings_print(stdout, NULL, &p->mesh, &p->prepared.report, &after, v->crossings);
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
    ebpo_self_intersections_options search = EBPO_SELF_INTERSECTIONS_OPTIONS_INIT;
    search.threads = (unsigned)v->threads;
    search.progress = progress;
    search.ply = v->out;
    return check_crossings(&p->mesh, &p->prepared.report, &search, v->json ? j : NULL, v->quiet,
                           line, error);
}
#endif

static ebpo_status report_findings(const values *v, mesh_input *p, const char *path,
                                   ebpo_progress progress, progress_line *line, ebpo_error *error)
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
    if (v->findings) /* must precede search_crossings, which empties the mesh */
        status = check_findings(&p->mesh, v->findings, (unsigned)v->threads, progress,
                                v->json ? &j : NULL, v->quiet, line, error);
    else if (v->json)
        json_null(&j, "locations"); /* not requested */
    if (v->json && !(status == EBPO_OK && v->crossings))
        json_null(&j, "crossings"); /* not checked */
#if EBPO_HAVE_EXTRAS
    else if (status == EBPO_OK && v->crossings)
        status = search_crossings(v, p, progress, &j, line, error);
#endif
    if (v->json)
        json_finish(&j);
    command_flush("check");
    return status;
}

static ebpo_status check_mesh(const values *v, const char *path, mesh_input *p,
                              ebpo_workspace *workspace, ebpo_error *error)
{
    progress_line line;
    ebpo_progress progress = progress_start(&line, "check", v->quiet);
    repair_request repairs_wanted = v->repairs_wanted;
    repairs_wanted.advise = true;
    ebpo_status status = mesh_input_read(p, path, repairs_wanted, READ_MESH, workspace,
                                         (unsigned)v->threads, progress, error);
    progress_wipe(&line);
    if (status != EBPO_OK)
        return status;
    status = report_findings(v, p, standard_files_shown(path), progress, &line, error);
    ebpo_mesh_free(&p->mesh);
    return status;
}

static const values standard = { 0 };

static int run_check(void *given, const char **operand)
{
    values *v = given;
    if (!memory_check("check", &v->memory) || repair_check("check", v->repairs_wanted) != EXIT_OK)
        return EXIT_USAGE;
    if (v->crossings && !EBPO_HAVE_EXTRAS)
        return command_usage("check", "this program was built without --crossings "
                                      "(-Dextras=disabled); build it with -Dextras=enabled");
    if (v->out && !v->crossings)
        return command_usage("check", "--output needs --crossings; give both");
    if (v->findings && !is_findings_target(v->findings))
        return command_usage("check", "--findings takes 'all', or a file whose name ends in .ply");
    const char *findings_ply = v->findings ? findings_ply_path(v->findings) : NULL;
    if (findings_ply && command_overwrites("check", operand[0], findings_ply))
        return EXIT_USAGE;
    if (findings_ply && v->out && command_overwrites("check", v->out, findings_ply))
        return EXIT_USAGE;
    if (v->out && command_overwrites("check", operand[0], v->out))
        return EXIT_USAGE;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_workspace *workspace = NULL;
    mesh_input p;
    ebpo_status status = v->out ? ebpo_check_output(v->out, &error) : EBPO_OK;
    if (status == EBPO_OK && findings_ply)
        status = ebpo_check_output(findings_ply, &error);
    if (status == EBPO_OK)
        status = memory_new(&workspace, &v->memory, &error);
    if (status == EBPO_OK)
        status = check_mesh(v, operand[0], &p, workspace, &error);
    ebpo_workspace_free(workspace);
    if (status != EBPO_OK)
        return command_failed("check", &error);
    return v->require_solid && p.doubts ? EXIT_NOT_SOLID : EXIT_OK;
}

const command command_check = { &spec, sizeof standard, &standard, run_check };
