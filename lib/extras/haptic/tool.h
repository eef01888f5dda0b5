/* A tool: points that move together, its contacts, rigid motions, and passive forces. For each
 * point a distance is known for which it meets no face; only points beyond it are examined. */
#ifndef EBPO_HAPTIC_TOOL_H
#define EBPO_HAPTIC_TOOL_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "extras/haptic/face_box.h"
#include "geometry/vec3.h"

typedef struct ebpo_passive {
    double stiffness, given, step_most;
} ebpo_passive;

/* The hand has moved against the force of the last tick. */
void ebpo_passive_moved(ebpo_passive *p, const double *force, const double *moved, int n);

/* The force of a spring from the hand along `depth` to the proxy, less `damping` times `moved`, and
 * never against `depth`. */
void ebpo_passive_push(const ebpo_passive *p, double damping, const double *depth,
                       const double *moved, int n, double *force);

/* Rigid motions, of which a tool's turning is measured in lengths: angles
 * times the tool's arm. */

typedef struct ebpo_rigid {
    double place[3], turn[4]; /* a unit quaternion x, y, z, w */
} ebpo_rigid;

enum { EBPO_SCREW = 6 }; /* a way, and a rotation vector times the arm */

/* False: not finite, or no quaternion at all. */
bool ebpo_rigid_read(const double place[3], const double turn[4], ebpo_rigid *out);

/* The way from a to b, in the axes of the world, by the shorter turn. */
void ebpo_rigid_between(const ebpo_rigid *a, const ebpo_rigid *b, double arm,
                        double out[EBPO_SCREW]);

/* A part of the way further. */
void ebpo_rigid_go(const ebpo_rigid *from, const double way[EBPO_SCREW], double part, double arm,
                   ebpo_rigid *out);

void ebpo_rigid_matrix(const ebpo_rigid *r, double out[3][3]);

static inline void ebpo_rigid_lever(const double matrix[3][3], const double p[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = ebpo_vec3_dot(matrix[i], p);
}

static inline double ebpo_screw_dot(const double a[EBPO_SCREW], const double b[EBPO_SCREW])
{
    return ebpo_vec3_dot(a, b) + ebpo_vec3_dot(a + 3, b + 3);
}

static inline double ebpo_screw_length(const double a[EBPO_SCREW])
{
    return sqrt(ebpo_screw_dot(a, a));
}

/* A tool's way, held back by what its points touch: the nearest one to the way it wants, that takes
 * no point closer to a face than it may. */

enum { EBPO_CONTACTS_MOST = 256 };

typedef struct ebpo_tool_contact {
    double grip[EBPO_SCREW]; /* grip . way: how far the point comes away from the face */
    double room;             /* so far it may come closer; below 0: it shall come away */
    double gap;
    uint64_t point, face; /* as callers know them */
    double normal[3];
} ebpo_tool_contact;

typedef struct ebpo_tool_contacts {
    ebpo_tool_contact at[EBPO_CONTACTS_MOST]; /* a heap: the largest gap first */
    int count;
} ebpo_tool_contacts;

/* Adds one; when there is no place, instead of the one that has the largest gap. */
void ebpo_tool_contact_add(ebpo_tool_contacts *all, const ebpo_tool_contact *contact);

/* `out`: for all contacts grip . out >= -room, to `close` and as far as bounded work finds it;
 * without `release` none is asked to come away. Returns how many contacts hold. */
int ebpo_tool_hold(const ebpo_tool_contacts *all, const double want[EBPO_SCREW], double close,
                   bool release, double out[EBPO_SCREW]);

/* A tool, which is points that are moved together. Of each it is known
 * how far it may go before it could meet a face; only of those that may is more found out. */

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
