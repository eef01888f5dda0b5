/* Changes a file through libhdf5, for vectors that the library does not write. A failure ends the
 * program. */
#ifndef CHANGE_FILE_H
#define CHANGE_FILE_H

#include <hdf5.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

extern hid_t changed; /* the copy that is being changed */

_Noreturn void die(const char *what, const char *why);
void need(bool ok, const char *what);

uint8_t *slurp(const char *path, size_t *size);
void spill(const char *path, const void *data, size_t size);

/* Opens the file as `changed`, calls `change`, closes it. */
void change_objects(const char *path, void (*change)(void));

void set_text(const char *object, const char *name, const char *text);
/* `size`: bytes of the type, or H5T_VARIABLE; `padding`: one of H5T_STR_. */
void set_text_as(const char *object, const char *name, const char *text, size_t size,
                 H5T_str_t padding);
void set_int(const char *object, const char *name, int64_t value);
void set_count(const char *object, const char *name, int64_t value);
void set_reals(const char *name, double a, double b, double c);
/* Sets one dimension of one value, in place of a scalar or of another type. */
void set_row(const char *object, const char *name, hid_t type, int64_t value);
uint64_t count_of(const char *object, const char *name);
void add_count(const char *object, const char *name, uint64_t value);
void drop_attribute(const char *object, const char *name);
void drop(const char *path);

/* Sets one value of an array, counted row by row. */
void poke(const char *path, unsigned at, int64_t value);

/* An array that replaces another, whose coding and about it keeps. */
typedef struct new_array {
    hid_t type;
    hsize_t rows, cols, chunk; /* cols 0: one dimension; chunk 0: contiguous */
    bool unlimited, unwritten;
    void (*filters)(hid_t);
    const int64_t *values; /* NULL: zeros */
} new_array;
void replace(const char *path, new_array a);
/* Adds to one value of an array. */
void add_to(const char *path, unsigned at, int64_t by);
/* Adds a number to an object; sets the six numbers of an attribute of the root. */
void set_real(const char *object, const char *name, double value);
void get_text(const char *object, const char *name, char *text, size_t size);
void add_real(const char *object, const char *name, double value);
void set_six(const char *name, const double values[6]);
/* Adds an array at a new path, without attributes. */
void add_array(const char *path, new_array a);
/* Writes the same values with other filters: of at most 256 elements. */
void refilter(const char *path, void (*filters)(hid_t));
void checksum(hid_t dcpl); /* filters: fletcher32 */
void scale_offset(hid_t dcpl);

haddr_t chunk_address(const char *path, hsize_t *size);

/* Updates content_sha256 for the current arrays. */
void state_content(void);

#endif
