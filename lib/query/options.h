/* Checks that all questions begin with. */
#ifndef EBPO_QUERY_OPTIONS_H
#define EBPO_QUERY_OPTIONS_H

#include "query/query_model.h"

EBPO_MUST_USE ebpo_status ebpo_check_options(const ebpo_query_options *options, ebpo_error *error);
/* EBPO_E_ABSENT when the file has no mesh. */
EBPO_MUST_USE ebpo_status ebpo_check_mesh(const ebpo_model *model, ebpo_error *error);
/* EBPO_E_NOT_SOLID for a surface. */
EBPO_MUST_USE ebpo_status ebpo_check_solid(const ebpo_model *model, ebpo_error *error);

#endif
