/* ebpo info: describes a file and its contents. Reads the header only. */
#include <stddef.h>
#include <stdio.h>

#include "cli/command.h"
#include "cli/file_facts.h"
#include "cli/memory_facts.h"
#include "cli/remote_args.h"
#include "cli/textures.h"
#include "cli/words.h"
#include "cli/commands/commands.h"

typedef struct values {
    bool json, arrays;
    const char *memory;
    remote_values remote;
} values;

#include "cli/options/info.inc"

static const values standard = { .remote = REMOTE_VALUES_INIT };

static ebpo_status plan_memory(const ebpo_file *file, const values *v, ebpo_model_plan *out,
                               ebpo_error *error)
{
    ebpo_model_options model_options = EBPO_MODEL_OPTIONS_INIT;
    if (!v->memory)
        return EBPO_OK;
    (void)words_read_size(v->memory, &model_options.memory); /* run_info has checked the text */
    return ebpo_model_memory(file, &model_options, out, error);
}

static void print_words(const values *v, const char *path, const ebpo_file *file,
                        const ebpo_stored_sizes *stored, const ebpo_model_plan *plan,
                        const textures *images)
{
    const ebpo_info *info = ebpo_file_info(file);
    facts_print(stdout, path, info, stored);
    if (v->memory)
        memory_facts(stdout, plan);
    facts_attributes(stdout, file);
    textures_print(stdout, images);
    putchar('\n');
    facts_table(stdout, info, stored);
    if (v->arrays)
        facts_arrays(stdout, file);
}

static void print_json(const values *v, const char *path, const ebpo_file *file,
                       const ebpo_stored_sizes *stored, const ebpo_model_plan *plan,
                       const textures *images, const traffic *t)
{
    json j;
    json_begin(&j, stdout);
    json_object(&j, NULL);
    facts_json(&j, path, ebpo_file_info(file), stored, NULL);
    if (v->memory)
        memory_facts_json(&j, "memory", plan);
    facts_attributes_json(&j, file);
    textures_json(&j, images);
    if (v->arrays)
        facts_arrays_json(&j, file);
    remote_json(&j, t, &v->remote);
    json_finish(&j);
}

static int run_info(void *given, const char **operand)
{
    values *v = given;
    uint64_t bytes;
    if (v->memory && !words_read_size(v->memory, &bytes))
        return command_usage("info", "--memory: '%s' is not " WORDS_SIZE_EXPECTED, v->memory);
    if (!command_requires_hdf5("info", operand[0]))
        return EXIT_FAILED;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    ebpo_stored_sizes stored = EBPO_STORED_SIZES_INIT;
    ebpo_model_plan plan = EBPO_MODEL_PLAN_INIT;
    ebpo_status status = remote_open(&file, operand[0], &v->remote, &error);
    if (status == EBPO_OK)
        status = ebpo_file_locate(file, &stored, &error);
    if (status == EBPO_OK)
        status = plan_memory(file, v, &plan, &error);
    textures images = { .count = 0 };
    if (status == EBPO_OK)
        status = textures_read(&images, file, false, &error);
    if (status != EBPO_OK) {
        ebpo_close(file);
        return command_failed("info", &error);
    }
    traffic t = traffic_of(file);
    if (v->json) {
        print_json(v, remote_shown(operand[0]), file, &stored, &plan, &images, &t);
    } else {
        print_words(v, remote_shown(operand[0]), file, &stored, &plan, &images);
        remote_report(&t, &v->remote, false);
    }
    textures_free(&images);
    ebpo_close(file);
    return EXIT_OK;
}

const command command_info = { &spec, sizeof standard, &standard, run_info };
