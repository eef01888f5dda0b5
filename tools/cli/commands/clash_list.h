/* Clashes of a scene: each pair of instances that met at some time, once, the worst first. */
#ifndef EBPO_TOOLS_CLASH_LIST_H
#define EBPO_TOOLS_CLASH_LIST_H

#include <ebpo/scene.h>

typedef struct clash {
    ebpo_scene_meeting worst; /* at `time` */
    double time, first, last; /* the worst one; the first and last frame in which they meet */
    uint64_t frames;
    char *picture; /* a data URI, or NULL */
} clash;

/* Zero at first. */
typedef struct clash_list {
    clash *clash;
    uint64_t count, capacity;
} clash_list;

/* Times ascend from call to call. */
EBPO_MUST_USE ebpo_status clash_add(clash_list *list, double time,
                                    const ebpo_scene_meeting *meetings, uint64_t count,
                                    ebpo_error *error);

/* By kind, then by depth, by distance, by number. */
void clash_sort(clash_list *list);
void clash_free(clash_list *list);

/* Of an ebpo_meeting_kind. */
const char *clash_kind_word(int32_t kind);

#endif
