/* Lists the commands. Each command is in a file cmd_NAME.c; the table of commands is in
 * options/meson.build. */
#ifndef EBPO_TOOLS_COMMANDS_H
#define EBPO_TOOLS_COMMANDS_H

#include "cli/args.h"
#include "cli/options/command_table.h"

typedef struct command {
    const arg_spec *spec;
    size_t size;          /* size of the struct that spec->options fills */
    const void *standard; /* the defaults of that struct */
    /* operand[ARGS_OPERANDS_MAX], NULL where none was given; returns the exit code */
    int (*run)(void *values, const char **operand);
} command;

#define COMMAND_GROUP(title, list) list
#define ABSENT_GROUP(title, names)
#define COMMAND(name) extern const command command_##name;
COMMAND_TABLE
#undef COMMAND_GROUP
#undef ABSENT_GROUP
#undef COMMAND

#endif
