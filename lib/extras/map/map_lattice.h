/* Computes exact distances of many points on many threads. */
#ifndef EBPO_MAP_MAP_LATTICE_H
#define EBPO_MAP_MAP_LATTICE_H

#include <ebpo/map.h>

/* Greatest number of threads, and of points in a call of ebpo_map_query. */
enum { EBPO_MAP_THREADS = 256, EBPO_MAP_PIECE = 4096 };

/* Query contexts. Each thread has one, which is made at its first query. */
typedef struct ebpo_map_queries {
    ebpo_model *model;
    ebpo_distance_options distance;
    unsigned threads;
    ebpo_context *context[EBPO_MAP_THREADS];
} ebpo_map_queries;

/* Prepares query contexts for checked options. The caller frees them by ebpo_map_queries_free, even
 * after a failure. */
EBPO_MUST_USE ebpo_status ebpo_map_queries_make(ebpo_map_queries *out, ebpo_model *model,
                                                const ebpo_map_options *options, ebpo_error *error);
void ebpo_map_queries_free(ebpo_map_queries *queries);

/* Computes the distances of points[count][3] into results[count]; count <= EBPO_MAP_PIECE. worker:
 * the index of the calling thread, which selects its context. */
EBPO_MUST_USE ebpo_status ebpo_map_query(ebpo_map_queries *queries, unsigned worker,
                                         const double *points, uint64_t count,
                                         ebpo_distance_result *results, ebpo_error *error);

#endif
