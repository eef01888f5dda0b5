/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: a hand that touches a model, at a steady rate and never late.
 *
 *   Making    ebpo_touch_new, ebpo_touch_free
 *
 *   A tick    ebpo_touch_move, ebpo_touch_way: a ball
 *             ebpo_touch_sense: a point that nothing stops
 *             ebpo_touch_turn, ebpo_touch_poses: a tool of many points, with force and torque
 *
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
 * the next one is there, the proxy waits at its wall (EBPO_TOUCH_WAITS): early, never late. If none
 * will come, as reading failed or too many faces are around, that is told (EBPO_TOUCH_STOPPED).
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

/* What a hand is: which of the ticks it has. */
typedef enum ebpo_touch_kind {
    EBPO_TOUCH_BALL = 0,  /* ebpo_touch_move */
    EBPO_TOUCH_PROBE = 1, /* ebpo_touch_sense */
    EBPO_TOUCH_TOOL = 2   /* ebpo_touch_turn */
} ebpo_touch_kind;

typedef struct ebpo_touch_options {
    size_t struct_size; /* EBPO_TOUCH_OPTIONS_INIT sets it */

    /* Of the hand, in the model's unit, at least 0. 0: a point. All faces within the radius and
     * `look` must find room in a box (`faces`). A tick looks at 512 of them at most, in the order
     * in which the ball may touch them; where that does not do, the next ones go on. */
    double radius;

    /*
     * So far beyond its radius the proxy keeps away from faces, in the model's unit: what rounding
     * needs. 0: 2^-20 of the diagonal of the model's root cell. Else at least 2^-30 of it,
     * and 2^-42 of the coordinates and the radius.
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

    /*
     * Of a tool: points[point_count][3] in its own coordinates, 1 to 10,000; copied. Points keep to
     * the side of faces from which they came, and so need no normals. For others NULL and 0.
     */
    const double (*points)[3];
    uint64_t point_count;

    /* An ebpo_touch_kind. */
    uint64_t kind;
} ebpo_touch_options;

#define EBPO_TOUCH_OPTIONS_INIT                                                      \
    {                                                                                \
        sizeof(ebpo_touch_options), 0, 0, 0, 400, 0.4, 0, 0.001, 1 << 14, NULL, 0, 0 \
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

    /* A tick's work was done before the way was: the proxy goes on in the next one. A ball that was
     * held is held meanwhile by the faces that were. */
    EBPO_TOUCH_SHORT = 4,

    /* Not all faces within `look` were looked at, which are the farthest ones then, or not all of
     * them are loaded: nearest face, distance and normal are those of the others. */
    EBPO_TOUCH_PARTLY = 8,

    /* The hand was not finite: it was taken to be where it was before. */
    EBPO_TOUCH_ASTRAY = 16,

    /* This kind of hand has no such tick: nothing was done. */
    EBPO_TOUCH_OTHER = 32,

    /* Of ebpo_touch_sense: the distance is known to rounding. */
    EBPO_TOUCH_CLOSE = 64,

    /* Nothing more is loaded, for good: ebpo_touch_check tells why. The hand goes on in what is
     * there, and waits at its wall. From the tick on that comes after the failure. */
    EBPO_TOUCH_STOPPED = 128
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
 * towards faces that the spring pushes away from, but for 1e-7 of itself. It is made weaker where
 * the hand would be given more energy in sum than was taken from it and stiffness times the square
 * of the longest step that it ever made in a tick, however it is moved.
 *
 * Threads: one per object.
 */
EBPO_API void ebpo_touch_move(ebpo_touch *touch, const double hand[3], ebpo_touch_result *out);

/* So many points a way has at most. */
enum { EBPO_TOUCH_WAY_MOST = 17 };

/*
 * A tool's way in the last tick, as ebpo_touch_way: a place and a quaternion each. Each point went
 * straight from one of its places to the next.
 *
 * Threads: one per object.
 */
EBPO_API uint32_t ebpo_touch_poses(const ebpo_touch *touch, double way[EBPO_TOUCH_WAY_MOST][7]);

/*
 * The proxy's way in the last tick, from where it was to where it is: segments between way[0] and
 * way[n - 1], none of which meets a face. Returns n, which is 1 if it stayed, 0 before the first
 * tick.
 *
 * Threads: one per object.
 */
EBPO_API uint32_t ebpo_touch_way(const ebpo_touch *touch, double way[EBPO_TOUCH_WAY_MOST][3]);

/* What a probe senses of the model around a place. */
typedef struct ebpo_touch_sensed {
    /*
     * Of solids negative inside. Right to some roundings of the coordinates with EBPO_TOUCH_CLOSE,
     * else NAN: only the bounds are known. The colour for it is ebpo_map_colour's.
     */
    double distance;

    /*
     * The distance is certainly within, signed as it is; from -hi to hi where it is not known
     * whether the place is inside.
     */
    double lo, hi;

    /* Unit vector, of solids outward: as in ebpo_touch_result if a face is within `look`; else that
     * of the nearest face of a moment ago, or (0, 0, 0) if there was none. */
    double normal[3];

    /* The nearest face within `look` as in ebpo_touch_result; else EBPO_NO_FACE. */
    uint64_t face;
    double point[3], weight[3];

    /* An ebpo_where; of surfaces EBPO_OUT. */
    int32_t where;

    /* ebpo_touch_flag bits. */
    uint32_t flags;

    /* Faces that the tick has looked at. */
    uint64_t work;
} ebpo_touch_sensed;

/*
 * One tick of a probe, which nothing stops: how far its place is from the model, by what is in
 * memory. That is
 *   - the faces around, and on which side of each the probe has gone through it, by exact
 *     arithmetic: within `look` of a face the answer is known to rounding;
 *   - the first levels of the octree, at most 2^17 nodes: which cells have faces, and in which
 *     cells without the solid is;
 *   - the exact answer for a place where the probe was a moment ago, from the loading thread: the
 *     distance has changed by no more than the way since.
 * Bounds are what all three allow. Time, locks, memory and reading as in ebpo_touch_move.
 *
 * Threads: one per object.
 */
EBPO_API void ebpo_touch_sense(ebpo_touch *touch, const double place[3], ebpo_touch_sensed *out);

/* A tick of a tool. */
typedef struct ebpo_touch_turned {
    /* Where the tool is on the free side: its place, and its turn, a unit quaternion x, y, z, w. */
    double proxy[3], turn[4];

    /* What the device should push and turn with, in the axes of the model; the torque is about the
     * tool's place. 0 unless EBPO_TOUCH_CONTACT. */
    double force[3], torque[3];

    /* How far the hand is behind the proxy if they touch: the way between them that contacts hold
     * back, with angles as lengths (see ebpo_touch_turn). Else 0. */
    double depth;

    /* Of the point that is closest to a face, if one is within 2 skins: its number in the tool
     * (EBPO_NO_FACE: none), the face's as in ebpo_distance_result, and the unit vector from the
     * face to it. */
    uint64_t point, face;
    double normal[3];

    /* Pairs of a point and a face that are so close; at most 256 are told. */
    uint64_t contacts;

    /* Nodes that the tick has looked at, and six for each face. */
    uint64_t work;

    /* ebpo_touch_flag bits. */
    uint32_t flags;
    uint32_t reserved;
} ebpo_touch_turned;

/*
 * One tick of a tool: the device is at `place`, turned by the quaternion x, y, z, w, of any length.
 * Of the tool's points none goes through a face, nor closer to one than half a skin: every step of
 * each is decided as the ball's are. Between its points a tool is nothing: they should be closer to
 * each other than what is to be felt.
 *
 * Turning counts as its angle times the tool's arm, the root of the mean square of the points'
 * distances from the tool's place. Of all ways that the points in contact allow, the proxy takes
 * the one that ends nearest to the hand; force and torque are those of a spring of `stiffness` for
 * what they hold back (for an angle, stiffness times arm^2), and weaker where the hand would be
 * given energy, as for ebpo_touch_move: also in the lengths of turning.
 *
 * Time is bounded as there. Points that cannot have come close since they were looked at cost next
 * to nothing. Where many are close and there is more to do than a tick can, the next ones go on
 * with it (EBPO_TOUCH_SHORT), and the tool stays where it is until then.
 *
 * Sources: Ortega, Redon and Coquillart 2007 (six degrees of freedom, the way by Gauss'
 * principle); McNeely, Puterbaugh and Troy 1999 (points for a tool); Barbic and James 2008 (points
 * in clusters, of which only those are looked at that can have come close).
 *
 * Threads: one per object.
 */
EBPO_API void ebpo_touch_turn(ebpo_touch *touch, const double place[3], const double turn[4],
                              ebpo_touch_turned *out);

/*
 * Lifts the hand and puts it elsewhere, a tool without turning it; waits until that is loaded. Not
 * for a tick.
 *
 * Errors are those of ebpo_touch_new. After a failure the hand is where it was.
 *
 * Threads: one per object.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_touch_place(ebpo_touch *touch, const double place[3],
                                                    ebpo_error *error);

/*
 * What has kept the thread from loading: it has stopped, and the hand stays in what is there. Ticks
 * tell that it has by EBPO_TOUCH_STOPPED. Takes a lock: not for a tick.
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

    /* Ticks with EBPO_TOUCH_STOPPED. */
    uint64_t stopped;
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
