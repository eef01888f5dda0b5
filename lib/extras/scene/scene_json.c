/* A scene from its file (format-spec/scene.md). */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/error.h"
#include "io/file_source.h"
#include "extras/scene/json_reader.h"
#include "extras/scene/json_routes.h"

/* ---- names ---- */

static ebpo_status read_name(json_reader *r, const json_t *value, const char **name)
{
    if (!json_is_string(value))
        return json_bad(r, "is not a name");
    *name = json_string_value(value);
    return EBPO_OK;
}

static ebpo_status read_layer(json_reader *r, const char *key, const json_t *value)
{
    (void)key;
    ebpo_error why = EBPO_ERROR_INIT;
    const char *name = NULL;
    ebpo_status status = read_name(r, value, &name);
    return status == EBPO_OK ? json_judge(r, scene_add_layer(r->scene, name, &why), &why) : status;
}

static ebpo_status read_group(json_reader *r, const char *key, const json_t *value)
{
    (void)key;
    ebpo_error why = EBPO_ERROR_INIT;
    const char *name = NULL;
    ebpo_status status = read_name(r, value, &name);
    return status == EBPO_OK ? json_judge(r, scene_add_group(r->scene, name, &why), &why) : status;
}

/* ---- models ---- */

static int digit(char c)
{
    const char *digits = "0123456789abcdef", *at = c ? strchr(digits, c) : NULL;
    return at ? (int)(at - digits) : -1;
}

static bool read_digest(const char *hex, uint8_t out[32])
{
    bool fits = strlen(hex) == 64;
    for (int i = 0; i < 32 && fits; i++) {
        int high = digit(hex[2 * i]), low = digit(hex[2 * i + 1]);
        fits = high >= 0 && low >= 0;
        out[i] = fits ? (uint8_t)(high << 4 | low) : 0;
    }
    return fits;
}

static ebpo_status read_model(json_reader *r, const char *name, const json_t *value)
{
    static const char *const known[] = { "file", "content_sha256", "subset_of", NULL };
    const char *path = NULL, *hex = NULL, *from = NULL;
    uint8_t digest[32];
    ebpo_error why = EBPO_ERROR_INIT;
    ebpo_status status = json_members(r, value, known);
    if (status == EBPO_OK)
        status = json_get_text(r, value, "file", true, &path);
    if (status == EBPO_OK)
        status = json_get_text(r, value, "content_sha256", false, &hex);
    if (status == EBPO_OK)
        status = json_get_text(r, value, "subset_of", false, &from);
    if (status != EBPO_OK)
        return status;
    if (from && !read_digest(from, digest))
        return json_bad_at(r, "subset_of", "is not 64 digits 0-9 a-f");
    if (hex && !read_digest(hex, digest))
        return json_bad_at(r, "content_sha256", "is not 64 digits 0-9 a-f");
    const char *refused = scene_path_refused(path, r->options, hex != NULL);
    if (refused)
        return json_bad_at(r, "file", refused);
    status = ebpo_scene_add_model(r->scene, name, path, hex ? digest : NULL, NULL, &why);
    return json_judge(r, status, &why);
}

/* ---- instances ---- */

/* The number of what `key` names; *number stays where it is missing. */
static ebpo_status find(json_reader *r, const json_t *object, const char *key, const char *kind,
                        bool needed, uint64_t *number)
{
    const char *name = NULL;
    ebpo_status status = json_get_text(r, object, key, needed, &name);
    if (status != EBPO_OK || !name)
        return status;
    *number = scene_find_name(r->scene, kind, name);
    return *number != EBPO_SCENE_NONE ? EBPO_OK : json_bad_at(r, key, "is not one of this scene");
}

static ebpo_status join_group(json_reader *r, const char *key, const json_t *value)
{
    (void)key;
    ebpo_error why = EBPO_ERROR_INIT;
    const char *name = NULL;
    ebpo_status status = read_name(r, value, &name);
    if (status != EBPO_OK)
        return status;
    uint64_t set = scene_find_name(r->scene, "group:", name);
    return set == EBPO_SCENE_NONE ? json_bad(r, "is not a group of this scene")
                                  : json_judge(r, scene_join_set(r->scene, set, &why), &why);
}

static ebpo_status read_instance(json_reader *r, const char *key, const json_t *value)
{
    static const char *const known[] = { "name",  "model",  "pose",  "route",
                                         "layer", "groups", "fixed", NULL };
    (void)key;
    ebpo_scene_instance i = EBPO_SCENE_INSTANCE_INIT;
    ebpo_error why = EBPO_ERROR_INIT;
    ebpo_status status = json_members(r, value, known);
    if (status == EBPO_OK)
        status = json_get_text(r, value, "name", true, &i.name);
    if (status == EBPO_OK)
        status = find(r, value, "model", SCENE_MODEL, true, &i.model);
    if (status == EBPO_OK)
        status = find(r, value, "route", SCENE_ROUTE, false, &i.route);
    if (status == EBPO_OK)
        status = find(r, value, "layer", SCENE_LAYER, false, &i.layer);
    if (status == EBPO_OK)
        status = json_get_flag(r, value, "fixed", &i.fixed);
    if (status == EBPO_OK)
        status = json_read_pose(r, value, "pose", &i.pose);
    if (status == EBPO_OK)
        status = json_judge(r, ebpo_scene_add_instance(r->scene, &i, NULL, &why), &why);
    return status == EBPO_OK ? json_each_item(r, value, "groups", join_group) : status;
}

/* ---- cameras ---- */

static ebpo_status check_camera(json_reader *r, const ebpo_scene_camera *c, const double pixels[2])
{
    double see[3], cross = 0;
    for (int k = 0; k < 3; k++)
        see[k] = c->target[k] - c->eye[k];
    for (int k = 0; k < 3; k++) {
        int u = (k + 1) % 3, v = (k + 2) % 3;
        cross = fmax(cross, fabs(see[u] * c->up[v] - see[v] * c->up[u]));
    }
    if (!(cross > 0 && cross < INFINITY))
        return json_bad(r, "target is not beside eye, or up points to it");
    if (!(c->fov > 0 && c->fov < 180))
        return json_bad_at(r, "fov", "is not between 0 and 180 degrees");
    for (int k = 0; k < 2; k++)
        if (!(pixels[k] >= 1 && pixels[k] <= 65536 && pixels[k] == floor(pixels[k])))
            return json_bad_at(r, "pixels", "is not two whole numbers from 1 to 65536");
    return EBPO_OK;
}

static ebpo_status read_camera(json_reader *r, const char *key, const json_t *value)
{
    static const char *const known[] = { "name", "eye",    "target", "up",
                                         "fov",  "pixels", "route",  NULL };
    (void)key;
    ebpo_scene_camera c = EBPO_SCENE_CAMERA_INIT;
    double pixels[2] = { 1280, 720 };
    ebpo_error why = EBPO_ERROR_INIT;
    c.up[2] = 1;
    c.fov = 45;
    c.route = EBPO_SCENE_NONE;
    ebpo_status status = json_members(r, value, known);
    if (status == EBPO_OK)
        status = json_get_text(r, value, "name", true, &c.name);
    if (status == EBPO_OK)
        status = json_get_reals(r, value, "eye", true, c.eye, 3);
    if (status == EBPO_OK)
        status = json_get_reals(r, value, "target", true, c.target, 3);
    if (status == EBPO_OK)
        status = json_get_reals(r, value, "up", false, c.up, 3);
    if (status == EBPO_OK)
        status = json_get_real(r, value, "fov", false, &c.fov);
    if (status == EBPO_OK)
        status = json_get_reals(r, value, "pixels", false, pixels, 2);
    if (status == EBPO_OK)
        status = find(r, value, "route", SCENE_ROUTE, false, &c.route);
    if (status == EBPO_OK)
        status = check_camera(r, &c, pixels);
    if (status != EBPO_OK)
        return status;
    c.width = (uint32_t)pixels[0];
    c.height = (uint32_t)pixels[1];
    return json_judge(r, scene_add_camera(r->scene, &c, &why), &why);
}

/* ---- rules ---- */

/* An array of two selectors. */
static ebpo_status read_two(json_reader *r, const json_t *two, uint64_t set[2])
{
    if (!json_is_array(two) || json_array_size(two) != 2)
        return json_bad(r, "is not an array of two names");
    for (size_t i = 0; i < 2; i++) {
        const char *name = json_string_value(json_array_get(two, i));
        set[i] = name ? scene_find_name(r->scene, "", name) : EBPO_SCENE_NONE;
        if (set[i] == EBPO_SCENE_NONE) {
            json_enter(r, NULL, i);
            ebpo_status status =
                json_bad(r, "is no instance, layer:NAME, group:NAME or * of this scene");
            json_leave(r);
            return status;
        }
    }
    return EBPO_OK;
}

static ebpo_status read_ignored(json_reader *r, const char *key, const json_t *value)
{
    (void)key;
    uint64_t set[2];
    ebpo_status status = read_two(r, value, set);
    return status == EBPO_OK ? scene_add_rule(r->scene, set[0], set[1], -1, r->error) : status;
}

static ebpo_status read_clearance(json_reader *r, const char *key, const json_t *value)
{
    static const char *const known[] = { "between", "distance", NULL };
    (void)key;
    uint64_t set[2];
    double distance = 0;
    ebpo_status status = json_members(r, value, known);
    if (status != EBPO_OK)
        return status;
    json_enter(r, "between", 0);
    status = read_two(r, json_object_get(value, "between"), set);
    json_leave(r);
    if (status == EBPO_OK)
        status = json_get_real(r, value, "distance", true, &distance);
    if (status == EBPO_OK && !(distance >= 0 && distance <= 0x1p1000))
        return json_bad_at(r, "distance", "is below 0 or beyond 2^1000");
    return status == EBPO_OK ? scene_add_rule(r->scene, set[0], set[1], distance, r->error)
                             : status;
}

/* ---- all of it ---- */

static ebpo_status check_version(json_reader *r, const json_t *root)
{
    const char *version = NULL;
    ebpo_status status = json_get_text(r, root, "ebpo_scene", true, &version);
    if (status != EBPO_OK)
        return status;
    if (strncmp(version, "1.", 2) != 0 || strspn(version + 2, "0123456789") == 0 ||
        version[2 + strspn(version + 2, "0123456789")] != 0)
        return ebpo_fail_file(r->error, EBPO_E_VERSION, r->name,
                              "is a scene of version %.20s; this program reads 1.0", version);
    return EBPO_OK;
}

static ebpo_status read_root(json_reader *r, const json_t *root)
{
    static const char *const known[] = { "ebpo_scene", "title",  "unit",      "models",
                                         "layers",     "groups", "routes",    "instances",
                                         "cameras",    "ignore", "clearance", NULL };
    const char *text;
    if (!json_is_object(root))
        return json_bad(r, "a scene is an object");
    ebpo_status status = check_version(r, root);
    if (status == EBPO_OK)
        status = json_members(r, root, known);
    if (status == EBPO_OK)
        status = json_get_text(r, root, "title", false, &text);
    if (status == EBPO_OK)
        status = json_get_text(r, root, "unit", false, &text);
    if (status == EBPO_OK)
        status = json_each_member(r, root, "models", read_model);
    if (status == EBPO_OK)
        status = json_each_item(r, root, "layers", read_layer);
    if (status == EBPO_OK)
        status = json_each_item(r, root, "groups", read_group);
    if (status == EBPO_OK)
        status = json_each_member(r, root, "routes", json_read_route);
    if (status == EBPO_OK)
        status = json_each_item(r, root, "instances", read_instance);
    if (status == EBPO_OK)
        status = json_each_item(r, root, "cameras", read_camera);
    if (status == EBPO_OK)
        status = json_each_item(r, root, "ignore", read_ignored);
    return status == EBPO_OK ? json_each_item(r, root, "clearance", read_clearance) : status;
}

static ebpo_status parse_failed(const char *name, const json_error_t *e, ebpo_error *error)
{
    char what[JSON_ERROR_TEXT_LENGTH];
    size_t i = 0;
    for (; e->text[i]; i++)
        what[i] = (unsigned char)e->text[i] < 0x20 ? ' ' : e->text[i];
    what[i] = 0;
    if (json_error_code(e) == json_error_out_of_memory)
        return ebpo_fail_memory(error, 1);
    return ebpo_fail_file(error, EBPO_E_FORMAT, name, "line %d: is not JSON: %s", e->line, what);
}

ebpo_status scene_too_long(const char *name, const ebpo_scene_options *options, ebpo_error *error)
{
    return ebpo_fail_file(error, EBPO_E_LIMIT, name, "has more than %llu bytes",
                          (unsigned long long)options->most_bytes);
}

ebpo_status scene_read_json(ebpo_scene *scene, const char *text, size_t size, const char *name,
                            const ebpo_scene_options *options, ebpo_error *error)
{
    json_error_t parsed;
    ebpo_error why = EBPO_ERROR_INIT;
    if (size > options->most_bytes)
        return scene_too_long(name, options, error);
    const char *foreign = ebpo_foreign_bytes((const uint8_t *)text, size);
    if (foreign)
        return ebpo_fail_file(error, EBPO_E_FORMAT, name, "%s", foreign);
    if (scene_text_fits(text, size, options->most_values, &why) != EBPO_OK)
        return ebpo_fail_file(error, EBPO_E_LIMIT, name, "%s", why.message);
    json_t *root =
        json_loadb(text, size, JSON_REJECT_DUPLICATES | JSON_DECODE_INT_AS_REAL, &parsed);
    if (!root)
        return parse_failed(name, &parsed, error);
    json_reader r = { .scene = scene,
                      .text = text,
                      .name = name,
                      .options = options,
                      .pose_bytes = options->most_pose_bytes,
                      .error = error };
    ebpo_status status = read_root(&r, root);
    if (status == EBPO_OK)
        scene_sort_rules(scene);
    json_decref(root);
    return status;
}
