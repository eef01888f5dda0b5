/* Asking for the distances, and writing them. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/command.h"
#include "cli/words.h"
#include "cli/commands/map_job.h"

static ebpo_status no_memory(ebpo_error *error)
{
    snprintf(error->message, sizeof error->message, "no memory for the map; make it coarser");
    return error->status = EBPO_E_MEMORY;
}

/* --- planes and grids --- */

static ebpo_status keep_layer(void *user, const double *values, uint64_t first, uint64_t layers,
                              ebpo_error *error)
{
    map_job *const *with = ((void **)user)[0];
    (void)first;
    (void)layers;
    (void)error;
    const ebpo_lattice *l = &(*with)->lattice;
    memcpy(((void **)user)[1], values, l->count[0] * l->count[1] * sizeof *values);
    return EBPO_OK;
}

/* The values of a plane, which its picture needs anyway. */
static ebpo_status map_plane(map_job *j, ebpo_error *error)
{
    uint64_t count = j->lattice.count[0] * j->lattice.count[1];
    double *values = malloc(count * sizeof *values);
    if (!values)
        return no_memory(error);
    void *user[2] = { &j, values };
    ebpo_status status =
        ebpo_map_lattice(j->model, &j->lattice, &j->options, keep_layer, user, error);
    if (status == EBPO_OK)
        status = ebpo_map_describe(values, count, &j->stats, error);
    if (j->range == 0 && j->stats.farthest > 0)
        j->range = j->stats.farthest;
    if (status == EBPO_OK && j->v->out && words_end_with(j->v->out, ".png"))
        status = map_draw_plane(j, values, j->v->out, error);
    if (status == EBPO_OK && j->v->picture)
        status = map_draw_plane(j, values, j->v->picture, error);
    free(values);
    return status;
}

ebpo_status map_plane_or_grid(map_job *j, ebpo_error *error)
{
    const char *out = j->v->out;
    ebpo_status status = EBPO_OK;
    if (j->plane)
        status = map_plane(j, error);
    if (status != EBPO_OK || (j->plane && (!out || words_end_with(out, ".png"))))
        return status;
    return ebpo_map_write(j->model, &j->lattice, out,
                          words_end_with(out, ".nrrd") ? EBPO_MAP_NRRD : EBPO_MAP_VTKHDF,
                          &j->options, j->plane ? NULL : &j->stats, error);
}

/* --- vertices --- */

static ebpo_status read_other(const map_job *j, ebpo_progress progress, ebpo_mesh *out,
                              ebpo_error *error)
{
    if (command_is_hdf5("map", j->v->from) == 0) {
        ebpo_mesh_read_options o = EBPO_MESH_READ_OPTIONS_INIT;
        o.threads = (unsigned)j->v->threads;
        o.progress = progress;
        o.attributes = 1;
        return ebpo_mesh_read(j->v->from, &o, out, error);
    }
    ebpo_read_options o = EBPO_READ_OPTIONS_INIT;
    ebpo_file *file = NULL;
    bool ordered;
    o.threads = (unsigned)j->v->threads;
    o.attributes = 1;
    ebpo_status status = remote_open(&file, j->v->from, &j->v->remote, error);
    if (status == EBPO_OK)
        status = ebpo_file_read_source_mesh(file, &o, out, &ordered, error);
    ebpo_close(file);
    return status;
}

/* A mesh's coordinates may be floats. */
static double *points_of(const ebpo_mesh *m)
{
    double *points = malloc((m->vertex_count + 1) * 3 * sizeof *points);
    for (uint64_t i = 0; points && i < 3 * m->vertex_count; i++)
        points[i] = m->xyz32 ? (double)m->xyz32[i] : m->xyz64[i];
    return points;
}

static ebpo_status paint(map_job *j, ebpo_mesh *m, const double *distances, ebpo_error *error)
{
    if (j->range == 0)
        j->range = j->stats.percentile_unsigned[5];
    if (!(j->range > 0)) /* nothing but zeros */
        j->range = j->stats.farthest > 0 ? j->stats.farthest : 1;
    ebpo_status status =
        ebpo_map_paint(m, distances, (ebpo_map_palette)j->v->palette, j->range, error);
    if (status == EBPO_OK && j->v->out)
        status = ebpo_mesh_write_ply(m, j->v->out, error);
    if (status == EBPO_OK && j->v->picture)
        status = map_draw_mesh(j, m, j->v->picture, error);
    return status;
}

static ebpo_status bound(map_job *j, const ebpo_mesh *m, const double *distances, ebpo_error *error)
{
    ebpo_map_reach_options o = EBPO_MAP_REACH_OPTIONS_INIT;
    o.threads = j->options.threads;
    o.progress = j->options.progress;
    return ebpo_map_find_reach(j->model, m, distances, &o, &j->reach, error);
}

ebpo_status map_vertices(map_job *j, ebpo_progress progress, ebpo_error *error)
{
    ebpo_mesh m = { 0 };
    ebpo_mesh_report report;
    ebpo_status status = read_other(j, progress, &m, error);
    if (status != EBPO_OK)
        return status;
    double *points = points_of(&m), *distances = malloc((m.vertex_count + 1) * sizeof *distances);
    if (!points || !distances)
        status = no_memory(error);
    if (status == EBPO_OK) /* that every index can be drawn */
        status = ebpo_mesh_check(&m, j->options.threads, progress, &report, error);
    if (status == EBPO_OK)
        status = ebpo_map_points(j->model, points, m.vertex_count, &j->options, distances, error);
    if (status == EBPO_OK)
        status = ebpo_map_describe(distances, m.vertex_count, &j->stats, error);
    if (status == EBPO_OK && j->v->bounds)
        status = bound(j, &m, distances, error);
    if (status == EBPO_OK && (j->v->out || j->v->picture))
        status = paint(j, &m, distances, error);
    free(points);
    free(distances);
    ebpo_mesh_free(&m);
    return status;
}
