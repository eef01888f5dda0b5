#include "h5/driver.h"

#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"
#include "h5/h5.h"

enum {
    HEAD_BYTES = 131072, /* holds all headers */
    /* of what lies behind: indexes of chunks, and metadata of files that h5repack made */
    WINDOW_BYTES = 131072
};

/* What libhdf5 sees of an open file; it begins with libhdf5's own part. */
typedef struct driver_file {
    H5FD_t libhdf5;
    ebpo_h5_driver *driver;
    haddr_t end_of_addresses;
} driver_file;

/* What a file access list carries. */
typedef struct driver_choice {
    ebpo_h5_driver *driver;
} driver_choice;

ebpo_status ebpo_h5_driver_open(ebpo_h5_driver *driver, ebpo_input *input, ebpo_error *error)
{
    uint64_t bytes = input->source.size < HEAD_BYTES ? input->source.size : HEAD_BYTES;
    if (ebpo_input_is_far(input) && input->source.prefetched < bytes)
        bytes = input->source.prefetched;
    *driver = (ebpo_h5_driver){ .input = input,
                                .id = -1,
                                .head = ebpo_alloc(bytes, 1),
                                .head_bytes = bytes,
                                .status = EBPO_OK };
    ebpo_status status = driver->head ? ebpo_input_read(input, 0, bytes, driver->head, error)
                                      : ebpo_fail_memory(error, bytes);
    return status;
}

void ebpo_h5_driver_close(ebpo_h5_driver *driver)
{
    ebpo_h5_close_id(driver->id);
    free(driver->head);
    free(driver->window);
    free(driver->table);
    *driver = (ebpo_h5_driver){ .id = -1 };
}

static bool take(const uint8_t *buffer, uint64_t begin, uint64_t bytes, uint64_t at, uint64_t size,
                 void *data)
{
    if (at < begin || at - begin > bytes || size > bytes - (at - begin))
        return false;
    memcpy(data, buffer + (at - begin), (size_t)size);
    return true;
}

static bool within(ebpo_range r, uint64_t at, uint64_t size)
{
    return at >= r.offset && at - r.offset < r.size && size <= r.size - (at - r.offset);
}

static ebpo_status fetch_table(ebpo_h5_driver *d, uint64_t at, uint64_t size, void *data)
{
    uint8_t *table = d->table ? d->table : ebpo_alloc(d->index.size, 1);
    if (!table)
        return ebpo_fail_memory(&d->error, d->index.size);
    ebpo_status status =
        d->table ? EBPO_OK
                 : ebpo_input_read(d->input, d->index.offset, d->index.size, table, &d->error);
    if (status != EBPO_OK) {
        free(table);
        return status;
    }
    d->table = table;
    memcpy(data, table + (at - d->index.offset), (size_t)size);
    return EBPO_OK;
}

/* Windows begin at multiples of half their size, so that reading to and fro around a place does not
 * move them. They do not reach into the index, which comes as a whole. */
static ebpo_range window_around(const ebpo_h5_driver *d, uint64_t at)
{
    uint64_t begin = at / (WINDOW_BYTES / 2) * (WINDOW_BYTES / 2), end = d->input->source.size;
    if (d->index.size && at < d->index.offset)
        end = d->index.offset;
    return (ebpo_range){ begin, end - begin < WINDOW_BYTES ? end - begin : WINDOW_BYTES };
}

static ebpo_status move_window(ebpo_h5_driver *d, ebpo_range to)
{
    if (!d->window)
        d->window = ebpo_alloc(WINDOW_BYTES, 1);
    if (!d->window)
        return ebpo_fail_memory(&d->error, WINDOW_BYTES);
    d->window_bytes = 0; /* in case that reading fails */
    ebpo_status status = ebpo_input_read(d->input, to.offset, to.size, d->window, &d->error);
    if (status == EBPO_OK) {
        d->window_at = to.offset;
        d->window_bytes = to.size;
    }
    return status;
}

/* [at, at + size) lies within the file. */
static ebpo_status fetch(ebpo_h5_driver *d, uint64_t at, uint64_t size, void *data)
{
    if (take(d->head, 0, d->head_bytes, at, size, data) ||
        take(d->window, d->window_at, d->window_bytes, at, size, data))
        return EBPO_OK;
    if (within(d->index, at, size))
        return fetch_table(d, at, size, data);
    ebpo_range window = window_around(d, at);
    if (!within(window, at, size))
        return ebpo_input_read(d->input, at, size, data, &d->error);
    ebpo_status status = move_window(d, window);
    if (status == EBPO_OK)
        memcpy(data, d->window + (at - window.offset), (size_t)size);
    return status;
}

static H5FD_t *driver_open(const char *name, unsigned flags, hid_t fapl, haddr_t address_max)
{
    (void)name;
    (void)address_max;
    const driver_choice *choice = H5Pget_driver_info(fapl);
    if (!choice || flags & (H5F_ACC_RDWR | H5F_ACC_TRUNC | H5F_ACC_CREAT))
        return NULL;
    driver_file *file = calloc(1, sizeof *file);
    if (!file) {
        choice->driver->status = ebpo_fail_memory(&choice->driver->error, sizeof *file);
        return NULL;
    }
    file->driver = choice->driver;
    return &file->libhdf5;
}

static herr_t driver_close(H5FD_t *file)
{
    free(file);
    return 0;
}

static herr_t driver_query(const H5FD_t *file, unsigned long *flags)
{
    (void)file;
    *flags = 0; /* nothing is written, and what is read is buffered here */
    return 0;
}

static haddr_t driver_get_eoa(const H5FD_t *file, H5FD_mem_t type)
{
    (void)type;
    return ((const driver_file *)file)->end_of_addresses;
}

static herr_t driver_set_eoa(H5FD_t *file, H5FD_mem_t type, haddr_t address)
{
    (void)type;
    ((driver_file *)file)->end_of_addresses = address;
    return 0;
}

static haddr_t driver_get_eof(const H5FD_t *file, H5FD_mem_t type)
{
    (void)type;
    return ((const driver_file *)file)->driver->input->source.size;
}

static herr_t driver_read(H5FD_t *file, H5FD_mem_t type, hid_t dxpl, haddr_t address, size_t size,
                          void *buffer)
{
    (void)dxpl;
    ebpo_h5_driver *d = ((driver_file *)file)->driver;
    if (d->recording && type == H5FD_MEM_DRAW) {
        d->recorded++;
        d->address = address;
        d->bytes = size;
        return 0;
    }
    /* Like libhdf5's own drivers: what lies behind the end reads as zeros. It looks for its
     * signature there. */
    uint64_t end = d->input->source.size, there = address >= end         ? 0
                                                  : end - address < size ? end - address
                                                                         : size;
    memset((uint8_t *)buffer + there, 0, (size_t)(size - there));
    if (there == 0)
        return 0;
    ebpo_status status = d->status == EBPO_OK ? fetch(d, address, there, buffer) : d->status;
    d->status = status;
    return status == EBPO_OK ? 0 : -1;
}

static herr_t driver_write(H5FD_t *file, H5FD_mem_t type, hid_t dxpl, haddr_t address, size_t size,
                           const void *buffer)
{
    (void)file;
    (void)type;
    (void)dxpl;
    (void)address;
    (void)size;
    (void)buffer;
    return -1;
}

static const H5FD_class_t driver_class = {
    .name = "ebpo source",
    .maxaddr = (haddr_t)INT64_MAX,
    .fc_degree = H5F_CLOSE_STRONG,
    .fapl_size = sizeof(driver_choice), /* without functions for it, libhdf5 copies it as bytes */
    .open = driver_open,
    .close = driver_close,
    .query = driver_query,
    .get_eoa = driver_get_eoa,
    .set_eoa = driver_set_eoa,
    .get_eof = driver_get_eof,
    .read = driver_read,
    .write = driver_write,
    .fl_map = H5FD_FLMAP_DICHOTOMY,
};

/* Registered anew for each file: the caller may have closed and reopened libhdf5 since. Held until
 * the file is closed, because libhdf5 calls the driver's `close` through the registration after
 * giving up its own hold on it. */
bool ebpo_h5_driver_use(ebpo_h5_driver *driver, hid_t fapl)
{
    driver_choice choice = { driver };
    driver->id = H5FDregister(&driver_class);
    return driver->id >= 0 && H5Pset_driver(fapl, driver->id, &choice) >= 0;
}
