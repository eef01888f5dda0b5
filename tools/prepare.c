#include "prepare.h"

#include <stdio.h>
#include <string.h>

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

/* Errors of the check do not know the file's name. */
static ebpo_status name_file(const char *path, ebpo_status status, ebpo_error *error)
{
    if (status == EBPO_OK || strstr(error->message, path))
        return status;
    char message[sizeof error->message];
    memcpy(message, error->message, sizeof message);
    int used = snprintf(error->message, sizeof error->message, "%.200s: ", path);
    snprintf(error->message + used, sizeof error->message - (size_t)used, "%s", message);
    return status;
}

ebpo_status prepare_mesh(prepared *out, const char *path, mending asked, unsigned threads, ebpo_progress progress,
                         ebpo_error *error)
{
    memset(out, 0, sizeof *out);
    ebpo_mesh_read_options options = { progress };
    ebpo_status status = ebpo_mesh_read(&out->mesh, path, &options, error);
    if (status != EBPO_OK)
        return status;
    out->as_read = out->mesh;
    out->as_read.faces = NULL;
    asked.weld = asked.weld || strncmp(out->mesh.source_format, "stl", 3) == 0;
    out->mended = asked.weld || asked.orient || asked.fill_holes;
    status = ebpo_mesh_check(&out->before, &out->mesh, threads, progress, error);
    if (status == EBPO_OK && out->mended)
        status = mend(out, asked, error);
    out->report = out->before;
    if (status == EBPO_OK && out->mended)
        status = ebpo_mesh_check(&out->report, &out->mesh, threads, progress, error);
    if (status != EBPO_OK)
        ebpo_mesh_free(&out->mesh);
    return name_file(path, status, error);
}
