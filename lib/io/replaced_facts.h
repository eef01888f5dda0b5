/* What a file that replaces another takes over of it beside the name. */
#ifndef EBPO_IO_REPLACED_FACTS_H
#define EBPO_IO_REPLACED_FACTS_H

#include <stdbool.h>

/* Gives the open file mode, owner and extended attributes (access control lists are some) of the
 * regular file at `path`; of the owner and the attributes, which not everybody may give, what the
 * system allows. Without such a file: `mode`, if it is not -1. False, with errno, when the mode
 * cannot be given. */
bool ebpo_take_over_facts(int fd, const char *path, int mode);

#endif
