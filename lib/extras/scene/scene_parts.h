/* The parts of a scene, shared by the files of lib/extras/scene. */
#ifndef EBPO_SCENE_SCENE_PARTS_H
#define EBPO_SCENE_SCENE_PARTS_H

#include <ebpo/scene.h>
#include <jansson.h>

/* An open file, shared by all models of a path. */
typedef struct ebpo_scene_file_entry {
    char *path; /* path by which the file is opened */
    ebpo_file *file;
    ebpo_model *model; /* made when first needed */
} ebpo_scene_file_entry;

typedef struct ebpo_scene_model_entry {
    char *name, *path;
    uint8_t digest[32];
    uint64_t instances;
    uint64_t file; /* index in scene.files; EBPO_SCENE_NONE: not loaded */
    double min[3], max[3];
} ebpo_scene_model_entry;

/* A key of a route. The rotation is a unit quaternion: x, y, z, w. */
typedef struct ebpo_route_key {
    double time, turn[4], translation[3], scale;
} ebpo_route_key;

typedef struct ebpo_scene_route {
    char *name;
    ebpo_route_key *keys; /* in ascending order of time */
    uint64_t count, capacity;
    bool jumps; /* the pose stays at a key until the time of the next key */
} ebpo_scene_route;

/* An instance and its sets. A set is what a name in rules selects: a layer, a group, an instance,
 * or all. An instance is in its own set, in that of all, and in those of its layer and its groups.
 */
typedef struct ebpo_scene_instance_entry {
    ebpo_scene_instance as; /* the entry owns the name in this struct */
    uint64_t *sets;         /* in ascending order, once the rules are sorted */
    uint32_t set_count;
} ebpo_scene_instance_entry;

/* A rule for pairs of an instance of set a and an instance of set b; a <= b. */
typedef struct ebpo_scene_rule_entry {
    uint64_t a, b;
    double clearance; /* below 0: the pairs are ignored */
} ebpo_scene_rule_entry;

/* A growing list: items, count, capacity. */
#define EBPO_SCENE_LIST(type, name) \
    type *name;                     \
    uint64_t name##_count, name##_capacity

struct ebpo_scene {
    EBPO_SCENE_LIST(ebpo_scene_model_entry, models);
    EBPO_SCENE_LIST(ebpo_scene_instance_entry, instances);
    EBPO_SCENE_LIST(ebpo_scene_route, routes);
    EBPO_SCENE_LIST(ebpo_scene_camera, cameras);
    EBPO_SCENE_LIST(ebpo_scene_rule_entry, rules); /* sorted, once a scene file has been read */
    EBPO_SCENE_LIST(char *, sets);     /* names of sets: "*", then those of layers, groups and
                                        * instances */
    EBPO_SCENE_LIST(uint64_t, layers); /* sets of layers */
    EBPO_SCENE_LIST(uint64_t, groups); /* sets of groups, in ascending order */
    EBPO_SCENE_LIST(ebpo_scene_file_entry, files);
    json_t *names; /* names of each kind and of sets, with their numbers */
    uint64_t ignored, clearances;
    char *folder; /* base of relative paths, "" or ending with "/" */
    char *text;   /* text from which the scene was read; NULL: none */
    size_t text_size;
    uint64_t text_models, text_instances; /* numbers of models and instances in that text */
    bool outside;                         /* files that the scene names may be outside the folder */
    ebpo_model_options how;               /* options of ebpo_scene_model */
};

#define EBPO_SCENE_ALL_SET 0

/* --- names --- */

/* Kinds of names; sets are "", "layer:" and "group:". No name begins with a control character. */
#define EBPO_SCENE_MODEL  "\001m"
#define EBPO_SCENE_ROUTE  "\001r"
#define EBPO_SCENE_CAMERA "\001c"
#define EBPO_SCENE_LAYER  "\001l"

/* Returns the number of the object with this name; EBPO_SCENE_NONE: the name does not exist. */
uint64_t ebpo_scene_find_name(const ebpo_scene *scene, const char *kind, const char *name);

/* --- adding members --- */

/* Add members that only scene files can have. Texts are copied; numbers must be valid. */
EBPO_MUST_USE ebpo_status ebpo_scene_add_layer(ebpo_scene *scene, const char *name,
                                               ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_scene_add_group(ebpo_scene *scene, const char *name,
                                               ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_scene_add_route(ebpo_scene *scene, const char *name,
                                               uint64_t *number, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_scene_add_camera(ebpo_scene *scene, const ebpo_scene_camera *camera,
                                                ebpo_error *error);
/* Adds the instance that was added last to a set. */
EBPO_MUST_USE ebpo_status ebpo_scene_join_set(ebpo_scene *scene, uint64_t set, ebpo_error *error);
/* Adds a rule; a clearance below 0 means that pairs are ignored. */
EBPO_MUST_USE ebpo_status ebpo_scene_add_rule(ebpo_scene *scene, uint64_t a, uint64_t b,
                                              double clearance, ebpo_error *error);

/* --- rules --- */

/* Sorts the rules; called before the caller gets the scene. */
void ebpo_scene_sort_rules(ebpo_scene *scene);

/* --- scene files --- */

/* Returns EBPO_E_LIMIT for a text of more than `max_bytes`. */
ebpo_status ebpo_scene_too_long(const char *name, const ebpo_scene_options *options,
                                ebpo_error *error);
/* Adds the content of `text` to an empty scene with a folder. */
EBPO_MUST_USE ebpo_status ebpo_scene_read_json(ebpo_scene *scene, const char *text, size_t size,
                                               const char *name, const ebpo_scene_options *options,
                                               ebpo_error *error);

/* --- routes --- */

/* Appends a key and normalises its quaternion. Fails with EBPO_E_ARGUMENT if a number is not
 * finite, the time is not above the last one or is beyond 2^1000, there is no rotation, or the
 * scale is out of range. */
EBPO_MUST_USE ebpo_status ebpo_scene_add_key(ebpo_scene_route *route, const ebpo_route_key *key,
                                             ebpo_error *error);
/* Returns the quaternion nearest to a matrix; its length is not 0, but need not be 1. */
void ebpo_scene_turn_of_matrix(const double m[3][3], double turn[4]);
void ebpo_scene_route_at(const ebpo_scene_route *route, double time, ebpo_pose *out);
/* Computes the pose that applies `inner` first, then `outer`. */
void ebpo_scene_compose(const ebpo_pose *outer, const ebpo_pose *inner, ebpo_pose *out);
/* Returns the end of the first part of from .. to in which the route's motion is smooth. This part
 * begins at `from`. */
double ebpo_scene_route_next(const ebpo_scene_route *route, double from, double to);

/* Returns an upper bound of the length of a vector, however small or large. */
double ebpo_scene_length_above(const double vector[3]);

/* Reach of points that follow a route. The first member bounds their distance from the route's
 * origin. The second is the size of the coordinates from which this bound is computed; it
 * determines the rounding. */
typedef struct ebpo_scene_reach {
    double length, size;
} ebpo_scene_reach;

/* Motion of points within `reach` of the route's origin, between two times without a key between
 * them. length: bound of their distance from their first position. sag: bound of their distance
 * from a point that moves at constant speed on the straight line from their first to their last
 * position. */
typedef struct ebpo_scene_step {
    double length, sag;
} ebpo_scene_step;
ebpo_scene_step ebpo_scene_route_step(const ebpo_scene_route *route, double from, double to,
                                      ebpo_scene_reach reach);

/* Returns the part of the motion of points on the route that does not shrink with the interval of
 * time, which rounding causes. */
double ebpo_scene_route_rounding(const ebpo_scene_route *route, ebpo_scene_reach reach);

/* Bounds the change of the distance of two instances on one route between `from` and `to`,
 * including rounding. reach: the sum of both instances' reaches. from < to. */
double ebpo_scene_route_growth(const ebpo_scene_route *route, double from, double to,
                               ebpo_scene_reach reach);

/* --- boxes --- */

/* Returns the reach of the instance's points from the origin of its route. */
ebpo_scene_reach ebpo_scene_reach_of(const ebpo_scene *scene,
                                     const ebpo_scene_instance_entry *instance);

/* --- files that a scene names --- */

/* Returns NULL, or the reason why the scene may not name this file. */
const char *ebpo_scene_path_refused(const char *path, const ebpo_scene_options *options,
                                    bool has_digest);
/* Returns the path by which a file is opened, from malloc; NULL without memory. */
char *ebpo_scene_join_path(const char *folder, const char *path);
/* Checks a path before opening, for a scene with this folder that may not name files outside. Fails
 * with EBPO_E_FORMAT if links lead out of the folder, EBPO_E_IO, EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_scene_stays_within(const char *folder, const char *path,
                                                  ebpo_error *error);
/* Returns the part of a path up to its last "/", or "", from malloc. */
char *ebpo_scene_folder_of(const char *path);

/* --- the text of a scene file --- */

/* Returns the length of a UTF-8 byte order mark at the beginning of a text: 0 or 3. */
size_t ebpo_scene_bom_length(const char *text, size_t size);

/* Returns EBPO_E_LIMIT for more than `max_values` values or 32 levels, without parsing. */
EBPO_MUST_USE ebpo_status ebpo_scene_text_fits(const char *text, size_t size, uint64_t max_values,
                                               ebpo_error *error);

/* A step of the path to a member: a key, or the index of an item if the key is NULL. */
typedef struct ebpo_scene_at {
    const char *key;
    uint64_t item;
} ebpo_scene_at;
enum { EBPO_SCENE_DEPTH = 32 };

#endif
