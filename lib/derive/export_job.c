/* Reads the data that all export formats share. A block is a level with its nodes and colours, or
 * the mesh with its source indices and colours. The functions of this file read a block, add the
 * block to the report, and make columns (arrays of values of the block's nodes, polygons or faces).
 * They also make float32 coordinates for formats that need them, and check the limits of formats.
 */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "derive/export_job.h"
#include "geometry/cells.h"
#include "mesh/attributes.h"

const ebpo_column ebpo_columns[EBPO_COLUMNS] = {
    /* Each comment gives the value in a level, and then the value in the mesh. */
    { "octcode", EBPO_H5_I64 },     /* locational code of the node; 0 for the mesh */
    { "level", EBPO_H5_I32 },       /* level of the node in the octree; -1 for the mesh */
    { "type", EBPO_H5_I32 },        /* type of the node (ebpo_node_type); -1 for the mesh */
    { "winding", EBPO_H5_I32 },     /* black nodes: winding number in the cell; leaves: winding
                                       number at the lowest corner of the cell; all other nodes, and
                                       the mesh: 0 */
    { "volume", EBPO_H5_F64 },      /* volume of the envelope; 0 for the mesh */
    { "source_face", EBPO_H5_I64 }, /* -1 in a level; in the mesh, the source index of the face, or
                                       -1 if the file has no maps */
    { "lod", EBPO_H5_I32 },         /* level of the block; -1 for the mesh */
};

int ebpo_block_count(const ebpo_export_options *o)
{
    return (o->first_level <= o->last_level ? o->last_level - o->first_level + 1 : 0) + o->mesh;
}

int ebpo_block_level(const ebpo_export_options *o, int i)
{
    return o->first_level <= o->last_level && i <= o->last_level - o->first_level
               ? o->first_level + i
               : -1;
}

/* Replaces the colours of the mesh by the caller's colours. */
static ebpo_status replace_colours(ebpo_block *out, const uint8_t *rgba, ebpo_error *error)
{
    uint64_t bytes = 4 * out->mesh.vertex_count;
    uint8_t *copy = ebpo_alloc(bytes, 1);
    if (!copy)
        return ebpo_fail_memory(error, bytes);
    memcpy(copy, rgba, bytes);
    free(out->colours.vertex);
    out->colours.vertex = copy;
    out->colours.by_face = 0;
    return EBPO_OK;
}

static ebpo_status read_mesh(ebpo_block *out, const ebpo_file *file, ebpo_block_order order,
                             const ebpo_export_options *options, ebpo_error *error)
{
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    read.threads = options->threads;
    read.attributes = 1;
    snprintf(out->name, sizeof out->name, "mesh");
    ebpo_status status = order == EBPO_SOURCE_ORDER
                             ? ebpo_file_read_source_mesh(file, &read, &out->mesh, NULL, error)
                             : ebpo_file_read_mesh(file, &read, &out->mesh, error);
    if (status == EBPO_OK)
        status = ebpo_mesh_colours(&out->mesh, &out->colours, error);
    if (status == EBPO_OK && options->vertex_colours)
        status = replace_colours(out, options->vertex_colours, error);
    ebpo_attributes_free(out->mesh.attributes); /* other attributes are not exported */
    out->mesh.attributes = NULL;
    if (status == EBPO_OK && order == EBPO_FILE_ORDER &&
        ebpo_file_info(file)->parts & EBPO_PART_MAPS)
        status = ebpo_file_read_maps(file, &read, &out->maps, error);
    return status;
}

static ebpo_status read_block(ebpo_block *out, const ebpo_file *file, int level,
                              ebpo_block_order order, const ebpo_export_options *options,
                              ebpo_error *error)
{
    *out = (ebpo_block){ .level = level };
    if (level < 0)
        return read_mesh(out, file, order, options, error);
    ebpo_lod_options lod = EBPO_LOD_OPTIONS_INIT;
    lod.threads = options->threads;
    lod.progress = options->progress;
    snprintf(out->name, sizeof out->name, "level_%02d", level);
    ebpo_status status =
        ebpo_lod_level_nodes(file, level, &lod, &out->mesh, &out->nodes, &out->volume, error);
    return status == EBPO_OK
               ? ebpo_lod_colours(&out->nodes, out->mesh.vertex_count, &out->colours, error)
               : status;
}

void ebpo_block_free(ebpo_block *block)
{
    ebpo_mesh_free(&block->mesh);
    ebpo_lod_nodes_free(&block->nodes);
    ebpo_maps_free(&block->maps);
    ebpo_colours_free(&block->colours);
    memset(block, 0, sizeof *block);
}

/* Adds a block to the report. */
static void report_block(const ebpo_block *block, ebpo_export_report *report)
{
    bool mesh = block->level < 0;
    report->block[report->block_count++] =
        (ebpo_export_block){ block->level,
                             block->nodes.node_count,
                             mesh ? block->mesh.face_count : block->nodes.polygon_count,
                             block->mesh.face_count,
                             block->mesh.vertex_count,
                             block->volume };
}

/* --- columns --- */

/* Stores an integer as values[i]; `number` is the type of the array. */
static void set_integer(void *values, ebpo_h5_number number, uint64_t i, int64_t v)
{
    if (number == EBPO_H5_I64)
        ((int64_t *)values)[i] = v;
    else if (number == EBPO_H5_F64)
        ((double *)values)[i] = (double)v;
    else
        ((int32_t *)values)[i] = (int32_t)v;
}

/* Returns the value of an integer column for a node. */
static int64_t value_of(const ebpo_block *block, const ebpo_lod_node *node, int column)
{
    switch (column) {
    case EBPO_COLUMN_OCTCODE: return (int64_t)node->octcode;
    case EBPO_COLUMN_LEVEL: return ebpo_octcode_level(node->octcode);
    case EBPO_COLUMN_TYPE: return node->type;
    case EBPO_COLUMN_WINDING: return node->winding;
    case EBPO_COLUMN_LOD: return block->level;
    default: return -1;
    }
}

/* Returns the value of a column for a face of the mesh. */
static int64_t value_of_face(const ebpo_block *block, uint64_t face, int column)
{
    switch (column) {
    case EBPO_COLUMN_SOURCE_FACE:
        return block->maps.face_source ? (int64_t)block->maps.face_source[face] : -1;
    case EBPO_COLUMN_LEVEL:
    case EBPO_COLUMN_TYPE:
    case EBPO_COLUMN_LOD: return -1;
    default: return 0;
    }
}

void *ebpo_column_make(const ebpo_block *block, int column, bool polygons)
{
    const ebpo_lod_nodes *nodes = &block->nodes;
    ebpo_h5_number number = ebpo_columns[column].number;
    bool mesh = block->level < 0;
    uint64_t count = mesh       ? block->mesh.face_count
                     : polygons ? nodes->polygon_count
                                : nodes->node_count,
             value_index = 0;
    void *values = ebpo_alloc(count, ebpo_h5_number_bytes(number));
    if (!values)
        return NULL;
    for (uint64_t i = 0; mesh && i < count; i++)
        set_integer(values, number, i, value_of_face(block, i, column));
    for (uint64_t i = 0; i < nodes->node_count; i++) {
        const ebpo_lod_node *node = &nodes->nodes[i];
        for (uint32_t k = 0; k < (polygons ? node->polygon_count : 1); k++, value_index++) {
            if (column == EBPO_COLUMN_VOLUME)
                ((double *)values)[value_index] = node->volume;
            else
                set_integer(values, number, value_index, value_of(block, node, column));
        }
    }
    return values;
}

void *ebpo_column_of_vertices(const ebpo_block *block)
{
    uint64_t count = block->mesh.vertex_count;
    int64_t *values = ebpo_alloc(count, sizeof *values);
    for (uint64_t i = 0; values && i < count; i++)
        values[i] = block->maps.vertex_source ? (int64_t)block->maps.vertex_source[i] : -1;
    return values;
}

ebpo_status ebpo_mesh_floats(float **out, const ebpo_mesh *mesh, const double origin[3],
                             double *largest_change, ebpo_error *error)
{
    float *xyz = *out = ebpo_alloc(mesh->vertex_count, 3 * sizeof *xyz);
    if (!xyz)
        return ebpo_fail_memory(error, mesh->vertex_count * 3 * sizeof *xyz);
    for (uint64_t i = 0; i < 3 * mesh->vertex_count; i++) {
        double coordinate = mesh->xyz32 ? (double)mesh->xyz32[i] : mesh->xyz64[i];
        xyz[i] = (float)(coordinate - origin[i % 3]);
        *largest_change = fmax(*largest_change, fabs((double)xyz[i] + origin[i % 3] - coordinate));
        if (!isfinite(xyz[i])) {
            free(xyz);
            *out = NULL;
            return ebpo_fail(error, EBPO_E_LIMIT,
                             "a coordinate of %g exceeds the range of float32; export XDMF or "
                             "VTKHDF, or scale the model",
                             coordinate);
        }
    }
    return EBPO_OK;
}

void ebpo_json_number(FILE *file, double x)
{
    char text[40];
    snprintf(text, sizeof text, "%.17g", x);
    for (char *c = text; *c; c++)
        if (!strchr("+-0123456789eE", *c))
            *c = '.';
    fputs(text, file);
}

void ebpo_json_numbers(FILE *file, const char *before, const double *x, int count)
{
    fputs(before, file);
    for (int k = 0; k < count; k++) {
        fputc(k ? ',' : '[', file);
        ebpo_json_number(file, x[k]);
    }
    fputc(']', file);
}

void ebpo_linear_colours(uint16_t linear[256])
{
    for (int i = 0; i < 256; i++) {
        double c = i / 255.0;
        linear[i] =
            (uint16_t)(65535 * (c <= 0.04045 ? c / 12.92 : pow((c + 0.055) / 1.055, 2.4)) + 0.5);
    }
}

void ebpo_choose_origin(const ebpo_info *info, double origin[3])
{
    double size = 0, largest = 0;
    for (int k = 0; k < 3; k++) {
        origin[k] = 0;
        size = fmax(size, info->box_size[k]);
        largest = fmax(largest, fmax(fabs(info->box_origin[k]),
                                     fabs(info->box_origin[k] + info->box_size[k])));
    }
    for (int k = 0; k < 3 && largest > 16 * size; k++) {
        /* The exported file stores `origin` as a translation, which programs read as float32. */
        float middle = (float)(info->box_origin[k] + info->box_size[k] / 2);
        origin[k] = isfinite(middle) ? (double)middle : 0;
    }
}

/* Records in the report whether the format stores the block's colours or omits them. */
static void report_colours(const ebpo_export_job *job, const ebpo_colours *colours)
{
    if (colours->vertex)
        job->report->vertex_colours =
            job->row->holds_vertex_colours ? EBPO_EXPORT_WRITTEN : EBPO_EXPORT_OMITTED;
    if (colours->face)
        job->report->face_colours =
            job->row->holds_face_colours ? EBPO_EXPORT_WRITTEN : EBPO_EXPORT_OMITTED;
}

ebpo_status ebpo_export_read_block(const ebpo_export_job *job, int i, ebpo_block_order order,
                                   ebpo_block *out, ebpo_error *error)
{
    *out = (ebpo_block){ 0 };
    if (!ebpo_progress_step(&job->options->progress, "exporting", (uint64_t)i,
                            (uint64_t)ebpo_block_count(job->options), error))
        return EBPO_E_CANCELLED;
    ebpo_status status =
        read_block(out, job->file, ebpo_block_level(job->options, i), order, job->options, error);
    if (status == EBPO_OK)
        report_block(out, job->report);
    if (status == EBPO_OK)
        report_colours(job, &out->colours);
    return status;
}

ebpo_status ebpo_export_check_glb(const char *path, uint64_t text, uint64_t bin, ebpo_error *error)
{
    uint64_t total = EBPO_GLB_HEADS + (text + 3) / 4 * 4 + bin;
    if (total <= UINT32_MAX)
        return EBPO_OK;
    return ebpo_fail_file(
        error, EBPO_E_LIMIT, path,
        "would have %" PRIu64
        " bytes or more, but a GLB file must be smaller than 4 GiB; export gltf, or coarser levels",
        total);
}

ebpo_status ebpo_export_check_assimp(const char *path, uint64_t vertices, uint64_t faces,
                                     ebpo_error *error)
{
    if (vertices <= UINT32_MAX && faces <= UINT32_MAX / 3)
        return EBPO_OK;
    return ebpo_fail_file(error, EBPO_E_LIMIT, path,
                          "would have %" PRIu64 " vertices and %" PRIu64
                          " triangles, but assimp supports at most %" PRIu32
                          " vertices and %" PRIu32
                          " triangles; choose another format, or a coarser level",
                          vertices, faces, UINT32_MAX, UINT32_MAX / 3);
}
