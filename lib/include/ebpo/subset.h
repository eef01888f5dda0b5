/* EBP-Octree in HDF5: a smaller file from a file. Levels, a box, parts.
 *
 *     ebpo_subset_options options = EBPO_SUBSET_OPTIONS_INIT;
 *     options.last_level = 5;
 *     options.parts = ebpo_profile_parts(EBPO_PROFILE_LOD);
 *     ebpo_subset(file, "small.ebpo.h5", &options, &error);      `file` may have been opened by its
 * URL: only what is kept is fetched
 *
 * What is left out of the tree is cut at gray nodes, which then are "pruned": they have their
 * envelopes, and no children (format-spec, section 5). Questions never get a wrong answer of such a
 * file: those to a level answer EBPO_MAYBE or a wider interval there, exact ones are answered where
 * what was kept decides, and EBPO_E_ABSENT where not.
 */
#ifndef EBPO_SUBSET_H
#define EBPO_SUBSET_H

#include <ebpo/file.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Parts for a purpose. */
typedef enum ebpo_profile {
    EBPO_PROFILE_FULL = 0, /* everything: for an archive */
    /* nodes, envelopes, stored leaf planes: what a viewer draws. No mesh, no maps */
    EBPO_PROFILE_LOD = 1,
    /* nodes, envelopes, mesh: what exact questions need. No maps, no stored leaf planes, which only
       spare deriving them */
    EBPO_PROFILE_COLLISION = 2
} ebpo_profile;

/* Bits of ebpo_part. */
EBPO_API uint32_t ebpo_profile_parts(ebpo_profile profile);

typedef struct ebpo_subset_options {
    size_t struct_size; /* EBPO_SUBSET_OPTIONS_INIT sets it */
    /* levels 0 .. last_level are kept; -1: all. Of a subset also a level that the whole file may
     * have had: all that is there */
    int last_level;
    /* with target_bytes, instead of `parts`: the first of the profiles full, collision, lod of
     * which all fits; else lod with a max_error */
    bool choose_parts;
    bool boxed;            /* what does not meet the closed box below is left out: */
    double min[3], max[3]; /* finite, min <= max on each axis; in the model's unit */
    /* ebpo_part bits that are kept, of those the file has. Of the mesh, what the leaves that are
     * kept list. No maps without mesh */
    uint32_t parts;
    ebpo_codec codec;
    int codec_level; /* as in ebpo_write_options */
    /* refine no further where the envelope certainly reaches at most so far beyond the model
     * (model's unit; see below): the node is pruned; 0: refine everywhere */
    double max_error;
    /* the least max_error (to 1 %) with which the file has at most so many bytes is found and used,
     * none if all fits; 0: not wanted. Not together with max_error */
    uint64_t target_bytes;
    unsigned threads; /* 0: all cores; the result does not depend on it */
    ebpo_progress progress;
} ebpo_subset_options;
#define EBPO_SUBSET_OPTIONS_INIT                                                      \
    {                                                                                 \
        sizeof(ebpo_subset_options), -1, false, false, { 0, 0, 0 }, { 0, 0, 0 }, ~0u, \
            EBPO_CODEC_ZSTD, 0, 0, 0, 0,                                              \
        {                                                                             \
            NULL, NULL                                                                \
        }                                                                             \
    }

/* max_error: the promise is that of every node pruned for it, and `info.kept_error` of the result
 * states it. What its envelope covers, its inside included, is at most so far from the solid and
 * its faces (of a surface: its faces), certainly. Leaves become pruned nodes without planes of
 * their own where their parent's planes do; those that stay are as close as the file's leaves are,
 * which may be farther. A smaller max_error keeps all that a larger one keeps. The whole model is
 * opened in memory: the file must have its mesh and be no subset, else EBPO_E_ABSENT. target_bytes:
 * EBPO_E_ARGUMENT tells the least size that can be reached, when that is larger. */

/* How many bytes of memory choosing by max_error or target_bytes takes, about (as measured, and
 * rather too many), for a model of `face_count` faces built with `leaf_faces`: for asking before
 * hours of building. Cannot fail; any thread. */
EBPO_API uint64_t ebpo_subset_memory(uint64_t face_count, uint32_t leaf_faces);

/* Writes the subset: whole or not at all. The result does not depend on threads; with everything
 * kept its content (content_sha256) is the source's. Reads what it needs and holds the result in
 * memory, and of the source up to 64 MiB beside it. `options` may be NULL: everything is kept. Any
 * thread; the file may be in use elsewhere. EBPO_E_IO, EBPO_E_FORMAT, EBPO_E_MEMORY,
 * EBPO_E_CANCELLED as everywhere. EBPO_E_ARGUMENT: no such level, a box without points, or one that
 * does not meet the model's root cell (or the box that an earlier subset has kept). */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_subset(const ebpo_file *file, const char *path,
                                               const ebpo_subset_options *options,
                                               ebpo_error *error);

/* The subset of a tree that is in no file yet: the same bytes as from the file that ebpo_tree_write
 * would make of it, which is written beside `path` for the while. The tree is consumed. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_subset_of_tree(ebpo_tree *tree, const char *path,
                                                       const ebpo_subset_options *options,
                                                       ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
