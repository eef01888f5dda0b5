/* Computes winding numbers of points. The winding numbers of a solid are integers. The winding
 * number of a surface with holes is a real number; the functions return bounds of this number. */
#include "core/strict_fp.h"

#include <math.h>

#include "core/error.h"
#include "core/fp_env.h"
#include "query/query_model.h"

ebpo_status ebpo_winding(ebpo_context *context, const double *points, uint64_t count, double width,
                         ebpo_winding_bounds *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    const ebpo_winding_bounds none = { NAN, NAN };
    const ebpo_model *m = context->model;
    ebpo_status status = ebpo_check_points(points, count, error);
    if (status == EBPO_OK && !(width >= 0))
        status = ebpo_fail(error, EBPO_E_ARGUMENT, "width %g is invalid; give 0 or more", width);
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++) {
        ebpo_bounded w = { 0, 0 };
        bool apart = true; /* the point is on no face */
        ebpo_inside_result r;
        /* For a surface, r.winding becomes the winding number of the closed mesh of surface and
         * caps. */
        context->undecided = m->holes != NULL;
        status = ebpo_inside(context, points + 3 * i, NULL, &r, error);
        context->undecided = false;
        apart = status == EBPO_OK && r.where != EBPO_ON;
        w.middle = apart ? r.winding : 0;
        if (apart && m->holes)
            w = ebpo_cap_winding(&m->holes->caps, points + 3 * i, r.winding, width);
        out[i] = apart ? (ebpo_winding_bounds){ w.middle - w.error, w.middle + w.error } : none;
    }
    return status;
}
