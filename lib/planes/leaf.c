/* The envelope of a leaf, from its faces. */
#include "geom/strict_fp.h"

#include "geom/plane_code.h"
#include "planes/planes.h"

enum { LEAF_CANDIDATES = 64 };

/* Distinct normals of the faces; of more than LEAF_CANDIDATES faces, an even sample. */
static int gather_normals(const ebpo_box *box, const ebpo_triangle *faces, uint64_t count, ebpo_candidate *out)
{
    int kept = 0;
    uint64_t step = count / LEAF_CANDIDATES + 1;
    for (uint64_t i = 0; i < count; i += step) {
        uint32_t normal;
        if (!ebpo_face_normal_code(box, &faces[i], &normal))
            continue;
        bool known = false;
        for (int j = 0; j < kept && !known; j++)
            known = out[j].normal == normal;
        if (!known)
            out[kept++] = (ebpo_candidate){ normal, -1e300 };
    }
    return kept;
}

static void raise_supports(ebpo_candidate *c, double (*n)[3], int count, const double p[3], double slack)
{
    for (int j = 0; j < count; j++) {
        double s = n[j][0] * p[0] + n[j][1] * p[1] + n[j][2] * p[2] + slack;
        c[j].support = s > c[j].support ? s : c[j].support;
    }
}

int ebpo_leaf_planes(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *faces, uint64_t count, unsigned inside_corners,
                     double epsilon, ebpo_polytope *envelope, uint32_t codes[EBPO_PLANES_MAX])
{
    ebpo_candidate candidates[LEAF_CANDIDATES];
    double n[LEAF_CANDIDATES][3];
    int kept = gather_normals(box, faces, count, candidates);
    for (int j = 0; j < kept; j++) {
        int32_t v[3], d;
        ebpo_plane_code_decode(candidates[j].normal, v, &d);
        for (int k = 0; k < 3; k++)
            n[j][k] = v[k];
    }
    for (uint64_t i = 0; i < count; i++) {
        double points[9][3], slack;
        int corners = ebpo_clip_triangle(box, cell, &faces[i], points, &slack);
        for (int p = 0; p < corners; p++)
            raise_supports(candidates, n, kept, points[p], EBPO_NORMAL_NORM * slack);
    }
    for (int i = 0; i < 8; i++)
        if (inside_corners >> i & 1)
            raise_supports(candidates, n, kept, (const double[3]){ i & 1, i >> 1 & 1, i >> 2 & 1 }, 0);
    if (epsilon > 0)
        return ebpo_select_greedy(envelope, candidates, kept, epsilon, EBPO_PLANES_MAX, codes);
    return ebpo_select_all(envelope, candidates, kept, EBPO_PLANES_MAX, codes);
}
