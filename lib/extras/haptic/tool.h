/* Inside lib/extras/haptic: a tool, which is points that are moved together. Of each it is known
 * how far it may go before it could meet a face; only of those that may is more found out. */
#ifndef EBPO_HAPTIC_TOOL_H
#define EBPO_HAPTIC_TOOL_H

#include "extras/haptic/face_box.h"
#include "extras/haptic/rigid.h"
#include "extras/haptic/tool_hold.h"

enum {
    EBPO_TOOL_POINTS = 10000,
    EBPO_TOOL_CLUSTER = 8,
    EBPO_TOOL_PIECES = 6,     /* of way in a tick */
    EBPO_TOOL_POOL = 1 << 16, /* faces around points, all in all */
    EBPO_TOOL_NEAR = 64,      /* around one */
    EBPO_TOOL_WORK = 4000     /* of a tick: nodes looked at, and six for each face */
};

typedef struct ebpo_tool_cluster {
    uint32_t first, count; /* points */
    double middle[3], radius;
    double gone; /* no point of it has gone farther, in sum of all steps */
    double free; /* until `gone` is so much, no point meets a face */
} ebpo_tool_cluster;

/* A point that may meet faces in a piece of way, which are pool[first] and on. */
typedef struct ebpo_tool_close {
    uint32_t point, first, count;
} ebpo_tool_close;

typedef enum ebpo_tool_stage {
    EBPO_TOOL_STANDS,
    EBPO_TOOL_LOOKS,
    EBPO_TOOL_CHECKS
} ebpo_tool_stage;

typedef struct ebpo_tool {
    uint64_t count, cluster_count;
    double (*point)[3]; /* in its own coordinates, cluster after cluster */
    uint32_t *number;   /* as the caller has them */
    double *free;       /* [count] as of clusters */
    double radius, arm; /* of all points; root of the mean square of their distances */
    ebpo_tool_cluster *cluster;

    ebpo_rigid proxy, hand;
    ebpo_rigid way_of[EBPO_TOOL_PIECES + 1]; /* of the last tick */
    uint32_t way_count;
    double force[EBPO_SCREW];
    ebpo_tool_contacts contacts, next; /* at the proxy; at the end of the way that is checked */

    /* A piece of way, of which the rest is for the next tick. */
    ebpo_tool_stage stage;
    double way[EBPO_SCREW], part; /* it is free so far */
    ebpo_rigid end;
    double from_matrix[3][3], to_matrix[3][3], end_matrix[3][3];
    uint32_t flags;
    uint64_t at; /* cluster, or close point */
    ebpo_tool_close *close;
    uint64_t close_count;
    uint32_t *pool;
    uint64_t pool_count;
} ebpo_tool;

EBPO_MUST_USE ebpo_status ebpo_tool_new(const double (*points)[3], uint64_t count, ebpo_tool **out,
                                        ebpo_error *error);
void ebpo_tool_free(ebpo_tool *tool);
uint64_t ebpo_tool_bytes(const ebpo_tool *tool);

/* Lifted, and put there: nothing is known any more. */
void ebpo_tool_put(ebpo_tool *tool, const ebpo_rigid *at);

static inline void ebpo_tool_at(const ebpo_rigid *r, const double matrix[3][3], const double p[3],
                                double out[3])
{
    ebpo_rigid_lever(matrix, p, out);
    for (int i = 0; i < 3; i++)
        out[i] += r->place[i];
}

#endif
