#include <limits.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>

#include <libqhull_r/qhull_ra.h>

#include "base/alloc.h"
#include "base/error.h"
#include "limit/hull.h"

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

double ebpo_hull_volume(ebpo_hull *hull, double *points, uint64_t count)
{
    static char command[] = "qhull Pp";
    qhT *qh = &hull->qhull;
    volatile double volume = 0; /* set between setjmp and a jump */
    if (count < 4 || count > INT_MAX / 3)
        return 0;
    qh_zero(qh, hull->silence);
    if (qh_new_qhull(qh, 3, (int)count, points, False, command, NULL, hull->silence) == 0) {
        int failed = setjmp(qh->errexit); /* qhull's errors jump */
        qh->NOerrexit = False;
        if (!failed) {
            qh_getarea(qh, qh->facet_list);
            volume = qh->totvol;
        }
        qh->NOerrexit = True;
    }
    int left, size;
    qh_freeqhull(qh, !qh_ALL);
    qh_memfreeshort(qh, &left, &size);
    return volume > 0 ? volume : 0;
}
