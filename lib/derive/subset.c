/* Makes subsets. A subset is a smaller file that contains only some levels or parts, or only the
 * data in a box. With max_error, a subset omits all nodes below a node whose envelope is within
 * max_error of the model. The envelope of a node is a convex polyhedron that contains the part of
 * the solid in the node's cell. This source file
 * - counts the bytes of a file that a subset needs, from headers and tables alone;
 * - resolves the options and makes the subset's tree, with subset_levels.c and subset_faces.c;
 * - searches for the smallest max_error whose subset fits a target size;
 * - publishes the result.
 *
 * A larger max_error gives a smaller file. For a target size, coarse subsets are tried first,
 * because they are small and quick to make. All trials share the results of the searches for bounds
 * of envelopes (error_bound.h). Trials are written beside the output. The finest trial that fits is
 * itself published, so its size is the size that was measured. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include <ebpo/subset.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "derive/subset_parts.h"
#include "format/border_loops.h"
#include "format/file_nodes.h"
#include "format/level_volumes.h"
#include "format/patch_table.h"
#include "format/reader.h"
#include "format/subtree_index.h"
#include "format/surface_patches.h"
#include "format/write_file.h"
#include "geometry/cells.h"
#include "io/publish.h"

/* --- counting the bytes that a subset needs --- */

enum { COUNTING_BUDGET = 16 << 20 }; /* memory of each cache of chunks, in bytes */

typedef struct counting {
    const ebpo_file *file;
    const ebpo_subset_options *options;
    ebpo_box box;
    ebpo_chunks *top; /* cache of the chunks that are read to find subtrees */
    /* a second cache, which is never used for reading, so that no chunk of a subtree is in memory
     * and all of them are counted */
    ebpo_chunks *subtree_chunks;
    ebpo_hints hints; /* collects the chunks that are needed, and counts their bytes */
    uint32_t needs;   /* the data that the subset needs (EBPO_NEEDS_...) */
    int last_level;   /* deepest level that is counted */
    ebpo_subset_reads *out;
    ebpo_error *error;
} counting;

static void count_subtree(counting *c, uint64_t index)
{
    c->out->subtrees++;
    ebpo_subtrees_hint(c->subtree_chunks, &c->hints, index, 1, c->needs, c->last_level,
                       c->needs & EBPO_NEEDS_MESH);
}

/* Counts the subtrees at or below a gray node. A subtree counts if its root's cell intersects the
 * box. */
static ebpo_status descend_to_subtrees(counting *c, const ebpo_node *gray)
{
    const ebpo_subset_options *o = c->options;
    uint16_t types;
    uint64_t ranks[4];
    if (o->boxed && !ebpo_cell_intersects(&c->box, gray->cell, o->min, o->max))
        return EBPO_OK;
    if (gray->cell.level == c->file->info.subtree_level) {
        count_subtree(c, gray->rank);
        return EBPO_OK;
    }
    ebpo_status status = ebpo_chunks_children(c->top, gray, &types, ranks, c->error);
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++) {
        ebpo_node child = ebpo_node_child(gray, octant, types, ranks);
        if (child.type == EBPO_GRAY)
            status = descend_to_subtrees(c, &child);
    }
    return status;
}

static ebpo_status count_subtrees(counting *c)
{
    ebpo_node root;
    ebpo_status status = ebpo_chunks_make(&c->top, c->file, COUNTING_BUDGET, c->error);
    if (status == EBPO_OK)
        status = ebpo_chunks_make(&c->subtree_chunks, c->file, COUNTING_BUDGET, c->error);
    if (status == EBPO_OK)
        status = ebpo_chunks_root(c->top, &root, c->error);
    if (status == EBPO_OK && root.type == EBPO_GRAY)
        status = descend_to_subtrees(c, &root);
    ebpo_chunks_free(c->top);
    ebpo_chunks_free(c->subtree_chunks);
    return status;
}

static void count_levels(counting *c, int last)
{
    for (int level = 0; level <= last; level++)
        for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++)
            if (ebpo_schema[id].needs & c->needs)
                ebpo_hint_array(&c->hints, &c->file->level_array[level][id]);
}

ebpo_status ebpo_subset_count_reads(const ebpo_file *file, const ebpo_subset_options *options,
                                    ebpo_subset_reads *out, ebpo_error *error)
{
    const ebpo_info *info = ebpo_file_info(file);
    int deepest = info->level_count - 1;
    counting c = { .file = file,
                   .options = options,
                   .box = ebpo_root_box(info),
                   .hints = EBPO_HINTS_INIT(file),
                   .needs = (info->parts & options->parts) | EBPO_NEEDS_ALWAYS |
                            (info->solid ? (uint32_t)EBPO_NEEDS_SOLID : 0),
                   .last_level = options->last_level,
                   .out = out,
                   .error = error };
    *out = (ebpo_subset_reads){ 0 };
    ebpo_status status = ebpo_file_locate(file, NULL, error);
    if (status != EBPO_OK)
        return status;
    if (c.last_level < 0 || c.last_level > deepest || c.needs & EBPO_NEEDS_MESH)
        c.last_level = deepest;
    c.hints.counts_bytes = true;
    /* true: the subset needs only some of the subtrees */
    bool divided = options->boxed && info->subtree_level && c.last_level > info->subtree_level;
    out->total_subtrees = info->subtree_level ? info->level[info->subtree_level].gray_count : 0;
    if (!divided && c.last_level > info->subtree_level)
        out->subtrees = out->total_subtrees;
    count_levels(&c, divided ? info->subtree_level : c.last_level);
    if (divided)
        status = count_subtrees(&c);
    else
        ebpo_hint_root(&c.hints, c.needs);
    out->bytes = ebpo_hints_bytes(&c.hints);
    return status;
}

/* --- the tree of a subset --- */

enum { CHUNK_BUDGET = 64 << 20 }; /* memory of the cache of chunks, in bytes */

uint32_t ebpo_profile_parts(ebpo_profile profile)
{
    switch (profile) {
    case EBPO_PROFILE_LOD:
        return EBPO_PART_PLANES | EBPO_PART_LEAF_PLANES | EBPO_PART_COLOURS | EBPO_PART_SURFACE;
    case EBPO_PROFILE_COLLISION: return EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_BORDER;
    case EBPO_PROFILE_FULL: break;
    }
    return EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS | EBPO_PART_LEAF_PLANES |
           EBPO_PART_ATTRIBUTES | EBPO_PART_COLOURS | EBPO_PART_BORDER | EBPO_PART_SURFACE;
}

/* Checks that the box intersects the root cell. If the file is itself a subset for a box, also
 * checks that the two boxes intersect, because the file has nothing outside its box. Sets kept_box
 * of the subset's info. */
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
                                  "a box must have finite corners, and the first corner must not "
                                  "be above the second one on any axis");
        if (ebpo_cell_face(&c->box, k, 0, 0) > o->max[k] ||
            ebpo_cell_face(&c->box, k, 0, 1) < o->min[k])
            return ebpo_fail_file(c->error, EBPO_E_ARGUMENT, shown,
                                  "the box does not intersect the model, which is within %.17g "
                                  "%.17g %.17g and %.17g %.17g %.17g",
                                  c->box.origin[0], c->box.origin[1], c->box.origin[2],
                                  ebpo_cell_face(&c->box, 0, 0, 1),
                                  ebpo_cell_face(&c->box, 1, 0, 1),
                                  ebpo_cell_face(&c->box, 2, 0, 1));
        if (c->from->boxed &&
            (c->from->kept_box[k] > o->max[k] || c->from->kept_box[3 + k] < o->min[k]))
            return ebpo_fail_file(c->error, EBPO_E_ARGUMENT, shown,
                                  "the box does not intersect the box of this subset, %.17g "
                                  "%.17g %.17g to %.17g %.17g %.17g; make the subset from the "
                                  "original file",
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
                         "maximum error %g: give a length above 0, or 0 for no maximum error",
                         o->max_error);
    c->last_level = o->last_level < 0 || o->last_level > deepest ? deepest : o->last_level;
    c->parts = c->from->parts & o->parts;
    if (!(c->parts & EBPO_PART_MESH))
        c->parts &= ~(uint32_t)(EBPO_PART_MAPS | EBPO_PART_ATTRIBUTES | EBPO_PART_BORDER);
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

/* Sends prefetch hints, so that a remote source fetches the data in few requests: for the data that
 * locate subtrees, if subtrees are read, and for whole arrays. With a box or a max_error, whole
 * arrays are not read, so no hints for them are sent. */
static void hint_cut(const ebpo_cutting *c)
{
    ebpo_hints e = EBPO_HINTS_INIT(c->file);
    if (c->last_level > c->from->subtree_level)
        ebpo_hint_top(c->file);
    if (c->options->boxed || c->tolerance || !ebpo_input_prefetches(&c->file->in))
        return;
    for (int level = 0; level <= c->last_level; level++)
        for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++)
            if (ebpo_schema_is_held(id) &&
                ebpo_schema[id].needs & (c->parts | EBPO_NEEDS_SOLID | EBPO_NEEDS_ALWAYS))
                ebpo_hint_array(&e, &c->file->level_array[level][id]);
    if (c->last_level == c->from->level_count - 1)
        ebpo_hint_root(&e, c->parts);
    ebpo_hint_all(&e);
}

static void name_mesh(ebpo_tree *out)
{
    memcpy(out->mesh.source_name, out->info.source_name, sizeof out->mesh.source_name);
    memcpy(out->mesh.source_format, out->info.source_format, sizeof out->mesh.source_format);
    memcpy(out->mesh.source_sha256, out->info.source_sha256, sizeof out->mesh.source_sha256);
    out->mesh.source_size = out->info.source_size;
}

/* Lists the patches of the simplified surface that are kept, and returns their number. Patches of
 * nodes in the kept levels are kept. With a box, a patch other than the root's is kept only if the
 * cell of its node's parent intersects the box. `kept`: [table->count] false on entry. */
static uint64_t list_patches(const ebpo_cutting *c, const ebpo_patch_table *table, bool *kept,
                             uint64_t *list)
{
    const ebpo_subset_options *o = c->options;
    int last = c->out->info.level_count - 1;
    uint64_t count = 0;
    kept[0] = true;
    for (uint64_t i = 0; i < table->count; i++) {
        ebpo_cell cell =
            ebpo_cell_of_octcode(table->row[EBPO_PATCH_COLUMNS * i + EBPO_PATCH_OCTCODE]);
        if (!kept[i] || cell.level > last)
            continue;
        list[count++] = i;
        if (!o->boxed || ebpo_cell_intersects(&c->box, cell, o->min, o->max))
            for (uint64_t child = table->child[i]; child < table->child_end[i]; child++)
                kept[child] = true;
    }
    return count;
}

/* Reads the patches that are kept. With a maximum error, leaves are removed with their faces, so
 * the part `surface` is omitted. */
static ebpo_status cut_surface(ebpo_cutting *c)
{
    ebpo_surface *surface = &c->out->surface;
    ebpo_patch_table table = { 0 };
    ebpo_hints hints = EBPO_HINTS_INIT(c->file);
    ebpo_status status =
        c->tolerance ? EBPO_OK : ebpo_patch_table_read(&table, c->chunks, c->error);
    uint64_t *list = ebpo_alloc(table.count, sizeof *list), count = 0;
    bool *kept = ebpo_alloc_zero(table.count, sizeof *kept);
    if (status == EBPO_OK && !(list && kept))
        status = ebpo_fail_memory(c->error, table.count * (sizeof *list + sizeof *kept));
    if (status == EBPO_OK && table.count)
        count = list_patches(c, &table, kept, list);
    for (uint64_t i = 0; i < count; i++)
        ebpo_patch_hint(&table, c->chunks, &hints, list[i]);
    ebpo_hint_all(&hints);
    if (count)
        status = ebpo_patches_take(&table, c->chunks, list, count, surface, c->error);
    if (surface->patch_count == 0)
        c->parts &= ~(uint32_t)EBPO_PART_SURFACE;
    ebpo_surface_summarise(surface, &c->out->info);
    ebpo_check check = ebpo_reader_check(c->file, NULL); /* names the input in messages */
    if (status == EBPO_OK && surface->patch_count)
        status = ebpo_check_surface(&check, &c->out->info, surface, c->error);
    free(list);
    free(kept);
    ebpo_patch_table_free(&table);
    return status;
}

/* Computes the volumes of envelopes if nodes were cut out of levels, or planes were omitted. */
static void measure_levels(ebpo_cutting *c)
{
    ebpo_tree *out = c->out;
    double gray[EBPO_LEVELS_MAX], leaf[EBPO_LEVELS_MAX];
    uint32_t lost = c->from->parts & ~c->parts;
    bool all = ((c->options->boxed || c->tolerance) && out->info.pruned) || lost & EBPO_PART_PLANES;
    if (!all && !(lost & EBPO_PART_LEAF_PLANES))
        return;
    ebpo_tree_volumes(out, c->parts, gray, leaf);
    for (int i = 0; i < out->info.level_count; i++) {
        out->level[i].gray_volume = all ? gray[i] : out->level[i].gray_volume;
        out->level[i].leaf_volume = leaf[i];
    }
}

/* Makes the tree of the subset. `tolerance` decides which envelopes are close enough to the model;
 * it may be NULL if there is no max_error. */
static ebpo_status subset_tree_within(ebpo_tree *out, const ebpo_file *file,
                                      const ebpo_subset_options *options, ebpo_tolerance *tolerance,
                                      ebpo_error *error)
{
    ebpo_cutting c = { .file = file,
                       .from = ebpo_file_info(file),
                       .options = options,
                       .out = out,
                       .error = error,
                       .tolerance = options->max_error > 0 ? tolerance : NULL };
    memset(out, 0, sizeof *out);
    ebpo_status status = resolve_options(&c);
    if (status == EBPO_OK)
        hint_cut(&c);
    if (status == EBPO_OK)
        status = ebpo_chunks_make(&c.chunks, file, CHUNK_BUDGET, error);
    if (status == EBPO_OK)
        status = ebpo_cut_levels(&c);
    if (status == EBPO_OK && c.parts & EBPO_PART_MESH)
        status = ebpo_cut_faces(&c);
    if (status == EBPO_OK && c.parts & EBPO_PART_BORDER)
        status = ebpo_border_read(file, &out->border, error);
    if (status == EBPO_OK && c.parts & EBPO_PART_SURFACE)
        status = cut_surface(&c);
    ebpo_chunks_free(c.chunks);
    if (status != EBPO_OK) {
        ebpo_tree_free(out);
        return status;
    }
    out->info.parts = c.parts;
    measure_levels(&c);
    if (!out->info.pruned) {
        out->info.cut_levels = 0;
        out->info.boxed = false;
        out->info.kept_error = 0;
    }
    name_mesh(out);
    return EBPO_OK;
}

ebpo_status ebpo_subset_tree(ebpo_tree *out, const ebpo_file *file,
                             const ebpo_subset_options *options, ebpo_error *error)
{
    ebpo_tolerance *tolerance = NULL;
    ebpo_status status = EBPO_OK;
    if (options->max_error > 0)
        status = ebpo_tolerance_open(&tolerance, file, options->parts & EBPO_PART_PLANES,
                                     options->threads, options->progress, error);
    if (status == EBPO_OK)
        status = subset_tree_within(out, file, options, tolerance, error);
    ebpo_tolerance_close(tolerance);
    return status;
}

/* Returns the options for writing the tree of a subset with all its parts. */
static ebpo_write_options subset_write_options(const ebpo_subset_options *options)
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

/* --- subsets for a target size --- */

/* The search ends when fitting.fits is at most this multiple of fitting.too_large. */
static const double size_precision = 1.01;
/* bracket_size does not halve max_error below the coarsest max_error times this factor. */
static const double least_share = 0x1p-40;

/* The search for the smallest max_error whose file fits the target size. */
typedef struct fitting {
    const ebpo_file *file;
    ebpo_subset_options *options;
    ebpo_publish trial; /* file of the current trial */
    ebpo_publish best;  /* file of the finest trial that fits */
    ebpo_tolerance *tolerance;
    double fits;                     /* least max_error so far whose file fits */
    double too_large;                /* largest max_error so far whose file is too large; 0: none */
    uint64_t fit_bytes, large_bytes; /* sizes of the files for `fits` and `too_large` */
    ebpo_error *error;
} fitting;

/* Writes a trial file for a max_error, and sets *bytes to its size. If the file fits, it becomes
 * f->best, because it is finer than all earlier files that fit. Sets *pruned to true if the file
 * has pruned nodes. */
static ebpo_status try_error(fitting *f, double max_error, uint64_t *bytes, bool *pruned)
{
    ebpo_tree tree;
    struct stat st;
    ebpo_subset_options o = *f->options;
    o.max_error = max_error;
    ebpo_status status = subset_tree_within(&tree, f->file, &o, f->tolerance, f->error);
    if (status != EBPO_OK)
        return status;
    *pruned = tree.info.pruned;
    ebpo_write_options write = subset_write_options(&o);
    status =
        ebpo_tree_write_into(&tree, ebpo_publish_path(&f->trial), f->trial.shown, &write, f->error);
    ebpo_tree_free(&tree);
    if (status == EBPO_OK && stat(ebpo_publish_path(&f->trial), &st) != 0)
        status = ebpo_fail_errno(f->error, f->trial.shown, "cannot get the size of the trial file");
    if (status != EBPO_OK)
        return status;
    *bytes = (uint64_t)st.st_size;
    if (*bytes <= f->options->target_bytes) {
        ebpo_publish swapped = f->best;
        f->best = f->trial;
        f->trial = swapped;
    }
    return EBPO_OK;
}

/* Tries subsets, beginning with the coarsest one, with half the max_error each time. Ends when a
 * file is too large, or has no pruned nodes (then *pruned is false). f->too_large stays 0 if no
 * file is too large. */
static ebpo_status bracket_size(fitting *f, bool *pruned)
{
    uint64_t bytes = 0;
    double coarsest = 0;
    ebpo_status status = ebpo_tolerance_max(f->tolerance, &coarsest, f->error);
    *pruned = true;
    if (status == EBPO_OK)
        status = try_error(f, coarsest, &bytes, pruned);
    if (status == EBPO_OK && bytes > f->options->target_bytes)
        return ebpo_fail_file(f->error, EBPO_E_ARGUMENT, f->file->in.shown,
                              "no subset with these parts fits in %" PRIu64
                              " bytes; the smallest one has %" PRIu64
                              " bytes; give a larger size or fewer parts",
                              f->options->target_bytes, bytes);
    f->fits = coarsest;
    f->fit_bytes = bytes;
    f->too_large = 0;
    for (double e = coarsest / 2;
         status == EBPO_OK && *pruned && f->too_large == 0 && e > coarsest * least_share; e /= 2) {
        status = try_error(f, e, &bytes, pruned);
        bool fits = bytes <= f->options->target_bytes;
        *(fits ? &f->fits : &f->too_large) = e;
        *(fits ? &f->fit_bytes : &f->large_bytes) = bytes;
    }
    return status;
}

/* Returns the max_error to try next, between f->too_large and f->fits. These two differ by at most
 * a factor of 2, and the size changes almost linearly between them. The result is halfway between
 * the linear interpolation and the middle, so that both ends of the interval move within a few
 * trials. Functions of libm are not used, because their results differ between systems, and
 * max_error is stored in the file. */
static double next_guess(const fitting *f)
{
    double share = .5;
    if (f->large_bytes > f->fit_bytes)
        share = (double)(f->large_bytes - f->options->target_bytes) /
                (double)(f->large_bytes - f->fit_bytes);
    share = .5 * share + .25;
    return f->too_large + share * (f->fits - f->too_large);
}

/* Searches for the smallest max_error whose file fits. The best trial is in f->best. */
static ebpo_status find_error(fitting *f)
{
    uint64_t bytes = 0;
    bool pruned = false;
    /* The subset with all nodes (max_error 0) is tried first if the target is at least a quarter of
     * the file's size. It would hardly fit a smaller target. With choose_parts, the caller has
     * already tried this subset. */
    bool may_fit =
             !f->options->choose_parts && f->options->target_bytes >= f->file->info.file_bytes / 4,
         tried_all = f->options->choose_parts || may_fit;
    ebpo_status status = may_fit ? try_error(f, 0, &bytes, &pruned) : EBPO_OK;
    if (status != EBPO_OK || (may_fit && bytes <= f->options->target_bytes))
        return status;
    status = bracket_size(f, &pruned);
    /* All trials fit, but even the finest trial has pruned nodes, because envelopes that coincide
     * with the solid are pruned for any max_error above 0. */
    if (status == EBPO_OK && f->too_large == 0 && pruned && !tried_all)
        return try_error(f, 0, &bytes, &pruned);
    while (status == EBPO_OK && f->too_large > 0 && f->fits > size_precision * f->too_large) {
        double e = next_guess(f);
        if (!(e > f->too_large) || !(e < f->fits))
            break;
        status = try_error(f, e, &bytes, &pruned);
        bool fits = bytes <= f->options->target_bytes;
        *(fits ? &f->fits : &f->too_large) = e;
        *(fits ? &f->fit_bytes : &f->large_bytes) = bytes;
    }
    return status;
}

/* Tries the profiles (sets of parts) with all nodes (max_error 0), beginning with the largest
 * profile. Sets *found if a profile fits. */
static ebpo_status choose_parts(fitting *f, bool *found)
{
    static const ebpo_profile order[] = { EBPO_PROFILE_FULL, EBPO_PROFILE_COLLISION,
                                          EBPO_PROFILE_LOD };
    ebpo_status status = EBPO_OK;
    *found = false;
    for (size_t i = 0; i < sizeof order / sizeof *order && status == EBPO_OK && !*found; i++) {
        uint64_t bytes = 0;
        bool pruned = false;
        f->options->parts = ebpo_profile_parts(order[i]);
        status = try_error(f, 0, &bytes, &pruned);
        *found = status == EBPO_OK && bytes <= f->options->target_bytes;
    }
    return status;
}

/* Makes the subset for options->target_bytes, and publishes it as `path`. Changes
 * options->max_error and options->parts. */
static ebpo_status subset_fit(const ebpo_file *file, const char *path, ebpo_subset_options *options,
                              ebpo_error *error)
{
    fitting f = { .file = file,
                  .options = options,
                  .trial = EBPO_PUBLISH_INIT,
                  .best = EBPO_PUBLISH_INIT,
                  .error = error };
    bool done = false;
    if (options->max_error != 0)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, file->in.shown,
                              "a maximum error and a target size cannot be combined; give one of "
                              "them");
    ebpo_status status = ebpo_publish_begin(&f.trial, path, error);
    if (status == EBPO_OK)
        status = ebpo_publish_begin(&f.best, path, error);
    if (status == EBPO_OK && options->choose_parts)
        status = choose_parts(&f, &done);
    if (status == EBPO_OK && !done)
        status = ebpo_tolerance_open(&f.tolerance, file, options->parts & EBPO_PART_PLANES,
                                     options->threads, options->progress, error);
    if (status == EBPO_OK && !done)
        status = find_error(&f);
    ebpo_tolerance_close(f.tolerance);
    if (status == EBPO_OK) {
        ebpo_publish_expect_input(&f.best, &file->in);
        status = ebpo_publish_commit(&f.best, error);
    }
    ebpo_publish_abort(&f.best);
    ebpo_publish_abort(&f.trial);
    return status;
}

/* --- publishing --- */

uint64_t ebpo_subset_memory(uint64_t face_count, uint32_t leaf_faces)
{
    /* Measured memory in bytes. OF_MESH: for each face, memory of the mesh and the faces' bounds.
     * OF_LEAVES / leaf_faces, but at most OF_LEAVES_MAX: for each face, memory of the leaves; the
     * smaller the leaves, the more leaves there are. ALWAYS: memory for everything else. */
    enum { OF_MESH = 130, OF_LEAVES = 1800, OF_LEAVES_MAX = 430, ALWAYS = 16 << 20 };
    double leaves = OF_LEAVES / (double)leaf_faces;
    return (uint64_t)((double)face_count *
                          (OF_MESH + (leaves < OF_LEAVES_MAX ? leaves : OF_LEAVES_MAX)) +
                      ALWAYS);
}

ebpo_status ebpo_subset(const ebpo_file *file, const char *path, const ebpo_subset_options *options,
                        ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_subset_options wanted = EBPO_SUBSET_OPTIONS_INIT;
    ebpo_publish out = EBPO_PUBLISH_INIT;
    ebpo_tree tree;
    ebpo_status status = EBPO_TAKE(ebpo_subset_options, &wanted, options, error);
    if (status != EBPO_OK)
        return status;
    if (wanted.target_bytes)
        return subset_fit(file, path, &wanted, error);
    status = ebpo_subset_tree(&tree, file, &wanted, error);
    if (status != EBPO_OK)
        return status;
    ebpo_write_options write = subset_write_options(&wanted);
    status = ebpo_publish_begin(&out, path, error);
    if (status == EBPO_OK) {
        ebpo_publish_expect_input(&out, &file->in);
        status = ebpo_tree_write_into(&tree, ebpo_publish_path(&out), path, &write, error);
    }
    ebpo_tree_free(&tree);
    if (status == EBPO_OK)
        status = ebpo_publish_commit(&out, error);
    ebpo_publish_abort(&out);
    return status;
}

ebpo_status ebpo_subset_of_tree(ebpo_tree *tree, const char *path,
                                const ebpo_subset_options *options, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_subset_options wanted = EBPO_SUBSET_OPTIONS_INIT;
    ebpo_publish original = EBPO_PUBLISH_INIT;
    ebpo_file *file = NULL;
    ebpo_status status = EBPO_TAKE(ebpo_subset_options, &wanted, options, error);
    ebpo_write_options write = subset_write_options(&wanted);
    if (status == EBPO_OK)
        status = ebpo_publish_begin(&original, path, error);
    if (status == EBPO_OK)
        status = ebpo_tree_write_into(tree, ebpo_publish_path(&original), path, &write, error);
    ebpo_tree_free(tree);
    if (status == EBPO_OK)
        status = ebpo_open_own(ebpo_publish_path(&original), &file, error);
    if (status == EBPO_OK)
        status = ebpo_subset(file, path, &wanted, error);
    ebpo_close(file);
    ebpo_publish_abort(&original);
    return status;
}
