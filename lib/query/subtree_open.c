/* Finding a node by its octcode, and reading what is below it. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "format/file_nodes.h"
#include "geometry/cursor.h"
#include "query/subtree_parts.h"

/* --- the node --- */

static ebpo_status fail_uniform(const ebpo_chunks *chunks, uint64_t octcode, ebpo_cursor *c,
                                ebpo_error *error)
{
    const char *shown = chunks->file->in.shown,
               *type = ebpo_cursor_node(c)->type == EBPO_BLACK ? "black" : "white";
    ebpo_octcode found = ebpo_cursor_octcode(c);
    if (found == octcode)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, shown,
                              "node %" PRIu64 " is %s: no face touches it, so nothing is below it; "
                              "ask for gray nodes and leaves",
                              octcode, type);
    return ebpo_fail_file(error, EBPO_E_ARGUMENT, shown,
                          "there is no node %" PRIu64 ": it would lie in node %" PRIu64
                          ", which is %s, and no face touches it",
                          octcode, found, type);
}

/* Whether what the cursor has come to will do. */
static ebpo_status check_found(const ebpo_chunks *chunks, uint64_t octcode, bool or_leaf_above,
                               ebpo_cursor *c, ebpo_error *error)
{
    const ebpo_node *child = NULL, *node = ebpo_cursor_node(c);
    ebpo_octcode found = ebpo_cursor_octcode(c);
    ebpo_status status = ebpo_cursor_children(c, &child, error); /* tells whether it is pruned */
    if (status != EBPO_OK)
        return status;
    if (ebpo_node_is_uniform(node))
        return fail_uniform(chunks, octcode, c, error);
    if (node->pruned)
        return ebpo_fail_file(error, EBPO_E_ABSENT, chunks->file->in.shown,
                              "what is below node %" PRIu64
                              " has been left out of this file, which is a subset; open the file "
                              "that it was taken from",
                              found);
    if (found == octcode || or_leaf_above)
        return EBPO_OK;
    return ebpo_fail_file(error, EBPO_E_ARGUMENT, chunks->file->in.shown,
                          "there is no node %" PRIu64 ": the tree ends above it, with leaf %" PRIu64
                          "; open that (or_leaf_above does)",
                          octcode, found);
}

static ebpo_status find_node(ebpo_chunks *chunks, uint64_t octcode, bool or_leaf_above,
                             ebpo_cursor *c, ebpo_error *error)
{
    ebpo_node root;
    if (!ebpo_octcode_valid(octcode))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "%" PRIu64 " is not an octcode, which is a leading 1 and three bits for "
                         "each of at most %d levels; 1 is the root's",
                         octcode, EBPO_LEVELS_MAX - 1);
    ebpo_status status = ebpo_chunks_root(chunks, &root, error);
    if (status != EBPO_OK)
        return status;
    ebpo_cursor_begin(c, &ebpo_chunks_source, chunks, root);
    status = ebpo_cursor_to_cell(c, ebpo_cell_of_octcode(octcode), error);
    return status == EBPO_OK ? check_found(chunks, octcode, or_leaf_above, c, error) : status;
}

/* Planes of the nodes on the way to the subtree's root. */
static ebpo_status take_above(ebpo_subtree *s, ebpo_cursor *c, ebpo_error *error)
{
    uint32_t codes[EBPO_NODE_PLANES];
    uint64_t capacity = 0;
    s->has_planes = true;
    for (int depth = 0; depth < c->depth; depth++) {
        unsigned count = 0;
        uint32_t first = s->above_first[depth];
        ebpo_status status = c->source->planes(c->holder, &c->at[depth].node, codes, &count, error);
        if (status != EBPO_OK)
            return status;
        if (!ebpo_grow(&s->above_planes, &capacity, first + count + 1, sizeof *codes))
            return ebpo_fail_memory(error, (first + count) * sizeof *codes);
        memcpy(s->above_planes + first, codes, count * sizeof *codes);
        s->above_first[depth + 1] = first + count;
    }
    return EBPO_OK;
}

/* --- how much memory --- */

/* Decoded chunks while reading: a quarter of what is allowed, within these. */
enum { CHUNKS_LEAST = 2 << 20, CHUNKS_MOST = 32 << 20 };

static uint64_t chunk_budget(uint64_t memory)
{
    return memory == 0 || memory / 4 > CHUNKS_MOST ? CHUNKS_MOST
           : memory / 4 < CHUNKS_LEAST             ? CHUNKS_LEAST
                                                   : memory / 4;
}

/* The least that holds so much beside the chunks. */
static uint64_t least_memory(uint64_t bytes)
{
    if (bytes <= 3 * (uint64_t)CHUNKS_LEAST)
        return bytes + CHUNKS_LEAST;
    return bytes <= 3 * (uint64_t)CHUNKS_MOST ? bytes + bytes / 3 + 4 : bytes + CHUNKS_MOST;
}

/* Of a slice, what is made of it, and what is needed on the way: a bound, from counts. */
static uint64_t bound(const ebpo_slice_size *size, const ebpo_info *info, bool whole, bool corners)
{
    enum {
        NODE = 32,      /* octcode, type, winding, children, planes, list; winding in the slice */
        GROUP = 4,      /* types, plane counts */
        LEAF = 24,      /* what a level has for each */
        PLANE = 8,      /* in the slice and in the subtree */
        REFERENCE = 52, /* in slice, list, and the table that numbers the outer ones */
        FACE = 24,      /* corners, number, number in the source, list */
        OLDER = 36,     /* for each corner: the table that numbers vertices of faces before */
        ALWAYS = 1 << 20
    };
    uint64_t number = info->double_coordinates ? sizeof(double) : sizeof(float),
             faces = size->new_faces + size->outer,
             vertices = 3 * faces < info->vertex_count ? 3 * faces : info->vertex_count;
    return ALWAYS + size->groups * (8 * NODE + GROUP) + size->leaves * LEAF + size->planes * PLANE +
           size->refs * REFERENCE + faces * (FACE + (corners ? 9 * number : 0)) +
           (whole ? 0 : 3 * faces * OLDER) + vertices * 3 * number;
}

/* References to faces that are new before the subtree: that many outer faces at most. Reads the
 * lists, of which most are references within the subtree. */
static ebpo_status count_outer(const ebpo_subtree *s, ebpo_chunks *chunks, uint64_t *outer,
                               ebpo_error *error)
{
    ebpo_slice lists;
    uint64_t first = UINT64_MAX;
    *outer = 0;
    ebpo_status status =
        ebpo_slice_read_nodes(&lists, chunks, &s->root, EBPO_NEEDS_ALWAYS | EBPO_NEEDS_MESH,
                              EBPO_SLICE_ALL, error);
    if (status != EBPO_OK)
        return status;
    for (int i = 0; i < lists.level_count; i++) /* ascending within a level */
        if (lists.level[i].leaf_count && lists.level[i].leaf_first[0] < first)
            first = lists.level[i].leaf_first[0];
    for (int i = 0; i < lists.level_count; i++)
        for (uint64_t k = 0; k < lists.level[i].ref_count; k++)
            *outer += lists.level[i].leaf_refs[k] < first;
    ebpo_slice_free(&lists);
    return EBPO_OK;
}

static ebpo_status check_memory(const ebpo_subtree *s, ebpo_chunks *chunks, uint32_t needs,
                                const ebpo_subtree_options *o, ebpo_error *error)
{
    ebpo_slice_size size;
    const ebpo_info *info = &chunks->file->info;
    bool whole = s->root.cell.level == 0, corners = o->corners && !s->no_faces;
    if (o->memory == 0)
        return EBPO_OK;
    ebpo_status status = ebpo_slice_measure_nodes(chunks, &s->root, needs, o->levels, &size, error);
    if (status != EBPO_OK)
        return status;
    ebpo_slice_size lists = size;
    lists.outer = lists.new_faces = 0;
    uint64_t least = least_memory(bound(&size, info, whole, corners));
    if (least > o->memory && size.outer &&
        least_memory(bound(&lists, info, whole, corners)) <= o->memory) {
        status = count_outer(s, chunks, &size.outer, error);
        least = least_memory(bound(&size, info, whole, corners));
    }
    if (status != EBPO_OK || least <= o->memory)
        return status;
    return ebpo_fail_file(error, EBPO_E_LIMIT, chunks->file->in.shown,
                          "the subtree of node %" PRIu64 " may take more than the %" PRIu64
                          " bytes allowed; %" PRIu64 " are enough, or open the subtrees below it",
                          ebpo_octcode_of_cell(s->root.cell), o->memory, least);
}

/* --- reading --- */

/* What of the arrays is wanted; sets `no_faces`. */
static uint32_t choose_needs(ebpo_subtree *s, const ebpo_subtree_options *o, uint32_t parts)
{
    uint32_t most = EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS | EBPO_PART_LEAF_PLANES,
             has = parts & o->parts & most;
    s->no_faces = !(parts & EBPO_PART_MESH)
                      ? "the file was written without its mesh; build it again with it"
                  : !(has & EBPO_PART_MESH)
                      ? "the subtree was opened without its faces; ask for EBPO_PART_MESH"
                  : o->levels >= 0 ? "the subtree was opened for some levels only, which have no "
                                     "faces; open all, with levels = -1"
                                   : NULL;
    has &= s->no_faces ? ~(uint32_t)(EBPO_PART_MESH | EBPO_PART_MAPS) : ~0u;
    s->has_leaf_planes = has & EBPO_PART_LEAF_PLANES;
    return has | EBPO_NEEDS_ALWAYS | EBPO_NEEDS_SOLID;
}

static ebpo_status fill(ebpo_subtree *s, ebpo_chunks *chunks, ebpo_cursor *c,
                        const ebpo_subtree_options *o, ebpo_error *error)
{
    ebpo_slice slice;
    uint32_t needs = choose_needs(s, o, chunks->file->info.parts);
    ebpo_status status = check_memory(s, chunks, needs, o, error);
    if (status == EBPO_OK && needs & (EBPO_NEEDS_PLANES | EBPO_NEEDS_LEAF_PLANES))
        status = take_above(s, c, error);
    if (status == EBPO_OK)
        status = s->no_faces
                     ? ebpo_slice_read_nodes(&slice, chunks, &s->root, needs, o->levels, error)
                     : ebpo_slice_read_parts(&slice, chunks, &s->root, needs, error);
    if (status != EBPO_OK)
        return status;
    status = ebpo_subtree_take_nodes(s, &slice, error);
    if (status == EBPO_OK && !s->no_faces)
        status = ebpo_subtree_take_faces(s, &slice, o, error);
    ebpo_slice_free(&slice);
    return status;
}

static ebpo_status open_below(ebpo_subtree *s, ebpo_chunks *chunks, uint64_t octcode,
                              const ebpo_subtree_options *o, ebpo_error *error)
{
    ebpo_cursor *c = ebpo_alloc(1, sizeof *c);
    if (!c)
        return ebpo_fail_memory(error, sizeof *c);
    ebpo_status status = find_node(chunks, octcode, o->or_leaf_above, c, error);
    if (status == EBPO_OK) {
        s->root = *ebpo_cursor_node(c);
        status = fill(s, chunks, c, o, error);
    }
    free(c);
    return status;
}

static ebpo_status check_options(const ebpo_subtree_options *o, ebpo_error *error)
{
    return o->levels < -1 ? ebpo_fail(error, EBPO_E_ARGUMENT,
                                      "subtree options: levels are at least 0, or -1 for all; %d "
                                      "are asked for",
                                      o->levels)
                          : EBPO_OK;
}

ebpo_status ebpo_subtree_open(const ebpo_file *file, uint64_t octcode,
                              const ebpo_subtree_options *options, ebpo_subtree **out,
                              ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_subtree_options wanted = EBPO_SUBTREE_OPTIONS_INIT;
    ebpo_chunks *chunks = NULL;
    *out = NULL;
    ebpo_status status = EBPO_TAKE(ebpo_subtree_options, &wanted, options, error);
    if (status == EBPO_OK)
        status = check_options(&wanted, error);
    if (status != EBPO_OK)
        return status;
    ebpo_subtree *s = ebpo_alloc_zero(1, sizeof *s);
    if (!s)
        return ebpo_fail_memory(error, sizeof *s);
    const ebpo_info *info = ebpo_file_info(file);
    s->box = ebpo_root_box(info);
    s->solid = info->solid;
    s->rule = info->rule;
    status = ebpo_chunks_make(&chunks, file, chunk_budget(wanted.memory), error);
    if (status == EBPO_OK)
        status = open_below(s, chunks, octcode, &wanted, error);
    ebpo_chunks_free(chunks);
    if (status == EBPO_OK)
        *out = s;
    else
        ebpo_subtree_close(s);
    return status;
}

void ebpo_subtree_close(ebpo_subtree *s)
{
    if (!s)
        return;
    ebpo_subtree_free_scratch(s->scratch);
    free(s->octcodes);
    free(s->types);
    free(s->windings);
    free(s->children);
    free(s->plane_first);
    free(s->planes);
    free(s->above_planes);
    ebpo_mesh_free(&s->mesh);
    free(s->corners32);
    free(s->corners64);
    free(s->numbers);
    free(s->source);
    free(s->list_first);
    free(s->list);
    free(s);
}

uint64_t ebpo_octcode_at(const ebpo_info *info, const double point[3], int level)
{
    EBPO_DEFAULT_FP;
    ebpo_box box = ebpo_root_box(info);
    ebpo_cell cell = { level, { 0, 0, 0 } };
    if (level < 0 || level > box.grid_level || level >= EBPO_LEVELS_MAX ||
        !ebpo_locate(&box, level, point, cell.at))
        return 0;
    return ebpo_octcode_of_cell(cell);
}
