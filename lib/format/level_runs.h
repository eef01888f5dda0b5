/* What runs of nodes have in a level's arrays: all that the table of arrays lists, read through a
 * cache of chunks and checked. */
#ifndef EBPO_FORMAT_LEVEL_RUNS_H
#define EBPO_FORMAT_LEVEL_RUNS_H

#include "core/alloc.h"
#include "format/chunks.h"

/* Groups [group, group + groups) of a level; level 0 has group 0. Its nodes by type: those of type
 * k are [rank[k], rank[k] + count[k]). */
typedef struct ebpo_run {
    uint64_t group, groups;
    uint64_t rank[4], count[4];
} ebpo_run;

/* Collects what ebpo_runs_read begins with, for sources far away. */
void ebpo_runs_expect(ebpo_chunks *chunks, ebpo_expected *expected, int level, const ebpo_run *runs,
                      uint64_t run_count, uint32_t needs);

/* Arrays of the nodes of ascending runs, one behind the other, and their counts into `out`, which
 * has the types already. Those that are there for any of `needs`; faces have the numbers of the
 * file. What they take is taken of `room` (NULL: no limit) first. */
EBPO_MUST_USE ebpo_status ebpo_runs_read(ebpo_chunks *chunks, int level, const ebpo_run *runs,
                                         uint64_t run_count, uint32_t needs, ebpo_room *room,
                                         ebpo_level *out, ebpo_error *error);

#endif
