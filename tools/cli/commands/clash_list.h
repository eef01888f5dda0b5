/* Collects clashes of a scene: each pair of instances with a clash at some time occurs once, the
 * worst pair first. */
#ifndef EBPO_TOOLS_CLASH_LIST_H
#define EBPO_TOOLS_CLASH_LIST_H

#include <ebpo/scene.h>

typedef struct clash {
    ebpo_scene_clash worst;   /* at `time` */
    double time, first, last; /* time of the worst clash; the first and last frame with a clash */
    uint64_t frames;
    char *picture; /* a data URI, or NULL */
} clash;

/* Initialize with zeros. */
typedef struct clash_list {
    clash *clash;
    uint64_t count, capacity;
} clash_list;

/* Times ascend from call to call. */
EBPO_MUST_USE ebpo_status clash_add(clash_list *list, double time,
                                    const ebpo_scene_clash *found_clashes, uint64_t count,
                                    ebpo_error *error);

/* Sorts by kind, then by depth, by distance, by index. */
void clash_sort(clash_list *list);
void clash_free(clash_list *list);

/* Returns the word for an ebpo_clash_kind. */
const char *clash_kind_word(int32_t kind);

#endif
