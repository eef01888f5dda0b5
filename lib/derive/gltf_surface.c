/* Writes a surface as GLB. Vertices are numbered in the order of their first use, and vertices
 * without triangles are omitted. The arrays are compressed. The buffer view of an array states the
 * position of the compressed array in the file's buffer. As EXT_meshopt_compression requires, it
 * also states the position of the decoded array in a second buffer, which is not stored. Sources:
 * Khronos, "glTF 2.0 Specification" and the extensions KHR_mesh_quantization and
 * EXT_meshopt_compression. */
#include "core/strict_fp.h"

#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/endian.h"
#include "core/error.h"
#include "core/text.h"
#include "derive/export_job.h"
#include "derive/gltf_surface.h"
#include "derive/meshopt_codec.h"

/* Numbers of the glTF format: component types, and targets of buffer views. */
enum { BYTE = 5120, SHORT_UNSIGNED = 5123, INT_UNSIGNED = 5125, FLOAT = 5126 };
enum { TARGET_VERTICES = 34962, TARGET_INDICES = 34963 };

enum { POSITIONS, NORMALS, COLOURS, INDICES, ARRAYS };
enum { STEPS_MAX = 65535, SHORT_VERTICES_MAX = 65535 };

typedef struct gltf_array {
    uint64_t count;  /* number of elements; 0: the array is absent */
    unsigned stride; /* bytes of an element */
    uint8_t *encoded;
    uint64_t bytes;                /* number of encoded bytes */
    uint64_t first, decoded_first; /* positions in the two buffers */
} gltf_array;

typedef struct gltf_writer {
    const ebpo_gltf_surface *surface;
    ebpo_gltf_written *out;
    uint32_t *vertex; /* [out->vertices] vertices of the surface in the order of their first use */
    uint32_t *index;  /* [triangle_count][3] positions in `vertex` */
    bool quantized;
    double step[3], low[3]; /* step and low corner of the grid; low is relative to the origin */
    double stored_min[3], stored_max[3];
    gltf_array array[ARRAYS];
    uint64_t bytes, decoded_bytes; /* sizes of the two buffers */
} gltf_writer;

/* --- vertices --- */

static ebpo_status number_vertices(gltf_writer *w, ebpo_error *error)
{
    const ebpo_gltf_surface *s = w->surface;
    uint32_t *number = ebpo_alloc(s->vertex_count, sizeof *number);
    w->vertex = ebpo_alloc(s->vertex_count, sizeof *w->vertex);
    w->index = ebpo_alloc(s->triangle_count, 3 * sizeof *w->index);
    if (!number || !w->vertex || !w->index) {
        free(number);
        return ebpo_fail_memory(error, (s->vertex_count * 2 + s->triangle_count * 3) * 4);
    }
    memset(number, 0xff, s->vertex_count * sizeof *number);
    for (uint64_t i = 0; i < 3 * s->triangle_count; i++) {
        uint32_t v = s->triangles[i];
        if (number[v] == UINT32_MAX) {
            number[v] = (uint32_t)w->out->vertices;
            w->vertex[w->out->vertices++] = v;
        }
        w->index[i] = number[v];
    }
    free(number);
    return EBPO_OK;
}

static const double *position_of(const gltf_writer *w, uint64_t i)
{
    return w->surface->xyz + 3 * (uint64_t)w->vertex[i];
}

/* Sets the steps and the low corner of the grid so that all positions fit into 16 bits. */
static void choose_grid(gltf_writer *w)
{
    const ebpo_gltf_surface *s = w->surface;
    for (int k = 0; k < 3; k++) {
        double low = INFINITY, high = -INFINITY, step = s->step[k];
        for (uint64_t i = 0; i < w->out->vertices; i++) {
            low = fmin(low, position_of(w, i)[k]);
            high = fmax(high, position_of(w, i)[k]);
        }
        while (floor((high - s->grid[k]) / step + 0.5) - floor((low - s->grid[k]) / step + 0.5) >
               STEPS_MAX)
            step *= 2;
        w->step[k] = step;
        w->low[k] = s->grid[k] - s->origin[k] + floor((low - s->grid[k]) / step + 0.5) * step;
    }
}

static void add_bounds(gltf_writer *w, const double stored[3], const double decoded[3],
                       const double exact[3], bool first)
{
    double square = 0;
    for (int k = 0; k < 3; k++) {
        w->stored_min[k] = first ? stored[k] : fmin(w->stored_min[k], stored[k]);
        w->stored_max[k] = first ? stored[k] : fmax(w->stored_max[k], stored[k]);
        w->out->min[k] = first ? decoded[k] : fmin(w->out->min[k], decoded[k]);
        w->out->max[k] = first ? decoded[k] : fmax(w->out->max[k], decoded[k]);
        square += (decoded[k] - exact[k]) * (decoded[k] - exact[k]);
    }
    w->out->change = fmax(w->out->change, sqrt(square));
}

/* Stores the positions as 16-bit numbers of steps, or as floats. */
static ebpo_status fill_positions(gltf_writer *w, uint8_t *to, ebpo_error *error)
{
    const ebpo_gltf_surface *s = w->surface;
    unsigned stride = w->array[POSITIONS].stride;
    for (uint64_t i = 0; i < w->out->vertices; i++, to += stride) {
        double exact[3], stored[3], decoded[3];
        for (int k = 0; k < 3; k++) {
            exact[k] = position_of(w, i)[k] - s->origin[k];
            if (w->quantized) {
                stored[k] =
                    fmin(fmax(floor((exact[k] - w->low[k]) / w->step[k] + 0.5), 0), STEPS_MAX);
                decoded[k] = w->low[k] + stored[k] * w->step[k];
                ebpo_store16(to + 2 * k, (uint16_t)stored[k]);
            } else {
                float single = (float)exact[k];
                uint32_t bits;
                memcpy(&bits, &single, sizeof bits);
                ebpo_store32(to + 4 * k, bits);
                stored[k] = decoded[k] = (double)single;
            }
            if (!isfinite(decoded[k]) || fabs(decoded[k]) > FLT_MAX)
                return ebpo_fail(error, EBPO_E_LIMIT,
                                 "a coordinate of %g exceeds the range of float32; scale the model",
                                 exact[k]);
        }
        add_bounds(w, stored, decoded, exact, i == 0);
    }
    return EBPO_OK;
}

/* Stores normals as signed bytes. If positions are stored as numbers of steps, the glTF node scales
 * positions by the steps, and readers divide normals by the steps. Therefore this function
 * multiplies normals by the steps. */
static void fill_normals(const gltf_writer *w, uint8_t *to)
{
    for (uint64_t i = 0; i < w->out->vertices; i++, to += 4) {
        double n[3], length = 0;
        for (int k = 0; k < 3; k++) {
            n[k] = (double)w->surface->normals[3 * (uint64_t)w->vertex[i] + (uint64_t)k] *
                   (w->quantized ? w->step[k] / w->step[0] : 1);
            length += n[k] * n[k];
        }
        length = sqrt(length);
        for (int k = 0; k < 3; k++)
            to[k] = (uint8_t)(int8_t)floor((length > 0 ? n[k] / length : k == 2) * 127 + 0.5);
    }
}

/* COLOR_0 is linear and has 16 bits, so that all 256 values of sRGB stay distinct. */
static void fill_colours(const gltf_writer *w, uint8_t *to)
{
    uint16_t linear[256];
    ebpo_linear_colours(linear);
    for (uint64_t i = 0; i < w->out->vertices; i++, to += 8) {
        const uint8_t *from =
            w->surface->colours + w->surface->colour_bytes * (uint64_t)w->vertex[i];
        for (int k = 0; k < 3; k++)
            ebpo_store16(to + 2 * k, linear[from[k]]);
        ebpo_store16(to + 6, (uint16_t)(257 * (w->surface->colour_bytes == 4 ? from[3] : 255)));
    }
}

/* --- encoding --- */

/* Places an array after the previous arrays in both buffers. */
static void place_array(gltf_writer *w, gltf_array *a)
{
    a->first = w->bytes;
    a->decoded_first = w->decoded_bytes;
    w->bytes += (a->bytes + 3) / 4 * 4;
    w->decoded_bytes += (a->count * a->stride + 3) / 4 * 4;
}

static ebpo_status encode_vertices(gltf_writer *w, int which, unsigned stride, ebpo_error *error)
{
    gltf_array *a = &w->array[which];
    *a = (gltf_array){ .count = w->out->vertices, .stride = stride };
    uint8_t *elements = ebpo_alloc_zero(a->count, stride);
    a->encoded = ebpo_alloc(ebpo_meshopt_attributes_bound(a->count, stride), 1);
    ebpo_status status =
        elements && a->encoded ? EBPO_OK : ebpo_fail_memory(error, 2 * a->count * stride);
    if (status == EBPO_OK && which == POSITIONS)
        status = fill_positions(w, elements, error);
    if (status == EBPO_OK && which == NORMALS)
        fill_normals(w, elements);
    if (status == EBPO_OK && which == COLOURS)
        fill_colours(w, elements);
    if (status == EBPO_OK) {
        a->bytes = ebpo_meshopt_attributes(elements, a->count, stride, a->encoded);
        place_array(w, a);
    }
    free(elements);
    return status;
}

static ebpo_status encode_arrays(gltf_writer *w, ebpo_error *error)
{
    const ebpo_gltf_surface *s = w->surface;
    w->quantized = s->step[0] > 0;
    ebpo_status status = EBPO_OK;
    if (w->quantized) {
        choose_grid(w);
        double finest = fmin(w->step[0], fmin(w->step[1], w->step[2]));
        if (finest < (double)FLT_MIN) /* readers would round the scale of the node to 0 */
            status = ebpo_fail(error, EBPO_E_LIMIT,
                               "the grid of the vertices has steps of %g, which are too small for "
                               "float32; scale the model",
                               finest);
    }
    if (status == EBPO_OK)
        status = encode_vertices(w, POSITIONS, w->quantized ? 8 : 12, error);
    if (status == EBPO_OK)
        status = encode_vertices(w, NORMALS, 4, error);
    if (status == EBPO_OK && s->colours)
        status = encode_vertices(w, COLOURS, 8, error);
    if (status != EBPO_OK)
        return status;
    gltf_array *a = &w->array[INDICES];
    a->count = 3 * s->triangle_count;
    a->stride = w->out->vertices > SHORT_VERTICES_MAX ? 4 : 2;
    a->encoded = ebpo_alloc(ebpo_meshopt_triangles_bound(s->triangle_count), 1);
    if (!a->encoded)
        return ebpo_fail_memory(error, ebpo_meshopt_triangles_bound(s->triangle_count));
    a->bytes = ebpo_meshopt_triangles(w->index, s->triangle_count, a->encoded);
    place_array(w, a);
    return EBPO_OK;
}

/* --- the JSON text --- */

static void print_matrix(FILE *f, const gltf_writer *w)
{
    double scale[3] = { 1, 1, 1 }, at[3] = { 0, 0, 0 }, m[16] = { 0 };
    for (int k = 0; k < 3 && w->quantized; k++) {
        scale[k] = w->step[k];
        at[k] = w->low[k];
    }
    /* stored column by column; `rotates`: (x, y, z) becomes (x, z, -y) */
    m[0] = scale[0];
    m[w->surface->rotates ? 6 : 5] = w->surface->rotates ? -scale[1] : scale[1];
    m[w->surface->rotates ? 9 : 10] = scale[2];
    m[12] = at[0];
    m[13] = w->surface->rotates ? at[2] : at[1];
    m[14] = w->surface->rotates ? -at[1] : at[2];
    m[15] = 1;
    ebpo_json_numbers(f, ",\"matrix\":", m, 16);
}

static void print_accessors(FILE *f, const gltf_writer *w)
{
    static const char *const type[ARRAYS] = { "VEC3", "VEC3", "VEC4", "SCALAR" };
    const int component[ARRAYS] = { w->quantized ? SHORT_UNSIGNED : FLOAT, BYTE, SHORT_UNSIGNED,
                                    w->array[INDICES].stride == 4 ? INT_UNSIGNED : SHORT_UNSIGNED };
    int view = 0;
    fprintf(f, "\"accessors\":[");
    for (int i = 0; i < ARRAYS; i++) {
        if (!w->array[i].count)
            continue;
        fprintf(f,
                "%s{\"bufferView\":%d,\"componentType\":%d,\"count\":%" PRIu64 ",\"type\":\"%s\"",
                view ? ",\n" : "", view, component[i], w->array[i].count, type[i]);
        if (i == NORMALS || i == COLOURS)
            fprintf(f, ",\"normalized\":true");
        if (i == POSITIONS) {
            ebpo_json_numbers(f, ",\"min\":", w->stored_min, 3);
            ebpo_json_numbers(f, ",\"max\":", w->stored_max, 3);
        }
        fputc('}', f);
        view++;
    }
    fprintf(f, "],\n");
}

static void print_views(FILE *f, const gltf_writer *w)
{
    bool first = true;
    fprintf(f, "\"bufferViews\":[");
    for (int i = 0; i < ARRAYS; i++) {
        const gltf_array *a = &w->array[i];
        if (!a->count)
            continue;
        fprintf(f, "%s{\"buffer\":1,\"byteOffset\":%" PRIu64 ",\"byteLength\":%" PRIu64,
                first ? "" : ",\n", a->decoded_first, a->count * a->stride);
        if (i != INDICES)
            fprintf(f, ",\"byteStride\":%u", a->stride);
        fprintf(f,
                ",\"target\":%d,\"extensions\":{\"EXT_meshopt_compression\":{\"buffer\":0,"
                "\"byteOffset\":%" PRIu64 ",\"byteLength\":%" PRIu64 ",\"byteStride\":%u,"
                "\"count\":%" PRIu64 ",\"mode\":\"%s\"}}}",
                i == INDICES ? TARGET_INDICES : TARGET_VERTICES, a->first, a->bytes, a->stride,
                a->count, i == INDICES ? "TRIANGLES" : "ATTRIBUTES");
        first = false;
    }
    fprintf(f,
            "],\n\"buffers\":[{\"byteLength\":%" PRIu64 "},{\"byteLength\":%" PRIu64
            ",\"extensions\":{\"EXT_meshopt_compression\":{\"fallback\":true}}}]",
            w->bytes, w->decoded_bytes);
}

static void print_text(FILE *f, const gltf_writer *w)
{
    static const char extensions[] = "[\"KHR_mesh_quantization\",\"EXT_meshopt_compression\"]";
    bool coloured = w->array[COLOURS].count > 0;
    fprintf(f,
            "{\"asset\":{\"version\":\"2.0\",\"generator\":\"ebpo %s\"},\n\"extensionsUsed\":%s,\n"
            "\"extensionsRequired\":%s,\n\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\n"
            "\"nodes\":[{\"name\":\"%s\",\"mesh\":0",
            ebpo_version(), extensions, extensions, w->surface->name);
    print_matrix(f, w);
    fprintf(f,
            "}],\n\"meshes\":[{\"name\":\"%s\",\"primitives\":[{\"attributes\":{\"POSITION\":0,"
            "\"NORMAL\":1%s},\"indices\":%d,\"material\":0}]}],\n\"materials\":[{"
            "\"pbrMetallicRoughness\":{%s\"metallicFactor\":0,\"roughnessFactor\":0.8}}],\n",
            w->surface->name, coloured ? ",\"COLOR_0\":2" : "", coloured ? 3 : 2,
            coloured ? "" : "\"baseColorFactor\":[0.6,0.7,0.8,1],");
    print_accessors(f, w);
    print_views(f, w);
    fprintf(f, "}\n");
}

/* --- the file --- */

static void write_number(FILE *f, uint32_t number)
{
    uint8_t bytes[4];
    ebpo_store32(bytes, number);
    fwrite(bytes, 1, sizeof bytes, f);
}

static ebpo_status write_parts(FILE *f, const char *path, gltf_writer *w, ebpo_error *error)
{
    static const char padding[4] = "";
    ebpo_text_stream t;
    if (!ebpo_text_stream_begin(&t))
        return ebpo_fail_memory(error, BUFSIZ);
    print_text(t.file, w);
    if (!ebpo_text_stream_end(&t))
        return ebpo_fail_memory(error, t.bytes);
    uint64_t text = (t.bytes + 3) / 4 * 4;
    ebpo_status status = ebpo_export_check_glb(path, text, w->bytes, error);
    if (status == EBPO_OK) {
        w->out->bytes = EBPO_GLB_HEADS + text + w->bytes;
        write_number(f, 0x46546C67); /* glTF */
        write_number(f, 2);
        write_number(f, (uint32_t)w->out->bytes);
        write_number(f, (uint32_t)text);
        write_number(f, 0x4E4F534A); /* JSON */
        fwrite(t.text, 1, t.bytes, f);
        fwrite("   ", 1, text - t.bytes, f);
        write_number(f, (uint32_t)w->bytes);
        write_number(f, 0x004E4942); /* BIN */
        for (int i = 0; i < ARRAYS; i++)
            if (w->array[i].count) {
                fwrite(w->array[i].encoded, 1, w->array[i].bytes, f);
                fwrite(padding, 1, -w->array[i].bytes & 3, f);
            }
    }
    free(t.text);
    return status;
}

ebpo_status ebpo_gltf_surface_write(FILE *file, const char *path, const ebpo_gltf_surface *surface,
                                    ebpo_gltf_written *out, ebpo_error *error)
{
    gltf_writer w = { .surface = surface, .out = out };
    memset(out, 0, sizeof *out);
    ebpo_status status = number_vertices(&w, error);
    if (status == EBPO_OK)
        status = encode_arrays(&w, error);
    if (status == EBPO_OK)
        status = write_parts(file, path, &w, error);
    for (int i = 0; i < ARRAYS; i++)
        free(w.array[i].encoded);
    free(w.vertex);
    free(w.index);
    return status;
}
