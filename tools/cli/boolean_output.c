#include "cli/boolean_output.h"

#include <inttypes.h>
#include <stdio.h>

#include <ebpo/collide.h>

#include "cli/words.h"

/* Converts the mesh to an .ebpo.h5 file. */
static ebpo_status convert_mesh(const boolean_output *o, ebpo_mesh *mesh, ebpo_progress progress,
                                ebpo_error *error)
{
    ebpo_prepared prepared = EBPO_PREPARED_INIT;
    ebpo_prepare_options prepare_options = EBPO_PREPARE_OPTIONS_INIT;
    ebpo_build_options build_options = EBPO_BUILD_OPTIONS_INIT;
    ebpo_write_options write_options = EBPO_WRITE_OPTIONS_INIT;
    ebpo_tree tree;
    prepare_options.threads = build_options.threads = write_options.threads = o->threads;
    prepare_options.progress = build_options.progress = write_options.progress = progress;
    build_options.require_solid = true;
    build_options.unit = o->unit;
    ebpo_status status = ebpo_mesh_prepare(mesh, &prepare_options, &prepared, error);
    if (status == EBPO_OK)
        status = ebpo_build(mesh, &prepared.report, NULL, &build_options, &tree, error);
    if (status != EBPO_OK)
        return status;
    status = ebpo_tree_write(&tree, o->path, &write_options, error);
    ebpo_tree_free(&tree);
    return status;
}

ebpo_status boolean_write_mesh(const boolean_output *o, ebpo_mesh *mesh, ebpo_progress progress,
                               ebpo_error *error)
{
    return words_end_with(o->path, ".ply") ? ebpo_mesh_write_ply(mesh, o->path, error)
                                           : convert_mesh(o, mesh, progress, error);
}

/* Counts the pairs of intersecting faces of the mesh. The check changes the mesh. */
static ebpo_status count_crossings(boolean_output *o, ebpo_mesh *mesh, ebpo_progress progress,
                                   ebpo_error *error)
{
    ebpo_mesh_report report;
    ebpo_self_intersections_options options = EBPO_SELF_INTERSECTIONS_OPTIONS_INIT;
    ebpo_self_intersections_summary sum = EBPO_SELF_INTERSECTIONS_SUMMARY_INIT;
    options.threads = o->threads;
    options.progress = progress;
    if (mesh->face_count == 0)
        return EBPO_OK;
    ebpo_status status = ebpo_mesh_check(mesh, o->threads, progress, &report, error);
    if (status == EBPO_OK)
        status = ebpo_mesh_self_intersections(mesh, &report, &options, NULL, NULL, &sum, error);
    for (int i = 0; i < 4; i++)
        o->crossing_pairs += sum.pairs[i];
    return status;
}

/* Writes the mesh, and then counts the intersecting faces of the written mesh. */
static ebpo_status write_and_count(boolean_output *o, ebpo_mesh *mesh, ebpo_progress progress,
                                   ebpo_error *error)
{
    ebpo_file *file = NULL;
    ebpo_read_options read_options = EBPO_READ_OPTIONS_INIT;
    ebpo_status status = boolean_write_mesh(o, mesh, progress, error);
    if (status != EBPO_OK || !o->crossings)
        return status;
    /* The conversion to .ebpo.h5 has freed the mesh, so the mesh is read back from the output. */
    if (!words_end_with(o->path, ".ply")) {
        read_options.threads = o->threads;
        read_options.workspace = o->workspace;
        status = ebpo_open(o->path, &file, error);
        if (status == EBPO_OK)
            status = ebpo_file_read_mesh(file, &read_options, mesh, error);
        ebpo_close(file);
    }
    return status == EBPO_OK ? count_crossings(o, mesh, progress, error) : status;
}

ebpo_status boolean_write_result(boolean_output *o, ebpo_boolean *b, ebpo_progress progress,
                                 ebpo_error *error)
{
    ebpo_mesh mesh;
    ebpo_boolean_mesh_options options = EBPO_BOOLEAN_MESH_OPTIONS_INIT;
    options.progress = progress;
    options.doubles = o->doubles;
    options.origins = true;
    options.volume = o->volume;
    options.changed_only = o->changed_only;
    options.attributes = !o->changed_only;
    options.colours = o->colours;
    options.workspace = o->workspace;
    o->report = (ebpo_boolean_mesh_report)EBPO_BOOLEAN_MESH_REPORT_INIT;
    ebpo_status status = ebpo_boolean_mesh(b, &options, &mesh, &o->report, error);
    if (status != EBPO_OK)
        return status;
    if (ebpo_mesh_attributes_lost(&mesh))
        fprintf(stderr, "ebpo boolean: %s: warning: attributes that are not carried over: %s\n",
                o->path, ebpo_mesh_attributes_lost(&mesh));
    o->vertices = mesh.vertex_count;
    o->faces = mesh.face_count;
    o->is_empty = mesh.face_count == 0 && !o->changed_only;
    if (o->is_empty && !words_end_with(o->path, ".ply")) {
        error->status = status = EBPO_E_ABSENT;
        snprintf(error->message, sizeof error->message,
                 "%s: the result is empty, but an .ebpo.h5 file cannot be empty; write a .ply file",
                 o->path);
    } else {
        status = write_and_count(o, &mesh, progress, error);
    }
    ebpo_mesh_free(&mesh);
    if (o->workspace) {
        ebpo_workspace_stats stats = EBPO_WORKSPACE_STATS_INIT;
        (void)ebpo_workspace_get_stats(o->workspace, &stats);
        o->temporary = stats.filed_peak;
    }
    return status;
}

void boolean_print_result(const boolean_output *o)
{
    char faces[40], cut[40], added[40], real[32];
    words_plural(faces, sizeof faces, o->faces, "face", "faces");
    words_plural(cut, sizeof cut, o->report.faces_cut, "face", "faces");
    words_plural(added, sizeof added, o->report.new_vertices, "new vertex", "new vertices");
    printf("%s: %s, %s; %s cut, %s, displaced at most %s", o->path, faces,
           o->changed_only ? "changed faces only" : "closed", cut, added,
           words_real(o->report.displacement, real));
    if (o->changed_only)
        printf("; removed faces of A: %" PRIu64, o->report.removed_faces);
    if (o->workspace)
        printf("; temporary files: %s", words_bytes(real, sizeof real, o->temporary));
    if (o->crossings)
        printf("; pairs of faces that intersect: %" PRIu64, o->crossing_pairs);
    putchar('\n');
}

void boolean_result_to_json(const boolean_output *o, json *j)
{
    json_text(j, "output", o->path);
    json_uint(j, "vertices", o->vertices);
    json_uint(j, "faces", o->faces);
    json_uint(j, "faces_cut", o->report.faces_cut);
    json_uint(j, "new_vertices", o->report.new_vertices);
    json_uint(j, "patches", o->report.patches);
    json_real(j, "displacement", o->report.displacement);
    if (o->changed_only)
        json_uint(j, "removed_faces", o->report.removed_faces);
    if (o->crossings)
        json_uint(j, "crossings", o->crossing_pairs);
    json_uint(j, "temporary_bytes", o->temporary);
}
