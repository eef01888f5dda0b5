/* Judges points inside meshes with holes. The program shares no code with the library.
 *
 *     winding_judge points MODEL.ply COUNT SEED >POINTS
 *     winding_judge check MODEL.ply POINTS RESULTS.npy FULL
 *     winding_judge holes MODEL.ply CELLS ONE_IN >HOLED.ply
 *
 * MODEL.ply is binary, with float vertices and triangles. POINTS has three doubles for each point:
 * of the box, of faces, of the border and their neighbours. RESULTS.npy is the output of `ebpo
 * inside --npy`. `check` compares each result with the winding number w of the faces:
 *
 *   w = k - c,
 *
 * where k is the winding number of the faces and of a cone over the border with one apex, and c
 * that of the cone alone. k is a sum of exact crossings of a vertical ray; c is a sum of solid
 * angles in doubles with an error bound, near 1/2 in long doubles, then in 320 bits. For the first
 * FULL points, and for points on edges of the cone, w is also the sum over all faces. Prints
 * counts; ends with 1 if results differ.
 *
 * `holes` makes holes in a large model: a grid has CELLS cells along the longest side of the box,
 * and the faces whose first corner is in a chosen cell are omitted. One cell in ONE_IN is chosen.
 */
#include <gmp.h>
#include <inttypes.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef double point[3];

static struct {
    uint64_t vertices, faces, edges, cones;
    point *at;
    uint32_t *face;      /* [faces][3] */
    struct border_edge { /* the border leads from a to b this many times */
        uint32_t a, b;
        int64_t times;
    } * edge;
    point apex, low, high;
    /* grid of faces over x and y */
    uint64_t side, *first;
    uint32_t *listed;
} m;

static void fail(const char *what)
{
    fprintf(stderr, "winding_judge: %s\n", what);
    exit(2);
}

static void *take(uint64_t count, size_t size)
{
    void *p = calloc(count + 1, size);
    if (!p)
        fail("no memory");
    return p;
}

/* --- exact signs --- */

static int sign_of(double x) { return (x > 0) - (x < 0); }

/* Returns the exact sign of the determinant of n vectors from p along the given axes. */
static int exact_sign(const double *p, const double *const v[3], const int *axis, int n)
{
    mpq_t d[3][3], sum, t, u;
    mpq_inits(sum, t, u, NULL);
    for (int i = 0; i < n; i++)
        for (int k = 0; k < n; k++) {
            mpq_init(d[i][k]);
            mpq_set_d(d[i][k], v[i][axis[k]]);
            mpq_set_d(t, p[axis[k]]);
            mpq_sub(d[i][k], d[i][k], t);
        }
    if (n == 2) {
        mpq_mul(t, d[0][0], d[1][1]);
        mpq_mul(u, d[0][1], d[1][0]);
        mpq_sub(sum, t, u);
    } else {
        for (int k = 0; k < 3; k++) {
            int a = (k + 1) % 3, b = (k + 2) % 3;
            mpq_mul(t, d[1][a], d[2][b]);
            mpq_mul(u, d[1][b], d[2][a]);
            mpq_sub(t, t, u);
            mpq_mul(t, t, d[0][k]);
            mpq_add(sum, sum, t);
        }
    }
    int sign = mpq_sgn(sum);
    for (int i = 0; i < n; i++)
        for (int k = 0; k < n; k++)
            mpq_clear(d[i][k]);
    mpq_clears(sum, t, u, NULL);
    return sign;
}

/* Returns the sign of the area of (p, a, b), seen along the third axis. */
static int turn(const double *p, const double *a, const double *b, int i, int j)
{
    double left = (a[i] - p[i]) * (b[j] - p[j]), right = (a[j] - p[j]) * (b[i] - p[i]),
           sum = left - right;
    if (fabs(sum) > 4e-16 * (fabs(left) + fabs(right)) + 1e-290)
        return sign_of(sum);
    const double *v[3] = { a, b };
    return exact_sign(p, v, (const int[]){ i, j }, 2);
}

/* Returns the sign of the volume of (p, a, b, c): positive where the triangle turns
 * counter-clockwise as seen from behind. */
static int side(const double *p, const double *a, const double *b, const double *c)
{
    double u[3], v[3], w[3], sum = 0, size = 0;
    for (int k = 0; k < 3; k++) {
        u[k] = a[k] - p[k];
        v[k] = b[k] - p[k];
        w[k] = c[k] - p[k];
    }
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        sum += u[k] * (v[i] * w[j] - v[j] * w[i]);
        size += fabs(u[k]) * (fabs(v[i] * w[j]) + fabs(v[j] * w[i]));
    }
    if (fabs(sum) > 1e-15 * size + 1e-290)
        return sign_of(sum);
    const double *t[3] = { a, b, c };
    return exact_sign(p, t, (const int[]){ 0, 1, 2 }, 3);
}

/* The point is moved by (e, e^2, e^3) with an infinitesimal e. Returns `turn` in x and y for it. */
static int moved_turn(const double *p, const double *a, const double *b)
{
    int sign = turn(p, a, b, 0, 1);
    sign = sign ? sign : sign_of(a[1] - b[1]);
    return sign ? sign : sign_of(b[0] - a[0]);
}

static int moved_side(const double *p, const double *a, const double *b, const double *c)
{
    int sign = side(p, a, b, c);
    for (int k = 0; k < 3 && sign == 0; k++) /* less the normal */
        sign = -turn(a, b, c, (k + 1) % 3, (k + 2) % 3);
    return sign;
}

/* Returns the crossing of the ray upward from the moved point. */
static int crossing(const double *p, const double *a, const double *b, const double *c)
{
    int s = moved_turn(p, a, b);
    if (s == 0 || moved_turn(p, b, c) != s || moved_turn(p, c, a) != s)
        return 0;
    return moved_side(p, a, b, c) == s ? s : 0;
}

static bool has_area(const double *a, const double *b, const double *c)
{
    return turn(a, b, c, 0, 1) || turn(a, b, c, 1, 2) || turn(a, b, c, 2, 0);
}

/* Returns true if p is in the closed triangle as seen along an axis. */
static bool within(const double *p, const double *a, const double *b, const double *c, int i, int j)
{
    int x = turn(p, a, b, i, j), y = turn(p, b, c, i, j), z = turn(p, c, a, i, j);
    return !((x > 0 || y > 0 || z > 0) && (x < 0 || y < 0 || z < 0));
}

static bool is_on(const double *p, const double *a, const double *b, const double *c)
{
    for (int k = 0; k < 3; k++)
        if (p[k] < fmin(a[k], fmin(b[k], c[k])) || p[k] > fmax(a[k], fmax(b[k], c[k])))
            return false;
    return side(p, a, b, c) == 0 && within(p, a, b, c, 0, 1) && within(p, a, b, c, 1, 2) &&
           within(p, a, b, c, 2, 0);
}

/* --- half angles --- */

typedef struct angle_sum {
    double sum, error;
    bool unknown; /* the point is on an edge */
} angle_sum;

/* Defines a function that sets sine and cosine of the half angle, times the product of the three
 * lengths, which it returns, in arithmetic of a type. */
#define HALF_ANGLE(name, real, root)                                                      \
    static real name(const double *p, const double *const t[3], real *sine, real *cosine) \
    {                                                                                     \
        real v[3][3], length[3], dot[3];                                                  \
        *sine = 0;                                                                        \
        for (int i = 0; i < 3; i++) {                                                     \
            for (int k = 0; k < 3; k++)                                                   \
                v[i][k] = (real)t[i][k] - (real)p[k];                                     \
            length[i] = root(v[i][0] * v[i][0] + v[i][1] * v[i][1] + v[i][2] * v[i][2]);  \
        }                                                                                 \
        for (int i = 0; i < 3; i++) {                                                     \
            int j = (i + 1) % 3, k = (i + 2) % 3;                                         \
            dot[i] = v[i][0] * v[j][0] + v[i][1] * v[j][1] + v[i][2] * v[j][2];           \
            *sine += v[0][i] * (v[1][j] * v[2][k] - v[1][k] * v[2][j]);                   \
        }                                                                                 \
        real product = length[0] * length[1] * length[2];                                 \
        *cosine = product + dot[0] * length[2] + dot[1] * length[0] + dot[2] * length[1]; \
        return product;                                                                   \
    }
HALF_ANGLE(half_angle, double, sqrt)
HALF_ANGLE(long_half_angle, long double, sqrtl)

static void add_angle(angle_sum *s, const double *p, const double *a, const double *b,
                      const double *c, double times)
{
    const double *t[3] = { a, b, c };
    double sine, cosine, product = half_angle(p, t, &sine, &cosine),
                         rounding = 0x1p-48 * product / sqrt(sine * sine + cosine * cosine);
    if (!(rounding < 0x1p-20)) { /* next to an edge or on it; or a face of area 0 */
        long double x, y, size = long_half_angle(p, t, &y, &x);
        rounding = (double)(0x1p-58L * size / sqrtl(x * x + y * y));
        sine = (double)(y / size);
        cosine = (double)(x / size);
        product = 1;
    }
    if (!(rounding < 0.1)) {
        s->unknown = s->unknown || has_area(a, b, c);
        return;
    }
    if (cosine < 0 && fabs(sine) < 0x1p-40 * product) /* close to the triangle */
        sine = copysign(sine, moved_side(p, a, b, c));
    s->sum += times * atan2(sine, cosine);
    s->error += fabs(times) * (rounding + 0x1p-50);
}

/* Sums in 320 bits: mpf_t, arguments by halving and a series. */
static struct {
    mpf_t sum, pi, v[3][3], length[3], x, y, t, u;
    bool unknown;
} big;

static void big_begin(void)
{
    mpf_set_default_prec(384);
    for (int i = 0; i < 9; i++)
        mpf_init(big.v[i / 3][i % 3]);
    for (int i = 0; i < 3; i++)
        mpf_init(big.length[i]);
    mpf_inits(big.sum, big.pi, big.x, big.y, big.t, big.u, NULL);
}

/* Sets t to the argument of x + i y, which is not 0; x and y are used up. */
static void big_argument(mpf_t out)
{
    int negative = mpf_sgn(big.x) < 0;
    for (int i = 0; i < 5; i++) { /* half angles: x + |z|, y */
        mpf_mul(big.t, big.x, big.x);
        mpf_mul(big.u, big.y, big.y);
        mpf_add(big.t, big.t, big.u);
        mpf_sqrt(big.t, big.t);
        if (i == 0 && negative) { /* (x + |z|) / y = y / (|z| - x), without cancellation */
            mpf_sub(big.u, big.t, big.x);
            mpf_set(big.x, big.y);
            mpf_set(big.y, big.u);
            if (mpf_sgn(big.x) < 0) {
                mpf_neg(big.x, big.x);
                mpf_neg(big.y, big.y);
            }
        } else {
            mpf_add(big.x, big.x, big.t);
        }
    }
    mpf_div(big.t, big.y, big.x);
    mpf_mul(big.u, big.t, big.t);
    mpf_set(out, big.t);
    mpf_set(big.x, big.t);
    for (unsigned long k = 3; k < 400; k += 2) {
        mpf_mul(big.x, big.x, big.u);
        mpf_div_ui(big.t, big.x, k);
        if (k % 4 == 3)
            mpf_sub(out, out, big.t);
        else
            mpf_add(out, out, big.t);
    }
    mpf_mul_2exp(out, out, 5);
}

static void big_dot(mpf_t out, int a, int b)
{
    mpf_set_ui(out, 0);
    for (int k = 0; k < 3; k++) {
        mpf_mul(big.t, big.v[a][k], big.v[b][k]);
        mpf_add(out, out, big.t);
    }
}

static void big_add(const double *p, const double *a, const double *b, const double *c, long times)
{
    const double *t[3] = { a, b, c };
    mpf_t angle;
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            mpf_set_d(big.v[i][k], t[i][k]);
            mpf_set_d(big.t, p[k]);
            mpf_sub(big.v[i][k], big.v[i][k], big.t);
        }
        big_dot(big.u, i, i);
        mpf_sqrt(big.length[i], big.u);
    }
    mpf_mul(big.x, big.length[0], big.length[1]);
    mpf_mul(big.x, big.x, big.length[2]);
    mpf_set_ui(big.y, 0);
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        big_dot(big.u, i, j);
        mpf_mul(big.u, big.u, big.length[k]);
        mpf_add(big.x, big.x, big.u);
        mpf_mul(big.t, big.v[1][j], big.v[2][k]);
        mpf_mul(big.u, big.v[1][k], big.v[2][j]);
        mpf_sub(big.t, big.t, big.u);
        mpf_mul(big.t, big.t, big.v[0][i]);
        mpf_add(big.y, big.y, big.t);
    }
    if (side(p, a, b, c) == 0) {
        if (!has_area(a, b, c))
            return;
        mpf_set_ui(big.y, 0);
        if (is_on(p, a, b,
                  c)) { /* the moved point sees a half of all directions, if not on an edge */
            mpf_mul_ui(big.x, big.length[0], 1);
            mpf_mul(big.x, big.x, big.length[1]);
            mpf_mul(big.x, big.x, big.length[2]);
            if (mpf_sgn(big.x) == 0)
                big.unknown = true;
            for (int i = 0; i < 3; i++) {
                int j = (i + 1) % 3;
                const double *e[2] = { t[i], t[j] };
                if (!turn(p, e[0], e[1], 0, 1) && !turn(p, e[0], e[1], 1, 2) &&
                    !turn(p, e[0], e[1], 2, 0))
                    big.unknown = true;
            }
            mpf_mul_ui(big.t, big.pi, (unsigned long)labs(times));
            if ((moved_side(p, a, b, c) > 0) == (times > 0))
                mpf_add(big.sum, big.sum, big.t);
            else
                mpf_sub(big.sum, big.sum, big.t);
        }
        return;
    }
    mpf_init(angle);
    big_argument(angle);
    mpf_mul_ui(angle, angle, (unsigned long)labs(times));
    if (times > 0)
        mpf_add(big.sum, big.sum, angle);
    else
        mpf_sub(big.sum, big.sum, angle);
    mpf_clear(angle);
}

/* --- the model --- */

static void read_ply(const char *path)
{
    char line[256];
    FILE *f = fopen(path, "rb");
    if (!f)
        fail("the model cannot be opened");
    while (fgets(line, sizeof line, f) && strcmp(line, "end_header\n") != 0) {
        sscanf(line, "element vertex %" SCNu64, &m.vertices);
        sscanf(line, "element face %" SCNu64, &m.faces);
    }
    m.at = take(m.vertices, sizeof *m.at);
    m.face = take(3 * m.faces, sizeof *m.face);
    for (uint64_t i = 0; i < m.vertices; i++) {
        float p[3];
        if (fread(p, sizeof p, 1, f) != 1)
            fail("the model is short");
        for (int k = 0; k < 3; k++)
            m.at[i][k] = (double)p[k] + 0.0; /* no -0 */
    }
    for (uint64_t i = 0; i < m.faces; i++) {
        uint8_t count;
        if (fread(&count, 1, 1, f) != 1 || count != 3 || fread(m.face + 3 * i, 12, 1, f) != 1)
            fail("a face is no triangle, or the model is short");
        for (int k = 0; k < 3; k++)
            if (m.face[3 * i + (uint64_t)k] >= m.vertices)
                fail("a face has no vertex");
    }
    fclose(f);
}

static int by_position(const void *a, const void *b)
{
    const double *x = m.at[*(const uint32_t *)a], *y = m.at[*(const uint32_t *)b];
    for (int k = 0; k < 3; k++)
        if (x[k] != y[k])
            return x[k] < y[k] ? -1 : 1;
    return 0;
}

/* Gives equal positions the same vertex. */
static void join_positions(void)
{
    uint32_t *order = take(m.vertices, sizeof *order), *same = take(m.vertices, sizeof *same);
    for (uint32_t i = 0; i < m.vertices; i++)
        order[i] = i;
    qsort(order, m.vertices, sizeof *order, by_position);
    for (uint64_t i = 0; i < m.vertices; i++)
        same[order[i]] =
            i && by_position(order + i, order + i - 1) == 0 ? same[order[i - 1]] : order[i];
    for (uint64_t i = 0; i < 3 * m.faces; i++)
        m.face[i] = same[m.face[i]];
    free(order);
    free(same);
}

static int by_ends(const void *a, const void *b)
{
    const struct border_edge *x = a, *y = b;
    if (x->a != y->a)
        return x->a < y->a ? -1 : 1;
    return (x->b > y->b) - (x->b < y->b);
}

static void find_border(void)
{
    struct border_edge *all = take(3 * m.faces, sizeof *all);
    uint64_t count = 0;
    for (uint64_t i = 0; i < 3 * m.faces; i++) {
        uint32_t a = m.face[i], b = m.face[i % 3 == 2 ? i - 2 : i + 1];
        if (a != b)
            all[count++] =
                a < b ? (struct border_edge){ a, b, 1 } : (struct border_edge){ b, a, -1 };
    }
    qsort(all, count, sizeof *all, by_ends);
    for (uint64_t i = 0, next; i < count; i = next) {
        int64_t times = 0;
        for (next = i; next < count && by_ends(all + i, all + next) == 0; next++)
            times += all[next].times;
        if (times > 0)
            all[m.edges++] = (struct border_edge){ all[i].a, all[i].b, times };
        else if (times < 0)
            all[m.edges++] = (struct border_edge){ all[i].b, all[i].a, -times };
    }
    m.edge = all;
}

static uint64_t column(double x, int axis)
{
    double at = (x - m.low[axis]) / (m.high[axis] - m.low[axis]) * (double)m.side;
    return at < 0 ? 0 : at >= (double)m.side ? m.side - 1 : (uint64_t)at;
}

static void make_grid(void)
{
    m.side = (uint64_t)sqrt((double)m.faces / 2) + 1;
    m.first = take(m.side * m.side + 2, sizeof *m.first);
    for (int pass = 0; pass < 2; pass++) {
        for (uint64_t f = 0; f < m.faces; f++) {
            const uint32_t *v = m.face + 3 * f;
            double low[2], high[2];
            for (int k = 0; k < 2; k++) {
                low[k] = fmin(m.at[v[0]][k], fmin(m.at[v[1]][k], m.at[v[2]][k]));
                high[k] = fmax(m.at[v[0]][k], fmax(m.at[v[1]][k], m.at[v[2]][k]));
            }
            for (uint64_t y = column(low[1], 1); y <= column(high[1], 1); y++)
                for (uint64_t x = column(low[0], 0); x <= column(high[0], 0); x++) {
                    uint64_t cell = y * m.side + x;
                    if (pass)
                        m.listed[m.first[cell + 1]++] = (uint32_t)f;
                    else
                        m.first[cell + 2]++;
                }
        }
        for (uint64_t i = 2; pass == 0 && i < m.side * m.side + 2; i++)
            m.first[i] += m.first[i - 1];
        if (pass == 0)
            m.listed = take(m.first[m.side * m.side + 1], sizeof *m.listed);
    }
}

static void find_box(void)
{
    for (int k = 0; k < 3; k++) {
        m.low[k] = INFINITY;
        m.high[k] = -INFINITY;
    }
    for (uint64_t i = 0; i < 3 * m.faces; i++)
        for (int k = 0; k < 3; k++) {
            m.low[k] = fmin(m.low[k], m.at[m.face[i]][k]);
            m.high[k] = fmax(m.high[k], m.at[m.face[i]][k]);
        }
}

static void open_model(const char *path)
{
    read_ply(path);
    join_positions();
    find_border();
    find_box();
    for (int k = 0; k < 3; k++)
        m.apex[k] = m.low[k] + (m.high[k] - m.low[k]) * (0.4142 + 0.1 * k);
}

/* --- judging --- */

/* Sums the half angles of the cone, or of all faces, in 320 bits. Returns the sign of |w| - 1/2,
 * where w = k + sum / (2 pi); 0 within 2^-200. */
static int big_sign(const double *p, long k, bool full)
{
    mpf_set_ui(big.sum, 0);
    big.unknown = false;
    /* pi = 4 arg(1 + i) */
    mpf_set_ui(big.x, 1);
    mpf_set_ui(big.y, 1);
    big_argument(big.pi);
    mpf_mul_ui(big.pi, big.pi, 4);
    for (uint64_t i = 0; full && i < m.faces; i++) {
        const uint32_t *v = m.face + 3 * i;
        big_add(p, m.at[v[0]], m.at[v[1]], m.at[v[2]], 1);
    }
    for (uint64_t i = 0; !full && i < m.edges; i++)
        big_add(p, m.at[m.edge[i].a], m.at[m.edge[i].b], m.apex, (long)m.edge[i].times);
    mpf_div(big.sum, big.sum, big.pi);
    mpf_div_ui(big.sum, big.sum, 2);
    if (k < 0)
        mpf_sub_ui(big.sum, big.sum, (unsigned long)-k);
    else
        mpf_add_ui(big.sum, big.sum, (unsigned long)k);
    mpf_abs(big.sum, big.sum);
    mpf_set_d(big.t, 0.5);
    mpf_sub(big.sum, big.sum, big.t);
    mpf_abs(big.u, big.sum);
    mpf_mul_2exp(big.u, big.u, 200);
    return mpf_cmp_ui(big.u, 1) < 0 ? 0 : mpf_sgn(big.sum);
}

static struct {
    uint64_t in, out, on, ties, big, full, edge, differ;
} tally;

/* Returns 1 or 0 for inside or outside by w = k + angles / (2 pi), 2 for a tie, -1 if p is on an
 * edge of a triangle. */
static int decide(const double *p, long k, angle_sum s, bool full)
{
    double w = fabs((double)k + s.sum / (2 * M_PI)), error = s.error / 6 + 1e-13;
    if (!s.unknown && fabs(w - 0.5) > error)
        return w > 0.5;
    int sign = big_sign(p, k, full);
    tally.big++;
    return big.unknown ? -1 : sign ? sign > 0 : 2;
}

static int judge_full(const double *p)
{
    angle_sum s = { 0, 0, false };
    for (uint64_t i = 0; i < m.faces; i++) {
        const uint32_t *v = m.face + 3 * i;
        add_angle(&s, p, m.at[v[0]], m.at[v[1]], m.at[v[2]], 1);
    }
    tally.full++;
    return decide(p, 0, s, true);
}

/* Returns 0, 1 or 2 as `where` of a result; a tie is 0. */
static int judge(const double *p, bool full)
{
    long k = 0;
    bool in_box = true;
    for (int i = 0; i < 3; i++)
        in_box = in_box && p[i] >= m.low[i] && p[i] <= m.high[i];
    uint64_t cell = column(p[1], 1) * m.side + column(p[0], 0);
    for (uint64_t i = m.first[cell]; in_box && i < m.first[cell + 1]; i++) {
        const uint32_t *v = m.face + 3 * (uint64_t)m.listed[i];
        const double *a = m.at[v[0]], *b = m.at[v[1]], *c = m.at[v[2]];
        if (is_on(p, a, b, c)) {
            tally.on++;
            return 2;
        }
    }
    for (uint64_t i = m.first[cell]; i < m.first[cell + 1]; i++) {
        const uint32_t *v = m.face + 3 * (uint64_t)m.listed[i];
        const double *a = m.at[v[0]], *b = m.at[v[1]], *c = m.at[v[2]];
        if (fmax(a[2], fmax(b[2], c[2])) >= p[2])
            k += crossing(p, a, b, c);
    }
    angle_sum s = { 0, 0, false };
    for (uint64_t i = 0; i < m.edges; i++) {
        const double *a = m.at[m.edge[i].a], *b = m.at[m.edge[i].b];
        k -= (long)m.edge[i].times * crossing(p, a, b, m.apex);
        add_angle(&s, p, a, b, m.apex, (double)m.edge[i].times);
    }
    int result = decide(p, k, s, false), other = result;
    if (result < 0) {
        tally.edge++;
        result = judge_full(p);
    } else if (full) {
        other = judge_full(p);
        if (other != result) {
            printf("(%a %a %a): %d by the cone, %d by all faces\n", p[0], p[1], p[2], result,
                   other);
            tally.differ++;
        }
    }
    tally.ties += result == 2;
    tally.in += result == 1;
    tally.out += result != 1;
    return result == 1;
}

static int check(const char *points, const char *results, uint64_t full)
{
    unsigned char head[10];
    double p[3];
    int32_t r[2];
    FILE *f = fopen(points, "rb"), *g = fopen(results, "rb");
    if (!f || !g || fread(head, 10, 1, g) != 1)
        fail("points or results cannot be read");
    fseek(g, 10 + head[8] + 256 * head[9], SEEK_SET);
    make_grid();
    for (uint64_t i = 0; fread(p, sizeof p, 1, f) == 1; i++) {
        if (fread(r, sizeof r, 1, g) != 1)
            fail("the results are short");
        int expected = judge(p, i < full);
        if (expected != r[0]) {
            tally.differ++;
            printf("(%a %a %a): result %d, expected %d\n", p[0], p[1], p[2], (int)r[0], expected);
        }
    }
    printf("%" PRIu64 " border edges; %" PRIu64 " in, %" PRIu64 " out, %" PRIu64
           " on faces; %" PRIu64 " ties; %" PRIu64 " sums of all faces, %" PRIu64
           " sums in 320 bits; %" PRIu64 " differ\n",
           m.edges, tally.in, tally.out, tally.on, tally.ties, tally.full, tally.big, tally.differ);
    return tally.differ > 0;
}

/* --- points --- */

static uint64_t state;

static double unit(void)
{
    state = state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (double)(state >> 11) * 0x1p-53;
}

/* Chooses a point: half of them in the box, the others of faces or of the border, some exactly,
 * some one ulp away, some at a small distance. */
static void choose(double p[3])
{
    double pick = unit(), u = (double)(int)(unit() * 5) / 4,
           v = (double)(int)(unit() * 3) / 4 * (1 - u);
    const double *a, *b, *c;
    if (m.edges && pick > 0.7) {
        const struct border_edge *e = &m.edge[(uint64_t)(unit() * (double)m.edges)];
        a = m.at[e->a];
        b = m.at[e->b];
        c = m.apex;
        v = 0;
    } else {
        const uint32_t *f = m.face + 3 * (uint64_t)(unit() * (double)m.faces);
        a = m.at[f[0]];
        b = m.at[f[1]];
        c = m.at[f[2]];
    }
    double size = 0, way = unit(), scale = ldexp(1, (int)(unit() * 40) - 36);
    for (int k = 0; k < 3; k++)
        size = fmax(size, fabs(b[k] - a[k]));
    for (int k = 0; k < 3; k++) {
        p[k] = a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]);
        if (pick < 0.5)
            p[k] = m.low[k] + (1.1 * unit() - 0.05) * (m.high[k] - m.low[k]);
        else if (way > 0.6)
            p[k] += size * scale * (2 * unit() - 1);
        else if (way > 0.3 && unit() > 0.3)
            p[k] = nextafter(p[k], unit() < 0.5 ? -INFINITY : INFINITY);
    }
}

/* --- holes --- */

static bool is_in_hole(const double p[3], double cells, uint64_t one_in)
{
    double size = 0;
    uint64_t cell = 0;
    for (int k = 0; k < 3; k++)
        size = fmax(size, m.high[k] - m.low[k]);
    for (int k = 0; k < 3; k++)
        cell = (cell << 21) + (uint64_t)((p[k] - m.low[k]) / size * cells);
    cell = (cell ^ cell >> 31) * UINT64_C(0x9e3779b97f4a7c15); /* a hash */
    cell = (cell ^ cell >> 29) * UINT64_C(0xbf58476d1ce4e5b9);
    return (cell >> 32) % one_in == 0;
}

static int make_holes(const char *path, double cells, uint64_t one_in)
{
    const uint8_t corners = 3;
    uint64_t kept = 0;
    if (!(cells >= 1 && cells < 0x1p21) || one_in == 0)
        fail("expected CELLS from 1 to 2^21 - 1, and ONE_IN of at least 1");
    read_ply(path);
    find_box();
    for (uint64_t i = 0; i < m.faces; i++)
        if (!is_in_hole(m.at[m.face[3 * i]], cells, one_in))
            memmove(m.face + 3 * kept++, m.face + 3 * i, 3 * sizeof *m.face);
    printf("ply\nformat binary_little_endian 1.0\nelement vertex %" PRIu64
           "\nproperty float x\nproperty float y\nproperty float z\nelement face %" PRIu64
           "\nproperty list uchar int vertex_indices\nend_header\n",
           m.vertices, kept);
    for (uint64_t i = 0; i < m.vertices; i++) {
        const float p[3] = { (float)m.at[i][0], (float)m.at[i][1], (float)m.at[i][2] };
        fwrite(p, sizeof p, 1, stdout);
    }
    for (uint64_t i = 0; i < kept; i++) {
        fwrite(&corners, 1, 1, stdout);
        fwrite(m.face + 3 * i, 12, 1, stdout);
    }
    return ferror(stdout) || fclose(stdout) != 0 ? 2 : 0;
}

int main(int count, char **argument)
{
    if (count == 5 && strcmp(argument[1], "holes") == 0)
        return make_holes(argument[2], strtod(argument[3], NULL), strtoull(argument[4], NULL, 10));
    if (count == 5 && strcmp(argument[1], "points") == 0) {
        open_model(argument[2]);
        state = strtoull(argument[4], NULL, 10);
        for (uint64_t i = strtoull(argument[3], NULL, 10); i > 0; i--) {
            double p[3];
            choose(p);
            if (fwrite(p, sizeof p, 1, stdout) != 1)
                fail("the points cannot be written");
        }
        return fclose(stdout) == 0 ? 0 : 2;
    }
    if (count != 6 || strcmp(argument[1], "check") != 0)
        fail("usage: points MODEL.ply COUNT SEED, check MODEL.ply POINTS RESULTS.npy FULL, or "
             "holes MODEL.ply CELLS ONE_IN");
    big_begin();
    open_model(argument[2]);
    return check(argument[3], argument[4], strtoull(argument[5], NULL, 10));
}
