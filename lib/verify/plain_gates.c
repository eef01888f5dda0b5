#include "verify/plain_gates.h"

#include <string.h>

enum { OPEN_MOST = 64, NEAR = 32 };

typedef struct pair {
    uint64_t a, b;
} pair;

typedef struct twin {
    const uint8_t *low, *more, *end;
    pair open[OPEN_MOST + 1]; /* newest last */
    size_t count;
    uint64_t seen;
} twin;

static void twin_open(twin *t, uint64_t a, uint64_t b)
{
    t->open[t->count++] = (pair){ a, b };
    if (t->count > OPEN_MOST)
        memmove(t->open, t->open + 1, --t->count * sizeof *t->open);
}

static void twin_remove(twin *t, size_t at)
{
    memmove(t->open + at, t->open + at + 1, (--t->count - at) * sizeof *t->open);
}

static void twin_pass(twin *t, uint64_t a, uint64_t b)
{
    for (size_t back = 1; back <= NEAR && back <= t->count; back++)
        if (t->open[t->count - back].a == a && t->open[t->count - back].b == b) {
            twin_remove(t, t->count - back);
            return;
        }
    twin_open(t, b, a);
}

static bool twin_number(twin *t, uint64_t *vertex)
{
    uint64_t number = *t->low++;
    if (number > 240)
        return false;
    if (number == 240) {
        if (t->end - t->more < 4)
            return false;
        number = t->more[0] + 256u * t->more[1] + 65536u * t->more[2] + 16777216ull * t->more[3];
        t->more += 4;
    } else if (number >= 224) {
        if (t->more == t->end)
            return false;
        number = 224 + 256 * (number - 224) + *t->more++;
    }
    if (number > t->seen)
        return false;
    *vertex = t->seen - number;
    t->seen += number == 0;
    return true;
}

/* Place of the newest open edge with that end; count: none. */
static size_t twin_newest(const twin *t, bool first, uint64_t vertex)
{
    for (size_t i = t->count; i > 0; i--)
        if ((first ? t->open[i - 1].a : t->open[i - 1].b) == vertex)
            return i - 1;
    return t->count;
}

static bool twin_across(twin *t, unsigned gate, unsigned third, uint64_t *face)
{
    uint64_t c = 0;
    unsigned kind = third / 3, k = third % 3;
    if (gate > t->count)
        return false;
    pair e = t->open[t->count - gate];
    twin_remove(t, t->count - gate);
    size_t at = kind == 1   ? twin_newest(t, true, e.b)
                : kind == 2 ? twin_newest(t, false, e.a)
                : kind >= 4 ? t->count - 1 - (kind - 4)
                            : 0;
    if (kind != 0 && kind != 3 && (kind >= 4 ? kind - 4 >= t->count : at == t->count))
        return false;
    if (kind == 0)
        c = t->seen++;
    else if (kind == 3 && !twin_number(t, &c))
        return false;
    else if (kind != 3)
        c = kind == 1 ? t->open[at].b : t->open[at].a;
    if (kind == 1 || kind == 2)
        twin_remove(t, at);
    if (kind == 0) {
        twin_open(t, c, e.b);
        twin_open(t, e.a, c);
    }
    if (kind >= 2)
        twin_pass(t, e.b, c);
    if (kind == 1 || kind >= 3)
        twin_pass(t, c, e.a);
    face[k] = e.a;
    face[(k + 1) % 3] = e.b;
    face[(k + 2) % 3] = c;
    return true;
}

static bool twin_codes(const uint8_t *in, uint32_t rows, uint64_t *seen, uint32_t *faces)
{
    for (size_t i = 0; i < 3 * (size_t)rows; i++) {
        uint64_t code = 0;
        for (size_t k = 0; k < 4; k++)
            code += (uint64_t)in[1 + k * 3 * rows + i] << 8 * k;
        if (code > *seen)
            return false;
        faces[i] = (uint32_t)(*seen - code);
        *seen += code == 0;
    }
    for (size_t i = 12 * (size_t)rows + 1; i < 13 * (size_t)rows; i++)
        if (in[i])
            return false;
    return true;
}

bool ebpo_plain_gates_read(const uint8_t *in, uint32_t rows, uint64_t *seen, uint32_t *faces)
{
    twin t;
    size_t thirds = 0, numbers = 0;
    if (in[0] == 1)
        return twin_codes(in, rows, seen, faces);
    for (uint32_t i = 0; i < rows; i++)
        thirds += in[i] != 0;
    for (size_t i = 0; i < thirds; i++)
        numbers += in[rows + i] / 3 == 3;
    const uint8_t *third = in + rows;
    t.low = third + thirds;
    t.more = t.low + 3 * (rows - thirds) + numbers;
    t.end = in + 13 * (size_t)rows;
    t.count = 0;
    t.seen = *seen;
    for (uint32_t i = 0; i < rows; i++) {
        uint64_t face[3];
        bool fine = true;
        if (in[i]) {
            fine = twin_across(&t, in[i], *third++, face);
        } else {
            for (int k = 0; k < 3 && fine; k++)
                fine = twin_number(&t, &face[k]);
            for (int k = 0; k < 3 && fine; k++)
                twin_open(&t, face[(k + 1) % 3], face[k]);
        }
        for (int k = 0; k < 3 && fine; k++)
            faces[3 * i + (uint32_t)k] = (uint32_t)face[k];
        if (!fine)
            return false;
    }
    for (; t.more < t.end; t.more++)
        if (*t.more)
            return false;
    *seen = t.seen;
    return true;
}
