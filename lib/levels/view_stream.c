/* One group of siblings after the other, chosen from the gray nodes of the cut. */
#include "levels/view_stream.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "levels/view_fetch.h"

enum { MEMORY_LEAST = 1 << 20 };

/* --- options --- */

static ebpo_status check_options(const ebpo_view_options *o, ebpo_error *error)
{
    if (o->priority < EBPO_PRIORITY_LEVEL || o->priority > EBPO_PRIORITY_FRONT_TO_BACK)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "view options: there is no priority number %d",
                         (int)o->priority);
    if (o->unseen != EBPO_UNSEEN_LAST && o->unseen != EBPO_UNSEEN_NEVER)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "view options: there is no rule number %d for what is unseen",
                         (int)o->unseen);
    if (!(o->pixels >= 0) || !(o->distance >= 0) || isinf(o->pixels))
        return ebpo_fail(
            error, EBPO_E_ARGUMENT,
            "view options: pixels must be a finite number and distance a number, both at least 0");
    if (o->memory &&
        o->memory < MEMORY_LEAST) /* less than one group's chunks and their neighbours': every group
                                     would read all of them again */
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "view options: memory must be at least %d bytes, or 0", MEMORY_LEAST);
    if (!o->observer &&
        (o->priority != EBPO_PRIORITY_LEVEL || o->pixels > 0 || !isinf(o->distance)))
        return ebpo_fail(
            error, EBPO_E_ARGUMENT,
            "view options: pixels, distance and all priorities but the level's need an observer");
    return EBPO_OK;
}

static ebpo_status take_options(ebpo_view_stream *s, const ebpo_view_options *options,
                                ebpo_error *error)
{
    ebpo_viewpoint viewpoint;
    ebpo_observer observer = EBPO_OBSERVER_INIT;
    ebpo_status status = check_options(options, error);
    if (status == EBPO_OK)
        status = EBPO_TAKE(ebpo_observer, &observer, options->observer, error);
    if (status == EBPO_OK)
        status =
            ebpo_viewpoint_make(&viewpoint, &s->box, options->observer ? &observer : NULL, error);
    if (status != EBPO_OK)
        return status;
    s->observer = observer;
    s->viewpoint = viewpoint;
    s->options = *options;
    s->options.observer = options->observer ? &s->observer : NULL;
    return EBPO_OK;
}

ebpo_status ebpo_view_stream_new(const ebpo_file *file, const ebpo_view_options *options,
                                 ebpo_view_stream **out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_view_options wanted = EBPO_VIEW_OPTIONS_INIT;
    *out = NULL;
    ebpo_status status = EBPO_TAKE(ebpo_view_options, &wanted, options, error);
    if (status != EBPO_OK)
        return status;
    ebpo_view_stream *s = ebpo_alloc_zero(1, sizeof *s);
    if (!s)
        return ebpo_fail_memory(error, sizeof *s);
    s->file = file;
    s->info = ebpo_file_info(file);
    s->box = ebpo_root_box(s->info);
    status = take_options(s, &wanted, error);
    if (status == EBPO_OK)
        status = ebpo_chunks_make_counted(&s->chunks, file, s->options.memory, error);
    s->partial.windings = s->options.windings;
    if (status == EBPO_OK && s->options.faces)
        status = ebpo_view_leaves_new(&s->leaves, file, error);
    if (status == EBPO_OK && s->options.polygons &&
        !(s->envelopes = ebpo_alloc_zero(1, sizeof *s->envelopes)))
        status = ebpo_fail_memory(error, sizeof *s->envelopes);
    if (status == EBPO_OK)
        *out = s;
    else
        ebpo_view_stream_free(s);
    return status;
}

void ebpo_view_stream_free(ebpo_view_stream *s)
{
    if (!s)
        return;
    ebpo_chunks_free(s->chunks);
    ebpo_partial_free(&s->partial);
    ebpo_frontier_free(&s->frontier);
    ebpo_view_leaves_free(s->leaves);
    free(s->envelopes);
    free(s);
}

/* --- what comes next --- */

static ebpo_turn turn_of(const ebpo_view_stream *s, int level, ebpo_seen look)
{
    const ebpo_view_options *o = &s->options;
    if ((o->level >= 0 && level >= o->level) ||
        (o->pixels > 0 &&
         ebpo_viewpoint_pixels(&s->viewpoint, level, look.distance2) <= o->pixels) ||
        (!isinf(o->distance) &&
         ebpo_viewpoint_distance(&s->viewpoint, look.distance2) > o->distance))
        return EBPO_TURN_NEVER;
    if (look.seen)
        return EBPO_TURN_SEEN;
    return o->unseen == EBPO_UNSEEN_NEVER ? EBPO_TURN_NEVER : EBPO_TURN_UNSEEN;
}

static void rank(const ebpo_view_stream *s, ebpo_waiting *w)
{
    ebpo_seen look = ebpo_viewpoint_see(&s->viewpoint, &s->box, ebpo_cell_of_octcode(w->octcode));
    w->key =
        ebpo_viewpoint_key(&s->viewpoint, &s->box, s->options.priority, w->octcode, look.distance2);
    w->turn = (uint8_t)turn_of(s, ebpo_octcode_level(w->octcode), look);
}

ebpo_status ebpo_view_stream_change(ebpo_view_stream *s, const ebpo_view_options *options,
                                    ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    const ebpo_view_options *now = &s->options;
    ebpo_view_options wanted = EBPO_VIEW_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_view_options, &wanted, options, error);
    if (status != EBPO_OK)
        return status;
    if (wanted.planes != now->planes || wanted.polygons != now->polygons ||
        wanted.windings != now->windings || wanted.memory != now->memory ||
        wanted.faces != now->faces)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "view options: planes, polygons, windings, memory and faces cannot be "
                         "changed; make another stream");
    status = take_options(s, &wanted, error);
    if (status != EBPO_OK)
        return status;
    for (uint64_t i = 0; i < s->frontier.count; i++)
        rank(s, &s->frontier.at[i]);
    ebpo_frontier_sort(&s->frontier);
    return EBPO_OK;
}

static ebpo_status read_now(ebpo_view_stream *s, const ebpo_view_group *group, unsigned wanted,
                            ebpo_error *error)
{
    ebpo_status status = ebpo_group_read(s->chunks, group->number.level, group->number.group,
                                         wanted, &s->read, error);
    return status == EBPO_OK && s->leaves
               ? ebpo_view_leaves_read(s->leaves, s->chunks, group, &s->read, error)
               : status;
}

/* Of a file far away, from memory alone; false: there is more to it. */
static bool read_at_once(ebpo_view_stream *s, const ebpo_view_group *group, unsigned wanted)
{
    ebpo_chunk_keys missing;
    ebpo_chunk_keys_begin(&missing);
    ebpo_chunks_collect(s->chunks, &missing);
    ebpo_status status = read_now(s, group, wanted, NULL);
    ebpo_chunks_collect(s->chunks, NULL);
    return status == EBPO_OK && missing.count == 0;
}

/* A view that ends with a number of bytes or nodes comes to an unknown depth: what is this much
 * deeper than the next node, or smaller, is not announced before its turn is near. */
enum { SOON_LEVELS = 2 };

static void set_soon(ebpo_view_stream *s, uint64_t next)
{
    int level = ebpo_octcode_level(next);
    ebpo_seen look = ebpo_viewpoint_see(&s->viewpoint, &s->box, ebpo_cell_of_octcode(next));
    bool ends = s->options.bytes || s->options.nodes;
    s->soon_level =
        ends && s->options.priority == EBPO_PRIORITY_LEVEL ? level + SOON_LEVELS : EBPO_LEVELS_MAX;
    s->soon_pixels =
        ends && s->options.priority == EBPO_PRIORITY_PIXELS
            ? ldexp(ebpo_viewpoint_pixels(&s->viewpoint, level, look.distance2), -SOON_LEVELS)
            : 0;
}

static bool is_late(const ebpo_view_stream *s, int level, ebpo_seen look)
{
    return level > s->soon_level ||
           (s->soon_pixels > 0 &&
            ebpo_viewpoint_pixels(&s->viewpoint, level, look.distance2) < s->soon_pixels);
}

/* The first level at which nothing below the node is refined any more, or not soon, seen from where
 * it is nearest. */
static int depth_below(const void *user, uint64_t octcode)
{
    const ebpo_view_stream *s = user;
    ebpo_seen look = ebpo_viewpoint_see(&s->viewpoint, &s->box, ebpo_cell_of_octcode(octcode));
    int level = ebpo_octcode_level(octcode);
    while (level < s->info->level_count && turn_of(s, level, look) != EBPO_TURN_NEVER &&
           !is_late(s, level, look))
        level++;
    return level;
}

/* Into s->read, and with faces those of its leaves. */
static ebpo_status read_group(ebpo_view_stream *s, const ebpo_view_group *group, ebpo_error *error)
{
    unsigned wanted = (s->options.planes || s->options.polygons ? EBPO_GROUP_PLANES : 0u) |
                      (s->options.windings ? EBPO_GROUP_WINDINGS : 0u);
    ebpo_status status = EBPO_OK;
    ebpo_chunks_limit(s->chunks, s->options.bytes ? s->options.bytes : UINT64_MAX);
    ebpo_view_depth depth = { depth_below, s };
    if (ebpo_input_expects(&s->chunks->file->in)) {
        if (read_at_once(s, group, wanted))
            return EBPO_OK;
        set_soon(s, group->parent ? group->parent : 1);
        status = ebpo_view_fetch(s->chunks, &s->partial, &s->frontier, group, wanted,
                                 s->leaves != NULL, &depth, error);
    }
    return status == EBPO_OK ? read_now(s, group, wanted, error) : status;
}

/* Begins with the children of the top of the frontier, or with the root. Of a pruned node there are
 * none: it stays in the cut, and the call is to be made again. */
static ebpo_status begin_group(ebpo_view_stream *s, ebpo_view_end *end, ebpo_error *error)
{
    bool root = s->partial.group_count == 0;
    ebpo_view_group group = { { 0, 0 }, 0 };
    if (!root && (s->frontier.count == 0 || s->frontier.at[0].turn == EBPO_TURN_NEVER)) {
        *end = EBPO_VIEW_DONE;
        return EBPO_OK;
    }
    if (s->options.nodes &&
        (root ? 1 : 8) > s->options.nodes -
                             (s->delivered < s->options.nodes ? s->delivered : s->options.nodes)) {
        *end = EBPO_VIEW_NODES;
        return EBPO_OK;
    }
    if (!root)
        group = ebpo_view_children(&s->frontier.at[0]);
    ebpo_error why = EBPO_ERROR_INIT;
    ebpo_status status = read_group(s, &group, &why);
    if (status == EBPO_E_LIMIT && ebpo_chunks_refused(s->chunks)) {
        *end = EBPO_VIEW_BYTES;
        return EBPO_OK;
    }
    if (status == EBPO_OK && !root && s->info->pruned && s->read.types == 0) {
        (void)ebpo_frontier_pop(&s->frontier);
        return EBPO_OK;
    }
    if (status == EBPO_OK)
        status = ebpo_frontier_reserve(&s->frontier, 8, &why);
    if (status == EBPO_OK)
        status = ebpo_partial_add(&s->partial, s->info, root ? 0 : s->frontier.at[0].octcode,
                                  &s->read, &why);
    if (status != EBPO_OK) {
        if (error)
            *error = why;
        return status;
    }
    s->flip = 0;
    if (!root) {
        s->parent = ebpo_frontier_pop(&s->frontier);
        if (s->options.priority == EBPO_PRIORITY_FRONT_TO_BACK)
            s->flip = ebpo_viewpoint_octant(&s->viewpoint, &s->box,
                                            ebpo_cell_of_octcode(s->parent.octcode));
    }
    s->step = 0;
    s->delivering = true;
    return EBPO_OK;
}

/* All siblings are there: they replace their parent. */
static void end_group(ebpo_view_stream *s)
{
    uint32_t group = (uint32_t)(s->partial.group_count - 1);
    if (group) {
        s->partial.group[s->parent.group].child[s->parent.octant] = group;
        s->cut[EBPO_GRAY]--;
    }
    for (unsigned octant = 0; octant < (group ? 8u : 1u); octant++) {
        ebpo_partial_node node = { group, (uint8_t)octant };
        ebpo_node_type type = ebpo_partial_type(&s->partial, node);
        s->cut[type]++;
        if (type == EBPO_GRAY && ebpo_octcode_level(ebpo_partial_octcode(&s->partial, node)) + 1 <
                                     s->info->level_count) { /* else pruned */
            ebpo_waiting w = { .octcode = ebpo_partial_octcode(&s->partial, node),
                               .below = ebpo_partial_children(&s->partial, node),
                               .group = group,
                               .octant = (uint8_t)octant };
            rank(s, &w);
            ebpo_frontier_push(&s->frontier, w);
        }
    }
    s->delivering = false;
}

/* --- nodes --- */

void ebpo_view_fill(ebpo_view_stream *s, ebpo_partial_node node, ebpo_view_node *out)
{
    ebpo_node_type type = ebpo_partial_type(&s->partial, node);
    memset(out, 0, sizeof *out);
    ebpo_node_begin(&out->node, &s->box, ebpo_partial_octcode(&s->partial, node), type);
    ebpo_cell cell = ebpo_cell_of_octcode(out->node.octcode);
    ebpo_seen look = ebpo_viewpoint_see(&s->viewpoint, &s->box, cell);
    out->level = cell.level;
    out->seen = look.seen;
    out->distance = ebpo_viewpoint_distance(&s->viewpoint, look.distance2);
    out->pixels = ebpo_viewpoint_pixels(&s->viewpoint, cell.level, look.distance2);
    if (s->partial.windings)
        out->node.winding = s->partial.winding[node.group][node.octant];
    if (s->options.planes || s->options.polygons) {
        unsigned count;
        const uint32_t *codes = ebpo_partial_codes(&s->partial, node, &count);
        ebpo_node_add_planes(&out->node, &s->box, codes, count, &s->capacity);
    }
    if (s->options.polygons && type != EBPO_WHITE)
        ebpo_node_add_polygons(&out->node, &s->box,
                               ebpo_partial_envelope(&s->partial, node, s->envelopes),
                               &s->capacity);
}

ebpo_status ebpo_view_stream_next(ebpo_view_stream *s, ebpo_view_node *out, ebpo_view_end *end,
                                  ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    *end = EBPO_VIEW_NODE;
    if (s->leaves)
        ebpo_view_leaves_give_none(s->leaves);
    while (!s->delivering) {
        ebpo_status status = begin_group(s, end, error);
        if (status != EBPO_OK || *end != EBPO_VIEW_NODE)
            return status;
    }
    uint32_t group = (uint32_t)(s->partial.group_count - 1);
    unsigned octant = s->step++ ^ s->flip;
    ebpo_view_fill(s, (ebpo_partial_node){ group, (uint8_t)octant }, out);
    if (s->leaves)
        ebpo_view_leaves_give(s->leaves, octant);
    s->delivered++;
    out->complete = s->step == (group ? 8 : 1);
    if (out->complete)
        end_group(s);
    return EBPO_OK;
}
