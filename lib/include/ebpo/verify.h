/* SPDX-License-Identifier: MIT
 * Verifies the guarantees of a file.
 */
#ifndef EBPO_VERIFY_H
#define EBPO_VERIFY_H

#include <ebpo/file.h>

#ifdef __cplusplus
extern "C" {
#endif

/* One kind of check: number of checks and of violations. */
typedef struct ebpo_verify_count {
    uint64_t checks, violations;

    /* Description of the first violation in the order of the file; "" if there is none. */
    char first[240];
} ebpo_verify_count;

/* Result of ebpo_verify, by kind of check. */
typedef struct ebpo_verify_report {
    size_t struct_size;

    /*
     * Header; shapes and counts of arrays; order of values; index arrays (running sums of counts).
     * Also checks that exactly the cells with more than leaf_faces faces are divided, although no
     * rule of the format requires this.
     */
    ebpo_verify_count structure;

    /* The content checksum (content_sha256) is the one computed from the arrays. */
    ebpo_verify_count content;

    /*
     * In each cell: vertices, parts of faces, and corners of the cell that are inside the solid,
     * are in every half-space on the path from the root.
     */
    ebpo_verify_count containment;

    /*
     * The envelope of each node, including leaves with stored planes, is contained in the envelope
     * of its parent.
     */
    ebpo_verify_count nesting;

    /*
     * White and black cells, and winding numbers of corners, agree with winding numbers that
     * another method computes.
     */
    ebpo_verify_count labels;

    /* Each leaf lists all faces that intersect its cell; no list contains a face twice. */
    ebpo_verify_count lists;

    /* The mesh equals its source bitwise (options.source). */
    ebpo_verify_count source;

    /* Sums over all kinds. */
    uint64_t checks, violations;

    /*
     * Number of unused bytes of the file, which are outside headers, chunk directories and chunks;
     * and number of unused bytes that are not zero, which is 0 in files of this library. Unused
     * bytes change no result and are not violations. For remote files (http.h) both are 0, because
     * unused bytes are not read.
     */
    uint64_t spare_bytes, spare_filled;
} ebpo_verify_report;

#define EBPO_VERIFY_REPORT_INIT EBPO_SIZED(ebpo_verify_report)

/* Options of ebpo_verify. */
typedef struct ebpo_verify_options {
    size_t struct_size;

    /*
     * The source mesh as ebpo_mesh_read returns it, neither repaired nor arranged. NULL: not
     * compared. The repairs that the file records are applied to a copy.
     */
    const ebpo_mesh *source;

    unsigned threads;

    /*
     * Number of cells whose labels are checked, at least one of each level and type. 0: all cells
     * if there are at most 2^22 cells, else 2^20 cells; 4,096 cells if these numbers would take
     * more than a few seconds.
     */
    uint64_t label_samples;

    ebpo_progress progress;

    /* Limits memory, and provides temporary files. NULL: no limit. */
    ebpo_workspace *workspace;
} ebpo_verify_options;

#define EBPO_VERIFY_OPTIONS_INIT                                      \
    {                                                                 \
        sizeof(ebpo_verify_options), NULL, 0, 0, { NULL, NULL }, NULL \
    }

/*
 * Verifies an open file. EBPO_OK means that the verification was completed; report->violations has
 * the result. A file too damaged to be read counts as a violation of its structure.
 *
 * EBPO_E_ARGUMENT: the source is not a valid mesh, or has been arranged. EBPO_E_IO.
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
