/* Reads the table of all patches of a simplified surface, and single patches when they are needed.
 * A patch is the simplified surface of one node. The table is in memory; patches are read through a
 * cache of chunks. The file is untrusted input, so every value is checked before it is used.
 * Source: format-spec/surface.md. */
#include "format/patch_table.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "format/reader.h"

/* The arrays with the triangle codes and the vertices of patches. */
static const struct {
    ebpo_array_id id;
    unsigned columns, size; /* columns, and bytes of an element */
    bool of_code;           /* true: rows are bytes of code; false: rows are vertices */
} ARRAYS[] = { { EBPO_A_SURFACE_TRIANGLES, 1, 1, true },
               { EBPO_A_SURFACE_POINTS, 3, 2, false },
               { EBPO_A_SURFACE_NORMALS, 2, 1, false },
               { EBPO_A_SURFACE_COLOURS, 3, 1, false } };
/* COLOURS: index of the array of colours, which is the last because a file may lack it. */
enum { ARRAY_COUNT = sizeof ARRAYS / sizeof *ARRAYS, COLOURS = ARRAY_COUNT - 1 };

void ebpo_patch_table_free(ebpo_patch_table *table)
{
    free(table->row);
    free(table->vertex);
    free(table->code);
    free(table->child);
    free(table->child_end);
    memset(table, 0, sizeof *table);
}

/* Computes the first vertices, first bytes of code and children from the rows of the table. Patches
 * ascend by octcode, so the children of successive patches also ascend. */
static void fill_table(ebpo_patch_table *t)
{
    uint64_t next = 0;
    t->vertex[0] = t->code[0] = 0;
    for (uint64_t i = 0; i < t->count; i++) {
        const uint64_t *row = t->row + EBPO_PATCH_COLUMNS * i;
        t->vertex[i + 1] = t->vertex[i] + row[EBPO_PATCH_VERTICES];
        t->code[i + 1] = t->code[i] + row[EBPO_PATCH_CODE_BYTES];
    }
    for (uint64_t i = 0; i < t->count; i++) {
        uint64_t code = t->row[EBPO_PATCH_COLUMNS * i + EBPO_PATCH_OCTCODE];
        while (next < t->count &&
               ebpo_octcode_parent(t->row[EBPO_PATCH_COLUMNS * next + EBPO_PATCH_OCTCODE]) < code)
            next++;
        t->child[i] = next;
        while (next < t->count &&
               ebpo_octcode_parent(t->row[EBPO_PATCH_COLUMNS * next + EBPO_PATCH_OCTCODE]) == code)
            next++;
        t->child_end[i] = next;
    }
}

ebpo_status ebpo_patch_table_read(ebpo_patch_table *table, ebpo_chunks *chunks, ebpo_error *error)
{
    const ebpo_info *info = &chunks->file->info;
    uint64_t count = info->surface_patches;
    ebpo_patch_table made = { .count = count };
    if (table->row)
        return EBPO_OK;
    if (!(info->parts & EBPO_PART_SURFACE))
        return ebpo_surface_absent(chunks->file, error);
    ebpo_status status = ebpo_chunks_take(chunks, EBPO_A_SURFACE_PATCHES, 0, 0, count,
                                          sizeof *made.row, &made.row, error);
    if (status != EBPO_OK)
        return status;
    ebpo_surface surface = { .patch_count = count,
                             .triangle_count = info->surface_triangles,
                             .vertex_count = info->surface_vertices,
                             .code_bytes = info->surface_code_bytes,
                             .patch = made.row };
    const char *fault = ebpo_surface_fault(info, &surface);
    if (fault)
        status = ebpo_chunks_fail(chunks, -1, EBPO_A_SURFACE_PATCHES, fault, error);
    made.vertex = ebpo_alloc(count + 1, sizeof *made.vertex);
    made.code = ebpo_alloc(count + 1, sizeof *made.code);
    made.child = ebpo_alloc(count, sizeof *made.child);
    made.child_end = ebpo_alloc(count, sizeof *made.child_end);
    if (status == EBPO_OK && !(made.vertex && made.code && made.child && made.child_end))
        status = ebpo_fail_memory(error, 4 * (count + 1) * sizeof *made.vertex);
    if (status == EBPO_OK) {
        fill_table(&made);
        *table = made;
    } else {
        ebpo_patch_table_free(&made);
    }
    return status;
}

double ebpo_patch_table_error(const ebpo_patch_table *table, const ebpo_info *info, uint64_t patch)
{
    return (double)table->row[EBPO_PATCH_COLUMNS * patch + EBPO_PATCH_ERROR] *
           ebpo_patch_error_step(info);
}

/* Returns the first row of a patch in array ARRAYS[array]. *rows: number of the patch's rows. */
static uint64_t rows_of(const ebpo_patch_table *t, int array, uint64_t patch, uint64_t *rows)
{
    const uint64_t *first = ARRAYS[array].of_code ? t->code : t->vertex;
    *rows = first[patch + 1] - first[patch];
    return first[patch];
}

/* Returns the number of arrays that the file has. */
static int array_count(const ebpo_chunks *chunks)
{
    return chunks->file->info.surface_colours ? ARRAY_COUNT : COLOURS;
}

void ebpo_patch_hint(const ebpo_patch_table *table, ebpo_chunks *chunks, ebpo_hints *hints,
                     uint64_t patch)
{
    for (int i = 0; i < array_count(chunks); i++) {
        uint64_t rows, first = rows_of(table, i, patch, &rows);
        ebpo_chunks_hint(chunks, hints, ARRAYS[i].id, 0, first, rows);
    }
}

void ebpo_patch_missing(const ebpo_patch_table *table, ebpo_chunks *chunks, uint64_t patch,
                        ebpo_chunk_keys *keys)
{
    for (int i = 0; i < array_count(chunks); i++) {
        uint64_t rows, first = rows_of(table, i, patch, &rows);
        (void)ebpo_chunks_missing(chunks, ARRAYS[i].id, 0, first, rows, keys);
    }
}

ebpo_status ebpo_patches_take(const ebpo_patch_table *table, ebpo_chunks *chunks,
                              const uint64_t *patches, uint64_t count, ebpo_surface *out,
                              ebpo_error *error)
{
    uint8_t *to[ARRAY_COUNT] = {
        NULL
    }; /* position at which the next rows of each array are written */
    ebpo_status status = EBPO_OK;
    memset(out, 0, sizeof *out);
    for (uint64_t i = 0; i < count; i++) {
        const uint64_t *row = table->row + EBPO_PATCH_COLUMNS * patches[i];
        out->triangle_count += row[EBPO_PATCH_TRIANGLES];
        out->vertex_count += row[EBPO_PATCH_VERTICES];
        out->code_bytes += row[EBPO_PATCH_CODE_BYTES];
    }
    out->patch_count = count;
    out->colour_count = chunks->file->info.surface_colours ? out->vertex_count : 0;
    out->patch = ebpo_alloc(count, EBPO_PATCH_COLUMNS * sizeof *out->patch);
    to[0] = out->code = ebpo_alloc(out->code_bytes, 1);
    to[1] = (uint8_t *)(out->point = ebpo_alloc(out->vertex_count, 3 * sizeof *out->point));
    to[2] = out->normal = ebpo_alloc(out->vertex_count, 2);
    to[3] = out->colour = out->colour_count ? ebpo_alloc(out->colour_count, 3) : NULL;
    if (!out->patch || !out->code || !out->point || !out->normal ||
        (out->colour_count && !out->colour))
        status = ebpo_fail_memory(error, out->code_bytes + 11 * out->vertex_count);
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++) {
        memcpy(out->patch + EBPO_PATCH_COLUMNS * i, table->row + EBPO_PATCH_COLUMNS * patches[i],
               EBPO_PATCH_COLUMNS * sizeof *out->patch);
        for (int k = 0; k < array_count(chunks) && status == EBPO_OK; k++) {
            uint64_t rows, first = rows_of(table, k, patches[i], &rows);
            status = ebpo_chunks_integers(chunks, ARRAYS[k].id, 0, first, rows, to[k],
                                          ARRAYS[k].size, error);
            to[k] += rows * ARRAYS[k].columns * ARRAYS[k].size;
        }
    }
    if (status != EBPO_OK)
        ebpo_surface_free(out);
    return status;
}

ebpo_status ebpo_patch_read(const ebpo_patch_table *table, ebpo_chunks *chunks, uint64_t patch,
                            ebpo_patch *out, ebpo_error *error)
{
    ebpo_surface one;
    *out = (ebpo_patch)EBPO_PATCH_INIT;
    ebpo_status status = ebpo_patches_take(table, chunks, &patch, 1, &one, error);
    if (status == EBPO_OK)
        status = ebpo_surface_decode(&one, &chunks->file->info, 0, out, error);
    if (status == EBPO_E_FORMAT && one.patch)
        status = ebpo_patch_code_fails(status, chunks->file->in.shown, error);
    ebpo_surface_free(&one);
    return status;
}
