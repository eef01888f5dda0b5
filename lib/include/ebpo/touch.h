/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: a hand that touches a model, at a steady rate and never late.
 *
 *   Making    ebpo_touch_new, ebpo_touch_free
 *   A tick    ebpo_touch_move, ebpo_touch_way
 *   Else      ebpo_touch_place, ebpo_touch_check, ebpo_touch_get_stats
 *
 *     ebpo_touch *touch = NULL;
 *     ebpo_touch_result answer;
 *     ebpo_touch_new(model, NULL, start, &touch, &error);
 *     for (;;) {
 *         ebpo_touch_move(touch, device_position, &answer);
 *         send(answer.force);
 *     }
 *
 * The hand is a ball (or a point). Where the device goes through a face, a proxy of it stays on the
 * side from which it came: every step of the proxy's centre is a segment of which exact arithmetic
 * has said that it meets no face. So it goes through no wall, however thin, and however fast the
 * device moves; faces count from both sides, and so surfaces can be touched as solids can.
 *
 * A tick works on what is in memory: the faces in a box around the hand, at most so many. A thread
 * of the object's own loads the next box ahead of the hand and hands it over by one atomic
 * exchange. A tick takes no lock, no memory and reads no file. Where the hand leaves the box before
 * the next one is there, the proxy waits at its wall (EBPO_TOUCH_WAITS): early, never late.
 *
 * Sources of the methods: EBP 2017, section 4.5; Zilles and Salisbury 1995 (god-object); Ruspini,
 * Kolarov and Khatib 1997 (proxy of a size).
 */
#ifndef EBPO_TOUCH_H
#define EBPO_TOUCH_H

#include <ebpo/query.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct ebpo_touch ebpo_touch;

typedef struct ebpo_touch_options {
    size_t struct_size; /* EBPO_TOUCH_OPTIONS_INIT sets it */

    /* Of the hand, in the model's unit, at least 0. 0: a point. */
    double radius;

    /*
     * So far beyond its radius the proxy keeps away from faces, in the model's unit: what rounding
     * needs. 0: 2^-20 of the diagonal of the model's root cell. Else at least 2^-30 of it.
     */
    double skin;

    /*
     * Faces within this distance of the ball take part in the smooth normal, the nearer the more,
     * and the nearest face is looked for so far; in the model's unit, at least 0. 0: 3 of the
     * diagonal over the root of the number of faces, some edges of an even mesh.
     */
    double look;

    /* Force for each unit of depth; force for each unit a second of the hand, while it touches; at
     * least 0. */
    double stiffness, damping;

    /* Coulomb's: the proxy slides where the tangential force is more than this part of the normal
     * one. At least 0. */
    double friction;

    /* Seconds from one call of ebpo_touch_move to the next; above 0. */
    double tick;

    /* Faces of a box at most; 64 to 2^20. Four such boxes are held: about 550 bytes a face in all,
     * beside the model's budget. */
    uint64_t faces;
} ebpo_touch_options;

#define EBPO_TOUCH_OPTIONS_INIT                                          \
    {                                                                    \
        sizeof(ebpo_touch_options), 0, 0, 0, 400, 0.4, 0, 0.001, 1 << 14 \
    }

/*
 * Puts the hand at a place and begins to load around it.
 *
 * model   must live as long; other contexts may use it meanwhile. Its budget is what loading may
 *         take (ebpo_model_options.memory)
 * place   three finite doubles, outside of the solid, and farther from every face than the ball
 *         needs
 *
 * EBPO_E_ARGUMENT: an option or the place is not such. EBPO_E_UNSUPPORTED: coordinates are beyond
 * 2^200.
 * EBPO_E_ABSENT: the file has no mesh, or is a subset without what lies around the place.
 * EBPO_E_LIMIT, EBPO_E_MEMORY, and the errors of reading.
 *
 * Threads: any; one more is started.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_touch_new(ebpo_model *model,
                                                  const ebpo_touch_options *options,
                                                  const double place[3], ebpo_touch **out,
                                                  ebpo_error *error);

/*
 * Ends the thread, after what it is loading. NULL is fine.
 *
 * Threads: one per object.
 */
EBPO_API void ebpo_touch_free(ebpo_touch *touch);

/* What is to be known of a tick: bits. */
typedef enum ebpo_touch_flag {
    /* A face keeps the proxy from the hand. */
    EBPO_TOUCH_CONTACT = 1,

    /* The proxy waits at the wall of what is loaded; there is no force from that. */
    EBPO_TOUCH_WAITS = 2,

    /* A tick's work was done before the way was: the proxy goes on in the next one. */
    EBPO_TOUCH_SHORT = 4,

    /* Not all faces within `look` were looked at, or not all of them are loaded: nearest face,
     * distance and normal are those of the others. */
    EBPO_TOUCH_PARTLY = 8,

    /* The hand was not finite: it was taken to be where it was before. */
    EBPO_TOUCH_ASTRAY = 16
} ebpo_touch_flag;

typedef struct ebpo_touch_result {
    /* The centre of the ball on the free side. */
    double proxy[3];

    /* What the device should push with; 0 unless EBPO_TOUCH_CONTACT. */
    double force[3];

    /*
     * Unit vector away from the faces around: their normals on the proxy's side, weighed, so that
     * it turns steadily when the proxy goes across an edge. (0, 0, 0) if no face is within `look`.
     */
    double normal[3];

    /*
     * How far the hand is behind the proxy if they touch. Else minus the distance from ball to
     * nearest face; minus `look` if none is so close: then the distance is that or more, unless
     * EBPO_TOUCH_PARTLY.
     */
    double depth;

    /* Of the nearest face within `look`: its number as in ebpo_distance_result (EBPO_NO_FACE:
     * none), the nearest point and the weights of its corners there, which sum up to 1. */
    uint64_t face;
    double point[3], weight[3];

    /* ebpo_touch_flag bits. */
    uint32_t flags;

    /* Faces that the tick has looked at. */
    uint32_t work;
} ebpo_touch_result;

/*
 * One tick: the device is at `hand`. Takes bounded time, without lock, memory or reading. How far
 * the proxy has come where it waited or was short depends on when boxes were loaded.
 *
 * Force: stiffness times the way from hand to proxy, less damping times the hand's speed; never
 * towards the faces. It is made weaker where the hand would be given more energy in sum than was
 * taken from it and stiffness times the square of the longest step that it ever made in a tick,
 * however it is moved.
 *
 * Threads: one per object.
 */
EBPO_API void ebpo_touch_move(ebpo_touch *touch, const double hand[3], ebpo_touch_result *out);

/* So many points a way has at most. */
enum { EBPO_TOUCH_WAY_MOST = 17 };

/*
 * The proxy's way in the last tick, from where it was to where it is: segments between way[0] and
 * way[n - 1], none of which meets a face. Returns n, which is 1 if it stayed, 0 before the first
 * tick.
 *
 * Threads: one per object.
 */
EBPO_API uint32_t ebpo_touch_way(const ebpo_touch *touch, double way[EBPO_TOUCH_WAY_MOST][3]);

/*
 * Lifts the hand and puts it elsewhere; waits until that is loaded. Not for a tick.
 *
 * Errors are those of ebpo_touch_new. After a failure the hand is where it was.
 *
 * Threads: one per object.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_touch_place(ebpo_touch *touch, const double place[3],
                                                    ebpo_error *error);

/*
 * What has kept the thread from loading: it has stopped, and the hand stays in what is there. Takes
 * a lock: not for a tick.
 *
 * EBPO_OK; else the errors of reading, EBPO_E_LIMIT, EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_touch_check(ebpo_touch *touch, ebpo_error *error);

/* Sums since the object was made. */
typedef struct ebpo_touch_stats {
    size_t struct_size; /* EBPO_TOUCH_STATS_INIT sets it */

    uint64_t ticks;

    /* Ticks with each of these flags. */
    uint64_t contacts, waits, shorts, partly;

    /* Boxes loaded, boxes that ticks have taken, boxes begun that had too many faces. */
    uint64_t loads, taken, too_many;

    /* Faces of the box at hand; faces looked at in a tick at most. */
    uint64_t faces, work_most;

    /* Energy given to the hand by forces, less what was taken; and what it ever was at most. The
     * hand's longest step in a tick. */
    double given, given_most, step_most;

    /* Bytes of the boxes. */
    uint64_t memory;

    /* Seconds that loading took in all, and one box at most. */
    double load_seconds, load_seconds_most;
} ebpo_touch_stats;

#define EBPO_TOUCH_STATS_INIT EBPO_SIZED(ebpo_touch_stats)

/*
 * EBPO_E_ARGUMENT: `out` was not begun with its macro.
 *
 * Threads: one per object.
 */
EBPO_API ebpo_status ebpo_touch_get_stats(const ebpo_touch *touch, ebpo_touch_stats *out);

#ifdef __cplusplus
}
#endif
#endif
