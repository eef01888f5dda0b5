#include "cli/commands/clash_list.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

const char *clash_kind_word(int32_t kind)
{
    static const char *const words[] = { "none",     "near",       "touching", "coplanar",
                                         "crossing", "protruding", "enclosed", "duplicate" };
    return words[kind];
}

/* Of the worst the most. */
static int rank_of(const ebpo_scene_meeting *m)
{
    static const int ranks[] = { 0, 1, 2, 3, 4, 6, 5, 7 }; /* by ebpo_meeting_kind */
    return ranks[m->kind];
}

double clash_depth(const ebpo_scene_meeting *m)
{
    double a = m->depth[0].hi < INFINITY ? m->depth[0].lo : 0;
    double b = m->depth[1].hi < INFINITY ? m->depth[1].lo : 0;
    return fmax(a, b);
}

/* Below 0: the first is worse. */
static int compare(const ebpo_scene_meeting *m, const ebpo_scene_meeting *n)
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
    const ebpo_scene_meeting *m = &((const clash *)p)->worst, *n = &((const clash *)q)->worst;
    return m->a != n->a ? (m->a < n->a ? -1 : 1) : m->b != n->b ? (m->b < n->b ? -1 : 1) : 0;
}

static int compare_clashes(const void *p, const void *q)
{
    int order = compare(&((const clash *)p)->worst, &((const clash *)q)->worst);
    return order ? order : compare_pairs(p, q);
}

static bool make_room(clash_list *list, uint64_t more)
{
    if (list->count + more <= list->capacity)
        return true;
    uint64_t capacity = 2 * (list->count + more);
    clash *room = realloc(list->clash, capacity * sizeof *room);
    if (!room)
        return false;
    list->clash = room;
    list->capacity = capacity;
    return true;
}

static void note_again(clash *c, double time, const ebpo_scene_meeting *m)
{
    c->frames++;
    c->last = time;
    if (compare(m, &c->worst) < 0) {
        c->worst = *m;
        c->time = time;
    }
}

/* Both are in the order of pairs. */
ebpo_status clash_add(clash_list *list, double time, const ebpo_scene_meeting *meetings,
                      uint64_t count, ebpo_error *error)
{
    uint64_t known = list->count, at = 0;
    if (!make_room(list, count)) {
        snprintf(error->message, sizeof error->message, "no memory for %llu clashes",
                 (unsigned long long)(known + count));
        return error->status = EBPO_E_MEMORY;
    }
    for (uint64_t i = 0; i < count; i++) {
        clash one = { meetings[i], time, time, time, 1, NULL };
        while (at < known && compare_pairs(&list->clash[at], &one) < 0)
            at++;
        if (at < known && compare_pairs(&list->clash[at], &one) == 0)
            note_again(&list->clash[at], time, &meetings[i]);
        else
            list->clash[list->count++] = one;
    }
    if (list->count)
        qsort(list->clash, list->count, sizeof *list->clash, compare_pairs);
    return EBPO_OK;
}

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
