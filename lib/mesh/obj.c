/* The first pass: what faces name. Faces may name what comes later, so they are a pass of their
 * own.
 */
#include "core/strict_fp.h"

#include "mesh/obj.h"

#include <inttypes.h>
#include <string.h>

#include "mesh/attributes.h"
#include "core/workspace.h"
#include "core/error.h"
#include "geometry/decimal.h"
#include "mesh/obj_faces.h"
#include "mesh/obj_state.h"

enum { MOST_WORDS = 8 };

static int read_words(obj_reading *r, obj_word word[MOST_WORDS])
{
    int n = 0;
    while (n < MOST_WORDS && ebpo_obj_next_word(&r->text, &word[n]))
        n++;
    return n;
}

/* --- vertices --- */

/* Numbers of as many words; false: *bad is none. */
static bool read_floats(const obj_reading *r, const obj_word *word, int n, float *value, int *bad)
{
    for (*bad = 0; *bad < n; ++*bad)
        if (!ebpo_import_value(r->build, &value[*bad], word[*bad].s, word[*bad].n))
            return false;
    return true;
}

static bool read_position(const obj_reading *r, const obj_word *word, double xyz[3], int *bad)
{
    for (*bad = 0; *bad < 3; ++*bad)
        if (!ebpo_import_coordinate(r->build, &xyz[*bad], word[*bad].s, word[*bad].n))
            return false;
    return true;
}

static ebpo_status fail_vertex(const obj_reading *r, obj_word word)
{
    char text[IMPORT_WORD_TEXT];
    ebpo_import_word_text(text, word.s, word.n);
    return ebpo_obj_fail(r, "no number: '%s' in vertex %" PRIu64 "; repair the file", text,
                         r->build->vertices + 1);
}

/* Homogeneous coordinates, as w is where it is no 1. */
static ebpo_status divide(obj_reading *r, const obj_word word[4], double xyz[3])
{
    double w;
    if (!ebpo_number_double(&w, word[3].s, word[3].n, r->build->c_locale) || w == 0)
        return fail_vertex(r, word[3]);
    for (int k = 0; k < 3 && w != 1; k++)
        ebpo_import_quotient(r->build, &xyz[k], word[k].s, word[k].n, w);
    r->losses.weights += w != 1;
    return EBPO_OK;
}

/* A vertex has the row of its own number. */
static ebpo_status add_colour(obj_reading *r, const obj_word word[3], bool coloured)
{
    static const float none[3] = { 0, 0, 0 };
    import_build *b = r->build;
    import_table *t = &b->table[IMPORT_COLOURS];
    float colour[3];
    int bad = 0;
    ebpo_status status = EBPO_OK;
    if (!b->attributes || (!coloured && !t->rows))
        return EBPO_OK;
    while (t->rows + 1 < b->vertices && status == EBPO_OK) {
        r->losses.uncoloured++;
        status = ebpo_import_row(b, IMPORT_COLOURS, none);
    }
    r->losses.uncoloured += !coloured;
    if (coloured && !read_floats(r, word, 3, colour, &bad)) {
        r->losses.no_numbers++;
        coloured = false;
    }
    return status == EBPO_OK ? ebpo_import_row(b, IMPORT_COLOURS, coloured ? colour : none)
                             : status;
}

/* x y z, x y z w, x y z red green blue, or these with an alpha. */
static ebpo_status read_vertex(obj_reading *r)
{
    obj_word word[MOST_WORDS];
    double xyz[3];
    int n = read_words(r, word), bad;
    if (n < 3)
        return ebpo_obj_fail(r,
                             "vertex %" PRIu64 " has %d coordinates, not three; write z as well "
                             "(0 in a plane), or repair the file",
                             r->build->vertices + 1, n);
    if (!read_position(r, word, xyz, &bad))
        return fail_vertex(r, word[bad]);
    ebpo_status status = n == 4 ? divide(r, word, xyz) : EBPO_OK;
    if (status == EBPO_OK)
        status = ebpo_import_position(r->build, xyz);
    r->losses.surplus += n == 5 || n == 8;
    r->losses.alpha += n == 7;
    return status == EBPO_OK ? add_colour(r, word + 3, n >= 6) : status;
}

/* --- normals and texture coordinates --- */

static ebpo_status read_row(obj_reading *r, import_sort sort)
{
    obj_word word[MOST_WORDS];
    float value[3] = { 0, 0, 0 };
    int bad, n, wanted = sort == IMPORT_NORMALS ? 3 : 1;
    r->rows[sort]++;
    if (!r->build->attributes)
        return EBPO_OK;
    n = read_words(r, word);
    if (n < wanted || !read_floats(r, word, n < 3 ? n : 3, value, &bad)) {
        r->losses.no_numbers++;
        memset(value, 0, sizeof value);
    }
    r->losses.third |= sort == IMPORT_TEXTURE && value[2] != 0;
    return ebpo_import_row(r->build, sort, value);
}

static ebpo_status read_values(obj_reading *r)
{
    obj_word word;
    ebpo_status status = EBPO_OK;
    while (status == EBPO_OK && ebpo_obj_step(r, &word)) {
        if (*word.s != 'v' || word.n > 2)
            continue;
        if (word.n == 1)
            status = read_vertex(r);
        else if (word.s[1] == 'n' || word.s[1] == 't')
            status = read_row(r, word.s[1] == 'n' ? IMPORT_NORMALS : IMPORT_TEXTURE);
    }
    r->rows[IMPORT_COLOURS] = r->build->vertices;
    return status;
}

/* --- what is left out --- */

/* What concerns those who read the mesh alone, too. */
static void note_unread(const obj_reading *r, ebpo_attributes *to)
{
    const obj_losses *l = &r->losses;
    ebpo_attributes_count_unread(
        to, "texture coordinates that corners of faces name and that are not in the file",
        l->absent[IMPORT_TEXTURE]);
    ebpo_attributes_count_unread(to,
                                 "normals that corners of faces name and that are not in the file",
                                 l->absent[IMPORT_NORMALS]);
    ebpo_attributes_count_unread(to, "weights of vertices, by which coordinates were divided",
                                 l->weights);
    ebpo_attributes_count_unread(to, "vertices' values beyond coordinates and colours", l->surplus);
    ebpo_attributes_count_unread(to, "points, lines, curves and surfaces, which are no faces",
                                 l->curves);
    if (l->unknown)
        ebpo_attributes_note_unread(to,
                                    "unknown statements: %" PRIu64 ", the first in line %" PRIu64,
                                    l->unknown, l->unknown_line);
}

static void note_losses(const obj_reading *r, ebpo_attributes *to)
{
    const obj_losses *l = &r->losses;
    if (l->third) /* only two have names */
        ebpo_attributes_lose(to, "the third texture coordinate");
    if (l->uncoloured)
        ebpo_attributes_lose(to, "that %" PRIu64 " vertices have no colours", l->uncoloured);
    if (l->alpha)
        ebpo_attributes_lose(to, "how opaque vertices are");
    if (l->no_numbers)
        ebpo_attributes_lose(to,
                             "%" PRIu64 " colours, normals or texture coordinates that are no "
                             "numbers",
                             l->no_numbers);
    if (l->smoothing)
        ebpo_attributes_lose(to, "smoothing groups");
    if (l->library)
        ebpo_attributes_lose(to, "what the material library says (colours and the like)");
}

static bool any_unread(const obj_losses *l)
{
    return l->absent[IMPORT_TEXTURE] || l->absent[IMPORT_NORMALS] || l->weights || l->surplus ||
           l->curves || l->unknown;
}

static ebpo_status note_all(obj_reading *r)
{
    ebpo_mesh *mesh = r->build->mesh;
    ebpo_status status = any_unread(&r->losses) ? ebpo_import_notes(r->build) : EBPO_OK;
    if (status != EBPO_OK)
        return status;
    if (mesh->attributes)
        note_unread(r, mesh->attributes);
    if (r->build->attributes)
        note_losses(r, mesh->attributes);
    return EBPO_OK;
}

static ebpo_status read_all(obj_reading *r)
{
    import_build *b = r->build;
    ebpo_status status = read_values(r);
    if (status == EBPO_OK)
        status = ebpo_import_faces(b);
    if (status == EBPO_OK)
        status = ebpo_obj_read_faces(r);
    if (status == EBPO_OK)
        status = ebpo_import_end(b);
    if (status == EBPO_OK && b->attributes)
        status = ebpo_import_attributes(b);
    if (status == EBPO_OK && b->attributes)
        status = ebpo_obj_keep_materials(&r->names, b->mesh, b->error);
    return status == EBPO_OK ? note_all(r) : status;
}

ebpo_status ebpo_obj_read(import_build *b, const uint8_t *data, uint64_t size, ebpo_obj_runs *runs)
{
    obj_reading r = { .build = b, .data = data, .size = size, .runs = runs };
    r.text = ebpo_obj_text(data, size);
    ebpo_status status = read_all(&r);
    if (status == EBPO_OK && r.losses.groups && b->attributes && !runs)
        ebpo_attributes_lose(b->mesh->attributes, "names of groups and objects");
    ebpo_obj_names_free(&r.names, b->mesh->workspace);
    return status;
}
