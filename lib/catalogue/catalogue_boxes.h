/* Finds the boxes that contain a point, that may be near a point, or that a ray may intersect. The
 * tree of boxes is immutable, and any number of threads may use it. */
#ifndef EBPO_CATALOGUE_CATALOGUE_BOXES_H
#define EBPO_CATALOGUE_CATALOGUE_BOXES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Maximum number of levels. A level has eight times as many boxes as the next higher level, so 12
 * levels are sufficient for 2^33 boxes. */
enum { EBPO_CATALOGUE_LEVELS = 12 };

/* A box is skipped only if its distance exceeds the limit by more than this share of the distance,
 * because lengths are rounded some ten times. */
#define EBPO_CATALOGUE_SLACK 0x1p-40

/* A closed box. */
typedef struct ebpo_catalogue_box {
    double min[3], max[3];
} ebpo_catalogue_box;

typedef struct ebpo_catalogue_boxes {
    /* [count[0]] for each box of level 0, the number that identifies the box in pairs */
    uint32_t *number;
    int levels;                          /* number of levels; 0: there is no box */
    size_t count[EBPO_CATALOGUE_LEVELS]; /* number of boxes of each level */
    /* [level] boxes. Level 0: the given boxes, along the Morton curve of their centres; a box of a
     * higher level contains eight consecutive boxes of the next lower level */
    ebpo_catalogue_box *box[EBPO_CATALOGUE_LEVELS];
} ebpo_catalogue_boxes;

/* A box, and an item (a point or ray) for which it is relevant. */
typedef struct ebpo_catalogue_pair {
    /* box: the box's number (ebpo_catalogue_boxes.number); item: index of the point or ray */
    uint32_t box, item;
    double min_distance; /* rounded distance of the box; only ebpo_catalogue_boxes_near sets it */
} ebpo_catalogue_pair;

typedef struct ebpo_catalogue_pairs {
    ebpo_catalogue_pair *pair;
    uint64_t count, capacity;
} ebpo_catalogue_pairs;

/* Makes the tree of the boxes. `boxes`: [count]. `numbers`: [count] numbers that identify the boxes
 * in pairs. Returns false when out of memory. The caller must call ebpo_catalogue_boxes_free, also
 * on failure. */
bool ebpo_catalogue_boxes_make(ebpo_catalogue_boxes *t, const ebpo_catalogue_box *boxes,
                               const uint32_t *numbers, size_t count);
void ebpo_catalogue_boxes_free(ebpo_catalogue_boxes *t);

/* The functions ebpo_catalogue_boxes_holding, _near and _on_ray return false when out of memory. */

/* Appends a pair (box, item) for each box that contains the point. */
bool ebpo_catalogue_boxes_holding(const ebpo_catalogue_boxes *t, const double p[3], uint32_t item,
                                  ebpo_catalogue_pairs *out);
/* Appends pairs for all boxes that may contain the face nearest to the point. Boxes that are
 * farther away than max_distance are omitted. */
bool ebpo_catalogue_boxes_near(const ebpo_catalogue_boxes *t, const double p[3],
                               double max_distance, uint32_t item, ebpo_catalogue_pairs *out);
/* Appends pairs for all boxes that the ray from o along d may intersect. */
bool ebpo_catalogue_boxes_on_ray(const ebpo_catalogue_boxes *t, const double o[3],
                                 const double d[3], uint32_t item, ebpo_catalogue_pairs *out);

/* Sorts points along the Morton curve of the box from `min` to `max`. `points`: [count][3].
 * `numbers`: [count] gets the indices of the points, in this order. A point outside the box is
 * sorted as if it were the nearest point of the box. Returns false when out of memory. */
bool ebpo_catalogue_morton_order(const double *points, size_t count, const double min[3],
                                 const double max[3], uint32_t *numbers);

#endif
