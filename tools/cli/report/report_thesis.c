/* Computes the cost of sending each level of a tree in the cost model of the theses (BP 2008,
 * section 4.2). The tree is sent uncompressed, level after level from the root. A leaf is sent with
 * its faces and their vertices. The costs are:
 * - leaf: 1 byte for its corners
 * - plane: 4 bytes for its offset, and 16 bytes for a new normal or 4 bytes for a known normal
 * - face: 12 bytes for a new face, 4 bytes for a known face
 * - vertex of a leaf: 12 bytes for a new vertex, 4 bytes for a known vertex
 * A normal, face or vertex is new if it was not sent before. */
#include <stdlib.h>
#include <string.h>

#include "cli/reading.h"
#include "cli/report/report_data.h"

enum { NORMAL_SPAN = 1023 }; /* number of values of a component of a normal: -511 to 511 */

typedef struct cost_state {
    ebpo_mesh mesh;
    uint8_t *normals, *faces, *vertices; /* bit arrays; bit i: item i has occurred */
    /* [vertex_count] number of the last leaf with the vertex, from 1; 0: none */
    uint64_t *leaf_of;
    uint64_t leaves; /* number of leaves so far */
} cost_state;

/* Sets bit i. Returns true if it was not set before. */
static bool mark_first(uint8_t *bits, uint64_t i)
{
    bool before = bits[i >> 3] >> (i & 7) & 1;
    bits[i >> 3] |= (uint8_t)(1u << (i & 7));
    return !before;
}

/* Returns the cost of the planes of a cell in bytes. All cells have the same proportions, so equal
 * decoded normals are equal directions at every level. */
static double plane_bytes(cost_state *s, const uint32_t *codes, uint64_t count)
{
    double sum = 0;
    for (uint64_t i = 0; i < count; i++) {
        int32_t n[3], d;
        if (!ebpo_plane_decode(codes[i], n, &d))
            continue;
        uint64_t key =
            ((uint64_t)(n[0] + 511) * NORMAL_SPAN + (uint64_t)(n[1] + 511)) * 2 + (n[2] < 0);
        sum += 4 + (mark_first(s->normals, key) ? 16 : 4);
    }
    return sum;
}

static double face_bytes(cost_state *s, uint64_t face)
{
    double sum = mark_first(s->faces, face) ? 12 : 4;
    for (int k = 0; k < 3; k++) {
        uint32_t v = s->mesh.faces[3 * face + (unsigned)k];
        if (s->leaf_of[v] == s->leaves)
            continue; /* the vertex was counted for another face of this leaf */
        s->leaf_of[v] = s->leaves;
        sum += mark_first(s->vertices, v) ? 12 : 4;
    }
    return sum;
}

static double leaf_bytes(cost_state *s, const ebpo_level *l)
{
    double sum = (double)l->leaf_count;
    uint64_t ref = 0;
    for (uint64_t i = 0; i < l->leaf_count; i++) {
        s->leaves++;
        for (uint32_t k = 0; k < l->leaf_new[i]; k++)
            sum += face_bytes(s, l->leaf_first[i] + k);
        for (uint32_t k = 0; k < l->leaf_ref_count[i]; k++)
            sum += face_bytes(s, l->leaf_refs[ref++]);
    }
    return sum;
}

/* Makes the arrays of the counting. Returns false when out of memory. */
static bool begin_counting(cost_state *s)
{
    s->normals = calloc((size_t)NORMAL_SPAN * NORMAL_SPAN * 2 / 8 + 1, 1);
    s->faces = calloc(s->mesh.face_count / 8 + 1, 1);
    s->vertices = calloc(s->mesh.vertex_count / 8 + 1, 1);
    s->leaf_of = calloc(s->mesh.vertex_count + 1, sizeof *s->leaf_of);
    return s->normals && s->faces && s->vertices && s->leaf_of;
}

static ebpo_status sum_costs(comparison *c, method *m, ebpo_file *file, cost_state *s,
                             ebpo_error *error)
{
    double sum = 0;
    for (int i = 0; i <= method_last(c, m); i++) {
        ebpo_level l;
        ebpo_read_options read = reading_options(c->v->threads, NULL);
        ebpo_status status = ebpo_file_read_level(file, i, &read, &l, error);
        if (status != EBPO_OK)
            return status;
        double cost = plane_bytes(s, l.planes, l.plane_count) +
                      plane_bytes(s, l.leaf_planes, l.leaf_plane_count) + leaf_bytes(s, &l);
        ebpo_level_free(&l);
        sum += cost;
        if (i < c->first)
            continue;
        m->level[i][METRIC_THESIS_BYTES] = cost;
        m->level[i][METRIC_THESIS_CUMULATIVE] = sum;
    }
    return EBPO_OK;
}

ebpo_status report_thesis(comparison *c, method *m, ebpo_file *file, ebpo_error *error)
{
    cost_state s = { .leaves = 0 };
    if (m->info.pruned) {
        method_note(m, "theses' cost model", "applies to a whole tree; this file is a subset");
        return EBPO_OK;
    }
    ebpo_read_options read = reading_options(c->v->threads, NULL);
    ebpo_status status = ebpo_file_read_mesh(file, &read, &s.mesh, error);
    if (status == EBPO_OK && !begin_counting(&s)) {
        snprintf(error->message, sizeof error->message,
                 "not enough memory for bits of all faces and vertices");
        status = error->status = EBPO_E_MEMORY;
    }
    if (status == EBPO_OK)
        status = sum_costs(c, m, file, &s, error);
    free(s.normals);
    free(s.faces);
    free(s.vertices);
    free(s.leaf_of);
    ebpo_mesh_free(&s.mesh);
    return method_note_missing(m, "theses' cost model", status, error);
}
