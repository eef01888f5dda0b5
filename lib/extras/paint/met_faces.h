/* Inside lib/extras/paint: faces that several points reach, each once. */
#ifndef EBPO_PAINT_MET_FACES_H
#define EBPO_PAINT_MET_FACES_H

#include "extras/paint/reach.h"

typedef struct ebpo_met_face {
    double corner[3][3];
    uint64_t face, file_face;
    bool covered[3];
} ebpo_met_face;

typedef struct ebpo_met_faces {
    ebpo_met_face *face;
    uint64_t count, capacity;
    uint32_t *slot; /* by file_face: 0: free, else the number and 1 */
    uint64_t slots;
} ebpo_met_faces;

/* Finds a face, or adds it: its number. EBPO_E_LIMIT, EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_met_faces_add(ebpo_met_faces *met, const ebpo_reach_face *face,
                                             uint32_t *number, ebpo_error *error);
void ebpo_met_faces_free(ebpo_met_faces *met);

#endif
