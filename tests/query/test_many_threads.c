/* 64 threads share one handle under a small budget for two models, with prefetching, contexts that
 * come and go, haptic devices, and fault injection. Every result equals that of one thread with
 * everything in memory, and an error reaches only the caller whose read failed. Reads a file, a
 * source and a server; test_many_threads [FAULTY_SERVER]
 *
 * EBPO_TEST_SECONDS=600 runs for 600 seconds with each of these three, on larger models. Without
 * the variable each thread runs some queries. Intended for ThreadSanitizer and AddressSanitizer. */
#include <inttypes.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/ebpo.h>

#include "core/os.h"
#include "check_main.h"
#include "model_file.h"
#include "query_mix.h"
#include "scratch.h"
#include "solids.h"
#include "web.h"

enum { THREADS = 64, MODELS = 2, NUMBERS = 24 };
enum { FROM_FILE, FROM_SOURCE, FROM_SERVER, PLACES };

static const char *const names[MODELS] = { "torus.ebpo.h5", "thick.ebpo.h5" };
static uint64_t right[MODELS][MIX_KINDS][NUMBERS];
static bool served;

static double seconds(void)
{
    const char *text = getenv("EBPO_TEST_SECONDS");
    return text ? atof(text) : 0;
}

static void must(ebpo_status status, const char *what, const ebpo_error *error)
{
    if (status != EBPO_OK)
        ck_abort_msg("%s: %s", what, error->message);
}

/* --- a source that fails when the reading thread requests it --- */

typedef struct bytes {
    uint8_t *data;
    uint64_t size;
} bytes;

static bytes content[MODELS];
static __thread unsigned own_number; /* 0: a thread of the library */
/* the number of the read that fails, counted from now; 0: none */
static __thread unsigned fail_in;
static _Atomic uint64_t background; /* reads in threads of the library */
static _Atomic bool background_fails;

static ebpo_status fail_as(const char *who, unsigned number, ebpo_error *error)
{
    if (error) {
        error->status = EBPO_E_IO;
        snprintf(error->message, sizeof error->message, "refused by %s %u;", who, number);
    }
    return EBPO_E_IO;
}

static ebpo_status read_some(void *user, uint64_t offset, uint64_t size, void *data,
                             ebpo_error *error)
{
    const bytes *b = user;
    if (own_number && fail_in && --fail_in == 0)
        return fail_as("thread", own_number, error);
    if (!own_number && background_fails && atomic_fetch_add(&background, 1) % 16 == 15)
        return fail_as("background", 0, error);
    memcpy(data, b->data + offset, size);
    return EBPO_OK;
}

static void expect_reads(void *user, const ebpo_range *ranges, size_t count)
{
    (void)user, (void)ranges, (void)count;
}

/* --- files --- */

static void write_model(const char *name, ebpo_mesh mesh)
{
    ebpo_tree tree = model_build_parts(mesh, 8, ebpo_profile_parts(EBPO_PROFILE_FULL));
    ebpo_write_options options = EBPO_WRITE_OPTIONS_INIT;
    options.subtree_faces = 32;
    model_write(&tree, scratch(name), &options);
}

static void slurp(const char *name, bytes *out)
{
    enum { LIMIT = 64 << 20 };
    FILE *f = fopen(scratch(name), "rb");
    out->data = malloc(LIMIT);
    ck_assert(f && out->data);
    out->size = fread(out->data, 1, LIMIT, f);
    fclose(f);
}

static ebpo_file *open_from(int place, int which)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_source source = EBPO_SOURCE_INIT;
    ebpo_file *file;
    if (place == FROM_SERVER && which == 0) {
        must(ebpo_open(web_url("random-1-5"), &file, &error), "opening from the server", &error);
        return file;
    }
    if (place == FROM_FILE) {
        must(ebpo_open(scratch(names[which]), &file, &error), "opening", &error);
        return file;
    }
    source.user = &content[which];
    source.size = content[which].size;
    source.read = read_some;
    source.prefetch = which ? NULL : expect_reads;
    source.prefetched = 30000;
    must(ebpo_open_source(&source, "source", &file, &error), "opening", &error);
    return file;
}

/* --- results of one thread --- */

static void query_alone(int which)
{
    ebpo_error error = EBPO_ERROR_INIT;
    mix_session a = { .file = model_open(scratch(names[which])) };
    must(ebpo_model_new(a.file, NULL, &a.model, &error), "model", &error);
    must(ebpo_context_new(a.model, &a.context, &error), "context", &error);
    for (int kind = 0; kind < MIX_KINDS; kind++)
        for (uint64_t n = 0; n < NUMBERS; n++)
            must(mix_query(&a, kind, n, &right[which][kind][n], &error), mix_names[kind], &error);
    ebpo_context_free(a.context);
    ebpo_model_free(a.model);
    ebpo_close((ebpo_file *)a.file);
}

static void begin(void)
{
    const uint32_t n = seconds() > 0 ? 70 : 50;
    scratch_enter();
    write_model(names[0], ebpo_test_torus(3, 1, 2 * n, n));
    write_model(names[1], ebpo_test_torus(2, 1.5, n, 2 * n));
    for (int which = 0; which < MODELS; which++) {
        slurp(names[which], &content[which]);
        query_alone(which);
    }
    served = test_arguments[0] && web_start(test_arguments[0], content[0].data, content[0].size);
}

static void end(void)
{
    web_stop();
    for (int which = 0; which < MODELS; which++)
        free(content[which].data);
    scratch_leave();
}

/* --- threads --- */

typedef struct shared {
    int place;
    ebpo_file *file[MODELS];
    ebpo_budget *budget;
    ebpo_model *model[MODELS];
    double until; /* seconds; 0: limited by count */
    uint64_t count;
    _Atomic bool enough;
    _Atomic uint64_t queries[MIX_KINDS], refused, wrong;
    _Atomic unsigned reported;
} shared;

typedef struct worker {
    shared *s;
    unsigned number;
    uint64_t state;
    mix_session session;
    int which;
} worker;

static uint64_t draw(worker *w, uint64_t below)
{
    w->state = w->state * 6364136223846793005u + 1442695040888963407u;
    return (w->state >> 33) % below;
}

static void report(worker *w, int kind, uint64_t number, const char *what)
{
    w->s->wrong++;
    w->s->enough = true;
    if (w->s->reported++ < 10)
        fprintf(stderr, "thread %u, %s %" PRIu64 " of %s: %s\n", w->number, mix_names[kind], number,
                names[w->which], what);
}

/* Returns true when a failure is expected: of a read by the worker, or of a read by a library
 * thread for the worker. */
static bool is_own(const worker *w, int kind, bool wanted, const ebpo_error *error)
{
    char own[64];
    snprintf(own, sizeof own, "refused by thread %u;", w->number);
    if (strstr(error->message, own))
        return wanted;
    return mix_has_workers(kind) && strstr(error->message, "refused by background");
}

/* Runs a query. The first query of each thread has injected faults, so that faults occur for any
 * number of queries: at that time not everything is in memory. */
static void query_check_points(worker *w, bool first)
{
    int kind = (int)draw(w, MIX_KINDS);
    bool wanted = w->s->place != FROM_FILE && (draw(w, 8) == 0 || first);
    uint64_t number = draw(w, NUMBERS), hash = 0;
    ebpo_error error = EBPO_ERROR_INIT;
    fail_in = first && wanted ? 1 : wanted ? 1 + (unsigned)draw(w, 4) : 0;
    ebpo_status status = mix_query(&w->session, kind, number, &hash, &error);
    fail_in = 0;
    w->s->queries[kind]++;
    if (status != EBPO_OK) {
        w->s->refused++;
        if (status != EBPO_E_IO || !is_own(w, kind, wanted, &error))
            report(w, kind, number, error.message[0] ? error.message : "fails without a message");
    } else if (hash != right[w->which][kind][number]) {
        report(w, kind, number, "the result differs from that of one thread");
    }
}

/* Replaces the context by a context of one of the two models. */
static bool change_context(worker *w)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_context_free(w->session.context);
    w->session.context = NULL;
    w->which = (int)draw(w, MODELS);
    w->session.file = w->s->file[w->which];
    w->session.model = w->s->model[w->which];
    if (ebpo_context_new(w->session.model, &w->session.context, &error) == EBPO_OK)
        return true;
    report(w, 0, 0, error.message);
    return false;
}

static void *work(void *user)
{
    worker *w = user;
    shared *s = w->s;
    ebpo_budget_stats stats = EBPO_BUDGET_STATS_INIT;
    own_number = w->number;
    for (uint64_t i = 0; !s->enough; i++) {
        if (s->until ? ebpo_seconds() > s->until : i >= s->count)
            break;
        if (i % 20 == 0 && !change_context(w))
            break;
        query_check_points(w, i == 0);
        if (ebpo_budget_get_stats(s->budget, &stats) != EBPO_OK || stats.memory > stats.budget)
            report(w, 0, 0, "more memory is used than the budget");
    }
    ebpo_context_free(w->session.context);
    return NULL;
}

/* Returns the memory of 64 contexts with a subtree each, and the same amount for loading. */
static uint64_t budget_for(const shared *s)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    enum { LEAST = 3 << 20 }; /* minimum of a shared budget */
    uint64_t most = 0;
    for (int which = 0; which < MODELS; which++) {
        ebpo_model_plan plan = EBPO_MODEL_PLAN_INIT;
        must(ebpo_model_memory(s->file[which], NULL, &plan, &error), "memory", &error);
        options.memory = plan.least;
        must(ebpo_model_memory(s->file[which], &options, &plan, &error), "memory", &error);
        most += plan.least + 2 * THREADS * plan.subtree_bytes;
    }
    return most > LEAST ? most : LEAST;
}

static void make_models(shared *s)
{
    ebpo_error error = EBPO_ERROR_INIT;
    for (int which = 0; which < MODELS; which++)
        s->file[which] = open_from(s->place, which);
    must(ebpo_budget_new(budget_for(s), &s->budget, &error), "budget", &error);
    for (int which = 0; which < MODELS; which++) {
        ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
        options.cut_level = 2;
        options.prefetch = true;
        options.budget = s->budget;
        must(ebpo_model_new(s->file[which], &options, &s->model[which], &error), "model", &error);
    }
}

static void free_models(shared *s)
{
    ebpo_budget_stats stats = EBPO_BUDGET_STATS_INIT;
    for (int which = 0; which < MODELS; which++) {
        ebpo_model_stats of = EBPO_MODEL_STATS_INIT;
        ck_assert_int_eq(ebpo_model_get_stats(s->model[which], &of), EBPO_OK);
        ck_assert(!of.resident);
        printf("%s: %" PRIu64 " loads, %" PRIu64 " hits, %" PRIu64 " ahead, %" PRIu64 " dropped\n",
               names[which], of.loads, of.hits, of.prefetched, of.evicted);
        ebpo_model_free(s->model[which]);
    }
    ck_assert_int_eq(ebpo_budget_get_stats(s->budget, &stats), EBPO_OK);
    ck_assert_uint_eq(stats.memory, 0);
    ck_assert_uint_le(stats.memory_peak, stats.budget);
    ebpo_budget_free(s->budget);
    for (int which = 0; which < MODELS; which++)
        ebpo_close(s->file[which]);
}

START_TEST(test_many_threads_match_single_thread)
{
    static worker w[THREADS];
    pthread_t thread[THREADS];
    shared s = { .place = _i, .count = ebpo_test_scaled(60) };
    uint64_t total = 0;
    if (s.place == FROM_SERVER && !served)
        return;
    background_fails = false;
    make_models(&s);
    background_fails = s.place == FROM_SOURCE;
    s.until = seconds() > 0 ? ebpo_seconds() + seconds() : 0;
    for (unsigned i = 0; i < THREADS; i++) {
        w[i] = (worker){ .s = &s, .number = i + 1, .state = i + 1 };
        ck_assert_int_eq(pthread_create(&thread[i], NULL, work, &w[i]), 0);
    }
    for (int i = 0; i < THREADS; i++)
        pthread_join(thread[i], NULL);
    for (int kind = 0; kind < MIX_KINDS; kind++)
        total += s.queries[kind];
    printf("%" PRIu64 " queries, %" PRIu64 " refused, %" PRIu64 " wrong\n", total, s.refused,
           s.wrong);
    free_models(&s);
    ck_assert_uint_eq(s.wrong, 0);
    ck_assert(s.place == FROM_FILE || s.refused > 0);
}
END_TEST

Suite *test_suite(void)
{
    Suite *suite = suite_create("many_threads");
    TCase *tests = tcase_create("threads");
    tcase_set_timeout(tests, 1000 + 2 * seconds());
    tcase_add_unchecked_fixture(tests, begin, end);
    tcase_add_loop_test(tests, test_many_threads_match_single_thread, 0, PLACES);
    suite_add_tcase(suite, tests);
    return suite;
}
