/* Finds the pairs of faces of one mesh that have more in common than a corner or an edge.
 *
 * The mesh is written to a temporary file, which is opened as a model with a memory budget, so the
 * mesh may be larger than memory. The search needs only the faces, so the model is built as a
 * surface without planes, which is much faster. ebpo_collide_self finds the pairs of the model's
 * faces that intersect. The mesh in the workspace gives the coordinates of these faces, from which
 * their common points are computed. An optional PLY file shows these faces in red. */
#include "core/strict_fp.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/build.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/workspace.h"
#include "extras/collide/collider.h"
#include "extras/collide/red_mesh.h"
#include "format/write_file.h"
#include "extras/collide/face_pairs.h"

typedef struct crossings {
    ebpo_self_intersections_options options;
    ebpo_self_intersections_fn take; /* the caller's function, or NULL, and its argument */
    void *user;
    ebpo_tree tree;  /* the built tree; after the file has been written, only its mesh is kept, in
                        the workspace */
    ebpo_file *file; /* the temporary file */
    ebpo_model *model;
    ebpo_collider *collider;
    ebpo_publish target;                 /* the PLY file, if options.ply is not NULL */
    ebpo_self_intersections_summary sum; /* counts for the caller */
    uint64_t *intersecting; /* a bit for each face, by its index in the source; 1: it intersects
                             * another face */
    bool enough;            /* the caller needs no more crossings */
} crossings;

/* --- the model --- */

/* Builds the tree of the mesh. ebpo_build gets a changed copy of the report, in which the mesh is
 * not closed, so that it builds a surface also from a closed mesh. */
static ebpo_status build_model(crossings *c, ebpo_mesh *mesh, const ebpo_mesh_report *report,
                               ebpo_error *error)
{
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    ebpo_mesh_report surface = *report;
    surface.balanced = surface.manifold = false;
    options.parts = EBPO_PART_MESH | EBPO_PART_MAPS;
    options.threads = c->options.threads;
    options.progress = c->options.progress;
    return ebpo_build(mesh, &surface, NULL, &options, &c->tree, error);
}

/* Frees the levels of the tree, which are not needed after the file has been written. */
static void drop_levels(ebpo_tree *tree)
{
    for (int i = 0; i < tree->info.level_count; i++)
        ebpo_level_free(&tree->level[i]);
}

/* Writes the temporary file and opens it. */
static ebpo_status store_model(crossings *c, const char *folder, ebpo_error *error)
{
    ebpo_write_options options = EBPO_WRITE_OPTIONS_INIT;
    options.codec_level = 1; /* the fastest level, because the file is temporary */
    options.threads = c->options.threads;
    options.progress = c->options.progress;
    return ebpo_tree_store(&c->tree, folder, "ebpo-crossings", &options, &c->file, error);
}

/* Minimum memory budget of the model in bytes. It has an effect only in tests, in which a quarter
 * of the available memory may be less. */
enum { LEAST_MODEL = 1 << 20 };

/* Makes the model and its collider. memory: number of bytes that the workspace, the model and the
 * collider may use together. The workspace uses half of these bytes, the model a quarter, and the
 * pairs of the collider 1/16. */
static ebpo_status make_collider(crossings *c, uint64_t memory, ebpo_error *error)
{
    ebpo_model_options model_options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_collider_options collider_options = EBPO_COLLIDER_OPTIONS_INIT;
    model_options.memory = memory / 4 > LEAST_MODEL ? memory / 4 : LEAST_MODEL;
    model_options.threads = collider_options.threads = c->options.threads;
    model_options.progress = c->options.progress;
    collider_options.memory = memory / 16;
    ebpo_status status = ebpo_model_new(c->file, &model_options, &c->model, error);
    return status == EBPO_OK
               ? ebpo_collider_new(c->model, c->model, &collider_options, &c->collider, error)
               : status;
}

/* --- pairs --- */

/* Gets the corners of a face by its index in the file. */
static void corners_of(const crossings *c, uint64_t file_face, double out[3][3])
{
    const ebpo_mesh *mesh = &c->tree.mesh;
    for (int i = 0; i < 3; i++) {
        uint64_t v = 3 * (uint64_t)mesh->faces[3 * file_face + (unsigned)i];
        for (unsigned k = 0; k < 3; k++)
            out[i][k] = mesh->xyz64 ? mesh->xyz64[v + k] : (double)mesh->xyz32[v + k];
    }
}

/* Computes a point of both faces of an intersecting pair. */
static void common_point(const double a[3][3], const double b[3][3], int32_t kind, double out[3])
{
    ebpo_contact_end end[2];
    ebpo_pair_distance_bounds nearest;
    if (kind == EBPO_PAIR_CROSSING) {
        ebpo_triangle_contact(a, b, end);
        for (int k = 0; k < 3; k++)
            out[k] = end[0].point[k] / 2 + end[1].point[k] / 2;
        return;
    }
    ebpo_triangles_distance_bounds(a, b, &nearest);
    memcpy(out, nearest.point[0], sizeof nearest.point[0]);
}

/* Marks a face as intersecting; counts the face if it was not marked. */
static void record_face(crossings *c, uint64_t face)
{
    uint64_t bit = UINT64_C(1) << face % 64;
    c->sum.faces += !(c->intersecting[face / 64] & bit);
    c->intersecting[face / 64] |= bit;
}

/* Sets *out to the crossing of a pair, and counts the pair and its faces. */
static void fill_crossing(crossings *c, const ebpo_face_pair *pair, ebpo_self_intersection *out)
{
    double a[3][3], b[3][3];
    bool swap = pair->face_a > pair->face_b;
    *out = (ebpo_self_intersection){ .kind = pair->kind };
    out->face[swap] = pair->face_a;
    out->face[!swap] = pair->face_b;
    corners_of(c, pair->file_face_a, a);
    corners_of(c, pair->file_face_b, b);
    common_point((const double(*)[3])a, (const double(*)[3])b, pair->kind, out->point);
    c->sum.pairs[pair->kind]++;
    for (int i = 0; i < 2; i++)
        record_face(c, out->face[i]);
}

enum { REPORTED_AT_ONCE = 256 }; /* greatest number of crossings in a call of c->take */

/* Receives pairs from ebpo_collide_self, and passes their crossings to the caller. Returns false if
 * the caller needs no more crossings. */
static bool receive_pairs(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    crossings *c = user;
    ebpo_self_intersection out[REPORTED_AT_ONCE];
    for (uint64_t at = 0; at < count && !c->enough; at += REPORTED_AT_ONCE) {
        uint64_t n = count - at < REPORTED_AT_ONCE ? count - at : REPORTED_AT_ONCE;
        for (uint64_t i = 0; i < n; i++)
            fill_crossing(c, &pairs[at + i], &out[i]);
        c->enough = c->take && !c->take(c->user, out, n);
    }
    return !c->enough;
}

/* --- the call --- */

/* Writes the PLY file. The model's file has its faces in another order, so the mesh is read in the
 * order of the source. */
static ebpo_status write_red_mesh(crossings *c, ebpo_workspace *workspace, ebpo_error *error)
{
    ebpo_read_options options = EBPO_READ_OPTIONS_INIT;
    ebpo_mesh mesh;
    bool source_order;
    options.threads = c->options.threads;
    options.workspace = workspace;
    ebpo_status status = ebpo_file_read_source_mesh(c->file, &options, &mesh, &source_order, error);
    if (status != EBPO_OK)
        return status;
    const ebpo_red_mesh red = { ebpo_red_source_of(&mesh), NULL, c->intersecting, "200 200 200" };
    status = ebpo_red_meshes_print(&red, 1, &c->target, error);
    ebpo_mesh_free(&mesh);
    return status == EBPO_OK ? ebpo_publish_commit(&c->target, error) : status;
}

/* Makes the model, searches it, and writes the PLY file if the caller wants one. */
static ebpo_status search_crossings(crossings *c, ebpo_mesh *mesh, const ebpo_mesh_report *report,
                                    ebpo_workspace *workspace, ebpo_error *error)
{
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    options.progress = c->options.progress;
    ebpo_status status = build_model(c, mesh, report, error);
    if (status != EBPO_OK)
        return status;
    c->intersecting = ebpo_alloc_zero(c->tree.mesh.face_count / 64 + 1, sizeof *c->intersecting);
    if (!c->intersecting)
        return ebpo_fail_memory(error, c->tree.mesh.face_count / 8);
    status = store_model(c, ebpo_workspace_folder(workspace), error);
    drop_levels(&c->tree);
    if (status == EBPO_OK)
        status = make_collider(c, ebpo_workspace_memory(workspace), error);
    if (status == EBPO_OK)
        status = ebpo_collide_self(c->collider, &options, receive_pairs, c, error);
    return status == EBPO_OK && c->options.ply ? write_red_mesh(c, workspace, error) : status;
}

/* Frees all members. */
static void close_all(crossings *c)
{
    ebpo_collider_free(c->collider);
    ebpo_model_free(c->model);
    ebpo_close(c->file);
    ebpo_tree_free(&c->tree);
    free(c->intersecting);
    ebpo_publish_abort(&c->target);
}

ebpo_status ebpo_mesh_self_intersections(ebpo_mesh *mesh, const ebpo_mesh_report *report,
                                         const ebpo_self_intersections_options *options,
                                         ebpo_self_intersections_fn take, void *user,
                                         ebpo_self_intersections_summary *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    crossings c = { .options = EBPO_SELF_INTERSECTIONS_OPTIONS_INIT,
                    .take = take,
                    .user = user,
                    .target = EBPO_PUBLISH_INIT,
                    .sum = EBPO_SELF_INTERSECTIONS_SUMMARY_INIT };
    ebpo_workspace *workspace = mesh->workspace, *temporary = NULL;
    ebpo_status status = EBPO_TAKE(ebpo_self_intersections_options, &c.options, options, error);
    if (status == EBPO_OK && !workspace)
        status = ebpo_workspace_new(NULL, &temporary, error);
    if (status == EBPO_OK && c.options.ply)
        status = ebpo_publish_begin(&c.target, c.options.ply, error);
    if (status == EBPO_OK)
        status = search_crossings(&c, mesh, report, workspace ? workspace : temporary, error);
    ebpo_mesh_free(mesh);
    close_all(&c);
    ebpo_workspace_free(temporary);
    return status == EBPO_OK && out ? EBPO_GIVE(ebpo_self_intersections_summary, out, &c.sum)
                                    : status;
}
