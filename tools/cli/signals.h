/* SIGINT, SIGTERM, SIGHUP and SIGPIPE: no temporary file stays behind, and the process ends by that
 * signal. SIGXFSZ becomes a write error. */
#ifndef EBPO_TOOLS_SIGNALS_H
#define EBPO_TOOLS_SIGNALS_H

void signals_install(void);

/* Called as well, once, when such a signal comes: it may only do what a signal handler may. */
void signals_also(void (*clean_up)(void));

/* The same for temporary files that stand around a whole command. */
void signals_scratch(void (*clean_up)(void));

#endif
