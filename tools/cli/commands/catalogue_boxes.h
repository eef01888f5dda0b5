/* Which of many boxes points and rays come to. Immutable once made, for any number of threads. */
#ifndef EBPO_TOOLS_CATALOGUE_BOXES_H
#define EBPO_TOOLS_CATALOGUE_BOXES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { BOX_LEVELS = 12 };

typedef struct closed_box {
    double min[3], max[3];
} closed_box;

typedef struct catalogue_boxes {
    uint32_t *number; /* [count[0]] of the boxes, along the Morton curve of their centres */
    int levels;       /* 0: there is no box */
    size_t count[BOX_LEVELS];
    closed_box *box[BOX_LEVELS]; /* level 0: the boxes; above: those of eight each */
} catalogue_boxes;

/* What is in the list, by what was asked. */
typedef struct box_pair {
    uint32_t box, item;
    double least; /* catalogue_boxes_near: how far away the box is at least */
} box_pair;

typedef struct box_pairs {
    box_pair *pair;
    size_t count, capacity;
} box_pairs;

/* boxes[count] with numbers[count], which name them in pairs. False: not enough memory;
 * catalogue_boxes_free in any case. */
bool catalogue_boxes_make(catalogue_boxes *t, const closed_box *boxes, const uint32_t *numbers,
                          size_t count);
void catalogue_boxes_free(catalogue_boxes *t);

/* Each appends pairs (box, item); false: not enough memory. Boxes that hold the point: */
bool catalogue_boxes_holding(const catalogue_boxes *t, const double p[3], uint32_t item,
                             box_pairs *out);
/* All that may hold what is nearest to the point, and at most `most` away: */
bool catalogue_boxes_near(const catalogue_boxes *t, const double p[3], double most, uint32_t item,
                          box_pairs *out);
/* All that the ray from o along d may meet: */
bool catalogue_boxes_on_ray(const catalogue_boxes *t, const double o[3], const double d[3],
                            uint32_t item, box_pairs *out);

/* Lengths here are rounded some ten times; what is dropped is farther than this share more. */
#define BOX_SLACK 0x1p-40

#endif
