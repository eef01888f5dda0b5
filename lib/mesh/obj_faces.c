/* The second pass: faces, and under which names they stand. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <string.h>

#include "core/error.h"
#include "mesh/obj_faces.h"

/* What the parts of a corner, v/vt/vn, behind the first are numbers of. */
static const import_sort sort_of[2] = { IMPORT_TEXTURE, IMPORT_NORMALS };

static ebpo_status fail_corner(const obj_reading *r, obj_word word)
{
    char text[IMPORT_WORD_TEXT];
    ebpo_import_word_text(text, word.s, word.n);
    return ebpo_obj_fail(r,
                         "a face has the corner '%s', but it takes v, v/vt, v//vn or v/vt/vn; "
                         "repair the file",
                         text);
}

/* [+-] digits, up to `end` or a slash. */
static bool read_number(const char **at, const char *end, int64_t *number)
{
    bool negative = *at < end && **at == '-';
    if (*at < end && (**at == '-' || **at == '+'))
        ++*at;
    const char *first = *at;
    for (*number = 0; *at < end && **at >= '0' && **at <= '9'; ++*at)
        if (*number < INT64_C(1) << 40)
            *number = 10 * *number + (**at - '0');
    *number = negative ? -*number : *number;
    return *at > first && (*at == end || **at == '/');
}

/* Numbers count from 1, or back from what stands before the face. */
static bool resolve(const obj_reading *r, import_sort sort, uint64_t total, int64_t number,
                    uint32_t *row)
{
    int64_t at = number > 0 ? number - 1 : (int64_t)r->rows[sort] + number;
    *row = (uint32_t)at;
    return number != 0 && at >= 0 && (uint64_t)at < total;
}

static ebpo_status fail_vertex(const obj_reading *r, int64_t number)
{
    if (number > 0)
        return ebpo_obj_fail(r,
                             "a face names vertex %" PRId64 ", but there are %" PRIu64
                             " vertices; repair the file or drop the face",
                             number, r->build->vertices);
    return number ? ebpo_obj_fail(r,
                                  "a face names vertex %" PRId64 ", but only %" PRIu64
                                  " stand before it; repair the file or drop the face",
                                  number, r->rows[IMPORT_COLOURS])
                  : ebpo_obj_fail(r, "a face names vertex 0, but they count from 1; repair the "
                                     "file");
}

static ebpo_status add_corner(obj_reading *r, const uint64_t total[IMPORT_SORTS], obj_word word)
{
    const char *at = word.s, *end = word.s + word.n;
    import_corner *c = ebpo_import_corner(r->build);
    int64_t number;
    if (!c)
        return ebpo_fail_memory(r->build->error, r->build->corners * sizeof *c);
    memset(c, 0xff, sizeof *c);
    if (!read_number(&at, end, &number))
        return fail_corner(r, word);
    if (!resolve(r, IMPORT_COLOURS, r->build->vertices, number, &c->vertex))
        return fail_vertex(r, number);
    c->row[IMPORT_COLOURS] = c->vertex;
    for (int i = 0; i < 2 && at < end; i++) {
        import_sort sort = sort_of[i];
        at++;
        if (at == end || *at == '/') /* not given */
            continue;
        if (!read_number(&at, end, &number))
            return fail_corner(r, word);
        if (!resolve(r, sort, total[sort], number, &c->row[sort])) {
            c->row[sort] = IMPORT_NONE;
            r->losses.absent[sort]++;
        }
    }
    return at == end ? EBPO_OK : fail_corner(r, word);
}

static ebpo_status read_face(obj_reading *r, const uint64_t total[IMPORT_SORTS])
{
    import_build *b = r->build;
    ebpo_mesh *mesh = b->mesh;
    uint64_t before = mesh->face_count;
    obj_word word;
    ebpo_status status = EBPO_OK;
    while (status == EBPO_OK && ebpo_obj_next_word(&r->text, &word))
        status = add_corner(r, total, word);
    if (status == EBPO_OK)
        status = ebpo_import_polygon(b);
    if (r->runs && status == EBPO_OK)
        r->runs->of[r->runs->count - 1].faces += mesh->face_count - before;
    return status;
}

/* Faces so far have the material so far. */
static ebpo_status use_material(obj_reading *r)
{
    import_build *b = r->build;
    obj_word name = ebpo_obj_name(&r->text);
    if (!b->attributes || !name.n)
        return EBPO_OK;
    ebpo_status status = ebpo_obj_give_material(&r->names, b->mesh, b->error);
    return status == EBPO_OK ? ebpo_obj_use_material(&r->names, name, b->error) : status;
}

static ebpo_status begin_run(obj_reading *r)
{
    obj_word name = ebpo_obj_name(&r->text);
    r->losses.groups |= name.n > 0;
    return r->runs ? ebpo_obj_runs_add(r->runs, name, r->build->name, r->build->error) : EBPO_OK;
}

/* Free-form geometry, points and lines; and what says how these are drawn, which no mesh needs. */
static bool is_curve(obj_word word)
{
    static const char *const words[] = { "p",    "l",    "vp",    "cstype", "deg",  "bmat",
                                         "step", "curv", "curv2", "surf",   "parm", "trim",
                                         "hole", "scrv", "sp",    "con",    "end",  "bzp",
                                         "cdc",  "cdp",  "res",   "bsp" };
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        if (ebpo_obj_word_is(word, words[i]))
            return true;
    return false;
}

static bool is_display(obj_word word)
{
    static const char *const words[] = { "mg",        "bevel",  "c_interp", "d_interp",
                                         "lod",       "usemap", "maplib",   "shadow_obj",
                                         "trace_obj", "ctech",  "stech",    "call" };
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        if (ebpo_obj_word_is(word, words[i]))
            return true;
    return false;
}

static void note_other(obj_reading *r, obj_word word)
{
    obj_losses *l = &r->losses;
    if (ebpo_obj_word_is(word, "mtllib")) {
        l->library |= ebpo_obj_name(&r->text).n > 0;
    } else if (ebpo_obj_word_is(word, "s")) {
        obj_word value = ebpo_obj_name(&r->text);
        l->smoothing |= value.n && !ebpo_obj_word_is(value, "off") && !ebpo_obj_word_is(value, "0");
    } else if (is_curve(word)) {
        l->curves++;
    } else if (!is_display(word)) {
        l->unknown_line = l->unknown++ ? l->unknown_line : r->line;
    }
}

static ebpo_status read_statement(obj_reading *r, const uint64_t total[IMPORT_SORTS], obj_word word)
{
    if (*word.s == 'v' && word.n <= 2) {
        char second = word.n == 2 ? word.s[1] : 0;
        if (!second || second == 'n' || second == 't') {
            r->rows[second == 'n' ? IMPORT_NORMALS : second ? IMPORT_TEXTURE : IMPORT_COLOURS]++;
            return EBPO_OK;
        }
    }
    if (ebpo_obj_word_is(word, "f") || ebpo_obj_word_is(word, "fo"))
        return read_face(r, total);
    if (ebpo_obj_word_is(word, "g") || ebpo_obj_word_is(word, "o"))
        return begin_run(r);
    if (ebpo_obj_word_is(word, "usemtl"))
        return use_material(r);
    note_other(r, word);
    return EBPO_OK;
}

ebpo_status ebpo_obj_read_faces(obj_reading *r)
{
    import_build *b = r->build;
    uint64_t total[IMPORT_SORTS];
    obj_word word;
    ebpo_status status =
        r->runs ? ebpo_obj_runs_add(r->runs, (obj_word){ "", 0 }, b->name, b->error) : EBPO_OK;
    memcpy(total, r->rows, sizeof total);
    memset(r->rows, 0, sizeof r->rows);
    r->text = ebpo_obj_text(r->data, r->size);
    r->next_release = 0;
    while (status == EBPO_OK && ebpo_obj_step(r, &word))
        status = read_statement(r, total, word);
    return status == EBPO_OK && r->names.count
               ? ebpo_obj_give_material(&r->names, b->mesh, b->error)
               : status;
}
