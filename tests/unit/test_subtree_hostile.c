/* Tests wrong tables of subtrees: every number is changed, in files with valid checksums. Results
 * must equal those of a file without a table, or be refused. Prefetch hints are within the file. */
#include <stdlib.h>
#include <string.h>

#include <ebpo/query.h>

#include "changed_array.h"
#include "check_main.h"
#include "scratch.h"
#include "solids.h"
#include "two_layouts.h"

enum { POINTS = 3 };
static const double points[POINTS][3] = { { 2.7, 0.1, 0.2 },
                                          { -1.9, 0.3, 0.69 },
                                          { 0, 2.1, -0.5 } };

/* Results of the file without a table. */
typedef struct truth {
    two_layouts files;
    changeable c;
    uint64_t *octcode, *sum, count, roots; /* roots: number of subtree roots, which come first */
    double distance[POINTS];
    bool inside[POINTS];
} truth;

/* --- a remote file: bytes in memory --- */

typedef struct far_bytes {
    const uint8_t *data;
    uint64_t size;
} far_bytes;

static ebpo_status read_bytes(void *user, uint64_t offset, uint64_t size, void *data,
                              ebpo_error *error)
{
    const far_bytes *b = user;
    (void)error;
    ck_assert(offset <= b->size && size <= b->size - offset);
    memcpy(data, b->data + offset, size);
    return EBPO_OK;
}

static void foresee(void *user, const ebpo_range *ranges, size_t count)
{
    const far_bytes *b = user;
    for (size_t i = 0; i < count; i++)
        ck_assert(ranges[i].offset <= b->size && ranges[i].size <= b->size - ranges[i].offset);
}

/* Returns NULL when the file is refused. */
static ebpo_file *open_bytes(far_bytes *b, bool far)
{
    ebpo_file *file = NULL;
    ebpo_source source = EBPO_SOURCE_INIT;
    source.user = b;
    source.size = b->size;
    source.read = read_bytes;
    if (far) {
        source.prefetch = foresee;
        source.prefetched = 4096;
    }
    return ebpo_open_source(&source, "x", &file, NULL) == EBPO_OK ? file : NULL;
}

/* --- queries --- */

/* Returns false when a call is refused, which is allowed. */
static bool run_query(const ebpo_file *file, double distance[POINTS], bool inside[POINTS])
{
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model *model = NULL;
    ebpo_context *context = NULL;
    options.memory = 16 << 20;
    options.threads = 1;
    bool fine = ebpo_model_new(file, &options, &model, NULL) == EBPO_OK &&
                ebpo_context_new(model, &context, NULL) == EBPO_OK;
    for (int i = 0; i < POINTS && fine; i++) {
        ebpo_distance_result d;
        ebpo_inside_result in;
        fine = ebpo_distance(context, points[i], NULL, &d, NULL) == EBPO_OK &&
               ebpo_inside(context, points[i], NULL, &in, NULL) == EBPO_OK;
        distance[i] = fine ? d.distance : 0;
        inside[i] = fine && in.where == EBPO_IN;
    }
    if (context)
        ebpo_context_free(context);
    ebpo_model_free(model);
    return fine;
}

static void truth_add(truth *t, int level)
{
    uint64_t count, *codes = octcodes_of_level(t->files.without, level, &count);
    t->octcode = realloc(t->octcode, (t->count + count + 1) * sizeof *t->octcode);
    t->sum = realloc(t->sum, (t->count + count + 1) * sizeof *t->sum);
    for (uint64_t i = 0; i < count; i++) {
        ebpo_status status;
        uint64_t sum = subtree_sum(t->files.without, codes[i], &status);
        if (status != EBPO_OK)
            continue;
        t->octcode[t->count] = codes[i];
        t->sum[t->count++] = sum;
    }
    free(codes);
}

static void truth_make(truth *t, uint32_t parts, uint64_t subtree_faces)
{
    memset(t, 0, sizeof *t);
    two_layouts_build(&t->files, ebpo_test_torus(2, 0.7, 48, 30), 6, parts, EBPO_CODEC_NONE,
                      subtree_faces);
    changeable_load(&t->c, t->files.packed);
    int level = ebpo_file_info(t->files.with)->subtree_level;
    ck_assert(level > 0);
    truth_add(t, level);
    t->roots = t->count;
    truth_add(t, level - 1);
    truth_add(t, level + 1);
    ck_assert(t->roots > 20);
    if (parts & EBPO_PART_MESH)
        ck_assert(run_query(t->files.without, t->distance, t->inside));
}

static void truth_free(truth *t)
{
    changeable_free(&t->c);
    two_layouts_close(&t->files);
    free(t->octcode);
    free(t->sum);
}

/* Checks the subtrees around one subtree, and some others. Each is unchanged or refused. */
static void check_results(const truth *t, uint64_t around, bool far, uint64_t *refused)
{
    far_bytes b = { t->c.data, t->c.size };
    ebpo_file *file = open_bytes(&b, far);
    double distance[POINTS];
    bool inside[POINTS];
    ebpo_status status;
    if (!file) {
        ++*refused;
        return;
    }
    for (uint64_t k = 0; k < 10; k++) {
        uint64_t i =
            k < 4 ? (around + k + t->roots - 1) % t->roots : (around * 7 + k * 31) % t->count;
        uint64_t sum = subtree_sum(file, t->octcode[i], &status);
        *refused += status != EBPO_OK;
        ck_assert(status == EBPO_OK || status == EBPO_E_FORMAT || status == EBPO_E_LIMIT);
        ck_assert(status != EBPO_OK || sum == t->sum[i]);
    }
    if (around % 4 == 0 && ebpo_file_info(file)->parts & EBPO_PART_MESH &&
        run_query(file, distance, inside)) {
        ck_assert(memcmp(distance, t->distance, sizeof distance) == 0);
        ck_assert(memcmp(inside, t->inside, sizeof inside) == 0);
    }
    ebpo_close(file);
}

static uint64_t changed(uint64_t value, int how)
{
    switch (how) {
    case 0: return value + 1;
    case 1: return value - 1;
    case 2: return 0;
    case 3: return value + 0x100;
    case 4: return UINT64_MAX;
    default: return value ^ 0x80000000;
    }
}

enum { WAYS = 6 };

static void change_all(truth *t, ebpo_array_id id, uint64_t step, uint64_t *refused)
{
    uint64_t count = changeable_count(&t->c, id), turn = 0;
    ck_assert(count > 0);
    for (uint64_t i = 0; i < count; i += step, turn++)
        for (int how = 0; how < WAYS; how++) {
            uint64_t before = changeable_get(&t->c, id, i);
            if (changed(before, how) == before)
                continue;
            changeable_put(&t->c, id, i, changed(before, how));
            check_results(t, i * t->roots / count, (turn + (uint64_t)how) % 2, refused);
            changeable_put(&t->c, id, i, before);
        }
}

static uint64_t steps(uint64_t count) { return (uint64_t)((double)count / ebpo_test_scale()); }

START_TEST(test_wrong_subtree_counts_are_harmless)
{
    static const struct {
        uint32_t parts;
        uint64_t faces;
    } files[] = { { EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS, 20 },
                  { EBPO_PART_MESH | EBPO_PART_LEAF_PLANES, 8 },
                  { EBPO_PART_PLANES, 8 } };
    truth t;
    uint64_t refused = 0;
    truth_make(&t, files[_i].parts, files[_i].faces);
    check_results(&t, 0, false, &refused);
    check_results(&t, 1, true, &refused);
    ck_assert(refused == 0);
    change_all(&t, EBPO_A_SUBTREE_INDEX, steps(1), &refused);
    change_all(&t, EBPO_A_SUBTREE_COUNTS, steps(7), &refused);
    ck_assert(refused > 0);
    if (files[_i].parts & EBPO_PART_MESH)
        change_all(&t, EBPO_A_SUBTREE_SHARED, steps(3), &refused);
    change_all(&t, EBPO_A_CHUNK_DIRECTORY, steps(3), &refused);
    truth_free(&t);
}
END_TEST

/* Changes two numbers of a column, so that the sums agree. */
START_TEST(test_wrong_subtree_row_pairs_are_harmless)
{
    truth t;
    uint64_t refused = 0, wrong = 0;
    truth_make(&t, EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS | EBPO_PART_LEAF_PLANES, 20);
    uint64_t count = changeable_count(&t.c, EBPO_A_SUBTREE_COUNTS), cols = count / t.roots;
    cols =
        count /
        ebpo_file_info(t.files.with)->level[ebpo_file_info(t.files.with)->subtree_level].gray_count;
    for (uint64_t i = 0; i + cols < count; i += steps(5), wrong++) {
        uint64_t a = changeable_get(&t.c, EBPO_A_SUBTREE_COUNTS, i),
                 b = changeable_get(&t.c, EBPO_A_SUBTREE_COUNTS, i + cols), by = 1 + wrong % 3;
        if (b < by)
            continue;
        changeable_put(&t.c, EBPO_A_SUBTREE_COUNTS, i, a + by);
        changeable_put(&t.c, EBPO_A_SUBTREE_COUNTS, i + cols, b - by);
        check_results(&t, i * t.roots / count, wrong % 2, &refused);
        changeable_put(&t.c, EBPO_A_SUBTREE_COUNTS, i, a);
        changeable_put(&t.c, EBPO_A_SUBTREE_COUNTS, i + cols, b);
    }
    ck_assert(refused > 0);
    truth_free(&t);
}
END_TEST

TEST_SUITE(subtree_hostile)
{
    Suite *suite = suite_create("subtree_hostile");
    TCase *tests = tcase_create("subtree_hostile");
    tcase_set_timeout(tests, 900);
    tcase_add_checked_fixture(tests, scratch_enter, scratch_leave);
    tcase_add_loop_test(tests, test_wrong_subtree_counts_are_harmless, 0, 3);
    tcase_add_test(tests, test_wrong_subtree_row_pairs_are_harmless);
    suite_add_tcase(suite, tests);
    return suite;
}
