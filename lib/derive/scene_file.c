#include "derive/scene_file.h"

#include "ebpo_config.h"

#if EBPO_HAVE_ASSIMP

#include <assimp/cfileio.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "core/error.h"
#include "io/file_source.h"

typedef struct cursor {
    ebpo_scene_file *target;
    FILE *stream;
} cursor;

static cursor *cursor_of(struct aiFile *file) { return (cursor *)(void *)file->UserData; }

/* assimp ignores what this returns, so the failure is kept. */
static void note_failure(ebpo_scene_file *target)
{
    target->why = target->failed ? target->why : errno;
    target->failed = true;
}

static size_t write_bytes(struct aiFile *file, const char *from, size_t size, size_t count)
{
    cursor *c = cursor_of(file);
    size_t done = fwrite(from, size, count, c->stream);
    if (done != count && size)
        note_failure(c->target);
    return done;
}

static size_t read_bytes(struct aiFile *file, char *to, size_t size, size_t count)
{
    (void)file, (void)to, (void)size, (void)count;
    return 0;
}

static size_t tell_stream(struct aiFile *file)
{
    off_t at = ftello(cursor_of(file)->stream);
    return at > 0 ? (size_t)at : 0;
}

static enum aiReturn seek_stream(struct aiFile *file, size_t offset, enum aiOrigin origin)
{
    int whence = origin == aiOrigin_SET ? SEEK_SET : origin == aiOrigin_CUR ? SEEK_CUR : SEEK_END;
    return fseeko(cursor_of(file)->stream, (off_t)offset, whence) == 0 ? aiReturn_SUCCESS
                                                                       : aiReturn_FAILURE;
}

static size_t file_size(struct aiFile *file)
{
    size_t at = tell_stream(file), end;
    (void)seek_stream(file, 0, aiOrigin_END);
    end = tell_stream(file);
    (void)seek_stream(file, at, aiOrigin_SET);
    return end;
}

static void flush_stream(struct aiFile *file)
{
    if (fflush(cursor_of(file)->stream) != 0)
        note_failure(cursor_of(file)->target);
}

static struct aiFile *open_file(struct aiFileIO *io, const char *name, const char *mode)
{
    ebpo_scene_file *target = (ebpo_scene_file *)(void *)io->UserData;
    if (mode[0] != 'w')
        return NULL;
    bool known = strcmp(ebpo_path_name(target->path), ebpo_path_name(name)) == 0;
    FILE *stream = known ? ebpo_publish_stream(&target->publish) : NULL;
    if (!known)
        snprintf(target->unknown, sizeof target->unknown, "%s", name);
    struct aiFile *file = calloc(1, sizeof *file);
    cursor *c = calloc(1, sizeof *c);
    if (!stream || !file || !c) {
        free(file);
        free(c);
        target->failed = true;
        target->why = ENOMEM;
        return NULL;
    }
    target->stream = stream;
    *c = (cursor){ target, stream };
    *file = (struct aiFile){ read_bytes, write_bytes,          tell_stream, file_size, seek_stream,
                             flush_stream,      (aiUserData)(void *)c };
    return file;
}

static void close_file(struct aiFileIO *io, struct aiFile *file)
{
    (void)io;
    flush_stream(file);
    free(file->UserData);
    free(file);
}

void ebpo_scene_file_begin(ebpo_scene_file *file, const char *path)
{
    *file = (ebpo_scene_file){ .path = path, .publish = EBPO_PUBLISH_INIT };
}

void ebpo_scene_file_offer(ebpo_scene_file *file, struct aiFileIO *io)
{
    *io = (struct aiFileIO){ open_file, close_file, (aiUserData)(void *)file };
}

ebpo_status ebpo_scene_file_commit(ebpo_scene_file *file, ebpo_error *error)
{
    if (file->unknown[0])
        return ebpo_fail_file(error, EBPO_E_UNSUPPORTED, file->path,
                              "this assimp wants to write a file '%s' too, which nobody knows of; "
                              "take another format",
                              file->unknown);
    if (file->failed) {
        errno = file->why;
        return ebpo_fail_errno(error, file->path, "could not be written");
    }
    if (!file->stream)
        return ebpo_fail_file(error, EBPO_E_UNSUPPORTED, file->path,
                              "this assimp has written nothing; take another format");
    return ebpo_publish_commit(&file->publish, error);
}

void ebpo_scene_file_abort(ebpo_scene_file *file) { ebpo_publish_abort(&file->publish); }

#endif
