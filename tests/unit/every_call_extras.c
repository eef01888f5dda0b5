/* Calls of modules built on queries: two models, Booleans, maps, haptics, paint, scenes. */
#include <math.h>
#include <stdlib.h>
#include <unistd.h>

#include <ebpo/boolean.h>
#include <ebpo/collide.h>
#include <ebpo/map.h>
#include <ebpo/paint.h>
#include <ebpo/scene.h>
#include <ebpo/haptic.h>

#include "every_call.h"
#include "scratch.h"

static bool count_found(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    (void)pairs;
    *(uint64_t *)user += count;
    return true;
}

static bool count_segments(void *user, const ebpo_contact_segment *segments, uint64_t count)
{
    (void)segments;
    *(uint64_t *)user += count;
    return true;
}

static bool count_lines(void *user, const ebpo_polyline *line)
{
    *(uint64_t *)user += line->count;
    return true;
}

static ebpo_status write_found(ebpo_collider *collider, const ebpo_collide_options *options,
                               ebpo_error *error)
{
    ebpo_status status =
        ebpo_collide_write(collider, options, EBPO_PAIRS_HDF5, scratch("pairs.h5"), error);
    if (status == EBPO_OK)
        status = ebpo_collide_write(collider, options, EBPO_PAIRS_PLY, scratch("red.ply"), error);
    unlink(scratch("pairs.h5"));
    unlink(scratch("red.ply"));
    return status;
}

static ebpo_status query_two(ebpo_collider *collider, const ebpo_collide_options *options,
                             ebpo_error *error)
{
    ebpo_face_pair pair;
    ebpo_collider_stats stats = EBPO_COLLIDER_STATS_INIT;
    const double up[3] = { 0, 0, 1 };
    ebpo_separation separation;
    ebpo_collide_distance_result clearance;
    ebpo_value_bounds depth[2];
    ebpo_relation_result relation;
    ebpo_level_result levels;
    int32_t found;
    uint64_t count = 0;
    ebpo_status status = ebpo_collide_first(collider, options, &pair, &found, error);
    if (status == EBPO_OK)
        status = ebpo_collide_all(collider, options, count_found, &count, error);
    if (status == EBPO_OK)
        status = ebpo_collide_self(collider, options, count_found, &count, error);
    if (status == EBPO_OK)
        status = ebpo_collide_contacts(collider, options, count_segments, &count, error);
    if (status == EBPO_OK)
        status = ebpo_collide_polylines(collider, options, count_lines, &count, error);
    if (status == EBPO_OK)
        status = ebpo_collide_distance(collider, options, NULL, &clearance, error);
    if (status == EBPO_OK)
        status = ebpo_collide_depth(collider, options, 0.5, &depth[0], &depth[1], error);
    if (status == EBPO_OK)
        status = ebpo_collide_separation(collider, options, up, &separation, error);
    if (status == EBPO_OK)
        status = ebpo_collide_relation(collider, options, &relation, error);
    if (status == EBPO_OK)
        status = write_found(collider, options, error);
    if (status == EBPO_OK)
        status = ebpo_collide_levels(collider, options, &levels, error);
    if (status == EBPO_OK)
        status = ebpo_collider_get_stats(collider, &stats);
    return status;
}

static bool take_segments(void *user, const ebpo_contact_segment *segments, uint64_t count)
{
    (void)segments;
    *(uint64_t *)user += count;
    return true;
}

/* Runs queries for partly loaded models. */
static ebpo_status query_parts(ebpo_collider *c, const ebpo_collide_options *o, ebpo_error *error)
{
    ebpo_collide_distance_result clearance;
    uint64_t segments = 0;
    ebpo_status status = ebpo_collide_distance(c, o, NULL, &clearance, error);
    return status == EBPO_OK ? ebpo_collide_contacts(c, o, take_segments, &segments, error)
                             : status;
}

static ebpo_status collide(ebpo_model *model, bool whole, ebpo_error *error)
{
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_collider *collider = NULL;
    options.pose_b.translation[0] = 0.3;
    static const double half[4] = { 0, 0, 1, 1 };
    ebpo_status status = ebpo_pose_turn(&options.pose_b, half, error);
    if (status == EBPO_OK)
        status = ebpo_pose_check(model, &options.pose_b, error);
    if (status == EBPO_OK)
        status = ebpo_collider_new(model, model, NULL, &collider, error);
    if (status == EBPO_OK)
        status =
            whole ? query_two(collider, &options, error) : query_parts(collider, &options, error);
    ebpo_collider_free(collider);
    return status;
}

static ebpo_status query_boolean_cells(ebpo_boolean *boolean, ebpo_error *error)
{
    ebpo_cells_options options = EBPO_CELLS_OPTIONS_INIT;
    ebpo_boolean_cells *cells = NULL;
    ebpo_boolean_volume volume = EBPO_BOOLEAN_VOLUME_INIT;
    ebpo_mesh mesh = { 0 };
    options.level = 2;
    ebpo_status status = ebpo_boolean_cells_new(boolean, &options, &cells, error);
    if (status == EBPO_OK)
        status = ebpo_boolean_cells_volume(cells, &volume);
    if (status == EBPO_OK)
        status = ebpo_boolean_cells_mesh(cells, EBPO_BOOLEAN_OUTER, &mesh, error);
    ebpo_mesh_free(&mesh);
    ebpo_boolean_cells_free(cells);
    return status;
}

/* Makes the mesh with attributes, and then its changes. */
static ebpo_status make_boolean_mesh(ebpo_boolean *boolean, ebpo_error *error)
{
    ebpo_boolean_mesh_report report = EBPO_BOOLEAN_MESH_REPORT_INIT;
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < 2 && status == EBPO_OK; i++) {
        ebpo_boolean_mesh_options options = EBPO_BOOLEAN_MESH_OPTIONS_INIT;
        ebpo_mesh mesh = { 0 };
        options.origins = options.colours = true;
        options.attributes = i == 0;
        options.changed_only = i == 1;
        status = ebpo_boolean_mesh(boolean, &options, &mesh, &report, error);
        ebpo_mesh_free(&mesh);
    }
    return status;
}

static ebpo_status query_boolean(ebpo_model *model, ebpo_error *error)
{
    const ebpo_boolean_operand operands[2] = { { model, EBPO_POSE_INIT },
                                               { model, EBPO_POSE_INIT } };
    const ebpo_boolean_node nodes[3] = { { EBPO_BOOLEAN_OPERAND, 0, 0, 0 },
                                         { EBPO_BOOLEAN_OPERAND, 1, 0, 0 },
                                         { EBPO_BOOLEAN_UNION, 0, 1, 0 } };
    double points[EVERY_CALL_POINTS][3];
    ebpo_boolean_result results[EVERY_CALL_POINTS];
    ebpo_boundary_distance distance;
    ebpo_exact_volume exact = EBPO_EXACT_VOLUME_INIT;
    ebpo_boolean_options options = EBPO_BOOLEAN_OPTIONS_INIT;
    ebpo_boolean *boolean = NULL;
    options.threads = 1;
    every_call_points(points);
    ebpo_status status = ebpo_boolean_new(operands, 2, nodes, 3, &options, &boolean, error);
    if (status == EBPO_OK)
        status = ebpo_boolean_inside(boolean, points[0], results, error);
    if (status == EBPO_OK)
        status = ebpo_boolean_inside_many(boolean, points[0], EVERY_CALL_POINTS, results, error);
    if (status == EBPO_OK)
        status = ebpo_boolean_distance(boolean, points[0], NULL, &distance, error);
    if (status == EBPO_OK)
        status = ebpo_boolean_exact_volume(boolean, NULL, &exact, error);
    if (status == EBPO_OK)
        status = query_boolean_cells(boolean, error);
    if (status == EBPO_OK)
        status = make_boolean_mesh(boolean, error);
    ebpo_boolean_free(boolean);
    return status;
}

/* Calls for two models, and Booleans of one. `whole`: the whole model is in memory. */
ebpo_status every_call_two_models(ebpo_model *model, bool whole, ebpo_error *error)
{
    ebpo_status status = query_boolean(model, error);
    return status == EBPO_OK ? collide(model, whole, error) : status;
}

static ebpo_status take_layers(void *user, const double *values, uint64_t first, uint64_t layers,
                               ebpo_error *error)
{
    (void)user;
    (void)values;
    (void)first;
    (void)layers;
    (void)error;
    return EBPO_OK;
}

static ebpo_status map_lattice(ebpo_model *model, ebpo_error *error)
{
    static const double low[3] = { -1, -1, -1 }, high[3] = { 1, 1, 1 };
    static const uint64_t count[3] = { 3, 2, 2 };
    ebpo_map_options options = EBPO_MAP_OPTIONS_INIT;
    ebpo_map_stats stats = EBPO_MAP_STATS_INIT;
    ebpo_lattice lattice;
    options.threads = 1;
    ebpo_status status = ebpo_lattice_of_box(low, high, count, &lattice, error);
    if (status == EBPO_OK)
        status = ebpo_map_lattice(model, &lattice, &options, take_layers, NULL, error);
    for (int format = 0; format < 2 && status == EBPO_OK; format++)
        status = ebpo_map_write(model, &lattice, scratch("map"), (ebpo_map_format)format, &options,
                                &stats, error);
    every_call_pause();
    unlink(scratch("map"));
    every_call_resume();
    return status;
}

static ebpo_status map_mesh(ebpo_model *model, ebpo_error *error)
{
    double xyz[9] = { 0, 0, 0, 1, 0, 0, 0, 1, 0 }, away[3];
    uint32_t face[3] = { 0, 1, 2 };
    ebpo_mesh mesh = { .vertex_count = 3, .face_count = 1 };
    ebpo_map_options options = EBPO_MAP_OPTIONS_INIT;
    ebpo_map_stats stats = EBPO_MAP_STATS_INIT;
    ebpo_map_hausdorff reach = EBPO_MAP_HAUSDORFF_INIT;
    ebpo_map_hausdorff_options reaching = EBPO_MAP_HAUSDORFF_OPTIONS_INIT;
    options.threads = reaching.threads = 1;
    ebpo_status status = ebpo_map_points(model, xyz, 3, &options, away, error);
    if (status == EBPO_OK)
        status = ebpo_map_describe(away, 3, &stats, error);
    mesh.xyz64 = xyz;
    mesh.faces = face;
    if (status == EBPO_OK)
        status = ebpo_map_bound_hausdorff(model, &mesh, away, &reaching, &reach, error);
    mesh.xyz64 = NULL; /* painting adds data to the mesh */
    mesh.faces = NULL;
    if (status == EBPO_OK)
        status = ebpo_map_paint(&mesh, away, EBPO_MAP_THESIS, 1, error);
    ebpo_mesh_free(&mesh);
    return status;
}

static ebpo_status call_map(every_call_env *e)
{
    uint8_t rgb[3];
    ebpo_model *model;
    ebpo_model_options opening = EBPO_MODEL_OPTIONS_INIT;
    opening.threads = 1;
    ebpo_map_colour(EBPO_MAP_DIVERGING, ebpo_map_percent(0), 2, rgb);
    if (!ebpo_map_palette_name(EBPO_MAP_DIVERGING))
        return EBPO_E_ARGUMENT;
    ebpo_status status = ebpo_model_new(e->file, &opening, &model, e->error);
    if (status == EBPO_OK)
        status = map_lattice(model, e->error);
    if (status == EBPO_OK)
        status = map_mesh(model, e->error);
    ebpo_model_free(model);
    return status;
}

static ebpo_status touch(ebpo_model *model, ebpo_error *error)
{
    static const double away[3] = { 9, 0, 0 }, closer[3] = { 6, 0, 0 };
    ebpo_haptic *touch;
    ebpo_haptic_ball_result result;
    ebpo_haptic_stats stats = EBPO_HAPTIC_STATS_INIT;
    double path[EBPO_HAPTIC_PATH_MAX][3];
    ebpo_haptic_options options = EBPO_HAPTIC_OPTIONS_INIT;
    options.faces = 1 << 12;
    const ebpo_haptic_instance instance = { model, EBPO_POSE_INIT };
    ebpo_status status = ebpo_haptic_new_posed(&instance, 1, &options, away, &touch, error);
    if (status == EBPO_OK) {
        ebpo_haptic_free(touch);
        status = ebpo_haptic_new(model, &options, away, &touch, error);
    }
    if (status != EBPO_OK)
        return status;
    ebpo_haptic_probe_result sensed;
    ebpo_haptic_tool_result turned;
    double poses[EBPO_HAPTIC_PATH_MAX][7];
    static const double turn[4] = { 0, 0, 0, 1 };
    ebpo_haptic_step_ball(touch, away, &result);
    (void)ebpo_haptic_ball_path(touch, path);
    ebpo_haptic_step_probe(touch, away,
                           &sensed); /* a device of the wrong kind: an error is reported */
    ebpo_haptic_step_tool(touch, away, turn, &turned);
    (void)ebpo_haptic_tool_path(touch, poses);
    status = ebpo_haptic_reset(touch, closer, error);
    if (status == EBPO_OK)
        status = ebpo_haptic_check(touch, error);
    if (status == EBPO_OK)
        status = ebpo_haptic_get_stats(touch, &stats);
    ebpo_haptic_free(touch);
    return status;
}

static bool take_painted(void *user, const ebpo_paint_face *face)
{
    (void)user;
    return face->file_face != 1;
}

/* Queries strokes of a paint on the model. */
static ebpo_status query_paint(ebpo_paint *paint, ebpo_context *context, ebpo_error *error)
{
    const ebpo_paint_input hand[2] = { { { 3, 0, 1 }, 1, 0 }, { { 3, 0.5, 1 }, 0.5, 10 } };
    ebpo_paint_pen pen = EBPO_PAINT_PEN_INIT;
    ebpo_paint_drawn laid = EBPO_PAINT_DRAWN_INIT;
    ebpo_paint_areas areas = EBPO_PAINT_AREAS_INIT;
    ebpo_paint_options options = EBPO_PAINT_OPTIONS_INIT;
    ebpo_paint_note note = EBPO_PAINT_NOTE_INIT;
    uint64_t elsewhere;
    pen.radius = 0.3;
    pen.spread = 0.4;
    pen.density = 3;
    options.fineness = 8;
    options.threads = 1;
    ebpo_paint_drawing *drawing = NULL;
    ebpo_status status = ebpo_paint_draw(paint, context, hand, 2, &pen, &laid, error);
    if (status == EBPO_OK)
        status = ebpo_paint_drawing_new(paint, context, &pen, &drawing, error);
    if (status == EBPO_OK)
        status = ebpo_paint_drawing_add(drawing, hand, 2, NULL, error);
    ebpo_paint_drawing_free(drawing);
    if (status == EBPO_OK)
        status = ebpo_paint_cover(paint, context, 0, take_painted, NULL, &elsewhere, error);
    if (status == EBPO_OK)
        status = ebpo_paint_measure(paint, context, &options, &areas, error);
    if (status == EBPO_OK)
        ebpo_paint_areas_free(&areas);
    if (status == EBPO_OK)
        status = ebpo_paint_locate(paint, context, hand[0].place, &note.at, error);
    note.body = "here";
    return status == EBPO_OK ? ebpo_paint_add_note(paint, &note, error) : status;
}

static ebpo_status bake_paint(const ebpo_paint *paint, const ebpo_file *file, ebpo_context *context,
                              ebpo_error *error)
{
    ebpo_paint_baked baked = EBPO_PAINT_BAKED_INIT;
    ebpo_mesh mesh;
    ebpo_status status = ebpo_file_read_source_mesh(file, NULL, &mesh, NULL, error);
    if (status != EBPO_OK)
        return status;
    uint8_t *rgba = calloc(mesh.vertex_count, 4);
    if (rgba)
        status = ebpo_paint_bake(paint, context, &mesh, NULL, rgba, &baked, error);
    if (rgba && status == EBPO_OK)
        status = ebpo_paint_colour_mesh(&mesh, rgba, error);
    if (!rgba)
        *error = (ebpo_error){ .status = status = EBPO_E_MEMORY, .message = "colours" };
    free(rgba);
    ebpo_mesh_free(&mesh);
    return status;
}

/* Writes, reads and removes a paint. */
static ebpo_status keep_paint(ebpo_paint *paint, ebpo_error *error)
{
    ebpo_paint *read = NULL;
    ebpo_paint_info info = EBPO_PAINT_INFO_INIT;
    ebpo_paint_layer layer = EBPO_PAINT_LAYER_INIT;
    ebpo_paint_stroke stroke = EBPO_PAINT_STROKE_INIT;
    ebpo_paint_note note = EBPO_PAINT_NOTE_INIT;
    ebpo_status status = ebpo_paint_save(paint, scratch("every.paint.h5"), error);
    if (status == EBPO_OK)
        status = ebpo_paint_open_to_change(scratch("every.paint.h5"), NULL, 0, NULL, &read, error);
    if (status == EBPO_OK)
        status = ebpo_paint_checkpoint(read, error);
    if (status == EBPO_OK)
        status = ebpo_paint_save(read, scratch("every.paint.h5"), error);
    ebpo_paint_free(read);
    read = NULL;
    if (status == EBPO_OK)
        status = ebpo_paint_open(scratch("every.paint.h5"), &read, error);
    if (status != EBPO_OK)
        return status;
    (void)ebpo_paint_get_info(read, &info);
    (void)ebpo_paint_get_layer(read, 0, &layer);
    (void)ebpo_paint_get_note(read, 0, &note);
    (void)ebpo_paint_get_stroke(read, 0, &stroke);
    status = ebpo_paint_set_layer(read, 0, &layer, error);
    if (status == EBPO_OK)
        status = ebpo_paint_add_stroke(paint, &stroke, error);
    if (status == EBPO_OK)
        status = ebpo_paint_remove_stroke(read, 0, error);
    if (status == EBPO_OK)
        status = ebpo_paint_remove_note(read, 0, error);
    if (status == EBPO_OK)
        status = ebpo_paint_remove_layer(read, 0, error);
    ebpo_paint_free(read);
    return status;
}

static ebpo_status call_paint(every_call_env *e)
{
    static const uint8_t none[8] = { 0 };
    ebpo_model *model = NULL;
    ebpo_context *context = NULL;
    ebpo_paint *paint = NULL;
    ebpo_model_options opening = EBPO_MODEL_OPTIONS_INIT;
    opening.threads = 1;
    ebpo_status status = ebpo_model_new(e->file, &opening, &model, e->error);
    if (status == EBPO_OK)
        status = ebpo_context_new(model, &context, e->error);
    if (status == EBPO_OK)
        status = ebpo_paint_new(e->file, &paint, e->error);
    if (status == EBPO_OK)
        status = ebpo_paint_check_model(paint, e->file, e->error);
    if (status == EBPO_OK)
        status = ebpo_paint_add_layer(paint, NULL, NULL, e->error);
    if (status == EBPO_OK)
        status = query_paint(paint, context, e->error);
    if (status == EBPO_OK)
        status = ebpo_paint_check_points(paint, context, NULL, e->error);
    if (status == EBPO_OK)
        status = bake_paint(paint, e->file, context, e->error);
    if (status == EBPO_OK)
        status = keep_paint(paint, e->error);
    ebpo_paint_free(paint);
    if (status == EBPO_OK &&
        ebpo_paint_open_memory(none, sizeof none, NULL, &paint, NULL) == EBPO_OK)
        abort();
    ebpo_context_free(context);
    ebpo_model_free(model);
    return status;
}

static ebpo_status call_haptic(every_call_env *e)
{
    ebpo_model *model;
    ebpo_model_options opening = EBPO_MODEL_OPTIONS_INIT;
    opening.threads = 1;
    ebpo_status status = ebpo_model_new(e->file, &opening, &model, e->error);
    if (status == EBPO_OK)
        status = touch(model, e->error);
    ebpo_model_free(model);
    return status;
}

static bool count_crossings(void *user, const ebpo_self_intersection *crossings, uint64_t count)
{
    (void)crossings;
    *(uint64_t *)user += count;
    return true;
}

/* Finds crossings, which consumes the mesh. */
static ebpo_status call_crossings(every_call_env *e)
{
    ebpo_mesh mesh;
    ebpo_prepared prepared = EBPO_PREPARED_INIT;
    ebpo_self_intersections_options options = EBPO_SELF_INTERSECTIONS_OPTIONS_INIT;
    ebpo_self_intersections_summary sum = EBPO_SELF_INTERSECTIONS_SUMMARY_INIT;
    uint64_t count = 0;
    options.threads = 1;
    options.ply = scratch("red.ply");
    ebpo_status status = every_call_read(e, EVERY_CALL_CROSSING, &mesh);
    if (status == EBPO_OK)
        status = every_call_prepare(&mesh, &prepared, e->error);
    if (status == EBPO_OK)
        status = ebpo_mesh_self_intersections(&mesh, &prepared.report, &options, count_crossings,
                                              &count, &sum, e->error);
    ebpo_mesh_free(&mesh);
    return status;
}

static bool count_pairs(void *user, const ebpo_scene_pair *pairs, uint64_t count)
{
    *(uint64_t *)user += count + (pairs[0].a > pairs[0].b);
    return true;
}

static ebpo_status inspect_scene(const ebpo_scene *scene)
{
    ebpo_scene_counts counts = EBPO_SCENE_COUNTS_INIT;
    ebpo_scene_model_facts model = EBPO_SCENE_MODEL_FACTS_INIT;
    ebpo_scene_instance instance = EBPO_SCENE_INSTANCE_INIT;
    ebpo_scene_camera camera = EBPO_SCENE_CAMERA_INIT;
    double clearance;
    bool fine = ebpo_scene_get_counts(scene, &counts) == EBPO_OK && counts.instances == 2 &&
                ebpo_scene_get_model_facts(scene, 0, &model) == EBPO_OK && model.loaded &&
                ebpo_scene_get_instance(scene, 1, &instance) == EBPO_OK &&
                ebpo_scene_get_camera(scene, 0, &camera) == EBPO_OK &&
                !ebpo_scene_get_layer(scene, 0) && !ebpo_scene_get_group(scene, 0) &&
                ebpo_scene_group_of(scene, 0, 0) == EBPO_SCENE_NONE &&
                ebpo_scene_pair_rule(scene, 0, 1, &clearance) && ebpo_scene_file(scene, 0) &&
                !ebpo_scene_file(scene, 1);
    return fine ? EBPO_OK : EBPO_E_ARGUMENT;
}

static bool count_clashes(void *user, const ebpo_scene_clash *clashes, uint64_t count)
{
    *(uint64_t *)user += count + (clashes[0].kind == EBPO_CLASH_NONE);
    return true;
}

static bool count_approaches(void *user, const ebpo_scene_approach_result *results, uint64_t count)
{
    *(uint64_t *)user += count + (results[0].reached != 1);
    return true;
}

static bool count_needs(void *user, const ebpo_scene_need *needs, uint64_t count)
{
    *(uint64_t *)user += count + (needs[0].bytes == 0);
    return true;
}

static bool count_packed(void *user, const ebpo_scene_packed *models, uint64_t count)
{
    *(uint64_t *)user += count + !models[0].complete;
    return true;
}

static ebpo_status pack_scene(ebpo_scene *scene, ebpo_error *error)
{
    uint64_t needs = 0, packed = 0;
    ebpo_plan_options plan = EBPO_PLAN_OPTIONS_INIT;
    ebpo_pack_options pack = EBPO_PACK_OPTIONS_INIT;
    pack.threads = 1;
    ebpo_status status = ebpo_scene_plan(scene, 0, 1, &plan, count_needs, &needs, error);
    if (status == EBPO_OK)
        status =
            ebpo_scene_pack(scene, scratch("packed"), 0, 1, &pack, count_packed, &packed, error);
    every_call_pause();
    if (status == EBPO_OK)
        scratch_remove(scratch("packed"));
    every_call_resume();
    return status == EBPO_OK && (needs != 1 || packed != 1) ? EBPO_E_ARGUMENT : status;
}

static bool count_leasts(void *user, const ebpo_scene_least *list, uint64_t count)
{
    *(uint64_t *)user += count + (list[0].hi != 0);
    return true;
}

static ebpo_status record_scene(const ebpo_scene *scene, const ebpo_scene_clash *clash,
                                ebpo_error *error)
{
    ebpo_scene_report *record;
    ebpo_scene_frame frame = { .time = 1, .tested = 1 };
    ebpo_status status = ebpo_scene_report_new(scene, scratch("report.h5"), &record, error);
    if (status == EBPO_OK)
        status = ebpo_scene_report_add(record, &frame, clash, 1, error);
    if (status == EBPO_OK)
        status = ebpo_scene_report_finish(record, error);
    ebpo_scene_report_free(record);
    unlink(scratch("report.h5"));
    return status;
}

static bool count_face_pairs(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    *(uint64_t *)user += count + (pairs[0].kind == EBPO_PAIR_APART);
    return true;
}

/* Queries the two intersecting instances. */
static ebpo_status inspect_clash(ebpo_scene *scene, ebpo_error *error)
{
    uint64_t pairs = 0;
    ebpo_scene_stats stats = EBPO_SCENE_STATS_INIT;
    ebpo_scene_clash clash = { .b = 1, .face_a = EBPO_NO_FACE };
    ebpo_status status = ebpo_scene_collide(scene, 0, 1, 1, 1, count_face_pairs, &pairs, error);
    if (status == EBPO_OK)
        status = record_scene(scene, &clash, error);
    if (status == EBPO_OK)
        status = ebpo_scene_get_stats(scene, &stats);
    return status == EBPO_OK && (pairs == 0 || stats.files != 1 || stats.models != 1)
               ? EBPO_E_ARGUMENT
               : status;
}

static ebpo_status intersect_in_scene(ebpo_scene *scene, ebpo_error *error)
{
    uint64_t clashes = 0, tested = 0;
    ebpo_scene_clash_options how = EBPO_SCENE_CLASH_OPTIONS_INIT;
    how.threads = 1;
    how.count = how.locations = how.relate = true;
    how.depth = 0.1;
    ebpo_status status =
        ebpo_scene_find_clashes(scene, 1, &how, count_clashes, &clashes, &tested, error);
    ebpo_scene_approach_options along = EBPO_SCENE_APPROACH_OPTIONS_INIT;
    uint64_t results = 0;
    if (status == EBPO_OK)
        status = inspect_clash(scene, error);
    along.threads = 1;
    along.tolerance = 0.01;
    if (status == EBPO_OK)
        status = ebpo_scene_approach(scene, 0, 1, &along, count_approaches, &results, error);
    if (status == EBPO_OK)
        status = ebpo_scene_least_distances(scene, 0, 1, &along, count_leasts, &results, error);
    return status == EBPO_OK && (clashes != 1 || tested != 1 || results != 2) ? EBPO_E_ARGUMENT
                                                                              : status;
}

static ebpo_status query_scene(ebpo_scene *scene, ebpo_error *error)
{
    double min[3], max[3], length;
    uint64_t pairs = 0;
    ebpo_pose pose;
    ebpo_model *model;
    ebpo_status status = ebpo_scene_load(scene, NULL, error);
    if (status == EBPO_OK)
        status = inspect_scene(scene);
    if (status == EBPO_OK)
        status = ebpo_scene_pose(scene, 1, 0.5, &pose, error);
    if (status == EBPO_OK)
        status = ebpo_scene_motion(scene, 1, 0, 1, &length, error);
    if (status == EBPO_OK)
        status = ebpo_scene_instance_box(scene, 1, 0, 1, min, max, error);
    if (status == EBPO_OK)
        status = ebpo_scene_box(scene, 0, 1, min, max, error);
    if (status == EBPO_OK)
        status = ebpo_scene_pairs(scene, 0, 1, count_pairs, &pairs, error);
    if (status == EBPO_OK)
        status = ebpo_scene_model(scene, 0, &model, error);
    if (status == EBPO_OK)
        status = intersect_in_scene(scene, error);
    return status == EBPO_OK && pairs != 1 ? EBPO_E_ARGUMENT : status;
}

static const char scene_text[] =
    "{\"ebpo_scene\": \"1.0\", \"models\": {\"m\": {\"file\": \"" EVERY_CALL_MODEL "\"}},"
    "\"routes\": {\"r\": {\"poses\": [{}, {\"quaternion\": [1, 0, 0, 1]}], \"step\": 1}},"
    "\"cameras\": [{\"name\": \"c\", \"eye\": [9, 9, 9], \"target\": [0, 0, 0]}],"
    "\"instances\": [{\"name\": \"a\", \"model\": \"m\", \"route\": \"r\"}]}";

static ebpo_status call_scene(every_call_env *e)
{
    ebpo_scene *scene;
    ebpo_scene_instance second = EBPO_SCENE_INSTANCE_INIT;
    second.name = "b";
    ebpo_status status = ebpo_scene_parse(scene_text, sizeof scene_text - 1, "scene", scratch(NULL),
                                          NULL, &scene, e->error);
    if (status == EBPO_OK)
        status = ebpo_scene_add_instance(scene, &second, NULL, e->error);
    if (status == EBPO_OK)
        status = query_scene(scene, e->error);
    ebpo_scene_free(scene);
    return status;
}

static ebpo_status call_scene_file(every_call_env *e)
{
    ebpo_scene *scene = NULL;
    ebpo_boolean_operand operand;
    uint32_t operands;
    ebpo_status status =
        ebpo_write_file(scratch("s.json"), scene_text, sizeof scene_text - 1, e->error);
    if (status == EBPO_OK)
        status = ebpo_scene_open(scratch("s.json"), NULL, &scene, e->error);
    if (status == EBPO_OK)
        status = ebpo_scene_load(scene, NULL, e->error);
    if (status == EBPO_OK)
        status = ebpo_boolean_get_operands(scene, 0, &operand, 1, &operands, e->error);
    if (status == EBPO_OK)
        status = pack_scene(scene, e->error);
    ebpo_scene_free(scene);
    every_call_pause();
    unlink(scratch("s.json"));
    every_call_resume();
    return status;
}

static ebpo_status call_scene_new(every_call_env *e)
{
    ebpo_scene *scene;
    ebpo_status status = ebpo_scene_new(&scene, e->error);
    if (status == EBPO_OK)
        status = ebpo_scene_add_model(scene, "m", "nowhere", NULL, NULL, e->error);
    ebpo_scene_free(scene);
    return status;
}

/* --- results that are cut to a box and a half-space --- */

static ebpo_status call_boolean_cut(every_call_env *e)
{
    static const double box[6] = { -2, -2, -2, 0.25, 2, 2 }, plane[4] = { 0, 1, 2, 0.5 };
    const ebpo_boolean_node nodes[2] = { { EBPO_BOOLEAN_OPERAND, 0, 0, 0 },
                                         { EBPO_BOOLEAN_COMPLEMENT, 0, 0, 0 } };
    ebpo_boolean_operand operand = { NULL, EBPO_POSE_INIT };
    ebpo_model_options holding = EBPO_MODEL_OPTIONS_INIT;
    ebpo_boolean_options options = EBPO_BOOLEAN_OPTIONS_INIT;
    ebpo_boolean *boolean = NULL;
    holding.threads = options.threads = 1;
    options.box = box;
    options.planes = plane;
    options.plane_count = 1;
    ebpo_status status = ebpo_model_new(e->file, &holding, &operand.model, e->error);
    if (status == EBPO_OK)
        status = ebpo_boolean_new(&operand, 1, nodes, 2, &options, &boolean, e->error);
    ebpo_boolean_free(boolean);
    ebpo_model_free(operand.model);
    return status;
}

const every_call every_call_extras[] = {
    { "crossings", call_crossings },
    { "map", call_map },
    { "touch", call_haptic },
    { "paint", call_paint },
    { "scene", call_scene },
    { "scene_file", call_scene_file },
    { "scene_new", call_scene_new },
    { "boolean_cut", call_boolean_cut },
    { NULL, NULL },
};
