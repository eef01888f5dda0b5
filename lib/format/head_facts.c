/* Writes and reads the HDF5 attributes of a file's root and of its levels: the values of ebpo_info.
 * A fact is one attribute. The tables in the first part have one row for each attribute. Writing
 * and reading loop over these rows, so both use the same names and types. A reader rejects a newer
 * version and unknown required parts before it reads any other attribute. Then the functions
 * check_... test the ranges of values and the sums over the levels, before memory of these sizes is
 * allocated. Source: format-spec/README.md, section 5. */
#include <inttypes.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include <ebpo/build.h>

#include "core/error.h"
#include "core/checksum.h"
#include "format/head_facts.h"
#include "format/schema.h"
#include "geometry/cells.h"

#define FORMAT_NAME "EBP-Octree in HDF5"

/* Conversion of a member of ebpo_info to an attribute. */
typedef enum fact_kind {
    FACT_TEXT,    /* char[size], required */
    FACT_NOTE,    /* char[size], omitted when empty */
    FACT_DIGEST,  /* uint8_t[32] as hexadecimal text */
    FACT_NUMBER,  /* int as i64 */
    FACT_INTEGER, /* int64_t as i64 */
    FACT_COUNT32, /* uint32_t as u64 */
    FACT_COUNT,   /* uint64_t as u64 */
    FACT_HINT,    /* uint64_t as u64; 0 if the attribute is absent or has another type */
    FACT_YES_NO,  /* bool as u64 0 or 1 */
    FACT_REAL,    /* double */
    FACT_REAL3,   /* double[3] */
    FACT_WORD     /* enumeration as a word, see `words` */
} fact_kind;

/* Conversion of one member of a struct to one attribute. */
typedef struct fact {
    const char *name;
    fact_kind kind;
    size_t offset, size;      /* offset and size of the member, in bytes */
    const char *const *words; /* for FACT_WORD: the word of each value, then NULL */
} fact;

#define FACT_AT(field) offsetof(ebpo_info, field), sizeof(((ebpo_info *)0)->field), NULL

/* A word in the attributes required_parts and optional_parts. A reader may ignore an unknown
 * optional part. A reader that ignored a required part would return wrong results. */
typedef struct part_word {
    const char *word;
    unsigned part; /* an ebpo_part, a WORD_ constant, or 0: in every file */
    bool required;
} part_word;

/* Bits of required parts that have no ebpo_part, but a member of ebpo_info: pruned, subtree_level,
 * gates, border_inside. */
enum {
    WORD_PRUNED = 1 << 30,
    WORD_SUBTREES = 1 << 29,
    WORD_GATES = 1 << 28,
    WORD_INSIDE = 1 << 27
};

static const char *const KINDS[] = { "surface", "solid", NULL }; /* indexed by info.solid */
static const char *const COORDINATES[] = { "float32", "float64",
                                           NULL }; /* indexed by info.double_coordinates */
static const char *const RULES[] = { "nonzero", "evenodd", "positive", NULL };

#define WORDS(field, words) offsetof(ebpo_info, field), sizeof(((ebpo_info *)0)->field), words

/* Attributes of the root in every file. */
static const fact root_facts[] = {
    { "generator", FACT_TEXT, FACT_AT(generator) },
    { "source_name", FACT_NOTE, FACT_AT(source_name) },
    { "source_format", FACT_NOTE, FACT_AT(source_format) },
    { "source_sha256", FACT_DIGEST, FACT_AT(source_sha256) },
    { "source_size", FACT_COUNT, FACT_AT(source_size) },
    { "unit", FACT_NOTE, FACT_AT(unit) },
    { "crs", FACT_NOTE, FACT_AT(crs) },
    { "date", FACT_NOTE, FACT_AT(date) },
    { "kind", FACT_WORD, WORDS(solid, KINDS) },
    { "winding_rule", FACT_WORD, WORDS(rule, RULES) },
    { "coordinate_type", FACT_WORD, WORDS(double_coordinates, COORDINATES) },
    { "vertex_count", FACT_COUNT, FACT_AT(vertex_count) },
    { "face_count", FACT_COUNT, FACT_AT(face_count) },
    { "source_vertex_count", FACT_COUNT, FACT_AT(source_vertex_count) },
    { "source_face_count", FACT_COUNT, FACT_AT(source_face_count) },
    { "box_origin", FACT_REAL3, FACT_AT(box_origin) },
    { "box_size", FACT_REAL3, FACT_AT(box_size) },
    { "grid_level", FACT_NUMBER, FACT_AT(grid_level) },
    { "max_level", FACT_NUMBER, FACT_AT(max_level) },
    { "level_count", FACT_NUMBER, FACT_AT(level_count) },
    { "leaf_faces", FACT_COUNT32, FACT_AT(leaf_faces) },
    { "epsilon", FACT_REAL, FACT_AT(epsilon) },
    { "mend_weld", FACT_YES_NO, FACT_AT(repair_record.weld) },
    { "mend_orient", FACT_YES_NO, FACT_AT(repair_record.orient) },
    { "mend_fill_holes", FACT_YES_NO, FACT_AT(repair_record.fill_holes) },
    { "mend_welded_vertices", FACT_COUNT, FACT_AT(repair_record.welded_vertices) },
    { "mend_flipped_faces", FACT_COUNT, FACT_AT(repair_record.flipped_faces) },
    { "mend_unorientable", FACT_COUNT, FACT_AT(repair_record.unorientable_components) },
    { "mend_filled_holes", FACT_COUNT, FACT_AT(repair_record.filled_holes) },
    { "mend_added_faces", FACT_COUNT, FACT_AT(repair_record.added_faces) },
    { "mend_unfilled_holes", FACT_COUNT, FACT_AT(repair_record.unfilled_holes) },
    { "mesh_balanced", FACT_YES_NO, FACT_AT(report.balanced) },
    { "mesh_manifold", FACT_YES_NO, FACT_AT(report.manifold) },
    { "mesh_boundary_edges", FACT_COUNT, FACT_AT(report.boundary_edges.count) },
    { "mesh_nonmanifold_edges", FACT_COUNT, FACT_AT(report.nonmanifold_edges.count) },
    { "mesh_misoriented_edges", FACT_COUNT, FACT_AT(report.misoriented_edges.count) },
    { "mesh_unbalanced_edges", FACT_COUNT, FACT_AT(report.unbalanced_edges.count) },
    { "mesh_bowtie_vertices", FACT_COUNT, FACT_AT(report.bowtie_vertices.count) },
    { "mesh_zero_area_faces", FACT_COUNT, FACT_AT(report.zero_area_faces.count) },
    { "mesh_index_repeated_faces", FACT_COUNT, FACT_AT(report.index_repeated_faces.count) },
    { "mesh_repeated_faces", FACT_COUNT, FACT_AT(report.repeated_faces.count) },
    { "mesh_unreferenced_vertices", FACT_COUNT, FACT_AT(report.unreferenced_vertices.count) },
    { "mesh_repeated_positions", FACT_COUNT, FACT_AT(report.repeated_positions.count) },
    { "mesh_edges", FACT_COUNT, FACT_AT(report.edges) },
    { "mesh_components", FACT_COUNT, FACT_AT(report.components) },
    { "mesh_boundary_loops", FACT_COUNT, FACT_AT(report.boundary_loops) },
    { "mesh_genus_known", FACT_YES_NO, FACT_AT(report.genus_known) },
    { "mesh_genus", FACT_INTEGER, FACT_AT(report.genus) },
    { "mesh_area", FACT_REAL, FACT_AT(report.area) },
    { "mesh_volume", FACT_REAL, FACT_AT(report.volume) },
    { "mesh_mean_edge", FACT_REAL, FACT_AT(report.mean_edge) },
    { "mesh_min", FACT_REAL3, FACT_AT(report.min) },
    { "mesh_max", FACT_REAL3, FACT_AT(report.max) },
    { "content_sha256", FACT_DIGEST, FACT_AT(content_sha256) },
    { "chunk_index_offset", FACT_HINT, FACT_AT(chunk_index_offset) },
    { "chunk_index_bytes", FACT_HINT, FACT_AT(chunk_index_bytes) },
};
static const int root_fact_count = sizeof root_facts / sizeof root_facts[0];

/* Attributes of a level's group. */
#define LEVEL_AT(field) \
    offsetof(ebpo_level_summary, field), sizeof(((ebpo_level_summary *)0)->field), NULL
static const fact level_facts[] = {
#define LEVEL_COUNT(ID, attribute, field, needs) { #attribute, FACT_COUNT, LEVEL_AT(field) },
#include "format/array_table.inc"
    { "gray_volume", FACT_REAL, LEVEL_AT(gray_volume) },
    { "leaf_volume", FACT_REAL, LEVEL_AT(leaf_volume) },
};
static const int level_fact_count = sizeof level_facts / sizeof level_facts[0];
/* Attribute of a level; omitted when 0. */
static const fact pruned_fact = { "pruned", FACT_COUNT, LEVEL_AT(pruned_count) };

static const part_word part_words[] = {
    { "levels", 0, true },
    { "mesh", EBPO_PART_MESH, true },
    { "planes", EBPO_PART_PLANES, false },
    { "maps", EBPO_PART_MAPS, false },
    { "leaf-planes", EBPO_PART_LEAF_PLANES, false },
    { "attributes", EBPO_PART_ATTRIBUTES, false },
    { "colours", EBPO_PART_COLOURS, false },
    { "border", EBPO_PART_BORDER, false },
    { "surface", EBPO_PART_SURFACE, false },
    { "subtrees", WORD_SUBTREES, true },
    { "gates", WORD_GATES, true },
    { "inside", WORD_INSIDE, true },
    { "pruned", WORD_PRUNED, true },
};
static const int part_word_count = sizeof part_words / sizeof part_words[0];

/* Attributes of files with a selection of planes that is not the default. Readers do not need these
 * attributes. */
static const char *const normals_words[] = { "spherical", "angle", NULL };
static const fact selection_facts[] = {
    { "selection_percent", FACT_REAL, FACT_AT(percent) },
    { "selection_k_root", FACT_REAL, FACT_AT(k_root) },
    { "selection_seed", FACT_COUNT, FACT_AT(seed) },
};
static const int selection_fact_count = sizeof selection_facts / sizeof selection_facts[0];

/* Omitted when 0. */
static const fact dropped_faces_fact = { "mend_dropped_faces", FACT_COUNT,
                                         FACT_AT(repair_record.dropped_faces) };

enum { WELD_FACTS = 3 };

/* Attributes of files whose vertices were welded within a distance. */
static const fact weld_facts[WELD_FACTS] = {
    { "mend_weld_distance", FACT_REAL, FACT_AT(repair_record.weld_distance) },
    { "mend_weld_moved", FACT_REAL, FACT_AT(repair_record.weld_moved) },
    { "mend_collapsed_faces", FACT_COUNT, FACT_AT(repair_record.collapsed_faces) },
};

/* Attributes of files with subtrees (subtree_level, top_bytes) or with colours (colours_sha256). */
static const fact subtree_level_fact = { "subtree_level", FACT_NUMBER, FACT_AT(subtree_level) },
                  colours_fact = { "colours_sha256", FACT_DIGEST, FACT_AT(colours_sha256) },
                  top_bytes_fact = { "top_bytes", FACT_HINT, FACT_AT(top_bytes) };

/* Attributes of surfaces with the part EBPO_PART_BORDER; the last attribute is the checksum. */
static const fact border_facts[] = {
    { "border_loops", FACT_COUNT, FACT_AT(border_loops) },
    { "border_points", FACT_COUNT, FACT_AT(border_points) },
    { "border_longest", FACT_COUNT, FACT_AT(border_longest) },
    { "border_area", FACT_REAL, FACT_AT(border_area) },
    { "border_sha256", FACT_DIGEST, FACT_AT(border_sha256) },
};
static const int border_fact_count = sizeof border_facts / sizeof border_facts[0];

/* Attributes of files with a simplified surface; the last attribute is the checksum. */
static const fact surface_facts[] = {
    { "surface_patches", FACT_COUNT, FACT_AT(surface_patches) },
    { "surface_triangles", FACT_COUNT, FACT_AT(surface_triangles) },
    { "surface_vertices", FACT_COUNT, FACT_AT(surface_vertices) },
    { "surface_code_bytes", FACT_COUNT, FACT_AT(surface_code_bytes) },
    { "surface_colours", FACT_COUNT, FACT_AT(surface_colours) },
    { "surface_sha256", FACT_DIGEST, FACT_AT(surface_sha256) },
};
static const int surface_fact_count = sizeof surface_facts / sizeof surface_facts[0];

/* --- names and settings of selections of planes; construct/selections.c has the functions --- */

static const ebpo_selection_traits selection_traits[] = {
    [EBPO_SELECT_INHERIT] = { .name = "inherit" },
    [EBPO_SELECT_KMEDOIDS] = { .name = "kmedoids",
                               .from_leaves = true,
                               .uses_normal_distance = true,
                               .uses_seed = true },
    [EBPO_SELECT_OFFSET] = { .name = "offset", .from_leaves = true },
    [EBPO_SELECT_RANDOM] = { .name = "random", .from_leaves = true, .uses_seed = true },
};
_Static_assert(sizeof selection_traits / sizeof *selection_traits == EBPO_SELECTION_COUNT,
               "each selection of ebpo/build.h needs a line in this table");

const ebpo_selection_traits *ebpo_selection_describe(ebpo_selection selection)
{
    return (unsigned)selection < EBPO_SELECTION_COUNT ? &selection_traits[selection] : NULL;
}

/* --- consistency of the attributes --- */

/* Maximum number of vertices or faces, and of the nodes of one type in a level. */
static const uint64_t MESH_MAX = UINT32_MAX - 1, NODES_MAX = UINT64_C(1) << 40;

/* The functions check_... return the error's text, or NULL. */
static const char *check_mesh_counts(const ebpo_info *info)
{
    if (info->face_count == 0 || info->face_count > MESH_MAX || info->vertex_count == 0 ||
        info->vertex_count > MESH_MAX)
        return "face_count or vertex_count is 0 or beyond 2^32 - 2";
    if (info->source_vertex_count > MESH_MAX || info->source_face_count > MESH_MAX ||
        info->repair_record.added_faces > MESH_MAX)
        return "a count of the source is beyond 2^32 - 2";
    if (info->repair_record.dropped_faces > info->source_face_count)
        return "more faces were dropped than the source has";
    if (info->vertex_count > info->source_vertex_count ||
        info->face_count > info->source_face_count + info->repair_record.added_faces -
                               info->repair_record.dropped_faces)
        return "the mesh has more vertices or faces than its source and the repair record explain";
    if (info->parts & EBPO_PART_MAPS && !(info->parts & EBPO_PART_MESH))
        return "there are maps but no mesh";
    if (info->parts & EBPO_PART_ATTRIBUTES && !(info->parts & EBPO_PART_MESH))
        return "there are attributes but no mesh";
    if (info->gates && !(info->parts & EBPO_PART_MESH))
        return "there is a coding of faces but no mesh";
    return NULL;
}

static const char *check_border(const ebpo_info *info)
{
    if (info->border_inside && info->solid)
        return "there is the part inside, but the model is a solid";
    if (!(info->parts & EBPO_PART_BORDER))
        return NULL;
    if (info->solid || !(info->parts & EBPO_PART_MESH))
        return "there is a border, but the model is a solid or has no mesh";
    if (info->border_points > INT32_MAX || info->border_loops > info->border_points / 3 ||
        info->border_longest > info->border_points)
        return "the counts of the border are impossible";
    if (!(info->border_area >= 0 && isfinite(info->border_area)))
        return "border_area is negative or not a number";
    return NULL;
}

static const char *check_surface(const ebpo_info *info)
{
    const uint64_t limit = UINT64_C(1) << 40; /* format-spec/surface.md, RL.1 */
    if (!(info->parts & EBPO_PART_SURFACE))
        return NULL;
    bool possible = info->surface_patches > 0 && info->surface_patches <= info->surface_triangles &&
                    info->surface_triangles <= info->surface_code_bytes &&
                    info->surface_code_bytes <= limit && info->surface_vertices >= 3 &&
                    info->surface_vertices <= limit &&
                    (info->surface_colours == 0 || info->surface_colours == info->surface_vertices);
    return possible ? NULL : "the counts of the simplified surface are impossible";
}

static const char *check_weld(const ebpo_repair_record *m)
{
    return m->weld_distance > 0 && !(m->weld && isfinite(m->weld_distance) && m->weld_moved >= 0 &&
                                     isfinite(m->weld_moved))
               ? "an attribute mend_weld, mend_weld_distance or mend_weld_moved is impossible"
               : NULL;
}

static const char *check_box(const ebpo_info *info)
{
    ebpo_box box = { .grid_level = info->grid_level };
    for (int k = 0; k < 3; k++) {
        box.origin[k] = info->box_origin[k];
        box.size[k] = info->box_size[k];
    }
    if (info->grid_level > EBPO_MAX_LEVEL || info->max_level > info->grid_level ||
        info->level_count < 1 || info->level_count > info->max_level + 1)
        return "grid_level, max_level and level_count contradict each other";
    if (!ebpo_box_valid(&box))
        return "box_origin and box_size are not on a grid of exact doubles";
    if (!(info->epsilon >= 0 && isfinite(info->epsilon)))
        return "epsilon is negative or not a number";
    if (!(info->percent >= 0 && info->percent <= 100) ||
        !(info->k_root >= 0 && isfinite(info->k_root)))
        return "selection_percent or selection_k_root is out of range";
    return NULL;
}

/* Checks the counts of a level against the level above, the next level and the parts. */
static const char *check_level_counts(const ebpo_info *info, int level)
{
    const ebpo_level_summary *s = &info->level[level];
    uint64_t nodes = level ? 8 * ebpo_schema_groups(info, level) : 1;
    if (s->gray_count > NODES_MAX || s->leaf_count > NODES_MAX || s->white_count > NODES_MAX ||
        s->black_count > NODES_MAX)
        return "a level has too many nodes";
    if (s->gray_count + s->leaf_count + s->white_count + s->black_count != nodes)
        return "a level does not have eight nodes for each gray node of the level above";
    bool last = level == info->level_count - 1;
    if (last ? s->gray_count && !info->pruned : s->gray_count == 0)
        return "a level above the deepest has no gray nodes, or the deepest level has gray nodes";
    if (info->pruned ? s->pruned_count > s->gray_count || (s->pruned_count == s->gray_count) < last
                     : s->pruned_count != 0)
        return "a level has more pruned nodes than gray nodes, or the deepest level has a gray "
               "node that is not pruned";
    if (!last && info->pruned &&
        (s->pruned_count == s->gray_count ||
         info->level[level + 1].white_count / 8 < s->pruned_count))
        return "all gray nodes of a level above the deepest are pruned, or the next level has too "
               "few white nodes for the groups of pruned nodes";
    if (s->plane_count > (info->parts & EBPO_PART_PLANES ? 255 * s->gray_count : 0) ||
        s->leaf_plane_count > (info->parts & EBPO_PART_LEAF_PLANES ? 255 * s->leaf_count : 0))
        return "a level has more planes than its nodes can have";
    if (!(info->parts & EBPO_PART_MESH) && (s->new_count || s->ref_count))
        return "a level counts faces, but there is no mesh";
    if (s->leaf_count == 0 && (s->new_count || s->ref_count))
        return "a level has faces but no leaf";
    if (s->black_count && !info->solid)
        return "a surface has black nodes";
    if (s->leaf_count && s->ref_count / s->leaf_count > info->face_count)
        return "the leaves of a level list more faces than the mesh has";
    return NULL;
}

ebpo_status ebpo_facts_check(const ebpo_info *info, const char *shown, ebpo_status as,
                             ebpo_error *error)
{
    const char *wrong = check_mesh_counts(info);
    if (!wrong)
        wrong = check_weld(&info->repair_record);
    if (!wrong)
        wrong = check_box(info);
    if (!wrong)
        wrong = check_border(info);
    if (!wrong)
        wrong = check_surface(info);
    uint64_t faces = 0;
    int level = -1;
    while (!wrong && ++level < info->level_count) {
        wrong = check_level_counts(info, level);
        if (info->level[level].new_count > info->face_count - faces)
            wrong = "the levels have more new faces than the mesh";
        else
            faces += info->level[level].new_count;
    }
    if (!wrong && info->parts & EBPO_PART_MESH && faces != info->face_count)
        wrong = "the levels' new faces do not add up to face_count";
    if (!wrong)
        return EBPO_OK;
    return ebpo_fail_at(error, as, shown, level >= 0 ? "/levels" : "/", -1, "%s; %s", wrong,
                        as == EBPO_E_FORMAT ? "get a fresh copy of the file"
                                            : "the tree was not written");
}

/* --- writing --- */

static const char FORMAT_VERSION[] = "1.1";
static const char ABOUT[] = "A triangle mesh with an octree of convex envelopes (EBP-Octree), "
                            "level by level: /levels/00 and so on, "
                            "then /mesh, then /maps. Each array's attributes name its coding; the "
                            "specification is format-spec/README.md of ebpo. Attributes of this "
                            "group: leaf_faces is the number of faces above which a cell was to be "
                            "divided; down to level grid_level all cell faces are exact doubles, "
                            "and levels above level_count - 1 are not in the file.";

/* Writes a member that is a bool or an ebpo_rule. */
static ebpo_status put_word(ebpo_h5_out *out, ebpo_h5_id id, const fact *f, const void *field,
                            ebpo_error *error)
{
    size_t value =
        f->size == sizeof(bool) ? *(const bool *)field : (size_t) * (const ebpo_rule *)field;
    return ebpo_h5_put_text(out, id, f->name, f->words[value], error);
}

static ebpo_status put_digest(ebpo_h5_out *out, ebpo_h5_id id, const char *name,
                              const uint8_t *digest, ebpo_error *error)
{
    char hex[65];
    ebpo_sha256_hex(digest, hex);
    return ebpo_h5_put_text(out, id, name, hex, error);
}

static ebpo_status put_fact(ebpo_h5_out *out, ebpo_h5_id id, const fact *f, const void *record,
                            ebpo_error *error)
{
    const void *field = (const char *)record + f->offset;
    switch (f->kind) {
    case FACT_TEXT: return ebpo_h5_put_text(out, id, f->name, field, error);
    case FACT_NOTE:
        return *(const char *)field ? ebpo_h5_put_text(out, id, f->name, field, error) : EBPO_OK;
    case FACT_DIGEST: return put_digest(out, id, f->name, field, error);
    case FACT_NUMBER: return ebpo_h5_put_int(out, id, f->name, *(const int *)field, error);
    case FACT_INTEGER: return ebpo_h5_put_int(out, id, f->name, *(const int64_t *)field, error);
    case FACT_COUNT32: return ebpo_h5_put_count(out, id, f->name, *(const uint32_t *)field, error);
    case FACT_HINT:
    case FACT_COUNT: return ebpo_h5_put_count(out, id, f->name, *(const uint64_t *)field, error);
    case FACT_YES_NO: return ebpo_h5_put_count(out, id, f->name, *(const bool *)field, error);
    case FACT_REAL: return ebpo_h5_put_real(out, id, f->name, field, 0, error);
    case FACT_REAL3: return ebpo_h5_put_real(out, id, f->name, field, 3, error);
    case FACT_WORD: return put_word(out, id, f, field, error);
    }
    return EBPO_E_ARGUMENT;
}

/* Writes the list of the required parts, or of the optional parts, of the file. */
static ebpo_status put_parts(ebpo_h5_out *out, ebpo_h5_id root, const ebpo_info *info,
                             bool required, ebpo_error *error)
{
    char words[128] = "";
    uint32_t parts = info->parts | (info->pruned ? WORD_PRUNED : 0) |
                     (info->subtree_level ? WORD_SUBTREES : 0) | (info->gates ? WORD_GATES : 0) |
                     (info->border_inside ? WORD_INSIDE : 0);
    for (int i = 0; i < part_word_count; i++)
        if (part_words[i].required == required &&
            (!part_words[i].part || parts & part_words[i].part)) {
            size_t used = strlen(words);
            snprintf(words + used, sizeof words - used, "%s%s", used ? " " : "",
                     part_words[i].word);
        }
    return ebpo_h5_put_text(out, root, required ? "required_parts" : "optional_parts", words,
                            error);
}

static ebpo_status put_selection(ebpo_h5_out *out, ebpo_h5_id root, const ebpo_info *info,
                                 ebpo_error *error)
{
    const ebpo_selection_traits *traits = ebpo_selection_describe((ebpo_selection)info->selection);
    if (info->selection == EBPO_SELECT_INHERIT || !traits || info->normals < 0 || info->normals > 1)
        return EBPO_OK;
    ebpo_status status = ebpo_h5_put_text(out, root, "selection", traits->name, error);
    if (status == EBPO_OK)
        status =
            ebpo_h5_put_text(out, root, "selection_normals", normals_words[info->normals], error);
    for (int i = 0; i < selection_fact_count && status == EBPO_OK; i++)
        status = put_fact(out, root, &selection_facts[i], info, error);
    return status;
}

static ebpo_status put_subtrees(ebpo_h5_out *out, ebpo_h5_id root, const ebpo_info *info,
                                ebpo_error *error)
{
    ebpo_status status = put_fact(out, root, &subtree_level_fact, info, error);
    return status == EBPO_OK ? put_fact(out, root, &top_bytes_fact, info, error) : status;
}

/* Writes the attributes that only subsets have. */
static ebpo_status put_subset(ebpo_h5_out *out, ebpo_h5_id root, const ebpo_info *info,
                              ebpo_error *error)
{
    ebpo_status status = put_digest(out, root, "subset_of", info->subset_of, error);
    if (status == EBPO_OK && info->cut_levels)
        status = ebpo_h5_put_int(out, root, "subset_levels", info->cut_levels, error);
    if (status == EBPO_OK && info->boxed)
        status = ebpo_h5_put_real(out, root, "subset_box", info->kept_box, 6, error);
    if (status == EBPO_OK && info->kept_error > 0)
        status = ebpo_h5_put_real(out, root, "subset_error", &info->kept_error, 0, error);
    return status;
}

ebpo_status ebpo_facts_put(ebpo_h5_out *out, ebpo_h5_id root, const ebpo_info *info,
                           ebpo_error *error)
{
    ebpo_status status = ebpo_h5_put_text(out, root, "format", FORMAT_NAME, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_text(out, root, "format_version", FORMAT_VERSION, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_int(out, root, "format_version_major", EBPO_FORMAT_MAJOR, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_int(out, root, "format_version_minor", EBPO_FORMAT_MINOR, error);
    if (status == EBPO_OK)
        status = put_parts(out, root, info, true, error);
    if (status == EBPO_OK)
        status = put_parts(out, root, info, false, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_text(out, root, "about", ABOUT, error);
    for (int i = 0; i < root_fact_count && status == EBPO_OK; i++)
        status = put_fact(out, root, &root_facts[i], info, error);
    if (status == EBPO_OK)
        status = put_selection(out, root, info, error);
    if (status == EBPO_OK && info->repair_record.dropped_faces)
        status = put_fact(out, root, &dropped_faces_fact, info, error);
    for (int i = 0; i < WELD_FACTS && status == EBPO_OK && info->repair_record.weld_distance > 0;
         i++)
        status = put_fact(out, root, &weld_facts[i], info, error);
    if (status == EBPO_OK && info->parts & EBPO_PART_COLOURS)
        status = put_fact(out, root, &colours_fact, info, error);
    for (int i = 0; i < border_fact_count && status == EBPO_OK && info->parts & EBPO_PART_BORDER;
         i++)
        status = put_fact(out, root, &border_facts[i], info, error);
    for (int i = 0; i < surface_fact_count && status == EBPO_OK && info->parts & EBPO_PART_SURFACE;
         i++)
        status = put_fact(out, root, &surface_facts[i], info, error);
    if (status == EBPO_OK && info->subtree_level)
        status = put_subtrees(out, root, info, error);
    if (status == EBPO_OK && info->pruned)
        status = put_subset(out, root, info, error);
    return status;
}

ebpo_status ebpo_facts_put_digest(ebpo_h5_out *out, ebpo_h5_id root, const uint8_t digest[32],
                                  ebpo_error *error)
{
    return put_digest(out, root, "content_sha256", digest, error);
}

ebpo_status ebpo_facts_put_colours_digest(ebpo_h5_out *out, ebpo_h5_id root,
                                          const uint8_t digest[32], ebpo_error *error)
{
    return put_digest(out, root, colours_fact.name, digest, error);
}

ebpo_status ebpo_facts_put_border_digest(ebpo_h5_out *out, ebpo_h5_id root,
                                         const uint8_t digest[32], ebpo_error *error)
{
    return put_digest(out, root, border_facts[border_fact_count - 1].name, digest, error);
}

ebpo_status ebpo_facts_put_surface_digest(ebpo_h5_out *out, ebpo_h5_id root,
                                          const uint8_t digest[32], ebpo_error *error)
{
    return put_digest(out, root, surface_facts[surface_fact_count - 1].name, digest, error);
}

ebpo_status ebpo_facts_put_index(ebpo_h5_out *out, ebpo_h5_id root, uint64_t offset, uint64_t bytes,
                                 ebpo_error *error)
{
    ebpo_status status = ebpo_h5_put_count(out, root, "chunk_index_offset", offset, error);
    return status == EBPO_OK ? ebpo_h5_put_count(out, root, "chunk_index_bytes", bytes, error)
                             : status;
}

ebpo_status ebpo_facts_put_top(ebpo_h5_out *out, ebpo_h5_id root, uint64_t bytes, ebpo_error *error)
{
    return ebpo_h5_put_count(out, root, top_bytes_fact.name, bytes, error);
}

ebpo_status ebpo_facts_put_level(ebpo_h5_out *out, ebpo_h5_id group,
                                 const ebpo_level_summary *level, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < level_fact_count && status == EBPO_OK; i++)
        status = put_fact(out, group, &level_facts[i], level, error);
    if (status == EBPO_OK && level->pruned_count)
        status = put_fact(out, group, &pruned_fact, level, error);
    return status;
}

/* --- reading --- */

static ebpo_status wrong_value(ebpo_head *in, const char *object, const char *name,
                               ebpo_error *error)
{
    return ebpo_fail_at(error, EBPO_E_FORMAT, in->shown, object, -1,
                        "attribute %s has a value that the format does not allow; get a fresh "
                        "copy of the file",
                        name);
}

/* Reads a word into a member that is a bool or an ebpo_rule. */
static ebpo_status get_word(ebpo_head *in, ebpo_head_object id, const char *object, const fact *f,
                            void *field, ebpo_error *error)
{
    char word[32];
    ebpo_status status = ebpo_head_get_text(in, id, object, f->name, word, sizeof word, error);
    if (status != EBPO_OK)
        return status;
    for (int i = 0; f->words[i]; i++) {
        if (strcmp(word, f->words[i]) != 0)
            continue;
        if (f->size == sizeof(bool))
            *(bool *)field = i == 1;
        else
            *(ebpo_rule *)field = (ebpo_rule)i;
        return EBPO_OK;
    }
    return wrong_value(in, object, f->name, error);
}

/* Returns the value of a lower-case hexadecimal digit, or -1. */
static int hex_digit(char c)
{
    return c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

static ebpo_status get_digest(ebpo_head *in, ebpo_head_object id, const char *object,
                              const char *name, uint8_t *digest, ebpo_error *error)
{
    char hex[66];
    ebpo_status status = ebpo_head_get_text(in, id, object, name, hex, sizeof hex, error);
    if (status != EBPO_OK)
        return status;
    if (strlen(hex) != 64)
        return wrong_value(in, object, name, error);
    for (int i = 0; i < 32; i++) {
        int high = hex_digit(hex[2 * i]), low = hex_digit(hex[2 * i + 1]);
        if (high < 0 || low < 0)
            return wrong_value(in, object, name, error);
        digest[i] = (uint8_t)(high << 4 | low);
    }
    return EBPO_OK;
}

ebpo_status ebpo_facts_get_digest(ebpo_head *in, ebpo_head_object id, const char *object,
                                  const char *name, uint8_t digest[32], ebpo_error *error)
{
    ebpo_status status = get_digest(in, id, object, name, digest, error);
    return status == EBPO_E_ABSENT
               ? ebpo_fail_at(error, EBPO_E_FORMAT, in->shown, object, -1,
                              "attribute %s is missing; get a fresh copy of the file", name)
               : status;
}

/* Reads a number of kind FACT_NUMBER, FACT_COUNT32 or FACT_YES_NO, which must be in the range of
 * the member. A FACT_NUMBER is at most 2^20. */
static ebpo_status get_limited(ebpo_head *in, ebpo_head_object id, const char *object,
                               const fact *f, void *field, ebpo_error *error)
{
    int64_t number = 0;
    uint64_t count = 0;
    bool is_int = f->kind == FACT_NUMBER;
    ebpo_status status = is_int ? ebpo_head_get_int(in, id, object, f->name, &number, error)
                                : ebpo_head_get_count(in, id, object, f->name, &count, error);
    if (status != EBPO_OK)
        return status;
    if ((f->kind == FACT_YES_NO && count > 1) || (f->kind == FACT_COUNT32 && count > UINT32_MAX) ||
        (is_int && (number < 0 || number > 1 << 20)))
        return wrong_value(in, object, f->name, error);
    if (f->kind == FACT_YES_NO)
        *(bool *)field = count;
    else if (f->kind == FACT_COUNT32)
        *(uint32_t *)field = (uint32_t)count;
    else
        *(int *)field = (int)number;
    return EBPO_OK;
}

/* Reads one attribute into its member of `record`. A missing attribute is an error, except for
 * FACT_NOTE and FACT_HINT. */
static ebpo_status get_fact(ebpo_head *in, ebpo_head_object id, const char *object, const fact *f,
                            void *record, ebpo_error *error)
{
    void *field = (char *)record + f->offset;
    ebpo_status status = EBPO_E_ARGUMENT;
    switch (f->kind) {
    case FACT_TEXT:
    case FACT_NOTE:
        status = ebpo_head_get_text(in, id, object, f->name, field, f->size, error);
        break;
    case FACT_DIGEST: status = get_digest(in, id, object, f->name, field, error); break;
    case FACT_NUMBER:
    case FACT_COUNT32:
    case FACT_YES_NO: status = get_limited(in, id, object, f, field, error); break;
    case FACT_INTEGER: status = ebpo_head_get_int(in, id, object, f->name, field, error); break;
    case FACT_HINT:
        if (ebpo_head_get_count(in, id, object, f->name, field, NULL) != EBPO_OK)
            *(uint64_t *)field = 0; /* absent, or rewritten by another program with another type */
        return EBPO_OK;
    case FACT_COUNT: status = ebpo_head_get_count(in, id, object, f->name, field, error); break;
    case FACT_REAL: status = ebpo_head_get_real(in, id, object, f->name, field, 0, error); break;
    case FACT_REAL3: status = ebpo_head_get_real(in, id, object, f->name, field, 3, error); break;
    case FACT_WORD: status = get_word(in, id, object, f, field, error); break;
    }
    if (status != EBPO_E_ABSENT)
        return status;
    if (f->kind == FACT_NOTE)
        return EBPO_OK;
    return ebpo_fail_at(error, EBPO_E_FORMAT, in->shown, object, -1,
                        "attribute %s is missing; get a fresh copy of the file", f->name);
}

static ebpo_status get_version(ebpo_head *in, ebpo_head_object root, ebpo_info *info,
                               ebpo_error *error)
{
    static const fact major = { "format_version_major", FACT_NUMBER, FACT_AT(version_major) };
    static const fact minor = { "format_version_minor", FACT_NUMBER, FACT_AT(version_minor) };
    char format[32];
    ebpo_status status = ebpo_head_get_text(in, root, "/", "format", format, sizeof format, error);
    if (status == EBPO_E_MEMORY)
        return status;
    if (status != EBPO_OK || strcmp(format, FORMAT_NAME) != 0)
        return ebpo_fail_file(error, EBPO_E_FORMAT, in->shown,
                              "the file is an HDF5 file, but not an EBP-Octree (its root attribute "
                              "format is not \"%s\"); %s",
                              FORMAT_NAME,
                              status == EBPO_OK && strncmp(format, "EBP-Octree paint", 16) == 0
                                  ? "it is a file of paint: `ebpo paint` prints its model"
                                  : "make an EBP-Octree with `ebpo convert`");
    status = get_fact(in, root, "/", &major, info, error);
    if (status == EBPO_OK)
        status = get_fact(in, root, "/", &minor, info, error);
    if (status == EBPO_OK && info->version_major != EBPO_FORMAT_MAJOR)
        status = ebpo_fail_file(
            error, EBPO_E_VERSION, in->shown,
            "the file has format version %d.%d, but this library reads version %d; use a newer "
            "library",
            info->version_major, info->version_minor, EBPO_FORMAT_MAJOR);
    char words[32] = ""; /* only this text distinguishes a draft from version 1.0 */
    if (status == EBPO_OK)
        status = ebpo_head_get_text(in, root, "/", "format_version", words, sizeof words, error);
    if (status == EBPO_E_ABSENT)
        return EBPO_OK;
    if (status == EBPO_OK && strcmp(words, "1.0-draft") == 0)
        status = ebpo_fail_file(error, EBPO_E_VERSION, in->shown,
                                "the file has a draft version of the format, which is no longer "
                                "supported; convert the model again");
    return status;
}

/* Sets the bit of a part in *listed (bit i: part_words[i]). A known part may be in either list,
 * required or optional parts, but only once. An unknown required part is an error. */
static ebpo_status mark_part(ebpo_head *in, const char *word, bool required, unsigned *listed,
                             ebpo_error *error)
{
    for (int i = 0; i < part_word_count; i++) {
        if (strcmp(word, part_words[i].word) != 0)
            continue;
        if (*listed >> i & 1)
            return ebpo_fail_file(error, EBPO_E_FORMAT, in->shown,
                                  "part \"%s\" is listed twice; get a fresh copy of the file",
                                  word);
        *listed |= 1u << i;
        return EBPO_OK;
    }
    if (!required)
        return EBPO_OK;
    return ebpo_fail_file(
        error, EBPO_E_VERSION, in->shown,
        "the file needs part \"%s\", which this library does not know; use a newer library", word);
}

static ebpo_status get_parts(ebpo_head *in, ebpo_head_object root, ebpo_info *info,
                             ebpo_error *error)
{
    unsigned listed = 0;
    for (int required = 1; required >= 0; required--) {
        const char *name = required ? "required_parts" : "optional_parts";
        char words[1024], *remaining = words;
        ebpo_status status = ebpo_head_get_text(in, root, "/", name, words, sizeof words, error);
        if (status == EBPO_E_ABSENT)
            return ebpo_fail_at(error, EBPO_E_FORMAT, in->shown, "/", -1,
                                "attribute %s is missing; get a fresh copy of the file", name);
        if (status == EBPO_OK && !*words)
            remaining = NULL; /* the list is empty */
        while (status == EBPO_OK && remaining) {
            char *word = remaining, *space = strchr(remaining, ' ');
            remaining = space ? space + 1 : NULL;
            if (space)
                *space = 0;
            status = *word ? mark_part(in, word, required, &listed, error)
                           : wrong_value(in, "/", name, error);
        }
        if (status != EBPO_OK)
            return status;
    }
    for (int i = 0; i < part_word_count; i++)
        if (listed >> i & 1)
            info->parts |= part_words[i].part;
    info->pruned = info->parts & WORD_PRUNED;
    info->subtree_level = info->parts & WORD_SUBTREES ? 1 : 0; /* get_subtrees replaces the 1 */
    info->gates = info->parts & WORD_GATES;
    info->border_inside = info->parts & WORD_INSIDE;
    info->parts &= ~(uint32_t)(WORD_PRUNED | WORD_SUBTREES | WORD_GATES | WORD_INSIDE);
    /* bit 0: the part `levels`, which every file has */
    return listed & 1 ? EBPO_OK : wrong_value(in, "/", "required_parts", error);
}

static ebpo_status get_subtrees(ebpo_head *in, ebpo_head_object root, ebpo_info *info,
                                ebpo_error *error)
{
    ebpo_status status = get_fact(in, root, "/", &subtree_level_fact, info, error);
    if (status == EBPO_OK)
        status = get_fact(in, root, "/", &top_bytes_fact, info, error);
    if (status == EBPO_OK && (info->subtree_level < 1 || info->level_count > EBPO_LEVELS_MAX ||
                              info->subtree_level > info->level_count - 2))
        status = wrong_value(in, "/", "subtree_level", error);
    return status;
}

/* Reads the attributes that only subsets have: subset_of, and subset_levels, subset_box and
 * subset_error, which may be absent. */
static ebpo_status get_subset(ebpo_head *in, ebpo_head_object root, ebpo_info *info,
                              ebpo_error *error)
{
    int64_t levels = 0;
    ebpo_status status = get_digest(in, root, "/", "subset_of", info->subset_of, error);
    if (status == EBPO_E_ABSENT)
        return ebpo_fail_at(error, EBPO_E_FORMAT, in->shown, "/", -1,
                            "attribute subset_of is missing; get a fresh copy of the file");
    if (status == EBPO_OK)
        status = ebpo_head_get_int(in, root, "/", "subset_levels", &levels, error);
    if (status == EBPO_OK && (levels < 1 || levels > EBPO_LEVELS_MAX))
        return wrong_value(in, "/", "subset_levels", error);
    info->cut_levels = (int)levels;
    if (status == EBPO_OK || status == EBPO_E_ABSENT)
        status = ebpo_head_get_real(in, root, "/", "subset_box", info->kept_box, 6, error);
    info->boxed = status == EBPO_OK;
    for (int k = 0; k < 3 && info->boxed; k++)
        if (!(isfinite(info->kept_box[k]) && isfinite(info->kept_box[3 + k]) &&
              info->kept_box[k] <= info->kept_box[3 + k]))
            return wrong_value(in, "/", "subset_box", error);
    if (status == EBPO_OK || status == EBPO_E_ABSENT)
        status = ebpo_head_get_real(in, root, "/", "subset_error", &info->kept_error, 0, error);
    if (status == EBPO_OK && !(isfinite(info->kept_error) && info->kept_error > 0))
        return wrong_value(in, "/", "subset_error", error);
    return status == EBPO_E_ABSENT ? EBPO_OK : status;
}

/* Reads an optional attribute that is a word. Sets *out to the value for which word_of returns this
 * word, or to -1 for a word of a newer library. Leaves *out unchanged if the attribute is absent.
 */
static ebpo_status get_known(ebpo_head *in, ebpo_head_object root, const char *name,
                             const char *(*word_of)(int value), int *out, ebpo_error *error)
{
    char word[64];
    ebpo_status status = ebpo_head_get_text(in, root, "/", name, word, sizeof word, error);
    if (status == EBPO_E_ABSENT || (status == EBPO_OK && !*word))
        return EBPO_OK;
    *out = -1;
    for (int i = 0; word_of(i) && status == EBPO_OK; i++)
        if (strcmp(word_of(i), word) == 0)
            *out = i;
    return status;
}

static const char *selection_word(int selection)
{
    const ebpo_selection_traits *traits = ebpo_selection_describe((ebpo_selection)selection);
    return traits ? traits->name : NULL;
}

static const char *normals_word(int normals) { return normals_words[normals]; }

static ebpo_status get_selection(ebpo_head *in, ebpo_head_object root, ebpo_info *info,
                                 ebpo_error *error)
{
    ebpo_status status = get_known(in, root, "selection", selection_word, &info->selection, error);
    if (status == EBPO_OK)
        status = get_known(in, root, "selection_normals", normals_word, &info->normals, error);
    for (int i = 0; i < selection_fact_count && status == EBPO_OK && info->selection > 0; i++)
        status = get_fact(in, root, "/", &selection_facts[i], info, error);
    return status;
}

/* Reads the number of dropped faces, which may be absent. The file does not state whether dropping
 * was requested; a number above 0 shows it. */
static ebpo_status get_dropped(ebpo_head *in, ebpo_head_object root, ebpo_info *info,
                               ebpo_error *error)
{
    uint64_t count = 0;
    ebpo_status status = ebpo_head_get_count(in, root, "/", dropped_faces_fact.name, &count, error);
    if (status == EBPO_E_ABSENT)
        return EBPO_OK;
    info->repair_record.dropped_faces = count;
    info->repair_record.drop_duplicates = count > 0;
    return status;
}

/* Reads the record of welding within a distance, which may be absent. ebpo_facts_check checks its
 * values. */
static ebpo_status get_weld(ebpo_head *in, ebpo_head_object root, ebpo_info *info,
                            ebpo_error *error)
{
    double distance = 0;
    ebpo_status status = ebpo_head_get_real(in, root, "/", weld_facts[0].name, &distance, 0, error);
    if (status == EBPO_E_ABSENT)
        return EBPO_OK;
    if (status == EBPO_OK && !(distance > 0)) /* 0 would mean no welding */
        return wrong_value(in, "/", weld_facts[0].name, error);
    for (int i = 0; i < WELD_FACTS && status == EBPO_OK; i++)
        status = get_fact(in, root, "/", &weld_facts[i], info, error);
    return status;
}

ebpo_status ebpo_facts_get(ebpo_head *in, ebpo_head_object root, ebpo_info *info, ebpo_error *error)
{
    ebpo_status status = get_version(in, root, info, error);
    if (status == EBPO_OK)
        status = get_parts(in, root, info, error);
    for (int i = 0; i < root_fact_count && status == EBPO_OK; i++)
        status = get_fact(in, root, "/", &root_facts[i], info, error);
    if (status == EBPO_OK)
        status = get_selection(in, root, info, error);
    if (status == EBPO_OK)
        status = get_dropped(in, root, info, error);
    if (status == EBPO_OK)
        status = get_weld(in, root, info, error);
    if (status == EBPO_OK && info->parts & EBPO_PART_COLOURS)
        status = get_fact(in, root, "/", &colours_fact, info, error);
    for (int i = 0; i < border_fact_count && status == EBPO_OK && info->parts & EBPO_PART_BORDER;
         i++)
        status = get_fact(in, root, "/", &border_facts[i], info, error);
    for (int i = 0; i < surface_fact_count && status == EBPO_OK && info->parts & EBPO_PART_SURFACE;
         i++)
        status = get_fact(in, root, "/", &surface_facts[i], info, error);
    if (status == EBPO_OK && info->subtree_level)
        status = get_subtrees(in, root, info, error);
    return status == EBPO_OK && info->pruned ? get_subset(in, root, info, error) : status;
}

ebpo_status ebpo_facts_get_level(ebpo_head *in, ebpo_head_object group, const char *path,
                                 ebpo_level_summary *level, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < level_fact_count && status == EBPO_OK; i++)
        status = get_fact(in, group, path, &level_facts[i], level, error);
    if (status == EBPO_OK)
        status =
            ebpo_head_get_count(in, group, path, pruned_fact.name, &level->pruned_count, error);
    return status == EBPO_E_ABSENT ? EBPO_OK : status;
}
