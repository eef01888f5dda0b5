/* Reads a PLY file: the header, the body by elements, and notes about omitted data. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "io/file_source.h"
#include "mesh/import_build.h"
#include "mesh/ply.h"
#include "mesh/ply_parts.h"

/* maximum number of vertices, and of faces */
#define COUNT_MAX (UINT64_C(0xfffffffe))

bool ebpo_ply_recognise(const uint8_t *data, uint64_t size)
{
    char line_end;
    return ebpo_ply_first_line(data, size, &line_end) != NULL;
}

/* Computes the minimum number of bytes that the rows of an element take in the file. Returns false
 * if the number does not fit into 64 bits. */
static bool least_bytes(const ebpo_ply_parser *p, const ebpo_ply_element *element, uint64_t *bytes)
{
    uint64_t row = element->row_bytes;
    if (p->header.encoding == EBPO_PLY_ASCII &&
        !ebpo_mul_ok(element->properties, 2, &row)) /* a digit and a blank for each value */
        return false;
    return ebpo_mul_ok(element->count, row, bytes);
}

/* Checks, before anything is allocated, that the file can hold the rows that its header declares.
 */
static ebpo_status check_file_size(ebpo_ply_parser *p)
{
    uint64_t available = p->size - p->header.body;
    /* the blank after the last value may be missing */
    available += p->header.encoding == EBPO_PLY_ASCII;
    for (uint64_t i = 0; i < p->header.elements; i++) {
        const ebpo_ply_element *e = &p->header.element[i];
        uint64_t need;
        if (least_bytes(p, e, &need) && need <= available) {
            available -= need;
            continue;
        }
        char name[EBPO_IMPORT_WORD_TEXT];
        ebpo_import_word_text(name, e->name.s, e->name.n);
        if (p->header.encoding == EBPO_PLY_ASCII || e->has_list)
            return ebpo_fail_file(
                p->error, EBPO_E_FORMAT, p->name,
                "line %" PRIu64 ": %" PRIu64
                " rows of element '%s' do not fit into the rest of the file, %" PRIu64
                " bytes; it is cut short or damaged, get it again",
                e->line, e->count, name, available);
        p->at = p->size;
        return ebpo_ply_fail_end(p, e, available / e->row_bytes);
    }
    return EBPO_OK;
}

/* Checks that the mesh has faces, and not too many vertices or faces. */
static ebpo_status check_counts(const ebpo_ply_parser *p)
{
    const ebpo_ply_header *h = &p->header;
    uint64_t vertices = h->element[h->vertex].count,
             faces = h->face >= 0 ? h->element[h->face].count : 0;
    if (vertices > COUNT_MAX || faces > COUNT_MAX)
        return ebpo_fail_file(p->error, EBPO_E_LIMIT, p->name,
                              "%" PRIu64 " vertices and %" PRIu64
                              " faces, but the limit is 2^32 - 2 of each; split the model",
                              vertices, faces);
    bool has_faces = faces || (h->strips >= 0 && h->element[h->strips].count);
    if (!has_faces && !vertices)
        return ebpo_fail_file(p->error, EBPO_E_FORMAT, p->name,
                              "the mesh is empty, with neither vertices nor faces");
    if (!has_faces)
        return ebpo_fail_file(p->error, EBPO_E_FORMAT, p->name,
                              "has %" PRIu64
                              " vertices but no faces (a point cloud); reconstruct a surface "
                              "first",
                              vertices);
    return EBPO_OK;
}

/* Returns true if the mesh stores coordinates as floats. This is so if the file declares all three
 * coordinates as floats. Coordinates of other types are stored as doubles, which represent them
 * exactly. Query points (p->strict) are always stored as doubles. */
static bool all_float(const ebpo_ply_parser *p)
{
    const ebpo_ply_header *h = &p->header;
    const ebpo_ply_element *vertex = &h->element[h->vertex];
    for (uint64_t i = 0; i < vertex->properties; i++) {
        const ebpo_ply_property *property = &h->property[vertex->first + i];
        if (property->role != EBPO_PLY_ROLE_NONE && property->type != EBPO_PLY_FLOAT32)
            return false;
    }
    return !p->strict;
}

static ebpo_status allocate_vertices(ebpo_ply_parser *p)
{
    const ebpo_ply_header *h = &p->header;
    ebpo_mesh *mesh = p->mesh;
    mesh->vertex_count = h->element[h->vertex].count;
    size_t width = all_float(p) ? sizeof(float) : sizeof(double);
    void *coordinates = ebpo_array_alloc(mesh->workspace, mesh->vertex_count, 3 * width);
    if (width == sizeof(float))
        mesh->xyz32 = coordinates;
    else
        mesh->xyz64 = coordinates;
    if (!coordinates)
        return ebpo_workspace_fail(mesh->workspace, mesh->vertex_count * 3 * width, p->error);
    if (h->encoding == EBPO_PLY_ASCII && !(p->c_locale = newlocale(LC_ALL_MASK, "C", (locale_t)0)))
        return ebpo_fail_memory(p->error, 0);
    return EBPO_OK;
}

static ebpo_status allocate_arrays(ebpo_ply_parser *p)
{
    const ebpo_ply_header *h = &p->header;
    p->face_capacity = h->face >= 0 ? h->element[h->face].count : 0;
    p->mesh->faces =
        ebpo_array_alloc(p->mesh->workspace, p->face_capacity, 3 * sizeof *p->mesh->faces);
    if (!p->mesh->faces)
        return ebpo_workspace_fail(p->mesh->workspace,
                                   p->face_capacity * 3 * sizeof *p->mesh->faces, p->error);
    return allocate_vertices(p);
}

static ebpo_status read_element(ebpo_ply_parser *p, const ebpo_ply_element *element, bool store)
{
    return p->header.encoding == EBPO_PLY_ASCII ? ebpo_ply_ascii_element(p, element, store)
                                                : ebpo_ply_binary_element(p, element, store);
}

/* Reads the elements before the vertices, for example faces. read_body has skipped these elements,
 * because the triangulation of faces needs the positions of vertices. */
static ebpo_status read_early_faces(ebpo_ply_parser *p)
{
    uint64_t at = p->at, line = p->line;
    p->at = p->header.body;
    p->line = p->header.body_line;
    ebpo_status status = EBPO_OK;
    for (int64_t i = 0; i < p->header.vertex && status == EBPO_OK; i++)
        status = read_element(p, &p->header.element[i], true);
    p->at = at;
    p->line = line;
    p->next_report = 0;
    return status;
}

/* Reads all elements. Elements before the vertices are skipped first, and read after the vertices.
 */
static ebpo_status read_body(ebpo_ply_parser *p)
{
    ebpo_status status = EBPO_OK;
    p->at = p->header.body;
    p->line = p->header.body_line;
    for (int64_t i = 0; i < (int64_t)p->header.elements && status == EBPO_OK; i++) {
        status = read_element(p, &p->header.element[i], i >= p->header.vertex);
        if (status == EBPO_OK && i == p->header.vertex)
            status = read_early_faces(p);
    }
    if (status == EBPO_OK && p->mesh->face_count == 0)
        status = ebpo_fail_file(p->error, EBPO_E_FORMAT, p->name,
                                "no face has three corners; the file contains no mesh");
    return status;
}

/* Releases the unused capacity of the face array, which grows by half of its size at a time. */
static void trim_faces(ebpo_ply_parser *p)
{
    if (p->face_capacity == p->mesh->face_count || p->mesh->workspace)
        return;
    uint32_t *faces = ebpo_realloc(p->mesh->faces, p->mesh->face_count, 3 * sizeof *faces);
    if (faces)
        p->mesh->faces = faces;
}

static void describe_source(ebpo_ply_parser *p)
{
    static const char *const formats[] = { "ply-ascii", "ply-le", "ply-be" };
    snprintf(p->mesh->source_name, sizeof p->mesh->source_name, "%s", p->name);
    snprintf(p->mesh->source_format, sizeof p->mesh->source_format, "%s",
             formats[p->header.encoding]);
    p->mesh->source_size = p->size;
}

/* Records in mesh->attributes which data of the file was not read or was rounded. */
static ebpo_status record_unread(ebpo_ply_parser *p)
{
    bool more = p->header.encoding == EBPO_PLY_ASCII && ebpo_ply_ascii_more(p);
    ebpo_status status = p->surplus_values || more || p->max_rounded > 0
                             ? ebpo_mesh_need_attributes(p->mesh, p->error)
                             : EBPO_OK;
    if (status != EBPO_OK)
        return status;
    if (more)
        ebpo_attributes_note_unread(p->mesh->attributes,
                                    "text after the last element, from line %" PRIu64 " on",
                                    p->line);
    if (p->surplus_values)
        ebpo_attributes_note_unread(p->mesh->attributes,
                                    "values that the header does not describe: %" PRIu64
                                    ", at the ends of %" PRIu64 " rows",
                                    p->surplus_values, p->surplus_rows);
    if (p->max_rounded > 0)
        ebpo_attributes_note_unread(p->mesh->attributes,
                                    "digits of coordinates that the header declares as float: "
                                    "rounded by up to %.3g; declare them as double",
                                    p->max_rounded);
    return EBPO_OK;
}

/* Frees everything except the mesh. */
static void free_parser(ebpo_ply_parser *p)
{
    if (p->c_locale)
        freelocale(p->c_locale);
    free(p->corners);
    free(p->scratch);
    free(p->lost);
    ebpo_ply_header_free(&p->header);
}

ebpo_status ebpo_ply_parse_all(ebpo_mesh *out, const uint8_t *data, uint64_t size, const char *name,
                               ebpo_workspace *workspace, bool attributes, unsigned threads,
                               const ebpo_progress *progress, ebpo_error *error)
{
    ebpo_mesh mesh = { .workspace = workspace };
    ebpo_ply_parser p = { .data = data,
                          .size = size,
                          .name = ebpo_path_name(name),
                          .mesh = &mesh,
                          .threads = threads,
                          .progress = progress,
                          .error = error };
    ebpo_status status = ebpo_ply_header_parse(&p.header, data, size, p.name, error);
    if (status == EBPO_OK)
        status = check_file_size(&p);
    if (status == EBPO_OK)
        status = check_counts(&p);
    if (status == EBPO_OK)
        status = allocate_arrays(&p);
    if (status == EBPO_OK && attributes)
        status = ebpo_ply_attributes_plan(&p);
    if (status == EBPO_OK)
        status = read_body(&p);
    if (status == EBPO_OK)
        status = ebpo_ply_attributes_end(&p);
    if (status == EBPO_OK)
        status = record_unread(&p);
    if (status == EBPO_OK)
        status = ebpo_ply_remove_unused(&p);
    if (status == EBPO_OK) {
        trim_faces(&p);
        describe_source(&p);
    } else {
        ebpo_array_free(workspace, mesh.xyz32);
        ebpo_array_free(workspace, mesh.xyz64);
        ebpo_array_free(workspace, mesh.faces);
        ebpo_attributes_free(mesh.attributes);
        mesh = (ebpo_mesh){ 0 };
    }
    free_parser(&p);
    *out = mesh;
    return status;
}

static ebpo_status read_ply(ebpo_mesh *out, const ebpo_import_job *job, ebpo_error *error)
{
    return ebpo_ply_parse_all(out, job->data, job->size, job->name, job->workspace, job->attributes,
                              job->threads, job->progress, error);
}

const ebpo_import_format ebpo_import_ply = { .called = "a PLY",
                                             .ending = ".ply",
                                             .recognise = ebpo_ply_recognise,
                                             .beginning_decides = true,
                                             .read = EBPO_IMPORT_READER(read_ply) };

ebpo_status ebpo_points_parse_ply(const void *data, uint64_t size, const char *name, double **xyz,
                                  uint64_t *count, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_mesh mesh = { 0 };
    ebpo_ply_parser p = {
        .data = data, .size = size, .name = ebpo_path_name(name), .mesh = &mesh, .error = error
    };
    p.strict = true; /* query points have no record of omitted values, so such values are errors */
    *xyz = NULL;
    *count = 0;
    ebpo_status status = ebpo_ply_header_parse(&p.header, p.data, size, p.name, error);
    if (status == EBPO_OK)
        status = check_file_size(&p);
    if (status == EBPO_OK)
        status = allocate_vertices(&p);
    p.at = p.header.body;
    p.line = p.header.body_line;
    /* data after the vertices is not read */
    for (int64_t i = 0; status == EBPO_OK && i <= p.header.vertex; i++)
        status = read_element(&p, &p.header.element[i], i == p.header.vertex);
    if (status == EBPO_OK) {
        *xyz = mesh.xyz64;
        *count = mesh.vertex_count;
    } else {
        free(mesh.xyz64);
    }
    free_parser(&p);
    return status;
}
