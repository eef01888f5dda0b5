#include "core/strict_fp.h"

#include "extras/collide/way_search.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/sort.h"
#include "core/parallel.h"

/* --- the heap --- */

static bool is_later(const ebpo_way_pair *a, const ebpo_way_pair *b) { return a->most > b->most; }

EBPO_HEAP(heap, ebpo_way_pair, is_later)

static bool push(ebpo_way_search *s, const ebpo_way_pair *pair)
{
    if (!ebpo_grow(&s->pairs, &s->capacity, s->count + 1, sizeof *s->pairs))
        return false;
    heap_add(s->pairs, s->count++, pair);
    return true;
}

/* --- extents along the three axes --- */

static ebpo_way_extent extent_of(const ebpo_way_search *s, int which, uint32_t ref)
{
    const ebpo_way_side *side = &s->side[which];
    const ebpo_bound *b = &side->accel->bound[ref / 8];
    double middle[3], half[3];
    ebpo_way_extent out;
    for (int k = 0; k < 3; k++) {
        ebpo_bound_sides ends = ebpo_bound_side(b, (int)(ref % 8), k);
        middle[k] = (ends.low + ends.high) / 2;
        half[k] = (ends.high - ends.low) / 2;
    }
    for (int i = 0; i < 3; i++) {
        const double *row = side->row[i];
        double at = row[0] * middle[0] + row[1] * middle[1] + row[2] * middle[2] + side->base[i],
               reach = fabs(row[0]) * half[0] + fabs(row[1]) * half[1] + fabs(row[2]) * half[2];
        out.low[i] = at - reach;
        out.high[i] = at + reach;
    }
    return out;
}

double ebpo_way_most(const ebpo_way_search *s, const ebpo_way_extent *a, const ebpo_way_extent *b)
{
    for (int i = 1; i < 3; i++)
        if (b->low[i] - a->high[i] > s->lost || a->low[i] - b->high[i] > s->lost)
            return -1;
    double along = b->high[0] - a->low[0] + s->lost;
    return along < 0 ? -1 : along / s->step * (1 + 0x1p-40);
}

/* Two axes at right angles to the direction, and to each other. */
static void make_axes(const double d[3], double axis[3][3])
{
    double length = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    int least = 0;
    for (int k = 0; k < 3; k++) {
        axis[0][k] = d[k] / length;
        least = fabs(d[k]) < fabs(d[least]) ? k : least;
    }
    int u = (least + 1) % 3, v = (least + 2) % 3;
    length = sqrt(axis[0][u] * axis[0][u] + axis[0][v] * axis[0][v]);
    axis[1][least] = 0;
    axis[1][u] = -axis[0][v] / length;
    axis[1][v] = axis[0][u] / length;
    for (int k = 0; k < 3; k++) {
        int p = (k + 1) % 3, q = (k + 2) % 3;
        axis[2][k] = axis[0][p] * axis[1][q] - axis[0][q] * axis[1][p];
    }
}

static double dot(const double x[3], const double y[3])
{
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
}

static void make_side(ebpo_way_search *s, int which, const ebpo_accel *accel)
{
    ebpo_way_side *side = &s->side[which];
    double centre[3];
    side->accel = accel;
    side->posing = &s->question->posing[which].posing;
    ebpo_posing_apply(side->posing, side->accel->centre, centre);
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            double column[3] = { side->posing->matrix[0][k], side->posing->matrix[1][k],
                                 side->posing->matrix[2][k] };
            side->row[i][k] = dot(s->axis[i], column) / side->accel->scale;
        }
        side->base[i] = dot(s->axis[i], centre);
    }
}

/* --- faces --- */

/* In the order of the question's models. */
static bool comes_first(const ebpo_way_search *s, const ebpo_met_pair *x)
{
    uint64_t a = ebpo_accel_file_face(s->side[0].accel, x->a),
             b = ebpo_accel_file_face(s->side[1].accel, x->b);
    const uint64_t has[2] = { s->pair.file_face_a, s->pair.file_face_b };
    bool turned = s->question->turned;
    return a != has[turned] ? a < has[turned] : b < has[!turned];
}

static void look_at_faces(ebpo_way_search *s, const double a[3][3], const double b[3][3],
                          const ebpo_met_pair *pair)
{
    double most = ebpo_sweep_most(a, b, s->direction, INFINITY);
    ebpo_sweep_time t;
    s->looked++;
    if (most < s->sure)
        return;
    ebpo_sweep_time_init(&t);
    ebpo_sweep_last(a, b, s->direction, &t);
    int order = t.ever && mpz_sgn(t.numerator) >= 0 ? ebpo_sweep_time_compare(&t, &s->last) : -1;
    if (order > 0 || (order == 0 && comes_first(s, pair))) {
        mpz_swap(t.numerator, s->last.numerator);
        mpz_swap(t.denominator, s->last.denominator);
        s->last.unit = t.unit;
        s->last.ever = true;
        s->pair = ebpo_collision_pair(s->question, s->side[0].accel, s->side[1].accel, pair);
        s->sure = fmax(0, nextafter(ebpo_sweep_time_round(&s->last), 0));
    }
    ebpo_sweep_time_clear(&t);
}

static void look_at_blocks(ebpo_way_search *s, uint32_t block_a, uint32_t block_b)
{
    const uint32_t block[2] = { block_a, block_b };
    const ebpo_meshlet *m[2];
    double corner[2][EBPO_BLOCK][3][3];
    for (int w = 0; w < 2; w++) {
        m[w] = ebpo_accel_meshlet(s->side[w].accel, block[w]);
        for (uint32_t lane = 0; lane < m[w]->faces; lane++)
            ebpo_posed_triangle(s->side[w].accel, s->side[w].posing, block[w] * EBPO_BLOCK + lane,
                                corner[w][lane]);
    }
    for (uint32_t i = 0; i < m[0]->faces; i++)
        for (uint32_t j = 0; j < m[1]->faces; j++) {
            ebpo_met_pair pair = { m[0]->face + i, m[1]->face + j, EBPO_PAIR_APART };
            look_at_faces(s, (const double(*)[3])corner[0][i], (const double(*)[3])corner[1][j],
                          &pair);
        }
}

/* --- the search --- */

static uint32_t child_of(const ebpo_way_search *s, int which, uint32_t ref)
{
    return s->side[which].accel->bound[ref / 8].child[ref % 8];
}

static double size_of(const ebpo_way_extent *e)
{
    return e->high[0] - e->low[0] + (e->high[1] - e->low[1]) + (e->high[2] - e->low[2]);
}

/* All children of one node with one child, or a node's children, of the other model. */
static ebpo_status offer_children(ebpo_way_search *s, int which, uint32_t node, uint32_t other,
                                  ebpo_error *error)
{
    ebpo_way_extent seen[2];
    seen[!which] = extent_of(s, !which, other);
    for (uint32_t i = 0; i < s->side[which].accel->bound[node].count; i++) {
        uint32_t ref[2];
        ref[which] = node * 8 + i;
        ref[!which] = other;
        seen[which] = extent_of(s, which, ref[which]);
        ebpo_way_pair pair = { ebpo_way_most(s, &seen[0], &seen[1]), ref[0], ref[1] };
        if (pair.most < s->sure)
            continue;
        if (!push(s, &pair))
            return ebpo_fail_memory(error, s->capacity * sizeof *s->pairs);
    }
    return EBPO_OK;
}

/* The larger one, if both are nodes. */
static ebpo_status divide(ebpo_way_search *s, const ebpo_way_pair *pair, ebpo_error *error)
{
    uint32_t child[2] = { child_of(s, 0, pair->a), child_of(s, 1, pair->b) };
    bool block[2] = { child[0] & EBPO_IS_BLOCK, child[1] & EBPO_IS_BLOCK };
    if (block[0] && block[1]) {
        look_at_blocks(s, child[0] & ~EBPO_IS_BLOCK, child[1] & ~EBPO_IS_BLOCK);
        return EBPO_OK;
    }
    ebpo_way_extent a = extent_of(s, 0, pair->a), b = extent_of(s, 1, pair->b);
    int which = block[0] || (!block[1] && size_of(&b) > size_of(&a));
    return offer_children(s, which, child[which], which ? pair->a : pair->b, error);
}

void ebpo_way_search_begin(ebpo_way_search *s)
{
    ebpo_sweep_time_init(&s->last);
    make_axes(s->direction, s->axis);
    s->step = dot(s->axis[0], s->direction);
    s->lost = 0x1p-40 * s->question->reach;
    s->hi = -1;
    s->pair = (ebpo_face_pair){ EBPO_NO_FACE, EBPO_NO_FACE,    EBPO_NO_FACE,
                                EBPO_NO_FACE, EBPO_PAIR_APART, 0 };
}

static ebpo_status offer_tops(ebpo_way_search *s, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    const ebpo_accel *b = s->side[1].accel;
    for (uint32_t j = 0; j < b->bound[b->top].count && status == EBPO_OK; j++)
        status = offer_children(s, 0, s->side[0].accel->top, b->top * 8 + j, error);
    return status;
}

ebpo_status ebpo_way_search_run(ebpo_way_search *s, const ebpo_accel *const accel[2],
                                ebpo_error *error)
{
    const ebpo_progress *progress = &s->question->options.progress;
    if (accel[0]->bound_count == 0 || accel[1]->bound_count == 0)
        return EBPO_OK;
    for (int w = 0; w < 2; w++)
        make_side(s, w, accel[w]);
    ebpo_status status = offer_tops(s, error);
    while (status == EBPO_OK && s->count > 0 && s->pairs[0].most >= s->sure) {
        if (ebpo_collision_is_late(s->question))
            break;
        if (s->looked % 64 == 0 && !ebpo_progress_step(progress, "way out", 0, 0, error)) {
            status = EBPO_E_CANCELLED;
            break;
        }
        ebpo_way_pair pair = heap_take(s->pairs, s->count--);
        status = divide(s, &pair, error);
    }
    if (s->count > 0 && s->pairs[0].most >= s->sure)
        s->hi = fmax(s->hi, s->pairs[0].most);
    free(s->pairs);
    s->pairs = NULL;
    s->count = s->capacity = 0;
    return status;
}
