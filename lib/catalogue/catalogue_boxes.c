/* Finds the boxes that contain a point, that may be near a point, or that a ray may intersect.
 *
 * The boxes are the leaves of a tree, ordered along the Morton curve of their centres. Every eight
 * consecutive boxes have a common box on the next higher level, which contains them. The only box
 * of the highest level contains all boxes. A query begins with the highest level and skips boxes
 * that are not relevant. The tree is immutable, so any number of threads may query it.
 *
 * No relevant box is skipped, in spite of rounding. A length is rounded some ten times in this
 * file, each time by at most 2^-53 of its value. A box is skipped only if its distance exceeds the
 * limit by more than 2^-40 of this distance. So a query may return boxes that are not relevant;
 * later queries of the models in such boxes return no face. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "catalogue/catalogue_boxes.h"
#include "core/alloc.h"

/* FAN: number of boxes that have a common box on the next level. BITS: number of bits of a Morton
 * code for each axis. */
enum { FAN = 8, BITS = 21, LEVELS = EBPO_CATALOGUE_LEVELS };

/* --- order --- */

typedef struct coded {
    uint64_t code;   /* Morton code of a point */
    uint32_t number; /* index of the point */
} coded;

static int by_code(const void *a, const void *b)
{
    const coded *x = a, *y = b;
    return x->code != y->code ? (x->code < y->code ? -1 : 1)
                              : (x->number > y->number) - (x->number < y->number);
}

/* Returns the Morton code of a point in the box from `min` to `max`. */
static uint64_t code_of(const double p[3], const double min[3], const double max[3])
{
    uint64_t code = 0;
    for (int k = 0; k < 3; k++) {
        double size = max[k] / 2 - min[k] / 2,
               share = size > 0 ? (p[k] / 2 - min[k] / 2) / size : 0;
        uint32_t step = (uint32_t)(fmin(fmax(share, 0), 1) * ((1 << BITS) - 1));
        for (int bit = 0; bit < BITS; bit++)
            code |= (uint64_t)(step >> bit & 1) << (3 * bit + k);
    }
    return code;
}

bool ebpo_catalogue_morton_order(const double *points, size_t count, const double min[3],
                                 const double max[3], uint32_t *numbers)
{
    coded *all = ebpo_alloc(count, sizeof *all);
    for (size_t i = 0; all && i < count; i++)
        all[i] = (coded){ code_of(points + 3 * i, min, max), (uint32_t)i };
    if (all)
        qsort(all, count, sizeof *all, by_code);
    for (size_t i = 0; all && i < count; i++)
        numbers[i] = all[i].number;
    free(all);
    return all != NULL;
}

/* --- the tree --- */

static ebpo_catalogue_box box_around(const ebpo_catalogue_box *boxes, size_t count)
{
    ebpo_catalogue_box all = boxes[0];
    for (size_t i = 1; i < count; i++)
        for (int k = 0; k < 3; k++) {
            all.min[k] = fmin(all.min[k], boxes[i].min[k]);
            all.max[k] = fmax(all.max[k], boxes[i].max[k]);
        }
    return all;
}

/* Makes level 0: the boxes, sorted along the Morton curve of their centres. */
static bool make_lowest(ebpo_catalogue_boxes *t, const ebpo_catalogue_box *boxes,
                        const uint32_t *numbers, size_t count)
{
    ebpo_catalogue_box all = box_around(boxes, count);
    double(*centre)[3] = ebpo_alloc(count, sizeof *centre);
    uint32_t *order = ebpo_alloc(count, sizeof *order);
    t->number = ebpo_alloc(count, sizeof *t->number);
    t->box[0] = ebpo_alloc(count, sizeof *t->box[0]);
    bool good = centre && order && t->number && t->box[0];
    for (size_t i = 0; good && i < count; i++)
        for (int k = 0; k < 3; k++)
            centre[i][k] = boxes[i].min[k] / 2 + boxes[i].max[k] / 2;
    good = good && ebpo_catalogue_morton_order(centre[0], count, all.min, all.max, order);
    for (size_t i = 0; good && i < count; i++) {
        t->number[i] = numbers[order[i]];
        t->box[0][i] = boxes[order[i]];
    }
    free(centre);
    free(order);
    return good;
}

bool ebpo_catalogue_boxes_make(ebpo_catalogue_boxes *t, const ebpo_catalogue_box *boxes,
                               const uint32_t *numbers, size_t count)
{
    *t = (ebpo_catalogue_boxes){ .levels = 0 };
    if (!count)
        return true;
    if (!make_lowest(t, boxes, numbers, count))
        return false;
    t->count[0] = count;
    for (t->levels = 1; t->count[t->levels - 1] > 1; t->levels++) {
        size_t below = t->count[t->levels - 1], here = (below + FAN - 1) / FAN;
        ebpo_catalogue_box *box = t->box[t->levels] = ebpo_alloc(here, sizeof *box);
        if (!box)
            return false;
        for (size_t i = 0; i < here; i++)
            box[i] = box_around(t->box[t->levels - 1] + i * FAN,
                                i + 1 < here ? (size_t)FAN : below - i * FAN);
        t->count[t->levels] = here;
    }
    return true;
}

void ebpo_catalogue_boxes_free(ebpo_catalogue_boxes *t)
{
    free(t->number);
    for (int level = 0; level < LEVELS; level++)
        free(t->box[level]);
    *t = (ebpo_catalogue_boxes){ .levels = 0 };
}

/* --- visits of boxes --- */

typedef struct walk {
    const ebpo_catalogue_boxes *t; /* the tree of boxes */
    const double *p, *d;           /* the point, or the ray's origin and direction */
    double reach;                  /* nearest face: boxes at a larger distance are skipped */
    double pad;                    /* ray: margin around each box, larger than the rounding error */
    uint32_t item;                 /* index of the point or ray, which is stored in the pairs */
    ebpo_catalogue_pairs *out;     /* the pairs are appended here; NULL: only `reach` is computed */
    /* Returns false if the box and all boxes in it are to be skipped. Otherwise it may set
     * *min_distance. */
    bool (*keep)(struct walk *w, const ebpo_catalogue_box *box, double *min_distance);
    bool failed; /* true: out of memory */
} walk;

static void append_pair(walk *w, uint32_t box, double min_distance)
{
    ebpo_catalogue_pairs *o = w->out;
    if (!ebpo_grow(&o->pair, &o->capacity, o->count + 1, sizeof *o->pair)) {
        w->failed = true;
        return;
    }
    o->pair[o->count++] = (ebpo_catalogue_pair){ box, w->item, min_distance };
}

/* Visits a box and, recursively, the boxes in it. The depth of recursion is at most LEVELS. */
static void descend_boxes(walk *w, int level, size_t node) /* NOLINT(misc-no-recursion) */
{
    double min_distance = 0;
    if (w->failed || !w->keep(w, &w->t->box[level][node], &min_distance))
        return;
    if (level == 0) {
        if (w->out)
            append_pair(w, w->t->number[node], min_distance);
        return;
    }
    size_t end = (node + 1) * FAN;
    end = end < w->t->count[level - 1] ? end : w->t->count[level - 1];
    for (size_t child = node * FAN; child < end; child++)
        descend_boxes(w, level - 1, child);
}

/* Visits all boxes that w->keep accepts. Returns false when out of memory. */
static bool walk_boxes(walk *w)
{
    if (w->t->levels)
        descend_boxes(w, w->t->levels - 1, 0);
    return !w->failed;
}

/* --- points --- */

static bool holds_point(walk *w, const ebpo_catalogue_box *b, double *min_distance)
{
    (void)min_distance;
    for (int k = 0; k < 3; k++)
        if (!(b->min[k] <= w->p[k] && w->p[k] <= b->max[k]))
            return false;
    return true;
}

bool ebpo_catalogue_boxes_holding(const ebpo_catalogue_boxes *t, const double p[3], uint32_t item,
                                  ebpo_catalogue_pairs *out)
{
    walk w = { .t = t, .p = p, .item = item, .out = out, .keep = holds_point };
    return walk_boxes(&w);
}

/* Returns the length of a vector, also if the squares of its components overflow. */
static double vector_length(const double v[3]) { return hypot(hypot(v[0], v[1]), v[2]); }

/* Returns the distance of a point from the box; 0 within the box. */
static double min_length(const ebpo_catalogue_box *b, const double p[3])
{
    double v[3];
    for (int k = 0; k < 3; k++)
        v[k] = fmax(fmax(b->min[k] - p[k], p[k] - b->max[k]), 0);
    return vector_length(v);
}

/* Returns the distance of a point from the farthest corner of the box. */
static double max_length(const ebpo_catalogue_box *b, const double p[3])
{
    double v[3];
    for (int k = 0; k < 3; k++)
        v[k] = fmax(b->max[k] - p[k], p[k] - b->min[k]);
    return vector_length(v);
}

/* Returns true if the distance of a face in the box may be at most w->reach. */
static bool may_be_near(walk *w, const ebpo_catalogue_box *b, double *min_distance)
{
    *min_distance = min_length(b, w->p);
    return *min_distance * (1 - EBPO_CATALOGUE_SLACK) <= w->reach;
}

/* Does the same as may_be_near, and lowers w->reach to the distance of the box's farthest corner,
 * because the distance of the model in the box is at most this distance. */
static bool comes_nearer(walk *w, const ebpo_catalogue_box *b, double *min_distance)
{
    if (!may_be_near(w, b, min_distance))
        return false;
    w->reach = fmin(w->reach, max_length(b, w->p));
    return true;
}

bool ebpo_catalogue_boxes_near(const ebpo_catalogue_boxes *t, const double p[3],
                               double max_distance, uint32_t item, ebpo_catalogue_pairs *out)
{
    walk w = { .t = t, .p = p, .reach = max_distance, .item = item, .keep = comes_nearer };
    (void)walk_boxes(&w);
    w.out = out;
    w.keep = may_be_near;
    return walk_boxes(&w);
}

/* --- rays --- */

/* Returns true if the ray may intersect the box with its margin. */
static bool may_be_hit(walk *w, const ebpo_catalogue_box *b, double *min_distance)
{
    double near = -INFINITY, far = INFINITY;
    (void)min_distance;
    for (int k = 0; k < 3; k++) {
        double lower = b->min[k] - w->pad - w->p[k], upper = b->max[k] + w->pad - w->p[k];
        if (w->d[k] == 0) {
            if (lower > 0 || upper < 0)
                return false;
            continue;
        }
        double lower_t = lower / w->d[k], upper_t = upper / w->d[k];
        near = fmax(near, fmin(lower_t, upper_t));
        far = fmin(far, fmax(lower_t, upper_t));
    }
    return !(near > far + EBPO_CATALOGUE_SLACK * fabs(far)) && !(far < 0);
}

bool ebpo_catalogue_boxes_on_ray(const ebpo_catalogue_boxes *t, const double o[3],
                                 const double d[3], uint32_t item, ebpo_catalogue_pairs *out)
{
    walk w = { .t = t, .p = o, .d = d, .item = item, .out = out, .keep = may_be_hit };
    for (int k = 0; t->levels && k < 3; k++) {
        const ebpo_catalogue_box *all = t->box[t->levels - 1];
        w.pad = fmax(w.pad, fmax(fabs(all->min[k]), fabs(all->max[k])));
        w.pad = fmax(w.pad, fabs(o[k]));
    }
    w.pad *= 2 * EBPO_CATALOGUE_SLACK;
    return walk_boxes(&w);
}
