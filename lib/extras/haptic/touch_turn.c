/* A tick of a tool. Gauss' principle for a body without mass: of all ways that its contacts allow,
 * the one nearest to where the hand is (Ortega, Redon, Coquillart 2007). */
#include "core/strict_fp.h"

#include "core/fp_env.h"
#include "extras/haptic/tool.h"
#include "extras/haptic/touch_parts.h"

static double closeness(const ebpo_touch *t) { return 0x1p-6 * t->options.skin; }

/* Coulomb: what is left of the way along the contacts is friction times what they hold back. */
static void rub(const ebpo_touch *t, const double want[EBPO_SCREW], double way[EBPO_SCREW])
{
    double held[EBPO_SCREW];
    for (int k = 0; k < EBPO_SCREW; k++)
        held[k] = want[k] - way[k];
    double length = screw_length(way), holds = t->options.friction * screw_length(held);
    double part = length > holds ? 1 - holds / length : 0;
    for (int k = 0; k < EBPO_SCREW; k++)
        way[k] *= part;
}

/* The next piece. False: the tool stays. */
static bool set_out(ebpo_touch *t, const ebpo_rigid *hand, uint32_t *flags)
{
    ebpo_tool *tool = t->tool;
    double want[EBPO_SCREW], way[EBPO_SCREW];
    ebpo_rigid_between(&tool->proxy, hand, tool->arm, want);
    int holding = ebpo_tool_hold(&tool->contacts, want, closeness(t), true, way);
    if (holding > 0 && t->touching && t->options.friction > 0)
        rub(t, want, way);
    if (screw_length(way) <= closeness(t) / 2)
        return false;
    return ebpo_tool_set_out(t, way, flags);
}

static uint32_t go(ebpo_touch *t, const ebpo_rigid *hand, uint64_t *work)
{
    ebpo_tool *tool = t->tool;
    uint32_t flags = 0;
    tool->way_count = 1;
    tool->way_of[0] = tool->proxy;
    for (int piece = 0; piece < EBPO_TOOL_PIECES; piece++) {
        bool arrived;
        if (tool->stage == EBPO_TOOL_STANDS) {
            if (*work > EBPO_TOOL_WORK)
                return flags | EBPO_TOUCH_SHORT;
            (void)ebpo_touch_take_box(t);
            *work += 4 * (uint64_t)tool->contacts.count; /* what holding back takes */
            if (!set_out(t, hand, &flags))
                return flags;
        }
        flags |= ebpo_tool_go_on(t, work, &arrived);
        copy(tool->proxy.place, t->proxy);
        if (arrived)
            tool->way_of[tool->way_count++] = tool->proxy;
        if (!arrived || (flags & EBPO_TOUCH_WAITS))
            return flags;
    }
    return flags | EBPO_TOUCH_SHORT;
}

/* The way from hand to proxy that contacts are the cause of; how many of them are. */
static int find_depth(const ebpo_touch *t, const ebpo_rigid *hand, uint32_t flags,
                      double out[EBPO_SCREW])
{
    const ebpo_tool *tool = t->tool;
    double want[EBPO_SCREW], way[EBPO_SCREW];
    ebpo_rigid_between(&tool->proxy, hand, tool->arm, want);
    int holding = ebpo_tool_hold(&tool->contacts, want, closeness(t), false, way);
    bool part = flags & (EBPO_TOUCH_WAITS | EBPO_TOUCH_SHORT) || t->options.friction == 0;
    for (int k = 0; k < EBPO_SCREW; k++)
        out[k] = (part ? way[k] : 0) - want[k];
    return holding;
}

static void tell_contact(const ebpo_touch *t, ebpo_touch_turned *out)
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
    copy(nearest->normal, out->normal);
}

static void push(ebpo_touch *t, const double depth[EBPO_SCREW], const double moved[EBPO_SCREW],
                 ebpo_touch_turned *out)
{
    ebpo_tool *tool = t->tool;
    double *force = tool->force;
    ebpo_passive_push(&t->passive, t->options.damping / t->options.tick, depth, moved, EBPO_SCREW,
                      force);
    for (int i = 0; i < 3; i++) {
        out->force[i] = force[i];
        out->torque[i] = force[3 + i] * tool->arm;
    }
}

void ebpo_touch_turn(ebpo_touch *t, const double place[3], const double turn[4],
                     ebpo_touch_turned *out)
{
    EBPO_DEFAULT_FP;
    ebpo_tool *tool = t->tool;
    ebpo_rigid hand;
    double moved[EBPO_SCREW], depth[EBPO_SCREW];
    *out = (ebpo_touch_turned){ .face = EBPO_NO_FACE, .point = EBPO_NO_FACE };
    if (!tool) {
        out->flags = EBPO_TOUCH_OTHER;
        return;
    }
    bool astray = !ebpo_rigid_read(place, turn, &hand);
    if (astray)
        hand = tool->hand;
    ebpo_rigid_between(&tool->hand, &hand, tool->arm, moved);
    ebpo_passive_moved(&t->passive, tool->force, moved, EBPO_SCREW);
    uint32_t flags = go(t, &hand, &out->work);
    int holding = find_depth(t, &hand, flags, depth);
    t->touching = holding > 0;
    for (int k = 0; k < EBPO_SCREW; k++)
        tool->force[k] = 0;
    if (t->touching) {
        flags |= EBPO_TOUCH_CONTACT;
        push(t, depth, moved, out);
        out->depth = screw_length(depth);
    }
    tell_contact(t, out);
    tool->hand = hand;
    copy(hand.place, t->hand);
    copy(tool->proxy.place, out->proxy);
    for (int k = 0; k < 4; k++)
        out->turn[k] = tool->proxy.turn[k];
    out->flags = flags | (astray ? EBPO_TOUCH_ASTRAY : 0) | ebpo_touch_stopped(t);
    if ((flags & EBPO_TOUCH_WAITS) && tool->stage == EBPO_TOOL_STANDS)
        ebpo_touch_try_other(t);
    ebpo_touch_count(t, out->flags, out->work);
    ebpo_touch_tell(t, hand.place);
}

uint32_t ebpo_touch_poses(const ebpo_touch *t, double way[EBPO_TOUCH_WAY_MOST][7])
{
    uint32_t count = t->tool ? t->tool->way_count : 0;
    for (uint32_t i = 0; i < count; i++) {
        copy(t->tool->way_of[i].place, way[i]);
        for (int k = 0; k < 4; k++)
            way[i][3 + k] = t->tool->way_of[i].turn[k];
    }
    return count;
}
