#include "mesh/textures.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/hash.h"
#include "core/text.h"

/* Text that does not end with a zero. */
typedef struct span {
    const char *s;
    size_t n;
} span;

static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

static span trimmed(span t)
{
    while (t.n && is_blank(*t.s))
        t = (span){ t.s + 1, t.n - 1 };
    while (t.n && is_blank(t.s[t.n - 1]))
        t.n--;
    return t;
}

/* Takes the first word off. */
static span take_word(span *rest)
{
    span t = trimmed(*rest), word = { t.s, 0 };
    while (word.n < t.n && !is_blank(t.s[word.n]))
        word.n++;
    *rest = trimmed((span){ t.s + word.n, t.n - word.n });
    return word;
}

static bool is(span word, const char *text)
{
    return word.n == strlen(text) && memcmp(word.s, text, word.n) == 0;
}

static bool begins(span word, const char *text)
{
    return word.n >= strlen(text) && memcmp(word.s, text, strlen(text)) == 0;
}

/* Text behind its mark of the order of bytes, if it has one. */
static span whole_text(const uint8_t *text, uint64_t bytes)
{
    uint64_t mark = ebpo_text_mark(text, bytes);
    return (span){ (const char *)text + mark, bytes - mark };
}

/* The next line; false: there is none. */
static bool next_line(span *text, span *line)
{
    if (!text->n)
        return false;
    const char *stop = memchr(text->s, '\n', text->n);
    size_t n = stop ? (size_t)(stop - text->s) : text->n, step = n + (stop != NULL);
    *line = (span){ text->s, n };
    *text = (span){ text->s + step, text->n - step };
    return true;
}

/* --- the list --- */

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

static ebpo_texture_name *place_of(ebpo_texture_names *names, span name)
{
    uint64_t at;
    EBPO_HASH_FIND(at, hash_of(name), EBPO_TEXTURE_SLOTS - 1,
                   !names->slot[at] || is(name, names->of[names->slot[at] - 1].name));
    if (names->slot[at])
        return &names->of[names->slot[at] - 1];
    if (!is_name(name) || names->count == EBPO_TEXTURES) {
        names->left_out++;
        return NULL;
    }
    char *copy = strndup(name.s, name.n);
    if (!copy || !ebpo_grow(&names->of, &names->capacity, names->count + 1, sizeof *names->of)) {
        free(copy);
        names->no_memory = true;
        return NULL;
    }
    names->of[names->count] = (ebpo_texture_name){ .name = copy };
    names->slot[at] = (uint16_t)(names->count + 1);
    return &names->of[names->count++];
}

/* Control characters become question marks: lines end lines. */
static void append(ebpo_texture_name *to, span text)
{
    for (size_t i = 0; i < text.n; i++)
        to->use[to->use_bytes++] =
            (unsigned char)text.s[i] < ' ' || text.s[i] == 127 ? '?' : text.s[i];
}

/* What for: a word, and the name of what has it. */
static void add(ebpo_texture_names *names, span name, span word, span owner)
{
    ebpo_texture_name *to = place_of(names, name);
    if (!to)
        return;
    if (to->use_bytes + word.n + owner.n + 2 > EBPO_TEXTURE_USE_BYTES) {
        names->left_out++;
        return;
    }
    if (!ebpo_grow(&to->use, &to->use_capacity, to->use_bytes + word.n + owner.n + 2, 1)) {
        names->no_memory = true;
        return;
    }
    if (to->use_bytes)
        to->use[to->use_bytes++] = '\n';
    append(to, word);
    if (owner.n)
        to->use[to->use_bytes++] = ' ';
    append(to, owner);
}

void ebpo_texture_names_free(ebpo_texture_names *names)
{
    for (uint64_t i = 0; i < names->count; i++) {
        free(names->of[i].name);
        free(names->of[i].use);
    }
    free(names->of);
    *names = (ebpo_texture_names){ .of = NULL };
}

/* --- PLY --- */

void ebpo_texture_names_of_ply(ebpo_texture_names *names, const char *header, uint64_t bytes)
{
    span text = { header, bytes }, line;
    while (next_line(&text, &line)) {
        if (!is(take_word(&line), "comment"))
            continue;
        span word = take_word(&line);
        if (is(word, "TextureFile"))
            add(names, line, word, (span){ "", 0 });
    }
}

/* --- OBJ --- */

static bool is_map(span word)
{
    static const char *const others[] = { "bump", "disp", "decal", "refl", "norm" };
    bool found = begins(word, "map_");
    for (size_t i = 0; i < sizeof others / sizeof others[0]; i++)
        found = found || is(word, others[i]);
    return found && !is(word, "map_aat"); /* a switch */
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

/* Behind a map's options stands its file's name, to the end of the line. */
static span skip_options(span rest)
{
    while (rest.n > 1 && rest.s[0] == '-') {
        span option = take_word(&rest);
        bool numbers = is(option, "-o") || is(option, "-s") || is(option, "-t");
        int most = numbers ? 3 : is(option, "-mm") ? 2 : 1;
        for (int i = 0; i < most; i++) {
            span ahead = rest, value = take_word(&ahead);
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
        span word = take_word(&line);
        if (is(word, "newmtl"))
            material = line;
        else if (is_map(word))
            add(names, skip_options(line), word, material);
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
            take_word(&line);
            take(context, line.s, line.n);
        }
    }
}
