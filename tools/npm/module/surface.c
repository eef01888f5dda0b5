/* Reads the simplified surface, and the caps of a surface with holes, for drawing, for the
 * WebAssembly module of viewers. The viewer chooses patches by the table, and gets one mesh in the
 * form in which it is drawn. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "levels/surface_mesh.h"
#include "module.h"

enum { PATCH_FACTS = 9 };

static ebpo_status read_table(ebpo_js_object *object)
{
    if (!object->patches)
        ebpo_js_hint_array(object, EBPO_A_SURFACE_PATCHES);
    ebpo_status status = ebpo_js_need_chunks(object);
    if (status == EBPO_OK && !object->patches &&
        !(object->patches = calloc(1, sizeof *object->patches)))
        status = object->error.status = EBPO_E_MEMORY;
    return status == EBPO_OK
               ? ebpo_patch_table_read(object->patches, object->chunks, &object->error)
               : status;
}

/* Array 0, double [PATCH_FACTS] for each patch: level, position of the cell (3 values), error in
 * the model's unit, number of triangles, number of faces, index of the first child patch, and end
 * of the child patches (one after the last index). */
int EBPO_JS(ebpo_js_patches)(ebpo_js_object *object)
{
    ebpo_js_clear(object);
    ebpo_status status = read_table(object);
    if (status != EBPO_OK)
        return status;
    const ebpo_patch_table *t = object->patches;
    double *out = ebpo_js_extend(object, 0, t->count, PATCH_FACTS * sizeof *out);
    if (!out)
        return EBPO_E_MEMORY;
    for (uint64_t i = 0; i < t->count; i++, out += PATCH_FACTS) {
        const uint64_t *row = t->row + EBPO_PATCH_COLUMNS * i;
        ebpo_cell cell = ebpo_cell_of_octcode(row[EBPO_PATCH_OCTCODE]);
        out[0] = cell.level;
        for (int k = 0; k < 3; k++)
            out[1 + k] = cell.at[k];
        out[4] = ebpo_patch_table_error(t, ebpo_file_info(object->file), i);
        out[5] = (double)row[EBPO_PATCH_TRIANGLES];
        out[6] = (double)row[EBPO_PATCH_FACES];
        out[7] = (double)t->child[i];
        out[8] = (double)t->child_end[i];
    }
    return EBPO_OK;
}

/* Result arrays of ebpo_js_surface and ebpo_js_caps. */
enum {
    /* double [2]: number of triangles, and number of those that are faces of the model */
    MESH_FACTS,
    MESH_POSITIONS, /* float [3] for each vertex: (coordinate - centre) * scale */
    MESH_NORMALS,   /* int16 [2] for each vertex: normal in octahedral coding */
    /* uint8 [4] for each vertex: red, green, blue, and 255 minus alpha (255: no colour) */
    MESH_COLOURS,
    MESH_TRIANGLES /* uint32 [3] for each triangle: indices of its vertices */
};

static void put_normal(const float n[3], int16_t out[2])
{
    double sum = fabs((double)n[0]) + fabs((double)n[1]) + fabs((double)n[2]);
    double u = sum > 0 ? (double)n[0] / sum : 0, v = sum > 0 ? (double)n[1] / sum : 0;
    if (n[2] < 0) {
        double folded = (1 - fabs(v)) * (u < 0 ? -1 : 1);
        v = (1 - fabs(u)) * (v < 0 ? -1 : 1);
        u = folded;
    }
    out[0] = (int16_t)lrint(u * 32767);
    out[1] = (int16_t)lrint(v * 32767);
}

static ebpo_status put_mesh(ebpo_js_object *object, const ebpo_surface_mesh *mesh,
                            const double *place)
{
    uint64_t count = mesh->mesh.vertex_count;
    double facts[2] = { (double)mesh->mesh.face_count, (double)mesh->faces };
    float(*position)[3] = ebpo_js_extend(object, MESH_POSITIONS, count, sizeof *position);
    int16_t(*normal)[2] = ebpo_js_extend(object, MESH_NORMALS, count, sizeof *normal);
    if (!position || !normal)
        return EBPO_E_MEMORY;
    for (uint64_t i = 0; i < count; i++) {
        for (uint64_t k = 0; k < 3; k++)
            position[i][k] = (float)((mesh->mesh.xyz64[3 * i + k] - place[k]) * place[3]);
        put_normal(mesh->normals + 3 * i, normal[i]);
    }
    for (uint64_t i = 0; mesh->colours.vertex && i < count; i++)
        mesh->colours.vertex[4 * i + 3] = (uint8_t)~mesh->colours.vertex[4 * i + 3];
    if (mesh->colours.vertex &&
        ebpo_js_put(object, MESH_COLOURS, mesh->colours.vertex, (size_t)count * 4) != EBPO_OK)
        return EBPO_E_MEMORY;
    ebpo_status status =
        ebpo_js_put(object, MESH_TRIANGLES, mesh->mesh.faces, (size_t)mesh->mesh.face_count * 12);
    return status == EBPO_OK ? ebpo_js_put(object, MESH_FACTS, facts, sizeof facts) : status;
}

/* Divides the `count` wanted patches into patches that are drawn, and patches that are replaced by
 * the model's faces. `wanted`: index and flag of each patch (ebpo_js_surface). Returns the number
 * of drawn patches. */
static uint64_t split_patches(const double *wanted, uint32_t count, uint64_t *drawn,
                              uint64_t *replaced)
{
    uint64_t d = 0, r = 0;
    for (uint32_t i = 0; i < count; i++)
        if (wanted[2 * i + 1] != 0)
            replaced[r++] = (uint64_t)wanted[2 * i];
        else
            drawn[d++] = (uint64_t)wanted[2 * i];
    return d;
}

static ebpo_status make_mesh(ebpo_js_object *object, const double *place, const uint64_t *drawn,
                             uint64_t count, const uint64_t *replaced, uint64_t replaced_count)
{
    ebpo_hints hints = EBPO_HINTS_INIT(object->file);
    ebpo_surface_mesh mesh = { 0 };
    ebpo_patch faces = EBPO_PATCH_INIT;
    for (uint64_t i = 0; i < count; i++)
        ebpo_patch_hint(object->patches, object->chunks, &hints, drawn[i]);
    ebpo_hint_all(&hints);
    ebpo_status status = EBPO_OK, of_faces = EBPO_OK;
    if (replaced_count)
        of_faces = ebpo_patch_faces_read(object->patches, object->chunks, replaced, replaced_count,
                                         &faces, &object->error);
    /* If the faces are pending, the patches are joined too: this collects the byte ranges that they
     * need for the same request. */
    if (of_faces == EBPO_OK || of_faces == EBPO_E_PENDING)
        status = ebpo_table_join(object->patches, object->chunks, drawn, count,
                                 replaced_count && of_faces == EBPO_OK ? &faces : NULL, &mesh,
                                 &object->error);
    if (of_faces != EBPO_OK)
        status = of_faces;
    if (status == EBPO_OK)
        status = put_mesh(object, &mesh, place);
    ebpo_surface_mesh_free(&mesh);
    ebpo_patch_free(&faces);
    return status;
}

/* Reads patches as one mesh without cracks. `place`: centre (3 values) and scale; then, for each of
 * `count` patches in ascending order, its index and a flag: 1 to draw the model's faces in place of
 * the patch, otherwise 0. */
int EBPO_JS(ebpo_js_surface)(ebpo_js_object *object, const double *place, uint32_t count)
{
    ebpo_js_clear(object);
    ebpo_status status = read_table(object);
    uint64_t *patches = malloc((2 * (size_t)count + 1) * sizeof *patches);
    if (status == EBPO_OK && !patches)
        status = object->error.status = EBPO_E_MEMORY;
    for (uint32_t i = 0; i < count && status == EBPO_OK; i++)
        if (!(place[4 + 2 * i] >= 0 && place[4 + 2 * i] < (double)object->patches->count))
            status = object->error.status = EBPO_E_ARGUMENT;
    if (status == EBPO_OK) {
        uint64_t drawn = split_patches(place + 4, count, patches, patches + count);
        status = make_mesh(object, place, patches, drawn, patches + count, count - drawn);
    }
    free(patches);
    return status;
}

/* Puts triangles with separate vertices, each with the normal of its triangle. */
static ebpo_status put_flat(ebpo_js_object *object, const ebpo_mesh *mesh, const double *place)
{
    uint64_t count = 3 * mesh->face_count;
    double facts[2] = { (double)mesh->face_count, 0 };
    float(*position)[3] = ebpo_js_extend(object, MESH_POSITIONS, count, sizeof *position);
    int16_t(*normal)[2] = ebpo_js_extend(object, MESH_NORMALS, count, sizeof *normal);
    uint32_t *index = ebpo_js_extend(object, MESH_TRIANGLES, count, sizeof *index);
    if (!position || !normal || !index)
        return EBPO_E_MEMORY;
    for (uint64_t i = 0; i < count; i++) {
        index[i] = (uint32_t)i;
        for (uint64_t k = 0; k < 3; k++) {
            uint64_t at = 3 * (uint64_t)mesh->faces[i] + k;
            double x = mesh->xyz64 ? mesh->xyz64[at] : (double)mesh->xyz32[at];
            position[i][k] = (float)((x - place[k]) * place[3]);
        }
    }
    for (uint64_t i = 0; i < count; i += 3) {
        float u[3], v[3], n[3];
        for (int k = 0; k < 3; k++) {
            u[k] = position[i + 1][k] - position[i][k];
            v[k] = position[i + 2][k] - position[i][k];
        }
        for (int k = 0; k < 3; k++)
            n[k] = u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3];
        for (int corner = 0; corner < 3; corner++)
            put_normal(n, normal[i + (uint64_t)corner]);
    }
    return ebpo_js_put(object, MESH_FACTS, facts, sizeof facts);
}

/* Reads the caps of the file's border. `place`: as above; `count` is not used. */
int EBPO_JS(ebpo_js_caps)(ebpo_js_object *object, const double *place, uint32_t count)
{
    ebpo_mesh mesh = { 0 };
    (void)count;
    ebpo_js_clear(object);
    ebpo_status status = ebpo_mesh_add_caps(&mesh, object->file, &object->error);
    if (status == EBPO_OK)
        status = put_flat(object, &mesh, place);
    ebpo_mesh_free(&mesh);
    return status;
}
