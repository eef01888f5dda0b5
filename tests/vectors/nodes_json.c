/* Writes the .nodes.json of a passed vector; see nodes_json.h. */
#include "nodes_json.h"

#include <hdf5.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/query.h>

#include "change_file.h"
#include "geometry/cells.h"

enum { NODES_MAX = 600 };

bool nodes_json_fits(const ebpo_tree *tree)
{
    uint64_t nodes = 0, planes = 0;
    for (int l = 0; l < tree->info.level_count; l++) {
        nodes += 8 * tree->level[l].group_count;
        planes += tree->level[l].plane_count + tree->level[l].leaf_plane_count;
    }
    return nodes <= NODES_MAX && planes <= NODES_MAX;
}

/* --- attributes --- */

static void put_values(FILE *out, hid_t attribute, hid_t type, size_t count)
{
    double reals[8];
    int64_t numbers[8];
    bool real = H5Tget_class(type) == H5T_FLOAT;
    need(count <= 8 && H5Aread(attribute, real ? H5T_NATIVE_DOUBLE : H5T_NATIVE_INT64,
                               real ? (void *)reals : (void *)numbers) >= 0,
         "an attribute");
    fprintf(out, count > 1 ? "[" : "");
    for (size_t i = 0; i < count; i++) {
        if (i)
            fprintf(out, ",");
        if (real)
            fprintf(out, "%.17g", reals[i]);
        else
            fprintf(out, "%" PRId64, numbers[i]);
    }
    fprintf(out, count > 1 ? "]" : "");
}

static herr_t put_attribute(hid_t object, const char *name, const H5A_info_t *info, void *user)
{
    FILE *out = user;
    char text[1024] = "";
    hid_t attribute = H5Aopen(object, name, H5P_DEFAULT), type = H5Aget_type(attribute),
          space = H5Aget_space(attribute);
    (void)info;
    fprintf(out, "%s\n  \"%s\": ", ftell(out) > 20 ? "," : "", name);
    if (H5Tget_class(type) == H5T_STRING) {
        need(H5Tget_size(type) < sizeof text && H5Aread(attribute, type, text) >= 0, name);
        fprintf(out, "\"%s\"", text);
    } else {
        put_values(out, attribute, type, (size_t)H5Sget_simple_extent_npoints(space));
    }
    H5Sclose(space);
    H5Tclose(type);
    H5Aclose(attribute);
    return 0;
}

static void put_attributes(FILE *out, const char *path)
{
    hid_t id = H5Fopen(path, H5F_ACC_RDONLY, H5P_DEFAULT);
    fprintf(out, "{\"attributes\": {");
    need(id >= 0 && H5Aiterate2(id, H5_INDEX_NAME, H5_ITER_INC, NULL, put_attribute, out) >= 0,
         path);
    H5Fclose(id);
    fprintf(out, "},\n");
}

/* --- nodes --- */

typedef struct cell_box {
    double corner[3], size[3];
} cell_box;

static cell_box box_of(const ebpo_info *info, ebpo_octcode code)
{
    ebpo_cell cell = ebpo_cell_of_octcode(code);
    cell_box box;
    for (int k = 0; k < 3; k++) {
        box.size[k] = info->box_size[k] / (double)(UINT64_C(1) << ebpo_octcode_level(code));
        box.corner[k] = info->box_origin[k] + (double)cell.at[k] * box.size[k];
    }
    return box;
}

/* Writes n . xi <= d / 4096 in cell coordinates; and A x + B y + C z <= D in model coordinates. */
static void put_plane(FILE *out, const cell_box *box, uint32_t code, bool first)
{
    int32_t n[3], d;
    need(ebpo_plane_decode(code, n, &d), "a plane");
    double world[3], offset = d / 4096.0;
    for (int k = 0; k < 3; k++) {
        world[k] = n[k] / box->size[k];
        offset += world[k] * box->corner[k];
    }
    fprintf(out, "%s\n    {\"code\": %" PRIu32 ", \"n\": [%d,%d,%d], \"d\": %d, ", first ? "" : ",",
            code, n[0], n[1], n[2], d);
    fprintf(out, "\"model\": [%.17g,%.17g,%.17g,%.17g]}", world[0], world[1], world[2], offset);
}

typedef struct at_level {
    uint64_t rank[4], plane, leaf_plane; /* next index in the level */
} at_level;

static void put_node(FILE *out, const ebpo_tree *tree, int level, ebpo_octcode code, unsigned type,
                     at_level *at)
{
    static const char *const words[] = { "white", "black", "leaf", "gray" };
    const ebpo_level *l = &tree->level[level];
    cell_box b = box_of(&tree->info, code);
    uint64_t rank = at->rank[type]++;
    fprintf(out, "%s\n  {\"octcode\": %" PRIu64 ", \"type\": \"%s\", \"rank\": %" PRIu64 ",\n",
            code > 1 ? "," : "", code, words[type], rank);
    fprintf(out, "   \"corner\": [%.17g,%.17g,%.17g], \"size\": [%.17g,%.17g,%.17g],\n",
            b.corner[0], b.corner[1], b.corner[2], b.size[0], b.size[1], b.size[2]);
    fprintf(out, "   \"half_spaces\": [");
    if (type == EBPO_GRAY && l->plane_counts)
        for (unsigned i = 0; i < l->plane_counts[rank]; i++)
            put_plane(out, &b, l->planes[at->plane++], i == 0);
    if (type == EBPO_LEAF && l->leaf_plane_counts)
        for (unsigned i = 0; i < l->leaf_plane_counts[rank]; i++)
            put_plane(out, &b, l->leaf_planes[at->leaf_plane++], i == 0);
    fprintf(out, "]}");
}

/* Writes level by level: the gray nodes of one are the parents in the next, in the same order. */
static void put_nodes(FILE *out, const ebpo_tree *tree)
{
    ebpo_octcode parents[NODES_MAX] = { 0 }, next[NODES_MAX];
    fprintf(out, " \"nodes\": [");
    for (int level = 0; level < tree->info.level_count; level++) {
        const ebpo_level *l = &tree->level[level];
        at_level at = { .plane = 0 };
        uint64_t count = 0;
        for (uint64_t group = 0; group < l->group_count; group++)
            for (unsigned octant = 0; octant < (level ? 8u : 1u); octant++) {
                unsigned type = l->types[group] >> 2 * octant & 3;
                ebpo_octcode code = level ? ebpo_octcode_child(parents[group], octant) : 1;
                if (type == EBPO_GRAY)
                    next[count++] = code;
                if (level && l->types[group] == 0)
                    at.rank[0]++; /* a child position below a pruned node */
                else
                    put_node(out, tree, level, code, type, &at);
            }
        memcpy(parents, next, count * sizeof *next);
    }
    fprintf(out, "]");
}

/* --- points --- */

static void put_point(FILE *out, ebpo_context *context, const double point[3], bool first)
{
    static const char *const words[] = { "out", "in", "on" };
    ebpo_inside_result r;
    ebpo_error error = EBPO_ERROR_INIT;
    if (ebpo_inside(context, point, NULL, &r, &error) != EBPO_OK || r.where > EBPO_ON)
        die("inside", error.message);
    fprintf(out, "%s\n  {\"point\": [%.17g,%.17g,%.17g], \"where\": \"%s\", \"winding\": %d}",
            first ? "" : ",", point[0], point[1], point[2], words[r.where], r.winding);
}

static void put_points(FILE *out, const char *path, const ebpo_tree *tree)
{
    ebpo_file *in = NULL;
    ebpo_model *model = NULL;
    ebpo_context *context = NULL;
    ebpo_error error = EBPO_ERROR_INIT;
    const ebpo_info *info = &tree->info;
    if (ebpo_open(path, &in, &error) != EBPO_OK ||
        ebpo_model_new(in, NULL, &model, &error) != EBPO_OK ||
        ebpo_context_new(model, &context, &error) != EBPO_OK)
        die(path, error.message);
    fprintf(out, ",\n \"points\": [");
    for (int i = 0; i < 27; i++) { /* in the middle of 27 boxes */
        static const double at[] = { 0.1875, 0.375, 0.8125 };
        double point[3] = { at[i % 3], at[i / 3 % 3], at[i / 9] };
        for (int k = 0; k < 3; k++)
            point[k] = info->box_origin[k] + point[k] * info->box_size[k];
        put_point(out, context, point, i == 0);
    }
    double corner[3];
    for (int k = 0; k < 3; k++)
        corner[k] = tree->mesh.xyz32 ? tree->mesh.xyz32[k] : tree->mesh.xyz64[k];
    put_point(out, context, corner, false);
    fprintf(out, "]");
    ebpo_context_free(context);
    ebpo_model_free(model);
    ebpo_close(in);
}

char *nodes_json(const char *path, const ebpo_tree *tree)
{
    char *text = NULL;
    size_t size = 0;
    FILE *out = open_memstream(&text, &size);
    put_attributes(out, path);
    put_nodes(out, tree);
    if (tree->info.solid && !tree->info.pruned && tree->info.parts & EBPO_PART_MESH)
        put_points(out, path, tree);
    fprintf(out, "}\n");
    fclose(out);
    return text;
}
