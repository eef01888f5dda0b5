/* Reads faces of the model, which a viewer draws instead of patches. A patch of the simplified
 * surface approximates the faces below a node (format/surface_patches.h).
 *
 * All faces at a vertex of the model share one vertex of the result. Its normal is the mean of the
 * normals of these faces, weighted by area. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/hash.h"
#include "format/face_colours.h"
#include "format/pick_rows.h"
#include "geometry/vec3.h"
#include "levels/surface_mesh.h"

#define NONE UINT32_MAX

typedef struct faces_reader {
    ebpo_chunks *chunks;
    ebpo_patch *out;  /* the faces as a patch */
    uint64_t count;   /* number of faces */
    uint32_t *face;   /* [count] indices of the faces in the file */
    uint32_t *corner; /* [count][3] indices in the file of the faces' vertices */
    uint32_t *vertex; /* [out->vertex_count] index in the file of each shared vertex */
    /* [out->vertex_count] sum of the area vectors of the faces at a vertex: normals whose length is
     * twice the face's area */
    double (*sum)[3];
    uint8_t *colour; /* [count][3][3] red, green, blue of each corner; NULL: no colours */
} faces_reader;

/* Makes the shared vertices, in the order of their first use by a face, and sets the triangles.
 * Returns false when out of memory. */
static bool number_vertices(faces_reader *r)
{
    uint64_t slots = ebpo_hash_slots(6 * r->count), at;
    uint32_t *slot = ebpo_alloc(slots, sizeof *slot);
    if (!slot)
        return false;
    memset(slot, 0xff, slots * sizeof *slot);
    for (uint64_t i = 0; i < 3 * r->count; i++) {
        uint32_t v = r->corner[i];
        EBPO_HASH_FIND(at, ebpo_hash_number(v), slots - 1,
                       slot[at] == NONE || r->vertex[slot[at]] == v);
        if (slot[at] == NONE) {
            slot[at] = (uint32_t)r->out->vertex_count;
            r->vertex[r->out->vertex_count++] = v;
        }
        r->out->triangles[i] = slot[at];
    }
    free(slot);
    return true;
}

static ebpo_status read_positions(faces_reader *r, ebpo_error *error)
{
    uint64_t coordinates = 3 * r->out->vertex_count;
    if (r->chunks->file->info.double_coordinates)
        return ebpo_pick_rows(r->chunks, EBPO_A_VERTICES, r->vertex, r->out->vertex_count, 1,
                              r->out->xyz, error);
    float *single = ebpo_alloc(coordinates, sizeof *single);
    ebpo_status status = single ? ebpo_pick_rows(r->chunks, EBPO_A_VERTICES, r->vertex,
                                                 r->out->vertex_count, 1, single, error)
                                : ebpo_fail_memory(error, coordinates * sizeof *single);
    for (uint64_t i = 0; i < coordinates && status == EBPO_OK; i++)
        r->out->xyz[i] = (double)single[i];
    free(single);
    return status;
}

/* Adds the area vectors of the faces at the vertices. The unit of length
 * is a power of two near the size of the model, so that products neither overflow nor underflow. */
static void add_normals(faces_reader *r)
{
    int exponent;
    (void)frexp(ebpo_patch_error_step(&r->chunks->file->info), &exponent);
    exponent += 32; /* the longest side of the root cell is 2^32 steps */
    for (uint64_t f = 0; f < r->count; f++) {
        const uint32_t *t = r->out->triangles + 3 * f;
        const double *p[3];
        double u[3], v[3], n[3];
        for (int k = 0; k < 3; k++)
            p[k] = r->out->xyz + 3 * (uint64_t)t[k];
        for (int k = 0; k < 3; k++) {
            u[k] = ldexp(p[1][k] - p[0][k], -exponent);
            v[k] = ldexp(p[2][k] - p[0][k], -exponent);
        }
        ebpo_vec3_cross(u, v, n);
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++)
                r->sum[t[i]][k] += n[k];
    }
}

/* Scales a normal to length 1. A normal of length 0 becomes (0, 0, 1). */
static void set_unit(const double n[3], float out[3])
{
    double largest = fmax(fabs(n[0]), fmax(fabs(n[1]), fabs(n[2])));
    double scaled[3] = { 0, 0, 1 };
    for (int k = 0; k < 3 && largest > 0; k++)
        scaled[k] = n[k] / largest;
    double length = sqrt(ebpo_vec3_dot(scaled, scaled));
    for (int k = 0; k < 3; k++)
        out[k] = (float)(scaled[k] / length);
}

/* Sets the normals and colours of vertices. */
static void set_vertices(faces_reader *r)
{
    ebpo_patch *out = r->out;
    for (uint64_t v = 0; v < out->vertex_count; v++)
        set_unit(r->sum[v], out->normals + 3 * v);
    for (uint64_t i = 0; i < 3 * r->count && r->colour; i++)
        memcpy(out->colours + 3 * (uint64_t)out->triangles[i], r->colour + 3 * i, 3);
}

static ebpo_status read_colours(faces_reader *r, ebpo_error *error)
{
    ebpo_face_colours colours;
    if (!r->chunks->file->info.surface_colours)
        return EBPO_OK;
    ebpo_status status = ebpo_face_colours_find(r->chunks->file, &colours, error);
    if (status == EBPO_OK && colours.element) {
        r->colour = ebpo_alloc(r->count, 9);
        r->out->colours = ebpo_alloc(3 * r->count, 3);
        status = r->colour && r->out->colours
                     ? ebpo_face_colours_read(&colours, r->chunks, r->face, r->corner, r->count,
                                              r->colour, error)
                     : ebpo_fail_memory(error, 18 * r->count);
    }
    ebpo_face_colours_free(&colours);
    return status;
}

static ebpo_status read_faces(faces_reader *r, ebpo_error *error)
{
    ebpo_patch *out = r->out;
    ebpo_status status =
        ebpo_pick_rows(r->chunks, EBPO_A_FACES, r->face, r->count, 1, r->corner, error);
    if (status == EBPO_OK && !number_vertices(r))
        status = ebpo_fail_memory(error, 6 * r->count * sizeof(uint32_t));
    if (status == EBPO_OK)
        status = read_positions(r, error);
    if (status == EBPO_OK)
        status = read_colours(r, error);
    if (status != EBPO_OK)
        return status;
    add_normals(r);
    set_vertices(r);
    out->triangle_count = r->count;
    return EBPO_OK;
}

ebpo_status ebpo_patch_faces_read(const ebpo_patch_table *table, ebpo_chunks *chunks,
                                  const uint64_t *patches, uint64_t count, ebpo_patch *out,
                                  ebpo_error *error)
{
    faces_reader r = { .chunks = chunks, .out = out };
    uint64_t at = 0;
    *out = (ebpo_patch)EBPO_PATCH_INIT;
    if (!(chunks->file->info.parts & EBPO_PART_MESH))
        return ebpo_fail_file(error, EBPO_E_ABSENT, chunks->file->in.shown,
                              "faces are requested, and the file was written without its mesh");
    for (uint64_t i = 0; i < count; i++)
        r.count += table->row[EBPO_PATCH_COLUMNS * patches[i] + EBPO_PATCH_FACES];
    if (r.count >= NONE / 3)
        return ebpo_fail(error, EBPO_E_LIMIT, "the patches replace more than 2^32 / 3 faces");
    r.face = ebpo_alloc(r.count, sizeof *r.face);
    r.corner = ebpo_alloc(3 * r.count, sizeof *r.corner);
    r.vertex = ebpo_alloc(3 * r.count, sizeof *r.vertex);
    r.sum = ebpo_alloc_zero(3 * r.count, sizeof *r.sum);
    out->xyz = ebpo_alloc(3 * r.count, 3 * sizeof *out->xyz);
    out->normals = ebpo_alloc(3 * r.count, 3 * sizeof *out->normals);
    out->triangles = ebpo_alloc(3 * r.count, sizeof *out->triangles);
    ebpo_status status = EBPO_OK;
    if (!r.face || !r.corner || !r.vertex || !r.sum || !out->xyz || !out->normals ||
        !out->triangles)
        status = ebpo_fail_memory(error, 220 * r.count); /* about the sum of the sizes above */
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++) {
        const uint64_t *row = table->row + EBPO_PATCH_COLUMNS * patches[i];
        for (uint64_t k = 0; k < row[EBPO_PATCH_FACES]; k++)
            r.face[at++] = (uint32_t)(row[EBPO_PATCH_FIRST_FACE] + k);
    }
    if (status == EBPO_OK)
        status = read_faces(&r, error);
    free(r.face);
    free(r.corner);
    free(r.vertex);
    free(r.sum);
    free(r.colour);
    if (status != EBPO_OK)
        ebpo_patch_free(out);
    return status;
}
