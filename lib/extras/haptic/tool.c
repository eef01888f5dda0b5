/* Computes the motion of a tool (a rigid set of points), the contacts that hold the tool, and its
 * forces.
 *
 * Points are split at the middle of their longest side into clusters of few points. A rotation is
 * measured as a length: its angle times the arm, the root mean square distance of the tool's points
 * from its centre.
 *
 * Contacts constrain the motion of a tool: allowed motions bring no point closer to a face than the
 * contact permits. The tool makes the allowed motion that is nearest to the wanted motion.
 * Hildreth's method finds this motion for a few active contacts, which are added one at a time, the
 * most violated contact first.
 *
 * Forces are passive: a force is reduced if it could give the device more energy than the device
 * has given. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "extras/haptic/tool.h"

static double dot_product(const double *a, const double *b, int n)
{
    double sum = 0;
    for (int i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

void ebpo_passive_moved(ebpo_passive *p, const double *force, const double *moved, int n)
{
    p->energy += dot_product(force, moved, n);
    p->longest_step = fmax(p->longest_step, sqrt(dot_product(moved, moved, n)));
}

/* Returns the greatest allowed force F. With an allowed force, the energy that the device has
 * received in total, p->energy, never exceeds A = stiffness s^2. s is the longest motion of the
 * device in one haptic step. Let g = -p->energy, the energy that the device has given so far. In a
 * step of length s' the device receives at most F s', and F s' - g must not exceed stiffness max(s,
 * s')^2. This holds for all s' in two cases. First, if F^2 <= 4 stiffness g. Second, if F <= 2
 * stiffness s and F s - g <= A, because for s' >= s the right side then grows faster than the left
 * side. For a spring that was pressed steadily to the depth d, F is stiffness d, and g is at least
 * stiffness d^2 / 2. Then one of the two cases holds, and the force is not reduced. */
static double max_force(const ebpo_passive *p)
{
    double k = p->stiffness, g = -p->energy, s = p->longest_step;
    double by_step = s > 0 ? fmin(2 * k * s, k * s + g / s) : 0;
    double by_energy = g > 0 ? 2 * sqrt(k * g) : 0;
    return fmax(fmax(by_step, by_energy) * (1 - 0x1p-40), 0);
}

void ebpo_passive_push(const ebpo_passive *p, double damping, const double *depth,
                       const double *moved, int n, double *force)
{
    for (int i = 0; i < n; i++)
        force[i] = p->stiffness * depth[i] - damping * moved[i];
    double into = dot_product(force, depth, n), square = dot_product(depth, depth, n);
    if (into < 0 && square > 0) /* remove the component that pulls towards the faces */
        for (int i = 0; i < n; i++)
            force[i] -= into / square * depth[i];
    double length = sqrt(dot_product(force, force, n)), most = max_force(p);
    if (length > most)
        for (int i = 0; i < n; i++)
            force[i] *= most / length;
}

bool ebpo_rigid_read(const double place[3], const double rotation[4], ebpo_rigid *out)
{
    double most = 0, square = 0, unit[4];
    bool valid = true;
    for (int i = 0; i < 3; i++)
        valid &= fabs(place[i]) <= 0x1p200;
    for (int i = 0; i < 4; i++) {
        valid &= isfinite(rotation[i]) != 0;
        most = fmax(most, fabs(rotation[i]));
    }
    if (!valid || !(most >= 0x1p-500))
        return false;
    for (int i = 0; i < 4; i++) {
        unit[i] = rotation[i] / most;
        square += unit[i] * unit[i];
    }
    ebpo_vec3_copy(place, out->place);
    for (int i = 0; i < 4; i++)
        out->rotation[i] = unit[i] / sqrt(square);
    return true;
}

static void rigid_multiply(const double a[4], const double b[4], double out[4])
{
    double c[3];
    ebpo_vec3_cross(a, b, c);
    for (int i = 0; i < 3; i++)
        out[i] = a[3] * b[i] + b[3] * a[i] + c[i];
    out[3] = a[3] * b[3] - ebpo_vec3_dot(a, b);
}

void ebpo_rigid_between(const ebpo_rigid *a, const ebpo_rigid *b, double arm,
                        double out[EBPO_SCREW])
{
    const double back[4] = { -a->rotation[0], -a->rotation[1], -a->rotation[2], a->rotation[3] };
    double q[4];
    ebpo_vec3_subtract(b->place, a->place, out);
    rigid_multiply(b->rotation, back, q);
    double sine = sqrt(ebpo_vec3_dot(q, q)), sign = q[3] < 0 ? -1 : 1;
    double angle = 2 * atan2(sine, sign * q[3]);
    for (int i = 0; i < 3; i++)
        out[3 + i] = sine > 0 ? arm * (sign * angle / sine) * q[i] : 0;
}

void ebpo_rigid_move(const ebpo_rigid *from, const double motion[EBPO_SCREW], double fraction,
                     double arm, ebpo_rigid *out)
{
    double rotation[4], q[4], place[3];
    double angle = fraction * sqrt(ebpo_vec3_dot(motion + 3, motion + 3)) / arm;
    for (int i = 0; i < 3; i++) {
        place[i] = from->place[i] + fraction * motion[i];
        rotation[i] = angle > 0 ? sin(angle / 2) / angle * (fraction * motion[3 + i] / arm) : 0;
    }
    rotation[3] = cos(angle / 2);
    rigid_multiply(rotation, from->rotation, q);
    *out = *from;
    (void)ebpo_rigid_read(place, q, out);
}

void ebpo_rigid_matrix(const ebpo_rigid *r, double out[3][3])
{
    const double *q = r->rotation;
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        out[i][i] = 1 - 2 * (q[j] * q[j] + q[k] * q[k]);
        out[i][j] = 2 * (q[i] * q[j] - q[3] * q[k]);
        out[i][k] = 2 * (q[i] * q[k] + q[3] * q[j]);
    }
}

/* --- contacts --- */

/* Greatest number of active contacts, and of iterations after each new active contact. */
enum { ACTIVE_MAX = 12, SWEEPS = 20 };

static void swap_contacts(ebpo_tool_contacts *all, int i, int j)
{
    ebpo_tool_contact c = all->at[i];
    all->at[i] = all->at[j];
    all->at[j] = c;
}

/* Moves at[0] down in the heap, to its position. */
static void sink_contact(ebpo_tool_contacts *all)
{
    for (int i = 0, child; (child = 2 * i + 1) < all->count; i = child) {
        if (child + 1 < all->count && all->at[child + 1].gap > all->at[child].gap)
            child++;
        if (all->at[child].gap <= all->at[i].gap)
            return;
        swap_contacts(all, i, child);
    }
}

void ebpo_tool_contact_add(ebpo_tool_contacts *all, const ebpo_tool_contact *contact)
{
    if (all->count == EBPO_CONTACTS_MAX) {
        if (contact->gap >= all->at[0].gap)
            return;
        all->at[0] = *contact;
        sink_contact(all);
        return;
    }
    int i = all->count++;
    all->at[i] = *contact;
    for (; i > 0 && all->at[(i - 1) / 2].gap < all->at[i].gap; i = (i - 1) / 2)
        swap_contacts(all, i, (i - 1) / 2);
}

/* State of Hildreth's method. The active contacts are those that the method uses. */
typedef struct hold_state {
    const ebpo_tool_contacts *all;
    int active[ACTIVE_MAX], count; /* indices of the active contacts */
    double force[ACTIVE_MAX];      /* multiplier of each active contact */
    double square[ACTIVE_MAX];     /* grip . grip of each active contact */
    bool release;                  /* see ebpo_tool_hold */
} hold_state;

/* Returns the length by which the motion violates a contact; negative if it does not. */
static double violation_of(const hold_state *h, const ebpo_tool_contact *c,
                           const double motion[EBPO_SCREW])
{
    double space = h->release ? c->space : fmax(c->space, 0);
    return -space - ebpo_screw_dot(c->grip, motion);
}

/* Iterates over the active contacts until no multiplier changes much. */
static void hold_sweep(hold_state *h, double tolerance, double motion[EBPO_SCREW])
{
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        double most = 0;
        for (int i = 0; i < h->count; i++) {
            const ebpo_tool_contact *c = &h->all->at[h->active[i]];
            double change = fmax(violation_of(h, c, motion) / h->square[i], -h->force[i]);
            h->force[i] += change;
            for (int k = 0; k < EBPO_SCREW; k++)
                motion[k] += change * c->grip[k];
            most = fmax(most, fabs(change) * h->square[i]);
        }
        if (most <= tolerance / 8)
            return;
    }
}

/* Returns the contact that the motion violates most. Returns -1 if no violation is greater than
 * `tolerance`, or if the contact is active already. */
static int most_violated(const hold_state *h, double tolerance, const double motion[EBPO_SCREW])
{
    int found = -1;
    double most = tolerance;
    for (int i = 0; i < h->all->count; i++) {
        double lack = violation_of(h, &h->all->at[i], motion);
        if (lack > most) {
            most = lack;
            found = i;
        }
    }
    for (int i = 0; i < h->count; i++)
        if (h->active[i] == found)
            return -1; /* only more iterations could reduce the violation; if it is too great, the
                        * second pass (EBPO_TOOL_CHECKS) detects it */
    return found;
}

int ebpo_tool_hold(const ebpo_tool_contacts *all, const double want[EBPO_SCREW], double tolerance,
                   bool release, double out[EBPO_SCREW])
{
    hold_state h = { .all = all, .release = release };
    int holding = 0;
    for (int k = 0; k < EBPO_SCREW; k++)
        out[k] = want[k];
    while (h.count < ACTIVE_MAX) {
        int next = most_violated(&h, tolerance, out);
        if (next < 0)
            break;
        h.active[h.count] = next;
        h.force[h.count] = 0;
        h.square[h.count++] = ebpo_screw_dot(all->at[next].grip, all->at[next].grip);
        hold_sweep(&h, tolerance, out);
    }
    for (int i = 0; i < h.count; i++)
        holding += h.force[i] > 0;
    return holding;
}

/* --- the tool --- */

/* A point and its index in the caller's array. */
typedef struct numbered_point {
    double p[3];
    uint32_t number;
} numbered_point;

static int along_x(const void *a, const void *b)
{
    const numbered_point *x = a, *y = b;
    return x->p[0] != y->p[0] ? (x->p[0] > y->p[0]) - (x->p[0] < y->p[0])
                              : (x->number > y->number) - (x->number < y->number);
}
static int along_y(const void *a, const void *b)
{
    const numbered_point *x = a, *y = b;
    return x->p[1] != y->p[1] ? (x->p[1] > y->p[1]) - (x->p[1] < y->p[1])
                              : (x->number > y->number) - (x->number < y->number);
}
static int along_z(const void *a, const void *b)
{
    const numbered_point *x = a, *y = b;
    return x->p[2] != y->p[2] ? (x->p[2] > y->p[2]) - (x->p[2] < y->p[2])
                              : (x->number > y->number) - (x->number < y->number);
}

static int longest_axis(const numbered_point *p, uint64_t count)
{
    double side[3];
    for (int k = 0; k < 3; k++) {
        double low = p[0].p[k], high = low;
        for (uint64_t i = 1; i < count; i++) {
            low = fmin(low, p[i].p[k]);
            high = fmax(high, p[i].p[k]);
        }
        side[k] = high - low;
    }
    return side[0] >= side[1] && side[0] >= side[2] ? 0 : side[1] >= side[2] ? 1 : 2;
}

static double point_distance(const double p[3], const double q[3])
{
    double d[3];
    ebpo_vec3_subtract(p, q, d);
    return sqrt(ebpo_vec3_dot(d, d));
}

static void add_cluster(ebpo_tool *t, const numbered_point *p, uint64_t first, uint64_t count)
{
    ebpo_tool_cluster *c = &t->cluster[t->cluster_count++];
    *c = (ebpo_tool_cluster){ .first = (uint32_t)first, .count = (uint32_t)count };
    for (uint64_t i = 0; i < count; i++)
        for (int k = 0; k < 3; k++)
            c->middle[k] += p[first + i].p[k] / (double)count;
    for (uint64_t i = 0; i < count; i++) {
        c->radius = fmax(c->radius, point_distance(p[first + i].p, c->middle));
        c->lever = fmax(c->lever, point_distance(p[first + i].p, (const double[3]){ 0 }));
    }
    ebpo_tool_group *g = &t->group[(t->cluster_count - 1) / EBPO_TOOL_GROUP];
    g->lever = fmax(g->lever, c->lever);
}

/* Splits points [first, first + count) at the middle of their longest side until each part is a
 * cluster. */
static void split_points(ebpo_tool *t, numbered_point *p, uint64_t first, uint64_t count)
{
    static int (*const compare[3])(const void *, const void *) = { along_x, along_y, along_z };
    if (count <= EBPO_TOOL_CLUSTER) {
        add_cluster(t, p, first, count);
        return;
    }
    qsort(p + first, count, sizeof *p, compare[longest_axis(p + first, count)]);
    split_points(t, p, first, count / 2);
    split_points(t, p, first + count / 2, count - count / 2);
}

static void fill_tool(ebpo_tool *t, const double (*points)[3], numbered_point *p)
{
    const double zero[3] = { 0, 0, 0 };
    double square = 0;
    for (uint64_t i = 0; i < t->count; i++) {
        ebpo_vec3_copy(points[i], p[i].p);
        p[i].number = (uint32_t)i;
        double far = point_distance(points[i], zero);
        t->radius = fmax(t->radius, far);
        square += far * far / (double)t->count;
    }
    split_points(t, p, 0, t->count);
    for (uint64_t i = 0; i < t->count; i++) {
        ebpo_vec3_copy(p[i].p, t->point[i]);
        t->number[i] = p[i].number;
        t->close_points[i] = (ebpo_close_point){ 0 };
        t->kept[i] = (ebpo_kept_faces){ 0 };
    }
    for (uint64_t i = 0; i < EBPO_TOOL_POOL; i++)
        t->pool[i] = 0; /* writes to all pages, so that no haptic step waits for the operating
                         * system */
    /* 1: all points are at the centre, so rotation has no effect */
    t->arm = square > 0 ? sqrt(square) : 1;
}

uint64_t ebpo_tool_bytes(const ebpo_tool *t)
{
    return sizeof *t + EBPO_TOOL_POOL * sizeof *t->pool +
           t->count *
               (sizeof *t->point + sizeof *t->number + sizeof *t->safe_until + sizeof *t->kept +
                sizeof *t->close_points + sizeof *t->cluster + sizeof *t->group);
}

ebpo_status ebpo_tool_new(const double (*points)[3], uint64_t count, ebpo_tool **out,
                          ebpo_error *error)
{
    ebpo_tool *t = *out = ebpo_alloc_zero(1, sizeof *t);
    numbered_point *p = ebpo_alloc(count, sizeof *p);
    if (t) {
        t->count = count;
        t->point = ebpo_alloc(count, sizeof *t->point);
        t->number = ebpo_alloc(count, sizeof *t->number);
        t->safe_until = ebpo_alloc(count, sizeof *t->safe_until);
        t->kept = ebpo_alloc(count, sizeof *t->kept);
        t->close_points = ebpo_alloc(count, sizeof *t->close_points);
        t->cluster = ebpo_alloc(count, sizeof *t->cluster);
        t->group = ebpo_alloc_zero(count, sizeof *t->group);
        t->pool = ebpo_alloc(EBPO_TOOL_POOL, sizeof *t->pool);
    }
    bool allocated = t && p && t->point && t->number && t->safe_until && t->kept &&
                     t->close_points && t->cluster && t->group && t->pool;
    if (allocated)
        fill_tool(t, points, p);
    free(p);
    return allocated ? EBPO_OK : ebpo_fail_memory(error, count * 128 + EBPO_TOOL_POOL * 4);
}

void ebpo_tool_free(ebpo_tool *t)
{
    if (!t)
        return;
    free(t->point);
    free(t->number);
    free(t->safe_until);
    free(t->kept);
    free(t->close_points);
    free(t->cluster);
    free(t->group);
    free(t->pool);
    free(t);
}

void ebpo_tool_put(ebpo_tool *t, const ebpo_rigid *at)
{
    t->proxy = t->device = *at;
    t->stage = EBPO_TOOL_IDLE;
    t->contacts.count = 0;
    t->path_count = 0;
    for (int k = 0; k < EBPO_SCREW; k++)
        t->force[k] = 0;
    t->moved = t->turned = 0;
    for (uint64_t i = 0; i < t->cluster_count; i++)
        t->cluster[i].safe_until = t->group[i / EBPO_TOOL_GROUP].safe_until = 0;
    for (uint64_t i = 0; i < t->count; i++)
        t->safe_until[i] = 0;
}
