#include "core/strict_fp.h"

#include <limits.h>
#include <setjmp.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>

#include <libqhull_r/qhull_ra.h>

#include "core/alloc.h"
#include "core/error.h"
#include "derive/qhull.h"

struct ebpo_hull {
    FILE *silence; /* qhull explains at length what is wrong with flat sets */
    qhT qhull;
};

ebpo_status ebpo_hull_new(ebpo_hull **out, ebpo_error *error)
{
    ebpo_hull *hull = *out = ebpo_alloc_zero(1, sizeof *hull);
    if (!hull)
        return ebpo_fail_memory(error, sizeof *hull);
    hull->silence = fopen("/dev/null", "w");
    if (hull->silence)
        return EBPO_OK;
    free(hull);
    *out = NULL;
    return ebpo_fail(error, EBPO_E_IO, "/dev/null cannot be opened for qhull's messages");
}

void ebpo_hull_free(ebpo_hull *hull)
{
    if (hull && hull->silence)
        fclose(hull->silence);
    free(hull);
}

static double volume_by(ebpo_hull *hull, double *points, int count, char *command, bool *failed)
{
    qhT *qh = &hull->qhull;
    volatile double volume = 0; /* set between setjmp and a jump */
    volatile bool wrong = true;
    qh_zero(qh, hull->silence);
    if (qh_new_qhull(qh, 3, count, points, False, command, NULL, hull->silence) == 0) {
        if (setjmp(qh->errexit) == 0) { /* qhull's errors jump */
            qh->NOerrexit = False;
            qh_getarea(qh, qh->facet_list);
            volume = qh->totvol;
            wrong = false;
        }
        qh->NOerrexit = True;
    }
    int left, size;
    qh_freeqhull(qh, !qh_ALL);
    qh_memfreeshort(qh, &left, &size);
    *failed = wrong;
    return volume > 0 ? volume : 0;
}

double ebpo_hull_volume(ebpo_hull *hull, double *points, uint64_t count)
{
    static char merged[] = "qhull Qt Pp", joggled[] = "qhull QJ Pp";
    bool failed;
    if (count < 4 || count > INT_MAX / 3)
        return 0;
    double volume = volume_by(hull, points, (int)count, merged, &failed);
    /* Thin hulls whose facets merge into nothing: with points moved by some 1e-11 they have a
     * volume; flat ones have next to none then. */
    return failed ? volume_by(hull, points, (int)count, joggled, &failed) : volume;
}
