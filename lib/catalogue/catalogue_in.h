/* Defines what the files of lib/catalogue share: the catalogue, open models that threads share, and
 * queries of several models. */
#ifndef EBPO_CATALOGUE_CATALOGUE_IN_H
#define EBPO_CATALOGUE_CATALOGUE_IN_H

#include <ebpo/catalogue.h>

#include "catalogue/catalogue_boxes.h"

/* --- a catalogue: catalogue_file.c --- */

struct ebpo_catalogue {
    char *path; /* path of the file that was read, or NULL */
    uint64_t file_bytes, file_hash;
    uint64_t count;                      /* at least 1, at most 2^32 - 2 */
    ebpo_catalogue_entry *entry;         /* the catalogue owns the texts of the entries */
    ebpo_catalogue_options how;          /* options; `folder` is not set */
    ebpo_catalogue_boxes all, seen;      /* boxes of all models; boxes of the models that rays and
                                          * distances use */
    const ebpo_catalogue_entry *surface; /* the first model without an inside; NULL: all have one */
};

/* Names of the values of ebpo_rule in catalogue files. */
extern const char *const ebpo_catalogue_rules[];

/* Returns the catalogue's name in messages. */
const char *ebpo_catalogue_shown(const ebpo_catalogue *c);

/* --- open models: open_models.c --- */

/* An open model, lent to a thread. */
typedef struct ebpo_catalogue_held ebpo_catalogue_held;

/* Runs a query, in a context of the model that belongs to the calling thread. */
typedef ebpo_status (*ebpo_catalogue_query)(ebpo_context *context, const ebpo_catalogue_held *model,
                                            void *user, ebpo_error *error);

/* Calls `run_query` with a model (with `surface`: with the model's part that rays and distances
 * use) when memory is available. If the model's budget is too small for several threads, calls
 * `run_query` again while no other thread queries the model. Fails with the errors of
 * ebpo/catalogue.h for opening. */
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

/* Opens the file. Returns EBPO_E_FORMAT if it is not an array of integers with one dimension. After
 * a failure, and after ebpo_catalogue_numbers_close, no file is open. */
EBPO_MUST_USE ebpo_status ebpo_catalogue_numbers_open(ebpo_catalogue_numbers *f, const char *path,
                                                      ebpo_error *error);
void ebpo_catalogue_numbers_close(ebpo_catalogue_numbers *f);

/* Replaces *face, an index in the part, by the index in the whole model. Returns EBPO_E_FORMAT if
 * the file has no index for this face, or if the index is negative or beyond 2^63; EBPO_E_IO. May
 * be called by any thread. */
EBPO_MUST_USE ebpo_status ebpo_catalogue_numbers_get(const ebpo_catalogue_numbers *f,
                                                     uint64_t *face, ebpo_error *error);

/* --- queries of each model once, by one thread: catalogue_query.c --- */

typedef struct ebpo_catalogue_batch {
    const ebpo_catalogue *c;
    ebpo_catalogue_models *models;
    const ebpo_catalogue_query_options *options;
} ebpo_catalogue_batch;

/* No further query is added when this number of pairs is in memory. */
enum { EBPO_CATALOGUE_PAIRS = 1 << 21 };

/* Input for one model: rows[count][width]; pair[i].item is the index of the query of row i. */
typedef struct ebpo_catalogue_run {
    uint32_t model;
    const ebpo_catalogue_pair *pair;
    uint64_t count;
    const double *rows;
    void *user;
} ebpo_catalogue_run;

/* Queries each model of `pairs` (sorted by model, then by query) once, for the rows of its items.
 * The callback gets an ebpo_catalogue_run as its `user`; the run has the `user` given here. */
EBPO_MUST_USE ebpo_status ebpo_catalogue_query_runs(const ebpo_catalogue_batch *a,
                                                    ebpo_catalogue_pairs *pairs, const double *rows,
                                                    size_t width, bool surface,
                                                    ebpo_catalogue_query run_query, void *user,
                                                    ebpo_error *error);

/* Appends a pair for each box that is relevant for an item, given the item's row. Returns false
 * when memory is short. */
typedef bool (*ebpo_catalogue_find)(const ebpo_catalogue_boxes *boxes, const double *row,
                                    uint32_t item, ebpo_catalogue_pairs *out);
bool ebpo_catalogue_find_point(const ebpo_catalogue_boxes *boxes, const double *row, uint32_t item,
                               ebpo_catalogue_pairs *out);
bool ebpo_catalogue_find_ray(const ebpo_catalogue_boxes *boxes, const double *row, uint32_t item,
                             ebpo_catalogue_pairs *out);

/* Same as ebpo_catalogue_query_runs, for rows[count]: `find` appends the pairs of each row. With
 * `surface`, only models that rays and distances use are queried. */
EBPO_MUST_USE ebpo_status ebpo_catalogue_query_all(const ebpo_catalogue_batch *a,
                                                   const double *rows, uint32_t count, size_t width,
                                                   ebpo_catalogue_find find, bool surface,
                                                   ebpo_catalogue_query run_query, void *user,
                                                   ebpo_error *error);

/* Returns EBPO_E_ABSENT if no model of the catalogue has a surface for rays and distances: all are
 * caps. */
EBPO_MUST_USE ebpo_status ebpo_catalogue_need_surface(const ebpo_catalogue *c, ebpo_error *error);

/* --- queries of many rows, by any number of threads: catalogue_query.c --- */

/* Processes a range of rows in one thread. A row is a point, or the numbers of an ebpo_ray. */
typedef ebpo_status (*ebpo_catalogue_stretch)(const ebpo_catalogue_batch *a, const double *rows,
                                              uint32_t count, void *out, uint64_t *model,
                                              ebpo_error *error);

typedef struct ebpo_catalogue_job {
    ebpo_catalogue_batch batch;
    ebpo_catalogue_stretch run_query;
    const char *stage;
    size_t width, result; /* numbers in a row; bytes of a result */
    bool ordered; /* true if rows are points, which may be processed along the Morton curve */
    /* rows and results of the remaining queries */
    const double *rows;
    char *out;
    uint64_t *model; /* the model of each result; or NULL */
    /* order of the rows of the current lap; set while the rows are processed */
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
