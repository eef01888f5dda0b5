/* Builds a mesh from a file with vertices, faces and values of corners.
 *
 * The mesh has one vertex for each position that faces use, in the order of first use. Vertices at
 * equal positions are merged, because OBJ and OFF files often, and STL files always, repeat the
 * vertices of adjacent faces. */
#ifndef EBPO_MESH_IMPORT_BUILD_H
#define EBPO_MESH_IMPORT_BUILD_H

#include <locale.h>
#include <string.h>

#include <ebpo/base.h>
#include <ebpo/mesh.h>

#include "core/text.h"

#define EBPO_IMPORT_MAX  (UINT64_C(0xfffffffe)) /* greatest number of vertices, or of triangles */
#define EBPO_IMPORT_NONE UINT32_MAX             /* not a vertex index */

/* The sorts (kinds) of values to which corners refer; the index of a table. */
typedef enum ebpo_import_sort {
    EBPO_IMPORT_COLOURS,
    EBPO_IMPORT_NORMALS,
    EBPO_IMPORT_TEXTURE,
    EBPO_IMPORT_SORTS
} ebpo_import_sort;

/* All values of one sort in the file. */
typedef struct ebpo_import_table {
    float *values; /* [rows][columns] */
    uint64_t rows, capacity;
    /* [faces of the mesh][3] row of each corner; EBPO_IMPORT_NONE: no row. NULL if attributes are
     * not requested */
    uint32_t *index;
    uint64_t index_capacity;
    bool named;   /* some corner refers to a row */
    bool bytes;   /* values are integers up to 255, stored as bytes */
    bool of_face; /* the file has one value for each face */
} ebpo_import_table;

/* A corner of a polygon: a vertex of the file and rows of the tables. */
typedef struct ebpo_import_corner {
    uint32_t vertex, row[EBPO_IMPORT_SORTS];
} ebpo_import_corner;

/* The state of the building. A reader calls, in this order: ebpo_import_begin, the functions that
 * add vertices and rows, ebpo_import_faces, ebpo_import_polygon for each polygon, ebpo_import_end,
 * ebpo_import_attributes, ebpo_import_free. */
typedef struct ebpo_import_build {
    const char *name; /* name of the file, for messages */
    ebpo_error *error;
    ebpo_mesh *mesh;
    bool attributes;   /* attributes are requested: values are stored */
    locale_t c_locale; /* for parsing numbers with a decimal point */

    bool doubles;         /* positions are doubles, otherwise floats */
    bool loses_digits;    /* some coordinate has more digits than a float keeps */
    uint64_t rounded;     /* number of table values that floats round */
    size_t position_size; /* bytes */
    void *xyz;            /* [vertices][3] positions of the file's vertices */
    uint64_t vertices, vertex_capacity;
    uint32_t *use; /* [vertices] index in the mesh; EBPO_IMPORT_NONE: no face has used the vertex */
    uint64_t face_capacity;
    ebpo_import_table table[EBPO_IMPORT_SORTS];

    ebpo_import_corner *corner; /* corners of the current polygon */
    uint64_t corners, corner_capacity;
    void *scratch; /* scratch memory for the triangulation of the polygon */
    uint64_t scratch_capacity;
} ebpo_import_build;

/* Begins a mesh with float or double positions. EBPO_E_MEMORY. After a failure, the caller frees
 * nothing. */
EBPO_MUST_USE ebpo_status ebpo_import_begin(ebpo_import_build *b, ebpo_mesh *mesh, const char *name,
                                            bool attributes, bool doubles, ebpo_error *error);

/* Parses s[0 .. n) as a coordinate: the nearest float or double. Returns false if the text is not a
 * number. */
bool ebpo_import_coordinate(ebpo_import_build *b, double *value, const char *s, size_t n);

/* Parses s[0 .. n), which must be a number, and writes the number divided by `weight` to *value.
 * Sets b->loses_digits if the quotient is no float. (A vertex of an OBJ file may have a weight.) */
void ebpo_import_quotient(ebpo_import_build *b, double *value, const char *s, size_t n,
                          double weight);

/* Parses s[0 .. n) as a value of a row: the nearest float. Returns false if the text is not a
 * number. */
bool ebpo_import_value(ebpo_import_build *b, float *value, const char *s, size_t n);

/* Adds a vertex of the file. EBPO_E_LIMIT, EBPO_E_MEMORY, EBPO_E_IO. EBPO_E_UNSUPPORTED, without a
 * message: some coordinate has more digits than a float keeps (`loses_digits`), and the file must
 * be read again with doubles. */
EBPO_MUST_USE ebpo_status ebpo_import_position(ebpo_import_build *b, const double xyz[3]);

/* Adds a vertex of a binary file, which holds floats. */
EBPO_MUST_USE ebpo_status ebpo_import_vertex(ebpo_import_build *b, const float xyz[3]);

/* Adds a row to the table `sort`, with one value for each of its columns. Returns the errors of
 * ebpo_import_position. */
EBPO_MUST_USE ebpo_status ebpo_import_row(ebpo_import_build *b, ebpo_import_sort sort,
                                          const float *values);
/* Returns the number of columns of a table: 2 for texture coordinates, else 3. */
unsigned ebpo_import_columns(ebpo_import_sort sort);

/* Allocates the arrays for polygons. Call this function after the last vertex and row, before the
 * first polygon. */
EBPO_MUST_USE ebpo_status ebpo_import_faces(ebpo_import_build *b);

/* Appends a corner to the current polygon, and returns the address where the caller stores it.
 * Returns NULL when out of memory. */
ebpo_import_corner *ebpo_import_add_corner(ebpo_import_build *b);

/* Triangulates the polygon of the corners, or counts it as omitted if it has fewer than three
 * corners. Then begins the next polygon. EBPO_E_LIMIT, EBPO_E_MEMORY, EBPO_E_IO. */
EBPO_MUST_USE ebpo_status ebpo_import_polygon(ebpo_import_build *b);

/* Merges vertices of equal position. EBPO_E_FORMAT: there are no faces. */
EBPO_MUST_USE ebpo_status ebpo_import_end(ebpo_import_build *b);

/* Adds the values of the tables to the attributes. A table becomes an attribute of vertices if all
 * corners at each vertex have equal values. Otherwise it becomes an attribute of faces: one value
 * if the three corners of each face have equal values, else the values of the three corners. */
EBPO_MUST_USE ebpo_status ebpo_import_attributes(ebpo_import_build *b);

/* Copies a word for a message: at most 40 characters; '?' replaces unprintable characters. */
enum { EBPO_IMPORT_WORD_TEXT = 41 };
void ebpo_import_word_text(char text[EBPO_IMPORT_WORD_TEXT], const char *s, size_t n);

/* Frees everything except the mesh. */
void ebpo_import_free(ebpo_import_build *b);

/* Moves the first vertex of each position to the front of xyz [count][3] (doubles or floats), in
 * order, and writes the new index of each old vertex to map [count]. Positions are equal if their
 * bits are equal or both coordinates are zero. (STL writers mix -0 and 0 along planes of symmetry;
 * the first vertex's sign stays.) count <= 2^32 - 2. *welded: number of remaining vertices.
 * EBPO_E_MEMORY only. */
EBPO_MUST_USE ebpo_status ebpo_import_weld(void *xyz, bool doubles, uint64_t count, uint32_t *map,
                                           uint64_t *welded, ebpo_error *error);

/* --- formats --- */

/* Runs of faces, each with a name. */
typedef struct ebpo_import_runs {
    /* [count] the first run has the name "" and the faces before the first name */
    ebpo_named_run *run;
    uint64_t count, capacity;
} ebpo_import_runs;

void ebpo_import_runs_free(ebpo_import_runs *runs);

/* A file in memory and the options for reading it. */
typedef struct ebpo_import_job {
    const uint8_t *data;
    uint64_t size;
    const char *name;              /* a path or any other name; messages omit its folders */
    ebpo_workspace *workspace;     /* for arrays; NULL: heap memory */
    bool attributes;               /* keep properties beyond positions and corners */
    unsigned threads;              /* 0: all cores; the mesh does not depend on the number */
    const ebpo_progress *progress; /* may be NULL */
    /* NULL, or initially empty: receives the runs of a format with named groups; the names point
     * into `data`. At most one run means that the file has no names. */
    ebpo_import_runs *runs;
} ebpo_import_job;

/* A format: a row of the table in import.c. */
typedef struct ebpo_import_format {
    const char *called; /* name with an article for messages: "an OBJ" */
    /* ending of file names: ".obj". The text after the dot becomes the mesh's source_format */
    const char *ending;
    /* Returns true if the file begins like files of this format. */
    bool (*recognise)(const uint8_t *data, uint64_t size);
    /* true: a file that begins like this format is read as this format, even if its name has the
     * ending of another format */
    bool beginning_decides;
    /* true: files of other formats may begin in the same way, so the beginning does not identify
     * the format */
    bool has_no_signature;
    /* Exactly one of `build` and `read` is set. `build` adds the content of the file to a mesh
     * under construction. `read` creates the complete mesh, reports progress, and clears `out` on
     * failure. Errors are those of ebpo_import_memory. */
    ebpo_status (*build)(ebpo_import_build *b, const ebpo_import_job *job);
    ebpo_status (*read)(ebpo_mesh *out, const ebpo_import_job *job, ebpo_error *error);
} ebpo_import_format;

/* Returns the name without its article. */
static inline const char *ebpo_import_name(const ebpo_import_format *format)
{
    return strchr(format->called, ' ') + 1;
}

/* The reader function of a format. Libraries without readers of meshes, such as the npm package,
 * are built with EBPO_NO_MESH_READERS. These libraries only recognise files of the formats, for
 * messages. */
#ifdef EBPO_NO_MESH_READERS
#define EBPO_IMPORT_READER(reader) (false ? (reader) : NULL)
#else
#define EBPO_IMPORT_READER(reader) (reader)
#endif

/* The formats. Each format is defined in the file of its reader. */
extern const ebpo_import_format ebpo_import_ply, ebpo_import_obj, ebpo_import_stl, ebpo_import_off;

/* Returns true if the first `known` bytes of a file declare a binary STL model of `size` bytes. */
bool ebpo_stl_states_size(const uint8_t *data, uint64_t known, uint64_t size);

#endif
