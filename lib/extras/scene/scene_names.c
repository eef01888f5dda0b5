/* Names of a scene: each kind has its own, and selectors share one space. */
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "extras/scene/scene_parts.h"

enum { NAME_MOST = 255, KIND_MOST = 8 };

static bool is_plain(const char *name)
{
    for (const unsigned char *c = (const unsigned char *)name; *c; c++)
        if (*c < 0x20 || *c == 0x7f)
            return false;
    json_t *text = json_string(name); /* NULL where it is not UTF-8 */
    json_decref(text);
    return text != NULL;
}

ebpo_status scene_check_name(const char *name, const char *what, ebpo_error *error)
{
    size_t size = name ? strnlen(name, NAME_MOST + 1) : 0;
    if (size == 0 || size > NAME_MOST || !is_plain(name))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "a name of %s is 1 to %d bytes of UTF-8 without control characters", what,
                         NAME_MOST);
    if (strcmp(name, "*") == 0 || strncmp(name, "layer:", 6) == 0 ||
        strncmp(name, "group:", 6) == 0)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "'%.80s' cannot be a name of %s: '*', 'layer:' and 'group:' stand for "
                         "many",
                         name, what);
    return EBPO_OK;
}

static void join(char *out, size_t room, const char *kind, const char *name)
{
    size_t begin = strlen(kind), size = strnlen(name, room - begin - 1);
    memcpy(out, kind, begin);
    memcpy(out + begin, name, size);
    out[begin + size] = 0;
}

uint64_t scene_find_name(const ebpo_scene *scene, const char *kind, const char *name)
{
    char key[KIND_MOST + NAME_MOST + 2];
    join(key, sizeof key, kind, name);
    const json_t *number = json_object_get(scene->names, key);
    return number ? (uint64_t)json_integer_value(number) : EBPO_SCENE_NONE;
}

ebpo_status scene_put_name(ebpo_scene *scene, const char *kind, const char *name, uint64_t number,
                           ebpo_error *error)
{
    char key[KIND_MOST + NAME_MOST + 2];
    join(key, sizeof key, kind, name);
    if (json_object_get(scene->names, key))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "there is another '%.80s'", name);
    if (json_object_set_new(scene->names, key, json_integer((json_int_t)number)) != 0)
        return ebpo_fail_memory(error, sizeof key);
    return EBPO_OK;
}

ebpo_status scene_add_set(ebpo_scene *scene, const char *kind, const char *name, uint64_t *set,
                          ebpo_error *error)
{
    uint64_t number = scene->sets_count;
    if (!ebpo_grow(&scene->sets, &scene->sets_capacity, number + 1, sizeof *scene->sets))
        return ebpo_fail_memory(error, (number + 1) * sizeof *scene->sets);
    ebpo_status status = scene_put_name(scene, kind, name, number, error);
    if (status != EBPO_OK)
        return status;
    scene->sets[number] = strdup(name);
    if (!scene->sets[number])
        return ebpo_fail_memory(error, strlen(name));
    scene->sets_count++;
    if (set)
        *set = number;
    return EBPO_OK;
}
