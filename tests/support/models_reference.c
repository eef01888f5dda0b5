#include "models_reference.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "exact_reference.h"
#include "pair_reference.h"

/* --- poses --- */

typedef enum pose_turn { STRAIGHT, QUARTER, ANYHOW } pose_turn;

/* A kind of poses. B is rotated, scaled, then moved by a share of the size along x, or along a
 * random direction. */
typedef struct pose_kind {
    const char *name;
    pose_turn turn;
    double scale, along_x, along_any;
    double
        both; /* not 0: A is also rotated at random, and both models are moved by this many sizes */
} pose_kind;

static const pose_kind kinds[REFERENCE_POSES] = {
    { "identical", STRAIGHT, 1, 0, 0, 0 },
    { "quarter turn", QUARTER, 1, 0, 0, 0 },
    { "half along x", STRAIGHT, 1, 0.5, 0, 0 },
    { "boxes touch", STRAIGHT, 1, 1, 0, 0 },
    { "quarter turn, boxes touch", QUARTER, 1, 1, 0, 0 },
    { "1e-9", STRAIGHT, 1, 0, 1e-9, 0 },
    { "boxes 1e-9 apart", STRAIGHT, 1, 1 + 1e-9, 0, 0 },
    { "slight", STRAIGHT, 1, 0.97, 0, 0 },
    { "deep", STRAIGHT, 1, 0, 0.4, 0 },
    { "turned, slight", ANYHOW, 1, 0, 0.9, 0 },
    { "turned, deep", ANYHOW, 1, 0, 0.3, 1 },
    { "within", ANYHOW, 0.05, 0, 0.1, 0 },
    { "apart by 0.01", STRAIGHT, 1, 1.01, 0, 0 },
    { "apart by 0.05", QUARTER, 1, 1.05, 0, 0 },
    { "apart, turned", ANYHOW, 0.7, 0, 1.7, 0 },
    { "far away", ANYHOW, 1, 0, 1.8, 1000 },
};

const char *reference_pose_name(int kind) { return kinds[kind].name; }

/* Sets the rotation from a quaternion. */
static void turn_to(ebpo_pose *p, double w, double x, double y, double z)
{
    double n = w * w + x * x + y * y + z * z;
    double r[9] = { n - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                    2 * (x * y + w * z),     n - 2 * (x * x + z * z), 2 * (y * z - w * x),
                    2 * (x * z - w * y),     2 * (y * z + w * x),     n - 2 * (x * x + y * y) };
    for (int i = 0; i < 9; i++)
        p->rotation[i / 3][i % 3] = r[i] / n;
}

static void turn_anyhow(ebpo_pose *p, uint64_t *state)
{
    double q[4];
    for (int i = 0; i < 4; i++)
        q[i] = reference_uniform(state);
    turn_to(p, q[0], q[1], q[2], q[3]);
}

void reference_pose(int kind, double size, uint64_t *state, ebpo_pose *a, ebpo_pose *b)
{
    const pose_kind *k = &kinds[kind];
    double direction[3], length = 0;
    *a = *b = (ebpo_pose)EBPO_POSE_INIT;
    if (k->turn == QUARTER)
        turn_to(b, 1, 1, 0, 0);
    if (k->turn == ANYHOW)
        turn_anyhow(b, state);
    if (k->both > 0)
        turn_anyhow(a, state);
    b->scale = k->scale;
    for (int i = 0; i < 3; i++) {
        direction[i] = reference_uniform(state);
        length += direction[i] * direction[i];
    }
    for (int i = 0; i < 3; i++) {
        double move =
            size * k->along_any * direction[i] / sqrt(length) + (i ? 0 : size * k->along_x);
        a->translation[i] = size * k->both;
        b->translation[i] = size * k->both + move;
    }
}

/* --- faces --- */

static const reference_faces *sorted; /* for qsort */

static double least(const double face[3][3], int axis)
{
    return fmin(face[0][axis], fmin(face[1][axis], face[2][axis]));
}
static double most(const double face[3][3], int axis)
{
    return fmax(face[0][axis], fmax(face[1][axis], face[2][axis]));
}

static int by_x(const void *p, const void *q)
{
    double x = least((const double(*)[3])sorted->corner[*(const uint32_t *)p], 0),
           y = least((const double(*)[3])sorted->corner[*(const uint32_t *)q], 0);
    return (x > y) - (x < y);
}

void reference_faces_make(reference_faces *out, const query_model *m, const ebpo_pose *pose)
{
    out->count = m->mesh.face_count;
    out->corner = query_alloc(out->count + 1, sizeof *out->corner);
    out->order = query_alloc(out->count + 1, sizeof *out->order);
    for (uint64_t i = 0; i < 3 * out->count; i++) {
        double x[3];
        ebpo_test_point(&m->mesh, m->mesh.faces[i], x);
        for (int k = 0; k < 3; k++) {
            const double *r = pose->rotation[k];
            double a = pose->scale * r[0] * x[0], b = pose->scale * r[1] * x[1],
                   c = pose->scale * r[2] * x[2];
            out->corner[i / 3][i % 3][k] = ((a + b) + c) + pose->translation[k];
        }
    }
    for (uint32_t i = 0; i < out->count; i++)
        out->order[i] = i;
    sorted = out;
    qsort(out->order, out->count, sizeof *out->order, by_x);
}

void reference_faces_free(reference_faces *f)
{
    free(f->corner);
    free(f->order);
}

/* --- pairs --- */

static int by_faces(const void *p, const void *q)
{
    const reference_found *x = p, *y = q;
    if (x->a != y->a)
        return x->a < y->a ? -1 : 1;
    return (x->b > y->b) - (x->b < y->b);
}

static bool boxes_intersect(const double a[3][3], const double b[3][3])
{
    for (int k = 0; k < 3; k++)
        if (least(a, k) > most(b, k) || least(b, k) > most(a, k))
            return false;
    return true;
}

uint64_t reference_pairs(const reference_faces *a, const reference_faces *b, reference_found **out)
{
    uint64_t count = 0, capacity = 64;
    *out = query_alloc(capacity, sizeof **out);
    for (uint64_t i = 0; i < a->count; i++) {
        const double(*face)[3] = (const double(*)[3])a->corner[i];
        for (uint64_t n = 0; n < b->count; n++) {
            const double(*other)[3] = (const double(*)[3])b->corner[b->order[n]];
            if (least(other, 0) > most(face, 0))
                break;
            int kind = boxes_intersect(face, other) ? reference_pair_kind(face, other) : 0;
            if (!kind)
                continue;
            if (count == capacity) {
                capacity *= 2;
                *out = realloc(*out, capacity * sizeof **out);
                if (!*out)
                    abort();
            }
            (*out)[count++] = (reference_found){ i, b->order[n], kind };
        }
    }
    qsort(*out, count, sizeof **out, by_faces);
    return count;
}

/* Returns true if the distance of the faces along one of these directions is certainly greater. */
static bool farther(const double a[3][3], const double b[3][3], double direction[][3],
                    int directions, double distance)
{
    for (int w = 0; w < directions; w++)
        for (int sign = -1; sign < 2; sign += 2) {
            double ahead = -INFINITY, behind = INFINITY, size = 0;
            for (int i = 0; i < 3; i++) {
                double x = 0, y = 0;
                for (int k = 0; k < 3; k++) {
                    x += sign * direction[w][k] * a[i][k];
                    y += sign * direction[w][k] * b[i][k];
                    size = fmax(size, fmax(fabs(a[i][k]), fabs(b[i][k])));
                }
                ahead = fmax(ahead, x);
                behind = fmin(behind, y);
            }
            if (behind - ahead - 1e-14 * size > distance * (1 + 1e-9))
                return true;
        }
    return false;
}

const char *reference_models_distance(const reference_faces *a, const reference_faces *b,
                                      double distance, uint64_t at_a, uint64_t at_b)
{
    double below = nextafter(distance, 0), above = nextafter(distance, INFINITY);
    double direction[16][3] = { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } };
    uint64_t state = 7;
    if (reference_pair_distance_compare((const double(*)[3])a->corner[at_a],
                                        (const double(*)[3])b->corner[at_b], above) > 0)
        return "the pair is farther away";
    for (int w = 3; w < 16; w++) {
        double length = 0;
        for (int k = 0; k < 3; k++) {
            direction[w][k] =
                w == 3 ? b->corner[at_b][0][k] - a->corner[at_a][0][k] : reference_uniform(&state);
            length += direction[w][k] * direction[w][k];
        }
        for (int k = 0; k < 3; k++)
            direction[w][k] /= length > 0 ? sqrt(length) * (1 + 1e-12) : 1;
    }
    for (uint64_t i = 0; i < a->count; i++)
        for (uint64_t j = 0; j < b->count; j++) {
            const double(*f)[3] = (const double(*)[3])a->corner[i],
                  (*g)[3] = (const double(*)[3])b->corner[j];
            if (!farther(f, g, direction, 16, distance) &&
                reference_pair_distance_compare(f, g, below) < 0)
                return "another pair is nearer";
        }
    return NULL;
}
