/* A piece of a tool's way. First each point that may meet a face is followed along it, to where the
 * first one comes too close. Then all these points are looked at where they will be: exact
 * arithmetic says that they went through nothing, and distances, that they are not too close. Only
 * then the tool is there. Both may take several ticks, if many points are close. */
#include "core/strict_fp.h"

#include "extras/haptic/face_near.h"
#include "extras/haptic/tool.h"
#include "extras/haptic/touch_parts.h"

enum { CLUSTER_VISITS = 64, POINT_VISITS = 48, FACE_VISITS = 256, FACE_COST = 6 };

/* Of the skin: faces this close are looked at; the way ends where a point would come closer; where
 * it ends none is closer. What turning adds to straight ways is less than a bend (see limit). */
static const double looks = 2.5, blocks = 0.75, least = 0.5, bend = 0.125;

typedef struct piece {
    ebpo_touch *t;
    ebpo_tool *tool;
    const ebpo_face_box *box; /* NULL: there are no faces where it goes */
    double skin, turned;      /* the angle of the whole way */
    uint64_t *work;
} piece;

static piece piece_of(ebpo_touch *t, uint64_t *work)
{
    ebpo_tool *tool = t->tool;
    const ebpo_face_box *box = &t->box[t->at];
    bool known = ebpo_extent_holds(&box->centres, tool->proxy.place);
    return (piece){ t,
                    tool,
                    known ? box : NULL,
                    t->options.skin,
                    sqrt(dot(tool->way + 3, tool->way + 3)) / tool->arm,
                    work };
}

static void around(const double p[3], const double q[3], double wide, ebpo_extent *out)
{
    for (int i = 0; i < 3; i++) {
        out->min[i] = fmin(p[i], q[i]) - wide;
        out->max[i] = fmax(p[i], q[i]) + wide;
    }
}

/* No face is closer to anything in `e`: by those of the box, by where what was loaded ends, and by
 * where the model does. */
static double clearance(const piece *p, const ebpo_extent *e, uint32_t visits)
{
    double out = 0, inside = INFINITY;
    for (int i = 0; i < 3; i++)
        out = fmax(out, fmax(p->t->root.min[i] - e->max[i], e->min[i] - p->t->root.max[i]));
    if (!p->box)
        return out;
    for (int i = 0; i < 3; i++)
        inside = fmin(inside,
                      fmin(e->min[i] - p->box->loaded.min[i], p->box->loaded.max[i] - e->max[i]));
    return fmax(out, fmin(inside, ebpo_face_box_clearance(p->box, e, visits, p->work)));
}

/* As far as a point goes at most whose way from the middle of the turn is so long. */
static double far(const piece *p, double lever)
{
    return sqrt(dot(p->tool->way, p->tool->way)) + lever * p->turned;
}

static double lever_of(const double p[3]) { return sqrt(dot(p, p)); }

static double most_way(const piece *p, const ebpo_tool_cluster *c)
{
    return far(p, lever_of(c->middle) + c->radius) * (1 + 0x1p-40);
}

/* False: the pool is full, or too many faces are in one place. */
static bool add_close(const piece *p, uint32_t point)
{
    ebpo_tool *tool = p->tool;
    double from[3], way[3], to[3];
    ebpo_extent e;
    uint32_t count, visits = FACE_VISITS;
    ebpo_tool_at(&tool->proxy, (const double(*)[3])tool->from_matrix, tool->point[point], from);
    ebpo_rigid_lever((const double(*)[3])tool->to_matrix, tool->point[point], way);
    for (int i = 0; i < 3; i++)
        to[i] = tool->proxy.place[i] + tool->way[i] + way[i];
    difference(to, from, way);
    around(from, to, looks * p->skin, &e);
    if (tool->pool_count + EBPO_TOOL_NEAR > EBPO_TOOL_POOL)
        return false;
    bool all = ebpo_face_box_find(p->box, &e, tool->pool + tool->pool_count, EBPO_TOOL_NEAR,
                                  &visits, &count);
    *p->work += FACE_VISITS - visits + FACE_COST * (uint64_t)count;
    if (!all)
        return false;
    const ebpo_ball_way w = { from, way, blocks * p->skin, p->t->band, 0, 0 };
    for (uint32_t i = 0; i < count; i++) {
        double away[3];
        double met =
            ebpo_ball_meets(&w,
                            (const double(*)[3])p->box->corner[tool->pool[tool->pool_count + i]],
                            away);
        tool->part = fmin(tool->part, met);
    }
    tool->close[tool->close_count++] =
        (ebpo_tool_close){ point, (uint32_t)tool->pool_count, count };
    tool->pool_count += count;
    return true;
}

/* Points of a cluster that as a whole may meet faces. */
static bool look_at_points(const piece *p, uint32_t number)
{
    ebpo_tool *tool = p->tool;
    ebpo_tool_cluster *c = &tool->cluster[number];
    double need = looks * p->skin;
    double all = INFINITY;
    c->free = 0; /* if it is given up */
    for (uint32_t i = c->first; i < c->first + c->count; i++) {
        double way = far(p, lever_of(tool->point[i])) * (1 + 0x1p-40);
        if (tool->free[i] - c->gone - way <= 0) {
            double at[3];
            ebpo_extent e;
            ebpo_tool_at(&tool->proxy, (const double(*)[3])tool->from_matrix, tool->point[i], at);
            around(at, at, 0, &e);
            tool->free[i] = c->gone + clearance(p, &e, POINT_VISITS) - need;
        }
        if (tool->free[i] - c->gone - way <= 0 && !add_close(p, i))
            return false;
        all = fmin(all, tool->free[i]);
    }
    c->free = all;
    return true;
}

static bool look_at_cluster(const piece *p, uint32_t number)
{
    ebpo_tool *tool = p->tool;
    ebpo_tool_cluster *c = &tool->cluster[number];
    double way = most_way(p, c);
    ++*p->work;
    if (!p->box || c->free - c->gone - way > 0)
        return true;
    double at[3], from_all;
    ebpo_extent e;
    ebpo_tool_at(&tool->proxy, (const double(*)[3])tool->from_matrix, c->middle, at);
    around(at, at, c->radius, &e);
    from_all = clearance(p, &e, CLUSTER_VISITS) - looks * p->skin;
    if (from_all - way <= 0)
        return look_at_points(p, number);
    c->free = c->gone + from_all;
    for (uint32_t i = c->first; i < c->first + c->count; i++)
        tool->free[i] = fmax(tool->free[i], c->free);
    return true;
}

static void add_contact(const piece *p, const ebpo_tool_close *close, uint32_t face,
                        const ebpo_face_near *near)
{
    ebpo_tool *tool = p->tool;
    ebpo_tool_contact c = { .room = near->distance - p->skin,
                            .gap = near->distance,
                            .point = tool->number[close->point],
                            .face = p->box->face[face] };
    double lever[3];
    ebpo_rigid_lever((const double(*)[3])tool->end_matrix, tool->point[close->point], lever);
    copy(near->away, c.normal);
    copy(near->away, c.grip);
    cross(lever, near->away, c.grip + 3);
    for (int i = 0; i < 3; i++)
        c.grip[3 + i] /= tool->arm;
    ebpo_tool_contact_add(&tool->next, &c);
}

/* Of faces that meet in an edge, one is below the point and pushes it straight away; the others
 * would hold it back from going on to them, askew. So a face counts if what is nearest of it lies
 * in its inside, or if it is the nearest of all. */
static void add_contacts(const piece *p, const ebpo_tool_close *close, const ebpo_face_near *near)
{
    double nearest = INFINITY;
    for (uint32_t i = 0; i < close->count; i++)
        nearest = fmin(nearest, near[i].distance);
    for (uint32_t i = 0; i < close->count; i++) {
        const double *w = near[i].weight;
        bool straight = w[0] > 0 && w[1] > 0 && w[2] > 0;
        if (near[i].distance < looks * p->skin &&
            (straight || near[i].distance <= nearest + 0x1p-10 * p->skin))
            add_contact(p, close, p->tool->pool[close->first + i], &near[i]);
    }
}

/* Where the point will be. False: it may not. */
static bool check_close(const piece *p, const ebpo_tool_close *close)
{
    ebpo_tool *tool = p->tool;
    ebpo_face_near near[EBPO_TOOL_NEAR];
    double from[3], to[3];
    ebpo_tool_at(&tool->proxy, (const double(*)[3])tool->from_matrix, tool->point[close->point],
                 from);
    ebpo_tool_at(&tool->end, (const double(*)[3])tool->end_matrix, tool->point[close->point], to);
    *p->work += FACE_COST * (uint64_t)close->count;
    for (uint32_t i = 0; i < close->count; i++) {
        const double(*face)[3] = (const double(*)[3])p->box->corner[tool->pool[close->first + i]];
        ebpo_face_nearest(to, face, &near[i]);
        if (tool->part > 0 && (near[i].distance < least * p->skin + p->t->band ||
                               ebpo_segment_may_meet(from, to, face)))
            return false;
    }
    add_contacts(p, close, near);
    return true;
}

static void begin_check(ebpo_tool *tool)
{
    tool->stage = EBPO_TOOL_CHECKS;
    tool->at = 0;
    tool->next.count = 0;
    tool->end = tool->proxy;
    if (tool->part > 0)
        ebpo_rigid_go(&tool->proxy, tool->way, tool->part, tool->arm, &tool->end);
    ebpo_rigid_matrix(&tool->end, tool->end_matrix);
}

/* It is there: what each point may still go is less by that. */
static void arrive(const piece *p)
{
    ebpo_tool *tool = p->tool;
    for (uint64_t i = 0; i < tool->cluster_count; i++)
        tool->cluster[i].gone += tool->part * most_way(p, &tool->cluster[i]) + 0x1p-8 * p->t->band;
    tool->contacts = tool->next;
    tool->proxy = tool->end;
    tool->stage = EBPO_TOOL_STANDS;
}

/* Straight ways and turns differ by no more than lever times angle^2 / 8. */
static void limit(ebpo_touch *t, double way[EBPO_SCREW], uint32_t *flags)
{
    ebpo_tool *tool = t->tool;
    double most = fmin(0.25, sqrt(8 * bend * t->options.skin / tool->radius));
    double angle = sqrt(dot(way + 3, way + 3)) / tool->arm, part = 1;
    if (angle > most)
        part = most / angle;
    double length = screw_length(way);
    if (part * length > t->stride)
        part = t->stride / length;
    if (part >= 1)
        return;
    *flags |= EBPO_TOUCH_SHORT;
    for (int k = 0; k < EBPO_SCREW; k++)
        way[k] *= part;
}

bool ebpo_tool_set_out(ebpo_touch *t, const double wanted[EBPO_SCREW], uint32_t *flags)
{
    ebpo_tool *tool = t->tool;
    for (int k = 0; k < EBPO_SCREW; k++)
        tool->way[k] = wanted[k];
    tool->flags = 0;
    limit(t, tool->way, &tool->flags);
    double part = ebpo_touch_known_part(t, tool->way, tool->radius + looks * t->options.skin);
    if (part < 1) {
        tool->flags |= EBPO_TOUCH_WAITS;
        if (part <= 0) {
            *flags |= EBPO_TOUCH_WAITS;
            return false;
        }
        for (int k = 0; k < EBPO_SCREW; k++)
            tool->way[k] *= part;
    }
    ebpo_rigid_matrix(&tool->proxy, tool->from_matrix);
    ebpo_rigid end;
    ebpo_rigid_go(&tool->proxy, tool->way, 1, tool->arm, &end);
    ebpo_rigid_matrix(&end, tool->to_matrix);
    tool->stage = EBPO_TOOL_LOOKS;
    tool->at = tool->close_count = tool->pool_count = 0;
    tool->part = 1;
    return true;
}

/* A way along which too much is close: a shorter one the next time. */
static uint32_t give_up(piece *p)
{
    p->t->stride = fmax(0.25 * screw_length(p->tool->way), 0x1p-8 * p->skin);
    p->tool->stage = EBPO_TOOL_STANDS;
    return EBPO_TOUCH_SHORT;
}

uint32_t ebpo_tool_go_on(ebpo_touch *t, uint64_t *work, bool *arrived)
{
    piece p = piece_of(t, work);
    ebpo_tool *tool = t->tool;
    *arrived = false;
    for (; tool->stage == EBPO_TOOL_LOOKS && tool->at < tool->cluster_count; tool->at++) {
        if (*work > EBPO_TOOL_WORK)
            return EBPO_TOUCH_SHORT;
        if (!look_at_cluster(&p, (uint32_t)tool->at))
            return give_up(&p);
    }
    if (tool->stage == EBPO_TOOL_LOOKS)
        begin_check(tool);
    for (; tool->at < tool->close_count; tool->at++) {
        if (*work > EBPO_TOOL_WORK)
            return EBPO_TOUCH_SHORT;
        if (!check_close(&p, &tool->close[tool->at]))
            return give_up(&p);
    }
    arrive(&p);
    *arrived = true;
    if (t->stride < t->diagonal && tool->pool_count < EBPO_TOOL_POOL / 4)
        t->stride *= 2;
    return tool->part < 1 ? 0 : tool->flags;
}
