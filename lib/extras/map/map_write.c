/* Computes statistics of distances, and writes files of the distances at a lattice's points.
 *
 * Sums are exact (mesh/sum.h), so statistics depend neither on the order of values nor on the
 * number of threads. Small, ordinary and large values have separate sums, so that no square
 * overflows or underflows.
 *
 * A lattice is written layer by layer, as NRRD (teem, "Definition of NRRD File Format") or as a
 * VTKHDF 1.0 image (VTK's documentation, "VTKHDF file format"). Each format has a function that
 * begins the file and a function that writes layers; VTKHDF also has a function that ends the file.
 * The file is written under a temporary name first, and replaces an older file atomically. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/map.h>

#include "core/alloc.h"
#include "core/endian.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "hdf5_write/h5.h"
#include "io/publish.h"
#include "mesh/sum.h"

/* Each value is added to one of three bins, for small, ordinary and large absolute values. The
 * limits between the bins are 2^-400 and 2^400 (see add_to). The units of values in bins 0, 1 and 2
 * are 2^-MAP_BIN_UNIT, 1 and 2^MAP_BIN_UNIT. In the unit of its bin, every value except 0 has an
 * absolute value between 2^-474 and 2^424, so that its square is a normal number. */
enum { MAP_BINS = 3, MAP_BIN_UNIT = 600 };

/* The state of statistics while values are added. Percentiles are computed separately. */
typedef struct map_sums {
    ebpo_map_stats stats; /* only counts, min and max are set */
    /* Sums of the values in each bin, of their absolute values, and of their squares. The unit of
     * a sum of squares is the square of the bin's unit. */
    ebpo_sum sum[MAP_BINS], sum_unsigned[MAP_BINS], squares[MAP_BINS];
} map_sums;

/* A file that is written layer by layer. */
typedef struct map_file {
    const ebpo_lattice *lattice;
    const char *shown; /* name of the file for messages */
    const char *path;  /* for VTKHDF: name of the temporary file */
    FILE *stream;      /* for NRRD: the temporary file; NULL: not open */
    ebpo_h5_out out;   /* for VTKHDF: the temporary file */
    ebpo_h5_id values; /* for VTKHDF: the dataset of distances; -1: not open */
} map_file;

/* The percentiles of the statistics, in percent. */
static const double percents[EBPO_MAP_PERCENTILES] = { 1, 5, 25, 50, 75, 95, 99 };

double ebpo_map_percent(int index)
{
    return index >= 0 && index < EBPO_MAP_PERCENTILES ? percents[index] : NAN;
}

/* --- sums --- */

/* Returns new sums, which free() frees; NULL if memory is short. */
static map_sums *map_sums_new(void)
{
    map_sums *s = ebpo_alloc_zero(1, sizeof *s);
    if (s)
        s->stats = (ebpo_map_stats){ .min = INFINITY, .max = -INFINITY };
    return s;
}

/* Adds a value to one of the bins. The absolute value selects the bin, and the value is converted
 * to the bin's unit. square: adds the square of the value. */
static void add_to(ebpo_sum bins[MAP_BINS], double value, bool square)
{
    double size = fabs(value);
    int bin = size < 0x1p-400 ? 0 : size < 0x1p400 ? 1 : 2;
    double scaled = ldexp(value, -MAP_BIN_UNIT * (bin - 1));
    ebpo_sum_add(&bins[bin], square ? scaled * scaled : scaled);
}

/* Returns the sum of all bins divided by `count`, in the unit 2^unit. square: the bins have sums of
 * squares. */
static double mean_of(const ebpo_sum bins[MAP_BINS], bool square, uint64_t count, int unit)
{
    double sum = 0;
    for (int bin = 0; bin < MAP_BINS; bin++)
        sum += ldexp(ebpo_sum_value(&bins[bin]) / (double)count,
                     MAP_BIN_UNIT * (bin - 1) * (square ? 2 : 1) - unit);
    return sum;
}

/* Adds values; a value that is not finite is only counted. */
static void map_sums_add(map_sums *s, const double *values, uint64_t count)
{
    for (uint64_t i = 0; i < count; i++) {
        double d = values[i];
        if (!isfinite(d)) {
            s->stats.beyond++;
            continue;
        }
        s->stats.count++;
        s->stats.inside += d < 0;
        s->stats.on += d == 0;
        s->stats.min = fmin(s->stats.min, d);
        s->stats.max = fmax(s->stats.max, d);
        add_to(s->sum, d, false);
        add_to(s->sum_unsigned, fabs(d), false);
        add_to(s->squares, d, true);
    }
}

/* Returns the statistics of a map in which no value is finite: the counts of s, and NAN in all
 * members that are distances. */
static ebpo_map_stats stats_of_nothing(const ebpo_map_stats *s)
{
    ebpo_map_stats out = *s;
    out.min = out.max = out.farthest = out.mean = out.mean_unsigned = out.rms =
        out.standard_deviation = NAN;
    return out;
}

/* Returns the statistics of the values that have been added; percentiles are NAN. */
static ebpo_map_stats map_sums_stats(const map_sums *s)
{
    ebpo_map_stats out = s->stats.count ? s->stats : stats_of_nothing(&s->stats);
    for (int i = 0; i < EBPO_MAP_PERCENTILES; i++)
        out.percentile[i] = out.percentile_unsigned[i] = NAN;
    if (!out.count)
        return out;
    int unit; /* means are computed in the unit 2^unit, where no value is above 1 */
    out.farthest = fmax(fabs(out.min), fabs(out.max));
    frexp(out.farthest, &unit);
    double mean = mean_of(s->sum, false, out.count, unit),
           square = mean_of(s->squares, true, out.count, 2 * unit);
    out.mean = ldexp(mean, unit);
    out.mean_unsigned = ldexp(mean_of(s->sum_unsigned, false, out.count, unit), unit);
    out.rms = ldexp(sqrt(square), unit);
    out.standard_deviation = ldexp(sqrt(fmax(square - mean * mean, 0)), unit);
    return out;
}

/* --- percentiles --- */

/* Compares two values for qsort. */
static int compare_values(const void *x, const void *y)
{
    const double a = *(const double *)x, b = *(const double *)y;
    return (a > b) - (a < b);
}

/* Sorts values and computes their percentiles. The p-th percentile is the first value in sorted
 * order that has at least p percent of all values at or before it. */
static void pick_percentiles(double *values, uint64_t count, double out[EBPO_MAP_PERCENTILES])
{
    qsort(values, count, sizeof *values, compare_values);
    for (int i = 0; i < EBPO_MAP_PERCENTILES; i++) {
        double rank = ceil(percents[i] / 100 * (double)count);
        out[i] = values[rank < 1 ? 0 : (uint64_t)rank - 1];
    }
}

/* Computes the percentiles of the finite values, whose number is out->count. */
static ebpo_status add_percentiles(const double *values, uint64_t count, ebpo_map_stats *out,
                                   ebpo_error *error)
{
    double *finite = ebpo_alloc(out->count, sizeof *finite);
    uint64_t n = 0;
    if (!finite)
        return ebpo_fail_memory(error, out->count * sizeof *finite);
    for (uint64_t i = 0; i < count; i++)
        if (isfinite(values[i]))
            finite[n++] = values[i];
    pick_percentiles(finite, n, out->percentile);
    for (uint64_t i = 0; i < n; i++)
        finite[i] = fabs(finite[i]);
    pick_percentiles(finite, n, out->percentile_unsigned);
    free(finite);
    return EBPO_OK;
}

ebpo_status ebpo_map_describe(const double *values, uint64_t count, ebpo_map_stats *out,
                              ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_map_stats, out, error);
    if (status != EBPO_OK)
        return status;
    map_sums *sums = map_sums_new();
    if (!sums)
        return ebpo_fail_memory(error, sizeof *sums);
    map_sums_add(sums, values, count);
    ebpo_map_stats filled = map_sums_stats(sums);
    free(sums);
    if (filled.count)
        status = add_percentiles(values, count, &filled, error);
    if (status == EBPO_OK)
        status = EBPO_GIVE(ebpo_map_stats, out, &filled);
    return status;
}

/* --- NRRD: a header of text and raw numbers --- */

/* Writes a vector in the notation of NRRD. */
static void put_vector(FILE *to, const double v[3])
{
    fprintf(to, " (%.17g,%.17g,%.17g)", v[0], v[1], v[2]);
}

/* Writes the header of an NRRD file. */
static ebpo_status map_nrrd_begin(map_file *f, ebpo_error *error)
{
    const ebpo_lattice *l = f->lattice;
    FILE *to = f->stream;
    fprintf(to, "NRRD0004\n# signed distances of a model, as ebpo map writes them\ntype: double\n"
                "dimension: 3\nspace dimension: 3\n");
    fprintf(to, "sizes: %" PRIu64 " %" PRIu64 " %" PRIu64 "\n", l->count[0], l->count[1],
            l->count[2]);
    fprintf(to, "space directions:");
    for (int i = 0; i < 3; i++)
        put_vector(to, l->step[i]);
    fprintf(to, "\nspace origin:");
    put_vector(to, l->origin);
    fprintf(to, "\nkinds: space space space\ncenterings: node node node\nendian: little\n"
                "encoding: raw\n\n");
    return ferror(to) ? ebpo_fail_errno(error, f->shown, "writing the header") : EBPO_OK;
}

/* Writes the next layers to an NRRD file, as little-endian numbers. */
static ebpo_status map_nrrd_layers(map_file *f, const double *values, uint64_t first,
                                   uint64_t layers, ebpo_error *error)
{
    enum { BUFFER_VALUES = 512 };
    uint64_t count = layers * f->lattice->count[0] * f->lattice->count[1];
    (void)first; /* the layers follow those that have been written */
    for (uint64_t i = 0; i < count;) {
        uint8_t bytes[8 * BUFFER_VALUES];
        unsigned n = 0;
        for (; n < BUFFER_VALUES && i < count; n++, i++) {
            uint64_t bits;
            memcpy(&bits, &values[i], sizeof bits);
            ebpo_store64(bytes + 8 * n, bits);
        }
        if (fwrite(bytes, 8, n, f->stream) != n)
            return ebpo_fail_errno(error, f->shown, "writing");
    }
    return EBPO_OK;
}

/* --- VTKHDF: an image --- */

static const char values_path[] = "/VTKHDF/PointData/distance";

/* Returns the length of a vector, without overflow or underflow of squares. */
static double length_of(const double v[3])
{
    double most = fmax(fabs(v[0]), fmax(fabs(v[1]), fabs(v[2])));
    if (most == 0)
        return 0;
    double a = v[0] / most, b = v[1] / most, c = v[2] / most;
    return most * sqrt(a * a + b * b + c * c);
}

/* Computes the direction matrix of an image, whose columns are perpendicular unit vectors, and the
 * spacing of points along these vectors. */
static ebpo_status find_axes(const ebpo_lattice *l, double spacing[3], double direction[9],
                             ebpo_error *error)
{
    double axis[3][3];
    for (int i = 0; i < 3; i++) {
        spacing[i] = length_of(l->step[i]);
        if (!(spacing[i] > 0) || !isfinite(spacing[i]))
            return ebpo_fail(error, EBPO_E_ARGUMENT,
                             "VTKHDF needs steps along all three axes; write NRRD");
        for (int c = 0; c < 3; c++)
            axis[i][c] = l->step[i][c] / spacing[i];
    }
    for (int i = 0; i < 3; i++) {
        const double *a = axis[i], *b = axis[(i + 1) % 3];
        if (fabs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) > 1e-9) /* the cosine of the angle */
            return ebpo_fail(error, EBPO_E_ARGUMENT,
                             "VTKHDF needs steps at right angles; write NRRD");
        for (int c = 0; c < 3; c++)
            direction[3 * c + i] = axis[i][c];
    }
    return EBPO_OK;
}

/* Writes the attributes of an image to the group `id`. */
static ebpo_status put_image_attributes(map_file *f, ebpo_h5_id id, ebpo_error *error)
{
    static const int64_t version[2] = { 1, 0 };
    const ebpo_lattice *l = f->lattice;
    double spacing[3], direction[9];
    const int64_t extent[6] = { 0, (int64_t)l->count[0] - 1, 0, (int64_t)l->count[1] - 1,
                                0, (int64_t)l->count[2] - 1 };
    ebpo_status status = find_axes(l, spacing, direction, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_ints(&f->out, id, "Version", version, 2, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_ascii(&f->out, id, "Type", "ImageData", error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_ints(&f->out, id, "WholeExtent", extent, 6, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_real(&f->out, id, "Origin", l->origin, 3, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_real(&f->out, id, "Spacing", spacing, 3, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_real(&f->out, id, "Direction", direction, 9, error);
    return status;
}

/* Makes a group. with_attributes: writes the attributes of the image to the group. */
static ebpo_status put_group(map_file *f, const char *path, bool with_attributes, ebpo_error *error)
{
    ebpo_h5_id id = -1;
    ebpo_status status = ebpo_h5_make_plain_group(&f->out, path, &id, error);
    if (status == EBPO_OK && with_attributes)
        status = put_image_attributes(f, id, error);
    ebpo_h5_close_id(&f->out, id);
    return status;
}

/* Gets the lattice's dimensions in the order of a dataset in HDF5: the slowest axis (2) first. */
static void dims_of(const ebpo_lattice *l, uint64_t dims[3])
{
    for (int i = 0; i < 3; i++)
        dims[i] = l->count[2 - i];
}

/* Begins a VTKHDF file: writes the groups and makes the dataset of distances. */
static ebpo_status map_vtkhdf_begin(map_file *f, ebpo_error *error)
{
    uint64_t dims[3];
    dims_of(f->lattice, dims);
    ebpo_status status = ebpo_h5_create_plain(&f->out, f->path, f->shown, error);
    if (status == EBPO_OK)
        status = put_group(f, "/VTKHDF", true, error);
    if (status == EBPO_OK)
        status = put_group(f, "/VTKHDF/PointData", false, error);
    if (status == EBPO_OK)
        status = ebpo_h5_make_volume(&f->out, values_path, dims, &f->values, error);
    return status;
}

/* Writes layers to the dataset of distances. */
static ebpo_status map_vtkhdf_layers(map_file *f, const double *values, uint64_t first,
                                     uint64_t layers, ebpo_error *error)
{
    uint64_t dims[3];
    dims_of(f->lattice, dims);
    return ebpo_h5_put_layers(&f->out, values_path, f->values, dims, first, layers, values, error);
}

/* Closes the dataset and the file. */
static ebpo_status map_vtkhdf_end(map_file *f, ebpo_error *error)
{
    ebpo_h5_close_id(&f->out, f->values);
    f->values = -1;
    return ebpo_h5_finish(&f->out, error);
}

/* --- files of lattices --- */

typedef struct writing {
    map_file file;
    ebpo_map_format format;
    map_sums *sums; /* sums of the values that have been written, for the statistics */
} writing;

/* Writes layers whose distances ebpo_map_lattice has computed, and adds them to the statistics. */
static ebpo_status receive_layers(void *user, const double *values, uint64_t first, uint64_t layers,
                                  ebpo_error *error)
{
    writing *w = user;
    const ebpo_lattice *l = w->file.lattice;
    map_sums_add(w->sums, values, layers * l->count[0] * l->count[1]);
    return w->format == EBPO_MAP_NRRD ? map_nrrd_layers(&w->file, values, first, layers, error)
                                      : map_vtkhdf_layers(&w->file, values, first, layers, error);
}

/* Begins the temporary file in the chosen format. */
static ebpo_status write_begin(writing *w, ebpo_publish *publish, ebpo_error *error)
{
    w->file.shown = publish->shown;
    w->file.path = ebpo_publish_path(publish);
    if (w->format != EBPO_MAP_NRRD)
        return map_vtkhdf_begin(&w->file, error);
    w->file.stream = ebpo_publish_stream(publish);
    return w->file.stream ? map_nrrd_begin(&w->file, error) : ebpo_fail_memory(error, 4096);
}

ebpo_status ebpo_map_write(ebpo_model *model, const ebpo_lattice *lattice, const char *path,
                           ebpo_map_format format, const ebpo_map_options *options,
                           ebpo_map_stats *stats, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    writing w = { .file = { .lattice = lattice, .out = EBPO_H5_OUT_INIT, .values = -1 },
                  .format = format,
                  .sums = map_sums_new() };
    ebpo_publish publish = EBPO_PUBLISH_INIT;
    ebpo_status status = w.sums ? EBPO_OK : ebpo_fail_memory(error, sizeof *w.sums);
    if (status == EBPO_OK && stats)
        status = EBPO_CHECK_SIZED(ebpo_map_stats, stats, error);
    if (status == EBPO_OK && format != EBPO_MAP_NRRD && format != EBPO_MAP_VTKHDF)
        status = ebpo_fail(error, EBPO_E_ARGUMENT, "unknown format of maps");
    if (status == EBPO_OK)
        status = ebpo_publish_begin(&publish, path, error);
    if (status == EBPO_OK)
        status = write_begin(&w, &publish, error);
    if (status == EBPO_OK)
        status = ebpo_map_lattice(model, lattice, options, receive_layers, &w, error);
    if (status == EBPO_OK && format != EBPO_MAP_NRRD)
        status = map_vtkhdf_end(&w.file, error);
    ebpo_h5_close_id(&w.file.out, w.file.values);
    ebpo_h5_discard(&w.file.out);
    if (status == EBPO_OK)
        status = ebpo_publish_commit(&publish, error);
    ebpo_publish_abort(&publish);
    if (status == EBPO_OK && stats) {
        ebpo_map_stats filled = map_sums_stats(w.sums);
        status = EBPO_GIVE(ebpo_map_stats, stats, &filled);
    }
    free(w.sums);
    return status;
}
