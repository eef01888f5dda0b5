/* Writing the attributes of a head. */
#include <ebpo/build.h>
#include <stdio.h>
#include <string.h>

#include "core/error.h"
#include "core/checksum.h"
#include "format/head_facts.h"
#include "format/head_facts_table.h"

static const char FORMAT_VERSION[] = "1.1";
static const char ABOUT[] = "A triangle mesh with an octree of convex envelopes (EBP-Octree), "
                            "level by level: /levels/00 and so on, "
                            "then /mesh, then /maps. Each array's attributes name its coding; the "
                            "specification is format-spec/README.md of ebpo.";

static ebpo_status put_word(ebpo_h5_out *out, ebpo_h5_id id, const ebpo_fact *f, const void *field,
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

static ebpo_status put_fact(ebpo_h5_out *out, ebpo_h5_id id, const ebpo_fact *f, const void *record,
                            ebpo_error *error)
{
    const void *field = (const char *)record + f->offset;
    switch (f->kind) {
    case EBPO_FACT_TEXT: return ebpo_h5_put_text(out, id, f->name, field, error);
    case EBPO_FACT_NOTE:
        return *(const char *)field ? ebpo_h5_put_text(out, id, f->name, field, error) : EBPO_OK;
    case EBPO_FACT_DIGEST: return put_digest(out, id, f->name, field, error);
    case EBPO_FACT_NUMBER: return ebpo_h5_put_int(out, id, f->name, *(const int *)field, error);
    case EBPO_FACT_INTEGER:
        return ebpo_h5_put_int(out, id, f->name, *(const int64_t *)field, error);
    case EBPO_FACT_COUNT32:
        return ebpo_h5_put_count(out, id, f->name, *(const uint32_t *)field, error);
    case EBPO_FACT_HINT:
    case EBPO_FACT_COUNT:
        return ebpo_h5_put_count(out, id, f->name, *(const uint64_t *)field, error);
    case EBPO_FACT_YES_NO: return ebpo_h5_put_count(out, id, f->name, *(const bool *)field, error);
    case EBPO_FACT_REAL: return ebpo_h5_put_real(out, id, f->name, field, 0, error);
    case EBPO_FACT_REAL3: return ebpo_h5_put_real(out, id, f->name, field, 3, error);
    case EBPO_FACT_WORD: return put_word(out, id, f, field, error);
    }
    return EBPO_E_ARGUMENT;
}

static ebpo_status put_parts(ebpo_h5_out *out, ebpo_h5_id root, const ebpo_info *info,
                             bool required, ebpo_error *error)
{
    char words[128] = "";
    uint32_t has = info->parts | (info->pruned ? EBPO_WORD_PRUNED : 0) |
                   (info->subtree_level ? EBPO_WORD_SUBTREES : 0) |
                   (info->gates ? EBPO_WORD_GATES : 0);
    for (int i = 0; i < ebpo_part_word_count; i++)
        if (ebpo_part_words[i].required == required &&
            (!ebpo_part_words[i].part || has & ebpo_part_words[i].part)) {
            size_t used = strlen(words);
            snprintf(words + used, sizeof words - used, "%s%s", used ? " " : "",
                     ebpo_part_words[i].word);
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
        status = ebpo_h5_put_text(out, root, "selection_normals", ebpo_normals_words[info->normals],
                                  error);
    for (int i = 0; i < ebpo_selection_fact_count && status == EBPO_OK; i++)
        status = put_fact(out, root, &ebpo_selection_facts[i], info, error);
    return status;
}

static ebpo_status put_subtrees(ebpo_h5_out *out, ebpo_h5_id root, const ebpo_info *info,
                                ebpo_error *error)
{
    ebpo_status status = put_fact(out, root, &ebpo_subtree_level_fact, info, error);
    return status == EBPO_OK ? put_fact(out, root, &ebpo_top_bytes_fact, info, error) : status;
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
    ebpo_status status = ebpo_h5_put_text(out, root, "format", EBPO_FORMAT_NAME, error);
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
    for (int i = 0; i < ebpo_fact_count && status == EBPO_OK; i++)
        status = put_fact(out, root, &ebpo_facts[i], info, error);
    if (status == EBPO_OK)
        status = put_selection(out, root, info, error);
    if (status == EBPO_OK && info->mend.dropped_faces)
        status = put_fact(out, root, &ebpo_dropped_faces_fact, info, error);
    for (int i = 0; i < EBPO_WELD_FACTS && status == EBPO_OK && info->mend.weld_distance > 0; i++)
        status = put_fact(out, root, &ebpo_weld_facts[i], info, error);
    if (status == EBPO_OK && info->parts & EBPO_PART_COLOURS)
        status = put_fact(out, root, &ebpo_colours_fact, info, error);
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
    return put_digest(out, root, ebpo_colours_fact.name, digest, error);
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
    return ebpo_h5_put_count(out, root, ebpo_top_bytes_fact.name, bytes, error);
}

ebpo_status ebpo_facts_put_level(ebpo_h5_out *out, ebpo_h5_id group,
                                 const ebpo_level_summary *level, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < ebpo_level_fact_count && status == EBPO_OK; i++)
        status = put_fact(out, group, &ebpo_level_facts[i], level, error);
    if (status == EBPO_OK && level->pruned_count)
        status = put_fact(out, group, &ebpo_pruned_fact, level, error);
    return status;
}
