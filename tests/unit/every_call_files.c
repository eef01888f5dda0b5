/* Calls that read and write files. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "every_call.h"
#include "scratch.h"

static ebpo_read_options reading(const every_call_env *e)
{
    ebpo_read_options options = EBPO_READ_OPTIONS_INIT;
    options.threads = 1;
    options.workspace = e->workspace;
    return options;
}

static ebpo_status call_facts(every_call_env *e)
{
    ebpo_file_stats stats = EBPO_FILE_STATS_INIT;
    ebpo_array_facts facts = { .struct_size = sizeof facts };
    int32_t normal[3], distance;
    char redacted[64], second[64];
    unsigned arrays = 0;
    ebpo_attribute_facts attribute = EBPO_ATTRIBUTE_FACTS_INIT;
    while (ebpo_file_array(e->file, arrays, &facts))
        arrays++;
    (void)ebpo_file_attribute(e->file, 0, &attribute);
    (void)ebpo_plane_decode(0, normal, &distance);
    (void)ebpo_export_second_file(EBPO_EXPORT_XDMF, "x.xdmf", second, sizeof second);
    bool good = arrays && ebpo_version() && ebpo_free_memory() > 0 &&
                ebpo_version_number() == EBPO_VERSION_NUMBER && ebpo_status_name(EBPO_OK) &&
                ebpo_is_date("2026-11-26") && ebpo_export_format_name(EBPO_EXPORT_OBJ) &&
                ebpo_is_url(ebpo_url_redact("http://a:b@c/", redacted, sizeof redacted)) &&
                ebpo_attribute_type_text(0) && ebpo_profile_parts(EBPO_PROFILE_LOD) &&
                ebpo_subset_memory(1000, 16) && ebpo_file_info(e->file)->level_count > 0;
    return good ? ebpo_file_get_stats(e->file, &stats) : EBPO_E_ARGUMENT;
}

static ebpo_status call_workspace(every_call_env *e)
{
    ebpo_workspace *workspace;
    ebpo_workspace_options options = EBPO_WORKSPACE_OPTIONS_INIT;
    ebpo_workspace_stats stats = EBPO_WORKSPACE_STATS_INIT;
    options.temp_dir = scratch(NULL);
    ebpo_status status = ebpo_workspace_new(&options, &workspace, e->error);
    if (status == EBPO_OK)
        status = ebpo_workspace_get_stats(workspace, &stats);
    ebpo_workspace_free(workspace);
    return status;
}

static ebpo_status call_outputs(every_call_env *e)
{
    ebpo_status status = ebpo_check_output(scratch("text"), e->error);
    if (status == EBPO_OK)
        status = ebpo_write_file(scratch("text"), "text", 4, e->error);
    ebpo_output *out = NULL;
    int descriptor;
    if (status == EBPO_OK)
        status = ebpo_output_begin(scratch("text"), &out, &descriptor, e->error);
    if (status == EBPO_OK)
        status = ebpo_output_end(out, e->error);
    if (status == EBPO_OK)
        status = ebpo_output_begin(scratch("text"), &out, &descriptor, e->error);
    if (status == EBPO_OK)
        ebpo_output_abandon(out);
    ebpo_abandon_outputs();
    return status;
}

static ebpo_status call_folder(every_call_env *e)
{
    char *making = NULL;
    ebpo_status status = ebpo_folder_begin(scratch("folder"), &making, e->error);
    if (status == EBPO_OK)
        status = ebpo_folder_publish(making, scratch("folder"), e->error);
    if (making)
        rmdir(status == EBPO_OK ? scratch("folder") : making);
    free(making);
    return status;
}

static ebpo_status call_filters(every_call_env *e) { return ebpo_register_filters(e->error); }

static ebpo_status end_open(ebpo_file *file, ebpo_status status, ebpo_error *error)
{
    ebpo_stored_sizes sizes = EBPO_STORED_SIZES_INIT;
    if (status == EBPO_OK)
        status = ebpo_file_locate(file, &sizes, error);
    ebpo_close(file);
    return status;
}

static ebpo_status call_open(every_call_env *e)
{
    ebpo_file *file;
    ebpo_status status = ebpo_open(scratch(EVERY_CALL_MODEL), &file, e->error);
    return end_open(file, status, e->error);
}

static ebpo_status call_open_with(every_call_env *e)
{
    ebpo_file *file;
    ebpo_open_options options = EBPO_OPEN_OPTIONS_INIT;
    options.max_expansion = 1;
    ebpo_status status = ebpo_open_with(scratch(EVERY_CALL_MODEL), &options, &file, e->error);
    return end_open(file, status, e->error);
}

static ebpo_status call_open_compat(every_call_env *e)
{
    ebpo_file *file;
    ebpo_compat_options options = EBPO_COMPAT_OPTIONS_INIT;
    ebpo_status status = ebpo_open_compat(scratch(EVERY_CALL_MODEL), &options, &file, e->error);
    return end_open(file, status, e->error);
}

/* A model in memory, owned by the test. */
typedef struct bytes {
    char *data;
    uint64_t size;
} bytes;

static bytes load(void)
{
    enum { LIMIT = 8 << 20 };
    every_call_pause();
    FILE *f = fopen(scratch(EVERY_CALL_MODEL), "rb");
    bytes b = { malloc(LIMIT), 0 };
    b.size = f && b.data ? fread(b.data, 1, LIMIT, f) : 0;
    if (f)
        fclose(f);
    every_call_resume();
    return b;
}

/* Opens a file of an asynchronous source, which first lacks all bytes. */
static ebpo_status open_async(ebpo_async *async, const bytes *b, ebpo_error *error)
{
    ebpo_source source = EBPO_SOURCE_INIT;
    ebpo_file *file = NULL;
    const ebpo_range *range;
    size_t count;
    ebpo_status status = EBPO_E_PENDING;
    while (status == EBPO_E_PENDING) {
        status = ebpo_async_needed(async, &range, &count, error);
        for (size_t i = 0; i < count && status == EBPO_OK; i++)
            status = ebpo_async_supply(async, range[i].offset, range[i].size,
                                       b->data + range[i].offset, NULL, error);
        if (status == EBPO_OK)
            status = ebpo_async_source(async, &source, error);
        if (status == EBPO_OK)
            status = ebpo_open_source(&source, "async", &file, error);
        if (status == EBPO_OK)
            status = ebpo_file_locate(file, NULL, error);
        ebpo_close(file);
        file = NULL;
    }
    return status;
}

static ebpo_status call_open_async(every_call_env *e)
{
    bytes b = load();
    ebpo_async *async = NULL;
    ebpo_status status = ebpo_async_new(b.size, "async", "", 0, &async, e->error);
    uint64_t operation = status == EBPO_OK ? ebpo_async_begin(async) : 0;
    if (status == EBPO_OK)
        status = open_async(async, &b, e->error);
    if (async)
        ebpo_async_end(async, operation);
    if (status == EBPO_OK && ebpo_async_bytes(async) == 0)
        status = EBPO_E_ARGUMENT;
    ebpo_async_free(async);
    free(b.data);
    return status;
}

static ebpo_status call_open_memory(every_call_env *e)
{
    ebpo_file *file;
    bytes b = load();
    ebpo_status status = ebpo_open_memory(b.data, b.size, "memory", &file, e->error);
    status = end_open(file, status, e->error);
    free(b.data);
    return status;
}

static ebpo_status read_bytes(void *user, uint64_t offset, uint64_t size, void *data,
                              ebpo_error *error)
{
    (void)error;
    memcpy(data, ((bytes *)user)->data + offset, size);
    return EBPO_OK;
}

static void foresee(void *user, const ebpo_range *ranges, size_t count)
{
    (void)user, (void)ranges, (void)count;
}

static ebpo_status call_open_source(every_call_env *e)
{
    ebpo_file *file;
    bytes b = load();
    ebpo_source source = EBPO_SOURCE_INIT;
    source.user = &b;
    source.size = b.size;
    source.read = read_bytes;
    source.prefetch = foresee;
    source.prefetched = 4096;
    ebpo_status status = ebpo_open_source(&source, "source", &file, e->error);
    if (status == EBPO_OK)
        ebpo_file_prefetch_levels(file, 0, 2);
    status = end_open(file, status, e->error);
    free(b.data);
    return status;
}

static ebpo_http_options plain_http(void)
{
    ebpo_http_options options = EBPO_HTTP_OPTIONS_INIT;
    options.connect_timeout = 2;
    options.retries = 0;
    options.netrc = false;
    options.proxy = "";
    return options;
}

static ebpo_status call_source_of_url(every_call_env *e)
{
    ebpo_source source = EBPO_SOURCE_INIT;
    ebpo_http_options options = plain_http();
    char head[512];
    if (!every_call_url())
        return EBPO_OK;
    ebpo_status status = ebpo_source_of_url(every_call_url(), &options, &source, e->error);
    if (status != EBPO_OK)
        return status;
    status = source.read(source.user, 0, sizeof head, head, e->error);
    source.close(source.user);
    return status;
}

static ebpo_status call_open_url(every_call_env *e)
{
    ebpo_file *file;
    ebpo_http_stats stats = EBPO_HTTP_STATS_INIT;
    ebpo_http_options options = plain_http();
    if (!every_call_url())
        return EBPO_OK;
    options.cache_folder = scratch("http-cache");
    ebpo_status status = ebpo_open_url(every_call_url(), &options, &file, e->error);
    if (status == EBPO_OK)
        status = ebpo_file_get_http_stats(file, &stats);
    return end_open(file, status, e->error);
}

static ebpo_status call_read_level(every_call_env *e)
{
    ebpo_level level;
    ebpo_read_options options = reading(e);
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < ebpo_file_info(e->file)->level_count && status == EBPO_OK; i++) {
        status = ebpo_file_read_level(e->file, i, &options, &level, e->error);
        if (status == EBPO_OK)
            ebpo_level_free(&level);
    }
    return status;
}

static ebpo_status call_read_mesh(every_call_env *e)
{
    ebpo_mesh mesh;
    ebpo_read_options options = reading(e);
    ebpo_status status = ebpo_file_read_mesh(e->file, &options, &mesh, e->error);
    if (status == EBPO_OK)
        ebpo_mesh_free(&mesh);
    return status;
}

static ebpo_status call_read_source_mesh(every_call_env *e)
{
    ebpo_mesh mesh;
    ebpo_read_options options = reading(e);
    ebpo_status status = ebpo_file_read_source_mesh(e->file, &options, &mesh, NULL, e->error);
    if (status == EBPO_OK)
        ebpo_mesh_free(&mesh);
    return status;
}

static ebpo_status call_read_maps(every_call_env *e)
{
    ebpo_maps maps;
    ebpo_read_options options = reading(e);
    ebpo_status status = ebpo_file_read_maps(e->file, &options, &maps, e->error);
    if (status == EBPO_OK)
        ebpo_maps_free(&maps);
    return status;
}

static ebpo_status call_read_attribute(every_call_env *e)
{
    ebpo_attribute_values values;
    ebpo_read_options options = reading(e);
    ebpo_status status = ebpo_file_attribute_ends(e->file, 1, &options, &values, e->error);
    ebpo_attribute_values_free(&values);
    if (status == EBPO_OK)
        status = ebpo_file_read_attribute(e->file, 0, &options, &values, e->error);
    ebpo_attribute_values_free(&values);
    return status;
}

static ebpo_status call_check_content(every_call_env *e)
{
    ebpo_read_options options = reading(e);
    return ebpo_file_check_content(e->file, &options, e->error);
}

static ebpo_status call_write(every_call_env *e)
{
    ebpo_tree tree;
    ebpo_read_options options = reading(e);
    ebpo_write_options writing = EBPO_WRITE_OPTIONS_INIT;
    writing.threads = 1;
    ebpo_status status = ebpo_file_read_tree(e->file, &options, &tree, e->error);
    if (status != EBPO_OK)
        return status;
    status = ebpo_tree_write(&tree, scratch("written.ebpo.h5"), &writing, e->error);
    ebpo_tree_free(&tree);
    return status;
}

static ebpo_subset_options half(void)
{
    ebpo_subset_options options = EBPO_SUBSET_OPTIONS_INIT;
    options.boxed = true;
    for (int axis = 0; axis < 3; axis++) {
        options.min[axis] = -4;
        options.max[axis] = axis ? 4 : 1;
    }
    options.threads = 1;
    return options;
}

static ebpo_status call_subset_of_tree(every_call_env *e)
{
    ebpo_tree tree;
    ebpo_read_options options = reading(e);
    ebpo_subset_options part = half();
    ebpo_status status = ebpo_file_read_tree(e->file, &options, &tree, e->error);
    if (status != EBPO_OK)
        return status;
    status = ebpo_subset_of_tree(&tree, scratch("part.ebpo.h5"), &part, e->error);
    ebpo_tree_free(&tree);
    return status;
}

static ebpo_status call_subset(every_call_env *e)
{
    ebpo_subset_options part = half();
    return ebpo_subset(e->file, scratch("part.ebpo.h5"), &part, e->error);
}

static ebpo_status call_subset_coarse(every_call_env *e)
{
    ebpo_subset_options part = EBPO_SUBSET_OPTIONS_INIT;
    part.max_error = 0.3;
    part.threads = 1;
    return ebpo_subset(e->file, scratch("part.ebpo.h5"), &part, e->error);
}

static ebpo_status call_repack(every_call_env *e)
{
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_write_options write = EBPO_WRITE_OPTIONS_INIT;
    read.threads = write.threads = 1;
    read.workspace = e->workspace;
    write.subtree_faces = 1;
    return ebpo_file_repack(e->file, scratch("part.ebpo.h5"), &read, &write, e->error);
}

/* Queries a surface with its border. */
static ebpo_status query_surface(const ebpo_file *file, ebpo_error *error)
{
    ebpo_model *model = NULL;
    ebpo_context *context = NULL;
    double points[EVERY_CALL_POINTS][3];
    ebpo_inside_result results[EVERY_CALL_POINTS];
    ebpo_winding_bounds bounds[EVERY_CALL_POINTS];
    every_call_points(points);
    ebpo_status status = ebpo_model_new(file, NULL, &model, error);
    if (status == EBPO_OK)
        status = ebpo_context_new(model, &context, error);
    if (status == EBPO_OK)
        status = ebpo_inside_many(context, points[0], EVERY_CALL_POINTS, NULL, results, error);
    if (status == EBPO_OK)
        status = ebpo_winding(context, points[0], EVERY_CALL_POINTS, 1e-6, bounds, error);
    ebpo_context_free(context);
    ebpo_model_free(model);
    return status;
}

static ebpo_status call_add_border(every_call_env *e)
{
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_write_options write = EBPO_WRITE_OPTIONS_INIT;
    ebpo_file *file = NULL, *whole = NULL;
    ebpo_mesh mesh = { 0 }, caps = { 0 };
    read.threads = write.threads = 1;
    read.workspace = e->workspace;
    ebpo_status status = ebpo_open(scratch(EVERY_CALL_SURFACE), &file, e->error);
    if (status == EBPO_OK)
        status = ebpo_file_add_border(file, scratch("part.ebpo.h5"), &read, &write, e->error);
    if (status == EBPO_OK)
        status = ebpo_open(scratch("part.ebpo.h5"), &whole, e->error);
    if (status == EBPO_OK)
        status = query_surface(whole, e->error);
    if (status == EBPO_OK)
        status = ebpo_file_read_mesh(whole, &read, &mesh, e->error);
    if (status == EBPO_OK)
        status = ebpo_mesh_add_caps(&mesh, whole, e->error);
    if (status == EBPO_OK)
        status = ebpo_mesh_add_caps(&caps, whole, e->error);
    ebpo_mesh_free(&mesh);
    ebpo_mesh_free(&caps);
    ebpo_close(whole);
    ebpo_close(file);
    return status;
}

static ebpo_status export_to(every_call_env *e, const char *name, ebpo_export_format format)
{
    ebpo_export_report report = { .struct_size = sizeof report };
    ebpo_export_options options = EBPO_EXPORT_OPTIONS_INIT;
    options.threads = 1;
    return ebpo_export(e->file, scratch(name), format, &options, &report, e->error);
}

static ebpo_status call_xdmf(every_call_env *e) { return export_to(e, "x.xdmf", EBPO_EXPORT_XDMF); }
static ebpo_status call_vtk(every_call_env *e) { return export_to(e, "x.hdf", EBPO_EXPORT_VTKHDF); }
static ebpo_status call_gltf(every_call_env *e) { return export_to(e, "x.gltf", EBPO_EXPORT_GLTF); }
static ebpo_status call_glb(every_call_env *e) { return export_to(e, "x.glb", EBPO_EXPORT_GLB); }
static ebpo_status call_obj(every_call_env *e) { return export_to(e, "x.obj", EBPO_EXPORT_OBJ); }
static ebpo_status call_stl(every_call_env *e) { return export_to(e, "x.stl", EBPO_EXPORT_STL); }

static void remove_tiles(const char *folder)
{
    char path[600];
    bool found = true;
    for (int i = 0; found; i++) {
        snprintf(path, sizeof path, "%s/%d.glb", folder, i);
        found = unlink(path) == 0;
    }
    snprintf(path, sizeof path, "%s/tileset.json", folder);
    (void)!unlink(path);
    (void)!rmdir(folder);
}

/* Exports the patches of a vector: as GLB of a level and of some triangles, and as 3D Tiles. */
static ebpo_status call_patches(every_call_env *e)
{
    ebpo_export_report report = { .struct_size = sizeof report };
    ebpo_export_options options = EBPO_EXPORT_OPTIONS_INIT;
    ebpo_file *file = NULL;
    char path[4096];
    snprintf(path, sizeof path, "%s/passed/69_surface.ebpo.h5", getenv("EBPO_VECTORS"));
    options.threads = 1;
    ebpo_status status = ebpo_open(path, &file, e->error);
    if (status == EBPO_OK)
        status =
            ebpo_export(file, scratch("tiles"), EBPO_EXPORT_TILES, &options, &report, e->error);
    if (status == EBPO_OK)
        remove_tiles(scratch("tiles"));
    options.surface = true;
    options.mesh = false;
    options.first_level = options.last_level = 1;
    for (int i = 0; i < 2 && status == EBPO_OK; i++) {
        options.triangles = i ? 1500 : 0;
        status = ebpo_export(file, scratch("x.glb"), EBPO_EXPORT_GLB, &options, &report, e->error);
    }
    ebpo_close(file);
    return status;
}

static ebpo_status call_verify(every_call_env *e)
{
    ebpo_verify_report report = EBPO_VERIFY_REPORT_INIT;
    ebpo_verify_options options = EBPO_VERIFY_OPTIONS_INIT;
    options.threads = 1;
    options.workspace = e->workspace;
    ebpo_status status = ebpo_verify(e->file, &options, &report, e->error);
    return status == EBPO_OK && report.violations ? EBPO_E_FORMAT : status;
}

static ebpo_status call_add_surface(every_call_env *e)
{
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_write_options write = EBPO_WRITE_OPTIONS_INIT;
    ebpo_surface surface = { .patch_count = 0 };
    read.threads = write.threads = 1;
    read.workspace = e->workspace;
    ebpo_status status =
        ebpo_file_add_surface(e->file, scratch("part.ebpo.h5"), &read, &write, e->error);
    if (status != EBPO_OK)
        return status;
    /* the model has too few faces */
    status = ebpo_file_read_patches(e->file, &surface, e->error);
    ebpo_surface_free(&surface);
    if (status == EBPO_E_ABSENT)
        status = ebpo_file_read_surface(e->file, 0, 20, &surface, e->error);
    ebpo_surface_free(&surface);
    return status == EBPO_E_ABSENT ? EBPO_OK : status;
}

/* A patch of one triangle. */
static ebpo_status call_surface(every_call_env *e)
{
    uint64_t row[EBPO_PATCH_COLUMNS] = { 1, 0, 1, 1, 3, 3, 0 }, *patches = NULL, count = 0;
    uint8_t code[3] = { 0, 0, 0 }, normal[6] = { 64, 64 }, colour[9] = { 255, 9 };
    uint16_t point[9] = { 0, 0, 0, 200, 0, 0, 0, 200, 0 };
    ebpo_surface surface = { 1, 1, 3, 3, 3, row, code, point, normal, colour, NULL };
    ebpo_patch patch = EBPO_PATCH_INIT;
    ebpo_surface_mesh mesh = { .error = 0 };
    const ebpo_info *info = ebpo_file_info(e->file);
    ebpo_status status = ebpo_surface_decode(&surface, info, 0, &patch, e->error);
    if (status == EBPO_OK)
        status = ebpo_surface_select(&surface, 3, &patches, &count, e->error);
    if (status == EBPO_OK)
        status = ebpo_surface_join(&surface, info, patches, count, &mesh, e->error);
    free(patches);
    ebpo_patch_free(&patch);
    ebpo_surface_mesh_free(&mesh);
    return status;
}

const every_call every_call_files[] = {
    { "facts", call_facts },
    { "workspace", call_workspace },
    { "outputs", call_outputs },
    { "folder", call_folder },
    { "filters", call_filters },
    { "open", call_open },
    { "open_memory", call_open_memory },
    { "open_async", call_open_async },
    { "open_with", call_open_with },
    { "open_compat", call_open_compat },
    { "open_source", call_open_source },
    { "source_of_url", call_source_of_url },
    { "open_url", call_open_url },
    { "read_level", call_read_level },
    { "read_mesh", call_read_mesh },
    { "read_source_mesh", call_read_source_mesh },
    { "read_maps", call_read_maps },
    { "read_attribute", call_read_attribute },
    { "check_content", call_check_content },
    { "write", call_write },
    { "subset_of_tree", call_subset_of_tree },
    { "subset", call_subset },
    { "subset_coarse", call_subset_coarse },
    { "repack", call_repack },
    { "add_border", call_add_border },
    { "add_surface", call_add_surface },
    { "surface", call_surface },
    { "export_xdmf", call_xdmf },
    { "export_vtkhdf", call_vtk },
    { "export_gltf", call_gltf },
    { "export_glb", call_glb },
    { "export_obj", call_obj },
    { "export_stl", call_stl },
    { "export_patches", call_patches },
    { "verify", call_verify },
    { NULL, NULL },
};
