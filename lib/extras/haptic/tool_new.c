/* Points are parted at the middle of their longest side until few are left. */
#include "core/strict_fp.h"

#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "extras/haptic/tool.h"

typedef struct placed {
    double p[3];
    uint32_t number;
} placed;

static int along_x(const void *a, const void *b)
{
    const placed *x = a, *y = b;
    return x->p[0] != y->p[0] ? (x->p[0] > y->p[0]) - (x->p[0] < y->p[0])
                              : (x->number > y->number) - (x->number < y->number);
}
static int along_y(const void *a, const void *b)
{
    const placed *x = a, *y = b;
    return x->p[1] != y->p[1] ? (x->p[1] > y->p[1]) - (x->p[1] < y->p[1])
                              : (x->number > y->number) - (x->number < y->number);
}
static int along_z(const void *a, const void *b)
{
    const placed *x = a, *y = b;
    return x->p[2] != y->p[2] ? (x->p[2] > y->p[2]) - (x->p[2] < y->p[2])
                              : (x->number > y->number) - (x->number < y->number);
}

static int longest_axis(const placed *p, uint64_t count)
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

static double far_from(const double p[3], const double q[3])
{
    double d[3];
    difference(p, q, d);
    return sqrt(dot(d, d));
}

static void add_cluster(ebpo_tool *t, const placed *p, uint64_t first, uint64_t count)
{
    ebpo_tool_cluster *c = &t->cluster[t->cluster_count++];
    *c = (ebpo_tool_cluster){ .first = (uint32_t)first, .count = (uint32_t)count };
    for (uint64_t i = 0; i < count; i++)
        for (int k = 0; k < 3; k++)
            c->middle[k] += p[first + i].p[k] / (double)count;
    for (uint64_t i = 0; i < count; i++)
        c->radius = fmax(c->radius, far_from(p[first + i].p, c->middle));
}

static void part(ebpo_tool *t, placed *p, uint64_t first, uint64_t count)
{
    static int (*const along[3])(const void *, const void *) = { along_x, along_y, along_z };
    if (count <= EBPO_TOOL_CLUSTER) {
        add_cluster(t, p, first, count);
        return;
    }
    qsort(p + first, count, sizeof *p, along[longest_axis(p + first, count)]);
    part(t, p, first, count / 2);
    part(t, p, first + count / 2, count - count / 2);
}

static void fill(ebpo_tool *t, const double (*points)[3], placed *p)
{
    const double zero[3] = { 0, 0, 0 };
    double square = 0;
    for (uint64_t i = 0; i < t->count; i++) {
        copy(points[i], p[i].p);
        p[i].number = (uint32_t)i;
        double far = far_from(points[i], zero);
        t->radius = fmax(t->radius, far);
        square += far * far / (double)t->count;
    }
    part(t, p, 0, t->count);
    for (uint64_t i = 0; i < t->count; i++) {
        copy(p[i].p, t->point[i]);
        t->number[i] = p[i].number;
        t->close[i] = (ebpo_tool_close){ 0 };
    }
    for (uint64_t i = 0; i < EBPO_TOOL_POOL; i++)
        t->pool[i] = 0;                     /* no tick is the first to use a page */
    t->arm = square > 0 ? sqrt(square) : 1; /* one point in the middle: turning does nothing */
}

uint64_t ebpo_tool_bytes(const ebpo_tool *t)
{
    return sizeof *t + EBPO_TOOL_POOL * sizeof *t->pool +
           t->count * (sizeof *t->point + sizeof *t->number + sizeof *t->free + sizeof *t->close +
                       sizeof *t->cluster);
}

ebpo_status ebpo_tool_new(const double (*points)[3], uint64_t count, ebpo_tool **out,
                          ebpo_error *error)
{
    ebpo_tool *t = *out = ebpo_alloc_zero(1, sizeof *t);
    placed *p = ebpo_alloc(count, sizeof *p);
    if (t) {
        t->count = count;
        t->point = ebpo_alloc(count, sizeof *t->point);
        t->number = ebpo_alloc(count, sizeof *t->number);
        t->free = ebpo_alloc(count, sizeof *t->free);
        t->close = ebpo_alloc(count, sizeof *t->close);
        t->cluster = ebpo_alloc(count, sizeof *t->cluster);
        t->pool = ebpo_alloc(EBPO_TOOL_POOL, sizeof *t->pool);
    }
    bool fine = t && p && t->point && t->number && t->free && t->close && t->cluster && t->pool;
    if (fine)
        fill(t, points, p);
    free(p);
    return fine ? EBPO_OK : ebpo_fail_memory(error, count * 128 + EBPO_TOOL_POOL * 4);
}

void ebpo_tool_free(ebpo_tool *t)
{
    if (!t)
        return;
    free(t->point);
    free(t->number);
    free(t->free);
    free(t->close);
    free(t->cluster);
    free(t->pool);
    free(t);
}

void ebpo_tool_put(ebpo_tool *t, const ebpo_rigid *at)
{
    t->proxy = t->hand = *at;
    t->stage = EBPO_TOOL_STANDS;
    t->contacts.count = 0;
    t->way_count = 0;
    for (int k = 0; k < EBPO_SCREW; k++)
        t->force[k] = 0;
    for (uint64_t i = 0; i < t->cluster_count; i++)
        t->cluster[i].gone = t->cluster[i].free = 0;
    for (uint64_t i = 0; i < t->count; i++)
        t->free[i] = 0;
}
