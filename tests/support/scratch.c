#include "scratch.h"

#include <dirent.h>
#include <ftw.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static void die(const char *what)
{
    perror(what);
    abort();
}

void scratch_make(char folder[SCRATCH_LENGTH])
{
    const char *below = getenv("TMPDIR");
    int length = snprintf(folder, SCRATCH_LENGTH, "%s/ebpo-test-XXXXXX", below ? below : "/tmp");
    if (length >= SCRATCH_LENGTH || !mkdtemp(folder))
        die(folder);
}

/* Adds permissions: tests remove them, and nftw cannot enter such folders. */
static int open_folder(const char *path, const struct stat *st, int type, struct FTW *at)
{
    (void)st, (void)at;
    return type == FTW_DNR ? chmod(path, 0700) : 0;
}

static int remove_one(const char *path, const struct stat *st, int type, struct FTW *at)
{
    (void)st, (void)type;
    if (at->level)
        remove(path);
    return 0;
}

static void empty(const char *folder)
{
    enum { OPEN_FILES = 16 };
    chmod(folder, 0700);
    nftw(folder, open_folder, OPEN_FILES, FTW_PHYS);
    nftw(folder, remove_one, OPEN_FILES, FTW_PHYS | FTW_DEPTH);
}

void scratch_remove(const char *folder)
{
    if (!*folder)
        return;
    empty(folder);
    if (rmdir(folder) != 0)
        die(folder);
}

/* ---- folder of the program ---- */

static char own[SCRATCH_LENGTH];

void scratch_enter(void)
{
    if (own[0])
        empty(own);
    else
        scratch_make(own);
}

void scratch_leave(void)
{
    if (own[0])
        empty(own);
}

void scratch_end(void)
{
    scratch_remove(own);
    own[0] = 0;
}

int scratch_entries(void)
{
    int count = 0;
    DIR *d = opendir(scratch(NULL));
    if (!d)
        die(own);
    while (readdir(d))
        count++;
    closedir(d);
    return count - 2; /* . and .. */
}

const char *scratch(const char *name)
{
    enum { NAMES = 32 };
    static char paths[NAMES][2 * SCRATCH_LENGTH];
    if (!own[0])
        scratch_make(own);
    if (!name)
        return own;
    for (int i = 0; i < NAMES; i++) {
        size_t length = strlen(own);
        if (!paths[i][0])
            snprintf(paths[i], sizeof paths[i], "%s/%s", own, name);
        if (strcmp(paths[i] + length + 1, name) == 0)
            return paths[i];
    }
    fprintf(stderr, "more than %d names in the scratch folder\n", NAMES);
    abort();
}
