/* ebpo levels: prints the levels as they arrive, coarse to fine. */
#include <inttypes.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

#include <ebpo/lod.h>
#include <ebpo/stream.h>

#include "cli/command.h"
#include "cli/file_facts.h"
#include "cli/json.h"
#include "cli/process_memory.h"
#include "cli/progress.h"
#include "cli/remote_args.h"
#include "cli/tables.h"
#include "cli/words.h"
#include "cli/commands/commands.h"

typedef struct values {
    int64_t max_level, threads;
    const char *memory;
    bool nodes, json;
    remote_values remote;
} values;

#include "cli/options/levels.inc"

typedef struct printer {
    const values *v;
    const ebpo_info *info;
    double begin; /* when the file was opened, see progress_now */
    json j;       /* used with --json */
} printer;

/* Returns a volume in percent of the last level's volume, or 100 if the last level's volume is 0,
 * as that of a flat surface. NAN: not known. */
static double volume_share(const printer *p, double volume)
{
    double last = facts_volume(p->info, p->info->level_count - 1);
    return !isfinite(last) ? NAN : last > 0 ? 100 * volume / last : 100;
}

/* --- one level --- */

static void print_level(const printer *p, const ebpo_stream_level *level, double ms)
{
    const ebpo_level_summary *s = &p->info->level[level->level];
    char volume[TABLE_CELL], percent[TABLE_CELL];
    printf("%5d %9" PRIu64 " %9" PRIu64 " %9" PRIu64 " %9" PRIu64 " %10" PRIu64
           " %16s %9s %12" PRIu64 " %9.2f\n",
           level->level, s->gray_count, s->leaf_count, facts_white(p->info, level->level),
           s->black_count, s->plane_count + s->leaf_plane_count,
           table_cell(volume, "%.10g", level->volume),
           table_cell(percent, "%.2f", volume_share(p, level->volume)), level->cumulative_bytes,
           ms);
}

static void begin_json_level(printer *p, const ebpo_stream_level *level, double ms)
{
    const ebpo_level_summary *s = &p->info->level[level->level];
    json_object(&p->j, NULL);
    json_int(&p->j, "level", level->level);
    json_uint(&p->j, "gray", s->gray_count);
    json_uint(&p->j, "leaf", s->leaf_count);
    json_uint(&p->j, "white", facts_white(p->info, level->level));
    json_uint(&p->j, "black", s->black_count);
    json_uint(&p->j, "planes", s->plane_count);
    json_uint(&p->j, "leaf_planes", s->leaf_plane_count);
    json_real(&p->j, "volume", level->volume);
    json_real(&p->j, "percent_of_last", volume_share(p, level->volume));
    json_uint(&p->j, "cumulative_bytes", level->cumulative_bytes);
    json_real(&p->j, "ms", ms);
}

/* --- one node --- */

static void print_node(const ebpo_stream_node *n)
{
    char colour[8];
    printf("%" PRIu64 " %s ", n->octcode, words_node_type(n->type));
    words_print_reals(n->min, 3, " ");
    putchar(' ');
    words_print_reals(n->max, 3, " ");
    printf(" %d %" PRIu32, (int)n->winding, n->plane_count);
    for (uint32_t i = 0; i < n->plane_count; i++) {
        putchar(' ');
        words_print_reals(n->planes[i], 4, " ");
    }
    if (n->coloured)
        printf(" %s", words_colour(colour, n->colour));
    putchar('\n');
}

static void json_node(json *j, const ebpo_stream_node *n)
{
    char colour[8];
    json_object(j, NULL);
    json_uint(j, "octcode", n->octcode);
    json_text(j, "type", words_node_type(n->type));
    json_reals(j, "min", n->min, 3);
    json_reals(j, "max", n->max, 3);
    json_int(j, "winding", n->winding);
    if (n->coloured)
        json_text(j, "colour", words_colour(colour, n->colour));
    json_array(j, "planes");
    for (uint32_t i = 0; i < n->plane_count; i++)
        json_reals(j, NULL, n->planes[i], 4);
    json_end(j);
    json_end(j);
}

static ebpo_status report_nodes(printer *p, ebpo_stream *stream, ebpo_error *error)
{
    ebpo_stream_node node;
    ebpo_status status;
    bool has_more = true;
    if (p->v->json)
        json_array(&p->j, "nodes");
    while ((status = ebpo_stream_next_node(stream, &node, &has_more, error)) == EBPO_OK &&
           has_more) {
        if (p->v->json)
            json_node(&p->j, &node);
        else
            print_node(&node);
    }
    if (p->v->json)
        json_end(&p->j);
    return status;
}

/* --- all levels --- */

/* Prints all levels, and flushes the output after each level. If the output cannot be written,
 * stops and sets *accepted to false. */
static ebpo_status report_levels(printer *p, ebpo_stream *stream, int last, bool *accepted,
                                 ebpo_error *error)
{
    ebpo_stream_level level;
    ebpo_status status = EBPO_OK;
    bool has_more = true;
    for (int i = 0; i <= last && status == EBPO_OK && *accepted; i++) {
        status = ebpo_stream_next_level(stream, &level, &has_more, error);
        if (status != EBPO_OK || !has_more)
            break;
        double ms = (progress_now() - p->begin) * 1e3;
        if (p->v->json)
            begin_json_level(p, &level, ms);
        else
            print_level(p, &level, ms);
        if (p->v->nodes)
            status = report_nodes(p, stream, error);
        if (p->v->json)
            json_end(&p->j);
        *accepted = command_flush("levels");
    }
    return status;
}

static void print_head(const char *path, const ebpo_info *info)
{
    char levels[32];
    printf("%s: %s, %s\n", path, info->solid ? "a solid" : "a surface",
           words_plural(levels, sizeof levels, (uint64_t)info->level_count, "level", "levels"));
    printf("%5s %9s %9s %9s %9s %10s %16s %9s %12s %9s\n", "level", "gray", "leaf", "white",
           "black", "planes", "volume", "% last", "bytes", "ms");
}

static void print_legend(const ebpo_info *info)
{
    table_legend(stdout);
    printf(
        "volume: of the envelopes, in the model's unit%s%s cubed; %% last: percent of the last "
        "level's volume;\nbytes: read for the level and the levels above it; ms: since opening\n",
        info->unit[0] ? " " : "", info->unit);
    if (!isfinite(facts_volume(info, 0)))
        table_beyond(stdout);
}

/* --- the simplified surface --- */

/* Prints the count, the triangles and the error bound of `patches`, which ebpo_surface_select chose
 * for a level. */
static void print_patches(printer *p, const ebpo_surface *s, int level, const uint64_t *patches,
                          uint64_t count)
{
    uint64_t triangles = 0, error = 0;
    for (uint64_t i = 0; i < count; i++) {
        const uint64_t *row = s->patch + EBPO_PATCH_COLUMNS * patches[i];
        triangles += row[EBPO_PATCH_TRIANGLES];
        error = row[EBPO_PATCH_ERROR] > error ? row[EBPO_PATCH_ERROR] : error;
    }
    const double *size = p->info->box_size;
    double bound = ldexp((double)error, -32) * fmax(size[0], fmax(size[1], size[2]));
    if (p->v->json) {
        json_object(&p->j, NULL);
        json_int(&p->j, "level", level);
        json_uint(&p->j, "patches", count);
        json_uint(&p->j, "triangles", triangles);
        json_real(&p->j, "error", bound);
        json_end(&p->j);
    } else {
        printf("%5d %9" PRIu64 " %9" PRIu64 " %12.4g\n", level, count, triangles, bound);
    }
}

/* Returns the level of a node. The root, on level 0, has octcode 1; each level adds three bits. */
static int level_of(uint64_t octcode)
{
    int level = 0;
    for (; octcode > 1; octcode >>= 3)
        level++;
    return level;
}

static ebpo_status print_surface(printer *p, const ebpo_file *file, int last_level,
                                 ebpo_error *error)
{
    ebpo_surface s;
    ebpo_status status = ebpo_file_read_patches(file, &s, error);
    if (status != EBPO_OK)
        return status;
    int last = level_of(s.patch[EBPO_PATCH_COLUMNS * (s.patch_count - 1) + EBPO_PATCH_OCTCODE]);
    if (p->v->json)
        json_array(&p->j, "surface");
    else
        puts("simplified surface; error: largest distance from the model, in its unit\n"
             "level   patches triangles        error");
    for (int level = 0; level <= last && level <= last_level && status == EBPO_OK; level++) {
        uint64_t *patches = NULL, count = 0;
        status = ebpo_surface_select(&s, level, &patches, &count, error);
        if (status == EBPO_OK)
            print_patches(p, &s, level, patches, count);
        free(patches);
    }
    if (p->v->json)
        json_end(&p->j);
    ebpo_surface_free(&s);
    return status;
}

static ebpo_status stream_levels(printer *p, ebpo_file *file, const char *path, bool *accepted,
                                 ebpo_error *error)
{
    int last = p->info->level_count - 1;
    ebpo_stream_options stream_options = EBPO_STREAM_OPTIONS_INIT;
    ebpo_stream *stream = NULL;
    stream_options.planes = p->v->nodes;
    stream_options.threads = (unsigned)p->v->threads;
    ebpo_status status = ebpo_stream_new(file, &stream_options, &stream, error);
    if (status != EBPO_OK)
        return status;
    if (p->v->json) {
        json_begin(&p->j, stdout);
        json_object(&p->j, NULL);
        json_text(&p->j, "file", remote_shown(path));
        json_array(&p->j, "levels");
    } else {
        print_head(remote_shown(path), p->info);
    }
    int last_level = p->v->max_level >= 0 ? (int)p->v->max_level : last;
    ebpo_stream_prefetch(stream, last_level);
    status = report_levels(p, stream, last_level, accepted, error);
    if (p->v->json)
        json_end(&p->j);
    else if (status == EBPO_OK && *accepted)
        print_legend(p->info);
    if (status == EBPO_OK && *accepted && !p->v->nodes && p->info->parts & EBPO_PART_SURFACE)
        status = print_surface(p, file, last_level, error);
    traffic t = traffic_of(file);
    if (p->v->json) {
        remote_json(&p->j, &t, &p->v->remote);
        json_finish(&p->j);
    } else {
        remote_report(&t, &p->v->remote, false);
    }
    ebpo_stream_free(stream);
    return status;
}

static const values standard = { .max_level = -1, .remote = REMOTE_VALUES_INIT };

static int run_levels(void *given, const char **operand)
{
    values *v = given;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    printer p = { .v = v, .begin = progress_now() };
    if (!process_memory_take("levels", v->memory, v->threads))
        return EXIT_USAGE;
    if (!command_requires_hdf5("levels", operand[0]))
        return EXIT_FAILED;
    if (remote_open(&file, operand[0], &v->remote, &error) != EBPO_OK)
        return command_failed("levels", &error);
    p.info = ebpo_file_info(file);
    bool has_level = command_has_level("levels", p.info, v->max_level), accepted = true;
    ebpo_status status =
        has_level ? stream_levels(&p, file, operand[0], &accepted, &error) : EBPO_OK;
    ebpo_close(file);
    if (!has_level)
        return EXIT_USAGE;
    if (!accepted)
        return EXIT_FAILED;
    return status == EBPO_OK ? EXIT_OK : command_failed("levels", &error);
}

const command command_levels = { &spec, sizeof standard, &standard, run_levels };
