/* Evaluates queries natively, for comparison with the WebAssembly module (results.mjs).
 *
 *     native_results MODEL INPUTS OUTPUT
 *
 * INPUTS: doubles: a count n, then n points [3], n rays [6] and n boxes [6]. OUTPUT: the sections
 * that write_results writes, each preceded by its size in bytes as a double. Sections are empty if
 * the file has no mesh. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/ebpo.h>

static FILE *output;
static ebpo_error error = EBPO_ERROR_INIT;

static void require(bool ok, const char *what)
{
    if (ok)
        return;
    fprintf(stderr, "native_results: %s: %s\n", what, error.message);
    exit(1);
}

static void *allocate(uint64_t bytes)
{
    void *out = calloc(1, bytes ? bytes : 1);
    require(out != NULL, "memory");
    return out;
}

static void write_section(const void *data, uint64_t bytes)
{
    double size = (double)bytes;
    require(fwrite(&size, sizeof size, 1, output) == 1, "output");
    require(fwrite(data, 1, bytes, output) == bytes, "output");
}

/* Collects a section item by item, in memory. */
typedef struct section {
    char *data;
    size_t size;
    FILE *stream;
} section;

static void begin_sections(section *s, unsigned count)
{
    for (unsigned i = 0; i < count; i++) {
        s[i] = (section){ 0 };
        s[i].stream = open_memstream(&s[i].data, &s[i].size);
        require(s[i].stream != NULL, "memory");
    }
}

static void end_sections(section *s, unsigned count)
{
    for (unsigned i = 0; i < count; i++) {
        fclose(s[i].stream);
        write_section(s[i].data, s[i].size);
        free(s[i].data);
    }
}

#define PUT(s, x) fwrite(&(x), sizeof(x), 1, (s).stream)

static uint32_t face_index(uint64_t face)
{
    return face == EBPO_NO_FACE ? UINT32_MAX : (uint32_t)face;
}

static void write_inside(ebpo_context *context, const double *points, uint64_t n)
{
    section s[2];
    ebpo_inside_result *r = allocate(n * sizeof *r);
    require(ebpo_inside_many(context, points, n, NULL, r, &error) == EBPO_OK, "inside");
    begin_sections(s, 2);
    for (uint64_t i = 0; i < n; i++) {
        int8_t where = (int8_t)r[i].where;
        PUT(s[0], where);
        PUT(s[1], r[i].winding);
    }
    end_sections(s, 2);
    free(r);
}

static void write_distances(ebpo_context *context, const double *points, uint64_t n)
{
    section s[6];
    ebpo_distance_result *r = allocate(n * sizeof *r);
    require(ebpo_distance_many(context, points, n, NULL, r, &error) == EBPO_OK, "distance");
    begin_sections(s, 6);
    for (uint64_t i = 0; i < n; i++) {
        uint32_t face = face_index(r[i].face);
        PUT(s[0], r[i].distance);
        PUT(s[1], r[i].point);
        PUT(s[2], r[i].normal);
        PUT(s[3], face);
        PUT(s[4], r[i].lo);
        PUT(s[5], r[i].hi);
    }
    end_sections(s, 6);
    free(r);
}

static bool take_near(void *user, const ebpo_near_face *near)
{
    section *s = user;
    uint32_t face = face_index(near->face);
    PUT(s[0], near->distance);
    PUT(s[1], face);
    return true;
}

/* The three nearest faces of each point. */
static void write_nearest(ebpo_context *context, const double *points, uint64_t n)
{
    section s[2];
    ebpo_within_options options = EBPO_WITHIN_OPTIONS_INIT;
    options.most = 3;
    begin_sections(s, 2);
    for (uint64_t i = 0; i < n; i++)
        require(ebpo_distance_within(context, points + 3 * i, &options, take_near, s, &error) ==
                    EBPO_OK,
                "nearest");
    end_sections(s, 2);
}

static void put_hit(section *s, const ebpo_ray_hit *hit)
{
    uint32_t face = face_index(hit->face);
    int8_t side = (int8_t)hit->side;
    PUT(s[0], hit->t);
    PUT(s[1], face);
    PUT(s[2], side);
}

static void write_rays(ebpo_context *context, const double *lines, uint64_t n)
{
    section s[4];
    ebpo_ray *rays = allocate(n * sizeof *rays);
    ebpo_ray_hit *first = allocate(n * sizeof *first);
    const ebpo_ray_hit *all;
    const uint64_t *begin;
    bool *any = allocate(n * sizeof *any);
    for (uint64_t i = 0; i < n; i++)
        for (int k = 0; k < 3; k++) {
            rays[i].origin[k] = lines[6 * i + (uint64_t)k];
            rays[i].direction[k] = lines[6 * i + 3 + (uint64_t)k];
            rays[i].t_max = __builtin_inf();
        }
    require(ebpo_ray_first_many(context, rays, n, NULL, first, &error) == EBPO_OK, "first hits");
    begin_sections(s, 3);
    for (uint64_t i = 0; i < n; i++)
        put_hit(s, &first[i]);
    end_sections(s, 3);
    require(ebpo_ray_all_many(context, rays, n, NULL, &all, &begin, &error) == EBPO_OK, "all hits");
    begin_sections(s, 4);
    for (uint64_t i = 0; i < begin[n]; i++)
        put_hit(s, &all[i]);
    for (uint64_t i = 0; i <= n; i++) {
        uint32_t at = (uint32_t)begin[i];
        PUT(s[3], at);
    }
    end_sections(s, 4);
    require(ebpo_ray_any_many(context, rays, n, NULL, any, &error) == EBPO_OK, "any hits");
    write_section(any, n * sizeof *any);
    free(rays);
    free(first);
    free(any);
}

static bool take_triangles(void *user, const ebpo_triangles *triangles)
{
    section *s = user;
    fwrite(triangles->corners, sizeof *triangles->corners, triangles->count, s->stream);
    return true;
}

static void write_boxes(ebpo_context *context, const double *boxes, uint64_t n)
{
    section s[3];
    begin_sections(s, 3);
    for (uint64_t i = 0; i < n; i++) {
        const double *box = boxes + 6 * i;
        const uint64_t *faces;
        uint64_t count;
        require(ebpo_faces_in_box(context, box, box + 3, &faces, &count, &error) == EBPO_OK,
                "faces in a box");
        uint32_t found = (uint32_t)count;
        PUT(s[0], found);
        for (uint64_t f = 0; f < count; f++) {
            uint32_t face = face_index(faces[f]);
            PUT(s[1], face);
        }
        if (i % 16 == 0)
            require(ebpo_triangles_in_box(context, box, box + 3, take_triangles, &s[2], &error) ==
                        EBPO_OK,
                    "triangles in a box");
    }
    end_sections(s, 3);
}

static bool next_level(ebpo_stream *stream, ebpo_stream_level *out)
{
    bool more = false;
    require(ebpo_stream_next_level(stream, out, &more, &error) == EBPO_OK, "levels");
    return more;
}

static bool next_node(ebpo_stream *stream, ebpo_stream_node *out)
{
    bool more = false;
    require(ebpo_stream_next_node(stream, out, &more, &error) == EBPO_OK, "nodes");
    return more;
}

/* Nodes of all levels, with their polygons. */
static void write_levels(const ebpo_file *file)
{
    section s[5];
    ebpo_stream_options options = EBPO_STREAM_OPTIONS_INIT;
    ebpo_stream *stream;
    ebpo_stream_level level;
    options.polygons = true;
    require(ebpo_stream_new(file, &options, &stream, &error) == EBPO_OK, "stream");
    begin_sections(s, 5);
    while (next_level(stream, &level)) {
        ebpo_stream_node node;
        while (next_node(stream, &node)) {
            PUT(s[0], node.octcode);
            PUT(s[1], node.winding);
            PUT(s[2], node.volume);
            fwrite(node.planes, sizeof *node.planes, node.plane_count, s[3].stream);
            fwrite(node.vertices, sizeof *node.vertices, node.vertex_count, s[4].stream);
        }
    }
    end_sections(s, 5);
    ebpo_stream_free(stream);
}

/* The polygons of level 4, or of the last one. */
static void write_level(const ebpo_file *file)
{
    ebpo_mesh mesh = { 0 };
    ebpo_lod_nodes nodes = { 0 };
    int last = ebpo_file_info(file)->level_count - 1;
    require(ebpo_lod_level_nodes(file, last > 4 ? 4 : last, NULL, &mesh, &nodes, NULL, &error) ==
                EBPO_OK,
            "level");
    float *normals = allocate(nodes.polygon_count * 3 * sizeof *normals);
    require(ebpo_lod_normals(ebpo_file_info(file), &mesh, &nodes, normals, &error) == EBPO_OK,
            "normals");
    write_section(mesh.xyz64, mesh.vertex_count * 3 * sizeof *mesh.xyz64);
    write_section(mesh.faces, mesh.face_count * 3 * sizeof *mesh.faces);
    write_section(normals, nodes.polygon_count * 3 * sizeof *normals);
    free(normals);
    ebpo_lod_nodes_free(&nodes);
    ebpo_mesh_free(&mesh);
}

static void write_mesh(const ebpo_file *file)
{
    ebpo_mesh mesh = { 0 };
    bool source_order;
    require(ebpo_file_read_source_mesh(file, NULL, &mesh, &source_order, &error) == EBPO_OK,
            "mesh");
    uint64_t size = mesh.xyz32 ? sizeof *mesh.xyz32 : sizeof *mesh.xyz64;
    write_section(mesh.xyz32 ? (void *)mesh.xyz32 : (void *)mesh.xyz64,
                  mesh.vertex_count * 3 * size);
    write_section(mesh.faces, mesh.face_count * 3 * sizeof *mesh.faces);
    ebpo_mesh_free(&mesh);
}

/* Values and ends of all arrays of attributes, in the order of the file; the maps. */
static void write_attributes(const ebpo_file *file)
{
    section s[2];
    ebpo_attribute_facts facts = EBPO_ATTRIBUTE_FACTS_INIT;
    const ebpo_info *info = ebpo_file_info(file);
    begin_sections(s, 2);
    for (unsigned n = 0; ebpo_file_attribute(file, n, &facts); n++) {
        static const size_t sizes[] = { 1, 1, 2, 2, 4, 4, 4, 8 };
        ebpo_attribute_values v = { 0 };
        require(ebpo_file_read_attribute(file, n, NULL, &v, &error) == EBPO_OK, "attribute");
        fwrite(v.values, sizes[facts.type], v.count, s[0].stream);
        for (uint64_t i = 0; v.ends && i < facts.rows; i++) {
            double end = (double)v.ends[i];
            PUT(s[1], end);
        }
        ebpo_attribute_values_free(&v);
    }
    end_sections(s, 2);
    if (info->parts & EBPO_PART_MAPS) {
        ebpo_maps maps = { 0 };
        require(ebpo_file_read_maps(file, NULL, &maps, &error) == EBPO_OK, "maps");
        write_section(maps.vertex_source, info->vertex_count * 4);
        write_section(maps.face_source, info->face_count * 4);
        ebpo_maps_free(&maps);
    }
}

/* The first attribute of vertices or faces that is no list, at the nearest points of `points`. */
static void write_samples(const ebpo_file *file, ebpo_context *context, const double *points,
                          uint64_t n)
{
    ebpo_attribute_facts facts = EBPO_ATTRIBUTE_FACTS_INIT;
    for (unsigned i = 0; ebpo_file_attribute(file, i, &facts); i++) {
        ebpo_sampler *sampler = NULL;
        char name[400];
        bool is_face = strcmp(facts.element, "face") == 0;
        if ((!is_face && strcmp(facts.element, "vertex") != 0) || facts.list)
            continue;
        snprintf(name, sizeof name, "%s:%.*s", facts.element, (int)strcspn(facts.names, " "),
                 facts.names);
        ebpo_distance_result *r = allocate(n * sizeof *r);
        double *at = allocate(n * 24), *values = allocate(n * 8);
        uint64_t *faces = allocate(n * 8);
        require(ebpo_distance_many(context, points, n, NULL, r, &error) == EBPO_OK, "distance");
        for (uint64_t k = 0; k < n; k++) {
            memcpy(at + 3 * k, r[k].point, sizeof r[k].point);
            faces[k] = r[k].face;
        }
        require(ebpo_sampler_new(file, name, 1, &sampler, &error) == EBPO_OK, name);
        require(ebpo_sample(sampler, at, faces, n, values, &error) == EBPO_OK, "samples");
        write_section(values, n * sizeof *values);
        ebpo_sampler_free(sampler);
        free(r);
        free(at);
        free(values);
        free(faces);
        return;
    }
}

/* Nodes by their size for an observer, and their faces. */
static void write_view(const ebpo_file *file)
{
    section s[7];
    const ebpo_info *info = ebpo_file_info(file);
    ebpo_view_options options = EBPO_VIEW_OPTIONS_INIT;
    ebpo_observer observer = EBPO_OBSERVER_INIT;
    ebpo_view_stream *view = NULL;
    ebpo_view_node node;
    ebpo_view_end end = EBPO_VIEW_NODE;
    for (int k = 0; k < 3; k++) {
        observer.eye[k] = info->box_origin[k] + (k + 1) * info->box_size[k];
        observer.direction[k] = -1;
    }
    options.priority = EBPO_PRIORITY_PIXELS;
    options.observer = &observer;
    options.pixels = 20;
    options.faces = info->parts & EBPO_PART_MESH && !info->pruned;
    require(ebpo_view_stream_new(file, &options, &view, &error) == EBPO_OK, "view");
    begin_sections(s, 7);
    for (;;) {
        ebpo_view_faces faces = EBPO_VIEW_FACES_INIT;
        ebpo_status status = ebpo_view_stream_next(view, &node, &end, &error);
        require(status == EBPO_OK || (status == EBPO_E_ABSENT && info->pruned), "view");
        if (status != EBPO_OK || end != EBPO_VIEW_NODE)
            break;
        uint8_t flags[2] = { node.complete, node.seen };
        PUT(s[0], node.node.octcode);
        fwrite(node.node.planes, sizeof *node.node.planes, node.node.plane_count, s[1].stream);
        PUT(s[2], flags);
        PUT(s[3], node.distance);
        PUT(s[4], node.pixels);
        require(ebpo_view_stream_get_faces(view, &faces) == EBPO_OK, "faces of a view");
        fwrite(faces.corners, sizeof *faces.corners, faces.face_count, s[5].stream);
        fwrite(faces.file_faces, sizeof *faces.file_faces, faces.face_count, s[6].stream);
    }
    end_sections(s, 7);
    ebpo_view_stream_free(view);
}

/* The subtree of the root. */
static void write_subtree(const ebpo_file *file)
{
    const ebpo_info *info = ebpo_file_info(file);
    ebpo_subtree_nodes nodes = EBPO_SUBTREE_NODES_INIT;
    ebpo_subtree_faces faces = EBPO_SUBTREE_FACES_INIT;
    ebpo_subtree *subtree = NULL;
    if (info->pruned)
        return;
    require(ebpo_subtree_open(file, 1, NULL, &subtree, &error) == EBPO_OK, "subtree");
    require(ebpo_subtree_get_nodes(subtree, &nodes) == EBPO_OK, "nodes of a subtree");
    write_section(nodes.octcodes, nodes.node_count * sizeof *nodes.octcodes);
    write_section(nodes.types, nodes.node_count * sizeof *nodes.types);
    write_section(nodes.planes, nodes.plane_first
                                    ? nodes.plane_first[nodes.node_count] * sizeof *nodes.planes
                                    : 0);
    if (ebpo_subtree_get_faces(subtree, &faces, &error) == EBPO_OK) {
        write_section(faces.faces, faces.face_count * 12);
        write_section(faces.file_faces, faces.face_count * 4);
        write_section(faces.list, faces.list_first[nodes.node_count] * sizeof *faces.list);
    }
    ebpo_subtree_close(subtree);
}

static double *read_inputs(const char *path, uint64_t *n)
{
    double count;
    FILE *in = fopen(path, "rb");
    require(in && fread(&count, sizeof count, 1, in) == 1, path);
    *n = (uint64_t)count;
    double *values = allocate(*n * 15 * sizeof *values);
    require(fread(values, 15 * sizeof *values, *n, in) == *n, path);
    fclose(in);
    return values;
}

int main(int argc, char **argv)
{
    ebpo_file *file = NULL;
    ebpo_model *model = NULL;
    ebpo_context *context = NULL;
    uint64_t n;
    if (argc != 4) {
        fprintf(stderr, "usage: native_results MODEL INPUTS OUTPUT\n");
        return 2;
    }
    double *inputs = read_inputs(argv[2], &n);
    output = fopen(argv[3], "wb");
    require(output != NULL, argv[3]);
    require(ebpo_open(argv[1], &file, &error) == EBPO_OK, argv[1]);
    write_levels(file);
    write_level(file);
    write_attributes(file);
    write_view(file);
    write_subtree(file);
    if (ebpo_file_info(file)->parts & EBPO_PART_MESH && !ebpo_file_info(file)->pruned) {
        require(ebpo_model_new(file, NULL, &model, &error) == EBPO_OK, "model");
        require(ebpo_context_new(model, &context, &error) == EBPO_OK, "context");
        write_mesh(file);
        if (ebpo_file_info(file)->solid)
            write_inside(context, inputs, n);
        write_distances(context, inputs, n);
        write_nearest(context, inputs, n);
        write_rays(context, inputs + 3 * n, n);
        write_boxes(context, inputs + 9 * n, n);
        write_samples(file, context, inputs, n);
    }
    ebpo_context_free(context);
    ebpo_model_free(model);
    ebpo_close(file);
    free(inputs);
    return fclose(output) != 0;
}
