/* Lists the commands. Each command is in a file cmd_NAME.c. The file includes cli/options/NAME.inc,
 * which defines `spec`. make_options.py generates NAME.inc from NAME.options. The table of commands
 * is in options/meson.build. */
#ifndef EBPO_TOOLS_COMMANDS_H
#define EBPO_TOOLS_COMMANDS_H

#include "cli/args.h"
#include "cli/options/command_table.h"

typedef struct command {
    const arg_spec *spec;
    size_t size;          /* size of the struct `values` that spec->options fills */
    const void *standard; /* a struct of that type with the defaults */
    /* values: the struct with defaults and given options; operand: the operands,
     * then NULL. Returns the exit code. */
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
