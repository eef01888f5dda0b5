/* SPDX-License-Identifier: MIT
 * Verifies the guarantees of a file. The envelope of a node is a convex polyhedron that contains
 * the part of the solid in the node's cell.
 */
#ifndef EBPO_VERIFY_H
#define EBPO_VERIFY_H

#include <ebpo/file.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Result of one kind of check: number of checks, and number of violations. */
typedef struct ebpo_verify_count {
    uint64_t checks, violations;

    /* Description of the first violation in the order of the file; "" if there is none. */
    char first[240];
} ebpo_verify_count;

/*
 * Result of ebpo_verify, by kind of check. The comment of a member states the property that is
 * checked.
 */
typedef struct ebpo_verify_report {
    size_t struct_size;

    /*
     * The header, the shapes and counts of arrays, the order of values, and the index arrays
     * (running sums of counts) are valid. This check also requires that exactly the cells with more
     * than leaf_faces faces are divided, although no rule of the format requires this.
     */
    ebpo_verify_count structure;

    /* The content checksum (content_sha256) equals the checksum computed from the arrays. */
    ebpo_verify_count content;

    /*
     * In each cell, all points of the solid are in every half-space of the nodes on the path from
     * the root. The vertices in the cell, the parts of faces in the cell, and the corners of the
     * cell that are inside the solid are tested.
     */
    ebpo_verify_count containment;

    /*
     * The envelope of each node, including leaves with stored planes, is contained in the envelope
     * of its parent.
     */
    ebpo_verify_count nesting;

    /*
     * The types of white and black cells, and the winding numbers of cell corners, agree with
     * winding numbers that another method computes.
     */
    ebpo_verify_count labels;

    /* Each leaf lists all faces that intersect its cell; no list contains a face twice. */
    ebpo_verify_count lists;

    /* The mesh equals its source bitwise (options.source). */
    ebpo_verify_count source;

    /* Sums over all kinds. */
    uint64_t checks, violations;

    /*
     * spare_bytes: number of unused bytes of the file. Unused bytes are outside headers, chunk
     * directories and chunks. spare_filled: number of unused bytes that are not zero; 0 in files of
     * this library. Unused bytes change no result and are not violations. For remote files (http.h)
     * both are 0, because unused bytes are not read.
     */
    uint64_t spare_bytes, spare_filled;
} ebpo_verify_report;

#define EBPO_VERIFY_REPORT_INIT EBPO_SIZED(ebpo_verify_report)

/* Options of ebpo_verify. */
typedef struct ebpo_verify_options {
    size_t struct_size;

    /*
     * The source mesh as ebpo_mesh_read returns it, neither repaired nor arranged. The repairs that
     * the file records are applied to a copy of the source mesh, which is compared with the mesh in
     * the file. NULL: no source mesh is compared.
     */
    const ebpo_mesh *source;

    unsigned threads;

    /*
     * Number of cells whose labels (`labels` of ebpo_verify_report) are checked, at least one of
     * each level and type. 0 selects a default number: all cells if there are at most 2^22 cells,
     * otherwise 2^20 cells. If the checks of these cells would take more than a few seconds, the
     * default number is 4,096.
     */
    uint64_t label_samples;

    ebpo_progress progress;

    /* Workspace that limits memory and provides temporary files. NULL: no limit of memory. */
    ebpo_workspace *workspace;
} ebpo_verify_options;

#define EBPO_VERIFY_OPTIONS_INIT                                      \
    {                                                                 \
        sizeof(ebpo_verify_options), NULL, 0, 0, { NULL, NULL }, NULL \
    }

/*
 * Verifies an open file. EBPO_OK means that the verification was completed, even if the file has
 * violations; report->violations gives their number. If the file is too damaged to be read, this
 * counts as a violation of its structure.
 *
 * EBPO_E_ARGUMENT: the source mesh is not valid, or has been arranged. EBPO_E_IO.
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
