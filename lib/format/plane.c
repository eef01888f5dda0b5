/* The public name of the plane code's decoder. */
#include <ebpo/file.h>

#include "geometry/plane_code.h"

bool ebpo_plane_decode(uint32_t code, int32_t n[3], int32_t *d)
{
    return ebpo_plane_code_decode(code, n, d);
}
