/* A tool: points that move together, its contacts, rigid motions, and passive forces. For each
 * point a distance is known within which there is no face. The point is examined only after it has
 * moved farther than this distance. */
#ifndef EBPO_HAPTIC_TOOL_H
#define EBPO_HAPTIC_TOOL_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "extras/haptic/face_box.h"
#include "geometry/vec3.h"

typedef struct ebpo_passive {
    double stiffness, energy, longest_step;
} ebpo_passive;

/* Records that the device has moved against the force of the last haptic step. */
void ebpo_passive_moved(ebpo_passive *p, const double *force, const double *moved, int n);

/* Computes the force of a spring along `depth`, the vector from device to proxy, minus `damping`
 * times `moved`. The force never opposes `depth`. */
void ebpo_passive_push(const ebpo_passive *p, double damping, const double *depth,
                       const double *moved, int n, double *force);

/* Rigid motions. A tool's rotation is measured in lengths: angles times the tool's arm. */

typedef struct ebpo_rigid {
    double place[3], turn[4]; /* a unit quaternion x, y, z, w */
} ebpo_rigid;

enum { EBPO_SCREW = 6 }; /* translation, then rotation vector times the arm */

/* Returns false if values are not finite or the quaternion is invalid. */
bool ebpo_rigid_read(const double place[3], const double turn[4], ebpo_rigid *out);

/* Computes the motion from a to b, in the world's axes, by the shorter rotation. */
void ebpo_rigid_between(const ebpo_rigid *a, const ebpo_rigid *b, double arm,
                        double out[EBPO_SCREW]);

/* Moves by a part of the motion. */
void ebpo_rigid_go(const ebpo_rigid *from, const double motion[EBPO_SCREW], double part, double arm,
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

/* A tool's motion under its contacts: of the motions that take no point closer to a face than
 * allowed, the one nearest to the wanted motion. */

enum { EBPO_CONTACTS_MAX = 256 };

typedef struct ebpo_tool_contact {
    double grip[EBPO_SCREW]; /* grip . motion is how far the point moves away from the face */
    double space;            /* how far the point may come closer to the face; negative: it must
                              * move away */
    double gap;
    uint64_t point, face; /* numbers that callers get */
    double normal[3];
} ebpo_tool_contact;

typedef struct ebpo_tool_contacts {
    ebpo_tool_contact at[EBPO_CONTACTS_MAX]; /* a heap: the contact with the largest gap first */
    int count;
} ebpo_tool_contacts;

/* Adds a contact; when the heap is full, it replaces the contact with the largest gap. */
void ebpo_tool_contact_add(ebpo_tool_contacts *all, const ebpo_tool_contact *contact);

/* Computes `out` with grip . out >= -space for all contacts, with an error of at most `close`, as
 * far as bounded work allows. Without `release`, no contact requires a motion away from its face.
 * Returns the number of contacts that hold the tool. */
int ebpo_tool_hold(const ebpo_tool_contacts *all, const double want[EBPO_SCREW], double close,
                   bool release, double out[EBPO_SCREW]);

/* Limits of a tool. */

enum {
    EBPO_TOOL_POINTS = 10000,
    EBPO_TOOL_CLUSTER = 8,
    EBPO_TOOL_PIECES = 6,     /* pieces of path in each haptic step */
    EBPO_TOOL_POOL = 1 << 16, /* faces around all points in total */
    EBPO_TOOL_NEAR = 64,      /* faces around one point */
    EBPO_TOOL_WORK = 4000     /* for each haptic step: visited nodes, plus six for each face */
};

typedef struct ebpo_tool_cluster {
    uint32_t first, count; /* points of the cluster */
    double middle[3], radius;
    double gone; /* bound of the motion of each of its points, summed over all steps */
    double free; /* until `gone` reaches this, no point hits a face */
} ebpo_tool_cluster;

/* A point that may hit faces in a piece of path; its faces begin at pool[first]. */
typedef struct ebpo_tool_close {
    uint32_t point, first, count;
} ebpo_tool_close;

typedef enum ebpo_tool_stage {
    EBPO_TOOL_STANDS,
    EBPO_TOOL_SEARCHES,
    EBPO_TOOL_CHECKS
} ebpo_tool_stage;

typedef struct ebpo_tool {
    uint64_t count, cluster_count;
    double (*point)[3]; /* in the tool's coordinates, cluster after cluster */
    uint32_t *number;   /* [count] numbers that the caller gets */
    double *free;       /* [count] as for clusters */
    double radius, arm; /* greatest distance of the points from the centre; root of the mean square
                         * of these distances */
    ebpo_tool_cluster *cluster;

    ebpo_rigid proxy, device;
    ebpo_rigid path[EBPO_TOOL_PIECES + 1]; /* positions of the proxy in the last haptic step */
    uint32_t path_count;
    double force[EBPO_SCREW];
    ebpo_tool_contacts contacts,
        next; /* contacts at the proxy, and at the end of the checked path */

    /* The current piece of path; the next haptic step continues it. */
    ebpo_tool_stage stage;
    double motion[EBPO_SCREW], part; /* the piece is free up to this part */
    ebpo_rigid end;
    double from_matrix[3][3], to_matrix[3][3], end_matrix[3][3];
    uint32_t flags;
    uint64_t at; /* number of the next cluster, or of the next close point */
    ebpo_tool_close *close;
    uint64_t close_count;
    uint32_t *pool;
    uint64_t pool_count;
} ebpo_tool;

EBPO_MUST_USE ebpo_status ebpo_tool_new(const double (*points)[3], uint64_t count, ebpo_tool **out,
                                        ebpo_error *error);
void ebpo_tool_free(ebpo_tool *tool);
uint64_t ebpo_tool_bytes(const ebpo_tool *tool);

/* Places the tool without a path: all known distances are discarded. */
void ebpo_tool_put(ebpo_tool *tool, const ebpo_rigid *at);

static inline void ebpo_tool_at(const ebpo_rigid *r, const double matrix[3][3], const double p[3],
                                double out[3])
{
    ebpo_rigid_lever(matrix, p, out);
    for (int i = 0; i < 3; i++)
        out[i] += r->place[i];
}

#endif
