/* What is around the proxy: the nearest face, and a normal that turns steadily. */
#include "core/strict_fp.h"

#include <math.h>

#include "extras/haptic/face_near.h"
#include "extras/haptic/touch_parts.h"
#include "extras/haptic/vectors.h"

typedef struct around {
    ebpo_touch *t;
    const ebpo_face_box *box;
    ebpo_near_queue queue;
    double look;    /* all faces that are closer to the ball are found */
    double nearest; /* centre to face */
    uint32_t looked;
    uint32_t count; /* of t->found */
    ebpo_touch_result *out;
} around;

/* Area times a weight that falls to 0 where faces are no longer looked at; to the side on which the
 * proxy is, of a solid always the outer one. */
static void add_normal(const around *a, const double face[3][3], double gap, double sum[3])
{
    double e[3], f[3], n[3], d[3];
    double far = fmax(gap, 0) / a->look, weight = (1 - far) * (1 - far);
    difference(face[1], face[0], e);
    difference(face[2], face[0], f);
    difference(a->t->proxy, face[0], d);
    cross(e, f, n);
    if (!a->t->solid && dot(n, d) < 0)
        weight = -weight;
    for (int i = 0; i < 3; i++)
        sum[i] += weight * n[i];
}

static void add_face(around *a, uint64_t f)
{
    const double(*face)[3] = (const double(*)[3])a->box->corner[f];
    ebpo_face_near near;
    ebpo_face_nearest(a->t->proxy, face, &near);
    double gap = near.distance - a->t->options.radius;
    a->looked++;
    if (!(gap < a->t->options.look))
        return;
    a->t->found[a->count] = (uint32_t)f;
    a->t->gap[a->count++] = gap;
    if (near.distance >= a->nearest)
        return;
    a->nearest = near.distance;
    copy(near.away, a->t->away);
    a->out->face = a->box->face[f];
    for (int i = 0; i < 3; i++) {
        a->out->weight[i] = near.weight[i];
        a->out->point[i] = a->t->proxy[i] - near.distance * near.away[i];
    }
}

static void wait_for(around *a, uint64_t node)
{
    const ebpo_extent *e = &a->box->node[node];
    double off[3];
    for (int i = 0; i < 3; i++)
        off[i] = fmax(0, fmax(e->min[i] - a->t->proxy[i], a->t->proxy[i] - e->max[i]));
    double least = sqrt(dot(off, off)) * (1 - 0x1p-48);
    if (least < a->t->options.radius + a->t->options.look)
        ebpo_near_push(&a->queue, least, node);
}

/* The nearest first: where there are too many the farthest are left out, and the normal is that of
 * those which are surely closer. */
static void find_faces(around *a)
{
    for (uint32_t visits = 0; a->queue.count > 0; visits++) {
        if (visits >= EBPO_TOUCH_VISITS || a->looked + EBPO_FACE_BOX_LEAF > EBPO_TOUCH_FACES) {
            a->out->flags |= EBPO_TOUCH_PARTLY;
            a->look = fmin(a->look, a->queue.item[0].key - a->t->options.radius);
            return;
        }
        uint64_t node = ebpo_near_pop(&a->queue).node;
        if (node < a->box->leaves) {
            wait_for(a, 2 * node);
            wait_for(a, 2 * node + 1);
            continue;
        }
        uint64_t f = (node - a->box->leaves) * EBPO_FACE_BOX_LEAF, end = f + EBPO_FACE_BOX_LEAF;
        for (; f < end && f < a->box->count; f++)
            add_face(a, f);
    }
}

static bool no_face_close(const ebpo_touch *t)
{
    double wide = t->options.radius + t->options.look;
    for (int i = 0; i < 3; i++)
        if (t->proxy[i] - wide > t->root.max[i] || t->proxy[i] + wide < t->root.min[i])
            return true;
    return false;
}

/* Of a ball with so many faces around it that hardly any are known to be all, away from the
 * nearest. */
static void tell_normal(const around *a, double out[3])
{
    double sum[3] = { 0 };
    for (uint32_t i = 0; i < a->count; i++)
        if (a->t->gap[i] < a->look)
            add_normal(a, (const double(*)[3])a->box->corner[a->t->found[i]], a->t->gap[i], sum);
    double length = sqrt(dot(sum, sum));
    if (!(length > 0) && a->count > 0 && a->t->options.kind == EBPO_TOUCH_BALL) {
        difference(a->t->proxy, a->out->point, sum);
        length = sqrt(dot(sum, sum));
    }
    for (int i = 0; i < 3; i++)
        out[i] = length > 0 ? sum[i] / length : 0;
}

void ebpo_touch_look(ebpo_touch *t, ebpo_touch_result *out)
{
    around a = { .t = t,
                 .box = &t->box[t->at],
                 .queue = { t->looking, 0 },
                 .look = t->options.look,
                 .nearest = INFINITY,
                 .out = out };
    out->face = EBPO_NO_FACE;
    if (!ebpo_extent_holds(&a.box->centres, t->proxy)) {
        if (!no_face_close(t))
            out->flags |= EBPO_TOUCH_PARTLY;
    } else if (a.box->count > 0) {
        wait_for(&a, 1);
        find_faces(&a);
    }
    out->work += a.looked;
    tell_normal(&a, out->normal);
    out->depth = -fmin(t->options.look, a.nearest - t->options.radius);
}
