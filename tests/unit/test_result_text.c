/* Tests result text (tools/cli/result_text.h): text that is written early, lost or repeated, in
 * any order, gives the bytes of each row once. */
#include <string.h>

#include "check_main.h"
#include "cli/result_text.h"
#include "cli/command.h"
#include "solids.h"

enum { ROWS = 200, ITEM = 100, LIMIT = ROWS * 60 * ITEM };

static char out[LIMIT];
static size_t out_count;

bool command_write(const char *name, const char *bytes, size_t count)
{
    (void)name;
    ck_assert(out_count + count <= sizeof out);
    memcpy(out + out_count, bytes, count);
    out_count += count;
    return true;
}

/* --- rows of items; the text spills often --- */

static bool turn;

static void spill(result_text *t, void *user)
{
    (void)user;
    if (turn)
        ck_assert(result_text_write(t, "test"));
    else
        t->full = true;
}

static unsigned items_of(uint64_t row) { return (unsigned)(row * 7919 % 59); }

/* Prints the first items of a row. When the row has no more items, also prints its end. */
static void print_row(result_text *t, uint64_t row, unsigned items)
{
    for (unsigned i = 0; i < items_of(row) && i < items; i++) {
        char *at = result_text_capacity(t);
        memset(at, 'a' + (int)((row + i) % 26), ITEM);
        result_text_end(t, at + ITEM);
        if (row % 3 == 0)
            result_text_close(t);
    }
    if (items < items_of(row))
        return;
    char *at = result_text_capacity(t);
    *at = '\n';
    result_text_end(t, at + 1);
    result_text_end_row(t);
}

static size_t print_all(result_text *t, char *to)
{
    for (uint64_t row = 0; row < ROWS; row++)
        print_row(t, row, UINT32_MAX);
    ck_assert(result_text_write(t, "test"));
    memcpy(to, out, out_count);
    size_t count = out_count;
    out_count = 0;
    return count;
}

START_TEST(test_failed_rows_are_printed_once)
{
    static char right[LIMIT];
    uint64_t state = 1;
    result_text t;
    ck_assert(result_text_init(&t));
    size_t count = print_all(&t, right);
    t.spill_at = 20 * ITEM;
    t.spill = spill;
    for (int round = 0; round < 50; round++) {
        out_count = 0;
        turn = round % 2;
        for (uint64_t row = 0, failed = UINT64_MAX; row < ROWS; row += t.rows) {
            t.rows = 0;
            /* half of the rows fail once, after some items */
            bool fails = failed != row && ebpo_test_random_unit(&state) < 0.5;
            unsigned items = (unsigned)(ebpo_test_random_unit(&state) * items_of(row));
            print_row(&t, row, fails ? items : UINT32_MAX);
            failed = fails && !t.rows ? row : failed;
            if (t.full) /* the row must wait for the turn of its block */
                turn = true;
            if (!t.rows)
                result_text_retry(&t);
            else if (row % 16 == 0)
                turn = turn || round % 3 == 0;
        }
        ck_assert(result_text_write(&t, "test"));
        ck_assert_uint_eq(out_count, count);
        ck_assert(memcmp(out, right, count) == 0);
    }
    result_text_free(&t);
}
END_TEST

Suite *test_suite(void)
{
    Suite *suite = suite_create("answer_text");
    TCase *rows = tcase_create("rows");
    tcase_add_test(rows, test_failed_rows_are_printed_once);
    suite_add_tcase(suite, rows);
    return suite;
}
