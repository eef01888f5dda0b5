/* Writes the HTML page of `ebpo scene report`: clashes in a table with filters and pictures. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/commands/clash_list.h"
#include "cli/commands/clash_page.h"

/* --- names as HTML text --- */

/* Writes text between tags; escapes < and &. */
static void html_put_text(FILE *f, const char *text)
{
    for (; *text; text++) {
        if (*text == '<')
            fputs("&lt;", f);
        else if (*text == '&')
            fputs("&amp;", f);
        else
            fputc(*text, f);
    }
}

const char *clash_kind_word(int32_t kind)
{
    static const char *const words[] = { "none",     "near",       "touching", "coplanar",
                                         "crossing", "protruding", "enclosed", "duplicate" };
    return words[kind];
}

/* Returns the severity of the clash. It depends on the kind only; a worse kind has a greater
 * severity. */
static int rank_of(const ebpo_scene_clash *m)
{
    static const int ranks[] = { 0, 1, 2, 3, 4, 6, 5, 7 }; /* the index is an ebpo_clash_kind */
    return ranks[m->kind];
}

/* Returns the lower bound of the penetration depth; 0: not known. */
static double clash_depth(const ebpo_scene_clash *m)
{
    double a = m->depth[0].hi < INFINITY ? m->depth[0].lo : 0;
    double b = m->depth[1].hi < INFINITY ? m->depth[1].lo : 0;
    return fmax(a, b);
}

/* Returns a negative number if the first clash is worse than the second, a positive number if the
 * second is worse, or 0. */
static int order_clashes(const ebpo_scene_clash *m, const ebpo_scene_clash *n)
{
    if (rank_of(m) != rank_of(n))
        return rank_of(n) - rank_of(m);
    if (clash_depth(m) != clash_depth(n))
        return clash_depth(m) > clash_depth(n) ? -1 : 1;
    if (m->distance != n->distance)
        return m->distance < n->distance ? -1 : 1;
    return 0;
}

static int compare_pairs(const void *p, const void *q)
{
    const ebpo_scene_clash *m = &((const clash *)p)->worst, *n = &((const clash *)q)->worst;
    return m->a != n->a ? (m->a < n->a ? -1 : 1) : m->b != n->b ? (m->b < n->b ? -1 : 1) : 0;
}

static int compare_clashes(const void *p, const void *q)
{
    int order = order_clashes(&((const clash *)p)->worst, &((const clash *)q)->worst);
    return order ? order : compare_pairs(p, q);
}

static bool reserve_space(clash_list *list, uint64_t more)
{
    if (list->count + more <= list->capacity)
        return true;
    uint64_t capacity = 2 * (list->count + more);
    clash *space = realloc(list->clash, capacity * sizeof *space);
    if (!space)
        return false;
    list->clash = space;
    list->capacity = capacity;
    return true;
}

static void add_frame(clash *c, double time, const ebpo_scene_clash *m)
{
    c->frames++;
    c->last = time;
    if (order_clashes(m, &c->worst) < 0) {
        c->worst = *m;
        c->time = time;
    }
}

/* Merges clashes into the list. The list and found_clashes are sorted by pairs of instances. */
ebpo_status clash_add(clash_list *list, double time, const ebpo_scene_clash *found_clashes,
                      uint64_t count, ebpo_error *error)
{
    uint64_t known = list->count, at = 0;
    if (!reserve_space(list, count)) {
        snprintf(error->message, sizeof error->message, "no memory for %llu clashes",
                 (unsigned long long)(known + count));
        return error->status = EBPO_E_MEMORY;
    }
    for (uint64_t i = 0; i < count; i++) {
        clash one = { found_clashes[i], time, time, time, 1, NULL };
        while (at < known && compare_pairs(&list->clash[at], &one) < 0)
            at++;
        if (at < known && compare_pairs(&list->clash[at], &one) == 0)
            add_frame(&list->clash[at], time, &found_clashes[i]);
        else
            list->clash[list->count++] = one;
    }
    if (list->count)
        qsort(list->clash, list->count, sizeof *list->clash, compare_pairs);
    return EBPO_OK;
}

/* --- list of clashes --- */

void clash_sort(clash_list *list)
{
    if (list->count)
        qsort(list->clash, list->count, sizeof *list->clash, compare_clashes);
}

void clash_free(clash_list *list)
{
    for (uint64_t i = 0; i < list->count; i++)
        free(list->clash[i].picture);
    free(list->clash);
    *list = (clash_list){ 0 };
}

/* --- buttons ---
 *
 * A click on the button of a group shows only rows with an instance of this group. Buttons are
 * radio inputs, and style rules hide rows, so that the page needs no scripts. */

/* Returns the nth group of the two instances: first the groups of `a`, then those of `b`. Returns
 * EBPO_SCENE_NONE after the last group. */
static uint64_t group_of(const clash *c, const ebpo_scene *scene, uint64_t nth)
{
    uint64_t of_a = 0;
    while (of_a <= nth && ebpo_scene_group_of(scene, c->worst.a, of_a) != EBPO_SCENE_NONE)
        of_a++;
    return nth < of_a ? ebpo_scene_group_of(scene, c->worst.a, nth)
                      : ebpo_scene_group_of(scene, c->worst.b, nth - of_a);
}

/* Returns false if the nth group occurs earlier among the groups of the two instances. */
static bool is_first_group(const clash *c, const ebpo_scene *scene, uint64_t nth)
{
    uint64_t group = group_of(c, scene, nth);
    for (uint64_t i = 0; i < nth; i++)
        if (group_of(c, scene, i) == group)
            return false;
    return true;
}

/* Adds the number of clashes of group i to sums[i]. */
static void count_clashes(const clash_list *list, const ebpo_scene *scene, uint64_t *sums)
{
    for (uint64_t i = 0; i < list->count; i++)
        for (uint64_t n = 0; group_of(&list->clash[i], scene, n) != EBPO_SCENE_NONE; n++)
            sums[group_of(&list->clash[i], scene, n)] += is_first_group(&list->clash[i], scene, n);
}

static void put_button(FILE *f, uint64_t number, uint64_t clashes, const char *name)
{
    fprintf(f, "<input type=radio name=g id=g%llu><label for=g%llu>", (unsigned long long)number,
            (unsigned long long)number);
    html_put_text(f, name);
    fprintf(f, " (%llu)</label>\n", (unsigned long long)clashes);
}

static void put_buttons(FILE *f, const uint64_t *sums, uint64_t groups, const clash_list *list,
                        const ebpo_scene *scene)
{
    fputs("<style>", f);
    for (uint64_t i = 0; i < groups; i++)
        if (sums[i])
            fprintf(f, "#g%llu:checked~.c tr:not(.g%llu):not(.h){display:none}",
                    (unsigned long long)i, (unsigned long long)i);
    fprintf(f,
            "</style>\n<p>Of the group:</p>\n<input type=radio name=g id=all checked>"
            "<label for=all>all (%llu)</label>\n",
            (unsigned long long)list->count);
    for (uint64_t i = 0; i < groups; i++)
        if (sums[i])
            put_button(f, i, sums[i], ebpo_scene_get_group(scene, i));
}

/* Writes a button for each group that has clashes. The caller must then write a table of class `c`,
 * in which the buttons hide rows. Returns false if there is not enough memory. */
static bool put_filter(FILE *f, const clash_list *list, const ebpo_scene *scene)
{
    ebpo_scene_counts c = EBPO_SCENE_COUNTS_INIT;
    (void)ebpo_scene_get_counts(scene, &c);
    uint64_t *sums = calloc(c.groups ? c.groups : 1, sizeof *sums), any = 0;
    if (!sums)
        return false;
    count_clashes(list, scene, sums);
    for (uint64_t i = 0; i < c.groups; i++)
        any += sums[i] > 0;
    if (any)
        put_buttons(f, sums, c.groups, list, scene);
    free(sums);
    return true;
}

/* Writes the class attribute of a row, inside <tr>: "gN" for each group N of the clash's instances.
 */
static void put_classes(FILE *f, const clash *c, const ebpo_scene *scene)
{
    bool any = false;
    for (uint64_t n = 0; group_of(c, scene, n) != EBPO_SCENE_NONE; n++) {
        if (!is_first_group(c, scene, n))
            continue;
        fprintf(f, "%sg%llu", any ? " " : " class=\"", (unsigned long long)group_of(c, scene, n));
        any = true;
    }
    if (any)
        fputc('"', f);
}

static const char style[] =
    "body{font:15px/1.45 system-ui,sans-serif;color:#222;max-width:78em;margin:2em auto;"
    "padding:0 1em}h1{font-size:1.5em}table{border-collapse:collapse;width:100%}"
    "th,td{text-align:left;vertical-align:top;padding:.45em .7em;border-bottom:1px solid #d8dde3}"
    "th{color:#556;font-weight:600}td.n{font-variant-numeric:tabular-nums;white-space:nowrap}"
    "img{width:240px;height:180px;display:block;border-radius:4px}.k{font-weight:600}"
    ".protruding,.duplicate,.enclosed{color:#b00d0d}.crossing{color:#b4530a}.near{color:#665500}"
    "input{margin:0 .3em 0 0}label{margin-right:1em}.q{color:#667;font-size:.9em}@media "
    "print{tr{break-inside:avoid}}";

/* Explanations of each ebpo_clash_kind. */
static const char *const meanings[] = {
    "",
    "closer than the clearance",
    "faces touch, without penetration",
    "faces overlap in one plane",
    "surfaces intersect",
    "one part penetrates the other",
    "one part is completely within the other",
    "the same part twice in one place",
};
enum { KINDS = sizeof meanings / sizeof *meanings };

/* --- the head --- */

static void put_kinds(FILE *f, const clash_list *list)
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
    fprintf(f, "</h1>\n<p>%llu %s of parts", (unsigned long long)list->count,
            list->count == 1 ? "pair" : "pairs");
    if (frames > 1)
        fprintf(f,
                ", evaluated at %llu times from %.9g to %.9g; times in between are not "
                "evaluated",
                (unsigned long long)frames, from, to);
    else
        fprintf(f, ", at time %.9g", from);
    fputs(". Lengths and positions are in the unit of the scene. The decisions are exact. In "
          "pictures A is brown, B is blue, intersecting faces are red; of a part that encloses "
          "another only the far side is drawn.</p>\n",
          f);
}

/* --- rows --- */

static void put_instance(FILE *f, const ebpo_scene *scene, const char *letter, uint64_t instance)
{
    ebpo_scene_instance at = EBPO_SCENE_INSTANCE_INIT;
    ebpo_scene_model_facts model = EBPO_SCENE_MODEL_FACTS_INIT;
    (void)ebpo_scene_get_instance(scene, instance, &at);
    (void)ebpo_scene_get_model_facts(scene, at.model, &model);
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

static void put_depth(FILE *f, const char *what, const ebpo_value_bounds *depth)
{
    if (depth->hi < INFINITY && depth->hi > 0)
        fprintf(f, "%s %.4g to %.4g deep<br>", what, depth->lo, depth->hi);
}

static void put_measure(FILE *f, const ebpo_scene_clash *m)
{
    if (m->kind == EBPO_CLASH_NEAR)
        fprintf(f, "%.4g apart, required %.4g", m->distance, m->clearance);
    if (m->kind == EBPO_CLASH_ENCLOSED)
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
    const ebpo_scene_clash *m = &c->worst;
    fputs("<tr", f);
    put_classes(f, c, scene);
    fprintf(f, "><td class=n>%llu<td>", (unsigned long long)number);
    if (c->picture)
        fprintf(f, "<img alt=\"clash %llu\" src=\"%s\">", (unsigned long long)number, c->picture);
    fputs("<td>", f);
    put_instance(f, scene, "A", m->a);
    put_instance(f, scene, "B", m->b);
    fprintf(f, "<td><span class=\"k %s\">%s</span><div class=q>%s</div><td class=n>",
            clash_kind_word(m->kind), clash_kind_word(m->kind), meanings[m->kind]);
    put_measure(f, m);
    fputs("<td class=n>", f);
    if (isfinite(m->location[0]))
        fprintf(f, "x %.6g<br>y %.6g<br>z %.6g", m->location[0], m->location[1], m->location[2]);
    if (frames > 1)
        fprintf(f, "<td class=n>from %.6g<br>to %.6g<br>worst %.6g", c->first, c->last, c->time);
    fputc('\n', f);
}

/* Returns false if there is not enough memory. */
static bool put_page(FILE *f, const clash_list *list, const ebpo_scene *scene, const char *title,
                     double from, double to, uint64_t frames)
{
    put_head(f, list, title, from, to, frames);
    put_kinds(f, list);
    fputs("<h2>The worst first</h2>\n", f);
    bool complete = put_filter(f, list, scene);
    fprintf(f,
            "<table class=c><tr class=h><th>#<th>Picture<th>Parts<th>Kind<th>How much"
            "<th>Where%s\n",
            frames > 1 ? "<th>When" : "");
    for (uint64_t i = 0; i < list->count; i++)
        put_row(f, scene, &list->clash[i], i + 1, frames);
    fputs("</table>\n</html>\n", f);
    return complete;
}

ebpo_status clash_page(const clash_list *list, const ebpo_scene *scene, const char *title,
                       double from, double to, uint64_t frames, const char *path, ebpo_error *error)
{
    char *text = NULL;
    size_t size = 0;
    FILE *f = open_memstream(&text, &size);
    bool complete = f && put_page(f, list, scene, title, from, to, frames);
    ebpo_status status = EBPO_OK;
    if ((f && fclose(f) != 0) || !complete) {
        snprintf(error->message, sizeof error->message, "%s: no memory for the page", path);
        status = error->status = EBPO_E_MEMORY;
    }
    if (status == EBPO_OK)
        status = ebpo_write_file(path, text, size, error);
    free(text);
    return status;
}
