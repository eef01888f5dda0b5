/* The models of a catalogue that are open, all within one budget: opened when first needed, and
 * closed when there is no room, the one that was asked longest ago first. Any number of threads. */
#ifndef EBPO_TOOLS_HOLDING_H
#define EBPO_TOOLS_HOLDING_H

#include "cli/commands/catalogue.h"
#include "cli/remote_args.h"

/* A model that is held, lent to who asks it. */
typedef struct held_model held_model;
typedef struct held_models held_models;

typedef struct holding_options {
    uint64_t memory;  /* bytes for all of them; 0: as many as they need */
    unsigned threads; /* that open one; 0: all cores */
    const remote_values *remote;
} holding_options;

/* The catalogue must stay. NULL: not enough memory. */
held_models *holding_new(const catalogue *c, const holding_options *options);
/* After the last question. */
void holding_free(held_models *h);

/* Asks with a context of the model that is its thread's. */
typedef ebpo_status (*holding_question)(ebpo_context *context, const held_model *model, void *user,
                                        ebpo_error *error);

/* Asks a model, or what rays and distances see of it, waiting for room. Where its budget does not
 * do for several threads, `ask` is called again, alone. What is opened must be what the catalogue
 * tells: digest, box, how many numbers; else EBPO_E_FORMAT. */
EBPO_MUST_USE ebpo_status holding_ask(held_models *h, uint64_t number, bool surface,
                                      holding_question ask, void *user, ebpo_error *error);

/* A face's number in the whole, where the catalogue tells it; *face may be EBPO_NO_FACE. */
EBPO_MUST_USE ebpo_status held_face(const held_model *model, uint64_t *face, ebpo_error *error);

/* What it took: sums over all models, also those that were closed; `memory` is of those that are
 * open. */
typedef struct holding_counts {
    uint64_t opened, closed;
    ebpo_model_stats sums;
} holding_counts;
void holding_get_counts(held_models *h, holding_counts *out);

#endif
