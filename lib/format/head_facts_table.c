#include "format/head_facts_table.h"

static const char *const KINDS[] = { "surface", "solid", NULL }; /* by info.solid */
static const char *const COORDINATES[] = { "float32", "float64",
                                           NULL }; /* by info.double_coordinates */
static const char *const RULES[] = { "nonzero", "evenodd", "positive", NULL };

#define WORDS(field, words) offsetof(ebpo_info, field), sizeof(((ebpo_info *)0)->field), words

const ebpo_fact ebpo_facts[] = {
    { "generator", EBPO_FACT_TEXT, EBPO_FACT_AT(generator) },
    { "source_name", EBPO_FACT_NOTE, EBPO_FACT_AT(source_name) },
    { "source_format", EBPO_FACT_NOTE, EBPO_FACT_AT(source_format) },
    { "source_sha256", EBPO_FACT_DIGEST, EBPO_FACT_AT(source_sha256) },
    { "source_size", EBPO_FACT_COUNT, EBPO_FACT_AT(source_size) },
    { "unit", EBPO_FACT_NOTE, EBPO_FACT_AT(unit) },
    { "crs", EBPO_FACT_NOTE, EBPO_FACT_AT(crs) },
    { "date", EBPO_FACT_NOTE, EBPO_FACT_AT(date) },
    { "kind", EBPO_FACT_WORD, WORDS(solid, KINDS) },
    { "winding_rule", EBPO_FACT_WORD, WORDS(rule, RULES) },
    { "coordinate_type", EBPO_FACT_WORD, WORDS(double_coordinates, COORDINATES) },
    { "vertex_count", EBPO_FACT_COUNT, EBPO_FACT_AT(vertex_count) },
    { "face_count", EBPO_FACT_COUNT, EBPO_FACT_AT(face_count) },
    { "source_vertex_count", EBPO_FACT_COUNT, EBPO_FACT_AT(source_vertex_count) },
    { "source_face_count", EBPO_FACT_COUNT, EBPO_FACT_AT(source_face_count) },
    { "box_origin", EBPO_FACT_REAL3, EBPO_FACT_AT(box_origin) },
    { "box_size", EBPO_FACT_REAL3, EBPO_FACT_AT(box_size) },
    { "grid_level", EBPO_FACT_NUMBER, EBPO_FACT_AT(grid_level) },
    { "max_level", EBPO_FACT_NUMBER, EBPO_FACT_AT(max_level) },
    { "level_count", EBPO_FACT_NUMBER, EBPO_FACT_AT(level_count) },
    { "leaf_faces", EBPO_FACT_COUNT32, EBPO_FACT_AT(leaf_faces) },
    { "epsilon", EBPO_FACT_REAL, EBPO_FACT_AT(epsilon) },
    { "mend_weld", EBPO_FACT_YES_NO, EBPO_FACT_AT(mend.weld) },
    { "mend_orient", EBPO_FACT_YES_NO, EBPO_FACT_AT(mend.orient) },
    { "mend_fill_holes", EBPO_FACT_YES_NO, EBPO_FACT_AT(mend.fill_holes) },
    { "mend_welded_vertices", EBPO_FACT_COUNT, EBPO_FACT_AT(mend.welded_vertices) },
    { "mend_flipped_faces", EBPO_FACT_COUNT, EBPO_FACT_AT(mend.flipped_faces) },
    { "mend_unorientable", EBPO_FACT_COUNT, EBPO_FACT_AT(mend.unorientable_components) },
    { "mend_filled_holes", EBPO_FACT_COUNT, EBPO_FACT_AT(mend.filled_holes) },
    { "mend_added_faces", EBPO_FACT_COUNT, EBPO_FACT_AT(mend.added_faces) },
    { "mend_unfilled_holes", EBPO_FACT_COUNT, EBPO_FACT_AT(mend.unfilled_holes) },
    { "mesh_balanced", EBPO_FACT_YES_NO, EBPO_FACT_AT(report.balanced) },
    { "mesh_manifold", EBPO_FACT_YES_NO, EBPO_FACT_AT(report.manifold) },
    { "mesh_boundary_edges", EBPO_FACT_COUNT, EBPO_FACT_AT(report.boundary_edges.count) },
    { "mesh_nonmanifold_edges", EBPO_FACT_COUNT, EBPO_FACT_AT(report.nonmanifold_edges.count) },
    { "mesh_misoriented_edges", EBPO_FACT_COUNT, EBPO_FACT_AT(report.misoriented_edges.count) },
    { "mesh_unbalanced_edges", EBPO_FACT_COUNT, EBPO_FACT_AT(report.unbalanced_edges.count) },
    { "mesh_bowtie_vertices", EBPO_FACT_COUNT, EBPO_FACT_AT(report.bowtie_vertices.count) },
    { "mesh_zero_area_faces", EBPO_FACT_COUNT, EBPO_FACT_AT(report.zero_area_faces.count) },
    { "mesh_index_repeated_faces", EBPO_FACT_COUNT,
      EBPO_FACT_AT(report.index_repeated_faces.count) },
    { "mesh_repeated_faces", EBPO_FACT_COUNT, EBPO_FACT_AT(report.repeated_faces.count) },
    { "mesh_unreferenced_vertices", EBPO_FACT_COUNT,
      EBPO_FACT_AT(report.unreferenced_vertices.count) },
    { "mesh_repeated_positions", EBPO_FACT_COUNT, EBPO_FACT_AT(report.repeated_positions.count) },
    { "mesh_edges", EBPO_FACT_COUNT, EBPO_FACT_AT(report.edges) },
    { "mesh_components", EBPO_FACT_COUNT, EBPO_FACT_AT(report.components) },
    { "mesh_boundary_loops", EBPO_FACT_COUNT, EBPO_FACT_AT(report.boundary_loops) },
    { "mesh_genus_known", EBPO_FACT_YES_NO, EBPO_FACT_AT(report.genus_known) },
    { "mesh_genus", EBPO_FACT_INTEGER, EBPO_FACT_AT(report.genus) },
    { "mesh_area", EBPO_FACT_REAL, EBPO_FACT_AT(report.area) },
    { "mesh_volume", EBPO_FACT_REAL, EBPO_FACT_AT(report.volume) },
    { "mesh_mean_edge", EBPO_FACT_REAL, EBPO_FACT_AT(report.mean_edge) },
    { "mesh_min", EBPO_FACT_REAL3, EBPO_FACT_AT(report.min) },
    { "mesh_max", EBPO_FACT_REAL3, EBPO_FACT_AT(report.max) },
    { "content_sha256", EBPO_FACT_DIGEST, EBPO_FACT_AT(content_sha256) },
    { "chunk_index_offset", EBPO_FACT_HINT, EBPO_FACT_AT(chunk_index_offset) },
    { "chunk_index_bytes", EBPO_FACT_HINT, EBPO_FACT_AT(chunk_index_bytes) },
};
const int ebpo_fact_count = sizeof ebpo_facts / sizeof ebpo_facts[0];

#define LEVEL_AT(field) \
    offsetof(ebpo_level_summary, field), sizeof(((ebpo_level_summary *)0)->field), NULL
const ebpo_fact ebpo_level_facts[] = {
#define LEVEL_COUNT(ID, attribute, field, needs) { #attribute, EBPO_FACT_COUNT, LEVEL_AT(field) },
#include "format/array_table.inc"
    { "gray_volume", EBPO_FACT_REAL, LEVEL_AT(gray_volume) },
    { "leaf_volume", EBPO_FACT_REAL, LEVEL_AT(leaf_volume) },
};
const int ebpo_level_fact_count = sizeof ebpo_level_facts / sizeof ebpo_level_facts[0];
const ebpo_fact ebpo_pruned_fact = { "pruned", EBPO_FACT_COUNT, LEVEL_AT(pruned_count) };

const ebpo_part_word ebpo_part_words[] = {
    { "levels", 0, true },
    { "mesh", EBPO_PART_MESH, true },
    { "planes", EBPO_PART_PLANES, false },
    { "maps", EBPO_PART_MAPS, false },
    { "leaf-planes", EBPO_PART_LEAF_PLANES, false },
    { "attributes", EBPO_PART_ATTRIBUTES, false },
    { "colours", EBPO_PART_COLOURS, false },
    { "subtrees", EBPO_WORD_SUBTREES, true },
    { "gates", EBPO_WORD_GATES, true },
    { "pruned", EBPO_WORD_PRUNED, true },
};
const int ebpo_part_word_count = sizeof ebpo_part_words / sizeof ebpo_part_words[0];

const char *const ebpo_normals_words[] = { "spherical", "angle", NULL };
const ebpo_fact ebpo_selection_facts[] = {
    { "selection_percent", EBPO_FACT_REAL, EBPO_FACT_AT(percent) },
    { "selection_k_root", EBPO_FACT_REAL, EBPO_FACT_AT(k_root) },
    { "selection_seed", EBPO_FACT_COUNT, EBPO_FACT_AT(seed) },
};
const int ebpo_selection_fact_count = sizeof ebpo_selection_facts / sizeof ebpo_selection_facts[0];

const ebpo_fact ebpo_dropped_faces_fact = { "mend_dropped_faces", EBPO_FACT_COUNT,
                                            EBPO_FACT_AT(mend.dropped_faces) };

const ebpo_fact ebpo_weld_facts[EBPO_WELD_FACTS] = {
    { "mend_weld_distance", EBPO_FACT_REAL, EBPO_FACT_AT(mend.weld_distance) },
    { "mend_weld_moved", EBPO_FACT_REAL, EBPO_FACT_AT(mend.weld_moved) },
    { "mend_collapsed_faces", EBPO_FACT_COUNT, EBPO_FACT_AT(mend.collapsed_faces) },
};

const ebpo_fact ebpo_subtree_level_fact = { "subtree_level", EBPO_FACT_NUMBER,
                                            EBPO_FACT_AT(subtree_level) },
                ebpo_colours_fact = { "colours_sha256", EBPO_FACT_DIGEST,
                                      EBPO_FACT_AT(colours_sha256) },
                ebpo_top_bytes_fact = { "top_bytes", EBPO_FACT_HINT, EBPO_FACT_AT(top_bytes) };
