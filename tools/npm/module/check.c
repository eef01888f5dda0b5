/* Checks a whole file, for the WebAssembly module. */
#include <stdlib.h>

#include <ebpo/subtree.h>

#include "module.h"

/* Returns the octcodes of the gray nodes of `level`, and sets *count to their number. On entry,
 * codes[*count] are the octcodes of the gray nodes of the level above; this function frees them.
 * Returns NULL when out of memory. `root`: true: `level` is level 0. */
static uint64_t *next_codes(uint64_t *codes, uint64_t *count, const ebpo_level *level, bool root)
{
    uint64_t found = 0, *next = malloc((size_t)(level->gray_count + 1) * sizeof *next);
    for (uint64_t g = 0; g < *count && next; g++)
        for (unsigned octant = 0; octant < (root ? 1 : 8); octant++)
            if ((level->types[g] >> 2 * octant & 3) == EBPO_GRAY)
                next[found++] = root ? 1 : codes[g] << 3 | octant;
    free(codes);
    *count = found;
    return next;
}

/* Opens and closes each subtree, if the file has a table of subtrees. */
static ebpo_status check_subtrees(ebpo_js_object *object, const ebpo_tree *tree)
{
    int last = ebpo_file_info(object->file)->subtree_level;
    uint64_t count = 1, *codes = calloc(1, sizeof *codes);
    ebpo_status status = EBPO_OK;
    for (int i = 0; i <= last && codes; i++)
        codes = next_codes(codes, &count, &tree->level[i], i == 0);
    if (!codes)
        status = object->error.status = EBPO_E_MEMORY;
    for (uint64_t i = 0; i < count && last && status == EBPO_OK; i++) {
        ebpo_subtree *subtree = NULL;
        status = ebpo_subtree_open(object->file, codes[i], NULL, &subtree, &object->error);
        ebpo_subtree_close(subtree);
    }
    free(codes);
    return status;
}

/* Reads all arrays of the file, compares their content with its checksum, and opens all subtrees.
 */
int EBPO_JS(ebpo_js_check)(ebpo_js_object *object)
{
    ebpo_read_options options = EBPO_READ_OPTIONS_INIT;
    ebpo_tree tree = { 0 };
    options.threads = 1;
    ebpo_status status = ebpo_file_read_tree(object->file, &options, &tree, &object->error);
    if (status == EBPO_OK)
        status = ebpo_file_check_content(object->file, &options, &object->error);
    if (status == EBPO_OK)
        status = check_subtrees(object, &tree);
    ebpo_tree_free(&tree);
    return status;
}
