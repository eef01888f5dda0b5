#include "format/schema.h"

#include <stddef.h>
#include <stdio.h>

#include "core/arrays.h"
#include "hdf5_read/face_gates.h"

#define REQUIRED       .if_needed = false
#define USUALLY(value) .if_needed = true, .usual = (value)
#define OF_LEVEL(type, field)                                                          \
    .is_signed = _Generic((type)0, int8_t : 1, int16_t : 1, int32_t : 1, default : 0), \
    .held_size = sizeof(type), .held = offsetof(ebpo_level, field)

const ebpo_array_spec ebpo_schema[EBPO_ARRAYS] = {
#define LEVEL_ARRAY(ID, name_, field, type, stored, per_, needs_, coding_, absent, since_, about_) \
    [EBPO_A_##ID] = { .name = #name_,                                                              \
                      .per = EBPO_PER_##per_,                                                      \
                      .needs = EBPO_NEEDS_##needs_,                                                \
                      .sizes = stored,                                                             \
                      .coding = coding_,                                                           \
                      .since = since_,                                                             \
                      .about = about_,                                                             \
                      absent,                                                                      \
                      OF_LEVEL(type, field) },
#define LEVEL_INDEX(ID, name_, cols_, of, needs_, since_, about_) \
    [EBPO_A_##ID] = { .name = #name_,                             \
                      .per = EBPO_PER_##of##_BLOCK,               \
                      .needs = EBPO_NEEDS_##needs_,               \
                      .cols = cols_,                              \
                      .sizes = 8,                                 \
                      .since = since_,                            \
                      .coding = "plain",                          \
                      .about = about_ },
#define ROOT_ARRAY(ID, path, cols_, stored, per_, needs_, coding_, bytes_, since_, about_) \
    [EBPO_A_##ID] = { .name = path,                                                        \
                      .per = EBPO_PER_##per_,                                              \
                      .needs = EBPO_NEEDS_##needs_,                                        \
                      .cols = cols_,                                                       \
                      .sizes = stored,                                                     \
                      .since = since_,                                                     \
                      .bytes = offsetof(ebpo_stored_sizes, bytes_),                        \
                      .coding = coding_,                                                   \
                      .about = about_ },
#define TABLE_ARRAY(ID, path, cols_, stored, per_, about_)                  \
    [EBPO_A_##ID] = { .name = path,                                         \
                      .per = EBPO_PER_##per_,                               \
                      .needs = EBPO_NEEDS_SUBTREES,                         \
                      .cols = cols_,                                        \
                      .sizes = stored,                                      \
                      .since = 1,                                           \
                      .if_needed = EBPO_PER_##per_ == EBPO_PER_OUTER_BLOCK, \
                      .bytes = offsetof(ebpo_stored_sizes, subtree_bytes),  \
                      .coding = "plain",                                    \
                      .about = about_ },
#define SUM_ARRAY(ID, path, stored, per_, about_)                      \
    [EBPO_A_##ID] = { .name = path,                                    \
                      .per = EBPO_PER_##per_,                          \
                      .needs = EBPO_NEEDS_ALWAYS,                      \
                      .sizes = stored,                                 \
                      .since = 1,                                      \
                      .if_needed = true,                               \
                      .bytes = offsetof(ebpo_stored_sizes, sum_bytes), \
                      .coding = "plain",                               \
                      .about = about_ },
#include "format/array_table.inc"
    [EBPO_A_ATTRIBUTE] = { .name = "/attributes",
                           .per = EBPO_PER_CHUNK,
                           .needs = EBPO_NEEDS_ATTRIBUTES,
                           .sizes = 1 + 2 + 4 + 8,
                           .since = 1,
                           .bytes = offsetof(ebpo_stored_sizes, attribute_bytes),
                           .coding = "",
                           .about = "" },
};

const ebpo_count_spec ebpo_counts[EBPO_COUNTS] = {
#define LEVEL_COUNT(ID, attribute, field, needs)                                     \
    [EBPO_PER_##ID] = { #attribute, EBPO_NEEDS_##needs, offsetof(ebpo_level, field), \
                        offsetof(ebpo_level_summary, field) },
#include "format/array_table.inc"
};

/* Rows and fields cannot disagree. */
#define LEVEL_ARRAY(ID, name, field, type, ...)                                 \
    _Static_assert(_Generic(((ebpo_level *)0)->field, type * : 1, default : 0), \
                   "ebpo_level." #field ": another type than in its row of array_table.inc");
#include "format/array_table.inc"

/* Values are narrowed from 32 bits, or have one size; what leaf_skip holds is a difference. */
#define LEVEL_ARRAY(ID, name, field, type, stored, ...)                               \
    _Static_assert((stored) & ((stored)-1)                                            \
                       ? sizeof(type) == 4                                            \
                       : sizeof(type) == (stored) || EBPO_A_##ID == EBPO_A_LEAF_SKIP, \
                   #name ": its sizes in the file do not go with its type in memory");
#include "format/array_table.inc"

/* What ebpo_level is made of: the rows' pointers and counts, and what is named here. */
struct all_of_level {
#define LEVEL_ARRAY(ID, name, field, type, ...) type *field;
#define LEVEL_COUNT(ID, attribute, field, ...)  uint64_t field;
#include "format/array_table.inc"
    uint64_t group_count, pruned_count;
    double gray_volume, leaf_volume;
    ebpo_workspace *workspace;
};
_Static_assert(sizeof(struct all_of_level) == sizeof(ebpo_level),
               "ebpo_level has an array or a count without a row in array_table.inc");

void ebpo_schema_path(ebpo_array_id id, int level, char path[EBPO_PATH_BYTES])
{
    if (id < EBPO_LEVEL_ARRAYS)
        snprintf(path, EBPO_PATH_BYTES, "/levels/%02d/%s", level, ebpo_schema[id].name);
    else
        snprintf(path, EBPO_PATH_BYTES, "%s", ebpo_schema[id].name);
}

ebpo_shape ebpo_stored_shape(const ebpo_shape *given, bool gates)
{
    ebpo_shape stored = *given;
    if (gates) {
        stored.element_size = 1;
        stored.cols = EBPO_GATES_COLS;
    }
    return stored;
}

uint64_t ebpo_schema_index_rows(uint64_t count)
{
    return count > EBPO_INDEX_ROWS ? (count - 1) / EBPO_INDEX_ROWS + 1 : 0;
}

static uint64_t face_chunks(const ebpo_info *info)
{
    uint64_t faces = info->face_count,
             rows = info->subtree_level ? EBPO_FACE_BLOCK : ebpo_full_chunk_rows(faces, 3, 4);
    return faces > rows ? (faces - 1) / rows + 1 : 0;
}

static uint64_t subtree_rows(const ebpo_info *info)
{
    return info->level[info->subtree_level].gray_count;
}

static uint64_t subtree_chunks(const ebpo_info *info)
{
    uint64_t rows = ebpo_subtree_rows(info);
    return (subtree_rows(info) + rows - 1) / rows;
}

uint32_t ebpo_subtree_rows(const ebpo_info *info)
{
    uint32_t full = EBPO_SUBTREE_ROWS;
    while (full * ebpo_schema_cols(info, EBPO_A_SUBTREE_COUNTS) * 4 > EBPO_CHUNK_BYTES_MAX)
        full /= 2;
    return full;
}

uint32_t ebpo_schema_cols(const ebpo_info *info, ebpo_array_id id)
{
    int below = info->level_count - 1 - info->subtree_level;
    return ebpo_schema[id].cols == EBPO_COLS_OF_SUBTREES
               ? EBPO_SUBTREE_LEVELS + EBPO_SUBTREE_LEVEL_COLS * (uint32_t)below
               : ebpo_schema[id].cols;
}

static uint64_t load_field(const void *record, size_t offset)
{
    uint64_t value;
    memcpy(&value, (const char *)record + offset, sizeof value);
    return value;
}

static void store_field(void *record, size_t offset, uint64_t value)
{
    memcpy((char *)record + offset, &value, sizeof value);
}

uint64_t ebpo_schema_rows(const ebpo_info *info, ebpo_array_id id, int level)
{
    const ebpo_level_summary *l = &info->level[level];
    ebpo_per per = ebpo_schema[id].per;
    if (!(ebpo_schema[id].needs & ebpo_schema_has(info)))
        return 0;
    switch (per) {
    case EBPO_PER_GROUP: return ebpo_schema_groups(info, level);
    case EBPO_PER_GROUP_BLOCK: return ebpo_schema_index_rows(ebpo_schema_groups(info, level));
    case EBPO_PER_GRAY_BLOCK: return ebpo_schema_index_rows(l->gray_count);
    case EBPO_PER_LEAF_BLOCK: return ebpo_schema_index_rows(l->leaf_count);
    case EBPO_PER_VERTEX: return info->vertex_count;
    case EBPO_PER_FACE: return info->face_count;
    case EBPO_PER_FACE_CHUNK: return face_chunks(info);
    case EBPO_PER_SUBTREE_CHUNK: return subtree_chunks(info);
    case EBPO_PER_SUBTREE: return subtree_rows(info);
    case EBPO_PER_OUTER_BLOCK:
    case EBPO_PER_CHUNK: return EBPO_ROWS_STATED;
    default: return load_field(l, ebpo_counts[per].in_summary);
    }
}

const ebpo_list_spec *ebpo_schema_list(ebpo_per per)
{
    static const ebpo_list_spec planes = { EBPO_A_PLANE_COUNTS, EBPO_PER_GRAY },
                                leaf_planes = { EBPO_A_LEAF_PLANE_COUNTS, EBPO_PER_LEAF },
                                refs = { EBPO_A_LEAF_REF_COUNT, EBPO_PER_LEAF };
    return per == EBPO_PER_PLANE        ? &planes
           : per == EBPO_PER_LEAF_PLANE ? &leaf_planes
           : per == EBPO_PER_REF        ? &refs
                                        : NULL;
}

int ebpo_schema_node_type(ebpo_per per)
{
    return per == EBPO_PER_GRAY    ? EBPO_GRAY
           : per == EBPO_PER_LEAF  ? EBPO_LEAF
           : per == EBPO_PER_WHITE ? EBPO_WHITE
           : per == EBPO_PER_BLACK ? EBPO_BLACK
                                   : -1;
}

uint64_t ebpo_level_count(const ebpo_level *level, ebpo_per per)
{
    return per < EBPO_COUNTS ? load_field(level, ebpo_counts[per].in_level) : level->group_count;
}

void ebpo_level_set_count(ebpo_level *level, ebpo_per per, uint64_t count)
{
    if (per < EBPO_COUNTS)
        store_field(level, ebpo_counts[per].in_level, count);
    else
        level->group_count = count;
}

static bool is_value(const void *element, size_t size, int8_t value)
{
    switch (size) {
    case 1: return *(const int8_t *)element == value;
    case 2: return *(const int16_t *)element == value;
    case 4: return *(const int32_t *)element == value;
    default: return *(const int64_t *)element == value;
    }
}

bool ebpo_level_is_usual(const ebpo_level *level, int id)
{
    const ebpo_array_spec *spec = &ebpo_schema[id];
    const char *values = ebpo_level_array(level, id);
    uint64_t count = values ? ebpo_level_rows(level, id) : 0;
    EBPO_FOR_ITEMS(level->workspace, i, 0, count)
        if (!is_value(values + i * spec->held_size, spec->held_size, spec->usual))
            return false;
    return true;
}

void ebpo_level_drop(ebpo_level *level, uint32_t needs)
{
    for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++)
        if (ebpo_schema_is_held(id) && !(ebpo_schema[id].needs & ~needs)) {
            ebpo_array_free(level->workspace, ebpo_level_array(level, id));
            ebpo_level_set_array(level, id, NULL);
        }
}

void ebpo_level_free(ebpo_level *level)
{
    if (!level)
        return;
    ebpo_level_drop(level, ~0u);
    memset(level, 0, sizeof *level);
}

ebpo_level_summary ebpo_level_summarise(const ebpo_level *level, uint32_t parts)
{
    ebpo_level_summary out = { .gray_volume = level->gray_volume,
                               .leaf_volume = level->leaf_volume };
    for (int i = 0; i < EBPO_COUNTS; i++)
        if (ebpo_counts[i].needs & (parts | EBPO_NEEDS_ALWAYS))
            store_field(&out, ebpo_counts[i].in_summary, load_field(level, ebpo_counts[i].in_level));
    return out;
}

ebpo_level ebpo_level_of_summary(const ebpo_info *info, int level)
{
    const ebpo_level_summary *s = &info->level[level];
    ebpo_level out = { .group_count = ebpo_schema_groups(info, level),
                       .gray_volume = s->gray_volume,
                       .leaf_volume = s->leaf_volume,
                       .pruned_count = s->pruned_count };
    for (int i = 0; i < EBPO_COUNTS; i++)
        store_field(&out, ebpo_counts[i].in_level, load_field(s, ebpo_counts[i].in_summary));
    return out;
}
