/* ebpo export: writes levels and the model in formats of other programs. ebpo extract writes PLY.
 */
#include <inttypes.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "cli/command.h"
#include "cli/json.h"
#include "cli/process_memory.h"
#include "cli/progress.h"
#include "cli/remote_args.h"
#include "cli/tables.h"
#include "cli/words.h"
#include "cli/commands/commands.h"

typedef struct values {
    int format;
    int64_t level, triangles, threads;
    const char *levels, *memory;
    bool mesh, surface, tiles, json, quiet;
    bool to_deepest; /* --levels ends with '-': up to the last level of the file */
    remote_values remote;
} values;

static const char *const format_words[] = {
    "xdmf", "vtkhdf", "gltf", "glb", "obj", "stl", NULL
}; /* in the order of ebpo_export_format; EBPO_EXPORT_TILES has the option --tiles, and no word */

#include "cli/options/export.inc"

/* Sets v->format from the ending of the output's name, unless --format was given. Returns an exit
 * code. */
static int choose_format(values *v, const char *out)
{
    const char *dot = strrchr(out, '.');
    if (v->tiles && v->format >= 0)
        return command_usage("export", "--tiles and --format cannot be used together");
    if (v->tiles)
        v->format = EBPO_EXPORT_TILES;
    if (dot && strcasecmp(dot, ".ply") == 0 && v->format < 0)
        return command_usage("export", "PLY files are written by 'ebpo extract'");
    for (int i = 0; dot && v->format < 0 && format_words[i]; i++)
        if (strcasecmp(dot + 1, format_words[i]) == 0)
            v->format = i;
    return v->format >= 0
               ? EXIT_OK
               : command_usage("export",
                               "the output's extension is not that of a format; give --format");
}

/* Sets the options of an export of the simplified surface. */
static int choose_surface(const values *v, ebpo_export_options *o)
{
    if (v->tiles)
        return v->level >= 0 || v->levels || v->mesh || v->surface || v->triangles
                   ? command_usage("export", "--tiles exports everything; omit --level, --levels, "
                                             "--mesh, --surface and --triangles")
                   : EXIT_OK;
    if (v->levels || v->mesh || (v->level >= 0) == (v->triangles > 0))
        return command_usage("export", "--surface needs --level or --triangles, and nothing else");
    if (v->format != EBPO_EXPORT_GLB)
        return command_usage("export", "--surface is written as glb only");
    o->surface = true;
    o->triangles = (uint64_t)v->triangles;
    o->first_level = o->last_level = (int)v->level;
    return EXIT_OK;
}

/* Sets the levels to export. Returns an exit code. */
static int choose_levels(values *v, ebpo_export_options *o)
{
    word_levels levels;
    *o = (ebpo_export_options)EBPO_EXPORT_OPTIONS_INIT;
    o->mesh = v->mesh;
    if (v->tiles || v->surface)
        return choose_surface(v, o);
    if (v->triangles)
        return command_usage("export", "--triangles needs --surface");
    if (v->level < 0 && !v->levels && !v->mesh)
        return command_usage("export", "nothing to export; give --level, --levels or --mesh");
    if (v->level >= 0 && v->levels)
        return command_usage("export", "--level and --levels cannot be used together");
    if (v->level >= 0)
        o->first_level = o->last_level = (int)v->level;
    if (!v->levels)
        return EXIT_OK;
    if (!words_read_levels(v->levels, &levels))
        return command_usage("export", "--levels: '%s' is not " WORDS_LEVELS_EXPECTED, v->levels);
    if (!levels.is_contiguous)
        return command_usage("export", "--levels: '%s' omits levels; give a first and a last one",
                             v->levels);
    o->first_level = levels.first;
    o->last_level = levels.last;
    v->to_deepest = levels.to_end;
    return EXIT_OK;
}

/* Checks that no output overwrites the input. second: path of the second output, which some formats
 * have; "": none. */
static int check_names(const char *in, const char *out, const char *second)
{
    const char *names[] = { out, second };
    for (int i = 0; i < 2; i++)
        if (*names[i] && command_overwrites("export", in, names[i]))
            return EXIT_USAGE;
    return EXIT_OK;
}

/* --- output --- */

static void print_colours(const ebpo_export_report *r)
{
    const uint64_t result[2] = { r->vertex_colours, r->face_colours };
    for (int i = 0; i < 2; i++)
        if (result[i] != EBPO_EXPORT_NO_COLOURS)
            printf("colours of %s: %s\n", i ? "faces" : "vertices",
                   result[i] == EBPO_EXPORT_WRITTEN ? "written"
                   : i ? "omitted: this format has no colours of faces; xdmf and vtkhdf have them"
                       : "omitted: this format has no colours of vertices; other formats have "
                         "them");
}

/* Prints the statistics of the simplified surface that was written. */
static void print_surface(const values *v, const ebpo_export_report *r)
{
    char count[3][40], bytes[40];
    const ebpo_export_block *b = &r->block[0];
    words_bytes(bytes, sizeof bytes, r->bytes);
    if (v->tiles)
        printf("%s, %s, error up to %.3g\n",
               words_plural(count[0], sizeof count[0], r->tiles, "tile", "tiles"), bytes, r->error);
    else
        printf("surface: %s, %s, %s, %s, error %.3g\n",
               words_plural(count[0], sizeof count[0], b->nodes, "patch", "patches"),
               words_plural(count[1], sizeof count[1], b->vertices, "vertex", "vertices"),
               words_plural(count[2], sizeof count[2], b->triangles, "triangle", "triangles"),
               bytes, r->error);
    if (v->tiles && (r->origin[0] != 0 || r->origin[1] != 0 || r->origin[2] != 0))
        printf("vertices are relative to %.9g %.9g %.9g, the transform of the root tile\n",
               r->origin[0], r->origin[1], r->origin[2]);
    print_colours(r);
}

static void print_report(const values *v, const char *out, const char *second,
                         const ebpo_export_report *r)
{
    char count[3][40], volume[TABLE_CELL];
    printf("%s%s%s\n", out, *second ? ", " : "", second);
    if (v->tiles || v->surface) {
        print_surface(v, r);
        return;
    }
    for (int i = 0; i < r->block_count; i++) {
        const ebpo_export_block *b = &r->block[i];
        words_plural(count[0], sizeof count[0], b->vertices, "vertex", "vertices");
        words_plural(count[1], sizeof count[1], b->triangles, "triangle", "triangles");
        if (b->level < 0)
            printf("mesh: %s, %s\n", count[0], count[1]);
        else
            printf("level %d: %s, %s, %s, volume %s\n", b->level,
                   words_plural(count[2], sizeof count[2], b->nodes, "envelope", "envelopes"),
                   count[0], count[1], table_volume(volume, "%.9g", b->volume));
    }
    if (r->origin[0] != 0 || r->origin[1] != 0 || r->origin[2] != 0)
        printf("vertices are relative to %.9g %.9g %.9g, the nodes' translation\n", r->origin[0],
               r->origin[1], r->origin[2]);
    if (r->largest_change > 0)
        printf("float32: coordinates are rounded by up to %.3g\n", r->largest_change);
    print_colours(r);
}

static void json_block(json *j, const ebpo_export_block *b, bool surface)
{
    json_object(j, NULL);
    if (b->level < 0) {
        json_text(j, "block", "mesh");
    } else if (surface) {
        json_text(j, "block", "surface");
        json_int(j, "level", b->level);
        json_uint(j, "patches", b->nodes);
    } else {
        json_text(j, "block", "level");
        json_int(j, "level", b->level);
        json_uint(j, "envelopes", b->nodes);
        json_real(j, "volume", b->volume);
    }
    json_uint(j, "polygons", b->polygons);
    json_uint(j, "triangles", b->triangles);
    json_uint(j, "vertices", b->vertices);
    json_end(j);
}

static const char *const colour_words[] = { "none", "written", "left out" };

static void print_json(const values *v, const char *out, const char *second,
                       const ebpo_export_report *r, const traffic *t)
{
    json j;
    json_begin(&j, stdout);
    json_object(&j, NULL);
    json_text(&j, "format", ebpo_export_format_name((ebpo_export_format)v->format));
    json_array(&j, "files");
    json_text(&j, NULL, out);
    if (*second)
        json_text(&j, NULL, second);
    json_end(&j);
    json_array(&j, "blocks");
    for (int i = 0; i < r->block_count; i++)
        json_block(&j, &r->block[i], v->surface);
    json_end(&j);
    if (v->tiles)
        json_uint(&j, "tiles", r->tiles);
    if (v->tiles || v->surface) {
        json_uint(&j, "bytes", r->bytes);
        json_real(&j, "error", r->error);
    }
    json_reals(&j, "origin", r->origin, 3);
    json_real(&j, "largest_change", r->largest_change);
    json_text(&j, "vertex_colours", colour_words[r->vertex_colours]);
    json_text(&j, "face_colours", colour_words[r->face_colours]);
    remote_json(&j, t, &v->remote);
    json_finish(&j);
}

/* --- the command --- */

static int write_out(const values *v, const char *in, const char *out, const char *second,
                     ebpo_export_options *o)
{
    progress_line line;
    o->progress = progress_start(&line, "export", v->quiet);
    o->threads = (unsigned)v->threads;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_export_report report = EBPO_EXPORT_REPORT_INIT;
    ebpo_file *file = NULL;
    ebpo_status status = remote_open(&file, in, &v->remote, &error);
    if (status == EBPO_OK && v->to_deepest && o->first_level < ebpo_file_info(file)->level_count)
        o->last_level = ebpo_file_info(file)->level_count - 1;
    if (status == EBPO_OK && v->tiles) /* without faces, the finest tiles contain patches */
        o->mesh = ebpo_file_info(file)->parts & EBPO_PART_MESH;
    if (status == EBPO_OK)
        status = ebpo_export(file, out, (ebpo_export_format)v->format, o, &report, &error);
    progress_wipe(&line);
    if (status == EBPO_OK) {
        traffic t = traffic_of(file);
        if (v->json)
            print_json(v, out, second, &report, &t);
        else if (!v->quiet)
            print_report(v, out, second, &report);
        if (!v->json)
            remote_report(&t, &v->remote, false);
    }
    ebpo_close(file);
    return status == EBPO_OK ? EXIT_OK : command_failed("export", &error);
}

static const values standard = { .format = -1, .level = -1, .remote = REMOTE_VALUES_INIT };

static int run_export(void *given, const char **operand)
{
    values *v = given;
    char second[4096];
    ebpo_export_options o;
    int code = choose_format(v, operand[1]);
    if (code == EXIT_OK)
        code = choose_levels(v, &o);
    if (code == EXIT_OK && !process_memory_take("export", v->memory, v->threads))
        code = EXIT_USAGE;
    if (code != EXIT_OK)
        return code;
    if (!ebpo_export_second_file((ebpo_export_format)v->format, operand[1], second, sizeof second))
        return command_usage("export",
                             "the output's name is too long, contains a ':', which XDMF does not "
                             "allow, or ends with "
                             ".bin, as the second file of glTF does; choose another name");
    code = check_names(operand[0], operand[1], second);
    if (code != EXIT_OK)
        return code;
    if (!command_requires_hdf5("export", operand[0]))
        return EXIT_FAILED;
    return write_out(v, operand[0], operand[1], second, &o);
}

const command command_export = { &spec, sizeof standard, &standard, run_export };
