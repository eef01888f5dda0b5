#include "cli/commands/clash_page.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/commands/clash_groups.h"
#include "cli/commands/html_text.h"

static const char style[] =
    "body{font:15px/1.45 system-ui,sans-serif;color:#222;max-width:78em;margin:2em auto;"
    "padding:0 1em}h1{font-size:1.5em}table{border-collapse:collapse;width:100%}"
    "th,td{text-align:left;vertical-align:top;padding:.45em .7em;border-bottom:1px solid #d8dde3}"
    "th{color:#556;font-weight:600}td.n{font-variant-numeric:tabular-nums;white-space:nowrap}"
    "img{width:240px;height:180px;display:block;border-radius:4px}.k{font-weight:600}"
    ".protruding,.duplicate,.enclosed{color:#b00d0d}.crossing{color:#b4530a}.near{color:#665500}"
    "input{margin:0 .3em 0 0}label{margin-right:1em}.q{color:#667;font-size:.9em}@media "
    "print{tr{break-inside:avoid}}";

/* What an ebpo_meeting_kind means on a site. */
static const char *const meanings[] = {
    "",
    "closer than the clearance",
    "faces touch, nothing enters",
    "faces lie on each other",
    "surfaces cut each other",
    "one runs into the other",
    "one is wholly within the other",
    "the same part twice in one place",
};
enum { KINDS = sizeof meanings / sizeof *meanings };

/* --- the head --- */

static void put_sums(FILE *f, const clash_list *list)
{
    uint64_t sums[KINDS] = { 0 };
    for (uint64_t i = 0; i < list->count; i++)
        sums[list->clash[i].worst.kind]++;
    fputs("<table><tr><th>Kind<th>Pairs<th>Meaning\n", f);
    for (int k = KINDS - 1; k > 0; k--)
        if (sums[k])
            fprintf(f, "<tr><td class=\"k %s\">%s<td class=n>%llu<td>%s\n", clash_kind_word(k),
                    clash_kind_word(k), (unsigned long long)sums[k], meanings[k]);
    fputs("</table>\n", f);
}

static void put_head(FILE *f, const clash_list *list, const char *title, double from, double to,
                     uint64_t frames)
{
    fputs("<!DOCTYPE html>\n<html lang=en><meta charset=utf-8>\n<title>Clashes: ", f);
    html_put_text(f, title);
    fprintf(f, "</title>\n<style>%s</style>\n<h1>Clashes in ", style);
    html_put_text(f, title);
    fprintf(f, "</h1>\n<p>%llu pairs of parts", (unsigned long long)list->count);
    if (frames > 1)
        fprintf(f, ", looked at %llu times from %.9g to %.9g; between these times nothing is said",
                (unsigned long long)frames, from, to);
    else
        fprintf(f, ", at time %.9g", from);
    fputs(". Lengths and places are in the scene's unit. The decisions are exact. In pictures A is "
          "brown, B is blue, faces that meet are red; of a part that encloses another only the "
          "far side is drawn.</p>\n",
          f);
}

/* --- rows --- */

static void put_part(FILE *f, const ebpo_scene *scene, const char *letter, uint64_t instance)
{
    ebpo_scene_instance at = EBPO_SCENE_INSTANCE_INIT;
    ebpo_scene_model_facts model = EBPO_SCENE_MODEL_FACTS_INIT;
    (void)ebpo_scene_get_instance(scene, instance, &at);
    (void)ebpo_scene_get_model(scene, at.model, &model);
    const char *layer = ebpo_scene_get_layer(scene, at.layer);
    fprintf(f, "%s <b>", letter);
    html_put_text(f, at.name);
    fputs("</b><div class=q>", f);
    html_put_text(f, model.name);
    if (layer) {
        fputs(", layer ", f);
        html_put_text(f, layer);
    }
    const char *before = ", of ";
    for (uint64_t n = 0, g; (g = ebpo_scene_group_of(scene, instance, n)) != EBPO_SCENE_NONE; n++) {
        fputs(before, f);
        html_put_text(f, ebpo_scene_get_group(scene, g));
        before = ", ";
    }
    fputs("</div>", f);
}

static void put_depth(FILE *f, const char *what, const ebpo_certain *depth)
{
    if (depth->hi < INFINITY && depth->hi > 0)
        fprintf(f, "%s %.4g to %.4g deep<br>", what, depth->lo, depth->hi);
}

static void put_measure(FILE *f, const ebpo_scene_meeting *m)
{
    if (m->kind == EBPO_MEETING_NEAR)
        fprintf(f, "%.4g apart, wanted %.4g", m->distance, m->clearance);
    if (m->kind == EBPO_MEETING_ENCLOSED)
        fprintf(f, "%s is inside<br>", m->relation == EBPO_A_INSIDE_B ? "A" : "B");
    put_depth(f, "A in B", &m->depth[0]);
    put_depth(f, "B in A", &m->depth[1]);
    if (m->contacts && m->contacts < UINT64_MAX)
        fprintf(f, "%llu %s of contact", (unsigned long long)m->contacts,
                m->contacts == 1 ? "line" : "lines");
}

static void put_row(FILE *f, const ebpo_scene *scene, const clash *c, uint64_t number,
                    uint64_t frames)
{
    const ebpo_scene_meeting *m = &c->worst;
    fputs("<tr", f);
    clash_put_classes(f, c, scene);
    fprintf(f, "><td class=n>%llu<td>", (unsigned long long)number);
    if (c->picture)
        fprintf(f, "<img alt=\"clash %llu\" src=\"%s\">", (unsigned long long)number, c->picture);
    fputs("<td>", f);
    put_part(f, scene, "A", m->a);
    put_part(f, scene, "B", m->b);
    fprintf(f, "<td><span class=\"k %s\">%s</span><div class=q>%s</div><td class=n>",
            clash_kind_word(m->kind), clash_kind_word(m->kind), meanings[m->kind]);
    put_measure(f, m);
    fputs("<td class=n>", f);
    if (isfinite(m->place[0]))
        fprintf(f, "x %.6g<br>y %.6g<br>z %.6g", m->place[0], m->place[1], m->place[2]);
    if (frames > 1)
        fprintf(f, "<td class=n>from %.6g<br>to %.6g<br>worst %.6g", c->first, c->last, c->time);
    fputc('\n', f);
}

/* False: no memory. */
static bool put_page(FILE *f, const clash_list *list, const ebpo_scene *scene, const char *title,
                     double from, double to, uint64_t frames)
{
    put_head(f, list, title, from, to, frames);
    put_sums(f, list);
    fputs("<h2>The worst first</h2>\n", f);
    bool fine = clash_put_choice(f, list, scene);
    fprintf(f,
            "<table class=c><tr class=h><th>#<th>Picture<th>Parts<th>Kind<th>How much"
            "<th>Where%s\n",
            frames > 1 ? "<th>When" : "");
    for (uint64_t i = 0; i < list->count; i++)
        put_row(f, scene, &list->clash[i], i + 1, frames);
    fputs("</table>\n</html>\n", f);
    return fine;
}

ebpo_status clash_page(const clash_list *list, const ebpo_scene *scene, const char *title,
                       double from, double to, uint64_t frames, const char *path, ebpo_error *error)
{
    char *text = NULL;
    size_t size = 0;
    FILE *f = open_memstream(&text, &size);
    bool fine = f && put_page(f, list, scene, title, from, to, frames);
    ebpo_status status = EBPO_OK;
    if ((f && fclose(f) != 0) || !fine) {
        snprintf(error->message, sizeof error->message, "%s: no memory for the page", path);
        status = error->status = EBPO_E_MEMORY;
    }
    if (status == EBPO_OK)
        status = ebpo_write_file(path, text, size, error);
    free(text);
    return status;
}
