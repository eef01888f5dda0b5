/* What follows from a vector's arrays, for whoever writes a reader: the attributes of the root,
 * octcodes, cells, half-spaces and answers to questions about points. */
#ifndef NODES_JSON_H
#define NODES_JSON_H

#include <ebpo/file.h>

/* Whether a vector is small enough to be looked at by a person. */
bool nodes_json_fits(const ebpo_tree *tree);

/* The text, which the caller frees. `path`: the file that the tree was read from. */
char *nodes_json(const char *path, const ebpo_tree *tree);

#endif
