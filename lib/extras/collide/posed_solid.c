/* Points of the world asked of models; bounds: docs/develop/booleans.md. */
#include "core/strict_fp.h"

#include "extras/collide/posed_solid.h"

#include <math.h>
#include <string.h>

#include "core/error.h"
#include "extras/collide/posed_model.h"
#include "query/query_model.h"

/* More than the roundings of a bound's own computation. */
static const double more = 1 + 0x1p-40;

static void bound_box(ebpo_posed_solid *s)
{
    const ebpo_info *info = s->model->info;
    for (int i = 0; i < 3; i++) {
        double low = s->posing.translation[i], high = low, size = fabs(low);
        for (int k = 0; k < 3; k++) {
            double a = info->box_origin[k], b = a + info->box_size[k], m = s->posing.matrix[i][k];
            low += fmin(m * a, m * b);
            high += fmax(m * a, m * b);
            size += fmax(fabs(m * a), fabs(m * b));
        }
        double rounding = 16 * 0x1p-53 * size + 0x1p-1070;
        s->box[i] = low - rounding;
        s->box[3 + i] = high + rounding;
    }
}

ebpo_status ebpo_posed_solid_make(ebpo_posed_solid *out, ebpo_model *model, const ebpo_pose *pose,
                                  ebpo_error *error)
{
    double reach[3];
    *out = (ebpo_posed_solid){ .model = model };
    memcpy(out->rotation, pose->rotation, sizeof out->rotation);
    ebpo_model_reach(model, reach);
    ebpo_status status = ebpo_check_mesh(model, error);
    if (status == EBPO_OK)
        status = ebpo_posing_make(&out->posing, pose, reach, error);
    if (status != EBPO_OK)
        return status;
    /* reach is at most 2^1000: no sum overflows; 1.7321 is more than the root of 3 */
    out->moved = 1.7321 * ebpo_posing_error(&out->posing, (reach[0] + reach[1] + reach[2]) * more);
    bound_box(out);
    if (!(out->moved / out->posing.scale <= 0x1p990))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "pose: the model is too small for where it is: rounding moves it by %.3g "
                         "of its own units",
                         out->moved / out->posing.scale);
    return EBPO_OK;
}

bool ebpo_posed_solid_near(const ebpo_posed_solid *s, const double w[3], double margin)
{
    for (int k = 0; k < 3; k++)
        if ((s->box[k] - w[k]) * (1 - 0x1p-50) > margin ||
            (w[k] - s->box[3 + k]) * (1 - 0x1p-50) > margin)
            return false;
    return true;
}

void ebpo_unpose(const ebpo_posed_solid *s, const double w[3], double p[3], double *doubt)
{
    double y[3], length = 0, scale = s->posing.scale;
    for (int i = 0; i < 3; i++) {
        y[i] = w[i] - s->posing.translation[i];
        length += fabs(y[i]);
    }
    for (int k = 0; k < 3; k++)
        p[k] = ((s->rotation[0][k] * y[0] + s->rotation[1][k] * y[1]) + s->rotation[2][k] * y[2]) /
               scale;
    double far = s->moved + length * (2 * s->posing.deviation + 8 * 0x1p-53) + 0x1p-1060;
    *doubt = far / scale * more + 0x1p-1060;
}

void ebpo_unpose_box(const ebpo_posed_solid *s, const double a[3], const double b[3], double low[3],
                     double high[3])
{
    double middle[3], half[3], all = 0, p[3], doubt;
    for (int k = 0; k < 3; k++) {
        middle[k] = a[k] / 2 + b[k] / 2;
        half[k] = fmax(fabs(a[k] - middle[k]), fabs(b[k] - middle[k])) * (1 + 0x1p-50);
        all += half[k];
    }
    ebpo_unpose(s, middle, p, &doubt);
    for (int k = 0; k < 3; k++) {
        double reach = 2 * s->posing.deviation * all;
        for (int i = 0; i < 3; i++)
            reach += fabs(s->rotation[i][k]) * half[i];
        reach = reach / s->posing.scale * (1 + 0x1p-40) + doubt;
        low[k] = nextafter(p[k] - reach, -INFINITY);
        high[k] = nextafter(p[k] + reach, INFINITY);
    }
}

ebpo_status ebpo_posed_solid_clear(ebpo_context *context, const double p[3], double doubt,
                                   bool *clear, ebpo_error *error)
{
    double low[3], high[3];
    const uint64_t *faces;
    uint64_t count;
    for (int k = 0; k < 3; k++) {
        low[k] = nextafter(p[k] - doubt, -INFINITY);
        high[k] = nextafter(p[k] + doubt, INFINITY);
    }
    ebpo_status status = ebpo_faces_in_box(context, low, high, &faces, &count, error);
    *clear = status == EBPO_OK && count == 0;
    return status;
}
