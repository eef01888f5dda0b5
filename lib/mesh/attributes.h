/* What a mesh has of numbers beside positions and corners: colours, normals, labels. Arrays of the
 * mesh's vertices and faces, in the order of the source, and of other elements that the source has.
 * format-spec/README.md, "Attributes". One thread. */
#ifndef EBPO_MESH_ATTRIBUTES_H
#define EBPO_MESH_ATTRIBUTES_H

#include <ebpo/mesh.h>

enum {
    EBPO_ATTRIBUTE_COLUMNS = 64,  /* of an array, at most; and items of equal lists */
    EBPO_ATTRIBUTE_ARRAYS = 1000, /* of a mesh */
    EBPO_ATTRIBUTE_NO_LIST = -1,
    EBPO_ATTRIBUTE_HEADER = 1 << 20,   /* bytes of a header */
    EBPO_ATTRIBUTE_ELEMENT_BYTES = 64, /* with the zero behind it */
    EBPO_ATTRIBUTE_NAMES_BYTES = 256
};

typedef struct ebpo_attribute {
    char element[EBPO_ATTRIBUTE_ELEMENT_BYTES];
    char names[EBPO_ATTRIBUTE_NAMES_BYTES]; /* of the columns, one space between them */
    ebpo_attribute_type type;
    int list;         /* the type in which the source states a list's length, or no list */
    uint32_t columns; /* at least 1 */
    uint64_t rows;
    uint8_t *values; /* [rows][columns], of the machine's byte order; or [ends[rows - 1]] */
    uint64_t *ends;  /* [rows] items of the lists up to here; NULL: all as long as `columns` */
    uint64_t row_capacity, item_capacity;
    bool borrowed; /* values and ends are another mesh's, which frees them */
} ebpo_attribute;

/* The struct and its arrays, which the workspace owns. */
typedef struct ebpo_attributes {
    ebpo_workspace *workspace;
    ebpo_attribute *array;
    uint64_t count, capacity;
    char *header; /* malloc's; NULL: none */
    uint64_t header_bytes;
    char lost[400]; /* what the source has and this has not, in words; "": nothing */
    /* what reading the mesh itself left out, or did not find; told also where no attributes were
     * asked for */
    char unread[400];
} ebpo_attributes;

/* NULL when memory is short. */
ebpo_attributes *ebpo_attributes_make(ebpo_workspace *workspace);
void ebpo_attributes_free(ebpo_attributes *attributes); /* NULL: nothing */

/* Gives a mesh attributes where it has none, so that something can be noted. EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_mesh_need_attributes(ebpo_mesh *mesh, ebpo_error *error);

/* Whether there is anything to keep. */
static inline bool ebpo_attributes_hold(const ebpo_attributes *attributes)
{
    return attributes && (attributes->count || attributes->header);
}

/* Bytes of a value: 1, 2, 4 or 8. Its name, as in files; the type of a name, or -1. */
unsigned ebpo_attribute_bytes(ebpo_attribute_type type);
const char *ebpo_attribute_type_name(ebpo_attribute_type type);
int ebpo_attribute_type_of(const char *name);

static inline bool ebpo_attribute_is_float(ebpo_attribute_type type)
{
    return type >= EBPO_ATTRIBUTE_FLOAT32;
}

bool ebpo_attribute_is_of(const ebpo_attribute *a, const char *element);
/* Of a mesh's vertices or faces: what is cut and sorted with them. */
bool ebpo_attribute_is_of_mesh(const ebpo_attribute *a);
/* Of images that the source names: mesh/textures.h. */
#define EBPO_TEXTURE_ELEMENT "ebpo:texture"
bool ebpo_attribute_is_of_textures(const ebpo_attribute *a);

/* Bytes of a row of values; 0: lists of different lengths. */
static inline uint64_t ebpo_attribute_row_bytes(const ebpo_attribute *a)
{
    return a->ends ? 0 : a->columns * (uint64_t)ebpo_attribute_bytes(a->type);
}
/* Values of an array. */
static inline uint64_t ebpo_attribute_value_count(const ebpo_attribute *a)
{
    return !a->ends ? a->rows * a->columns : a->rows ? a->ends[a->rows - 1] : 0;
}

/* A new array of `rows` rows without values; NULL when there are too many or memory is short. */
ebpo_attribute *ebpo_attributes_add(ebpo_attributes *to, const ebpo_attribute *like);
void ebpo_attributes_remove(ebpo_attributes *from, uint64_t index);

/* Removes those of other elements than vertices, faces and textures; NULL: nothing. */
void ebpo_attributes_drop_others(ebpo_attributes *from);

/* Room for more rows, and for more items of lists. */
bool ebpo_attribute_reserve(ebpo_workspace *workspace, ebpo_attribute *a, uint64_t rows,
                            uint64_t items);

/* Notes that something cannot be kept: a sentence's part, such as "property x of vertex". */
void ebpo_attributes_lose(ebpo_attributes *attributes, const char *format, ...) EBPO_PRINTF(2, 3);
/* Notes what reading left out: a sentence, without a full stop. */
void ebpo_attributes_note_unread(ebpo_attributes *attributes, const char *format, ...)
    EBPO_PRINTF(2, 3);
/* "what: count", unless that is 0. */
void ebpo_attributes_count_unread(ebpo_attributes *attributes, const char *what, uint64_t count);

/* The arrays of an element are made anew of `count` rows: row i is what row rows[i] was; zeros and
 * empty lists where there was no such row. EBPO_E_MEMORY, EBPO_E_IO. */
EBPO_MUST_USE ebpo_status ebpo_attributes_pick(ebpo_attributes *attributes, const char *element,
                                               const uint32_t *rows, uint64_t count,
                                               ebpo_error *error);

/* Of an element only `count` rows stay, those that `rows` names in ascending order; cannot
 * fail, as it takes no memory. */
void ebpo_attributes_keep(ebpo_attributes *attributes, const char *element, const uint32_t *rows,
                          uint64_t count);

/* Whether row i of an array is row k of another one (or the same) of its type, bit for bit. */
bool ebpo_attribute_same_row(const ebpo_attribute *a, uint64_t i, const ebpo_attribute *b,
                             uint64_t k);

/* Whether two rows of an element have the same values, bit for bit. */
bool ebpo_attributes_equal_rows(const ebpo_attributes *attributes, const char *element, uint64_t a,
                                uint64_t b);

/* Lists that are all of one length, of 1 to EBPO_ATTRIBUTE_COLUMNS items, become columns. */
void ebpo_attribute_even_out(ebpo_workspace *workspace, ebpo_attribute *a);

/* How many of the first `columns` of these names go together, as red green blue do: at least 1. */
typedef struct ebpo_attribute_name {
    const char *s;
    size_t n;
} ebpo_attribute_name;
unsigned ebpo_attribute_names_together(const ebpo_attribute_name *names, unsigned count);

/* The value of this type that stands there, at any address: exact. */
double ebpo_attribute_number(const uint8_t *at, ebpo_attribute_type type);

/* Least and greatest value, NaN aside; false: there is none. */
bool ebpo_attribute_range(const ebpo_attribute *a, ebpo_workspace *workspace, double range[2]);

/* The same values, borrowed from `from` until they are picked; NULL of NULL. EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_attributes_borrow(ebpo_attributes **out, const ebpo_attributes *from,
                                                 ebpo_error *error);

/* A copy in another workspace; NULL of NULL. */
EBPO_MUST_USE ebpo_status ebpo_attributes_copy(ebpo_attributes **out, const ebpo_attributes *from,
                                               ebpo_workspace *workspace, ebpo_error *error);

/* Which columns of a mesh's attributes are colours, and these as bytes, a value at a time. */

enum { EBPO_COLOUR_CHANNELS = 4 }; /* red, green, blue; alpha is there or not */

/* A column of an array of numbers; `of` NULL: there is none. */
typedef struct ebpo_colour_column {
    const ebpo_attribute *of;
    uint32_t column;
} ebpo_colour_column;

/* Of "vertex" or "face"; false: there is no red, green and blue. `in` NULL has none. */
bool ebpo_colour_columns(const ebpo_attributes *in, const char *element,
                         ebpo_colour_column out[EBPO_COLOUR_CHANNELS]);

/* As ebpo_mesh_colours says. The row must be there. */
uint8_t ebpo_colour_byte(const ebpo_colour_column *column, uint64_t row);

/* Whether vertices or faces have colours. */
bool ebpo_attributes_coloured(const ebpo_attributes *in);

#endif
