/* Guarantees IEEE double arithmetic with one rounding to nearest for each operation. A source file
 * whose results depend on this arithmetic includes this header first. The header rejects compilers
 * and flags that do not guarantee this arithmetic. Disables contraction into FMA (fused
 * multiply-add) even if the flags request it. With gcc, disables the SLP vectoriser, which drops
 * the rounding of neighbouring (double)(float) casts (gcc 12). tests/lint/flags/test_strict_fp.py
 * checks the sources and this file. */
#ifndef EBPO_CORE_STRICT_FP_H
#define EBPO_CORE_STRICT_FP_H

#include <float.h>

#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__)
#error \
    "exact predicates need strict floating point: build without -ffast-math and -ffinite-math-only"
#endif
#if defined(__GNUC__) && !defined(__clang__) && (!defined(__GCC_IEC_559) || __GCC_IEC_559 == 0)
#error \
    "exact predicates need strict floating point: build without -funsafe-math-optimizations and its parts (-fassociative-math, -freciprocal-math, -fno-signed-zeros)"
#endif
/* The value 16 is also allowed: it differs from 0 only in the treatment of _Float16, not of double.
 */
#if FLT_EVAL_METHOD != 0 && FLT_EVAL_METHOD != 16
#error \
    "exact predicates need FLT_EVAL_METHOD 0, without excess precision: on x86 build with -msse2 -mfpmath=sse"
#endif
_Static_assert(FLT_RADIX == 2 && DBL_MANT_DIG == 53 && DBL_MAX_EXP == 1024,
               "exact predicates need IEEE 754 binary64");

#if defined(__clang__)
/* clang's unsafe-math flags define no macro, but these pragmas override them. The pragmas do not
 * override -ffp-contract=fast, and no macro shows that flag; tests/lint/flags/fp_flags.py detects
 * it. */
#if !defined(__wasm__) /* clang 14 does not support this pragma for WebAssembly */
#pragma float_control(precise, on)
#endif
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
#pragma GCC optimize("fp-contract=off", "no-tree-slp-vectorize")
#endif

#endif
