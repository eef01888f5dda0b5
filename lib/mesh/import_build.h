/* A mesh that is being made of a file that has vertices, faces over them, and values at corners.
 *
 * A mesh's vertices are those that faces name, in the order in which they do so, and one for each
 * position: programs write OBJ and OFF files, and always STL, with vertices apart where faces meet.
 */
#ifndef EBPO_MESH_IMPORT_BUILD_H
#define EBPO_MESH_IMPORT_BUILD_H

#include <locale.h>
#include <string.h>

#include <ebpo/base.h>
#include <ebpo/mesh.h>

#include "core/text.h"

#define EBPO_IMPORT_MOST (UINT64_C(0xfffffffe))
#define EBPO_IMPORT_NONE UINT32_MAX /* no vertex has this number */

typedef enum ebpo_import_sort {
    EBPO_IMPORT_COLOURS,
    EBPO_IMPORT_NORMALS,
    EBPO_IMPORT_TEXTURE,
    EBPO_IMPORT_SORTS
} ebpo_import_sort;

/* Values that corners name. */
typedef struct ebpo_import_table {
    float *values; /* [rows][columns] */
    uint64_t rows, capacity;
    uint32_t *index; /* [faces of the mesh][3] rows; EBPO_IMPORT_NONE: none; only with attributes */
    uint64_t index_capacity;
    bool named;   /* some corner names a row */
    bool bytes;   /* values are whole numbers up to 255, and kept as such */
    bool of_face; /* the file says it of faces */
} ebpo_import_table;

/* A corner of a polygon: a vertex of the file, and rows of the tables. */
typedef struct ebpo_import_corner {
    uint32_t vertex, row[EBPO_IMPORT_SORTS];
} ebpo_import_corner;

typedef struct ebpo_import_build {
    const char *name;
    ebpo_error *error;
    ebpo_mesh *mesh;
    bool attributes; /* values are kept */
    locale_t c_locale;

    bool doubles;         /* positions are doubles; else floats */
    bool loses_digits;    /* floats do not keep the text of some coordinate */
    uint64_t rounded;     /* values of tables whose text floats do not keep */
    size_t position_size; /* bytes */
    void *xyz;            /* [vertices][3] of the file */
    uint64_t vertices, vertex_capacity;
    uint32_t *use; /* [vertices] the number by first use; EBPO_IMPORT_NONE: not yet used */
    uint64_t face_capacity;
    ebpo_import_table table[EBPO_IMPORT_SORTS];

    ebpo_import_corner *corner; /* of the polygon being read */
    uint64_t corners, corner_capacity;
    void *scratch; /* for cutting it */
    uint64_t scratch_capacity;
} ebpo_import_build;

/* Positions are floats, or doubles. EBPO_E_MEMORY. On failure nothing is left to free. */
EBPO_MUST_USE ebpo_status ebpo_import_begin(ebpo_import_build *b, ebpo_mesh *mesh, const char *name,
                                            bool attributes, bool doubles, ebpo_error *error);

/* Reads s[0 .. n) as a coordinate: the nearest float or double. False: it is no number. */
bool ebpo_import_coordinate(ebpo_import_build *b, double *value, const char *s, size_t n);

/* Reads a number again and divides it by a weight. A float stands for the quotient where it equals
 * it. */
void ebpo_import_quotient(ebpo_import_build *b, double *value, const char *s, size_t n,
                          double weight);

/* Reads a value of a row: the nearest float. False: it is no number. */
bool ebpo_import_value(ebpo_import_build *b, float *value, const char *s, size_t n);

/* Adds a vertex of the file. EBPO_E_LIMIT, EBPO_E_MEMORY, EBPO_E_IO. EBPO_E_UNSUPPORTED, without a
 * message: floats do not keep its text (`loses_digits`); the file is to be read again with
 * doubles. */
EBPO_MUST_USE ebpo_status ebpo_import_position(ebpo_import_build *b, const double xyz[3]);

/* Likewise of a binary file, which holds floats. */
EBPO_MUST_USE ebpo_status ebpo_import_vertex(ebpo_import_build *b, const float xyz[3]);

/* Adds a row to a table, of as many values as the sort has columns. Likewise. */
EBPO_MUST_USE ebpo_status ebpo_import_row(ebpo_import_build *b, ebpo_import_sort sort,
                                          const float *values);
unsigned ebpo_import_columns(ebpo_import_sort sort);

/* All vertices and rows are there: faces may come. */
EBPO_MUST_USE ebpo_status ebpo_import_faces(ebpo_import_build *b);

/* Room for one corner more of the polygon being read; NULL: no memory. */
ebpo_import_corner *ebpo_import_add_corner(ebpo_import_build *b);

/* The corners make a polygon; it is cut into triangles, or counted as left out where it has fewer
 * than three corners. Begins the next. EBPO_E_LIMIT, EBPO_E_MEMORY, EBPO_E_IO. */
EBPO_MUST_USE ebpo_status ebpo_import_polygon(ebpo_import_build *b);

/* Positions become one vertex each. EBPO_E_FORMAT: there are no faces. */
EBPO_MUST_USE ebpo_status ebpo_import_end(ebpo_import_build *b);

/* Adds what the tables hold to the mesh's attributes: to the vertices where all corners at a vertex
 * say the same; else to the faces, one for the face or as lists of its three corners'. */
EBPO_MUST_USE ebpo_status ebpo_import_attributes(ebpo_import_build *b);

/* Copies a word for a message: at most 40 characters, what is not printable becomes '?'. */
enum { EBPO_IMPORT_WORD_TEXT = 41 };
void ebpo_import_word_text(char text[EBPO_IMPORT_WORD_TEXT], const char *s, size_t n);

/* Frees all but the mesh. */
void ebpo_import_free(ebpo_import_build *b);

/* Joining vertices at identical positions. */

/* Moves the first vertex of each position to the front of xyz [count][3], which are doubles or
 * floats, in order, and writes each old vertex's new number to map [count]. Positions are the same
 * when their bits are, or both coordinates are zero (STL writers mix -0 and 0 along planes of
 * symmetry; the first one's sign stays). count <= 2^32 - 2. *welded: vertices left. EBPO_E_MEMORY
 * only. */
EBPO_MUST_USE ebpo_status ebpo_import_weld(void *xyz, bool doubles, uint64_t count, uint32_t *map,
                                           uint64_t *welded, ebpo_error *error);

/* --- formats --- */

/* Faces that stand under one name each. */
typedef struct ebpo_import_runs {
    ebpo_named_run *of; /* [count] the first is what stands before any name; that is "" */
    uint64_t count, capacity;
} ebpo_import_runs;

void ebpo_import_runs_free(ebpo_import_runs *runs);

/* A file that is in memory, and what is wanted of it. */
typedef struct ebpo_import_job {
    const uint8_t *data;
    uint64_t size;
    const char *name;              /* a path or any other name, shown without its folders */
    ebpo_workspace *workspace;     /* for arrays; NULL: they are in memory */
    bool attributes;               /* properties beyond positions and corners are kept */
    unsigned threads;              /* 0: all cores; the mesh does not depend on it */
    const ebpo_progress *progress; /* NULL: nobody is told */
    /* NULL, or empty at first: gets the runs of a format that names groups; their names point into
     * `data`. No more than one run: the file has no names. */
    ebpo_import_runs *runs;
} ebpo_import_job;

/* What is known of a format: a row of the table in import.c. */
typedef struct ebpo_import_format {
    const char *called; /* in messages: its name with an article, "an OBJ" */
    const char *ending; /* of names: ".obj"; without the dot it is the mesh's source_format */
    /* True where a file begins as those of this format do. */
    bool (*recognise)(const uint8_t *data, uint64_t size);
    bool mark_comes_first; /* the name does not count, whichever format it says */
    bool has_no_mark;      /* files of other formats might begin so, too */
    /* One of two, the other is NULL. Adds what the file holds to a mesh that is being made; or
     * makes the whole mesh, tells of progress, and clears `out` on failure. Errors are those of
     * ebpo_import_memory. */
    ebpo_status (*build)(ebpo_import_build *b, const ebpo_import_job *job);
    ebpo_status (*read)(ebpo_mesh *out, const ebpo_import_job *job, ebpo_error *error);
} ebpo_import_format;

/* The name without its article. */
static inline const char *ebpo_import_name(const ebpo_import_format *format)
{
    return strchr(format->called, ' ') + 1;
}

/* The rows, each in the file of its reader. */
extern const ebpo_import_format ebpo_import_ply, ebpo_import_obj, ebpo_import_stl, ebpo_import_off;

/* True if the first `known` bytes of a file state that a binary STL model takes `size` bytes. */
bool ebpo_stl_states_size(const uint8_t *data, uint64_t known, uint64_t size);

#endif
