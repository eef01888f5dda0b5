/* The mesh, its maps, the source's order, and whole trees. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/sized.h"
#include "core/arrays.h"
#include "hdf5_read/coding.h"
#include "format/read_attributes.h"
#include "format/reader.h"

void ebpo_tree_free(ebpo_tree *tree)
{
    if (!tree)
        return;
    for (int i = 0; i < EBPO_LEVELS_MAX; i++)
        ebpo_level_free(&tree->level[i]);
    ebpo_mesh_free(&tree->mesh);
    ebpo_array_free(tree->workspace, tree->vertex_source);
    ebpo_array_free(tree->workspace, tree->face_source);
    memset(tree, 0, sizeof *tree);
}

static ebpo_status part_absent(const ebpo_file *file, const char *part, ebpo_error *error)
{
    return ebpo_fail_file(error, EBPO_E_ABSENT, file->in.shown,
                          "the file was written without its %s; build it again with that part",
                          part);
}

typedef struct mesh_job {
    const ebpo_file *file;
    ebpo_mesh *mesh;
    uint64_t *faces_index; /* NULL: a single chunk */
    uint64_t seen;         /* by the last chunk */
} mesh_job;

static ebpo_status take_vertices(void *context, const ebpo_array_in *array, uint64_t chunk,
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

static ebpo_status take_faces(void *context, const ebpo_array_in *array, uint64_t chunk,
                              uint64_t row, uint64_t rows, const uint8_t *bytes, ebpo_error *error)
{
    mesh_job *j = context;
    ebpo_check check = ebpo_reader_check(j->file, j->mesh->workspace);
    uint64_t last = ebpo_shape_chunks(&array->shape) - 1;
    uint64_t seen = j->faces_index ? j->faces_index[chunk] : 0;
    if (seen > j->mesh->vertex_count || (chunk == 0 && seen))
        return ebpo_check_fail(&check, -1, "/mesh/faces_index",
                               "the index names more vertices than there are", error);
    if (!ebpo_corners_decode(bytes, rows, &seen, j->mesh->faces + 3 * row) ||
        seen > j->mesh->vertex_count)
        return ebpo_check_fail(&check, -1, "/mesh/faces",
                               "a face names a vertex that does not exist", error);
    if (chunk < last && seen != j->faces_index[chunk + 1])
        return ebpo_check_fail(&check, -1, "/mesh/faces_index", "the index contradicts the faces",
                               error);
    return EBPO_OK;
}

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
    ebpo_read_options alone = *read;
    alone.threads = 1;
    ebpo_status status = make_mesh(file, out, read->workspace, error);
    if (status == EBPO_OK)
        status = ebpo_reader_rows(file, ebpo_reader_array(file, EBPO_A_VERTICES, 0), read,
                                  take_vertices, &j, error);
    if (status == EBPO_OK)
        status = ebpo_check_finite(&check, out, error);
    if (status == EBPO_OK)
        status = ebpo_reader_make(file, EBPO_A_FACES_INDEX, 0, &alone, 8, &j.faces_index, error);
    if (status == EBPO_OK)
        status = ebpo_reader_rows(file, ebpo_reader_array(file, EBPO_A_FACES, 0), read, take_faces,
                                  &j, error);
    ebpo_array_free(read->workspace, j.faces_index);
    if (status != EBPO_OK)
        ebpo_mesh_free(out);
    return status;
}

ebpo_status ebpo_file_read_mesh(const ebpo_file *file, const ebpo_read_options *options,
                                ebpo_mesh *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    memset(out, 0, sizeof *out);
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_read_options, &read, options, error);
    if (status != EBPO_OK)
        return status;
    if (!(file->info.parts & EBPO_PART_MESH))
        return part_absent(file, "mesh", error);
    ebpo_expected expected = EBPO_EXPECTED_INIT(file);
    ebpo_expect_root(&expected, EBPO_NEEDS_MESH);
    if (read.attributes)
        ebpo_expect_attributes(&expected);
    ebpo_expect_all(&expected);
    status = read_mesh(file, out, &read, error);
    if (status == EBPO_OK && read.attributes)
        status = ebpo_attributes_read(file, &read, &out->attributes, error);
    if (status != EBPO_OK)
        ebpo_mesh_free(out);
    return status;
}

static ebpo_status take_numbers(void *context, const ebpo_array_in *array, uint64_t chunk,
                                uint64_t row, uint64_t rows, const uint8_t *bytes,
                                ebpo_error *error)
{
    (void)array;
    (void)chunk;
    (void)error;
    ebpo_numbers_decode(bytes, rows, (uint32_t *)context + row);
    return EBPO_OK;
}

static ebpo_status read_map(const ebpo_file *file, ebpo_array_id id, uint64_t limit,
                            const ebpo_read_options *read, uint32_t **out, ebpo_error *error)
{
    const ebpo_array_in *array = ebpo_reader_array(file, id, 0);
    ebpo_check check = ebpo_reader_check(file, read->workspace);
    uint32_t *map = *out = ebpo_array_alloc(read->workspace, array->shape.rows, sizeof *map);
    if (!map)
        return ebpo_workspace_fail(read->workspace, array->shape.rows * sizeof *map, error);
    ebpo_status status = ebpo_reader_rows(file, array, read, take_numbers, map, error);
    return status == EBPO_OK
               ? ebpo_check_map(&check, array->path, map, array->shape.rows, limit, error)
               : status;
}

static uint64_t face_limit(const ebpo_info *info)
{
    return info->source_face_count + info->mend.added_faces;
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
    ebpo_status status = EBPO_TAKE(ebpo_read_options, &read, options, error);
    if (status != EBPO_OK)
        return status;
    if (!(file->info.parts & EBPO_PART_MAPS))
        return part_absent(file, "maps to the source's numbers", error);
    ebpo_expected expected = EBPO_EXPECTED_INIT(file);
    ebpo_expect_root(&expected, EBPO_NEEDS_MAPS);
    ebpo_expect_all(&expected);
    out->workspace = read.workspace;
    status = read_map(file, EBPO_A_VERTEX_SOURCE, file->info.source_vertex_count, &read,
                      &out->vertex_source, error);
    if (status == EBPO_OK)
        status = read_map(file, EBPO_A_FACE_SOURCE, face_limit(&file->info), &read,
                          &out->face_source, error);
    if (status != EBPO_OK)
        ebpo_maps_free(out);
    return status;
}

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
    if (read.without)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, file->in.shown,
                              "parts to be left out are asked for, and a tree is read whole; set "
                              "read options' `without` to 0, or read levels");
    ebpo_expect_tree(file);
    out->info = file->info;
    out->workspace = read.workspace;
    read.attributes = 1;
    status = read_parts(file, out, &read, error);
    if (status != EBPO_OK)
        ebpo_tree_free(out);
    return status;
}

/* Place of each item when they are sorted by their source number (distinct, below limit): how many
 * smaller ones there are. In *place, to be freed. Counted in a bit for each number that there may
 * be, as a head may state far more of them than the file has items: pages without items stay empty.
 */
static ebpo_status sort_by_source(ebpo_workspace *workspace, const uint32_t *source, uint64_t count,
                                  uint64_t limit, uint32_t **place, ebpo_error *error)
{
    enum { WORDS = 8 /* between two counts */ };
    uint64_t words = (limit <= UINT32_MAX ? limit : UINT64_C(1) << 32) / 64 + 1;
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
        *place = out;
    else
        ebpo_array_free(workspace, out);
    return status;
}

static ebpo_status reorder_vertices(ebpo_mesh *mesh, const uint32_t *place, ebpo_error *error)
{
    size_t size = mesh->xyz32 ? 3 * sizeof *mesh->xyz32 : 3 * sizeof *mesh->xyz64;
    const uint8_t *old = mesh->xyz32 ? (const uint8_t *)mesh->xyz32 : (const uint8_t *)mesh->xyz64;
    uint8_t *sorted = ebpo_array_alloc(mesh->workspace, mesh->vertex_count, size);
    if (!sorted)
        return ebpo_workspace_fail(mesh->workspace, mesh->vertex_count * size, error);
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, 0, mesh->vertex_count)
        memcpy(sorted + place[i] * size, old + i * size, size);
    if (mesh->xyz32) {
        ebpo_array_free(mesh->workspace, mesh->xyz32);
        mesh->xyz32 = (float *)(void *)sorted;
    } else {
        ebpo_array_free(mesh->workspace, mesh->xyz64);
        mesh->xyz64 = (double *)(void *)sorted;
    }
    return EBPO_OK;
}

static ebpo_status reorder_faces(ebpo_mesh *mesh, const uint32_t *vertex_place,
                                 const uint32_t *face_place, ebpo_error *error)
{
    uint32_t *sorted = ebpo_array_alloc(mesh->workspace, mesh->face_count, 3 * sizeof *sorted);
    if (!sorted)
        return ebpo_workspace_fail(mesh->workspace, mesh->face_count * 12, error);
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, 0, mesh->face_count * 3)
        sorted[3 * (uint64_t)face_place[i / 3] + i % 3] = vertex_place[mesh->faces[i]];
    ebpo_array_free(mesh->workspace, mesh->faces);
    mesh->faces = sorted;
    return EBPO_OK;
}

/* rows[place[i]] = i */
static ebpo_status reorder_attributes(ebpo_mesh *mesh, const char *element, const uint32_t *place,
                                      uint64_t count, ebpo_error *error)
{
    if (!mesh->attributes)
        return EBPO_OK;
    uint32_t *rows = ebpo_array_alloc(mesh->workspace, count, sizeof *rows);
    if (!rows)
        return ebpo_workspace_fail(mesh->workspace, count * sizeof *rows, error);
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, 0, count)
        rows[place[i]] = (uint32_t)i;
    ebpo_status status = ebpo_attributes_pick(mesh->attributes, element, rows, count, error);
    ebpo_array_free(mesh->workspace, rows);
    return status;
}

static ebpo_status to_source_order(const ebpo_file *file, ebpo_mesh *mesh,
                                   const ebpo_read_options *read, ebpo_error *error)
{
    uint32_t *vertex_place = NULL, *face_place = NULL;
    ebpo_workspace *workspace = read->workspace;
    ebpo_maps maps;
    ebpo_status status = ebpo_file_read_maps(file, read, &maps, error);
    if (status == EBPO_OK)
        status = sort_by_source(workspace, maps.vertex_source, mesh->vertex_count,
                                file->info.source_vertex_count, &vertex_place, error);
    if (status == EBPO_OK)
        status = sort_by_source(workspace, maps.face_source, mesh->face_count,
                                face_limit(&file->info), &face_place, error);
    ebpo_maps_free(&maps);
    if (status == EBPO_OK)
        status = reorder_vertices(mesh, vertex_place, error);
    if (status == EBPO_OK)
        status = reorder_faces(mesh, vertex_place, face_place, error);
    if (status == EBPO_OK)
        status = reorder_attributes(mesh, "vertex", vertex_place, mesh->vertex_count, error);
    if (status == EBPO_OK)
        status = reorder_attributes(mesh, "face", face_place, mesh->face_count, error);
    ebpo_array_free(workspace, vertex_place);
    ebpo_array_free(workspace, face_place);
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
    ebpo_expected expected = EBPO_EXPECTED_INIT(file);
    ebpo_expect_root(&expected, EBPO_NEEDS_MESH | EBPO_NEEDS_MAPS);
    if (read.attributes)
        ebpo_expect_attributes(&expected);
    ebpo_expect_all(&expected);
    status = ebpo_file_read_mesh(file, &read, out, error);
    if (status == EBPO_OK && maps)
        status = to_source_order(file, out, &read, error);
    if (status == EBPO_OK && (!maps || file->info.mend.welded_vertices))
        ebpo_attributes_drop_others(out->attributes); /* numbers of vertices are the source's */
    if (source_order)
        *source_order = status == EBPO_OK && maps;
    if (status != EBPO_OK)
        ebpo_mesh_free(out);
    return status;
}
