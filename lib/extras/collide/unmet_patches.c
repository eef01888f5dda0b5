#include "core/strict_fp.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "extras/collide/contact_lines.h"
#include "extras/collide/contacts.h"
#include "extras/collide/unmet_patches.h"
#include "extras/collide/pair_walk.h"
#include "extras/collide/posed_subtrees.h"
#include "geometry/level_nodes.h"
#include "geometry/predicates.h"
#include "query/accel.h"

/* Faces put together: of each the first one that it is joined with. Arrays are the caller's. */

/* Of the faces joined so far; paths get shorter. At first first[face] = face. */
static inline uint32_t ebpo_joined_first(uint32_t *first, uint32_t face)
{
    while (first[face] != face) {
        first[face] = first[first[face]];
        face = first[face];
    }
    return face;
}

static inline void ebpo_join_faces(uint32_t *first, uint32_t a, uint32_t b)
{
    a = ebpo_joined_first(first, a);
    b = ebpo_joined_first(first, b);
    first[a > b ? a : b] = a > b ? b : a;
}

/* Faces that are connected by corners. */

typedef struct joining {
    ebpo_corner_ids corners;
    uint32_t *user; /* of each corner: a face that has it */
    uint64_t users;
} joining;

static bool join_face(joining *j, uint32_t *patch, uint32_t face, const double t[3][3])
{
    for (int i = 0; i < 3; i++) {
        uint32_t id;
        uint64_t known = j->corners.count;
        if (!ebpo_corner_id(&j->corners, t[i], &id) ||
            !ebpo_grow(&j->user, &j->users, j->corners.count, sizeof *j->user))
            return false;
        if (id < known)
            ebpo_join_faces(patch, j->user[id], face);
        else
            j->user[id] = face;
    }
    return true;
}

/* For each own face of a subtree, by its number in the file less first_face, the first face of its
 * patch: those that are connected to it by corners (equal coordinates) of own faces that are not
 * left out (a bit for each face of the file). One that is left out is alone. The caller frees it.
 */
static ebpo_status ebpo_face_patches(const ebpo_accel *subtree, const uint32_t *slots,
                                     const uint64_t *left_out, uint32_t **out, ebpo_error *error)
{
    joining j = { 0 };
    uint32_t count = subtree->face_count - subtree->outer_count;
    uint32_t *patch = ebpo_alloc(count, sizeof *patch);
    bool fine = patch != NULL;
    for (uint32_t f = 0; f < count && fine; f++)
        patch[f] = f;
    for (uint32_t f = 0; f < count && fine; f++) {
        double t[3][3];
        uint64_t number = subtree->first_face + f;
        if (left_out[number / 64] >> number % 64 & 1)
            continue;
        ebpo_accel_triangle(subtree, slots[subtree->outer_count + f], t);
        fine = join_face(&j, patch, f, (const double(*)[3])t);
    }
    for (uint32_t f = 0; f < count && fine; f++)
        patch[f] = ebpo_joined_first(patch, f);
    ebpo_corner_ids_free(&j.corners);
    free(j.user);
    if (!fine) {
        free(patch);
        return ebpo_fail_memory(error, count * sizeof *patch);
    }
    *out = patch;
    return EBPO_OK;
}

/* Each edge is listed at its corner of the lesser number, as the other corner and the face; what
 * stands twice in a sorted list connects. */

#define NO_CORNER UINT32_MAX

typedef struct edges {
    const ebpo_accel *whole;
    uint32_t (*corner)[3]; /* of each face; NO_CORNER: it has no area */
    uint64_t *end;         /* of each corner's list: it begins where that of the one before ends */
    uint64_t *edge;        /* other corner << 32 | face */
    uint32_t *patch;
} edges;

static bool number_corners(edges *e, ebpo_corner_ids *ids, const uint32_t *slots,
                           const ebpo_posing *posing)
{
    for (uint32_t f = 0; f < e->whole->face_count; f++) {
        double t[3][3];
        ebpo_posed_triangle(e->whole, posing, slots[f], t);
        bool area = !ebpo_zero_area(t[0], t[1], t[2]);
        e->patch[f] = f;
        e->corner[f][0] = NO_CORNER;
        for (int i = 0; i < 3 && area; i++)
            if (!ebpo_corner_id(ids, t[i], &e->corner[f][i]))
                return false;
    }
    return true;
}

/* Edge i of a face: its lesser corner and the other one. False: the face has no area. */
static bool edge_of(const edges *e, uint32_t f, int i, uint32_t *lesser, uint32_t *other)
{
    uint32_t a = e->corner[f][i], b = e->corner[f][i == 2 ? 0 : i + 1];
    *lesser = a < b ? a : b;
    *other = a < b ? b : a;
    return e->corner[f][0] != NO_CORNER;
}

/* Counts first, then fills lists from their ends. */
static void list_edges(edges *e, uint64_t corners)
{
    uint32_t at, other;
    for (uint32_t f = 0; f < e->whole->face_count; f++)
        for (int i = 0; i < 3; i++)
            if (edge_of(e, f, i, &at, &other))
                e->end[at + 1]++;
    for (uint64_t c = 0; c < corners; c++)
        e->end[c + 1] += e->end[c];
    for (uint32_t f = 0; f < e->whole->face_count; f++)
        for (int i = 0; i < 3; i++)
            if (edge_of(e, f, i, &at, &other))
                e->edge[e->end[at]++] = (uint64_t)other << 32 | f;
}

static int edge_patches_compare(const void *a, const void *b)
{
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

static void join_list(edges *e, uint64_t *list, uint64_t count)
{
    if (count > 1)
        qsort(list, count, sizeof *list, edge_patches_compare);
    for (uint64_t i = 0, next; i < count; i = next) {
        for (next = i + 1; next < count && list[next] >> 32 == list[i] >> 32;)
            next++;
        if (next - i == 2)
            ebpo_join_faces(e->patch, (uint32_t)list[i], (uint32_t)list[i + 1]);
    }
}

static bool edge_patches_join(edges *e, uint64_t corners)
{
    uint64_t faces = e->whole->face_count;
    e->end = ebpo_alloc_zero(corners + 1, sizeof *e->end);
    e->edge = ebpo_alloc(3 * faces, sizeof *e->edge);
    if (!e->end || !e->edge)
        return false;
    list_edges(e, corners);
    for (uint64_t c = 0; c < corners; c++) {
        uint64_t begin = c ? e->end[c - 1] : 0;
        join_list(e, e->edge + begin, e->end[c] - begin);
    }
    for (uint32_t f = 0; f < faces; f++)
        e->patch[f] = ebpo_joined_first(e->patch, f);
    return true;
}

ebpo_status ebpo_edge_patches(const ebpo_accel *whole, const uint32_t *slots,
                              const ebpo_posing *posing, uint32_t **out, ebpo_error *error)
{
    ebpo_corner_ids ids = { 0 };
    edges e = { .whole = whole };
    e.corner = ebpo_alloc(whole->face_count, sizeof *e.corner);
    e.patch = ebpo_alloc(whole->face_count, sizeof *e.patch);
    bool fine = e.corner && e.patch && number_corners(&e, &ids, slots, posing);
    uint64_t corners = ids.count;
    ebpo_corner_ids_free(&ids);
    fine = fine && edge_patches_join(&e, corners);
    free(e.corner);
    free(e.end);
    free(e.edge);
    if (!fine) {
        free(e.patch);
        return ebpo_fail_memory(error, whole->face_count * (uint64_t)60);
    }
    *out = e.patch;
    return EBPO_OK;
}

void ebpo_unmet_patches_begin(ebpo_unmet_patches *u, const ebpo_collision *question,
                              ebpo_two_models *two, int m)
{
    const ebpo_model *model = question->model[m];
    *u = (ebpo_unmet_patches){ .question = question, .two = two, .m = m };
    u->subtrees = model->whole ? 1 : model->top->below_count;
}

void ebpo_unmet_patches_end(ebpo_unmet_patches *u) { free(u->patch); }

static ebpo_status find_patches(ebpo_unmet_patches *u, const ebpo_accel *subtree,
                                const uint32_t *slots, const uint64_t *met, ebpo_error *error)
{
    u->first = subtree->first_face;
    u->count = subtree->face_count - subtree->outer_count;
    return ebpo_face_patches(subtree, slots, met, &u->patch, error);
}

ebpo_status ebpo_unmet_patches_find(ebpo_unmet_patches *u, uint64_t number, const uint64_t *met,
                                    ebpo_error *error)
{
    const ebpo_model *model = u->question->model[u->m];
    ebpo_context *context = u->two->context[u->m];
    ebpo_accel *subtree;
    free(u->patch);
    u->patch = NULL;
    if (model->whole)
        return find_patches(u, model->whole, u->two->faces[u->m]->slots, met, error);
    ebpo_status status = ebpo_context_subtree(context, (uint32_t)number, &subtree, error);
    if (status != EBPO_OK)
        return status;
    uint32_t *slots = ebpo_face_slots(subtree);
    status = slots ? find_patches(u, subtree, slots, met, error)
                   : ebpo_fail_memory(error, subtree->face_count * sizeof *slots);
    free(slots);
    ebpo_context_let_go(context);
    return status;
}

static bool note_any(void *user, const ebpo_triangles *triangles)
{
    bool *any = user;
    *any |= triangles->count > 0;
    return !*any;
}

/* Whether the solid has all of a ball around a point of the world inside, or outside. */
static ebpo_status side_of_ball(const ebpo_unmet_patches *u, const double middle[3], double radius,
                                int *in, ebpo_error *error)
{
    const ebpo_posed_solid *other = &u->two->model[!u->m];
    ebpo_context *context = u->two->context[!u->m];
    double low[3], high[3], p[3], doubt;
    bool near = false;
    ebpo_inside_result inside;
    ebpo_unpose(other, middle, p, &doubt);
    double room = (radius / other->posing.scale + 2 * doubt) * (1 + 0x1p-20);
    for (int k = 0; k < 3; k++) {
        low[k] = nextafter(p[k] - room, -INFINITY);
        high[k] = nextafter(p[k] + room, INFINITY);
    }
    ebpo_status status = ebpo_triangles_in_box(context, low, high, note_any, &near, error);
    if (status != EBPO_OK || near)
        return status;
    status = ebpo_inside(context, p, NULL, &inside, error);
    *in = ebpo_rule_inside(u->two->rule[!u->m], inside.winding);
    return status;
}

/* The cell has a point of each of its own faces; so does the ball around it. If no face of the
 * other model comes near the ball, it is on one side, and so is each face that meets none. */
ebpo_status ebpo_unmet_patches_side(const ebpo_unmet_patches *u, uint64_t number, int *in,
                                    ebpo_error *error)
{
    const ebpo_model *model = u->question->model[u->m];
    ebpo_posed_subtrees as = { .model = model, .posing = u->question->posing[u->m].posing };
    double corner[8][3], middle[3];
    *in = -1;
    if (model->whole)
        return EBPO_OK;
    ebpo_cell cell = model->top->below[number].cell;
    double radius =
        ebpo_posed_diagonal(&as, cell) / 2 + ebpo_posed_slack(&as, cell, u->question->reach);
    ebpo_posed_cell(&as, cell, corner);
    for (int k = 0; k < 3; k++)
        middle[k] = corner[0][k] / 2 + corner[7][k] / 2;
    if (ebpo_posed_solid_near(&u->two->model[!u->m], middle, radius))
        return side_of_ball(u, middle, radius, in, error);
    *in = 0;
    return EBPO_OK;
}
