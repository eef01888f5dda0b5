/* Which pairs of instances are asked about, and how far apart they shall be. */
#include "geom/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "scene/scene_parts.h"

static int compare_rules(const void *a, const void *b)
{
    const scene_rule *x = a, *y = b;
    if (x->a != y->a)
        return x->a < y->a ? -1 : 1;
    return (x->b > y->b) - (x->b < y->b);
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
}

/* Of two sets: below 0 ignored, 0 also where there is no rule. */
static double rule_of(const ebpo_scene *scene, uint64_t a, uint64_t b)
{
    scene_rule wanted = { a < b ? a : b, a < b ? b : a, 0 };
    const scene_rule *rule =
        bsearch(&wanted, scene->rules, scene->rules_count, sizeof *scene->rules, compare_rules);
    return rule ? rule->clearance : 0;
}

bool ebpo_scene_pair_rule(const ebpo_scene *scene, uint64_t a, uint64_t b, double *clearance)
{
    *clearance = 0;
    if (a == b || a >= scene->instances_count || b >= scene->instances_count)
        return false;
    const scene_instance *x = &scene->instances[a], *y = &scene->instances[b];
    if (x->as.fixed && y->as.fixed)
        return false;
    if (!scene->rules_count)
        return true;
    for (uint32_t i = 0; i < x->set_count; i++)
        for (uint32_t k = 0; k < y->set_count; k++) {
            double rule = rule_of(scene, x->sets[i], y->sets[k]);
            if (rule < 0)
                return false;
            *clearance = fmax(*clearance, rule);
        }
    return true;
}
