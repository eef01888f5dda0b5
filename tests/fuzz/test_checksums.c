/* SPDX-License-Identifier: MIT
 * Checks that checksums are compared: a build with -Dfuzzing=true, which does not compare them,
 * must not be used by mistake, and fails here.
 *
 *     test_checksums FILE...    each of a pipeline with checksums */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/checksum.h"
#include "hdf5_read/chunk.h"
#include "format/file_in.h"
#include "read_by.h"

static int wrong;

static void expect(bool refused, const char *what)
{
    if (refused == (EBPO_CHECKSUMS_COMPARED != 0))
        return;
    fprintf(stderr, "%s: damage is %s\n", what, refused ? "refused" : "not noticed");
    wrong = 1;
}

/* The last four bytes of a chunk are its checksum, in all three pipelines that have one. */
static void chunk(ebpo_pipeline pipeline, const char *name)
{
    static ebpo_chunk_coder coder;
    uint8_t raw[4096], stored[8192], again[sizeof raw];
    size_t bytes;
    const char *why;
    for (size_t i = 0; i < sizeof raw; i++)
        raw[i] = (uint8_t)(i * i >> 5);
    if (ebpo_chunk_encode(&coder, pipeline, 0, 4, raw, sizeof raw, stored, &bytes) != EBPO_OK)
        exit(2);
    stored[bytes - 1] ^= 1;
    expect(ebpo_chunk_decode(&coder, pipeline, 4, stored, bytes, again, sizeof again, &why) !=
               EBPO_OK,
           name);
    ebpo_chunk_coder_clear(&coder);
}

static uint8_t *slurp(const char *path, size_t *size)
{
    enum { LIMIT = 1 << 20 };
    uint8_t *data = malloc(LIMIT);
    FILE *f = fopen(path, "rb");
    if (!f || !data)
        exit(2);
    *size = fread(data, 1, LIMIT, f);
    fclose(f);
    return data;
}

static ebpo_status open_and_check(const uint8_t *data, size_t size)
{
    ebpo_file *file;
    ebpo_status status = ebpo_open_memory(data, size, "changed", &file, NULL);
    if (status == EBPO_OK)
        status = ebpo_file_check_content(file, READ_BY(1), NULL);
    ebpo_close(file);
    return status;
}

/* Changes one bit of the digest in the header, with the old checksum of the header: either check
 * detects it. */
static void content(const char *path)
{
    size_t size;
    uint8_t *data = slurp(path, &size);
    if (open_and_check(data, size) != EBPO_OK)
        exit(2);
    uint8_t *name = memmem(data, size, "content_sha256", 14);
    if (!name)
        exit(2);
    for (uint8_t *at = name + 15; at < data + size; at++)
        if (*at >= '0' && *at <= '8') { /* one of 64 hexadecimal digits */
            ++*at;
            break;
        }
    expect(open_and_check(data, size) != EBPO_OK, path);
    free(data);
}

int main(int argc, char **argv)
{
    chunk(EBPO_PIPELINE_ZSTD, "zstd");
    chunk(EBPO_PIPELINE_DEFLATE, "deflate");
    chunk(EBPO_PIPELINE_CHECKSUM, "fletcher32");
    for (int i = 1; i < argc; i++)
        content(argv[i]);
    printf("checksums are %s\n",
           EBPO_CHECKSUMS_COMPARED ? "compared" : "not compared: a fuzzing build");
    return wrong;
}
