/* Reads nodes for drawing, for the WebAssembly module of viewers. A level is read in parts. In
 * levels that the file stores by subtree, a part is the nodes of one subtree. In other levels, a
 * part is up to EBPO_INDEX_ROWS (4,096) groups; a group is the eight children of a node. All chunks
 * that a call needs are requested together, as far as their positions are known. */
#include <stdlib.h>
#include <string.h>

#include <ebpo/file.h>

#include "format/chunk_directory.h"
#include "format/file_in.h"
#include "format/pick_rows.h"
#include "format/reader.h"
#include "format/schema.h"
#include "format/subtree_index.h"
#include "geometry/level_nodes.h"
#include "module.h"

enum {
    DRAWN = EBPO_NEEDS_ALWAYS | EBPO_NEEDS_PLANES | EBPO_NEEDS_LEAF_PLANES | EBPO_NEEDS_COLOURS
};

/* Begins drawing. `memory`: size of the cache of decoded chunks in bytes; reading a whole level
 * does not use the cache. Chunks are not compared with their checksums until ebpo_js_sums has read
 * the list of chunk checksums, because this list may arrive late. Returns 1 if the file has such a
 * list. */
int EBPO_JS(ebpo_js_view)(ebpo_js_object *object, double memory)
{
    ebpo_file *file = ebpo_reader_own(object->file); /* the same file, mutable */
    bool has_checksums = file->has_checksums;
    object->chunk_memory = (uint64_t)memory;
    file->has_checksums = false;
    return has_checksums;
}

/* Reads the list of chunk checksums. Then empties the cache, so that later reads compare all chunks
 * with their checksums. */
int EBPO_JS(ebpo_js_sums)(ebpo_js_object *object)
{
    ebpo_file *file = ebpo_reader_own(object->file); /* the same file, mutable */
    file->has_checksums = true;
    ebpo_status status = ebpo_chunk_checksums_read(file, &object->error);
    if (status == EBPO_OK)
        status = ebpo_checksum_pages_prepare(file, &object->error);
    if (status == EBPO_E_PENDING)
        file->has_checksums = false;
    ebpo_chunks_free(object->chunks);
    object->chunks = NULL;
    return status;
}

/* ---- bytes of levels ---- */

/* Puts a double for each level into result array 0: the number of bytes of the file that the header
 * and all levels down to this level take. Reads the chunk directory. */
int EBPO_JS(ebpo_js_level_bytes)(ebpo_js_object *object)
{
    const ebpo_info *info = ebpo_file_info(object->file);
    ebpo_stored_sizes sizes = EBPO_STORED_SIZES_INIT;
    ebpo_js_clear(object);
    ebpo_status status = ebpo_file_locate(object->file, &sizes, &object->error);
    double sum = (double)info->head_bytes;
    for (int i = 0; i < info->level_count && status == EBPO_OK; i++) {
        sum += (double)sizes.level_bytes[i];
        status = ebpo_js_put(object, 0, &sum, sizeof sum);
    }
    return status;
}

/* ---- parts of levels ---- */

/* Result arrays of ebpo_js_nodes. */
enum {
    /* double [13] for each part: [0] level, [1] index of the part, [2] first group, [3] number of
     * groups, [4] to [7] ranks of the first white, black, leaf and gray node, [8] to [12] numbers
     * of the part's items in PART_COUNTS, PART_PLANES, PART_LEAF_COUNTS, PART_LEAF_PLANES and
     * PART_COLOURS */
    PART_FACTS,
    PART_TYPES,       /* uint16 for each group: types of its eight nodes */
    PART_COUNTS,      /* uint8 for each gray node: number of planes */
    PART_PLANES,      /* uint32 for each plane of a gray node: code */
    PART_LEAF_COUNTS, /* uint8 for each leaf: number of stored planes */
    PART_LEAF_PLANES, /* uint32 for each stored plane of a leaf: code */
    PART_COLOURS      /* uint32 for each gray node; empty if the file has no colours */
};

typedef struct wanted_part {
    double level, part; /* index of the part in the level; -1: the whole level */
} wanted_part;

/* Returns the number of groups of a level; level 0 has one group, with the root alone. */
static uint64_t groups_of_level(const ebpo_info *info, int level)
{
    return level ? info->level[level - 1].gray_count : 1;
}

/* Sets *run to the groups of a wanted part. */
static ebpo_status find_run(ebpo_js_object *object, const wanted_part *wanted, ebpo_run *run)
{
    const ebpo_info *info = ebpo_file_info(object->file);
    int level = (int)wanted->level;
    uint64_t part = (uint64_t)wanted->part, first = part * EBPO_INDEX_ROWS,
             all = groups_of_level(info, level);
    ebpo_subtree_row row;
    *run = (ebpo_run){ 0 };
    if (!ebpo_subtree_table_has(object->file, level)) {
        run->group = first;
        run->groups = all - first < EBPO_INDEX_ROWS ? all - first : EBPO_INDEX_ROWS;
        return EBPO_OK;
    }
    ebpo_status status = ebpo_subtree_table_row(object->chunks, part, &row, &object->error);
    if (status == EBPO_OK) {
        run->group = ebpo_subtree_groups(info, &row, level, false);
        run->groups = ebpo_subtree_groups(info, &row, level, true) - run->group;
    }
    return status;
}

/* Appends `count` items of `size` bytes to result array n, and the number of items to PART_FACTS.
 * If `data` is NULL, there are 0 items. Returns false when out of memory. */
static bool put_items(ebpo_js_object *object, unsigned n, const void *data, uint64_t count,
                      size_t size)
{
    double items = data ? (double)count : 0;
    return ebpo_js_put(object, n, data, data ? (size_t)count * size : 0) == EBPO_OK &&
           ebpo_js_put(object, PART_FACTS, &items, sizeof items) == EBPO_OK;
}

/* Appends one part to the result arrays; `l` has only the nodes of this part. */
static ebpo_status put_part(ebpo_js_object *object, const wanted_part *wanted, const ebpo_run *run,
                            const ebpo_level *l)
{
    double facts[8] = { wanted->level, wanted->part, (double)run->group, (double)run->groups };
    for (int type = 0; type < 4; type++)
        facts[4 + type] = (double)run->rank[type];
    bool ok = ebpo_js_put(object, PART_FACTS, facts, sizeof facts) == EBPO_OK &&
              ebpo_js_put(object, PART_TYPES, l->types, (size_t)run->groups * 2) == EBPO_OK &&
              put_items(object, PART_COUNTS, l->plane_counts, l->gray_count, 1) &&
              put_items(object, PART_PLANES, l->planes, l->plane_count, 4) &&
              put_items(object, PART_LEAF_COUNTS, l->leaf_plane_counts, l->leaf_count, 1) &&
              put_items(object, PART_LEAF_PLANES, l->leaf_planes, l->leaf_plane_count, 4) &&
              put_items(object, PART_COLOURS, l->gray_colours, l->gray_count, 4);
    return ok ? EBPO_OK : EBPO_E_MEMORY;
}

/* Reads a whole level as one part. */
static ebpo_status read_whole(ebpo_js_object *object, const wanted_part *wanted)
{
    ebpo_read_options options = EBPO_READ_OPTIONS_INIT;
    ebpo_level level = { 0 };
    options.threads = 1;
    options.omitted_parts = EBPO_PART_MESH | EBPO_PART_MAPS;
    ebpo_status status =
        ebpo_file_read_level(object->file, (int)wanted->level, &options, &level, &object->error);
    ebpo_run run = { .groups = level.group_count };
    if (status == EBPO_OK)
        status = put_part(object, wanted, &run, &level);
    ebpo_level_free(&level);
    return status;
}

/* Reads one part. */
static ebpo_status read_part(ebpo_js_object *object, const wanted_part *wanted)
{
    ebpo_level level = { 0 };
    ebpo_run run;
    if (wanted->part < 0)
        return read_whole(object, wanted);
    ebpo_status status = find_run(object, wanted, &run);
    if (status == EBPO_OK)
        status = ebpo_pick_level(object->chunks, (int)wanted->level, &run, 1, DRAWN, &level,
                                 &object->error);
    if (status == EBPO_OK)
        status = put_part(object, wanted, &run, &level);
    ebpo_level_free(&level);
    return status;
}

/* Collects in `hints` the chunks of the wanted parts that are not in memory. The levels of one
 * subtree are adjacent in wanted[count] and ascend. So the chunks of the subtree are collected
 * once, down to the deepest of these levels. */
static void hint_parts(ebpo_js_object *object, ebpo_hints *hints, const wanted_part *wanted,
                       uint32_t count)
{
    uint32_t not_needed = EBPO_NEEDS_MESH | EBPO_NEEDS_MAPS;
    for (uint32_t i = 0; i < count; i++) {
        int level = (int)wanted[i].level;
        if (wanted[i].part < 0)
            ebpo_hint_level(hints, level, not_needed);
        else if (ebpo_subtree_table_has(object->file, level) &&
                 (i + 1 == count || wanted[i + 1].part != wanted[i].part))
            ebpo_subtrees_hint(object->chunks, hints, (uint64_t)wanted[i].part, 1, DRAWN, level,
                               false);
    }
}

/* Returns a number n, so that the first n parts together take at most `bytes` bytes of the file.
 * But n is at least LEAST, or `count` if this is less. Doubles n while the parts fit. Parts of
 * levels that are not stored by subtree are not counted, because such levels are small. */
static uint32_t affordable_parts(ebpo_js_object *object, const wanted_part *wanted, uint32_t count,
                                 double bytes)
{
    enum { LEAST = 16 };
    uint32_t fitting = count < LEAST ? count : LEAST;
    while (fitting < count) {
        uint32_t more = 2 * fitting < count ? 2 * fitting : count;
        ebpo_hints hints = EBPO_HINTS_INIT(object->file);
        hints.counts_bytes = true;
        hint_parts(object, &hints, wanted, more);
        if ((double)ebpo_hints_bytes(&hints) > bytes)
            break;
        fitting = more;
    }
    return fitting;
}

/* Reads the parts wanted[count] into the result arrays. The levels of one subtree must be adjacent
 * in `wanted` and ascend. Reads only the first parts, up to about `bytes` bytes of the file
 * (affordable_parts). */
int EBPO_JS(ebpo_js_nodes)(ebpo_js_object *object, const wanted_part *wanted, uint32_t count,
                           double bytes)
{
    const ebpo_info *info = ebpo_file_info(object->file);
    ebpo_status status = EBPO_OK;
    uint64_t *subtrees = malloc(count * sizeof *subtrees);
    uint32_t subtree_count = 0, partial_count = 0; /* parts that are not whole levels */
    ebpo_js_clear(object);
    if (!subtrees && count)
        return object->error.status = EBPO_E_MEMORY;
    for (uint32_t i = 0; i < count; i++)
        partial_count += wanted[i].part >= 0;
    if (partial_count)
        status = ebpo_js_need_chunks(object);
    for (uint32_t i = 0; i < count && status == EBPO_OK; i++)
        if (wanted[i].part >= 0 && wanted[i].level > info->subtree_level && info->subtree_level)
            subtrees[subtree_count++] = (uint64_t)wanted[i].part;
    if (subtree_count)
        ebpo_subtree_table_hint(object->chunks, subtrees, subtree_count);
    free(subtrees);
    if (status != EBPO_OK)
        return status;
    count = affordable_parts(object, wanted, count, bytes);
    ebpo_hints hints = EBPO_HINTS_INIT(object->file);
    hint_parts(object, &hints, wanted, count);
    ebpo_hint_all(&hints);
    for (uint32_t i = 0; i < count && (status == EBPO_OK || status == EBPO_E_PENDING); i++) {
        ebpo_status one = read_part(object, &wanted[i]);
        /* The loop goes on after EBPO_E_PENDING, so that the missing bytes of all parts are
         * requested. */
        status = one == EBPO_OK ? status : one;
    }
    return status;
}
