/* Members of a scene file, and what is wrong with them: line, path, and what was expected. */
#ifndef EBPO_SCENE_JSON_READER_H
#define EBPO_SCENE_JSON_READER_H

#include "extras/scene/scene_parts.h"

typedef struct json_reader {
    ebpo_scene *scene;
    const char *text, *name;
    const ebpo_scene_options *options;
    uint64_t pose_bytes; /* that may still be read from other files */
    scene_at path[SCENE_DEPTH];
    int depth;
    ebpo_error *error;
} json_reader;

/* Into a member, or an item where `key` is NULL; and out of it. */
void json_enter(json_reader *r, const char *key, uint64_t item);
void json_leave(json_reader *r);

/* EBPO_E_FORMAT about the value that was entered. */
ebpo_status json_bad(json_reader *r, const char *format, ...) EBPO_PRINTF(2, 3);
/* The same of its member. */
ebpo_status json_bad_at(json_reader *r, const char *key, const char *what);
/* EBPO_E_ARGUMENT becomes json_bad; others are handed on. */
ebpo_status json_judge(json_reader *r, ebpo_status status, const ebpo_error *why);

/* An object of these members (NULL ends them) and private ones, "x-...". */
EBPO_MUST_USE ebpo_status json_members(json_reader *r, const json_t *value,
                                       const char *const *known);

/* *out stays where the member is missing; then EBPO_E_FORMAT if it is needed. */
EBPO_MUST_USE ebpo_status json_get_text(json_reader *r, const json_t *object, const char *key,
                                        bool needed, const char **out);
EBPO_MUST_USE ebpo_status json_get_flag(json_reader *r, const json_t *object, const char *key,
                                        bool *out);
EBPO_MUST_USE ebpo_status json_get_real(json_reader *r, const json_t *object, const char *key,
                                        bool needed, double *out);
EBPO_MUST_USE ebpo_status json_get_reals(json_reader *r, const json_t *object, const char *key,
                                         bool needed, double *out, size_t count);

/* Each member (or item) of the member `key`, which may be missing, entered. `name` is NULL in
 * arrays. */
typedef ebpo_status (*json_each_fn)(json_reader *r, const char *name, const json_t *value);
EBPO_MUST_USE ebpo_status json_each_member(json_reader *r, const json_t *object, const char *key,
                                           json_each_fn each);
EBPO_MUST_USE ebpo_status json_each_item(json_reader *r, const json_t *object, const char *key,
                                         json_each_fn each);

#endif
