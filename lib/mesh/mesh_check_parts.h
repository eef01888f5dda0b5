/* Declares the passes of ebpo_mesh_check. Each pass works on blocks of fixed size, whose results
 * are joined in order, so the report does not depend on the number of threads. */
#ifndef EBPO_MESH_MESH_CHECK_PARTS_H
#define EBPO_MESH_MESH_CHECK_PARTS_H

#include <math.h>

#include <ebpo/findings.h>

#include "mesh/boundary.h"
#include "mesh/adjacency.h"
#include "mesh/sum.h"

/* The units of measurement. Along axis k, the unit of length is 2^exponent[k]. An exponent differs
 * from 0 only if squares or cubes of coordinates could leave the range of doubles. */
typedef struct ebpo_units {
    bool scaled; /* false: all exponents are 0 */
    int exponent[3];
    int length, area, volume; /* exponents of the units of lengths, areas and volumes */
} ebpo_units;

/* A location that was found during the check: a and b are indices in the current mesh. For an edge,
 * a and b are the two vertices of the edge. For a vertex or a face, a and b are equal. For a
 * repeated face, `b` is the first face with the same vertices. */
typedef struct ebpo_found {
    uint32_t kind;     /* ebpo_finding_kind */
    uint32_t location; /* source index, as in ebpo_finding.locations */
    uint32_t a, b;
} ebpo_found;

static inline bool ebpo_found_is_edge(uint32_t kind) { return kind <= EBPO_FOUND_UNBALANCED_EDGE; }

typedef struct ebpo_found_list {
    ebpo_found *item;
    uint64_t count, capacity;
    bool short_of_memory; /* true: some locations are missing */
} ebpo_found_list;

typedef struct ebpo_check {
    const ebpo_mesh *mesh;
    unsigned threads; /* number of threads, not 0 */
    ebpo_progress progress;
    ebpo_mesh_report *report;
    uint32_t *parents; /* [vertex_count] disjoint sets of vertices (core/disjoint_sets.h) */
    ebpo_stars stars;
    ebpo_boundary boundary; /* all boundary edges, unordered */
    uint64_t referenced;    /* number of vertices that faces use */
    ebpo_units units;
    ebpo_found_list *found; /* [threads]; NULL: locations are not requested */
} ebpo_check;

/* Writes the position of a vertex in the units of measurement. */
static inline void ebpo_check_position(const ebpo_check *check, uint64_t vertex, double out[3])
{
    ebpo_mesh_position(check->mesh, vertex, out);
    if (check->units.scaled)
        for (int k = 0; k < 3; k++)
            out[k] = ldexp(out[k], -check->units.exponent[k]);
}

/* Returns the length of a vector whose component k is d[k] 2^exponent[k], in units of 2^unit. */
static inline double ebpo_scaled_length(const double d[3], const int exponent[3], int unit)
{
    double x[3], most = 0, sum = 0;
    for (int k = 0; k < 3; k++) {
        x[k] = ldexp(d[k], exponent[k] - unit);
        most = fmax(most, fabs(x[k]));
    }
    for (int k = 0; k < 3 && most > 0; k++)
        sum += x[k] / most * (x[k] / most);
    return most * sqrt(sum);
}

/* Counts a location, and stores it if it is among the EBPO_FINDING_LOCATIONS lowest locations. */
static inline void ebpo_finding_add(ebpo_finding *finding, uint64_t location)
{
    int kept =
        finding->count < EBPO_FINDING_LOCATIONS ? (int)finding->count : EBPO_FINDING_LOCATIONS;
    finding->count++;
    if (kept == EBPO_FINDING_LOCATIONS && finding->locations[kept - 1] <= location)
        return;
    int i = kept < EBPO_FINDING_LOCATIONS ? kept : kept - 1;
    for (; i > 0 && finding->locations[i - 1] > location; i--)
        finding->locations[i] = finding->locations[i - 1];
    finding->locations[i] = location;
}

/* Adds the count and the locations of another block's finding. */
static inline void ebpo_finding_merge(ebpo_finding *finding, const ebpo_finding *other)
{
    uint64_t kept = other->count < EBPO_FINDING_LOCATIONS ? other->count : EBPO_FINDING_LOCATIONS;
    for (uint64_t i = 0; i < kept; i++)
        ebpo_finding_add(finding, other->locations[i]);
    finding->count += other->count - kept;
}

/* Adds a location to the worker's list. When out of memory, only sets list.short_of_memory. */
void ebpo_found_add(const ebpo_check *check, unsigned worker, ebpo_found found);

/* Counts a location, and adds it to the worker's list if all locations are requested. `location`:
 * the index in the report. */
static inline void ebpo_check_note(const ebpo_check *check, unsigned worker, ebpo_finding *finding,
                                   ebpo_finding_kind kind, uint64_t location, uint32_t a,
                                   uint32_t b)
{
    ebpo_finding_add(finding, location);
    if (check->found)
        ebpo_found_add(check, worker, (ebpo_found){ (uint32_t)kind, (uint32_t)location, a, b });
}

/* Fills in the report of a check whose mesh, threads and report are set. ebpo_check_run is the body
 * of ebpo_mesh_check. */
EBPO_MUST_USE ebpo_status ebpo_check_run(ebpo_check *check, ebpo_error *error);

/* Checks that every coordinate is finite. */
EBPO_MUST_USE ebpo_status ebpo_check_coordinates(ebpo_check *check, ebpo_error *error);
/* Computes the bounding box and the units of measurement, and finds unreferenced vertices.
 * check->stars must exist. */
EBPO_MUST_USE ebpo_status ebpo_check_vertices(ebpo_check *check, ebpo_error *error);
/* Computes the area and the volume (relative to the box's centre), finds faces of zero area and
 * with repeated indices, and joins components. ebpo_check_vertices must have been called. */
EBPO_MUST_USE ebpo_status ebpo_check_faces(ebpo_check *check, ebpo_error *error);
/* Counts edges. Finds edges with findings, bow-ties (vertices whose faces form several fans) and
 * repeated faces. Computes the mean edge and the number of components. ebpo_check_faces must have
 * been called. */
EBPO_MUST_USE ebpo_status ebpo_check_stars(ebpo_check *check, ebpo_error *error);
/* Finds repeated positions. */
EBPO_MUST_USE ebpo_status ebpo_check_positions(ebpo_check *check, ebpo_error *error);

#endif
