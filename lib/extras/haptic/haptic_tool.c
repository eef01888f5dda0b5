/* Computes a haptic step of a tool (a rigid set of points). The motion follows Gauss' principle for
 * a body without mass: among all motions that the contacts allow, the tool makes the motion that is
 * nearest to the device's motion (Ortega, Redon, Coquillart 2007).
 *
 * The path of a step consists of pieces. A piece is computed in two passes. The first pass follows
 * each point that may hit a face, and ends the piece where the first point comes too close to a
 * face. The second pass examines these points at their new positions: exact arithmetic checks that
 * no point has crossed a face, and computed distances show that no point is too close to a face.
 * After that, the tool moves to the end of the piece. If many points are close to faces, a pass may
 * take several haptic steps. */
#include "core/strict_fp.h"

#include "core/fp_env.h"
#include "extras/haptic/face_box.h"
#include "extras/haptic/tool.h"
#include "extras/haptic/haptic_parts.h"

/* Limits of visited nodes in a search. CLUSTER_VISITS: around a cluster; POINT_VISITS: around a
 * point; KEPT_VISITS: for the kept faces of a point; FACE_VISITS: for the faces around a point's
 * path. FACE_COST, CONTACT_COST: work of examining a face or a contact, in visited nodes. */
enum {
    CLUSTER_VISITS = 400,
    POINT_VISITS = 48,
    KEPT_VISITS = 192,
    FACE_VISITS = 256,
    FACE_COST = 6,
    CONTACT_COST = 6
};

/* A search for a distance ends at this multiple of the needed distance. A wider search saves later
 * searches for points that are far from faces, but visits more nodes. */
static const double search_multiple = 16;

/* Distances in units of the skin. */
static const double search_distance =
    2.5; /* faces within this distance of a point's path are examined */
static const double stop_distance = 0.75; /* a piece ends where a point is this close to a face */
static const double least_distance =
    0.5;                              /* at the end of a piece, no point may be closer to a face */
static const double max_bend = 0.125; /* a rotating point may be this far from its straight path;
                                       * see limit_angle */

typedef struct tool_piece {
    ebpo_haptic *t;
    ebpo_tool *tool;
    const ebpo_face_box *box; /* NULL: the current box does not contain the proxy, because no face
                               * is near the path */
    double skin;              /* distance that the tool keeps from faces (ebpo_haptic_options) */
    double length, angle;     /* of the piece: length of its translation, and angle of its rotation
                               * in radians */
    uint64_t *work;           /* work of the haptic step so far */
} tool_piece;

static tool_piece make_piece(ebpo_haptic *t, uint64_t *work)
{
    ebpo_tool *tool = t->tool;
    const ebpo_face_box *box = &t->box[t->current_box];
    bool is_in_box = ebpo_extent_holds(&box->allowed, tool->proxy.place);
    return (tool_piece){ t,
                         tool,
                         is_in_box ? box : NULL,
                         t->options.skin,
                         sqrt(ebpo_vec3_dot(tool->motion, tool->motion)),
                         sqrt(ebpo_vec3_dot(tool->motion + 3, tool->motion + 3)) / tool->arm,
                         work };
}

static void box_of_segment(const double p[3], const double q[3], double wide, ebpo_extent *out)
{
    for (int i = 0; i < 3; i++) {
        out->min[i] = fmin(p[i], q[i]) - wide;
        out->max[i] = fmax(p[i], q[i]) + wide;
    }
}

/* Returns a lower bound of the distance of `e` from all faces. The bound is computed from the faces
 * of the box and the boundary of the loaded region, or from the box of the model. needed: the
 * distance from which on the caller need not examine faces. *leaf: see ebpo_face_box_gap. */
static double free_distance(const tool_piece *p, const ebpo_extent *e, double needed,
                            uint32_t visits, uint64_t *leaf)
{
    double out = 0, inside = INFINITY;
    for (int i = 0; i < 3; i++)
        out = fmax(out, fmax(p->t->root.min[i] - e->max[i], e->min[i] - p->t->root.max[i]));
    if (!p->box)
        return out;
    for (int i = 0; i < 3; i++)
        inside = fmin(inside,
                      fmin(e->min[i] - p->box->loaded.min[i], p->box->loaded.max[i] - e->max[i]));
    double gap = ebpo_face_box_gap(p->box, e, search_multiple * needed, visits, leaf, p->work);
    return fmax(out, fmin(inside, gap));
}

/* Bounds the motion of points whose distance from the tool's centre is at most `lever`. */
static double max_motion(const tool_piece *p, double lever)
{
    return (p->length + lever * p->angle) * (1 + 0x1p-40);
}

/* Sets the end of the point's straight path if the piece is complete. */
static void end_of_point(const tool_piece *p, uint32_t point, double out[3])
{
    const ebpo_tool *tool = p->tool;
    double lever[3];
    ebpo_rigid_lever((const double(*)[3])tool->to_matrix, tool->point[point], lever);
    for (int i = 0; i < 3; i++)
        out[i] = tool->proxy.place[i] + tool->motion[i] + lever[i];
}

/* Adds a point to tool->close_points with the last `count` faces of the pool, which are around its
 * path. Ends the piece where the point comes too close to one of these faces. */
static void add_close_point(const tool_piece *p, uint32_t point, const double from[3],
                            const double to[3], uint32_t count)
{
    ebpo_tool *tool = p->tool;
    double motion[3];
    ebpo_vec3_subtract(to, from, motion);
    const ebpo_ball_motion ball = { from, motion, stop_distance * p->skin, p->t->band, 0, 0 };
    *p->work += FACE_COST * (uint64_t)count;
    for (uint32_t i = 0; i < count; i++) {
        double away[3];
        double fraction = ebpo_ball_first_contact(
            &ball, (const double(*)[3])p->box->corner[tool->pool[tool->pool_count + i]], away);
        tool->fraction = fmin(tool->fraction, fraction);
    }
    tool->close_points[tool->close_count++] =
        (ebpo_close_point){ point, (uint32_t)tool->pool_count, count };
    tool->pool_count += count;
}

/* Finds the faces around the path of a point, and adds the point to tool->close_points. Returns
 * false if the pool is full or too many faces are around the path. */
static bool find_close_point(const tool_piece *p, uint32_t point, const double from[3])
{
    ebpo_tool *tool = p->tool;
    double to[3];
    ebpo_extent e;
    uint32_t count, visits = FACE_VISITS;
    end_of_point(p, point, to);
    box_of_segment(from, to, search_distance * p->skin, &e);
    bool all = ebpo_face_box_find(p->box, &e, tool->pool + tool->pool_count, EBPO_TOOL_NEAR,
                                  &visits, &count);
    *p->work += FACE_VISITS - visits;
    if (all)
        add_close_point(p, point, from, to, count);
    return all;
}

/* Returns true if the kept faces of a point are all faces within `reach` of its position `at`. */
static bool are_kept(const tool_piece *p, const ebpo_kept_faces *kept, const double at[3],
                     double reach)
{
    double far = 0;
    for (int i = 0; i < 3; i++)
        far = fmax(far, fabs(at[i] - kept->middle[i]));
    return kept->serial == p->box->serial && far + reach <= kept->wide;
}

/* Finds the faces within `reach` of the position `at` of a point, and keeps them, if possible with
 * those of a wider surrounding. Returns false if there are too many to be kept. */
static bool keep_faces(const tool_piece *p, ebpo_kept_faces *kept, const double at[3], double reach)
{
    static const double widths[] = { 8, 1 };
    double loaded = INFINITY;
    for (int i = 0; i < 3; i++)
        loaded = fmin(loaded, fmin(at[i] - p->box->loaded.min[i], p->box->loaded.max[i] - at[i]));
    kept->serial = 0;
    for (int k = 0; k < 2 && kept->serial == 0 && reach < loaded; k++) {
        uint32_t visits = KEPT_VISITS;
        ebpo_extent e;
        kept->wide = fmin(widths[k] * reach, loaded) * (1 - 0x1p-40);
        box_of_segment(at, at, kept->wide, &e);
        ebpo_vec3_copy(at, kept->middle);
        if (ebpo_face_box_find(p->box, &e, kept->face, EBPO_TOOL_KEPT, &visits, &kept->count))
            kept->serial = p->box->serial;
        *p->work += KEPT_VISITS - visits;
    }
    return are_kept(p, kept, at, reach * (1 - 0x1p-30));
}

/* Examines a point with its kept faces: sets tool->safe_until, and adds the point to
 * tool->close_points if it may come too close to a face. motion: bound of its motion. */
static void inspect_kept(const tool_piece *p, uint32_t point, const double from[3], double motion,
                         double travelled)
{
    ebpo_tool *tool = p->tool;
    const ebpo_kept_faces *kept = &tool->kept[point];
    double margin = search_distance * p->skin, nearest = kept->wide, to[3];
    uint32_t count = 0;
    for (int i = 0; i < 3; i++)
        nearest = fmin(nearest, kept->wide - fabs(from[i] - kept->middle[i]));
    *p->work += FACE_COST * (uint64_t)kept->count;
    for (uint32_t i = 0; i < kept->count; i++) {
        ebpo_face_near near;
        ebpo_face_nearest(from, (const double(*)[3])p->box->corner[kept->face[i]], &near);
        double distance = near.distance - p->t->band;
        nearest = fmin(nearest, distance);
        if (distance - motion - margin <= 0)
            tool->pool[tool->pool_count + count++] = kept->face[i];
    }
    tool->safe_until[point] = travelled + nearest - margin;
    if (count == 0)
        return;
    end_of_point(p, point, to);
    add_close_point(p, point, from, to, count);
}

/* Examines a point of a cluster. motion: bound of its motion. Returns false if the piece must be
 * given up. */
static bool inspect_point(const tool_piece *p, ebpo_tool_cluster *c, uint32_t point, double motion)
{
    ebpo_tool *tool = p->tool;
    double margin = search_distance * p->skin, travelled = ebpo_tool_travelled(tool, c->lever);
    double from[3];
    if (tool->safe_until[point] - travelled - motion > 0)
        return true;
    if (tool->pool_count + EBPO_TOOL_NEAR > EBPO_TOOL_POOL)
        return false;
    ebpo_tool_at(&tool->proxy, (const double(*)[3])tool->from_matrix, tool->point[point], from);
    if (are_kept(p, &tool->kept[point], from, motion + margin) ||
        keep_faces(p, &tool->kept[point], from, motion + margin)) {
        inspect_kept(p, point, from, motion, travelled);
        return true;
    }
    ebpo_extent e;
    box_of_segment(from, from, 0, &e);
    tool->safe_until[point] =
        travelled + free_distance(p, &e, motion + margin, POINT_VISITS, &c->leaf) - margin;
    return tool->safe_until[point] - travelled - motion > 0 || find_close_point(p, point, from);
}

/* Examines the points of a cluster whose bounding ball may hit faces, from tool->next_point on.
 * Returns false if the piece must be given up. If the work of the haptic step is done before, the
 * next step continues with tool->next_point; otherwise sets it to 0. */
static bool inspect_points(const tool_piece *p, ebpo_tool_cluster *c, double motion)
{
    ebpo_tool *tool = p->tool;
    double least = INFINITY;
    c->safe_until = 0; /* not known, until all points have been examined */
    for (; tool->next_point < c->count; tool->next_point++) {
        if (tool->next_point > 0 && *p->work > EBPO_TOOL_WORK)
            return true;
        if (!inspect_point(p, c, c->first + tool->next_point, motion))
            return false;
    }
    tool->next_point = 0;
    for (uint32_t i = c->first; i < c->first + c->count; i++)
        least = fmin(least, tool->safe_until[i]);
    c->safe_until = least;
    return true;
}

/* Returns true if less than half of the points of a cluster must be examined again. */
static bool few_expired(const tool_piece *p, const ebpo_tool_cluster *c, double motion)
{
    double used = ebpo_tool_travelled(p->tool, c->lever) + motion;
    uint32_t expired = 0;
    for (uint32_t i = c->first; i < c->first + c->count; i++)
        expired += p->tool->safe_until[i] - used <= 0;
    return 2 * expired < c->count;
}

/* Examines a cluster of points. Returns false if the piece must be given up. */
static bool inspect_cluster(const tool_piece *p, uint32_t number)
{
    ebpo_tool *tool = p->tool;
    ebpo_tool_cluster *c = &tool->cluster[number];
    double motion = max_motion(p, c->lever), travelled = ebpo_tool_travelled(tool, c->lever);
    ++*p->work;
    if (tool->next_point == 0 && c->safe_until - travelled - motion > 0)
        return true;
    if (tool->next_point > 0 || few_expired(p, c, motion))
        return inspect_points(p, c, motion);
    double at[3], distance, margin = search_distance * p->skin;
    ebpo_extent e;
    ebpo_tool_at(&tool->proxy, (const double(*)[3])tool->from_matrix, c->middle, at);
    box_of_segment(at, at, c->radius, &e);
    distance = free_distance(p, &e, motion + margin, CLUSTER_VISITS, &c->leaf) - margin;
    if (distance - motion <= 0)
        return inspect_points(p, c, motion);
    c->safe_until = travelled + distance;
    for (uint32_t i = c->first; i < c->first + c->count; i++)
        tool->safe_until[i] = fmax(tool->safe_until[i], c->safe_until);
    return true;
}

static void add_contact(const tool_piece *p, const ebpo_close_point *close, uint32_t face,
                        const ebpo_face_near *near)
{
    ebpo_tool *tool = p->tool;
    ebpo_tool_contact c = { .space = near->distance - p->skin,
                            .gap = near->distance,
                            .point = tool->number[close->point],
                            .face = p->box->face[face],
                            .instance = p->box->instance[face] };
    double lever[3];
    ebpo_rigid_lever((const double(*)[3])tool->end_matrix, tool->point[close->point], lever);
    ebpo_vec3_copy(near->away, c.normal);
    ebpo_vec3_copy(near->away, c.grip);
    ebpo_vec3_cross(lever, near->away, c.grip + 3);
    for (int i = 0; i < 3; i++)
        c.grip[3 + i] /= tool->arm;
    *p->work += CONTACT_COST;
    ebpo_tool_contact_add(&tool->next, &c);
}

/* Adds the contacts of a point. A face directly below the point pushes the point along the face's
 * normal. A neighbouring face would push from the shared edge, at an angle. So a face counts only
 * if the face's nearest point is in its interior, or if no other face is nearer. near: nearest
 * points of close->count faces. */
static void add_contacts(const tool_piece *p, const ebpo_close_point *close,
                         const ebpo_face_near *near)
{
    double nearest = INFINITY;
    for (uint32_t i = 0; i < close->count; i++)
        nearest = fmin(nearest, near[i].distance);
    for (uint32_t i = 0; i < close->count; i++) {
        const double *w = near[i].weight;
        bool straight = w[0] > 0 && w[1] > 0 && w[2] > 0;
        if (near[i].distance < search_distance * p->skin &&
            (straight || near[i].distance <= nearest + 0x1p-10 * p->skin))
            add_contact(p, close, p->tool->pool[close->first + i], &near[i]);
    }
}

/* Checks the new position of a point, and adds the contacts at this position. Returns false if the
 * point has crossed a face or is too close to a face. */
static bool check_close_point(const tool_piece *p, const ebpo_close_point *close)
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
        if (tool->fraction > 0 && (near[i].distance < least_distance * p->skin + p->t->band ||
                                   ebpo_segment_may_intersect(from, to, face)))
            return false;
    }
    add_contacts(p, close, near);
    return true;
}

static void begin_check(ebpo_tool *tool)
{
    tool->stage = EBPO_TOOL_CHECKS;
    tool->next_index = 0;
    tool->next.count = 0;
    tool->end = tool->proxy;
    if (tool->fraction > 0)
        ebpo_rigid_move(&tool->proxy, tool->motion, tool->fraction, tool->arm, &tool->end);
    ebpo_rigid_matrix(&tool->end, tool->end_matrix);
}

/* Moves the tool to the end of the piece, and adds the motion to the length of its path. */
static void end_piece(const tool_piece *p)
{
    ebpo_tool *tool = p->tool;
    tool->moved += tool->fraction * p->length * (1 + 0x1p-40) + 0x1p-8 * p->t->band;
    tool->turned += tool->fraction * p->angle * (1 + 0x1p-40);
    tool->contacts = tool->next;
    tool->proxy = tool->end;
    tool->stage = EBPO_TOOL_IDLE;
}

/* If a motion's angle or length is too great, shortens the motion and sets a bit of *flags. The
 * path of a point differs from a straight path by at most lever * angle^2 / 8. */
static void limit_angle(ebpo_haptic *t, double motion[EBPO_SCREW], uint32_t *flags)
{
    ebpo_tool *tool = t->tool;
    double most = fmin(0.25, sqrt(8 * max_bend * t->options.skin / tool->radius));
    double angle = sqrt(ebpo_vec3_dot(motion + 3, motion + 3)) / tool->arm, fraction = 1;
    if (angle > most)
        fraction = most / angle;
    double length = ebpo_screw_length(motion);
    if (fraction * length > t->max_piece)
        fraction = t->max_piece / length;
    if (fraction >= 1)
        return;
    *flags |= EBPO_HAPTIC_PATH_UNFINISHED;
    for (int k = 0; k < EBPO_SCREW; k++)
        motion[k] *= fraction;
}

/* Begins a piece along `wanted`, which is shortened if necessary. Returns false, and sets a bit of
 * *flags, if the piece cannot begin. */
static bool begin_tool_motion(ebpo_haptic *t, const double wanted[EBPO_SCREW], uint32_t *flags)
{
    ebpo_tool *tool = t->tool;
    for (int k = 0; k < EBPO_SCREW; k++)
        tool->motion[k] = wanted[k];
    tool->flags = 0;
    limit_angle(t, tool->motion, &tool->flags);
    double fraction =
        ebpo_haptic_loaded_part(t, tool->motion, tool->radius + search_distance * t->options.skin);
    if (fraction < 1) {
        tool->flags |= EBPO_HAPTIC_WAITING;
        if (fraction <= 0) {
            *flags |= EBPO_HAPTIC_WAITING;
            return false;
        }
        for (int k = 0; k < EBPO_SCREW; k++)
            tool->motion[k] *= fraction;
    }
    ebpo_rigid_matrix(&tool->proxy, tool->from_matrix);
    ebpo_rigid end;
    ebpo_rigid_move(&tool->proxy, tool->motion, 1, tool->arm, &end);
    ebpo_rigid_matrix(&end, tool->to_matrix);
    tool->stage = EBPO_TOOL_SEARCHES;
    tool->next_point = 0;
    tool->next_index = tool->close_count = tool->pool_count = tool->piece_work = 0;
    tool->fraction = 1;
    return true;
}

/* Abandons the piece, because too many faces are close or the tool must not move to the end of the
 * piece. Makes the next piece shorter. */
static uint32_t give_up_piece(tool_piece *p)
{
    p->t->max_piece = fmax(0.25 * ebpo_screw_length(p->tool->motion), 0x1p-8 * p->skin);
    p->tool->stage = EBPO_TOOL_IDLE;
    return EBPO_HAPTIC_PATH_UNFINISHED;
}

/* If the next cluster is the first one of a group that is safe in this piece, moves on to the next
 * group, and returns true. */
static bool skip_group(const tool_piece *p)
{
    ebpo_tool *tool = p->tool;
    const ebpo_tool_group *g = &tool->group[tool->next_index / EBPO_TOOL_GROUP];
    if (tool->next_index % EBPO_TOOL_GROUP != 0 ||
        g->safe_until - ebpo_tool_travelled(tool, g->lever) - max_motion(p, g->lever) <= 0)
        return false;
    ++*p->work;
    tool->next_index += EBPO_TOOL_GROUP;
    return true;
}

/* Sets `safe_until` of the group whose last cluster has been examined. */
static void end_group(const tool_piece *p)
{
    ebpo_tool *tool = p->tool;
    uint64_t end = tool->next_index;
    ebpo_tool_group *g = &tool->group[end / EBPO_TOOL_GROUP - 1];
    double least = INFINITY;
    for (uint64_t i = end - EBPO_TOOL_GROUP; i < end; i++)
        least = fmin(least, tool->cluster[i].safe_until -
                                ebpo_tool_travelled(tool, tool->cluster[i].lever));
    g->safe_until = ebpo_tool_travelled(tool, g->lever) + least;
}

/* Continues the piece, within the work of a haptic step. Returns bits of ebpo_haptic_flag.
 * *arrived: the tool has moved to the end of the piece. */
static uint32_t continue_piece(ebpo_haptic *t, uint64_t *work, bool *arrived)
{
    tool_piece p = make_piece(t, work);
    ebpo_tool *tool = t->tool;
    while (p.box && tool->stage == EBPO_TOOL_SEARCHES && tool->next_index < tool->cluster_count) {
        if (*work > EBPO_TOOL_WORK)
            return EBPO_HAPTIC_PATH_UNFINISHED;
        if (skip_group(&p))
            continue;
        if (!inspect_cluster(&p, (uint32_t)tool->next_index))
            return give_up_piece(&p);
        if (tool->next_point > 0)
            return EBPO_HAPTIC_PATH_UNFINISHED;
        if (++tool->next_index % EBPO_TOOL_GROUP == 0)
            end_group(&p);
    }
    if (tool->stage == EBPO_TOOL_SEARCHES)
        begin_check(tool);
    for (; tool->next_index < tool->close_count; tool->next_index++) {
        if (*work > EBPO_TOOL_WORK)
            return EBPO_HAPTIC_PATH_UNFINISHED;
        if (!check_close_point(&p, &tool->close_points[tool->next_index]))
            return give_up_piece(&p);
    }
    /* Without a new contact, the next piece would be the same. */
    tool->jams = tool->fraction == 0 && tool->next.count <= tool->contacts.count;
    end_piece(&p);
    *arrived = true;
    return tool->fraction < 1 ? 0 : tool->flags;
}

/* Does the same as continue_piece, and sets t->max_piece so that a piece takes about a quarter of
 * the work of a haptic step. A shorter piece examines fewer points, and the points' kept faces
 * serve several pieces. */
static uint32_t continue_tool_motion(ebpo_haptic *t, uint64_t *work, bool *arrived)
{
    ebpo_tool *tool = t->tool;
    uint64_t before = *work;
    *arrived = false;
    uint32_t flags = continue_piece(t, work, arrived);
    tool->piece_work += *work - before;
    if (*arrived && tool->piece_work > EBPO_TOOL_WORK / 3)
        t->max_piece = fmax(0.5 * ebpo_screw_length(tool->motion), 8 * t->options.skin);
    else if (*arrived && tool->piece_work < EBPO_TOOL_WORK / 6 && t->max_piece < t->diagonal)
        t->max_piece *= 2;
    return flags;
}

/* --- the step --- */

static double contact_tolerance(const ebpo_haptic *t) { return 0x1p-6 * t->options.skin; }

/* Applies Coulomb friction. The contacts allow `motion` and prevent the rest of `want`, its
 * difference from `motion`. Shortens `motion` by the coefficient of friction times the length of
 * this rest. */
static void apply_friction(const ebpo_haptic *t, const double want[EBPO_SCREW],
                           double motion[EBPO_SCREW])
{
    double held[EBPO_SCREW];
    for (int k = 0; k < EBPO_SCREW; k++)
        held[k] = want[k] - motion[k];
    double length = ebpo_screw_length(motion);
    double friction = t->options.friction * ebpo_screw_length(held);
    double fraction = length > friction ? 1 - friction / length : 0;
    for (int k = 0; k < EBPO_SCREW; k++)
        motion[k] *= fraction;
}

/* If the tool jams, begins a piece that only moves the points that touch back to the distance of
 * the skin. A point that is closer than stop_distance to two faces cannot slide along one of them
 * to the edge of the other: each motion along the face, however short, comes closer to the other
 * face. Returns false if no piece begins. */
static bool begin_retreat(ebpo_haptic *t, uint32_t *flags)
{
    ebpo_tool *tool = t->tool;
    static const double stay[EBPO_SCREW];
    double motion[EBPO_SCREW];
    if (!tool->jams)
        return false;
    tool->jams = false;
    (void)ebpo_tool_hold(&tool->contacts, stay, contact_tolerance(t), true, motion);
    return ebpo_screw_length(motion) > contact_tolerance(t) / 2 &&
           begin_tool_motion(t, motion, flags);
}

/* Computes the motion that the contacts allow, and begins a piece along it. Returns false if the
 * tool stays. */
static bool begin_path(ebpo_haptic *t, const ebpo_rigid *device, uint32_t *flags)
{
    ebpo_tool *tool = t->tool;
    double want[EBPO_SCREW], motion[EBPO_SCREW];
    if (begin_retreat(t, flags))
        return true;
    ebpo_rigid_between(&tool->proxy, device, tool->arm, want);
    int holding = ebpo_tool_hold(&tool->contacts, want, contact_tolerance(t), true, motion);
    if (holding > 0 && t->touching && t->options.friction > 0)
        apply_friction(t, want, motion);
    if (ebpo_screw_length(motion) <= contact_tolerance(t) / 2)
        return false;
    return begin_tool_motion(t, motion, flags);
}

/* Moves the tool towards the device in a few pieces. Returns bits of ebpo_haptic_flag. */
static uint32_t move_proxy(ebpo_haptic *t, const ebpo_rigid *device, uint64_t *work)
{
    ebpo_tool *tool = t->tool;
    uint32_t flags = 0;
    tool->path_count = 1;
    tool->path[0] = tool->proxy;
    for (int piece = 0; piece < EBPO_TOOL_PIECES; piece++) {
        bool arrived;
        if (tool->stage == EBPO_TOOL_IDLE) {
            if (*work > EBPO_TOOL_WORK)
                return flags | EBPO_HAPTIC_PATH_UNFINISHED;
            (void)ebpo_haptic_take_box(t);
            *work += CONTACT_COST * (uint64_t)tool->contacts.count; /* work of the contacts */
            if (!begin_path(t, device, &flags))
                return flags;
        }
        flags |= continue_tool_motion(t, work, &arrived);
        ebpo_vec3_copy(tool->proxy.place, t->proxy);
        if (arrived)
            tool->path[tool->path_count++] = tool->proxy;
        if (!arrived || (flags & EBPO_HAPTIC_WAITING))
            return flags;
    }
    return flags | EBPO_HAPTIC_PATH_UNFINISHED;
}

/* Computes the vector from device to proxy, or, in cases that are explained below, only the
 * component of this vector that contacts cause. Returns the number of contacts that hold the
 * tool. */
static int find_depth(const ebpo_haptic *t, const ebpo_rigid *device, uint32_t flags,
                      double out[EBPO_SCREW])
{
    const ebpo_tool *tool = t->tool;
    double want[EBPO_SCREW], motion[EBPO_SCREW];
    ebpo_rigid_between(&tool->proxy, device, tool->arm, want);
    int holding = ebpo_tool_hold(&tool->contacts, want, contact_tolerance(t), false, motion);
    /* With friction, a tool that has completed its path is held in all directions, so the whole
     * vector counts. Without friction, or on an incomplete path, motions that the contacts allow
     * do not count. */
    bool held_only =
        flags & (EBPO_HAPTIC_WAITING | EBPO_HAPTIC_PATH_UNFINISHED) || t->options.friction == 0;
    for (int k = 0; k < EBPO_SCREW; k++)
        out[k] = (held_only ? motion[k] : 0) - want[k];
    return holding;
}

/* Reports the number of contacts, and the face and the point of the nearest contact. */
static void report_contact(const ebpo_haptic *t, ebpo_haptic_tool_result *out)
{
    const ebpo_tool_contacts *all = &t->tool->contacts;
    const ebpo_tool_contact *nearest = NULL;
    out->face = out->point = EBPO_NO_FACE;
    out->contacts = (uint64_t)all->count;
    for (int i = 0; i < all->count; i++)
        if (!nearest || all->at[i].gap < nearest->gap)
            nearest = &all->at[i];
    if (!nearest)
        return;
    out->point = nearest->point;
    out->face = nearest->face;
    out->instance = nearest->instance;
    ebpo_vec3_copy(nearest->normal, out->normal);
}

static void compute_force(ebpo_haptic *t, const double depth[EBPO_SCREW],
                          const double moved[EBPO_SCREW], ebpo_haptic_tool_result *out)
{
    ebpo_tool *tool = t->tool;
    double *force = tool->force;
    ebpo_passive_push(&t->passive, t->options.damping / t->options.step_seconds, depth, moved,
                      EBPO_SCREW, force);
    for (int i = 0; i < 3; i++) {
        out->force[i] = force[i];
        out->torque[i] = force[3 + i] * tool->arm;
    }
}

void ebpo_haptic_step_tool(ebpo_haptic *t, const double place[3], const double turn[4],
                           ebpo_haptic_tool_result *out)
{
    EBPO_DEFAULT_FP;
    ebpo_tool *tool = t->tool;
    ebpo_rigid device;
    double moved[EBPO_SCREW], depth[EBPO_SCREW];
    *out = (ebpo_haptic_tool_result){ .face = EBPO_NO_FACE, .point = EBPO_NO_FACE };
    if (!tool) {
        out->flags = EBPO_HAPTIC_WRONG_KIND;
        return;
    }
    bool bad_input = !ebpo_rigid_read(place, turn, &device);
    if (bad_input)
        device = tool->device;
    ebpo_rigid_between(&tool->device, &device, tool->arm, moved);
    ebpo_passive_moved(&t->passive, tool->force, moved, EBPO_SCREW);
    uint32_t flags = move_proxy(t, &device, &out->work);
    int holding = find_depth(t, &device, flags, depth);
    t->touching = holding > 0;
    for (int k = 0; k < EBPO_SCREW; k++)
        tool->force[k] = 0;
    if (t->touching) {
        flags |= EBPO_HAPTIC_CONTACT;
        compute_force(t, depth, moved, out);
        out->depth = ebpo_screw_length(depth);
    }
    report_contact(t, out);
    tool->device = device;
    ebpo_vec3_copy(device.place, t->device);
    ebpo_vec3_copy(tool->proxy.place, out->proxy);
    for (int k = 0; k < 4; k++)
        out->turn[k] = tool->proxy.rotation[k];
    out->flags = flags | (bad_input ? EBPO_HAPTIC_BAD_INPUT : 0) | ebpo_haptic_stopped(t);
    if ((flags & EBPO_HAPTIC_WAITING) && tool->stage == EBPO_TOOL_IDLE)
        ebpo_haptic_try_previous_box(t);
    ebpo_haptic_count(t, out->flags, out->work);
    ebpo_haptic_report(t, device.place);
}

uint32_t ebpo_haptic_tool_path(const ebpo_haptic *t, double path[EBPO_HAPTIC_PATH_MAX][7])
{
    uint32_t count = t->tool ? t->tool->path_count : 0;
    for (uint32_t i = 0; i < count; i++) {
        ebpo_vec3_copy(t->tool->path[i].place, path[i]);
        for (int k = 0; k < 4; k++)
            path[i][3 + k] = t->tool->path[i].rotation[k];
    }
    return count;
}
