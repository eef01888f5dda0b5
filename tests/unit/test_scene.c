/* Tests scenes: valid and invalid files, poses in time, boxes and pairs against reference
 * implementations. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "check_main.h"
#include "exact_reference.h"
#include "geometry/pose.h"
#include "extras/scene/scene_parts.h"
#include "scratch.h"

static ebpo_error error;

static void fine(ebpo_status status)
{
    ck_assert_msg(status == EBPO_OK, "%s: %s", ebpo_status_name(status), error.message);
}

static ebpo_scene *parsed(const char *text)
{
    ebpo_scene *scene = NULL;
    fine(ebpo_scene_parse(text, strlen(text), "s.json", NULL, NULL, &scene, &error));
    return scene;
}

/* --- files --- */

#define HEAD "{\"ebpo_scene\": \"1.0\",\n\"models\": {\"m\": {\"file\": \"m.ebpo.h5\"}},\n"
#define ONE  "{\"name\": \"a\", \"model\": \"m\"}"

static const struct {
    const char *text, *says;
} bad[] = {
    { "", "line 1: is not JSON" },
    { "[]", "line 1: the top of a scene file must be a JSON object" },
    { "\xef\xbb\xbf[]", "line 1: the top of a scene file must be a JSON object" },
    { "\xfe\xff\0[", "is text of two bytes a character (UTF-16); save it as UTF-8" },
    { "version https://git-lfs.github.com/spec/v1", "is a Git LFS pointer, not the file itself" },
    { "{}", "line 1: has no member ebpo_scene" },
    { "{\"ebpo_scene\": \"2.0\"}", "version 2.0" },
    { "{\"ebpo_scene\": \"1.0\",\n\"instances\": 3}", "line 2: instances: is not an array" },
    { HEAD "\"colour\": 1}", "line 3: colour: is not a known member" },
    { HEAD "\"title\": 1}", "line 3: title: is not a string" },
    { HEAD "\"title\": \"a\", \"title\": \"b\"}", "line 3: is not JSON: duplicate" },
    { HEAD "\"instances\": [\n{\"model\": \"m\"}]}", "line 4: instances[0]: has no member name" },
    { HEAD "\"instances\": [" ONE ",\n" ONE "]}",
      "line 4: instances[1]: the name 'a' exists already" },
    { HEAD "\"instances\": [\n{\"name\": \"a\", \"model\": \"n\"}]}",
      "line 4: instances[0].model: is not a name that the scene defines" },
    { HEAD "\"instances\": [{\"name\": \"a\", \"model\": \"m\",\n\"pose\": {\n\"scale\": \"1\"}}]}",
      "line 5: instances[0].pose.scale: is not a number" },
    { HEAD "\"instances\": [{\"name\": \"a\", \"model\": \"m\", \"pose\": {\"scale\": -1}}]}",
      "the scale is -1" },
    { HEAD "\"instances\": [{\"name\": \"a\", \"model\": \"m\", \"pose\":\n{\"rotation\": "
           "[1,0,0,0,1,0,0,0,-1]}}]}",
      "mirror" },
    { HEAD "\"instances\": [{\"name\": \"a\", \"model\": \"m\", \"pose\":\n{\"rotation\": "
           "[1,0,0,0,1,0,0,1]}}]}",
      "line 4: instances[0].pose.rotation: is not an array of 9 numbers" },
    { HEAD "\"instances\": [{\"name\": \"a\", \"model\": \"m\", \"pose\":\n{\"quaternion\": "
           "[0,0,0,0]}}]}",
      "the quaternion is 0" },
    { HEAD "\"instances\": [{\"name\": \"*\", \"model\": \"m\"}]}", "cannot be a name" },
    { HEAD "\"instances\": [{\"name\": \"a\\nb\", \"model\": \"m\"}]}", "control characters" },
    { HEAD "\"routes\": {\"r\": {\"keys\": []}}}", "routes.r: has no poses" },
    { HEAD "\"routes\": {\"r\": {}}}", "routes.r: must have exactly one of keys" },
    { HEAD "\"routes\": {\"r\": {\"keys\": [{\"time\": 1, \"pose\": {}},\n{\"time\": 1, \"pose\": "
           "{}}]}}}",
      "line 4: routes.r.keys[1]: time 1 is not later than" },
    { HEAD "\"routes\": {\"r\": {\"keys\": [{\"time\": -1.7e308, \"pose\": {}}]}}}",
      "the time is beyond 2^1000" },
    { HEAD "\"routes\": {\"r\": {\"keys\": [{\"time\": 1}]}}}", "keys[0].pose: is not an object" },
    { HEAD "\"routes\": {\"r\": {\"csv\": \"../p.csv\"}}}", "routes.r.csv: is outside" },
    { HEAD "\"ignore\": [[\"a\"]]}", "ignore[0]: is not an array of two names" },
    { HEAD "\"ignore\": [[\"*\",\n\"layer:x\"]]}", "line 4: ignore[0][1]: is not an instance" },
    { HEAD "\"clearance\": [{\"between\": [\"*\", \"*\"], \"distance\": -1}]}",
      "clearance[0].distance: is below 0" },
    { HEAD "\"cameras\": [{\"name\": \"c\", \"eye\": [0,0,1], \"target\": [0,0,2]}]}",
      "up is parallel to the viewing direction" },
    { "{\"ebpo_scene\": \"1.0\",\n\"models\": {\"m\": {\"file\": \"/etc/m\"}}}",
      "line 2: models.m.file: is outside" },
    { "{\"ebpo_scene\": \"1.0\", \"models\": {\"m\": {\"file\": \"a/../../m\"}}}", "is outside" },
    { "{\"ebpo_scene\": \"1.0\", \"models\": {\"m\": {\"file\": \"http://h/m\"}}}",
      "use ebpo scene --remote" },
    { "{\"ebpo_scene\": \"1.0\", \"models\": {\"m\": {\"file\": \"m\", \"content_sha256\": "
      "\"1\"}}}",
      "is not 64 digits" },
    { "[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[", "more than 32 levels" },
    { "{\"ebpo_scene\": 1e999}", "is not JSON" },
};

START_TEST(test_scene_invalid_files_are_refused)
{
    ebpo_scene *scene = NULL;
    ebpo_status status =
        ebpo_scene_parse(bad[_i].text, strlen(bad[_i].text), "s.json", NULL, NULL, &scene, &error);
    ck_assert_msg(status != EBPO_OK && !scene, "%s", bad[_i].text);
    ck_assert_msg(strstr(error.message, bad[_i].says), "%s\n%s", bad[_i].text, error.message);
}
END_TEST

static const char whole[] = HEAD
    "\"layers\": [\"l\"], \"groups\": [\"g\"], \"routes\": {\"r\": {\"keys\": [{\"time\": 0, "
    "\"pose\": {}}, {\"time\": 2, \"pose\": {\"quaternion\": [0, 0, 1, 1], \"scale\": 2}}]}, "
    "\"p\": {\"poses\": [{}, {\"translation\": [1, 2, 3]}], \"step\": 1, \"between\": "
    "\"jump\"}},\n\"instances\": [" ONE ", {\"name\": \"b\", \"model\": \"m\", \"pose\": "
    "{\"rotation\": [1, 0, 0, 0, 1, 0, 0, 0, 1]}, \"layer\": \"l\", \"groups\": [\"g\"], "
    "\"route\": \"r\"}],\n\"cameras\": [{\"name\": \"c\", \"eye\": [1, 1, 1], \"target\": [0, 0, "
    "0], \"fov\": 50, \"pixels\": [10, 10]}], \"ignore\": [[\"*\", \"group:g\"]],\n"
    "\"clearance\": [{\"between\": [\"a\", \"layer:l\"], \"distance\": 1}], \"x-y\": [{}]}";

/* Any bytes give a scene, or a message that names the file. */
START_TEST(test_scene_arbitrary_bytes)
{
    uint64_t state = 6;
    int scenes = 0;
    for (int n = 0; n < 4000; n++) {
        size_t size = sizeof whole - 1;
        char *text = malloc(size);
        ebpo_scene *scene = NULL;
        memcpy(text, whole, size);
        for (int64_t k = reference_integer(&state, 0, 3); k > 0; k--) {
            size_t at = (size_t)reference_integer(&state, 0, (int64_t)size - 1);
            size_t from = (size_t)reference_integer(&state, 0, (int64_t)size - 1);
            text[at] = n % 3 ? text[from] : (char)reference_integer(&state, 0, 255);
        }
        size -= n % 5 ? 0 : (size_t)reference_integer(&state, 0, (int64_t)size);
        text = realloc(text, size + !size); /* so that reading beyond the end is detected */
        ebpo_status status = ebpo_scene_parse(text, size, "s.json", NULL, NULL, &scene, &error);
        scenes += status == EBPO_OK;
        ck_assert(status == EBPO_OK ? scene != NULL : strstr(error.message, "s.json") != NULL);
        ebpo_scene_free(scene);
        free(text);
    }
    ck_assert_int_gt(scenes, 400);
}
END_TEST

START_TEST(test_scene_size_limits)
{
    static const char text[] = HEAD "\"x-a\": [1, 2, 3, \"[[[[,,,,\\\"\", 4]}";
    ebpo_scene_options options = EBPO_SCENE_OPTIONS_INIT;
    ebpo_scene *scene = NULL;
    options.max_values = 16;
    fine(ebpo_scene_parse(text, strlen(text), "s.json", NULL, &options, &scene, &error));
    ebpo_scene_free(scene);
    options.max_values = 15;
    ck_assert_int_eq(ebpo_scene_parse(text, strlen(text), "s.json", NULL, &options, &scene, &error),
                     EBPO_E_LIMIT);
    options.max_values = 0;
    options.max_bytes = strlen(text) - 1;
    ck_assert_int_eq(ebpo_scene_parse(text, strlen(text), "s.json", NULL, &options, &scene, &error),
                     EBPO_E_LIMIT);
}
END_TEST

START_TEST(test_scene_ignore_and_clearance_rules)
{
    ebpo_scene *s = parsed(
        HEAD "\"layers\": [\"l\"], \"groups\": [\"g\", \"h\"], \"instances\": [" ONE ","
             "{\"name\": \"b\", \"model\": \"m\", \"layer\": \"l\", \"groups\": [\"g\"]},"
             "{\"name\": \"c\", \"model\": \"m\", \"fixed\": true},"
             "{\"name\": \"d\", \"model\": \"m\", \"fixed\": true, \"groups\": [\"h\", \"g\"]}],"
             "\"ignore\": [[\"group:h\", \"a\"]], \"clearance\": ["
             "{\"between\": [\"*\", \"layer:l\"], \"distance\": 2},"
             "{\"between\": [\"group:g\", \"group:g\"], \"distance\": 3}]}");
    static double want[4][4] = {
        { -1, 2, 0, -1 }, { 2, -1, 2, 3 }, { 0, 2, -1, -1 }, { -1, 3, -1, -1 }
    };
    for (uint64_t a = 0; a < 4; a++)
        for (uint64_t b = 0; b < 4; b++) {
            double clearance;
            bool tested = ebpo_scene_pair_rule(s, a, b, &clearance);
            ck_assert_msg((tested ? clearance : -1) == want[a][b], "%d %d", (int)a, (int)b);
        }
    ck_assert_str_eq(ebpo_scene_get_layer(s, 0), "l");
    ck_assert_ptr_null(ebpo_scene_get_layer(s, 1));
    ck_assert_str_eq(ebpo_scene_get_group(s, 1), "h");
    ck_assert_ptr_null(ebpo_scene_get_group(s, 2));
    static const uint64_t groups[5][2] = { { EBPO_SCENE_NONE, EBPO_SCENE_NONE },
                                           { 0, EBPO_SCENE_NONE },
                                           { EBPO_SCENE_NONE, EBPO_SCENE_NONE },
                                           { 0, 1 },
                                           { EBPO_SCENE_NONE, EBPO_SCENE_NONE } };
    for (uint64_t i = 0; i < 5; i++)
        for (uint64_t n = 0; n < 2; n++)
            ck_assert_uint_eq(ebpo_scene_group_of(s, i, n), groups[i][n]);
    ck_assert_uint_eq(ebpo_scene_group_of(s, 3, 2), EBPO_SCENE_NONE);
    ebpo_scene_free(s);
}
END_TEST

START_TEST(test_scene_csv_routes)
{
    static const struct {
        const char *text, *says;
    } cases[] = {
        { "time,x,y,z,qx,qy,qz,qw\n1,2,3,4,0,0,0,1\n\n2;2;3;5;0;0;0;-1\r\n", NULL },
        { "\xef\xbb\xbftime,x,y,z,qx,qy,qz,qw\n1,2,3,4,0,0,0,1\n2,2,3,5,0,0,0,-1\n", NULL },
        { "\xff\xfet\0i\0", "two bytes a character (UTF-16)" },
        { "\xef\xbb\xbf", "there are no poses" }, /* only a byte order mark */
        { "scale, qw ,qz,qy,qx,z,y,x,time\n 1 , 1,0,0,0,4,3,2,1\n1,1,0,0,0,5,3,2,2", NULL },
        { "time,x,y,z\n", "line 1: the first line must name" },
        { "time,x,y,z,qx,qy,qz,qw,qw\n", "line 1: each column must be one of" },
        { "time,x,y,z,qx,qy,qz,qw\n", "there are no poses" },
        { "time,x,y,z,qx,qy,qz,qw\n1,2,3,4,0,0,0\n", "line 2: the number of fields differs" },
        { "time,x,y,z,qx,qy,qz,qw\n1,2,3,4,0,0,0,a\n", "line 2: expected a number" },
        { "time,x,y,z,qx,qy,qz,qw\n1,2,3,4,0,0,0,1\n\n1,2,3,4,0,0,0,1\n", "line 4: time 1 is" },
        { "time,x,y,z,qx,qy,qz,qw\n1,2,3,nan,0,0,0,1\n", "line 2: a number is not finite" },
    };
    static const char text[] = HEAD "\"routes\": {\"r\": {\"csv\": \"p.csv\"}}}";
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        ebpo_scene *s = NULL;
        ebpo_pose pose;
        fine(ebpo_write_file(scratch("p.csv"), cases[i].text, strlen(cases[i].text), &error));
        ebpo_status status =
            ebpo_scene_parse(text, strlen(text), "s.json", scratch(NULL), NULL, &s, &error);
        if (cases[i].says) {
            ck_assert_msg(status == EBPO_E_FORMAT && strstr(error.message, cases[i].says), "%s\n%s",
                          cases[i].text, error.message);
            continue;
        }
        fine(status);
        ebpo_scene_route_at(&s->routes[0], 1.5, &pose);
        ck_assert(pose.translation[2] == 4.5 && pose.rotation[0][0] == 1);
        ebpo_scene_free(s);
    }
}
END_TEST

/* --- poses --- */

static double some(uint64_t *state, double size)
{
    return (double)reference_integer(state, -1000000, 1000000) * size / 1000000;
}

static void some_route(ebpo_scene_route *route, uint64_t *state, int keys)
{
    for (int i = 0; i < keys; i++) {
        ebpo_route_key key = { .time = i, .scale = 1 + 0.5 * fabs(some(state, 1)) };
        for (int k = 0; k < 4; k++)
            key.quaternion[k] = some(state, 1) + (k == 3 ? 1e-3 : 0);
        for (int k = 0; k < 3; k++)
            key.translation[k] = some(state, 3);
        fine(ebpo_scene_add_key(route, &key, &error));
    }
}

/* Interpolates quaternions by sines, as in textbooks. */
static void sine_reference(const double a[4], const double b[4], double u, double q[4])
{
    double dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
    double sign = dot < 0 ? -1 : 1, angle = acos(fmin(fabs(dot), 1)), s = sin(angle);
    for (int k = 0; k < 4; k++)
        q[k] = s < 1e-9 ? a[k] : (sin((1 - u) * angle) * a[k] + sin(u * angle) * sign * b[k]) / s;
}

START_TEST(test_scene_route_turns_evenly)
{
    uint64_t state = 7;
    ebpo_scene_route route = { 0 };
    some_route(&route, &state, 300);
    for (int i = 0; i + 1 < 300; i++) {
        double u = fabs(some(&state, 1)), q[4];
        ebpo_pose p;
        if (u >= 1)
            continue;
        ebpo_scene_route_at(&route, i + u, &p);
        sine_reference(route.keys[i].quaternion, route.keys[i + 1].quaternion, (i + u) - i, q);
        double reference[3][3] = {
            { 1 - 2 * (q[1] * q[1] + q[2] * q[2]), 2 * (q[0] * q[1] - q[2] * q[3]),
              2 * (q[0] * q[2] + q[1] * q[3]) },
            { 2 * (q[0] * q[1] + q[2] * q[3]), 1 - 2 * (q[0] * q[0] + q[2] * q[2]),
              2 * (q[1] * q[2] - q[0] * q[3]) },
            { 2 * (q[0] * q[2] - q[1] * q[3]), 2 * (q[1] * q[2] + q[0] * q[3]),
              1 - 2 * (q[0] * q[0] + q[1] * q[1]) },
        };
        for (int k = 0; k < 9; k++)
            ck_assert_double_eq_tol((&p.rotation[0][0])[k], (&reference[0][0])[k], 1e-11);
    }
    free(route.keys);
}
END_TEST

START_TEST(test_scene_matrix_to_quaternion)
{
    uint64_t state = 8;
    ebpo_scene_route route = { 0 };
    some_route(&route, &state, 500);
    for (int i = 0; i < 500; i++) {
        ebpo_pose p, again;
        ebpo_scene_route one = { 0 };
        ebpo_route_key key = { .scale = 1 };
        ebpo_scene_route_at(&route, i, &p);
        ebpo_scene_quaternion_of_matrix((const double(*)[3])p.rotation, key.quaternion);
        fine(ebpo_scene_add_key(&one, &key, &error));
        ebpo_scene_route_at(&one, 0, &again);
        for (int k = 0; k < 9; k++)
            ck_assert_double_eq_tol((&p.rotation[0][0])[k], (&again.rotation[0][0])[k], 1e-14);
        free(one.keys);
    }
    free(route.keys);
}
END_TEST

/* --- boxes, motions, pairs --- */

/* Makes a scene as if a file with this box had been opened. */
static ebpo_scene *some_scene(uint64_t *state, int routes, int instances)
{
    ebpo_scene *s = NULL;
    uint64_t number;
    char name[20];
    fine(ebpo_scene_new(&s, &error));
    fine(ebpo_scene_add_model(s, "m", "m", NULL, NULL, &error));
    s->models[0].file = 0;
    for (int k = 0; k < 3; k++) {
        s->models[0].min[k] = -0.3 - 0.1 * k;
        s->models[0].max[k] = 0.2 + 0.4 * k;
    }
    for (int i = 0; i < routes; i++) {
        snprintf(name, sizeof name, "r%d", i);
        fine(ebpo_scene_add_route(s, name, &number, &error));
        some_route(&s->routes[i], state, 2 + i % 5);
        s->routes[i].jumps = i % 4 == 3;
    }
    for (int i = 0; i < instances; i++) {
        ebpo_scene_instance at = EBPO_SCENE_INSTANCE_INIT;
        snprintf(name, sizeof name, "i%d", i);
        at.name = name;
        at.route = routes && i % 3 ? (uint64_t)(i % routes) : EBPO_SCENE_NONE;
        at.fixed = i % 9 == 0;
        at.pose.scale = 0.25 + fabs(some(state, 1));
        for (int k = 0; k < 3; k++)
            at.pose.translation[k] = some(state, 5);
        fine(ebpo_scene_add_instance(s, &at, NULL, &error));
    }
    return s;
}

static void some_vertex(const ebpo_scene *s, uint64_t *state, double x[3])
{
    for (int k = 0; k < 3; k++) {
        const ebpo_scene_model_entry *m = &s->models[0];
        double u = (double)reference_integer(state, 0, 4) / 4;
        x[k] = fmin(fmax(m->min[k] + u * (m->max[k] - m->min[k]), m->min[k]), m->max[k]);
    }
}

static void posed(const ebpo_scene *s, uint64_t i, double time, const double x[3], double out[3])
{
    static const double reach[3] = { 2, 2, 2 };
    ebpo_pose pose;
    ebpo_posing posing;
    fine(ebpo_scene_pose(s, i, time, &pose, &error));
    fine(ebpo_posing_make(&posing, &pose, reach, &error));
    ebpo_posing_apply(&posing, x, out);
}

START_TEST(test_scene_motion_bounds_hold)
{
    uint64_t state = 9;
    ebpo_scene *s = some_scene(&state, 12, 60);
    for (int n = 0; n < 3000; n++) {
        uint64_t i = (uint64_t)reference_integer(&state, 0, 59);
        double from = some(&state, 4), to = from + fabs(some(&state, n % 3 ? 3 : 0.01)), box[2][3];
        double x[3], at[2][3], length, gone = 0;
        if (n % 7 == 0)
            from = floor(from), to = from + 1;
        fine(ebpo_scene_instance_box(s, i, from, to, box[0], box[1], &error));
        fine(ebpo_scene_motion(s, i, from, to, &length, &error));
        some_vertex(s, &state, x);
        for (int e = 0; e < 2; e++) {
            double time = e && n % 2 ? to : from + (to - from) * fabs(some(&state, 1));
            posed(s, i, fmin(time, to), x, at[e]);
            for (int k = 0; k < 3; k++)
                ck_assert(at[e][k] >= box[0][k] && at[e][k] <= box[1][k]);
        }
        for (int k = 0; k < 3; k++)
            gone += (at[0][k] - at[1][k]) * (at[0][k] - at[1][k]);
        ck_assert_msg(sqrt(gone) <= length, "%g > %g", sqrt(gone), length);
    }
    ebpo_scene_free(s);
}
END_TEST

/* An arm turns by a right angle, with its tip on the x axis halfway, and translates by its length.
 * The squares of these lengths overflow or underflow. */
START_TEST(test_scene_motion_bounds_of_any_size)
{
    static const int exponents[] = { -560, 0, 530 };
    for (int e = 0; e < 3; e++) {
        double arm = ldexp(1, exponents[e]), low[3], high[3], length;
        ebpo_scene *s = parsed(HEAD "\"routes\": {\"r\": {\"keys\": ["
                                    "{\"time\": 0, \"pose\": {\"quaternion\": [0, 0, -2, 5]}},"
                                    "{\"time\": 1, \"pose\": {\"quaternion\": [0, 0, 2, 5]}},"
                                    "{\"time\": 2, \"pose\": {\"quaternion\": [0, 0, 2, 5]}}]}},"
                                    "\"instances\": [{\"name\": \"a\", \"model\": \"m\","
                                    "\"route\": \"r\"}]}");
        s->models[0].file = 0;
        s->models[0].min[0] = s->models[0].max[0] = arm;
        s->routes[0].keys[2].translation[0] = arm;
        fine(ebpo_scene_instance_box(s, 0, 0, 1, low, high, &error));
        ck_assert(high[0] >= arm && high[0] < 1.1 * arm && low[0] > 0);
        fine(ebpo_scene_motion(s, 0, 0, 1, &length, &error));
        ck_assert(length >= arm && length < 2 * arm);
        fine(ebpo_scene_motion(s, 0, 1, 2, &length, &error));
        ck_assert(length >= arm && length < 1.1 * arm);
        fine(ebpo_scene_instance_box(s, 0, -1e308, 1.7e308, low, high, &error));
        ck_assert(low[0] > 0 && high[0] >= 1.7 * arm && high[0] < 2.1 * arm);
        ebpo_scene_free(s);
    }
}
END_TEST

/* Bounds are tight for a quarter turn of a point at a distance of 1, and for a straight path. */
START_TEST(test_scene_motion_bounds_are_tight)
{
    ebpo_scene *s =
        parsed(HEAD "\"routes\": {\"turn\": {\"keys\": [{\"time\": 0, \"pose\": {}}, {\"time\": 1, "
                    "\"pose\": {\"quaternion\": [0, 0, 1, 1]}}]}, \"way\": {\"poses\": [{}, "
                    "{\"translation\": [3, 4, 0]}], \"step\": 1}},"
                    "\"instances\": [{\"name\": \"a\", \"model\": \"m\", \"route\": \"turn\"},"
                    "{\"name\": \"b\", \"model\": \"m\", \"route\": \"way\"}]}");
    double length, box[2][3];
    s->models[0].file = 0;
    s->models[0].max[0] = 1;
    fine(ebpo_scene_motion(s, 0, 0, 1, &length, &error));
    ck_assert_double_eq_tol(length, acos(0), 1e-9);
    fine(ebpo_scene_instance_box(s, 0, 0, 1, box[0], box[1], &error));
    ck_assert(box[1][0] < 1.003 && box[1][1] < 1.003 && box[0][0] > -0.003);
    fine(ebpo_scene_motion(s, 1, 0.5, 1, &length, &error));
    ck_assert_double_eq_tol(length, 2.5, 1e-9);
    fine(ebpo_scene_box(s, 0, 1, box[0], box[1], &error));
    ck_assert_double_eq_tol(box[1][0], 4, 1e-9);
    ebpo_scene_free(s);
}
END_TEST

START_TEST(test_scene_box_grows_with_instances)
{
    uint64_t state = 10;
    ebpo_scene *s = some_scene(&state, 0, 0);
    double box[2][3];
    fine(ebpo_scene_box(s, 0, 0, box[0], box[1], &error));
    ck_assert(box[0][0] == INFINITY && box[1][2] == -INFINITY);
    for (int i = 0; i < 3; i++) {
        ebpo_scene_instance at = EBPO_SCENE_INSTANCE_INIT;
        at.name = i == 0 ? "a" : i == 1 ? "b" : "c";
        at.pose.translation[0] = 10 * i;
        fine(ebpo_scene_add_instance(s, &at, NULL, &error));
        fine(ebpo_scene_box(s, 0, 0, box[0], box[1], &error));
        ck_assert_double_eq_tol(box[0][0], -0.3, 1e-9);
        ck_assert_double_eq_tol(box[1][0], 0.2 + 10 * i, 1e-9);
    }
    ebpo_scene_free(s);
}
END_TEST

typedef struct found {
    ebpo_scene_pair pairs[20000];
    uint64_t count;
} found;

static bool keep(void *user, const ebpo_scene_pair *pairs, uint64_t count)
{
    found *f = user;
    memcpy(f->pairs + f->count, pairs, count * sizeof *pairs);
    f->count += count;
    return true;
}

/* Finds every pair of boxes, in order. */
static void all_pairs(const ebpo_scene *s, double from, double to, found *f)
{
    ebpo_scene_pair p;
    for (p.a = 0; p.a < s->instances_count; p.a++)
        for (p.b = p.a + 1; p.b < s->instances_count; p.b++) {
            double x[2][3], y[2][3];
            fine(ebpo_scene_instance_box(s, p.a, from, to, x[0], x[1], &error));
            fine(ebpo_scene_instance_box(s, p.b, from, to, y[0], y[1], &error));
            bool near = ebpo_scene_pair_rule(s, p.a, p.b, &p.clearance);
            for (int k = 0; k < 3; k++)
                near &= x[0][k] - y[1][k] <= p.clearance && y[0][k] - x[1][k] <= p.clearance;
            if (near)
                f->pairs[f->count++] = p;
        }
}

/* Tests few and many lines of rules, for instances with few and many groups. The lines are
 * evaluated in order. */
START_TEST(test_scene_rules_match_reference)
{
    enum { INSTANCES = 8, LIMIT = 60 };
    uint64_t state = 40 + (uint64_t)_i;
    int groups = _i % 2 ? 12 : 1, lines = _i / 2 ? LIMIT : 4;
    ebpo_scene *s = some_scene(&state, 0, 0);
    bool in[INSTANCES][200] = { { false } };
    ebpo_scene_rule_entry line[LIMIT];
    char name[20];
    for (int g = 0; g < groups; g++) {
        snprintf(name, sizeof name, "g%d", g);
        fine(ebpo_scene_add_group(s, name, &error));
    }
    for (int i = 0; i < INSTANCES; i++) {
        ebpo_scene_instance at = EBPO_SCENE_INSTANCE_INIT;
        snprintf(name, sizeof name, "i%d", i);
        at.name = name;
        fine(ebpo_scene_add_instance(s, &at, NULL, &error));
        in[i][EBPO_SCENE_ALL_SET] = in[i][s->sets_count - 1] = true;
        for (int g = 0; g < groups; g++) {
            uint64_t set = (uint64_t)reference_integer(&state, 1, groups);
            fine(ebpo_scene_put_newest_into(s, set, &error));
            in[i][set] = true;
        }
    }
    for (int i = 0; i < lines; i++) {
        line[i].a = (uint64_t)reference_integer(&state, 1, (int)s->sets_count - 1);
        line[i].b = (uint64_t)reference_integer(&state, i ? 1 : 0, (int)s->sets_count - 1);
        line[i].clearance = i % 5 == 4 ? -1 : reference_integer(&state, 0, 9);
        fine(ebpo_scene_add_rule(s, line[i].a, line[i].b, line[i].clearance, &error));
    }
    ebpo_scene_sort_rules(s);
    for (uint64_t a = 0; a < INSTANCES; a++)
        for (uint64_t b = 0; b < INSTANCES; b++) {
            double want = 0, got;
            for (int i = 0; i < lines && want >= 0; i++)
                if ((in[a][line[i].a] && in[b][line[i].b]) ||
                    (in[a][line[i].b] && in[b][line[i].a]))
                    want = line[i].clearance < 0 ? -1 : fmax(want, line[i].clearance);
            bool tested = ebpo_scene_pair_rule(s, a, b, &got);
            ck_assert(a == b ? !tested : tested ? got == want : want < 0);
        }
    ebpo_scene_free(s);
}
END_TEST

START_TEST(test_scene_pairs_match_reference)
{
    static found fast, slow;
    uint64_t state = 11 + (uint64_t)_i;
    ebpo_scene *s = some_scene(&state, _i % 2 ? 8 : 0, 150);
    fine(ebpo_scene_add_rule(s, EBPO_SCENE_ALL_SET, EBPO_SCENE_ALL_SET, _i * 0.2, &error));
    fine(ebpo_scene_add_rule(s, 3, 7, 4, &error));
    fine(ebpo_scene_add_rule(s, 4, EBPO_SCENE_ALL_SET, -1, &error));
    ebpo_scene_sort_rules(s);
    fast.count = slow.count = 0;
    fine(ebpo_scene_pairs(s, 0, _i < 2 ? 0 : 2.5, keep, &fast, &error));
    all_pairs(s, 0, _i < 2 ? 0 : 2.5, &slow);
    ck_assert_uint_gt(slow.count, 5);
    ck_assert_uint_eq(fast.count, slow.count);
    for (uint64_t i = 0; i < fast.count; i++)
        ck_assert(fast.pairs[i].a == slow.pairs[i].a && fast.pairs[i].b == slow.pairs[i].b &&
                  fast.pairs[i].clearance == slow.pairs[i].clearance);
    ebpo_scene_free(s);
}
END_TEST

TEST_SUITE(scene)
{
    Suite *suite = suite_create("scene");
    TCase *c = tcase_create("scene");
    tcase_add_checked_fixture(c, scratch_enter, scratch_leave);
    tcase_set_timeout(c, 300);
    tcase_add_loop_test(c, test_scene_invalid_files_are_refused, 0, sizeof bad / sizeof *bad);
    tcase_add_test(c, test_scene_arbitrary_bytes);
    tcase_add_test(c, test_scene_size_limits);
    tcase_add_test(c, test_scene_ignore_and_clearance_rules);
    tcase_add_test(c, test_scene_csv_routes);
    tcase_add_test(c, test_scene_route_turns_evenly);
    tcase_add_test(c, test_scene_matrix_to_quaternion);
    tcase_add_test(c, test_scene_motion_bounds_hold);
    tcase_add_test(c, test_scene_motion_bounds_of_any_size);
    tcase_add_test(c, test_scene_motion_bounds_are_tight);
    tcase_add_test(c, test_scene_box_grows_with_instances);
    tcase_add_loop_test(c, test_scene_rules_match_reference, 0, 4);
    tcase_add_loop_test(c, test_scene_pairs_match_reference, 0, 4);
    suite_add_tcase(suite, c);
    return suite;
}
