/* Prints `ebpo --version`. */
#ifndef EBPO_TOOLS_VERSION_FACTS_H
#define EBPO_TOOLS_VERSION_FACTS_H

/* argument: the argument after --version; NULL: none. With --verbose, also prints the paths of the
 * program, the running library and the HDF5 plugin, and the names of built-in parts. Returns an
 * exit code: EXIT_FAILED, with the reason on stderr, if the running library is not the library
 * installed with the program. */
int version_report(const char *argument);

#endif
