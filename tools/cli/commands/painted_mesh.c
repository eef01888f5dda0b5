/* Builds a mesh from instances of a scene. The paint of a face is a byte that selects its colour.
 */
#include "cli/commands/painted_mesh.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/render/raster.h"

void painted_free(painted_mesh *p)
{
    ebpo_mesh_free(&p->mesh);
    free(p->paint);
    *p = (painted_mesh){ 0 };
}

static ebpo_status no_memory(ebpo_error *error)
{
    snprintf(error->message, sizeof error->message, "no memory for pictures of the scene");
    return error->status = EBPO_E_MEMORY;
}

/* --- red faces: faces of an instance that intersect another instance --- */

static bool take_red(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    uint8_t *const *red = user;
    for (uint64_t i = 0; i < count; i++) {
        red[0][pairs[i].file_face_a] = 1;
        red[1][pairs[i].file_face_b] = 1;
    }
    return true;
}

static const ebpo_file *file_of(const ebpo_scene *scene, uint64_t instance)
{
    ebpo_scene_instance i = EBPO_SCENE_INSTANCE_INIT;
    (void)ebpo_scene_get_instance(scene, instance, &i);
    return ebpo_scene_file(scene, i.model);
}

ebpo_status painted_find_red(ebpo_scene *scene, uint64_t a, uint64_t b, double time,
                             unsigned threads, uint8_t *red[2], ebpo_error *error)
{
    for (int i = 0; i < 2; i++)
        if (!red[i])
            red[i] = calloc(ebpo_file_info(file_of(scene, i ? b : a))->face_count + 1, 1);
    if (!red[0] || !red[1])
        return no_memory(error);
    return ebpo_scene_collide(scene, a, b, time, threads, take_red, red, error);
}

/* --- the mesh to draw --- */

/* Reserves space for more vertices and faces. Returns false if there is not enough memory. */
static bool reserve_space(painted_mesh *p, uint64_t vertices, uint64_t faces)
{
    ebpo_mesh *m = &p->mesh;
    double *xyz = realloc(m->xyz64, 3 * (m->vertex_count + vertices) * sizeof *xyz);
    m->xyz64 = xyz ? xyz : m->xyz64;
    uint32_t *face = realloc(m->faces, 3 * (m->face_count + faces) * sizeof *face);
    m->faces = face ? face : m->faces;
    uint8_t *paint = realloc(p->paint, m->face_count + faces);
    p->paint = paint ? paint : p->paint;
    return xyz && face && paint && m->vertex_count + vertices < UINT32_MAX;
}

static void add_vertex(ebpo_mesh *m, const ebpo_pose *pose, const double x[3])
{
    double *out = m->xyz64 + 3 * m->vertex_count++;
    for (int i = 0; i < 3; i++) {
        const double *r = pose->rotation[i];
        out[i] = pose->scale * (r[0] * x[0] + r[1] * x[1] + r[2] * x[2]) + pose->translation[i];
    }
}

/* Adds the face with the vertices first + corner[k]. */
static void add_face(painted_mesh *p, uint32_t first, const uint32_t corner[3], uint8_t paint)
{
    ebpo_mesh *m = &p->mesh;
    for (int k = 0; k < 3; k++)
        m->faces[3 * m->face_count + (uint64_t)k] = first + corner[k];
    p->paint[m->face_count++] = paint;
}

static ebpo_status add_mesh(painted_mesh *p, const ebpo_mesh *from, const ebpo_pose *pose,
                            const uint8_t *red, uint8_t paint, ebpo_error *error)
{
    uint32_t first = (uint32_t)p->mesh.vertex_count;
    if (!reserve_space(p, from->vertex_count, from->face_count))
        return no_memory(error);
    for (uint64_t i = 0; i < from->vertex_count; i++) {
        double x[3];
        for (uint64_t k = 0; k < 3; k++)
            x[k] = from->xyz32 ? (double)from->xyz32[3 * i + k] : from->xyz64[3 * i + k];
        add_vertex(&p->mesh, pose, x);
    }
    for (uint64_t f = 0; f < from->face_count; f++) {
        bool is_red = red && red[f];
        add_face(p, first, from->faces + 3 * f, is_red ? RASTER_RED : paint);
    }
    return EBPO_OK;
}

ebpo_status painted_add(painted_mesh *p, const ebpo_scene *scene, uint64_t instance, double time,
                        const uint8_t *red, uint8_t paint, ebpo_error *error)
{
    ebpo_pose pose;
    ebpo_mesh mesh = { 0 };
    ebpo_status status = ebpo_scene_pose(scene, instance, time, &pose, error);
    if (status == EBPO_OK)
        status = ebpo_file_read_mesh(file_of(scene, instance), NULL, &mesh, error);
    if (status == EBPO_OK)
        status = add_mesh(p, &mesh, &pose, red, paint, error);
    ebpo_mesh_free(&mesh);
    return status;
}

ebpo_status painted_add_box(painted_mesh *p, const ebpo_scene *scene, uint64_t instance,
                            double time, uint8_t paint, ebpo_error *error)
{
    static const uint32_t corner[12][3] = { { 0, 2, 3 }, { 0, 3, 1 }, { 4, 5, 7 }, { 4, 7, 6 },
                                            { 0, 1, 5 }, { 0, 5, 4 }, { 2, 6, 7 }, { 2, 7, 3 },
                                            { 0, 4, 6 }, { 0, 6, 2 }, { 1, 3, 7 }, { 1, 7, 5 } };
    ebpo_scene_instance at = EBPO_SCENE_INSTANCE_INIT;
    ebpo_scene_model_facts m = EBPO_SCENE_MODEL_FACTS_INIT;
    ebpo_pose pose;
    uint32_t first = (uint32_t)p->mesh.vertex_count;
    ebpo_status status = ebpo_scene_pose(scene, instance, time, &pose, error);
    if (status != EBPO_OK)
        return status;
    (void)ebpo_scene_get_instance(scene, instance, &at);
    (void)ebpo_scene_get_model_facts(scene, at.model, &m);
    if (!reserve_space(p, 8, 12))
        return no_memory(error);
    for (int i = 0; i < 8; i++) {
        const double x[3] = { (i & 1 ? m.max : m.min)[0], (i & 2 ? m.max : m.min)[1],
                              (i & 4 ? m.max : m.min)[2] };
        add_vertex(&p->mesh, &pose, x);
    }
    for (int f = 0; f < 12; f++)
        add_face(p, first, corner[f], paint);
    return EBPO_OK;
}

/* Returns true if the box of the face intersects the cube of painted_crop. */
static bool is_near(const ebpo_mesh *m, uint64_t face, const double middle[3], double half_side)
{
    for (uint64_t k = 0; k < 3; k++) {
        double low = INFINITY, high = -INFINITY;
        for (uint64_t i = 0; i < 3; i++) {
            double x = m->xyz64[3 * (uint64_t)m->faces[3 * face + i] + k];
            low = fmin(low, x);
            high = fmax(high, x);
        }
        if (low > middle[k] + half_side || high < middle[k] - half_side)
            return false;
    }
    return true;
}

void painted_crop(painted_mesh *p, const double middle[3], double half_side)
{
    ebpo_mesh *m = &p->mesh;
    uint64_t kept = 0;
    for (uint64_t f = 0; f < m->face_count; f++) {
        if (!is_near(m, f, middle, half_side))
            continue;
        memmove(m->faces + 3 * kept, m->faces + 3 * f, 3 * sizeof *m->faces);
        p->paint[kept++] = p->paint[f];
    }
    m->face_count = kept;
}
