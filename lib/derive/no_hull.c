#include "core/strict_fp.h"

#include "core/error.h"
#include "derive/qhull.h"

ebpo_status ebpo_hull_new(ebpo_hull **out, ebpo_error *error)
{
    *out = NULL;
    return ebpo_fail(error, EBPO_E_ABSENT,
                     "this library was built without qhull, so it cannot compute convex hulls; "
                     "build it with -Dqhull=enabled");
}

void ebpo_hull_free(ebpo_hull *hull) { (void)hull; }

double ebpo_hull_volume(ebpo_hull *hull, double *points, uint64_t count)
{
    (void)hull, (void)points, (void)count;
    return 0;
}
