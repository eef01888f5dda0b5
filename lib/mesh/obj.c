/* Reads OBJ files in two passes. The first pass reads vertices, normals and texture coordinates;
 * the second pass reads faces. A corner of a face refers to its values by indices, which may be
 * negative (counted back from the latest value). Materials become an attribute of faces, and named
 * groups become runs of faces. Curves, lines and points are counted and reported.
 *
 * Source: "Object Files (.obj)", appendix B1 of Wavefront's Advanced Visualizer manual, 3.0. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/hash.h"
#include "core/text.h"
#include "core/workspace.h"
#include "geometry/decimal.h"
#include "mesh/attributes.h"
#include "mesh/import_build.h"
#include "mesh/obj.h"

/* Counts of data in the file that the mesh cannot store. */
typedef struct obj_losses {
    /* number of vertices whose coordinates were divided by a weight w, and number of vertices with
     * extra values */
    uint64_t weights, surplus;
    /* numbers of curve statements and of unknown statements, and the line of the first unknown
     * statement */
    uint64_t curves, unknown, unknown_line;
    uint64_t absent[EBPO_IMPORT_SORTS]; /* number of corners that refer to missing values */
    /* numbers of vertices without colour, of vertices with opacity, and of values that are no
     * numbers */
    uint64_t uncoloured, alpha, no_numbers;
    /* the file has: a third texture coordinate, smoothing groups, a material library, named groups
     */
    bool third, smoothing, library, groups;
} obj_losses;

typedef struct obj_reading {
    ebpo_import_build *build;
    const uint8_t *data;
    uint64_t size;
    ebpo_obj_text text;
    uint64_t next_release;            /* offset at which pages are released again */
    uint64_t line;                    /* line where the statement begins */
    uint64_t rows[EBPO_IMPORT_SORTS]; /* numbers of vertices, normals and texture coordinates that
                                         the current pass has read */
    ebpo_import_runs *runs;           /* NULL if not requested */
    obj_losses losses;
    ebpo_obj_names names;
} obj_reading;

static bool ends_line(char c) { return c == '\n' || c == '\r'; }

static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\v' || c == '\f'; }

ebpo_obj_text ebpo_obj_text_begin(const uint8_t *data, uint64_t size)
{
    return (ebpo_obj_text){ (const char *)data + ebpo_text_bom_length(data, size),
                            (const char *)data + size, 1, false };
}

/* Characters at which a word may end. */
static const bool may_end[256] = { [' '] = true,  ['\t'] = true, ['\v'] = true, ['\f'] = true,
                                   ['\n'] = true, ['\r'] = true, ['\\'] = true };

/* Returns the position after the end of a line. */
static const char *past_end(const char *at, const char *end)
{
    if (end - at > 1 && at[0] == '\r' && at[1] == '\n')
        return at + 2;
    return at < end ? at + 1 : at;
}

/* Returns the end of the line if a backslash at `at` joins it with the next line, otherwise NULL.
 */
static const char *joined_end(const char *at, const char *end)
{
    if (*at != '\\')
        return NULL;
    for (at++; at < end && is_blank(*at);)
        at++;
    return at < end && ends_line(*at) ? at : NULL;
}

static void skip_blanks(ebpo_obj_text *t)
{
    const char *joined;
    while (t->at < t->end) {
        if (is_blank(*t->at)) {
            t->at++;
        } else if ((joined = joined_end(t->at, t->end))) {
            t->at = past_end(joined, t->end);
            t->line++;
        } else {
            return;
        }
    }
}

bool ebpo_obj_next_word(ebpo_obj_text *t, ebpo_obj_word *word)
{
    skip_blanks(t);
    const char *s = t->at;
    if (s == t->end || ends_line(*s) || *s == '#')
        return false;
    const char *at = s;
    while (at < t->end && (!may_end[(uint8_t)*at] || (*at == '\\' && !joined_end(at, t->end))))
        at++;
    t->at = at;
    *word = (ebpo_obj_word){ s, (size_t)(at - s) };
    return true;
}

static void skip_line(ebpo_obj_text *t)
{
    while (t->at < t->end && !ends_line(*t->at))
        t->at++;
}

ebpo_obj_word ebpo_obj_name(ebpo_obj_text *t)
{
    while (t->at < t->end && is_blank(*t->at))
        t->at++;
    const char *s = t->at, *stop;
    skip_line(t);
    for (stop = t->at; stop > s && is_blank(stop[-1]);)
        stop--;
    return (ebpo_obj_word){ s, (size_t)(stop - s) };
}

bool ebpo_obj_next_statement(ebpo_obj_text *t, ebpo_obj_word *word)
{
    bool begun = t->begun;
    t->begun = true;
    while (ebpo_obj_next_word(t, word))
        if (!begun)
            return true;
    for (;;) {
        skip_line(t);
        if (t->at == t->end)
            return false;
        t->at = past_end(t->at, t->end);
        t->line++;
        if (ebpo_obj_next_word(t, word))
            return true;
    }
}

bool ebpo_obj_word_is(ebpo_obj_word word, const char *text)
{
    return word.n == strlen(text) && memcmp(word.s, text, word.n) == 0;
}

/* Limits for untrusted files: numbers of group statements and of material names. */
enum { RUNS_MAX = 100000000, MATERIALS_MAX = 10000000 };

ebpo_status ebpo_obj_runs_add(ebpo_import_runs *runs, ebpo_obj_word run, const char *name,
                              ebpo_error *error)
{
    if (runs->count == RUNS_MAX)
        return ebpo_fail_file(error, EBPO_E_LIMIT, name,
                              "has more than %d group statements; remove some", RUNS_MAX);
    if (!ebpo_grow(&runs->run, &runs->capacity, runs->count + 1, sizeof *runs->run))
        return ebpo_fail_memory(error, (runs->count + 1) * sizeof *runs->run);
    runs->run[runs->count++] = (ebpo_named_run){ .name = run.s, .size = run.n };
    return EBPO_OK;
}

/* --- materials --- */

static uint64_t hash_of(ebpo_obj_word word)
{
    uint64_t hash = word.n;
    for (size_t i = 0; i < word.n; i++)
        hash = hash * 31 + (uint8_t)word.s[i];
    return ebpo_hash_number(hash);
}

static bool same_word(ebpo_obj_word a, ebpo_obj_word b)
{
    return a.n == b.n && memcmp(a.s, b.s, a.n) == 0;
}

/* Returns the slot of the name's index, or the free slot in which it belongs. 0 marks a free slot,
 * because index 0 (faces without a named material) is not in the table. */
static uint64_t find_slot(const ebpo_obj_names *names, ebpo_obj_word word)
{
    uint64_t at;
    EBPO_HASH_FIND(at, hash_of(word), names->slots - 1,
                   !names->slot[at] || same_word(names->material[names->slot[at]], word));
    return at;
}

static bool grow_table(ebpo_obj_names *names)
{
    uint64_t slots = ebpo_hash_slots(4 * (names->count + 1));
    uint32_t *slot = ebpo_alloc_zero(slots, sizeof *slot);
    if (!slot)
        return false;
    free(names->slot);
    names->slot = slot;
    names->slots = slots;
    for (uint64_t i = 1; i < names->count; i++)
        slot[find_slot(names, names->material[i])] = (uint32_t)i;
    return true;
}

ebpo_status ebpo_obj_use_material(ebpo_obj_names *names, ebpo_obj_word material, ebpo_error *error)
{
    if (names->count >= MATERIALS_MAX)
        return ebpo_fail(error, EBPO_E_LIMIT, "there are more than %d material names",
                         MATERIALS_MAX);
    uint64_t need = names->count ? names->count + 1 : 2;
    if (!ebpo_grow(&names->material, &names->capacity, need, sizeof *names->material) ||
        (2 * need > names->slots && !grow_table(names)))
        return ebpo_fail_memory(error, need * sizeof *names->material);
    if (!names->count)
        names->material[names->count++] = (ebpo_obj_word){ "DefaultMaterial", 15 };
    uint64_t at = find_slot(names, material);
    if (!names->slot[at]) {
        names->material[names->count] = material;
        names->slot[at] = (uint32_t)names->count++;
    }
    names->current = names->slot[at];
    return EBPO_OK;
}

ebpo_status ebpo_obj_give_material(ebpo_obj_names *names, const ebpo_mesh *mesh, ebpo_error *error)
{
    if (!ebpo_array_grow(mesh->workspace, &names->of_face, &names->face_capacity, mesh->face_count,
                         sizeof *names->of_face))
        return ebpo_workspace_fail(mesh->workspace, mesh->face_count * sizeof *names->of_face,
                                   error);
    while (names->faces < mesh->face_count)
        names->of_face[names->faces++] = names->current;
    return EBPO_OK;
}

static void print_names(FILE *out, const ebpo_obj_names *names)
{
    for (uint64_t i = 0; i < names->count; i++) {
        fprintf(out, "comment material %llu ", (unsigned long long)i);
        for (size_t k = 0; k < names->material[i].n; k++) {
            char c = names->material[i].s[k];
            fputc((unsigned char)c < ' ' || c == 127 ? '?' : c, out);
        }
        fputc('\n', out);
    }
}

static void print_properties(FILE *out, const ebpo_attributes *attributes, const char *element)
{
    for (uint64_t i = 0; i < attributes->count; i++) {
        const ebpo_attribute *a = &attributes->array[i];
        const char *type = a->type == EBPO_ATTRIBUTE_FLOAT32 ? "float" : "uint";
        const char *name = a->names;
        if (!ebpo_attribute_is_of(a, element))
            continue;
        if (a->list != EBPO_ATTRIBUTE_NO_LIST)
            fprintf(out, "property list uchar %s %s\n", type, name);
        else
            for (size_t n; (n = strcspn(name, " ")) > 0; name += n + (name[n] == ' '))
                fprintf(out, "property %s %.*s\n", type, (int)n, name);
    }
}

/* Stores the material names as comments of a PLY header, which a later export as PLY writes. */
static ebpo_status make_header(const ebpo_mesh *mesh, const ebpo_obj_names *names,
                               ebpo_error *error)
{
    ebpo_attributes *attributes = mesh->attributes;
    const char *type = mesh->xyz64 ? "double" : "float";
    ebpo_text_stream text;
    if (!ebpo_text_stream_begin(&text))
        return ebpo_fail_memory(error, BUFSIZ);
    FILE *out = text.file;
    fputs("ply\nformat binary_little_endian 1.0\n", out);
    print_names(out, names);
    fprintf(out, "element vertex 0\nproperty %s x\nproperty %s y\nproperty %s z\n", type, type,
            type);
    print_properties(out, attributes, "vertex");
    fputs("element face 0\nproperty list uchar int vertex_indices\n", out);
    print_properties(out, attributes, "face");
    fputs("end_header\n", out);
    if (!ebpo_text_stream_end(&text))
        return ebpo_fail_memory(error, text.bytes);
    if (text.bytes > EBPO_ATTRIBUTE_HEADER) {
        free(text.text);
        ebpo_attributes_lose(attributes, "material names (more than 1 MiB)");
        return EBPO_OK;
    }
    attributes->header = text.text;
    attributes->header_bytes = text.bytes;
    return EBPO_OK;
}

ebpo_status ebpo_obj_keep_materials(ebpo_obj_names *names, ebpo_mesh *mesh, ebpo_error *error)
{
    ebpo_attribute head = { .element = "face", .names = "material", .columns = 1 };
    if (!names->count)
        return EBPO_OK;
    head.type = EBPO_ATTRIBUTE_UINT32;
    head.list = EBPO_ATTRIBUTE_NO_LIST;
    head.rows = mesh->face_count;
    ebpo_attribute *a = ebpo_attributes_add(mesh->attributes, &head);
    if (!a)
        return ebpo_fail_memory(error, sizeof *a);
    a->values = ebpo_array_alloc(mesh->workspace, mesh->face_count, sizeof *names->of_face);
    if (!a->values)
        return ebpo_workspace_fail(mesh->workspace, mesh->face_count * sizeof *names->of_face,
                                   error);
    ebpo_array_copy(mesh->workspace, a->values, names->of_face,
                    mesh->face_count * sizeof *names->of_face);
    return make_header(mesh, names, error);
}

void ebpo_obj_names_free(ebpo_obj_names *names, ebpo_workspace *workspace)
{
    free(names->material);
    free(names->slot);
    ebpo_array_free(workspace, names->of_face);
}

enum { RELEASE = 1 << 22 }; /* bytes between two releases of pages */

/* Returns EBPO_E_FORMAT with the line of the statement. */
EBPO_PRINTF(2, 3)
static ebpo_status fail_statement(const obj_reading *r, const char *format, ...)
{
    char text[320];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    return ebpo_fail_file(r->build->error, EBPO_E_FORMAT, r->build->name, "line %" PRIu64 ": %s",
                          r->line, text);
}

/* Reads the first word of the next statement, and releases pages after each RELEASE bytes. Returns
 * false at the end of the file. */
static bool step_to_statement(obj_reading *r, ebpo_obj_word *word)
{
    uint64_t at = (uint64_t)(r->text.at - (const char *)r->data);
    if (at >= r->next_release) {
        ebpo_release_pages(r->build->mesh->workspace);
        r->next_release = at + RELEASE;
    }
    bool more = ebpo_obj_next_statement(&r->text, word);
    r->line = r->text.line;
    return more;
}

/* Returns true for statements whose rest is a name (ebpo_obj_name). Both passes must read these
 * statements in the same way, because a backslash at the end of a name joins no lines. */
static bool has_name(ebpo_obj_word word)
{
    static const char *const words[] = { "g", "o", "usemtl", "mtllib", "s" };
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        if (ebpo_obj_word_is(word, words[i]))
            return true;
    return false;
}

/* --- the second pass: faces, and their materials and groups --- */

/* Tables of the second and third index of a corner, v/vt/vn. */
static const ebpo_import_sort sort_of[2] = { EBPO_IMPORT_TEXTURE, EBPO_IMPORT_NORMALS };

static ebpo_status fail_corner(const obj_reading *r, ebpo_obj_word word)
{
    char text[EBPO_IMPORT_WORD_TEXT];
    ebpo_import_word_text(text, word.s, word.n);
    return fail_statement(r, "invalid corner '%s' in a face; expected v, v/vt, v//vn or v/vt/vn",
                          text);
}

/* Reads [+-] digits, up to `end` or a slash. When the number so far is out of range,
 * ignores further digits. Returns false if there are no digits, or if another character follows. */
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

/* Converts an index that counts from 1 (`number` > 0), or back from the latest row so far (< 0), to
 * a row. Returns false if the row does not exist among the `total` rows. */
static bool resolve_index(const obj_reading *r, ebpo_import_sort sort, uint64_t total,
                          int64_t number, uint32_t *row)
{
    int64_t at = number > 0 ? number - 1 : (int64_t)r->rows[sort] + number;
    *row = (uint32_t)at;
    return number != 0 && at >= 0 && (uint64_t)at < total;
}

static ebpo_status fail_vertex_index(const obj_reading *r, int64_t number)
{
    if (number > 0)
        return fail_statement(r,
                              "a face names vertex %" PRId64 ", but there are %" PRIu64
                              " vertices; repair the file or drop the face",
                              number, r->build->vertices);
    return number ? fail_statement(r,
                                   "a face names vertex %" PRId64 ", but only %" PRIu64
                                   " precede it; repair the file or drop the face",
                                   number, r->rows[EBPO_IMPORT_COLOURS])
                  : fail_statement(r, "a face names vertex 0, but indices begin at 1; repair the "
                                      "file");
}

/* Adds a corner to the current polygon. */
static ebpo_status add_corner(obj_reading *r, const uint64_t total[EBPO_IMPORT_SORTS],
                              ebpo_obj_word word)
{
    const char *at = word.s, *end = word.s + word.n;
    ebpo_import_corner *c = ebpo_import_add_corner(r->build);
    int64_t number;
    if (!c)
        return ebpo_fail_memory(r->build->error, r->build->corners * sizeof *c);
    memset(c, 0xff, sizeof *c);
    if (!read_number(&at, end, &number))
        return fail_corner(r, word);
    if (!resolve_index(r, EBPO_IMPORT_COLOURS, r->build->vertices, number, &c->vertex))
        return fail_vertex_index(r, number);
    c->row[EBPO_IMPORT_COLOURS] = c->vertex;
    for (int i = 0; i < 2 && at < end; i++) {
        ebpo_import_sort sort = sort_of[i];
        at++;
        if (at == end || *at == '/') /* not present */
            continue;
        if (!read_number(&at, end, &number))
            return fail_corner(r, word);
        if (!resolve_index(r, sort, total[sort], number, &c->row[sort])) {
            c->row[sort] = EBPO_IMPORT_NONE;
            r->losses.absent[sort]++;
        }
    }
    return at == end ? EBPO_OK : fail_corner(r, word);
}

static ebpo_status read_face(obj_reading *r, const uint64_t total[EBPO_IMPORT_SORTS])
{
    ebpo_import_build *b = r->build;
    ebpo_mesh *mesh = b->mesh;
    uint64_t before = mesh->face_count;
    ebpo_obj_word word;
    ebpo_status status = EBPO_OK;
    while (status == EBPO_OK && ebpo_obj_next_word(&r->text, &word))
        status = add_corner(r, total, word);
    if (status == EBPO_OK)
        status = ebpo_import_polygon(b);
    if (r->runs && status == EBPO_OK)
        r->runs->run[r->runs->count - 1].faces += mesh->face_count - before;
    return status;
}

/* Gives the current material to all faces that have none, and begins the named material. */
static ebpo_status use_material(obj_reading *r)
{
    ebpo_import_build *b = r->build;
    ebpo_obj_word name = ebpo_obj_name(&r->text);
    if (!b->attributes || !name.n)
        return EBPO_OK;
    ebpo_status status = ebpo_obj_give_material(&r->names, b->mesh, b->error);
    return status == EBPO_OK ? ebpo_obj_use_material(&r->names, name, b->error) : status;
}

static ebpo_status begin_run(obj_reading *r)
{
    ebpo_obj_word name = ebpo_obj_name(&r->text);
    r->losses.groups |= name.n > 0;
    return r->runs ? ebpo_obj_runs_add(r->runs, name, r->build->name, r->build->error) : EBPO_OK;
}

/* Returns true for free-form geometry, points, lines and their display attributes, which a mesh
 * cannot hold. */
static bool is_curve(ebpo_obj_word word)
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

/* Returns true for statements that only affect rendering, and which are ignored silently. */
static bool is_display(ebpo_obj_word word)
{
    static const char *const words[] = { "mg",        "bevel",  "c_interp", "d_interp",
                                         "lod",       "usemap", "maplib",   "shadow_obj",
                                         "trace_obj", "ctech",  "stech",    "call" };
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        if (ebpo_obj_word_is(word, words[i]))
            return true;
    return false;
}

/* Counts a statement whose content the mesh cannot store. */
static void record_other(obj_reading *r, ebpo_obj_word word)
{
    obj_losses *l = &r->losses;
    if (ebpo_obj_word_is(word, "mtllib")) {
        l->library |= ebpo_obj_name(&r->text).n > 0;
    } else if (ebpo_obj_word_is(word, "s")) {
        ebpo_obj_word value = ebpo_obj_name(&r->text);
        l->smoothing |= value.n && !ebpo_obj_word_is(value, "off") && !ebpo_obj_word_is(value, "0");
    } else if (is_curve(word)) {
        l->curves++;
    } else if (!is_display(word)) {
        l->unknown_line = l->unknown++ ? l->unknown_line : r->line;
    }
}

/* Reads a statement in the second pass. Vertices, normals and texture coordinates are only counted,
 * because negative indices count back from the latest value. */
static ebpo_status read_statement(obj_reading *r, const uint64_t total[EBPO_IMPORT_SORTS],
                                  ebpo_obj_word word)
{
    if (*word.s == 'v' && word.n <= 2) {
        char second = word.n == 2 ? word.s[1] : 0;
        if (!second || second == 'n' || second == 't') {
            r->rows[second == 'n' ? EBPO_IMPORT_NORMALS
                    : second      ? EBPO_IMPORT_TEXTURE
                                  : EBPO_IMPORT_COLOURS]++;
            return EBPO_OK;
        }
    }
    if (ebpo_obj_word_is(word, "f") || ebpo_obj_word_is(word, "fo"))
        return read_face(r, total);
    if (ebpo_obj_word_is(word, "g") || ebpo_obj_word_is(word, "o"))
        return begin_run(r);
    if (ebpo_obj_word_is(word, "usemtl"))
        return use_material(r);
    record_other(r, word);
    return EBPO_OK;
}

/* Reads the faces and their statements. Returns the errors of ebpo_import_memory. */
static ebpo_status read_faces(obj_reading *r)
{
    ebpo_import_build *b = r->build;
    uint64_t total[EBPO_IMPORT_SORTS];
    ebpo_obj_word word;
    ebpo_status status =
        r->runs ? ebpo_obj_runs_add(r->runs, (ebpo_obj_word){ "", 0 }, b->name, b->error) : EBPO_OK;
    memcpy(total, r->rows, sizeof total);
    memset(r->rows, 0, sizeof r->rows);
    r->text = ebpo_obj_text_begin(r->data, r->size);
    r->next_release = 0;
    while (status == EBPO_OK && step_to_statement(r, &word))
        status = read_statement(r, total, word);
    return status == EBPO_OK && r->names.count
               ? ebpo_obj_give_material(&r->names, b->mesh, b->error)
               : status;
}

/* --- the first pass: vertices, normals and texture coordinates --- */

enum { MAX_WORDS = 8 }; /* the longest vertex has x y z red green blue alpha; one more is surplus */

/* Reads the next words of the statement. Returns their number, at most MAX_WORDS. */
static int read_words(obj_reading *r, ebpo_obj_word word[MAX_WORDS])
{
    int n = 0;
    while (n < MAX_WORDS && ebpo_obj_next_word(&r->text, &word[n]))
        n++;
    return n;
}

/* --- vertices --- */

/* Parses n numbers. On failure returns false and sets *bad to the invalid word. */
static bool read_floats(const obj_reading *r, const ebpo_obj_word *word, int n, float *value,
                        int *bad)
{
    for (*bad = 0; *bad < n; ++*bad)
        if (!ebpo_import_value(r->build, &value[*bad], word[*bad].s, word[*bad].n))
            return false;
    return true;
}

static bool read_position(const obj_reading *r, const ebpo_obj_word *word, double xyz[3], int *bad)
{
    for (*bad = 0; *bad < 3; ++*bad)
        if (!ebpo_import_coordinate(r->build, &xyz[*bad], word[*bad].s, word[*bad].n))
            return false;
    return true;
}

static ebpo_status fail_number(const obj_reading *r, ebpo_obj_word word)
{
    char text[EBPO_IMPORT_WORD_TEXT];
    ebpo_import_word_text(text, word.s, word.n);
    return fail_statement(r, "invalid number '%s' in vertex %" PRIu64 "; repair the file", text,
                          r->build->vertices + 1);
}

/* Divides the coordinates of a vertex x y z w by w. */
static ebpo_status divide_by_weight(obj_reading *r, const ebpo_obj_word word[4], double xyz[3])
{
    double w;
    if (!ebpo_number_double(&w, word[3].s, word[3].n, r->build->c_locale) || w == 0 || !isfinite(w))
        return fail_number(r, word[3]);
    for (int k = 0; k < 3 && w != 1; k++)
        ebpo_import_quotient(r->build, &xyz[k], word[k].s, word[k].n, w);
    r->losses.weights += w != 1;
    return EBPO_OK;
}

/* Adds the colour of the latest vertex to the table of colours, in the row of the vertex. The rows
 * of vertices without a colour are black. coloured: the vertex has a colour (`word`). */
static ebpo_status add_colour(obj_reading *r, const ebpo_obj_word word[3], bool coloured)
{
    static const float none[3] = { 0, 0, 0 };
    ebpo_import_build *b = r->build;
    ebpo_import_table *t = &b->table[EBPO_IMPORT_COLOURS];
    float colour[3];
    int bad = 0;
    ebpo_status status = EBPO_OK;
    if (!b->attributes || (!coloured && !t->rows))
        return EBPO_OK;
    while (t->rows + 1 < b->vertices && status == EBPO_OK) {
        r->losses.uncoloured++;
        status = ebpo_import_row(b, EBPO_IMPORT_COLOURS, none);
    }
    r->losses.uncoloured += !coloured;
    if (coloured && !read_floats(r, word, 3, colour, &bad)) {
        r->losses.no_numbers++;
        coloured = false;
    }
    return status == EBPO_OK ? ebpo_import_row(b, EBPO_IMPORT_COLOURS, coloured ? colour : none)
                             : status;
}

/* Reads x y z, x y z w, x y z red green blue, or x y z red green blue alpha. */
static ebpo_status read_vertex(obj_reading *r)
{
    ebpo_obj_word word[MAX_WORDS];
    double xyz[3];
    int n = read_words(r, word), bad;
    if (n < 3)
        return fail_statement(r,
                              "vertex %" PRIu64 " has %d coordinate%s, expected 3; add z (0 in a "
                              "plane), or repair the file",
                              r->build->vertices + 1, n, n == 1 ? "" : "s");
    if (!read_position(r, word, xyz, &bad))
        return fail_number(r, word[bad]);
    ebpo_status status = n == 4 ? divide_by_weight(r, word, xyz) : EBPO_OK;
    if (status == EBPO_OK)
        status = ebpo_import_position(r->build, xyz);
    r->losses.surplus += n == 5 || n == 8;
    r->losses.alpha += n == 7;
    return status == EBPO_OK ? add_colour(r, word + 3, n >= 6) : status;
}

/* --- normals and texture coordinates --- */

static ebpo_status read_row(obj_reading *r, ebpo_import_sort sort)
{
    ebpo_obj_word word[MAX_WORDS];
    float value[3] = { 0, 0, 0 };
    int bad, n, wanted = sort == EBPO_IMPORT_NORMALS ? 3 : 1;
    r->rows[sort]++;
    if (!r->build->attributes)
        return EBPO_OK;
    n = read_words(r, word);
    if (n < wanted || !read_floats(r, word, n < 3 ? n : 3, value, &bad)) {
        r->losses.no_numbers++;
        memset(value, 0, sizeof value);
    }
    r->losses.third |= sort == EBPO_IMPORT_TEXTURE && value[2] != 0;
    return ebpo_import_row(r->build, sort, value);
}

static ebpo_status read_values(obj_reading *r)
{
    ebpo_obj_word word;
    ebpo_status status = EBPO_OK;
    while (status == EBPO_OK && step_to_statement(r, &word)) {
        if (has_name(word))
            (void)ebpo_obj_name(&r->text);
        if (*word.s != 'v' || word.n > 2)
            continue;
        if (word.n == 1)
            status = read_vertex(r);
        else if (word.s[1] == 'n' || word.s[1] == 't')
            status = read_row(r, word.s[1] == 'n' ? EBPO_IMPORT_NORMALS : EBPO_IMPORT_TEXTURE);
    }
    r->rows[EBPO_IMPORT_COLOURS] = r->build->vertices;
    return status;
}

/* --- omitted data --- */

/* Records omitted data that also matter to callers that read only the mesh. */
static void record_unread(const obj_reading *r, ebpo_attributes *to)
{
    const obj_losses *l = &r->losses;
    ebpo_attributes_count_unread(to, "texture coordinates that faces refer to but the file lacks",
                                 l->absent[EBPO_IMPORT_TEXTURE]);
    ebpo_attributes_count_unread(to, "normals that faces refer to but the file lacks",
                                 l->absent[EBPO_IMPORT_NORMALS]);
    ebpo_attributes_count_unread(to, "weights of vertices (coordinates are divided by them)",
                                 l->weights);
    ebpo_attributes_count_unread(to, "vertex values beyond coordinates and colours", l->surplus);
    ebpo_attributes_count_unread(to, "points, lines, curves and surfaces, which are not faces",
                                 l->curves);
    if (l->unknown)
        ebpo_attributes_note_unread(to,
                                    "unknown statements: %" PRIu64 ", the first in line %" PRIu64,
                                    l->unknown, l->unknown_line);
}

static void record_losses(const obj_reading *r, ebpo_attributes *to)
{
    const obj_losses *l = &r->losses;
    if (l->third) /* only two components have names */
        ebpo_attributes_lose(to, "the third texture coordinate");
    if (l->uncoloured)
        ebpo_attributes_lose(to, "missing colours of vertices (stored as black): %" PRIu64,
                             l->uncoloured);
    if (l->alpha)
        ebpo_attributes_lose(to, "opacity of vertices");
    if (l->no_numbers)
        ebpo_attributes_lose(to,
                             "colours, normals or texture coordinates that are not numbers: "
                             "%" PRIu64,
                             l->no_numbers);
    if (l->smoothing)
        ebpo_attributes_lose(to, "smoothing groups");
    if (l->library)
        ebpo_attributes_lose(to, "material properties in the library (colours and the like)");
}

static bool any_unread(const obj_losses *l)
{
    return l->absent[EBPO_IMPORT_TEXTURE] || l->absent[EBPO_IMPORT_NORMALS] || l->weights ||
           l->surplus || l->curves || l->unknown;
}

static ebpo_status record_all(obj_reading *r)
{
    ebpo_mesh *mesh = r->build->mesh;
    ebpo_status status = any_unread(&r->losses)
                             ? ebpo_mesh_need_attributes(r->build->mesh, r->build->error)
                             : EBPO_OK;
    if (status != EBPO_OK)
        return status;
    if (mesh->attributes)
        record_unread(r, mesh->attributes);
    if (r->build->attributes)
        record_losses(r, mesh->attributes);
    return EBPO_OK;
}

static ebpo_status read_all(obj_reading *r)
{
    ebpo_import_build *b = r->build;
    ebpo_status status = read_values(r);
    if (status == EBPO_OK)
        status = ebpo_import_faces(b);
    if (status == EBPO_OK)
        status = read_faces(r);
    if (status == EBPO_OK)
        status = ebpo_import_end(b);
    if (status == EBPO_OK && b->attributes)
        status = ebpo_import_attributes(b);
    if (status == EBPO_OK && b->attributes)
        status = ebpo_obj_keep_materials(&r->names, b->mesh, b->error);
    return status == EBPO_OK ? record_all(r) : status;
}

static ebpo_status build_obj(ebpo_import_build *b, const ebpo_import_job *job)
{
    obj_reading r = { .build = b, .data = job->data, .size = job->size, .runs = job->runs };
    r.text = ebpo_obj_text_begin(r.data, r.size);
    ebpo_status status = read_all(&r);
    if (status == EBPO_OK && r.losses.groups && b->attributes && !r.runs)
        ebpo_attributes_lose(b->mesh->attributes, "names of groups and objects");
    ebpo_obj_names_free(&r.names, b->mesh->workspace);
    return status;
}

/* Returns true if the first word begins an OBJ statement. OBJ files have no magic number. */
static bool begins_as_obj(const uint8_t *data, uint64_t size)
{
    static const char *const words[] = { "v", "vt", "vn", "vp",     "f",
                                         "g", "o",  "s",  "mtllib", "usemtl" };
    ebpo_obj_text t = ebpo_obj_text_begin(data, size);
    ebpo_obj_word word;
    if (!ebpo_obj_next_statement(&t, &word))
        return false;
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        if (ebpo_obj_word_is(word, words[i]))
            return true;
    return false;
}

const ebpo_import_format ebpo_import_obj = { .called = "an OBJ",
                                             .ending = ".obj",
                                             .recognise = begins_as_obj,
                                             .has_no_signature = true,
                                             .build = EBPO_IMPORT_READER(build_obj) };
