#include "cli/model_memory.h"

#include <ebpo/http.h>
#include <ebpo/memory.h>
#include <stdio.h>

#include "cli/words.h"

void model_memory_report_least(const char *command, const char *path, uint64_t least, uint64_t half)
{
    char needs[32], has[32];
    words_bytes(needs, sizeof needs, least);
    words_bytes(has, sizeof has, half);
    fprintf(stderr,
            "ebpo %s: %s: note: needs at least %s of memory, more than %s, half of the free "
            "memory\n",
            command, path, needs, has);
}

void model_memory_default(const char *command, const ebpo_file *file, const char *path,
                          ebpo_model_options *options)
{
    ebpo_model_plan plan = EBPO_MODEL_PLAN_INIT;
    if (ebpo_is_url(path) || ebpo_model_memory(file, options, &plan, NULL) != EBPO_OK)
        return; /* the error is reported when the model is made */
    uint64_t half = ebpo_free_memory() / 2;
    options->memory = plan.whole <= half ? 0 : half > plan.least ? half : plan.least;
    if (plan.whole > half && plan.least > half)
        model_memory_report_least(command, path, plan.least, half);
}
