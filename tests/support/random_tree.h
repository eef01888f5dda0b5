/* Trees whose counts, orders and ranges are valid in files but that describe no shape, for tests of
 * the container. */
#ifndef RANDOM_TREE_H
#define RANDOM_TREE_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/file.h>

#include "core/alloc.h"
#include "geometry/cells.h"
#include "geometry/polytope.h"

typedef struct random_tree_options {
    uint64_t seed;
    int levels;          /* exact number */
    unsigned gray_share; /* gray children of 16, above the deepest level */
    unsigned new_faces;  /* maximum number of new faces of a leaf */
    bool solid, doubles, windings, leaf_planes;
} random_tree_options;

typedef struct random_tree_maker {
    ebpo_tree *tree;
    const random_tree_options *options;
    uint64_t state, seen;
    uint64_t capacity[EBPO_LEVELS_MAX][12];
} random_tree_maker;

static uint32_t rt_random(random_tree_maker *m, uint32_t below)
{
    m->state = m->state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (uint32_t)((m->state >> 33) % below);
}

#define RT_PUSH(level_, slot_, array_, count_, value_)                                          \
    do {                                                                                        \
        if (!ebpo_grow(&(array_), &m->capacity[level_][slot_], (count_) + 1, sizeof *(array_))) \
            abort();                                                                            \
        (array_)[(count_)] = (value_);                                                          \
    } while (0)

static uint32_t rt_plane(random_tree_maker *m)
{
    int32_t n[3], d;
    for (;;) {
        uint32_t code = rt_random(m, 1u << 30) << 2 | rt_random(m, 4);
        if (ebpo_plane_code_decode(code, n, &d))
            return code;
    }
}

static void rt_leaf(random_tree_maker *m, int level)
{
    ebpo_level *l = &m->tree->level[level];
    uint32_t fresh = rt_random(m, m->options->new_faces + 1), refs = 0;
    if (m->seen == 0 && fresh == 0)
        fresh = 1;
    for (uint64_t at = 0; m->seen > 0 && rt_random(m, 4); at++, refs++) {
        at += rt_random(m, (uint32_t)(m->seen / 3 + 1));
        if (at >= m->seen)
            break;
        RT_PUSH(level, 0, l->leaf_refs, l->ref_count, (uint32_t)at);
        l->ref_count++;
    }
    if (m->options->solid) {
        int32_t winding =
            m->options->windings ? (int32_t)rt_random(m, 70000) - 35000 : (int32_t)rt_random(m, 2);
        RT_PUSH(level, 1, l->leaf_winding, l->leaf_count, winding);
    }
    RT_PUSH(level, 2, l->leaf_first, l->leaf_count, m->seen);
    RT_PUSH(level, 3, l->leaf_new, l->leaf_count, fresh);
    RT_PUSH(level, 4, l->leaf_ref_count, l->leaf_count, refs);
    if (m->options->leaf_planes) {
        uint32_t planes = rt_random(m, 5);
        RT_PUSH(level, 5, l->leaf_plane_counts, l->leaf_count, (uint8_t)planes);
        for (uint32_t i = 0; i < planes; i++) {
            RT_PUSH(level, 6, l->leaf_planes, l->leaf_plane_count, rt_plane(m));
            l->leaf_plane_count++;
        }
    }
    l->leaf_count++;
    l->new_count += fresh;
    m->seen += fresh;
}

static void rt_node(random_tree_maker *m, int level, ebpo_node_type type);

static void rt_gray(random_tree_maker *m, int level)
{
    ebpo_level *l = &m->tree->level[level], *below = &m->tree->level[level + 1];
    uint32_t planes = rt_random(m, 4);
    unsigned types = 0;
    RT_PUSH(level, 7, l->plane_counts, l->gray_count, (uint8_t)planes);
    for (uint32_t i = 0; i < planes; i++) {
        RT_PUSH(level, 8, l->planes, l->plane_count, rt_plane(m));
        l->plane_count++;
    }
    l->gray_count++;
    bool may_divide = level + 2 < m->options->levels;
    for (int octant = 0; octant < 8; octant++) {
        unsigned type = may_divide && (rt_random(m, 16) < m->options->gray_share || octant == 0)
                            ? EBPO_GRAY
                            : rt_random(m, 3);
        if (type == EBPO_BLACK && !m->options->solid)
            type = EBPO_LEAF;
        if (!may_divide && octant == 0)
            type = EBPO_LEAF;
        types |= type << 2 * octant;
    }
    RT_PUSH(level + 1, 9, below->types, below->group_count, (uint16_t)types);
    below->group_count++;
    for (int octant = 0; octant < 8; octant++)
        rt_node(m, level + 1, (ebpo_node_type)(types >> 2 * octant & 3));
}

static void rt_node(random_tree_maker *m, int level, ebpo_node_type type)
{
    ebpo_level *l = &m->tree->level[level];
    bool odd = m->options->windings;
    if (type == EBPO_GRAY) {
        rt_gray(m, level);
    } else if (type == EBPO_LEAF) {
        rt_leaf(m, level);
    } else if (type == EBPO_BLACK) {
        if (odd)
            RT_PUSH(level, 10, l->black_winding, l->black_count, 1 + 2 * (int32_t)rt_random(m, 90));
        l->black_count++;
    } else {
        if (odd)
            RT_PUSH(level, 11, l->white_winding, l->white_count,
                    2 * (int32_t)rt_random(m, 90) - 90);
        l->white_count++;
    }
}

static float rt_coordinate(random_tree_maker *m)
{
    return rt_random(m, 50) == 0 ? -0.0f
                                 : (float)((double)rt_random(m, 1u << 30) / (1u << 30) - 0.5);
}

static void rt_mesh(random_tree_maker *m)
{
    ebpo_mesh *mesh = &m->tree->mesh;
    uint64_t seen = 0;
    mesh->face_count = m->seen;
    mesh->faces = ebpo_alloc(m->seen, 3 * sizeof *mesh->faces);
    for (uint64_t i = 0; i < 3 * m->seen; i++) {
        bool fresh = seen < 3 || rt_random(m, 6) == 0;
        mesh->faces[i] =
            fresh ? (uint32_t)seen++
                  : (uint32_t)(seen - 1 - rt_random(m, seen < 500 ? (uint32_t)seen : 500));
    }
    mesh->vertex_count = seen + 2; /* two unreferenced ones */
    mesh->xyz32 = m->options->doubles ? NULL : ebpo_alloc(mesh->vertex_count, 3 * sizeof(float));
    mesh->xyz64 = m->options->doubles ? ebpo_alloc(mesh->vertex_count, 3 * sizeof(double)) : NULL;
    for (uint64_t i = 0; i < 3 * mesh->vertex_count; i++)
        if (m->options->doubles)
            mesh->xyz64[i] = (double)rt_coordinate(m) * 1.000000000123;
        else
            mesh->xyz32[i] = rt_coordinate(m);
}

static uint32_t *rt_permutation(random_tree_maker *m, uint64_t count)
{
    uint32_t *map = ebpo_alloc(count, sizeof *map);
    for (uint64_t i = 0; i < count; i++)
        map[i] = (uint32_t)i;
    for (uint64_t i = count; i > 1; i--) {
        uint32_t other = rt_random(m, (uint32_t)i), value = map[i - 1];
        map[i - 1] = map[other];
        map[other] = value;
    }
    return map;
}

static void rt_facts(random_tree_maker *m)
{
    ebpo_info *info = &m->tree->info;
    const double min[3] = { -0.5, -0.5, -0.5 }, max[3] = { 0.5, 0.5, 0.5 };
    ebpo_box box;
    if (!ebpo_box_make(&box, min, max, 14))
        abort();
    memcpy(info->box_origin, box.origin, sizeof info->box_origin);
    memcpy(info->box_size, box.size, sizeof info->box_size);
    info->grid_level = box.grid_level;
    info->level_count = m->options->levels;
    info->max_level = m->options->levels - 1;
    info->solid = m->options->solid;
    info->rule = m->options->windings ? EBPO_RULE_EVENODD : EBPO_RULE_NONZERO;
    info->double_coordinates = m->options->doubles;
    info->vertex_count = info->source_vertex_count = m->tree->mesh.vertex_count;
    info->face_count = info->source_face_count = m->tree->mesh.face_count;
    info->leaf_faces = 16;
    info->epsilon = 0.003;
    info->parts = EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS |
                  (m->options->leaf_planes ? EBPO_PART_LEAF_PLANES : 0);
    snprintf(info->source_name, sizeof info->source_name, "r\xc3\xa4ndom.ply");
    snprintf(info->source_format, sizeof info->source_format, "ply-le");
    info->source_size = 12345;
    memset(info->source_sha256, 0xa5, 32);
    snprintf(info->unit, sizeof info->unit, "m");
    info->report.balanced = m->options->solid;
    info->report.edges = 3 * info->face_count / 2;
    info->report.genus = -1;
    info->report.volume = 0.25;
    memcpy(info->report.min, min, sizeof min);
    memcpy(info->report.max, max, sizeof max);
    for (int i = 0; i < info->level_count; i++) {
        m->tree->level[i].gray_volume = 1.0 / (i + 1);
        m->tree->level[i].leaf_volume = 0.5 / (i + 1);
    }
}

static void random_tree_make(ebpo_tree *tree, const random_tree_options *options)
{
    random_tree_maker m = { .tree = tree, .options = options, .state = options->seed * 7919 + 17 };
    memset(tree, 0, sizeof *tree);
    ebpo_node_type root = options->levels == 1 ? EBPO_LEAF : EBPO_GRAY;
    tree->level[0].types = ebpo_alloc(1, sizeof(uint16_t));
    tree->level[0].types[0] = (uint16_t)root;
    tree->level[0].group_count = 1;
    rt_node(&m, 0, root);
    rt_mesh(&m);
    tree->vertex_source = rt_permutation(&m, tree->mesh.vertex_count);
    tree->face_source = rt_permutation(&m, tree->mesh.face_count);
    rt_facts(&m);
}

/* Adds colours of gray nodes. */
static inline void random_tree_paint(ebpo_tree *tree)
{
    random_tree_maker m = { .state = tree->mesh.face_count };
    for (int i = 0; i < tree->info.level_count; i++) {
        ebpo_level *l = &tree->level[i];
        l->gray_colours = l->gray_count ? ebpo_alloc(l->gray_count, sizeof *l->gray_colours) : NULL;
        for (uint64_t k = 0; k < l->gray_count; k++)
            l->gray_colours[k] = rt_random(&m, 1 << 24);
    }
    tree->info.parts |= EBPO_PART_COLOURS;
}

#endif
