/* Makes a catalogue, a list of models with their boxes, from a JSON file or an array.
 *
 * A catalogue file is untrusted input. The kind and range of every member that is used are checked
 * before the catalogue is made. Paths must be texts, and digests must be 64 hexadecimal digits.
 * Boxes must have two corners of three finite numbers each, with min not above max. When a model is
 * opened, open_models.c compares the digest and the box with the model. Unknown members are
 * ignored.
 *
 * The paths in the entries of a catalogue include their base folder. For a catalogue file, the base
 * folder is the folder of this file. A catalogue is immutable, and any number of threads may use
 * it.
 *
 * Source: docs/guide/clusters.md has the format. */
#include "core/strict_fp.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "catalogue/catalogue_in.h"
#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/hash.h"
#include "core/os.h"

/* MAX_BYTES: maximum length of a catalogue file in bytes, sufficient for some millions of models.
 * It limits the memory for reading, which is many times the length of the file. DIGEST_LETTERS:
 * number of letters of a digest. */
enum { MAX_BYTES = 1 << 30, DIGEST_LETTERS = 64 };

const char *const ebpo_catalogue_rules[] = { "nonzero", "evenodd", "positive" };
enum { RULES = sizeof ebpo_catalogue_rules / sizeof ebpo_catalogue_rules[0] };

const char *ebpo_catalogue_shown(const ebpo_catalogue *c)
{
    return c->path ? c->path : "the catalogue";
}

/* --- making --- */

/* Returns the path by which a file is opened. If `path` is relative, the result is `folder`
 * followed by `path`; `folder` is "" or ends in '/'. Otherwise the result is a copy of `path`.
 * Returns NULL when out of memory. */
static char *joined_path(const char *folder, const char *path)
{
    bool whole = ebpo_path_is_absolute(path) || strstr(path, "://");
    size_t before = whole ? 0 : strlen(folder), size = strlen(path) + 1;
    char *joined = malloc(before + size);
    if (joined) {
        memcpy(joined, folder, before);
        memcpy(joined + before, path, size);
    }
    return joined;
}

/* Makes the tree of the boxes of all models. If `seen` is true, the tree has only the boxes of the
 * models that rays and distances use (not models that consist of caps only). */
static bool make_boxes(ebpo_catalogue_boxes *boxes, const ebpo_catalogue *c, bool seen)
{
    ebpo_catalogue_box *box = ebpo_alloc(c->count, sizeof *box);
    uint32_t *number = ebpo_alloc(c->count, sizeof *number);
    size_t count = 0;
    for (uint64_t i = 0; box && number && i < c->count; i++) {
        const ebpo_catalogue_entry *e = &c->entry[i];
        if (seen && e->only_caps)
            continue;
        memcpy(box[count].min, e->min, sizeof e->min);
        memcpy(box[count].max, e->max, sizeof e->max);
        number[count++] = (uint32_t)i;
    }
    bool good = box && number && ebpo_catalogue_boxes_make(boxes, box, number, count);
    free(box);
    free(number);
    return good;
}

/* Sets the members of the catalogue that depend on its entries. */
static ebpo_status finish_catalogue(ebpo_catalogue *c, ebpo_error *error)
{
    for (uint64_t i = 0; i < c->count && !c->surface; i++)
        c->surface = c->entry[i].solid ? NULL : &c->entry[i];
    return make_boxes(&c->all, c, false) && make_boxes(&c->seen, c, true)
               ? EBPO_OK
               : ebpo_fail_memory(error, c->count * sizeof(ebpo_catalogue_box));
}

static ebpo_status begin_catalogue(const ebpo_catalogue_options *options, ebpo_catalogue **out,
                                   ebpo_error *error)
{
    *out = NULL;
    ebpo_catalogue *c = calloc(1, sizeof *c);
    if (!c)
        return ebpo_fail_memory(error, sizeof *c);
    c->how = (ebpo_catalogue_options)EBPO_CATALOGUE_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_catalogue_options, &c->how, options, error);
    if (status == EBPO_OK && (unsigned)c->how.rule >= RULES)
        status = ebpo_fail(error, EBPO_E_ARGUMENT, "unknown winding rule %d", (int)c->how.rule);
    if (status == EBPO_OK)
        *out = c;
    else
        free(c);
    return status;
}

void ebpo_catalogue_free(ebpo_catalogue *c)
{
    if (!c)
        return;
    for (uint64_t i = 0; c->entry && i < c->count; i++) {
        free((char *)c->entry[i].path);
        free((char *)c->entry[i].surface);
        free((char *)c->entry[i].numbers);
    }
    ebpo_catalogue_boxes_free(&c->all);
    ebpo_catalogue_boxes_free(&c->seen);
    free(c->entry);
    free(c->path);
    free(c);
}

static ebpo_status end_making(ebpo_catalogue *c, ebpo_status status, ebpo_catalogue **out,
                              ebpo_error *error)
{
    if (status == EBPO_OK)
        status = finish_catalogue(c, error);
    if (status == EBPO_OK) {
        *out = c;
    } else {
        ebpo_catalogue_free(c);
        *out = NULL;
    }
    return status;
}

/* --- checks of entries --- */

/* Returns the fault of an entry, in words that follow "entry N"; NULL: the entry has no fault. */
static const char *fault_of_entry(const ebpo_catalogue_entry *e)
{
    if (!e->path || !*e->path)
        return "has no path";
    if (e->surface && !*e->surface)
        return "has an empty path in `surface`";
    if (e->surface && e->only_caps)
        return "has a `surface`, although `only_caps` is true";
    if (e->numbers && !*e->numbers)
        return "has an empty path of face indices";
    if ((unsigned)e->rule >= RULES)
        return "has an unknown winding rule";
    for (int k = 0; k < 3; k++)
        if (!isfinite(e->min[k]) || !isfinite(e->max[k]) || e->min[k] > e->max[k])
            return "has an invalid box: min is above max, or a corner is not finite";
    return NULL;
}

static bool copy_entry(ebpo_catalogue_entry *to, const ebpo_catalogue_entry *from,
                       const char *folder)
{
    *to = *from;
    to->path = joined_path(folder, from->path);
    to->surface = from->surface ? joined_path(folder, from->surface) : NULL;
    to->numbers = from->numbers ? joined_path(folder, from->numbers) : NULL;
    return to->path && !to->surface == !from->surface && !to->numbers == !from->numbers;
}

static ebpo_status copy_entries(ebpo_catalogue *c, const ebpo_catalogue_entry *entries,
                                uint64_t count, ebpo_error *error)
{
    const char *folder_option = c->how.folder ? c->how.folder : "";
    size_t length = strlen(folder_option);
    char *folder = malloc(length + 2);
    c->entry = ebpo_alloc_zero(count, sizeof *c->entry);
    if (folder) {
        memcpy(folder, folder_option, length + 1);
        if (length && folder[length - 1] != '/')
            memcpy(folder + length, "/", 2);
    }
    bool good = folder && c->entry;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < count && good && status == EBPO_OK; i++) {
        const char *fault = fault_of_entry(&entries[i]);
        c->count = i + 1;
        if (fault)
            status = ebpo_fail(error, EBPO_E_ARGUMENT, "entry %" PRIu64 " %s", i, fault);
        else
            good = copy_entry(&c->entry[i], &entries[i], folder);
    }
    free(folder);
    c->how.folder = NULL;
    return good ? status : ebpo_fail_memory(error, count * sizeof *c->entry);
}

ebpo_status ebpo_catalogue_new(const ebpo_catalogue_entry *entries, uint64_t count,
                               const ebpo_catalogue_options *options, ebpo_catalogue **out,
                               ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_catalogue *c;
    *out = NULL;
    if (count == 0 || count >= UINT32_MAX)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "a catalogue needs at least one model, and at most 2^32 - 2");
    ebpo_status status = begin_catalogue(options, &c, error);
    return status == EBPO_OK ? end_making(c, copy_entries(c, entries, count, error), out, error)
                             : status;
}

void ebpo_catalogue_entry_of(const ebpo_file *file, const char *path, ebpo_catalogue_entry *out)
{
    const ebpo_info *info = ebpo_file_info(file);
    *out = (ebpo_catalogue_entry){ .path = path,
                                   .file_bytes = info->file_bytes,
                                   .face_count = info->face_count,
                                   .vertex_count = info->vertex_count,
                                   .rule = info->rule,
                                   .mesh = (info->parts & EBPO_PART_MESH) != 0,
                                   .pruned = info->pruned,
                                   .solid = info->solid };
    memcpy(out->digest, info->content_sha256, sizeof out->digest);
    memcpy(out->min, info->report.min, sizeof out->min);
    memcpy(out->max, info->report.max, sizeof out->max);
}

/* --- facts --- */

ebpo_status ebpo_catalogue_get_facts(const ebpo_catalogue *c, ebpo_catalogue_facts *out)
{
    ebpo_catalogue_facts facts = EBPO_CATALOGUE_FACTS_INIT;
    facts.path = c->path;
    facts.count = c->count;
    facts.file_bytes = c->file_bytes;
    facts.file_hash = c->file_hash;
    facts.rule = c->how.rule;
    facts.parts = c->how.parts;
    return EBPO_GIVE(ebpo_catalogue_facts, out, &facts);
}

const ebpo_catalogue_entry *ebpo_catalogue_get_entry(const ebpo_catalogue *c, uint64_t number)
{
    return number < c->count ? &c->entry[number] : NULL;
}

/* --- reading: values --- */

typedef struct reader {
    ebpo_catalogue *c;
    char *folder;    /* ending in '/', or "" */
    uint64_t number; /* index of the model that is read */
    ebpo_error *error;
} reader;

static ebpo_status bad_model(const reader *r, const char *what)
{
    return ebpo_fail_file(r->error, EBPO_E_FORMAT, r->c->path,
                          "not a catalogue: models[%" PRIu64 "]: %s", r->number, what);
}

static ebpo_status bad_file(const reader *r, const char *what)
{
    return ebpo_fail_file(r->error, EBPO_E_FORMAT, r->c->path, "not a catalogue: %s", what);
}

/* Reads a path from a member of a model. *out stays NULL if the member is missing, null or empty.
 */
static ebpo_status read_path(const reader *r, const json_t *model, const char *key,
                             const char **out)
{
    const json_t *value = json_object_get(model, key);
    char what[64];
    if (!value || json_is_null(value) || (json_is_string(value) && !json_string_length(value)))
        return EBPO_OK;
    snprintf(what, sizeof what, "%s is not a string", key);
    if (!json_is_string(value))
        return bad_model(r, what);
    *out = joined_path(r->folder, json_string_value(value));
    return *out ? EBPO_OK : ebpo_fail_memory(r->error, json_string_length(value));
}

static ebpo_status read_digest(const reader *r, const json_t *model, const char *key,
                               uint8_t out[32])
{
    static const char letters[] = "0123456789abcdef";
    const char *text = json_string_value(json_object_get(model, key));
    char what[128];
    if (text && strlen(text) == DIGEST_LETTERS && strspn(text, letters) == DIGEST_LETTERS) {
        for (int i = 0; i < DIGEST_LETTERS / 2; i++)
            out[i] = (uint8_t)((strchr(letters, text[2 * i]) - letters) << 4 |
                               (strchr(letters, text[2 * i + 1]) - letters));
        return EBPO_OK;
    }
    snprintf(what, sizeof what,
             "%s is not a digest, which must be 64 digits 0 to 9 or letters a to f", key);
    return bad_model(r, what);
}

static bool read_corner(const json_t *model, const char *key, double out[3])
{
    const json_t *value = json_object_get(model, key);
    bool good = json_array_size(value) == 3;
    for (size_t k = 0; good && k < 3; k++) {
        const json_t *x = json_array_get(value, k);
        out[k] = json_number_value(x);
        good = json_is_number(x) && isfinite(out[k]);
    }
    return good;
}

static ebpo_status read_box(const reader *r, const json_t *model, ebpo_catalogue_entry *e)
{
    if (!read_corner(model, "box_min", e->min) || !read_corner(model, "box_max", e->max))
        return bad_model(r, "a box needs two corners, box_min and box_max, of three numbers");
    for (int k = 0; k < 3; k++)
        if (e->min[k] > e->max[k])
            return bad_model(r, "box_min is above box_max");
    return EBPO_OK;
}

static bool read_rule(const json_t *of, ebpo_rule *out)
{
    const json_t *rule = json_object_get(of, "rule");
    bool found = !rule;
    *out = EBPO_RULE_NONZERO;
    for (int i = 0; json_is_string(rule) && i < RULES; i++)
        if (strcmp(ebpo_catalogue_rules[i], json_string_value(rule)) == 0) {
            *out = (ebpo_rule)i;
            found = true;
        }
    return found;
}

/* Returns a count, or 0 if the count is missing or invalid. No query uses these counts, so they are
 * not checked further. */
static uint64_t read_count(const json_t *model, const char *key)
{
    double count = json_number_value(json_object_get(model, key));
    return count >= 0 && count < 0x1p64 ? (uint64_t)count : 0;
}

/* --- reading: models --- */

static ebpo_status read_paths(const reader *r, const json_t *model, ebpo_catalogue_entry *e)
{
    ebpo_status status = read_path(r, model, "path", &e->path);
    if (status == EBPO_OK)
        status = read_path(r, model, "surface", &e->surface);
    if (status == EBPO_OK)
        status = read_path(r, model, "numbers", &e->numbers);
    if (status == EBPO_OK && !e->path)
        return bad_model(r, "has no path");
    e->only_caps = json_is_null(json_object_get(model, "surface"));
    return status;
}

static ebpo_status read_entry(const reader *r, const json_t *model, ebpo_catalogue_entry *e)
{
    const json_t *solid = json_object_get(model, "solid");
    if (!json_is_object(model))
        return bad_model(r, "not an object");
    ebpo_status status = read_paths(r, model, e);
    if (status == EBPO_OK)
        status = read_digest(r, model, "content_sha256", e->digest);
    if (status == EBPO_OK && e->surface)
        status = read_digest(r, model, "surface_sha256", e->surface_digest);
    if (status == EBPO_OK && !json_is_boolean(solid))
        return bad_model(r, "solid is not true or false");
    e->solid = json_is_true(solid);
    e->file_bytes = read_count(model, "bytes");
    e->face_count = read_count(model, "faces");
    e->vertex_count = read_count(model, "vertices");
    (void)read_rule(model, &e->rule);
    e->mesh = json_is_true(json_object_get(model, "mesh"));
    e->pruned = json_is_true(json_object_get(model, "pruned"));
    return status == EBPO_OK ? read_box(r, model, e) : status;
}

static ebpo_status read_models(reader *r, const json_t *root)
{
    const json_t *models = json_object_get(root, "models");
    ebpo_catalogue *c = r->c;
    ebpo_status status = EBPO_OK;
    uint64_t count = json_array_size(models);
    if (count == 0 || count >= UINT32_MAX)
        return bad_file(r, "\"models\" is not a list of at least one model");
    c->entry = ebpo_alloc_zero(count, sizeof *c->entry);
    if (!c->entry)
        return ebpo_fail_memory(r->error, count * sizeof *c->entry);
    c->count = count;
    for (; r->number < count && status == EBPO_OK; r->number++)
        status = read_entry(r, json_array_get(models, r->number), &c->entry[r->number]);
    return status;
}

/* --- reading: the whole file --- */

static ebpo_status read_root(reader *r, const json_t *root)
{
    ebpo_catalogue *c = r->c;
    const char *format = json_string_value(json_object_get(root, "format"));
    const json_t *version = json_object_get(root, "version"),
                 *parts = json_object_get(root, "parts");
    if (!format || strcmp(format, "ebpo-catalogue") != 0)
        return bad_file(r, "\"format\": \"ebpo-catalogue\" is missing");
    if (json_number_value(version) != 1)
        return ebpo_fail_file(r->error, EBPO_E_VERSION, c->path,
                              "unsupported catalogue version %g; this program reads version 1",
                              json_number_value(version));
    if (parts && !json_is_boolean(parts))
        return bad_file(r, "parts is not true or false");
    c->how.parts = json_is_true(parts);
    if (!read_rule(root, &c->how.rule))
        return bad_file(r, "rule is not nonzero, evenodd or positive");
    return read_models(r, root);
}

static ebpo_status parse_text(reader *r, const char *text, size_t size)
{
    json_error_t why;
    json_t *root = json_loadb(text, size, JSON_DECODE_INT_AS_REAL, &why);
    if (!root && json_error_code(&why) == json_error_out_of_memory)
        return ebpo_fail_memory(r->error, size);
    if (!root)
        return ebpo_fail_file(r->error, EBPO_E_FORMAT, r->c->path, "not a catalogue: line %d: %s",
                              why.line, why.text);
    ebpo_status status = read_root(r, root);
    json_decref(root);
    return status;
}

/* Sets *text to the file's content, which the caller frees, and c->file_bytes to its length. If the
 * file is a pipe, fails without waiting for a writer. */
static ebpo_status read_text(ebpo_catalogue *c, char **text, ebpo_error *error)
{
    struct stat st;
    int fd = open(c->path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    if (fd < 0)
        return ebpo_fail_errno(error, c->path, "cannot be read");
    ebpo_status status = EBPO_OK;
    if (fstat(fd, &st) != 0)
        status = ebpo_fail_errno(error, c->path, "cannot be read");
    else if (!S_ISREG(st.st_mode))
        status =
            ebpo_fail_file(error, EBPO_E_FORMAT, c->path, "cannot be read: not a regular file");
    FILE *in = status == EBPO_OK ? fdopen(fd, "r") : NULL;
    if (!in) {
        close(fd);
        return status == EBPO_OK ? ebpo_fail_memory(error, BUFSIZ) : status;
    }
    c->file_bytes = (uint64_t)st.st_size;
    *text = c->file_bytes <= MAX_BYTES ? malloc((size_t)c->file_bytes + 1) : NULL;
    if (c->file_bytes > MAX_BYTES)
        status = ebpo_fail_file(error, EBPO_E_LIMIT, c->path,
                                "too long for a catalogue: more than 1 GiB");
    else if (!*text)
        status = ebpo_fail_memory(error, c->file_bytes + 1);
    else if (fread(*text, 1, (size_t)c->file_bytes + 1, in) != c->file_bytes)
        status = ebpo_fail_file(error, EBPO_E_IO, c->path, "was changed while it was read");
    fclose(in);
    return status;
}

static ebpo_status read_file(ebpo_catalogue *c, const char *path, ebpo_error *error)
{
    char *text = NULL;
    const char *slash = ebpo_last_separator(path);
    reader r = { .c = c, .error = error };
    c->path = strdup(path);
    r.folder = slash ? strndup(path, (size_t)(slash - path) + 1) : strdup("");
    ebpo_status status = c->path && r.folder ? read_text(c, &text, error)
                                             : ebpo_fail_memory(error, strlen(path) + 1);
    if (status == EBPO_OK) {
        c->file_hash = ebpo_hash_bytes(EBPO_HASH_BYTES_BEGIN, text, (size_t)c->file_bytes);
        status = parse_text(&r, text, (size_t)c->file_bytes);
    }
    free(text);
    free(r.folder);
    return status;
}

ebpo_status ebpo_catalogue_open(const char *path, const ebpo_catalogue_options *options,
                                ebpo_catalogue **out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_catalogue *c;
    *out = NULL;
    ebpo_status status = begin_catalogue(options, &c, error);
    if (status != EBPO_OK)
        return status;
    c->how.folder = NULL;
    return end_making(c, read_file(c, path, error), out, error);
}
