/* The object of a haptic session, and which thread may use which part of it. */
#ifndef EBPO_HAPTIC_TOUCH_PARTS_H
#define EBPO_HAPTIC_TOUCH_PARTS_H

#include <ebpo/touch.h>
#include <pthread.h>
#include <stdatomic.h>

#include "extras/haptic/ball_walk.h"
#include "extras/haptic/face_box.h"
#include "extras/haptic/held_levels.h"
#include "extras/haptic/tool.h"

enum {
    /* The tick's box, the one it looked at last, the one between, the one being loaded. */
    EBPO_TOUCH_BOXES = 4,
    EBPO_TOUCH_FRESH = 8, /* beside a box's number: the tick has not seen it */

    /* What is looked at for the normal, and for the side of a probe: at most. */
    EBPO_TOUCH_FACES = 384,
    EBPO_TOUCH_VISITS = 1024,

    EBPO_TOUCH_PIECES = EBPO_TOUCH_WAY_MOST - 1
};

/* What the loading thread has been told of a place, for probes. */
typedef struct ebpo_known_place {
    double place[3];
    double distance; /* unsigned; of nothing infinite */
    double point[3], normal[3];
    int32_t winding;
    bool there, on;
} ebpo_known_place;

struct ebpo_touch {
    /* for good */
    ebpo_model *model;
    ebpo_touch_options options;
    ebpo_extent root; /* no face is outside */
    double diagonal;  /* of the root cell */
    double reach, band, margin;
    bool solid;
    ebpo_held_levels levels; /* of probes */

    /* of the ticks' thread */
    unsigned at, seen; /* boxes */
    double proxy[3], hand[3], force[3];
    bool touching;
    ebpo_ball_walk walk;     /* the piece of way it is on */
    ebpo_held_planes along;  /* what the ball touches */
    double along_at[3];      /* with its centre here */
    ebpo_held_planes planes; /* that hold the proxy: of the last piece that is done */
    uint32_t cut;            /* flags if the piece's end is reached */
    bool felt;               /* a piece is done that goes to where the hand is */
    double way[EBPO_TOUCH_WAY_MOST][3];
    uint32_t way_count;
    double stride; /* so long a piece of a tool's way may be */
    ebpo_passive passive;
    struct ebpo_tool *tool; /* or NULL */
    ebpo_touch_stats stats;
    uint32_t found[EBPO_TOUCH_FACES];
    ebpo_near_node looking[EBPO_TOUCH_VISITS + 2];
    double gap[EBPO_TOUCH_FACES];
    double away[3];       /* from the nearest face, if one was found */
    ebpo_context *asking; /* for places */
    ebpo_side side;
    unsigned answer; /* number of a known place */

    /* handed over */
    ebpo_face_box box[EBPO_TOUCH_BOXES];
    atomic_uint between;          /* a box, perhaps fresh */
    _Atomic double proxy_told[3]; /* each for itself: what the loader makes of a mixture is */
    _Atomic double hand_told[3];  /* a box like any other, and the tick looks whether it fits */
    ebpo_known_place known[3];
    atomic_uint known_between;  /* as `between` */
    _Atomic bool stop, stopped; /* stopped: by a failure, which is there before */
    atomic_uint_fast64_t loads, too_many, load_ns, load_ns_most;

    /* of the loading thread */
    ebpo_context *loading;
    unsigned own; /* box */
    unsigned own_known;
    double asked[3]; /* the last place that was asked about */
    ebpo_extent last;
    double half; /* of a box's sides */
    double hand_before[3], speed[3];
    uint64_t when_before;
    pthread_t thread;
    bool has_thread;

    pthread_mutex_t mutex; /* of `failure`: never locked by a tick */
    ebpo_error failure;
};

/* touch_step.c: the proxy goes towards the goal, as far as faces and the box at hand allow; bits of
 * ebpo_touch_flag. */
uint32_t ebpo_touch_go(ebpo_touch *t, const double goal[3], ebpo_ball_work *work);

/* The part of the proxy's way, itself between a straight one's ends, of which all faces within
 * `reach` are known: to the wall of the box at hand, or all of it where no face can be. */
double ebpo_touch_known_part(const ebpo_touch *t, const double way[3], double reach);

/* touch_step.c: nearest face, weights, depth and the smooth normal; t->away. */
void ebpo_touch_look(ebpo_touch *t, ebpo_touch_result *out);

/* The last that is known. */
const ebpo_known_place *ebpo_touch_known(ebpo_touch *t);

/* touch_loader.c */
EBPO_MUST_USE ebpo_status ebpo_touch_loader_start(ebpo_touch *t, ebpo_error *error);
void ebpo_touch_loader_stop(ebpo_touch *t);

/* touch_step.c: a box that is fresh and holds the proxy becomes the one at hand. True: one did. */
bool ebpo_touch_take_box(ebpo_touch *t);
/* The box before, if it holds the proxy: perhaps that one reaches further. */
void ebpo_touch_try_other(ebpo_touch *t);

/* touch_move.c: EBPO_TOUCH_STOPPED, or 0. */
uint32_t ebpo_touch_stopped(const ebpo_touch *t);
void ebpo_touch_tell(ebpo_touch *t, const double hand[3]);
void ebpo_touch_count(ebpo_touch *t, uint32_t flags, uint64_t work);

#endif
