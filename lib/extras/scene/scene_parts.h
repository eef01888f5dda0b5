/* What a scene is made of, within the module. */
#ifndef EBPO_SCENE_SCENE_PARTS_H
#define EBPO_SCENE_SCENE_PARTS_H

#include <ebpo/scene.h>
#include <jansson.h>

/* A file that is open: one for all models of a path. */
typedef struct scene_file {
    char *path; /* as it is opened */
    ebpo_file *file;
    ebpo_model *model; /* made when it is first asked for */
} scene_file;

typedef struct scene_model {
    char *name, *path;
    uint8_t digest[32];
    uint64_t instances;
    uint64_t file; /* of scene.files; EBPO_SCENE_NONE: not loaded */
    double min[3], max[3];
} scene_model;

/* A moment of a route. The rotation is that of a unit quaternion: x, y, z, w. */
typedef struct scene_key {
    double time, turn[4], translation[3], scale;
} scene_key;

typedef struct scene_route {
    char *name;
    scene_key *keys; /* times ascend */
    uint64_t count, capacity;
    bool jumps; /* stays at a key until the next one's time */
} scene_route;

/* A name that rules use: a layer, a group, an instance, or all. The sets of an instance are its
 * own, that of all, its layer's and its groups'. */
typedef struct scene_instance {
    ebpo_scene_instance as; /* its name is owned */
    uint64_t *sets;         /* ascending, once the rules are sorted */
    uint32_t set_count;
} scene_instance;

/* Of two sets, a <= b: pairs of one of each. */
typedef struct scene_rule {
    uint64_t a, b;
    double clearance; /* below 0: ignored */
} scene_rule;

/* A growing list: items, how many, room. */
#define SCENE_LIST(type, name) \
    type *name;                \
    uint64_t name##_count, name##_capacity

struct ebpo_scene {
    SCENE_LIST(scene_model, models);
    SCENE_LIST(scene_instance, instances);
    SCENE_LIST(scene_route, routes);
    SCENE_LIST(ebpo_scene_camera, cameras);
    SCENE_LIST(scene_rule, rules); /* sorted, once a file is read */
    SCENE_LIST(char *, sets);      /* names: "*", those of layers, groups and instances */
    SCENE_LIST(uint64_t, layers);  /* their sets */
    SCENE_LIST(uint64_t, groups);  /* the same, ascending */
    SCENE_LIST(scene_file, files);
    json_t *names; /* of each kind and of sets, with their numbers */
    uint64_t ignored, clearances;
    char *folder; /* where relative paths begin, "" or with a closing "/" */
    char *text;   /* that it was read from; NULL: none */
    size_t text_size;
    uint64_t text_models, text_instances; /* that are in it */
    bool outside;                         /* what it names may lie outside the folder */
    ebpo_model_options how;               /* of ebpo_scene_model */
};

#define SCENE_ALL_SET 0

/* ---- scene_names.c ---- */

/* Kinds of names; sets are "", "layer:" and "group:". No name begins with a control character. */
#define SCENE_MODEL  "\001m"
#define SCENE_ROUTE  "\001r"
#define SCENE_CAMERA "\001c"
#define SCENE_LAYER  "\001l"

/* 1 to 255 bytes of UTF-8 without control characters, not beginning as selectors do. */
EBPO_MUST_USE ebpo_status scene_check_name(const char *name, const char *what, ebpo_error *error);
/* Gives `kind` and `name` a number. EBPO_E_ARGUMENT: there is one already. */
EBPO_MUST_USE ebpo_status scene_put_name(ebpo_scene *scene, const char *kind, const char *name,
                                         uint64_t number, ebpo_error *error);
/* EBPO_SCENE_NONE: there is none. */
uint64_t scene_find_name(const ebpo_scene *scene, const char *kind, const char *name);
/* A new set; *set may be NULL. */
EBPO_MUST_USE ebpo_status scene_add_set(ebpo_scene *scene, const char *kind, const char *name,
                                        uint64_t *set, ebpo_error *error);

/* ---- scene_make.c ---- */

/* What only files can say. Texts are copied; numbers are valid. */
EBPO_MUST_USE ebpo_status scene_add_layer(ebpo_scene *scene, const char *name, ebpo_error *error);
EBPO_MUST_USE ebpo_status scene_add_group(ebpo_scene *scene, const char *name, ebpo_error *error);
EBPO_MUST_USE ebpo_status scene_add_route(ebpo_scene *scene, const char *name, uint64_t *number,
                                          ebpo_error *error);
EBPO_MUST_USE ebpo_status scene_add_camera(ebpo_scene *scene, const ebpo_scene_camera *camera,
                                           ebpo_error *error);
/* Of the instance that was added last. */
EBPO_MUST_USE ebpo_status scene_join_set(ebpo_scene *scene, uint64_t set, ebpo_error *error);
/* clearance below 0: ignored. */
EBPO_MUST_USE ebpo_status scene_add_rule(ebpo_scene *scene, uint64_t a, uint64_t b,
                                         double clearance, ebpo_error *error);

/* ---- scene_rules.c ---- */

/* Before the scene is handed out. */
void scene_sort_rules(ebpo_scene *scene);

/* ---- scene_json.c ---- */

/* EBPO_E_LIMIT, of a text of more than `most_bytes`. */
ebpo_status scene_too_long(const char *name, const ebpo_scene_options *options, ebpo_error *error);
/* Adds what `text` says to an empty scene with a folder. */
EBPO_MUST_USE ebpo_status scene_read_json(ebpo_scene *scene, const char *text, size_t size,
                                          const char *name, const ebpo_scene_options *options,
                                          ebpo_error *error);

/* ---- route.c ---- */

/* Appends; a key's rotation is made a unit quaternion's. EBPO_E_ARGUMENT: not finite, time not
 * above the last or beyond 2^1000, no rotation, scale out of range. */
EBPO_MUST_USE ebpo_status scene_add_key(scene_route *route, const scene_key *key,
                                        ebpo_error *error);
/* The quaternion nearest to a matrix, of any length but 0. */
void scene_turn_of_matrix(const double m[3][3], double turn[4]);
void scene_route_at(const scene_route *route, double time, ebpo_pose *out);
/* `outer` after `inner`. */
void scene_compose(const ebpo_pose *outer, const ebpo_pose *inner, ebpo_pose *out);
/* Parts of from .. to between which a route's motion is smooth: the time at which the one that
 * begins at `from` ends. */
double scene_route_next(const scene_route *route, double from, double to);

/* At least the length, however small or large. */
double scene_length_above(const double way[3]);

/* Of points that follow a route: how far from its origin, at most; and how large the coordinates
 * are that this is made of, which rounding goes by. */
typedef struct scene_reach {
    double length, size;
} scene_reach;

/* How points within `reach` of the route's origin move between two times that no key is between:
 * at most `length` from where they were; and at most `sag` off the straight line from the first to
 * the last place, passed evenly. */
typedef struct scene_step {
    double length, sag;
} scene_step;
scene_step scene_route_step(const scene_route *route, double from, double to, scene_reach reach);

/* Of points that follow the route, anywhere on it: the part of their steps that does not become
 * shorter with them. */
double scene_route_rounding(const scene_route *route, scene_reach reach);

/* How far the distance of two things that ride on what moves along the route changes on its way
 * from .. to, at most, by rounding too. reach: the sum of both. from < to. */
double scene_route_growth(const scene_route *route, double from, double to, scene_reach reach);

/* ---- scene_boxes.c ---- */

/* Of the instance's points, from the origin of what moves along its route. */
scene_reach scene_reach_of(const ebpo_scene *scene, const scene_instance *instance);

/* ---- scene_csv.c ---- */

/* Adds a file of poses to a route. *left: bytes that may still be read. */
EBPO_MUST_USE ebpo_status scene_read_csv(scene_route *route, const char *path, uint64_t *left,
                                         ebpo_error *error);

/* ---- scene_paths.c ---- */

/* NULL, or why the scene may not name this file. */
const char *scene_path_refused(const char *path, const ebpo_scene_options *options,
                               bool has_digest);
/* `path` as it is opened: malloc's, NULL without memory. */
char *scene_join_path(const char *folder, const char *path);
/* Of a path as it is opened, of a scene with this folder that may not name others: EBPO_E_FORMAT
 * where links lead it out of the folder. EBPO_E_IO, EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status scene_stays_within(const char *folder, const char *path,
                                             ebpo_error *error);
/* The part of a path up to its last "/", or "": malloc's. */
char *scene_folder_of(const char *path);

/* ---- json_text.c ---- */

/* Bytes of a byte order mark of UTF-8 that a text begins with: 0 or 3. */
size_t scene_text_mark(const char *text, size_t size);

/* EBPO_E_LIMIT: more than so many values or 32 levels of them, seen without parsing. */
EBPO_MUST_USE ebpo_status scene_text_fits(const char *text, size_t size, uint64_t most_values,
                                          ebpo_error *error);

/* A member's place: keys, and numbers of items where the key is NULL. */
typedef struct scene_at {
    const char *key;
    uint64_t item;
} scene_at;
enum { SCENE_DEPTH = 32 };
/* The line, from 1, on which the value at path[count] begins in text that is valid JSON; where that
 * is not there, of the deepest one above it that is. */
uint64_t scene_line_of(const char *text, const scene_at *path, int count);

#endif
