#include "format/pick.h"

#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "format/chunks.h"
#include "format/subtree_index.h"
#include "geometry/node_types.h"

typedef struct picking {
    ebpo_chunks *chunks;
    int level;
    ebpo_run *run;
    uint64_t run_count;
    ebpo_level *out;
    ebpo_error *error;
} picking;

static void expect_types(const picking *p)
{
    ebpo_expected e = EBPO_EXPECTED_INIT(p->chunks->file);
    for (uint64_t i = 0; i < p->run_count; i++) {
        uint64_t index = p->run[i].group / EBPO_INDEX_ROWS, counted = index * EBPO_INDEX_ROWS;
        if (ebpo_subtree_table_has(p->chunks->file, p->level))
            counted = p->run[i].group;
        else
            ebpo_chunks_expect(p->chunks, &e, EBPO_A_TYPES_INDEX, p->level, index, 1);
        ebpo_chunks_expect(p->chunks, &e, EBPO_A_TYPES, p->level, counted,
                           p->run[i].group + p->run[i].groups - counted);
    }
    ebpo_expect_all(&e);
}

/* Types, and which nodes they make each run have. */
static ebpo_status pick_types(const picking *p)
{
    uint64_t at = 0;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < p->run_count; i++)
        p->out->group_count += p->run[i].groups;
    p->out->types = ebpo_alloc(p->out->group_count, sizeof *p->out->types);
    if (!p->out->types)
        return ebpo_fail_memory(p->error, p->out->group_count * sizeof *p->out->types);
    expect_types(p);
    for (uint64_t i = 0; i < p->run_count && status == EBPO_OK; at += p->run[i++].groups) {
        ebpo_run *r = &p->run[i];
        uint16_t *types = p->out->types + at;
        status = ebpo_ranks_before(p->chunks, p->level, r->group, r->rank, p->error);
        if (status == EBPO_OK)
            status = ebpo_chunks_integers(p->chunks, EBPO_A_TYPES, p->level, r->group, r->groups,
                                          types, sizeof *types, p->error);
        if (status != EBPO_OK)
            break;
        ebpo_groups_count_at(p->level, types, r->groups, r->count);
        status = ebpo_ranks_check(p->chunks, p->level, r->rank, r->count, p->error);
    }
    return status;
}

ebpo_status ebpo_pick_level(ebpo_chunks *chunks, int level, ebpo_run *runs, uint64_t run_count,
                            uint32_t parts, ebpo_level *out, ebpo_error *error)
{
    picking p = { chunks, level, runs, run_count, out, error };
    uint32_t needs = parts | EBPO_NEEDS_SOLID | EBPO_NEEDS_ALWAYS;
    memset(out, 0, sizeof *out);
    ebpo_status status = pick_types(&p);
    if (status == EBPO_OK) {
        ebpo_expected e = EBPO_EXPECTED_INIT(chunks->file);
        ebpo_runs_expect(chunks, &e, level, runs, run_count, needs);
        ebpo_expect_all(&e);
        status = ebpo_runs_read(chunks, level, runs, run_count, needs, NULL, out, error);
    }
    if (status != EBPO_OK)
        ebpo_level_free(out);
    return status;
}
