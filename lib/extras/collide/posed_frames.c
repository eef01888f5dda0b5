/* Poses models in floats, with proved error bounds: computes the vertices of blocks for the filter
 * of pairs, and the relative position of the frames of two models.
 *
 * Coordinates are multiplied by a power of two (the unit), so that they are in the range of floats.
 * A block of up to eight faces is rotated in floats relative to its first vertex, whose posed
 * coordinates are doubles. For each matrix between two frames, the absolute values of its entries
 * are also stored; kernels compute sizes of boxes from these values. If two frames are too
 * different for floats, no pair of nodes is dropped. See docs/develop/collision.md, "From blocks to
 * the filter". All functions are pure and can be called from any thread. */
#include "core/strict_fp.h"

#include <math.h>
#include <string.h>

#include "extras/collide/posed_frames.h"

/* --- blocks: loops over 24 vertices, which compilers vectorize --- */

enum { LIMIT = EBPO_POSED_VERTICES };

/* Returns the greater of two numbers. */
static float greater_of(float a, float b) { return a > b ? a : b; }

double ebpo_block_unit(double max_coordinate)
{
    int exponent;
    frexp(max_coordinate > 0x1p-900 ? max_coordinate : 0x1p-900, &exponent);
    return ldexp(1, 30 - exponent);
}

void ebpo_block_posing_make(ebpo_block_posing *out, const ebpo_posing *posing,
                            double max_coordinate)
{
    out->posing = *posing;
    out->unit = ebpo_block_unit(max_coordinate);
    double size = posing->scale * out->unit * (1 + 0x1p-18);
    out->size = (float)(size * (1 + 0x1p-20));
    out->uncertainty = (float)(0x1p-49 * max_coordinate * out->unit);
    out->fits = size > 0x1p-60 && size < 0x1p60;
    for (int i = 0; i < 9; i++)
        out->matrix[i / 3][i % 3] = (float)(posing->matrix[i / 3][i % 3] * out->unit);
}

void ebpo_posed_block_make(ebpo_posed_block *out, const ebpo_block_posing *p, const float *vertex,
                           unsigned vertices)
{
    const float base[3] = { vertex[0], vertex[vertices], vertex[2 * vertices] };
    ebpo_posing_apply(&p->posing, (const double[3]){ base[0], base[1], base[2] }, out->base);
    float most = 0, d[3][LIMIT] = { { 0 } };
    for (unsigned k = 0; k < 3; k++)
        for (unsigned i = 0; i < vertices; i++)
            d[k][i] = vertex[k * vertices + i] - base[k];
    for (int i = 0; i < LIMIT; i++)
        most = greater_of(most, fabsf(d[0][i]) + fabsf(d[1][i]) + fabsf(d[2][i]));
    for (int k = 0; k < 3; k++) {
        const float *m = p->matrix[k];
        for (int i = 0; i < LIMIT; i++)
            out->x[k][i] = (m[0] * d[0][i] + m[1] * d[1][i]) + m[2] * d[2][i];
    }
    out->vertices = vertices;
    out->extent = ebpo_posed_block_extent(p, most);
    out->error = ebpo_posed_block_error(p, out->extent);
}

void ebpo_posed_block_make_wide(ebpo_posed_block *out, const ebpo_block_posing *p,
                                const double *vertex, unsigned vertices)
{
    const double base[3] = { vertex[0], vertex[vertices], vertex[2 * vertices] };
    ebpo_posing_apply(&p->posing, base, out->base);
    memset(out->x, 0, sizeof out->x);
    out->extent = 0;
    for (unsigned i = 0; i < vertices; i++) {
        double v[3] = { vertex[i], vertex[vertices + i], vertex[2 * vertices + i] }, posed[3];
        ebpo_posing_apply(&p->posing, v, posed);
        for (int k = 0; k < 3; k++) {
            out->x[k][i] = (float)((posed[k] - out->base[k]) * p->unit);
            out->extent = greater_of(out->extent, fabsf(out->x[k][i]));
        }
    }
    out->vertices = vertices;
    out->error = 2 * 0x1p-24f * out->extent + p->uncertainty;
}

float ebpo_posed_block_place(const ebpo_posed_block *b, double unit, const double origin[3],
                             float out[3][EBPO_POSED_VERTICES])
{
    float most = 0;
    for (int k = 0; k < 3; k++) {
        float shift = (float)((b->base[k] - origin[k]) * unit);
        most = greater_of(most, fabsf(shift));
        for (int i = 0; i < LIMIT; i++)
            out[k][i] = b->x[k][i] + shift;
    }
    return b->error + 0x1.2p-24f * b->extent + 2.5f * 0x1p-24f * most;
}

/* Inverts a 3x3 matrix in doubles. The matrix is close to a rotation times a factor. */
static void invert_matrix(const double m[3][3], double out[3][3])
{
    double det = 0;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            int r1 = (k + 1) % 3, r2 = (k + 2) % 3, c1 = (i + 1) % 3, c2 = (i + 2) % 3;
            out[i][k] = m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1];
        }
    for (int k = 0; k < 3; k++)
        det += m[0][k] * out[k][0];
    for (int i = 0; i < 9; i++)
        out[i / 3][i % 3] /= det;
}

/* Multiplies a matrix by a vector. */
static void rotate_vector(const double m[3][3], const double x[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = m[i][0] * x[0] + m[i][1] * x[1] + m[i][2] * x[2];
}

/* Rounds a matrix to floats. size: set to the absolute values of its entries, rounded up. */
static void to_floats(const double m[3][3], float out[3][3], float size[3][3])
{
    for (int i = 0; i < 9; i++) {
        out[i / 3][i % 3] = (float)m[i / 3][i % 3];
        size[i / 3][i % 3] = fabsf(out[i / 3][i % 3]) * (1 + 0x1p-22f);
    }
}

/* Rounds the matrices `out->turn` and `back`, its inverse, to floats. */
static void set_matrices(ebpo_accel_pair *out, const double back[3][3])
{
    to_floats((const double(*)[3])out->turn, out->into[0], out->size[0]);
    to_floats(back, out->into[1], out->size[1]);
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 4; i++) {
            out->column[k][i] = i < 3 ? out->turn[i][k] : 0;
            out->into_column[k][i] = i < 3 ? out->into[1][i][k] : 0;
        }
    out->place[3] = 0;
}

/* Prepares a pair whose frames are too different for floats, or whose coordinates are out of the
 * range of floats. The walk then visits every pair of nodes. */
static void visit_all_pairs(ebpo_accel_pair *out)
{
    static const double identity[3][3] = { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } };
    out->unit[0] = out->unit[1] = 1;
    memcpy(out->turn, identity, sizeof out->turn);
    out->place[0] = out->place[1] = out->place[2] = 0;
    set_matrices(out, identity);
    out->uncertainty = INFINITY;
    out->cylinders = out->apart = false;
}

/* Returns true if the boxes of both models are certainly apart along an axis of the first model's
 * frame. */
static bool turned_boxes_apart(const ebpo_accel_pair *p)
{
    double first = p->accel[0]->largest_coordinate * (double)p->unit[0],
           second = p->accel[1]->largest_coordinate * (double)p->unit[1];
    for (int i = 0; i < 3; i++) {
        double size = first + (double)p->uncertainty;
        for (int k = 0; k < 3; k++)
            size += fabs(p->turn[i][k]) * second;
        if (fabs(p->place[i]) > size * (1 + 0x1p-40))
            return true;
    }
    return false;
}

/* Chooses the factors of lengths in both frames. per_world: [model] the length in the model's frame
 * that is 1 in the world. */
static void choose_units(ebpo_accel_pair *out, const double per_world[2])
{
    double ratio = per_world[0] / per_world[1];
    out->cylinders = ratio > 0x1p-60 && ratio < 0x1p60;
    out->unit[0] = ratio > 1 ? (float)fmax(1 / ratio, 0x1p-60) : 1;
    out->unit[1] = ratio > 1 ? 1 : (float)fmax(ratio, 0x1p-60);
}

void ebpo_accel_pair_make(ebpo_accel_pair *out, const ebpo_accel *const accel[2],
                          const ebpo_block_posing *const posing[2], double max_coordinate)
{
    double per_world[2], rotation[2][3][3], back[3][3], middle[3], rotated[3];
    for (int i = 0; i < 2; i++) {
        out->accel[i] = accel[i];
        out->posing[i] = posing[i];
        per_world[i] = accel[i]->scale / posing[i]->posing.scale;
        ebpo_posing_rotation(&posing[i]->posing, rotation[i]);
    }
    choose_units(out, per_world);
    double unit = (double)out->unit[0] * per_world[0],
           ratio = unit / ((double)out->unit[1] * per_world[1]);
    if (!(unit > 0x1p-900 && unit < 0x1p900 && ratio > 0x1p-900 && ratio < 0x1p900 &&
          max_coordinate * unit < 0x1p100)) {
        visit_all_pairs(out);
        return;
    }
    invert_matrix((const double(*)[3])rotation[0], back);
    for (int k = 0; k < 3; k++) {
        double column[3] = { rotation[1][0][k], rotation[1][1][k], rotation[1][2][k] };
        rotate_vector((const double(*)[3])back, column, rotated);
        for (int i = 0; i < 3; i++)
            out->turn[i][k] = rotated[i] * ratio;
    }
    ebpo_posing_apply(&posing[1]->posing, accel[1]->centre, middle);
    for (int i = 0; i < 3; i++)
        middle[i] -= posing[0]->posing.translation[i];
    rotate_vector((const double(*)[3])back, middle, rotated);
    for (int i = 0; i < 3; i++)
        out->place[i] = rotated[i] * unit - accel[0]->centre[i] * (posing[0]->posing.scale * unit);
    invert_matrix((const double(*)[3])out->turn, back);
    set_matrices(out, (const double(*)[3])back);
    double error_bound = posing[0]->posing.error_bound + posing[1]->posing.error_bound;
    out->uncertainty = (float)(0x1p-44 * max_coordinate * unit) + 0x1p-100f;
    out->cylinder_share = (float)(0x1p-17 + 8 * error_bound);
    out->sine_capacity = (float)(0x1p-17 + 16 * error_bound);
    out->apart = turned_boxes_apart(out);
}

/* Returns the greatest absolute value of a point's coordinates. */
static double greatest_coordinate(const double x[3])
{
    return fmax(fabs(x[0]), fmax(fabs(x[1]), fabs(x[2])));
}

/* Computes the map from the frame `from` to the frame `to`. from, to: rotations of the frames;
 * offset: centre of `from` minus centre of `to`, in the world, times the unit. */
static void set_turned_frame(ebpo_turned_frame *out, double from[3][3], double to[3][3],
                             const double offset[3])
{
    for (int i = 0; i < 3; i++) {
        double shift = 0;
        for (int j = 0; j < 3; j++) {
            double turn = 0;
            for (int k = 0; k < 3; k++)
                turn += to[k][i] * from[k][j];
            out->turn[i][j] = (float)turn;
            out->turn_size[i][j] = fabsf(out->turn[i][j]);
            out->in_world[i][j] = (float)from[i][j];
            shift += to[j][i] * offset[j];
        }
        out->shift[i] = (float)shift;
    }
}

void ebpo_two_frames_make(ebpo_two_frames *out, const ebpo_accel *const accel[2],
                          const ebpo_block_posing posing[2])
{
    double rotation[2][3][3], centre[2][3], offset[2][3], size = 0, lost = 0, error_bound = 0;
    double unit = posing[0].unit;
    for (int s = 0; s < 2; s++) {
        const ebpo_posing *p = &posing[s].posing;
        double length = accel[s]->largest_coordinate / accel[s]->scale,
               far = greatest_coordinate(accel[s]->centre) + length;
        ebpo_posing_rotation(p, rotation[s]);
        ebpo_posing_apply(p, accel[s]->centre, centre[s]);
        out->frame[s].unit = (float)(p->scale / accel[s]->scale * unit);
        size += length * p->scale * unit;
        lost += 2 * ebpo_posing_error(p, 1.7321 * far) * unit;
        error_bound += 2 * p->error_bound + 0x1p-50;
    }
    for (int k = 0; k < 3; k++) {
        offset[0][k] = (centre[0][k] - centre[1][k]) * unit;
        offset[1][k] = -offset[0][k];
    }
    double all = size + 1.7321 * greatest_coordinate(offset[0]);
    for (int s = 0; s < 2; s++)
        set_turned_frame(&out->frame[s], rotation[s], rotation[1 - s], offset[s]);
    out->slack = (float)((0x1p-19 * all + 2 * error_bound * all + 2 * lost) * (1 + 0x1p-20));
}
