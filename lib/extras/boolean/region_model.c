/* Makes models of boxes and half-spaces.
 *
 * A result is cut by intersecting it with these models, so the cut is exact, and faces in the plane
 * of the cut (caps) close it. The model of a half-space has a single triangle in the plane, because
 * four rounded points would not be in one plane. */
#include "core/strict_fp.h"

#include "extras/boolean/region_model.h"

#include <gmp.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/build.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/workspace.h"
#include "format/write_file.h"
#include "geometry/vec3.h"

/* --- models --- */

static ebpo_status build_tree(ebpo_mesh *mesh, ebpo_tree *tree, ebpo_error *error)
{
    ebpo_mesh_report report;
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    options.threads = 1;
    options.require_solid = true;
    ebpo_status status = ebpo_mesh_check(mesh, 1, (ebpo_progress){ NULL, NULL }, &report, error);
    return status == EBPO_OK ? ebpo_build(mesh, &report, NULL, &options, tree, error) : status;
}

static ebpo_status open_tree(ebpo_region_model *out, const ebpo_tree *tree, const char *temp_dir,
                             ebpo_error *error)
{
    ebpo_write_options write_options = EBPO_WRITE_OPTIONS_INIT;
    ebpo_model_options model_options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_workspace_options workspace_options = EBPO_WORKSPACE_OPTIONS_INIT;
    ebpo_workspace *workspace;
    workspace_options.temp_dir = temp_dir;
    write_options.threads = model_options.threads = 1;
    ebpo_status status = ebpo_workspace_new(&workspace_options, &workspace, error);
    if (status != EBPO_OK)
        return status;
    status = ebpo_tree_store(tree, ebpo_workspace_folder(workspace), "ebpo-region", &write_options,
                             &out->file, error);
    if (status == EBPO_OK)
        status = ebpo_model_new(out->file, &model_options, &out->model, error);
    ebpo_workspace_free(workspace);
    return status;
}

/* Makes the model of a closed mesh. */
static ebpo_status make_model(ebpo_region_model *out, const double (*corner)[3], uint32_t corners,
                              const uint32_t (*face)[3], uint32_t faces, const char *temp_dir,
                              ebpo_error *error)
{
    ebpo_tree tree = { 0 };
    ebpo_mesh mesh = { .vertex_count = corners, .face_count = faces };
    mesh.xyz64 = ebpo_alloc(corners, sizeof *corner);
    mesh.faces = ebpo_alloc(faces, sizeof *face);
    ebpo_status status =
        mesh.xyz64 && mesh.faces ? EBPO_OK : ebpo_fail_memory(error, corners * sizeof *corner);
    if (status == EBPO_OK) {
        memcpy(mesh.xyz64, corner, corners * sizeof *corner);
        memcpy(mesh.faces, face, faces * sizeof *face);
        status = build_tree(&mesh, &tree, error);
    }
    if (status == EBPO_OK)
        status = open_tree(out, &tree, temp_dir, error);
    ebpo_tree_free(&tree);
    ebpo_mesh_free(&mesh);
    return status;
}

void ebpo_region_model_free(ebpo_region_model *region)
{
    ebpo_model_free(region->model);
    ebpo_close(region->file);
}

/* --- boxes --- */

ebpo_status ebpo_region_box(ebpo_region_model *out, const double box[6], const char *temp_dir,
                            ebpo_error *error)
{
    static const uint32_t face[12][3] = { { 0, 2, 3 }, { 0, 3, 1 }, { 4, 5, 7 }, { 4, 7, 6 },
                                          { 0, 1, 5 }, { 0, 5, 4 }, { 2, 6, 7 }, { 2, 7, 3 },
                                          { 0, 4, 6 }, { 0, 6, 2 }, { 1, 3, 7 }, { 1, 7, 5 } };
    double corner[8][3];
    for (int k = 0; k < 3; k++)
        if (!isfinite(box[k]) || !isfinite(box[3 + k]) || box[k] >= box[3 + k])
            return ebpo_fail(error, EBPO_E_ARGUMENT,
                             "box: expected two finite corners, the first of them lower on each "
                             "axis, but on axis %c they are %g and %g",
                             'x' + k, box[k], box[3 + k]);
    for (int i = 0; i < 8; i++)
        for (int k = 0; k < 3; k++)
            corner[i][k] = box[i >> k & 1 ? 3 + k : k];
    return make_model(out, (const double(*)[3])corner, 8, face, 12, temp_dir, error);
}

/* --- half-spaces --- */

/* A half-space: normal . x <= offset. In a ball around the box, its model must contain the same
 * points as the half-space. */
typedef struct half_space {
    double normal[3], offset; /* the caller's numbers, scaled by a power of two */
    double length;            /* length of the normal */
    double centre[3], radius; /* the ball */
} half_space;

/* Makes a ball around the box. If the box is empty, the ball is around the origin. */
static void set_ball(half_space *h, const double box[6])
{
    double most = 1;
    h->radius = 0;
    for (int k = 0; k < 3; k++) {
        bool empty = box[0] > box[3] || box[1] > box[4] || box[2] > box[5];
        double low = empty ? 0 : box[k], high = empty ? 0 : box[3 + k];
        h->centre[k] = low + (high - low) / 2;
        h->radius = fmax(h->radius, high - low); /* half the diagonal is at most 0.87 times this */
        most = fmax(most, fmax(fabs(low), fabs(high)));
    }
    h->radius = h->radius > 0 ? h->radius : most;
}

/* Sets the normal and the offset. If the plane is more than two radii away from the centre of the
 * ball, moves it to this distance. Returns false if a number is not finite or the normal is 0. */
static bool set_plane(half_space *h, const double plane[4])
{
    int power;
    double most = fmax(fabs(plane[0]), fmax(fabs(plane[1]), fabs(plane[2])));
    for (int k = 0; k < 4; k++)
        if (!isfinite(plane[k]) || most == 0)
            return false;
    frexp(most, &power);
    for (int k = 0; k < 3; k++)
        h->normal[k] = ldexp(plane[k], -power);
    h->length = sqrt(ebpo_vec3_dot(h->normal, h->normal));
    double middle = ebpo_vec3_dot(h->normal, h->centre), farthest = 2 * h->radius * h->length;
    h->offset = ldexp(plane[3], -power);
    h->offset = fmin(fmax(h->offset, middle - farthest), middle + farthest);
    return true;
}

/* Rounds to the nearest double; mpq_get_d rounds towards zero. */
static double round_fraction(const mpq_t x)
{
    double nearest = mpq_get_d(x); /* rounded towards zero */
    double other = nextafter(nearest, mpq_sgn(x) < 0 ? -INFINITY : INFINITY);
    mpq_t middle, end;
    if (!isfinite(nearest) || !isfinite(other))
        return nearest;
    mpq_init(middle);
    mpq_init(end);
    mpq_set_d(middle, nearest);
    mpq_set_d(end, other);
    mpq_add(middle, middle, end);
    mpq_div_2exp(middle, middle, 1);
    bool beyond = mpq_sgn(x) < 0 ? mpq_cmp(x, middle) < 0 : mpq_cmp(x, middle) > 0;
    mpq_clears(middle, end, NULL);
    return beyond ? other : nearest;
}

/* Moves a point along an axis to the double that is nearest to the plane. */
static void move_into_plane(const half_space *h, int axis, double point[3])
{
    mpq_t sum, factor, x;
    mpq_inits(sum, factor, x, NULL);
    mpq_set_d(sum, h->offset);
    for (int k = 0; k < 3; k++) {
        if (k == axis)
            continue;
        mpq_set_d(factor, h->normal[k]);
        mpq_set_d(x, point[k]);
        mpq_mul(x, x, factor);
        mpq_sub(sum, sum, x);
    }
    mpq_set_d(factor, h->normal[axis]);
    mpq_div(sum, sum, factor);
    point[axis] = round_fraction(sum);
    mpq_clears(sum, factor, x, NULL);
}

/* Makes the corners of the tetrahedron. In this comment, lengths are in radii of the ball. The face
 * in the plane is an equilateral triangle around q, the projection of the ball's centre to the
 * plane. Its corners have a distance of 8 from q, so its inscribed circle has a radius of 4. The
 * fourth corner is 12 behind q. The ball's points in the half-space are at most 3 behind the plane,
 * and within 1 of the line from q to the fourth corner. At a depth of 3, the section of the
 * tetrahedron has an inscribed circle with a radius of 3. So the tetrahedron contains these points.
 * Corners are rounded to a grid of 1/8 or less before they are moved into the plane, so that they
 * have few digits. */
static void make_corners(const half_space *h, double corner[4][3])
{
    double unit[3], side[2][3], q[3], grid = fmax(ldexp(1, ilogb(h->radius) - 3), 0x1p-1074);
    int axis = 0;
    for (int k = 1; k < 3; k++)
        axis = fabs(h->normal[k]) > fabs(h->normal[axis]) ? k : axis;
    double height = (h->offset - ebpo_vec3_dot(h->normal, h->centre)) / h->length;
    for (int k = 0; k < 3; k++) {
        unit[k] = h->normal[k] / h->length;
        q[k] = h->centre[k] + height * unit[k];
    }
    /* two directions in the plane: the axis after `axis` without its component along the normal,
     * and the cross product of the normal and this direction */
    double along = unit[(axis + 1) % 3], across = sqrt(1 - along * along);
    for (int k = 0; k < 3; k++)
        side[0][k] = ((k == (axis + 1) % 3) - along * unit[k]) / across;
    for (int k = 0; k < 3; k++)
        side[1][k] =
            unit[(k + 1) % 3] * side[0][(k + 2) % 3] - unit[(k + 2) % 3] * side[0][(k + 1) % 3];
    static const double turn[3][2] = { { 1, 0 },
                                       { -0.5, 0.8660254037844386 },
                                       { -0.5, -0.8660254037844386 } };
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            double x = q[k] + 8 * h->radius * (turn[i][0] * side[0][k] + turn[i][1] * side[1][k]);
            corner[i][k] = rint(x / grid) * grid;
        }
        move_into_plane(h, axis, corner[i]);
    }
    for (int k = 0; k < 3; k++)
        corner[3][k] = q[k] - 12 * h->radius * unit[k];
}

ebpo_status ebpo_region_half_space(ebpo_region_model *out, const double plane[4],
                                   const double box[6], const char *temp_dir, ebpo_error *error)
{
    static const uint32_t face[4][3] = { { 0, 1, 2 }, { 0, 3, 1 }, { 1, 3, 2 }, { 2, 3, 0 } };
    half_space h;
    double corner[4][3];
    set_ball(&h, box);
    if (!set_plane(&h, plane))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "plane: expected four finite numbers and a normal that is not 0, got %g "
                         "%g %g %g",
                         plane[0], plane[1], plane[2], plane[3]);
    make_corners(&h, corner);
    for (int i = 0; i < 12; i++)
        if (!isfinite(corner[i / 3][i % 3]))
            return ebpo_fail(error, EBPO_E_LIMIT,
                             "plane: the model is too large to be cut by a plane; scale it");
    return make_model(out, (const double(*)[3])corner, 4, face, 4, temp_dir, error);
}
