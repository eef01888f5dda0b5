#include "core/strict_fp.h"

#include "construct/proposals.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "geometry/plane_code.h"

void ebpo_handover_free(ebpo_handover *h)
{
    free(h->offers);
    free(h->corner);
    memset(h, 0, sizeof *h);
}

void ebpo_proposals_free(ebpo_proposals *p)
{
    if (!p)
        return;
    if (!p->packed) {
        free(p->first);
        free(p->count);
        free(p->codes);
    }
    ebpo_handover_free(&p->root);
    free(p);
}

const uint32_t *ebpo_proposed(const ebpo_branch *s, uint32_t detail, int *count)
{
    static const uint32_t none[1];
    const ebpo_proposals *p = s->proposals;
    *count = 0;
    if (!p)
        return NULL;
    *count = p->count[detail];
    return *count ? p->codes + p->first[detail] : none;
}

bool ebpo_handover_add(ebpo_handover *h, uint32_t normal, double origin)
{
    if (!ebpo_grow(&h->offers, &h->offer_capacity, h->offer_count + 1, sizeof *h->offers))
        return false;
    h->offers[h->offer_count++] = (ebpo_offer){ normal, origin };
    return true;
}

bool ebpo_handover_gather(ebpo_handover *given, const ebpo_handover *child, unsigned octant)
{
    if (!ebpo_grow(&given->corner, &given->corner_capacity,
                   given->corner_count + child->corner_count, sizeof *given->corner))
        return false;
    for (uint64_t i = 0; i < child->corner_count; i++, given->corner_count++)
        for (int k = 0; k < 3; k++)
            given->corner[given->corner_count][k] = (child->corner[i][k] + (octant >> k & 1)) / 2;
    for (uint64_t i = 0; i < child->offer_count; i++) {
        int32_t n[3], d, shift = 0;
        ebpo_plane_code_decode(child->offers[i].normal, n, &d);
        for (int k = 0; k < 3; k++)
            shift += octant >> k & 1 ? n[k] : 0;
        if (!ebpo_handover_add(given, child->offers[i].normal,
                               (child->offers[i].origin + shift) / 2))
            return false;
    }
    return true;
}

bool ebpo_proposals_make(ebpo_branch *s)
{
    ebpo_proposals *p = s->proposals = ebpo_alloc_zero(1, sizeof *p);
    if (!p)
        return false;
    p->first = ebpo_alloc_zero(s->detail_count, sizeof *p->first);
    p->count = ebpo_alloc_zero(s->detail_count, 1);
    return p->first && p->count;
}
