/* SPDX-License-Identifier: MIT
 * Queries many models together, or the parts of one model that is too large for one file.
 *
 *   Catalogues   ebpo_catalogue_open (a file), ebpo_catalogue_new (of entries),
 *                ebpo_catalogue_entry_of, ebpo_catalogue_save
 *   Contents     ebpo_catalogue_get_facts, ebpo_catalogue_get_entry
 *   Open models  ebpo_catalogue_models_new (of any catalogues, within one budget)
 *   Queries      ebpo_catalogue_inside, ebpo_catalogue_distance, ebpo_catalogue_ray
 *
 *     ebpo_catalogue *catalogue = NULL;
 *     ebpo_catalogue_models *models = NULL;
 *     ebpo_catalogue_open("scans/catalogue.json", NULL, &catalogue, &error);
 *     ebpo_catalogue_models_new(NULL, &models, &error);
 *     ebpo_catalogue_inside(catalogue, models, points, count, NULL, out, &error);
 *
 * A *catalogue* is a list of entries, each with the path, the box and the digest (content_sha256)
 * of a model. *Parts* are files of one model that was cut; *caps* are faces that close a part where
 * it was cut. A query opens a model only if its box shows that the model can contribute to the
 * result. Distances and rays use the file that the member `surface` of the entry names, or the
 * file `path` if `surface` is NULL.
 * Results are those of the models (query.h) and do not depend on the budget. docs/guide/clusters.md
 * describes the file format and the results of parts.
 *
 * A query returns EBPO_E_FORMAT if an opened model does not have the digest of its entry or is not
 * within the entry's box. It also returns EBPO_E_FORMAT if the entry names a file of face indices
 * (`numbers`) with a wrong number of indices. The file must have one index for each face of the
 * model that distances and rays use.
 */
#ifndef EBPO_CATALOGUE_H
#define EBPO_CATALOGUE_H

#include <ebpo/query.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- catalogues ---- */

/* An immutable list of entries. Threads may share a catalogue. */
typedef struct ebpo_catalogue ebpo_catalogue;

/* Description of a model in a catalogue. */
typedef struct ebpo_catalogue_entry {
    /*
     * Path or URL of the model. If `surface` is not NULL: path or URL of the part with caps, which
     * is used for winding numbers. Must not be NULL or empty.
     */
    const char *path;

    /*
     * For a part: path or URL of the part without caps, which is used for distances and rays. NULL:
     * distances and rays use the model at `path`.
     */
    const char *surface;

    /*
     * For a part: path of an .npy file of face indices. Element i is the index, in the whole
     * model, of face i of the file that distances and rays use. Must not be empty.
     * NULL: results give the indices of faces in the part.
     */
    const char *numbers;

    /* content_sha256 of the models at `path` and `surface`. */
    uint8_t digest[32], surface_digest[32];

    /* Box that contains the model: finite, min <= max on each axis. */
    double min[3], max[3];

    /*
     * Data from the header of the file at `path`, for programs that read the catalogue. file_bytes:
     * size of the file. face_count, vertex_count: number of faces and vertices. rule: rule for
     * winding numbers. mesh: true if the file has a mesh. pruned: true if the file is a subset.
     * Queries do not use this data. If file_bytes is 0, these six members are unknown and not
     * written.
     */
    uint64_t file_bytes, face_count, vertex_count;
    ebpo_rule rule;
    bool mesh, pruned;

    /* True: the model is a solid; false: it is a surface. */
    bool solid;

    /*
     * True for a part without faces of the model, only with caps. Distances and rays ignore this
     * part.
     */
    bool only_caps;

    uint64_t reserved[4];
} ebpo_catalogue_entry;

/*
 * Function that opens a file for a query, by a path or URL that the catalogue contains. If this
 * function fails, the query returns its error. Any thread may call it, including threads of the
 * library.
 */
typedef ebpo_status (*ebpo_catalogue_open_fn)(void *user, const char *path, ebpo_file **out,
                                              ebpo_error *error);

/*
 * Function that closes a file that ebpo_catalogue_open_fn opened. Any thread may call it. The
 * function must not call functions of the ebpo_catalogue_models whose query opened the file,
 * because the library has locked this object.
 */
typedef void (*ebpo_catalogue_close_fn)(void *user, ebpo_file *file);

/* Options of ebpo_catalogue_open and ebpo_catalogue_new. */
typedef struct ebpo_catalogue_options {
    size_t struct_size;

    /*
     * Functions for opening and closing files; NULL: ebpo_open and ebpo_close. Catalogues with
     * equal functions and equal `user` share open models.
     */
    ebpo_catalogue_open_fn open_file;
    ebpo_catalogue_close_fn close_file;
    void *user;

    /* For ebpo_catalogue_new: base folder of relative paths; NULL: the current folder. */
    const char *folder;

    /* For ebpo_catalogue_new: rule for the summed winding numbers of parts. */
    ebpo_rule rule;

    /* For ebpo_catalogue_new: true if the models are parts of one model. */
    bool parts;

    uint8_t reserved[3];
} ebpo_catalogue_options;

#define EBPO_CATALOGUE_OPTIONS_INIT EBPO_SIZED(ebpo_catalogue_options)

/*
 * Reads and checks a catalogue written by `ebpo catalogue` or ebpo_catalogue_save; opens no model.
 * Relative paths are based on the file's folder. Unknown JSON members are ignored.
 *
 * EBPO_E_FORMAT: not a catalogue; the message gives the location. EBPO_E_VERSION: the file has an
 * unknown version. EBPO_E_LIMIT: the file has more than 1 GiB. EBPO_E_IO.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_catalogue_open(const char *path,
                                                       const ebpo_catalogue_options *options,
                                                       ebpo_catalogue **out, ebpo_error *error);

/*
 * Makes a catalogue of entries[count], in their order. All data is copied.
 *
 * EBPO_E_ARGUMENT: there is no entry, or there are 2^32 - 1 entries or more; or an entry has no
 * path or no valid box.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_catalogue_new(const ebpo_catalogue_entry *entries,
                                                      uint64_t count,
                                                      const ebpo_catalogue_options *options,
                                                      ebpo_catalogue **out, ebpo_error *error);

/*
 * Describes an open file as an entry with the given `path`, which is not copied. The entry's box is
 * the box of the mesh. The entry of a file without faces has no valid box, so ebpo_catalogue_new
 * refuses the entry.
 *
 * Threads: any.
 */
EBPO_API void ebpo_catalogue_entry_of(const ebpo_file *file, const char *path,
                                      ebpo_catalogue_entry *out);

/*
 * Frees a catalogue. Call this function only after all queries of the catalogue have returned.
 * Models that queries opened stay open.
 *
 * Threads: one at a time per catalogue.
 */
EBPO_API void ebpo_catalogue_free(ebpo_catalogue *catalogue);

/*
 * Writes the catalogue as a JSON file, which is replaced atomically. A model's path that begins
 * with the bytes of the path of the catalogue's folder is written relative to this folder; other
 * paths are unchanged. When the catalogue is read again, relative paths begin at its folder.
 *
 * EBPO_E_ARGUMENT: a path is not UTF-8. EBPO_E_IO.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_catalogue_save(const ebpo_catalogue *catalogue,
                                                       const char *path, ebpo_error *error);

/* Properties of a catalogue (ebpo_catalogue_get_facts). */
typedef struct ebpo_catalogue_facts {
    size_t struct_size;

    /* Path of the file that was read; valid until the catalogue is freed. NULL: the catalogue was
     * made of entries. */
    const char *path;

    /* Number of entries, at least 1. */
    uint64_t count;

    /*
     * Size of the catalogue's file, and the FNV-1a hash of its bytes. 0: the catalogue was made of
     * entries.
     */
    uint64_t file_bytes, file_hash;

    /* As in ebpo_catalogue_options. */
    ebpo_rule rule;
    bool parts;

    uint8_t reserved[3];
} ebpo_catalogue_facts;

#define EBPO_CATALOGUE_FACTS_INIT EBPO_SIZED(ebpo_catalogue_facts)

/*
 * Gets the properties of a catalogue.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_catalogue_get_facts(const ebpo_catalogue *catalogue,
                                              ebpo_catalogue_facts *out);

/*
 * Returns the entry with index `number`, or NULL if `number` is out of range. Relative paths in the
 * entry are already joined with their base folder. The entry is valid until the catalogue is freed.
 *
 * Threads: any.
 */
EBPO_API const ebpo_catalogue_entry *ebpo_catalogue_get_entry(const ebpo_catalogue *catalogue,
                                                              uint64_t number);

/* ---- open models ---- */

/*
 * Open models of any number of catalogues. The first query that needs a model opens the model. If
 * memory is needed, the least recently queried model is closed. Threads may share this object.
 */
typedef struct ebpo_catalogue_models ebpo_catalogue_models;

/* Options of ebpo_catalogue_models_new. */
typedef struct ebpo_catalogue_models_options {
    size_t struct_size;

    /*
     * Maximum memory of all open models together, in bytes. Each open model may use one n-th of
     * this maximum; n is the number of models of its catalogue, but at most 8. 0: no limit.
     */
    uint64_t memory;

    /* Number of threads for opening a model. 0: all cores. */
    unsigned threads;

    uint8_t reserved[4];
} ebpo_catalogue_models_options;

#define EBPO_CATALOGUE_MODELS_OPTIONS_INIT EBPO_SIZED(ebpo_catalogue_models_options)

/*
 * Makes an object without open models.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_catalogue_models_new(
    const ebpo_catalogue_models_options *options, ebpo_catalogue_models **out, ebpo_error *error);

/*
 * Closes all models.
 *
 * Threads: one at a time per object, after all queries.
 */
EBPO_API void ebpo_catalogue_models_free(ebpo_catalogue_models *models);

/*
 * Changes the memory limit, from the next query on. Models that no query uses are closed when
 * memory is needed.
 *
 * Threads: any.
 */
EBPO_API void ebpo_catalogue_models_set_memory(ebpo_catalogue_models *models, uint64_t memory);

/*
 * Closes the models that no query uses.
 *
 * Threads: any.
 */
EBPO_API void ebpo_catalogue_models_close_idle(ebpo_catalogue_models *models);

/* Statistics of open models (ebpo_catalogue_models_get_stats). */
typedef struct ebpo_catalogue_models_stats {
    size_t struct_size;

    /*
     * opened, closed: number of models that were opened and closed since the object was made. open:
     * number of models that are open now.
     */
    uint64_t opened, closed, open;
} ebpo_catalogue_models_stats;

#define EBPO_CATALOGUE_MODELS_STATS_INIT EBPO_SIZED(ebpo_catalogue_models_stats)

/*
 * Gets statistics.
 *
 * sums   sums over all models, including closed models. Exceptions: `memory` is the memory in use
 *        now; `budget` is the budget that all models share. May be NULL
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_catalogue_models_get_stats(ebpo_catalogue_models *models,
                                                     ebpo_catalogue_models_stats *out,
                                                     ebpo_model_stats *sums);

/* ---- queries ---- */

/*
 * Rules for the queries of a catalogue. query.h gives the valid values of points and rays. For
 * other values, queries return EBPO_E_ARGUMENT, and the message gives the index of the point or
 * ray. Points are sorted along a space-filling curve, so that each model and subtree is loaded only
 * a few times. On failure the results are unspecified. Errors are those of opening and querying
 * models. EBPO_E_LIMIT: a model does not fit in its share of the budget.
 *
 * A query waits while other queries use the budget. Therefore a callback of a query, such as
 * ebpo_catalogue_open_fn, must not query the same ebpo_catalogue_models.
 */

/* Options of the queries of a catalogue. */
typedef struct ebpo_catalogue_query_options {
    size_t struct_size;

    /* Reports the number of completed points or rays, which are completed in any order. */
    ebpo_progress progress;

    /* For distances: as in ebpo_distance_options. */
    double max_distance;

    /* For rays: as in ebpo_ray_options. */
    ebpo_ray_sides sides;

    /* Number of threads for this call. 0: all cores. */
    unsigned threads;

    /* For distances: as in ebpo_distance_options. */
    bool unsigned_distance;

    uint8_t reserved[7];
} ebpo_catalogue_query_options;

#define EBPO_CATALOGUE_QUERY_OPTIONS_INIT                                                        \
    {                                                                                            \
        sizeof(ebpo_catalogue_query_options), { NULL, NULL }, __builtin_inf(), EBPO_RAY_BOTH, 0, \
            false,                                                                               \
        {                                                                                        \
            0                                                                                    \
        }                                                                                        \
    }

/* Value of a model's index if there is no model. */
#define EBPO_CATALOGUE_NO_MODEL UINT64_MAX

/*
 * Classifies points[count][3] into out[count]. The winding number is the sum of the winding numbers
 * of the models. A model counts as 0 if the point is on one of its faces. A point is inside if it
 * is inside any model. Otherwise it is on a face if it is on a face of any model.
 *
 * If the models are parts of one model, the rule is applied to the sum of the winding numbers. The
 * result is exactly the result for the whole model, also for points on caps. For such points, the
 * function counts the crossings of a ray with the faces. EBPO_E_LIMIT: each of 64 rays hits an edge
 * or runs along a face. EBPO_E_ABSENT: a point is on a cap, and the member `surface` is NULL for
 * all parts.
 *
 * EBPO_E_NOT_SOLID: a model is a surface.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_catalogue_inside(
    const ebpo_catalogue *catalogue, ebpo_catalogue_models *models, const double *points,
    uint64_t count, const ebpo_catalogue_query_options *options, ebpo_inside_result *out,
    ebpo_error *error);

/*
 * Finds the nearest face of any model within max_distance, for points[count][3]. If several models
 * have the same rounded distance, the first of them in the catalogue is used. If all models are
 * solids, distances of points inside (ebpo_catalogue_inside) are negative. `lo` and `hi` are both
 * the unsigned distance, or 0 if no face is found.
 *
 * model   [count] index of the entry that has the face; EBPO_CATALOGUE_NO_MODEL: no face is found
 *
 * EBPO_E_ABSENT: all entries are parts with only caps (`only_caps`).
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_catalogue_distance(
    const ebpo_catalogue *catalogue, ebpo_catalogue_models *models, const double *points,
    uint64_t count, const ebpo_catalogue_query_options *options, ebpo_distance_result *out,
    uint64_t *model, ebpo_error *error);

/*
 * For each of rays[count], finds the first face of any model that the ray hits. If several models
 * have the same rounded t, the first of them in the catalogue is used. Exception: the nearest hits
 * of several models may all have t = INFINITY (ebpo_ray_hit). To compare these hits,
 * their t are computed again with the ray's direction multiplied by a power of two. The returned t
 * is INFINITY nevertheless.
 *
 * model   as for ebpo_catalogue_distance
 *
 * EBPO_E_ABSENT: all entries are parts with only caps (`only_caps`).
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_catalogue_ray(const ebpo_catalogue *catalogue,
                                                      ebpo_catalogue_models *models,
                                                      const ebpo_ray *rays, uint64_t count,
                                                      const ebpo_catalogue_query_options *options,
                                                      ebpo_ray_hit *out, uint64_t *model,
                                                      ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
