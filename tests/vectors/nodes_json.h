/* Derives data from the arrays of a vector, for authors of readers: the attributes of the root,
 * octcodes, cells, half-spaces and results of point queries. */
#ifndef NODES_JSON_H
#define NODES_JSON_H

#include <ebpo/file.h>

/* Returns true when a vector is small enough for people to read. */
bool nodes_json_fits(const ebpo_tree *tree);

/* Returns the text, which the caller frees. `path`: the file of the tree. */
char *nodes_json(const char *path, const ebpo_tree *tree);

#endif
