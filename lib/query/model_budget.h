/* What is chosen by a model's budget: from the counts in the file's head. */
#ifndef EBPO_QUERY_MODEL_BUDGET_H
#define EBPO_QUERY_MODEL_BUDGET_H

#include <ebpo/query.h>

#include "query/budget_shares.h"

/* Sets the budget: what is left of one that is shared, or that of a file far away where nobody
 * asked for one; true then. */
bool ebpo_usual_memory(const ebpo_file *file, ebpo_model_options *options);

/* Everything at once, or the cut level. Errors are those of ebpo_model_memory. */
EBPO_MUST_USE ebpo_status ebpo_plan_model(const ebpo_file *file, const ebpo_model_options *options,
                                          bool default_memory, ebpo_model_plan *out,
                                          ebpo_error *error);
/* The cut level for a budget that everything was found to exceed. Only that and `least` are set. */
EBPO_MUST_USE ebpo_status ebpo_plan_parts(const ebpo_file *file, const ebpo_model_options *options,
                                          ebpo_model_plan *out, ebpo_error *error);

#endif
