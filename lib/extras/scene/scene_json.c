/* Reads a scene from its file: models, instances, layers, groups, cameras, rules and routes, and
 * the CSV files of poses that routes name.
 *
 * A scene file is untrusted input. Each member is checked for its type and range, names must be
 * unique, and other files may be named only as the options allow (scene_make.c). The first line of
 * a file of poses names its columns time, x, y, z, qx, qy, qz, qw and scale in any order. The bytes
 * of all such files are limited. Numbers are read in the C locale.
 *
 * See format-spec/scene.md. */
#include "core/strict_fp.h"

#include <locale.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/error.h"
#include "extras/scene/json_reader.h"
#include "extras/scene/scene_parts.h"
#include "geometry/decimal.h"
#include "geometry/pose.h"
#include "io/file_source.h"

/* COLUMNS: number of known columns of a CSV file; the first NEEDED of them must exist. FIELDS_MAX:
 * maximum number of fields of a line. */
enum { COLUMNS = 9, NEEDED = 8, FIELDS_MAX = 64 };
static const char *const columns[COLUMNS] = {
    "time", "x", "y", "z", "qx", "qy", "qz", "qw", "scale"
};

/* The text of a CSV file while it is read. */
typedef struct csv_lines {
    const char *at, *end; /* the text that has not been read */
    const char *name;     /* name of the file, for messages */
    uint64_t line;        /* number of lines read */
    int field[COLUMNS];   /* [column] index of the column's field in a line; -1: missing */
    int fields;           /* number of fields of each line */
    locale_t c_locale;
} csv_lines;

/* A part of the text: a line or a field, without blanks at its ends. */
typedef struct csv_text {
    const char *at;
    size_t size;
} csv_text;

static csv_text csv_trimmed(const char *from, const char *to)
{
    while (from < to && strchr(" \t\r", *from))
        from++;
    while (to > from && strchr(" \t\r", to[-1]))
        to--;
    return (csv_text){ from, (size_t)(to - from) };
}

/* Reads the next line that is not empty. Returns false at the end of the text. */
static bool next_line(csv_lines *l, csv_text *out)
{
    while (l->at < l->end) {
        const char *end = memchr(l->at, '\n', (size_t)(l->end - l->at));
        end = end ? end : l->end;
        *out = csv_trimmed(l->at, end);
        l->at = end < l->end ? end + 1 : end;
        l->line++;
        if (out->size)
            return true;
    }
    return false;
}

/* Splits a line at commas and semicolons. Returns the number of fields; -1: more than FIELDS_MAX.
 */
static int csv_split(csv_text line, csv_text field[FIELDS_MAX])
{
    int count = 0;
    const char *at = line.at, *end = line.at + line.size;
    for (;;) {
        const char *stop = at;
        while (stop < end && *stop != ',' && *stop != ';')
            stop++;
        if (count == FIELDS_MAX)
            return -1;
        field[count++] = csv_trimmed(at, stop);
        if (stop == end)
            return count;
        at = stop + 1;
    }
}

static ebpo_status csv_bad(const csv_lines *l, const char *what, ebpo_error *error)
{
    return ebpo_fail_file(error, EBPO_E_FORMAT, l->name, "line %llu: %s",
                          (unsigned long long)l->line, what);
}

static ebpo_status read_header(csv_lines *l, ebpo_error *error)
{
    csv_text line, field[FIELDS_MAX];
    for (int k = 0; k < COLUMNS; k++)
        l->field[k] = -1;
    if (!next_line(l, &line))
        return csv_bad(l, "there are no poses", error);
    l->fields = csv_split(line, field);
    for (int i = 0; i < l->fields; i++) {
        int k = 0;
        while (k < COLUMNS && (strlen(columns[k]) != field[i].size ||
                               memcmp(columns[k], field[i].at, field[i].size) != 0))
            k++;
        if (k == COLUMNS || l->field[k] >= 0)
            return csv_bad(l, "each column must be one of time, x, y, z, qx, qy, qz, qw, scale",
                           error);
        l->field[k] = i;
    }
    for (int k = 0; k < NEEDED; k++)
        if (l->field[k] < 0)
            return csv_bad(l, "the first line must name columns time, x, y, z, qx, qy, qz, qw",
                           error);
    return EBPO_OK;
}

static ebpo_status read_row(csv_lines *l, csv_text line, ebpo_scene_route *route, ebpo_error *error)
{
    csv_text field[FIELDS_MAX];
    double v[COLUMNS] = { [8] = 1 };
    if (csv_split(line, field) != l->fields)
        return csv_bad(l, "the number of fields differs from the number of columns", error);
    for (int k = 0; k < COLUMNS; k++)
        if (l->field[k] >= 0 &&
            !ebpo_number_double(&v[k], field[l->field[k]].at, field[l->field[k]].size, l->c_locale))
            return csv_bad(l, "expected a number in every column", error);
    ebpo_route_key key = {
        v[0],
        { v[4], v[5], v[6], v[7] },
        { v[1], v[2], v[3] },
        v[8],
    };
    ebpo_error why = EBPO_ERROR_INIT;
    ebpo_status status = ebpo_scene_add_key(route, &key, &why);
    return status == EBPO_E_ARGUMENT ? csv_bad(l, why.message, error)
           : status != EBPO_OK       ? ebpo_fail_with(error, &why)
                                     : EBPO_OK;
}

static ebpo_status read_rows(csv_lines *l, ebpo_scene_route *route, ebpo_error *error)
{
    csv_text line;
    ebpo_status status = read_header(l, error);
    while (status == EBPO_OK && next_line(l, &line))
        status = read_row(l, line, route, error);
    if (status == EBPO_OK && !route->count)
        status = csv_bad(l, "there are no poses", error);
    return status;
}

static ebpo_status read_text(const ebpo_whole_file *file, ebpo_scene_route *route, const char *path,
                             ebpo_error *error)
{
    csv_lines l = { (const char *)file->data,
                    (const char *)file->data + file->size,
                    path,
                    0,
                    { 0 },
                    0,
                    newlocale(LC_ALL_MASK, "C", (locale_t)0) };
    ebpo_status status;
    const char *wrong_kind = ebpo_wrong_kind_of_file(file->data, file->size);
    l.at += ebpo_scene_bom_length(l.at, file->size);
    if (wrong_kind)
        status = ebpo_fail_file(error, EBPO_E_FORMAT, path, "%s", wrong_kind);
    else if (!l.c_locale)
        status = ebpo_fail_memory(error, 1);
    else
        status = read_rows(&l, route, error);
    if (l.c_locale)
        freelocale(l.c_locale);
    return status;
}

/* Adds the poses of a CSV file to a route. Decreases *bytes_left, the number of bytes that may
 * still be read from CSV files, by the size of this file. */
static ebpo_status read_csv_file(ebpo_scene_route *route, const char *path, uint64_t *bytes_left,
                                 ebpo_error *error)
{
    ebpo_whole_file file = EBPO_WHOLE_FILE_INIT;
    ebpo_status status = ebpo_whole_file_open(&file, path, error);
    if (status == EBPO_OK && file.size > *bytes_left)
        status =
            ebpo_fail_file(error, EBPO_E_LIMIT, path,
                           "with this file, the CSV files of poses together have more bytes than "
                           "max_pose_bytes");
    if (status == EBPO_OK)
        status = ebpo_whole_file_load(&file, NULL, 1, NULL, path, error);
    if (status == EBPO_OK)
        status = read_text(&file, route, path, error);
    if (status == EBPO_OK)
        status = ebpo_whole_file_unchanged(&file, path, error);
    if (status == EBPO_OK)
        *bytes_left -= file.size;
    ebpo_whole_file_close(&file);
    return status;
}

/* --- poses and routes --- */

/* A pose as a scene file gives it: the rotation is a matrix, or a quaternion x, y, z, w of any
 * length. */
typedef struct read_pose {
    ebpo_pose pose;
    double quaternion[4];
    bool has_quaternion;
} read_pose;

static ebpo_status pose_members(ebpo_json_reader *r, const json_t *value, read_pose *out)
{
    static const char *const known[] = { "translation", "rotation", "quaternion", "scale", NULL };
    ebpo_pose *p = &out->pose;
    ebpo_status status = ebpo_json_members(r, value, known);
    if (status == EBPO_OK)
        status = ebpo_json_get_reals(r, value, "translation", false, p->translation, 3);
    if (status == EBPO_OK)
        status = ebpo_json_get_reals(r, value, "rotation", false, &p->rotation[0][0], 9);
    if (status == EBPO_OK)
        status = ebpo_json_get_reals(r, value, "quaternion", false, out->quaternion, 4);
    if (status == EBPO_OK)
        status = ebpo_json_get_real(r, value, "scale", false, &p->scale);
    out->has_quaternion = json_object_get(value, "quaternion") != NULL;
    if (status == EBPO_OK && out->has_quaternion && json_object_get(value, "rotation"))
        return ebpo_json_bad(r, "has both rotation and quaternion");
    return status;
}

/* Appends a key to a route: a time, and a pose with a unit quaternion. */
static ebpo_status add_pose_key(ebpo_json_reader *r, const read_pose *p, double time,
                                ebpo_scene_route *route)
{
    static const double origin[3] = { 0, 0, 0 };
    ebpo_error why = EBPO_ERROR_INIT;
    ebpo_posing posing;
    ebpo_route_key key = { .time = time, .scale = p->pose.scale };
    memcpy(key.translation, p->pose.translation, sizeof key.translation);
    memcpy(key.quaternion, p->quaternion, sizeof key.quaternion);
    if (!p->has_quaternion) {
        /* only checks the matrix; `posing` is not used */
        ebpo_status status = ebpo_posing_make(&posing, &p->pose, origin, &why);
        if (status != EBPO_OK)
            return ebpo_json_locate_error(r, status, &why);
        ebpo_scene_quaternion_of_matrix(p->pose.rotation, key.quaternion);
    }
    return ebpo_json_locate_error(r, ebpo_scene_add_key(route, &key, &why), &why);
}

/* Reads a pose. Does not change *out if the member is missing. */
static ebpo_status json_read_pose(ebpo_json_reader *r, const json_t *object, const char *key,
                                  ebpo_pose *out)
{
    const json_t *value = json_object_get(object, key);
    if (!value)
        return EBPO_OK;
    read_pose p = { .pose = EBPO_POSE_INIT };
    ebpo_scene_route single = { 0 };
    ebpo_json_enter(r, key, 0);
    ebpo_status status = pose_members(r, value, &p);
    if (status == EBPO_OK && p.has_quaternion) {
        status = add_pose_key(r, &p, 0, &single);
        if (status == EBPO_OK)
            ebpo_scene_route_at(&single, 0, &p.pose);
        free(single.keys);
    }
    ebpo_json_leave(r);
    *out = p.pose; /* if the rotation is a matrix, ebpo_scene_add_instance checks it */
    return status;
}

static ebpo_scene_route *last_route(ebpo_json_reader *r)
{
    return &r->scene->routes[r->scene->routes_count - 1];
}

static ebpo_status read_key(ebpo_json_reader *r, const char *name, const json_t *value)
{
    static const char *const known[] = { "time", "pose", NULL };
    (void)name;
    double time = 0;
    read_pose p = { .pose = EBPO_POSE_INIT };
    ebpo_status status = ebpo_json_members(r, value, known);
    if (status == EBPO_OK)
        status = ebpo_json_get_real(r, value, "time", true, &time);
    if (status != EBPO_OK)
        return status;
    ebpo_json_enter(r, "pose", 0);
    status = pose_members(r, json_object_get(value, "pose"), &p);
    ebpo_json_leave(r);
    return status == EBPO_OK ? add_pose_key(r, &p, time, last_route(r)) : status;
}

static ebpo_status read_poses(ebpo_json_reader *r, const json_t *value)
{
    double begin = 0, step = 0;
    const json_t *poses = json_object_get(value, "poses");
    ebpo_status status = ebpo_json_get_real(r, value, "begin", false, &begin);
    if (status == EBPO_OK)
        status = ebpo_json_get_real(r, value, "step", true, &step);
    if (status != EBPO_OK)
        return status;
    if (!json_is_array(poses))
        return ebpo_json_bad_at(r, "poses", "is not an array");
    ebpo_json_enter(r, "poses", 0);
    for (size_t i = 0; i < json_array_size(poses) && status == EBPO_OK; i++) {
        read_pose p = { .pose = EBPO_POSE_INIT };
        ebpo_json_enter(r, NULL, i);
        status = pose_members(r, json_array_get(poses, i), &p);
        if (status == EBPO_OK)
            status = add_pose_key(r, &p, begin + step * (double)i, last_route(r));
        ebpo_json_leave(r);
    }
    ebpo_json_leave(r);
    return status;
}

static ebpo_status read_csv(ebpo_json_reader *r, const json_t *value)
{
    const char *path = NULL;
    ebpo_status status = ebpo_json_get_text(r, value, "csv", true, &path);
    if (status != EBPO_OK)
        return status;
    ebpo_scene_options local = *r->options;
    local.remote = false;
    const char *refused = ebpo_scene_path_refused(path, &local, false);
    if (refused)
        return ebpo_json_bad_at(r, "csv", refused);
    char *joined = ebpo_scene_join_path(r->scene->folder, path);
    status = joined ? EBPO_OK : ebpo_fail_memory(r->error, strlen(path));
    if (status == EBPO_OK && !local.allow_outside)
        status = ebpo_scene_stays_within(r->scene->folder, joined, r->error);
    if (status == EBPO_OK)
        status = read_csv_file(last_route(r), joined, &r->pose_bytes, r->error);
    free(joined);
    return status;
}

static ebpo_status read_between(ebpo_json_reader *r, const json_t *value)
{
    /* even: poses between two keys are interpolated at constant speed; jump: the pose of a key
     * holds until the next key */
    const char *between = "even";
    ebpo_status status = ebpo_json_get_text(r, value, "between", false, &between);
    if (status != EBPO_OK)
        return status;
    last_route(r)->jumps = strcmp(between, "jump") == 0;
    return last_route(r)->jumps || strcmp(between, "even") == 0
               ? EBPO_OK
               : ebpo_json_bad_at(r, "between", "is neither even nor jump");
}

/* Reads a member of "routes". */
static ebpo_status json_read_route(ebpo_json_reader *r, const char *name, const json_t *value)
{
    static const char *const known[] = { "keys", "poses", "begin", "step", "csv", "between", NULL };
    uint64_t number;
    ebpo_error why = EBPO_ERROR_INIT;
    ebpo_status status = ebpo_json_members(r, value, known);
    if (status == EBPO_OK)
        status =
            ebpo_json_locate_error(r, ebpo_scene_add_route(r->scene, name, &number, &why), &why);
    if (status == EBPO_OK)
        status = read_between(r, value);
    if (status != EBPO_OK)
        return status;
    bool keys = json_object_get(value, "keys"), poses = json_object_get(value, "poses"),
         csv = json_object_get(value, "csv");
    if (keys + poses + csv != 1)
        return ebpo_json_bad(r, "must have exactly one of keys, poses and csv");
    if (!poses && (json_object_get(value, "begin") || json_object_get(value, "step")))
        return ebpo_json_bad(r, "begin and step apply to poses only");
    status = keys    ? ebpo_json_each_item(r, value, "keys", read_key)
             : poses ? read_poses(r, value)
                     : read_csv(r, value);
    return status == EBPO_OK && last_route(r)->count == 0 ? ebpo_json_bad(r, "has no poses")
                                                          : status;
}

/* --- names --- */

static ebpo_status read_name(ebpo_json_reader *r, const json_t *value, const char **name)
{
    if (!json_is_string(value))
        return ebpo_json_bad(r, "is not a name");
    *name = json_string_value(value);
    return EBPO_OK;
}

static ebpo_status read_layer(ebpo_json_reader *r, const char *key, const json_t *value)
{
    (void)key;
    ebpo_error why = EBPO_ERROR_INIT;
    const char *name = NULL;
    ebpo_status status = read_name(r, value, &name);
    return status == EBPO_OK
               ? ebpo_json_locate_error(r, ebpo_scene_add_layer(r->scene, name, &why), &why)
               : status;
}

static ebpo_status read_group(ebpo_json_reader *r, const char *key, const json_t *value)
{
    (void)key;
    ebpo_error why = EBPO_ERROR_INIT;
    const char *name = NULL;
    ebpo_status status = read_name(r, value, &name);
    return status == EBPO_OK
               ? ebpo_json_locate_error(r, ebpo_scene_add_group(r->scene, name, &why), &why)
               : status;
}

/* --- models --- */

static int json_digit(char c)
{
    const char *digits = "0123456789abcdef", *at = c ? strchr(digits, c) : NULL;
    return at ? (int)(at - digits) : -1;
}

static bool read_digest(const char *hex, uint8_t out[32])
{
    bool fits = strlen(hex) == 64;
    for (int i = 0; i < 32 && fits; i++) {
        int high = json_digit(hex[2 * i]), low = json_digit(hex[2 * i + 1]);
        fits = high >= 0 && low >= 0;
        out[i] = fits ? (uint8_t)(high << 4 | low) : 0;
    }
    return fits;
}

static ebpo_status read_model(ebpo_json_reader *r, const char *name, const json_t *value)
{
    static const char *const known[] = { "file", "content_sha256", "subset_of", NULL };
    const char *path = NULL, *hex = NULL, *subset_of = NULL;
    uint8_t digest[32];
    ebpo_error why = EBPO_ERROR_INIT;
    ebpo_status status = ebpo_json_members(r, value, known);
    if (status == EBPO_OK)
        status = ebpo_json_get_text(r, value, "file", true, &path);
    if (status == EBPO_OK)
        status = ebpo_json_get_text(r, value, "content_sha256", false, &hex);
    if (status == EBPO_OK)
        status = ebpo_json_get_text(r, value, "subset_of", false, &subset_of);
    if (status != EBPO_OK)
        return status;
    /* subset_of is only checked here; programs that make subsets use it */
    if (subset_of && !read_digest(subset_of, digest))
        return ebpo_json_bad_at(r, "subset_of", "is not 64 digits 0-9 a-f");
    if (hex && !read_digest(hex, digest))
        return ebpo_json_bad_at(r, "content_sha256", "is not 64 digits 0-9 a-f");
    const char *refused = ebpo_scene_path_refused(path, r->options, hex != NULL);
    if (refused)
        return ebpo_json_bad_at(r, "file", refused);
    status = ebpo_scene_add_model(r->scene, name, path, hex ? digest : NULL, NULL, &why);
    return ebpo_json_locate_error(r, status, &why);
}

/* --- instances --- */

/* Sets *number to the index of the object whose name is the value of the member `key`. Does not
 * change *number if the member is missing. */
static ebpo_status json_find(ebpo_json_reader *r, const json_t *object, const char *key,
                             const char *kind, bool needed, uint64_t *number)
{
    const char *name = NULL;
    ebpo_status status = ebpo_json_get_text(r, object, key, needed, &name);
    if (status != EBPO_OK || !name)
        return status;
    *number = ebpo_scene_find_name(r->scene, kind, name);
    return *number != EBPO_SCENE_NONE
               ? EBPO_OK
               : ebpo_json_bad_at(r, key, "is not a name that the scene defines");
}

static ebpo_status join_group(ebpo_json_reader *r, const char *key, const json_t *value)
{
    (void)key;
    ebpo_error why = EBPO_ERROR_INIT;
    const char *name = NULL;
    ebpo_status status = read_name(r, value, &name);
    if (status != EBPO_OK)
        return status;
    uint64_t set = ebpo_scene_find_name(r->scene, "group:", name);
    return set == EBPO_SCENE_NONE
               ? ebpo_json_bad(r, "is not a group of this scene")
               : ebpo_json_locate_error(r, ebpo_scene_put_newest_into(r->scene, set, &why), &why);
}

static ebpo_status read_instance(ebpo_json_reader *r, const char *key, const json_t *value)
{
    static const char *const known[] = { "name",  "model",  "pose",  "route",
                                         "layer", "groups", "fixed", NULL };
    (void)key;
    ebpo_scene_instance i = EBPO_SCENE_INSTANCE_INIT;
    ebpo_error why = EBPO_ERROR_INIT;
    ebpo_status status = ebpo_json_members(r, value, known);
    if (status == EBPO_OK)
        status = ebpo_json_get_text(r, value, "name", true, &i.name);
    if (status == EBPO_OK)
        status = json_find(r, value, "model", EBPO_SCENE_MODEL, true, &i.model);
    if (status == EBPO_OK)
        status = json_find(r, value, "route", EBPO_SCENE_ROUTE, false, &i.route);
    if (status == EBPO_OK)
        status = json_find(r, value, "layer", EBPO_SCENE_LAYER, false, &i.layer);
    if (status == EBPO_OK)
        status = ebpo_json_get_flag(r, value, "fixed", &i.fixed);
    if (status == EBPO_OK)
        status = json_read_pose(r, value, "pose", &i.pose);
    if (status == EBPO_OK)
        status = ebpo_json_locate_error(r, ebpo_scene_add_instance(r->scene, &i, NULL, &why), &why);
    return status == EBPO_OK ? ebpo_json_each_item(r, value, "groups", join_group) : status;
}

/* --- cameras --- */

static ebpo_status check_camera(ebpo_json_reader *r, const ebpo_scene_camera *c,
                                const double pixels[2])
{
    double viewing[3], cross = 0;
    for (int k = 0; k < 3; k++)
        viewing[k] = c->target[k] - c->eye[k];
    for (int k = 0; k < 3; k++) {
        int u = (k + 1) % 3, v = (k + 2) % 3;
        cross = fmax(cross, fabs(viewing[u] * c->up[v] - viewing[v] * c->up[u]));
    }
    if (!(cross > 0 && cross < INFINITY))
        return ebpo_json_bad(r,
                             "target is equal to eye, or up is parallel to the viewing direction");
    if (!(c->fov > 0 && c->fov < 180))
        return ebpo_json_bad_at(r, "fov", "is not between 0 and 180 degrees");
    for (int k = 0; k < 2; k++)
        if (!(pixels[k] >= 1 && pixels[k] <= 65536 && pixels[k] == floor(pixels[k])))
            return ebpo_json_bad_at(r, "pixels", "is not two whole numbers from 1 to 65536");
    return EBPO_OK;
}

static ebpo_status read_camera(ebpo_json_reader *r, const char *key, const json_t *value)
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
    ebpo_status status = ebpo_json_members(r, value, known);
    if (status == EBPO_OK)
        status = ebpo_json_get_text(r, value, "name", true, &c.name);
    if (status == EBPO_OK)
        status = ebpo_json_get_reals(r, value, "eye", true, c.eye, 3);
    if (status == EBPO_OK)
        status = ebpo_json_get_reals(r, value, "target", true, c.target, 3);
    if (status == EBPO_OK)
        status = ebpo_json_get_reals(r, value, "up", false, c.up, 3);
    if (status == EBPO_OK)
        status = ebpo_json_get_real(r, value, "fov", false, &c.fov);
    if (status == EBPO_OK)
        status = ebpo_json_get_reals(r, value, "pixels", false, pixels, 2);
    if (status == EBPO_OK)
        status = json_find(r, value, "route", EBPO_SCENE_ROUTE, false, &c.route);
    if (status == EBPO_OK)
        status = check_camera(r, &c, pixels);
    if (status != EBPO_OK)
        return status;
    c.width = (uint32_t)pixels[0];
    c.height = (uint32_t)pixels[1];
    return ebpo_json_locate_error(r, ebpo_scene_add_camera(r->scene, &c, &why), &why);
}

/* --- rules --- */

/* Reads an array of two selectors, and sets the indices of their sets. */
static ebpo_status read_selectors(ebpo_json_reader *r, const json_t *two, uint64_t set[2])
{
    if (!json_is_array(two) || json_array_size(two) != 2)
        return ebpo_json_bad(r, "is not an array of two names");
    for (size_t i = 0; i < 2; i++) {
        const char *name = json_string_value(json_array_get(two, i));
        set[i] = name ? ebpo_scene_find_name(r->scene, "", name) : EBPO_SCENE_NONE;
        if (set[i] == EBPO_SCENE_NONE) {
            ebpo_json_enter(r, NULL, i);
            ebpo_status status =
                ebpo_json_bad(r, "is not an instance, layer:NAME, group:NAME or * of this scene");
            ebpo_json_leave(r);
            return status;
        }
    }
    return EBPO_OK;
}

static ebpo_status read_ignored(ebpo_json_reader *r, const char *key, const json_t *value)
{
    (void)key;
    uint64_t set[2];
    ebpo_status status = read_selectors(r, value, set);
    const double ignore = -1; /* a clearance below 0 means: ignore the pairs */
    return status == EBPO_OK ? ebpo_scene_add_rule(r->scene, set[0], set[1], ignore, r->error)
                             : status;
}

static ebpo_status read_clearance(ebpo_json_reader *r, const char *key, const json_t *value)
{
    static const char *const known[] = { "between", "distance", NULL };
    (void)key;
    uint64_t set[2];
    double distance = 0;
    ebpo_status status = ebpo_json_members(r, value, known);
    if (status != EBPO_OK)
        return status;
    ebpo_json_enter(r, "between", 0);
    status = read_selectors(r, json_object_get(value, "between"), set);
    ebpo_json_leave(r);
    if (status == EBPO_OK)
        status = ebpo_json_get_real(r, value, "distance", true, &distance);
    if (status == EBPO_OK && !(distance >= 0 && distance <= 0x1p1000))
        return ebpo_json_bad_at(r, "distance", "is below 0 or beyond 2^1000");
    return status == EBPO_OK ? ebpo_scene_add_rule(r->scene, set[0], set[1], distance, r->error)
                             : status;
}

/* --- the scene --- */

static ebpo_status check_version(ebpo_json_reader *r, const json_t *root)
{
    const char *version = NULL;
    ebpo_status status = ebpo_json_get_text(r, root, "ebpo_scene", true, &version);
    if (status != EBPO_OK)
        return status;
    if (strncmp(version, "1.", 2) != 0 || strspn(version + 2, "0123456789") == 0 ||
        version[2 + strspn(version + 2, "0123456789")] != 0)
        return ebpo_fail_file(r->error, EBPO_E_VERSION, r->name,
                              "is a scene of version %.20s; this program reads versions 1.x",
                              version);
    return EBPO_OK;
}

static ebpo_status read_root(ebpo_json_reader *r, const json_t *root)
{
    static const char *const known[] = { "ebpo_scene", "title",  "unit",      "models",
                                         "layers",     "groups", "routes",    "instances",
                                         "cameras",    "ignore", "clearance", NULL };
    const char *text;
    if (!json_is_object(root))
        return ebpo_json_bad(r, "the top of a scene file must be a JSON object");
    ebpo_status status = check_version(r, root);
    if (status == EBPO_OK)
        status = ebpo_json_members(r, root, known);
    if (status == EBPO_OK)
        status = ebpo_json_get_text(r, root, "title", false, &text);
    if (status == EBPO_OK)
        status = ebpo_json_get_text(r, root, "unit", false, &text);
    if (status == EBPO_OK)
        status = ebpo_json_each_member(r, root, "models", read_model);
    if (status == EBPO_OK)
        status = ebpo_json_each_item(r, root, "layers", read_layer);
    if (status == EBPO_OK)
        status = ebpo_json_each_item(r, root, "groups", read_group);
    if (status == EBPO_OK)
        status = ebpo_json_each_member(r, root, "routes", json_read_route);
    if (status == EBPO_OK)
        status = ebpo_json_each_item(r, root, "instances", read_instance);
    if (status == EBPO_OK)
        status = ebpo_json_each_item(r, root, "cameras", read_camera);
    if (status == EBPO_OK)
        status = ebpo_json_each_item(r, root, "ignore", read_ignored);
    return status == EBPO_OK ? ebpo_json_each_item(r, root, "clearance", read_clearance) : status;
}

static ebpo_status report_parse_error(const char *name, const json_error_t *e, ebpo_error *error)
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

ebpo_status ebpo_scene_too_long(const char *name, const ebpo_scene_options *options,
                                ebpo_error *error)
{
    return ebpo_fail_file(error, EBPO_E_LIMIT, name, "has more than %llu bytes",
                          (unsigned long long)options->max_bytes);
}

ebpo_status ebpo_scene_read_json(ebpo_scene *scene, const char *text, size_t size, const char *name,
                                 const ebpo_scene_options *options, ebpo_error *error)
{
    json_error_t parsed;
    ebpo_error why = EBPO_ERROR_INIT;
    if (size > options->max_bytes)
        return ebpo_scene_too_long(name, options, error);
    const char *wrong_kind = ebpo_wrong_kind_of_file((const uint8_t *)text, size);
    if (wrong_kind)
        return ebpo_fail_file(error, EBPO_E_FORMAT, name, "%s", wrong_kind);
    if (ebpo_scene_text_fits(text, size, options->max_values, &why) != EBPO_OK)
        return ebpo_fail_file(error, EBPO_E_LIMIT, name, "%s", why.message);
    json_t *root =
        json_loadb(text, size, JSON_REJECT_DUPLICATES | JSON_DECODE_INT_AS_REAL, &parsed);
    if (!root)
        return report_parse_error(name, &parsed, error);
    ebpo_json_reader r = { .scene = scene,
                           .text = text,
                           .name = name,
                           .options = options,
                           .pose_bytes = options->max_pose_bytes,
                           .error = error };
    ebpo_status status = read_root(&r, root);
    if (status == EBPO_OK)
        ebpo_scene_sort_rules(scene);
    json_decref(root);
    return status;
}
