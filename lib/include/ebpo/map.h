/* SPDX-License-Identifier: MIT
 * Computes maps of a model's exact signed distances at the points of a plane, a grid or another
 * model, with statistics and colours.
 *
 *   Distances     ebpo_map_points, ebpo_map_lattice
 *   Files         ebpo_map_write (HDF5 for VTK, NRRD)
 *   Two scans     ebpo_map_points (for the vertices of one scan), ebpo_map_describe,
 *                 ebpo_map_bound_hausdorff (bounds of the Hausdorff distance), ebpo_map_paint
 *   Colours       ebpo_map_colour
 *
 * Sources: BP 2008, figures 5.8 and 5.9; EBP 2017, section 4.4 and figures 90 to 92.
 */
#ifndef EBPO_MAP_H
#define EBPO_MAP_H

#include <ebpo/mesh.h>
#include <ebpo/query.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- distances ---- */

/* Options for computing maps. */
typedef struct ebpo_map_options {
    size_t struct_size;

    /*
     * Points that are farther away from the model than this get the value INFINITY. In the model's
     * unit; at least 0. A smaller distance is faster.
     */
    double max_distance;

    /*
     * True: distances have no signs. False: distances from a solid have signs; distances from a
     * surface have signs if the file has the part EBPO_PART_BORDER.
     */
    bool unsigned_distance;

    uint8_t reserved[3];

    unsigned threads;

    ebpo_progress progress;
} ebpo_map_options;

#define EBPO_MAP_OPTIONS_INIT                                                      \
    {                                                                              \
        sizeof(ebpo_map_options), __builtin_inf(), false, { 0 }, 0, { NULL, NULL } \
    }

/*
 * Computes the distances of points[count][3], each finite, into distances[count]. As in
 * ebpo_distance, the distances are correctly rounded, and negative inside a solid. If not
 * everything is in memory, points are sorted along a space-filling curve, so that each subtree is
 * loaded only a few times. Sorting takes 24 bytes per point.
 *
 * EBPO_E_ARGUMENT: an option or a point is not valid; the message has the index of the point.
 * EBPO_E_ABSENT: the file has no mesh. EBPO_E_LIMIT: the budget is too small (ebpo_model_new). Also
 * the errors of reading (base.h). On failure `distances` is unspecified.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_map_points(ebpo_model *model, const double *points,
                                                   uint64_t count, const ebpo_map_options *options,
                                                   double *distances, ebpo_error *error);

/*
 * Points in rows, columns and layers: origin + i step[0] + j step[1] + k step[2], where i, j and k
 * are from 0 to count[0] - 1, count[1] - 1 and count[2] - 1. Each product and each sum is rounded,
 * in this order. A plane has count[2] == 1.
 */
typedef struct ebpo_lattice {
    double origin[3], step[3][3];
    uint64_t count[3]; /* each at least 1; their product is at most 2^40 */
} ebpo_lattice;

/*
 * Makes a lattice that fills a box: on each axis, the first points are on the box's lower face, and
 * the last points are on the box's upper face. On an axis with one point, the point is in the
 * middle.
 *
 * EBPO_E_ARGUMENT: a count is 0, the box is not finite, or `low` is not below `high` on each axis.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_lattice_of_box(const double low[3], const double high[3],
                                                       const uint64_t count[3], ebpo_lattice *out,
                                                       ebpo_error *error);

/*
 * Callback that gets values[layers][count[1]][count[0]] of the lattice, from layer `first` on. The
 * values are valid until the callback returns. If the callback returns a status other than EBPO_OK,
 * it also fills in `error`, and the call ends with this status.
 */
typedef ebpo_status (*ebpo_map_fn)(void *user, const double *values, uint64_t first,
                                   uint64_t layers, ebpo_error *error);

/*
 * Computes the distances at a lattice's points and passes them to `take` by layers. Memory: about
 * 64 MiB, or one layer of 8 bytes per point if this is more.
 *
 * EBPO_E_ARGUMENT: also if a point of the lattice is not finite, or if there are too many points.
 * Other errors are those of ebpo_map_points.
 *
 * Threads: any; calls of `take` are sequential and in order.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_map_lattice(ebpo_model *model, const ebpo_lattice *lattice,
                                                    const ebpo_map_options *options,
                                                    ebpo_map_fn take, void *user,
                                                    ebpo_error *error);

/* ---- statistics ---- */

/* Number of percentiles: those of 1, 5, 25, 50, 75, 95 and 99 percent. */
enum { EBPO_MAP_PERCENTILES = 7 };

/*
 * Statistics of the values of a map. Lengths are in the model's unit. If no value is finite, all
 * members except the counts are NAN.
 */
typedef struct ebpo_map_stats {
    size_t struct_size;

    /*
     * count: number of finite values. beyond: number of values that are not finite, because the
     * point is beyond max_distance.
     */
    uint64_t count, beyond;

    /* inside: number of values below 0. on: number of values equal to 0. */
    uint64_t inside, on;

    /* Least and greatest value. */
    double min, max;

    /* Maximum absolute value: the one-sided Hausdorff distance of the points. */
    double farthest;

    /*
     * mean: mean of the values. mean_unsigned: mean of the absolute values. rms: root mean square
     * of the values. standard_deviation: standard deviation of the values.
     */
    double mean, mean_unsigned, rms, standard_deviation;

    /*
     * For each percentage (ebpo_map_percent): the least value v with the property that at least
     * this percentage of the finite values are <= v. percentile: for the values.
     * percentile_unsigned: for the absolute values.
     */
    double percentile[EBPO_MAP_PERCENTILES], percentile_unsigned[EBPO_MAP_PERCENTILES];
} ebpo_map_stats;

#define EBPO_MAP_STATS_INIT EBPO_SIZED(ebpo_map_stats)

/*
 * Returns the percentage of percentile[index] of ebpo_map_stats: 1, 5, 25, 50, 75, 95 or 99. NAN if
 * the index is out of range.
 *
 * Threads: any.
 */
EBPO_API double ebpo_map_percent(int index);

/*
 * Computes statistics of values[count]; sums do not depend on the order of values. Takes 8 bytes
 * per value.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_map_describe(const double *values, uint64_t count,
                                                     ebpo_map_stats *out, ebpo_error *error);

/* Options of ebpo_map_bound_hausdorff. */
typedef struct ebpo_map_hausdorff_options {
    size_t struct_size;

    /* Bounds are refined until hi <= (1 + tolerance) lo. The tolerance is above 0. */
    double tolerance;

    /*
     * The search stops after about this many distances have been computed. The given distances of
     * vertices do not count. 0: the search stops after 16 distances for each face.
     */
    uint64_t queries;

    unsigned threads; /* 0: all cores */

    uint32_t reserved;

    ebpo_progress progress;
} ebpo_map_hausdorff_options;

#define EBPO_MAP_HAUSDORFF_OPTIONS_INIT                                   \
    {                                                                     \
        sizeof(ebpo_map_hausdorff_options), 0.01, 0, 0, 0, { NULL, NULL } \
    }

/* Result of ebpo_map_bound_hausdorff. Lengths are in the model's unit. */
typedef struct ebpo_map_hausdorff {
    size_t struct_size;

    /*
     * Bounds of the one-sided Hausdorff distance from all faces of the mesh to the model's faces.
     */
    double lo, hi;

    /* Point on a face of the mesh, at distance lo from the model. */
    double location[3];

    /* Number of distances that were computed. */
    uint64_t queries;
} ebpo_map_hausdorff;

#define EBPO_MAP_HAUSDORFF_INIT EBPO_SIZED(ebpo_map_hausdorff)

/*
 * Bounds the maximum distance of a mesh's faces from a model's faces. The interiors of faces are
 * included, because they may be farther away than the vertices.
 *
 * mesh        mesh whose coordinates are finite
 * distances   [vertex_count] distances of its vertices from ebpo_map_points, all finite
 *
 * EBPO_E_ARGUMENT: an option, a distance or an index is not valid. Other errors are those of
 * ebpo_map_points.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_map_bound_hausdorff(
    ebpo_model *model, const ebpo_mesh *mesh, const double *distances,
    const ebpo_map_hausdorff_options *options, ebpo_map_hausdorff *out, ebpo_error *error);

/* ---- colours ---- */

/* Palette by which a distance gets a colour. */
typedef enum ebpo_map_palette {
    /*
     * Colours by signed distance: blue inside, orange outside, grey at 0. Lightness decreases
     * evenly with the absolute distance, also for colour-blind viewers.
     */
    EBPO_MAP_DIVERGING = 0,

    /*
     * Colours by absolute distance as in EBP 2017, section 4.4: black on the surface, and from red
     * over green to blue with increasing distance.
     */
    EBPO_MAP_THESIS = 1,

    /* Number of palettes. */
    EBPO_MAP_PALETTES
} ebpo_map_palette;

/*
 * Returns the name of a palette as a static string: "diverging" or "thesis". Returns NULL for
 * invalid values.
 *
 * Threads: any.
 */
EBPO_API const char *ebpo_map_palette_name(ebpo_map_palette palette);

/*
 * Gets the sRGB colour of a distance. The distance is clamped to -range .. range; `range` is above
 * 0. The colour of a distance that is not finite is grey.
 *
 * Threads: any.
 */
EBPO_API void ebpo_map_colour(ebpo_map_palette palette, double distance, double range,
                              uint8_t rgb[3]);

/*
 * Adds distances and colours of vertices to a mesh, as attributes `distance` (float64) and `red`,
 * `green`, `blue` (uint8). Attributes of these names are replaced. ebpo_mesh_write_ply writes the
 * attributes.
 *
 * distances   [vertex_count] distances of the vertices
 * range       as for ebpo_map_colour, and finite
 *
 * EBPO_E_ARGUMENT: palette or range is not valid, or the mesh has too many attributes.
 *
 * Threads: one at a time per mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_map_paint(ebpo_mesh *mesh, const double *distances,
                                                  ebpo_map_palette palette, double range,
                                                  ebpo_error *error);

/* ---- files ---- */

/* Format of the file of a map. */
typedef enum ebpo_map_format {
    /*
     * HDF5, as an image of VTKHDF 1.0: float64 array /VTKHDF/PointData/distance of shape
     * [count[2]][count[1]][count[0]], with Origin, Spacing and Direction. The steps of the lattice
     * must be at right angles.
     */
    EBPO_MAP_VTKHDF = 0,

    /* NRRD 4: one file with the header and the uncompressed values. */
    EBPO_MAP_NRRD = 1
} ebpo_map_format;

/*
 * Writes the map of a lattice to a file, which is replaced atomically. Values beyond max_distance
 * are INFINITY.
 *
 * stats   receives the statistics, in which percentiles are NAN; may be NULL
 *
 * EBPO_E_ARGUMENT: also if the format does not support the lattice. EBPO_E_IO. Other errors are
 * those of ebpo_map_lattice.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_map_write(ebpo_model *model, const ebpo_lattice *lattice,
                                                  const char *path, ebpo_map_format format,
                                                  const ebpo_map_options *options,
                                                  ebpo_map_stats *stats, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
