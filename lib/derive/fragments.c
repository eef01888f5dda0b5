/* Cuts an envelope into fragments, for bounds of its distance to the model. Fragments are convex
 * polytopes in the cell
 * coordinates of a node, which together cover the envelope. Lengths are in units of a power of two
 * near the cell's longest side, so that nothing overflows or underflows. Every cut keeps slightly
 * too much on both sides, so that the tolerances of ebpo_polytope_clip lose nothing. Fragments
 * follow the model's tree down to leaves and are then cut along the planes of faces, or halved,
 * until each is inside, outside, or small. This file also reads the trees: the tree whose envelopes
 * are measured, and the tree of the whole model, which determines the solid. */
#include "core/strict_fp.h"

#include <math.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "derive/fragments.h"
#include "format/reader.h"
#include "geometry/distance.h"

/* exceeds the few roundings of a sum of squares and its root */
static const double up = 1 + 0x1p-40;

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
    /* A few ulp of the largest coordinate, and of the least positive number. */
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
    return sqrt(sum) * up + f->grain;
}

double ebpo_cell_frame_diagonal(const ebpo_cell_frame *f, int levels)
{
    double sum = 0;
    for (int k = 0; k < 3; k++)
        sum += f->side[k] * f->side[k];
    return sqrt(sum) * up * (1 + 1 / 128.0) * ebpo_half_power(levels) + f->grain;
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

/* Converts a triangle of the model to cell coordinates; returns a bound of the rounding error of a
 * coordinate. */
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

enum { CUT_TAG = 1 << 20 };

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

/* Computes the part with x[axis] <= at (side 0) or >= at (side 1), plus a thin part of the other
 * side. Returns false if this part is empty or thin. */
static bool cut_axis(const ebpo_polytope *p, int axis, int side, double at, ebpo_polytope *out)
{
    double n[3] = { 0, 0, 0 };
    ebpo_extent e;
    ebpo_extent_of(p, &e);
    /* Clipping fails where almost nothing would remain, and a box around a thin part extends far
     * beyond it. So a thin part stays with the thick part. */
    bool high_is_thin = e.max[axis] - at <= EBPO_CUT_THIN,
         low_is_thin = !high_is_thin && at - e.min[axis] <= EBPO_CUT_THIN;
    if (side ? high_is_thin : low_is_thin)
        return false;
    ebpo_polytope_copy(out, p);
    n[axis] = side ? -1 : 1;
    if (!high_is_thin && !low_is_thin)
        /* where clipping still fails, the part stays too large */
        (void)ebpo_polytope_clip(out, n, (side ? -at : at) + EBPO_CUT_SLACK, CUT_TAG);
    return true;
}

/* Computes the part with n . x <= d, |n| = 1; returns false when clipping fails. */
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
                              "is a subset, and error bounds are measured against the whole "
                              "mesh; use the original");
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    read.threads = threads;
    ebpo_status status = ebpo_lod_model_read(out, file, info->level_count - 1, &read, error);
    if (status == EBPO_OK && !out->mesh.faces)
        status = ebpo_file_read_mesh(file, &read, &out->mesh, error);
    if (status != EBPO_OK)
        ebpo_lod_model_free(out);
    return status;
}

static bool go_to(ebpo_cursor *c, ebpo_level_nodes *nodes, ebpo_cell cell, ebpo_node *out)
{
    ebpo_cursor_begin(c, &ebpo_level_source, nodes, ebpo_level_root(nodes));
    bool good = ebpo_cursor_to_cell(c, cell, NULL) == EBPO_OK;
    *out = *ebpo_cursor_node(c);
    return good && out->cell.level == cell.level;
}

bool ebpo_tree_find(const ebpo_lod_model *tree, ebpo_cell cell, ebpo_node *out)
{
    ebpo_level_nodes nodes = ebpo_lod_model_nodes(tree);
    ebpo_cursor c;
    return go_to(&c, &nodes, cell, out);
}

bool ebpo_tree_bounds(const ebpo_lod_model *tree, ebpo_cell cell, bool own, ebpo_node *out,
                      ebpo_half_spaces *halves)
{
    ebpo_level_nodes nodes = ebpo_lod_model_nodes(tree);
    ebpo_cursor c;
    return go_to(&c, &nodes, cell, out) &&
           ebpo_cursor_half_spaces(&c, own, halves, NULL) == EBPO_OK;
}

ebpo_status ebpo_tree_derive(const ebpo_lod_model *tree, const ebpo_node *leaf,
                             ebpo_leaf_scratch *scratch, ebpo_half_spaces *halves,
                             ebpo_error *error)
{
    ebpo_polytope inherited;
    uint32_t codes[EBPO_PLANES_MAX];
    int count = 0;
    ebpo_half_spaces_cut(halves, 0, &inherited);
    ebpo_status status = ebpo_lod_leaf_planes(tree, leaf->cell, leaf->rank, scratch, &inherited,
                                              codes, &count, error);
    if (status == EBPO_OK)
        ebpo_half_spaces_add(halves, codes, (uint64_t)count);
    return status;
}

/* maximum number of faces to cut along; a fragment with more faces is halved */
enum { CUT_FACES = 64 };
/* a plane cuts only a fragment that extends this far, in cells, to both sides of the plane; this is
 * more than the width that ebpo_polytope_clip refuses */
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

static ebpo_status push_polytope(ebpo_bounder *b, ebpo_fragment_kind kind,
                                 const ebpo_fragment *parent, const ebpo_polytope *p,
                                 ebpo_fragment **out)
{
    ebpo_status status = ebpo_fragment_push(b, kind, parent, out);
    if (status == EBPO_OK)
        ebpo_polytope_copy(&(*out)->p, p);
    return status;
}

/* Sets the faces of a fragment: those that may intersect it. Copies these to the top of the stack
 * of faces from `count` faces that begin at `first` in the same stack. */
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
        ebpo_lod_leaf_faces(b->whole, leaf->cell, leaf->rank, &b->scratch, &count, b->error);
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

/* Computes the bounds of a cell `levels` below the envelope's node, in the coordinates of that
 * node's cell. */
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

/* Returns how far a fragment extends beyond its cell: up to EBPO_CUT_THIN where a neighbour's thin
 * part stayed with it, or the slack of a cut. Both are lengths in the cell coordinates of the
 * envelope's node, so far below this node they are not small compared with the fragment's cell. A
 * bound for the cell plus this distance is a bound for the fragment. */
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

/* Bounds a fragment in a black cell. The fragment is inside the solid, except for thin parts of
 * neighbouring cells that stayed with it. Parts within the slack are ignored, as the fragments of
 * neighbours overlap by it. */
static void bound_black(ebpo_bounder *b, const ebpo_polytope *p, ebpo_cell cell, int levels)
{
    double low[3], high[3];
    bool thin = false;
    ebpo_extent e;
    ebpo_extent_of(p, &e);
    find_cell_faces(b, cell, levels, low, high);
    for (int k = 0; k < 3; k++)
        thin = thin || e.min[k] < low[k] - EBPO_CUT_SLACK || e.max[k] > high[k] + EBPO_CUT_SLACK;
    if (thin)
        ebpo_bound_raise(b, find_beyond(b, p, cell, levels));
}

static ebpo_status cut_gray(ebpo_bounder *b, const ebpo_fragment *fragment)
{
    ebpo_polytope z, y, x;
    ebpo_status status = EBPO_OK;
    ebpo_level_nodes nodes = ebpo_lod_model_nodes(b->whole);
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
        status = push_polytope(b,
                               child.type == EBPO_GRAY   ? EBPO_FRAGMENT_GRAY
                               : child.type == EBPO_LEAF ? EBPO_FRAGMENT_LEAF
                                                         : EBPO_FRAGMENT_OUTSIDE,
                               fragment, &x, &next);
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

/* Computes the plane of a face in cell coordinates, n of length 1; returns false when rounding
 * leaves it too uncertain. */
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
    /* An error of a corner tilts the plane by about error * edge / length. The tilt acts over the
     * length of a cell or of an edge. */
    if (!(length > 0) || !(error * edge / length * (1 + edge) < 1e-9))
        return false;
    for (int k = 0; k < 3; k++)
        n[k] /= length;
    *d = n[0] * t[0][0] + n[1] * t[0][1] + n[2] * t[0][2];
    return true;
}

/* Cuts a fragment along a plane, |n| = 1, and pushes both parts. Sets *done to false when clipping
 * fails. */
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

/* Cuts a fragment of about the size of its nearest face along the sides of the prism above that
 * face. Over the face, the distance to the face's plane is the distance to the face, so flat places
 * need no small fragments. */
static ebpo_status cut_prism(ebpo_bounder *b, const ebpo_fragment *fragment,
                             const ebpo_fragment_measure *l)
{
    double t[3][3], edge[3][3], normal[3], longest = 0;
    bool done = false;
    ebpo_status status = EBPO_OK;
    (void)cell_frame_triangle(&b->frame, l->face, t);
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
    for (int i = 0; i < 3 && l->reach <= 2 * longest && !done && status == EBPO_OK; i++) {
        double n[3], d = 0, length = 0, most = -INFINITY, least = INFINITY;
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
            most = fmax(most, e);
            least = fmin(least, e);
        }
        if (most > side_least && least < -side_least) /* never for NAN, from a face without area */
            status = cut_along(b, fragment, EBPO_FRAGMENT_OUTSIDE, n, d, &done);
    }
    return status != EBPO_OK || done ? status : cut_longest(b, fragment, EBPO_FRAGMENT_OUTSIDE);
}

/* Returns a bound of the distance for a fragment whose centre is inside the solid. Faces may cut
 * only the outermost part of the fragment. A segment from the centre to a point behind such a face
 * ends at most this far behind the face. The same is true for the cell faces of the leaf, where the
 * fragment extends beyond them by more than the overlap of cuts: faces there are in the list of the
 * neighbour, not of this leaf. */
static double behind_faces(const ebpo_bounder *b, const ebpo_fragment *fragment,
                           const ebpo_fragment_measure *l)
{
    double share = 0, low[3], high[3];
    ebpo_extent all;
    ebpo_extent_of(&fragment->p, &all);
    find_cell_faces(b, fragment->node.cell, fragment->levels, low, high);
    for (int k = 0; k < 3; k++)
        for (int side = 0; side < 2; side++) {
            double other = side ? all.max[k] - high[k] : low[k] - all.min[k],
                   own = side ? high[k] - l->centre[k] : l->centre[k] - low[k];
            if (other > EBPO_CUT_SLACK && !(own > 0))
                /* the centre is beyond the cell face: only the distance of the centre is known */
                return INFINITY;
            if (other > EBPO_CUT_SLACK)
                share = fmax(share, (other + 2e-9) / (other + 2e-9 + own));
        }
    for (uint64_t i = 0; i < fragment->face_count; i++) {
        double n[3], d, reach[2] = { 0, 0 };
        if (!find_plane(b, fragment->face_first + i, n, &d))
            return INFINITY;
        double own = n[0] * l->centre[0] + n[1] * l->centre[1] + n[2] * l->centre[2] - d;
        for (int v = 0; v < fragment->p.vertex_count; v++) {
            double e = n[0] * fragment->p.vertex[v][0] + n[1] * fragment->p.vertex[v][1] +
                       n[2] * fragment->p.vertex[v][2] - d;
            reach[e > 0] = fmax(reach[e > 0], fabs(e));
        }
        double other = reach[own < 0] + 2e-9;
        share = fmax(share, other / (other + fabs(own)));
    }
    return share * l->reach + b->frame.grain;
}

/* Returns true if the cell is thinner on some axis than the precision of coordinates. */
static bool is_flat(const ebpo_bounder *b)
{
    return fmin(fmin(b->frame.side[0], b->frame.side[1]), b->frame.side[2]) < 1e10 * b->frame.grain;
}

/* Cuts a fragment within a leaf of a solid, whose points are inside or outside. */
static ebpo_status cut_leaf(ebpo_bounder *b, const ebpo_fragment *fragment,
                            const ebpo_fragment_measure *l)
{
    bool done = false, known = fragment->face_count <= CUT_FACES;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < fragment->face_count && known && !done && status == EBPO_OK; i++) {
        double n[3], d, most = -INFINITY, least = INFINITY;
        known = find_plane(b, fragment->face_first + i, n, &d);
        for (int v = 0; v < fragment->p.vertex_count && known; v++) {
            double e = n[0] * fragment->p.vertex[v][0] + n[1] * fragment->p.vertex[v][1] +
                       n[2] * fragment->p.vertex[v][2] - d;
            most = fmax(most, e);
            least = fmin(least, e);
        }
        if (known && most > side_least && least < -side_least) {
            status = cut_along(b, fragment, EBPO_FRAGMENT_LEAF, n, d, &done);
            known = done;
        }
    }
    if (status != EBPO_OK || done)
        return status;
    if (!known && is_flat(b)) /* sides cannot be distinguished: the model is treated as a surface */
        return cut_prism(b, fragment, l);
    if (!known)
        return cut_longest(b, fragment, EBPO_FRAGMENT_LEAF);
    if (l->distance >= 0)
        return cut_prism(b, fragment, l);
    double behind = behind_faces(b, fragment, l);
    if (behind > EBPO_FRAGMENT_LEAST && behind > b->target)
        return cut_longest(b, fragment, EBPO_FRAGMENT_LEAF);
    ebpo_bound_raise(b, fmin(behind, l->upper));
    return EBPO_OK;
}

ebpo_status ebpo_fragment_cut(ebpo_bounder *b, const ebpo_fragment *fragment,
                              const ebpo_fragment_measure *l)
{
    switch (fragment->kind) {
    case EBPO_FRAGMENT_GRAY: return cut_gray(b, fragment);
    case EBPO_FRAGMENT_LEAF:
        return b->whole->info->solid ? cut_leaf(b, fragment, l) : cut_prism(b, fragment, l);
    case EBPO_FRAGMENT_OUTSIDE: break;
    }
    return cut_prism(b, fragment, l);
}
