/* Transforms models by their poses in floats, with proved error bounds. Results are posed blocks
 * for the filter of pairs of faces, and the relative position of two models' frames. A block is up
 * to eight faces of an accel (the acceleration structure of a subtree). The frame of a model is its
 * accel's coordinate system. See docs/develop/collision.md, "From blocks to the filter" and "Going
 * down two hierarchies". All functions are pure and can be called from any thread. */
#ifndef EBPO_COLLIDE_POSED_FRAMES_H
#define EBPO_COLLIDE_POSED_FRAMES_H

#include <stdbool.h>

#include "geometry/pose.h"
#include "query/accel.h"

/* A pose, prepared for transforming blocks. */
typedef struct ebpo_block_posing {
    ebpo_posing posing;
    double unit;        /* a power of two: floats are world coordinates times the unit */
    float matrix[3][3]; /* the posing's matrix times unit */
    float size;         /* upper bound of the lengths of the rows of `matrix` */
    float uncertainty;  /* bound of the distance of posed coordinates from the exact motion of the
                         * vertex, times unit */
    bool fits; /* the matrix is in the range of floats; if false, all blocks are posed in doubles
                  (ebpo_posed_block_make_wide) */
} ebpo_block_posing;

/* Returns the unit for two models whose posed coordinates have absolute values of at most
 * `max_coordinate`: multiplied by the unit, coordinates are below 2^30. max_coordinate <= 2^1000.
 */
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
    unsigned vertices;                            /* number of vertices, 1 to 24 */
    float error;  /* bound of the difference between x + base * unit and the exact posed coordinate
                   * times unit */
    float extent; /* upper bound of the absolute values in x */
} ebpo_posed_block;

/* Returns ebpo_posed_block.extent for a block whose vertices, relative to its first vertex and
 * before the rotation, have 1-norms of at most `most`. */
static inline float ebpo_posed_block_extent(const ebpo_block_posing *p, float most)
{
    return p->size * most * (1 + 0x1p-20f);
}
/* Returns ebpo_posed_block.error for a block with this extent. */
static inline float ebpo_posed_block_error(const ebpo_block_posing *p, float extent)
{
    return 6 * 0x1p-24f * extent + p->uncertainty;
}

/* Computes a posed block from a block's 1 to 24 vertices in floats; needs p->fits. vertex:
 * [3][vertices], first all x, then all y, then all z. */
void ebpo_posed_block_make(ebpo_posed_block *out, const ebpo_block_posing *p, const float *vertex,
                           unsigned vertices);
/* Computes a posed block from a block's vertices in doubles. */
void ebpo_posed_block_make_wide(ebpo_posed_block *out, const ebpo_block_posing *p,
                                const double *vertex, unsigned vertices);

/* Computes the posed vertices of a block relative to `origin`, a point of the world, times `unit`,
 * for ebpo_pair_kernels. Returns a bound of the errors of their coordinates. */
float ebpo_posed_block_place(const ebpo_posed_block *b, double unit, const double origin[3],
                             float out[3][EBPO_POSED_VERTICES]);

/* The posed faces of a block for ebpo_pair_kernels, relative to `base`, times unit. */
typedef struct ebpo_posed_faces {
    _Alignas(32) float x[9][8]; /* [3 * corner + axis][lane] */
    double base[3];             /* posed coordinates of the block's first vertex */
    float error, extent;        /* as in ebpo_posed_block */
    uint8_t lanes;              /* a bit for each lane that has a face */
} ebpo_posed_faces;

/* A cache: the last blocks of a model that a walk has posed. The indices are contiguous, so that a
 * short query quickly marks all entries as empty. */
enum { EBPO_POSED_FACES = 32 };

typedef struct ebpo_posed_cache {
    uint32_t block[EBPO_POSED_FACES]; /* the block's index; EBPO_NO_CHILD: the entry is empty */
    ebpo_posed_faces faces[EBPO_POSED_FACES];
} ebpo_posed_cache;

/* Marks all entries of both models' caches as empty. */
static inline void ebpo_posed_faces_forget(ebpo_posed_cache cache[2])
{
    for (int i = 0; i < EBPO_POSED_FACES; i++)
        cache[0].block[i] = cache[1].block[i] = EBPO_NO_CHILD;
}

/* Two accels at their poses, prepared for a walk through both hierarchies together. The coordinates
 * of each accel are in the frame of its model. The struct does not change after it has been made,
 * so any thread may use it.
 *
 * Lengths in both frames are multiplied by the factors `unit`, so that they have the same unit: the
 * larger of the two frames' units. Boxes of one model are transformed to the other model's frame by
 * linear maps, for all pose matrices; only cylinders need a map that keeps lengths
 * (docs/develop/collision.md, "Going down two hierarchies"). */
typedef struct ebpo_accel_pair {
    const ebpo_accel *accel[2];
    const ebpo_block_posing *posing[2];
    float unit[2];     /* factor of lengths in each frame */
    double turn[3][3]; /* matrix from vectors of the second frame to vectors of the first frame */
    double place[4];   /* origin of the second frame in the first frame; place[3] is 0 */
    /* In floats: into[i] is the matrix from vectors of the other frame to vectors of frame i;
     * size[i] has the absolute values of the entries of into[i], rounded up. */
    float into[2][3][3], size[2][3][3];
    /* the columns of `turn` and of into[1]; the fourth entries are 0 */
    double column[3][4];
    float into_column[3][4];
    float uncertainty; /* bound of the errors of posing and of the matrices, in the common unit of
                        * both frames; INFINITY: no pair of nodes is dropped */
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

/* The map from one model's frame to the other model's frame. A point x of the frame has the
 * coordinates y = x * unit in the unit of ebpo_two_frames, and turn * y + shift in the other
 * model's frame. */
typedef struct ebpo_turned_frame {
    float unit, turn[3][3], shift[3];
    float turn_size[3][3]; /* absolute values of `turn` */
    float in_world[3][3];  /* matrix; its transpose maps a direction of the world to the frame */
} ebpo_turned_frame;

/* The frames of two models, for searches for the nearest faces. Lengths are world lengths times the
 * unit of ebpo_block_posing, which is the same for both models. */
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
