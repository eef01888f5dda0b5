/* ebpo scene: models at many places, that move. */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "cli/command.h"
#include "cli/json.h"
#include "cli/progress.h"
#include "cli/words.h"
#include "cli/commands/commands.h"
#include "cli/commands/scene_plan.h"
#include "cli/commands/scene_report.h"
#include "cli/commands/scene_run.h"

static const char *const purpose_words[] = { "collide", "view", "inside", "solids", NULL };

#include "cli/options/scene.inc"

/* Which times are asked about: one, unless a span is given, or `spans` makes it the usual. */
static bool settle_times(scene_values *v, bool spans, const ebpo_scene *scene)
{
    ebpo_scene_counts c = EBPO_SCENE_COUNTS_INIT;
    (void)ebpo_scene_get_counts(scene, &c);
    bool span = !isnan(v->from) || !isnan(v->to) || v->step > 0;
    if (span && !isnan(v->time))
        return false;
    if (!span && !(spans && isnan(v->time))) {
        v->from = v->to = isnan(v->time) ? c.begin : v->time;
    } else {
        v->from = isnan(v->from) ? c.begin : v->from;
        v->to = isnan(v->to) ? c.end : v->to;
    }
    return v->from <= v->to;
}

enum { FRAMES_MOST = 10000000 };

/* NULL, or what is wrong with the options of a report. */
static const char *wrong_report(const scene_values *v)
{
    if (v->json && v->csv)
        return "--json and --csv exclude each other";
    if (v->out && !words_end_with(v->out, ".h5") && !words_end_with(v->out, ".html") &&
        !words_end_with(v->out, ".png"))
        return "--output of a report ends in .h5, .html or .png";
    if (v->to > v->from && !(v->step > 0))
        return "from one time to another a report needs --step";
    if (v->to > v->from && !((v->to - v->from) / v->step < FRAMES_MOST))
        return "--step is so small that there are more than ten million times";
    return NULL;
}

static const struct {
    const char *name;
    ebpo_status (*run)(const scene_values *v, const char *path, ebpo_scene *scene,
                       ebpo_error *error);
} deeds[] = {
    { "info", scene_info },   { "check", scene_check },   { "boxes", scene_boxes },
    { "pairs", scene_pairs }, { "report", scene_report }, { "approach", scene_approach },
    { "plan", scene_plan },   { "pack", scene_pack },
};
enum { DEEDS = sizeof deeds / sizeof *deeds };

static bool is_for_all(int deed)
{
    return deeds[deed].run == scene_approach || deeds[deed].run == scene_plan ||
           deeds[deed].run == scene_pack;
}

/* NULL, or what is wrong with the options of a plan: those of a report say what it is for. */
static const char *settle_purpose(scene_values *v)
{
    if (!v->solids && !(v->depth > 0))
        return NULL;
    if (v->purpose != EBPO_SCENE_FOR_COLLIDE && v->purpose != EBPO_SCENE_FOR_SOLIDS)
        return "--solids and --depth are for collide and solids, not for view or inside";
    v->purpose = EBPO_SCENE_FOR_SOLIDS;
    return NULL;
}

/* NULL, or what is wrong with the options of this deed. */
static const char *wrong_options(int deed, scene_values *v, ebpo_load_options *load)
{
    uint64_t target;
    if (deeds[deed].run == scene_approach && !(v->tolerance > 0))
        return "approach needs --tolerance";
    if (deeds[deed].run == scene_pack && !v->out)
        return "pack needs -o DIR";
    if (v->target_size && (!words_read_size(v->target_size, &target) || !target))
        return "--target-size expects " WORDS_SIZE_EXPECTED;
    if (v->memory && !words_read_size(v->memory, &load->memory))
        return "--memory expects " WORDS_SIZE_EXPECTED;
    if (deeds[deed].run == scene_plan || deeds[deed].run == scene_pack)
        return settle_purpose(v);
    return deeds[deed].run == scene_report ? wrong_report(v) : NULL;
}

static int run(void *given, const char **operand)
{
    scene_values *v = given;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_scene *scene = NULL;
    int deed = 0;
    while (deed < DEEDS && strcmp(operand[0], deeds[deed].name) != 0)
        deed++;
    if (deed == DEEDS)
        return command_usage(
            "scene", "'%s' is not one of info, check, boxes, pairs, report, approach, plan, pack",
            operand[0]);
    ebpo_scene_options how = EBPO_SCENE_OPTIONS_INIT;
    ebpo_load_options load = EBPO_LOAD_OPTIONS_INIT;
    load.most_expansion = (uint64_t)v->most_expansion;
    how.outside = v->outside;
    how.remote = v->remote;
    const char *wrong = NULL;
    ebpo_status status = ebpo_scene_open(operand[1], &how, &scene, &error);
    if (status == EBPO_OK && !settle_times(v, is_for_all(deed), scene))
        wrong = "--time stands alone; --from is not after --to";
    else if (status == EBPO_OK)
        wrong = wrong_options(deed, v, &load);
    if (wrong) {
        ebpo_scene_free(scene);
        return command_usage("scene", "%s", wrong);
    }
    progress_line line;
    load.progress = progress_start(&line, "scene", v->quiet);
    if (status == EBPO_OK)
        status = ebpo_scene_load(scene, &load, &error);
    progress_wipe(&line);
    if (status == EBPO_OK)
        status = deeds[deed].run(v, operand[1], scene, &error);
    ebpo_scene_free(scene);
    return status == EBPO_OK ? EXIT_FINE : command_failed("scene", &error);
}

static const scene_values usual = SCENE_VALUES_INIT;

const command command_scene = { &spec, sizeof usual, &usual, run };
