/* Runs a faulty web server, tests/support/faulty_server.py, for a test program. The server is
 * started once, and always ends with the program. */
#ifndef EBPO_TESTS_WEB_H
#define EBPO_TESTS_WEB_H

#include <stdbool.h>
#include <stddef.h>

/* Serves these bytes as a file. Returns false if Python is not available. The server ends when this
 * process ends, because the system then closes the pipe from which the server reads. */
bool web_start(const char *script, const void *data, size_t size);
void web_stop(void);
/* Returns "http://127.0.0.1:PORT/FAULT/N", with another N for each call. The string is valid until
 * the next call. */
const char *web_url(const char *fault);

#endif
