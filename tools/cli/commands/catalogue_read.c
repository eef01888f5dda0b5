#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cli/commands/catalogue.h"
#include "cli/words.h"

/* Some millions of models; more would be read into many times as much memory. */
enum { MOST_BYTES = 1 << 30 };

bool catalogue_is(const char *name)
{
    size_t length = strlen(name);
    return length > 5 && strcmp(name + length - 5, ".json") == 0 && !ebpo_is_url(name);
}

ebpo_status catalogue_fail(ebpo_error *error, ebpo_status status, const char *file,
                           const char *format, ...)
{
    va_list args;
    size_t at = 0;
    if (!error)
        return status;
    *error = (ebpo_error)EBPO_ERROR_INIT;
    error->status = status;
    if (file) {
        snprintf(error->file, sizeof error->file, "%s", file);
        at = (size_t)snprintf(error->message, sizeof error->message, "%.255s: ", file);
    }
    va_start(args, format);
    vsnprintf(error->message + at, sizeof error->message - at, format, args);
    va_end(args);
    return status;
}

/* --- values --- */

typedef struct reader {
    catalogue *c;
    char *folder;    /* with '/' behind it, or "" */
    uint64_t number; /* of the model that is read */
    ebpo_error *error;
} reader;

static ebpo_status fail_catalogue(const reader *r, const char *what)
{
    return catalogue_fail(r->error, EBPO_E_FORMAT, r->c->path,
                          "not a catalogue: models[%" PRIu64 "]: %s", r->number, what);
}

static ebpo_status no_memory(const reader *r)
{
    return catalogue_fail(r->error, EBPO_E_MEMORY, r->c->path, "not enough memory");
}

/* Seen from where the catalogue is; NULL: not enough memory. */
static char *path_of(const reader *r, const char *text)
{
    char *path;
    bool whole = *text == '/' || strstr(text, "://");
    return asprintf(&path, "%s%s", whole ? "" : r->folder, text) < 0 ? NULL : path;
}

/* *out: NULL where the member is not there, is null or empty. */
static ebpo_status read_path(const reader *r, const json_t *model, const char *key, char **out)
{
    const json_t *value = json_object_get(model, key);
    char what[64];
    if (!value || json_is_null(value) || (json_is_string(value) && !json_string_length(value)))
        return EBPO_OK;
    snprintf(what, sizeof what, "%s is no text", key);
    if (!json_is_string(value))
        return fail_catalogue(r, what);
    *out = path_of(r, json_string_value(value));
    return *out ? EBPO_OK : no_memory(r);
}

static ebpo_status read_digest(const reader *r, const json_t *model, const char *key,
                               char out[CATALOGUE_DIGEST + 1])
{
    const char *text = json_string_value(json_object_get(model, key));
    char what[128];
    if (text && strlen(text) == CATALOGUE_DIGEST &&
        strspn(text, "0123456789abcdef") == CATALOGUE_DIGEST) {
        memcpy(out, text, CATALOGUE_DIGEST + 1);
        return EBPO_OK;
    }
    snprintf(what, sizeof what,
             "%s is no digest, without which another file would be taken for the model", key);
    return fail_catalogue(r, what);
}

static bool read_corner(const json_t *model, const char *key, double out[3])
{
    const json_t *value = json_object_get(model, key);
    bool fine = json_array_size(value) == 3;
    for (size_t k = 0; fine && k < 3; k++) {
        const json_t *x = json_array_get(value, k);
        out[k] = json_number_value(x);
        fine = json_is_number(x) && isfinite(out[k]);
    }
    return fine;
}

static ebpo_status read_box(const reader *r, const json_t *model, catalogue_entry *e)
{
    if (!read_corner(model, "box_min", e->min) || !read_corner(model, "box_max", e->max))
        return fail_catalogue(r, "a box has two corners, box_min and box_max, of three numbers");
    for (int k = 0; k < 3; k++)
        if (e->min[k] > e->max[k])
            return fail_catalogue(r, "box_min is above box_max");
    return EBPO_OK;
}

/* --- models --- */

static ebpo_status read_paths(const reader *r, const json_t *model, catalogue_entry *e)
{
    ebpo_status status = read_path(r, model, "path", &e->path);
    if (status == EBPO_OK)
        status = read_path(r, model, "surface", &e->surface);
    if (status == EBPO_OK)
        status = read_path(r, model, "numbers", &e->numbers);
    if (status == EBPO_OK && !e->path)
        return fail_catalogue(r, "has no path");
    e->unseen = json_is_null(json_object_get(model, "surface"));
    return status;
}

static ebpo_status read_entry(const reader *r, const json_t *model, catalogue_entry *e)
{
    const json_t *solid = json_object_get(model, "solid");
    if (!json_is_object(model))
        return fail_catalogue(r, "a model is an object");
    ebpo_status status = read_paths(r, model, e);
    if (status == EBPO_OK)
        status = read_digest(r, model, "content_sha256", e->digest);
    if (status == EBPO_OK && e->surface)
        status = read_digest(r, model, "surface_sha256", e->surface_digest);
    if (status == EBPO_OK && !json_is_boolean(solid))
        return fail_catalogue(r, "solid is true or false");
    e->solid = json_is_true(solid);
    return status == EBPO_OK ? read_box(r, model, e) : status;
}

static ebpo_status read_models(reader *r, const json_t *root)
{
    const json_t *models = json_object_get(root, "models");
    catalogue *c = r->c;
    ebpo_status status = EBPO_OK;
    c->count = json_array_size(models);
    if (c->count == 0 || c->count >= UINT32_MAX)
        return catalogue_fail(r->error, EBPO_E_FORMAT, c->path,
                              "not a catalogue: \"models\" is a list of one model at least");
    c->entry = calloc(c->count, sizeof *c->entry);
    if (!c->entry)
        return no_memory(r);
    for (; r->number < c->count && status == EBPO_OK; r->number++)
        status = read_entry(r, json_array_get(models, r->number), &c->entry[r->number]);
    return status;
}

/* --- the whole --- */

static bool read_rule(catalogue *c, const json_t *root)
{
    const json_t *rule = json_object_get(root, "rule");
    bool found = !rule;
    c->rule = EBPO_RULE_NONZERO;
    for (int i = 0; json_is_string(rule) && rule_words[i]; i++)
        if (strcmp(rule_words[i], json_string_value(rule)) == 0) {
            c->rule = (ebpo_rule)i;
            found = true;
        }
    return found;
}

static ebpo_status read_root(reader *r, const json_t *root)
{
    catalogue *c = r->c;
    const char *format = json_string_value(json_object_get(root, "format"));
    const json_t *version = json_object_get(root, "version"),
                 *parts = json_object_get(root, "parts");
    if (!format || strcmp(format, "ebpo-catalogue") != 0)
        return catalogue_fail(r->error, EBPO_E_FORMAT, c->path,
                              "not a catalogue: there is no \"format\": \"ebpo-catalogue\"");
    if (json_number_value(version) != 1)
        return catalogue_fail(r->error, EBPO_E_VERSION, c->path,
                              "a catalogue of version %g; this program reads 1",
                              json_number_value(version));
    if (parts && !json_is_boolean(parts))
        return catalogue_fail(r->error, EBPO_E_FORMAT, c->path,
                              "not a catalogue: parts is true or false");
    c->parts = json_is_true(parts);
    if (!read_rule(c, root))
        return catalogue_fail(r->error, EBPO_E_FORMAT, c->path,
                              "not a catalogue: rule is nonzero, evenodd or positive");
    return read_models(r, root);
}

static ebpo_status parse_catalogue(reader *r, const char *text, size_t size)
{
    json_error_t why;
    json_t *root = json_loadb(text, size, JSON_DECODE_INT_AS_REAL, &why);
    if (!root)
        return catalogue_fail(r->error, EBPO_E_FORMAT, r->c->path, "not a catalogue: line %d: %s",
                              why.line, why.text);
    ebpo_status status = read_root(r, root);
    json_decref(root);
    return status;
}

static uint64_t fnv1a(const char *text, size_t size)
{
    uint64_t hash = 0xcbf29ce484222325;
    for (size_t i = 0; i < size; i++)
        hash = (hash ^ (unsigned char)text[i]) * 0x100000001b3;
    return hash;
}

static ebpo_status read_text(catalogue *c, char **text, ebpo_error *error)
{
    struct stat st;
    int fd = open(c->path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY); /* pipes are not read */
    bool fine = fd >= 0 && fstat(fd, &st) == 0 && S_ISREG(st.st_mode);
    FILE *in = fine ? fdopen(fd, "r") : NULL;
    if (!in) {
        const char *why = fd < 0 || fine ? strerror(errno) : "is no file";
        if (fd >= 0)
            close(fd);
        return catalogue_fail(error, EBPO_E_IO, c->path, "cannot be read: %s", why);
    }
    ebpo_status status = EBPO_OK;
    c->bytes = (uint64_t)st.st_size;
    *text = c->bytes <= MOST_BYTES ? malloc((size_t)c->bytes + 1) : NULL;
    if (c->bytes > MOST_BYTES)
        status = catalogue_fail(error, EBPO_E_LIMIT, c->path,
                                "too long for a catalogue: more than 1 GiB");
    else if (!*text)
        status = catalogue_fail(error, EBPO_E_MEMORY, c->path, "not enough memory");
    else if (fread(*text, 1, (size_t)c->bytes + 1, in) != c->bytes)
        status = catalogue_fail(error, EBPO_E_IO, c->path, "was changed while it was read");
    fclose(in);
    return status;
}

ebpo_status catalogue_read(const char *path, catalogue **out, ebpo_error *error)
{
    char *text = NULL;
    const char *slash = strrchr(path, '/');
    catalogue *c = calloc(1, sizeof *c);
    reader r = { .c = c, .error = error };
    *out = NULL;
    if (c)
        c->path = strdup(path);
    r.folder = slash ? strndup(path, (size_t)(slash - path) + 1) : strdup("");
    ebpo_status status = c && c->path && r.folder
                             ? read_text(c, &text, error)
                             : catalogue_fail(error, EBPO_E_MEMORY, path, "not enough memory");
    if (status == EBPO_OK) {
        c->hash = fnv1a(text, (size_t)c->bytes);
        status = parse_catalogue(&r, text, (size_t)c->bytes);
    }
    free(text);
    free(r.folder);
    if (status == EBPO_OK)
        *out = c;
    else
        catalogue_free(c);
    return status;
}

void catalogue_free(catalogue *c)
{
    for (uint64_t i = 0; c && c->entry && i < c->count; i++) {
        free(c->entry[i].path);
        free(c->entry[i].surface);
        free(c->entry[i].numbers);
    }
    if (c) {
        free(c->entry);
        free(c->path);
    }
    free(c);
}
