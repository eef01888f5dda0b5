#include "core/strict_fp.h"

#include "geometry/cells.h"

bool ebpo_cells_touch(ebpo_cell a, ebpo_cell b)
{
    int fine = a.level > b.level ? a.level : b.level;
    for (int k = 0; k < 3; k++) {
        uint64_t a_low = (uint64_t)a.at[k] << (fine - a.level),
                 a_high = ((uint64_t)a.at[k] + 1) << (fine - a.level),
                 b_low = (uint64_t)b.at[k] << (fine - b.level),
                 b_high = ((uint64_t)b.at[k] + 1) << (fine - b.level);
        if (a_high < b_low || b_high < a_low)
            return false;
    }
    return true;
}

double ebpo_cell_volume(const ebpo_box *box, int level)
{
    double cells = (double)(1u << level);
    return box->size[0] / cells * (box->size[1] / cells) * (box->size[2] / cells);
}

bool ebpo_locator_decide(const ebpo_locator *l, const double p[3], ebpo_position *out)
{
    if (!ebpo_locate(&l->box, l->level, p, out->at))
        return false;
    for (int k = 0; k < 3; k++)
        out->cells[k] = (p[k] - l->box.origin[k]) / l->box.size[k] * (2 * l->half);
    return true;
}
