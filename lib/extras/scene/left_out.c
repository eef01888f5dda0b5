#include "core/strict_fp.h"

#include "extras/scene/left_out.h"

#include <math.h>
#include <string.h>

#include "core/error.h"
#include "geometry/pose.h"

/* of sums of a few products: far above their rounding */
static const double slack = 0x1p-44;

static const scene_model *model_of(const ebpo_scene *scene, uint64_t instance)
{
    return &scene->models[scene->instances[instance].as.model];
}

static ebpo_status posing_of(const ebpo_scene *scene, uint64_t instance, double time,
                             ebpo_posing *out, ebpo_error *error)
{
    const scene_model *m = model_of(scene, instance);
    double reach[3];
    ebpo_pose pose;
    for (int k = 0; k < 3; k++)
        reach[k] = fmax(fabs(m->min[k]), fabs(m->max[k]));
    ebpo_status status = ebpo_scene_pose(scene, instance, time, &pose, error);
    return status == EBPO_OK ? ebpo_posing_make(out, &pose, reach, error) : status;
}

/* Of the box of a model in the world: its middle, and half of it along each of its axes. */
typedef struct posed_box {
    double middle[3], half[3][3], size;
} posed_box;

static void pose_box(const ebpo_posing *p, const scene_model *m, posed_box *out)
{
    double middle[3];
    for (int k = 0; k < 3; k++)
        middle[k] = m->min[k] / 2 + m->max[k] / 2;
    ebpo_posing_apply(p, middle, out->middle);
    out->size = 0;
    for (int i = 0; i < 3; i++) {
        out->size += fabs(p->translation[i]);
        for (int k = 0; k < 3; k++) {
            double reach = fmax(fabs(m->min[k]), fabs(m->max[k]));
            out->half[k][i] = p->matrix[i][k] * (m->max[k] / 2 - m->min[k] / 2);
            out->size += fabs(p->matrix[i][k]) * reach;
        }
    }
}

ebpo_status scene_seen_from(const ebpo_scene *scene, uint64_t of, uint64_t other, double time,
                            scene_seen *out, ebpo_error *error)
{
    const scene_model *m = model_of(scene, of);
    ebpo_posing from, at;
    posed_box b;
    ebpo_status status = posing_of(scene, of, time, &from, error);
    if (status == EBPO_OK)
        status = posing_of(scene, other, time, &at, error);
    if (status != EBPO_OK)
        return status;
    pose_box(&at, model_of(scene, other), &b);
    double scale = from.scale, sizes = b.size, reach = 0;
    for (int i = 0; i < 3; i++) {
        sizes += fabs(from.translation[i]);
        reach += fmax(fabs(m->min[i]), fabs(m->max[i]));
    }
    /* the transposed matrix is the inverse but for the deviation, of points of the model's box */
    double off = (sizes + reach * scale) * slack / scale + 3 * from.deviation * reach;
    out->rounding = off;
    for (int k = 0; k < 3; k++) {
        double middle = 0, half = off;
        for (int i = 0; i < 3; i++)
            middle += from.matrix[i][k] / scale * ((b.middle[i] - from.translation[i]) / scale);
        for (int j = 0; j < 3; j++) {
            double sum = 0;
            for (int i = 0; i < 3; i++)
                sum += from.matrix[i][k] / scale * (b.half[j][i] / scale);
            half += fabs(sum);
        }
        out->box.min[k] = middle - half;
        out->box.max[k] = middle + half;
    }
    out->unit = scale * (1 - 2 * from.deviation);
    return EBPO_OK;
}

double scene_space_gap(const scene_space *a, const scene_space *b)
{
    double apart[3];
    for (int k = 0; k < 3; k++)
        apart[k] = fmax(fmax(a->min[k] - b->max[k], b->min[k] - a->max[k]), 0);
    return scene_length_above(apart) * (1 - 8 * slack);
}

/* The part of a model's box whose faces its file has; false: all. */
static bool held_box(const ebpo_scene *scene, uint64_t instance, scene_space *out)
{
    const ebpo_info *info =
        ebpo_file_info(ebpo_scene_file(scene, scene->instances[instance].as.model));
    bool mesh = info->parts & EBPO_PART_MESH;
    if (mesh && !info->pruned)
        return false;
    for (int k = 0; k < 3; k++) {
        bool box = mesh && info->boxed && !info->cut_levels && !(info->kept_error > 0);
        out->min[k] = box ? info->kept_box[k] : INFINITY;
        out->max[k] = box ? info->kept_box[3 + k] : -INFINITY;
    }
    return true;
}

/* Of `other` to what is in the box `all` and not in `held`: up to six boxes on its sides. */
static double gap_around(const scene_space *all, const scene_space *held, const scene_space *other)
{
    double gap = INFINITY;
    for (int k = 0; k < 3; k++) {
        scene_space side = *all;
        side.max[k] = fmin(held->min[k], all->max[k]);
        if (all->min[k] < held->min[k])
            gap = fmin(gap, scene_space_gap(&side, other));
        side = *all;
        side.min[k] = fmax(held->max[k], all->min[k]);
        if (all->max[k] > held->max[k])
            gap = fmin(gap, scene_space_gap(&side, other));
    }
    return gap;
}

static ebpo_status left_out_of(const ebpo_scene *scene, uint64_t of, uint64_t other, double time,
                               double *gap, ebpo_error *error)
{
    const scene_model *m = model_of(scene, of);
    scene_space held, all;
    scene_seen seen;
    *gap = INFINITY;
    if (!held_box(scene, of, &held))
        return EBPO_OK;
    memcpy(all.min, m->min, sizeof all.min);
    memcpy(all.max, m->max, sizeof all.max);
    ebpo_status status = scene_seen_from(scene, of, other, time, &seen, error);
    if (status == EBPO_OK)
        *gap = gap_around(&all, &held, &seen.box) * seen.unit;
    return status;
}

ebpo_status scene_left_out(const ebpo_scene *scene, const ebpo_scene_pair *pair, double time,
                           double *gap, uint64_t *lacking, ebpo_error *error)
{
    double of_a, of_b;
    ebpo_status status = left_out_of(scene, pair->a, pair->b, time, &of_a, error);
    if (status == EBPO_OK)
        status = left_out_of(scene, pair->b, pair->a, time, &of_b, error);
    if (status != EBPO_OK)
        return status;
    *gap = fmin(of_a, of_b);
    *lacking = of_a <= of_b ? pair->a : pair->b;
    return EBPO_OK;
}

ebpo_status scene_lacks(const ebpo_scene *scene, const ebpo_scene_pair *pair, uint64_t lacking,
                        double time, bool solids, ebpo_error *error)
{
    const scene_model *m = model_of(scene, lacking);
    return ebpo_fail(
        error, EBPO_E_ABSENT,
        "instances '%.80s' and '%.80s' at time %.9g: the file of model '%.80s' is a "
        "part of another or has no mesh, and what is not in it may matter; ask a scene "
        "with more of it%s",
        scene->instances[pair->a].as.name, scene->instances[pair->b].as.name, time, m->name,
        solids ? ", such as ebpo scene pack --solids makes" : "");
}
