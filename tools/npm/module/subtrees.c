/* Reads subtrees (subtree.h), for the WebAssembly module. */
#include <ebpo/subtree.h>

#include "module.h"

/* Result arrays of ebpo_js_subtree: members of ebpo_subtree_nodes and ebpo_subtree_faces. An array
 * is empty if the file does not have its data, or the data was not requested. */
enum {
    SUBTREE_FACTS, /* double [3]: level; 1 if faces were read, else 0; number of shared faces */
    LEVEL_FIRST,   /* uint64 */
    OCTCODES,      /* uint64 */
    TYPES,         /* uint8 */
    WINDINGS,      /* int32 */
    CHILDREN,      /* uint32 */
    PLANE_FIRST,   /* uint32 */
    PLANES,        /* uint32 */
    ABOVE_FIRST,   /* uint32 */
    ABOVE_PLANES,  /* uint32 */
    VERTICES,      /* float [3] or double [3] */
    FACES,         /* uint32 [3] */
    NUMBERS,       /* uint32: file_faces */
    SOURCE,        /* uint32 */
    LIST_FIRST,    /* uint32 */
    LIST           /* uint32 */
};

_Static_assert(LIST < EBPO_JS_ARRAYS, "result arrays");

/* Appends `count` items of `size` bytes to result array n. If `data` is NULL, appends nothing.
 * Returns false when out of memory. */
static bool put_items(ebpo_js_object *object, unsigned n, const void *data, uint64_t count,
                      size_t size)
{
    return !data || ebpo_js_put(object, n, data, (size_t)count * size) == EBPO_OK;
}

static bool put_nodes(ebpo_js_object *object, const ebpo_subtree_nodes *n)
{
    uint64_t count = n->node_count;
    return put_items(object, LEVEL_FIRST, n->level_first, (uint64_t)n->level_count + 1, 8) &&
           put_items(object, OCTCODES, n->octcodes, count, 8) &&
           put_items(object, TYPES, n->types, count, 1) &&
           put_items(object, WINDINGS, n->windings, count, 4) &&
           put_items(object, CHILDREN, n->children, count, 4) &&
           (!n->plane_first ||
            (put_items(object, PLANE_FIRST, n->plane_first, count + 1, 4) &&
             put_items(object, PLANES, n->planes, n->plane_first[count], 4) &&
             put_items(object, ABOVE_FIRST, n->above_first, (uint64_t)n->level + 1, 4) &&
             put_items(object, ABOVE_PLANES, n->above_planes, n->above_first[n->level], 4)));
}

static bool put_faces(ebpo_js_object *object, const ebpo_subtree_faces *f, uint64_t nodes)
{
    return put_items(object, VERTICES, f->xyz32, f->vertex_count, 12) &&
           put_items(object, VERTICES, f->xyz64, f->vertex_count, 24) &&
           put_items(object, FACES, f->faces, f->face_count, 12) &&
           put_items(object, NUMBERS, f->file_faces, f->face_count, 4) &&
           put_items(object, SOURCE, f->source, f->face_count, 4) &&
           put_items(object, LIST_FIRST, f->list_first, nodes + 1, 4) &&
           put_items(object, LIST, f->list, f->list_first[nodes], 4);
}

/* Reads the subtree of a node. `levels`: number of levels below the node; -1: all levels, with the
 * faces. */
int EBPO_JS(ebpo_js_subtree)(ebpo_js_object *object, uint64_t octcode, int levels, double memory,
                             int or_leaf_above)
{
    ebpo_subtree_options options = EBPO_SUBTREE_OPTIONS_INIT;
    ebpo_subtree_nodes nodes = EBPO_SUBTREE_NODES_INIT;
    ebpo_subtree_faces faces = EBPO_SUBTREE_FACES_INIT;
    ebpo_subtree *subtree = NULL;
    options.levels = levels;
    options.memory = (uint64_t)memory;
    options.or_leaf_above = or_leaf_above;
    ebpo_js_clear(object);
    ebpo_status status =
        ebpo_subtree_open(object->file, octcode, &options, &subtree, &object->error);
    if (status == EBPO_OK)
        status = ebpo_subtree_get_nodes(subtree, &nodes);
    if (status != EBPO_OK)
        return status;
    bool has_faces = ebpo_subtree_get_faces(subtree, &faces, &object->error) == EBPO_OK;
    double facts[3] = { nodes.level, has_faces, has_faces ? (double)faces.shared_count : 0 };
    bool ok = ebpo_js_put(object, SUBTREE_FACTS, facts, sizeof facts) == EBPO_OK &&
              put_nodes(object, &nodes) &&
              (!has_faces || put_faces(object, &faces, nodes.node_count));
    ebpo_subtree_close(subtree);
    return ok ? EBPO_OK : EBPO_E_MEMORY;
}

/* Returns the octcode of the cell of a level that contains a point; 0: the point is outside the
 * root cell. */
uint64_t EBPO_JS(ebpo_js_octcode)(const ebpo_js_object *object, double x, double y, double z,
                                  int level)
{
    return ebpo_octcode_at(ebpo_file_info(object->file), (double[3]){ x, y, z }, level);
}
