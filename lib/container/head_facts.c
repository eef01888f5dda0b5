#include "container/head_facts.h"

#include <ebpo/build.h>
#include <inttypes.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "base/error.h"
#include "base/sha256.h"
#include "container/schema.h"
#include "ebpo_config.h"

static const char FORMAT[] = "EBP-Octree in HDF5";
static const char FORMAT_VERSION[] = "1.1", DRAFT[] = "1.0-draft";
static const char ABOUT[] = "A triangle mesh with an octree of convex envelopes (EBP-Octree), "
                            "level by level: /levels/00 and so on, "
                            "then /mesh, then /maps. Each array's attributes name its coding; the "
                            "specification is format-spec/README.md of ebpo.";

/* How a field of ebpo_info becomes an attribute. */
typedef enum fact_kind {
    TEXT,    /* char[size], required */
    NOTE,    /* char[size], left out when empty */
    DIGEST,  /* uint8_t[32] as hexadecimal text */
    NUMBER,  /* int as i64 */
    INTEGER, /* int64_t as i64 */
    COUNT32, /* uint32_t as u64 */
    COUNT,   /* uint64_t as u64 */
    HINT,    /* the same, may be absent */
    YES_NO,  /* bool as u64 0 or 1 */
    REAL,    /* double */
    REAL3,   /* double[3] */
    WORD     /* enumeration in a word, see `words` */
} fact_kind;

typedef struct fact {
    const char *name;
    fact_kind kind;
    size_t offset, size;
    const char *const *words;
} fact;

static const char *const KINDS[] = { "surface", "solid", NULL }; /* by info.solid */
static const char *const COORDINATES[] = { "float32", "float64",
                                           NULL }; /* by info.double_coordinates */
static const char *const RULES[] = { "nonzero", "evenodd", "positive", NULL };

#define AT(field)           offsetof(ebpo_info, field), sizeof(((ebpo_info *)0)->field), NULL
#define WORDS(field, words) offsetof(ebpo_info, field), sizeof(((ebpo_info *)0)->field), words

static const fact facts[] = {
    { "generator", TEXT, AT(generator) },
    { "source_name", NOTE, AT(source_name) },
    { "source_format", NOTE, AT(source_format) },
    { "source_sha256", DIGEST, AT(source_sha256) },
    { "source_size", COUNT, AT(source_size) },
    { "unit", NOTE, AT(unit) },
    { "crs", NOTE, AT(crs) },
    { "date", NOTE, AT(date) },
    { "kind", WORD, WORDS(solid, KINDS) },
    { "winding_rule", WORD, WORDS(rule, RULES) },
    { "coordinate_type", WORD, WORDS(double_coordinates, COORDINATES) },
    { "vertex_count", COUNT, AT(vertex_count) },
    { "face_count", COUNT, AT(face_count) },
    { "source_vertex_count", COUNT, AT(source_vertex_count) },
    { "source_face_count", COUNT, AT(source_face_count) },
    { "box_origin", REAL3, AT(box_origin) },
    { "box_size", REAL3, AT(box_size) },
    { "grid_level", NUMBER, AT(grid_level) },
    { "max_level", NUMBER, AT(max_level) },
    { "level_count", NUMBER, AT(level_count) },
    { "leaf_faces", COUNT32, AT(leaf_faces) },
    { "epsilon", REAL, AT(epsilon) },
    { "mend_weld", YES_NO, AT(mend.weld) },
    { "mend_orient", YES_NO, AT(mend.orient) },
    { "mend_fill_holes", YES_NO, AT(mend.fill_holes) },
    { "mend_welded_vertices", COUNT, AT(mend.welded_vertices) },
    { "mend_flipped_faces", COUNT, AT(mend.flipped_faces) },
    { "mend_unorientable", COUNT, AT(mend.unorientable_components) },
    { "mend_filled_holes", COUNT, AT(mend.filled_holes) },
    { "mend_added_faces", COUNT, AT(mend.added_faces) },
    { "mend_unfilled_holes", COUNT, AT(mend.unfilled_holes) },
    { "mesh_balanced", YES_NO, AT(report.balanced) },
    { "mesh_manifold", YES_NO, AT(report.manifold) },
    { "mesh_boundary_edges", COUNT, AT(report.boundary_edges.count) },
    { "mesh_nonmanifold_edges", COUNT, AT(report.nonmanifold_edges.count) },
    { "mesh_misoriented_edges", COUNT, AT(report.misoriented_edges.count) },
    { "mesh_unbalanced_edges", COUNT, AT(report.unbalanced_edges.count) },
    { "mesh_bowtie_vertices", COUNT, AT(report.bowtie_vertices.count) },
    { "mesh_zero_area_faces", COUNT, AT(report.zero_area_faces.count) },
    { "mesh_index_repeated_faces", COUNT, AT(report.index_repeated_faces.count) },
    { "mesh_repeated_faces", COUNT, AT(report.repeated_faces.count) },
    { "mesh_unreferenced_vertices", COUNT, AT(report.unreferenced_vertices.count) },
    { "mesh_repeated_positions", COUNT, AT(report.repeated_positions.count) },
    { "mesh_edges", COUNT, AT(report.edges) },
    { "mesh_components", COUNT, AT(report.components) },
    { "mesh_boundary_loops", COUNT, AT(report.boundary_loops) },
    { "mesh_genus_known", YES_NO, AT(report.genus_known) },
    { "mesh_genus", INTEGER, AT(report.genus) },
    { "mesh_area", REAL, AT(report.area) },
    { "mesh_volume", REAL, AT(report.volume) },
    { "mesh_mean_edge", REAL, AT(report.mean_edge) },
    { "mesh_min", REAL3, AT(report.min) },
    { "mesh_max", REAL3, AT(report.max) },
    { "content_sha256", DIGEST, AT(content_sha256) },
    { "chunk_index_offset", HINT, AT(chunk_index_offset) },
    { "chunk_index_bytes", HINT, AT(chunk_index_bytes) },
};
enum { FACTS = sizeof facts / sizeof facts[0] };

#define LEVEL_AT(field) \
    offsetof(ebpo_level_summary, field), sizeof(((ebpo_level_summary *)0)->field), NULL
static const fact level_facts[] = {
#define LEVEL_COUNT(ID, attribute, field, needs) { #attribute, COUNT, LEVEL_AT(field) },
#include "container/array_table.inc"
    { "gray_volume", REAL, LEVEL_AT(gray_volume) },
    { "leaf_volume", REAL, LEVEL_AT(leaf_volume) },
};
enum { LEVEL_FACTS = sizeof level_facts / sizeof level_facts[0] };
static const fact pruned_fact = { "pruned", COUNT, LEVEL_AT(pruned_count) }; /* left out when 0 */

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
    case TEXT: return ebpo_h5_put_text(out, id, f->name, field, error);
    case NOTE:
        return *(const char *)field ? ebpo_h5_put_text(out, id, f->name, field, error) : EBPO_OK;
    case DIGEST: return put_digest(out, id, f->name, field, error);
    case NUMBER: return ebpo_h5_put_int(out, id, f->name, *(const int *)field, error);
    case INTEGER: return ebpo_h5_put_int(out, id, f->name, *(const int64_t *)field, error);
    case COUNT32: return ebpo_h5_put_count(out, id, f->name, *(const uint32_t *)field, error);
    case HINT:
    case COUNT: return ebpo_h5_put_count(out, id, f->name, *(const uint64_t *)field, error);
    case YES_NO: return ebpo_h5_put_count(out, id, f->name, *(const bool *)field, error);
    case REAL: return ebpo_h5_put_real(out, id, f->name, field, 0, error);
    case REAL3: return ebpo_h5_put_real(out, id, f->name, field, 3, error);
    case WORD: return put_word(out, id, f, field, error);
    }
    return EBPO_E_ARGUMENT;
}

/* A reader that does not know an optional part is none the wiser, but right; without a required one
 * it would be wrong. */
/* info.pruned and subtree_level: words in the list of parts, but nothing that one could leave out
 */
enum { PRUNED = 1 << 30, SUBTREES = 1 << 29 };
static const struct {
    const char *word;
    unsigned part;
    bool required;
} parts[] = {
    { "levels", 0, true },
    { "mesh", EBPO_PART_MESH, true },
    { "planes", EBPO_PART_PLANES, false },
    { "maps", EBPO_PART_MAPS, false },
    { "leaf-planes", EBPO_PART_LEAF_PLANES, false },
    { "subtrees", SUBTREES, true },
    { "pruned", PRUNED, true },
};
enum { PARTS = sizeof parts / sizeof parts[0] };

static ebpo_status put_parts(ebpo_h5_out *out, ebpo_h5_id root, const ebpo_info *info,
                             bool required, ebpo_error *error)
{
    char words[128] = "";
    uint32_t has = info->parts | (info->pruned ? PRUNED : 0) | (info->subtree_level ? SUBTREES : 0);
    for (int i = 0; i < PARTS; i++)
        if (parts[i].required == required && (!parts[i].part || has & parts[i].part)) {
            size_t used = strlen(words);
            snprintf(words + used, sizeof words - used, "%s%s", used ? " " : "", parts[i].word);
        }
    return ebpo_h5_put_text(out, root, required ? "required_parts" : "optional_parts", words,
                            error);
}

/* How planes were chosen, where that was not the usual way: told, and needed by no reader. */
static const char *const NORMALS[] = { "spherical", "angle", NULL };
static const fact selection_facts[] = {
    { "selection_percent", REAL, AT(percent) },
    { "selection_k_root", REAL, AT(k_root) },
    { "selection_seed", COUNT, AT(seed) },
};
enum { SELECTION_FACTS = sizeof selection_facts / sizeof selection_facts[0] };

static ebpo_status put_selection(ebpo_h5_out *out, ebpo_h5_id root, const ebpo_info *info,
                                 ebpo_error *error)
{
    const ebpo_selection_traits *traits = ebpo_selection_describe((ebpo_selection)info->selection);
    if (info->selection == EBPO_SELECT_INHERIT || !traits || info->normals < 0 || info->normals > 1)
        return EBPO_OK;
    ebpo_status status = ebpo_h5_put_text(out, root, "selection", traits->name, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_text(out, root, "selection_normals", NORMALS[info->normals], error);
    for (int i = 0; i < SELECTION_FACTS && status == EBPO_OK; i++)
        status = put_fact(out, root, &selection_facts[i], info, error);
    return status;
}

static const fact subtree_level_fact = { "subtree_level", NUMBER, AT(subtree_level) },
                  top_bytes_fact = { "top_bytes", HINT, AT(top_bytes) };

static ebpo_status put_subtrees(ebpo_h5_out *out, ebpo_h5_id root, const ebpo_info *info,
                                ebpo_error *error)
{
    ebpo_status status = put_fact(out, root, &subtree_level_fact, info, error);
    return status == EBPO_OK ? put_fact(out, root, &top_bytes_fact, info, error) : status;
}

/* Only in subsets: other files stay as they are. */
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
    ebpo_status status = ebpo_h5_put_text(out, root, "format", FORMAT, error);
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
    for (int i = 0; i < FACTS && status == EBPO_OK; i++)
        status = put_fact(out, root, &facts[i], info, error);
    if (status == EBPO_OK)
        status = put_selection(out, root, info, error);
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
    for (int i = 0; i < LEVEL_FACTS && status == EBPO_OK; i++)
        status = put_fact(out, group, &level_facts[i], level, error);
    if (status == EBPO_OK && level->pruned_count)
        status = put_fact(out, group, &pruned_fact, level, error);
    return status;
}

static ebpo_status wrong_value(ebpo_h5_in *in, const char *object, const char *name,
                               ebpo_error *error)
{
    return ebpo_fail_at(error, EBPO_E_FORMAT, in->shown, object, -1,
                        "attribute %s has a value that the format does not allow; get a fresh "
                        "copy of the file",
                        name);
}

static ebpo_status get_word(ebpo_h5_in *in, ebpo_h5_id id, const char *object, const fact *f,
                            void *field, ebpo_error *error)
{
    char word[32];
    ebpo_status status = ebpo_h5_get_text(in, id, object, f->name, word, sizeof word, error);
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

static int hex_digit(char c)
{
    return c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

static ebpo_status get_digest(ebpo_h5_in *in, ebpo_h5_id id, const char *object, const char *name,
                              uint8_t *digest, ebpo_error *error)
{
    char hex[66];
    ebpo_status status = ebpo_h5_get_text(in, id, object, name, hex, sizeof hex, error);
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

static ebpo_status get_limited(ebpo_h5_in *in, ebpo_h5_id id, const char *object, const fact *f,
                               void *field, ebpo_error *error)
{
    int64_t number = 0;
    uint64_t count = 0;
    bool is_int = f->kind == NUMBER;
    ebpo_status status = is_int ? ebpo_h5_get_int(in, id, object, f->name, &number, error)
                                : ebpo_h5_get_count(in, id, object, f->name, &count, error);
    if (status != EBPO_OK)
        return status;
    if ((f->kind == YES_NO && count > 1) || (f->kind == COUNT32 && count > UINT32_MAX) ||
        (is_int && (number < 0 || number > 1 << 20)))
        return wrong_value(in, object, f->name, error);
    if (f->kind == YES_NO)
        *(bool *)field = count;
    else if (f->kind == COUNT32)
        *(uint32_t *)field = (uint32_t)count;
    else
        *(int *)field = (int)number;
    return EBPO_OK;
}

static ebpo_status get_fact(ebpo_h5_in *in, ebpo_h5_id id, const char *object, const fact *f,
                            void *record, ebpo_error *error)
{
    void *field = (char *)record + f->offset;
    ebpo_status status = EBPO_E_ARGUMENT;
    switch (f->kind) {
    case TEXT:
    case NOTE: status = ebpo_h5_get_text(in, id, object, f->name, field, f->size, error); break;
    case DIGEST: status = get_digest(in, id, object, f->name, field, error); break;
    case NUMBER:
    case COUNT32:
    case YES_NO: status = get_limited(in, id, object, f, field, error); break;
    case INTEGER: status = ebpo_h5_get_int(in, id, object, f->name, field, error); break;
    case HINT:
    case COUNT: status = ebpo_h5_get_count(in, id, object, f->name, field, error); break;
    case REAL: status = ebpo_h5_get_real(in, id, object, f->name, field, 0, error); break;
    case REAL3: status = ebpo_h5_get_real(in, id, object, f->name, field, 3, error); break;
    case WORD: status = get_word(in, id, object, f, field, error); break;
    }
    if (status != EBPO_E_ABSENT)
        return status;
    if (f->kind == NOTE || f->kind == HINT)
        return EBPO_OK;
    return ebpo_fail_at(error, EBPO_E_FORMAT, in->shown, object, -1,
                        "attribute %s is missing; get a fresh copy of the file", f->name);
}

static ebpo_status get_version(ebpo_h5_in *in, ebpo_h5_id root, ebpo_info *info, ebpo_error *error)
{
    static const fact major = { "format_version_major", NUMBER, AT(version_major) };
    static const fact minor = { "format_version_minor", NUMBER, AT(version_minor) };
    char format[32];
    ebpo_status status = ebpo_h5_get_text(in, root, "/", "format", format, sizeof format, NULL);
    if (status != EBPO_OK || strcmp(format, FORMAT) != 0)
        return ebpo_fail_file(error, EBPO_E_FORMAT, in->shown,
                              "an HDF5 file, but not an EBP-Octree (its root attribute format does "
                              "not say \"%s\"); "
                              "make one with `ebpo convert`",
                              FORMAT);
    status = get_fact(in, root, "/", &major, info, error);
    if (status == EBPO_OK)
        status = get_fact(in, root, "/", &minor, info, error);
    if (status == EBPO_OK && info->version_major != EBPO_FORMAT_MAJOR)
        status = ebpo_fail_file(
            error, EBPO_E_VERSION, in->shown,
            "format version %d.%d, and this library reads version %d; use a newer one",
            info->version_major, info->version_minor, EBPO_FORMAT_MAJOR);
    char words[32]; /* they are for people, but files of the draft have the same numbers */
    if (status == EBPO_OK &&
        ebpo_h5_get_text(in, root, "/", "format_version", words, sizeof words, NULL) == EBPO_OK &&
        strcmp(words, DRAFT) == 0)
        status = ebpo_fail_file(error, EBPO_E_VERSION, in->shown,
                                "was written while the format was a draft, which is not read any "
                                "more; convert the model again");
    return status;
}

/* A part may stand in either list; one that we know counts as present. */
static ebpo_status take_part(ebpo_h5_in *in, const char *word, bool required, unsigned *seen,
                             ebpo_error *error)
{
    for (int i = 0; i < PARTS; i++) {
        if (strcmp(word, parts[i].word) != 0)
            continue;
        if (*seen >> i & 1)
            return ebpo_fail_file(error, EBPO_E_FORMAT, in->shown,
                                  "part \"%s\" is listed twice; get a fresh copy of the file",
                                  word);
        *seen |= 1u << i;
        return EBPO_OK;
    }
    if (!required)
        return EBPO_OK;
    return ebpo_fail_file(
        error, EBPO_E_VERSION, in->shown,
        "the file needs part \"%s\", which this library does not know; use a newer one", word);
}

static ebpo_status get_parts(ebpo_h5_in *in, ebpo_h5_id root, ebpo_info *info, ebpo_error *error)
{
    unsigned seen = 0;
    for (int required = 1; required >= 0; required--) {
        const char *name = required ? "required_parts" : "optional_parts";
        char words[1024], *rest = words, *word;
        ebpo_status status = ebpo_h5_get_text(in, root, "/", name, words, sizeof words, error);
        if (status == EBPO_E_ABSENT)
            return ebpo_fail_at(error, EBPO_E_FORMAT, in->shown, "/", -1,
                                "attribute %s is missing; get a fresh copy of the file", name);
        while (status == EBPO_OK && (word = strsep(&rest, " ")) != NULL)
            if (*word)
                status = take_part(in, word, required, &seen, error);
        if (status != EBPO_OK)
            return status;
    }
    for (int i = 0; i < PARTS; i++)
        if (seen >> i & 1)
            info->parts |= parts[i].part;
    info->pruned = info->parts & PRUNED;
    info->subtree_level = info->parts & SUBTREES ? 1 : 0; /* until get_subtrees */
    info->parts &= ~(uint32_t)(PRUNED | SUBTREES);
    return seen & 1 ? EBPO_OK : wrong_value(in, "/", "required_parts", error);
}

static ebpo_status get_subtrees(ebpo_h5_in *in, ebpo_h5_id root, ebpo_info *info, ebpo_error *error)
{
    ebpo_status status = get_fact(in, root, "/", &subtree_level_fact, info, error);
    if (status == EBPO_OK)
        status = get_fact(in, root, "/", &top_bytes_fact, info, error);
    if (status == EBPO_OK && (info->subtree_level < 1 || info->level_count > EBPO_LEVELS_MAX ||
                              info->subtree_level > info->level_count - 2))
        status = wrong_value(in, "/", "subtree_level", error);
    return status;
}

static ebpo_status get_subset(ebpo_h5_in *in, ebpo_h5_id root, ebpo_info *info, ebpo_error *error)
{
    int64_t levels = 0;
    ebpo_status status = get_digest(in, root, "/", "subset_of", info->subset_of, error);
    if (status == EBPO_E_ABSENT)
        return ebpo_fail_at(error, EBPO_E_FORMAT, in->shown, "/", -1,
                            "attribute subset_of is missing; get a fresh copy of the file");
    if (status == EBPO_OK)
        status = ebpo_h5_get_int(in, root, "/", "subset_levels", &levels, error);
    if (status == EBPO_OK && (levels < 1 || levels > EBPO_LEVELS_MAX))
        return wrong_value(in, "/", "subset_levels", error);
    info->cut_levels = (int)levels;
    if (status == EBPO_OK || status == EBPO_E_ABSENT)
        status = ebpo_h5_get_real(in, root, "/", "subset_box", info->kept_box, 6, error);
    info->boxed = status == EBPO_OK;
    for (int k = 0; k < 3 && info->boxed; k++)
        if (!(isfinite(info->kept_box[k]) && isfinite(info->kept_box[3 + k]) &&
              info->kept_box[k] <= info->kept_box[3 + k]))
            return wrong_value(in, "/", "subset_box", error);
    if (status == EBPO_OK || status == EBPO_E_ABSENT)
        status = ebpo_h5_get_real(in, root, "/", "subset_error", &info->kept_error, 0, error);
    if (status == EBPO_OK && !(isfinite(info->kept_error) && info->kept_error > 0))
        return wrong_value(in, "/", "subset_error", error);
    return status == EBPO_E_ABSENT ? EBPO_OK : status;
}

/* Place of the attribute's word in `words`; -1: another one, of a newer library. Without the
 * attribute *out stays. */
static ebpo_status get_known(ebpo_h5_in *in, ebpo_h5_id root, const char *name,
                             const char *(*word_of)(int value), int *out, ebpo_error *error)
{
    char word[64];
    ebpo_status status = ebpo_h5_get_text(in, root, "/", name, word, sizeof word, error);
    if (status == EBPO_E_ABSENT)
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

static const char *normals_word(int normals) { return NORMALS[normals]; }

static ebpo_status get_selection(ebpo_h5_in *in, ebpo_h5_id root, ebpo_info *info,
                                 ebpo_error *error)
{
    ebpo_status status = get_known(in, root, "selection", selection_word, &info->selection, error);
    if (status == EBPO_OK)
        status = get_known(in, root, "selection_normals", normals_word, &info->normals, error);
    for (int i = 0; i < SELECTION_FACTS && status == EBPO_OK && info->selection > 0; i++)
        status = get_fact(in, root, "/", &selection_facts[i], info, error);
    return status;
}

ebpo_status ebpo_facts_get(ebpo_h5_in *in, ebpo_h5_id root, ebpo_info *info, ebpo_error *error)
{
    ebpo_status status = get_version(in, root, info, error);
    if (status == EBPO_OK)
        status = get_parts(in, root, info, error);
    for (int i = 0; i < FACTS && status == EBPO_OK; i++)
        status = get_fact(in, root, "/", &facts[i], info, error);
    if (status == EBPO_OK)
        status = get_selection(in, root, info, error);
    if (status == EBPO_OK && info->subtree_level)
        status = get_subtrees(in, root, info, error);
    return status == EBPO_OK && info->pruned ? get_subset(in, root, info, error) : status;
}

ebpo_status ebpo_facts_get_level(ebpo_h5_in *in, ebpo_h5_id group, const char *path,
                                 ebpo_level_summary *level, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < LEVEL_FACTS && status == EBPO_OK; i++)
        status = get_fact(in, group, path, &level_facts[i], level, error);
    if (status == EBPO_OK)
        status = ebpo_h5_get_count(in, group, path, pruned_fact.name, &level->pruned_count, error);
    return status == EBPO_E_ABSENT ? EBPO_OK : status;
}
