/* Which pairs of instances are asked about, and how far apart they shall be. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "extras/scene/scene_parts.h"

static int compare_rules(const void *a, const void *b)
{
    const scene_rule *x = a, *y = b;
    if (x->a != y->a)
        return x->a < y->a ? -1 : 1;
    return (x->b > y->b) - (x->b < y->b);
}

static int compare_sets(const void *a, const void *b)
{
    const uint64_t *x = a, *y = b;
    return (*x > *y) - (*x < *y);
}

/* Ascending, each once. */
static void sort_sets(scene_instance *i)
{
    uint32_t kept = 0;
    if (i->set_count)
        qsort(i->sets, i->set_count, sizeof *i->sets, compare_sets);
    for (uint32_t k = 0; k < i->set_count; k++)
        if (!kept || i->sets[kept - 1] != i->sets[k])
            i->sets[kept++] = i->sets[k];
    i->set_count = kept;
}

/* One rule for a pair of sets: ignored if any line says so, else the greatest clearance. */
void scene_sort_rules(ebpo_scene *scene)
{
    uint64_t kept = 0;
    if (scene->rules_count)
        qsort(scene->rules, scene->rules_count, sizeof *scene->rules, compare_rules);
    for (uint64_t i = 0; i < scene->rules_count; i++) {
        scene_rule rule = scene->rules[i];
        scene_rule *last = kept ? &scene->rules[kept - 1] : NULL;
        if (last && last->a == rule.a && last->b == rule.b)
            last->clearance = last->clearance < 0 || rule.clearance < 0
                                  ? -1
                                  : fmax(last->clearance, rule.clearance);
        else
            scene->rules[kept++] = rule;
    }
    scene->rules_count = kept;
    for (uint64_t i = 0; i < scene->instances_count; i++)
        sort_sets(&scene->instances[i]);
}

/* Of two sets: below 0 ignored, 0 also where there is no rule. */
static double rule_of(const ebpo_scene *scene, uint64_t a, uint64_t b)
{
    scene_rule wanted = { a < b ? a : b, a < b ? b : a, 0 };
    const scene_rule *rule =
        bsearch(&wanted, scene->rules, scene->rules_count, sizeof *scene->rules, compare_rules);
    return rule ? rule->clearance : 0;
}

/* What is said of a pair so far; false: it is ignored. */
static bool take_rule(double rule, double *clearance)
{
    *clearance = fmax(*clearance, rule);
    return rule >= 0;
}

static bool by_sets(const ebpo_scene *scene, const scene_instance *x, const scene_instance *y,
                    double *clearance)
{
    for (uint32_t i = 0; i < x->set_count; i++)
        for (uint32_t k = 0; k < y->set_count; k++)
            if (!take_rule(rule_of(scene, x->sets[i], y->sets[k]), clearance))
                return false;
    return true;
}

static bool is_in(const scene_instance *i, uint64_t set)
{
    return bsearch(&set, i->sets, i->set_count, sizeof set, compare_sets) != NULL;
}

static bool by_rules(const ebpo_scene *scene, const scene_instance *x, const scene_instance *y,
                     double *clearance)
{
    for (uint64_t i = 0; i < scene->rules_count; i++) {
        const scene_rule *r = &scene->rules[i];
        if (((is_in(x, r->a) && is_in(y, r->b)) || (is_in(x, r->b) && is_in(y, r->a))) &&
            !take_rule(r->clearance, clearance))
            return false;
    }
    return true;
}

bool ebpo_scene_pair_rule(const ebpo_scene *scene, uint64_t a, uint64_t b, double *clearance)
{
    *clearance = 0;
    if (a == b || a >= scene->instances_count || b >= scene->instances_count)
        return false;
    const scene_instance *x = &scene->instances[a], *y = &scene->instances[b];
    if (x->as.fixed && y->as.fixed)
        return false;
    /* each group with each of the other would take hours where both have 100,000 */
    bool few = scene->rules_count < (uint64_t)x->set_count * y->set_count;
    return (few ? by_rules : by_sets)(scene, x, y, clearance);
}
