#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/workspace.h"
#include "geometry/predicates.h"
#include "mesh/mesh_check_parts.h"

enum { FACE_GRAIN = 1 << 14 };

typedef struct face_block {
    ebpo_sum area2, volume6; /* twice the area, six times the volume */
    ebpo_finding zero_area, index_repeated;
} face_block;

typedef struct face_pass {
    const ebpo_check *check;
    face_block *blocks;
    double centre[3];
} face_pass;

/* Root of v. Paths are halved on the way; any thread may do so, as a parent only ever moves towards
 * the root. */
static uint32_t find_root(uint32_t *parents, uint32_t v)
{
    for (;;) {
        uint32_t parent = __atomic_load_n(&parents[v], __ATOMIC_RELAXED);
        if (parent == v)
            return v;
        uint32_t grand = __atomic_load_n(&parents[parent], __ATOMIC_RELAXED);
        if (grand != parent)
            __atomic_compare_exchange_n(&parents[v], &parent, grand, true, __ATOMIC_RELAXED,
                                        __ATOMIC_RELAXED);
        v = grand;
    }
}

/* The higher root goes below the lower one, so there are no cycles; the number of roots is the same
 * in any order. */
static void join(uint32_t *parents, uint32_t a, uint32_t b)
{
    for (;;) {
        a = find_root(parents, a);
        b = find_root(parents, b);
        if (a == b)
            return;
        if (a < b) {
            uint32_t t = a;
            a = b;
            b = t;
        }
        uint32_t expected = a;
        if (__atomic_compare_exchange_n(&parents[a], &expected, b, false, __ATOMIC_RELAXED,
                                        __ATOMIC_RELAXED))
            return;
    }
}

/* True when rounding cannot hide a zero: |ad - bc| against its error bound (Shewchuk
 * 1997, 3.33e-16), and no underflow or overflow. */
static bool surely_nonzero(double a, double b, double c, double d)
{
    double permanent = fabs(a * d) + fabs(b * c);
    return permanent > 1e-280 && permanent < 1e300 && fabs(a * d - b * c) > 1e-15 * permanent;
}

static bool zero_area(const double a[3], const double b[3], const double c[3])
{
    double p[3] = { b[0] - a[0], b[1] - a[1], b[2] - a[2] };
    double q[3] = { c[0] - a[0], c[1] - a[1], c[2] - a[2] };
    if (surely_nonzero(p[0], p[1], q[0], q[1]) || surely_nonzero(p[1], p[2], q[1], q[2]) ||
        surely_nonzero(p[2], p[0], q[2], q[0]))
        return false;
    return ebpo_zero_area(a, b, c);
}

static double cross_length(const ebpo_units *u, const double cross[3])
{
    if (!u->scaled)
        return sqrt(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]);
    const int exponent[3] = { u->exponent[1] + u->exponent[2], u->exponent[2] + u->exponent[0],
                              u->exponent[0] + u->exponent[1] };
    return ebpo_scaled_length(cross, exponent, u->area);
}

static void measure(face_block *block, const ebpo_units *units, const double centre[3],
                    const double a[3], const double cross[3])
{
    ebpo_sum_add(&block->area2, cross_length(units, cross));
    ebpo_sum_add(&block->volume6, (a[0] - centre[0]) * cross[0] + (a[1] - centre[1]) * cross[1] +
                                      (a[2] - centre[2]) * cross[2]);
}

static void note(const ebpo_check *check, unsigned worker, ebpo_finding *finding,
                 ebpo_finding_kind kind, uint64_t face)
{
    ebpo_check_note(check, worker, finding, kind, ebpo_mesh_source_face(check->mesh, face),
                    (uint32_t)face, (uint32_t)face);
}

static ebpo_status faces(void *context, uint64_t begin, uint64_t end, unsigned worker,
                         ebpo_error *error)
{
    (void)error;
    const face_pass *pass = context;
    const ebpo_mesh *mesh = pass->check->mesh;
    uint32_t *parents = pass->check->parents;
    face_block block = { .area2 = { .adds = 0 } };
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, f, begin, end) {
        const uint32_t *v = mesh->faces + 3 * f;
        join(parents, v[0], v[1]);
        join(parents, v[1], v[2]);
        if (ebpo_face_repeats_index(v)) {
            note(pass->check, worker, &block.index_repeated, EBPO_FOUND_INDEX_REPEATED_FACE, f);
            note(pass->check, worker, &block.zero_area, EBPO_FOUND_ZERO_AREA_FACE, f);
            continue;
        }
        double a[3], b[3], c[3], cross[3];
        ebpo_check_position(pass->check, v[0], a);
        ebpo_check_position(pass->check, v[1], b);
        ebpo_check_position(pass->check, v[2], c);
        ebpo_face_cross(a, b, c, cross);
        measure(&block, &pass->check->units, pass->centre, a, cross);
        if (pass->check->units.scaled) { /* the test is exact: on the coordinates themselves */
            ebpo_mesh_position(mesh, v[0], a);
            ebpo_mesh_position(mesh, v[1], b);
            ebpo_mesh_position(mesh, v[2], c);
        }
        if (zero_area(a, b, c))
            note(pass->check, worker, &block.zero_area, EBPO_FOUND_ZERO_AREA_FACE, f);
    }
    pass->blocks[begin / FACE_GRAIN] = block;
    return EBPO_OK;
}

ebpo_status ebpo_check_faces(ebpo_check *check, ebpo_error *error)
{
    ebpo_mesh_report *r = check->report;
    uint64_t count = check->mesh->face_count, blocks = (count + FACE_GRAIN - 1) / FACE_GRAIN;
    face_pass pass = { .check = check, .blocks = ebpo_alloc(blocks, sizeof *pass.blocks) };
    if (!pass.blocks)
        return ebpo_fail_memory(error, blocks * sizeof *pass.blocks);
    for (int k = 0; k < 3; k++)
        pass.centre[k] = ldexp(0.5 * r->min[k] + 0.5 * r->max[k], -check->units.exponent[k]);
    ebpo_status status = ebpo_parallel_for(check->threads, NULL, count, FACE_GRAIN, faces, &pass,
                                           &check->progress, "measuring faces", error);
    ebpo_sum area2 = { .adds = 0 }, volume6 = { .adds = 0 };
    for (uint64_t i = 0; status == EBPO_OK && i < blocks; i++) {
        ebpo_sum_merge(&area2, &pass.blocks[i].area2);
        ebpo_sum_merge(&volume6, &pass.blocks[i].volume6);
        ebpo_finding_merge(&r->zero_area_faces, &pass.blocks[i].zero_area);
        ebpo_finding_merge(&r->index_repeated_faces, &pass.blocks[i].index_repeated);
    }
    r->area = ldexp(ebpo_sum_value(&area2) / 2, check->units.area);
    r->volume = ldexp(ebpo_sum_value(&volume6) / 6, check->units.volume);
    free(pass.blocks);
    return status;
}
