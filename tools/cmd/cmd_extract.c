/* ebpo extract: a level's envelopes, or the model itself, as PLY. */
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "cli/command.h"
#include "cli/memory_args.h"
#include "cli/progress.h"
#include "cli/reading.h"
#include "cli/remote_args.h"
#include "cli/words.h"
#include "cmd/commands.h"

typedef struct values {
    int64_t level, threads;
    memory_values memory;
    bool mesh, no_walls, quiet;
    remote_values remote;
} values;

static const arg_option options[] = {
    OPTION_INT("level", 0, values, level, "N", 0, 20,
               "the envelopes of level N, and leaves and black nodes above it"),
    OPTION_FLAG("mesh", 0, values, mesh,
                "the model itself, bit for bit; in the order of the source if the maps are stored"),
    OPTION_FLAG("no-walls", 0, values, no_walls,
                "with --level: leave out polygons that lie on cell walls"),
    OPTION_THREADS(values, threads),
    MEMORY_OPTIONS(values, memory),
    OPTION_QUIET(values, quiet),
    REMOTE_OPTIONS(values, remote),
    { 0 },
};

static const arg_spec spec = {
    .command = "extract",
    .operands = "FILE OUT.ply",
    .least = 2,
    .most = 2,
    .summary = "writes a level's envelopes, or the model itself, as PLY",
    .text = "FILE is an .ebpo.h5 file or its URL. Either --level or --mesh is needed. A level's "
            "polygons are held in memory whatever --memory says.",
    .options = options,
};

static int check_values(const values *v, const char *in, const char *out)
{
    if (v->level < 0 && !v->mesh)
        return command_usage("extract", "nothing to extract; give --level N or --mesh");
    if (v->level >= 0 && v->mesh)
        return command_usage("extract", "--level and --mesh cannot be used together");
    if (v->mesh && v->no_walls)
        return command_usage("extract",
                             "--no-walls belongs to --level; the model has no cell walls");
    if (command_overwrites("extract", in, out))
        return EXIT_USAGE;
    return EXIT_FINE;
}

static ebpo_status take(ebpo_file *file, const values *v, const char *path,
                        ebpo_workspace *workspace, ebpo_progress progress, ebpo_mesh *out,
                        double *volume, ebpo_error *error)
{
    if (!v->mesh) {
        ebpo_lod_options lod = EBPO_LOD_OPTIONS_INIT;
        lod.walls = !v->no_walls;
        lod.threads = (unsigned)v->threads;
        lod.progress = progress;
        lod.workspace = workspace;
        return ebpo_lod_level(file, (int)v->level, &lod, out, volume, error);
    }
    bool source_order = false;
    ebpo_read_options read = reading(v->threads, workspace);
    ebpo_status status = ebpo_file_read_source_mesh(file, &read, out, &source_order, error);
    if (status == EBPO_OK && !source_order)
        fprintf(
            stderr,
            "ebpo extract: %s: note: has no maps, so vertices and faces are in the file's order\n",
            remote_shown(path));
    if (status == EBPO_OK && ebpo_file_info(file)->pruned)
        fprintf(stderr,
                "ebpo extract: %s: note: is a subset, so its mesh is only part of the model's\n",
                remote_shown(path));
    return status;
}

static void summarise(const values *v, const char *out, const ebpo_mesh *mesh, double volume)
{
    char vertices[40], faces[40];
    words_plural(vertices, sizeof vertices, mesh->vertex_count, "vertex", "vertices");
    words_plural(faces, sizeof faces, mesh->face_count, "face", "faces");
    printf("%s: %s, %s", out, vertices, faces);
    if (!v->mesh)
        printf(", envelope volume %.9g", volume);
    putchar('\n');
}

static const values usual = { .level = -1, .remote = REMOTE_VALUES_INIT };

static int run(void *given, const char **operand)
{
    values *v = given;
    int code = check_values(v, operand[0], operand[1]);
    if (code != EXIT_FINE)
        return code;
    if (!memory_good("extract", &v->memory))
        return EXIT_USAGE;
    if (!command_wants_hdf5("extract", operand[0]))
        return EXIT_FAILED;
    progress_line line;
    ebpo_progress progress = progress_start(&line, "extract", v->quiet);
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    ebpo_mesh mesh = { 0 };
    double volume = 0;
    ebpo_workspace *workspace = NULL;
    ebpo_status status = memory_make(&workspace, &v->memory, &error);
    if (status == EBPO_OK)
        status = remote_open(&file, operand[0], &v->remote, &error);
    if (status == EBPO_OK)
        status = take(file, v, operand[0], workspace, progress, &mesh, &volume, &error);
    if (status == EBPO_OK)
        status = ebpo_mesh_write_ply(&mesh, operand[1], &error);
    progress_wipe(&line);
    if (status == EBPO_OK && !v->quiet)
        summarise(v, operand[1], &mesh, volume);
    if (status == EBPO_OK) {
        traffic t = traffic_of(file);
        remote_tell(&t, &v->remote, false);
    }
    ebpo_mesh_free(&mesh);
    ebpo_close(file);
    ebpo_workspace_free(workspace);
    return status == EBPO_OK ? EXIT_FINE : command_failed("extract", &error);
}

const command command_extract = { &spec, sizeof usual, &usual, run };
