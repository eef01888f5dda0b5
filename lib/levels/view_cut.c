/* What of a view has been delivered: faces of a leaf, the cut, and figures. */
#include <math.h>

#include "core/fp_env.h"
#include "core/error.h"
#include "levels/view_stream.h"

typedef struct visitor {
    ebpo_view_stream *stream;
    ebpo_view_visit_fn visit;
    void *user;
    ebpo_view_node node;
} visitor;

/* False: enough. */
static bool visit_node(visitor *v, ebpo_partial_node node)
{
    const ebpo_partial *partial = &v->stream->partial;
    uint32_t below = partial->group[node.group].child[node.octant];
    if (below == 0) {
        ebpo_view_fill(v->stream, node, &v->node);
        v->node.complete = true;
        return v->visit(v->user, &v->node);
    }
    unsigned flip =
        ebpo_viewpoint_octant(&v->stream->viewpoint, &v->stream->box,
                              ebpo_cell_of_octcode(ebpo_partial_octcode(partial, node)));
    for (unsigned step = 0; step < 8; step++)
        if (!visit_node(v, (ebpo_partial_node){ below, (uint8_t)(step ^ flip) }))
            return false;
    return true;
}

void ebpo_view_stream_cut(ebpo_view_stream *s, ebpo_view_visit_fn visit, void *user)
{
    EBPO_DEFAULT_FP;
    visitor v = { .stream = s, .visit = visit, .user = user };
    if (s->delivered)
        (void)visit_node(&v, (ebpo_partial_node){ 0, 0 });
}

static void count_node(const ebpo_view_stream *s, const ebpo_waiting *w, ebpo_view_stats *out)
{
    ebpo_cell cell = ebpo_cell_of_octcode(w->octcode);
    ebpo_seen look = ebpo_viewpoint_see(&s->viewpoint, &s->box, cell);
    if (look.seen)
        out->pixels =
            fmax(out->pixels, ebpo_viewpoint_pixels(&s->viewpoint, cell.level, look.distance2));
    out->waiting += w->turn != EBPO_TURN_NEVER;
}

ebpo_status ebpo_view_stream_get_stats(const ebpo_view_stream *s, ebpo_view_stats *out)
{
    ebpo_file_stats file = EBPO_FILE_STATS_INIT;
    ebpo_view_stats stats = EBPO_VIEW_STATS_INIT;
    stats.nodes = s->delivered;
    stats.pixels = s->viewpoint.given ? 0 : NAN;
    ebpo_file_get_stats(s->file, &file);
    stats.bytes_read = file.bytes_read;
    for (int i = 0; i < 4; i++)
        stats.cut[i] = s->cut[i];
    for (uint64_t i = 0; i < s->frontier.count; i++)
        count_node(s, &s->frontier.at[i], &stats);
    if (s->delivering && s->partial.group_count > 1)
        count_node(s, &s->parent, &stats);
    return EBPO_GIVE(ebpo_view_stats, out, &stats);
}

ebpo_status ebpo_view_stream_get_faces(const ebpo_view_stream *stream, ebpo_view_faces *out)
{
    static const ebpo_view_faces none = EBPO_VIEW_FACES_INIT;
    return EBPO_GIVE(ebpo_view_faces, out, stream->leaves ? &stream->leaves->now : &none);
}
