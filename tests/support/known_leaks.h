/* For the one file of a program that is built with LeakSanitizer: libhdf5 1.10 itself leaks when it
 * gives up on a damaged object header; that is not what we look for. */
#ifndef EBPO_TESTS_KNOWN_LEAKS_H
#define EBPO_TESTS_KNOWN_LEAKS_H

__attribute__((visibility("default"))) const char *__lsan_default_suppressions(void);
const char *__lsan_default_suppressions(void) { return "leak:libhdf5"; }

#endif
