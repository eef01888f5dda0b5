/* Hashes results of the functions of core/simd.h for random and special values. The hash must be
 * the same for every instruction set, because kernels must give equal bits on every machine. The
 * program fails when the hash is not the expected one. f8_about_inverse and f8_inverse are not
 * included: their results may differ. Exit code 77: the processor lacks the instructions. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>

#include "core/simd.h"

enum { ROUNDS = 100000 };
static const uint64_t EXPECTED = UINT64_C(0x9770f33248b81296);

static uint64_t random_state = 1, hash = UINT64_C(1469598103934665603);

static uint32_t random_bits(void)
{
    random_state = random_state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (uint32_t)(random_state >> 32);
}

static float random_float(void)
{
    static const float special[] = { 0,         -0.0F, 1,      -1,      INFINITY,
                                     -INFINITY, NAN,   1e-40F, -1e-40F, 3.4e38F };
    uint32_t bits = random_bits();
    if (bits % 4 == 0)
        return special[(bits >> 8) % (sizeof special / sizeof *special)];
    bits = random_bits();
    float x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

static void add_bytes(const void *at, size_t bytes)
{
    for (size_t i = 0; i < bytes; i++)
        hash = (hash ^ ((const uint8_t *)at)[i]) * UINT64_C(1099511628211);
}

/* Adds a float; processors may give NaN different bits. */
static void add_float(float x)
{
    x = x == x ? x : 0;
    add_bytes(&x, sizeof x);
}

static void add(f8 a)
{
    float x[8];
    f8_store(x, a);
    for (int i = 0; i < 8; i++)
        add_float(x[i]);
}

static void add_bits(unsigned bits) { add_bytes(&bits, sizeof bits); }

static void add_d3(d3 a)
{
    double x[4] = { 0 };
    d3_store(x, a);
    for (int k = 0; k < 3; k++)
        add_bytes(x[k] == x[k] ? &x[k] : &(double){ 0 }, sizeof x[k]);
}

static void hash_floats(const float a[16], const float b[8])
{
    f8 x = f8_load(a), y = f8_load(b), four = f8_load_twice(a);
    f8 results[] = { f8_add(x, y),
                     f8_sub(x, y),
                     f8_mul(x, y),
                     f8_div(x, y),
                     f8_min(x, y),
                     f8_max(x, y),
                     f8_sqrt(f8_abs(x)),
                     f8_pick(f8_mask(random_bits() & 255), x, y),
                     f8_and(x, f8_less(x, y)),
                     f8_or(f8_and(x, f8_less(x, y)), f8_and(y, f8_at_most(y, x))),
                     f8_xor(x, f8_xor(y, x)),
                     four,
                     f8_spread0(four),
                     f8_spread1(four),
                     f8_spread2(four),
                     f8_spread3(four),
                     f8_look_up(f8_table_load(a), n8_from_bits(random_bits())) };
    for (size_t i = 0; i < sizeof results / sizeof *results; i++)
        add(results[i]);
    unsigned mask = random_bits() & 255;
    add_bits(f8_bits(f8_less(x, y)));
    add_bits(f8_bits(f8_at_most(x, y)));
    add_bits(f8_bits(f8_mask(mask)) == mask);
}

static void hash_least(const float b[8])
{
    float numbers[8]; /* neither NaN nor zeros of both signs */
    for (int i = 0; i < 8; i++)
        numbers[i] = b[i] == b[i] && b[i] != 0 ? b[i] : 2;
    add_float(f8_least(f8_load(numbers)));
}

static void hash_integers(const float a[16])
{
    uint8_t bytes[8];
    int16_t shorts[8];
    int32_t from[8];
    v4l words;
    for (int i = 0; i < 8; i++) {
        bytes[i] = (uint8_t)random_bits();
        shorts[i] = (int16_t)random_bits();
        from[i] = (int32_t)(random_bits() & 7);
    }
    for (int i = 0; i < 4; i++)
        words[i] = (int64_t)(random_bits() & 1) * INT64_MIN;
    add(f8_from_bytes(bytes));
    add(f8_from_shorts(shorts));
    add(f8_load_lanes(a, from));
    add_bits(v4l_mask(words));
}

static void hash_doubles(const float a[16], const float b[8])
{
    double p[3], q[3];
    float rounded[2][4] = { { 0 } };
    for (int k = 0; k < 3; k++) {
        p[k] = (double)a[k] * 1.0000000001;
        q[k] = (double)b[k];
    }
    d3 x = d3_load(p), y = d3_load(q);
    d3 results[] = { d3_add(x, y),       d3_sub(x, y), d3_mul(x, y),
                     d3_div(x, y),       d3_max(x, y), d3_signed(d3_abs(x), y),
                     d3_beyond_floats(x) };
    for (size_t i = 0; i < sizeof results / sizeof *results; i++)
        add_d3(results[i]);
    d3_store_floats(rounded[0], x);
    d3_store_floats_after(rounded[1], x);
    for (int k = 0; k < 3; k++) {
        add_float(rounded[0][k]);
        add_float(rounded[1][k + 1]);
    }
    add_bits(d3_signs(d3_signed(d3_all(1), y)));
}

int main(void)
{
#if defined(EBPO_SIMD_AVX2)
    if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma"))
        return 77;
#endif
    for (int round = 0; round < ROUNDS; round++) {
        float a[16], b[8];
        for (int i = 0; i < 16; i++)
            a[i] = random_float();
        for (int i = 0; i < 8; i++)
            b[i] = random_float();
        hash_floats(a, b);
        hash_least(b);
        hash_integers(a);
        hash_doubles(a, b);
    }
    printf("%016" PRIx64 "\n", hash);
    return hash != EXPECTED;
}
