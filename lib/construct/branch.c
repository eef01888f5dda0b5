
#include "construct/branch.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "construct/piece_levels.h"
#include "construct/proposals.h"

bool ebpo_branch_detail(const ebpo_builder *b, ebpo_branch *s, uint32_t *index)
{
    if (!ebpo_array_grow_late(b->workspace, &s->details, &s->detail_capacity, s->detail_count + 1,
                              sizeof *s->details))
        return false;
    memset(&s->details[s->detail_count], 0, sizeof s->details[0]);
    *index = (uint32_t)s->detail_count++;
    return true;
}

bool ebpo_branch_children(const ebpo_builder *b, ebpo_branch *s, uint32_t *first)
{
    if (!ebpo_array_grow_late(b->workspace, &s->nodes, &s->node_capacity, s->node_count + 8,
                              sizeof *s->nodes))
        return false;
    *first = (uint32_t)s->node_count;
    memset(&s->nodes[s->node_count], 0, 8 * sizeof s->nodes[0]);
    s->node_count += 8;
    return true;
}

ebpo_status ebpo_build_check_branch(const ebpo_branch *s, ebpo_error *error)
{
    if (s->node_count <= UINT32_MAX - 8 && s->detail_count < UINT32_MAX)
        return EBPO_OK;
    return ebpo_fail(
        error, EBPO_E_LIMIT,
        "more than 2^32 nodes in one piece of the tree: lower --max-level or raise --leaf-faces");
}

void ebpo_branch_forget(ebpo_branch *s)
{
    ebpo_array_free(s->workspace, s->nodes);
    ebpo_array_free(s->workspace, s->details);
    ebpo_array_free(s->workspace, s->entries);
    ebpo_array_free(s->workspace, s->crossing);
    s->nodes = NULL;
    s->details = NULL;
    s->entries = s->crossing = NULL;
    s->node_count = s->node_capacity = s->detail_count = s->detail_capacity = 0;
    s->entry_count = s->entry_capacity = s->cross_count = s->cross_capacity = 0;
}

void ebpo_branch_release(ebpo_branch *s)
{
    ebpo_branch_forget(s);
    ebpo_array_free(s->workspace, s->list);
    free(s->fresh);
    ebpo_array_free(s->workspace, s->above);
    ebpo_proposals_free(s->proposals);
    s->proposals = NULL;
    s->list = NULL;
    s->fresh = NULL;
    s->above = NULL;
}

void ebpo_branch_free(ebpo_branch *s)
{
    ebpo_branch_release(s);
    ebpo_piece_levels_free(s->out);
    memset(s, 0, sizeof *s);
}
