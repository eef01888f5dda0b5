/* SPDX-License-Identifier: MIT
 * Malicious files: each is refused with a message, and libhdf5 is not called for it.
 *
 *     test_hostile FOLDER
 *
 * Linked with H5open and the functions that open objects wrapped. Prints the time of the slowest
 * file: processor time, as others may use the machine. */
#include <dirent.h>
#include <hdf5.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <ebpo/file.h>

static int entered;

herr_t __wrap_H5open(void);
hid_t __wrap_H5Fopen(const char *name, unsigned flags, hid_t fapl);
hid_t __wrap_H5Dopen2(hid_t at, const char *name, hid_t dapl);
hid_t __wrap_H5Gopen2(hid_t at, const char *name, hid_t gapl);
htri_t __wrap_H5Aexists(hid_t at, const char *name);

herr_t __wrap_H5open(void)
{
    entered++;
    return -1;
}
hid_t __wrap_H5Fopen(const char *name, unsigned flags, hid_t fapl)
{
    (void)name;
    (void)flags;
    (void)fapl;
    entered++;
    return -1;
}
hid_t __wrap_H5Dopen2(hid_t at, const char *name, hid_t dapl)
{
    (void)at;
    (void)name;
    (void)dapl;
    entered++;
    return -1;
}
hid_t __wrap_H5Gopen2(hid_t at, const char *name, hid_t gapl)
{
    return __wrap_H5Dopen2(at, name, gapl);
}
htri_t __wrap_H5Aexists(hid_t at, const char *name) { return (htri_t)__wrap_H5Dopen2(at, name, 0); }

static double processor_seconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static bool is_refused(const char *path)
{
    ebpo_file *file = NULL;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_status status = ebpo_open(path, &file, &error);
    ebpo_close(file);
    return (status == EBPO_E_FORMAT || status == EBPO_E_UNSUPPORTED) && error.message[0];
}

int main(int argc, char **argv)
{
    struct dirent **names;
    double slowest = 0;
    int wrong = 0, files = 0, n = argc == 2 ? scandir(argv[1], &names, NULL, alphasort) : -1;
    if (n < 0)
        return 2;
    for (int i = 0; i < n; free(names[i++])) {
        char path[4096];
        if (names[i]->d_name[0] == '.')
            continue;
        snprintf(path, sizeof path, "%s/%s", argv[1], names[i]->d_name);
        double began = processor_seconds();
        int before = entered;
        bool refused = is_refused(path);
        double took = processor_seconds() - began;
        slowest = took > slowest ? took : slowest;
        if (!refused || entered != before)
            fprintf(stderr, "%s: %s\n", names[i]->d_name,
                    refused ? "libhdf5 was entered" : "is not refused");
        wrong |= !refused || entered != before;
        files++;
    }
    free(names);
    printf("%d files, each refused in at most %.3f ms; libhdf5 was entered %d times\n", files,
           1000 * slowest, entered);
    return wrong || files < 50;
}
