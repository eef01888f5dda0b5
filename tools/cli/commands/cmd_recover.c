/* ebpo recover: makes a new file from the readable parts of a damaged one. The tree is built again
 * from the mesh; the mesh is read from the file or from its source. */
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

typedef enum fate { NONE, KEPT, REBUILT, LOST } fate; /* NONE: the file has no such part */

typedef enum piece { MESH, MAPS, ATTRIBUTES, LEVELS, SUMS, PIECES } piece;

typedef struct patient {
    const struct values *v; /* values of the options */
    const char *path;
    unsigned threads;
    uint64_t max_expansion;
    ebpo_file *file;
    const ebpo_info *info;
    ebpo_workspace *workspace;
    ebpo_progress progress;
    fate fate[PIECES];
    char why[PIECES][sizeof((ebpo_error *)NULL)->message]; /* errors; "": none */
    bool same;                                             /* the new content equals that of the
                                                            * file */
} patient;

/* Returns the options for reading parts. */
static ebpo_read_options patient_reading(const patient *p)
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

/* Records the result of reading a part. */
static ebpo_status take_down(patient *p, piece which, ebpo_status status,
                             const ebpo_error *reported, ebpo_error *error)
{
    if (status == EBPO_OK || is_damage(status)) {
        p->fate[which] = status == EBPO_OK ? KEPT : LOST;
        if (status != EBPO_OK && !p->why[which][0])
            snprintf(p->why[which], sizeof p->why[which], "%s", reported->message);
        return EBPO_OK;
    }
    *error = *reported;
    return status;
}

static ebpo_status inspect_mesh(patient *p, ebpo_error *error)
{
    ebpo_error reported = EBPO_ERROR_INIT;
    ebpo_read_options read = patient_reading(p);
    ebpo_mesh mesh = { 0 };
    ebpo_maps maps = { 0 };
    if (!(p->info->parts & EBPO_PART_MESH))
        return EBPO_OK;
    ebpo_status status = ebpo_file_read_mesh(p->file, &read, &mesh, &reported);
    ebpo_mesh_free(&mesh);
    status = take_down(p, MESH, status, &reported, error);
    if (status != EBPO_OK || !(p->info->parts & EBPO_PART_MAPS))
        return status;
    status = ebpo_file_read_maps(p->file, &read, &maps, &reported);
    ebpo_maps_free(&maps);
    return take_down(p, MAPS, status, &reported, error);
}

/* The shared header is read with all attributes. */
static ebpo_status inspect_header(patient *p, ebpo_error *error)
{
    ebpo_error reported = EBPO_ERROR_INIT;
    ebpo_read_options read = patient_reading(p);
    ebpo_mesh mesh = { 0 };
    if (p->fate[MESH] != KEPT)
        return EBPO_OK;
    read.attributes = true;
    ebpo_status status = ebpo_file_read_mesh(p->file, &read, &mesh, &reported);
    ebpo_mesh_free(&mesh);
    return take_down(p, ATTRIBUTES, status, &reported, error);
}

static ebpo_status inspect_attributes(patient *p, ebpo_error *error)
{
    ebpo_error reported = EBPO_ERROR_INIT;
    ebpo_read_options read = patient_reading(p);
    ebpo_status status = EBPO_OK;
    if (!(p->info->parts & EBPO_PART_ATTRIBUTES))
        return EBPO_OK;
    p->fate[ATTRIBUTES] = KEPT;
    status = inspect_header(p, error);
    for (unsigned n = 0; status == EBPO_OK && p->fate[ATTRIBUTES] == KEPT; n++) {
        ebpo_attribute_values got;
        status = ebpo_file_read_attribute(p->file, n, &read, &got, &reported);
        ebpo_attribute_values_free(&got);
        if (status == EBPO_E_ABSENT) /* there are no more attributes */
            return EBPO_OK;
        status = take_down(p, ATTRIBUTES, status, &reported, error);
    }
    return status;
}

static ebpo_status inspect_levels(patient *p, ebpo_error *error)
{
    ebpo_error reported = EBPO_ERROR_INIT;
    ebpo_read_options read = patient_reading(p);
    ebpo_status status = EBPO_OK;
    p->fate[LEVELS] = KEPT;
    for (int l = 0; l < p->info->level_count && status == EBPO_OK; l++) {
        ebpo_level level;
        status = ebpo_file_read_level(p->file, l, &read, &level, &reported);
        bool good = status == EBPO_OK;
        if (good)
            ebpo_level_free(&level);
        status = good ? EBPO_OK : take_down(p, LEVELS, status, &reported, error);
    }
    return status;
}

static void forget_fates(patient *p)
{
    memset(p->fate, 0, sizeof p->fate);
    memset(p->why, 0, sizeof p->why);
}

static ebpo_status inspect_all(patient *p, ebpo_error *error)
{
    forget_fates(p);
    ebpo_status status = inspect_mesh(p, error);
    if (status == EBPO_OK)
        status = inspect_attributes(p, error);
    return status == EBPO_OK ? inspect_levels(p, error) : status;
}

/* Opens the file without its list of chunk ends, if its content then matches the header. */
static ebpo_status open_unlisted(const patient *p, ebpo_file **out, ebpo_error *error)
{
    ebpo_read_options read = patient_reading(p);
    ebpo_status status = unlisted_open(p->path, p->max_expansion, out, error);
    return status == EBPO_OK ? ebpo_file_check_content(*out, &read, error) : status;
}

/* Nothing can be read without the list of chunk ends. When only this list is damaged, the content
 * without it matches the header. This proves that all content is intact, so all of it is kept. */
static ebpo_status patient_inspect(patient *p, ebpo_error *error)
{
    ebpo_stored_sizes stored = EBPO_STORED_SIZES_INIT;
    ebpo_error reported = EBPO_ERROR_INIT;
    ebpo_file *unlisted = NULL;
    ebpo_status status = inspect_all(p, error);
    if (status == EBPO_OK)
        status = ebpo_file_locate(p->file, &stored, error);
    if (status != EBPO_OK || !stored.checksum_bytes)
        return status;
    p->fate[SUMS] = KEPT;
    if (p->fate[MESH] != LOST)
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
    p->fate[SUMS] = REBUILT;
    memcpy(p->why[SUMS], why, sizeof why);
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

static const char *const fate_words[] = { "none", "kept", "rebuilt", "lost" };
static const char *const piece_words[] = { "mesh", "maps", "attributes", "levels", "checksums" };

/* --- the mesh to build from --- */

typedef struct remade {
    ebpo_mesh mesh;
    ebpo_mesh_report report;
    ebpo_repair_record record;
    /* source index of each vertex or face of the mesh; NULL: equal to its index */
    uint32_t *vertex_source, *face_source;
} remade;

static int in_order(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

/* Returns the source indices of a map, ascending. */
static uint32_t *sorted_numbers(const uint32_t *map, uint64_t count)
{
    uint32_t *out = malloc(count * sizeof *out);
    if (!out)
        return NULL;
    memcpy(out, map, count * sizeof *out);
    qsort(out, count, sizeof *out, in_order);
    return out;
}

/* Welding and dropping leave gaps in the source indices, which the mesh alone does not show. */
static ebpo_status numbers_of(const patient *p, remade *r, ebpo_error *error)
{
    const ebpo_repair_record *m = &p->info->repair_record;
    ebpo_maps maps;
    ebpo_read_options read = patient_reading(p);
    if (p->fate[MAPS] != KEPT || (!m->welded_vertices && !m->dropped_faces))
        return EBPO_OK;
    ebpo_status status = ebpo_file_read_maps(p->file, &read, &maps, error);
    if (status != EBPO_OK)
        return status;
    r->vertex_source = sorted_numbers(maps.vertex_source, p->info->vertex_count);
    r->face_source = sorted_numbers(maps.face_source, p->info->face_count);
    ebpo_maps_free(&maps);
    if (r->vertex_source && r->face_source)
        return EBPO_OK;
    snprintf(error->message, sizeof error->message, "not enough memory");
    return error->status = EBPO_E_MEMORY;
}

static ebpo_status from_file(patient *p, remade *r, ebpo_error *error)
{
    ebpo_read_options read = patient_reading(p);
    ebpo_prepare_options prepare = EBPO_PREPARE_OPTIONS_INIT;
    ebpo_prepared prepared = EBPO_PREPARED_INIT;
    bool ordered;
    read.attributes = p->fate[ATTRIBUTES] == KEPT;
    ebpo_status status = p->fate[MAPS] == KEPT
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
    return status == EBPO_OK ? numbers_of(p, r, error) : status;
}

static ebpo_status from_source(patient *p, remade *r, ebpo_error *error)
{
    const ebpo_repair_record *m = &p->info->repair_record;
    repairing steps = { .weld = m->weld && !(m->weld_distance > 0),
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
        p->fate[i] = p->fate[i] == LOST ? REBUILT : p->fate[i];
    return EBPO_OK;
}

/* --- building --- */

static ebpo_build_options building_options(const patient *p)
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
    if (p->fate[MAPS] == LOST)
        o.parts &= ~(uint32_t)EBPO_PART_MAPS;
    if (p->fate[ATTRIBUTES] == LOST)
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

/* Consumes the mesh. */
static ebpo_status make_file(const patient *p, remade *r, ebpo_error *error)
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

static ebpo_status compare_content(patient *p, ebpo_error *error)
{
    ebpo_file *made;
    ebpo_status status = remote_open_own(p->v->out, &made, error);
    if (status != EBPO_OK)
        return status;
    p->same = memcmp(ebpo_file_info(made)->content_sha256, p->info->content_sha256,
                     sizeof p->info->content_sha256) == 0;
    /* a part that was read without fault is kept only if the new one equals it */
    if (p->fate[LEVELS] == LOST || !p->same)
        p->fate[LEVELS] = REBUILT;
    if (p->v->source && !textures_same(p->file, made)) {
        p->fate[ATTRIBUTES] = LOST;
        snprintf(p->why[ATTRIBUTES], sizeof p->why[ATTRIBUTES],
                 "images named by %.200s have changed", p->v->source);
    }
    ebpo_close(made);
    return EBPO_OK;
}

static ebpo_status refuse_repair(const patient *p, const char *why, ebpo_error *error)
{
    snprintf(error->message, sizeof error->message, "%s", why);
    (void)p;
    return error->status = EBPO_E_ABSENT;
}

/* The list of chunk ends may be damaged: then nothing can be attributed to the file. */
static ebpo_status refuse_mesh(const patient *p, ebpo_error *error)
{
    char why[sizeof error->message];
    snprintf(why, sizeof why,
             "the mesh of the file cannot be read, and all other data is built from it; give the "
             "mesh that the file was made from with --source (%.300s)",
             p->why[MESH]);
    return refuse_repair(p, why, error);
}

static ebpo_status repair_file(patient *p, ebpo_error *error)
{
    remade r = { .vertex_source = NULL };
    if (p->info->pruned)
        return refuse_repair(
            p,
            "the file is a subset: omitted parts cannot be rebuilt; make another subset of the "
            "original",
            error);
    ebpo_status status = patient_inspect(p, error);
    if (status != EBPO_OK)
        return status;
    if (!p->v->source && p->fate[MESH] == LOST)
        return refuse_mesh(p, error);
    if (!p->v->source && p->fate[MESH] != KEPT)
        return refuse_repair(
            p,
            "the file has no mesh to rebuild from; give the mesh that the file was made from "
            "with --source",
            error);
    status = p->v->source ? from_source(p, &r, error) : from_file(p, &r, error);
    if (status == EBPO_OK)
        status = make_file(p, &r, error);
    else
        ebpo_mesh_free(&r.mesh);
    free(r.vertex_source);
    free(r.face_source);
    return status == EBPO_OK ? compare_content(p, error) : status;
}

/* --- output --- */

static void print_words(const patient *p, const char *in)
{
    char hex[65];
    for (int i = 0; i < PIECES; i++)
        if (p->fate[i] != NONE)
            printf("  %-11s %s%s%s\n", piece_words[i], fate_words[p->fate[i]],
                   p->why[i][0] ? ": " : "", p->why[i]);
    words_hex(p->info->content_sha256, hex);
    printf("%s: %s of %s, SHA-256 %s\n", p->v->out, p->same ? "the content" : "not the content", in,
           hex);
}

static void print_json(const patient *p, const char *in)
{
    json j;
    json_begin(&j, stdout);
    json_object(&j, NULL);
    json_text(&j, "file", in);
    json_text(&j, "output", p->v->out);
    json_bool(&j, "same_content", p->same);
    json_object(&j, "parts");
    for (int i = 0; i < PIECES; i++)
        json_text(&j, piece_words[i], fate_words[p->fate[i]]);
    json_end(&j);
    json_object(&j, "damage");
    for (int i = 0; i < PIECES; i++)
        if (p->why[i][0])
            json_text(&j, piece_words[i], p->why[i]);
        else
            json_null(&j, piece_words[i]);
    json_end(&j);
    json_finish(&j);
}

/* Lost maps always change the content. */
static int code_of(const patient *p)
{
    return p->same || p->fate[MAPS] == LOST ? EXIT_FINE : EXIT_DIFFERS;
}

static const values standard = { 0 };

static int run_recover(void *given, const char **operand)
{
    const values *v = given;
    progress_line line;
    patient p = { .v = v,
                  .path = operand[0],
                  .threads = (unsigned)v->threads,
                  .max_expansion = (uint64_t)v->max_expansion };
    ebpo_open_options how = EBPO_OPEN_OPTIONS_INIT;
    how.max_expansion = (uint64_t)v->max_expansion;
    ebpo_error error = EBPO_ERROR_INIT;
    if (!v->out)
        return command_usage("recover", "give the new file with --output");
    if (!memory_good("recover", &v->memory) || command_overwrites("recover", operand[0], v->out))
        return EXIT_USAGE;
    if (!command_wants_hdf5("recover", operand[0]))
        return EXIT_FAILED;
    p.progress = progress_start(&line, "recover", v->quiet);
    ebpo_status status = ebpo_check_output(v->out, &error);
    if (status == EBPO_OK)
        status = memory_make(&p.workspace, &v->memory, &error);
    if (status == EBPO_OK)
        status = ebpo_open_with(operand[0], &how, &p.file, &error);
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
    return status == EBPO_OK ? code_of(&p) : command_failed("recover", &error);
}

const command command_recover = { &spec, sizeof standard, &standard, run_recover };
