/* The object of a haptic session, with comments on which thread may use which part. */
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
    /* Number of boxes: the current one of the step, its previous one, the middle one, the one being
     * loaded. */
    EBPO_HAPTIC_BOXES = 4,
    EBPO_HAPTIC_FRESH = 8, /* flag in addition to a box's number: no haptic step has seen the box */

    /* Maximum number of faces and nodes that are examined for the normal, and for the side of a
     * probe. */
    EBPO_HAPTIC_FACES = 384,
    EBPO_HAPTIC_VISITS = 1024,

    EBPO_HAPTIC_PIECES = EBPO_HAPTIC_PATH_MAX - 1
};

/* Results of the loading thread for a position of a probe. */
typedef struct ebpo_known_place {
    double place[3];
    double distance; /* without a sign; infinite if the model has no faces */
    double point[3], normal[3];
    int32_t winding;
    bool valid, on;
} ebpo_known_place;

struct ebpo_haptic {
    /* --- constant members --- */
    ebpo_model *model;
    ebpo_haptic_options options;
    ebpo_extent root; /* all faces are inside */
    double diagonal;  /* diagonal of the root cell */
    double reach, band, margin;
    bool solid;
    ebpo_held_levels levels; /* for probes */

    /* --- used by the thread of haptic steps --- */
    unsigned at, seen; /* numbers of the current and the previous box */
    double proxy[3], device[3], force[3];
    bool touching;
    ebpo_ball_walk walk;     /* the current piece of the path */
    ebpo_held_planes along;  /* contacts of the ball when its centre is at along_at */
    double along_at[3];      /* position of the centre for these contacts */
    ebpo_held_planes planes; /* planes that hold the proxy after the last complete piece */
    uint32_t cut;            /* flags that are returned at the end of the piece */
    bool felt;               /* the whole path to the device's position is done */
    double path[EBPO_HAPTIC_PATH_MAX][3];
    uint32_t path_count;
    double stride; /* maximum length of a piece of a tool's path */
    ebpo_passive passive;
    struct ebpo_tool *tool; /* or NULL */
    ebpo_haptic_stats stats;
    uint32_t found[EBPO_HAPTIC_FACES];
    ebpo_near_node nearest_queue[EBPO_HAPTIC_VISITS + 2];
    double gap[EBPO_HAPTIC_FACES];
    double away[3];              /* direction away from the nearest face, if one was found */
    ebpo_context *proxy_context; /* for placing the proxy */
    ebpo_side side;
    unsigned result; /* number of the step's entry of known[] */

    /* --- exchanged between the threads --- */
    ebpo_face_box box[EBPO_HAPTIC_BOXES];
    atomic_uint between; /* number of the middle box, possibly with EBPO_HAPTIC_FRESH */
    _Atomic double proxy_reported[3]; /* The position of the proxy. Each component is atomic, so the
                                       * loader may read a mixture of two positions. Therefore the
                                       * step checks that a new box contains the proxy. */
    _Atomic double device_reported[3];
    ebpo_known_place known[3];
    atomic_uint known_between;  /* as `between`, for known[] */
    _Atomic bool stop, stopped; /* stopped: by a failure; `failure` is set before */
    atomic_uint_fast64_t loads, too_many, load_ns, load_ns_max;

    /* --- used by the loading thread --- */
    ebpo_context *loading;
    unsigned own; /* number of its box */
    unsigned own_known;
    double last_query[3]; /* position of the last query */
    ebpo_extent last;
    double half; /* half a box's side */
    double device_before[3], speed[3];
    uint64_t when_before;
    pthread_t thread;
    bool has_thread;

    pthread_mutex_t mutex; /* protects `failure`; never locked by a haptic step */
    ebpo_error failure;
};

/* haptic_step.c: moves the proxy towards the goal, as far as faces and the current box allow.
 * Returns bits of ebpo_haptic_flag. */
uint32_t ebpo_haptic_go(ebpo_haptic *t, const double goal[3], ebpo_ball_work *work);

/* Returns the part of the straight path `motion` of the proxy for which all faces within `reach`
 * are known: up to the boundary of the current box, or the whole path where no face can be. */
double ebpo_haptic_known_part(const ebpo_haptic *t, const double motion[3], double reach);

/* haptic_step.c: finds the nearest face, weights, depth and the smooth normal; sets t->away. */
void ebpo_haptic_find_nearest(ebpo_haptic *t, ebpo_haptic_ball_result *out);

/* Returns the last result of the loading thread. */
const ebpo_known_place *ebpo_haptic_known(ebpo_haptic *t);

/* haptic_loader.c */
EBPO_MUST_USE ebpo_status ebpo_haptic_loader_start(ebpo_haptic *t, ebpo_error *error);
void ebpo_haptic_loader_stop(ebpo_haptic *t);

/* haptic_step.c: replaces the current box by a fresh one that contains the proxy. Returns true if
 * there was one. */
bool ebpo_haptic_take_box(ebpo_haptic *t);
/* Returns to the previous box if it contains the proxy: it may extend further. */
void ebpo_haptic_try_other(ebpo_haptic *t);

/* haptic_ball.c: returns EBPO_HAPTIC_STOPPED, or 0. */
uint32_t ebpo_haptic_stopped(const ebpo_haptic *t);
void ebpo_haptic_report(ebpo_haptic *t, const double device[3]);
void ebpo_haptic_count(ebpo_haptic *t, uint32_t flags, uint64_t work);

#endif
