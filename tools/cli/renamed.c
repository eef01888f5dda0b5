#include "cli/renamed.h"

#include <stdbool.h>
#include <string.h>

static const struct {
    const char *old, *current;
} commands[] = { { "repair", "recover" }, { "touch", "haptic" } };

/* Former options. If `command` is NULL, the option is one of every command. */
static const struct {
    const char *command, *old, *current;
} options[] = {
    { "bench", "level", "--max-level" },
    { "bench", "save-answers", "--save-results" },
    { "boolean", "level", "--max-level" },
    { "check", "places", "--findings" },
    { "collide", "level", "--max-level" },
    { "collide", "way-out", "--separation" },
    { "convert", "with", "--parts or --profile (for example --profile full)" },
    { "convert", "without", "--parts (for example --parts -mesh)" },
    { "distance", "level", "--max-level" },
    { "extract", "no-walls", "--no-cell-faces" },
    { "haptic", "look", "--search-radius" },
    { "haptic", "sense", "--probe" },
    { "inside", "level", "--max-level" },
    { "levels", "to", "--max-level" },
    { "measure", "deviation", "--error-bound" },
    { "measure", "limit", "--hulls" },
    { "measure", "questions", "--max-queries" },
    { "report", "need", "--targets" },
    { "report", "out", "--output" },
    { "scene", "outside", "--allow-outside" },
    { "scene", "places", "--locations" },
    { "view", "out", "--output" },
    { "view", "to", "--max-level" },
    { NULL, "most-expansion", "--max-expansion" },
    { NULL, "together", "--batch" },
};

static const struct {
    const char *option, *old, *current;
} words[] = { { "face-coding", "usual", "default" } };

static bool is_word(const char *word, const char *text, size_t length)
{
    return strlen(word) == length && memcmp(word, text, length) == 0;
}

const char *renamed_command(const char *name)
{
    for (size_t i = 0; i < sizeof commands / sizeof *commands; i++)
        if (strcmp(commands[i].old, name) == 0)
            return commands[i].current;
    return NULL;
}

const char *renamed_option(const char *command, const char *name, size_t length)
{
    for (size_t i = 0; i < sizeof options / sizeof *options; i++)
        if ((!options[i].command || strcmp(options[i].command, command) == 0) &&
            is_word(options[i].old, name, length))
            return options[i].current;
    return NULL;
}

const char *renamed_word(const char *option, const char *word, size_t length)
{
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        if (strcmp(words[i].option, option) == 0 && is_word(words[i].old, word, length))
            return words[i].current;
    return NULL;
}
