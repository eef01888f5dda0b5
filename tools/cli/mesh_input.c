/* Reads the mesh of a command, and makes the requested repairs. Without such a request, may try
 * repairs on copies of the mesh, to advise the user. */
#include "cli/mesh_input.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "cli/command.h"
#include "cli/mesh_findings.h"

static bool steps_given(repair_request requested)
{
    return requested.weld || requested.drop_duplicates || requested.orient || requested.flip ||
           requested.fill_holes;
}

int repair_check(const char *command, repair_request requested)
{
    if (requested.repair && steps_given(requested))
        return command_usage(command,
                             "--repair chooses from --weld, --drop-duplicates, --orient and "
                             "--fill-holes; omit these and --flip");
    if (requested.weld && requested.weld_distance > 0)
        return command_usage(command, "--weld-distance includes --weld; choose one");
    if (requested.orient && requested.flip)
        return command_usage(command, "--orient sets the orientation of faces; omit --flip");
    return EXIT_OK;
}

/* Adds the repairs of a second preparation of the mesh to the record of the first one. */
static void join_preparations(ebpo_prepared *first, const ebpo_prepared *second)
{
    ebpo_repair_record *a = &first->record;
    const ebpo_repair_record *b = &second->record;
    first->was_repaired = true;
    first->report = second->report;
    a->weld |= b->weld;
    a->drop_duplicates |= b->drop_duplicates;
    a->orient |= b->orient;
    a->fill_holes |= b->fill_holes;
    a->welded_vertices += b->welded_vertices;
    a->flipped_faces += b->flipped_faces;
    a->unorientable_components += b->unorientable_components;
    a->filled_holes += b->filled_holes;
    a->added_faces += b->added_faces;
    a->unfilled_holes += b->unfilled_holes;
    a->dropped_faces += b->dropped_faces;
    a->dropped_opposite += b->dropped_opposite;
    a->weld_distance = fmax(a->weld_distance, b->weld_distance);
    a->weld_moved = fmax(a->weld_moved, b->weld_moved);
    a->collapsed_faces += b->collapsed_faces;
}

/* Applies the repairs that were chosen among those tried. */
static ebpo_status apply_chosen(mesh_input *p, ebpo_prepare_options *options, ebpo_error *error)
{
    const ebpo_repair_record *steps = &p->repairs.tries[p->repairs.chosen].record;
    ebpo_prepared second = EBPO_PREPARED_INIT;
    options->weld = steps->weld;
    options->weld_distance = 0;
    options->drop_duplicates = steps->drop_duplicates;
    options->orient = steps->orient;
    options->fill_holes = steps->fill_holes;
    ebpo_status status = ebpo_mesh_prepare(&p->mesh, options, &second, error);
    if (status == EBPO_OK)
        join_preparations(&p->prepared, &second);
    return status;
}

static ebpo_status try_and_repair(mesh_input *p, repair_request requested,
                                  ebpo_prepare_options *options, ebpo_error *error)
{
    if (steps_given(requested) || !(requested.repair || requested.advise))
        return EBPO_OK;
    ebpo_status status = ebpo_mesh_try_repairs(&p->mesh, &p->prepared.report, options->threads,
                                               options->progress, &p->repairs, error);
    p->repairs_tried = status == EBPO_OK && p->repairs.count > 0;
    return p->repairs_tried && requested.repair && p->repairs.chosen >= 0
               ? apply_chosen(p, options, error)
               : status;
}

/* Counts faces at the positions of an earlier face. If no vertices coincide, these are the repeated
 * faces that the check of the mesh has counted. */
static ebpo_status count_repeated(mesh_input *p, unsigned threads, ebpo_error *error)
{
    p->repeated = p->prepared.report.repeated_faces;
    if (!p->prepared.report.repeated_positions.count)
        return EBPO_OK;
    ebpo_status status =
        ebpo_mesh_count_repeated(&p->mesh, threads, &p->repeated, &p->repeated_opposite, error);
    p->repeated_same = p->repeated.count - p->repeated_opposite;
    return status;
}

/* Counts shells (closed components) that are cavities, inside out or nested. A 2-manifold of one
 * component needs no count, because the sign of its volume shows if the component is inside out. */
static ebpo_status count_shells(mesh_input *p, const ebpo_prepare_options *options,
                                ebpo_error *error)
{
    const ebpo_mesh_report *r = &p->prepared.report;
    if (!r->balanced || (r->manifold && r->components < 2))
        return EBPO_OK;
    p->shells = (ebpo_shells)EBPO_SHELLS_INIT;
    p->shells_counted = true;
    return ebpo_mesh_count_shells(&p->mesh, options->threads, options->progress, &p->shells, error);
}

ebpo_solid_volume mesh_input_solid(const mesh_input *p, bool after)
{
    bool same_mesh = after || !p->prepared.was_repaired;
    ebpo_solid_volume solid =
        findings_solid(after ? &p->prepared.report : &p->prepared.before, p->rule,
                       same_mesh && p->shells_counted ? &p->shells : NULL, NULL);
    /* A face that repeats another face with the same orientation counts twice in the volume, so the
     * volume is not known. */
    if (same_mesh && p->repeated_same) {
        solid.lo = 0;
        solid.hi = INFINITY;
    }
    return solid;
}

ebpo_status mesh_input_read_groups(mesh_input *out, const char *path, repair_request requested,
                                   mesh_reading more, ebpo_mesh_groups **groups,
                                   ebpo_workspace *workspace, unsigned threads,
                                   ebpo_progress progress, ebpo_error *error)
{
    ebpo_mesh_read_options options = EBPO_MESH_READ_OPTIONS_INIT;
    ebpo_prepare_options repairs = EBPO_PREPARE_OPTIONS_INIT;
    options.progress = repairs.progress = progress;
    options.threads = repairs.threads = threads;
    options.workspace = workspace;
    options.attributes = more != READ_MESH;
    options.embed_textures = more == READ_TEXTURES;
    repairs.weld = requested.weld;
    repairs.weld_distance = requested.weld_distance;
    repairs.drop_duplicates = requested.drop_duplicates;
    repairs.orient = requested.orient;
    repairs.flip = requested.flip;
    repairs.fill_holes = requested.fill_holes;
    memset(out, 0, sizeof *out);
    out->chosen_by_repair = requested.repair;
    out->prepared = (ebpo_prepared)EBPO_PREPARED_INIT;
    out->repairs = (ebpo_repairs)EBPO_REPAIRS_INIT;
    ebpo_status status = groups ? ebpo_mesh_read_groups(path, &options, &out->mesh, groups, error)
                                : ebpo_mesh_read(path, &options, &out->mesh, error);
    if (status != EBPO_OK)
        return status;
    const char *unread = ebpo_mesh_ignored(&out->mesh);
    snprintf(out->unread, sizeof out->unread, "%s", unread ? unread : "");
    out->as_read = out->mesh;
    out->as_read.faces = NULL;
    out->as_read.attributes = NULL;
    status = ebpo_mesh_prepare(&out->mesh, &repairs, &out->prepared, error);
    if (status == EBPO_OK)
        status = try_and_repair(out, requested, &repairs, error);
    if (status == EBPO_OK)
        status = count_repeated(out, threads, error);
    if (status == EBPO_OK)
        status = count_shells(out, &repairs, error);
    out->doubts =
        ebpo_mesh_doubts(out->prepared.before.area, &out->prepared.report, &out->prepared.record);
    if (status == EBPO_OK)
        return EBPO_OK;
    ebpo_mesh_free(&out->mesh);
    if (groups) {
        ebpo_mesh_groups_free(*groups);
        *groups = NULL;
    }
    return status;
}

ebpo_status mesh_input_read(mesh_input *out, const char *path, repair_request requested,
                            mesh_reading more, ebpo_workspace *workspace, unsigned threads,
                            ebpo_progress progress, ebpo_error *error)
{
    return mesh_input_read_groups(out, path, requested, more, NULL, workspace, threads, progress,
                                  error);
}

void mesh_input_warn(const char *command, const char *path, const mesh_input *input)
{
    if (input->unread[0])
        fprintf(stderr, "ebpo %s: %s: warning: not read: %s\n", command, path, input->unread);
    const ebpo_mesh *m = &input->as_read;
    if (m->polygons_guessed)
        fprintf(stderr,
                "ebpo %s: %s: warning: %llu of %llu polygons %s and got triangles of least area, "
                "which may be wrong (from face %llu on); triangulate such polygons in the program "
                "that wrote them\n",
                command, path, (unsigned long long)m->polygons_guessed,
                (unsigned long long)m->polygons_triangulated,
                m->polygons_guessed == 1 ? "crosses itself" : "cross themselves",
                (unsigned long long)m->first_guessed_face);
}
