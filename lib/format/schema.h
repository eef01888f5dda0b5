/* Declares the arrays of a file: the rows of array_table.inc as an enumeration and a table. Nodes
 * are gray (with children), leaves, white (outside) or black (inside): ebpo_node_type. The eight
 * children of a gray node are a group. The rank of a node is its position among the nodes of its
 * type in its level. Source: format-spec/README.md, sections 6 and 9. */
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
    /* stands for every array of /attributes; `level` is then the array's number in /attributes */
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
    EBPO_PER_GROUP_BLOCK, /* EBPO_INDEX_ROWS groups */
    EBPO_PER_GRAY_BLOCK,  /* EBPO_INDEX_ROWS gray nodes */
    EBPO_PER_LEAF_BLOCK,  /* EBPO_INDEX_ROWS leaves */
    EBPO_PER_VERTEX,
    EBPO_PER_FACE,
    EBPO_PER_FACE_CHUNK,
    EBPO_PER_BORDER_LOOP,
    EBPO_PER_BORDER_POINT,
    EBPO_PER_PATCH,         /* patch of the simplified surface */
    EBPO_PER_PATCH_BYTE,    /* byte of the triangle codes of all patches */
    EBPO_PER_PATCH_VERTEX,  /* vertex of any patch */
    EBPO_PER_PATCH_COLOUR,  /* vertex of any patch, if the vertices have colours */
    EBPO_PER_SUBTREE_CHUNK, /* chunk of /subtrees/counts */
    EBPO_PER_SUBTREE,
    /* chunk of faces or vertices that a subtree uses, and that precedes the subtree */
    EBPO_PER_SHARED_BLOCK,
    EBPO_PER_CHUNK /* chunk of the file */
} ebpo_per;

/* Conditions for the presence of an array, as bits. Most conditions are that the file has a part.
 * EBPO_NEEDS_SUBTREES: the file has subtrees. EBPO_NEEDS_SOLID: the model is a solid.
 * EBPO_NEEDS_ALWAYS: no condition. */
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
    EBPO_INDEX_ROWS = 4096,            /* number of items between two rows of an index array */
    EBPO_COLOUR_OF_NOTHING = 0x808080, /* for gray nodes without a known colour */
    EBPO_PATH_BYTES = 48,              /* size of an array's path, including the final zero byte */
    EBPO_COLUMNS_BYTES = 2048, /* size of the attribute `columns`, including the final zero byte */
    /* rows of a chunk in files with subtrees (format-spec/subtrees.md) */
    EBPO_FACE_BLOCK = 2048,     /* /mesh/faces */
    EBPO_VERTEX_BLOCK = 1024,   /* /mesh/vertices */
    EBPO_SUBTREE_ROWS = 128,    /* /subtrees/counts */
    EBPO_CHECKSUM_ROWS = 256,   /* /subtrees/checksums */
    EBPO_COLS_OF_SUBTREES = 255 /* see ebpo_schema_cols */
};

/* Columns of /subtrees/counts: numbers of items of a subtree. Columns with BEFORE count the items
 * between the previous subtree and this subtree. These items belong to leaves that are at or above
 * the level of the subtrees' roots. A new face of a leaf is in the list of no earlier leaf (depth
 * first). */
enum {
    EBPO_S_FACES_BEFORE, /* new faces */
    EBPO_S_FACES,
    EBPO_S_VERTICES_BEFORE, /* vertices that the faces of EBPO_S_FACES_BEFORE use first */
    EBPO_S_VERTICES,        /* vertices that the faces of EBPO_S_FACES use first */
    EBPO_S_SHARED_FACES,    /* rows of /subtrees/shared_chunks for chunks of faces */
    EBPO_S_SHARED_VERTICES, /* rows of /subtrees/shared_chunks for chunks of vertices */
    EBPO_SUBTREE_LEVELS     /* first column of ebpo_subtree_column */
};
/* Columns for each level below the subtrees' roots: numbers of nodes, planes and references. */
enum {
    EBPO_S_GRAY,
    EBPO_S_LEAF,
    EBPO_S_BLACK,
    EBPO_S_PLANES,
    EBPO_S_LEAF_PLANES,
    EBPO_S_REFS,
    /* The *end* of a leaf is one past its last new face. The column has the end of the last leaf of
     * the subtree in the level, minus the end of the last leaf of the level before the subtree. */
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

/* Result of ebpo_schema_rows for an array whose length the header's counts do not determine. */
#define EBPO_ROWS_STATED UINT64_MAX

/* The index arrays of a level, in the order of the items that they count. */
enum { EBPO_INDEX_TYPES, EBPO_INDEX_GRAY, EBPO_INDEX_LEAVES, EBPO_INDEXES };

typedef struct ebpo_array_spec {
    const char *name; /* within /levels/NN, or the full path */
    ebpo_per per;
    uint32_t needs; /* conditions, EBPO_NEEDS_...; one of them suffices */
    uint8_t cols;   /* 0: the array has one dimension */
    uint8_t sizes;  /* sum of the allowed element sizes: 1 + 2 + 4 + 8 */
    bool is_signed;
    bool if_needed; /* true: the file may omit the array if all values are default_value */
    int8_t default_value;
    uint8_t since;     /* first minor version of the format with this array */
    uint8_t held_size; /* size of an element in ebpo_level; 0: ebpo_level lacks the array */
    uint16_t held;     /* offset in ebpo_level of the pointer to the array */
    uint16_t bytes;    /* arrays of the root: offset of the counter of bytes in ebpo_stored_sizes */
    const char *coding; /* value of the array's attribute `coding` */
    const char *about;  /* value of the array's attribute `about` */
} ebpo_array_spec;

extern const ebpo_array_spec ebpo_schema[EBPO_ARRAYS];

/* Value of the attribute `coding` for faces that are stored as gates: relative to an edge of a
 * preceding face (hdf5_read/face_gates.h). */
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

/* Returns the number of columns of an array; 0: the array has one dimension. */
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

/* Returns the conditions (EBPO_NEEDS_...) that the file or tree with this header meets. */
static inline uint32_t ebpo_schema_has(const ebpo_info *info)
{
    return info->parts | (info->solid ? EBPO_NEEDS_SOLID : 0) |
           (info->subtree_level ? EBPO_NEEDS_SUBTREES : 0) | EBPO_NEEDS_ALWAYS;
}

/* A list of planes, leaf planes or references of nodes. */
typedef struct ebpo_list_spec {
    ebpo_array_id counts; /* the array with the number of list items of each node */
    ebpo_per of;          /* type of the nodes that have list items */
} ebpo_list_spec;
/* Returns the list that consists of items of kind `per`; NULL for items that are in no list. */
const ebpo_list_spec *ebpo_schema_list(ebpo_per per);

/* Returns the type of node (ebpo_node_type) that `per` stands for, or -1. */
int ebpo_schema_node_type(ebpo_per per);

/* --- a level in memory --- */

/* Returns true for index arrays. An index array has sums over the items before each
 * EBPO_INDEX_ROWS-th item, so that a reader can begin in the middle of a level. */
static inline bool ebpo_schema_is_index(int id)
{
    return ebpo_schema[id].per >= EBPO_PER_GROUP_BLOCK &&
           ebpo_schema[id].per <= EBPO_PER_LEAF_BLOCK;
}

/* Returns true for the lists of chunks (offsets and checksums). Each list is a single chunk, which
 * is in no list of checksums. */
static inline bool ebpo_schema_is_list(ebpo_array_id id)
{
    return id == EBPO_A_CHUNK_DIRECTORY || id == EBPO_A_CHUNK_CHECKSUMS ||
           id == EBPO_A_CHECKSUM_INDEX;
}

/* Returns true if ebpo_level has a member for the array. */
static inline bool ebpo_schema_is_held(int id) { return ebpo_schema[id].held_size != 0; }

/* Returns the level's array; NULL if it is absent. */
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

/* Returns the number of items of a level. `per`: not a block of an index array. */
uint64_t ebpo_level_count(const ebpo_level *level, ebpo_per per);
void ebpo_level_set_count(ebpo_level *level, ebpo_per per, uint64_t count);

static inline uint64_t ebpo_level_rows(const ebpo_level *level, int id)
{
    return ebpo_level_count(level, ebpo_schema[id].per);
}

/* Returns true if all values are the default, so that the array can be omitted. */
bool ebpo_level_is_default(const ebpo_level *level, int id);

/* Frees the arrays that only the conditions in `needs` (EBPO_NEEDS_...) require. The level's counts
 * do not change. */
void ebpo_level_drop(ebpo_level *level, uint32_t needs);

/* Returns the counts and volumes of a level, as a file's header states them. Counts of parts that
 * are not in `parts` are 0. */
ebpo_level_summary ebpo_level_summarise(const ebpo_level *level, uint32_t parts);
/* Returns a level with the header's counts and no arrays. */
ebpo_level ebpo_level_of_summary(const ebpo_info *info, int level);

/* The functions ebpo_check_... check the constraints of format-spec/README.md, sections 6 and 9, on
 * a tree that is read from a file, or that a caller passes for writing. */

typedef struct ebpo_check {
    const char *shown; /* the file's name for messages */
    ebpo_status as;    /* status of an error: EBPO_E_FORMAT for a file, EBPO_E_ARGUMENT for a
                          caller's tree */
    ebpo_workspace *workspace; /* workspace that contains the arrays; NULL: allocated with malloc */
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

/* Numbers of the arrays in /attributes (format-spec/attributes.md): 0 is the header. Attribute
 * array n has an array of values. If the values are lists of different lengths, the array of values
 * contains the end of each list, and a second array contains the items of all lists. */
static inline int ebpo_values_number(uint64_t n) { return 1 + 2 * (int)n; }
static inline int ebpo_items_number(uint64_t n) { return 2 + 2 * (int)n; }
/* Writes the absolute path of an array in /attributes. */
void ebpo_attribute_path(int number, char path[EBPO_PATH_BYTES]);

/* Returns the attribute `about` of an array in /attributes. `ends`: the array's lists have
 * different lengths. */
const char *ebpo_attribute_about(int number, bool ends);

extern const char ebpo_coding_plain[], ebpo_coding_columns[];

/* The former name of ebpo_coding_columns, which readers also accept. */
#define EBPO_CODING_COLUMNS_FORMER "columns"

#endif
