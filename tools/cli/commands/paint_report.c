/* Prints the results of `ebpo paint`: the list, changes, areas. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/json.h"
#include "cli/words.h"
#include "cli/commands/paint_job.h"

/* Writes a colour as "#rrggbbaa"; returns `out`. */
static const char *colour_text(uint32_t colour, char out[12])
{
    snprintf(out, 12, "#%08x", colour);
    return out;
}

/* Counts of one layer. */
typedef struct counts {
    uint64_t strokes, points, notes;
} counts;

/* Returns the counts of all layers; NULL: not enough memory. */
static counts *count_layers(const ebpo_paint *p, const ebpo_paint_info *info)
{
    counts *c = calloc(info->layer_count + 1, sizeof *c);
    ebpo_paint_stroke s = EBPO_PAINT_STROKE_INIT;
    ebpo_paint_note n = EBPO_PAINT_NOTE_INIT;
    for (uint64_t i = 0; c && ebpo_paint_get_stroke(p, i, &s) == EBPO_OK; i++) {
        c[s.layer].strokes++;
        c[s.layer].points += s.point_count;
    }
    for (uint64_t i = 0; c && ebpo_paint_get_note(p, i, &n) == EBPO_OK; i++)
        c[n.layer].notes++;
    return c;
}

/* --- words --- */

/* Prints the lines of a text, indented. Lines are separated by U+2028. */
static void print_lines(const char *text)
{
    while (*text) {
        const char *end = strstr(text, "\xe2\x80\xa8");
        size_t length = end ? (size_t)(end - text) : strlen(text);
        printf("             %.*s\n", (int)length, text);
        text += length + (end ? 3 : 0);
    }
}

static void print_author(const char *author, const char *date)
{
    if (*author || *date)
        printf("             %s%s%s\n", author, *author && *date ? ", " : "", date);
}

static void print_layer(const ebpo_paint *p, uint64_t number, const counts *c)
{
    char strokes[40], points[40], notes[40], colour[12];
    ebpo_paint_layer l = EBPO_PAINT_LAYER_INIT;
    ebpo_paint_get_layer(p, number, &l);
    printf("  layer %-4llu \"%s\", %s, %s, %s, %s", (unsigned long long)number, l.title,
           colour_text(l.colour, colour),
           words_plural(strokes, sizeof strokes, c->strokes, "stroke", "strokes"),
           words_plural(points, sizeof points, c->points, "point", "points"),
           words_plural(notes, sizeof notes, c->notes, "note", "notes"));
    if (l.opacity < 255)
        printf(", opacity %u", l.opacity);
    puts(l.visible ? "" : ", hidden");
    print_author(l.author, l.date);
    print_lines(l.description);
}

static void print_note(const ebpo_paint *p, uint64_t number)
{
    ebpo_paint_note n = EBPO_PAINT_NOTE_INIT;
    ebpo_paint_get_note(p, number, &n);
    printf("  note %-5llu \"%s\", layer %llu, face %u at ", (unsigned long long)number, n.title,
           (unsigned long long)n.layer, n.at.face);
    words_print_reals(n.at.place, 3, " ");
    putchar('\n');
    print_author(n.author, n.date);
    print_lines(n.body);
}

static void print_stroke(const ebpo_paint *p, uint64_t number)
{
    char colour[12], radius[32], points[40];
    ebpo_paint_stroke s = EBPO_PAINT_STROKE_INIT;
    ebpo_paint_get_stroke(p, number, &s);
    printf("  stroke %-3llu layer %llu, %s, radius %s, %s\n", (unsigned long long)number,
           (unsigned long long)s.layer,
           s.kind == EBPO_PAINT_ERASES ? "erases" : colour_text(s.colour, colour),
           words_real(s.radius, radius),
           words_plural(points, sizeof points, s.point_count, "point", "points"));
}

static void print_list(const paint_job *j, const ebpo_paint_info *info, const counts *c)
{
    printf("  model      %s%s%s\n", info->model_name, *info->model_name ? ", " : "",
           info->model_sha256);
    for (uint64_t i = 0; i < info->layer_count; i++)
        print_layer(j->paint, i, &c[i]);
    for (uint64_t i = 0; i < info->note_count; i++)
        print_note(j->paint, i);
    for (uint64_t i = 0; i < info->stroke_count && j->v->strokes; i++)
        print_stroke(j->paint, i);
}

static void print_area(const char *what, const ebpo_paint_area *a)
{
    printf("  %-24s %14.9g  from %.9g to %.9g\n", what, a->value, a->lo, a->hi);
}

static void print_areas(const paint_job *j, const ebpo_paint_info *info)
{
    char what[64], colour[12];
    const ebpo_paint_areas *a = &j->areas;
    print_area("area of all layers", &a->all);
    for (uint64_t i = 0; i < info->layer_count; i++) {
        snprintf(what, sizeof what, "layer %llu", (unsigned long long)i);
        print_area(what, &a->layers[i]);
        for (uint64_t k = 0; k < a->colour_count; k++) {
            if (a->colours[k].layer != i)
                continue;
            snprintf(what, sizeof what, "  %s", colour_text(a->colours[k].colour, colour));
            print_area(what, &a->colours[k].area);
        }
    }
    for (uint64_t i = 0; i < info->stroke_count && j->v->strokes; i++) {
        snprintf(what, sizeof what, "stroke %llu", (unsigned long long)i);
        print_area(what, &a->strokes[i]);
    }
}

static void print_changes(const paint_job *j)
{
    const ebpo_paint_drawn *drawn = &j->drawn;
    const ebpo_paint_baked *b = &j->baked;
    char points[40], strokes[40], steps[40], vertices[40], lifted[40], strayed[40];
    if (j->v->path)
        printf("  drawn      %s in %s, at %s; lifted at %s; %s discarded\n",
               words_plural(points, sizeof points, drawn->points, "point", "points"),
               words_plural(strokes, sizeof strokes, drawn->strokes, "stroke", "strokes"),
               words_plural(steps, sizeof steps, drawn->steps, "step", "steps"),
               words_plural(lifted, sizeof lifted, drawn->lifted, "step", "steps"),
               words_plural(strayed, sizeof strayed, drawn->strayed, "point", "points"));
    if (j->v->bake)
        printf("  baked      %s of %llu; of %s, %llu cover no vertex\n",
               words_plural(vertices, sizeof vertices, b->vertices, "vertex", "vertices"),
               (unsigned long long)ebpo_file_info(j->file)->vertex_count,
               words_plural(points, sizeof points, b->points, "point", "points"),
               (unsigned long long)b->points_without_vertex);
    uint64_t outside = j->v->bake   ? b->points_outside_subset
                       : j->v->area ? j->areas.points_outside_subset
                                    : 0;
    if (outside)
        printf("  omitted    %s, on faces that this subset does not have\n",
               words_plural(points, sizeof points, outside, "point", "points"));
}

static void print_all(const paint_job *j, const ebpo_paint_info *info, const counts *c)
{
    char layers[40], strokes[40], points[40], notes[40];
    printf("%s: %s, %s, %s, %s%s%s\n", j->changed && j->v->out ? j->v->out : j->paint_path,
           words_plural(layers, sizeof layers, info->layer_count, "layer", "layers"),
           words_plural(strokes, sizeof strokes, info->stroke_count, "stroke", "strokes"),
           words_plural(points, sizeof points, info->point_count, "point", "points"),
           words_plural(notes, sizeof notes, info->note_count, "note", "notes"),
           *info->unit ? ", unit " : "", info->unit);
    if (!j->changed && !j->v->bake && !j->v->area)
        print_list(j, info, c);
    print_changes(j);
    if (j->v->area)
        print_areas(j, info);
}

/* --- JSON --- */

static void json_colour(json *out, const char *key, uint32_t colour)
{
    char text[12];
    json_text(out, key, colour_text(colour, text));
}

static void json_layers(const paint_job *j, const ebpo_paint_info *info, const counts *c, json *out)
{
    json_array(out, "layers");
    for (uint64_t i = 0; i < info->layer_count; i++) {
        ebpo_paint_layer l = EBPO_PAINT_LAYER_INIT;
        ebpo_paint_get_layer(j->paint, i, &l);
        json_object(out, NULL);
        json_text(out, "title", l.title);
        json_text(out, "author", l.author);
        json_text(out, "date", l.date);
        json_text(out, "description", l.description);
        json_colour(out, "colour", l.colour);
        json_uint(out, "opacity", l.opacity);
        json_bool(out, "visible", l.visible);
        json_uint(out, "stroke_count", c[i].strokes);
        json_uint(out, "point_count", c[i].points);
        json_uint(out, "note_count", c[i].notes);
        json_end(out);
    }
    json_end(out);
}

static void json_point(json *out, const ebpo_paint_point *q)
{
    json_uint(out, "face", q->face);
    json_array(out, "weights");
    json_uint(out, NULL, q->weight[0]);
    json_uint(out, NULL, q->weight[1]);
    json_end(out);
    json_reals(out, "place", q->place, 3);
}

static void json_notes(const paint_job *j, const ebpo_paint_info *info, json *out)
{
    json_array(out, "notes");
    for (uint64_t i = 0; i < info->note_count; i++) {
        ebpo_paint_note n = EBPO_PAINT_NOTE_INIT;
        ebpo_paint_get_note(j->paint, i, &n);
        json_object(out, NULL);
        json_text(out, "title", n.title);
        json_text(out, "author", n.author);
        json_text(out, "date", n.date);
        json_text(out, "body", n.body);
        json_uint(out, "layer", n.layer);
        json_point(out, &n.at);
        json_end(out);
    }
    json_end(out);
}

static void json_points(json *out, const ebpo_paint_stroke *s)
{
    json_array(out, "points");
    for (uint64_t i = 0; i < s->point_count; i++) {
        const ebpo_paint_point *q = &s->points[i];
        json_object(out, NULL);
        json_point(out, q);
        json_uint(out, "size", q->size);
        json_uint(out, "pressure", q->pressure);
        json_uint(out, "time", q->time);
        json_end(out);
    }
    json_end(out);
}

static void json_strokes(const paint_job *j, const ebpo_paint_info *info, json *out)
{
    json_array(out, "strokes");
    for (uint64_t i = 0; i < info->stroke_count; i++) {
        ebpo_paint_stroke s = EBPO_PAINT_STROKE_INIT;
        ebpo_paint_get_stroke(j->paint, i, &s);
        json_object(out, NULL);
        json_uint(out, "layer", s.layer);
        json_text(out, "kind", s.kind == EBPO_PAINT_ERASES ? "erases" : "paints");
        json_colour(out, "colour", s.colour);
        json_real(out, "radius", s.radius);
        json_uint(out, "time", s.time);
        json_uint(out, "point_count", s.point_count);
        if (j->v->points)
            json_points(out, &s);
        json_end(out);
    }
    json_end(out);
}

static void json_area(json *out, const char *key, const ebpo_paint_area *a)
{
    if (key)
        json_object(out, key);
    json_real(out, "area", a->value);
    json_real(out, "lo", a->lo);
    json_real(out, "hi", a->hi);
    if (key)
        json_end(out);
}

static void json_areas(const paint_job *j, const ebpo_paint_info *info, json *out)
{
    const ebpo_paint_areas *a = &j->areas;
    json_object(out, "areas");
    json_area(out, "all", &a->all);
    json_array(out, "layers");
    for (uint64_t i = 0; i < info->layer_count; i++) {
        json_object(out, NULL);
        json_area(out, NULL, &a->layers[i]);
        json_end(out);
    }
    json_end(out);
    json_array(out, "colours");
    for (uint64_t i = 0; i < a->colour_count; i++) {
        json_object(out, NULL);
        json_uint(out, "layer", a->colours[i].layer);
        json_colour(out, "colour", a->colours[i].colour);
        json_area(out, NULL, &a->colours[i].area);
        json_end(out);
    }
    json_end(out);
    json_array(out, "strokes");
    for (uint64_t i = 0; i < info->stroke_count && j->v->strokes; i++) {
        json_object(out, NULL);
        json_area(out, NULL, &a->strokes[i]);
        json_end(out);
    }
    json_end(out);
    json_uint(out, "faces", a->faces);
    json_uint(out, "points_outside_subset", a->points_outside_subset);
    json_end(out);
}

static void json_changes(const paint_job *j, json *out)
{
    if (j->v->path) {
        json_object(out, "drawn");
        json_uint(out, "strokes", j->drawn.strokes);
        json_uint(out, "points", j->drawn.points);
        json_uint(out, "steps", j->drawn.steps);
        json_uint(out, "lifted", j->drawn.lifted);
        json_uint(out, "strayed", j->drawn.strayed);
        json_end(out);
    }
    if (j->v->bake) {
        json_object(out, "baked");
        json_text(out, "output", j->v->bake);
        json_uint(out, "vertices", j->baked.vertices);
        json_uint(out, "points", j->baked.points);
        json_uint(out, "points_outside_subset", j->baked.points_outside_subset);
        json_uint(out, "points_without_vertex", j->baked.points_without_vertex);
        json_bool(out, "own_colours", j->has_own_colours);
        json_end(out);
    }
}

static void json_all(const paint_job *j, const ebpo_paint_info *info, const counts *c)
{
    json out;
    json_begin(&out, stdout);
    json_object(&out, NULL);
    json_text(&out, "file", j->changed && j->v->out ? j->v->out : j->paint_path);
    json_text(&out, "generator", info->generator);
    json_text(&out, "model_sha256", info->model_sha256);
    json_text(&out, "model_name", info->model_name);
    json_text(&out, "unit", info->unit);
    json_text(&out, "face_numbers", info->source_numbers ? "source" : "file");
    json_uint(&out, "stroke_count", info->stroke_count);
    json_uint(&out, "point_count", info->point_count);
    json_layers(j, info, c, &out);
    json_notes(j, info, &out);
    if (j->v->strokes || j->v->points)
        json_strokes(j, info, &out);
    json_changes(j, &out);
    if (j->v->area)
        json_areas(j, info, &out);
    json_finish(&out);
}

void paint_report(const paint_job *j)
{
    ebpo_paint_info info = EBPO_PAINT_INFO_INIT;
    ebpo_paint_get_info(j->paint, &info);
    counts *c = count_layers(j->paint, &info);
    if (!c)
        fputs("ebpo paint: not enough memory for the list\n", stderr);
    else if (j->v->json)
        json_all(j, &info, c);
    else if (!j->v->quiet)
        print_all(j, &info, c);
    free(c);
}
