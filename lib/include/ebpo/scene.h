/* SPDX-License-Identifier: MIT
 * Makes scenes of animated rigid instances of models, and finds their collisions.
 *
 *   Making      ebpo_scene_open (a file: format-spec/scene.md), ebpo_scene_new,
 *               ebpo_scene_add_model, ebpo_scene_add_instance
 *   Contents    ebpo_scene_get_counts, ebpo_scene_get_model_facts, ebpo_scene_get_instance,
 *               ebpo_scene_get_layer, ebpo_scene_get_group, ebpo_scene_group_of,
 *               ebpo_scene_get_camera, ebpo_scene_get_stats, ebpo_scene_pair_rule
 *   Models      ebpo_scene_load, ebpo_scene_file, ebpo_scene_model
 *   In time     ebpo_scene_pose, ebpo_scene_motion, ebpo_scene_instance_box, ebpo_scene_box
 *   Collisions  ebpo_scene_pairs (boxes), ebpo_scene_find_clashes (faces),
 *               ebpo_scene_collide (two instances)
 *   As a file   ebpo_scene_report_new
 *   Over time   ebpo_scene_approach, ebpo_scene_least_distances
 *   Subsets     ebpo_scene_plan, ebpo_scene_pack
 *
 *     ebpo_scene *scene = NULL;
 *     ebpo_scene_open("plant.scene.json", NULL, &scene, &error);
 *     ebpo_scene_load(scene, NULL, &error);
 *     ebpo_scene_box(scene, 0, 10, min, max, &error);
 *     ebpo_scene_pairs(scene, 0, 10, take, NULL, &error);
 *
 * An *instance* is a model at a pose. A *route* is a list of poses with times; an instance or a
 * camera with a route moves along it. Layers and groups are named sets of instances; an instance is
 * in at most one layer and in any number of groups. A *rule* states that certain pairs of instances
 * are ignored, or that they must keep a *clearance* (minimum distance).
 *
 * Models, instances and cameras have indices in the order in which they were added. Times are in
 * seconds. Before the first time of its route, an instance has the first pose of the route. After
 * the last time of the route, it has the last pose. Poses, boxes and pairs are the same on every
 * machine.
 */
#ifndef EBPO_SCENE_H
#define EBPO_SCENE_H

#include <ebpo/collide.h>
#include <ebpo/pose.h>
#include <ebpo/subset.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Models, instances, routes, cameras and rules. */
typedef struct ebpo_scene ebpo_scene;

/* ---- making ---- */

/* Options of ebpo_scene_open and ebpo_scene_parse. */
typedef struct ebpo_scene_options {
    size_t struct_size;

    /*
     * max_bytes: maximum size of the scene file in bytes; 0: 64 MiB. max_pose_bytes: maximum total
     * size, in bytes, of the pose files that the scene file names; 0: 256 MiB.
     */
    uint64_t max_bytes, max_pose_bytes;

    /*
     * Maximum number of values (objects, arrays, strings, numbers) in the scene file. A value takes
     * about 250 bytes of memory during reading. 0: 4 million.
     */
    uint64_t max_values;

    /*
     * True: the files that the scene names may be anywhere. False: these files must be in the
     * scene's folder or below; their paths must be relative and without "..", and no symbolic link
     * may lead out of the folder.
     */
    bool allow_outside;

    /* True: models on web servers are allowed. The scene must state the digests of these models. */
    bool remote;

    uint8_t reserved[6];
} ebpo_scene_options;

#define EBPO_SCENE_OPTIONS_INIT EBPO_SIZED(ebpo_scene_options)

/*
 * Reads a scene file and its pose files, but no model.
 *
 * EBPO_E_FORMAT: the file is not a scene file; the message has the line and the path of the JSON
 * member, such as "line 12: instances[3].pose.scale". EBPO_E_VERSION: the file has another major
 * version. EBPO_E_LIMIT: the scene exceeds max_bytes, max_pose_bytes or max_values. EBPO_E_IO.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_open(const char *path,
                                                   const ebpo_scene_options *options,
                                                   ebpo_scene **out, ebpo_error *error);

/*
 * Reads a scene as ebpo_scene_open does, from `size` bytes of text.
 *
 * name     name of the scene in messages
 * folder   base folder of relative paths; NULL: the current folder
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_parse(const char *text, size_t size, const char *name,
                                                    const char *folder,
                                                    const ebpo_scene_options *options,
                                                    ebpo_scene **out, ebpo_error *error);

/*
 * Makes a scene without models.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_new(ebpo_scene **out, ebpo_error *error);

/*
 * Frees a scene, and closes its files and models.
 *
 * Threads: one at a time per scene.
 */
EBPO_API void ebpo_scene_free(ebpo_scene *scene);

/*
 * Adds a model; ebpo_scene_load opens its file. Texts are copied.
 *
 * name     1 to 255 bytes of UTF-8, unique among models
 * path     path or URL of an .ebpo.h5 file
 * digest   content_sha256 that the file must have; NULL: any
 * number   receives the index of the model; may be NULL
 *
 * EBPO_E_ARGUMENT: the name is not valid.
 *
 * Threads: one at a time per scene.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_add_model(ebpo_scene *scene, const char *name,
                                                        const char *path, const uint8_t digest[32],
                                                        uint64_t *number, ebpo_error *error);

/* Value of an index if there is no route, no layer or no group. */
#define EBPO_SCENE_NONE UINT64_MAX

/* An instance of a model. */
typedef struct ebpo_scene_instance {
    size_t struct_size;

    /* Name of the instance: 1 to 255 bytes of UTF-8, unique among instances. */
    const char *name;

    /* Index of the model. */
    uint64_t model;

    /*
     * Pose in the world. With a route: pose relative to the coordinate system that moves along the
     * route.
     */
    ebpo_pose pose;

    /* Index of the route, and of the layer (ebpo_scene_get_layer), or EBPO_SCENE_NONE. */
    uint64_t route, layer;

    /*
     * True: pairs of this instance and another fixed instance are not tested. An instance with a
     * route must not be fixed.
     */
    bool fixed;

    uint8_t reserved[7];
} ebpo_scene_instance;

#define EBPO_SCENE_INSTANCE_INIT                                                                \
    {                                                                                           \
        sizeof(ebpo_scene_instance), NULL, 0, EBPO_POSE_INIT, EBPO_SCENE_NONE, EBPO_SCENE_NONE, \
            false,                                                                              \
        {                                                                                       \
            0                                                                                   \
        }                                                                                       \
    }

/*
 * Adds an instance of a model. If the model is loaded, boxes computed later include the instance.
 *
 * number   receives the index of the instance; may be NULL
 *
 * EBPO_E_ARGUMENT: the name, model, route, layer or pose is not valid, or the instance is fixed and
 * has a route. If the model is loaded, the pose must pass ebpo_pose_check.
 *
 * Threads: one at a time per scene.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_add_instance(ebpo_scene *scene,
                                                           const ebpo_scene_instance *instance,
                                                           uint64_t *number, ebpo_error *error);

/* ---- contents ---- */

/* Counts of a scene (ebpo_scene_get_counts). */
typedef struct ebpo_scene_counts {
    size_t struct_size;

    /* Number of models, of instances, of layers, of groups, of routes and of cameras. */
    uint64_t models, instances, layers, groups, routes, cameras;

    /*
     * poses: number of poses of all routes. ignored, clearances: number of entries of "ignore" and
     * of "clearance" in the scene file. fixed: number of fixed instances.
     */
    uint64_t poses, ignored, clearances, fixed;

    /* First and last time of all routes, in seconds. Both are 0 if no instance moves. */
    double begin, end;
} ebpo_scene_counts;

#define EBPO_SCENE_COUNTS_INIT EBPO_SIZED(ebpo_scene_counts)

/*
 * Gets the counts of a scene.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_scene_get_counts(const ebpo_scene *scene, ebpo_scene_counts *out);

/* Properties of a model in a scene (ebpo_scene_get_model_facts). */
typedef struct ebpo_scene_model_facts {
    size_t struct_size;

    /* Name and path as in the scene file; both texts are valid until the scene is freed. */
    const char *name, *path;

    /* content_sha256 that the file must have. All bytes are 0 if the scene does not state it. */
    uint8_t digest[32];

    /* Number of instances of the model. */
    uint64_t instances;

    /*
     * loaded: true if the file of the model is open. In this case `min` and `max` are the corners
     * of the box of its faces, in the model's unit.
     */
    bool loaded;
    uint8_t reserved[7];
    double min[3], max[3];
} ebpo_scene_model_facts;

#define EBPO_SCENE_MODEL_FACTS_INIT EBPO_SIZED(ebpo_scene_model_facts)

/*
 * Gets the properties of a model.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_scene_get_model_facts(const ebpo_scene *scene, uint64_t model,
                                                ebpo_scene_model_facts *out);

/* Statistics of the models of a scene (ebpo_scene_get_stats). */
typedef struct ebpo_scene_stats {
    size_t struct_size;

    /* files: number of open files. models: number of files with a model in memory. */
    uint64_t files, models;

    /* Memory of the models that `models` counts, in bytes. */
    uint64_t memory;

    /* Number of bytes read from the files, and number of reads. */
    uint64_t bytes_read, reads;

    /* Number of subtrees that were loaded for queries of models that are partly in memory. */
    uint64_t loads;
} ebpo_scene_stats;

#define EBPO_SCENE_STATS_INIT EBPO_SIZED(ebpo_scene_stats)

/*
 * Gets statistics of the models so far.
 *
 * Threads: one at a time per scene.
 */
EBPO_API ebpo_status ebpo_scene_get_stats(const ebpo_scene *scene, ebpo_scene_stats *out);

/*
 * Gets an instance as it was added.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_scene_get_instance(const ebpo_scene *scene, uint64_t instance,
                                             ebpo_scene_instance *out);

/*
 * Returns the name of a layer, or NULL if `layer` is out of range. The text is valid until the
 * scene is freed.
 *
 * Threads: any.
 */
EBPO_API const char *ebpo_scene_get_layer(const ebpo_scene *scene, uint64_t layer);

/*
 * Returns the name of a group, or NULL if `group` is out of range. The text is valid until the
 * scene is freed.
 *
 * Threads: any.
 */
EBPO_API const char *ebpo_scene_get_group(const ebpo_scene *scene, uint64_t group);

/*
 * Returns the index of the nth group (from 0) of an instance. Returns EBPO_SCENE_NONE if the
 * instance has no nth group, or if `instance` is out of range.
 *
 * Threads: any.
 */
EBPO_API uint64_t ebpo_scene_group_of(const ebpo_scene *scene, uint64_t instance, uint64_t nth);

/* A perspective camera of a scene (ebpo_scene_get_camera). */
typedef struct ebpo_scene_camera {
    size_t struct_size;
    /* Name of the camera, valid until the scene is freed. */
    const char *name;

    /*
     * Position of the eye, position of the point that the eye looks at, and upward direction. They
     * are in world coordinates. With a route, they are relative to the coordinate system that moves
     * along the route.
     */
    double eye[3], target[3], up[3];

    /* Vertical field of view in degrees. */
    double fov;

    /* Size of the image in pixels. */
    uint32_t width, height;

    /* Index of the route, or EBPO_SCENE_NONE. */
    uint64_t route;
} ebpo_scene_camera;

#define EBPO_SCENE_CAMERA_INIT EBPO_SIZED(ebpo_scene_camera)

/*
 * Gets a camera.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_scene_get_camera(const ebpo_scene *scene, uint64_t camera,
                                           ebpo_scene_camera *out);

/*
 * Returns true if a pair of instances is to be tested: the scene does not ignore the pair, the
 * instances are different, and at most one of them is fixed. If the result is true, *clearance is
 * the largest clearance (minimum distance) that the rules of the scene require for the pair, in the
 * world's unit; 0: no clearance. Returns false if an index is out of range.
 *
 * Threads: any.
 */
EBPO_API bool ebpo_scene_pair_rule(const ebpo_scene *scene, uint64_t a, uint64_t b,
                                   double *clearance);

/* ---- models ---- */

/* Options of ebpo_scene_load. */
typedef struct ebpo_load_options {
    size_t struct_size;

    /*
     * Maximum memory, in bytes, of all queried models together (ebpo_budget_new). The first call
     * with a value other than 0 sets this maximum. 0: no maximum.
     */
    uint64_t memory;

    ebpo_progress progress;

    /* As in ebpo_open_options. */
    uint64_t max_expansion;

    /* As in ebpo_model_options, for all models that ebpo_scene_model makes after this call. */
    int cut_level;
    unsigned threads;
} ebpo_load_options;

#define EBPO_LOAD_OPTIONS_INIT                                 \
    {                                                          \
        sizeof(ebpo_load_options), 0, { NULL, NULL }, 0, -1, 0 \
    }

/*
 * Opens the files of models that are not open yet. A path that several models share is opened once.
 * Compares the digests and computes the boxes. Only the headers of the files are read. Files of
 * models without instances are also opened.
 *
 * EBPO_E_FORMAT: a file is not an .ebpo.h5 file, its digest differs from that in the scene, or a
 * link leads out of the scene's folder (ebpo_scene_options.allow_outside). EBPO_E_ARGUMENT: an
 * instance has a pose that its model cannot have; the message names the instance. EBPO_E_IO.
 *
 * Threads: one at a time per scene.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_load(ebpo_scene *scene,
                                                   const ebpo_load_options *options,
                                                   ebpo_error *error);

/*
 * Returns the open file of a model, which the scene owns. Returns NULL if the model is not loaded
 * (ebpo_scene_load), or if `model` is out of range. Models with the same path share the file.
 *
 * Threads: any.
 */
EBPO_API const ebpo_file *ebpo_scene_file(const ebpo_scene *scene, uint64_t model);

/*
 * Gets the ebpo_model for queries of a model (query.h). The scene owns the ebpo_model, and makes it
 * at the first call. All instances of a file share one ebpo_model.
 *
 * EBPO_E_ARGUMENT: the model is not loaded (ebpo_scene_load). Also the errors of ebpo_model_new.
 *
 * Threads: one at a time per scene.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_model(ebpo_scene *scene, uint64_t model,
                                                    ebpo_model **out, ebpo_error *error);

/* ---- in time ---- */

/*
 * Computes the pose of an instance at a finite time.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_pose(const ebpo_scene *scene, uint64_t instance,
                                                   double time, ebpo_pose *out, ebpo_error *error);

/*
 * Computes an upper bound of the distance that a point of the instance's model moves between two
 * times in from .. to, in the world's unit. The bound is valid for all points and all pairs of
 * times, and also for posed coordinates, which are rounded. INFINITY: the route jumps. 0: the
 * instance does not move.
 *
 * EBPO_E_ARGUMENT: the model is not loaded, a time is not finite, or `from` is after `to`.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_motion(const ebpo_scene *scene, uint64_t instance,
                                                     double from, double to, double *length,
                                                     ebpo_error *error);

/*
 * Computes a box that contains the instance's posed vertices at all times in from .. to. Errors are
 * those of ebpo_scene_motion.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_instance_box(const ebpo_scene *scene,
                                                           uint64_t instance, double from,
                                                           double to, double min[3], double max[3],
                                                           ebpo_error *error);

/*
 * Computes a box that contains all instances at all times in from .. to. If the scene has no
 * instances, `min` is INFINITY and `max` is -INFINITY. EBP 2017, 5.6.1, uses a different box: it
 * has four times the extents, and its centre is the mean of the centres of mass.
 *
 * Errors are those of ebpo_scene_motion. EBPO_E_ARGUMENT: also if the model of an instance was
 * added after the last ebpo_scene_load.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_box(const ebpo_scene *scene, double from, double to,
                                                  double min[3], double max[3], ebpo_error *error);

/* ---- collisions ---- */

/* Two instances, a < b, whose boxes are at most `clearance` apart on each axis. */
typedef struct ebpo_scene_pair {
    uint64_t a, b;
    double clearance;
} ebpo_scene_pair;

/*
 * Callback that gets pairs, which are valid until it returns. The callback returns false to stop
 * the call.
 */
typedef bool (*ebpo_scene_pairs_fn)(void *user, const ebpo_scene_pair *pairs, uint64_t count);

/*
 * Broad phase: finds the pairs for which ebpo_scene_pair_rule returns true, and whose boxes
 * (ebpo_scene_instance_box) are at most their clearance apart on each axis. Pairs are in ascending
 * order of a, then b. If this function does not find a pair for which ebpo_scene_pair_rule returns
 * true, the two instances are farther apart than their clearance at all times in from .. to.
 *
 * EBPO_E_ARGUMENT: a model is not loaded, a time is not finite, or `from` is after `to`.
 * EBPO_E_LIMIT: more than 2^23 pairs.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_pairs(const ebpo_scene *scene, double from, double to,
                                                    ebpo_scene_pairs_fn take, void *user,
                                                    ebpo_error *error);

/* Kind of a clash. */
typedef enum ebpo_clash_kind {
    EBPO_CLASH_NONE = 0,     /* no faces intersect; one instance may be inside the other */
    EBPO_CLASH_NEAR = 1,     /* no faces intersect, but some are nearer than the clearance */
    EBPO_CLASH_TOUCHING = 2, /* faces have common points, but no common interior points */
    EBPO_CLASH_COPLANAR = 3, /* faces are coplanar and overlap, but no faces cross */
    EBPO_CLASH_CROSSING = 4, /* faces cross */

    /*
     * Kinds that are possible only with ebpo_scene_clash_options.relate. If one of them applies, it
     * replaces the kinds from EBPO_CLASH_NONE to EBPO_CLASH_CROSSING.
     */
    EBPO_CLASH_PROTRUDING = 5, /* one instance is partly inside the other, which is a solid */
    EBPO_CLASH_ENCLOSED = 6,   /* one instance is inside the other, a solid; faces may touch */
    EBPO_CLASH_DUPLICATE = 7   /* both instances are the same point set */
} ebpo_clash_kind;

/*
 * Two instances, a < b, that clash: their faces intersect or are too near, or one instance is
 * inside the other.
 */
typedef struct ebpo_scene_clash {
    uint64_t a, b;

    /*
     * A pair of intersecting faces, as source indices: the pair with the lowest indices if all
     * pairs are counted (ebpo_scene_clash_options.count), else the pair of ebpo_collide_first. If
     * no faces intersect: the nearest pair of faces.
     */
    uint64_t face_a, face_b;

    /*
     * Number of pairs of faces of each kind (ebpo_pair_kind). With ebpo_scene_clash_options.count,
     * all pairs are counted; otherwise the pairs that were found until `kind` was certain.
     */
    uint64_t touching, crossing, coplanar;

    /*
     * clearance: the clearance that the scene requires for the pair. distance: exact distance
     * between the faces if `kind` is EBPO_CLASH_NEAR, or if one instance is inside the other and no
     * faces intersect; in other cases 0. Both are in the world's unit.
     */
    double clearance, distance;

    /* ebpo_clash_kind. Without `relate`: the greatest kind of any pair of faces. */
    int32_t kind;

    /*
     * With ebpo_scene_clash_options.relate: ebpo_relation of a to b. Without it:
     * EBPO_RELATION_UNDECIDED.
     */
    int32_t relation;

    /*
     * With ebpo_scene_clash_options.count: number of intersection lines (ebpo_collide_polylines).
     * UINT64_MAX: the collider's memory is too small for all segments.
     */
    uint64_t contacts;

    /*
     * With ebpo_scene_clash_options.locations: a common point of face_a and face_b, or the middle
     * of their nearest points. In the world's coordinates, approximated in doubles. Without this
     * option: NAN.
     */
    double location[3];

    /*
     * Corners of a box that contains `location` and, with ebpo_scene_clash_options.count, all
     * contact segments.
     */
    double location_min[3], location_max[3];

    /*
     * Depth of a in b, and of b in a (ebpo_collide_depth), with the tolerance
     * ebpo_scene_clash_options.depth. The bounds are 0 and INFINITY if the depth was not requested,
     * or if the instance that could contain the other instance is a surface.
     */
    ebpo_value_bounds depth[2];
} ebpo_scene_clash;

/*
 * Callback that gets clashes, which are valid until it returns. The callback returns false to stop
 * the call.
 */
typedef bool (*ebpo_scene_clashes_fn)(void *user, const ebpo_scene_clash *clashes, uint64_t count);

/* Options of ebpo_scene_find_clashes. */
typedef struct ebpo_scene_clash_options {
    size_t struct_size;

    ebpo_progress progress;

    unsigned threads;

    /* True: counts all pairs of intersecting faces, and the intersection lines. */
    bool count;

    /* True: computes `location`, `location_min` and `location_max` of ebpo_scene_clash. */
    bool locations;

    /*
     * True: computes the relation (ebpo_collide_relation) of all tested pairs. This takes about 60
     * bytes per face of both models, for each thread.
     */
    bool relate;

    uint8_t reserved;

    /*
     * Tolerance of `depth` of ebpo_scene_clash, in the world's unit. A tolerance above 0 implies
     * `relate`. 0: computes no depths.
     */
    double depth;
} ebpo_scene_clash_options;

#define EBPO_SCENE_CLASH_OPTIONS_INIT EBPO_SIZED(ebpo_scene_clash_options)

/*
 * Narrow phase: finds the pairs of ebpo_scene_pairs whose faces intersect at a time, or are nearer
 * than the clearance. Decisions are exact on posed coordinates (collide.h). Clashes are in
 * ascending order of a, then b. If one instance is inside the other and no faces are near, the pair
 * is reported only with options.relate. The function makes the models that it needs, as
 * ebpo_scene_model does.
 *
 * tested   receives the number of tested pairs; may be NULL
 *
 * EBPO_E_ARGUMENT: a model is not loaded, or the time, a pose (ebpo_pose_check) or options.depth is
 * not valid. EBPO_E_ABSENT: a model has no mesh, or is a subset without required faces (`relate`
 * requires all faces). EBPO_E_LIMIT: `memory` of ebpo_load_options is too small. Also the errors of
 * reading (base.h).
 *
 * Threads: one at a time per scene.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_find_clashes(ebpo_scene *scene, double time,
                                                           const ebpo_scene_clash_options *options,
                                                           ebpo_scene_clashes_fn take, void *user,
                                                           uint64_t *tested, ebpo_error *error);

/*
 * Finds all pairs of intersecting faces of two instances at a time, as ebpo_collide_all does for
 * their models. Errors are those of ebpo_scene_find_clashes.
 *
 * Threads: one at a time per scene.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_collide(ebpo_scene *scene, uint64_t a, uint64_t b,
                                                      double time, unsigned threads,
                                                      ebpo_pairs_fn take, void *user,
                                                      ebpo_error *error);

/* ---- as a file ---- */

/* A file of the clashes at several times, while it is being written. */
typedef struct ebpo_scene_report ebpo_scene_report;

/* One time of a report, with statistics of ebpo_scene_find_clashes at this time. */
typedef struct ebpo_scene_frame {
    /* The time in the scene, in seconds. */
    double time;

    /* tested: number of tested pairs. nanoseconds: duration of the tests. */
    uint64_t tested, nanoseconds;

    /*
     * Number of bytes read, of models made, and of subtrees loaded during the tests
     * (ebpo_scene_stats).
     */
    uint64_t bytes_read, models, loads;
} ebpo_scene_frame;

/*
 * Begins an HDF5 file, which HDF5 1.8 and later can read. The file appears atomically when
 * ebpo_scene_report_finish is called. Each array has an attribute `meaning` with a description.
 *
 *   /instances/names       uint8 [bytes]  names in order, each terminated by 0
 *   /instances/model       int64 [i]      index in /models/names
 *   /models/names          uint8 [bytes]
 *   /frames/time           double [n]     in seconds
 *   /frames/first_clash    int64 [n]      first index in /clashes
 *   /frames/clashes        int64 [n]      number of clashes
 *   /frames/tested, nanoseconds, bytes_read, models, loads   int64 [n]   members of
 *                           ebpo_scene_frame
 *   /clashes/frame         int64 [m]
 *   /clashes/instances     int64 [m][2]   a and b
 *   /clashes/kind          uint8 [m]      ebpo_clash_kind
 *   /clashes/relation      uint8 [m]      ebpo_relation
 *   /clashes/faces         int64 [m][2]   of a and of b, source indices; -1: none
 *   /clashes/pairs         int64 [m][3]   number of pairs of faces: touching, coplanar, crossing
 *   /clashes/contacts      int64 [m]      -1: not computed
 *   /clashes/clearance, distance   double [m]
 *   /clashes/location      double [m][3]  NAN: not requested
 *   /clashes/location_box  double [m][6]  lower corner, upper corner
 *   /clashes/depth         double [m][4]  bounds of the depth of a in b, then of b in a
 *
 * EBPO_E_IO: the file cannot be written.
 *
 * Threads: one at a time per scene. The scene must not change until the report is freed.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_report_new(const ebpo_scene *scene, const char *path,
                                                         ebpo_scene_report **out,
                                                         ebpo_error *error);

/*
 * Adds the results of ebpo_scene_find_clashes at one time. EBPO_E_IO.
 *
 * Threads: one at a time per report.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_report_add(ebpo_scene_report *report,
                                                         const ebpo_scene_frame *frame,
                                                         const ebpo_scene_clash *clashes,
                                                         uint64_t count, ebpo_error *error);

/*
 * Completes the file. EBPO_E_IO.
 *
 * Threads: one at a time per report.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_report_finish(ebpo_scene_report *report,
                                                            ebpo_error *error);

/*
 * Frees a report. An unfinished file is removed.
 *
 * Threads: one at a time per report.
 */
EBPO_API void ebpo_scene_report_free(ebpo_scene_report *report);

/* ---- over time ---- */

/* Result of ebpo_scene_approach for two instances, a < b. */
typedef struct ebpo_scene_approach_result {
    uint64_t a, b;

    /*
     * Time at which the search ended. At all earlier times of the interval, the faces of a and b
     * are certainly farther apart than the clearance.
     */
    double time;

    /* Bounds of the distance between the faces of a and b at `time`. */
    double lo, hi;

    /* Clearance that the scene requires for the pair. */
    double clearance;

    /* Number of times at which the distance was evaluated. */
    uint64_t evaluations;

    /*
     * 1: at `time` the faces are at most clearance + tolerance apart. 0: the faces are farther
     * apart during the whole interval; `time` is its end. -1: undecided, because the search reached
     * options.max_evaluations, or because the tolerance is finer than the rounding of coordinates.
     */
    int32_t reached;

    int32_t reserved;
} ebpo_scene_approach_result;

/*
 * Callback that gets results, which are valid until it returns. The callback returns false to stop
 * the call.
 */
typedef bool (*ebpo_scene_approaches_fn)(void *user, const ebpo_scene_approach_result *results,
                                         uint64_t count);

/* Options of ebpo_scene_approach and ebpo_scene_least_distances. */
typedef struct ebpo_scene_approach_options {
    size_t struct_size;

    ebpo_progress progress;

    /*
     * Tolerance of distances, in the world's unit; above 0. A smaller tolerance needs more
     * evaluations.
     */
    double tolerance;

    /* Maximum number of times at which the distance of a pair is evaluated. 0: 10,000. */
    uint64_t max_evaluations;

    unsigned threads;

    uint32_t reserved;
} ebpo_scene_approach_options;

#define EBPO_SCENE_APPROACH_OPTIONS_INIT EBPO_SIZED(ebpo_scene_approach_options)

/*
 * Finds the time in from .. to at which two instances are first within their clearance of each
 * other; no time is missed. For each pair of ebpo_scene_pairs (from, to), the distance is evaluated
 * at time `from`. This distance and the bound of ebpo_scene_motion give a later time, before which
 * the pair cannot be near. The distance is evaluated at this later time, and so on. There is one
 * result per pair, in ascending order of a, then b. If one instance is inside another instance from
 * the beginning, and no faces are near, the instances count as apart.
 *
 * Errors are those of ebpo_scene_find_clashes. EBPO_E_ARGUMENT: also if the tolerance is not above
 * 0.
 *
 * Threads: one at a time per scene.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_approach(ebpo_scene *scene, double from, double to,
                                                       const ebpo_scene_approach_options *options,
                                                       ebpo_scene_approaches_fn take, void *user,
                                                       ebpo_error *error);

/* Minimum distance between two instances, a < b, over a time interval. */
typedef struct ebpo_scene_least {
    uint64_t a, b;

    /* A time at which the faces are at most `hi` apart. */
    double time;

    /*
     * Bounds of the minimum distance between the faces over all times of the interval. They differ
     * by more than the tolerance only if options.max_evaluations was reached, a file lacks data, or
     * the tolerance is finer than the rounding of coordinates.
     */
    double lo, hi;

    /* Clearance that the scene requires for the pair. */
    double clearance;

    /* Number of times at which the distance was evaluated. */
    uint64_t evaluations;
} ebpo_scene_least;

/*
 * Callback that gets minimum distances, which are valid until it returns. Its return value is
 * ignored.
 */
typedef bool (*ebpo_scene_least_fn)(void *user, const ebpo_scene_least *list, uint64_t count);

/*
 * Computes for each pair of ebpo_scene_pairs (from, to) the minimum distance over all times in from
 * .. to, and a time at which it occurs. Results are in ascending order of a, then b. Options and
 * errors are those of ebpo_scene_approach.
 *
 * Threads: one at a time per scene.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_least_distances(
    ebpo_scene *scene, double from, double to, const ebpo_scene_approach_options *options,
    ebpo_scene_least_fn take, void *user, ebpo_error *error);

/* ---- subsets ---- */

/* Queries that a packed scene must support. */
typedef enum ebpo_scene_purpose {
    /* ebpo_scene_find_clashes and ebpo_scene_approach. Results have source indices of faces. */
    EBPO_SCENE_FOR_COLLIDE = 0,

    /* Images from the scene's cameras, with cells no larger than a pixel. */
    EBPO_SCENE_FOR_VIEW = 1,

    /*
     * Tests if points of instances are inside other instances. These tests need only the data near
     * other instances.
     */
    EBPO_SCENE_FOR_INSIDE = 2,

    /*
     * As EBPO_SCENE_FOR_COLLIDE, with options.relate and options.depth of ebpo_scene_find_clashes.
     * These queries need all faces of an instance that is near another instance, because any face
     * may be part of a surface around the other instance.
     */
    EBPO_SCENE_FOR_RELATIONS = 3
} ebpo_scene_purpose;

/* Options of ebpo_scene_plan. */
typedef struct ebpo_plan_options {
    size_t struct_size;

    ebpo_progress progress;

    /*
     * Data of an instance is included if the distance of the data from another instance is at most
     * the clearance plus this margin, in the world's unit. With a larger margin,
     * ebpo_scene_approach needs fewer evaluations. 0: the margin for a pair is 1/32 of the longest
     * side of the smaller of the two instances' boxes.
     */
    double margin;

    /* ebpo_scene_purpose */
    int32_t purpose;

    int32_t reserved;
} ebpo_plan_options;

#define EBPO_PLAN_OPTIONS_INIT                                                  \
    {                                                                           \
        sizeof(ebpo_plan_options), { NULL, NULL }, 0, EBPO_SCENE_FOR_COLLIDE, 0 \
    }

/* Data of a model that queries of a scene can need. Models of the same file need the same data. */
typedef struct ebpo_scene_need {
    size_t struct_size;

    uint64_t model;

    /*
     * EBPO_SCENE_FOR_VIEW: number of cameras. Other purposes: number of pairs that include an
     * instance of this model's file; a pair of two instances of this file counts twice.
     */
    uint64_t users;

    /*
     * subtrees: number of the file's subtrees that intersect the box min .. max. total_subtrees:
     * number of all subtrees of the file. Both are 0 if the file has no table of subtrees.
     */
    uint64_t subtrees, total_subtrees;

    /* Size of the required chunks, each counted once, and size of the file; in bytes. */
    uint64_t bytes, file_bytes;

    /* Corners of a box in the model's unit. Faces outside the box are not needed. */
    double min[3], max[3];

    /* Deepest level that is needed, and number of levels of the file. */
    int32_t last_level, level_count;

    /*
     * ebpo_part bits: needed parts that the file has. For purposes other than EBPO_SCENE_FOR_VIEW:
     * if EBPO_PART_MESH is not set, no query needs the faces of this model.
     */
    uint32_t parts;

    /* True: the box does not contain all faces of the model. */
    bool boxed;

    uint8_t reserved[3];
} ebpo_scene_need;

#define EBPO_SCENE_NEED_INIT EBPO_SIZED(ebpo_scene_need)

/* Callback that gets needs, which are valid until it returns. Its return value is ignored. */
typedef bool (*ebpo_scene_needs_fn)(void *user, const ebpo_scene_need *needs, uint64_t count);

/*
 * Finds for each model the data that queries of a purpose can need at any time in from .. to. For
 * collisions and containment, this is the data near other instances; for images, it is some levels.
 * Reads only headers and tables of files.
 *
 * EBPO_E_ARGUMENT: a model is not loaded, `from` is after `to`, the purpose is not valid, or the
 * margin is below 0. Also the errors of reading (base.h).
 *
 * Threads: one at a time per scene.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_plan(ebpo_scene *scene, double from, double to,
                                                   const ebpo_plan_options *options,
                                                   ebpo_scene_needs_fn take, void *user,
                                                   ebpo_error *error);

/* Options of ebpo_scene_pack. */
typedef struct ebpo_pack_options {
    size_t struct_size;

    ebpo_progress progress;

    /* As in ebpo_plan_options. */
    double margin;

    /*
     * Maximum total size, in bytes, of the files of the new models. If the total size would be
     * larger, the size of each file is reduced by the same ratio, with the least possible error
     * bound (ebpo_subset). 0: no maximum.
     */
    uint64_t target_bytes;

    /* As in ebpo_plan_options. */
    int32_t purpose;

    unsigned threads;
} ebpo_pack_options;

#define EBPO_PACK_OPTIONS_INIT                                                     \
    {                                                                              \
        sizeof(ebpo_pack_options), { NULL, NULL }, 0, 0, EBPO_SCENE_FOR_COLLIDE, 0 \
    }

/* A model of a packed scene. Models of the same source file share one new file. */
typedef struct ebpo_scene_packed {
    size_t struct_size;

    uint64_t model;

    /* Size of the new file, size of the source file, and bytes read from the source file. */
    uint64_t bytes, source_bytes, bytes_read;

    /*
     * Error bound of the envelopes of a model that was reduced because of target_bytes, in the
     * model's unit. 0: the model was not reduced.
     */
    double max_error;

    /* content_sha256 of the new file, and of the source file. */
    uint8_t digest[32], source_digest[32];

    /*
     * True: all queries of the purpose are supported. False: some exact queries are not supported,
     * because the model was reduced.
     */
    bool complete;

    uint8_t reserved[7];
} ebpo_scene_packed;

#define EBPO_SCENE_PACKED_INIT EBPO_SIZED(ebpo_scene_packed)

/* Callback that gets packed models, which are valid until it returns; its result is ignored. */
typedef bool (*ebpo_scene_packs_fn)(void *user, const ebpo_scene_packed *models, uint64_t count);

/*
 * Writes the data that ebpo_scene_plan finds to a new folder, which appears atomically. The folder
 * contains subsets of the models' files, pose files, and packed.scene.json. This scene file refers
 * to the new files, and has the digests of the new files and of the source files. `take` may be
 * NULL.
 *
 * Queries of options.purpose at times in from .. to have the same results in the new scene, with
 * two exceptions. ebpo_scene_approach may evaluate other times, and intervals of distances beyond
 * the clearance may be wider. Queries that need more data return EBPO_E_ABSENT.
 *
 * EBPO_E_ARGUMENT: as for ebpo_scene_plan; the scene was not read from a file, or was changed after
 * reading; or target_bytes is too small for a model. EBPO_E_ABSENT: with target_bytes, a file is a
 * subset or has no mesh. EBPO_E_IO: also if the folder exists. Also the errors of reading (base.h).
 *
 * Threads: one at a time per scene.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_pack(ebpo_scene *scene, const char *folder,
                                                   double from, double to,
                                                   const ebpo_pack_options *options,
                                                   ebpo_scene_packs_fn take, void *user,
                                                   ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
