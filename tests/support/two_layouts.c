#include "two_layouts.h"

#include <stdlib.h>
#include <string.h>

#include "model_file.h"
#include "geometry/level_nodes.h"
#include "read_by.h"
#include "scratch.h"

void two_layouts_write(two_layouts *out, ebpo_tree *tree, uint32_t parts, ebpo_codec codec,
                       uint64_t subtree_faces)
{
    ebpo_write_options options = EBPO_WRITE_OPTIONS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    *out = (two_layouts){ scratch("packed.ebpo.h5"), scratch("plain.ebpo.h5"), NULL, NULL };
    options.parts = parts;
    options.codec = codec;
    options.threads = 1;
    options.subtree_faces = subtree_faces;
    model_must(ebpo_tree_write(tree, out->packed, &options, &error), "writing", &error);
    options.subtree_faces = EBPO_NO_SUBTREES;
    model_write(tree, out->plain, &options);
    out->with = model_open(out->packed);
    out->without = model_open(out->plain);
}

void two_layouts_build(two_layouts *out, ebpo_mesh mesh, uint32_t leaf_faces, uint32_t parts,
                       ebpo_codec codec, uint64_t subtree_faces)
{
    ebpo_tree tree = model_build_parts(mesh, leaf_faces, parts);
    two_layouts_write(out, &tree, parts, codec, subtree_faces);
}

void two_layouts_close(two_layouts *l)
{
    ebpo_close(l->with);
    ebpo_close(l->without);
}

/* Adds data to a checksum (FNV-1a). */
static uint64_t add(uint64_t sum, const void *data, uint64_t bytes)
{
    for (uint64_t i = 0; data && i < bytes; i++)
        sum = (sum ^ ((const uint8_t *)data)[i]) * UINT64_C(1099511628211);
    return (sum ^ bytes) * UINT64_C(1099511628211);
}

static uint64_t nodes_sum(uint64_t sum, const ebpo_subtree_nodes *n)
{
    uint64_t nodes = n->node_count, above = n->above_first ? n->above_first[n->level] : 0,
             planes = n->plane_first ? n->plane_first[nodes] : 0;
    sum = add(sum, n->level_first, ((uint64_t)n->level_count + 1) * 8);
    sum = add(sum, n->octcodes, nodes * 8);
    sum = add(sum, n->types, nodes);
    sum = add(sum, n->windings, n->windings ? nodes * 4 : 0);
    sum = add(sum, n->children, nodes * 4);
    sum = add(sum, n->plane_first, n->plane_first ? (nodes + 1) * 4 : 0);
    sum = add(sum, n->planes, planes * 4);
    return add(sum, n->above_planes, above * 4);
}

static uint64_t faces_sum(uint64_t sum, const ebpo_subtree_faces *f, uint64_t nodes)
{
    sum = add(sum, f->list_first, (nodes + 1) * 4);
    sum = add(sum, f->list, (uint64_t)f->list_first[nodes] * 4);
    sum = add(sum, f->file_faces, f->face_count * 4);
    sum = add(sum, f->source, f->source ? f->face_count * 4 : 0);
    sum = add(sum, f->corners32, f->corners32 ? f->face_count * 36 : 0);
    sum = add(sum, f->corners64, f->corners64 ? f->face_count * 72 : 0);
    return add(sum, &f->shared_count, sizeof f->shared_count);
}

uint64_t subtree_sum(const ebpo_file *file, uint64_t octcode, ebpo_status *status)
{
    ebpo_subtree *subtree = NULL;
    ebpo_subtree_options options = EBPO_SUBTREE_OPTIONS_INIT;
    ebpo_subtree_nodes nodes = EBPO_SUBTREE_NODES_INIT;
    ebpo_subtree_faces faces = EBPO_SUBTREE_FACES_INIT;
    uint64_t sum = UINT64_C(14695981039346656037);
    options.corners = true;
    *status = ebpo_subtree_open(file, octcode, &options, &subtree, NULL);
    if (*status == EBPO_OK && ebpo_subtree_get_nodes(subtree, &nodes) == EBPO_OK)
        sum = nodes_sum(sum, &nodes);
    if (*status == EBPO_OK && ebpo_subtree_get_faces(subtree, &faces, NULL) == EBPO_OK)
        sum = faces_sum(sum, &faces, nodes.node_count);
    ebpo_subtree_close(subtree);
    return sum;
}

uint64_t *octcodes_of_level(const ebpo_file *file, int level, uint64_t *count)
{
    const ebpo_info *info = ebpo_file_info(file);
    uint64_t *gray = malloc(sizeof *gray), *wanted = NULL, grays = 1, wanteds = 0;
    gray[0] = 0; /* octcode of the root's parent; the root's octcode is 1 */
    for (int i = 0; i <= level; i++) {
        ebpo_level l;
        ebpo_error error = EBPO_ERROR_INIT;
        model_must(ebpo_file_read_level(file, i, READ_BY(1), &l, &error), "reading", &error);
        uint64_t *next = malloc((8 * l.group_count + 1) * sizeof *next);
        wanted = realloc(wanted, (8 * l.group_count + 1) * sizeof *wanted);
        uint64_t nexts = 0;
        wanteds = 0;
        for (uint64_t g = 0; g < grays && g < l.group_count; g++)
            for (unsigned octant = 0; octant < ebpo_group_octants(i); octant++) {
                ebpo_node_type type = ebpo_group_type(l.types[g], octant);
                uint64_t code = i ? gray[g] << 3 | octant : 1;
                if (type >= EBPO_LEAF && !(type == EBPO_GRAY && info->pruned))
                    wanted[wanteds++] = code;
                if (type == EBPO_GRAY)
                    next[nexts++] = code;
            }
        free(gray);
        gray = next;
        grays = nexts;
        ebpo_level_free(&l);
    }
    free(gray);
    *count = wanteds;
    return wanted;
}
