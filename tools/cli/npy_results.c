#include "cli/npy_results.h"

#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cli/command.h"

/* PREFIX_SIZE: number of bytes of the signature, the version and the length field. HEADER_SIZE:
 * number of bytes of the whole header. */
enum { PREFIX_SIZE = 10, HEADER_SIZE = 192 };

static void write_header(char head[HEADER_SIZE], const char *dtype, uint64_t count)
{
    memset(head, ' ', HEADER_SIZE);
    memcpy(head, "\x93NUMPY\x01\x00", 8);
    head[8] = (char)(HEADER_SIZE - PREFIX_SIZE);
    head[9] = 0;
    int length =
        snprintf(head + PREFIX_SIZE, HEADER_SIZE - PREFIX_SIZE,
                 "{'descr': %s, 'fortran_order': False, 'shape': (%" PRIu64 ",), }", dtype, count);
    head[PREFIX_SIZE + length] = ' ';
    head[HEADER_SIZE - 1] = '\n';
}

/* Returns true if standard output is a file whose header can be rewritten. */
static bool can_rewrite_header(void)
{
    struct stat st;
    int flags = fcntl(STDOUT_FILENO, F_GETFL);
    return fstat(STDOUT_FILENO, &st) == 0 && S_ISREG(st.st_mode) && flags >= 0 &&
           !(flags & O_APPEND);
}

bool npy_begin(npy_results *npy, points *in)
{
    char head[HEADER_SIZE];
    npy->begin = can_rewrite_header() ? lseek(STDOUT_FILENO, 0, SEEK_CUR) : -1;
    if (npy->begin < 0 && !points_begin(in))
        return false;
    if (npy->begin < 0 && !in->rows_known) {
        fprintf(stderr,
                "ebpo %s: --npy must know the number of results at the beginning, but this input "
                "does not state it; write to a file, or use a .npy, PLY or HDF5 file as input\n",
                npy->command);
        return false;
    }
    write_header(head, npy->dtype, npy->begin < 0 ? in->rows_total : 0);
    return command_write(npy->command, head, HEADER_SIZE);
}

bool npy_end(npy_results *npy)
{
    char head[HEADER_SIZE];
    off_t end = npy->begin < 0 ? -1 : lseek(STDOUT_FILENO, 0, SEEK_CUR);
    if (npy->begin < 0)
        return true;
    write_header(head, npy->dtype, (uint64_t)(end - npy->begin - HEADER_SIZE) / npy->bytes);
    return pwrite(STDOUT_FILENO, head, HEADER_SIZE, npy->begin) == HEADER_SIZE ||
           command_not_written(npy->command);
}
