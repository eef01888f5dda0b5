/* What a scene is made of, and what the files of lib/extras/scene share. */
#ifndef EBPO_SCENE_SCENE_PARTS_H
#define EBPO_SCENE_SCENE_PARTS_H

#include <ebpo/scene.h>
#include <jansson.h>

/* A file that is open: one for all models of a path. */
typedef struct ebpo_scene_file_entry {
    char *path; /* as it is opened */
    ebpo_file *file;
    ebpo_model *model; /* made when it is first asked for */
} ebpo_scene_file_entry;

typedef struct ebpo_scene_model_entry {
    char *name, *path;
    uint8_t digest[32];
    uint64_t instances;
    uint64_t file; /* of scene.files; EBPO_SCENE_NONE: not loaded */
    double min[3], max[3];
} ebpo_scene_model_entry;

/* A moment of a route. The rotation is that of a unit quaternion: x, y, z, w. */
typedef struct ebpo_route_key {
    double time, turn[4], translation[3], scale;
} ebpo_route_key;

typedef struct ebpo_scene_route {
    char *name;
    ebpo_route_key *keys; /* times ascend */
    uint64_t count, capacity;
    bool jumps; /* stays at a key until the next one's time */
} ebpo_scene_route;

/* A name that rules use: a layer, a group, an instance, or all. The sets of an instance are its
 * own, that of all, its layer's and its groups'. */
typedef struct ebpo_scene_instance_entry {
    ebpo_scene_instance as; /* its name is owned */
    uint64_t *sets;         /* ascending, once the rules are sorted */
    uint32_t set_count;
} ebpo_scene_instance_entry;

/* Of two sets, a <= b: pairs of one of each. */
typedef struct ebpo_scene_rule_entry {
    uint64_t a, b;
    double clearance; /* below 0: ignored */
} ebpo_scene_rule_entry;

/* A growing list: items, how many, room. */
#define EBPO_SCENE_LIST(type, name) \
    type *name;                     \
    uint64_t name##_count, name##_capacity

struct ebpo_scene {
    EBPO_SCENE_LIST(ebpo_scene_model_entry, models);
    EBPO_SCENE_LIST(ebpo_scene_instance_entry, instances);
    EBPO_SCENE_LIST(ebpo_scene_route, routes);
    EBPO_SCENE_LIST(ebpo_scene_camera, cameras);
    EBPO_SCENE_LIST(ebpo_scene_rule_entry, rules); /* sorted, once a file is read */
    EBPO_SCENE_LIST(char *, sets);     /* names: "*", those of layers, groups and instances */
    EBPO_SCENE_LIST(uint64_t, layers); /* their sets */
    EBPO_SCENE_LIST(uint64_t, groups); /* the same, ascending */
    EBPO_SCENE_LIST(ebpo_scene_file_entry, files);
    json_t *names; /* of each kind and of sets, with their numbers */
    uint64_t ignored, clearances;
    char *folder; /* where relative paths begin, "" or with a closing "/" */
    char *text;   /* that it was read from; NULL: none */
    size_t text_size;
    uint64_t text_models, text_instances; /* that are in it */
    bool outside;                         /* what it names may lie outside the folder */
    ebpo_model_options how;               /* of ebpo_scene_model */
};

#define EBPO_SCENE_ALL_SET 0

/* --- names --- */

/* Kinds of names; sets are "", "layer:" and "group:". No name begins with a control character. */
#define EBPO_SCENE_MODEL  "\001m"
#define EBPO_SCENE_ROUTE  "\001r"
#define EBPO_SCENE_CAMERA "\001c"
#define EBPO_SCENE_LAYER  "\001l"

/* EBPO_SCENE_NONE: there is none. */
uint64_t ebpo_scene_find_name(const ebpo_scene *scene, const char *kind, const char *name);

/* --- adding members --- */

/* What only files can say. Texts are copied; numbers are valid. */
EBPO_MUST_USE ebpo_status ebpo_scene_add_layer(ebpo_scene *scene, const char *name,
                                               ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_scene_add_group(ebpo_scene *scene, const char *name,
                                               ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_scene_add_route(ebpo_scene *scene, const char *name,
                                               uint64_t *number, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_scene_add_camera(ebpo_scene *scene, const ebpo_scene_camera *camera,
                                                ebpo_error *error);
/* Of the instance that was added last. */
EBPO_MUST_USE ebpo_status ebpo_scene_join_set(ebpo_scene *scene, uint64_t set, ebpo_error *error);
/* clearance below 0: ignored. */
EBPO_MUST_USE ebpo_status ebpo_scene_add_rule(ebpo_scene *scene, uint64_t a, uint64_t b,
                                              double clearance, ebpo_error *error);

/* --- rules --- */

/* Before the scene is handed out. */
void ebpo_scene_sort_rules(ebpo_scene *scene);

/* --- scene files --- */

/* EBPO_E_LIMIT, of a text of more than `most_bytes`. */
ebpo_status ebpo_scene_too_long(const char *name, const ebpo_scene_options *options,
                                ebpo_error *error);
/* Adds what `text` says to an empty scene with a folder. */
EBPO_MUST_USE ebpo_status ebpo_scene_read_json(ebpo_scene *scene, const char *text, size_t size,
                                               const char *name, const ebpo_scene_options *options,
                                               ebpo_error *error);

/* --- routes --- */

/* Appends; a key's rotation is made a unit quaternion's. EBPO_E_ARGUMENT: not finite, time not
 * above the last or beyond 2^1000, no rotation, scale out of range. */
EBPO_MUST_USE ebpo_status ebpo_scene_add_key(ebpo_scene_route *route, const ebpo_route_key *key,
                                             ebpo_error *error);
/* The quaternion nearest to a matrix, of any length but 0. */
void ebpo_scene_turn_of_matrix(const double m[3][3], double turn[4]);
void ebpo_scene_route_at(const ebpo_scene_route *route, double time, ebpo_pose *out);
/* `outer` after `inner`. */
void ebpo_scene_compose(const ebpo_pose *outer, const ebpo_pose *inner, ebpo_pose *out);
/* Parts of from .. to between which a route's motion is smooth: the time at which the one that
 * begins at `from` ends. */
double ebpo_scene_route_next(const ebpo_scene_route *route, double from, double to);

/* At least the length, however small or large. */
double ebpo_scene_length_above(const double way[3]);

/* Of points that follow a route: how far from its origin, at most; and how large the coordinates
 * are that this is made of, which rounding goes by. */
typedef struct ebpo_scene_reach {
    double length, size;
} ebpo_scene_reach;

/* How points within `reach` of the route's origin move between two times that no key is between:
 * at most `length` from where they were; and at most `sag` off the straight line from the first to
 * the last place, passed evenly. */
typedef struct ebpo_scene_step {
    double length, sag;
} ebpo_scene_step;
ebpo_scene_step ebpo_scene_route_step(const ebpo_scene_route *route, double from, double to,
                                      ebpo_scene_reach reach);

/* Of points that follow the route, anywhere on it: the part of their steps that does not become
 * shorter with them. */
double ebpo_scene_route_rounding(const ebpo_scene_route *route, ebpo_scene_reach reach);

/* How far the distance of two things that ride on what moves along the route changes on its way
 * from .. to, at most, by rounding too. reach: the sum of both. from < to. */
double ebpo_scene_route_growth(const ebpo_scene_route *route, double from, double to,
                               ebpo_scene_reach reach);

/* --- boxes --- */

/* Of the instance's points, from the origin of what moves along its route. */
ebpo_scene_reach ebpo_scene_reach_of(const ebpo_scene *scene,
                                     const ebpo_scene_instance_entry *instance);

/* --- files that a scene names --- */

/* NULL, or why the scene may not name this file. */
const char *ebpo_scene_path_refused(const char *path, const ebpo_scene_options *options,
                                    bool has_digest);
/* `path` as it is opened: malloc's, NULL without memory. */
char *ebpo_scene_join_path(const char *folder, const char *path);
/* Of a path as it is opened, of a scene with this folder that may not name others: EBPO_E_FORMAT
 * where links lead it out of the folder. EBPO_E_IO, EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_scene_stays_within(const char *folder, const char *path,
                                                  ebpo_error *error);
/* The part of a path up to its last "/", or "": malloc's. */
char *ebpo_scene_folder_of(const char *path);

/* --- the text of a scene file --- */

/* Bytes of a byte order mark of UTF-8 that a text begins with: 0 or 3. */
size_t ebpo_scene_text_mark(const char *text, size_t size);

/* EBPO_E_LIMIT: more than so many values or 32 levels of them, seen without parsing. */
EBPO_MUST_USE ebpo_status ebpo_scene_text_fits(const char *text, size_t size, uint64_t most_values,
                                               ebpo_error *error);

/* A member's place: keys, and numbers of items where the key is NULL. */
typedef struct ebpo_scene_at {
    const char *key;
    uint64_t item;
} ebpo_scene_at;
enum { EBPO_SCENE_DEPTH = 32 };

#endif
