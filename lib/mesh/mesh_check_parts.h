/* The passes of ebpo_mesh_check. Each works on fixed blocks whose results are joined in order, so
 * the report does not depend on the number of threads. */
#ifndef EBPO_MESH_MESH_CHECK_PARTS_H
#define EBPO_MESH_MESH_CHECK_PARTS_H

#include <math.h>

#include <ebpo/findings.h>

#include "mesh/boundary.h"
#include "mesh/adjacency.h"
#include "mesh/sum.h"

/* The units of measurement. Along axis k, the unit of length is 2^exponent[k]. All exponents are 0
 * unless squares and cubes could leave the range of doubles. */
typedef struct ebpo_units {
    bool scaled;
    int exponent[3];
    int length, area, volume; /* exponents of the sums */
} ebpo_units;

/* A place that was found during the check, with indices in the current mesh: the vertices of an
 * edge, a vertex, or the index of a face. For a repeated face, `b` is the first face with its
 * vertices. */
typedef struct ebpo_found {
    uint32_t kind, location; /* as in ebpo_finding */
    uint32_t a, b;
} ebpo_found;

static inline bool ebpo_found_is_edge(uint32_t kind) { return kind <= EBPO_FOUND_UNBALANCED_EDGE; }

typedef struct ebpo_found_list {
    ebpo_found *item;
    uint64_t count, capacity;
    bool short_of_memory; /* some places are missing */
} ebpo_found_list;

typedef struct ebpo_check {
    const ebpo_mesh *mesh;
    unsigned threads; /* number of threads, not 0 */
    ebpo_progress progress;
    ebpo_mesh_report *report;
    uint32_t *parents; /* [vertex_count] union-find forest over vertices */
    ebpo_stars stars;
    ebpo_boundary boundary; /* all boundary edges, unordered */
    uint64_t referenced;    /* vertices that faces use */
    ebpo_units units;
    ebpo_found_list *found; /* [threads]; NULL: places are not requested */
} ebpo_check;

/* Returns the position in the units of measurement. */
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

/* Counts `place`, and stores it if it is among the lowest. */
static inline void ebpo_finding_add(ebpo_finding *finding, uint64_t place)
{
    int kept =
        finding->count < EBPO_FINDING_LOCATIONS ? (int)finding->count : EBPO_FINDING_LOCATIONS;
    finding->count++;
    if (kept == EBPO_FINDING_LOCATIONS && finding->locations[kept - 1] <= place)
        return;
    int i = kept < EBPO_FINDING_LOCATIONS ? kept : kept - 1;
    for (; i > 0 && finding->locations[i - 1] > place; i--)
        finding->locations[i] = finding->locations[i - 1];
    finding->locations[i] = place;
}

static inline void ebpo_finding_merge(ebpo_finding *finding, const ebpo_finding *other)
{
    uint64_t kept = other->count < EBPO_FINDING_LOCATIONS ? other->count : EBPO_FINDING_LOCATIONS;
    for (uint64_t i = 0; i < kept; i++)
        ebpo_finding_add(finding, other->locations[i]);
    finding->count += other->count - kept;
}

/* Adds a place to the worker's list. */
void ebpo_found_add(const ebpo_check *check, unsigned worker, ebpo_found found);

/* Counts a place, and stores it if all places are requested. */
static inline void ebpo_check_note(const ebpo_check *check, unsigned worker, ebpo_finding *finding,
                                   ebpo_finding_kind kind, uint64_t place, uint32_t a, uint32_t b)
{
    ebpo_finding_add(finding, place);
    if (check->found)
        ebpo_found_add(check, worker, (ebpo_found){ (uint32_t)kind, (uint32_t)place, a, b });
}

/* Fills in the report of a check that has its mesh, threads and report: the body of
 * ebpo_mesh_check. */
EBPO_MUST_USE ebpo_status ebpo_check_run(ebpo_check *check, ebpo_error *error);

/* Checks that every coordinate is finite. */
EBPO_MUST_USE ebpo_status ebpo_check_coordinates(ebpo_check *check, ebpo_error *error);
/* Computes the bounding box, the unit of measurement and unreferenced vertices; needs the stars. */
EBPO_MUST_USE ebpo_status ebpo_check_vertices(ebpo_check *check, ebpo_error *error);
/* Computes area, volume (relative to the box's centre), faces of zero area and repeated indices;
 * joins components. Needs the bounding box. */
EBPO_MUST_USE ebpo_status ebpo_check_faces(ebpo_check *check, ebpo_error *error);
/* Computes edges, bow-ties, repeated faces, the mean edge and the number of components; needs the
 * pass over faces. */
EBPO_MUST_USE ebpo_status ebpo_check_stars(ebpo_check *check, ebpo_error *error);
/* Finds repeated positions. */
EBPO_MUST_USE ebpo_status ebpo_check_positions(ebpo_check *check, ebpo_error *error);

#endif
