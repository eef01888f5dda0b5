/* ebpo scene: models at many places, that move. */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "cli/command.h"
#include "cli/json.h"
#include "cli/progress.h"
#include "cli/words.h"
#include "cmd/commands.h"
#include "cmd/scene_plan.h"
#include "cmd/scene_report.h"
#include "cmd/scene_run.h"

static const char *const purpose_words[] = { "collide", "view", "inside", "solids", NULL };

static const arg_option options[] = {
    OPTION_REAL("time", 't', scene_values, time, "T", -1e300, 1e300,
                "at this time; default: the first of all routes"),
    OPTION_REAL("from", 0, scene_values, from, "T", -1e300, 1e300,
                "from this time on; default: the first"),
    OPTION_REAL("to", 0, scene_values, to, "T", -1e300, 1e300,
                "up to this time; default: the last"),
    OPTION_REAL("step", 0, scene_values, step, "S", 1e-300, 1e300,
                "report: between --from and --to look every S seconds"),
    OPTION_REAL("tolerance", 0, scene_values, tolerance, "D", 1e-300, 1e300,
                "approach: how near is near, beyond the clearance"),
    OPTION_WORD(
        "for", 0, scene_values, purpose, "WHAT", purpose_words,
        "plan, pack: what will be asked: collide (report, approach; the usual), view (pictures "
        "from the cameras), inside, or solids (collide, and report --solids, --depth)"),
    OPTION_REAL("margin", 0, scene_values, margin, "D", 1e-300, 1e300,
                "plan, pack: what comes so near, beyond the clearance, is needed too"),
    OPTION_TEXT("output", 'o', scene_values, out, "PATH",
                "pack: the folder to make; report: a file that ends in .h5, .html (a page of "
                "clashes) or .png "
                "(pictures)"),
    OPTION_TEXT("target-size", 0, scene_values, target_size, "S",
                "pack: models of at most this many bytes (5M, 512KiB) together, with "
                "the least error"),
    OPTION_FLAG("count", 0, scene_values, count,
                "report: count all pairs of faces that meet, and lines of contact"),
    OPTION_FLAG("places", 0, scene_values, places, "report: also where"),
    OPTION_FLAG(
        "solids", 0, scene_values, solids,
        "report: how solids lie to each other: protruding, enclosed, duplicate; plan, pack: "
        "as --for solids"),
    OPTION_REAL("depth", 0, scene_values, depth, "D", 1e-300, 1e300,
                "report: how deep one is in the other, within D"),
    OPTION_FLAG("least", 0, scene_values, least,
                "approach: how near they come at all times, and when"),
    OPTION_TEXT(
        "memory", 0, scene_values, memory, "SIZE",
        "report, approach: bytes that all models may use together (512M, 1GiB); default: as "
        "many as they need"),
    OPTION_THREADS(scene_values, threads),
    OPTION_FLAG("outside", 0, scene_values, outside,
                "files that the scene names may lie outside its folder"),
    OPTION_FLAG("remote", 0, scene_values, remote,
                "models may be on web servers, if their digests are given"),
    OPTION_FLAG("csv", 0, scene_values, csv, "report: print CSV"),
    OPTION_FLAG("json", 0, scene_values, json, "print JSON"),
    OPTION_QUIET(scene_values, quiet),
    { 0 },
};

static const arg_spec spec = {
    .command = "scene",
    .operands = "info|check|boxes|pairs|report|approach|plan|pack FILE",
    .least = 2,
    .most = 2,
    .summary = "describes a scene: models at many places, that move, and which meet",
    .text =
        "FILE is a scene in JSON. 'info' tells what it holds and where that is, 'check' opens "
        "every model and says whether all fits together, 'boxes' prints the box of each "
        "instance, 'pairs' the instances whose boxes come close enough to each other, 'report' "
        "those whose faces meet or are too near, exactly, 'approach' when pairs first come near, "
        "'plan' what of each model the scene can ever call for, 'pack' writes that as a folder.",
    .options = options,
};

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
