/* What is found out about leaves once questions come to them, and where it is kept. */
#include "core/strict_fp.h"

#include <stdlib.h>

#include "core/alloc.h"
#include "geometry/cells.h"
#include "query/accel_parts.h"

/* --- rows of all leaves: pages, each twice as large as the one before, so that what has been
 * found stays where it is --- */

/* What one leaf may take at most fits: 1 + 4 * 4. */
enum { FIRST_PAGE = 32, PAGE_BYTES = 64 };

ebpo_leaf_kinds *ebpo_leaf_kinds_make(uint64_t rows_most)
{
    ebpo_leaf_kinds *k = ebpo_alloc_zero(1, sizeof *k);
    if (k)
        k->rows_most = rows_most;
    if (k)
        pthread_mutex_init(&k->lock, NULL);
    return k;
}

void ebpo_leaf_kinds_free(ebpo_leaf_kinds *k)
{
    if (!k)
        return;
    for (int i = 0; i < EBPO_KIND_PAGES; i++)
        free(k->page[i]);
    pthread_mutex_destroy(&k->lock);
    free(k);
}

/* A page for at least so many rows; false when there is none. */
static bool add_page(ebpo_leaf_kinds *k, uint64_t least)
{
    uint64_t size = (uint64_t)FIRST_PAGE << k->pages, left = k->rows_most - k->rows;
    size = size < left ? size : left;
    if (size < least || k->pages == EBPO_KIND_PAGES ||
        size > (PTRDIFF_MAX - PAGE_BYTES) / sizeof **k->page)
        return false;
    size_t bytes = ((size_t)size * sizeof **k->page + PAGE_BYTES - 1) / PAGE_BYTES * PAGE_BYTES;
    k->page[k->pages] = aligned_alloc(PAGE_BYTES, bytes);
    if (!k->page[k->pages])
        return false;
    k->pages++;
    k->rows += size;
    k->used = 0;
    k->room = size;
    return true;
}

/* The number of the first of so many rows, which lie in one page, or EBPO_NO_ROWS. */
static uint32_t take_rows(ebpo_leaf_kinds *k, uint64_t rows)
{
    uint32_t number = EBPO_NO_ROWS;
    pthread_mutex_lock(&k->lock);
    if (k->used + rows <= k->room || add_page(k, rows)) {
        number = (k->pages - 1) << EBPO_KIND_PAGE_BITS | (uint32_t)k->used;
        k->used += rows;
    }
    pthread_mutex_unlock(&k->lock);
    return number;
}

/* The kind of a leaf with these planes; without memory for them it stays a general one. */
static ebpo_leaf_kind keep_planes(ebpo_leaf_kinds *kinds, ebpo_accel_leaf *leaf,
                                  const ebpo_deciding_planes *planes)
{
    int count = planes->count, flip = planes->flip, fours = (count + 3) / 4;
    uint32_t first = take_rows(kinds, 1 + 4 * (uint64_t)fours);
    if (first == EBPO_NO_ROWS)
        return EBPO_LEAF_GENERAL;
    ebpo_kind_row *row = EBPO_KIND_ROW(kinds, first);
    *row++ = (ebpo_kind_row){ .says = { planes->inner, planes->outer, (uint32_t)fours } };
    for (int i = 0; i < 4 * fours; i++) {
        const ebpo_leaf_plane *q = &planes->plane[i < count ? i : 0];
        for (int k = 0; k < 4; k++)
            row[i / 4 * 4 + k].of_four[i % 4] = (float)(flip * (k < 3 ? q->n[k] : q->d));
    }
    leaf->rows = first;
    return count == 1   ? EBPO_LEAF_ONE_PLANE
           : count == 2 ? EBPO_LEAF_TWO_PLANES
           : flip > 0   ? EBPO_LEAF_CONVEX
                        : EBPO_LEAF_CONCAVE;
}

/* --- a leaf --- */

/* A lower wall if there is one: its winding number is the corner's. */
static uint8_t choose_wall(unsigned walls)
{
    unsigned open = ~walls & 63;
    if (open & 21)
        return (uint8_t)__builtin_ctz(open & 21);
    return open ? (uint8_t)__builtin_ctz(open) : EBPO_NO_WALL;
}

static ebpo_leaf_kind classify(const ebpo_accel *s, ebpo_accel_leaf *leaf, ebpo_cell cell)
{
    ebpo_deciding_planes planes;
    return ebpo_leaf_find_planes(s, leaf, cell, &planes) ? keep_planes(s->kinds, leaf, &planes)
                                                         : EBPO_LEAF_GENERAL;
}

/* Its wall, the winding number there, and the boxes of its list. */
static void bound(const ebpo_accel *s, ebpo_accel_leaf *leaf, ebpo_cell cell, ebpo_walls_fn *walls)
{
    uint8_t wall = choose_wall(walls(s, s->list + leaf->list, cell));
    int32_t step = 0;
    if (wall != EBPO_NO_WALL && wall % 2) {
        double low[3], high[3];
        uint64_t at_corner = UINT64_C(0x0f0f0f) & ~(UINT64_C(255) << 8 * (wall / 2));
        ebpo_cell_bounds(&s->box, cell, low, high);
        step = ebpo_leaf_crossings(s, leaf, low, high[wall / 2], wall / 2,
                                   at_corner << EBPO_LISTED_BOX);
    }
    bool small = step >= INT8_MIN && step <= INT8_MAX;
    leaf->wall = small ? wall : EBPO_NO_WALL;
    leaf->wall_step = (int8_t)(small ? step : 0);
}

static bool begin(ebpo_accel_leaf *leaf, ebpo_leaf_kind from, ebpo_leaf_kind to)
{
    uint8_t expected = (uint8_t)from;
    return atomic_compare_exchange_strong(&leaf->kind, &expected, (uint8_t)to);
}

static void end(ebpo_accel_leaf *leaf, ebpo_leaf_kind kind)
{
    atomic_store_explicit(&leaf->kind, (uint8_t)kind, memory_order_release);
}

static void find_wall(const ebpo_accel *s, ebpo_accel_leaf *leaf, ebpo_cell cell,
                      ebpo_walls_fn *walls)
{
    /* looked at first: a look is all that later questions take */
    if (ebpo_leaf_kind_of(leaf) == EBPO_LEAF_UNKNOWN &&
        begin(leaf, EBPO_LEAF_UNKNOWN, EBPO_LEAF_IN_HAND)) {
        bound(s, leaf, cell, walls);
        end(leaf, EBPO_LEAF_WALLED);
    }
}

static bool find_kind(const ebpo_accel *s, ebpo_accel_leaf *leaf, ebpo_cell cell)
{
    if (!begin(leaf, EBPO_LEAF_WALLED, EBPO_LEAF_SORTED))
        return false;
    ebpo_leaf_kind kind = classify(s, leaf, cell);
    atomic_fetch_add(&s->kinds->of_kind[kind], 1);
    if (kind == EBPO_LEAF_GENERAL && leaf->wall != EBPO_NO_WALL)
        atomic_fetch_add(&s->kinds->one_wall, 1);
    end(leaf, kind);
    return true;
}

bool ebpo_leaf_ask(const ebpo_accel *s, ebpo_accel_leaf *leaf, ebpo_cell cell, ebpo_walls_fn *walls)
{
    /* threads may count over each other: things are found a little later then */
    int asked = atomic_load_explicit(&leaf->asked, memory_order_relaxed) + 1;
    bool found = false;
    if (asked >= EBPO_LEAF_WALL_ASKED)
        find_wall(s, leaf, cell, walls);
    if (asked >= EBPO_LEAF_KIND_ASKED)
        found = find_kind(s, leaf, cell);
    else
        atomic_store_explicit(&leaf->asked, (uint8_t)asked, memory_order_relaxed);
    return found;
}
