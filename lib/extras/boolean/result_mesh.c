/* Writes the triangles that bound the result into a mesh.
 *
 * Each operand is read again, and its faces are visited in order. Faces near other operands are in
 * a list (face_list.h) and have been cut into triangles (cut_mesh.h); those triangles that bound
 * the result are added. A face that is not listed is added whole if the listed faces of its
 * component bound the result.
 *
 * Vertices are numbered in the order of their first use. A corner of a listed face gets the number
 * of its vertex in the cut mesh, so whole faces and triangles share vertices. If requested, each
 * face of the result gets the index of its original face. This is the source index if the operand's
 * file has source indices, else the index in the file. */
#include "core/strict_fp.h"

#include "extras/boolean/result_mesh.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/workspace.h"
#include "extras/boolean/result_attributes.h"
#include "extras/boolean/volume_sum.h"
#include "mesh/attributes.h"
#include "mesh/mesh_parts.h"
#include "query/sample_attributes.h"

#define NO_NUMBER UINT32_MAX

typedef struct output {
    const ebpo_cut_mesh *cut;
    const int8_t *sign; /* for each triangle: 1: added; -1: added, reversed; 0: not in the result */
    int8_t *component_sign[EBPO_BOOLEAN_OPERANDS_MAX]; /* [operand][component] sign of all faces of
                                                          the component */
    bool doubles;            /* coordinates of the result are doubles, else floats */
    uint32_t *number;        /* [vertex of the cut mesh] its number in the result, or NO_NUMBER */
    ebpo_corner_ids rounded; /* rounded positions of the vertices that have a number */
    uint32_t *of_rounded;    /* [rounded position] number of its vertex in the result */
    uint64_t of_rounded_capacity;
    ebpo_boolean_mesh_report *report;
    ebpo_mesh *mesh;
    uint64_t removed; /* index of the attribute "removed"; only for changes */
    /* Arrays with an entry for each face of the result; NULL: not requested. */
    uint8_t *operand;      /* index of the operand */
    uint8_t *operand_face; /* uint32: index of the original face */
    uint8_t *colour;       /* three bytes: colour of the operand */
    ebpo_carrying carrying;
    bool measures; /* `volume` is requested */
    ebpo_volume_sum volume;
} output;

/* The operand that is being read. */
typedef struct operand_output {
    output *o;
    uint32_t operand;
    ebpo_mesh mesh;       /* the operand's mesh, posed */
    ebpo_maps maps;       /* source indices of the faces */
    bool repeats;         /* several vertices have one position */
    ebpo_positions first; /* for each vertex: the first vertex at its position; only if `repeats` */
    uint64_t *near;       /* a bit for each vertex that is a corner of a listed face */
    uint32_t *number;     /* [vertex] its number in the result, or NO_NUMBER */
} operand_output;

/* --- vertices --- */

/* Rounds coordinate k to the nearest float, ties to even. at: the double that is nearest to the
 * coordinate. p: the exact point, or NULL if `at` is exact. */
static double round_to_float(double at, const ebpo_exact_point *p, int k, int unit)
{
    float nearest = (float)at, other = nextafterf(nearest, at > nearest ? INFINITY : -INFINITY);
    /* If `at` is in the middle between two floats, the exact coordinate decides. */
    bool tie = at != nearest && at - nearest == (double)other - at;
    int side = tie && p ? ebpo_exact_side_of_double(p, k, unit) : 0;
    if (side != 0)
        nearest = (side > 0) == (other > nearest) ? other : nearest;
    return nearest;
}

/* Adds a vertex and returns its number. The arrays have space for the vertex. */
static uint32_t add_vertex(output *o, const double at[3])
{
    uint64_t v = o->mesh->vertex_count++;
    for (unsigned k = 0; k < 3; k++)
        if (o->doubles)
            o->mesh->xyz64[3 * v + k] = at[k];
        else
            o->mesh->xyz32[3 * v + k] = (float)at[k];
    return (uint32_t)v;
}

/* Sets `at` to the doubles nearest to the coordinates of a vertex of the cut mesh. Returns the
 * exact point; NULL: the doubles are exact. */
static const ebpo_exact_point *get_cut_vertex(const output *o, uint32_t v, double at[3])
{
    const ebpo_face_list *faces = o->cut->faces;
    uint64_t corners = faces->corners.count;
    const ebpo_exact_point *p = v < corners ? NULL : &o->cut->set.point[v - corners];
    memcpy(at, p ? p->at : faces->corners.at[v], 3 * sizeof *at);
    for (int k = 0; k < 3 && v < faces->given_corners; k++)
        at[k] = faces->negative_zeros[v] >> k & 1 ? -0.0 : at[k]; /* exact coordinates have no -0 */
    return p;
}

/* Gives a vertex of the cut mesh a number in the result. If no vertex with the same rounded
 * position exists, adds the vertex to the mesh. Returns false without memory. */
static bool number_cut_vertex(output *o, uint32_t v)
{
    double at[3], out[3], moved;
    uint32_t id;
    if (o->number[v] != NO_NUMBER)
        return true;
    const ebpo_exact_point *p = get_cut_vertex(o, v, at);
    for (int k = 0; k < 3; k++)
        out[k] = o->doubles ? at[k] : round_to_float(at[k], p, k, o->cut->unit);
    moved = p ? ebpo_exact_distance(p, out, o->cut->unit)
              : hypot(hypot(out[0] - at[0], out[1] - at[1]), out[2] - at[2]);
    o->report->displacement = fmax(o->report->displacement, moved);
    o->report->new_vertices += p || v >= o->cut->faces->given_corners;
    uint64_t known = o->rounded.count;
    if (!ebpo_corner_id(&o->rounded, out, &id) ||
        !ebpo_grow(&o->of_rounded, &o->of_rounded_capacity, o->rounded.count,
                   sizeof *o->of_rounded))
        return false;
    if (id == known)
        o->of_rounded[id] = add_vertex(o, out);
    o->number[v] = o->of_rounded[id];
    return true;
}

/* Updates the greatest displacement, for a vertex whose coordinates become floats. */
static void note_displacement(output *o, const double at[3])
{
    double moved[3], most = 0; /* most: the length is at most twice this */
    for (int k = 0; k < 3; k++) {
        moved[k] = fabs((double)(float)at[k] - at[k]);
        most = moved[k] > most ? moved[k] : most;
    }
    if (2 * most > o->report->displacement)
        o->report->displacement =
            fmax(o->report->displacement, hypot(hypot(moved[0], moved[1]), moved[2]));
}

/* Gives the vertex `number` of the result the attributes of vertex v of the operand. sign: sign of
 * the face. */
static void carry_vertex(operand_output *r, uint32_t number, uint32_t v, int sign)
{
    static const double weight[3] = { 1, 0, 0 };
    const uint32_t corner[3] = { v, v, v };
    ebpo_carry_vertex(&r->o->carrying, number, corner, weight, sign);
}

/* Gives a vertex of the operand a number in the result, and its attributes. sign: sign of the face.
 * Returns false without memory. */
static bool number_vertex(operand_output *r, uint32_t v, int sign)
{
    output *o = r->o;
    double at[3];
    uint32_t corner;
    ebpo_mesh_position(&r->mesh, v, at);
    if (ebpo_has_bit(r->near, v)) {
        if (!ebpo_corner_id(&o->cut->faces->corners, at, &corner) || !number_cut_vertex(o, corner))
            return false;
        r->number[v] = o->number[corner];
    } else {
        if (!o->doubles && r->mesh.xyz64)
            note_displacement(o, at);
        r->number[v] = add_vertex(o, at);
    }
    carry_vertex(r, r->number[v], v, sign);
    return true;
}

/* --- faces --- */

/* The face of the operand from which a face of the result comes. */
typedef struct origin {
    uint64_t face;   /* index in the file */
    uint32_t source; /* source index, or the index in the file if the file has no source indices */
} origin;

static origin origin_of(const operand_output *r, uint64_t face)
{
    return (origin){ face, r->maps.face_source ? r->maps.face_source[face] : (uint32_t)face };
}

static void add_colour(output *o, uint64_t at, uint32_t operand)
{
    static const uint8_t colours[][3] = { { 200, 190, 170 }, { 215, 105, 60 },  { 80, 150, 220 },
                                          { 110, 180, 90 },  { 190, 110, 190 }, { 220, 190, 70 },
                                          { 90, 190, 190 },  { 200, 90, 100 } };
    memcpy(o->colour + 3 * at, colours[operand % (sizeof colours / sizeof *colours)], 3);
}

/* Adds a face. corner: numbers of its corners in the result. If rounding made two corners equal,
 * the face is omitted. The result stays closed, because two edges of the face are then one edge in
 * both directions. */
static void add_face(operand_output *r, origin from, const uint32_t corner[3], int sign)
{
    output *o = r->o;
    uint64_t at = o->mesh->face_count;
    uint32_t *to = o->mesh->faces + 3 * at;
    if (corner[0] == corner[1] || corner[1] == corner[2] || corner[2] == corner[0])
        return;
    to[0] = corner[0];
    to[1] = corner[sign > 0 ? 1 : 2];
    to[2] = corner[sign > 0 ? 2 : 1];
    o->mesh->face_count++;
    ebpo_carry_face(&o->carrying, at, from.face, sign);
    if (o->colour)
        add_colour(o, at, r->operand);
    if (!o->operand)
        return;
    o->operand[at] = (uint8_t)r->operand;
    memcpy(o->operand_face + sizeof from.source * at, &from.source, sizeof from.source);
}

static void get_corners(const operand_output *r, uint64_t face, uint32_t out[3])
{
    for (int i = 0; i < 3; i++) {
        out[i] = r->mesh.faces[3 * face + (unsigned)i];
        if (r->repeats)
            out[i] = ebpo_positions_first(&r->first, out[i]);
    }
}

/* Adds a face of the operand that is not cut. Returns false without memory. */
static bool add_whole_face(operand_output *r, uint64_t face, int sign)
{
    uint32_t corner[3];
    get_corners(r, face, corner);
    if (r->o->measures) {
        double t[3][3];
        for (int i = 0; i < 3; i++)
            ebpo_mesh_position(&r->mesh, corner[i], t[i]);
        ebpo_volume_sum_add(&r->o->volume, (const double(*)[3])t, sign);
    }
    for (int i = 0; i < 3; i++) {
        if (r->number[corner[i]] == NO_NUMBER && !number_vertex(r, corner[i], sign))
            return false;
        corner[i] = r->number[corner[i]];
    }
    add_face(r, origin_of(r, face), corner, sign);
    return true;
}

/* Adds the volume below a triangle of the cut mesh, before rounding. */
static void measure_triangle(output *o, uint64_t t)
{
    const uint32_t *corner = o->cut->triangle[t];
    const ebpo_corner_ids *corners = &o->cut->faces->corners;
    mpq_t exact[3][3];
    double at[3][3];
    bool doubles = true;
    for (int i = 0; i < 3; i++) {
        doubles = doubles && corner[i] < corners->count;
        if (doubles)
            memcpy(at[i], corners->at[corner[i]], sizeof at[i]);
    }
    if (doubles) {
        ebpo_volume_sum_add(&o->volume, (const double(*)[3])at, o->sign[t]);
        return;
    }
    for (int i = 0; i < 9; i++) {
        mpq_init(exact[i / 3][i % 3]);
        ebpo_cut_mesh_coordinate(o->cut, corner[i / 3], i % 3, exact[i / 3][i % 3]);
    }
    ebpo_volume_sum_add_rational(&o->volume, exact, o->sign[t]);
    for (int i = 0; i < 9; i++)
        mpq_clear(exact[i / 3][i % 3]);
}

/* Gives vertex v of a triangle the attributes that the face has at the position of v. */
static void carry_point(operand_output *r, uint64_t face, uint32_t v, int sign)
{
    output *o = r->o;
    const uint32_t *corner = r->mesh.faces + 3 * face;
    double at[3], corners[3][3], weight[3];
    get_cut_vertex(o, v, at);
    for (int i = 0; i < 3; i++)
        ebpo_mesh_position(&r->mesh, corner[i], corners[i]);
    ebpo_weigh_corners((const double(*)[3])corners, at, weight);
    for (int i = 0; i < 3; i++)
        if (at[0] == corners[i][0] && at[1] == corners[i][1] && at[2] == corners[i][2]) {
            carry_vertex(r, o->number[v], corner[i], sign);
            return;
        }
    ebpo_carry_vertex(&o->carrying, o->number[v], corner, weight, sign);
}

/* Adds triangle t of a face, if it bounds the result. Returns false without memory. */
static bool add_triangle(operand_output *r, origin from, uint64_t t)
{
    output *o = r->o;
    uint32_t corner[3];
    if (o->sign[t] == 0)
        return true;
    if (o->measures)
        measure_triangle(o, t);
    for (int i = 0; i < 3; i++) {
        uint32_t v = o->cut->triangle[t][i];
        if (!number_cut_vertex(o, v))
            return false;
        corner[i] = o->number[v];
        if (o->carrying.count)
            carry_point(r, from.face, v, o->sign[t]);
    }
    add_face(r, from, corner, o->sign[t]);
    return true;
}

/* --- one operand --- */

/* Marks the corners of listed faces. */
static void mark_near(operand_output *r)
{
    const ebpo_face_list *faces = r->o->cut->faces;
    for (uint32_t i = faces->first[r->operand]; i < faces->first[r->operand + 1]; i++) {
        uint32_t corner[3];
        get_corners(r, faces->file_face[i], corner);
        for (int k = 0; k < 3; k++)
            ebpo_set_bit(r->near, corner[k]);
    }
}

/* Returns the first triangle of the operand in the cut mesh. */
static uint64_t first_triangle(const operand_output *r)
{
    const ebpo_cut_mesh *cut = r->o->cut;
    uint64_t low = 0, high = cut->count;
    while (low < high) {
        uint64_t middle = low + (high - low) / 2;
        if (cut->face[middle] < cut->faces->first[r->operand])
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

static bool add_faces(operand_output *r)
{
    const output *o = r->o;
    const ebpo_face_list *faces = o->cut->faces;
    const ebpo_whole_faces *whole = &faces->whole[r->operand];
    uint32_t listed = faces->first[r->operand];
    uint64_t t = first_triangle(r);
    EBPO_FOR_ITEMS(r->mesh.workspace, f, 0, r->mesh.face_count) {
        if (ebpo_has_bit(whole->listed, f)) {
            for (; t < o->cut->count && o->cut->face[t] == listed; t++)
                if (!add_triangle(r, origin_of(r, f), t))
                    return false;
            listed++;
        } else {
            int sign = o->component_sign[r->operand][whole->component[f]];
            if (sign && !add_whole_face(r, f, sign))
                return false;
        }
    }
    return true;
}

/* --- changes of the base --- */

/* Adds a range of removed faces of the base to the attribute "removed". A range that follows the
 * last range extends it. Returns false without memory. */
static bool add_removed(output *o, uint64_t first, uint64_t count)
{
    uint32_t row[2] = { (uint32_t)first, (uint32_t)count }, last[2];
    ebpo_attribute *a = &o->mesh->attributes->array[o->removed];
    if (count == 0)
        return true;
    o->report->removed_faces += count;
    if (a->rows) {
        uint8_t *before = a->values + (a->rows - 1) * sizeof last;
        memcpy(last, before, sizeof last);
        if (last[0] + last[1] == row[0]) {
            last[1] += row[1];
            memcpy(before, last, sizeof last);
            return true;
        }
    }
    if (!ebpo_attribute_reserve(o->mesh->workspace, a, a->rows + 1, 0))
        return false;
    memcpy(a->values + a->rows++ * sizeof row, row, sizeof row);
    return true;
}

/* Adds the ranges of removed faces among faces of the base that are not listed, [first, end). */
static bool add_unlisted(output *o, uint64_t first, uint64_t end)
{
    const ebpo_face_list *faces = o->cut->faces;
    if (!faces->base_differs)
        return faces->keeps_base || add_removed(o, first, end - first);
    bool added = true;
    for (uint64_t f = first; f < end && added; f++)
        added = faces->keeps_base != ebpo_has_bit(faces->base_differs, f) || add_removed(o, f, 1);
    return added;
}

/* Adds the triangles of the changed faces of the base (operand 0), and the ranges of removed faces.
 * A listed face is not changed if it is one triangle that bounds the result. */
static bool add_changes(operand_output *r)
{
    output *o = r->o;
    const ebpo_cut_mesh *cut = o->cut;
    const ebpo_face_list *faces = cut->faces;
    uint64_t t = first_triangle(r),
             after = 0; /* index in the file of the face after the last listed face */
    for (uint32_t f = faces->first[0]; f < faces->first[1]; f++) {
        uint64_t end = t;
        while (end < cut->count && cut->face[end] == f)
            end++;
        bool kept =
            end == t ? faces->keeps_base
                     : end - t == 1 && o->sign[t] > 0 &&
                           memcmp(cut->triangle[t], faces->face[f], sizeof cut->triangle[t]) == 0;
        uint64_t file_face = faces->file_face[f];
        if (!add_unlisted(o, after, file_face))
            return false;
        if (!kept && !add_removed(o, file_face, 1))
            return false;
        for (; t < end; t++)
            if (!kept && !add_triangle(r, (origin){ file_face, faces->base_source[f] }, t))
                return false;
        after = file_face + 1;
    }
    uint64_t all = faces->boolean->solid[0].model->info->face_count;
    return add_unlisted(o, after, all);
}

static ebpo_status read_maps(operand_output *r, ebpo_error *error)
{
    const ebpo_model *model = r->o->cut->faces->boolean->solid[r->operand].model;
    ebpo_read_options options = EBPO_READ_OPTIONS_INIT;
    ebpo_error cause = EBPO_ERROR_INIT;
    options.workspace = r->mesh.workspace;
    options.threads = r->o->cut->faces->boolean->threads;
    ebpo_status status = ebpo_file_read_maps(model->file, &options, &r->maps, &cause);
    return status == EBPO_OK || status == EBPO_E_ABSENT
               ? EBPO_OK
               : ebpo_fail_operand(model, r->operand, &cause, error);
}

static ebpo_status add_operand(output *o, uint32_t operand, ebpo_error *error)
{
    const ebpo_face_list *faces = o->cut->faces;
    operand_output r = { .o = o, .operand = operand };
    if (ebpo_face_list_is_base(faces, operand))
        return add_changes(&r) ? EBPO_OK : ebpo_fail_memory(error, 40 * o->rounded.count);
    ebpo_status status = ebpo_operand_mesh_read(&r.mesh, faces->boolean, operand,
                                                o->carrying.count > 0, faces->workspace, error);
    if (status != EBPO_OK)
        return status;
    uint64_t vertices = r.mesh.vertex_count;
    r.repeats = faces->whole[operand].repeats;
    r.number = ebpo_array_alloc(faces->workspace, vertices, sizeof *r.number);
    r.near = ebpo_alloc_zero(vertices / 64 + 1, sizeof *r.near);
    if (!r.number || !r.near)
        status = ebpo_workspace_fail(faces->workspace, 4 * vertices, error);
    if (status == EBPO_OK && r.repeats)
        status = ebpo_positions_build(&r.first, &r.mesh, faces->boolean->threads, NULL, error);
    if (status == EBPO_OK && o->operand)
        status = read_maps(&r, error);
    if (status == EBPO_OK) {
        ebpo_array_fill(faces->workspace, r.number, 0xff, vertices * sizeof *r.number);
        ebpo_carrying_operand(&o->carrying, &faces->boolean->solid[operand], &r.mesh);
        mark_near(&r);
        if (!add_faces(&r))
            status = ebpo_fail_memory(error, 40 * o->rounded.count);
    }
    ebpo_positions_free(&r.first);
    ebpo_maps_free(&r.maps);
    ebpo_array_free(faces->workspace, r.number);
    free(r.near);
    ebpo_mesh_free(&r.mesh);
    return status;
}

/* --- sizes --- */

/* Sets the sign of each component to the sign of a listed face of the component. */
static ebpo_status find_components(output *o, ebpo_error *error)
{
    const ebpo_face_list *faces = o->cut->faces;
    for (uint32_t i = 0; i < faces->boolean->count; i++) {
        o->component_sign[i] = ebpo_alloc_zero(faces->whole[i].components, 1);
        if (!o->component_sign[i])
            return ebpo_fail_memory(error, faces->whole[i].components);
    }
    for (uint64_t t = 0; t < o->cut->count; t++) {
        uint32_t face = o->cut->face[t], operand = ebpo_face_list_operand(faces, face),
                 component = ebpo_face_list_component(faces, operand, face);
        if (component != EBPO_NO_COMPONENT)
            o->component_sign[operand][component] = o->sign[t];
    }
    return EBPO_OK;
}

/* Returns the number of faces of an operand that are in the result and are not listed. If an
 * earlier operand is equal to this one, returns 0, because the faces are counted for the earlier
 * operand. */
static uint64_t count_whole(const output *o, uint32_t operand)
{
    const ebpo_face_list *faces = o->cut->faces;
    const ebpo_whole_faces *whole = &faces->whole[operand];
    uint64_t count = 0;
    if (!faces->equal[operand] || ebpo_face_list_is_base(faces, operand))
        return 0;
    EBPO_FOR_ITEMS(faces->workspace, f, 0, faces->boolean->solid[operand].model->info->face_count)
        count +=
            !ebpo_has_bit(whole->listed, f) && o->component_sign[operand][whole->component[f]] != 0;
    return count;
}

/* Floats have 24 bits. If an operand is farther from the origin than this number of its sizes,
 * floats would leave fewer than 14 bits for its shape. */
enum { FAR = 1 << 10 };

/* Returns true if an operand has coordinates beyond the range of floats, or is far from the origin,
 * for example because of its pose. Then floats cannot represent the result well. Half-spaces are
 * not tested, because the result is also in the box of the other operands. */
static bool exceeds_floats(const ebpo_face_list *faces)
{
    for (uint32_t i = 0; i < faces->boolean->first_plane; i++) {
        const double *box = faces->boolean->solid[i].box;
        double most = 0, size = 0;
        for (int k = 0; k < 3 && faces->equal[i]; k++) {
            most = fmax(most, fmax(fabs(box[k]), fabs(box[3 + k])));
            size = fmax(size, box[3 + k] - box[k]);
        }
        if (most > FLT_MAX || most > FAR * size)
            return true;
    }
    return false;
}

/* Returns true if an operand of the caller has doubles. */
static bool has_doubles(const ebpo_face_list *faces)
{
    for (uint32_t i = 0; i < faces->boolean->given; i++)
        if (faces->equal[i] && faces->boolean->solid[i].model->info->double_coordinates)
            return true;
    return false;
}

/* Adds an attribute with space for `rows` rows; returns NULL without memory. */
static uint8_t *add_array(ebpo_mesh *mesh, const char *element, const char *names,
                          ebpo_attribute_type type, uint64_t rows)
{
    ebpo_attribute like = { .type = type, .columns = 1 };
    for (const char *at = strchr(names, ' '); at; at = strchr(at + 1, ' '))
        like.columns++;
    like.list = EBPO_ATTRIBUTE_NO_LIST;
    memcpy(like.element, element, strlen(element) + 1);
    memcpy(like.names, names, strlen(names) + 1);
    ebpo_attribute *a = ebpo_attributes_add(mesh->attributes, &like);
    return a && ebpo_attribute_reserve(mesh->workspace, a, rows + 1, 0) ? a->values : NULL;
}

/* Adds the attributes of the mesh that describe the result. */
static ebpo_status add_own_attributes(output *o, const ebpo_boolean_mesh_options *options,
                                      uint64_t count, ebpo_error *error)
{
    ebpo_mesh *mesh = o->mesh;
    bool changed_only = o->cut->faces->changed_only, made = true;
    ebpo_status status = options->origins || options->colours || changed_only
                             ? ebpo_mesh_need_attributes(mesh, error)
                             : EBPO_OK;
    if (status != EBPO_OK)
        return status;
    if (changed_only) {
        o->removed = mesh->attributes->count;
        made = add_array(mesh, "removed", "first count", EBPO_ATTRIBUTE_UINT32, 0) != NULL;
    }
    if (options->origins) {
        o->operand = add_array(mesh, "face", "operand", EBPO_ATTRIBUTE_UINT8, count);
        o->operand_face = add_array(mesh, "face", "operand_face", EBPO_ATTRIBUTE_UINT32, count);
        made = made && o->operand && o->operand_face;
    }
    if (options->colours) {
        o->colour = add_array(mesh, "face", "red green blue", EBPO_ATTRIBUTE_UINT8, count);
        made = made && o->colour;
    }
    return made ? EBPO_OK : ebpo_workspace_fail(mesh->workspace, 8 * count, error);
}

/* Allocates the arrays of the mesh, also for an empty result, so that they have the right types. */
static ebpo_status make_arrays(output *o, const ebpo_boolean_mesh_options *options,
                               ebpo_error *error)
{
    const ebpo_face_list *faces = o->cut->faces;
    ebpo_mesh *mesh = o->mesh;
    uint64_t vertices = ebpo_cut_mesh_vertices(o->cut), count = 0;
    for (uint32_t i = 0; i < faces->boolean->count; i++) {
        uint64_t whole = count_whole(o, i);
        count += whole;
        if (whole)
            vertices += faces->boolean->solid[i].model->info->vertex_count;
    }
    for (uint64_t t = 0; t < o->cut->count; t++)
        count += o->sign[t] != 0;
    if (count > UINT32_MAX - 2 || vertices > UINT32_MAX - 2)
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "the result has more than 2^32 - 2 faces or vertices");
    mesh->faces = ebpo_array_alloc(mesh->workspace, count + 1, 3 * sizeof *mesh->faces);
    if (o->doubles)
        mesh->xyz64 = ebpo_array_alloc(mesh->workspace, vertices + 1, 3 * sizeof *mesh->xyz64);
    else
        mesh->xyz32 = ebpo_array_alloc(mesh->workspace, vertices + 1, 3 * sizeof *mesh->xyz32);
    if (!mesh->faces || (!mesh->xyz32 && !mesh->xyz64))
        return ebpo_workspace_fail(mesh->workspace, 12 * (count + vertices), error);
    ebpo_status status = add_own_attributes(o, options, count, error);
    if (status != EBPO_OK || !options->attributes)
        return status;
    return ebpo_carrying_begin(&o->carrying, faces->boolean, mesh, options->colours, vertices,
                               count, error);
}

static ebpo_status add_operands(output *o, const ebpo_progress *progress, ebpo_error *error)
{
    const ebpo_face_list *faces = o->cut->faces;
    ebpo_status status = EBPO_OK;
    for (uint32_t i = 0; i < faces->boolean->count && status == EBPO_OK; i++) {
        if (!ebpo_progress_step(progress, "join the result", i, faces->boolean->count, error))
            return EBPO_E_CANCELLED;
        if (faces->equal[i])
            status = add_operand(o, i, error);
    }
    return status;
}

ebpo_status ebpo_result_mesh_make(const ebpo_cut_mesh *cut, const int8_t *sign,
                                  const ebpo_boolean_mesh_options *options, ebpo_mesh *mesh,
                                  ebpo_boolean_mesh_report *report, ebpo_error *error)
{
    output o = { .cut = cut, .sign = sign, .report = report, .mesh = mesh };
    o.measures = options->volume;
    ebpo_volume_sum_begin(&o.volume);
    uint64_t vertices = ebpo_cut_mesh_vertices(cut);
    mesh->workspace = cut->faces->workspace;
    o.doubles = options->doubles || has_doubles(cut->faces) || exceeds_floats(cut->faces);
    o.number = ebpo_alloc(vertices, sizeof *o.number);
    ebpo_status status = o.number ? EBPO_OK : ebpo_fail_memory(error, 4 * vertices);
    for (uint64_t v = 0; v < vertices && o.number; v++)
        o.number[v] = NO_NUMBER;
    if (status == EBPO_OK)
        status = find_components(&o, error);
    if (status == EBPO_OK)
        status = make_arrays(&o, options, error);
    if (status == EBPO_OK)
        status = add_operands(&o, &options->progress, error);
    for (uint64_t i = 0; i < (mesh->attributes ? mesh->attributes->count : 0); i++)
        if (ebpo_attribute_is_of(&mesh->attributes->array[i], "face"))
            mesh->attributes->array[i].rows = mesh->face_count;
    ebpo_carrying_end(&o.carrying);
    ebpo_carrying_free(&o.carrying);
    if (status == EBPO_OK && o.measures)
        report->volume = ebpo_volume_sum_interval(&o.volume, &report->scaled, &report->exponent);
    ebpo_volume_sum_end(&o.volume);
    for (uint32_t i = 0; i < EBPO_BOOLEAN_OPERANDS_MAX; i++)
        free(o.component_sign[i]);
    free(o.number);
    free(o.of_rounded);
    ebpo_corner_ids_free(&o.rounded);
    return status;
}
