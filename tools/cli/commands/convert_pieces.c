/* Implements ebpo convert --split-components and --split-groups. The pieces of the mesh are its
 * components (faces connected by common vertices) or its groups (of an OBJ file). The output is a
 * folder with one model for each piece, and a scene of these models. */
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <ebpo/ebpo.h>
#include <ebpo/groups.h>

#include "cli/command.h"
#include "cli/commands/convert_pieces.h"
#include "cli/json.h"
#include "cli/mesh_advice.h"
#include "cli/mesh_findings.h"
#include "cli/progress.h"
#include "cli/remote_args.h"
#include "cli/signals.h"
#include "cli/words.h"

/* --- names of pieces --- */

/* Sizes of names in bytes, with the final 0. NAME_SIZE: in file names; SHOWN_SIZE: in the scene. */
enum { NAME_SIZE = 96, SHOWN_SIZE = 256 };

/* Maximum lengths of the group's own name within a longer name. OWN_NAME_MAX: within a file name.
 * SPELT_MAX: within a name in the scene that ends in a number. */
enum { OWN_NAME_MAX = 40, SPELT_MAX = 220 };

static bool is_safe(char c)
{
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
           c == '_';
}

/* Writes "KIND-NUMBER-NAME", with letters, digits, '-' and '_' only. The number has `digits` digits
 * and makes the name unique. own_name: the source of NAME; NULL: the name has no NAME. */
static void piece_file_name(char out[NAME_SIZE], const char *kind, int digits, uint64_t number,
                            const char *own_name)
{
    size_t size =
        (size_t)snprintf(out, NAME_SIZE, "%s-%0*llu", kind, digits, (unsigned long long)number);
    if (!own_name || !*own_name || size + OWN_NAME_MAX + 2 > NAME_SIZE)
        return;
    out[size++] = '-';
    for (int i = 0; own_name[i] && i < OWN_NAME_MAX; i++)
        out[size++] = is_safe(own_name[i]) ? own_name[i] : '_';
    out[size] = 0;
}

/* Returns true if scene files use the name to select many instances. */
static bool is_selector(const char *own_name)
{
    return strcmp(own_name, "*") == 0 || strncmp(own_name, "layer:", 6) == 0 ||
           strncmp(own_name, "group:", 6) == 0;
}

/* Returns the number of bytes of the character at `s`; 0: a scene does not allow the character. */
static int plain_length(const char *s)
{
    unsigned char c = (unsigned char)*s;
    return c < 0x20 || c == 0x7f ? 0 : json_utf8_length(s);
}

/* Returns true if an instance can have this name: 1 to 255 bytes of UTF-8 without control
 * characters, and no selector (see is_selector). */
static bool is_scene_name(const char *own_name)
{
    size_t size = strnlen(own_name, SHOWN_SIZE);
    if (size == 0 || size >= SHOWN_SIZE || is_selector(own_name))
        return false;
    for (const char *s = own_name; *s;) {
        int length = plain_length(s);
        if (length == 0)
            return false;
        s += length;
    }
    return true;
}

/* For qsort of pointers to names. */
static int compare_names(const void *a, const void *b)
{
    return strcmp(*(const char *const *)a, *(const char *const *)b);
}

/* Writes the name, with \xNN for each byte that is not allowed and for the first byte of a
 * selector. Truncates a long name. Returns the length. */
static size_t spell_name(char *out, const char *own_name)
{
    size_t size = 0;
    bool escapes_next = is_selector(own_name);
    for (const char *s = own_name; *s && size + 4 <= SPELT_MAX; escapes_next = false) {
        int length = escapes_next ? 0 : plain_length(s);
        if (length)
            memcpy(out + size, s, (size_t)length);
        else
            snprintf(out + size, 5, "\\x%02x", (unsigned char)*s);
        size += length ? (size_t)length : 4;
        s += length ? length : 1;
    }
    return size;
}

/* Writes the name of a group in the scene. This is the group's own name if a scene can have it.
 * Otherwise it is derived from the group's name and a number, and differs from all names in
 * `taken`. `taken`: the sorted names of groups that are used unchanged. */
static void write_shown_name(char out[SHOWN_SIZE], const char *own_name, uint64_t number,
                             const char *const *taken, uint64_t taken_count)
{
    if (is_scene_name(own_name)) {
        snprintf(out, SHOWN_SIZE, "%s", own_name);
        return;
    }
    size_t size = spell_name(out, own_name);
    size += (size_t)snprintf(out + size, SHOWN_SIZE - size, " #%llu", (unsigned long long)number);
    while (size + 1 < SHOWN_SIZE &&
           bsearch(&out, taken, taken_count, sizeof *taken, compare_names)) {
        out[size++] = '#';
        out[size] = 0;
    }
}

/* Words for a kind of pieces. */
typedef struct piece_kind {
    const char *singular, *plural;
    const char *scene;    /* file name of the scene */
    const char *building; /* name of the stage for the progress line */
    const char *hint;     /* ends the message on too many pieces */
} piece_kind;

static const piece_kind components = { "component", "components", "components.scene.json",
                                       "building components",
                                       "; merge vertices at the same position with --weld" },
                        groups = { "group", "groups", "groups.scene.json", "building groups", "" };

enum { PIECES_MAX = 100000, ENDING_SIZE = 16 }; /* the ending: ".ebpo.h5" */

/* A piece and its file. */
typedef struct piece {
    char name[NAME_SIZE], file[NAME_SIZE + ENDING_SIZE];
    char *shown; /* the name of the group in the scene; NULL: `name` is the name in the scene */
    ebpo_component facts;
    /* facts of the file */
    bool solid;
    int levels;
    uint64_t bytes;
    char digest[65]; /* content_sha256 as hexadecimal digits */
} piece;

typedef struct piece_writer {
    const pieces_run *run;
    const piece_kind *kind;
    mesh_input *whole; /* the mesh that is split */
    ebpo_components *components;
    piece *pieces;       /* [count] */
    uint64_t count;      /* 0 until the pieces are named */
    uint64_t faces_done; /* number of faces of written pieces */
} piece_writer;

/* ---- the folder ---- */

/* The temporary folder and the files that it may contain. These are static because a signal handler
 * removes the folder. */
static char *temporary_folder; /* path; NULL: there is no temporary folder */
static int temporary_fd = -1;  /* the open folder; -1: none */
static piece *volatile temporary_pieces;
static volatile uint64_t temporary_count; /* number of pieces */
static const char *scene_name;            /* file name of the scene */

/* Removes the temporary folder, unless it has its final name. Uses only async-signal-safe calls. */
static void remove_folder(void)
{
    if (!temporary_folder || access(temporary_folder, F_OK) != 0)
        return;
    for (uint64_t i = 0; i < temporary_count; i++)
        unlinkat(temporary_fd, temporary_pieces[i].file, 0);
    unlinkat(temporary_fd, scene_name, 0);
    rmdir(temporary_folder);
}

ebpo_status pieces_begin(const char *folder, bool of_groups, ebpo_error *error)
{
    scene_name = (of_groups ? &groups : &components)->scene;
    ebpo_status status = ebpo_folder_begin(folder, &temporary_folder, error);
    if (status != EBPO_OK)
        return status;
    temporary_fd = open(temporary_folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    signals_set_cleanup(remove_folder);
    return EBPO_OK;
}

void pieces_end(void)
{
    remove_folder();
    signals_set_cleanup(NULL);
    if (temporary_fd >= 0)
        close(temporary_fd);
    free(temporary_folder);
    temporary_folder = NULL;
    temporary_fd = -1;
    free(temporary_pieces);
    temporary_pieces = NULL;
    temporary_count = 0;
}

static void free_names(const piece_writer *w)
{
    for (uint64_t i = 0; i < w->count; i++)
        free(w->pieces[i].shown);
}

static ebpo_status no_memory(ebpo_error *error)
{
    error->status = EBPO_E_MEMORY;
    snprintf(error->message, sizeof error->message, "there is not enough memory");
    return EBPO_E_MEMORY;
}

/* Returns the path of a file in the temporary folder; NULL: there is not enough memory. */
static char *path_of(const char *name)
{
    size_t size = strlen(temporary_folder) + strlen(name) + 2;
    char *path = malloc(size);
    if (path)
        snprintf(path, size, "%s/%s", temporary_folder, name);
    return path;
}

/* ---- pieces ---- */

static ebpo_status fail_too_many(const piece_writer *w, ebpo_error *error)
{
    error->status = EBPO_E_LIMIT;
    snprintf(error->message, sizeof error->message, "%s: has %llu %s, and at most %d are written%s",
             w->whole->as_read.source_name,
             (unsigned long long)ebpo_components_count(w->components), w->kind->plural, PIECES_MAX,
             w->kind->hint);
    return EBPO_E_LIMIT;
}

/* Sets the names and the facts of a piece. All numbers in names have as many digits as the greatest
 * number, so that the order of names is the order of numbers. */
static ebpo_status name_piece(const piece_writer *w, uint64_t i, int digits, ebpo_error *error)
{
    piece *p = &w->pieces[i];
    ebpo_mesh_group group = EBPO_MESH_GROUP_INIT;
    ebpo_status status = EBPO_OK;
    if (w->run->groups)
        status = ebpo_mesh_groups_get(w->run->groups, i, &group, error);
    piece_file_name(p->name, w->kind->singular, digits, i, group.name);
    snprintf(p->file, sizeof p->file, "%s.ebpo.h5", p->name);
    p->facts = (ebpo_component)EBPO_COMPONENT_INIT;
    return status == EBPO_OK ? ebpo_components_get(w->components, i, &p->facts, error) : status;
}

/* Sets the names of groups in the scene. */
static ebpo_status show_names(const piece_writer *w, ebpo_error *error)
{
    const char **own_name = calloc(w->count, sizeof *own_name),
               **taken = calloc(w->count, sizeof *taken);
    uint64_t count = 0;
    ebpo_status status = own_name && taken ? EBPO_OK : no_memory(error);
    for (uint64_t i = 0; i < w->count && status == EBPO_OK; i++) {
        ebpo_mesh_group group = EBPO_MESH_GROUP_INIT;
        status = ebpo_mesh_groups_get(w->run->groups, i, &group, error);
        own_name[i] = group.name;
        if (status == EBPO_OK && is_scene_name(own_name[i]))
            taken[count++] = own_name[i];
    }
    if (status == EBPO_OK)
        qsort(taken, count, sizeof *taken, compare_names);
    for (uint64_t i = 0; i < w->count && status == EBPO_OK; i++) {
        char name[SHOWN_SIZE];
        write_shown_name(name, own_name[i], i, taken, count);
        w->pieces[i].shown = strdup(name);
        status = w->pieces[i].shown ? EBPO_OK : no_memory(error);
    }
    free(own_name);
    free(taken);
    return status;
}

static ebpo_status name_pieces(piece_writer *w, ebpo_error *error)
{
    uint64_t count = ebpo_components_count(w->components), max_faces = 0;
    if (count > PIECES_MAX)
        return fail_too_many(w, error);
    w->pieces = calloc(count, sizeof *w->pieces);
    if (!w->pieces)
        return no_memory(error);
    int digits = snprintf(NULL, 0, "%llu", (unsigned long long)count - 1);
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++) {
        status = name_piece(w, i, digits, error);
        max_faces =
            w->pieces[i].facts.face_count > max_faces ? w->pieces[i].facts.face_count : max_faces;
    }
    w->count = count;
    temporary_pieces = w->pieces;
    temporary_count = count;
    if (status == EBPO_OK && w->run->groups)
        status = show_names(w, error);
    return status == EBPO_OK ? w->run->fits(w->run->user, max_faces, error) : status;
}

static const char *shown_name(const piece *p) { return p->shown ? p->shown : p->name; }

/* ---- files ---- */

static bool report_piece(void *user, const char *stage, uint64_t done, uint64_t total)
{
    const piece_writer *w = user;
    const ebpo_progress *outer = &w->run->progress;
    (void)stage, (void)done, (void)total;
    return !outer->report ||
           outer->report(outer->user, w->kind->building, w->faces_done, w->whole->mesh.face_count);
}

static ebpo_status inspect_piece(piece *p, const char *path, ebpo_error *error)
{
    ebpo_file *file = NULL;
    ebpo_status status = remote_open_own(path, &file, error);
    if (status != EBPO_OK)
        return status;
    const ebpo_info *info = ebpo_file_info(file);
    p->solid = info->solid;
    p->levels = info->level_count;
    p->bytes = info->file_bytes;
    for (int i = 0; i < 32; i++)
        snprintf(p->digest + 2 * i, 3, "%02x", info->content_sha256[i]);
    ebpo_close(file);
    return EBPO_OK;
}

/* Sets *out to the mesh of a piece, and checks it. No repair is needed, because the whole mesh was
 * repaired. */
static ebpo_status take_mesh(const piece_writer *w, uint64_t number, mesh_input *out,
                             ebpo_error *error)
{
    ebpo_progress progress = { report_piece, (void *)(uintptr_t)w };
    *out = *w->whole;
    ebpo_status status = ebpo_components_mesh(w->components, number, &out->mesh, error);
    if (status == EBPO_OK)
        status = ebpo_mesh_arrange(&out->mesh, w->run->threads, progress, error);
    if (status == EBPO_OK)
        status =
            ebpo_mesh_check(&out->mesh, w->run->threads, progress, &out->prepared.report, error);
    out->doubts = status == EBPO_OK ? ebpo_mesh_doubts(0, &out->prepared.report, NULL) : 0;
    if (status != EBPO_OK)
        ebpo_mesh_free(&out->mesh);
    return status;
}

static ebpo_status write_piece(piece_writer *w, uint64_t number, ebpo_error *error)
{
    ebpo_progress progress = { report_piece, w };
    mesh_input piece_mesh;
    char *path = path_of(w->pieces[number].file);
    if (!path)
        return no_memory(error);
    ebpo_status status = take_mesh(w, number, &piece_mesh, error);
    if (status == EBPO_OK && w->run->groups) { /* warnings are printed for each group */
        progress_wipe(w->run->line);
        advice_warn(stderr, "convert", shown_name(&w->pieces[number]), &piece_mesh);
    }
    if (status == EBPO_OK)
        status = w->run->build(w->run->user, &piece_mesh, path, progress, error);
    if (status == EBPO_OK)
        status = inspect_piece(&w->pieces[number], path, error);
    w->faces_done += w->pieces[number].facts.face_count;
    free(path);
    return status;
}

/* ---- the scene ---- */

static void print_scene(const piece_writer *w, FILE *out)
{
    json j;
    json_begin(&j, out);
    json_object(&j, NULL);
    json_text(&j, "ebpo_scene", "1.0");
    if (w->run->unit)
        json_text(&j, "unit", w->run->unit);
    json_object(&j, "models");
    for (uint64_t i = 0; i < w->count; i++) {
        json_object(&j, w->pieces[i].name);
        json_text(&j, "file", w->pieces[i].file);
        json_text(&j, "content_sha256", w->pieces[i].digest);
        json_end(&j);
    }
    json_end(&j);
    json_array(&j, "instances");
    for (uint64_t i = 0; i < w->count; i++) {
        json_object(&j, NULL);
        json_text(&j, "name", shown_name(&w->pieces[i]));
        json_text(&j, "model", w->pieces[i].name);
        json_end(&j);
    }
    json_finish(&j);
}

static ebpo_status write_scene(const piece_writer *w, ebpo_error *error)
{
    char *text = NULL, *path = path_of(scene_name);
    size_t size = 0;
    FILE *out = open_memstream(&text, &size);
    ebpo_status status = out && path ? EBPO_OK : no_memory(error);
    if (status == EBPO_OK)
        print_scene(w, out);
    bool complete = out && !ferror(out);
    if (out && fclose(out) != 0)
        complete = false;
    if (status == EBPO_OK)
        status = complete ? ebpo_write_file(path, text, size, error) : no_memory(error);
    free(text);
    free(path);
    return status;
}

/* ---- output ---- */

static void print_words(const piece_writer *w, double seconds)
{
    char bytes[32], faces[40];
    uint64_t sum = 0;
    for (uint64_t i = 0; i < w->count; i++) {
        const piece *p = &w->pieces[i];
        sum += p->bytes;
        printf("%s: ", p->name);
        if (p->shown)
            printf("'%s', ", p->shown);
        printf("%s, %s", p->solid ? "a solid" : "a surface",
               words_plural(faces, sizeof faces, p->facts.face_count, "face", "faces"));
        if (p->facts.cavities)
            printf(" with %llu %s", (unsigned long long)p->facts.cavities,
                   p->facts.cavities == 1 ? "cavity" : "cavities");
        printf(", from face %llu on, levels 0 to %d, %s\n", (unsigned long long)p->facts.first_face,
               p->levels - 1, words_bytes(bytes, sizeof bytes, p->bytes));
    }
    printf("%s: %llu %s, %s, in %.1f s\n", w->run->folder, (unsigned long long)w->count,
           w->count == 1 ? w->kind->singular : w->kind->plural,
           words_bytes(bytes, sizeof bytes, sum), seconds);
}

static void print_json(const piece_writer *w, double seconds)
{
    json j;
    json_begin(&j, stdout);
    json_object(&j, NULL);
    json_text(&j, "folder", w->run->folder);
    json_text(&j, "scene", scene_name);
    json_array(&j, w->kind->plural);
    for (uint64_t i = 0; i < w->count; i++) {
        const piece *p = &w->pieces[i];
        json_object(&j, NULL);
        json_text(&j, "name", p->name);
        if (p->shown)
            json_text(&j, "group", p->shown);
        json_text(&j, "file", p->file);
        json_text(&j, "content_sha256", p->digest);
        json_bool(&j, "solid", p->solid);
        json_uint(&j, "faces", p->facts.face_count);
        json_uint(&j, "vertices", p->facts.vertex_count);
        json_uint(&j, "first_face", p->facts.first_face);
        json_uint(&j, "cavities", p->facts.cavities);
        json_int(&j, "levels", p->levels);
        json_uint(&j, "bytes", p->bytes);
        json_end(&j);
    }
    json_end(&j);
    json_object(&j, "input");
    findings_json_source(&j, "mesh", &w->whole->as_read, w->whole->unread);
    ebpo_solid_volume before = mesh_input_solid(w->whole, false);
    findings_json(&j, "report", &w->whole->prepared.before, &before);
    json_end(&j);
    json_real(&j, "seconds", seconds);
    json_finish(&j);
}

/* ---- all of it ---- */

/* Reports groups without faces, for which no model is written. In the list of groups, these follow
 * all other groups. */
static ebpo_status report_empty(const piece_writer *w, ebpo_error *error)
{
    uint64_t count = ebpo_mesh_groups_count(w->run->groups);
    if (count <= w->count)
        return EBPO_OK;
    ebpo_mesh_group group = EBPO_MESH_GROUP_INIT;
    char first[SHOWN_SIZE];
    ebpo_status status = ebpo_mesh_groups_get(w->run->groups, w->count, &group, error);
    if (status != EBPO_OK)
        return status;
    write_shown_name(first, group.name, w->count, NULL, 0);
    progress_wipe(w->run->line);
    fprintf(stderr,
            "ebpo convert: %s: note: %llu of %llu groups %s no faces, and no model: '%s'%s\n",
            w->whole->as_read.source_name, (unsigned long long)(count - w->count),
            (unsigned long long)count, count - w->count > 1 ? "have" : "has", first,
            count - w->count > 1 ? " and others" : "");
    return EBPO_OK;
}

static ebpo_status find_pieces(piece_writer *w, ebpo_error *error)
{
    const pieces_run *run = w->run;
    return run->groups
               ? ebpo_components_of_groups(&w->whole->mesh, run->groups, &w->components, error)
               : ebpo_components_new(&w->whole->mesh, run->threads, run->progress, &w->components,
                                     error);
}

static ebpo_status write_all(piece_writer *w, ebpo_error *error)
{
    const pieces_run *run = w->run;
    ebpo_status status = find_pieces(w, error);
    if (status == EBPO_OK)
        status = name_pieces(w, error);
    if (status == EBPO_OK)
        status = report_empty(w, error);
    for (uint64_t i = 0; i < w->count && status == EBPO_OK; i++)
        status = write_piece(w, i, error);
    if (status == EBPO_OK)
        status = write_scene(w, error);
    if (status == EBPO_OK)
        status = ebpo_folder_publish(temporary_folder, run->folder, error);
    return status;
}

ebpo_status pieces_write(const pieces_run *run, mesh_input *whole, double begun, ebpo_error *error)
{
    piece_writer w = { .run = run, .kind = run->groups ? &groups : &components, .whole = whole };
    ebpo_status status = write_all(&w, error);
    ebpo_components_free(w.components);
    ebpo_mesh_free(&whole->mesh);
    if (status == EBPO_OK) {
        temporary_count = 0; /* the folder is complete, and is kept */
        free(temporary_folder);
        temporary_folder = NULL;
        progress_wipe(run->line);
        if (run->json)
            print_json(&w, progress_now() - begun);
        else if (!run->quiet)
            print_words(&w, progress_now() - begun);
    }
    free_names(&w);
    return status;
}
