#include "import/obj_runs.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"

static const char mark[] = "g run_";

/* "g run_4294967295\n" */
enum { MARK_SIZE = 17, RUNS_MOST = 100000000 };

/* A statement, its end without; statements go on behind a backslash. */
typedef struct statement {
    uint64_t begin, end;
    bool backslash;
} statement;

typedef struct scanning {
    const char *data;
    uint64_t size;
    const char *name;
    ebpo_obj_runs *out; /* filled in the second time; the first time only counted */
    bool counting;
} scanning;

/* As assimp ends lines. */
static bool ends_line(char c) { return c == '\n' || c == '\r' || c == '\0' || c == '\f'; }

/* As assimp reads them, to the character: a backslash anywhere joins the next line, up to the line
 * feed of which nothing is read. */
static bool next_statement(const scanning *s, uint64_t at, statement *out)
{
    bool joins = false;
    *out = (statement){ .begin = at };
    if (at >= s->size)
        return false;
    for (; at < s->size; at++) {
        if (s->data[at] == '\\') {
            joins = out->backslash = true;
            at++;
        }
        if (at >= s->size || !ends_line(s->data[at]))
            continue;
        if (!joins)
            break;
        while (at < s->size && s->data[at] != '\n')
            at++;
        at++; /* what comes next is no end, whatever it is */
        joins = false;
    }
    out->end = at < s->size ? at : s->size;
    return true;
}

static bool is_space(char c) { return c == ' ' || c == '\t'; }

/* Cuts off spaces on both sides. */
static ebpo_named_run name_of(const char *begin, const char *end)
{
    while (begin < end && is_space(*begin))
        begin++;
    while (end > begin && is_space(end[-1]))
        end--;
    return (ebpo_named_run){ .name = begin, .size = (size_t)(end - begin) };
}

static bool begins_run(const scanning *s, const statement *t)
{
    char first = s->data[t->begin];
    return t->end > t->begin && (first == 'g' || first == 'o') &&
           (t->end == t->begin + 1 || is_space(s->data[t->begin + 1]));
}

static uint64_t line_of(const scanning *s, uint64_t at)
{
    uint64_t line = 1;
    for (uint64_t i = 0; i < at; i++)
        line += s->data[i] == '\n';
    return line;
}

static ebpo_status check(const scanning *s, const statement *t, ebpo_error *error)
{
    static const char free_form[] = "cstype";
    if (begins_run(s, t) && t->backslash)
        return ebpo_fail_file(error, EBPO_E_UNSUPPORTED, s->name,
                              "line %" PRIu64
                              ": there is a backslash in the name of a group, and assimp takes the "
                              "next line for a part of it; give it another name",
                              line_of(s, t->begin));
    if (t->end - t->begin >= sizeof free_form - 1 &&
        memcmp(s->data + t->begin, free_form, sizeof free_form - 1) == 0)
        return ebpo_fail_file(error, EBPO_E_UNSUPPORTED, s->name,
                              "line %" PRIu64
                              ": groups of files with free-form curves or surfaces are not read; "
                              "leave these out",
                              line_of(s, t->begin));
    if (s->out->count >= RUNS_MOST || s->out->text_size > UINT32_MAX)
        return ebpo_fail_file(error, EBPO_E_LIMIT, s->name,
                              "has more than %d lines that name groups, or too many for its size",
                              RUNS_MOST);
    return EBPO_OK;
}

static void put_text(const scanning *s, uint64_t begin, uint64_t end)
{
    if (!s->counting)
        memcpy(s->out->text + s->out->text_size, s->data + begin, end - begin);
    s->out->text_size += end - begin;
}

static void put_run(const scanning *s, ebpo_named_run run)
{
    ebpo_obj_runs *out = s->out;
    if (!s->counting) {
        char line[MARK_SIZE + 1];
        snprintf(line, sizeof line, "%s%010" PRIu64 "\n", mark, out->count);
        memcpy(out->text + out->text_size, line, MARK_SIZE);
        out->of[out->count] = run;
    }
    out->text_size += MARK_SIZE;
    out->count++;
}

/* A mark of the order of bytes is no part of the first line. */
static uint64_t first_byte(const scanning *s)
{
    return s->size >= 3 && memcmp(s->data, "\xef\xbb\xbf", 3) == 0 ? 3 : 0;
}

static ebpo_status scan(const scanning *s, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    uint64_t at = first_byte(s), copied = at;
    statement t;
    s->out->count = s->out->text_size = 0;
    put_run(s, (ebpo_named_run){ .name = "" });
    for (; status == EBPO_OK && next_statement(s, at, &t); at = t.end + 1) {
        status = check(s, &t, error);
        if (status != EBPO_OK || !begins_run(s, &t))
            continue;
        put_text(s, copied, t.begin);
        put_run(s, name_of(s->data + t.begin + 1, s->data + t.end));
        copied = t.end < s->size ? t.end + 1 : s->size;
    }
    if (status == EBPO_OK)
        put_text(s, copied, s->size);
    return status;
}

ebpo_status ebpo_obj_runs_find(ebpo_obj_runs *out, const uint8_t *data, uint64_t size,
                               const char *name, ebpo_error *error)
{
    scanning s = { (const char *)data, size, name, out, true };
    *out = (ebpo_obj_runs){ 0 };
    ebpo_status status = scan(&s, error);
    if (status != EBPO_OK)
        return status;
    out->of = ebpo_alloc(out->count, sizeof *out->of);
    out->text = ebpo_alloc(out->text_size, 1);
    s.counting = false;
    status = out->of && out->text
                 ? scan(&s, error)
                 : ebpo_fail_memory(error, out->count * sizeof *out->of + out->text_size);
    if (status != EBPO_OK)
        ebpo_obj_runs_free(out);
    return status;
}

bool ebpo_obj_run_number(const ebpo_obj_runs *runs, const char *object, uint64_t *number)
{
    size_t lead = sizeof mark - 1 - 2; /* without "g " */
    if (strncmp(object, mark + 2, lead) != 0 || strlen(object) != lead + 10)
        return false;
    *number = 0;
    for (const char *c = object + lead; *c; c++) {
        if (*c < '0' || *c > '9')
            return false;
        *number = 10 * *number + (uint64_t)(*c - '0');
    }
    return *number < runs->count;
}

void ebpo_obj_runs_free(ebpo_obj_runs *runs)
{
    free(runs->of);
    free(runs->text);
    *runs = (ebpo_obj_runs){ 0 };
}

ebpo_status ebpo_fail_no_runs(const char *name, ebpo_error *error)
{
    return ebpo_fail_file(error, EBPO_E_UNSUPPORTED, name,
                          "which faces are in which group cannot be told, as assimp reads them in "
                          "another order; name each object once, with `g` instead of `o`");
}
