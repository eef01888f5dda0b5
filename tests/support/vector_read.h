/* Reads a whole vector file, and returns the result as two lines: status, message. The message
 * omits the folder. */
#ifndef VECTOR_READ_H
#define VECTOR_READ_H
#include "read_by.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/file.h>
#include <ebpo/subtree.h>
#include <ebpo/verify.h>

/* Opens each subtree by the file's table, if it has one. */
static inline ebpo_status vector_read_subtrees(const ebpo_file *file, const ebpo_tree *tree,
                                               ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    int last = ebpo_file_info(file)->subtree_level;
    uint64_t count = 1, *codes = calloc(1, sizeof *codes);
    for (int i = 0; i <= last; i++) {
        const ebpo_level *level = &tree->level[i];
        uint64_t found = 0, *next = malloc((level->gray_count + 1) * sizeof *next);
        for (uint64_t g = 0; g < count; g++)
            for (unsigned octant = 0; octant < (i ? 8 : 1); octant++)
                if ((level->types[g] >> 2 * octant & 3) == EBPO_GRAY)
                    next[found++] = i ? codes[g] << 3 | octant : 1;
        free(codes);
        codes = next;
        count = found;
    }
    for (uint64_t i = 0; i < count && last && status == EBPO_OK; i++) {
        ebpo_subtree *subtree = NULL;
        status = ebpo_subtree_open(file, codes[i], NULL, &subtree, error);
        ebpo_subtree_close(subtree);
    }
    free(codes);
    return status;
}

static inline ebpo_status vector_read(const char *path, ebpo_tree *tree, ebpo_error *error)
{
    ebpo_file *file;
    ebpo_status status = ebpo_open(path, &file, error);
    if (status != EBPO_OK)
        return status;
    status = ebpo_file_read_tree(file, READ_BY(1), tree, error);
    if (status == EBPO_OK)
        status = ebpo_file_check_content(file, READ_BY(1), error);
    if (status == EBPO_OK)
        status = vector_read_subtrees(file, tree, error);
    if (status != EBPO_OK)
        ebpo_tree_free(tree);
    ebpo_close(file);
    return status;
}

/* Writes the first violation that verifying finds, as two lines. Returns false if there is none. */
static inline bool vector_violation(const char *path, char *text, size_t size)
{
    ebpo_file *file;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_verify_report report = EBPO_VERIFY_REPORT_INIT;
    const ebpo_verify_count *const kinds[] = { &report.structure,   &report.content,
                                               &report.containment, &report.nesting,
                                               &report.labels,      &report.lists };
    const char *name = strrchr(path, '/') ? strrchr(path, '/') + 1 : path;
    *text = 0;
    if (ebpo_open(path, &file, &error) == EBPO_OK &&
        ebpo_verify(file, NULL, &report, &error) == EBPO_OK)
        for (size_t i = 0; i < sizeof kinds / sizeof *kinds && !*text; i++)
            if (kinds[i]->violations)
                snprintf(text, size, "violation\n%s: %s\n", name, kinds[i]->first);
    ebpo_close(file);
    return *text;
}

static inline void vector_outcome(const char *path, const ebpo_error *error, char *text,
                                  size_t size)
{
    const char *name = strrchr(path, '/') ? strrchr(path, '/') + 1 : path;
    const char *rest = strncmp(error->message, path, strlen(path)) == 0
                           ? error->message + strlen(path)
                           : error->message;
    snprintf(text, size, "%s\n%s%s\n", ebpo_status_name(error->status), name, rest);
}

#endif
