/* Provides the virtual file driver (sink) through which libhdf5 writes to a file or to memory.
 *
 * libhdf5 1.10 does not survive a failed write. After such a failure, it keeps unflushed data and
 * an id whose file is already released, and it fails when it uses this id at exit. So the driver
 * stores the first failure, and reports every write to libhdf5 as successful. In this way libhdf5
 * always closes the file normally. ebpo_h5_sink_status and ebpo_h5_sink_close return the stored
 * failure. */
#include "hdf5_write/h5_parts.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/alloc.h"
#include "core/error.h"

/* Maximum number of bytes for one call of pread or pwrite. Some systems transfer at most about 2
 * GiB. */
static const size_t CALL_BYTES_MAX = (size_t)1 << 30;

/* The driver's struct for an open file. libhdf5 uses only the first member. */
typedef struct sink_file {
    H5FD_t libhdf5;
    ebpo_h5_sink *sink;
    haddr_t end_of_addresses;
} sink_file;

/* The driver's data in a file access property list: the sink of the file. */
typedef struct sink_settings {
    ebpo_h5_sink *sink;
} sink_settings;

void ebpo_h5_sink_fail(ebpo_h5_sink *sink, const ebpo_error *error)
{
    if (sink->status != EBPO_OK)
        return;
    sink->error = *error;
    sink->status = error->status;
}

ebpo_status ebpo_h5_sink_status(const ebpo_h5_sink *sink, ebpo_error *error)
{
    return sink->status == EBPO_OK ? EBPO_OK : ebpo_fail_with(error, &sink->error);
}

/* Stores a failure with the system's reason (errno). Does nothing if an earlier failure is stored.
 */
static void fail_errno(ebpo_h5_sink *sink, const char *what)
{
    ebpo_error error = EBPO_ERROR_INIT;
    (void)ebpo_fail_errno(&error, sink->shown, what);
    ebpo_h5_sink_fail(sink, &error);
}

ebpo_status ebpo_h5_sink_open(ebpo_h5_sink **out, const char *path, const char *shown,
                              ebpo_error *error)
{
    size_t size = sizeof **out + strlen(shown) + 1;
    ebpo_h5_sink *sink = ebpo_alloc_zero(1, size);
    *out = NULL;
    if (!sink)
        return ebpo_fail_memory(error, size);
    sink->id = -1;
    sink->fd = -1;
    strcpy(sink->shown, shown);
    if (path) {
        sink->fd = open(path, O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0666);
        if (sink->fd < 0) {
            ebpo_status status = ebpo_fail_errno(error, shown, "cannot be opened for writing");
            free(sink);
            return status;
        }
    }
    *out = sink;
    return EBPO_OK;
}

/* Closes the file, or frees the memory. */
static void release_sink(ebpo_h5_sink *sink)
{
    if (sink->fd >= 0 && close(sink->fd) != 0)
        fail_errno(sink, "could not be written");
    sink->fd = -1;
    free(sink->memory);
    sink->memory = NULL;
    sink->capacity = sink->size = 0;
}

ebpo_status ebpo_h5_sink_close(ebpo_h5_sink *sink, ebpo_error *error)
{
    release_sink(sink);
    ebpo_status status = ebpo_h5_sink_status(sink, error);
    if (sink->id >= 0)
        H5Idec_ref(sink->id);
    free(sink);
    return status;
}

void ebpo_h5_sink_abandon(ebpo_h5_sink *sink)
{
    release_sink(sink);
    if (sink->status == EBPO_OK)
        sink->status = EBPO_E_MEMORY; /* any error makes later writes of libhdf5 do nothing */
}

static H5FD_t *sink_open(const char *name, unsigned flags, hid_t fapl, haddr_t address_max)
{
    (void)name;
    (void)address_max;
    /* Ignores the flags (create, truncate). A new sink is empty anyway, and when libhdf5 opens a
     * sink again, the sink must keep its bytes. */
    (void)flags;
    const sink_settings *settings = H5Pget_driver_info(fapl);
    if (!settings)
        return NULL;
    sink_file *file = calloc(1, sizeof *file);
    if (!file) {
        errno = ENOMEM;
        fail_errno(settings->sink, "could not be opened for writing");
        return NULL;
    }
    file->sink = settings->sink;
    return &file->libhdf5;
}

static herr_t sink_close(H5FD_t *file)
{
    free(file);
    return 0;
}

/* Sets the flags that libhdf5's default driver sets, because the offsets of metadata depend on
 * these flags. */
static herr_t sink_query(const H5FD_t *file, unsigned long *flags)
{
    (void)file;
    *flags = H5FD_FEAT_AGGREGATE_METADATA | H5FD_FEAT_ACCUMULATE_METADATA | H5FD_FEAT_DATA_SIEVE |
             H5FD_FEAT_AGGREGATE_SMALLDATA;
    return 0;
}

static haddr_t sink_get_eoa(const H5FD_t *file, H5FD_mem_t type)
{
    (void)type;
    return ((const sink_file *)file)->end_of_addresses;
}

static herr_t sink_set_eoa(H5FD_t *file, H5FD_mem_t type, haddr_t address)
{
    (void)type;
    ((sink_file *)file)->end_of_addresses = address;
    return 0;
}

static haddr_t sink_get_eof(const H5FD_t *file, H5FD_mem_t type)
{
    (void)type;
    return ((const sink_file *)file)->sink->size;
}

/* Reads bytes of the file. Returns the number of bytes read, which is less than `size` at the end
 * of the file or on failure. */
static size_t read_file(ebpo_h5_sink *sink, uint64_t at, size_t size, uint8_t *to)
{
    size_t done = 0;
    while (done < size) {
        size_t call_bytes = size - done < CALL_BYTES_MAX ? size - done : CALL_BYTES_MAX;
        ssize_t received = pread(sink->fd, to + done, call_bytes, (off_t)(at + done));
        if (received < 0 && errno == EINTR)
            continue;
        if (received < 0)
            fail_errno(sink, "cannot be read back");
        if (received <= 0)
            break;
        done += (size_t)received;
    }
    return done;
}

static herr_t sink_read(H5FD_t *file, H5FD_mem_t type, hid_t dxpl, haddr_t address, size_t size,
                        void *buffer)
{
    (void)type;
    (void)dxpl;
    ebpo_h5_sink *sink = ((sink_file *)file)->sink;
    size_t available = 0;
    /* number of requested bytes before the end of the file; the bytes beyond the end are zeros */
    if (sink->fd >= 0)
        available = read_file(sink, address, size, buffer);
    else if (address < sink->size)
        available = sink->size - address < size ? (size_t)(sink->size - address) : size;
    if (sink->fd < 0 && available)
        memcpy(buffer, sink->memory + address, available);
    memset((uint8_t *)buffer + available, 0, size - available);
    return 0;
}

static void write_file(ebpo_h5_sink *sink, uint64_t at, size_t size, const uint8_t *data)
{
    size_t done = 0;
    while (done < size) {
        size_t call_bytes = size - done < CALL_BYTES_MAX ? size - done : CALL_BYTES_MAX;
        ssize_t written = pwrite(sink->fd, data + done, call_bytes, (off_t)(at + done));
        if (written < 0 && errno == EINTR)
            continue;
        if (written == 0)
            errno = EIO;
        if (written <= 0) {
            fail_errno(sink, "could not be written");
            return;
        }
        done += (size_t)written;
    }
}

static void write_memory(ebpo_h5_sink *sink, uint64_t at, size_t size, const uint8_t *data)
{
    uint64_t need = at + size, least = UINT64_C(1) << 20;
    if (need > sink->capacity) {
        uint64_t capacity = need < least / 2 ? least : 2 * need;
        uint8_t *bigger = capacity <= SIZE_MAX ? realloc(sink->memory, (size_t)capacity) : NULL;
        if (!bigger) {
            errno = ENOMEM;
            fail_errno(sink, "could not be written to memory");
            return;
        }
        memset(bigger + sink->capacity, 0, (size_t)(capacity - sink->capacity));
        sink->memory = bigger;
        sink->capacity = capacity;
    }
    memcpy(sink->memory + at, data, size);
}

static herr_t sink_write(H5FD_t *file, H5FD_mem_t type, hid_t dxpl, haddr_t address, size_t size,
                         const void *buffer)
{
    (void)type;
    (void)dxpl;
    ebpo_h5_sink *sink = ((sink_file *)file)->sink;
    if (sink->status == EBPO_OK && sink->fd >= 0)
        write_file(sink, address, size, buffer);
    else if (sink->status == EBPO_OK)
        write_memory(sink, address, size, buffer);
    if (address + size > sink->size)
        sink->size = address + size;
    return 0;
}

/* Sets the size of the file to the end of the addresses that libhdf5 has allocated. */
static herr_t sink_truncate(H5FD_t *file, hid_t dxpl, hbool_t closing)
{
    (void)dxpl;
    (void)closing;
    ebpo_h5_sink *sink = ((sink_file *)file)->sink;
    haddr_t end = ((sink_file *)file)->end_of_addresses;
    if (end == sink->size)
        return 0;
    if (sink->status == EBPO_OK && sink->fd >= 0 && ftruncate(sink->fd, (off_t)end) != 0)
        fail_errno(sink, "could not be written");
    sink->size = end;
    return 0;
}

static const H5FD_class_t sink_class = {
#ifdef H5FD_CLASS_VERSION
    .version = H5FD_CLASS_VERSION,
    .value = (H5FD_class_value_t)400, /* from the range for private use */
#endif
    .name = "ebpo sink",
    .maxaddr = (haddr_t)INT64_MAX,
    .fc_degree = H5F_CLOSE_STRONG,
    /* libhdf5 copies sink_settings byte by byte, because this class defines no copy function */
    .fapl_size = sizeof(sink_settings),
    .open = sink_open,
    .close = sink_close,
    .query = sink_query,
    .get_eoa = sink_get_eoa,
    .set_eoa = sink_set_eoa,
    .get_eof = sink_get_eof,
    .read = sink_read,
    .write = sink_write,
    .truncate = sink_truncate,
    .fl_map = H5FD_FLMAP_DICHOTOMY,
};

/* Registers the driver for each file, because the caller may have closed libhdf5 (H5close) since
 * the previous file. sink->id keeps the driver registered until ebpo_h5_sink_close, because libhdf5
 * releases its own reference to the driver before it calls the driver's function `close`. */
bool ebpo_h5_sink_use(ebpo_h5_sink *sink, hid_t fapl)
{
    sink_settings settings = { sink };
    if (sink->id < 0)
        sink->id = H5FDregister(&sink_class);
    return sink->id >= 0 && H5Pset_driver(fapl, sink->id, &settings) >= 0;
}
