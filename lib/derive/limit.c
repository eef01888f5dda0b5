/* Computes the "limit" of a level: the least volume that its convex envelopes can have. The
 * envelope of a node contains the part of the solid in the node's cell. Gray nodes have children,
 * leaves list faces, white nodes are outside the solid, and black nodes are inside. The limit is
 * the sum, over the cells of the level, of the volume of the convex hull of the solid in the cell.
 * The extreme points of a hull are corners of the mesh's faces after clipping to the cell, or
 * corners of the cell that are inside the solid. If the envelopes of a surface contain its inside
 * (ebpo_info.border_inside), corners that are inside by the surface's winding number count, too.
 * Near caps, which close the holes of the surface, the inside may extend beyond these hulls. So the
 * sum is only a lower bound there. The library qhull computes the volumes. In a build
 * without qhull, ebpo_limit_level returns EBPO_E_ABSENT. Volumes are stored for each node and added
 * in the order of the nodes, so that the number of threads does not change the sum. */
#include "core/strict_fp.h"

#include <ebpo/limit.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "ebpo_config.h"

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "format/border_loops.h"
#include "levels/lod.h"
#include "geometry/cap_bounds.h"
#include "geometry/cells.h"
#include "geometry/level_nodes.h"

#if EBPO_HAVE_QHULL
#include <limits.h>
#include <setjmp.h>
#include <stdbool.h>
#include <stdio.h>

#include <libqhull_r/qhull_ra.h>
#endif

/* --- the volume of a convex hull, computed by qhull if the build has it --- */

#if EBPO_HAVE_QHULL

/* State of qhull, one for each thread. */
typedef struct hull {
    FILE *null_file; /* receives qhull's messages, which are long for flat sets */
    qhT qhull;
} hull;

static ebpo_status hull_new(hull **out, ebpo_error *error)
{
    hull *h = *out = ebpo_alloc_zero(1, sizeof *h);
    if (!h)
        return ebpo_fail_memory(error, sizeof *h);
    h->null_file = fopen("/dev/null", "w");
    if (h->null_file)
        return EBPO_OK;
    free(h);
    *out = NULL;
    return ebpo_fail(error, EBPO_E_IO, "/dev/null could not be opened for qhull's messages");
}

static void hull_free(hull *h)
{
    if (h && h->null_file)
        fclose(h->null_file);
    free(h);
}

/* Returns the volume that qhull computes with the options of `command`; sets *failed if qhull
 * fails. */
static double volume_by(hull *h, double *points, int count, char *command, bool *failed)
{
    qhT *qh = &h->qhull;
    volatile double volume = 0; /* volatile, because it is set between setjmp and a jump */
    volatile bool has_failed = true;
    qh_zero(qh, h->null_file);
    if (qh_new_qhull(qh, 3, count, points, False, command, NULL, h->null_file) == 0) {
        if (setjmp(qh->errexit) == 0) { /* qhull's errors jump here */
            qh->NOerrexit = False;
            qh_getarea(qh, qh->facet_list);
            volume = qh->totvol;
            has_failed = false;
        }
        qh->NOerrexit = True;
    }
    int unfreed_blocks, unfreed_bytes;
    qh_freeqhull(qh, !qh_ALL);
    qh_memfreeshort(qh, &unfreed_blocks, &unfreed_bytes);
    *failed = has_failed;
    return volume > 0 ? volume : 0;
}

/* Returns the volume of the convex hull of points[count][3], whose coordinates are from 0 to 1.
 * Returns 0 when all points are in a plane, up to rounding. */
static double hull_volume(hull *h, double *points, uint64_t count)
{
    static char merged[] = "qhull Qt Pp", joggled[] = "qhull QJ Pp";
    bool failed;
    if (count < 4 || count > INT_MAX / 3)
        return 0;
    double volume = volume_by(h, points, (int)count, merged, &failed);
    /* qhull fails for some thin hulls, because it merges all their facets. With option QJ, qhull
     * merges no facets, but moves the points by about 1e-11. Then qhull returns the volume of a
     * thin hull, and almost 0 for a flat hull. */
    return failed ? volume_by(h, points, (int)count, joggled, &failed) : volume;
}

#else

typedef struct hull hull;

static ebpo_status hull_new(hull **out, ebpo_error *error)
{
    *out = NULL;
    return ebpo_fail(error, EBPO_E_ABSENT,
                     "this library was built without qhull, which computes convex hulls; build "
                     "it with -Dqhull=enabled");
}

static void hull_free(hull *h) { (void)h; }

static double hull_volume(hull *h, double *points, uint64_t count)
{
    (void)h, (void)points, (void)count;
    return 0;
}

#endif

/* Memory of one thread, for the computation of one node's hull. */
typedef struct scratch {
    hull *hull;
    uint32_t *list;       /* [list_count] indices of the node's faces */
    ebpo_triangle *faces; /* [list_count] corners of these faces */
    double *points;       /* [point_count][3] points of the hull, in cell coordinates */
    uint64_t list_count, list_capacity, faces_capacity, point_count, points_capacity;
} scratch;

typedef struct job {
    ebpo_lod_model model;
    ebpo_mesh mesh;     /* all faces of the file */
    ebpo_cap_tree caps; /* with border_inside: the caps of the surface; otherwise empty */
    int level;
    ebpo_level_nodes tree; /* the nodes of `model`, in the form that ebpo_level_child reads */
    ebpo_node *nodes;      /* [node_count] nodes whose hulls are computed */
    uint64_t node_count, node_capacity;
    double *volume; /* [node_count] volume of the hull, as a fraction of the volume of the node's
                       cell */
    double black;   /* sum of the volumes of black nodes */
    bool in_root_cells; /* true: volumes are fractions of the root cell's volume */
    scratch *scratch;   /* [threads] */
} job;

static double cell_volume(const job *j, int level)
{
    return j->in_root_cells ? ldexp(1, -3 * level) : ebpo_cell_volume(&j->model.box, level);
}

/* --- the nodes --- */

/* Lists the gray nodes of the level, and the leaves of the level and above it. Adds the volumes of
 * black nodes to j->black. Returns false when out of memory. */
static bool list_nodes(job *j, const ebpo_node *node)
{
    if (node->type == EBPO_BLACK)
        j->black += cell_volume(j, node->cell.level);
    if (ebpo_node_is_uniform(node))
        return true;
    if (node->type == EBPO_GRAY && node->cell.level < j->level) {
        bool complete = true;
        for (unsigned octant = 0; octant < 8 && complete; octant++) {
            ebpo_node child = ebpo_level_child(&j->tree, node, octant);
            complete = list_nodes(j, &child);
        }
        return complete;
    }
    if (!ebpo_grow(&j->nodes, &j->node_capacity, j->node_count + 1, sizeof *j->nodes))
        return false;
    j->nodes[j->node_count++] = *node;
    return true;
}

/* --- a node's faces --- */

/* Appends the faces of a leaf of level `depth` to s->list. Returns false when out of memory. */
static bool list_leaf_faces(const job *j, scratch *s, int depth, uint64_t leaf)
{
    const ebpo_level *level = &j->model.level[depth];
    uint64_t refs = level->leaf_ref_count[leaf], new_count = level->leaf_new[leaf];
    if (!ebpo_grow(&s->list, &s->list_capacity, s->list_count + refs + new_count, sizeof *s->list))
        return false;
    if (refs)
        memcpy(s->list + s->list_count, level->leaf_refs + j->model.ranks[depth].ref_first[leaf],
               refs * sizeof *s->list);
    for (uint64_t i = 0; i < new_count; i++)
        s->list[s->list_count + refs + i] = (uint32_t)(level->leaf_first[leaf] + i);
    s->list_count += refs + new_count;
    return true;
}

/* Appends the faces of all leaves at or below a node to s->list; a face may be listed repeatedly.
 * Returns false when out of memory. */
static bool list_node_faces(const job *j, scratch *s, const ebpo_node *node)
{
    bool complete = true;
    if (node->type == EBPO_LEAF)
        return list_leaf_faces(j, s, node->cell.level, node->rank);
    for (unsigned octant = 0; octant < 8 && complete && node->type == EBPO_GRAY; octant++) {
        ebpo_node child = ebpo_level_child(&j->tree, node, octant);
        complete = list_node_faces(j, s, &child);
    }
    return complete;
}

static int compare_faces(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

/* Sorts the listed faces, removes repetitions, and copies the coordinates to s->faces. */
static bool load_listed_faces(const job *j, scratch *s)
{
    const ebpo_mesh *m = &j->mesh;
    uint64_t kept = 0;
    if (s->list_count)
        qsort(s->list, s->list_count, sizeof *s->list, compare_faces);
    for (uint64_t i = 0; i < s->list_count; i++)
        if (i == 0 || s->list[i] != s->list[i - 1])
            s->list[kept++] = s->list[i];
    s->list_count = kept;
    if (!ebpo_grow(&s->faces, &s->faces_capacity, kept, sizeof *s->faces))
        return false;
    for (uint64_t i = 0; i < kept; i++)
        for (uint64_t c = 0; c < 3; c++) {
            uint64_t v = m->faces[3 * (uint64_t)s->list[i] + c];
            for (uint64_t k = 0; k < 3; k++)
                s->faces[i].corner[c][k] =
                    m->xyz32 ? (double)m->xyz32[3 * v + k] : m->xyz64[3 * v + k];
        }
    return true;
}

/* --- a node's points --- */

/* Returns the winding number at a node's lowest corner; in a surface, that of faces and caps. The
 * file has no winding numbers of gray nodes, so for a gray node, the function uses the white node,
 * black node or leaf at this corner. */
static int32_t lowest_winding(const job *j, ebpo_node node)
{
    while (node.type == EBPO_GRAY)
        node = ebpo_level_child(&j->tree, &node, 0);
    return ebpo_level_winding(&j->tree, &node);
}

/* Returns true if corner i of a cell is inside. `winding`: winding number at the corner; in a
 * surface, the lowest corner's number plus the crossings of faces on the way, without those of
 * caps.
 */
static bool is_inside(const job *j, ebpo_cell cell, int i, int32_t winding)
{
    const ebpo_info *info = j->model.info;
    const ebpo_cap_rule rule = { (uint8_t)info->rule, 0.5 };
    double low[3], p[3];
    if (info->solid)
        return ebpo_rule_inside(info->rule, winding);
    ebpo_cell_bounds(&j->model.box, cell, low, p);
    for (int k = 0; k < 3; k++)
        p[k] = i >> k & 1 ? p[k] : low[k];
    if (j->caps.node_count)
        winding += ebpo_cap_path_crossings(&j->caps, 0, low, p);
    return ebpo_cap_decide(&j->caps, p, winding, &rule).inside;
}

/* Adds the corners of the node's cell that are inside the model to s->points. */
static bool add_corners(const job *j, scratch *s, const ebpo_node *node)
{
    const ebpo_lod_model *m = &j->model;
    if (!m->info->solid && !m->info->border_inside)
        return true;
    int32_t delta[8], lowest = lowest_winding(j, *node);
    ebpo_corner_windings(&m->box, node->cell, s->faces, s->list_count, delta);
    if (!ebpo_grow(&s->points, &s->points_capacity, s->point_count + 8, 3 * sizeof *s->points))
        return false;
    for (int i = 0; i < 8; i++)
        if (is_inside(j, node->cell, i, lowest + delta[i])) {
            double *p = s->points + 3 * s->point_count++;
            p[0] = i & 1, p[1] = i >> 1 & 1, p[2] = i >> 2 & 1;
        }
    return true;
}

/* Adds the corners of the listed faces, after each face is clipped to the cell, to s->points. */
static bool add_faces(const job *j, scratch *s, ebpo_cell cell)
{
    if (!ebpo_grow(&s->points, &s->points_capacity, s->point_count + 9 * s->list_count,
                   3 * sizeof *s->points))
        return false;
    for (uint64_t i = 0; i < s->list_count; i++) {
        double points[9][3], slack;
        int count = ebpo_clip_triangle(&j->model.box, cell, &s->faces[i], points, &slack);
        memcpy(s->points + 3 * s->point_count, points, (size_t)count * sizeof points[0]);
        s->point_count += (uint64_t)count;
    }
    return true;
}

static ebpo_status measure_hulls(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    job *j = context;
    scratch *s = &j->scratch[worker];
    for (uint64_t i = begin; i < end; i++) {
        const ebpo_node *node = &j->nodes[i];
        s->list_count = s->point_count = 0;
        if (!list_node_faces(j, s, node) || !load_listed_faces(j, s) || !add_corners(j, s, node) ||
            !add_faces(j, s, node->cell))
            return ebpo_fail_memory(error, s->list_count * sizeof *s->faces);
        j->volume[i] = hull_volume(s->hull, s->points, s->point_count);
    }
    return EBPO_OK;
}

/* --- the call --- */

static ebpo_status check_level(const ebpo_file *file, int level, ebpo_error *error)
{
    const ebpo_info *info = ebpo_file_info(file);
    if (level < 0 || level >= info->level_count)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "there is no level %d; this file has levels 0 to %d", level,
                         info->level_count - 1);
    if (!(info->parts & EBPO_PART_MESH) || info->pruned)
        return ebpo_fail(error, EBPO_E_ABSENT,
                         "convex hulls need the whole mesh, but this file %s; use the original "
                         "file with its mesh",
                         info->pruned ? "is a subset" : "has no mesh");
    if (info->border_inside && !(info->parts & EBPO_PART_BORDER))
        return ebpo_fail(error, EBPO_E_ABSENT,
                         "convex hulls need the border of this surface, whose envelopes contain "
                         "its inside; use the original file with the part border");
    return EBPO_OK;
}

/* Reads the caps of a surface whose envelopes contain its inside. */
static ebpo_status read_caps(job *j, const ebpo_file *file, ebpo_error *error)
{
    ebpo_border_loops loops = { 0 };
    if (!ebpo_file_info(file)->border_inside)
        return EBPO_OK;
    ebpo_status status = ebpo_border_read(file, &loops, error);
    if (status == EBPO_OK)
        status = ebpo_cap_tree_of_loops(&j->caps, &loops, error);
    ebpo_border_loops_free(&loops);
    return status;
}

static ebpo_status prepare_job(job *j, const ebpo_file *file, int level, unsigned threads,
                               ebpo_error *error)
{
    const ebpo_info *info = ebpo_file_info(file);
    j->level = level;
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    read.threads = threads;
    ebpo_status status = ebpo_lod_model_read(&j->model, file, info->level_count - 1, &read, error);
    if (status == EBPO_OK)
        status = ebpo_file_read_mesh(file, &read, &j->mesh, error);
    if (status == EBPO_OK)
        status = read_caps(j, file, error);
    j->scratch = ebpo_alloc_zero(threads, sizeof *j->scratch);
    if (status == EBPO_OK) {
        j->tree = ebpo_lod_model_nodes(&j->model);
        ebpo_node root = ebpo_level_root(&j->tree);
        if (!j->scratch || !list_nodes(j, &root))
            status = ebpo_fail_memory(error, j->node_count * sizeof *j->nodes);
    }
    for (unsigned i = 0; i < threads && status == EBPO_OK; i++)
        status = hull_new(&j->scratch[i].hull, error);
    if (status == EBPO_OK && !(j->volume = ebpo_alloc(j->node_count, sizeof *j->volume)))
        status = ebpo_fail_memory(error, j->node_count * sizeof *j->volume);
    return status;
}

static void job_free(job *j, unsigned threads)
{
    for (unsigned i = 0; j->scratch && i < threads; i++) {
        hull_free(j->scratch[i].hull);
        free(j->scratch[i].list);
        free(j->scratch[i].faces);
        free(j->scratch[i].points);
    }
    free(j->scratch);
    free(j->nodes);
    free(j->volume);
    ebpo_mesh_free(&j->mesh);
    ebpo_cap_tree_free(&j->caps);
    ebpo_lod_model_free(&j->model);
}

ebpo_status ebpo_limit_level(const ebpo_file *file, int level, const ebpo_limit_options *options,
                             ebpo_limit *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_limit_options requested = EBPO_LIMIT_OPTIONS_INIT;
    job j = { 0 };
    ebpo_limit found = EBPO_LIMIT_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_limit_options, &requested, options, error);
    if (status == EBPO_OK)
        status = EBPO_CHECK_SIZED(ebpo_limit, out, error);
    if (status == EBPO_OK)
        status = check_level(file, level, error);
    if (status != EBPO_OK)
        return status;
    unsigned threads = ebpo_thread_count(requested.threads);
    j.in_root_cells = requested.in_root_cells != 0;
    status = prepare_job(&j, file, level, threads, error);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(threads, NULL, j.node_count, 1, measure_hulls, &j,
                                   &requested.progress, "convex hulls", error);
    for (uint64_t i = 0; i < j.node_count && status == EBPO_OK; i++) {
        /* The volume of a cell may be infinite, and 0 times infinity is NAN. */
        double volume = j.volume[i] > 0 ? j.volume[i] * cell_volume(&j, j.nodes[i].cell.level) : 0;
        found.volume += volume;
        found.gray_volume += j.nodes[i].type == EBPO_GRAY ? volume : 0;
        found.flat += j.volume[i] == 0;
        found.hulls++;
    }
    found.volume += j.black;
    EBPO_GIVE(ebpo_limit, out, &found);
    job_free(&j, threads);
    return status;
}
