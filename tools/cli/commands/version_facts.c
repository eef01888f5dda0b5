#include "cli/commands/version_facts.h"

#include <dlfcn.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "cli/command.h"
#include "cli/words.h"
#include "ebpo_config.h"

/* Paths of installed files. */
typedef struct installation {
    char program[PATH_MAX];
    char library[PATH_MAX];           /* the running library; "": not known */
    char installed_library[PATH_MAX]; /* the library installed with the program; "": none */
    char plugin[PATH_MAX];            /* folder of the HDF5 plugin; "": none */
} installation;

/* Sets `out` to the path of an installed file, or to "" if the file does not exist. path: relative
 * to the program's folder, or absolute. */
static void locate_file(const char *program, const char *path, const char *name, char out[PATH_MAX])
{
    char joined[3 * PATH_MAX];
    int folder = path[0] == '/' ? 0 : (int)(strrchr(program, '/') - program + 1);
    snprintf(joined, sizeof joined, "%.*s%s%s", folder, program, path, name);
    if (!realpath(joined, out))
        out[0] = 0;
}

static void inspect_installation(installation *i)
{
    Dl_info library;
    if (!realpath("/proc/self/exe", i->program))
        snprintf(i->program, sizeof i->program, "/");
    void *function = dlsym(RTLD_DEFAULT, "ebpo_version");
    bool known = function && dladdr(function, &library) && library.dli_fname;
    if (!known || !realpath(library.dli_fname, i->library))
        i->library[0] = 0;
    locate_file(i->program, EBPO_LIBRARY_FROM_BIN, "", i->installed_library);
    i->plugin[0] = 0;
    if (*EBPO_PLUGIN_FROM_BIN)
        locate_file(i->program, EBPO_PLUGIN_FROM_BIN, "/libebpo_h5zstd.so", i->plugin);
    if (i->plugin[0])
        *strrchr(i->plugin, '/') = 0;
}

static void print_installation(const installation *i)
{
    printf("program: %s\nlibrary: %s (%s)\nHDF5 plugin: %s\n", i->program,
           i->library[0] ? i->library : "unknown", ebpo_version(),
           i->plugin[0] ? i->plugin : "none was installed with this program");
    printf("built with:%s%s%s%s%s%s\n", EBPO_HAVE_ASSIMP ? " assimp" : "",
           EBPO_HAVE_HTTP ? " libcurl" : "", EBPO_HAVE_PNG ? " libpng" : "",
           EBPO_HAVE_CAIRO ? " cairo" : "", EBPO_HAVE_CHART_JS ? " Chart.js" : "",
           EBPO_HAVE_QHULL ? " qhull" : "");
}

/* Warns if the running library is not the library installed with the program, or has another
 * version. Returns an exit code. */
static int warn_of_other_library(const installation *i)
{
    bool other = i->installed_library[0] && i->library[0] &&
                 !command_same_file(i->installed_library, i->library);
    if (other)
        fprintf(stderr,
                "ebpo: the running library is not the library installed with this program, %s; the "
                "loader found %s first: remove it, or remove its folder from LD_LIBRARY_PATH\n",
                i->installed_library, i->library);
    bool differs = ebpo_version_number() != EBPO_VERSION_NUMBER;
    if (differs)
        fprintf(stderr, "ebpo: this program was made for version %d.%d.%d of the library, not %s\n",
                EBPO_VERSION_MAJOR, EBPO_VERSION_MINOR, EBPO_VERSION_PATCH, ebpo_version());
    return other || differs ? EXIT_FAILED : EXIT_OK;
}

int version_report(const char *argument)
{
    char format[32];
    bool verbose = argument && strcmp(argument, "--verbose") == 0;
    if (argument && !verbose) {
        fprintf(stderr, "ebpo: after --version, only --verbose is allowed, not '%s'\n", argument);
        return EXIT_USAGE;
    }
    installation i;
    inspect_installation(&i);
    printf("ebpo %s, format %s\n", ebpo_version(),
           words_format(format, sizeof format, EBPO_FORMAT_MAJOR, EBPO_FORMAT_MINOR));
    if (verbose)
        print_installation(&i);
    return warn_of_other_library(&i);
}
