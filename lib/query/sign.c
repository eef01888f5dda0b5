#include "core/strict_fp.h"

#include "query/query_model.h"

#include "query/inside.h"
#include "query/limited.h"

ebpo_status ebpo_give_sign(ebpo_context *c, const double p[3], const ebpo_distance_options *o,
                           ebpo_distance_result *out, ebpo_error *error)
{
    ebpo_inside_result where;
    ebpo_inside_options plain = EBPO_INSIDE_OPTIONS_INIT;
    if (!c->model->info->solid || o->unsigned_distance || out->face == EBPO_NO_FACE)
        return EBPO_OK;
    ebpo_status status = c->model->whole ? ebpo_inside_whole(c, p, 1, &where, error)
                                         : ebpo_inside_walk(c, p, &plain, &where, error);
    if (status == EBPO_OK && where.where == EBPO_IN)
        out->distance = -out->distance;
    return status;
}
