/* Prints an estimate of a model's memory use for a budget (ebpo_model_memory). */
#ifndef EBPO_TOOLS_MEMORY_FACTS_H
#define EBPO_TOOLS_MEMORY_FACTS_H

#include <ebpo/query.h>
#include <stdio.h>

#include "cli/json.h"

void memory_facts(FILE *out, const ebpo_model_plan *plan);
void memory_facts_json(json *j, const char *key, const ebpo_model_plan *plan);

#endif
