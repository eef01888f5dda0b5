/* Measures nanoseconds for each pair of faces, by kind of input: the filter of eight, the exact
 * test, contacts, distances. Also measures pairs of blocks. Prints a table; it is not a test. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "exact_reference.h"
#include "extras/collide/face_pairs.h"
#include "extras/collide/posed_frames.h"
#include "geometry/triangle_pair.h"
#include "pair_reference.h"

enum { PAIRS = 4096, ROUNDS = 40 };

typedef double face[3][3];
static face first[PAIRS], second[PAIRS], crossing[PAIRS][2];
static float first32[PAIRS / 8][72], second32[PAIRS / 8][72];
static float error;
static int crossings;
static volatile double sink;

#define CORNERS(face) ((const double(*)[3])(face))

static double now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec * 1e9 + (double)t.tv_nsec;
}

static void fill(int kind, uint64_t *state)
{
    double most = 0;
    crossings = 0;
    for (int i = 0; i < PAIRS; i++) {
        reference_pair_case(first[i], second[i], kind, state);
        if (ebpo_triangle_pair(CORNERS(first[i]), CORNERS(second[i])) == EBPO_PAIR_CROSSING) {
            memcpy(crossing[crossings][0], first[i], sizeof(face));
            memcpy(crossing[crossings++][1], second[i], sizeof(face));
        }
        for (int k = 0; k < 9; k++) {
            double o = first[i][0][k % 3], x = first[i][k / 3][k % 3] - o,
                   y = second[i][k / 3][k % 3] - o;
            first32[i / 8][8 * k + i % 8] = (float)x;
            second32[i / 8][8 * k + i % 8] = (float)y;
            most = fmax(most, fmax(fabs(x), fabs(y)));
        }
    }
    error = (float)(most * 0x1.1p-24);
}

typedef double work(int pair);

static double filter_base(int i)
{
    return i % 8 ? 0 : ebpo_pair_kernels_base.eight(first32[i / 8], second32[i / 8], error).apart;
}

static double filter_best(int i)
{
    return i % 8 ? 0
                 : ebpo_pair_kernels_best()->eight(first32[i / 8], second32[i / 8], error).apart;
}

static double filter_one(int i)
{
    return i % 8 ? 0 : ebpo_pair_kernels_best()->one(first32[0], second32[i / 8], error).apart;
}

static double exact_kind(int i)
{
    return ebpo_triangle_pair(CORNERS(first[i]), CORNERS(second[i]));
}

static double contact(int i)
{
    ebpo_contact_end end[2];
    if (!crossings)
        return 0;
    ebpo_triangle_contact(CORNERS(crossing[i % crossings][0]), CORNERS(crossing[i % crossings][1]),
                          end);
    return end[0].point[0];
}

static double bounds(int i)
{
    ebpo_pair_distance_bounds out;
    ebpo_triangles_distance_bounds(CORNERS(first[i]), CORNERS(second[i]), &out);
    return out.lo;
}

static double exact_distance(int i)
{
    return ebpo_triangles_distance(CORNERS(first[i]), CORNERS(second[i]));
}

/* Returns the minimum of some runs, in thread time. */
static double ns_per_pair(work *f, int pairs, int rounds)
{
    double least = INFINITY;
    for (int round = 0; round < rounds; round++) {
        double start = now_ns(), sum = 0;
        for (int i = 0; i < pairs; i++)
            sum += f(i);
        sink = sum;
        least = fmin(least, (now_ns() - start) / pairs);
    }
    return least;
}

static double share_open(void)
{
    int decided = 0;
    for (int i = 0; i < PAIRS / 8; i++) {
        ebpo_pair_masks m = ebpo_pair_kernels_base.eight(first32[i], second32[i], error);
        decided += __builtin_popcount((unsigned)m.apart | m.crossing);
    }
    return 100 - 100.0 * decided / PAIRS;
}

/* --- blocks of a surface against blocks of an intersecting one --- */

enum { BLOCKS = 512, VERTICES = 10 };
static float vertex[2][BLOCKS][3][VERTICES], placed[2][BLOCKS][72], placed_error[BLOCKS];
static ebpo_posed_block posed[2][BLOCKS];
static ebpo_block_posing posing[2];
static ebpo_block_pairs found;

/* Two rows of five vertices of a wavy surface: four squares. */
static void fill_patch(float out[3][VERTICES], uint64_t *state)
{
    for (int i = 0; i < VERTICES; i++) {
        double height = 0.3 * reference_uniform(state);
        out[0][i] = (float)(i % 5 + 0.1 * height);
        out[1][i] = (float)(i / 5);
        out[2][i] = (float)height;
    }
}

static void to_faces(float (*x)[EBPO_POSED_VERTICES], float out[72])
{
    static const int corners[2][3] = { { 0, 1, 6 }, { 0, 6, 5 } };
    for (int i = 0; i < 72; i++) {
        int lane = i % 8, corner = i / 24;
        out[i] = x[i / 8 % 3][corners[lane & 1][corner] + lane / 2];
    }
}

static double turn_block(int i)
{
    ebpo_posed_block_make(&posed[1][i], &posing[1], vertex[1][i][0], VERTICES);
    return (double)posed[1][i].x[0][0];
}

static double place_block(int i)
{
    float out[3][EBPO_POSED_VERTICES];
    float off = ebpo_posed_block_place(&posed[1][i], posing[0].unit, posed[0][i].base, out);
    return (double)(off + out[0][0]);
}

static void fill_blocks(uint64_t *state)
{
    static const double reach[3] = { 8, 8, 8 };
    static const ebpo_pose poses[] = {
        { { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } }, { 0, 0, 0 }, 1 },
        { { { 0.36, 0.48, -0.8 }, { -0.8, 0.6, 0 }, { 0.48, 0.64, 0.6 } }, { 1, 1.5, -1.5 }, 1 }
    };
    for (int of = 0; of < 2; of++) {
        ebpo_posing p;
        if (ebpo_posing_make(&p, &poses[of], reach, NULL) != EBPO_OK)
            return;
        ebpo_block_posing_make(&posing[of], &p, 32);
        for (int i = 0; i < BLOCKS; i++) {
            float out[3][EBPO_POSED_VERTICES];
            fill_patch(vertex[of][i], state);
            ebpo_posed_block_make(&posed[of][i], &posing[of], vertex[of][i][0], VERTICES);
            float off =
                ebpo_posed_block_place(&posed[of][i], posing[0].unit, posed[0][i].base, out);
            placed_error[i] = off > placed_error[i] ? off : placed_error[i];
            to_faces(out, placed[of][i]);
        }
    }
}

static double pair_blocks_by(const ebpo_pair_kernels *kernels, int i)
{
    kernels->blocks(placed[0][i], 255, placed[1][i], 255, placed_error[i], &found);
    return found.count;
}

static double pair_blocks_base(int i) { return pair_blocks_by(&ebpo_pair_kernels_base, i); }

static double pair_blocks_best(int i) { return pair_blocks_by(ebpo_pair_kernels_best(), i); }

static void report_blocks(uint64_t *state)
{
    int contacts = 0, certain = 0;
    fill_blocks(state);
    for (int i = 0; i < BLOCKS; i++) {
        pair_blocks_best(i);
        contacts += (int)found.count;
        for (unsigned k = 0; k < found.count; k++)
            certain += (found.pair[k] & EBPO_CERTAINLY_CROSSING) != 0;
    }
    printf("\nns for each pair of blocks: rotate one %.1f, pose one %.1f, filter all 64 pairs: "
           "base %.1f, best %.1f\n(%.2f certainly crossing, %.3f open)\n",
           ns_per_pair(turn_block, BLOCKS, ROUNDS), ns_per_pair(place_block, BLOCKS, ROUNDS),
           ns_per_pair(pair_blocks_base, BLOCKS, ROUNDS),
           ns_per_pair(pair_blocks_best, BLOCKS, ROUNDS), (double)certain / BLOCKS,
           (double)(contacts - certain) / BLOCKS);
}

int main(void)
{
    uint64_t state = 1;
    printf("%-34s %8s %8s %8s %8s %8s %8s %8s %8s\n", "ns for each pair", "base", "best", "one",
           "open %", "exact", "contact", "bounds", "distance");
    for (int kind = 0; kind < REFERENCE_PAIR_KINDS; kind++) {
        fill(kind, &state);
        printf("%-34s %8.2f %8.2f %8.2f %8.2f %8.1f %8.0f %8.0f %8.0f\n", reference_pair_name(kind),
               ns_per_pair(filter_base, PAIRS, ROUNDS), ns_per_pair(filter_best, PAIRS, ROUNDS),
               ns_per_pair(filter_one, PAIRS, ROUNDS), share_open(),
               ns_per_pair(exact_kind, PAIRS, ROUNDS), ns_per_pair(contact, PAIRS, 4),
               ns_per_pair(bounds, PAIRS, ROUNDS), ns_per_pair(exact_distance, 64, 2));
    }
    report_blocks(&state);
    return 0;
}
