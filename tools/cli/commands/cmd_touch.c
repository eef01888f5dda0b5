/* ebpo touch: a hand is played at a steady rate, and the times of its ticks are measured. */
#include <float.h>
#include <math.h>
#include <sched.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <time.h>

#include <ebpo/map.h>

#include "cli/command.h"
#include "cli/commands/commands.h"
#include "cli/commands/touch_device.h"
#include "cli/json.h"
#include "cli/model_memory.h"
#include "cli/numbers.h"
#include "cli/points.h"
#include "cli/remote_args.h"
#include "cli/tool_clock.h"
#include "cli/words.h"

/* --- ticks at a steady rate --- */

/* Of a microsecond: bin 0 is less than 1, bin n from 2^(n - 1) to 2^n, the last all beyond. */
enum { TOUCH_BINS = 16 };

typedef struct touch_times {
    uint64_t ticks, late;                 /* not done a period after they were due */
    double p50, p99, p99_9, p99_99, most; /* seconds from begin to end of a tick */
    double wake_p99_9, wake_most;         /* seconds from when a tick was due to its begin */
    double cpu_p99_9, cpu_most;           /* processor time from begin to end of a tick */
    uint64_t over_ms;                     /* took more than a millisecond from begin to end */
    uint64_t bins[TOUCH_BINS];
    uint64_t page_faults;              /* of the ticks' thread */
    double between_mean, between_most; /* of a probe: from lo to hi */
} touch_times;

typedef struct touch_play {
    double rate, seconds;
    ebpo_touch *touch;          /* NULL: an empty loop */
    const touch_device *device; /* of the hand */
    ebpo_touch_kind kind;
    double range;       /* of colours, for probes */
    touch_pose *record; /* [ticks] where the hand was, or NULL */
} touch_play;

/* Asks the system to run this thread before others, and to keep the memory of the process. What it
 * was granted, in words. Threads that are made from here on run before others, too. */
static const char *touch_play_first(void)
{
    bool kept = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
#ifdef EBPO_HAVE_SCHED_SETSCHEDULER
    struct sched_param first = { .sched_priority = sched_get_priority_max(SCHED_FIFO) / 2 };
    /* of this thread; the loading one was made before and stays behind */
    bool ahead = sched_setscheduler(0, SCHED_FIFO, &first) == 0;
#else
    bool ahead = false;
#endif
    return ahead  ? kept ? "SCHED_FIFO, memory locked" : "SCHED_FIFO, memory not locked"
           : kept ? "as other threads, memory locked"
                  : "as other threads, memory not locked";
}

/* As others again. */
static void touch_play_behind(void)
{
#ifdef EBPO_HAVE_SCHED_SETSCHEDULER
    (void)sched_setscheduler(0, SCHED_OTHER, &(struct sched_param){ 0 });
#endif
    (void)munlockall();
}

static int compare_times(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* The least time that so many of all do not exceed. */
static double time_quantile(const float *sorted, uint64_t count, double part)
{
    uint64_t rank = (uint64_t)ceil(part * (double)count);
    return sorted[rank > 0 ? rank - 1 : 0];
}

static void sort_times(float *times, uint64_t count)
{
    qsort(times, count, sizeof *times, compare_times);
}

/* Of each tick. */
typedef struct spans {
    float *took, *wake, *cpu;
} spans;

static void sum_up(const spans *s, uint64_t count, touch_times *out)
{
    for (uint64_t i = 0; i < count; i++) {
        int bin = s->took[i] < 1e-6F ? 0 : 1 + (int)log2(1e6 * (double)s->took[i]);
        out->bins[bin < TOUCH_BINS ? bin : TOUCH_BINS - 1]++;
        out->over_ms += s->took[i] > 1e-3F;
    }
    sort_times(s->took, count);
    sort_times(s->wake, count);
    sort_times(s->cpu, count);
    out->p50 = time_quantile(s->took, count, 0.5);
    out->p99 = time_quantile(s->took, count, 0.99);
    out->p99_9 = time_quantile(s->took, count, 0.999);
    out->p99_99 = time_quantile(s->took, count, 0.9999);
    out->most = s->took[count - 1];
    out->wake_p99_9 = time_quantile(s->wake, count, 0.999);
    out->wake_most = s->wake[count - 1];
    out->cpu_p99_9 = time_quantile(s->cpu, count, 0.999);
    out->cpu_most = s->cpu[count - 1];
}

static uint64_t page_faults(void)
{
    struct rusage r;
#ifdef EBPO_HAVE_RUSAGE_THREAD
    bool known = getrusage(RUSAGE_THREAD, &r) == 0;
#else
    bool known = getrusage(RUSAGE_SELF, &r) == 0;
#endif
    return known ? (uint64_t)(r.ru_minflt + r.ru_majflt) : 0;
}

static uint64_t thread_clock(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (uint64_t)t.tv_sec * UINT64_C(1000000000) + (uint64_t)t.tv_nsec;
}

static void move_ball(ebpo_touch *touch, const touch_pose *hand, touch_answer *a)
{
    ebpo_touch_result r;
    ebpo_touch_move(touch, hand->place, &r);
    memcpy(a->proxy.place, r.proxy, sizeof r.proxy);
    memcpy(a->proxy.turn, hand->turn, sizeof hand->turn);
    memcpy(a->force, r.force, sizeof r.force);
    memcpy(a->normal, r.normal, sizeof r.normal);
    a->depth = r.depth;
    a->face = r.face;
    a->flags = r.flags;
}

static void turn_tool(ebpo_touch *touch, const touch_pose *hand, touch_answer *a)
{
    ebpo_touch_turned r;
    ebpo_touch_turn(touch, hand->place, hand->turn, &r);
    memcpy(a->proxy.place, r.proxy, sizeof r.proxy);
    memcpy(a->proxy.turn, r.turn, sizeof r.turn);
    memcpy(a->force, r.force, sizeof r.force);
    memcpy(a->torque, r.torque, sizeof r.torque);
    memcpy(a->normal, r.normal, sizeof r.normal);
    a->depth = r.depth;
    a->face = r.face;
    a->flags = r.flags;
}

static void sense_distance(const touch_play *p, const touch_pose *hand, touch_answer *a)
{
    ebpo_touch_sensed r;
    ebpo_touch_sense(p->touch, hand->place, &r);
    a->proxy = *hand;
    memcpy(a->normal, r.normal, sizeof r.normal);
    a->depth = r.distance;
    a->lo = r.lo;
    a->hi = r.hi;
    a->face = r.face;
    a->flags = r.flags;
    a->where = (uint8_t)r.where;
    ebpo_map_colour(EBPO_MAP_THESIS, r.distance, p->range, a->rgb);
}

/* False: the device has ended. */
static bool play_tick(const touch_play *p, uint64_t i, touch_times *out)
{
    touch_answer answer = { .depth = 0 };
    touch_pose hand;
    if (!p->touch)
        return true;
    if (!p->device->read(p->device->self, i, &hand))
        return false;
    if (p->record)
        p->record[i] = hand;
    switch (p->kind) {
    case EBPO_TOUCH_BALL: move_ball(p->touch, &hand, &answer); break;
    case EBPO_TOUCH_PROBE: sense_distance(p, &hand, &answer); break;
    case EBPO_TOUCH_TOOL: turn_tool(p->touch, &hand, &answer); break;
    }
    p->device->write(p->device->self, &answer);
    out->between_mean += answer.hi - answer.lo; /* a sum, until the end */
    out->between_most = fmax(out->between_most, answer.hi - answer.lo);
    return true;
}

/* A tick that comes too late is played all the same, and those after it at their own times. Returns
 * how many there were. */
static uint64_t play_all(const touch_play *p, uint64_t count, const spans *s, touch_times *out)
{
    const double period = 1e9 / p->rate;
    uint64_t begin = tool_clock() + (uint64_t)(2 * period), faults = page_faults(), i = 0;
    for (; i < count; i++) {
        uint64_t due = begin + (uint64_t)((double)i * period);
        tool_wait_until(due);
        uint64_t worked = thread_clock(), began = tool_clock();
        if (!play_tick(p, i, out))
            break;
        uint64_t ended = tool_clock();
        s->cpu[i] = 1e-9F * (float)(thread_clock() - worked);
        s->took[i] = 1e-9F * (float)(ended - began);
        s->wake[i] = 1e-9F * (float)(began - due);
        out->late += (double)(ended - due) > period;
    }
    out->page_faults = page_faults() - faults;
    return i;
}

/* Ticks that there will be at most. */
static uint64_t touch_play_ticks(const touch_play *p)
{
    uint64_t most = p->touch ? p->device->ticks(p->device->self) : 0;
    return most ? most : (uint64_t)ceil(p->rate * p->seconds);
}

/* False: no memory for the times. */
static bool touch_play_run(const touch_play *p, touch_times *out)
{
    uint64_t count = touch_play_ticks(p);
    /* zeros are written, so that no tick is the first to use a page */
    float *all = malloc(3 * count * sizeof *all);
    *out = (touch_times){ .ticks = 0 };
    if (!all)
        return false;
    memset(all, 0, 3 * count * sizeof *all);
    const spans s = { all, all + count, all + 2 * count };
    out->ticks = play_all(p, count, &s, out);
    out->between_mean /= fmax(1, (double)out->ticks);
    if (out->ticks > 0)
        sum_up(&s, out->ticks, out);
    free(all);
    return true;
}

/* --- the command --- */

typedef struct values {
    const char *path, *device, *record, *tool, *memory;
    double rate, seconds, radius, friction, stiffness, damping, skin, look;
    int64_t faces;
    bool sense, json;
    remote_values remote;
} values;

#include "cli/options/touch.inc"

typedef struct job {
    const values *v;
    const char *name; /* FILE */
    ebpo_file *file;
    ebpo_model *model;
    ebpo_touch *touch;
    double *points; /* of the tool */
    uint64_t point_count;
    ebpo_touch_kind kind;
    touch_device device;
    touch_pose *record;
    const char *scheduling;
    touch_times empty, times;
    ebpo_touch_stats stats;
    ebpo_error stopped; /* EBPO_OK, or what has ended loading */
    ebpo_model_stats memory;
} job;

/* --- what is told --- */

static const char *const kinds[] = { "a hand", "a probe", "a tool" };

static void print_times(const char *name, const touch_times *t)
{
    printf("  %-8s %10llu %6llu %7llu %9.2f %9.2f %9.2f %9.2f %9.2f %11.2f %9.2f %10.2f %9.2f\n",
           name, (unsigned long long)t->ticks, (unsigned long long)t->late,
           (unsigned long long)t->over_ms, 1e6 * t->p50, 1e6 * t->p99, 1e6 * t->p99_9,
           1e6 * t->p99_99, 1e6 * t->most, 1e6 * t->wake_p99_9, 1e6 * t->wake_most,
           1e6 * t->cpu_p99_9, 1e6 * t->cpu_most);
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
    printf("%s: %s at %g Hz, %s\n", remote_shown(j->name), kinds[j->kind], j->v->rate,
           j->scheduling);
    printf("  %-8s %10s %6s %7s %9s %9s %9s %9s %9s %11s %9s %10s %9s\n", "us", "ticks", "late",
           ">1 ms", "p50", "p99", "p99.9", "p99.99", "most", "wake p99.9", "most", "cpu p99.9",
           "most");
    print_times("touch", &j->times);
    print_times("nothing", &j->empty);
    printf("  contact %llu, waits %llu, short %llu, partly %llu; faces at most %llu; page faults "
           "%llu\n",
           (unsigned long long)s->contacts, (unsigned long long)s->waits,
           (unsigned long long)s->shorts, (unsigned long long)s->partly,
           (unsigned long long)s->work_most, (unsigned long long)j->times.page_faults);
    if (j->kind == EBPO_TOUCH_PROBE)
        printf("  distances known to %g on average, %g at most\n", j->times.between_mean,
               j->times.between_most);
    printf("  boxes loaded %llu, taken %llu, too full %llu; %.3f s, the longest %.3f s; %llu "
           "bytes\n",
           (unsigned long long)s->loads, (unsigned long long)s->taken,
           (unsigned long long)s->too_many, s->load_seconds, s->load_seconds_most,
           (unsigned long long)s->memory);
    if (j->stopped.status != EBPO_OK)
        printf("  loading has stopped: so it was in %llu ticks\n", (unsigned long long)s->stopped);
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
    json_real(out, "cpu_p99_9", t->cpu_p99_9);
    json_real(out, "cpu_most", t->cpu_most);
    json_uint(out, "over_ms", t->over_ms);
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
    json_text(&out, "hand", kinds[j->kind] + 2);
    json_real(&out, "rate", j->v->rate);
    json_text(&out, "scheduling", j->scheduling);
    json_times(&out, "touch", &j->times);
    json_times(&out, "nothing", &j->empty);
    if (j->kind == EBPO_TOUCH_PROBE) {
        json_real(&out, "between_mean", j->times.between_mean);
        json_real(&out, "between_most", j->times.between_most);
    }
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
    json_uint(&out, "stopped", s->stopped);
    if (j->stopped.status != EBPO_OK)
        json_text(&out, "failure", j->stopped.message);
    json_finish(&out);
}

/* --- running --- */

/* Tools are vertices of a mesh file, or points as `ebpo inside` reads them. */
static bool read_mesh_tool(job *j)
{
    ebpo_mesh_read_options read = EBPO_MESH_READ_OPTIONS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh mesh;
    if (ebpo_mesh_read(j->v->tool, &read, &mesh, &error) != EBPO_OK) {
        (void)command_failed("touch", &error);
        return false;
    }
    j->point_count = mesh.vertex_count;
    j->points = malloc(3 * mesh.vertex_count * sizeof *j->points);
    for (uint64_t i = 0; j->points && i < 3 * mesh.vertex_count; i++)
        j->points[i] = mesh.xyz32 ? (double)mesh.xyz32[i] : mesh.xyz64[i];
    ebpo_mesh_free(&mesh);
    return j->points != NULL;
}

static bool read_point_tool(job *j)
{
    points p;
    double rows[3 * POINTS_BATCH];
    uint64_t got;
    bool fine = points_open(&p, "touch", j->v->tool, POINTS, false, INFINITY);
    while (fine && (got = points_next(&p, rows)) > 0) {
        double *more = realloc(j->points, (j->point_count + got) * 3 * sizeof *more);
        fine = more != NULL;
        if (!fine)
            break;
        memcpy(more + 3 * j->point_count, rows, got * 3 * sizeof *more);
        j->points = more;
        j->point_count += got;
    }
    fine = fine && !p.failed;
    points_close(&p);
    return fine;
}

static bool read_tool(job *j)
{
    const char *name = j->v->tool;
    if (!name)
        return true;
    bool mesh = words_end_with(name, ".obj") || words_end_with(name, ".stl") ||
                words_end_with(name, ".off");
    if (!(mesh ? read_mesh_tool(j) : read_point_tool(j)))
        return false;
    if (j->point_count > 0 && j->point_count <= 10000)
        return true;
    fprintf(stderr, "ebpo touch: the tool %s has %llu points; 1 to 10,000 are expected\n", name,
            (unsigned long long)j->point_count);
    return false;
}

static double tool_radius(const job *j)
{
    double most = j->v->radius;
    for (uint64_t i = 0; i < j->point_count; i++)
        most =
            fmax(most, hypot(hypot(j->points[3 * i], j->points[3 * i + 1]), j->points[3 * i + 2]));
    return most;
}

static ebpo_status open_model(job *j, uint64_t memory, ebpo_error *error)
{
    ebpo_model_options opening = EBPO_MODEL_OPTIONS_INIT;
    opening.memory = memory;
    ebpo_status status = remote_open(&j->file, j->name, &j->v->remote, error);
    if (status == EBPO_OK && !j->v->memory)
        model_memory_usual("touch", j->file, j->name, &opening);
    if (status == EBPO_OK)
        status = ebpo_model_new(j->file, &opening, &j->model, error);
    if (status == EBPO_OK && !j->v->path && !j->v->device)
        status = touch_own_open(&j->device, j->model, ebpo_file_info(j->file), j->v->rate,
                                tool_radius(j), error);
    return status;
}

static ebpo_status open_hand(job *j, const double start[3], ebpo_error *error)
{
    const values *v = j->v;
    ebpo_touch_options wanted = EBPO_TOUCH_OPTIONS_INIT;
    wanted.radius = v->radius;
    wanted.friction = v->friction;
    wanted.stiffness = v->stiffness;
    wanted.damping = v->damping;
    wanted.skin = v->skin;
    wanted.look = v->look;
    wanted.tick = 1 / v->rate;
    wanted.faces = (uint64_t)v->faces;
    wanted.kind = j->kind;
    wanted.points = (const double(*)[3])j->points;
    wanted.point_count = j->point_count;
    return ebpo_touch_new(j->model, &wanted, start, &j->touch, error);
}

static double model_diagonal(const ebpo_info *info)
{
    return hypot(hypot(info->box_size[0], info->box_size[1]), info->box_size[2]);
}

static ebpo_status no_memory(ebpo_error *error, const char *what)
{
    *error = (ebpo_error){ .status = EBPO_E_MEMORY };
    snprintf(error->message, sizeof error->message, "not enough memory for %s", what);
    return EBPO_E_MEMORY;
}

/* The empty loop, a tenth as long: what the machine itself adds. Before a device begins. */
static ebpo_status play_nothing(job *j, ebpo_error *error)
{
    const values *v = j->v;
    uint64_t ticks = v->path ? j->device.ticks(j->device.self) : 0;
    const touch_play empty = { .rate = v->rate,
                               .seconds = ticks ? (double)ticks / v->rate / 10 : v->seconds / 10 };
    touch_play_first();
    bool fine = touch_play_run(&empty, &j->empty);
    touch_play_behind(); /* and so does what loads, which is made now */
    return fine ? EBPO_OK : no_memory(error, "the times of ticks");
}

static ebpo_status play_hand(job *j, ebpo_error *error)
{
    const values *v = j->v;
    touch_play all = { v->rate,    v->seconds, j->touch,
                       &j->device, j->kind,    model_diagonal(ebpo_file_info(j->file)) / 20,
                       NULL };
    if (v->record) {
        j->record = calloc(touch_play_ticks(&all), sizeof *j->record);
        if (!j->record)
            return no_memory(error, "the record");
        all.record = j->record;
    }
    j->scheduling = touch_play_first();
    if (!touch_play_run(&all, &j->times))
        return no_memory(error, "the times of ticks");
    ebpo_touch_get_stats(j->touch, &j->stats);
    ebpo_model_get_stats(j->model, &j->memory);
    j->stopped.status = ebpo_touch_check(j->touch, &j->stopped);
    return EBPO_OK;
}

/* As --path reads it: each number to the last bit. */
static ebpo_status write_record(const job *j, ebpo_error *error)
{
    enum { LINE = 7 * (NUMBER_ROOM + 1) };
    char *text = malloc(j->times.ticks * LINE + 1), *at = text;
    if (!text)
        return no_memory(error, "what is recorded");
    for (uint64_t i = 0; i < j->times.ticks; i++) {
        const touch_pose *p = &j->record[i];
        for (int k = 0; k < 7; k++) {
            at = number_write(at, k < 3 ? p->place[k] : p->turn[k - 3]);
            *at++ = k < 6 ? ' ' : '\n';
        }
    }
    ebpo_status status = ebpo_write_file(j->v->record, text, (size_t)(at - text), error);
    free(text);
    return status;
}

static int run_job(job *j, uint64_t memory)
{
    ebpo_error error = EBPO_ERROR_INIT;
    touch_pose start;
    ebpo_status status = j->v->record ? ebpo_check_output(j->v->record, &error) : EBPO_OK;
    if (status == EBPO_OK)
        status = open_model(j, memory, &error);
    if (status == EBPO_OK)
        status = play_nothing(j, &error);
    if (status == EBPO_OK && !j->device.begin(j->device.self, j->v->seconds, &start))
        return EXIT_FAILED;
    if (status == EBPO_OK)
        status = open_hand(j, start.place, &error);
    if (status == EBPO_OK)
        status = play_hand(j, &error);
    if (status == EBPO_OK && j->v->record)
        status = write_record(j, &error);
    if (status != EBPO_OK)
        return command_failed("touch", &error);
    if (j->v->json)
        json_report(j);
    else
        print_report(j);
    return j->stopped.status == EBPO_OK ? EXIT_FINE : command_failed("touch", &j->stopped);
}

/* 0: nothing is wrong with them. */
static int check_values(const values *v, uint64_t *memory)
{
    if (v->memory && !words_read_size(v->memory, memory))
        return command_usage("touch", "--memory '%s': expected " WORDS_SIZE_EXPECTED, v->memory);
    if (v->path && v->seconds != 10)
        return command_usage("touch", "--seconds is for the hand without --path, which ends with "
                                      "its last place");
    if (v->path && v->device)
        return command_usage("touch", "--path and --device: either moves the hand");
    if (v->device && !touch_udp_named(v->device))
        return command_usage("touch", "--device '%s': expected udp:PORT or udp:ADDRESS:PORT",
                             v->device);
    if (v->tool && v->sense)
        return command_usage("touch", "--tool and --sense: a probe is a point");
    if ((v->tool || v->sense) && v->radius > 0)
        return command_usage("touch", "--radius is for a ball, without --tool and --sense");
    return 0;
}

/* The record would replace what is read. */
static bool overwrites_input(const values *v, const char *model)
{
    const char *in[] = { model, v->path, v->tool };
    for (int i = 0; v->record && i < 3; i++)
        if (in[i] && command_overwrites("touch", in[i], v->record))
            return true;
    return false;
}

static int run_touch(void *given, const char **operand)
{
    const values *v = given;
    job j = { .v = v,
              .name = operand[0],
              .kind = v->tool    ? EBPO_TOUCH_TOOL
                      : v->sense ? EBPO_TOUCH_PROBE
                                 : EBPO_TOUCH_BALL,
              .stats = EBPO_TOUCH_STATS_INIT,
              .memory = EBPO_MODEL_STATS_INIT };
    uint64_t memory = 0;
    int code = check_values(v, &memory);
    if (code != 0 || overwrites_input(v, operand[0]))
        return EXIT_USAGE;
    bool fine = command_wants_hdf5("touch", operand[0]) && read_tool(&j) &&
                (!v->path || touch_path_open(&j.device, v->path)) &&
                (!v->device || touch_udp_open(&j.device, v->device));
    code = fine ? run_job(&j, memory) : EXIT_FAILED;
    ebpo_touch_free(j.touch);
    ebpo_model_free(j.model);
    ebpo_close(j.file);
    if (j.device.end)
        j.device.end(j.device.self);
    free(j.points);
    free(j.record);
    return code;
}

static const values usual = { .rate = 1000,
                              .seconds = 10,
                              .stiffness = 400,
                              .damping = 0.4,
                              .faces = 1 << 14,
                              .remote = REMOTE_VALUES_INIT };

const command command_touch = { &spec, sizeof usual, &usual, run_touch };
