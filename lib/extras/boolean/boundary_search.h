/* How far it is to the other side: a search over cells of the world, the nearest first. */
#ifndef EBPO_BOOLEAN_BOUNDARY_SEARCH_H
#define EBPO_BOOLEAN_BOUNDARY_SEARCH_H

#include <math.h>

#include "extras/boolean/world_cell.h"

/* Right to some ulp, without overflow. */
static inline double ebpo_length(const double x[3])
{
    double most = fmax(fabs(x[0]), fmax(fabs(x[1]), fabs(x[2])));
    if (!(most > 0) || isinf(most))
        return most;
    double a = x[0] / most, b = x[1] / most, c = x[2] / most;
    return most * sqrt(a * a + b * b + c * c);
}

typedef struct ebpo_boundary_search {
    const ebpo_boolean *boolean;
    const double *point;
    unsigned side; /* EBPO_MAY_IN or EBPO_MAY_OUT: what is left behind */
    double tolerance;
    uint64_t most;  /* cells */
    uint64_t cells; /* is counted up */
    /* No point of the other side is nearer than lo for certain, one is at most hi away; hi: what is
     * known before. Both INFINITY: there is none. */
    double lo, hi;
} ebpo_boundary_search;

EBPO_MUST_USE ebpo_status ebpo_boundary_search_run(ebpo_boundary_search *s, ebpo_error *error);

#endif
