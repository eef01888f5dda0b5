/* Reading the attributes of a head. */
#include <ebpo/build.h>
#include <math.h>
#include <string.h>

#include "core/error.h"
#include "format/head_facts.h"
#include "format/head_facts_table.h"

static ebpo_status wrong_value(ebpo_head *in, const char *object, const char *name,
                               ebpo_error *error)
{
    return ebpo_fail_at(error, EBPO_E_FORMAT, in->shown, object, -1,
                        "attribute %s has a value that the format does not allow; get a fresh "
                        "copy of the file",
                        name);
}

static ebpo_status get_word(ebpo_head *in, ebpo_head_object id, const char *object,
                            const ebpo_fact *f, void *field, ebpo_error *error)
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

static ebpo_status get_limited(ebpo_head *in, ebpo_head_object id, const char *object,
                               const ebpo_fact *f, void *field, ebpo_error *error)
{
    int64_t number = 0;
    uint64_t count = 0;
    bool is_int = f->kind == EBPO_FACT_NUMBER;
    ebpo_status status = is_int ? ebpo_head_get_int(in, id, object, f->name, &number, error)
                                : ebpo_head_get_count(in, id, object, f->name, &count, error);
    if (status != EBPO_OK)
        return status;
    if ((f->kind == EBPO_FACT_YES_NO && count > 1) ||
        (f->kind == EBPO_FACT_COUNT32 && count > UINT32_MAX) ||
        (is_int && (number < 0 || number > 1 << 20)))
        return wrong_value(in, object, f->name, error);
    if (f->kind == EBPO_FACT_YES_NO)
        *(bool *)field = count;
    else if (f->kind == EBPO_FACT_COUNT32)
        *(uint32_t *)field = (uint32_t)count;
    else
        *(int *)field = (int)number;
    return EBPO_OK;
}

static ebpo_status get_fact(ebpo_head *in, ebpo_head_object id, const char *object,
                            const ebpo_fact *f, void *record, ebpo_error *error)
{
    void *field = (char *)record + f->offset;
    ebpo_status status = EBPO_E_ARGUMENT;
    switch (f->kind) {
    case EBPO_FACT_TEXT:
    case EBPO_FACT_NOTE:
        status = ebpo_head_get_text(in, id, object, f->name, field, f->size, error);
        break;
    case EBPO_FACT_DIGEST: status = get_digest(in, id, object, f->name, field, error); break;
    case EBPO_FACT_NUMBER:
    case EBPO_FACT_COUNT32:
    case EBPO_FACT_YES_NO: status = get_limited(in, id, object, f, field, error); break;
    case EBPO_FACT_INTEGER:
        status = ebpo_head_get_int(in, id, object, f->name, field, error);
        break;
    case EBPO_FACT_HINT:
        if (ebpo_head_get_count(in, id, object, f->name, field, NULL) != EBPO_OK)
            *(uint64_t *)field = 0; /* absent, or of another program's type: no hint */
        return EBPO_OK;
    case EBPO_FACT_COUNT:
        status = ebpo_head_get_count(in, id, object, f->name, field, error);
        break;
    case EBPO_FACT_REAL:
        status = ebpo_head_get_real(in, id, object, f->name, field, 0, error);
        break;
    case EBPO_FACT_REAL3:
        status = ebpo_head_get_real(in, id, object, f->name, field, 3, error);
        break;
    case EBPO_FACT_WORD: status = get_word(in, id, object, f, field, error); break;
    }
    if (status != EBPO_E_ABSENT)
        return status;
    if (f->kind == EBPO_FACT_NOTE)
        return EBPO_OK;
    return ebpo_fail_at(error, EBPO_E_FORMAT, in->shown, object, -1,
                        "attribute %s is missing; get a fresh copy of the file", f->name);
}

static ebpo_status get_version(ebpo_head *in, ebpo_head_object root, ebpo_info *info,
                               ebpo_error *error)
{
    static const ebpo_fact major = { "format_version_major", EBPO_FACT_NUMBER,
                                     EBPO_FACT_AT(version_major) };
    static const ebpo_fact minor = { "format_version_minor", EBPO_FACT_NUMBER,
                                     EBPO_FACT_AT(version_minor) };
    char format[32];
    ebpo_status status = ebpo_head_get_text(in, root, "/", "format", format, sizeof format, error);
    if (status == EBPO_E_MEMORY)
        return status;
    if (status != EBPO_OK || strcmp(format, EBPO_FORMAT_NAME) != 0)
        return ebpo_fail_file(error, EBPO_E_FORMAT, in->shown,
                              "an HDF5 file, but not an EBP-Octree (its root attribute format does "
                              "not say \"%s\"); %s",
                              EBPO_FORMAT_NAME,
                              status == EBPO_OK && strncmp(format, "EBP-Octree paint", 16) == 0
                                  ? "it is paint: `ebpo paint` tells of which model"
                                  : "make one with `ebpo convert`");
    status = get_fact(in, root, "/", &major, info, error);
    if (status == EBPO_OK)
        status = get_fact(in, root, "/", &minor, info, error);
    if (status == EBPO_OK && info->version_major != EBPO_FORMAT_MAJOR)
        status = ebpo_fail_file(
            error, EBPO_E_VERSION, in->shown,
            "format version %d.%d, and this library reads version %d; use a newer one",
            info->version_major, info->version_minor, EBPO_FORMAT_MAJOR);
    char words[32] = ""; /* for people, but files of the draft have the same numbers */
    if (status == EBPO_OK)
        status = ebpo_head_get_text(in, root, "/", "format_version", words, sizeof words, error);
    if (status == EBPO_E_ABSENT)
        return EBPO_OK;
    if (status == EBPO_OK && strcmp(words, "1.0-draft") == 0)
        status = ebpo_fail_file(error, EBPO_E_VERSION, in->shown,
                                "was written while the format was a draft, which is not read any "
                                "more; convert the model again");
    return status;
}

/* A part may stand in either list; one that we know counts as present. */
static ebpo_status take_part(ebpo_head *in, const char *word, bool required, unsigned *seen,
                             ebpo_error *error)
{
    for (int i = 0; i < ebpo_part_word_count; i++) {
        if (strcmp(word, ebpo_part_words[i].word) != 0)
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

static ebpo_status get_parts(ebpo_head *in, ebpo_head_object root, ebpo_info *info,
                             ebpo_error *error)
{
    unsigned seen = 0;
    for (int required = 1; required >= 0; required--) {
        const char *name = required ? "required_parts" : "optional_parts";
        char words[1024], *rest = words;
        ebpo_status status = ebpo_head_get_text(in, root, "/", name, words, sizeof words, error);
        if (status == EBPO_E_ABSENT)
            return ebpo_fail_at(error, EBPO_E_FORMAT, in->shown, "/", -1,
                                "attribute %s is missing; get a fresh copy of the file", name);
        if (status == EBPO_OK && !*words)
            rest = NULL; /* no words */
        while (status == EBPO_OK && rest) {
            char *word = rest, *space = strchr(rest, ' ');
            rest = space ? space + 1 : NULL;
            if (space)
                *space = 0;
            status = *word ? take_part(in, word, required, &seen, error)
                           : wrong_value(in, "/", name, error);
        }
        if (status != EBPO_OK)
            return status;
    }
    for (int i = 0; i < ebpo_part_word_count; i++)
        if (seen >> i & 1)
            info->parts |= ebpo_part_words[i].part;
    info->pruned = info->parts & EBPO_WORD_PRUNED;
    info->subtree_level = info->parts & EBPO_WORD_SUBTREES ? 1 : 0; /* until get_subtrees */
    info->gates = info->parts & EBPO_WORD_GATES;
    info->parts &= ~(uint32_t)(EBPO_WORD_PRUNED | EBPO_WORD_SUBTREES | EBPO_WORD_GATES);
    return seen & 1 ? EBPO_OK : wrong_value(in, "/", "required_parts", error);
}

static ebpo_status get_subtrees(ebpo_head *in, ebpo_head_object root, ebpo_info *info,
                                ebpo_error *error)
{
    ebpo_status status = get_fact(in, root, "/", &ebpo_subtree_level_fact, info, error);
    if (status == EBPO_OK)
        status = get_fact(in, root, "/", &ebpo_top_bytes_fact, info, error);
    if (status == EBPO_OK && (info->subtree_level < 1 || info->level_count > EBPO_LEVELS_MAX ||
                              info->subtree_level > info->level_count - 2))
        status = wrong_value(in, "/", "subtree_level", error);
    return status;
}

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

/* Place of the attribute's word in `words`; -1: another one, of a newer library. Without the
 * attribute *out stays. */
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

static const char *normals_word(int normals) { return ebpo_normals_words[normals]; }

static ebpo_status get_selection(ebpo_head *in, ebpo_head_object root, ebpo_info *info,
                                 ebpo_error *error)
{
    ebpo_status status = get_known(in, root, "selection", selection_word, &info->selection, error);
    if (status == EBPO_OK)
        status = get_known(in, root, "selection_normals", normals_word, &info->normals, error);
    for (int i = 0; i < ebpo_selection_fact_count && status == EBPO_OK && info->selection > 0; i++)
        status = get_fact(in, root, "/", &ebpo_selection_facts[i], info, error);
    return status;
}

/* Dropping is known to have been asked for where it did something. */
static ebpo_status get_dropped(ebpo_head *in, ebpo_head_object root, ebpo_info *info,
                               ebpo_error *error)
{
    uint64_t count = 0;
    ebpo_status status =
        ebpo_head_get_count(in, root, "/", ebpo_dropped_faces_fact.name, &count, error);
    if (status == EBPO_E_ABSENT)
        return EBPO_OK;
    info->mend.dropped_faces = count;
    info->mend.drop_duplicates = count > 0;
    return status;
}

/* The record of welding within a distance, which most files lack: ebpo_facts_check has the rest. */
static ebpo_status get_weld(ebpo_head *in, ebpo_head_object root, ebpo_info *info,
                            ebpo_error *error)
{
    double distance = 0;
    ebpo_status status =
        ebpo_head_get_real(in, root, "/", ebpo_weld_facts[0].name, &distance, 0, error);
    if (status == EBPO_E_ABSENT)
        return EBPO_OK;
    if (status == EBPO_OK && !(distance > 0)) /* 0 would be none */
        return wrong_value(in, "/", ebpo_weld_facts[0].name, error);
    for (int i = 0; i < EBPO_WELD_FACTS && status == EBPO_OK; i++)
        status = get_fact(in, root, "/", &ebpo_weld_facts[i], info, error);
    return status;
}

ebpo_status ebpo_facts_get(ebpo_head *in, ebpo_head_object root, ebpo_info *info, ebpo_error *error)
{
    ebpo_status status = get_version(in, root, info, error);
    if (status == EBPO_OK)
        status = get_parts(in, root, info, error);
    for (int i = 0; i < ebpo_fact_count && status == EBPO_OK; i++)
        status = get_fact(in, root, "/", &ebpo_facts[i], info, error);
    if (status == EBPO_OK)
        status = get_selection(in, root, info, error);
    if (status == EBPO_OK)
        status = get_dropped(in, root, info, error);
    if (status == EBPO_OK)
        status = get_weld(in, root, info, error);
    if (status == EBPO_OK && info->parts & EBPO_PART_COLOURS)
        status = get_fact(in, root, "/", &ebpo_colours_fact, info, error);
    if (status == EBPO_OK && info->subtree_level)
        status = get_subtrees(in, root, info, error);
    return status == EBPO_OK && info->pruned ? get_subset(in, root, info, error) : status;
}

ebpo_status ebpo_facts_get_level(ebpo_head *in, ebpo_head_object group, const char *path,
                                 ebpo_level_summary *level, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < ebpo_level_fact_count && status == EBPO_OK; i++)
        status = get_fact(in, group, path, &ebpo_level_facts[i], level, error);
    if (status == EBPO_OK)
        status = ebpo_head_get_count(in, group, path, ebpo_pruned_fact.name, &level->pruned_count,
                                     error);
    return status == EBPO_E_ABSENT ? EBPO_OK : status;
}
