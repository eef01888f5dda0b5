/* A misbehaving web server for a test program: tests/support/faulty_server.py. It is started once,
 * and always ends with the program. */
#ifndef EBPO_TESTS_WEB_H
#define EBPO_TESTS_WEB_H

/* Serves these bytes as a file; returns false if Python is not available. The server ends when this
 * process ends, because the system then closes the pipe from which the server reads. */
#include <stdbool.h>
#include <stddef.h>

bool web_start(const char *script, const void *data, size_t size);
void web_stop(void);
/* Returns "http://127.0.0.1:PORT/FAULT/N", with another N for each call. Static memory, valid until
 * the next call. */
const char *web_url(const char *fault);

#endif
