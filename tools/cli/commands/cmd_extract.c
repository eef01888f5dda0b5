/* ebpo extract: writes the envelopes of a level, the model, or a part of it, as PLY. */
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "cli/command.h"
#include "cli/json.h"
#include "cli/memory_args.h"
#include "cli/progress.h"
#include "cli/reading.h"
#include "cli/remote_args.h"
#include "cli/standard_files.h"
#include "cli/tables.h"
#include "cli/textures.h"
#include "cli/words.h"
#include "cli/commands/commands.h"

/* The mesh to write. */
typedef struct extracted {
    ebpo_mesh mesh;
    ebpo_subtree *mesh_owner; /* owner of the arrays of `mesh`; NULL: `mesh` is the owner */
    double volume;            /* with --level: volume of the envelopes */
} extracted;

typedef struct values {
    int64_t level, subtree, threads;
    memory_values memory;
    bool mesh, caps, no_cell_faces, json, quiet;
    const char *textures;
    remote_values remote;
} values;

/* Limit of --subtree; all octcodes are smaller. The limits of options are doubles, and a double
 * represents this value exactly. */
#define OCTCODE_MAX (INT64_C(1) << 61)

#include "cli/options/extract.inc"

static int check_values(const values *v, const char *in, const char *out)
{
    int requested = (v->level >= 0) + v->mesh + (v->subtree > 0);
    if (v->textures && strcmp(v->textures, "-") == 0)
        return command_usage("extract", "--textures: '-': a folder's name is needed here");
    if (requested == 0 && v->textures && !out)
        return v->json ? command_usage("extract", "--json cannot be used with --textures alone")
                       : EXIT_OK;
    if (requested == 0)
        return command_usage("extract", "specify --level N, --mesh or --subtree OCTCODE");
    if (!out)
        return command_usage("extract", "missing operand; expected: FILE OUT.ply");
    if (requested > 1)
        return command_usage("extract", "--level, --mesh and --subtree cannot be used together");
    if (v->level < 0 && v->no_cell_faces)
        return command_usage(
            "extract", "--no-cell-faces applies to --level only; the model has no cell faces");
    if (v->caps && !v->mesh)
        return command_usage("extract", "--caps applies to --mesh only");
    if (command_overwrites("extract", in, out))
        return EXIT_USAGE;
    return EXIT_OK;
}

/* Warns if nodes of the subtree are pruned. A pruned node is a gray node (an inner node) without
 * children. */
static void warn_of_pruned(const ebpo_subtree *subtree, const char *path)
{
    ebpo_subtree_nodes nodes = EBPO_SUBTREE_NODES_INIT;
    uint64_t pruned = 0;
    if (ebpo_subtree_get_nodes(subtree, &nodes) != EBPO_OK)
        return;
    for (uint64_t i = 0; i < nodes.node_count; i++)
        pruned += nodes.types[i] == EBPO_GRAY && nodes.children[i] == EBPO_NO_CHILDREN;
    char nodes_text[40];
    words_plural(nodes_text, sizeof nodes_text, pruned, "node", "nodes");
    if (pruned)
        fprintf(stderr,
                "ebpo extract: %s: note: is a subset without the nodes below %s of this subtree, "
                "so faces are missing\n",
                remote_shown(path), nodes_text);
}

/* Sets out->mesh to the faces of the subtree that --subtree names. The subtree still owns the
 * arrays. */
static ebpo_status take_subtree(const ebpo_file *file, const values *v, const char *path,
                                const ebpo_workspace *workspace, extracted *out, ebpo_error *error)
{
    ebpo_subtree_options subtree_options = EBPO_SUBTREE_OPTIONS_INIT;
    ebpo_subtree_faces faces = EBPO_SUBTREE_FACES_INIT;
    ebpo_workspace_stats allowed = EBPO_WORKSPACE_STATS_INIT;
    ebpo_workspace_get_stats(workspace, &allowed);
    subtree_options.parts = EBPO_PART_MESH;
    subtree_options.memory = allowed.memory;
    ebpo_status status =
        ebpo_subtree_open(file, (uint64_t)v->subtree, &subtree_options, &out->mesh_owner, error);
    if (status == EBPO_OK)
        status = ebpo_subtree_get_faces(out->mesh_owner, &faces, error);
    if (status == EBPO_OK)
        warn_of_pruned(out->mesh_owner, path);
    out->mesh.vertex_count = faces.vertex_count;
    out->mesh.face_count = faces.face_count;
    out->mesh.xyz32 = (float *)faces.xyz32;
    out->mesh.xyz64 = (double *)faces.xyz64;
    out->mesh.faces = (uint32_t *)faces.faces;
    return status;
}

/* Warns if elements of the source other than vertices and faces are omitted. Such elements may
 * refer to vertex indices, so they are written only if the vertices have the order of the source.
 */
static void warn_of_elements(const ebpo_file *file, bool source_order, const char *path)
{
    ebpo_attribute_facts a = EBPO_ATTRIBUTE_FACTS_INIT;
    bool has_elements = false;
    for (unsigned n = 0; ebpo_file_attribute(file, n, &a); n++)
        has_elements =
            has_elements || (strcmp(a.element, "vertex") != 0 && strcmp(a.element, "face") != 0 &&
                             strcmp(a.element, "ebpo:texture") != 0);
    if (has_elements && (!source_order || ebpo_file_info(file)->repair_record.welded_vertices))
        fprintf(stderr,
                "ebpo extract: %s: note: other elements are omitted, as their vertex indices "
                "refer to the source\n",
                remote_shown(path));
}

/* Sets *out to the requested mesh: a subtree, the envelopes of a level, or the whole model. */
static ebpo_status take_mesh(ebpo_file *file, const values *v, const char *path,
                             ebpo_workspace *workspace, ebpo_progress progress, extracted *out,
                             ebpo_error *error)
{
    if (v->subtree > 0)
        return take_subtree(file, v, path, workspace, out, error);
    if (!v->mesh) {
        ebpo_lod_options lod = EBPO_LOD_OPTIONS_INIT;
        lod.cell_faces = !v->no_cell_faces;
        lod.threads = (unsigned)v->threads;
        lod.progress = progress;
        lod.workspace = workspace;
        return ebpo_lod_level(file, (int)v->level, &lod, &out->mesh, &out->volume, error);
    }
    bool source_order = false;
    ebpo_read_options read = reading_options(v->threads, workspace);
    read.attributes = !v->caps;
    ebpo_status status = ebpo_file_read_source_mesh(file, &read, &out->mesh, &source_order, error);
    if (status == EBPO_OK && !source_order)
        fprintf(stderr,
                "ebpo extract: %s: note: has no source indices, so vertices and faces are "
                "in the file's order\n",
                remote_shown(path));
    if (status == EBPO_OK && !v->caps)
        warn_of_elements(file, source_order, path);
    if (status == EBPO_OK && ebpo_file_info(file)->pruned)
        fprintf(stderr,
                "ebpo extract: %s: note: is a subset, so its mesh is only part of the model's\n",
                remote_shown(path));
    if (status == EBPO_OK && v->caps)
        status = ebpo_mesh_add_caps(&out->mesh, file, error);
    return status;
}

/* Writes the images of textures to the folder --textures. */
static ebpo_status write_textures(const ebpo_file *file, const values *v, ebpo_error *error)
{
    textures t;
    uint64_t written;
    ebpo_status status = textures_read(&t, file, true, error);
    if (status != EBPO_OK)
        return status;
    status = textures_write(&t, v->textures, &written, error);
    textures_free(&t);
    char images[40];
    words_plural(images, sizeof images, written, "image", "images");
    if (status == EBPO_OK && !v->quiet && !v->json)
        printf("%s: %s\n", v->textures, images);
    return status;
}

static void print_summary(const values *v, const char *path, const extracted *out)
{
    char vertices[40], faces[40], volume[TABLE_CELL];
    words_plural(vertices, sizeof vertices, out->mesh.vertex_count, "vertex", "vertices");
    words_plural(faces, sizeof faces, out->mesh.face_count, "face", "faces");
    printf("%s: %s, %s", standard_files_shown(path), vertices, faces);
    if (v->level >= 0)
        printf(", envelope volume %s", table_volume(volume, "%.9g", out->volume));
    putchar('\n');
}

static void summarise_json(const values *v, const char *path, const extracted *out,
                           const traffic *t)
{
    json j;
    json_begin(&j, stdout);
    json_object(&j, NULL);
    json_text(&j, "file", standard_files_shown(path));
    json_uint(&j, "vertices", out->mesh.vertex_count);
    json_uint(&j, "faces", out->mesh.face_count);
    if (v->level >= 0)
        json_real(&j, "envelope_volume", out->volume);
    remote_json(&j, t, &v->remote);
    json_finish(&j);
}

static const values standard = { .level = -1, .subtree = -1, .remote = REMOTE_VALUES_INIT };

static int run_extract(void *given, const char **operand)
{
    values *v = given;
    int code = check_values(v, operand[0], operand[1]);
    if (code != EXIT_OK)
        return code;
    if (!memory_check("extract", &v->memory))
        return EXIT_USAGE;
    if (!command_requires_hdf5("extract", operand[0]))
        return EXIT_FAILED;
    progress_line line;
    ebpo_progress progress = progress_start(&line, "extract", v->quiet);
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    extracted out = { .volume = 0 };
    ebpo_workspace *workspace = NULL;
    ebpo_status status = memory_new(&workspace, &v->memory, &error);
    if (status == EBPO_OK)
        status = remote_open(&file, operand[0], &v->remote, &error);
    if (status == EBPO_OK && v->textures)
        status = write_textures(file, v, &error);
    if (status == EBPO_OK && operand[1])
        status = take_mesh(file, v, operand[0], workspace, progress, &out, &error);
    if (status == EBPO_OK && operand[1])
        status = ebpo_mesh_write_ply(&out.mesh, operand[1], &error);
    progress_wipe(&line);
    if (status == EBPO_OK) {
        traffic t = traffic_of(file);
        if (v->json)
            summarise_json(v, operand[1], &out, &t);
        else if (operand[1] && !v->quiet)
            print_summary(v, operand[1], &out);
        if (!v->json)
            remote_report(&t, &v->remote, false);
    }
    if (!out.mesh_owner)
        ebpo_mesh_free(&out.mesh);
    ebpo_subtree_close(out.mesh_owner);
    ebpo_close(file);
    ebpo_workspace_free(workspace);
    return status == EBPO_OK ? EXIT_OK : command_failed("extract", &error);
}

const command command_extract = { &spec, sizeof standard, &standard, run_extract };
