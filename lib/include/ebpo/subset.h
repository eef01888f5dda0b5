/* SPDX-License-Identifier: MIT
 * Extracts a smaller file: selected levels, a box, selected parts, or a target size. The envelope
 * of a node is a convex polyhedron that contains the part of the solid in the node's cell.
 *
 *     ebpo_subset_options options = EBPO_SUBSET_OPTIONS_INIT;
 *     options.last_level = 5;
 *     options.parts = ebpo_profile_parts(EBPO_PROFILE_LOD);
 *     ebpo_subset(file, "small.ebpo.h5", &options, &error);
 *
 * `file` may be opened by a URL. In this case only the data that is kept is fetched.
 *
 * A gray node is a node with children. A subset can have *pruned* nodes, which are gray nodes
 * without children: their children in `file` are omitted, but their envelopes are kept. A leaf can
 * also become a pruned node (format-spec/README.md, section 7). Results from a subset are never
 * wrong. If a query needs missing data, a query with a level returns EBPO_MAYBE or a wider
 * interval, and an exact query returns EBPO_E_ABSENT.
 */
#ifndef EBPO_SUBSET_H
#define EBPO_SUBSET_H

#include <ebpo/file.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Sets of parts for common purposes. */
typedef enum ebpo_profile {
    /* All parts, for an archive. */
    EBPO_PROFILE_FULL = 0,

    /* Parts for a viewer: nodes, envelopes, stored leaf planes. */
    EBPO_PROFILE_LOD = 1,

    /*
     * Parts for exact queries: nodes, envelopes, mesh. Source indices and stored leaf planes are
     * omitted, but leaf planes can be derived from the mesh.
     */
    EBPO_PROFILE_COLLISION = 2
} ebpo_profile;

/*
 * Returns the parts of a profile, as ebpo_part bits.
 *
 * Threads: any.
 */
EBPO_API uint32_t ebpo_profile_parts(ebpo_profile profile);

/* Options of ebpo_subset. */
typedef struct ebpo_subset_options {
    size_t struct_size;

    /*
     * Levels 0 to last_level are kept. -1: all levels are kept. If the file is itself a subset,
     * last_level may be any level of the original file; all existing levels up to last_level are
     * kept.
     */
    int last_level;

    /*
     * True: target_bytes selects the parts, and `parts` is ignored. The profiles full, collision
     * and lod are tried in this order, without a max_error. The first profile with which the new
     * file fits is used. If no profile fits, the profile lod is used with a max_error.
     */
    bool choose_parts;

    /* True: omits data that does not intersect the closed box min .. max. */
    bool boxed;

    /* The box, in the model's unit: finite, min <= max on each axis. */
    double min[3], max[3];

    /*
     * ebpo_part bits: parts to keep. Parts that the file does not have are ignored. The new mesh
     * has only the faces in the lists of the kept leaves. Source indices and attributes are omitted
     * if the mesh is omitted.
     */
    uint32_t parts;

    /* As in ebpo_write_options. */
    ebpo_codec codec;
    int codec_level;

    /*
     * Nodes whose envelopes have at most this error bound are pruned (see ebpo_subset). In the
     * model's unit. 0: no nodes are pruned because of their error bound.
     */
    double max_error;

    /*
     * Maximum size of the new file in bytes. 0: no maximum size. If the file is too large without a
     * max_error, ebpo_subset searches for the least max_error with which the file is small enough,
     * and uses the result of the search. The result is at most 1 % too large. target_bytes and
     * max_error cannot be set together.
     */
    uint64_t target_bytes;

    unsigned threads;

    ebpo_progress progress;

    /* As in ebpo_write_options, for the faces of the subset. */
    uint64_t subtree_faces;

    /* As in ebpo_write_options. */
    ebpo_face_coding face_coding;
    int32_t reserved; /* 0 */
} ebpo_subset_options;

#define EBPO_SUBSET_OPTIONS_INIT                                                      \
    {                                                                                 \
        sizeof(ebpo_subset_options), -1, false, false, { 0, 0, 0 }, { 0, 0, 0 }, ~0u, \
            EBPO_CODEC_ZSTD, 0, 0, 0, 0, { NULL, NULL }, 0, EBPO_FACES_DEFAULT, 0     \
    }

/*
 * Estimates the memory, in bytes, that ebpo_subset needs with max_error or target_bytes. With these
 * options it loads the whole model into memory. The estimate uses measured numbers of bytes per
 * face, which depend on the number of faces per leaf.
 *
 * Threads: any.
 */
EBPO_API uint64_t ebpo_subset_memory(uint64_t face_count, uint32_t leaf_faces);

/*
 * Writes a subset of `file` to a file at `path`, which is replaced atomically. If everything is
 * kept, the new file has the content (content_sha256) of `file`. Needs memory for the result, and
 * up to 64 MiB for data that is read.
 *
 * Guarantee for every node that was pruned because of max_error: no point of the node's envelope,
 * including the interior, is farther than max_error from the solid and its faces (for a surface:
 * from its faces). `kept_error` of ebpo_info is this max_error. A leaf becomes a pruned gray node
 * if the intersection of the parent's envelope with the leaf's cell has an error bound of at most
 * max_error. The pruned node stores no planes, and its envelope is this intersection. Leaves that
 * are kept have the same error bound as in `file`, which may be larger than max_error. A smaller
 * max_error keeps all nodes that a larger max_error keeps. With max_error or target_bytes, the
 * whole model is loaded into memory (see ebpo_subset_memory).
 *
 * EBPO_E_ARGUMENT: one of these conditions is true.
 * - The level is not valid.
 * - The box has no points, or does not intersect the model's root cell.
 * - `file` is a subset that was made with a box, and the two boxes do not intersect.
 * - target_bytes is too small; the message gives the minimum.
 *
 * EBPO_E_ABSENT: max_error or target_bytes is set, and the file has no mesh or is a subset.
 * EBPO_E_IO: also if `path` is the path of `file`, and another program has replaced the file since
 * opening. Also the errors of reading (base.h).
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_subset(const ebpo_file *file, const char *path,
                                               const ebpo_subset_options *options,
                                               ebpo_error *error);

/*
 * Writes a subset of a tree. First the tree is written to a temporary file beside `path`, as by
 * ebpo_tree_write. Then ebpo_subset makes the subset of the temporary file. The tree is freed, also
 * on failure.
 *
 * Threads: one at a time per tree.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_subset_of_tree(ebpo_tree *tree, const char *path,
                                                       const ebpo_subset_options *options,
                                                       ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
