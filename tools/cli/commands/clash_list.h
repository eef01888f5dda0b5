/* Collects clashes of a scene: each pair of instances with a clash at some time occurs once, the
 * worst pair first. */
#ifndef EBPO_TOOLS_CLASH_LIST_H
#define EBPO_TOOLS_CLASH_LIST_H

#include <ebpo/scene.h>

/* The clashes of a pair of instances. */
typedef struct clash {
    ebpo_scene_clash worst; /* the worst clash of the pair */
    double time;            /* when `worst` occurs */
    double first, last;     /* the first and the last evaluated time with a clash */
    uint64_t frames;        /* number of evaluated times with a clash */
    char *picture;          /* a PNG picture as a data URI; NULL: no picture */
} clash;

/* Initialize with zeros. */
typedef struct clash_list {
    clash *clash; /* [count] */
    uint64_t count, capacity;
} clash_list;

/* Adds the clashes at a time. found_clashes[count] must be sorted by the indices of the instances
 * (a, then b). `time` must be greater than in the call before. */
EBPO_MUST_USE ebpo_status clash_add(clash_list *list, double time,
                                    const ebpo_scene_clash *found_clashes, uint64_t count,
                                    ebpo_error *error);

/* Sorts by severity of the kind, then by depth, by distance and by the indices of instances; the
 * worst clash is first. */
void clash_sort(clash_list *list);
void clash_free(clash_list *list);

/* Returns the word for an ebpo_clash_kind. */
const char *clash_kind_word(int32_t kind);

#endif
