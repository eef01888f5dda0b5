/* The convex hull of the solid in each cell. Its extreme points are mesh vertices in the cell,
 * corners of what faces leave on the cell's walls, and the cell's corners that lie inside. */
#include "geom/strict_fp.h"

#include <ebpo/limit.h>

#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/fp_env.h"
#include "base/parallel.h"
#include "base/sized.h"
#include "limit/qhull.h"
#include "lod/lod_model.h"
#include "octree/cells.h"
#include "octree/node_types.h"
#include "octree/rule.h"

/* A node whose hull is wanted. */
typedef struct wanted {
    ebpo_cell cell;
    uint64_t rank; /* among the gray nodes or leaves of its level */
    bool gray;
} wanted;

/* One for each thread. */
typedef struct scratch {
    ebpo_hull *hull;
    uint32_t *list;
    ebpo_triangle *faces;
    double *points;
    uint64_t list_count, list_capacity, faces_room, point_count, points_room;
    ebpo_limit sum;
} scratch;

typedef struct job {
    ebpo_lod_model model;
    ebpo_mesh mesh;
    int level;
    wanted *nodes;
    uint64_t node_count, node_capacity;
    double *volume; /* [node_count] in cells */
    /* white, black: such nodes in the groups before; where their windings are stored */
    uint64_t *empty_before[EBPO_LEVELS_MAX][2];
    double black;
    scratch *scratch; /* [threads] */
} job;

/* --- which nodes --- */

static bool list_group(job *j, uint64_t group, ebpo_cell parent);

static bool list_node(job *j, uint64_t group, unsigned octant, ebpo_cell cell)
{
    const ebpo_level *level = &j->model.level[cell.level];
    const ebpo_lod_index *index = &j->model.index[cell.level];
    ebpo_node_type type = ebpo_group_type(level->types[group], octant);
    uint64_t rank = ebpo_group_count(level->types[group], type, octant);
    if (type == EBPO_BLACK)
        j->black += ebpo_cell_volume(&j->model.box, cell.level);
    if (type == EBPO_WHITE || type == EBPO_BLACK)
        return true;
    rank += type == EBPO_GRAY ? index->gray_before[group] : index->leaf_before[group];
    if (type == EBPO_GRAY && cell.level < j->level)
        return list_group(j, rank, cell);
    if (!ebpo_grow(&j->nodes, &j->node_capacity, j->node_count + 1, sizeof *j->nodes))
        return false;
    j->nodes[j->node_count++] = (wanted){ cell, rank, type == EBPO_GRAY };
    return true;
}

static bool list_group(job *j, uint64_t group, ebpo_cell parent)
{
    for (unsigned octant = 0; octant < 8; octant++)
        if (!list_node(j, group, octant, ebpo_cell_child(parent, octant)))
            return false;
    return true;
}

/* --- a node's faces --- */

static bool take_leaf(const job *j, scratch *s, int number, uint64_t leaf)
{
    const ebpo_level *level = &j->model.level[number];
    uint64_t refs = level->leaf_ref_count[leaf], fresh = level->leaf_new[leaf];
    if (!ebpo_grow(&s->list, &s->list_capacity, s->list_count + refs + fresh, sizeof *s->list))
        return false;
    if (refs)
        memcpy(s->list + s->list_count, level->leaf_refs + j->model.index[number].ref_first[leaf],
               refs * sizeof *s->list);
    for (uint64_t i = 0; i < fresh; i++)
        s->list[s->list_count + refs + i] = (uint32_t)(level->leaf_first[leaf] + i);
    s->list_count += refs + fresh;
    return true;
}

static bool take_group(const job *j, scratch *s, int number, uint64_t group)
{
    const ebpo_level *level = &j->model.level[number];
    const ebpo_lod_index *index = &j->model.index[number];
    uint64_t gray = index->gray_before[group], leaf = index->leaf_before[group];
    bool good = true;
    for (unsigned octant = 0; octant < 8 && good; octant++)
        switch (ebpo_group_type(level->types[group], octant)) {
        case EBPO_GRAY: good = take_group(j, s, number + 1, gray++); break;
        case EBPO_LEAF: good = take_leaf(j, s, number, leaf++); break;
        default: break;
        }
    return good;
}

static int compare(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

static bool take_faces(const job *j, scratch *s)
{
    const ebpo_mesh *m = &j->mesh;
    uint64_t kept = 0;
    qsort(s->list, s->list_count, sizeof *s->list, compare);
    for (uint64_t i = 0; i < s->list_count; i++)
        if (i == 0 || s->list[i] != s->list[i - 1])
            s->list[kept++] = s->list[i];
    s->list_count = kept;
    if (!ebpo_grow(&s->faces, &s->faces_room, kept, sizeof *s->faces))
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

/* --- its corners --- */

/* Winding number at a gray node's lowest corner: that of the node in its lowest corner. */
static int32_t lowest_winding(const job *j, int number, uint64_t gray)
{
    const ebpo_lod_model *m = &j->model;
    for (;; number++) {
        const ebpo_level *level = &m->level[number + 1];
        const ebpo_lod_index *index = &m->index[number + 1];
        switch (ebpo_group_type(level->types[gray], 0)) {
        case EBPO_GRAY: gray = index->gray_before[gray]; break;
        case EBPO_LEAF: return level->leaf_winding[index->leaf_before[gray]];
        default: { /* only windings that are not 0 or 1 are stored; octant 0 is the first of its
                      group */
            bool black = ebpo_group_type(level->types[gray], 0) == EBPO_BLACK;
            const int32_t *stored = black ? level->black_winding : level->white_winding;
            return stored ? stored[j->empty_before[number + 1][black][gray]] : black;
        }
        }
    }
}

static bool add_corners(const job *j, scratch *s, const wanted *w)
{
    const ebpo_lod_model *m = &j->model;
    if (!m->info->solid)
        return true;
    int32_t delta[8], lowest = w->gray ? lowest_winding(j, w->cell.level, w->rank)
                                       : m->level[w->cell.level].leaf_winding[w->rank];
    ebpo_corner_windings(&m->box, w->cell, s->faces, s->list_count, delta);
    if (!ebpo_grow(&s->points, &s->points_room, s->point_count + 8, 3 * sizeof *s->points))
        return false;
    for (int i = 0; i < 8; i++)
        if (ebpo_rule_inside(m->info->rule, lowest + delta[i])) {
            double *p = s->points + 3 * s->point_count++;
            p[0] = i & 1, p[1] = i >> 1 & 1, p[2] = i >> 2 & 1;
        }
    return true;
}

static bool add_faces(const job *j, scratch *s, ebpo_cell cell)
{
    if (!ebpo_grow(&s->points, &s->points_room, s->point_count + 9 * s->list_count,
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

static ebpo_status hulls(void *context, uint64_t begin, uint64_t end, unsigned worker,
                         ebpo_error *error)
{
    job *j = context;
    scratch *s = &j->scratch[worker];
    for (uint64_t i = begin; i < end; i++) {
        const wanted *w = &j->nodes[i];
        s->list_count = s->point_count = 0;
        bool good = w->gray ? take_group(j, s, w->cell.level + 1, w->rank)
                            : take_leaf(j, s, w->cell.level, w->rank);
        if (!good || !take_faces(j, s) || !add_corners(j, s, w) || !add_faces(j, s, w->cell))
            return ebpo_fail_memory(error, s->list_count * sizeof *s->faces);
        j->volume[i] = ebpo_hull_volume(s->hull, s->points, s->point_count);
    }
    return EBPO_OK;
}

/* --- all of it --- */

static ebpo_status check(ebpo_file *file, int level, ebpo_error *error)
{
    const ebpo_info *info = ebpo_file_info(file);
    if (level < 0 || level >= info->level_count)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "there is no level %d; this file has levels 0 to %d", level,
                         info->level_count - 1);
    if (!(info->parts & EBPO_PART_MESH) || info->pruned)
        return ebpo_fail(error, EBPO_E_ABSENT, "hulls need the whole mesh, and this file has %s",
                         info->pruned ? "a part of it" : "none");
    return EBPO_OK;
}

static bool count_empty(job *j)
{
    for (int i = 0; i <= j->model.target; i++)
        for (int black = 0; black < 2; black++) {
            const ebpo_level *level = &j->model.level[i];
            if (!(black ? level->black_winding : level->white_winding))
                continue;
            uint64_t sum = 0, *before = j->empty_before[i][black] =
                                  ebpo_alloc(level->group_count, sizeof *before);
            for (uint64_t g = 0; before && g < level->group_count; g++) {
                before[g] = sum;
                sum += ebpo_group_count(level->types[g], black ? EBPO_BLACK : EBPO_WHITE, 8);
            }
            if (!before)
                return false;
        }
    return true;
}

static ebpo_status prepare(job *j, ebpo_file *file, int level, unsigned threads, ebpo_error *error)
{
    const ebpo_info *info = ebpo_file_info(file);
    j->level = level;
    ebpo_status status =
        ebpo_lod_model_read(&j->model, file, info->level_count - 1, threads, error);
    if (status == EBPO_OK)
        status = ebpo_file_read_mesh(file, &j->mesh, threads, error);
    j->scratch = ebpo_alloc_zero(threads, sizeof *j->scratch);
    if (status == EBPO_OK &&
        (!j->scratch || !count_empty(j) || !list_node(j, 0, 0, (ebpo_cell){ 0, { 0, 0, 0 } })))
        status = ebpo_fail_memory(error, j->node_count * sizeof *j->nodes);
    for (unsigned i = 0; i < threads && status == EBPO_OK; i++)
        status = ebpo_hull_new(&j->scratch[i].hull, error);
    if (status == EBPO_OK && !(j->volume = ebpo_alloc(j->node_count, sizeof *j->volume)))
        status = ebpo_fail_memory(error, j->node_count * sizeof *j->volume);
    return status;
}

static void job_free(job *j, unsigned threads)
{
    for (unsigned i = 0; j->scratch && i < threads; i++) {
        ebpo_hull_free(j->scratch[i].hull);
        free(j->scratch[i].list);
        free(j->scratch[i].faces);
        free(j->scratch[i].points);
    }
    for (int i = 0; i < EBPO_LEVELS_MAX; i++) {
        free(j->empty_before[i][0]);
        free(j->empty_before[i][1]);
    }
    free(j->scratch);
    free(j->nodes);
    free(j->volume);
    ebpo_mesh_free(&j->mesh);
    ebpo_lod_model_free(&j->model);
}

ebpo_status ebpo_limit_level(ebpo_file *file, int level, unsigned threads,
                             const ebpo_progress *progress, ebpo_limit *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    static const ebpo_progress silent;
    job j = { 0 };
    ebpo_limit found = EBPO_LIMIT_INIT;
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_limit, out, error);
    if (status == EBPO_OK)
        status = check(file, level, error);
    if (status != EBPO_OK)
        return status;
    threads = ebpo_thread_count(threads);
    status = prepare(&j, file, level, threads, error);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(threads, j.node_count, 1, hulls, &j,
                                   progress ? progress : &silent, "convex hulls", error);
    for (uint64_t i = 0; i < j.node_count && status == EBPO_OK; i++) {
        /* not 0 times infinity */
        double volume = j.volume[i] > 0
                            ? j.volume[i] * ebpo_cell_volume(&j.model.box, j.nodes[i].cell.level)
                            : 0;
        found.volume += volume;
        found.gray_volume += j.nodes[i].gray ? volume : 0;
        found.flat += j.volume[i] == 0;
        found.hulls++;
    }
    found.volume += j.black;
    EBPO_GIVE(ebpo_limit, out, &found);
    job_free(&j, threads);
    return status;
}
