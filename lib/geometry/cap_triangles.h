/* Makes the cap triangles of a closed loop of vertices, by halving.
 *
 * A stretch [i, j] of a loop is the path from position i to position j and the chord between them.
 * A stretch of more than one edge has the triangle (i, m, j), where m = i + (j - i) / 2. It also
 * has two halves, the stretches [i, m] and [m, j]. The whole loop of n vertices is the stretch [0,
 * n - 1], whose chord is the loop's last edge. It has n - 2 triangles. The boundary of these
 * triangles is the loop in its direction. The caps, which close a mesh, have the opposite
 * orientation. */
#ifndef EBPO_GEOMETRY_CAP_TRIANGLES_H
#define EBPO_GEOMETRY_CAP_TRIANGLES_H

#include <stdint.h>

static inline uint64_t ebpo_cap_middle(uint64_t i, uint64_t j) { return i + (j - i) / 2; }

/* Returns the number of triangles of the stretch [i, j]. */
static inline uint64_t ebpo_cap_count(uint64_t i, uint64_t j) { return j - i < 2 ? 0 : j - i - 1; }

/* Computes triangle t of the stretch [i, j], as positions in the loop. Triangles are numbered in
 * preorder: the stretch's triangle, the triangles of its first half, the triangles of its second
 * half. */
static inline void ebpo_cap_triangle(uint64_t i, uint64_t j, uint64_t t, uint64_t out[3])
{
    uint64_t m = ebpo_cap_middle(i, j);
    while (t > 0) {
        uint64_t first = ebpo_cap_count(i, m);
        if (t <= first) {
            j = m;
            t--;
        } else {
            i = m;
            t -= first + 1;
        }
        m = ebpo_cap_middle(i, j);
    }
    out[0] = i;
    out[1] = m;
    out[2] = j;
}

#endif
