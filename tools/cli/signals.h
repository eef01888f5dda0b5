/* Handles SIGINT, SIGTERM, SIGHUP and SIGPIPE: removes temporary files and ends the process by the
 * same signal. SIGXFSZ becomes a write error. */
#ifndef EBPO_TOOLS_SIGNALS_H
#define EBPO_TOOLS_SIGNALS_H

void signals_install(void);

/* Registers a function that is called once when one of these signals arrives. It must be safe in a
 * signal handler. */
void signals_also(void (*clean_up)(void));

/* Registers a second such function, which removes temporary files that exist during a whole
 * command. */
void signals_scratch(void (*clean_up)(void));

#endif
