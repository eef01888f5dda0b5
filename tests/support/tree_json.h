/* Writes a tree as JSON: the content of the vectors' .json files, which every reader must reproduce
 * from a file. The arrays are those of ebpo_tree. Coordinates have enough digits to restore every
 * bit. */
#ifndef TREE_JSON_H
#define TREE_JSON_H

#include <inttypes.h>
#include <stdio.h>

#include <ebpo/file.h>

#include "core/checksum.h"

/* Writes long arrays as their SHA-256, as little-endian integers and floats of the widths in
 * ebpo_tree. */
static void tj_digest(FILE *out, const void *values, uint64_t count, size_t size)
{
    const uint8_t *from = values;
    uint8_t digest[32], item[8];
    char hex[65];
    ebpo_sha256 state;
    ebpo_sha256_begin(&state);
    for (uint64_t i = 0; i < count; i++, from += size) {
        for (size_t k = 0; k < size; k++)
            item[k] = from[__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__ ? k : size - 1 - k];
        ebpo_sha256_add(&state, item, size);
    }
    ebpo_sha256_end(&state, digest);
    ebpo_sha256_hex(digest, hex);
    fprintf(out, "\"sha256 %s\"", hex);
}

#define TJ_ARRAY(out, name, values, count, format)                      \
    do {                                                                \
        fprintf(out, ",\n   \"%s\": ", name);                           \
        if (!(values)) {                                                \
            fprintf(out, "null");                                       \
            break;                                                      \
        }                                                               \
        if ((count) > 1000) {                                           \
            tj_digest(out, values, count, sizeof *(values));            \
            break;                                                      \
        }                                                               \
        fprintf(out, "[");                                              \
        for (uint64_t tj_i = 0; tj_i < (count); tj_i++)                 \
            fprintf(out, "%s" format, tj_i ? "," : "", (values)[tj_i]); \
        fprintf(out, "]");                                              \
    } while (0)

static void tj_level(FILE *out, const ebpo_level *l, int number)
{
    fprintf(out, "  {\"level\": %d,\n   \"gray_volume\": %.17g,\n   \"leaf_volume\": %.17g", number,
            l->gray_volume, l->leaf_volume);
    TJ_ARRAY(out, "types", l->types, l->group_count, "%" PRIu16);
    TJ_ARRAY(out, "plane_counts", l->plane_counts, l->gray_count, "%" PRIu8);
    TJ_ARRAY(out, "planes", l->planes, l->plane_count, "%" PRIu32);
    TJ_ARRAY(out, "leaf_winding", l->leaf_winding, l->leaf_count, "%" PRId32);
    TJ_ARRAY(out, "black_winding", l->black_winding, l->black_count, "%" PRId32);
    TJ_ARRAY(out, "white_winding", l->white_winding, l->white_count, "%" PRId32);
    TJ_ARRAY(out, "leaf_first", l->leaf_first, l->leaf_count, "%" PRIu64);
    TJ_ARRAY(out, "leaf_new", l->leaf_new, l->leaf_count, "%" PRIu32);
    TJ_ARRAY(out, "leaf_ref_count", l->leaf_ref_count, l->leaf_count, "%" PRIu32);
    TJ_ARRAY(out, "leaf_refs", l->leaf_refs, l->ref_count, "%" PRIu32);
    TJ_ARRAY(out, "leaf_plane_counts", l->leaf_plane_counts, l->leaf_count, "%" PRIu8);
    TJ_ARRAY(out, "leaf_planes", l->leaf_planes, l->leaf_plane_count, "%" PRIu32);
    if (l->gray_colours)
        TJ_ARRAY(out, "gray_colours", l->gray_colours, l->gray_count, "%" PRIu32);
    fprintf(out, "}");
}

static void tree_json(FILE *out, const ebpo_tree *tree)
{
    const ebpo_info *info = &tree->info;
    static const char *const rules[] = { "nonzero", "evenodd", "positive" };
    fprintf(out,
            "{\"kind\": \"%s\",\n \"winding_rule\": \"%s\",\n \"coordinate_type\": \"%s\",\n "
            "\"levels\": [\n",
            info->solid ? "solid" : "surface", rules[info->rule],
            info->double_coordinates ? "float64" : "float32");
    for (int i = 0; i < info->level_count; i++) {
        tj_level(out, &tree->level[i], i);
        fprintf(out, i + 1 < info->level_count ? ",\n" : "],\n \"mesh\": {\"level\": null");
    }
    if (tree->mesh.xyz64)
        TJ_ARRAY(out, "vertices", tree->mesh.xyz64, 3 * info->vertex_count, "%.17g");
    else
        TJ_ARRAY(out, "vertices", tree->mesh.xyz32, 3 * info->vertex_count, "%.9g");
    TJ_ARRAY(out, "faces", tree->mesh.faces, 3 * info->face_count, "%" PRIu32);
    TJ_ARRAY(out, "vertex_source", tree->vertex_source, info->vertex_count, "%" PRIu32);
    TJ_ARRAY(out, "face_source", tree->face_source, info->face_count, "%" PRIu32);
    fprintf(out, "}}\n");
}

#endif
