/* Declares the interface of the WebAssembly module for tools/npm/ebpo: one object for each opened
 * file. The results of a call are result arrays of the object; the next call for this object
 * replaces them. Sizes and offsets are doubles, because JavaScript cannot use 64-bit integers
 * without conversions. */
#ifndef EBPO_MODULE_H
#define EBPO_MODULE_H

#include <ebpo/async.h>
#include <ebpo/ebpo.h>

/* Exports a function, so that JavaScript can call it by this name. */
#define EBPO_JS(name) __attribute__((export_name(#name), used)) name

enum {
    EBPO_JS_ARRAYS = 24,      /* number of result arrays of an object */
    EBPO_JS_NODE_ARRAYS = 13, /* number of arrays that ebpo_js_put_node uses, from array 0 on */
    EBPO_JS_NUMBERS = 10      /* maximum number of values in the result of one point or ray */
};

/* A growing array. */
typedef struct ebpo_js_array {
    uint8_t *data;
    size_t bytes, capacity;
} ebpo_js_array;

/* Either a model, or an object for queries, streams, views and samplers. A model owns `async`,
 * `file` and `model`; the other objects borrow these three members from a model. Members that are
 * not used are NULL. */
typedef struct ebpo_js_object {
    ebpo_async *async;
    ebpo_file *file;
    ebpo_model *model;
    ebpo_context *context;
    ebpo_stream *stream;
    ebpo_view_stream *view;
    ebpo_sampler *sampler;
    struct ebpo_chunks *chunks; /* decoded chunks, for reading rows of arrays; NULL: none yet */
    struct ebpo_patch_table *patches; /* the patches of a view; NULL: none yet */
    uint64_t chunk_memory;            /* size of the cache of chunks in bytes */
    bool within_level; /* true: the stream has begun a level whose nodes are not all read */
    ebpo_js_array array[EBPO_JS_ARRAYS];
    double number[EBPO_JS_NUMBERS]; /* result of a query of one point or ray */
    ebpo_error error;
} ebpo_js_object;

/* Empties all result arrays. */
void ebpo_js_clear(ebpo_js_object *object);

/* Sends prefetch hints for a whole array of the root (ebpo_array_id), so that one request fetches
 * it. */
void ebpo_js_hint_array(ebpo_js_object *object, int array);

/* Makes `chunks`, unless it exists. */
EBPO_MUST_USE ebpo_status ebpo_js_need_chunks(ebpo_js_object *object);

/* Returns EBPO_OK if the file has a mesh, else EBPO_E_ABSENT with an error. */
EBPO_MUST_USE ebpo_status ebpo_js_need_mesh(ebpo_js_object *object);

/* Frees the result arrays, but not the object. */
void ebpo_js_free_arrays(ebpo_js_object *object);

/* Appends bytes to result array n. Returns EBPO_E_MEMORY, with an error, when out of memory. */
EBPO_MUST_USE ebpo_status ebpo_js_put(ebpo_js_object *object, unsigned n, const void *data,
                                      size_t bytes);

/* Appends `count` uninitialized items of `size` bytes to result array n. Returns the first of these
 * items; NULL, with an error, when out of memory. */
void *ebpo_js_extend(ebpo_js_object *object, unsigned n, uint64_t count, size_t size);

/* Returns result array n with `count` items. If the array does not have this size already, sets all
 * items to zero. Returns NULL, with an error, when out of memory. */
void *ebpo_js_fixed(ebpo_js_object *object, unsigned n, uint64_t count, size_t size);

/* Appends a node to result arrays 0 to EBPO_JS_NODE_ARRAYS - 1. Returns false, with an error, when
 * out of memory. */
bool ebpo_js_put_node(ebpo_js_object *object, const ebpo_stream_node *n);

#endif
