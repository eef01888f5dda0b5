/* Computes the narrow phase of a scene: decides exactly which pairs of instances intersect at a
 * time, and describes each contact.
 *
 * The broad phase (scene_pairs.c) provides the pairs, which are evaluated on all cores. For a pair
 * whose faces intersect, the result has two of these faces, and the location, number and depth of
 * contacts. For other pairs the result has, if the options request it, the relation of the solids
 * and the distance if it is less than the clearance. If faces that are omitted from a subset may
 * change a result, the query fails with EBPO_E_ABSENT.
 *
 * See docs/guide/scenes.md. */
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

/* A query of a pair of instances at their poses. */
typedef struct scene_two {
    const ebpo_scene_clash_options *requested; /* the results that the caller wants */
    ebpo_collider *collider;
    const ebpo_collide_options *options; /* the poses of both instances */
    bool solid[2];                       /* true: the model is a solid, false: a surface */
} scene_two;

/* Marks all results as unknown. */
static void clear_results(ebpo_scene_clash *clash)
{
    static const ebpo_value_bounds unknown = { 0, INFINITY, EBPO_VALUE_BOUND, 0 };
    clash->face_a = clash->face_b = EBPO_NO_FACE;
    clash->relation = EBPO_RELATION_UNDECIDED;
    for (int k = 0; k < 3; k++)
        clash->location[k] = clash->location_min[k] = clash->location_max[k] = NAN;
    clash->depth[0] = clash->depth[1] = unknown;
}

/* Extends the box of locations so that it contains a point. A box that is NAN becomes the point. */
static void widen_location_box(ebpo_scene_clash *clash, const double p[3])
{
    for (int k = 0; k < 3; k++) {
        clash->location_min[k] = fmin(clash->location_min[k], p[k]);
        clash->location_max[k] = fmax(clash->location_max[k], p[k]);
    }
}

static void set_location(ebpo_scene_clash *clash, const double location[3])
{
    memcpy(clash->location, location, sizeof clash->location);
    widen_location_box(clash, location);
}

/* --- all pairs --- */

/* Counts pairs of faces by kind, and keeps the pair with the least indices. */
typedef struct tally {
    ebpo_scene_clash *clash;
    ebpo_pair_faces *faces; /* gives the corners of faces, to find locations; NULL: locations are
                               not requested */
    ebpo_face_pair first;
    bool kind_only; /* stop at the first crossing pair, which decides the kind of the clash, and do
                       not change `first` */
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
    widen_location_box(t->clash, s.point[0]);
    widen_location_box(t->clash, s.point[1]);
    return true;
}

static bool count_faces(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    tally *t = user;
    for (uint64_t i = 0; i < count; i++) {
        t->clash->touching += pairs[i].kind == EBPO_PAIR_TOUCHING;
        t->clash->crossing += pairs[i].kind == EBPO_PAIR_CROSSING;
        t->clash->coplanar += pairs[i].kind == EBPO_PAIR_COPLANAR;
        if (t->kind_only && t->clash->crossing)
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

/* Sets the number of lines of contact; UINT64_MAX if the collider has too little memory to count
 * them. */
static ebpo_status report_lines(const scene_two *two, ebpo_scene_clash *clash, ebpo_error *error)
{
    if (clash->crossing > ebpo_contact_lines_max(two->collider)) {
        clash->contacts = UINT64_MAX;
        return EBPO_OK;
    }
    return ebpo_collide_polylines(two->collider, two->options, count_lines, &clash->contacts,
                                  error);
}

/* --- locations --- */

/* Computes a common point of two faces that cross or touch: an end of their common segment if they
 * cross, a nearest point if they touch. models: gives the corners of both faces. */
static ebpo_status common_point(ebpo_pair_faces *models, const ebpo_face_pair *pair, double out[3],
                                ebpo_error *error)
{
    ebpo_posed_pair faces;
    ebpo_status status = ebpo_pose_pair(models, pair, &faces, error);
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

/* Finds a location of contact by a distance query, which returns a point of the first contact that
 * it finds. This takes less memory than ebpo_pair_faces, which has an array with an entry for each
 * face. */
static ebpo_status locate_first(const scene_two *two, ebpo_scene_clash *clash, ebpo_error *error)
{
    ebpo_collide_distance_result found;
    ebpo_status status = ebpo_collide_distance(two->collider, two->options, NULL, &found, error);
    if (status == EBPO_OK)
        set_location(clash, found.point_a);
    return status;
}

/* Sets faces, distance and location of the nearest pair. */
static void scene_report_nearest(const scene_two *two, const ebpo_collide_distance_result *nearest,
                                 ebpo_scene_clash *clash)
{
    double middle[3];
    clash->distance = nearest->distance.hi;
    clash->face_a = nearest->pair.face_a;
    clash->face_b = nearest->pair.face_b;
    for (int k = 0; k < 3; k++)
        middle[k] = nearest->point_a[k] / 2 + nearest->point_b[k] / 2;
    if (two->requested->locations)
        set_location(clash, middle);
}

/* --- intersecting faces --- */

/* Counts all pairs of intersecting faces and the lines of contact. faces: for finding locations;
 * NULL: locations are not requested. first: an intersecting pair. */
static ebpo_status count_all(const scene_two *two, ebpo_pair_faces *faces,
                             const ebpo_face_pair *first, ebpo_scene_clash *clash,
                             ebpo_error *error)
{
    tally t = { clash, faces, *first, false, error, EBPO_OK };
    double location[3];
    ebpo_status status = ebpo_collide_all(two->collider, two->options, count_faces, &t, error);
    if (status == EBPO_OK)
        status = t.status;
    if (status != EBPO_OK)
        return status;
    clash->face_a = t.first.face_a;
    clash->face_b = t.first.face_b;
    if (faces)
        status = common_point(faces, &t.first, location, error);
    if (faces && status == EBPO_OK)
        set_location(clash, location);
    return status == EBPO_OK && clash->crossing ? report_lines(two, clash, error) : status;
}

static ebpo_status count_with_location(const scene_two *two, const ebpo_face_pair *first,
                                       ebpo_scene_clash *clash, ebpo_error *error)
{
    ebpo_collision collision;
    ebpo_pair_faces faces = { .collision = &collision };
    ebpo_status status = ebpo_collision_begin(&collision, two->collider, two->options, error);
    if (status == EBPO_OK)
        status = ebpo_pair_faces_begin(&faces, &collision, error);
    if (status == EBPO_OK)
        status = count_all(two, &faces, first, clash, error);
    ebpo_pair_faces_end(&faces);
    return status;
}

/* Counts pairs of faces by kind up to the first crossing pair, which decides the kind of the clash.
 * first: an intersecting pair. */
static ebpo_status find_kind(const scene_two *two, const ebpo_face_pair *first,
                             ebpo_scene_clash *clash, ebpo_error *error)
{
    tally t = { clash, NULL, *first, true, error, EBPO_OK };
    clash->crossing = first->kind == EBPO_PAIR_CROSSING;
    return clash->crossing ? EBPO_OK
                           : ebpo_collide_all(two->collider, two->options, count_faces, &t, error);
}

/* Sets faces, numbers of pairs, contacts and location. `first`: result of ebpo_collide_first. */
static ebpo_status scene_report_contacts(const scene_two *two, const ebpo_face_pair *first,
                                         ebpo_scene_clash *clash, ebpo_error *error)
{
    clash->face_a = first->face_a;
    clash->face_b = first->face_b;
    if (two->requested->count)
        return two->requested->locations ? count_with_location(two, first, clash, error)
                                         : count_all(two, NULL, first, clash, error);
    ebpo_status status = find_kind(two, first, clash, error);
    return status == EBPO_OK && two->requested->locations ? locate_first(two, clash, error)
                                                          : status;
}

/* Returns true if a point of one model may be inside the other model. If the function returns
 * false, the depths are 0, and no search is needed. (A search would take long for faces that
 * overlap in one plane.) */
static bool is_any_inner(int32_t relation)
{
    return relation == EBPO_INTERSECTING || relation == EBPO_A_INSIDE_B ||
           relation == EBPO_B_INSIDE_A;
}

/* Sets the depth of each instance in the other instance. */
static ebpo_status scene_report_depths(const scene_two *two, ebpo_scene_clash *clash,
                                       ebpo_error *error)
{
    static const ebpo_value_bounds zero = { 0, 0, EBPO_VALUE_EXACT, 0 };
    if (!(two->requested->depth > 0))
        return EBPO_OK;
    if (is_any_inner(clash->relation) && (two->solid[0] || two->solid[1]))
        return ebpo_collide_depth(two->collider, two->options, two->requested->depth,
                                  two->solid[1] ? &clash->depth[0] : NULL,
                                  two->solid[0] ? &clash->depth[1] : NULL, error);
    for (int i = 0; i < 2; i++)
        if (two->solid[!i])
            clash->depth[i] = zero;
    return EBPO_OK;
}

/* --- pairs of instances --- */

typedef struct clash_query {
    const ebpo_scene *scene;
    ebpo_scene_clash_options requested;
    double time;
} clash_query;

static ebpo_clash_kind kind_of(const ebpo_scene_clash *clash)
{
    return clash->crossing   ? EBPO_CLASH_CROSSING
           : clash->coplanar ? EBPO_CLASH_COPLANAR
           : clash->touching ? EBPO_CLASH_TOUCHING
                             : EBPO_CLASH_NONE;
}

/* Compares the distance with the clearance, which takes less time than computing the distance.
 * Computes the distance, and sets the kind EBPO_CLASH_NEAR, only if the distance is less than the
 * clearance. */
static ebpo_status query_clearance(const scene_two *two, ebpo_scene_clash *clash, ebpo_error *error)
{
    ebpo_collide_distance_options limit = EBPO_COLLIDE_DISTANCE_OPTIONS_INIT;
    ebpo_collide_distance_result found;
    limit.at_least = clash->clearance;
    ebpo_status status = ebpo_collide_distance(two->collider, two->options, &limit, &found, error);
    if (status != EBPO_OK || found.at_least == 1)
        return status;
    status = ebpo_collide_distance(two->collider, two->options, NULL, &found, error);
    clash->kind = EBPO_CLASH_NEAR;
    if (status == EBPO_OK)
        scene_report_nearest(two, &found, clash);
    return status;
}

/* Sets the relation. If the relation determines a kind of clash, sets this kind. */
static ebpo_status query_relation(const scene_two *two, ebpo_scene_clash *clash, ebpo_error *error)
{
    ebpo_relation_result found;
    ebpo_status status = ebpo_collide_relation(two->collider, two->options, &found, error);
    clash->relation = found.relation;
    if (found.relation == EBPO_INTERSECTING && (two->solid[0] || two->solid[1]))
        clash->kind = EBPO_CLASH_PROTRUDING;
    if (found.relation == EBPO_A_INSIDE_B || found.relation == EBPO_B_INSIDE_A)
        clash->kind = EBPO_CLASH_ENCLOSED;
    if (found.relation == EBPO_EQUAL)
        clash->kind = EBPO_CLASH_DUPLICATE;
    return status;
}

/* Sets the results of a pair whose faces do not intersect. */
static ebpo_status query_disjoint_faces(const scene_two *two, ebpo_scene_clash *clash,
                                        ebpo_error *error)
{
    ebpo_collide_distance_result found;
    ebpo_status status = two->requested->relate ? query_relation(two, clash, error) : EBPO_OK;
    if (status != EBPO_OK)
        return status;
    if (clash->kind == EBPO_CLASH_NONE) {
        status = clash->clearance > 0 ? query_clearance(two, clash, error) : EBPO_OK;
    } else {
        status = ebpo_collide_distance(two->collider, two->options, NULL, &found, error);
        if (status == EBPO_OK)
            scene_report_nearest(two, &found, clash);
    }
    return status == EBPO_OK ? scene_report_depths(two, clash, error) : status;
}

static ebpo_status query_faces(const scene_two *two, ebpo_scene_clash *clash, ebpo_error *error)
{
    int32_t found = 0;
    ebpo_face_pair first;
    ebpo_status status = ebpo_collide_first(two->collider, two->options, &first, &found, error);
    if (status != EBPO_OK)
        return status;
    if (found <= 0)
        return query_disjoint_faces(two, clash, error);
    status = scene_report_contacts(two, &first, clash, error);
    clash->kind = kind_of(clash);
    if (status == EBPO_OK && two->requested->relate)
        status = query_relation(two, clash, error);
    return status == EBPO_OK ? scene_report_depths(two, clash, error) : status;
}

/* Checks that faces omitted from a file cannot change the result. If the relation is requested, any
 * omitted face may change it, because one instance may be inside the other instance. */
static ebpo_status check_omitted_faces(const clash_query *query, const ebpo_scene_pair *pair,
                                       ebpo_error *error)
{
    double distance = INFINITY; /* lower bound of the distance of omitted faces */
    uint64_t omitted_in = 0;
    ebpo_status status =
        ebpo_scene_omitted(query->scene, pair, query->time, &distance, &omitted_in, error);
    if (status == EBPO_OK &&
        (!(distance > pair->clearance) || (query->requested.relate && distance < INFINITY)))
        status = ebpo_scene_fail_omitted(query->scene, pair, omitted_in, query->time,
                                         query->requested.relate, error);
    return status;
}

static bool is_solid(const ebpo_scene *scene, uint64_t instance)
{
    return ebpo_file_info(ebpo_scene_file(scene, scene->instances[instance].description.model))
        ->solid;
}

static ebpo_status query_pair(const void *context, const ebpo_scene_pair *pair, void *result,
                              ebpo_error *error)
{
    const clash_query *query = context;
    ebpo_scene_clash *clash = result;
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_collider *collider = NULL;
    *clash = (ebpo_scene_clash){ .a = pair->a, .b = pair->b, .clearance = pair->clearance };
    clear_results(clash);
    ebpo_status status = ebpo_scene_pose_pair(query->scene, pair, query->time, &options, error);
    if (status == EBPO_OK)
        status = check_omitted_faces(query, pair, error);
    if (status == EBPO_OK)
        status = ebpo_scene_collider(query->scene, pair, 1, &collider, error);
    scene_two two = {
        &query->requested,
        collider,
        &options,
        { is_solid(query->scene, pair->a), is_solid(query->scene, pair->b) },
    };
    if (status == EBPO_OK && collider)
        status = query_faces(&two, clash, error);
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
    clash_query query = { .scene = scene,
                          .requested = EBPO_SCENE_CLASH_OPTIONS_INIT,
                          .time = time };
    void *clashes = NULL;
    uint64_t count = 0;
    ebpo_status status = EBPO_TAKE(ebpo_scene_clash_options, &query.requested, options, error);
    if (status == EBPO_OK && !(query.requested.depth >= 0 && query.requested.depth < INFINITY))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "expected a tolerance of depths that is a length of 0 or more, got %g",
                         query.requested.depth);
    query.requested.relate |= query.requested.depth > 0;
    ebpo_scene_search search = { query_pair,
                                 &query,
                                 sizeof(ebpo_scene_clash),
                                 4,
                                 query.requested.threads,
                                 &query.requested.progress,
                                 "evaluating pairs" };
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
    clash_query query = { .scene = scene, .time = time };
    ebpo_scene_pair pair = { a, b, 0 };
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_collider *collider = NULL;
    ebpo_status status = ebpo_scene_pose_pair(scene, &pair, time, &options, error);
    if (status == EBPO_OK)
        status = ebpo_scene_make_models(scene, &pair, 1, error);
    if (status == EBPO_OK)
        status = check_omitted_faces(&query, &pair, error);
    if (status == EBPO_OK)
        status = ebpo_scene_collider(scene, &pair, threads, &collider, error);
    if (status == EBPO_OK && collider)
        status = ebpo_collide_all(collider, &options, take, user, error);
    ebpo_collider_free(collider);
    return status;
}
