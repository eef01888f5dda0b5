#include "cli/boolean_operands.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/command.h"
#include "cli/words.h"

/* Adds an operand whose model is set later. Returns false, after an error message, if the letters A
 * to Z do not suffice. */
static bool add_operand(boolean_operands *o, const char *name, const char *shown,
                        const ebpo_pose *pose)
{
    if (o->count == BOOLEAN_OPERANDS) {
        command_usage(name,
                      "more than %d models were given, but the letters A to Z name only %d models",
                      BOOLEAN_OPERANDS, BOOLEAN_OPERANDS);
        return false;
    }
    o->shown[o->count] = shown;
    o->operand[o->count++].pose = *pose;
    return true;
}

/* Adds all instances of a scene. Returns an exit code. */
static int list_instances(boolean_operands *o, const char *name, boolean_input *in)
{
    ebpo_scene_counts counts = EBPO_SCENE_COUNTS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    if (ebpo_scene_open(in->path, NULL, &in->scene, &error) != EBPO_OK)
        return command_failed(name, &error);
    (void)ebpo_scene_get_counts(in->scene, &counts);
    if (counts.instances == 0)
        return command_usage(name, "%s: the scene has no instances", in->path);
    for (uint64_t i = 0; i < counts.instances; i++) {
        ebpo_scene_instance instance = EBPO_SCENE_INSTANCE_INIT;
        ebpo_pose pose;
        (void)ebpo_scene_get_instance(in->scene, i, &instance);
        if (ebpo_scene_pose(in->scene, i, counts.begin, &pose, &error) != EBPO_OK)
            return command_failed(name, &error);
        if (!add_operand(o, name, instance.name, &pose))
            return EXIT_USAGE;
    }
    return EXIT_OK;
}

int boolean_operands_list(boolean_operands *o, const char *name, const char **paths)
{
    const ebpo_pose no_motion = EBPO_POSE_INIT;
    memset(o, 0, sizeof *o);
    for (; *paths; paths++) {
        boolean_input *in = &o->input[o->inputs++];
        *in = (boolean_input){ .path = *paths, .first = o->count, .session = QUERY_SESSION_INIT };
        if (words_end_with(*paths, ".json")) {
            int code = list_instances(o, name, in);
            if (code != EXIT_OK)
                return code;
        } else if (!add_operand(o, name, *paths, &no_motion)) {
            return EXIT_USAGE;
        }
        in->count = o->count - in->first;
    }
    return EXIT_OK;
}

static int open_scene(boolean_operands *o, const char *name, boolean_input *in,
                      const ebpo_model_options *model_options, const remote_values *remote)
{
    ebpo_load_options load = EBPO_LOAD_OPTIONS_INIT;
    ebpo_boolean_operand operand[BOOLEAN_OPERANDS];
    ebpo_error error = EBPO_ERROR_INIT;
    uint32_t count = 0;
    /* the least memory of the models is not known before they are open */
    load.memory = model_options->memory * in->count * (o->raises_memory ? 16 : 1);
    if (o->memory_max)
        load.memory = o->memory_max * in->count;
    load.cut_level = model_options->cut_level;
    load.threads = model_options->threads;
    load.max_expansion = (uint64_t)remote->max_expansion;
    ebpo_status status = ebpo_scene_load(in->scene, &load, &error);
    if (status == EBPO_OK)
        status = ebpo_boolean_get_operands(in->scene, 0, operand, BOOLEAN_OPERANDS, &count, &error);
    for (uint32_t i = 0; i < count && status == EBPO_OK; i++)
        o->operand[in->first + i].model = operand[i].model; /* poses may be those of --pose */
    return status == EBPO_OK ? EXIT_OK : command_failed(name, &error);
}

/* Raises the memory for a model that needs more. */
static void raise_memory(const boolean_operands *o, const ebpo_file *file, uint64_t *memory)
{
    const ebpo_model_options any_level = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model_plan plan = EBPO_MODEL_PLAN_INIT;
    if (ebpo_model_memory(file, &any_level, &plan, NULL) != EBPO_OK)
        return; /* the error is reported when the model is made */
    uint64_t wanted = plan.least < o->memory_max ? plan.least : o->memory_max;
    if (o->raises_memory)
        wanted = 2 * plan.least;
    if (*memory < wanted)
        *memory = wanted;
}

/* Opens a model. A cut level below the model's last level is no error, because other models may
 * have more levels. Then the whole model stays in memory. */
static int open_model(boolean_operands *o, const char *name, boolean_input *in,
                      const ebpo_model_options *model_options, const remote_values *remote)
{
    const ebpo_model_options any_level = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model_options options = *model_options;
    int code = query_open_file(&in->session, name, in->path, &any_level, -1, remote);
    if (code == EXIT_OK && (o->raises_memory || o->memory_max))
        raise_memory(o, in->session.file, &options.memory);
    if (code == EXIT_OK)
        code = query_open_model(&in->session, name, &options);
    o->operand[in->first].model = in->session.model;
    return code;
}

int boolean_operands_open(boolean_operands *o, const char *name,
                          const ebpo_model_options *model_options, const remote_values *remote)
{
    int code = EXIT_OK;
    for (uint32_t i = 0; i < o->inputs && code == EXIT_OK; i++) {
        boolean_input *in = &o->input[i];
        code = in->scene ? open_scene(o, name, in, model_options, remote)
                         : open_model(o, name, in, model_options, remote);
    }
    return code;
}

void boolean_operands_close(boolean_operands *o)
{
    for (uint32_t i = 0; i < o->inputs; i++) {
        query_close(&o->input[i].session);
        ebpo_scene_free(o->input[i].scene);
    }
}

/* Returns the open file of an operand of an input. */
static const ebpo_file *file_of(const boolean_input *in, uint32_t operand)
{
    ebpo_scene_instance instance = EBPO_SCENE_INSTANCE_INIT;
    if (!in->scene)
        return in->session.file;
    (void)ebpo_scene_get_instance(in->scene, operand - in->first, &instance);
    return ebpo_scene_file(in->scene, instance.model);
}

const char *boolean_operands_unit(const boolean_operands *o, const boolean_nodes *nodes)
{
    const char *unit = "";
    for (uint32_t n = 0; n < nodes->count && !unit[0]; n++) {
        const boolean_input *in = o->input;
        uint32_t operand = nodes->node[n].left;
        if (nodes->node[n].operation != EBPO_BOOLEAN_OPERAND || o->operand[operand].pose.scale != 1)
            continue;
        while (operand >= in->first + in->count)
            in++;
        unit = ebpo_file_info(file_of(in, operand))->unit;
    }
    return unit[0] ? unit : NULL;
}

/* Returns true, after an error message, if a model of the scene is the output file, or without
 * memory. */
static bool overwrites_model(const boolean_input *in, const char *name, const char *out)
{
    ebpo_scene_counts counts = EBPO_SCENE_COUNTS_INIT;
    (void)ebpo_scene_get_counts(in->scene, &counts);
    for (uint64_t i = 0; i < counts.models; i++) {
        ebpo_scene_model_facts facts = EBPO_SCENE_MODEL_FACTS_INIT;
        (void)ebpo_scene_get_model_facts(in->scene, i, &facts);
        char *path = command_path_in_scene(in->path, facts.path);
        bool overwrites =
            path ? command_overwrites(name, path, out) : command_no_memory(name) != EXIT_OK;
        free(path);
        if (overwrites)
            return true;
    }
    return false;
}

bool boolean_operands_overwrite(const boolean_operands *o, const char *name, const char *out)
{
    for (uint32_t i = 0; i < o->inputs; i++)
        if (command_overwrites(name, o->input[i].path, out) ||
            (o->input[i].scene && overwrites_model(&o->input[i], name, out)))
            return true;
    return false;
}
