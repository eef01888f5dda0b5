#include "cli/commands/query_pipe.h"

#include <fcntl.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <unistd.h>

#include "cli/command.h"
#include "cli/points_parse.h"

/* Blocks under way for each thread: while the oldest one is waited for, others are done. Of large
 * ones fewer. */
enum { BLOCKS_EACH = 4, LARGE_EACH = 2, FIRST_PIECE = 16 };
/* Answers to a block that are kept, for each of its rows. */
enum { KEPT_EACH = 128 };

/* A block of questions, and its answers. */
typedef struct slot {
    struct pipe_line *pipe;
    points_block block;
    answer_text text;
    uint64_t number;
    bool holds; /* its thread holds the model */
    bool done;
    ebpo_status status;
    ebpo_error error;
} slot;

typedef struct crew {
    struct pipe_line *pipe;
    query_worker worker;
    pthread_t thread;
} crew;

/* Two locks: the model's (query_holding.h), which is held while rows are answered, and `lock`. No
 * thread waits for `moved` while it holds the model, and none takes another lock while it holds
 * `lock`. So whoever holds the model lets it go, and the oldest block waits for nothing else. */
typedef struct pipe_line {
    const query_job *job;
    query_holding *holding;
    points *in;
    int waker; /* a byte written here ends its waiting; -1: nobody waits beside others */
    progress_line *progress;
    unsigned threads; /* at most */
    uint64_t slots;
    slot *slot;           /* [slots] block i is in slot i % slots */
    crew *crew;           /* [threads] the first `working` of them have begun */
    atomic_uint working;  /* changed by the thread that takes */
    pthread_mutex_t lock; /* of all below */
    pthread_cond_t moved; /* any of these has changed */
    bool taking;          /* a thread takes a block; no other one does */
    uint64_t taken;       /* blocks */
    uint64_t left;        /* blocks whose answers have left */
    bool leaving;         /* a thread lets block `left` leave; no other one does */
    bool stopped;
    /* these belong to the thread that lets blocks leave */
    uint64_t rows_left, bytes_left;
    int code;
} pipe_line;

/* --- answers leave in order --- */

static void stop_pipe(pipe_line *p)
{
    p->stopped = true;
    if (p->waker >= 0)
        (void)!write(p->waker, "", 1);
    pthread_cond_broadcast(&p->moved);
}

/* Returns whether all blocks before this one have left; waits for that unless the thread holds the
 * model. */
static bool has_turn(slot *s)
{
    pipe_line *p = s->pipe;
    pthread_mutex_lock(&p->lock);
    while (!s->holds && p->left != s->number && !p->stopped)
        pthread_cond_wait(&p->moved, &p->lock);
    bool turn = p->left == s->number;
    if (p->stopped)
        answer_text_lose(&s->text);
    pthread_mutex_unlock(&p->lock);
    return turn;
}

/* Long answers leave in the block's turn. Before it they stop at a row, behind which they go on
 * when the model has been let go. */
static void spill_answers(answer_text *t, void *user)
{
    slot *s = user;
    if (has_turn(s))
        (void)answer_text_leave(t, s->pipe->job->command);
    else
        t->full = !t->failed;
}

/* Of a file it is known how much there is, so that the number of questions can be estimated. */
static void tell_progress(pipe_line *p, const slot *s)
{
    uint64_t total = p->in->rows_known ? p->in->rows_total : 0;
    p->rows_left += s->block.row_count;
    p->bytes_left += s->block.count;
    if (!total && p->in->bytes_total && p->bytes_left)
        total =
            (uint64_t)((double)p->rows_left * ((double)p->in->bytes_total / (double)p->bytes_left));
    progress_tell(p->progress, "questions", p->rows_left, total);
}

/* The answers, then what is wrong behind them. False: nothing may follow. */
static bool leave_block(pipe_line *p, slot *s)
{
    bool left = answer_text_leave(&s->text, p->job->command);
    if (!left || s->status != EBPO_OK || s->block.failed)
        progress_wipe(p->progress);
    if (!left)
        p->code = s->text.failed ? command_no_memory(p->job->command) : EXIT_FAILED;
    else if (s->status != EBPO_OK)
        p->code = command_failed(p->job->command, &s->error);
    else if (!points_pass(p->in, &s->block))
        p->code = EXIT_FAILED;
    else
        tell_progress(p, s);
    return p->code == EXIT_FINE;
}

/* Who finishes the oldest block lets it leave, with all those behind it that are done. */
static void finish_block(pipe_line *p, slot *s)
{
    pthread_mutex_lock(&p->lock);
    s->done = true;
    for (;;) {
        slot *oldest = &p->slot[p->left % p->slots];
        if (p->leaving || p->stopped || !oldest->done || oldest->number != p->left)
            break;
        p->leaving = true;
        pthread_mutex_unlock(&p->lock);
        bool go_on = leave_block(p, oldest);
        pthread_mutex_lock(&p->lock);
        p->leaving = oldest->done = false;
        p->left++;
        if (!go_on)
            stop_pipe(p);
        pthread_cond_broadcast(&p->moved);
    }
    pthread_mutex_unlock(&p->lock);
}

/* --- one block --- */

static bool results_room(query_worker *w, size_t each, uint64_t rows)
{
    if (each && w->row_room < rows) {
        free(w->results);
        w->results = malloc(rows * each);
        w->row_room = w->results ? rows : 0;
    }
    return !each || w->row_room >= rows;
}

/* How many questions there will be; 0: not known. */
static double total_of(const points *in, const points_block *b)
{
    if (in->rows_known)
        return (double)in->rows_total;
    return (double)in->bytes_total * (double)b->row_count / (double)(b->count ? b->count : 1);
}

/* Answers the rows behind text->rows, with the model as it has been entered. */
static void answer_rest(pipe_line *p, query_worker *w, slot *s, const double *rows, uint64_t count)
{
    uint64_t done = s->text.rows, width = (uint64_t)points_width(p->job->kind);
    double begin = progress_now();
    s->holds = true;
    s->status = p->job->answer(p->job, w, rows + done * width, count - done, &s->error);
    s->holds = false;
    query_holding_leave(p->holding, count - done, progress_now() - begin);
}

/* Answers rows of a block, or the first ones of them: text->rows. Other threads may hold what these
 * need: then they are answered while no other thread holds the model. False: nothing may follow. */
static bool answer_piece(pipe_line *p, query_worker *w, slot *s, const double *rows, uint64_t count,
                         double total)
{
    s->text.rows = 0;
    s->status = query_holding_enter(p->holding, &w->context, total, &s->error);
    if (s->status != EBPO_OK)
        return false;
    answer_rest(p, w, s, rows, count);
    if (s->status == EBPO_E_LIMIT && p->working > 1 &&
        query_holding_enter_alone(p->holding, &w->context)) {
        answer_text_retry(&s->text);
        answer_rest(p, w, s, rows, count);
    }
    if (s->status != EBPO_OK)
        return count > 1 && s->text.rows == 0; /* those before the one that fails are answered */
    if (p->job->print)
        p->job->print(p->job, w, rows, count);
    if (s->text.full) {
        answer_text_retry(&s->text);
        (void)has_turn(s);
    }
    return !answer_text_is_over(&s->text);
}

/* The first questions come in small pieces, each as large as all before it: after each it may be
 * decided to bring in all of the model. Questions that fail together are answered one by one. */
static void answer_block(pipe_line *p, query_worker *w, slot *s)
{
    const points_block *b = &s->block;
    uint64_t width = (uint64_t)points_width(p->job->kind), most = b->row_count;
    double total = total_of(p->in, b);
    ebpo_error none = EBPO_ERROR_INIT;
    s->error = none;
    s->status = EBPO_OK;
    w->text = &s->text;
    if (!results_room(w, p->job->result_bytes, b->row_count)) {
        answer_text_lose(&s->text);
        return;
    }
    for (uint64_t at = 0; at < b->row_count; at += s->text.rows) {
        bool first = s->number == 0 && p->holding->waiting;
        uint64_t piece = !first ? most : at ? at : FIRST_PIECE;
        most = s->status == EBPO_OK ? most : 1;
        piece = piece < most ? piece : most;
        piece = piece < b->row_count - at ? piece : b->row_count - at;
        if (!answer_piece(p, w, s, b->rows + at * width, piece, total))
            break;
    }
}

/* --- threads --- */

static void *work_on_blocks(void *user);

/* Another thread joins when there is more than a little to do. */
static void call_another(pipe_line *p)
{
    crew *next = &p->crew[p->working];
    if (p->working < p->threads && command_thread(&next->thread, work_on_blocks, next) == 0)
        p->working++;
}

/* Waits until this thread may take a block and there is a slot for it. False: nothing more is
 * taken. */
static bool begin_to_take(pipe_line *p)
{
    pthread_mutex_lock(&p->lock);
    while (!p->stopped && (p->taking || p->taken - p->left >= p->slots))
        pthread_cond_wait(&p->moved, &p->lock);
    bool may = !p->stopped;
    p->taking |= may;
    pthread_mutex_unlock(&p->lock);
    return may;
}

static void end_taking(pipe_line *p, bool took)
{
    pthread_mutex_lock(&p->lock);
    p->taking = false;
    p->taken += took;
    pthread_cond_broadcast(&p->moved);
    pthread_mutex_unlock(&p->lock);
}

/* NULL: there is no more. */
static slot *take_block(pipe_line *p)
{
    if (!begin_to_take(p))
        return NULL;
    slot *s = &p->slot[p->taken % p->slots];
    bool took = points_take(p->in, &s->block);
    if (took) {
        s->number = p->taken;
        if (s->number > 0 || s->block.count > POINTS_BATCH * 8)
            call_another(p);
    }
    end_taking(p, took);
    return took ? s : NULL;
}

static void *work_on_blocks(void *user)
{
    crew *c = user;
    pipe_line *p = c->pipe;
    for (slot *s = take_block(p); s; s = take_block(p)) {
        points_parse(p->in, &s->block);
        answer_block(p, &c->worker, s);
        finish_block(p, s);
    }
    return NULL;
}

/* --- all of it --- */

/* By which who waits for input is told to stop. */
static void make_waker(pipe_line *p)
{
    int ends[2];
    if (pipe(ends) != 0)
        return; /* it is told when the next input comes */
    for (int i = 0; i < 2; i++)
        (void)fcntl(ends[i], F_SETFD, FD_CLOEXEC);
    p->in->wake = ends[0];
    p->waker = ends[1];
}

static bool make_slots(pipe_line *p)
{
    p->slot = calloc(p->slots, sizeof *p->slot);
    p->crew = calloc(p->threads, sizeof *p->crew);
    if (!p->slot || !p->crew)
        return false;
    for (uint64_t i = 0; i < p->slots; i++) {
        if (!answer_text_init(&p->slot[i].text))
            return false;
        p->slot[i].pipe = p;
        if (p->in->together > POINTS_BATCH)
            p->slot[i].text.spill_at = KEPT_EACH * p->in->together;
        p->slot[i].text.spill = spill_answers;
        p->slot[i].text.user = &p->slot[i];
    }
    for (unsigned i = 0; i < p->threads; i++)
        p->crew[i].pipe = p;
    if (p->threads > 1)
        make_waker(p);
    return true;
}

static void free_slots(pipe_line *p)
{
    for (unsigned i = 0; p->crew && i < p->threads; i++) {
        query_holding_forget(p->holding, &p->crew[i].worker.context);
        free(p->crew[i].worker.results);
    }
    for (uint64_t i = 0; p->slot && i < p->slots; i++) {
        points_block_free(&p->slot[i].block);
        answer_text_free(&p->slot[i].text);
    }
    if (p->waker >= 0) {
        close(p->waker);
        close(p->in->wake);
    }
    p->in->wake = -1;
    free(p->slot);
    free(p->crew);
}

/* What cannot be asked at all, and the line of names. */
static int ask_nothing(pipe_line *p, query_worker *w)
{
    ebpo_error error = EBPO_ERROR_INIT;
    w->text = &p->slot[0].text;
    ebpo_status status = query_holding_enter(p->holding, &w->context, 0, &error);
    if (status == EBPO_OK) {
        status = p->job->answer(p->job, w, NULL, 0, &error);
        query_holding_leave(p->holding, 0, 0);
    }
    if (status != EBPO_OK)
        return command_failed(p->job->command, &error);
    if (p->job->values->header && !p->job->continues && p->job->form != ANSWERS_JSON &&
        p->job->form != ANSWERS_RAW)
        answers_header(w->text, p->job->form, p->job->columns(p->job), p->job->values->attribute);
    return EXIT_FINE;
}

int query_pipe_run(const query_job *job, query_holding *holding, points *in, unsigned threads,
                   progress_line *progress)
{
    pipe_line p = { .job = job, .holding = holding, .in = in, .waker = -1, .progress = progress };
    p.threads = threads;
    p.slots = threads > 1
                  ? (uint64_t)threads * (in->together > POINTS_BATCH ? LARGE_EACH : BLOCKS_EACH)
                  : 1;
    pthread_mutex_init(&p.lock, NULL);
    pthread_cond_init(&p.moved, NULL);
    p.code = make_slots(&p) ? EXIT_FINE : command_no_memory(job->command);
    if (p.code == EXIT_FINE)
        p.code = ask_nothing(&p, &p.crew[0].worker);
    if (p.code == EXIT_FINE) {
        p.working = 1;
        work_on_blocks(&p.crew[0]);
        /* threads are called by those before them, which have ended here */
        for (unsigned i = 1; i < p.working; i++)
            pthread_join(p.crew[i].thread, NULL);
        if (p.code == EXIT_FINE && !answer_text_leave(&p.slot[0].text, job->command))
            p.code = EXIT_FAILED; /* a line of names without answers */
        if (p.code == EXIT_FINE && in->failed)
            p.code = EXIT_FAILED;
    }
    free_slots(&p);
    pthread_mutex_destroy(&p.lock);
    pthread_cond_destroy(&p.moved);
    return p.code;
}
