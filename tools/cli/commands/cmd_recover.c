/* ebpo recover: makes a new file from the readable parts of a damaged file. The tree is built again
 * from a mesh, which is read from the file or from the source of the file. */
#include <inttypes.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/ebpo.h>

#include "cli/command.h"
#include "cli/commands/commands.h"
#include "cli/commands/unlisted.h"
#include "cli/json.h"
#include "cli/memory_args.h"
#include "cli/mesh_input.h"
#include "cli/progress.h"
#include "cli/remote_args.h"
#include "cli/textures.h"
#include "cli/words.h"

/* --- readable parts of the file --- */

typedef enum part_state {
    NONE,    /* the file has no such part */
    KEPT,    /* the part can be read, and is in the new file */
    REBUILT, /* the part cannot be read, and is made again from the mesh or the source */
    LOST     /* the part cannot be read, and is not in the new file */
} part_state;

typedef enum file_part { MESH, MAPS, ATTRIBUTES, LEVELS, CHECKSUMS, FILE_PARTS } file_part;

typedef struct recovery {
    const struct values *v; /* values of the options */
    const char *path;
    unsigned threads;
    uint64_t max_expansion;
    ebpo_file *file;
    const ebpo_info *info;
    ebpo_workspace *workspace;
    ebpo_progress progress;
    part_state part_state[FILE_PARTS];
    char why[FILE_PARTS][sizeof((ebpo_error *)NULL)->message]; /* errors of reading; "": none */
    bool content_equal; /* the content of the new file equals that of the damaged file */
} recovery;

/* Returns the options for reading parts. */
static ebpo_read_options part_options(const recovery *p)
{
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    read.threads = p->threads;
    read.workspace = p->workspace;
    return read;
}

/* Returns true for a failure caused by the file and not by this machine. */
static bool is_damage(ebpo_status status)
{
    return status == EBPO_E_FORMAT || status == EBPO_E_VERSION || status == EBPO_E_LIMIT ||
           status == EBPO_E_ABSENT;
}

/* Records the result of reading a part. `reported`: the error. If the file is not the cause, fails
 * with this error. */
static ebpo_status record_result(recovery *p, file_part which, ebpo_status status,
                                 const ebpo_error *reported, ebpo_error *error)
{
    if (status == EBPO_OK || is_damage(status)) {
        p->part_state[which] = status == EBPO_OK ? KEPT : LOST;
        if (status != EBPO_OK && !p->why[which][0])
            snprintf(p->why[which], sizeof p->why[which], "%s", reported->message);
        return EBPO_OK;
    }
    *error = *reported;
    return status;
}

static ebpo_status inspect_mesh(recovery *p, ebpo_error *error)
{
    ebpo_error reported = EBPO_ERROR_INIT;
    ebpo_read_options read = part_options(p);
    ebpo_mesh mesh = { 0 };
    ebpo_maps maps = { 0 };
    if (!(p->info->parts & EBPO_PART_MESH))
        return EBPO_OK;
    ebpo_status status = ebpo_file_read_mesh(p->file, &read, &mesh, &reported);
    ebpo_mesh_free(&mesh);
    status = record_result(p, MESH, status, &reported, error);
    if (status != EBPO_OK || !(p->info->parts & EBPO_PART_MAPS))
        return status;
    status = ebpo_file_read_maps(p->file, &read, &maps, &reported);
    ebpo_maps_free(&maps);
    return record_result(p, MAPS, status, &reported, error);
}

/* Checks that the mesh can be read with its attributes. This check also reads the header of all
 * attributes. */
static ebpo_status inspect_header(recovery *p, ebpo_error *error)
{
    ebpo_error reported = EBPO_ERROR_INIT;
    ebpo_read_options read = part_options(p);
    ebpo_mesh mesh = { 0 };
    if (p->part_state[MESH] != KEPT)
        return EBPO_OK;
    read.attributes = true;
    ebpo_status status = ebpo_file_read_mesh(p->file, &read, &mesh, &reported);
    ebpo_mesh_free(&mesh);
    return record_result(p, ATTRIBUTES, status, &reported, error);
}

static ebpo_status inspect_attributes(recovery *p, ebpo_error *error)
{
    ebpo_error reported = EBPO_ERROR_INIT;
    ebpo_read_options read = part_options(p);
    ebpo_status status = EBPO_OK;
    if (!(p->info->parts & EBPO_PART_ATTRIBUTES))
        return EBPO_OK;
    p->part_state[ATTRIBUTES] = KEPT;
    status = inspect_header(p, error);
    for (unsigned n = 0; status == EBPO_OK && p->part_state[ATTRIBUTES] == KEPT; n++) {
        ebpo_attribute_values values_read;
        status = ebpo_file_read_attribute(p->file, n, &read, &values_read, &reported);
        ebpo_attribute_values_free(&values_read);
        if (status == EBPO_E_ABSENT) /* there are no more attributes */
            return EBPO_OK;
        status = record_result(p, ATTRIBUTES, status, &reported, error);
    }
    return status;
}

static ebpo_status inspect_levels(recovery *p, ebpo_error *error)
{
    ebpo_error reported = EBPO_ERROR_INIT;
    ebpo_read_options read = part_options(p);
    ebpo_status status = EBPO_OK;
    p->part_state[LEVELS] = KEPT;
    for (int l = 0; l < p->info->level_count && status == EBPO_OK; l++) {
        ebpo_level level;
        status = ebpo_file_read_level(p->file, l, &read, &level, &reported);
        if (status == EBPO_OK)
            ebpo_level_free(&level);
        else
            status = record_result(p, LEVELS, status, &reported, error);
    }
    return status;
}

static void reset_states(recovery *p)
{
    memset(p->part_state, 0, sizeof p->part_state);
    memset(p->why, 0, sizeof p->why);
}

static ebpo_status inspect_all(recovery *p, ebpo_error *error)
{
    reset_states(p);
    ebpo_status status = inspect_mesh(p, error);
    if (status == EBPO_OK)
        status = inspect_attributes(p, error);
    return status == EBPO_OK ? inspect_levels(p, error) : status;
}

/* Opens the file without its lists of chunks, see unlisted.h. Fails if the content of the file does
 * not match the checksum in the header. */
static ebpo_status open_unlisted(const recovery *p, ebpo_file **out, ebpo_error *error)
{
    ebpo_read_options read = part_options(p);
    ebpo_status status = unlisted_open(p->path, p->max_expansion, out, error);
    return status == EBPO_OK ? ebpo_file_check_content(*out, &read, error) : status;
}

/* Finds the readable parts. If the list of chunk checksums is damaged, no part can be read with
 * this list. Then the function reads the file without the list. If the content matches the checksum
 * in the header, all content is intact, and is kept. */
static ebpo_status inspect_file(recovery *p, ebpo_error *error)
{
    ebpo_stored_sizes stored = EBPO_STORED_SIZES_INIT;
    ebpo_error reported = EBPO_ERROR_INIT;
    ebpo_file *unlisted = NULL;
    ebpo_status status = inspect_all(p, error);
    if (status == EBPO_OK)
        status = ebpo_file_locate(p->file, &stored, error);
    if (status != EBPO_OK || !stored.checksum_bytes)
        return status;
    p->part_state[CHECKSUMS] = KEPT;
    if (p->part_state[MESH] != LOST)
        return EBPO_OK;
    status = open_unlisted(p, &unlisted, &reported);
    if (status != EBPO_OK) {
        ebpo_close(unlisted);
        *error = reported;
        return is_damage(status) ? EBPO_OK : status;
    }
    char why[sizeof p->why[MESH]];
    memcpy(why, p->why[MESH], sizeof why);
    ebpo_close(p->file);
    p->file = unlisted;
    p->info = ebpo_file_info(unlisted);
    status = inspect_all(p, error);
    p->part_state[CHECKSUMS] = REBUILT;
    memcpy(p->why[CHECKSUMS], why, sizeof why);
    return status;
}

/* --- the command --- */

typedef struct values {
    const char *out, *source;
    int64_t threads, max_expansion;
    memory_values memory;
    bool json, quiet;
} values;

#include "cli/options/recover.inc"

static const char *const state_words[] = { "none", "kept", "rebuilt", "lost" };
static const char *const file_part_words[] = { "mesh", "maps", "attributes", "levels",
                                               "checksums" };

/* --- the mesh from which the new file is built --- */

typedef struct rebuilt_mesh {
    ebpo_mesh mesh;
    ebpo_mesh_report report;
    ebpo_repair_record record;
    /* source index of each vertex or face of the mesh; NULL: equal to the index in the mesh */
    uint32_t *vertex_source, *face_source;
} rebuilt_mesh;

static int compare_indices(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

/* Returns the source indices of a map, ascending; NULL: there is not enough memory. */
static uint32_t *sorted_indices(const uint32_t *map, uint64_t count)
{
    uint32_t *out = malloc(count * sizeof *out);
    if (!out)
        return NULL;
    memcpy(out, map, count * sizeof *out);
    qsort(out, count, sizeof *out, compare_indices);
    return out;
}

/* Sets the source indices if vertices were welded or faces dropped when the file was made. Then
 * source indices have gaps, and do not follow from the mesh alone. */
static ebpo_status set_source_indices(const recovery *p, rebuilt_mesh *r, ebpo_error *error)
{
    const ebpo_repair_record *m = &p->info->repair_record;
    ebpo_maps maps;
    ebpo_read_options read = part_options(p);
    if (p->part_state[MAPS] != KEPT || (!m->welded_vertices && !m->dropped_faces))
        return EBPO_OK;
    ebpo_status status = ebpo_file_read_maps(p->file, &read, &maps, error);
    if (status != EBPO_OK)
        return status;
    r->vertex_source = sorted_indices(maps.vertex_source, p->info->vertex_count);
    r->face_source = sorted_indices(maps.face_source, p->info->face_count);
    ebpo_maps_free(&maps);
    if (r->vertex_source && r->face_source)
        return EBPO_OK;
    snprintf(error->message, sizeof error->message, "not enough memory");
    return error->status = EBPO_E_MEMORY;
}

static ebpo_status read_file_mesh(recovery *p, rebuilt_mesh *r, ebpo_error *error)
{
    ebpo_read_options read = part_options(p);
    ebpo_prepare_options prepare = EBPO_PREPARE_OPTIONS_INIT;
    ebpo_prepared prepared = EBPO_PREPARED_INIT;
    bool ordered;
    read.attributes = p->part_state[ATTRIBUTES] == KEPT;
    ebpo_status status = p->part_state[MAPS] == KEPT
                             ? ebpo_file_read_source_mesh(p->file, &read, &r->mesh, &ordered, error)
                             : ebpo_file_read_mesh(p->file, &read, &r->mesh, error);
    if (status != EBPO_OK)
        return status;
    r->mesh.workspace = p->workspace;
    prepare.threads = p->threads;
    prepare.progress = p->progress;
    status = ebpo_mesh_prepare(&r->mesh, &prepare, &prepared, error);
    r->report = prepared.report;
    r->record = p->info->repair_record;
    memcpy(r->mesh.source_name, p->info->source_name, sizeof r->mesh.source_name);
    memcpy(r->mesh.source_sha256, p->info->source_sha256, sizeof r->mesh.source_sha256);
    memcpy(r->mesh.source_format, p->info->source_format, sizeof r->mesh.source_format);
    r->mesh.source_size = p->info->source_size;
    return status == EBPO_OK ? set_source_indices(p, r, error) : status;
}

static ebpo_status read_source_mesh(recovery *p, rebuilt_mesh *r, ebpo_error *error)
{
    const ebpo_repair_record *m = &p->info->repair_record;
    repair_request steps = { .weld = m->weld && !(m->weld_distance > 0),
                             .weld_distance = m->weld_distance,
                             .drop_duplicates = m->dropped_faces > 0,
                             .orient = m->orient,
                             .flip = !m->orient && m->flipped_faces,
                             .fill_holes = m->fill_holes };
    mesh_input in;
    mesh_reading more = !(p->info->parts & EBPO_PART_ATTRIBUTES) ? READ_MESH
                        : textures_embedded(p->file)             ? READ_TEXTURES
                                                                 : READ_ATTRIBUTES;
    ebpo_status status = mesh_input_read(&in, p->v->source, steps, more, p->workspace, p->threads,
                                         p->progress, error);
    if (status != EBPO_OK)
        return status;
    r->mesh = in.mesh;
    r->report = in.prepared.report;
    r->record = in.prepared.record;
    if (memcmp(in.as_read.source_sha256, p->info->source_sha256, sizeof in.as_read.source_sha256) !=
        0) {
        snprintf(error->message, sizeof error->message,
                 "%s: is not the source of the file, %s: its SHA-256 differs; find the original "
                 "source, or convert this one",
                 p->v->source, p->info->source_name);
        return error->status = EBPO_E_ABSENT;
    }
    for (int i = 0; i < LEVELS; i++)
        p->part_state[i] = p->part_state[i] == LOST ? REBUILT : p->part_state[i];
    return EBPO_OK;
}

/* --- building --- */

static ebpo_build_options building_options(const recovery *p)
{
    ebpo_build_options o = EBPO_BUILD_OPTIONS_INIT;
    const ebpo_info *info = p->info;
    o.max_level = info->max_level;
    o.leaf_faces = info->leaf_faces;
    o.epsilon = info->epsilon;
    o.select = (ebpo_selection)info->selection;
    o.percent = info->percent > 0 ? info->percent : o.percent;
    o.k_root = info->k_root;
    o.normals = (ebpo_normal_distance)info->normals;
    o.seed = info->seed;
    o.parts = info->parts;
    if (p->part_state[MAPS] == LOST)
        o.parts &= ~(uint32_t)EBPO_PART_MAPS;
    if (p->part_state[ATTRIBUTES] == LOST)
        o.parts &= ~(uint32_t)(EBPO_PART_ATTRIBUTES | EBPO_PART_COLOURS);
    o.rule = info->rule;
    o.require_solid = info->solid;
    o.threads = p->threads;
    o.unit = info->unit[0] ? info->unit : NULL;
    o.crs = info->crs[0] ? info->crs : NULL;
    o.date = info->date[0] ? info->date : NULL;
    o.progress = p->progress;
    return o;
}

/* Builds and writes the new file; frees the mesh. */
static ebpo_status make_file(const recovery *p, rebuilt_mesh *r, ebpo_error *error)
{
    ebpo_build_options build = building_options(p);
    ebpo_write_options write = EBPO_WRITE_OPTIONS_INIT;
    ebpo_tree tree;
    ebpo_status status = ebpo_build(&r->mesh, &r->report, &r->record, &build, &tree, error);
    if (status != EBPO_OK)
        return status;
    for (uint64_t i = 0; r->vertex_source && tree.vertex_source && i < tree.info.vertex_count; i++)
        tree.vertex_source[i] = r->vertex_source[tree.vertex_source[i]];
    for (uint64_t i = 0; r->face_source && tree.face_source && i < tree.info.face_count; i++)
        tree.face_source[i] = r->face_source[tree.face_source[i]];
    write.codec = p->info->codec;
    write.threads = p->threads;
    write.face_coding = p->info->gates ? EBPO_FACES_GATES : EBPO_FACES_DEFAULT;
    write.progress = p->progress;
    status = ebpo_tree_write(&tree, p->v->out, &write, error);
    ebpo_tree_free(&tree);
    return status;
}

/* Compares the new file with the damaged file, and corrects p->part_state. */
static ebpo_status compare_content(recovery *p, ebpo_error *error)
{
    ebpo_file *made;
    ebpo_status status = remote_open_own(p->v->out, &made, error);
    if (status != EBPO_OK)
        return status;
    p->content_equal = memcmp(ebpo_file_info(made)->content_sha256, p->info->content_sha256,
                              sizeof p->info->content_sha256) == 0;
    /* readable levels count as kept only if the new content equals the old content */
    if (p->part_state[LEVELS] == LOST || !p->content_equal)
        p->part_state[LEVELS] = REBUILT;
    if (p->v->source && !textures_same(p->file, made)) {
        p->part_state[ATTRIBUTES] = LOST;
        snprintf(p->why[ATTRIBUTES], sizeof p->why[ATTRIBUTES],
                 "images named by %.200s have changed", p->v->source);
    }
    ebpo_close(made);
    return EBPO_OK;
}

static ebpo_status refuse_repair(const char *why, ebpo_error *error)
{
    snprintf(error->message, sizeof error->message, "%s", why);
    return error->status = EBPO_E_ABSENT;
}

/* Fails because the file has no readable mesh. */
static ebpo_status refuse_mesh(const recovery *p, ebpo_error *error)
{
    char why[sizeof error->message];
    snprintf(why, sizeof why,
             "the mesh of the file cannot be read, and all other data is built from it; give the "
             "mesh that the file was made from with --source (%.300s)",
             p->why[MESH]);
    return refuse_repair(why, error);
}

static ebpo_status repair_file(recovery *p, ebpo_error *error)
{
    rebuilt_mesh r = { .vertex_source = NULL };
    if (p->info->pruned)
        return refuse_repair("the file is a subset: omitted parts cannot be rebuilt; make another "
                             "subset of the original file",
                             error);
    ebpo_status status = inspect_file(p, error);
    if (status != EBPO_OK)
        return status;
    if (!p->v->source && p->part_state[MESH] == LOST)
        return refuse_mesh(p, error);
    if (!p->v->source && p->part_state[MESH] != KEPT)
        return refuse_repair("the file has no mesh to rebuild from; give the mesh that the file "
                             "was made from with --source",
                             error);
    status = p->v->source ? read_source_mesh(p, &r, error) : read_file_mesh(p, &r, error);
    if (status == EBPO_OK)
        status = make_file(p, &r, error);
    else
        ebpo_mesh_free(&r.mesh);
    free(r.vertex_source);
    free(r.face_source);
    return status == EBPO_OK ? compare_content(p, error) : status;
}

/* --- output --- */

static void print_words(const recovery *p, const char *in)
{
    char hex[65];
    for (int i = 0; i < FILE_PARTS; i++)
        if (p->part_state[i] != NONE)
            printf("  %-11s %s%s%s\n", file_part_words[i], state_words[p->part_state[i]],
                   p->why[i][0] ? ": " : "", p->why[i]);
    words_hex(p->info->content_sha256, hex);
    printf("%s: %s of %s, SHA-256 %s\n", p->v->out,
           p->content_equal ? "the content" : "not the content", in, hex);
}

static void print_json(const recovery *p, const char *in)
{
    json j;
    json_begin(&j, stdout);
    json_object(&j, NULL);
    json_text(&j, "file", in);
    json_text(&j, "output", p->v->out);
    json_bool(&j, "same_content", p->content_equal);
    json_object(&j, "parts");
    for (int i = 0; i < FILE_PARTS; i++)
        json_text(&j, file_part_words[i], state_words[p->part_state[i]]);
    json_end(&j);
    json_object(&j, "damage");
    for (int i = 0; i < FILE_PARTS; i++)
        if (p->why[i][0])
            json_text(&j, file_part_words[i], p->why[i]);
        else
            json_null(&j, file_part_words[i]);
    json_end(&j);
    json_finish(&j);
}

/* Returns the exit code. If the maps (source indices) of the file are lost, the content always
 * differs; this is no error. */
static int exit_code_of(const recovery *p)
{
    return p->content_equal || p->part_state[MAPS] == LOST ? EXIT_OK : EXIT_DIFFERS;
}

static const values standard = { 0 };

static int run_recover(void *given, const char **operand)
{
    const values *v = given;
    progress_line line;
    recovery p = { .v = v,
                   .path = operand[0],
                   .threads = (unsigned)v->threads,
                   .max_expansion = (uint64_t)v->max_expansion };
    ebpo_open_options open_options = EBPO_OPEN_OPTIONS_INIT;
    open_options.max_expansion = (uint64_t)v->max_expansion;
    ebpo_error error = EBPO_ERROR_INIT;
    if (!v->out)
        return command_usage("recover", "name the new file with --output");
    if (!memory_check("recover", &v->memory) || command_overwrites("recover", operand[0], v->out) ||
        (v->source && command_overwrites("recover", v->source, v->out)))
        return EXIT_USAGE;
    if (!command_requires_hdf5("recover", operand[0]))
        return EXIT_FAILED;
    p.progress = progress_start(&line, "recover", v->quiet);
    ebpo_status status = ebpo_check_output(v->out, &error);
    if (status == EBPO_OK)
        status = memory_new(&p.workspace, &v->memory, &error);
    if (status == EBPO_OK)
        status = ebpo_open_with(operand[0], &open_options, &p.file, &error);
    if (status == EBPO_OK) {
        p.info = ebpo_file_info(p.file);
        status = repair_file(&p, &error);
    }
    progress_wipe(&line);
    if (status == EBPO_OK && v->json)
        print_json(&p, operand[0]);
    else if (status == EBPO_OK && !v->quiet)
        print_words(&p, operand[0]);
    ebpo_close(p.file);
    ebpo_workspace_free(p.workspace);
    return status == EBPO_OK ? exit_code_of(&p) : command_failed("recover", &error);
}

const command command_recover = { &spec, sizeof standard, &standard, run_recover };
