/* Reads members of a scene file. Errors name the line, the path and the expected value. */
#ifndef EBPO_SCENE_JSON_READER_H
#define EBPO_SCENE_JSON_READER_H

#include "extras/scene/scene_parts.h"

typedef struct ebpo_json_reader {
    ebpo_scene *scene;
    const char *text, *name; /* the scene file's text, and its name for messages */
    const ebpo_scene_options *options;
    uint64_t pose_bytes; /* number of bytes that may still be read from CSV files of poses */
    ebpo_scene_at path[EBPO_SCENE_DEPTH];
    int depth; /* number of steps in `path` */
    ebpo_error *error;
} ebpo_json_reader;

/* ebpo_json_enter appends a step to the path of the current value: the member `key`, or, if `key`
 * is NULL, the item with the index `item`. ebpo_json_leave removes the last step. */
void ebpo_json_enter(ebpo_json_reader *r, const char *key, uint64_t item);
void ebpo_json_leave(ebpo_json_reader *r);

/* Sets r->error to a message about the current value. Always returns EBPO_E_FORMAT. */
ebpo_status ebpo_json_bad(ebpo_json_reader *r, const char *format, ...) EBPO_PRINTF(2, 3);
/* Sets r->error to a message about the member `key` of the current value. Always returns
 * EBPO_E_FORMAT. */
ebpo_status ebpo_json_bad_at(ebpo_json_reader *r, const char *key, const char *what);
/* Converts the status EBPO_E_ARGUMENT with the message `why` into the error of ebpo_json_bad, which
 * names the line and the path. Returns other statuses unchanged. */
ebpo_status ebpo_json_locate_error(ebpo_json_reader *r, ebpo_status status, const ebpo_error *why);

/* Checks that the value is an object that has only members in the list `known` (NULL ends it) and
 * private members, whose names begin with "x-". */
EBPO_MUST_USE ebpo_status ebpo_json_members(ebpo_json_reader *r, const json_t *value,
                                            const char *const *known);

/* Each of the next functions reads a member of an object. If the member is missing, the function
 * does not change *out, and fails with EBPO_E_FORMAT if the member is `needed`. The function also
 * fails if the member has another type. ebpo_json_get_flag: the member is never needed. */
EBPO_MUST_USE ebpo_status ebpo_json_get_text(ebpo_json_reader *r, const json_t *object,
                                             const char *key, bool needed, const char **out);
EBPO_MUST_USE ebpo_status ebpo_json_get_flag(ebpo_json_reader *r, const json_t *object,
                                             const char *key, bool *out);
EBPO_MUST_USE ebpo_status ebpo_json_get_real(ebpo_json_reader *r, const json_t *object,
                                             const char *key, bool needed, double *out);
EBPO_MUST_USE ebpo_status ebpo_json_get_reals(ebpo_json_reader *r, const json_t *object,
                                              const char *key, bool needed, double *out,
                                              size_t count);

/* ebpo_json_each_member calls a function for each member of the object `key`, and
 * ebpo_json_each_item for each item of the array `key`. Both do nothing if the member `key` is
 * missing. During a call, the path of the reader ends with the member or item. name: key of the
 * member; NULL for items. */
typedef ebpo_status (*ebpo_json_each_fn)(ebpo_json_reader *r, const char *name,
                                         const json_t *value);
EBPO_MUST_USE ebpo_status ebpo_json_each_member(ebpo_json_reader *r, const json_t *object,
                                                const char *key, ebpo_json_each_fn each);
EBPO_MUST_USE ebpo_status ebpo_json_each_item(ebpo_json_reader *r, const json_t *object,
                                              const char *key, ebpo_json_each_fn each);

#endif
