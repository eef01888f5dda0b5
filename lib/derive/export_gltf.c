/* Writes glTF 2.0, as one file (GLB) or as a text file with a .bin file beside it. Coordinates are
 * float32. If the model is far from the origin, its coordinates are relative to the middle of the
 * root cell, and this middle becomes the translation of the nodes. OBJ and STL are written by
 * assimp. assimp's exporter for glTF is not used, because it joins vertices that are less than 1e-5
 * apart, however small the model is. Source: Khronos, "glTF 2.0 Specification", sections 3 and
 * 4. */
#include "core/strict_fp.h"

#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/endian.h"
#include "core/workspace.h"
#include "core/error.h"
#include "core/text.h"
#include "derive/export_job.h"
#include "io/file_source.h"
#include "io/publish.h"

/* Numbers of the glTF format: FLOAT32, UINT32 and UINT16 are component types; VERTICES and INDICES
 * are targets of buffer views. */
enum {
    BLOCKS_MAX = EBPO_LEVELS_MAX + 1,
    FLOAT32 = 5126,
    UINT32 = 5125,
    UINT16 = 5123,
    VERTICES = 34962,
    INDICES = 34963,
    WORDS_AT_ONCE = 1 << 14 /* size of the buffer of write_words */
};

/* A block (a level or the mesh, export_job.h) with its coordinates. */
typedef struct gltf_block {
    ebpo_block block;      /* xyz has the positions of vertices; block.mesh has none */
    float *xyz;            /* [vertex_count][3] positions minus the origin */
    float low[3], high[3]; /* least and greatest coordinates of xyz */
} gltf_block;

typedef struct model {
    gltf_block blocks[BLOCKS_MAX];
    int count; /* number of blocks */
    /* origin: subtracted from all positions; largest_change: see ebpo_mesh_floats */
    double origin[3], largest_change;
    const char *bin_name; /* name of the file with the binary data; NULL: GLB, one file for all */
} model;

/* --- content --- */

static void find_bounds(gltf_block *p)
{
    for (int k = 0; k < 3; k++)
        p->low[k] = p->high[k] = p->xyz[k];
    for (uint64_t i = 0; i < 3 * p->block.mesh.vertex_count; i++) {
        p->low[i % 3] = fminf(p->low[i % 3], p->xyz[i]);
        p->high[i % 3] = fmaxf(p->high[i % 3], p->xyz[i]);
    }
}

/* The buffer views of a block, in this order; each view has one accessor. A block without colours
 * does not have VIEW_COLOURS. */
enum { VIEW_POSITIONS, VIEW_CORNERS, VIEW_COLOURS, VIEWS };

/* Returns the size of a view; 0 if the block does not have the view. */
static uint64_t view_bytes(const gltf_block *p, int view)
{
    const ebpo_block *block = &p->block;
    return view == VIEW_POSITIONS  ? 12 * block->mesh.vertex_count
           : view == VIEW_CORNERS  ? 12 * block->mesh.face_count
           : block->colours.vertex ? 8 * block->mesh.vertex_count
                                   : 0;
}

/* Returns the index of the first view of block `block`, which is also the index of its first
 * accessor. */
static int first_view(const model *m, int block)
{
    int n = 0;
    for (int i = 0; i < block; i++)
        n += m->blocks[i].block.colours.vertex ? VIEWS : VIEW_COLOURS;
    return n;
}

/* Returns the size of the binary data. */
static uint64_t bin_bytes(const model *m)
{
    uint64_t sum = 0;
    for (int i = 0; i < m->count; i++)
        for (int v = 0; v < VIEWS; v++)
            sum += view_bytes(&m->blocks[i], v);
    return sum;
}

static ebpo_status gather_model(model *m, const ebpo_export_job *job, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    const ebpo_info *info = ebpo_file_info(job->file);
    ebpo_choose_origin(info, m->origin);
    if (!m->bin_name && job->options->mesh) /* the size of the mesh is known before it is read */
        status = ebpo_export_check_glb(job->path, 0, 12 * (info->vertex_count + info->face_count),
                                       error);
    for (int i = 0; i < ebpo_block_count(job->options) && status == EBPO_OK; i++) {
        gltf_block *p = &m->blocks[m->count];
        status = ebpo_export_read_block(job, i, EBPO_SOURCE_ORDER, &p->block, error);
        if (status != EBPO_OK || p->block.mesh.face_count == 0) {
            ebpo_block_free(&p->block);
            continue;
        }
        m->count++;
        /* check the size before the next block is read */
        status = m->bin_name ? EBPO_OK : ebpo_export_check_glb(job->path, 0, bin_bytes(m), error);
        if (status != EBPO_OK)
            return status;
        status = ebpo_mesh_floats(&p->xyz, &p->block.mesh, m->origin, &m->largest_change, error);
        if (status != EBPO_OK)
            return status;
        ebpo_array_free(p->block.mesh.workspace, p->block.mesh.xyz32);
        ebpo_array_free(p->block.mesh.workspace, p->block.mesh.xyz64);
        p->block.mesh.xyz32 = NULL;
        p->block.mesh.xyz64 = NULL;
        find_bounds(p);
    }
    memcpy(job->report->origin, m->origin, sizeof m->origin);
    job->report->largest_change = m->largest_change;
    if (status == EBPO_OK && m->count == 0)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, job->path,
                              "would contain no triangles; choose another level");
    return status;
}

/* --- the text --- */

/* Prints a file name as a URI. Letters, digits and "-._~" are printed unchanged; other bytes are
 * printed as %XX. */
static void print_name(FILE *f, const char *name)
{
    static const char hex[] = "0123456789ABCDEF";
    for (; *name; name++) {
        unsigned char c = (unsigned char)*name;
        if ((c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') ||
            strchr("-._~", c))
            fputc(c, f);
        else
            fprintf(f, "%%%c%c", hex[c >> 4], hex[c & 15]);
    }
}

static void print_mesh(FILE *f, const model *m, int i)
{
    const ebpo_block *block = &m->blocks[i].block;
    int first = first_view(m, i);
    bool coloured = block->colours.vertex != NULL;
    fprintf(f, "%s{\"name\":\"%s\",\"primitives\":[{\"attributes\":{\"POSITION\":%d",
            i ? ",\n" : "", block->name, first);
    if (coloured)
        fprintf(f, ",\"COLOR_0\":%d", first + VIEW_COLOURS);
    fprintf(f, "},\"indices\":%d,\"material\":%d}]}", first + VIEW_CORNERS, coloured);
}

static void print_nodes(FILE *f, const model *m)
{
    const double *o = m->origin;
    fprintf(f, "\"scene\":0,\"scenes\":[{\"nodes\":[");
    for (int i = 0; i < m->count; i++)
        fprintf(f, "%s%d", i ? "," : "", i);
    fprintf(f, "]}],\n\"nodes\":[");
    for (int i = 0; i < m->count; i++) {
        fprintf(f, "%s{\"name\":\"%s\",\"mesh\":%d", i ? ",\n" : "", m->blocks[i].block.name, i);
        if (o[0] != 0 || o[1] != 0 || o[2] != 0)
            ebpo_json_numbers(f, ",\"translation\":", o, 3);
        fputc('}', f);
    }
    fprintf(f, "],\n\"meshes\":[");
    for (int i = 0; i < m->count; i++)
        print_mesh(f, m, i);
    fprintf(f,
            "],\n\"materials\":[{\"name\":\"plain\",\"pbrMetallicRoughness\":{\"baseColorFactor\":["
            "0.6,0.7,0.8,1],\"metallicFactor\":0,\"roughnessFactor\":0.8}}");
    /* Blocks with colours get a material without a base colour, because a base colour would change
     * these colours. */
    if (first_view(m, m->count) > VIEW_COLOURS * m->count)
        fprintf(f, ",\n{\"name\":\"coloured\",\"pbrMetallicRoughness\":{\"metallicFactor\":0,"
                   "\"roughnessFactor\":0.8}}");
    fprintf(f, "],\n");
}

static void print_accessors(FILE *f, const model *m, int i)
{
    const gltf_block *p = &m->blocks[i];
    int first = first_view(m, i);
    const double low[3] = { (double)p->low[0], (double)p->low[1], (double)p->low[2] },
                 high[3] = { (double)p->high[0], (double)p->high[1], (double)p->high[2] };
    fprintf(f, "%s{\"bufferView\":%d,\"componentType\":%d,\"count\":%" PRIu64 ",\"type\":\"VEC3\"",
            i ? ",\n" : "", first, FLOAT32, p->block.mesh.vertex_count);
    ebpo_json_numbers(f, ",\"min\":", low, 3);
    ebpo_json_numbers(f, ",\"max\":", high, 3);
    fprintf(f,
            "},\n{\"bufferView\":%d,\"componentType\":%d,\"count\":%" PRIu64
            ",\"type\":\"SCALAR\"}",
            first + VIEW_CORNERS, UINT32, 3 * p->block.mesh.face_count);
    if (p->block.colours.vertex)
        fprintf(f,
                ",\n{\"bufferView\":%d,\"componentType\":%d,\"normalized\":true,\"count\":%" PRIu64
                ",\"type\":\"VEC4\"}",
                first + VIEW_COLOURS, UINT16, p->block.mesh.vertex_count);
}

static void print_data(FILE *f, const model *m)
{
    uint64_t at = 0;
    fprintf(f, "\"accessors\":[");
    for (int i = 0; i < m->count; i++)
        print_accessors(f, m, i);
    fprintf(f, "],\n\"bufferViews\":[");
    for (int i = 0; i < m->count; i++) {
        for (int k = 0; k < VIEWS; k++) {
            uint64_t size = view_bytes(&m->blocks[i], k);
            if (size)
                fprintf(f,
                        "%s{\"buffer\":0,\"byteOffset\":%" PRIu64 ",\"byteLength\":%" PRIu64
                        ",\"target\":%d}",
                        at ? ",\n" : "", at, size, k == VIEW_CORNERS ? INDICES : VERTICES);
            at += size;
        }
    }
    fprintf(f, "],\n\"buffers\":[{\"byteLength\":%" PRIu64, at);
    if (m->bin_name) {
        fprintf(f, ",\"uri\":\"");
        print_name(f, m->bin_name);
        fputc('"', f);
    }
    fprintf(f, "}]");
}

static void print_text(FILE *f, const model *m)
{
    fprintf(f, "{\"asset\":{\"version\":\"2.0\",\"generator\":\"ebpo %s\"},\n", ebpo_version());
    print_nodes(f, m);
    print_data(f, m);
    fprintf(f, "}\n");
}

/* --- the binary data --- */

/* Writes 32-bit words as little-endian. */
static void write_words(FILE *f, const void *words, uint64_t count)
{
    uint8_t buffer[4 * WORDS_AT_ONCE];
    const uint8_t *from = words;
    for (uint64_t done = 0; done < count;) {
        size_t n = count - done < WORDS_AT_ONCE ? (size_t)(count - done) : WORDS_AT_ONCE;
        for (size_t i = 0; i < n; i++) {
            uint32_t word;
            memcpy(&word, from + 4 * (done + i), 4);
            ebpo_store32(buffer + 4 * i, word);
        }
        fwrite(buffer, 4, n, f); /* write_files checks ferror */
        done += n;
    }
}

/* Writes colours as the attribute COLOR_0. COLOR_0 is linear, but the colours of a mesh are sRGB.
 * With 16 bits, all 256 values stay distinct after the conversion. */
static void write_colours(FILE *f, const uint8_t *rgba, uint64_t count)
{
    uint16_t linear[256];
    ebpo_linear_colours(linear);
    for (uint64_t i = 0; i < count; i++, rgba += 4) {
        uint8_t row[8];
        for (int k = 0; k < 4; k++)
            ebpo_store16(row + 2 * k, k < 3 ? linear[rgba[k]] : (uint16_t)(257 * rgba[k]));
        fwrite(row, 1, sizeof row, f);
    }
}

static void write_bin(FILE *f, const model *m)
{
    for (int i = 0; i < m->count; i++) {
        write_words(f, m->blocks[i].xyz, 3 * m->blocks[i].block.mesh.vertex_count);
        write_words(f, m->blocks[i].block.mesh.faces, 3 * m->blocks[i].block.mesh.face_count);
        if (m->blocks[i].block.colours.vertex)
            write_colours(f, m->blocks[i].block.colours.vertex,
                          m->blocks[i].block.mesh.vertex_count);
    }
}

/* --- the files --- */

static ebpo_status write_glb(FILE *f, const model *m, const char *path, ebpo_error *error)
{
    ebpo_text_stream t;
    if (!ebpo_text_stream_begin(&t))
        return ebpo_fail_memory(error, BUFSIZ);
    print_text(t.file, m);
    if (!ebpo_text_stream_end(&t))
        return ebpo_fail_memory(error, t.bytes);
    char *text = t.text;
    uint64_t length = t.bytes;
    size_t padding = -length & 3;
    uint64_t bin = bin_bytes(m), total = EBPO_GLB_HEADS + length + padding + bin;
    ebpo_status status = ebpo_export_check_glb(path, length, bin, error);
    if (status != EBPO_OK) {
        free(text);
        return status;
    }
    const uint32_t head[5] = { 0x46546C67 /* glTF */, 2, (uint32_t)total,
                               (uint32_t)(length + padding), 0x4E4F534A /* JSON */ };
    const uint32_t bin_head[2] = { (uint32_t)bin, 0x004E4942 /* BIN */ };
    write_words(f, head, 5);
    fwrite(text, 1, length, f);
    fwrite("   ", 1, padding, f);
    write_words(f, bin_head, 2);
    write_bin(f, m);
    free(text);
    return EBPO_OK;
}

static ebpo_status write_files(const model *m, const ebpo_export_job *job, ebpo_publish *main_file,
                               ebpo_publish *bin_file, ebpo_error *error)
{
    FILE *f = ebpo_publish_stream(main_file),
         *b = m->bin_name ? ebpo_publish_stream(bin_file) : NULL;
    ebpo_status status = EBPO_OK;
    if (!f || (m->bin_name && !b))
        return ebpo_fail_memory(error, BUFSIZ);
    if (b) {
        write_bin(b, m);
        print_text(f, m);
    } else {
        status = write_glb(f, m, job->path, error);
    }
    if (status == EBPO_OK && b && (ferror(b) || fflush(b) != 0))
        status = ebpo_fail_errno(error, job->second, "could not be written");
    if (status == EBPO_OK && (ferror(f) || fflush(f) != 0))
        status = ebpo_fail_errno(error, job->path, "could not be written");
    if (status != EBPO_OK)
        return status;
    return b ? ebpo_publish_commit_pair(bin_file, main_file, error)
             : ebpo_publish_commit(main_file, error);
}

ebpo_status ebpo_export_gltf(const ebpo_export_job *job, ebpo_error *error)
{
    ebpo_publish main_file = EBPO_PUBLISH_INIT, bin_file = EBPO_PUBLISH_INIT;
    model *m = ebpo_alloc_zero(1, sizeof *m);
    if (!m)
        return ebpo_fail_memory(error, sizeof *m);
    m->bin_name = *job->second ? ebpo_path_name(job->second) : NULL;
    /* Begins the files before the work, so that a folder without write permission is reported at
     * once. */
    ebpo_status status = ebpo_publish_begin(&main_file, job->path, error);
    if (status == EBPO_OK && m->bin_name)
        status = ebpo_publish_begin(&bin_file, job->second, error);
    if (status == EBPO_OK)
        status = gather_model(m, job, error);
    if (status == EBPO_OK)
        status = write_files(m, job, &main_file, &bin_file, error);
    ebpo_publish_abort(&bin_file);
    ebpo_publish_abort(&main_file);
    for (int i = 0; i < m->count; i++) {
        ebpo_block_free(&m->blocks[i].block);
        free(m->blocks[i].xyz);
    }
    free(m);
    return status;
}
