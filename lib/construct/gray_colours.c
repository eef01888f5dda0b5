/* Computes the colours of gray nodes: the mean of the colours of the faces below a node, weighted
 * by area (format-spec/colours.md).
 *
 * The levels are processed from the deepest upwards: the sums of a gray node are the sums over its
 * group of eight children. No data is stored for each face. The weight of a face is computed again
 * for each leaf that lists the face; this takes little time, because most faces are in one leaf
 * only. Weights and sums are integers, so the result is exact and does not depend on the number of
 * threads. The colour of a face is the mean of its vertices' colours. Exception: if faces have
 * colours, and the vertices have no colours or all have the same colour, the face's own colour is
 * used. lib/verify computes the same colours with separate code. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "construct/construct_stages.h"
#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/wide.h"
#include "geometry/level_nodes.h"
#include "geometry/vec3.h"
#include "mesh/attributes.h"

/* GROUP_GRAIN: number of groups of a task. GROUPS_A_TIME: number of groups after which pages of the
 * workspace are released. */
enum { GROUP_GRAIN = 1 << 12, GROUPS_A_TIME = 16 };

/* Sums over the faces below a node. A face counts once for each leaf that lists the face. */
typedef struct colour_sums {
    ebpo_wide colour[3]; /* sums of 3 * weight * colour */
    ebpo_wide weight;    /* sum of 3 * weight */
} colour_sums;

/* How many of a level's leaves, gray nodes and references come before the groups of a task. (A
 * reference is an element of leaf_refs: a face that an earlier leaf also lists.) */
typedef struct task_start {
    uint64_t leaf, gray, ref;
} task_start;

typedef struct colouring {
    ebpo_tree *tree;
    double size;  /* longest side of the root box */
    bool by_face; /* true: `column` has the colours of faces; false: of vertices */
    ebpo_colour_column column[EBPO_COLOUR_CHANNELS];
    const ebpo_level *level;  /* level whose groups are added up */
    const task_start *start;  /* [task] */
    const colour_sums *below; /* [gray node of the level] sums */
    /* [group] sums and colours of the level's groups. They are the sums and the colour of the
     * group's parent, a gray node of the level above */
    colour_sums *above;
    uint32_t *colours; /* bytes 0 to 2: red, green, blue */
} colouring;

/* Returns the weight of a face: 1 + floor(2^32 times its doubled area, divided by size^2). */
static uint64_t weight_of(const colouring *c, uint64_t face)
{
    const uint32_t *corner = c->tree->mesh.faces + 3 * face;
    double p[3][3], u[3], v[3], normal[3];
    for (int k = 0; k < 3; k++)
        ebpo_mesh_position(&c->tree->mesh, corner[k], p[k]);
    for (int k = 0; k < 3; k++) {
        u[k] = (p[1][k] - p[0][k]) / c->size;
        v[k] = (p[2][k] - p[0][k]) / c->size;
    }
    ebpo_vec3_cross(u, v, normal);
    return 1 + (uint64_t)(ebpo_vec3_length(normal) * 0x1p32);
}

static void add_face(const colouring *c, uint64_t face, colour_sums *sums)
{
    uint64_t weight = weight_of(c, face);
    const uint32_t *corner = c->tree->mesh.faces + 3 * face;
    for (int k = 0; k < 3; k++) {
        /* 3 times the face's colour */
        unsigned triple = c->by_face ? 3u * ebpo_colour_byte(&c->column[k], face) : 0;
        for (int i = 0; i < 3 && !c->by_face; i++)
            triple += ebpo_colour_byte(&c->column[k], corner[i]);
        sums->colour[k] = ebpo_wide_plus(sums->colour[k], ebpo_wide_product(weight, triple));
    }
    sums->weight = ebpo_wide_plus(sums->weight, ebpo_wide_product(weight, 3));
}

static void add_sums(colour_sums *to, const colour_sums *more)
{
    for (int k = 0; k < 3; k++)
        to->colour[k] = ebpo_wide_plus(to->colour[k], more->colour[k]);
    to->weight = ebpo_wide_plus(to->weight, more->weight);
}

/* Adds the faces of a leaf to the sums. `ref`: index in leaf_refs of the leaf's first reference. */
static void add_leaf(const colouring *c, uint64_t leaf, uint64_t ref, colour_sums *sums)
{
    const ebpo_level *l = c->level;
    for (uint32_t i = 0; i < l->leaf_new[leaf]; i++)
        add_face(c, l->leaf_first[leaf] + i, sums);
    for (uint32_t i = 0; i < l->leaf_ref_count[leaf]; i++)
        add_face(c, l->leaf_refs[ref + i], sums);
}

/* Returns the byte nearest to colour / weight; halves are rounded up. This byte is the greatest one
 * with 2 * byte * weight <= 2 * colour + weight. The loop finds its bits one after the other. */
static uint32_t mean_of_channel(ebpo_wide colour, ebpo_wide weight)
{
    ebpo_wide limit = ebpo_wide_plus(ebpo_wide_left(colour, 1), weight);
    uint32_t byte = 0;
    for (uint32_t bit = 128; bit; bit >>= 1)
        if (!ebpo_wide_less(limit, ebpo_wide_times(weight, 2 * (byte | bit))))
            byte |= bit;
    return byte;
}

/* Returns the mean colour, with red in byte 0. */
static uint32_t mean_of(const colour_sums *sums)
{
    uint32_t colour = 0;
    for (int k = 0; k < 3; k++)
        colour |= mean_of_channel(sums->colour[k], sums->weight) << 8 * k;
    return colour;
}

/* Computes the sums and colours of groups of a level. */
static ebpo_status add_groups(void *context, uint64_t begin, uint64_t end, unsigned worker,
                              ebpo_error *error)
{
    const colouring *c = context;
    task_start at = c->start[begin / GROUP_GRAIN];
    (void)worker, (void)error;
    EBPO_FOR_ITEMS_EVERY(c->tree->workspace, GROUPS_A_TIME, group, begin, end) {
        colour_sums sums = { .weight = 0 };
        for (unsigned octant = 0; octant < 8; octant++) {
            ebpo_node_type type = ebpo_group_type(c->level->types[group], octant);
            if (type == EBPO_GRAY)
                add_sums(&sums, &c->below[at.gray++]);
            if (type != EBPO_LEAF)
                continue;
            add_leaf(c, at.leaf, at.ref, &sums);
            at.ref += c->level->leaf_ref_count[at.leaf++];
        }
        c->above[group] = sums;
        c->colours[group] = mean_of(&sums);
    }
    return EBPO_OK;
}

/* Returns the starts of all tasks for c->level, which the caller frees; NULL when out of memory. */
static task_start *find_starts(const colouring *c)
{
    const ebpo_level *l = c->level;
    task_start at = { 0, 0, 0 },
               *start = ebpo_alloc(l->group_count / GROUP_GRAIN + 1, sizeof *start);
    EBPO_FOR_ITEMS(c->tree->workspace, group, 0, start ? l->group_count : 0) {
        if (group % GROUP_GRAIN == 0)
            start[group / GROUP_GRAIN] = at;
        unsigned leaves = ebpo_group_count(l->types[group], EBPO_LEAF, 8);
        at.gray += ebpo_group_count(l->types[group], EBPO_GRAY, 8);
        for (; leaves; leaves--)
            at.ref += l->leaf_ref_count[at.leaf++];
    }
    return start;
}

/* Colours the gray nodes of level `level` - 1, the parents of the groups of `level`. */
static ebpo_status colour_level(const ebpo_builder *b, colouring *c, int level,
                                const ebpo_progress *progress, ebpo_error *error)
{
    ebpo_workspace *workspace = c->tree->workspace;
    uint64_t groups = c->tree->level[level].group_count;
    c->level = &c->tree->level[level];
    task_start *start = find_starts(c);
    c->start = start;
    c->above = ebpo_array_alloc(workspace, groups, sizeof *c->above);
    c->colours = ebpo_array_alloc(workspace, groups, sizeof *c->colours);
    c->tree->level[level - 1].gray_colours = c->colours;
    ebpo_status status = start && c->above && c->colours
                             ? EBPO_OK
                             : ebpo_workspace_fail(workspace, groups * sizeof *c->above, error);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(b->threads, workspace, groups, GROUP_GRAIN, add_groups, c,
                                   progress, "colours of envelopes", error);
    free(start);
    return status;
}

/* Returns true if all vertices have the same colour. */
static bool have_equal_colours(const colouring *c)
{
    uint8_t first[3];
    for (int k = 0; k < 3; k++)
        first[k] = ebpo_colour_byte(&c->column[k], 0);
    EBPO_FOR_ITEMS(c->tree->workspace, i, 1, c->tree->mesh.vertex_count)
        for (int k = 0; k < 3; k++)
            if (ebpo_colour_byte(&c->column[k], i) != first[k])
                return false;
    return true;
}

/* Chooses the colours of vertices or the colours of faces. */
static void choose_columns(colouring *c)
{
    const ebpo_attributes *attributes = c->tree->mesh.attributes;
    ebpo_colour_column of_face[EBPO_COLOUR_CHANNELS];
    bool faces = ebpo_colour_columns(attributes, "face", of_face),
         vertices = ebpo_colour_columns(attributes, "vertex", c->column);
    c->by_face = faces && (!vertices || have_equal_colours(c));
    for (int k = 0; k < EBPO_COLOUR_CHANNELS && c->by_face; k++)
        c->column[k] = of_face[k];
}

ebpo_status ebpo_build_gray_colours(const ebpo_builder *b, ebpo_tree *out, ebpo_error *error)
{
    const double *size = b->box.size;
    colouring c = { .tree = out, .size = fmax(size[0], fmax(size[1], size[2])) };
    colour_sums *below = NULL;
    uint64_t groups = 0, done = 0;
    ebpo_status status = EBPO_OK;
    choose_columns(&c);
    for (int level = 1; level < out->info.level_count; level++)
        groups += out->level[level].group_count;
    for (int level = out->info.level_count - 1; level > 0 && status == EBPO_OK; level--) {
        uint64_t count = out->level[level].group_count;
        ebpo_pass pass = { &b->options->progress, done, done + count, groups };
        ebpo_progress progress = ebpo_pass_progress(&pass);
        c.below = below;
        status = colour_level(b, &c, level, &progress, error);
        ebpo_array_free(out->workspace, below);
        below = c.above;
        done += count;
    }
    ebpo_array_free(out->workspace, below);
    return status;
}
