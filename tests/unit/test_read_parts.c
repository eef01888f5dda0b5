/* When levels are read without some of their parts, the other parts equal those of the complete
 * level. */
#include <string.h>

#include "check_main.h"
#include "format/file_in.h"
#include "scratch.h"
#include "solids.h"
#include "two_layouts.h"

enum { PARTS = EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS | EBPO_PART_LEAF_PLANES };

/* Makes files that are large enough for index arrays of planes and leaves. */
static two_layouts make_files(void)
{
    two_layouts l;
    two_layouts_build(&l, ebpo_test_sheet(1, 110), 3, PARTS, EBPO_CODEC_ZSTD, 400);
    bool gray = false, leaf = false;
    for (int level = 0; level < l.without->info.level_count; level++) {
        gray |= ebpo_reader_array(l.without, EBPO_A_GRAY_INDEX, level)->present;
        leaf |= ebpo_reader_array(l.without, EBPO_A_LEAF_INDEX, level)->present;
    }
    ck_assert(gray && leaf);
    return l;
}

static ebpo_level read_level(const ebpo_file *file, int number, uint64_t without)
{
    ebpo_read_options options = EBPO_READ_OPTIONS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_level level;
    options.omitted_parts = without;
    ck_assert_msg(ebpo_file_read_level(file, number, &options, &level, &error) == EBPO_OK,
                  "level %d without %x: %s", number, (unsigned)without, error.message);
    return level;
}

static void compare(const ebpo_file *file, int number, uint64_t without)
{
    ebpo_level all = read_level(file, number, 0), some = read_level(file, number, without);
    uint32_t left = ebpo_schema_has(&file->info) & ~((uint32_t)without & PARTS);
    for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++) {
        if (!ebpo_schema_is_held(id))
            continue;
        const void *whole = ebpo_level_array(&all, id), *part = ebpo_level_array(&some, id);
        ck_assert_uint_eq(ebpo_level_rows(&all, id), ebpo_level_rows(&some, id));
        if (!whole || !(ebpo_schema[id].needs & left))
            ck_assert_msg(!part, "level %d: %s", number, ebpo_schema[id].name);
        else
            ck_assert_msg(part &&
                              memcmp(whole, part,
                                     ebpo_level_rows(&all, id) * ebpo_schema[id].held_size) == 0,
                          "level %d without %x: %s", number, (unsigned)without,
                          ebpo_schema[id].name);
    }
    ebpo_level_free(&all);
    ebpo_level_free(&some);
}

static void trees_are_whole(const ebpo_file *file)
{
    ebpo_read_options options = EBPO_READ_OPTIONS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_tree tree;
    options.omitted_parts = EBPO_PART_MESH;
    ck_assert(ebpo_file_read_tree(file, &options, &tree, &error) == EBPO_E_ARGUMENT);
    ck_assert(strstr(error.message, "omit") != NULL);
    ck_assert(ebpo_file_repack(file, scratch("new.ebpo.h5"), &options, NULL, &error) ==
              EBPO_E_ARGUMENT);
    ck_assert_int_eq(scratch_entries(), 2); /* the two files */
}

START_TEST(test_reading_with_omitted_parts)
{
    two_layouts l = make_files();
    trees_are_whole(l.with);
    for (uint64_t without = 1; without <= PARTS + 1; without++)
        for (int level = 0; level < l.with->info.level_count; level++) {
            /* the reader ignores undefined bits */
            compare(l.with, level, without > PARTS ? UINT64_MAX : without);
            compare(l.without, level, without > PARTS ? UINT64_MAX : without);
        }
    two_layouts_close(&l);
}
END_TEST

TEST_SUITE(read_parts)
{
    Suite *s = suite_create("read_parts");
    TCase *tc = tcase_create("levels");
    tcase_set_timeout(tc, 600);
    tcase_add_checked_fixture(tc, scratch_enter, scratch_leave);
    tcase_add_test(tc, test_reading_with_omitted_parts);
    suite_add_tcase(s, tc);
    return s;
}
