/* Makes the files of format-spec/vectors: make_vectors FOLDER. passed/ with files that must be
 * read, failed/ with files that must be refused and the reasons; each failed file is a passed one
 * with a single named change. Run it when the format changes, check the difference, and commit
 * both. */
#include <hdf5.h>
#include <stdio.h>
#include <sys/stat.h>

#include <ebpo/file.h>

#include "change_file.h"
#include "known_leaks.h"
#include "make_parts.h"

int main(int argc, char **argv)
{
    char path[512];
    if (argc != 2)
        die("usage", "make_vectors FOLDER");
    H5Eset_auto2(H5E_DEFAULT, NULL, NULL);
    snprintf(path, sizeof path, "%s/passed", argv[1]);
    mkdir(path, 0777);
    snprintf(path, sizeof path, "%s/failed", argv[1]);
    mkdir(path, 0777);
    if (ebpo_register_filters(NULL) != EBPO_OK)
        die("zstd", "no filter");
    make_passed(argv[1]);
    make_failed(argv[1]);
    return 0;
}
