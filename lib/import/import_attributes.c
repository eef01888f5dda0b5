#include "import/import_attributes.h"

#include "ebpo_config.h"

#if EBPO_HAVE_ASSIMP

#include <assimp/material.h>
#include <assimp/scene.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "attributes/attributes.h"
#include "base/alloc.h"
#include "base/arrays.h"
#include "base/error.h"

enum { MOST_COLUMNS = 3 };

typedef enum sort { COLOURS, NORMALS, TEXTURE, SORTS } sort;

static const struct {
    const char *names, *list_name;
    unsigned columns;
} sorts[SORTS] = { { "red green blue", "color", 3 },
                   { "nx ny nz", "normal", 3 },
                   { "s t", "texcoord", 2 } };

/* The values of a mesh's vertex; false: it has none. */
static bool value_at(const struct aiMesh *m, sort what, unsigned i, float out[MOST_COLUMNS])
{
    const struct aiVector3D *v = what == NORMALS ? m->mNormals : m->mTextureCoords[0];
    if (what == COLOURS) {
        const struct aiColor4D *c = m->mColors[0];
        if (c) {
            out[0] = c[i].r;
            out[1] = c[i].g;
            out[2] = c[i].b;
        }
        return c != NULL;
    }
    if (v) {
        out[0] = v[i].x;
        out[1] = v[i].y;
        out[2] = v[i].z;
    }
    return v != NULL;
}

/* Of all vertices of the scene, one mesh after the other; zeros where a mesh has none. False: no
 * mesh has any, and `values` is as it was. */
static bool gather(const struct aiScene *scene, sort what, float *values)
{
    bool found = false;
    unsigned columns = sorts[what].columns;
    for (unsigned i = 0; i < scene->mNumMeshes; i++) {
        const struct aiMesh *m = scene->mMeshes[i];
        for (unsigned k = 0; k < m->mNumVertices; k++, values += columns) {
            float value[MOST_COLUMNS] = { 0, 0, 0 };
            found |= value_at(m, what, k, value);
            memcpy(values, value, columns * sizeof *values);
        }
    }
    return found;
}

typedef struct placing {
    ebpo_mesh *mesh;
    const ebpo_imported *how;
    const float *values; /* [vertices][columns] */
    size_t bytes;        /* of a vertex's values */
    ebpo_error *error;
} placing;

static ebpo_status add(const placing *p, ebpo_attribute *head, ebpo_attribute **out)
{
    ebpo_workspace *workspace = p->mesh->workspace;
    size_t bytes = head->columns * (size_t)ebpo_attribute_bytes(head->type);
    bool face = strcmp(head->element, "face") == 0;
    head->rows = face ? p->mesh->face_count : p->mesh->vertex_count;
    *out = ebpo_attributes_add(p->mesh->attributes, head);
    if (!*out)
        return ebpo_fail_memory(p->error, sizeof **out);
    (*out)->values = ebpo_array_alloc(workspace, head->rows, bytes);
    return (*out)->values ? EBPO_OK : ebpo_workspace_fail(workspace, head->rows * bytes, p->error);
}

/* Takes away the last one again. */
static void drop(const placing *p)
{
    ebpo_attributes_remove(p->mesh->attributes, p->mesh->attributes->count - 1);
}

static ebpo_attribute head_of(sort what, const char *element)
{
    ebpo_attribute head = { .type = EBPO_ATTRIBUTE_FLOAT32, .list = EBPO_ATTRIBUTE_NO_LIST };
    head.columns = sorts[what].columns;
    snprintf(head.element, sizeof head.element, "%s", element);
    snprintf(head.names, sizeof head.names, "%s", sorts[what].names);
    return head;
}

static const char *value_of(const placing *p, uint64_t vertex)
{
    return (const char *)p->values + vertex * p->bytes;
}

/* *fits: all corners at a vertex say the same. */
static ebpo_status place_on_vertices(const placing *p, sort what, bool *fits)
{
    ebpo_attribute head = head_of(what, "vertex"), *a;
    ebpo_status status = add(p, &head, &a);
    *fits = status == EBPO_OK;
    if (!*fits)
        return status;
    for (uint64_t i = 0; i < p->how->vertices; i++)
        memcpy(a->values + p->how->map[i] * p->bytes, value_of(p, i), p->bytes);
    for (uint64_t i = 0; i < p->how->vertices && *fits; i++)
        *fits = memcmp(a->values + p->how->map[i] * p->bytes, value_of(p, i), p->bytes) == 0;
    if (!*fits)
        drop(p);
    return EBPO_OK;
}

/* *fits: all corners of a face say the same. */
static ebpo_status place_on_faces(const placing *p, sort what, bool *fits)
{
    ebpo_attribute head = head_of(what, "face"), *a;
    ebpo_status status = add(p, &head, &a);
    *fits = status == EBPO_OK;
    for (uint64_t f = 0; f < p->mesh->face_count && *fits; f++) {
        const uint32_t *corner = p->how->corner + 3 * f;
        const char *first = value_of(p, corner[0]);
        *fits = memcmp(first, value_of(p, corner[1]), p->bytes) == 0 &&
                memcmp(first, value_of(p, corner[2]), p->bytes) == 0;
        memcpy(a->values + f * p->bytes, first, p->bytes);
    }
    if (status == EBPO_OK && !*fits)
        drop(p);
    return status;
}

static ebpo_status place_in_lists(const placing *p, sort what)
{
    ebpo_attribute head = head_of(what, "face"), *a;
    head.columns *= 3;
    head.list = EBPO_ATTRIBUTE_UINT8;
    snprintf(head.names, sizeof head.names, "%s", sorts[what].list_name);
    ebpo_status status = add(p, &head, &a);
    for (uint64_t i = 0; i < 3 * p->mesh->face_count && status == EBPO_OK; i++)
        memcpy(a->values + i * p->bytes, value_of(p, p->how->corner[i]), p->bytes);
    return status;
}

static ebpo_status place(ebpo_mesh *mesh, const struct aiScene *scene, const ebpo_imported *how,
                         sort what, ebpo_error *error)
{
    size_t bytes = sorts[what].columns * sizeof(float);
    float *values = ebpo_alloc(how->vertices, bytes);
    placing p = { mesh, how, values, bytes, error };
    bool fits = false;
    if (!values)
        return ebpo_fail_memory(error, how->vertices * bytes);
    ebpo_status status = EBPO_OK;
    if (gather(scene, what, values)) {
        status = place_on_vertices(&p, what, &fits);
        if (status == EBPO_OK && !fits)
            status = place_on_faces(&p, what, &fits);
        if (status == EBPO_OK && !fits)
            status = place_in_lists(&p, what);
    }
    free(values);
    return status;
}

/* --- materials: a number for each face, and names in comments of a header --- */

/* Faces come mesh by mesh, and a mesh has one material. */
static ebpo_status place_materials(ebpo_mesh *mesh, const struct aiScene *scene,
                                   const ebpo_imported *how, ebpo_error *error)
{
    placing p = { mesh, how, NULL, 0, error };
    ebpo_attribute head = { .element = "face", .names = "material", .columns = 1 }, *a;
    head.type = EBPO_ATTRIBUTE_UINT32;
    head.list = EBPO_ATTRIBUTE_NO_LIST;
    ebpo_status status = add(&p, &head, &a);
    uint64_t end = 0;
    unsigned next = 0;
    uint32_t number = 0;
    for (uint64_t f = 0; f < mesh->face_count && status == EBPO_OK; f++) {
        while (how->corner[3 * f] >= end && next < scene->mNumMeshes) {
            number = scene->mMeshes[next]->mMaterialIndex;
            end += scene->mMeshes[next++]->mNumVertices;
        }
        memcpy(a->values + f * sizeof number, &number, sizeof number);
    }
    return status;
}

static void print_name(FILE *out, const struct aiScene *scene, unsigned i)
{
    struct aiString name;
    if (aiGetMaterialString(scene->mMaterials[i], "?mat.name", 0, 0, &name) != aiReturn_SUCCESS)
        return;
    fprintf(out, "comment material %u ", i);
    for (const char *s = name.data; *s; s++)
        fputc((unsigned char)*s < ' ' || *s == 127 ? '?' : *s, out);
    fputc('\n', out);
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

/* A header of PLY, as such files are written again. */
static ebpo_status make_header(ebpo_attributes *attributes, const struct aiScene *scene,
                               ebpo_error *error)
{
    char *text = NULL;
    size_t size = 0;
    FILE *out = open_memstream(&text, &size);
    if (!out)
        return ebpo_fail_memory(error, BUFSIZ);
    fputs("ply\nformat binary_little_endian 1.0\n", out);
    for (unsigned i = 0; i < scene->mNumMaterials; i++)
        print_name(out, scene, i);
    fputs("element vertex 0\nproperty float x\nproperty float y\nproperty float z\n", out);
    print_properties(out, attributes, "vertex");
    fputs("element face 0\nproperty list uchar int vertex_indices\n", out);
    print_properties(out, attributes, "face");
    fputs("end_header\n", out);
    bool fine = !ferror(out);
    if (fclose(out) != 0 || !fine) {
        free(text);
        return ebpo_fail_memory(error, size);
    }
    if (size > EBPO_ATTRIBUTE_HEADER) {
        free(text);
        ebpo_attributes_lose(attributes, "names of materials (more than 1 MiB)");
        return EBPO_OK;
    }
    attributes->header = text;
    attributes->header_bytes = size;
    return EBPO_OK;
}

/* assimp makes a material where the file names none. */
static bool has_materials(const struct aiScene *scene)
{
    struct aiString name;
    if (scene->mNumMaterials != 1)
        return scene->mNumMaterials > 1;
    return aiGetMaterialString(scene->mMaterials[0], "?mat.name", 0, 0, &name) ==
               aiReturn_SUCCESS &&
           strcmp(name.data, "DefaultMaterial") != 0 && name.data[0];
}

bool ebpo_import_has_attributes(const struct aiScene *scene)
{
    float value[MOST_COLUMNS];
    bool found = has_materials(scene);
    for (unsigned i = 0; i < scene->mNumMeshes && !found; i++)
        for (int what = 0; what < SORTS; what++)
            found |= value_at(scene->mMeshes[i], (sort)what, 0, value);
    return found;
}

/* Only two texture coordinates have names. */
static void note_third(ebpo_attributes *attributes, const struct aiScene *scene)
{
    float value[MOST_COLUMNS];
    bool third = false;
    for (unsigned i = 0; i < scene->mNumMeshes; i++)
        for (unsigned k = 0; k < scene->mMeshes[i]->mNumVertices && !third; k++)
            third = value_at(scene->mMeshes[i], TEXTURE, k, value) && value[2] != 0;
    if (third)
        ebpo_attributes_lose(attributes, "the third texture coordinate");
}

ebpo_status ebpo_import_attributes(ebpo_mesh *mesh, const struct aiScene *scene,
                                   const ebpo_imported *how, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (int what = 0; what < SORTS && status == EBPO_OK; what++)
        status = place(mesh, scene, how, (sort)what, error);
    note_third(mesh->attributes, scene);
    if (status == EBPO_OK && has_materials(scene)) {
        status = place_materials(mesh, scene, how, error);
        if (status == EBPO_OK)
            status = make_header(mesh->attributes, scene, error);
    }
    return status;
}

#endif
