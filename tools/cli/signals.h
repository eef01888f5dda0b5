/* Handles SIGINT, SIGTERM, SIGHUP and SIGPIPE: removes temporary files, and then ends the process
 * by the same signal. SIGXFSZ is ignored, so that the write that exceeds the limit fails. */
#ifndef EBPO_TOOLS_SIGNALS_H
#define EBPO_TOOLS_SIGNALS_H

void signals_install(void);

/* Registers the function that removes the files of the running command when one of these signals
 * arrives; NULL: none. The function replaces that of an earlier call, and must be
 * async-signal-safe. */
void signals_set_cleanup(void (*clean_up)(void));

/* Registers a second function, which removes the temporary copies of standard input and output. A
 * signal calls both functions. */
void signals_set_scratch_cleanup(void (*clean_up)(void));

#endif
