/* Evaluates queries by several threads: they take blocks of consecutive input rows, evaluate the
 * rows, and write the results in the order of the input. A slot holds a block in progress, and its
 * results. */
#include "cli/commands/query_pipe.h"

#include <fcntl.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <unistd.h>

#include "cli/command.h"
#include "cli/points_parse.h"

/* Number of blocks in progress for each thread; LARGE_EACH is for large blocks. With more than one
 * block, a thread can continue while the oldest block is not finished. */
enum { BLOCKS_EACH = 4, LARGE_EACH = 2 };
/* Number of rows of the first piece of the first block, see compute_block. */
enum { FIRST_ROWS = 16 };
/* A large block keeps up to this number of bytes of results for each row in memory. When it has
 * more, it tries to write them. */
enum { KEPT_BYTES = 128 };

/* A block of queries, and its results. */
typedef struct slot {
    struct pipe_line *pipe;
    points_block block;
    result_text text;   /* the results */
    uint64_t number;    /* number of the block, from 0 */
    bool holds_model;   /* the thread of the block holds the lock of the model */
    bool done;          /* the block is evaluated, and not yet written */
    ebpo_status status; /* status of the evaluation */
    ebpo_error error;
} slot;

typedef struct pipe_thread {
    struct pipe_line *pipe;
    query_worker worker;
    pthread_t thread;
} pipe_thread;

/* The state of all threads. There are two locks: `lock`, and the lock of the model
 * (query_holding.h), which a thread holds while it evaluates rows. No thread waits for `changed`
 * while it holds the lock of the model, and no thread takes another lock while it holds `lock`. So
 * each thread that holds the lock of the model will release it, and there is no deadlock. */
typedef struct pipe_line {
    const query_job *job;
    query_holding *holding;
    points *in;
    int wake_pipe; /* writing a byte here ends the wait of the reading thread; -1: no pipe */
    progress_line *progress;
    unsigned threads;         /* maximum number of threads */
    uint64_t slots;           /* maximum number of blocks in progress */
    slot *slot;               /* [slots] block i is in slot i % slots */
    pipe_thread *pipe_thread; /* [threads] the first `started` threads have started */
    atomic_uint started;      /* changed by the thread that is taking a block */
    pthread_mutex_t lock;     /* protects the members from here to `stopped` */
    pthread_cond_t changed;   /* signals that one of these members has changed */
    bool taking;              /* a thread is taking a block; only one at a time */
    uint64_t taken;           /* number of blocks that were taken */
    uint64_t written;         /* number of blocks whose results have been written */
    bool writing;             /* a thread is writing block `written`; only one at a time */
    bool stopped;             /* an error has occurred; no more blocks are taken or written */
    /* only the thread that writes blocks uses the next members */
    uint64_t rows_written;  /* number of rows in written blocks */
    uint64_t bytes_written; /* bytes of input of these blocks */
    int code;               /* exit code */
} pipe_line;

/* --- writing results in order --- */

static void stop_pipe(pipe_line *p)
{
    p->stopped = true;
    if (p->wake_pipe >= 0)
        (void)!write(p->wake_pipe, "", 1);
    pthread_cond_broadcast(&p->changed);
}

/* Returns true if all earlier blocks have been written. Waits until this is true, unless the thread
 * holds the lock of the model. */
static bool has_turn(slot *s)
{
    pipe_line *p = s->pipe;
    pthread_mutex_lock(&p->lock);
    while (!s->holds_model && p->written != s->number && !p->stopped)
        pthread_cond_wait(&p->changed, &p->lock);
    bool turn = p->written == s->number;
    if (p->stopped)
        result_text_discard(&s->text);
    pthread_mutex_unlock(&p->lock);
    return turn;
}

/* Called when the results of a block have become long. Writes the results if all earlier blocks
 * have been written. Otherwise marks the text as full: evaluation then stops after a row. It
 * continues when this thread has released the lock of the model, and all earlier blocks have been
 * written. */
static void spill_results(result_text *t, void *user)
{
    slot *s = user;
    if (has_turn(s))
        (void)result_text_write(t, s->pipe->job->command);
    else
        t->full = !t->failed;
}

/* Reports the number of queries so far, and the total number. If only the size of the input is
 * known, estimates the total. */
static void report_progress(pipe_line *p, const slot *s)
{
    uint64_t total = p->in->rows_known ? p->in->rows_total : 0;
    p->rows_written += s->block.row_count;
    p->bytes_written += s->block.count;
    if (!total && p->in->bytes_total && p->bytes_written)
        total = (uint64_t)((double)p->rows_written *
                           ((double)p->in->bytes_total / (double)p->bytes_written));
    progress_report(p->progress, "queries", p->rows_written, total);
}

/* Writes the results of a block, and then reports its error, if there is one. Returns false if no
 * further results may be written. */
static bool write_block(pipe_line *p, slot *s)
{
    bool written = result_text_write(&s->text, p->job->command);
    if (!written || s->status != EBPO_OK || s->block.failed)
        progress_wipe(p->progress);
    if (!written)
        p->code = s->text.failed ? command_no_memory(p->job->command) : EXIT_FAILED;
    else if (s->status != EBPO_OK)
        p->code = command_failed(p->job->command, &s->error);
    else if (!points_finish_block(p->in, &s->block))
        p->code = EXIT_FAILED;
    else
        report_progress(p, s);
    return p->code == EXIT_OK;
}

/* Marks a block as done. If all earlier blocks have been written, writes this block and the
 * finished blocks that follow it. */
static void finish_block(pipe_line *p, slot *s)
{
    pthread_mutex_lock(&p->lock);
    s->done = true;
    for (;;) {
        slot *oldest = &p->slot[p->written % p->slots];
        if (p->writing || p->stopped || !oldest->done || oldest->number != p->written)
            break;
        p->writing = true;
        pthread_mutex_unlock(&p->lock);
        bool keep_going = write_block(p, oldest);
        pthread_mutex_lock(&p->lock);
        p->writing = oldest->done = false;
        p->written++;
        if (!keep_going)
            stop_pipe(p);
        pthread_cond_broadcast(&p->changed);
    }
    pthread_mutex_unlock(&p->lock);
}

/* --- one block --- */

/* Ensures that w->results has space for `rows` rows of `row_bytes` each. Returns false if there is
 * not enough memory. */
static bool alloc_results(query_worker *w, size_t row_bytes, uint64_t rows)
{
    if (row_bytes && w->row_capacity < rows) {
        free(w->results);
        w->results = malloc(rows * row_bytes);
        w->row_capacity = w->results ? rows : 0;
    }
    return !row_bytes || w->row_capacity >= rows;
}

/* Estimates the number of queries in the input; 0: not known. */
static double estimate_total(const points *in, const points_block *b)
{
    if (in->rows_known)
        return (double)in->rows_total;
    return (double)in->bytes_total * (double)b->row_count / (double)(b->count ? b->count : 1);
}

/* Evaluates the rows from number s->text.rows on. Call after query_holding_enter. The function
 * calls query_holding_leave. */
static void compute_from_row(pipe_line *p, query_worker *w, slot *s, const double *rows,
                             uint64_t count)
{
    uint64_t done = s->text.rows, width = (uint64_t)points_width(p->job->kind);
    double begin = progress_now();
    s->holds_model = true;
    s->status = p->job->result(p->job, w, rows + done * width, count - done, &s->error);
    s->holds_model = false;
    query_holding_leave(p->holding, count - done, progress_now() - begin);
}

/* Evaluates and prints rows of a block. After the call, s->text.rows is the number of evaluated
 * rows, which may be less than `count`. If memory is short because other threads use it, evaluates
 * the rows again while no other thread uses the model. Returns false if no further rows may be
 * evaluated. */
static bool compute_rows(pipe_line *p, query_worker *w, slot *s, const double *rows, uint64_t count,
                         double total)
{
    s->text.rows = 0;
    s->status = query_holding_enter(p->holding, &w->context, total, &s->error);
    if (s->status != EBPO_OK)
        return false;
    compute_from_row(p, w, s, rows, count);
    if (s->status == EBPO_E_LIMIT && p->started > 1 &&
        query_holding_enter_alone(p->holding, &w->context)) {
        result_text_retry(&s->text);
        compute_from_row(p, w, s, rows, count);
    }
    if (s->status != EBPO_OK)
        return count > 1 && s->text.rows == 0; /* true: compute_block tries the rows one by one */
    if (p->job->print)
        p->job->print(p->job, w, rows, count);
    if (s->text.full) {
        result_text_retry(&s->text);
        (void)has_turn(s);
    }
    return !result_text_is_over(&s->text);
}

/* Evaluates all rows of a block. The first block is evaluated in pieces, because the whole model
 * may be loaded before each piece. The first piece is small; each other piece is as large as all
 * pieces before it. If a piece fails, its rows are evaluated one by one, so that the results before
 * the failing row are printed. */
static void compute_block(pipe_line *p, query_worker *w, slot *s)
{
    const points_block *b = &s->block;
    uint64_t width = (uint64_t)points_width(p->job->kind), most = b->row_count;
    double total = estimate_total(p->in, b);
    ebpo_error none = EBPO_ERROR_INIT;
    s->error = none;
    s->status = EBPO_OK;
    w->text = &s->text;
    if (!alloc_results(w, p->job->result_bytes, b->row_count)) {
        result_text_discard(&s->text);
        return;
    }
    for (uint64_t at = 0; at < b->row_count; at += s->text.rows) {
        bool in_pieces = s->number == 0 && p->holding->may_load_all;
        uint64_t piece = !in_pieces ? most : at ? at : FIRST_ROWS;
        most = s->status == EBPO_OK ? most : 1;
        piece = piece < most ? piece : most;
        piece = piece < b->row_count - at ? piece : b->row_count - at;
        if (!compute_rows(p, w, s, b->rows + at * width, piece, total))
            break;
    }
}

/* --- threads --- */

static void *work_on_blocks(void *user);

/* Starts another thread, unless p->threads threads have started. */
static void start_thread(pipe_line *p)
{
    pipe_thread *next = &p->pipe_thread[p->started];
    if (p->started < p->threads && command_thread(&next->thread, work_on_blocks, next) == 0)
        p->started++;
}

/* Waits until no other thread is taking a block and a slot is free. Returns false if no more blocks
 * are taken. */
static bool begin_to_take(pipe_line *p)
{
    pthread_mutex_lock(&p->lock);
    while (!p->stopped && (p->taking || p->taken - p->written >= p->slots))
        pthread_cond_wait(&p->changed, &p->lock);
    bool may_take = !p->stopped;
    p->taking |= may_take;
    pthread_mutex_unlock(&p->lock);
    return may_take;
}

static void end_taking(pipe_line *p, bool has_block)
{
    pthread_mutex_lock(&p->lock);
    p->taking = false;
    p->taken += has_block;
    pthread_cond_broadcast(&p->changed);
    pthread_mutex_unlock(&p->lock);
}

/* Reads the next block of the input. Returns NULL at the end. */
static slot *take_block(pipe_line *p)
{
    if (!begin_to_take(p))
        return NULL;
    slot *s = &p->slot[p->taken % p->slots];
    bool has_block = points_take(p->in, &s->block);
    if (has_block) {
        s->number = p->taken;
        if (s->number > 0 || s->block.count > POINTS_BATCH * 8)
            start_thread(p);
    }
    end_taking(p, has_block);
    return has_block ? s : NULL;
}

static void *work_on_blocks(void *user)
{
    pipe_thread *c = user;
    pipe_line *p = c->pipe;
    for (slot *s = take_block(p); s; s = take_block(p)) {
        points_parse(p->in, &s->block);
        compute_block(p, &c->worker, s);
        finish_block(p, s);
    }
    return NULL;
}

/* --- run --- */

/* Makes the pipe that interrupts a wait for input. */
static void make_wake_pipe(pipe_line *p)
{
    int ends[2];
    if (pipe(ends) != 0)
        return; /* without the pipe, the reading thread stops only at the next input */
    for (int i = 0; i < 2; i++)
        (void)fcntl(ends[i], F_SETFD, FD_CLOEXEC);
    p->in->wake_fd = ends[0];
    p->wake_pipe = ends[1];
}

static bool make_slots(pipe_line *p)
{
    p->slot = calloc(p->slots, sizeof *p->slot);
    p->pipe_thread = calloc(p->threads, sizeof *p->pipe_thread);
    if (!p->slot || !p->pipe_thread)
        return false;
    for (uint64_t i = 0; i < p->slots; i++) {
        if (!result_text_init(&p->slot[i].text))
            return false;
        p->slot[i].pipe = p;
        if (p->in->rows_per_block > POINTS_BATCH)
            p->slot[i].text.spill_at = KEPT_BYTES * p->in->rows_per_block;
        p->slot[i].text.spill = spill_results;
        p->slot[i].text.user = &p->slot[i];
    }
    for (unsigned i = 0; i < p->threads; i++)
        p->pipe_thread[i].pipe = p;
    if (p->threads > 1)
        make_wake_pipe(p);
    return true;
}

static void free_slots(pipe_line *p)
{
    for (unsigned i = 0; p->pipe_thread && i < p->threads; i++) {
        query_holding_drop_context(p->holding, &p->pipe_thread[i].worker.context);
        free(p->pipe_thread[i].worker.results);
    }
    for (uint64_t i = 0; p->slot && i < p->slots; i++) {
        points_block_free(&p->slot[i].block);
        result_text_free(&p->slot[i].text);
    }
    if (p->wake_pipe >= 0) {
        close(p->wake_pipe);
        close(p->in->wake_fd);
    }
    p->in->wake_fd = -1;
    free(p->slot);
    free(p->pipe_thread);
}

/* Runs the query without rows, which reports unsupported queries, and prints the line of column
 * names. Returns an exit code. */
static int query_no_rows(pipe_line *p, query_worker *w)
{
    ebpo_error error = EBPO_ERROR_INIT;
    w->text = &p->slot[0].text;
    ebpo_status status = query_holding_enter(p->holding, &w->context, 0, &error);
    if (status == EBPO_OK) {
        status = p->job->result(p->job, w, NULL, 0, &error);
        query_holding_leave(p->holding, 0, 0);
    }
    if (status != EBPO_OK)
        return command_failed(p->job->command, &error);
    if (p->job->values->header && !p->job->continues && p->job->form != RESULTS_JSON &&
        p->job->form != RESULTS_RAW)
        results_header(w->text, p->job->form, p->job->columns(p->job), p->job->values->attribute);
    return EXIT_OK;
}

int query_pipe_run(const query_job *job, query_holding *holding, points *in, unsigned threads,
                   progress_line *progress)
{
    pipe_line p = {
        .job = job, .holding = holding, .in = in, .wake_pipe = -1, .progress = progress
    };
    p.threads = threads;
    p.slots = threads > 1 ? (uint64_t)threads *
                                (in->rows_per_block > POINTS_BATCH ? LARGE_EACH : BLOCKS_EACH)
                          : 1;
    pthread_mutex_init(&p.lock, NULL);
    pthread_cond_init(&p.changed, NULL);
    p.code = make_slots(&p) ? EXIT_OK : command_no_memory(job->command);
    if (p.code == EXIT_OK)
        p.code = query_no_rows(&p, &p.pipe_thread[0].worker);
    if (p.code == EXIT_OK) {
        p.started = 1;
        work_on_blocks(&p.pipe_thread[0]);
        /* A thread starts other threads only before it ends. Thread 0 and the joined threads have
         * ended, so `started` is final when the loop ends. */
        for (unsigned i = 1; i < p.started; i++)
            pthread_join(p.pipe_thread[i].thread, NULL);
        if (p.code == EXIT_OK && !result_text_write(&p.slot[0].text, job->command))
            p.code = EXIT_FAILED; /* there were no results, only the line of column names */
        if (p.code == EXIT_OK && in->failed)
            p.code = EXIT_FAILED;
    }
    free_slots(&p);
    pthread_mutex_destroy(&p.lock);
    pthread_cond_destroy(&p.changed);
    return p.code;
}
