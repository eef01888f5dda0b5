/* What is around the proxy: the nearest face, and a normal that turns steadily. */
#include "geom/strict_fp.h"

#include <math.h>

#include "touch/face_near.h"
#include "touch/touch_parts.h"
#include "touch/vectors.h"

typedef struct around {
    const ebpo_touch *t;
    double sum[3], nearest;
    ebpo_touch_result *out;
} around;

/* Area times a weight that falls to 0 where faces are no longer looked at; to the side on which the
 * proxy is, of a solid always the outer one. */
static void add_normal(around *a, const double face[3][3], const ebpo_face_near *near, double gap)
{
    double e[3], f[3], n[3];
    double far = fmax(gap, 0) / a->t->options.look, weight = (1 - far) * (1 - far);
    difference(face[1], face[0], e);
    difference(face[2], face[0], f);
    cross(e, f, n);
    if (!a->t->solid && dot(n, near->away) < 0)
        weight = -weight;
    for (int i = 0; i < 3; i++)
        a->sum[i] += weight * n[i];
}

static void add_face(around *a, uint32_t f, const ebpo_face_box *box)
{
    const double(*face)[3] = (const double(*)[3])box->corner[f];
    ebpo_face_near near;
    ebpo_face_nearest(a->t->proxy, face, &near);
    double gap = near.distance - a->t->options.radius;
    if (!(gap < a->t->options.look))
        return;
    add_normal(a, face, &near, gap);
    if (near.distance >= a->nearest)
        return;
    a->nearest = near.distance;
    a->out->face = box->face[f];
    for (int i = 0; i < 3; i++) {
        a->out->weight[i] = near.weight[i];
        a->out->point[i] = a->t->proxy[i] - near.distance * near.away[i];
    }
}

static bool no_face_close(const ebpo_touch *t, const ebpo_extent *e)
{
    for (int i = 0; i < 3; i++)
        if (e->min[i] > t->root.max[i] || e->max[i] < t->root.min[i])
            return true;
    return false;
}

void ebpo_touch_look(ebpo_touch *t, ebpo_touch_result *out)
{
    const ebpo_face_box *box = &t->box[t->at];
    double wide = t->options.radius + t->options.look;
    around a = { .t = t, .nearest = INFINITY, .out = out };
    ebpo_extent e;
    uint32_t count = 0, visits = EBPO_TOUCH_VISITS;
    for (int i = 0; i < 3; i++) {
        e.min[i] = t->proxy[i] - wide;
        e.max[i] = t->proxy[i] + wide;
    }
    out->face = EBPO_NO_FACE;
    if (ebpo_extent_holds(&box->centres, t->proxy)) {
        if (!ebpo_face_box_find(box, &e, t->found, EBPO_TOUCH_FACES, &visits, &count))
            out->flags |= EBPO_TOUCH_PARTLY;
    } else if (!no_face_close(t, &e)) {
        out->flags |= EBPO_TOUCH_PARTLY;
    }
    out->work += count;
    for (uint32_t i = 0; i < count; i++)
        add_face(&a, t->found[i], box);
    double length = sqrt(dot(a.sum, a.sum));
    for (int i = 0; i < 3; i++)
        out->normal[i] = length > 0 ? a.sum[i] / length : 0;
    out->depth = -fmin(t->options.look, a.nearest - t->options.radius);
}
