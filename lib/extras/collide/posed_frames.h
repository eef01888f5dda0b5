/* Transforms models by their poses in floats, with proved error bounds. Results are posed blocks
 * (a block is up to eight faces of an accel) for the filter of pairs of faces, and the relative
 * position of two models' frames. The frame of a model is its accel's coordinate system. See
 * docs/develop/collision.md, "From blocks to the filter" and "Going down two hierarchies". All
 * functions are pure and can be called from any thread. */
#ifndef EBPO_COLLIDE_POSED_FRAMES_H
#define EBPO_COLLIDE_POSED_FRAMES_H

#include <stdbool.h>

#include "geometry/pose.h"
#include "query/accel.h"

/* A pose, prepared for posing blocks. */
typedef struct ebpo_block_posing {
    ebpo_posing posing;
    double unit;        /* a power of two: floats are world coordinates times this unit */
    float matrix[3][3]; /* the posing's matrix times unit */
    float size;         /* greatest length of a row of `matrix` */
    float uncertainty;  /* bound of the distance of posed coordinates from the exact motion of the
                         * vertex, times unit */
    bool fits;          /* the matrix is in the range of floats; if false, only blocks of doubles
                         * are used */
} ebpo_block_posing;

/* Returns the unit for two models whose posed coordinates are at most `max_coordinate` in size:
 * multiplied by the unit, they are below 2^30. max_coordinate <= 2^1000. */
double ebpo_block_unit(double max_coordinate);

/* Prepares a posing. max_coordinate: as for ebpo_block_unit, the same for both models of a pair. */
void ebpo_block_posing_make(ebpo_block_posing *out, const ebpo_posing *posing,
                            double max_coordinate);

/* Maximum number of vertices of a block: eight faces without a common vertex. */
enum { EBPO_POSED_VERTICES = 24 };

/* A block's rotated vertices, relative to the posed coordinates of the block's first vertex, times
 * unit. */
typedef struct ebpo_posed_block {
    _Alignas(32) float x[3][EBPO_POSED_VERTICES]; /* entries from `vertices` on are 0 */
    double base[3];                               /* posed coordinates of the first vertex */
    unsigned vertices;
    float error;  /* bound of the difference between x + base * unit and the exact posed coordinate
                   * times unit */
    float extent; /* greatest |x| */
} ebpo_posed_block;

/* Returns an upper bound of |x| of rotated vertices, for unrotated vertices whose 1-norms, relative
 * to the first vertex, are at most `most`. */
static inline float ebpo_posed_block_extent(const ebpo_block_posing *p, float most)
{
    return p->size * most * (1 + 0x1p-20f);
}
/* Returns ebpo_posed_block.error for a block with this extent. */
static inline float ebpo_posed_block_error(const ebpo_block_posing *p, float extent)
{
    return 6 * 0x1p-24f * extent + p->uncertainty;
}

/* Compute a posed block from a block's 1 to 24 vertices. vertex: [3][vertices], all x, all y, all
 * z. The first function is for blocks of floats, and needs p->fits; the second function is for
 * blocks of doubles. */
void ebpo_posed_block_make(ebpo_posed_block *out, const ebpo_block_posing *p, const float *vertex,
                           unsigned vertices);
void ebpo_posed_block_make_wide(ebpo_posed_block *out, const ebpo_block_posing *p,
                                const double *vertex, unsigned vertices);

/* Computes the vertices relative to `origin`, a point of the world, times `unit`. Returns the bound
 * of their error. The corners of the faces that ebpo_pair_kernels compare are among these
 * vertices. */
float ebpo_posed_block_place(const ebpo_posed_block *b, double unit, const double origin[3],
                             float out[3][EBPO_POSED_VERTICES]);

/* Eight faces of a block for ebpo_pair_kernels, relative to `base`. */
typedef struct ebpo_posed_faces {
    _Alignas(32) float x[9][8]; /* index: 3 * corner + axis */
    double base[3];             /* posed coordinates of the block's first vertex */
    float error, extent;        /* as in ebpo_posed_block */
    uint32_t block;             /* EBPO_NO_CHILD: the entry is empty */
    uint8_t lanes;
} ebpo_posed_faces;

/* Number of posed blocks of each model that a walk keeps. */
enum { EBPO_POSED_FACES = 32 };

/* Marks all kept blocks as empty. */
static inline void ebpo_posed_faces_forget(ebpo_posed_faces faces[2][EBPO_POSED_FACES])
{
    for (int i = 0; i < 2 * EBPO_POSED_FACES; i++)
        faces[i / EBPO_POSED_FACES][i % EBPO_POSED_FACES].block = EBPO_NO_CHILD;
}

/* Two accels (acceleration structures of subtrees) at their poses, each in its own frame, prepared
 * for descending both hierarchies together. The struct does not change afterwards, so any thread
 * may use it.
 *
 * Both frames use one unit of length: the larger one of the two frames' units. Boxes of one model
 * are transformed to the other model's frame by linear maps, for all pose matrices; only cylinders
 * need a map that keeps lengths (docs/develop/collision.md, "Going down two hierarchies"). */

typedef struct ebpo_accel_pair {
    const ebpo_accel *accel[2];
    const ebpo_block_posing *posing[2];
    float unit[2];     /* factor of lengths in each frame */
    double turn[3][3]; /* matrix from vectors of the second frame to vectors of the first one */
    double place[3];   /* origin of the second frame in the first */
    /* In floats: into[i] is the matrix from vectors of the other frame to vectors of frame i;
     * size[i] has the absolute values of its entries, rounded up. */
    float into[2][3][3], size[2][3][3];
    float uncertainty; /* bound of the errors of posing and of the matrices, in the unit; INFINITY:
                        * no pair of nodes is dropped */
    float cylinder_share; /* distances of cylinders are reduced by this share of the nodes' sizes */
    float sine_capacity;  /* margin that is added to the squared sine of the angle between two
                           * cylinders' axes */
    bool cylinders;       /* tests of cylinders are valid */
    bool apart;           /* the boxes around all faces are disjoint */
} ebpo_accel_pair;

/* Prepares a pair. max_coordinate: as for ebpo_block_unit. The posings must live as long as the
 * pair. */
void ebpo_accel_pair_make(ebpo_accel_pair *out, const ebpo_accel *const accel[2],
                          const ebpo_block_posing *const posing[2], double max_coordinate);

/* The map from one model's frame to the other model's frame. A point x of the accel's frame has the
 * coordinates y = x * unit. In the other model's frame they are turn * y + shift. turn_size:
 * absolute values of `turn`. */
typedef struct ebpo_turned_frame {
    float unit, turn[3][3], turn_size[3][3], shift[3];
    float in_world[3][3]; /* matrix; its transpose maps a direction of the world to the frame */
} ebpo_turned_frame;

/* Lengths are world lengths times the unit of ebpo_block_posing, the same for both models. */
typedef struct ebpo_two_frames {
    ebpo_turned_frame frame[2];
    /* The greatest error by which a computed gap of boxes may be too large, on each axis of either
     * frame. Causes are the rounding of floats (docs/develop/collision.md, "Bounds of pairs of
     * nodes"), the difference of poses from exact motions, and the rounding of posed
     * coordinates. */
    float slack;
} ebpo_two_frames;

/* Prepares both frames. The posings must have been made with the same max_coordinate. */
void ebpo_two_frames_make(ebpo_two_frames *out, const ebpo_accel *const accel[2],
                          const ebpo_block_posing posing[2]);

#endif
