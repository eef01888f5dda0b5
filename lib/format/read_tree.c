/* Reads whole parts of a file into memory: a level, the mesh, source indices (positions in the mesh
 * that was converted), the mesh in the source's order, and the whole tree. Levels and meshes are
 * checked during reading, so that every index in the result is valid. Threads decode chunks
 * directly into the result, which may be in a workspace on disk. The last functions of this file
 * recompute a file's checksums and compare them with the stated checksums. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "core/checksum.h"
#include "format/content_checksum.h"
#include "format/border_loops.h"
#include "format/read_attributes.h"
#include "format/reader.h"
#include "format/write_plan.h"
#include "hdf5_read/coding.h"

/* Converts leaf_first from skips, as in the file, to the first new face of each leaf. A new face of
 * a leaf is a face that no earlier leaf lists. A skip is the number of faces between the new faces
 * of a leaf and those of the previous leaf of the level. `number`: number of the level, also in the
 * functions below. */
static ebpo_status add_up_skips(const ebpo_file *file, int number, ebpo_level *level,
                                ebpo_error *error)
{
    ebpo_check check = ebpo_reader_check(file, level->workspace);
    uint64_t end = 0, faces = file->info.face_count;
    EBPO_FOR_ITEMS(level->workspace, i, 0, level->leaf_count) {
        uint64_t skip = level->leaf_first[i];
        if (skip > faces - end || level->leaf_new[i] > faces - end - skip)
            return ebpo_check_fail(&check, number, "leaf_skip",
                                   "a leaf's new faces are beyond the last face", error);
        level->leaf_first[i] = end + skip;
        end += skip + level->leaf_new[i];
    }
    return EBPO_OK;
}

/* References of a level's leaves that several threads decode. */
typedef struct refs_job {
    const ebpo_file *file;
    int number; /* number of the level */
    ebpo_level *level;
    /* [blocks][3] sums before each EBPO_INDEX_ROWS-th leaf; column 1 counts the references */
    const uint64_t *index;
} refs_job;

bool ebpo_refs_decode(uint32_t *refs, uint64_t count, uint64_t first)
{
    /* a reference is stored as the number of faces between it and `above` */
    uint64_t above = first;
    for (uint64_t k = 0; k < count; k++) {
        if (refs[k] >= above)
            return false;
        above -= (uint64_t)refs[k] + 1;
        refs[k] = (uint32_t)above;
    }
    for (uint64_t k = 0; k < count / 2; k++) {
        uint32_t swap = refs[count - 1 - k];
        refs[count - 1 - k] = refs[k];
        refs[k] = swap;
    }
    return true;
}

/* Decodes the references of the leaves in blocks [begin, end) of EBPO_INDEX_ROWS leaves. */
static ebpo_status decode_refs(void *context, uint64_t begin, uint64_t end, unsigned worker,
                               ebpo_error *error)
{
    refs_job *j = context;
    (void)worker;
    uint64_t leaf = begin * EBPO_INDEX_ROWS,
             at = j->index[begin * 3 + 1]; /* at: index of the next reference */
    uint64_t leaf_end =
        end * EBPO_INDEX_ROWS < j->level->leaf_count ? end * EBPO_INDEX_ROWS : j->level->leaf_count;
    for (; leaf < leaf_end; at += j->level->leaf_ref_count[leaf++])
        if (!ebpo_refs_decode(j->level->leaf_refs + at, j->level->leaf_ref_count[leaf],
                              j->level->leaf_first[leaf])) {
            ebpo_check check = ebpo_reader_check(j->file, j->level->workspace);
            return ebpo_check_fail(&check, j->number, "leaf_refs",
                                   "a reference is not to a face before the leaf's new faces",
                                   error);
        }
    return EBPO_OK;
}

/* Compares an index array of the file with the sums `computed`. Does nothing if the file lacks the
 * array, or if the array belongs to one of `omitted_parts`, which are not read. */
static ebpo_status check_index(const ebpo_file *file, ebpo_array_id id, const ebpo_level *level,
                               int number, uint64_t omitted_parts, const uint64_t *computed,
                               ebpo_error *error)
{
    const ebpo_array_in *array = ebpo_reader_array(file, id, number);
    uint64_t *stored = NULL;
    if (!array->present || ebpo_schema[id].needs & omitted_parts)
        return EBPO_OK;
    ebpo_read_options read = ebpo_read_threads(1);
    read.workspace = level->workspace;
    ebpo_status status = ebpo_reader_make(file, id, number, &read, sizeof *stored, &stored, error);
    if (status == EBPO_OK &&
        memcmp(stored, computed, array->shape.rows * array->shape.cols * sizeof *stored) != 0) {
        ebpo_check check = ebpo_reader_check(file, level->workspace);
        status = ebpo_check_fail(&check, number, ebpo_schema[id].name,
                                 "the index contradicts the arrays that it indexes", error);
    }
    ebpo_array_free(level->workspace, stored);
    return status;
}

/* Checks that the counts of references add up, and converts the skips in leaf_first. */
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

/* Decodes references, with several threads: the sums of leaf_index locate the references of each
 * block of EBPO_INDEX_ROWS leaves. */
static ebpo_status finish_leaves(const ebpo_file *file, int number, ebpo_level *level,
                                 const ebpo_read_options *options, ebpo_error *error)
{
    uint64_t *index = ebpo_index_leaves(level);
    ebpo_status status =
        index ? EBPO_OK : ebpo_fail_memory(error, level->leaf_count / EBPO_INDEX_ROWS * 24);
    if (status == EBPO_OK)
        status = check_index(file, EBPO_A_LEAF_INDEX, level, number, options->omitted_parts, index,
                             error);
    if (status == EBPO_OK && level->leaf_refs) {
        refs_job j = { file, number, level, index };
        uint64_t blocks = (level->leaf_count - 1) / EBPO_INDEX_ROWS + 1;
        status = ebpo_parallel_for(blocks > 1 ? options->threads : 1, level->workspace, blocks, 1,
                                   decode_refs, &j, NULL, "read", error);
    }
    free(index);
    return status;
}

/* Checks the index arrays of types and of gray nodes. */
static ebpo_status check_indexes(const ebpo_file *file, int number, const ebpo_level *level,
                                 uint64_t omitted_parts, ebpo_error *error)
{
    uint64_t *types = ebpo_index_types(level, number == 0), *gray = ebpo_index_gray(level);
    ebpo_status status = types && gray
                             ? EBPO_OK
                             : ebpo_fail_memory(error, level->group_count / EBPO_INDEX_ROWS * 32);
    if (status == EBPO_OK)
        status = check_index(file, EBPO_A_TYPES_INDEX, level, number, omitted_parts, types, error);
    if (status == EBPO_OK)
        status = check_index(file, EBPO_A_GRAY_INDEX, level, number, omitted_parts, gray, error);
    free(types);
    free(gray);
    return status;
}

/* Reads the level's arrays that are in ebpo_level. */
static ebpo_status read_arrays(const ebpo_file *file, int number, ebpo_level *level,
                               const ebpo_read_options *options, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    uint32_t needs = ebpo_schema_has(&file->info) & ~(uint32_t)options->omitted_parts;
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

static void hint_arrays(const ebpo_file *file, int level, uint32_t omitted_parts)
{
    ebpo_hints e = EBPO_HINTS_INIT(file);
    ebpo_hint_level(&e, level, omitted_parts);
    ebpo_hint_all(&e);
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
    read.omitted_parts &= info->parts;
    hint_arrays(file, level, (uint32_t)read.omitted_parts);
    status = read_arrays(file, level, out, &read, error);
    if (status == EBPO_OK && out->leaf_count)
        status = finish_leaves(file, level, out, &read, error);
    if (status == EBPO_OK)
        status = check_indexes(file, level, out, read.omitted_parts, error);
    if (status == EBPO_OK) {
        ebpo_check check = ebpo_reader_check(file, out->workspace);
        ebpo_info read_info = *info;
        read_info.parts &= ~(uint32_t)read.omitted_parts;
        status = ebpo_check_level(&check, &read_info, level, out, error);
    }
    if (status != EBPO_OK)
        ebpo_level_free(out);
    return status;
}

/* --- the mesh, its source indices, and whole trees --- */

void ebpo_tree_free(ebpo_tree *tree)
{
    if (!tree)
        return;
    for (int i = 0; i < EBPO_LEVELS_MAX; i++)
        ebpo_level_free(&tree->level[i]);
    ebpo_mesh_free(&tree->mesh);
    ebpo_array_free(tree->workspace, tree->vertex_source);
    ebpo_array_free(tree->workspace, tree->face_source);
    ebpo_border_loops_free(&tree->border);
    ebpo_surface_free(&tree->surface);
    memset(tree, 0, sizeof *tree);
}

static ebpo_status part_absent(const ebpo_file *file, const char *part, ebpo_error *error)
{
    return ebpo_fail_file(
        error, EBPO_E_ABSENT, file->in.shown,
        "the file was written without its %s; build the file again with this part", part);
}

/* A mesh that several threads decode. */
typedef struct mesh_job {
    const ebpo_file *file;
    ebpo_mesh *mesh;
    uint64_t *faces_index; /* [chunks of faces] number of vertices that the faces before the chunk
                              use; NULL: a single chunk */
} mesh_job;

static ebpo_status decode_vertices(void *context, const ebpo_array_in *array, uint64_t chunk,
                                   uint64_t row, uint64_t rows, const uint8_t *bytes,
                                   ebpo_error *error)
{
    (void)array;
    (void)chunk;
    (void)error;
    mesh_job *j = context;
    if (j->mesh->xyz32)
        ebpo_points32_decode(bytes, rows, j->mesh->xyz32 + 3 * row);
    else
        ebpo_points64_decode(bytes, rows, j->mesh->xyz64 + 3 * row);
    return EBPO_OK;
}

static ebpo_status decode_faces(void *context, const ebpo_array_in *array, uint64_t chunk,
                                uint64_t row, uint64_t rows, const uint8_t *bytes,
                                ebpo_error *error)
{
    mesh_job *j = context;
    ebpo_check check = ebpo_reader_check(j->file, j->mesh->workspace);
    uint64_t last = ebpo_shape_chunks(&array->shape) - 1;
    /* number of vertices that the faces so far use */
    uint64_t used = j->faces_index ? j->faces_index[chunk] : 0;
    if (used > j->mesh->vertex_count || (chunk == 0 && used))
        return ebpo_check_fail(&check, -1, "/mesh/faces_index",
                               "the index has more vertices than the mesh", error);
    if (!ebpo_corners_decode(bytes, rows, &used, j->mesh->faces + 3 * row) ||
        used > j->mesh->vertex_count)
        return ebpo_check_fail(&check, -1, "/mesh/faces",
                               "a face names a vertex that does not exist", error);
    if (chunk < last && used != j->faces_index[chunk + 1])
        return ebpo_check_fail(&check, -1, "/mesh/faces_index", "the index contradicts the faces",
                               error);
    return EBPO_OK;
}

/* Allocates a mesh, and copies the source's name, format and digest. */
static ebpo_status make_mesh(const ebpo_file *file, ebpo_mesh *out, ebpo_workspace *workspace,
                             ebpo_error *error)
{
    const ebpo_info *info = &file->info;
    out->workspace = workspace;
    out->vertex_count = info->vertex_count;
    out->face_count = info->face_count;
    if (info->double_coordinates)
        out->xyz64 = ebpo_array_alloc(workspace, info->vertex_count, 3 * sizeof *out->xyz64);
    else
        out->xyz32 = ebpo_array_alloc(workspace, info->vertex_count, 3 * sizeof *out->xyz32);
    out->faces = ebpo_array_alloc(workspace, info->face_count, 3 * sizeof *out->faces);
    snprintf(out->source_name, sizeof out->source_name, "%s", info->source_name);
    snprintf(out->source_format, sizeof out->source_format, "%s", info->source_format);
    memcpy(out->source_sha256, info->source_sha256, sizeof out->source_sha256);
    out->source_size = info->source_size;
    if (!out->faces || (!out->xyz32 && !out->xyz64))
        return ebpo_workspace_fail(workspace, info->vertex_count * 24 + info->face_count * 12,
                                   error);
    return EBPO_OK;
}

static ebpo_status read_mesh(const ebpo_file *file, ebpo_mesh *out, const ebpo_read_options *read,
                             ebpo_error *error)
{
    mesh_job j = { .file = file, .mesh = out };
    ebpo_check check = ebpo_reader_check(file, read->workspace);
    ebpo_read_options one_thread = *read;
    one_thread.threads = 1;
    ebpo_status status = make_mesh(file, out, read->workspace, error);
    if (status == EBPO_OK)
        status = ebpo_reader_rows(file, ebpo_reader_array(file, EBPO_A_VERTICES, 0), read,
                                  decode_vertices, &j, error);
    if (status == EBPO_OK)
        status = ebpo_check_finite(&check, out, error);
    if (status == EBPO_OK)
        status =
            ebpo_reader_make(file, EBPO_A_FACES_INDEX, 0, &one_thread, 8, &j.faces_index, error);
    if (status == EBPO_OK)
        status = ebpo_reader_rows(file, ebpo_reader_array(file, EBPO_A_FACES, 0), read,
                                  decode_faces, &j, error);
    ebpo_array_free(read->workspace, j.faces_index);
    if (status != EBPO_OK)
        ebpo_mesh_free(out);
    return status;
}

/* Copies the caller's options to *read, and checks that the file has the part. */
static ebpo_status copy_options(const ebpo_file *file, const ebpo_read_options *options,
                                uint32_t part, const char *name, ebpo_read_options *read,
                                ebpo_error *error)
{
    ebpo_status status = EBPO_TAKE(ebpo_read_options, read, options, error);
    if (status == EBPO_OK && !(file->info.parts & part))
        status = part_absent(file, name, error);
    return status;
}

/* Sends prefetch hints for the root's arrays that `needs` requires and, if `attributes` is true,
 * for the attributes. */
static void hint_root(const ebpo_file *file, uint32_t needs, bool attributes)
{
    ebpo_hints hints = EBPO_HINTS_INIT(file);
    ebpo_hint_root(&hints, needs);
    if (attributes)
        ebpo_hint_attributes(&hints);
    ebpo_hint_all(&hints);
}

ebpo_status ebpo_file_read_mesh(const ebpo_file *file, const ebpo_read_options *options,
                                ebpo_mesh *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    memset(out, 0, sizeof *out);
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_status status = copy_options(file, options, EBPO_PART_MESH, "mesh", &read, error);
    if (status != EBPO_OK)
        return status;
    hint_root(file, EBPO_NEEDS_MESH, read.attributes);
    status = read_mesh(file, out, &read, error);
    if (status == EBPO_OK && read.attributes)
        status = ebpo_attributes_read(file, &read, &out->attributes, error);
    if (status != EBPO_OK)
        ebpo_mesh_free(out);
    return status;
}

static ebpo_status decode_numbers(void *context, const ebpo_array_in *array, uint64_t chunk,
                                  uint64_t row, uint64_t rows, const uint8_t *bytes,
                                  ebpo_error *error)
{
    (void)array;
    (void)chunk;
    (void)error;
    ebpo_numbers_decode(bytes, rows, (uint32_t *)context + row);
    return EBPO_OK;
}

/* Reads the source indices of vertices or faces, which must be distinct and below `limit`. */
static ebpo_status read_map(const ebpo_file *file, ebpo_array_id id, uint64_t limit,
                            const ebpo_read_options *read, uint32_t **out, ebpo_error *error)
{
    const ebpo_array_in *array = ebpo_reader_array(file, id, 0);
    ebpo_check check = ebpo_reader_check(file, read->workspace);
    uint32_t *map = *out = ebpo_array_alloc(read->workspace, array->shape.rows, sizeof *map);
    if (!map)
        return ebpo_workspace_fail(read->workspace, array->shape.rows * sizeof *map, error);
    ebpo_status status = ebpo_reader_rows(file, array, read, decode_numbers, map, error);
    return status == EBPO_OK
               ? ebpo_check_map(&check, array->path, map, array->shape.rows, limit, error)
               : status;
}

/* Returns one past the largest possible source index of a face. Faces that a repair added have
 * indices from source_face_count on. */
static uint64_t face_source_limit(const ebpo_info *info)
{
    return info->source_face_count + info->repair_record.added_faces;
}

void ebpo_maps_free(ebpo_maps *maps)
{
    if (!maps)
        return;
    ebpo_array_free(maps->workspace, maps->vertex_source);
    ebpo_array_free(maps->workspace, maps->face_source);
    memset(maps, 0, sizeof *maps);
}

ebpo_status ebpo_file_read_maps(const ebpo_file *file, const ebpo_read_options *options,
                                ebpo_maps *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    memset(out, 0, sizeof *out);
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_status status =
        copy_options(file, options, EBPO_PART_MAPS, "maps to source indices", &read, error);
    if (status != EBPO_OK)
        return status;
    hint_root(file, EBPO_NEEDS_MAPS, false);
    out->workspace = read.workspace;
    status = read_map(file, EBPO_A_VERTEX_SOURCE, file->info.source_vertex_count, &read,
                      &out->vertex_source, error);
    if (status == EBPO_OK)
        status = read_map(file, EBPO_A_FACE_SOURCE, face_source_limit(&file->info), &read,
                          &out->face_source, error);
    if (status != EBPO_OK)
        ebpo_maps_free(out);
    return status;
}

/* Reads all parts of the file into the tree. */
static ebpo_status read_parts(const ebpo_file *file, ebpo_tree *out, const ebpo_read_options *read,
                              ebpo_error *error)
{
    ebpo_check check = ebpo_reader_check(file, read->workspace);
    ebpo_maps maps = { .vertex_source = NULL };
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < file->info.level_count && status == EBPO_OK; i++)
        status = ebpo_file_read_level(file, i, read, &out->level[i], error);
    if (status == EBPO_OK && file->info.parts & EBPO_PART_MESH)
        status = ebpo_check_order(&check, out, error);
    if (status == EBPO_OK && file->info.parts & EBPO_PART_MESH)
        status = ebpo_file_read_mesh(file, read, &out->mesh, error);
    if (status == EBPO_OK && file->info.parts & EBPO_PART_MAPS)
        status = ebpo_file_read_maps(file, read, &maps, error);
    if (status == EBPO_OK && file->info.parts & EBPO_PART_BORDER)
        status = ebpo_border_read(file, &out->border, error);
    if (status == EBPO_OK && file->info.parts & EBPO_PART_SURFACE)
        status = ebpo_file_read_surface(file, 0, EBPO_LEVELS_MAX, &out->surface, error);
    out->vertex_source = maps.vertex_source;
    out->face_source = maps.face_source;
    return status;
}

ebpo_status ebpo_file_read_tree(const ebpo_file *file, const ebpo_read_options *options,
                                ebpo_tree *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    memset(out, 0, sizeof *out);
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_read_options, &read, options, error);
    if (status != EBPO_OK)
        return status;
    if (read.omitted_parts)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, file->in.shown,
                              "a tree is always read as a whole; set `omitted_parts` of the read "
                              "options to 0, or read levels");
    ebpo_hint_tree(file);
    out->info = file->info;
    out->workspace = read.workspace;
    read.attributes = 1;
    status = read_parts(file, out, &read, error);
    if (status != EBPO_OK)
        ebpo_tree_free(out);
    return status;
}

/* Computes the position of each item in the order of source indices. The indices are distinct and
 * below `limit`. The caller frees *position. A set of bits marks the indices, because a header may
 * state a limit far above the number of items. A bit for each possible index takes little memory,
 * and the system allocates no memory for pages that contain only zeros. */
static ebpo_status sort_by_source(ebpo_workspace *workspace, const uint32_t *source, uint64_t count,
                                  uint64_t limit, uint32_t **position, ebpo_error *error)
{
    enum { WORDS = 8 }; /* number of words of `bits` for each entry of `before` */
    uint64_t words = (limit <= UINT32_MAX ? limit : UINT64_C(1) << 32) / 64 + 1;
    /* bits: bit i is set if i is a source index. before: number of set bits before the words of the
     * entry */
    uint64_t *bits = ebpo_alloc_zero(words, sizeof *bits);
    uint32_t *before = ebpo_alloc(words / WORDS + 1, sizeof *before),
             *out = ebpo_array_alloc(workspace, count, sizeof *out), sum = 0;
    ebpo_status status =
        bits && before && out
            ? EBPO_OK
            : ebpo_workspace_fail(workspace, words * 9 + count * sizeof *out, error);
    EBPO_FOR_ITEMS(workspace, i, 0, status == EBPO_OK ? count : 0)
        bits[source[i] / 64] |= UINT64_C(1) << source[i] % 64;
    for (uint64_t w = 0; w < words && status == EBPO_OK; w++) {
        if (w % WORDS == 0)
            before[w / WORDS] = sum;
        sum += (uint32_t)__builtin_popcountll(bits[w]);
    }
    EBPO_FOR_ITEMS(workspace, i, 0, status == EBPO_OK ? count : 0) {
        uint64_t word = source[i] / 64;
        out[i] = before[word / WORDS] +
                 (uint32_t)__builtin_popcountll(bits[word] & ((UINT64_C(1) << source[i] % 64) - 1));
        for (uint64_t w = word / WORDS * WORDS; w < word; w++)
            out[i] += (uint32_t)__builtin_popcountll(bits[w]);
    }
    free(bits);
    free(before);
    if (status == EBPO_OK)
        *position = out;
    else
        ebpo_array_free(workspace, out);
    return status;
}

static ebpo_status reorder_vertices(ebpo_mesh *mesh, const uint32_t *position, ebpo_error *error)
{
    size_t size = mesh->xyz32 ? 3 * sizeof *mesh->xyz32 : 3 * sizeof *mesh->xyz64;
    const uint8_t *old = mesh->xyz32 ? (const uint8_t *)mesh->xyz32 : (const uint8_t *)mesh->xyz64;
    uint8_t *sorted = ebpo_array_alloc(mesh->workspace, mesh->vertex_count, size);
    if (!sorted)
        return ebpo_workspace_fail(mesh->workspace, mesh->vertex_count * size, error);
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, 0, mesh->vertex_count)
        memcpy(sorted + position[i] * size, old + i * size, size);
    if (mesh->xyz32) {
        ebpo_array_free(mesh->workspace, mesh->xyz32);
        mesh->xyz32 = (float *)(void *)sorted;
    } else {
        ebpo_array_free(mesh->workspace, mesh->xyz64);
        mesh->xyz64 = (double *)(void *)sorted;
    }
    return EBPO_OK;
}

static ebpo_status reorder_faces(ebpo_mesh *mesh, const uint32_t *vertex_position,
                                 const uint32_t *face_position, ebpo_error *error)
{
    uint32_t *sorted = ebpo_array_alloc(mesh->workspace, mesh->face_count, 3 * sizeof *sorted);
    if (!sorted)
        return ebpo_workspace_fail(mesh->workspace, mesh->face_count * 12, error);
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, 0, mesh->face_count * 3)
        sorted[3 * (uint64_t)face_position[i / 3] + i % 3] = vertex_position[mesh->faces[i]];
    ebpo_array_free(mesh->workspace, mesh->faces);
    mesh->faces = sorted;
    return EBPO_OK;
}

/* Moves row i of the attributes of an element to row position[i]. */
static ebpo_status reorder_attributes(ebpo_mesh *mesh, const char *element,
                                      const uint32_t *position, uint64_t count, ebpo_error *error)
{
    if (!mesh->attributes)
        return EBPO_OK;
    uint32_t *rows = ebpo_array_alloc(mesh->workspace, count, sizeof *rows);
    if (!rows)
        return ebpo_workspace_fail(mesh->workspace, count * sizeof *rows, error);
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, 0, count)
        rows[position[i]] = (uint32_t)i;
    ebpo_status status = ebpo_attributes_pick(mesh->attributes, element, rows, count, error);
    ebpo_array_free(mesh->workspace, rows);
    return status;
}

/* Sorts vertices, faces and attributes by source indices. */
static ebpo_status to_source_order(const ebpo_file *file, ebpo_mesh *mesh,
                                   const ebpo_read_options *read, ebpo_error *error)
{
    uint32_t *vertex_position = NULL, *face_position = NULL;
    ebpo_workspace *workspace = read->workspace;
    ebpo_maps maps;
    ebpo_status status = ebpo_file_read_maps(file, read, &maps, error);
    if (status == EBPO_OK)
        status = sort_by_source(workspace, maps.vertex_source, mesh->vertex_count,
                                file->info.source_vertex_count, &vertex_position, error);
    if (status == EBPO_OK)
        status = sort_by_source(workspace, maps.face_source, mesh->face_count,
                                face_source_limit(&file->info), &face_position, error);
    ebpo_maps_free(&maps);
    if (status == EBPO_OK)
        status = reorder_vertices(mesh, vertex_position, error);
    if (status == EBPO_OK)
        status = reorder_faces(mesh, vertex_position, face_position, error);
    if (status == EBPO_OK)
        status = reorder_attributes(mesh, "vertex", vertex_position, mesh->vertex_count, error);
    if (status == EBPO_OK)
        status = reorder_attributes(mesh, "face", face_position, mesh->face_count, error);
    ebpo_array_free(workspace, vertex_position);
    ebpo_array_free(workspace, face_position);
    return status;
}

ebpo_status ebpo_file_read_source_mesh(const ebpo_file *file, const ebpo_read_options *options,
                                       ebpo_mesh *out, bool *source_order, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    bool maps = file->info.parts & EBPO_PART_MAPS;
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_read_options, &read, options, error);
    memset(out, 0, sizeof *out);
    if (source_order)
        *source_order = false;
    if (status != EBPO_OK)
        return status;
    hint_root(file, EBPO_NEEDS_MESH | EBPO_NEEDS_MAPS, read.attributes);
    status = ebpo_file_read_mesh(file, &read, out, error);
    if (status == EBPO_OK && maps)
        status = to_source_order(file, out, &read, error);
    if (status == EBPO_OK && (!maps || file->info.repair_record.welded_vertices))
        /* attributes of other elements (edges, ...) refer to vertices by source indices, which are
         * not the indices in this mesh */
        ebpo_attributes_drop_others(out->attributes);
    if (source_order)
        *source_order = status == EBPO_OK && maps;
    if (status != EBPO_OK)
        ebpo_mesh_free(out);
    return status;
}

/* --- recomputing checksums: one thread reads an array, because the chunks must come in order ---
 */

/* Digest of an array that is being read. */
typedef struct array_job {
    const ebpo_info *info;
    ebpo_array_digest digest;
} array_job;

/* Digests of all arrays, which several threads compute. */
typedef struct content_job {
    const ebpo_file *file;
    const ebpo_array_in *array[EBPO_LEVELS_MAX * EBPO_LEVEL_ARRAYS + EBPO_ARRAYS];
    uint8_t digest[EBPO_LEVELS_MAX * EBPO_LEVEL_ARRAYS + EBPO_ARRAYS][32];
    unsigned count;
    ebpo_read_options one_thread; /* one thread, so that the chunks of an array come in order */
} content_job;

static ebpo_status digest_rows(void *context, const ebpo_array_in *array, uint64_t chunk,
                               uint64_t row, uint64_t rows, const uint8_t *bytes, ebpo_error *error)
{
    array_job *t = context;
    (void)chunk;
    (void)error;
    ebpo_array_digest_add(&t->digest, t->info, array->id, &array->shape, row, rows, bytes);
    return EBPO_OK;
}

static ebpo_status digest_arrays(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    content_job *j = context;
    (void)worker;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++) {
        array_job t = { .info = &j->file->info };
        ebpo_array_digest_begin(&t.digest);
        status = ebpo_reader_rows(j->file, j->array[i], &j->one_thread, digest_rows, &t, error);
        ebpo_array_digest_end(&t.digest, j->digest[i]);
    }
    return status;
}

/* Computes checksum `which` (EBPO_DIGEST_...) from the digests of its arrays. Compares the result
 * with `stated`, the value of the attribute `name`. */
static ebpo_status compare_digest(content_job *j, int which, const uint8_t stated[32],
                                  const char *name, ebpo_error *error)
{
    ebpo_content content = { .entries = NULL };
    uint8_t digest[32];
    for (unsigned i = 0; i < j->count; i++)
        if (ebpo_content_of(j->array[i]->id, j->file->info.solid) == which)
            ebpo_content_put(&content, j->array[i]->path, j->digest[i]);
    ebpo_status status = ebpo_content_end(&content, digest, error);
    ebpo_content_free(&content);
    if (status == EBPO_OK && ebpo_digest_differs(stated, digest))
        status = ebpo_fail_file(error, EBPO_E_FORMAT, j->file->in.shown,
                                "the content does not match %s: the file was changed; get a "
                                "fresh copy",
                                name);
    return status;
}

ebpo_status ebpo_file_check_content(const ebpo_file *file, const ebpo_read_options *options,
                                    ebpo_error *error)
{
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_read_options, &read, options, error);
    if (status != EBPO_OK)
        return status;
    content_job j = { .file = file, .one_thread = read };
    j.one_thread.threads = 1;
    /* A remote file is read from its beginning to its end. A local file is read backwards, so that
     * threads begin with the largest arrays, which are at the end. */
    bool remote = ebpo_input_prefetches(&file->in);
    for (int id = EBPO_ARRAYS - 1; id >= EBPO_LEVEL_ARRAYS; id--)
        if (file->root_array[id].present && ebpo_content_has(&file->info, (ebpo_array_id)id))
            j.array[j.count++] = &file->root_array[id];
    for (int level = file->info.level_count - 1; level >= 0; level--)
        for (int id = EBPO_LEVEL_ARRAYS - 1; id >= 0; id--)
            if (file->level_array[level][id].present)
                j.array[j.count++] = &file->level_array[level][id];
    for (unsigned i = 0; remote && i < j.count / 2; i++) {
        const ebpo_array_in *swap = j.array[i];
        j.array[i] = j.array[j.count - 1 - i];
        j.array[j.count - 1 - i] = swap;
    }
    ebpo_hint_tree(file);
    status =
        ebpo_parallel_for(read.threads, NULL, j.count, 1, digest_arrays, &j, NULL, "check", error);
    if (status == EBPO_OK)
        status = compare_digest(&j, EBPO_DIGEST_CONTENT, file->info.content_sha256,
                                "content_sha256", error);
    if (status == EBPO_OK && file->info.parts & EBPO_PART_COLOURS)
        status = compare_digest(&j, EBPO_DIGEST_COLOURS, file->info.colours_sha256,
                                "colours_sha256", error);
    if (status == EBPO_OK && file->info.parts & EBPO_PART_BORDER)
        status = compare_digest(&j, EBPO_DIGEST_BORDER, file->info.border_sha256, "border_sha256",
                                error);
    if (status == EBPO_OK && file->info.parts & EBPO_PART_SURFACE)
        status = compare_digest(&j, EBPO_DIGEST_SURFACE, file->info.surface_sha256,
                                "surface_sha256", error);
    return status == EBPO_OK ? ebpo_attributes_check(file, &read, error) : status;
}
