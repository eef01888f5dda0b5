/* Chooses patches of the simplified surface for an observer, reads them, and joins them to a mesh.
 * A patch approximates the faces below a node (format/surface_patches.h).
 *
 * The choice begins with the patch of the root. The patch with the greatest error in the image is
 * replaced by the patches of its node's children, until no error is greater than options.pixels. If
 * the children have no patches and options.faces is true, the patch is replaced by the model's
 * faces, except in a subset: there, patches have the face numbers of the original file. The errors
 * are in the table of patches, so only chosen patches are read. If there is a limit of bytes, the
 * choice ends before the chunks of the next patches would exceed the limit. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "levels/surface_mesh.h"
#include "levels/view_cut.h"

typedef struct choosing {
    const ebpo_patch_table *table;
    ebpo_chunks *chunks;
    const ebpo_viewpoint *viewpoint;
    const ebpo_view_options *options;
    const ebpo_info *info;
    ebpo_box box;
    bool faces; /* patches may be replaced by faces */
    /* the patches chosen so far, as a heap (view_cut.h); child_group: index of a patch */
    ebpo_frontier frontier;
    /* missing chunks of the patches chosen so far; NULL: no limit of bytes */
    ebpo_chunk_keys *keys;
    uint64_t *chosen; /* [chosen_count] patches that are drawn */
    /* [replaced_count] patches that are replaced by faces, greatest error first */
    uint64_t *replaced;
    uint64_t chosen_count, replaced_count;
} choosing;

static ebpo_octcode octcode_of(const choosing *c, uint64_t patch)
{
    return c->table->row[EBPO_PATCH_COLUMNS * patch + EBPO_PATCH_OCTCODE];
}

static ebpo_seen see_patch(const choosing *c, uint64_t patch)
{
    return ebpo_viewpoint_see(c->viewpoint, &c->box, ebpo_cell_of_octcode(octcode_of(c, patch)));
}

/* Returns the error of a patch in pixels; NAN without an observer. */
static double pixels_of(const choosing *c, uint64_t patch, ebpo_seen sight)
{
    double error = ebpo_patch_table_error(c->table, c->info, patch);
    return error > 0 || !c->viewpoint->has_observer
               ? ebpo_viewpoint_length(c->viewpoint, error, sight.distance2)
               : 0;
}

/* Returns the class of a patch in the order in which patches are replaced. EBPO_TURN_NEVER: the
 * patch is drawn and not replaced. */
static ebpo_turn turn_of(const choosing *c, uint64_t patch, ebpo_seen sight)
{
    const ebpo_view_options *o = c->options;
    int level = ebpo_octcode_level(octcode_of(c, patch));
    bool divided = c->table->child_end[patch] > c->table->child[patch];
    if ((!divided && !c->faces) || (o->level >= 0 && level >= o->level) ||
        (o->pixels > 0 && pixels_of(c, patch, sight) <= o->pixels) ||
        (!isinf(o->distance) &&
         ebpo_viewpoint_distance(c->viewpoint, sight.distance2) > o->distance))
        return EBPO_TURN_NEVER;
    if (sight.seen)
        return EBPO_TURN_SEEN;
    return o->unseen == EBPO_UNSEEN_NEVER ? EBPO_TURN_NEVER : EBPO_TURN_UNSEEN;
}

/* Adds a patch to the frontier. */
static ebpo_status offer_patch(choosing *c, uint64_t patch, ebpo_error *error)
{
    ebpo_seen sight = see_patch(c, patch);
    ebpo_waiting w = { .octcode = octcode_of(c, patch),
                       .child_group = patch,
                       .turn = (uint8_t)turn_of(c, patch, sight) };
    if (c->viewpoint->has_observer) {
        double pixels = pixels_of(c, patch, sight);
        /* Bits of nonnegative doubles, read as integers, have the order of the doubles. The
         * greatest error gets the least key. */
        memcpy(&w.key, &pixels, sizeof w.key);
        w.key = ~w.key;
    }
    ebpo_status status = ebpo_frontier_reserve(&c->frontier, 1, error);
    if (status == EBPO_OK)
        ebpo_frontier_push(&c->frontier, w);
    return status;
}

/* Returns true if the view can read the patches `first` to `end` - 1 within its limit of bytes.
 * Adds the missing chunks of these patches to c->keys. */
static bool is_affordable(choosing *c, uint64_t first, uint64_t end)
{
    if (!c->keys)
        return true;
    for (uint64_t i = first; i < end; i++)
        ebpo_patch_missing(c->table, c->chunks, i, c->keys);
    uint64_t taken = atomic_load(&c->chunks->file->in.bytes);
    return c->keys->count < EBPO_CHUNK_KEYS && taken <= c->options->bytes &&
           c->keys->bytes <= c->options->bytes - taken;
}

/* Replaces patches until a limit is reached. Fills c->chosen and c->replaced. */
static ebpo_status choose_patches(choosing *c, ebpo_error *error)
{
    ebpo_status status = offer_patch(c, 0, error);
    while (status == EBPO_OK && c->frontier.count && c->frontier.at[0].turn != EBPO_TURN_NEVER) {
        uint64_t patch = c->frontier.at[0].child_group, child = c->table->child[patch],
                 end = c->table->child_end[patch];
        if (!is_affordable(c, child, end))
            break;
        (void)ebpo_frontier_pop(&c->frontier);
        if (child == end)
            c->replaced[c->replaced_count++] = patch;
        for (; child < end && status == EBPO_OK; child++)
            status = offer_patch(c, child, error);
    }
    for (uint64_t i = 0; i < c->frontier.count; i++)
        c->chosen[c->chosen_count++] = c->frontier.at[i].child_group;
    return status;
}

static int compare_indices(const void *a, const void *b)
{
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

static void sort_indices(uint64_t *indices, uint64_t count)
{
    qsort(indices, count, sizeof *indices, compare_indices);
}

/* Requests the missing chunks of all chosen patches in one batch. */
static ebpo_status fetch_patches(choosing *c, ebpo_error *error)
{
    ebpo_chunk_keys *keys = ebpo_alloc(1, sizeof *keys);
    if (!keys)
        return ebpo_fail_memory(error, sizeof *keys);
    ebpo_chunk_keys_begin(keys);
    for (uint64_t i = 0; i < c->chosen_count; i++)
        ebpo_patch_missing(c->table, c->chunks, c->chosen[i], keys);
    ebpo_status status = ebpo_chunks_fetch(c->chunks, keys, keys->count, error);
    free(keys);
    return status;
}

/* Reads the faces of replaced patches. Requests their chunks in a few batches: the chunks of faces
 * show which chunks of vertices are needed. If the faces exceed the limit of bytes, the half of the
 * replaced patches with the least errors is drawn without replacement, and the function tries
 * again. */
static ebpo_status read_faces(choosing *c, ebpo_patch *faces, ebpo_error *error)
{
    enum { PASSES = 4 };
    ebpo_chunk_keys *keys = ebpo_alloc(1, sizeof *keys);
    if (!keys)
        return ebpo_fail_memory(error, sizeof *keys);
    ebpo_status status = EBPO_OK;
    uint64_t *sorted = ebpo_alloc(c->replaced_count, sizeof *sorted);
    while (c->replaced_count && status == EBPO_OK && sorted) {
        unsigned missing = 1;
        memcpy(sorted, c->replaced, c->replaced_count * sizeof *sorted);
        sort_indices(sorted, c->replaced_count);
        bool remote = ebpo_input_prefetches(&c->chunks->file->in);
        for (int pass = 0; remote && pass < PASSES && missing && status == EBPO_OK; pass++) {
            ebpo_chunk_keys_begin(keys);
            ebpo_chunks_collect(c->chunks, keys);
            if (ebpo_patch_faces_read(c->table, c->chunks, sorted, c->replaced_count, faces,
                                      NULL) == EBPO_OK)
                ebpo_patch_free(faces);
            ebpo_chunks_collect(c->chunks, NULL);
            missing = keys->count;
            status = ebpo_chunks_fetch(c->chunks, keys, missing, error);
        }
        if (status == EBPO_OK)
            status =
                ebpo_patch_faces_read(c->table, c->chunks, sorted, c->replaced_count, faces, error);
        if (status != EBPO_E_LIMIT || !ebpo_chunks_refused(c->chunks))
            break;
        uint64_t kept = c->replaced_count / 2;
        while (c->replaced_count > kept)
            c->chosen[c->chosen_count++] = c->replaced[--c->replaced_count];
        ebpo_chunks_limit(c->chunks, c->options->bytes);
        status = EBPO_OK;
    }
    if (!sorted)
        status = ebpo_fail_memory(error, c->replaced_count * sizeof *sorted);
    free(sorted);
    free(keys);
    return status;
}

/* Returns the greatest error in pixels of a visible patch that is drawn; NAN without an observer.
 */
static double greatest_pixels(const choosing *c)
{
    double pixels = c->viewpoint->has_observer ? 0 : NAN;
    for (uint64_t i = 0; i < c->chosen_count; i++) {
        ebpo_seen sight = see_patch(c, c->chosen[i]);
        if (sight.seen)
            pixels = fmax(pixels, pixels_of(c, c->chosen[i], sight));
    }
    return pixels;
}

static ebpo_status make_surface(choosing *c, ebpo_surface_mesh *out, ebpo_error *error)
{
    ebpo_patch faces = EBPO_PATCH_INIT;
    ebpo_status status = EBPO_OK;
    if (c->options->bytes) { /* the sizes of chunks are known after the first chunks were read */
        ebpo_patch root;
        status = ebpo_patch_read(c->table, c->chunks, 0, &root, error);
        ebpo_patch_free(&root);
    }
    if (status == EBPO_OK)
        status = choose_patches(c, error);
    if (status == EBPO_OK)
        status = fetch_patches(c, error);
    if (status == EBPO_OK)
        status = read_faces(c, &faces, error);
    if (status == EBPO_OK) {
        sort_indices(c->chosen, c->chosen_count);
        status = ebpo_table_join(c->table, c->chunks, c->chosen, c->chosen_count,
                                 c->replaced_count ? &faces : NULL, out, error);
    }
    if (status == EBPO_OK)
        out->pixels = greatest_pixels(c);
    ebpo_patch_free(&faces);
    return status;
}

ebpo_status ebpo_view_surface(ebpo_patch_table *table, ebpo_chunks *chunks,
                              const ebpo_viewpoint *viewpoint, const ebpo_view_options *options,
                              ebpo_surface_mesh *out, ebpo_error *error)
{
    const ebpo_info *info = &chunks->file->info;
    choosing c = { .table = table,
                   .chunks = chunks,
                   .viewpoint = viewpoint,
                   .options = options,
                   .info = info,
                   .box = ebpo_root_box(info),
                   .faces = options->faces && !info->pruned };
    memset(out, 0, sizeof *out);
    ebpo_chunks_limit(chunks, options->bytes ? options->bytes : UINT64_MAX);
    ebpo_status status = ebpo_patch_table_read(table, chunks, error);
    if (status != EBPO_OK)
        return status;
    c.chosen = ebpo_alloc(table->count, sizeof *c.chosen);
    c.replaced = ebpo_alloc(table->count, sizeof *c.replaced);
    c.keys = options->bytes ? ebpo_alloc(1, sizeof *c.keys) : NULL;
    if (c.keys)
        ebpo_chunk_keys_begin(c.keys);
    status = c.chosen && c.replaced && (c.keys || !options->bytes)
                 ? make_surface(&c, out, error)
                 : ebpo_fail_memory(error, 2 * table->count * sizeof *c.chosen);
    ebpo_frontier_free(&c.frontier);
    free(c.chosen);
    free(c.replaced);
    free(c.keys);
    return status;
}
