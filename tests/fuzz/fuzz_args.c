/* SPDX-License-Identifier: MIT
 * Any bytes as a command line, for the table of each command; and as values of options: sizes,
 * levels, times, poses, expressions, numbers.
 *
 * Input: a byte for the kind (64 and above: a value), the text; arguments end with line feeds. */
#include "fuzz_support.h"
#include "fuzz_quiet.h"

#include <math.h>

#include "cli/memory_args.h"
#include "cli/numbers.h"
#include "cli/pose_args.h"
#include "cli/query_args.h"
#include "cli/selection_args.h"
#include "cli/subtree_args.h"
#include "cli/words.h"
#include "cli/commands/commands.h"
#include "ebpo_config.h"

#if EBPO_HAVE_EXTRAS
#include "cli/boolean_args.h"
#include "cli/commands/map_job.h"
#endif

static const command *const commands[] = {
    &command_convert, &command_check,   &command_info,    &command_levels, &command_view,
    &command_extract, &command_export,  &command_subset,  &command_repack, &command_fetch,
    &command_measure, &command_render,  &command_verify,  &command_inside, &command_distance,
    &command_ray,     &command_box,     &command_bench,   &command_report, &command_recover,
#if EBPO_HAVE_EXTRAS
    &command_scene,   &command_boolean, &command_collide, &command_map,    &command_haptic,
    &command_paint,
#endif
};
enum { COMMANDS = sizeof commands / sizeof *commands, WORDS_MAX = 40, VALUES = 64 };

static void command_line(const command *c, char *text)
{
    char name[] = "fuzz", *argv[WORDS_MAX + 1] = { name };
    const char *operand[ARGS_OPERANDS_MAX + 1];
    int argc = 1;
    for (char *at = text; *at && argc < WORDS_MAX; argc++) {
        argv[argc] = at;
        at += strcspn(at, "\n");
        if (*at)
            *at++ = 0;
    }
    void *values = fuzz_copy(c->standard, c->size);
    if (args_parse(c->spec, argc, argv, values, operand) == ARGS_RUN)
        for (int i = 0; i < c->spec->least; i++)
            fuzz_must(operand[i] != NULL);
    free(values);
}

static void number(const char *text)
{
    char printed[NUMBER_CAPACITY + 1], *end;
    const char *after;
    double v = number_read(text, text + strlen(text), &after), expected = strtod(text, &end);
    if (after == text)
        return;
    fuzz_must(memcmp(&v, &expected, sizeof v) == 0 || isnan(v));
    *number_write(printed, v) = 0;
    double again = strtod(printed, NULL);
    fuzz_must(memcmp(&v, &again, sizeof v) == 0 || isnan(v));
}

#if EBPO_HAVE_EXTRAS
static void expression(const char *text, uint32_t operands)
{
    boolean_nodes nodes;
    if (!boolean_read("fuzz", text, operands, &nodes))
        return;
    fuzz_must(nodes.count > 0 && nodes.count <= EBPO_BOOLEAN_NODES_MAX);
}

static void picture_size(const char *text)
{
    int width, height;
    if (map_read_size(text, &width, &height))
        fuzz_must(width >= 2 && width <= 8192 && height >= 2 && height <= 8192);
}
#endif

static void value(uint8_t what, const char *text)
{
    word_levels levels;
    ebpo_pose pose = EBPO_POSE_INIT;
    uint64_t n;
    double planes;
    switch (what % 10) {
    case 0: (void)words_read_size(text, &n); break;
    case 1:
        if (words_read_levels(text, &levels))
            fuzz_must(levels.set && levels.first <= levels.last && levels.last <= 20);
        break;
    case 2:
        if (pose_read(text, &pose))
            fuzz_must(isfinite(pose.scale) && isfinite(pose.translation[0]));
        break;
#if EBPO_HAVE_EXTRAS
    case 3: expression(text, 1 + what / 10 % 12); break;
    case 8: picture_size(text); break;
#endif
    case 4: (void)subtree_faces_read("fuzz", text, &n); break;
    case 5: (void)query_read_time("fuzz", text, &n); break;
    case 6: (void)memory_check("fuzz", &(memory_values){ text, NULL }); break;
    case 7: {
        selection_options o = { 1, -1, -1, text, -1, -1 };
        if (selection_check("fuzz", &o) == 0 &&
            selection_k_root(text, 1000, &planes, NULL) == EBPO_OK)
            fuzz_must(planes >= 0 && planes <= 1e9);
        break;
    }
    default: number(text);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static bool begun;
    if (!begun) {
        fuzz_quiet();
        words_init();
        begun = true;
    }
    if (size < 1)
        return 0;
    char *text = fuzz_text(data + 1, size - 1);
    if (data[0] < VALUES)
        command_line(commands[data[0] % COMMANDS], text);
    else
        value((uint8_t)(data[0] - VALUES), text);
    free(text);
    return 0;
}
