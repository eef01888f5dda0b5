/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: scenes. Models at many places, that move.
 *
 *   Making      ebpo_scene_open (a file: format-spec/scene.md), ebpo_scene_new,
 *               ebpo_scene_add_model, ebpo_scene_add_instance
 *   What it is  ebpo_scene_get_counts, ebpo_scene_get_model, ebpo_scene_get_instance,
 *               ebpo_scene_get_layer, ebpo_scene_get_group, ebpo_scene_group_of,
 *               ebpo_scene_get_camera, ebpo_scene_get_stats, ebpo_scene_pair_rule
 *   Models      ebpo_scene_load, ebpo_scene_file, ebpo_scene_model
 *   In time     ebpo_scene_pose, ebpo_scene_motion, ebpo_scene_instance_box, ebpo_scene_box
 *   Who meets   ebpo_scene_pairs (boxes), ebpo_scene_meet (faces), ebpo_scene_collide (of two),
 *               ebpo_scene_approach, ebpo_scene_least_distances (all times)
 *   As a file   ebpo_scene_record_new
 *   What of it  ebpo_scene_plan, ebpo_scene_pack
 *
 *     ebpo_scene *scene = NULL;
 *     ebpo_scene_open("plant.scene.json", NULL, &scene, &error);
 *     ebpo_scene_load(scene, NULL, &error);
 *     ebpo_scene_box(scene, 0, 10, min, max, &error);
 *     ebpo_scene_pairs(scene, 0, 10, take, NULL, &error);
 *
 * Models, instances and cameras have numbers from 0 in the order in which they were added. Times
 * are in the scene's seconds; before a route's first time an instance is where it begins, after its
 * last where it ends. Poses, boxes and pairs are the same on every machine.
 */
#ifndef EBPO_SCENE_H
#define EBPO_SCENE_H

#include <ebpo/collide.h>
#include <ebpo/pose.h>
#include <ebpo/subset.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct ebpo_scene ebpo_scene;

/* ---- making ---- */

typedef struct ebpo_scene_options {
    size_t struct_size; /* EBPO_SCENE_OPTIONS_INIT sets it */

    /* Most bytes of the scene file; of all files of poses that it names; 0: 64 MiB, 256 MiB. */
    uint64_t most_bytes, most_pose_bytes;

    /*
     * Most values (objects, arrays, texts, numbers) in the scene file: about 250 bytes of memory
     * each while it is read. 0: 4 million.
     */
    uint64_t most_values;

    /*
     * Files that the scene names may lie anywhere. Else they lie in the scene's folder or below
     * it: their paths are relative, have no part "..", and no link leads out of the folder.
     */
    bool outside;

    /* Models on web servers may be named, with their digests. */
    bool remote;

    uint8_t reserved[6];
} ebpo_scene_options;

#define EBPO_SCENE_OPTIONS_INIT EBPO_SIZED(ebpo_scene_options)

/*
 * Reads a scene file, and the files of poses that it names; no model yet.
 *
 * EBPO_E_FORMAT: not such a file; the message has the line and the path of the member, such as
 * "line 12: instances[3].pose.scale". EBPO_E_VERSION: of another major version. EBPO_E_LIMIT: more
 * than a limit of the options. EBPO_E_ARGUMENT, EBPO_E_IO, EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_open(const char *path,
                                                   const ebpo_scene_options *options,
                                                   ebpo_scene **out, ebpo_error *error);

/*
 * The same of `size` bytes of text in memory.
 *
 * name     for messages
 * folder   where relative paths begin; NULL: here
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_parse(const char *text, size_t size, const char *name,
                                                    const char *folder,
                                                    const ebpo_scene_options *options,
                                                    ebpo_scene **out, ebpo_error *error);

/*
 * A scene without models. EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_new(ebpo_scene **out, ebpo_error *error);

/*
 * NULL is fine. Closes the files and models that it has opened.
 *
 * Threads: one per scene.
 */
EBPO_API void ebpo_scene_free(ebpo_scene *scene);

/*
 * Adds a model, whose file is opened by ebpo_scene_load. Texts are copied.
 *
 * name     1 to 255 bytes of UTF-8, of no other model of the scene
 * path     of an .ebpo.h5 file, or its URL
 * digest   its content_sha256; NULL: any
 * number   may be NULL
 *
 * EBPO_E_ARGUMENT: the name. EBPO_E_MEMORY.
 *
 * Threads: one per scene.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_add_model(ebpo_scene *scene, const char *name,
                                                        const char *path, const uint8_t digest[32],
                                                        uint64_t *number, ebpo_error *error);

/* The number of nothing: no route, no layer. */
#define EBPO_SCENE_NONE UINT64_MAX

typedef struct ebpo_scene_instance {
    size_t struct_size; /* EBPO_SCENE_INSTANCE_INIT sets it */

    /* 1 to 255 bytes of UTF-8, of no other instance. */
    const char *name;

    uint64_t model;

    /* Where it is; of one with a route: where it is on what moves along the route. */
    ebpo_pose pose;

    /* Number of its route; and of its layer, as `ebpo_scene_get_layer` names it. */
    uint64_t route, layer;

    /* Two fixed instances are not asked about. One with a route is not fixed. */
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
 * Adds an instance of a model. Boxes that are asked for later have it in them, once its model is
 * loaded. `number` may be NULL.
 *
 * EBPO_E_ARGUMENT: the name, no such model, route or layer, fixed with a route; the pose is none
 * (ebpo_pose_check says more, of a model). EBPO_E_MEMORY.
 *
 * Threads: one per scene.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_add_instance(ebpo_scene *scene,
                                                           const ebpo_scene_instance *instance,
                                                           uint64_t *number, ebpo_error *error);

/* ---- what it is ---- */

typedef struct ebpo_scene_counts {
    size_t struct_size; /* EBPO_SCENE_COUNTS_INIT sets it */

    uint64_t models, instances, layers, groups, routes, cameras;

    /* Poses of all routes; lines of "ignore" and of "clearance"; instances that are fixed. */
    uint64_t poses, ignored, clearances, fixed;

    /* From the first time of any route to the last. 0, 0: nothing moves. */
    double begin, end;
} ebpo_scene_counts;

#define EBPO_SCENE_COUNTS_INIT EBPO_SIZED(ebpo_scene_counts)

/*
 * EBPO_E_ARGUMENT: `out` was not begun with its macro.
 *
 * Threads: any, while nobody changes the scene.
 */
EBPO_API ebpo_status ebpo_scene_get_counts(const ebpo_scene *scene, ebpo_scene_counts *out);

typedef struct ebpo_scene_model_facts {
    size_t struct_size; /* EBPO_SCENE_MODEL_FACTS_INIT sets it */

    /* The scene's, until it is freed. The path is as the scene file has it. */
    const char *name, *path;

    /* All 0: none is stated. */
    uint8_t digest[32];

    uint64_t instances;

    /* Its file is open; then the box of its faces, in its own unit. */
    bool loaded;
    uint8_t reserved[7];
    double min[3], max[3];
} ebpo_scene_model_facts;

#define EBPO_SCENE_MODEL_FACTS_INIT EBPO_SIZED(ebpo_scene_model_facts)

/*
 * EBPO_E_ARGUMENT: no such model, or `out` was not begun with its macro.
 *
 * Threads: any, while nobody changes the scene.
 */
EBPO_API ebpo_status ebpo_scene_get_model(const ebpo_scene *scene, uint64_t model,
                                          ebpo_scene_model_facts *out);

typedef struct ebpo_scene_stats {
    size_t struct_size; /* EBPO_SCENE_STATS_INIT sets it */

    /* Files that are open, and those of which a model has been made. */
    uint64_t files, models;

    /* Bytes of memory that these models take. */
    uint64_t memory;

    /* Bytes read of files, and how many times. */
    uint64_t bytes_read, reads;

    /* Subtrees loaded because a question needed them, of models that are not all in memory. */
    uint64_t loads;
} ebpo_scene_stats;

#define EBPO_SCENE_STATS_INIT EBPO_SIZED(ebpo_scene_stats)

/*
 * What its models have cost so far. EBPO_E_ARGUMENT: `out` was not begun with its macro.
 *
 * Threads: one per scene.
 */
EBPO_API ebpo_status ebpo_scene_get_stats(const ebpo_scene *scene, ebpo_scene_stats *out);

/*
 * As it was added. EBPO_E_ARGUMENT: no such instance, or `out` was not begun with its macro.
 *
 * Threads: any, while nobody changes the scene.
 */
EBPO_API ebpo_status ebpo_scene_get_instance(const ebpo_scene *scene, uint64_t instance,
                                             ebpo_scene_instance *out);

/*
 * The name of a layer, until the scene is freed; NULL: there is no such layer.
 *
 * Threads: any, while nobody changes the scene.
 */
EBPO_API const char *ebpo_scene_get_layer(const ebpo_scene *scene, uint64_t layer);

/*
 * The name of a group, until the scene is freed; NULL: there is no such group.
 *
 * Threads: any, while nobody changes the scene.
 */
EBPO_API const char *ebpo_scene_get_group(const ebpo_scene *scene, uint64_t group);

/*
 * The number of the nth group, from 0, that an instance belongs to. EBPO_SCENE_NONE: it has not so
 * many, or there is no such instance.
 *
 * Threads: any, while nobody changes the scene.
 */
EBPO_API uint64_t ebpo_scene_group_of(const ebpo_scene *scene, uint64_t instance, uint64_t nth);

typedef struct ebpo_scene_camera {
    size_t struct_size; /* EBPO_SCENE_CAMERA_INIT sets it */
    const char *name;

    /* In the world, or in what moves along its route. */
    double eye[3], target[3], up[3];

    /* Degrees, vertical. */
    double fov;

    uint32_t width, height;

    /* Of its route, or EBPO_SCENE_NONE. */
    uint64_t route;
} ebpo_scene_camera;

#define EBPO_SCENE_CAMERA_INIT EBPO_SIZED(ebpo_scene_camera)

/*
 * EBPO_E_ARGUMENT: no such camera, or `out` was not begun with its macro.
 *
 * Threads: any, while nobody changes the scene.
 */
EBPO_API ebpo_status ebpo_scene_get_camera(const ebpo_scene *scene, uint64_t camera,
                                           ebpo_scene_camera *out);

/*
 * Whether a pair is to be asked about: not one that the scene ignores, not two fixed instances, not
 * an instance and itself. Then *clearance is the greatest distance that the scene wants between
 * them, 0 if none, in the world's unit. False too where there is no such instance.
 *
 * Threads: any, while nobody changes the scene.
 */
EBPO_API bool ebpo_scene_pair_rule(const ebpo_scene *scene, uint64_t a, uint64_t b,
                                   double *clearance);

/* ---- models ---- */

typedef struct ebpo_load_options {
    size_t struct_size; /* EBPO_LOAD_OPTIONS_INIT sets it */

    /*
     * Bytes of memory for all models that are asked questions, together, as of ebpo_budget_new;
     * those of the first call that gives any. 0: as much as they need.
     */
    uint64_t memory;

    ebpo_progress progress;

    /* As in ebpo_open_options. */
    uint64_t most_expansion;
} ebpo_load_options;

#define EBPO_LOAD_OPTIONS_INIT EBPO_SIZED(ebpo_load_options)

/*
 * Opens the files of models that are not open yet (heads only, one for each path), compares
 * digests, and makes boxes. Files of models without instances are opened as well.
 *
 * EBPO_E_FORMAT: a file is none of this format or not the one that the scene means, or links lead
 * to it out of the scene's folder (ebpo_scene_options.outside). EBPO_E_ARGUMENT: a model cannot be
 * where an instance of it is, which the message names. EBPO_E_CANCELLED, EBPO_E_IO, EBPO_E_MEMORY.
 *
 * Threads: one per scene.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_load(ebpo_scene *scene,
                                                   const ebpo_load_options *options,
                                                   ebpo_error *error);

/*
 * The open file of a model, the scene's; NULL: not loaded, or no such model. Models of one path
 * share it.
 *
 * Threads: any, while nobody changes the scene.
 */
EBPO_API const ebpo_file *ebpo_scene_file(const ebpo_scene *scene, uint64_t model);

/*
 * What questions are asked of, made when it is first asked for: the scene's, one for all instances
 * and all models of one file.
 *
 * EBPO_E_ARGUMENT: not loaded, or no such model. The errors of ebpo_model_new.
 *
 * Threads: one per scene.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_model(ebpo_scene *scene, uint64_t model,
                                                    ebpo_model **out, ebpo_error *error);

/* ---- in time ---- */

/*
 * Where an instance is at a time (finite).
 *
 * EBPO_E_ARGUMENT: no such instance, or no such time.
 *
 * Threads: any, while nobody changes the scene.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_pose(const ebpo_scene *scene, uint64_t instance,
                                                   double time, ebpo_pose *out, ebpo_error *error);

/*
 * No point of the instance's model moves farther than *length between any two times of
 * from .. to, in the world's unit; its posed coordinates neither. INFINITY where a route jumps.
 * 0: it does not move.
 *
 * EBPO_E_ARGUMENT: no such instance, not loaded, or not from <= to, both finite.
 *
 * Threads: any, while nobody changes the scene.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_motion(const ebpo_scene *scene, uint64_t instance,
                                                     double from, double to, double *length,
                                                     ebpo_error *error);

/*
 * A box that holds the instance's posed vertices at all times of from .. to: min and max of three.
 *
 * Errors as for ebpo_scene_motion.
 *
 * Threads: any, while nobody changes the scene.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_instance_box(const ebpo_scene *scene,
                                                           uint64_t instance, double from,
                                                           double to, double min[3], double max[3],
                                                           ebpo_error *error);

/*
 * A box that holds all instances at all times of from .. to (EBP 2017, 5.6.1). Without instances
 * min is INFINITY and max -INFINITY. Instances whose models were added after ebpo_scene_load are
 * EBPO_E_ARGUMENT until it is called again. Errors as for ebpo_scene_motion.
 *
 * Threads: any, while nobody changes the scene.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_box(const ebpo_scene *scene, double from, double to,
                                                  double min[3], double max[3], ebpo_error *error);

/* ---- who meets ---- */

/* Two instances, a < b, whose boxes come within `clearance` of each other. */
typedef struct ebpo_scene_pair {
    uint64_t a, b;
    double clearance;
} ebpo_scene_pair;

/* Pairs, lent until it returns. False: enough. */
typedef bool (*ebpo_scene_pairs_fn)(void *user, const ebpo_scene_pair *pairs, uint64_t count);

/*
 * The broad phase: pairs that ebpo_scene_pair_rule allows and whose boxes
 * (ebpo_scene_instance_box) are at most their clearance apart on each axis; ascending by a, then b.
 * No other pair of instances comes that close at any time of from .. to.
 *
 * EBPO_E_ARGUMENT: not loaded, or not from <= to, both finite. EBPO_E_LIMIT: more than 2^23 pairs.
 * EBPO_E_MEMORY.
 *
 * Threads: any, while nobody changes the scene.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_pairs(const ebpo_scene *scene, double from, double to,
                                                    ebpo_scene_pairs_fn take, void *user,
                                                    ebpo_error *error);

typedef enum ebpo_meeting_kind {
    EBPO_MEETING_NONE = 0,     /* no faces meet; one may still be within the other */
    EBPO_MEETING_NEAR = 1,     /* none meet, but they are nearer than their clearance */
    EBPO_MEETING_TOUCHING = 2, /* faces have common points, none has inner ones */
    EBPO_MEETING_COPLANAR = 3, /* faces lie on each other, none cross */
    EBPO_MEETING_CROSSING = 4, /* faces cross */

    /* Only if ebpo_scene_ask_options.relate, and then instead of those above: */
    EBPO_MEETING_PROTRUDING = 5, /* a part of one is inside the other, a solid, a part sticks out */
    EBPO_MEETING_ENCLOSED = 6,   /* one is within the other, a solid; it may touch it from within */
    EBPO_MEETING_DUPLICATE = 7   /* both are the same points */
} ebpo_meeting_kind;

/* Of two instances, a < b, whose faces meet or come too near, or of which one is in the other. */
typedef struct ebpo_scene_meeting {
    uint64_t a, b;

    /*
     * A pair of their faces that meet: if all are counted the first by numbers, else one as
     * ebpo_collide_first gives it; or the nearest pair.
     */
    uint64_t face_a, face_b;

    /*
     * Pairs of faces of each kind (ebpo_pair_kind), all of them if ebpo_scene_ask_options.count;
     * else what was seen until `kind` was certain.
     */
    uint64_t touching, crossing, coplanar;

    /*
     * What the scene wants between them, and what there is between faces, exact, of
     * EBPO_MEETING_NEAR and where one is within the other without touching it; else 0.
     */
    double clearance, distance;

    /* An ebpo_meeting_kind; without `relate` the greatest that any pair of faces has. */
    int32_t kind;

    /* An ebpo_relation of a to b, if ebpo_scene_ask_options.relate, else EBPO_RELATION_OPEN. */
    int32_t relation;

    /*
     * Lines along which they cross, as ebpo_collide_polylines joins them, if
     * ebpo_scene_ask_options.count; UINT64_MAX: more segments than a collider joins.
     */
    uint64_t contacts;

    /*
     * A point in the world, as far as doubles tell, if ebpo_scene_ask_options.places: one that the
     * two faces have in common, or the middle between their nearest points. NAN: not asked.
     */
    double place[3];

    /* A box of `place` and, if ebpo_scene_ask_options.count too, of all contact segments. */
    double place_min[3], place_max[3];

    /*
     * Of a in b and of b in a, as ebpo_collide_depth gives them within
     * ebpo_scene_ask_options.depth; 0 to INFINITY: not asked, or in a surface.
     */
    ebpo_certain depth[2];
} ebpo_scene_meeting;

/* Meetings, lent until it returns. False: enough. */
typedef bool (*ebpo_scene_meetings_fn)(void *user, const ebpo_scene_meeting *meetings,
                                       uint64_t count);

typedef struct ebpo_scene_ask_options {
    size_t struct_size; /* EBPO_SCENE_ASK_OPTIONS_INIT sets it */

    ebpo_progress progress;

    /* 0: all cores. The answers do not depend on it. */
    unsigned threads;

    /* Count all pairs of faces that meet, and lines along which they cross. */
    bool count;

    /* Tell where. */
    bool places;

    /*
     * Tell how solids lie to each other (ebpo_collide_relation), of all pairs asked: some 60 bytes
     * a face of both models, for each thread.
     */
    bool relate;

    uint8_t reserved;

    /* Tell how deep what is inside is, within so much, in the world's unit; and `relate`. 0: do
     * not. */
    double depth;
} ebpo_scene_ask_options;

#define EBPO_SCENE_ASK_OPTIONS_INIT EBPO_SIZED(ebpo_scene_ask_options)

/*
 * The narrow phase at a time: of the pairs of ebpo_scene_pairs those whose faces meet or are nearer
 * to each other than the pair's clearance, exact on posed coordinates (collide.h), ascending by a,
 * then b. An instance within another that no face comes near is a meeting only if options.relate.
 * Models are made as ebpo_scene_model does; all pairs of a model are asked of one. `asked`, the
 * number of pairs asked, may be NULL.
 *
 * EBPO_E_ARGUMENT: not loaded, no such time, a pose (ebpo_pose_check), or options.depth is no such
 * length. EBPO_E_ABSENT: a model has no mesh, or is a subset without faces that may matter: of
 * those that are related all may. EBPO_E_LIMIT: too little memory
 * (ebpo_load_options).
 * EBPO_E_CANCELLED, EBPO_E_MEMORY, and the errors of reading.
 *
 * Threads: one per scene; further ones live for the call.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_meet(ebpo_scene *scene, double time,
                                                   const ebpo_scene_ask_options *options,
                                                   ebpo_scene_meetings_fn take, void *user,
                                                   uint64_t *asked, ebpo_error *error);

/*
 * Every pair of faces of two instances that meet at a time, as ebpo_collide_all gives them of their
 * models.
 *
 * threads   0: all cores. The answers do not depend on it
 *
 * EBPO_E_ARGUMENT: no such instance. Other errors are those of ebpo_scene_meet.
 *
 * Threads: one per scene; further ones live for the call.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_collide(ebpo_scene *scene, uint64_t a, uint64_t b,
                                                      double time, unsigned threads,
                                                      ebpo_pairs_fn take, void *user,
                                                      ebpo_error *error);

/* ---- as a file ---- */

/* A report of what was asked at several times, being written. */
typedef struct ebpo_scene_record ebpo_scene_record;

/* One time. */
typedef struct ebpo_scene_frame {
    double time;

    /* Pairs that were asked about; nanoseconds that it took. */
    uint64_t asked, nanoseconds;

    /* Meanwhile: bytes read of files, models made, subtrees loaded (ebpo_scene_stats). */
    uint64_t bytes_read, models, loads;
} ebpo_scene_frame;

/*
 * Begins a file for any HDF5 from 1.8 on, which appears whole, when it is finished, or not at all.
 * Arrays have an attribute `meaning`, in words.
 *
 *   /instances/names       uint8 [bytes]  names, each ended by a 0, by number
 *   /instances/model       int64 [i]      its model's number in /models
 *   /models/names          uint8 [bytes]
 *   /frames/time           double [n]     in the scene's seconds
 *   /frames/first_meeting  int64 [n]      the frame's meetings begin there in /meetings
 *   /frames/meetings       int64 [n]      and are so many
 *   /frames/asked, nanoseconds, bytes_read, models, loads   int64 [n]   of ebpo_scene_frame
 *   /meetings/frame        int64 [m]
 *   /meetings/instances    int64 [m][2]   a and b
 *   /meetings/kind         uint8 [m]      an ebpo_meeting_kind
 *   /meetings/relation     uint8 [m]      an ebpo_relation
 *   /meetings/faces        int64 [m][2]   of a and of b, in the sources; -1: none
 *   /meetings/pairs        int64 [m][3]   of faces: touching, coplanar, crossing
 *   /meetings/contacts     int64 [m]      -1: not told
 *   /meetings/clearance, distance   double [m]
 *   /meetings/place        double [m][3]  NAN: not asked
 *   /meetings/place_box    double [m][6]  lower corner, upper corner
 *   /meetings/depth        double [m][4]  of a in b from, to; of b in a from, to
 *
 * EBPO_E_IO: it cannot be written. EBPO_E_MEMORY.
 *
 * Threads: one per scene. The scene may not change before the record is freed.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_record_new(const ebpo_scene *scene, const char *path,
                                                         ebpo_scene_record **out,
                                                         ebpo_error *error);

/*
 * Adds a time and what ebpo_scene_meet gave. EBPO_E_IO, EBPO_E_MEMORY.
 *
 * Threads: one per record.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_record_add(ebpo_scene_record *record,
                                                         const ebpo_scene_frame *frame,
                                                         const ebpo_scene_meeting *meetings,
                                                         uint64_t count, ebpo_error *error);

/*
 * The file appears. EBPO_E_IO.
 *
 * Threads: one per record.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_record_finish(ebpo_scene_record *record,
                                                            ebpo_error *error);

/*
 * NULL is fine. What is not finished leaves nothing behind.
 *
 * Threads: one per record.
 */
EBPO_API void ebpo_scene_record_free(ebpo_scene_record *record);

/* ---- on the way ---- */

/* Two instances, a < b, on their way. */
typedef struct ebpo_scene_way {
    uint64_t a, b;

    /* At all times before this one their faces are certainly farther apart than their clearance. */
    double time;

    /* Bounds of the distance of their faces then. */
    double lo, hi;

    double clearance;

    /* Times at which they were looked at. */
    uint64_t looks;

    /*
     * 1: at `time` they are at most clearance + tolerance apart. 0: `time` is the last time, at
     * which they are farther apart, too. -1: it is open: lo and hi are what is known at `time`,
     * after options.most_looks, or because the tolerance is finer than the rounding of coordinates.
     */
    int32_t reached;

    int32_t reserved;
} ebpo_scene_way;

/* Ways, lent until it returns. False: enough. */
typedef bool (*ebpo_scene_ways_fn)(void *user, const ebpo_scene_way *ways, uint64_t count);

typedef struct ebpo_scene_way_options {
    size_t struct_size; /* EBPO_SCENE_WAY_OPTIONS_INIT sets it */

    ebpo_progress progress;

    /* Greater than 0, in the world's unit: the smaller, the more looks. */
    double tolerance;

    /* For each pair. 0: 10,000. */
    uint64_t most_looks;

    /* 0: all cores. The answers do not depend on it. */
    unsigned threads;

    uint32_t reserved;
} ebpo_scene_way_options;

#define EBPO_SCENE_WAY_OPTIONS_INIT EBPO_SIZED(ebpo_scene_way_options)

/*
 * When instances first come near each other, nothing being missed between two looks: each pair of
 * ebpo_scene_pairs (from, to) is looked at, its distance and ebpo_scene_motion say until when
 * nothing can happen, and then it is looked at again. A way for each pair, ascending by a, then b.
 * An instance that is within another from the beginning, without coming near its faces, is apart.
 *
 * Errors as for ebpo_scene_meet; EBPO_E_ARGUMENT also: the tolerance is not above 0.
 *
 * Threads: one per scene; further ones live for the call.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_approach(ebpo_scene *scene, double from, double to,
                                                       const ebpo_scene_way_options *options,
                                                       ebpo_scene_ways_fn take, void *user,
                                                       ebpo_error *error);

/* The least distance of two instances, a < b, over a time. */
typedef struct ebpo_scene_least {
    uint64_t a, b;

    /* When they are at most `hi` apart. */
    double time;

    /*
     * Bounds of the least distance of their faces, certain for all times: their difference is at
     * most the tolerance, unless options.most_looks did not suffice, or what a file lacks or the
     * rounding of coordinates leaves it open.
     */
    double lo, hi;

    double clearance;

    /* Times at which they were looked at. */
    uint64_t looks;
} ebpo_scene_least;

/* Least distances, lent until it returns. What it returns is ignored. */
typedef bool (*ebpo_scene_least_fn)(void *user, const ebpo_scene_least *list, uint64_t count);

/*
 * How near instances come to each other at any time of from .. to, and when, nothing being missed:
 * each pair of ebpo_scene_pairs (from, to), ascending by a, then b. Options and errors are those of
 * ebpo_scene_approach.
 *
 * Threads: one per scene; further ones live for the call.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_least_distances(ebpo_scene *scene, double from,
                                                              double to,
                                                              const ebpo_scene_way_options *options,
                                                              ebpo_scene_least_fn take, void *user,
                                                              ebpo_error *error);

/* ---- what of its models a scene needs ---- */

typedef enum ebpo_scene_purpose {
    /* ebpo_scene_meet and ebpo_scene_approach, with numbers of faces as in the source. */
    EBPO_SCENE_FOR_COLLIDE = 0,

    /* Pictures from the scene's cameras, of cells no larger than a pixel. */
    EBPO_SCENE_FOR_VIEW = 1,

    /* Whether points of instances are inside those that they may meet. */
    EBPO_SCENE_FOR_INSIDE = 2,

    /*
     * As EBPO_SCENE_FOR_COLLIDE, with options.relate and options.depth of ebpo_scene_meet: all
     * faces of what comes near anything, as a face anywhere may be around the other one.
     */
    EBPO_SCENE_FOR_SOLIDS = 3
} ebpo_scene_purpose;

typedef struct ebpo_plan_options {
    size_t struct_size; /* EBPO_PLAN_OPTIONS_INIT sets it */

    ebpo_progress progress;

    /*
     * What comes so near beyond the clearance is taken along, in the world's unit: with more,
     * ebpo_scene_approach takes fewer looks. 0: of each pair a 32nd of the longest side of the box
     * of the smaller one.
     */
    double margin;

    /* An ebpo_scene_purpose. */
    int32_t purpose;

    int32_t reserved;
} ebpo_plan_options;

#define EBPO_PLAN_OPTIONS_INIT                                                  \
    {                                                                           \
        sizeof(ebpo_plan_options), { NULL, NULL }, 0, EBPO_SCENE_FOR_COLLIDE, 0 \
    }

/* What a scene can ever call for of a model. Models of one file need the same. */
typedef struct ebpo_scene_need {
    size_t struct_size; /* EBPO_SCENE_NEED_INIT sets it */

    uint64_t model;

    /* Pairs of instances of which one is of this model's file, twice if both are; or cameras. */
    uint64_t askers;

    /* Subtrees of the file that meet the box, of all. 0, 0: it has none. */
    uint64_t subtrees, of_subtrees;

    /* Of the file's chunks that hold this, each counted once; and of the file. */
    uint64_t bytes, file_bytes;

    /* The box, in the model's unit, outside which no face is called for. */
    double min[3], max[3];

    /* Levels 0 to last_level, of so many. */
    int32_t last_level, level_count;

    /* Bits of ebpo_part, of those that the file has. Without the mesh: nothing is asked. */
    uint32_t parts;

    /* The box does not hold all faces. */
    bool boxed;

    uint8_t reserved[3];
} ebpo_scene_need;

#define EBPO_SCENE_NEED_INIT EBPO_SIZED(ebpo_scene_need)

/* Needs, lent until it returns. What it returns is ignored. */
typedef bool (*ebpo_scene_needs_fn)(void *user, const ebpo_scene_need *needs, uint64_t count);

/*
 * What questions of a purpose at any time of from .. to can call for, of each model: for collisions
 * and containment what other instances come near to, on all their ways; for pictures levels. Only
 * heads and tables of files are read.
 *
 * EBPO_E_ARGUMENT: not loaded, not from <= to, no such purpose, a margin below 0.
 * EBPO_E_CANCELLED, EBPO_E_MEMORY, and the errors of reading.
 *
 * Threads: one per scene.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_scene_plan(ebpo_scene *scene, double from, double to,
                                                   const ebpo_plan_options *options,
                                                   ebpo_scene_needs_fn take, void *user,
                                                   ebpo_error *error);

typedef struct ebpo_pack_options {
    size_t struct_size; /* EBPO_PACK_OPTIONS_INIT sets it */

    ebpo_progress progress;

    /* As in ebpo_plan_options. */
    double margin;

    /*
     * Bytes that all models shall have at most: if they have more, each is made smaller by the same
     * share, with the least error that it takes (ebpo_subset). 0: no target.
     */
    uint64_t target_bytes;

    /* As in ebpo_plan_options. */
    int32_t purpose;

    /* 0: all cores. The result does not depend on it. */
    unsigned threads;
} ebpo_pack_options;

#define EBPO_PACK_OPTIONS_INIT                                                     \
    {                                                                              \
        sizeof(ebpo_pack_options), { NULL, NULL }, 0, 0, EBPO_SCENE_FOR_COLLIDE, 0 \
    }

/* A model of a packed scene. Models of one file share it. */
typedef struct ebpo_scene_packed {
    size_t struct_size; /* EBPO_SCENE_PACKED_INIT sets it */

    uint64_t model;

    /* Of its file; of the one that it comes from; and what was read of that. */
    uint64_t bytes, source_bytes, bytes_read;

    /* How far envelopes reach beyond the model where it was made smaller, in its unit; else 0. */
    double max_error;

    /* Their content_sha256. */
    uint8_t digest[32], source_digest[32];

    /* What was planned is answered; false: exact questions no longer are, for target_bytes. */
    bool answers;

    uint8_t reserved[7];
} ebpo_scene_packed;

#define EBPO_SCENE_PACKED_INIT EBPO_SIZED(ebpo_scene_packed)

/* What was packed, lent until it returns. What it returns is ignored. */
typedef bool (*ebpo_scene_packs_fn)(void *user, const ebpo_scene_packed *models, uint64_t count);

/*
 * Writes what ebpo_scene_plan finds as a new folder, which appears whole or not at all: subsets of
 * the models' files, files of poses, and packed.scene.json, the scene with these files, their
 * digests and those of what they come from. Questions of the purpose, at times of from .. to, have
 * the same answers there: of ebpo_scene_meet the same, of ebpo_scene_approach the same with
 * perhaps other looks; intervals of distances beyond the clearance may be wider. What would need
 * more is refused (EBPO_E_ABSENT). `take` may be NULL.
 *
 * EBPO_E_ARGUMENT: as for ebpo_scene_plan; the scene was not read from a file, or has been added
 * to; or target_bytes is below what a model can have. EBPO_E_ABSENT: target_bytes, and a file is a
 * subset or has no mesh. EBPO_E_IO: also: the folder is there. EBPO_E_CANCELLED, EBPO_E_MEMORY, and
 * the errors of reading.
 *
 * Threads: one per scene.
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
