/* Queries of every kind, numbered: each gives a hash of its result. The same number gives the same
 * hash on any thread, and with any part of the model in memory. */
#ifndef EBPO_TESTS_QUERY_MIX_H
#define EBPO_TESTS_QUERY_MIX_H

#include "ebpo_config.h"

#include <ebpo/query.h>

/* Data of one thread that runs queries: its context and the file. */
typedef struct mix_session {
    const ebpo_file *file;
    ebpo_model *model;
    ebpo_context *context;
} mix_session;

enum { MIX_KINDS = EBPO_HAVE_EXTRAS ? 16 : 15 };
extern const char *const mix_names[MIX_KINDS];

/* Returns true when the library also reads in threads of its own for this kind of query. */
bool mix_has_workers(int kind);

/* Runs query `number` of a kind. *hash is 0 for queries without a fixed result (haptic devices,
 * counts). */
ebpo_status mix_query(const mix_session *session, int kind, uint64_t number, uint64_t *hash,
                      ebpo_error *error);

#endif
