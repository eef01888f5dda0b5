/* ebpo collide --distance, --depth and --way-out: asking and printing; and relations of models
 * whose faces do not meet. */
#ifndef EBPO_TOOLS_COLLIDE_FAR_H
#define EBPO_TOOLS_COLLIDE_FAR_H

#include <ebpo/collide.h>

/* As the options say; not given: a tolerance of 0, an at_least below 0. */
typedef struct collide_far {
    bool distance, depth;
    double tolerance, at_least;
    const char *way_out; /* X Y Z, or NULL */
    double direction[3]; /* set by collide_far_fits */
} collide_far;

#define COLLIDE_FAR_INIT                           \
    {                                              \
        false, false, 0.0, -1.0, NULL, { 0, 0, 0 } \
    }

/* By ebpo_relation. */
extern const char *const collide_relations[];

/* How models whose faces do not meet lie to each other: *relation is an ebpo_relation as its name;
 * NULL: they are DISJOINT, or faces meet after all. */
ebpo_status collide_unmet(ebpo_collider *collider, const ebpo_collide_options *how,
                          const char **relation, ebpo_error *error);
/* Prints it behind what the line has: " NAME", or as a member of JSON. NULL: nothing. */
void collide_print_unmet(bool as_json, const char *relation);

/* False, and a message on standard error: they do not go together. others: --all or --self. */
bool collide_far_fits(collide_far *far, bool others);

bool collide_far_asked(const collide_far *far);

ebpo_status collide_far_ask(const collide_far *far, bool as_json, ebpo_collider *collider,
                            const ebpo_collide_options *how, ebpo_error *error);

#endif
