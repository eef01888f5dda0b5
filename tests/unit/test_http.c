/* Reads files on correct and misbehaving web servers. The result is the correct bytes or a clear
 * error, and never a hang: each test has a time limit. EBPO_TEST_SCALE scales the number of random
 * fault schedules.
 *
 *     test_http FAULTY_SERVER */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <ebpo/ebpo.h>

#include "check_main.h"
#include "io/http_response.h"
#include "io/byte_source.h"
#include "scratch.h"
#include "solids.h"
#include "web.h"

enum { DATA_BYTES = 3000017, HEAD_BYTES = 131072 };
static uint8_t *data;

static uint64_t next_random(uint64_t *state)
{
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    return *state;
}

static ebpo_http_options quick(void)
{
    ebpo_http_options o = EBPO_HTTP_OPTIONS_INIT;
    o.connect_timeout = 2;
    o.stall_timeout = 1;
    o.time_limit = 4;
    o.retries = 3;
    o.netrc = false;
    o.proxy = "";
    return o;
}

static ebpo_http_stats stats_of(const ebpo_source *source)
{
    ebpo_http_stats stats = EBPO_HTTP_STATS_INIT;
    ck_assert(ebpo_source_http_stats(source, &stats));
    return stats;
}

static ebpo_status read_one(const ebpo_source *s, uint64_t offset, uint64_t size, ebpo_error *error)
{
    uint8_t *got = malloc(size);
    ebpo_status status = s->read(s->user, offset, size, got, error);
    if (status == EBPO_OK)
        ck_assert_mem_eq(got, data + offset, size);
    free(got);
    return status;
}

/* Reads some ranges, then everything, with prefetch hints in pieces. */
static ebpo_status read_all(const ebpo_source *s, ebpo_error *error)
{
    static const ebpo_range places[] = { { 0, 100 },
                                         { HEAD_BYTES - 50, 100 },
                                         { 1000000, 1 },
                                         { DATA_BYTES - 10, 10 },
                                         { 500000, 1200000 } };
    ebpo_range hinted[10];
    ebpo_status status = EBPO_OK;
    for (size_t i = 0; i < sizeof places / sizeof *places && status == EBPO_OK; i++)
        status = read_one(s, places[i].offset, places[i].size, error);
    for (uint64_t i = 0; i < 10; i++)
        hinted[i] = (ebpo_range){ (9 - i) * 300000, i == 0 ? DATA_BYTES - 2700000 : 300000 };
    if (status == EBPO_OK)
        s->prefetch(s->user, hinted, 10);
    for (int i = 9; i >= 0 && status == EBPO_OK; i--)
        status = read_one(s, hinted[i].offset, hinted[i].size, error);
    return status;
}

static ebpo_status visit(const char *fault, const ebpo_http_options *options,
                         ebpo_http_stats *stats, ebpo_error *error)
{
    ebpo_source s = EBPO_SOURCE_INIT;
    ebpo_status status = ebpo_source_of_url(web_url(fault), options, &s, error);
    if (status != EBPO_OK)
        return status;
    ck_assert_uint_eq(s.size, DATA_BYTES);
    status = read_all(&s, error);
    if (stats)
        *stats = stats_of(&s);
    s.close(s.user);
    return status;
}

/* --- usable servers --- */

static const struct {
    const char *fault;
    unsigned retries; /* least number of retries */
} readable[] = {
    { "good", 0 },
    { "modified", 0 },
    { "bare", 0 },
    { "whole", 0 },
    { "whole_bare", 0 },
    { "whole_chunked", 0 },
    { "whole_dropped-2", 2 },
    { "whole_then_parts-2", 2 },
    { "small_parts", 0 },
    { "short-2", 2 },
    { "empty-2", 2 },
    { "lying_length-2", 2 },
    { "chunked", 0 },
    { "stall_head-1", 1 },
    { "stall_body-1", 1 },
    { "code-503-2", 2 },
    { "code-500-1", 1 },
    { "code-502-1", 1 },
    { "code-504-1", 1 },
    { "code-408-1", 1 },
    { "code-429-1", 1 },
    { "code_later-503-1-2", 1 },
    { "wait-429-1-1", 1 },
    { "redirect", 0 },
    { "weak_sometimes", 0 },
};

START_TEST(test_http_harmless_faults_give_same_bytes)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_http_options o = quick();
    ebpo_http_stats stats = EBPO_HTTP_STATS_INIT;
    ebpo_status status = visit(readable[_i].fault, &o, &stats, &error);
    ck_assert_msg(status == EBPO_OK, "%s: %s", readable[_i].fault, error.message);
    ck_assert_msg(stats.retries >= readable[_i].retries, "%s: %d retries", readable[_i].fault,
                  (int)stats.retries);
    ck_assert_uint_ge(stats.bytes, DATA_BYTES);
}
END_TEST

/* Without a version, one response must hold all data, as two responses could be from different
 * files. */
START_TEST(test_http_unversioned_parts_are_not_joined)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_http_options o = quick();
    ebpo_source s = EBPO_SOURCE_INIT;
    uint8_t *got = malloc(DATA_BYTES);
    ck_assert_msg(ebpo_source_of_url(web_url("bare_replaced"), &o, &s, &error) == EBPO_OK, "%s",
                  error.message);
    ck_assert_int_eq(s.read(s.user, 0, DATA_BYTES, got, &error), EBPO_OK);
    bool turned = got[0] != data[0];
    for (uint64_t i = 0; i < DATA_BYTES; i++)
        ck_assert_msg(got[i] == (turned ? 255 - data[i] : data[i]),
                      "byte %d is from the other file", (int)i);
    s.close(s.user);
    free(got);
}
END_TEST

START_TEST(test_http_short_responses_are_continued)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_http_options o = quick();
    o.retries = 60;
    o.time_limit = 60;
    ebpo_source s = EBPO_SOURCE_INIT;
    ck_assert_int_eq(ebpo_source_of_url(web_url("less"), &o, &s, &error), EBPO_OK);
    ck_assert_msg(read_one(&s, 100000, 300000, &error) == EBPO_OK, "%s", error.message);
    s.close(s.user);
}
END_TEST

/* --- unusable servers --- */

static const struct {
    const char *fault;
    ebpo_status status;
    const char *words;
} unreadable[] = {
    { "whole_open", EBPO_E_UNSUPPORTED, "does not report the size of the file" },
    { "whole_later", EBPO_E_IO, "the whole file instead of a part" },
    { "short-99", EBPO_E_IO, "given up after" },
    { "empty-99", EBPO_E_IO, "given up after 4 attempts" },
    { "lying_length", EBPO_E_IO, "given up after" },
    { "wrong_range", EBPO_E_IO, "the server sent bytes 1 to 131072 for a request of 0 to 131071" },
    { "wrong_range_later", EBPO_E_IO, "for a request of" },
    { "bad_range", EBPO_E_IO, "Content-Range" },
    { "no_range", EBPO_E_IO, "Content-Range" },
    { "star", EBPO_E_IO, "does not report the file's size" },
    { "two_ranges", EBPO_E_IO, "Content-Range" },
    { "wide", EBPO_E_IO, "for a request of 0 to 131071" },
    { "longer", EBPO_E_IO, "more bytes than its Content-Range" },
    { "multipart", EBPO_E_IO, "Content-Range" },
    { "gzip", EBPO_E_IO, "Content-Encoding" },
    { "gzip_whole", EBPO_E_IO, "Content-Encoding" },
    { "stall_head-99", EBPO_E_IO, "; " },
    { "stall_body-99", EBPO_E_IO, "; " },
    { "drip", EBPO_E_IO, "not read within 4 s" },
    { "code-503", EBPO_E_IO, "returned status 503; given up after 4 attempts" },
    { "code-500", EBPO_E_IO, "returned status 500; given up" },
    { "code-404", EBPO_E_IO, "returned status 404: there is no such file" },
    { "code-403", EBPO_E_IO, "returned status 403: not allowed" },
    { "code-401", EBPO_E_IO, "returned status 401: not allowed" },
    { "code-501", EBPO_E_IO, "returned status 501" },
    { "code-304", EBPO_E_IO, "returned status 304" },
    { "code_later-404-1", EBPO_E_IO, "returned status 404" },
    { "wait-503-3600-99", EBPO_E_IO, "requires a pause of 3600 s" },
    { "wait-429-30-99", EBPO_E_IO, "requires a pause of 30 s" },
    { "redirect_wrong", EBPO_E_IO, "for a request of" },
    { "redirect_loop", EBPO_E_IO, "redirects" },
    { "redirect_file", EBPO_E_IO, "rotocol" },
    { "change_etag", EBPO_E_IO, "another ETag" },
    { "change_etag-2", EBPO_E_IO, "another ETag" },
    { "change_modified", EBPO_E_IO, "another Last-Modified" },
    { "change_size", EBPO_E_IO, "another size" },
    { "change_shorter", EBPO_E_IO, "has changed" },
    { "change_between", EBPO_E_IO, "another ETag" },
    { "several-22", EBPO_E_IO, "another ETag" },
    { "headers", EBPO_E_IO, "head of the server's response is too long" },
    { "garbage", EBPO_E_IO, "" },
    { "not_satisfiable", EBPO_E_IO, "416" },
    { "private", EBPO_E_IO, "returned status 401" },
    { "etag_by_server", EBPO_E_IO, "another ETag); open it again, or use --http-unversioned" },
    { "html", EBPO_E_IO, "the server returned text/html, not a model" },
    { "html_bare", EBPO_E_IO, "the server returned a page of HTML" },
    { "html_later", EBPO_E_IO, "the server returned text/html instead of a part" },
    { "redirect_long-150000", EBPO_E_IO, "address of a redirect, is too long" },
};

START_TEST(test_http_errors_name_file)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_http_options o = quick();
    ebpo_status status = visit(unreadable[_i].fault, &o, NULL, &error);
    ck_assert_msg(status == unreadable[_i].status, "%s: %d %s", unreadable[_i].fault, status,
                  error.message);
    ck_assert_msg(strstr(error.message, unreadable[_i].words), "%s: %s", unreadable[_i].fault,
                  error.message);
    ck_assert_msg(strncmp(error.message, "http://127.0.0.1:", 17) == 0, "%s: %s",
                  unreadable[_i].fault, error.message);
    ck_assert_ptr_null(strchr(error.message, '\n'));
}
END_TEST

START_TEST(test_http_final_status_is_not_retried)
{
    static const char *const faults[] = { "code-404", "code-403", "code-401" };
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_http_options o = quick();
    ebpo_source s = EBPO_SOURCE_INIT;
    ck_assert_int_eq(ebpo_source_of_url(web_url("code_later-404-1-1"), &o, &s, &error), EBPO_OK);
    ck_assert_int_eq(read_one(&s, 200000, 10, &error), EBPO_E_IO);
    ck_assert_uint_eq(stats_of(&s).requests, 2);
    ck_assert_uint_eq(stats_of(&s).retries, 0);
    ck_assert_int_eq(read_one(&s, 200000, 10, &error), EBPO_OK); /* a failure is not permanent */
    s.close(s.user);
    for (int i = 0; i < 3; i++) {
        ck_assert_int_eq(ebpo_source_of_url(web_url(faults[i]), &o, &s, &error), EBPO_E_IO);
        ck_assert_int_eq(error.system_error, i == 0 ? ENOENT : 0);
    }
}
END_TEST

START_TEST(test_http_text_content_type_is_accepted)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_http_options o = quick();
    ebpo_source s = EBPO_SOURCE_INIT;
    ck_assert_msg(ebpo_source_of_url(web_url("model_as_text"), &o, &s, &error) == EBPO_OK, "%s",
                  error.message);
    s.close(s.user);
}
END_TEST

/* Several servers respond for one address, each with its tag or its time. */
START_TEST(test_http_versions_can_be_ignored)
{
    static const char *const faults[] = { "etag_by_server", "modified_by_server" };
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_http_options o = quick();
    for (int i = 0; i < 2; i++) {
        ck_assert_int_eq(visit(faults[i], &o, NULL, &error), EBPO_E_IO);
        ck_assert_ptr_nonnull(strstr(error.message, "--http-unversioned"));
    }
    o.unversioned = true;
    for (int i = 0; i < 2; i++)
        ck_assert_msg(visit(faults[i], &o, NULL, &error) == EBPO_OK, "%s", error.message);
    ck_assert_int_eq(visit("change_size", &o, NULL, &error), EBPO_E_IO);
}
END_TEST

START_TEST(test_http_without_ranges_limits_file_size)
{
    static const char *const faults[] = { "whole", "whole_chunked", "whole_bare", "bare" };
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_http_options o = quick();
    ebpo_source s = EBPO_SOURCE_INIT;
    o.whole_limit = DATA_BYTES - 1;
    for (size_t i = 0; i < sizeof faults / sizeof *faults; i++) {
        ck_assert_int_eq(ebpo_source_of_url(web_url(faults[i]), &o, &s, &error),
                         EBPO_E_UNSUPPORTED);
        ck_assert_ptr_nonnull(strstr(error.message, "download the file"));
    }
    o.unversioned = true;
    ck_assert_int_eq(visit("bare", &o, NULL, &error), EBPO_OK);
}
END_TEST

START_TEST(test_http_unversioned_file_is_one_response)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_http_options o = quick();
    ebpo_source s = EBPO_SOURCE_INIT;
    ck_assert_int_eq(ebpo_source_of_url(web_url("change_bare-1"), &o, &s, &error), EBPO_OK);
    uint8_t *got = malloc(DATA_BYTES);
    ck_assert_int_eq(s.read(s.user, 0, DATA_BYTES, got, &error), EBPO_OK);
    for (size_t i = 0; i < DATA_BYTES; i++)
        ck_assert_uint_eq(got[i],
                          data[DATA_BYTES - 1 - i]); /* all bytes are of the second version */
    free(got);
    s.close(s.user);
}
END_TEST

/* --- costs --- */

START_TEST(test_http_prefetch_uses_few_requests)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_http_options o = quick();
    ebpo_source s = EBPO_SOURCE_INIT;
    ck_assert_int_eq(ebpo_source_of_url(web_url("good"), &o, &s, &error), EBPO_OK);
    ck_assert_int_eq(read_one(&s, 0, HEAD_BYTES, &error), EBPO_OK);
    ck_assert_uint_eq(stats_of(&s).requests, 1);
    ck_assert_uint_eq(stats_of(&s).bytes, HEAD_BYTES);
    ebpo_range ranges[29];
    for (uint64_t i = 0; i < 29; i++)
        ranges[i] = (ebpo_range){ HEAD_BYTES + i * 98000, 98000 };
    s.prefetch(s.user, ranges, 29);
    for (int i = 0; i < 29; i++)
        ck_assert_int_eq(read_one(&s, ranges[i].offset, ranges[i].size, &error), EBPO_OK);
    ck_assert_uint_eq(stats_of(&s).requests, 2);
    ck_assert_uint_eq(stats_of(&s).bytes, HEAD_BYTES + 29 * 98000);
    ck_assert_uint_le(stats_of(&s).connections, 2);
    s.close(s.user);
}
END_TEST

/* Responses to requests for several ranges: faults of faulty_server.py. Requests: the head; the
 * first range with the first byte; 40 ranges together. After a wrong response, each range is
 * requested alone, and no request is for several ranges again. */
static const struct {
    unsigned what, requests, retries;
} several[] = {
    { 0, 3, 0 },   /* valid */
    { 1, 3, 0 },   /* the boundary is not quoted */
    { 2, 3, 0 },   /* the last part first */
    { 3, 4, 1 },   /* cut off once: the last range is requested again */
    { 4, 43, 0 },  /* the whole file */
    { 5, 43, 0 },  /* no boundary */
    { 6, 43, 0 },  /* a boundary that is too long */
    { 7, 43, 0 },  /* another boundary */
    { 8, 43, 0 },  /* only the first part */
    { 9, 43, 0 },  /* the first part twice */
    { 10, 43, 0 }, /* a part that was not requested */
    { 11, 43, 0 }, /* another offset */
    { 12, 43, 0 }, /* another size of the file */
    { 13, 43, 0 }, /* more bytes than Content-Range states */
    { 14, 43, 0 }, /* a long line */
    { 15, 43, 0 }, /* many lines */
    { 16, 43, 0 }, /* text before the first part */
    { 17, 43, 0 }, /* Content-Encoding */
    { 18, 43, 0 }, /* longer parts than requested */
    { 19, 43, 0 }, /* one part for both ranges */
    { 20, 43, 0 }, /* status 416 */
    { 21, 43, 0 }, /* another ETag only in responses with several ranges */
    { 23, 4, 1 },  /* status 503 once: all are requested again, together */
    { 24, 43, 1 }, /* a closed connection */
};

START_TEST(test_http_several_ranges_take_one_request)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_http_options o = quick();
    ebpo_source s = EBPO_SOURCE_INIT;
    ebpo_range ranges[40];
    char fault[40];
    snprintf(fault, sizeof fault, "several-%u", several[_i].what);
    ck_assert_int_eq(ebpo_source_of_url(web_url(fault), &o, &s, &error), EBPO_OK);
    ck_assert_msg(read_one(&s, 200000, 5000, &error) == EBPO_OK, "%s", error.message);
    for (uint64_t i = 0; i < 40; i++)
        ranges[i] = (ebpo_range){ 300000 + i * 60000, 1 + i * 70 };
    s.prefetch(s.user, ranges, 40);
    for (int i = 0; i < 40; i++)
        ck_assert_msg(read_one(&s, ranges[i].offset, ranges[i].size, &error) == EBPO_OK, "%s",
                      error.message);
    ebpo_http_stats stats = stats_of(&s);
    ck_assert_msg(stats.requests == several[_i].requests, "%s: %d requests", fault,
                  (int)stats.requests);
    ck_assert_msg(stats.retries == several[_i].retries, "%s: %d retries", fault,
                  (int)stats.retries);
    /* once it works, short gaps between ranges are not requested */
    for (uint64_t i = 0; i < 40; i++)
        ranges[i] = (ebpo_range){ 2700000 + i * 5000, 100 };
    s.prefetch(s.user, ranges, 40);
    for (int i = 0; i < 40; i++)
        ck_assert_int_eq(read_one(&s, ranges[i].offset, ranges[i].size, &error), EBPO_OK);
    ebpo_http_stats more = stats_of(&s);
    ck_assert_uint_eq(more.requests, stats.requests + 1);
    if (several[_i].requests == 3)
        ck_assert_uint_lt(more.bytes - stats.bytes, 15000);
    s.close(s.user);
}
END_TEST

START_TEST(test_http_unused_prefetch_hint_is_harmless)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_http_options o = quick();
    ebpo_source s = EBPO_SOURCE_INIT;
    uint64_t random = 7;
    ck_assert_int_eq(ebpo_source_of_url(web_url("good"), &o, &s, &error), EBPO_OK);
    for (int i = 0; i < 300; i++) {
        uint64_t at = next_random(&random) % (DATA_BYTES - 5000);
        ebpo_range twice[2] = { { at, 5000 }, { at + 1000, 2000 } };
        s.prefetch(s.user, twice, 2);
        if (i % 3 == 0)
            ck_assert_int_eq(read_one(&s, next_random(&random) % (DATA_BYTES - 9000), 9000, &error),
                             EBPO_OK);
    }
    s.close(s.user);
}
END_TEST

/* --- threads, random faults and interruption --- */

typedef struct reader {
    const ebpo_source *source;
    uint64_t random;
    atomic_int *failures;
} reader;

static void *read_anywhere(void *argument)
{
    reader *r = argument;
    for (int i = 0; i < 25; i++) {
        uint64_t at = next_random(&r->random) % DATA_BYTES,
                 most = DATA_BYTES - at < 200000 ? DATA_BYTES - at : 200000,
                 size = 1 + next_random(&r->random) % most;
        ebpo_error error = EBPO_ERROR_INIT;
        if (i % 2)
            r->source->prefetch(r->source->user, &(ebpo_range){ at, size }, 1);
        ebpo_status status = read_one(r->source, at, size, &error);
        if (status != EBPO_OK)
            atomic_fetch_add(r->failures, 1);
        ck_assert_msg(status == EBPO_OK || (status == EBPO_E_IO && *error.message), "%d %s", status,
                      error.message);
    }
    return NULL;
}

static int read_by_threads(const ebpo_source *source, uint64_t seed)
{
    enum { THREADS = 4 };
    pthread_t threads[THREADS];
    reader readers[THREADS];
    atomic_int failures = 0;
    for (unsigned i = 0; i < THREADS; i++) {
        readers[i] = (reader){ source, seed * 1000 + i + 1, &failures };
        ck_assert_int_eq(pthread_create(&threads[i], NULL, read_anywhere, &readers[i]), 0);
    }
    for (int i = 0; i < THREADS; i++)
        pthread_join(threads[i], NULL);
    return failures;
}

START_TEST(test_http_concurrent_reads)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_http_options o = quick();
    ebpo_source s = EBPO_SOURCE_INIT;
    ck_assert_int_eq(ebpo_source_of_url(web_url("good"), &o, &s, &error), EBPO_OK);
    ck_assert_int_eq(read_by_threads(&s, 1), 0);
    s.close(s.user);
}
END_TEST

static int schedules(void)
{
    int count = (int)(12 * ebpo_test_scale());
    return count < 2 ? 2 : count;
}

START_TEST(test_http_faults_never_give_wrong_bytes)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_http_options o = quick();
    char fault[64];
    o.retries = 12;
    o.time_limit = 60;
    int opened = 0, failures = 0;
    for (int seed = 0; seed < schedules(); seed++) {
        ebpo_source s = EBPO_SOURCE_INIT;
        snprintf(fault, sizeof fault, "random-%d-%d", seed, 10 + seed % 4 * 10);
        if (ebpo_source_of_url(web_url(fault), &o, &s, &error) != EBPO_OK)
            continue;
        opened++;
        failures += read_by_threads(&s, (uint64_t)seed + 2);
        s.close(s.user);
    }
    ck_assert_int_gt(opened, 0);
    ck_assert_int_lt(failures, opened * 100);
}
END_TEST

static atomic_bool stopping;

static bool stop(void *user)
{
    (void)user;
    return stopping;
}

static void *stop_soon(void *argument)
{
    (void)argument;
    usleep(300000);
    stopping = true;
    return NULL;
}

START_TEST(test_http_read_can_be_cancelled)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_http_options o = EBPO_HTTP_OPTIONS_INIT;
    pthread_t thread;
    ebpo_source s = EBPO_SOURCE_INIT;
    o.stop = stop;
    o.proxy = "";
    pthread_create(&thread, NULL, stop_soon, NULL);
    ck_assert_int_eq(ebpo_source_of_url(web_url("stall_head-99"), &o, &s, &error),
                     EBPO_E_CANCELLED);
    pthread_join(thread, NULL);
}
END_TEST

START_TEST(test_http_close_during_prefetch)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_http_options o = quick();
    ebpo_source s = EBPO_SOURCE_INIT;
    ck_assert_int_eq(ebpo_source_of_url(web_url("good"), &o, &s, &error), EBPO_OK);
    s.prefetch(s.user, &(ebpo_range){ 0, DATA_BYTES }, 1);
    s.close(s.user);
}
END_TEST

/* --- options --- */

START_TEST(test_http_credentials_are_never_shown)
{
    static const char *const headers[] = { "X-Key: 7", NULL };
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_http_options o = quick();
    ebpo_source s = EBPO_SOURCE_INIT;
    o.user = "name:secret";
    o.headers = headers;
    ck_assert_msg(visit("private", &o, NULL, &error) == EBPO_OK, "%s", error.message);
    char shown[100];
    ck_assert_str_eq(ebpo_url_redact("https://name:p@ss@example.org/a/b.h5?signature=1#x", shown,
                                     sizeof shown),
                     "https://example.org/a/b.h5");
    ck_assert_str_eq(ebpo_url_redact("http://example.org?a@b", shown, sizeof shown),
                     "http://example.org");
    ck_assert_str_eq(ebpo_url_redact("a@b/c?d", shown, sizeof shown), "a@b/c?d");
    ck_assert_str_eq(ebpo_url_redact("http://example.org/abc", shown, 12), "http://exam");
    o.user = "name:wrong";
    ck_assert_int_eq(ebpo_source_of_url(web_url("private"), &o, &s, &error), EBPO_E_IO);
    ck_assert_ptr_null(strstr(error.message, "wrong"));
}
END_TEST

/* Headers are sent to no other server. When another server redirects back, they are not sent
 * either, because that server chose the target. */
START_TEST(test_http_headers_stay_with_their_server)
{
    static const char *const headers[] = { "X-Key: 7", NULL };
    for (int i = 0; i < 6; i++) {
        ebpo_error error = EBPO_ERROR_INIT;
        ebpo_http_options o = quick();
        char away[24];
        o.headers = headers;
        o.user = i < 4 ? NULL : "name:secret";
        snprintf(away, sizeof away, "away-%d", i);
        ck_assert_msg(visit(away, &o, NULL, &error) == EBPO_OK, "%s: %s", away, error.message);
    }
}
END_TEST

START_TEST(test_http_invalid_options_are_refused)
{
    static const char *const smuggled[] = { "X: 1\r\nY: 2", NULL };
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_source s = EBPO_SOURCE_INIT;
    for (int i = 0; i < 6; i++) {
        ebpo_http_options o = quick();
        if (i == 0)
            o.connections = 0;
        else if (i == 1)
            o.connections = 33;
        else if (i == 2)
            o.time_limit = 0;
        else if (i == 3)
            o.stall_timeout = __builtin_nan("");
        else if (i == 4)
            o.headers = smuggled;
        else
            o.cache_folder = "/proc/nowhere/at/all";
        ck_assert_msg(ebpo_source_of_url(web_url("good"), &o, &s, &error) == EBPO_E_ARGUMENT, "%d",
                      i);
    }
    ck_assert_int_eq(ebpo_source_of_url("ftp://example.org/a", NULL, &s, &error), EBPO_E_ARGUMENT);
}
END_TEST

START_TEST(test_http_unreachable_server_is_an_error)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_http_options o = quick();
    ebpo_source s = EBPO_SOURCE_INIT;
    o.retries = 1;
    ck_assert_int_eq(ebpo_source_of_url("http://127.0.0.1:1/a", &o, &s, &error), EBPO_E_IO);
    ck_assert_int_eq(ebpo_source_of_url("http://", &o, &s, &error), EBPO_E_IO);
}
END_TEST

/* --- the cache folder --- */

static const char *cache;

/* Calls `what` for each file of the cache folder; returns the number of files. */
static int each_file(void (*what)(const char *name))
{
    int count = 0;
    DIR *folder = opendir(cache);
    for (struct dirent *f; folder && (f = readdir(folder)) != NULL;)
        if (f->d_name[0] != '.' || strlen(f->d_name) > 2) {
            char name[400];
            snprintf(name, sizeof name, "%s/%s", cache, f->d_name);
            what(name);
            count++;
        }
    closedir(folder);
    return count;
}

static void damage(const char *name)
{
    int fd = open(name, O_WRONLY);
    ck_assert_int_eq(pwrite(fd, "x!", 2, 1000), 2);
    close(fd);
}

static uint64_t total;
static void add_up(const char *name)
{
    struct stat st;
    total += stat(name, &st) == 0 ? (uint64_t)st.st_size : 0;
}

static void set_up_cache(void)
{
    static char folder[300];
    scratch_enter();
    snprintf(folder, sizeof folder, "%s", scratch("made/on/the/way")); /* does not exist yet */
    cache = folder;
}

static ebpo_http_stats visit_cached(const char *url, uint64_t bytes)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_http_options o = quick();
    ebpo_source s = EBPO_SOURCE_INIT;
    o.cache_folder = cache;
    o.cache_bytes = bytes;
    ck_assert_msg(ebpo_source_of_url(url, &o, &s, &error) == EBPO_OK, "%s", error.message);
    ck_assert_msg(read_all(&s, &error) == EBPO_OK, "%s", error.message);
    ebpo_http_stats stats = stats_of(&s);
    s.close(s.user);
    return stats;
}

START_TEST(test_http_cache_is_reused_and_checked)
{
    char url[300];
    snprintf(url, sizeof url, "%s", web_url("good"));
    ck_assert_uint_gt(visit_cached(url, 1 << 30).requests, 1);
    ebpo_http_stats again = visit_cached(url, 1 << 30);
    ck_assert_uint_eq(again.requests, 1);
    ck_assert_uint_ge(again.cache_bytes, DATA_BYTES - HEAD_BYTES);
    ck_assert_uint_gt(again.cache_hits, 0);
    ck_assert_int_gt(each_file(damage), 80);
    again = visit_cached(url, 1 << 30);
    ck_assert_uint_gt(again.requests, 1);
    ck_assert_uint_eq(visit_cached(url, 1 << 30).requests, 1);
    ck_assert_uint_gt(visit_cached(web_url("good"), 1 << 30).requests, 1); /* another address */
}
END_TEST

/* Gives each full block the name of the full block before. */
static void rotate_names(const char *name)
{
    static char before[400];
    char spare[420];
    struct stat st;
    if (stat(name, &st) != 0 || (before[0] && (uint64_t)st.st_size != total))
        return;
    total = (uint64_t)st.st_size;
    if (before[0]) {
        snprintf(spare, sizeof spare, "%s.spare", before);
        ck_assert(rename(before, spare) == 0 && rename(name, before) == 0 &&
                  rename(spare, name) == 0);
    }
    snprintf(before, sizeof before, "%s", name);
}

static void append_byte(const char *name)
{
    int fd = open(name, O_WRONLY | O_APPEND);
    ck_assert_int_eq(write(fd, "x", 1), 1);
    close(fd);
}

/* The checksum of such blocks is valid: it covers neither the name nor the size of the file. */
START_TEST(test_http_cache_rejects_exchanged_and_longer_blocks)
{
    char url[300];
    snprintf(url, sizeof url, "%s", web_url("good"));
    ck_assert_uint_gt(visit_cached(url, 1 << 30).requests, 1);
    ck_assert_int_gt(each_file(rotate_names), 80);
    ck_assert_uint_gt(visit_cached(url, 1 << 30).requests, 1);
    ck_assert_uint_eq(visit_cached(url, 1 << 30).requests, 1);
    ck_assert_int_gt(each_file(append_byte), 80);
    ck_assert_uint_gt(visit_cached(url, 1 << 30).requests, 1);
    ck_assert_uint_eq(visit_cached(url, 1 << 30).requests, 1);
}
END_TEST

/* Data from the cache folder equals the file, for any ranges read before. */
START_TEST(test_http_cache_serves_other_ranges)
{
    char url[300];
    uint64_t random = 77;
    ebpo_error error = EBPO_ERROR_INIT;
    snprintf(url, sizeof url, "%s", web_url("good"));
    for (int session = 0; session < 12; session++) {
        ebpo_http_options o = quick();
        ebpo_source s = EBPO_SOURCE_INIT;
        o.cache_folder = cache;
        o.cache_bytes = 1 << 30;
        o.memory = session % 2 ? 300000 : o.memory;
        ck_assert_msg(ebpo_source_of_url(url, &o, &s, &error) == EBPO_OK, "%s", error.message);
        for (int i = 0; i < 12; i++) {
            uint64_t offset = i == 0 ? HEAD_BYTES - 100 + 100 * (uint64_t)(session % 3)
                                     : next_random(&random) % (DATA_BYTES - 1),
                     most = i % 3 ? 90000 : 700000;
            uint64_t size = 1 + next_random(&random) % most;
            ebpo_range range = { offset, offset + size > DATA_BYTES ? DATA_BYTES - offset : size };
            if (i % 2)
                s.prefetch(s.user, &range, 1);
            ck_assert_msg(read_one(&s, range.offset, range.size, &error) == EBPO_OK, "%s",
                          error.message);
        }
        s.close(s.user);
    }
}
END_TEST

START_TEST(test_http_cache_keeps_size_limit)
{
    enum { LIMIT = 1000000 };
    for (int i = 0; i < 3; i++)
        visit_cached(web_url("good"), LIMIT);
    total = 0;
    each_file(add_up);
    ck_assert_uint_gt(total, LIMIT / 4);
    ck_assert_uint_le(total, LIMIT);
}
END_TEST

START_TEST(test_http_cache_rejects_other_version)
{
    char url[300];
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_http_options o = quick();
    ebpo_source s = EBPO_SOURCE_INIT;
    o.cache_folder = cache;
    snprintf(url, sizeof url, "%s", web_url("change_etag-2"));
    ck_assert_int_eq(ebpo_source_of_url(url, &o, &s, &error), EBPO_OK);
    ck_assert_int_eq(read_one(&s, 200000, 1000, &error), EBPO_OK);
    ck_assert_int_eq(read_one(&s, 1200000, 1000, &error), EBPO_E_IO);
    s.close(s.user);
    ck_assert_int_eq(ebpo_source_of_url(url, &o, &s, &error), EBPO_OK);
    uint8_t got[1000];
    ck_assert_int_eq(s.read(s.user, 200000, 1000, got, &error), EBPO_OK);
    for (int i = 0; i < 1000; i++)
        ck_assert_uint_eq(got[i], data[DATA_BYTES - 1 - 200000 - i]);
    s.close(s.user);
}
END_TEST

START_TEST(test_http_cache_is_shared_by_processes)
{
    char url[300];
    snprintf(url, sizeof url, "%s", web_url("good"));
    pid_t child[3];
    for (int i = 0; i < 3; i++) {
        child[i] = fork();
        if (child[i] == 0) {
            ebpo_error error = EBPO_ERROR_INIT;
            ebpo_http_options o = quick();
            ebpo_source s = EBPO_SOURCE_INIT;
            o.cache_folder = cache;
            o.cache_bytes = 1500000;
            bool good = ebpo_source_of_url(url, &o, &s, &error) == EBPO_OK &&
                        read_all(&s, &error) == EBPO_OK;
            if (good)
                s.close(s.user);
            _exit(good ? 0 : 1);
        }
    }
    for (int i = 0; i < 3; i++) {
        int state;
        ck_assert_int_eq(waitpid(child[i], &state, 0), child[i]);
        ck_assert_int_eq(state, 0);
    }
}
END_TEST

/* --- response headers --- */

static ebpo_verdict judged(const char *const *lines, const ebpo_http_version *pinned,
                           char why[EBPO_WHY_BYTES])
{
    ebpo_http_response result = { .code = 0 };
    ebpo_http_request request = { 100, 200, pinned, 1000, false, false };
    ebpo_status status;
    for (; *lines; lines++)
        ebpo_http_response_line(&result, *lines, strlen(*lines));
    *why = 0;
    return ebpo_http_response_judge(&result, &request, &status, why);
}

#define JUDGED(...) judged((const char *const[]){ __VA_ARGS__, NULL }, &pinned, why)

START_TEST(test_http_header_parsing_is_strict)
{
    ebpo_http_version pinned = { 5000, "\"a\"", "" };
    char why[EBPO_WHY_BYTES];
    ck_assert_int_eq(JUDGED("HTTP/1.1 206 Partial\r\n", "content-range:bytes 100-199/5000\r\n",
                            "ETag: \"a\"\r\n"),
                     EBPO_HTTP_PART);
    ck_assert_int_eq(JUDGED("HTTP/2 206\r\n", "Content-Range: BYTES 100-150/5000 \r\n",
                            "etag:\"a\"\r\n"),
                     EBPO_HTTP_PART);
    ck_assert_int_eq(JUDGED("HTTP/1.1 302 Found\r\n", "Content-Encoding: gzip\r\n",
                            "HTTP/1.1 206 x\r\n", "Content-Range: bytes 100-199/5000",
                            "ETag: \"a\""),
                     EBPO_HTTP_PART);
    static const char *const wrong[] = {
        "bytes 100-200/5000",  "bytes 99-199/5000",
        "bytes 150-120/5000",  "bytes 100-199/150",
        "bytes 100-199/5001",  "bytes 100-199/",
        "bytes 100-199",       "bytes -199/5000",
        "bytes 100-/5000",     "bytes 100-199/5000x",
        "bytes  100-199/5000", "bytes 100-99999999999999999999999/5000",
        "items 100-199/5000",  "",
        "bytes */5000",        "bytes 100-199/*",
        "bytes +100-199/5000", "bytes 0100-0x99/5000"
    };
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        char line[100];
        snprintf(line, sizeof line, "Content-Range: %s\r\n", wrong[i]);
        ck_assert_msg(JUDGED("HTTP/1.1 206 x\r\n", line, "ETag: \"a\"\r\n") == EBPO_HTTP_REFUSED,
                      "%s", wrong[i]);
        ck_assert_uint_gt(strlen(why), 20);
    }
    ck_assert_int_eq(JUDGED("HTTP/1.1 206 x", "Content-Range: bytes 100-199/5000"),
                     EBPO_HTTP_REFUSED); /* the tag is missing */
    ck_assert_int_eq(JUDGED("HTTP/1.1 206 x", "Content-Range: bytes 100-199/5000", "ETag: W/\"a\""),
                     EBPO_HTTP_PART);
    ck_assert_int_eq(JUDGED("HTTP/1.1 206 x", "Content-Range: bytes 100-199/5000", "ETag: W/\"b\""),
                     EBPO_HTTP_REFUSED);
    ck_assert_int_eq(JUDGED("HTTP/1.1 206 x", "Content-Range: bytes 100-199/5000", "ETag: \"a\"",
                            "Content-Encoding: br"),
                     EBPO_HTTP_REFUSED);
    ck_assert_int_eq(JUDGED("HTTP/1.1 206 x", "Content-Range: bytes 100-199/5000", "ETag: \"a\"",
                            "Content-Encoding: identity"),
                     EBPO_HTTP_PART);
    ck_assert_int_eq(JUDGED("nonsense"), EBPO_HTTP_REFUSED);
    ck_assert_int_eq(JUDGED("HTTP/1.1 503 x"), EBPO_HTTP_LATER);
}
END_TEST

START_TEST(test_http_ranges_beyond_4_gib)
{
    ebpo_http_version pinned = { UINT64_C(900000000000), "\"a\"", "" };
    char why[EBPO_WHY_BYTES];
    static const struct {
        const char *line;
        uint64_t last;
        ebpo_verdict verdict;
    } results[] = {
        { "Content-Range: bytes 8589934592-8589934691/900000000000", UINT64_C(8589934691),
          EBPO_HTTP_PART },
        { "Content-Range: bytes 4294967296-4294967395/900000000000", 0,
          EBPO_HTTP_REFUSED }, /* less by 2^32 */
        { "Content-Range: bytes 8589934592-12884901887/900000000000", 0,
          EBPO_HTTP_REFUSED }, /* more than requested by 2^32 */
        { "Content-Range: bytes 8589934592-8589934691/2349901312", 0, EBPO_HTTP_REFUSED },
        { "Content-Range: bytes 8589934592-8589934691/18446744073709551616", 0, EBPO_HTTP_REFUSED },
    };
    for (size_t i = 0; i < sizeof results / sizeof *results; i++) {
        ebpo_http_response result = { .code = 0 };
        ebpo_http_request request = {
            UINT64_C(8589934592), UINT64_C(8589934692), &pinned, 1000, false, false
        };
        ebpo_status status;
        const char *const lines[] = { "HTTP/1.1 206 Partial", "ETag: \"a\"", results[i].line };
        for (int k = 0; k < 3; k++)
            ebpo_http_response_line(&result, lines[k], strlen(lines[k]));
        ck_assert_msg(ebpo_http_response_judge(&result, &request, &status, why) ==
                          results[i].verdict,
                      "%s", results[i].line);
        if (results[i].verdict == EBPO_HTTP_PART)
            ck_assert_uint_eq(result.last, results[i].last);
    }
}
END_TEST

START_TEST(test_http_long_etags_compare_fully)
{
    char line[2000], other[2000], why[EBPO_WHY_BYTES];
    ebpo_http_response result = { .code = 0 };
    memset(line, 'x', sizeof line);
    memcpy(line, "ETag: ", 6);
    memcpy(other, line, sizeof line);
    other[1999] = 'y';
    ebpo_http_response_line(&result, line, sizeof line);
    ebpo_http_version pinned = { 5000, "", "" };
    strcpy(pinned.etag, result.etag);
    ebpo_http_response second = {
        .code = 206, .has_range = true, .has_total = true, .begin = 100, .last = 199, .total = 5000
    };
    ebpo_http_request request = { 100, 200, &pinned, 1000, false, false };
    ebpo_status status;
    ebpo_http_response_line(&second, line, sizeof line);
    ck_assert_int_eq(ebpo_http_response_judge(&second, &request, &status, why), EBPO_HTTP_PART);
    ebpo_http_response_line(&second, other, sizeof other);
    ck_assert_int_eq(ebpo_http_response_judge(&second, &request, &status, why), EBPO_HTTP_REFUSED);
}
END_TEST

static void make_data(void)
{
    uint64_t random = 88172645463325252u;
    data = malloc(DATA_BYTES);
    for (size_t i = 0; i < DATA_BYTES; i++)
        data[i] = (uint8_t)(next_random(&random) >> 24);
}

TEST_SUITE(http)
{
    make_data();
    if (!test_arguments[0] || !web_start(test_arguments[0], data, DATA_BYTES)) {
        fprintf(stderr, "no Python, no web server\n");
        exit(TEST_SKIPPED);
    }
    Suite *suite = suite_create("http");
    TCase *tests = tcase_create("servers"), *folder = tcase_create("folder");
    tcase_set_timeout(tests, 120);
    tcase_set_timeout(folder, 120);
    tcase_add_checked_fixture(folder, set_up_cache, scratch_leave);
    tcase_add_loop_test(tests, test_http_harmless_faults_give_same_bytes, 0,
                        sizeof readable / sizeof *readable);
    tcase_add_test(tests, test_http_short_responses_are_continued);
    tcase_add_test(tests, test_http_unversioned_parts_are_not_joined);
    tcase_add_loop_test(tests, test_http_errors_name_file, 0,
                        sizeof unreadable / sizeof *unreadable);
    tcase_add_test(tests, test_http_final_status_is_not_retried);
    tcase_add_test(tests, test_http_text_content_type_is_accepted);
    tcase_add_test(tests, test_http_versions_can_be_ignored);
    tcase_add_test(tests, test_http_without_ranges_limits_file_size);
    tcase_add_test(tests, test_http_unversioned_file_is_one_response);
    tcase_add_test(tests, test_http_prefetch_uses_few_requests);
    tcase_add_loop_test(tests, test_http_several_ranges_take_one_request, 0,
                        sizeof several / sizeof *several);
    tcase_add_test(tests, test_http_unused_prefetch_hint_is_harmless);
    tcase_add_test(tests, test_http_concurrent_reads);
    tcase_add_test(tests, test_http_faults_never_give_wrong_bytes);
    tcase_add_test(tests, test_http_read_can_be_cancelled);
    tcase_add_test(tests, test_http_close_during_prefetch);
    tcase_add_test(tests, test_http_credentials_are_never_shown);
    tcase_add_test(tests, test_http_headers_stay_with_their_server);
    tcase_add_test(tests, test_http_invalid_options_are_refused);
    tcase_add_test(tests, test_http_unreachable_server_is_an_error);
    tcase_add_test(tests, test_http_header_parsing_is_strict);
    tcase_add_test(tests, test_http_ranges_beyond_4_gib);
    tcase_add_test(tests, test_http_long_etags_compare_fully);
    tcase_add_test(folder, test_http_cache_is_reused_and_checked);
    tcase_add_test(folder, test_http_cache_rejects_exchanged_and_longer_blocks);
    tcase_add_test(folder, test_http_cache_serves_other_ranges);
    tcase_add_test(folder, test_http_cache_keeps_size_limit);
    tcase_add_test(folder, test_http_cache_rejects_other_version);
    tcase_add_test(folder, test_http_cache_is_shared_by_processes);
    suite_add_tcase(suite, tests);
    suite_add_tcase(suite, folder);
    return suite;
}
