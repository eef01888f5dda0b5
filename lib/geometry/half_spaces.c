#include "core/strict_fp.h"

#include "geometry/half_spaces.h"

#include "geometry/plane_clip.h"

void ebpo_half_spaces_add(ebpo_half_spaces *s, const uint32_t *codes, uint64_t count)
{
    for (uint64_t i = 0; i < count && s->count < EBPO_HALF_SPACES_MAX; i++) {
        int32_t d;
        ebpo_half_space *next = &s->at[s->count];
        if (!ebpo_plane_code_decode(codes[i], next->n, &d))
            continue;
        next->d = d;
        s->count++;
    }
}

static bool keeps_cell(const ebpo_half_space *h)
{
    int64_t most = 0;
    for (int k = 0; k < 3; k++)
        most += h->n[k] > 0 ? h->n[k] : 0;
    return EBPO_OFFSET_STEPS * most <= h->d;
}

void ebpo_half_spaces_to_child(ebpo_half_spaces *s, unsigned octant)
{
    int kept = 0;
    for (int i = 0; i < s->count; i++) {
        ebpo_half_space h = s->at[i];
        h.d = ebpo_plane_to_child(h.n, h.d, octant);
        if (!keeps_cell(&h))
            s->at[kept++] = h;
    }
    s->count = kept;
}

void ebpo_half_spaces_cut(const ebpo_half_spaces *s, double slack, ebpo_polytope *out)
{
    ebpo_polytope_cube(out);
    for (int i = 0; i < s->count; i++) {
        double n[3], d = ebpo_plane_as_double(s->at[i].n, s->at[i].d, n);
        (void)ebpo_polytope_clip(out, n, d + slack, i);
    }
}
