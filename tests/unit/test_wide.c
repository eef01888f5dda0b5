/* Compares integers of 128 bits with GMP. */
#include <gmp.h>

#include "core/hash.h"
#include "core/wide.h"
#include "check_main.h"

enum { ROUNDS = 20000 };

static void set_number(mpz_t out, uint64_t v) { mpz_import(out, 1, 1, sizeof v, 0, 0, &v); }

static void set_wide(mpz_t out, ebpo_wide v)
{
    const uint64_t words[2] = { v.high, v.low };
    mpz_import(out, 2, 1, sizeof words[0], 0, 0, words);
}

static void set_signed(mpz_t out, ebpo_wide v)
{
    set_wide(out, v);
    if (v.high >> 63) {
        mpz_t all;
        mpz_init(all);
        mpz_setbit(all, 128);
        mpz_sub(out, out, all);
        mpz_clear(all);
    }
}

static void expect(ebpo_wide found, mpz_t wanted)
{
    mpz_t value;
    mpz_init(value);
    set_wide(value, found);
    mpz_fdiv_r_2exp(wanted, wanted, 128);
    ck_assert_msg(mpz_cmp(value, wanted) == 0, "%016llx %016llx", (unsigned long long)found.high,
                  (unsigned long long)found.low);
    mpz_clear(value);
}

/* Returns a number of any length, often near its limits. */
static uint64_t number(uint64_t *r)
{
    uint64_t v = ebpo_random_next(r) >> ebpo_random_next(r) % 64;
    return ebpo_random_next(r) % 8 == 0 ? ~v : v;
}

static void check_arithmetic(ebpo_wide a, ebpo_wide b, int n)
{
    mpz_t x, y, z;
    mpz_inits(x, y, z, NULL);
    set_wide(x, a);
    set_wide(y, b);
    mpz_add(z, x, y);
    expect(ebpo_wide_plus(a, b), z);
    mpz_mul_2exp(z, x, (mp_bitcnt_t)n);
    expect(ebpo_wide_left(a, n), z);
    mpz_fdiv_q_2exp(z, x, (mp_bitcnt_t)n);
    expect(ebpo_wide_right(a, n), z);
    ck_assert(ebpo_wide_less(a, b) == (mpz_cmp(x, y) < 0));
    set_number(y, b.low);
    mpz_mul(z, x, y);
    expect(ebpo_wide_times(a, b.low), z);
    uint64_t m = b.low >> 1 | 1;
    set_number(y, m);
    mpz_fdiv_r(z, x, y);
    set_number(y, ebpo_wide_modulo(a, m));
    ck_assert(mpz_cmp(y, z) == 0);
    set_signed(x, a);
    set_signed(y, b);
    ck_assert(ebpo_wide_signed_at_most(a, b) == (mpz_cmp(x, y) <= 0));
    mpz_clears(x, y, z, NULL);
}

START_TEST(test_wide_arithmetic_matches_gmp)
{
    uint64_t r = 128;
    for (int i = 0; i < ROUNDS; i++) {
        ebpo_wide a = { number(&r), number(&r) }, b = { number(&r), number(&r) };
        if (i % 4 == 0)
            b.high = a.high;
        check_arithmetic(a, i % 64 == 0 ? a : b, (int)(ebpo_random_next(&r) % 128));
    }
}
END_TEST

START_TEST(test_wide_products_match_gmp)
{
    uint64_t r = 64;
    mpz_t x, y, z;
    mpz_inits(x, y, z, NULL);
    for (int i = 0; i < ROUNDS; i++) {
        uint64_t a = number(&r), b = number(&r);
        set_number(x, a);
        set_number(y, b);
        mpz_mul(z, x, y);
        expect(ebpo_wide_product(a, b), z);
        expect(ebpo_wide_product_by_halves(a, b), z);
        set_signed(x, (ebpo_wide){ a >> 63 ? UINT64_MAX : 0, a });
        set_signed(y, (ebpo_wide){ b >> 63 ? UINT64_MAX : 0, b });
        mpz_mul(z, x, y);
        expect(ebpo_wide_signed_product((int64_t)a, (int64_t)b), z);
    }
    mpz_clears(x, y, z, NULL);
}
END_TEST

TEST_SUITE(wide)
{
    Suite *suite = suite_create("wide");
    TCase *tests = tcase_create("wide");
    tcase_add_test(tests, test_wide_arithmetic_matches_gmp);
    tcase_add_test(tests, test_wide_products_match_gmp);
    suite_add_tcase(suite, tests);
    return suite;
}
