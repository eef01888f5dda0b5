/* Binary STL files: a head of 80 bytes, a count, facets of 50 bytes. The last two bytes of a facet
 * are, by the format, the number of bytes that follow it; most programs keep a colour there. */
#include "core/strict_fp.h"

#include "mesh/stl_binary.h"

#include <inttypes.h>
#include <string.h>

#include "mesh/attributes.h"
#include "core/workspace.h"
#include "core/endian.h"
#include "core/error.h"
#include "io/file_source.h"

enum { COUNT = 80, HEAD = 84, RECORD = 50, WORD = 48 };

/* What the bytes of a file are. */
typedef struct stl_bytes {
    uint64_t models;  /* one behind the other */
    uint64_t payload; /* bytes that follow facets, as their last two bytes state */
    uint64_t behind;  /* bytes behind the last facet */
} stl_bytes;

static uint64_t stated_faces(const uint8_t *head) { return ebpo_load32(head + COUNT); }

static uint64_t stated_size(const uint8_t *head) { return HEAD + RECORD * stated_faces(head); }

/* Counts the models that take all bytes, one behind the other; 0: there are other bytes. */
static uint64_t count_models(const uint8_t *data, uint64_t size)
{
    uint64_t models = 0, bytes;
    for (uint64_t at = 0; at < size; at += bytes, models++) {
        bytes = size - at < HEAD ? UINT64_MAX : stated_size(data + at);
        if (bytes > size - at || (bytes == HEAD && size > HEAD))
            return 0;
    }
    return models;
}

/* Returns where the last facet ends if bytes follow each as its last two state; UINT64_MAX: beyond
 * the file. */
static uint64_t end_with_payload(ebpo_workspace *workspace, const uint8_t *data, uint64_t size)
{
    uint64_t at = HEAD;
    EBPO_FOR_ITEMS(workspace, i, 0, stated_faces(data)) {
        uint64_t next =
            size - at < RECORD ? UINT64_MAX : at + RECORD + ebpo_load16(data + at + WORD);
        if (next > size)
            return UINT64_MAX;
        at = next;
    }
    return at;
}

bool ebpo_stl_states_size(const uint8_t *data, uint64_t known, uint64_t size)
{
    return known >= HEAD && size > HEAD && stated_size(data) == size;
}

bool ebpo_stl_fits_binary(const uint8_t *data, uint64_t size)
{
    return size >= HEAD && (count_models(data, size) ||
                            (stated_size(data) < size &&
                             end_with_payload(NULL, data, size) == size && stated_faces(data)));
}

static ebpo_status fail_ambiguous(const import_build *b, const uint8_t *data, uint64_t size)
{
    return ebpo_fail_file(b->error, EBPO_E_FORMAT, b->name,
                          "states %" PRIu64 " faces, which take %" PRIu64 " of its %" PRIu64
                          " bytes, and the others may belong to faces (their attribute byte "
                          "counts) or follow them; save it as STL without attributes, or as PLY",
                          stated_faces(data), stated_size(data), size);
}

/* Finds out what the bytes behind the stated facets are; EBPO_E_FORMAT where that is not certain.
 */
static ebpo_status explain(const import_build *b, const uint8_t *data, uint64_t size, stl_bytes *is)
{
    uint64_t end = stated_size(data), held = (size - HEAD) / RECORD;
    *is = (stl_bytes){ .models = 1 };
    if (end == size)
        return EBPO_OK;
    uint64_t models = count_models(data, size),
             last = end_with_payload(b->mesh->workspace, data, size);
    bool payload = last == size && last > end;
    if (models && payload)
        return fail_ambiguous(b, data, size);
    if (models || payload) {
        is->models = models ? models : 1;
        is->payload = payload ? size - end : 0;
        return EBPO_OK;
    }
    if (held && (!stated_faces(data) || (size - HEAD) % RECORD == 0))
        return ebpo_fail_file(b->error, EBPO_E_FORMAT, b->name,
                              "states %" PRIu64 " faces, but its %" PRIu64 " bytes hold %" PRIu64
                              "; correct the count (bytes 80 to 83), or get the file again",
                              stated_faces(data), size, held);
    if (last > end && last < size)
        return fail_ambiguous(b, data, size);
    is->behind = size - end;
    return EBPO_OK;
}

static ebpo_status read_facets(import_build *b, const uint8_t *model, bool payload)
{
    const uint8_t *at = model + HEAD;
    ebpo_status status = EBPO_OK;
    EBPO_FOR_ITEMS(b->mesh->workspace, i, 0, stated_faces(model)) {
        for (unsigned k = 0; k < 3 && status == EBPO_OK; k++) {
            const uint8_t *corner = at + 12 + 12 * k;
            uint32_t raw[3] = { ebpo_load32(corner), ebpo_load32(corner + 4),
                                ebpo_load32(corner + 8) };
            float xyz[3];
            memcpy(xyz, raw, sizeof xyz);
            status = ebpo_import_vertex(b, xyz);
        }
        if (status != EBPO_OK)
            return status;
        at += RECORD + (payload ? ebpo_load16(at + WORD) : 0);
    }
    return EBPO_OK;
}

/* Counts the facets of a model whose last two bytes are not zero. */
static uint64_t count_words(const import_build *b, const uint8_t *model)
{
    uint64_t words = 0;
    EBPO_FOR_ITEMS(b->mesh->workspace, i, 0, stated_faces(model))
        words += ebpo_load16(model + HEAD + RECORD * i + WORD) != 0;
    return words;
}

static ebpo_status note(import_build *b, const stl_bytes *is, uint64_t words)
{
    ebpo_status status = is->payload || is->behind || words ? ebpo_import_notes(b) : EBPO_OK;
    if (status != EBPO_OK || !b->mesh->attributes)
        return status;
    ebpo_attributes *to = b->mesh->attributes;
    ebpo_attributes_count_unread(to, "bytes that follow facets, by their attribute byte counts",
                                 is->payload);
    ebpo_attributes_count_unread(to, "bytes behind the last facet", is->behind);
    if (words)
        ebpo_attributes_lose(to,
                             "the two bytes behind %" PRIu64
                             " facets (colours, perhaps), as the file holds several models",
                             words);
    if (is->models > 1 && b->attributes)
        ebpo_attributes_lose(to, "where each of %" PRIu64 " models begins", is->models);
    return EBPO_OK;
}

static ebpo_status fail_head(const import_build *b, const uint8_t *data, uint64_t size)
{
    char word[IMPORT_WORD_TEXT];
    uint64_t at = 0, end;
    if (!ebpo_bytes_are_text(data, size))
        return ebpo_fail_file(b->error, EBPO_E_FORMAT, b->name,
                              "is no STL file: neither the word solid stands first, nor are there "
                              "the 84 bytes that binary ones begin with");
    while (at < size && (data[at] == ' ' || (data[at] >= '\t' && data[at] <= '\r')))
        at++;
    for (end = at; end < size && data[end] > ' ';)
        end++;
    ebpo_import_word_text(word, (const char *)data + at, end - at);
    return ebpo_fail_file(b->error, EBPO_E_FORMAT, b->name,
                          "is no STL file, but text that begins with '%s'; an STL file in text "
                          "begins with the word solid: remove what is before it, or rename the "
                          "file",
                          word);
}

ebpo_status ebpo_stl_read_binary(import_build *b, const uint8_t *data, uint64_t size,
                                 uint64_t *plain)
{
    *plain = 0;
    if (size < HEAD || (ebpo_bytes_are_text(data, size) && !ebpo_stl_fits_binary(data, size)))
        return fail_head(b, data, size);
    uint64_t faces = stated_faces(data), words = 0;
    if (stated_size(data) > size)
        return ebpo_fail_file(b->error, EBPO_E_FORMAT, b->name,
                              "states %" PRIu64 " faces, but its %" PRIu64 " bytes hold %" PRIu64
                              "; it is cut short or no STL file",
                              faces, size, (size - HEAD) / RECORD);
    if (3 * faces > IMPORT_MOST)
        return ebpo_fail_file(b->error, EBPO_E_LIMIT, b->name,
                              "states %" PRIu64 " faces of three corners each, more than 2^32 - 2 "
                              "corners; split the model",
                              faces);
    stl_bytes is;
    ebpo_status status = explain(b, data, size, &is);
    for (uint64_t m = 0, at = 0; status == EBPO_OK && m < is.models; m++) {
        status = read_facets(b, data + at, is.payload > 0);
        words += is.models > 1 ? count_words(b, data + at) : 0;
        at += stated_size(data + at);
    }
    *plain = is.models == 1 && !is.payload ? stated_size(data) : 0;
    return status == EBPO_OK ? note(b, &is, words) : status;
}
