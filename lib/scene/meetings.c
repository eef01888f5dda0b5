/* The narrow phase: which of the pairs that may meet do, exactly, on all cores. */
#include "geom/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include <ebpo/collide.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/fp_env.h"
#include "base/parallel.h"
#include "base/sized.h"
#include "scene/scene_parts.h"

typedef struct asking {
    ebpo_scene *scene;
    ebpo_scene_ask_options how;
    double time;
    ebpo_scene_pair *pairs;
    ebpo_scene_meeting *meetings;
    uint64_t count;
} asking;

static bool keep_pairs(void *user, const ebpo_scene_pair *pairs, uint64_t count)
{
    asking *a = user;
    a->pairs = ebpo_alloc(count, sizeof *pairs);
    for (uint64_t i = 0; a->pairs && i < count; i++)
        a->pairs[i] = pairs[i];
    a->count = count;
    return true;
}

/* Models of the pairs, made one after the other: questions then share them. */
static ebpo_status make_models(asking *a, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    ebpo_model *model;
    for (uint64_t i = 0; i < 2 * a->count && status == EBPO_OK; i++) {
        uint64_t instance = i % 2 ? a->pairs[i / 2].b : a->pairs[i / 2].a;
        status = ebpo_scene_model(a->scene, a->scene->instances[instance].as.model, &model, error);
    }
    return status;
}

/* Counts pairs of faces by kind; only whether there is one that crosses, where that is enough. */
typedef struct tally {
    ebpo_scene_meeting *m;
    bool enough;
} tally;

static bool count_faces(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    const tally *t = user;
    for (uint64_t i = 0; i < count; i++) {
        t->m->touching += pairs[i].kind == EBPO_PAIR_TOUCHING;
        t->m->crossing += pairs[i].kind == EBPO_PAIR_CROSSING;
        t->m->coplanar += pairs[i].kind == EBPO_PAIR_COPLANAR;
        if (t->enough && t->m->crossing)
            return false;
    }
    return true;
}

static ebpo_scene_meeting_kind kind_of(const ebpo_scene_meeting *m)
{
    return m->crossing   ? EBPO_MEETING_CROSSING
           : m->coplanar ? EBPO_MEETING_COPLANAR
           : m->touching ? EBPO_MEETING_TOUCHING
                         : EBPO_MEETING_NONE;
}

static ebpo_status ask_faces(const asking *a, ebpo_collider *collider,
                             const ebpo_collide_options *options, ebpo_scene_meeting *m,
                             ebpo_error *error)
{
    int32_t found = 0;
    ebpo_face_pair first;
    ebpo_status status = ebpo_collide_first(collider, options, &first, &found, error);
    if (status != EBPO_OK || found <= 0)
        return status;
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

static ebpo_status ask_pair(const asking *a, uint64_t n, ebpo_error *error)
{
    const ebpo_scene_pair *pair = &a->pairs[n];
    ebpo_scene_meeting *m = &a->meetings[n];
    const scene_instance *x = &a->scene->instances[pair->a], *y = &a->scene->instances[pair->b];
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_collider_options single = EBPO_COLLIDER_OPTIONS_INIT;
    ebpo_collider *collider = NULL;
    *m = (ebpo_scene_meeting){ .a = pair->a,
                               .b = pair->b,
                               .face_a = EBPO_NO_FACE,
                               .face_b = EBPO_NO_FACE,
                               .clearance = pair->clearance };
    single.threads = 1;
    ebpo_status status = ebpo_scene_pose(a->scene, pair->a, a->time, &options.pose_a, error);
    if (status == EBPO_OK)
        status = ebpo_scene_pose(a->scene, pair->b, a->time, &options.pose_b, error);
    if (status == EBPO_OK)
        status = ebpo_collider_new(a->scene->files[a->scene->models[x->as.model].file].model,
                                   a->scene->files[a->scene->models[y->as.model].file].model,
                                   &single, &collider, error);
    if (status == EBPO_OK)
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
    for (uint64_t i = 0; i < a->count; i++)
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
        status = ebpo_scene_pairs(scene, time, time, keep_pairs, &a, error);
    if (status == EBPO_OK && a.count)
        a.meetings = ebpo_alloc(a.count, sizeof *a.meetings);
    if (status == EBPO_OK && a.count && (!a.pairs || !a.meetings))
        status = ebpo_fail_memory(error, a.count * (sizeof *a.pairs + sizeof *a.meetings));
    if (status == EBPO_OK)
        status = make_models(&a, error);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(ebpo_thread_count(a.how.threads), NULL, a.count, 4, ask_pairs,
                                   &a, &a.how.progress, "asking pairs", error);
    if (status == EBPO_OK)
        give(&a, take, user);
    if (asked)
        *asked = a.count;
    free(a.pairs);
    free(a.meetings);
    return status;
}
