/* ebpo verify: verifies the guarantees of a file, or shows violations. */
#include <stddef.h>
#include <stdio.h>

#include "cli/command.h"
#include "cli/json.h"
#include "cli/memory_args.h"
#include "cli/progress.h"
#include "cli/remote_args.h"
#include "cli/words.h"
#include "cli/commands/commands.h"

typedef struct values {
    const char *against;
    int64_t samples, threads;
    memory_values memory;
    bool json, quiet;
    remote_values remote;
} values;

#include "cli/options/verify.inc"

/* Kinds of checks. */
static const struct kind {
    size_t offset; /* offset of the kind's ebpo_verify_count in ebpo_verify_report */
    const char *name;
    const char *meaning; /* what is true without violations */
} kinds[] = {
    { offsetof(ebpo_verify_report, structure), "structure",
      "the header, shapes, counts and order are valid" },
    { offsetof(ebpo_verify_report, content), "content", "all arrays match the checksum" },
    { offsetof(ebpo_verify_report, containment), "containment",
      "the solid lies in every half-space" },
    { offsetof(ebpo_verify_report, nesting), "nesting",
      "each envelope is inside the envelope of its parent" },
    { offsetof(ebpo_verify_report, labels), "labels",
      "white and black nodes and winding numbers are right" },
    { offsetof(ebpo_verify_report, lists), "lists",
      "each leaf lists all faces that touch its cell" },
    { offsetof(ebpo_verify_report, source), "source", "data of the file equals the source's" },
};
enum { KINDS = sizeof kinds / sizeof *kinds };

static const ebpo_verify_count *count_of(const ebpo_verify_report *report, int i)
{
    return (const ebpo_verify_count *)(const void *)((const char *)report + kinds[i].offset);
}

/* Data of the source that was not compared, because the file does not have the data. */
typedef struct not_compared {
    char words[900]; /* what was not compared, and why; "": everything was compared */
} not_compared;

static not_compared list_not_compared(const ebpo_file *file, const ebpo_mesh *source)
{
    uint64_t parts = ebpo_file_info(file)->parts;
    not_compared u = { "" };
    const char *lost = ebpo_mesh_attributes_lost(source), *unread = ebpo_mesh_ignored(source);
    bool has_attributes = ebpo_mesh_has_attributes(source);
    if (has_attributes && !(parts & EBPO_PART_ATTRIBUTES))
        snprintf(u.words, sizeof u.words,
                 "its attributes, such as colours and normals, because the .ebpo.h5 file has none");
    else if (has_attributes && !(parts & EBPO_PART_MAPS))
        snprintf(u.words, sizeof u.words,
                 "its attributes, such as colours and normals, because the .ebpo.h5 file has no "
                 "source indices");
    else if (lost || unread)
        snprintf(u.words, sizeof u.words, "data that is not converted: %s%s%s",
                 unread ? unread : "", lost && unread ? "; " : "", lost ? lost : "");
    return u;
}

static void print_words(const ebpo_verify_report *report, const char *path, const char *against,
                        const not_compared *u)
{
    printf("%-12s %14s %11s\n", "kind", "checks", "violations");
    for (int i = 0; i < KINDS; i++) {
        const ebpo_verify_count *c = count_of(report, i);
        if (c->checks || c->violations)
            printf("%-12s %14llu %11llu   %s\n", kinds[i].name, (unsigned long long)c->checks,
                   (unsigned long long)c->violations, kinds[i].meaning);
        else
            printf("%-12s %14s %11s   %s\n", kinds[i].name, "not made", "-", kinds[i].meaning);
    }
    if (u->words[0])
        printf("%s: not compared: %s\n", against, u->words);
    if (report->spare_filled)
        printf(
            "%s: note: %llu of %llu unused bytes are not zero, so the file was changed, or another "
            "program wrote it; not a violation\n",
            path, (unsigned long long)report->spare_filled,
            (unsigned long long)report->spare_bytes);
    if (!report->violations)
        printf("%s: OK: %llu checks, no violation\n", path, (unsigned long long)report->checks);
}

static void print_violations(const ebpo_verify_report *report, const char *path)
{
    for (int i = 0; i < KINDS; i++) {
        const ebpo_verify_count *c = count_of(report, i);
        if (c->violations)
            fprintf(stderr, "ebpo verify: %s: %s: %llu of %llu checks failed; first: %s\n", path,
                    kinds[i].name, (unsigned long long)c->violations, (unsigned long long)c->checks,
                    c->first);
    }
}

static void print_json(const ebpo_verify_report *report, const char *path, const not_compared *u,
                       const traffic *t, const remote_values *remote)
{
    json j;
    json_begin(&j, stdout);
    json_object(&j, NULL);
    json_text(&j, "file", remote_shown(path));
    json_bool(&j, "ok", report->violations == 0);
    json_uint(&j, "checks", report->checks);
    json_uint(&j, "violations", report->violations);
    if (u->words[0])
        json_text(&j, "not_compared", u->words);
    json_object(&j, "kinds");
    for (int i = 0; i < KINDS; i++) {
        const ebpo_verify_count *c = count_of(report, i);
        json_object(&j, kinds[i].name);
        json_uint(&j, "checks", c->checks);
        json_uint(&j, "violations", c->violations);
        if (c->violations)
            json_text(&j, "first", c->first);
        json_end(&j);
    }
    json_end(&j);
    json_uint(&j, "spare_bytes", report->spare_bytes);
    json_uint(&j, "spare_filled", report->spare_filled);
    remote_json(&j, t, remote);
    json_finish(&j);
}

static ebpo_status verify_model(const values *v, const char *path, ebpo_progress progress,
                                ebpo_verify_report *report, not_compared *u, traffic *t,
                                ebpo_error *error)
{
    ebpo_mesh source = { 0 };
    ebpo_file *file = NULL;
    ebpo_workspace *workspace = NULL;
    ebpo_status status = memory_new(&workspace, &v->memory, error);
    ebpo_mesh_read_options read = EBPO_MESH_READ_OPTIONS_INIT;
    read.progress = progress;
    read.workspace = workspace;
    read.threads = (unsigned)v->threads;
    read.attributes = 1;
    read.embed_textures = 1;
    if (status == EBPO_OK)
        status = remote_open(&file, path, &v->remote, error);
    if (status == EBPO_OK && v->against)
        status = ebpo_mesh_read(v->against, &read, &source, error);
    if (status == EBPO_OK) {
        ebpo_verify_options verify_options = EBPO_VERIFY_OPTIONS_INIT;
        verify_options.source = v->against ? &source : NULL;
        verify_options.threads = (unsigned)v->threads;
        verify_options.label_samples = (uint64_t)v->samples;
        verify_options.progress = progress;
        verify_options.workspace = workspace;
        status = ebpo_verify(file, &verify_options, report, error);
    }
    if (status == EBPO_OK)
        *t = traffic_of(file);
    if (status == EBPO_OK && v->against)
        *u = list_not_compared(file, &source);
    ebpo_mesh_free(&source);
    ebpo_close(file);
    ebpo_workspace_free(workspace);
    return status;
}

static const values standard = { .remote = REMOTE_VALUES_INIT };

static int run_verify(void *given, const char **operand)
{
    values *v = given;
    if (!memory_check("verify", &v->memory))
        return EXIT_USAGE;
    if (!command_requires_hdf5("verify", operand[0]))
        return EXIT_FAILED;
    progress_line line;
    ebpo_progress progress = progress_start(&line, "verify", v->quiet);
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_verify_report report = EBPO_VERIFY_REPORT_INIT;
    not_compared u = { "" };
    traffic t;
    ebpo_status status = verify_model(v, operand[0], progress, &report, &u, &t, &error);
    progress_wipe(&line);
    if (status != EBPO_OK)
        return command_failed("verify", &error);
    if (v->json)
        print_json(&report, operand[0], &u, &t, &v->remote);
    else if (!v->quiet)
        print_words(&report, remote_shown(operand[0]), v->against, &u);
    command_flush("verify");
    print_violations(&report, remote_shown(operand[0]));
    if (!v->json)
        remote_report(&t, &v->remote, false);
    return report.violations ? EXIT_FAILED : EXIT_OK;
}

const command command_verify = { &spec, sizeof standard, &standard, run_verify };
