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
    double begin;
    json j;
} printer;

/* Returns a volume divided by the volume of the last level, which is 0 for a flat surface. */
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
    bool more = true;
    if (p->v->json)
        json_array(&p->j, "nodes");
    while ((status = ebpo_stream_next_node(stream, &node, &more, error)) == EBPO_OK && more) {
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

/* Prints all levels, and flushes the output after each level. If the output has been closed, stops
 * and sets *arrived to false. */
static ebpo_status report_levels(printer *p, ebpo_stream *stream, int last, bool *arrived,
                                 ebpo_error *error)
{
    ebpo_stream_level level;
    ebpo_status status = EBPO_OK;
    bool more = true;
    for (int i = 0; i <= last && status == EBPO_OK && *arrived; i++) {
        status = ebpo_stream_next_level(stream, &level, &more, error);
        if (status != EBPO_OK || !more)
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
        *arrived = command_flush("levels");
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
    printf("volume: of the envelopes, in the model's unit%s%s cubed; %% last: percent of the last "
           "level's volume;\nbytes: read for the level and those above; ms: since opening\n",
           info->unit[0] ? " " : "", info->unit);
    if (!isfinite(facts_volume(info, 0)))
        table_beyond(stdout);
}

/* --- the simplified surface --- */

/* Prints the patches that make the picture of a level, as ebpo_surface_select. */
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

static int level_of(uint64_t octcode)
{
    int level = 0;
    for (; octcode > 1; octcode >>= 3)
        level++;
    return level;
}

static ebpo_status print_surface(printer *p, const ebpo_file *file, int to, ebpo_error *error)
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
    for (int level = 0; level <= last && level <= to && status == EBPO_OK; level++) {
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

static ebpo_status stream_levels(printer *p, ebpo_file *file, const char *path, bool *arrived,
                                 ebpo_error *error)
{
    int last = p->info->level_count - 1;
    ebpo_stream_options wanted = EBPO_STREAM_OPTIONS_INIT;
    ebpo_stream *stream = NULL;
    wanted.planes = p->v->nodes;
    wanted.threads = (unsigned)p->v->threads;
    ebpo_status status = ebpo_stream_new(file, &wanted, &stream, error);
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
    int to = p->v->max_level >= 0 ? (int)p->v->max_level : last;
    ebpo_stream_prefetch(stream, to);
    status = report_levels(p, stream, to, arrived, error);
    if (p->v->json)
        json_end(&p->j);
    else if (status == EBPO_OK && *arrived)
        print_legend(p->info);
    if (status == EBPO_OK && *arrived && !p->v->nodes && p->info->parts & EBPO_PART_SURFACE)
        status = print_surface(p, file, to, error);
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
    bool has_level = command_has_level("levels", p.info, v->max_level), arrived = true;
    ebpo_status status =
        has_level ? stream_levels(&p, file, operand[0], &arrived, &error) : EBPO_OK;
    ebpo_close(file);
    if (!has_level)
        return EXIT_USAGE;
    if (!arrived)
        return EXIT_FAILED;
    return status == EBPO_OK ? EXIT_OK : command_failed("levels", &error);
}

const command command_levels = { &spec, sizeof standard, &standard, run_levels };
