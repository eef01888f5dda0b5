/* Models at poses in floats, with proved errors: blocks of faces as the filter of pairs takes
 * them, and two models' frames seen from each other (docs/develop/collision.md, "From blocks to
 * the filter" and "Going down two hierarchies"). Pure functions, any thread. */
#ifndef EBPO_COLLIDE_POSED_FRAMES_H
#define EBPO_COLLIDE_POSED_FRAMES_H

#include <stdbool.h>

#include "geometry/pose.h"
#include "query/accel.h"

/* A pose made ready for blocks. */
typedef struct ebpo_block_posing {
    ebpo_posing posing;
    double unit;        /* a power of two: floats are world coordinates times it */
    float matrix[3][3]; /* the posing's times unit */
    float size;         /* no row of the matrix is longer */
    float doubt;        /* what posed coordinates are off from exact motions, times unit */
    bool fits;          /* in floats; else only blocks of doubles are */
} ebpo_block_posing;

/* The unit for two models whose posed coordinates are at most `reach` in size: it brings them below
 * 2^30. reach <= 2^1000. */
double ebpo_block_unit(double reach);

/* reach: as for ebpo_block_unit, the same for both models of a pair. */
void ebpo_block_posing_make(ebpo_block_posing *out, const ebpo_posing *posing, double reach);

/* At most: eight faces without a vertex in common. */
enum { EBPO_POSED_VERTICES = 24 };

/* A block's vertices, turned, beside the posed coordinates of its first one. */
typedef struct ebpo_posed_block {
    _Alignas(32) float x[3][EBPO_POSED_VERTICES]; /* 0 from `vertices` on */
    double base[3];                               /* posed coordinates, as defined */
    unsigned vertices;
    float error; /* x + base * unit less the exact one times unit, at most */
    float reach; /* no |x| is greater */
} ebpo_posed_block;

/* Of vertices whose 1-norms, seen from the first one, are at most `most`. */
static inline float ebpo_posed_block_reach(const ebpo_block_posing *p, float most)
{
    return p->size * most * (1 + 0x1p-20f);
}
static inline float ebpo_posed_block_error(const ebpo_block_posing *p, float reach)
{
    return 6 * 0x1p-24f * reach + p->doubt;
}

/* vertex: [3][vertices], all x, all y, all z, as blocks have them; 1 to 24 of them. The first:
 * p->fits. */
void ebpo_posed_block_make(ebpo_posed_block *out, const ebpo_block_posing *p, const float *vertex,
                           unsigned vertices);
void ebpo_posed_block_make_wide(ebpo_posed_block *out, const ebpo_block_posing *p,
                                const double *vertex, unsigned vertices);

/* The vertices as seen from `origin` in the world, from which a block's corners pick the faces that
 * ebpo_pair_kernels take; returns their error. */
float ebpo_posed_block_place(const ebpo_posed_block *b, double unit, const double origin[3],
                             float out[3][EBPO_POSED_VERTICES]);

/* Eight faces of a block as the kernels of pairs take them, seen from `base`. */
typedef struct ebpo_posed_faces {
    _Alignas(32) float x[9][8]; /* 3 corner + axis */
    double base[3];             /* posed coordinates of the block's first vertex */
    float error, reach;         /* as in ebpo_posed_block */
    uint32_t block;             /* EBPO_NO_CHILD: none is here */
    uint8_t lanes;
} ebpo_posed_faces;

/* Of each model so many are kept. */
enum { EBPO_POSED_FACES = 32 };

static inline void ebpo_posed_faces_forget(ebpo_posed_faces faces[2][EBPO_POSED_FACES])
{
    for (int i = 0; i < 2 * EBPO_POSED_FACES; i++)
        faces[i / EBPO_POSED_FACES][i % EBPO_POSED_FACES].block = EBPO_NO_CHILD;
}

/* Two accels at their poses, each in its own frame, made ready for going down both hierarchies
 * together. Immutable; any thread.
 *
 * Frames are measured in one unit: the first's, or the second's if that is the larger one. What is
 * known of each is linear in the frame of the other, whatever the poses' matrices are like; only
 * slabs rest upon lengths (docs/develop/collision.md, "Going down two hierarchies"). */

typedef struct ebpo_accel_pair {
    const ebpo_accel *accel[2];
    const ebpo_block_posing *posing[2];
    float unit[2];     /* what a length of a frame is multiplied by */
    double turn[3][3]; /* a vector of the second's frame to the first's */
    double place[3];   /* the second's origin in the first's frame */
    /* The same in floats: a vector of the other's frame to frame i; and the sizes of the entries,
     * rounded up. */
    float into[2][3][3], size[2][3][3];
    float doubt;      /* what posing and these numbers are off, in the unit */
    float slab_share; /* of the sizes of nodes, for what slabs lose */
    float sine_room;  /* added to the squared sine of two slabs' axes */
    bool slabs;       /* they may be asked */
    bool apart;       /* the boxes around all faces have no common point */
} ebpo_accel_pair;

/* reach: at least every posed coordinate of both models. The posings must live as long. */
void ebpo_accel_pair_make(ebpo_accel_pair *out, const ebpo_accel *const accel[2],
                          const ebpo_block_posing *const posing[2], double reach);

/* How two models' frames lie to each other: what boxes and slabs of one are, seen from the other.
 */

/* y = x * unit, x in the accel's frame; the other model's y is turn y + shift. */
typedef struct ebpo_turned_frame {
    float unit, turn[3][3], turn_size[3][3], shift[3];
    float in_world[3][3]; /* a direction of the world is in_world^T of it in the frame */
} ebpo_turned_frame;

/* Lengths are those of the world times ebpo_block_posing's unit, the same for both. */
typedef struct ebpo_two_frames {
    ebpo_turned_frame frame[2];
    /* On each axis of either frame, gaps of boxes may be so much less than they are computed: what
     * floats lose (docs/develop/collision.md, "Bounds of pairs of nodes"), what poses are off from
     * motions, and posed coordinates from exact ones. */
    float slack;
} ebpo_two_frames;

/* The posings have been made with one reach. */
void ebpo_two_frames_make(ebpo_two_frames *out, const ebpo_accel *const accel[2],
                          const ebpo_block_posing posing[2]);

#endif
