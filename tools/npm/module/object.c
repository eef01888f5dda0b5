/* Provides the objects of the WebAssembly module: opening, supply of bytes, result arrays, and
 * information of the file. */
#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/error.h"
#include "format/patch_table.h"
#include "format/reader.h"
#include "module.h"

/* ---- results ---- */

void ebpo_js_clear(ebpo_js_object *object)
{
    for (unsigned n = 0; n < EBPO_JS_ARRAYS; n++)
        object->array[n].bytes = 0;
}

void *ebpo_js_extend(ebpo_js_object *object, unsigned n, uint64_t count, size_t size)
{
    ebpo_js_array *a = &object->array[n];
    uint64_t bytes = a->bytes + count * size;
    if (count > SIZE_MAX / 2 / size || bytes > SIZE_MAX / 2)
        bytes = UINT64_MAX;
    if (bytes > a->capacity || !a->data) {
        uint64_t capacity = bytes < 256 ? 256 : bytes + (a->bytes ? bytes / 2 : 0);
        uint8_t *data = capacity < SIZE_MAX / 2 ? realloc(a->data, (size_t)capacity) : NULL;
        if (!data) {
            object->error.status = EBPO_E_MEMORY;
            snprintf(object->error.message, sizeof object->error.message,
                     "not enough memory for the results");
            return NULL;
        }
        a->data = data;
        a->capacity = (size_t)capacity;
    }
    void *out = a->data + a->bytes;
    a->bytes = (size_t)bytes;
    return out;
}

void *ebpo_js_fixed(ebpo_js_object *object, unsigned n, uint64_t count, size_t size)
{
    ebpo_js_array *a = &object->array[n];
    if (count && a->bytes == count * size)
        return a->data;
    a->bytes = 0;
    void *out = ebpo_js_extend(object, n, count, size);
    if (out)
        memset(out, 0, a->bytes);
    return out;
}

ebpo_status ebpo_js_put(ebpo_js_object *object, unsigned n, const void *data, size_t bytes)
{
    void *out = ebpo_js_extend(object, n, bytes, 1);
    if (!out)
        return EBPO_E_MEMORY;
    if (bytes)
        memcpy(out, data, bytes);
    return EBPO_OK;
}

void ebpo_js_free_arrays(ebpo_js_object *object)
{
    for (unsigned n = 0; n < EBPO_JS_ARRAYS; n++)
        free(object->array[n].data);
}

/* Returns the result arrays. JavaScript reads their members: each ebpo_js_array has three members
 * of 4 bytes. */
const ebpo_js_array *EBPO_JS(ebpo_js_table)(const ebpo_js_object *object) { return object->array; }

const char *EBPO_JS(ebpo_js_message)(const ebpo_js_object *object) { return object->error.message; }

const char *EBPO_JS(ebpo_js_path)(const ebpo_js_object *object) { return object->error.object; }

double EBPO_JS(ebpo_js_offset)(const ebpo_js_object *object)
{
    return (double)object->error.offset;
}

/* ---- bytes ---- */

/* Returns an object without an open file; NULL: out of memory. */
ebpo_js_object *EBPO_JS(ebpo_js_new)(double size, const char *name, const char *version,
                                     double memory)
{
    ebpo_js_object *object = calloc(1, sizeof *object);
    if (!object)
        return NULL;
    object->error = (ebpo_error)EBPO_ERROR_INIT;
    if (ebpo_async_new((uint64_t)size, name, version, (uint64_t)memory, &object->async,
                       &object->error) == EBPO_OK)
        return object;
    free(object);
    return NULL;
}

/* Frees an object, after its model, queries and streams. */
void EBPO_JS(ebpo_js_free)(ebpo_js_object *object)
{
    ebpo_chunks_free(object->chunks);
    if (object->patches)
        ebpo_patch_table_free(object->patches);
    free(object->patches);
    ebpo_close(object->file);
    ebpo_async_free(object->async);
    ebpo_js_free_arrays(object);
    free(object);
}

double EBPO_JS(ebpo_js_begin)(ebpo_js_object *object)
{
    return (double)ebpo_async_begin(object->async);
}

void EBPO_JS(ebpo_js_end)(ebpo_js_object *object, double operation)
{
    ebpo_async_end(object->async, (uint64_t)operation);
}

/* Puts the byte ranges that the object needs into array 0: offset and size of each range, doubles.
 */
int EBPO_JS(ebpo_js_needed)(ebpo_js_object *object)
{
    const ebpo_range *ranges = NULL;
    size_t count = 0;
    ebpo_js_clear(object);
    ebpo_status status = ebpo_async_needed(object->async, &ranges, &count, &object->error);
    double *out = status == EBPO_OK ? ebpo_js_extend(object, 0, count, 2 * sizeof *out) : NULL;
    if (!out)
        return object->error.status;
    for (size_t i = 0; i < count; i++) {
        out[2 * i] = (double)ranges[i].offset;
        out[2 * i + 1] = (double)ranges[i].size;
    }
    return EBPO_OK;
}

int EBPO_JS(ebpo_js_supply)(ebpo_js_object *object, double offset, double size, const void *bytes,
                            const char *version)
{
    return ebpo_async_supply(object->async, (uint64_t)offset, (uint64_t)size, bytes, version,
                             &object->error);
}

void ebpo_js_hint_array(ebpo_js_object *object, int array)
{
    ebpo_hints hints = EBPO_HINTS_INIT(object->file);
    ebpo_hint_array(&hints, ebpo_reader_array(object->file, (ebpo_array_id)array, 0));
    ebpo_hint_all(&hints);
}

ebpo_status ebpo_js_need_chunks(ebpo_js_object *object)
{
    if (object->chunks)
        return EBPO_OK;
    ebpo_js_hint_array(object, EBPO_A_FACES_INDEX); /* ebpo_chunks_make reads it chunk by chunk */
    return ebpo_chunks_make(&object->chunks, object->file, object->chunk_memory, &object->error);
}

ebpo_status ebpo_js_need_mesh(ebpo_js_object *object)
{
    return ebpo_file_info(object->file)->parts & EBPO_PART_MESH
               ? EBPO_OK
               : ebpo_fail(&object->error, EBPO_E_ABSENT, "the file has no mesh");
}

/* ---- opening ---- */

/* Opens the file. `whole`: true: all bytes are supplied already, so no prefetch hints are sent. */
int EBPO_JS(ebpo_js_open)(ebpo_js_object *object, const char *name, int whole)
{
    ebpo_source source = EBPO_SOURCE_INIT;
    ebpo_status status = ebpo_async_source(object->async, &source, &object->error);
    if (whole) {
        source.prefetch = NULL;
        source.prefetched = 0;
    }
    if (status == EBPO_OK)
        status = ebpo_open_source(&source, name, &object->file, &object->error);
    return status;
}

/* ---- information ---- */

/* Appends formatted text to array 0. */
static EBPO_PRINTF(2, 3) ebpo_status put_text(ebpo_js_object *object, const char *format, ...)
{
    char text[512];
    va_list args;
    va_start(args, format);
    int length = vsnprintf(text, sizeof text, format, args);
    va_end(args);
    return ebpo_js_put(object, 0, text, (size_t)length);
}

/* put_string, put_number, put_vector and put_hash append a member of a JSON object, and a comma. */
static ebpo_status put_string(ebpo_js_object *object, const char *name, const char *value)
{
    ebpo_status status = put_text(object, "\"%s\":\"", name);
    for (; *value && status == EBPO_OK; value++) {
        unsigned c = (unsigned char)*value;
        status = c < 32 || c == '"' || c == '\\' ? put_text(object, "\\u%04x", c)
                                                 : ebpo_js_put(object, 0, value, 1);
    }
    return status == EBPO_OK ? put_text(object, "\",") : status;
}

static ebpo_status put_number(ebpo_js_object *object, const char *name, double value)
{
    return isfinite(value) ? put_text(object, "\"%s\":%.17g,", name, value)
                           : put_text(object, "\"%s\":null,", name);
}

static ebpo_status put_vector(ebpo_js_object *object, const char *name, const double x[3])
{
    return put_text(object, "\"%s\":[%.17g,%.17g,%.17g],", name, x[0], x[1], x[2]);
}

static ebpo_status put_hash(ebpo_js_object *object, const char *name, const uint8_t hash[32])
{
    char text[65];
    for (int i = 0; i < 32; i++)
        snprintf(text + 2 * i, 3, "%02x", hash[i]);
    return put_string(object, name, text);
}

static bool put_level(ebpo_js_object *object, const ebpo_level_summary *level)
{
    return put_text(object,
                    "{\"gray\":%" PRIu64 ",\"leaves\":%" PRIu64 ",\"white\":%" PRIu64
                    ",\"black\":%" PRIu64 ",\"planes\":%" PRIu64 ",\"leafPlanes\":%" PRIu64
                    ",\"faces\":%" PRIu64 ",",
                    level->gray_count, level->leaf_count, level->white_count, level->black_count,
                    level->plane_count, level->leaf_plane_count, level->new_count) == EBPO_OK &&
           put_number(object, "grayVolume", level->gray_volume) == EBPO_OK &&
           put_number(object, "leafVolume", level->leaf_volume) == EBPO_OK &&
           put_text(object, "\"pruned\":%" PRIu64 "}", level->pruned_count) == EBPO_OK;
}

static ebpo_status put_attribute(ebpo_js_object *object, const ebpo_attribute_facts *a, bool first)
{
    bool ok = put_text(object, first ? "{" : ",{") == EBPO_OK &&
              put_string(object, "element", a->element) == EBPO_OK &&
              put_string(object, "names", a->names) == EBPO_OK &&
              put_string(object, "type", ebpo_attribute_type_text(a->type)) == EBPO_OK &&
              put_number(object, "rows", (double)a->rows) == EBPO_OK &&
              put_number(object, "columns", (double)a->columns) == EBPO_OK &&
              (!a->has_range || !isfinite(a->range[0]) || !isfinite(a->range[1]) ||
               put_text(object, "\"range\":[%.17g,%.17g],", a->range[0], a->range[1]) == EBPO_OK);
    return ok ? put_text(object, "\"list\":%s}", a->list ? "true" : "false") : EBPO_E_MEMORY;
}

static ebpo_status put_attributes(ebpo_js_object *object)
{
    ebpo_attribute_facts facts = EBPO_ATTRIBUTE_FACTS_INIT;
    ebpo_status status = put_text(object, "\"attributes\":[");
    for (unsigned n = 0; status == EBPO_OK && ebpo_file_attribute(object->file, n, &facts); n++)
        status = put_attribute(object, &facts, n == 0);
    return status == EBPO_OK ? put_text(object, "],") : status;
}

/* Returns true if the outside of the mesh is in front of all faces, unless they intersect. */
static bool is_outward(const ebpo_mesh_report *report)
{
    return report->manifold && report->components == 1 && report->volume > 0;
}

static const char *const rule_words[] = { "nonzero", "evenodd", "positive" };

/* Puts the file's information into array 0, as JSON in UTF-8. */
int EBPO_JS(ebpo_js_info)(ebpo_js_object *object)
{
    const ebpo_info *info = ebpo_file_info(object->file);
    ebpo_js_clear(object);
    bool ok =
        put_text(object, "{") == EBPO_OK &&
        put_string(object, "generator", info->generator) == EBPO_OK &&
        put_string(object, "sourceName", info->source_name) == EBPO_OK &&
        put_string(object, "sourceFormat", info->source_format) == EBPO_OK &&
        put_string(object, "unit", info->unit) == EBPO_OK &&
        put_string(object, "crs", info->crs) == EBPO_OK &&
        put_string(object, "date", info->date) == EBPO_OK &&
        put_string(object, "rule", rule_words[info->rule]) == EBPO_OK &&
        put_hash(object, "contentSha256", info->content_sha256) == EBPO_OK &&
        (!info->pruned || put_hash(object, "subsetOf", info->subset_of) == EBPO_OK) &&
        put_text(object,
                 "\"version\":[%d,%d],\"solid\":%s,\"outward\":%s,\"pruned\":%s,"
                 "\"hasMesh\":%s,\"doubles\":%s,",
                 info->version_major, info->version_minor, info->solid ? "true" : "false",
                 is_outward(&info->report) ? "true" : "false", info->pruned ? "true" : "false",
                 info->parts & EBPO_PART_MESH ? "true" : "false",
                 info->double_coordinates ? "true" : "false") == EBPO_OK &&
        put_vector(object, "origin", info->box_origin) == EBPO_OK &&
        put_vector(object, "size", info->box_size) == EBPO_OK &&
        put_number(object, "volume", info->report.volume) == EBPO_OK &&
        put_number(object, "vertices", (double)info->vertex_count) == EBPO_OK &&
        put_number(object, "faces", (double)info->face_count) == EBPO_OK &&
        put_number(object, "sourceFaces", (double)info->source_face_count) == EBPO_OK &&
        put_number(object, "addedFaces", (double)info->repair_record.added_faces) == EBPO_OK &&
        put_number(object, "parts", info->parts) == EBPO_OK &&
        put_number(object, "subtreeLevel", info->subtree_level) == EBPO_OK &&
        put_number(object, "fileBytes", (double)info->file_bytes) == EBPO_OK &&
        put_attributes(object) == EBPO_OK && put_text(object, "\"levels\":[") == EBPO_OK;
    for (int k = 0; k < info->level_count && ok; k++)
        ok = put_text(object, k ? "," : "") == EBPO_OK && put_level(object, &info->level[k]);
    return ok && put_text(object, "]}") == EBPO_OK ? EBPO_OK : EBPO_E_MEMORY;
}
