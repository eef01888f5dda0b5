/* The checksum of the part `attributes`. */
#ifndef EBPO_FORMAT_ATTRIBUTE_DIGEST_H
#define EBPO_FORMAT_ATTRIBUTE_DIGEST_H

#include "mesh/attributes.h"

EBPO_MUST_USE ebpo_status ebpo_attributes_digest(const ebpo_attributes *attributes,
                                                 uint8_t digest[32], ebpo_error *error);

#endif
