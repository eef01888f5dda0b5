/* Suppresses reports of LeakSanitizer on two kinds of memory: leaks of libhdf5 1.10 after a damaged
 * object header, and memory that the dynamic linker allocates for dlopen and never frees.
 * LeakSanitizer does not report the second kind, except if the malloc of faults.c is preloaded. One
 * file of each program that is built with LeakSanitizer includes this header. */
#ifndef EBPO_TESTS_KNOWN_LEAKS_H
#define EBPO_TESTS_KNOWN_LEAKS_H

__attribute__((visibility("default"))) const char *__lsan_default_suppressions(void);
const char *__lsan_default_suppressions(void) { return "leak:libhdf5\nleak:ld-linux"; }

#endif
