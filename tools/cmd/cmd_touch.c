/* ebpo touch: a hand played at a steady rate, and whether any of its ticks was late. */
#include <float.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/command.h"
#include "cli/json.h"
#include "cli/model_memory.h"
#include "cli/points.h"
#include "cli/remote_args.h"
#include "cli/words.h"
#include "cmd/commands.h"
#include "cmd/touch_play.h"

typedef struct values {
    const char *path, *memory;
    double rate, seconds, radius, friction;
    int64_t faces;
    bool json;
    remote_values remote;
} values;

#include "options/touch.inc"

typedef struct job {
    const values *v;
    const char *name; /* FILE */
    ebpo_file *file;
    ebpo_model *model;
    ebpo_touch *touch;
    double *path;
    uint64_t count;
    const char *scheduling;
    touch_times empty, times;
    ebpo_touch_stats stats;
    ebpo_model_stats memory;
} job;

/* --- what is told --- */

static void print_times(const char *name, const touch_times *t)
{
    printf("  %-8s %10llu %6llu %9.2f %9.2f %9.2f %9.2f %9.2f %11.2f %9.2f\n", name,
           (unsigned long long)t->ticks, (unsigned long long)t->late, 1e6 * t->p50, 1e6 * t->p99,
           1e6 * t->p99_9, 1e6 * t->p99_99, 1e6 * t->most, 1e6 * t->wake_p99_9, 1e6 * t->wake_most);
}

static void print_bins(const touch_times *t)
{
    puts("  microseconds from begin to end: ticks");
    for (int i = 0; i < TOUCH_BINS; i++)
        if (t->bins[i])
            printf("  %6d %s %llu\n", i ? 1 << (i - 1) : 0,
                   i < TOUCH_BINS - 1 ? "up  " : "and more", (unsigned long long)t->bins[i]);
}

static void print_report(const job *j)
{
    const ebpo_touch_stats *s = &j->stats;
    printf("%s: a hand at %g Hz, %s\n", remote_shown(j->name), j->v->rate, j->scheduling);
    printf("  %-8s %10s %6s %9s %9s %9s %9s %9s %11s %9s\n", "us", "ticks", "late", "p50", "p99",
           "p99.9", "p99.99", "most", "wake p99.9", "most");
    print_times("touch", &j->times);
    print_times("nothing", &j->empty);
    printf("  contact %llu, waits %llu, short %llu, partly %llu; faces at most %llu; page faults "
           "%llu\n",
           (unsigned long long)s->contacts, (unsigned long long)s->waits,
           (unsigned long long)s->shorts, (unsigned long long)s->partly,
           (unsigned long long)s->work_most, (unsigned long long)j->times.page_faults);
    printf("  boxes loaded %llu, taken %llu, too full %llu; %.3f s, the longest %.3f s; %llu "
           "bytes\n",
           (unsigned long long)s->loads, (unsigned long long)s->taken,
           (unsigned long long)s->too_many, s->load_seconds, s->load_seconds_most,
           (unsigned long long)s->memory);
    printf("  model: %llu bytes at most, %llu subtrees loaded\n",
           (unsigned long long)j->memory.memory_peak, (unsigned long long)j->memory.loads);
    print_bins(&j->times);
}

static void json_times(json *out, const char *key, const touch_times *t)
{
    json_object(out, key);
    json_uint(out, "ticks", t->ticks);
    json_uint(out, "late", t->late);
    json_real(out, "p50", t->p50);
    json_real(out, "p99", t->p99);
    json_real(out, "p99_9", t->p99_9);
    json_real(out, "p99_99", t->p99_99);
    json_real(out, "most", t->most);
    json_real(out, "wake_p99_9", t->wake_p99_9);
    json_real(out, "wake_most", t->wake_most);
    json_uint(out, "page_faults", t->page_faults);
    json_array(out, "histogram");
    for (int i = 0; i < TOUCH_BINS; i++)
        json_uint(out, NULL, t->bins[i]);
    json_end(out);
    json_end(out);
}

static void json_report(const job *j)
{
    const ebpo_touch_stats *s = &j->stats;
    json out;
    json_begin(&out, stdout);
    json_object(&out, NULL);
    json_text(&out, "file", remote_shown(j->name));
    json_real(&out, "rate", j->v->rate);
    json_text(&out, "scheduling", j->scheduling);
    json_times(&out, "touch", &j->times);
    json_times(&out, "nothing", &j->empty);
    json_uint(&out, "contacts", s->contacts);
    json_uint(&out, "waits", s->waits);
    json_uint(&out, "shorts", s->shorts);
    json_uint(&out, "partly", s->partly);
    json_uint(&out, "faces_most", s->work_most);
    json_uint(&out, "loads", s->loads);
    json_uint(&out, "taken", s->taken);
    json_uint(&out, "too_full", s->too_many);
    json_real(&out, "load_seconds", s->load_seconds);
    json_real(&out, "load_seconds_most", s->load_seconds_most);
    json_uint(&out, "box_bytes", s->memory);
    json_uint(&out, "model_bytes_most", j->memory.memory_peak);
    json_uint(&out, "subtrees_loaded", j->memory.loads);
    json_finish(&out);
}

/* --- running --- */

/* All of the path. False: it has none, or what is wrong was said. */
static bool read_path(job *j)
{
    points p;
    double rows[3 * POINTS_BATCH];
    uint64_t got;
    bool fine = points_open(&p, "touch", j->v->path, POINTS, false, INFINITY);
    p.headless = true;
    while (fine && (got = points_next(&p, rows)) > 0) {
        double *more = realloc(j->path, (j->count + got) * 3 * sizeof *more);
        fine = more != NULL;
        if (!fine)
            break;
        memcpy(more + 3 * j->count, rows, got * 3 * sizeof *more);
        j->path = more;
        j->count += got;
    }
    fine = fine && !p.failed;
    points_close(&p);
    if (fine && j->count == 0)
        fprintf(stderr, "ebpo touch: the path '%s' has no place\n", j->v->path);
    return fine && j->count > 0;
}

static ebpo_status open_hand(job *j, uint64_t memory, ebpo_error *error)
{
    const values *v = j->v;
    ebpo_model_options opening = EBPO_MODEL_OPTIONS_INIT;
    ebpo_touch_options wanted = EBPO_TOUCH_OPTIONS_INIT;
    double start[3];
    opening.memory = memory;
    wanted.radius = v->radius;
    wanted.friction = v->friction;
    wanted.tick = 1 / v->rate;
    wanted.faces = (uint64_t)v->faces;
    ebpo_status status = remote_open(&j->file, j->name, &v->remote, error);
    if (status == EBPO_OK && !v->memory)
        model_memory_usual("touch", j->file, j->name, &opening);
    if (status == EBPO_OK)
        status = ebpo_model_new(j->file, &opening, &j->model, error);
    if (status != EBPO_OK)
        return status;
    if (j->path)
        memcpy(start, j->path, sizeof start);
    else
        touch_hand_at(ebpo_file_info(j->file), 0, start);
    return ebpo_touch_new(j->model, &wanted, start, &j->touch, error);
}

/* The empty loop first, a tenth as long: what the machine itself adds. */
static ebpo_status play(job *j, ebpo_error *error)
{
    const values *v = j->v;
    double seconds = j->path ? (double)j->count / v->rate : v->seconds;
    const touch_play empty = { .rate = v->rate, .seconds = seconds / 10 };
    const touch_play all = {
        v->rate, seconds, j->touch, j->path, j->count, ebpo_file_info(j->file)
    };
    j->scheduling = touch_play_first();
    if (!touch_play_run(&empty, &j->empty) || !touch_play_run(&all, &j->times)) {
        *error = (ebpo_error){ .status = EBPO_E_MEMORY };
        snprintf(error->message, sizeof error->message, "not enough memory for the times of ticks");
        return EBPO_E_MEMORY;
    }
    ebpo_touch_get_stats(j->touch, &j->stats);
    ebpo_model_get_stats(j->model, &j->memory);
    return ebpo_touch_check(j->touch, error);
}

static int run_job(job *j, uint64_t memory)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_status status = open_hand(j, memory, &error);
    if (status == EBPO_OK)
        status = play(j, &error);
    if (status != EBPO_OK)
        return command_failed("touch", &error);
    if (j->v->json)
        json_report(j);
    else
        print_report(j);
    return EXIT_FINE;
}

static int run(void *given, const char **operand)
{
    const values *v = given;
    job j = {
        .v = v, .name = operand[0], .stats = EBPO_TOUCH_STATS_INIT, .memory = EBPO_MODEL_STATS_INIT
    };
    uint64_t memory = 0;
    if (v->memory && !words_read_size(v->memory, &memory))
        return command_usage("touch", "--memory '%s': expected " WORDS_SIZE_EXPECTED, v->memory);
    if (v->path && v->seconds != 10)
        return command_usage("touch", "--seconds is for the hand without --path, which ends with "
                                      "its last place");
    if (!command_wants_hdf5("touch", operand[0]))
        return EXIT_FAILED;
    int code = v->path && !read_path(&j) ? EXIT_FAILED : run_job(&j, memory);
    ebpo_touch_free(j.touch);
    ebpo_model_free(j.model);
    ebpo_close(j.file);
    free(j.path);
    return code;
}

static const values usual = {
    .rate = 1000, .seconds = 10, .faces = 1 << 14, .remote = REMOTE_VALUES_INIT
};

const command command_touch = { &spec, sizeof usual, &usual, run };
