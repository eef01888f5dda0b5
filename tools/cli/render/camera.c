/* Sets the camera of raster.h so that it shows a mesh completely. */
#include <math.h>
#include <string.h>

#include "cli/render/raster.h"

static const double margin = 0.94; /* share of the picture that the model may fill */

static double dot_product(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void read_vertex(const ebpo_mesh *mesh, uint64_t i, double out[3])
{
    for (uint64_t k = 0; k < 3; k++)
        out[k] = mesh->xyz32 ? (double)mesh->xyz32[3 * i + k] : mesh->xyz64[3 * i + k];
}

/* Sets the axes of the camera. At azimuth 0 the eye looks along -z if y is up, along y if z is up,
 * along -z if x is up. */
static void aim_camera(camera *c, double azimuth, double elevation, int up_axis)
{
    static const double rights[3][3] = { { 0, -1, 0 }, { 1, 0, 0 }, { 1, 0, 0 } };
    static const double fronts[3][3] = { { 0, 0, 1 }, { 0, 0, 1 }, { 0, -1, 0 } };
    double a = azimuth * M_PI / 180, e = elevation * M_PI / 180;
    const double *right = rights[up_axis], *front = fronts[up_axis];
    for (int k = 0; k < 3; k++) {
        double up = k == up_axis;
        double level = sin(a) * right[k] + cos(a) * front[k];
        c->right[k] = cos(a) * right[k] - sin(a) * front[k];
        c->back[k] = cos(e) * level + sin(e) * up;
        c->up[k] = cos(e) * up - sin(e) * level;
    }
}

static void centre_model(camera *c, const ebpo_mesh *mesh)
{
    double low[3] = { INFINITY, INFINITY, INFINITY }, high[3] = { -INFINITY, -INFINITY, -INFINITY };
    for (uint64_t i = 0; i < mesh->vertex_count; i++) {
        double v[3];
        read_vertex(mesh, i, v);
        for (int k = 0; k < 3; k++) {
            low[k] = fmin(low[k], v[k]);
            high[k] = fmax(high[k], v[k]);
        }
    }
    for (int k = 0; k < 3; k++)
        c->target[k] = low[k] / 2 + high[k] / 2;
}

/* Sets the distance of the eye at which every vertex is visible. *shift_x, *shift_y: offset of the
 * target, to the right and upwards, that would centre the model in the picture. */
static void measure_view(camera *c, const ebpo_mesh *mesh, double aspect, double *shift_x,
                         double *shift_y)
{
    /* tx, ty: tangents of half the usable angles of view */
    double tx = c->tangent * aspect * margin, ty = c->tangent * margin, distance = 0;
    double low[2] = { INFINITY, INFINITY }, high[2] = { -INFINITY, -INFINITY };
    for (int pass = 0; pass < 2; pass++) { /* first the distance, then the extent in the picture */
        for (uint64_t i = 0; i < mesh->vertex_count; i++) {
            double v[3];
            read_vertex(mesh, i, v);
            for (int k = 0; k < 3; k++)
                v[k] -= c->target[k];
            double x = dot_product(v, c->right), y = dot_product(v, c->up),
                   z = dot_product(v, c->back);
            if (pass == 0) {
                distance = fmax(distance, z + fmax(fabs(x) / tx, fabs(y) / ty));
                continue;
            }
            double s[2] = { x / (distance - z), y / (distance - z) };
            for (int k = 0; k < 2; k++) {
                low[k] = fmin(low[k], s[k]);
                high[k] = fmax(high[k], s[k]);
            }
        }
        if (pass == 0 && !(distance > 0))
            distance = 1; /* a single point */
    }
    c->distance = distance;
    *shift_x = (low[0] + high[0]) / 2 * distance;
    *shift_y = (low[1] + high[1]) / 2 * distance;
}

void camera_fit(camera *out, const ebpo_mesh *mesh, double azimuth, double elevation, int up_axis,
                int width, int height)
{
    double aspect = (double)width / height, sx, sy;
    memset(out, 0, sizeof *out);
    out->tangent = 0.22; /* an angle of view of 25 degrees, so that perspective distorts little */
    aim_camera(out, azimuth, elevation, up_axis);
    centre_model(out, mesh);
    for (int round = 0; round < 3; round++) { /* centring changes the distance, and vice versa */
        measure_view(out, mesh, aspect, &sx, &sy);
        for (int k = 0; k < 3; k++)
            out->target[k] += sx * out->right[k] + sy * out->up[k];
    }
    measure_view(out, mesh, aspect, &sx, &sy);
}
