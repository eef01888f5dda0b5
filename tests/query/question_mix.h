/* Questions of every kind, numbered: each gives a hash of its answer, the same for the same number
 * whoever asks, with however much of the model in memory. */
#ifndef EBPO_TESTS_QUESTION_MIX_H
#define EBPO_TESTS_QUESTION_MIX_H

#include "ebpo_config.h"

#include <ebpo/query.h>

/* What one thread asks of: its context, and the file behind it. */
typedef struct mix_asker {
    const ebpo_file *file;
    ebpo_model *model;
    ebpo_context *context;
} mix_asker;

enum { MIX_KINDS = EBPO_HAVE_EXTRAS ? 16 : 15 };
extern const char *const mix_names[MIX_KINDS];

/* Whether the library reads for it in threads of its own, too. */
bool mix_has_workers(int kind);

/* Question `number` of a kind. *hash is 0 for what has no answer of its own (a hand, counts). */
ebpo_status mix_ask(const mix_asker *asker, int kind, uint64_t number, uint64_t *hash,
                    ebpo_error *error);

#endif
