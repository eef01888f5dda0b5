/* Reads levels, for the WebAssembly module: streams of nodes, envelopes as polygons, and the mesh.
 */
#include <stdlib.h>
#include <string.h>

#include "module.h"

/* ---- streams ---- */

/* Makes the stream of a query object. */
int EBPO_JS(ebpo_js_stream)(ebpo_js_object *object, int planes, int polygons)
{
    ebpo_stream_options options = EBPO_STREAM_OPTIONS_INIT;
    options.planes = planes;
    options.polygons = polygons;
    options.threads = 1;
    return ebpo_stream_new(object->file, &options, &object->stream, &object->error);
}

/* Result arrays of a level of the stream. All arrays before LEVEL_FACTS are for the nodes of the
 * level, one node after the other. */
enum stream_array {
    NODE_CODES,     /* uint64 for each node: octcode */
    NODE_TYPES,     /* uint8 for each node */
    NODE_WINDINGS,  /* int32 for each node: winding number */
    NODE_CELLS,     /* double [6] for each node: min, max */
    NODE_VOLUMES,   /* double for each node */
    NODE_COLOURS,   /* uint32 for each node; UINT32_MAX: no colour */
    PLANE_COUNTS,   /* uint32 for each node: number of planes */
    PLANES,         /* double [4] for each plane */
    VERTEX_COUNTS,  /* uint32 for each node: number of vertices */
    VERTICES,       /* double [3] for each vertex */
    POLYGON_COUNTS, /* uint32 for each node: number of polygons */
    POLYGON_FIRST,  /* uint32 [polygon_count + 1] for each node with polygons: index of each
                       polygon's first corner among the node's CORNERS; then their number */
    CORNERS,        /* uint32 for each corner: index of a vertex of the node */
    LEVEL_FACTS = EBPO_JS_NODE_ARRAYS /* double [4]: level, number of nodes, bytes, volume */
};

static bool put_polygons(ebpo_js_object *object, const ebpo_stream_node *n)
{
    if (ebpo_js_put(object, VERTEX_COUNTS, &n->vertex_count, 4) != EBPO_OK ||
        ebpo_js_put(object, POLYGON_COUNTS, &n->polygon_count, 4) != EBPO_OK)
        return false;
    if (!n->polygon_count)
        return true;
    return ebpo_js_put(object, VERTICES, n->vertices, n->vertex_count * sizeof *n->vertices) ==
               EBPO_OK &&
           ebpo_js_put(object, POLYGON_FIRST, n->polygon_first, 4 * (n->polygon_count + 1)) ==
               EBPO_OK &&
           ebpo_js_put(object, CORNERS, n->corners, 4 * n->polygon_first[n->polygon_count]) ==
               EBPO_OK;
}

bool ebpo_js_put_node(ebpo_js_object *object, const ebpo_stream_node *n)
{
    uint8_t type = (uint8_t)n->type;
    uint32_t colour = n->coloured ? n->colour : UINT32_MAX;
    double cell[6] = { n->min[0], n->min[1], n->min[2], n->max[0], n->max[1], n->max[2] };
    return ebpo_js_put(object, NODE_CODES, &n->octcode, sizeof n->octcode) == EBPO_OK &&
           ebpo_js_put(object, NODE_TYPES, &type, sizeof type) == EBPO_OK &&
           ebpo_js_put(object, NODE_WINDINGS, &n->winding, sizeof n->winding) == EBPO_OK &&
           ebpo_js_put(object, NODE_CELLS, cell, sizeof cell) == EBPO_OK &&
           ebpo_js_put(object, NODE_VOLUMES, &n->volume, sizeof n->volume) == EBPO_OK &&
           ebpo_js_put(object, NODE_COLOURS, &colour, sizeof colour) == EBPO_OK &&
           ebpo_js_put(object, PLANE_COUNTS, &n->plane_count, sizeof n->plane_count) == EBPO_OK &&
           ebpo_js_put(object, PLANES, n->planes, n->plane_count * sizeof *n->planes) == EBPO_OK &&
           put_polygons(object, n);
}

/* Reads the next level of the stream. After the last level, array LEVEL_FACTS is empty. After
 * EBPO_E_PENDING, the next call appends the remaining nodes of the level to the arrays. */
int EBPO_JS(ebpo_js_next_level)(ebpo_js_object *object)
{
    bool more = false;
    ebpo_status status = EBPO_OK;
    if (!object->within_level) {
        ebpo_stream_level level;
        ebpo_js_clear(object);
        status = ebpo_stream_next_level(object->stream, &level, &more, &object->error);
        if (status != EBPO_OK || !more)
            return status;
        double facts[4] = { level.level, (double)level.node_count, (double)level.cumulative_bytes,
                            level.volume };
        status = ebpo_js_put(object, LEVEL_FACTS, facts, sizeof facts);
        object->within_level = status == EBPO_OK;
    }
    while (status == EBPO_OK) {
        ebpo_stream_node node;
        status = ebpo_stream_next_node(object->stream, &node, &more, &object->error);
        if (status == EBPO_OK && !more)
            break;
        if (status == EBPO_OK && !ebpo_js_put_node(object, &node))
            status = EBPO_E_MEMORY;
    }
    if (status != EBPO_E_PENDING)
        object->within_level = false;
    return status;
}

/* ---- envelopes of a level ---- */

/* Arrays of ebpo_js_level. */
enum {
    LOD_VERTICES,
    LOD_TRIANGLES,
    LOD_CORNER_COUNTS,
    LOD_NORMALS,
    LOD_OCTCODES,
    LOD_TYPES,
    LOD_WINDINGS,
    LOD_VOLUMES,
    LOD_VERTEX_COUNTS,
    LOD_POLYGON_COUNTS,
    LOD_COLOURS,
    LOD_LEVEL_VOLUME
};

static ebpo_status put_lod(ebpo_js_object *object, const ebpo_mesh *mesh,
                           const ebpo_lod_nodes *nodes, double volume)
{
    size_t polygons = (size_t)nodes->polygon_count;
    float *normals = ebpo_js_extend(object, LOD_NORMALS, polygons, 3 * sizeof *normals);
    ebpo_status status = normals ? ebpo_lod_normals(ebpo_file_info(object->file), mesh, nodes,
                                                    normals, &object->error)
                                 : EBPO_E_MEMORY;
    bool ok =
        status == EBPO_OK &&
        ebpo_js_put(object, LOD_VERTICES, mesh->xyz64, (size_t)mesh->vertex_count * 24) ==
            EBPO_OK &&
        ebpo_js_put(object, LOD_TRIANGLES, mesh->faces, (size_t)mesh->face_count * 12) == EBPO_OK &&
        ebpo_js_put(object, LOD_CORNER_COUNTS, nodes->corners, polygons) == EBPO_OK &&
        ebpo_js_put(object, LOD_LEVEL_VOLUME, &volume, sizeof volume) == EBPO_OK;
    for (uint64_t i = 0; i < nodes->node_count && ok; i++) {
        const ebpo_lod_node *n = &nodes->nodes[i];
        uint8_t type = (uint8_t)n->type;
        uint32_t colour = n->coloured ? n->colour : UINT32_MAX;
        ok = ebpo_js_put(object, LOD_OCTCODES, &n->octcode, sizeof n->octcode) == EBPO_OK &&
             ebpo_js_put(object, LOD_TYPES, &type, sizeof type) == EBPO_OK &&
             ebpo_js_put(object, LOD_WINDINGS, &n->winding, sizeof n->winding) == EBPO_OK &&
             ebpo_js_put(object, LOD_VOLUMES, &n->volume, sizeof n->volume) == EBPO_OK &&
             ebpo_js_put(object, LOD_VERTEX_COUNTS, &n->vertex_count, sizeof n->vertex_count) ==
                 EBPO_OK &&
             ebpo_js_put(object, LOD_POLYGON_COUNTS, &n->polygon_count, sizeof n->polygon_count) ==
                 EBPO_OK &&
             ebpo_js_put(object, LOD_COLOURS, &colour, sizeof colour) == EBPO_OK;
    }
    return status != EBPO_OK ? status : ok ? EBPO_OK : EBPO_E_MEMORY;
}

/* Gets the envelopes of a level. Result array 0: double [3] for each vertex. 1: uint32 [3] for each
 * triangle. 2: uint8 for each polygon, its number of corners. 3: float [3] for each polygon, its
 * normal. 4 to 10: for each node, its octcode, type, winding number, volume, number of vertices,
 * number of polygons, and colour. 11: double, volume of the level. `cell_faces`: as in
 * ebpo_lod_options. */
int EBPO_JS(ebpo_js_level)(ebpo_js_object *object, int level, int cell_faces)
{
    ebpo_lod_options options = EBPO_LOD_OPTIONS_INIT;
    ebpo_mesh mesh = { 0 };
    ebpo_lod_nodes nodes = { 0 };
    double volume = 0;
    options.cell_faces = cell_faces;
    options.threads = 1;
    ebpo_js_clear(object);
    ebpo_status status =
        ebpo_lod_level_nodes(object->file, level, &options, &mesh, &nodes, &volume, &object->error);
    if (status == EBPO_OK)
        status = put_lod(object, &mesh, &nodes, volume);
    ebpo_lod_nodes_free(&nodes);
    ebpo_mesh_free(&mesh);
    return status;
}

/* ---- mesh ---- */

/* Gets the mesh. Result array 0: float [3] for each vertex; result array 1: double [3] for each
 * vertex; one of these two arrays is empty. Result array 2: uint32 [3] for each triangle.
 * `in_source_order`: true: rows are in the order of the source, if the file has source indices;
 * otherwise in the order of the file. */
int EBPO_JS(ebpo_js_mesh)(ebpo_js_object *object, int in_source_order)
{
    ebpo_read_options options = EBPO_READ_OPTIONS_INIT;
    ebpo_mesh mesh = { 0 };
    options.threads = 1;
    ebpo_js_clear(object);
    ebpo_status status =
        in_source_order
            ? ebpo_file_read_source_mesh(object->file, &options, &mesh, NULL, &object->error)
            : ebpo_file_read_mesh(object->file, &options, &mesh, &object->error);
    if (status == EBPO_OK && mesh.xyz32)
        status = ebpo_js_put(object, 0, mesh.xyz32, (size_t)mesh.vertex_count * 12);
    if (status == EBPO_OK && mesh.xyz64)
        status = ebpo_js_put(object, 1, mesh.xyz64, (size_t)mesh.vertex_count * 24);
    if (status == EBPO_OK)
        status = ebpo_js_put(object, 2, mesh.faces, (size_t)mesh.face_count * 12);
    ebpo_mesh_free(&mesh);
    return status;
}
