/* How many bytes of a file its arrays take. */
#include "format/stored_sizes.h"

#include "core/error.h"

static uint64_t level_bytes(const ebpo_file *file, int level, bool located)
{
    uint64_t bytes = 0;
    for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++) {
        const ebpo_array_in *a = &file->level_array[level][id];
        if (located || (a->present && ebpo_shape_chunks(&a->shape) == 1))
            bytes += a->stored_bytes;
    }
    return bytes;
}

/* Another thread may be locating the chunks: until then only those count that opening tells. */
uint64_t ebpo_reader_level_bytes(const ebpo_file *file, int level)
{
    return level_bytes(file, level, atomic_load(&file->located));
}

/* Of the arrays whose chunks are known. */
ebpo_stored_sizes ebpo_reader_sizes(const ebpo_file *file)
{
    ebpo_stored_sizes sizes = { .map_bytes = 0 };
    for (int level = 0; level < file->info.level_count; level++)
        sizes.level_bytes[level] = level_bytes(file, level, true);
    for (int id = EBPO_LEVEL_ARRAYS; id < EBPO_ARRAYS; id++)
        *(uint64_t *)(void *)((char *)&sizes + ebpo_schema[id].bytes) +=
            file->root_array[id].stored_bytes;
    for (int i = 0; i < file->attributes.arrays; i++)
        sizes.attribute_bytes += file->attributes.array[i].stored_bytes;
    return sizes;
}

ebpo_status ebpo_stored_check(const ebpo_file *file, ebpo_error *error)
{
    ebpo_stored_sizes sizes = ebpo_reader_sizes(file);
    uint64_t stored = sizes.mesh_vertex_bytes + sizes.mesh_face_bytes + sizes.map_bytes +
                      sizes.subtree_bytes + sizes.attribute_bytes + sizes.sum_bytes;
    for (int level = 0; level < file->info.level_count; level++)
        stored += sizes.level_bytes[level];
    if (stored > file->info.file_bytes)
        return ebpo_fail_file(
            error, EBPO_E_FORMAT, file->in.shown,
            "the arrays' chunks take more room than the file has; get a fresh copy of the file");
    return EBPO_OK;
}

static double decoded_bytes(const ebpo_array_in *a)
{
    return a->present ? (double)a->shape.rows * (double)ebpo_shape_row_bytes(&a->shape) : 0;
}

ebpo_status ebpo_stored_check_expansion(const ebpo_file *file, uint64_t most, ebpo_error *error)
{
    double bytes = 0, room = (double)file->info.file_bytes;
    for (int level = 0; level < file->info.level_count; level++)
        for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++)
            bytes += decoded_bytes(&file->level_array[level][id]);
    for (int id = EBPO_LEVEL_ARRAYS; id < EBPO_ARRAYS; id++)
        bytes += decoded_bytes(&file->root_array[id]);
    for (int i = 0; i < file->attributes.arrays; i++)
        bytes += decoded_bytes(&file->attributes.array[i]);
    most = most ? most : EBPO_EXPANSION_MOST;
    if (most == UINT64_MAX || bytes <= (double)EBPO_EXPANSION_FREE || bytes <= (double)most * room)
        return EBPO_OK;
    return ebpo_fail_file(
        error, EBPO_E_LIMIT, file->in.shown,
        "decoded, its arrays take %.0f MB, %.0f times the file and more than %llu "
        "times: it may be made to exhaust memory; if you trust it, read it with "
        "--most-expansion %.0f",
        bytes / 1e6, bytes / room, (unsigned long long)most, bytes / room + 1);
}
