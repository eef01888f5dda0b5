/* Defines the arrays of a file as a table in memory, and the constraints on these arrays.
 * array_table.inc lists each array and each count once. This file derives tables of paths, shapes,
 * codings and needs (conditions for the presence of an array) from the list, for the writer, the
 * reader and subsets. The second part checks the arrays of a tree from a file (EBPO_E_FORMAT), or
 * from a caller who writes the tree (EBPO_E_ARGUMENT). Each error names the level, the array and
 * the constraint. Source: format-spec/README.md, sections 6 and 9. */
#include <inttypes.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

#include <ebpo/file.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "format/schema.h"
#include "geometry/level_nodes.h"
#include "geometry/polytope.h"
#include "hdf5_read/face_gates.h"

#define REQUIRED            .if_needed = false
#define WITH_DEFAULT(value) .if_needed = true, .default_value = (value)
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
#define TABLE_ARRAY(ID, path, cols_, stored, per_, about_)                   \
    [EBPO_A_##ID] = { .name = path,                                          \
                      .per = EBPO_PER_##per_,                                \
                      .needs = EBPO_NEEDS_SUBTREES,                          \
                      .cols = cols_,                                         \
                      .sizes = stored,                                       \
                      .since = 1,                                            \
                      .if_needed = EBPO_PER_##per_ == EBPO_PER_SHARED_BLOCK, \
                      .bytes = offsetof(ebpo_stored_sizes, subtree_bytes),   \
                      .coding = "plain",                                     \
                      .about = about_ },
#define SUM_ARRAY(ID, path, stored, per_, needs_, about_)                   \
    [EBPO_A_##ID] = { .name = path,                                         \
                      .per = EBPO_PER_##per_,                               \
                      .needs = EBPO_NEEDS_##needs_,                         \
                      .sizes = stored,                                      \
                      .since = 1,                                           \
                      .if_needed = true,                                    \
                      .bytes = offsetof(ebpo_stored_sizes, checksum_bytes), \
                      .coding = "plain",                                    \
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

/* A count of a level: a row LEVEL_COUNT of array_table.inc. */
typedef struct count_spec {
    const char *name;              /* HDF5 attribute of the level's group */
    uint32_t needs;                /* condition for a count above 0: EBPO_NEEDS_... */
    uint16_t in_level, in_summary; /* offset in ebpo_level and in ebpo_level_summary */
} count_spec;

static const count_spec level_counts[EBPO_COUNTS] = {
#define LEVEL_COUNT(ID, attribute, field, needs)                                     \
    [EBPO_PER_##ID] = { #attribute, EBPO_NEEDS_##needs, offsetof(ebpo_level, field), \
                        offsetof(ebpo_level_summary, field) },
#include "format/array_table.inc"
};

/* Checks that the type in each row of array_table.inc is the type of the member of ebpo_level. */
#define LEVEL_ARRAY(ID, name, field, type, ...)                                 \
    _Static_assert(_Generic(((ebpo_level *)0)->field, type * : 1, default : 0), \
                   "ebpo_level." #field ": another type than in its row of array_table.inc");
#include "format/array_table.inc"

/* Checks the element sizes in the file. If several sizes are allowed, the type in memory has 32
 * bits. If one size is allowed, it is the size of the type in memory. Exception: leaf_skip, which
 * contains differences. */
#define LEVEL_ARRAY(ID, name, field, type, stored, ...)                               \
    _Static_assert((stored) & ((stored)-1)                                            \
                       ? sizeof(type) == 4                                            \
                       : sizeof(type) == (stored) || EBPO_A_##ID == EBPO_A_LEAF_SKIP, \
                   #name ": its sizes in the file do not match its type in memory");
#include "format/array_table.inc"

/* The pointers and counts of array_table.inc, and all other members of ebpo_level. The size of this
 * struct shows whether ebpo_level has a member that is missing here. */
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

const char *ebpo_schema_former(ebpo_array_id id)
{
    return id == EBPO_A_SUBTREE_SHARED    ? "/subtrees/outer"
           : id == EBPO_A_CHUNK_DIRECTORY ? "/subtrees/places"
           : id == EBPO_A_CHUNK_CHECKSUMS ? "/chunk_sums"
                                          : NULL;
}

/* Writes the names of the columns of /subtrees/counts, in the order of EBPO_S_... (schema.h). */
static void subtree_columns(const ebpo_info *info, char names[EBPO_COLUMNS_BYTES])
{
    static const char *const of_level[EBPO_SUBTREE_LEVEL_COLS] = {
        "gray", "leaf", "black", "planes", "leaf_planes", "references", "face_end"
    };
    size_t used = (size_t)snprintf(names, EBPO_COLUMNS_BYTES,
                                   "faces_before faces vertices_before vertices "
                                   "shared_face_chunks shared_vertex_chunks");
    for (int level = info->subtree_level + 1; level < info->level_count; level++)
        for (int k = 0; k < EBPO_SUBTREE_LEVEL_COLS; k++)
            used += (size_t)snprintf(names + used, EBPO_COLUMNS_BYTES - used, " %02d/%s", level,
                                     of_level[k]);
}

void ebpo_schema_columns(const ebpo_info *info, ebpo_array_id id, char names[EBPO_COLUMNS_BYTES])
{
    static const char *const fixed[EBPO_ARRAYS] = {
        [EBPO_A_TYPES_INDEX] = "white black leaf gray",
        [EBPO_A_GRAY_INDEX] = "planes",
        [EBPO_A_LEAF_INDEX] = "face_end references leaf_planes",
        [EBPO_A_VERTICES] = "x y z",
        [EBPO_A_FACES] = "first second third",
        [EBPO_A_FACES_INDEX] = "vertices",
        [EBPO_A_BORDER_LOOPS] = "points weight",
        [EBPO_A_BORDER_POINTS] = "x y z",
        [EBPO_A_SURFACE_PATCHES] = "octcode first_face faces triangles vertices code_bytes error",
        [EBPO_A_SURFACE_POINTS] = "x y z",
        [EBPO_A_SURFACE_NORMALS] = "u v",
        [EBPO_A_SURFACE_COLOURS] = "red green blue",
    };
    if (id == EBPO_A_SUBTREE_INDEX || id == EBPO_A_SUBTREE_COUNTS)
        subtree_columns(info, names);
    else
        snprintf(names, EBPO_COLUMNS_BYTES, "%s", fixed[id] ? fixed[id] : "");
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

/* Returns the number of rows of /mesh/faces_index. */
static uint64_t face_chunks(const ebpo_info *info)
{
    uint64_t faces = info->face_count,
             rows = info->subtree_level ? EBPO_FACE_BLOCK : ebpo_full_chunk_rows(faces, 3, 4);
    return faces > rows ? (faces - 1) / rows + 1 : 0;
}

/* Returns the number of subtrees. */
static uint64_t subtree_count(const ebpo_info *info)
{
    return info->level[info->subtree_level].gray_count;
}

/* Returns the number of chunks of /subtrees/counts. */
static uint64_t subtree_chunks(const ebpo_info *info)
{
    uint64_t rows = ebpo_subtree_rows(info);
    return (subtree_count(info) + rows - 1) / rows;
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

/* Reads the uint64_t member of a struct at an offset. */
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
    case EBPO_PER_BORDER_LOOP: return info->border_loops;
    case EBPO_PER_BORDER_POINT: return info->border_points;
    case EBPO_PER_PATCH: return info->surface_patches;
    case EBPO_PER_PATCH_BYTE: return info->surface_code_bytes;
    case EBPO_PER_PATCH_VERTEX: return info->surface_vertices;
    case EBPO_PER_PATCH_COLOUR: return info->surface_colours;
    case EBPO_PER_SUBTREE_CHUNK: return subtree_chunks(info);
    case EBPO_PER_SUBTREE: return subtree_count(info);
    case EBPO_PER_SHARED_BLOCK:
    case EBPO_PER_CHUNK: return EBPO_ROWS_STATED;
    default: return load_field(l, level_counts[per].in_summary);
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
    return per < EBPO_COUNTS ? load_field(level, level_counts[per].in_level) : level->group_count;
}

void ebpo_level_set_count(ebpo_level *level, ebpo_per per, uint64_t count)
{
    if (per < EBPO_COUNTS)
        store_field(level, level_counts[per].in_level, count);
    else
        level->group_count = count;
}

/* Returns true if an element of `size` bytes has this value. */
static bool is_value(const void *element, size_t size, int8_t value)
{
    switch (size) {
    case 1: return *(const int8_t *)element == value;
    case 2: return *(const int16_t *)element == value;
    case 4: return *(const int32_t *)element == value;
    default: return *(const int64_t *)element == value;
    }
}

bool ebpo_level_is_default(const ebpo_level *level, int id)
{
    const ebpo_array_spec *spec = &ebpo_schema[id];
    const char *values = ebpo_level_array(level, id);
    uint64_t count = values ? ebpo_level_rows(level, id) : 0;
    EBPO_FOR_ITEMS(level->workspace, i, 0, count)
        if (!is_value(values + i * spec->held_size, spec->held_size, spec->default_value))
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
        if (level_counts[i].needs & (parts | EBPO_NEEDS_ALWAYS))
            store_field(&out, level_counts[i].in_summary,
                        load_field(level, level_counts[i].in_level));
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
        store_field(&out, level_counts[i].in_level, load_field(s, level_counts[i].in_summary));
    return out;
}

/* Returns the advice at the end of an error message. */
static const char *next_step(const ebpo_check *check)
{
    return check->as == EBPO_E_FORMAT ? "get a fresh copy of the file" : "the tree was not written";
}

ebpo_status ebpo_check_fail(const ebpo_check *check, int level, const char *array, const char *what,
                            ebpo_error *error)
{
    char path[64];
    if (level >= 0)
        snprintf(path, sizeof path, "/levels/%02d/%s", level, array);
    else
        snprintf(path, sizeof path, "%s", array);
    return ebpo_fail_at(error, check->as, check->shown, path, -1, "%s; %s", what, next_step(check));
}

/* Checks the types of a level's groups against the counts in the header. A group with types 0
 * belongs to a pruned node (a gray node whose children are not in the file). */
static ebpo_status check_types(const ebpo_check *check, const ebpo_info *info, int level,
                               const ebpo_level *arrays, ebpo_error *error)
{
    uint64_t counts[4] = { 0, 0, 0, 0 };
    uint64_t groups = ebpo_schema_groups(info, level);
    if (arrays->group_count != groups || !arrays->types)
        return ebpo_check_fail(check, level, "types",
                               "there is not exactly one group for each gray node of the level "
                               "above",
                               error);
    if (level == 0 && arrays->types[0] > 3)
        return ebpo_check_fail(check, level, "types", "the root has siblings", error);
    uint64_t empty_groups = 0, without_faces = 0;
    EBPO_FOR_ITEMS(check->workspace, i, 0, groups) {
        for (unsigned octant = 0; octant < ebpo_group_octants(level); octant++)
            counts[ebpo_group_type(arrays->types[i], octant)]++;
    }
    for (uint64_t i = 0; i < groups; i++) {
        empty_groups += arrays->types[i] == 0;
        without_faces += arrays->types[i] != 0 && !ebpo_group_lists_faces(arrays->types[i]);
    }
    if (level && without_faces)
        return ebpo_check_fail(check, level, "types",
                               "a gray node has no child that is gray or a leaf", error);
    if (level && empty_groups != info->level[level - 1].pruned_count)
        return ebpo_check_fail(
            check, level, "types",
            info->pruned ? "there is not exactly one empty group for each pruned node of the "
                           "level above"
                         : "a gray node has no child that is gray or a leaf",
            error);
    const ebpo_level_summary *s = &info->level[level];
    if (counts[EBPO_WHITE] != s->white_count || counts[EBPO_BLACK] != s->black_count ||
        counts[EBPO_LEAF] != s->leaf_count || counts[EBPO_GRAY] != s->gray_count)
        return ebpo_check_fail(check, level, "types",
                               "the types do not add up to the counts in the header", error);
    return EBPO_OK;
}

/* Checks that all required arrays are present, and that a surface has no arrays of winding numbers
 * that only solids have. */
static ebpo_status check_presence(const ebpo_check *check, const ebpo_info *info, int level,
                                  const ebpo_level *arrays, ebpo_error *error)
{
    for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++) {
        const ebpo_array_spec *spec = &ebpo_schema[id];
        bool required = ebpo_schema_rows(info, (ebpo_array_id)id, level) != 0;
        if (!ebpo_schema_is_held(id))
            continue;
        if (required && !spec->if_needed && !ebpo_level_array(arrays, id))
            return ebpo_check_fail(check, level, spec->name, "the array is missing", error);
        if (!info->solid && spec->needs == EBPO_NEEDS_SOLID && ebpo_level_array(arrays, id))
            return ebpo_check_fail(check, level, spec->name, "a surface has no winding numbers",
                                   error);
    }
    return EBPO_OK;
}

/* Checks the numbers of planes, and the plane codes, of the gray nodes or of the leaves. */
static ebpo_status check_planes(const ebpo_check *check, int level, const char *counts_name,
                                const uint8_t *counts, uint64_t nodes, const char *planes_name,
                                const uint32_t *planes, uint64_t plane_count, ebpo_error *error)
{
    uint64_t sum = 0;
    for (uint64_t i = 0; i < nodes; i++)
        sum += counts[i];
    if (sum != plane_count)
        return ebpo_check_fail(check, level, counts_name,
                               "the counts do not add up to the number of planes", error);
    EBPO_FOR_ITEMS(check->workspace, i, 0, plane_count) {
        int32_t n[3], d;
        if (!ebpo_plane_code_decode(planes[i], n, &d))
            return ebpo_check_fail(check, level, planes_name, "invalid plane code", error);
    }
    return EBPO_OK;
}

static ebpo_status check_colours(const ebpo_check *check, int level, const ebpo_level *arrays,
                                 ebpo_error *error)
{
    EBPO_FOR_ITEMS(check->workspace, i, 0, arrays->gray_count)
        if (arrays->gray_colours[i] >> 24)
            return ebpo_check_fail(check, level, "gray_colours", "a colour is above 2^24 - 1",
                                   error);
    return EBPO_OK;
}

static ebpo_status check_windings(const ebpo_check *check, const ebpo_info *info, int level,
                                  const ebpo_level *arrays, ebpo_error *error)
{
    if (arrays->black_winding)
        EBPO_FOR_ITEMS(check->workspace, i, 0, arrays->black_count)
            if (!ebpo_rule_inside(info->rule, arrays->black_winding[i]))
                return ebpo_check_fail(check, level, "black_winding",
                                       "a black node is outside by the winding rule", error);
    if (arrays->white_winding && info->solid)
        EBPO_FOR_ITEMS(check->workspace, i, 0, arrays->white_count)
            if (ebpo_rule_inside(info->rule, arrays->white_winding[i]))
                return ebpo_check_fail(check, level, "white_winding",
                                       "a white node is inside by the winding rule", error);
    return EBPO_OK;
}

/* Checks that a leaf's references ascend and are less than `first`, the leaf's first new face (no
 * earlier leaf lists it). */
static ebpo_status check_refs(const ebpo_check *check, int level, const uint32_t *refs,
                              uint64_t count, uint64_t first, ebpo_error *error)
{
    for (uint64_t k = 0; k < count; k++)
        if (refs[k] >= first || (k && refs[k] <= refs[k - 1]))
            return ebpo_check_fail(
                check, level, "leaf_refs",
                "a leaf's references are not ascending, or a reference is not to "
                "a face before the leaf's new faces",
                error);
    return EBPO_OK;
}

/* Checks the new faces and the references of a level's leaves. */
static ebpo_status check_leaves(const ebpo_check *check, const ebpo_info *info, int level,
                                const ebpo_level *arrays, ebpo_error *error)
{
    const ebpo_level_summary *s = &info->level[level];
    uint64_t end = 0, new_faces = 0, refs = 0;
    EBPO_FOR_ITEMS(check->workspace, i, 0, arrays->leaf_count) {
        uint64_t first = arrays->leaf_first[i];
        if (first < end || first > info->face_count ||
            arrays->leaf_new[i] > info->face_count - first)
            return ebpo_check_fail(
                check, level, "leaf_skip",
                "a leaf's new faces overlap those of another leaf or are beyond the last face",
                error);
        end = first + arrays->leaf_new[i];
        new_faces += arrays->leaf_new[i];
        if (arrays->leaf_ref_count[i] > s->ref_count - refs)
            return ebpo_check_fail(check, level, "leaf_ref_count",
                                   "the counts exceed the number of references", error);
        ebpo_status status =
            check_refs(check, level, arrays->leaf_refs ? arrays->leaf_refs + refs : NULL,
                       arrays->leaf_ref_count[i], first, error);
        if (status != EBPO_OK)
            return status;
        refs += arrays->leaf_ref_count[i];
    }
    if (new_faces != s->new_count || refs != s->ref_count)
        return ebpo_check_fail(check, level, "leaf_new",
                               "the leaves' counts do not add up to those in the header", error);
    return EBPO_OK;
}

ebpo_status ebpo_check_level(const ebpo_check *check, const ebpo_info *info, int level,
                             const ebpo_level *arrays, ebpo_error *error)
{
    ebpo_status status = check_types(check, info, level, arrays, error);
    if (status == EBPO_OK)
        status = check_presence(check, info, level, arrays, error);
    if (status == EBPO_OK && info->parts & EBPO_PART_PLANES)
        status =
            check_planes(check, level, "plane_counts", arrays->plane_counts, arrays->gray_count,
                         "planes", arrays->planes, arrays->plane_count, error);
    if (status == EBPO_OK && info->parts & EBPO_PART_LEAF_PLANES)
        status = check_planes(check, level, "leaf_plane_counts", arrays->leaf_plane_counts,
                              arrays->leaf_count, "leaf_planes", arrays->leaf_planes,
                              arrays->leaf_plane_count, error);
    if (status == EBPO_OK && info->parts & EBPO_PART_COLOURS)
        status = check_colours(check, level, arrays, error);
    if (status == EBPO_OK)
        status = check_windings(check, info, level, arrays, error);
    if (status == EBPO_OK && info->parts & EBPO_PART_MESH)
        status = check_leaves(check, info, level, arrays, error);
    return status;
}

/* State of a visit of all leaves of a tree in depth-first order. */
typedef struct walk {
    const ebpo_check *check;
    const ebpo_tree *tree;
    /* index of the next group and of the next leaf of each level; in depth-first order, the items
     * of a level have ascending indices */
    uint64_t group[EBPO_LEVELS_MAX], leaf[EBPO_LEVELS_MAX];
    uint64_t faces_before; /* number of new faces of the leaves that were visited */
} walk;

/* Checks the next group of a level, and the subtrees of its gray nodes. */
static ebpo_status walk_group(walk *w, int level, ebpo_error *error)
{
    const ebpo_level *arrays = &w->tree->level[level];
    uint16_t types = arrays->types[w->group[level]++];
    for (unsigned octant = 0; octant < ebpo_group_octants(level); octant++) {
        ebpo_node_type type = ebpo_group_type(types, octant);
        if (type == EBPO_GRAY && level + 1 < w->tree->info.level_count) {
            ebpo_status status = walk_group(w, level + 1, error);
            if (status != EBPO_OK)
                return status;
        } else if (type == EBPO_LEAF) {
            uint64_t i = w->leaf[level]++;
            if (arrays->leaf_first[i] != w->faces_before)
                return ebpo_check_fail(w->check, level, "leaf_skip",
                                       "the leaves' new faces are not in depth-first order", error);
            w->faces_before += arrays->leaf_new[i];
        }
    }
    return EBPO_OK;
}

ebpo_status ebpo_check_order(const ebpo_check *check, const ebpo_tree *tree, ebpo_error *error)
{
    walk w = { .check = check, .tree = tree };
    ebpo_status status = walk_group(&w, 0, error);
    if (status == EBPO_OK && w.faces_before != tree->info.face_count)
        return ebpo_check_fail(check, 0, "leaf_new", "not every face is new in exactly one leaf",
                               error);
    return status;
}

ebpo_status ebpo_check_map(const ebpo_check *check, const char *array, const uint32_t *map,
                           uint64_t count, uint64_t limit, ebpo_error *error)
{
    limit = limit <= UINT32_MAX ? limit : UINT64_C(1) << 32; /* source indices have 32 bits */
    /* a bit for each index below the limit */
    uint64_t *used = ebpo_alloc_zero(limit / 64 + 1, sizeof *used);
    if (!used)
        return ebpo_fail_memory(error, limit / 8);
    ebpo_status status = EBPO_OK;
    EBPO_FOR_ITEMS(check->workspace, i, 0, count) {
        uint64_t bit = UINT64_C(1) << map[i] % 64;
        if (map[i] >= limit || used[map[i] / 64] & bit) {
            status = ebpo_check_fail(check, -1, array,
                                     "a source index is out of range or used twice", error);
            break;
        }
        used[map[i] / 64] |= bit;
    }
    free(used);
    return status;
}

ebpo_status ebpo_check_finite(const ebpo_check *check, const ebpo_mesh *mesh, ebpo_error *error)
{
    bool finite = true;
    EBPO_FOR_ITEMS(check->workspace, i, 0, mesh->vertex_count * 3)
        finite &= mesh->xyz32 ? isfinite(mesh->xyz32[i]) : isfinite(mesh->xyz64[i]);
    return finite ? EBPO_OK
                  : ebpo_check_fail(check, -1, "/mesh/vertices",
                                    "a coordinate is not a finite number", error);
}

/* --- names of the arrays of attributes, and of their codings --- */

const char ebpo_coding_plain[] = "plain", ebpo_coding_columns[] = "column-delta";

void ebpo_attribute_path(int number, char path[EBPO_PATH_BYTES])
{
    if (number == 0)
        snprintf(path, EBPO_PATH_BYTES, "/attributes/header");
    else
        snprintf(path, EBPO_PATH_BYTES, "/attributes/%03d%s", (number - 1) / 2,
                 number % 2 ? "" : "_items");
}

const char *ebpo_attribute_about(int number, bool ends)
{
    return number == 0       ? "header of the source file"
           : number % 2 == 0 ? "items of the lists of the array before"
           : ends            ? "end of each element's list in the items"
                             : "values of each element, named by columns";
}

/* --- plane codes --- */

bool ebpo_plane_decode(uint32_t code, int32_t n[3], int32_t *d)
{
    return ebpo_plane_code_decode(code, n, d);
}
