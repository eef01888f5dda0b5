#include "cli/commands/clash_groups.h"

#include <stdlib.h>

#include "cli/commands/html_text.h"

/* Of both parts, the nth; EBPO_SCENE_NONE behind the last. */
static uint64_t group_of(const clash *c, const ebpo_scene *scene, uint64_t nth)
{
    uint64_t of_a = 0;
    while (of_a <= nth && ebpo_scene_group_of(scene, c->worst.a, of_a) != EBPO_SCENE_NONE)
        of_a++;
    return nth < of_a ? ebpo_scene_group_of(scene, c->worst.a, nth)
                      : ebpo_scene_group_of(scene, c->worst.b, nth - of_a);
}

static bool is_first(const clash *c, const ebpo_scene *scene, uint64_t nth)
{
    uint64_t group = group_of(c, scene, nth);
    for (uint64_t i = 0; i < nth; i++)
        if (group_of(c, scene, i) == group)
            return false;
    return true;
}

static void count_clashes(const clash_list *list, const ebpo_scene *scene, uint64_t *sums)
{
    for (uint64_t i = 0; i < list->count; i++)
        for (uint64_t n = 0; group_of(&list->clash[i], scene, n) != EBPO_SCENE_NONE; n++)
            sums[group_of(&list->clash[i], scene, n)] += is_first(&list->clash[i], scene, n);
}

static void put_button(FILE *f, uint64_t number, uint64_t clashes, const char *name)
{
    fprintf(f, "<input type=radio name=g id=g%llu><label for=g%llu>", (unsigned long long)number,
            (unsigned long long)number);
    html_put_text(f, name);
    fprintf(f, " (%llu)</label>\n", (unsigned long long)clashes);
}

static void put_choice(FILE *f, const uint64_t *sums, uint64_t groups, const clash_list *list,
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

bool clash_put_choice(FILE *f, const clash_list *list, const ebpo_scene *scene)
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
        put_choice(f, sums, c.groups, list, scene);
    free(sums);
    return true;
}

void clash_put_classes(FILE *f, const clash *c, const ebpo_scene *scene)
{
    bool any = false;
    for (uint64_t n = 0; group_of(c, scene, n) != EBPO_SCENE_NONE; n++) {
        if (!is_first(c, scene, n))
            continue;
        fprintf(f, "%sg%llu", any ? " " : " class=\"", (unsigned long long)group_of(c, scene, n));
        any = true;
    }
    if (any)
        fputc('"', f);
}
