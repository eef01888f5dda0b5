/* Computes the narrow phase of a scene: decides exactly which pairs of instances intersect at a
 * time, and describes each contact.
 *
 * Pairs come from the broad phase (scene_pairs.c), and are evaluated on all cores. For each pair
 * whose faces intersect, the result has the faces, the location, the number and the depth of
 * contacts. For other pairs the result has, as far as the options request it, the relation of the
 * solids and whether the clearance is kept. If parts that are omitted from a subset may matter, the
 * query fails with EBPO_E_ABSENT.
 *
 * Source: docs/guide/scenes.md. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/collide.h>
#include <ebpo/scene.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "extras/collide/face_pairs.h"
#include "extras/collide/pair_faces.h"
#include "extras/scene/instance_pair.h"

/* Two instances at their poses. */
typedef struct scene_two {
    const ebpo_scene_clash_options *how; /* requested results */
    ebpo_collider *collider;
    const ebpo_collide_options *options; /* poses */
    bool solid[2];                       /* the model is a solid, not a surface */
} scene_two;

/* Marks all results as unknown. */
static void clear_results(ebpo_scene_clash *m)
{
    static const ebpo_value_bounds unknown = { 0, INFINITY, EBPO_VALUE_BOUND, 0 };
    m->face_a = m->face_b = EBPO_NO_FACE;
    m->relation = EBPO_RELATION_UNDECIDED;
    for (int k = 0; k < 3; k++)
        m->location[k] = m->location_min[k] = m->location_max[k] = NAN;
    m->depth[0] = m->depth[1] = unknown;
}

/* Widens the box of locations by a point. A box that is still NAN becomes the point. */
static void widen_location_box(ebpo_scene_clash *m, const double p[3])
{
    for (int k = 0; k < 3; k++) {
        m->location_min[k] = fmin(m->location_min[k], p[k]);
        m->location_max[k] = fmax(m->location_max[k], p[k]);
    }
}

static void set_location(ebpo_scene_clash *m, const double location[3])
{
    memcpy(m->location, location, sizeof m->location);
    widen_location_box(m, location);
}

/* --- all pairs --- */

/* Counts pairs of faces by kind, and keeps the pair with the least indices. */
typedef struct tally {
    ebpo_scene_clash *m;
    ebpo_pair_faces *faces; /* for finding locations; NULL: not requested */
    ebpo_face_pair first;
    bool kind_only;    /* the first crossing pair is enough: stop there, and keep `first` */
    ebpo_error *error; /* error of `status` */
    ebpo_status status;
} tally;

static bool comes_first(const ebpo_face_pair *p, const ebpo_face_pair *q)
{
    return p->face_a < q->face_a || (p->face_a == q->face_a && p->face_b < q->face_b);
}

static bool record_segment(tally *t, const ebpo_face_pair *pair)
{
    ebpo_posed_pair faces;
    ebpo_contact_segment s;
    t->status = ebpo_pose_pair(t->faces, pair, &faces, t->error);
    if (t->status != EBPO_OK)
        return false;
    ebpo_contact_of(&faces, pair, &s);
    widen_location_box(t->m, s.point[0]);
    widen_location_box(t->m, s.point[1]);
    return true;
}

static bool count_faces(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    tally *t = user;
    for (uint64_t i = 0; i < count; i++) {
        t->m->touching += pairs[i].kind == EBPO_PAIR_TOUCHING;
        t->m->crossing += pairs[i].kind == EBPO_PAIR_CROSSING;
        t->m->coplanar += pairs[i].kind == EBPO_PAIR_COPLANAR;
        if (t->kind_only && t->m->crossing)
            return false;
        if (!t->kind_only && comes_first(&pairs[i], &t->first))
            t->first = pairs[i];
        if (t->faces && pairs[i].kind == EBPO_PAIR_CROSSING && !record_segment(t, &pairs[i]))
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

/* Sets the number of lines of contact; UINT64_MAX: the collider's memory for segments does not
 * suffice to count them. */
static ebpo_status report_lines(const scene_two *two, ebpo_scene_clash *m, ebpo_error *error)
{
    if (m->crossing > ebpo_contact_lines_max(two->collider)) {
        m->contacts = UINT64_MAX;
        return EBPO_OK;
    }
    return ebpo_collide_polylines(two->collider, two->options, count_lines, &m->contacts, error);
}

/* --- locations --- */

/* Computes a common point of two faces: an end of their common segment if they cross, otherwise a
 * nearest point. */
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

/* Finds a location of contact by a distance query: if models intersect, it returns a point of the
 * first contact that it finds. This needs no table of all faces. */
static ebpo_status locate_first(const scene_two *two, ebpo_scene_clash *m, ebpo_error *error)
{
    ebpo_collide_distance_result found;
    ebpo_status status = ebpo_collide_distance(two->collider, two->options, NULL, &found, error);
    if (status == EBPO_OK)
        set_location(m, found.point_a);
    return status;
}

/* Sets faces, distance and location of the nearest pair. */
static void scene_report_nearest(const scene_two *two, const ebpo_collide_distance_result *nearest,
                                 ebpo_scene_clash *m)
{
    double middle[3];
    m->distance = nearest->distance.hi;
    m->face_a = nearest->pair.face_a;
    m->face_b = nearest->pair.face_b;
    for (int k = 0; k < 3; k++)
        middle[k] = nearest->point_a[k] / 2 + nearest->point_b[k] / 2;
    if (two->how->locations)
        set_location(m, middle);
}

/* --- intersecting faces --- */

/* Counts all pairs of intersecting faces and the lines of contact. `faces`: for finding locations;
 * NULL: not requested. `first`: a pair that intersects. */
static ebpo_status count_all(const scene_two *two, ebpo_pair_faces *faces,
                             const ebpo_face_pair *first, ebpo_scene_clash *m, ebpo_error *error)
{
    tally t = { m, faces, *first, false, error, EBPO_OK };
    double location[3];
    ebpo_status status = ebpo_collide_all(two->collider, two->options, count_faces, &t, error);
    if (status == EBPO_OK)
        status = t.status;
    if (status != EBPO_OK)
        return status;
    m->face_a = t.first.face_a;
    m->face_b = t.first.face_b;
    if (faces)
        status = common_point(faces, &t.first, location, error);
    if (faces && status == EBPO_OK)
        set_location(m, location);
    return status == EBPO_OK && m->crossing ? report_lines(two, m, error) : status;
}

static ebpo_status count_with_location(const scene_two *two, const ebpo_face_pair *first,
                                       ebpo_scene_clash *m, ebpo_error *error)
{
    ebpo_collision collision;
    ebpo_pair_faces faces = { .collision = &collision };
    ebpo_status status = ebpo_collision_begin(&collision, two->collider, two->options, error);
    if (status == EBPO_OK)
        status = ebpo_pair_faces_begin(&faces, &collision, error);
    if (status == EBPO_OK)
        status = count_all(two, &faces, first, m, error);
    ebpo_pair_faces_end(&faces);
    return status;
}

/* Searches for a crossing pair of faces only, which decides the kind. */
static ebpo_status find_kind(const scene_two *two, const ebpo_face_pair *first, ebpo_scene_clash *m,
                             ebpo_error *error)
{
    tally t = { m, NULL, *first, true, error, EBPO_OK };
    m->crossing = first->kind == EBPO_PAIR_CROSSING;
    return m->crossing ? EBPO_OK
                       : ebpo_collide_all(two->collider, two->options, count_faces, &t, error);
}

/* Sets faces, numbers of pairs, contacts and location. `first`: result of ebpo_collide_first. */
static ebpo_status scene_report_contacts(const scene_two *two, const ebpo_face_pair *first,
                                         ebpo_scene_clash *m, ebpo_error *error)
{
    m->face_a = first->face_a;
    m->face_b = first->face_b;
    if (two->how->count)
        return two->how->locations ? count_with_location(two, first, m, error)
                                   : count_all(two, NULL, first, m, error);
    ebpo_status status = find_kind(two, first, m, error);
    return status == EBPO_OK && two->how->locations ? locate_first(two, m, error) : status;
}

/* Returns true if a point of one model is inside the other. Otherwise the depth is 0, and no search
 * is necessary, which would take long for faces that overlap in one plane. */
static bool is_any_inner(int32_t relation)
{
    return relation == EBPO_INTERSECTING || relation == EBPO_A_INSIDE_B ||
           relation == EBPO_B_INSIDE_A;
}

/* Sets the depth of each instance in the other. */
static ebpo_status scene_report_depths(const scene_two *two, ebpo_scene_clash *m, ebpo_error *error)
{
    static const ebpo_value_bounds none = { 0, 0, EBPO_VALUE_EXACT, 0 };
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

/* --- pairs of instances --- */

typedef struct clash_query {
    const ebpo_scene *scene;
    ebpo_scene_clash_options how;
    double time;
} clash_query;

static ebpo_clash_kind kind_of(const ebpo_scene_clash *m)
{
    return m->crossing   ? EBPO_CLASH_CROSSING
           : m->coplanar ? EBPO_CLASH_COPLANAR
           : m->touching ? EBPO_CLASH_TOUCHING
                         : EBPO_CLASH_NONE;
}

/* Checks the clearance, which takes less time than computing the distance. Computes the distance
 * only if the clearance is not kept. */
static ebpo_status query_clearance(const scene_two *two, ebpo_scene_clash *m, ebpo_error *error)
{
    ebpo_collide_distance_options how = EBPO_COLLIDE_DISTANCE_OPTIONS_INIT;
    ebpo_collide_distance_result found;
    how.at_least = m->clearance;
    ebpo_status status = ebpo_collide_distance(two->collider, two->options, &how, &found, error);
    if (status != EBPO_OK || found.at_least == 1)
        return status;
    status = ebpo_collide_distance(two->collider, two->options, NULL, &found, error);
    m->kind = EBPO_CLASH_NEAR;
    if (status == EBPO_OK)
        scene_report_nearest(two, &found, m);
    return status;
}

/* Sets the relation. The relation of solids is more specific than the relation of faces. */
static ebpo_status query_relation(const scene_two *two, ebpo_scene_clash *m, ebpo_error *error)
{
    ebpo_relation_result found;
    ebpo_status status = ebpo_collide_relation(two->collider, two->options, &found, error);
    m->relation = found.relation;
    if (found.relation == EBPO_INTERSECTING && (two->solid[0] || two->solid[1]))
        m->kind = EBPO_CLASH_PROTRUDING;
    if (found.relation == EBPO_A_INSIDE_B || found.relation == EBPO_B_INSIDE_A)
        m->kind = EBPO_CLASH_ENCLOSED;
    if (found.relation == EBPO_EQUAL)
        m->kind = EBPO_CLASH_DUPLICATE;
    return status;
}

/* Sets the results of a pair whose faces do not intersect. */
static ebpo_status query_disjoint_faces(const scene_two *two, ebpo_scene_clash *m,
                                        ebpo_error *error)
{
    ebpo_collide_distance_result found;
    ebpo_status status = two->how->relate ? query_relation(two, m, error) : EBPO_OK;
    if (status != EBPO_OK)
        return status;
    if (m->kind == EBPO_CLASH_NONE) {
        status = m->clearance > 0 ? query_clearance(two, m, error) : EBPO_OK;
    } else {
        status = ebpo_collide_distance(two->collider, two->options, NULL, &found, error);
        if (status == EBPO_OK)
            scene_report_nearest(two, &found, m);
    }
    return status == EBPO_OK ? scene_report_depths(two, m, error) : status;
}

static ebpo_status query_faces(const scene_two *two, ebpo_scene_clash *m, ebpo_error *error)
{
    int32_t found = 0;
    ebpo_face_pair first;
    ebpo_status status = ebpo_collide_first(two->collider, two->options, &first, &found, error);
    if (status != EBPO_OK)
        return status;
    if (found <= 0)
        return query_disjoint_faces(two, m, error);
    status = scene_report_contacts(two, &first, m, error);
    m->kind = kind_of(m);
    if (status == EBPO_OK && two->how->relate)
        status = query_relation(two, m, error);
    return status == EBPO_OK ? scene_report_depths(two, m, error) : status;
}

/* Checks that parts omitted from a file do not matter. If one instance is inside a solid, any face
 * may matter. */
static ebpo_status check_omitted_faces(const clash_query *a, const ebpo_scene_pair *pair,
                                       ebpo_error *error)
{
    double gap = INFINITY;
    uint64_t lacking = 0;
    ebpo_status status = ebpo_scene_omitted(a->scene, pair, a->time, &gap, &lacking, error);
    if (status == EBPO_OK && (!(gap > pair->clearance) || (a->how.relate && gap < INFINITY)))
        status = ebpo_scene_fail_omitted(a->scene, pair, lacking, a->time, a->how.relate, error);
    return status;
}

static bool is_solid(const ebpo_scene *scene, uint64_t instance)
{
    return ebpo_file_info(ebpo_scene_file(scene, scene->instances[instance].as.model))->solid;
}

static ebpo_status query_pair(const void *how, const ebpo_scene_pair *pair, void *result,
                              ebpo_error *error)
{
    const clash_query *a = how;
    ebpo_scene_clash *m = result;
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_collider *collider = NULL;
    *m = (ebpo_scene_clash){ .a = pair->a, .b = pair->b, .clearance = pair->clearance };
    clear_results(m);
    ebpo_status status = ebpo_scene_pose_pair(a->scene, pair, a->time, &options, error);
    if (status == EBPO_OK)
        status = check_omitted_faces(a, pair, error);
    if (status == EBPO_OK)
        status = ebpo_scene_collider(a->scene, pair, 1, &collider, error);
    scene_two two = {
        &a->how, collider, &options, { is_solid(a->scene, pair->a), is_solid(a->scene, pair->b) }
    };
    if (status == EBPO_OK && collider)
        status = query_faces(&two, m, error);
    ebpo_collider_free(collider);
    return status;
}

/* Passes the clashes to the caller, without pairs of kind EBPO_CLASH_NONE. */
static void pass_clashes(ebpo_scene_clash *clashes, uint64_t count, ebpo_scene_clashes_fn take,
                         void *user)
{
    uint64_t kept = 0;
    for (uint64_t i = 0; i < count; i++)
        if (clashes[i].kind != EBPO_CLASH_NONE)
            clashes[kept++] = clashes[i];
    if (kept)
        (void)take(user, clashes, kept);
}

ebpo_status ebpo_scene_find_clashes(ebpo_scene *scene, double time,
                                    const ebpo_scene_clash_options *options,
                                    ebpo_scene_clashes_fn take, void *user, uint64_t *tested,
                                    ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    clash_query a = { .scene = scene, .how = EBPO_SCENE_CLASH_OPTIONS_INIT, .time = time };
    void *clashes = NULL;
    uint64_t count = 0;
    ebpo_status status = EBPO_TAKE(ebpo_scene_clash_options, &a.how, options, error);
    if (status == EBPO_OK && !(a.how.depth >= 0 && a.how.depth < INFINITY))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "depths within %g: the tolerance is not a valid "
                         "length",
                         a.how.depth);
    a.how.relate |= a.how.depth > 0;
    ebpo_scene_search search = {
        query_pair,        &a, sizeof(ebpo_scene_clash), 4, a.how.threads, &a.how.progress,
        "evaluating pairs"
    };
    if (status == EBPO_OK)
        status = ebpo_scene_find_in_pairs(scene, time, time, &search, &clashes, &count, error);
    if (status == EBPO_OK)
        pass_clashes(clashes, count, take, user);
    if (tested)
        *tested = count;
    free(clashes);
    return status;
}

ebpo_status ebpo_scene_collide(ebpo_scene *scene, uint64_t a, uint64_t b, double time,
                               unsigned threads, ebpo_pairs_fn take, void *user, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    clash_query one = { .scene = scene, .time = time };
    ebpo_scene_pair pair = { a, b, 0 };
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_collider *collider = NULL;
    ebpo_status status = ebpo_scene_pose_pair(scene, &pair, time, &options, error);
    if (status == EBPO_OK)
        status = ebpo_scene_make_models(scene, &pair, 1, error);
    if (status == EBPO_OK)
        status = check_omitted_faces(&one, &pair, error);
    if (status == EBPO_OK)
        status = ebpo_scene_collider(scene, &pair, threads, &collider, error);
    if (status == EBPO_OK && collider)
        status = ebpo_collide_all(collider, &options, take, user, error);
    ebpo_collider_free(collider);
    return status;
}
