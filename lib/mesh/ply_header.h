/* The head of a PLY file: what its elements are made of. Source: Greg Turk, "The PLY Polygon File
 * Format", 1994. */
#ifndef EBPO_MESH_PLY_HEADER_H
#define EBPO_MESH_PLY_HEADER_H

#include <ebpo/base.h>

typedef enum ply_encoding { PLY_ASCII, PLY_LITTLE, PLY_BIG } ply_encoding;
typedef enum ply_type {
    PLY_INT8,
    PLY_UINT8,
    PLY_INT16,
    PLY_UINT16,
    PLY_INT32,
    PLY_UINT32,
    PLY_FLOAT32,
    PLY_FLOAT64
} ply_type;
/* What a property is to us. */
typedef enum ply_role {
    PLY_ROLE_NONE,
    PLY_ROLE_X,
    PLY_ROLE_Y,
    PLY_ROLE_Z,
    PLY_ROLE_CORNERS
} ply_role;
typedef enum ply_kind { PLY_KIND_OTHER, PLY_KIND_VERTEX, PLY_KIND_FACE, PLY_KIND_STRIPS } ply_kind;

/* A word of the header; points into the file's bytes. */
typedef struct ply_word {
    const char *s;
    size_t n;
} ply_word;

typedef struct ply_property {
    ply_word name;
    ply_type type;       /* of the value, or of a list's items */
    ply_type count_type; /* of a list's length */
    bool list;
    ply_role role;
    int attribute; /* number of the array that takes the values, and which column; -1: none */
    unsigned column;
} ply_property;

typedef struct ply_element {
    ply_word name;
    ply_kind kind;
    uint64_t count;
    uint64_t line;              /* in the header, from 1 */
    uint64_t first, properties; /* in ply_header.property */
    uint64_t row_bytes;         /* binary: least size of a row; its size when there is no list */
    bool has_list;
} ply_element;

typedef struct ply_header {
    ply_encoding encoding;
    char line_end;      /* '\n', or '\r' in files from very old systems */
    uint64_t body;      /* offset of the first byte behind the header */
    uint64_t body_line; /* number of the body's first line, from 1 */
    ply_element *element;
    uint64_t elements, element_capacity;
    ply_property *property;
    uint64_t properties, property_capacity;
    int64_t vertex, face, strips; /* element numbers, or -1 */
    uint64_t notes;               /* lines that are comments, or obj_info, or not understood */
} ply_header;

enum { PLY_HEADER_LONGEST = 1 << 20 };

/* Parses the header at the start of `data`; `name` is for messages. The words point into `data`. On
 * failure `out` is empty. Says nothing about counts fitting the file: ebpo_ply_parse_memory checks
 * that. */
EBPO_MUST_USE ebpo_status ebpo_ply_header_parse(ply_header *out, const uint8_t *data, uint64_t size,
                                                const char *name, ebpo_error *error);
void ebpo_ply_header_free(ply_header *header);

/* Returns the end of the line "ply" that the data begin with, where its line end is: it may follow
 * a mark of the order of bytes, and have blanks behind it. NULL: there is no such line. */
const char *ebpo_ply_first_line(const uint8_t *data, uint64_t size, char *line_end);

/* A word for a message: at most 40 characters, what is not printable ASCII becomes '?'. */
enum { PLY_WORD_TEXT = 41 };
void ebpo_ply_word_text(char text[PLY_WORD_TEXT], ply_word word);

/* Bytes of one value in a binary file: 1, 2, 4 or 8. */
unsigned ebpo_ply_type_bytes(ply_type type);

#endif
