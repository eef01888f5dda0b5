/* SPDX-License-Identifier: MIT
 * Computes haptic forces for a device that explores a model, at a steady rate with a deadline for
 * each step.
 *
 *   Making    ebpo_haptic_new, ebpo_haptic_new_posed (several models), ebpo_haptic_free
 *
 *   A step    ebpo_haptic_step_ball, ebpo_haptic_ball_path: a ball
 *             ebpo_haptic_step_probe: a probe, which is a point without collisions
 *             ebpo_haptic_step_tool, ebpo_haptic_tool_path: a tool of many points,
 *             with force and torque
 *
 *   Other     ebpo_haptic_reset, ebpo_haptic_check, ebpo_haptic_get_stats
 *
 *     ebpo_haptic *haptic = NULL;
 *     ebpo_haptic_ball_result result;
 *     ebpo_haptic_new(model, NULL, start, &haptic, &error);
 *     for (;;) {
 *         ebpo_haptic_step_ball(haptic, device_position, &result);
 *         send(result.force);
 *     }
 *
 * The *proxy* is a ball (or a point, or a tool) that follows the haptic device. If the device
 * passes through a face, the proxy stays on the side from which it came. The proxy's centre moves
 * along segments. Exact arithmetic ensures that no segment intersects a face, so the proxy passes
 * through no face, at any speed, and however thin the solid is. Faces stop the proxy from both
 * sides, so surfaces work like solids.
 *
 * A *haptic step* is one cycle of the force computation. A step uses only data in memory: a bounded
 * number of faces in a box around the device. A step takes no lock, allocates no memory and reads
 * no file. A separate thread loads the next box ahead of the device, and passes the box to the
 * steps by one atomic exchange. If the device leaves the box before the next box is loaded, the
 * proxy waits at the boundary of the box (EBPO_HAPTIC_WAITING), so deadlines are met. If no further
 * box can be loaded, because reading failed or there are too many faces, steps report
 * EBPO_HAPTIC_STOPPED.
 *
 * Methods: EBP 2017, section 4.5; Zilles and Salisbury 1995 (proxy that is a point, "god-object");
 * Ruspini, Kolarov and Khatib 1997 (proxy that is a ball).
 */
#ifndef EBPO_HAPTIC_H
#define EBPO_HAPTIC_H

#include <ebpo/pose.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A proxy, its box of faces and the thread that loads faces. */
typedef struct ebpo_haptic ebpo_haptic;

/* Kind of a haptic object, with the step function that is allowed for it. */
typedef enum ebpo_haptic_kind {
    EBPO_HAPTIC_BALL = 0,  /* ebpo_haptic_step_ball */
    EBPO_HAPTIC_PROBE = 1, /* ebpo_haptic_step_probe */
    EBPO_HAPTIC_TOOL = 2   /* ebpo_haptic_step_tool */
} ebpo_haptic_kind;

/* Options of ebpo_haptic_new. */
typedef struct ebpo_haptic_options {
    size_t struct_size;

    /*
     * Radius of the ball in the model's unit, at least 0. 0: the ball is a point. The option
     * `faces` must be at least the number of faces whose distance from the device is at most the
     * radius plus `search_radius`. A step tests
     * at most 512 of these faces, in the order in which the ball may touch them. If there are more
     * faces, the next steps test the remaining faces.
     */
    double radius;

    /*
     * Additional distance that the proxy keeps from faces because of rounding, in the model's unit.
     * 0: 2^-20 of the diagonal of the model's root cell. Any other value must be at least 2^-30 of
     * this diagonal, and at least 2^-42 of the greatest coordinate and of the radius.
     */
    double skin;

    /*
     * Search distance for the nearest face, in the model's unit, at least 0. Faces within this
     * distance of the ball contribute to `normal` of the result; nearer faces contribute more. 0
     * selects a default distance: 3 times the diagonal of the root cell, divided by the square root
     * of the number of faces. If all edges have similar lengths, the default distance is a few edge
     * lengths.
     */
    double search_radius;

    /*
     * stiffness: force per unit of depth. damping: force per unit of the device's speed during
     * contact; the speed is in the model's unit per second. Both are at least 0.
     */
    double stiffness, damping;

    /*
     * Coefficient of Coulomb friction, at least 0. The proxy slides if the tangential force exceeds
     * the normal force times this coefficient.
     */
    double friction;

    /* Seconds between steps; above 0. */
    double step_seconds;

    /*
     * Maximum number of faces of a box; 64 to 2^20. Four boxes are in memory. They take about 550
     * bytes per face in total, besides the model's budget. A probe also keeps up to 8 MiB of nodes.
     */
    uint64_t faces;

    /*
     * For a tool: [point_count][3] points in the tool's coordinates, which are copied; 1 to 10,000
     * points. Each point stays on the side of a face from which it came; points need no normals.
     * For a ball or a probe: NULL and 0.
     */
    const double (*points)[3];
    uint64_t point_count;

    /* ebpo_haptic_kind */
    uint64_t kind;
} ebpo_haptic_options;

#define EBPO_HAPTIC_OPTIONS_INIT                                                      \
    {                                                                                 \
        sizeof(ebpo_haptic_options), 0, 0, 0, 400, 0.4, 0, 0.001, 1 << 14, NULL, 0, 0 \
    }

/*
 * Makes a haptic object at a position and starts to load the faces around the position.
 *
 * model      must outlive the object. Contexts may use the model at the same time. The model's
 *            budget limits loading (ebpo_model_options.memory)
 * position   three finite doubles. Ball: outside the solid, and the distance from every
 *            face must be greater than the radius plus 1.5 times `skin`. Tool: each point of the
 * tool must meet these conditions, with radius 0. Probe: any position
 *
 * EBPO_E_ARGUMENT: an option or the position is not valid. EBPO_E_UNSUPPORTED: coordinates are
 * beyond 2^200. EBPO_E_ABSENT: the file has no mesh, or is a subset without the surroundings of the
 * position. EBPO_E_LIMIT: the budget is too small (ebpo_model_new). Also the errors of reading
 * (base.h).
 *
 * Threads: any; the function starts another thread.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_haptic_new(ebpo_model *model,
                                                   const ebpo_haptic_options *options,
                                                   const double position[3], ebpo_haptic **out,
                                                   ebpo_error *error);

/* A model at a pose. */
typedef struct ebpo_haptic_instance {
    ebpo_model *model;
    ebpo_pose pose;
} ebpo_haptic_instance;

/*
 * Makes a haptic object for instances of models, which it touches together: its faces are the posed
 * faces (pose.h) of all instances, and its lengths are in the unit of the world. All guarantees of
 * haptic steps hold for these faces. Instances may intersect and share faces. A position is inside
 * if it is inside one of the instances; a probe's distance is that from the nearest face of all
 * instances. Default lengths use the box around all instances instead of the root cell, and the
 * least default `search_radius` of all instances.
 *
 * instances   [count] are copied; count is 1 to 2^32 - 1. Instances may share a model. The models
 *             must outlive the object. A step of a probe takes longer for each instance
 *
 * Errors are those of ebpo_haptic_new. EBPO_E_ARGUMENT: also for a pose that its model cannot have
 * (ebpo_pose_check).
 *
 * Threads: any; the function starts another thread.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_haptic_new_posed(const ebpo_haptic_instance *instances,
                                                         uint64_t count,
                                                         const ebpo_haptic_options *options,
                                                         const double position[3],
                                                         ebpo_haptic **out, ebpo_error *error);

/*
 * Frees the object and ends its thread, after the current load.
 *
 * Threads: one at a time per object.
 */
EBPO_API void ebpo_haptic_free(ebpo_haptic *haptic);

/* Flags of the result of a haptic step, as bits. */
typedef enum ebpo_haptic_flag {
    /* A face keeps the proxy away from the device. */
    EBPO_HAPTIC_CONTACT = 1,

    /* The proxy waits at the boundary of the loaded box. Waiting causes no force. */
    EBPO_HAPTIC_WAITING = 2,

    /*
     * The path of the proxy is incomplete, because the step reached its work limit before the end
     * of the path. The next step continues the path; until then, a ball in contact stays in contact
     * with the same faces.
     */
    EBPO_HAPTIC_PATH_UNFINISHED = 4,

    /*
     * Not all faces within `search_radius` were used for the nearest face, its distance and the
     * normal: the farthest faces were not tested, or some faces were not loaded. The path of the
     * proxy is not affected.
     */
    EBPO_HAPTIC_FACES_OMITTED = 8,

    /* The device position was not finite; the previous position was used. */
    EBPO_HAPTIC_BAD_INPUT = 16,

    /* The step function is for another kind of object; nothing was done. */
    EBPO_HAPTIC_WRONG_KIND = 32,

    /* ebpo_haptic_step_probe: the distance is exact except for rounding. */
    EBPO_HAPTIC_ACCURATE = 64,

    /*
     * Loading has failed and ended permanently, see ebpo_haptic_check. The proxy moves only in the
     * loaded box. All later steps also have this flag.
     */
    EBPO_HAPTIC_STOPPED = 128
} ebpo_haptic_flag;

/* Result of a haptic step of a ball. */
typedef struct ebpo_haptic_ball_result {
    /* Centre of the proxy's ball. */
    double proxy[3];

    /* Force for the device; 0 without EBPO_HAPTIC_CONTACT. */
    double force[3];

    /*
     * Unit vector away from the near faces: weighted mean of their normals on the proxy's side. The
     * vector turns steadily when the proxy passes an edge. (0, 0, 0) if no face is within
     * `search_radius`.
     */
    double normal[3];

    /*
     * In contact: length of the vector from proxy to device. With EBPO_HAPTIC_WAITING
     * or EBPO_HAPTIC_PATH_UNFINISHED, not only faces hold the proxy back. In this case, `depth` is
     * the length of the vector's component in the directions in which faces hold it back. Without
     * contact:
     * minus the distance from the ball to the nearest face, or minus `search_radius` if no face is
     * within `search_radius`. With EBPO_HAPTIC_FACES_OMITTED, a face that was not tested may be
     * nearer.
     */
    double depth;

    /*
     * Nearest face within `search_radius`. face: index as in ebpo_distance_result (query.h);
     * EBPO_NO_FACE: no face. point: the point of the face that is nearest to the proxy. weight:
     * weights of the face's corners at this point; their sum is 1.
     */
    uint64_t face;
    double point[3], weight[3];

    /* ebpo_haptic_flag bits */
    uint32_t flags;

    /* Number of faces tested in this step. */
    uint32_t work;

    /* Index of the instance that has `face`; 0 without a face. */
    uint64_t instance;
} ebpo_haptic_ball_result;

/*
 * Computes one haptic step with the device at the position `device`. Takes bounded time, without
 * locks, allocation or reading. Results are reproducible, except after EBPO_HAPTIC_WAITING or
 * EBPO_HAPTIC_PATH_UNFINISHED. After these flags, the proxy's path depends on the times at which
 * boxes were loaded.
 *
 * The force is the force of a spring (stiffness times the vector from device to proxy), minus
 * damping times the device velocity. If the spring pushes the device away from a face, damping does
 * not turn the force towards the face: the component of the force towards the face is at most 1e-7
 * of the force's length. If needed, the force is reduced to limit the energy. For any motion, the
 * total energy given to the device is at most the energy taken from the device, plus stiffness
 * times the square of the longest step of the device.
 *
 * Threads: one at a time per object.
 */
EBPO_API void ebpo_haptic_step_ball(ebpo_haptic *haptic, const double device[3],
                                    ebpo_haptic_ball_result *out);

/* Maximum number of points (or poses) of a proxy's path in one step. */
enum { EBPO_HAPTIC_PATH_MAX = 17 };

/*
 * Gets the path of the proxy in the last step: n points path[0] to path[n - 1], joined by segments
 * that intersect no face. Returns n, which is 1 if the proxy did not move, and 0 before the first
 * step.
 *
 * Threads: one at a time per object.
 */
EBPO_API uint32_t ebpo_haptic_ball_path(const ebpo_haptic *haptic,
                                        double path[EBPO_HAPTIC_PATH_MAX][3]);

/*
 * Gets the path of a tool's proxy in the last step, as ebpo_haptic_ball_path does for a ball. Each
 * item of `path` is a position and a quaternion x, y, z, w. Between two items, each point of the
 * tool moved along a segment.
 *
 * Threads: one at a time per object.
 */
EBPO_API uint32_t ebpo_haptic_tool_path(const ebpo_haptic *haptic,
                                        double path[EBPO_HAPTIC_PATH_MAX][7]);

/* Result of a probe at a position. */
typedef struct ebpo_haptic_probe_result {
    /*
     * Signed distance, negative inside a solid. With EBPO_HAPTIC_ACCURATE: correct except for a few
     * rounding errors of the coordinates. Without this flag: NAN, because only the bounds are
     * known. ebpo_map_colour (map.h) converts a distance to a colour.
     */
    double distance;

    /*
     * Bounds of the signed distance. If lo = -hi, the position may be inside or outside.
     */
    double lo, hi;

    /*
     * Unit vector, outward for solids. If a face is within `search_radius`, it is computed as in
     * ebpo_haptic_ball_result. Otherwise it is the normal of the last nearest face of an earlier
     * step, or (0, 0, 0) if there was no such face.
     */
    double normal[3];

    /* Nearest face within `search_radius`, as in ebpo_haptic_ball_result. */
    uint64_t face;
    double point[3], weight[3];

    /* Side of the position, as ebpo_where; EBPO_OUT for surfaces. */
    int32_t where;

    /* ebpo_haptic_flag bits */
    uint32_t flags;

    /* Number of faces tested in this step. */
    uint64_t work;

    /* As in ebpo_haptic_ball_result. */
    uint64_t instance;
} ebpo_haptic_probe_result;

/*
 * Computes one haptic step of a probe, which has no collisions. The result has bounds of the
 * distance from `position` to the model. The bounds combine three sources in memory:
 * - The near faces, and the sides of these faces on which the probe is. Exact arithmetic tracks
 *   these sides. Within `search_radius` of a face, the result is exact except for rounding.
 * - The first levels of the octree, at most 2^17 nodes of all models together besides their roots.
 *   Leaves and gray nodes (nodes with children) bound the distance. White nodes (outside the solid)
 *   and black nodes (inside) give the side.
 * - The exact result for an earlier position of the probe, which the loading thread computes. Since
 *   then, the distance has changed by at most the length of the probe's path.
 *
 * Time, locks, memory and reading are as in ebpo_haptic_step_ball.
 *
 * Threads: one at a time per object.
 */
EBPO_API void ebpo_haptic_step_probe(ebpo_haptic *haptic, const double position[3],
                                     ebpo_haptic_probe_result *out);

/* Result of a haptic step of a tool. */
typedef struct ebpo_haptic_tool_result {
    /* Pose of the proxy: position, and rotation as a unit quaternion x, y, z, w. */
    double proxy[3], turn[4];

    /*
     * Force and torque for the device, along the axes of the model. The torque is about the tool's
     * position. Both are 0 without EBPO_HAPTIC_CONTACT.
     */
    double force[3], torque[3];

    /*
     * In contact: contacts prevent a part of the motion from proxy to device; the depth is the
     * length of this part. Rotations count as lengths (ebpo_haptic_step_tool). Without contact: 0.
     */
    double depth;

    /*
     * The point of the tool that is nearest to a face, if their distance is at most 2 times `skin`.
     * point: index in the tool's points; EBPO_NO_FACE: there is no such point. face: index as in
     * ebpo_distance_result. normal: unit vector from the face to the point.
     */
    uint64_t point, face;
    double normal[3];

    /*
     * Number of pairs of a point and a face whose distance is at most 2 times `skin`; at most 256.
     */
    uint64_t contacts;

    /* Number of nodes visited in this step, plus six for each tested face. */
    uint64_t work;

    /* ebpo_haptic_flag bits */
    uint32_t flags;

    /* Index of the instance that has `face`; 0 without a face. */
    uint32_t instance;
} ebpo_haptic_tool_result;

/*
 * Computes one haptic step of a tool with the device at `position`, rotated by the quaternion
 * `turn` (x, y, z, w, of any length). No point of the tool passes through a face, or comes closer
 * than half of `skin` to a face; as for a ball, exact arithmetic ensures this. The space
 * between the points is not tested. So the points must be closer to each other than the size of the
 * smallest details of the model that the user is to feel.
 *
 * A rotation counts as a length: its angle times the arm of the tool. The arm is the root mean
 * square distance of the points from the tool's position. Among all motions that the contacts
 * allow, the proxy makes the motion that ends nearest to the device. Force and torque are those of
 * a spring for the prevented motion; its stiffness is `stiffness` for translations, and `stiffness`
 * times arm^2 for angles. As in ebpo_haptic_step_ball, force and torque are reduced to limit the
 * energy; here, too, rotations count as lengths.
 *
 * Time is bounded as in ebpo_haptic_step_ball. Testing a point measures its distance from the
 * nearest face. Until the point has moved by this distance, its next tests take almost no time. If
 * many points are near faces, and their tests exceed the work limit of a step, the next steps
 * continue the tests (EBPO_HAPTIC_PATH_UNFINISHED). The tool does not move until all tests are
 * done.
 *
 * Methods: Ortega, Redon and Coquillart 2007 (six degrees of freedom, motion by Gauss' principle);
 * McNeely, Puterbaugh and Troy 1999 (points for a tool); Barbic and James 2008 (clusters of
 * points).
 *
 * Threads: one at a time per object.
 */
EBPO_API void ebpo_haptic_step_tool(ebpo_haptic *haptic, const double position[3],
                                    const double turn[4], ebpo_haptic_tool_result *out);

/*
 * Places the proxy at another position, without collisions on the way, and waits until the
 * surroundings are loaded. A tool gets the rotation 0, 0, 0, 1. The function waits, so do not call
 * it in the loop of haptic steps.
 *
 * Errors are those of ebpo_haptic_new. After a failure the position is unchanged.
 *
 * Threads: one at a time per object.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_haptic_reset(ebpo_haptic *haptic, const double position[3],
                                                     ebpo_error *error);

/*
 * Returns the error that stopped the loading thread (EBPO_HAPTIC_STOPPED). The function takes a
 * lock, so do not call it in the loop of haptic steps.
 *
 * EBPO_OK: the thread is not stopped. Other statuses: the errors of reading (base.h), EBPO_E_LIMIT,
 * EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_haptic_check(ebpo_haptic *haptic, ebpo_error *error);

/* Statistics of a haptic object since it was made. */
typedef struct ebpo_haptic_stats {
    size_t struct_size;

    /* Number of steps. */
    uint64_t step_count;

    /*
     * Number of steps with EBPO_HAPTIC_CONTACT, EBPO_HAPTIC_WAITING, EBPO_HAPTIC_PATH_UNFINISHED
     * and EBPO_HAPTIC_FACES_OMITTED.
     */
    uint64_t contacts, waiting, path_unfinished, faces_omitted;

    /*
     * loads: number of boxes that were loaded. taken: number of boxes that steps used. too_many:
     * number of boxes that were not completed, because they had too many faces.
     */
    uint64_t loads, taken, too_many;

    /*
     * faces: number of faces in the current box. work_max: maximum number of faces tested in a
     * step.
     */
    uint64_t faces, work_max;

    /*
     * energy: energy given to the device by forces minus energy taken from the device. energy_max:
     * maximum of this difference over time. longest_step: longest motion of the device in one step.
     */
    double energy, energy_max, longest_step;

    /* Memory of the boxes, and of a probe's nodes, in bytes. */
    uint64_t memory;

    /* load_seconds: total time of loading. load_seconds_max: longest time for one box. */
    double load_seconds, load_seconds_max;

    /* Number of steps with EBPO_HAPTIC_STOPPED. */
    uint64_t stopped;
} ebpo_haptic_stats;

#define EBPO_HAPTIC_STATS_INIT EBPO_SIZED(ebpo_haptic_stats)

/*
 * Gets the statistics of the object.
 *
 * Threads: one at a time per object.
 */
EBPO_API ebpo_status ebpo_haptic_get_stats(const ebpo_haptic *haptic, ebpo_haptic_stats *out);

#ifdef __cplusplus
}
#endif
#endif
