/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: how much memory reading, building and verifying may use.
 *
 *     ebpo_workspace_options options = EBPO_WORKSPACE_OPTIONS_INIT;
 *     ebpo_mesh_read_options read = EBPO_MESH_READ_OPTIONS_INIT;
 *     options.memory = UINT64_C(4) << 30;
 *     ebpo_workspace_new(&options, &workspace, &error);
 *     read.workspace = workspace;
 *     ebpo_mesh_read("large.ply", &read, &mesh, &error);
 */
#ifndef EBPO_WORKSPACE_H
#define EBPO_WORKSPACE_H

#include <ebpo/base.h>

#ifdef __cplusplus
extern "C" {
#endif

/*
 * The arrays of models that are read, built or verified. They are in memory while
 * they fit into half of what is allowed. The others lie in temporary files
 * without a name, which are gone with the process however it ends. These are
 * mapped, and only as much of them is resident as the budget allows.
 *
 * Results never depend on it.
 */
typedef struct ebpo_workspace ebpo_workspace;

/* Fewer bytes of memory are refused. */
enum { EBPO_WORKSPACE_MIN = 128000000 };

typedef struct ebpo_workspace_options {
    size_t struct_size; /* EBPO_WORKSPACE_OPTIONS_INIT sets it */

    /*
     * Bytes that the whole process may have resident. 0: half of the machine's
     * memory, or of what its control group is allowed.
     */
    uint64_t memory;

    /*
     * The folder for temporary files, which should lie on a disk, not in memory.
     * NULL: $TMPDIR, else /var/tmp.
     */
    const char *temp_dir;
} ebpo_workspace_options;

#define EBPO_WORKSPACE_OPTIONS_INIT             \
    {                                           \
        sizeof(ebpo_workspace_options), 0, NULL \
    }

/*
 * EBPO_E_ARGUMENT: less memory than EBPO_WORKSPACE_MIN. EBPO_E_IO: a folder that
 * cannot be written to, which is found out at once and not after an hour.
 * EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_workspace_new(const ebpo_workspace_options *options,
                                                      ebpo_workspace **out, ebpo_error *error);

/*
 * After everything that was made with it has been freed. NULL is fine.
 *
 * Threads: one per workspace.
 */
EBPO_API void ebpo_workspace_free(ebpo_workspace *workspace);

/* Bytes. */
typedef struct ebpo_workspace_stats {
    size_t struct_size; /* EBPO_WORKSPACE_STATS_INIT sets it */

    /* The budget. */
    uint64_t memory;

    /* Of arrays in memory: now, and at most. */
    uint64_t held, held_peak;

    /* Of arrays in files: now, at most at one time, and summed over all. */
    uint64_t filed, filed_peak, filed_total;
} ebpo_workspace_stats;

#define EBPO_WORKSPACE_STATS_INIT EBPO_SIZED(ebpo_workspace_stats)

/*
 * EBPO_E_ARGUMENT: `out` was not begun with its macro.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_workspace_get_stats(const ebpo_workspace *workspace,
                                              ebpo_workspace_stats *out);

#ifdef __cplusplus
}
#endif
#endif
