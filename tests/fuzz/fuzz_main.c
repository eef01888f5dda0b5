/* Runs a fuzz target without libFuzzer: replays files, then mutates each of them, always in the
 * same way.
 *
 *     fuzz_x [-n MUTATIONS] [-s SEED] FILE_OR_FOLDER...
 *
 * A file NAME.pack is a corpus (corpus.py): its inputs are replayed and not mutated.
 *
 * When the target crashes, the last message names the file, the seed and the number of the
 * mutation; -1 is the unchanged file. */
#include <dirent.h>
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "mutate.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* Defined by some targets; it may call the other function, which an engine would provide. */
size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t most, unsigned seed)
    __attribute__((weak));
size_t LLVMFuzzerMutate(uint8_t *data, size_t size, size_t most);

enum { LARGEST_SEED = 1 << 22 };

static struct {
    long mutations;
    uint64_t seed;
    const char *file;
    long mutation;
    uint64_t runs;
} now = { .seed = 1 };

static void last_words(void)
{
    char line[512];
    int n = snprintf(line, sizeof line, "\ncrashed on %.300s, seed %" PRIu64 ", mutation %ld\n",
                     now.file, now.seed, now.mutation);
    if (write(STDERR_FILENO, line, (size_t)n) < 0)
        _exit(1);
}

static void on_crash(int number)
{
    last_words();
    signal(number, SIG_DFL);
    raise(number);
}

/* Sanitizers do not raise a signal; they call this before they abort. */
void __sanitizer_set_death_callback(void (*callback)(void)) __attribute__((weak));

static void run(const uint8_t *data, size_t size)
{
    /* of exactly this size, so that a read after its end is detected */
    uint8_t *exact = malloc(size ? size : 1);
    if (!exact)
        exit(2);
    memcpy(exact, data, size);
    LLVMFuzzerTestOneInput(exact, size);
    free(exact);
    now.runs++;
}

/* Damage is more likely to be interesting in the first kilobyte, where formats keep their counts.
 */
static size_t place(uint64_t *state, size_t size)
{
    size_t within = fuzz_next(state) % 2 && size > 1024 ? 1024 : size;
    return within ? fuzz_next(state) % within : 0;
}

static void overwrite(uint8_t *data, size_t size, size_t at, const void *bytes, size_t n)
{
    memcpy(data + at, bytes, size - at < n ? size - at : n);
}

static size_t mutate_once(uint8_t *data, size_t size, uint64_t *state)
{
    static const uint32_t extremes[] = { 0,          1,          0x7f,       0x80,
                                         0xff,       0x7fff,     0x8000,     0xffff,
                                         0x7fffffff, 0x80000000, 0xfffffffe, 0xffffffff };
    static const char letters[] = "0123456789-+.eE \t\r\n,nifx\0";
    if (!size)
        return 0;
    size_t at = place(state, size), n = 1 + fuzz_next(state) % 16, from = place(state, size);
    uint32_t value = extremes[fuzz_next(state) % (sizeof extremes / sizeof *extremes)];
    switch (fuzz_next(state) % 7) {
    case 0: data[at] ^= (uint8_t)(1u << fuzz_next(state) % 8); return size;
    case 1: data[at] = (uint8_t)fuzz_next(state); return size;
    case 2: data[at] = (uint8_t)letters[fuzz_next(state) % (sizeof letters - 1)]; return size;
    case 3: overwrite(data, size, at, &value, 4); return size;
    case 4: return at; /* truncate */
    case 5:            /* drop some bytes */
        n = size - at < n ? size - at : n;
        memmove(data + at, data + at + n, size - at - n);
        return size - n;
    default: /* repeat some bytes from elsewhere */
        n = size - from < n ? size - from : n;
        n = size - at < n ? size - at : n;
        memmove(data + at, data + from, n);
        return size;
    }
}

size_t LLVMFuzzerMutate(uint8_t *data, size_t size, size_t most)
{
    static uint64_t state;
    (void)most; /* it never gets longer */
    state += now.seed + (uint64_t)now.mutation;
    return mutate_once(data, size, &state);
}

static size_t mutate(uint8_t *data, size_t size, uint64_t *state)
{
    if (LLVMFuzzerCustomMutator && fuzz_next(state) % 2)
        return LLVMFuzzerCustomMutator(data, size, LARGEST_SEED, (unsigned)fuzz_next(state));
    for (uint64_t times = 1 + fuzz_next(state) % 4; times > 0; times--)
        size = mutate_once(data, size, state);
    return size;
}

/* Reads lengths of four bytes, little-endian, each followed by so many bytes. */
static int run_pack(const char *path)
{
    FILE *f = fopen(path, "rb");
    uint8_t *input = malloc(LARGEST_SEED), b[4];
    size_t bytes = 0, got = 0;
    if (!f || !input) {
        perror(path);
        return 2;
    }
    now.file = path;
    for (now.mutation = 0; got == bytes && fread(b, 1, 4, f) == 4; now.mutation++) {
        bytes = b[0] | (size_t)b[1] << 8 | (size_t)b[2] << 16 | (size_t)b[3] << 24;
        got = bytes <= LARGEST_SEED ? fread(input, 1, bytes, f) : 0;
        if (got == bytes)
            run(input, bytes);
    }
    fclose(f);
    free(input);
    if (got == bytes)
        return 0;
    fprintf(stderr, "%s: cut off at input %ld\n", path, now.mutation - 1);
    return 2;
}

static int run_file(const char *path)
{
    const char *ending = strrchr(path, '.');
    if (ending && strcmp(ending, ".pack") == 0)
        return run_pack(path);
    FILE *f = fopen(path, "rb");
    uint8_t *seed = malloc(LARGEST_SEED), *changed = malloc(LARGEST_SEED);
    if (!f || !seed || !changed) {
        perror(path);
        return 2;
    }
    size_t size = fread(seed, 1, LARGEST_SEED, f);
    fclose(f);
    now.file = path;
    now.mutation = -1;
    run(seed, size);
    for (now.mutation = 0; now.mutation < now.mutations; now.mutation++) {
        uint64_t state = now.seed * UINT64_C(1000003) + (uint64_t)now.mutation;
        memcpy(changed, seed, size);
        run(changed, mutate(changed, size, &state));
    }
    free(seed);
    free(changed);
    return 0;
}

static int run_folder(const char *path)
{
    struct dirent **names;
    int failed = 0, n = scandir(path, &names, NULL, alphasort);
    for (int i = 0; i < n; i++) {
        char file[4096];
        struct stat st;
        int length = snprintf(file, sizeof file, "%s/%s", path, names[i]->d_name);
        if (!failed && length < (int)sizeof file && stat(file, &st) == 0 && S_ISREG(st.st_mode))
            failed = run_file(file);
        free(names[i]);
    }
    if (n >= 0)
        free(names);
    return failed;
}

int main(int argc, char **argv)
{
    int option, failed = 0;
    while ((option = getopt(argc, argv, "n:s:")) != -1)
        if (option == 'n')
            now.mutations = strtol(optarg, NULL, 10);
        else if (option == 's')
            now.seed = strtoull(optarg, NULL, 10);
        else
            return 2;
    if (__sanitizer_set_death_callback)
        __sanitizer_set_death_callback(last_words);
    else
        for (const int *s = (const int[]){ SIGSEGV, SIGBUS, SIGFPE, SIGABRT, SIGILL, 0 }; *s; s++)
            signal(*s, on_crash);
    for (int i = optind; i < argc && !failed; i++) {
        struct stat st;
        if (stat(argv[i], &st) != 0) {
            perror(argv[i]);
            return 2;
        }
        failed = S_ISDIR(st.st_mode) ? run_folder(argv[i]) : run_file(argv[i]);
    }
    printf("%" PRIu64 " inputs, no crash\n", now.runs);
    return failed;
}
