/* Reads and checks the part `border` of a file: the border of a surface as closed loops of points.
 */
#ifndef EBPO_FORMAT_BORDER_LOOPS_H
#define EBPO_FORMAT_BORDER_LOOPS_H

#include "format/file_in.h"

/* Maximum of the sum of points times weight over all loops (RK.3). A segment crosses each cap at
 * most once, so sums of 32 bits hold the crossings of a path of three segments with all caps. */
enum { EBPO_BORDER_WEIGHT_MAX = 1 << 28 };

/* Reads and checks the loops of a file with EBPO_PART_BORDER. `out` is cleared on failure. */
EBPO_MUST_USE ebpo_status ebpo_border_read(const ebpo_file *file, ebpo_border_loops *out,
                                           ebpo_error *error);

/* Checks the loops against the counts of the header. */
EBPO_MUST_USE ebpo_status ebpo_check_border(const ebpo_check *check, const ebpo_info *info,
                                            const ebpo_border_loops *loops, ebpo_error *error);

/* Encodes rows [row, row + rows) of /border/points. */
void ebpo_border_encode(const ebpo_border_loops *loops, bool doubles, uint64_t row, uint64_t rows,
                        uint8_t *file);

void ebpo_border_loops_free(ebpo_border_loops *loops);

#endif
