/* Plans a file to write: lists its arrays with shapes and codings, and encodes rows of an array to
 * bytes. The plan refers to the caller's checked tree. The plan owns only derived arrays: index
 * arrays, counts and sums of subtrees, and codings of attributes. An index array has a row of sums
 * for every EBPO_INDEX_ROWS-th item; sums that belong to an absent part are 0. Encoding a chunk
 * depends only on the plan and the chunk's rows, so threads encode chunks independently. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/endian.h"
#include "core/error.h"
#include "core/checksum.h"
#include "core/text.h"
#include "ebpo_config.h"
#include "format/border_loops.h"
#include "format/content_checksum.h"
#include "format/chunk_layout.h"
#include "format/head_facts.h"
#include "format/level_volumes.h"
#include "format/schema.h"
#include "format/surface_patches.h"
#include "format/write_plan.h"
#include "geometry/level_nodes.h"
#include "hdf5_read/coding.h"

/* Allocates an index array over `count` items. */
static uint64_t *make_index(uint64_t count, unsigned cols)
{
    return ebpo_alloc_zero((count / EBPO_INDEX_ROWS + 1) * cols, sizeof(uint64_t));
}

uint64_t *ebpo_index_types(const ebpo_level *level, bool root)
{
    uint64_t *index = make_index(level->group_count, 4);
    uint64_t before[4] = { 0, 0, 0, 0 };
    EBPO_FOR_ITEMS(level->workspace, i, 0, index ? level->group_count : 0) {
        if (i % EBPO_INDEX_ROWS == 0)
            for (int k = 0; k < 4; k++)
                index[i / EBPO_INDEX_ROWS * 4 + k] = before[k];
        for (unsigned octant = 0; octant < ebpo_group_octants(!root); octant++)
            before[ebpo_group_type(level->types[i], octant)]++;
    }
    return index;
}

uint64_t *ebpo_index_gray(const ebpo_level *level)
{
    uint64_t *index = make_index(level->gray_count, 1);
    uint64_t planes = 0;
    for (uint64_t i = 0; index && i < level->gray_count; i++) {
        if (i % EBPO_INDEX_ROWS == 0)
            index[i / EBPO_INDEX_ROWS] = planes;
        planes += level->plane_counts ? level->plane_counts[i] : 0;
    }
    return index;
}

uint64_t *ebpo_index_leaves(const ebpo_level *level)
{
    uint64_t *index = make_index(level->leaf_count, 3);
    uint64_t end = 0, refs = 0, planes = 0; /* end: one past the last new face so far */
    EBPO_FOR_ITEMS(level->workspace, i, 0, index ? level->leaf_count : 0) {
        if (i % EBPO_INDEX_ROWS == 0) {
            index[i / EBPO_INDEX_ROWS * 3] = end;
            index[i / EBPO_INDEX_ROWS * 3 + 1] = refs;
            index[i / EBPO_INDEX_ROWS * 3 + 2] = planes;
        }
        if (level->leaf_first) {
            end = level->leaf_first[i] + level->leaf_new[i];
            refs += level->leaf_ref_count[i];
        }
        planes += level->leaf_plane_counts ? level->leaf_plane_counts[i] : 0;
    }
    return index;
}

/* --- attributes: checks --- */

/* Checks the rows of attribute array i. Returns the error's text or NULL. */
static const char *check_rows(const ebpo_info *info, const ebpo_attributes *all, uint64_t i)
{
    const ebpo_attribute *a = &all->array[i];
    bool vertex = ebpo_attribute_is_of(a, "vertex"), face = ebpo_attribute_is_of(a, "face");
    if (a->rows == 0 ||
        ((vertex || face) && a->rows != (vertex ? info->vertex_count : info->face_count)))
        return "an attribute array of vertices or faces does not have a row for each of them, or "
               "an attribute array has no rows";
    for (uint64_t k = 0; k < i; k++)
        if (strcmp(all->array[k].element, a->element) == 0 && all->array[k].rows != a->rows)
            return "two attribute arrays of one element have different numbers of rows";
    if (!a->ends && !a->values)
        return "an attribute array has no values";
    return NULL;
}

/* Checks the names of an attribute array. Returns the error's text or NULL. */
static const char *check_names(const ebpo_attribute *a)
{
    uint32_t words = 1;
    for (const char *s = a->names; *s; s++)
        words += *s == ' ';
    if (!a->element[0] || strchr(a->element, ' ') || !a->names[0] || !ebpo_text_ok(a->element) ||
        !ebpo_text_ok(a->names) || a->columns < 1 || a->columns > EBPO_ATTRIBUTE_COLUMNS ||
        words != (a->list == EBPO_ATTRIBUTE_NO_LIST ? a->columns : 1))
        return "an attribute array does not have a name for each column";
    return NULL;
}

/* --- attributes: codings, chosen by the compressed size of a few samples --- */

enum { SAMPLES = 8, SAMPLE_BYTES = 16384 /* greatest size of a sample */ };

/* Returns the compressed size of a sample; 0 on failure. `columns`: true: encodes the values as
 * differences within columns; false: as plain values. */
static uint64_t sample_bytes(ebpo_chunk_coder *coder, const uint8_t *values, size_t size,
                             bool floats, uint64_t rows, uint32_t cols, bool columns)
{
    uint8_t raw[SAMPLE_BYTES], stored[2 * SAMPLE_BYTES];
    size_t bytes = 0;
    if (columns)
        ebpo_columns_encode(values, size, floats, rows, cols, raw);
    else
        ebpo_integers_encode(values, size, rows * cols, size, raw);
    return ebpo_chunk_encode(coder, EBPO_PIPELINE_ZSTD, 3, (uint8_t)size, raw, rows * cols * size,
                             stored, &bytes) == EBPO_OK
               ? bytes
               : 0;
}

/* Returns true if samples of the values take fewer bytes as columns of differences than as plain
 * values. */
static bool columns_are_less(ebpo_chunk_coder *coder, const uint8_t *values, size_t size,
                             bool floats, uint64_t rows, uint32_t cols)
{
    uint64_t row_bytes = size * cols, sampled = SAMPLE_BYTES / row_bytes, plain = 0, columns = 0;
    if (sampled > rows)
        sampled = rows;
    for (uint64_t i = 0; i < SAMPLES; i++) {
        const uint8_t *at = values + (rows - sampled) / SAMPLES * i * row_bytes;
        plain += sample_bytes(coder, at, size, floats, sampled, cols, false);
        columns += sample_bytes(coder, at, size, floats, sampled, cols, true);
    }
    return columns < plain;
}

/* Chooses if an attribute array is stored as columns of differences or as plain values. Lists of
 * different lengths are stored as two arrays, the ends and the items of the lists. Ends ascend, so
 * they are always stored as differences. */
static void choose_codings(ebpo_attribute_plan *to, const ebpo_attribute *a,
                           ebpo_chunk_coder *coder)
{
    bool floats = ebpo_attribute_is_float(a->type);
    unsigned bytes = ebpo_attribute_bytes(a->type);
    uint64_t count = ebpo_attribute_value_count(a);
    to->columns = a->ends || columns_are_less(coder, a->values, bytes, floats, a->rows, a->columns);
    to->items_columns =
        a->ends && count && columns_are_less(coder, a->values, bytes, floats, count, 1);
}

/* Checks the attributes to write (EBPO_E_ARGUMENT). Sets their codings, ranges and checksum in the
 * plan. */
static ebpo_status attributes_plan(ebpo_plan *plan, const char *shown, ebpo_error *error)
{
    const ebpo_attributes *all = plan->attributes;
    if (!all)
        return EBPO_OK;
    plan->attribute = ebpo_alloc_zero(all->count, sizeof *plan->attribute);
    ebpo_chunk_coder *coder = ebpo_alloc_zero(1, sizeof *coder);
    const char *wrong = NULL;
    for (uint64_t i = 0; i < all->count && plan->attribute && coder && !wrong; i++) {
        ebpo_attribute_plan *to = &plan->attribute[i];
        wrong = check_rows(&plan->info, all, i);
        if (!wrong)
            wrong = check_names(&all->array[i]);
        if (wrong)
            break;
        choose_codings(to, &all->array[i], coder);
        to->has_range = !ebpo_attribute_is_of_textures(&all->array[i]) &&
                        ebpo_attribute_range(&all->array[i], all->workspace, to->range);
    }
    bool made = plan->attribute && coder;
    if (coder)
        ebpo_chunk_coder_clear(coder);
    free(coder);
    if (!made)
        return ebpo_fail_memory(error, all->count * sizeof *plan->attribute);
    if (wrong)
        return ebpo_fail_at(error, EBPO_E_ARGUMENT, shown, "/attributes", -1,
                            "%s; the tree was not written", wrong);
    return ebpo_attributes_digest(all, plan->attributes_sha256, error);
}

/* --- attributes: arrays --- */

/* Returns the maximum number of arrays in /attributes. */
static uint64_t attributes_planned(const ebpo_plan *plan)
{
    return plan->attributes ? 1 + 2 * plan->attributes->count : 0;
}

/* Adds array `number` of /attributes to the plan. `size`: bytes of an element. */
static void add_attribute_array(ebpo_plan *plan, int number, const void *values, uint64_t rows,
                                uint32_t cols, unsigned size, ebpo_pipeline pipeline)
{
    ebpo_array_out *a = &plan->array[plan->count++];
    *a = (ebpo_array_out){ .id = EBPO_A_ATTRIBUTE,
                           .level = number,
                           .handle = -1,
                           .values = values,
                           .value_size = (uint8_t)size,
                           .rows_of = EBPO_A_ATTRIBUTE };
    ebpo_attribute_path(number, a->path);
    a->shape = (ebpo_shape){
        .rows = rows, .cols = cols, .element_size = (uint8_t)size, .pipeline = pipeline
    };
    a->shape.chunk_rows = ebpo_rows_of_chunk(&plan->info, EBPO_A_ATTRIBUTE, 0, rows, cols, size);
}

/* Adds the one or two arrays of attribute array n to the plan. */
static void add_one(ebpo_plan *plan, uint64_t n, ebpo_pipeline pipeline)
{
    const ebpo_attribute *a = &plan->attributes->array[n];
    unsigned bytes = ebpo_attribute_bytes(a->type);
    uint64_t items = a->ends ? ebpo_attribute_value_count(a) : 0;
    /* flat: the array has one dimension */
    bool flat = a->ends || (a->columns == 1 && a->list == EBPO_ATTRIBUTE_NO_LIST);
    if (a->ends)
        add_attribute_array(plan, ebpo_values_number(n), a->ends, a->rows, 0, sizeof *a->ends,
                            pipeline);
    else
        add_attribute_array(plan, ebpo_values_number(n), a->values, a->rows, flat ? 0 : a->columns,
                            bytes, pipeline);
    ebpo_array_out *made = &plan->array[plan->count - 1];
    made->columns = plan->attribute[n].columns;
    if (ebpo_attribute_is_of_mesh(a))
        made->rows_of = ebpo_attribute_is_of(a, "vertex") ? EBPO_A_VERTICES : EBPO_A_FACES;
    if (!items)
        return;
    add_attribute_array(plan, ebpo_items_number(n), a->values, items, 0, bytes, pipeline);
    plan->array[plan->count - 1].columns = plan->attribute[n].items_columns;
}

static void attributes_add_arrays(ebpo_plan *plan, ebpo_pipeline pipeline)
{
    const ebpo_attributes *all = plan->attributes;
    if (!all)
        return;
    if (all->header)
        add_attribute_array(plan, 0, all->header, all->header_bytes, 0, 1, pipeline);
    for (uint64_t i = 0; i < all->count; i++)
        add_one(plan, i, pipeline);
}

/* Returns true if an array of /attributes contains floating-point numbers. `array` is not the
 * header. */
static bool floats_in(const ebpo_plan *plan, const ebpo_array_out *array)
{
    const ebpo_attribute *a = &plan->attributes->array[(array->level - 1) / 2];
    bool ends = array->level % 2 && a->ends;
    return !ends && ebpo_attribute_is_float(a->type);
}

static void attributes_encode(const ebpo_plan *plan, const ebpo_array_out *array, uint64_t row,
                              uint64_t rows, uint8_t *encoded)
{
    uint32_t cols = array->shape.cols ? array->shape.cols : 1;
    const uint8_t *values = array->values;
    values += row * cols * array->value_size;
    if (array->columns)
        ebpo_columns_encode(values, array->value_size, floats_in(plan, array), rows, cols, encoded);
    else
        ebpo_integers_encode(values, array->value_size, rows * cols, array->value_size, encoded);
}

/* --- attributes: HDF5 attributes --- */

ebpo_status ebpo_attributes_put_group(ebpo_h5_out *out, const ebpo_plan *plan, ebpo_error *error)
{
    unsigned links = 0;
    char hex[65];
    ebpo_h5_id id;
    if (!plan->attributes)
        return EBPO_OK;
    for (unsigned i = 0; i < plan->count; i++)
        links += plan->array[i].id == EBPO_A_ATTRIBUTE;
    ebpo_status status = ebpo_h5_make_group(out, "/attributes", links, &id, error);
    ebpo_sha256_hex(plan->attributes_sha256, hex);
    if (status == EBPO_OK)
        status = ebpo_h5_put_count(out, id, "arrays", plan->attributes->count, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_text(out, id, "sha256", hex, error);
    if (status == EBPO_OK)
        status =
            ebpo_h5_put_text(out, id, "about",
                             "values that the source has for vertices, faces and others", error);
    ebpo_h5_close_id(out, id);
    return status;
}

static ebpo_status put_list(ebpo_h5_out *out, ebpo_h5_id id, const ebpo_attribute *a,
                            ebpo_error *error)
{
    if (a->list == EBPO_ATTRIBUTE_NO_LIST)
        return EBPO_OK;
    ebpo_status status =
        ebpo_h5_put_text(out, id, "list", ebpo_attribute_type_name((ebpo_attribute_type)a->list),
                         error);
    return status == EBPO_OK ? ebpo_h5_put_count(out, id, "lengths_differ", a->ends != NULL, error)
                             : status;
}

ebpo_status ebpo_attributes_put_array(ebpo_h5_out *out, const ebpo_plan *plan,
                                      const ebpo_array_out *array, ebpo_error *error)
{
    ebpo_status status =
        ebpo_h5_put_text(out, array->handle, "coding",
                         array->columns ? ebpo_coding_columns : ebpo_coding_plain, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_text(
            out, array->handle, "about",
            ebpo_attribute_about(array->level,
                                 array->level % 2 &&
                                     plan->attributes->array[(array->level - 1) / 2].ends),
            error);
    if (array->level % 2 == 0)
        return status;
    uint64_t n = (uint64_t)(array->level - 1) / 2;
    const ebpo_attribute *a = &plan->attributes->array[n];
    if (status == EBPO_OK)
        status = ebpo_h5_put_text(out, array->handle, "element", a->element, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_text(out, array->handle, "columns", a->names, error);
    if (status == EBPO_OK)
        status =
            ebpo_h5_put_text(out, array->handle, "type", ebpo_attribute_type_name(a->type), error);
    if (status == EBPO_OK)
        status = put_list(out, array->handle, a, error);
    if (status == EBPO_OK && plan->attribute[n].has_range)
        status = ebpo_h5_put_real(out, array->handle, "range", plan->attribute[n].range, 2, error);
    return status;
}

/* --- encoding rows --- */

/* Encodes rows of leaf_skip: for each leaf, the number of faces between its new faces and those of
 * the previous leaf of the level. */
static void encode_skips(const ebpo_level *level, const ebpo_shape *shape, uint64_t row,
                         uint64_t rows, uint8_t *encoded)
{
    for (uint64_t i = row; i < row + rows; i++) {
        uint64_t skip =
            level->leaf_first[i] - (i ? level->leaf_first[i - 1] + level->leaf_new[i - 1] : 0);
        ebpo_integers_encode(&skip, sizeof skip, 1, shape->element_size, encoded);
        encoded += shape->element_size;
    }
}

/* Returns the block of EBPO_INDEX_ROWS leaves that contains reference `ref` of the level. This is
 * the last block with at most `ref` references in the leaves before the block. leaf_index has this
 * number for each block. */
static uint64_t block_of(const uint64_t *leaf_index, uint64_t leaves, uint64_t ref)
{
    uint64_t low = 0, high = (leaves - 1) / EBPO_INDEX_ROWS;
    while (low < high) {
        uint64_t middle = (low + high + 1) / 2;
        if (leaf_index[middle * 3 + 1] <= ref)
            low = middle;
        else
            high = middle - 1;
    }
    return low;
}

/* Encodes rows of leaf_refs. A leaf's references are stored from the last to the first. A reference
 * is stored as the number of faces between it and the next greater reference of the leaf. For the
 * last reference, the leaf's first new face takes the place of the next greater reference. */
static void encode_refs(const ebpo_level *level, const uint64_t *leaf_index, uint64_t row,
                        uint64_t rows, uint8_t *encoded)
{
    uint64_t block = block_of(leaf_index, level->leaf_count, row);
    uint64_t leaf = block * EBPO_INDEX_ROWS, before = leaf_index[block * 3 + 1], end = row + rows;
    for (; before < end; before += level->leaf_ref_count[leaf++]) {
        uint64_t count = level->leaf_ref_count[leaf];
        /* `refs` ascend, but are stored from the last to the first */
        const uint32_t *refs = level->leaf_refs + before;
        for (uint64_t k = row > before ? row - before : 0; k < count && before + k < end; k++) {
            uint64_t above = k ? refs[count - k] : level->leaf_first[leaf];
            ebpo_store32(encoded + 4 * (before + k - row),
                         (uint32_t)(above - 1 - refs[count - 1 - k]));
        }
    }
}

void ebpo_plan_encode(const ebpo_plan *plan, const ebpo_array_out *array, uint64_t row,
                      uint64_t rows, uint8_t *encoded)
{
    const ebpo_tree *tree = plan->tree;
    const ebpo_level *level = &tree->level[array->level];
    uint64_t used;
    switch (array->id) {
    case EBPO_A_LEAF_SKIP: encode_skips(level, &array->shape, row, rows, encoded); break;
    case EBPO_A_LEAF_REFS:
        encode_refs(level, plan->index[array->level][EBPO_INDEX_LEAVES], row, rows, encoded);
        break;
    case EBPO_A_VERTICES:
        if (tree->mesh.xyz32)
            ebpo_points32_encode(tree->mesh.xyz32 + 3 * row, rows, encoded);
        else
            ebpo_points64_encode(tree->mesh.xyz64 + 3 * row, rows, encoded);
        break;
    case EBPO_A_FACES:
        used = plan->faces_index[row / array->shape.chunk_rows]; /* vertices of earlier chunks */
        /* does not fail, because index_faces has checked the faces */
        (void)ebpo_corners_encode(tree->mesh.faces + 3 * row, rows, &used, encoded);
        break;
    case EBPO_A_BORDER_POINTS:
        ebpo_border_encode(&tree->border, plan->info.double_coordinates, row, rows, encoded);
        break;
    case EBPO_A_VERTEX_SOURCE: ebpo_numbers_encode(tree->vertex_source + row, rows, encoded); break;
    case EBPO_A_ATTRIBUTE: attributes_encode(plan, array, row, rows, encoded); break;
    case EBPO_A_FACE_SOURCE: ebpo_numbers_encode(tree->face_source + row, rows, encoded); break;
    default: {
        uint64_t cols = array->shape.cols ? array->shape.cols : 1;
        const uint8_t *values = array->values;
        ebpo_integers_encode(values + row * cols * array->value_size, array->value_size,
                             rows * cols, array->shape.element_size, encoded);
    }
    }
}

void ebpo_plan_free(ebpo_plan *plan)
{
    free(plan->array);
    for (int level = 0; level < EBPO_LEVELS_MAX; level++)
        for (int i = 0; i < EBPO_INDEXES; i++)
            free(plan->index[level][i]);
    free(plan->faces_index);
    free(plan->attribute);
    ebpo_subtree_sums_free(&plan->subtrees);
    memset(plan, 0, sizeof *plan);
}

static void summarise_levels(ebpo_info *info, const ebpo_tree *tree)
{
    for (int i = 0; i < info->level_count; i++) {
        info->level[i] = ebpo_level_summarise(&tree->level[i], info->parts);
        info->level[i].pruned_count = info->pruned ? tree->level[i].pruned_count : 0;
    }
}

/* Returns true if all texts end within their arrays and are UTF-8 without control characters. */
static bool texts_ok(const ebpo_info *info)
{
    const struct {
        const char *text;
        size_t size;
    } texts[] = {
        { info->generator, sizeof info->generator },
        { info->source_name, sizeof info->source_name },
        { info->source_format, sizeof info->source_format },
        { info->unit, sizeof info->unit },
        { info->crs, sizeof info->crs },
        { info->date, sizeof info->date },
    };
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++)
        if (!memchr(texts[i].text, 0, texts[i].size) || !ebpo_text_ok(texts[i].text))
            return false;
    return true;
}

/* Returns true if faces are to be stored as gates: relative to edges of preceding faces
 * (hdf5_read/face_gates.h). By default, faces are stored as gates if the tree was read from a file
 * with gates (`tree_has_gates`) and the new file is compressed. Without compression, gates take
 * more space, because they contain many zero bytes. */
static bool gates_wanted(const ebpo_info *info, bool tree_has_gates, ebpo_face_coding coding)
{
    bool by_default = tree_has_gates && info->codec != EBPO_CODEC_NONE;
    return info->parts & EBPO_PART_MESH &&
           (coding == EBPO_FACES_DEFAULT ? by_default : coding == EBPO_FACES_GATES);
}

/* Computes plan->info: the parts that are requested and available, and the counts of written items.
 */
static ebpo_status resolve_facts(ebpo_plan *plan, const ebpo_write_options *options,
                                 const ebpo_check *check, ebpo_error *error)
{
    const ebpo_tree *tree = plan->tree;
    ebpo_info *info = &plan->info;
    if ((unsigned)options->face_coding > EBPO_FACES_HIGH_WATER)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "face_coding: invalid value %u",
                         (unsigned)options->face_coding);
    *info = tree->info;
    info->version_major = EBPO_FORMAT_MAJOR;
    info->version_minor = EBPO_FORMAT_MINOR;
    info->codec = options->codec;
    info->subtree_level = 0;
    info->top_bytes = 0;
    info->gates = false;
    info->parts &= options->parts;
    if (!(info->parts & EBPO_PART_MESH))
        info->parts &= ~(uint32_t)(EBPO_PART_MAPS | EBPO_PART_ATTRIBUTES | EBPO_PART_BORDER);
    plan->attributes = info->parts & EBPO_PART_ATTRIBUTES ? tree->mesh.attributes : NULL;
    if (!plan->attributes)
        info->parts &= ~(uint32_t)EBPO_PART_ATTRIBUTES;
    if (!info->generator[0])
        snprintf(info->generator, sizeof info->generator, "ebpo %s", EBPO_VERSION);
    if (info->parts & EBPO_PART_MESH) {
        bool one_precision = !tree->mesh.xyz32 != !tree->mesh.xyz64;
        if (!one_precision || !tree->mesh.faces || tree->mesh.vertex_count != info->vertex_count ||
            tree->mesh.face_count != info->face_count)
            return ebpo_check_fail(
                check, -1, "/mesh",
                "the mesh is missing, or its counts differ from the counts in the tree's info",
                error);
        info->double_coordinates = tree->mesh.xyz64 != NULL;
    }
    if (info->parts & EBPO_PART_MAPS && (!tree->vertex_source || !tree->face_source))
        return ebpo_check_fail(check, -1, "/maps", "the source indices (part maps) are missing",
                               error);
    if (info->level_count < 1 || info->level_count > EBPO_LEVELS_MAX || info->grid_level < 0 ||
        info->max_level < 0 || (unsigned)info->rule > EBPO_RULE_POSITIVE)
        return ebpo_check_fail(check, -1, "/levels",
                               "level_count, grid_level, max_level or rule is out of range", error);
    if (!texts_ok(info))
        return ebpo_check_fail(check, -1, "/",
                               "a name, unit, CRS or date is not UTF-8 without control characters",
                               error);
    summarise_levels(info, tree);
    info->subtree_level = ebpo_subtree_level_for(info, options->subtree_faces);
    info->gates = gates_wanted(info, tree->info.gates, options->face_coding);
    return ebpo_facts_check(info, check->shown, check->as, error);
}

/* Checks all arrays that will be written. */
static ebpo_status check_tree(ebpo_plan *plan, const ebpo_check *check, ebpo_error *error)
{
    const ebpo_tree *tree = plan->tree;
    const ebpo_info *info = &plan->info;
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < info->level_count && status == EBPO_OK; i++)
        status = ebpo_check_level(check, info, i, &tree->level[i], error);
    if (status == EBPO_OK && info->parts & EBPO_PART_MESH)
        status = ebpo_check_order(check, tree, error);
    if (status == EBPO_OK && info->parts & EBPO_PART_MESH)
        status = ebpo_check_finite(check, &tree->mesh, error);
    if (status == EBPO_OK && info->parts & EBPO_PART_BORDER)
        status = ebpo_check_border(check, info, &tree->border, error);
    if (status == EBPO_OK && info->parts & EBPO_PART_SURFACE)
        status = ebpo_check_surface(check, info, &tree->surface, error);
    if (status == EBPO_OK && info->parts & EBPO_PART_MAPS)
        status = ebpo_check_map(check, "/maps/vertex_source", tree->vertex_source,
                                info->vertex_count, info->source_vertex_count, error);
    if (status == EBPO_OK && info->parts & EBPO_PART_MAPS)
        status = ebpo_check_map(check, "/maps/face_source", tree->face_source, info->face_count,
                                info->source_face_count + info->repair_record.added_faces, error);
    return status;
}

/* Computes the volumes of leaves' envelopes if planes of leaves are in the tree, but are not
 * written. (Volumes are kept if the planes of gray nodes are not written either: the test vectors
 * have files of this kind.) */
static void measure_leaves(ebpo_plan *plan)
{
    double gray[EBPO_LEVELS_MAX], leaf[EBPO_LEVELS_MAX];
    ebpo_info *info = &plan->info;
    uint32_t lost = plan->tree->info.parts & ~info->parts;
    if ((lost & (EBPO_PART_PLANES | EBPO_PART_LEAF_PLANES)) != EBPO_PART_LEAF_PLANES)
        return;
    ebpo_tree_volumes(plan->tree, info->parts, gray, leaf);
    for (int i = 0; i < info->level_count; i++)
        info->level[i].leaf_volume = leaf[i];
}

static ebpo_status index_levels(ebpo_plan *plan, ebpo_error *error)
{
    for (int i = 0; i < plan->info.level_count; i++) {
        const ebpo_level *level = &plan->tree->level[i];
        ebpo_level stored = *level; /* the level without the arrays of omitted parts */
        if (!(plan->info.parts & EBPO_PART_MESH))
            stored.leaf_first = NULL;
        if (!(plan->info.parts & EBPO_PART_LEAF_PLANES))
            stored.leaf_plane_counts = NULL;
        uint64_t **index = plan->index[i];
        index[EBPO_INDEX_TYPES] = ebpo_index_types(level, i == 0);
        index[EBPO_INDEX_GRAY] = ebpo_index_gray(level);
        index[EBPO_INDEX_LEAVES] = ebpo_index_leaves(&stored);
        for (int k = 0; k < EBPO_INDEXES; k++)
            if (!index[k])
                return ebpo_fail_memory(error, level->leaf_count / EBPO_INDEX_ROWS * 24);
    }
    return EBPO_OK;
}

/* Computes plan->faces_index, the number of vertices that the faces before each chunk use. Checks
 * that the vertices are in the order of their first use. */
static ebpo_status index_faces(ebpo_plan *plan, const ebpo_check *check, ebpo_error *error)
{
    const ebpo_mesh *mesh = &plan->tree->mesh;
    uint32_t rows =
        ebpo_rows_of_chunk(&plan->info, EBPO_A_FACES, 0, mesh->face_count, 3, sizeof(uint32_t));
    plan->faces_index = ebpo_alloc(mesh->face_count / rows + 1, sizeof *plan->faces_index);
    if (!plan->faces_index)
        return ebpo_fail_memory(error, mesh->face_count / rows * 8);
    uint64_t used = 0;
    EBPO_FOR_ITEMS(mesh->workspace, i, 0, mesh->face_count * 3) {
        if (i % (3 * (uint64_t)rows) == 0)
            plan->faces_index[i / (3 * (uint64_t)rows)] = used;
        if (mesh->faces[i] > used || mesh->faces[i] >= mesh->vertex_count)
            return ebpo_check_fail(
                check, -1, "/mesh/faces",
                "the vertices are not in the order of their first use by the faces", error);
        used += mesh->faces[i] == used;
    }
    return EBPO_OK;
}

/* Returns the smallest size of an element, 1, 2 or 4 bytes, that is sufficient for all values. */
static uint8_t narrow_unsigned(const ebpo_level *level, const uint32_t *values, uint64_t count)
{
    uint32_t bits = 0; /* bits that are set in any value */
    EBPO_FOR_ITEMS(level->workspace, i, 0, count)
        bits |= values[i];
    return bits <= UINT8_MAX ? 1 : bits <= UINT16_MAX ? 2 : 4;
}

/* Same as narrow_unsigned, for signed values. */
static uint8_t narrow_signed(const ebpo_level *level, const int32_t *values, uint64_t count)
{
    int32_t low = 0, high = 0;
    EBPO_FOR_ITEMS(level->workspace, i, 0, count) {
        low = values[i] < low ? values[i] : low;
        high = values[i] > high ? values[i] : high;
    }
    return low >= INT8_MIN && high <= INT8_MAX ? 1 : low >= INT16_MIN && high <= INT16_MAX ? 2 : 4;
}

/* Returns the size of an element in the file: the only allowed size, or the smallest allowed size
 * that is sufficient for all values. In the second case, values have 32 bits in memory (schema.c).
 */
static uint8_t stored_size(const ebpo_plan *plan, const ebpo_array_out *a, const void *values)
{
    const ebpo_array_spec *spec = &ebpo_schema[a->id];
    if (a->id == EBPO_A_VERTICES || a->id == EBPO_A_BORDER_POINTS)
        return plan->info.double_coordinates ? 8 : 4;
    if (!(spec->sizes & (spec->sizes - 1)))
        return spec->sizes;
    const ebpo_level *level = &plan->tree->level[a->level];
    uint64_t count = ebpo_level_rows(level, a->id);
    return spec->is_signed ? narrow_signed(level, values, count)
                           : narrow_unsigned(level, values, count);
}

/* Sets the array's values, and the size of an element in memory and in the file. */
static void find_values(const ebpo_plan *plan, ebpo_array_out *a)
{
    const ebpo_array_spec *spec = &ebpo_schema[a->id];
    if (a->id == EBPO_A_BORDER_LOOPS)
        a->values = plan->tree->border.loop;
    else if (a->id == EBPO_A_SURFACE_PATCHES)
        a->values = plan->tree->surface.patch;
    else if (a->id == EBPO_A_SURFACE_TRIANGLES)
        a->values = plan->tree->surface.code;
    else if (a->id == EBPO_A_SURFACE_POINTS)
        a->values = plan->tree->surface.point;
    else if (a->id == EBPO_A_SURFACE_NORMALS)
        a->values = plan->tree->surface.normal;
    else if (a->id == EBPO_A_SURFACE_COLOURS)
        a->values = plan->tree->surface.colour;
    else if (a->id == EBPO_A_FACES_INDEX)
        a->values = plan->faces_index;
    else if (a->id == EBPO_A_SUBTREE_INDEX)
        a->values = plan->subtrees.index;
    else if (a->id == EBPO_A_SUBTREE_COUNTS)
        a->values = plan->subtrees.counts;
    else if (a->id == EBPO_A_SUBTREE_SHARED)
        a->values = plan->subtrees.shared;
    else if (ebpo_schema_is_held(a->id))
        a->values = ebpo_level_array(&plan->tree->level[a->level], a->id);
    else if (spec->per >= EBPO_PER_GROUP_BLOCK && spec->per <= EBPO_PER_LEAF_BLOCK)
        a->values = plan->index[a->level][spec->per - EBPO_PER_GROUP_BLOCK];
    a->value_size = spec->held_size ? spec->held_size : spec->sizes;
    a->shape.element_size = stored_size(plan, a, a->values);
}

/* Returns the HDF5 filters of a codec. */
static ebpo_pipeline pipeline_of(ebpo_codec codec)
{
    _Static_assert((int)EBPO_CODEC_ZSTD == (int)EBPO_PIPELINE_ZSTD &&
                       (int)EBPO_CODEC_DEFLATE == (int)EBPO_PIPELINE_DEFLATE &&
                       (int)EBPO_CODEC_NONE == (int)EBPO_PIPELINE_CHECKSUM,
                   "pipelines begin with the codecs, in their order");
    return (ebpo_pipeline)codec;
}

/* Adds an array of a level or of the root to the plan. Does nothing if the array has no rows or may
 * be omitted. */
static void add_array(ebpo_plan *plan, ebpo_array_id id, int level)
{
    uint64_t rows = id == EBPO_A_SUBTREE_SHARED ? plan->subtrees.shared_count
                                                : ebpo_schema_rows(&plan->info, id, level);
    if (rows == 0 || rows == EBPO_ROWS_STATED ||
        (id < EBPO_LEVEL_ARRAYS && ebpo_schema[id].if_needed &&
         ebpo_level_is_default(&plan->tree->level[level], id)))
        return;
    ebpo_array_out *a = &plan->array[plan->count++];
    *a = (ebpo_array_out){ .id = id, .level = level, .handle = -1 };
    ebpo_schema_path(id, level, a->path);
    find_values(plan, a);
    a->shape.rows = rows;
    a->shape.cols = ebpo_schema_cols(&plan->info, id);
    a->shape.is_signed = ebpo_schema[id].is_signed;
    a->shape.chunk_rows =
        ebpo_rows_of_chunk(&plan->info, id, level, rows, a->shape.cols, a->shape.element_size);
    a->shape.pipeline = pipeline_of(plan->info.codec);
    a->gates = id == EBPO_A_FACES && plan->info.gates;
}

ebpo_status ebpo_plan_make(ebpo_plan *plan, const ebpo_tree *tree,
                           const ebpo_write_options *options, const char *shown, ebpo_error *error)
{
    ebpo_check check = { shown, EBPO_E_ARGUMENT, tree->workspace };
    memset(plan, 0, sizeof *plan);
    plan->tree = tree;
    ebpo_status status = resolve_facts(plan, options, &check, error);
    if (status == EBPO_OK)
        status = check_tree(plan, &check, error);
    if (status == EBPO_OK)
        measure_leaves(plan);
    if (status == EBPO_OK)
        status = index_levels(plan, error);
    if (status == EBPO_OK && plan->info.parts & EBPO_PART_MESH)
        status = index_faces(plan, &check, error);
    if (status == EBPO_OK && plan->info.subtree_level)
        status = ebpo_subtree_sums_make(&plan->subtrees, tree, &plan->info, error);
    if (status == EBPO_OK)
        status = attributes_plan(plan, shown, error);
    if (status != EBPO_OK)
        goto done;
    plan->array = ebpo_alloc((uint64_t)plan->info.level_count * EBPO_LEVEL_ARRAYS + EBPO_ARRAYS +
                                 attributes_planned(plan),
                             sizeof *plan->array);
    if (!plan->array) {
        status = ebpo_fail_memory(error, sizeof *plan->array);
        goto done;
    }
    for (int level = 0; level < plan->info.level_count; level++)
        for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++)
            add_array(plan, (ebpo_array_id)id, level);
    for (int id = EBPO_LEVEL_ARRAYS; id < EBPO_A_CHUNK_DIRECTORY; id++)
        add_array(plan, (ebpo_array_id)id, 0);
    attributes_add_arrays(plan, pipeline_of(plan->info.codec));
done:
    if (status != EBPO_OK)
        ebpo_plan_free(plan);
    return status;
}
