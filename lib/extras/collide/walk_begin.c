/* Which kernels a walk uses. */
#include "extras/collide/pair_walk.h"

void ebpo_pair_walk_begin(ebpo_pair_walk *w, const ebpo_accel_pair *pair)
{
    w->pair = pair;
    w->kernels = ebpo_walk_kernels_best();
    w->filter = ebpo_pair_kernels_best();
    w->top = w->group = w->met_count = 0;
    w->begin = 0;
    w->end = pair->accel[0]->face_count;
    for (int i = 0; i < 2 * EBPO_TURNED_NODES; i++)
        w->turned[i / EBPO_TURNED_NODES][i % EBPO_TURNED_NODES].node = EBPO_NO_CHILD;
    ebpo_posed_faces_forget(w->posed);
}
