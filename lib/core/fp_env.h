/* Sets the floating-point environment that the library needs in public functions: rounding to
 * nearest, denormals kept, no traps.
 *
 * A public function begins with the line EBPO_DEFAULT_FP; which saves the caller's environment,
 * sets the default environment, and restores the caller's environment on every return. If the
 * caller's environment is already the default, nothing is written, and the line takes a few
 * nanoseconds. Threads that the function starts inherit the environment. Exception flags that the
 * caller had raised stay; flags that the library's operations raise may be added. */
#ifndef EBPO_CORE_FP_ENV_H
#define EBPO_CORE_FP_ENV_H

#if defined(__SSE2__)
#include <xmmintrin.h>

/* The saved environment. On x86 this is only the SSE control register, because strict_fp.h rejects
 * x87 arithmetic. */
typedef struct ebpo_fp_env {
    unsigned control;
} ebpo_fp_env;

/* EBPO_FP_CONTROL: mask of the control register's bits that are not exception flags.
 * EBPO_FP_DEFAULT: the default of these bits: all exceptions masked, rounding to nearest, no flush
 * to zero, no denormals-are-zero. */
enum { EBPO_FP_CONTROL = 0xffc0, EBPO_FP_DEFAULT = 0x1f80 };

/* Sets the default environment. The asm prevents the compiler from moving memory reads, and
 * computations with these values, from after this line to before it. */
static inline ebpo_fp_env ebpo_fp_enter(void)
{
    ebpo_fp_env env = { _mm_getcsr() };
    if (__builtin_expect((env.control & EBPO_FP_CONTROL) != EBPO_FP_DEFAULT, 0))
        _mm_setcsr(EBPO_FP_DEFAULT);
    __asm__ volatile("" ::: "memory");
    return env;
}

/* Restores a saved environment. */
static inline void ebpo_fp_leave(const ebpo_fp_env *env)
{
    __asm__ volatile("" ::: "memory");
    if (__builtin_expect((env->control & EBPO_FP_CONTROL) != EBPO_FP_DEFAULT, 0))
        _mm_setcsr(env->control);
}

#elif defined(__aarch64__)
#include <stdint.h>

typedef struct ebpo_fp_env {
    uint64_t control;
} ebpo_fp_env;

static inline void ebpo_fp_set(uint64_t control)
{
    __asm__ volatile("msr fpcr, %0" ::"r"(control) : "memory");
}

static inline ebpo_fp_env ebpo_fp_enter(void)
{
    ebpo_fp_env env;
    __asm__ volatile("mrs %0, fpcr" : "=r"(env.control)::"memory");
    if (__builtin_expect(env.control != 0, 0)) /* 0: the default environment */
        ebpo_fp_set(0);
    return env;
}

static inline void ebpo_fp_leave(const ebpo_fp_env *env)
{
    if (__builtin_expect(env->control != 0, 0))
        ebpo_fp_set(env->control);
}

#else
#include <fenv.h>

typedef struct ebpo_fp_env {
    fenv_t all;
} ebpo_fp_env;

static inline ebpo_fp_env ebpo_fp_enter(void)
{
    ebpo_fp_env env;
    fegetenv(&env.all);
    fesetenv(FE_DFL_ENV);
    return env;
}

static inline void ebpo_fp_leave(const ebpo_fp_env *env) { fesetenv(&env->all); }
#endif

#define EBPO_DEFAULT_FP                                                                 \
    __attribute__((cleanup(ebpo_fp_leave), unused)) const ebpo_fp_env ebpo_callers_fp = \
        ebpo_fp_enter()

#endif
