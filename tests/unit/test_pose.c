/* Tests posed coordinates: their definition, refused poses, and their error against exact motions.
 */
#include <math.h>
#include <string.h>

#include <gmp.h>

#include "check_main.h"
#include "exact_reference.h"
#include "extras/collide/posed_frames.h"
#include "solids.h"

enum { CASES = 20000 };

static const double unit_reach[3] = { 1, 1, 1 };

static ebpo_pose unmoved(void)
{
    return (ebpo_pose){ { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } }, { 0, 0, 0 }, 1 };
}

/* Computes the rotation of a quaternion of integers: entries m, and their common denominator as the
 * result. */
static int64_t exact_rotation(int64_t m[3][3], uint64_t *state)
{
    int64_t q[4], n = 0;
    do {
        n = 0;
        for (int i = 0; i < 4; i++) {
            q[i] = reference_integer(state, -1000, 1000);
            n += q[i] * q[i];
        }
    } while (n == 0);
    int64_t w = q[0], x = q[1], y = q[2], z = q[3];
    int64_t r[3][3] = { { n - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y) },
                        { 2 * (x * y + w * z), n - 2 * (x * x + z * z), 2 * (y * z - w * x) },
                        { 2 * (x * z - w * y), 2 * (y * z + w * x), n - 2 * (x * x + y * y) } };
    memcpy(m, r, sizeof r);
    return n;
}

/* Returns true when |given - (scale Q x + t)| <= bound on one axis, where Q is row / n. */
static bool within_bound(double given, const int64_t row[3], int64_t n, const ebpo_pose *pose,
                         const double x[3], double t, double bound)
{
    mpq_t sum, part, other;
    mpq_inits(sum, part, other, NULL);
    for (int k = 0; k < 3; k++) {
        mpq_set_d(part, x[k]);
        mpq_set_si(other, row[k], 1);
        mpq_mul(part, part, other);
        mpq_add(sum, sum, part);
    }
    mpq_set_si(other, n, 1);
    mpq_div(sum, sum, other);
    mpq_set_d(other, pose->scale);
    mpq_mul(sum, sum, other);
    mpq_set_d(other, t);
    mpq_add(sum, sum, other);
    mpq_set_d(other, given);
    mpq_sub(sum, sum, other);
    mpq_abs(sum, sum);
    mpq_set_d(other, bound);
    bool within = mpq_cmp(sum, other) <= 0;
    mpq_clears(sum, part, other, NULL);
    return within;
}

/* Rounds the exact rotation, and stretches it by a symmetric matrix of up to `stretch`, which does
 * not change the nearest rotation. */
static void stretched(const int64_t m[3][3], int64_t n, double stretch, double out[3][3],
                      uint64_t *state)
{
    double s[3][3];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k <= i; k++)
            s[i][k] = s[k][i] = (i == k) + stretch * reference_uniform(state);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            out[i][k] = (double)m[i][k] / (double)n;
            if (stretch == 0)
                continue;
            out[i][k] = 0;
            for (int j = 0; j < 3; j++)
                out[i][k] += (double)m[i][j] / (double)n * s[j][k];
        }
}

START_TEST(test_posed_points_are_within_error_bound)
{
    uint64_t state = 3;
    for (int i = 0; i < (int)ebpo_test_scaled(CASES); i++) {
        int64_t m[3][3], n = exact_rotation(m, &state);
        ebpo_pose pose = unmoved();
        ebpo_posing posing;
        double x[3], out[3];
        stretched((const int64_t(*)[3])m, n, i & 1 ? 0x1p-24 : 0, pose.rotation, &state);
        for (int k = 0; k < 3; k++) {
            x[k] = reference_uniform(&state);
            pose.translation[k] =
                ldexp(reference_uniform(&state), (int)reference_integer(&state, -30, 30));
        }
        pose.scale = 1 + 0.5 * reference_uniform(&state);
        ck_assert_int_eq(ebpo_posing_make(&posing, &pose, unit_reach, NULL), EBPO_OK);
        ck_assert(posing.error_bound < (i & 1 ? 0x1p-21 : 0x1p-49));
        ebpo_posing_apply(&posing, x, out);
        double length = sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]) * (1 + 0x1p-50);
        for (int k = 0; k < 3; k++)
            ck_assert(within_bound(out[k], m[k], n, &pose, x, pose.translation[k],
                                   ebpo_posing_error(&posing, length)));
    }
}
END_TEST

/* Posed points have one rounding for each operation, in the stated order. */
START_TEST(test_posed_points_match_definition)
{
    uint64_t state = 5;
    for (int i = 0; i < 1000; i++) {
        int64_t m[3][3], n = exact_rotation(m, &state);
        ebpo_pose pose = unmoved();
        ebpo_posing posing;
        for (int k = 0; k < 9; k++)
            pose.rotation[k / 3][k % 3] = (double)m[k / 3][k % 3] / (double)n;
        pose.scale = 3;
        for (int k = 0; k < 3; k++)
            pose.translation[k] = reference_uniform(&state);
        double x[3] = { reference_uniform(&state), reference_uniform(&state), 1 }, out[3];
        ck_assert_int_eq(ebpo_posing_make(&posing, &pose, unit_reach, NULL), EBPO_OK);
        ebpo_posing_apply(&posing, x, out);
        for (int k = 0; k < 3; k++) {
            volatile double row[3], part[3], sum;
            for (int j = 0; j < 3; j++) {
                row[j] = 3 * pose.rotation[k][j];
                part[j] = row[j] * x[j];
            }
            sum = part[0] + part[1];
            sum = sum + part[2];
            sum = sum + pose.translation[k];
            ck_assert(out[k] == sum);
        }
    }
}
END_TEST

static void refused(ebpo_pose pose, const double reach[3], const char *word)
{
    ebpo_error error;
    ebpo_posing posing;
    ck_assert_int_eq(ebpo_posing_make(&posing, &pose, reach, &error), EBPO_E_ARGUMENT);
    ck_assert_msg(strstr(error.message, word) != NULL, "%s: not about \"%s\"", error.message, word);
}

START_TEST(test_invalid_pose_is_refused)
{
    const double far[3] = { 0x1p900, 0, 0 };
    const double numbers[] = { NAN, INFINITY, -INFINITY };
    for (int i = 0; i < 3; i++) {
        ebpo_pose pose = unmoved();
        pose.rotation[1][2] = numbers[i];
        refused(pose, unit_reach, "finite");
        pose = unmoved();
        pose.translation[2] = numbers[i];
        refused(pose, unit_reach, "finite");
        pose = unmoved();
        pose.scale = numbers[i];
        refused(pose, unit_reach, "scale");
    }
    ebpo_pose pose = unmoved();
    pose.rotation[0][0] = 1.001;
    refused(pose, unit_reach, "off by 0.002");
    pose.rotation[0][0] = 0x1p1000;
    refused(pose, unit_reach, "off by inf");
    pose.rotation[0][0] = -1;
    refused(pose, unit_reach, "mirror");
    pose = unmoved();
    pose.rotation[0][1] = 0x1p-19;
    refused(pose, unit_reach, "not a rotation");
    pose.rotation[0][1] = 0x1p-21;
    ebpo_posing posing;
    ck_assert_int_eq(ebpo_posing_make(&posing, &pose, unit_reach, NULL), EBPO_OK);
    pose = unmoved();
    pose.scale = 0;
    refused(pose, unit_reach, "scale");
    pose.scale = 0x1p200;
    refused(pose, far, "axis 0");
    pose.scale = 1;
    ck_assert_int_eq(ebpo_posing_make(&posing, &pose, far, NULL), EBPO_OK);
}
END_TEST

/* --- blocks --- */

static void random_pose(ebpo_pose *pose, double far, uint64_t *state)
{
    int64_t m[3][3], n = exact_rotation(m, state);
    for (int k = 0; k < 9; k++)
        pose->rotation[k / 3][k % 3] = (double)m[k / 3][k % 3] / (double)n;
    for (int k = 0; k < 3; k++)
        pose->translation[k] = far * reference_uniform(state);
    pose->scale =
        ldexp(1.5 + 0.4 * reference_uniform(state), (int)reference_integer(state, -20, 20));
}

/* Makes vertices within approximately `size` of a point at the distance `far` from the model's
 * origin. */
static void random_block(double wide[72], float block[72], double far, double size, int vertices,
                         uint64_t *state)
{
    double centre[3] = { far * reference_uniform(state), far * reference_uniform(state), far };
    for (int i = 0; i < 3 * vertices; i++) {
        block[i] = (float)(centre[i / vertices] + size * reference_uniform(state));
        wide[i] = (double)block[i];
    }
}

/* Checks the block relative to its base; then its position. */
static void check_vertex(const ebpo_block_posing *p, const ebpo_posed_block *posed,
                         const double world[3], int i)
{
    for (int k = 0; k < 3; k++) {
        double off = fabs((double)posed->x[k][i] - (world[k] - posed->base[k]) * p->unit);
        ck_assert_msg(off <= (double)posed->error, "off by %g, stated %g", off,
                      (double)posed->error);
        ck_assert(fabsf(posed->x[k][i]) <= posed->extent);
    }
}

static void check_block(const ebpo_block_posing *p, const ebpo_posed_block *posed,
                        const double *vertex, const double origin[3], int vertices)
{
    float out[3][EBPO_POSED_VERTICES];
    float error = ebpo_posed_block_place(posed, p->unit, origin, out);
    ck_assert_uint_eq(posed->vertices, (unsigned)vertices);
    for (int i = 0; i < vertices; i++) {
        double x[3] = { vertex[i], vertex[vertices + i], vertex[2 * vertices + i] }, world[3];
        ebpo_posing_apply(&p->posing, x, world);
        check_vertex(p, posed, world, i);
        for (int k = 0; k < 3; k++) {
            double off = fabs((double)out[k][i] - (world[k] - origin[k]) * p->unit);
            ck_assert_msg(off <= (double)error * (1 + 0x1p-20), "off by %g, stated %g", off,
                          (double)error);
        }
    }
}

START_TEST(test_posed_blocks_are_within_error_bound)
{
    uint64_t state = 17;
    for (int i = 0; i < (int)ebpo_test_scaled(CASES); i++) {
        double far = ldexp(1, (int)reference_integer(&state, -30, 20)), origin[3];
        double size = far * ldexp(1, -(int)reference_integer(&state, 0, 20));
        const double reach[3] = { 3 * far, 3 * far, 3 * far };
        int vertices = (int)reference_integer(&state, 1, EBPO_POSED_VERTICES);
        ebpo_pose pose;
        ebpo_posing posing;
        ebpo_block_posing p;
        ebpo_posed_block posed, wide;
        double block[72];
        float block32[72];
        random_pose(&pose, far, &state);
        ck_assert_int_eq(ebpo_posing_make(&posing, &pose, reach, NULL), EBPO_OK);
        ebpo_block_posing_make(&p, &posing, far + 9 * far * pose.scale);
        ck_assert(p.fits);
        random_block(block, block32, far, size, vertices, &state);
        ebpo_posed_block_make(&posed, &p, block32, (unsigned)vertices);
        ebpo_posed_block_make_wide(&wide, &p, block, (unsigned)vertices);
        ck_assert_mem_eq(posed.base, wide.base, sizeof posed.base);
        double away = pose.scale * size * ldexp(1, (int)reference_integer(&state, -2, 8));
        for (int k = 0; k < 3; k++)
            origin[k] = posed.base[k] + away * reference_uniform(&state);
        check_block(&p, &posed, block, origin, vertices);
        check_block(&p, &wide, block, origin, vertices);
        ck_assert((double)posed.error <=
                  0x1p-18 * pose.scale * p.unit * size + (double)p.uncertainty);
    }
}
END_TEST

TEST_SUITE(pose)
{
    TCase *tests = tcase_create("pose");
    tcase_set_timeout(tests, 300);
    tcase_add_test(tests, test_posed_points_are_within_error_bound);
    tcase_add_test(tests, test_posed_points_match_definition);
    tcase_add_test(tests, test_posed_blocks_are_within_error_bound);
    tcase_add_test(tests, test_invalid_pose_is_refused);
    Suite *suite = suite_create("pose");
    suite_add_tcase(suite, tests);
    return suite;
}
