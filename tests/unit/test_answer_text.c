/* Answers as bytes (tools/cli/answer_text.h): what leaves early, is lost or comes again, in any
 * order, is in the end each row's bytes once. */
#include <string.h>

#include "check_main.h"
#include "cli/answer_text.h"
#include "cli/command.h"
#include "solids.h"

enum { ROWS = 200, ITEM = 100, MOST = ROWS * 60 * ITEM };

static char out[MOST];
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

static void spill(answer_text *t, void *user)
{
    (void)user;
    if (turn)
        ck_assert(answer_text_leave(t, "test"));
    else
        t->full = true;
}

static unsigned items_of(uint64_t row) { return (unsigned)(row * 7919 % 59); }

/* Prints a row's first items; all of them and its end, when there are so many. */
static void print_row(answer_text *t, uint64_t row, unsigned items)
{
    for (unsigned i = 0; i < items_of(row) && i < items; i++) {
        char *at = answer_text_room(t);
        memset(at, 'a' + (int)((row + i) % 26), ITEM);
        answer_text_end(t, at + ITEM);
        if (row % 3 == 0)
            answer_text_close(t);
    }
    if (items < items_of(row))
        return;
    char *at = answer_text_room(t);
    *at = '\n';
    answer_text_end(t, at + 1);
    answer_text_end_row(t);
}

static size_t print_all(answer_text *t, char *to)
{
    for (uint64_t row = 0; row < ROWS; row++)
        print_row(t, row, UINT32_MAX);
    ck_assert(answer_text_leave(t, "test"));
    memcpy(to, out, out_count);
    size_t count = out_count;
    out_count = 0;
    return count;
}

START_TEST(rows_once)
{
    static char right[MOST];
    uint64_t state = 1;
    answer_text t;
    ck_assert(answer_text_init(&t));
    size_t count = print_all(&t, right);
    t.spill_at = 20 * ITEM;
    t.spill = spill;
    for (int round = 0; round < 50; round++) {
        out_count = 0;
        turn = round % 2;
        for (uint64_t row = 0, failed = UINT64_MAX; row < ROWS; row += t.rows) {
            t.rows = 0;
            /* half of the rows fail once on their way, after some items */
            bool fails = failed != row && ebpo_test_random_unit(&state) < 0.5;
            unsigned items = (unsigned)(ebpo_test_random_unit(&state) * items_of(row));
            print_row(&t, row, fails ? items : UINT32_MAX);
            failed = fails && !t.rows ? row : failed;
            if (t.full) /* its turn comes when it waits for that */
                turn = true;
            if (!t.rows)
                answer_text_retry(&t);
            else if (row % 16 == 0)
                turn = turn || round % 3 == 0;
        }
        ck_assert(answer_text_leave(&t, "test"));
        ck_assert_uint_eq(out_count, count);
        ck_assert(memcmp(out, right, count) == 0);
    }
    answer_text_free(&t);
}
END_TEST

Suite *test_suite(void)
{
    Suite *suite = suite_create("answer_text");
    TCase *rows = tcase_create("rows");
    tcase_add_test(rows, rows_once);
    suite_add_tcase(suite, rows);
    return suite;
}
