/* A mesh made ready for building: mended as asked, in the order of the curve, checked. */
#include <string.h>

#include "construct/arrange.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "mesh/mesh_parts.h"

typedef struct preparation {
    ebpo_mesh *mesh;
    const ebpo_prepare_options *options;
    ebpo_prepared *out;
} preparation;

/* What is too large for an exact grid can be checked all the same; building says so again. */
static ebpo_status unless_too_large(ebpo_status status, const ebpo_error *local, ebpo_error *error)
{
    if (status == EBPO_OK || status == EBPO_E_LIMIT)
        return EBPO_OK;
    if (error)
        *error = *local;
    return status;
}

static ebpo_status mend(const preparation *p, bool weld, ebpo_error *error)
{
    const ebpo_prepare_options *o = p->options;
    unsigned steps = (weld ? EBPO_MEND_WELD : 0) | (o->orient ? EBPO_MEND_ORIENT : 0) |
                     (o->flip ? EBPO_MEND_FLIP : 0) | (o->fill_holes ? EBPO_MEND_FILL : 0) |
                     (o->drop_duplicates ? EBPO_MEND_DROP : 0);
    if (!ebpo_progress_stage(&o->progress, "mending", error))
        return EBPO_E_CANCELLED;
    return ebpo_mesh_mend(p->mesh, steps, o->weld_distance, &p->out->record, error);
}

/* In the order of the curve before anything else, so that each step goes through memory in order,
 * however little of it there is. */
static ebpo_status arrange_and_mend(const preparation *p, bool weld, ebpo_error *error)
{
    const ebpo_prepare_options *o = p->options;
    ebpo_error local = EBPO_ERROR_INIT;
    ebpo_status status = ebpo_arrange_to_mend(p->mesh, o->threads, &o->progress, &local);
    status = unless_too_large(status, &local, error);
    if (status == EBPO_OK)
        status = ebpo_mesh_check(p->mesh, o->threads, o->progress, &p->out->before, error);
    return status == EBPO_OK ? mend(p, weld, error) : status;
}

static ebpo_status prepare(const preparation *p, ebpo_error *error)
{
    const ebpo_prepare_options *o = p->options;
    /* STL has no shared vertices */
    bool weld = o->weld || o->weld_distance > 0 || strncmp(p->mesh->source_format, "stl", 3) == 0;
    ebpo_status status = EBPO_OK;
    if (!(o->weld_distance >= 0))
        return ebpo_fail(
            error, EBPO_E_ARGUMENT,
            "weld_distance has to be 0, which is for equal positions, or above, not %g",
            o->weld_distance);
    p->out->mended = weld || o->orient || o->flip || o->fill_holes || o->drop_duplicates;
    if (p->out->mended)
        status = arrange_and_mend(p, weld, error);
    if (status == EBPO_OK) {
        ebpo_error local = EBPO_ERROR_INIT;
        status = ebpo_arrange(p->mesh, -1, o->threads, &o->progress, &local);
        status = unless_too_large(status, &local, error);
    }
    if (status == EBPO_OK)
        status = ebpo_mesh_check(p->mesh, o->threads, o->progress, &p->out->report, error);
    if (status == EBPO_OK && !p->out->mended)
        p->out->before = p->out->report;
    return status;
}

ebpo_status ebpo_mesh_prepare(ebpo_mesh *mesh, const ebpo_prepare_options *options,
                              ebpo_prepared *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    static const ebpo_prepared nothing = EBPO_PREPARED_INIT;
    ebpo_prepare_options wanted = EBPO_PREPARE_OPTIONS_INIT;
    ebpo_prepared made = EBPO_PREPARED_INIT;
    preparation p = { mesh, &wanted, &made };
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_prepared, out, error);
    if (status == EBPO_OK)
        status = EBPO_TAKE(ebpo_prepare_options, &wanted, options, error);
    if (status == EBPO_OK)
        status = prepare(&p, error);
    EBPO_GIVE(ebpo_prepared, out, status == EBPO_OK ? &made : &nothing);
    return status;
}
