/* Stores the attributes of a mesh: numeric data beyond positions and corners, such as colours,
 * normals and labels. Each array belongs to an *element* of the source file. As in PLY files, an
 * element is a list of equal items: the vertices, the faces, or another list. Rows are in the order
 * of the source. Specification: format-spec/attributes.md. For use by one thread. */
#ifndef EBPO_MESH_ATTRIBUTES_H
#define EBPO_MESH_ATTRIBUTES_H

#include <ebpo/mesh.h>

enum {
    EBPO_ATTRIBUTE_COLUMNS =
        64, /* greatest number of columns, and of items in lists that become columns */
    EBPO_ATTRIBUTE_ARRAYS = 1000, /* greatest number of arrays of a mesh */
    EBPO_ATTRIBUTE_NO_LIST = -1,
    EBPO_ATTRIBUTE_HEADER = 1 << 20,   /* greatest size of a source file's header in bytes */
    EBPO_ATTRIBUTE_ELEMENT_BYTES = 64, /* including the terminating zero */
    EBPO_ATTRIBUTE_NAMES_BYTES = 256   /* including the terminating zero */
};

typedef struct ebpo_attribute {
    char element[EBPO_ATTRIBUTE_ELEMENT_BYTES]; /* "vertex", "face", ... */
    char names[EBPO_ATTRIBUTE_NAMES_BYTES];     /* names of the columns, separated by one space */
    ebpo_attribute_type type;
    int list;         /* type of a list length in the source, or EBPO_ATTRIBUTE_NO_LIST */
    uint32_t columns; /* at least 1 */
    uint64_t rows;
    uint8_t *values; /* [rows][columns] in native byte order; for lists [ends[rows - 1]] */
    /* [rows] number of list items up to the end of each row; NULL: each row has `columns` items */
    uint64_t *ends;
    uint64_t row_capacity, item_capacity; /* rows, and list items, for which there is space */
    bool borrowed; /* values and ends belong to another mesh, which frees them */
} ebpo_attribute;

/* Free the struct with ebpo_attributes_free. The workspace owns the values and the ends of the
 * arrays. */
typedef struct ebpo_attributes {
    ebpo_workspace *workspace;
    ebpo_attribute *array;
    uint64_t count, capacity;
    char *header; /* header of the source file, from malloc; NULL: none */
    uint64_t header_bytes;
    char lost[400]; /* description of source data that are not kept; "": none */
    /* description of data that the mesh reader omitted or did not find; set even if attributes are
     * not requested */
    char unread[400];
} ebpo_attributes;

/* Makes empty attributes. Returns NULL when out of memory. */
ebpo_attributes *ebpo_attributes_make(ebpo_workspace *workspace);
void ebpo_attributes_free(ebpo_attributes *attributes); /* accepts NULL */

/* Adds empty attributes to a mesh that has none, so that notes can be stored. EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_mesh_need_attributes(ebpo_mesh *mesh, ebpo_error *error);

/* Returns true if there are arrays or a header. */
static inline bool ebpo_attributes_hold(const ebpo_attributes *attributes)
{
    return attributes && (attributes->count || attributes->header);
}

/* ebpo_attribute_bytes returns the size of a value (1, 2, 4 or 8). ebpo_attribute_type_name returns
 * the name of a type in files. ebpo_attribute_type_of returns the type with a name, or -1. */
unsigned ebpo_attribute_bytes(ebpo_attribute_type type);
const char *ebpo_attribute_type_name(ebpo_attribute_type type);
int ebpo_attribute_type_of(const char *name);

static inline bool ebpo_attribute_is_float(ebpo_attribute_type type)
{
    return type >= EBPO_ATTRIBUTE_FLOAT32;
}

/* Returns true if the array belongs to this element. */
bool ebpo_attribute_is_of(const ebpo_attribute *a, const char *element);
/* Returns true for attributes of the mesh's vertices or faces, which are selected and sorted
 * together with the vertices or faces. */
bool ebpo_attribute_is_of_mesh(const ebpo_attribute *a);
/* The element for images that the source names (mesh/textures.h). */
#define EBPO_TEXTURE_ELEMENT "ebpo:texture"
bool ebpo_attribute_is_of_textures(const ebpo_attribute *a);

/* Returns the bytes of a row of values; 0 for lists of different lengths. */
static inline uint64_t ebpo_attribute_row_bytes(const ebpo_attribute *a)
{
    return a->ends ? 0 : a->columns * (uint64_t)ebpo_attribute_bytes(a->type);
}
/* Returns the number of values of an array. */
static inline uint64_t ebpo_attribute_value_count(const ebpo_attribute *a)
{
    return !a->ends ? a->rows * a->columns : a->rows ? a->ends[a->rows - 1] : 0;
}

/* Adds an array with the names and types of `like`, without values. Returns NULL when there are too
 * many arrays, or when out of memory. */
ebpo_attribute *ebpo_attributes_add(ebpo_attributes *to, const ebpo_attribute *like);
void ebpo_attributes_remove(ebpo_attributes *from, uint64_t index);

/* Removes the arrays of elements other than vertices, faces and textures. Accepts NULL. */
void ebpo_attributes_drop_others(ebpo_attributes *from);

/* Reserves space for `rows` rows and `items` list items. Returns false when out of memory. */
bool ebpo_attribute_reserve(ebpo_workspace *workspace, ebpo_attribute *a, uint64_t rows,
                            uint64_t items);

/* Records source data that the attributes cannot store, as a phrase such as "property x of vertex".
 */
void ebpo_attributes_lose(ebpo_attributes *attributes, const char *format, ...) EBPO_PRINTF(2, 3);
/* Records data that reading omitted, as a sentence without a full stop. */
void ebpo_attributes_note_unread(ebpo_attributes *attributes, const char *format, ...)
    EBPO_PRINTF(2, 3);
/* Records "what: count", unless count is 0. */
void ebpo_attributes_count_unread(ebpo_attributes *attributes, const char *what, uint64_t count);

/* Replaces the arrays of an element by `count` rows: row i is the old row rows[i]; if that row does
 * not exist, row i has zeros and empty lists. EBPO_E_MEMORY, EBPO_E_IO. */
EBPO_MUST_USE ebpo_status ebpo_attributes_pick(ebpo_attributes *attributes, const char *element,
                                               const uint32_t *rows, uint64_t count,
                                               ebpo_error *error);

/* Keeps only the `count` rows of an element that are listed in `rows`, ascending. Cannot fail,
 * because it needs no memory. */
void ebpo_attributes_keep(ebpo_attributes *attributes, const char *element, const uint32_t *rows,
                          uint64_t count);

/* Returns true if row i of an array equals row k of an array of the same type (which may be the
 * same array), bit for bit. */
bool ebpo_attribute_same_row(const ebpo_attribute *a, uint64_t i, const ebpo_attribute *b,
                             uint64_t k);

/* Returns true if two rows of an element have equal values, bit for bit. */
bool ebpo_attributes_equal_rows(const ebpo_attributes *attributes, const char *element, uint64_t a,
                                uint64_t b);

/* Converts lists of equal length, from 1 to EBPO_ATTRIBUTE_COLUMNS items, to columns. */
void ebpo_attribute_even_out(ebpo_workspace *workspace, ebpo_attribute *a);

/* A name; not terminated by zero. */
typedef struct ebpo_attribute_name {
    const char *s;
    size_t n;
} ebpo_attribute_name;
/* Returns the number of leading names that form a group, such as red green blue: at least 1. */
unsigned ebpo_attribute_names_together(const ebpo_attribute_name *names, unsigned count);

/* Returns the value of this type at `at`, exactly; `at` need not be aligned. */
double ebpo_attribute_number(const uint8_t *at, ebpo_attribute_type type);

/* Finds the least and greatest value, ignoring NaN. Returns false if no value is a number. */
bool ebpo_attribute_range(const ebpo_attribute *a, ebpo_workspace *workspace, double range[2]);

/* Creates attributes whose values are borrowed from `from` until rows are selected. If `from` is
 * NULL, *out is NULL. EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_attributes_borrow(ebpo_attributes **out, const ebpo_attributes *from,
                                                 ebpo_error *error);

/* Copies attributes into another workspace. If `from` is NULL, *out is NULL. */
EBPO_MUST_USE ebpo_status ebpo_attributes_copy(ebpo_attributes **out, const ebpo_attributes *from,
                                               ebpo_workspace *workspace, ebpo_error *error);

enum { EBPO_COLOUR_CHANNELS = 4 }; /* red, green, blue and an optional alpha */

/* A column of a numeric array. */
typedef struct ebpo_colour_column {
    const ebpo_attribute *of; /* the array; NULL: the mesh has no such column */
    uint32_t column;
} ebpo_colour_column;

/* Finds the colour columns of "vertex" or "face". Returns false if red, green or blue is missing,
 * or `in` is NULL. */
bool ebpo_colour_columns(const ebpo_attributes *in, const char *element,
                         ebpo_colour_column out[EBPO_COLOUR_CHANNELS]);

/* Converts a value to a byte, as described at ebpo_mesh_colours. The row must exist. */
uint8_t ebpo_colour_byte(const ebpo_colour_column *column, uint64_t row);

/* Returns true if vertices or faces have colours. */
bool ebpo_attributes_coloured(const ebpo_attributes *in);

#endif
