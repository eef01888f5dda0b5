/* A late step is not omitted, and the due times of later steps do not change. Times are stored in
 * memory that is written before the first step, so that no step has a page fault for it. */
#include "cli/commands/haptic_play.h"

#include <math.h>
#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <time.h>

#include <ebpo/map.h>

#include "cli/commands/haptic_brush.h"
#include "cli/tool_clock.h"

volatile sig_atomic_t haptic_play_stopped;

const char *haptic_request_real_time(void)
{
    bool locked = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
#ifdef EBPO_HAVE_SCHED_SETSCHEDULER
    struct sched_param parameters = { .sched_priority = sched_get_priority_max(SCHED_FIFO) / 2 };
    /* a loading thread that exists already keeps its scheduling */
    bool is_real_time = sched_setscheduler(0, SCHED_FIFO, &parameters) == 0;
#else
    bool is_real_time = false;
#endif
    return is_real_time ? locked ? "SCHED_FIFO, memory locked" : "SCHED_FIFO, memory not locked"
           : locked     ? "as other threads, memory locked"
                        : "as other threads, memory not locked";
}

void haptic_end_real_time(void)
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

/* Returns the quantile `part` (0 .. 1) of ascending times. */
static double time_quantile(const float *sorted, uint64_t count, double part)
{
    uint64_t rank = (uint64_t)ceil(part * (double)count);
    return sorted[rank > 0 ? rank - 1 : 0];
}

static void sort_times(float *times, uint64_t count)
{
    qsort(times, count, sizeof *times, compare_times);
}

/* Times of each step, in seconds, as in haptic_times. */
typedef struct step_times {
    float *duration; /* from the start to the end */
    float *wake;     /* from the due time to the start */
    float *cpu;      /* processor time from the start to the end */
} step_times;

/* Sets the histogram and the quantiles; sorts the times of `s`. */
static void compute_times(const step_times *s, uint64_t count, haptic_times *out)
{
    for (uint64_t i = 0; i < count; i++) {
        int bin = s->duration[i] < 1e-6F ? 0 : 1 + (int)log2(1e6 * (double)s->duration[i]);
        out->bins[bin < HAPTIC_BINS ? bin : HAPTIC_BINS - 1]++;
        out->over_ms += s->duration[i] > 1e-3F;
    }
    sort_times(s->duration, count);
    sort_times(s->wake, count);
    sort_times(s->cpu, count);
    out->p50 = time_quantile(s->duration, count, 0.5);
    out->p99 = time_quantile(s->duration, count, 0.99);
    out->p99_9 = time_quantile(s->duration, count, 0.999);
    out->p99_99 = time_quantile(s->duration, count, 0.9999);
    out->max_time = s->duration[count - 1];
    out->wake_p99_9 = time_quantile(s->wake, count, 0.999);
    out->wake_max = s->wake[count - 1];
    out->cpu_p99_9 = time_quantile(s->cpu, count, 0.999);
    out->cpu_max = s->cpu[count - 1];
}

/* Returns the number of page faults of this thread so far; 0: not known. */
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

/* Returns the processor time of this thread in nanoseconds. */
static uint64_t thread_clock(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (uint64_t)t.tv_sec * UINT64_C(1000000000) + (uint64_t)t.tv_nsec;
}

static void step_ball(ebpo_haptic *haptic, const haptic_pose *pose, haptic_result *a)
{
    ebpo_haptic_ball_result r;
    ebpo_haptic_step_ball(haptic, pose->position, &r);
    memcpy(a->proxy.position, r.proxy, sizeof r.proxy);
    memcpy(a->proxy.rotation, pose->rotation, sizeof pose->rotation);
    memcpy(a->force, r.force, sizeof r.force);
    memcpy(a->normal, r.normal, sizeof r.normal);
    memcpy(a->touch, r.face == EBPO_NO_FACE ? r.proxy : r.point, sizeof r.point);
    a->depth = r.depth;
    a->face = r.face;
    a->instance = r.instance;
    a->flags = r.flags;
}

static void step_tool(const haptic_play *p, const haptic_pose *pose, haptic_result *a)
{
    ebpo_haptic_tool_result r;
    ebpo_haptic_step_tool(p->haptic, pose->position, pose->rotation, &r);
    if (r.point != EBPO_NO_FACE)
        haptic_rotate(r.turn, p->points + 3 * r.point, a->touch);
    for (int k = 0; k < 3; k++)
        a->touch[k] += r.proxy[k];
    memcpy(a->proxy.position, r.proxy, sizeof r.proxy);
    memcpy(a->proxy.rotation, r.turn, sizeof r.turn);
    memcpy(a->force, r.force, sizeof r.force);
    memcpy(a->torque, r.torque, sizeof r.torque);
    memcpy(a->normal, r.normal, sizeof r.normal);
    a->depth = r.depth;
    a->face = r.face;
    a->instance = r.instance;
    a->flags = r.flags;
}

static void step_probe(const haptic_play *p, const haptic_pose *pose, haptic_result *a)
{
    ebpo_haptic_probe_result r;
    ebpo_haptic_step_probe(p->haptic, pose->position, &r);
    a->proxy = *pose;
    memcpy(a->normal, r.normal, sizeof r.normal);
    a->depth = r.distance;
    a->lo = r.lo;
    a->hi = r.hi;
    a->face = r.face;
    a->flags = r.flags;
    a->where = (uint8_t)r.where;
    ebpo_map_colour(EBPO_MAP_THESIS, r.distance, p->range, a->rgb);
}

/* Passes a step to the thread that paints. */
static void push_step(const haptic_play *p, uint64_t i, const haptic_pose *pose,
                      const haptic_result *a)
{
    haptic_sample sample = { .time = (double)i * 1000 / p->rate,
                             .depth = a->depth,
                             .clock = tool_clock(),
                             .instance = a->face == EBPO_NO_FACE ? UINT64_MAX : a->instance,
                             .flags = a->flags,
                             .pressure = pose->pressure,
                             .lifted = pose->lifted };
    memcpy(sample.device, pose->position, sizeof sample.device);
    memcpy(sample.proxy, a->proxy.position, sizeof sample.proxy);
    memcpy(sample.rotation, a->proxy.rotation, sizeof sample.rotation);
    memcpy(sample.device_rotation, pose->rotation, sizeof sample.device_rotation);
    memcpy(sample.normal, a->normal, sizeof sample.normal);
    memcpy(sample.force, a->force, sizeof sample.force);
    memcpy(sample.touch, a->touch, sizeof sample.touch);
    memcpy(sample.rgb, a->rgb, sizeof sample.rgb);
    haptic_live_push(p->live, &sample);
}

/* Returns false if the device has ended. */
static bool play_step(const haptic_play *p, uint64_t i, haptic_times *out)
{
    haptic_result result = { .depth = 0 };
    haptic_pose pose;
    if (!p->haptic)
        return true;
    if (!p->device->read(p->device->self, i, &pose))
        return false;
    if (i == 0) /* a replay of the recording begins there, too */
        pose = p->first;
    if (p->record)
        p->record[i] = pose;
    switch (p->kind) {
    case EBPO_HAPTIC_BALL: step_ball(p->haptic, &pose, &result); break;
    case EBPO_HAPTIC_PROBE: step_probe(p, &pose, &result); break;
    case EBPO_HAPTIC_TOOL: step_tool(p, &pose, &result); break;
    }
    if (p->live)
        push_step(p, i, &pose, &result);
    if (p->device->write)
        p->device->write(p->device->self, &result);
    out->width_mean += result.hi - result.lo; /* a sum until haptic_play_run divides it */
    out->width_max = fmax(out->width_max, result.hi - result.lo);
    return true;
}

/* Plays up to `count` steps. A late step is not omitted, and the due times of later steps do not
 * change. Returns the number of played steps, which is less than `count` if the device ends. */
static uint64_t play_all(const haptic_play *p, uint64_t count, const step_times *s,
                         haptic_times *out)
{
    const double period = 1e9 / p->rate;
    uint64_t begin = tool_clock() + (uint64_t)(2 * period), faults_before = page_faults(), i = 0;
    for (; i < count && !haptic_play_stopped; i++) {
        uint64_t due = begin + (uint64_t)((double)i * period);
        tool_wait_until(due);
        uint64_t cpu_begin = thread_clock(), begin_time = tool_clock();
        if (!play_step(p, i, out))
            break;
        uint64_t end_time = tool_clock();
        s->cpu[i] = 1e-9F * (float)(thread_clock() - cpu_begin);
        s->duration[i] = 1e-9F * (float)(end_time - begin_time);
        s->wake[i] = 1e-9F * (float)(begin_time - due);
        out->late += (double)(end_time - due) > period;
    }
    out->page_faults = page_faults() - faults_before;
    return i;
}

uint64_t haptic_play_steps(const haptic_play *p)
{
    uint64_t count = p->haptic ? p->device->step_count : 0;
    return count ? count : (uint64_t)ceil(p->rate * p->seconds);
}

bool haptic_play_run(const haptic_play *p, haptic_times *out)
{
    uint64_t count = haptic_play_steps(p);
    float *all = malloc(3 * count * sizeof *all);
    *out = (haptic_times){ .step_count = 0 };
    if (!all)
        return false;
    memset(all, 0, 3 * count * sizeof *all); /* now, so that no step has a page fault for it */
    const step_times s = { all, all + count, all + 2 * count };
    out->step_count = play_all(p, count, &s, out);
    out->width_mean /= fmax(1, (double)out->step_count);
    if (out->step_count > 0)
        compute_times(&s, out->step_count, out);
    free(all);
    return true;
}
