/* What the files of lib/catalogue share: the list of entries, and models that are lent to it. */
#ifndef EBPO_CATALOGUE_CATALOGUE_IN_H
#define EBPO_CATALOGUE_CATALOGUE_IN_H

#include <ebpo/catalogue.h>

#include "catalogue/catalogue_boxes.h"

/* --- a catalogue: catalogue_file.c --- */

struct ebpo_catalogue {
    char *path; /* of the file that was read, or NULL */
    uint64_t file_bytes, file_hash;
    uint64_t count;                      /* at least 1, less than 2^32 - 1 */
    ebpo_catalogue_entry *entry;         /* whose texts are the catalogue's */
    ebpo_catalogue_options how;          /* without `folder` */
    ebpo_catalogue_boxes all, seen;      /* of all models; of those that rays and distances see */
    const ebpo_catalogue_entry *surface; /* the first that has no inside; NULL: all have */
};

/* The words of files for an ebpo_rule. */
extern const char *const ebpo_catalogue_rules[];

/* How messages name it. */
const char *ebpo_catalogue_shown(const ebpo_catalogue *c);

/* --- open models: open_models.c --- */

/* A model that is open, lent to who asks it. */
typedef struct ebpo_catalogue_held ebpo_catalogue_held;

/* Asks with a context of the model that is its thread's. */
typedef ebpo_status (*ebpo_catalogue_question)(ebpo_context *context,
                                               const ebpo_catalogue_held *model, void *user,
                                               ebpo_error *error);

/* Asks a model, or what rays and distances see of it, when there is room. Where its budget does not
 * do for several threads, `ask` is called again, alone. The errors of ebpo/catalogue.h for opening.
 */
EBPO_MUST_USE ebpo_status ebpo_catalogue_lend(ebpo_catalogue_models *models,
                                              const ebpo_catalogue *c, uint64_t number,
                                              bool surface, ebpo_catalogue_question ask, void *user,
                                              ebpo_error *error);

/* True: the catalogue has one model, which is open and all in memory. */
bool ebpo_catalogue_in_memory(ebpo_catalogue_models *models, const ebpo_catalogue *c);

/* A face's number in the whole, where the catalogue tells it; *face may be EBPO_NO_FACE. */
EBPO_MUST_USE ebpo_status ebpo_catalogue_held_face(const ebpo_catalogue_held *model, uint64_t *face,
                                                   ebpo_error *error);

/* --- numbers of faces: part_numbers.c --- */

/* Numbers of faces in the whole, of a part: a .npy of integers, read where they are wanted. */
typedef struct ebpo_catalogue_numbers {
    const char *path; /* the caller's */
    int fd;           /* -1: none is open */
    int64_t begin;
    uint64_t count;
    unsigned bytes; /* of a number: 1, 2, 4 or 8 */
    bool is_signed, big_endian;
} ebpo_catalogue_numbers;

/* EBPO_E_FORMAT: it cannot be read as an array of integers with one dimension. Then, and after
 * ebpo_catalogue_numbers_close, it is not open. */
EBPO_MUST_USE ebpo_status ebpo_catalogue_numbers_open(ebpo_catalogue_numbers *f, const char *path,
                                                      ebpo_error *error);
void ebpo_catalogue_numbers_close(ebpo_catalogue_numbers *f);

/* The number at place *face, into *face. EBPO_E_FORMAT: there is no such number, or it is negative
 * or beyond 2^63; EBPO_E_IO. Threads: any. */
EBPO_MUST_USE ebpo_status ebpo_catalogue_numbers_get(const ebpo_catalogue_numbers *f,
                                                     uint64_t *face, ebpo_error *error);

/* --- each model once, by one thread: catalogue_ask.c --- */

typedef struct ebpo_catalogue_asker {
    const ebpo_catalogue *c;
    ebpo_catalogue_models *models;
    const ebpo_catalogue_ask_options *options;
} ebpo_catalogue_asker;

/* Pairs that are in memory at a time, but for those of one question. */
enum { EBPO_CATALOGUE_PAIRS = 1 << 21 };

/* What a model is asked: rows[count][width] and of which questions they are, pair[].item. */
typedef struct ebpo_catalogue_run {
    uint32_t model;
    const ebpo_catalogue_pair *pair;
    uint64_t count;
    const double *rows;
    void *user;
} ebpo_catalogue_run;

/* Asks each model of `pairs` (which are sorted, by model and question) once, about rows[item]; the
 * question's `user` is a run, which has `user`. */
EBPO_MUST_USE ebpo_status ebpo_catalogue_ask_runs(const ebpo_catalogue_asker *a,
                                                  ebpo_catalogue_pairs *pairs, const double *rows,
                                                  size_t width, bool surface,
                                                  ebpo_catalogue_question ask, void *user,
                                                  ebpo_error *error);

/* Appends the pairs of an item, whose row is given; false: not enough memory. */
typedef bool (*ebpo_catalogue_find)(const ebpo_catalogue_boxes *boxes, const double *row,
                                    uint32_t item, ebpo_catalogue_pairs *out);
bool ebpo_catalogue_find_point(const ebpo_catalogue_boxes *boxes, const double *row, uint32_t item,
                               ebpo_catalogue_pairs *out);
bool ebpo_catalogue_find_ray(const ebpo_catalogue_boxes *boxes, const double *row, uint32_t item,
                             ebpo_catalogue_pairs *out);

/* The same about rows[count], of which `find` says which boxes (`seen`, if `surface`) they come to.
 */
EBPO_MUST_USE ebpo_status ebpo_catalogue_ask_all(const ebpo_catalogue_asker *a, const double *rows,
                                                 uint32_t count, size_t width,
                                                 ebpo_catalogue_find find, bool surface,
                                                 ebpo_catalogue_question ask, void *user,
                                                 ebpo_error *error);

/* EBPO_E_ABSENT: the catalogue tells of caps alone. */
EBPO_MUST_USE ebpo_status ebpo_catalogue_need_surface(const ebpo_catalogue *c, ebpo_error *error);

/* --- many rows, by any number of threads: catalogue_ask.c --- */

/* Asks about a stretch of rows, which are points, or as an ebpo_ray, in one thread. */
typedef ebpo_status (*ebpo_catalogue_stretch)(const ebpo_catalogue_asker *a, const double *rows,
                                              uint32_t count, void *out, uint64_t *model,
                                              ebpo_error *error);

typedef struct ebpo_catalogue_job {
    ebpo_catalogue_asker asker;
    ebpo_catalogue_stretch ask;
    const char *stage;
    size_t width, result; /* numbers of a row; bytes of an answer */
    bool ordered;         /* along the curve: rows are points */
    const double *rows;   /* of the questions that are left, as are the two below */
    char *out;
    uint64_t *model;       /* or NULL */
    const uint32_t *order; /* set while rows are asked */
} ebpo_catalogue_job;

EBPO_MUST_USE ebpo_status ebpo_catalogue_ask_rows(ebpo_catalogue_job *job, uint64_t count,
                                                  ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_catalogue_take_options(ebpo_catalogue_ask_options *own,
                                                      const ebpo_catalogue_ask_options *given,
                                                      ebpo_error *error);

/* --- where a stretch of points is: catalogue_inside.c --- */

EBPO_MUST_USE ebpo_status ebpo_catalogue_ask_inside(const ebpo_catalogue_asker *a,
                                                    const double *rows, uint32_t count, void *out,
                                                    uint64_t *model, ebpo_error *error);

#endif
