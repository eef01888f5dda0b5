/* Makes the instances that a haptic session touches, and loads their faces.
 *
 * The faces of all instances are loaded into one box (face_box.h), in posed coordinates. A haptic
 * step does not distinguish instances, except to report them. So the guarantees of a step hold for
 * the posed faces of all instances together. The tree of the box needs faces in a spatial order, so
 * instances that are near each other are loaded one after the other. An object for a single model
 * has one instance that is not posed, so its coordinates stay as they are in the file. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "extras/haptic/haptic_parts.h"
#include "geometry/vec3.h"
#include "query/query_model.h"

/* Maximum number of nodes of all models that a probe keeps, except for the roots. */
enum { HELD_NODES = 1 << 17 };

/* Finds the entry of a model. Returns NULL if it has none. */
static ebpo_haptic_model *find_model(const ebpo_haptic *t, const ebpo_model *model)
{
    for (uint64_t i = 0; i < t->model_count; i++)
        if (t->models[i].model == model)
            return &t->models[i];
    return NULL;
}

static ebpo_status add_model(ebpo_haptic *t, ebpo_model *model, ebpo_error *error)
{
    ebpo_haptic_model *m = &t->models[t->model_count++];
    m->model = model;
    ebpo_status status = ebpo_context_new(model, &m->placing, error);
    if (status == EBPO_OK)
        status = ebpo_context_new(model, &m->loading, error);
    return status;
}

/* Reads the first levels of all models, which share the number of nodes. */
static ebpo_status read_levels(ebpo_haptic *t, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < t->model_count && status == EBPO_OK; i++)
        status = ebpo_held_levels_read(t->models[i].model->file, HELD_NODES / t->model_count,
                                       &t->models[i].levels, error);
    return status;
}

/* Sets the extent of an instance that is not posed: the root cell, widened by its rounding. */
static void set_cell(ebpo_haptic_part *part)
{
    const ebpo_info *info = ebpo_file_info(part->of->model->file);
    for (int i = 0; i < 3; i++) {
        double low = info->box_origin[i], high = low + info->box_size[i];
        double wider = 0x1p-50 * (fabs(low) + fabs(high)); /* rounding of low + high */
        part->extent.min[i] = low - wider;
        part->extent.max[i] = high + wider;
    }
}

static ebpo_status make_part(ebpo_haptic *t, const ebpo_haptic_instance *instance, bool posed,
                             ebpo_error *error)
{
    ebpo_haptic_part *part = &t->part[t->part_count];
    ebpo_status status = EBPO_OK;
    if (!find_model(t, instance->model))
        status = add_model(t, instance->model, error);
    part->of = find_model(t, instance->model);
    part->is_posed = posed;
    part->scale = 1;
    part->solid = ebpo_file_info(instance->model->file)->solid;
    part->probed_point.instance = (uint32_t)t->part_count++;
    if (status == EBPO_OK && posed)
        status = ebpo_posed_solid_make(&part->posed, instance->model, &instance->pose, error);
    if (status != EBPO_OK || !posed) {
        set_cell(part);
        return status;
    }
    part->scale = part->posed.posing.scale;
    ebpo_vec3_copy(part->posed.box, part->extent.min);
    ebpo_vec3_copy(part->posed.box + 3, part->extent.max);
    return EBPO_OK;
}

/* Bounds the rounding of the coordinates of an instance, and of points in its model. */
static double rounding_of(const ebpo_haptic_part *part)
{
    double slack = part->of->levels.slack;
    if (!part->is_posed)
        return slack;
    slack = slack * part->scale + part->posed.moved;
    for (int i = 0; i < 3; i++)
        slack += 0x1p-40 * fmax(fabs(part->extent.min[i]), fabs(part->extent.max[i]));
    return slack;
}

/* The position of an instance on a space-filling curve. */
typedef struct curve_place {
    uint64_t code;
    uint32_t part;
} curve_place;

static int compare_places(const void *a, const void *b)
{
    const curve_place *x = a, *y = b;
    if (x->code != y->code)
        return x->code < y->code ? -1 : 1;
    return (x->part > y->part) - (x->part < y->part);
}

static double middle_of(const ebpo_haptic_part *part, int axis)
{
    return part->extent.min[axis] / 2 + part->extent.max[axis] / 2;
}

/* Returns the Morton code of the middle of an instance; all middles are from `low` to `high`. */
static uint64_t curve_code(const ebpo_haptic_part *part, const double low[3], const double high[3])
{
    enum { BITS = 21 };
    uint64_t code = 0;
    for (int i = 0; i < 3; i++) {
        double size = high[i] - low[i];
        double share = size > 0 ? (middle_of(part, i) - low[i]) / size : 0;
        uint64_t cell = (uint64_t)(share * ((1 << BITS) - 1));
        for (int k = 0; k < BITS; k++)
            code |= (cell >> k & 1) << (3 * k + i);
    }
    return code;
}

/* Sets t->order. */
static ebpo_status sort_parts(ebpo_haptic *t, ebpo_error *error)
{
    double low[3], high[3];
    uint64_t count = t->part_count;
    curve_place *place = ebpo_alloc(count, sizeof *place);
    t->order = ebpo_alloc(count, sizeof *t->order);
    if (!place || !t->order) {
        free(place);
        return ebpo_fail_memory(error, count * (sizeof *place + sizeof *t->order));
    }
    for (int i = 0; i < 3; i++) {
        low[i] = high[i] = middle_of(&t->part[0], i);
        for (uint64_t k = 1; k < count; k++) {
            low[i] = fmin(low[i], middle_of(&t->part[k], i));
            high[i] = fmax(high[i], middle_of(&t->part[k], i));
        }
    }
    for (uint64_t k = 0; k < count; k++)
        place[k] = (curve_place){ curve_code(&t->part[k], low, high), (uint32_t)k };
    qsort(place, count, sizeof *place, compare_places);
    for (uint64_t k = 0; k < count; k++)
        t->order[k] = place[k].part;
    free(place);
    return EBPO_OK;
}

ebpo_status ebpo_haptic_parts_new(ebpo_haptic *t, const ebpo_haptic_instance *instances,
                                  uint64_t count, bool posed, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    if (count == 0 || count > UINT32_MAX)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "1 to 2^32 - 1 instances are expected");
    t->models = ebpo_alloc_zero(count, sizeof *t->models);
    t->part = ebpo_alloc_zero(count, sizeof *t->part);
    if (!t->models || !t->part)
        return ebpo_fail_memory(error, count * (sizeof *t->models + sizeof *t->part));
    for (int i = 0; i < 3 && t->options.kind == EBPO_HAPTIC_PROBE; i++) {
        t->known[i].side = ebpo_alloc_zero(count, sizeof *t->known[i].side);
        if (!t->known[i].side)
            return ebpo_fail_memory(error, count * sizeof *t->known[i].side);
    }
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++) {
        status = make_part(t, &instances[i], posed, error);
        t->slack = fmax(t->slack, rounding_of(&t->part[i]));
    }
    if (status == EBPO_OK && t->options.kind == EBPO_HAPTIC_PROBE)
        status = read_levels(t, error);
    return status == EBPO_OK ? sort_parts(t, error) : status;
}

void ebpo_haptic_parts_free(ebpo_haptic *t)
{
    for (uint64_t i = 0; i < t->model_count; i++) {
        ebpo_context_free(t->models[i].placing);
        ebpo_context_free(t->models[i].loading);
        ebpo_held_levels_free(&t->models[i].levels);
    }
    for (int i = 0; i < 3; i++)
        free(t->known[i].side);
    free(t->models);
    free(t->part);
    free(t->order);
}

void ebpo_haptic_part_point(const ebpo_haptic_part *part, const double w[3], double p[3],
                            double *uncertainty)
{
    *uncertainty = 0;
    if (part->is_posed)
        ebpo_unpose(&part->posed, w, p, uncertainty);
    else
        ebpo_vec3_copy(w, p);
}

double ebpo_haptic_part_gap(const ebpo_haptic_part *part, const double w[3])
{
    double off[3];
    for (int i = 0; i < 3; i++)
        off[i] = fmax(0, fmax(part->extent.min[i] - w[i], w[i] - part->extent.max[i]));
    return sqrt(ebpo_vec3_dot(off, off)) * (1 - 0x1p-48);
}

static bool extents_overlap(const ebpo_extent *a, const ebpo_extent *b)
{
    for (int i = 0; i < 3; i++)
        if (!(a->min[i] <= b->max[i] && a->max[i] >= b->min[i]))
            return false;
    return true;
}

ebpo_status ebpo_haptic_parts_load(ebpo_haptic *t, ebpo_face_box *box, const ebpo_extent *allowed,
                                   bool *fits, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    *fits = true;
    ebpo_face_box_begin(box, ++t->serial, allowed, t->margin);
    for (uint64_t i = 0; i < t->part_count && status == EBPO_OK && *fits; i++) {
        const ebpo_haptic_part *part = &t->part[t->order[i]];
        if (!part->is_posed || extents_overlap(&part->extent, &box->loaded))
            status = ebpo_face_box_add(box, part->of->loading, part->is_posed ? &part->posed : NULL,
                                       t->order[i], fits, error);
    }
    if (status == EBPO_OK && *fits)
        ebpo_face_box_end(box);
    return status;
}
