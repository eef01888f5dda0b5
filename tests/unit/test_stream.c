/* Reads levels in order: the nodes are those of the tree read at once; planes contain the
 * half-spaces of their codes (proved with rationals); polygons are closed; and volumes agree. */
#include <gmp.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <ebpo/ebpo.h>
#include <ebpo/stream.h>

#include "check_main.h"
#include "model_file.h"
#include "read_by.h"
#include "geometry/polytope.h"
#include "geometry/cells.h"
#include "scratch.h"
#include "solids.h"
#include "levels/stream.h"

static const char *path;

static void make_folder(void)
{
    scratch_enter();
    path = scratch("x.ebpo.h5");
}

enum { DEFAULT = EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS };

static void write_file(ebpo_mesh mesh, uint32_t parts, uint32_t leaf_faces)
{
    ebpo_tree tree = model_build_parts(mesh, leaf_faces, parts);
    model_write(&tree, path, NULL);
}

static ebpo_file *build(ebpo_mesh mesh, uint32_t parts, uint32_t leaf_faces)
{
    write_file(mesh, parts, leaf_faces);
    return model_open(path);
}

static ebpo_stream *new_stream(ebpo_file *file, bool planes, bool polygons, unsigned threads)
{
    ebpo_stream_options options = { sizeof(ebpo_stream_options), planes, polygons, threads };
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_stream *stream = NULL;
    ck_assert_msg(ebpo_stream_new(file, &options, &stream, &error) == EBPO_OK, "%s", error.message);
    return stream;
}

static bool next_level(ebpo_stream *stream, ebpo_stream_level *level)
{
    bool more = false;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_msg(ebpo_stream_next_level(stream, level, &more, &error) == EBPO_OK, "%s",
                  error.message);
    return more;
}

static bool next_node(ebpo_stream *stream, ebpo_stream_node *node)
{
    bool more = false;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_msg(ebpo_stream_next_node(stream, node, &more, &error) == EBPO_OK, "%s",
                  error.message);
    return more;
}

static ebpo_box box_of(const ebpo_info *info)
{
    ebpo_box box = { .grid_level = info->grid_level };
    memcpy(box.origin, info->box_origin, sizeof box.origin);
    memcpy(box.size, info->box_size, sizeof box.size);
    return box;
}

/* --- equal to the tree --- */

static int32_t winding_in(const ebpo_level *level, ebpo_node_type type, uint64_t rank)
{
    switch (type) {
    case EBPO_WHITE: return level->white_winding ? level->white_winding[rank] : 0;
    case EBPO_BLACK: return level->black_winding ? level->black_winding[rank] : 1;
    case EBPO_LEAF: return level->leaf_winding ? level->leaf_winding[rank] : 0;
    default: return 0;
    }
}

static uint64_t planes_in(const ebpo_level *level, ebpo_node_type type, uint64_t rank)
{
    if (type == EBPO_GRAY && level->plane_counts)
        return level->plane_counts[rank];
    return type == EBPO_LEAF && level->leaf_plane_counts ? level->leaf_plane_counts[rank] : 0;
}

/* Compares one level with the tree; `parents`: octcodes of the gray nodes of the previous level,
 * replaced by those of this level. */
static void expect_level(ebpo_stream *stream, const ebpo_tree *tree, int number, uint64_t **parents,
                         uint64_t *parent_count, bool planes)
{
    const ebpo_level *level = &tree->level[number];
    ebpo_box box = box_of(&tree->info);
    uint64_t *grays = malloc((level->gray_count + 1) * sizeof *grays), rank[4] = { 0 };
    ebpo_stream_node node;
    for (uint64_t g = 0; g < *parent_count; g++)
        for (unsigned k = 0; k < (number ? 8 : 1); k++) {
            uint64_t octcode = number ? (*parents)[g] << 3 | k : 1;
            ebpo_node_type type = (ebpo_node_type)(level->types[g] >> 2 * k & 3);
            ebpo_cell cell = ebpo_cell_of_octcode(octcode);
            ck_assert(next_node(stream, &node));
            ck_assert_uint_eq(node.octcode, octcode);
            ck_assert_int_eq(node.type, type);
            ck_assert_int_eq(node.winding, winding_in(level, type, rank[type]));
            ck_assert_uint_eq(node.plane_count, planes ? planes_in(level, type, rank[type]) : 0);
            for (int i = 0; i < 3; i++)
                ck_assert(node.min[i] == ebpo_cell_face(&box, i, number, cell.at[i]) &&
                          node.max[i] == ebpo_cell_face(&box, i, number, cell.at[i] + 1));
            if (type == EBPO_GRAY)
                grays[rank[type]] = octcode;
            rank[type]++;
        }
    ck_assert(!next_node(stream, &node));
    ck_assert_uint_eq(rank[EBPO_GRAY], level->gray_count);
    free(*parents);
    *parents = grays;
    *parent_count = level->gray_count;
}

static void expect_tree(ebpo_file *file, bool planes, bool polygons)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_tree tree;
    ck_assert_msg(ebpo_file_read_tree(file, NULL, &tree, &error) == EBPO_OK, "%s", error.message);
    ebpo_stream *stream = new_stream(file, planes, polygons, 2);
    ebpo_stored_sizes stored = EBPO_STORED_SIZES_INIT;
    ck_assert_int_eq(ebpo_file_locate(file, &stored, NULL), EBPO_OK);
    ebpo_stream_level level;
    uint64_t *parents = NULL, parent_count = 1, bytes = tree.info.head_bytes;
    int number = 0;
    for (; next_level(stream, &level); number++) {
        ck_assert_int_eq(level.level, number);
        ck_assert_uint_eq(level.node_count, number ? 8 * parent_count : 1);
        bytes += stored.level_bytes[number] +
                 (number == tree.info.index_level ? tree.info.chunk_index_bytes : 0);
        ck_assert_uint_eq(level.cumulative_bytes, bytes);
        expect_level(stream, &tree, number, &parents, &parent_count, planes || polygons);
    }
    ck_assert_int_eq(number, tree.info.level_count);
    ck_assert(!next_level(stream, &level));
    free(parents);
    ebpo_stream_free(stream);
    ebpo_tree_free(&tree);
}

START_TEST(test_streamed_levels_match_whole_tree)
{
    if (!ebpo_test_wanted(_i))
        return;
    for (int variant = 0; variant < 3; variant++) {
        ebpo_file *file = build(ebpo_test_solids[_i].make(),
                                variant == 0   ? DEFAULT
                                : variant == 1 ? DEFAULT | EBPO_PART_LEAF_PLANES
                                               : EBPO_PART_MESH,
                                4);
        expect_tree(file, variant == 0, variant == 1);
        expect_tree(file, false, false);
        ebpo_close(file);
    }
}
END_TEST

START_TEST(test_stream_resumes_at_next_level)
{
    ebpo_file *file = build(ebpo_test_make("torus"), DEFAULT | EBPO_PART_LEAF_PLANES, 2);
    ebpo_stream *whole = new_stream(file, true, true, 1), *some = new_stream(file, true, true, 3);
    ebpo_stream_level a, b;
    ebpo_stream_node p, q;
    bool more = true;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_int_eq(ebpo_stream_next_node(whole, &p, &more, &error), EBPO_E_ARGUMENT);
    ck_assert(!more && strstr(error.message, "ebpo_stream_next_level"));
    while (next_level(whole, &a)) {
        ck_assert(next_level(some, &b));
        /* for any number of threads */
        ck_assert(a.volume == b.volume && a.node_count == b.node_count);
        for (uint64_t i = 0; next_node(whole, &p); i++)
            if (i < a.node_count / 2) {
                ck_assert(next_node(some, &q));
                ck_assert(p.octcode == q.octcode && p.volume == q.volume &&
                          p.vertex_count == q.vertex_count && p.plane_count == q.plane_count);
                ck_assert(p.vertex_count == 0 ||
                          memcmp(p.vertices, q.vertices, p.vertex_count * sizeof *p.vertices) == 0);
                ck_assert(p.plane_count == 0 ||
                          memcmp(p.planes, q.planes, p.plane_count * sizeof *p.planes) == 0);
            }
    }
    ck_assert(!next_level(some, &b));
    ebpo_stream_free(whole);
    ebpo_stream_free(some);
    ebpo_stream_free(NULL);
    ebpo_close(file);
}
END_TEST

/* --- reads --- */

typedef struct memory {
    uint8_t *data;
    bool failing;
} memory;

static ebpo_status read_memory(void *user, uint64_t offset, uint64_t size, void *data,
                               ebpo_error *error)
{
    memory *m = user;
    if (m->failing) {
        error->status = EBPO_E_IO;
        strcpy(error->message, "the line is down");
        return EBPO_E_IO;
    }
    memcpy(data, m->data + offset, size);
    return EBPO_OK;
}

static ebpo_file *open_memory(memory *m)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    FILE *f = fopen(path, "rb");
    fseek(f, 0, SEEK_END);
    size_t size = (size_t)ftell(f);
    rewind(f);
    m->data = malloc(size);
    ck_assert_uint_eq(fread(m->data, 1, size, f), size);
    fclose(f);
    ebpo_source source = {
        .struct_size = sizeof(ebpo_source), .user = m, .size = size, .read = read_memory
    };
    ck_assert_msg(ebpo_open_source(&source, "memory", &file, &error) == EBPO_OK, "%s",
                  error.message);
    return file;
}

START_TEST(test_stream_reads_only_requested_level)
{
    memory m = { NULL, false };
    write_file(ebpo_test_make("torus"), DEFAULT, 2);
    ebpo_file *file = open_memory(&m);
    ebpo_stream *stream = new_stream(file, true, true, 1);
    const ebpo_info *info = ebpo_file_info(file);
    ebpo_stream_level level;
    ebpo_stream_node node;
    ebpo_stored_sizes stored = EBPO_STORED_SIZES_INIT;
    ck_assert_int_eq(ebpo_file_locate(file, &stored, NULL), EBPO_OK);
    uint64_t before, after;
    for (int i = 0; i < info->level_count; i++) {
        before = ebpo_test_file_stats(file).bytes_read;
        ck_assert(next_level(stream, &level));
        while (next_node(stream, &node))
            ;
        after = ebpo_test_file_stats(file).bytes_read;
        /* the list of chunk checksums is read with the first chunk */
        ck_assert_uint_le(after - before, stored.level_bytes[i] + (i ? 0 : stored.checksum_bytes));
    }
    ebpo_stream_free(stream);
    ebpo_close(file);
    free(m.data);
}
END_TEST

START_TEST(test_stream_retries_failed_level)
{
    memory m = { NULL, false };
    write_file(ebpo_test_make("torus"), DEFAULT, 2);
    ebpo_file *file = open_memory(&m);
    ebpo_stream *stream = new_stream(file, true, true, 1);
    ebpo_stream_level level;
    ebpo_stream_node node;
    ck_assert(next_level(stream, &level) && next_level(stream, &level));
    bool more = true;
    ebpo_error error = EBPO_ERROR_INIT;
    m.failing = true;
    ck_assert_int_eq(ebpo_stream_next_level(stream, &level, &more, &error), EBPO_E_IO);
    ck_assert(!more && strstr(error.message, "the line is down"));
    ck_assert(next_node(stream, &node));
    ck_assert_uint_eq(node.octcode, 8);
    m.failing = false;
    ck_assert(next_level(stream, &level));
    ck_assert_int_eq(level.level, 2);
    ebpo_stream_free(stream);
    ebpo_close(file);
    free(m.data);
}
END_TEST

/* --- volumes and polygons --- */

static void expect_closed(const ebpo_stream_node *node)
{
    static int8_t edge[192][192];
    memset(edge, 0, sizeof edge);
    for (uint32_t f = 0; f < node->polygon_count; f++) {
        uint32_t first = node->polygon_first[f], count = node->polygon_first[f + 1] - first;
        ck_assert_uint_ge(count, 3);
        for (uint32_t i = 0; i < count; i++) {
            uint32_t a = node->corners[first + i], b = node->corners[first + (i + 1) % count];
            ck_assert(a < node->vertex_count && b < node->vertex_count);
            ck_assert_int_eq(edge[a][b]++, 0);
        }
    }
    bool closed = true, within = true;
    for (uint32_t a = 0; a < node->vertex_count; a++)
        for (uint32_t b = 0; b < node->vertex_count; b++)
            closed &= edge[a][b] == edge[b][a];
    for (uint32_t v = 0; v < node->vertex_count; v++)
        for (int k = 0; k < 3; k++)
            within &= node->vertices[v][k] >= node->min[k] && node->vertices[v][k] <= node->max[k];
    ck_assert(closed && within);
}

/* Computes a volume relative to the lowest corner of the cell, so that little cancels. */
static double polygon_volume(const ebpo_stream_node *node)
{
    double sum = 0;
    for (uint32_t f = 0; f < node->polygon_count; f++)
        for (uint32_t i = node->polygon_first[f] + 1; i + 1 < node->polygon_first[f + 1]; i++) {
            double p[3][3];
            uint32_t corner[3] = { node->corners[node->polygon_first[f]], node->corners[i],
                                   node->corners[i + 1] };
            for (int j = 0; j < 3; j++)
                for (int k = 0; k < 3; k++)
                    p[j][k] = node->vertices[corner[j]][k] - node->min[k];
            sum += p[0][0] * (p[1][1] * p[2][2] - p[1][2] * p[2][1]) +
                   p[0][1] * (p[1][2] * p[2][0] - p[1][0] * p[2][2]) +
                   p[0][2] * (p[1][0] * p[2][1] - p[1][1] * p[2][0]);
        }
    return sum / 6;
}

static void expect_volumes(ebpo_file *file, bool stored_leaves)
{
    const ebpo_info *info = ebpo_file_info(file);
    ebpo_stream *stream = new_stream(file, true, true, 0),
                *plain = new_stream(file, false, false, 0);
    ebpo_stream_level level, reported;
    ebpo_stream_node node;
    double settled = 0, space = info->box_size[0] * info->box_size[1] * info->box_size[2];
    while (next_level(stream, &level)) {
        double gray = 0, lod = -1, cell = ldexp(space, -3 * level.level);
        ebpo_error error = EBPO_ERROR_INIT;
        while (next_node(stream, &node)) {
            *(node.type == EBPO_GRAY ? &gray : &settled) += node.volume;
            if (node.type == EBPO_WHITE) {
                ck_assert(node.volume == 0 && node.vertex_count == 0 && node.polygon_count == 0);
                continue;
            }
            expect_closed(&node);
            double away = 1e-9; /* vertices far from the origin have greater rounding errors */
            for (int k = 0; k < 3; k++)
                away += 1e-14 * fabs(node.max[k]) / (node.max[k] - node.min[k]);
            ck_assert_double_eq_tol(polygon_volume(&node) / cell, node.volume / cell, away);
        }
        double stated = info->level[level.level].gray_volume;
        ck_assert_msg(fabs(gray - stated) <= 1e-7 * stated + 1e-12 * space,
                      "level %d: %.17g, stated %.17g", level.level, gray, stated);
        ck_assert_double_eq_tol(level.volume / space, (gray + settled) / space, 1e-12);
        ck_assert(next_level(plain, &reported));
        ck_assert_double_eq_tol(level.volume / space, reported.volume / space, 1e-6);
        ck_assert(ebpo_lod_level(file, level.level, NULL, NULL, &lod, &error) == EBPO_OK);
        ck_assert_double_le(lod / space, reported.volume / space + 1e-6);
        if (stored_leaves)
            ck_assert_double_eq_tol(level.volume / space, lod / space, 1e-12);
    }
    ebpo_stream_free(stream);
    ebpo_stream_free(plain);
}

START_TEST(test_streamed_volumes_and_polygons_match_file)
{
    if (!ebpo_test_wanted(_i))
        return;
    for (int variant = 0; variant < 2; variant++) {
        ebpo_file *file = build(ebpo_test_solids[_i].make(),
                                variant ? DEFAULT | EBPO_PART_LEAF_PLANES : DEFAULT, 4);
        expect_volumes(file, variant == 1);
        ebpo_close(file);
    }
}
END_TEST

/* --- planes, exactly --- */

static void set_cross(mpq_t out, const double a[3], mpq_t p[3])
{
    mpq_t t;
    mpq_init(t);
    mpq_set_ui(out, 0, 1);
    for (int k = 0; k < 3; k++) {
        mpq_set_d(t, a[k]);
        mpq_mul(t, t, p[k]);
        mpq_add(out, out, t);
    }
    mpq_clear(t);
}

/* out = n . xi - d / 4096 at a point of the unit cube */
static void set_excess(mpq_t out, const int32_t n[3], int32_t d, mpq_t xi[3])
{
    mpq_t t;
    mpq_init(t);
    mpq_set_si(out, -d, 4096);
    mpq_canonicalize(out);
    for (int k = 0; k < 3; k++) {
        mpq_set_si(t, n[k], 1);
        mpq_mul(t, t, xi[k]);
        mpq_add(out, out, t);
    }
    mpq_clear(t);
}

typedef struct exact {
    mpq_t xi[3], p[3], value, side, limit, most;
    double plane[4];
    const ebpo_box *box;
    ebpo_cell cell;
    int checked;
} exact;

/* Checks that the point xi of the cell satisfies the plane. */
static void check_point(exact *e)
{
    for (int k = 0; k < 3; k++) {
        mpq_set_d(e->side, ebpo_cell_face(e->box, k, e->cell.level, e->cell.at[k] + 1));
        mpq_set_d(e->value, ebpo_cell_face(e->box, k, e->cell.level, e->cell.at[k]));
        mpq_sub(e->side, e->side, e->value);
        mpq_mul(e->p[k], e->side, e->xi[k]);
        mpq_add(e->p[k], e->p[k], e->value);
    }
    set_cross(e->value, e->plane, e->p);
    ck_assert_msg(mpq_cmp(e->value, e->limit) <= 0,
                  "the plane cuts off a point that the code keeps");
    if (!e->checked++ || mpq_cmp(e->value, e->most) > 0)
        mpq_set(e->most, e->value);
}

/* Checks the extreme points of the cell within the half-space of the code: its corners inside, and
 * the intersections of its edges with the plane. */
static void check_code(exact *e, const int32_t n[3], int32_t d)
{
    mpq_t at_low, at_high;
    mpq_inits(at_low, at_high, NULL);
    e->checked = 0;
    for (int corner = 0; corner < 8; corner++)
        for (int axis = 0; axis < 3; axis++) {
            if (corner >> axis & 1)
                continue;
            for (int k = 0; k < 3; k++)
                mpq_set_si(e->xi[k], corner >> k & 1, 1);
            set_excess(at_low, n, d, e->xi);
            if (mpq_sgn(at_low) <= 0)
                check_point(e);
            mpq_set_si(e->xi[axis], 1, 1);
            set_excess(at_high, n, d, e->xi);
            if (mpq_sgn(at_high) <= 0)
                check_point(e);
            if (mpq_sgn(at_low) * mpq_sgn(at_high) >= 0)
                continue;
            mpq_sub(e->xi[axis], at_low, at_high);
            mpq_div(e->xi[axis], at_low, e->xi[axis]);
            check_point(e);
        }
    mpq_clears(at_low, at_high, NULL);
}

static ebpo_box random_box(uint64_t *random)
{
    double low[3], high[3];
    ebpo_box box;
    bool flat = ebpo_test_random(random) % 4 == 0, far = ebpo_test_random(random) % 4 == 0,
         tiny = ebpo_test_random(random) % 8 == 0;
    for (int k = 0; k < 3; k++) {
        low[k] = (ebpo_test_random_unit(random) - 0.5) * (far ? 1e7 : 10) * (tiny ? 1e-290 : 1);
        high[k] = low[k] + (0.1 + ebpo_test_random_unit(random)) * (flat && k == 1 ? 1e-6 : 1) *
                               (tiny ? 1e-290 : 1);
    }
    ck_assert(ebpo_box_make(&box, low, high, 20));
    return box;
}

START_TEST(test_streamed_planes_match_their_codes)
{
    uint64_t random = 7 + (uint64_t)_i;
    exact e;
    mpq_inits(e.xi[0], e.xi[1], e.xi[2], e.p[0], e.p[1], e.p[2], e.value, e.side, e.limit, e.most,
              NULL);
    for (int i = 0; i < 4000; i++) {
        ebpo_box box = random_box(&random);
        int level = (int)(ebpo_test_random(&random) % (uint64_t)(box.grid_level + 1));
        e.cell = (ebpo_cell){ level, { 0, 0, 0 } };
        for (int k = 0; k < 3; k++)
            e.cell.at[k] = (uint32_t)(ebpo_test_random(&random) & ((1u << level) - 1));
        e.box = &box;
        int32_t n[3], d;
        if (!ebpo_plane_decode((uint32_t)ebpo_test_random(&random), n, &d))
            continue;
        ebpo_plane_to_world(&box, e.cell, n, d, e.plane);
        mpq_set_d(e.limit, e.plane[3]);
        check_code(&e, n, d);
        double length = sqrt(e.plane[0] * e.plane[0] + e.plane[1] * e.plane[1] +
                             e.plane[2] * e.plane[2]),
               reach = 0;
        ck_assert_double_eq_tol(length, 1, 1e-15);
        for (int k = 0; k < 3; k++)
            reach += fabs(e.plane[k]) * (fabs(ebpo_cell_face(&box, k, level, e.cell.at[k])) +
                                         box.size[k] / (double)(1u << level));
        mpq_sub(e.value, e.limit, e.most);
        ck_assert_msg(mpq_get_d(e.value) <= 1e-14 * reach + 1e-300, "%g of %g too wide",
                      mpq_get_d(e.value), reach);
    }
    mpq_clears(e.xi[0], e.xi[1], e.xi[2], e.p[0], e.p[1], e.p[2], e.value, e.side, e.limit, e.most,
               NULL);
}
END_TEST

/* --- the solid is within --- */

/* Returns the number of used vertices. Vertices that no face uses come last and need not be inside
 * an envelope. */
static uint64_t used_vertices(const ebpo_mesh *mesh)
{
    uint64_t used = 0;
    for (uint64_t i = 0; i < 3 * mesh->face_count; i++)
        used = mesh->faces[i] >= used ? (uint64_t)mesh->faces[i] + 1 : used;
    return used;
}

static bool satisfies(const ebpo_stream_node *node, const double p[3])
{
    for (uint32_t i = 0; i < node->plane_count; i++) {
        const double *a = node->planes[i];
        if (a[0] * p[0] + a[1] * p[1] + a[2] * p[2] > a[3] ||
            a[2] * p[2] + a[1] * p[1] + a[0] * p[0] > a[3])
            return false;
    }
    return true;
}

static void vertex(const ebpo_mesh *mesh, uint64_t v, double p[3])
{
    for (uint64_t k = 0; k < 3; k++)
        p[k] = mesh->xyz32 ? (double)mesh->xyz32[3 * v + k] : mesh->xyz64[3 * v + k];
}

static bool in_cell(const ebpo_stream_node *node, const double p[3])
{
    bool in = true;
    for (int k = 0; k < 3; k++)
        in &= p[k] >= node->min[k] && p[k] <= node->max[k];
    return in;
}

START_TEST(test_closed_cell_vertices_satisfy_planes)
{
    if (!ebpo_test_wanted(_i))
        return;
    ebpo_file *file = build(ebpo_test_solids[_i].make(), DEFAULT | EBPO_PART_LEAF_PLANES, 4);
    ebpo_stream *stream = new_stream(file, true, false, 1);
    ebpo_stream_level level;
    ebpo_stream_node node;
    ebpo_mesh mesh;
    ck_assert(ebpo_file_read_mesh(file, READ_BY(1), &mesh, NULL) == EBPO_OK);
    uint64_t count = used_vertices(&mesh), step = 1 + count / 2000;
    while (next_level(stream, &level) && level.node_count < 20000)
        while (next_node(stream, &node))
            for (uint64_t v = 0; v < count && node.plane_count; v += step) {
                double p[3];
                vertex(&mesh, v, p);
                ck_assert(!in_cell(&node, p) || satisfies(&node, p));
            }
    ebpo_mesh_free(&mesh);
    ebpo_stream_free(stream);
    ebpo_close(file);
}
END_TEST

typedef struct placed {
    uint64_t octcode, vertex;
} placed;

static int by_octcode(const void *a, const void *b)
{
    const placed *p = a, *q = b;
    return (p->octcode > q->octcode) - (p->octcode < q->octcode);
}

/* Sorts the vertices by their cell of `level`. A cell contains its lower faces. */
static void place(placed *list, const ebpo_mesh *mesh, uint64_t count, const ebpo_box *box,
                  int level)
{
    for (uint64_t v = 0; v < count; v++) {
        ebpo_cell cell = { level, { 0, 0, 0 } };
        double p[3];
        vertex(mesh, v, p);
        for (int k = 0; k < 3; k++)
            for (uint32_t bit = 1u << level >> 1; bit; bit >>= 1)
                cell.at[k] |= p[k] >= ebpo_cell_face(box, k, level, cell.at[k] | bit) ? bit : 0;
        list[v] = (placed){ ebpo_octcode_of_cell(cell), v };
    }
    qsort(list, count, sizeof *list, by_octcode);
}

static void expect_vertices_within(ebpo_file *file)
{
    ebpo_stream *stream = new_stream(file, true, false, 0);
    ebpo_box box = box_of(ebpo_file_info(file));
    ebpo_stream_level level;
    ebpo_stream_node node;
    ebpo_mesh mesh;
    ck_assert(ebpo_file_read_mesh(file, NULL, &mesh, NULL) == EBPO_OK);
    uint64_t count = used_vertices(&mesh);
    placed *list = malloc(count * sizeof *list);
    uint64_t checked = 0, planes = 0;
    while (next_level(stream, &level)) {
        place(list, &mesh, count, &box, level.level);
        uint64_t at = 0;
        while (next_node(stream, &node)) {
            while (at < count && list[at].octcode < node.octcode)
                at++;
            for (; at < count && list[at].octcode == node.octcode; at++) {
                double p[3];
                vertex(&mesh, list[at].vertex, p);
                ck_assert_int_ge(node.type, EBPO_LEAF);
                ck_assert_msg(satisfies(&node, p), "level %d: vertex %llu", level.level,
                              (unsigned long long)list[at].vertex);
                checked++;
                planes += node.plane_count;
            }
        }
    }
    ck_assert_uint_gt(checked, count);
    ck_assert_uint_gt(planes, checked);
    free(list);
    ebpo_mesh_free(&mesh);
    ebpo_stream_free(stream);
}

START_TEST(test_real_models_are_inside_streamed_planes)
{
    static const char *const names[] = { "armadillo.ply", "bunny.ply" };
    const char *models = getenv("EBPO_MODELS");
    ebpo_mesh mesh;
    char name[4096];
    snprintf(name, sizeof name, "%s/%s", models ? models : "", names[_i]);
    if (ebpo_test_scale() < 1 && _i == 0)
        return; /* only the smaller one */
    if (!models || ebpo_mesh_read(name, NULL, &mesh, NULL) != EBPO_OK)
        return;
    ebpo_file *file = build(mesh, DEFAULT | EBPO_PART_LEAF_PLANES, 16);
    expect_vertices_within(file);
    expect_volumes(file, true);
    ebpo_close(file);
}
END_TEST

TEST_SUITE(stream)
{
    Suite *suite = suite_create("stream");
    TCase *tests = tcase_create("stream");
    tcase_set_timeout(tests, 900);
    tcase_add_checked_fixture(tests, make_folder, scratch_leave);
    tcase_add_loop_test(tests, test_streamed_levels_match_whole_tree, 0, ebpo_test_solid_count);
    tcase_add_test(tests, test_stream_resumes_at_next_level);
    tcase_add_test(tests, test_stream_reads_only_requested_level);
    tcase_add_test(tests, test_stream_retries_failed_level);
    tcase_add_loop_test(tests, test_streamed_volumes_and_polygons_match_file, 0,
                        ebpo_test_solid_count);
    tcase_add_loop_test(tests, test_streamed_planes_match_their_codes, 0, 4);
    tcase_add_loop_test(tests, test_closed_cell_vertices_satisfy_planes, 0, ebpo_test_solid_count);
    tcase_add_loop_test(tests, test_real_models_are_inside_streamed_planes, 0, 2);
    suite_add_tcase(suite, tests);
    return suite;
}
