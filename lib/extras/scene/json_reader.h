/* Reads members of a scene file. Errors name the line, the path and the expected value. */
#ifndef EBPO_SCENE_JSON_READER_H
#define EBPO_SCENE_JSON_READER_H

#include "extras/scene/scene_parts.h"

typedef struct ebpo_json_reader {
    ebpo_scene *scene;
    const char *text, *name; /* the scene file's text, and its name for messages */
    const ebpo_scene_options *options;
    uint64_t pose_bytes; /* number of bytes that may still be read from files of poses */
    ebpo_scene_at path[EBPO_SCENE_DEPTH];
    int depth; /* number of steps in `path` */
    ebpo_error *error;
} ebpo_json_reader;

/* The first function adds a member, or an item if `key` is NULL, to the path of the current value;
 * the second removes it from the path. */
void ebpo_json_enter(ebpo_json_reader *r, const char *key, uint64_t item);
void ebpo_json_leave(ebpo_json_reader *r);

/* Returns EBPO_E_FORMAT with a message about the entered value. */
ebpo_status ebpo_json_bad(ebpo_json_reader *r, const char *format, ...) EBPO_PRINTF(2, 3);
/* Returns EBPO_E_FORMAT with a message about the member `key` of the entered value. */
ebpo_status ebpo_json_bad_at(ebpo_json_reader *r, const char *key, const char *what);
/* Converts EBPO_E_ARGUMENT with the message `why` into the error of ebpo_json_bad; returns other
 * errors unchanged. */
ebpo_status ebpo_json_locate_error(ebpo_json_reader *r, ebpo_status status, const ebpo_error *why);

/* Checks that the value is an object with only these members (NULL ends the list) and private ones,
 * "x-...". */
EBPO_MUST_USE ebpo_status ebpo_json_members(ebpo_json_reader *r, const json_t *value,
                                            const char *const *known);

/* Read a member. If the member is missing, *out stays unchanged; if it is also `needed`, the
 * function fails with EBPO_E_FORMAT. */
EBPO_MUST_USE ebpo_status ebpo_json_get_text(ebpo_json_reader *r, const json_t *object,
                                             const char *key, bool needed, const char **out);
EBPO_MUST_USE ebpo_status ebpo_json_get_flag(ebpo_json_reader *r, const json_t *object,
                                             const char *key, bool *out);
EBPO_MUST_USE ebpo_status ebpo_json_get_real(ebpo_json_reader *r, const json_t *object,
                                             const char *key, bool needed, double *out);
EBPO_MUST_USE ebpo_status ebpo_json_get_reals(ebpo_json_reader *r, const json_t *object,
                                              const char *key, bool needed, double *out,
                                              size_t count);

/* Called for each member (or item) of the member `key`, if `key` exists. The member (or item) has
 * been entered. `name` is NULL in arrays. */
typedef ebpo_status (*ebpo_json_each_fn)(ebpo_json_reader *r, const char *name,
                                         const json_t *value);
EBPO_MUST_USE ebpo_status ebpo_json_each_member(ebpo_json_reader *r, const json_t *object,
                                                const char *key, ebpo_json_each_fn each);
EBPO_MUST_USE ebpo_status ebpo_json_each_item(ebpo_json_reader *r, const json_t *object,
                                              const char *key, ebpo_json_each_fn each);

#endif
