/* Computes exact distances of many points on many threads. */
#ifndef EBPO_MAP_MAP_LATTICE_H
#define EBPO_MAP_MAP_LATTICE_H

#include <ebpo/map.h>

enum {
    EBPO_MAP_THREADS = 256, /* greatest number of threads */
    EBPO_MAP_PIECE = 4096   /* greatest number of points in a call of ebpo_map_query */
};

/* The threads' query contexts for a model. */
typedef struct ebpo_map_queries {
    ebpo_model *model;
    ebpo_distance_options distance;          /* options of all queries */
    unsigned threads;                        /* number of threads, 1 to EBPO_MAP_THREADS */
    ebpo_context *context[EBPO_MAP_THREADS]; /* context of each thread, which is made at the
                                              * thread's first query; NULL: not made yet */
} ebpo_map_queries;

/* Prepares query contexts; `options` have been checked. The caller frees the contexts by
 * ebpo_map_queries_free, even after a failure. */
EBPO_MUST_USE ebpo_status ebpo_map_queries_make(ebpo_map_queries *out, ebpo_model *model,
                                                const ebpo_map_options *options, ebpo_error *error);
void ebpo_map_queries_free(ebpo_map_queries *queries);

/* Computes the distances of points[count][3] into results[count]; count <= EBPO_MAP_PIECE. worker:
 * index of the calling thread, which selects the thread's context. */
EBPO_MUST_USE ebpo_status ebpo_map_query(ebpo_map_queries *queries, unsigned worker,
                                         const double *points, uint64_t count,
                                         ebpo_distance_result *results, ebpo_error *error);

#endif
