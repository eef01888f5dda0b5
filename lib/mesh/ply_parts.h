/* Declares the parts of the PLY reader: the header with its elements and properties, the state of
 * the reader, attributes, and the two kinds of body. Source: Greg Turk, "The PLY Polygon File
 * Format", 1994. */
#ifndef EBPO_MESH_PLY_PARTS_H
#define EBPO_MESH_PLY_PARTS_H

#include <locale.h>

#include <ebpo/base.h>
#include <ebpo/mesh.h>

#include "mesh/attributes.h"
#include "mesh/import_build.h"

/* The formats of the body: text, or binary with little-endian or big-endian values. */
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
/* The meaning of a property to the reader. */
typedef enum ebpo_ply_role {
    EBPO_PLY_ROLE_NONE,
    EBPO_PLY_ROLE_X,
    EBPO_PLY_ROLE_Y,
    EBPO_PLY_ROLE_Z,
    EBPO_PLY_ROLE_CORNERS
} ebpo_ply_role;
/* The kind of an element (a list of items with the same properties). */
typedef enum ebpo_ply_kind {
    EBPO_PLY_KIND_OTHER,
    EBPO_PLY_KIND_VERTEX,
    EBPO_PLY_KIND_FACE,
    EBPO_PLY_KIND_STRIPS
} ebpo_ply_kind;

/* A word of the header; points into the bytes of the file. */
typedef struct ebpo_ply_word {
    const char *s;
    size_t n;
} ebpo_ply_word;

typedef struct ebpo_ply_property {
    ebpo_ply_word name;
    ebpo_ply_type type;       /* type of the value, or of the items of a list */
    ebpo_ply_type count_type; /* type of the list length */
    bool list;
    ebpo_ply_role role;
    int attribute;   /* index of the array for the values; -1: none */
    unsigned column; /* column of this array */
} ebpo_ply_property;

typedef struct ebpo_ply_element {
    ebpo_ply_word name;
    ebpo_ply_kind kind;
    uint64_t count;             /* number of rows */
    uint64_t line;              /* line in the header, from 1 */
    uint64_t first, properties; /* range in ebpo_ply_header.property */
    uint64_t row_bytes; /* binary: least size of a row; its exact size if the element has no list */
    bool has_list;
} ebpo_ply_element;

typedef struct ebpo_ply_header {
    ebpo_ply_encoding encoding;
    char line_end;      /* '\n', or '\r' in files from very old systems */
    uint64_t body;      /* offset of the first byte after the header */
    uint64_t body_line; /* line number of the body's first line, from 1 */
    ebpo_ply_element *element;
    uint64_t elements, element_capacity;
    ebpo_ply_property *property;
    uint64_t properties, property_capacity;
    int64_t vertex, face, strips; /* element indices, or -1 */
    /* number of lines that are comments, obj_info or unknown, and of types with names such as
     * float32 */
    uint64_t notes;
} ebpo_ply_header;

enum { EBPO_PLY_HEADER_LONGEST = 1 << 20 }; /* in bytes */

/* Parses the header at the start of `data`; `name` appears in messages. The words point into
 * `data`. On failure `out` is empty. ebpo_ply_parse_memory checks later that the counts fit the
 * file. */
EBPO_MUST_USE ebpo_status ebpo_ply_header_parse(ebpo_ply_header *out, const uint8_t *data,
                                                uint64_t size, const char *name, ebpo_error *error);
void ebpo_ply_header_free(ebpo_ply_header *header);

/* Returns a pointer to the line end of the first line, "ply", and sets *line_end to the character
 * that ends lines. A byte order mark may precede the word, and blanks may follow it. Returns NULL
 * if there is no such line. */
const char *ebpo_ply_first_line(const uint8_t *data, uint64_t size, char *line_end);

/* Returns the bytes of one value in a binary file: 1, 2, 4 or 8. */
unsigned ebpo_ply_type_bytes(ebpo_ply_type type);

/* State shared by the parts of the PLY reader: the position in the file, the mesh under
 * construction, and messages. */

typedef struct ebpo_ply_parser {
    const uint8_t *data;
    uint64_t size, at; /* size in bytes, and the offset of the next byte to read */
    uint64_t line;     /* ascii: line number of the byte at `at`, from 1 */
    const char *name;
    ebpo_ply_header header;
    ebpo_mesh *mesh;
    uint64_t face_capacity;
    unsigned threads; /* 0: all cores */

    uint32_t *corners; /* corners of the current face or strip */
    uint64_t corner_count, corner_capacity;
    void *scratch; /* for triangulation */
    uint64_t scratch_capacity;

    locale_t c_locale; /* ascii only */
    const ebpo_progress *progress;
    uint64_t next_report; /* offset of the next progress report */
    /* ascii: values that the header does not describe, and the number of rows that end with such
     * values */
    uint64_t surplus_values, surplus_rows;
    bool strict;        /* ascii: surplus values are an error; coordinates are doubles */
    double max_rounded; /* ascii: largest rounding error of a float coordinate */
    uint64_t rounded;   /* ascii: number of attribute values whose text a float cannot hold */
    /* [attribute arrays] true if the mesh will not have the array, for example because a value does
     * not fit its type; NULL: attributes are not read */
    bool *lost;
    uint64_t faces_reserved; /* rows reserved for face attributes */
    uint64_t repeated_bytes; /* bytes of copies of lists for the other triangles of polygons */
    ebpo_error *error;
} ebpo_ply_parser;

/* Returns EBPO_E_FORMAT with a message that begins with the parser's position: "name: line 17: ..."
 * or "name: byte 1234: ...". */
ebpo_status ebpo_ply_fail(const ebpo_ply_parser *p, const char *format, ...) EBPO_PRINTF(2, 3);
/* Reports that the file ends within row `row` of `element`. */
ebpo_status ebpo_ply_fail_end(const ebpo_ply_parser *p, const ebpo_ply_element *element,
                              uint64_t row);

/* Returns "vertex", "face", "strip" or "element", for messages. */
const char *ebpo_ply_row_name(const ebpo_ply_element *element);

/* Returns true if a progress report is due. The function is fast enough for a call for each row. */
static inline bool ebpo_ply_report_due(const ebpo_ply_parser *p) { return p->at >= p->next_report; }
ebpo_status ebpo_ply_report(ebpo_ply_parser *p);
/* Returns EBPO_E_CANCELLED. */
ebpo_status ebpo_ply_fail_stopped(const ebpo_ply_parser *p);

/* --- attributes: properties other than positions and corners --- */

/* Creates arrays for the header's properties, with space for the declared rows. The functions of
 * this section do nothing if attributes are not read (ebpo_ply_parser.lost is NULL). */
EBPO_MUST_USE ebpo_status ebpo_ply_attributes_plan(ebpo_ply_parser *p);
/* Completes the attributes after the last row. Removes arrays with values that do not fit their
 * type, and keeps the header if it has information that the mesh lacks. */
EBPO_MUST_USE ebpo_status ebpo_ply_attributes_end(ebpo_ply_parser *p);

/* Reserves space for a total of `faces` faces. */
EBPO_MUST_USE ebpo_status ebpo_ply_attributes_reserve(ebpo_ply_parser *p, uint64_t faces);

/* Returns true if an attribute array receives the values of the property. */
static inline bool ebpo_ply_is_attribute(const ebpo_ply_property *property)
{
    return property->attribute >= 0;
}

/* Stores the low bytes of `bits` as the value of a row. Threads may call this function at the same
 * time for different rows. */
void ebpo_ply_put_value(const ebpo_ply_parser *p, const ebpo_ply_property *property, uint64_t row,
                        uint64_t bits);

/* Appends a list for `row`, and sets *items to the address where the caller stores its `count`
 * items. */
EBPO_MUST_USE ebpo_status ebpo_ply_put_list(ebpo_ply_parser *p, const ebpo_ply_property *property,
                                            uint64_t row, uint64_t count, uint8_t **items);

/* Converts text to the bits of a value. If the text is not a value of the property's type, the mesh
 * will not have this attribute, which is recorded. */
uint64_t ebpo_ply_text_bits(ebpo_ply_parser *p, const ebpo_ply_property *property,
                            ebpo_ply_word token, uint64_t row);
/* Stores bits at address `at`. */
void ebpo_ply_store_bits(uint8_t *at, unsigned bytes, uint64_t bits);

/* Copies the values of face `row`, which came from a polygon, to all faces after `row`, which are
 * the other triangles of the polygon. */
EBPO_MUST_USE ebpo_status ebpo_ply_repeat_face(ebpo_ply_parser *p, uint64_t row);

/* Sets zeros and empty lists for the faces from `first` on, which come from strips and have no row
 * in the face element. Space must have been reserved. */
void ebpo_ply_blank_faces(ebpo_ply_parser *p, uint64_t first);

/* --- the body of an ascii file --- */

/* Reads all rows of an element, from p->at to the byte after its last row. If `store` is false, the
 * rows are only skipped. */
ebpo_status ebpo_ply_ascii_element(ebpo_ply_parser *p, const ebpo_ply_element *element, bool store);

/* Skips blanks after the last row of the last element. Returns true if more text follows. */
bool ebpo_ply_ascii_more(ebpo_ply_parser *p);

/* --- the body of a binary file, of either byte order --- */

/* Same as ebpo_ply_ascii_element, for a binary file. */
ebpo_status ebpo_ply_binary_element(ebpo_ply_parser *p, const ebpo_ply_element *element,
                                    bool store);

/* --- conversion of the corners of a row to triangles --- */

/* Separates two strips in the corners of one row. No vertex has this index. */
#define EBPO_PLY_RESTART UINT32_MAX

/* Clears the corners and makes space for `count` new corners. */
ebpo_status ebpo_ply_reserve_corners(ebpo_ply_parser *p, uint64_t count);
/* Reports a vertex index that does not exist. `row` is the index of the face. */
ebpo_status ebpo_ply_fail_index(const ebpo_ply_parser *p, const ebpo_ply_element *element,
                                uint64_t row, int64_t index);

/* Adds the triangles of the current corners, which form a face or a strip, to the mesh. */
ebpo_status ebpo_ply_add_polygon(ebpo_ply_parser *p, uint64_t row);
ebpo_status ebpo_ply_add_strip(ebpo_ply_parser *p, uint64_t row);

/* Removes vertices that no face uses and whose coordinates are not finite, and records the number
 * of removed vertices. Call this function after all rows are read. EBPO_E_MEMORY, EBPO_E_IO. */
EBPO_MUST_USE ebpo_status ebpo_ply_remove_unused(ebpo_ply_parser *p);

#endif
