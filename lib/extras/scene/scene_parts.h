/* Defines the members of a scene, and functions that the files of lib/extras/scene share. */
#ifndef EBPO_SCENE_SCENE_PARTS_H
#define EBPO_SCENE_SCENE_PARTS_H

#include <ebpo/scene.h>
#include <jansson.h>

/* An open file. All models with the same path share it. */
typedef struct ebpo_scene_file_entry {
    char *path; /* path by which the file is opened */
    ebpo_file *file;
    ebpo_model *model; /* NULL until it is needed */
} ebpo_scene_file_entry;

typedef struct ebpo_scene_model_entry {
    char *name, *path;
    uint8_t digest[32];    /* required content_sha256 of the file; all 0: any content */
    uint64_t instances;    /* number of instances of the model */
    uint64_t file;         /* index in scene.files; EBPO_SCENE_NONE: not loaded */
    double min[3], max[3]; /* box of the model, set when it is loaded */
} ebpo_scene_model_entry;

/* A key of a route: a time, and the pose at that time. The rotation is a unit quaternion: x, y, z,
 * w. */
typedef struct ebpo_route_key {
    double time, quaternion[4], translation[3], scale;
} ebpo_route_key;

typedef struct ebpo_scene_route {
    char *name;
    ebpo_route_key *keys; /* in ascending order of time */
    uint64_t count, capacity;
    bool jumps; /* the pose of a key is kept until the time of the next key, without
                 * interpolation */
} ebpo_scene_route;

/* An instance and its sets. A name in a rule selects a set of instances: the instances of a layer
 * or of a group, one instance, or all instances. So an instance is in the set of all instances, in
 * a set that has only this instance, and in the sets of its layer and its groups. */
typedef struct ebpo_scene_instance_entry {
    ebpo_scene_instance description; /* as added by the caller; the entry owns its name */
    uint64_t *sets; /* indices of sets; in ascending order after ebpo_scene_sort_rules */
    uint32_t set_count;
} ebpo_scene_instance_entry;

/* A rule for pairs of an instance of set a and an instance of set b; a <= b. */
typedef struct ebpo_scene_rule_entry {
    uint64_t a, b;
    double clearance; /* required distance; below 0: the pairs are ignored */
} ebpo_scene_rule_entry;

/* Declares the members of a growing list: the items, their number and the capacity. */
#define EBPO_SCENE_LIST(type, name) \
    type *name;                     \
    uint64_t name##_count, name##_capacity

struct ebpo_scene {
    EBPO_SCENE_LIST(ebpo_scene_model_entry, models);
    EBPO_SCENE_LIST(ebpo_scene_instance_entry, instances);
    EBPO_SCENE_LIST(ebpo_scene_route, routes);
    EBPO_SCENE_LIST(ebpo_scene_camera, cameras);
    EBPO_SCENE_LIST(ebpo_scene_rule_entry, rules); /* sorted by ebpo_scene_sort_rules */
    EBPO_SCENE_LIST(char *, sets);     /* names of sets: "*", then those of layers, groups and
                                        * instances */
    EBPO_SCENE_LIST(uint64_t, layers); /* [layer] index in `sets` of the layer's set */
    EBPO_SCENE_LIST(uint64_t, groups); /* [group] index in `sets` of the group's set; ascending */
    EBPO_SCENE_LIST(ebpo_scene_file_entry, files);
    json_t *names; /* maps a name, prefixed by its kind, to the index in the list of that kind */
    uint64_t ignored_count, clearance_count; /* numbers of rules that ignore pairs, and of rules
                                              * that require a clearance, before sorting */
    char *folder;                            /* base of relative paths, "" or ending with "/" */
    char *text; /* JSON text from which the scene was read; NULL: a program made the scene */
    size_t text_size;
    uint64_t text_models, text_instances; /* numbers of models and instances in that text */
    bool allow_outside;                   /* files that the scene names may be outside the folder */
    ebpo_model_options model_options;     /* options of the models that ebpo_scene_model makes */
};

#define EBPO_SCENE_ALL_SET 0 /* index in `sets` of the set of all instances */

/* --- names --- */

/* Kinds of names: prefixes of keys in `names`. The kinds of sets are "", "layer:" and "group:". No
 * name begins with a control character, so keys of different kinds are different. */
#define EBPO_SCENE_MODEL  "\001m"
#define EBPO_SCENE_ROUTE  "\001r"
#define EBPO_SCENE_CAMERA "\001c"
#define EBPO_SCENE_LAYER  "\001l"

/* Returns the index of the object of this kind and name; EBPO_SCENE_NONE if there is none. */
uint64_t ebpo_scene_find_name(const ebpo_scene *scene, const char *kind, const char *name);

/* --- adding members --- */

/* These functions add members that only scene files can have. They copy names. Indices in `camera`
 * must be valid. */
EBPO_MUST_USE ebpo_status ebpo_scene_add_layer(ebpo_scene *scene, const char *name,
                                               ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_scene_add_group(ebpo_scene *scene, const char *name,
                                               ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_scene_add_route(ebpo_scene *scene, const char *name,
                                               uint64_t *number, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_scene_add_camera(ebpo_scene *scene, const ebpo_scene_camera *camera,
                                                ebpo_error *error);
/* Puts the newest instance into a set. */
EBPO_MUST_USE ebpo_status ebpo_scene_put_newest_into(ebpo_scene *scene, uint64_t set,
                                                     ebpo_error *error);
/* Adds a rule for pairs of an instance of set a and an instance of set b. A clearance below 0 means
 * that the pairs are ignored. */
EBPO_MUST_USE ebpo_status ebpo_scene_add_rule(ebpo_scene *scene, uint64_t a, uint64_t b,
                                              double clearance, ebpo_error *error);

/* --- rules --- */

/* Sorts the rules and the sets of instances, and merges rules for the same pair of sets. Must be
 * called before rules are evaluated. */
void ebpo_scene_sort_rules(ebpo_scene *scene);

/* --- scene files --- */

/* Reports that a text has more than max_bytes bytes. Always returns EBPO_E_LIMIT. */
ebpo_status ebpo_scene_too_long(const char *name, const ebpo_scene_options *options,
                                ebpo_error *error);
/* Adds the content of `text` to an empty scene, whose folder has been set. name: for messages. */
EBPO_MUST_USE ebpo_status ebpo_scene_read_json(ebpo_scene *scene, const char *text, size_t size,
                                               const char *name, const ebpo_scene_options *options,
                                               ebpo_error *error);

/* --- routes --- */

/* Appends a key and normalises its quaternion. Fails with EBPO_E_ARGUMENT if a number is not
 * finite, the quaternion is 0, or the scale is out of range. Also fails with EBPO_E_ARGUMENT if the
 * time is not later than the time of the last key, or is beyond 2^1000. */
EBPO_MUST_USE ebpo_status ebpo_scene_add_key(ebpo_scene_route *route, const ebpo_route_key *key,
                                             ebpo_error *error);
/* Returns the quaternion nearest to a matrix; its length is not 0, but need not be 1. */
void ebpo_scene_quaternion_of_matrix(const double m[3][3], double quaternion[4]);
/* Computes the pose of a route at a time: before the first key, the pose of the first key; after
 * the last key, the pose of the last key. */
void ebpo_scene_route_at(const ebpo_scene_route *route, double time, ebpo_pose *out);
/* Computes the pose that applies `inner` first, and then `outer`. */
void ebpo_scene_compose(const ebpo_pose *outer, const ebpo_pose *inner, ebpo_pose *out);
/* Returns the time of the first key after `from`, or `to` if `to` is earlier. The motion is smooth
 * between `from` and the returned time. */
double ebpo_scene_route_next(const ebpo_scene_route *route, double from, double to);

/* Returns an upper bound of the length of a vector. Squares do not overflow or underflow. */
double ebpo_scene_length_above(const double vector[3]);

/* Bounds of a set of points that follow a route, in the coordinates of the route. */
typedef struct ebpo_scene_extent {
    double max_distance; /* upper bound of the points' distance from the route's origin */
    double size; /* 1-norm of the coordinates from which max_distance is computed; the rounding
                    error is proportional to it */
} ebpo_scene_extent;

/* Bounds of the motion of points between two times. */
typedef struct ebpo_scene_step {
    double length; /* upper bound of the distance of a point from its first position */
    double sag; /* upper bound of the distance between the point and a second point, which moves at
                   constant speed on the straight line from the first point's first position to its
                   last position */
} ebpo_scene_step;
/* Returns the bounds for points of this extent. No key may be between the two times. */
ebpo_scene_step ebpo_scene_route_step(const ebpo_scene_route *route, double from, double to,
                                      ebpo_scene_extent extent);

/* Returns an upper bound of the motion that rounding alone causes. This bound is the same for short
 * and long intervals of time. */
double ebpo_scene_route_rounding(const ebpo_scene_route *route, ebpo_scene_extent extent);

/* Returns an upper bound of the change of the distance of two instances on one route between the
 * times `from` and `to`, including rounding; from < to. extent: the sum of both instances'
 * extents, member by member. */
double ebpo_scene_route_growth(const ebpo_scene_route *route, double from, double to,
                               ebpo_scene_extent extent);

/* --- boxes --- */

/* Returns the extent of the instance's points in the coordinates of its route. */
ebpo_scene_extent ebpo_scene_extent_of(const ebpo_scene *scene,
                                       const ebpo_scene_instance_entry *instance);

/* --- files that a scene names --- */

/* Returns NULL, or the reason why the scene may not name this file. */
const char *ebpo_scene_path_refused(const char *path, const ebpo_scene_options *options,
                                    bool has_digest);
/* Returns the path by which a file is opened, from malloc; NULL without memory. */
char *ebpo_scene_join_path(const char *folder, const char *path);
/* Checks, before a file is opened, that its path does not lead out of the folder by symbolic links.
 * Fails with EBPO_E_FORMAT if it does, and with EBPO_E_IO, EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_scene_stays_within(const char *folder, const char *path,
                                                  ebpo_error *error);
/* Returns the beginning of a path up to its last "/", or "", from malloc. */
char *ebpo_scene_folder_of(const char *path);

/* --- the text of a scene file --- */

/* Returns the length of a UTF-8 byte order mark at the beginning of a text: 0 or 3. */
size_t ebpo_scene_bom_length(const char *text, size_t size);

/* Fails with EBPO_E_LIMIT if the JSON text has more than `max_values` values or more than
 * EBPO_SCENE_DEPTH levels of brackets. Does not parse the text. */
EBPO_MUST_USE ebpo_status ebpo_scene_text_fits(const char *text, size_t size, uint64_t max_values,
                                               ebpo_error *error);

/* One step of the path to a value in the JSON text: the key of a member of an object, or, if the
 * key is NULL, the index of an item of an array. */
typedef struct ebpo_scene_at {
    const char *key;
    uint64_t item;
} ebpo_scene_at;
enum { EBPO_SCENE_DEPTH = 32 };

#endif
