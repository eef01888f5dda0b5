/* Inside an ebpo_view_stream. */
#ifndef EBPO_STREAM_VIEW_H
#define EBPO_STREAM_VIEW_H

#include <ebpo/view.h>

#include "stream/frontier.h"
#include "stream/grown.h"
#include "stream/observer.h"

struct ebpo_view_stream {
    ebpo_file *file;
    const ebpo_info *info;
    ebpo_box box;
    ebpo_view_options options; /* observer: NULL, or `observer` below */
    ebpo_observer observer;
    ebpo_sight sight;
    ebpo_chunks *chunks;
    ebpo_grown grown;
    ebpo_frontier frontier; /* gray nodes of the cut, but for `parent` */
    /* Siblings that are being delivered: the last group of `grown`. */
    bool delivering;
    ebpo_waiting parent; /* not of the root's group */
    unsigned step, flip; /* the next one is octant step ^ flip */
    uint64_t delivered, cut[4];
    ebpo_group read;
    ebpo_walk_envelopes *envelopes; /* with polygons */
    ebpo_node_room room;
};

/* All about a node of `grown`; `complete` is left to the caller. */
void ebpo_view_fill(ebpo_view_stream *stream, ebpo_grown_node node, ebpo_view_node *out);

#endif
