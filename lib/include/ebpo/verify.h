/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: proving that a file keeps its promises.
 */
#ifndef EBPO_VERIFY_H
#define EBPO_VERIFY_H

#include <ebpo/file.h>

#ifdef __cplusplus
extern "C" {
#endif

/* One kind of check: how often it was made, and how often it failed. */
typedef struct ebpo_verify_count {
    uint64_t checks, violations;

    /* The first violation in the order of the file; "" if there is none. */
    char first[240];
} ebpo_verify_count;

typedef struct ebpo_verify_report {
    size_t struct_size; /* EBPO_VERIFY_REPORT_INIT sets it */

    /* Head, shapes, counts, index arrays, order. */
    ebpo_verify_count structure;

    /* The checksum of the content. */
    ebpo_verify_count content;

    /*
     * Vertices, clipped faces and corners inside, against every half-space on
     * the way from the root.
     */
    ebpo_verify_count containment;

    /* A child's envelope lies in its parent's, leaf planes included. */
    ebpo_verify_count nesting;

    /*
     * White and black cells, and winding numbers of corners, against winding
     * numbers that are computed independently.
     */
    ebpo_verify_count labels;

    /* No face touches a cell that does not list it; no list names a face twice. */
    ebpo_verify_count lists;

    /* The mesh equals its source, bit for bit (options.source). */
    ebpo_verify_count source;

    /* Sums over all kinds. */
    uint64_t checks, violations;

    /*
     * Bytes of the file that belong to nothing, neither to its headers and indexes nor to a chunk,
     * and how many of them are not zero: 0 in what this library writes. They change no answer, and
     * are no violation. Files far away (http.h): 0, they are not read.
     */
    uint64_t spare_bytes, spare_filled;
} ebpo_verify_report;

#define EBPO_VERIFY_REPORT_INIT EBPO_SIZED(ebpo_verify_report)

typedef struct ebpo_verify_options {
    size_t struct_size; /* EBPO_VERIFY_OPTIONS_INIT sets it */

    /*
     * The mesh as it was read, neither mended nor arranged; or NULL. Mending that
     * the file records is done again.
     */
    const ebpo_mesh *source;

    /* 0: all cores. The result does not depend on it. */
    unsigned threads;

    /*
     * How many cells have their labels checked, at least one of each level and
     * type. 0: all of up to 2^22, or 2^20 of more; 4096 where that would take
     * more than some seconds.
     */
    uint64_t label_samples;

    ebpo_progress progress;

    /*
     * What the work keeps to, in memory and temporary files. NULL: as much memory
     * as it takes.
     */
    ebpo_workspace *workspace;
} ebpo_verify_options;

#define EBPO_VERIFY_OPTIONS_INIT                                      \
    {                                                                 \
        sizeof(ebpo_verify_options), NULL, 0, 0, { NULL, NULL }, NULL \
    }

/*
 * Verifies an open file. EBPO_OK means that the work could be done, whatever was
 * found: look at report->violations. A file too damaged to be read counts as a
 * violation of its structure.
 *
 * EBPO_E_ARGUMENT: the source is no valid mesh, or has been arranged.
 * EBPO_E_CANCELLED, EBPO_E_IO, EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_verify(const ebpo_file *file,
                                               const ebpo_verify_options *options,
                                               ebpo_verify_report *report, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
