#include "cli/commands/subset_run.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/command.h"
#include "cli/file_facts.h"
#include "cli/remote_args.h"
#include "cli/words.h"

const char *const profile_words[] = { "full", "lod", "collision", NULL }; /* by ebpo_profile */

/* Reads --levels, 0-N or 0-. Returns false for other text. */
static bool read_levels(const char *text, int *last)
{
    word_levels levels;
    if (!words_read_levels(text, &levels) || levels.first != 0 || !levels.is_contiguous)
        return false;
    *last = levels.to_end ? -1 : levels.last; /* -1: all levels */
    return true;
}

static bool read_box(const char *text, ebpo_subset_options *o)
{
    double number[6];
    if (!args_read_reals(text, 6, number))
        return false;
    for (int k = 0; k < 3; k++) {
        o->min[k] = number[k];
        o->max[k] = number[3 + k];
        if (o->min[k] > o->max[k])
            return false;
    }
    return o->boxed = true;
}

/* Returns the bit of the part that word[length] names; 0: no part has this name. */
static uint32_t part_named(const char *word, size_t length)
{
    static const struct {
        const char *word;
        uint32_t part;
    } names[] = { { "mesh", EBPO_PART_MESH },
                  { "maps", EBPO_PART_MAPS },
                  { "envelopes", EBPO_PART_PLANES },
                  { "planes", EBPO_PART_PLANES },
                  { "leaf-planes", EBPO_PART_LEAF_PLANES },
                  { "attributes", EBPO_PART_ATTRIBUTES },
                  { "colours", EBPO_PART_COLOURS },
                  { "border", EBPO_PART_BORDER },
                  { "surface", EBPO_PART_SURFACE } };
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (strlen(names[i].word) == length && memcmp(names[i].word, word, length) == 0)
            return names[i].part;
    return 0;
}

bool subset_read_parts(const char *text, uint32_t base, uint32_t *parts)
{
    bool changes = text[0] == '-' || text[0] == '+';
    *parts = changes ? base : 0;
    for (const char *at = text;; at++) {
        bool omits = *at == '-';
        if ((omits || *at == '+') != changes)
            return false;
        at += changes;
        size_t length = strcspn(at, ",");
        uint32_t part = part_named(at, length);
        if (!part)
            return false;
        *parts = omits ? *parts & ~part : *parts | part;
        at += length;
        if (!*at)
            return true;
    }
}

int subset_read_target(const char *name, double max_error, const char *target_size,
                       ebpo_subset_options *out)
{
    if (target_size && (!words_read_size(target_size, &out->target_bytes) || !out->target_bytes))
        return command_usage(name, "--target-size: '%s' is not " WORDS_SIZE_EXPECTED, target_size);
    if (target_size && max_error > 0)
        return command_usage(name, "--max-error and --target-size cannot be used together");
    out->max_error = max_error;
    return EXIT_OK;
}

void subset_print_target(const ebpo_info *info, bool chosen)
{
    if (chosen)
        printf(", profile %s", profile_words[info->parts & EBPO_PART_MAPS   ? EBPO_PROFILE_FULL
                                             : info->parts & EBPO_PART_MESH ? EBPO_PROFILE_COLLISION
                                                                            : EBPO_PROFILE_LOD]);
    if (info->kept_error > 0)
        printf(", pruned where envelopes extend at most %.6g beyond the model", info->kept_error);
}

int subset_options(const char *name, const subset_values *v, const char *in, const char *out_path,
                   ebpo_subset_options *out)
{
    *out = (ebpo_subset_options)EBPO_SUBSET_OPTIONS_INIT;
    if (v->levels && !read_levels(v->levels, &out->last_level))
        return command_usage(
            name,
            "--levels: '%s' is not 0-N with N up to 20; all levels from 0 to N are "
            "needed, as each level depends on the levels above",
            v->levels);
    if (v->box && !read_box(v->box, out))
        return command_usage(
            name, "--box: '%s' is not six numbers separated by commas, the lower corner first",
            v->box);
    uint32_t full_parts = ebpo_profile_parts(EBPO_PROFILE_FULL);
    if (v->parts && !subset_read_parts(v->parts, full_parts, &out->parts))
        return command_usage(name, "--parts: '%s' " SUBSET_PARTS_EXPECTED, v->parts);
    if (v->parts && v->profile >= 0)
        return command_usage(name, "--parts and --profile cannot be used together");
    if (v->zstd_level && v->codec > EBPO_CODEC_ZSTD)
        return command_usage(name, "--zstd-level does not apply to --codec deflate or none");
    if (!subtree_faces_read(name, v->subtree_faces, &out->subtree_faces) ||
        command_overwrites(name, in, out_path))
        return EXIT_USAGE;
    if (v->profile >= 0)
        out->parts = ebpo_profile_parts((ebpo_profile)v->profile);
    out->threads = (unsigned)v->threads;
    out->face_coding = (ebpo_face_coding)v->face_coding;
    out->choose_parts = v->target_size && !v->parts && v->profile < 0 && !v->levels;
    return subset_read_target(name, v->max_error, v->target_size, out);
}

static ebpo_status refuse_values(ebpo_error *error, const char *shown, const char *what)
{
    error->status = EBPO_E_ARGUMENT;
    snprintf(error->message, sizeof error->message, "%.200s: %s", shown, what);
    return EBPO_E_ARGUMENT;
}

ebpo_status subset_set_parts(const subset_values *v, const ebpo_info *info, const char *shown,
                             ebpo_subset_options *out, ebpo_error *error)
{
    char what[200];
    if (out->last_level >= info->level_count && !info->pruned) {
        snprintf(what, sizeof what, "there is no level %d; the file has levels 0 to %d",
                 out->last_level, info->level_count - 1);
        return refuse_values(error, shown, what);
    }
    uint32_t requested = 0; /* parts in the list without a minus sign */
    if (v->parts && subset_read_parts(v->parts, 0, &requested) && requested & ~info->parts) {
        char parts[80];
        snprintf(what, sizeof what, "--parts requests %s, which the file does not have",
                 words_parts(parts, sizeof parts, requested & ~info->parts));
        return refuse_values(error, shown, what);
    }
    uint32_t of_mesh = EBPO_PART_MAPS | EBPO_PART_ATTRIBUTES | EBPO_PART_BORDER;
    if (requested & of_mesh && !(out->parts & EBPO_PART_MESH)) {
        char parts[80];
        snprintf(what, sizeof what,
                 "--parts requests %s without the mesh, to which they belong; add mesh",
                 words_parts(parts, sizeof parts, requested & of_mesh));
        return refuse_values(error, shown, what);
    }
    if (!v->parts && v->profile < 0 && out->last_level >= 0 &&
        out->last_level < info->level_count - 1)
        out->parts &= ~(uint32_t)(EBPO_PART_MESH | EBPO_PART_MAPS | EBPO_PART_ATTRIBUTES);
    if (v->profile == EBPO_PROFILE_LOD && !(info->parts & EBPO_PART_LEAF_PLANES) && !v->quiet)
        fprintf(stderr,
                "note: %s stores no leaf planes, so leaves will have their parents' envelopes; "
                "'ebpo convert --profile lod' stores them\n",
                shown);
    out->codec = v->codec >= 0 ? (ebpo_codec)v->codec : info->codec;
    out->codec_level = (int)v->zstd_level;
    if (v->zstd_level && out->codec != EBPO_CODEC_ZSTD)
        return refuse_values(
            error, shown,
            "--zstd-level does not apply to the codec of this file; add --codec zstd");
    return EBPO_OK;
}

static void print_summary(const subset_values *v, const char *out_path, const ebpo_info *info,
                          const ebpo_info *from, const traffic *t, double seconds)
{
    char bytes[32], whole[32], parts[80], fetched[32];
    printf("%s: levels 0 to %d", out_path, info->level_count - 1);
    words_parts(parts, sizeof parts, info->parts);
    printf(", %s, %s of %s", parts[0] ? parts : "types only",
           words_bytes(bytes, sizeof bytes, info->file_bytes),
           words_bytes(whole, sizeof whole, from->file_bytes));
    if (info->parts & EBPO_PART_MESH && info->face_count < from->face_count)
        printf(", %" PRIu64 " of %" PRIu64 " faces", info->face_count, from->face_count);
    subset_print_target(info, v->target_size && !v->parts && v->profile < 0 && !v->levels);
    if (info->kept_error > 0 && from->parts & ~info->parts & EBPO_PART_SURFACE)
        printf(", without the simplified surface, which has the faces of pruned nodes");
    if (t->remote)
        printf(", %s in %" PRIu64 " requests", words_bytes(fetched, sizeof fetched, t->http.bytes),
               t->http.requests);
    if (t->remote && t->http.cache_bytes)
        printf(", %s fetched earlier", words_bytes(fetched, sizeof fetched, t->http.cache_bytes));
    printf(", in %.1f s\n", seconds);
}

ebpo_status subset_report(const subset_values *v, const char *out_path, const ebpo_info *from,
                          const traffic *t, double seconds, ebpo_error *error)
{
    ebpo_file *file = NULL;
    if (v->quiet && !v->json)
        return EBPO_OK;
    ebpo_stored_sizes stored = EBPO_STORED_SIZES_INIT;
    ebpo_status status = remote_open_own(out_path, &file, error);
    if (status == EBPO_OK)
        status = ebpo_file_locate(file, &stored, error);
    if (status != EBPO_OK) {
        ebpo_close(file);
        return status;
    }
    if (v->json) {
        json j;
        json_begin(&j, stdout);
        json_object(&j, NULL);
        facts_json(&j, out_path, ebpo_file_info(file), &stored, NULL);
        json_uint(&j, "source_bytes", from->file_bytes);
        if (t->remote) {
            json_uint(&j, "fetched_requests", t->http.requests);
            json_uint(&j, "fetched_bytes", t->http.bytes);
            json_uint(&j, "resumed_bytes", t->http.cache_bytes);
        }
        json_real(&j, "seconds", seconds);
        remote_json(&j, t, &v->remote);
        json_finish(&j);
    } else {
        print_summary(v, out_path, ebpo_file_info(file), from, t, seconds);
    }
    ebpo_close(file);
    return EBPO_OK;
}
