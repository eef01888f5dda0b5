#include "core/workspace.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/sized.h"
#include "core/machine_memory.h"
#include "core/unnamed_file.h"
#include "core/workspace_parts.h"

static ebpo_status choose_folder(ebpo_workspace *w, const char *wanted, ebpo_error *error)
{
    const char *folder = wanted ? wanted : getenv("TMPDIR");
    if (!folder || !*folder)
        folder = "/var/tmp";
    if (strlen(folder) >= sizeof w->folder)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the name of the folder for temporary files is longer than %zu bytes",
                         sizeof w->folder - 1);
    strcpy(w->folder, folder);
    int fd = ebpo_open_unnamed(folder);
    if (fd < 0)
        return ebpo_fail_file(error, EBPO_E_IO, folder,
                              "cannot hold temporary files: %s; name another folder for them",
                              strerror(errno));
    close(fd);
    return EBPO_OK;
}

ebpo_status ebpo_workspace_new(const ebpo_workspace_options *options, ebpo_workspace **out,
                               ebpo_error *error)
{
    ebpo_workspace_options wanted = EBPO_WORKSPACE_OPTIONS_INIT;
    *out = NULL;
    ebpo_status status = EBPO_TAKE(ebpo_workspace_options, &wanted, options, error);
    if (status != EBPO_OK)
        return status;
    uint64_t memory = wanted.memory ? wanted.memory : ebpo_machine_memory() / 2;
    if (memory < EBPO_WORKSPACE_MIN && wanted.memory)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "%llu bytes of memory are too few; %d MB are the least",
                         (unsigned long long)memory, EBPO_WORKSPACE_MIN / 1000000);
    if (memory < EBPO_WORKSPACE_MIN)
        memory = EBPO_WORKSPACE_MIN;
    return ebpo_workspace_make_any(out, memory, wanted.temp_dir, error);
}

ebpo_status ebpo_workspace_make_any(ebpo_workspace **out, uint64_t memory, const char *temp_dir,
                                    ebpo_error *error)
{
    *out = NULL;
    ebpo_workspace *w = ebpo_alloc_zero(1, sizeof *w);
    if (!w)
        return ebpo_fail_memory(error, sizeof *w);
    pthread_mutex_init(&w->lock, NULL);
    pthread_mutex_init(&w->pool_lock, NULL);
    pthread_mutex_init(&w->table_lock, NULL);
    w->figures.memory = memory;
    w->holders = 1;
    w->page = (size_t)sysconf(_SC_PAGESIZE);
    w->statm = open("/proc/self/statm", O_RDONLY | O_CLOEXEC);
    ebpo_status status = choose_folder(w, temp_dir, error);
    if (status != EBPO_OK)
        ebpo_workspace_free(w);
    else
        *out = w;
    return status;
}

void ebpo_workspace_leave(ebpo_workspace *w)
{
    pthread_mutex_lock(&w->lock);
    bool last = --w->holders == 0;
    pthread_mutex_unlock(&w->lock);
    if (!last)
        return;
    if (w->statm >= 0)
        close(w->statm);
    pthread_mutex_destroy(&w->lock);
    pthread_mutex_destroy(&w->pool_lock);
    pthread_mutex_destroy(&w->table_lock);
    free(w);
}

void ebpo_workspace_free(ebpo_workspace *workspace)
{
    if (workspace)
        ebpo_workspace_leave(workspace);
}

ebpo_status ebpo_workspace_get_stats(const ebpo_workspace *workspace, ebpo_workspace_stats *out)
{
    ebpo_workspace *w = (ebpo_workspace *)workspace;
    pthread_mutex_lock(&w->lock);
    ebpo_workspace_stats figures = w->figures;
    pthread_mutex_unlock(&w->lock);
    return EBPO_GIVE(ebpo_workspace_stats, out, &figures);
}

ebpo_status ebpo_workspace_fail(const ebpo_workspace *workspace, uint64_t bytes, ebpo_error *error)
{
    int fault = workspace ? workspace->failed : 0;
    if (!fault)
        return ebpo_fail_memory(error, bytes);
    return ebpo_fail_file(error, EBPO_E_IO, workspace->folder,
                          "cannot hold %llu bytes of temporary files: %s; name another folder, or "
                          "allow more memory",
                          (unsigned long long)bytes, strerror(fault));
}

ebpo_status ebpo_workspace_fail_while(const ebpo_workspace *workspace, const char *what,
                                      ebpo_error *error)
{
    int fault = workspace ? workspace->failed : 0;
    if (!fault)
        return ebpo_fail(error, EBPO_E_MEMORY, "out of memory %s", what);
    return ebpo_fail_file(
        error, EBPO_E_IO, workspace->folder,
        "cannot hold the temporary files %s: %s; name another folder, or allow more memory", what,
        strerror(fault));
}
