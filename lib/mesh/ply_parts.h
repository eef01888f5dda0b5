/* The head of a PLY file: what its elements are made of. Source: Greg Turk, "The PLY Polygon File
 * Format", 1994. */
#ifndef EBPO_MESH_PLY_PARTS_H
#define EBPO_MESH_PLY_PARTS_H

#include <locale.h>

#include <ebpo/base.h>
#include <ebpo/mesh.h>

#include "mesh/attributes.h"
#include "mesh/import_build.h"

typedef enum ebpo_ply_encoding { EBPO_PLY_ASCII, EBPO_PLY_LITTLE, EBPO_PLY_BIG } ebpo_ply_encoding;
typedef enum ebpo_ply_type {
    EBPO_PLY_INT8,
    EBPO_PLY_UINT8,
    EBPO_PLY_INT16,
    EBPO_PLY_UINT16,
    EBPO_PLY_INT32,
    EBPO_PLY_UINT32,
    EBPO_PLY_FLOAT32,
    EBPO_PLY_FLOAT64
} ebpo_ply_type;
/* What a property is to us. */
typedef enum ebpo_ply_role {
    EBPO_PLY_ROLE_NONE,
    EBPO_PLY_ROLE_X,
    EBPO_PLY_ROLE_Y,
    EBPO_PLY_ROLE_Z,
    EBPO_PLY_ROLE_CORNERS
} ebpo_ply_role;
typedef enum ebpo_ply_kind {
    EBPO_PLY_KIND_OTHER,
    EBPO_PLY_KIND_VERTEX,
    EBPO_PLY_KIND_FACE,
    EBPO_PLY_KIND_STRIPS
} ebpo_ply_kind;

/* A word of the header; points into the file's bytes. */
typedef struct ebpo_ply_word {
    const char *s;
    size_t n;
} ebpo_ply_word;

typedef struct ebpo_ply_property {
    ebpo_ply_word name;
    ebpo_ply_type type;       /* of the value, or of a list's items */
    ebpo_ply_type count_type; /* of a list's length */
    bool list;
    ebpo_ply_role role;
    int attribute; /* number of the array that takes the values, and which column; -1: none */
    unsigned column;
} ebpo_ply_property;

typedef struct ebpo_ply_element {
    ebpo_ply_word name;
    ebpo_ply_kind kind;
    uint64_t count;
    uint64_t line;              /* in the header, from 1 */
    uint64_t first, properties; /* in ebpo_ply_header.property */
    uint64_t row_bytes;         /* binary: least size of a row; its size when there is no list */
    bool has_list;
} ebpo_ply_element;

typedef struct ebpo_ply_header {
    ebpo_ply_encoding encoding;
    char line_end;      /* '\n', or '\r' in files from very old systems */
    uint64_t body;      /* offset of the first byte behind the header */
    uint64_t body_line; /* number of the body's first line, from 1 */
    ebpo_ply_element *element;
    uint64_t elements, element_capacity;
    ebpo_ply_property *property;
    uint64_t properties, property_capacity;
    int64_t vertex, face, strips; /* element numbers, or -1 */
    uint64_t notes;               /* lines that are comments, or obj_info, or not understood */
} ebpo_ply_header;

enum { EBPO_PLY_HEADER_LONGEST = 1 << 20 };

/* Parses the header at the start of `data`; `name` is for messages. The words point into `data`. On
 * failure `out` is empty. Says nothing about counts fitting the file: ebpo_ply_parse_memory checks
 * that. */
EBPO_MUST_USE ebpo_status ebpo_ply_header_parse(ebpo_ply_header *out, const uint8_t *data,
                                                uint64_t size, const char *name, ebpo_error *error);
void ebpo_ply_header_free(ebpo_ply_header *header);

/* Returns the end of the line "ply" that the data begin with, where its line end is: it may follow
 * a mark of the order of bytes, and have blanks behind it. NULL: there is no such line. */
const char *ebpo_ply_first_line(const uint8_t *data, uint64_t size, char *line_end);

/* Bytes of one value in a binary file: 1, 2, 4 or 8. */
unsigned ebpo_ply_type_bytes(ebpo_ply_type type);

/* What the parts of the PLY reader share: the position in the file, the mesh under construction,
 * and messages. */

typedef struct ebpo_ply_parser {
    const uint8_t *data;
    uint64_t size, at; /* bytes, and the next one to read */
    uint64_t line;     /* ascii: line of that byte, from 1 */
    const char *name;
    ebpo_ply_header header;
    ebpo_mesh *mesh;
    uint64_t face_capacity;
    unsigned threads; /* 0: all cores */

    uint32_t *corners; /* of the face or strip being read */
    uint64_t corner_count, corner_capacity;
    void *scratch; /* for triangulation */
    uint64_t scratch_capacity;

    locale_t c_locale; /* ascii only */
    const ebpo_progress *progress;
    uint64_t next_report; /* offset */
    /* ascii: values that the header does not describe, at the ends of how many rows */
    uint64_t surplus_values, surplus_rows;
    bool strict;         /* ascii: such are an error; coordinates are doubles */
    double most_rounded; /* ascii: by which a float differs from its text, which it loses */
    uint64_t rounded;    /* ascii: values of attributes whose text a float loses */
    bool *lost; /* [arrays of attributes] a value does not fit its type; NULL: none are read */
    uint64_t faces_reserved; /* rows that faces' attributes have room for */
    ebpo_error *error;
} ebpo_ply_parser;

/* EBPO_E_FORMAT: "name: line 17: ..." or "name: byte 1234: ...", from the parser's position. */
ebpo_status ebpo_ply_fail(const ebpo_ply_parser *p, const char *format, ...) EBPO_PRINTF(2, 3);
/* The file ends within row `row` of `element`. */
ebpo_status ebpo_ply_fail_end(const ebpo_ply_parser *p, const ebpo_ply_element *element,
                              uint64_t row);

/* "vertex", "face", "strip" or "element" for messages. */
const char *ebpo_ply_row_name(const ebpo_ply_element *element);

/* Reports progress now and then; EBPO_E_CANCELLED when asked to stop. Cheap: call it for each row.
 */
static inline bool ebpo_ply_report_due(const ebpo_ply_parser *p) { return p->at >= p->next_report; }
ebpo_status ebpo_ply_report(ebpo_ply_parser *p);
/* EBPO_E_CANCELLED. */
ebpo_status ebpo_ply_fail_stopped(const ebpo_ply_parser *p);

/* Properties beyond positions and corners, on their way into a mesh's attributes. What is here does
 * nothing when they are not read (ebpo_ply_parser.lost is NULL). */

/* Arrays for the header's properties, with room for the rows that it states. */
EBPO_MUST_USE ebpo_status ebpo_ply_attributes_plan(ebpo_ply_parser *p);
/* After the last row: what was read becomes the mesh's, with the header where that says more than
 * the mesh does. */
EBPO_MUST_USE ebpo_status ebpo_ply_attributes_end(ebpo_ply_parser *p);

/* Room for so many faces in all. */
EBPO_MUST_USE ebpo_status ebpo_ply_attributes_reserve(ebpo_ply_parser *p, uint64_t faces);

static inline bool ebpo_ply_is_attribute(const ebpo_ply_property *property)
{
    return property->attribute >= 0;
}

/* The bits of a value, in its low bytes, become that of a row. Rows of different numbers: from any
 * threads. */
void ebpo_ply_put_value(const ebpo_ply_parser *p, const ebpo_ply_property *property, uint64_t row,
                        uint64_t bits);

/* A list for `row`, behind those of the rows before: *items is where its `count` items go. */
EBPO_MUST_USE ebpo_status ebpo_ply_put_list(ebpo_ply_parser *p, const ebpo_ply_property *property,
                                            uint64_t row, uint64_t count, uint8_t **items);

/* The bits of a value in text; where it is none of its type, the whole property is lost. */
uint64_t ebpo_ply_text_bits(ebpo_ply_parser *p, const ebpo_ply_property *property,
                            ebpo_ply_word token, uint64_t row);
/* Stores bits at `at`. */
void ebpo_ply_store_bits(uint8_t *at, unsigned bytes, uint64_t bits);

/* Face `row` was one of a polygon: the faces up to the last have the same values. */
EBPO_MUST_USE ebpo_status ebpo_ply_repeat_face(ebpo_ply_parser *p, uint64_t row);

/* Faces from `first` on are no rows of the element of faces: they have zeros and empty lists. There
 * is room for them. */
void ebpo_ply_blank_faces(ebpo_ply_parser *p, uint64_t first);

/* The body of an ascii PLY file. */

/* Reads all rows of an element, from p->at to behind its last row; with `store` false it only steps
 * over them. */
ebpo_status ebpo_ply_ascii_element(ebpo_ply_parser *p, const ebpo_ply_element *element, bool store);

/* Steps over blanks behind the last row: true where more text follows. */
bool ebpo_ply_ascii_more(ebpo_ply_parser *p);

/* The body of a binary PLY file, of either byte order. */

/* As ebpo_ply_ascii_element. */
ebpo_status ebpo_ply_binary_element(ebpo_ply_parser *p, const ebpo_ply_element *element,
                                    bool store);

/* The corners of a row become triangles of the mesh. */

/* In the corners of a strip row: a new strip begins. No vertex has this number. */
#define EBPO_PLY_RESTART UINT32_MAX

/* Forgets the corners read, and makes room for `count` more. */
ebpo_status ebpo_ply_reserve_corners(ebpo_ply_parser *p, uint64_t count);
/* A vertex number that does not exist. `row` is the face's number. */
ebpo_status ebpo_ply_fail_index(const ebpo_ply_parser *p, const ebpo_ply_element *element,
                                uint64_t row, int64_t index);

/* The corners read make a face or a strip: adds its triangles to the mesh. */
ebpo_status ebpo_ply_add_polygon(ebpo_ply_parser *p, uint64_t row);
ebpo_status ebpo_ply_add_strip(ebpo_ply_parser *p, uint64_t row);

/* Vertices of a PLY that cannot be used and are not. */

/* Leaves out the vertices that no face names and whose coordinates are not finite, and notes how
 * many. All rows have been read. EBPO_E_MEMORY, EBPO_E_IO. */
EBPO_MUST_USE ebpo_status ebpo_ply_leave_unused(ebpo_ply_parser *p);

#endif
