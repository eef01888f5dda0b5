/* Selects kernels: inner loops that are compiled once for each instruction set, with the same
 * results.
 *
 * A kernel is a table of functions. NAME_kernels.c defines the table as EBPO_KERNEL(TABLE), its
 * header declares it by EBPO_KERNELS(TYPE, TABLE), and callers use TABLE_best(), which returns the
 * table for this processor. lib/meson.build has one row for each instruction set, with its suffix
 * and its compiler flags. The suffix `base` is the compiler's default instruction set. Tests define
 * EBPO_BASE_KERNELS_ONLY to use only the base kernels, which they compile with other flags. */
#ifndef EBPO_CORE_CPU_H
#define EBPO_CORE_CPU_H

#include <stdbool.h>

#define EBPO_KERNEL_JOIN(name, suffix)  name##_##suffix
#define EBPO_KERNEL_NAMED(name, suffix) EBPO_KERNEL_JOIN(name, suffix)
#define EBPO_KERNEL(name)               EBPO_KERNEL_NAMED(name, EBPO_KERNEL_SUFFIX)

#if defined(__x86_64__) && !defined(EBPO_BASE_KERNELS_ONLY)
#define EBPO_KERNELS(type, name)                              \
    extern const type name##_base, name##_v3;                 \
    static inline const type *name##_best(void)               \
    {                                                         \
        return ebpo_cpu_has_v3() ? &name##_v3 : &name##_base; \
    }
#else
#define EBPO_KERNELS(type, name)   \
    extern const type name##_base; \
    static inline const type *name##_best(void) { return &name##_base; }
#endif

/* Returns true if this processor has AVX2, FMA, BMI1 and BMI2 (x86-64-v3). */
bool ebpo_cpu_has_v3(void);

#endif
