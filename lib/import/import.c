#include "import/import.h"

#include "attributes/attributes.h"
#include "base/arrays.h"
#include "base/error.h"
#include "ebpo_config.h"
#include "import/obj_runs.h"
#include "io/file_source.h"

void ebpo_import_clear(ebpo_mesh *mesh)
{
    ebpo_array_free(mesh->workspace, mesh->xyz32);
    ebpo_array_free(mesh->workspace, mesh->faces);
    ebpo_attributes_free(mesh->attributes);
    *mesh = (ebpo_mesh){ 0 };
}

#if !EBPO_HAVE_ASSIMP

ebpo_status ebpo_import_runs(ebpo_mesh *out, ebpo_import_format format, const uint8_t *data,
                             uint64_t size, const char *name, ebpo_workspace *workspace,
                             bool attributes, ebpo_obj_runs *runs, ebpo_error *error)
{
    (void)format;
    (void)data;
    (void)size;
    (void)workspace;
    (void)attributes;
    (void)runs;
    *out = (ebpo_mesh){ 0 };
    return ebpo_fail_file(error, EBPO_E_UNSUPPORTED, ebpo_path_name(name),
                          "this build reads PLY only; build it with libassimp-dev installed, or "
                          "convert the file to PLY");
}

#else

#include <assimp/cfileio.h>
#include <assimp/cimport.h>
#include <assimp/scene.h>
#include <inttypes.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "geom/polygon.h"
#include "import/assimp_lock.h"
#include "import/import_attributes.h"
#include "import/obj_losses.h"
#include "import/stl_colours.h"
#include "import/off_check.h"
#include "import/corner_weld.h"

#define MOST (UINT64_C(0xfffffffe))

static pthread_mutex_t assimp_mutex = PTHREAD_MUTEX_INITIALIZER;

void ebpo_assimp_lock(void) { pthread_mutex_lock(&assimp_mutex); }

void ebpo_assimp_unlock(void) { pthread_mutex_unlock(&assimp_mutex); }

static const char *const pseudo_names[] = { "model.obj", "model.stl", "model.off" };
static const char *const format_names[] = { "obj", "stl", "off" };

/* Bytes that assimp and what is made of its scene take for a byte of the file, measured
 * (assimp 5.2.4, 1.4 million triangles: 6.5 for OBJ of positions only, 4.0 for binary STL, 2.6 for
 * OFF) and rounded up. */
static const uint64_t bytes_each[] = { 7, 5, 3 };

/* assimp has all of a model in memory, several times over. */
static ebpo_status check_budget(ebpo_import_format format, uint64_t size,
                                const ebpo_workspace *workspace, const char *name,
                                ebpo_error *error)
{
    ebpo_workspace_stats figures = EBPO_WORKSPACE_STATS_INIT;
    figures.memory = UINT64_MAX;
    uint64_t need;
    if (workspace)
        ebpo_workspace_get_stats(workspace, &figures);
    if (!ebpo_mul_ok(size, bytes_each[format], &need) || need > figures.memory)
        return ebpo_fail_file(error, EBPO_E_LIMIT, name,
                              "reading it takes some %" PRIu64
                              " MiB, as assimp has all of it in memory, but %" PRIu64
                              " MiB are allowed; allow more, or convert it to PLY",
                              (need >> 20) + 1, figures.memory >> 20);
    return EBPO_OK;
}

/* A scene is millions of small allocations, which would stay with the process. */
static void give_back(void)
{
#ifdef __GLIBC__
    malloc_trim(0);
#endif
}

/* The one file that assimp gets to see. */
typedef struct memory_file {
    const uint8_t *data;
    size_t size;
    const char *name;
    bool no_memory; /* for opening it: assimp only learns that it cannot be opened */
} memory_file;

typedef struct cursor {
    const memory_file *file;
    size_t at;
} cursor;

static size_t read_bytes(struct aiFile *file, char *to, size_t size, size_t count)
{
    cursor *c = (cursor *)(void *)file->UserData;
    size_t left = c->file->size - c->at;
    if (size == 0)
        return 0;
    if (count > left / size)
        count = left / size;
    memcpy(to, c->file->data + c->at, size * count);
    c->at += size * count;
    return count;
}

static size_t write_bytes(struct aiFile *file, const char *from, size_t size, size_t count)
{
    (void)file, (void)from, (void)size, (void)count;
    return 0;
}

static size_t tell(struct aiFile *file) { return ((cursor *)(void *)file->UserData)->at; }

static size_t file_size(struct aiFile *file)
{
    return ((cursor *)(void *)file->UserData)->file->size;
}

static enum aiReturn seek(struct aiFile *file, size_t offset, enum aiOrigin origin)
{
    cursor *c = (cursor *)(void *)file->UserData;
    size_t base = origin == aiOrigin_SET ? 0 : origin == aiOrigin_CUR ? c->at : c->file->size;
    size_t to = base + offset; /* negative offsets come as large ones and wrap around */
    if (to > c->file->size)
        return aiReturn_FAILURE;
    c->at = to;
    return aiReturn_SUCCESS;
}

static void flush(struct aiFile *file) { (void)file; }

/* Any other name (material libraries) does not exist: a model must not make us open what it likes.
 */
static struct aiFile *open_memory(struct aiFileIO *io, const char *name, const char *mode)
{
    memory_file *source = (memory_file *)(void *)io->UserData;
    struct aiFile *file;
    cursor *c;
    if (strcmp(name, source->name) != 0 || mode[0] != 'r')
        return NULL;
    file = calloc(1, sizeof *file);
    c = calloc(1, sizeof *c);
    if (!file || !c) {
        free(file);
        free(c);
        source->no_memory = true;
        return NULL;
    }
    c->file = source;
    *file = (struct aiFile){ read_bytes, write_bytes,          tell, file_size, seek,
                             flush,      (aiUserData)(void *)c };
    return file;
}

static void close_memory(struct aiFileIO *io, struct aiFile *file)
{
    (void)io;
    free(file->UserData);
    free(file);
}

/* What is read, and how. */
typedef struct reading {
    memory_file file;
    ebpo_import_format format;
    ebpo_obj_runs *runs; /* NULL: not asked for */
    const char *name;
    ebpo_error *error;
    bool more; /* of OFF: there is more than positions and corners */
} reading;

/* Sums over the scene's meshes, with every index checked. */
typedef struct totals {
    uint64_t vertices, triangles, most_corners;
} totals;

static ebpo_status add_mesh_totals(totals *t, const struct aiMesh *m, const char *name,
                                   ebpo_error *error)
{
    t->vertices += m->mNumVertices;
    for (unsigned i = 0; i < m->mNumFaces; i++) {
        const struct aiFace *face = &m->mFaces[i];
        for (unsigned k = 0; k < face->mNumIndices; k++)
            if (face->mIndices[k] >= m->mNumVertices)
                return ebpo_fail_file(
                    error, EBPO_E_FORMAT, name,
                    "face %u names vertex %u, but there are %u vertices; repair the file", i,
                    face->mIndices[k], m->mNumVertices);
        t->triangles += face->mNumIndices >= 3 ? face->mNumIndices - 2 : 0;
        if (t->most_corners < face->mNumIndices)
            t->most_corners = face->mNumIndices;
    }
    if (t->vertices > MOST || t->triangles > MOST)
        return ebpo_fail_file(error, EBPO_E_LIMIT, name,
                              "more than 2^32 - 2 vertices or triangles; split the model");
    return EBPO_OK;
}

static ebpo_status scene_totals(totals *t, const struct aiScene *scene, const char *name,
                                ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (unsigned i = 0; i < scene->mNumMeshes && status == EBPO_OK; i++)
        status = add_mesh_totals(t, scene->mMeshes[i], name, error);
    if (status == EBPO_OK && t->triangles == 0)
        status = ebpo_fail_file(error, EBPO_E_FORMAT, name,
                                "has no faces; there is no mesh in this file");
    return status;
}

static void copy_positions(float *xyz, const struct aiScene *scene)
{
    for (unsigned i = 0; i < scene->mNumMeshes; i++) {
        const struct aiMesh *m = scene->mMeshes[i];
        for (unsigned k = 0; k < m->mNumVertices; k++, xyz += 3) {
            xyz[0] = m->mVertices[k].x;
            xyz[1] = m->mVertices[k].y;
            xyz[2] = m->mVertices[k].z;
        }
    }
}

typedef struct polygon_capacity {
    double (*position)[3];
    uint32_t (*triangle)[3];
    void *scratch;
} polygon_capacity;

static bool polygon_buffers_get(polygon_capacity *capacity, uint64_t corners)
{
    capacity->position = ebpo_alloc(corners, sizeof *capacity->position);
    capacity->triangle = ebpo_alloc(corners, sizeof *capacity->triangle);
    capacity->scratch = ebpo_alloc(ebpo_polygon_scratch_bytes(corners), 1);
    return capacity->position && capacity->triangle && capacity->scratch;
}

static void polygon_buffers_free(polygon_capacity *capacity)
{
    free(capacity->position);
    free(capacity->triangle);
    free(capacity->scratch);
}

/* From the scene's faces to the mesh's. */
typedef struct filling {
    ebpo_mesh *mesh;
    const uint32_t *map; /* from this assimp mesh's vertices to ours */
    uint32_t first;      /* number among all of the scene of this one's first vertex */
    uint32_t *corner;    /* NULL, or [triangles][3] which of those each corner is */
    polygon_capacity polygon;
    const char *name;
    ebpo_error *error;
} filling;

static void add_triangle(const filling *f, const struct aiFace *face, const uint32_t corner[3])
{
    uint64_t at = 3 * f->mesh->face_count++;
    for (int k = 0; k < 3; k++) {
        uint32_t vertex = face->mIndices[corner[k]];
        f->mesh->faces[at + (uint64_t)k] = f->map[vertex];
        if (f->corner)
            f->corner[at + (uint64_t)k] = f->first + vertex;
    }
}

static ebpo_status add_face(const filling *f, const struct aiFace *face)
{
    ebpo_mesh *mesh = f->mesh;
    const polygon_capacity *capacity = &f->polygon;
    uint32_t n = face->mNumIndices;
    if (n < 3) {
        mesh->polygons_dropped++;
        return EBPO_OK;
    }
    for (uint32_t i = 0; i < n; i++)
        for (int k = 0; k < 3; k++)
            capacity->position[i][k] =
                (double)mesh->xyz32[3 * (uint64_t)f->map[face->mIndices[i]] + (uint64_t)k];
    ebpo_polygon_kind kind =
        ebpo_polygon_triangulate(capacity->triangle, (const double(*)[3])capacity->position, n,
                                 capacity->scratch);
    if (kind == EBPO_POLYGON_TOO_LARGE)
        return ebpo_fail_file(
            f->error, EBPO_E_LIMIT, f->name,
            "a concave polygon of %" PRIu32
            " corners is too intricate to be cut into triangles here; triangulate it in the source",
            n);
    mesh->polygons_triangulated += n > 3;
    mesh->polygons_concave += kind == EBPO_POLYGON_CONCAVE;
    for (uint32_t i = 0; i < n - 2; i++)
        add_triangle(f, face, capacity->triangle[i]);
    return EBPO_OK;
}

static ebpo_status add_faces(filling *f, const struct aiScene *scene)
{
    ebpo_status status = EBPO_OK;
    for (unsigned i = 0; i < scene->mNumMeshes; i++) {
        const struct aiMesh *m = scene->mMeshes[i];
        for (unsigned k = 0; k < m->mNumFaces && status == EBPO_OK; k++)
            status = add_face(f, &m->mFaces[k]);
        f->map += m->mNumVertices;
        f->first += m->mNumVertices;
    }
    return status;
}

/* assimp gives OBJ vertices once for each corner that uses them and STL has no shared vertices at
 * all, so shared edges exist only after welding. OFF keeps its vertices apart in the file; welding
 * it too makes the three formats agree on what a shared vertex is. */
static ebpo_status weld_and_fill(filling *f, const struct aiScene *scene, uint32_t *map,
                                 uint64_t vertices)
{
    ebpo_mesh *mesh = f->mesh;
    copy_positions(mesh->xyz32, scene);
    ebpo_status status =
        ebpo_import_weld(mesh->xyz32, vertices, map, &mesh->vertex_count, f->error);
    if (status == EBPO_OK)
        status = add_faces(f, scene);
    float *smaller = mesh->workspace || status != EBPO_OK
                         ? NULL
                         : ebpo_realloc(mesh->xyz32, mesh->vertex_count, 3 * sizeof *mesh->xyz32);
    if (smaller)
        mesh->xyz32 = smaller;
    return status;
}

static ebpo_status convert(ebpo_mesh *mesh, const struct aiScene *scene, const reading *r)
{
    totals t = { 0, 0, 3 };
    ebpo_workspace *workspace = mesh->workspace;
    bool corners =
        mesh->attributes && r->format == EBPO_IMPORT_OBJ && ebpo_import_has_attributes(scene);
    ebpo_status status = scene_totals(&t, scene, r->name, r->error);
    if (status != EBPO_OK)
        return status;
    mesh->xyz32 = ebpo_array_alloc(workspace, t.vertices, 3 * sizeof *mesh->xyz32);
    mesh->faces = ebpo_array_alloc(workspace, t.triangles, 3 * sizeof *mesh->faces);
    uint32_t *map = ebpo_alloc(t.vertices, sizeof *map);
    filling f = { .mesh = mesh, .map = map, .name = r->name, .error = r->error };
    f.corner = corners ? ebpo_array_alloc(workspace, t.triangles, 3 * sizeof *f.corner) : NULL;
    if (!mesh->xyz32 || !mesh->faces || !map || (corners && !f.corner) ||
        !polygon_buffers_get(&f.polygon, t.most_corners))
        status = ebpo_workspace_fail(workspace, t.vertices * 16 + t.triangles * 24, r->error);
    else
        status = weld_and_fill(&f, scene, map, t.vertices);
    if (status == EBPO_OK && corners)
        status = ebpo_import_attributes(mesh, scene, &(ebpo_imported){ t.vertices, map, f.corner },
                                        r->error);
    polygon_buffers_free(&f.polygon);
    ebpo_array_free(workspace, f.corner);
    free(map);
    return status;
}

static uint64_t triangles_of(const struct aiMesh *m)
{
    uint64_t sum = 0;
    for (unsigned i = 0; i < m->mNumFaces; i++)
        sum += m->mFaces[i].mNumIndices >= 3 ? m->mFaces[i].mNumIndices - 2 : 0;
    return sum;
}

/* False where assimp's objects are not the runs, in their order. */
static bool count_runs(ebpo_obj_runs *runs, const struct aiScene *scene)
{
    const struct aiNode *root = scene->mRootNode;
    uint64_t run, last = 0;
    unsigned next = 0;
    for (unsigned i = 0; i < root->mNumChildren; i++) {
        const struct aiNode *object = root->mChildren[i];
        if (object->mNumMeshes == 0)
            continue;
        if (!ebpo_obj_run_number(runs, object->mName.data, &run) || run < last)
            return false;
        for (unsigned k = 0; k < object->mNumMeshes; k++, next++) {
            if (object->mMeshes[k] != next)
                return false;
            runs->of[run].faces += triangles_of(scene->mMeshes[next]);
        }
        last = run;
    }
    return next == scene->mNumMeshes;
}

static ebpo_status fail_assimp(const reading *r)
{
    char reason[200];
    if (r->file.no_memory)
        return ebpo_fail_memory(r->error, sizeof(struct aiFile));
    snprintf(reason, sizeof reason, "%s", aiGetErrorString());
    for (char *s = reason; *s; s++)
        if (*s < ' ' || *s > '~')
            *s = ' ';
    return ebpo_fail_file(r->error, EBPO_E_FORMAT, r->name,
                          "assimp cannot read it (%s); repair the file or convert it to PLY",
                          reason);
}

static ebpo_status import_locked(ebpo_mesh *mesh, reading *r)
{
    struct aiFileIO io = { open_memory, close_memory, (aiUserData)(void *)&r->file };
    /* No post-processing: nothing may move, join or reorder. */
    const struct aiScene *scene = aiImportFileEx(r->file.name, 0, &io);
    if (!scene)
        return fail_assimp(r);
    ebpo_status status = convert(mesh, scene, r);
    if (status == EBPO_OK && r->runs && !count_runs(r->runs, scene))
        status = ebpo_fail_no_runs(r->name, r->error);
    aiReleaseImport(scene);
    return status;
}

static ebpo_status check(reading *r, const ebpo_workspace *workspace)
{
    uint64_t size = r->file.size;
    ebpo_status status = check_budget(r->format, size, workspace, r->name, r->error);
    if (status == EBPO_OK &&
        size > UINT32_MAX) /* assimp keeps sizes, and counts of corners, in 32 bits */
        status = ebpo_fail_file(
            r->error, EBPO_E_LIMIT, r->name,
            "has %" PRIu64
            " bytes, and files other than PLY are read up to 4 GiB; convert it to PLY",
            size);
    if (status == EBPO_OK && r->format == EBPO_IMPORT_OFF)
        status = ebpo_import_check_off(r->file.data, size, r->name, &r->more, r->error);
    return status;
}

/* What the scene does not say of the file's attributes. */
static ebpo_status complete_attributes(ebpo_mesh *mesh, const reading *r)
{
    ebpo_status status = EBPO_OK;
    if (mesh->attributes && r->format == EBPO_IMPORT_STL)
        status = ebpo_import_stl_colours(mesh, r->file.data, r->file.size, r->error);
    if (mesh->attributes && r->format == EBPO_IMPORT_OBJ)
        ebpo_obj_note_losses(mesh->attributes, r->file.data, r->file.size);
    if (mesh->attributes && r->more)
        ebpo_attributes_lose(mesh->attributes, "colours, normals or others of OFF");
    if (!mesh->attributes || ebpo_attributes_hold(mesh->attributes) || mesh->attributes->lost[0])
        return status;
    ebpo_attributes_free(mesh->attributes);
    mesh->attributes = NULL;
    return status;
}

ebpo_status ebpo_import_runs(ebpo_mesh *out, ebpo_import_format format, const uint8_t *data,
                             uint64_t size, const char *name, ebpo_workspace *workspace,
                             bool attributes, ebpo_obj_runs *runs, ebpo_error *error)
{
    name = ebpo_path_name(name);
    reading r = {
        { data, (size_t)size, pseudo_names[format], false }, format, runs, name, error, false
    };
    ebpo_mesh mesh = { .workspace = workspace };
    ebpo_status status = check(&r, workspace);
    if (status == EBPO_OK && attributes && !(mesh.attributes = ebpo_attributes_make(workspace)))
        status = ebpo_fail_memory(error, sizeof *mesh.attributes);
    if (status == EBPO_OK) {
        ebpo_assimp_lock();
        status = import_locked(&mesh, &r);
        ebpo_assimp_unlock();
        give_back();
    }
    if (status == EBPO_OK)
        status = complete_attributes(&mesh, &r);
    if (status == EBPO_OK) {
        snprintf(mesh.source_name, sizeof mesh.source_name, "%s", name);
        snprintf(mesh.source_format, sizeof mesh.source_format, "%s", format_names[format]);
        mesh.source_size = size;
    } else {
        ebpo_import_clear(&mesh);
    }
    *out = mesh;
    return status;
}

#endif
