/* Prepares a mesh for building, and finds repairs that make it a solid.
 *
 * ebpo_mesh_prepare first sorts the mesh along the Morton curve (arrange.h), so that each later
 * step accesses memory in order. Then it checks the mesh, repairs it as the options request, sorts
 * it again and checks it again. A mesh with coordinates beyond 2^1000 cannot be sorted. It is
 * checked without sorting, and later ebpo_build rejects it.
 *
 * ebpo_mesh_try_repairs applies sequences of repairs to copies of the mesh, shorter sequences
 * first, until one of the results is a solid without doubts. Doubts are reasons why a solid may
 * differ from the author's intention. There are three: much of the surface was made by filling
 * holes; the volume is negative; the volume is very small for the area (a sheet). */
#include "core/strict_fp.h"

#include <ebpo/repair.h>
#include <float.h>
#include <math.h>
#include <string.h>

#include "construct/arrange.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "mesh/mesh_parts.h"

/* --- preparing --- */

typedef struct preparation {
    ebpo_mesh *mesh;
    const ebpo_prepare_options *options;
    ebpo_prepared *out;
} preparation;

/* Returns EBPO_OK if `status` is EBPO_E_LIMIT, the error of sorting for coordinates beyond 2^1000,
 * because the mesh can still be checked. (ebpo_build returns EBPO_E_LIMIT again.) Copies any other
 * error from *local to *error, and returns `status`. */
static ebpo_status accept_too_large(ebpo_status status, const ebpo_error *local, ebpo_error *error)
{
    if (status == EBPO_OK || status == EBPO_E_LIMIT)
        return EBPO_OK;
    if (error)
        *error = *local;
    return status;
}

/* Applies the repairs that the options request. If `weld` is true, also welds vertices. */
static ebpo_status repair_as_requested(const preparation *p, bool weld, ebpo_error *error)
{
    const ebpo_prepare_options *o = p->options;
    unsigned steps = (weld ? EBPO_REPAIR_WELD : 0) | (o->orient ? EBPO_REPAIR_ORIENT : 0) |
                     (o->flip ? EBPO_REPAIR_FLIP : 0) | (o->fill_holes ? EBPO_REPAIR_FILL : 0) |
                     (o->drop_duplicates ? EBPO_REPAIR_DROP : 0);
    if (!ebpo_progress_stage(&o->progress, "repairing", error))
        return EBPO_E_CANCELLED;
    return ebpo_mesh_repair(p->mesh, steps, o->weld_distance, &p->out->record, error);
}

/* Sorts along the curve, checks and repairs. Sorting comes first, because checking and repairing
 * are slow in a workspace with little memory if they do not access memory in order. */
static ebpo_status arrange_and_repair(const preparation *p, bool weld, ebpo_error *error)
{
    const ebpo_prepare_options *o = p->options;
    ebpo_error local = EBPO_ERROR_INIT;
    ebpo_status status = ebpo_arrange_to_repair(p->mesh, o->threads, &o->progress, &local);
    status = accept_too_large(status, &local, error);
    if (status == EBPO_OK)
        status = ebpo_mesh_check(p->mesh, o->threads, o->progress, &p->out->before, error);
    return status == EBPO_OK ? repair_as_requested(p, weld, error) : status;
}

static ebpo_status prepare_in_order(const preparation *p, ebpo_error *error)
{
    const ebpo_prepare_options *o = p->options;
    /* faces of an STL file share no vertices, so its vertices are always welded */
    bool weld = o->weld || o->weld_distance > 0 || strncmp(p->mesh->source_format, "stl", 3) == 0;
    ebpo_status status = EBPO_OK;
    if (!(o->weld_distance >= 0))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "invalid weld_distance %g; give 0 (equal positions) or more",
                         o->weld_distance);
    p->out->was_repaired = weld || o->orient || o->flip || o->fill_holes || o->drop_duplicates;
    if (p->out->was_repaired)
        status = arrange_and_repair(p, weld, error);
    if (status == EBPO_OK) {
        ebpo_error local = EBPO_ERROR_INIT;
        status = ebpo_arrange(p->mesh, -1, o->threads, &o->progress, &local);
        status = accept_too_large(status, &local, error);
    }
    if (status == EBPO_OK)
        status = ebpo_mesh_check(p->mesh, o->threads, o->progress, &p->out->report, error);
    if (status == EBPO_OK && !p->out->was_repaired)
        p->out->before = p->out->report;
    return status;
}

ebpo_status ebpo_mesh_prepare(ebpo_mesh *mesh, const ebpo_prepare_options *options,
                              ebpo_prepared *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    static const ebpo_prepared none = EBPO_PREPARED_INIT;
    ebpo_prepare_options wanted = EBPO_PREPARE_OPTIONS_INIT;
    ebpo_prepared made = EBPO_PREPARED_INIT;
    preparation p = { mesh, &wanted, &made };
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_prepared, out, error);
    if (status == EBPO_OK)
        status = EBPO_TAKE(ebpo_prepare_options, &wanted, options, error);
    if (status == EBPO_OK)
        status = prepare_in_order(&p, error);
    EBPO_GIVE(ebpo_prepared, out, status == EBPO_OK ? &made : &none);
    return status;
}

/* --- trying repairs: types --- */

enum {
    WELD = EBPO_REPAIR_WELD,
    ORIENT = EBPO_REPAIR_ORIENT,
    FILL = EBPO_REPAIR_FILL,
    DROP = EBPO_REPAIR_DROP
};

/* A mesh counts as a sheet if the cube root of its volume is at most this factor times the square
 * root of its area. */
static const double THIN = 0.01;

typedef struct trying {
    const ebpo_mesh *mesh;
    const ebpo_mesh_report *given; /* report on `mesh` */
    unsigned threads;
    const ebpo_progress *progress;
    ebpo_repairs *out;
} trying;

/* --- doubts about a result --- */

/* Returns true if more than half of the edges were boundary edges before holes were filled.
 * `report` is about the filled mesh. The counts for the unfilled mesh follow from it, because
 * filling a loop of n boundary edges adds n - 2 faces and n - 3 edges. */
static bool mostly_open(const ebpo_mesh_report *report, const ebpo_repair_record *record)
{
    uint64_t boundary = record->added_faces + 2 * record->filled_holes;
    uint64_t before = report->edges - (record->added_faces - record->filled_holes);
    return 2 * boundary > before;
}

/* Returns the doubts caused by filled holes. `area`: area before the repair; 0: unknown. */
static uint32_t doubts_of_filling(double area, const ebpo_mesh_report *report,
                                  const ebpo_repair_record *record)
{
    uint32_t doubts = 0;
    if (!record || !record->filled_holes)
        return 0;
    if (!record->weld && report->repeated_positions.count)
        doubts |= EBPO_DOUBT_UNWELDED;
    if (mostly_open(report, record))
        doubts |= EBPO_DOUBT_MOSTLY_OPEN;
    /* tests if the area of the filled holes is at least the area of the given surface, except for
     * rounding errors */
    if (area > 0 && report->area - area >= area * 0.999999)
        doubts |= EBPO_DOUBT_MOSTLY_FILLED;
    return doubts;
}

/* Returns EBPO_DOUBT_NO_VOLUME for a sheet, EBPO_DOUBT_INSIDE_OUT for a negative volume, and
 * otherwise 0. If coordinates are extremely large or small, volume and area overflow or underflow,
 * but the volume keeps its sign. With such coordinates, only a mesh without extent along an axis
 * counts as a sheet. */
static uint32_t doubts_of_volume(const ebpo_mesh_report *report)
{
    /* coordinates are extreme if the binary exponents of the extents along the three axes have a
     * sum beyond this limit */
    enum { EXTREME = 1000 };
    int exponent[3], sum = 0;
    bool flat = false;
    for (int k = 0; k < 3; k++) {
        double extent = report->max[k] - report->min[k];
        flat |= extent == 0;
        frexp(isfinite(extent) ? extent : DBL_MAX, &exponent[k]);
        sum += exponent[k];
    }
    bool extreme = sum > EXTREME || sum < -EXTREME;
    if (flat || (!extreme && cbrt(fabs(report->volume)) <= THIN * sqrt(report->area)))
        return EBPO_DOUBT_NO_VOLUME;
    return signbit(report->volume) ? EBPO_DOUBT_INSIDE_OUT : 0;
}

uint32_t ebpo_mesh_doubts(double area, const ebpo_mesh_report *report,
                          const ebpo_repair_record *record)
{
    EBPO_DEFAULT_FP;
    uint32_t doubts = doubts_of_filling(area, report, record);
    if (!report->balanced)
        return doubts | EBPO_DOUBT_OPEN;
    return doubts | doubts_of_volume(report);
}

/* --- sequences of repairs --- */

/* Applies `steps` to a copy of the mesh, and adds the result to the list of tries. */
static ebpo_status try_steps(trying *t, unsigned steps, ebpo_error *error)
{
    static const ebpo_progress silent;
    ebpo_repair_try *result = &t->out->tries[t->out->count];
    ebpo_mesh copy;
    if (!ebpo_progress_stage(t->progress, "trying repairs", error))
        return EBPO_E_CANCELLED;
    ebpo_status status = ebpo_mesh_copy(t->mesh, &copy, error);
    if (status != EBPO_OK)
        return status;
    result->steps = steps;
    status = ebpo_mesh_repair(&copy, steps, 0, &result->record, error);
    if (status == EBPO_OK)
        status = ebpo_mesh_check(&copy, t->threads, silent, &result->report, error);
    ebpo_mesh_free(&copy);
    if (status != EBPO_OK)
        return status;
    result->doubts = ebpo_mesh_doubts(t->given->area, &result->report, &result->record);
    if (result->doubts == 0)
        t->out->chosen = (int64_t)t->out->count;
    t->out->count++;
    return EBPO_OK;
}

/* Returns true if the repairs `steps` may make a solid of a mesh whose report is `base`. */
static bool may_help(const ebpo_mesh_report *base, unsigned steps)
{
    bool open = base->boundary_edges.count > 0;
    bool turned = base->misoriented_edges.count || base->nonmanifold_edges.count ||
                  (ebpo_mesh_doubts(0, base, NULL) & ~(uint32_t)EBPO_DOUBT_OPEN);
    if (open != !!(steps & FILL))
        return false;
    return !(steps & ORIENT) || turned || open;
}

/* The beginning of a sequence of repairs: its steps, and the report on the mesh after these steps.
 */
typedef struct start {
    unsigned steps;
    const ebpo_mesh_report *report; /* NULL: the steps were not tried */
} start;

/* Tries from.steps followed by the steps `more`. Does nothing if a sequence is already chosen, or
 * if `more` cannot make a solid. */
static ebpo_status try_more(trying *t, start from, unsigned more, ebpo_error *error)
{
    if (t->out->chosen >= 0 || !from.report || !may_help(from.report, more))
        return EBPO_OK;
    return try_steps(t, from.steps | more, error);
}

/* Tries from.steps followed by `step`, and sets *then to the start for further steps. */
static ebpo_status begin_with(trying *t, start from, unsigned step, start *then, ebpo_error *error)
{
    if (t->out->chosen >= 0)
        return EBPO_OK;
    *then = (start){ from.steps | step, &t->out->tries[t->out->count].report };
    return try_steps(t, then->steps, error);
}

/* Tries to drop repeated faces, if there are any, and sets *then to the start for further steps. */
static ebpo_status drop_repeated(trying *t, start from, start *then, ebpo_error *error)
{
    return from.report->repeated_faces.count ? begin_with(t, from, DROP, then, error) : EBPO_OK;
}

/* If vertices have equal positions, first tries short sequences without welding. Then sets *from to
 * the welded mesh, with which all further sequences start. */
static ebpo_status weld_first(trying *t, start *from, ebpo_error *error)
{
    start bare = *from, dropped = { 0, NULL };
    if (!bare.report->repeated_positions.count)
        return EBPO_OK;
    ebpo_status status = try_more(t, bare, ORIENT, error);
    if (status == EBPO_OK)
        status = drop_repeated(t, bare, &dropped, error);
    if (status == EBPO_OK)
        status = begin_with(t, bare, WELD, from, error);
    return status == EBPO_OK ? try_more(t, dropped, ORIENT, error) : status;
}

/* Tries all sequences, shorter ones first. */
static ebpo_status try_all(trying *t, ebpo_error *error)
{
    start plain = { 0, t->given }, dropped = { 0, NULL };
    ebpo_status status = weld_first(t, &plain, error);
    if (status == EBPO_OK)
        status = try_more(t, plain, ORIENT, error);
    if (status == EBPO_OK)
        status = try_more(t, plain, FILL, error);
    if (status == EBPO_OK)
        status = drop_repeated(t, plain, &dropped, error);
    if (status == EBPO_OK)
        status = try_more(t, dropped, ORIENT, error);
    if (status == EBPO_OK)
        status = try_more(t, dropped, FILL, error);
    if (status == EBPO_OK)
        status = try_more(t, plain, ORIENT | FILL, error);
    return status == EBPO_OK ? try_more(t, dropped, ORIENT | FILL, error) : status;
}

/* Tries to drop the repeated faces of a solid without doubts. The result is only reported; no
 * repair is chosen. */
static ebpo_status try_dropping(trying *t, ebpo_error *error)
{
    ebpo_status status = try_steps(t, DROP, error);
    t->out->chosen = -1;
    return status;
}

ebpo_status ebpo_mesh_try_repairs(const ebpo_mesh *mesh, const ebpo_mesh_report *report,
                                  unsigned threads, ebpo_progress progress, ebpo_repairs *out,
                                  ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    static const ebpo_repairs none = { .struct_size = sizeof none, .chosen = -1 };
    ebpo_repairs made = none;
    trying t = { mesh, report, threads, &progress, &made };
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_repairs, out, error);
    if (status == EBPO_OK)
        status = ebpo_mesh_check_shape(mesh, error);
    if (status == EBPO_OK && ebpo_mesh_doubts(0, report, NULL))
        status = try_all(&t, error);
    else if (status == EBPO_OK && report->repeated_faces.count)
        status = try_dropping(&t, error);
    EBPO_GIVE(ebpo_repairs, out, status == EBPO_OK ? &made : &none);
    return status;
}
