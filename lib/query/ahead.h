/* Loading ahead. */
#ifndef EBPO_QUERY_AHEAD_H
#define EBPO_QUERY_AHEAD_H

#include "query/model.h"

/* Asks for the subtrees around p, the nearest first, when p has moved on by about a quarter of a subtree's cell. Models with a cache only. */
void ebpo_context_look_ahead(ebpo_context *context, const double p[3]);

/* True when the model's options ask for it. */
static inline bool ebpo_looks_ahead(const ebpo_model *m)
{
    return m->options.prefetch && !m->whole && m->options.loading == EBPO_LOAD_CACHE;
}

#endif
