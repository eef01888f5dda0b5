/* Gathers the results of one method that are not times. These are values of the header, volumes,
 * hulls, error bounds, targets, budgets, and the costs in the cost model of the theses. */
#include <stdio.h>
#include <string.h>

#include "cli/file_facts.h"
#include "cli/mesh_findings.h"
#include "cli/report/report_data.h"

static void set_header_values(const comparison *c, method *m)
{
    const ebpo_info *info = &m->info;
    double planes = 0;
    for (int i = 0; i < info->level_count; i++)
        planes += (double)(info->level[i].plane_count + info->level[i].leaf_plane_count);
    m->whole[METRIC_FILE_BYTES] = (double)info->file_bytes;
    m->whole[METRIC_HEAD_BYTES] = (double)info->head_bytes;
    m->whole[METRIC_ALL_PLANES] = planes;
    for (int i = c->first; i <= method_last(c, m); i++) {
        const ebpo_level_summary *s = &info->level[i];
        double *f = m->level[i];
        f[METRIC_BYTES] = (double)m->stored.level_bytes[i];
        f[METRIC_CUMULATIVE_BYTES] = (double)facts_cumulative(info, &m->stored, i);
        f[METRIC_GRAY] = (double)s->gray_count;
        f[METRIC_LEAVES] = (double)s->leaf_count;
        f[METRIC_PLANES] = (double)s->plane_count;
        f[METRIC_LEAF_PLANES] = (double)s->leaf_plane_count;
    }
}

/* --- levels --- */

/* Returns true if the volume of the root cell, or 2^-60 of it (the volume of a cell 20 levels
 * below), is not a normal double. */
static bool is_out_of_range(const ebpo_info *info)
{
    double volume = info->box_size[0] * info->box_size[1] * info->box_size[2];
    return !isnormal(volume) || !isnormal(ldexp(volume, -60));
}

/* Returns the volume within the mesh as a share of the volume of the root cell. The share does not
 * depend on the scale of the model. */
static double share_of_root(const ebpo_info *info, const ebpo_mesh *mesh)
{
    double sum = 0;
    for (uint64_t i = 0; i < mesh->face_count; i++) {
        double p[3][3];
        for (uint64_t v = 0; v < 3; v++)
            for (uint64_t k = 0; k < 3; k++) {
                uint64_t at = 3 * (uint64_t)mesh->faces[3 * i + v] + k;
                double x = mesh->xyz32 ? (double)mesh->xyz32[at] : mesh->xyz64[at];
                p[v][k] = x / info->box_size[k] - info->box_origin[k] / info->box_size[k];
            }
        sum += p[0][0] * (p[1][1] * p[2][2] - p[1][2] * p[2][1]) +
               p[0][1] * (p[1][2] * p[2][0] - p[1][0] * p[2][2]) +
               p[0][2] * (p[1][0] * p[2][1] - p[1][1] * p[2][0]);
    }
    return fabs(sum) / 6;
}

/* Sets m->solid_share if volumes are beyond the range of a double. */
static ebpo_status solid_in_root(const comparison *c, method *m, ebpo_file *file, ebpo_error *error)
{
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_mesh mesh = { 0 };
    if (!m->info.solid || !is_out_of_range(&m->info) || m->info.report.components > 1 ||
        !findings_volume_known(&m->solid))
        return EBPO_OK;
    read.threads = (unsigned)c->v->threads;
    ebpo_status status = ebpo_file_read_mesh(file, &read, &mesh, error);
    if (status != EBPO_OK)
        return method_note_missing(m, "excess, with volumes beyond a double's range", status,
                                   error);
    m->solid_share = share_of_root(&m->info, &mesh);
    ebpo_mesh_free(&mesh);
    return EBPO_OK;
}

/* Computes the excess of a level from m->solid_share. */
static ebpo_status excess_in_root(const comparison *c, method *m, ebpo_file *file, int level,
                                  ebpo_error *error)
{
    ebpo_lod_options options = EBPO_LOD_OPTIONS_INIT;
    ebpo_mesh polygons = { 0 };
    options.threads = (unsigned)c->v->threads;
    options.progress = c->progress;
    ebpo_status status = ebpo_lod_level(file, level, &options, &polygons, NULL, error);
    if (status == EBPO_OK)
        m->level[level][METRIC_EXCESS] =
            100 * (share_of_root(&m->info, &polygons) - m->solid_share) / m->solid_share;
    ebpo_mesh_free(&polygons);
    return status;
}

/* Sets the volume of the solid from the header. If the header does not give it, and for a surface
 * with its border, measures the mesh. */
static ebpo_status solid_volume(const comparison *c, method *m, const ebpo_file *file,
                                ebpo_error *error)
{
    ebpo_mass mass = EBPO_MASS_INIT;
    m->solid = facts_solid(&m->info, NULL);
    bool known = findings_volume_known(&m->solid) && !(m->info.parts & EBPO_PART_BORDER);
    if (known || !(m->info.parts & EBPO_PART_MESH) || m->info.pruned)
        return EBPO_OK;
    ebpo_status status = ebpo_measure(file, (unsigned)c->v->threads, &mass, error);
    if (status == EBPO_OK)
        m->solid = facts_measured(&m->info, &mass);
    return status;
}

/* Computes the volumes of levels from all data of the file, including the mesh. */
static ebpo_status gather_volumes(comparison *c, method *m, ebpo_file *file, ebpo_error *error)
{
    ebpo_status status = solid_volume(c, m, file, error);
    if (status == EBPO_OK)
        status = solid_in_root(c, m, file, error);
    for (int i = c->first; i <= method_last(c, m) && status == EBPO_OK; i++) {
        double *f = m->level[i];
        status =
            facts_derived(file, i, (unsigned)c->v->threads, c->progress, &f[METRIC_VOLUME], error);
        f[METRIC_EXCESS] = facts_excess(&m->info, &m->solid, f[METRIC_VOLUME]);
        if (status == EBPO_OK && m->solid_share > 0)
            status = excess_in_root(c, m, file, i, error);
    }
    return status;
}

/* Computes the volumes of levels from the data of the levels alone, without the mesh. */
static ebpo_status gather_levels_volumes(comparison *c, method *m, ebpo_file *file,
                                         ebpo_error *error)
{
    ebpo_stream_options stream_options = { sizeof(ebpo_stream_options), true, true,
                                           (unsigned)c->v->threads };
    ebpo_stream *stream = NULL;
    bool has_more = true;
    ebpo_status status = ebpo_stream_new(file, &stream_options, &stream, error);
    for (int i = 0; i <= method_last(c, m) && status == EBPO_OK; i++) {
        ebpo_stream_level reported;
        status = ebpo_stream_next_level(stream, &reported, &has_more, error);
        if (status == EBPO_OK && i >= c->first) {
            m->level[i][METRIC_LEVELS_VOLUME] = reported.volume;
            /* If the file stores leaf planes, the envelopes are the same with and without the mesh.
             */
            m->level[i][METRIC_LEVELS_EXCESS] =
                !(m->solid_share > 0) ? facts_excess(&m->info, &m->solid, reported.volume)
                : m->info.parts & EBPO_PART_LEAF_PLANES ? m->level[i][METRIC_EXCESS]
                                                        : NAN;
        }
    }
    ebpo_stream_free(stream);
    return status;
}

/* --- the limit, and error bounds --- */

static ebpo_status gather_limits(comparison *c, method *m, ebpo_file *file, ebpo_error *error)
{
    for (int i = c->first; i <= method_last(c, m); i++) {
        ebpo_limit limit = EBPO_LIMIT_INIT;
        ebpo_limit_options options = EBPO_LIMIT_OPTIONS_INIT;
        options.threads = (unsigned)c->v->threads;
        options.progress = c->progress;
        double *f = m->level[i];
        ebpo_status status = ebpo_limit_level(file, i, &options, &limit, error);
        if (status != EBPO_OK)
            return method_note_missing(m, "limit", status, error);
        f[METRIC_LIMIT_VOLUME] = limit.volume;
        f[METRIC_LIMIT_EXCESS] = facts_excess(&m->info, &m->solid, limit.volume);
        f[METRIC_EXCESS_TO_LIMIT] =
            facts_excess_ratio(&m->info, &m->solid, f[METRIC_VOLUME], limit.volume);
        if (!(m->solid_share > 0))
            continue;
        options.in_root_cells = 1;
        status = ebpo_limit_level(file, i, &options, &limit, error);
        if (status != EBPO_OK)
            return status;
        f[METRIC_LIMIT_EXCESS] = 100 * (limit.volume - m->solid_share) / m->solid_share;
        f[METRIC_EXCESS_TO_LIMIT] =
            f[METRIC_LIMIT_EXCESS] > 1e-7 ? f[METRIC_EXCESS] / f[METRIC_LIMIT_EXCESS] : NAN;
    }
    return EBPO_OK;
}

static ebpo_status gather_error_bounds(comparison *c, method *m, ebpo_file *file, ebpo_model *model,
                                       ebpo_error *error)
{
    ebpo_error_bound_options options = EBPO_ERROR_BOUND_OPTIONS_INIT;
    const uint64_t samples = options.samples;
    options.queries = REPORT_QUERIES;
    options.seed = (uint64_t)c->v->seed;
    options.threads = (unsigned)c->v->threads;
    options.progress = c->progress;
    /* The loop begins at level 0 even if --levels omits it, because the bound of each level is used
     * as an upper bound for the next level. */
    for (int i = 0; i <= method_last(c, m); i++) {
        ebpo_error_bound bound = EBPO_ERROR_BOUND_INIT;
        double *f = m->level[i];
        options.samples = i < c->first ? 0 : samples;
        ebpo_status status = ebpo_level_error_bound(model, file, i, &options, &bound, error);
        if (status != EBPO_OK)
            return method_note_missing(m, "Hausdorff distance", status, error);
        options.at_most = bound.hi;
        if (i < c->first)
            continue;
        f[METRIC_FAR_LO] = bound.lo;
        f[METRIC_FAR_HI] = bound.hi;
        f[METRIC_FAR_MEAN] = bound.mean;
        f[METRIC_FAR_RMS] = bound.rms;
    }
    return EBPO_OK;
}

/* --- all values --- */

/* Gathers the results for which the model is opened. */
static ebpo_status gather_from_model(comparison *c, method *m, ebpo_file *file, ebpo_error *error)
{
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
    ebpo_model *model = NULL;
    options.threads = (unsigned)c->v->threads;
    ebpo_status status = ebpo_model_new(file, &options, &model, error);
    if (status != EBPO_OK)
        return status;
    ebpo_model_get_stats(model, &stats);
    m->whole[METRIC_MEMORY_BYTES] = (double)stats.memory;
    status = gather_error_bounds(c, m, file, model, error);
    if (status == EBPO_OK && c->v->targets)
        status = report_targets(c, m, file, model, error);
    ebpo_model_free(model);
    return status == EBPO_OK ? report_budgets(c, m, file, error) : status;
}

ebpo_status report_gather(comparison *c, method *m, ebpo_error *error)
{
    ebpo_file *file = NULL;
    ebpo_status status = remote_open(&file, m->path, &c->v->remote, error);
    set_header_values(c, m);
    if (status == EBPO_OK)
        status = gather_volumes(c, m, file, error);
    if (status == EBPO_OK)
        status = gather_levels_volumes(c, m, file, error);
    if (status == EBPO_OK)
        status = report_lines(c, m, error);
    if (status == EBPO_OK)
        status = report_thesis(c, m, file, error);
    if (status == EBPO_OK)
        status = gather_limits(c, m, file, error);
    if (status == EBPO_OK)
        status = gather_from_model(c, m, file, error);
    ebpo_close(file);
    return status;
}
