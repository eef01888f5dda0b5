/* Runs independent pieces of work on several threads, which take the pieces in ascending order. The
 * calling thread is one of these threads, and only the calling thread reports progress. Any thread
 * may run any piece, so results must not depend on the thread. If several pieces fail, the failure
 * of the first of these pieces is returned. This file starts all threads of the library, with a
 * fixed stack size. The threads compute with the default floating-point environment (fp_env.h). */
#include "core/parallel.h"

#include <stdatomic.h>

#include "core/os.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/workspace.h"

/* STACK_BYTES: stack of a thread. The library uses less than a quarter of this stack, but several
 * times as much when it is compiled with sanitizers. */
enum { MAX_THREADS = 256, STACK_BYTES = 4 << 20 };

/* State of ebpo_parallel_for. */
typedef struct run {
    ebpo_workspace *workspace;
    uint64_t count, grain;
    ebpo_task_fn task;
    void *context;
    const ebpo_progress *progress;
    const char *stage;
    _Atomic uint64_t next; /* first item of the next piece */
    _Atomic uint64_t done; /* number of finished items */
    atomic_bool stop;      /* true: begin no further pieces */
    pthread_mutex_t lock;  /* protects `failed_at`, `status` and `error` */
    uint64_t failed_at;    /* first item of the lowest piece that failed */
    ebpo_status status;
    ebpo_error error;
} run;

typedef struct worker {
    run *r;
    unsigned number; /* index of the worker; the calling thread is worker 0 */
    pthread_t thread;
} worker;

int ebpo_thread_start(pthread_t *thread, void *(*body)(void *), void *argument)
{
    pthread_attr_t attributes;
    int failed = pthread_attr_init(&attributes);
    if (failed)
        return failed;
    failed = pthread_attr_setstacksize(&attributes, STACK_BYTES);
    if (!failed)
        failed = pthread_create(thread, &attributes, body, argument);
    pthread_attr_destroy(&attributes);
    return failed;
}

unsigned ebpo_thread_count(unsigned requested)
{
    if (requested)
        return requested < MAX_THREADS ? requested : MAX_THREADS;
    int cores = ebpo_cores();
    return cores < 1 ? 1 : cores > MAX_THREADS ? MAX_THREADS : (unsigned)cores;
}

/* Stops the run, and records the failure of the piece that begins at item `at`. If a piece with
 * lower items has failed, keeps the failure of that piece. */
static void record_failure(run *r, uint64_t at, ebpo_status status, const ebpo_error *error)
{
    pthread_mutex_lock(&r->lock);
    if (r->status == EBPO_OK || at < r->failed_at) {
        r->failed_at = at;
        r->status = status;
        r->error = *error;
    }
    pthread_mutex_unlock(&r->lock);
    atomic_store(&r->stop, true);
}

static void work_on_pieces(run *r, unsigned number)
{
    double last = ebpo_seconds();
    while (!atomic_load(&r->stop)) {
        uint64_t begin = atomic_fetch_add(&r->next, r->grain);
        if (begin >= r->count)
            return;
        uint64_t end = r->count - begin < r->grain ? r->count : begin + r->grain;
        ebpo_error error = EBPO_ERROR_INIT;
        ebpo_status status = r->task(r->context, begin, end, number, &error);
        ebpo_release_pages(r->workspace);
        if (status != EBPO_OK)
            record_failure(r, begin, status, &error);
        uint64_t done = atomic_fetch_add(&r->done, end - begin) + (end - begin);
        if (number == 0 && r->progress && r->progress->report && ebpo_seconds() - last > 0.1) {
            last = ebpo_seconds();
            if (!ebpo_progress_step(r->progress, r->stage, done, r->count, &error))
                record_failure(r, begin, EBPO_E_CANCELLED, &error);
        }
    }
}

static void *run_worker(void *argument)
{
    EBPO_DEFAULT_FP;
    worker *w = argument;
    work_on_pieces(w->r, w->number);
    return NULL;
}

bool ebpo_progress_step(const ebpo_progress *progress, const char *stage, uint64_t done,
                        uint64_t total, ebpo_error *error)
{
    if (!progress || !progress->report || !*stage ||
        progress->report(progress->user, stage, done, total))
        return true;
    ebpo_fail(error, EBPO_E_CANCELLED, "stopped on request during %s", stage);
    return false;
}

bool ebpo_progress_stage(const ebpo_progress *progress, const char *stage, ebpo_error *error)
{
    return ebpo_progress_step(progress, stage, 0, 0, error);
}

/* Converts the progress of a pass to the progress of the whole stage, and reports it. */
static bool report_pass(void *user, const char *stage, uint64_t done, uint64_t total)
{
    const ebpo_pass *p = user;
    double share = total ? (double)done / (double)total : 0;
    enum { PARTS = 1024 }; /* steps reported for a pass, because `report` takes whole numbers */
    return p->to->report(p->to->user, stage,
                         PARTS * p->begin + (uint64_t)(share * PARTS * (double)(p->end - p->begin)),
                         PARTS * p->of);
}

ebpo_progress ebpo_pass_progress(ebpo_pass *pass)
{
    return (ebpo_progress){ pass->to && pass->to->report ? report_pass : NULL, pass };
}

ebpo_status ebpo_parallel_for(unsigned threads, ebpo_workspace *workspace, uint64_t count,
                              uint64_t grain, ebpo_task_fn task, void *context,
                              const ebpo_progress *progress, const char *stage, ebpo_error *error)
{
    run r = { .workspace = workspace,
              .count = count,
              .grain = grain ? grain : 1,
              .task = task,
              .context = context,
              .progress = progress,
              .stage = stage,
              .lock = PTHREAD_MUTEX_INITIALIZER,
              .status = EBPO_OK };
    /* even a short stage reports its beginning, because callers measure the times of stages */
    if (!ebpo_progress_step(progress, stage, 0, count, error))
        return EBPO_E_CANCELLED;
    threads = ebpo_thread_count(threads);
    uint64_t pieces = count / r.grain + 1;
    if (threads > pieces)
        threads = (unsigned)pieces;
    worker workers[MAX_THREADS];
    unsigned started = 1;
    for (; started < threads; started++) {
        workers[started] = (worker){ .r = &r, .number = started };
        if (ebpo_thread_start(&workers[started].thread, run_worker, &workers[started]) != 0)
            break; /* fewer threads give the same result */
    }
    work_on_pieces(&r, 0);
    for (unsigned i = 1; i < started; i++)
        pthread_join(workers[i].thread, NULL);
    pthread_mutex_destroy(&r.lock);
    if (r.status != EBPO_OK && error)
        *error = r.error;
    return r.status;
}
