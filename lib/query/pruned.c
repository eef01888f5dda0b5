#include "core/strict_fp.h"

#include "query/query_node.h"

#include <string.h>

#include "core/error.h"
#include "format/reader.h"

typedef struct checking {
    ebpo_context *context;
    ebpo_matters_fn matters;
    void *user;
    ebpo_box box;
} checking;

static ebpo_status check(const checking *k, ebpo_node node, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    if (ebpo_node_is_uniform(&node) || node.type != EBPO_GRAY ||
        !k->matters(k->user, &k->box, &node))
        return EBPO_OK;
    if (ebpo_node_is_below(&node)) /* fails for pruned ones */
        status = ebpo_model_enter(k->context, &node, error);
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++)
        status = check(k, ebpo_model_child(k->context->model, &node, octant), error);
    return status;
}

ebpo_status ebpo_check_pruned(ebpo_context *context, ebpo_matters_fn matters, void *user,
                              ebpo_error *error)
{
    if (!context->model->info->pruned)
        return EBPO_OK;
    checking k = { context, matters, user, ebpo_model_box(context->model) };
    return check(&k, ebpo_model_root(context->model), error);
}
