/* Measures the cost of saving the floating-point environment for a call: ns, in the default
 * environment and in another one. */
#include <fenv.h>
#include <stdio.h>
#include <time.h>

#include "core/fp_env.h"

enum { CALLS = 50000000 };

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

__attribute__((noinline)) static void with(void)
{
    EBPO_DEFAULT_FP;
    __asm__ volatile("" ::: "memory");
}

__attribute__((noinline)) static void without(void) { __asm__ volatile("" ::: "memory"); }

static double cost(void)
{
    double begin = now();
    for (int i = 0; i < CALLS; i++)
        with();
    double middle = now();
    for (int i = 0; i < CALLS; i++)
        without();
    return ((middle - begin) - (now() - middle)) / CALLS;
}

int main(void)
{
    double standard = cost();
    fesetround(FE_UPWARD);
    double other = cost();
    fesetround(FE_TONEAREST);
    printf("default environment %.1f ns, another %.1f ns a call\n", standard, other);
    return 0;
}
