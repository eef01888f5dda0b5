/* EBP-Octree in HDF5: what no convex envelope can be better than. */
#ifndef EBPO_LIMIT_H
#define EBPO_LIMIT_H

#include <ebpo/file.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct ebpo_limit_options {
    size_t struct_size; /* EBPO_LIMIT_OPTIONS_INIT sets it */
    unsigned threads;   /* 0: all cores; the result does not depend on it */
    ebpo_progress progress;
} ebpo_limit_options;
#define EBPO_LIMIT_OPTIONS_INIT                       \
    {                                                 \
        sizeof(ebpo_limit_options), 0, { NULL, NULL } \
    }

typedef struct ebpo_limit {
    size_t struct_size; /* EBPO_LIMIT_INIT sets it */
    /* of the level: hulls of gray nodes and leaves, cells of black nodes (levels 0 .. level, as in
     * ebpo_lod_level); model's unit cubed */
    double volume;
    double gray_volume; /* the part of the level's gray nodes */
    uint64_t hulls;     /* computed */
    uint64_t flat;      /* of them without volume: their points lie in a plane, or nearly so */
} ebpo_limit;
#define EBPO_LIMIT_INIT EBPO_SIZED(ebpo_limit)

/* The volume of the convex hull of the solid in each cell (of a surface: of its faces there),
 * computed by qhull from the parts of faces in the cell and from its corners inside. Rounded, not
 * certified: a figure to compare with; infinite or 0 where a cell's volume is no normal double
 * (coordinates beyond about 1e102 or below 1e-102). EBPO_E_ABSENT without mesh, and where the
 * library was built without qhull (`-Dqhull`); EBPO_E_ARGUMENT: no such level. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_limit_level(const ebpo_file *file, int level,
                                                    const ebpo_limit_options *options,
                                                    ebpo_limit *out, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
