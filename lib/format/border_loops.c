/* Reads, checks and encodes the border of a surface: closed loops of points with weights. The file
 * stores the coordinates of the points, coded like the vertices of the mesh. It does not store
 * indices of vertices, for two reasons. The vertices of a subset have other indices, and a reader
 * needs the points of all loops at once, without the mesh. Source: format-spec/border.md. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/endian.h"
#include "core/error.h"
#include "format/border_loops.h"
#include "format/reader.h"
#include "hdf5_read/coding.h"

/* Maximum number of coordinates of a chunk. */
enum { CHUNK_FLOATS = EBPO_CHUNK_BYTES_MAX / sizeof(float) };

void ebpo_border_loops_free(ebpo_border_loops *loops)
{
    free(loops->loop);
    free(loops->point);
    *loops = (ebpo_border_loops){ 0, 0, NULL, NULL };
}

/* Returns the text of the first error in the loops, or NULL. */
static const char *find_fault(const ebpo_info *info, const ebpo_border_loops *loops)
{
    uint64_t points = 0, longest = 0, weight = 0;
    for (uint64_t i = 0; i < loops->loop_count; i++) {
        uint64_t count = loops->loop[2 * i];
        if (count < 3 || count > loops->point_count - points || loops->loop[2 * i + 1] == 0)
            return "a loop has fewer than three points, more points than the header states, or the "
                   "weight 0";
        points += count;
        weight += count * loops->loop[2 * i + 1]; /* below 2^63, because count < 2^31 in all */
        longest = count > longest ? count : longest;
    }
    if (points != loops->point_count || longest != info->border_longest)
        return "the loops do not add up to the counts in the header";
    if (weight > EBPO_BORDER_WEIGHT_MAX)
        return "the weights of the loops are too large";
    for (uint64_t i = 0; i < 3 * points; i++)
        if (!isfinite(loops->point[i]))
            return "a coordinate is not a finite number";
    return NULL;
}

ebpo_status ebpo_check_border(const ebpo_check *check, const ebpo_info *info,
                              const ebpo_border_loops *loops, ebpo_error *error)
{
    bool missing = info->border_loops && (!loops->loop || !loops->point);
    const char *fault = loops->loop_count != info->border_loops ||
                                loops->point_count != info->border_points || missing
                            ? "the loops are missing"
                            : find_fault(info, loops);
    return fault ? ebpo_check_fail(check, -1, "/border/loops", fault, error) : EBPO_OK;
}

static ebpo_status take_points(void *context, const ebpo_array_in *array, uint64_t chunk,
                               uint64_t row, uint64_t rows, const uint8_t *bytes, ebpo_error *error)
{
    const ebpo_border_loops *loops = context;
    double *out = loops->point + 3 * row;
    (void)chunk;
    (void)error;
    if (array->shape.element_size == sizeof(double)) {
        ebpo_points64_decode(bytes, rows, out);
        return EBPO_OK;
    }
    float decoded[CHUNK_FLOATS];
    ebpo_points32_decode(bytes, rows, decoded);
    for (uint64_t i = 0; i < 3 * rows; i++)
        out[i] = (double)decoded[i];
    return EBPO_OK;
}

static ebpo_status take_loops(void *context, const ebpo_array_in *array, uint64_t chunk,
                              uint64_t row, uint64_t rows, const uint8_t *bytes, ebpo_error *error)
{
    const ebpo_border_loops *loops = context;
    (void)array;
    (void)chunk;
    (void)error;
    for (uint64_t i = 0; i < 2 * rows; i++)
        loops->loop[2 * row + i] = ebpo_load32(bytes + 4 * i);
    return EBPO_OK;
}

ebpo_status ebpo_border_read(const ebpo_file *file, ebpo_border_loops *out, ebpo_error *error)
{
    const ebpo_info *info = &file->info;
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_check check = ebpo_reader_check(file, NULL);
    ebpo_hints hints = EBPO_HINTS_INIT(file);
    read.threads = 1;
    if (info->subtree_level) { /* also prefetches the data that queries need first */
        ebpo_hint_top(file);
    } else {
        ebpo_hint_root(&hints, EBPO_NEEDS_BORDER);
        ebpo_hint_all(&hints);
    }
    *out =
        (ebpo_border_loops){ .loop_count = info->border_loops, .point_count = info->border_points };
    ebpo_status status = EBPO_OK;
    if (out->loop_count) { /* the file omits arrays without rows */
        out->loop = ebpo_alloc(out->loop_count, 2 * sizeof *out->loop);
        out->point = ebpo_alloc(out->point_count, 3 * sizeof *out->point);
        status = out->loop && out->point
                     ? EBPO_OK
                     : ebpo_fail_memory(error, out->point_count * 3 * sizeof *out->point);
        if (status == EBPO_OK)
            status = ebpo_reader_rows(file, ebpo_reader_array(file, EBPO_A_BORDER_LOOPS, 0), &read,
                                      take_loops, out, error);
        if (status == EBPO_OK)
            status = ebpo_reader_rows(file, ebpo_reader_array(file, EBPO_A_BORDER_POINTS, 0), &read,
                                      take_points, out, error);
    }
    if (status == EBPO_OK)
        status = ebpo_check_border(&check, info, out, error);
    if (status != EBPO_OK)
        ebpo_border_loops_free(out);
    return status;
}

void ebpo_border_encode(const ebpo_border_loops *loops, bool doubles, uint64_t row, uint64_t rows,
                        uint8_t *file)
{
    const double *from = loops->point + 3 * row;
    if (doubles) {
        ebpo_points64_encode(from, rows, file);
        return;
    }
    float floats[CHUNK_FLOATS];
    for (uint64_t i = 0; i < 3 * rows; i++)
        floats[i] = (float)from[i];
    ebpo_points32_encode(floats, rows, file);
}
