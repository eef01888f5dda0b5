/* All paths that can be requested are in a table, which is made at the start. A request selects an
 * entry of the table, and opens the entry's file only if it is still the same file, so no request
 * leads to another file. */
#include "cli/commands/site.h"

#include "ebpo_config.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cli/command.h"
#include "cli/remote_args.h"
#include "cli/words.h"
#include "cli/commands/folder_files.h"
#include "cli/render/thumbnail.h"
#include "cli/serve/http_request.h"

enum { PICTURE_WIDTH = 320, PICTURE_HEIGHT = 240 };

/* A path that can be requested. */
typedef struct served {
    char *path;             /* decoded */
    char *file;             /* path of the file with the content; NULL: the content is in memory */
    http_content content;   /* content.file is -1 */
    struct model *pictured; /* model whose picture is the content; NULL: other content */
} served;

typedef struct model {
    char *path;            /* of the file */
    char *name;            /* last part of the path */
    char *address;         /* path in requests, after "/models/"; encoded */
    char tag[64];          /* version of the file, as in http_content */
    uint64_t faces, bytes; /* numbers of faces and bytes of the file */
    pthread_mutex_t lock;  /* guards the picture */
    bool drawn;
    void *png; /* the picture; NULL: not drawn yet, or drawing has failed */
    size_t png_bytes;
} model;

struct site {
    site_options options;
    served *entry;
    size_t entries, capacity;
    model **model;
    size_t models, model_capacity;
    char *start; /* address of the first page, from "/" on */
    char *list;  /* of models, for the viewer */
    size_t list_bytes;
    char *scene; /* text of the scene that the first page shows; NULL: no scene */
};

/* --- the table --- */

/* Adds a path. `file`: path of the file with the content; NULL: the content is in memory. Takes
 * ownership of `path`, also on failure. */
static bool add_entry(site *s, char *path, const char *file, const http_content *content,
                      model *pictured)
{
    char *copy = file ? strdup(file) : NULL;
    if (path && s->entries == s->capacity) {
        size_t capacity = s->capacity ? 2 * s->capacity : 64;
        served *wider = realloc(s->entry, capacity * sizeof *wider);
        if (wider) {
            s->entry = wider;
            s->capacity = capacity;
        }
    }
    if (!path || s->entries == s->capacity || (file && !copy)) {
        free(path);
        free(copy);
        return false;
    }
    s->entry[s->entries] = (served){ path, copy, *content, pictured };
    s->entry[s->entries++].content.file = -1;
    return true;
}

/* Opens a regular file. Returns false with errno. */
static bool open_content(const char *path, const char *type, http_content *out)
{
    struct stat st;
    *out = (http_content){ .type = type, .file = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK) };
    if (out->file < 0)
        return false;
    if (fstat(out->file, &st) != 0 || !S_ISREG(st.st_mode)) {
        close(out->file);
        errno = EINVAL;
        return false;
    }
    out->size = (uint64_t)st.st_size;
    snprintf(out->tag, sizeof out->tag, "\"%jx-%jx-%jx.%lx\"", (uintmax_t)st.st_ino,
             (uintmax_t)st.st_size, (uintmax_t)st.st_mtim.tv_sec, (long)st.st_mtim.tv_nsec);
    return true;
}

/* Opens the file of a content if it is the file with the content's tag. Returns HTTP_OK, HTTP_GONE,
 * or HTTP_FAILED if the system lacks resources. */
static int open_again(const char *path, http_content *content)
{
    http_content now;
    if (!open_content(path, content->type, &now))
        return errno == EMFILE || errno == ENFILE || errno == ENOMEM ? HTTP_FAILED : HTTP_GONE;
    if (strcmp(now.tag, content->tag) != 0) {
        close(now.file);
        return HTTP_GONE;
    }
    *content = now;
    return HTTP_OK;
}

static const served *find_entry(const site *s, const char *path)
{
    for (size_t i = 0; i < s->entries; i++)
        if (strcmp(s->entry[i].path, path) == 0)
            return &s->entry[i];
    return NULL;
}

/* --- the viewer --- */

static const char *type_of(const char *name)
{
    static const char *const types[][2] = {
        { ".html", "text/html; charset=utf-8" },
        { ".js", "text/javascript; charset=utf-8" },
        { ".css", "text/css; charset=utf-8" },
        { ".wasm", "application/wasm" },
        { ".svg", "image/svg+xml" },
    };
    for (size_t i = 0; i < sizeof types / sizeof *types; i++)
        if (words_end_with(name, types[i][0]))
            return types[i][1];
    return NULL;
}

/* Finds the folder of the viewer: beside the program in the folder of a build, or where the viewer
 * is installed. */
static void find_viewer(const site *s, char out[PATH_MAX])
{
    char program[PATH_MAX];
    const char *const places[] = { EBPO_VIEWER_FROM_BIN, "viewer" };
    if (s->options.viewer || !realpath("/proc/self/exe", program)) {
        snprintf(out, PATH_MAX, "%s", s->options.viewer ? s->options.viewer : "viewer");
        return;
    }
    for (size_t i = sizeof places / sizeof *places; i-- > 0;) {
        char index[PATH_MAX + 16];
        int folder = places[i][0] == '/' ? 0 : (int)(strrchr(program, '/') - program + 1);
        int length = snprintf(out, PATH_MAX, "%.*s%s", folder, program, places[i]);
        snprintf(index, sizeof index, "%s/index.html", out);
        if (length < PATH_MAX && access(index, R_OK) == 0)
            return;
    }
}

static int add_viewer_file(site *s, const char *folder, const char *name, const char *type)
{
    char *path = NULL, *request = NULL;
    http_content content;
    int code = EXIT_OK;
    if (asprintf(&path, "%s/%s", folder, name) < 0)
        return command_no_memory(s->options.command);
    if (!open_content(path, type, &content)) {
        fprintf(stderr, "ebpo %s: %s: cannot be opened: %s\n", s->options.command, path,
                strerror(errno));
        code = EXIT_FAILED;
    } else {
        if (asprintf(&request, "/%s", strcmp(name, "index.html") == 0 ? "" : name) < 0)
            request = NULL;
        close(content.file);
        if (!add_entry(s, request, path, &content, NULL))
            code = command_no_memory(s->options.command);
    }
    free(path);
    return code;
}

/* Adds the files of the viewer. Folders in its folder are not searched. */
static int add_viewer(site *s)
{
    char folder[PATH_MAX];
    find_viewer(s, folder);
    DIR *d = opendir(folder);
    int code = EXIT_OK;
    for (const struct dirent *e; d && code == EXIT_OK && (e = readdir(d));)
        if (e->d_name[0] != '.' && type_of(e->d_name))
            code = add_viewer_file(s, folder, e->d_name, type_of(e->d_name));
    if (d)
        closedir(d);
    if (code == EXIT_OK && !find_entry(s, "/")) {
        fprintf(stderr,
                "ebpo %s: %s: the viewer is not in this folder; give its folder with --viewer, "
                "or make it from the sources of ebpo by 'sh tools/npm/build.sh build-npm' and 'npm "
                "ci && npm run build' in tools/web, then install ebpo again\n",
                s->options.command, folder);
        code = EXIT_FAILED;
    }
    return code;
}

/* --- models --- */

/* Encodes a name as a part of an address: all characters except letters, digits and -._~ become
 * %XX. The caller frees the result. */
static char *encode_name(const char *name)
{
    char *text = malloc(3 * strlen(name) + 1), *to = text;
    for (; text && *name; name++) {
        unsigned char c = (unsigned char)*name;
        if ((c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') ||
            strchr("-._~", c))
            *to++ = (char)c;
        else
            to += sprintf(to, "%%%02X", c);
    }
    if (text)
        *to = 0;
    return text;
}

static model *new_model(site *s, const char *path)
{
    if (s->models == s->model_capacity) {
        size_t capacity = s->model_capacity ? 2 * s->model_capacity : 16;
        model **wider = realloc(s->model, capacity * sizeof *wider);
        if (!wider)
            return NULL;
        s->model = wider;
        s->model_capacity = capacity;
    }
    model *m = calloc(1, sizeof *m);
    if (!m)
        return NULL;
    pthread_mutex_init(&m->lock, NULL);
    m->path = strdup(path);
    m->name = strdup(words_file_name(path));
    char *encoded = m->name ? encode_name(m->name) : NULL;
    if (!encoded || asprintf(&m->address, "%zu/%s", s->models, encoded) < 0)
        m->address = NULL;
    free(encoded);
    s->model[s->models++] = m;
    return m->path && m->address ? m : NULL;
}

/* Adds the paths of a model and of its picture. */
static bool add_model_entries(site *s, model *m, const http_content *content)
{
    char *path = NULL;
    size_t number = s->models - 1;
    if (asprintf(&path, "/models/%zu/%s", number, m->name) < 0)
        path = NULL;
    if (!add_entry(s, path, m->path, content, NULL))
        return false;
    if (!EBPO_HAVE_PNG)
        return true;
    http_content picture = { .type = "image/png" };
    if (asprintf(&path, "/models/%zu.png", number) < 0)
        path = NULL;
    snprintf(m->tag, sizeof m->tag, "%s", content->tag);
    return add_entry(s, path, NULL, &picture, m);
}

static int add_model(site *s, const char *path)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    remote_values how = REMOTE_VALUES_INIT;
    http_content content;
    how.max_expansion = s->options.max_expansion;
    if (!command_requires_hdf5(s->options.command, path))
        return EXIT_FAILED;
    ebpo_status status = remote_open(&file, path, &how, &error);
    if (status != EBPO_OK)
        return command_failed(s->options.command, &error);
    if (!open_content(path, "application/x-hdf5", &content)) {
        fprintf(stderr, "ebpo %s: %s: cannot be opened: %s\n", s->options.command, path,
                strerror(errno));
        ebpo_close(file);
        return EXIT_FAILED;
    }
    close(content.file);
    model *m = new_model(s, path);
    if (m) {
        m->faces = ebpo_file_info(file)->face_count;
        m->bytes = content.size;
    }
    ebpo_close(file);
    return m && add_model_entries(s, m, &content) ? EXIT_OK : command_no_memory(s->options.command);
}

/* Adds the models below a folder. Files that are not models are reported and omitted. */
static int add_folder(site *s, const char *folder)
{
    folder_files files;
    size_t before = s->models;
    int code = folder_files_find(&files, s->options.command, folder) ? EXIT_OK : EXIT_FAILED;
    for (size_t i = 0; i < files.count && code == EXIT_OK; i++) {
        char *path = NULL;
        if (asprintf(&path, "%s/%s", folder, files.path[i]) < 0)
            code = command_no_memory(s->options.command);
        else
            (void)add_model(s, path);
        free(path);
    }
    if (code == EXIT_OK && s->models == before) {
        fprintf(stderr, "ebpo %s: %s: no model is below this folder\n", s->options.command, folder);
        code = EXIT_FAILED;
    }
    folder_files_free(&files);
    return code;
}

int site_add(site *s, const char *path)
{
    struct stat st;
    if (strncmp(path, "http://", 7) == 0 || strncmp(path, "https://", 8) == 0)
        return command_usage(s->options.command,
                             "%s: files of other servers cannot be served; open the "
                             "address in the viewer, or fetch the file",
                             path);
    return stat(path, &st) == 0 && S_ISDIR(st.st_mode) ? add_folder(s, path) : add_model(s, path);
}

/* --- the list of models --- */

void site_print_models(const site *s, json *j, bool for_viewer)
{
    json_array(j, for_viewer ? NULL : "models");
    for (size_t i = 0; i < s->models; i++) {
        const model *m = s->model[i];
        size_t length = strlen(m->name);
        char *name = strndup(m->name, words_end_with(m->name, ".ebpo.h5") ? length - 8 : length);
        json_object(j, NULL);
        json_text(j, "name", name ? name : m->name);
        json_text(j, "file", for_viewer ? m->address : m->path);
        json_uint(j, "faces", m->faces);
        json_uint(j, "bytes", m->bytes);
        if (for_viewer && EBPO_HAVE_PNG) {
            char picture[40];
            snprintf(picture, sizeof picture, "%zu.png", i);
            json_text(j, "picture", picture);
        }
        json_end(j);
        free(name);
    }
    json_end(j);
}

/* Makes the address of the first page: of the scene, of the only model, or of the list of models. A
 * path in the query is decoded once more than a path, so its % becomes %25. */
static bool make_start(site *s)
{
    const char *only = s->models == 1 ? s->model[0]->address : "";
    const char *more = s->options.query ? s->options.query : "";
    size_t space = sizeof "/?samples=models/index.json" + 3 * strlen(only) + strlen(more);
    char *to = s->start = malloc(space);
    if (!to)
        return false;
    if (s->scene) {
        snprintf(to, space, "/?scene=scene.json%s", more);
        return true;
    }
    if (s->models != 1) {
        snprintf(to, space, "/?samples=models/index.json");
        return true;
    }
    for (to += sprintf(to, "/?file=models/"); *only; only++)
        to += sprintf(to, *only == '%' ? "%%25" : "%c", *only);
    strcpy(to, more);
    return true;
}

int site_show_scene(site *s, char *text)
{
    const http_content content = { .type = "application/json",
                                   .bytes = text,
                                   .size = text ? strlen(text) : 0 };
    s->scene = text;
    return text && add_entry(s, strdup("/scene.json"), NULL, &content, NULL)
               ? EXIT_OK
               : command_no_memory(s->options.command);
}

/* Adds the files of the viewer and the list of models, and sets the address of the first page. */
int site_finish(site *s)
{
    json j;
    int code = add_viewer(s);
    if (code != EXIT_OK)
        return code;
    FILE *f = open_memstream(&s->list, &s->list_bytes);
    if (!f)
        return command_no_memory(s->options.command);
    json_begin(&j, f);
    site_print_models(s, &j, true);
    json_finish(&j);
    if (fclose(f) != 0)
        return command_no_memory(s->options.command);
    http_content content = { .type = "application/json", .bytes = s->list, .size = s->list_bytes };
    return make_start(s) && add_entry(s, strdup("/models/index.json"), NULL, &content, NULL)
               ? EXIT_OK
               : command_no_memory(s->options.command);
}

/* --- requests --- */

/* Draws the picture of a model when it is first requested, if the file is the same as at the start.
 */
static int find_picture(const site *s, model *m, http_content *out)
{
#if EBPO_HAVE_PNG
    pthread_mutex_lock(&m->lock);
    if (!m->drawn) {
        ebpo_error error = EBPO_ERROR_INIT;
        http_content file = { .type = "" };
        memcpy(file.tag, m->tag, sizeof file.tag);
        m->drawn = true;
        if (open_again(m->path, &file) == HTTP_OK) {
            close(file.file);
            if (thumbnail_draw(m->path, s->options.max_expansion, PICTURE_WIDTH, PICTURE_HEIGHT,
                               &m->png, &m->png_bytes, &error) != EBPO_OK)
                (void)command_failed(s->options.command, &error);
        }
    }
    pthread_mutex_unlock(&m->lock);
#else
    (void)s; /* the table has no pictures */
#endif
    out->bytes = m->png;
    out->size = m->png_bytes;
    return m->png ? HTTP_OK : HTTP_FAILED;
}

int site_find(void *user, const char *path, bool has_query, http_content *out)
{
    const site *s = user;
    if (strcmp(path, "/") == 0 && !has_query) {
        out->location = s->start;
        return HTTP_FOUND;
    }
    const served *found = find_entry(s, path);
    if (!found)
        return HTTP_NOT_FOUND;
    *out = found->content;
    return found->pictured ? find_picture(s, found->pictured, out)
           : found->file   ? open_again(found->file, out)
                           : HTTP_OK;
}

/* --- making and freeing --- */

site *site_new(const site_options *options)
{
    site *s = calloc(1, sizeof *s);
    if (!s) {
        (void)command_no_memory(options->command);
        return NULL;
    }
    s->options = *options;
    return s;
}

size_t site_model_count(const site *s) { return s->models; }

void site_free(site *s)
{
    if (!s)
        return;
    for (size_t i = 0; i < s->entries; i++) {
        free(s->entry[i].path);
        free(s->entry[i].file);
    }
    for (size_t i = 0; i < s->models; i++) {
        pthread_mutex_destroy(&s->model[i]->lock);
        free(s->model[i]->path);
        free(s->model[i]->name);
        free(s->model[i]->address);
        free(s->model[i]->png);
        free(s->model[i]);
    }
    free(s->entry);
    free(s->model);
    free(s->list);
    free(s->scene);
    free(s->start);
    free(s);
}
