/* What a ray has met so far: exact decisions about one triangle after the other, of which the
 * question's answer is kept. One thread. */
#ifndef EBPO_QUERY_RAY_HITS_H
#define EBPO_QUERY_RAY_HITS_H

#include <math.h>
#include <string.h>

#include "query/query_model.h"
#include "query/query_kernels.h"

/* A face that the ray meets, with what exact comparison needs. */
struct ebpo_met {
    double triangle[3][3];
    uint64_t file_face, source_face;
    ebpo_ray_meeting meeting;
};

typedef struct ebpo_casting {
    ebpo_context *context; /* its list of faces takes all hits */
    ebpo_segment ray;
    ebpo_ray_wants wants;
    ebpo_ray_sides sides; /* only such faces count */
    double limit;         /* t beyond which nothing matters, certain; falls while searching */
    bool done;            /* nothing more is to be looked at */
    bool no_memory;
    uint64_t count;
    ebpo_met first; /* if count > 0, unless all are wanted */
} ebpo_casting;

static inline void ebpo_casting_begin(ebpo_casting *c, ebpo_context *context,
                                      const double origin[3], const double direction[3],
                                      double t_max, ebpo_ray_wants wants, ebpo_ray_sides sides)
{
    c->context = context;
    memcpy(c->ray.origin, origin, sizeof c->ray.origin);
    memcpy(c->ray.direction, direction, sizeof c->ray.direction);
    c->ray.t_max = c->limit = t_max;
    c->wants = wants;
    c->sides = sides;
    c->done = c->no_memory = false;
    c->count = 0;
}

/* Whether the ray meets m->triangle, and from a side that counts; then m->meeting says where.
 * `facing`: where that is certain already, because the line goes through its interior; else 0. */
bool ebpo_casting_meets(const ebpo_casting *casting, int facing, ebpo_met *m);

/* A face that is met, with its numbers. */
void ebpo_casting_keep(ebpo_casting *casting, const ebpo_met *m);

/* All hits in order, each once, into context->hits from `begin` on, up to *end. */
EBPO_MUST_USE ebpo_status ebpo_casting_sort(ebpo_casting *casting, uint64_t begin, uint64_t *end,
                                            ebpo_error *error);

static inline ebpo_ray_hit ebpo_hit_of(const ebpo_met *m)
{
    return (ebpo_ray_hit){ m->meeting.t, m->source_face, m->meeting.side };
}

const char *ebpo_ray_fault_of(const ebpo_segment *ray);

/* What is wrong with a ray, as the end of a sentence; NULL: nothing. */
static inline const char *ebpo_ray_fault(const ebpo_segment *ray)
{
    const double *o = ray->origin, *d = ray->direction;
    double far = fabs(o[0]) + fabs(o[1]) + fabs(o[2]), size = fabs(d[0]) + fabs(d[1]) + fabs(d[2]);
    if (size > 0 && far + size < INFINITY && ray->t_max >= 0)
        return NULL;
    return ebpo_ray_fault_of(ray);
}

#endif
