#include "core/strict_fp.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "core/checksum.h"
#include "mesh/textures.h"

enum { DIGEST = 32, STEP = 1 << 20 };

const char *ebpo_texture_array_name(ebpo_texture_array which)
{
    static const char *const names[EBPO_TEXTURE_ARRAYS] = { "name", "use", "sha256", "bytes" };
    return names[which];
}

static ebpo_attribute *find(const ebpo_attributes *all, ebpo_texture_array which)
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
    return find(all, which);
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

static ebpo_attribute *make(ebpo_attributes *to, ebpo_texture_array which)
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
        ebpo_attribute *a = find(to, (ebpo_texture_array)which);
        if (!a && !(a = make(to, (ebpo_texture_array)which)))
            return ebpo_fail_memory(error, sizeof *a);
        if (!add_row(to->workspace, a, list[which]))
            return ebpo_workspace_fail(to->workspace, list[which].count, error);
    }
    return EBPO_OK;
}

static bool is_digest(ebpo_texture_bytes bytes, ebpo_texture_bytes sha256,
                      ebpo_workspace *workspace)
{
    uint8_t digest[DIGEST];
    ebpo_sha256 state;
    ebpo_sha256_begin(&state);
    EBPO_FOR_PIECES(workspace, at, bytes.count, STEP)
        ebpo_sha256_add(&state, (const uint8_t *)bytes.at + at,
                        bytes.count - at < STEP ? (size_t)(bytes.count - at) : STEP);
    ebpo_sha256_end(&state, digest);
    return sha256.count == DIGEST && !ebpo_digest_differs(sha256.at, digest);
}

bool ebpo_textures_good(const ebpo_attributes *all)
{
    const ebpo_attribute *bytes = find(all, EBPO_TEXTURE_BYTES),
                         *sha256 = find(all, EBPO_TEXTURE_SHA256);
    for (uint64_t i = 0; bytes && i < bytes->rows; i++) {
        ebpo_texture_bytes list = ebpo_texture_list(bytes, i);
        if (list.count && !is_digest(list, ebpo_texture_list(sha256, i), all->workspace))
            return false;
    }
    return true;
}

/* Text that does not end with a zero. */
typedef struct words {
    const char *s;
    size_t n;
} words;

/* What faces have numbers of: names, in the order of the header's comments. */
typedef struct numbered {
    const ebpo_attribute *of_faces; /* NULL: faces have none */
    words *name;
    bool *used;
    uint64_t count, capacity;
} numbered;

typedef struct naming {
    ebpo_attributes *all;
    numbered materials, files;
    bool *kept; /* [rows] */
} naming;

static words trimmed(words t)
{
    while (t.n && (*t.s == ' ' || *t.s == '\t' || *t.s == '\r'))
        t = (words){ t.s + 1, t.n - 1 };
    while (t.n && (t.s[t.n - 1] == ' ' || t.s[t.n - 1] == '\t' || t.s[t.n - 1] == '\r'))
        t.n--;
    return t;
}

/* Takes the first word off. */
static words first_word(words *rest)
{
    words t = trimmed(*rest), word = { t.s, 0 };
    while (word.n < t.n && t.s[word.n] != ' ' && t.s[word.n] != '\t')
        word.n++;
    *rest = trimmed((words){ t.s + word.n, t.n - word.n });
    return word;
}

/* Takes the first line off; false: there is none. */
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

static bool is(words a, const char *text)
{
    return a.n == strlen(text) && (!a.n || memcmp(a.s, text, a.n) == 0);
}

static const ebpo_attribute *of_faces(const ebpo_attributes *all, const char *name)
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

/* "comment material 1 red", "comment TextureFile red.png". */
static bool read_header(naming *n)
{
    words text = { n->all->header, n->all->header_bytes }, line;
    bool good = true;
    while (good && first_line(&text, &line)) {
        if (!is(first_word(&line), "comment"))
            continue;
        words word = first_word(&line);
        if (is(word, "TextureFile"))
            good = add_name(&n->files, line);
        else if (is(word, "material") && n->materials.of_faces) {
            words number = first_word(&line);
            bool next = number.n && strtoull(number.s, NULL, 10) == n->materials.count;
            good = !next || add_name(&n->materials, line);
        }
    }
    return good;
}

static bool mark(numbered *to, const uint32_t *faces, uint64_t count, ebpo_workspace *workspace)
{
    const ebpo_attribute *a = to->of_faces;
    to->used = ebpo_alloc_zero(to->count + 1, sizeof *to->used);
    unsigned bytes = a ? ebpo_attribute_bytes(a->type) : 0;
    EBPO_FOR_ITEMS_SCATTERED(workspace, i, 0, a && to->used ? count : 0) {
        double v = faces[i] < a->rows
                       ? ebpo_attribute_number(a->values + faces[i] * (uint64_t)bytes, a->type)
                       : 0; /* as faces that mending has added have it */
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

/* Of the names only those that are used, in the order of their bytes. */
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

static bool has(const numbered *n, words name)
{
    return n->count && bsearch(&name, n->name, n->count, sizeof *n->name, compare_words);
}

/* One line of what an image is for. */
static bool is_named(const naming *n, words file, words use)
{
    words word = first_word(&use);
    if (is(word, "TextureFile"))
        return !n->files.of_faces || has(&n->files, file);
    return !n->materials.of_faces || has(&n->materials, use);
}

static bool keeps(const naming *n, uint64_t row)
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

/* The array anew, of the lists that are kept; all others are empty. */
static ebpo_status cut(naming *n, ebpo_attribute *a, ebpo_error *error)
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

static ebpo_status keep(naming *n, ebpo_attribute *bytes, const uint32_t *faces, uint64_t count,
                        ebpo_error *error)
{
    ebpo_workspace *workspace = n->all->workspace;
    uint64_t kept = 0;
    if (!read_header(n) || !mark(&n->materials, faces, count, workspace) ||
        !mark(&n->files, faces, count, workspace))
        return ebpo_fail_memory(error, n->all->header_bytes);
    sort_used(&n->materials);
    sort_used(&n->files);
    n->kept = ebpo_alloc_zero(bytes->rows + 1, sizeof *n->kept);
    if (!n->kept)
        return ebpo_fail_memory(error, bytes->rows);
    for (uint64_t i = 0; i < bytes->rows; i++)
        kept += n->kept[i] = keeps(n, i);
    if (kept < bytes->rows && kept)
        return cut(n, bytes, error);
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
    n.materials.of_faces = of_faces(of, "material");
    n.files.of_faces = of_faces(of, "texnumber");
    ebpo_status status = keep(&n, &of->array[bytes - of->array], faces, count, error);
    free(n.materials.name);
    free(n.materials.used);
    free(n.files.name);
    free(n.files.used);
    free(n.kept);
    return status;
}
