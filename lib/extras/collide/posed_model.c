#include "core/strict_fp.h"

#include <ebpo/collide.h>

#include "extras/collide/posed_model.h"

#include <math.h>
#include <string.h>

#include "core/fp_env.h"

void ebpo_model_reach(const ebpo_model *m, double reach[3])
{
    for (int k = 0; k < 3; k++) {
        double low = m->info->box_origin[k], high = low + m->info->box_size[k];
        reach[k] = fmax(fabs(low), fabs(high)) * (1 + 0x1p-50);
    }
}

double ebpo_posed_reach(const ebpo_posing *p, const double reach[3])
{
    double most = 0;
    for (int i = 0; i < 3; i++) {
        double size = fabs(p->translation[i]);
        for (int k = 0; k < 3; k++)
            size += fabs(p->matrix[i][k]) * reach[k];
        most = fmax(most, size);
    }
    return most * (1 + 0x1p-50);
}

ebpo_status ebpo_pose_check(const ebpo_model *model, const ebpo_pose *pose, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_posing posing;
    double reach[3];
    ebpo_model_reach(model, reach);
    return ebpo_posing_make(&posing, pose, reach, error);
}

bool ebpo_same_model(const ebpo_model *a, const ebpo_model *b)
{
    const ebpo_info *x = a->info, *y = b->info;
    return memcmp(x->content_sha256, y->content_sha256, sizeof x->content_sha256) == 0 &&
           x->solid == y->solid && x->rule == y->rule;
}
