/* Records results of a scene at several times in an HDF5 file, for other programs.
 *
 * The file has the names of instances and models, a row for each time, and a row for each pair
 * found, with the pair's kind, location and depth. Tables grow by rows while times are added. The
 * file is published when it is finished; after a failure there is no file. */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "hdf5_write/h5.h"
#include "io/publish.h"
#include "extras/scene/scene_parts.h"

/* Datasets of the file: first the datasets of /frames, then the datasets of /clashes. */
enum {
    TIME,
    FIRST_CLASH,
    CLASHES,
    TESTED,
    NANOSECONDS,
    BYTES_READ,
    MODELS,
    LOADS,
    FRAME,
    INSTANCES,
    KIND,
    RELATION,
    FACES,
    PAIRS,
    CONTACTS,
    CLEARANCE,
    DISTANCE,
    LOCATION,
    LOCATION_BOX,
    DEPTH,
    TABLES
};

static const struct {
    const char *path;
    ebpo_h5_number number;
    uint32_t cols; /* 0: the dataset is one-dimensional */
    const char *meaning;
} layout[TABLES] = {
    [TIME] = { "/frames/time", EBPO_H5_F64, 0, "the scene's seconds" },
    [FIRST_CLASH] = { "/frames/first_clash", EBPO_H5_I64, 0, "first row of the time in /clashes" },
    [CLASHES] = { "/frames/clashes", EBPO_H5_I64, 0, "number of rows of the time in /clashes" },
    [TESTED] = { "/frames/tested", EBPO_H5_I64, 0, "number of pairs of instances evaluated" },
    [NANOSECONDS] = { "/frames/nanoseconds", EBPO_H5_I64, 0, "duration of the query" },
    [BYTES_READ] = { "/frames/bytes_read", EBPO_H5_I64, 0,
                     "bytes read from models' files during the query" },
    [MODELS] = { "/frames/models", EBPO_H5_I64, 0,
                 "number of models read into memory during the query" },
    [LOADS] = { "/frames/loads", EBPO_H5_I64, 0, "number of subtrees loaded during the query" },
    [FRAME] = { "/clashes/frame", EBPO_H5_I64, 0, "row in /frames" },
    [INSTANCES] = { "/clashes/instances", EBPO_H5_I64, 2, "a and b, rows in /instances" },
    [KIND] = { "/clashes/kind", EBPO_H5_U8, 0,
               "1 near, 2 touching, 3 coplanar, 4 crossing, 5 protruding, 6 enclosed, "
               "7 duplicate" },
    [RELATION] = { "/clashes/relation", EBPO_H5_U8, 0,
                   "0 disjoint, 1 touching, 2 intersecting, 3 a inside b, 4 b inside a, 5 equal, "
                   "6 not requested" },
    [FACES] = { "/clashes/faces", EBPO_H5_I64, 2,
                "a face of a and a face of b that intersect or are nearest; -1: none" },
    [PAIRS] = { "/clashes/pairs", EBPO_H5_I64, 3,
                "numbers of pairs of faces: touching, coplanar, crossing" },
    [CONTACTS] = { "/clashes/contacts", EBPO_H5_I64, 0,
                   "number of lines of contact; -1: not known" },
    [CLEARANCE] = { "/clashes/clearance", EBPO_H5_F64, 0,
                    "required distance, in the scene's unit" },
    [DISTANCE] = { "/clashes/distance", EBPO_H5_F64, 0,
                   "distance of the faces, in the scene's unit" },
    [LOCATION] = { "/clashes/location", EBPO_H5_F64, 3,
                   "x, y, z in the world; nan: not requested" },
    [LOCATION_BOX] = { "/clashes/location_box", EBPO_H5_F64, 6,
                       "box of the contacts in the world: least x, y, z, greatest x, y, z" },
    [DEPTH] = { "/clashes/depth", EBPO_H5_F64, 4, "bounds of the depth of a in b, then of b in a" },
};

struct ebpo_scene_report {
    const ebpo_scene *scene;
    char *path;
    ebpo_publish target;
    ebpo_h5_out out;
    ebpo_h5_table table[TABLES];
    int64_t frames, clashes;
};

static ebpo_status put_meaning(ebpo_scene_report *r, ebpo_h5_id id, const char *meaning,
                               ebpo_error *error)
{
    return ebpo_h5_put_ascii(&r->out, id, "meaning", meaning, error);
}

/* --- the scene's content --- */

static const char *instance_name(const ebpo_scene *scene, uint64_t i)
{
    return scene->instances[i].description.name;
}

static const char *model_name(const ebpo_scene *scene, uint64_t i) { return scene->models[i].name; }

/* Writes names, each ended by a 0 byte, to a dataset. */
static ebpo_status put_names(ebpo_scene_report *r, const char *path,
                             const char *(*name)(const ebpo_scene *, uint64_t), uint64_t count,
                             ebpo_error *error)
{
    ebpo_h5_table table;
    ebpo_status status = ebpo_h5_make_table(&r->out, path, EBPO_H5_U8, 0, &table, error);
    if (status == EBPO_OK)
        status = put_meaning(r, table.id, "UTF-8, each name ended by a 0", error);
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++)
        status = ebpo_h5_append(&r->out, &table, name(r->scene, i), strlen(name(r->scene, i)) + 1,
                                error);
    ebpo_h5_close_table(&r->out, &table);
    return status;
}

static ebpo_status put_models(ebpo_scene_report *r, ebpo_error *error)
{
    uint64_t count = r->scene->instances_count;
    int64_t *model = ebpo_alloc(count, sizeof *model);
    if (!model)
        return ebpo_fail_memory(error, count * sizeof *model);
    for (uint64_t i = 0; i < count; i++)
        model[i] = (int64_t)r->scene->instances[i].description.model;
    ebpo_h5_table table;
    ebpo_status status =
        ebpo_h5_make_table(&r->out, "/instances/model", EBPO_H5_I64, 0, &table, error);
    if (status == EBPO_OK)
        status = put_meaning(r, table.id, "row of the instance's model in /models", error);
    if (status == EBPO_OK)
        status = ebpo_h5_append(&r->out, &table, model, count, error);
    ebpo_h5_close_table(&r->out, &table);
    free(model);
    return status;
}

static ebpo_status put_scene(ebpo_scene_report *r, ebpo_error *error)
{
    ebpo_status status =
        put_names(r, "/instances/names", instance_name, r->scene->instances_count, error);
    if (status == EBPO_OK)
        status = put_models(r, error);
    return status == EBPO_OK
               ? put_names(r, "/models/names", model_name, r->scene->models_count, error)
               : status;
}

/* --- the file --- */

static ebpo_status make_groups(ebpo_scene_report *r, ebpo_error *error)
{
    static const struct {
        const char *path, *meaning;
    } groups[] = {
        { "/instances", "rigid instances; row = index" },
        { "/models", "models; row = index" },
        { "/frames", "times that were evaluated, in order" },
        { "/clashes", "pairs of instances that intersect or are too near, frame by frame" },
    };
    ebpo_status status = EBPO_OK;
    for (size_t i = 0; i < sizeof groups / sizeof *groups && status == EBPO_OK; i++) {
        ebpo_h5_id id;
        status = ebpo_h5_make_plain_group(&r->out, groups[i].path, &id, error);
        if (status == EBPO_OK)
            status = put_meaning(r, id, groups[i].meaning, error);
        ebpo_h5_close_id(&r->out, id);
    }
    return status;
}

static ebpo_status make_tables(ebpo_scene_report *r, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < TABLES && status == EBPO_OK; i++) {
        status = ebpo_h5_make_table(&r->out, layout[i].path, layout[i].number, layout[i].cols,
                                    &r->table[i], error);
        if (status == EBPO_OK)
            status = put_meaning(r, r->table[i].id, layout[i].meaning, error);
    }
    return status;
}

static ebpo_status record_begin(ebpo_scene_report *r, const char *path, ebpo_error *error)
{
    ebpo_status status = ebpo_publish_begin(&r->target, path, error);
    if (status == EBPO_OK)
        status = ebpo_h5_create_plain(&r->out, ebpo_publish_path(&r->target), r->path, error);
    if (status == EBPO_OK)
        status = make_groups(r, error);
    if (status == EBPO_OK)
        status = put_scene(r, error);
    return status == EBPO_OK ? make_tables(r, error) : status;
}

ebpo_status ebpo_scene_report_new(const ebpo_scene *scene, const char *path,
                                  ebpo_scene_report **out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_scene_report *r = ebpo_alloc_zero(1, sizeof *r);
    char *shown = strdup(path);
    *out = NULL;
    if (!r || !shown) {
        free(r);
        free(shown);
        return ebpo_fail_memory(error, sizeof *r);
    }
    r->scene = scene;
    r->path = shown;
    r->target = (ebpo_publish)EBPO_PUBLISH_INIT;
    r->out = (ebpo_h5_out)EBPO_H5_OUT_INIT;
    for (int i = 0; i < TABLES; i++)
        r->table[i] = (ebpo_h5_table)EBPO_H5_TABLE_INIT;
    ebpo_status status = record_begin(r, path, error);
    if (status == EBPO_OK)
        *out = r;
    else
        ebpo_scene_report_free(r);
    return status;
}

static void close_tables(ebpo_scene_report *r)
{
    for (int i = 0; i < TABLES; i++)
        ebpo_h5_close_table(&r->out, &r->table[i]);
}

ebpo_status ebpo_scene_report_finish(ebpo_scene_report *r, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    close_tables(r);
    ebpo_status status = ebpo_h5_finish(&r->out, error);
    return status == EBPO_OK ? ebpo_publish_commit(&r->target, error) : status;
}

void ebpo_scene_report_free(ebpo_scene_report *r)
{
    if (!r)
        return;
    close_tables(r);
    ebpo_h5_discard(&r->out);
    ebpo_publish_abort(&r->target);
    free(r->path);
    free(r);
}

/* --- rows --- */

enum { ROWS = 256 };

/* A block of rows of /clashes that is written at once, one array for each dataset. */
typedef struct rows {
    int64_t frame[ROWS], instances[ROWS][2], faces[ROWS][2], pairs[ROWS][3], contacts[ROWS];
    uint8_t kind[ROWS], relation[ROWS];
    double clearance[ROWS], distance[ROWS], location[ROWS][3], location_box[ROWS][6],
        depth[ROWS][4];
} rows;

/* Returns an index or a count as a signed number; -1 for values that mean "none" or "not known". */
static int64_t record_number(uint64_t n) { return n > INT64_MAX ? -1 : (int64_t)n; }

static void fill_row(rows *out, uint64_t i, const ebpo_scene_clash *clash, int64_t frame)
{
    out->frame[i] = frame;
    out->instances[i][0] = record_number(clash->a);
    out->instances[i][1] = record_number(clash->b);
    out->kind[i] = (uint8_t)clash->kind;
    out->relation[i] = (uint8_t)clash->relation;
    out->faces[i][0] = record_number(clash->face_a);
    out->faces[i][1] = record_number(clash->face_b);
    out->pairs[i][0] = record_number(clash->touching);
    out->pairs[i][1] = record_number(clash->coplanar);
    out->pairs[i][2] = record_number(clash->crossing);
    out->contacts[i] = record_number(clash->contacts);
    out->clearance[i] = clash->clearance;
    out->distance[i] = clash->distance;
    memcpy(out->location[i], clash->location, sizeof clash->location);
    memcpy(out->location_box[i], clash->location_min, sizeof clash->location_min);
    memcpy(out->location_box[i] + 3, clash->location_max, sizeof clash->location_max);
    for (int k = 0; k < 2; k++) {
        out->depth[i][2 * k] = clash->depth[k].lo;
        out->depth[i][2 * k + 1] = clash->depth[k].hi;
    }
}

static ebpo_status put_rows(ebpo_scene_report *r, const rows *d, uint64_t count, ebpo_error *error)
{
    const void *const data[] = { d->frame,    d->instances, d->kind,         d->relation,
                                 d->faces,    d->pairs,     d->contacts,     d->clearance,
                                 d->distance, d->location,  d->location_box, d->depth };
    ebpo_status status = EBPO_OK;
    for (int i = FRAME; i < TABLES && status == EBPO_OK; i++)
        status = ebpo_h5_append(&r->out, &r->table[i], data[i - FRAME], count, error);
    r->clashes += (int64_t)count;
    return status;
}

static ebpo_status put_frame(ebpo_scene_report *r, const ebpo_scene_frame *f, uint64_t clashes,
                             ebpo_error *error)
{
    const int64_t n[] = { r->clashes,
                          record_number(clashes),
                          record_number(f->tested),
                          record_number(f->nanoseconds),
                          record_number(f->bytes_read),
                          record_number(f->models),
                          record_number(f->loads) };
    ebpo_status status = ebpo_h5_append(&r->out, &r->table[TIME], &f->time, 1, error);
    for (int i = FIRST_CLASH; i < FRAME && status == EBPO_OK; i++)
        status = ebpo_h5_append(&r->out, &r->table[i], &n[i - FIRST_CLASH], 1, error);
    return status;
}

ebpo_status ebpo_scene_report_add(ebpo_scene_report *r, const ebpo_scene_frame *frame,
                                  const ebpo_scene_clash *clashes, uint64_t count,
                                  ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    rows *block = ebpo_alloc(1, sizeof *block);
    if (!block)
        return ebpo_fail_memory(error, sizeof *block);
    ebpo_status status = put_frame(r, frame, count, error);
    for (uint64_t at = 0; at < count && status == EBPO_OK; at += ROWS) {
        uint64_t n = count - at < ROWS ? count - at : ROWS;
        for (uint64_t i = 0; i < n; i++)
            fill_row(block, i, &clashes[at + i], r->frames);
        status = put_rows(r, block, n, error);
    }
    r->frames++;
    free(block);
    return status;
}
