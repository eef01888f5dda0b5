/* Encodes, decodes and checks the patches of the part `surface` of a file. A patch is the
 * simplified surface of a node: triangles that replace the faces below the node. Source:
 * format-spec/surface.md. */
#ifndef EBPO_FORMAT_SURFACE_PATCHES_H
#define EBPO_FORMAT_SURFACE_PATCHES_H

#include "format/file_in.h"
#include "geometry/cells.h"

/* EBPO_PATCH_GRID: the vertices of a patch are on a grid of 2^EBPO_PATCH_GRID steps along each axis
 * of the node's cell. EBPO_PATCH_CELLS: the border of a patch has at most one vertex in each cell
 * that is EBPO_PATCH_CELLS levels below the node. EBPO_PATCH_LEVEL: deepest level of nodes with
 * patches. */
enum { EBPO_PATCH_GRID = 9, EBPO_PATCH_CELLS = 6, EBPO_PATCH_LEVEL = 14 };

/* A patch to encode. */
typedef struct ebpo_patch_source {
    uint64_t vertex_count, triangle_count;
    const uint32_t *triangle;  /* [triangle_count][3] vertex indices */
    const int16_t *point;      /* [vertex_count][3] steps of the grid from the lowest corner of the
                                  node's cell */
    const double (*normal)[3]; /* [vertex_count] of any length; 0: readers compute the normal from
                                  the triangles */
    const uint8_t *colour;     /* [vertex_count][3], or NULL */
} ebpo_patch_source;

/* An encoded patch: its rows in the file's arrays. ebpo_patch_rows_free frees the arrays. */
typedef struct ebpo_patch_rows {
    uint64_t code_bytes, code_capacity;
    uint8_t *code;
    uint16_t *point;
    uint8_t *normal, *colour;
} ebpo_patch_rows;

/* Encodes a patch. Changes the order of its vertices. Returns EBPO_E_MEMORY if memory is short. */
EBPO_MUST_USE ebpo_status ebpo_patch_encode(const ebpo_patch_source *source, ebpo_patch_rows *out,
                                            ebpo_error *error);
void ebpo_patch_rows_free(ebpo_patch_rows *rows);

/* Returns the unit of the errors in the file: 2^-32 of the longest side of the root cell. */
double ebpo_patch_error_step(const ebpo_info *info);

/* Returns the coordinates of a point of a patch of a node at `cell`. */
void ebpo_patch_position(const ebpo_box *box, ebpo_cell cell, const int16_t point[3],
                         double out[3]);

/* Marks the vertices on the border of a patch: vertices of edges with one triangle, and vertices
 * without triangles. Returns false if memory is short. */
EBPO_MUST_USE bool ebpo_patch_mark_border(const uint32_t *triangle, uint64_t triangles,
                                          uint64_t vertices, bool *border);

/* Checks the table of patches against the header's counts, and the codes of all patches. */
EBPO_MUST_USE ebpo_status ebpo_check_surface(const ebpo_check *check, const ebpo_info *info,
                                             const ebpo_surface *surface, ebpo_error *error);

/* Checks the table of patches against the header's counts. Returns the error's text or NULL. */
const char *ebpo_surface_fault(const ebpo_info *info, const ebpo_surface *surface);

/* Returns `as`, with a message that a patch of the file (its shown name; "": not known) cannot be
 * decoded. */
ebpo_status ebpo_patch_code_fails(ebpo_status as, const char *file, ebpo_error *error);

/* Returns EBPO_E_ABSENT, with a message that the file lacks the part `surface`. */
ebpo_status ebpo_surface_absent(const ebpo_file *file, ebpo_error *error);

/* Sets surface->first. Returns false if memory is short. */
EBPO_MUST_USE bool ebpo_surface_add_up(ebpo_surface *surface);

/* Sets the header's counts of the simplified surface. */
void ebpo_surface_summarise(const ebpo_surface *surface, ebpo_info *info);

#endif
