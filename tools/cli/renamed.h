/* Former names of commands, options and values, for messages that give the current names. */
#ifndef EBPO_TOOLS_RENAMED_H
#define EBPO_TOOLS_RENAMED_H

#include <stddef.h>

/* Returns the current name of a command; NULL: `name` is not a former name. */
const char *renamed_command(const char *name);

/* Returns the current option, such as "--parts (for example --parts -mesh)"; NULL: name[length] is
 * not a former option of the command. */
const char *renamed_option(const char *command, const char *name, size_t length);

/* Returns the current value of an option; NULL: word[length] is not a former value. */
const char *renamed_word(const char *option, const char *word, size_t length);

#endif
