/* Writes results for other programs: pairs of intersecting faces to an HDF5 file, and meshes to a
 * PLY file that shows the intersecting faces in red.
 *
 * The HDF5 file has a row for each pair. Rows are written in groups while pairs are found, so that
 * memory does not grow with the number of pairs. The writer of PLY files reads vertices and faces
 * in ascending order from a source: a mesh in memory or a partly loaded model. Output files appear
 * only when they are complete (io/publish.h). */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "extras/collide/pair_faces.h"
#include "extras/collide/red_mesh.h"
#include "hdf5_write/h5.h"
#include "io/publish.h"

/* Functions of an ebpo_red_source for a mesh in memory. These functions cannot fail. */
static ebpo_status mesh_vertex(void *user, uint64_t number, double out[3], ebpo_error *error)
{
    const ebpo_mesh *mesh = user;
    (void)error;
    for (unsigned k = 0; k < 3; k++)
        out[k] = mesh->xyz64 ? mesh->xyz64[3 * number + k] : (double)mesh->xyz32[3 * number + k];
    return EBPO_OK;
}

static ebpo_status mesh_face(void *user, uint64_t number, uint32_t out[3], ebpo_error *error)
{
    const ebpo_mesh *mesh = user;
    (void)error;
    memcpy(out, mesh->faces + 3 * number, 3 * sizeof *out);
    return EBPO_OK;
}

ebpo_red_source ebpo_red_source_of(const ebpo_mesh *mesh)
{
    return (ebpo_red_source){ mesh->vertex_count, mesh->face_count, (ebpo_mesh *)mesh, mesh_vertex,
                              mesh_face };
}

/* Prints the posed vertices of a mesh. */
static ebpo_status print_vertices(FILE *f, const ebpo_red_mesh *m, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t v = 0; v < m->source.vertices && status == EBPO_OK; v++) {
        double x[3], out[3];
        status = m->source.vertex(m->source.user, v, x, error);
        if (status != EBPO_OK)
            break;
        memcpy(out, x, sizeof out);
        if (m->posing)
            ebpo_posing_apply(m->posing, x, out);
        fprintf(f, "%.17g %.17g %.17g\n", out[0], out[1], out[2]);
    }
    return status;
}

/* Prints the faces of a mesh with their colours. first_vertex: index of the mesh's first vertex in
 * the PLY file. */
static ebpo_status print_faces(FILE *f, const ebpo_red_mesh *m, uint64_t first_vertex,
                               ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < m->source.faces && status == EBPO_OK; i++) {
        uint32_t v[3];
        bool red = m->red[i / 64] >> i % 64 & 1;
        status = m->source.face(m->source.user, i, v, error);
        if (status == EBPO_OK)
            fprintf(f, "3 %" PRIu64 " %" PRIu64 " %" PRIu64 " %s\n", first_vertex + v[0],
                    first_vertex + v[1], first_vertex + v[2], red ? "255 0 0" : m->colour);
    }
    return status;
}

ebpo_status ebpo_red_meshes_print(const ebpo_red_mesh *meshes, int count, ebpo_publish *target,
                                  ebpo_error *error)
{
    uint64_t vertices = 0, faces = 0;
    FILE *f = ebpo_publish_stream(target);
    if (!f)
        return ebpo_fail_memory(error, 4096);
    for (int i = 0; i < count; i++) {
        vertices += meshes[i].source.vertices;
        faces += meshes[i].source.faces;
    }
    if (vertices > UINT32_MAX)
        return ebpo_fail(error, EBPO_E_LIMIT, "more than 2^32 - 1 vertices in one PLY file");
    fprintf(f,
            "ply\nformat ascii 1.0\nelement vertex %" PRIu64 "\nproperty double x\n"
            "property double y\nproperty double z\nelement face %" PRIu64 "\n"
            "property list uchar uint vertex_indices\nproperty uchar red\nproperty uchar green\n"
            "property uchar blue\nend_header\n",
            vertices, faces);
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < count && status == EBPO_OK; i++)
        status = print_vertices(f, &meshes[i], error);
    vertices = 0;
    for (int i = 0; i < count && status == EBPO_OK; i++) {
        status = print_faces(f, &meshes[i], vertices, error);
        vertices += meshes[i].source.vertices;
    }
    if (status != EBPO_OK)
        return status;
    return ferror(f) ? ebpo_fail_file(error, EBPO_E_IO, target->shown, "cannot be written")
                     : EBPO_OK;
}

/* --- HDF5 --- */

/* The datasets of the file. The datasets before POINTS have a row for each pair, and the others
 * have a row for each contact. */
enum { PAIR_FACES, PAIR_FILE_FACES, PAIR_KIND, POINTS, CONTACT_FACES, CONTACT_ON, TABLES };

static const struct {
    const char *path;
    ebpo_h5_number number; /* type of the numbers */
    uint32_t cols;         /* number of columns; 0: the dataset has one dimension */
} layout[TABLES] = {
    [PAIR_FACES] = { "/pairs/faces", EBPO_H5_I64, 2 },
    [PAIR_FILE_FACES] = { "/pairs/file_faces", EBPO_H5_I64, 2 },
    [PAIR_KIND] = { "/pairs/kind", EBPO_H5_U8, 0 },
    [POINTS] = { "/contacts/points", EBPO_H5_F64, 6 },
    [CONTACT_FACES] = { "/contacts/faces", EBPO_H5_I64, 2 },
    [CONTACT_ON] = { "/contacts/on", EBPO_H5_U8, 4 },
};

/* Number of rows that are written at once. */
enum { ROWS = 512 };

/* An HDF5 file while it is written. */
typedef struct pairs_file {
    const ebpo_collision *collision;
    ebpo_pair_faces lookup; /* the look-up of faces by their indices */
    ebpo_h5_out out;
    ebpo_h5_table table[TABLES];
    /* rows that wait to be written to each dataset */
    int64_t faces[ROWS][2], file_faces[ROWS][2], contact_faces[ROWS][2];
    uint8_t kind[ROWS], on[ROWS][4];
    double points[ROWS][6];
    uint64_t pairs, contacts; /* numbers of waiting rows of pairs and of contacts */
    ebpo_status status;       /* failure of receive_rows, and its error */
    ebpo_error *error;
} pairs_file;

/* Makes the groups and the empty datasets. */
static ebpo_status make_tables(pairs_file *w, ebpo_error *error)
{
    static const char *const groups[] = { "/pairs", "/contacts" };
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < 2 && status == EBPO_OK; i++) {
        ebpo_h5_id id;
        status = ebpo_h5_make_plain_group(&w->out, groups[i], &id, error);
        ebpo_h5_close_id(&w->out, id);
    }
    for (int i = 0; i < TABLES && status == EBPO_OK; i++)
        status = ebpo_h5_make_table(&w->out, layout[i].path, layout[i].number, layout[i].cols,
                                    &w->table[i], error);
    return status;
}

/* Writes the waiting rows. Returns false after a failure, and sets w->status. */
static bool flush_rows(pairs_file *w)
{
    const void *const data[TABLES] = { w->faces,  w->file_faces,    w->kind,
                                       w->points, w->contact_faces, w->on };
    for (int i = 0; i < TABLES && w->status == EBPO_OK; i++)
        w->status = ebpo_h5_append(&w->out, &w->table[i], data[i],
                                   i < POINTS ? w->pairs : w->contacts, w->error);
    w->pairs = w->contacts = 0;
    return w->status == EBPO_OK;
}

/* Adds a row for the contact of a crossing pair. Returns false after a failure, and sets
 * w->status. */
static bool add_contact_row(pairs_file *w, const ebpo_face_pair *pair)
{
    ebpo_posed_pair faces;
    ebpo_contact_segment s;
    uint64_t n = w->contacts++;
    w->status = ebpo_pose_pair(&w->lookup, pair, &faces, w->error);
    if (w->status != EBPO_OK)
        return false;
    ebpo_contact_of(&faces, pair, &s);
    memcpy(w->points[n], s.point, sizeof s.point);
    w->contact_faces[n][0] = (int64_t)s.face_a;
    w->contact_faces[n][1] = (int64_t)s.face_b;
    for (int i = 0; i < 2; i++) {
        w->on[n][2 * i] = s.on_a[i];
        w->on[n][2 * i + 1] = s.on_b[i];
    }
    return true;
}

/* Receives pairs from ebpo_collide_all, and adds their rows. Returns false after a failure, and
 * sets w->status. */
static bool receive_rows(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    pairs_file *w = user;
    for (uint64_t i = 0; i < count; i++) {
        uint64_t n = w->pairs++;
        w->faces[n][0] = (int64_t)pairs[i].face_a;
        w->faces[n][1] = (int64_t)pairs[i].face_b;
        w->file_faces[n][0] = (int64_t)pairs[i].file_face_a;
        w->file_faces[n][1] = (int64_t)pairs[i].file_face_b;
        w->kind[n] = (uint8_t)pairs[i].kind;
        if (pairs[i].kind == EBPO_PAIR_CROSSING && !add_contact_row(w, &pairs[i]))
            return false;
        if (w->pairs == ROWS && !flush_rows(w))
            return false;
    }
    return true;
}

/* Writes the whole file. */
static ebpo_status write_tables(pairs_file *w, const char *path, ebpo_publish *target)
{
    const ebpo_collision *q = w->collision;
    ebpo_status status = ebpo_h5_create_plain(&w->out, ebpo_publish_path(target), path, w->error);
    if (status == EBPO_OK)
        status = make_tables(w, w->error);
    if (status == EBPO_OK)
        status = ebpo_collide_all(q->collider, &q->options, receive_rows, w, w->error);
    if (status == EBPO_OK)
        status = w->status;
    if (status == EBPO_OK && !flush_rows(w))
        status = w->status;
    for (int i = 0; i < TABLES; i++)
        ebpo_h5_close_table(&w->out, &w->table[i]);
    if (status == EBPO_OK)
        status = ebpo_h5_finish(&w->out, w->error);
    ebpo_h5_discard(&w->out);
    return status;
}

/* Writes the pairs and contacts of a query to an HDF5 file. */
static ebpo_status write_hdf5(const ebpo_collision *q, const char *path, ebpo_publish *target,
                              ebpo_error *error)
{
    pairs_file *w = ebpo_alloc_zero(1, sizeof *w);
    if (!w)
        return ebpo_fail_memory(error, sizeof *w);
    w->collision = q;
    w->out = (ebpo_h5_out)EBPO_H5_OUT_INIT;
    w->error = error;
    for (int i = 0; i < TABLES; i++)
        w->table[i] = (ebpo_h5_table)EBPO_H5_TABLE_INIT;
    ebpo_status status = ebpo_pair_faces_begin(&w->lookup, q, error);
    if (status == EBPO_OK)
        status = write_tables(w, path, target);
    ebpo_pair_faces_end(&w->lookup);
    free(w);
    return status;
}

/* --- PLY --- */

/* A mesh that is written as PLY. The mesh of a partly loaded model is read chunk by chunk. The mesh
 * of a model that is entirely in memory (a whole model) is read from the model's file. */
typedef struct shown_mesh {
    ebpo_mesh mesh;             /* for a whole model */
    ebpo_faces_by_number parts; /* for a partly loaded model */
    ebpo_red_source source;
    uint64_t *intersecting; /* a bit for each face, 1: the face intersects the other mesh */
} shown_mesh;

typedef struct shown_meshes {
    shown_mesh side[2]; /* meshes of the caller's A and B */
} shown_meshes;

/* Marks the faces of pairs as intersecting. */
static bool mark_faces(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    const shown_meshes *p = user;
    uint64_t *a = p->side[0].intersecting, *b = p->side[1].intersecting;
    for (uint64_t i = 0; i < count; i++) {
        a[pairs[i].file_face_a / 64] |= UINT64_C(1) << pairs[i].file_face_a % 64;
        b[pairs[i].file_face_b / 64] |= UINT64_C(1) << pairs[i].file_face_b % 64;
    }
    return true;
}

/* Functions of an ebpo_red_source for a partly loaded model. */
static ebpo_status part_vertex(void *user, uint64_t number, double out[3], ebpo_error *error)
{
    return ebpo_faces_by_number_vertex(user, number, out, error);
}

static ebpo_status part_face(void *user, uint64_t number, uint32_t out[3], ebpo_error *error)
{
    return ebpo_faces_by_number_corners(user, number, out, error);
}

/* Prepares the mesh of a model, without marked faces. */
static ebpo_status begin_shown_mesh(shown_mesh *p, const ebpo_model *model, ebpo_error *error)
{
    const ebpo_info *info = model->info;
    p->intersecting = ebpo_alloc_zero(info->face_count / 64 + 1, 8);
    if (!p->intersecting)
        return ebpo_fail_memory(error, info->face_count / 8);
    if (model->whole) {
        ebpo_status status = ebpo_file_read_mesh(model->file, NULL, &p->mesh, error);
        p->source = ebpo_red_source_of(&p->mesh);
        return status;
    }
    ebpo_faces_by_number_begin(&p->parts, model, NULL);
    p->source = (ebpo_red_source){ info->vertex_count, info->face_count, &p->parts, part_vertex,
                                   part_face };
    return EBPO_OK;
}

static void end_shown_mesh(shown_mesh *p)
{
    ebpo_faces_by_number_end(&p->parts);
    ebpo_mesh_free(&p->mesh);
    free(p->intersecting);
}

/* Writes both meshes of a query to a PLY file. */
static ebpo_status write_ply(const ebpo_collision *q, ebpo_publish *target, ebpo_error *error)
{
    static const char *const colour[2] = { "200 200 200", "150 150 160" }; /* two greys */
    shown_meshes p = { 0 };
    ebpo_red_mesh red[2];
    ebpo_status status = EBPO_OK;
    for (int m = 0; m < 2 && status == EBPO_OK; m++)
        status = begin_shown_mesh(&p.side[m], q->collider->model[m], error);
    if (status == EBPO_OK)
        status = ebpo_collide_all(q->collider, &q->options, mark_faces, &p, error);
    uint64_t before = ebpo_collision_bytes_read(q);
    for (int m = 0; m < 2; m++)
        red[m] = (ebpo_red_mesh){ p.side[m].source, &q->posing[(int)q->swapped ^ m].posing,
                                  p.side[m].intersecting, colour[m] };
    if (status == EBPO_OK)
        status = ebpo_red_meshes_print(red, 2, target, error);
    q->collider->bytes_read += ebpo_collision_bytes_read(q) - before;
    for (int m = 0; m < 2; m++)
        end_shown_mesh(&p.side[m]);
    return status;
}

/* --- both formats --- */

ebpo_status ebpo_collide_write(ebpo_collider *c, const ebpo_collide_options *options,
                               ebpo_pairs_format format, const char *path, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_collision q;
    ebpo_publish target = EBPO_PUBLISH_INIT;
    if (format != EBPO_PAIRS_HDF5 && format != EBPO_PAIRS_PLY)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "%s: unknown format of pairs: %d", path,
                         (int)format);
    ebpo_status status = ebpo_collision_begin(&q, c, options, error);
    if (status == EBPO_OK)
        status = ebpo_publish_begin(&target, path, error);
    if (status == EBPO_OK)
        status = format == EBPO_PAIRS_PLY ? write_ply(&q, &target, error)
                                          : write_hdf5(&q, path, &target, error);
    if (status == EBPO_OK)
        status = ebpo_publish_commit(&target, error);
    ebpo_publish_abort(&target);
    return status;
}
