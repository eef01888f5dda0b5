/* The narrow phase: which of the pairs that may meet do, exactly, on all cores. */
#include "geom/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/fp_env.h"
#include "base/parallel.h"
#include "base/sized.h"
#include "scene/asked_pairs.h"
#include "scene/left_out.h"

typedef struct asking {
    const ebpo_scene *scene;
    ebpo_scene_ask_options how;
    double time;
    scene_pairs_list list;
    ebpo_scene_meeting *meetings;
} asking;

/* Counts pairs of faces by kind, and keeps the first by numbers; only whether there is one that
 * crosses, where that is enough. */
typedef struct tally {
    ebpo_scene_meeting *m;
    bool enough;
} tally;

static void keep_first(ebpo_scene_meeting *m, const ebpo_face_pair *p)
{
    if (p->face_a < m->face_a || (p->face_a == m->face_a && p->face_b < m->face_b)) {
        m->face_a = p->face_a;
        m->face_b = p->face_b;
    }
}

static bool count_faces(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    const tally *t = user;
    for (uint64_t i = 0; i < count; i++) {
        t->m->touching += pairs[i].kind == EBPO_PAIR_TOUCHING;
        t->m->crossing += pairs[i].kind == EBPO_PAIR_CROSSING;
        t->m->coplanar += pairs[i].kind == EBPO_PAIR_COPLANAR;
        if (t->enough && t->m->crossing)
            return false;
        if (!t->enough)
            keep_first(t->m, &pairs[i]);
    }
    return true;
}

static ebpo_meeting_kind kind_of(const ebpo_scene_meeting *m)
{
    return m->crossing   ? EBPO_MEETING_CROSSING
           : m->coplanar ? EBPO_MEETING_COPLANAR
           : m->touching ? EBPO_MEETING_TOUCHING
                         : EBPO_MEETING_NONE;
}

/* Whether the clearance is kept, which ends sooner; and if not, the distance. */
static ebpo_status ask_clearance(ebpo_collider *collider, const ebpo_collide_options *options,
                                 ebpo_scene_meeting *m, ebpo_error *error)
{
    ebpo_clearance_options how = EBPO_CLEARANCE_OPTIONS_INIT;
    ebpo_clearance found;
    how.at_least = m->clearance;
    ebpo_status status = ebpo_collide_distance(collider, options, &how, &found, error);
    if (status != EBPO_OK || found.at_least == 1)
        return status;
    how.at_least = -1;
    status = ebpo_collide_distance(collider, options, &how, &found, error);
    m->kind = EBPO_MEETING_NEAR;
    m->distance = found.distance.hi;
    m->face_a = found.pair.face_a;
    m->face_b = found.pair.face_b;
    return status;
}

static ebpo_status ask_faces(const asking *a, ebpo_collider *collider,
                             const ebpo_collide_options *options, ebpo_scene_meeting *m,
                             ebpo_error *error)
{
    int32_t found = 0;
    ebpo_face_pair first;
    ebpo_status status = ebpo_collide_first(collider, options, &first, &found, error);
    if (status != EBPO_OK)
        return status;
    if (found <= 0)
        return m->clearance > 0 ? ask_clearance(collider, options, m, error) : EBPO_OK;
    m->face_a = first.face_a;
    m->face_b = first.face_b;
    tally t = { m, !a->how.count };
    if (t.enough && first.kind == EBPO_PAIR_CROSSING)
        m->crossing = 1;
    else
        status = ebpo_collide_all(collider, options, count_faces, &t, error);
    m->kind = kind_of(m);
    return status;
}

/* What has been left out of a file must not matter. */
static ebpo_status check_left_out(const asking *a, const ebpo_scene_pair *pair, ebpo_error *error)
{
    double gap = INFINITY;
    uint64_t lacking = 0;
    ebpo_status status = scene_left_out(a->scene, pair, a->time, &gap, &lacking, error);
    if (status == EBPO_OK && !(gap > pair->clearance))
        status = scene_lacks(a->scene, pair, lacking, a->time, error);
    return status;
}

static ebpo_status ask_pair(const asking *a, uint64_t n, ebpo_error *error)
{
    const ebpo_scene_pair *pair = &a->list.pairs[n];
    ebpo_scene_meeting *m = &a->meetings[n];
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_collider *collider = NULL;
    *m = (ebpo_scene_meeting){ .a = pair->a,
                               .b = pair->b,
                               .face_a = EBPO_NO_FACE,
                               .face_b = EBPO_NO_FACE,
                               .clearance = pair->clearance };
    ebpo_status status = scene_pose_pair(a->scene, pair, a->time, &options, error);
    if (status == EBPO_OK)
        status = check_left_out(a, pair, error);
    if (status == EBPO_OK)
        status = scene_collider(a->scene, pair, &collider, error);
    if (status == EBPO_OK && collider)
        status = ask_faces(a, collider, &options, m, error);
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
