/* Declares the arrays of a file: the rows of array_table.inc as an enumeration and a table. Source:
 * format-spec/README.md, sections 6 and 9. */
#ifndef EBPO_FORMAT_SCHEMA_H
#define EBPO_FORMAT_SCHEMA_H

#include <string.h>

#include <ebpo/file.h>

#include "hdf5_read/chunk.h"

/* Arrays in file order. Arrays before EBPO_LEVEL_ARRAYS exist once for each level. */
typedef enum ebpo_array_id {
#define LEVEL_ARRAY(ID, ...) EBPO_A_##ID,
#define LEVEL_INDEX(ID, ...) EBPO_A_##ID,
#include "format/array_table.inc"
    EBPO_LEVEL_ARRAYS,
    EBPO_BEFORE_ROOT = EBPO_LEVEL_ARRAYS - 1,
#define ROOT_ARRAY(ID, ...)  EBPO_A_##ID,
#define TABLE_ARRAY(ID, ...) EBPO_A_##ID,
#define SUM_ARRAY(ID, ...)   EBPO_A_##ID,
#include "format/array_table.inc"
    /* stands for every array of /attributes; `level` is then the array's number there */
    EBPO_A_ATTRIBUTE,
    EBPO_ARRAYS
} ebpo_array_id;

/* Kind of item that has one row in an array. For kinds before EBPO_COUNTS, the HDF5 attributes of a
 * level's group contain the number of items. */
typedef enum ebpo_per {
#define LEVEL_COUNT(ID, ...) EBPO_PER_##ID,
#include "format/array_table.inc"
    EBPO_COUNTS,
    EBPO_PER_GROUP = EBPO_COUNTS,
    EBPO_PER_GROUP_BLOCK, /* EBPO_INDEX_ROWS groups; in the next two rows: gray nodes, leaves */
    EBPO_PER_GRAY_BLOCK,
    EBPO_PER_LEAF_BLOCK,
    EBPO_PER_VERTEX,
    EBPO_PER_FACE,
    EBPO_PER_FACE_CHUNK,
    EBPO_PER_BORDER_LOOP,
    EBPO_PER_BORDER_POINT,
    EBPO_PER_PATCH, /* of the simplified surface; the next three rows: of all patches */
    EBPO_PER_PATCH_BYTE,
    EBPO_PER_PATCH_VERTEX,
    EBPO_PER_PATCH_COLOUR,
    EBPO_PER_SUBTREE_CHUNK, /* chunk of the rows of subtrees */
    EBPO_PER_SUBTREE,
    EBPO_PER_SHARED_BLOCK,
    EBPO_PER_CHUNK
} ebpo_per;

/* Conditions for the presence of an array, as bits. The last three bits are not parts of the file:
 * the file has subtrees; the model is a solid; no condition. */
enum {
    EBPO_NEEDS_PLANES = EBPO_PART_PLANES,
    EBPO_NEEDS_MESH = EBPO_PART_MESH,
    EBPO_NEEDS_MAPS = EBPO_PART_MAPS,
    EBPO_NEEDS_LEAF_PLANES = EBPO_PART_LEAF_PLANES,
    EBPO_NEEDS_ATTRIBUTES = EBPO_PART_ATTRIBUTES,
    EBPO_NEEDS_COLOURS = EBPO_PART_COLOURS,
    EBPO_NEEDS_BORDER = EBPO_PART_BORDER,
    EBPO_NEEDS_SURFACE = EBPO_PART_SURFACE,
    EBPO_NEEDS_MESH_OR_LEAF_PLANES = EBPO_PART_MESH | EBPO_PART_LEAF_PLANES,
    EBPO_NEEDS_SUBTREES = 1 << 28,
    EBPO_NEEDS_SOLID = 1 << 29,
    EBPO_NEEDS_SOLID_OR_BORDER = EBPO_NEEDS_SOLID | EBPO_PART_BORDER,
    EBPO_NEEDS_ALWAYS = 1 << 30
};

enum {
    EBPO_INDEX_ROWS = 4096,            /* items between two rows of an index array */
    EBPO_COLOUR_OF_NOTHING = 0x808080, /* for gray nodes without a known colour */
    EBPO_PATH_BYTES = 48,
    EBPO_COLUMNS_BYTES = 2048, /* of the attribute `columns`, with its end */
    /* with the part `subtrees` (format-spec/subtrees.md) */
    EBPO_FACE_BLOCK = 2048, /* rows of a chunk */
    EBPO_VERTEX_BLOCK = 1024,
    EBPO_SUBTREE_ROWS = 128,
    EBPO_COLS_OF_SUBTREES = 255 /* see ebpo_schema_cols */
};

/* Columns of /subtrees/counts: numbers of items of a subtree. Columns with BEFORE count the items
 * between the previous subtree and this one. These items belong to leaves that are at or above the
 * level of the subtrees' roots. */
enum {
    EBPO_S_FACES_BEFORE, /* new faces */
    EBPO_S_FACES,
    EBPO_S_VERTICES_BEFORE, /* first used by these faces */
    EBPO_S_VERTICES,
    EBPO_S_SHARED_FACES,    /* rows of /subtrees/shared_chunks for chunks of faces */
    EBPO_S_SHARED_VERTICES, /* rows of /subtrees/shared_chunks for chunks of vertices */
    EBPO_SUBTREE_LEVELS     /* first of the columns of levels */
};
/* Columns of each level below the subtrees' roots. */
enum {
    EBPO_S_GRAY,
    EBPO_S_LEAF,
    EBPO_S_BLACK,
    EBPO_S_PLANES,
    EBPO_S_LEAF_PLANES,
    EBPO_S_REFS,
    /* The end of the new faces is one past the last new face of the level's leaves so far. The
     * column has the end after the subtree's leaves, minus the end before these leaves. */
    EBPO_S_ENDS,
    EBPO_SUBTREE_LEVEL_COLS
};

/* Returns the column of a level below the subtrees' roots. `what`: EBPO_S_GRAY to EBPO_S_ENDS. */
static inline unsigned ebpo_subtree_column(const ebpo_info *info, int level, unsigned what)
{
    return EBPO_SUBTREE_LEVELS +
           EBPO_SUBTREE_LEVEL_COLS * (unsigned)(level - info->subtree_level - 1) + what;
}

/* Returns the number of rows in a chunk of /subtrees/counts. The array may have fewer rows. */
uint32_t ebpo_subtree_rows(const ebpo_info *info);

/* Number of rows of an array whose length is not derived from the header's counts. */
#define EBPO_ROWS_STATED UINT64_MAX

/* The index arrays of a level, in the order of the items that they count. */
enum { EBPO_INDEX_TYPES, EBPO_INDEX_GRAY, EBPO_INDEX_LEAVES, EBPO_INDEXES };

typedef struct ebpo_array_spec {
    const char *name; /* within /levels/NN, or the full path */
    ebpo_per per;
    uint32_t needs; /* any of these bits */
    uint8_t cols;   /* 0: one dimension */
    uint8_t sizes;  /* sum of the allowed element sizes: 1 + 2 + 4 + 8 */
    bool is_signed;
    bool if_needed; /* true: may be absent although its items exist; all values are then the default
                     */
    int8_t default_value;
    uint8_t since;      /* first minor version of the format with this array */
    uint8_t held_size;  /* size of an element in ebpo_level; 0: ebpo_level lacks the array */
    uint16_t held;      /* offset of the pointer in ebpo_level */
    uint16_t bytes;     /* arrays of the root: offset of their size in ebpo_stored_sizes */
    const char *coding; /* value of the array's attribute `coding` */
    const char *about;  /* value of the array's attribute `about` */
} ebpo_array_spec;

extern const ebpo_array_spec ebpo_schema[EBPO_ARRAYS];

/* Coding of faces as gates across edges (hdf5_read/face_gates.h). */
#define EBPO_GATES_CODING "gates"
/* Returns the shape in the file of an array with values of shape `given`. The result differs from
 * `given` only for gates. */
ebpo_shape ebpo_stored_shape(const ebpo_shape *given, bool gates);

/* Writes the absolute path of an array; `level` is ignored for arrays of the root. */
void ebpo_schema_path(ebpo_array_id id, int level, char path[EBPO_PATH_BYTES]);

/* Returns the path of the array in files of format 1.1 that were written before the array had its
 * final name; NULL for arrays without a former name. */
const char *ebpo_schema_former(ebpo_array_id id);

/* Writes the attribute `columns`: a name for each column; "" for arrays of one dimension. */
void ebpo_schema_columns(const ebpo_info *info, ebpo_array_id id, char names[EBPO_COLUMNS_BYTES]);

/* Returns the columns of an array; 0: one dimension. */
uint32_t ebpo_schema_cols(const ebpo_info *info, ebpo_array_id id);

/* Returns the number of rows that the header's counts and parts require, or EBPO_ROWS_STATED.
 * Returns 0 if the array is not in the file. */
uint64_t ebpo_schema_rows(const ebpo_info *info, ebpo_array_id id, int level);

/* Returns the number of rows of an index array over `count` items: one for each EBPO_INDEX_ROWS
 * items. Returns 0 instead of 1, because a single row would contain only zeros. */
uint64_t ebpo_schema_index_rows(uint64_t count);

/* Returns the number of groups of eight in a level, from the header's counts. */
static inline uint64_t ebpo_schema_groups(const ebpo_info *info, int level)
{
    return level == 0 ? 1 : info->level[level - 1].gray_count;
}

/* Returns the conditions (EBPO_NEEDS_...) that a file or tree fulfils. */
static inline uint32_t ebpo_schema_has(const ebpo_info *info)
{
    return info->parts | (info->solid ? EBPO_NEEDS_SOLID : 0) |
           (info->subtree_level ? EBPO_NEEDS_SUBTREES : 0) | EBPO_NEEDS_ALWAYS;
}

/* A list of planes, leaf planes or references. Another array contains the number of list items of
 * each node of one type. */
typedef struct ebpo_list_spec {
    ebpo_array_id counts; /* the array of these numbers */
    ebpo_per of;          /* the type of node */
} ebpo_list_spec;
/* Returns the list that consists of such items; NULL for items that are in no list. */
const ebpo_list_spec *ebpo_schema_list(ebpo_per per);

/* Returns the type of node (ebpo_node_type) that `per` stands for, or -1. */
int ebpo_schema_node_type(ebpo_per per);

/* --- a level in memory --- */

/* Returns true for index arrays: sums before each EBPO_INDEX_ROWS-th item. */
static inline bool ebpo_schema_is_index(int id)
{
    return ebpo_schema[id].per >= EBPO_PER_GROUP_BLOCK &&
           ebpo_schema[id].per <= EBPO_PER_LEAF_BLOCK;
}

/* Returns true for the two lists of all chunks (offsets and checksums). Each list is a single
 * chunk, which neither list contains. */
static inline bool ebpo_schema_is_list(ebpo_array_id id)
{
    return id == EBPO_A_CHUNK_DIRECTORY || id == EBPO_A_CHUNK_CHECKSUMS;
}

/* Returns true if ebpo_level has the array. */
static inline bool ebpo_schema_is_held(int id) { return ebpo_schema[id].held_size != 0; }

static inline void *ebpo_level_array(const ebpo_level *level, int id)
{
    void *array;
    memcpy(&array, (const char *)level + ebpo_schema[id].held, sizeof array);
    return array;
}

static inline void ebpo_level_set_array(ebpo_level *level, int id, const void *array)
{
    memcpy((char *)level + ebpo_schema[id].held, &array, sizeof array);
}

/* Returns the number of items of a level, except index rows. */
uint64_t ebpo_level_count(const ebpo_level *level, ebpo_per per);
void ebpo_level_set_count(ebpo_level *level, ebpo_per per, uint64_t count);

static inline uint64_t ebpo_level_rows(const ebpo_level *level, int id)
{
    return ebpo_level_count(level, ebpo_schema[id].per);
}

/* Returns true if all values are the default, so that the array can be omitted. */
bool ebpo_level_is_default(const ebpo_level *level, int id);

/* Frees the arrays that only these `needs` require. The level's counts do not change. */
void ebpo_level_drop(ebpo_level *level, uint32_t needs);

/* Returns the counts and volumes of a level, as a file's header states them. Counts of parts that
 * are not in `parts` are 0. */
ebpo_level_summary ebpo_level_summarise(const ebpo_level *level, uint32_t parts);
/* Returns a level with the header's counts and no arrays. */
ebpo_level ebpo_level_of_summary(const ebpo_info *info, int level);

/* Constraints on a tree, which is read from a file or comes from a caller who writes it:
 * format-spec/README.md, sections 6 and 9. */

/* Subject of the check: a file (EBPO_E_FORMAT) or a caller's tree (EBPO_E_ARGUMENT). */
typedef struct ebpo_check {
    const char *shown;         /* the file's name */
    ebpo_status as;            /* status of an error */
    ebpo_workspace *workspace; /* contains the arrays, or NULL */
} ebpo_check;

/* Reports a wrong array of a level, for example "shown: /levels/03/planes: what; advice". `level`:
 * -1 for an array of the root. */
ebpo_status ebpo_check_fail(const ebpo_check *check, int level, const char *array, const char *what,
                            ebpo_error *error);

/* Checks a level's arrays against the header's counts and against each other. */
EBPO_MUST_USE ebpo_status ebpo_check_level(const ebpo_check *check, const ebpo_info *info,
                                           int level, const ebpo_level *arrays, ebpo_error *error);

/* Checks a tree with face lists: the new faces of its leaves, in depth-first order, must be
 * 0 .. face_count - 1 in ascending order. */
EBPO_MUST_USE ebpo_status ebpo_check_order(const ebpo_check *check, const ebpo_tree *tree,
                                           ebpo_error *error);

/* Checks that source indices (positions in the source mesh) are distinct and below `limit`. */
EBPO_MUST_USE ebpo_status ebpo_check_map(const ebpo_check *check, const char *array,
                                         const uint32_t *map, uint64_t count, uint64_t limit,
                                         ebpo_error *error);

/* Checks that all coordinates of vertices are finite. */
EBPO_MUST_USE ebpo_status ebpo_check_finite(const ebpo_check *check, const ebpo_mesh *mesh,
                                            ebpo_error *error);

/* Numbers of the arrays in /attributes: 0 is the header. Attribute array n has an array of values
 * and, for lists of different lengths, an array of their items. format-spec/attributes.md. */
static inline int ebpo_values_number(uint64_t n) { return 1 + 2 * (int)n; }
static inline int ebpo_items_number(uint64_t n) { return 2 + 2 * (int)n; }
/* Writes the absolute path of an array in /attributes. */
void ebpo_attribute_path(int number, char path[EBPO_PATH_BYTES]);

/* Returns the attribute `about`. `ends`: the array's lists have different lengths. */
const char *ebpo_attribute_about(int number, bool ends);

extern const char ebpo_coding_plain[], ebpo_coding_columns[];

/* The former name of ebpo_coding_columns, which readers also accept. */
#define EBPO_CODING_COLUMNS_FORMER "columns"

#endif
