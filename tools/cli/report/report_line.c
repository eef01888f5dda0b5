/* Counts the bytes and round trips that reading a level over a network needs, with a simulated
 * remote source. The page computes the times for networks with certain rates and delays. */
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cli/report/report_data.h"

/* HEAD_BYTES: number of bytes that are fetched when a file is opened. BLOCK_BYTES: number of bytes
 * of each later block. Both are as in the library for URLs. */
enum { HEAD_BYTES = 128 << 10, BLOCK_BYTES = 4096 };

/* A simulated network connection. Only one thread reads, so there is no lock. */
typedef struct simulated_line {
    int file;       /* descriptor of the local file */
    uint64_t size;  /* bytes of the file */
    uint64_t bytes; /* number of bytes sent so far */
    uint64_t trips; /* number of completed round trips */
    /* [number of blocks] number of the round trip that brings the block, from 1; 0: not requested
     */
    uint32_t *arrival_trip;
} simulated_line;

/* Requests the missing blocks of a range; they arrive with the next round trip. Returns the number
 * of the round trip with which the last block of the range arrives. */
static uint64_t request_blocks(simulated_line *l, uint64_t offset, uint64_t size)
{
    uint64_t last = 0;
    for (uint64_t i = offset / BLOCK_BYTES; size && i <= (offset + size - 1) / BLOCK_BYTES; i++) {
        if (!l->arrival_trip[i]) {
            l->arrival_trip[i] = (uint32_t)l->trips + 1;
            l->bytes += (i + 1) * BLOCK_BYTES < l->size ? BLOCK_BYTES : l->size - i * BLOCK_BYTES;
        }
        last = l->arrival_trip[i] > last ? l->arrival_trip[i] : last;
    }
    return last;
}

static ebpo_status read_range(void *user, uint64_t offset, uint64_t size, void *data,
                              ebpo_error *error)
{
    simulated_line *l = user;
    uint64_t arrival = request_blocks(l, offset, size), done = 0;
    l->trips = arrival > l->trips ? arrival : l->trips;
    while (done < size) {
        ssize_t read_bytes =
            pread(l->file, (char *)data + done, size - done, (off_t)(offset + done));
        if (read_bytes <= 0) {
            snprintf(error->message, sizeof error->message, "the file cannot be read");
            return error->status = EBPO_E_IO;
        }
        done += (uint64_t)read_bytes;
    }
    return EBPO_OK;
}

/* Requests all blocks of ranges that will be read. The blocks come with one round trip. */
static void prefetch_ranges(void *user, const ebpo_range *ranges, size_t count)
{
    for (size_t i = 0; i < count; i++)
        (void)request_blocks(user, ranges[i].offset, ranges[i].size);
}

/* Opens the file over the simulated connection and reads levels 0 to `level`. Sets l->bytes and
 * l->trips to the bytes and round trips that this takes. */
static ebpo_status load_level(simulated_line *l, const char *path, int level, ebpo_error *error)
{
    ebpo_stream_options stream_options = EBPO_STREAM_OPTIONS_INIT;
    ebpo_source source = EBPO_SOURCE_INIT;
    ebpo_stream_level reported;
    ebpo_stream *stream = NULL;
    ebpo_file *file = NULL;
    bool has_more = true;
    stream_options.threads = 1;
    source.user = l;
    source.size = l->size;
    source.read = read_range;
    source.prefetch = prefetch_ranges;
    source.prefetched = l->size < HEAD_BYTES ? l->size : HEAD_BYTES;
    l->trips = l->bytes = 0;
    memset(l->arrival_trip, 0, (l->size / BLOCK_BYTES + 1) * sizeof *l->arrival_trip);
    l->trips = request_blocks(l, 0, source.prefetched);
    ebpo_status status = ebpo_open_source(&source, path, &file, error);
    if (status == EBPO_OK) {
        ebpo_file_prefetch_levels(file, 0, level);
        status = ebpo_stream_new(file, &stream_options, &stream, error);
    }
    for (int i = 0; i <= level && status == EBPO_OK; i++)
        status = ebpo_stream_next_level(stream, &reported, &has_more, error);
    ebpo_stream_free(stream);
    ebpo_close(file);
    return status;
}

ebpo_status report_lines(comparison *c, method *m, ebpo_error *error)
{
    struct stat st;
    simulated_line l = { .file = -1 };
    ebpo_status status = EBPO_OK;
    if (ebpo_is_url(m->path)) {
        method_note(m, "network connections", "the file is remote; compare files on the disk");
        return EBPO_OK;
    }
    l.file = open(m->path, O_RDONLY | O_CLOEXEC);
    if (l.file < 0 || fstat(l.file, &st) != 0) {
        snprintf(error->message, sizeof error->message, "%.200s: cannot be read", m->path);
        status = error->status = EBPO_E_IO;
    } else {
        l.size = (uint64_t)st.st_size;
        l.arrival_trip = malloc((l.size / BLOCK_BYTES + 1) * sizeof *l.arrival_trip);
        if (!l.arrival_trip) {
            snprintf(error->message, sizeof error->message,
                     "not enough memory for simulated connections");
            status = error->status = EBPO_E_MEMORY;
        }
    }
    for (int i = c->first; i <= method_last(c, m) && status == EBPO_OK; i++) {
        status = load_level(&l, m->path, i, error);
        m->level[i][METRIC_LINE_BYTES] = (double)l.bytes;
        m->level[i][METRIC_LINE_TRIPS] = (double)l.trips;
    }
    free(l.arrival_trip);
    if (l.file >= 0)
        close(l.file);
    return status;
}
