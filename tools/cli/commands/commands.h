/* The commands: one cmd_*.c for each, main.c has their table. */
#ifndef EBPO_TOOLS_COMMANDS_H
#define EBPO_TOOLS_COMMANDS_H

#include "cli/args.h"

typedef struct command {
    const arg_spec *spec;
    size_t size;       /* of the struct that spec->options fills */
    const void *usual; /* what is in it before */
    /* operand[ARGS_OPERANDS_MAX], NULL where none was given; returns the exit code */
    int (*run)(void *values, const char **operand);
} command;

extern const command command_convert, command_check, command_info, command_levels, command_extract,
    command_export, command_measure, command_render, command_verify;
extern const command command_inside, command_distance, command_ray, command_box, command_bench,
    command_subset, command_fetch, command_view, command_report, command_repack, command_repair,
    command_scene, command_boolean, command_collide, command_map, command_touch, command_paint,
    command_catalogue;

#endif
