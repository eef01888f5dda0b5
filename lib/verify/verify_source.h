/* The mesh in the file against the mesh that it was made from. */
#ifndef EBPO_VERIFY_VERIFY_SOURCE_H
#define EBPO_VERIFY_VERIFY_SOURCE_H

#include "verify/tally.h"

/* Does the recorded mending again on a copy of `source` and compares bit for bit. `stored`: the
 * file's mesh; `ordered`: it is in the source's order (else vertices and faces are compared as
 * multisets). NULL: the file is a subset; its faces and vertices, as those of a component's file,
 * are compared with those of their numbers in the source. Of a file whose coordinates an earlier
 * version rounded, that is the only violation. */
EBPO_MUST_USE ebpo_status ebpo_check_source(ebpo_tally *tally, const ebpo_file *file,
                                            const ebpo_mesh *stored, bool ordered,
                                            const ebpo_mesh *source, const ebpo_read_options *read,
                                            ebpo_error *error);

#endif
