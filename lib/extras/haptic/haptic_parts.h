/* Defines the object of a haptic session, and the instances of models that it touches. Its members
 * are in groups; a comment at the head of each group states which thread may use its members. */
#ifndef EBPO_HAPTIC_HAPTIC_PARTS_H
#define EBPO_HAPTIC_HAPTIC_PARTS_H

#include <ebpo/haptic.h>
#include <pthread.h>
#include <stdatomic.h>

#include "extras/haptic/ball_walk.h"
#include "extras/haptic/face_box.h"
#include "extras/haptic/held_levels.h"
#include "extras/haptic/tool.h"

enum {
    /* Number of boxes: the current and the previous box of haptic steps, one that waits to be taken
     * by a step, and one that is being loaded. */
    EBPO_HAPTIC_BOXES = 4,
    EBPO_HAPTIC_FRESH = 8, /* flag that is added to the index of a box: no haptic step has taken the
                            * box */

    /* Maximum number of faces and nodes that are examined for the normal, and for the side of a
     * probe. */
    EBPO_HAPTIC_FACES = 384,
    EBPO_HAPTIC_VISITS = 1024,

    /* Maximum number of straight pieces of the path in a haptic step. */
    EBPO_HAPTIC_PIECES = EBPO_HAPTIC_PATH_MAX - 1
};

/* A model, and what both threads need to query it. Its instances share it. */
typedef struct ebpo_haptic_model {
    ebpo_model *model;
    ebpo_context *placing;   /* used by the thread of haptic steps, for placing the proxy */
    ebpo_context *loading;   /* used by the loading thread */
    ebpo_held_levels levels; /* upper levels of the octree, for probes */
} ebpo_haptic_model;

/* An instance: a model at a pose. */
typedef struct ebpo_haptic_part {
    const ebpo_haptic_model *of;
    bool is_posed; /* false: the coordinates of the model are those of the world */
    ebpo_posed_solid posed;
    ebpo_extent extent; /* contains all faces */
    double scale;       /* length in the world of a unit of the model */
    bool solid;
    ebpo_known_winding probed_point; /* last position of the probe, with its winding number */
} ebpo_haptic_part;

/* The side of a position with respect to an instance. */
typedef struct ebpo_probe_side {
    int32_t winding;
    bool on_face; /* the position is on a face of the instance */
} ebpo_probe_side;

/* Exact results of the loading thread for a position of the probe. */
typedef struct ebpo_probe_query {
    double place[3];            /* the position */
    double distance;            /* distance from the nearest face, 0 or more; infinite if there are
                                 * no faces */
    double uncertainty;         /* bound of the error of `distance` because of poses */
    double point[3], normal[3]; /* nearest point, and normal of its face */
    ebpo_probe_side *side;      /* [part_count] */
    bool valid;                 /* the results have been set */
} ebpo_probe_query;

struct ebpo_haptic {
    /* --- constant members --- */
    ebpo_haptic_model *models; /* [model_count] */
    ebpo_haptic_part *part;    /* [part_count] only probed_point changes, in haptic steps */
    uint32_t *order; /* [part_count] the instances in the order in which they are loaded */
    uint64_t model_count, part_count;
    ebpo_haptic_options options;
    ebpo_extent root; /* contains all faces */
    double diagonal;  /* diagonal of `root` */
    double slack;     /* of a probe: bound of the rounding of coordinates */
    double contact_distance,
        band;      /* contact_distance: radius plus skin, used as ebpo_ball_motion.radius; band:
                      tolerance of contact, used as ebpo_ball_motion.band */
    double margin; /* faces within this distance of the proxy are loaded */

    /* --- used by the thread of haptic steps --- */
    unsigned current_box, previous_box;   /* indices of the current and the previous box */
    double proxy[3], device[3], force[3]; /* positions, and the force of the last step */
    bool touching;                        /* the last step had a contact */
    ebpo_ball_walk walk;                  /* the current piece of the path */
    ebpo_held_planes contact_planes; /* contacts of the ball if its centre is at contact_position */
    double contact_position[3];
    ebpo_held_planes holding_planes; /* planes that hold the proxy after the last complete piece */
    uint32_t end_flags;              /* flags that are returned at the end of the piece */
    bool has_complete_piece; /* a piece towards the current position of the device is complete */
    double path[EBPO_HAPTIC_PATH_MAX][3]; /* [path_count] positions of the proxy in the last step */
    uint32_t path_count;
    double max_piece; /* maximum length of a piece of a tool's path */
    ebpo_passive passive;
    struct ebpo_tool *tool; /* NULL for a ball or a probe */
    ebpo_haptic_stats stats;
    uint32_t found[EBPO_HAPTIC_FACES];                    /* workspace: faces around the proxy */
    ebpo_near_node nearest_queue[EBPO_HAPTIC_VISITS + 2]; /* workspace of the search for faces */
    double gap[EBPO_HAPTIC_FACES]; /* distances of the faces in `found` from the ball */
    double away[3];                /* direction away from the nearest face, if one was found */
    unsigned step_result;          /* index in known[] of the result that steps use */

    /* --- exchanged between the threads --- */
    ebpo_face_box box[EBPO_HAPTIC_BOXES];
    atomic_uint
        waiting_box; /* index of the waiting box, plus EBPO_HAPTIC_FRESH until it is taken */
    /* The positions of proxy and device. Only the components are atomic, so the loader may read a
     * mixture of two positions. Therefore the step checks that a new box contains the proxy. */
    _Atomic double proxy_reported[3], device_reported[3];
    ebpo_probe_query known[3];
    atomic_uint waiting_result; /* index in known[] of the waiting result, as for waiting_box */
    _Atomic bool stop;          /* the loading thread must end */
    _Atomic bool stopped;       /* the loading thread has failed, and `failure` has been set */
    atomic_uint_fast64_t loads, too_many, load_ns, load_ns_max;

    /* --- used by the loading thread --- */
    unsigned loader_box;    /* index of the box that the loading thread may write */
    uint64_t serial;        /* of the newest box */
    unsigned loader_result; /* index in known[] of the result that the loading thread may write */
    double last_query[3];   /* position of the last query for a probe */
    ebpo_extent newest_allowed; /* `allowed` of the newest box */
    double half_side;           /* half of the side of `allowed` of the next box */
    double speed_position[3],
        speed[3];        /* position of the device at speed_time, and its speed before speed_time */
    uint64_t speed_time; /* time of the last measurement, in ns */
    pthread_t thread;
    bool has_thread;

    pthread_mutex_t mutex; /* protects `failure`; never locked by a haptic step */
    ebpo_error failure;
};

/* haptic_part.c: makes the instances [count] and what they share. posed: false if there is one
 * instance, whose pose is not used. A probe also gets the upper levels of the octrees. */
EBPO_MUST_USE ebpo_status ebpo_haptic_parts_new(ebpo_haptic *t,
                                                const ebpo_haptic_instance *instances,
                                                uint64_t count, bool posed, ebpo_error *error);
void ebpo_haptic_parts_free(ebpo_haptic *t);

/* haptic_part.c: computes the point p, in coordinates of the instance's model, for a point w of the
 * world. *uncertainty: as for ebpo_unpose; 0 if the instance is not posed. */
void ebpo_haptic_part_point(const ebpo_haptic_part *part, const double w[3], double p[3],
                            double *uncertainty);

/* haptic_part.c: returns a lower bound of the distance of w from the faces of the instance. */
double ebpo_haptic_part_gap(const ebpo_haptic_part *part, const double w[3]);

/* haptic_part.c: loads the faces of all instances that are within t->margin of the box `allowed`.
 * *fits: as for ebpo_face_box_add. */
EBPO_MUST_USE ebpo_status ebpo_haptic_parts_load(ebpo_haptic *t, ebpo_face_box *box,
                                                 const ebpo_extent *allowed, bool *fits,
                                                 ebpo_error *error);

/* haptic_step.c: moves the ball's proxy towards the goal, until faces, the end of the current box
 * or a limit of `work` stop the proxy. Returns bits of ebpo_haptic_flag. */
uint32_t ebpo_haptic_move_ball(ebpo_haptic *t, const double goal[3], ebpo_ball_work *work);

/* haptic_step.c: returns the fraction, 0 to 1, of the proxy's straight path `motion` for which all
 * faces within `distance` are loaded. The result is 1 if no face of the model can be within
 * `distance` of the path. */
double ebpo_haptic_loaded_part(const ebpo_haptic *t, const double motion[3], double distance);

/* haptic_step.c: finds the nearest face, its weights, the depth and the smooth normal, and sets
 * t->away. */
void ebpo_haptic_find_nearest(ebpo_haptic *t, ebpo_haptic_ball_result *out);

/* haptic_loader.c: returns the newest exact results for the probe. */
const ebpo_probe_query *ebpo_haptic_newest_probe_query(ebpo_haptic *t);

/* haptic_loader.c: start and stop the loading thread. */
EBPO_MUST_USE ebpo_status ebpo_haptic_loader_start(ebpo_haptic *t, ebpo_error *error);
void ebpo_haptic_loader_stop(ebpo_haptic *t);

/* haptic_step.c: if the waiting box is fresh (no step has taken it), takes it as the previous box.
 * If this box contains the proxy, makes it the current box and returns true. */
bool ebpo_haptic_take_box(ebpo_haptic *t);
/* haptic_step.c: exchanges the current and the previous box if the previous box contains the proxy.
 * This helps if the previous box extends further towards the device. */
void ebpo_haptic_try_previous_box(ebpo_haptic *t);

/* haptic_ball.c: returns EBPO_HAPTIC_STOPPED if the loading thread has failed, or 0. */
uint32_t ebpo_haptic_stopped(const ebpo_haptic *t);
/* haptic_ball.c: passes the positions of proxy and device to the loading thread. */
void ebpo_haptic_report(ebpo_haptic *t, const double device[3]);
/* haptic_ball.c: adds a step with these flags and this work to the statistics. */
void ebpo_haptic_count(ebpo_haptic *t, uint32_t flags, uint64_t work);

#endif
