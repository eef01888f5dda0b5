/* Implements ebpo_mesh_read: reads one file of any known format, optionally with its groups. */
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "core/checksum.h"
#include "core/workspace.h"
#include "mesh/import.h"
#include "mesh/textures.h"
#include "io/file_source.h"
#include "mesh/mesh_parts.h"
#include "mesh/component_parts.h"

enum { HASH_STEP = 1 << 22 }; /* bytes between two releases of pages */

/* The computation of the file's SHA-256. */
typedef struct hashing {
    const ebpo_whole_file *file;
    ebpo_workspace *workspace;
    uint8_t digest[32];
    pthread_t thread;
    bool threaded; /* `thread` was started */
} hashing;

static void *hash_file(void *argument)
{
    hashing *h = argument;
    ebpo_sha256 state;
    ebpo_sha256_begin(&state);
    EBPO_FOR_PIECES(h->workspace, at, h->file->size, HASH_STEP)
        ebpo_sha256_add(&state, h->file->data + at,
                        h->file->size - at < HASH_STEP ? (size_t)(h->file->size - at) : HASH_STEP);
    ebpo_sha256_end(&state, h->digest);
    return NULL;
}

/* Starts a thread that hashes the file while the calling thread parses it. Hashing and parsing take
 * about the same time and read the same pages. */
static void hash_begin(hashing *h)
{
    h->threaded = ebpo_thread_start(&h->thread, hash_file, h) == 0;
    if (!h->threaded)
        hash_file(h);
}

static void hash_end(hashing *h)
{
    if (h->threaded)
        pthread_join(h->thread, NULL);
}

/* Parses the file, with its groups if they are requested and present. */
static ebpo_status read_parse(ebpo_mesh *out, const ebpo_whole_file *file, const char *path,
                              const ebpo_mesh_read_options *wanted, ebpo_mesh_groups **groups,
                              ebpo_error *error)
{
    ebpo_import_runs runs = { 0 };
    const ebpo_import_job job = { .data = file->data,
                                  .size = file->size,
                                  .name = path,
                                  .workspace = wanted->workspace,
                                  .attributes = wanted->attributes != 0,
                                  .threads = wanted->threads,
                                  .progress = &wanted->progress,
                                  .runs = groups ? &runs : NULL };
    ebpo_status status = ebpo_import_any(out, &job, error);
    if (status == EBPO_OK && runs.count > 1)
        status = ebpo_mesh_groups_new(runs.run, runs.count, groups, error);
    ebpo_import_runs_free(&runs);
    return status;
}

/* If another program has changed the file during reading, returns an error about the change in
 * place of `status`, because the change may have caused a format error. */
static ebpo_status report_change(const ebpo_whole_file *file, const char *path, ebpo_status status,
                                 ebpo_error *error)
{
    ebpo_error changed = EBPO_ERROR_INIT;
    ebpo_status unchanged = ebpo_whole_file_unchanged(file, path, &changed);
    if (unchanged == EBPO_OK)
        return status;
    if (error)
        *error = changed;
    return unchanged;
}

static ebpo_status read_mesh(const char *path, const ebpo_mesh_read_options *options,
                             ebpo_mesh *out, ebpo_mesh_groups **groups, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_mesh_read_options wanted = EBPO_MESH_READ_OPTIONS_INIT;
    ebpo_whole_file file = EBPO_WHOLE_FILE_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_mesh_read_options, &wanted, options, error);
    ebpo_workspace *workspace = wanted.workspace;
    hashing hash = { .file = &file, .workspace = workspace };
    memset(out, 0, sizeof *out);
    if (status == EBPO_OK)
        status = ebpo_whole_file_open(&file, path, error);
    if (status != EBPO_OK)
        return status;
    status = ebpo_whole_file_load(&file, workspace, wanted.threads, &wanted.progress, path, error);
    if (status != EBPO_OK) {
        ebpo_whole_file_close(&file);
        return status;
    }
    hash_begin(&hash);
    status = read_parse(out, &file, path, &wanted, groups, error);
    hash_end(&hash);
    out->workspace = workspace;
    if (status == EBPO_OK && wanted.attributes)
        status =
            ebpo_textures_find(out, path, file.data, file.size, wanted.embed_textures != 0, error);
    if (status == EBPO_OK || status == EBPO_E_FORMAT)
        status = report_change(&file, path, status, error);
    if (status == EBPO_OK)
        memcpy(out->source_sha256, hash.digest, sizeof hash.digest);
    else
        ebpo_mesh_free(out);
    ebpo_whole_file_close(&file);
    return status;
}

ebpo_status ebpo_mesh_read(const char *path, const ebpo_mesh_read_options *options, ebpo_mesh *out,
                           ebpo_error *error)
{
    return read_mesh(path, options, out, NULL, error);
}

ebpo_status ebpo_mesh_read_groups(const char *path, const ebpo_mesh_read_options *options,
                                  ebpo_mesh *out, ebpo_mesh_groups **groups, ebpo_error *error)
{
    *groups = NULL;
    ebpo_status status = read_mesh(path, options, out, groups, error);
    if (status != EBPO_OK) {
        ebpo_mesh_groups_free(*groups);
        *groups = NULL;
    }
    return status;
}
