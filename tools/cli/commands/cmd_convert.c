/* ebpo convert: makes an .ebpo.h5 file from a mesh, and describes both. */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include <ebpo/file.h>

#include "cli/command.h"
#include "cli/commands/commands.h"
#include "cli/commands/convert_pieces.h"
#include "cli/commands/subset_run.h"
#include "cli/file_facts.h"
#include "cli/memory_args.h"
#include "cli/mesh_advice.h"
#include "cli/mesh_findings.h"
#include "cli/mesh_input.h"
#include "cli/progress.h"
#include "cli/remote_args.h"
#include "cli/selection_args.h"
#include "cli/stages.h"
#include "cli/standard_files.h"
#include "cli/subtree_args.h"
#include "cli/tables.h"
#include "cli/words.h"

/* --- reports of the mesh and of the file --- */

/* Facts about a conversion that the reports need, and the form of the reports. */
typedef struct convert_reported {
    const char *in;  /* the name of the mesh file in messages */
    const char *out; /* the path of the written file */
    bool piped;      /* the mesh came from standard input */
    bool json, quiet, timings;
    bool wants_surface;    /* --parts names the simplified surface */
    bool repair_requested; /* --repair was given */
    bool chosen;           /* the command chose the parts, to reach --target-size */
    bool by_groups;        /* convert_pieces.c reports warnings for each group instead */
} convert_reported;

/* Reports the mesh, and warnings on it. Call before the build, which empties the mesh. */
static void convert_report_mesh(const convert_reported *t, const mesh_input *p)
{
    ebpo_solid_volume before = mesh_input_solid(p, false), after = mesh_input_solid(p, true);
    if (!t->json && !t->quiet) {
        findings_print(stdout, t->in, &p->as_read, &p->prepared.before, &before, false);
        advice_print(stdout, p);
        findings_print_repair(stdout, &p->prepared.record);
        if (p->prepared.was_repaired)
            findings_print(stdout, NULL, &p->mesh, &p->prepared.report, &after, false);
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

/* --- the summary: five lines --- */

/* Prints the kind of the model (solid or surface), and the counts of the file. */
static void print_kind(const char *out, const ebpo_info *info)
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
    printf("  sound     yes: %s, %s; intersecting faces were not checked\n",
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
    subset_print_target(info, chosen);
    printf(", in %.1f s\n", seconds);
}

static void print_levels(const ebpo_info *info, const ebpo_solid_volume *solid)
{
    char first[TABLE_CELL], last[TABLE_CELL];
    int deepest = info->level_count - 1;
    bool known = findings_volume_known(solid);
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

/* Prints a blank and the name of a file, quoted for a shell if necessary. */
static void print_name(const char *name)
{
    static const char plain[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
                                "._-/+,:@%";
    /* Before a leading '-', "./" is printed, so that the name is not read as an option. "-" alone
     * is standard input. */
    const char *folder = name[0] == '-' && name[1] ? "./" : "";
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

/* Prints the command that the user may run next. */
static void print_next(const convert_reported *t, const ebpo_info *info, const mesh_input *p)
{
    fputs("  next      ", stdout);
    if (p->doubts && t->repair_requested) {
        puts("no automatic repair gives a solid; try --weld-distance if corners nearly coincide, "
             "or a mesh editor");
        return;
    }
    fputs(p->doubts ? "ebpo check" : "ebpo verify", stdout);
    print_name(p->doubts ? t->piped ? "-" : t->in : t->out);
    if (!p->doubts && info->parts & EBPO_PART_MESH && !info->pruned && !t->piped) {
        fputs(" --against", stdout);
        print_name(t->in);
    }
    puts(p->doubts ? " (finds repairs that make it a solid)"
                   : " (checks that the file is complete)");
}

/* --- JSON --- */

static void print_json(const convert_reported *t, const mesh_input *p, const ebpo_info *info,
                       const ebpo_stored_sizes *stored, const progress_line *line,
                       const stage_facts *stages, double seconds)
{
    json j;
    ebpo_solid_volume before = mesh_input_solid(p, false);
    json_begin(&j, stdout);
    json_object(&j, NULL);
    facts_json(&j, t->out, info, stored, p->shells_counted ? &p->shells : NULL);
    json_object(&j, "input");
    findings_json_source(&j, "mesh", &p->as_read, p->unread);
    findings_json(&j, "report", &p->prepared.before, &before);
    advice_json(&j, p);
    json_end(&j);
    json_real(&j, "seconds", seconds);
    stages_json(&j, line, stages);
    json_finish(&j);
}

/* Opens the written file, and reports its properties. */
static ebpo_status convert_report_file(const convert_reported *t, const mesh_input *p,
                                       const progress_line *line, const stage_facts *stages,
                                       double seconds, ebpo_error *error)
{
    if (t->quiet && !t->json && !t->wants_surface)
        return EBPO_OK;
    ebpo_file *file = NULL;
    ebpo_stored_sizes stored = EBPO_STORED_SIZES_INIT;
    ebpo_status status = remote_open_own(t->out, &file, error);
    if (status == EBPO_OK)
        status = ebpo_file_locate(file, &stored, error);
    if (status == EBPO_OK && t->json) {
        print_json(t, p, ebpo_file_info(file), &stored, line, stages, seconds);
    } else if (status == EBPO_OK && !t->quiet) {
        const ebpo_info *info = ebpo_file_info(file);
        ebpo_solid_volume solid = facts_solid(info, p->shells_counted ? &p->shells : NULL);
        if (t->timings)
            stages_print(stdout, line, stages, seconds);
        print_kind(t->out, info);
        print_sound(info, &solid, p);
        print_size(info, t->chosen, seconds);
        print_levels(info, &solid);
        print_next(t, info, p);
    }
    if (status == EBPO_OK && t->wants_surface && !(ebpo_file_info(file)->parts & EBPO_PART_SURFACE))
        fprintf(stderr, "ebpo convert: %s: note: no simplified surface was added: %s\n", t->out,
                facts_no_surface(ebpo_file_info(file)));
    ebpo_close(file);
    return status;
}

/* --- the command --- */

typedef struct values {
    int64_t max_level, leaf_faces, zstd_level, threads;
    double epsilon, percent, max_error;
    int select, normals;
    int64_t seed;
    const char *k_root, *target_size, *subtree_faces, *parts;
    memory_values memory;
    int codec, face_coding, rule, profile;
    repair_request repairs_wanted;
    bool require_solid, split_components, split_groups, embed_textures, timings, json, quiet;
    const char *unit, *crs, *date;
} values;

/* Parts that are stored if neither --parts nor --profile is given. */
#define DEFAULT_PARTS                                                            \
    (EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS | EBPO_PART_ATTRIBUTES | \
     EBPO_PART_COLOURS | EBPO_PART_BORDER)

#include "cli/options/convert.inc"

/* Returns the parts that the text of --parts selects, as bits, without the parts that need an
 * omitted part. */
static uint32_t listed_parts(const char *text)
{
    uint32_t parts = 0;
    if (!subset_read_parts(text, DEFAULT_PARTS, &parts))
        return 0;
    if (!(parts & EBPO_PART_MESH))
        parts &= ~(uint32_t)(EBPO_PART_MAPS | EBPO_PART_ATTRIBUTES | EBPO_PART_COLOURS |
                             EBPO_PART_BORDER | EBPO_PART_SURFACE);
    if (!(parts & EBPO_PART_ATTRIBUTES))
        parts &= ~(uint32_t)EBPO_PART_COLOURS;
    return parts;
}

static int check_parts(const values *v)
{
    uint32_t requested; /* parts in the list without a minus sign */
    if (!v->parts)
        return EXIT_OK;
    if (v->profile >= 0)
        return command_usage("convert", "--parts and --profile cannot be used together");
    if (!subset_read_parts(v->parts, 0, &requested))
        return command_usage("convert", "--parts: '%s' " SUBSET_PARTS_EXPECTED, v->parts);
    uint32_t parts = listed_parts(v->parts);
    if (requested & ~parts)
        return command_usage("convert",
                             "--parts: maps, attributes, colours, border and surface need "
                             "mesh, and colours need attributes; add them");
    if (v->embed_textures && !(parts & EBPO_PART_ATTRIBUTES))
        return command_usage("convert", "--embed-textures needs the parts mesh and attributes: "
                                        "textures are among the attributes");
    return EXIT_OK;
}

static int check_values(const values *v, const char *in, const char *out)
{
    selection_options chosen = { 1u << v->select, v->percent, v->epsilon,
                                 v->k_root,       v->normals, v->seed };
    int code = selection_check("convert", &chosen);
    if (code != EXIT_OK)
        return code;
    if (!memory_check("convert", &v->memory) ||
        repair_check("convert", v->repairs_wanted) != EXIT_OK)
        return EXIT_USAGE;
    if (v->zstd_level && v->codec != EBPO_CODEC_ZSTD)
        return command_usage("convert", "--zstd-level does not apply to --codec deflate or none");
    if (check_parts(v) != EXIT_OK)
        return EXIT_USAGE;
    if (v->split_components && v->split_groups)
        return command_usage("convert",
                             "--split-components and --split-groups cannot be used together");
    if (v->split_groups && (v->repairs_wanted.fill_holes || v->repairs_wanted.repair))
        return command_usage("convert",
                             "--fill-holes and --repair cannot be used with --split-groups: "
                             "faces that they add are in no group");
    if (v->date && !ebpo_is_date(v->date))
        return command_usage("convert", "--date '%s': expected " WORDS_DATE_EXPECTED, v->date);
    uint64_t subtree_faces;
    if (!subtree_faces_read("convert", v->subtree_faces, &subtree_faces) ||
        command_overwrites("convert", in, out))
        return EXIT_USAGE;
    return EXIT_OK;
}

static bool selects_levels(const values *v) { return v->max_error > 0 || v->target_size; }

static int check_target(const values *v, ebpo_subset_options *target)
{
    int code = subset_read_target("convert", v->max_error, v->target_size, target);
    if (code == EXIT_OK && selects_levels(v) && v->parts &&
        !(listed_parts(v->parts) & EBPO_PART_MESH))
        return command_usage("convert", "--max-error and --target-size measure against the mesh, "
                                        "which --parts omits; use --profile lod instead");
    return code;
}

/* Returns true if the command chooses the parts, to reach --target-size. */
static bool chooses_parts(const values *v) { return v->target_size && v->profile < 0 && !v->parts; }

/* Returns the parts to build. With --profile or chosen parts, the command builds all parts and then
 * writes some of them. So the output equals the output of `ebpo subset` for a file with all parts.
 */
static uint32_t parts_of(const values *v)
{
    if (v->profile >= 0 || chooses_parts(v))
        return ebpo_profile_parts(EBPO_PROFILE_FULL);
    return v->parts ? listed_parts(v->parts) : DEFAULT_PARTS;
}

static mesh_reading reading_of(const values *v)
{
    return !(parts_of(v) & EBPO_PART_ATTRIBUTES) ? READ_MESH
           : v->embed_textures                   ? READ_TEXTURES
                                                 : READ_ATTRIBUTES;
}

static convert_reported reported_of(const values *v, const char *in, const char *out)
{
    const char *shown = standard_files_shown(in);
    return (convert_reported){ .in = shown,
                               .piped = shown != in,
                               .out = out,
                               .json = v->json,
                               .quiet = v->quiet,
                               .wants_surface =
                                   v->parts && listed_parts(v->parts) & EBPO_PART_SURFACE,
                               .timings = v->timings,
                               .repair_requested = v->repairs_wanted.repair,
                               .chosen = chooses_parts(v),
                               .by_groups = v->split_groups };
}

/* --- work --- */

/* Fails if there is not enough memory for the step after the build that selects levels (--max-error
 * and --target-size). Call before the build, which may take long. */
static ebpo_status check_selection_memory(const values *v, uint64_t faces, const char *in,
                                          const ebpo_workspace *workspace, ebpo_error *error)
{
    ebpo_workspace_stats stats = EBPO_WORKSPACE_STATS_INIT;
    uint64_t needed = ebpo_subset_memory(faces, (uint32_t)v->leaf_faces);
    char bytes[32], budget[32];
    ebpo_workspace_get_stats(workspace, &stats);
    if (needed <= stats.memory)
        return EBPO_OK;
    error->status = EBPO_E_LIMIT;
    snprintf(error->message, sizeof error->message,
             "%s: --max-error and --target-size measure with the whole model in memory, about "
             "%s, but the budget is %s; allow more with --memory, or omit them here and use "
             "'ebpo subset' on a machine with more memory",
             in, words_bytes(bytes, sizeof bytes, needed),
             words_bytes(budget, sizeof budget, stats.memory));
    return EBPO_E_LIMIT;
}

/* Builds the tree and writes the file. Empties the mesh of `p`. target: the requested error bound
 * or file size. */
static ebpo_status build_and_write(const values *v, mesh_input *p, const char *out,
                                   const ebpo_subset_options *target, ebpo_progress progress,
                                   ebpo_build_times *times, ebpo_error *error)
{
    ebpo_build_options build = EBPO_BUILD_OPTIONS_INIT;
    build.max_level = (int)v->max_level;
    build.leaf_faces = (uint32_t)v->leaf_faces;
    build.epsilon = v->epsilon >= 0 ? v->epsilon : build.epsilon;
    build.select = (ebpo_selection)v->select;
    build.percent = v->percent >= 0 ? v->percent : build.percent;
    build.normals = v->normals >= 0 ? (ebpo_normal_distance)v->normals : build.normals;
    build.seed = v->seed >= 0 ? (uint64_t)v->seed : build.seed;
    build.parts = parts_of(v);
    build.rule = (ebpo_rule)v->rule;
    build.require_solid = v->require_solid;
    build.threads = (unsigned)v->threads;
    build.unit = v->unit;
    build.crs = v->crs;
    build.date = v->date;
    build.progress = progress;
    build.times = times;
    ebpo_tree tree;
    ebpo_status status = selection_k_root(v->k_root, p->mesh.face_count, &build.k_root, error);
    if (status != EBPO_OK) {
        ebpo_mesh_free(&p->mesh);
        return status;
    }
    status = ebpo_build(&p->mesh, &p->prepared.report, &p->prepared.record, &build, &tree, error);
    if (status != EBPO_OK)
        return status;
    ebpo_write_options write = EBPO_WRITE_OPTIONS_INIT;
    write.codec = (ebpo_codec)v->codec;
    write.codec_level = (int)v->zstd_level;
    write.threads = (unsigned)v->threads;
    write.face_coding = (ebpo_face_coding)v->face_coding;
    write.progress = progress;
    (void)subtree_faces_read("convert", v->subtree_faces, &write.subtree_faces);
    if (target->max_error > 0 || target->target_bytes) {
        ebpo_subset_options subset = *target;
        subset.codec = write.codec;
        subset.codec_level = write.codec_level;
        subset.threads = write.threads;
        subset.progress = progress;
        subset.subtree_faces = write.subtree_faces;
        subset.face_coding = write.face_coding;
        subset.choose_parts = chooses_parts(v);
        if (v->profile >= 0)
            subset.parts = ebpo_profile_parts((ebpo_profile)v->profile);
        return ebpo_subset_of_tree(&tree, out, &subset, error);
    }
    if (v->profile >= 0)
        write.parts = ebpo_profile_parts((ebpo_profile)v->profile);
    status = ebpo_tree_write(&tree, out, &write, error);
    ebpo_tree_free(&tree);
    return status;
}

/* Data for the functions that build one piece of a split mesh. */
typedef struct piece_build {
    const values *v;
    const ebpo_subset_options *target; /* as in build_and_write */
    const char *in;                    /* path of the whole mesh, for messages */
    const ebpo_workspace *workspace;
} piece_build;

static ebpo_status piece_fits(void *user, uint64_t faces, ebpo_error *error)
{
    const piece_build *b = user;
    return selects_levels(b->v) ? check_selection_memory(b->v, faces, b->in, b->workspace, error)
                                : EBPO_OK;
}

static ebpo_status build_piece(void *user, mesh_input *part, const char *path,
                               ebpo_progress progress, ebpo_error *error)
{
    const piece_build *b = user;
    ebpo_build_times times = EBPO_BUILD_TIMES_INIT;
    return build_and_write(b->v, part, path, b->target, progress, &times, error);
}

static bool splits_mesh(const values *v) { return v->split_components || v->split_groups; }

static ebpo_status build_pieces(piece_build *build, mesh_input *p, const char *folder,
                                const ebpo_mesh_groups *groups, progress_line *line,
                                ebpo_progress progress, double begun, ebpo_error *error)
{
    const values *v = build->v;
    pieces_run run = { .build = build_piece,
                       .fits = piece_fits,
                       .user = build,
                       .groups = groups,
                       .folder = folder,
                       .unit = v->unit,
                       .json = v->json,
                       .quiet = v->quiet,
                       .threads = (unsigned)v->threads,
                       .line = line,
                       .progress = progress };
    return pieces_write(&run, p, begun, error);
}

/* Returns the facts from which the stages are planned. These facts follow from the options; the
 * members `faces` and `times` are set after the build. */
static stage_facts plan_stages(const values *v, const char *in)
{
    const char *dot = strrchr(in, '.');
    return (stage_facts){ .may_repair =
                              v->repairs_wanted.weld || v->repairs_wanted.weld_distance > 0 ||
                              v->repairs_wanted.drop_duplicates || v->repairs_wanted.orient ||
                              v->repairs_wanted.flip || v->repairs_wanted.fill_holes ||
                              v->repairs_wanted.repair || (dot && strcasecmp(dot, ".stl") == 0),
                          .solid = true,
                          .from_leaves =
                              ebpo_selection_describe((ebpo_selection)v->select)->from_leaves,
                          .selected = selects_levels(v),
                          .leaf_planes = parts_of(v) & EBPO_PART_LEAF_PLANES,
                          .times = EBPO_BUILD_TIMES_INIT };
}

static const values standard = { .max_level = -1,
                                 .profile = -1,
                                 .leaf_faces = -1,
                                 .epsilon = -1,
                                 .percent = -1,
                                 .normals = -1,
                                 .seed = -1 };

/* Fails if --require-solid forbids the build, or if there is not enough memory. */
static ebpo_status refuse_mesh(const values *v, const mesh_input *p, const char *in,
                               const ebpo_workspace *workspace, ebpo_error *error)
{
    if (v->require_solid && !v->split_groups && p->doubts) {
        snprintf(error->message, sizeof error->message,
                 "%s: is %s, and --require-solid was given; nothing was written", in,
                 p->doubts & EBPO_DOUBT_OPEN ? "not a solid" : "probably not the intended solid");
        return error->status = EBPO_E_NOT_SOLID;
    }
    return selects_levels(v) && !splits_mesh(v)
               ? check_selection_memory(v, p->mesh.face_count, in, workspace, error)
               : EBPO_OK;
}

static ebpo_status no_groups(const char *in, ebpo_error *error)
{
    error->status = EBPO_E_FORMAT;
    snprintf(error->message, sizeof error->message,
             "%s: has no groups, which are lines g or o of an OBJ file; use --split-components to "
             "split it into components that share no vertices",
             in);
    return error->status;
}

static ebpo_status convert_mesh(const values *v, const char *in, const char *out,
                                const ebpo_subset_options *target, ebpo_workspace *workspace,
                                ebpo_error *error)
{
    progress_line line;
    ebpo_progress progress = progress_start(&line, "convert", v->quiet);
    stage_facts stages = plan_stages(v, in);
    int plan[STAGE_PLAN_MAX];
    mesh_input p = { .mesh = { 0 } };
    ebpo_mesh_groups *groups = NULL;
    if (!splits_mesh(v))
        progress_plan(&line, plan, stages_plan(&stages, plan), &p.as_read.face_count);
    double begun = progress_now();
    ebpo_status status = mesh_input_read_groups(&p, in, v->repairs_wanted, reading_of(v),
                                                v->split_groups ? &groups : NULL, workspace,
                                                (unsigned)v->threads, progress, error);
    progress_wipe(&line);
    if (status != EBPO_OK)
        return status;
    p.rule = (ebpo_rule)v->rule;
    convert_reported reported = reported_of(v, in, out);
    convert_report_mesh(&reported, &p);
    status = refuse_mesh(v, &p, in, workspace, error);
    if (status == EBPO_OK && v->split_groups && !groups)
        status = no_groups(in, error);
    if (status == EBPO_OK && splits_mesh(v)) {
        piece_build build = { v, target, in, workspace };
        status = build_pieces(&build, &p, out, groups, &line, progress, begun, error);
        ebpo_mesh_groups_free(groups);
        progress_wipe(&line);
        return status;
    }
    ebpo_mesh_groups_free(groups);
    if (status == EBPO_OK)
        status = build_and_write(v, &p, out, target, progress, &stages.times, error);
    else
        ebpo_mesh_free(&p.mesh);
    progress_wipe(&line);
    progress_end_stage(&line);
    stages_split(&line, &stages.times);
    stages.faces = p.as_read.face_count;
    return status == EBPO_OK
               ? convert_report_file(&reported, &p, &line, &stages, progress_now() - begun, error)
               : status;
}

static int run_convert(void *given, const char **operand)
{
    const ebpo_build_options defaults = EBPO_BUILD_OPTIONS_INIT;
    ebpo_subset_options target = EBPO_SUBSET_OPTIONS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_workspace *workspace = NULL;
    values *v = given;
    if (v->leaf_faces < 0)
        v->leaf_faces = defaults.leaf_faces;
    int code = check_values(v, operand[0], operand[1]);
    if (code == EXIT_OK)
        code = check_target(v, &target);
    if (code != EXIT_OK)
        return code;
    ebpo_status status = splits_mesh(v) ? pieces_begin(operand[1], v->split_groups, &error)
                                        : ebpo_check_output(operand[1], &error);
    if (status == EBPO_OK)
        status = memory_new(&workspace, &v->memory, &error);
    if (status == EBPO_OK)
        status = convert_mesh(v, operand[0], operand[1], &target, workspace, &error);
    ebpo_workspace_free(workspace);
    pieces_end();
    return status == EBPO_OK ? EXIT_OK : command_failed("convert", &error);
}

const command command_convert = { &spec, sizeof standard, &standard, run_convert };
