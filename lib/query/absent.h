/* Questions that need what a subset has left out. */
#ifndef EBPO_QUERY_ABSENT_H
#define EBPO_QUERY_ABSENT_H

#include "query/query_model.h"

/* EBPO_E_ABSENT: the question needs what was left out below this node. Says which file, where, and
 * what it was cut to. */
ebpo_status ebpo_fail_pruned(const ebpo_model *model, ebpo_cell cell, ebpo_error *error);

#endif
