/* Checks the options for selections, the methods that choose planes of envelopes. A trait is a
 * property of a selection. */
#include "cli/selection_args.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "cli/command.h"

static const double max_planes = 1e9; /* limit of ebpo_build */

/* Reads a number such as "500", or a share such as "1%". */
static bool read_k_root(const char *text, double *k, bool *share)
{
    char *end;
    *k = strtod(text, &end);
    *share = *end == '%' && !end[1];
    if (end == text || (*end && !*share))
        return false;
    return (*share ? *k > 0 : *k >= 1) && *k <= max_planes;
}

static int check_k_root(const char *name, const char *text)
{
    double k;
    bool share;
    if (read_k_root(text, &k, &share))
        return EXIT_OK;
    return command_usage(name,
                         "--k-root: '%s' is not a number of planes from 1 to 1e9, such as 500, or "
                         "a share of the faces, such as 1%%",
                         text);
}

typedef bool (*trait_fn)(const ebpo_selection_traits *traits);

static bool from_leaves(const ebpo_selection_traits *t) { return t->from_leaves; }
static bool from_root(const ebpo_selection_traits *t) { return !t->from_leaves; }
static bool uses_normal_distance(const ebpo_selection_traits *t) { return t->uses_normal_distance; }
static bool uses_seed(const ebpo_selection_traits *t) { return t->uses_seed; }

/* Returns the selections that have a trait, as bits. Writes their names to `names`, in the form
 * "kmedoids, offset or random". */
static uint32_t selections_with(trait_fn has, char *names, size_t size)
{
    uint32_t bits = 0;
    names[0] = 0;
    for (int i = EBPO_SELECTION_COUNT - 1; i >= 0; i--) {
        const ebpo_selection_traits *t = ebpo_selection_describe((ebpo_selection)i);
        if (!has(t))
            continue;
        char later[200]; /* names of the selections after i */
        snprintf(later, sizeof later, "%s", names);
        const char *between = !bits ? "" : bits & (bits - 1) ? ", " : " or ";
        snprintf(names, size, "%s%s%.150s", t->name, between, later);
        bits |= 1u << i;
    }
    return bits;
}

/* Refuses options that were given but affect none of the chosen selections. `options`: beginning of
 * the message, such as "--epsilon is". `has`: the trait of the selections that use the options. */
static int check_effect(const char *name, const selection_options *o, bool given,
                        const char *options, trait_fn has)
{
    char names[200], message[300];
    uint32_t affected = selections_with(has, names, sizeof names);
    if (!given || o->chosen & affected)
        return EXIT_OK;
    snprintf(message, sizeof message, "%s for --select %s", options, names);
    return command_usage(name, "%s", message);
}

int selection_check(const char *name, const selection_options *o)
{
    int code = check_effect(name, o, o->percent >= 0 || o->k_root || o->normals >= 0,
                            "--percent, --k-root and --normals are", from_leaves);
    if (code == EXIT_OK)
        code = check_effect(name, o, o->epsilon >= 0, "--epsilon is", from_root);
    if (code == EXIT_OK)
        code = check_effect(name, o, o->normals >= 0, "--normals is", uses_normal_distance);
    if (code == EXIT_OK)
        code = check_effect(name, o, o->seed >= 0, "--seed is", uses_seed);
    if (code != EXIT_OK)
        return code;
    if (o->percent >= 0 && o->k_root)
        return command_usage(name, "--percent and --k-root cannot be used together; give one");
    if (o->percent == 0)
        return command_usage(name, "--percent 0 leaves no planes; give more");
    return o->k_root ? check_k_root(name, o->k_root) : EXIT_OK;
}

ebpo_status selection_k_root(const char *text, uint64_t faces, double *out, ebpo_error *error)
{
    double k = 0;
    bool share = false;
    *out = 0;
    if (!text)
        return EBPO_OK;
    bool is_read = read_k_root(text, &k, &share);
    if (share)
        k = fmax(1, k / 100 * (double)faces);
    if (!is_read || !(k <= max_planes)) {
        snprintf(error->message, sizeof error->message,
                 "--k-root: %.40s of %" PRIu64
                 " faces is more than 1e9 planes; give a smaller share",
                 text, faces);
        return error->status = EBPO_E_ARGUMENT;
    }
    *out = k;
    return EBPO_OK;
}
