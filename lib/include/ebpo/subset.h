/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: a smaller file from a file. Levels, a box, parts, or as
 * much as fits.
 *
 *     ebpo_subset_options options = EBPO_SUBSET_OPTIONS_INIT;
 *     options.last_level = 5;
 *     options.parts = ebpo_profile_parts(EBPO_PROFILE_LOD);
 *     ebpo_subset(file, "small.ebpo.h5", &options, &error);
 *
 * `file` may have been opened by its URL: only what is kept is fetched.
 *
 * The tree is cut at gray nodes, which then are "pruned": they have their
 * envelopes, and no children (format-spec, section 5). Such a file never gives a
 * wrong answer. Where the cut matters, questions to a level answer EBPO_MAYBE or a
 * wider interval, and exact ones EBPO_E_ABSENT.
 */
#ifndef EBPO_SUBSET_H
#define EBPO_SUBSET_H

#include <ebpo/file.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Parts for a purpose. */
typedef enum ebpo_profile {
    /* Everything: for an archive. */
    EBPO_PROFILE_FULL = 0,

    /* What a viewer draws: nodes, envelopes, stored leaf planes. */
    EBPO_PROFILE_LOD = 1,

    /*
     * What exact questions need: nodes, envelopes, mesh. No maps, and no stored
     * leaf planes, which only spare deriving them.
     */
    EBPO_PROFILE_COLLISION = 2
} ebpo_profile;

/*
 * The parts of a profile, as bits of ebpo_part.
 *
 * Threads: any.
 */
EBPO_API uint32_t ebpo_profile_parts(ebpo_profile profile);

typedef struct ebpo_subset_options {
    size_t struct_size; /* EBPO_SUBSET_OPTIONS_INIT sets it */

    /*
     * Levels 0 to last_level are kept. -1: all. If the file is a subset, a level
     * that only the whole file may have had will do: all that is there is kept.
     */
    int last_level;

    /*
     * With target_bytes, instead of `parts`: the first of the profiles full,
     * collision and lod of which all fits, else lod with a max_error.
     */
    bool choose_parts;

    /* What does not meet the closed box min .. max is left out. */
    bool boxed;

    /* In the model's unit: finite, min <= max on each axis. */
    double min[3], max[3];

    /*
     * Bits of ebpo_part that are kept, of those the file has. Of the mesh, what
     * the kept leaves list. Without mesh there are no maps.
     */
    uint32_t parts;

    /* As in ebpo_write_options. */
    ebpo_codec codec;
    int codec_level;

    /*
     * Refine no further where the envelope certainly reaches at most so far
     * beyond the model, in the model's unit: the node is pruned. 0: refine
     * everywhere. See ebpo_subset.
     */
    double max_error;

    /*
     * Find the least max_error, to 1 %, with which the file has at most so many
     * bytes; none if all fits. 0: no target. Not together with max_error.
     */
    uint64_t target_bytes;

    /* 0: all cores. The result does not depend on it. */
    unsigned threads;

    ebpo_progress progress;

    /* As in ebpo_write_options; of the subset's faces. */
    uint64_t subtree_faces;

    /* As in ebpo_write_options. */
    ebpo_face_coding face_coding;
    int32_t reserved; /* 0 */
} ebpo_subset_options;

#define EBPO_SUBSET_OPTIONS_INIT                                                      \
    {                                                                                 \
        sizeof(ebpo_subset_options), -1, false, false, { 0, 0, 0 }, { 0, 0, 0 }, ~0u, \
            EBPO_CODEC_ZSTD, 0, 0, 0, 0, { NULL, NULL }, 0, EBPO_FACES_USUAL, 0       \
    }

/*
 * About how many bytes judging takes (max_error, target_bytes), for which the
 * whole model is opened in memory: measured, of a model of so many faces that was
 * built with so many faces a leaf.
 *
 * Threads: any.
 */
EBPO_API uint64_t ebpo_subset_memory(uint64_t face_count, uint32_t leaf_faces);

/*
 * Writes the subset of a file as a file, which appears whole or not at all. If
 * everything is kept, its content (content_sha256) is that of `file`. The result
 * is held in memory, and up to 64 MiB of what is read.
 *
 * What max_error promises, of every node that was pruned for it: what its
 * envelope covers, its inside included, is at most so far from the solid and its
 * faces (of a surface: from its faces), certainly. `kept_error` of ebpo_info
 * states it. Leaves become pruned nodes without planes of their own where their
 * parent's planes do; those that stay are as close as the file's leaves are, and
 * that may be less close. A smaller max_error keeps all that a larger one keeps.
 * The whole model is opened in memory, see ebpo_subset_memory.
 *
 * EBPO_E_ARGUMENT: no such level; a box without points, or one that does not meet
 * the model's root cell or the box that an earlier subset has kept; or a
 * target_bytes below what can be reached, which the message tells. EBPO_E_ABSENT:
 * max_error or target_bytes, and the file has no mesh or is a subset.
 * EBPO_E_IO: also where `path` is that of `file`, and another program has replaced
 * it since it was opened. EBPO_E_CANCELLED, EBPO_E_MEMORY, and the errors of reading.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_subset(const ebpo_file *file, const char *path,
                                               const ebpo_subset_options *options,
                                               ebpo_error *error);

/*
 * The subset of a tree that is in no file yet: the same bytes as from the file
 * that ebpo_tree_write would make of it, which is written beside `path` for the
 * time being. The tree is freed, also on failure.
 *
 * Threads: one per tree.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_subset_of_tree(ebpo_tree *tree, const char *path,
                                                       const ebpo_subset_options *options,
                                                       ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
