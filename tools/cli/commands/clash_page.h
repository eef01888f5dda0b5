/* Writes a page of clashes: one HTML file, without scripts. */
#ifndef EBPO_TOOLS_CLASH_PAGE_H
#define EBPO_TOOLS_CLASH_PAGE_H

#include "cli/commands/clash_list.h"

/* Writes the page of a list that clash_sort has sorted. Replaces the file `path` atomically.
 *
 *   title   name of the scene's file
 *   frames  number of evaluated times, from `from` to `to` */
EBPO_MUST_USE ebpo_status clash_page(const clash_list *list, const ebpo_scene *scene,
                                     const char *title, double from, double to, uint64_t frames,
                                     const char *path, ebpo_error *error);

#endif
