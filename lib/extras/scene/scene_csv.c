/* Poses from a file of lines: time, x, y, z, qx, qy, qz, qw, scale in any order, named by the first
 * line. */
#include "core/strict_fp.h"

#include <locale.h>
#include <string.h>

#include "core/error.h"
#include "io/file_source.h"
#include "geometry/decimal.h"
#include "extras/scene/scene_parts.h"

enum { COLUMNS = 9, NEEDED = 8, FIELDS_MOST = 64 };
static const char *const columns[COLUMNS] = {
    "time", "x", "y", "z", "qx", "qy", "qz", "qw", "scale"
};

typedef struct lines {
    const char *at, *end, *name;
    uint64_t line;
    int field[COLUMNS]; /* where each column stands; -1: not there */
    int fields;
    locale_t c_locale;
} lines;

typedef struct text {
    const char *at;
    size_t size;
} text;

static text trimmed(const char *from, const char *to)
{
    while (from < to && strchr(" \t\r", *from))
        from++;
    while (to > from && strchr(" \t\r", to[-1]))
        to--;
    return (text){ from, (size_t)(to - from) };
}

/* The next line that is not empty. */
static bool next_line(lines *l, text *out)
{
    while (l->at < l->end) {
        const char *end = memchr(l->at, '\n', (size_t)(l->end - l->at));
        end = end ? end : l->end;
        *out = trimmed(l->at, end);
        l->at = end < l->end ? end + 1 : end;
        l->line++;
        if (out->size)
            return true;
    }
    return false;
}

/* Commas or semicolons part fields; -1: too many. */
static int split(text line, text field[FIELDS_MOST])
{
    int count = 0;
    const char *at = line.at, *end = line.at + line.size;
    for (;;) {
        const char *stop = at;
        while (stop < end && *stop != ',' && *stop != ';')
            stop++;
        if (count == FIELDS_MOST)
            return -1;
        field[count++] = trimmed(at, stop);
        if (stop == end)
            return count;
        at = stop + 1;
    }
}

static ebpo_status bad(const lines *l, const char *what, ebpo_error *error)
{
    return ebpo_fail_file(error, EBPO_E_FORMAT, l->name, "line %llu: %s",
                          (unsigned long long)l->line, what);
}

static ebpo_status read_header(lines *l, ebpo_error *error)
{
    text line, field[FIELDS_MOST];
    for (int k = 0; k < COLUMNS; k++)
        l->field[k] = -1;
    if (!next_line(l, &line))
        return bad(l, "there are no poses", error);
    l->fields = split(line, field);
    for (int i = 0; i < l->fields; i++) {
        int k = 0;
        while (k < COLUMNS && (strlen(columns[k]) != field[i].size ||
                               memcmp(columns[k], field[i].at, field[i].size) != 0))
            k++;
        if (k == COLUMNS || l->field[k] >= 0)
            return bad(l, "each column is one of time, x, y, z, qx, qy, qz, qw, scale", error);
        l->field[k] = i;
    }
    for (int k = 0; k < NEEDED; k++)
        if (l->field[k] < 0)
            return bad(l, "the first line names columns time, x, y, z, qx, qy, qz, qw", error);
    return EBPO_OK;
}

static ebpo_status read_row(lines *l, text line, scene_route *route, ebpo_error *error)
{
    text field[FIELDS_MOST];
    double v[COLUMNS] = { [8] = 1 };
    if (split(line, field) != l->fields)
        return bad(l, "there are not as many numbers as columns", error);
    for (int k = 0; k < COLUMNS; k++)
        if (l->field[k] >= 0 &&
            !ebpo_number_double(&v[k], field[l->field[k]].at, field[l->field[k]].size, l->c_locale))
            return bad(l, "this is not a number in each column", error);
    scene_key key = {
        v[0],
        { v[4], v[5], v[6], v[7] },
        { v[1], v[2], v[3] },
        v[8],
    };
    ebpo_error why = EBPO_ERROR_INIT;
    ebpo_status status = scene_add_key(route, &key, &why);
    return status == EBPO_E_ARGUMENT ? bad(l, why.message, error)
           : status != EBPO_OK       ? ebpo_fail_with(error, &why)
                                     : EBPO_OK;
}

static ebpo_status read_rows(lines *l, scene_route *route, ebpo_error *error)
{
    text line;
    ebpo_status status = read_header(l, error);
    while (status == EBPO_OK && next_line(l, &line))
        status = read_row(l, line, route, error);
    if (status == EBPO_OK && !route->count)
        status = bad(l, "there are no poses", error);
    return status;
}

static ebpo_status read_text(const ebpo_whole_file *file, scene_route *route, const char *path,
                             ebpo_error *error)
{
    lines l = { (const char *)file->data,
                (const char *)file->data + file->size,
                path,
                0,
                { 0 },
                0,
                newlocale(LC_ALL_MASK, "C", (locale_t)0) };
    ebpo_status status;
    const char *foreign = ebpo_foreign_bytes(file->data, file->size);
    l.at += scene_text_mark(l.at, file->size);
    if (foreign)
        status = ebpo_fail_file(error, EBPO_E_FORMAT, path, "%s", foreign);
    else if (!l.c_locale)
        status = ebpo_fail_memory(error, 1);
    else
        status = read_rows(&l, route, error);
    if (l.c_locale)
        freelocale(l.c_locale);
    return status;
}

ebpo_status scene_read_csv(scene_route *route, const char *path, uint64_t *left, ebpo_error *error)
{
    ebpo_whole_file file = EBPO_WHOLE_FILE_INIT;
    ebpo_status status = ebpo_whole_file_open(&file, path, error);
    if (status == EBPO_OK && file.size > *left)
        status = ebpo_fail_file(error, EBPO_E_LIMIT, path,
                                "files of poses have more bytes than the limit that was given");
    if (status == EBPO_OK)
        status = ebpo_whole_file_load(&file, NULL, 1, NULL, path, error);
    if (status == EBPO_OK)
        status = read_text(&file, route, path, error);
    if (status == EBPO_OK)
        status = ebpo_whole_file_unchanged(&file, path, error);
    if (status == EBPO_OK)
        *left -= file.size;
    ebpo_whole_file_close(&file);
    return status;
}
