#include <ebpo/subset.h>

#include <math.h>
#include <string.h>

#include "core/error.h"
#include "format/reader.h"
#include "geometry/cells.h"
#include "derive/subset_parts.h"

enum { CHUNK_BUDGET = 64 << 20 };

uint32_t ebpo_profile_parts(ebpo_profile profile)
{
    switch (profile) {
    case EBPO_PROFILE_LOD: return EBPO_PART_PLANES | EBPO_PART_LEAF_PLANES | EBPO_PART_COLOURS;
    case EBPO_PROFILE_COLLISION: return EBPO_PART_PLANES | EBPO_PART_MESH;
    case EBPO_PROFILE_FULL: break;
    }
    return EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS | EBPO_PART_LEAF_PLANES |
           EBPO_PART_ATTRIBUTES | EBPO_PART_COLOURS;
}

/* The box against the root cell and against one that was kept before: then nothing but their common
 * part is here. */
static ebpo_status resolve_box(ebpo_cutting *c)
{
    const ebpo_subset_options *o = c->options;
    const char *shown = c->file->in.shown;
    ebpo_info *info = &c->out->info;
    if (!o->boxed)
        return EBPO_OK;
    for (int k = 0; k < 3; k++) {
        if (!isfinite(o->min[k]) || !isfinite(o->max[k]) || !(o->min[k] <= o->max[k]))
            return ebpo_fail_file(c->error, EBPO_E_ARGUMENT, shown,
                                  "a box needs finite corners, the lower one first on each axis");
        if (ebpo_wall(&c->box, k, 0, 0) > o->max[k] || ebpo_wall(&c->box, k, 0, 1) < o->min[k])
            return ebpo_fail_file(c->error, EBPO_E_ARGUMENT, shown,
                                  "the box does not meet the model, which lies within %.17g %.17g "
                                  "%.17g and %.17g %.17g %.17g",
                                  c->box.origin[0], c->box.origin[1], c->box.origin[2],
                                  ebpo_wall(&c->box, 0, 0, 1), ebpo_wall(&c->box, 1, 0, 1),
                                  ebpo_wall(&c->box, 2, 0, 1));
        if (c->from->boxed &&
            (c->from->kept_box[k] > o->max[k] || c->from->kept_box[3 + k] < o->min[k]))
            return ebpo_fail_file(c->error, EBPO_E_ARGUMENT, shown,
                                  "the box does not meet the one that this file was cut to, %.17g "
                                  "%.17g %.17g to %.17g %.17g %.17g; take the subset of the "
                                  "original",
                                  c->from->kept_box[0], c->from->kept_box[1], c->from->kept_box[2],
                                  c->from->kept_box[3], c->from->kept_box[4], c->from->kept_box[5]);
    }
    for (int k = 0; k < 3; k++) {
        info->kept_box[k] = c->from->boxed ? fmax(o->min[k], c->from->kept_box[k]) : o->min[k];
        info->kept_box[3 + k] =
            c->from->boxed ? fmin(o->max[k], c->from->kept_box[3 + k]) : o->max[k];
    }
    info->boxed = true;
    return EBPO_OK;
}

static ebpo_status resolve_options(ebpo_cutting *c)
{
    const ebpo_subset_options *o = c->options;
    ebpo_info *info = &c->out->info;
    int deepest = c->from->level_count - 1;
    if (o->last_level < -1 || o->last_level >= EBPO_LEVELS_MAX ||
        (o->last_level > deepest && !c->from->pruned))
        return ebpo_fail_file(c->error, EBPO_E_ARGUMENT, c->file->in.shown,
                              "there is no level %d; the file has levels 0 to %d", o->last_level,
                              deepest);
    if (!(o->max_error >= 0) || !isfinite(o->max_error))
        return ebpo_fail(c->error, EBPO_E_ARGUMENT,
                         "maximum error %g: give a length above 0, or 0 to keep everything",
                         o->max_error);
    c->last_level = o->last_level < 0 || o->last_level > deepest ? deepest : o->last_level;
    c->parts = c->from->parts & o->parts;
    if (!(c->parts & EBPO_PART_MESH))
        c->parts &= ~(uint32_t)(EBPO_PART_MAPS | EBPO_PART_ATTRIBUTES);
    c->box = ebpo_root_box(c->from);
    *info = *c->from;
    if (!c->from->pruned)
        memcpy(info->subset_of, c->from->content_sha256, sizeof info->subset_of);
    if (c->last_level < deepest)
        info->cut_levels = c->last_level + 1;
    if (o->max_error > 0)
        info->kept_error = o->max_error;
    return resolve_box(c);
}

/* Without a box whole arrays will be read: a source far away then fetches them in few requests. */
static void announce_cut(const ebpo_cutting *c)
{
    ebpo_expected e = EBPO_EXPECTED_INIT(c->file);
    if (c->last_level > c->from->subtree_level)
        ebpo_expect_top(c->file);
    if (c->options->boxed || c->need || !ebpo_input_expects(&c->file->in))
        return;
    for (int level = 0; level <= c->last_level; level++)
        for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++)
            if (ebpo_schema_is_held(id) &&
                ebpo_schema[id].needs & (c->parts | EBPO_NEEDS_SOLID | EBPO_NEEDS_ALWAYS))
                ebpo_expect_array(&e, &c->file->level_array[level][id]);
    if (c->last_level == c->from->level_count - 1)
        ebpo_expect_root(&e, c->parts);
    ebpo_expect_all(&e);
}

static void name_mesh(ebpo_tree *out)
{
    memcpy(out->mesh.source_name, out->info.source_name, sizeof out->mesh.source_name);
    memcpy(out->mesh.source_format, out->info.source_format, sizeof out->mesh.source_format);
    memcpy(out->mesh.source_sha256, out->info.source_sha256, sizeof out->mesh.source_sha256);
    out->mesh.source_size = out->info.source_size;
}

ebpo_status ebpo_subset_tree(ebpo_tree *out, const ebpo_file *file,
                             const ebpo_subset_options *options, ebpo_error *error)
{
    ebpo_tolerance *need = NULL;
    ebpo_status status = EBPO_OK;
    if (options->max_error > 0)
        status = ebpo_tolerance_open(&need, file, options->parts & EBPO_PART_PLANES,
                                     options->threads, options->progress, error);
    if (status == EBPO_OK)
        status = ebpo_subset_tree_within(out, file, options, need, error);
    ebpo_tolerance_close(need);
    return status;
}

ebpo_status ebpo_subset_tree_within(ebpo_tree *out, const ebpo_file *file,
                                    const ebpo_subset_options *options, ebpo_tolerance *need,
                                    ebpo_error *error)
{
    ebpo_cutting c = { .file = file,
                       .from = ebpo_file_info(file),
                       .options = options,
                       .out = out,
                       .error = error,
                       .need = options->max_error > 0 ? need : NULL };
    memset(out, 0, sizeof *out);
    ebpo_status status = resolve_options(&c);
    if (status == EBPO_OK)
        announce_cut(&c);
    if (status == EBPO_OK)
        status = ebpo_chunks_make(&c.chunks, file, CHUNK_BUDGET, error);
    if (status == EBPO_OK)
        status = ebpo_cut_levels(&c);
    if (status == EBPO_OK && c.parts & EBPO_PART_MESH)
        status = ebpo_cut_faces(&c);
    ebpo_chunks_free(c.chunks);
    if (status != EBPO_OK) {
        ebpo_tree_free(out);
        return status;
    }
    bool lost_planes = c.from->parts & ~c.parts & EBPO_PART_PLANES;
    out->info.parts = c.parts;
    if (((options->boxed || c.need) && out->info.pruned) || lost_planes)
        ebpo_cut_volumes(&c);
    if (!out->info.pruned) {
        out->info.cut_levels = 0;
        out->info.boxed = false;
        out->info.kept_error = 0;
    }
    name_mesh(out);
    return EBPO_OK;
}

ebpo_write_options ebpo_subset_write_options(const ebpo_subset_options *options)
{
    ebpo_write_options write = EBPO_WRITE_OPTIONS_INIT;
    write.codec = options->codec;
    write.codec_level = options->codec_level;
    write.threads = options->threads;
    write.progress = options->progress;
    write.subtree_faces = options->subtree_faces;
    write.face_coding = options->face_coding;
    return write;
}
