/* Defines data and functions that the files of lib/catalogue share: the catalogue, open models that
 * several threads use, and queries of several models. */
#ifndef EBPO_CATALOGUE_CATALOGUE_IN_H
#define EBPO_CATALOGUE_CATALOGUE_IN_H

#include <ebpo/catalogue.h>

#include "catalogue/catalogue_boxes.h"

/* --- a catalogue: catalogue_file.c --- */

struct ebpo_catalogue {
    char *path; /* path of the catalogue file that was read; NULL: made from an array */
    uint64_t file_bytes, file_hash; /* size and hash of the catalogue file */
    uint64_t count;                 /* number of models, at least 1, at most 2^32 - 2 */
    /* [count] models; the catalogue owns the texts of the entries */
    ebpo_catalogue_entry *entry;
    ebpo_catalogue_options how;          /* options; `folder` is NULL */
    ebpo_catalogue_boxes all;            /* boxes of all models */
    ebpo_catalogue_boxes seen;           /* boxes of the models that rays and distances use */
    const ebpo_catalogue_entry *surface; /* first model that is not a solid; NULL: all are solids */
};

/* Names of the values of ebpo_rule in catalogue files. */
extern const char *const ebpo_catalogue_rules[];

/* Returns the catalogue's name in messages. */
const char *ebpo_catalogue_shown(const ebpo_catalogue *c);

/* --- open models: open_models.c --- */

/* An open model, lent to a thread. */
typedef struct ebpo_catalogue_held ebpo_catalogue_held;

/* Runs a query of a model. `context` is a context of this model that no other thread uses
 * meanwhile. */
typedef ebpo_status (*ebpo_catalogue_query)(ebpo_context *context, const ebpo_catalogue_held *model,
                                            void *user, ebpo_error *error);

/* Waits until the memory budget has space for a model, opens the model if necessary, and calls
 * `run_query` with the model. If `surface` is true, opens the file that rays and distances use. If
 * `run_query` fails because the model's share of the budget is too small for several threads, calls
 * it again while no other thread queries the model. Fails with the errors of ebpo/catalogue.h for
 * opening. */
EBPO_MUST_USE ebpo_status ebpo_catalogue_lend(ebpo_catalogue_models *models,
                                              const ebpo_catalogue *c, uint64_t number,
                                              bool surface, ebpo_catalogue_query run_query,
                                              void *user, ebpo_error *error);

/* Returns true if the catalogue has a single model, which is open and completely in memory. */
bool ebpo_catalogue_in_memory(ebpo_catalogue_models *models, const ebpo_catalogue *c);

/* Replaces *face, the index of a face in a part, by the index of this face in the whole model. Does
 * nothing if the catalogue has no such indices, or if *face is EBPO_NO_FACE. */
EBPO_MUST_USE ebpo_status ebpo_catalogue_held_face(const ebpo_catalogue_held *model, uint64_t *face,
                                                   ebpo_error *error);

/* --- face indices of parts: part_numbers.c --- */

/* A .npy file of integers: for each face of a part, the index of this face in the whole model.
 * Indices are read when they are needed. */
typedef struct ebpo_catalogue_numbers {
    const char *path; /* owned by the caller */
    int fd;           /* -1: not open */
    int64_t begin;    /* offset of the first index in the file */
    uint64_t count;   /* number of indices */
    unsigned bytes;   /* bytes of an index: 1, 2, 4 or 8 */
    bool is_signed, big_endian;
} ebpo_catalogue_numbers;

/* Opens the file. Returns EBPO_E_FORMAT if the file is not an array of integers with one dimension.
 * After a failure, no file is open. */
EBPO_MUST_USE ebpo_status ebpo_catalogue_numbers_open(ebpo_catalogue_numbers *f, const char *path,
                                                      ebpo_error *error);
void ebpo_catalogue_numbers_close(ebpo_catalogue_numbers *f);

/* Replaces *face, an index in the part, by the index in the whole model. Returns EBPO_E_FORMAT if
 * the file has no index for this face, or if the index is negative or beyond 2^63; EBPO_E_IO if
 * reading fails. Any thread may call this function. */
EBPO_MUST_USE ebpo_status ebpo_catalogue_numbers_get(const ebpo_catalogue_numbers *f,
                                                     uint64_t *face, ebpo_error *error);

/* --- a range of rows, in one thread; each model is queried once: catalogue_query.c. A row (item)
 * is a point or a ray. A pair consists of an item and a model that is relevant for it --- */

typedef struct ebpo_catalogue_batch {
    const ebpo_catalogue *c;
    ebpo_catalogue_models *models;
    const ebpo_catalogue_query_options *options;
} ebpo_catalogue_batch;

/* When there are at least this number of pairs in memory, their models are queried before further
 * pairs are made. */
enum { EBPO_CATALOGUE_PAIRS = 1 << 21 };

/* The input of a query of one model. */
typedef struct ebpo_catalogue_run {
    uint32_t model; /* index of the model in the catalogue */
    /* [count] pair[i].item is the index of the item whose row is row i */
    const ebpo_catalogue_pair *pair;
    uint64_t count;     /* number of rows */
    const double *rows; /* [count][width] rows of the items */
    void *user;         /* argument `user` of ebpo_catalogue_query_runs */
} ebpo_catalogue_run;

/* Sorts the pairs by model, then by item. Queries each model in `pairs` once, for all items that
 * are paired with it. `rows`: [item][width] rows of all items. The argument `user` of `run_query`
 * is an ebpo_catalogue_run. */
EBPO_MUST_USE ebpo_status ebpo_catalogue_query_runs(const ebpo_catalogue_batch *a,
                                                    ebpo_catalogue_pairs *pairs, const double *rows,
                                                    size_t width, bool surface,
                                                    ebpo_catalogue_query run_query, void *user,
                                                    ebpo_error *error);

/* A function that appends a pair for each box that is relevant for an item. `row`: the row of the
 * item. Returns false when out of memory. */
typedef bool (*ebpo_catalogue_find)(const ebpo_catalogue_boxes *boxes, const double *row,
                                    uint32_t item, ebpo_catalogue_pairs *out);
bool ebpo_catalogue_find_point(const ebpo_catalogue_boxes *boxes, const double *row, uint32_t item,
                               ebpo_catalogue_pairs *out);
bool ebpo_catalogue_find_ray(const ebpo_catalogue_boxes *boxes, const double *row, uint32_t item,
                             ebpo_catalogue_pairs *out);

/* Finds the pairs of all rows by `find`, and queries the models as ebpo_catalogue_query_runs does.
 * `rows`: [count][width]. If `surface` is true, queries only models that rays and distances use. */
EBPO_MUST_USE ebpo_status ebpo_catalogue_query_all(const ebpo_catalogue_batch *a,
                                                   const double *rows, uint32_t count, size_t width,
                                                   ebpo_catalogue_find find, bool surface,
                                                   ebpo_catalogue_query run_query, void *user,
                                                   ebpo_error *error);

/* Returns EBPO_E_ABSENT if all models of the catalogue consist of caps, so that there is no surface
 * for rays and distances. */
EBPO_MUST_USE ebpo_status ebpo_catalogue_need_surface(const ebpo_catalogue *c, ebpo_error *error);

/* --- queries of many rows, by any number of threads: catalogue_query.c --- */

/* A function that processes a range of rows in one thread. A row is a point (3 numbers) or an
 * ebpo_ray (7 numbers). `out` and `model` get the result of each row and the index of its model. */
typedef ebpo_status (*ebpo_catalogue_stretch)(const ebpo_catalogue_batch *a, const double *rows,
                                              uint32_t count, void *out, uint64_t *model,
                                              ebpo_error *error);

typedef struct ebpo_catalogue_job {
    ebpo_catalogue_batch batch;
    ebpo_catalogue_stretch run_query;
    const char *stage;    /* name of the stage, for the progress */
    size_t width, result; /* width: number of doubles in a row; result: bytes of a result */
    bool ordered;         /* true: the rows may be processed in the order of the Morton curve */
    const double *rows;   /* rows that are not processed yet */
    char *out;            /* the results of these rows are stored here */
    /* the index of the model of each result is stored here; NULL: not requested */
    uint64_t *model;
    /* order in which the rows of the current lap (a block of rows that are sorted together) are
     * processed; NULL: the given order */
    const uint32_t *order;
} ebpo_catalogue_job;

EBPO_MUST_USE ebpo_status ebpo_catalogue_query_rows(ebpo_catalogue_job *job, uint64_t count,
                                                    ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_catalogue_take_options(ebpo_catalogue_query_options *own,
                                                      const ebpo_catalogue_query_options *given,
                                                      ebpo_error *error);

/* --- classification of a range of points: catalogue_inside.c --- */

EBPO_MUST_USE ebpo_status ebpo_catalogue_query_inside(const ebpo_catalogue_batch *a,
                                                      const double *rows, uint32_t count, void *out,
                                                      uint64_t *model, ebpo_error *error);

#endif
