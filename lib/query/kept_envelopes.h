/* Envelopes that a context has cut, kept for its next questions: cutting one takes ten times what
 * looking for its nearest point does. One thread. */
#ifndef EBPO_QUERY_KEPT_ENVELOPES_H
#define EBPO_QUERY_KEPT_ENVELOPES_H

#include "geometry/cell.h"
#include "geometry/polytope.h"

typedef struct ebpo_kept_envelopes ebpo_kept_envelopes;

/* The envelope of the node with this cell, if it is there. */
bool ebpo_kept_envelopes_get(const ebpo_kept_envelopes *kept, ebpo_cell cell, ebpo_polytope *out);
/* Keeps it, in the place of another. *kept begins as NULL; without memory nothing is kept. */
void ebpo_kept_envelopes_put(ebpo_kept_envelopes **kept, ebpo_cell cell,
                             const ebpo_polytope *envelope);
void ebpo_kept_envelopes_free(ebpo_kept_envelopes *kept);

#endif
