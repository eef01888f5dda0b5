/* Writes OBJ and STL through the exporters of the library assimp, which write float32 coordinates.
 * The blocks of a job (levels and the mesh, export_job.h) become one assimp scene. assimp may write
 * only one file, which has a temporary name until it is complete. If assimp opens another file for
 * writing, the export fails. A build without assimp does not compile this file. In such a build,
 * the table in export.c has no function for OBJ and STL. */
#include "core/strict_fp.h"

#include <assimp/cexport.h>
#include <assimp/cfileio.h>
#include <assimp/cimport.h>
#include <assimp/material.h>
#include <assimp/mesh.h>
#include <assimp/scene.h>
#include <errno.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "derive/export_job.h"
#include "io/file_source.h"
#include "io/publish.h"

/* --- the file that assimp writes --- */

/* The only file that assimp may write. */
typedef struct scene_file {
    const char *path; /* borrowed */
    ebpo_publish publish;
    FILE *stream;         /* NULL: assimp has not opened the file */
    bool failed;          /* true: a write failed */
    int error_number;     /* errno of the first failure */
    char unexpected[128]; /* another name that assimp opened for writing; "": none */
} scene_file;

/* A file that assimp has opened. */
typedef struct open_stream {
    scene_file *target;
    FILE *stream;
} open_stream;

static open_stream *stream_of(struct aiFile *file) { return (open_stream *)(void *)file->UserData; }

/* Records the first failure, because assimp ignores the results of these callbacks. */
static void keep_failure(scene_file *target)
{
    target->error_number = target->failed ? target->error_number : errno;
    target->failed = true;
}

static size_t write_bytes(struct aiFile *file, const char *from, size_t size, size_t count)
{
    open_stream *c = stream_of(file);
    size_t done = fwrite(from, size, count, c->stream);
    if (done != count && size)
        keep_failure(c->target);
    return done;
}

static size_t read_bytes(struct aiFile *file, char *to, size_t size, size_t count)
{
    (void)file, (void)to, (void)size, (void)count;
    return 0;
}

static size_t stream_position(struct aiFile *file)
{
    off_t at = ftello(stream_of(file)->stream);
    return at > 0 ? (size_t)at : 0;
}

static enum aiReturn seek_stream(struct aiFile *file, size_t offset, enum aiOrigin origin)
{
    int whence = origin == aiOrigin_SET ? SEEK_SET : origin == aiOrigin_CUR ? SEEK_CUR : SEEK_END;
    return fseeko(stream_of(file)->stream, (off_t)offset, whence) == 0 ? aiReturn_SUCCESS
                                                                       : aiReturn_FAILURE;
}

static size_t file_size(struct aiFile *file)
{
    size_t at = stream_position(file), end;
    (void)seek_stream(file, 0, aiOrigin_END);
    end = stream_position(file);
    (void)seek_stream(file, at, aiOrigin_SET);
    return end;
}

static void flush_stream(struct aiFile *file)
{
    if (fflush(stream_of(file)->stream) != 0)
        keep_failure(stream_of(file)->target);
}

static struct aiFile *open_file(struct aiFileIO *io, const char *name, const char *mode)
{
    scene_file *target = (scene_file *)(void *)io->UserData;
    if (mode[0] != 'w')
        return NULL;
    bool is_target = strcmp(ebpo_path_name(target->path), ebpo_path_name(name)) == 0;
    FILE *stream = is_target ? ebpo_publish_stream(&target->publish) : NULL;
    if (!is_target)
        snprintf(target->unexpected, sizeof target->unexpected, "%s", name);
    struct aiFile *file = calloc(1, sizeof *file);
    open_stream *c = calloc(1, sizeof *c);
    if (!stream || !file || !c) {
        free(file);
        free(c);
        target->failed = true;
        target->error_number = ENOMEM;
        return NULL;
    }
    target->stream = stream;
    *c = (open_stream){ target, stream };
    *file = (struct aiFile){ read_bytes,  write_bytes,  stream_position,      file_size,
                             seek_stream, flush_stream, (aiUserData)(void *)c };
    return file;
}

static void close_file(struct aiFileIO *io, struct aiFile *file)
{
    (void)io;
    flush_stream(file);
    free(file->UserData);
    free(file);
}

static void scene_file_begin(scene_file *file, const char *path)
{
    *file = (scene_file){ .path = path, .publish = EBPO_PUBLISH_INIT };
}

/* Sets `io` to functions that give assimp access to this file, and to no other file. assimp knows
 * the file by the last part of its path. `io` keeps a pointer to `file`. */
static void scene_file_offer(scene_file *file, struct aiFileIO *io)
{
    *io = (struct aiFileIO){ open_file, close_file, (aiUserData)(void *)file };
}

/* Publishes the file, if assimp wrote it without a failure. */
static ebpo_status scene_file_commit(scene_file *file, ebpo_error *error)
{
    if (file->unexpected[0])
        return ebpo_fail_file(error, EBPO_E_UNSUPPORTED, file->path,
                              "this version of assimp also writes an unexpected file '%s'; "
                              "choose another format",
                              file->unexpected);
    if (file->failed) {
        errno = file->error_number;
        return ebpo_fail_errno(error, file->path, "could not be written");
    }
    if (!file->stream)
        return ebpo_fail_file(error, EBPO_E_UNSUPPORTED, file->path,
                              "this version of assimp has written nothing; choose another format");
    return ebpo_publish_commit(&file->publish, error);
}

/* Removes the file, unless it was committed. */
static void scene_file_abort(scene_file *file) { ebpo_publish_abort(&file->publish); }

/* --- the scene for assimp --- */

enum { BLOCKS_MAX = EBPO_LEVELS_MAX + 1 };

/* assimp has one error text for the whole process, so only one thread at a time may call it. */
static pthread_mutex_t assimp_mutex = PTHREAD_MUTEX_INITIALIZER;

/* All data that assimp borrows. assimp does not change the data; if assimp needs changes, it makes
 * them in a copy. */
typedef struct scene {
    struct aiScene root;
    struct aiNode top, node[BLOCKS_MAX], *children[BLOCKS_MAX];
    struct aiMesh mesh[BLOCKS_MAX], *meshes[BLOCKS_MAX];
    struct aiMaterial material, *materials;
    unsigned count; /* number of meshes, which is the number of nodes below `top` */
    unsigned mesh_index[BLOCKS_MAX]; /* [count] index of the mesh of each node */
    double largest_change;           /* largest rounding error of a coordinate (ebpo_mesh_floats) */
} scene;

static void set_name(struct aiString *to, const char *name)
{
    to->length = (ai_uint32)snprintf(to->data, sizeof to->data, "%s", name);
}

static const struct aiMatrix4x4 identity = { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1 };

static ebpo_status add_vertices(scene *s, struct aiMesh *to, const ebpo_mesh *from,
                                ebpo_error *error)
{
    static const double origin[3] = { 0, 0, 0 };
    float *xyz = NULL;
    ebpo_status status = ebpo_mesh_floats(&xyz, from, origin, &s->largest_change, error);
    if (status != EBPO_OK)
        return status;
    to->mNumVertices = (unsigned)from->vertex_count;
    to->mVertices = ebpo_alloc(from->vertex_count, sizeof *to->mVertices);
    if (!to->mVertices)
        status = ebpo_fail_memory(error, from->vertex_count * sizeof *to->mVertices);
    for (uint64_t i = 0; to->mVertices && i < from->vertex_count; i++)
        to->mVertices[i] = (struct aiVector3D){ xyz[3 * i], xyz[3 * i + 1], xyz[3 * i + 2] };
    free(xyz);
    return status;
}

/* Adds colours of vertices. In an OBJ file, assimp writes them after the positions. */
static ebpo_status add_colours(struct aiMesh *to, const ebpo_block *block, ebpo_error *error)
{
    const uint8_t *rgba = block->colours.vertex;
    uint64_t count = block->mesh.vertex_count;
    struct aiColor4D *colours = rgba ? ebpo_alloc(count, sizeof *colours) : NULL;
    if (rgba && !colours)
        return ebpo_fail_memory(error, count * sizeof *colours);
    for (uint64_t i = 0; colours && i < count; i++, rgba += 4)
        colours[i] = (struct aiColor4D){ (float)rgba[0] / 255, (float)rgba[1] / 255,
                                         (float)rgba[2] / 255, (float)rgba[3] / 255 };
    to->mColors[0] = colours;
    return EBPO_OK;
}

/* Moves the triangles from the block to the scene. */
static ebpo_status add_faces(struct aiMesh *to, ebpo_mesh *from, ebpo_error *error)
{
    to->mNumFaces = (unsigned)from->face_count;
    to->mFaces = ebpo_alloc(from->face_count, sizeof *to->mFaces);
    if (!to->mFaces)
        return ebpo_fail_memory(error, from->face_count * sizeof *to->mFaces);
    for (uint64_t i = 0; i < from->face_count; i++)
        to->mFaces[i] = (struct aiFace){ 3, from->faces + 3 * i };
    from->faces = NULL;
    return EBPO_OK;
}

static ebpo_status add_block(scene *s, ebpo_block *block, ebpo_error *error)
{
    struct aiMesh *mesh = &s->mesh[s->count];
    struct aiNode *node = &s->node[s->count];
    mesh->mPrimitiveTypes = aiPrimitiveType_TRIANGLE;
    set_name(&mesh->mName, block->name);
    node->mName = mesh->mName;
    node->mTransformation = identity;
    node->mParent = &s->top;
    node->mNumMeshes = 1;
    node->mMeshes = &s->mesh_index[s->count];
    s->mesh_index[s->count] = s->count;
    s->children[s->count] = node;
    s->meshes[s->count++] = mesh;
    ebpo_status status = add_vertices(s, mesh, &block->mesh, error);
    if (status == EBPO_OK)
        status = add_colours(mesh, block, error);
    return status == EBPO_OK ? add_faces(mesh, &block->mesh, error) : status;
}

static void finish_scene(scene *s)
{
    set_name(&s->top.mName, "ebpo");
    s->top.mTransformation = identity;
    s->top.mNumChildren = s->count;
    s->top.mChildren = s->children;
    s->materials = &s->material;
    s->root.mRootNode = &s->top;
    s->root.mNumMeshes = s->count;
    s->root.mMeshes = s->meshes;
    s->root.mNumMaterials = 1;
    s->root.mMaterials = &s->materials;
}

static void scene_free(scene *s)
{
    for (unsigned i = 0; i < s->count; i++) {
        if (s->mesh[i].mFaces)
            free(s->mesh[i].mFaces[0].mIndices);
        free(s->mesh[i].mFaces);
        free(s->mesh[i].mVertices);
        free(s->mesh[i].mColors[0]);
    }
    free(s);
}

static ebpo_status gather_scene(scene *s, const ebpo_export_job *job, ebpo_error *error)
{
    const ebpo_info *info = ebpo_file_info(job->file);
    /* The size of the mesh is known and checked before the mesh is read. */
    ebpo_status status =
        job->options->mesh
            ? ebpo_export_check_assimp(job->path, info->vertex_count, info->face_count, error)
            : EBPO_OK;
    uint64_t vertices = 0, faces = 0;
    for (int i = 0; i < ebpo_block_count(job->options) && status == EBPO_OK; i++) {
        ebpo_block block;
        status = ebpo_export_read_block(job, i, EBPO_SOURCE_ORDER, &block, error);
        if (status == EBPO_OK)
            status = ebpo_export_check_assimp(job->path, vertices += block.mesh.vertex_count,
                                              faces += block.mesh.face_count, error);
        if (status == EBPO_OK && block.mesh.face_count)
            status = add_block(s, &block, error);
        ebpo_block_free(&block);
    }
    if (status == EBPO_OK && s->count == 0)
        status = ebpo_fail_file(error, EBPO_E_ARGUMENT, job->path,
                                "would contain no triangles; choose another level");
    finish_scene(s);
    job->report->largest_change = s->largest_change;
    return status;
}

static ebpo_status write_scene(const scene *s, const ebpo_export_job *job, scene_file *file,
                               ebpo_error *error)
{
    const char *id = job->format == EBPO_EXPORT_OBJ ? "objnomtl" : "stlb";
    struct aiFileIO io;
    ebpo_status status = EBPO_OK;
    scene_file_offer(file, &io);
    pthread_mutex_lock(&assimp_mutex);
    if (aiExportSceneEx(&s->root, id, ebpo_path_name(job->path), &io, 0) != aiReturn_SUCCESS &&
        !file->failed)
        status = ebpo_fail_file(error, EBPO_E_UNSUPPORTED, job->path,
                                "assimp cannot write it (%.200s); choose another format",
                                aiGetErrorString());
    pthread_mutex_unlock(&assimp_mutex);
    return status;
}

ebpo_status ebpo_export_assimp(const ebpo_export_job *job, ebpo_error *error)
{
    scene_file file;
    scene_file_begin(&file, job->path);
    scene *s = ebpo_alloc_zero(1, sizeof *s);
    if (!s)
        return ebpo_fail_memory(error, sizeof *s);
    /* Begins the file before the work, so that a folder without write permission is reported at
     * once. */
    ebpo_status status = ebpo_publish_begin(&file.publish, job->path, error);
    if (status == EBPO_OK)
        status = gather_scene(s, job, error);
    if (status == EBPO_OK)
        status = write_scene(s, job, &file, error);
    if (status == EBPO_OK)
        status = scene_file_commit(&file, error);
    scene_file_abort(&file);
    scene_free(s);
    return status;
}
