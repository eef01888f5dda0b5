/* Writes XDMF 3: a text file that refers to arrays in an HDF5 file beside it. Each level is a grid
 * of polyhedra, the envelopes of its nodes. The mesh is a grid of triangles. VTK reads polyhedra
 * with its Xdmf3 readers, but not with the older XDMF reader. Both files are published together. */
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "derive/export_job.h"
#include "io/file_source.h"
#include "io/publish.h"

enum { XDMF_POLYHEDRON = 16 }; /* XDMF's type of polyhedra in a mixed topology */

typedef struct writer {
    ebpo_h5_out out;
    FILE *text;
    const char *data_file; /* name by which the text refers to the HDF5 file */
} writer;

static void print_escaped(FILE *f, const char *s)
{
    for (; *s; s++) {
        if (*s == '&' || *s == '<' || *s == '>' || *s == '"')
            fprintf(f, "&#%d;", *s);
        else
            fputc(*s, f);
    }
}

/* Writes an array to the HDF5 file and a reference to the array to the text file. If `values` is
 * NULL, because the caller's allocation failed, returns EBPO_E_MEMORY. */
static ebpo_status put_array(writer *w, const ebpo_block *block, const char *name,
                             ebpo_h5_number number, uint32_t cols, const void *values,
                             uint64_t rows, ebpo_error *error)
{
    char path[64];
    snprintf(path, sizeof path, "/%s/%s", block->name, name);
    ebpo_status status = values
                             ? ebpo_h5_put_table(&w->out, path, number, cols, values, rows, error)
                             : ebpo_fail_memory(error, rows * 8);
    const char *kind = number == EBPO_H5_U8                             ? "UChar"
                       : number == EBPO_H5_F32 || number == EBPO_H5_F64 ? "Float"
                                                                        : "Int";
    fprintf(w->text,
            "<DataItem Format=\"HDF\" NumberType=\"%s\" Precision=\"%zu\" Dimensions=\"%" PRIu64,
            kind, ebpo_h5_number_bytes(number), rows);
    if (cols)
        fprintf(w->text, " %" PRIu32, cols);
    fprintf(w->text, "\">");
    print_escaped(w->text, w->data_file);
    fprintf(w->text, ":%s</DataItem>\n", path);
    return status;
}

/* Writes an attribute with one value for each node or cell (`centre`). Frees `values`. */
static ebpo_status put_attribute(writer *w, const ebpo_block *block, const char *name,
                                 const char *centre, ebpo_h5_number number, void *values,
                                 uint64_t rows, ebpo_error *error)
{
    fprintf(w->text,
            "        <Attribute Name=\"%s\" AttributeType=\"Scalar\" Center=\"%s\">\n          ",
            name, centre);
    ebpo_status status = put_array(w, block, name, number, 0, values, rows, error);
    fprintf(w->text, "        </Attribute>\n");
    free(values);
    return status;
}

/* Writes the envelopes of a level as polyhedra. A polyhedron is stored as its XDMF type, the number
 * of its polygons, and then, for each polygon, the number of its corners and the corners. */
static ebpo_status put_polyhedra(writer *w, const ebpo_block *block, ebpo_error *error)
{
    const ebpo_lod_nodes *nodes = &block->nodes;
    uint64_t size = 2 * nodes->node_count + 3 * nodes->polygon_count + block->mesh.face_count,
             at = 0, polygon = 0;
    int64_t *cells = ebpo_alloc(size, sizeof *cells);
    const uint32_t *triangle = block->mesh.faces;
    for (uint64_t i = 0; cells && i < nodes->node_count; i++) {
        cells[at++] = XDMF_POLYHEDRON;
        cells[at++] = nodes->nodes[i].polygon_count;
        for (uint32_t f = 0; f < nodes->nodes[i].polygon_count; f++) {
            unsigned n = nodes->corners[polygon++];
            cells[at++] = n;
            for (unsigned k = 0; k < n; k++)
                cells[at++] = ebpo_polygon_corner(triangle, k);
            triangle += 3 * (n - 2);
        }
    }
    fprintf(w->text,
            "        <Topology TopologyType=\"Mixed\" NumberOfElements=\"%" PRIu64
            "\">\n          ",
            nodes->node_count);
    ebpo_status status = put_array(w, block, "cells", EBPO_H5_I64, 0, cells, size, error);
    free(cells);
    return status;
}

static ebpo_status put_triangles(writer *w, const ebpo_block *block, ebpo_error *error)
{
    const ebpo_mesh *mesh = &block->mesh;
    uint64_t count = mesh->face_count;
    int64_t *cells = ebpo_alloc(count, 3 * sizeof *cells);
    for (uint64_t i = 0; cells && i < 3 * count; i++)
        cells[i] = mesh->faces[i];
    fprintf(w->text,
            "        <Topology TopologyType=\"Triangle\" NumberOfElements=\"%" PRIu64
            "\">\n          ",
            count);
    ebpo_status status = put_array(w, block, "cells", EBPO_H5_I64, 3, cells, count, error);
    free(cells);
    return status;
}

static ebpo_status put_colours(writer *w, const ebpo_block *block, const char *name,
                               const char *centre, const uint8_t *rgba, uint64_t rows,
                               ebpo_error *error)
{
    if (!rgba)
        return EBPO_OK;
    fprintf(w->text,
            "        <Attribute Name=\"rgba\" AttributeType=\"Matrix\" Center=\"%s\">\n"
            "          ",
            centre);
    ebpo_status status = put_array(w, block, name, EBPO_H5_U8, 4, rgba, rows, error);
    fprintf(w->text, "        </Attribute>\n");
    return status;
}

/* Writes the colours of the block's vertices, and of its faces, if the block has such colours. */
static ebpo_status put_colours_of(writer *w, const ebpo_block *block, ebpo_error *error)
{
    const ebpo_colours *c = &block->colours;
    ebpo_status status = put_colours(w, block, "rgba_of_vertices", "Node", c->vertex,
                                     block->mesh.vertex_count, error);
    return status == EBPO_OK ? put_colours(w, block, "rgba_of_faces", "Cell", c->face,
                                           block->mesh.face_count, error)
                             : status;
}

/* Writes the values of a level's nodes, or the source indices of the mesh. */
static ebpo_status put_data(writer *w, const ebpo_block *block, ebpo_error *error)
{
    bool mesh = block->level < 0;
    uint64_t rows = mesh ? block->mesh.face_count : block->nodes.node_count;
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < EBPO_COLUMNS_OF_NODES && !mesh && status == EBPO_OK; i++)
        status = put_attribute(w, block, ebpo_columns[i].name, "Cell", ebpo_columns[i].number,
                               ebpo_column_make(block, i, false), rows, error);
    if (!mesh || !block->maps.face_source)
        return status;
    const ebpo_column *c = &ebpo_columns[EBPO_COLUMN_SOURCE_FACE];
    status = put_attribute(w, block, c->name, "Cell", c->number,
                           ebpo_column_make(block, EBPO_COLUMN_SOURCE_FACE, false), rows, error);
    if (status == EBPO_OK)
        status = put_attribute(w, block, "source_vertex", "Node", EBPO_H5_I64,
                               ebpo_column_of_vertices(block), block->mesh.vertex_count, error);
    return status;
}

static ebpo_status put_block(writer *w, const ebpo_block *block, ebpo_error *error)
{
    const ebpo_mesh *mesh = &block->mesh;
    char path[32];
    ebpo_h5_id group;
    snprintf(path, sizeof path, "/%s", block->name);
    ebpo_status status = ebpo_h5_make_plain_group(&w->out, path, &group, error);
    ebpo_h5_close_id(&w->out, group);
    if (status != EBPO_OK)
        return status;
    fprintf(w->text, "      <Grid Name=\"%s\" GridType=\"Uniform\">\n", block->name);
    status = block->level < 0 ? put_triangles(w, block, error) : put_polyhedra(w, block, error);
    fprintf(w->text, "        </Topology>\n        <Geometry GeometryType=\"XYZ\">\n          ");
    if (status == EBPO_OK)
        status = put_array(w, block, "points", mesh->xyz32 ? EBPO_H5_F32 : EBPO_H5_F64, 3,
                           mesh->xyz32 ? (const void *)mesh->xyz32 : mesh->xyz64,
                           mesh->vertex_count, error);
    fprintf(w->text, "        </Geometry>\n");
    if (status == EBPO_OK)
        status = put_data(w, block, error);
    if (status == EBPO_OK)
        status = put_colours_of(w, block, error);
    fprintf(w->text, "      </Grid>\n");
    return status;
}

static ebpo_status write_blocks(writer *w, const ebpo_export_job *job, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    fprintf(w->text,
            "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<Xdmf Version=\"3.0\">\n  <Domain>\n"
            "    <Grid Name=\"ebpo\" GridType=\"Collection\" CollectionType=\"Spatial\">\n");
    for (int i = 0; i < ebpo_block_count(job->options) && status == EBPO_OK; i++) {
        ebpo_block block;
        status = ebpo_export_read_block(job, i, EBPO_FILE_ORDER, &block, error);
        if (status == EBPO_OK &&
            (block.level < 0 || block.nodes.node_count)) /* VTK stops at a grid without cells */
            status = put_block(w, &block, error);
        ebpo_block_free(&block);
    }
    fprintf(w->text, "    </Grid>\n  </Domain>\n</Xdmf>\n");
    return status;
}

ebpo_status ebpo_export_xdmf(const ebpo_export_job *job, ebpo_error *error)
{
    writer w = { EBPO_H5_OUT_INIT, NULL, ebpo_path_name(job->second) };
    ebpo_publish text_file = EBPO_PUBLISH_INIT, data_file = EBPO_PUBLISH_INIT;
    ebpo_status status = ebpo_publish_begin(&text_file, job->path, error);
    if (status == EBPO_OK)
        status = ebpo_publish_begin(&data_file, job->second, error);
    if (status == EBPO_OK && !(w.text = ebpo_publish_stream(&text_file)))
        status = ebpo_fail_memory(error, BUFSIZ);
    if (status == EBPO_OK)
        status = ebpo_h5_create_plain(&w.out, ebpo_publish_path(&data_file), job->second, error);
    if (status == EBPO_OK)
        status = write_blocks(&w, job, error);
    if (status == EBPO_OK && ferror(w.text))
        status = ebpo_fail_errno(error, job->path, "could not be written");
    if (status == EBPO_OK)
        status = ebpo_h5_finish(&w.out, error);
    ebpo_h5_discard(&w.out);
    if (status == EBPO_OK)
        status = ebpo_publish_commit_pair(&data_file, &text_file, error);
    ebpo_publish_abort(&data_file);
    ebpo_publish_abort(&text_file);
    return status;
}
