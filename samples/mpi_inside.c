/* Classifies points as inside, outside or on the surface, on all processes of an MPI program:
 *
 *     mpirun -n 4 mpi_inside MODEL.ebpo.h5 POINTS.raw RESULTS.raw [MEGABYTES]
 *
 * POINTS.raw has three doubles for each point. RESULTS.raw gets two int32 for each point, as `ebpo
 * inside --raw` prints them: location (0 outside, 1 inside, 2 on the surface) and winding number.
 * The results do not depend on the number of processes. Each process opens the model with at most
 * MEGABYTES of memory (default 256). An error of one process ends all processes, and the results
 * are removed. */
#include <ebpo/ebpo.h>
#include <mpi.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>

enum { TOGETHER = 1 << 18 }; /* number of points that a process reads in each collective read */

static int rank, ranks;

/* Returns true if `ok` is true in all processes. If `ok` is false, prints the error `what` of this
 * process. Every process must call this function. */
static int all_ok(int ok, const char *what)
{
    int every;
    if (!ok)
        fprintf(stderr, "mpi_inside: process %d of %d: %s\n", rank, ranks, what);
    MPI_Allreduce(&ok, &every, 1, MPI_INT, MPI_LAND, MPI_COMM_WORLD);
    return every;
}

/* Returns true if an MPI call for a file succeeded in all processes. `code`: result of the call.
 * Prints MPI errors as text. */
static int mpi_ok(int code, const char *path)
{
    char why[MPI_MAX_ERROR_STRING] = "", what[MPI_MAX_ERROR_STRING + 512];
    int length;
    if (code != MPI_SUCCESS)
        MPI_Error_string(code, why, &length);
    snprintf(what, sizeof what, "%s: %s", path, why);
    return all_ok(code == MPI_SUCCESS, what);
}

/* Returns true if the query succeeded in all processes. A message of the library states the index
 * of a point among the points of one call. `first`: index in the file of the first point of this
 * call. */
static int query_ok(ebpo_status status, MPI_Offset first, const char *message)
{
    char what[sizeof(ebpo_error) + 64];
    snprintf(what, sizeof what, "in the points from index %lld on: %s", (long long)first, message);
    return all_ok(status == EBPO_OK, what);
}

/* Reads `count` points from index `first` on, queries them, and writes the results. All processes
 * call this function at the same time, because it reads and writes collectively. */
static int query_range(ebpo_context *context, MPI_File in, MPI_File out, const char *const *paths,
                       MPI_Offset first, int count, double *points, ebpo_inside_result *results,
                       int *pairs)
{
    ebpo_error error = EBPO_ERROR_INIT;
    MPI_Status read_status;
    int doubles = 0;
    int code = MPI_File_read_at_all(in, first * 24, points, 3 * count, MPI_DOUBLE, &read_status);
    if (!mpi_ok(code, paths[0]))
        return 0;
    MPI_Get_count(&read_status, MPI_DOUBLE, &doubles);
    if (!all_ok(doubles == 3 * count, "the points file became shorter during reading"))
        return 0;
    ebpo_inside_options options = EBPO_INSIDE_OPTIONS_INIT;
    ebpo_status status =
        ebpo_inside_many(context, points, (uint64_t)count, &options, results, &error);
    if (!query_ok(status, first, error.message))
        return 0;
    for (int i = 0; i < count; i++) {
        pairs[2 * i] = (int)results[i].where;
        pairs[2 * i + 1] = results[i].winding;
    }
    code = MPI_File_write_at_all(out, first * 8, pairs, 2 * count, MPI_INT, &read_status);
    return mpi_ok(code, paths[1]);
}

/* Processes all points, in ranges. All processes process the same number of ranges, because every
 * process must take part in a collective read. */
static int query_all(ebpo_context *context, MPI_File in, MPI_File out, const char *const *paths,
                     MPI_Offset rows)
{
    double *points = malloc(sizeof *points * 3 * TOGETHER);
    ebpo_inside_result *results = malloc(sizeof *results * TOGETHER);
    int *pairs = malloc(sizeof *pairs * 2 * TOGETHER);
    int ok = all_ok(points && results && pairs, "not enough memory");
    for (MPI_Offset at = 0; ok && at < rows; at += (MPI_Offset)TOGETHER * ranks) {
        MPI_Offset first = at + (MPI_Offset)TOGETHER * rank,
                   remaining = first < rows ? rows - first : 0;
        ok = query_range(context, in, out, paths, first,
                         remaining < TOGETHER ? (int)remaining : TOGETHER, points, results, pairs);
    }
    free(points);
    free(results);
    free(pairs);
    return ok;
}

/* Returns true if the output file is an input file, which writing would destroy. */
static int is_input(const char *input, const char *output)
{
    struct stat a, b;
    return stat(input, &a) == 0 && stat(output, &b) == 0 && a.st_dev == b.st_dev &&
           a.st_ino == b.st_ino;
}

static int query_files(ebpo_context *context, const char *points, const char *output)
{
    const char *const paths[] = { points, output };
    MPI_File in, out;
    MPI_Offset bytes = 0;
    if (!mpi_ok(MPI_File_open(MPI_COMM_WORLD, points, MPI_MODE_RDONLY, MPI_INFO_NULL, &in), points))
        return 0;
    int ok = mpi_ok(MPI_File_get_size(in, &bytes), points) &&
             all_ok(bytes % 24 == 0, "the points file does not contain rows of three doubles");
    if (ok && mpi_ok(MPI_File_open(MPI_COMM_WORLD, output, MPI_MODE_WRONLY | MPI_MODE_CREATE,
                                   MPI_INFO_NULL, &out),
                     output)) {
        ok = mpi_ok(MPI_File_set_size(out, bytes / 3), output) &&
             query_all(context, in, out, paths, bytes / 24);
        ok = mpi_ok(MPI_File_close(&out), output) && ok;
        if (!ok && rank == 0)
            MPI_File_delete(output, MPI_INFO_NULL);
    } else {
        ok = 0;
    }
    MPI_File_close(&in);
    return ok;
}

static int query_model(const char *const *path, double megabytes)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    ebpo_model *model = NULL;
    ebpo_context *context = NULL;
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    options.memory = (uint64_t)(megabytes * 1e6);
    options.threads = 1;
    if (!all_ok(!is_input(path[0], path[2]) && !is_input(path[1], path[2]),
                "the results would overwrite the model or the points"))
        return 0;
    ebpo_status status = ebpo_open(path[0], &file, &error);
    if (status == EBPO_OK)
        status = ebpo_model_new(file, &options, &model, &error);
    if (status == EBPO_OK)
        status = ebpo_context_new(model, &context, &error);
    int ok = all_ok(status == EBPO_OK, error.message) && query_files(context, path[1], path[2]);
    ebpo_context_free(context);
    ebpo_model_free(model);
    ebpo_close(file);
    return ok;
}

int main(int argc, char **argv)
{
    MPI_Init(&argc, &argv);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    MPI_Comm_size(MPI_COMM_WORLD, &ranks);
    char none[] = "", *end = none;
    double megabytes = argc == 5 ? strtod(argv[4], &end) : 256;
    int ok = 0;
    if ((argc == 4 || argc == 5) && !*end && megabytes > 0 && megabytes < 1e9) {
        const char *const path[] = { argv[1], argv[2], argv[3] };
        ok = query_model(path, megabytes);
    } else if (rank == 0) {
        fprintf(stderr, "usage: mpi_inside MODEL.ebpo.h5 POINTS.raw RESULTS.raw [MEGABYTES]\n");
    }
    MPI_Finalize();
    return ok ? 0 : 1;
}
