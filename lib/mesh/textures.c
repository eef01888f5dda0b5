/* Finds image files that a source names and stores them. Each image becomes a row of the element
 * `ebpo:texture`, with its name and bytes (format-spec/attributes.md). Names come from comments of
 * a PLY file and from the material libraries of an OBJ file. Files are searched only in the
 * source's folder and below. Files that are missing, too large or not images are reported and
 * omitted. */
#include "core/strict_fp.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/checksum.h"
#include "core/error.h"
#include "core/hash.h"
#include "core/text.h"
#include "core/workspace.h"
#include "io/file_source.h"
#include "mesh/textures.h"

enum {
    TEXTURES_DIGEST = 32,   /* bytes of a SHA-256 */
    TEXTURES_STEP = 1 << 20 /* bytes that are hashed between two releases of pages */
};

const char *ebpo_texture_array_name(ebpo_texture_array which)
{
    static const char *const names[EBPO_TEXTURE_ARRAYS] = { "name", "use", "sha256", "bytes" };
    return names[which];
}

static ebpo_attribute *find_array(const ebpo_attributes *all, ebpo_texture_array which)
{
    for (uint64_t i = 0; all && i < all->count; i++) {
        ebpo_attribute *a = &all->array[i];
        if (ebpo_attribute_is_of_textures(a) && a->type == EBPO_ATTRIBUTE_UINT8 &&
            a->list != EBPO_ATTRIBUTE_NO_LIST &&
            strcmp(a->names, ebpo_texture_array_name(which)) == 0)
            return a;
    }
    return NULL;
}

const ebpo_attribute *ebpo_textures_array(const ebpo_attributes *all, ebpo_texture_array which)
{
    return find_array(all, which);
}

ebpo_texture_bytes ebpo_texture_list(const ebpo_attribute *a, uint64_t row)
{
    if (!a || row >= a->rows)
        return (ebpo_texture_bytes){ NULL, 0 };
    uint64_t from = row * a->columns, to = from + a->columns;
    if (a->ends) {
        from = row ? a->ends[row - 1] : 0;
        to = a->ends[row];
    }
    return (ebpo_texture_bytes){ a->values ? a->values + from : NULL, to - from };
}

static ebpo_attribute *make_array(ebpo_attributes *to, ebpo_texture_array which)
{
    ebpo_attribute head = { .element = EBPO_TEXTURE_ELEMENT,
                            .type = EBPO_ATTRIBUTE_UINT8,
                            .list = EBPO_ATTRIBUTE_UINT32,
                            .columns = 1 };
    snprintf(head.names, sizeof head.names, "%s", ebpo_texture_array_name(which));
    return ebpo_attributes_add(to, &head);
}

static bool add_row(ebpo_workspace *workspace, ebpo_attribute *a, ebpo_texture_bytes list)
{
    uint64_t from = a->rows ? a->ends[a->rows - 1] : 0, end = from + list.count;
    if (!ebpo_attribute_reserve(workspace, a, a->rows + 1, end))
        return false;
    if (list.count)
        ebpo_array_copy(workspace, a->values + from, list.at, list.count);
    a->ends[a->rows++] = end;
    return true;
}

ebpo_status ebpo_textures_add(ebpo_attributes *to, bool keep,
                              const ebpo_texture_bytes list[EBPO_TEXTURE_ARRAYS], ebpo_error *error)
{
    for (int which = 0; which < (keep ? EBPO_TEXTURE_ARRAYS : EBPO_TEXTURE_BYTES); which++) {
        ebpo_attribute *a = find_array(to, (ebpo_texture_array)which);
        if (!a && !(a = make_array(to, (ebpo_texture_array)which)))
            return ebpo_fail_memory(error, sizeof *a);
        if (!add_row(to->workspace, a, list[which]))
            return ebpo_workspace_fail(to->workspace, list[which].count, error);
    }
    return EBPO_OK;
}

/* Returns true if `sha256` is the SHA-256 of the bytes. */
static bool is_digest(ebpo_texture_bytes bytes, ebpo_texture_bytes sha256,
                      ebpo_workspace *workspace)
{
    uint8_t digest[TEXTURES_DIGEST];
    ebpo_sha256 state;
    ebpo_sha256_begin(&state);
    EBPO_FOR_PIECES(workspace, at, bytes.count, TEXTURES_STEP)
        ebpo_sha256_add(&state, (const uint8_t *)bytes.at + at,
                        bytes.count - at < TEXTURES_STEP ? (size_t)(bytes.count - at)
                                                         : TEXTURES_STEP);
    ebpo_sha256_end(&state, digest);
    return sha256.count == TEXTURES_DIGEST && !ebpo_digest_differs(sha256.at, digest);
}

bool ebpo_textures_good(const ebpo_attributes *all)
{
    const ebpo_attribute *bytes = find_array(all, EBPO_TEXTURE_BYTES),
                         *sha256 = find_array(all, EBPO_TEXTURE_SHA256);
    for (uint64_t i = 0; bytes && i < bytes->rows; i++) {
        ebpo_texture_bytes list = ebpo_texture_list(bytes, i);
        if (list.count && !is_digest(list, ebpo_texture_list(sha256, i), all->workspace))
            return false;
    }
    return true;
}

/* Text without a terminating zero. */
typedef struct words {
    const char *s;
    size_t n;
} words;

/* Names that face attributes refer to by index, in the order of the header's comments. */
typedef struct numbered {
    const ebpo_attribute *of_faces; /* attribute of faces that refers to the names; NULL: none */
    words *name;
    bool *used; /* [count] true: a kept face refers to the name */
    uint64_t count, capacity;
} numbered;

typedef struct naming {
    ebpo_attributes *all;
    numbered materials, files;
    bool *kept; /* [rows of the textures] true: the bytes are kept */
} naming;

static words trim_words(words t)
{
    while (t.n && (*t.s == ' ' || *t.s == '\t' || *t.s == '\r'))
        t = (words){ t.s + 1, t.n - 1 };
    while (t.n && (t.s[t.n - 1] == ' ' || t.s[t.n - 1] == '\t' || t.s[t.n - 1] == '\r'))
        t.n--;
    return t;
}

/* Removes and returns the first word. */
static words first_word(words *rest)
{
    words t = trim_words(*rest), word = { t.s, 0 };
    while (word.n < t.n && t.s[word.n] != ' ' && t.s[word.n] != '\t')
        word.n++;
    *rest = trim_words((words){ t.s + word.n, t.n - word.n });
    return word;
}

/* Removes the first line. Returns false when there is none. */
static bool first_line(words *text, words *line)
{
    const char *stop = text->n ? memchr(text->s, '\n', text->n) : NULL;
    size_t n = stop ? (size_t)(stop - text->s) : text->n;
    *line = (words){ text->s, n };
    if (!text->n)
        return false;
    n += stop != NULL;
    *text = (words){ text->s + n, text->n - n };
    return true;
}

static bool words_are(words a, const char *text)
{
    return a.n == strlen(text) && (!a.n || memcmp(a.s, text, a.n) == 0);
}

/* Returns the face attribute with this name and one value for each face, or NULL. */
static const ebpo_attribute *find_face_attribute(const ebpo_attributes *all, const char *name)
{
    for (uint64_t i = 0; i < all->count; i++) {
        const ebpo_attribute *a = &all->array[i];
        if (ebpo_attribute_is_of(a, "face") && a->list == EBPO_ATTRIBUTE_NO_LIST &&
            a->columns == 1 && strcmp(a->names, name) == 0)
            return a;
    }
    return NULL;
}

static bool add_name(numbered *to, words name)
{
    if (!ebpo_grow(&to->name, &to->capacity, to->count + 1, sizeof *to->name))
        return false;
    to->name[to->count++] = name;
    return true;
}

/* Collects the names from lines such as "comment material 1 red" and "comment TextureFile red.png".
 * Returns false when out of memory. */
static bool read_header(naming *n)
{
    words text = { n->all->header, n->all->header_bytes }, line;
    bool good = true;
    while (good && first_line(&text, &line)) {
        if (!words_are(first_word(&line), "comment"))
            continue;
        words word = first_word(&line);
        if (words_are(word, "TextureFile"))
            good = add_name(&n->files, line);
        else if (words_are(word, "material") && n->materials.of_faces) {
            words number = first_word(&line);
            bool next = number.n && strtoull(number.s, NULL, 10) == n->materials.count;
            good = !next || add_name(&n->materials, line);
        }
    }
    return good;
}

/* Marks the names that the faces refer to. Returns false when out of memory. */
static bool mark_used(numbered *to, const uint32_t *faces, uint64_t count,
                      ebpo_workspace *workspace)
{
    const ebpo_attribute *a = to->of_faces;
    to->used = ebpo_alloc_zero(to->count + 1, sizeof *to->used);
    unsigned bytes = a ? ebpo_attribute_bytes(a->type) : 0;
    EBPO_FOR_ITEMS_SCATTERED(workspace, i, 0, a && to->used ? count : 0) {
        double v = faces[i] < a->rows
                       ? ebpo_attribute_number(a->values + faces[i] * (uint64_t)bytes, a->type)
                       : 0; /* value of faces added by repair */
        if (v >= 0 && v < (double)to->count)
            to->used[(uint64_t)v] = true;
    }
    return to->used != NULL;
}

static int compare_words(const void *x, const void *y)
{
    const words *a = x, *b = y;
    int order = memcmp(a->s, b->s, a->n < b->n ? a->n : b->n);
    return order ? order : (a->n > b->n) - (a->n < b->n);
}

/* Keeps only the used names, and sorts them by their bytes. */
static void sort_used(numbered *n)
{
    uint64_t used = 0;
    for (uint64_t i = 0; i < n->count; i++)
        if (n->used[i])
            n->name[used++] = n->name[i];
    n->count = used;
    if (used)
        qsort(n->name, used, sizeof *n->name, compare_words);
}

static bool has_name(const numbered *n, words name)
{
    return n->count && bsearch(&name, n->name, n->count, sizeof *n->name, compare_words);
}

/* Parses one line of an image's uses, such as "map_Kd red". Returns true if the kept faces use the
 * image in this way, or if no attribute of faces refers to names of this kind. */
static bool is_named(const naming *n, words file, words use)
{
    words word = first_word(&use);
    if (words_are(word, "TextureFile"))
        return !n->files.of_faces || has_name(&n->files, file);
    return !n->materials.of_faces || has_name(&n->materials, use);
}

/* Returns true if the kept faces use the image, or if the image has no uses. */
static bool keeps_bytes(const naming *n, uint64_t row)
{
    ebpo_texture_bytes name =
                           ebpo_texture_list(ebpo_textures_array(n->all, EBPO_TEXTURE_NAME), row),
                       use = ebpo_texture_list(ebpo_textures_array(n->all, EBPO_TEXTURE_USE), row);
    words lines = { use.at, use.count }, line;
    bool named = use.count == 0;
    while (!named && first_line(&lines, &line))
        named = is_named(n, (words){ name.at, name.count }, line);
    return named;
}

/* Rebuilds the array with the lists of kept rows; all other lists become empty. */
static ebpo_status cut_array(naming *n, ebpo_attribute *a, ebpo_error *error)
{
    ebpo_workspace *workspace = n->all->workspace;
    ebpo_attribute made = *a;
    uint64_t sum = 0;
    made.values = NULL;
    made.ends = NULL;
    made.row_capacity = made.item_capacity = 0;
    made.columns = 1;
    made.borrowed = false;
    for (uint64_t i = 0; i < a->rows; i++)
        sum += n->kept[i] ? ebpo_texture_list(a, i).count : 0;
    if (!ebpo_attribute_reserve(workspace, &made, a->rows, sum + 1)) {
        ebpo_array_free(workspace, made.ends);
        return ebpo_workspace_fail(workspace, sum + a->rows * sizeof *made.ends, error);
    }
    sum = 0;
    for (uint64_t i = 0; i < a->rows; i++) {
        ebpo_texture_bytes list = ebpo_texture_list(a, i);
        if (n->kept[i] && list.count) {
            ebpo_array_copy(workspace, made.values + sum, list.at, list.count);
            sum += list.count;
        }
        made.ends[i] = sum;
    }
    if (!a->borrowed) {
        ebpo_array_free(workspace, a->values);
        ebpo_array_free(workspace, a->ends);
    }
    *a = made;
    return EBPO_OK;
}

/* Keeps the bytes of the images that the faces use. `bytes`: the array of the images' bytes. */
static ebpo_status keep_used(naming *n, ebpo_attribute *bytes, const uint32_t *faces,
                             uint64_t count, ebpo_error *error)
{
    ebpo_workspace *workspace = n->all->workspace;
    uint64_t kept = 0;
    if (!read_header(n) || !mark_used(&n->materials, faces, count, workspace) ||
        !mark_used(&n->files, faces, count, workspace))
        return ebpo_fail_memory(error, n->all->header_bytes);
    sort_used(&n->materials);
    sort_used(&n->files);
    n->kept = ebpo_alloc_zero(bytes->rows + 1, sizeof *n->kept);
    if (!n->kept)
        return ebpo_fail_memory(error, bytes->rows);
    for (uint64_t i = 0; i < bytes->rows; i++)
        kept += n->kept[i] = keeps_bytes(n, i);
    if (kept < bytes->rows && kept)
        return cut_array(n, bytes, error);
    if (!kept)
        ebpo_attributes_remove(n->all, (uint64_t)(bytes - n->all->array));
    return EBPO_OK;
}

ebpo_status ebpo_textures_keep_named(ebpo_attributes *of, const uint32_t *faces, uint64_t count,
                                     ebpo_error *error)
{
    const ebpo_attribute *bytes = ebpo_textures_array(of, EBPO_TEXTURE_BYTES);
    if (!bytes || !of->header || !bytes->rows)
        return EBPO_OK;
    naming n = { .all = of };
    n.materials.of_faces = find_face_attribute(of, "material");
    n.files.of_faces = find_face_attribute(of, "texnumber");
    ebpo_status status = keep_used(&n, &of->array[bytes - of->array], faces, count, error);
    free(n.materials.name);
    free(n.materials.used);
    free(n.files.name);
    free(n.files.used);
    free(n.kept);
    return status;
}

/* Text without a terminating zero. */
typedef struct span {
    const char *s;
    size_t n;
} span;

static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

static span trim_span(span t)
{
    while (t.n && is_blank(*t.s))
        t = (span){ t.s + 1, t.n - 1 };
    while (t.n && is_blank(t.s[t.n - 1]))
        t.n--;
    return t;
}

/* Removes and returns the first word. */
static span parse_word(span *rest)
{
    span t = trim_span(*rest), word = { t.s, 0 };
    while (word.n < t.n && !is_blank(t.s[word.n]))
        word.n++;
    *rest = trim_span((span){ t.s + word.n, t.n - word.n });
    return word;
}

static bool span_is(span word, const char *text)
{
    return word.n == strlen(text) && memcmp(word.s, text, word.n) == 0;
}

static bool span_begins(span word, const char *text)
{
    return word.n >= strlen(text) && memcmp(word.s, text, strlen(text)) == 0;
}

/* Returns the text after an optional byte order mark. */
static span whole_text(const uint8_t *text, uint64_t bytes)
{
    uint64_t bom = ebpo_text_bom_length(text, bytes);
    return (span){ (const char *)text + bom, bytes - bom };
}

/* Reads the next line, which ends with a line feed or a carriage return. (Between the two bytes of
 * a DOS line end, there is an empty line.) Returns false when there is none. */
static bool next_line(span *text, span *line)
{
    size_t n = 0;
    if (!text->n)
        return false;
    while (n < text->n && text->s[n] != '\n' && text->s[n] != '\r')
        n++;
    size_t step = n + (n < text->n);
    *line = (span){ text->s, n };
    *text = (span){ text->s + step, text->n - step };
    return true;
}

/* --- the list --- */

/* Returns true if the name is not too long and has no control characters. */
static bool is_name(span name)
{
    bool good = name.n > 0 && name.n <= EBPO_TEXTURE_NAME_BYTES;
    for (size_t i = 0; i < name.n && good; i++)
        good = (unsigned char)name.s[i] >= ' ' && name.s[i] != 127;
    return good;
}

static uint64_t hash_of(span name)
{
    uint64_t hash = name.n;
    for (size_t i = 0; i < name.n; i++)
        hash = hash * 31 + (uint8_t)name.s[i];
    return ebpo_hash_number(hash);
}

/* Returns the entry of a name, or NULL after recording why there is none. */
static ebpo_texture_name *find_or_add_name(ebpo_texture_names *names, span name)
{
    uint64_t at;
    EBPO_HASH_FIND(at, hash_of(name), EBPO_TEXTURE_SLOTS - 1,
                   !names->slot[at] || span_is(name, names->name[names->slot[at] - 1].name));
    if (names->slot[at])
        return &names->name[names->slot[at] - 1];
    if (!is_name(name) || names->count == EBPO_TEXTURES) {
        names->omitted++;
        return NULL;
    }
    char *copy = strndup(name.s, name.n);
    if (!copy ||
        !ebpo_grow(&names->name, &names->capacity, names->count + 1, sizeof *names->name)) {
        free(copy);
        names->no_memory = true;
        return NULL;
    }
    names->name[names->count] = (ebpo_texture_name){ .name = copy };
    names->slot[at] = (uint16_t)(names->count + 1);
    return &names->name[names->count++];
}

/* Appends text. Control characters become question marks, since line feeds separate lines. */
static void append_span(ebpo_texture_name *to, span text)
{
    for (size_t i = 0; i < text.n; i++)
        to->use[to->use_bytes++] =
            (unsigned char)text.s[i] < ' ' || text.s[i] == 127 ? '?' : text.s[i];
}

/* Adds a name with its use: a word, and the name of the material that uses it. */
static void add_use(ebpo_texture_names *names, span name, span word, span owner)
{
    ebpo_texture_name *to = find_or_add_name(names, name);
    if (!to)
        return;
    if (to->use_bytes + word.n + owner.n + 2 > EBPO_TEXTURE_USE_BYTES) {
        names->omitted++;
        return;
    }
    if (!ebpo_grow(&to->use, &to->use_capacity, to->use_bytes + word.n + owner.n + 2, 1)) {
        names->no_memory = true;
        return;
    }
    if (to->use_bytes)
        to->use[to->use_bytes++] = '\n';
    append_span(to, word);
    if (owner.n)
        to->use[to->use_bytes++] = ' ';
    append_span(to, owner);
}

void ebpo_texture_names_free(ebpo_texture_names *names)
{
    for (uint64_t i = 0; i < names->count; i++) {
        free(names->name[i].name);
        free(names->name[i].use);
    }
    free(names->name);
    *names = (ebpo_texture_names){ .name = NULL };
}

/* --- PLY --- */

void ebpo_texture_names_of_ply(ebpo_texture_names *names, const char *header, uint64_t bytes)
{
    span text = { header, bytes }, line;
    while (next_line(&text, &line)) {
        if (!span_is(parse_word(&line), "comment"))
            continue;
        span word = parse_word(&line);
        if (span_is(word, "TextureFile"))
            add_use(names, line, word, (span){ "", 0 });
    }
}

/* --- OBJ --- */

/* Returns true for statements of a material library that name an image. */
static bool is_map(span word)
{
    static const char *const others[] = { "bump", "disp", "decal", "refl", "norm" };
    bool found = span_begins(word, "map_");
    for (size_t i = 0; i < sizeof others / sizeof others[0]; i++)
        found = found || span_is(word, others[i]);
    return found && !span_is(word, "map_aat"); /* map_aat is a switch, not a map */
}

static bool is_number(span word)
{
    bool digits = false;
    for (size_t i = 0; i < word.n; i++) {
        if (!strchr("+-.0123456789eE", word.s[i]))
            return false;
        digits |= word.s[i] >= '0' && word.s[i] <= '9';
    }
    return digits;
}

/* Skips the options of a map. The rest of the line is the name of the file. */
static span skip_options(span rest)
{
    while (rest.n > 1 && rest.s[0] == '-') {
        span option = parse_word(&rest);
        bool numbers = span_is(option, "-o") || span_is(option, "-s") || span_is(option, "-t");
        int most = numbers ? 3 : span_is(option, "-mm") ? 2 : 1;
        for (int i = 0; i < most; i++) {
            span ahead = rest, value = parse_word(&ahead);
            if ((numbers && !is_number(value)) || !ahead.n)
                break;
            rest = ahead;
        }
    }
    return rest;
}

void ebpo_texture_names_of_mtl(ebpo_texture_names *names, const uint8_t *text, uint64_t bytes)
{
    span rest = whole_text(text, bytes), line, material = { "", 0 };
    while (next_line(&rest, &line)) {
        span word = parse_word(&line);
        if (span_is(word, "newmtl"))
            material = line;
        else if (is_map(word))
            add_use(names, skip_options(line), word, material);
    }
}

void ebpo_obj_libraries(const uint8_t *text, uint64_t bytes,
                        void (*take)(void *context, const char *rest, size_t size), void *context)
{
    span rest = whole_text(text, bytes), line;
    while (next_line(&rest, &line)) {
        for (; line.n && is_blank(*line.s); line.n--)
            line.s++;
        if (line.n > 6 && memcmp(line.s, "mtllib", 6) == 0 && is_blank(line.s[6])) {
            parse_word(&line);
            take(context, line.s, line.n);
        }
    }
}

enum {
    LIBRARY_BYTES = 1 << 25,     /* greatest total size of the material libraries that are read */
    LIBRARIES = 100,             /* greatest number of libraries' names that are tried */
    TEXTURE_FILES_DIGEST = 32,   /* bytes of a SHA-256 */
    TEXTURE_FILES_STEP = 1 << 20 /* bytes of an image that are read and hashed at a time */
};
#define IMAGE_BYTES ((uint64_t)1 << 30) /* greatest size of an image */

/* The search for the images of a mesh. */
typedef struct image_search {
    const char *path; /* path of the source */
    ebpo_texture_names names;
    /* number of files that are not found, that are outside the folder, and that are too large */
    uint64_t absent, outside, large;
    /* number of library names that were tried, and number of libraries that could not be read */
    uint64_t tried, libraries;
    uint64_t library_bytes; /* bytes that were read of libraries */
    bool keep;              /* the bytes of images are kept */
    bool no_memory;
    ebpo_error *error;
} image_search;

/* --- files near the source --- */

/* Returns true if the path stays below the folder: no root, no drive, no "..". */
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

/* Returns the path with backslashes converted to slashes. */
static char *path_of(const char *name)
{
    char *path = strdup(name);
    for (char *s = path; path && *s; s++)
        if (*s == '\\')
            *s = '/';
    return path;
}

/* Opens a file that the source names, in the source's folder or below. */
static found open_next_to_source(const char *source, const char *name, ebpo_whole_file *out)
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

/* Collects the names from a material library. Returns false if the library cannot be read. */
static bool read_library(image_search *f, const char *name)
{
    ebpo_whole_file file = EBPO_WHOLE_FILE_INIT;
    found how = f->tried++ < LIBRARIES ? open_next_to_source(f->path, name, &file) : ABSENT;
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

/* Reads the library whose name is the whole text, which may have spaces. If there is no such file,
 * reads one library for each word of the text. */
static void read_libraries(void *context, const char *rest, size_t size)
{
    image_search *f = context;
    char *names = strndup(rest, size);
    if (!names || read_library(f, names)) {
        f->no_memory |= !names;
        free(names);
        return;
    }
    char *state = NULL, *name = strtok_r(names, " \t", &state);
    for (; name; name = strtok_r(NULL, " \t", &state))
        f->libraries += !read_library(f, name);
    free(names);
}

static void find_names(image_search *f, const ebpo_mesh *mesh, const uint8_t *data, uint64_t size)
{
    if (strcmp(mesh->source_format, "obj") == 0)
        ebpo_obj_libraries(data, size, read_libraries, f);
    else if (mesh->attributes && mesh->attributes->header)
        ebpo_texture_names_of_ply(&f->names, mesh->attributes->header,
                                  mesh->attributes->header_bytes);
    f->no_memory |= f->names.no_memory;
}

/* --- images --- */

/* Computes the digest of a file in pieces, so that files whose bytes are not kept need not fit in
 * memory. */
static ebpo_status make_digest(const ebpo_whole_file *file, const char *name,
                               uint8_t digest[TEXTURE_FILES_DIGEST], ebpo_error *error)
{
    ebpo_sha256 state;
    ebpo_status status = EBPO_OK;
    uint8_t *piece = file->data ? NULL : ebpo_alloc(TEXTURE_FILES_STEP, 1);
    if (!file->data && !piece)
        return ebpo_fail_memory(error, TEXTURE_FILES_STEP);
    ebpo_sha256_begin(&state);
    for (uint64_t at = 0; at < file->size && status == EBPO_OK; at += TEXTURE_FILES_STEP) {
        size_t bytes =
            file->size - at < TEXTURE_FILES_STEP ? (size_t)(file->size - at) : TEXTURE_FILES_STEP;
        if (piece)
            status = ebpo_whole_file_read(file, at, piece, bytes, name, error);
        if (status == EBPO_OK)
            ebpo_sha256_add(&state, piece ? piece : file->data + at, bytes);
    }
    ebpo_sha256_end(&state, digest);
    free(piece);
    return status;
}

/* Reads the bytes if they are kept, and computes the digest. */
static ebpo_status read_image(const image_search *f, ebpo_whole_file *file, const char *name,
                              uint8_t digest[TEXTURE_FILES_DIGEST])
{
    ebpo_status status =
        f->keep ? ebpo_whole_file_load(file, NULL, 1, NULL, name, f->error) : EBPO_OK;
    return status == EBPO_OK ? make_digest(file, name, digest, f->error) : status;
}

static ebpo_status add_image(image_search *f, ebpo_attributes *to, const ebpo_texture_name *named)
{
    ebpo_whole_file file = EBPO_WHOLE_FILE_INIT;
    uint8_t digest[TEXTURE_FILES_DIGEST];
    ebpo_texture_bytes list[EBPO_TEXTURE_ARRAYS] = {
        [EBPO_TEXTURE_NAME] = { named->name, strlen(named->name) },
        [EBPO_TEXTURE_USE] = { named->use, named->use_bytes },
    };
    found how = open_next_to_source(f->path, named->name, &file);
    f->absent += how == ABSENT;
    f->outside += how == OUTSIDE;
    if (how == NO_MEMORY)
        return ebpo_fail_memory(f->error, strlen(f->path));
    ebpo_status status = EBPO_OK;
    if (how == FOUND && file.size > IMAGE_BYTES) {
        f->large++;
    } else if (how == FOUND) {
        status = read_image(f, &file, named->name, digest);
        list[EBPO_TEXTURE_SHA256] = (ebpo_texture_bytes){ digest, TEXTURE_FILES_DIGEST };
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

/* --- records of what is not stored --- */

/* Records a phrase for one file or for several files. */
static void lose_files(ebpo_attributes *to, uint64_t count, const char *one, const char *several)
{
    if (count == 1)
        ebpo_attributes_lose(to, "%s", one);
    else if (count)
        ebpo_attributes_lose(to, several, count);
}

static void record_losses(const image_search *f, ebpo_attributes *to)
{
    uint64_t found_images = f->names.count - f->absent - f->outside - f->large;
    lose_files(to, f->names.omitted, "a name or a use of an image (too many)",
               "%" PRIu64 " names and uses of images (too many)");
    lose_files(to, f->libraries, "names of images (a material library cannot be read)",
               "names of images (%" PRIu64 " material libraries cannot be read)");
    lose_files(to, f->absent, "the digest of an image (file not found beside the source)",
               "the digests of %" PRIu64 " images (files not found beside the source)");
    lose_files(to, f->outside, "the digest of an image (its path leaves the source's folder)",
               "the digests of %" PRIu64 " images (their paths leave the source's folder)");
    lose_files(to, f->large, "an image of more than 1 GiB",
               "%" PRIu64 " images of more than 1 GiB");
    lose_files(to, f->keep ? 0 : found_images,
               "the bytes of an image (--embed-textures keeps them)",
               "the bytes of %" PRIu64 " images (--embed-textures keeps them)");
}

/* Removes an element of a PLY file that has the reserved name ebpo:texture. */
static void drop_reserved_element(ebpo_attributes *from)
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

static ebpo_status add_images(image_search *f, ebpo_mesh *mesh)
{
    ebpo_status status = EBPO_OK;
    if (f->no_memory)
        return ebpo_fail_memory(f->error, sizeof *f->names.name);
    if (!f->names.count && !f->names.omitted && !f->libraries)
        return EBPO_OK;
    status = ebpo_mesh_need_attributes(mesh, f->error);
    if (status != EBPO_OK)
        return status;
    for (uint64_t i = 0; i < f->names.count && status == EBPO_OK; i++)
        status = add_image(f, mesh->attributes, &f->names.name[i]);
    record_losses(f, mesh->attributes);
    return status;
}

ebpo_status ebpo_textures_find(ebpo_mesh *mesh, const char *path, const uint8_t *data,
                               uint64_t size, bool keep, ebpo_error *error)
{
    image_search f = { .path = path, .keep = keep, .error = error };
    drop_reserved_element(mesh->attributes);
    find_names(&f, mesh, data, size);
    ebpo_status status = add_images(&f, mesh);
    ebpo_texture_names_free(&f.names);
    return status;
}
