/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: which repairs make a solid of a mesh.
 *
 *   ebpo_mesh_try_repairs   tries them, and chooses the shortest sequence that does
 *   ebpo_mesh_count_shells  which of its closed components are turned inside out
 *   ebpo_mesh_doubts        why a solid is probably not the one that was meant
 */
#ifndef EBPO_REPAIR_H
#define EBPO_REPAIR_H

#include <ebpo/mesh.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Why a mesh is no solid, or probably not the one that was meant. Bits. */
typedef enum ebpo_doubt {
    /* Its edges do not balance. */
    EBPO_DOUBT_OPEN = 1 << 0,

    /* Holes were filled although vertices at one position had not been merged. */
    EBPO_DOUBT_UNWELDED = 1 << 1,

    /* Holes were filled although more than half of all edges were boundary edges. */
    EBPO_DOUBT_MOSTLY_OPEN = 1 << 2,

    /* Filling holes added as much area as there was, or more. */
    EBPO_DOUBT_MOSTLY_FILLED = 1 << 3,

    /*
     * The volume is that of a sheet: at most the cube of a hundredth of the area's root. Of
     * coordinates so far from 1 that a volume is no double: there is no thickness at all.
     */
    EBPO_DOUBT_NO_VOLUME = 1 << 4,

    /* The volume is negative: faces look inwards. */
    EBPO_DOUBT_INSIDE_OUT = 1 << 5
} ebpo_doubt;

/*
 * The doubts about a mesh as it is now.
 *
 * area     of the mesh before it was mended; 0: not known, and nothing is said of
 *          area that was added
 * report   of the mesh as it is now
 * record   of what was mended; NULL: nothing
 *
 * Threads: any.
 */
EBPO_API uint32_t ebpo_mesh_doubts(double area, const ebpo_mesh_report *report,
                                   const ebpo_mend_record *record);

#define EBPO_REPAIR_TRIES 12

/* One sequence of steps: which, is what `record` says was asked for. */
typedef struct ebpo_repair_try {
    ebpo_mend_record record;
    ebpo_mesh_report report;

    /* ebpo_doubt. */
    uint32_t doubts;

    /* Bits: 1 welded, 2 oriented, 4 holes filled, 32 repeated faces dropped. */
    uint32_t steps;
} ebpo_repair_try;

typedef struct ebpo_repairs {
    size_t struct_size; /* EBPO_REPAIRS_INIT sets it */

    /* In the order in which they were tried: fewer steps first. */
    uint64_t count;
    ebpo_repair_try tries[EBPO_REPAIR_TRIES];

    /*
     * The one after which no doubts were left, or -1. It is the last one then. -1 also
     * where there were none before.
     */
    int64_t chosen;
} ebpo_repairs;

#define EBPO_REPAIRS_INIT EBPO_SIZED(ebpo_repairs)

/*
 * Tries on a copy of the mesh, without its attributes and in its workspace, what
 * ebpo_mesh_weld, ebpo_mesh_drop_duplicates, ebpo_mesh_orient and
 * ebpo_mesh_fill_holes, in this order, would leave; sequences that cannot help are
 * left out. Where nothing is to be repaired nothing is tried, but for what dropping
 * repeated faces would leave.
 *
 * report    of the mesh as it is (ebpo_mesh_check, ebpo_mesh_prepare)
 * threads   0: all cores. The result does not depend on it.
 *
 * Errors are those of mending and ebpo_mesh_check. On failure `out` is cleared.
 *
 * Threads: any, while nobody changes the mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_try_repairs(const ebpo_mesh *mesh,
                                                         const ebpo_mesh_report *report,
                                                         unsigned threads, ebpo_progress progress,
                                                         ebpo_repairs *out, ebpo_error *error);

/* Shells, also those that share vertices or edges, by what they bound; see ebpo_mesh_orient. */
typedef struct ebpo_shells {
    size_t struct_size; /* EBPO_SHELLS_INIT sets it */

    /* With a volume that is not 0. */
    uint64_t closed;

    /* Of these, within an even number of others, and look inwards. */
    uint64_t inside_out;

    /* Within an odd number of others, and look inwards. */
    uint64_t cavities;

    /* Within an odd number of others, and look outwards: a solid within another. */
    uint64_t nested;

    /*
     * 1: every component is closed, and no faces of two components have a common
     * point; crossings within one component are not looked for. 0: not so, or too
     * crowded to find out.
     */
    int32_t apart;

    uint32_t reserved;

    /*
     * By ebpo_rule, of components that are apart: the volume of the solid less the
     * integral of the winding number. 0 where each component looks outwards in the
     * open and inwards in a solid. In the source's unit cubed.
     */
    double beyond[3];
} ebpo_shells;

#define EBPO_SHELLS_INIT EBPO_SIZED(ebpo_shells)

/*
 * Counts them, and finds out whether they are apart. Time: a few passes over the
 * faces, and a search in trees of components and of faces near other components;
 * the search stops after 64 boxes for each face (and 2^22) and then says that they
 * are not apart.
 *
 * threads   0: all cores. The result does not depend on it.
 *
 * Errors are those of ebpo_components_new. On failure `out` is cleared.
 *
 * Threads: any, while nobody changes the mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_count_shells(const ebpo_mesh *mesh, unsigned threads,
                                                          ebpo_progress progress, ebpo_shells *out,
                                                          ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
