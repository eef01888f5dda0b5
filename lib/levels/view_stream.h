/* Inside an ebpo_view_stream. */
#ifndef EBPO_LEVELS_VIEW_STREAM_H
#define EBPO_LEVELS_VIEW_STREAM_H

#include <ebpo/view.h>

#include "levels/frontier.h"
#include "levels/partial_tree.h"
#include "levels/observer.h"
#include "levels/view_faces.h"

struct ebpo_view_stream {
    const ebpo_file *file;
    const ebpo_info *info;
    ebpo_box box;
    ebpo_view_options options; /* observer: NULL, or `observer` below */
    ebpo_observer observer;
    ebpo_viewpoint viewpoint;
    ebpo_chunks *chunks;
    ebpo_partial partial;
    ebpo_frontier frontier; /* gray nodes of the cut, but for `parent` */
    /* Siblings that are being delivered: the last group of `grown`. */
    bool delivering;
    ebpo_waiting parent; /* not of the root's group */
    unsigned step, flip; /* the next one is octant step ^ flip */
    uint64_t delivered, cut[4];
    ebpo_group read;
    ebpo_envelope_stack *envelopes; /* with polygons */
    ebpo_node_buffers capacity;
    ebpo_view_leaves *leaves; /* with faces */
    /* what is deeper, or smaller, is not announced yet */
    int soon_level;
    double soon_pixels;
};

/* All about a node of `grown`; `complete` is left to the caller. */
void ebpo_view_fill(ebpo_view_stream *stream, ebpo_partial_node node, ebpo_view_node *out);

#endif
