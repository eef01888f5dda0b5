/* A subtree from its slice, stage by stage, and how much memory that takes. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "query/accel_parts.h"
#include "query/accel.h"

/* What floats lose of a cross product of differences of coordinates, with room to spare. */
static double turn_error(const ebpo_box *box)
{
    double reach = 0, size = 0;
    for (int k = 0; k < 3; k++) {
        reach = fmax(reach, fmax(fabs(box->origin[k]), fabs(box->origin[k] + box->size[k])));
        size = fmax(size, box->size[k]);
    }
    return 0x1p-43 * reach * size;
}

static void make_frame(ebpo_accel *s)
{
    double most = 0, low[3], high[3];
    ebpo_cell_bounds(&s->box, s->root.cell, low, high);
    for (int k = 0; k < 3; k++) {
        s->centre[k] = low[k] / 2 + high[k] / 2;
        most = fmax(most, high[k] - low[k]);
    }
    int exponent;
    frexp(most, &exponent);
    s->turn_error = (float)turn_error(&s->box);
    s->scale = ldexp(1, exponent < -1000 ? 1000 : exponent > 1000 ? -1000 : 1 - exponent);
}

static ebpo_status copy_planes(ebpo_accel *s, const ebpo_slice *slice, ebpo_error *error)
{
    uint64_t grays = 0, planes = 0, at = 0;
    for (int i = 0; i < slice->level_count; i++) {
        grays += slice->level[i].gray_count;
        planes += slice->level[i].plane_count;
    }
    if (planes > UINT32_MAX) /* what gray_first holds */
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "the tree has too many planes to be held at once; give a memory budget");
    s->gray_planes = ebpo_alloc(planes, sizeof *s->gray_planes);
    s->gray_first = ebpo_alloc(grays + 1, sizeof *s->gray_first);
    if (!s->gray_planes || !s->gray_first)
        return ebpo_fail_memory(error, (grays + planes) * 4);
    uint64_t gray = 0;
    for (int i = 0; i < slice->level_count; i++) {
        const ebpo_level *level = &slice->level[i];
        uint64_t first = at;
        for (uint64_t k = 0; k < level->gray_count; k++) {
            s->gray_first[gray++] = (uint32_t)at;
            at += level->plane_counts ? level->plane_counts[k] : 0;
        }
        if (level->plane_count)
            memcpy(s->gray_planes + first, level->planes,
                   level->plane_count * sizeof *s->gray_planes);
    }
    s->gray_first[gray] = (uint32_t)at;
    s->gray_count = gray;
    return EBPO_OK;
}

/* Of planes that make leaves easy. Few leaves of one subtree are asked about; what they may take
 * counts from the beginning. */
static uint64_t rows_most(const ebpo_accel *s)
{
    return s->root.cell.level ? s->leaf_count : 5 * (uint64_t)s->leaf_count;
}

static uint64_t count_bytes(const ebpo_accel *s)
{
    uint64_t cells = s->nodes.grid_bits ? UINT64_C(1) << 3 * s->nodes.grid_bits : 0;
    return sizeof *s + s->nodes.group_count * sizeof *s->nodes.group + cells * 5 +
           s->leaf_count * sizeof *s->leaf + s->list_count * sizeof *s->list +
           (s->kinds ? sizeof *s->kinds : 0) +
           (s->kinds && s->root.cell.level ? rows_most(s) * sizeof(ebpo_kind_row) : 0) +
           (s->units + 1) * EBPO_MESHLET_UNIT +
           s->bound_count * (sizeof *s->bound + sizeof *s->slab) + (uint64_t)s->outer_count * 4 +
           (s->face_source ? (uint64_t)s->face_count * 4 : 0) +
           (s->gray_first ? (s->gray_count + s->gray_first[s->gray_count]) * 4 : 0);
}

static ebpo_status make(ebpo_accel *s, ebpo_slice *slice, const ebpo_info *info, ebpo_room *room,
                        unsigned threads, ebpo_error *error)
{
    ebpo_layout layout;
    ebpo_accel_plan plan = { info, slice, s->has_planes, NULL };
    ebpo_status status = ebpo_accel_fits(room, &plan, 0, error);
    if (status == EBPO_OK)
        status = ebpo_layout_make(&layout, slice, EBPO_BLOCKS_MOST, error);
    if (status != EBPO_OK)
        return status;
    plan.layout = &layout;
    status = ebpo_accel_fits(room, &plan, layout.block_count, error);
    if (status == EBPO_OK)
        status = ebpo_accel_fill_blocks(s, &plan, room, threads, error);
    ebpo_mesh_free(&slice->mesh);
    if (status == EBPO_OK)
        status = ebpo_accel_fill_bounds(s, &layout, threads, error);
    if (status == EBPO_OK)
        status = ebpo_accel_fill_nodes(s, slice, &layout, error);
    ebpo_layout_free(&layout);
    if (status == EBPO_OK && s->solid) {
        s->kinds = ebpo_leaf_kinds_make(rows_most(s));
        status = s->kinds ? EBPO_OK : ebpo_fail_memory(error, sizeof *s->kinds);
    }
    if (status == EBPO_OK && s->has_planes)
        status = copy_planes(s, slice, error);
    return status;
}

ebpo_status ebpo_accel_make(ebpo_accel **out, ebpo_slice *slice, const ebpo_info *info,
                            bool with_planes, unsigned threads, ebpo_error *error)
{
    return ebpo_accel_make_within(out, slice, info, NULL, with_planes, threads, error);
}

ebpo_status ebpo_accel_make_within(ebpo_accel **out, ebpo_slice *slice, const ebpo_info *info,
                                   ebpo_room *room, bool with_planes, unsigned threads,
                                   ebpo_error *error)
{
    *out = NULL;
    ebpo_accel *s = ebpo_alloc_zero(1, sizeof *s);
    if (!s) {
        ebpo_slice_free(slice);
        return ebpo_fail_memory(error, sizeof *s);
    }
    s->box = ebpo_root_box(info);
    s->root = slice->root;
    s->deepest = slice->root.cell.level + slice->level_count - 1;
    s->solid = info->solid;
    s->rule = (uint8_t)info->rule;
    s->has_planes = with_planes;
    s->wide = ebpo_accel_needs_doubles(info);
    s->face_count = (uint32_t)slice->mesh.face_count;
    s->outer_count = slice->outer_count;
    s->first_face = slice->first_face;
    make_frame(s);
    ebpo_status status =
        slice->mesh.face_count >= EBPO_IS_BLOCK
            ? ebpo_fail(error, EBPO_E_LIMIT,
                        "the model has too many faces to be held at once; give a memory budget")
            : make(s, slice, info, room, threads, error);
    s->outer = slice->outer;
    s->face_source = slice->face_source;
    slice->outer = slice->face_source = NULL;
    ebpo_slice_free(slice);
    if (status != EBPO_OK) {
        ebpo_accel_free(s);
        return status;
    }
    if (s->root.cell.level == 0)
        ebpo_node_table_make_grid(&s->nodes);
    s->bytes = count_bytes(s);
    *out = s;
    return EBPO_OK;
}

void ebpo_accel_free(ebpo_accel *s)
{
    if (!s)
        return;
    ebpo_node_table_free(&s->nodes);
    free(s->leaf);
    free(s->list);
    ebpo_leaf_kinds_free(s->kinds);
    free(s->meshlets);
    free(s->bound);
    free(s->slab);
    free(s->outer);
    free(s->face_source);
    free(s->gray_planes);
    free(s->gray_first);
    free(s);
}

/* Blocks are half full but for the one that a leaf of few faces has alone, where its neighbours'
 * fill theirs: what that takes beyond its faces' share is in the 64 bytes of each leaf, as what its
 * planes may take in a subtree. Lists name at most one block for each listed face. Of a face a
 * record has three vertices at most, or four where it has room for more than 16. */
void ebpo_accel_estimate(const ebpo_slice_size *size, const ebpo_info *info, uint64_t *keep,
                         uint64_t *peak)
{
    uint64_t wide = ebpo_accel_needs_doubles(info) ? 2 : 1, faces = size->new_faces + size->outer;
    uint64_t blocks = faces / 4 + 2, bounds = blocks / 3 + 2;
    *keep = sizeof(ebpo_accel) + sizeof(ebpo_leaf_kinds) + size->groups * 64 +
            size->leaves * (sizeof(ebpo_accel_leaf) + 64) +
            (size->refs + size->new_faces) * sizeof(ebpo_listed_block) +
            blocks * (EBPO_MESHLET_WIDE + EBPO_MESHLET_UNIT) + faces * 48 * wide +
            bounds * (sizeof(ebpo_bound) + sizeof(ebpo_bound_slab)) + faces * 8;
    *peak = *keep + size->groups * 128 + size->leaves * 64 + faces * (12 + 36 * wide + 24) +
            (blocks + bounds) * 72 + 65536;
}
