#include "changed_array.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/endian.h"
#include "hdf5_read/chunk.h"
#include "format/checksum_pages.h"
#include "format/chunk_directory.h"
#include "format/reader.h"

void changeable_load(changeable *c, const char *path)
{
    FILE *f = fopen(path, "rb");
    if (!f || fseek(f, 0, SEEK_END) != 0)
        abort();
    c->size = (uint64_t)ftell(f);
    c->data = malloc(c->size);
    rewind(f);
    if (!c->data || fread(c->data, 1, c->size, f) != c->size || fclose(f) != 0 ||
        ebpo_open(path, &c->file, NULL) != EBPO_OK ||
        ebpo_file_locate(c->file, NULL, NULL) != EBPO_OK ||
        ebpo_chunk_checksums_read(c->file, NULL) != EBPO_OK)
        abort();
}

void changeable_free(changeable *c)
{
    ebpo_close(c->file);
    free(c->data);
}

static const ebpo_array_in *array_of(const changeable *c, ebpo_array_id id)
{
    return ebpo_reader_array(c->file, id, 0);
}

static unsigned columns(const ebpo_array_in *a) { return a->shape.cols ? a->shape.cols : 1; }

uint64_t changeable_count(const changeable *c, ebpo_array_id id)
{
    const ebpo_array_in *a = array_of(c, id);
    return a->present ? a->shape.rows * columns(a) : 0;
}

static uint8_t *item_at(const changeable *c, const ebpo_array_in *a, uint64_t item,
                        const ebpo_chunk_location **chunk)
{
    uint64_t of_chunk = (uint64_t)a->shape.chunk_rows * columns(a);
    *chunk = &a->chunks[item / of_chunk];
    return c->data + (*chunk)->address + item % of_chunk * a->shape.element_size;
}

uint64_t changeable_get(const changeable *c, ebpo_array_id id, uint64_t item)
{
    const ebpo_chunk_location *chunk;
    uint64_t value = 0;
    memcpy(&value, item_at(c, array_of(c, id), item, &chunk), array_of(c, id)->shape.element_size);
    return value;
}

/* Updates the checksum at the end of a chunk. Returns the checksum. */
static uint32_t update_checksum(changeable *c, ebpo_chunk_location chunk)
{
    uint8_t *end = c->data + chunk.address + chunk.bytes - 4;
    ebpo_store32(end, ebpo_fletcher32(c->data + chunk.address, chunk.bytes - 4));
    return ebpo_load32(end);
}

/* Sets the checksum of a chunk in the list of chunk checksums, or in a page of checksums, if the
 * file has a list. */
static void update_list(changeable *c, const ebpo_array_in *a, uint64_t chunk, uint32_t sum)
{
    const ebpo_array_in *list = array_of(c, c->file->checksum_list),
                        *pages = array_of(c, EBPO_A_CHECKSUM_PAGES);
    uint64_t page;
    if (!c->file->has_checksums || ebpo_schema_is_list(a->id))
        return;
    if (pages->present && ebpo_is_paged(&c->file->info, a->id, a->level, &a->shape)) {
        if (ebpo_checksum_pages_prepare(c->file, NULL) != EBPO_OK)
            abort();
        uint32_t row = a->chunks[chunk].checksum_row;
        page = row / pages->shape.chunk_rows;
        ebpo_store32(c->data + pages->chunks[page].address + 4 * (row % pages->shape.chunk_rows),
                     sum);
        sum = update_checksum(c, pages->chunks[page]);
        a = pages;
        chunk = page;
    }
    ebpo_store32(c->data + list->chunks[0].address + 8 * (a->first_checksum + chunk), sum);
    (void)update_checksum(c, list->chunks[0]);
}

uint64_t changeable_put(changeable *c, ebpo_array_id id, uint64_t item, uint64_t value)
{
    const ebpo_array_in *a = array_of(c, id);
    const ebpo_chunk_location *chunk;
    uint8_t *at = item_at(c, a, item, &chunk);
    uint64_t before = changeable_get(c, id, item);
    memcpy(at, &value, a->shape.element_size);
    update_list(c, a, (uint64_t)(chunk - a->chunks), update_checksum(c, *chunk));
    return before;
}
