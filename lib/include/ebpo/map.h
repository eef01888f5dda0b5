/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: maps of distance. A model's exact signed distances at the points of a plane,
 * of a grid or of another model, their statistics, and colours for them.
 *
 *   Distances     ebpo_map_points, ebpo_map_lattice
 *   Files         ebpo_map_write: HDF5 as VTK reads it, NRRD
 *   Two scans     ebpo_map_points of the one's vertices, ebpo_map_describe, ebpo_map_reach,
 *                 ebpo_map_paint
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

typedef struct ebpo_map_options {
    size_t struct_size; /* EBPO_MAP_OPTIONS_INIT sets it */

    /*
     * Points farther away, in the model's unit, get INFINITY; at least 0. Less work, as
     * nobody looks farther.
     */
    double max_distance;

    /* No signs. Surfaces have none anyway. */
    bool unsigned_distance;

    uint8_t reserved[3];

    /* 0: all cores. The result does not depend on it. */
    unsigned threads;

    ebpo_progress progress;
} ebpo_map_options;

#define EBPO_MAP_OPTIONS_INIT                                                      \
    {                                                                              \
        sizeof(ebpo_map_options), __builtin_inf(), false, { 0 }, 0, { NULL, NULL } \
    }

/*
 * The distances of points[count][3], each finite, into distances[count]: correctly rounded, and
 * negative inside a solid, as ebpo_distance gives them. Where not everything is in memory, points
 * are asked about along a curve, so that subtrees are loaded few times; that takes 24 bytes a
 * point.
 *
 * EBPO_E_ARGUMENT: a point or an option is no such thing; the point's number is told.
 * EBPO_E_ABSENT: the file has no mesh. EBPO_E_CANCELLED, EBPO_E_LIMIT, EBPO_E_MEMORY, and the
 * errors of reading. On failure, `distances` is unspecified.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_map_points(ebpo_model *model, const double *points,
                                                   uint64_t count, const ebpo_map_options *options,
                                                   double *distances, ebpo_error *error);

/*
 * Points in rows, columns and layers: origin + i step[0] + j step[1] + k step[2], each product and
 * each sum rounded in this order. A plane has count[2] == 1.
 */
typedef struct ebpo_lattice {
    double origin[3], step[3][3];
    uint64_t count[3]; /* at least 1 each; at most 2^40 points */
} ebpo_lattice;

/*
 * Points that fill a box: the first ones on its lower walls, the last ones on its upper ones; of an
 * axis with one point it is in the middle.
 *
 * EBPO_E_ARGUMENT: a count is 0, or the box is not finite or its low corner not below its high one.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_lattice_of_box(const double low[3], const double high[3],
                                                       const uint64_t count[3], ebpo_lattice *out,
                                                       ebpo_error *error);

/*
 * Lent until the function returns: values[layers][count[1]][count[0]], in the lattice's order; the
 * first of them is of layer `first`. Anything but EBPO_OK ends the map with that status; `error`
 * is then the function's to fill in.
 */
typedef ebpo_status (*ebpo_map_fn)(void *user, const double *values, uint64_t first,
                                   uint64_t layers, ebpo_error *error);

/*
 * The distances at a lattice's points, given to `take` layer by layer. Takes some layers' memory,
 * 8 bytes a point: about 64 MiB, or one layer if that is more.
 *
 * EBPO_E_ARGUMENT: also a lattice with points that are not finite, or too many. Else as
 * ebpo_map_points.
 *
 * Threads: any; `take` is called by one at a time, in order.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_map_lattice(ebpo_model *model, const ebpo_lattice *lattice,
                                                    const ebpo_map_options *options,
                                                    ebpo_map_fn take, void *user,
                                                    ebpo_error *error);

/* ---- statistics ---- */

/* Shares for which percentiles are told: 1, 5, 25, 50, 75, 95, 99 percent. */
enum { EBPO_MAP_PERCENTILES = 7 };

/* All but the counts are NAN where no value is finite. Lengths are in the model's unit. */
typedef struct ebpo_map_stats {
    size_t struct_size; /* EBPO_MAP_STATS_INIT sets it */

    /* How many values are finite; how many are not, as they are beyond max_distance. */
    uint64_t count, beyond;

    /* How many are below 0, and 0. */
    uint64_t inside, on;

    double min, max;

    /* The greatest without signs: the one-sided Hausdorff distance of the points. */
    double farthest;

    /* Of the signed values; of those without signs; root of the mean square; about the mean. */
    double mean, mean_unsigned, rms, deviation;

    /* The least value that so many percent of the finite ones do not exceed; with signs, and
     * without. */
    double percentile[EBPO_MAP_PERCENTILES], percentile_unsigned[EBPO_MAP_PERCENTILES];
} ebpo_map_stats;

#define EBPO_MAP_STATS_INIT EBPO_SIZED(ebpo_map_stats)

/*
 * Percents: 1, 5, 25, ... of EBPO_MAP_PERCENTILES. NAN for another index.
 *
 * Threads: any.
 */
EBPO_API double ebpo_map_percent(int index);

/*
 * Statistics of values[count]; sums do not depend on the order of what is added. Takes 8 bytes a
 * value.
 *
 * EBPO_E_ARGUMENT: `out` was not begun with its macro. EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_map_describe(const double *values, uint64_t count,
                                                     ebpo_map_stats *out, ebpo_error *error);

typedef struct ebpo_map_reach_options {
    size_t struct_size; /* EBPO_MAP_REACH_OPTIONS_INIT sets it */

    /* The bounds are refined until hi <= (1 + tolerance) lo. Above 0. */
    double tolerance;

    /* Stop after about so many distances beyond those of vertices. 0: 16 for each face. */
    uint64_t questions;

    unsigned threads; /* 0: all cores. The result does not depend on it. */

    uint32_t reserved;

    ebpo_progress progress;
} ebpo_map_reach_options;

#define EBPO_MAP_REACH_OPTIONS_INIT                                   \
    {                                                                 \
        sizeof(ebpo_map_reach_options), 0.01, 0, 0, 0, { NULL, NULL } \
    }

typedef struct ebpo_map_reach {
    size_t struct_size; /* EBPO_MAP_REACH_INIT sets it */

    /*
     * The one-sided Hausdorff distance, from all of the faces of the mesh to the model's faces, is
     * certainly within these bounds.
     */
    double lo, hi;

    /* A point of a face that is lo away. */
    double place[3];

    uint64_t questions;
} ebpo_map_reach;

#define EBPO_MAP_REACH_INIT EBPO_SIZED(ebpo_map_reach)

/*
 * How far a mesh's faces reach from a model's, insides of faces included: where vertices are close,
 * what is between them need not be.
 *
 * mesh        indices below vertex_count, finite coordinates
 * distances   [vertex_count] of its vertices, as ebpo_map_points gives them, all finite
 *
 * EBPO_E_ARGUMENT: an option, a distance or an index is no such thing. Else as ebpo_map_points.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_map_find_reach(ebpo_model *model, const ebpo_mesh *mesh,
                                                       const double *distances,
                                                       const ebpo_map_reach_options *options,
                                                       ebpo_map_reach *out, ebpo_error *error);

/* ---- colours ---- */

typedef enum ebpo_map_palette {
    /*
     * With signs: blue inside, orange outside, grey at 0; the lightness falls evenly with the
     * distance, for every eye.
     */
    EBPO_MAP_DIVERGING = 0,

    /* EBP 2017, section 4.4: black on the surface, red close to it, green near, blue far. */
    EBPO_MAP_THESIS = 1,
    EBPO_MAP_PALETTES
} ebpo_map_palette;

/*
 * "diverging", "thesis". A static string; NULL for other values.
 *
 * Threads: any.
 */
EBPO_API const char *ebpo_map_palette_name(ebpo_map_palette palette);

/*
 * sRGB of a distance: at `range` and beyond it is that of the end. Not finite: grey.
 *
 * range   above 0
 *
 * Threads: any.
 */
EBPO_API void ebpo_map_colour(ebpo_map_palette palette, double distance, double range,
                              uint8_t rgb[3]);

/*
 * Gives a mesh's vertices distances and colours, as attributes `distance` (float64) and `red`,
 * `green`, `blue` (uint8), in place of what it had of these names; ebpo_mesh_write_ply writes them.
 *
 * distances   [vertex_count]
 * range       above 0 and finite
 *
 * EBPO_E_ARGUMENT: palette or range is no such thing; or the mesh has more attributes than fit.
 * EBPO_E_MEMORY.
 *
 * Threads: one per mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_map_paint(ebpo_mesh *mesh, const double *distances,
                                                  ebpo_map_palette palette, double range,
                                                  ebpo_error *error);

/* ---- files ---- */

typedef enum ebpo_map_format {
    /*
     * HDF5, as VTKHDF 1.0 has an image: /VTKHDF/PointData/distance[count[2]][count[1]][count[0]] of
     * float64, with Origin, Spacing and Direction. Steps must be at right angles.
     */
    EBPO_MAP_VTKHDF = 0,

    /* NRRD 4, with its numbers behind the header as they are. */
    EBPO_MAP_NRRD = 1
} ebpo_map_format;

/*
 * Maps a lattice into a file, which appears whole or not at all. Values beyond max_distance are
 * INFINITY there, too.
 *
 * stats   without percentiles (NAN); or NULL
 *
 * EBPO_E_ARGUMENT: also a lattice that the format cannot hold. EBPO_E_IO. Else as ebpo_map_lattice.
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
