/* One level from its arrays. */
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "core/sized.h"
#include "core/arrays.h"
#include "format/write_plan.h"
#include "format/reader.h"

/* leaf_first holds skips; each leaf's new faces end before the next one's begin. */
static ebpo_status add_up_skips(const ebpo_file *file, int number, ebpo_level *level,
                                ebpo_error *error)
{
    ebpo_check check = ebpo_reader_check(file, level->workspace);
    uint64_t end = 0, faces = file->info.face_count;
    EBPO_FOR_ITEMS(level->workspace, i, 0, level->leaf_count) {
        uint64_t skip = level->leaf_first[i];
        if (skip > faces - end || level->leaf_new[i] > faces - end - skip)
            return ebpo_check_fail(&check, number, "leaf_skip",
                                   "a leaf's new faces lie beyond the last face", error);
        level->leaf_first[i] = end + skip;
        end += skip + level->leaf_new[i];
    }
    return EBPO_OK;
}

typedef struct refs_job {
    const ebpo_file *file;
    int number;
    ebpo_level *level;
    const uint64_t *index;
} refs_job;

bool ebpo_refs_decode(uint32_t *refs, uint64_t count, uint64_t first)
{
    uint64_t above = first;
    for (uint64_t k = 0; k < count; k++) {
        if (refs[k] >= above)
            return false;
        above -= (uint64_t)refs[k] + 1;
        refs[k] = (uint32_t)above;
    }
    for (uint64_t k = 0; k < count / 2; k++) {
        uint32_t other = refs[count - 1 - k];
        refs[count - 1 - k] = refs[k];
        refs[k] = other;
    }
    return true;
}

static ebpo_status decode_refs(void *context, uint64_t begin, uint64_t end, unsigned worker,
                               ebpo_error *error)
{
    refs_job *j = context;
    (void)worker;
    uint64_t leaf = begin * EBPO_INDEX_ROWS, at = j->index[begin * 3 + 1];
    uint64_t stop =
        end * EBPO_INDEX_ROWS < j->level->leaf_count ? end * EBPO_INDEX_ROWS : j->level->leaf_count;
    for (; leaf < stop; at += j->level->leaf_ref_count[leaf++])
        if (!ebpo_refs_decode(j->level->leaf_refs + at, j->level->leaf_ref_count[leaf],
                              j->level->leaf_first[leaf])) {
            ebpo_check check = ebpo_reader_check(j->file, j->level->workspace);
            return ebpo_check_fail(&check, j->number, "leaf_refs",
                                   "a reference does not lead to a face before the leaf's own",
                                   error);
        }
    return EBPO_OK;
}

/* Of an index that is also about parts that are left out, nothing can be said. */
static ebpo_status check_index(const ebpo_file *file, ebpo_array_id id, const ebpo_level *level,
                               int number, uint64_t without, const uint64_t *right,
                               ebpo_error *error)
{
    const ebpo_array_in *array = ebpo_reader_array(file, id, number);
    uint64_t *stored = NULL;
    if (!array->present || ebpo_schema[id].needs & without)
        return EBPO_OK;
    ebpo_read_options read = ebpo_read_threads(1);
    read.workspace = level->workspace;
    ebpo_status status = ebpo_reader_make(file, id, number, &read, sizeof *stored, &stored, error);
    if (status == EBPO_OK &&
        memcmp(stored, right, array->shape.rows * array->shape.cols * sizeof *stored) != 0) {
        ebpo_check check = ebpo_reader_check(file, level->workspace);
        status = ebpo_check_fail(&check, number, ebpo_schema[id].name,
                                 "the index contradicts the arrays that it is about", error);
    }
    ebpo_array_free(level->workspace, stored);
    return status;
}

/* Counts of references, and skips. */
static ebpo_status finish_lists(const ebpo_file *file, int number, ebpo_level *level,
                                ebpo_error *error)
{
    uint64_t refs = 0;
    if (!level->leaf_first)
        return EBPO_OK;
    EBPO_FOR_ITEMS(level->workspace, i, 0, level->leaf_count)
        refs += level->leaf_ref_count[i];
    ebpo_check check = ebpo_reader_check(file, level->workspace);
    if (refs != level->ref_count)
        return ebpo_check_fail(&check, number, "leaf_ref_count",
                               "the counts do not add up to the number of references", error);
    return add_up_skips(file, number, level, error);
}

/* References are decoded here: leaf_index tells each block of leaves where to begin. */
static ebpo_status finish_leaves(const ebpo_file *file, int number, ebpo_level *level,
                                 const ebpo_read_options *options, ebpo_error *error)
{
    uint64_t *index = ebpo_index_leaves(level);
    ebpo_status status =
        index ? EBPO_OK : ebpo_fail_memory(error, level->leaf_count / EBPO_INDEX_ROWS * 24);
    if (status == EBPO_OK)
        status =
            check_index(file, EBPO_A_LEAF_INDEX, level, number, options->without, index, error);
    if (status == EBPO_OK && level->leaf_refs) {
        refs_job j = { file, number, level, index };
        uint64_t blocks = (level->leaf_count - 1) / EBPO_INDEX_ROWS + 1;
        status = ebpo_parallel_for(blocks > 1 ? options->threads : 1, level->workspace, blocks, 1,
                                   decode_refs, &j, NULL, "read", error);
    }
    free(index);
    return status;
}

static ebpo_status check_indexes(const ebpo_file *file, int number, const ebpo_level *level,
                                 uint64_t without, ebpo_error *error)
{
    uint64_t *types = ebpo_index_types(level, number == 0), *gray = ebpo_index_gray(level);
    ebpo_status status = types && gray
                             ? EBPO_OK
                             : ebpo_fail_memory(error, level->group_count / EBPO_INDEX_ROWS * 32);
    if (status == EBPO_OK)
        status = check_index(file, EBPO_A_TYPES_INDEX, level, number, without, types, error);
    if (status == EBPO_OK)
        status = check_index(file, EBPO_A_GRAY_INDEX, level, number, without, gray, error);
    free(types);
    free(gray);
    return status;
}

static ebpo_status read_arrays(const ebpo_file *file, int number, ebpo_level *level,
                               const ebpo_read_options *options, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    uint32_t needs = ebpo_schema_has(&file->info) & ~(uint32_t)options->without;
    for (int id = 0; id < EBPO_LEVEL_ARRAYS && status == EBPO_OK; id++) {
        void *array;
        if (!ebpo_schema_is_held(id) || !(ebpo_schema[id].needs & needs))
            continue;
        status = ebpo_reader_make(file, (ebpo_array_id)id, number, options,
                                  ebpo_schema[id].held_size, &array, error);
        ebpo_level_set_array(level, id, array);
    }
    return status == EBPO_OK ? finish_lists(file, number, level, error) : status;
}

static void expect_arrays(const ebpo_file *file, int level, uint32_t without)
{
    ebpo_expected e = EBPO_EXPECTED_INIT(file);
    ebpo_expect_level(&e, level, without);
    ebpo_expect_all(&e);
}

ebpo_status ebpo_file_read_level(const ebpo_file *file, int level, const ebpo_read_options *options,
                                 ebpo_level *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    memset(out, 0, sizeof *out);
    const ebpo_info *info = &file->info;
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_read_options, &read, options, error);
    if (status != EBPO_OK)
        return status;
    if (level < 0 || level >= info->level_count)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, file->in.shown,
                              "there is no level %d; the file has levels 0 to %d", level,
                              info->level_count - 1);
    *out = ebpo_level_of_summary(info, level);
    out->workspace = read.workspace;
    read.without &= info->parts;
    expect_arrays(file, level, (uint32_t)read.without);
    status = read_arrays(file, level, out, &read, error);
    if (status == EBPO_OK && out->leaf_count)
        status = finish_leaves(file, level, out, &read, error);
    if (status == EBPO_OK)
        status = check_indexes(file, level, out, read.without, error);
    if (status == EBPO_OK) {
        ebpo_check check = ebpo_reader_check(file, out->workspace);
        ebpo_info seen = *info;
        seen.parts &= ~(uint32_t)read.without;
        status = ebpo_check_level(&check, &seen, level, out, error);
    }
    if (status != EBPO_OK)
        ebpo_level_free(out);
    return status;
}
