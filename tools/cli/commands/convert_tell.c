#include "cli/commands/convert_tell.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "cli/command.h"
#include "cli/file_facts.h"
#include "cli/mesh_advice.h"
#include "cli/mesh_findings.h"
#include "cli/remote_args.h"
#include "cli/tables.h"
#include "cli/words.h"
#include "cli/commands/subset_run.h"

void convert_tell_mesh(const convert_told *t, const mesh_input *p)
{
    ebpo_solid_volume before = mesh_input_solid(p, false), after = mesh_input_solid(p, true);
    if (!t->json && !t->quiet) {
        findings_print(stdout, t->in, &p->as_read, &p->prepared.before, &before, false);
        advice_print(stdout, p);
        findings_print_mending(stdout, &p->prepared.record);
        if (p->prepared.mended)
            findings_print(stdout, "after repair", &p->mesh, &p->prepared.report, &after, false);
        advice_print_shells(stdout, p);
    }
    command_flush("convert");
    mesh_input_warn("convert", t->in, p);
    const char *lost = ebpo_mesh_attributes_lost(&p->mesh);
    if (lost)
        fprintf(stderr, "ebpo convert: %s: note: not kept: %s\n", t->in, lost);
    if (!t->by_groups)
        advice_warn(stderr, "convert", t->in, p);
}

/* --- five lines --- */

static void print_what(const char *out, const ebpo_info *info)
{
    char faces[64], parts[64];
    printf("%s: %s of %s", out, info->solid ? "a solid" : "a surface",
           words_plural(faces, sizeof faces, info->face_count, "face", "faces"));
    printf(", in %s\n",
           words_plural(parts, sizeof parts, info->report.components, "component", "components"));
}

static void print_sound(const ebpo_info *info, const ebpo_solid_volume *solid, const mesh_input *p)
{
    char text[1024], volume[FINDINGS_VOLUME];
    if (p->doubts) {
        printf("  sound     no: %s\n", advice_doubts(text, sizeof text, p));
        return;
    }
    printf("  sound     yes: %s, %s; faces that cross were not looked for\n",
           info->report.manifold ? "a closed 2-manifold" : "its edges balance",
           findings_volume(volume, solid, &info->report, info->unit));
}

static void print_size(const ebpo_info *info, bool chosen, double seconds)
{
    char bytes[32];
    printf("  size      %s, %.2f B/face", words_bytes(bytes, sizeof bytes, info->file_bytes),
           info->face_count ? (double)info->file_bytes / (double)info->face_count : 0);
    if (info->source_size)
        printf(", %.0f %% of the source",
               100 * (double)info->file_bytes / (double)info->source_size);
    subset_print_need(info, chosen);
    printf(", in %.1f s\n", seconds);
}

static void print_levels(const ebpo_info *info, const ebpo_solid_volume *solid)
{
    char first[TABLE_CELL], last[TABLE_CELL];
    int deepest = info->level_count - 1;
    bool known = findings_knows(solid);
    printf("  levels    0 to %d", deepest);
    if (isfinite(facts_percent(info, solid, 0)) && info->parts & EBPO_PART_PLANES)
        printf(": envelopes of %s%s%s %% of the %s",
               table_cell(first, "%.4g", facts_percent(info, solid, 0)), deepest ? " to " : "",
               deepest ? table_cell(last, "%.4g", facts_percent(info, solid, deepest)) : "",
               !info->solid ? "box's volume"
               : known      ? "solid's volume"
                            : "integral of the winding number");
    putchar('\n');
}

/* A name as a shell reads it. */
static void print_name(const char *name)
{
    static const char plain[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
                                "._-/+,:@%";
    const char *folder = name[0] == '-' && name[1] ? "./" : ""; /* "-" is standard input */
    if (strspn(name, plain) == strlen(name)) {
        printf(" %s%s", folder, name);
        return;
    }
    printf(" '%s", folder);
    for (; *name; name++)
        if (*name == '\'')
            fputs("'\\''", stdout);
        else
            putchar(*name);
    putchar('\'');
}

static void print_next(const convert_told *t, const ebpo_info *info, const mesh_input *p)
{
    fputs("  next      ", stdout);
    if (p->doubts && t->repaired) {
        puts("--weld-distance where corners nearly coincide, or a mesh editor: no repair that is "
             "tried leaves a plausible solid");
        return;
    }
    fputs(p->doubts ? "ebpo check" : "ebpo verify", stdout);
    print_name(p->doubts ? t->piped ? "-" : t->in : t->out);
    if (!p->doubts && info->parts & EBPO_PART_MESH && !info->pruned && !t->piped) {
        fputs(" --against", stdout);
        print_name(t->in);
    }
    puts(p->doubts ? " (which repairs would make it a solid)" : " (whether all of it is there)");
}

/* --- JSON --- */

static void print_json(const convert_told *t, const mesh_input *p, const ebpo_info *info,
                       const ebpo_stored_sizes *stored, const progress_line *line,
                       const stage_facts *stages, double seconds)
{
    json j;
    ebpo_solid_volume before = mesh_input_solid(p, false);
    json_begin(&j, stdout);
    json_object(&j, NULL);
    facts_json(&j, t->out, info, stored, p->counted ? &p->shells : NULL);
    json_object(&j, "input");
    findings_json_source(&j, "mesh", &p->as_read, p->unread);
    findings_json(&j, "report", &p->prepared.before, &before);
    advice_json(&j, p);
    json_end(&j);
    json_real(&j, "seconds", seconds);
    stages_json(&j, line, stages);
    json_finish(&j);
}

ebpo_status convert_tell_file(const convert_told *t, const mesh_input *p, const progress_line *line,
                              const stage_facts *stages, double seconds, ebpo_error *error)
{
    if (t->quiet && !t->json)
        return EBPO_OK;
    ebpo_file *file = NULL;
    ebpo_stored_sizes stored = EBPO_STORED_SIZES_INIT;
    ebpo_status status = remote_open_own(t->out, &file, error);
    if (status == EBPO_OK)
        status = ebpo_file_locate(file, &stored, error);
    if (status == EBPO_OK && t->json) {
        print_json(t, p, ebpo_file_info(file), &stored, line, stages, seconds);
    } else if (status == EBPO_OK) {
        const ebpo_info *info = ebpo_file_info(file);
        ebpo_solid_volume solid = facts_solid(info, p->counted ? &p->shells : NULL);
        if (t->timings)
            stages_print(stdout, line, stages, seconds);
        print_what(t->out, info);
        print_sound(info, &solid, p);
        print_size(info, t->chosen, seconds);
        print_levels(info, &solid);
        print_next(t, info, p);
    }
    ebpo_close(file);
    return status;
}
