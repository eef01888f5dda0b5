#include "cli/selection_args.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "cli/command.h"

static const double most_planes = 1e9; /* as ebpo_build has it */

static int refused(const char *name, const char *message)
{
    fprintf(stderr, "ebpo %s: %s; try 'ebpo %s --help'\n", name, message, name);
    return EXIT_USAGE;
}

/* "500", or "1%", which is a share. */
static bool read_k_root(const char *text, double *k, bool *share)
{
    char *end;
    *k = strtod(text, &end);
    *share = *end == '%' && !end[1];
    if (end == text || (*end && !*share))
        return false;
    return (*share ? *k > 0 : *k >= 1) && *k <= most_planes;
}

static int check_k_root(const char *name, const char *text)
{
    double k;
    bool share;
    if (read_k_root(text, &k, &share))
        return EXIT_FINE;
    fprintf(stderr,
            "ebpo %s: --k-root: '%s' is not a number of planes from 1 to 1e9, such as 500, or a "
            "share of the faces, such as 1%%; try 'ebpo %s --help'\n",
            name, text, name);
    return EXIT_USAGE;
}

int selection_check(const char *name, const selection_options *o)
{
    const uint32_t inherit = 1u << EBPO_SELECT_INHERIT, kmedoids = 1u << EBPO_SELECT_KMEDOIDS,
                   random = 1u << EBPO_SELECT_RANDOM;
    if (!(o->chosen & ~inherit) && (o->percent >= 0 || o->k_root || o->normals >= 0))
        return refused(
            name, "--percent, --k-root and --normals are for --select kmedoids, offset or random");
    if (!(o->chosen & inherit) && o->epsilon >= 0)
        return refused(name, "--epsilon is for --select inherit");
    if (o->normals >= 0 && !(o->chosen & kmedoids))
        return refused(name, "--normals is for --select kmedoids");
    if (o->seed >= 0 && !(o->chosen & (kmedoids | random)))
        return refused(name, "--seed is for --select kmedoids or random");
    if (o->percent >= 0 && o->k_root)
        return refused(name, "--percent and --k-root exclude each other; give one");
    if (o->percent == 0)
        return refused(name, "--percent 0 leaves no planes; give more");
    return o->k_root ? check_k_root(name, o->k_root) : EXIT_FINE;
}

ebpo_status selection_k_root(const char *text, uint64_t faces, double *out, ebpo_error *error)
{
    double k = 0;
    bool share = false;
    *out = 0;
    if (!text)
        return EBPO_OK;
    bool fine = read_k_root(text, &k, &share);
    if (share)
        k = fmax(1, k / 100 * (double)faces);
    if (!fine || !(k <= most_planes)) {
        snprintf(error->message, sizeof error->message,
                 "--k-root: %.40s of %" PRIu64
                 " faces is more than 1e9 planes; give a smaller share",
                 text, faces);
        return error->status = EBPO_E_ARGUMENT;
    }
    *out = k;
    return EBPO_OK;
}
