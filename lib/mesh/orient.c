#include "geom/strict_fp.h"

#include <stdlib.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/fp_env.h"
#include "mesh/mesh.h"
#include "mesh/stars.h"
#include "mesh/sum.h"

/* How a face relates to the first face of its patch. */
enum { UNSEEN = 0, KEEP = 1, FLIP = 2 };

/* A patch: faces connected by edges that are used exactly twice. */
typedef struct patch {
    uint64_t begin, end; /* range of orienting.order */
    bool closed;         /* every edge has a face on its other side */
    bool consistent;     /* as it came */
    bool orientable;
} patch;

typedef struct orienting {
    ebpo_mesh *mesh;
    uint32_t *mate;  /* [3 * face_count] face across corner k .. k + 1, or EBPO_NO_INDEX */
    uint8_t *state;  /* [face_count] */
    uint32_t *order; /* [face_count] faces, patch by patch */
    uint64_t placed;
    uint64_t flipped, unorientable;
} orienting;

static ebpo_status find_mates(orienting *o, ebpo_error *error)
{
    ebpo_stars stars;
    ebpo_star star = { .links = NULL };
    ebpo_status status = ebpo_stars_build(&stars, o->mesh, 0, NULL, error);
    if (status != EBPO_OK)
        return status;
    for (uint64_t i = 0; i < 3 * o->mesh->face_count; i++)
        o->mate[i] = EBPO_NO_INDEX;
    for (uint64_t v = 0; v < o->mesh->vertex_count && status == EBPO_OK; v++) {
        if (!ebpo_star_gather(&star, &stars, o->mesh, (uint32_t)v))
            status = ebpo_fail_memory(error, star.capacity * 2 * sizeof *star.links);
        for (uint64_t begin = 0, end; status == EBPO_OK && begin < star.count; begin = end) {
            const ebpo_link *a = &star.links[begin], *b = a + 1;
            end = ebpo_star_run_end(&star, begin);
            if (end - begin != 2 || ebpo_link_face(a) == ebpo_link_face(b) || ebpo_link_neighbour(a) < v)
                continue;
            o->mate[3 * (uint64_t)ebpo_link_face(a) + a->corner] = ebpo_link_face(b);
            o->mate[3 * (uint64_t)ebpo_link_face(b) + b->corner] = ebpo_link_face(a);
        }
    }
    ebpo_star_free(&star);
    ebpo_stars_free(&stars);
    return status;
}

static bool runs_along(const uint32_t face[3], uint32_t from, uint32_t to)
{
    return (face[0] == from && face[1] == to) || (face[1] == from && face[2] == to) ||
           (face[2] == from && face[0] == to);
}

/* Looks over one edge of a face; notes what the face behind it must be. */
static void look_across(orienting *o, patch *p, uint32_t face, int corner)
{
    const uint32_t *v = o->mesh->faces + 3 * (uint64_t)face;
    uint32_t mate = o->mate[3 * (uint64_t)face + (unsigned)corner];
    if (mate == EBPO_NO_INDEX) {
        p->closed = false;
        return;
    }
    bool agrees = !runs_along(o->mesh->faces + 3 * (uint64_t)mate, v[corner], v[(corner + 1) % 3]);
    uint8_t wanted = agrees ? o->state[face] : (uint8_t)(KEEP + FLIP - o->state[face]);
    if (!agrees)
        p->consistent = false;
    if (o->state[mate] == UNSEEN) {
        o->state[mate] = wanted;
        o->order[p->end++] = mate;
    } else if (o->state[mate] != wanted) {
        p->orientable = false;
    }
}

static patch collect_patch(orienting *o, uint32_t seed)
{
    patch p = { .begin = o->placed, .end = o->placed, .closed = true, .consistent = true, .orientable = true };
    o->state[seed] = KEEP;
    o->order[p.end++] = seed;
    for (uint64_t i = p.begin; i < p.end; i++)
        for (int k = 0; k < 3; k++)
            look_across(o, &p, o->order[i], k);
    o->placed = p.end;
    return p;
}

/* Six times the signed volume of a closed patch once its FLIP faces are turned. */
static double patch_volume(const orienting *o, const patch *p)
{
    double base[3];
    ebpo_sum sum = { 0, 0 };
    ebpo_mesh_position(o->mesh, o->mesh->faces[3 * (uint64_t)o->order[p->begin]], base);
    for (uint64_t i = p->begin; i < p->end; i++) {
        const uint32_t *v = o->mesh->faces + 3 * (uint64_t)o->order[i];
        double a[3], b[3], c[3], cross[3];
        ebpo_mesh_position(o->mesh, v[0], a);
        ebpo_mesh_position(o->mesh, v[1], b);
        ebpo_mesh_position(o->mesh, v[2], c);
        ebpo_face_cross(a, b, c, cross);
        double term = (a[0] - base[0]) * cross[0] + (a[1] - base[1]) * cross[1] + (a[2] - base[2]) * cross[2];
        ebpo_sum_add(&sum, o->state[o->order[i]] == FLIP ? -term : term);
    }
    return ebpo_sum_value(&sum);
}

static void settle_patch(orienting *o, const patch *p)
{
    if (!p->orientable)
        o->unorientable++;
    if (!p->orientable || p->consistent)
        return;
    uint64_t count = p->end - p->begin, flips = 0;
    for (uint64_t i = p->begin; i < p->end; i++)
        flips += o->state[o->order[i]] == FLIP;
    double volume = p->closed ? patch_volume(o, p) : 0;
    bool other_side = volume < 0 || (!(volume > 0) && flips > count - flips);
    for (uint64_t i = p->begin; i < p->end; i++) {
        uint32_t *v = o->mesh->faces + 3 * (uint64_t)o->order[i];
        if ((o->state[o->order[i]] == FLIP) == other_side)
            continue;
        uint32_t t = v[1];
        v[1] = v[2];
        v[2] = t;
        o->flipped++;
    }
}

ebpo_status ebpo_mesh_orient(ebpo_mesh *mesh, ebpo_mend_record *record, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_status status = ebpo_mesh_check_shape(mesh, error);
    if (status != EBPO_OK)
        return status;
    uint64_t count = mesh->face_count;
    orienting o = { .mesh = mesh, .mate = ebpo_alloc(3 * count, sizeof *o.mate), .state = ebpo_alloc_zero(count, 1),
                    .order = ebpo_alloc(count, sizeof *o.order) };
    if (!o.mate || !o.state || !o.order) {
        status = ebpo_fail_memory(error, count * 17);
        goto done;
    }
    status = find_mates(&o, error);
    if (status != EBPO_OK)
        goto done;
    for (uint64_t f = 0; f < count; f++)
        if (o.state[f] == UNSEEN) {
            patch p = collect_patch(&o, (uint32_t)f);
            settle_patch(&o, &p);
        }
    if (record) {
        record->orient = true;
        record->flipped_faces += o.flipped;
        record->unorientable_components += o.unorientable;
    }
done:
    free(o.mate);
    free(o.state);
    free(o.order);
    return status;
}
