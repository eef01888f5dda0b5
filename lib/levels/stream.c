/* Levels one after the other. Of a level that has been passed only its types stay, and with
 * polygons its planes: enough to walk down to the nodes of the next one. */
#include "core/strict_fp.h"

#include <ebpo/stream.h>

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "format/reader.h"
#include "geometry/cells.h"
#include "geometry/node_types.h"
#include "levels/stream_node.h"
#include "levels/level_walk.h"

enum { PIECE = 4096 };

struct ebpo_stream {
    const ebpo_file *file;
    const ebpo_info *info;
    ebpo_stream_options options;
    ebpo_box box;
    int level; /* last one read; -1: none */
    ebpo_level kept[EBPO_LEVELS_MAX];
    uint64_t bytes;
    double
        uniform_volume; /* volume of the leaves and black nodes of all levels before the next one */
    ebpo_level_walk walk;
    ebpo_envelope_stack *envelopes; /* with polygons */
    ebpo_node_buffers capacity;
};

ebpo_status ebpo_stream_new(const ebpo_file *file, const ebpo_stream_options *options,
                            ebpo_stream **out, ebpo_error *error)
{
    ebpo_stream_options wanted = EBPO_STREAM_OPTIONS_INIT;
    *out = NULL;
    ebpo_status status = EBPO_TAKE(ebpo_stream_options, &wanted, options, error);
    if (status != EBPO_OK)
        return status;
    ebpo_stream *s = ebpo_alloc_zero(1, sizeof *s);
    if (!s)
        return ebpo_fail_memory(error, sizeof *s);
    s->file = file;
    s->info = ebpo_file_info(file);
    s->options = wanted;
    s->level = -1;
    s->box = ebpo_root_box(s->info);
    s->bytes = s->info->head_bytes;
    if (s->options.polygons && !(s->envelopes = ebpo_alloc_zero(1, sizeof *s->envelopes))) {
        ebpo_stream_free(s);
        return ebpo_fail_memory(error, sizeof *s->envelopes);
    }
    *out = s;
    return EBPO_OK;
}

void ebpo_stream_free(ebpo_stream *s)
{
    if (!s)
        return;
    for (int i = 0; i <= s->level; i++)
        ebpo_level_free(&s->kept[i]);
    free(s->envelopes);
    free(s);
}

/* --- reading a level --- */

static void drop_passed(ebpo_level *level, bool planes)
{
    ebpo_level_drop(level, ~(uint32_t)(EBPO_NEEDS_ALWAYS | EBPO_NEEDS_COLOURS |
                                       (planes ? EBPO_NEEDS_PLANES : 0)));
}

static uint64_t sum_counts(const uint8_t *counts, uint64_t count)
{
    uint64_t sum = 0;
    for (uint64_t i = 0; counts && i < count; i++)
        sum += counts[i];
    return sum;
}

/* What the walk relies on. */
static ebpo_status check_level(const ebpo_level *level, int number, uint64_t parents,
                               ebpo_error *error)
{
    uint64_t count[4];
    if (level->group_count != parents)
        return ebpo_fail(error, EBPO_E_FORMAT,
                         "level %d: %" PRIu64 " groups of siblings, but %" PRIu64
                         " parents; run ebpo verify",
                         number, level->group_count, parents);
    ebpo_groups_count_at(number, level->types, level->group_count, count);
    if (count[EBPO_GRAY] != level->gray_count || count[EBPO_LEAF] != level->leaf_count ||
        count[EBPO_BLACK] != level->black_count || count[EBPO_WHITE] != level->white_count)
        return ebpo_fail(error, EBPO_E_FORMAT,
                         "level %d: its types and its node counts disagree; run ebpo verify",
                         number);
    if (sum_counts(level->plane_counts, level->gray_count) !=
            (level->plane_counts ? level->plane_count : 0) ||
        sum_counts(level->leaf_plane_counts, level->leaf_count) !=
            (level->leaf_plane_counts ? level->leaf_plane_count : 0))
        return ebpo_fail(error, EBPO_E_FORMAT,
                         "level %d: the counts of its planes do not add up; run ebpo verify",
                         number);
    return EBPO_OK;
}

/* --- volumes --- */

typedef struct volumes {
    double gray, uniform_volume;
} volumes;

typedef struct job {
    const ebpo_stream *stream;
    int target;
    ebpo_level_walk *starts;        /* [pieces] */
    volumes *found;                 /* [pieces] */
    ebpo_envelope_stack *envelopes; /* [threads] */
} job;

static ebpo_status sum_pieces(void *context, uint64_t begin, uint64_t end, unsigned worker,
                              ebpo_error *error)
{
    const job *j = context;
    double cell = ebpo_cell_volume(&j->stream->box, j->target);
    (void)error;
    for (uint64_t i = begin; i < end; i++) {
        ebpo_level_walk walk = j->starts[i];
        ebpo_level_walk_node node;
        for (int k = 0; k < PIECE && ebpo_level_walk_next(&walk, &node); k++)
            if (node.type != EBPO_WHITE)
                *(node.type == EBPO_GRAY ? &j->found[i].gray : &j->found[i].uniform_volume) +=
                    ebpo_polytope_volume(
                        ebpo_level_walk_envelope(&walk, &node, &j->envelopes[worker])) *
                    cell;
    }
    return EBPO_OK;
}

/* A first walk, without envelopes, finds where each piece begins; pieces do not depend on the
 * number of threads, so neither does the sum. */
static void find_starts(job *j)
{
    ebpo_level_walk walk;
    ebpo_level_walk_node node;
    ebpo_level_walk_begin(&walk, j->stream->kept, j->target, j->stream->info->pruned);
    uint64_t seen = 0;
    do {
        if (seen % PIECE == 0)
            j->starts[seen / PIECE] = walk;
        seen++;
    } while (ebpo_level_walk_next(&walk, &node));
}

static ebpo_status cut_volumes(const ebpo_stream *s, int target, uint64_t nodes, volumes *out,
                               ebpo_error *error)
{
    unsigned threads = ebpo_thread_count(s->options.threads);
    uint64_t pieces = nodes / PIECE + 1;
    job j = { s, target, ebpo_alloc(pieces, sizeof *j.starts),
              ebpo_alloc_zero(pieces, sizeof *j.found),
              ebpo_alloc_zero(threads, sizeof *j.envelopes) };
    ebpo_status status = EBPO_OK;
    if (!j.starts || !j.found || !j.envelopes) {
        status = ebpo_fail_memory(error, pieces * (sizeof *j.starts + sizeof *j.found) +
                                             threads * sizeof *j.envelopes);
        goto done;
    }
    find_starts(&j);
    status = ebpo_parallel_for(threads, NULL, pieces, 1, sum_pieces, &j, NULL, "cutting envelopes",
                               error);
    for (uint64_t i = 0; i < pieces; i++) {
        out->gray += j.found[i].gray;
        out->uniform_volume += j.found[i].uniform_volume;
    }
done:
    free(j.starts);
    free(j.found);
    free(j.envelopes);
    return status;
}

static volumes stated_volumes(const ebpo_stream *s, int level)
{
    const ebpo_level_summary *summary = &s->info->level[level];
    return (volumes){ summary->gray_volume,
                      summary->leaf_volume +
                          (double)summary->black_count * ebpo_cell_volume(&s->box, level) };
}

/* --- levels --- */

void ebpo_stream_prefetch(const ebpo_stream *s, int last)
{
    ebpo_expected e = EBPO_EXPECTED_INIT(s->file);
    for (int level = s->level + 1; level <= last && level < s->info->level_count; level++)
        ebpo_expect_level(&e, level, EBPO_PART_MESH);
    ebpo_expect_all(&e);
}

ebpo_status ebpo_stream_next_level(ebpo_stream *s, ebpo_stream_level *out, bool *more,
                                   ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    int next = s->level + 1;
    *more = false;
    if (next >= s->info->level_count)
        return EBPO_OK;
    ebpo_level *level = &s->kept[next];
    uint64_t parents = next ? s->kept[next - 1].gray_count : 1;
    ebpo_read_options read = ebpo_read_threads(s->options.threads);
    read.without = EBPO_PART_MESH;
    ebpo_status status = ebpo_file_read_level(s->file, next, &read, level, error);
    if (status != EBPO_OK)
        return status;
    volumes v = stated_volumes(s, next);
    /* the head has been checked: at most all parents */
    uint64_t nodes = next ? 8 * (parents - s->info->level[next - 1].pruned_count) : 1;
    status = check_level(level, next, parents, error);
    if (status == EBPO_OK && s->options.polygons) {
        v = (volumes){ 0, 0 };
        status = cut_volumes(s, next, nodes, &v, error);
    }
    if (status != EBPO_OK) {
        ebpo_level_free(level);
        memset(level, 0, sizeof *level);
        return status;
    }
    if (next)
        drop_passed(&s->kept[next - 1], s->options.polygons);
    s->level = next;
    s->uniform_volume += v.uniform_volume;
    s->bytes += ebpo_reader_level_bytes(s->file, next) +
                (next == s->info->index_level ? s->info->chunk_index_bytes : 0);
    ebpo_level_walk_begin(&s->walk, s->kept, next, s->info->pruned);
    *out = (ebpo_stream_level){ next, nodes, s->bytes, v.gray + s->uniform_volume };
    *more = true;
    return EBPO_OK;
}

/* --- nodes --- */

static int32_t winding_of(const ebpo_level *level, const ebpo_level_walk_node *node)
{
    switch (node->type) {
    case EBPO_WHITE: return level->white_winding ? level->white_winding[node->rank] : 0;
    case EBPO_BLACK: return level->black_winding ? level->black_winding[node->rank] : 1;
    case EBPO_LEAF: return level->leaf_winding ? level->leaf_winding[node->rank] : 0;
    case EBPO_GRAY:
    default: return 0;
    }
}

/* Of a node that is not gray: its parent's, which was passed before it. */
static void add_colour(const ebpo_stream *s, const ebpo_level_walk_node *node,
                       ebpo_stream_node *out)
{
    bool gray = node->type == EBPO_GRAY;
    int level = s->level - !gray;
    const uint32_t *colours = level < 0 ? NULL : s->kept[level].gray_colours;
    out->coloured = colours != NULL;
    if (colours)
        out->colour = colours[gray ? node->rank : s->walk.at[level].node.rank];
}

ebpo_status ebpo_stream_next_node(ebpo_stream *s, ebpo_stream_node *out, bool *more,
                                  ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_level_walk_node node;
    *more = false;
    if (s->level < 0)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "no level has been read yet; call ebpo_stream_next_level first");
    if (!ebpo_level_walk_next(&s->walk, &node))
        return EBPO_OK;
    ebpo_node_begin(out, &s->box, node.octcode, node.type);
    out->winding = winding_of(&s->kept[s->level], &node);
    add_colour(s, &node, out);
    if (s->options.planes || s->options.polygons)
        ebpo_node_add_planes(out, &s->box, node.codes, node.code_count, &s->capacity);
    if (s->options.polygons && node.type != EBPO_WHITE)
        ebpo_node_add_polygons(out, &s->box,
                               ebpo_level_walk_envelope(&s->walk, &node, s->envelopes),
                               &s->capacity);
    *more = true;
    return EBPO_OK;
}
