/* The arrays of a file, for all who carry them: the rows of array_table.inc as an enumeration and a
 * table. format-spec/README.md, "Arrays". */
#ifndef EBPO_FORMAT_SCHEMA_H
#define EBPO_FORMAT_SCHEMA_H

#include <string.h>

#include <ebpo/file.h>

#include "hdf5_read/chunk.h"

/* In the order in which they lie in the file. Up to EBPO_LEVEL_ARRAYS once for each level. */
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
    /* all arrays of /attributes, which files have as many of as they like: the `level` is then the
     * number of the array there */
    EBPO_A_ATTRIBUTE,
    EBPO_ARRAYS
} ebpo_array_id;

/* One row for each what. The first ones are counted in the attributes of a level. */
typedef enum ebpo_per {
#define LEVEL_COUNT(ID, ...) EBPO_PER_##ID,
#include "format/array_table.inc"
    EBPO_COUNTS,
    EBPO_PER_GROUP = EBPO_COUNTS,
    EBPO_PER_GROUP_BLOCK, /* of EBPO_INDEX_ROWS groups, and so on */
    EBPO_PER_GRAY_BLOCK,
    EBPO_PER_LEAF_BLOCK,
    EBPO_PER_VERTEX,
    EBPO_PER_FACE,
    EBPO_PER_FACE_CHUNK,
    EBPO_PER_SUBTREE_CHUNK, /* of the rows of subtrees */
    EBPO_PER_SUBTREE,
    EBPO_PER_OUTER_BLOCK,
    EBPO_PER_CHUNK
} ebpo_per;

/* What an array is there for, as bits: parts, and whether winding numbers are defined. */
enum {
    EBPO_NEEDS_PLANES = EBPO_PART_PLANES,
    EBPO_NEEDS_MESH = EBPO_PART_MESH,
    EBPO_NEEDS_MAPS = EBPO_PART_MAPS,
    EBPO_NEEDS_LEAF_PLANES = EBPO_PART_LEAF_PLANES,
    EBPO_NEEDS_ATTRIBUTES = EBPO_PART_ATTRIBUTES,
    EBPO_NEEDS_COLOURS = EBPO_PART_COLOURS,
    EBPO_NEEDS_MESH_OR_LEAF_PLANES = EBPO_PART_MESH | EBPO_PART_LEAF_PLANES,
    EBPO_NEEDS_SUBTREES = 1 << 28,
    EBPO_NEEDS_SOLID = 1 << 29,
    EBPO_NEEDS_ALWAYS = 1 << 30
};

enum {
    EBPO_INDEX_ROWS = 4096,            /* items between two rows of an index array */
    EBPO_COLOUR_OF_NOTHING = 0x808080, /* of gray nodes of which nothing is known */
    EBPO_PATH_BYTES = 48,
    /* with the part `subtrees` (format-spec/README.md, section 9) */
    EBPO_FACE_BLOCK = 2048, /* rows of a chunk */
    EBPO_VERTEX_BLOCK = 1024,
    EBPO_SUBTREE_ROWS = 128,
    EBPO_COLS_OF_SUBTREES = 255 /* ebpo_schema_cols tells */
};

/* Columns of /subtrees/counts: what of a subtree, and of what lies between it and the one before
 * (`BEFORE`: of leaves down to the roots' level). */
enum {
    EBPO_S_FACES_BEFORE, /* new ones */
    EBPO_S_FACES,
    EBPO_S_VERTICES_BEFORE, /* first used by these */
    EBPO_S_VERTICES,
    EBPO_S_OUTER_FACES, /* rows of /subtrees/outer about blocks of faces */
    EBPO_S_OUTER_VERTICES,
    EBPO_SUBTREE_LEVELS /* then for each level below the roots': */
};
enum {
    EBPO_S_GRAY,
    EBPO_S_LEAF,
    EBPO_S_BLACK,
    EBPO_S_PLANES,
    EBPO_S_LEAF_PLANES,
    EBPO_S_REFS,
    EBPO_S_ENDS, /* by how much the end of the level's new faces grows */
    EBPO_SUBTREE_LEVEL_COLS
};

/* `level`: below the roots'; `what`: one of the last. */
static inline unsigned ebpo_subtree_column(const ebpo_info *info, int level, unsigned what)
{
    return EBPO_SUBTREE_LEVELS +
           EBPO_SUBTREE_LEVEL_COLS * (unsigned)(level - info->subtree_level - 1) + what;
}

/* Rows of a chunk of /subtrees/counts, of which there may be fewer. */
uint32_t ebpo_subtree_rows(const ebpo_info *info);

/* Rows of arrays whose length nothing but themselves tells. */
#define EBPO_ROWS_STATED UINT64_MAX

/* The index arrays of a level, in the order of what they count. */
enum { EBPO_INDEX_TYPES, EBPO_INDEX_GRAY, EBPO_INDEX_LEAVES, EBPO_INDEXES };

typedef struct ebpo_array_spec {
    const char *name; /* within /levels/NN, or the whole path */
    ebpo_per per;
    uint32_t needs; /* any of these bits */
    uint8_t cols;   /* 0: one dimension */
    uint8_t sizes;  /* allowed element sizes, summed: 1 + 2 + 4 + 8 */
    bool is_signed;
    bool if_needed; /* may be absent where its rows exist: then every value is the usual one */
    int8_t usual;
    uint8_t since;      /* minor version of the format */
    uint8_t held_size;  /* of an element in ebpo_level; 0: the array is not held there */
    uint16_t held;      /* offset of the pointer in ebpo_level */
    uint16_t bytes;     /* arrays of the root: offset in ebpo_stored_sizes of their kind */
    const char *coding; /* attribute */
    const char *about;  /* attribute */
} ebpo_array_spec;

extern const ebpo_array_spec ebpo_schema[EBPO_ARRAYS];

/* How an array is stored whose values are of the shape `given`: as that, or as gates. */
#define EBPO_GATES_CODING "gates"
ebpo_shape ebpo_stored_shape(const ebpo_shape *given, bool gates);

/* Absolute path of an array; `level` matters for level arrays only. */
void ebpo_schema_path(ebpo_array_id id, int level, char path[EBPO_PATH_BYTES]);

/* Columns of an array; 0: one dimension. */
uint32_t ebpo_schema_cols(const ebpo_info *info, ebpo_array_id id);

/* Rows that the head's counts and parts call for, or EBPO_ROWS_STATED; 0: the array is not in the
 * file. */
uint64_t ebpo_schema_rows(const ebpo_info *info, ebpo_array_id id, int level);

/* Rows of an index array over `count` items: one each EBPO_INDEX_ROWS, but none when one would do
 * (it is all zeros). */
uint64_t ebpo_schema_index_rows(uint64_t count);

/* Groups of eight of a level, from the head's counts. */
static inline uint64_t ebpo_schema_groups(const ebpo_info *info, int level)
{
    return level == 0 ? 1 : info->level[level - 1].gray_count;
}

/* The needs that a file, or a tree, fulfils. */
static inline uint32_t ebpo_schema_has(const ebpo_info *info)
{
    return info->parts | (info->solid ? EBPO_NEEDS_SOLID : 0) |
           (info->subtree_level ? EBPO_NEEDS_SUBTREES : 0) | EBPO_NEEDS_ALWAYS;
}

/* Lists are behind counts: of planes, leaf planes and references each node of one type has a
 * number of its own. */
typedef struct ebpo_list_spec {
    ebpo_array_id counts;
    ebpo_per of;
} ebpo_list_spec;
/* NULL: not a list. */
const ebpo_list_spec *ebpo_schema_list(ebpo_per per);

/* The type of the nodes that have a row each; -1: not nodes of one type. */
int ebpo_schema_node_type(ebpo_per per);

/* --- a level in memory --- */

static inline bool ebpo_schema_is_index(int id)
{
    return ebpo_schema[id].per >= EBPO_PER_GROUP_BLOCK &&
           ebpo_schema[id].per <= EBPO_PER_LEAF_BLOCK;
}

/* A list about all chunks: a single one itself, and not told of in any. */
static inline bool ebpo_schema_is_list(ebpo_array_id id)
{
    return id == EBPO_A_PLACES || id == EBPO_A_CHUNK_SUMS;
}

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

/* Items of a level: not of index rows. */
uint64_t ebpo_level_count(const ebpo_level *level, ebpo_per per);
void ebpo_level_set_count(ebpo_level *level, ebpo_per per, uint64_t count);

static inline uint64_t ebpo_level_rows(const ebpo_level *level, int id)
{
    return ebpo_level_count(level, ebpo_schema[id].per);
}

/* Whether all values are the usual one, which an array that is not there says as well. */
bool ebpo_level_is_usual(const ebpo_level *level, int id);

/* Frees the arrays that are there for some of `needs` only. Counts stay. */
void ebpo_level_drop(ebpo_level *level, uint32_t needs);

/* Counts and volumes of a level as the head states them, of what the parts let be there; and a
 * level without arrays that is what the head states. */
ebpo_level_summary ebpo_level_summarise(const ebpo_level *level, uint32_t parts);
ebpo_level ebpo_level_of_summary(const ebpo_info *info, int level);

/* What must hold of a tree, whether it comes from a file or from a caller about to write one:
 * format-spec/README.md, "Constraints". */

/* Who is being checked: a file (EBPO_E_FORMAT) or a caller's tree (EBPO_E_ARGUMENT). */
typedef struct ebpo_check {
    const char *shown; /* the file's name */
    ebpo_status as;
    ebpo_workspace *workspace; /* what the arrays may be in, or NULL */
} ebpo_check;

/* One array of one level is wrong: "shown: /levels/03/planes: what; next". */
ebpo_status ebpo_check_fail(const ebpo_check *check, int level, const char *array, const char *what,
                            ebpo_error *error);

/* A level's arrays against the head's counts, and against themselves. */
EBPO_MUST_USE ebpo_status ebpo_check_level(const ebpo_check *check, const ebpo_info *info,
                                           int level, const ebpo_level *arrays, ebpo_error *error);

/* Leaves in depth-first order have faces 0 .. face_count - 1 as their new ones, in order. For trees
 * with their face lists. */
EBPO_MUST_USE ebpo_status ebpo_check_order(const ebpo_check *check, const ebpo_tree *tree,
                                           ebpo_error *error);

/* A map's values are distinct and below `limit`. */
EBPO_MUST_USE ebpo_status ebpo_check_map(const ebpo_check *check, const char *array,
                                         const uint32_t *map, uint64_t count, uint64_t limit,
                                         ebpo_error *error);

/* Vertices are finite and faces name vertices that exist, in first-use order. */
EBPO_MUST_USE ebpo_status ebpo_check_finite(const ebpo_check *check, const ebpo_mesh *mesh,
                                            ebpo_error *error);

/* The arrays of /attributes in a file: a header, then of each array of attributes its values and,
 * of lists of different lengths, their items. format-spec/README.md, "Attributes". */

/* Numbers of arrays, and their paths. */
static inline int ebpo_values_number(uint64_t n) { return 1 + 2 * (int)n; }
static inline int ebpo_items_number(uint64_t n) { return 2 + 2 * (int)n; }
void ebpo_attribute_path(int number, char path[EBPO_PATH_BYTES]);

extern const char ebpo_coding_plain[], ebpo_coding_columns[];

#endif
