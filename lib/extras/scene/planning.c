/* What a scene needs of its models. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "extras/scene/planning.h"
#include "extras/scene/scene_views.h"

ebpo_status scene_plan_check(scene_needs *needs, const ebpo_plan_options *options)
{
    const ebpo_scene *scene = needs->scene;
    ebpo_error *error = needs->error;
    needs->how = (ebpo_plan_options)EBPO_PLAN_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_plan_options, &needs->how, options, error);
    if (status != EBPO_OK)
        return status;
    if (needs->how.purpose < EBPO_SCENE_FOR_COLLIDE || needs->how.purpose > EBPO_SCENE_FOR_SOLIDS)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "there is no purpose %d", (int)needs->how.purpose);
    if (!(needs->how.margin >= 0 && needs->how.margin < INFINITY))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "the margin %g is below 0 or no length",
                         needs->how.margin);
    if (!(isfinite(needs->from) && isfinite(needs->to) && needs->from <= needs->to))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "there is no time from %g to %g", needs->from,
                         needs->to);
    for (uint64_t i = 0; i < scene->models_count; i++)
        if (scene->models[i].file == EBPO_SCENE_NONE)
            return ebpo_fail(error, EBPO_E_ARGUMENT, "model '%.80s' has not been loaded",
                             scene->models[i].name);
    return EBPO_OK;
}

ebpo_status scene_plan_needs(scene_needs *needs)
{
    ebpo_status status = scene_begin_needs(needs);
    if (status == EBPO_OK)
        status = needs->how.purpose == EBPO_SCENE_FOR_VIEW ? scene_add_views(needs)
                                                           : scene_add_near(needs);
    if (status == EBPO_OK)
        scene_end_needs(needs);
    return status;
}

ebpo_status scene_plan_list(const scene_needs *needs, ebpo_scene_need **out)
{
    uint64_t count = needs->scene->models_count;
    ebpo_scene_need *list = ebpo_alloc(count, sizeof *list);
    ebpo_status status = list ? EBPO_OK : ebpo_fail_memory(needs->error, count * sizeof *list);
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++)
        status = scene_tell_need(needs, i, &list[i]);
    *out = list;
    return status;
}

ebpo_status ebpo_scene_plan(ebpo_scene *scene, double from, double to,
                            const ebpo_plan_options *options, ebpo_scene_needs_fn take, void *user,
                            ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    scene_needs needs = { .scene = scene, .from = from, .to = to, .error = error };
    ebpo_scene_need *list = NULL;
    ebpo_status status = scene_plan_check(&needs, options);
    if (status == EBPO_OK)
        status = scene_plan_needs(&needs);
    if (status == EBPO_OK)
        status = scene_plan_list(&needs, &list);
    if (status == EBPO_OK && scene->models_count)
        (void)take(user, list, scene->models_count);
    free(list);
    free(needs.files);
    return status;
}
