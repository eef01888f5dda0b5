/* Computes area, volume, centroid and inertia as integrals over the faces (divergence theorem).
 * Each face and the middle of the model span a tetrahedron, whose moments are polynomials in its
 * corners. For corners a, b, c relative to the middle, with det = a . (b x c) and s = a + b + c:
 *   volume          det / 6
 *   first moments   det s / 24
 *   second moments  det (s s' + a a' + b b' + c c') / 120
 * where s' is the transpose of s. All values are in double-double arithmetic, on coordinates scaled
 * by a power of two to about 1. They are summed in blocks of BLOCK_FACES faces, so that sums do not
 * depend on the number of threads. For volume and moments, the terms of a face have a factor
 * (ebpo_component_times). The factor is 1 if the face's component bounds the solid, and -1 if the
 * component bounds the solid with the opposite orientation. The factor is 0 if the component does
 * not bound the solid. If the factor is not known, 1 is used. For a surface with its border (the
 * edges of its holes), the caps that close the holes are faces, too (measure_caps.h). Source of the
 * moments: Tonon 2004, "Explicit exact formulas for the 3-D tetrahedron inertia tensor in terms of
 * its vertex coordinates". */
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
#include "format/border_loops.h"
#include "format/reader.h"
#include "geometry/cap_triangles.h"
#include "geometry/expansion.h"
#include "geometry/level_nodes.h"
#include "mesh/mesh_parts.h"
#include "query/measure_caps.h"

enum { BLOCK_FACES = 16384 };

/* A sum that is at most this share of the sum of the absolute values of its terms counts as a
 * rounding error, and becomes 0. */
static const double zero_share = 0x1p-85;

/* Scaled coordinates are p / 2^exponent. `middle`: middle of the model's box, scaled. */
typedef struct frame {
    int exponent;
    /* 2^-exponent as two factors, because 2^-exponent may not fit into one double */
    double factor[2];
    double middle[3];
} frame;

/* Sums over faces. The number in a name is the factor by which the sum is larger than the value. An
 * ebpo_pair is a double-double number. */
typedef struct moments {
    ebpo_pair area2, volume6, first24[3];
    ebpo_pair second120[6]; /* xx, yy, zz, yz, zx, xy */
    ebpo_pair integral6;    /* as volume6, but each face counts once */
    /* absolute6: sum of the absolute values of the terms of volume6; terms6: sum of the absolute
     * values of the products from which these terms are computed */
    double absolute6, terms6;
} moments;

typedef struct measuring {
    const ebpo_mesh *mesh;
    const uint32_t *component; /* [faces] component of each face; NULL: all faces count once */
    int8_t *times;             /* [components] factor of the component's faces: 1, -1 or 0 */
    frame frame;
    moments *blocks; /* sums over each block */
} measuring;

/* --- the frame --- */

/* Chooses the frame: half the longest side of the box becomes 1/2 to 1. */
static void make_frame(frame *f, const ebpo_mesh *mesh)
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
    /* The scaled coordinates of a tiny model far from the origin must not overflow. */
    int largest_exponent;
    frexp(largest, &largest_exponent);
    f->exponent = f->exponent > largest_exponent - 900 ? f->exponent : largest_exponent - 900;
    f->factor[0] = ldexp(1, -f->exponent / 2);
    f->factor[1] = ldexp(1, -f->exponent - -f->exponent / 2);
    for (int k = 0; k < 3; k++)
        f->middle[k] = mesh->face_count ? .5 * (low[k] * f->factor[0] * f->factor[1]) +
                                              .5 * (high[k] * f->factor[0] * f->factor[1])
                                        : 0;
}

static void scaled_corners(const measuring *p, uint64_t face, double out[3][3])
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
    sum->terms6 += m->terms6;
}

static double pair_length(const ebpo_pair n[3])
{
    double largest = fmax(fabs(n[0].head), fmax(fabs(n[1].head), fabs(n[2].head)));
    if (largest == 0)
        return 0;
    double x = n[0].head / largest, y = n[1].head / largest, z = n[2].head / largest;
    return largest * sqrt(x * x + y * y + z * z);
}

/* Computes n = (b - a) x (c - a). terms[k]: sum of the absolute values of the products in n[k]. */
static void normal_of(const double corner[3][3], ebpo_pair n[3], double terms[3])
{
    ebpo_pair f[3], g[3];
    for (int k = 0; k < 3; k++) {
        f[k] = ebpo_two_difference(corner[1][k], corner[0][k]);
        g[k] = ebpo_two_difference(corner[2][k], corner[0][k]);
    }
    for (int k = 0; k < 3; k++) {
        int u = (k + 1) % 3, v = (k + 2) % 3;
        n[k] = ebpo_pair_subtract(ebpo_pair_multiply(f[u], g[v]), ebpo_pair_multiply(f[v], g[u]));
        terms[k] = fabs(f[u].head * g[v].head) + fabs(f[v].head * g[u].head);
    }
}

/* Returns element (u, v) of s s' + a a' + b b' + c c'. `r`: the corners a, b, c; `s`: their sum. */
static ebpo_pair mixed_product(ebpo_pair r[3][3], const ebpo_pair s[3], int u, int v)
{
    ebpo_pair sum = ebpo_pair_multiply(s[u], s[v]);
    for (int i = 0; i < 3; i++)
        add_pair(&sum, ebpo_pair_multiply(r[i][u], r[i][v]));
    return sum;
}

/* Adds the tetrahedron of a triangle. `n`, `terms`: results of normal_of. The factor of the
 * tetrahedron's terms is `weight` in integral6 and terms6, 1 in absolute6, and `weight` * `times`
 * in volume6, first24 and second120. */
static void add_tetrahedron(moments *m, const double corner[3][3], const double middle[3],
                            const ebpo_pair n[3], const double terms[3], double weight, int times)
{
    ebpo_pair r[3][3], s[3], det = { 0, 0 };
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 3; i++)
            r[i][k] = ebpo_two_difference(corner[i][k], middle[k]);
        s[k] = ebpo_pair_add(ebpo_pair_add(r[0][k], r[1][k]), r[2][k]);
        ebpo_pair product = ebpo_pair_multiply(r[0][k], n[k]);
        add_pair(&det, product);
        m->absolute6 += fabs(product.head);
        m->terms6 += fabs(weight * r[0][k].head) * terms[k];
    }
    det = ebpo_pair_multiply(det, ebpo_pair_of(weight));
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

static void add_face(moments *m, const double corner[3][3], const double middle[3], int times)
{
    ebpo_pair n[3];
    double terms[3];
    normal_of(corner, n, terms);
    add_pair(&m->area2, ebpo_pair_of(pair_length(n)));
    add_tetrahedron(m, corner, middle, n, terms, 1, times);
}

/* Returns the factor of the face's terms: 1, -1 or 0. */
static int times_of(const measuring *p, uint64_t face)
{
    return p->component ? p->times[p->component[face]] : 1;
}

static ebpo_status measure_blocks(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                  ebpo_error *error)
{
    measuring *p = context;
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

/* --- caps --- */

/* Sums over the loops of a border, for bounds of how much results depend on the choice of caps. */
typedef struct cap_sums {
    /* sum over all loops of the loop's weight times a bound of the volume of the loop's convex hull
     */
    double volume;
    double moment; /* sum of the same products, each times a bound of the distance of the hull's
                    * farthest point from the centroid */
} cap_sums;

static void scale_point(const frame *f, const double p[3], double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = p[k] * f->factor[0] * f->factor[1];
}

/* Adds the caps. The triangles of a cap are the triangles of a disc (geometry/cap_triangles.h) with
 * the opposite orientation. */
static void add_caps(moments *m, const frame *f, const ebpo_border_loops *loops)
{
    const double *point = loops->point;
    for (uint64_t i = 0; i < loops->loop_count; i++) {
        uint64_t n = loops->loop[2 * i];
        for (uint64_t t = 0; t < n - 2; t++) {
            uint64_t at[3];
            double corner[3][3], terms[3];
            ebpo_pair normal[3];
            ebpo_cap_triangle(0, n - 1, t, at);
            for (int k = 0; k < 3; k++)
                scale_point(f, point + 3 * at[2 - k], corner[k]);
            normal_of((const double(*)[3])corner, normal, terms);
            add_tetrahedron(m, (const double(*)[3])corner, f->middle, normal, terms,
                            loops->loop[2 * i + 1], 1);
        }
        point += 3 * n;
    }
}

/* Computes the sums of all loops. centroid: scaled. */
static void sum_hulls(cap_sums *out, const frame *f, const ebpo_border_loops *loops,
                      const double centroid[3])
{
    const double *point = loops->point;
    *out = (cap_sums){ 0, 0 };
    for (uint64_t i = 0; i < loops->loop_count; i++) {
        double farthest,
            volume = ebpo_loop_hull(point, loops->loop[2 * i], f->factor, centroid, &farthest) *
                     loops->loop[2 * i + 1];
        out->volume += volume;
        out->moment += volume * farthest;
        point += 3 * (uint64_t)loops->loop[2 * i];
    }
    out->volume *= 1 + 0x1p-20; /* covers the rounding errors of fewer than 2^30 additions */
    out->moment *= 1 + 0x1p-20;
}

/* --- from moments to mass --- */

/* Computes the inertia from central second moments: trace * identity - matrix. */
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

/* Returns a bound of the rounding error of integral6. Each operation on pairs has an error of at
 * most 2^-103 times the absolute values of its operands (for a product: of its result). A term of
 * the sum is the result of at most 8 operations. After that, the sum that contains the term takes
 * part in at most 4 additions for each triangle and for each block. All partial sums are at most
 * 2 * terms6. */
static double integral_error(const moments *m, uint64_t triangles)
{
    return (4 * (double)triangles + 64) * 0x1p-102 * m->terms6 + 0x1p-900;
}

/* Sets the members that depend on the border.
 *
 * Rounding: the corners of a triangle are at most 2 from the middle on each axis, so the absolute
 * value of a coordinate of their sum is at most 6. Hence the error of first24 is at most 12 times
 * the error of the integral. Let V = integral6, M = first24 and c = M / (4 V). An error e of V and
 * an error f of M change c by at most (f + 4 |c| e) / (4 (|V| - e)).
 *
 * Other caps: let k(x) be the winding number of a point x with our caps C, and k'(x) the winding
 * number with other caps C'. We assume two properties of the cap C'_i of each loop. First, C'_i
 * together with our cap C_i, reversed, is a closed surface with no other winding numbers than -w_i,
 * 0 and w_i, where w_i is the loop's weight. Second, C'_i is in the convex hull H_i of the loop (as
 * C_i is). Then |k'(x) - k(x)| is at most the sum of w_i over the hulls H_i that contain x. So the
 * integral changes by at most h = sum of w_i |H_i|, where |H_i| is the volume of the hull. With the
 * centroid c as the origin, the first moment of k is 0. The first moment of k' is at most the sum
 * of w_i |H_i| r_i, where r_i is the distance of the farthest point of H_i from c. So the centroid
 * moves by at most this sum divided by |V| - h. */
static void set_border(ebpo_mass *out, const moments *m, const frame *f,
                       const ebpo_border_loops *loops, uint64_t triangles)
{
    double error6 = integral_error(m, triangles), volume6 = fabs(m->integral6.head),
           centre[3] = { f->middle[0], f->middle[1], f->middle[2] }, largest = 0;
    cap_sums caps;
    for (int k = 0; k < 3; k++) {
        double c = volume6 > 0 ? m->first24[k].head / (4 * m->integral6.head) : 0;
        centre[k] += c;
        largest = fmax(largest, fabs(c));
    }
    sum_hulls(&caps, f, loops, centre);
    double least6 = volume6 * (1 - 0x1p-40) - error6, hulls6 = 6 * caps.volume;
    double moved =
        least6 > 0 ? (3 + largest) * error6 / least6 + 0x1p-48 * (1 + largest) : INFINITY;
    for (int k = 0; k < 3; k++)
        moved += 0x1p-50 * fabs(f->middle[k]);
    out->integral_error =
        ldexp(error6 / 6 * (1 + 0x1p-40) + 0x1p-51 * volume6 / 6, 3 * f->exponent);
    out->centroid_error = ldexp(moved, f->exponent);
    out->caps_integral = ldexp(caps.volume, 3 * f->exponent);
    out->caps_centroid =
        caps.volume == 0 ? 0
        : least6 > hulls6
            ? ldexp((6 * caps.moment + hulls6 * moved) / (least6 - hulls6) * (1 + 0x1p-40),
                    f->exponent)
            : INFINITY;
}

/* Computes the result from the sums. Only a solid (or a surface with its border) has a volume. */
static void mass_of(ebpo_mass *out, const moments *m, const frame *f, bool solid)
{
    memset(out, 0, sizeof *out);
    out->exponent = f->exponent;
    out->scaled_area = .5 * m->area2.head;
    out->area = ldexp(out->scaled_area, 2 * f->exponent);
    if (solid && fabs(m->integral6.head) > zero_share * m->absolute6)
        out->scaled_integral = ebpo_pair_divide(m->integral6, ebpo_pair_of(6)).head;
    out->integral = ldexp(out->scaled_integral, 3 * f->exponent);
    if (!solid || fabs(m->volume6.head) <= zero_share * m->absolute6)
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

/* Sets the factor of each component's faces. */
static ebpo_status count_components(measuring *p, const ebpo_solid_shells *s, ebpo_rule rule,
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

/* Returns true if the surface has one component, no edge of more than two faces, and no edge whose
 * faces have opposite orientations. The winding numbers of such a surface with caps are 0 and 1, or
 * 0 and -1, unless faces or caps intersect. */
static bool is_one_sheet(const ebpo_info *info)
{
    const ebpo_mesh_report *r = &info->report;
    return r->components == 1 && r->nonmanifold_edges.count == 0 && r->misoriented_edges.count == 0;
}

/* Computes an interval of the volume from the file header and, if there are several components,
 * from their nesting. If the volume is known, sets the factors of faces. */
static ebpo_status decide_volume(measuring *p, const ebpo_info *info, unsigned threads,
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

/* Corrects the sums if the normals of a single component point inwards: its faces count -1 times if
 * winding number -1 is inside under the rule, otherwise 0 times. */
static void count_inwards(moments *m, ebpo_rule rule)
{
    int times = ebpo_rule_inside(rule, -1) ? -1 : 0;
    ebpo_pair *sum[] = { &m->volume6,      m->first24,       m->first24 + 1,   m->first24 + 2,
                         m->second120,     m->second120 + 1, m->second120 + 2, m->second120 + 3,
                         m->second120 + 4, m->second120 + 5 };
    for (size_t i = 0; i < sizeof sum / sizeof *sum; i++)
        *sum[i] = (ebpo_pair){ times * sum[i]->head, times * sum[i]->tail };
}

/* Sets the volume and its interval. If the volume is not known, it becomes NAN. `bordered`: the
 * file has the border of a surface. */
static void set_volume(ebpo_mass *mass, const ebpo_solid_volume *known, bool bordered)
{
    if (known->lo != known->hi) {
        mass->scaled_volume = mass->volume = NAN;
        mass->volume_lo = known->lo;
        mass->volume_hi = known->hi;
        return;
    }
    mass->volume = ldexp(mass->scaled_volume, 3 * (int)mass->exponent);
    double error = bordered ? mass->integral_error + mass->caps_integral : 0;
    mass->volume_lo = fmax(0, mass->volume - error);
    mass->volume_hi = mass->volume + error;
}

ebpo_status ebpo_measure(const ebpo_file *file, unsigned threads, ebpo_mass *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_mesh mesh = { 0 };
    measuring p = { .mesh = &mesh };
    moments sum = { .absolute6 = 0 };
    uint64_t block_count = 0;
    ebpo_mass mass = EBPO_MASS_INIT;
    ebpo_solid_shells shells = { .mesh = &mesh };
    ebpo_solid_volume volume = EBPO_SOLID_VOLUME_INIT;
    ebpo_border_loops loops = { .loop_count = 0 };
    const ebpo_info *info = ebpo_file_info(file);
    bool bordered = info->parts & EBPO_PART_BORDER;
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_mass, out, error);
    if (status != EBPO_OK)
        return status;
    if (info->pruned)
        return ebpo_fail_file(error, EBPO_E_ABSENT, file->in.shown,
                              "the file is a subset, which omits a part of the mesh, so it cannot "
                              "be measured; measure the original file");
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    read.threads = threads;
    status = ebpo_file_read_mesh(file, &read, &mesh, error);
    if (status == EBPO_OK)
        status = decide_volume(&p, info, threads, &shells, &volume, error);
    if (status == EBPO_OK && bordered)
        status = ebpo_border_read(file, &loops, error);
    if (status != EBPO_OK)
        goto done;
    if (bordered && !is_one_sheet(info))
        volume.hi = INFINITY;
    block_count = mesh.face_count / BLOCK_FACES + (mesh.face_count % BLOCK_FACES != 0);
    p.blocks = ebpo_alloc(block_count, sizeof *p.blocks);
    if (!p.blocks) {
        status = ebpo_fail_memory(error, block_count * sizeof *p.blocks);
        goto done;
    }
    make_frame(&p.frame, &mesh);
    status = ebpo_parallel_for(threads, NULL, block_count, 1, measure_blocks, &p, NULL, "measuring",
                               error);
    if (status != EBPO_OK)
        goto done;
    for (uint64_t b = 0; b < block_count; b++)
        merge_moments(&sum, &p.blocks[b]);
    if (bordered)
        add_caps(&sum, &p.frame, &loops);
    if (!p.component && volume.lo == volume.hi && sum.volume6.head < 0)
        count_inwards(&sum, info->rule);
    mass_of(&mass, &sum, &p.frame, info->solid || bordered);
    if (bordered)
        set_border(&mass, &sum, &p.frame, &loops, mesh.face_count + loops.point_count);
    set_volume(&mass, &volume, bordered);
    EBPO_GIVE(ebpo_mass, out, &mass);
done:
    free(p.blocks);
    free(p.times);
    ebpo_border_loops_free(&loops);
    ebpo_solid_shells_free(&shells);
    ebpo_mesh_free(&mesh);
    return status;
}

/* --- the volume of a solid, from the file header --- */

/* Bounds of the rounding error of a sum of envelopes' volumes: OF_SUM is relative to the sum, and
 * OF_ROOT to the root cell's volume. */
static const double OF_SUM = 1e-9, OF_ROOT = 1e-12;

/* Sets out->lo to the volume of the black cells, and out->hi to the volume of the black cells and
 * of the leaves' envelopes. Does nothing for a subset, whose header does not have all volumes. */
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

/* Returns the volume, or NAN if it is not known because components intersect or may intersect. */
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
    ebpo_shells known_shells = EBPO_SHELLS_INIT;
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_solid_volume, out, error);
    if (status == EBPO_OK)
        status = EBPO_TAKE(ebpo_shells, &known_shells, shells, error);
    if (status != EBPO_OK)
        return status;
    if ((unsigned)rule > EBPO_RULE_POSITIVE)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "unknown winding rule %d", (int)rule);
    if (info)
        bound_by_cells(info, &v);
    double volume = known_volume(report, rule, &known_shells);
    if (!report->balanced)
        v = (ebpo_solid_volume){ .integral = 0 };
    else if (volume >= v.lo && volume <= v.hi)
        v.lo = v.hi = volume;
    return EBPO_GIVE(ebpo_solid_volume, out, &v);
}
