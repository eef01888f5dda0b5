#include "cli/commands/catalogue_models.h"

#include <stdlib.h>
#include <string.h>

ebpo_status catalogue_no_memory(ebpo_error *error)
{
    return catalogue_fail(error, EBPO_E_MEMORY, NULL, "not enough memory");
}

ebpo_status catalogue_need_surface(const catalogue_models *m, ebpo_error *error)
{
    return m->seen.levels ? EBPO_OK
                          : catalogue_fail(error, EBPO_E_ABSENT, m->c->path,
                                           "tells of caps alone, and of no surface; ask inside, or "
                                           "the catalogue of all parts");
}

/* --- the models --- */

static bool make_tree(catalogue_boxes *t, const catalogue *c, bool seen)
{
    closed_box *box = malloc(c->count * sizeof *box);
    uint32_t *number = malloc(c->count * sizeof *number);
    size_t count = 0;
    for (uint64_t i = 0; box && number && i < c->count; i++) {
        const catalogue_entry *e = &c->entry[i];
        if (seen && e->unseen)
            continue;
        memcpy(box[count].min, e->min, sizeof e->min);
        memcpy(box[count].max, e->max, sizeof e->max);
        number[count++] = (uint32_t)i;
    }
    bool fine = box && number && catalogue_boxes_make(t, box, number, count);
    free(box);
    free(number);
    return fine;
}

bool catalogue_models_make(catalogue_models *m, const catalogue *c, const holding_options *options)
{
    *m = (catalogue_models){ .c = c, .held = holding_new(c, options) };
    for (uint64_t i = 0; i < c->count && !m->surface; i++)
        m->surface = c->entry[i].solid ? NULL : &c->entry[i];
    return m->held && make_tree(&m->all, c, false) && make_tree(&m->seen, c, true);
}

void catalogue_models_free(catalogue_models *m)
{
    holding_free(m->held);
    catalogue_boxes_free(&m->all);
    catalogue_boxes_free(&m->seen);
    *m = (catalogue_models){ .c = NULL };
}

/* --- each model once --- */

static int by_model(const void *a, const void *b)
{
    const box_pair *x = a, *y = b;
    return x->box != y->box ? (x->box < y->box ? -1 : 1)
                            : (x->item > y->item) - (x->item < y->item);
}

/* Pairs of one model, of which there are the most. They are sorted. */
static size_t longest_run(const box_pairs *pairs)
{
    size_t longest = 0;
    for (size_t at = 0, begin = 0; at < pairs->count; at++) {
        if (pairs->pair[at].box != pairs->pair[begin].box)
            begin = at;
        longest = at + 1 - begin > longest ? at + 1 - begin : longest;
    }
    return longest;
}

ebpo_status catalogue_runs(catalogue_models *m, box_pairs *pairs, const double *rows, size_t width,
                           bool surface, holding_question ask, void *user, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    if (pairs->count)
        qsort(pairs->pair, pairs->count, sizeof *pairs->pair, by_model);
    double *some = malloc(longest_run(pairs) * width * sizeof *some + 1);
    if (!some)
        return catalogue_no_memory(error);
    for (size_t at = 0; at < pairs->count && status == EBPO_OK;) {
        const box_pair *pair = pairs->pair + at;
        model_run run = { .model = pair->box, .pair = pair, .rows = some, .user = user };
        for (; at < pairs->count && pairs->pair[at].box == run.model; at++, run.count++)
            memcpy(some + run.count * width, rows + pairs->pair[at].item * width,
                   width * sizeof *some);
        status = holding_ask(m->held, run.model, surface, ask, &run, error);
    }
    free(some);
    return status;
}
