#include "cli/prepare.h"

#include <stdio.h>
#include <string.h>

#include "cli/words.h"

static ebpo_status mend(prepared *p, mending asked, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    if (asked.weld)
        status = ebpo_mesh_weld(&p->mesh, &p->record, error);
    if (status == EBPO_OK && asked.orient)
        status = ebpo_mesh_orient(&p->mesh, &p->record, error);
    if (status == EBPO_OK && asked.fill_holes)
        status = ebpo_mesh_fill_holes(&p->mesh, &p->record, error);
    return status;
}

/* Errors of the check do not know the file's name; those of the system name another. */
static ebpo_status name_file(const char *path, ebpo_status status, ebpo_error *error)
{
    if (status == EBPO_OK || status == EBPO_E_IO || strstr(error->message, path))
        return status;
    char message[sizeof error->message];
    memcpy(message, error->message, sizeof message);
    int used = snprintf(error->message, sizeof error->message, "%.200s: ", path);
    snprintf(error->message + used, sizeof error->message - (size_t)used, "%s", message);
    return status;
}

/* What is too large for an exact grid can be checked all the same; building says so again. */
static ebpo_status unless_too_large(ebpo_status status)
{
    return status == EBPO_E_LIMIT ? EBPO_OK : status;
}

ebpo_status prepare_mesh(prepared *out, const char *path, mending asked, ebpo_workspace *workspace,
                         unsigned threads, ebpo_progress progress, ebpo_error *error)
{
    memset(out, 0, sizeof *out);
    ebpo_mesh_read_options options = { progress, workspace, threads };
    ebpo_status status = ebpo_mesh_read(&out->mesh, path, &options, error);
    if (status != EBPO_OK)
        return status;
    out->as_read = out->mesh;
    out->as_read.faces = NULL;
    asked.weld = asked.weld || strncmp(out->mesh.source_format, "stl", 3) == 0;
    out->mended = asked.weld || asked.orient || asked.fill_holes;
    if (out->mended) {
        status = unless_too_large(ebpo_mesh_arrange_to_mend(&out->mesh, threads, progress, error));
        if (status == EBPO_OK)
            status = ebpo_mesh_check(&out->before, &out->mesh, threads, progress, error);
        if (status == EBPO_OK && progress.report)
            (void)progress.report(progress.user, "mending", 0, 0); /* nobody here stops */
        if (status == EBPO_OK)
            status = mend(out, asked, error);
    }
    if (status == EBPO_OK)
        status = unless_too_large(ebpo_mesh_arrange(&out->mesh, threads, progress, error));
    if (status == EBPO_OK)
        status = ebpo_mesh_check(&out->report, &out->mesh, threads, progress, error);
    if (!out->mended)
        out->before = out->report;
    if (status != EBPO_OK)
        ebpo_mesh_free(&out->mesh);
    return name_file(path, status, error);
}
