/* The narrow phase: which of the pairs that may meet do, exactly, on all cores. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "extras/scene/asked_pairs.h"
#include "extras/scene/left_out.h"
#include "extras/scene/meeting_facts.h"

typedef struct asking {
    const ebpo_scene *scene;
    ebpo_scene_ask_options how;
    double time;
    scene_pairs_list list;
    ebpo_scene_meeting *meetings;
} asking;

static ebpo_meeting_kind kind_of(const ebpo_scene_meeting *m)
{
    return m->crossing   ? EBPO_MEETING_CROSSING
           : m->coplanar ? EBPO_MEETING_COPLANAR
           : m->touching ? EBPO_MEETING_TOUCHING
                         : EBPO_MEETING_NONE;
}

/* Whether the clearance is kept, which ends sooner; and if not, the distance. */
static ebpo_status ask_clearance(const scene_two *two, ebpo_scene_meeting *m, ebpo_error *error)
{
    ebpo_clearance_options how = EBPO_CLEARANCE_OPTIONS_INIT;
    ebpo_clearance found;
    how.at_least = m->clearance;
    ebpo_status status = ebpo_collide_distance(two->collider, two->options, &how, &found, error);
    if (status != EBPO_OK || found.at_least == 1)
        return status;
    status = ebpo_collide_distance(two->collider, two->options, NULL, &found, error);
    m->kind = EBPO_MEETING_NEAR;
    if (status == EBPO_OK)
        scene_tell_nearest(two, &found, m);
    return status;
}

/* What solids are to each other says more than what their faces are. */
static ebpo_status ask_relation(const scene_two *two, ebpo_scene_meeting *m, ebpo_error *error)
{
    ebpo_relation_result found;
    ebpo_status status = ebpo_collide_relation(two->collider, two->options, &found, error);
    m->relation = found.relation;
    if (found.relation == EBPO_INTERSECTING && (two->solid[0] || two->solid[1]))
        m->kind = EBPO_MEETING_PROTRUDING;
    if (found.relation == EBPO_A_INSIDE_B || found.relation == EBPO_B_INSIDE_A)
        m->kind = EBPO_MEETING_ENCLOSED;
    if (found.relation == EBPO_EQUAL)
        m->kind = EBPO_MEETING_DUPLICATE;
    return status;
}

static ebpo_status ask_apart(const scene_two *two, ebpo_scene_meeting *m, ebpo_error *error)
{
    ebpo_clearance found;
    ebpo_status status = two->how->relate ? ask_relation(two, m, error) : EBPO_OK;
    if (status != EBPO_OK)
        return status;
    if (m->kind == EBPO_MEETING_NONE) {
        status = m->clearance > 0 ? ask_clearance(two, m, error) : EBPO_OK;
    } else {
        status = ebpo_collide_distance(two->collider, two->options, NULL, &found, error);
        if (status == EBPO_OK)
            scene_tell_nearest(two, &found, m);
    }
    return status == EBPO_OK ? scene_tell_depths(two, m, error) : status;
}

static ebpo_status ask_faces(const scene_two *two, ebpo_scene_meeting *m, ebpo_error *error)
{
    int32_t found = 0;
    ebpo_face_pair first;
    ebpo_status status = ebpo_collide_first(two->collider, two->options, &first, &found, error);
    if (status != EBPO_OK)
        return status;
    if (found <= 0)
        return ask_apart(two, m, error);
    status = scene_tell_contacts(two, &first, m, error);
    m->kind = kind_of(m);
    if (status == EBPO_OK && two->how->relate)
        status = ask_relation(two, m, error);
    return status == EBPO_OK ? scene_tell_depths(two, m, error) : status;
}

/* What has been left out of a file must not matter; inside a solid any face may. */
static ebpo_status check_left_out(const asking *a, const ebpo_scene_pair *pair, ebpo_error *error)
{
    double gap = INFINITY;
    uint64_t lacking = 0;
    ebpo_status status = scene_left_out(a->scene, pair, a->time, &gap, &lacking, error);
    if (status == EBPO_OK && (!(gap > pair->clearance) || (a->how.relate && gap < INFINITY)))
        status = scene_lacks(a->scene, pair, lacking, a->time, a->how.relate, error);
    return status;
}

static bool is_solid(const ebpo_scene *scene, uint64_t instance)
{
    return ebpo_file_info(ebpo_scene_file(scene, scene->instances[instance].as.model))->solid;
}

static ebpo_status ask_pair(const asking *a, uint64_t n, ebpo_error *error)
{
    const ebpo_scene_pair *pair = &a->list.pairs[n];
    ebpo_scene_meeting *m = &a->meetings[n];
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_collider *collider = NULL;
    *m = (ebpo_scene_meeting){ .a = pair->a, .b = pair->b, .clearance = pair->clearance };
    scene_forget_facts(m);
    ebpo_status status = scene_pose_pair(a->scene, pair, a->time, &options, error);
    if (status == EBPO_OK)
        status = check_left_out(a, pair, error);
    if (status == EBPO_OK)
        status = scene_collider(a->scene, pair, 1, &collider, error);
    scene_two two = {
        &a->how, collider, &options, { is_solid(a->scene, pair->a), is_solid(a->scene, pair->b) }
    };
    if (status == EBPO_OK && collider)
        status = ask_faces(&two, m, error);
    ebpo_collider_free(collider);
    return status;
}

static ebpo_status ask_pairs(void *context, uint64_t begin, uint64_t end, unsigned worker,
                             ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    (void)worker;
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++)
        status = ask_pair(context, i, error);
    return status;
}

static void give(asking *a, ebpo_scene_meetings_fn take, void *user)
{
    uint64_t kept = 0;
    for (uint64_t i = 0; i < a->list.count; i++)
        if (a->meetings[i].kind != EBPO_MEETING_NONE)
            a->meetings[kept++] = a->meetings[i];
    if (kept)
        (void)take(user, a->meetings, kept);
}

ebpo_status ebpo_scene_meet(ebpo_scene *scene, double time, const ebpo_scene_ask_options *options,
                            ebpo_scene_meetings_fn take, void *user, uint64_t *asked,
                            ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    asking a = { .scene = scene, .how = EBPO_SCENE_ASK_OPTIONS_INIT, .time = time };
    ebpo_status status = EBPO_TAKE(ebpo_scene_ask_options, &a.how, options, error);
    if (status == EBPO_OK && !(a.how.depth >= 0 && a.how.depth < INFINITY))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "depths within %g: is no length", a.how.depth);
    a.how.relate |= a.how.depth > 0;
    if (status == EBPO_OK)
        status = scene_list_pairs(scene, time, time, &a.list, error);
    a.meetings = ebpo_alloc(a.list.count, sizeof *a.meetings);
    if (status == EBPO_OK && !a.meetings)
        status = ebpo_fail_memory(error, a.list.count * sizeof *a.meetings);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(ebpo_thread_count(a.how.threads), NULL, a.list.count, 4,
                                   ask_pairs, &a, &a.how.progress, "asking pairs", error);
    if (status == EBPO_OK)
        give(&a, take, user);
    if (asked)
        *asked = a.list.count;
    free(a.list.pairs);
    free(a.meetings);
    return status;
}

ebpo_status ebpo_scene_collide(ebpo_scene *scene, uint64_t a, uint64_t b, double time,
                               unsigned threads, ebpo_pairs_fn take, void *user, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    asking one = { .scene = scene, .time = time };
    ebpo_scene_pair pair = { a, b, 0 };
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_collider *collider = NULL;
    ebpo_status status = scene_pose_pair(scene, &pair, time, &options, error);
    if (status == EBPO_OK)
        status = scene_make_models(scene, &pair, 1, error);
    if (status == EBPO_OK)
        status = check_left_out(&one, &pair, error);
    if (status == EBPO_OK)
        status = scene_collider(scene, &pair, threads, &collider, error);
    if (status == EBPO_OK && collider)
        status = ebpo_collide_all(collider, &options, take, user, error);
    ebpo_collider_free(collider);
    return status;
}
