#include "core/strict_fp.h"

#include "mesh/places_ply.h"

#include <inttypes.h>
#include <string.h>

#include "core/workspace.h"
#include "core/endian.h"
#include "core/error.h"

enum { NOTHING = UINT8_MAX, VERTEX_BYTES = 3 * 8, FACE_BYTES = 1 + 3 * 4 + 3 };

ebpo_status ebpo_places_picture_begin(ebpo_places_picture *picture, const ebpo_mesh *mesh,
                                      const char *path, ebpo_error *error)
{
    picture->mesh = mesh;
    picture->face = ebpo_array_alloc(mesh->workspace, mesh->face_count, 1);
    if (!picture->face)
        return ebpo_workspace_fail(mesh->workspace, mesh->face_count, error);
    ebpo_array_fill(mesh->workspace, picture->face, NOTHING, mesh->face_count);
    return ebpo_publish_begin(&picture->target, path, error);
}

void ebpo_places_picture_note(ebpo_places_picture *picture, const ebpo_found *found,
                              const uint64_t *faces, uint64_t count)
{
    uint8_t kind = (uint8_t)found->kind;
    for (uint64_t i = 0; i < count; i++)
        if (kind < picture->face[faces[i]])
            picture->face[faces[i]] = kind;
}

/* How many places there are of each kind. */
static uint64_t count_of(const ebpo_mesh_report *r, int kind)
{
    const uint64_t counts[EBPO_FINDING_KINDS] = {
        [EBPO_FOUND_BOUNDARY_EDGE] = r->boundary_edges.count,
        [EBPO_FOUND_NONMANIFOLD_EDGE] = r->nonmanifold_edges.count,
        [EBPO_FOUND_MISORIENTED_EDGE] = r->misoriented_edges.count,
        [EBPO_FOUND_UNBALANCED_EDGE] = r->unbalanced_edges.count,
        [EBPO_FOUND_REPEATED_FACE] = r->repeated_faces.count,
        [EBPO_FOUND_INDEX_REPEATED_FACE] = r->index_repeated_faces.count,
        [EBPO_FOUND_ZERO_AREA_FACE] = r->zero_area_faces.count,
        [EBPO_FOUND_BOWTIE_VERTEX] = r->bowtie_vertices.count,
        [EBPO_FOUND_REPEATED_POSITION] = r->repeated_positions.count,
        [EBPO_FOUND_UNREFERENCED_VERTEX] = r->unreferenced_vertices.count,
    };
    return counts[kind];
}

static void print_header(const ebpo_places_picture *p, FILE *f, const ebpo_mesh_report *report)
{
    fputs("ply\nformat binary_little_endian 1.0\n", f);
    for (int kind = 0; kind < EBPO_FINDING_KINDS; kind++) {
        uint8_t rgb[3];
        ebpo_finding_colour(kind, rgb);
        if (count_of(report, kind))
            fprintf(f, "comment %s %" PRIu64 ": %u %u %u\n", ebpo_finding_name(kind),
                    count_of(report, kind), rgb[0], rgb[1], rgb[2]);
    }
    fprintf(f,
            "element vertex %" PRIu64 "\nproperty double x\nproperty double y\nproperty double z\n"
            "element face %" PRIu64 "\nproperty list uchar uint vertex_indices\n"
            "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n",
            p->mesh->vertex_count, p->mesh->face_count);
}

/* rgb   of a kind; NOTHING is none */
static void put_colour(uint8_t kind, uint8_t rgb[3])
{
    ebpo_finding_colour(kind == NOTHING ? -1 : kind, rgb);
}

/* Which of the mesh has each number of the source, ascending; numbers of dropped faces are left
 * out. NULL when memory is short. */
static uint32_t *in_source_order(const ebpo_mesh *mesh, const uint32_t *source, uint64_t count)
{
    uint64_t most = count;
    EBPO_FOR_ITEMS(mesh->workspace, i, 0, count)
        most = source[i] >= most ? source[i] + (uint64_t)1 : most;
    uint32_t *order = ebpo_array_alloc(mesh->workspace, most, sizeof *order);
    if (!order)
        return NULL;
    ebpo_array_fill(mesh->workspace, order, 0xff, most * sizeof *order);
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, 0, count)
        order[source[i]] = (uint32_t)i;
    uint64_t kept = 0;
    EBPO_FOR_ITEMS(mesh->workspace, i, 0, most)
        if (order[i] != EBPO_NO_INDEX)
            order[kept++] = order[i];
    return order;
}

static bool put_vertex(const ebpo_places_picture *p, FILE *f, uint64_t v)
{
    uint8_t row[VERTEX_BYTES];
    double x[3];
    ebpo_mesh_position(p->mesh, v, x);
    for (int k = 0; k < 3; k++) {
        uint64_t bits;
        memcpy(&bits, &x[k], sizeof bits);
        ebpo_store64(row + 8 * k, bits);
    }
    return fwrite(row, 1, sizeof row, f) == sizeof row;
}

/* rank   of each vertex among those that were written; NULL: their numbers */
static bool put_face(const ebpo_places_picture *p, FILE *f, uint64_t face, const uint32_t *rank)
{
    uint8_t row[FACE_BYTES] = { 3 };
    for (int k = 0; k < 3; k++) {
        uint32_t v = p->mesh->faces[3 * face + (unsigned)k];
        ebpo_store32(row + 1 + 4 * k, rank ? rank[v] : v);
    }
    put_colour(p->face[face], row + 13);
    return fwrite(row, 1, sizeof row, f) == sizeof row;
}

/* The order in which vertices and faces are written, and the vertices' ranks in it; NULL: as they
 * are. */
typedef struct written {
    uint32_t *vertices, *faces, *rank;
} written;

static ebpo_status order_all(const ebpo_mesh *mesh, written *w, ebpo_error *error)
{
    const struct ebpo_arrangement *a = mesh->arrangement;
    if (!a)
        return EBPO_OK;
    w->vertices = in_source_order(mesh, a->vertex_source, mesh->vertex_count);
    w->faces = in_source_order(mesh, a->face_source, mesh->face_count);
    w->rank = ebpo_array_alloc(mesh->workspace, mesh->vertex_count, sizeof *w->rank);
    if (!w->vertices || !w->faces || !w->rank)
        return ebpo_workspace_fail(mesh->workspace, mesh->face_count * sizeof *w->faces, error);
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, 0, mesh->vertex_count)
        w->rank[w->vertices[i]] = (uint32_t)i;
    return EBPO_OK;
}

static bool put_all(const ebpo_places_picture *p, FILE *f, const written *w)
{
    const ebpo_mesh *mesh = p->mesh;
    bool good = true;
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, 0, mesh->vertex_count)
        good = good && put_vertex(p, f, w->vertices ? w->vertices[i] : i);
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, 0, mesh->face_count)
        good = good && put_face(p, f, w->faces ? w->faces[i] : i, w->rank);
    return good;
}

ebpo_status ebpo_places_picture_write(ebpo_places_picture *picture, const ebpo_mesh_report *report,
                                      ebpo_error *error)
{
    const ebpo_mesh *mesh = picture->mesh;
    written w = { NULL, NULL, NULL };
    FILE *f = ebpo_publish_stream(&picture->target);
    ebpo_status status = f ? EBPO_OK : ebpo_fail_memory(error, BUFSIZ);
    if (status == EBPO_OK)
        status = order_all(mesh, &w, error);
    if (status == EBPO_OK) {
        print_header(picture, f, report);
        if (!put_all(picture, f, &w) || ferror(f))
            status = ebpo_fail_errno(error, picture->target.shown, "could not be written");
    }
    ebpo_array_free(mesh->workspace, w.vertices);
    ebpo_array_free(mesh->workspace, w.faces);
    ebpo_array_free(mesh->workspace, w.rank);
    return status == EBPO_OK ? ebpo_publish_commit(&picture->target, error) : status;
}

void ebpo_places_picture_end(ebpo_places_picture *picture)
{
    if (picture->mesh)
        ebpo_array_free(picture->mesh->workspace, picture->face);
    ebpo_publish_abort(&picture->target);
}
