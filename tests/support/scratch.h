/* Folders for what tests write: below $TMPDIR or /tmp, empty when made, gone with all in them. */
#ifndef EBPO_TESTS_SCRATCH_H
#define EBPO_TESTS_SCRATCH_H

enum { SCRATCH_LENGTH = 96 };

/* A new folder; ends the program when there can be none. */
void scratch_make(char folder[SCRATCH_LENGTH]);
/* With all in it, whatever its permissions. An empty name is no folder. */
void scratch_remove(const char *folder);

/* The program's own folder, which check_main.c removes at the end, also when a test dies: fixtures
 * that empty it before a test and after it. */
void scratch_enter(void);
void scratch_leave(void);
void scratch_end(void); /* check_main.c's */
/* What stands in it; a test that leaves nothing behind says so. */
int scratch_entries(void);
/* A path in it: the same string for the same name, as long as the program runs. NULL: the folder
 * itself. */
const char *scratch(const char *name);

#endif
