#include "report_output.h"

#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "signals.h"

static char being_made[4096]; /* for the signal handler */

static bool said(const char *path, const char *what)
{
    fprintf(stderr, "ebpo report: %s: %s\n", path, what);
    return false;
}

static bool ends_in(const char *name, const char *ending)
{
    size_t length = strlen(name), tail = strlen(ending);
    return length >= tail && strcmp(name + length - tail, ending) == 0;
}

/* report.csv, report.json, report.html, and files that --keep kept. */
static bool is_ours(const char *name)
{
    return strcmp(name, ".") == 0 || strcmp(name, "..") == 0 || strcmp(name, "report.csv") == 0 || strcmp(name, "report.json") == 0 || strcmp(name, "report.html") == 0 ||
           ends_in(name, ".ebpo.h5");
}

static bool place_is_free(const char *place)
{
    struct stat st;
    char text[600];
    bool fine = true;
    if (lstat(place, &st) != 0)
        return errno == ENOENT || said(place, strerror(errno));
    DIR *folder = S_ISDIR(st.st_mode) ? opendir(place) : NULL;
    if (!folder)
        return said(place, "is in the way and no folder; give another one with -o");
    for (struct dirent *entry; fine && (entry = readdir(folder));)
        if (!is_ours(entry->d_name)) {
            snprintf(text, sizeof text, "is a folder with something else than a report in it, '%.255s'; give another one with -o", entry->d_name);
            fine = said(place, text);
        }
    closedir(folder);
    return fine;
}

void output_drop(const char *folder)
{
    char path[8192];
    DIR *d = folder[0] ? opendir(folder) : NULL;
    if (!d)
        return;
    for (struct dirent *entry; (entry = readdir(d));)
        if (strcmp(entry->d_name, ".") != 0 && strcmp(entry->d_name, "..") != 0) {
            snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
            unlink(path);
        }
    closedir(d);
    rmdir(folder);
    being_made[0] = 0;
}

/* In a signal handler: only what may be called there. Names are known beforehand. */
static void abandon(void)
{
    static const char *const names[] = { "report.csv", "report.json", "report.html", "need.ebpo.h5", "inherit.ebpo.h5", "kmedoids.ebpo.h5", "offset.ebpo.h5", "random.ebpo.h5" };
    size_t length = strlen(being_made);
    if (!length)
        return;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        being_made[length] = '/';
        strcpy(being_made + length + 1, names[i]);
        unlink(being_made);
        being_made[length] = 0;
    }
    rmdir(being_made);
}

bool output_begin(const char *place, char *folder, size_t room)
{
    size_t length = strlen(place);
    while (length > 1 && place[length - 1] == '/')
        length--;
    folder[0] = 0;
    if (length + 40 > room || length + 40 > sizeof being_made)
        return said(place, "the name is too long");
    if (!place_is_free(place))
        return false;
    snprintf(folder, room, "%.*s.part-XXXXXX", (int)length, place);
    if (!mkdtemp(folder)) {
        folder[0] = 0;
        return said(place, strerror(errno));
    }
    chmod(folder, 0755);
    memcpy(being_made, folder, strlen(folder) + 1);
    signals_also(abandon);
    return true;
}

bool output_commit(const char *place, const char *folder)
{
    char older[8192], target[4200];
    size_t length = strlen(place);
    while (length > 1 && place[length - 1] == '/')
        length--;
    snprintf(target, sizeof target, "%.*s", (int)length, place);
    snprintf(older, sizeof older, "%s.old", folder);
    bool moved = rename(target, older) == 0;
    if (rename(folder, target) != 0) {
        said(place, strerror(errno));
        if (moved && rename(older, target) != 0)
            fprintf(stderr, "ebpo report: the report that was there is now %s\n", older);
        return false;
    }
    being_made[0] = 0;
    if (moved)
        output_drop(older);
    return true;
}
