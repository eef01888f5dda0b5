/* Tests arrays in memory or in files, and the resident memory. */
#include <dirent.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/workspace.h"
#include "core/parallel.h"
#include "check_main.h"
#include "scratch.h"

static uint64_t resident(void)
{
    unsigned long long size = 0, pages = 0;
    FILE *f = fopen("/proc/self/statm", "r");
    ck_assert(f && fscanf(f, "%llu %llu", &size, &pages) == 2);
    fclose(f);
    return pages * (uint64_t)sysconf(_SC_PAGESIZE);
}

static ebpo_workspace *make(uint64_t memory)
{
    ebpo_workspace *w;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_msg(ebpo_workspace_make_any(&w, memory, scratch(NULL), &error) == EBPO_OK, "%s",
                  error.message);
    return w;
}

START_TEST(test_workspace_spills_to_unnamed_files)
{
    enum { MIB = 1 << 20 };
    ebpo_workspace *w = make(8 * MIB);
    ebpo_workspace_stats f = EBPO_WORKSPACE_STATS_INIT;
    char *small = ebpo_array_alloc(w, 1000, 1), *held = ebpo_array_alloc(w, 2 * MIB, 1),
         *filed = ebpo_array_zero(w, 5 * MIB, 1);
    ck_assert(small && held && filed);
    ebpo_workspace_get_stats(w, &f);
    ck_assert_uint_eq(f.memory, 8 * MIB);
    ck_assert_uint_eq(f.held, 2 * MIB);
    ck_assert_uint_eq(f.filed, 5 * MIB);
    ck_assert_int_eq(scratch_entries(), 0);
    for (int i = 0; i < 5 * MIB; i++)
        ck_assert_msg(filed[i] == 0, "byte %d", i);
    memset(filed, 7, 5 * MIB);
    ebpo_array_free(w, held);
    ebpo_array_free(w, small);
    ebpo_workspace_free(w); /* blocks remain valid after the workspace is freed */
    ck_assert(filed[0] == 7 && filed[5 * MIB - 1] == 7);
    ebpo_array_free(w, filed);
}
END_TEST

/* Allocates 30 % of the budget. Returns the bytes that went to a file. */
static uint64_t filed_of_30_percent(uint64_t memory)
{
    ebpo_workspace *w = make(memory);
    ebpo_workspace_stats f = EBPO_WORKSPACE_STATS_INIT;
    void *array = ebpo_array_alloc(w, memory / 10 * 3, 1);
    ck_assert(array);
    ebpo_workspace_get_stats(w, &f);
    ebpo_array_free(w, array);
    ebpo_workspace_free(w);
    return f.filed;
}

/* Memory that is not the workspace's counts too. */
START_TEST(test_workspace_spills_for_other_memory)
{
    enum { MIB = 1 << 20 };
    volatile char *other = malloc(40 * MIB);
    for (int i = 0; i < 40 * MIB; i += 4096)
        other[i] = 1;
    ck_assert_uint_gt(filed_of_30_percent(64 * MIB), 0);
    free((void *)other);
    ck_assert_uint_eq(filed_of_30_percent(UINT64_C(1024) * MIB), 0);
}
END_TEST

START_TEST(test_workspace_growth_keeps_content)
{
    ebpo_workspace *w = make(4 << 20);
    uint32_t *a = NULL;
    uint64_t capacity = 0;
    for (uint32_t i = 0; i < 3000000; i++) {
        ck_assert(i < capacity || ebpo_array_grow(w, &a, &capacity, i + (uint64_t)1, sizeof *a));
        a[i] = i * 2654435761u;
    }
    for (uint32_t i = 0; i < 3000000; i++)
        if (a[i] != i * 2654435761u)
            ck_abort_msg("number %lu changed", (unsigned long)i);
    ebpo_array_free(w, a);
    ebpo_workspace_stats f = EBPO_WORKSPACE_STATS_INIT;
    ebpo_workspace_get_stats(w, &f);
    ck_assert(f.held == 0 && f.filed == 0 && f.filed_peak > 0 && f.held_peak > 0);
    ebpo_workspace_free(w);
}
END_TEST

START_TEST(test_workspace_releases_file_pages)
{
#ifdef __SANITIZE_ADDRESS__
    return; /* whose own memory is resident, too */
#endif
    uint64_t before = resident(), budget = before + (32 << 20), most = 0;
    /* a quarter of the budget is reserved for changes between two checks */
    ebpo_workspace *w = make(budget / 3 * 4);
    enum { BYTES = 256 << 20 };
    unsigned char *a = ebpo_array_alloc(w, BYTES, 1);
    ck_assert_ptr_nonnull(a);
    for (int round = 0; round < 2; round++)
        for (int i = 0; i < BYTES; i += 4096) {
            if (round == 0)
                a[i] = (unsigned char)(i >> 12);
            else
                ck_assert_msg(a[i] == (unsigned char)(i >> 12), "page %d", i >> 12);
            if (i % (1 << 20) == 0) {
                ebpo_release_pages(w);
                most = resident() > most ? resident() : most;
            }
        }
    ck_assert_msg(most <= budget / 3 * 4, "%llu MiB of %llu", (unsigned long long)most >> 20,
                  (unsigned long long)(budget / 3 * 4) >> 20);
    ebpo_array_free(w, a);
    ebpo_workspace_free(w);
}
END_TEST

enum { PAGE = 4096, PAGES = 1 << 15, LINE = 64 };

typedef struct page_writer {
    unsigned char *array;
    uint64_t most; /* greatest number of resident bytes */
} page_writer;

static void write_byte(page_writer *t, uint64_t byte)
{
    t->array[byte] = 1;
    if (byte % (1 << 20) == 0)
        t->most = resident() > t->most ? resident() : t->most;
}

static ebpo_status write_pages(void *context, uint64_t begin, uint64_t end, unsigned worker,
                               ebpo_error *error)
{
    (void)worker, (void)error;
    for (uint64_t page = begin; page < end; page++)
        write_byte(context, page * PAGE);
    return EBPO_OK;
}

static void write_all(int loop, ebpo_workspace *w, page_writer *t)
{
    if (loop == 0)
        EBPO_FOR_ITEMS(w, i, 0, (uint64_t)PAGES * PAGE / LINE)
            write_byte(t, i * LINE);
    if (loop == 1)
        EBPO_FOR_ITEMS_SCATTERED(w, page, 0, PAGES) {
            write_byte(t, page * PAGE);
            continue; /* this loop also releases pages */
        }
    if (loop == 2)
        EBPO_FOR_PIECES(w, page, PAGES, 256)
            write_pages(t, page, page + 256, 0, NULL);
    if (loop == 3)
        ck_assert_int_eq(ebpo_parallel_for(1, w, PAGES, 256, write_pages, t, NULL, "", NULL), 0);
}

START_TEST(test_workspace_loops_release_pages)
{
#ifdef __SANITIZE_ADDRESS__
    return; /* whose own memory is resident, too */
#endif
    uint64_t budget = (resident() + (32 << 20)) / 3 * 4;
    ebpo_workspace *w = make(budget);
    page_writer t = { ebpo_array_alloc(w, (uint64_t)PAGES * PAGE, 1), 0 };
    ck_assert_ptr_nonnull(t.array);
    write_all(_i, w, &t);
    ck_assert_msg(t.most <= budget, "%llu MiB of %llu", (unsigned long long)t.most >> 20,
                  (unsigned long long)budget >> 20);
    ebpo_array_free(w, t.array);
    ebpo_workspace_free(w);
}
END_TEST

/* Returns the number of system calls by which this process has read files; 0 if it is not known. */
static long long calls_of_read(void)
{
    char line[64];
    long long calls = 0;
    FILE *f = fopen("/proc/self/io", "r");
    while (f && fgets(line, sizeof line, f))
        if (strncmp(line, "syscr:", 6) == 0)
            calls = atoll(line + 6);
    if (f)
        fclose(f);
    return calls;
}

/* Loops call ebpo_release_pages for each few items, so a thread reads its resident memory only
 * after page faults. */
START_TEST(test_workspace_reads_memory_only_after_faults)
{
    ebpo_workspace *w = make(1 << 20);
    ebpo_release_pages(w);
    long long before = calls_of_read();
    for (int i = 0; i < 10000; i++)
        ebpo_release_pages(w);
    ck_assert_int_lt(calls_of_read() - before, 100);
    ebpo_workspace_free(w);
}
END_TEST

/* The bytes of a freed part remain in the file of its pool until the pool is freed: the system
 * waits for the disk when it makes a hole in a file. `b` keeps the pool mapped. */
START_TEST(test_workspace_makes_no_holes_in_files)
{
    ebpo_workspace *w = make(1 << 20);
    char *a = ebpo_array_alloc(w, 8192, 1), *b = ebpo_array_alloc(w, 8192, 1);
    ebpo_workspace_stats f = EBPO_WORKSPACE_STATS_INIT;
    ck_assert(a && b);
    ebpo_workspace_get_stats(w, &f);
    ck_assert_uint_gt(f.filed, 0);
    memset(a, 7, 8192);
    volatile const char *freed = a;
    ebpo_array_free(w, a);
    ck_assert_int_eq(freed[8191], 7);
    ebpo_array_free(w, b);
    ebpo_workspace_free(w);
}
END_TEST

START_TEST(test_workspace_null_uses_malloc)
{
    char *a = ebpo_array_alloc(NULL, 10 << 20, 1);
    uint64_t capacity = 10 << 20;
    ck_assert(a && ebpo_array_grow(NULL, &a, &capacity, 20 << 20, 1));
    ebpo_release_pages(NULL);
    ebpo_array_free(NULL, a);
    ebpo_array_free(NULL, NULL);
    ebpo_workspace_free(NULL);
    ck_assert_ptr_null(ebpo_array_alloc(NULL, UINT64_MAX / 2, 16));
}
END_TEST

START_TEST(test_workspace_invalid_options_are_refused)
{
    ebpo_workspace *w;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_workspace_options o = { sizeof(ebpo_workspace_options), 1000000, NULL };
    ck_assert_int_eq(ebpo_workspace_new(&o, &w, &error), EBPO_E_ARGUMENT);
    ck_assert(w == NULL && strstr(error.message, "128 MB") != NULL);
    o = (ebpo_workspace_options){ sizeof(ebpo_workspace_options), 0, "/no/such/folder" };
    ck_assert_int_eq(ebpo_workspace_new(&o, &w, &error), EBPO_E_IO);
    ck_assert(strstr(error.message, "/no/such/folder") != NULL);
    o = (ebpo_workspace_options){ sizeof(ebpo_workspace_options), 0, "/proc" };
    ck_assert_int_eq(ebpo_workspace_new(&o, &w, &error), EBPO_E_IO);
    ck_assert_int_eq(ebpo_workspace_new(NULL, &w, &error), EBPO_OK);
    ebpo_workspace_free(w);
}
END_TEST

START_TEST(test_workspace_write_failure_names_folder)
{
    ebpo_workspace *w = make(4 << 20);
    ebpo_error error = EBPO_ERROR_INIT;
    struct rlimit limit = { 1 << 20, 1 << 20 };
    signal(SIGXFSZ, SIG_IGN);
    ck_assert_int_eq(setrlimit(RLIMIT_FSIZE, &limit), 0);
    ck_assert_ptr_null(ebpo_array_alloc(w, 5 << 20, 1));
    ck_assert_int_eq(ebpo_workspace_fail(w, 5 << 20, &error), EBPO_E_IO);
    ck_assert_msg(strstr(error.message, scratch(NULL)) && strstr(error.message, "5242880"), "%s",
                  error.message);
    ebpo_workspace_stats f = EBPO_WORKSPACE_STATS_INIT;
    ebpo_workspace_get_stats(w, &f);
    ck_assert(f.held == 0 && f.filed == 0);
    ebpo_workspace_free(w);
}
END_TEST

/* Without madvise, the system controls the pages. */
#ifdef EBPO_HAVE_MADVISE
enum { LETS_GO = 1 };
#else
enum { LETS_GO = 0 };
#endif

TEST_SUITE(workspace)
{
    Suite *suite = suite_create("workspace");
    TCase *tests = tcase_create("arrays");
    tcase_set_timeout(tests, 120);
    tcase_add_test(tests, test_workspace_spills_to_unnamed_files);
    tcase_add_test(tests, test_workspace_growth_keeps_content);
    if (access("/proc/self/statm", R_OK) == 0) /* else the memory of the process is not known */
        tcase_add_test(tests, test_workspace_spills_for_other_memory);
    if (LETS_GO) {
        tcase_add_test(tests, test_workspace_releases_file_pages);
        tcase_add_loop_test(tests, test_workspace_loops_release_pages, 0, 4);
    }
#ifdef EBPO_HAVE_RUSAGE_THREAD
    tcase_add_test(tests, test_workspace_reads_memory_only_after_faults);
#endif
    tcase_add_test(tests, test_workspace_makes_no_holes_in_files);
    tcase_add_test(tests, test_workspace_null_uses_malloc);
    tcase_add_test(tests, test_workspace_invalid_options_are_refused);
    tcase_add_test(tests, test_workspace_write_failure_names_folder);
    suite_add_tcase(suite, tests);
    return suite;
}
