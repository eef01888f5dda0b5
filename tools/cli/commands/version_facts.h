/* What `ebpo --version` tells. */
#ifndef EBPO_TOOLS_VERSION_FACTS_H
#define EBPO_TOOLS_VERSION_FACTS_H

/* `argument`: what follows --version: NULL, or --verbose (with the program, the library that runs,
 * the HDF5 plugin, and what was built in). The exit code: EXIT_FAILED, with the reason on stderr,
 * when another library runs than the one that was installed with the program. */
int version_tell(const char *argument);

#endif
