/* The commands: one cmd_*.c for each, main.c has their table. */
#ifndef EBPO_TOOLS_COMMANDS_H
#define EBPO_TOOLS_COMMANDS_H

#include "cli/args.h"

typedef struct command {
    const arg_spec *spec;
    int (*run)(int argc, char **argv); /* argv[0] is the command's name; returns the exit code */
} command;

extern const command command_convert, command_check, command_info, command_levels, command_extract,
    command_export, command_measure, command_render, command_verify;
extern const command command_inside, command_distance, command_ray, command_box, command_bench,
    command_subset, command_fetch, command_view, command_report;

#endif
