/* Writes VTKHDF 1.0: a file with one unstructured grid of polygons. VTKHDF has separate grids only
 * since version 2.1, and polyhedra only since 2.5. So each level, and the mesh, is a partition of
 * the one grid, and the cell array `lod` gives the level of each polygon. Source: VTK's
 * documentation, "VTKHDF file format". */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "derive/export_job.h"
#include "io/publish.h"

enum { VTK_TRIANGLE = 5, VTK_POLYGON = 7 }; /* VTK's types of cells */

/* The tables (datasets) of the file. */
enum {
    POINTS,
    CONNECTIVITY,
    OFFSETS,
    TYPES,
    POINT_COUNT,
    CELL_COUNT,
    CORNER_COUNT,
    SOURCE_VERTEX,
    /* VERTEX_COLOURS, FACE_COLOURS: made when the first block with such colours is written */
    VERTEX_COLOURS,
    FACE_COLOURS,
    FIRST_COLUMN,
    TABLES = FIRST_COLUMN + EBPO_COLUMNS
};

/* The tables with indices below FIRST_COLUMN. */
static const struct {
    const char *path;
    ebpo_h5_number number;
    uint32_t cols; /* values in a row; 0: the dataset has one dimension */
} layout[FIRST_COLUMN] = {
    { "/VTKHDF/Points", EBPO_H5_F64, 3 },
    { "/VTKHDF/Connectivity", EBPO_H5_I64, 0 },
    { "/VTKHDF/Offsets", EBPO_H5_I64, 0 },
    { "/VTKHDF/Types", EBPO_H5_U8, 0 },
    { "/VTKHDF/NumberOfPoints", EBPO_H5_I64, 0 },
    { "/VTKHDF/NumberOfCells", EBPO_H5_I64, 0 },
    { "/VTKHDF/NumberOfConnectivityIds", EBPO_H5_I64, 0 },
    { "/VTKHDF/PointData/source_vertex", EBPO_H5_I64, 0 },
    { "/VTKHDF/PointData/rgba", EBPO_H5_U8, 4 },
    { "/VTKHDF/CellData/rgba", EBPO_H5_U8, 4 },
};

typedef struct writer {
    ebpo_h5_out out;
    ebpo_h5_table table[TABLES];
    bool has_colours[2]; /* true: the table VERTEX_COLOURS, or FACE_COLOURS, exists */
} writer;

static ebpo_status make_group(writer *w, const char *path, ebpo_error *error)
{
    static const int64_t version[2] = { 1, 0 };
    ebpo_h5_id id;
    ebpo_status status = ebpo_h5_make_plain_group(&w->out, path, &id, error);
    if (status == EBPO_OK && strcmp(path, "/VTKHDF") == 0)
        status = ebpo_h5_put_ints(&w->out, id, "Version", version, 2, error);
    if (status == EBPO_OK && strcmp(path, "/VTKHDF") == 0)
        status = ebpo_h5_put_ascii(&w->out, id, "Type", "UnstructuredGrid", error);
    ebpo_h5_close_id(&w->out, id);
    return status;
}

/* Makes all tables except those of colours. `floats`: true: positions are float32. */
static ebpo_status make_tables(writer *w, bool floats, ebpo_error *error)
{
    static const char *const groups[] = { "/VTKHDF", "/VTKHDF/PointData", "/VTKHDF/CellData" };
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < 3 && status == EBPO_OK; i++)
        status = make_group(w, groups[i], error);
    for (int i = 0; i < TABLES && status == EBPO_OK; i++) {
        char path[64];
        if (i == VERTEX_COLOURS || i == FACE_COLOURS)
            continue;
        const ebpo_column *column = i < FIRST_COLUMN ? NULL : &ebpo_columns[i - FIRST_COLUMN];
        snprintf(path, sizeof path, "/VTKHDF/CellData/%s", column ? column->name : "");
        ebpo_h5_number number = column                  ? column->number
                                : i == POINTS && floats ? EBPO_H5_F32
                                                        : layout[i].number;
        status = ebpo_h5_make_table(&w->out, column ? path : layout[i].path, number,
                                    column ? 0 : layout[i].cols, &w->table[i], error);
    }
    return status;
}

/* Appends the values to a table and frees them. If `values` is NULL, because the caller's
 * allocation failed, returns EBPO_E_MEMORY. */
static ebpo_status append_table(writer *w, int table, void *values, uint64_t count,
                                ebpo_error *error)
{
    ebpo_status status = values ? ebpo_h5_append(&w->out, &w->table[table], values, count, error)
                                : ebpo_fail_memory(error, count * 8);
    free(values);
    return status;
}

static ebpo_status append_points(writer *w, const ebpo_mesh *mesh, ebpo_error *error)
{
    if (mesh->xyz32 && w->table[POINTS].number == EBPO_H5_F64) {
        double *wide = ebpo_alloc(mesh->vertex_count, 3 * sizeof *wide);
        for (uint64_t i = 0; wide && i < 3 * mesh->vertex_count; i++)
            wide[i] = (double)mesh->xyz32[i];
        return append_table(w, POINTS, wide, mesh->vertex_count, error);
    }
    return ebpo_h5_append(&w->out, &w->table[POINTS],
                          mesh->xyz32 ? (const void *)mesh->xyz32 : mesh->xyz64, mesh->vertex_count,
                          error);
}

static ebpo_status append_cells(writer *w, const ebpo_block *block, uint64_t cells,
                                uint64_t corners, ebpo_error *error)
{
    bool mesh = block->level < 0;
    int64_t *connectivity = ebpo_alloc(corners, sizeof *connectivity),
            *offsets = ebpo_alloc(cells + 1, sizeof *offsets);
    uint8_t *types = ebpo_alloc(cells, 1);
    const uint32_t *triangle = block->mesh.faces;
    uint64_t at = 0;
    for (uint64_t i = 0; connectivity && offsets && types && i < cells; i++) {
        unsigned n = mesh ? 3 : block->nodes.corners[i];
        types[i] = mesh ? VTK_TRIANGLE : VTK_POLYGON;
        offsets[i] = (int64_t)at;
        for (unsigned k = 0; k < n; k++)
            connectivity[at++] = ebpo_polygon_corner(triangle, k);
        triangle += 3 * (n - 2);
    }
    if (offsets)
        offsets[cells] = (int64_t)corners;
    ebpo_status status = append_table(w, CONNECTIVITY, connectivity, corners, error);
    if (status == EBPO_OK)
        status = append_table(w, OFFSETS, offsets, cells + 1, error);
    else
        free(offsets);
    if (status == EBPO_OK)
        return append_table(w, TYPES, types, cells, error);
    free(types);
    return status;
}

/* Appends white rows, for earlier blocks without colours, until the table has `rows` rows. */
static ebpo_status pad_colours(writer *w, int table, uint64_t rows, ebpo_error *error)
{
    uint8_t white[4 * 1024];
    memset(white, 255, sizeof white);
    ebpo_status status = EBPO_OK;
    while (status == EBPO_OK && w->table[table].rows < rows) {
        uint64_t missing = rows - w->table[table].rows;
        status = ebpo_h5_append(&w->out, &w->table[table], white, missing < 1024 ? missing : 1024,
                                error);
    }
    return status;
}

/* Appends a block's colours (NULL: white), which are `rows` rows. `total_rows` is the number of
 * rows of this block and all earlier blocks. Makes the table at the first block that has colours.
 */
static ebpo_status append_rgba(writer *w, int table, const uint8_t *rgba, uint64_t rows,
                               uint64_t total_rows, ebpo_error *error)
{
    bool *has_colours = &w->has_colours[table - VERTEX_COLOURS];
    ebpo_status status = EBPO_OK;
    if (!rgba && !*has_colours)
        return EBPO_OK;
    if (!*has_colours)
        status = ebpo_h5_make_table(&w->out, layout[table].path, layout[table].number,
                                    layout[table].cols, &w->table[table], error);
    *has_colours = true;
    if (status == EBPO_OK)
        status = pad_colours(w, table, rgba ? total_rows - rows : total_rows, error);
    return status == EBPO_OK && rgba ? ebpo_h5_append(&w->out, &w->table[table], rgba, rows, error)
                                     : status;
}

static ebpo_status append_colours(writer *w, const ebpo_block *block, ebpo_error *error)
{
    const ebpo_colours *c = &block->colours;
    ebpo_status status = append_rgba(w, VERTEX_COLOURS, c->vertex, block->mesh.vertex_count,
                                     w->table[POINTS].rows, error);
    return status == EBPO_OK ? append_rgba(w, FACE_COLOURS, c->face, block->mesh.face_count,
                                           w->table[TYPES].rows, error)
                             : status;
}

static ebpo_status append_block(writer *w, const ebpo_block *block, ebpo_error *error)
{
    bool mesh = block->level < 0;
    uint64_t cells = mesh ? block->mesh.face_count : block->nodes.polygon_count;
    /* A polygon of n corners has n - 2 triangles. */
    uint64_t corners = mesh ? 3 * cells : block->mesh.face_count + 2 * cells;
    int64_t count[3] = { (int64_t)block->mesh.vertex_count, (int64_t)cells, (int64_t)corners };
    ebpo_status status = append_points(w, &block->mesh, error);
    if (status == EBPO_OK)
        status = append_cells(w, block, cells, corners, error);
    for (int i = 0; i < 3 && status == EBPO_OK; i++)
        status = ebpo_h5_append(&w->out, &w->table[POINT_COUNT + i], &count[i], 1, error);
    if (status == EBPO_OK)
        status = append_table(w, SOURCE_VERTEX, ebpo_column_of_vertices(block),
                              block->mesh.vertex_count, error);
    for (int i = 0; i < EBPO_COLUMNS && status == EBPO_OK; i++)
        status = append_table(w, FIRST_COLUMN + i, ebpo_column_make(block, i, true), cells, error);
    return status == EBPO_OK ? append_colours(w, block, error) : status;
}

static ebpo_status write_blocks(writer *w, const ebpo_export_job *job, ebpo_error *error)
{
    bool levels = ebpo_block_level(job->options, 0) >= 0;
    ebpo_status status =
        make_tables(w, !levels && !ebpo_file_info(job->file)->double_coordinates, error);
    for (int i = 0; i < ebpo_block_count(job->options) && status == EBPO_OK; i++) {
        ebpo_block block;
        status = ebpo_export_read_block(job, i, EBPO_FILE_ORDER, &block, error);
        if (status == EBPO_OK)
            status = append_block(w, &block, error);
        ebpo_block_free(&block);
    }
    return status;
}

ebpo_status ebpo_export_vtkhdf(const ebpo_export_job *job, ebpo_error *error)
{
    writer w = { .out = EBPO_H5_OUT_INIT };
    ebpo_publish target = EBPO_PUBLISH_INIT;
    for (int i = 0; i < TABLES; i++)
        w.table[i] = (ebpo_h5_table)EBPO_H5_TABLE_INIT;
    ebpo_status status = ebpo_publish_begin(&target, job->path, error);
    if (status == EBPO_OK)
        status = ebpo_h5_create_plain(&w.out, ebpo_publish_path(&target), job->path, error);
    if (status == EBPO_OK)
        status = write_blocks(&w, job, error);
    for (int i = 0; i < TABLES; i++)
        ebpo_h5_close_table(&w.out, &w.table[i]);
    if (status == EBPO_OK)
        status = ebpo_h5_finish(&w.out, error);
    ebpo_h5_discard(&w.out);
    if (status == EBPO_OK)
        status = ebpo_publish_commit(&target, error);
    ebpo_publish_abort(&target);
    return status;
}
