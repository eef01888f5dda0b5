/* Corners in the order of their coordinates: x, then y, then z. */
#ifndef EBPO_GEOMETRY_CORNER_ORDER_H
#define EBPO_GEOMETRY_CORNER_ORDER_H

static inline int ebpo_corner_order(const double p[3], const double q[3])
{
    for (int k = 0; k < 3; k++)
        if (p[k] != q[k])
            return p[k] < q[k] ? -1 : 1;
    return 0;
}

#endif
