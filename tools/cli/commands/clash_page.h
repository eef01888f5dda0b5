/* A page of clashes for people who build: one file of HTML, without scripts. */
#ifndef EBPO_TOOLS_CLASH_PAGE_H
#define EBPO_TOOLS_CLASH_PAGE_H

#include "cli/commands/clash_list.h"

/* The list is sorted; the first ones have pictures. As a file, whole or not at all.
 *
 * title    the scene's file
 * frames   times that were looked at, from `from` to `to` */
EBPO_MUST_USE ebpo_status clash_page(const clash_list *list, const ebpo_scene *scene,
                                     const char *title, double from, double to, uint64_t frames,
                                     const char *path, ebpo_error *error);

#endif
