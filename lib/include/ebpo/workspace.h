/* SPDX-License-Identifier: MIT
 * Limits the memory for reading, building and verifying.
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
 * Allocates the arrays of models that are read, built or verified. Arrays are in memory up to a
 * quarter of the budget, or up to half of it if the process needs little other memory. All other
 * arrays are in unnamed temporary files, which disappear with the process and are mapped into
 * memory. Their resident part stays within the budget. Results do not depend on the workspace.
 */
typedef struct ebpo_workspace ebpo_workspace;

/* Minimum budget, in bytes. */
enum { EBPO_WORKSPACE_MIN = 128000000 };

/* Options of ebpo_workspace_new. */
typedef struct ebpo_workspace_options {
    size_t struct_size;

    /*
     * Budget: maximum resident memory of the whole process, in bytes. 0: half of the memory of the
     * machine, or half of the memory of the process's control group if that is less.
     */
    uint64_t memory;

    /*
     * Folder for temporary files. It should be on a disk, not in memory. NULL: $TMPDIR, or /var/tmp
     * if TMPDIR is not set.
     */
    const char *temp_dir;
} ebpo_workspace_options;

#define EBPO_WORKSPACE_OPTIONS_INIT             \
    {                                           \
        sizeof(ebpo_workspace_options), 0, NULL \
    }

/*
 * Makes a workspace. EBPO_E_ARGUMENT: `memory` is below EBPO_WORKSPACE_MIN. EBPO_E_IO: the folder
 * is not writable.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_workspace_new(const ebpo_workspace_options *options,
                                                      ebpo_workspace **out, ebpo_error *error);

/*
 * Frees a workspace. Free all objects that use it first.
 *
 * Threads: one at a time per workspace.
 */
EBPO_API void ebpo_workspace_free(ebpo_workspace *workspace);

/* Statistics of a workspace; all sizes are in bytes. */
typedef struct ebpo_workspace_stats {
    size_t struct_size;

    /* The budget (memory of ebpo_workspace_options). */
    uint64_t memory;

    /* Total size of the arrays in memory. held: current size. held_peak: maximum so far. */
    uint64_t held, held_peak;

    /*
     * Total size of the arrays in files. filed: current size. filed_peak: maximum so far.
     * filed_total: sum over all arrays that were ever in a file.
     */
    uint64_t filed, filed_peak, filed_total;
} ebpo_workspace_stats;

#define EBPO_WORKSPACE_STATS_INIT EBPO_SIZED(ebpo_workspace_stats)

/*
 * Gets the statistics of a workspace.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_workspace_get_stats(const ebpo_workspace *workspace,
                                              ebpo_workspace_stats *out);

#ifdef __cplusplus
}
#endif
#endif
