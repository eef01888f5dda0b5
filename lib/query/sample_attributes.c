/* Samples attributes (such as temperatures) at points on faces. Attributes of vertices are
 * interpolated at the point's position on its face; attributes of faces are returned as stored.
 *
 * A sampler reads the requested columns once, and then evaluates any number of points. ebpo/query.h
 * documents the exactness of results. */
#include "core/strict_fp.h"

#include <ebpo/query.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "format/file_in.h"
#include "geometry/vec3.h"
#include "mesh/attributes.h"
#include "query/sample_attributes.h"

/* A requested column of an attribute. */
typedef struct sampled {
    const ebpo_attribute *head; /* attribute of the file */
    unsigned array, column;     /* index of the attribute in the file; index of its column */
    bool of_vertices;           /* the attribute belongs to vertices; false: to faces */
    /* this item must free `values`; later items may use the same values */
    bool owner;
    ebpo_attribute_values values;
} sampled;

struct ebpo_sampler {
    const ebpo_file *file;
    ebpo_mesh mesh;      /* read if any attribute belongs to vertices; else empty */
    uint32_t *file_face; /* [source_indices] file index of each face of the source (the mesh that
                          * was converted); UINT32_MAX: the file does not have the face; NULL: both
                          * indices are the same */
    uint64_t source_indices; /* greatest source index of a face, plus 1 */
    unsigned count;
    sampled item[EBPO_SAMPLER_MAX];
};

/* --- choice of attributes --- */

/* A requested column: NAME or ELEMENT:NAME. `text` is the whole request; all three pointers point
 * into a longer string. */
typedef struct wanted {
    const char *text, *element, *name;
    size_t bytes, element_bytes, name_bytes; /* element_bytes 0: any element */
} wanted;

/* Parses the requested column at the beginning of the text, up to the next comma or to the end. */
static wanted next_wanted(const char *text)
{
    wanted w = { .text = text, .bytes = strcspn(text, ",") };
    const char *colon = memchr(text, ':', w.bytes);
    w.element = text;
    w.element_bytes = colon ? (size_t)(colon - text) : 0;
    w.name = colon ? colon + 1 : text;
    w.name_bytes = w.bytes - (size_t)(w.name - text);
    return w;
}

/* Returns the index of the column with this name, or -1. names: separated by blanks. */
static int column_named(const char *names, const wanted *w)
{
    for (int column = 0; *names; column++) {
        size_t bytes = strcspn(names, " ");
        if (bytes == w->name_bytes && memcmp(names, w->name, bytes) == 0)
            return column;
        names += bytes + (names[bytes] == ' ');
    }
    return -1;
}

/* Returns true if the attribute belongs to this element, and the caller requested this element. */
static bool of_element(const ebpo_attribute *head, const wanted *w, const char *element)
{
    return ebpo_attribute_is_of(head, element) &&
           (!w->element_bytes || (strlen(element) == w->element_bytes &&
                                  memcmp(element, w->element, w->element_bytes) == 0));
}

/* Finds the column among the attributes of an element. Returns false if the column is absent or a
 * list. */
static bool find_column(const ebpo_file *file, const wanted *w, const char *element, sampled *out)
{
    for (unsigned n = 0; n < file->attributes.count; n++) {
        const ebpo_attribute *head = &file->attributes.head[n].head;
        int column = of_element(head, w, element) ? column_named(head->names, w) : -1;
        if (column < 0 || head->list != EBPO_ATTRIBUTE_NO_LIST)
            continue;
        *out = (sampled){ .head = head, .array = n, .column = (unsigned)column };
        out->of_vertices = strcmp(element, "vertex") == 0;
        return true;
    }
    return false;
}

static ebpo_status choose_columns(ebpo_sampler *s, const char *names, ebpo_error *error)
{
    const char *shown = s->file->in.shown, *at = names;
    for (bool more = true; more;) {
        wanted w = next_wanted(at);
        sampled item;
        if (!find_column(s->file, &w, "vertex", &item) && !find_column(s->file, &w, "face", &item))
            return ebpo_fail_file(error, EBPO_E_ABSENT, shown,
                                  "vertices and faces have no attribute '%.*s', or it is a list; "
                                  "'ebpo info' lists the attributes of the file",
                                  (int)(w.bytes < 100 ? w.bytes : 100), w.text);
        if (s->count == EBPO_SAMPLER_MAX)
            return ebpo_fail_file(error, EBPO_E_ARGUMENT, shown,
                                  "too many attributes; give at most %d at a time",
                                  EBPO_SAMPLER_MAX);
        s->item[s->count++] = item;
        more = at[w.bytes] == ',';
        at += w.bytes + 1;
    }
    return EBPO_OK;
}

/* --- reading --- */

/* Reads each requested attribute once. */
static ebpo_status read_values(ebpo_sampler *s, const ebpo_read_options *read, ebpo_error *error)
{
    for (unsigned i = 0; i < s->count; i++) {
        sampled *item = &s->item[i];
        unsigned k = 0;
        while (s->item[k].array != item->array)
            k++;
        item->values = s->item[k].values;
        if (k < i)
            continue;
        ebpo_status status =
            ebpo_file_read_attribute(s->file, item->array, read, &item->values, error);
        if (status != EBPO_OK)
            return status;
        item->owner = true;
    }
    return EBPO_OK;
}

static ebpo_status read_mesh(ebpo_sampler *s, const ebpo_read_options *read, ebpo_error *error)
{
    bool needed = false;
    for (unsigned i = 0; i < s->count; i++)
        needed = needed || s->item[i].of_vertices;
    return needed ? ebpo_file_read_mesh(s->file, read, &s->mesh, error) : EBPO_OK;
}

/* Makes `file_face`, because callers give source indices of faces. */
static ebpo_status invert_map(ebpo_sampler *s, const ebpo_read_options *read, ebpo_error *error)
{
    uint64_t faces = s->file->info.face_count;
    ebpo_maps maps;
    s->source_indices = faces;
    if (!(s->file->info.parts & EBPO_PART_MAPS))
        return EBPO_OK;
    ebpo_status status = ebpo_file_read_maps(s->file, read, &maps, error);
    if (status != EBPO_OK)
        return status;
    for (uint64_t f = 0; f < faces; f++)
        if (maps.face_source[f] >= s->source_indices)
            s->source_indices = maps.face_source[f] + UINT64_C(1);
    s->file_face = ebpo_alloc(s->source_indices, sizeof *s->file_face);
    if (s->file_face) {
        memset(s->file_face, 0xff, s->source_indices * sizeof *s->file_face);
        for (uint64_t f = 0; f < faces; f++)
            s->file_face[maps.face_source[f]] = (uint32_t)f;
    } else {
        status = ebpo_fail_memory(error, s->source_indices * sizeof *s->file_face);
    }
    ebpo_maps_free(&maps);
    return status;
}

ebpo_status ebpo_sampler_new(const ebpo_file *file, const char *names, unsigned threads,
                             ebpo_sampler **out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_sampler *s = *out = ebpo_alloc_zero(1, sizeof *s);
    if (!s)
        return ebpo_fail_memory(error, sizeof *s);
    read.threads = threads;
    s->file = file;
    ebpo_status status = choose_columns(s, names, error);
    if (status == EBPO_OK)
        status = read_values(s, &read, error);
    if (status == EBPO_OK)
        status = read_mesh(s, &read, error);
    if (status == EBPO_OK)
        status = invert_map(s, &read, error);
    if (status != EBPO_OK) {
        ebpo_sampler_free(s);
        *out = NULL;
    }
    return status;
}

void ebpo_sampler_free(ebpo_sampler *s)
{
    if (!s)
        return;
    for (unsigned i = 0; i < s->count; i++)
        if (s->item[i].owner)
            ebpo_attribute_values_free(&s->item[i].values);
    ebpo_mesh_free(&s->mesh);
    free(s->file_face);
    free(s);
}

unsigned ebpo_sampler_columns(const ebpo_sampler *s) { return s->count; }

/* --- weights --- */

static double clamp_to(double v, double least, double greatest)
{
    return v < least ? least : v > greatest ? greatest : v;
}

/* Returns the exponent of the largest absolute value of `count` numbers; 0 if all are 0. */
static int greatest_exponent(const double *v, int count)
{
    double greatest = 0;
    for (int i = 0; i < count; i++)
        greatest = fabs(v[i]) > greatest ? fabs(v[i]) : greatest;
    return greatest > 0 ? ilogb(greatest) : 0;
}

static void scale_by_power(double *v, int count, int by)
{
    for (int i = 0; i < count; i++)
        v[i] = scalbn(v[i], by);
}

/* Computes e[0] = b - a, e[1] = c - a and e[2] = p - a for the corners a, b, c. The three vectors
 * are scaled by a power of two so that the largest coordinate of e[0] and e[1] is 1 to 2. */
static void edges_of(const double corner[3][3], const double p[3], double e[3][3])
{
    double at[4][3];
    memcpy(at, corner, 3 * sizeof *at);
    memcpy(at[3], p, sizeof *at);
    scale_by_power(at[0], 12, -greatest_exponent(at[0], 9));
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            e[i][k] = at[i + 1][k] - at[0][k];
    scale_by_power(e[0], 9, -greatest_exponent(e[0], 6));
}

/* Computes weights for a face without area, by the position along the longest edge. e: result of
 * edges_of. */
static void weigh_edge(const double e[3][3], double weight[3])
{
    static const int from[3] = { 0, 0, 1 }, to[3] = { 1, 2, 2 };
    double third[3], beyond[3];
    for (int k = 0; k < 3; k++) {
        third[k] = e[1][k] - e[0][k];
        beyond[k] = e[2][k] - e[0][k];
    }
    const double *edges[3] = { e[0], e[1], third };
    int longest = 0;
    for (int i = 1; i < 3; i++)
        if (ebpo_vec3_dot(edges[i], edges[i]) > ebpo_vec3_dot(edges[longest], edges[longest]))
            longest = i;
    double length2 = ebpo_vec3_dot(edges[longest], edges[longest]);
    double along = ebpo_vec3_dot(longest == 2 ? beyond : e[2], edges[longest]);
    double t = length2 > 0 ? clamp_to(along / length2, 0, 1) : 0;
    weight[0] = weight[1] = weight[2] = 0;
    weight[from[longest]] = 1 - t;
    weight[to[longest]] = t;
}

void ebpo_weigh_corners(const double corner[3][3], const double p[3], double weight[3])
{
    double e[3][3];
    edges_of(corner, p, e);
    double bb = ebpo_vec3_dot(e[0], e[0]), bc = ebpo_vec3_dot(e[0], e[1]),
           cc = ebpo_vec3_dot(e[1], e[1]), pb = ebpo_vec3_dot(e[2], e[0]),
           pc = ebpo_vec3_dot(e[2], e[1]), det = bb * cc - bc * bc;
    if (!(det > 0x1p-900)) {
        weigh_edge((const double(*)[3])e, weight);
        return;
    }
    double b = clamp_to((cc * pb - bc * pc) / det, 0, INFINITY),
           c = clamp_to((bb * pc - bc * pb) / det, 0, INFINITY), a = clamp_to(1 - b - c, 0, 1),
           sum = a + b + c;
    weight[0] = a / sum;
    weight[1] = b / sum;
    weight[2] = c / sum;
}

double ebpo_blend_values(const double weight[3], const double value[3])
{
    double sum = 0, least = INFINITY, most = -INFINITY;
    for (int k = 0; k < 3; k++) {
        if (!(weight[k] > 0))
            continue;
        sum += weight[k] * value[k];
        least = value[k] < least ? value[k] : least;
        most = value[k] > most ? value[k] : most;
    }
    return clamp_to(sum, least, most);
}

/* --- results --- */

static void corners_of(const ebpo_mesh *mesh, const uint32_t *face, double corner[3][3])
{
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            uint64_t at = 3 * (uint64_t)face[i] + (uint64_t)k;
            corner[i][k] = mesh->xyz32 ? (double)mesh->xyz32[at] : mesh->xyz64[at];
        }
}

/* Returns the value of a column in the row of a vertex or face. */
static double value_of(const sampled *item, uint64_t row)
{
    const uint8_t *values = item->values.values;
    uint64_t index = row * item->head->columns + item->column;
    return ebpo_attribute_number(values + index * ebpo_attribute_bytes(item->head->type),
                                 item->head->type);
}

/* Computes all requested values at a point of face f (file index). */
static void sample_face(const ebpo_sampler *s, uint64_t f, const double point[3], double *out)
{
    const uint32_t *face = s->mesh.faces ? s->mesh.faces + 3 * f : NULL;
    double corner[3][3], weight[3] = { 1, 0, 0 };
    if (face) {
        corners_of(&s->mesh, face, corner);
        ebpo_weigh_corners((const double(*)[3])corner, point, weight);
    }
    for (unsigned i = 0; i < s->count; i++) {
        const sampled *item = &s->item[i];
        double value[3] = { 0, 0, 0 };
        for (int k = 0; k < 3 && item->of_vertices; k++)
            value[k] = value_of(item, face[k]);
        out[i] = item->of_vertices ? ebpo_blend_values(weight, value) : value_of(item, f);
    }
}

/* Converts a source index of a face to its index in the file. Returns UINT64_MAX if the file does
 * not have the face. */
static uint64_t face_in_file(const ebpo_sampler *s, uint64_t source_face)
{
    if (source_face >= s->source_indices)
        return UINT64_MAX;
    return !s->file_face                             ? source_face
           : s->file_face[source_face] == UINT32_MAX ? UINT64_MAX
                                                     : s->file_face[source_face];
}

ebpo_status ebpo_sample(const ebpo_sampler *s, const double *points, const uint64_t *faces,
                        uint64_t count, double *values, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    for (uint64_t i = 0; i < count; i++, points += 3, values += s->count) {
        uint64_t f = face_in_file(s, faces[i]);
        if (faces[i] == EBPO_NO_FACE) {
            for (unsigned k = 0; k < s->count; k++)
                values[k] = NAN;
            continue;
        }
        if (f == UINT64_MAX)
            return ebpo_fail_file(error, EBPO_E_ARGUMENT, s->file->in.shown,
                                  "point %llu: the file has no face %llu", (unsigned long long)i,
                                  (unsigned long long)faces[i]);
        if (!isfinite(points[0]) || !isfinite(points[1]) || !isfinite(points[2]))
            return ebpo_fail(error, EBPO_E_ARGUMENT, "point %llu is not finite",
                             (unsigned long long)i);
        sample_face(s, f, points, values);
    }
    return EBPO_OK;
}
