/* Computes area, volume, centroid and inertia as integrals over the faces (divergence theorem).
 * Each face and the middle of the model span a tetrahedron, whose moments are polynomials in its
 * corners. For corners a, b, c relative to the middle, with det = a . (b x c) and s = a + b + c:
 *   volume          det / 6
 *   first moments   det s / 24
 *   second moments  det (s s' + a a' + b b' + c c') / 120
 * All values are in double-double arithmetic, on coordinates scaled by a power of two to about 1.
 * They are summed in blocks of faces that do not depend on threads. A face counts with the
 * multiplicity of its component (construct/solid_shells.h) if this is known, else once. Source of
 * the moments: Tonon 2004, "Explicit exact formulas for the 3-D tetrahedron inertia tensor in terms
 * of its vertex coordinates". */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/query.h>

#include "construct/solid_shells.h"
#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "format/reader.h"
#include "geometry/expansion.h"
#include "geometry/level_nodes.h"
#include "mesh/mesh_parts.h"

enum { BLOCK_FACES = 16384 };

/* A volume whose share of the sum of absolute values is less than this is a rounding error: 0. */
static const double nothing = 0x1p-85;

/* Scaled coordinates are p / 2^exponent; `middle` is scaled. */
typedef struct frame {
    int exponent;
    double factor[2]; /* 2^-exponent in two steps, as it may not fit into one */
    double middle[3];
} frame;

typedef struct moments {
    ebpo_pair area2, volume6, first24[3], second120[6]; /* order of second moments: xx, yy, zz, yz,
                                                         * zx, xy */
    ebpo_pair integral6;                                /* with each face counted once */
    /* the sum of absolute values of the terms of volume6 */
    double absolute6;
} moments;

typedef struct pass {
    const ebpo_mesh *mesh;
    const uint32_t *component; /* [faces]; NULL: all faces count once */
    int8_t *times;             /* [components] multiplicity of each component's faces */
    frame frame;
    moments *blocks;
} pass;

/* --- the frame --- */

static void frame_of(frame *f, const ebpo_mesh *mesh)
{
    double low[3] = { INFINITY, INFINITY, INFINITY }, high[3] = { -INFINITY, -INFINITY, -INFINITY },
           half = 0, largest = 0, p[3];
    for (uint64_t i = 0; i < 3 * mesh->face_count; i++) {
        ebpo_mesh_position(mesh, mesh->faces[i], p);
        for (int k = 0; k < 3; k++) {
            low[k] = p[k] < low[k] ? p[k] : low[k];
            high[k] = p[k] > high[k] ? p[k] : high[k];
            largest = fmax(largest, fabs(p[k]));
        }
    }
    for (int k = 0; k < 3; k++)
        half = fmax(half, mesh->face_count ? .5 * high[k] - .5 * low[k] : 0);
    frexp(half, &f->exponent);
    /* A flat model that is far from the origin and has a tiny extent must not overflow. */
    int top;
    frexp(largest, &top);
    f->exponent = f->exponent > top - 900 ? f->exponent : top - 900;
    f->factor[0] = ldexp(1, -f->exponent / 2);
    f->factor[1] = ldexp(1, -f->exponent - -f->exponent / 2);
    for (int k = 0; k < 3; k++)
        f->middle[k] = mesh->face_count ? .5 * (low[k] * f->factor[0] * f->factor[1]) +
                                              .5 * (high[k] * f->factor[0] * f->factor[1])
                                        : 0;
}

static void scaled_corners(const pass *p, uint64_t face, double out[3][3])
{
    for (int i = 0; i < 3; i++) {
        ebpo_mesh_position(p->mesh, p->mesh->faces[3 * face + (uint64_t)i], out[i]);
        for (int k = 0; k < 3; k++)
            out[i][k] = out[i][k] * p->frame.factor[0] * p->frame.factor[1];
    }
}

/* --- moments --- */

static void add_pair(ebpo_pair *sum, ebpo_pair x) { *sum = ebpo_pair_add(*sum, x); }

static void merge_moments(moments *sum, const moments *m)
{
    add_pair(&sum->area2, m->area2);
    add_pair(&sum->volume6, m->volume6);
    add_pair(&sum->integral6, m->integral6);
    for (int k = 0; k < 3; k++)
        add_pair(&sum->first24[k], m->first24[k]);
    for (int k = 0; k < 6; k++)
        add_pair(&sum->second120[k], m->second120[k]);
    sum->absolute6 += m->absolute6;
}

static double pair_length(const ebpo_pair n[3])
{
    double largest = fmax(fabs(n[0].head), fmax(fabs(n[1].head), fabs(n[2].head)));
    if (largest == 0)
        return 0;
    double x = n[0].head / largest, y = n[1].head / largest, z = n[2].head / largest;
    return largest * sqrt(x * x + y * y + z * z);
}

/* Computes n = (b - a) x (c - a). */
static void normal_of(const double corner[3][3], ebpo_pair n[3])
{
    ebpo_pair f[3], g[3];
    for (int k = 0; k < 3; k++) {
        f[k] = ebpo_two_difference(corner[1][k], corner[0][k]);
        g[k] = ebpo_two_difference(corner[2][k], corner[0][k]);
    }
    for (int k = 0; k < 3; k++) {
        int u = (k + 1) % 3, v = (k + 2) % 3;
        n[k] = ebpo_pair_subtract(ebpo_pair_multiply(f[u], g[v]), ebpo_pair_multiply(f[v], g[u]));
    }
}

/* Returns the products of corners for the second moment in (u, v). */
static ebpo_pair mixed_product(ebpo_pair r[3][3], const ebpo_pair s[3], int u, int v)
{
    ebpo_pair sum = ebpo_pair_multiply(s[u], s[v]);
    for (int i = 0; i < 3; i++)
        add_pair(&sum, ebpo_pair_multiply(r[i][u], r[i][v]));
    return sum;
}

static void add_face(moments *m, const double corner[3][3], const double middle[3], int times)
{
    ebpo_pair n[3], r[3][3], s[3], det = { 0, 0 };
    normal_of(corner, n);
    add_pair(&m->area2, ebpo_pair_of(pair_length(n)));
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 3; i++)
            r[i][k] = ebpo_two_difference(corner[i][k], middle[k]);
        s[k] = ebpo_pair_add(ebpo_pair_add(r[0][k], r[1][k]), r[2][k]);
        ebpo_pair product = ebpo_pair_multiply(r[0][k], n[k]);
        add_pair(&det, product);
        m->absolute6 += fabs(product.head);
    }
    add_pair(&m->integral6, det);
    det = (ebpo_pair){ times * det.head, times * det.tail };
    add_pair(&m->volume6, det);
    for (int k = 0; k < 3; k++) {
        add_pair(&m->first24[k], ebpo_pair_multiply(det, s[k]));
        add_pair(&m->second120[k], ebpo_pair_multiply(det, mixed_product(r, s, k, k)));
        add_pair(&m->second120[3 + k],
                 ebpo_pair_multiply(det, mixed_product(r, s, (k + 1) % 3, (k + 2) % 3)));
    }
}

static int times_of(const pass *p, uint64_t face)
{
    return p->component ? p->times[p->component[face]] : 1;
}

static ebpo_status measure_blocks(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                  ebpo_error *error)
{
    pass *p = context;
    (void)worker;
    (void)error;
    for (uint64_t b = begin; b < end; b++) {
        moments m = { .absolute6 = 0 };
        uint64_t last = (b + 1) * BLOCK_FACES < p->mesh->face_count ? (b + 1) * BLOCK_FACES
                                                                    : p->mesh->face_count;
        for (uint64_t f = b * BLOCK_FACES; f < last; f++) {
            double corner[3][3];
            scaled_corners(p, f, corner);
            add_face(&m, (const double(*)[3])corner, p->frame.middle, times_of(p, f));
        }
        p->blocks[b] = m;
    }
    return EBPO_OK;
}

/* --- from moments to mass --- */

/* Computes the inertia from central second moments: the trace less the matrix. */
static void inertia_of(ebpo_mass *out, const ebpo_pair central[6], int exponent)
{
    for (int k = 0; k < 3; k++) {
        int u = (k + 1) % 3, v = (k + 2) % 3;
        out->scaled_inertia[k][k] = ebpo_pair_add(central[u], central[v]).head;
        out->scaled_inertia[u][v] = out->scaled_inertia[v][u] = 0 - central[3 + k].head;
    }
    for (int u = 0; u < 3; u++)
        for (int v = 0; v < 3; v++)
            out->inertia[u][v] = ldexp(out->scaled_inertia[u][v], 5 * exponent);
}

static void mass_of(ebpo_mass *out, const moments *m, const frame *f, bool solid)
{
    memset(out, 0, sizeof *out);
    out->exponent = f->exponent;
    out->scaled_area = .5 * m->area2.head;
    out->area = ldexp(out->scaled_area, 2 * f->exponent);
    if (solid && fabs(m->integral6.head) > nothing * m->absolute6)
        out->scaled_integral = ebpo_pair_divide(m->integral6, ebpo_pair_of(6)).head;
    out->integral = ldexp(out->scaled_integral, 3 * f->exponent);
    if (!solid || fabs(m->volume6.head) <= nothing * m->absolute6)
        return;
    ebpo_pair volume = ebpo_pair_divide(m->volume6, ebpo_pair_of(6)), centre[3], central[6];
    out->scaled_volume = volume.head;
    for (int k = 0; k < 3; k++) {
        centre[k] =
            ebpo_pair_divide(m->first24[k], ebpo_pair_multiply(m->volume6, ebpo_pair_of(4)));
        out->centroid[k] =
            ldexp(ebpo_pair_add(ebpo_pair_of(f->middle[k]), centre[k]).head, f->exponent);
    }
    for (int k = 0; k < 6; k++) {
        int u = k < 3 ? k : (k + 1) % 3, v = k < 3 ? k : (k + 2) % 3;
        ebpo_pair shift = ebpo_pair_multiply(volume, ebpo_pair_multiply(centre[u], centre[v]));
        central[k] =
            ebpo_pair_subtract(ebpo_pair_divide(m->second120[k], ebpo_pair_of(120)), shift);
    }
    inertia_of(out, central, f->exponent);
}

/* --- counted faces --- */

static ebpo_status count_components(pass *p, const ebpo_solid_shells *s, ebpo_rule rule,
                                    ebpo_error *error)
{
    const ebpo_components *c = s->nesting.components;
    p->times = ebpo_alloc(c->count, sizeof *p->times);
    if (!p->times)
        return ebpo_fail_memory(error, c->count * sizeof *p->times);
    for (uint64_t i = 0; i < c->count; i++)
        p->times[i] = (int8_t)ebpo_component_times(s, (uint32_t)i, rule);
    p->component = c->of_face;
    return EBPO_OK;
}

/* Finds if the volume is known; then sets the multiplicity of faces. */
static ebpo_status decide_volume(pass *p, const ebpo_info *info, unsigned threads,
                                 ebpo_solid_shells *s, ebpo_solid_volume *volume, ebpo_error *error)
{
    ebpo_shells shells;
    bool several = info->solid && info->report.manifold && info->report.components > 1;
    ebpo_status status =
        several ? ebpo_solid_shells_find(s, p->mesh, threads, NULL, error) : EBPO_OK;
    if (status == EBPO_OK && several)
        ebpo_solid_shells_count(s, &shells);
    if (status == EBPO_OK)
        status = ebpo_solid_volume_of(&info->report, info->rule, several ? &shells : NULL, info,
                                      volume, error);
    if (status == EBPO_OK && several && volume->lo == volume->hi)
        status = count_components(p, s, info->rule, error);
    return status;
}

/* Faces of a single component that face inwards count -1 times, or do not count. */
static void count_inwards(moments *m, ebpo_rule rule)
{
    int times = ebpo_rule_inside(rule, -1) ? -1 : 0;
    ebpo_pair *sum[] = { &m->volume6,      m->first24,       m->first24 + 1,   m->first24 + 2,
                         m->second120,     m->second120 + 1, m->second120 + 2, m->second120 + 3,
                         m->second120 + 4, m->second120 + 5 };
    for (size_t i = 0; i < sizeof sum / sizeof *sum; i++)
        *sum[i] = (ebpo_pair){ times * sum[i]->head, times * sum[i]->tail };
}

static void set_volume(ebpo_mass *mass, const ebpo_solid_volume *known)
{
    if (known->lo != known->hi) {
        mass->scaled_volume = mass->volume = NAN;
        mass->volume_lo = known->lo;
        mass->volume_hi = known->hi;
        return;
    }
    mass->volume = ldexp(mass->scaled_volume, 3 * (int)mass->exponent);
    mass->volume_lo = mass->volume_hi = mass->volume;
}

ebpo_status ebpo_measure(const ebpo_file *file, unsigned threads, ebpo_mass *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_mesh mesh = { 0 };
    pass p = { .mesh = &mesh };
    moments sum = { .absolute6 = 0 };
    uint64_t block_count = 0;
    ebpo_mass mass = EBPO_MASS_INIT;
    ebpo_solid_shells shells = { .mesh = &mesh };
    ebpo_solid_volume volume = EBPO_SOLID_VOLUME_INIT;
    const ebpo_info *info = ebpo_file_info(file);
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_mass, out, error);
    if (status != EBPO_OK)
        return status;
    if (info->pruned)
        return ebpo_fail_file(error, EBPO_E_ABSENT, file->in.shown,
                              "the file is a subset with an omitted part of the mesh: it cannot "
                              "be measured; measure the original");
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    read.threads = threads;
    status = ebpo_file_read_mesh(file, &read, &mesh, error);
    if (status == EBPO_OK)
        status = decide_volume(&p, info, threads, &shells, &volume, error);
    if (status != EBPO_OK)
        goto done;
    block_count = mesh.face_count / BLOCK_FACES + (mesh.face_count % BLOCK_FACES != 0);
    p.blocks = ebpo_alloc(block_count, sizeof *p.blocks);
    if (!p.blocks) {
        status = ebpo_fail_memory(error, block_count * sizeof *p.blocks);
        goto done;
    }
    frame_of(&p.frame, &mesh);
    status = ebpo_parallel_for(threads, NULL, block_count, 1, measure_blocks, &p, NULL, "measuring",
                               error);
    if (status != EBPO_OK)
        goto done;
    for (uint64_t b = 0; b < block_count; b++)
        merge_moments(&sum, &p.blocks[b]);
    if (!p.component && volume.lo == volume.hi && sum.volume6.head < 0)
        count_inwards(&sum, info->rule);
    mass_of(&mass, &sum, &p.frame, info->solid);
    set_volume(&mass, &volume);
    EBPO_GIVE(ebpo_mass, out, &mass);
done:
    free(p.blocks);
    free(p.times);
    ebpo_solid_shells_free(&shells);
    ebpo_mesh_free(&mesh);
    return status;
}

/* --- the volume of a solid, from the file header --- */

/* Rounding errors of sums of envelopes: relative to the sum, and to the root cell's volume. */
static const double OF_SUM = 1e-9, OF_ROOT = 1e-12;

/* Sets out->lo and hi to the volumes of black cells and envelopes. */
static void bound_by_cells(const ebpo_info *info, ebpo_solid_volume *out)
{
    double root = info->box_size[0] * info->box_size[1] * info->box_size[2], lo = 0, hi = 0;
    if (info->pruned || !isnormal(ldexp(root, -3 * EBPO_LEVELS_MAX)))
        return;
    for (int i = 0; i < info->level_count; i++) {
        lo += (double)info->level[i].black_count * ldexp(root, -3 * i);
        hi += info->level[i].leaf_volume;
    }
    hi += lo;
    out->lo = fmax(0, lo * (1 - OF_SUM));
    out->hi = hi * (1 + OF_SUM) + root * OF_ROOT;
}

/* Returns the volume of components that do not intersect; NAN: it is not known. Uncounted shells
 * may intersect. */
static double known_volume(const ebpo_mesh_report *report, ebpo_rule rule,
                           const ebpo_shells *shells)
{
    double integral = report->volume;
    if (!report->manifold)
        return NAN;
    if (report->components == 1)
        return ebpo_rule_inside(rule, signbit(integral) ? -1 : 1) ? fabs(integral) : 0;
    return shells->apart ? integral + shells->volume_difference[rule] : NAN;
}

ebpo_status ebpo_solid_volume_of(const ebpo_mesh_report *report, ebpo_rule rule,
                                 const ebpo_shells *shells, const ebpo_info *info,
                                 ebpo_solid_volume *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_solid_volume v = { .hi = INFINITY, .integral = report->volume };
    ebpo_shells own = EBPO_SHELLS_INIT;
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_solid_volume, out, error);
    if (status == EBPO_OK)
        status = EBPO_TAKE(ebpo_shells, &own, shells, error);
    if (status != EBPO_OK)
        return status;
    if ((unsigned)rule > EBPO_RULE_POSITIVE)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "unknown winding rule %d", (int)rule);
    if (info)
        bound_by_cells(info, &v);
    double volume = known_volume(report, rule, &own);
    if (!report->balanced)
        v = (ebpo_solid_volume){ .integral = 0 };
    else if (volume >= v.lo && volume <= v.hi)
        v.lo = v.hi = volume;
    return EBPO_GIVE(ebpo_solid_volume, out, &v);
}
