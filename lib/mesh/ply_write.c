/* Writes a mesh and its attributes as PLY. Uses the header of the source if the mesh has one,
 * otherwise a new header. Properties keep the types of the source if these types hold every value.
 */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/mesh.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/endian.h"
#include "core/error.h"
#include "core/text.h"
#include "io/publish.h"
#include "mesh/attributes.h"
#include "mesh/ply_parts.h"

/* --- the layout --- */

/* A property of the PLY file to write. The file has the elements and properties of the mesh and its
 * attributes, in the order of the source header if there is one. */

typedef struct ply_out_property {
    /* role of positions and corners; NONE: `attribute` and `column` identify the values */
    ebpo_ply_role role;
    uint32_t attribute; /* index of the array */
    uint32_t column;
    ebpo_ply_type type, count_type; /* types in the written file, for positions and corners */
} ply_out_property;

typedef struct ply_out_element {
    ebpo_ply_kind kind;
    uint64_t rows;
    uint64_t first, properties; /* range in ply_layout.property */
} ply_out_element;

typedef struct ply_layout {
    ply_out_element *element;
    uint64_t elements, element_capacity;
    ply_out_property *property;
    uint64_t properties, property_capacity;
    char *header; /* from malloc, `header_bytes` bytes */
    size_t header_bytes;
} ply_layout;

static void free_layout(ply_layout *layout);

/* The creation of a layout. */
typedef struct making {
    ply_layout *out;
    const ebpo_mesh *mesh;
    FILE *text; /* receives the new header */
    /* [arrays][EBPO_ATTRIBUTE_COLUMNS] columns that the new header already has */
    bool *taken;
    ebpo_ply_type index_type; /* type that holds all vertex indices */
    bool faces;               /* the new header already has the face element */
    bool no_memory;           /* true: out of memory; the layout is not usable */
} making;

static const char *const type_words[] = { "char", "uchar", "short", "ushort",
                                          "int",  "uint",  "float", "double" };

static ply_out_element *add_element(making *m, ebpo_ply_kind kind, uint64_t rows)
{
    ply_layout *l = m->out;
    if (!ebpo_grow(&l->element, &l->element_capacity, l->elements + 1, sizeof *l->element)) {
        m->no_memory = true;
        return NULL;
    }
    l->element[l->elements] = (ply_out_element){ kind, rows, l->properties, 0 };
    return &l->element[l->elements++];
}

static void add_property(making *m, ply_out_property property)
{
    ply_layout *l = m->out;
    if (m->no_memory ||
        !ebpo_grow(&l->property, &l->property_capacity, l->properties + 1, sizeof *l->property)) {
        m->no_memory = true;
        return;
    }
    l->property[l->properties++] = property;
    l->element[l->elements - 1].properties++;
}

static uint64_t array_count(const making *m)
{
    return m->mesh->attributes ? m->mesh->attributes->count : 0;
}

/* --- positions and corners --- */

static ebpo_ply_type position_type(const ebpo_mesh *mesh)
{
    return mesh->xyz64 ? EBPO_PLY_FLOAT64 : EBPO_PLY_FLOAT32;
}

/* Returns true if the type holds the coordinate exactly, bit for bit. */
static bool type_holds(ebpo_ply_type type, double v)
{
    static const double least[] = { INT8_MIN, 0, INT16_MIN, 0, INT32_MIN, 0 }, most[] = {
        INT8_MAX, UINT8_MAX, INT16_MAX, UINT16_MAX, INT32_MAX, UINT32_MAX
    };
    uint64_t bits, converted_bits;
    double converted;
    if (type == EBPO_PLY_FLOAT64)
        return true;
    if (type != EBPO_PLY_FLOAT32 && !(v >= least[type] && v <= most[type]))
        return false;
    converted = type == EBPO_PLY_FLOAT32 ? (double)(float)v : (double)(int64_t)v;
    memcpy(&bits, &v, sizeof v);
    memcpy(&converted_bits, &converted, sizeof converted);
    return bits == converted_bits;
}

/* Returns the wanted type if this type holds all coordinates of the axis, otherwise double. */
static ebpo_ply_type axis_type(const making *m, ebpo_ply_role role, ebpo_ply_type wanted)
{
    const ebpo_mesh *mesh = m->mesh;
    uint64_t axis = (uint64_t)(role - EBPO_PLY_ROLE_X);
    if (!mesh->xyz64)
        return EBPO_PLY_FLOAT32;
    EBPO_FOR_ITEMS(mesh->workspace, i, 0, wanted == EBPO_PLY_FLOAT64 ? 0 : mesh->vertex_count)
        if (!type_holds(wanted, mesh->xyz64[3 * i + axis]))
            return EBPO_PLY_FLOAT64;
    return wanted;
}

/* Copies a line of the source header unchanged, because types have several names. */
static void put_line(making *m, ebpo_ply_word line)
{
    fprintf(m->text, "%.*s\n", (int)line.n, line.s);
}

/* Adds the property of a coordinate. `line`: the line of the source header, which has the wanted
 * type, or an empty line. */
static void add_position(making *m, ebpo_ply_role role, ebpo_ply_type wanted, ebpo_ply_word line)
{
    ebpo_ply_type type = axis_type(m, role, wanted);
    if (line.n && type == wanted)
        put_line(m, line);
    else
        fprintf(m->text, "property %s %c\n", type_words[type], "xyz"[role - EBPO_PLY_ROLE_X]);
    add_property(m, (ply_out_property){ .role = role, .type = type });
}

/* Adds the property of the corners, a list. count: type of the list length. wanted: type of the
 * vertex indices if this type holds all of them. line: the line of the source header, or an empty
 * line. */
static void add_corners(making *m, ebpo_ply_type count, ebpo_ply_type wanted, ebpo_ply_word name,
                        ebpo_ply_word line)
{
    static const uint64_t most[] = { INT8_MAX,   UINT8_MAX, INT16_MAX,
                                     UINT16_MAX, INT32_MAX, UINT32_MAX };
    ebpo_ply_type type = m->mesh->vertex_count <= most[wanted] ? wanted : m->index_type;
    if (line.n && type == wanted)
        put_line(m, line);
    else
        fprintf(m->text, "property list %s %s %.*s\n", type_words[count], type_words[type],
                (int)name.n, name.s);
    add_property(m, (ply_out_property){
                        .role = EBPO_PLY_ROLE_CORNERS, .type = type, .count_type = count });
}

/* --- attributes --- */

static bool is_word(const char *s, size_t n, ebpo_ply_word word)
{
    return n == word.n && memcmp(s, word.s, n) == 0;
}

/* Returns the column with this name that is not in the header yet, or -1. */
static int find_column(const ebpo_attribute *a, const bool *taken, ebpo_ply_word name)
{
    const char *s = a->names;
    for (int column = 0; *s; column++) {
        size_t n = strcspn(s, " ");
        if (!taken[column] && is_word(s, n, name))
            return column;
        s += n + (s[n] == ' ');
    }
    return -1;
}

static void add_column(making *m, uint64_t array, uint32_t column)
{
    const ebpo_attribute *a = &m->mesh->attributes->array[array];
    m->taken[array * EBPO_ATTRIBUTE_COLUMNS + column] = true;
    add_property(m, (ply_out_property){ .role = EBPO_PLY_ROLE_NONE,
                                        .attribute = (uint32_t)array,
                                        .column = column,
                                        .type = (ebpo_ply_type)a->type,
                                        .count_type = (ebpo_ply_type)a->list });
}

/* Adds the column with the values of a property of the source header. Returns false if the mesh has
 * no such column. */
static bool add_named(making *m, ebpo_ply_word element, const ebpo_ply_property *property)
{
    for (uint64_t i = 0; i < array_count(m); i++) {
        const ebpo_attribute *a = &m->mesh->attributes->array[i];
        bool list = a->list != EBPO_ATTRIBUTE_NO_LIST;
        if (!is_word(a->element, strlen(a->element), element) || list != property->list ||
            (int)a->type != (int)property->type || (list && a->list != (int)property->count_type))
            continue;
        int column = find_column(a, m->taken + i * EBPO_ATTRIBUTE_COLUMNS, property->name);
        if (column < 0)
            continue;
        add_column(m, i, (uint32_t)column);
        return true;
    }
    return false;
}

/* Adds the columns of an element that are not in the header yet, in the order of the arrays. */
static void add_rest(making *m, const char *element)
{
    for (uint64_t i = 0; i < array_count(m); i++) {
        const ebpo_attribute *a = &m->mesh->attributes->array[i];
        const char *s = a->names;
        bool list = a->list != EBPO_ATTRIBUTE_NO_LIST;
        if (!ebpo_attribute_is_of(a, element))
            continue;
        for (uint32_t column = 0; *s; column++) {
            size_t n = strcspn(s, " ");
            if (!m->taken[i * EBPO_ATTRIBUTE_COLUMNS + column]) {
                add_column(m, i, column);
                fprintf(m->text, "property %s%s%s%s %.*s\n", list ? "list " : "",
                        list ? type_words[a->list] : "", list ? " " : "", type_words[a->type],
                        (int)n, s);
            }
            s += n + (s[n] == ' ');
        }
    }
}

/* Returns the number of rows of an element other than vertices and faces; 0 if the mesh does not
 * have its attributes. An element without properties has no attributes. */
static uint64_t rows_of(const making *m, const ebpo_ply_element *element)
{
    if (!element->properties)
        return element->count;
    for (uint64_t i = 0; i < array_count(m); i++) {
        const ebpo_attribute *a = &m->mesh->attributes->array[i];
        if (is_word(a->element, strlen(a->element), element->name))
            return a->rows;
    }
    return 0;
}

/* --- a new header --- */

static void begin_faces(making *m)
{
    m->faces = true;
    fprintf(m->text, "element face %" PRIu64 "\n", m->mesh->face_count);
    add_element(m, EBPO_PLY_KIND_FACE, m->mesh->face_count);
}

/* Adds the columns of the element that the source header does not have. */
static void end_element(making *m, ebpo_ply_kind kind)
{
    if (kind == EBPO_PLY_KIND_VERTEX)
        add_rest(m, "vertex");
    else if (kind == EBPO_PLY_KIND_FACE)
        add_rest(m, "face");
}

/* Adds the elements of attributes other than vertices, faces and textures. */
static void add_other_elements(making *m)
{
    for (uint64_t i = 0; i < array_count(m); i++) {
        const ebpo_attribute *a = &m->mesh->attributes->array[i];
        if (m->taken[i * EBPO_ATTRIBUTE_COLUMNS] || ebpo_attribute_is_of_mesh(a) ||
            ebpo_attribute_is_of_textures(a))
            continue;
        fprintf(m->text, "element %s %" PRIu64 "\n", a->element, a->rows);
        add_element(m, EBPO_PLY_KIND_OTHER, a->rows);
        add_rest(m, a->element);
    }
}

static const ebpo_ply_word default_corners = { "vertex_indices", 14 };

/* Makes the layout without a source header. */
static void make_plain(making *m)
{
    fprintf(m->text, "ply\nformat binary_little_endian 1.0\nelement vertex %" PRIu64 "\n",
            m->mesh->vertex_count);
    add_element(m, EBPO_PLY_KIND_VERTEX, m->mesh->vertex_count);
    for (int k = 0; k < 3; k++)
        add_position(m, (ebpo_ply_role)(EBPO_PLY_ROLE_X + k), position_type(m->mesh),
                     (ebpo_ply_word){ "", 0 });
    end_element(m, EBPO_PLY_KIND_VERTEX);
    begin_faces(m);
    add_corners(m, EBPO_PLY_UINT8, m->index_type, default_corners, (ebpo_ply_word){ "", 0 });
    end_element(m, EBPO_PLY_KIND_FACE);
    add_other_elements(m);
    fputs("end_header\n", m->text);
}

/* --- the source header --- */

/* The reading of the source header, statement by statement, while the new header is made. */
typedef struct following {
    making *m;
    ebpo_ply_header header;     /* the source header */
    uint64_t element, property; /* numbers of element and property statements so far */
    ebpo_ply_kind kind;         /* kind of the current element, as written */
    uint64_t rows;              /* rows of the current element */
    bool skipped;               /* the current element is omitted */
} following;

static void close_element(following *f)
{
    if (f->element && !f->skipped)
        end_element(f->m, f->kind);
}

/* Adds an element. Strips are written as faces. Omits a second element of faces, and elements whose
 * attributes the mesh does not have any more. */
static void follow_element(following *f)
{
    making *m = f->m;
    close_element(f);
    const ebpo_ply_element *e = &f->header.element[f->element++];
    f->kind = e->kind == EBPO_PLY_KIND_STRIPS ? EBPO_PLY_KIND_FACE : e->kind;
    f->rows = e->kind == EBPO_PLY_KIND_VERTEX  ? m->mesh->vertex_count
              : e->kind == EBPO_PLY_KIND_OTHER ? rows_of(m, e)
                                               : m->mesh->face_count;
    f->skipped = f->kind == EBPO_PLY_KIND_FACE ? m->faces : f->rows == 0 && e->count != 0;
    if (e->kind == EBPO_PLY_KIND_STRIPS && f->header.face >= 0)
        f->skipped = true;
    if (f->skipped)
        return;
    if (f->kind == EBPO_PLY_KIND_FACE) {
        begin_faces(m);
        return;
    }
    fprintf(m->text, "element %.*s %" PRIu64 "\n", (int)e->name.n, e->name.s, f->rows);
    add_element(m, f->kind, f->rows);
}

/* Adds a property. Elements without rows keep all properties of the source header. */
static void follow_property(following *f, ebpo_ply_word line)
{
    making *m = f->m;
    const ebpo_ply_element *e = &f->header.element[f->element - 1];
    const ebpo_ply_property *property = &f->header.property[f->property++];
    if (f->skipped)
        return;
    if (property->role == EBPO_PLY_ROLE_CORNERS && e->kind == EBPO_PLY_KIND_STRIPS)
        add_corners(m, EBPO_PLY_UINT8, property->type, property->name, (ebpo_ply_word){ "", 0 });
    else if (property->role == EBPO_PLY_ROLE_CORNERS)
        add_corners(m, property->count_type, property->type, property->name, line);
    else if (property->role != EBPO_PLY_ROLE_NONE)
        add_position(m, property->role, property->type, line);
    else if (add_named(m, e->name, property) || f->rows == 0)
        put_line(m, line);
}

static bool begins_with_word(ebpo_ply_word line, const char *word)
{
    size_t n = strlen(word), at = 0;
    while (at < line.n && (line.s[at] == ' ' || line.s[at] == '\t'))
        at++;
    return line.n - at >= n && memcmp(line.s + at, word, n) == 0 &&
           (line.n - at == n || line.s[at + n] == ' ' || line.s[at + n] == '\t');
}

static void follow_line(following *f, ebpo_ply_word line)
{
    if (begins_with_word(line, "format"))
        fputs("format binary_little_endian 1.0\n", f->m->text);
    else if (begins_with_word(line, "element"))
        follow_element(f);
    else if (begins_with_word(line, "property"))
        follow_property(f, line);
    else
        put_line(f->m, line);
}

static void follow_header(following *f, const char *at, const char *end)
{
    while (at < end && !f->m->no_memory) {
        const char *stop = memchr(at, '\n', (size_t)(end - at));
        ebpo_ply_word line = { at, (size_t)((stop ? stop : end) - at) };
        if (begins_with_word(line, "end_header"))
            close_element(f);
        if (line.n && line.s[line.n - 1] == '\r')
            line.n--;
        follow_line(f, line);
        at = stop ? stop + 1 : end;
    }
}

/* Makes the layout in the order of the source header. Returns false, with an unchanged layout, if
 * there is no usable source header. */
static bool make_as_source(making *m)
{
    const ebpo_attributes *all = m->mesh->attributes;
    following f = { .m = m };
    if (!all || !all->header ||
        ebpo_ply_header_parse(&f.header, (const uint8_t *)all->header, all->header_bytes, "header",
                              NULL) != EBPO_OK)
        return false;
    bool usable =
        (f.header.face >= 0 || f.header.strips >= 0) && f.header.body == all->header_bytes;
    if (usable)
        follow_header(&f, all->header, all->header + all->header_bytes);
    ebpo_ply_header_free(&f.header);
    return usable;
}

/* --- either header --- */

/* Creates the layout. `mesh` has been checked. */
static ebpo_status make_layout(ply_layout *out, const ebpo_mesh *mesh, ebpo_error *error)
{
    ebpo_text_stream header;
    *out = (ply_layout){ .element = NULL };
    making m = { .out = out,
                 .mesh = mesh,
                 .index_type =
                     mesh->vertex_count < UINT64_C(1) << 31 ? EBPO_PLY_INT32 : EBPO_PLY_UINT32 };
    m.taken = ebpo_alloc_zero(array_count(&m) + 1, EBPO_ATTRIBUTE_COLUMNS);
    if (ebpo_text_stream_begin(&header))
        m.text = header.file;
    m.no_memory = !m.taken || !m.text;
    if (!m.no_memory && !make_as_source(&m))
        make_plain(&m);
    if (m.text && !ebpo_text_stream_end(&header))
        m.no_memory = true;
    if (m.text) {
        out->header = header.text;
        out->header_bytes = header.bytes;
    }
    free(m.taken);
    if (!m.no_memory)
        return EBPO_OK;
    free_layout(out);
    return ebpo_fail_memory(error, sizeof *out);
}

static void free_layout(ply_layout *layout)
{
    free(layout->element);
    free(layout->property);
    free(layout->header);
    *layout = (ply_layout){ .element = NULL };
}

/* --- writing --- */

enum { BUFFER = 1 << 16 }; /* bytes */

static ebpo_status check_mesh(const ebpo_mesh *mesh, ebpo_error *error)
{
    if (mesh->vertex_count > UINT32_MAX - 1 || mesh->face_count > UINT32_MAX - 1)
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "the mesh has %" PRIu64 " vertices and %" PRIu64
                         " faces, but 2^32 - 2 of each is the limit; split it",
                         mesh->vertex_count, mesh->face_count);
    if ((mesh->vertex_count && !mesh->xyz32 == !mesh->xyz64) || (mesh->face_count && !mesh->faces))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the mesh has counts without arrays, or positions of both types");
    EBPO_FOR_ITEMS(mesh->workspace, i, 0, 3 * mesh->face_count)
        if (mesh->faces[i] >= mesh->vertex_count)
            return ebpo_fail(error, EBPO_E_ARGUMENT,
                             "face %" PRIu64 " of the mesh to write names vertex %" PRIu32
                             ", but there are %" PRIu64 " vertices",
                             i / 3, mesh->faces[i], mesh->vertex_count);
    return EBPO_OK;
}

typedef struct writing {
    FILE *f;
    const ebpo_mesh *mesh;
    const ply_layout *layout;
    const ply_out_element *element;
    uint8_t *buffer; /* BUFFER bytes */
    size_t used;
    bool failed;
} writing;

static void flush_buffer(writing *w)
{
    w->failed = w->failed || fwrite(w->buffer, 1, w->used, w->f) != w->used;
    w->used = 0;
}

/* Writes the low bytes of a number, little-endian. */
static void put_bytes(writing *w, unsigned bytes, uint64_t bits)
{
    uint8_t *at = w->buffer + w->used;
    if (bytes == 1)
        *at = (uint8_t)bits;
    else if (bytes == 2)
        ebpo_store16(at, (uint16_t)bits);
    else if (bytes == 4)
        ebpo_store32(at, (uint32_t)bits);
    else
        ebpo_store64(at, bits);
    w->used += bytes;
    if (w->used > BUFFER - sizeof(uint64_t))
        flush_buffer(w);
}

static void put_position(writing *w, const ply_out_property *p, uint64_t row)
{
    uint64_t at = 3 * row + (uint64_t)(p->role - EBPO_PLY_ROLE_X), bits = 0;
    float narrow = w->mesh->xyz32 ? w->mesh->xyz32[at] : (float)w->mesh->xyz64[at];
    if (p->type == EBPO_PLY_FLOAT32) {
        memcpy(&bits, &narrow, sizeof narrow);
        bits = __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__ ? bits : bits >> 32; /* the low bytes */
    } else if (p->type == EBPO_PLY_FLOAT64) {
        memcpy(&bits, &w->mesh->xyz64[at], sizeof bits);
    } else {
        bits = (uint64_t)(int64_t)w->mesh->xyz64[at]; /* the layout guarantees an integer */
    }
    put_bytes(w, ebpo_ply_type_bytes(p->type), bits);
}

static void put_corners(writing *w, const ply_out_property *p, uint64_t row)
{
    put_bytes(w, ebpo_ply_type_bytes(p->count_type), 3);
    for (uint64_t k = 0; k < 3; k++)
        put_bytes(w, ebpo_ply_type_bytes(p->type), w->mesh->faces[3 * row + k]);
}

/* Returns the bits of a value in memory. */
static uint64_t native_bits(const uint8_t *at, unsigned bytes)
{
    uint16_t b2;
    uint32_t b4;
    uint64_t b8;
    switch (bytes) {
    case 1: return *at;
    case 2: memcpy(&b2, at, 2); return b2;
    case 4: memcpy(&b4, at, 4); return b4;
    default: memcpy(&b8, at, 8); return b8;
    }
}

static void put_attribute(writing *w, const ply_out_property *p, uint64_t row)
{
    const ebpo_attribute *a = &w->mesh->attributes->array[p->attribute];
    unsigned bytes = ebpo_attribute_bytes(a->type);
    uint64_t begin = row * a->columns + p->column, count = 1;
    if (a->list != EBPO_ATTRIBUTE_NO_LIST) {
        begin = !a->ends ? row * a->columns : row ? a->ends[row - 1] : 0;
        count = a->ends ? a->ends[row] - begin : a->columns;
        put_bytes(w, ebpo_ply_type_bytes(p->count_type), count);
    }
    for (uint64_t i = begin; i < begin + count; i++)
        put_bytes(w, bytes, native_bits(a->values + i * bytes, bytes));
}

static void put_row(writing *w, uint64_t row)
{
    const ply_out_property *p = w->layout->property + w->element->first;
    for (uint64_t i = 0; i < w->element->properties; i++, p++) {
        if (p->role == EBPO_PLY_ROLE_NONE)
            put_attribute(w, p, row);
        else if (p->role == EBPO_PLY_ROLE_CORNERS)
            put_corners(w, p, row);
        else
            put_position(w, p, row);
    }
}

static bool write_rows(writing *w)
{
    for (uint64_t i = 0; i < w->layout->elements && !w->failed; i++) {
        w->element = &w->layout->element[i];
        EBPO_FOR_ITEMS(w->mesh->workspace, row, 0, w->element->properties ? w->element->rows : 0) {
            put_row(w, row);
            if (w->failed)
                break;
        }
    }
    flush_buffer(w);
    return !w->failed;
}

ebpo_status ebpo_mesh_write_ply(const ebpo_mesh *mesh, const char *path, ebpo_error *error)
{
    ebpo_publish out = EBPO_PUBLISH_INIT;
    ply_layout layout = { .element = NULL };
    writing w = { .mesh = mesh, .layout = &layout };
    ebpo_status status = check_mesh(mesh, error);
    if (status == EBPO_OK)
        status = make_layout(&layout, mesh, error);
    if (status == EBPO_OK)
        status = ebpo_publish_begin(&out, path, error);
    if (status != EBPO_OK)
        goto done;
    w.buffer = ebpo_alloc(BUFFER, 1);
    w.f = ebpo_publish_stream(&out);
    if (!w.buffer || !w.f) {
        status = ebpo_fail_memory(error, BUFFER);
        goto done;
    }
    if (fwrite(layout.header, 1, layout.header_bytes, w.f) != layout.header_bytes ||
        !write_rows(&w)) {
        status = ebpo_fail_errno(error, path, "could not be written");
        goto done;
    }
    status = ebpo_publish_commit(&out, error);
done:
    ebpo_publish_abort(&out);
    free_layout(&layout);
    free(w.buffer);
    return status;
}
