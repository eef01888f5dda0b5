#include "format/plan.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/arrays.h"
#include "core/text.h"
#include "hdf5_read/coding.h"
#include "format/schema.h"
#include "format/attribute_plan.h"
#include "format/chunk_rows.h"
#include "format/head_facts.h"
#include "format/rank_index.h"
#include "ebpo_config.h"

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

/* Without compression bytes of zeros count, so they are not kept there. */
static bool gates_wanted(const ebpo_info *info, bool had, ebpo_face_coding coding)
{
    bool usual = had && info->codec != EBPO_CODEC_NONE;
    return info->parts & EBPO_PART_MESH &&
           (coding == EBPO_FACES_USUAL ? usual : coding == EBPO_FACES_GATES);
}

/* The facts as the file will state them: parts that are wanted and there, counts of what is
 * written. */
static ebpo_status resolve_facts(ebpo_plan *plan, const ebpo_write_options *options,
                                 const ebpo_check *check, ebpo_error *error)
{
    const ebpo_tree *tree = plan->tree;
    ebpo_info *info = &plan->info;
    if ((unsigned)options->face_coding > EBPO_FACES_HIGH_WATER)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "face_coding: there is no coding number %u",
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
        info->parts &= ~(uint32_t)(EBPO_PART_MAPS | EBPO_PART_ATTRIBUTES);
    plan->attributes = info->parts & EBPO_PART_ATTRIBUTES ? tree->mesh.attributes : NULL;
    if (!plan->attributes)
        info->parts &= ~(uint32_t)EBPO_PART_ATTRIBUTES;
    if (!info->generator[0])
        snprintf(info->generator, sizeof info->generator, "ebpo %s", EBPO_VERSION);
    if (info->parts & EBPO_PART_MESH) {
        bool one = !tree->mesh.xyz32 != !tree->mesh.xyz64;
        if (!one || !tree->mesh.faces || tree->mesh.vertex_count != info->vertex_count ||
            tree->mesh.face_count != info->face_count)
            return ebpo_check_fail(check, -1, "/mesh",
                                   "the mesh is missing or its counts are not those of the facts",
                                   error);
        info->double_coordinates = tree->mesh.xyz64 != NULL;
    }
    if (info->parts & EBPO_PART_MAPS && (!tree->vertex_source || !tree->face_source))
        return ebpo_check_fail(check, -1, "/maps", "the maps are missing", error);
    if (info->level_count < 1 || info->level_count > EBPO_LEVELS_MAX || info->grid_level < 0 ||
        info->max_level < 0 || (unsigned)info->rule > EBPO_RULE_POSITIVE)
        return ebpo_check_fail(check, -1, "/levels",
                               "there are no levels, too many, or impossible facts", error);
    if (!texts_ok(info))
        return ebpo_check_fail(check, -1, "/",
                               "a name, unit, CRS or date is not UTF-8 without control characters",
                               error);
    summarise_levels(info, tree);
    info->subtree_level = ebpo_subtree_level_for(info, options->subtree_faces);
    info->gates = gates_wanted(info, tree->info.gates, options->face_coding);
    return ebpo_facts_check(info, check->shown, check->as, error);
}

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
    if (status == EBPO_OK && info->parts & EBPO_PART_MAPS)
        status = ebpo_check_map(check, "/maps/vertex_source", tree->vertex_source,
                                info->vertex_count, info->source_vertex_count, error);
    if (status == EBPO_OK && info->parts & EBPO_PART_MAPS)
        status = ebpo_check_map(check, "/maps/face_source", tree->face_source, info->face_count,
                                info->source_face_count + info->mend.added_faces, error);
    return status;
}

static ebpo_status index_levels(ebpo_plan *plan, ebpo_error *error)
{
    for (int i = 0; i < plan->info.level_count; i++) {
        const ebpo_level *level = &plan->tree->level[i];
        ebpo_level stored = *level; /* without the parts that are left out */
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

static ebpo_status index_faces(ebpo_plan *plan, const ebpo_check *check, ebpo_error *error)
{
    const ebpo_mesh *mesh = &plan->tree->mesh;
    uint32_t rows =
        ebpo_rows_of_chunk(&plan->info, EBPO_A_FACES, 0, mesh->face_count, 3, sizeof(uint32_t));
    plan->faces_index = ebpo_alloc(mesh->face_count / rows + 1, sizeof *plan->faces_index);
    if (!plan->faces_index)
        return ebpo_fail_memory(error, mesh->face_count / rows * 8);
    uint64_t seen = 0;
    EBPO_FOR_ITEMS(mesh->workspace, i, 0, mesh->face_count * 3) {
        if (i % (3 * (uint64_t)rows) == 0)
            plan->faces_index[i / (3 * (uint64_t)rows)] = seen;
        if (mesh->faces[i] > seen || mesh->faces[i] >= mesh->vertex_count)
            return ebpo_check_fail(
                check, -1, "/mesh/faces",
                "the vertices are not in the order of their first use by the faces", error);
        seen += mesh->faces[i] == seen;
    }
    return EBPO_OK;
}

/* Least of 1, 2, 4 bytes that holds all values. */
static uint8_t narrow_unsigned(const ebpo_level *level, const uint32_t *values, uint64_t count)
{
    uint32_t all = 0;
    EBPO_FOR_ITEMS(level->workspace, i, 0, count)
        all |= values[i];
    return all <= UINT8_MAX ? 1 : all <= UINT16_MAX ? 2 : 4;
}

static uint8_t narrow_signed(const ebpo_level *level, const int32_t *values, uint64_t count)
{
    int32_t low = 0, high = 0;
    EBPO_FOR_ITEMS(level->workspace, i, 0, count) {
        low = values[i] < low ? values[i] : low;
        high = values[i] > high ? values[i] : high;
    }
    return low >= INT8_MIN && high <= INT8_MAX ? 1 : low >= INT16_MIN && high <= INT16_MAX ? 2 : 4;
}

/* Bytes of an element in the file. schema.c: where there is a choice, values are of 32 bits. */
static uint8_t stored_size(const ebpo_plan *plan, const ebpo_array_out *a, const void *values)
{
    const ebpo_array_spec *spec = &ebpo_schema[a->id];
    if (a->id == EBPO_A_VERTICES)
        return plan->info.double_coordinates ? 8 : 4;
    if (!(spec->sizes & (spec->sizes - 1)))
        return spec->sizes;
    const ebpo_level *level = &plan->tree->level[a->level];
    uint64_t count = ebpo_level_rows(level, a->id);
    return spec->is_signed ? narrow_signed(level, values, count)
                           : narrow_unsigned(level, values, count);
}

/* Where the values are and how wide they get. */
static void find_values(const ebpo_plan *plan, ebpo_array_out *a)
{
    const ebpo_array_spec *spec = &ebpo_schema[a->id];
    if (a->id == EBPO_A_FACES_INDEX)
        a->values = plan->faces_index;
    else if (a->id == EBPO_A_SUBTREE_INDEX)
        a->values = plan->subtrees.index;
    else if (a->id == EBPO_A_SUBTREE_COUNTS)
        a->values = plan->subtrees.counts;
    else if (a->id == EBPO_A_SUBTREE_OUTER)
        a->values = plan->subtrees.outer;
    else if (ebpo_schema_is_held(a->id))
        a->values = ebpo_level_array(&plan->tree->level[a->level], a->id);
    else if (spec->per >= EBPO_PER_GROUP_BLOCK && spec->per <= EBPO_PER_LEAF_BLOCK)
        a->values = plan->index[a->level][spec->per - EBPO_PER_GROUP_BLOCK];
    a->value_size = spec->held_size ? spec->held_size : spec->sizes;
    a->shape.element_size = stored_size(plan, a, a->values);
}

static ebpo_pipeline pipeline_of(ebpo_codec codec)
{
    return codec == EBPO_CODEC_ZSTD      ? EBPO_PIPELINE_ZSTD
           : codec == EBPO_CODEC_DEFLATE ? EBPO_PIPELINE_DEFLATE
                                         : EBPO_PIPELINE_CHECKSUM;
}

static void add_array(ebpo_plan *plan, ebpo_array_id id, int level)
{
    uint64_t rows = id == EBPO_A_SUBTREE_OUTER ? plan->subtrees.outer_count
                                               : ebpo_schema_rows(&plan->info, id, level);
    if (rows == 0 || rows == EBPO_ROWS_STATED ||
        (id < EBPO_LEVEL_ARRAYS && ebpo_schema[id].if_needed &&
         ebpo_level_is_usual(&plan->tree->level[level], id)))
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
        status = index_levels(plan, error);
    if (status == EBPO_OK && plan->info.parts & EBPO_PART_MESH)
        status = index_faces(plan, &check, error);
    if (status == EBPO_OK && plan->info.subtree_level)
        status = ebpo_subtree_sums_make(&plan->subtrees, tree, &plan->info, error);
    if (status == EBPO_OK)
        status = ebpo_attributes_plan(plan, shown, error);
    if (status != EBPO_OK)
        goto done;
    plan->array = ebpo_alloc((uint64_t)plan->info.level_count * EBPO_LEVEL_ARRAYS + EBPO_ARRAYS +
                                 ebpo_attributes_planned(plan),
                             sizeof *plan->array);
    if (!plan->array) {
        status = ebpo_fail_memory(error, sizeof *plan->array);
        goto done;
    }
    for (int level = 0; level < plan->info.level_count; level++)
        for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++)
            add_array(plan, (ebpo_array_id)id, level);
    for (int id = EBPO_LEVEL_ARRAYS; id < EBPO_A_PLACES; id++)
        add_array(plan, (ebpo_array_id)id, 0);
    ebpo_attributes_add_arrays(plan, pipeline_of(plan->info.codec));
done:
    if (status != EBPO_OK)
        ebpo_plan_free(plan);
    return status;
}
