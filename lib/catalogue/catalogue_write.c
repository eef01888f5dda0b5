/* Writes catalogues as JSON files for ebpo_catalogue_open. When ebpo_catalogue_open reads the file,
 * it gets the same boxes, bit for bit, and the same counts, if the counts are below 2^53. If
 * `file_bytes` of an entry is 0, the entry is written without counts.
 *
 * Paths that begin with the folder of the file become relative to this folder, so that a folder of
 * models and its catalogue can be moved together. A path that would have another meaning without
 * the folder is not changed. Numbers are written with the fewest digits from which the same double
 * is read. The result does not depend on the locale. JSON cannot represent a path that is not
 * UTF-8, so such a path is an error, and nothing is written. The file is replaced atomically
 * (io/publish.h).
 *
 * Source: docs/guide/clusters.md has the format. */
#include "core/strict_fp.h"

#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "catalogue/catalogue_in.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/os.h"
#include "core/text.h"
#include "io/publish.h"

static void write_text(FILE *to, const char *text)
{
    fputc('"', to);
    for (const unsigned char *s = (const unsigned char *)text; *s; s++)
        if (*s == '"' || *s == '\\')
            fprintf(to, "\\%c", *s);
        else if (*s < 0x20 || *s == 0x7f)
            fprintf(to, "\\u%04x", *s);
        else
            fputc(*s, to);
    fputc('"', to);
}

/* Finds the fewest decimal digits of |x| from which the same double is read. The result does not
 * depend on the locale. Returns the number of digits. Sets `digits` to them, and *exponent to the
 * power of ten of the first digit. */
static int fewest_digits(double x, char digits[20], int *exponent)
{
    char text[40];
    int count = 0;
    for (int decimals = fabs(x) < DBL_MIN ? 0 : 14; decimals <= 16; decimals++) {
        snprintf(text, sizeof text, "%.*e", decimals, fabs(x));
        if (strtod(text, NULL) == fabs(x))
            break;
    }
    const char *at = text;
    for (; *at && *at != 'e'; at++)
        if (*at >= '0' && *at <= '9' && count < 20)
            digits[count++] = *at;
    while (count > 1 && digits[count - 1] == '0')
        count--;
    *exponent = *at ? atoi(at + 1) : 0;
    return count;
}

/* Writes a number as printf does with %.17g, but with the fewest digits. */
static void write_number(FILE *to, double x)
{
    char digits[20];
    int exponent, count = fewest_digits(x, digits, &exponent);
    fputs(signbit(x) ? "-" : "", to);
    if (exponent < -4 || exponent > 16) {
        fprintf(to, "%c%s%.*se%c%02d", digits[0], count > 1 ? "." : "", count - 1, digits + 1,
                exponent < 0 ? '-' : '+', abs(exponent));
        return;
    }
    for (int place = exponent < 0 ? 0 : exponent; place > exponent - count || place >= 0; place--) {
        int i = exponent - place;
        fputs(place == -1 ? "." : "", to);
        fputc(i >= 0 && i < count ? digits[i] : '0', to);
    }
}

static void write_corner(FILE *to, const char *key, const double x[3])
{
    fprintf(to, ",\n      \"%s\": [", key);
    for (int k = 0; k < 3; k++) {
        fputs(k ? ", " : "", to);
        write_number(to, x[k]);
    }
    fputc(']', to);
}

static void write_digest(FILE *to, const char *key, const uint8_t digest[32])
{
    fprintf(to, ",\n      \"%s\": \"", key);
    for (int i = 0; i < 32; i++)
        fprintf(to, "%02x", digest[i]);
    fputc('"', to);
}

/* Writes a member with a path. `folder` is "" or ends in '/'. If the path begins with `folder` and
 * the rest is a relative path, writes only the rest. `before`: text before the member. */
static void write_path(FILE *to, const char *before, const char *key, const char *path,
                       const char *folder)
{
    size_t length = strlen(folder);
    bool in_folder = length && strncmp(path, folder, length) == 0 && path[length] != '/' &&
                     path[length] && !strstr(path + length, "://");
    fprintf(to, "%s\n      \"%s\": ", before, key);
    write_text(to, path + (in_folder ? length : 0));
}

static void write_flag(FILE *to, const char *key, bool value)
{
    fprintf(to, ",\n      \"%s\": %s", key, value ? "true" : "false");
}

static void write_entry(FILE *to, const ebpo_catalogue_entry *e, const char *folder)
{
    bool has_counts = e->file_bytes > 0;
    write_path(to, "", "path", e->path, folder);
    if (has_counts)
        fprintf(to, ",\n      \"bytes\": %" PRIu64, e->file_bytes);
    write_digest(to, "content_sha256", e->digest);
    if (has_counts)
        fprintf(to, ",\n      \"faces\": %" PRIu64 ",\n      \"vertices\": %" PRIu64, e->face_count,
                e->vertex_count);
    write_flag(to, "solid", e->solid);
    if (has_counts) {
        fprintf(to, ",\n      \"rule\": \"%s\"", ebpo_catalogue_rules[e->rule]);
        write_flag(to, "mesh", e->mesh);
        write_flag(to, "pruned", e->pruned);
    }
    write_corner(to, "box_min", e->min);
    write_corner(to, "box_max", e->max);
    if (e->only_caps)
        fputs(",\n      \"surface\": null", to);
    if (e->surface) {
        write_path(to, ",", "surface", e->surface, folder);
        write_digest(to, "surface_sha256", e->surface_digest);
    }
    if (e->numbers)
        write_path(to, ",", "numbers", e->numbers, folder);
}

static void write_all(const ebpo_catalogue *c, FILE *to, const char *folder)
{
    fputs("{\n  \"format\": \"ebpo-catalogue\",\n  \"version\": 1,\n", to);
    if (c->how.parts)
        fprintf(to, "  \"parts\": true,\n  \"rule\": \"%s\",\n", ebpo_catalogue_rules[c->how.rule]);
    fputs("  \"models\": [", to);
    for (uint64_t i = 0; i < c->count; i++) {
        fputs(i ? ",\n    {" : "\n    {", to);
        write_entry(to, &c->entry[i], folder);
        fputs("\n    }", to);
    }
    fputs("\n  ]\n}\n", to);
}

static ebpo_status check_text(uint64_t number, const char *text, ebpo_error *error)
{
    return !text || ebpo_text_is_utf8(text)
               ? EBPO_OK
               : ebpo_fail(error, EBPO_E_ARGUMENT,
                           "entry %" PRIu64 " has a path that is not UTF-8, which JSON requires; "
                           "rename the file",
                           number);
}

static ebpo_status check_texts(const ebpo_catalogue *c, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < c->count && status == EBPO_OK; i++) {
        status = check_text(i, c->entry[i].path, error);
        if (status == EBPO_OK)
            status = check_text(i, c->entry[i].surface, error);
        if (status == EBPO_OK)
            status = check_text(i, c->entry[i].numbers, error);
    }
    return status;
}

ebpo_status ebpo_catalogue_save(const ebpo_catalogue *c, const char *path, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_publish out = EBPO_PUBLISH_INIT;
    const char *slash = ebpo_last_separator(path);
    char *folder = slash ? strndup(path, (size_t)(slash - path) + 1) : strdup("");
    ebpo_status status = folder ? check_texts(c, error) : ebpo_fail_memory(error, strlen(path) + 1);
    if (status == EBPO_OK)
        status = ebpo_publish_begin(&out, path, error);
    FILE *to = status == EBPO_OK ? ebpo_publish_stream(&out) : NULL;
    if (status == EBPO_OK && !to)
        status = ebpo_fail_memory(error, BUFSIZ);
    if (status == EBPO_OK) {
        write_all(c, to, folder);
        status = ebpo_publish_commit(&out, error);
    }
    ebpo_publish_abort(&out);
    free(folder);
    return status;
}
