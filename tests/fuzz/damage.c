/* SPDX-License-Identifier: MIT
 * Damages files in every way of storage and transport, and runs every query:
 *
 *     damage [-e EVERY] [-v] [-w FOLDER] [-o OTHER] FILE...
 *
 * Each byte is flipped in one bit (in each bit with EVERY 0, else every EVERY-th byte), set to zero
 * and to 255; the file is truncated at each byte; chunks of equal size are exchanged; and with -o a
 * chunk is replaced by the chunk of the same path and number in another version of the model. After
 * each change, every kind of query must return the result of the good file, or an error. -v: also
 * verifies, and names damage that verifying does not detect. -w: keeps files that gave wrong
 * results.
 *
 * The checksum of a chunk does not cover its offset: in files without /chunk_checksums, chunks that
 * were exchanged, or come from another file, are detected at the latest by content_sha256, when
 * verifying. In files with it every query must detect them.
 *
 * Exit code 1: a result was wrong without an error, and, for whole chunks, verifying does not
 * detect it either. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "query_all.h"
#include "core/checksum.h"
#include "format/file_in.h"
#include "known_leaks.h"

typedef struct bytes {
    uint8_t *at;
    size_t size;
} bytes;

typedef enum how { FLIP, ZERO, ONES, CUT, SWAP, OTHER, WAYS } how;
static const char *const ways[WAYS] = { "flips", "zeros", "ones", "cuts", "swaps", "of another" };

typedef struct damage {
    const char *name, *keep;
    unsigned every;
    bool verify;
    bytes good, now;
    query_results right;
    ebpo_file *file; /* the good file */
    how way;
    uint64_t tried[WAYS], refused[WAYS], noticed[WAYS], harmless[WAYS], wrong[WAYS], unseen[WAYS];
    uint64_t silent; /* wrong, and not detected by the check that should detect it */
    uint64_t shown, unseen_shown;
} damage;

static bytes slurp(const char *path)
{
    enum { LIMIT = 1 << 24 };
    FILE *f = fopen(path, "rb");
    bytes b = { malloc(LIMIT), 0 };
    if (!f || !b.at) {
        perror(path);
        exit(2);
    }
    b.size = fread(b.at, 1, LIMIT, f);
    fclose(f);
    return b;
}

/* --- position of a byte --- */

static const ebpo_array_in *array_number(const ebpo_file *f, int n)
{
    int levels = f->info.level_count * EBPO_LEVEL_ARRAYS;
    if (n < levels)
        return &f->level_array[n / EBPO_LEVEL_ARRAYS][n % EBPO_LEVEL_ARRAYS];
    if (n < levels + EBPO_ARRAYS)
        return &f->root_array[n - levels];
    n -= levels + EBPO_ARRAYS;
    return n < f->attributes.arrays ? &f->attributes.array[n] : NULL;
}

static uint64_t chunk_count(const ebpo_array_in *a)
{
    return a->present && a->chunks
               ? a->shape.rows / a->shape.chunk_rows + (a->shape.rows % a->shape.chunk_rows != 0)
               : 0;
}

static void report_place(const damage *d, uint64_t at)
{
    const ebpo_array_in *a;
    for (int n = 0; (a = array_number(d->file, n)); n++)
        for (uint64_t i = 0; i < chunk_count(a); i++)
            if (at >= a->chunks[i].address && at - a->chunks[i].address < a->chunks[i].bytes) {
                printf("%s, chunk %" PRIu64 ", its byte %" PRIu64 " of %" PRIu32, a->path, i,
                       at - a->chunks[i].address, (uint32_t)a->chunks[i].bytes);
                return;
            }
    printf(at < d->file->info.head_bytes ? "in the head" : "between chunks");
}

/* --- checks --- */

static void keep(const damage *d, uint64_t number)
{
    char path[4096];
    snprintf(path, sizeof path, "%s/%s_%" PRIu64 ".ebpo.h5", d->keep, ways[d->way], number);
    FILE *f = fopen(path, "wb");
    if (!f || fwrite(d->now.at, 1, d->now.size, f) != d->now.size || fclose(f) != 0)
        perror(path);
}

static bool differs(const damage *d, const query_results *a, int kind)
{
    return d->right.status[kind] != a->status[kind] || d->right.hash[kind] != a->hash[kind];
}

static void report_wrong(damage *d, const query_results *a, uint64_t at)
{
    if (d->keep)
        keep(d, at);
    if (d->shown++ >= 20)
        return;
    printf("%s: %s, byte %" PRIu64 " (", d->name, ways[d->way], at);
    report_place(d, at);
    printf("):");
    for (int i = 0; i < QUERY_KINDS; i++)
        if (differs(d, a, i) && a->status[i] == EBPO_OK)
            printf(" %s", query_names[i]);
    printf(": wrong, and nothing is said\n");
}

static void report_unseen(damage *d, uint64_t at)
{
    if (d->unseen_shown++ >= 100)
        return;
    printf("%s: %s, byte %" PRIu64 " (", d->name, ways[d->way], at);
    report_place(d, at);
    printf("): answers are right, and verifying does not see it\n");
}

static void judge(damage *d, uint64_t at)
{
    query_results a;
    bool wrong = false, noticed = false;
    uint8_t *exact = malloc(d->now.size ? d->now.size : 1); /* so that a read after its end is
                                                             * detected */
    if (!exact)
        exit(2);
    memcpy(exact, d->now.at, d->now.size);
    bool whole_chunks = d->way == SWAP || d->way == OTHER;
    query_all(exact, d->now.size, d->verify || whole_chunks, &a);
    free(exact);
    d->tried[d->way]++;
    if (a.open != EBPO_OK) {
        d->refused[d->way]++;
        return;
    }
    for (int i = 0; i < QUERY_KINDS; i++)
        if (differs(d, &a, i)) {
            wrong |= a.status[i] == EBPO_OK;
            noticed |= a.status[i] != EBPO_OK;
        }
    bool seen = a.verify != EBPO_OK || a.violations || a.spare_filled != d->right.spare_filled;
    d->wrong[d->way] += wrong;
    bool reported = whole_chunks && seen && !d->file->has_checksums;
    d->silent += wrong && !reported;
    d->noticed[d->way] += noticed && !wrong;
    d->harmless[d->way] += !noticed && !wrong;
    if (wrong && !reported)
        report_wrong(d, &a, at);
    if ((d->verify || whole_chunks) && !seen) {
        d->unseen[d->way]++;
        report_unseen(d, at);
    }
}

/* --- kinds of damage --- */

static void begin(damage *d, how way)
{
    d->way = way;
    d->now.size = d->good.size;
    memcpy(d->now.at, d->good.at, d->good.size);
}

static void change_bytes(damage *d)
{
    unsigned step = d->every ? d->every : 1;
    begin(d, FLIP);
    for (size_t i = 0; i < d->good.size; i += step) {
        uint8_t *byte = &d->now.at[i], was = *byte;
        unsigned bits = d->every ? 1 : 8;
        for (unsigned k = 0; k < bits; k++) {
            d->way = FLIP;
            *byte = (uint8_t)(was ^ 1u << (d->every ? i * 5 % 8 : k));
            judge(d, i);
        }
        d->way = ZERO;
        *byte = 0;
        if (was != 0)
            judge(d, i);
        d->way = ONES;
        *byte = 255;
        if (was != 255)
            judge(d, i);
        *byte = was;
    }
}

static void cut_off(damage *d)
{
    unsigned step = d->every ? d->every : 1;
    begin(d, CUT);
    for (size_t i = 0; i < d->good.size; i += step) {
        d->now.size = i;
        judge(d, i);
    }
}

static void swap(uint8_t *a, uint8_t *b, uint64_t size)
{
    for (; size > 0; a++, b++, size--) {
        uint8_t byte = *a;
        *a = *b;
        *b = byte;
    }
}

/* Exchanges chunks of all arrays, as a misdirected write or a sorted copy of blocks does. */
static void swap_chunks(damage *d)
{
    const ebpo_array_in *a, *b;
    unsigned turn = 0;
    begin(d, SWAP);
    for (int n = 0; (a = array_number(d->file, n)); n++)
        for (uint64_t i = 0; i < chunk_count(a); i++)
            for (int m = n; (b = array_number(d->file, m)); m++)
                for (uint64_t k = m == n ? i + 1 : 0; k < chunk_count(b); k++) {
                    uint8_t *x = d->now.at + a->chunks[i].address,
                            *y = d->now.at + b->chunks[k].address;
                    if (a->chunks[i].bytes != b->chunks[k].bytes ||
                        memcmp(x, y, a->chunks[i].bytes) == 0 ||
                        (d->every && !d->file->has_checksums && turn++ % d->every))
                        continue;
                    swap(x, y, a->chunks[i].bytes);
                    judge(d, a->chunks[i].address);
                    swap(x, y, a->chunks[i].bytes);
                }
}

/* As when writing over an older file stopped early. */
static void take_of_other(damage *d, const bytes *other)
{
    const ebpo_array_in *a, *b;
    ebpo_file *file;
    if (ebpo_open_memory(other->at, other->size, "other", &file, NULL) != EBPO_OK)
        return;
    begin(d, OTHER);
    for (int n = 0; (a = array_number(d->file, n)); n++)
        for (int m = 0; (b = array_number(file, m)); m++)
            for (uint64_t i = 0; i < chunk_count(a) && i < chunk_count(b); i++) {
                uint8_t *to = d->now.at + a->chunks[i].address;
                const uint8_t *from = other->at + b->chunks[i].address;
                uint32_t size = (uint32_t)a->chunks[i].bytes;
                if (strcmp(a->path, b->path) != 0 || size != b->chunks[i].bytes ||
                    memcmp(to, from, size) == 0)
                    continue;
                memcpy(to, from, size);
                judge(d, a->chunks[i].address);
                memcpy(to, d->good.at + a->chunks[i].address, size);
            }
    ebpo_close(file);
}

static void report(const damage *d)
{
    for (int i = 0; i < WAYS; i++) {
        if (!d->tried[i])
            continue;
        printf("%s: %s: %" PRIu64 " tried, %" PRIu64 " refused in opening, %" PRIu64
               " noticed, %" PRIu64 " harmless, %" PRIu64 " wrong",
               d->name, ways[i], d->tried[i], d->refused[i], d->noticed[i], d->harmless[i],
               d->wrong[i]);
        if (d->verify || i >= SWAP)
            printf(", %" PRIu64 " not seen by verifying", d->unseen[i]);
        printf("\n");
    }
}

static uint64_t damage_file(damage *d, const char *path, const char *other)
{
    const char *slash = strrchr(path, '/');
    d->name = slash ? slash + 1 : path;
    d->good = slurp(path);
    d->now.at = malloc(d->good.size);
    if (!d->now.at ||
        ebpo_open_memory(d->good.at, d->good.size, "good", &d->file, NULL) != EBPO_OK ||
        ebpo_file_locate(d->file, NULL, NULL) != EBPO_OK) {
        fprintf(stderr, "%s: cannot be opened\n", path);
        exit(2);
    }
    query_all(d->good.at, d->good.size, d->verify, &d->right);
    if (d->right.verify != EBPO_OK || d->right.violations) {
        fprintf(stderr, "%s: is not valid before it is damaged\n", path);
        exit(2);
    }
    change_bytes(d);
    cut_off(d);
    swap_chunks(d);
    if (other) {
        bytes o = slurp(other);
        take_of_other(d, &o);
        free(o.at);
    }
    report(d);
    fflush(stdout);
    ebpo_close(d->file);
    free(d->good.at);
    free(d->now.at);
    return d->silent;
}

int main(int argc, char **argv)
{
    damage settings = { .every = 0 };
    const char *other = NULL;
    uint64_t wrong = 0;
    int option;
    if (!EBPO_CHECKSUMS_COMPARED) {
        fprintf(stderr, "damage: a fuzzing build notices nothing; use another\n");
        return 77;
    }
    while ((option = getopt(argc, argv, "e:o:vw:")) != -1)
        switch (option) {
        case 'e': settings.every = (unsigned)strtoul(optarg, NULL, 10); break;
        case 'o': other = optarg; break;
        case 'v': settings.verify = true; break;
        case 'w': settings.keep = optarg; break;
        default: return 2;
        }
    for (int i = optind; i < argc; i++) {
        damage d = settings;
        wrong += damage_file(&d, argv[i], other);
    }
    return wrong ? 1 : 0;
}
