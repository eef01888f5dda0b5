/* What one thread works with while it bounds how far an envelope reaches. */
#ifndef EBPO_DERIVE_BOUNDER_H
#define EBPO_DERIVE_BOUNDER_H

#include "derive/cut.h"
#include "derive/frame.h"
#include "derive/tree.h"

typedef struct ebpo_fragment ebpo_fragment;

typedef struct ebpo_bounder {
    const ebpo_lod_model *whole; /* the model's tree: what is solid */
    ebpo_context *context;       /* of the same file */
    ebpo_leaf_scratch scratch;
    ebpo_half_spaces halves;  /* of the envelope */
    ebpo_fragment *fragments; /* a stack */
    uint64_t fragment_capacity, fragment_count;
    /* faces of pieces within leaves, in the model's unit: a stack as well */
    double (*faces)[3][3];
    uint64_t face_capacity, face_count;
    /* The node at hand: */
    ebpo_cell_frame frame;
    double target, quit, ratio, lo, hi, place[3];
    double inner[3]; /* about the envelope's middle, in cell coordinates */
    uint64_t questions;
    ebpo_error *error;
} ebpo_bounder;

#endif
