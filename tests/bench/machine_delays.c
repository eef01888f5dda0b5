/* Measures the delays of the machine. A loop at 1 kHz does the same 20 us of arithmetic in each
 * step, without the library, with SCHED_FIFO and locked memory as in `ebpo haptic`.
 *
 *     gcc -O2 tests/bench/machine_delays.c -o machine_delays -lm && ./machine_delays SECONDS */
#define _GNU_SOURCE
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <time.h>

static double now(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

int main(int argc, char **argv)
{
    size_t count = 1000 * (size_t)(argc > 1 ? atoi(argv[1]) : 60), over = 0;
    double *took = calloc(2 * count, sizeof *took), *cpu = took + count;
    volatile double sum = 0;
    struct sched_param first = { .sched_priority = sched_get_priority_max(SCHED_FIFO) / 2 };
    struct timespec due;
    if (!took || count == 0 || sched_setscheduler(0, SCHED_FIFO, &first) != 0 ||
        mlockall(MCL_CURRENT) != 0)
        return perror("machine_delays"), 1;
    clock_gettime(CLOCK_MONOTONIC, &due);
    for (size_t i = 0; i < count; i++) {
        due.tv_nsec += 1000000;
        due.tv_sec += due.tv_nsec / 1000000000;
        due.tv_nsec %= 1000000000;
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL);
        double began = now(CLOCK_MONOTONIC), worked = now(CLOCK_THREAD_CPUTIME_ID);
        for (int k = 0; k < 8000; k++)
            sum = sum + 1;
        cpu[i] = 1e6 * (now(CLOCK_THREAD_CPUTIME_ID) - worked);
        took[i] = 1e6 * (now(CLOCK_MONOTONIC) - began);
        over += took[i] > 1000;
    }
    qsort(took, count, sizeof *took, compare);
    qsort(cpu, count, sizeof *cpu, compare);
    printf("%zu steps: %zu over 1 ms; p50 %.3g us, p99.9 %.3g us, max %.0f us; CPU time p99.9 "
           "%.3g us, max %.0f us\n",
           count, over, took[count / 2], took[count - 1 - count / 1000], took[count - 1],
           cpu[count - 1 - count / 1000], cpu[count - 1]);
    return 0;
}
