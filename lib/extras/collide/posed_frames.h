/* Models at poses in floats, with proved error bounds: blocks of faces for the filter of pairs, and
 * the relative position of two models' frames (docs/develop/collision.md, "From blocks to the
 * filter" and "Going down two hierarchies"). Pure functions, any thread. */
#ifndef EBPO_COLLIDE_POSED_FRAMES_H
#define EBPO_COLLIDE_POSED_FRAMES_H

#include <stdbool.h>

#include "geometry/pose.h"
#include "query/accel.h"

/* A pose prepared for blocks. */
typedef struct ebpo_block_posing {
    ebpo_posing posing;
    double unit;        /* a power of two: floats are world coordinates times it */
    float matrix[3][3]; /* the posing's matrix times unit */
    float size;         /* no row of the matrix is longer */
    float doubt;        /* error of posed coordinates against exact motions, times unit */
    bool fits;          /* the model fits in floats; else only blocks of doubles are used */
} ebpo_block_posing;

/* Returns the unit for two models whose posed coordinates are at most `reach` in size: it brings
 * them below 2^30. reach <= 2^1000. */
double ebpo_block_unit(double reach);

/* reach: as for ebpo_block_unit, the same for both models of a pair. */
void ebpo_block_posing_make(ebpo_block_posing *out, const ebpo_posing *posing, double reach);

/* Most vertices of a block: eight faces without a common vertex. */
enum { EBPO_POSED_VERTICES = 24 };

/* A block's rotated vertices, relative to the posed coordinates of its first one. */
typedef struct ebpo_posed_block {
    _Alignas(32) float x[3][EBPO_POSED_VERTICES]; /* 0 from `vertices` on */
    double base[3];                               /* posed coordinates of the first vertex */
    unsigned vertices;
    float error; /* bound of the error of x + base * unit against the exact value times unit */
    float reach; /* no |x| is greater */
} ebpo_posed_block;

/* Returns the reach of vertices whose 1-norms, relative to the first one, are at most `most`. */
static inline float ebpo_posed_block_extent(const ebpo_block_posing *p, float most)
{
    return p->size * most * (1 + 0x1p-20f);
}
static inline float ebpo_posed_block_error(const ebpo_block_posing *p, float reach)
{
    return 6 * 0x1p-24f * reach + p->doubt;
}

/* vertex: [3][vertices], all x, all y, all z, as in blocks; 1 to 24 vertices. The first function
 * needs p->fits. */
void ebpo_posed_block_make(ebpo_posed_block *out, const ebpo_block_posing *p, const float *vertex,
                           unsigned vertices);
void ebpo_posed_block_make_wide(ebpo_posed_block *out, const ebpo_block_posing *p,
                                const double *vertex, unsigned vertices);

/* Computes the vertices relative to `origin` in the world, from which a block's corners pick the
 * faces for ebpo_pair_kernels; returns their error. */
float ebpo_posed_block_place(const ebpo_posed_block *b, double unit, const double origin[3],
                             float out[3][EBPO_POSED_VERTICES]);

/* Eight faces of a block for the kernels of pairs, relative to `base`. */
typedef struct ebpo_posed_faces {
    _Alignas(32) float x[9][8]; /* 3 corner + axis */
    double base[3];             /* posed coordinates of the block's first vertex */
    float error, reach;         /* as in ebpo_posed_block */
    uint32_t block;             /* EBPO_NO_CHILD: none is kept here */
    uint8_t lanes;
} ebpo_posed_faces;

/* Number of kept entries for each model. */
enum { EBPO_POSED_FACES = 32 };

static inline void ebpo_posed_faces_forget(ebpo_posed_faces faces[2][EBPO_POSED_FACES])
{
    for (int i = 0; i < 2 * EBPO_POSED_FACES; i++)
        faces[i / EBPO_POSED_FACES][i % EBPO_POSED_FACES].block = EBPO_NO_CHILD;
}

/* Two accels at their poses, each in its own frame, prepared for descending both hierarchies
 * together. Immutable; any thread.
 *
 * Frames use one unit: the first's, or the second's if that is larger. Bounds of each are linear in
 * the frame of the other for all pose matrices; only cylinders depend on lengths
 * (docs/develop/collision.md, "Going down two hierarchies"). */

typedef struct ebpo_accel_pair {
    const ebpo_accel *accel[2];
    const ebpo_block_posing *posing[2];
    float unit[2];     /* factor of lengths in each frame */
    double turn[3][3]; /* rotates a vector of the second's frame to the first's */
    double place[3];   /* the second's origin in the first's frame */
    /* In floats: rotation of a vector of the other's frame to frame i, and the sizes of the
     * entries, rounded up. */
    float into[2][3][3], size[2][3][3];
    float doubt;         /* error of posing and of these numbers, in the unit */
    float slab_share;    /* share of the sizes of nodes that bounds of cylinders lose */
    float sine_capacity; /* added to the squared sine between two cylinders' axes */
    bool slabs;          /* cylinders may be used */
    bool apart;          /* the boxes around all faces are disjoint */
} ebpo_accel_pair;

/* reach: at least every posed coordinate of both models. The posings must live as long as the pair.
 */
void ebpo_accel_pair_make(ebpo_accel_pair *out, const ebpo_accel *const accel[2],
                          const ebpo_block_posing *const posing[2], double reach);

/* The relative position of two models' frames, for boxes and cylinders of one in the other's frame.
 */

/* y = x * unit, x in the accel's frame; the other model's y is turn y + shift. */
typedef struct ebpo_turned_frame {
    float unit, turn[3][3], turn_size[3][3], shift[3];
    float in_world[3][3]; /* its transpose maps a direction of the world to the frame */
} ebpo_turned_frame;

/* Lengths are those of the world times ebpo_block_posing's unit, the same for both. */
typedef struct ebpo_two_frames {
    ebpo_turned_frame frame[2];
    /* Amount by which computed gaps of boxes may be too large on each axis of either frame:
     * rounding of floats (docs/develop/collision.md, "Bounds of pairs of nodes"), error of poses
     * against motions, and of posed coordinates against exact ones. */
    float slack;
} ebpo_two_frames;

/* The posings must have been made with one reach. */
void ebpo_two_frames_make(ebpo_two_frames *out, const ebpo_accel *const accel[2],
                          const ebpo_block_posing posing[2]);

#endif
