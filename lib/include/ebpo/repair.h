/* SPDX-License-Identifier: MIT
 * Finds the repairs that make a mesh a solid.
 *
 *   ebpo_mesh_try_repairs    tries sequences of repairs and chooses the shortest successful one
 *   ebpo_mesh_count_shells   counts shells (closed sets of faces) by orientation and nesting
 *   ebpo_mesh_doubts         reasons why a mesh is not a solid, or probably not the intended solid
 */
#ifndef EBPO_REPAIR_H
#define EBPO_REPAIR_H

#include <ebpo/mesh.h>

#ifdef __cplusplus
extern "C" {
#endif

/*
 * Reasons why a mesh is not a solid, or is a solid that its author probably did not intend; as
 * bits.
 */
typedef enum ebpo_doubt {
    /* The mesh has unbalanced edges (ebpo_mesh_report): it is not closed. */
    EBPO_DOUBT_OPEN = 1 << 0,

    /* Holes were filled although vertices of equal position had not been merged. */
    EBPO_DOUBT_UNWELDED = 1 << 1,

    /* Holes were filled although more than half of all edges were boundary edges. */
    EBPO_DOUBT_MOSTLY_OPEN = 1 << 2,

    /* The faces that fill holes at least doubled the area. */
    EBPO_DOUBT_MOSTLY_FILLED = 1 << 3,

    /*
     * The mesh is a sheet: |volume| <= (0.01 * sqrt(area))^3, or the mesh's box has size 0 on an
     * axis. If a double cannot hold the volume, because coordinates are very large or very small,
     * only the box is tested.
     */
    EBPO_DOUBT_NO_VOLUME = 1 << 4,

    /* The volume is negative: faces point inwards. */
    EBPO_DOUBT_INSIDE_OUT = 1 << 5
} ebpo_doubt;

/*
 * Returns the doubts about a mesh, as ebpo_doubt bits.
 *
 * area     area of the mesh before repairs. 0: unknown; EBPO_DOUBT_MOSTLY_FILLED is then not set
 * report   report on the mesh after repairs
 * record   repairs that were made; NULL: no repairs
 *
 * Threads: any.
 */
EBPO_API uint32_t ebpo_mesh_doubts(double area, const ebpo_mesh_report *report,
                                   const ebpo_repair_record *record);

/* Maximum number of tries. */
#define EBPO_REPAIR_TRIES 12

/* One sequence of steps that was tried. */
typedef struct ebpo_repair_try {
    /* The steps of this try, and the changes that they made. */
    ebpo_repair_record record;

    /* Report on the mesh after these steps. */
    ebpo_mesh_report report;

    /* ebpo_doubt bits */
    uint32_t doubts;

    /*
     * The steps of this try as bits: 1 weld, 2 orient, 4 fill holes, 32 drop repeated faces. The
     * bits 8 and 16 are not used.
     */
    uint32_t steps;
} ebpo_repair_try;

/* Result of ebpo_mesh_try_repairs. */
typedef struct ebpo_repairs {
    size_t struct_size;

    /* Number of tries. */
    uint64_t count;

    /* The tries in the order in which they were made: those with fewer steps first. */
    ebpo_repair_try tries[EBPO_REPAIR_TRIES];

    /*
     * Index of the chosen try: the last try, if there are no doubts about its mesh. -1: no try was
     * chosen, for one of two reasons. Either there are doubts about the mesh of every try. Or there
     * are no doubts about the unrepaired mesh, so it needs no repair. In the second case, dropping
     * repeated faces may have been tried, but is not chosen.
     */
    int64_t chosen;
} ebpo_repairs;

#define EBPO_REPAIRS_INIT EBPO_SIZED(ebpo_repairs)

/*
 * Tries ebpo_mesh_weld, ebpo_mesh_drop_duplicates, ebpo_mesh_orient and ebpo_mesh_fill_holes, in
 * this order, on a copy of the mesh without attributes. The copy is allocated in the workspace of
 * the mesh. Sequences that cannot help are skipped. If there are no doubts about the mesh, only
 * the step that drops repeated faces is tried.
 *
 * report   report on the current mesh (ebpo_mesh_check, ebpo_mesh_prepare)
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
 * Number of shells by kind. A shell is a closed set of faces (ebpo_mesh_orient); shells may share
 * vertices or edges. In this struct, a component is a shell, or a set of faces that belong to no
 * shell and are connected by vertices.
 */
typedef struct ebpo_shells {
    size_t struct_size;

    /* Number of shells. Shells of volume 0 are not counted. */
    uint64_t closed;

    /* Number of shells that are oriented inwards and inside an even number of other shells. */
    uint64_t inside_out;

    /* Number of shells that are oriented inwards and inside an odd number of other shells. */
    uint64_t cavities;

    /*
     * Number of shells that are oriented outwards and inside an odd number of other shells: solids
     * inside other solids.
     */
    uint64_t nested;

    /*
     * 1: every component is closed, and no faces of two components have a common point.
     * Intersections within one component are not tested. 0: one of these conditions is not met, or
     * the search was stopped (ebpo_mesh_count_shells).
     */
    int32_t apart;

    uint32_t reserved;

    /*
     * Difference of two volumes for each ebpo_rule: volume of the solid under this rule, minus the
     * signed volume of the mesh (the integral of the winding number). In cubic units of the source.
     * If `apart` is 0, the differences are unknown, and the members are 0. All differences are also
     * 0 if every winding number is 0 or 1, as for bodies that are oriented outwards and have
     * cavities that are oriented inwards.
     */
    double volume_difference[3];
} ebpo_shells;

#define EBPO_SHELLS_INIT EBPO_SIZED(ebpo_shells)

/*
 * Counts the shells, and tests if faces of different components have a common point. The test is a
 * search in trees of boxes, which stops after 64 * face_count + 2^22 compared boxes; `apart` is
 * then 0.
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
