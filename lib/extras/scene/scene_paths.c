/* Files that a scene names, and which of them a stranger's scene may name. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/http.h>

#include "core/error.h"
#include "extras/scene/scene_parts.h"

static bool goes_up(const char *path)
{
    for (const char *part = path; part; part = strchr(part, '/')) {
        part += *part == '/';
        if (strncmp(part, "..", 2) == 0 && (part[2] == '/' || part[2] == 0))
            return true;
    }
    return false;
}

const char *scene_path_refused(const char *path, const ebpo_scene_options *options, bool has_digest)
{
    if (!*path)
        return "is no path";
    if (ebpo_is_url(path) && !options->remote)
        return "is on a server, which has to be allowed (ebpo scene --remote)";
    if (ebpo_is_url(path) && !has_digest)
        return "is on a server, and needs its content_sha256 here";
    if (!ebpo_is_url(path) && !options->outside && (*path == '/' || goes_up(path)))
        return "is outside the scene's folder, which has to be allowed (ebpo scene --outside)";
    return NULL;
}

char *scene_join_path(const char *folder, const char *path)
{
    bool alone = *path == '/' || ebpo_is_url(path);
    size_t begin = alone ? 0 : strlen(folder), size = strlen(path);
    char *joined = malloc(begin + size + 1);
    if (joined) {
        memcpy(joined, folder, begin);
        memcpy(joined + begin, path, size + 1);
    }
    return joined;
}

static bool is_below(const char *folder, const char *path)
{
    size_t size = strlen(folder);
    size -= size && folder[size - 1] == '/'; /* the root only */
    return strncmp(folder, path, size) == 0 && path[size] == '/';
}

/* Names of files without links. */
static ebpo_status check_real(const char *folder, const char *real, const char *path,
                              ebpo_error *error)
{
    if (is_below(folder, real))
        return EBPO_OK;
    return ebpo_fail_file(error, EBPO_E_FORMAT, path,
                          "is by a link the file %.160s, outside the scene's folder %.160s, which "
                          "has to be allowed (ebpo scene --outside)",
                          real, folder);
}

ebpo_status scene_stays_within(const char *folder, const char *path, ebpo_error *error)
{
    if (ebpo_is_url(path))
        return EBPO_OK;
    char *top = realpath(*folder ? folder : ".", NULL), *real = realpath(path, NULL);
    ebpo_status status = EBPO_OK;
    if (top && real)
        status = check_real(top, real, path, error);
    else if (errno == ENOMEM)
        status = ebpo_fail_memory(error, strlen(path));
    else
        status = ebpo_fail_errno(error, path, "cannot be opened");
    free(top);
    free(real);
    return status;
}

char *scene_folder_of(const char *path)
{
    const char *last = strrchr(path, '/');
    return strndup(path, last ? (size_t)(last - path) + 1 : 0);
}
