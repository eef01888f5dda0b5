/* EBP-Octree in HDF5: from a mesh to a tree. */
#ifndef EBPO_BUILD_H
#define EBPO_BUILD_H

#include <ebpo/file.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct ebpo_build_options {
    int max_level;          /* 0 .. 20, or -1: EBP 2017, equation 3 */
    uint32_t leaf_faces;    /* a node with at most so many faces becomes a leaf (BP 2008, 3.3.1); 0: only the maximum level stops */
    double epsilon;         /* a plane is kept while it removes at least this share of the cell; >= 0 */
    uint32_t parts;         /* ebpo_part bits to make; leaf planes only on request */
    ebpo_rule rule;
    bool require_solid;     /* EBPO_E_NOT_SOLID for a mesh that does not balance */
    unsigned threads;       /* 0: all cores; the result does not depend on it */
    const char *unit, *crs, *date; /* UTF-8 without control characters, or NULL */
    ebpo_progress progress;
} ebpo_build_options;
#define EBPO_BUILD_OPTIONS_INIT { -1, 16, 0.003, EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS, EBPO_RULE_NONZERO, \
                                  false, 0, NULL, NULL, NULL, { NULL, NULL } }

/* Builds the tree of a checked and perhaps mended mesh; `report` and `mend` are copied into the file's facts.
 * The mesh is consumed: its arrays are reordered into `out` (on failure it is freed all the same). */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_build(ebpo_tree *out, ebpo_mesh *mesh, const ebpo_mesh_report *report,
                                              const ebpo_mend_record *mend, const ebpo_build_options *options,
                                              ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
