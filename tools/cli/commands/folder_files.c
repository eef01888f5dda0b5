/* Finds models below a folder. `folder`: where the search starts. `below`: path of a subfolder,
 * relative to `folder`. */
#include "cli/commands/folder_files.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "cli/words.h"

static bool is_model_name(const char *name)
{
    return (words_end_with(name, ".h5") || words_end_with(name, ".hdf5")) &&
           !words_end_with(name, ".paint.h5");
}

/* Adds a path to the list, which owns the path from now on. When out of memory, frees `path` and
 * returns false. `path` is NULL if the caller could not allocate it; this also counts as out of
 * memory. */
static bool add_path(folder_files *f, char *path)
{
    if (path && f->count == f->capacity) {
        size_t capacity = f->capacity ? 2 * f->capacity : 256;
        char **larger = realloc(f->path, capacity * sizeof *larger);
        if (larger) {
            f->path = larger;
            f->capacity = capacity;
        }
    }
    if (!path || f->count == f->capacity) {
        free(path);
        f->no_memory = true;
        return false;
    }
    f->path[f->count++] = path;
    return true;
}

static char *join_path(const char *a, const char *b)
{
    char *text = NULL;
    if (asprintf(&text, *a ? "%s/%s" : "%s%s", a, b) < 0)
        return NULL;
    return text;
}

char *folder_files_shown(const char *path)
{
    char *text = strdup(path);
    for (char *c = text; c && *c; c++)
        if ((unsigned char)*c < 0x20 || *c == 0x7f)
            *c = ' ';
    return text;
}

/* Reports that folder/below/name could not be read; `below` and `name` may be empty. The reason is
 * in errno. Returns false when out of memory. */
static bool report_unread(folder_files *f, const char *folder, const char *below, const char *name)
{
    const char *why = strerror(errno);
    char *within = *name ? join_path(below, name) : strdup(below);
    char *path = !within ? NULL : *within ? join_path(folder, within) : strdup(folder);
    char *shown = path ? folder_files_shown(path) : NULL;
    if (shown)
        fprintf(stderr, "ebpo %s: %s: cannot be read: %s\n", f->command, shown, why);
    f->unread++;
    f->no_memory |= !shown;
    free(within);
    free(path);
    free(shown);
    return !f->no_memory;
}

static bool search_folder(folder_files *f, const char *folder, const char *below);

/* Adds the entry `name` of folder/below if it is a model, or searches it if it is a folder. Does
 * not follow links to folders, which may form cycles. Returns false after an error that ends the
 * search. */
static bool inspect_entry(folder_files *f, DIR *dir, const char *folder, const char *below,
                          const char *name)
{
    struct stat st;
    bool has_stat = fstatat(dirfd(dir), name, &st, AT_SYMLINK_NOFOLLOW) == 0;
    if (!has_stat && errno == ENOENT)
        return true; /* the entry was removed meanwhile */
    bool is_folder = has_stat && S_ISDIR(st.st_mode);
    /* Without `st`, the type of the entry is unknown. If the entry has the name of a model, it is
     * added, and opening the model reports the error. Otherwise it may be a folder that should be
     * searched, and is reported as unread. */
    if (!has_stat && !is_model_name(name))
        return report_unread(f, folder, below, name);
    if (!is_folder && !is_model_name(name))
        return true;
    /* Skips a link to a folder. A link to a missing file is reported when the file is opened. */
    if (!is_folder && fstatat(dirfd(dir), name, &st, 0) == 0 && S_ISDIR(st.st_mode))
        return true;
    char *path = join_path(below, name);
    if (!path || !is_folder)
        return add_path(f, path);
    bool ok = search_folder(f, folder, path);
    free(path);
    return ok;
}

static DIR *open_folder(folder_files *f, const char *folder, const char *below)
{
    char *path = *below ? join_path(folder, below) : strdup(folder);
    DIR *dir = path ? opendir(path) : NULL;
    f->no_memory |= !path;
    if (path && !dir)
        (void)report_unread(f, folder, below, "");
    free(path);
    return dir;
}

static bool search_folder(folder_files *f, const char *folder, const char *below)
{
    DIR *dir = open_folder(f, folder, below);
    if (!dir)
        return !f->no_memory && *below;
    bool ok = true;
    for (const struct dirent *entry; ok && (errno = 0, entry = readdir(dir));)
        if (entry->d_name[0] != '.')
            ok = inspect_entry(f, dir, folder, below, entry->d_name);
    if (ok && errno != 0)
        ok = report_unread(f, folder, below, "");
    closedir(dir);
    return ok;
}

static int compare_bytes(const void *a, const void *b)
{
    return strcmp(*(char *const *)a, *(char *const *)b);
}

bool folder_files_find(folder_files *files, const char *command, const char *folder)
{
    *files = (folder_files){ .command = command };
    bool ok = search_folder(files, folder, "");
    if (files->count)
        qsort(files->path, files->count, sizeof *files->path, compare_bytes);
    return ok;
}

void folder_files_free(folder_files *files)
{
    for (size_t i = 0; i < files->count; i++)
        free(files->path[i]);
    free(files->path);
    *files = (folder_files){ .count = 0 };
}
