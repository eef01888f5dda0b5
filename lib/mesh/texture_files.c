#include "mesh/textures.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/checksum.h"
#include "io/file_source.h"

/* Of material libraries: bytes of all, and names that are tried. */
enum { LIBRARY_BYTES = 1 << 25, LIBRARIES = 100, DIGEST = 32, STEP = 1 << 20 };
#define IMAGE_BYTES ((uint64_t)1 << 30)

typedef struct finding {
    const char *path; /* of the source */
    ebpo_texture_names names;
    uint64_t absent, outside, large; /* not found; forbidden; too large */
    uint64_t tried, libraries;       /* names of libraries; not read */
    uint64_t library_bytes;          /* read */
    bool keep, no_memory;
    ebpo_error *error;
} finding;

/* --- files beside the source --- */

/* Below the folder, by its words: no root, no drive, nothing upwards. */
static bool stays_below(const char *name)
{
    if (*name == '/' || (*name && name[1] == ':'))
        return false;
    for (const char *s = name; *s;) {
        size_t n = strcspn(s, "/");
        if (n == 2 && s[0] == '.' && s[1] == '.')
            return false;
        s += n + (s[n] == '/');
    }
    return true;
}

typedef enum found { FOUND, ABSENT, OUTSIDE, NO_MEMORY } found;

/* Other systems' names have backslashes. */
static char *path_of(const char *name)
{
    char *path = strdup(name);
    for (char *s = path; path && *s; s++)
        if (*s == '\\')
            *s = '/';
    return path;
}

/* Opens a file that the source names. */
static found open_beside(const char *source, const char *name, ebpo_whole_file *out)
{
    size_t length = (size_t)(ebpo_path_name(source) - source);
    char *path = path_of(name), *folder = strndup(length ? source : ".", length ? length : 1);
    found how = path && folder ? FOUND : NO_MEMORY;
    if (how == FOUND && !stays_below(path))
        how = OUTSIDE;
    if (how == FOUND) {
        int fd = ebpo_open_below(folder, path);
        how = fd >= 0 ? FOUND : errno == EXDEV ? OUTSIDE : ABSENT;
        if (fd >= 0 && ebpo_whole_file_take(out, fd, path, NULL) != EBPO_OK)
            how = ABSENT;
    }
    free(path);
    free(folder);
    return how;
}

/* --- names --- */

static bool read_library(finding *f, const char *name)
{
    ebpo_whole_file file = EBPO_WHOLE_FILE_INIT;
    found how = f->tried++ < LIBRARIES ? open_beside(f->path, name, &file) : ABSENT;
    f->no_memory |= how == NO_MEMORY;
    bool good = how == FOUND && file.size <= LIBRARY_BYTES - f->library_bytes;
    if (good)
        f->library_bytes += file.size;
    good = good && ebpo_whole_file_load(&file, NULL, 1, NULL, name, NULL) == EBPO_OK;
    if (good)
        ebpo_texture_names_of_mtl(&f->names, file.data, file.size);
    ebpo_whole_file_close(&file);
    return good;
}

/* A library's name with spaces, or several names. */
static void read_libraries(void *context, const char *rest, size_t size)
{
    finding *f = context;
    char *names = strndup(rest, size);
    if (!names || read_library(f, names)) {
        f->no_memory |= !names;
        free(names);
        return;
    }
    char *left = NULL, *name = strtok_r(names, " \t", &left);
    for (; name; name = strtok_r(NULL, " \t", &left))
        f->libraries += !read_library(f, name);
    free(names);
}

static void find_names(finding *f, const ebpo_mesh *mesh, const uint8_t *data, uint64_t size)
{
    if (strcmp(mesh->source_format, "obj") == 0)
        ebpo_obj_libraries(data, size, read_libraries, f);
    else if (mesh->attributes && mesh->attributes->header)
        ebpo_texture_names_of_ply(&f->names, mesh->attributes->header,
                                  mesh->attributes->header_bytes);
    f->no_memory |= f->names.no_memory;
}

/* --- images --- */

/* Piece by piece: where the bytes are not kept they need not be in memory all at once. */
static ebpo_status make_digest(const ebpo_whole_file *file, const char *name,
                               uint8_t digest[DIGEST], ebpo_error *error)
{
    ebpo_sha256 state;
    ebpo_status status = EBPO_OK;
    uint8_t *piece = file->data ? NULL : ebpo_alloc(STEP, 1);
    if (!file->data && !piece)
        return ebpo_fail_memory(error, STEP);
    ebpo_sha256_begin(&state);
    for (uint64_t at = 0; at < file->size && status == EBPO_OK; at += STEP) {
        size_t bytes = file->size - at < STEP ? (size_t)(file->size - at) : STEP;
        if (piece)
            status = ebpo_whole_file_read(file, at, piece, bytes, name, error);
        if (status == EBPO_OK)
            ebpo_sha256_add(&state, piece ? piece : file->data + at, bytes);
    }
    ebpo_sha256_end(&state, digest);
    free(piece);
    return status;
}

/* Bytes that are kept, and the digest. */
static ebpo_status read_image(const finding *f, ebpo_whole_file *file, const char *name,
                              uint8_t digest[DIGEST])
{
    ebpo_status status =
        f->keep ? ebpo_whole_file_load(file, NULL, 1, NULL, name, f->error) : EBPO_OK;
    return status == EBPO_OK ? make_digest(file, name, digest, f->error) : status;
}

static ebpo_status add_image(finding *f, ebpo_attributes *to, const ebpo_texture_name *named)
{
    ebpo_whole_file file = EBPO_WHOLE_FILE_INIT;
    uint8_t digest[DIGEST];
    ebpo_texture_bytes list[EBPO_TEXTURE_ARRAYS] = {
        [EBPO_TEXTURE_NAME] = { named->name, strlen(named->name) },
        [EBPO_TEXTURE_USE] = { named->use, named->use_bytes },
    };
    found how = open_beside(f->path, named->name, &file);
    f->absent += how == ABSENT;
    f->outside += how == OUTSIDE;
    if (how == NO_MEMORY)
        return ebpo_fail_memory(f->error, strlen(f->path));
    ebpo_status status = EBPO_OK;
    if (how == FOUND && file.size > IMAGE_BYTES) {
        f->large++;
    } else if (how == FOUND) {
        status = read_image(f, &file, named->name, digest);
        list[EBPO_TEXTURE_SHA256] = (ebpo_texture_bytes){ digest, DIGEST };
        if (f->keep)
            list[EBPO_TEXTURE_BYTES] = (ebpo_texture_bytes){ file.data, file.size };
    }
    if (status == EBPO_OK)
        status = ebpo_textures_add(to, f->keep, list, f->error);
    if (status == EBPO_OK && how == FOUND)
        status = ebpo_whole_file_unchanged(&file, named->name, f->error);
    ebpo_whole_file_close(&file);
    return status;
}

/* --- notes --- */

static void lose(ebpo_attributes *to, uint64_t count, const char *one, const char *several)
{
    if (count == 1)
        ebpo_attributes_lose(to, "%s", one);
    else if (count)
        ebpo_attributes_lose(to, several, count);
}

static void note_losses(const finding *f, ebpo_attributes *to)
{
    uint64_t known = f->names.count - f->absent - f->outside - f->large;
    lose(to, f->names.left_out, "a name or a use of an image (there is no room for more)",
         "%" PRIu64 " names and uses of images (there is no room for more)");
    lose(to, f->libraries, "names of images (a material library cannot be read)",
         "names of images (%" PRIu64 " material libraries cannot be read)");
    lose(to, f->absent, "the digest of an image (there is no such file beside the source)",
         "the digests of %" PRIu64 " images (there are no such files beside the source)");
    lose(to, f->outside, "the digest of an image (its name leads out of the source's folder)",
         "the digests of %" PRIu64 " images (their names lead out of the source's folder)");
    lose(to, f->large, "an image of more than 1 GiB", "%" PRIu64 " images of more than 1 GiB");
    lose(to, f->keep ? 0 : known, "the bytes of an image (--embed-textures keeps them)",
         "the bytes of %" PRIu64 " images (--embed-textures keeps them)");
}

/* The element is ours, whatever a PLY says of one of that name. */
static void drop_own(ebpo_attributes *from)
{
    bool any = false;
    for (uint64_t i = from ? from->count : 0; i-- > 0;)
        if (ebpo_attribute_is_of_textures(&from->array[i])) {
            ebpo_attributes_remove(from, i);
            any = true;
        }
    if (any)
        ebpo_attributes_lose(from, "the element " EBPO_TEXTURE_ELEMENT);
}

static ebpo_status add_images(finding *f, ebpo_mesh *mesh)
{
    ebpo_status status = EBPO_OK;
    if (f->no_memory)
        return ebpo_fail_memory(f->error, sizeof *f->names.of);
    if (!f->names.count && !f->names.left_out && !f->libraries)
        return EBPO_OK;
    if (!mesh->attributes && !(mesh->attributes = ebpo_attributes_make(mesh->workspace)))
        return ebpo_fail_memory(f->error, sizeof *mesh->attributes);
    for (uint64_t i = 0; i < f->names.count && status == EBPO_OK; i++)
        status = add_image(f, mesh->attributes, &f->names.of[i]);
    note_losses(f, mesh->attributes);
    return status;
}

ebpo_status ebpo_textures_find(ebpo_mesh *mesh, const char *path, const uint8_t *data,
                               uint64_t size, bool keep, ebpo_error *error)
{
    finding f = { .path = path, .keep = keep, .error = error };
    drop_own(mesh->attributes);
    find_names(&f, mesh, data, size);
    ebpo_status status = add_images(&f, mesh);
    ebpo_texture_names_free(&f.names);
    return status;
}
