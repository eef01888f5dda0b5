/* Suppresses leaks of libhdf5 1.10 after a damaged object header, and what the dynamic linker
 * allocates for dlopen and holds until the end: LeakSanitizer omits it by itself, but not when the
 * preloaded malloc of faults.c is between. One file of each program that is built with
 * LeakSanitizer includes this header. */
#ifndef EBPO_TESTS_KNOWN_LEAKS_H
#define EBPO_TESTS_KNOWN_LEAKS_H

__attribute__((visibility("default"))) const char *__lsan_default_suppressions(void);
const char *__lsan_default_suppressions(void) { return "leak:libhdf5\nleak:ld-linux"; }

#endif
