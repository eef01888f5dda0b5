/* Which faces a stroke reaches, and which of their corners it covers; whether points fit a model.
 */
#include "core/strict_fp.h"

#include <ebpo/paint.h>

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "extras/paint/met_faces.h"
#include "extras/paint/paint_parts.h"
#include "extras/paint/paint_reach.h"
#include "query/query_model.h"

static int by_file_face(const void *a, const void *b)
{
    const ebpo_met_face *x = a, *y = b;
    return (x->file_face > y->file_face) - (x->file_face < y->file_face);
}

static ebpo_status add_point(ebpo_met_faces *met, ebpo_reach *reach, ebpo_error *error)
{
    for (uint64_t i = 0; i < reach->count; i++) {
        const ebpo_reach_face *f = &reach->face[i];
        uint32_t number;
        ebpo_status status = ebpo_met_faces_add(met, f, &number, error);
        if (status != EBPO_OK)
            return status;
        for (int k = 0; k < 3; k++)
            met->face[number].covered[k] |= f->within[k];
    }
    return EBPO_OK;
}

static void give(const ebpo_met_faces *met, ebpo_paint_face_fn take, void *user)
{
    qsort(met->face, met->count, sizeof *met->face, by_file_face);
    for (uint64_t i = 0; i < met->count; i++) {
        const ebpo_met_face *f = &met->face[i];
        ebpo_paint_face out = { .face = f->face, .file_face = f->file_face };
        memcpy(out.corner, f->corner, sizeof out.corner);
        for (int k = 0; k < 3; k++)
            out.covered[k] = f->covered[k];
        if (!take(user, &out))
            return;
    }
}

ebpo_status ebpo_paint_cover(const ebpo_paint *p, ebpo_context *context, uint64_t stroke,
                             ebpo_paint_face_fn take, void *user, uint64_t *elsewhere,
                             ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_met_faces met = { 0 };
    ebpo_reach reach;
    uint64_t absent = 0;
    ebpo_status status = ebpo_paint_check_context(p, context, error);
    if (status == EBPO_OK && stroke >= p->stroke_count)
        status = ebpo_fail(error, EBPO_E_ARGUMENT, "there is no stroke %llu",
                           (unsigned long long)stroke);
    if (status != EBPO_OK)
        return status;
    ebpo_reach_begin(&reach, context);
    for (uint32_t i = 0; i < p->stroke[stroke].count && status == EBPO_OK; i++) {
        bool here;
        status = ebpo_paint_reach(&reach, p, stroke, i, &here, error);
        if (status == EBPO_OK && here)
            status = add_point(&met, &reach, error);
        absent += status == EBPO_OK && !here;
    }
    ebpo_reach_end(&reach);
    if (status == EBPO_OK && elsewhere)
        *elsewhere = absent;
    if (status == EBPO_OK)
        give(&met, take, user);
    ebpo_met_faces_free(&met);
    return status;
}

/* --- all points --- */

static ebpo_status check_point(ebpo_reach *reach, const ebpo_paint_point *q, const char *what,
                               uint64_t number, ebpo_error *error)
{
    bool fits;
    ebpo_status status = ebpo_reach_check(reach, q->place, q->face, &fits, error);
    return status != EBPO_OK || fits
               ? status
               : ebpo_fail_file(
                     error, EBPO_E_FORMAT, reach->context->model->file->in.shown,
                     "%s %llu of the paint is not on face %lu, where it says to be: the "
                     "paint does not fit the model; give the one that it was made on, or "
                     "remove that %s without naming a model",
                     what, (unsigned long long)number, (unsigned long)q->face, what);
}

ebpo_status ebpo_paint_check_points(const ebpo_paint *p, ebpo_context *context,
                                    const ebpo_progress *progress, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    enum { STEP = 1024 };
    ebpo_reach reach;
    uint64_t done = 0;
    ebpo_status status = ebpo_paint_check_context(p, context, error);
    if (status != EBPO_OK)
        return status;
    ebpo_reach_begin(&reach, context);
    for (uint64_t i = 0; i < p->stroke_count && status == EBPO_OK; i++)
        for (uint32_t k = 0; k < p->stroke[i].count && status == EBPO_OK; k++, done++) {
            if (done % STEP == 0 &&
                !ebpo_progress_step(progress, "checking", done, p->point_count, error))
                status = EBPO_E_CANCELLED;
            else
                status = check_point(&reach, &p->point[p->stroke[i].first + k], "stroke", i, error);
        }
    for (uint64_t i = 0; i < p->note_count && status == EBPO_OK; i++)
        status = check_point(&reach, &p->note[i].at, "note", i, error);
    ebpo_reach_end(&reach);
    return status;
}
