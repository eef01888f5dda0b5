#include "container/schema.h"

#include <stdio.h>

#include "h5/h5.h"

const ebpo_array_spec ebpo_schema[EBPO_ARRAYS] = {
    [EBPO_A_TYPES] = { "types", 0, 2, false, false, "plain", "child types, 2 bits each" },
    [EBPO_A_PLANE_COUNTS] = { "plane_counts", 0, 1, false, false, "plain",
                              "planes of each gray node" },
    [EBPO_A_PLANES] = { "planes", 0, 4, false, false, "plain", "plane codes" },
    [EBPO_A_LEAF_WINDING] = { "leaf_winding", 0, 1 + 2 + 4, true, false, "plain",
                              "winding at lowest corner" },
    [EBPO_A_BLACK_WINDING] = { "black_winding", 0, 1 + 2 + 4, true, true, "plain",
                               "winding (absent: 1)" },
    [EBPO_A_WHITE_WINDING] = { "white_winding", 0, 1 + 2 + 4, true, true, "plain",
                               "winding (absent: 0)" },
    [EBPO_A_LEAF_SKIP] = { "leaf_skip", 0, 4 + 8, false, false, "delta", "new faces in between" },
    [EBPO_A_LEAF_NEW] = { "leaf_new", 0, 1 + 2 + 4, false, false, "plain", "new faces" },
    [EBPO_A_LEAF_REF_COUNT] = { "leaf_ref_count", 0, 1 + 2 + 4, false, false, "plain",
                                "earlier faces" },
    [EBPO_A_LEAF_REFS] = { "leaf_refs", 0, 4, false, false, "gap", "earlier faces, descending" },
    [EBPO_A_TYPES_INDEX] = { "types_index", 4, 8, false, false, "plain",
                             "white black leaf gray before" },
    [EBPO_A_GRAY_INDEX] = { "gray_index", 1, 8, false, false, "plain", "planes before" },
    [EBPO_A_LEAF_INDEX] = { "leaf_index", 3, 8, false, false, "plain", "face refs planes before" },
    [EBPO_A_LEAF_PLANE_COUNTS] = { "leaf_plane_counts", 0, 1, false, false, "plain",
                                   "planes of each leaf" },
    [EBPO_A_LEAF_PLANES] = { "leaf_planes", 0, 4, false, false, "plain", "plane codes" },
    [EBPO_A_VERTICES] = { "/mesh/vertices", 3, 4 + 8, false, false, "delta",
                          "x y z in the root attribute unit" },
    [EBPO_A_FACES] = { "/mesh/faces", 3, 4, false, false, "high-water",
                       "vertices of each face, counter-clockwise" },
    [EBPO_A_FACES_INDEX] = { "/mesh/faces_index", 1, 8, false, false, "plain",
                             "vertices seen before each chunk of faces" },
    [EBPO_A_VERTEX_SOURCE] = { "/maps/vertex_source", 0, 4, false, false, "delta",
                               "vertex number in the source" },
    [EBPO_A_FACE_SOURCE] = { "/maps/face_source", 0, 4, false, false, "delta",
                             "face number in the source" },
};

void ebpo_schema_path(ebpo_array_id id, int level, char path[EBPO_PATH_BYTES])
{
    if (id < EBPO_LEVEL_ARRAYS)
        snprintf(path, EBPO_PATH_BYTES, "/levels/%02d/%s", level, ebpo_schema[id].name);
    else
        snprintf(path, EBPO_PATH_BYTES, "%s", ebpo_schema[id].name);
}

uint64_t ebpo_schema_index_rows(uint64_t count)
{
    return count > EBPO_INDEX_ROWS ? (count - 1) / EBPO_INDEX_ROWS + 1 : 0;
}

static uint64_t face_chunks(uint64_t faces)
{
    uint32_t rows = ebpo_h5_chunk_rows(faces, 3, 4);
    return faces > rows ? (faces - 1) / rows + 1 : 0;
}

uint64_t ebpo_schema_rows(const ebpo_info *info, ebpo_array_id id, int level)
{
    const ebpo_level_summary *l = &info->level[level];
    bool planes = info->parts & EBPO_PART_PLANES, mesh = info->parts & EBPO_PART_MESH,
         maps = info->parts & EBPO_PART_MAPS;
    bool leaf_planes = info->parts & EBPO_PART_LEAF_PLANES;
    switch (id) {
    case EBPO_A_TYPES: return ebpo_schema_groups(info, level);
    case EBPO_A_PLANE_COUNTS: return planes ? l->gray_count : 0;
    case EBPO_A_PLANES: return planes ? l->plane_count : 0;
    case EBPO_A_LEAF_WINDING: return info->solid ? l->leaf_count : 0;
    case EBPO_A_BLACK_WINDING: return info->solid ? l->black_count : 0;
    case EBPO_A_WHITE_WINDING: return info->solid ? l->white_count : 0;
    case EBPO_A_LEAF_SKIP:
    case EBPO_A_LEAF_NEW:
    case EBPO_A_LEAF_REF_COUNT: return mesh ? l->leaf_count : 0;
    case EBPO_A_LEAF_REFS: return mesh ? l->ref_count : 0;
    case EBPO_A_TYPES_INDEX: return ebpo_schema_index_rows(ebpo_schema_groups(info, level));
    case EBPO_A_GRAY_INDEX: return planes ? ebpo_schema_index_rows(l->gray_count) : 0;
    case EBPO_A_LEAF_INDEX: return mesh || leaf_planes ? ebpo_schema_index_rows(l->leaf_count) : 0;
    case EBPO_A_LEAF_PLANE_COUNTS: return leaf_planes ? l->leaf_count : 0;
    case EBPO_A_LEAF_PLANES: return leaf_planes ? l->leaf_plane_count : 0;
    case EBPO_A_VERTICES: return mesh ? info->vertex_count : 0;
    case EBPO_A_FACES: return mesh ? info->face_count : 0;
    case EBPO_A_FACES_INDEX: return mesh ? face_chunks(info->face_count) : 0;
    case EBPO_A_VERTEX_SOURCE: return maps ? info->vertex_count : 0;
    case EBPO_A_FACE_SOURCE: return maps ? info->face_count : 0;
    case EBPO_ARRAYS: break;
    }
    return 0;
}
