#include "core/strict_fp.h"

#include "extras/scene/meeting_facts.h"

#include <math.h>
#include <string.h>

#include "core/error.h"
#include "extras/collide/contacts.h"
#include "extras/collide/contact.h"
#include "extras/collide/pair_distance.h"

void scene_forget_facts(ebpo_scene_meeting *m)
{
    static const ebpo_certain unknown = { 0, INFINITY, EBPO_FIGURE_BOUND, 0 };
    m->face_a = m->face_b = EBPO_NO_FACE;
    m->relation = EBPO_RELATION_OPEN;
    for (int k = 0; k < 3; k++)
        m->place[k] = m->place_min[k] = m->place_max[k] = NAN;
    m->depth[0] = m->depth[1] = unknown;
}

/* Of NAN and a number the number. */
static void widen(ebpo_scene_meeting *m, const double p[3])
{
    for (int k = 0; k < 3; k++) {
        m->place_min[k] = fmin(m->place_min[k], p[k]);
        m->place_max[k] = fmax(m->place_max[k], p[k]);
    }
}

static void set_place(ebpo_scene_meeting *m, const double place[3])
{
    memcpy(m->place, place, sizeof m->place);
    widen(m, place);
}

/* --- all pairs --- */

/* Counts pairs of faces by kind, and keeps the first by numbers; only whether there is one that
 * crosses, where that is enough. */
typedef struct tally {
    ebpo_scene_meeting *m;
    ebpo_pair_faces *faces; /* to ask where; NULL: not asked */
    ebpo_face_pair first;
    bool enough;
    ebpo_error *error; /* of `status` */
    ebpo_status status;
} tally;

static bool comes_first(const ebpo_face_pair *p, const ebpo_face_pair *q)
{
    return p->face_a < q->face_a || (p->face_a == q->face_a && p->face_b < q->face_b);
}

static bool note_segment(tally *t, const ebpo_face_pair *pair)
{
    ebpo_posed_pair faces;
    ebpo_contact_segment s;
    t->status = ebpo_pose_pair(t->faces, pair, &faces, t->error);
    if (t->status != EBPO_OK)
        return false;
    ebpo_contact_of(&faces, pair, &s);
    widen(t->m, s.point[0]);
    widen(t->m, s.point[1]);
    return true;
}

static bool count_faces(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    tally *t = user;
    for (uint64_t i = 0; i < count; i++) {
        t->m->touching += pairs[i].kind == EBPO_PAIR_TOUCHING;
        t->m->crossing += pairs[i].kind == EBPO_PAIR_CROSSING;
        t->m->coplanar += pairs[i].kind == EBPO_PAIR_COPLANAR;
        if (t->enough && t->m->crossing)
            return false;
        if (!t->enough && comes_first(&pairs[i], &t->first))
            t->first = pairs[i];
        if (t->faces && pairs[i].kind == EBPO_PAIR_CROSSING && !note_segment(t, &pairs[i]))
            return false;
    }
    return true;
}

static bool count_lines(void *user, const ebpo_polyline *line)
{
    (void)line;
    ++*(uint64_t *)user;
    return true;
}

/* More segments than the collider's memory holds are no failure of a report; what else fails is. */
static ebpo_status tell_lines(const scene_two *two, ebpo_scene_meeting *m, ebpo_error *error)
{
    if (m->crossing > ebpo_contact_lines_most(two->collider)) {
        m->contacts = UINT64_MAX;
        return EBPO_OK;
    }
    return ebpo_collide_polylines(two->collider, two->options, count_lines, &m->contacts, error);
}

/* --- where --- */

/* A point of both faces: an end of their common segment, or what their nearest features have. */
static ebpo_status common_point(ebpo_pair_faces *of, const ebpo_face_pair *pair, double out[3],
                                ebpo_error *error)
{
    ebpo_posed_pair faces;
    ebpo_status status = ebpo_pose_pair(of, pair, &faces, error);
    if (status != EBPO_OK)
        return status;
    const double(*a)[3] = (const double(*)[3])faces.corner[0];
    const double(*b)[3] = (const double(*)[3])faces.corner[1];
    if (pair->kind == EBPO_PAIR_CROSSING) {
        ebpo_contact_end end[2];
        ebpo_triangle_contact(a, b, end);
        memcpy(out, end[0].point, sizeof end[0].point);
    } else {
        ebpo_pair_distance_bounds bounds;
        ebpo_triangles_distance_bounds(a, b, &bounds);
        memcpy(out, bounds.point[0], sizeof bounds.point[0]);
    }
    return EBPO_OK;
}

/* The distance of models that meet begins with their first contact, and tells a point of it: that
 * takes no table of all faces. */
static ebpo_status place_of_first(const scene_two *two, ebpo_scene_meeting *m, ebpo_error *error)
{
    ebpo_clearance found;
    ebpo_status status = ebpo_collide_distance(two->collider, two->options, NULL, &found, error);
    if (status == EBPO_OK)
        set_place(m, found.point_a);
    return status;
}

void scene_tell_nearest(const scene_two *two, const ebpo_clearance *nearest, ebpo_scene_meeting *m)
{
    double middle[3];
    m->distance = nearest->distance.hi;
    m->face_a = nearest->pair.face_a;
    m->face_b = nearest->pair.face_b;
    for (int k = 0; k < 3; k++)
        middle[k] = nearest->point_a[k] / 2 + nearest->point_b[k] / 2;
    if (two->how->places)
        set_place(m, middle);
}

/* --- of faces that meet --- */

/* `faces`: NULL, or to tell where. */
static ebpo_status count_all(const scene_two *two, ebpo_pair_faces *faces,
                             const ebpo_face_pair *first, ebpo_scene_meeting *m, ebpo_error *error)
{
    tally t = { m, faces, *first, false, error, EBPO_OK };
    double place[3];
    ebpo_status status = ebpo_collide_all(two->collider, two->options, count_faces, &t, error);
    if (status == EBPO_OK)
        status = t.status;
    if (status != EBPO_OK)
        return status;
    m->face_a = t.first.face_a;
    m->face_b = t.first.face_b;
    if (faces)
        status = common_point(faces, &t.first, place, error);
    if (faces && status == EBPO_OK)
        set_place(m, place);
    return status == EBPO_OK && m->crossing ? tell_lines(two, m, error) : status;
}

static ebpo_status count_places(const scene_two *two, const ebpo_face_pair *first,
                                ebpo_scene_meeting *m, ebpo_error *error)
{
    ebpo_collision question;
    ebpo_pair_faces faces = { .question = &question };
    ebpo_status status = ebpo_collision_begin(&question, two->collider, two->options, error);
    if (status == EBPO_OK)
        status = ebpo_pair_faces_begin(&faces, &question, error);
    if (status == EBPO_OK)
        status = count_all(two, &faces, first, m, error);
    ebpo_pair_faces_end(&faces);
    return status;
}

static ebpo_status find_kind(const scene_two *two, const ebpo_face_pair *first,
                             ebpo_scene_meeting *m, ebpo_error *error)
{
    tally t = { m, NULL, *first, true, error, EBPO_OK };
    m->crossing = first->kind == EBPO_PAIR_CROSSING;
    return m->crossing ? EBPO_OK
                       : ebpo_collide_all(two->collider, two->options, count_faces, &t, error);
}

ebpo_status scene_tell_contacts(const scene_two *two, const ebpo_face_pair *first,
                                ebpo_scene_meeting *m, ebpo_error *error)
{
    m->face_a = first->face_a;
    m->face_b = first->face_b;
    if (two->how->count)
        return two->how->places ? count_places(two, first, m, error)
                                : count_all(two, NULL, first, m, error);
    ebpo_status status = find_kind(two, first, m, error);
    return status == EBPO_OK && two->how->places ? place_of_first(two, m, error) : status;
}

/* Whether a point of one is inner to the other; else nothing is deep, and a search, at faces that
 * lie on each other, would take long to find that out. */
static bool is_any_inner(int32_t relation)
{
    return relation == EBPO_INTERSECTING || relation == EBPO_A_INSIDE_B ||
           relation == EBPO_B_INSIDE_A;
}

ebpo_status scene_tell_depths(const scene_two *two, ebpo_scene_meeting *m, ebpo_error *error)
{
    static const ebpo_certain none = { 0, 0, EBPO_FIGURE_EXACT, 0 };
    if (!(two->how->depth > 0))
        return EBPO_OK;
    if (is_any_inner(m->relation) && (two->solid[0] || two->solid[1]))
        return ebpo_collide_depth(two->collider, two->options, two->how->depth,
                                  two->solid[1] ? &m->depth[0] : NULL,
                                  two->solid[0] ? &m->depth[1] : NULL, error);
    for (int i = 0; i < 2; i++)
        if (two->solid[!i])
            m->depth[i] = none;
    return EBPO_OK;
}
