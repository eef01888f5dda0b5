/* Cuts an envelope into fragments, for bounds of the distance by which the envelope extends beyond
 * the model. The envelope of a node is a convex polyhedron that contains the part of the solid in
 * the node's cell. Gray nodes have children, leaves list faces, and black nodes are inside the
 * solid. Fragments are convex polytopes in the cell coordinates of a node; together they cover the
 * envelope. The unit of length is a power of two near the longest side of the node's cell, so that
 * no length overflows or underflows. At every cut, both parts extend slightly beyond the cut, so
 * that no point is lost within the tolerances of ebpo_polytope_clip.
 *
 * Fragments are first cut along the cells of the model's tree, down to leaves. Within leaves, they
 * are cut along the planes of faces, or halved, until each fragment is inside the solid, outside
 * the solid, or small. This file also reads the trees (fragments.h). */
#include "core/strict_fp.h"

#include <math.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "derive/fragments.h"
#include "format/reader.h"
#include "geometry/distance.h"

/* A computed root of a sum of three squares, multiplied by this factor, is an upper bound despite
 * rounding. */
static const double rounding_factor = 1 + 0x1p-40;

void ebpo_cell_frame_make(ebpo_cell_frame *out, const ebpo_box *box, ebpo_cell cell)
{
    double longest = 0, largest = 0;
    out->cell = cell;
    for (int k = 0; k < 3; k++) {
        out->low[k] = ebpo_cell_face(box, k, cell.level, cell.at[k]);
        out->high[k] = ebpo_cell_face(box, k, cell.level, cell.at[k] + 1);
        out->size[k] = box->size[k] * ebpo_half_power(cell.level);
        longest = fmax(longest, out->size[k]);
        largest = fmax(largest, fmax(fabs(out->low[k]), fabs(out->high[k])));
    }
    frexp(longest, &out->exponent);
    out->factor[0] = ldexp(1, -out->exponent / 2);
    out->factor[1] = ldexp(1, -out->exponent - -out->exponent / 2);
    for (int k = 0; k < 3; k++)
        out->side[k] = out->size[k] * out->factor[0] * out->factor[1];
    /* The rounding error is a few ulp of the largest coordinate, and of the least positive number.
     */
    out->grain = 0x1p-49 * ebpo_cell_frame_length(out, largest) + 0x1p-50 +
                 ebpo_cell_frame_length(out, 0x1p-1070);
}

void ebpo_cell_frame_point(const ebpo_cell_frame *f, const double xi[3], double out[3])
{
    for (int k = 0; k < 3; k++) {
        double x = xi[k] <= 0   ? f->low[k]
                   : xi[k] >= 1 ? f->high[k]
                                : f->low[k] + xi[k] * f->size[k];
        out[k] = fmin(fmax(x, f->low[k]), f->high[k]);
    }
}

double ebpo_cell_frame_length(const ebpo_cell_frame *f, double length)
{
    return length * f->factor[0] * f->factor[1];
}

double ebpo_cell_frame_model_length(const ebpo_cell_frame *f, double length)
{
    double out = ldexp(length, f->exponent);
    return length > 0 && ebpo_cell_frame_length(f, out) < length ? nextafter(out, INFINITY) : out;
}

double ebpo_cell_frame_apart(const ebpo_cell_frame *f, const double a[3], const double b[3])
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        double d = (a[k] - b[k]) * f->side[k];
        sum += d * d;
    }
    return sqrt(sum) * rounding_factor + f->grain;
}

double ebpo_cell_frame_diagonal(const ebpo_cell_frame *f, int levels)
{
    double sum = 0;
    for (int k = 0; k < 3; k++)
        sum += f->side[k] * f->side[k];
    return sqrt(sum) * rounding_factor * (1 + 1 / 128.0) * ebpo_half_power(levels) + f->grain;
}

double ebpo_cell_frame_distance(const ebpo_cell_frame *f, const double xi[3],
                                const double triangle[3][3])
{
    double p[3], t[3][3];
    ebpo_distance_bounds bounds;
    ebpo_cell_frame_point(f, xi, p);
    for (int k = 0; k < 3; k++) {
        p[k] = ebpo_cell_frame_length(f, p[k]);
        for (int i = 0; i < 3; i++)
            t[i][k] = ebpo_cell_frame_length(f, triangle[i][k]);
    }
    ebpo_triangle_distance_bounds(p, (const double(*)[3])t, &bounds);
    return bounds.hi + f->grain;
}

/* Converts a triangle of the model to cell coordinates. Returns a bound of the rounding error of
 * the converted coordinates. */
static double cell_frame_triangle(const ebpo_cell_frame *f, const double triangle[3][3],
                                  double out[3][3])
{
    double largest = 1, least = INFINITY;
    for (int k = 0; k < 3; k++) {
        least = fmin(least, f->side[k]);
        for (int i = 0; i < 3; i++) {
            out[i][k] = (triangle[i][k] - f->low[k]) / f->size[k];
            largest = fmax(largest, fabs(out[i][k]));
        }
    }
    return 0x1p-50 * largest + f->grain / least;
}

enum { CUT_TAG = 1 << 20 }; /* tag of the polygons that cuts add to a polytope */

void ebpo_extent_of(const ebpo_polytope *p, ebpo_extent *out)
{
    for (int k = 0; k < 3; k++) {
        out->min[k] = INFINITY;
        out->max[k] = -INFINITY;
        for (int i = 0; i < p->vertex_count; i++) {
            out->min[k] = fmin(out->min[k], p->vertex[i][k]);
            out->max[k] = fmax(out->max[k], p->vertex[i][k]);
        }
    }
}

/* Computes the part of `p` with x[axis] <= at (side 0) or with x[axis] >= at (side 1). If the part
 * on the other side of the cut is thin, the result includes that part. Returns false if the part on
 * this side is empty or thin. */
static bool cut_axis(const ebpo_polytope *p, int axis, int side, double at, ebpo_polytope *out)
{
    double n[3] = { 0, 0, 0 };
    ebpo_extent e;
    ebpo_extent_of(p, &e);
    /* Clipping fails if almost nothing would remain. So a thin part cannot be cut off, and the thin
     * part stays with the thick part. */
    bool high_is_thin = e.max[axis] - at <= EBPO_CUT_THIN,
         low_is_thin = !high_is_thin && at - e.min[axis] <= EBPO_CUT_THIN;
    if (side ? high_is_thin : low_is_thin)
        return false;
    ebpo_polytope_copy(out, p);
    n[axis] = side ? -1 : 1;
    if (!high_is_thin && !low_is_thin)
        /* if clipping fails, the part stays larger than necessary */
        (void)ebpo_polytope_clip(out, n, (side ? -at : at) + EBPO_CUT_SLACK, CUT_TAG);
    return true;
}

/* Computes the part of `p` with n . x <= d. The length of n is 1. Returns false when clipping
 * fails. */
static bool cut_plane(const ebpo_polytope *p, const double n[3], double d, ebpo_polytope *out)
{
    ebpo_polytope_copy(out, p);
    return ebpo_polytope_clip(out, n, d + EBPO_CUT_SLACK, CUT_TAG) != EBPO_CLIP_REFUSED;
}

ebpo_status ebpo_tree_read_whole(ebpo_lod_model *out, const ebpo_file *file, unsigned threads,
                                 ebpo_error *error)
{
    const ebpo_info *info = ebpo_file_info(file);
    if (!(info->parts & EBPO_PART_MESH))
        return ebpo_fail_file(error, EBPO_E_ABSENT, file->in.shown,
                              "error bounds are measured against the mesh, which the file does "
                              "not have; use a file with its mesh (`ebpo convert`)");
    if (info->pruned)
        return ebpo_fail_file(error, EBPO_E_ABSENT, file->in.shown,
                              "is a subset, but error bounds are measured against the whole "
                              "mesh; use the original file");
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    read.threads = threads;
    ebpo_status status = ebpo_lod_model_read(out, file, info->level_count - 1, &read, error);
    if (status == EBPO_OK && !out->mesh.faces)
        status = ebpo_file_read_mesh(file, &read, &out->mesh, error);
    if (status != EBPO_OK)
        ebpo_lod_model_free(out);
    return status;
}

/* Moves a cursor to the node of a cell; returns false if the tree has no such node. */
static bool go_to(ebpo_cursor *c, ebpo_level_nodes *nodes, ebpo_cell cell, ebpo_node *out)
{
    ebpo_cursor_begin(c, &ebpo_level_source, nodes, ebpo_level_root(nodes));
    bool found = ebpo_cursor_to_cell(c, cell, NULL) == EBPO_OK;
    *out = *ebpo_cursor_node(c);
    return found && out->cell.level == cell.level;
}

bool ebpo_tree_find(const ebpo_lod_model *tree, ebpo_cell cell, ebpo_node *out)
{
    ebpo_level_nodes nodes = ebpo_lod_model_nodes(tree);
    ebpo_cursor c;
    return go_to(&c, &nodes, cell, out);
}

bool ebpo_tree_bounds(const ebpo_lod_model *tree, ebpo_cell cell, bool include_node, ebpo_node *out,
                      ebpo_half_spaces *half_spaces)
{
    ebpo_level_nodes nodes = ebpo_lod_model_nodes(tree);
    ebpo_cursor c;
    return go_to(&c, &nodes, cell, out) &&
           ebpo_cursor_half_spaces(&c, include_node, half_spaces, NULL) == EBPO_OK;
}

ebpo_status ebpo_tree_derive(const ebpo_lod_model *tree, const ebpo_node *leaf,
                             ebpo_leaf_scratch *scratch, ebpo_half_spaces *half_spaces,
                             ebpo_error *error)
{
    ebpo_polytope inherited;
    uint32_t codes[EBPO_PLANES_MAX];
    int count = 0;
    ebpo_half_spaces_cut(half_spaces, 0, &inherited);
    ebpo_status status = ebpo_lod_leaf_planes(tree, leaf->cell, leaf->rank, scratch, &inherited,
                                              codes, &count, error);
    if (status == EBPO_OK)
        ebpo_half_spaces_add(half_spaces, codes, (uint64_t)count);
    return status;
}

/* A fragment with at most this number of faces is cut along the planes of its faces; a fragment
 * with more faces is halved. */
enum { CUT_FACES = 64 };
/* A plane cuts a fragment only if the fragment extends to at least this distance (in cell
 * coordinates) on both sides of the plane. The distance is more than the width that
 * ebpo_polytope_clip refuses. */
static const double side_least = 2e-7;

/* --- the stack --- */

ebpo_status ebpo_fragment_push(ebpo_bounder *b, ebpo_fragment_kind kind,
                               const ebpo_fragment *parent, ebpo_fragment **out)
{
    double upper = parent ? parent->upper : INFINITY;
    int levels = parent ? parent->levels : 0;
    double beyond = parent ? parent->beyond : 0;
    ebpo_node node = parent ? parent->node : (ebpo_node){ .rank = 0 };
    if (!ebpo_grow(&b->fragments, &b->fragment_capacity, b->fragment_count + 1,
                   sizeof *b->fragments))
        return ebpo_fail_memory(b->error, (b->fragment_count + 1) * sizeof *b->fragments);
    *out = &b->fragments[b->fragment_count++];
    (*out)->kind = kind;
    (*out)->upper = upper;
    (*out)->levels = levels;
    (*out)->beyond = beyond;
    (*out)->node = node;
    (*out)->face_first = b->face_count;
    (*out)->face_count = 0;
    return EBPO_OK;
}

/* Pushes a fragment like ebpo_fragment_push, and sets its polytope to `p`. */
static ebpo_status push_polytope(ebpo_bounder *b, ebpo_fragment_kind kind,
                                 const ebpo_fragment *parent, const ebpo_polytope *p,
                                 ebpo_fragment **out)
{
    ebpo_status status = ebpo_fragment_push(b, kind, parent, out);
    if (status == EBPO_OK)
        ebpo_polytope_copy(&(*out)->p, p);
    return status;
}

/* Lists the faces that may intersect a fragment, among the `count` faces that begin at `first` in
 * the stack of faces. Copies the listed faces to the top of this stack. */
static ebpo_status copy_faces(ebpo_bounder *b, ebpo_fragment *fragment, uint64_t first,
                              uint64_t count)
{
    ebpo_extent e;
    ebpo_extent_of(&fragment->p, &e);
    fragment->face_first = b->face_count;
    if (!ebpo_grow(&b->faces, &b->face_capacity, b->face_count + count, sizeof *b->faces))
        return ebpo_fail_memory(b->error, (b->face_count + count) * sizeof *b->faces);
    for (uint64_t i = first; i < first + count; i++) {
        double t[3][3],
            error = cell_frame_triangle(&b->frame, (const double(*)[3])b->faces[i], t) + 1e-9;
        bool overlaps = true;
        for (int k = 0; k < 3; k++)
            overlaps = overlaps && fmin(fmin(t[0][k], t[1][k]), t[2][k]) <= e.max[k] + error &&
                       fmax(fmax(t[0][k], t[1][k]), t[2][k]) >= e.min[k] - error;
        if (overlaps)
            memcpy(b->faces[b->face_count++], b->faces[i], sizeof *b->faces);
    }
    fragment->face_count = b->face_count - fragment->face_first;
    return EBPO_OK;
}

ebpo_status ebpo_fragment_leaf_faces(ebpo_bounder *b, ebpo_fragment *fragment,
                                     const ebpo_node *leaf)
{
    uint64_t count = 0, first = b->face_count;
    ebpo_status status =
        ebpo_lod_leaf_faces(b->model_tree, leaf->cell, leaf->rank, &b->scratch, &count, b->error);
    if (status == EBPO_OK &&
        !ebpo_grow(&b->faces, &b->face_capacity, first + count, sizeof *b->faces))
        status = ebpo_fail_memory(b->error, (first + count) * sizeof *b->faces);
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++)
        memcpy(b->faces[b->face_count++], b->scratch.faces[i].corner, sizeof *b->faces);
    fragment->face_first = first;
    fragment->face_count = count;
    return status;
}

/* --- cutting --- */

/* Computes the box of a cell that is `levels` levels below the envelope's node, in the cell
 * coordinates of the envelope's node. */
static void find_cell_faces(const ebpo_bounder *b, ebpo_cell cell, int levels, double low[3],
                            double high[3])
{
    double side = ebpo_half_power(levels);
    for (int k = 0; k < 3; k++) {
        uint32_t first = b->frame.cell.at[k] << levels;
        low[k] = (double)(cell.at[k] - first) * side;
        high[k] = (double)(cell.at[k] - first + 1) * side;
    }
}

/* Returns the distance by which a fragment extends beyond its cell: up to EBPO_CUT_THIN if the thin
 * part of a neighbour stayed with the fragment, otherwise up to EBPO_CUT_SLACK. A bound for the
 * cell plus this distance is a bound for the fragment. The distance must not be ignored: many
 * levels below the envelope's node, these widths are not small compared with the fragment's cell.
 */
static double find_beyond(const ebpo_bounder *b, const ebpo_polytope *p, ebpo_cell cell, int levels)
{
    double low[3], high[3], origin[3] = { 0, 0, 0 }, apart[3];
    ebpo_extent e;
    ebpo_extent_of(p, &e);
    find_cell_faces(b, cell, levels, low, high);
    for (int k = 0; k < 3; k++)
        apart[k] = fmax(fmax(low[k] - e.min[k], e.max[k] - high[k]), 0);
    return ebpo_cell_frame_apart(&b->frame, apart, origin);
}

ebpo_fragment_kind ebpo_fragment_kind_in(const ebpo_bounder *b, const ebpo_node *node)
{
    const ebpo_level *level = &b->model_tree->level[node->cell.level];
    return node->type == EBPO_GRAY ? EBPO_FRAGMENT_GRAY
           : node->type == EBPO_LEAF &&
                   (level->leaf_new[node->rank] || level->leaf_ref_count[node->rank])
               ? EBPO_FRAGMENT_LEAF
               : EBPO_FRAGMENT_OUTSIDE;
}

/* Raises the upper bound of the search to the bound of a fragment in a black cell. The fragment is
 * inside the solid, except for thin parts of neighbouring cells that stayed with it. Parts within
 * EBPO_CUT_SLACK of the cell are ignored, because fragments of the neighbouring cells cover them,
 * too. */
static void bound_black(ebpo_bounder *b, const ebpo_polytope *p, ebpo_cell cell, int levels)
{
    double low[3], high[3];
    bool has_thin_parts = false;
    ebpo_extent e;
    ebpo_extent_of(p, &e);
    find_cell_faces(b, cell, levels, low, high);
    for (int k = 0; k < 3; k++)
        has_thin_parts = has_thin_parts || e.min[k] < low[k] - EBPO_CUT_SLACK ||
                         e.max[k] > high[k] + EBPO_CUT_SLACK;
    if (has_thin_parts)
        ebpo_bound_raise(b, find_beyond(b, p, cell, levels));
}

/* Cuts a fragment in a gray node's cell along the cells of the node's children. */
static ebpo_status cut_gray(ebpo_bounder *b, const ebpo_fragment *fragment)
{
    ebpo_polytope z, y, x;
    ebpo_status status = EBPO_OK;
    ebpo_level_nodes nodes = ebpo_lod_model_nodes(b->model_tree);
    double low[3], half = .5 * ebpo_half_power(fragment->levels);
    for (int k = 0; k < 3; k++)
        low[k] = (double)(fragment->node.cell.at[k] - (b->frame.cell.at[k] << fragment->levels)) *
                 2 * half;
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++) {
        ebpo_node child = ebpo_level_child(&nodes, &fragment->node, octant);
        ebpo_fragment *next = NULL;
        if (!cut_axis(&fragment->p, 2, octant >> 2 & 1, low[2] + half, &z) ||
            !cut_axis(&z, 1, octant >> 1 & 1, low[1] + half, &y) ||
            !cut_axis(&y, 0, octant & 1, low[0] + half, &x))
            continue;
        if (child.type == EBPO_BLACK) {
            bound_black(b, &x, child.cell, fragment->levels + 1);
            continue;
        }
        status = push_polytope(b, ebpo_fragment_kind_in(b, &child), fragment, &x, &next);
        if (status != EBPO_OK)
            break;
        next->levels++;
        next->node = child;
        next->beyond = find_beyond(b, &next->p, child.cell, next->levels);
        if (child.type == EBPO_LEAF)
            status = ebpo_fragment_leaf_faces(b, next, &child);
    }
    return status;
}

/* Halves a fragment across its longest side, and pushes the halves. `kind`: kind of the halves. */
static ebpo_status cut_longest(ebpo_bounder *b, const ebpo_fragment *fragment,
                               ebpo_fragment_kind kind)
{
    ebpo_extent e;
    int axis = 0;
    ebpo_status status = EBPO_OK;
    ebpo_extent_of(&fragment->p, &e);
    for (int k = 1; k < 3; k++)
        if ((e.max[k] - e.min[k]) * b->frame.side[k] >
            (e.max[axis] - e.min[axis]) * b->frame.side[axis])
            axis = k;
    for (int side = 0; side < 2 && status == EBPO_OK; side++) {
        ebpo_polytope part;
        ebpo_fragment *next = NULL;
        if (!cut_axis(&fragment->p, axis, side, .5 * e.min[axis] + .5 * e.max[axis], &part))
            continue;
        status = push_polytope(b, kind, fragment, &part, &next);
        if (status == EBPO_OK && kind == EBPO_FRAGMENT_LEAF)
            status = copy_faces(b, next, fragment->face_first, fragment->face_count);
    }
    return status;
}

/* Computes the plane of a face in cell coordinates, with a normal of length 1. Returns false if the
 * rounding error of the plane may be too large. */
static bool find_plane(const ebpo_bounder *b, uint64_t face, double n[3], double *d)
{
    double t[3][3], u[3], v[3],
        error = cell_frame_triangle(&b->frame, (const double(*)[3])b->faces[face], t);
    for (int k = 0; k < 3; k++) {
        u[k] = t[1][k] - t[0][k];
        v[k] = t[2][k] - t[0][k];
    }
    for (int k = 0; k < 3; k++)
        n[k] = u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3];
    double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]), edge = 0;
    for (int k = 0; k < 3; k++)
        edge += fabs(u[k]) + fabs(v[k]);
    /* An error of a corner tilts the plane by about error * edge / length. The tilt moves points of
     * the plane in proportion to their distance, which is at most about the side of the cell or the
     * length of an edge. */
    if (!(length > 0) || !(error * edge / length * (1 + edge) < 1e-9))
        return false;
    for (int k = 0; k < 3; k++)
        n[k] /= length;
    *d = n[0] * t[0][0] + n[1] * t[0][1] + n[2] * t[0][2];
    return true;
}

/* Cuts a fragment along the plane n . x = d, and pushes both parts. The length of n is 1. Sets
 * *done to false if clipping fails; then no part is pushed. */
static ebpo_status cut_along(ebpo_bounder *b, const ebpo_fragment *fragment,
                             ebpo_fragment_kind kind, const double n[3], double d, bool *done)
{
    ebpo_polytope side[2];
    double back[3] = { -n[0], -n[1], -n[2] };
    ebpo_status status = EBPO_OK;
    *done = cut_plane(&fragment->p, n, d, &side[0]) && cut_plane(&fragment->p, back, -d, &side[1]);
    for (int i = 0; i < 2 && *done && status == EBPO_OK; i++) {
        ebpo_fragment *next = NULL;
        status = push_polytope(b, kind, fragment, &side[i], &next);
        if (status == EBPO_OK && kind == EBPO_FRAGMENT_LEAF)
            status = copy_faces(b, next, fragment->face_first, fragment->face_count);
    }
    return status;
}

/* Cuts a fragment that is outside the solid. The cut is along a side of the prism that stands
 * perpendicularly on the face nearest to the fragment's centre. Within this prism, the distance to
 * the face's plane is the distance to the face, so a flat surface needs no small fragments. If the
 * fragment is much larger than the face, or no side of the prism cuts the fragment, the fragment is
 * halved. */
static ebpo_status cut_prism(ebpo_bounder *b, const ebpo_fragment *fragment,
                             const ebpo_fragment_measure *measure)
{
    double t[3][3], edge[3][3], normal[3], longest = 0;
    bool done = false;
    ebpo_status status = EBPO_OK;
    (void)cell_frame_triangle(&b->frame, measure->face, t);
    for (int i = 0; i < 3; i++) {
        double sum = 0;
        for (int k = 0; k < 3; k++) {
            edge[i][k] = (t[(i + 1) % 3][k] - t[i][k]) * b->frame.side[k];
            sum += edge[i][k] * edge[i][k];
        }
        longest = fmax(longest, sqrt(sum));
    }
    for (int k = 0; k < 3; k++)
        normal[k] = edge[0][(k + 1) % 3] * edge[1][(k + 2) % 3] -
                    edge[0][(k + 2) % 3] * edge[1][(k + 1) % 3];
    for (int i = 0; i < 3 && measure->radius <= 2 * longest && !done && status == EBPO_OK; i++) {
        double n[3], d = 0, length = 0, greatest = -INFINITY, least = INFINITY;
        for (int k = 0; k < 3; k++) {
            n[k] = (edge[i][(k + 1) % 3] * normal[(k + 2) % 3] -
                    edge[i][(k + 2) % 3] * normal[(k + 1) % 3]) *
                   b->frame.side[k];
            length += n[k] * n[k];
        }
        length = sqrt(length);
        for (int k = 0; k < 3; k++) {
            n[k] /= length;
            d += n[k] * t[i][k];
        }
        for (int v = 0; v < fragment->p.vertex_count; v++) {
            double e = n[0] * fragment->p.vertex[v][0] + n[1] * fragment->p.vertex[v][1] +
                       n[2] * fragment->p.vertex[v][2] - d;
            greatest = fmax(greatest, e);
            least = fmin(least, e);
        }
        /* For a face without area, both values are NAN, and both comparisons are false. */
        if (greatest > side_least && least < -side_least)
            status = cut_along(b, fragment, EBPO_FRAGMENT_OUTSIDE, n, d, &done);
    }
    return status != EBPO_OK || done ? status : cut_longest(b, fragment, EBPO_FRAGMENT_OUTSIDE);
}

/* Returns a bound of the distance from the solid for the points of a fragment whose centre is
 * inside the solid. The planes of the fragment's faces must cut off only thin outermost parts of
 * the fragment. A segment from the centre to a point of the fragment can leave the solid only
 * behind the plane of a face. The part of the segment behind the plane is at most as long as the
 * returned bound. The leaf does not list the faces behind its cell faces. So a cell face of the
 * leaf counts as a plane, too, if the fragment extends beyond it by more than EBPO_CUT_SLACK.
 * Returns INFINITY if the planes are too uncertain for a bound. */
static double behind_faces(const ebpo_bounder *b, const ebpo_fragment *fragment,
                           const ebpo_fragment_measure *measure)
{
    double share = 0, low[3], high[3];
    ebpo_extent all;
    ebpo_extent_of(&fragment->p, &all);
    find_cell_faces(b, fragment->node.cell, fragment->levels, low, high);
    for (int k = 0; k < 3; k++)
        for (int side = 0; side < 2; side++) {
            double beyond = side ? all.max[k] - high[k] : low[k] - all.min[k],
                   centre_to_side =
                       side ? high[k] - measure->centre[k] : measure->centre[k] - low[k];
            if (beyond > EBPO_CUT_SLACK && !(centre_to_side > 0))
                /* The centre is beyond the cell face, so there is no bound. */
                return INFINITY;
            if (beyond > EBPO_CUT_SLACK)
                share = fmax(share, (beyond + 2e-9) / (beyond + 2e-9 + centre_to_side));
        }
    for (uint64_t i = 0; i < fragment->face_count; i++) {
        double n[3], d, farthest_from_plane[2] = { 0, 0 };
        if (!find_plane(b, fragment->face_first + i, n, &d))
            return INFINITY;
        double centre_to_plane =
            n[0] * measure->centre[0] + n[1] * measure->centre[1] + n[2] * measure->centre[2] - d;
        for (int v = 0; v < fragment->p.vertex_count; v++) {
            double e = n[0] * fragment->p.vertex[v][0] + n[1] * fragment->p.vertex[v][1] +
                       n[2] * fragment->p.vertex[v][2] - d;
            farthest_from_plane[e > 0] = fmax(farthest_from_plane[e > 0], fabs(e));
        }
        double behind = farthest_from_plane[centre_to_plane < 0] + 2e-9;
        share = fmax(share, behind / (behind + fabs(centre_to_plane)));
    }
    return share * measure->radius + b->frame.grain;
}

/* Returns true if the node's cell is so thin along an axis that the planes of faces are too
 * uncertain to distinguish inside and outside. */
static bool is_flat(const ebpo_bounder *b)
{
    return fmin(fmin(b->frame.side[0], b->frame.side[1]), b->frame.side[2]) < 1e10 * b->frame.grain;
}

/* Cuts a fragment within a leaf of a solid. If the plane of a listed face cuts the fragment, the
 * fragment is cut along this plane. If no such plane cuts the fragment, the fragment is inside or
 * outside the solid, except for thin outermost parts. Then its bound is computed. If this bound is
 * not good enough, the fragment is cut in another way. */
static ebpo_status cut_leaf(ebpo_bounder *b, const ebpo_fragment *fragment,
                            const ebpo_fragment_measure *measure)
{
    /* usable: all planes so far are certain, and the fragment does not have too many faces */
    bool done = false, usable = fragment->face_count <= CUT_FACES;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < fragment->face_count && usable && !done && status == EBPO_OK; i++) {
        double n[3], d, greatest = -INFINITY, least = INFINITY;
        usable = find_plane(b, fragment->face_first + i, n, &d);
        for (int v = 0; v < fragment->p.vertex_count && usable; v++) {
            double e = n[0] * fragment->p.vertex[v][0] + n[1] * fragment->p.vertex[v][1] +
                       n[2] * fragment->p.vertex[v][2] - d;
            greatest = fmax(greatest, e);
            least = fmin(least, e);
        }
        if (usable && greatest > side_least && least < -side_least) {
            status = cut_along(b, fragment, EBPO_FRAGMENT_LEAF, n, d, &done);
            usable = done;
        }
    }
    if (status != EBPO_OK || done)
        return status;
    /* In a flat cell, inside and outside cannot be distinguished. So the model is treated as a
     * surface, and all of the fragment as outside. */
    if (!usable && is_flat(b))
        return cut_prism(b, fragment, measure);
    if (!usable)
        return cut_longest(b, fragment, EBPO_FRAGMENT_LEAF);
    if (measure->distance >= 0)
        return cut_prism(b, fragment, measure);
    double behind = behind_faces(b, fragment, measure);
    if (behind > EBPO_FRAGMENT_LEAST && behind > b->target)
        return cut_longest(b, fragment, EBPO_FRAGMENT_LEAF);
    ebpo_bound_raise(b, fmin(behind, measure->upper));
    return EBPO_OK;
}

ebpo_status ebpo_fragment_cut(ebpo_bounder *b, const ebpo_fragment *fragment,
                              const ebpo_fragment_measure *measure)
{
    switch (fragment->kind) {
    case EBPO_FRAGMENT_GRAY: return cut_gray(b, fragment);
    case EBPO_FRAGMENT_LEAF:
        return b->model_tree->info->solid ? cut_leaf(b, fragment, measure)
                                          : cut_prism(b, fragment, measure);
    case EBPO_FRAGMENT_OUTSIDE: break;
    }
    return cut_prism(b, fragment, measure);
}
