/* How much memory a whole model takes. But for blocks and the hierarchy over them all is told by
 * the counts in the head; these two are bounded by what ordinary models have, twice as much or
 * less, and ebpo_accel_make_within refuses a model that has more than its budget allows. */
#include "geom/strict_fp.h"

#include <inttypes.h>
#include <math.h>

#include "base/error.h"
#include "accel/accel_parts.h"

bool ebpo_accel_needs_doubles(const ebpo_info *info)
{
    double most = 0;
    for (int k = 0; k < 3; k++)
        most = fmax(most,
                    fmax(fabs(info->box_origin[k]), fabs(info->box_origin[k] + info->box_size[k])));
    double least = fmin(info->box_size[0], fmin(info->box_size[1], info->box_size[2]));
    return info->double_coordinates || !(most < 0x1p40) || !(least > 0x1p-40);
}

/* What the head tells, in bytes. */
typedef struct told {
    uint64_t levels, mesh, maps; /* of the slice */
    uint64_t only_read;          /* what a slice does not have */
    uint64_t nodes, list, planes, slots;
} told;

static uint64_t grid_bytes(uint64_t groups)
{
    int bits = ebpo_node_grid_bits(groups);
    return bits ? (UINT64_C(1) << 3 * bits) * 5 : 0;
}

static told told_by(const ebpo_info *info)
{
    uint64_t faces = info->face_count, vertices = info->vertex_count, groups = 1, leaves = 0,
             refs = 0, uniform = 0, planes = 0, leaf_planes = 0;
    for (int i = 0; i < info->level_count; i++) {
        const ebpo_level_summary *level = &info->level[i];
        groups += level->gray_count;
        leaves += level->leaf_count;
        refs += level->ref_count;
        uniform += level->white_count + level->black_count;
        planes += level->plane_count;
        leaf_planes += level->leaf_plane_count;
    }
    uint64_t coordinate = info->double_coordinates ? sizeof(double) : sizeof(float),
             maps = info->parts & EBPO_PART_MAPS ? 4 : 0;
    return (told){
        .levels = 3 * groups + 20 * leaves + 4 * (uniform + refs + planes),
        .mesh = 12 * faces + 3 * coordinate * vertices,
        .maps = maps * faces,
        .only_read = maps * vertices + leaves + 4 * leaf_planes,
        .nodes = groups * 32 + grid_bytes(groups) + leaves * sizeof(ebpo_accel_leaf),
        .list = ebpo_list_most(refs, leaves, faces) * sizeof(ebpo_listed_block),
        .planes = 4 * (groups + 1 + planes),
        .slots = 4 * faces,
    };
}

/* What making finds out, in numbers. */
typedef struct found {
    uint64_t blocks, bounds, units;
} found;

static found usual(const ebpo_info *info)
{
    uint64_t faces = info->face_count;
    uint64_t bytes = faces * (ebpo_accel_needs_doubles(info) ? 56 : 32);
    return (found){ .blocks = faces / 4 + 16,
                    .bounds = faces / 16 + 16,
                    .units = bytes / EBPO_MESHLET_UNIT + 64 };
}

static uint64_t kept_bytes(const told *t, const found *f)
{
    return sizeof(ebpo_accel) + sizeof(ebpo_leaf_kinds) + t->maps + t->nodes + t->list + t->planes +
           (f->units + 1) * EBPO_MESHLET_UNIT +
           (f->bounds + 1) * (sizeof(ebpo_bound) + sizeof(ebpo_bound_slab));
}

static uint64_t greater(uint64_t a, uint64_t b) { return a > b ? a : b; }

/* Arrays of a layout have grown by half. Side by side with all that is kept later are first the
 * mesh and what is found of blocks, then extents, then the nodes. A layout that is refused fits
 * too: 12 bytes a block, 60 a bound, no more blocks than faces, 7 bounds for 13 blocks (the first
 * run that is wrapped in a join has five members at least, the others four, three, two, two ..),
 * and 8 bytes a face to number them are below the 56 bytes a face of usual records, bounds and
 * layout. Beside it all is what one thread decodes with. */
static uint64_t peak_bytes(const told *t, const found *f)
{
    enum { LAYOUT_BLOCK = 16, LAYOUT_BOUND = 60, FOUND = 25, EXTENT = 72, BESIDE = 3 << 16 };
    uint64_t layout = f->blocks * LAYOUT_BLOCK + f->bounds * LAYOUT_BOUND,
             early = t->mesh + f->blocks * FOUND, extents = (f->blocks + f->bounds) * EXTENT,
             late = t->nodes + t->list, after = t->nodes + t->list + t->planes,
             kept = kept_bytes(t, f) - after, read = t->levels + t->mesh + t->maps + t->only_read;
    uint64_t made = t->levels + kept + greater(greater(early, extents), late + t->slots) + layout;
    return greater(greater(read, made), t->levels + kept + after) + BESIDE;
}

void ebpo_accel_estimate_whole(const ebpo_info *info, uint64_t *keep, uint64_t *peak)
{
    told t = told_by(info);
    found f = usual(info);
    *keep = kept_bytes(&t, &f);
    *peak = peak_bytes(&t, &f);
}

ebpo_status ebpo_accel_fits(const ebpo_accel_room *room, const ebpo_layout *layout, uint64_t units,
                            ebpo_error *error)
{
    if (room->most == UINT64_MAX)
        return EBPO_OK;
    told t = told_by(room->info);
    uint64_t peak = peak_bytes(&t, &(found){ layout->block_count, layout->bound_count, units });
    if (peak <= room->most)
        return EBPO_OK;
    return ebpo_fail(error, EBPO_E_LIMIT,
                     "the memory budget of %" PRIu64
                     " bytes does not hold this model, which takes up to %" PRIu64,
                     room->most, peak);
}
