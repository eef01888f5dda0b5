/* Reads the meshes of operands at their poses. */
#include "core/strict_fp.h"

#include "extras/boolean/operand_mesh.h"

#include "core/error.h"
#include "core/parallel.h"
#include "core/workspace.h"
#include "mesh/mesh_parts.h"

enum { VERTEX_GRAIN = 1 << 15 };

bool ebpo_moves_nothing(const ebpo_posing *p)
{
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            if (p->matrix[i][k] != (i == k) || p->translation[i] != 0)
                return false;
    return true;
}

typedef struct posing_job {
    const ebpo_mesh *mesh;
    const ebpo_posing *posing;
    double *out;
} posing_job;

static ebpo_status pose_some(void *context, uint64_t begin, uint64_t end, unsigned worker,
                             ebpo_error *error)
{
    const posing_job *job = context;
    (void)worker, (void)error;
    EBPO_FOR_ITEMS(job->mesh->workspace, v, begin, end) {
        double x[3];
        ebpo_mesh_position(job->mesh, v, x);
        ebpo_posing_apply(job->posing, x, job->out + 3 * v);
    }
    return EBPO_OK;
}

/* Replaces the coordinates of the mesh by posed coordinates, which are doubles. */
static ebpo_status pose_mesh(ebpo_mesh *mesh, const ebpo_posing *posing, unsigned threads,
                             ebpo_error *error)
{
    double *posed = mesh->xyz64;
    if (!posed)
        posed = ebpo_array_alloc(mesh->workspace, mesh->vertex_count, 3 * sizeof *posed);
    if (!posed)
        return ebpo_workspace_fail(mesh->workspace, mesh->vertex_count * 3 * sizeof *posed, error);
    posing_job job = { mesh, posing, posed };
    ebpo_status status = ebpo_parallel_for(threads, mesh->workspace, mesh->vertex_count,
                                           VERTEX_GRAIN, pose_some, &job, NULL, "", error);
    ebpo_array_free(mesh->workspace, mesh->xyz32);
    mesh->xyz32 = NULL;
    mesh->xyz64 = posed;
    return status;
}

ebpo_status ebpo_operand_mesh_read(ebpo_mesh *out, const ebpo_boolean *b, uint32_t operand,
                                   bool attributes, ebpo_workspace *workspace, ebpo_error *error)
{
    const ebpo_posed_solid *solid = &b->solid[operand];
    ebpo_read_options options = EBPO_READ_OPTIONS_INIT;
    ebpo_error cause = EBPO_ERROR_INIT;
    options.threads = b->threads;
    options.workspace = workspace;
    options.attributes = attributes;
    ebpo_status status = ebpo_file_read_mesh(solid->model->file, &options, out, &cause);
    if (status == EBPO_OK && !ebpo_moves_nothing(&solid->posing))
        status = pose_mesh(out, &solid->posing, b->threads, &cause);
    if (status == EBPO_OK)
        return EBPO_OK;
    ebpo_mesh_free(out);
    return ebpo_fail_operand(solid->model, operand, &cause, error);
}
