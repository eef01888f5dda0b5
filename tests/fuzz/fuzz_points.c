/* SPDX-License-Identifier: MIT
 * Any bytes as points, rays or boxes on standard input: text, a PLY, a NumPy array, raw doubles.
 *
 * Input: a byte of flags, then the points. */
#include "fuzz_support.h"
#include "fuzz_quiet.h"

#include <math.h>
#include <sys/mman.h>
#include <unistd.h>

#include "cli/points.h"

static int input = -1;

static void put(const uint8_t *data, size_t size)
{
    if (input < 0) {
        input = memfd_create("points", 0);
        fuzz_must(input >= 0 && dup2(input, STDIN_FILENO) == STDIN_FILENO);
    }
    fuzz_must(ftruncate(input, 0) == 0 && pwrite(input, data, size, 0) == (ssize_t)size &&
              lseek(input, 0, SEEK_SET) == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static double rows[POINTS_BATCH * POINTS_WIDEST];
    points p;
    uint64_t total = 0, count;
    fuzz_quiet();
    if (size < 1)
        return 0;
    put(data + 1, size - 1);
    points_kind kind = (points_kind)(data[0] % 3);
    if (points_open(&p, "fuzz", NULL, kind, data[0] & 4, INFINITY)) {
        p.header = data[0] & 8;
        p.no_header = data[0] & 16;
        while ((count = points_next(&p, rows)) > 0) {
            fuzz_must(count <= POINTS_BATCH);
            for (uint64_t i = 0; i < count * (uint64_t)points_width(kind); i++)
                total += rows[i] < 0; /* reads all of them */
        }
    }
    fuzz_must(total <= size);
    points_close(&p);
    return 0;
}
