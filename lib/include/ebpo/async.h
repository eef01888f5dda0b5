/* SPDX-License-Identifier: MIT
 * Reads files whose bytes arrive asynchronously: in browsers, and in programs with an event loop.
 *
 * No function waits for bytes. A function that needs bytes which are not available returns
 * EBPO_E_PENDING. The caller gets the ranges of the needed bytes, fetches all ranges at the same
 * time, supplies the bytes, and repeats the call with the same arguments:
 *
 *     ebpo_async *async = NULL;
 *     ebpo_source source = EBPO_SOURCE_INIT;
 *     const ebpo_range *range;
 *     size_t count;
 *     ebpo_async_new(size, "model.ebpo.h5", etag, UINT64_C(48) << 20, &async, &error);
 *     ebpo_async_source(async, &source, &error);
 *     ...
 *     uint64_t operation = ebpo_async_begin(async);
 *     while ((status = ebpo_distance(context, p, NULL, &out, &error)) == EBPO_E_PENDING) {
 *         ebpo_async_needed(async, &range, &count, &error);
 *         for (size_t i = 0; i < count; i++)
 *             ...  fetch range[i], at the same time as all other ranges, and then:
 *             ebpo_async_supply(async, range[i].offset, range[i].size, bytes, etag, &error);
 *     }
 *     ebpo_async_end(async, operation);
 *
 * Every function that reads can return EBPO_E_PENDING if its file has such a source. Rules:
 * - A function that returns EBPO_E_PENDING makes no object. If this function is ebpo_open_source,
 *   it has closed the source: get a new source from ebpo_async_source for the repeated call.
 * - Outputs are unspecified, and callbacks may have received some results. The repeated call starts
 *   again and passes all results. Streams continue with the item that was not returned.
 * - Batches of points and rays keep their completed results if options.done is given (query.h). For
 *   a batch, also begin a second operation before each repetition, and end one of the two
 *   operations after ebpo_async_needed. If the repetition has completed items, end the older
 *   operation. The library may remove bytes that only earlier repetitions used. If the repetition
 *   has completed no items, end the newer operation.
 * - ebpo_ray_all_many keeps no completed results: its hits are one array in the order of the rays,
 *   so the position of a hit depends on all earlier rays. Each call evaluates all rays, so pass few
 *   rays at a time.
 * - Catalogues support such files if ebpo_catalogue_options.open_file opens them. Scenes do not
 *   support them, because a scene opens its files by path.
 * - Haptic rendering does not support such files, because its thread loads data in the background.
 *
 * The number of repetitions is finite for any memory budget. Bytes that were supplied or read since
 * the operation began stay available until the operation ends. So each repetition either completes,
 * or needs bytes that no earlier repetition needed.
 */
#ifndef EBPO_ASYNC_H
#define EBPO_ASYNC_H

#include <ebpo/file.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The available bytes of one file, and the ranges of the needed bytes. */
typedef struct ebpo_async ebpo_async;

/*
 * Makes an object without bytes.
 *
 * size      size of the file in bytes
 * name      name of the file for messages; copied
 * version   text that changes when the file changes, such as an ETag; copied. "": not known
 * memory    maximum number of supplied bytes in memory. When an operation ends, the least recently
 *           used bytes are removed until at most this number remains. The first 128 KiB of the file
 *           stay
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_async_new(uint64_t size, const char *name,
                                                  const char *version, uint64_t memory,
                                                  ebpo_async **out, ebpo_error *error);

/*
 * Frees the object. First close the files that use its sources.
 *
 * Threads: one at a time per object.
 */
EBPO_API void ebpo_async_free(ebpo_async *async);

/*
 * Makes a source for ebpo_open_source. The same bytes may be opened any number of times, each time
 * with a new source.
 * Initialize `out` with EBPO_SOURCE_INIT. Reading can return EBPO_E_PENDING, and EBPO_E_IO after
 * the file has changed.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_async_source(ebpo_async *async, ebpo_source *out,
                                                     ebpo_error *error);

/*
 * Begins an operation: one call with all its repetitions. Returns the argument for ebpo_async_end.
 * Several operations may run at the same time.
 *
 * Threads: any.
 */
EBPO_API uint64_t ebpo_async_begin(ebpo_async *async);

/*
 * Ends an operation that is complete, or that the caller no longer repeats. After this, bytes that
 * no running operation has used may be removed.
 *
 * Threads: any.
 */
EBPO_API void ebpo_async_end(ebpo_async *async, uint64_t operation);

/*
 * Gets the ranges of missing bytes that calls have needed, or prefetch hints have named, since the
 * last call of ebpo_async_needed. Ranges are in ascending order and at most 4 MiB each; ranges with
 * small gaps between them are merged.
 *
 * ranges   [count] valid until the next call of ebpo_async_needed with this object
 * count    0: all bytes have arrived in the meantime (several threads); repeat the call at once
 *
 * Threads: one at a time per object.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_async_needed(ebpo_async *async, const ebpo_range **ranges,
                                                     size_t *count, ebpo_error *error);

/*
 * Supplies bytes [offset, offset + size) of the file, which are copied. Any ranges may be supplied,
 * in any order, also before they are needed.
 *
 * version   version of the file from which the bytes come; NULL: not known
 *
 * EBPO_E_IO: the version differs from the version given to ebpo_async_new, or the bytes differ from
 * available bytes. In both cases the file has changed, and all later calls and reads fail.
 * EBPO_E_ARGUMENT: the range is not within the file.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_async_supply(ebpo_async *async, uint64_t offset,
                                                     uint64_t size, const void *bytes,
                                                     const char *version, ebpo_error *error);

/*
 * Returns the number of supplied bytes that are in memory.
 *
 * Threads: any.
 */
EBPO_API uint64_t ebpo_async_bytes(const ebpo_async *async);

#ifdef __cplusplus
}
#endif
#endif
