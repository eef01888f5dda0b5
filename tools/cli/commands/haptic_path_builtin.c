/* Simulates a haptic device. The device moves around the longest axis of the model in 8 seconds. At
 * the same time it moves slowly up and down along the axis, and into the surface and out of it.
 * Rays find the surface in advance. */
#include <math.h>
#include <stdlib.h>

#include "cli/commands/haptic_device.h"

/* Numbers of angles and of heights at which rays measure the surface. */
enum { ANGLES = 64, HEIGHTS = 17 };

static const double pi = 3.141592653589793;

typedef struct builtin_path {
    double rate;               /* steps per second */
    double clearance;          /* radius of the tool, as a share of the shortest side of the box */
    double origin[3], size[3]; /* the box of the model */
    int up;                    /* the longest axis of the box */
    /* distance of the surface from the middle axis of the box, as a share of the box's sides; 0.1
     * if the ray hits nothing */
    double hit[HEIGHTS][ANGLES];
} builtin_path;

/* Computes a point from cylindrical coordinates: the angle around the middle axis of the box, the
 * height along this axis (-0.5 to 0.5), and the distance `radius` from the axis. Height and radius
 * are shares of the sides of the box. */
static void box_point(const builtin_path *p, double angle, double height, double radius,
                      double out[3])
{
    int u = (p->up + 1) % 3, v = (p->up + 2) % 3;
    out[u] = p->origin[u] + p->size[u] * (0.5 + radius * cos(angle));
    out[v] = p->origin[v] + p->size[v] * (0.5 + radius * sin(angle));
    out[p->up] = p->origin[p->up] + p->size[p->up] * (0.5 + height);
}

/* Sets p->hit, by rays from outside the box to the middle axis of the box. */
static ebpo_status measure_radii(builtin_path *p, ebpo_context *context, ebpo_error *error)
{
    for (int h = 0; h < HEIGHTS; h++)
        for (int a = 0; a < ANGLES; a++) {
            double angle = 2 * pi * a / ANGLES, height = 0.9 * ((double)h / (HEIGHTS - 1) - 0.5);
            double from[3], direction[3];
            ebpo_ray_hit hit;
            bool is_hit;
            box_point(p, angle, height, 0.8, from);
            box_point(p, angle, height, 0, direction);
            for (int k = 0; k < 3; k++)
                direction[k] -= from[k];
            ebpo_status status = ebpo_ray_first(context, from, direction, 1, &hit, &is_hit, error);
            if (status != EBPO_OK)
                return status;
            p->hit[h][a] = is_hit ? 0.8 * (1 - hit.t) : 0.1;
        }
    return EBPO_OK;
}

/* Returns the distance of the surface from the axis, interpolated from p->hit. */
static double surface_distance(const builtin_path *p, double angle, double height)
{
    double a = angle / (2 * pi) * ANGLES, h = (height / 0.9 + 0.5) * (HEIGHTS - 1);
    int i = (int)floor(a), j = (int)fmin(fmax(floor(h), 0), HEIGHTS - 2);
    double s = a - i, t = h - j;
    int i0 = ((i % ANGLES) + ANGLES) % ANGLES, i1 = (i0 + 1) % ANGLES;
    return (1 - t) * ((1 - s) * p->hit[j][i0] + s * p->hit[j][i1]) +
           t * ((1 - s) * p->hit[j + 1][i0] + s * p->hit[j + 1][i1]);
}

static bool pose_at(void *self, uint64_t step, haptic_pose *out)
{
    const builtin_path *p = self;
    double seconds = (double)step / p->rate, angle = 2 * pi * seconds / 8;
    double height = 0.4 * sin(0.31 * angle), nod = 0.06 * cos(3.7 * angle);
    double approach = fmax(0, 1 - seconds); /* in the first second, the device approaches */
    double radius = surface_distance(p, angle, height) + p->clearance + nod - 0.01;
    box_point(p, angle, height, radius + approach * (0.9 + p->clearance - radius), out->position);
    out->lifted = false;
    out->pressure = 0;
    for (int k = 0; k < 4; k++)
        out->rotation[k] = 0;
    out->rotation[p->up] = sin(0.3 * sin(angle)); /* the device turns back and forth */
    out->rotation[3] = cos(0.3 * sin(angle));
    return true;
}

static bool begin_builtin(void *self, double seconds, haptic_pose *first)
{
    (void)seconds;
    return pose_at(self, 0, first);
}

ebpo_status haptic_builtin_open(haptic_device *out, ebpo_model *model, const ebpo_info *info,
                                double rate, double clearance, ebpo_error *error)
{
    builtin_path *p = calloc(1, sizeof *p);
    ebpo_context *context = NULL;
    *out = (haptic_device){ begin_builtin, pose_at, NULL, free, p, 0 };
    ebpo_status status = ebpo_context_new(model, &context, error);
    if (status != EBPO_OK || !p)
        return status != EBPO_OK ? status : EBPO_E_MEMORY;
    double shortest = fmin(info->box_size[0], fmin(info->box_size[1], info->box_size[2]));
    p->rate = rate;
    p->clearance = clearance / shortest;
    for (int k = 0; k < 3; k++) {
        p->origin[k] = info->box_origin[k];
        p->size[k] = info->box_size[k];
        if (p->size[k] > p->size[p->up])
            p->up = k;
    }
    status = measure_radii(p, context, error);
    ebpo_context_free(context);
    return status;
}
