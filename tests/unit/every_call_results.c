/* Calls that query a model or return its levels. */
#include <math.h>
#include <stdlib.h>
#include <unistd.h>

#include "every_call.h"
#include "ebpo_config.h"
#include "scratch.h"

void every_call_points(double (*points)[3])
{
    for (int i = 0; i < EVERY_CALL_POINTS; i++) {
        points[i][0] = -4 + 0.2 * i;
        points[i][1] = 0.1 * (i % 7);
        points[i][2] = 0.05 * (i % 11);
    }
}

static ebpo_status query_many(ebpo_context *context, ebpo_error *error)
{
    double points[EVERY_CALL_POINTS][3];
    ebpo_inside_result inside[EVERY_CALL_POINTS];
    ebpo_distance_result distance[EVERY_CALL_POINTS];
    every_call_points(points);
    ebpo_status status =
        ebpo_inside_many(context, points[0], EVERY_CALL_POINTS, NULL, inside, error);
    if (status == EBPO_OK)
        status = ebpo_distance_many(context, points[0], EVERY_CALL_POINTS, NULL, distance, error);
    return status;
}

static bool count_faces(void *user, const ebpo_near_face *face)
{
    *(uint64_t *)user += face->distance < 3;
    return true;
}

static ebpo_status query_check_points(ebpo_context *context, ebpo_error *error)
{
    static const double point[3] = { 3, 0.1, 0.2 };
    ebpo_inside_result inside;
    ebpo_distance_result distance;
    uint64_t count = 0;
    ebpo_status status = ebpo_inside(context, point, NULL, &inside, error);
    if (status == EBPO_OK)
        status = ebpo_distance(context, point, NULL, &distance, error);
    if (status == EBPO_OK)
        status = ebpo_distance_within(context, point, NULL, count_faces, &count, error);
    return status;
}

static bool count_triangles(void *user, const ebpo_triangles *triangles)
{
    *(uint64_t *)user += triangles->count;
    return true;
}

static ebpo_status query_many_rays(ebpo_context *context, ebpo_error *error)
{
    static const ebpo_ray rays[2] = { { { -9, 0.1, 0.2 }, { 1, 0, 0 }, 99 },
                                      { { 0, -9, 0.2 }, { 0, 1, 0 }, INFINITY } };
    ebpo_ray_hit first[2];
    const ebpo_ray_hit *hits;
    const uint64_t *begin;
    bool any[2];
    ebpo_ray_options options = EBPO_RAY_OPTIONS_INIT;
    ebpo_status status = ebpo_ray_first_many(context, rays, 2, &options, first, error);
    if (status == EBPO_OK)
        status = ebpo_ray_any_many(context, rays, 2, &options, any, error);
    if (status == EBPO_OK)
        status = ebpo_ray_all_many(context, rays, 2, &options, &hits, &begin, error);
    return status;
}

static ebpo_status query_rays(ebpo_context *context, ebpo_error *error)
{
    static const double origin[3] = { -9, 0.1, 0.2 }, direction[3] = { 1, 0, 0 };
    static const double low[3] = { 0, 0, -1 }, high[3] = { 4, 4, 1 };
    ebpo_ray_hit first;
    const ebpo_ray_hit *hits;
    const uint64_t *faces;
    uint64_t count;
    bool hit;
    ebpo_status status = ebpo_ray_first(context, origin, direction, 99, &first, &hit, error);
    if (status == EBPO_OK)
        status = ebpo_ray_all(context, origin, direction, 99, &hits, &count, error);
    if (status == EBPO_OK)
        status = ebpo_ray_any(context, origin, direction, 99, &hit, error);
    if (status == EBPO_OK)
        status = query_many_rays(context, error);
    if (status == EBPO_OK)
        status = ebpo_faces_in_box(context, low, high, &faces, &count, error);
    if (status == EBPO_OK)
        status = ebpo_triangles_in_box(context, low, high, count_triangles, &count, error);
    return status;
}

static ebpo_status query_winding(ebpo_context *context, ebpo_error *error)
{
    static const double points[2][3] = { { 0.1, 0.2, 0.3 }, { 9, 9, 9 } };
    ebpo_winding_bounds bounds[2];
    return ebpo_winding(context, points[0], 2, 1e-6, bounds, error);
}

static ebpo_status query_all(ebpo_model *model, ebpo_error *error)
{
    ebpo_context *context;
    ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
    ebpo_status status = ebpo_context_new(model, &context, error);
    if (status == EBPO_OK)
        status = query_check_points(context, error);
    if (status == EBPO_OK)
        status = query_many(context, error);
    if (status == EBPO_OK)
        status = query_rays(context, error);
    if (status == EBPO_OK)
        status = query_winding(context, error);
    if (status == EBPO_OK)
        status = ebpo_model_get_stats(model, &stats);
#if EBPO_HAVE_EXTRAS
    if (status == EBPO_OK)
        status = every_call_two_models(model, stats.resident, error);
#endif
    ebpo_context_free(context);
    return status;
}

static ebpo_status run_query(every_call_env *e, const ebpo_model_options *options)
{
    ebpo_model *model = NULL;
    ebpo_model_plan plan = EBPO_MODEL_PLAN_INIT;
    ebpo_status status = ebpo_model_memory(e->file, options, &plan, e->error);
    if (status == EBPO_OK)
        status = ebpo_model_new(e->file, options, &model, e->error);
    if (status == EBPO_OK)
        status = query_all(model, e->error);
    ebpo_model_free(model);
    return status;
}

static ebpo_status call_sample(every_call_env *e)
{
    static const double point[2][3] = { { 4, 0, 0 }, { 3, 0, 1 } };
    static const uint64_t face[2] = { 0, EBPO_NO_FACE };
    double values[2];
    ebpo_sampler *sampler;
    ebpo_status status = ebpo_sampler_new(e->file, "vertex:red", 1, &sampler, e->error);
    if (status == EBPO_OK && ebpo_sampler_columns(sampler) == 1)
        status = ebpo_sample(sampler, point[0], face, 2, values, e->error);
    ebpo_sampler_free(sampler);
    return status;
}

static ebpo_status call_query(every_call_env *e)
{
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    options.threads = 1;
    return run_query(e, &options);
}

static ebpo_status load_by(every_call_env *e, ebpo_loading loading, bool prefetch)
{
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    options.threads = 1;
    options.memory = 8 << 20;
    options.cut_level = 2;
    options.loading = loading;
    options.prefetch = prefetch;
    return run_query(e, &options);
}

static ebpo_status call_query_cached(every_call_env *e)
{
    return load_by(e, EBPO_LOAD_CACHE, false);
}
static ebpo_status call_query_ahead(every_call_env *e) { return load_by(e, EBPO_LOAD_CACHE, true); }
static ebpo_status call_query_subtree(every_call_env *e)
{
    return load_by(e, EBPO_LOAD_SUBTREE, false);
}
static ebpo_status call_query_nodes(every_call_env *e)
{
    return load_by(e, EBPO_LOAD_NODES, false);
}

/* Opens two models, one in memory and one in parts. */
static ebpo_status share(every_call_env *e, ebpo_budget *budget)
{
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model *whole = NULL;
    ebpo_budget_stats stats = EBPO_BUDGET_STATS_INIT;
    options.threads = 1;
    options.budget = budget;
    ebpo_status status = ebpo_model_new(e->file, &options, &whole, e->error);
    options.cut_level = 2;
    if (status == EBPO_OK)
        status = run_query(e, &options);
    if (status == EBPO_OK)
        status = ebpo_budget_get_stats(budget, &stats);
    ebpo_model_free(whole);
    return status;
}

static ebpo_status call_budget(every_call_env *e)
{
    ebpo_budget *budget;
    ebpo_status status = ebpo_budget_new(64 << 20, &budget, e->error);
    if (status == EBPO_OK)
        status = share(e, budget);
    ebpo_budget_free(budget);
    return status;
}

static ebpo_status call_measure(every_call_env *e)
{
    ebpo_mass mass = EBPO_MASS_INIT;
    const ebpo_info *info = ebpo_file_info(e->file);
    ebpo_solid_volume volume = EBPO_SOLID_VOLUME_INIT;
    ebpo_status status = ebpo_measure(e->file, 1, &mass, e->error);
    return status == EBPO_OK
               ? ebpo_solid_volume_of(&info->report, info->rule, NULL, info, &volume, e->error)
               : status;
}

static ebpo_status call_error_bound(every_call_env *e)
{
    ebpo_model *model;
    ebpo_error_bound_options options = EBPO_ERROR_BOUND_OPTIONS_INIT;
    ebpo_error_bound error_bound = EBPO_ERROR_BOUND_INIT;
    options.samples = 20;
    options.queries = 50;
    options.threads = 1;
    ebpo_status status = ebpo_model_new(e->file, NULL, &model, e->error);
    if (status == EBPO_OK)
        status = ebpo_level_error_bound(model, e->file, 1, &options, &error_bound, e->error);
    ebpo_model_free(model);
    return status;
}

static ebpo_status call_limit(every_call_env *e)
{
    ebpo_limit_options options = EBPO_LIMIT_OPTIONS_INIT;
    ebpo_limit limit = EBPO_LIMIT_INIT;
    options.threads = 1;
    return ebpo_limit_level(e->file, 1, &options, &limit, e->error);
}

static ebpo_lod_options shaped(const every_call_env *e)
{
    ebpo_lod_options options = EBPO_LOD_OPTIONS_INIT;
    options.threads = 1;
    options.workspace = e->workspace;
    return options;
}

static int last_level(const every_call_env *e) { return ebpo_file_info(e->file)->level_count - 1; }

static ebpo_status call_lod(every_call_env *e)
{
    ebpo_mesh mesh;
    double volume;
    ebpo_lod_options options = shaped(e);
    ebpo_status status = ebpo_lod_level(e->file, last_level(e), &options, &mesh, &volume, e->error);
    if (status == EBPO_OK)
        ebpo_mesh_free(&mesh);
    return status;
}

static ebpo_status call_lod_nodes(every_call_env *e)
{
    ebpo_mesh mesh;
    ebpo_lod_nodes nodes;
    double volume;
    ebpo_lod_options options = shaped(e);
    ebpo_status status =
        ebpo_lod_level_nodes(e->file, last_level(e), &options, &mesh, &nodes, &volume, e->error);
    if (status == EBPO_OK) {
        ebpo_colours colours;
        float *normals = malloc((nodes.polygon_count + 1) * 3 * sizeof *normals);
        status = ebpo_lod_colours(&nodes, mesh.vertex_count, &colours, e->error);
        if (status == EBPO_OK && normals)
            status = ebpo_lod_normals(ebpo_file_info(e->file), &mesh, &nodes, normals, e->error);
        free(normals);
        ebpo_colours_free(&colours);
        ebpo_mesh_free(&mesh);
        ebpo_lod_nodes_free(&nodes);
    }
    return status;
}

static ebpo_status take_nodes(ebpo_stream *stream, ebpo_error *error)
{
    ebpo_stream_level level;
    ebpo_stream_node node;
    bool more = true, another = true;
    ebpo_status status = EBPO_OK;
    while (more && status == EBPO_OK) {
        ebpo_stream_prefetch(stream, 1);
        status = ebpo_stream_next_level(stream, &level, &more, error);
        for (another = more; another && status == EBPO_OK;)
            status = ebpo_stream_next_node(stream, &node, &another, error);
    }
    return status;
}

static ebpo_status call_stream(every_call_env *e)
{
    ebpo_stream *stream;
    ebpo_stream_options options = EBPO_STREAM_OPTIONS_INIT;
    options.polygons = true;
    options.threads = 1;
    ebpo_status status = ebpo_stream_new(e->file, &options, &stream, e->error);
    if (status == EBPO_OK)
        status = take_nodes(stream, e->error);
    ebpo_stream_free(stream);
    return status;
}

static bool visit(void *user, const ebpo_view_node *node)
{
    (void)node;
    return ++*(int *)user < 20;
}

static ebpo_status take_view(ebpo_view_stream *stream, int most, ebpo_error *error)
{
    ebpo_view_node node;
    ebpo_view_end end = EBPO_VIEW_NODE;
    ebpo_view_faces faces = EBPO_VIEW_FACES_INIT;
    ebpo_status status = EBPO_OK;
    while (end == EBPO_VIEW_NODE && status == EBPO_OK && most--)
        status = ebpo_view_stream_next(stream, &node, &end, error);
    return status == EBPO_OK ? ebpo_view_stream_get_faces(stream, &faces) : status;
}

static ebpo_status view(ebpo_view_stream *stream, ebpo_view_options *options, ebpo_error *error)
{
    ebpo_view_stats stats = EBPO_VIEW_STATS_INIT;
    ebpo_surface_mesh mesh;
    int visited = 0;
    ebpo_status status = ebpo_view_stream_surface(stream, &mesh, error);
    ebpo_surface_mesh_free(&mesh);
    if (status != EBPO_E_ABSENT) /* the model has too few faces */
        return status;
    status = take_view(stream, 50, error);
    options->priority = EBPO_PRIORITY_DISTANCE;
    if (status == EBPO_OK)
        status = ebpo_view_stream_change(stream, options, error);
    if (status == EBPO_OK)
        status = take_view(stream, 200, error);
    ebpo_view_stream_cut(stream, visit, &visited);
    return status == EBPO_OK ? ebpo_view_stream_get_stats(stream, &stats) : status;
}

static ebpo_status call_view(every_call_env *e)
{
    ebpo_view_stream *stream;
    ebpo_observer observer = EBPO_OBSERVER_INIT;
    ebpo_view_options options = EBPO_VIEW_OPTIONS_INIT;
    observer.eye[2] = 9;
    observer.direction[2] = -1;
    options.priority = EBPO_PRIORITY_PIXELS;
    options.observer = &observer;
    options.polygons = options.windings = options.faces = true;
    ebpo_status status = ebpo_view_stream_new(e->file, &options, &stream, e->error);
    if (status == EBPO_OK)
        status = view(stream, &options, e->error);
    ebpo_view_stream_free(stream);
    return status;
}

static ebpo_status take_subtree(ebpo_subtree *subtree, ebpo_error *error)
{
    ebpo_subtree_nodes nodes = EBPO_SUBTREE_NODES_INIT;
    ebpo_subtree_faces faces = EBPO_SUBTREE_FACES_INIT;
    ebpo_subtree_node node = EBPO_SUBTREE_NODE_INIT;
    ebpo_status status = ebpo_subtree_get_nodes(subtree, &nodes);
    if (status == EBPO_OK)
        status = ebpo_subtree_get_faces(subtree, &faces, error);
    for (uint64_t i = 0; i < nodes.node_count && status == EBPO_OK; i += 5)
        status = ebpo_subtree_get_node(subtree, i, true, &node, error);
    return status;
}

static ebpo_status call_subtree(every_call_env *e)
{
    static const double point[3] = { 2.5, 1, 0.3 };
    ebpo_subtree *subtree;
    ebpo_subtree_options options = EBPO_SUBTREE_OPTIONS_INIT;
    options.corners = options.or_leaf_above = true;
    options.memory = 64 << 20;
    uint64_t octcode = ebpo_octcode_at(ebpo_file_info(e->file), point, 1);
    ebpo_status status = ebpo_subtree_open(e->file, octcode, &options, &subtree, e->error);
    if (status == EBPO_OK)
        status = take_subtree(subtree, e->error);
    ebpo_subtree_close(subtree);
    return status;
}

static ebpo_status query_catalogue(const ebpo_catalogue *catalogue, ebpo_catalogue_models *models,
                                   ebpo_error *error)
{
    static const double points[2][3] = { { 3, 0.1, 0.2 }, { 4, 0, 0 } };
    static const ebpo_ray ray = { { -9, 0.1, 0.2 }, { 1, 0, 0 }, 99 };
    ebpo_catalogue_query_options one = EBPO_CATALOGUE_QUERY_OPTIONS_INIT;
    ebpo_inside_result inside[2];
    ebpo_distance_result distance[2];
    ebpo_ray_hit hit;
    uint64_t model[2];
    one.threads = 1;
    ebpo_status status =
        ebpo_catalogue_inside(catalogue, models, points[0], 2, &one, inside, error);
    if (status == EBPO_OK)
        status =
            ebpo_catalogue_distance(catalogue, models, points[0], 2, &one, distance, model, error);
    ebpo_catalogue_models_set_memory(models, 64 << 20);
    if (status == EBPO_OK)
        status = ebpo_catalogue_ray(catalogue, models, &ray, 1, &one, &hit, model, error);
    return status;
}

static ebpo_status query_catalogue_file(const char *path, ebpo_error *error)
{
    ebpo_catalogue *catalogue;
    ebpo_catalogue_models *models = NULL;
    ebpo_catalogue_models_options few = EBPO_CATALOGUE_MODELS_OPTIONS_INIT;
    ebpo_catalogue_models_stats stats = EBPO_CATALOGUE_MODELS_STATS_INIT;
    ebpo_catalogue_facts facts = EBPO_CATALOGUE_FACTS_INIT;
    few.threads = 1;
    ebpo_status status = ebpo_catalogue_open(path, NULL, &catalogue, error);
    if (status == EBPO_OK)
        status = ebpo_catalogue_get_facts(catalogue, &facts);
    if (status == EBPO_OK && ebpo_catalogue_get_entry(catalogue, facts.count - 1))
        status = ebpo_catalogue_models_new(&few, &models, error);
    if (status == EBPO_OK)
        status = query_catalogue(catalogue, models, error);
    if (status == EBPO_OK)
        status = ebpo_catalogue_models_get_stats(models, &stats, NULL);
    if (status == EBPO_OK)
        ebpo_catalogue_models_close_idle(models);
    ebpo_catalogue_models_free(models);
    ebpo_catalogue_free(catalogue);
    return status;
}

static ebpo_status make_catalogue(every_call_env *e, ebpo_catalogue **out)
{
    ebpo_catalogue_options options = EBPO_CATALOGUE_OPTIONS_INIT;
    ebpo_catalogue_entry entry;
    options.folder = scratch(NULL);
    options.parts = true;
    ebpo_catalogue_entry_of(e->file, EVERY_CALL_MODEL, &entry);
    return ebpo_catalogue_new(&entry, 1, &options, out, e->error);
}

static ebpo_status call_catalogue(every_call_env *e)
{
    ebpo_catalogue *catalogue;
    ebpo_status status = make_catalogue(e, &catalogue);
    if (status == EBPO_OK)
        status = ebpo_catalogue_save(catalogue, scratch("c.json"), e->error);
    if (status == EBPO_OK)
        status = query_catalogue_file(scratch("c.json"), e->error);
    ebpo_catalogue_free(catalogue);
    every_call_pause();
    unlink(scratch("c.json"));
    every_call_resume();
    return status;
}

/* Queries when the model is already open, so that only the allocations of queries fail. */
static ebpo_status call_catalogue_again(every_call_env *e)
{
    ebpo_catalogue *catalogue = NULL;
    ebpo_catalogue_models *models = NULL;
    every_call_pause();
    ebpo_status status = make_catalogue(e, &catalogue);
    if (status == EBPO_OK)
        status = ebpo_catalogue_models_new(NULL, &models, e->error);
    if (status == EBPO_OK)
        status = query_catalogue(catalogue, models, e->error);
    every_call_resume();
    if (status == EBPO_OK)
        status = query_catalogue(catalogue, models, e->error);
    ebpo_catalogue_models_free(models);
    ebpo_catalogue_free(catalogue);
    return status;
}

const every_call every_call_results[] = {
    { "sample", call_sample },
    { "ask", call_query },
    { "ask_cached", call_query_cached },
    { "ask_ahead", call_query_ahead },
    { "ask_subtree", call_query_subtree },
    { "ask_nodes", call_query_nodes },
    { "budget", call_budget },
    { "measure", call_measure },
    { "deviation", call_error_bound },
    { "limit", call_limit },
    { "lod", call_lod },
    { "lod_nodes", call_lod_nodes },
    { "stream", call_stream },
    { "view", call_view },
    { "subtree", call_subtree },
    { "catalogue", call_catalogue },
    { "catalogue_again", call_catalogue_again },
    { NULL, NULL },
};
