/* What a winding number means. */
#ifndef EBPO_GEOMETRY_RULE_H
#define EBPO_GEOMETRY_RULE_H

#include <ebpo/file.h>

/* True where points of this winding number belong to the solid. */
static inline bool ebpo_rule_inside(ebpo_rule rule, int32_t winding)
{
    switch (rule) {
    case EBPO_RULE_EVENODD: return winding & 1;
    case EBPO_RULE_POSITIVE: return winding > 0;
    case EBPO_RULE_NONZERO: break;
    }
    return winding != 0;
}

#endif
