/* Declares a tool (points that move together), its contacts, rigid motions and passive forces. Each
 * point has a known distance within which there is no face. The point is examined again only after
 * it may have moved by this distance. */
#ifndef EBPO_HAPTIC_TOOL_H
#define EBPO_HAPTIC_TOOL_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "extras/haptic/face_box.h"
#include "geometry/vec3.h"

/* A spring whose forces are passive: in total, the device receives no more energy than it gave,
 * except for the energy of one step (see max_force in tool.c). */
typedef struct ebpo_passive {
    double stiffness;
    double energy;       /* energy that the device has received in total; negative: it gave more */
    double longest_step; /* longest motion of the device in one haptic step */
} ebpo_passive;

/* Records that the device moved by moved[n] while the force[n] of the last haptic step acted. */
void ebpo_passive_moved(ebpo_passive *p, const double *force, const double *moved, int n);

/* Computes the force: stiffness times `depth` (the vector from device to proxy), minus `damping`
 * times `moved`. Limits the force so that it is passive; it never has a component against `depth`.
 * All vectors have n components. */
void ebpo_passive_push(const ebpo_passive *p, double damping, const double *depth,
                       const double *moved, int n, double *force);

/* --- rigid motions; a rotation is measured as a length: its angle times the arm, the root mean
 * square distance of the tool's points from its centre --- */

/* The position of a tool. */
typedef struct ebpo_rigid {
    double place[3];    /* position of the tool's centre */
    double rotation[4]; /* rotation, a unit quaternion x, y, z, w */
} ebpo_rigid;

/* Number of components of a rigid motion: translation, then rotation vector times the arm. */
enum { EBPO_SCREW = 6 };

/* Returns false if values are not finite or the quaternion is invalid. */
bool ebpo_rigid_read(const double place[3], const double rotation[4], ebpo_rigid *out);

/* Computes the motion from a to b, in the world's axes, by the shorter rotation. */
void ebpo_rigid_between(const ebpo_rigid *a, const ebpo_rigid *b, double arm,
                        double out[EBPO_SCREW]);

/* Sets `out` to `from`, moved by a fraction, 0 to 1, of the motion. */
void ebpo_rigid_move(const ebpo_rigid *from, const double motion[EBPO_SCREW], double fraction,
                     double arm, ebpo_rigid *out);

void ebpo_rigid_matrix(const ebpo_rigid *r, double out[3][3]);

/* Rotates p: `out` is the vector from the tool's centre to the point, in the world's axes. */
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

/* --- contacts of a tool --- */

enum { EBPO_CONTACTS_MAX = 256 };

typedef struct ebpo_tool_contact {
    double grip[EBPO_SCREW]; /* grip . motion is the distance by which the point moves away from the
                              * face */
    double space;         /* distance by which the point may come closer to the face; negative: it
                           * must move away by -space */
    double gap;           /* distance of the point from the face */
    uint64_t point, face; /* indices for the caller */
    uint32_t instance;    /* index of the face's instance */
    double normal[3];     /* unit vector from the face to the point */
} ebpo_tool_contact;

typedef struct ebpo_tool_contacts {
    ebpo_tool_contact at[EBPO_CONTACTS_MAX]; /* a heap; at[0] has the largest gap */
    int count;
} ebpo_tool_contacts;

/* Adds a contact. If the heap is full, the new contact replaces the contact with the largest gap;
 * the new contact is ignored if its own gap is not smaller. */
void ebpo_tool_contact_add(ebpo_tool_contacts *all, const ebpo_tool_contact *contact);

/* Computes the motion `out` nearest to `want` with grip . out >= -space for all contacts. If the
 * limit of work is not reached, the error is at most `tolerance`. release: contacts with a negative
 * space require a motion away from their faces; if false, a negative space counts as 0. Returns the
 * number of contacts that hold the tool. */
int ebpo_tool_hold(const ebpo_tool_contacts *all, const double want[EBPO_SCREW], double tolerance,
                   bool release, double out[EBPO_SCREW]);

/* Greatest values of a tool. */
enum {
    EBPO_TOOL_POINTS = 10000, /* number of points of a tool */
    EBPO_TOOL_CLUSTER = 8,    /* number of points of a cluster */
    EBPO_TOOL_GROUP = 16,     /* number of clusters of a group */
    EBPO_TOOL_PIECES = 6,     /* number of pieces of the path in a haptic step */
    EBPO_TOOL_POOL = 1 << 16, /* number of faces around all points in total */
    EBPO_TOOL_NEAR = 64,      /* number of faces around a point */
    EBPO_TOOL_KEPT = 8,       /* number of faces that are kept for a point */
    EBPO_TOOL_WORK = 7500     /* work of a haptic step: visited nodes, plus six for each face */
};

/* A set of points that are near each other. */
typedef struct ebpo_tool_cluster {
    uint32_t first, count;    /* indices of its points: first .. first + count - 1 */
    double middle[3], radius; /* a ball around the points, in the tool's coordinates */
    double lever;             /* greatest distance of a point from the tool's centre */
    double safe_until; /* no point of the cluster can hit a face before ebpo_tool_travelled is
                          greater than this value */
    uint64_t leaf;     /* leaf of a face box near the cluster; any value is valid */
} ebpo_tool_cluster;

/* Clusters that are near each other: cluster number GROUP n to GROUP (n + 1) - 1 for group n. */
typedef struct ebpo_tool_group {
    double lever;
    double safe_until; /* as for a cluster, for all clusters of the group */
} ebpo_tool_group;

/* The faces around a point, which are kept from one piece to the next. */
typedef struct ebpo_kept_faces {
    uint64_t serial; /* ebpo_face_box.serial of the box that has the faces; 0: none are kept */
    double middle[3],
        wide; /* all faces that intersect the cube middle - wide to middle + wide are kept */
    uint32_t count, face[EBPO_TOOL_KEPT]; /* indices in ebpo_face_box.corner */
} ebpo_kept_faces;

/* A point that may hit faces in the current piece: the faces pool[first] to pool[first + count -
 * 1]. */
typedef struct ebpo_close_point {
    uint32_t point, first, count;
} ebpo_close_point;

typedef enum ebpo_tool_stage {
    EBPO_TOOL_IDLE,     /* there is no unfinished piece */
    EBPO_TOOL_SEARCHES, /* first pass: find where a point comes too close to a face */
    EBPO_TOOL_CHECKS    /* second pass: check the points at the end of the piece */
} ebpo_tool_stage;

typedef struct ebpo_tool {
    uint64_t count, cluster_count;
    double (*point)[3];    /* in the tool's coordinates, cluster after cluster */
    uint32_t *number;      /* [count] index of each point in the caller's array */
    double *safe_until;    /* [count] as ebpo_tool_cluster.safe_until, for one point */
    ebpo_kept_faces *kept; /* [count] */
    double radius, arm;    /* radius: greatest distance of a point from the centre; arm: root of the
                              mean square of the distances of all points */
    ebpo_tool_cluster *cluster;
    ebpo_tool_group *group;
    double moved, turned; /* upper bounds of the length of the centre's path and of the angle of all
                           * rotations, over all pieces */

    ebpo_rigid proxy, device;
    ebpo_rigid path[EBPO_TOOL_PIECES + 1]; /* positions of the proxy in the last haptic step */
    uint32_t path_count;
    double force[EBPO_SCREW];    /* force of the last haptic step */
    ebpo_tool_contacts contacts; /* contacts at the proxy's position */
    ebpo_tool_contacts next;     /* contacts at the end of the piece */

    /* The current piece of path; the next haptic step continues it. */
    ebpo_tool_stage stage;
    double motion[EBPO_SCREW]; /* motion of the whole piece */
    double fraction;           /* fraction of the piece that is free */
    bool jams;      /* the last piece did not move the tool, and has found no new contact */
    ebpo_rigid end; /* position of the tool at this fraction */
    double from_matrix[3][3]; /* rotation at the beginning of the piece */
    double to_matrix[3][3];   /* rotation at the end of the whole piece */
    double end_matrix[3][3];  /* rotation of `end` */
    uint32_t flags; /* bits of ebpo_haptic_flag that the step returns when the piece is complete */
    uint32_t next_point; /* number in its cluster of the point that is examined next */
    uint64_t piece_work; /* work of the piece so far */
    uint64_t next_index; /* index of the cluster or of the close point that is examined next */
    ebpo_close_point *close_points; /* [close_count] */
    uint64_t close_count;
    uint32_t *pool; /* [pool_count] faces around close points: indices in ebpo_face_box.corner */
    uint64_t pool_count;
} ebpo_tool;

EBPO_MUST_USE ebpo_status ebpo_tool_new(const double (*points)[3], uint64_t count, ebpo_tool **out,
                                        ebpo_error *error);
void ebpo_tool_free(ebpo_tool *tool);
uint64_t ebpo_tool_bytes(const ebpo_tool *tool);

/* Places the tool at another position without following a path, and discards all known distances.
 */
void ebpo_tool_put(ebpo_tool *tool, const ebpo_rigid *at);

/* Returns an upper bound of the length of the path, over all pieces, of a point whose distance from
 * the tool's centre is at most `lever`. */
static inline double ebpo_tool_travelled(const ebpo_tool *tool, double lever)
{
    return tool->moved + lever * tool->turned;
}

/* Computes the position in the world of the tool's point p. matrix: the rotation of r. */
static inline void ebpo_tool_at(const ebpo_rigid *r, const double matrix[3][3], const double p[3],
                                double out[3])
{
    ebpo_rigid_lever(matrix, p, out);
    for (int i = 0; i < 3; i++)
        out[i] += r->place[i];
}

#endif
