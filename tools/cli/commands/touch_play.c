#include "cli/commands/touch_play.h"

#include <math.h>
#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <time.h>

#include <ebpo/map.h>

#include "cli/tool_clock.h"

const char *touch_play_first(void)
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

void touch_play_behind(void)
{
#ifdef EBPO_HAVE_SCHED_SETSCHEDULER
    (void)sched_setscheduler(0, SCHED_OTHER, &(struct sched_param){ 0 });
#endif
    (void)munlockall();
}

static int compare(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* The least time that so many of all do not exceed. */
static double quantile(const float *sorted, uint64_t count, double part)
{
    uint64_t rank = (uint64_t)ceil(part * (double)count);
    return sorted[rank > 0 ? rank - 1 : 0];
}

static void sort(float *times, uint64_t count) { qsort(times, count, sizeof *times, compare); }

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
    sort(s->took, count);
    sort(s->wake, count);
    sort(s->cpu, count);
    out->p50 = quantile(s->took, count, 0.5);
    out->p99 = quantile(s->took, count, 0.99);
    out->p99_9 = quantile(s->took, count, 0.999);
    out->p99_99 = quantile(s->took, count, 0.9999);
    out->most = s->took[count - 1];
    out->wake_p99_9 = quantile(s->wake, count, 0.999);
    out->wake_most = s->wake[count - 1];
    out->cpu_p99_9 = quantile(s->cpu, count, 0.999);
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

static void move(ebpo_touch *touch, const touch_pose *hand, touch_answer *a)
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

static void turn(ebpo_touch *touch, const touch_pose *hand, touch_answer *a)
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

static void sense(const touch_play *p, const touch_pose *hand, touch_answer *a)
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
    case EBPO_TOUCH_BALL: move(p->touch, &hand, &answer); break;
    case EBPO_TOUCH_PROBE: sense(p, &hand, &answer); break;
    case EBPO_TOUCH_TOOL: turn(p->touch, &hand, &answer); break;
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

uint64_t touch_play_ticks(const touch_play *p)
{
    uint64_t most = p->touch ? p->device->ticks(p->device->self) : 0;
    return most ? most : (uint64_t)ceil(p->rate * p->seconds);
}

bool touch_play_run(const touch_play *p, touch_times *out)
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
