/* Provides workspaces. A workspace keeps arrays in memory up to half of its budget, and further
 * arrays in temporary files. Also provides loops over such arrays; these loops release pages
 * (return memory to the system) as they proceed. */
#ifndef EBPO_CORE_WORKSPACE_H
#define EBPO_CORE_WORKSPACE_H

#include <ebpo/workspace.h>

/* Same as ebpo_workspace_new, but without a minimum of the budget, for tests that keep small models
 * in files. */
EBPO_MUST_USE ebpo_status ebpo_workspace_make_any(ebpo_workspace **out, uint64_t memory,
                                                  const char *temp_dir, ebpo_error *error);

/* Reports why the last allocation (of `bytes` bytes) failed. Returns EBPO_E_MEMORY, or EBPO_E_IO
 * with the folder in the message. */
ebpo_status ebpo_workspace_fail(const ebpo_workspace *workspace, uint64_t bytes, ebpo_error *error);
/* Same as ebpo_workspace_fail, for callers that do not know the size. `what` completes the message,
 * as in "while joining levels". */
ebpo_status ebpo_workspace_fail_while(const ebpo_workspace *workspace, const char *what,
                                      ebpo_error *error);

/* Returns the folder of the temporary files, shorter than EBPO_FOLDER_BYTES bytes and owned by the
 * workspace. */
enum { EBPO_FOLDER_BYTES = 4096 };
const char *ebpo_workspace_folder(const ebpo_workspace *workspace);
/* Returns the budget in bytes. */
uint64_t ebpo_workspace_memory(const ebpo_workspace *workspace);

/* Releases the pages of arrays in files if more than three quarters of the budget are in use; data
 * that were written stay in the file. Each thread calls this function whenever it has visited a few
 * megabytes. A call is cheap, and NULL is allowed. The loops EBPO_FOR_... and ebpo_parallel_for
 * call this function; other code, such as a recursion, must call it explicitly. */
void ebpo_release_pages(ebpo_workspace *workspace);

/* Numbers of items between two calls of ebpo_release_pages. EBPO_ITEMS_IN_ORDER: for arrays that
 * are visited in order. EBPO_ITEMS_SCATTERED: for loops in which an item may bring 16 pages into
 * memory. */
enum { EBPO_ITEMS_IN_ORDER = 1 << 15, EBPO_ITEMS_SCATTERED = 1 << 7 };

/* Loops over the items of large arrays. A workspace keeps arrays in files, whose visited pages stay
 * in memory until they are released. These loops release the pages, so the bodies of the loops need
 * not release them. A body may `continue`, `break` and return; `end` is evaluated once. If
 * `workspace` is NULL, a loop costs only one more test. */

/* Loops from `begin` to `end` - 1 with the variable `i`, a uint64_t. Releases pages whenever `i`
 * becomes a multiple of `every`, a power of two. For `every` items together, the body should visit
 * at most a few megabytes. */
#define EBPO_FOR_ITEMS_EVERY(workspace, every, i, begin, end) \
    for (uint64_t i = (begin), i##_end = (end); i < i##_end; ebpo_items_step(workspace, every, ++i))

/* A loop that visits arrays in order. */
#define EBPO_FOR_ITEMS(workspace, i, begin, end) \
    EBPO_FOR_ITEMS_EVERY(workspace, EBPO_ITEMS_IN_ORDER, i, begin, end)

/* A loop with scattered access: each item may bring 16 pages into memory. */
#define EBPO_FOR_ITEMS_SCATTERED(workspace, i, begin, end) \
    EBPO_FOR_ITEMS_EVERY(workspace, EBPO_ITEMS_SCATTERED, i, begin, end)

/* Loops over [0, end) in steps of `piece`, with the variable `at`. A piece should have a few
 * megabytes, or less if the work on it takes long. */
#define EBPO_FOR_PIECES(workspace, at, end, piece)         \
    for (uint64_t at = 0, at##_end = (end); at < at##_end; \
         at += (piece), ebpo_release_pages(workspace))

static inline void ebpo_items_step(ebpo_workspace *workspace, uint64_t every, uint64_t i)
{
    if (workspace && (i & (every - 1)) == 0)
        ebpo_release_pages(workspace);
}

/* --- arrays in memory or in temporary files --- */

/* Allocates count * size uninitialised bytes; if `workspace` is NULL, by malloc. Returns NULL if
 * the product is too large, an allocation fails or the disk is full; ebpo_workspace_fail reports
 * the reason. ebpo_array_free needs the same workspace, so an object that owns the array also keeps
 * a pointer to the workspace. */
void *ebpo_array_alloc(ebpo_workspace *workspace, uint64_t count, size_t size);
/* Same as ebpo_array_alloc, but sets all bytes to 0. */
void *ebpo_array_zero(ebpo_workspace *workspace, uint64_t count, size_t size);
/* Same as ebpo_grow, for workspace arrays. */
bool ebpo_array_grow(ebpo_workspace *workspace, void *array, uint64_t *capacity, uint64_t need,
                     size_t size);
/* Grows by ebpo_grow while the array is small (most arrays stay small), and by ebpo_array_grow once
 * the array is large. */
bool ebpo_array_grow_late(ebpo_workspace *workspace, void *array, uint64_t *capacity, uint64_t need,
                          size_t size);
/* Frees an array of `workspace`, or of malloc if `workspace` is NULL. A NULL array is allowed. */
void ebpo_array_free(ebpo_workspace *workspace, void *array);

/* Copies or fills arrays as memcpy and memset do, and releases pages meanwhile. */
void ebpo_array_copy(ebpo_workspace *workspace, void *to, const void *from, uint64_t bytes);
void ebpo_array_fill(ebpo_workspace *workspace, void *array, int byte, uint64_t bytes);

#endif
