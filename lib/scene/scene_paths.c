/* Files that a scene names, and which of them a stranger's scene may name. */
#include <stdlib.h>
#include <string.h>

#include <ebpo/http.h>

#include "scene/scene_parts.h"

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

char *scene_folder_of(const char *path)
{
    const char *last = strrchr(path, '/');
    return strndup(path, last ? (size_t)(last - path) + 1 : 0);
}
