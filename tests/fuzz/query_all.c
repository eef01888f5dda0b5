#include "query_all.h"

#include <ebpo/lod.h>
#include <ebpo/query.h>
#include <ebpo/stream.h>
#include <ebpo/subtree.h>
#include <ebpo/verify.h>
#include <ebpo/view.h>
#include <string.h>

#include "read_by.h"
#include "derive/subset_parts.h"

/* --- hashes; FNV-1a, eight bytes at a time where there are as many --- */

static void add(uint64_t *h, const void *data, uint64_t bytes)
{
    const uint8_t *p = data;
    for (; data && bytes; p++, bytes--) {
        if (bytes >= 8) {
            uint64_t eight;
            memcpy(&eight, p, 8);
            *h = (*h ^ eight) * UINT64_C(1099511628211);
            *h ^= *h >> 29;
            p += 7;
            bytes -= 7;
        } else {
            *h = (*h ^ *p) * UINT64_C(1099511628211);
        }
    }
}

#define ADD(h, value) add(h, &(value), sizeof(value))

static void add_level(uint64_t *h, const ebpo_level *l)
{
    add(h, l->types, 2 * l->group_count);
    add(h, l->plane_counts, l->gray_count);
    add(h, l->planes, 4 * l->plane_count);
    add(h, l->leaf_winding, 4 * l->leaf_count);
    add(h, l->black_winding, 4 * l->black_count);
    add(h, l->white_winding, 4 * l->white_count);
    add(h, l->leaf_first, 8 * l->leaf_count);
    add(h, l->leaf_new, 4 * l->leaf_count);
    add(h, l->leaf_ref_count, 4 * l->leaf_count);
    add(h, l->leaf_refs, 4 * l->ref_count);
    add(h, l->leaf_plane_counts, l->leaf_count);
    add(h, l->leaf_planes, 4 * l->leaf_plane_count);
    add(h, l->gray_colours, 4 * l->gray_count);
    ADD(h, l->gray_volume);
    ADD(h, l->leaf_volume);
}

static void add_mesh(uint64_t *h, const ebpo_mesh *m)
{
    ADD(h, m->vertex_count);
    add(h, m->xyz32, 12 * m->vertex_count);
    add(h, m->xyz64, 24 * m->vertex_count);
    add(h, m->faces, 12 * m->face_count);
}

/* --- kinds --- */

typedef ebpo_status query_fn(ebpo_file *file, uint64_t *h);

/* The facts of `ebpo info`, except chunk offsets and the length of the file. */
static ebpo_status facts(ebpo_file *file, uint64_t *h)
{
    const ebpo_info *i = ebpo_file_info(file);
    ADD(h, i->version_minor);
    add(h, i->generator, strlen(i->generator));
    add(h, i->source_name, strlen(i->source_name));
    add(h, i->source_format, strlen(i->source_format));
    add(h, i->source_sha256, 32);
    add(h, i->unit, strlen(i->unit));
    add(h, i->crs, strlen(i->crs));
    add(h, i->date, strlen(i->date));
    ADD(h, i->source_size);
    ADD(h, i->solid);
    ADD(h, i->rule);
    ADD(h, i->double_coordinates);
    ADD(h, i->vertex_count);
    ADD(h, i->face_count);
    ADD(h, i->source_vertex_count);
    ADD(h, i->source_face_count);
    add(h, i->box_origin, sizeof i->box_origin);
    add(h, i->box_size, sizeof i->box_size);
    ADD(h, i->grid_level);
    ADD(h, i->max_level);
    ADD(h, i->level_count);
    ADD(h, i->leaf_faces);
    ADD(h, i->epsilon);
    ADD(h, i->repair_record.welded_vertices);
    ADD(h, i->report.edges);
    ADD(h, i->report.area);
    ADD(h, i->report.volume);
    add(h, i->report.min, sizeof i->report.min);
    add(h, i->report.max, sizeof i->report.max);
    ADD(h, i->parts);
    ADD(h, i->pruned);
    add(h, i->content_sha256, 32);
    for (int k = 0; k < i->level_count; k++) {
        ADD(h, i->level[k].gray_count);
        ADD(h, i->level[k].leaf_count);
        ADD(h, i->level[k].new_count);
        ADD(h, i->level[k].gray_volume);
        ADD(h, i->level[k].leaf_volume);
    }
    return EBPO_OK;
}

static ebpo_status levels(ebpo_file *file, uint64_t *h)
{
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < ebpo_file_info(file)->level_count && status == EBPO_OK; i++) {
        ebpo_level level;
        status = ebpo_file_read_level(file, i, READ_BY(1), &level, NULL);
        if (status != EBPO_OK)
            return status;
        add_level(h, &level);
        ebpo_level_free(&level);
    }
    return status;
}

static ebpo_status mesh(ebpo_file *file, uint64_t *h)
{
    ebpo_mesh m;
    ebpo_status status = ebpo_file_read_mesh(file, READ_BY(1), &m, NULL);
    if (status != EBPO_OK)
        return status;
    add_mesh(h, &m);
    ebpo_mesh_free(&m);
    return EBPO_OK;
}

static ebpo_status source_mesh(ebpo_file *file, uint64_t *h)
{
    ebpo_mesh m;
    ebpo_status status = ebpo_file_read_source_mesh(file, READ_BY(1), &m, NULL, NULL);
    if (status != EBPO_OK)
        return status;
    add_mesh(h, &m);
    ebpo_mesh_free(&m);
    return EBPO_OK;
}

static ebpo_status attributes(ebpo_file *file, uint64_t *h)
{
    ebpo_attribute_facts a = EBPO_ATTRIBUTE_FACTS_INIT;
    for (unsigned n = 0; ebpo_file_attribute(file, n, &a); n++) {
        ebpo_attribute_values v;
        size_t width = a.type <= EBPO_ATTRIBUTE_UINT8    ? 1
                       : a.type <= EBPO_ATTRIBUTE_UINT16 ? 2
                       : a.type < EBPO_ATTRIBUTE_FLOAT64 ? 4
                                                         : 8;
        ebpo_status status = ebpo_file_read_attribute(file, n, READ_BY(1), &v, NULL);
        if (status != EBPO_OK)
            return status;
        add(h, a.element, strlen(a.element));
        add(h, a.names, strlen(a.names));
        add(h, v.values, width * v.count);
        ebpo_attribute_values_free(&v);
    }
    return EBPO_OK;
}

/* Returns points in and around the model, the same for the same box. */
static void point(const ebpo_info *info, unsigned i, double p[3])
{
    static const double steps[3] = { 0.7548776662466927, 0.5698402909980532, 0.3247179572447461 };
    for (int k = 0; k < 3; k++) {
        double at = steps[k] * (i + 1);
        p[k] = info->box_origin[k] + info->box_size[k] * ((at - (double)(int64_t)at) * 1.2 - 0.1);
    }
}

enum { POINTS = 48 };

static ebpo_status query_point(ebpo_context *context, const ebpo_info *info, unsigned i,
                               uint64_t *h)
{
    double p[3], q[3];
    ebpo_inside_result where = { 0 };
    ebpo_distance_result near = { 0 };
    const ebpo_ray_hit *hits;
    const uint64_t *faces;
    uint64_t count;
    point(info, i, p);
    point(info, i + 7, q);
    ebpo_status status = info->solid ? ebpo_inside(context, p, NULL, &where, NULL) : EBPO_OK;
    ADD(h, where.where);
    ADD(h, where.winding);
    if (status == EBPO_OK)
        status = ebpo_distance(context, p, NULL, &near, NULL);
    ADD(h, near.distance);
    ADD(h, near.point);
    ADD(h, near.face);
    for (int k = 0; k < 3; k++)
        q[k] -= p[k];
    if (status == EBPO_OK)
        status = ebpo_ray_all(context, p, q, 10, &hits, &count, NULL);
    for (uint64_t k = 0; status == EBPO_OK && k < count; k++) {
        ADD(h, hits[k].t);
        ADD(h, hits[k].face);
        ADD(h, hits[k].side);
    }
    for (int k = 0; k < 3; k++)
        q[k] = p[k] + info->box_size[k] / 8;
    if (status == EBPO_OK)
        status = ebpo_faces_in_box(context, p, q, &faces, &count, NULL);
    if (status == EBPO_OK)
        add(h, faces, 8 * count);
    return status;
}

static ebpo_status queries(ebpo_file *file, int cut, uint64_t memory, uint64_t *h)
{
    const ebpo_info *info = ebpo_file_info(file);
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model *model;
    ebpo_context *context = NULL;
    options.cut_level = cut;
    options.threads = 1;
    options.memory = memory;
    ebpo_status status = ebpo_model_new(file, &options, &model, NULL);
    if (status != EBPO_OK)
        return status;
    status = ebpo_context_new(model, &context, NULL);
    for (unsigned i = 0; i < POINTS && status == EBPO_OK; i++)
        status = query_point(context, info, i, h);
    ebpo_context_free(context);
    ebpo_model_free(model);
    return status;
}

static ebpo_status whole_model(ebpo_file *file, uint64_t *h) { return queries(file, -1, 0, h); }
static ebpo_status parts(ebpo_file *file, uint64_t *h)
{
    return queries(file, 1, UINT64_C(64) << 20, h);
}

/* Results that need only envelopes. */
static ebpo_status by_level(ebpo_file *file, uint64_t *h)
{
    const ebpo_info *info = ebpo_file_info(file);
    ebpo_inside_options options = EBPO_INSIDE_OPTIONS_INIT;
    ebpo_model *model;
    ebpo_context *context = NULL;
    ebpo_status status = ebpo_model_new(file, NULL, &model, NULL);
    if (status != EBPO_OK)
        return status;
    status = ebpo_context_new(model, &context, NULL);
    options.level = info->level_count / 2;
    for (unsigned i = 0; i < POINTS && status == EBPO_OK && info->solid; i++) {
        double p[3];
        ebpo_inside_result where = { 0 };
        point(info, i, p);
        status = ebpo_inside(context, p, &options, &where, NULL);
        ADD(h, where.where);
        ADD(h, where.doubt);
    }
    ebpo_context_free(context);
    ebpo_model_free(model);
    return status;
}

static void add_node(uint64_t *h, const ebpo_stream_node *node)
{
    ADD(h, node->octcode);
    ADD(h, node->type);
    ADD(h, node->winding);
    add(h, node->planes, 32 * (uint64_t)node->plane_count);
    add(h, node->vertices, 24 * (uint64_t)node->vertex_count);
    add(h, node->corners,
        node->polygon_count ? 4 * (uint64_t)node->polygon_first[node->polygon_count] : 0);
}

static ebpo_status stream(ebpo_file *file, uint64_t *h)
{
    ebpo_stream_options options = EBPO_STREAM_OPTIONS_INIT;
    ebpo_stream *of;
    ebpo_stream_level level;
    ebpo_stream_node node;
    bool more = true;
    options.polygons = true;
    options.threads = 1;
    ebpo_status status = ebpo_stream_new(file, &options, &of, NULL);
    if (status != EBPO_OK)
        return status;
    while ((status = ebpo_stream_next_level(of, &level, &more, NULL)) == EBPO_OK && more) {
        ADD(h, level.volume);
        while ((status = ebpo_stream_next_node(of, &node, &more, NULL)) == EBPO_OK && more) {
            add_node(h, &node);
            ADD(h, node.colour);
        }
        if (status != EBPO_OK)
            break;
    }
    ebpo_stream_free(of);
    return status;
}

static ebpo_status view(ebpo_file *file, uint64_t *h)
{
    ebpo_view_options options = EBPO_VIEW_OPTIONS_INIT;
    ebpo_view_stream *of;
    ebpo_view_node node;
    ebpo_view_end end = EBPO_VIEW_NODE;
    options.polygons = options.windings = true;
    options.faces = ebpo_file_info(file)->parts & EBPO_PART_MESH;
    ebpo_status status = ebpo_view_stream_new(file, &options, &of, NULL);
    if (status != EBPO_OK)
        return status;
    while ((status = ebpo_view_stream_next(of, &node, &end, NULL)) == EBPO_OK &&
           end == EBPO_VIEW_NODE)
        add_node(h, &node.node);
    ADD(h, end);
    ebpo_view_stream_free(of);
    return status;
}

static ebpo_status subset(ebpo_file *file, uint64_t *h)
{
    ebpo_tree tree;
    ebpo_subset_options options = EBPO_SUBSET_OPTIONS_INIT;
    options.last_level = 2;
    options.threads = 1;
    ebpo_status status = ebpo_subset_tree(&tree, file, &options, NULL);
    if (status != EBPO_OK)
        return status;
    for (int i = 0; i < tree.info.level_count; i++)
        add_level(h, &tree.level[i]);
    ebpo_tree_free(&tree);
    return EBPO_OK;
}

static ebpo_status cut(ebpo_file *file, uint64_t *h)
{
    ebpo_lod_options options = EBPO_LOD_OPTIONS_INIT;
    ebpo_mesh m;
    options.threads = 1;
    ebpo_status status =
        ebpo_lod_level(file, ebpo_file_info(file)->level_count - 1, &options, &m, NULL, NULL);
    if (status != EBPO_OK)
        return status;
    add_mesh(h, &m);
    ebpo_mesh_free(&m);
    return EBPO_OK;
}

static ebpo_status subtrees(ebpo_file *file, uint64_t *h)
{
    ebpo_subtree_options options = EBPO_SUBTREE_OPTIONS_INIT;
    ebpo_subtree_nodes nodes = EBPO_SUBTREE_NODES_INIT;
    options.corners = options.or_leaf_above = true;
    for (uint64_t octcode = 1; octcode < 16; octcode++) {
        ebpo_subtree *of;
        ebpo_status status = ebpo_subtree_open(file, octcode, &options, &of, NULL);
        if (status == EBPO_E_ABSENT || status == EBPO_E_ARGUMENT)
            continue; /* there is none */
        if (status != EBPO_OK)
            return status;
        ebpo_subtree_get_nodes(of, &nodes);
        ADD(h, nodes.node_count);
        for (uint64_t i = 0; i < nodes.node_count; i++) {
            ebpo_subtree_node node = EBPO_SUBTREE_NODE_INIT;
            if (ebpo_subtree_get_node(of, i, true, &node, NULL) == EBPO_OK)
                add_node(h, &node.node);
        }
        ebpo_subtree_close(of);
    }
    return EBPO_OK;
}

const char *const query_names[QUERY_KINDS] = { "facts",
                                               "levels",
                                               "mesh",
                                               "source mesh",
                                               "attributes",
                                               "questions",
                                               "questions by parts",
                                               "questions by level",
                                               "stream",
                                               "view",
                                               "subset",
                                               "cut level",
                                               "subtrees" };
static query_fn *const kinds[QUERY_KINDS] = { facts,      levels,      mesh,   source_mesh,
                                              attributes, whole_model, parts,  by_level,
                                              stream,     view,        subset, cut,
                                              subtrees };

void query_all(const uint8_t *data, size_t size, bool verified, query_results *out)
{
    ebpo_file *file;
    *out = (query_results){ .open = ebpo_open_memory(data, size, "damaged", &file, NULL) };
    if (out->open != EBPO_OK)
        return;
    for (int i = 0; i < QUERY_KINDS; i++) {
        out->hash[i] = UINT64_C(14695981039346656037);
        out->status[i] = kinds[i](file, &out->hash[i]);
    }
    if (verified) {
        ebpo_verify_options options = EBPO_VERIFY_OPTIONS_INIT;
        ebpo_verify_report report = EBPO_VERIFY_REPORT_INIT;
        options.threads = 1;
        out->verify = ebpo_verify(file, &options, &report, NULL);
        out->violations = report.violations;
        out->spare_filled = report.spare_filled;
    }
    ebpo_close(file);
}
