/* Streams of nodes by their importance to an observer (ebpo/view.h), for the WebAssembly module. */
#include <string.h>

#include "module.h"

/* Result arrays of views. The arrays before VIEW_LEVELS are those of ebpo_js_put_node. */
enum {
    VIEW_LEVELS = EBPO_JS_NODE_ARRAYS, /* uint8 for each node */
    VIEW_FLAGS,                        /* uint8 for each node: bits 1: complete, 2: seen */
    VIEW_SIZES,                        /* double [2] for each node: distance, pixels */
    FACE_COUNTS,                       /* uint32 for each node: number of faces */
    FACE_CORNERS,                      /* double [9] for each face */
    FACE_NUMBERS,                      /* uint32 for each face: index in the file */
    FACE_REPEATED,                     /* uint8 for each face */
    VIEW_FACTS                         /* double [2]: ebpo_view_end, number of nodes */
};

_Static_assert(VIEW_FACTS < EBPO_JS_ARRAYS, "result arrays");

/* Indices of the options in the array of numbers that options_of in view_stream.js makes. */
enum {
    PRIORITY,
    UNSEEN,
    PIXELS,
    DISTANCE,
    LEVEL,
    BYTES,
    NODES,
    PLANES,
    POLYGONS,
    WINDINGS,
    MEMORY,
    FACES,
    HAS_OBSERVER,
    EYE,
    DIRECTION = EYE + 3,
    UP = DIRECTION + 3,
    FOV = UP + 3,
    WIDTH,
    HEIGHT
};

static void read_options(const double *x, ebpo_view_options *options, ebpo_observer *observer)
{
    *options = (ebpo_view_options)EBPO_VIEW_OPTIONS_INIT;
    *observer = (ebpo_observer)EBPO_OBSERVER_INIT;
    options->priority = (ebpo_priority)x[PRIORITY];
    options->unseen = (ebpo_unseen)x[UNSEEN];
    options->pixels = x[PIXELS];
    options->distance = x[DISTANCE];
    options->level = (int)x[LEVEL];
    options->bytes = (uint64_t)x[BYTES];
    options->nodes = (uint64_t)x[NODES];
    options->planes = x[PLANES] != 0;
    options->polygons = x[POLYGONS] != 0;
    options->windings = x[WINDINGS] != 0;
    options->memory = (uint64_t)x[MEMORY];
    options->faces = x[FACES] != 0;
    memcpy(observer->eye, x + EYE, sizeof observer->eye);
    memcpy(observer->direction, x + DIRECTION, sizeof observer->direction);
    memcpy(observer->up, x + UP, sizeof observer->up);
    observer->fov = x[FOV];
    observer->width = (uint32_t)x[WIDTH];
    observer->height = (uint32_t)x[HEIGHT];
    options->observer = x[HAS_OBSERVER] != 0 ? observer : NULL;
}

/* Makes the view of a query object, or changes its options. */
int EBPO_JS(ebpo_js_view_set)(ebpo_js_object *object, const double *numbers)
{
    ebpo_view_options options;
    ebpo_observer observer;
    read_options(numbers, &options, &observer);
    return object->view
               ? ebpo_view_stream_change(object->view, &options, &object->error)
               : ebpo_view_stream_new(object->file, &options, &object->view, &object->error);
}

static bool put_view_node(ebpo_js_object *object, const ebpo_view_node *n)
{
    uint8_t level = (uint8_t)n->level, flags = (uint8_t)(n->complete | n->seen << 1);
    double sizes[2] = { n->distance, n->pixels };
    return ebpo_js_put_node(object, &n->node) &&
           ebpo_js_put(object, VIEW_LEVELS, &level, 1) == EBPO_OK &&
           ebpo_js_put(object, VIEW_FLAGS, &flags, 1) == EBPO_OK &&
           ebpo_js_put(object, VIEW_SIZES, sizes, sizeof sizes) == EBPO_OK;
}

static bool put_faces(ebpo_js_object *object)
{
    ebpo_view_faces f = EBPO_VIEW_FACES_INIT;
    if (ebpo_view_stream_get_faces(object->view, &f) != EBPO_OK)
        return false;
    uint32_t count = (uint32_t)f.face_count;
    return ebpo_js_put(object, FACE_COUNTS, &count, sizeof count) == EBPO_OK &&
           ebpo_js_put(object, FACE_CORNERS, f.corners, count * sizeof *f.corners) == EBPO_OK &&
           ebpo_js_put(object, FACE_NUMBERS, f.file_faces, count * sizeof *f.file_faces) ==
               EBPO_OK &&
           ebpo_js_put(object, FACE_REPEATED, f.repeated, count) == EBPO_OK;
}

static ebpo_status put_facts(ebpo_js_object *object, double end, double count)
{
    double facts[2] = { end, count };
    return ebpo_js_put(object, VIEW_FACTS, facts, sizeof facts);
}

/* Reads up to `most` nodes into the result arrays. Stops at a node whose bytes are missing: returns
 * EBPO_OK with the nodes before it, or EBPO_E_PENDING if there are none. */
int EBPO_JS(ebpo_js_view_next)(ebpo_js_object *object, double most)
{
    ebpo_status status = EBPO_OK;
    ebpo_view_end end = EBPO_VIEW_NODE;
    double count = 0;
    ebpo_js_clear(object);
    while (count < most && status == EBPO_OK) {
        ebpo_view_node node;
        status = ebpo_view_stream_next(object->view, &node, &end, &object->error);
        if (status != EBPO_OK || end != EBPO_VIEW_NODE)
            break;
        if (!put_view_node(object, &node) || !put_faces(object))
            return EBPO_E_MEMORY;
        count++;
    }
    if (status == EBPO_OK || (status == EBPO_E_PENDING && count > 0))
        status = put_facts(object, end, count);
    return status;
}

/* Context of take_cut, which puts the nodes of the cut into the result arrays. */
typedef struct cut_nodes {
    ebpo_js_object *object;
    double count; /* number of nodes so far */
    bool ok;      /* false: out of memory */
} cut_nodes;

static bool take_cut(void *user, const ebpo_view_node *node)
{
    cut_nodes *cut = user;
    cut->ok = put_view_node(cut->object, node);
    cut->count++;
    return cut->ok;
}

/* Puts the nodes of the cut (view.h) into the arrays of ebpo_js_view_next, without faces. */
int EBPO_JS(ebpo_js_view_cut)(ebpo_js_object *object)
{
    cut_nodes cut = { .object = object, .ok = true };
    ebpo_js_clear(object);
    ebpo_view_stream_cut(object->view, take_cut, &cut);
    return cut.ok ? put_facts(object, EBPO_VIEW_NODE, cut.count) : EBPO_E_MEMORY;
}

/* Gets statistics. Array 0: members of ebpo_view_stats as doubles: number of delivered nodes;
 * numbers of white nodes, black nodes, leaves and gray nodes of the cut; number of waiting nodes;
 * pixels; bytes read. */
int EBPO_JS(ebpo_js_view_stats)(ebpo_js_object *object)
{
    ebpo_view_stats s = EBPO_VIEW_STATS_INIT;
    ebpo_js_clear(object);
    ebpo_status status = ebpo_view_stream_get_stats(object->view, &s);
    double out[8] = { (double)s.nodes,
                      (double)s.cut[EBPO_WHITE],
                      (double)s.cut[EBPO_BLACK],
                      (double)s.cut[EBPO_LEAF],
                      (double)s.cut[EBPO_GRAY],
                      (double)s.waiting,
                      s.pixels,
                      (double)s.bytes_read };
    return status == EBPO_OK ? ebpo_js_put(object, 0, out, sizeof out) : status;
}

/* Gets the mesh of ebpo_view_stream_surface. Array 0: double [3] for each vertex. Array 1: float
 * [3], normal of each vertex. Array 2: uint8 [4], colour of each vertex; empty if there are no
 * colours. Array 3: uint32 [3] for each triangle. Array 4: double [4]: error, pixels, number of
 * patches, number of triangles that are faces of the model. */
int EBPO_JS(ebpo_js_view_surface)(ebpo_js_object *object)
{
    ebpo_surface_mesh mesh;
    ebpo_js_clear(object);
    ebpo_status status = ebpo_view_stream_surface(object->view, &mesh, &object->error);
    if (status != EBPO_OK)
        return status;
    size_t count = (size_t)mesh.mesh.vertex_count;
    double facts[4] = { mesh.error, mesh.pixels, (double)mesh.patches, (double)mesh.faces };
    bool ok =
        ebpo_js_put(object, 0, mesh.mesh.xyz64, count * 24) == EBPO_OK &&
        ebpo_js_put(object, 1, mesh.normals, count * 12) == EBPO_OK &&
        ebpo_js_put(object, 2, mesh.colours.vertex, mesh.colours.vertex ? count * 4 : 0) ==
            EBPO_OK &&
        ebpo_js_put(object, 3, mesh.mesh.faces, (size_t)mesh.mesh.face_count * 12) == EBPO_OK &&
        ebpo_js_put(object, 4, facts, sizeof facts) == EBPO_OK;
    ebpo_surface_mesh_free(&mesh);
    return ok ? EBPO_OK : EBPO_E_MEMORY;
}
