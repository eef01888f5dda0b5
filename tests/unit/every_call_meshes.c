/* Calls for meshes: reading, checking, repairing, building. */
#include <stdlib.h>
#include <string.h>

#include "every_call.h"
#include "scratch.h"

ebpo_status every_call_read(every_call_env *e, const char *name, ebpo_mesh *mesh)
{
    ebpo_mesh_read_options options = EBPO_MESH_READ_OPTIONS_INIT;
    options.threads = 1;
    options.workspace = e->workspace;
    options.attributes = 1;
    return ebpo_mesh_read(scratch(name), &options, mesh, e->error);
}

static ebpo_status call_read(every_call_env *e)
{
    ebpo_mesh mesh;
    ebpo_attribute_facts facts = EBPO_ATTRIBUTE_FACTS_INIT;
    ebpo_attribute_values values;
    ebpo_status status = every_call_read(e, EVERY_CALL_PLY, &mesh);
    (void)ebpo_mesh_attribute(&mesh, 0, &facts, &values);
    (void)ebpo_mesh_attributes_lost(&mesh);
    (void)ebpo_mesh_ignored(&mesh);
    (void)ebpo_mesh_has_attributes(&mesh);
    ebpo_mesh_free(&mesh);
    return status;
}

static ebpo_status call_import(every_call_env *e)
{
    ebpo_mesh mesh;
    ebpo_status status = every_call_read(e, EVERY_CALL_OBJ, &mesh);
    ebpo_mesh_free(&mesh);
    return status;
}

static ebpo_status call_parse_points(every_call_env *e)
{
    static const char text[] = "ply\nformat ascii 1.0\nelement vertex 2\nproperty double x\n"
                               "property double y\nproperty double z\nend_header\n1 2 3\n4 5 6\n";
    double *xyz;
    uint64_t count;
    ebpo_status status =
        ebpo_points_parse_ply(text, sizeof text - 1, "points", &xyz, &count, e->error);
    free(xyz);
    return status;
}

static ebpo_status call_rows(every_call_env *e)
{
    double *rows;
    uint64_t count;
    ebpo_status status = ebpo_rows_read(scratch(EVERY_CALL_ROWS), EVERY_CALL_ROWS_PATH, 3, 3, 0,
                                        &rows, &count, e->error);
    free(rows);
    return status;
}

static ebpo_status call_rows_part(every_call_env *e)
{
    double *rows;
    uint64_t count, total;
    ebpo_status status = ebpo_rows_read_part(scratch(EVERY_CALL_ROWS), EVERY_CALL_ROWS_PATH, 3, 3,
                                             0, 1, 2, &rows, &count, &total, e->error);
    free(rows);
    return status;
}

static ebpo_status call_write_ply(every_call_env *e)
{
    ebpo_mesh mesh;
    ebpo_status status = every_call_read(e, EVERY_CALL_PLY, &mesh);
    if (status == EBPO_OK)
        status = ebpo_mesh_write_ply(&mesh, scratch("written.ply"), e->error);
    ebpo_mesh_free(&mesh);
    return status;
}

static ebpo_status call_colours(every_call_env *e)
{
    ebpo_mesh mesh;
    ebpo_colours colours = { 0 };
    ebpo_status status = every_call_read(e, EVERY_CALL_PLY, &mesh);
    if (status == EBPO_OK)
        status = ebpo_mesh_colours(&mesh, &colours, e->error);
    ebpo_colours_free(&colours);
    ebpo_mesh_free(&mesh);
    return status;
}

static ebpo_status call_check(every_call_env *e)
{
    ebpo_mesh mesh;
    ebpo_mesh_report report;
    ebpo_status status = every_call_read(e, EVERY_CALL_HOLED, &mesh);
    if (status == EBPO_OK)
        status = ebpo_mesh_check(&mesh, 1, (ebpo_progress){ NULL, NULL }, &report, e->error);
    ebpo_mesh_free(&mesh);
    return status;
}

static bool take_place(void *user, const ebpo_mesh_finding *place)
{
    uint8_t rgb[3];
    (void)user;
    ebpo_finding_colour(place->kind, rgb);
    return ebpo_finding_name(place->kind) != NULL;
}

static ebpo_status call_findings(every_call_env *e)
{
    ebpo_mesh mesh;
    ebpo_findings_options options = EBPO_FINDINGS_OPTIONS_INIT;
    ebpo_status status = every_call_read(e, EVERY_CALL_HOLED, &mesh);
    options.threads = 1;
    options.ply = scratch("places.ply");
    if (status == EBPO_OK)
        status = ebpo_mesh_findings(&mesh, &options, take_place, NULL, NULL, e->error);
    ebpo_mesh_free(&mesh);
    return status;
}

static ebpo_status call_arrange(every_call_env *e)
{
    ebpo_mesh mesh;
    ebpo_status status = every_call_read(e, EVERY_CALL_CROSSING, &mesh);
    if (status == EBPO_OK)
        status = ebpo_mesh_arrange(&mesh, 1, (ebpo_progress){ NULL, NULL }, e->error);
    ebpo_mesh_free(&mesh);
    return status;
}

static ebpo_status repair_record(every_call_env *e, const char *name,
                                 ebpo_status (*how)(ebpo_mesh *, ebpo_repair_record *,
                                                    ebpo_error *))
{
    ebpo_mesh mesh;
    ebpo_repair_record record;
    memset(&record, 0, sizeof record);
    ebpo_status status = every_call_read(e, name, &mesh);
    if (status == EBPO_OK)
        status = how(&mesh, &record, e->error);
    ebpo_mesh_free(&mesh);
    return status;
}

static ebpo_status weld(ebpo_mesh *mesh, ebpo_repair_record *record, ebpo_error *error)
{
    return ebpo_mesh_weld(mesh, record, error);
}

static ebpo_status weld_within(ebpo_mesh *mesh, ebpo_repair_record *record, ebpo_error *error)
{
    return ebpo_mesh_weld_within(mesh, 1e-6, record, error);
}

static ebpo_status orient(ebpo_mesh *mesh, ebpo_repair_record *record, ebpo_error *error)
{
    return ebpo_mesh_orient(mesh, record, error);
}

static ebpo_status fill(ebpo_mesh *mesh, ebpo_repair_record *record, ebpo_error *error)
{
    return ebpo_mesh_fill_holes(mesh, record, error);
}

static ebpo_status drop(ebpo_mesh *mesh, ebpo_repair_record *record, ebpo_error *error)
{
    return ebpo_mesh_drop_duplicates(mesh, record, error);
}

static ebpo_status flip(ebpo_mesh *mesh, ebpo_repair_record *record, ebpo_error *error)
{
    return ebpo_mesh_flip(mesh, record, error);
}

static ebpo_status call_weld(every_call_env *e) { return repair_record(e, EVERY_CALL_SPLIT, weld); }
static ebpo_status call_weld_within(every_call_env *e)
{
    return repair_record(e, EVERY_CALL_SPLIT, weld_within);
}
static ebpo_status call_orient(every_call_env *e)
{
    return repair_record(e, EVERY_CALL_TURNED, orient);
}
static ebpo_status call_fill_holes(every_call_env *e)
{
    return repair_record(e, EVERY_CALL_HOLED, fill);
}

static ebpo_status call_drop(every_call_env *e)
{
    return repair_record(e, EVERY_CALL_DOUBLE, drop);
}

static ebpo_status call_flip(every_call_env *e)
{
    return repair_record(e, EVERY_CALL_TURNED, flip);
}

static ebpo_status call_shells(every_call_env *e)
{
    ebpo_mesh mesh;
    ebpo_shells shells = EBPO_SHELLS_INIT;
    ebpo_status status = every_call_read(e, EVERY_CALL_CROSSING, &mesh);
    if (status == EBPO_OK)
        status = ebpo_mesh_count_shells(&mesh, 1, (ebpo_progress){ NULL, NULL }, &shells, e->error);
    ebpo_mesh_free(&mesh);
    return status;
}

static ebpo_status call_repeated(every_call_env *e)
{
    ebpo_mesh mesh;
    ebpo_finding repeated;
    uint64_t opposite;
    ebpo_status status = every_call_read(e, EVERY_CALL_CROSSING, &mesh);
    if (status == EBPO_OK)
        status = ebpo_mesh_count_repeated(&mesh, 1, &repeated, &opposite, e->error);
    ebpo_mesh_free(&mesh);
    return status;
}

/* Reads the groups of a file without names of groups. */
static ebpo_status call_groups(every_call_env *e)
{
    ebpo_mesh mesh;
    ebpo_mesh_groups *groups = NULL;
    ebpo_mesh_group group = EBPO_MESH_GROUP_INIT;
    ebpo_components *components = NULL;
    ebpo_mesh_read_options how = EBPO_MESH_READ_OPTIONS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    how.threads = 1;
    how.workspace = e->workspace;
    ebpo_status status =
        ebpo_mesh_read_groups(scratch(EVERY_CALL_CROSSING), &how, &mesh, &groups, e->error);
    if (status != EBPO_OK)
        return status;
    if (groups || ebpo_mesh_groups_count(groups) ||
        ebpo_mesh_groups_get(groups, 0, &group, &error) != EBPO_E_ARGUMENT ||
        ebpo_components_of_groups(&mesh, groups, &components, &error) != EBPO_E_ARGUMENT)
        status = EBPO_E_FORMAT;
    ebpo_mesh_groups_free(groups);
    ebpo_mesh_free(&mesh);
    return status;
}

static ebpo_status call_components(every_call_env *e)
{
    ebpo_mesh mesh, part = { 0 };
    ebpo_components *components = NULL;
    ebpo_component facts = EBPO_COMPONENT_INIT;
    ebpo_status status = every_call_read(e, EVERY_CALL_CROSSING, &mesh);
    if (status == EBPO_OK)
        status =
            ebpo_components_new(&mesh, 1, (ebpo_progress){ NULL, NULL }, &components, e->error);
    if (status == EBPO_OK)
        status = ebpo_components_get(components, ebpo_components_count(components) - 1, &facts,
                                     e->error);
    if (status == EBPO_OK)
        status = ebpo_components_mesh(components, 0, &part, e->error);
    ebpo_mesh_free(&part);
    ebpo_components_free(components);
    ebpo_mesh_free(&mesh);
    return status;
}

ebpo_status every_call_prepare(ebpo_mesh *mesh, ebpo_prepared *out, ebpo_error *error)
{
    ebpo_prepare_options options = EBPO_PREPARE_OPTIONS_INIT;
    options.weld = options.orient = options.fill_holes = true;
    options.threads = 1;
    return ebpo_mesh_prepare(mesh, &options, out, error);
}

static ebpo_status call_prepare(every_call_env *e)
{
    ebpo_mesh mesh;
    ebpo_prepared prepared = EBPO_PREPARED_INIT;
    ebpo_status status = every_call_read(e, EVERY_CALL_HOLED, &mesh);
    if (status == EBPO_OK)
        status = every_call_prepare(&mesh, &prepared, e->error);
    ebpo_mesh_free(&mesh);
    return status;
}

static ebpo_status call_repairs(every_call_env *e)
{
    ebpo_mesh mesh;
    ebpo_mesh_report report;
    ebpo_repairs repairs = EBPO_REPAIRS_INIT;
    ebpo_progress silent = { NULL, NULL };
    ebpo_status status = every_call_read(e, EVERY_CALL_HOLED, &mesh);
    if (status == EBPO_OK)
        status = ebpo_mesh_check(&mesh, 1, silent, &report, e->error);
    if (status == EBPO_OK)
        status = ebpo_mesh_try_repairs(&mesh, &report, 1, silent, &repairs, e->error);
    if (status == EBPO_OK && (repairs.chosen < 0 || ebpo_mesh_doubts(0, &report, NULL) == 0))
        status = EBPO_E_FORMAT;
    ebpo_mesh_free(&mesh);
    return status;
}

/* ebpo_build consumes the mesh, also on failure. */
static ebpo_status build(every_call_env *e, const char *name, ebpo_selection selection,
                         unsigned threads)
{
    ebpo_mesh mesh;
    ebpo_tree tree;
    ebpo_prepared prepared = EBPO_PREPARED_INIT;
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    options.leaf_faces = 8;
    options.threads = threads;
    options.select = selection;
    options.parts |= ebpo_selection_describe(selection)->from_leaves ? EBPO_PART_LEAF_PLANES : 0;
    ebpo_status status = every_call_read(e, name, &mesh);
    if (status == EBPO_OK)
        status = every_call_prepare(&mesh, &prepared, e->error);
    if (status == EBPO_OK)
        status = ebpo_build(&mesh, &prepared.report, &prepared.record, &options, &tree, e->error);
    ebpo_mesh_free(&mesh);
    if (status == EBPO_OK)
        ebpo_tree_free(&tree);
    return status;
}

/* ebpo_build_as_theses consumes the mesh, also on failure. */
static ebpo_status call_build_as_theses(every_call_env *e)
{
    ebpo_mesh mesh;
    ebpo_prepared prepared = EBPO_PREPARED_INIT;
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    ebpo_thesis_levels levels = EBPO_THESIS_LEVELS_INIT;
    options.select = EBPO_SELECT_KMEDOIDS;
    options.threads = 1;
    ebpo_status status = every_call_read(e, EVERY_CALL_PLY, &mesh);
    if (status == EBPO_OK)
        status = every_call_prepare(&mesh, &prepared, e->error);
    if (status == EBPO_OK)
        status = ebpo_build_as_theses(&mesh, &prepared.report, &options, EBPO_COALESCE_SUM, &levels,
                                      e->error);
    ebpo_mesh_free(&mesh);
    return status;
}

static ebpo_status call_build(every_call_env *e)
{
    return build(e, EVERY_CALL_PLY, EBPO_SELECT_INHERIT, 1);
}

static ebpo_status call_build_crossing(every_call_env *e)
{
    return build(e, EVERY_CALL_CROSSING, EBPO_SELECT_RANDOM, 1);
}

static ebpo_status call_build_kmedoids(every_call_env *e)
{
    return build(e, EVERY_CALL_PLY, EBPO_SELECT_KMEDOIDS, 1);
}

static ebpo_status call_build_threads(every_call_env *e)
{
    return build(e, EVERY_CALL_PLY, EBPO_SELECT_OFFSET, 2);
}

const every_call every_call_meshes[] = {
    { "read", call_read },
    { "import", call_import },
    { "parse_points", call_parse_points },
    { "rows", call_rows },
    { "rows_part", call_rows_part },
    { "write_ply", call_write_ply },
    { "colours", call_colours },
    { "check", call_check },
    { "findings", call_findings },
    { "arrange", call_arrange },
    { "weld", call_weld },
    { "weld_within", call_weld_within },
    { "orient", call_orient },
    { "drop duplicates", call_drop },
    { "flip", call_flip },
    { "fill_holes", call_fill_holes },
    { "shells", call_shells },
    { "repeated", call_repeated },
    { "components", call_components },
    { "groups", call_groups },
    { "prepare", call_prepare },
    { "repairs", call_repairs },
    { "build", call_build },
    { "build_crossing", call_build_crossing },
    { "build_kmedoids", call_build_kmedoids },
    { "build_as_theses", call_build_as_theses },
    { "build_threads", call_build_threads },
    { NULL, NULL },
};
