/* Makes folders for files of tests, below $TMPDIR or /tmp, and removes them with their contents. */
#ifndef EBPO_TESTS_SCRATCH_H
#define EBPO_TESTS_SCRATCH_H

enum { SCRATCH_LENGTH = 96 };

/* Makes a folder; ends the program on failure. */
void scratch_make(char folder[SCRATCH_LENGTH]);
/* Removes a folder with its contents, whatever their permissions are. Does nothing if the name is
 * empty. */
void scratch_remove(const char *folder);

/* Fixtures that empty the program's folder before and after a test. check_main.c removes it at the
 * end, also when a test crashes. */
void scratch_enter(void);
void scratch_leave(void);
void scratch_end(void); /* for check_main.c */
/* Returns the number of entries of the program's folder, for tests that must leave no files. */
int scratch_entries(void);
/* Returns a path in the program's folder: the same string for the same name while the program runs.
 * `name` NULL: the folder. */
const char *scratch(const char *name);

#endif
