/* Defines what the files of lib/catalogue share: the catalogue, open models that threads share, and
 * queries of several models. */
#ifndef EBPO_CATALOGUE_CATALOGUE_IN_H
#define EBPO_CATALOGUE_CATALOGUE_IN_H

#include <ebpo/catalogue.h>

#include "catalogue/catalogue_boxes.h"

/* --- a catalogue: catalogue_file.c --- */

struct ebpo_catalogue {
    char *path; /* path of the catalogue file that was read; NULL: made from an array */
    uint64_t file_bytes, file_hash;      /* size and hash of this file */
    uint64_t count;                      /* number of models, at least 1, at most 2^32 - 2 */
    ebpo_catalogue_entry *entry;         /* [count] the catalogue owns the texts of the entries */
    ebpo_catalogue_options how;          /* options; `folder` is not set */
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

/* Runs a query. The context is one of the model, and belongs to the calling thread. */
typedef ebpo_status (*ebpo_catalogue_query)(ebpo_context *context, const ebpo_catalogue_held *model,
                                            void *user, ebpo_error *error);

/* Waits until the budget has space for a model, opens the model if necessary, and calls `run_query`
 * with it. If `surface` is true, the model is the part that rays and distances use. If the model's
 * share of the budget is too small for several threads, calls `run_query` again while no other
 * thread queries the model. Fails with the errors of ebpo/catalogue.h for opening. */
EBPO_MUST_USE ebpo_status ebpo_catalogue_lend(ebpo_catalogue_models *models,
                                              const ebpo_catalogue *c, uint64_t number,
                                              bool surface, ebpo_catalogue_query run_query,
                                              void *user, ebpo_error *error);

/* Returns true if the catalogue has a single model, which is open and completely in memory. */
bool ebpo_catalogue_in_memory(ebpo_catalogue_models *models, const ebpo_catalogue *c);

/* Converts the index of a part's face to its index in the whole model, if the catalogue has such
 * indices; *face may be EBPO_NO_FACE. */
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

/* --- queries of each model once, by one thread: catalogue_query.c --- */

typedef struct ebpo_catalogue_batch {
    const ebpo_catalogue *c;
    ebpo_catalogue_models *models;
    const ebpo_catalogue_query_options *options;
} ebpo_catalogue_batch;

/* When at least this number of pairs is in memory, their models are queried before the pairs of
 * further items are added. */
enum { EBPO_CATALOGUE_PAIRS = 1 << 21 };

/* The input of a query of one model. */
typedef struct ebpo_catalogue_run {
    uint32_t model;                  /* index of the model in the catalogue */
    const ebpo_catalogue_pair *pair; /* [count] pair[i].item: index of the item of row i */
    uint64_t count;                  /* number of rows */
    const double *rows;              /* [count][width] rows of the items */
    void *user;                      /* argument `user` of ebpo_catalogue_query_runs */
} ebpo_catalogue_run;

/* Sorts the pairs by model, then by item. Queries each model in `pairs` once, for the rows of its
 * items. The argument `user` of `run_query` is an ebpo_catalogue_run. */
EBPO_MUST_USE ebpo_status ebpo_catalogue_query_runs(const ebpo_catalogue_batch *a,
                                                    ebpo_catalogue_pairs *pairs, const double *rows,
                                                    size_t width, bool surface,
                                                    ebpo_catalogue_query run_query, void *user,
                                                    ebpo_error *error);

/* Appends a pair for each box that is relevant for an item. `row`: the row of the item. Returns
 * false when out of memory. */
typedef bool (*ebpo_catalogue_find)(const ebpo_catalogue_boxes *boxes, const double *row,
                                    uint32_t item, ebpo_catalogue_pairs *out);
bool ebpo_catalogue_find_point(const ebpo_catalogue_boxes *boxes, const double *row, uint32_t item,
                               ebpo_catalogue_pairs *out);
bool ebpo_catalogue_find_ray(const ebpo_catalogue_boxes *boxes, const double *row, uint32_t item,
                             ebpo_catalogue_pairs *out);

/* Finds the pairs of each of rows[count] with `find`, and queries the models as
 * ebpo_catalogue_query_runs does. If `surface` is true, queries only models that rays and distances
 * use. */
EBPO_MUST_USE ebpo_status ebpo_catalogue_query_all(const ebpo_catalogue_batch *a,
                                                   const double *rows, uint32_t count, size_t width,
                                                   ebpo_catalogue_find find, bool surface,
                                                   ebpo_catalogue_query run_query, void *user,
                                                   ebpo_error *error);

/* Returns EBPO_E_ABSENT if all models of the catalogue consist of caps, so that there is no surface
 * for rays and distances. */
EBPO_MUST_USE ebpo_status ebpo_catalogue_need_surface(const ebpo_catalogue *c, ebpo_error *error);

/* --- queries of many rows, by any number of threads: catalogue_query.c --- */

/* Processes a range of rows in one thread. A row is a point, or the numbers of an ebpo_ray. */
typedef ebpo_status (*ebpo_catalogue_stretch)(const ebpo_catalogue_batch *a, const double *rows,
                                              uint32_t count, void *out, uint64_t *model,
                                              ebpo_error *error);

typedef struct ebpo_catalogue_job {
    ebpo_catalogue_batch batch;
    ebpo_catalogue_stretch run_query;
    const char *stage;    /* name of the stage, for the progress */
    size_t width, result; /* width: number of doubles in a row; result: bytes of a result */
    bool ordered;         /* true: rows are points, which may be processed along the Morton curve */
    const double *rows;   /* rows that are not processed yet */
    char *out;            /* receives the results of these rows */
    uint64_t *model;      /* receives the index of the model of each result; NULL: not requested */
    /* order in which the rows of the current lap are processed; NULL: the given order */
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
