/* Makes the mesh of the result of an expression: reads the faces of the operands (face_list.h),
 * cuts them along their intersections (cut_mesh.h), selects the parts that bound the result, and
 * rounds the new vertices. Only the last step rounds, and it moves vertices without changing which
 * triangles share them, so the mesh is closed. Proof: docs/develop/booleans.md, "Mesh". */
#include "core/strict_fp.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "extras/boolean/boolean_origins.h"
#include "extras/boolean/cut_mesh.h"

typedef struct output {
    const ebpo_cut_mesh *cut;
    const int8_t *sign;
    bool doubles;
    uint32_t *number;       /* for each vertex of the cut mesh: its number, or EBPO_NO_CORNER */
    ebpo_corner_ids vertex; /* rounded vertices */
    uint32_t *origin;       /* for each face: the face of an operand from which it comes */
    ebpo_boolean_mesh_report *report;
    ebpo_mesh *mesh;
} output;

/* Rounds coordinate k to the nearest float, ties to even. `p`: the exact point, or NULL if the
 * double is exact. */
static double round_to_float(double at, const ebpo_exact_point *p, int k, int unit)
{
    float nearest = (float)at, other = nextafterf(nearest, at > nearest ? INFINITY : -INFINITY);
    bool tie = at != nearest && at - nearest == (double)other - at;
    int side = tie && p ? ebpo_exact_side_of_double(p, k, unit) : 0;
    if (side != 0)
        nearest = (side > 0) == (other > nearest) ? other : nearest;
    return nearest;
}

static bool number_vertex(output *o, uint32_t v)
{
    const ebpo_cut_mesh *cut = o->cut;
    uint64_t corners = cut->faces->corners.count;
    const ebpo_exact_point *p = v < corners ? NULL : &cut->set.point[v - corners];
    const double *at = p ? p->at : cut->faces->corners.at[v];
    double out[3], moved;
    if (o->number[v] != EBPO_NO_CORNER)
        return true;
    for (int k = 0; k < 3; k++)
        out[k] = o->doubles ? at[k] : round_to_float(at[k], p, k, cut->unit);
    moved = p ? ebpo_exact_distance(p, out, cut->unit)
              : hypot(hypot(out[0] - at[0], out[1] - at[1]), out[2] - at[2]);
    o->report->displacement = fmax(o->report->displacement, moved);
    o->report->new_vertices += p || v >= cut->faces->given_corners;
    return ebpo_corner_id(&o->vertex, out, &o->number[v]);
}

/* Numbers vertices in the order of triangles. Triangles that lose a corner by rounding are omitted:
 * their two other edges are then the same edge in both directions. */
static bool list_triangles(output *o)
{
    const ebpo_cut_mesh *cut = o->cut;
    for (uint64_t t = 0; t < cut->count; t++) {
        uint32_t *to = o->mesh->faces + 3 * o->mesh->face_count;
        if (o->sign[t] == 0)
            continue;
        for (int i = 0; i < 3; i++)
            if (!number_vertex(o, cut->triangle[t][i]))
                return false;
        to[0] = o->number[cut->triangle[t][0]];
        to[1] = o->number[cut->triangle[t][o->sign[t] > 0 ? 1 : 2]];
        to[2] = o->number[cut->triangle[t][o->sign[t] > 0 ? 2 : 1]];
        o->origin[o->mesh->face_count] = cut->face[t];
        o->mesh->face_count += to[0] != to[1] && to[1] != to[2] && to[2] != to[0];
    }
    return true;
}

/* Returns true if a vertex of the result is beyond the range of floats. */
static bool exceeds_floats(const output *o)
{
    const ebpo_corner_ids *corners = &o->cut->faces->corners;
    for (uint64_t i = 0; i < 3 * o->cut->count; i++) {
        uint32_t v = o->cut->triangle[i / 3][i % 3]; /* other vertices are between corners */
        for (int k = 0; k < 3 && v < corners->count && o->sign[i / 3]; k++)
            if (fabs(corners->at[v][k]) > FLT_MAX)
                return true;
    }
    return false;
}

static bool copy_vertices(output *o)
{
    ebpo_mesh *mesh = o->mesh;
    mesh->vertex_count = o->vertex.count;
    if (o->doubles) {
        mesh->xyz64 = (double *)o->vertex.at;
        o->vertex.at = NULL;
        return mesh->xyz64 || mesh->vertex_count == 0;
    }
    mesh->xyz32 = ebpo_alloc(mesh->vertex_count, 3 * sizeof *mesh->xyz32);
    for (uint64_t i = 0; i < 3 * mesh->vertex_count && mesh->xyz32; i++)
        mesh->xyz32[i] = (float)o->vertex.at[i / 3][i % 3];
    return mesh->xyz32 != NULL;
}

static ebpo_status fill_mesh(output *o, const ebpo_boolean_mesh_options *options, ebpo_error *error)
{
    const ebpo_cut_mesh *cut = o->cut;
    uint64_t vertices = ebpo_cut_mesh_vertices(cut), faces = 0;
    for (uint64_t t = 0; t < cut->count; t++)
        faces += o->sign[t] != 0;
    o->doubles = options->doubles || !cut->faces->floats || exceeds_floats(o);
    o->number = ebpo_alloc(vertices, sizeof *o->number);
    o->mesh->faces = ebpo_alloc(faces, 3 * sizeof *o->mesh->faces);
    o->origin = ebpo_alloc(faces, sizeof *o->origin);
    bool fine = o->number && o->mesh->faces && o->origin;
    for (uint64_t v = 0; v < vertices && fine; v++)
        o->number[v] = EBPO_NO_CORNER;
    fine = fine && list_triangles(o) && copy_vertices(o);
    ebpo_status status = fine ? EBPO_OK : ebpo_fail_memory(error, 4 * vertices + 16 * faces);
    if (status == EBPO_OK && options->origins)
        status = ebpo_boolean_origins(cut->faces, o->origin, o->mesh, error);
    free(o->number);
    free(o->origin);
    ebpo_corner_ids_free(&o->vertex);
    return status;
}

static ebpo_status make_mesh(ebpo_face_list *faces, const ebpo_boolean_mesh_options *options,
                             ebpo_mesh *mesh, ebpo_boolean_mesh_report *report, ebpo_error *error)
{
    ebpo_cut_mesh cut;
    int8_t *sign = NULL;
    ebpo_status status = ebpo_cut_mesh_make(&cut, faces, &options->progress, error);
    if (status == EBPO_OK)
        status = ebpo_cut_mesh_classify(&cut, &options->progress, &sign, &report->patches, error);
    if (status == EBPO_OK) {
        output o = { .cut = &cut, .sign = sign, .report = report, .mesh = mesh };
        status = fill_mesh(&o, options, error);
        report->faces_cut = cut.faces_cut;
    }
    free(sign);
    ebpo_cut_mesh_free(&cut);
    return status;
}

/* Units are texts of the user; an operand without a unit is accepted with every unit. */
static ebpo_status check_units(const ebpo_boolean *b, ebpo_error *error)
{
    const char *unit = "";
    uint64_t used = ebpo_expression_operands(&b->expression);
    for (uint32_t i = 0; i < b->count; i++) {
        const ebpo_model *model = b->solid[i].model;
        const char *own = model->info->unit;
        ebpo_error cause = EBPO_ERROR_INIT;
        if (!(used >> i & 1) || !own[0])
            continue;
        if (unit[0] && strcmp(unit, own) != 0) {
            ebpo_fail(&cause, EBPO_E_ARGUMENT,
                      "the unit is %s, but another operand has the unit %s; convert a model again "
                      "with the same unit",
                      own, unit);
            return ebpo_fail_operand(model, i, &cause, error);
        }
        unit = own;
    }
    return EBPO_OK;
}

ebpo_status ebpo_boolean_mesh(ebpo_boolean *boolean, const ebpo_boolean_mesh_options *options,
                              ebpo_mesh *out, ebpo_boolean_mesh_report *report, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_boolean_mesh_options wanted = EBPO_BOOLEAN_MESH_OPTIONS_INIT;
    ebpo_boolean_mesh_report filled = EBPO_BOOLEAN_MESH_REPORT_INIT;
    ebpo_face_list faces;
    memset(out, 0, sizeof *out);
    ebpo_status status = EBPO_TAKE(ebpo_boolean_mesh_options, &wanted, options, error);
    if (status == EBPO_OK)
        status = check_units(boolean, error);
    if (status != EBPO_OK)
        return status;
    status = ebpo_face_list_read(&faces, boolean, &wanted.progress, error);
    if (status == EBPO_OK)
        status = ebpo_face_list_find_pairs(&faces, &wanted.progress, error);
    if (status == EBPO_OK)
        status = make_mesh(&faces, &wanted, out, &filled, error);
    ebpo_face_list_free(&faces);
    if (status != EBPO_OK)
        ebpo_mesh_free(out);
    return status == EBPO_OK && report ? EBPO_GIVE(ebpo_boolean_mesh_report, report, &filled)
                                       : status;
}
