/* Measures the speed of ebpo_mesh_check: bench_mesh_check FILE [THREADS]. */
#include <stdio.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <time.h>

#include <ebpo/mesh.h>

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static long peak_kib(void)
{
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    return usage.ru_maxrss;
}

int main(int argc, char **argv)
{
    ebpo_mesh mesh;
    ebpo_mesh_report report;
    ebpo_error error = EBPO_ERROR_INIT;
    unsigned threads = argc > 2 ? (unsigned)atoi(argv[2]) : 0;
    if (argc < 2 || ebpo_mesh_read(argv[1], NULL, &mesh, &error) != EBPO_OK) {
        fprintf(stderr, "bench_mesh_check: %s\n", argc < 2 ? "give a mesh file" : error.message);
        return EXIT_FAILURE;
    }
    double best = 1e30;
    for (int i = 0; i < 5; i++) {
        double start = now();
        if (ebpo_mesh_check(&mesh, threads, (ebpo_progress){ NULL, NULL }, &report, &error) !=
            EBPO_OK) {
            fprintf(stderr, "bench_mesh_check: %s\n", error.message);
            return EXIT_FAILURE;
        }
        double time = now() - start;
        best = time < best ? time : best;
    }
    printf("%llu faces, best of 5: %.3f s, %.2f million faces/s, peak %ld KiB with the mesh\n",
           (unsigned long long)mesh.face_count, best, (double)mesh.face_count / best * 1e-6,
           peak_kib());
    printf("balanced %d manifold %d genus %lld components %llu volume %.9g\n", report.balanced,
           report.manifold, (long long)report.genus, (unsigned long long)report.components,
           report.volume);
    ebpo_mesh_free(&mesh);
    return EXIT_SUCCESS;
}
