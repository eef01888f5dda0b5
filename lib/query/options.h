/* Checks that all questions begin with. */
#ifndef EBPO_QUERY_OPTIONS_H
#define EBPO_QUERY_OPTIONS_H

#include "query/query_model.h"

EBPO_MUST_USE ebpo_status ebpo_check_query_level(int level, ebpo_error *error);
/* EBPO_E_ARGUMENT: an option is none of its kind. */
ebpo_status ebpo_fail_value(ebpo_error *error);
/* EBPO_E_ABSENT when the file has no mesh. */
EBPO_MUST_USE ebpo_status ebpo_check_mesh(const ebpo_model *model, ebpo_error *error);
/* EBPO_E_NOT_SOLID for a surface. */
EBPO_MUST_USE ebpo_status ebpo_check_solid(const ebpo_model *model, ebpo_error *error);

#endif
