/* Tests paint: contents of files, range of a ball, areas against closed forms, and strokes from
 * the path of a device. tests/cli/paint.tests compares the colouring of vertices with a reference
 * implementation in Python. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <ebpo/ebpo.h>
#include <ebpo/paint.h>

#include "check_main.h"
#include "io/unfinished.h"
#include "model_file.h"
#include "scratch.h"
#include "solids.h"

#define PI 3.14159265358979323846

typedef struct opened {
    ebpo_file *file;
    ebpo_model *model;
    ebpo_context *context;
    ebpo_paint *paint; /* with one layer */
} opened;

/* cut_level -1: the whole model is in memory. */
static opened open_model(ebpo_mesh mesh, int cut_level)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_tree tree = model_build_parts(mesh, 8, EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS);
    opened o = { NULL, NULL, NULL, NULL };
    model_write(&tree, scratch("m.ebpo.h5"), NULL);
    o.file = model_open(scratch("m.ebpo.h5"));
    options.cut_level = cut_level;
    model_must(ebpo_model_new(o.file, &options, &o.model, &error), "opening", &error);
    model_must(ebpo_context_new(o.model, &o.context, &error), "opening", &error);
    model_must(ebpo_paint_new(o.file, &o.paint, &error), "a new paint", &error);
    model_must(ebpo_paint_add_layer(o.paint, NULL, NULL, &error), "a layer", &error);
    return o;
}

static void close_model(opened *o)
{
    ebpo_paint_free(o->paint);
    ebpo_context_free(o->context);
    ebpo_model_free(o->model);
    ebpo_close(o->file);
}

static ebpo_paint_point point_at(const opened *o, double x, double y, double z)
{
    const double place[3] = { x, y, z };
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_paint_point out;
    model_must(ebpo_paint_locate(o->paint, o->context, place, &out, &error), "a point", &error);
    return out;
}

/* Adds a stroke of one point. */
static void add_dab(opened *o, uint64_t layer, uint32_t colour, double radius, double x, double y,
                    double z)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_paint_stroke s = EBPO_PAINT_STROKE_INIT;
    ebpo_paint_point q = point_at(o, x, y, z);
    s.layer = layer;
    s.kind = colour ? EBPO_PAINT_PAINTS : EBPO_PAINT_ERASES;
    s.colour = colour;
    s.radius = radius;
    s.points = &q;
    s.point_count = 1;
    model_must(ebpo_paint_add_stroke(o->paint, &s, &error), "a stroke", &error);
}

static ebpo_paint_areas measured(const opened *o, unsigned fineness, unsigned threads)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_paint_areas areas = EBPO_PAINT_AREAS_INIT;
    ebpo_paint_options options = EBPO_PAINT_OPTIONS_INIT;
    options.fineness = fineness;
    options.threads = threads;
    model_must(ebpo_paint_measure(o->paint, o->context, &options, &areas, &error), "measuring",
               &error);
    return areas;
}

/* Expects an area within its bounds, which are close to each other, and near the value. */
static void expect_area(const ebpo_paint_area *a, double area, double apart, double off)
{
    ck_assert_msg(a->lo <= area * (1 + 1e-12) && area <= a->hi * (1 + 1e-12),
                  "%.17g is not from %.17g to %.17g", area, a->lo, a->hi);
    ck_assert_msg(a->hi - a->lo <= apart * area, "%g to %g", a->lo, a->hi);
    ck_assert_msg(fabs(a->value - area) <= off * area, "%.17g for %.17g", a->value, area);
}

/* --- files --- */

static void same_text(const char *a, const char *b) { ck_assert_str_eq(a, b); }

static void same_paint(const ebpo_paint *a, const ebpo_paint *b)
{
    ebpo_paint_info x = EBPO_PAINT_INFO_INIT, y = EBPO_PAINT_INFO_INIT;
    ebpo_paint_layer k = EBPO_PAINT_LAYER_INIT, l = EBPO_PAINT_LAYER_INIT;
    ebpo_paint_note m = EBPO_PAINT_NOTE_INIT, n = EBPO_PAINT_NOTE_INIT;
    ebpo_paint_stroke s = EBPO_PAINT_STROKE_INIT, t = EBPO_PAINT_STROKE_INIT;
    ck_assert(ebpo_paint_get_info(a, &x) == EBPO_OK && ebpo_paint_get_info(b, &y) == EBPO_OK);
    same_text(x.model_sha256, y.model_sha256);
    same_text(x.model_name, y.model_name);
    ck_assert(x.source_numbers == y.source_numbers && x.layer_count == y.layer_count);
    ck_assert(x.note_count == y.note_count && x.stroke_count == y.stroke_count);
    for (uint64_t i = 0; ebpo_paint_get_layer(a, i, &k) == EBPO_OK; i++) {
        ck_assert(ebpo_paint_get_layer(b, i, &l) == EBPO_OK && k.colour == l.colour);
        ck_assert(k.opacity == l.opacity && k.visible == l.visible);
        same_text(k.title, l.title);
        same_text(k.author, l.author);
        same_text(k.date, l.date);
        same_text(k.description, l.description);
    }
    for (uint64_t i = 0; ebpo_paint_get_note(a, i, &m) == EBPO_OK; i++) {
        ck_assert(ebpo_paint_get_note(b, i, &n) == EBPO_OK && m.layer == n.layer);
        ck_assert(memcmp(&m.at, &n.at, sizeof m.at) == 0);
        same_text(m.title, n.title);
        same_text(m.body, n.body);
    }
    for (uint64_t i = 0; ebpo_paint_get_stroke(a, i, &s) == EBPO_OK; i++) {
        ck_assert(ebpo_paint_get_stroke(b, i, &t) == EBPO_OK && s.layer == t.layer);
        ck_assert(s.kind == t.kind && s.colour == t.colour && s.radius == t.radius);
        ck_assert(s.time == t.time && s.point_count == t.point_count);
        ck_assert(memcmp(s.points, t.points, s.point_count * sizeof *s.points) == 0);
    }
}

static void fill(opened *o)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_paint_layer layer = EBPO_PAINT_LAYER_INIT;
    ebpo_paint_note note = EBPO_PAINT_NOTE_INIT;
    char body[32768];
    memset(body, 'b', sizeof body - 1);
    body[sizeof body - 1] = 0;
    layer.title = "Risse \xe2\x80\x94 \xe4\xbf\xae";
    layer.author = "A. B.";
    layer.date = "2026-11-26";
    layer.description = "one\xe2\x80\xa8two";
    layer.colour = 0x01020304;
    layer.opacity = 7;
    layer.visible = 0;
    for (int i = 0; i < 3; i++)
        model_must(ebpo_paint_add_layer(o->paint, &layer, NULL, &error), "a layer", &error);
    note.title = "Here";
    note.body = body;
    for (note.layer = 0; note.layer < 3; note.layer++) {
        note.at = point_at(o, 0.2 * (double)note.layer, 1, 2);
        model_must(ebpo_paint_add_note(o->paint, &note, &error), "a note", &error);
    }
    for (int i = 0; i < 12; i++)
        add_dab(o, (uint64_t)i % 4, i % 5 == 4 ? 0 : 0xff00ff80u + (uint32_t)i, 0.1 + i, 0.1 * i, 2,
                i);
}

START_TEST(test_paint_file_round_trip)
{
    opened o = open_model(ebpo_test_sphere((double[3]){ 0, 0, 0 }, 1, 3), -1);
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_paint *read = NULL;
    fill(&o);
    model_must(ebpo_paint_save(o.paint, scratch("p.paint.h5"), &error), "saving", &error);
    model_must(ebpo_paint_open(scratch("p.paint.h5"), &read, &error), "reading", &error);
    same_paint(o.paint, read);
    same_paint(read, o.paint);
    /* saves the paint again to the file that it was read from */
    model_must(ebpo_paint_save(read, scratch("p.paint.h5"), &error), "saving", &error);
    ebpo_paint_free(read);
    model_must(ebpo_paint_open(scratch("p.paint.h5"), &read, &error), "reading", &error);
    same_paint(o.paint, read);
    ebpo_paint_free(read);
    close_model(&o);
}
END_TEST

/* --- two handles of the same file --- */

static ebpo_paint *opened_paint(void)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_paint *p = NULL;
    model_must(ebpo_paint_open(scratch("p.paint.h5"), &p, &error), "reading", &error);
    return p;
}

static uint64_t layers_of(const ebpo_paint *p)
{
    ebpo_paint_info info = EBPO_PAINT_INFO_INIT;
    ck_assert(ebpo_paint_get_info(p, &info) == EBPO_OK);
    return info.layer_count;
}

START_TEST(test_paint_second_save_is_refused)
{
    opened o = open_model(ebpo_test_sphere((double[3]){ 0, 0, 0 }, 1, 2), -1);
    ebpo_error error = EBPO_ERROR_INIT;
    model_must(ebpo_paint_save(o.paint, scratch("p.paint.h5"), &error), "saving", &error);
    ebpo_paint *one = opened_paint(), *other = opened_paint();
    ck_assert(ebpo_paint_add_layer(one, NULL, NULL, NULL) == EBPO_OK);
    model_must(ebpo_paint_save(one, scratch("p.paint.h5"), &error), "saving", &error);
    /* the handle that created the file is also refused, because it has not read the file again */
    ck_assert(ebpo_paint_save(other, scratch("p.paint.h5"), &error) == EBPO_E_IO);
    ck_assert(strstr(error.message, "another program has changed the file") != NULL);
    ck_assert(ebpo_paint_save(o.paint, scratch("p.paint.h5"), NULL) == EBPO_E_IO);
    /* the last saver may save again, and copies may be saved anywhere */
    model_must(ebpo_paint_save(one, scratch("p.paint.h5"), &error), "saving", &error);
    model_must(ebpo_paint_save(other, scratch("q.paint.h5"), &error), "saving", &error);
    model_must(ebpo_paint_save(other, scratch("q.paint.h5"), &error), "saving", &error);
    ck_assert(ebpo_paint_save(other, scratch("p.paint.h5"), NULL) == EBPO_E_IO);
    ebpo_paint_free(one);
    ebpo_paint_free(other);
    one = opened_paint();
    ck_assert(layers_of(one) == 2);
    /* a missing file is created again */
    ck_assert(unlink(scratch("p.paint.h5")) == 0);
    model_must(ebpo_paint_save(one, scratch("p.paint.h5"), &error), "saving", &error);
    ebpo_paint_free(one);
    close_model(&o);
}
END_TEST

START_TEST(test_paint_keeps_file_modified_in_place)
{
    opened o = open_model(ebpo_test_sphere((double[3]){ 0, 0, 0 }, 1, 2), -1);
    ebpo_error error = EBPO_ERROR_INIT;
    model_must(ebpo_paint_save(o.paint, scratch("p.paint.h5"), &error), "saving", &error);
    ebpo_paint *p = opened_paint();
    FILE *f = fopen(scratch("p.paint.h5"), "ab");
    ck_assert(f && fputc(0, f) == 0 && fclose(f) == 0);
    ck_assert(ebpo_paint_save(p, scratch("p.paint.h5"), NULL) == EBPO_E_IO);
    ebpo_paint_free(p);
    close_model(&o);
}
END_TEST

START_TEST(test_paint_checkpoint_keeps_the_lock)
{
    opened o = open_model(ebpo_test_sheet(8, 2), -1);
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_paint *one = NULL, *other = NULL;
    ebpo_paint_layer layer = EBPO_PAINT_LAYER_INIT;
    ebpo_paint_info info = EBPO_PAINT_INFO_INIT;
    const char *path = scratch("checkpoint.paint.h5");
    model_must(ebpo_paint_new(o.file, &one, &error), "new", &error);
    ck_assert(ebpo_paint_checkpoint(one, NULL) == EBPO_E_ARGUMENT); /* no file */
    ebpo_paint_free(one);
    model_must(ebpo_paint_open_to_change(path, o.file, 0, NULL, &one, &error), "new", &error);
    for (uint64_t i = 1; i <= 3; i++) {
        model_must(ebpo_paint_add_layer(one, &layer, NULL, &error), "adding", &error);
        model_must(ebpo_paint_checkpoint(one, &error), "checkpoint", &error);
        ck_assert(ebpo_paint_open_to_change(path, o.file, 0.05, NULL, &other, NULL) == EBPO_E_IO);
        model_must(ebpo_paint_open(path, &other, &error), "reading", &error);
        ck_assert(ebpo_paint_get_info(other, &info) == EBPO_OK && info.layer_count == i);
        ebpo_paint_free(other);
    }
    ebpo_paint_free(one);
    model_must(ebpo_paint_open_to_change(path, NULL, 0, NULL, &other, &error), "next", &error);
    ebpo_paint_free(other);
    close_model(&o);
}
END_TEST

START_TEST(test_paint_file_is_locked_for_changes)
{
    opened o = open_model(ebpo_test_sphere((double[3]){ 0, 0, 0 }, 1, 2), -1);
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_paint *one = NULL, *other = NULL;
    const char *path = scratch("p.paint.h5");
    ck_assert(ebpo_paint_open_to_change(path, NULL, 0, NULL, &one, &error) == EBPO_E_IO);
    ck_assert(ebpo_paint_open_to_change(path, NULL, NAN, NULL, &one, NULL) == EBPO_E_ARGUMENT);
    /* other programs also wait for a new paint */
    model_must(ebpo_paint_open_to_change(path, o.file, 0, NULL, &one, &error), "new", &error);
    ck_assert(ebpo_paint_open_to_change(path, o.file, 0.05, NULL, &other, &error) == EBPO_E_IO);
    ck_assert(strstr(error.message, "another program has been changing the file") && !other);
    /* a save to another path, even a failed one, does not release the lock */
    ck_assert(ebpo_paint_save(one, scratch("absent/q.paint.h5"), NULL) == EBPO_E_IO);
    ck_assert(ebpo_paint_save(one, scratch(NULL), NULL) == EBPO_E_IO);
    model_must(ebpo_paint_save(one, scratch("q.paint.h5"), &error), "saving", &error);
    ck_assert(ebpo_paint_open_to_change(path, o.file, 0.05, NULL, &other, &error) == EBPO_E_IO);
    ck_assert(ebpo_paint_add_layer(one, NULL, NULL, NULL) == EBPO_OK);
    model_must(ebpo_paint_save(one, path, &error), "saving", &error);
    /* after saving, the next program gets the lock and reads the saved file */
    model_must(ebpo_paint_open_to_change(path, o.file, 0, NULL, &other, &error), "next", &error);
    ck_assert(layers_of(other) == 1 && ebpo_paint_add_layer(other, NULL, NULL, NULL) == EBPO_OK);
    ebpo_paint_free(other); /* without saving */
    model_must(ebpo_paint_open_to_change(path, NULL, 0, NULL, &other, &error), "next", &error);
    model_must(ebpo_paint_save(other, path, &error), "saving", &error);
    ck_assert(ebpo_paint_save(one, path, &error) == EBPO_E_IO);
    ebpo_paint_free(one);
    ebpo_paint_free(other);
    close_model(&o);
}
END_TEST

START_TEST(test_new_paint_keeps_file_made_meanwhile)
{
    opened o = open_model(ebpo_test_sphere((double[3]){ 0, 0, 0 }, 1, 2), -1);
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_paint *p = NULL;
    model_must(ebpo_paint_open_to_change(scratch("p.paint.h5"), o.file, 0, NULL, &p, &error), "new",
               &error);
    /* written by a program that ignores locks */
    ck_assert(ebpo_write_file(scratch("p.paint.h5"), "x", 1, NULL) == EBPO_OK);
    ck_assert(ebpo_paint_save(p, scratch("p.paint.h5"), &error) == EBPO_E_IO);
    ebpo_paint_free(p);
    close_model(&o);
}
END_TEST

START_TEST(test_new_paint_writes_file_on_save)
{
    opened o = open_model(ebpo_test_sphere((double[3]){ 0, 0, 0 }, 1, 2), -1);
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_paint *p = NULL;
    int slots = 0;
    while (ebpo_unfinished_reserve() >= 0) /* no further output can be started */
        slots++;
    ebpo_status status =
        ebpo_paint_open_to_change(scratch("p.paint.h5"), o.file, 0, NULL, &p, &error);
    while (slots > 0)
        ebpo_unfinished_forget(--slots);
    model_must(status, "new", &error);
    ebpo_paint_free(p);
    ck_assert(ebpo_paint_open_to_change(scratch("absent/p.paint.h5"), o.file, 0, NULL, &p,
                                        &error) == EBPO_E_IO);
    ck_assert(strstr(error.message, "the folder of the output cannot be used") != NULL);
    close_model(&o);
}
END_TEST

START_TEST(test_paint_points_are_checked_against_model)
{
    opened o = open_model(ebpo_test_sphere((double[3]){ 0, 0, 0 }, 1, 2), -1);
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_paint_stroke s = EBPO_PAINT_STROKE_INIT;
    ebpo_paint_note n = EBPO_PAINT_NOTE_INIT;
    fill(&o);
    model_must(ebpo_paint_check_points(o.paint, o.context, NULL, &error), "checking", &error);
    ck_assert(ebpo_paint_get_stroke(o.paint, 0, &s) == EBPO_OK);
    ebpo_paint_point q = s.points[0], far = q;
    far.place[0] += 0.1;
    s.points = &far;
    ck_assert(ebpo_paint_add_stroke(o.paint, &s, NULL) == EBPO_OK);
    ck_assert(ebpo_paint_check_points(o.paint, o.context, NULL, &error) == EBPO_E_FORMAT);
    ck_assert(strstr(error.message, "a point of stroke 12 is not on its face") != NULL);
    ck_assert(ebpo_paint_remove_stroke(o.paint, 12, NULL) == EBPO_OK);
    n.at = q;
    n.at.face = 1 << 20; /* a face that does not exist */
    ck_assert(ebpo_paint_add_note(o.paint, &n, NULL) == EBPO_OK);
    ck_assert(ebpo_paint_check_points(o.paint, o.context, NULL, &error) == EBPO_E_FORMAT);
    ck_assert(strstr(error.message, "a point of note 3 is not on its face 1048576") != NULL);
    close_model(&o);
}
END_TEST

START_TEST(test_paint_removed_layers_are_absent)
{
    opened o = open_model(ebpo_test_sphere((double[3]){ 0, 0, 0 }, 1, 2), -1);
    ebpo_paint_info info = EBPO_PAINT_INFO_INIT;
    ebpo_paint_stroke s = EBPO_PAINT_STROKE_INIT;
    ebpo_paint_note n = EBPO_PAINT_NOTE_INIT;
    fill(&o);
    ck_assert(ebpo_paint_remove_layer(o.paint, 1, NULL) == EBPO_OK);
    ck_assert(ebpo_paint_get_info(o.paint, &info) == EBPO_OK);
    ck_assert(info.layer_count == 3 && info.stroke_count == 9 && info.point_count == 9 &&
              info.note_count == 2);
    /* strokes were in layers 0 1 2 3 0 1 ..., their radii identify them */
    static const double radius[] = { 0.1, 2.1, 3.1, 4.1, 6.1, 7.1, 8.1, 10.1, 11.1 };
    for (uint64_t i = 0; i < 9; i++) {
        ck_assert(ebpo_paint_get_stroke(o.paint, i, &s) == EBPO_OK);
        ck_assert(fabs(s.radius - radius[i]) < 1e-9 && s.layer == i % 3);
    }
    ck_assert(ebpo_paint_get_note(o.paint, 1, &n) == EBPO_OK && n.layer == 1);
    ck_assert(ebpo_paint_remove_note(o.paint, 0, NULL) == EBPO_OK);
    ck_assert(ebpo_paint_get_note(o.paint, 0, &n) == EBPO_OK && n.layer == 1);
    ck_assert(ebpo_paint_remove_stroke(o.paint, 8, NULL) == EBPO_OK); /* undo */
    ck_assert(ebpo_paint_remove_stroke(o.paint, 0, NULL) == EBPO_OK);
    ck_assert(ebpo_paint_get_stroke(o.paint, 0, &s) == EBPO_OK && fabs(s.radius - 2.1) < 1e-9);
    ck_assert(ebpo_paint_remove_stroke(o.paint, 7, NULL) == EBPO_E_ARGUMENT);
    ck_assert(ebpo_paint_remove_layer(o.paint, 3, NULL) == EBPO_E_ARGUMENT);
    close_model(&o);
}
END_TEST

START_TEST(test_paint_invalid_input_is_refused)
{
    opened o = open_model(ebpo_test_tetrahedron(1), -1);
    ebpo_paint_layer layer = EBPO_PAINT_LAYER_INIT;
    ebpo_paint_stroke s = EBPO_PAINT_STROKE_INIT;
    ebpo_paint_point q = point_at(&o, 0, 0, 0);
    layer.title = "two\nlines";
    ck_assert(ebpo_paint_add_layer(o.paint, &layer, NULL, NULL) == EBPO_E_ARGUMENT);
    layer.title = NULL;
    layer.date = "a date that is longer than any date";
    ck_assert(ebpo_paint_add_layer(o.paint, &layer, NULL, NULL) == EBPO_E_ARGUMENT);
    for (int i = 0; i < 4; i++) {
        static const char *const dates[] = { "2026-02-30", "2100-02-29", "2026-11-31T10:00Z",
                                             "May" };
        layer.date = dates[i];
        ck_assert(ebpo_paint_add_layer(o.paint, &layer, NULL, NULL) == EBPO_E_ARGUMENT);
        ck_assert(ebpo_paint_set_layer(o.paint, 0, &layer, NULL) == EBPO_E_ARGUMENT);
    }
    layer.date = "2096-02-29";
    ck_assert(ebpo_paint_set_layer(o.paint, 0, &layer, NULL) == EBPO_OK);
    layer.date = NULL;
    layer.opacity = 256;
    ck_assert(ebpo_paint_add_layer(o.paint, &layer, NULL, NULL) == EBPO_E_ARGUMENT);
    s.radius = 1;
    s.points = &q;
    /* a stroke without points */
    ck_assert(ebpo_paint_add_stroke(o.paint, &s, NULL) == EBPO_E_ARGUMENT);
    s.point_count = 1;
    ck_assert(ebpo_paint_add_stroke(o.paint, &s, NULL) == EBPO_OK);
    s.radius = NAN;
    ck_assert(ebpo_paint_add_stroke(o.paint, &s, NULL) == EBPO_E_ARGUMENT);
    s.radius = 1;
    s.layer = UINT64_C(1) << 32;
    ck_assert(ebpo_paint_add_stroke(o.paint, &s, NULL) == EBPO_E_ARGUMENT);
    s.layer = 0;
    s.point_count = EBPO_PAINT_POINTS;
    ck_assert(ebpo_paint_add_stroke(o.paint, &s, NULL) == EBPO_E_LIMIT);
    s.point_count = 1;
    q.size = 0;
    ck_assert(ebpo_paint_add_stroke(o.paint, &s, NULL) == EBPO_E_ARGUMENT);
    close_model(&o);
}
END_TEST

START_TEST(test_paint_of_other_model_is_refused)
{
    opened o = open_model(ebpo_test_sphere((double[3]){ 0, 0, 0 }, 1, 2), -1);
    ebpo_paint *mine = o.paint;
    o.paint = NULL;
    close_model(&o);
    o = open_model(ebpo_test_sphere((double[3]){ 0, 0, 0 }, 1, 3), -1);
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_paint_areas areas = EBPO_PAINT_AREAS_INIT;
    ck_assert(ebpo_paint_check_model(mine, o.file, &error) == EBPO_E_ARGUMENT);
    ck_assert(strstr(error.message, "belongs to another model, m.ebpo.h5") != NULL);
    ck_assert(ebpo_paint_measure(mine, o.context, NULL, &areas, NULL) == EBPO_E_ARGUMENT);
    ebpo_paint_free(mine);
    close_model(&o);
}
END_TEST

/* --- range of a ball --- */

typedef struct sides {
    uint64_t faces, above, below, covered;
} sides;

static bool take_side(void *user, const ebpo_paint_face *f)
{
    sides *s = user;
    bool above = true, below = true;
    for (int k = 0; k < 3; k++) {
        above = above && f->corner[k][2] == 0.1;
        below = below && f->corner[k][2] == 0;
        s->covered += f->covered[k];
    }
    s->faces++;
    s->above += above;
    s->below += below;
    return true;
}

static sides sides_of(const opened *o, uint64_t stroke)
{
    sides s = { 0, 0, 0, 0 };
    ebpo_error error = EBPO_ERROR_INIT;
    model_must(ebpo_paint_cover(o->paint, o->context, stroke, take_side, &s, NULL, &error), "cover",
               &error);
    return s;
}

/* The plate is 2 x 2 x 0.1. A ball through it paints one side; at the rim it paints both. */
START_TEST(test_paint_spares_back_of_thin_plate)
{
    for (int cut = -1; cut <= 1; cut += 2) {
        opened o =
            open_model(ebpo_test_box((double[3]){ 0, 0, 0 }, (double[3]){ 2, 2, 0.1 }, 20), cut);
        add_dab(&o, 0, 0xff0000ff, 0.4, 1, 1, 0.2);
        add_dab(&o, 0, 0xff0000ff, 0.4, 1, 0.1, 0.2);
        add_dab(&o, 0, 0xff0000ff, 0.4, 1, 1, -0.2);
        sides middle = sides_of(&o, 0), rim = sides_of(&o, 1), under = sides_of(&o, 2);
        ck_assert(middle.above > 100 && middle.below == 0 && middle.above == middle.faces);
        ck_assert(rim.above > 50 && rim.below > 50 && middle.covered > 100);
        ck_assert(under.below > 100 && under.above == 0);
        ebpo_paint_areas areas = measured(&o, 256, 0);
        expect_area(&areas.strokes[0], PI * 0.16, 0.02, 1e-3);
        expect_area(&areas.strokes[2], PI * 0.16, 0.02, 1e-3);
        ebpo_paint_areas_free(&areas);
        close_model(&o);
    }
}
END_TEST

/* Tests two faces of one large square, and a ball that touches none of the square's other edges. */
START_TEST(test_paint_joins_faces_across_long_edges)
{
    opened o = open_model(ebpo_test_sheet(8, 1), -1);
    add_dab(&o, 0, 0xff0000ff, 1, 4.1, 3.9, 0);
    sides s = sides_of(&o, 0);
    ck_assert(s.faces == 2 && s.covered == 0);
    ebpo_paint_areas areas = measured(&o, 256, 0);
    expect_area(&areas.all, PI, 0.02, 1e-3);
    ebpo_paint_areas_free(&areas);
    close_model(&o);
}
END_TEST

/* --- areas --- */

/* Returns the common area of two discs of radius r at distance d. */
static double lens(double r, double d)
{
    return 2 * r * r * acos(d / (2 * r)) - d / 2 * sqrt(4 * r * r - d * d);
}

/* A square of side 8 has a disc, a second disc that overlaps the first one, a disc that erases a
 * part of both, and a disc in a layer above. */
START_TEST(test_paint_areas_match_discs)
{
    for (int cut = -1; cut <= 1; cut += 2) {
        opened o = open_model(ebpo_test_sheet(8, 37), cut);
        ebpo_error error = EBPO_ERROR_INIT;
        double disc = PI * 0.81;
        model_must(ebpo_paint_add_layer(o.paint, NULL, NULL, &error), "a layer", &error);
        add_dab(&o, 0, 0xff0000ff, 0.9, 2, 2, 0);
        add_dab(&o, 1, 0xff0000ff, 0.9, 6, 6, 0);
        add_dab(&o, 0, 0x00ff00ff, 0.9, 3, 2, 0);
        add_dab(&o, 0, 0, 0.9, 4.2, 2, 0); /* erases only the second disc */
        add_dab(&o, 1, 0x00ff00ff, 0.9, 2.5, 2, 0);
        ebpo_paint_areas a = measured(&o, 256, 1), b = measured(&o, 256, 3);
        double second = disc - lens(0.9, 1.2), first = disc - lens(0.9, 1);
        expect_area(&a.strokes[0], first, 0.03, 1e-3);
        expect_area(&a.strokes[2], second, 0.03, 1e-3);
        ck_assert(a.strokes[3].hi == 0);
        expect_area(&a.strokes[1], disc, 0.02, 1e-3);
        expect_area(&a.layers[0], first + second, 0.02, 1e-3);
        expect_area(&a.layers[1], 2 * disc, 0.02, 1e-3);
        ck_assert(a.colour_count == 4);
        ck_assert(a.colours[0].layer == 0 && a.colours[0].colour == 0x00ff00ff);
        expect_area(&a.colours[0].area, second, 0.03, 1e-3);
        expect_area(&a.colours[1].area, first, 0.03, 1e-3);
        ck_assert(a.all.hi <= a.layers[0].hi + a.layers[1].hi && a.all.lo > a.layers[1].hi);
        /* the result does not depend on threads */
        ck_assert(memcmp(&a.all, &b.all, sizeof a.all) == 0);
        ck_assert(memcmp(a.strokes, b.strokes, 5 * sizeof *a.strokes) == 0);
        ebpo_paint_areas_free(&a);
        ebpo_paint_areas_free(&b);
        close_model(&o);
    }
}
END_TEST

/* Tests balls that are smaller than the spacing of doubles at their position, beside large balls.
 */
START_TEST(test_paint_smallest_balls_terminate)
{
    opened o = open_model(ebpo_test_sheet(8, 3), -1);
    for (int i = 0; i < 20; i++)
        add_dab(&o, 0, 0xff0000ffu + ((uint32_t)i << 8), ldexp(1, -10 * i), 4.1 + 1e-15 * i, 3.9,
                0);
    add_dab(&o, 0, 0x00ff00ff, 0x1p-200, 4, 4, 0);
    add_dab(&o, 0, 0, 0x1p-60, 4.1, 3.9, 0);
    ebpo_paint_areas areas = measured(&o, 4096, 0);
    ck_assert(areas.all.hi > areas.all.lo && fabs(areas.all.value - PI) < 1e-4);
    ebpo_paint_areas_free(&areas);
    close_model(&o);
}
END_TEST

/* Tests a complete sphere and a cap of the sphere. The area of a cap within a chord r is pi r^2. */
START_TEST(test_paint_areas_follow_surface)
{
    opened o = open_model(ebpo_test_sphere((double[3]){ 1, 2, 3 }, 2, 4), -1);
    ebpo_mass mass = EBPO_MASS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    model_must(ebpo_measure(o.file, 1, &mass, &error), "measuring", &error);
    add_dab(&o, 0, 0xff0000ff, 1, 1, 2, 9);
    ebpo_paint_areas areas = measured(&o, 256, 0);
    ck_assert(fabs(areas.all.value - PI) < 0.01 * PI); /* faces are within the sphere */
    ebpo_paint_areas_free(&areas);
    add_dab(&o, 0, 0x00ff00ff, 5, 1, 2, 9);
    areas = measured(&o, 1, 0);
    ck_assert(fabs(areas.strokes[1].lo - mass.area) < 1e-9 && areas.strokes[0].hi == 0);
    ebpo_paint_areas_free(&areas);
    close_model(&o);
}
END_TEST

/* --- a device --- */

enum { INPUT = 40 };

static ebpo_paint_drawn laid_by(opened *o, const ebpo_paint_pen *pen, double pressure,
                                double height)
{
    ebpo_paint_input input[INPUT];
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_paint_drawn drawn = EBPO_PAINT_DRAWN_INIT;
    for (int i = 0; i < INPUT; i++)
        input[i] =
            (ebpo_paint_input){ { 1 + 0.15 * i, 4, i == 20 ? 3 : height }, pressure, 5. * i };
    model_must(ebpo_paint_draw(o->paint, o->context, input, INPUT, pen, &drawn, &error), "drawing",
               &error);
    return drawn;
}

/* Checks that points are on their faces, at their weights, and within the spread. */
static void check_points(const ebpo_paint *paint, const ebpo_mesh *mesh)
{
    ebpo_paint_stroke s = EBPO_PAINT_STROKE_INIT;
    for (uint64_t i = 0; ebpo_paint_get_stroke(paint, i, &s) == EBPO_OK; i++)
        for (uint64_t k = 0; k < s.point_count; k++) {
            const ebpo_paint_point *q = &s.points[k];
            double w[3] = { 0, q->weight[0] * 0x1p-30, q->weight[1] * 0x1p-30 };
            w[0] = 1 - w[1] - w[2];
            for (int c = 0; c < 3; c++) {
                double sum = 0;
                for (int v = 0; v < 3; v++)
                    sum += w[v] * mesh->xyz64[3 * mesh->faces[3 * q->face + (unsigned)v] + c];
                ck_assert(fabs(sum - q->place[c]) < 1e-8);
            }
            ck_assert(fabs(q->place[1] - 4) <= 0.5 && q->place[2] == 0);
        }
}

START_TEST(test_paint_pressure_adds_points)
{
    opened o = open_model(ebpo_test_sheet(8, 16), -1);
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh mesh;
    ebpo_paint_pen pen = EBPO_PAINT_PEN_INIT;
    ebpo_paint_stroke s = EBPO_PAINT_STROKE_INIT, t = EBPO_PAINT_STROKE_INIT;
    pen.radius = 0.1;
    pen.spread = 0.5;
    pen.density = 20;
    pen.size_least = 0.25;
    pen.within = 1;
    ebpo_paint_drawn soft = laid_by(&o, &pen, 0.1, 0.5), hard = laid_by(&o, &pen, 1, 0.5),
                     again = laid_by(&o, &pen, 1, 0.5);
    pen.seed = 2;
    laid_by(&o, &pen, 1, 0.5);
    /* the device moves up at one position, which lifts the pen */
    ck_assert(soft.strokes == 2 && hard.strokes == 2 && soft.lifted == hard.lifted);
    ck_assert(soft.steps == hard.steps && soft.lifted > 0 && hard.strayed == 0);
    ck_assert(soft.points == 2 * soft.steps && hard.points == 20 * hard.steps);
    ck_assert(again.points == hard.points);
    ck_assert(ebpo_paint_get_stroke(o.paint, 2, &s) == EBPO_OK);
    ck_assert(ebpo_paint_get_stroke(o.paint, 4, &t) == EBPO_OK);
    ck_assert(memcmp(s.points, t.points, s.point_count * sizeof *s.points) == 0);
    ck_assert(ebpo_paint_get_stroke(o.paint, 6, &t) == EBPO_OK);
    ck_assert(s.point_count == t.point_count);
    ck_assert(memcmp(s.points, t.points, s.point_count * sizeof *s.points) != 0);
    ck_assert(s.points[0].size == 1 << 15 && s.points[0].pressure == 65535);
    ck_assert(ebpo_paint_get_stroke(o.paint, 0, &s) == EBPO_OK);
    ck_assert(s.points[0].size == (int)(0.325 * 32768 + 0.5) && s.points[0].time == 0);
    ck_assert(s.points[s.point_count - 1].time > 50);
    model_must(ebpo_file_read_source_mesh(o.file, NULL, &mesh, NULL, &error), "reading", &error);
    check_points(o.paint, &mesh);
    ebpo_mesh_free(&mesh);
    close_model(&o);
}
END_TEST

/* Draws the same path in calls of 1 to 5 positions. */
START_TEST(test_paint_drawing_in_parts_equals_one_call)
{
    opened o = open_model(ebpo_test_sheet(8, 16), -1);
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_paint_input input[INPUT];
    ebpo_paint_pen pen = EBPO_PAINT_PEN_INIT;
    ebpo_paint_drawing *drawing = NULL;
    ebpo_paint_drawn drawn = EBPO_PAINT_DRAWN_INIT, all = EBPO_PAINT_DRAWN_INIT;
    ebpo_paint_stroke s = EBPO_PAINT_STROKE_INIT, t = EBPO_PAINT_STROKE_INIT;
    ebpo_paint_info info = EBPO_PAINT_INFO_INIT;
    pen.radius = 0.1;
    pen.spread = 0.3;
    pen.density = 5;
    pen.size_least = 0.25;
    pen.pressure_step = 0.2;
    pen.within = 1;
    for (int i = 0; i < INPUT; i++)
        input[i] = (ebpo_paint_input){ { 1 + 0.15 * i, 4, i == 20 || i == 27 ? 3 : 0.5 },
                                       i % 13 / 12.,
                                       5. * i };
    for (int most = 1; most <= 5; most++) {
        model_must(ebpo_paint_draw(o.paint, o.context, input, INPUT, &pen, &all, &error), "drawing",
                   &error);
        model_must(ebpo_paint_drawing_new(o.paint, o.context, &pen, &drawing, &error), "beginning",
                   &error);
        for (int i = 0, count; i < INPUT; i += count) {
            count = i + most < INPUT ? most : INPUT - i;
            model_must(ebpo_paint_drawing_add(drawing, input + i, (uint64_t)count, &drawn, &error),
                       "drawing in parts", &error);
        }
        ebpo_paint_drawing_free(drawing);
        ck_assert(all.strokes > 2 && memcmp(&all, &drawn, sizeof all) == 0);
        ck_assert(ebpo_paint_get_info(o.paint, &info) == EBPO_OK);
        ck_assert(info.stroke_count == 2 * all.strokes && info.point_count == 2 * all.points);
        for (uint64_t i = 0; i < all.strokes; i++) {
            ck_assert(ebpo_paint_get_stroke(o.paint, i, &s) == EBPO_OK);
            ck_assert(ebpo_paint_get_stroke(o.paint, i + all.strokes, &t) == EBPO_OK);
            ck_assert(s.point_count == t.point_count);
            ck_assert(memcmp(s.points, t.points, s.point_count * sizeof *s.points) == 0);
        }
        while (info.stroke_count > 0)
            model_must(ebpo_paint_remove_stroke(o.paint, --info.stroke_count, &error), "removing",
                       &error);
    }
    close_model(&o);
}
END_TEST

START_TEST(test_paint_rising_pressure_widens_a_spot)
{
    opened o = open_model(ebpo_test_sheet(8, 2), -1);
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_paint_input input[INPUT];
    ebpo_paint_pen pen = EBPO_PAINT_PEN_INIT;
    ebpo_paint_stroke s = EBPO_PAINT_STROKE_INIT;
    pen.radius = 0.1;
    pen.size_least = 0.25;
    for (int i = 0; i < INPUT; i++) /* the pressure rises to 1 and falls */
        input[i] = (ebpo_paint_input){ { 1, 1, 1 }, i <= 20 ? 0.05 * i : 2 - 0.05 * i, 5. * i };
    model_must(ebpo_paint_draw(o.paint, o.context, input + 1, INPUT - 1, &pen, NULL, &error),
               "drawing", &error);
    ck_assert(ebpo_paint_get_stroke(o.paint, 0, &s) == EBPO_OK && s.point_count == 1);
    pen.pressure_step = 0.25;
    model_must(ebpo_paint_draw(o.paint, o.context, input + 1, INPUT - 1, &pen, NULL, &error),
               "drawing", &error);
    ck_assert(ebpo_paint_get_stroke(o.paint, 1, &s) == EBPO_OK && s.point_count == 4);
    for (uint64_t i = 1; i < s.point_count; i++)
        ck_assert(s.points[i].pressure >= s.points[i - 1].pressure + 16383 &&
                  s.points[i].size > s.points[i - 1].size);
    pen.pressure_step = 2;
    ck_assert(ebpo_paint_draw(o.paint, o.context, input, 1, &pen, NULL, NULL) == EBPO_E_ARGUMENT);
    close_model(&o);
}
END_TEST

/* A failed call adds nothing, and the drawing can be continued. */
START_TEST(test_paint_drawing_continues_after_failure)
{
    opened o = open_model(ebpo_test_sheet(8, 2), -1);
    ebpo_error error = EBPO_ERROR_INIT;
    const ebpo_paint_input near = { { 1, 1, 1 }, 1, 0 },
                           far[2] = { { { 2, 1, 1 }, 1, 0 }, { { 1e9, 1, 1 }, 1, 0 } };
    ebpo_paint_drawing *drawing = NULL;
    ebpo_paint_info info = EBPO_PAINT_INFO_INIT;
    ebpo_paint_pen pen = EBPO_PAINT_PEN_INIT;
    ck_assert(ebpo_paint_drawing_new(o.paint, o.context, &pen, &drawing, NULL) == EBPO_E_ARGUMENT &&
              !drawing);
    pen.radius = 0.1;
    model_must(ebpo_paint_drawing_new(o.paint, o.context, &pen, &drawing, &error), "beginning",
               &error);
    ck_assert(ebpo_paint_drawing_add(drawing, &near, 0, NULL, NULL) == EBPO_E_ARGUMENT);
    ck_assert(ebpo_paint_drawing_add(drawing, &near, 1, NULL, NULL) == EBPO_OK);
    ck_assert(ebpo_paint_drawing_add(drawing, far, 2, NULL, NULL) == EBPO_E_LIMIT);
    ck_assert(ebpo_paint_get_info(o.paint, &info) == EBPO_OK);
    ck_assert(info.stroke_count == 1 && info.point_count == 1);
    ck_assert(ebpo_paint_drawing_add(drawing, &near, 1, NULL, NULL) == EBPO_OK);
    ebpo_paint_drawing_free(drawing);
    ck_assert(ebpo_paint_get_info(o.paint, &info) == EBPO_OK);
    ck_assert(info.stroke_count == 2 && info.point_count == 2);
    close_model(&o);
}
END_TEST

START_TEST(test_paint_invalid_pen_adds_nothing)
{
    opened o = open_model(ebpo_test_sheet(8, 2), -1);
    const ebpo_paint_input input[2] = { { { 1, 1, 1 }, 1, 0 }, { { 1e9, 1, 1 }, 1, 0 } };
    ebpo_paint_info info = EBPO_PAINT_INFO_INIT;
    ebpo_paint_pen pen = EBPO_PAINT_PEN_INIT;
    ck_assert(ebpo_paint_draw(o.paint, o.context, input, 1, &pen, NULL, NULL) == EBPO_E_ARGUMENT);
    pen.radius = 0.1;
    ck_assert(ebpo_paint_draw(o.paint, o.context, input, 0, &pen, NULL, NULL) == EBPO_E_ARGUMENT);
    ck_assert(ebpo_paint_draw(o.paint, o.context, input, 2, &pen, NULL, NULL) == EBPO_E_LIMIT);
    pen.density = 2;
    ck_assert(ebpo_paint_draw(o.paint, o.context, input, 1, &pen, NULL, NULL) == EBPO_E_ARGUMENT);
    pen.density = 1;
    pen.layer = 1;
    ck_assert(ebpo_paint_draw(o.paint, o.context, input, 1, &pen, NULL, NULL) == EBPO_E_ARGUMENT);
    ck_assert(ebpo_paint_get_info(o.paint, &info) == EBPO_OK && info.stroke_count == 0);
    close_model(&o);
}
END_TEST

/* --- baking --- */

/* Changes only covered vertices, for all types of colours. */
START_TEST(test_paint_baked_colours_keep_type)
{
    opened o = open_model(ebpo_test_sheet(8, 8), -1);
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_paint_baked baked = EBPO_PAINT_BAKED_INIT;
    ebpo_mesh mesh;
    add_dab(&o, 0, 0x4080c0ff, 1.1, 4, 4, 0);
    model_must(ebpo_file_read_source_mesh(o.file, NULL, &mesh, NULL, &error), "reading", &error);
    uint8_t *rgba = calloc(mesh.vertex_count, 4);
    ck_assert(rgba != NULL);
    model_must(ebpo_paint_bake(o.paint, o.context, &mesh, NULL, rgba, &baked, &error), "baking",
               &error);
    ck_assert(baked.vertices == 5 && baked.points == 1 && baked.points_without_vertex == 0);
    for (uint64_t i = 0; i < mesh.vertex_count; i++) {
        const double *x = mesh.xyz64 + 3 * i;
        bool near = hypot(x[0] - 4, x[1] - 4) <= 1.1;
        ck_assert(rgba[4 * i] == (near ? 0x40 : 0) && rgba[4 * i + 2] == (near ? 0xc0 : 0));
    }
    ebpo_colours own;
    model_must(ebpo_paint_colour_mesh(&mesh, rgba, &error), "dyeing", &error);
    model_must(ebpo_mesh_colours(&mesh, &own, &error), "colours", &error);
    for (uint64_t i = 0; i < mesh.vertex_count; i++)
        ck_assert(memcmp(own.vertex + 4 * i, rgba + 4 * i, 3) == 0);
    ebpo_colours_free(&own);
    free(rgba);
    ebpo_mesh_free(&mesh);
    close_model(&o);
}
END_TEST

TEST_SUITE(paint)
{
    Suite *s = suite_create("paint");
    TCase *c = tcase_create("paint");
    tcase_set_timeout(c, 600);
    tcase_add_checked_fixture(c, scratch_enter, scratch_leave);
    tcase_add_test(c, test_paint_file_round_trip);
    tcase_add_test(c, test_paint_second_save_is_refused);
    tcase_add_test(c, test_paint_keeps_file_modified_in_place);
    tcase_add_test(c, test_paint_file_is_locked_for_changes);
    tcase_add_test(c, test_paint_checkpoint_keeps_the_lock);
    tcase_add_test(c, test_new_paint_keeps_file_made_meanwhile);
    tcase_add_test(c, test_new_paint_writes_file_on_save);
    tcase_add_test(c, test_paint_points_are_checked_against_model);
    tcase_add_test(c, test_paint_removed_layers_are_absent);
    tcase_add_test(c, test_paint_invalid_input_is_refused);
    tcase_add_test(c, test_paint_of_other_model_is_refused);
    tcase_add_test(c, test_paint_spares_back_of_thin_plate);
    tcase_add_test(c, test_paint_joins_faces_across_long_edges);
    tcase_add_test(c, test_paint_areas_match_discs);
    tcase_add_test(c, test_paint_smallest_balls_terminate);
    tcase_add_test(c, test_paint_areas_follow_surface);
    tcase_add_test(c, test_paint_pressure_adds_points);
    tcase_add_test(c, test_paint_drawing_in_parts_equals_one_call);
    tcase_add_test(c, test_paint_rising_pressure_widens_a_spot);
    tcase_add_test(c, test_paint_drawing_continues_after_failure);
    tcase_add_test(c, test_paint_invalid_pen_adds_nothing);
    tcase_add_test(c, test_paint_baked_colours_keep_type);
    suite_add_tcase(s, c);
    return s;
}
