/* Which of many boxes points and rays come to. Immutable once made, for any number of threads. */
#ifndef EBPO_CATALOGUE_CATALOGUE_BOXES_H
#define EBPO_CATALOGUE_CATALOGUE_BOXES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Eight times as many boxes on each: enough for 2^33. */
enum { EBPO_CATALOGUE_LEVELS = 12 };

/* Lengths are rounded some ten times; what is left out is farther than this share more. */
#define EBPO_CATALOGUE_SLACK 0x1p-40

/* A closed box. */
typedef struct ebpo_catalogue_box {
    double min[3], max[3];
} ebpo_catalogue_box;

typedef struct ebpo_catalogue_boxes {
    uint32_t *number; /* [count[0]] of the boxes, along the Morton curve of their centres */
    int levels;       /* 0: there is no box */
    size_t count[EBPO_CATALOGUE_LEVELS];
    /* level 0: the boxes; above: those around eight each */
    ebpo_catalogue_box *box[EBPO_CATALOGUE_LEVELS];
} ebpo_catalogue_boxes;

/* A box, and a point or ray that comes to it. */
typedef struct ebpo_catalogue_pair {
    uint32_t box, item;
    double least; /* ebpo_catalogue_boxes_near: how far away the box is at least */
} ebpo_catalogue_pair;

typedef struct ebpo_catalogue_pairs {
    ebpo_catalogue_pair *pair;
    uint64_t count, capacity;
} ebpo_catalogue_pairs;

/* boxes[count] with numbers[count], which name them in pairs. False: not enough memory;
 * ebpo_catalogue_boxes_free in any case. */
bool ebpo_catalogue_boxes_make(ebpo_catalogue_boxes *t, const ebpo_catalogue_box *boxes,
                               const uint32_t *numbers, size_t count);
void ebpo_catalogue_boxes_free(ebpo_catalogue_boxes *t);

/* Each appends pairs (box, item); false: not enough memory. Boxes that hold the point: */
bool ebpo_catalogue_boxes_holding(const ebpo_catalogue_boxes *t, const double p[3], uint32_t item,
                                  ebpo_catalogue_pairs *out);
/* All that may hold what is nearest to the point, and at most `most` away: */
bool ebpo_catalogue_boxes_near(const ebpo_catalogue_boxes *t, const double p[3], double most,
                               uint32_t item, ebpo_catalogue_pairs *out);
/* All that the ray from o along d may meet: */
bool ebpo_catalogue_boxes_on_ray(const ebpo_catalogue_boxes *t, const double o[3],
                                 const double d[3], uint32_t item, ebpo_catalogue_pairs *out);

/* Numbers from 0 of points[count][3] along the Morton curve of a box; those outside of it count as
 * on its sides. False: not enough memory. */
bool ebpo_catalogue_morton_order(const double *points, size_t count, const double min[3],
                                 const double max[3], uint32_t *numbers);

#endif
