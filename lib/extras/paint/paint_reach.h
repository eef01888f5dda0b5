/* Finds the reach of a point: the faces that are connected with the point's face within the point's
 * ball (format-spec/paint.md, section 4). */
#ifndef EBPO_PAINT_PAINT_REACH_H
#define EBPO_PAINT_PAINT_REACH_H

#include <ebpo/query.h>

#include "extras/paint/paint_parts.h"

/* A face in or near the ball. */
typedef struct ebpo_reach_face {
    double corner[3][3];
    uint64_t face, file_face; /* as in ebpo_paint_face */
    uint32_t at[3];           /* indices of the face's corners among the positions */
    bool within[3];           /* [corner] the corner is within the ball */
} ebpo_reach_face;

/* A position of corners; equal corners have one position. */
typedef struct ebpo_reach_position {
    double p[3];
    bool within;
} ebpo_reach_position;

/* An edge that intersects the ball although both its ends are outside the ball. */
typedef struct ebpo_reach_edge {
    uint32_t a, b; /* indices of the two positions, a < b */
} ebpo_reach_edge;

/* State for evaluating many points one after the other, in one thread. */
typedef struct ebpo_reach_search {
    ebpo_context *context;
    double tolerance;      /* maximum distance of a point from its face */
    ebpo_reach_face *face; /* [count] faces around the ball; after ebpo_reach_find only the faces of
                            * the reach, in the order of the file */
    uint64_t count, capacity;
    uint64_t own; /* index in `face` of the point's face */
    ebpo_reach_position *position;
    ebpo_reach_edge *edge;
    uint64_t position_count, position_capacity, edge_count, edge_capacity;
    uint32_t *slot; /* [slots] hash table, first of positions, then of edges; an entry is 0 (free)
                     * or an index plus 1 */
    uint32_t *root; /* union-find sets of faces, positions and edges, in this order. An entry is the
                       index of another member of the same set. The entry of the set's
                       representative is its own index. */
    uint64_t slots, slot_capacity, root_capacity;
    bool short_of_memory, too_many; /* the reason why gathering faces failed */
} ebpo_reach_search;

/* A ball around a point, with the point's face. */
typedef struct ebpo_reach_ball {
    double place[3], radius;
    uint64_t face;
} ebpo_reach_ball;

void ebpo_reach_begin(ebpo_reach_search *reach, ebpo_context *context);
void ebpo_reach_end(ebpo_reach_search *reach);

/* Finds the reach of a ball. *complete is false, and there is no result, if the model's file is a
 * subset that omits the ball's face or some of the faces around the ball. Fails with EBPO_E_FORMAT
 * if the ball's centre is not on its face, and with EBPO_E_LIMIT, EBPO_E_MEMORY and the errors of
 * reading. */
EBPO_MUST_USE ebpo_status ebpo_reach_find(ebpo_reach_search *reach, const ebpo_reach_ball *ball,
                                          bool *complete, ebpo_error *error);

/* Sets *fits to false if a position is not on the face. *fits is also true if the position cannot
 * be tested, because the model's file is a subset without this face or without faces around it. */
EBPO_MUST_USE ebpo_status ebpo_reach_check(ebpo_reach_search *reach, const double place[3],
                                           uint64_t face, bool *fits, ebpo_error *error);

/* Returns true if q is within the ball with this centre; square: the square of its radius. Computed
 * as format-spec/paint.md, section 4, requires. */
static inline bool ebpo_ball_holds(const double centre[3], double square, const double q[3])
{
    double x = q[0] - centre[0], y = q[1] - centre[1], z = q[2] - centre[2];
    return (x * x + y * y) + z * z <= square;
}

/* --- the faces in the reaches of several points, each once --- */

typedef struct ebpo_found_face {
    double corner[3][3];
    uint64_t face, file_face;
    bool covered[3]; /* [corner] the ball of a point contains the corner */
} ebpo_found_face;

typedef struct ebpo_found_faces {
    ebpo_found_face *face;
    uint64_t count, capacity;
    uint32_t *slot; /* hash table by file_face; an entry is 0 (free) or the index plus 1 */
    uint64_t slots;
} ebpo_found_faces;

/* Finds or adds a face, and sets *number to its index. Fails with EBPO_E_LIMIT, EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_found_faces_add(ebpo_found_faces *found_faces,
                                               const ebpo_reach_face *face, uint32_t *number,
                                               ebpo_error *error);
void ebpo_found_faces_free(ebpo_found_faces *found_faces);

/* --- the reach of a stroke's point --- */

/* Returns the ball of point `i` of a stroke. */
static inline ebpo_reach_ball ebpo_paint_ball(const ebpo_paint *p, uint64_t stroke, uint32_t i)
{
    const ebpo_stroke_data *s = &p->stroke[stroke];
    const ebpo_paint_point *q = &p->point[s->first + i];
    return (ebpo_reach_ball){ { q->place[0], q->place[1], q->place[2] },
                              ebpo_paint_radius(s, q),
                              q->face };
}

/* Finds the reach of point `i` of a stroke, as ebpo_reach_find does. */
EBPO_MUST_USE static inline ebpo_status ebpo_paint_reach(ebpo_reach_search *reach,
                                                         const ebpo_paint *p, uint64_t stroke,
                                                         uint32_t i, bool *complete,
                                                         ebpo_error *error)
{
    ebpo_reach_ball ball = ebpo_paint_ball(p, stroke, i);
    return ebpo_reach_find(reach, &ball, complete, error);
}

/* --- the reaches of many points, found on all cores and returned one by one --- */

typedef struct ebpo_reach_result_face {
    uint64_t face; /* as in ebpo_paint_face */
    bool within[3];
} ebpo_reach_result_face;

/* The reach of one point. */
typedef struct ebpo_reach_result {
    const ebpo_reach_result_face *face;
    uint64_t count;
    bool complete; /* false: a subset omits a part of the reach */
} ebpo_reach_result;

typedef struct ebpo_reach_pool ebpo_reach_pool;

/* Makes an object that finds reaches on several threads. One thread uses `context`. The other
 * threads use new contexts of the same model. threads: 0: one for each core. There are fewer
 * threads if the model's memory budget is small. After a failure *out is NULL. */
EBPO_MUST_USE ebpo_status ebpo_reach_pool_new(const ebpo_paint *p, ebpo_context *context,
                                              unsigned threads, ebpo_reach_pool **out,
                                              ebpo_error *error);
void ebpo_reach_pool_free(ebpo_reach_pool *r);

/* Returns the reach of a stroke's point `i`, which is valid until the next call. Request the points
 * of a stroke in order, because a call finds the reaches of the following points, too. Fails with
 * the errors of ebpo_reach_find. */
EBPO_MUST_USE ebpo_status ebpo_reach_pool_find(ebpo_reach_pool *r, uint32_t stroke, uint32_t i,
                                               ebpo_reach_result *out, ebpo_error *error);

#endif
