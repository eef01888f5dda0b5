/* What the parts of the PLY reader share: the position in the file, the mesh under construction,
 * and messages. */
#ifndef EBPO_MESH_PLY_STATE_H
#define EBPO_MESH_PLY_STATE_H

#include <ebpo/mesh.h>
#include <locale.h>

#include "mesh/attributes.h"
#include "mesh/ply_header.h"

typedef struct ply_parser {
    const uint8_t *data;
    uint64_t size, at; /* bytes, and the next one to read */
    uint64_t line;     /* ascii: line of that byte, from 1 */
    const char *name;
    ply_header header;
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
} ply_parser;

/* EBPO_E_FORMAT: "name: line 17: ..." or "name: byte 1234: ...", from the parser's position. */
ebpo_status ebpo_ply_fail(const ply_parser *p, const char *format, ...) EBPO_PRINTF(2, 3);
/* The file ends within row `row` of `element`. */
ebpo_status ebpo_ply_fail_end(const ply_parser *p, const ply_element *element, uint64_t row);

/* Gives the mesh attributes where it has none, so that what was left out can be noted.
 * EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_ply_notes(ply_parser *p);

/* "vertex", "face", "strip" or "element" for messages. */
const char *ebpo_ply_row_name(const ply_element *element);

/* Reports progress now and then; EBPO_E_CANCELLED when asked to stop. Cheap: call it for each row.
 */
static inline bool ebpo_ply_report_due(const ply_parser *p) { return p->at >= p->next_report; }
ebpo_status ebpo_ply_report(ply_parser *p);
/* EBPO_E_CANCELLED. */
ebpo_status ebpo_ply_fail_stopped(const ply_parser *p);

#endif
