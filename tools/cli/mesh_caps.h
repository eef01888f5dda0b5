/* Closes the holes of a surface's mesh by caps, as format-spec/border.md defines them. */
#ifndef EBPO_TOOLS_MESH_CAPS_H
#define EBPO_TOOLS_MESH_CAPS_H

#include <ebpo/file.h>

/* Appends the caps of a file's border to a mesh of this file: vertices at the points of the loops,
 * and faces, each as often as its loop counts. Reads the whole tree. Frees and omits all other data
 * of the mesh. `path`: name of the file for messages. EBPO_E_ABSENT: the file has no border,
 * or is a subset. EBPO_E_LIMIT: more than 2^32 - 2 vertices or faces, or more caps than three times
 * the faces plus the points of the border. Also the errors of reading. */
EBPO_MUST_USE ebpo_status mesh_caps_add(ebpo_mesh *mesh, const ebpo_file *file, const char *path,
                                        unsigned threads, ebpo_error *error);

#endif
