/* How much memory a subtree or a whole model takes. But for blocks, the hierarchy over them, and
 * what lies across a subtree's border, all is told by counts; these are bounded by what ordinary
 * models have, and ebpo_accel_make_within and ebpo_slice_read_within refuse what has more. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <math.h>

#include "core/error.h"
#include "core/hash.h"
#include "query/accel_parts.h"
#include "format/slice.h"

bool ebpo_accel_needs_doubles(const ebpo_info *info)
{
    double most = 0;
    for (int k = 0; k < 3; k++)
        most = fmax(most,
                    fmax(fabs(info->box_origin[k]), fabs(info->box_origin[k] + info->box_size[k])));
    double least = fmin(info->box_size[0], fmin(info->box_size[1], info->box_size[2]));
    return info->double_coordinates || !(most < 0x1p40) || !(least > 0x1p-40);
}

static uint64_t greater(uint64_t a, uint64_t b) { return a > b ? a : b; }
static uint64_t lesser(uint64_t a, uint64_t b) { return a < b ? a : b; }

/* --- what counts tell --- */

typedef struct counts {
    uint64_t groups, leaves, refs, uniform, planes, leaf_planes;
    uint64_t faces, outer, vertices; /* the outer ones are among the faces */
    bool below;                      /* a subtree, not the whole model */
    bool keeps_planes;
} counts;

/* In bytes. */
typedef struct told {
    uint64_t levels, mesh, maps, outer; /* of the slice */
    uint64_t only_read;                 /* what a slice does not have */
    uint64_t nodes, list, planes, rows, slots;
    uint64_t beside;
} told;

static uint64_t grid_bytes(uint64_t groups)
{
    int bits = ebpo_node_grid_bits(groups);
    return bits ? (UINT64_C(1) << 3 * bits) * 5 : 0;
}

/* Corners that lead to vertices before the subtree: of the outer faces, and of their neighbours. */
static uint64_t border_bytes(const counts *c) { return ebpo_compact_bytes(6 * c->outer); }

static told told_by(const counts *c, const ebpo_info *info)
{
    uint64_t coordinate = info->double_coordinates ? sizeof(double) : sizeof(float),
             maps = info->parts & EBPO_PART_MAPS ? 4 : 0;
    return (told){
        .levels = 3 * c->groups + 20 * c->leaves + 4 * (c->uniform + c->refs + c->planes),
        .mesh = 12 * c->faces + 3 * coordinate * c->vertices,
        .maps = maps * c->faces,
        .outer = 4 * c->outer,
        .only_read =
            c->below ? border_bytes(c) : maps * c->vertices + c->leaves + 4 * c->leaf_planes,
        .nodes = c->groups * 32 + (c->below ? 0 : grid_bytes(c->groups)) +
                 c->leaves * sizeof(ebpo_accel_leaf),
        .list = ebpo_list_most(c->refs, c->leaves, c->faces) * sizeof(ebpo_listed_block),
        .planes = c->keeps_planes ? 4 * (c->groups + 1 + c->planes) : 0,
        .rows = c->below && info->solid ? c->leaves * sizeof(ebpo_kind_row) : 0,
        .slots = 4 * c->faces,
        .beside = c->below ? 1 << 14 : 3 << 16,
    };
}

static counts counts_of_all(const ebpo_info *info)
{
    counts c = {
        .groups = 1, .faces = info->face_count, .vertices = info->vertex_count, .keeps_planes = true
    };
    for (int i = 0; i < info->level_count; i++) {
        const ebpo_level_summary *level = &info->level[i];
        c.groups += level->gray_count;
        c.leaves += level->leaf_count;
        c.refs += level->ref_count;
        c.uniform += level->white_count + level->black_count;
        c.planes += level->plane_count;
        c.leaf_planes += level->leaf_plane_count;
    }
    return c;
}

static counts counts_of_slice(const ebpo_slice *slice, bool with_planes)
{
    counts c = { .faces = slice->mesh.face_count,
                 .outer = slice->outer_count,
                 .vertices = slice->mesh.vertex_count,
                 .below = slice->root.cell.level > 0,
                 .keeps_planes = with_planes };
    for (int i = 0; i < slice->level_count; i++) {
        const ebpo_level *level = &slice->level[i];
        c.groups += level->group_count;
        c.leaves += level->leaf_count;
        c.refs += level->ref_count;
        c.uniform += level->white_count + level->black_count;
        c.planes += level->plane_count;
    }
    return c;
}

/* Faces across a subtree's border are as many as its patch of surface is round: about three times
 * the root of their number; `most` times here, and no more than are listed. */
static counts counts_of_size(const ebpo_slice_size *size, const ebpo_info *info, double roots,
                             uint64_t more)
{
    uint64_t own = size->new_faces, nodes = 8 * size->groups,
             outer = lesser(size->refs, (uint64_t)(roots * sqrt((double)own)) + more),
             faces = own + outer, usual = faces / 4 * 3 + 64;
    double of_face = info->face_count ? (double)info->vertex_count / (double)info->face_count : 0;
    return (counts){ .groups = size->groups,
                     .leaves = size->leaves,
                     .refs = size->refs,
                     .uniform = nodes > size->leaves ? nodes - size->leaves : 0,
                     .planes = size->planes,
                     .faces = faces,
                     .outer = outer,
                     .vertices = greater(usual, (uint64_t)(1.25 * of_face * (double)faces)),
                     .below = true,
                     .keeps_planes = size->planes > 0 };
}

/* --- what making finds out, in numbers --- */

typedef struct found {
    uint64_t blocks, bounds, units;
} found;

static found usual(const counts *c, const ebpo_info *info)
{
    uint64_t bytes = c->faces * (ebpo_accel_needs_doubles(info) ? 56 : 32);
    return (found){ .blocks = c->faces / 4 + 16,
                    .bounds = c->faces / 16 + 16,
                    .units = bytes / EBPO_MESHLET_UNIT + 64 };
}

static uint64_t kept_bytes(const told *t, const found *f)
{
    return sizeof(ebpo_accel) + sizeof(ebpo_leaf_kinds) + t->maps + t->outer + t->nodes + t->list +
           t->planes + t->rows + (f->units + 1) * EBPO_MESHLET_UNIT +
           (f->bounds + 1) * (sizeof(ebpo_bound) + sizeof(ebpo_bound_slab));
}

/* Arrays of a layout have grown by half. Side by side with all that is kept later are first the
 * mesh and what is found of blocks, then extents, then the nodes. A layout that is refused fits
 * too: 12 bytes a block, 60 a bound, no more blocks than faces, 7 bounds for 13 blocks (the first
 * run that is wrapped in a join has five members at least, the others four, three, two, two ..),
 * and 8 bytes a face to number them are below the 56 bytes a face of usual records, bounds and
 * layout. Beside it all is what one thread decodes a whole model with. */
static uint64_t peak_bytes(const told *t, const found *f)
{
    enum { LAYOUT_BLOCK = 16, LAYOUT_BOUND = 60, FOUND = 25, EXTENT = 72 };
    uint64_t layout = f->blocks * LAYOUT_BLOCK + f->bounds * LAYOUT_BOUND,
             early = t->mesh + f->blocks * FOUND, extents = (f->blocks + f->bounds) * EXTENT,
             late = t->nodes + t->list, after = t->nodes + t->list + t->planes + t->rows,
             kept = kept_bytes(t, f) - after,
             read = t->levels + t->mesh + t->outer + t->maps + t->only_read;
    uint64_t made = t->levels + kept + greater(greater(early, extents), late + t->slots) + layout;
    return greater(greater(read, made), t->levels + kept + after) + t->beside;
}

/* --- foretold --- */

void ebpo_accel_estimate_whole(const ebpo_info *info, uint64_t *keep, uint64_t *peak)
{
    counts c = counts_of_all(info);
    told t = told_by(&c, info);
    found f = usual(&c, info);
    *keep = kept_bytes(&t, &f);
    *peak = peak_bytes(&t, &f);
}

void ebpo_accel_estimate_subtree(const ebpo_slice_size *size, const ebpo_info *info, uint64_t *keep,
                                 uint64_t *peak)
{
    counts c = counts_of_size(size, info, 8, 64);
    told t = told_by(&c, info);
    found f = usual(&c, info);
    *keep = kept_bytes(&t, &f);
    *peak = peak_bytes(&t, &f);
}

/* Blocks and the hierarchy are fuller than is certain, and a leaf's list names a block once for
 * several faces. */
uint64_t ebpo_accel_mean_bytes(const ebpo_slice_size *all, const ebpo_info *info, uint64_t subtrees)
{
    uint64_t n = subtrees ? subtrees : 1;
    ebpo_slice_size mean = { .groups = all->groups / n + 1,
                             .leaves = all->leaves / n + 1,
                             .refs = all->refs / n + 1,
                             .new_faces = all->new_faces / n + 1,
                             .planes = all->planes / n + 1 };
    counts c = counts_of_size(&mean, info, 3.5, 2);
    told t = told_by(&c, info);
    uint64_t bytes = c.faces * (ebpo_accel_needs_doubles(info) ? 48 : 27);
    found f = { .units = bytes / EBPO_MESHLET_UNIT + 4, .bounds = c.faces / 24 + 1 };
    t.list = ((c.refs + c.leaves) / 2 + c.faces / 16 + 4) * sizeof(ebpo_listed_block);
    return kept_bytes(&t, &f);
}

/* --- and refused --- */

ebpo_status ebpo_accel_fits(ebpo_room *room, const ebpo_accel_plan *plan, uint64_t units,
                            ebpo_error *error)
{
    if (!room)
        return EBPO_OK;
    const ebpo_layout *layout = plan->layout;
    counts c = counts_of_slice(plan->slice, plan->with_planes);
    told t = told_by(&c, plan->info);
    t.only_read = 0; /* it has been read */
    found f =
        layout ? (found){ layout->block_count, layout->bound_count, units } : usual(&c, plan->info);
    uint64_t peak = peak_bytes(&t, &f);
    ebpo_room all = { .most = room->most };
    ebpo_status status = ebpo_room_check(&all, peak, error);
    room->needed = all.needed;
    return status;
}
