/* Finds the triangles that bound the result of the expression.
 *
 * A patch is a set of triangles that are connected by edges of exactly two triangles. The two
 * triangles of such an edge separate the space around the edge into two sectors. So the winding
 * numbers of all operands are constant in front of a patch, and constant behind it. The same is
 * true for a connected component of whole faces, which no other face intersects (operand_mesh.h).
 * So those faces of the component that are in the list of faces (face_list.h) are joined to one
 * patch. The winding numbers are computed exactly at an inner point of one triangle of the patch.
 * The patch bounds the result if the expression has different values on the two sides of the patch.
 * This rule covers coplanar faces, operands that touch, and operands that intersect themselves.
 *
 * The boundary of a set is closed. So each edge occurs in the selected triangles equally often in
 * both directions. ebpo_cut_mesh_classify checks this property of the selected triangles. */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/sort.h"
#include "core/workspace.h"
#include "extras/boolean/cut_mesh.h"
#include "geometry/predicates.h"

static const char stage[] = "classify";
static const char base_not_simple[] =
    "its faces intersect each other, have no area, or point inwards; make the whole result instead";

/* --- edges --- */

/* The edges of all triangles. Each edge is listed at its vertex with the lower number. An entry is
 * (other vertex << 32 | triangle << 1 | direction). The direction is 1 if the triangle has the edge
 * from the higher to the lower number. */
typedef struct edge_lists {
    uint64_t *begin; /* [vertices + 1] index in `edge` of the first edge of each vertex */
    uint64_t *edge;
} edge_lists;

static uint32_t other_vertex(uint64_t edge) { return (uint32_t)(edge >> 32); }

static uint32_t triangle_of(uint64_t edge) { return (uint32_t)edge >> 1; }

static ebpo_status list_edges(edge_lists *e, const ebpo_cut_mesh *cut, ebpo_error *error)
{
    uint64_t vertices = ebpo_cut_mesh_vertices(cut);
    e->begin = ebpo_alloc_zero(vertices + 2, sizeof *e->begin);
    e->edge = ebpo_alloc(3 * cut->count, sizeof *e->edge);
    if (!e->begin || !e->edge)
        return ebpo_fail_memory(error, 8 * vertices + 24 * cut->count);
    uint64_t *end = e->begin + 1; /* end[i]: first the start of list i; after filling, its end */
    for (uint64_t t = 0; t < cut->count; t++)
        for (int i = 0; i < 3; i++) {
            uint32_t a = cut->triangle[t][i], b = cut->triangle[t][i == 2 ? 0 : i + 1];
            end[(a < b ? a : b) + 1]++;
        }
    for (uint64_t v = 0; v < vertices; v++)
        end[v + 1] += end[v];
    for (uint64_t t = 0; t < cut->count; t++)
        for (int i = 0; i < 3; i++) {
            uint32_t a = cut->triangle[t][i], b = cut->triangle[t][i == 2 ? 0 : i + 1];
            e->edge[end[a < b ? a : b]++] = (uint64_t)(a < b ? b : a) << 32 | t << 1 | (a > b);
        }
    for (uint64_t v = 0; v < vertices; v++)
        ebpo_sort_numbers(e->edge + e->begin[v], e->begin[v + 1] - e->begin[v]);
    return EBPO_OK;
}

static void free_edges(edge_lists *e)
{
    free(e->begin);
    free(e->edge);
}

/* --- patches --- */

/* Patches are kept in a disjoint-set forest. The entry of a triangle is (parent << 1 | flip). The
 * flip is 1 if the triangle and its parent have opposite orientations: their normals point to
 * different sides of the patch. The root of a patch is its first triangle. */

/* Returns (root << 1 | flip). The flip is 1 if the triangle and the root have opposite
 * orientations. Shortens the path to the root. */
static uint32_t find_root(uint32_t *parent, uint32_t triangle)
{
    uint32_t flips = 0;
    while (parent[triangle] >> 1 != triangle) {
        uint32_t up = parent[triangle], above = parent[up >> 1];
        parent[triangle] = (above & ~UINT32_C(1)) | ((up ^ above) & 1);
        flips ^= parent[triangle] & 1;
        triangle = parent[triangle] >> 1;
    }
    return triangle << 1 | flips;
}

/* Joins the patches of two triangles. flipped: 1 if the triangles have opposite orientations. */
static void join_triangles(uint32_t *parent, uint32_t first, uint32_t second, uint32_t flipped)
{
    uint32_t a = find_root(parent, first), b = find_root(parent, second);
    flipped ^= (a ^ b) & 1;
    if (a >> 1 < b >> 1)
        parent[b >> 1] = (a & ~UINT32_C(1)) | flipped;
    else if (b >> 1 < a >> 1)
        parent[a >> 1] = (b & ~UINT32_C(1)) | flipped;
}

/* Joins triangles at edges of exactly two triangles. */
static void join_patches(const ebpo_cut_mesh *cut, const edge_lists *e, uint32_t *parent)
{
    for (uint32_t t = 0; t < cut->count; t++)
        parent[t] = t << 1;
    for (uint64_t i = 0, next, all = 3 * cut->count, v = 0; i < all; i = next) {
        while (e->begin[v + 1] <= i)
            v++;
        for (next = i + 1;
             next < e->begin[v + 1] && other_vertex(e->edge[next]) == other_vertex(e->edge[i]);)
            next++;
        if (next - i == 2) /* the same direction in both triangles means opposite orientations */
            join_triangles(parent, triangle_of(e->edge[i]), triangle_of(e->edge[i + 1]),
                           ((e->edge[i] ^ e->edge[i + 1]) & 1) == 0);
    }
}

/* Returns the component of the face from which a triangle was cut, and sets *operand to the face's
 * operand. EBPO_NO_COMPONENT: the face is not whole. */
static uint32_t component_of(const ebpo_cut_mesh *cut, uint32_t triangle, uint32_t *operand)
{
    uint32_t face = cut->face[triangle];
    *operand = ebpo_face_list_operand(cut->faces, face);
    return ebpo_face_list_component(cut->faces, *operand, face);
}

/* Joins the listed faces of each component of whole faces to one patch. */
static ebpo_status join_components(const ebpo_cut_mesh *cut, uint32_t *parent, ebpo_error *error)
{
    uint64_t begin[EBPO_BOOLEAN_OPERANDS_MAX], count = 0; /* first component of each operand */
    for (uint32_t i = 0; i < cut->faces->boolean->count; i++) {
        begin[i] = count;
        count += cut->faces->whole[i].components;
    }
    uint32_t *first = ebpo_alloc_zero(count, sizeof *first); /* a triangle + 1; 0: none */
    if (!first)
        return ebpo_fail_memory(error, count * sizeof *first);
    for (uint32_t t = 0; t < cut->count; t++) {
        uint32_t operand, component = component_of(cut, t, &operand);
        if (component == EBPO_NO_COMPONENT)
            continue;
        uint32_t *entry = &first[begin[operand] + component];
        if (*entry)
            join_triangles(parent, *entry - 1, t, 0);
        else
            *entry = t + 1;
    }
    free(first);
    return EBPO_OK;
}

/* --- winding numbers --- */

typedef struct classifying {
    const ebpo_cut_mesh *cut;
    const uint32_t *triangle; /* [patch] the triangle of the patch that is classified */
    int8_t *sign;             /* [patch] sign of this triangle (ebpo_cut_mesh_classify) */
} classifying;

/* Computes the mean of the triangle's corners. */
static void find_middle(const ebpo_cut_mesh *cut, uint32_t triangle, mpq_t out[3])
{
    mpq_t x;
    mpq_init(x);
    for (int k = 0; k < 3; k++) {
        mpq_init(out[k]);
        for (int i = 0; i < 3; i++) {
            ebpo_cut_mesh_coordinate(cut, cut->triangle[triangle][i], k, x);
            mpq_add(out[k], out[k], x);
        }
        mpq_set_ui(x, 3, 1);
        mpq_div(out[k], out[k], x);
    }
    mpq_clear(x);
}

/* Computes the changes of the operands' winding numbers from the front of a triangle to its back.
 */
static void find_changes(const ebpo_cut_mesh *cut, uint32_t triangle,
                         int32_t change[EBPO_BOOLEAN_OPERANDS_MAX])
{
    uint64_t low = 0, high = cut->covers;
    memset(change, 0, EBPO_BOOLEAN_OPERANDS_MAX * sizeof *change);
    change[ebpo_face_list_operand(cut->faces, cut->face[triangle])]++;
    while (low < high) {
        uint64_t middle = low + (high - low) / 2;
        if (cut->cover[middle].triangle < triangle)
            low = middle + 1;
        else
            high = middle;
    }
    for (; low < cut->covers && cut->cover[low].triangle == triangle; low++)
        change[ebpo_face_list_operand(cut->faces, cut->cover[low].face)] +=
            cut->cover[low].opposite ? -1 : 1;
}

/* Fails if the base (face_list.h) has a winding number other than 0 and 1 on a side of a triangle.
 * Faces of the base that are not listed do not change. So the changed mesh would have winding
 * numbers other than 0 and 1, too. */
static ebpo_status check_base(int32_t front, int32_t behind, ebpo_error *error)
{
    if ((front == 0 || front == 1) && (behind == 0 || behind == 1))
        return EBPO_OK;
    return ebpo_fail(error, EBPO_E_UNSUPPORTED, "near the other operands, %s", base_not_simple);
}

/* Computes the sign of a triangle from the states of all operands in front of it and behind it. */
static ebpo_status classify_triangle(const ebpo_cut_mesh *cut, uint32_t triangle, unsigned worker,
                                     int8_t *sign, ebpo_error *error)
{
    const ebpo_face_list *faces = cut->faces;
    const ebpo_boolean *b = faces->boolean;
    uint32_t face = cut->face[triangle];
    int32_t change[EBPO_BOOLEAN_OPERANDS_MAX], shifted = 0;
    uint64_t in_front = 0, behind = 0;
    mpq_t middle[3];
    ebpo_status status = EBPO_OK;
    /* Winding numbers are computed at the middle, shifted by an infinitesimal. `shifted` is 1 if
     * the shifted point is in front of the triangle, -1 if it is behind. */
    for (int k = 0; k < 3 && shifted == 0; k++)
        shifted = ebpo_normal_sign(k, ebpo_face_list_corner(faces, face, 0),
                                   ebpo_face_list_corner(faces, face, 1),
                                   ebpo_face_list_corner(faces, face, 2));
    find_changes(cut, triangle, change);
    find_middle(cut, triangle, middle);
    for (uint32_t i = 0; i < b->count && status == EBPO_OK; i++) {
        ebpo_error cause = EBPO_ERROR_INIT;
        int32_t front = 0;
        if (!faces->equal[i])
            continue;
        status = ebpo_exact_winding(&b->solid[i], ebpo_boolean_context(b, worker, i),
                                    (const mpq_t *)middle, &front, &cause);
        front -= shifted < 0 ? change[i] : 0;
        if (status == EBPO_OK && ebpo_face_list_is_base(faces, i))
            status = check_base(front, front + change[i], &cause);
        if (status != EBPO_OK)
            status = ebpo_fail_operand(b->solid[i].model, i, &cause, error);
        ebpo_rule rule = b->solid[i].model->info->rule;
        in_front |= ebpo_rule_inside(rule, front) ? faces->equal[i] : 0;
        behind |= ebpo_rule_inside(rule, front + change[i]) ? faces->equal[i] : 0;
    }
    *sign = (int8_t)(ebpo_boolean_holds(b, behind) - ebpo_boolean_holds(b, in_front));
    mpq_clears(middle[0], middle[1], middle[2], NULL);
    return status;
}

static ebpo_status classify_some(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    const classifying *c = context;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++)
        status = classify_triangle(c->cut, c->triangle[i], worker, &c->sign[i], error);
    return status;
}

/* --- all patches --- */

/* Chooses a triangle of each patch: if possible, a triangle of a face without partners, because
 * queries are fastest there. Sets patch[t] to the number of the patch of triangle t. Returns the
 * number of patches. */
static uint32_t choose_triangles(const ebpo_cut_mesh *cut, uint32_t *parent, uint32_t *patch,
                                 uint32_t *chosen)
{
    uint32_t count = 0;
    const uint64_t *begin = cut->faces->begin;
    for (uint32_t t = 0; t < cut->count; t++) {
        uint32_t root = find_root(parent, t) >> 1, face = cut->face[t];
        if (root == t) {
            patch[t] = count;
            chosen[count++] = t;
            continue;
        }
        patch[t] = patch[root];
        uint32_t chosen_face = cut->face[chosen[patch[t]]];
        if (begin[chosen_face + 1] > begin[chosen_face] && begin[face + 1] == begin[face])
            chosen[patch[t]] = t;
    }
    return count;
}

static ebpo_status classify_patches(const ebpo_cut_mesh *cut, uint32_t *parent,
                                    const ebpo_progress *progress, int8_t *sign, uint64_t *patches,
                                    ebpo_error *error)
{
    uint32_t *patch = ebpo_alloc(cut->count, sizeof *patch);
    uint32_t *chosen = ebpo_alloc(cut->count, sizeof *chosen);
    int8_t *of_patch = ebpo_alloc(cut->count, sizeof *of_patch);
    ebpo_status status = EBPO_OK;
    if (patch && chosen && of_patch) {
        classifying c = { cut, chosen, of_patch };
        uint32_t count = choose_triangles(cut, parent, patch, chosen);
        status = ebpo_parallel_for(count < 2 ? 1 : cut->faces->boolean->threads, NULL, count, 1,
                                   classify_some, &c, progress, stage, error);
        for (uint32_t t = 0; t < cut->count && status == EBPO_OK; t++) {
            uint32_t flips = (find_root(parent, t) ^ find_root(parent, chosen[patch[t]])) & 1;
            sign[t] = (int8_t)(flips ? -of_patch[patch[t]] : of_patch[patch[t]]);
        }
        *patches = count;
    } else {
        status = ebpo_fail_memory(error, 9 * cut->count);
    }
    free(patch);
    free(chosen);
    free(of_patch);
    return status;
}

/* --- reversed faces of the base --- */

/* Lists the faces of the base of which a triangle is reversed in the result. Returns their number.
 */
static uint32_t list_reversed(const ebpo_cut_mesh *cut, const int8_t *sign, uint32_t *out)
{
    uint32_t count = 0;
    for (uint64_t t = 0; t < cut->count; t++)
        if (sign[t] < 0 && ebpo_face_list_operand(cut->faces, cut->face[t]) == 0 &&
            (count == 0 || out[count - 1] != cut->face[t]))
            out[count++] = cut->face[t];
    return count;
}

/* Makes a mesh of listed faces. Each face has separate vertices. The caller frees the mesh, also
 * after a failure. */
static ebpo_status make_mesh(const ebpo_face_list *faces, const uint32_t *face, uint32_t count,
                             ebpo_mesh *out, ebpo_error *error)
{
    uint64_t corners = 3 * (uint64_t)count;
    *out = (ebpo_mesh){ .workspace = faces->workspace };
    out->xyz64 = ebpo_array_alloc(out->workspace, corners, 3 * sizeof *out->xyz64);
    out->faces = ebpo_array_alloc(out->workspace, corners, sizeof *out->faces);
    if (!out->xyz64 || !out->faces)
        return ebpo_workspace_fail(out->workspace, 28 * corners, error);
    for (uint64_t i = 0; i < corners; i++) {
        memcpy(out->xyz64 + 3 * i, ebpo_face_list_corner(faces, face[i / 3], (int)(i % 3)),
               3 * sizeof *out->xyz64);
        out->faces[i] = (uint32_t)i;
    }
    out->vertex_count = corners;
    out->face_count = count;
    return EBPO_OK;
}

static bool stop_at_first(void *user, const ebpo_self_intersection *crossings, uint64_t count)
{
    (void)crossings;
    *(bool *)user = count > 0;
    return false;
}

/* Fails if reversed faces of the base intersect each other. Self-intersections of the base are not
 * cut. If such faces stay or are removed, winding numbers of the changed mesh are those of the base
 * or 0. But if they are reversed, a winding number of 2 becomes -1, which no point outside the
 * result may have. classify_triangle finds such winding numbers only at the tested points. */
static ebpo_status check_reversed(const ebpo_cut_mesh *cut, const int8_t *sign,
                                  const ebpo_progress *progress, ebpo_error *error)
{
    ebpo_mesh mesh;
    ebpo_mesh_report report;
    ebpo_self_intersections_options options = EBPO_SELF_INTERSECTIONS_OPTIONS_INIT;
    bool found = false;
    uint32_t *face = ebpo_alloc(cut->faces->count, sizeof *face);
    uint32_t count = face ? list_reversed(cut, sign, face) : 0;
    ebpo_status status = face ? EBPO_OK : ebpo_fail_memory(error, 4 * (uint64_t)cut->faces->count);
    if (count > 0) {
        options.threads = cut->faces->boolean->threads;
        options.progress = *progress;
        status = make_mesh(cut->faces, face, count, &mesh, error);
        if (status == EBPO_OK)
            status = ebpo_mesh_check(&mesh, options.threads, *progress, &report, error);
        if (status == EBPO_OK)
            status = ebpo_mesh_self_intersections(&mesh, &report, &options, stop_at_first, &found,
                                                  NULL, error);
        ebpo_mesh_free(&mesh);
    }
    free(face);
    return status == EBPO_OK && found ? ebpo_fail(error, EBPO_E_UNSUPPORTED,
                                                  "operand 1 is reversed where %s", base_not_simple)
                                      : status;
}

/* --- all of it --- */

/* Makes a bit for each corner: 1 for two corners of each listed face of the base without area. */
static uint64_t *mark_flat(const ebpo_face_list *faces)
{
    uint64_t *flat = ebpo_alloc_zero(faces->given_corners / 64 + 1, sizeof *flat);
    for (uint32_t f = faces->first[0]; f < faces->first[1] && flat; f++)
        for (int i = 1; i < 3 && faces->face[f][0] == EBPO_NO_CORNER; i++)
            ebpo_set_bit(flat, faces->face[f][i]);
    return flat;
}

/* Returns true if each edge occurs in the selected triangles equally often in both directions.
 *
 * An edge of only one triangle is not tested if the triangle's face is whole. Then the edge's other
 * face is a whole face of the same component that is not listed. If the faces of the base that are
 * not listed stay in the result (keeps_base), the difference between the selected triangles and all
 * triangles of the base is tested. The base is closed, so the result is closed if this difference
 * is closed.
 *
 * If faces of the base that are not listed may stay or be removed (base_differs), one of the two
 * tests must succeed. The faces around an edge of a face that is not listed all stay, or are all
 * removed, because no other operand has a face there. flat (mark_flat): listed faces without area
 * have no triangles and the state of keeps_base, so only the first test is correct at their edges.
 */
static bool is_closed(const ebpo_cut_mesh *cut, const edge_lists *e, const uint64_t *flat,
                      const int8_t *sign)
{
    const ebpo_face_list *faces = cut->faces;
    for (uint64_t i = 0, next, all = 3 * cut->count, v = 0; i < all; i = next) {
        int64_t balance = 0, base = 0; /* of the selected triangles, and of the base */
        uint32_t operand, other = other_vertex(e->edge[i]);
        while (e->begin[v + 1] <= i)
            v++;
        for (next = i; next < e->begin[v + 1] && other_vertex(e->edge[next]) == other; next++) {
            uint32_t t = triangle_of(e->edge[next]);
            int direction = e->edge[next] & 1 ? -1 : 1;
            balance += direction * sign[t];
            base += ebpo_face_list_is_base(faces, ebpo_face_list_operand(faces, cut->face[t]))
                        ? direction
                        : 0;
        }
        if (balance == (faces->keeps_base ? base : 0) ||
            (next - i == 1 &&
             component_of(cut, triangle_of(e->edge[i]), &operand) != EBPO_NO_COMPONENT))
            continue;
        bool given = other < faces->given_corners && v < faces->given_corners;
        if (!faces->base_differs || balance != (faces->keeps_base ? 0 : base) ||
            (given && (ebpo_has_bit(flat, v) || ebpo_has_bit(flat, other))))
            return false;
    }
    return true;
}

ebpo_status ebpo_cut_mesh_classify(const ebpo_cut_mesh *cut, const ebpo_progress *progress,
                                   int8_t **sign, uint64_t *patches, ebpo_error *error)
{
    edge_lists e = { 0 };
    uint64_t *flat = mark_flat(cut->faces);
    uint32_t *parent = ebpo_alloc(cut->count, sizeof *parent);
    *sign = ebpo_alloc_zero(cut->count, sizeof **sign);
    ebpo_status status = parent && *sign && flat
                             ? EBPO_OK
                             : ebpo_fail_memory(error, cut->count * (sizeof *parent + 1));
    if (status == EBPO_OK && !ebpo_progress_stage(progress, "join patches", error))
        status = EBPO_E_CANCELLED;
    if (status == EBPO_OK)
        status = list_edges(&e, cut, error);
    if (status == EBPO_OK) {
        join_patches(cut, &e, parent);
        status = join_components(cut, parent, error);
    }
    if (status == EBPO_OK)
        status = classify_patches(cut, parent, progress, *sign, patches, error);
    if (status == EBPO_OK && !is_closed(cut, &e, flat, *sign))
        status =
            cut->faces->changed_only
                ? ebpo_fail(error, EBPO_E_UNSUPPORTED, "operand 1 is cut where %s", base_not_simple)
                : ebpo_fail(error, EBPO_E_FORMAT,
                            "the result is not closed; check that the operands are closed (ebpo "
                            "verify)");
    if (status == EBPO_OK && cut->faces->changed_only)
        status = check_reversed(cut, *sign, progress, error);
    free_edges(&e);
    free(flat);
    free(parent);
    return status;
}
