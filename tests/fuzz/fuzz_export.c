/* SPDX-License-Identifier: MIT
 * Any bytes as a file that is written again: in formats of other programs, repacked, as a subset.
 * The last byte selects the way. */
#include "fuzz_support.h"

#include <ebpo/export.h>
#include <ebpo/subset.h>
#include <stdio.h>
#include <unistd.h>

#include "known_leaks.h"
#include "read_by.h"

static void export(ebpo_file *file, ebpo_export_format format)
{
    char path[64], second[80];
    ebpo_export_options options = EBPO_EXPORT_OPTIONS_INIT;
    options.last_level = ebpo_file_info(file)->level_count - 1;
    options.threads = 1;
    snprintf(path, sizeof path, "/dev/shm/fuzz_%ld.%s", (long)getpid(),
             ebpo_export_format_name(format));
    (void)!ebpo_export(file, path, format, &options, NULL, NULL);
    (void)!unlink(path);
    if (ebpo_export_second_file(format, path, second, sizeof second) && *second)
        (void)!unlink(second);
}

static void write_again(ebpo_file *file, uint8_t way)
{
    char path[64];
    ebpo_write_options options = EBPO_WRITE_OPTIONS_INIT;
    ebpo_subset_options part = EBPO_SUBSET_OPTIONS_INIT;
    options.codec = (ebpo_codec)(way % 3);
    options.threads = part.threads = 1;
    part.last_level = way % 4;
    snprintf(path, sizeof path, "/dev/shm/fuzz_%ld.ebpo.h5", (long)getpid());
    if (way & 8)
        (void)!ebpo_file_repack(file, path, READ_BY(1), &options, NULL);
    else
        (void)!ebpo_subset(file, path, &part, NULL);
    (void)!unlink(path);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    ebpo_file *file;
    if (ebpo_open_memory(data, size, "fuzzed", &file, NULL) != EBPO_OK)
        return 0;
    if (data[size - 1] & 16)
        write_again(file, data[size - 1]);
    else
        export(file, (ebpo_export_format)(data[size - 1] % 4));
    ebpo_close(file);
    return 0;
}
