/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: catalogues. Many models that are asked as one, or the parts of one model that
 * is too large for a file.
 *
 *   Catalogues   ebpo_catalogue_open (a file), ebpo_catalogue_new (of entries),
 *                ebpo_catalogue_entry_of (a model's), ebpo_catalogue_save
 *   What it is   ebpo_catalogue_get_facts, ebpo_catalogue_get_entry
 *   Open models  ebpo_catalogue_models_new: of any catalogues, within one budget
 *   Questions    ebpo_catalogue_inside, ebpo_catalogue_distance, ebpo_catalogue_ray
 *
 *     ebpo_catalogue *catalogue = NULL;
 *     ebpo_catalogue_models *models = NULL;
 *     ebpo_catalogue_open("scans/catalogue.json", NULL, &catalogue, &error);
 *     ebpo_catalogue_models_new(NULL, &models, &error);
 *     ebpo_catalogue_inside(catalogue, models, points, count, NULL, out, &error);
 *
 * A question opens the models whose boxes it comes to, and no others. What is opened must be what
 * the catalogue tells of it: digest, box, how many numbers of faces; else the question is
 * EBPO_E_FORMAT. Answers are those of the models (query.h), and depend neither on the budget nor on
 * the threads. docs/guide/clusters.md has the file's format, and what parts say together.
 */
#ifndef EBPO_CATALOGUE_H
#define EBPO_CATALOGUE_H

#include <ebpo/query.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- catalogues ---- */

/* A list of entries, which does not change. Threads share it. */
typedef struct ebpo_catalogue ebpo_catalogue;

/* A model, as a catalogue tells of it. */
typedef struct ebpo_catalogue_entry {
    /* Its path or URL: it is asked for winding numbers. Not NULL, and not empty. */
    const char *path;

    /* Of a part: what distances and rays see, which has no caps. NULL: the same model. */
    const char *surface;

    /* Of a part: a .npy of integers, the numbers in the whole of the surface's faces; not empty.
     * NULL: faces keep their numbers. */
    const char *numbers;

    /* content_sha256 of the two files. */
    uint8_t digest[32], surface_digest[32];

    /* Corners of a box that holds the model: finite, and min <= max on each axis. */
    double min[3], max[3];

    /*
     * More that the head of its file tells, for readers of the catalogue; questions do not need it.
     * If file_bytes is 0, none of these six is known, and none is written.
     */
    uint64_t file_bytes, face_count, vertex_count;
    ebpo_rule rule;
    bool mesh, pruned;

    bool solid;

    /* Of a part: it is made of caps alone, so that distances and rays see nothing of it. */
    bool unseen;

    uint64_t reserved[4];
} ebpo_catalogue_entry;

/*
 * Opens a file for a question, by a path or URL of the catalogue; its errors are the question's.
 * From any thread, also from threads of the library.
 */
typedef ebpo_status (*ebpo_catalogue_open_fn)(void *user, const char *path, ebpo_file **out,
                                              ebpo_error *error);

/*
 * Closes it, in any thread. It must not call a function of the same ebpo_catalogue_models, whose
 * lock is held meanwhile.
 */
typedef void (*ebpo_catalogue_close_fn)(void *user, ebpo_file *file);

typedef struct ebpo_catalogue_options {
    size_t struct_size; /* EBPO_CATALOGUE_OPTIONS_INIT sets it */

    /*
     * How its files are opened and closed; NULL: by ebpo_open and ebpo_close. Catalogues with equal
     * functions and an equal `user` share models that are open.
     */
    ebpo_catalogue_open_fn open_file;
    ebpo_catalogue_close_fn close_file;
    void *user;

    /* For ebpo_catalogue_new: the folder where relative paths of entries begin; NULL: here. */
    const char *folder;

    /* For ebpo_catalogue_new: which winding numbers are inside of the sum of parts. */
    ebpo_rule rule;

    /* For ebpo_catalogue_new: the models are parts of one. */
    bool parts;

    uint8_t reserved[3];
} ebpo_catalogue_options;

#define EBPO_CATALOGUE_OPTIONS_INIT EBPO_SIZED(ebpo_catalogue_options)

/*
 * Reads a catalogue that `ebpo catalogue` or ebpo_catalogue_save has written, and checks what it
 * says; opens no model. Relative paths begin in the file's folder. Members that it does not know
 * are left out.
 *
 * EBPO_E_FORMAT: not such a file; the message says where. EBPO_E_VERSION: of another version.
 * EBPO_E_LIMIT: more than 1 GiB. EBPO_E_IO, EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_catalogue_open(const char *path,
                                                       const ebpo_catalogue_options *options,
                                                       ebpo_catalogue **out, ebpo_error *error);

/*
 * A catalogue of entries[count], in their order. All is copied.
 *
 * EBPO_E_ARGUMENT: no entry, or 2^32 - 1 and more; an entry without a path or a box. EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_catalogue_new(const ebpo_catalogue_entry *entries,
                                                      uint64_t count,
                                                      const ebpo_catalogue_options *options,
                                                      ebpo_catalogue **out, ebpo_error *error);

/*
 * What an entry tells of an open file; `path` is kept as it is. The box is that of the mesh: of a
 * file without faces it is none that ebpo_catalogue_new takes.
 *
 * Threads: any.
 */
EBPO_API void ebpo_catalogue_entry_of(const ebpo_file *file, const char *path,
                                      ebpo_catalogue_entry *out);

/*
 * NULL is fine. After the questions to it; models of it that are open stay open.
 *
 * Threads: one per catalogue.
 */
EBPO_API void ebpo_catalogue_free(ebpo_catalogue *catalogue);

/*
 * Writes the catalogue as a JSON file, which appears whole or not at all. Paths that begin with the
 * folder of `path`, letter by letter, become relative; others stay as they are, and relative ones
 * begin in that folder when they are read again.
 *
 * EBPO_E_ARGUMENT: a path is not UTF-8, which JSON demands. EBPO_E_IO, EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_catalogue_save(const ebpo_catalogue *catalogue,
                                                       const char *path, ebpo_error *error);

typedef struct ebpo_catalogue_facts {
    size_t struct_size; /* EBPO_CATALOGUE_FACTS_INIT sets it */

    /* Of the file that was read; the catalogue's. NULL: it was made of entries. */
    const char *path;

    /* Entries, at least 1. */
    uint64_t count;

    /* Bytes of the file, and the FNV-1a hash of all of them. 0: it was made of entries. */
    uint64_t file_bytes, file_hash;

    /* As in ebpo_catalogue_options. */
    ebpo_rule rule;
    bool parts;

    uint8_t reserved[3];
} ebpo_catalogue_facts;

#define EBPO_CATALOGUE_FACTS_INIT EBPO_SIZED(ebpo_catalogue_facts)

/*
 * EBPO_E_ARGUMENT: `out` was not begun with its macro.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_catalogue_get_facts(const ebpo_catalogue *catalogue,
                                              ebpo_catalogue_facts *out);

/*
 * An entry, the first is 0, with paths as they are opened. It is the catalogue's, until that is
 * freed. NULL: there is no such entry.
 *
 * Threads: any.
 */
EBPO_API const ebpo_catalogue_entry *ebpo_catalogue_get_entry(const ebpo_catalogue *catalogue,
                                                              uint64_t number);

/* ---- open models ---- */

/*
 * Models that are open, of any number of catalogues: opened by the first question that needs them,
 * and closed when there is no room, the one that was asked longest ago first. Threads share it.
 */
typedef struct ebpo_catalogue_models ebpo_catalogue_models;

typedef struct ebpo_catalogue_models_options {
    size_t struct_size; /* EBPO_CATALOGUE_MODELS_OPTIONS_INIT sets it */

    /*
     * Bytes that all of them may take together. Of a catalogue of several models each gets an equal
     * share, of one of more than eight an eighth. 0: as many as they need.
     */
    uint64_t memory;

    /* For opening a model. 0: all cores. */
    unsigned threads;

    uint8_t reserved[4];
} ebpo_catalogue_models_options;

#define EBPO_CATALOGUE_MODELS_OPTIONS_INIT EBPO_SIZED(ebpo_catalogue_models_options)

/*
 * None is open at first. EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_catalogue_models_new(
    const ebpo_catalogue_models_options *options, ebpo_catalogue_models **out, ebpo_error *error);

/*
 * Closes all of them. NULL is fine.
 *
 * Threads: one per object, after all questions.
 */
EBPO_API void ebpo_catalogue_models_free(ebpo_catalogue_models *models);

/*
 * Another budget, from the next question on; what is idle is closed when room is needed.
 *
 * Threads: any.
 */
EBPO_API void ebpo_catalogue_models_set_memory(ebpo_catalogue_models *models, uint64_t memory);

/*
 * Closes the models that no question uses.
 *
 * Threads: any.
 */
EBPO_API void ebpo_catalogue_models_close_idle(ebpo_catalogue_models *models);

typedef struct ebpo_catalogue_models_stats {
    size_t struct_size; /* EBPO_CATALOGUE_MODELS_STATS_INIT sets it */

    /* Models that were opened, and closed again, since the beginning; that are open now. */
    uint64_t opened, closed, open;
} ebpo_catalogue_models_stats;

#define EBPO_CATALOGUE_MODELS_STATS_INIT EBPO_SIZED(ebpo_catalogue_models_stats)

/*
 * sums   of all models, also of those that were closed; but `memory` is what is taken now, and
 *        `budget` that of all. May be NULL
 *
 * EBPO_E_ARGUMENT: `out` or `sums` was not begun with its macro.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_catalogue_models_get_stats(ebpo_catalogue_models *models,
                                                     ebpo_catalogue_models_stats *out,
                                                     ebpo_model_stats *sums);

/* ---- questions ---- */

/*
 * Points and rays are as in query.h; others are EBPO_E_ARGUMENT, with their number. Many points are
 * asked along a curve, so that models and subtrees are opened few times. On failure, the answers
 * are unspecified. Errors are EBPO_E_CANCELLED, EBPO_E_MEMORY, those of opening models, and of
 * asking them. EBPO_E_LIMIT: the budget is too small for a model's share.
 *
 * A question waits while others use the budget: a function that it calls, such as the one that
 * opens files, must not ask the same models.
 */

typedef struct ebpo_catalogue_ask_options {
    size_t struct_size; /* EBPO_CATALOGUE_ASK_OPTIONS_INIT sets it */

    /* Points or rays that are answered, in no order. */
    ebpo_progress progress;

    /* Distances: as in ebpo_distance_options. */
    double max_distance;

    /* Rays: as in ebpo_ray_options. */
    ebpo_ray_sides sides;

    /* That answer this call. 0: all cores. */
    unsigned threads;

    /* Distances: as in ebpo_distance_options. */
    bool unsigned_distance;

    uint8_t reserved[7];
} ebpo_catalogue_ask_options;

#define EBPO_CATALOGUE_ASK_OPTIONS_INIT                                                        \
    {                                                                                          \
        sizeof(ebpo_catalogue_ask_options), { NULL, NULL }, __builtin_inf(), EBPO_RAY_BOTH, 0, \
            false,                                                                             \
        {                                                                                      \
            0                                                                                  \
        }                                                                                      \
    }

/* As the number of a model: none. */
#define EBPO_CATALOGUE_NO_MODEL UINT64_MAX

/*
 * Where points[count][3] are, into out[count]. The winding number is the sum over the models; one
 * that has the point on a face adds 0. A point is inside that is inside of any model, else on a
 * face if it is on any.
 *
 * Of parts the answer is exactly the whole's, also on caps: inside is what the rule says of the
 * sum. EBPO_E_LIMIT: 64 rays from a point on a cap all meet edges (nobody has seen that).
 * EBPO_E_ABSENT: a point is on a cap, and the catalogue has no surface of any part.
 *
 * EBPO_E_NOT_SOLID: a model is a surface.
 *
 * Threads: any; further ones live for the call.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_catalogue_inside(const ebpo_catalogue *catalogue,
                                                         ebpo_catalogue_models *models,
                                                         const double *points, uint64_t count,
                                                         const ebpo_catalogue_ask_options *options,
                                                         ebpo_inside_result *out,
                                                         ebpo_error *error);

/*
 * The nearest face of any model, at most max_distance away, for points[count][3]; of several models
 * at the same rounded distance the first. Distances are negative inside (ebpo_catalogue_inside) if
 * all models are solids. `lo` and `hi` are both the unsigned distance, or 0 where there is none.
 *
 * model   [count] the number of its entry; EBPO_CATALOGUE_NO_MODEL: there is no such face
 *
 * EBPO_E_ABSENT: all entries are unseen.
 *
 * Threads: any; further ones live for the call.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_catalogue_distance(
    const ebpo_catalogue *catalogue, ebpo_catalogue_models *models, const double *points,
    uint64_t count, const ebpo_catalogue_ask_options *options, ebpo_distance_result *out,
    uint64_t *model, ebpo_error *error);

/*
 * The first face of any model that each of rays[count] meets; of several models at the same rounded
 * t the first. Where t is INFINITY for several, a longer direction decides (ebpo_ray_hit).
 *
 * model   as for ebpo_catalogue_distance
 *
 * EBPO_E_ABSENT: all entries are unseen.
 *
 * Threads: any; further ones live for the call.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_catalogue_ray(const ebpo_catalogue *catalogue,
                                                      ebpo_catalogue_models *models,
                                                      const ebpo_ray *rays, uint64_t count,
                                                      const ebpo_catalogue_ask_options *options,
                                                      ebpo_ray_hit *out, uint64_t *model,
                                                      ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
