/* What an OBJ file says and a mesh made of it does not have, told from how its lines begin. */
#ifndef EBPO_IMPORT_OBJ_LOSSES_H
#define EBPO_IMPORT_OBJ_LOSSES_H

#include "attributes/attributes.h"

/* Smoothing groups, faces without a material before others with one, and what a material library
 * says beyond names. */
void ebpo_obj_note_losses(ebpo_attributes *attributes, const uint8_t *data, uint64_t size);

/* Whether it names groups or objects. */
bool ebpo_obj_names(const uint8_t *data, uint64_t size);

#endif
