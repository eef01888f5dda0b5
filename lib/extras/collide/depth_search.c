#include "core/strict_fp.h"

#include "extras/collide/depth_search.h"

#include <math.h>
#include <stdlib.h>

#include "core/parallel.h"
#include "extras/collide/depth_cells.h"

static ebpo_status search(ebpo_depth_search *s, ebpo_error *error)
{
    ebpo_status status = ebpo_depth_offer_cells(s, error);
    while (status == EBPO_OK && !ebpo_depth_is_done(s) && !ebpo_depth_is_late(s)) {
        if (s->asked % 64 == 0 && !ebpo_progress_step(s->progress, "depth", 0, 0, error))
            return EBPO_E_CANCELLED;
        status = ebpo_depth_divide_next(s, error);
    }
    return status;
}

ebpo_status ebpo_depth_search_run(ebpo_depth_search *s, ebpo_error *error)
{
    s->lost = 0x1p-46 * s->reach;
    s->lo = 0;
    ebpo_status status = search(s, error);
    s->hi = fmax(s->lo, s->left);
    if (s->count > 0)
        s->hi = fmax(s->hi, s->part[0].most);
    free(s->part);
    s->part = NULL;
    return status;
}
