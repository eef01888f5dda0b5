/* SIGINT, SIGTERM and SIGHUP: no temporary file stays behind, and the process ends by that signal. SIGXFSZ becomes a
 * write error. */
#ifndef EBPO_TOOLS_SIGNALS_H
#define EBPO_TOOLS_SIGNALS_H

void signals_install(void);

#endif
