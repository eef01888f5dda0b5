/* EBP-Octree in HDF5: how much memory building, checking and verifying may use. */
#ifndef EBPO_WORKSPACE_H
#define EBPO_WORKSPACE_H

#include <ebpo/base.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The arrays of models that are read, built or verified. They are in memory while they fit into
 * half of what is allowed; what does not fit lies in files without a name in a folder for temporary
 * files (gone with the process, however it ends), mapped, and only so much of them is resident as
 * the budget allows. Results never depend on it. All functions may be called from any thread. */
typedef struct ebpo_workspace ebpo_workspace;

enum { EBPO_WORKSPACE_MIN = 128 << 20 }; /* bytes: less is refused */

typedef struct ebpo_workspace_options {
    size_t struct_size; /* EBPO_WORKSPACE_OPTIONS_INIT sets it */
    /* bytes that the whole process may have resident; 0: half of the machine's, or of what its
     * control group is allowed */
    uint64_t memory;
    const char *temp_dir; /* NULL: $TMPDIR, else /var/tmp; should lie on a disk, not in memory */
} ebpo_workspace_options;
#define EBPO_WORKSPACE_OPTIONS_INIT             \
    {                                           \
        sizeof(ebpo_workspace_options), 0, NULL \
    }

/* `options` may be NULL. EBPO_E_ARGUMENT for less memory than EBPO_WORKSPACE_MIN; EBPO_E_IO for a
 * folder that cannot be written to (looked at at once, so that it does not show after an hour). */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_workspace_new(const ebpo_workspace_options *options,
                                                      ebpo_workspace **out, ebpo_error *error);

/* After the last call that is given a mesh or tree made with it (or a file that keeps to it); these
 * themselves may be freed or closed later. NULL is fine. */
EBPO_API void ebpo_workspace_free(ebpo_workspace *workspace);

typedef struct ebpo_workspace_stats {
    size_t struct_size;       /* EBPO_WORKSPACE_STATS_INIT sets it */
    uint64_t memory;          /* the budget */
    uint64_t held, held_most; /* bytes of arrays in memory: now, at most */
    /* bytes of arrays in files: now, at most at one time, ever */
    uint64_t filed, filed_most, filed_total;
} ebpo_workspace_stats;
#define EBPO_WORKSPACE_STATS_INIT EBPO_SIZED(ebpo_workspace_stats)

EBPO_API ebpo_status ebpo_workspace_get_stats(const ebpo_workspace *workspace,
                                              ebpo_workspace_stats *out);

#ifdef __cplusplus
}
#endif
#endif
