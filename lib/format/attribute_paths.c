/* The names of the arrays of attributes, and of their codings. */
#include <stdio.h>

#include "format/attribute_paths.h"

const char ebpo_coding_plain[] = "plain", ebpo_coding_columns[] = "columns";

void ebpo_attribute_path(int number, char path[EBPO_PATH_BYTES])
{
    if (number == 0)
        snprintf(path, EBPO_PATH_BYTES, "/attributes/header");
    else
        snprintf(path, EBPO_PATH_BYTES, "/attributes/%03d%s", (number - 1) / 2,
                 number % 2 ? "" : "_items");
}
