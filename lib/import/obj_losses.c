#include "import/obj_losses.h"

#include <string.h>

static bool is_space(uint8_t c) { return c == ' ' || c == '\t'; }

/* Whether a line begins with one of the words, with something behind it. */
static bool begins(const uint8_t *at, const uint8_t *end, const char *word)
{
    size_t n = strlen(word);
    if ((size_t)(end - at) <= n || memcmp(at, word, n) != 0 || !is_space(at[n]))
        return false;
    for (at += n; at < end && is_space(*at);)
        at++;
    return at < end && *at != '\r';
}

static bool is_off(const uint8_t *at, const uint8_t *end)
{
    while (end > at && (is_space(end[-1]) || end[-1] == '\r'))
        end--;
    return (end - at >= 3 && memcmp(end - 3, "off", 3) == 0) ||
           (end - at >= 2 && end[-1] == '0' && is_space(end[-2]));
}

typedef struct findings {
    bool names, smoothing, library;
    bool faces, materials; /* any so far */
    bool early;            /* faces stand before the first material */
} findings;

static findings find(const uint8_t *at, uint64_t size)
{
    findings f = { .names = false };
    for (const uint8_t *end = at + size, *stop; at < end; at = stop + 1) {
        stop = memchr(at, '\n', (size_t)(end - at));
        if (!stop)
            stop = end;
        f.names |= begins(at, stop, "g") || begins(at, stop, "o");
        f.library |= begins(at, stop, "mtllib");
        f.smoothing |= begins(at, stop, "s") && !is_off(at, stop);
        f.faces |= begins(at, stop, "f");
        if (!f.materials && begins(at, stop, "usemtl")) {
            f.materials = true;
            f.early = f.faces;
        }
        if (stop == end)
            break;
    }
    return f;
}

void ebpo_obj_note_losses(ebpo_attributes *attributes, const uint8_t *data, uint64_t size)
{
    findings f = find(data, size);
    if (f.smoothing)
        ebpo_attributes_lose(attributes, "smoothing groups");
    if (f.early) /* assimp gives them the first one */
        ebpo_attributes_lose(attributes, "that faces before the first material have none");
    if (f.library)
        ebpo_attributes_lose(attributes, "what the material library says (colours and the like)");
}

bool ebpo_obj_names(const uint8_t *data, uint64_t size) { return find(data, size).names; }
