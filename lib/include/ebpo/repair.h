/* SPDX-License-Identifier: MIT
 * Finds the repairs that make a mesh a solid.
 *
 *   ebpo_mesh_try_repairs    tries sequences of repairs and chooses the shortest successful one
 *   ebpo_mesh_count_shells   counts closed shells, also inverted ones
 *   ebpo_mesh_doubts         reasons why a solid is probably not the intended one
 */
#ifndef EBPO_REPAIR_H
#define EBPO_REPAIR_H

#include <ebpo/mesh.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Reasons why a mesh is not a solid, or probably not the intended one. Bits. */
typedef enum ebpo_doubt {
    /* Its edges are not balanced. */
    EBPO_DOUBT_OPEN = 1 << 0,

    /* Holes were filled although vertices of equal position had not been merged. */
    EBPO_DOUBT_UNWELDED = 1 << 1,

    /* Holes were filled although more than half of all edges were boundary edges. */
    EBPO_DOUBT_MOSTLY_OPEN = 1 << 2,

    /* Filled holes at least doubled the area. */
    EBPO_DOUBT_MOSTLY_FILLED = 1 << 3,

    /*
     * The volume is that of a sheet: at most the cube of 1/100 of the square root of the area. If
     * coordinates are so large or small that a double cannot hold the volume: the thickness is 0.
     */
    EBPO_DOUBT_NO_VOLUME = 1 << 4,

    /* The volume is negative: faces point inwards. */
    EBPO_DOUBT_INSIDE_OUT = 1 << 5
} ebpo_doubt;

/*
 * Returns the doubts about the current mesh.
 *
 * area     of the mesh before repairs. 0: unknown; the added area is then not tested
 * report   of the current mesh
 * record   repairs that were made; NULL: none
 *
 * Threads: any.
 */
EBPO_API uint32_t ebpo_mesh_doubts(double area, const ebpo_mesh_report *report,
                                   const ebpo_repair_record *record);

#define EBPO_REPAIR_TRIES 12

/* One sequence of steps; `record` contains the requested steps. */
typedef struct ebpo_repair_try {
    ebpo_repair_record record;
    ebpo_mesh_report report;

    /* ebpo_doubt bits */
    uint32_t doubts;

    /* Bits: 1 welded, 2 oriented, 4 holes filled, 32 repeated faces dropped. */
    uint32_t steps;
} ebpo_repair_try;

typedef struct ebpo_repairs {
    size_t struct_size;

    /* In the order in which they were tried: fewer steps first. */
    uint64_t count;
    ebpo_repair_try tries[EBPO_REPAIR_TRIES];

    /*
     * Index of the try without doubts, which is then the last try. -1: no try is without doubts, or
     * the mesh had none before.
     */
    int64_t chosen;
} ebpo_repairs;

#define EBPO_REPAIRS_INIT EBPO_SIZED(ebpo_repairs)

/*
 * Tries ebpo_mesh_weld, ebpo_mesh_drop_duplicates, ebpo_mesh_orient and ebpo_mesh_fill_holes, in
 * this order, on a copy of the mesh without its attributes, in its workspace. Sequences that cannot
 * help are skipped. If no repair is needed, only dropping repeated faces is tried.
 *
 * report   of the current mesh (ebpo_mesh_check, ebpo_mesh_prepare)
 *
 * Errors are those of the repairs and of ebpo_mesh_check. On failure `out` is cleared.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_try_repairs(const ebpo_mesh *mesh,
                                                         const ebpo_mesh_report *report,
                                                         unsigned threads, ebpo_progress progress,
                                                         ebpo_repairs *out, ebpo_error *error);

/*
 * Number of shells by kind, and properties of their components. Shells are defined at
 * ebpo_mesh_orient; they may share vertices or edges.
 */
typedef struct ebpo_shells {
    size_t struct_size;

    /* Number of shells with a volume other than 0. */
    uint64_t closed;

    /* Closed shells that are oriented inwards, inside an even number of other shells. */
    uint64_t inside_out;

    /* Closed shells that are oriented inwards, inside an odd number of other shells. */
    uint64_t cavities;

    /*
     * Closed shells that are oriented outwards, inside an odd number of other shells: a solid
     * inside another.
     */
    uint64_t nested;

    /*
     * 1: every component is closed, and no faces of two components have a common point;
     * intersections within one component are not tested. 0: otherwise, or the search was stopped
     * (ebpo_mesh_count_shells).
     */
    int32_t apart;

    uint32_t reserved;

    /*
     * Indexed by ebpo_rule, for components that are apart: volume of the solid minus the integral
     * of the winding number, in the cube of the source's unit. 0 if each component outside all
     * solids is oriented outwards, and each component in a solid inwards.
     */
    double beyond[3];
} ebpo_shells;

#define EBPO_SHELLS_INIT EBPO_SIZED(ebpo_shells)

/*
 * Counts the shells and tests if they are apart. It takes a few passes over the faces, and a search
 * in trees of components and of faces near other components. The search stops after 64 boxes for
 * each face (plus 2^22); `apart` is then 0.
 *
 * Errors are those of ebpo_components_new. On failure `out` is cleared.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_count_shells(const ebpo_mesh *mesh, unsigned threads,
                                                          ebpo_progress progress, ebpo_shells *out,
                                                          ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
