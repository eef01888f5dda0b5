#include "cmd/touch_play.h"

#include <math.h>
#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <time.h>

#include "cli/tool_clock.h"

void touch_hand_at(const ebpo_info *info, double seconds, double hand[3])
{
    const double turn = 6.283185307179586 * seconds / 8;
    double wide = 0.34 + 0.26 * cos(turn * 3.7), high = 0.45 * sin(turn * 0.31);
    const double unit[3] = { wide * cos(turn), wide * sin(turn), high };
    for (int i = 0; i < 3; i++)
        hand[i] = info->box_origin[i] + (0.5 + unit[i]) * info->box_size[i];
}

const char *touch_play_first(void)
{
    bool kept = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
    struct sched_param first = { .sched_priority = sched_get_priority_max(SCHED_FIFO) / 2 };
    /* of this thread; the loading one was made before and stays behind */
    bool ahead = sched_setscheduler(0, SCHED_FIFO, &first) == 0;
    return ahead  ? kept ? "SCHED_FIFO, memory locked" : "SCHED_FIFO, memory not locked"
           : kept ? "as other threads, memory locked"
                  : "as other threads, memory not locked";
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

static void sum_up(float *took, float *wake, uint64_t count, touch_times *out)
{
    for (uint64_t i = 0; i < count; i++) {
        int bin = took[i] < 1e-6F ? 0 : 1 + (int)log2(1e6 * (double)took[i]);
        out->bins[bin < TOUCH_BINS ? bin : TOUCH_BINS - 1]++;
    }
    qsort(took, count, sizeof *took, compare);
    qsort(wake, count, sizeof *wake, compare);
    out->p50 = quantile(took, count, 0.5);
    out->p99 = quantile(took, count, 0.99);
    out->p99_9 = quantile(took, count, 0.999);
    out->p99_99 = quantile(took, count, 0.9999);
    out->most = took[count - 1];
    out->wake_p99_9 = quantile(wake, count, 0.999);
    out->wake_most = wake[count - 1];
}

static void wait_until(uint64_t due)
{
    const struct timespec t = { (time_t)(due / 1000000000), (long)(due % 1000000000) };
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL) != 0)
        ;
}

static uint64_t page_faults(void)
{
    struct rusage r;
    return getrusage(RUSAGE_THREAD, &r) == 0 ? (uint64_t)(r.ru_minflt + r.ru_majflt) : 0;
}

static void play_tick(const touch_play *p, uint64_t i)
{
    ebpo_touch_result answer;
    double hand[3];
    if (!p->touch)
        return;
    if (p->path)
        memcpy(hand, p->path + 3 * i, sizeof hand);
    else
        touch_hand_at(p->info, (double)i / p->rate, hand);
    ebpo_touch_move(p->touch, hand, &answer);
}

/* A tick that comes too late is played all the same, and those after it at their own times. */
static void play_all(const touch_play *p, uint64_t count, float *took, float *wake,
                     touch_times *out)
{
    const double period = 1e9 / p->rate;
    uint64_t begin = tool_clock() + (uint64_t)(2 * period), faults = page_faults();
    for (uint64_t i = 0; i < count; i++) {
        uint64_t due = begin + (uint64_t)((double)i * period);
        wait_until(due);
        uint64_t began = tool_clock();
        play_tick(p, i);
        uint64_t ended = tool_clock();
        took[i] = 1e-9F * (float)(ended - began);
        wake[i] = 1e-9F * (float)(began - due);
        out->late += (double)(ended - due) > period;
    }
    out->page_faults = page_faults() - faults;
}

bool touch_play_run(const touch_play *p, touch_times *out)
{
    uint64_t count = p->path ? p->count : (uint64_t)ceil(p->rate * p->seconds);
    float *took = malloc(count * sizeof *took), *wake = malloc(count * sizeof *wake);
    bool fine = took && wake && count > 0;
    *out = (touch_times){ .ticks = count };
    if (fine) {
        memset(took, 0, count * sizeof *took); /* so that no tick is the first to use a page */
        memset(wake, 0, count * sizeof *wake);
        play_all(p, count, took, wake, out);
        sum_up(took, wake, count, out);
    }
    free(took);
    free(wake);
    return fine;
}
