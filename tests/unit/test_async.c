/* Tests files whose bytes arrive asynchronously: the object that holds the bytes, and the functions
 * that read files. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/ebpo.h>

#include "check_main.h"
#include "counted_source.h"
#include "pending_source.h"
#include "scratch.h"
#include "solids.h"
#include "two_layouts.h"

enum {
    ALL = EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS | EBPO_PART_LEAF_PLANES,
    HEAD = 4096, /* of the models below, so that opening does not read all of them */
    KIB = 1024
};

static ebpo_error error;

/* --- the object --- */

static uint8_t byte_at(uint64_t offset) { return (uint8_t)(offset * 31 + offset / 256); }

static ebpo_status supply(ebpo_async *a, uint64_t offset, uint64_t size, const char *version)
{
    uint8_t *bytes = malloc(size + 1);
    for (uint64_t i = 0; i < size; i++)
        bytes[i] = byte_at(offset + i);
    ebpo_status status = ebpo_async_supply(a, offset, size, bytes, version, &error);
    free(bytes);
    return status;
}

static ebpo_async *make(uint64_t size, uint64_t memory, ebpo_source *source)
{
    ebpo_async *a;
    *source = (ebpo_source)EBPO_SOURCE_INIT;
    ck_assert(ebpo_async_new(size, "file", "v1", memory, &a, &error) == EBPO_OK);
    ck_assert(ebpo_async_source(a, source, &error) == EBPO_OK);
    return a;
}

/* Reads a range and compares its bytes. */
static ebpo_status read_range(const ebpo_source *source, uint64_t offset, uint64_t size)
{
    uint8_t *bytes = malloc(size);
    ebpo_status status = source->read(source->user, offset, size, bytes, &error);
    for (uint64_t i = 0; i < size && status == EBPO_OK; i++)
        ck_assert_uint_eq(bytes[i], byte_at(offset + i));
    free(bytes);
    return status;
}

static void expect_needed(ebpo_async *a, size_t count, const ebpo_range *expected)
{
    const ebpo_range *range;
    size_t found;
    ck_assert(ebpo_async_needed(a, &range, &found, &error) == EBPO_OK);
    ck_assert_uint_eq(found, count);
    for (size_t i = 0; i < count; i++) {
        ck_assert_uint_eq(range[i].offset, expected[i].offset);
        ck_assert_uint_eq(range[i].size, expected[i].size);
    }
}

START_TEST(test_needed_ranges_are_sorted_and_merged)
{
    enum { FAR = 1 << 20 };
    ebpo_source source;
    ebpo_async *a = make(UINT64_C(1) << 30, UINT64_MAX, &source);
    const ebpo_range hints[] = { { 9 * FAR, 100 }, { 5 * FAR, 100 }, { 5 * FAR + 16000, 50 } };
    ck_assert(read_range(&source, 7 * FAR, 10) == EBPO_E_PENDING);
    source.prefetch(source.user, hints, 3);
    expect_needed(a, 3, (ebpo_range[]){ { 5 * FAR, 16050 }, { 7 * FAR, 10 }, { 9 * FAR, 100 } });
    expect_needed(a, 0, NULL); /* each range is returned once */
    ck_assert(supply(a, 5 * FAR + 100, 200, NULL) == EBPO_OK);
    ck_assert(read_range(&source, 5 * FAR, 1000) == EBPO_E_PENDING);
    expect_needed(a, 2, (ebpo_range[]){ { 5 * FAR, 100 }, { 5 * FAR + 300, 700 } });
    ck_assert(read_range(&source, 100 * FAR, 9 * FAR) == EBPO_E_PENDING);
    expect_needed(a, 3,
                  (ebpo_range[]){
                      { 100 * FAR, 3 * FAR }, { 103 * FAR, 3 * FAR }, { 106 * FAR, 3 * FAR } });
    ebpo_async_free(a);
}
END_TEST

START_TEST(test_supplied_bytes_are_read)
{
    ebpo_source source;
    ebpo_async *a = make(1 << 20, UINT64_MAX, &source);
    uint64_t state = 5;
    static uint8_t known[1 << 20];
    for (int n = 0; n < 3000; n++) {
        uint64_t offset = ebpo_test_random(&state) % (1 << 20),
                 size = ebpo_test_random(&state) % 4000;
        size = size > (1 << 20) - offset ? (1 << 20) - offset : size + (offset < (1 << 20));
        size = size > (1 << 20) - offset ? (1 << 20) - offset : size;
        bool available = true;
        for (uint64_t i = offset; i < offset + size; i++)
            available &= known[i];
        if (n % 2) {
            ck_assert(supply(a, offset, size, n % 4 == 1 ? "v1" : NULL) == EBPO_OK);
            memset(known + offset, 1, size);
        } else if (size) {
            ck_assert(read_range(&source, offset, size) == (available ? EBPO_OK : EBPO_E_PENDING));
        }
    }
    uint64_t sum = 0;
    for (size_t i = 0; i < sizeof known; i++)
        sum += known[i];
    ck_assert_uint_eq(ebpo_async_bytes(a), sum);
    ebpo_async_free(a);
}
END_TEST

START_TEST(test_wrong_supplies_are_rejected)
{
    ebpo_source source;
    ebpo_async *a = make(1000, UINT64_MAX, &source);
    static const uint8_t other[4] = { 9, 9, 9, 9 };
    ck_assert(supply(a, 990, 11, NULL) == EBPO_E_ARGUMENT);
    ck_assert(supply(a, 1001, 0, NULL) == EBPO_E_ARGUMENT);
    ck_assert(supply(a, UINT64_MAX, 2, NULL) == EBPO_E_ARGUMENT);
    ck_assert(ebpo_async_supply(a, 0, 4, NULL, NULL, &error) == EBPO_E_ARGUMENT);
    ck_assert(ebpo_async_source(a, NULL, &error) == EBPO_E_ARGUMENT);
    ck_assert(ebpo_async_source(NULL, &(ebpo_source)EBPO_SOURCE_INIT, &error) == EBPO_E_ARGUMENT);
    ck_assert(supply(a, 0, 100, "v1") == EBPO_OK && read_range(&source, 0, 100) == EBPO_OK);
    if (_i) /* another version, or other bytes */
        ck_assert(supply(a, 200, 10, "v2") == EBPO_E_IO);
    else
        ck_assert(ebpo_async_supply(a, 98, 4, other, NULL, &error) == EBPO_E_IO);
    ck_assert(strstr(error.message, "has changed"));
    const ebpo_range *range;
    size_t count;
    ck_assert(read_range(&source, 0, 100) == EBPO_E_IO);
    ck_assert(ebpo_async_needed(a, &range, &count, &error) == EBPO_E_IO && count == 0);
    ck_assert(supply(a, 300, 10, "v1") == EBPO_E_IO);
    ebpo_async_free(a);
}
END_TEST

/* Bytes that a running operation used stay, others are removed by age; the head stays. */
START_TEST(test_operations_keep_their_bytes)
{
    enum { MIB = 1 << 20 };
    ebpo_source source;
    ebpo_async *a = make(100 * MIB, 2 * MIB, &source);
    uint64_t first = ebpo_async_begin(a);
    for (uint64_t i = 0; i < 8; i++)
        ck_assert(supply(a, i * MIB, MIB, NULL) == EBPO_OK);
    uint64_t second = ebpo_async_begin(a);
    ck_assert(read_range(&source, 5 * MIB, MIB) == EBPO_OK);
    ck_assert(supply(a, 20 * MIB, 2 * MIB, NULL) == EBPO_OK);
    ck_assert_uint_eq(ebpo_async_bytes(a), 10 * MIB);
    ebpo_async_end(a, first);
    ck_assert_uint_eq(ebpo_async_bytes(a), 3 * MIB + 128 * KIB); /* above the limit: in use */
    ck_assert(read_range(&source, 20 * MIB, 2 * MIB) == EBPO_OK);
    ck_assert(read_range(&source, 5 * MIB, MIB) == EBPO_OK);
    ck_assert(read_range(&source, 4 * MIB, MIB) == EBPO_E_PENDING);
    ebpo_async_end(a, second);
    ck_assert(read_range(&source, 20 * MIB, MIB) == EBPO_E_PENDING);
    ck_assert(read_range(&source, 5 * MIB, MIB) == EBPO_OK); /* read last */
    ck_assert(read_range(&source, 0, 128 * KIB) == EBPO_OK);
    ck_assert(ebpo_async_bytes(a) <= 2 * MIB);
    ebpo_async_free(a);
}
END_TEST

/* --- functions that read files --- */

/* Adds the results of a function to a checksum. `p`: the source of the file; NULL: its bytes are
 * available. A function that returns EBPO_E_PENDING is called again, with the initial checksum. */
typedef ebpo_status (*reading_fn)(const ebpo_file *file, pending_source *p, uint64_t *sum);

static bool again(pending_source *p, ebpo_status status) { return p && pending_again(p, status); }

static void add(uint64_t *sum, const void *data, uint64_t bytes)
{
    for (uint64_t i = 0; data && i < bytes; i++)
        *sum = (*sum ^ ((const uint8_t *)data)[i]) * UINT64_C(1099511628211);
}

static void add_mesh(uint64_t *sum, const ebpo_mesh *m)
{
    add(sum, m->faces, m->face_count * 12);
    add(sum, m->xyz32, m->vertex_count * 12);
    add(sum, m->xyz64, m->vertex_count * 24);
}

static void add_level(uint64_t *sum, const ebpo_level *level)
{
    add(sum, level->types, level->group_count * 2);
    add(sum, level->planes, level->plane_count * 4);
    add(sum, level->leaf_first, level->leaf_count * 8);
    add(sum, level->leaf_refs, level->ref_count * 4);
    add(sum, level->leaf_planes, level->leaf_plane_count * 4);
}

static void add_file(uint64_t *sum, const char *path)
{
    char buffer[4096];
    FILE *f = fopen(path, "rb");
    ck_assert_ptr_nonnull(f);
    for (size_t n; (n = fread(buffer, 1, sizeof buffer, f)) > 0;)
        add(sum, buffer, n);
    fclose(f);
}

static ebpo_status sum_levels(const ebpo_file *file, pending_source *p, uint64_t *sum)
{
    ebpo_level level;
    ebpo_status status = EBPO_OK;
    (void)p;
    for (int i = 0; i < ebpo_file_info(file)->level_count && status == EBPO_OK; i++) {
        status = ebpo_file_read_level(file, i, NULL, &level, &error);
        add_level(sum, &level); /* cleared on failure */
        ebpo_level_free(&level);
    }
    return status;
}

static ebpo_status sum_sizes(const ebpo_file *file, pending_source *p, uint64_t *sum)
{
    ebpo_stored_sizes sizes = EBPO_STORED_SIZES_INIT;
    (void)p;
    ebpo_status status = ebpo_file_locate(file, &sizes, &error);
    add(sum, &sizes, sizeof sizes);
    return status;
}

static ebpo_status sum_mesh(const ebpo_file *file, pending_source *p, uint64_t *sum)
{
    ebpo_mesh mesh;
    (void)p;
    ebpo_status status = ebpo_file_read_mesh(file, NULL, &mesh, &error);
    add_mesh(sum, &mesh);
    ebpo_mesh_free(&mesh);
    return status;
}

static ebpo_status sum_source_mesh(const ebpo_file *file, pending_source *p, uint64_t *sum)
{
    ebpo_mesh mesh;
    bool source_order;
    (void)p;
    ebpo_status status = ebpo_file_read_source_mesh(file, NULL, &mesh, &source_order, &error);
    add_mesh(sum, &mesh);
    ebpo_mesh_free(&mesh);
    return status;
}

static ebpo_status sum_tree(const ebpo_file *file, pending_source *p, uint64_t *sum)
{
    ebpo_tree tree;
    (void)p;
    ebpo_status status = ebpo_file_read_tree(file, NULL, &tree, &error);
    for (int i = 0; status == EBPO_OK && i < tree.info.level_count; i++)
        add_level(sum, &tree.level[i]);
    if (status == EBPO_OK)
        add_mesh(sum, &tree.mesh);
    ebpo_tree_free(&tree);
    return status == EBPO_OK ? ebpo_file_check_content(file, NULL, &error) : status;
}

static ebpo_status sum_polygons(const ebpo_file *file, pending_source *p, uint64_t *sum)
{
    ebpo_mesh mesh;
    double volume;
    (void)p;
    ebpo_status status = ebpo_lod_level(file, 3, NULL, &mesh, &volume, &error);
    if (status == EBPO_OK)
        add_mesh(sum, &mesh);
    ebpo_mesh_free(&mesh);
    return status;
}

/* Reads two levels ahead. */
static ebpo_status sum_stream(const ebpo_file *file, pending_source *p, uint64_t *sum)
{
    ebpo_stream *stream;
    ebpo_stream_level level;
    ebpo_stream_node node;
    bool more = true;
    ebpo_status status = ebpo_stream_new(file, NULL, &stream, &error);
    while (status == EBPO_OK && more) {
        ebpo_stream_prefetch(stream, 1);
        do
            status = ebpo_stream_next_level(stream, &level, &more, &error);
        while (again(p, status));
        for (bool another = more; status == EBPO_OK && another;) {
            status = ebpo_stream_next_node(stream, &node, &another, &error);
            add(sum, &node.octcode, sizeof node.octcode);
        }
    }
    ebpo_stream_free(stream);
    return status;
}

static ebpo_status sum_view_of(const ebpo_file *file, pending_source *p, uint64_t *sum,
                               const ebpo_view_options *options)
{
    ebpo_view_stream *stream;
    ebpo_view_node node;
    ebpo_view_faces faces = EBPO_VIEW_FACES_INIT;
    ebpo_view_end end = EBPO_VIEW_NODE;
    ebpo_status status = ebpo_view_stream_new(file, options, &stream, &error);
    while (status == EBPO_OK && end == EBPO_VIEW_NODE) {
        do
            status = ebpo_view_stream_next(stream, &node, &end, &error);
        while (again(p, status));
        if (status != EBPO_OK || end != EBPO_VIEW_NODE)
            break;
        add(sum, &node.node.octcode, sizeof node.node.octcode);
        add(sum, node.node.planes, node.node.plane_count * 32);
        status = options->faces ? ebpo_view_stream_get_faces(stream, &faces) : EBPO_OK;
        add(sum, faces.corners, faces.face_count * sizeof *faces.corners);
    }
    add(sum, &end, sizeof end);
    ebpo_view_stream_free(stream);
    return status;
}

static ebpo_status sum_view(const ebpo_file *file, pending_source *p, uint64_t *sum)
{
    ebpo_observer observer = EBPO_OBSERVER_INIT;
    ebpo_view_options view = EBPO_VIEW_OPTIONS_INIT;
    observer.eye[0] = 4;
    observer.direction[0] = -1;
    observer.up[2] = 1;
    view.observer = &observer;
    view.priority = EBPO_PRIORITY_PIXELS;
    view.planes = view.windings = view.faces = true;
    view.pixels = 12;
    return sum_view_of(file, p, sum, &view);
}

/* A view within a small memory. */
static ebpo_status sum_small_view(const ebpo_file *file, pending_source *p, uint64_t *sum)
{
    ebpo_view_options view = EBPO_VIEW_OPTIONS_INIT;
    view.memory = 1 << 20;
    view.nodes = 20000;
    view.planes = view.faces = true;
    return sum_view_of(file, p, sum, &view);
}

/* A view that ends at a number of bytes of the file. */
static ebpo_status sum_short_view(const ebpo_file *file, pending_source *p, uint64_t *sum)
{
    ebpo_view_options view = EBPO_VIEW_OPTIONS_INIT;
    view.bytes = 60000;
    view.planes = true;
    return sum_view_of(file, p, sum, &view);
}

static ebpo_status sum_subtrees(const ebpo_file *file, pending_source *p, uint64_t *sum)
{
    ebpo_status status = EBPO_OK;
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++) {
        uint64_t found;
        do
            found = subtree_sum(file, 8 | octant, &status);
        while (again(p, status));
        add(sum, &found, sizeof found);
        if (status == EBPO_E_ABSENT)
            status = EBPO_OK;
    }
    return status;
}

static ebpo_status sum_mass(const ebpo_file *file, pending_source *p, uint64_t *sum)
{
    ebpo_mass mass = EBPO_MASS_INIT;
    (void)p;
    ebpo_status status = ebpo_measure(file, 2, &mass, &error);
    add(sum, &mass.volume, sizeof mass.volume);
    add(sum, mass.inertia, sizeof mass.inertia);
    return status;
}

static ebpo_status sum_subset(const ebpo_file *file, pending_source *p, uint64_t *sum)
{
    ebpo_subset_options box = EBPO_SUBSET_OPTIONS_INIT;
    (void)p;
    box.boxed = true;
    for (int k = 0; k < 3; k++) {
        box.min[k] = k ? -0.3 : 2.2;
        box.max[k] = k ? 0.3 : 3;
    }
    ebpo_status status = ebpo_subset(file, scratch("box.ebpo.h5"), &box, &error);
    if (status == EBPO_OK)
        add_file(sum, scratch("box.ebpo.h5"));
    return status;
}

static ebpo_status sum_export(const ebpo_file *file, pending_source *p, uint64_t *sum)
{
    ebpo_export_report report = { .struct_size = sizeof report };
    (void)p;
    ebpo_status status =
        ebpo_export(file, scratch("out.obj"), EBPO_EXPORT_OBJ, NULL, &report, &error);
    if (status == EBPO_OK)
        add_file(sum, scratch("out.obj"));
    return status;
}

static ebpo_status sum_repacked(const ebpo_file *file, pending_source *p, uint64_t *sum)
{
    (void)p;
    ebpo_status status = ebpo_file_repack(file, scratch("repacked.ebpo.h5"), NULL, NULL, &error);
    if (status == EBPO_OK)
        add_file(sum, scratch("repacked.ebpo.h5"));
    return status;
}

static ebpo_status sum_violations(const ebpo_file *file, pending_source *p, uint64_t *sum)
{
    ebpo_verify_report report = { .struct_size = sizeof report };
    (void)p;
    ebpo_status status = ebpo_verify(file, NULL, &report, &error);
    add(sum, &report.violations, sizeof report.violations);
    add(sum, &report.checks, sizeof report.checks);
    return status;
}

static ebpo_status sum_limit(const ebpo_file *file, pending_source *p, uint64_t *sum)
{
    ebpo_limit limit = EBPO_LIMIT_INIT;
    (void)p;
    ebpo_status status = ebpo_limit_level(file, 2, NULL, &limit, &error);
    add(sum, &limit, sizeof limit);
    return status;
}

static const struct {
    const char *name;
    reading_fn call;
} readings[] = {
    { "levels", sum_levels },
    { "sizes", sum_sizes },
    { "mesh", sum_mesh },
    { "source mesh", sum_source_mesh },
    { "tree", sum_tree },
    { "polygons", sum_polygons },
    { "stream", sum_stream },
    { "view", sum_view },
    { "small view", sum_small_view },
    { "short view", sum_short_view },
    { "subtrees", sum_subtrees },
    { "mass", sum_mass },
    { "subset", sum_subset },
    { "export", sum_export },
    { "repacked", sum_repacked },
    { "violations", sum_violations },
    { "limit", sum_limit },
};
enum { READINGS = sizeof readings / sizeof *readings };

static const uint64_t SEED = UINT64_C(14695981039346656037);

/* Calls a function for a remote file that waits for bytes; *waves is the number of round trips. */
static uint64_t call_waiting(reading_fn call, const char *path, uint64_t *waves)
{
    counted_source c;
    uint64_t sum = SEED;
    ebpo_file *file = counted_open(&c, path, true);
    uint64_t opened = c.batches + c.alone;
    ck_assert_msg(call(file, NULL, &sum) == EBPO_OK, "%s", error.message);
    *waves = c.batches + c.alone - opened;
    counted_close(&c, file);
    return sum;
}

/* `memory`: limit for bytes that no operation uses. */
static uint64_t call_pending(reading_fn call, const char *path, uint64_t memory, uint64_t *rounds)
{
    pending_source p;
    uint64_t sum;
    ebpo_status status;
    pending_begin(&p, path, memory);
    ebpo_file *file = pending_open(&p, HEAD);
    uint64_t opened = p.rounds;
    do {
        sum = SEED;
        status = call(file, &p, &sum);
    } while (pending_again(&p, status));
    ck_assert_msg(status == EBPO_OK, "%s", error.message);
    *rounds = p.rounds - opened;
    ebpo_close(file);
    pending_end(&p);
    return sum;
}

/* Each function gives the same results as for a source that waits, in as many round trips. */
START_TEST(test_file_functions_resume)
{
    if (!ebpo_test_wanted(_i))
        return;
    two_layouts l;
    two_layouts_build(&l, ebpo_test_torus(2, 0.7, 100, 60), 8, ALL, EBPO_CODEC_ZSTD, 400);
    for (int packed = 0; packed < 2; packed++) {
        uint64_t waves, rounds, more;
        const char *path = packed ? l.packed : l.plain;
        uint64_t waiting = call_waiting(readings[_i].call, path, &waves),
                 pending = call_pending(readings[_i].call, path, UINT64_MAX, &rounds),
                 short_lived = call_pending(readings[_i].call, path, 0, &more);
        ck_assert_msg(waiting == pending && waiting == short_lived, "%s: results differ",
                      readings[_i].name);
        ck_assert_msg(rounds <= waves, "%s: %d round trips, %d expected", readings[_i].name,
                      (int)rounds, (int)waves);
    }
    two_layouts_close(&l);
}
END_TEST

TEST_SUITE(async)
{
    Suite *suite = suite_create("async");
    TCase *tests = tcase_create("async");
    tcase_set_timeout(tests, 600);
    tcase_add_checked_fixture(tests, scratch_enter, scratch_leave);
    tcase_add_test(tests, test_needed_ranges_are_sorted_and_merged);
    tcase_add_test(tests, test_supplied_bytes_are_read);
    tcase_add_loop_test(tests, test_wrong_supplies_are_rejected, 0, 2);
    tcase_add_test(tests, test_operations_keep_their_bytes);
    tcase_add_loop_test(tests, test_file_functions_resume, 0, READINGS);
    suite_add_tcase(suite, tests);
    return suite;
}
