/* Rows of a page of clashes by the groups of their parts: chosen without scripts. */
#ifndef EBPO_TOOLS_CLASH_GROUPS_H
#define EBPO_TOOLS_CLASH_GROUPS_H

#include <stdio.h>

#include "cli/commands/clash_list.h"

/* Buttons, one for each group that has clashes, before a table of class `c` that follows at once:
 * nothing where there is none. False: no memory. */
bool clash_put_choice(FILE *f, const clash_list *list, const ebpo_scene *scene);

/* The class that a row has for them: what stands in <tr> behind its name. */
void clash_put_classes(FILE *f, const clash *c, const ebpo_scene *scene);

#endif
