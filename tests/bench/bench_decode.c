/* Measures decoding of a file: bench_decode FILE.ebpo.h5 [--threads N] [--rounds R]. Reads the
 * whole file with all checks: the levels, the mesh, the maps. Each part is freed before the next. A
 * first round, which is not counted, loads the file into the page cache. Prints one line of JSON:
 * medians of R rounds (default 3), and the decoded bytes, which are the bytes of the arrays that a
 * reader gets (file.h: ebpo_level, ebpo_mesh, maps). */
#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <ebpo/file.h>

enum { LEVELS, MESH, MAPS, PARTS, ROUNDS_MAX = 99 };

static const char *const names[PARTS] = { "levels", "mesh", "maps" };

typedef struct settings {
    const char *path;
    unsigned threads;
    int rounds;
} settings;

/* Decoded bytes, wall-clock and processor seconds. */
typedef struct round_metrics {
    uint64_t bytes[PARTS];
    double seconds[PARTS], cpu;
} round_metrics;

static double now(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static uint64_t level_bytes(const ebpo_level *l)
{
    uint64_t sum = l->group_count * sizeof *l->types + l->plane_count * sizeof *l->planes +
                   l->ref_count * sizeof *l->leaf_refs +
                   l->leaf_plane_count * sizeof *l->leaf_planes;
    sum += l->plane_counts ? l->gray_count * sizeof *l->plane_counts : 0;
    sum += l->leaf_winding ? l->leaf_count * sizeof *l->leaf_winding : 0;
    sum += l->black_winding ? l->black_count * sizeof *l->black_winding : 0;
    sum += l->white_winding ? l->white_count * sizeof *l->white_winding : 0;
    sum += l->leaf_first ? l->leaf_count * (sizeof *l->leaf_first + sizeof *l->leaf_new +
                                            sizeof *l->leaf_ref_count)
                         : 0;
    return sum + (l->leaf_plane_counts ? l->leaf_count * sizeof *l->leaf_plane_counts : 0);
}

static bool read_levels(ebpo_file *file, const ebpo_read_options *read, uint64_t *bytes,
                        ebpo_error *error)
{
    for (int i = 0; i < ebpo_file_info(file)->level_count; i++) {
        ebpo_level level;
        if (ebpo_file_read_level(file, i, read, &level, error) != EBPO_OK)
            return false;
        *bytes += level_bytes(&level);
        ebpo_level_free(&level);
    }
    return true;
}

static bool read_mesh(ebpo_file *file, const ebpo_read_options *read, uint64_t *bytes,
                      ebpo_error *error)
{
    ebpo_mesh mesh;
    if (ebpo_file_read_mesh(file, read, &mesh, error) != EBPO_OK)
        return false;
    *bytes = mesh.vertex_count * 3 * (mesh.xyz64 ? sizeof *mesh.xyz64 : sizeof *mesh.xyz32) +
             mesh.face_count * 3 * sizeof *mesh.faces;
    ebpo_mesh_free(&mesh);
    return true;
}

static bool read_maps(ebpo_file *file, const ebpo_read_options *read, uint64_t *bytes,
                      ebpo_error *error)
{
    ebpo_maps maps;
    if (ebpo_file_read_maps(file, read, &maps, error) != EBPO_OK)
        return false;
    *bytes = (ebpo_file_info(file)->vertex_count + ebpo_file_info(file)->face_count) *
             sizeof *maps.vertex_source;
    ebpo_maps_free(&maps);
    return true;
}

static bool read_all(ebpo_file *file, const ebpo_read_options *read, round_metrics *f,
                     ebpo_error *error)
{
    static bool (*const readers[PARTS])(ebpo_file *, const ebpo_read_options *, uint64_t *,
                                        ebpo_error *) = { read_levels, read_mesh, read_maps };
    static const uint32_t parts[PARTS] = { 0, EBPO_PART_MESH, EBPO_PART_MAPS };
    double cpu = now(CLOCK_PROCESS_CPUTIME_ID);
    memset(f, 0, sizeof *f);
    for (int i = 0; i < PARTS; i++) {
        double begin = now(CLOCK_MONOTONIC);
        if ((ebpo_file_info(file)->parts & parts[i]) == parts[i] &&
            !readers[i](file, read, &f->bytes[i], error))
            return false;
        f->seconds[i] = now(CLOCK_MONOTONIC) - begin;
    }
    f->cpu = now(CLOCK_PROCESS_CPUTIME_ID) - cpu;
    return true;
}

static double total(const round_metrics *f)
{
    return f->seconds[LEVELS] + f->seconds[MESH] + f->seconds[MAPS];
}

static int by_seconds(const void *a, const void *b)
{
    double x = total(a), y = total(b);
    return (x > y) - (x < y);
}

static void print(const settings *s, const round_metrics *f, uint64_t file_bytes)
{
    printf("{\"threads\": %u, \"rounds\": %d, \"file_bytes\": %" PRIu64 ", \"parts\": [",
           s->threads, s->rounds, file_bytes);
    for (int i = 0; i < PARTS; i++)
        printf("%s{\"part\": \"%s\", \"decoded_bytes\": %" PRIu64 ", \"seconds\": %.6f}",
               i ? ", " : "", names[i], f->bytes[i], f->seconds[i]);
    uint64_t bytes = f->bytes[LEVELS] + f->bytes[MESH] + f->bytes[MAPS];
    printf("], \"decoded_bytes\": %" PRIu64
           ", \"seconds\": %.6f, \"cpu_seconds\": %.6f, \"decoded_bytes_per_second\": %.0f}\n",
           bytes, total(f), f->cpu, (double)bytes / total(f));
}

static bool parse(int argc, char **argv, settings *s)
{
    *s = (settings){ .threads = 1, .rounds = 3 };
    for (int i = 1; i < argc; i++) {
        char *end = NULL;
        unsigned long value = i + 1 < argc ? strtoul(argv[i + 1], &end, 10) : 0;
        bool number = end && end != argv[i + 1] && !*end;
        if (strcmp(argv[i], "--threads") == 0 && number && value <= 1024)
            s->threads = (unsigned)value, i++;
        else if (strcmp(argv[i], "--rounds") == 0 && number && value >= 1 && value <= ROUNDS_MAX)
            s->rounds = (int)value, i++;
        else if (argv[i][0] != '-' && !s->path)
            s->path = argv[i];
        else
            return false;
    }
    return s->path != NULL;
}

int main(int argc, char **argv)
{
    settings s;
    round_metrics f[ROUNDS_MAX], first;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file;
    if (!parse(argc, argv, &s)) {
        fprintf(stderr, "usage: bench_decode FILE.ebpo.h5 [--threads N] [--rounds 1..%d]\n",
                ROUNDS_MAX);
        return 2;
    }
    if (ebpo_open(s.path, &file, &error) != EBPO_OK) {
        fprintf(stderr, "bench_decode: %s\n", error.message);
        return EXIT_FAILURE;
    }
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    read.threads = s.threads;
    bool ok = read_all(file, &read, &first, &error);
    for (int i = 0; ok && i < s.rounds; i++)
        ok = read_all(file, &read, &f[i], &error);
    if (ok) {
        qsort(f, (size_t)s.rounds, sizeof *f, by_seconds);
        print(&s, &f[s.rounds / 2], ebpo_file_info(file)->file_bytes);
    } else {
        fprintf(stderr, "bench_decode: %s\n", error.message);
    }
    ebpo_close(file);
    return ok && fflush(stdout) == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
