/* ebpo view: prints nodes in the order of their importance for an observer, within a budget. */
#include <inttypes.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

#include <ebpo/view.h>

#include "cli/command.h"
#include "cli/json.h"
#include "cli/progress.h"
#include "cli/remote_args.h"
#include "cli/tables.h"
#include "cli/words.h"
#include "cli/commands/commands.h"
#include "cli/render/cut_mesh.h"

typedef struct values {
    int order;
    const char *eye, *look, *up, *size, *bytes, *memory, *out;
    double fov, pixels, distance;
    int64_t max_level, count;
    bool seen_only, nodes, json;
    remote_values remote;
} values;

static const char *const order_words[] = { "level", "distance", "pixels", "front-to-back", NULL };

#include "cli/options/view.inc"

static const char *const end_names[] = { "", "done", "bytes", "nodes" }; /* by ebpo_view_end */

typedef struct printer {
    const values *v;
    double begin; /* when the command began, see progress_now */
    json j;       /* used with --json */
} printer;

/* --- options --- */

static int check_values(const values *v)
{
    if (!v->eye && (v->order > EBPO_PRIORITY_LEVEL || v->look || v->fov > 0 || v->size ||
                    v->pixels > 0 || v->distance >= 0))
        return command_usage("view", "--look, --fov, --size, --pixels, --distance, and --order "
                                     "with another value than level need --eye X,Y,Z");
    if (!v->look && (v->up || v->seen_only))
        return command_usage(
            "view",
            "--up and --seen-only need --look X,Y,Z: without it the observer looks all around");
    return EXIT_OK;
}

static bool read_triple(const char *name, const char *text, double out[3])
{
    char extra;
    if (sscanf(text, "%lf,%lf,%lf%c", &out[0], &out[1], &out[2], &extra) == 3 && isfinite(out[0]) &&
        isfinite(out[1]) && isfinite(out[2]))
        return true;
    command_usage("view", "--%s: '%s' is not three numbers separated by commas", name, text);
    return false;
}

static bool read_budget(const char *name, const char *text, uint64_t *out)
{
    if (!text || (words_read_size(text, out) && *out))
        return true;
    command_usage("view", "--%s: '%s' is not " WORDS_SIZE_EXPECTED, name, text);
    return false;
}

static bool read_observer(const values *v, ebpo_observer *o)
{
    double look[3];
    char extra;
    if (!read_triple("eye", v->eye, o->eye) || (v->look && !read_triple("look", v->look, look)) ||
        (v->up && !read_triple("up", v->up, o->up)))
        return false;
    for (int k = 0; k < 3 && v->look; k++)
        o->direction[k] = look[k] - o->eye[k];
    if (v->look && o->direction[0] == 0 && o->direction[1] == 0 && o->direction[2] == 0) {
        fprintf(stderr, "ebpo view: --look and --eye are the same point; choose another --look\n");
        return false;
    }
    if (v->fov > 0)
        o->fov = v->fov;
    if (v->size &&
        (sscanf(v->size, "%9" SCNu32 "x%9" SCNu32 "%c", &o->width, &o->height, &extra) != 2 ||
         !o->width || !o->height)) {
        command_usage("view", "--size: '%s' is not WIDTHxHEIGHT in pixels, such as 1920x1080",
                      v->size);
        return false;
    }
    return true;
}

static bool read_options(const values *v, ebpo_view_options *o, ebpo_observer *observer)
{
    o->priority = v->order >= 0 ? (ebpo_priority)v->order
                  : v->eye      ? EBPO_PRIORITY_PIXELS
                                : EBPO_PRIORITY_LEVEL;
    o->observer = v->eye ? observer : NULL;
    o->unseen = v->seen_only ? EBPO_UNSEEN_NEVER : EBPO_UNSEEN_LAST;
    o->pixels = v->pixels > 0 ? v->pixels : 0;
    o->distance = v->distance >= 0 ? v->distance : INFINITY;
    o->level = (int)v->max_level;
    o->nodes = v->count > 0 ? (uint64_t)v->count : 0;
    o->polygons = v->out != NULL;
    o->windings = v->nodes;
    return read_budget("bytes", v->bytes, &o->bytes) &&
           read_budget("memory", v->memory, &o->memory) && (!v->eye || read_observer(v, observer));
}

/* --- printing --- */

/* Prints the statistics of the stream so far. `key`: key of the JSON object; NULL: the object is an
 * element of an array. */
static void print_row(printer *p, const ebpo_view_stream *stream, const char *key)
{
    ebpo_view_stats s = EBPO_VIEW_STATS_INIT;
    ebpo_view_stream_get_stats(stream, &s);
    double ms = (progress_now() - p->begin) * 1e3;
    char pixels[TABLE_CELL];
    if (!p->v->json) {
        printf("%12" PRIu64 " %10" PRIu64 " %9" PRIu64 " %9" PRIu64 " %9" PRIu64 " %9" PRIu64
               " %9" PRIu64 " %10s %9.2f\n",
               s.bytes_read, s.nodes, s.cut[EBPO_GRAY], s.cut[EBPO_LEAF], s.cut[EBPO_WHITE],
               s.cut[EBPO_BLACK], s.waiting, table_cell(pixels, "%.5g", s.pixels), ms);
        return;
    }
    json_object(&p->j, key);
    json_uint(&p->j, "bytes_read", s.bytes_read);
    json_uint(&p->j, "nodes", s.nodes);
    json_uint(&p->j, "gray", s.cut[EBPO_GRAY]);
    json_uint(&p->j, "leaf", s.cut[EBPO_LEAF]);
    json_uint(&p->j, "white", s.cut[EBPO_WHITE]);
    json_uint(&p->j, "black", s.cut[EBPO_BLACK]);
    json_uint(&p->j, "waiting", s.waiting);
    json_real(&p->j, "pixels", s.pixels);
    json_real(&p->j, "ms", ms);
    json_end(&p->j);
}

static void print_line(const ebpo_view_node *v)
{
    const ebpo_stream_node *n = &v->node;
    printf("%" PRIu64 " %s ", n->octcode, words_node_type(n->type));
    words_print_reals(n->min, 3, " ");
    putchar(' ');
    words_print_reals(n->max, 3, " ");
    printf(" %d ", (int)n->winding);
    words_print_reals((const double[]){ v->distance, v->pixels }, 2, " ");
    printf(" %d %d %" PRIu32, v->seen, v->complete, n->plane_count);
    for (uint32_t i = 0; i < n->plane_count; i++) {
        putchar(' ');
        words_print_reals(n->planes[i], 4, " ");
    }
    putchar('\n');
}

static void print_node(printer *p, const ebpo_view_node *v)
{
    const ebpo_stream_node *n = &v->node;
    if (!p->v->json) {
        print_line(v);
        return;
    }
    json_object(&p->j, NULL);
    json_uint(&p->j, "octcode", n->octcode);
    json_text(&p->j, "type", words_node_type(n->type));
    json_reals(&p->j, "min", n->min, 3);
    json_reals(&p->j, "max", n->max, 3);
    json_int(&p->j, "winding", n->winding);
    json_real(&p->j, "distance", v->distance);
    json_real(&p->j, "pixels", v->pixels);
    json_bool(&p->j, "seen", v->seen);
    json_bool(&p->j, "complete", v->complete);
    json_array(&p->j, "planes");
    for (uint32_t i = 0; i < n->plane_count; i++)
        json_reals(&p->j, NULL, n->planes[i], 4);
    json_end(&p->j);
    json_end(&p->j);
}

static void print_legend(void)
{
    table_legend(stdout);
    puts("waiting: number of gray nodes to divide next; pixels: size of the largest visible one\n"
         "(shown as - if there is no --eye); bytes: read from the file; ms: since opening");
}

/* --- streaming --- */

/* Takes nodes from the stream until it ends. With --nodes, prints each node; otherwise prints a row
 * of statistics each time the number of nodes has doubled. If the output cannot be written, stops
 * and sets *accepted to false. */
static ebpo_status report_nodes(printer *p, ebpo_view_stream *stream, ebpo_view_end *end,
                                bool *accepted, ebpo_error *error)
{
    ebpo_view_node node;
    ebpo_status status;
    uint64_t count = 0, next_row = 1;
    while (*accepted && (status = ebpo_view_stream_next(stream, &node, end, error)) == EBPO_OK &&
           *end == EBPO_VIEW_NODE) {
        count++;
        if (p->v->nodes)
            print_node(p, &node);
        if (!node.complete || count < next_row)
            continue;
        if (!p->v->nodes)
            print_row(p, stream, NULL);
        next_row = 2 * count;
        *accepted = command_flush("view");
    }
    return *accepted ? status : EBPO_OK;
}

static ebpo_status stream_nodes(printer *p, ebpo_file *file, const char *path,
                                const ebpo_view_options *view_options, bool *accepted,
                                ebpo_error *error)
{
    ebpo_view_stream *stream = NULL;
    ebpo_view_end end = EBPO_VIEW_NODE;
    const char *order = order_words[view_options->priority];
    ebpo_status status = ebpo_view_stream_new(file, view_options, &stream, error);
    if (status != EBPO_OK)
        return status;
    if (p->v->json) {
        json_begin(&p->j, stdout);
        json_object(&p->j, NULL);
        json_text(&p->j, "file", remote_shown(path));
        json_text(&p->j, "order", order);
        json_array(&p->j, p->v->nodes ? "nodes" : "progress");
    } else {
        printf("%s: by %s\n%12s %10s %9s %9s %9s %9s %9s %10s %9s\n", remote_shown(path), order,
               "bytes", "nodes", "gray", "leaf", "white", "black", "waiting", "pixels", "ms");
    }
    status = report_nodes(p, stream, &end, accepted, error);
    if (p->v->json)
        json_end(&p->j);
    print_row(p, stream, "last");
    traffic t = traffic_of(file);
    if (p->v->json) {
        json_text(&p->j, "end", status == EBPO_OK ? end_names[end] : "failed");
        remote_json(&p->j, &t, &p->v->remote);
        json_finish(&p->j);
    } else {
        if (status == EBPO_OK && *accepted)
            print_legend();
        if (status == EBPO_OK && *accepted)
            printf("%s\n", end == EBPO_VIEW_DONE    ? "all requested data has arrived"
                           : end == EBPO_VIEW_BYTES ? "stopped by --bytes"
                                                    : "stopped by --count");
        (void)command_flush("view");
        remote_report(&t, &p->v->remote, false);
    }
    ebpo_view_stats stats = EBPO_VIEW_STATS_INIT;
    ebpo_view_stream_get_stats(stream, &stats);
    if (status == EBPO_OK && *accepted && p->v->out && stats.nodes == 0) {
        fprintf(stderr,
                "ebpo view: %s: not written: the budget is too small even for the root; give "
                "larger --bytes\n",
                p->v->out);
        *accepted = false;
    } else if (status == EBPO_OK && *accepted && p->v->out)
        status = cut_mesh_write(stream, p->v->out, error);
    ebpo_view_stream_free(stream);
    return status;
}

static const values standard = { .order = -1,
                                 .fov = -1,
                                 .pixels = -1,
                                 .distance = -1,
                                 .max_level = -1,
                                 .count = -1,
                                 .remote = REMOTE_VALUES_INIT };

static int run_view(void *given, const char **operand)
{
    values *v = given;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    ebpo_observer observer = EBPO_OBSERVER_INIT;
    ebpo_view_options view_options = EBPO_VIEW_OPTIONS_INIT;
    printer p = { .v = v, .begin = progress_now() };
    int code = check_values(v);
    if (code != EXIT_OK)
        return code;
    if (!read_options(v, &view_options, &observer))
        return EXIT_USAGE;
    if (v->out && command_overwrites("view", operand[0], v->out))
        return EXIT_USAGE;
    if (!command_requires_hdf5("view", operand[0]))
        return EXIT_FAILED;
    if (remote_open(&file, operand[0], &v->remote, &error) != EBPO_OK)
        return command_failed("view", &error);
    bool has_level = command_has_level("view", ebpo_file_info(file), v->max_level), accepted = true;
    ebpo_status status =
        has_level ? stream_nodes(&p, file, operand[0], &view_options, &accepted, &error) : EBPO_OK;
    ebpo_close(file);
    if (!has_level)
        return EXIT_USAGE;
    if (!accepted)
        return EXIT_FAILED;
    return status == EBPO_OK ? EXIT_OK : command_failed("view", &error);
}

const command command_view = { &spec, sizeof standard, &standard, run_view };
