/* Blocks contain the faces of their mesh, bit by bit, read one by one and by the kernels for each
 * processor. An accel takes no more memory than estimated. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "query/accel.h"
#include "check_main.h"
#include "format/chunks.h"
#include "format/slice.h"
#include "query/query_model.h"
#include "query_support.h"
#include "read_blocks.h"

/* --- an accel against its mesh --- */

typedef struct reading {
    const ebpo_accel *s;
    const ebpo_mesh *mesh; /* in file order, or with local indices */
    bool in_file_order;
    uint8_t *seen;    /* flag by local face */
    unsigned largest; /* number of vertices of the largest block */
} reading;

static double coordinate(const ebpo_mesh *mesh, uint64_t face, int corner, int axis)
{
    uint64_t at = 3 * (uint64_t)mesh->faces[3 * face + (uint64_t)corner] + (uint64_t)axis;
    return mesh->xyz64 ? mesh->xyz64[at] : (double)mesh->xyz32[at];
}

static bool same_bits(double a, double b) { return memcmp(&a, &b, sizeof a) == 0; }

static void check_lane(reading *r, uint32_t block, unsigned lane, double base[3][3][EBPO_BLOCK],
                       double avx2[3][3][EBPO_BLOCK])
{
    uint32_t slot = block * EBPO_BLOCK + lane, local = ebpo_accel_slot_face(r->s, slot);
    double t[3][3];
    ck_assert_uint_lt(local, r->s->face_count);
    ck_assert_uint_eq(r->seen[local]++, 0);
    ebpo_accel_triangle(r->s, slot, t);
    uint64_t face = r->in_file_order ? ebpo_accel_file_face(r->s, local) : local;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            ck_assert(same_bits(t[i][k], coordinate(r->mesh, face, i, k)));
            ck_assert(same_bits(base[k][i][lane], t[i][k]));
            ck_assert(same_bits(avx2[k][i][lane], t[i][k]));
        }
}

/* Checks that empty lanes repeat a face, so that bounds of all lanes bound only the faces. */
static void check_idle(const ebpo_accel *s, uint32_t block, unsigned lane,
                       double read[3][3][EBPO_BLOCK])
{
    ck_assert_uint_eq(ebpo_accel_slot_face(s, block * EBPO_BLOCK + lane), EBPO_NO_SLOT);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            ck_assert(same_bits(read[k][i][lane], read[k][i][0]));
}

static void check_block(reading *r, uint32_t block)
{
    const ebpo_meshlet *m = ebpo_accel_meshlet(r->s, block);
    double base[3][3][EBPO_BLOCK], avx2[3][3][EBPO_BLOCK];
    unsigned lanes = read_block_base(r->s, block, base);
    ck_assert_uint_eq(lanes, (1u << m->faces) - 1);
    memcpy(avx2, base, sizeof avx2);
#if defined(HAVE_AVX2)
    if (__builtin_cpu_supports("avx2"))
        ck_assert_uint_eq(read_block_avx2(r->s, block, avx2), lanes);
#endif
    for (unsigned lane = 0; lane < EBPO_BLOCK; lane++) {
        if (lanes >> lane & 1)
            check_lane(r, block, lane, base, avx2);
        else {
            check_idle(r->s, block, lane, base);
            check_idle(r->s, block, lane, avx2);
        }
    }
    r->largest = m->vertices > r->largest ? m->vertices : r->largest;
}

static void check_below(reading *r, uint32_t node)
{
    const ebpo_bound *b = &r->s->bound[node];
    for (int lane = 0; lane < b->count; lane++) {
        if (b->child[lane] & EBPO_IS_BLOCK)
            check_block(r, b->child[lane] & ~EBPO_IS_BLOCK);
        else
            check_below(r, b->child[lane]);
    }
}

/* Returns the vertices of the largest block. */
static unsigned check_accel(const ebpo_accel *s, const ebpo_mesh *mesh, bool in_file_order)
{
    reading r = { .s = s, .mesh = mesh, .in_file_order = in_file_order };
    r.seen = calloc(s->face_count + 1, 1);
    ck_assert_ptr_nonnull(r.seen);
    if (s->bound_count)
        check_below(&r, s->root_bound);
    for (uint32_t i = 0; i < s->face_count; i++)
        ck_assert_uint_eq(r.seen[i], 1);
    free(r.seen);
    return r.largest;
}

static void check_estimate(const ebpo_accel *s, const ebpo_slice_size *size, const ebpo_info *info)
{
    uint64_t keep, peak;
    ebpo_accel_estimate(size, info, &keep, &peak);
    ck_assert_msg(s->bytes <= keep, "%d bytes, %d expected", (int)s->bytes, (int)keep);
    ck_assert_uint_lt(keep, peak);
}

/* --- random meshes: one leaf --- */

enum { FACES = 500 };

/* Makes faces with corners from a moving pool of vertices. The larger the pool, the fewer vertices
 * are shared. */
static ebpo_mesh random_mesh(uint64_t *state, uint32_t pool, bool doubles)
{
    ebpo_mesh mesh = { .vertex_count = FACES / 8 * (pool / 4) + 2 * pool, .face_count = FACES };
    mesh.faces = malloc(3 * FACES * sizeof *mesh.faces);
    mesh.xyz64 = doubles ? malloc(3 * mesh.vertex_count * sizeof *mesh.xyz64) : NULL;
    mesh.xyz32 = doubles ? NULL : malloc(3 * mesh.vertex_count * sizeof *mesh.xyz32);
    for (uint64_t i = 0; i < 3 * mesh.vertex_count; i++) {
        double x = (double)(ebpo_test_random(state) >> 11) * 0x1p-53;
        if (doubles)
            mesh.xyz64[i] = x;
        else
            mesh.xyz32[i] = (float)x;
    }
    for (uint32_t i = 0; i < 3 * FACES; i++)
        mesh.faces[i] = i / 24 * (pool / 4) + (uint32_t)(ebpo_test_random(state) % pool);
    return mesh;
}

static void *copy_of(const void *from, size_t bytes)
{
    return from ? memcpy(malloc(bytes), from, bytes) : NULL;
}

static ebpo_slice one_leaf(const ebpo_mesh *mesh)
{
    ebpo_slice slice = { .root = { .type = EBPO_LEAF },
                         .level_count = 1,
                         .face_count = mesh->face_count,
                         .mesh = *mesh };
    ebpo_level *level = &slice.level[0];
    level->group_count = level->leaf_count = 1;
    level->types = copy_of(&(uint16_t){ EBPO_LEAF }, sizeof *level->types);
    level->leaf_first = calloc(1, sizeof *level->leaf_first);
    level->leaf_new = copy_of(&(uint32_t){ (uint32_t)mesh->face_count }, sizeof *level->leaf_new);
    level->leaf_ref_count = calloc(1, sizeof *level->leaf_ref_count);
    slice.mesh.faces = copy_of(mesh->faces, 3 * mesh->face_count * sizeof *mesh->faces);
    slice.mesh.xyz32 = copy_of(mesh->xyz32, 3 * mesh->vertex_count * sizeof *mesh->xyz32);
    slice.mesh.xyz64 = copy_of(mesh->xyz64, 3 * mesh->vertex_count * sizeof *mesh->xyz64);
    return slice;
}

/* Pool sizes from few vertices for many faces to one vertex for each corner. */
static const uint32_t pools[] = { 4, 6, 8, 9, 12, 17, 24, 1000 };
enum { POOLS = sizeof pools / sizeof pools[0] };

START_TEST(test_blocks_contain_faces_of_random_meshes)
{
    uint64_t state = 77 + (uint64_t)_i;
    bool doubles = _i >= POOLS;
    ebpo_mesh mesh = random_mesh(&state, pools[_i % POOLS], doubles);
    ebpo_info *info = calloc(1, sizeof *info);
    info->box_size[0] = info->box_size[1] = info->box_size[2] = 1;
    info->double_coordinates = doubles;
    ebpo_slice slice = one_leaf(&mesh);
    ebpo_accel *s = NULL;
    ASSERT_OK(ebpo_accel_make(&s, &slice, info, EBPO_ACCEL_NODES, 1, error));
    ck_assert(s->wide == doubles);
    check_estimate(s, &(ebpo_slice_size){ .leaves = 1, .new_faces = FACES }, info);
    unsigned largest = check_accel(s, &mesh, false);
    ck_assert_uint_eq(largest, pools[_i % POOLS] <= 17 ? largest : EBPO_MESHLET_VERTICES);
    ck_assert_uint_le(largest, EBPO_MESHLET_VERTICES);
    ebpo_accel_free(s);
    ebpo_mesh_free(&mesh);
    free(info);
}
END_TEST

/* --- faces so far from their leaf that their squares overflow --- */

/* Checks that each vertex of a child is in its bounding cylinder, as defined in accel.h. */
static void check_cylinder(const ebpo_accel *s, const ebpo_bound *b,
                           const ebpo_bound_cylinder *cylinder, int lane, uint32_t child)
{
    if (!(child & EBPO_IS_BLOCK)) {
        for (int i = 0; i < s->bound[child].count; i++)
            check_cylinder(s, b, cylinder, lane, s->bound[child].child[i]);
        return;
    }
    uint32_t block = child & ~EBPO_IS_BLOCK;
    for (uint32_t slot = 0; slot < ebpo_accel_meshlet(s, block)->faces; slot++) {
        double t[3][3];
        ebpo_accel_triangle(s, block * EBPO_BLOCK + slot, t);
        for (int i = 0; i < 3; i++) {
            double along = 0, square = 0,
                   aside = (double)cylinder->aside_step * cylinder->radius[lane];
            for (int k = 0; k < 3; k++) {
                ebpo_bound_sides side = ebpo_bound_side(b, lane, k);
                double x = (t[i][k] - s->centre[k]) * s->scale - (side.low + side.high) / 2;
                along += x * (cylinder->axis[k][lane] * 0x1p-15);
                square += x * x;
            }
            ck_assert_double_le((double)cylinder->along_step * cylinder->from[lane], along);
            ck_assert_double_ge((double)cylinder->along_step * cylinder->to[lane], along);
            ck_assert_double_le(square - along * along, aside * aside);
        }
    }
}

static void check_cylinders(const ebpo_accel *s)
{
    for (uint64_t n = 0; n < s->bound_count; n++) {
        const ebpo_bound_cylinder *cylinder = &s->cylinder[n];
        ck_assert(isfinite(cylinder->along_step) && isfinite(cylinder->aside_step));
        for (int lane = 0; lane < s->bound[n].count; lane++)
            check_cylinder(s, &s->bound[n], cylinder, lane, s->bound[n].child[lane]);
    }
}

/* Covers files of other programs: the leaf is 1 wide, its faces are up to 10^25 away, and squares
 * in single precision may be at most 10^38. */
START_TEST(test_cylinders_contain_faces_with_overflow)
{
    static const double far[] = { 1, 1e15, 1e25 };
    enum { FARS = sizeof far / sizeof far[0] };
    bool doubles = _i >= FARS;
    uint64_t state = 5 + (uint64_t)_i;
    ebpo_mesh mesh = random_mesh(&state, 24, doubles);
    for (uint64_t i = 0; i < 3 * mesh.vertex_count; i++)
        if (doubles)
            mesh.xyz64[i] *= far[_i % FARS];
        else
            mesh.xyz32[i] *= (float)far[_i % FARS];
    ebpo_info *info = calloc(1, sizeof *info);
    info->box_size[0] = info->box_size[1] = info->box_size[2] = 1;
    info->double_coordinates = doubles;
    ebpo_slice slice = one_leaf(&mesh);
    ebpo_accel *s = NULL;
    ASSERT_OK(ebpo_accel_make(&s, &slice, info, EBPO_ACCEL_NODES, 1, error));
    check_cylinders(s);
    ebpo_accel_free(s);
    ebpo_mesh_free(&mesh);
    free(info);
}
END_TEST

/* --- 512 leaves with one face and with nine in turn: hardly any two share a block --- */

enum { LEVELS = 4, LEAVES = 512, NINES = LEAVES / 2 * 10 };

/* Makes a mesh whose faces share no vertices. */
static ebpo_mesh spread_mesh(bool doubles)
{
    ebpo_mesh mesh = { .vertex_count = 3 * NINES, .face_count = NINES };
    mesh.faces = malloc(3 * NINES * sizeof *mesh.faces);
    mesh.xyz64 = doubles ? calloc(3 * mesh.vertex_count, sizeof *mesh.xyz64) : NULL;
    mesh.xyz32 = doubles ? NULL : calloc(3 * mesh.vertex_count, sizeof *mesh.xyz32);
    for (uint32_t i = 0; i < 3 * NINES; i++)
        mesh.faces[i] = i;
    return mesh;
}

static ebpo_slice spread_leaves(bool doubles)
{
    ebpo_slice slice = { .root = { .cell.level = 1, .type = EBPO_GRAY },
                         .level_count = LEVELS,
                         .face_count = NINES,
                         .mesh = spread_mesh(doubles) };
    for (int depth = 0; depth < LEVELS; depth++) {
        ebpo_level *level = &slice.level[depth];
        uint64_t nodes = UINT64_C(1) << 3 * depth;
        bool deepest = depth == LEVELS - 1;
        level->group_count = depth ? nodes / 8 : 1;
        *(deepest ? &level->leaf_count : &level->gray_count) = nodes;
        level->types = calloc(level->group_count, sizeof *level->types);
        for (uint64_t i = 0; i < level->group_count; i++)
            for (int octant = 0; octant < (depth ? 8 : 1); octant++)
                level->types[i] |= (uint16_t)((deepest ? EBPO_LEAF : EBPO_GRAY) << 2 * octant);
    }
    ebpo_level *last = &slice.level[LEVELS - 1];
    last->leaf_first = calloc(LEAVES, sizeof *last->leaf_first);
    last->leaf_new = calloc(LEAVES, sizeof *last->leaf_new);
    last->leaf_ref_count = calloc(LEAVES, sizeof *last->leaf_ref_count);
    for (uint64_t i = 0; i < LEAVES; i++) {
        last->leaf_first[i] = (i + 1) / 2 + i / 2 * 9;
        last->leaf_new[i] = i % 2 ? 9 : 1;
    }
    return slice;
}

START_TEST(test_block_memory_stays_below_estimate)
{
    ebpo_info *info = calloc(1, sizeof *info);
    info->box_size[0] = info->box_size[1] = info->box_size[2] = 1;
    info->double_coordinates = _i;
    info->solid = true;
    ebpo_slice slice = spread_leaves(_i);
    ebpo_accel *s = NULL;
    ASSERT_OK(ebpo_accel_make(&s, &slice, info, EBPO_ACCEL_NODES, 1, error));
    ck_assert_uint_eq(s->list_count, LEAVES / 2 * 3);
    check_estimate(s,
                   &(ebpo_slice_size){ .groups = 1 + 8 + 64, .leaves = LEAVES, .new_faces = NINES },
                   info);
    ebpo_accel_free(s);
    free(info);
}
END_TEST

/* --- files, whole and subtree by subtree --- */

static void check_subtree(const query_model *m, const ebpo_node *root)
{
    ebpo_chunks *chunks;
    ebpo_slice slice;
    ebpo_accel *s = NULL;
    ASSERT_OK(ebpo_chunks_make(&chunks, m->file, 1 << 20, error));
    ebpo_slice_size size;
    ASSERT_OK(ebpo_slice_measure(chunks, root, &size, error));
    ASSERT_OK(ebpo_slice_read(&slice, chunks, root, error));
    ASSERT_OK(ebpo_accel_make(&s, &slice, &m->info, EBPO_ACCEL_PLANES, 1, error));
    check_accel(s, &m->mesh, true);
    check_estimate(s, &size, &m->info);
    ebpo_accel_free(s);
    ebpo_chunks_free(chunks);
}

START_TEST(test_blocks_contain_faces_of_files)
{
    query_model m;
    query_model_make(&m, query_solid_name(_i), query_solid_make(_i),
                     &query_variants[_i % query_variant_count]);
    check_accel(m.model->whole, &m.mesh, true);
    for (uint64_t i = 0; m.info.max_level > 0 && i < m.info.level[1].gray_count; i++)
        check_subtree(&m, &(ebpo_node){ .cell.level = 1, .type = EBPO_GRAY, .rank = i });
    for (uint64_t i = 0; m.info.max_level > 0 && i < m.info.level[1].leaf_count; i++)
        check_subtree(&m, &(ebpo_node){ .cell.level = 1, .type = EBPO_LEAF, .rank = i });
    query_model_free(&m);
}
END_TEST

Suite *test_suite(void)
{
    Suite *suite = suite_create("blocks");
    TCase *blocks = tcase_create("blocks");
    tcase_set_timeout(blocks, 600);
    tcase_add_loop_test(blocks, test_blocks_contain_faces_of_random_meshes, 0, 2 * POOLS);
    tcase_add_loop_test(blocks, test_cylinders_contain_faces_with_overflow, 0, 6);
    tcase_add_loop_test(blocks, test_block_memory_stays_below_estimate, 0, 2);
    tcase_add_loop_test(blocks, test_blocks_contain_faces_of_files, 0, query_solid_count());
    suite_add_tcase(suite, blocks);
    return suite;
}
