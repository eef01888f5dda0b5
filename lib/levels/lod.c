/* A level's envelopes: from the root down, each cut from its parent's. The top of the tree is
 * walked first; the subtrees that hang from it are independent of each other. Where it is cut
 * depends on the tree alone, so the result does not depend on the number of threads. */
#include "core/strict_fp.h"

#include <ebpo/lod.h>

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "geometry/plane_clip.h"
#include "levels/lod_colours.h"
#include "levels/lod_model.h"
#include "levels/polyhedra.h"
#include "geometry/cells.h"
#include "geometry/node_types.h"
#include "geometry/octcode.h"

enum { SEEDS_WANTED = 128 };

/* Halves of the envelopes on the path to a node, along z, y, x: too large for the stack. */
typedef ebpo_polytope path_halves[EBPO_LEVELS_MAX][3];

/* A gray node at the split level: where a subtree's walk begins. */
typedef struct seed {
    ebpo_cell cell;
    ebpo_polytope envelope;
} seed;

typedef struct job {
    const ebpo_lod_model *model;
    bool walls, polygons; /* keep wall polygons; want polygons at all, or the volume only */
    bool nodes;           /* want to know whose polygons they are */
    int split;            /* level at which the first walk leaves seeds */
    seed *seeds;
    uint64_t seed_count;
    ebpo_polyhedra (*pieces)[EBPO_LEVELS_MAX]; /* [1 + seed_count]: of the top, then of each seed */
    ebpo_leaf_scratch *scratch;                /* [threads] */
    path_halves *halves;                       /* [threads] */
} job;

typedef struct walker {
    job *j;
    ebpo_polyhedra *out; /* [EBPO_LEVELS_MAX] */
    ebpo_leaf_scratch *scratch;
    ebpo_polytope (*half)[3]; /* [EBPO_LEVELS_MAX] */
    int stop;                 /* gray nodes of this level are not descended into */
    ebpo_error *error;
} walker;

static ebpo_status emit(walker *w, const ebpo_polytope *p, ebpo_cell cell, ebpo_node_type type)
{
    ebpo_polyhedra *piece = &w->out[cell.level];
    piece->volume += ebpo_polytope_volume(p) * ebpo_cell_volume(&w->j->model->box, cell.level);
    if (!w->j->polygons)
        return EBPO_OK;
    piece->wants_nodes = w->j->nodes;
    return ebpo_polyhedra_add(piece, p, &w->j->model->box, cell, type, w->j->walls, w->error);
}

static ebpo_status visit_group(walker *w, uint64_t group, ebpo_cell parent_cell,
                               const ebpo_polytope *parent);

/* Nothing is known below it but its envelope, which therefore stands for it at all deeper levels.
 * Only asked above the target. */
static bool is_pruned(const ebpo_lod_model *model, int level, uint64_t gray)
{
    return model->info->pruned && level < model->target && model->level[level + 1].types[gray] == 0;
}

static ebpo_status visit_gray(walker *w, uint64_t gray, ebpo_cell cell, ebpo_polytope *envelope)
{
    const ebpo_level *level = &w->j->model->level[cell.level];
    if (level->plane_counts && level->plane_counts[gray])
        ebpo_planes_cut(envelope, level->planes + w->j->model->ranks[cell.level].plane_first[gray],
                        level->plane_counts[gray]);
    if (cell.level == w->j->model->target)
        return emit(w, envelope, cell, EBPO_GRAY);
    if (cell.level == w->stop) {
        seed *s = &w->j->seeds[w->j->seed_count++];
        s->cell = cell;
        ebpo_polytope_copy(&s->envelope, envelope);
        return EBPO_OK;
    }
    if (is_pruned(w->j->model, cell.level, gray))
        return emit(w, envelope, cell, EBPO_GRAY);
    return visit_group(w, gray, cell, envelope);
}

/* One gray node or leaf; `envelope` is the parent's, cut to this cell. */
static ebpo_status visit_node(walker *w, uint64_t group, unsigned octant, ebpo_cell cell,
                              ebpo_polytope *envelope)
{
    const ebpo_lod_model *model = w->j->model;
    const ebpo_level_ranks *ranks = &model->ranks[cell.level];
    uint16_t types = model->level[cell.level].types[group];
    ebpo_node_type type = ebpo_group_type(types, octant);
    uint64_t rank = ranks->before[type][group] + ebpo_group_count(types, type, octant);
    if (type == EBPO_GRAY)
        return visit_gray(w, rank, cell, envelope);
    ebpo_status status = ebpo_lod_leaf(model, cell, rank, w->scratch, envelope, w->error);
    return status == EBPO_OK ? emit(w, envelope, cell, EBPO_LEAF) : status;
}

/* Black nodes are their whole cell. */
static ebpo_status visit_black(walker *w, ebpo_cell cell)
{
    ebpo_polytope cube;
    ebpo_polytope_cube(&cube);
    return emit(w, &cube, cell, EBPO_BLACK);
}

static ebpo_status visit_root(walker *w)
{
    ebpo_cell root = { 0, { 0, 0, 0 } };
    ebpo_polytope cube;
    ebpo_polytope_cube(&cube);
    switch (ebpo_group_type(w->j->model->level[0].types[0], 0)) {
    case EBPO_WHITE: return EBPO_OK;
    case EBPO_BLACK: return visit_black(w, root);
    default: return visit_node(w, 0, 0, root, &cube);
    }
}

/* In octant order; neighbours share the halves that their envelopes are cut from, as in the
 * builder. */
static ebpo_status visit_group(walker *w, uint64_t group, ebpo_cell parent_cell,
                               const ebpo_polytope *parent)
{
    uint16_t types = w->j->model->level[parent_cell.level + 1].types[group];
    unsigned filled = ebpo_group_filled(types);
    ebpo_polytope *z = w->half[parent_cell.level], *y = z + 1, *x = z + 2;
    ebpo_status status = EBPO_OK;
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++) {
        ebpo_cell cell = ebpo_cell_child(parent_cell, octant);
        if (octant % 4 == 0 && filled >> 2 * octant & 0xff)
            (void)ebpo_polytope_half(parent, 2, octant >> 2 & 1, z);
        if (octant % 2 == 0 && filled >> 2 * octant & 0xf)
            (void)ebpo_polytope_half(z, 1, octant >> 1 & 1, y);
        if (filled >> 2 * octant & 1) {
            (void)ebpo_polytope_half(y, 0, octant & 1, x);
            status = visit_node(w, group, octant, cell, x);
        } else if (ebpo_group_type(types, octant) == EBPO_BLACK) {
            status = visit_black(w, cell);
        }
    }
    return status;
}

static ebpo_status walk_seeds(void *context, uint64_t begin, uint64_t end, unsigned worker,
                              ebpo_error *error)
{
    job *j = context;
    for (uint64_t i = begin; i < end; i++) {
        walker w = { j, j->pieces[1 + i], &j->scratch[worker], j->halves[worker], -1, error };
        seed *s = &j->seeds[i];
        /* Seeds are in octcode order, and all gray nodes of their level: the i-th has the i-th
         * group below it. */
        ebpo_status status = is_pruned(j->model, s->cell.level, i)
                                 ? emit(&w, &s->envelope, s->cell, EBPO_GRAY)
                                 : visit_group(&w, i, s->cell, &s->envelope);
        if (status != EBPO_OK)
            return status;
    }
    return EBPO_OK;
}

/* The first level with enough gray nodes to share out; the target when there is none. */
static int choose_split(const ebpo_lod_model *model)
{
    int level = 0;
    while (level < model->target && model->level[level].gray_count < SEEDS_WANTED)
        level++;
    return level;
}

static ebpo_status prepare(job *j, unsigned threads, ebpo_error *error)
{
    j->split = choose_split(j->model);
    uint64_t seeds = j->split < j->model->target ? j->model->level[j->split].gray_count : 0;
    j->seeds = ebpo_alloc(seeds, sizeof *j->seeds);
    j->pieces = ebpo_alloc_zero(seeds + 1, sizeof *j->pieces);
    j->scratch = ebpo_alloc_zero(threads, sizeof *j->scratch);
    j->halves = ebpo_alloc(threads, sizeof *j->halves);
    if (!j->seeds || !j->pieces || !j->scratch || !j->halves)
        return ebpo_fail_memory(error, seeds * (sizeof *j->seeds + sizeof *j->pieces) +
                                           threads * sizeof *j->halves);
    return EBPO_OK;
}

static ebpo_status walk(job *j, unsigned threads, const ebpo_progress *progress, ebpo_error *error)
{
    walker top = { j, j->pieces[0], &j->scratch[0], j->halves[0], j->split, error };
    ebpo_status status = visit_root(&top);
    if (status != EBPO_OK)
        return status;
    return ebpo_parallel_for(threads, NULL, j->seed_count, 1, walk_seeds, j, progress,
                             "clipping envelopes", error);
}

/* Level after level, and within one level first the top's nodes or the seeds' in their order. */
static ebpo_status join(job *j, ebpo_mesh *out, ebpo_lod_nodes *nodes, double *volume,
                        ebpo_error *error)
{
    uint64_t count = j->seed_count + 1, listed = 0;
    ebpo_polyhedra **list = ebpo_alloc(count * EBPO_LEVELS_MAX, sizeof *list);
    if (!list)
        return ebpo_fail_memory(error, count * EBPO_LEVELS_MAX * sizeof *list);
    double sum = 0;
    for (int level = 0; level <= j->model->target; level++)
        for (uint64_t i = 0; i < count; i++) {
            sum += j->pieces[i][level].volume;
            list[listed++] = &j->pieces[i][level];
        }
    if (volume)
        *volume = sum;
    ebpo_status status = out ? ebpo_polyhedra_join(out, nodes, list, listed, error) : EBPO_OK;
    free(list);
    return status;
}

static void job_free(job *j, unsigned threads)
{
    for (uint64_t i = 0; j->pieces && i <= j->seed_count; i++)
        for (int level = 0; level < EBPO_LEVELS_MAX; level++)
            ebpo_polyhedra_free(&j->pieces[i][level]);
    for (unsigned i = 0; j->scratch && i < threads; i++)
        free(j->scratch[i].faces);
    free(j->pieces);
    free(j->scratch);
    free(j->halves);
    free(j->seeds);
}

void ebpo_lod_nodes_free(ebpo_lod_nodes *nodes)
{
    if (!nodes)
        return;
    free(nodes->nodes);
    free(nodes->corners);
    memset(nodes, 0, sizeof *nodes);
}

/* Joined nodes come level after level, each in octcode order, and every leaf and black node of a
 * level is there: so running counts are their ranks. */
static void add_windings(ebpo_lod_nodes *nodes, const ebpo_lod_model *model)
{
    uint64_t leaf = 0, black = 0;
    int before = 0;
    for (uint64_t i = 0; i < nodes->node_count; i++) {
        ebpo_lod_node *n = &nodes->nodes[i];
        int level = ebpo_cell_of_octcode(n->octcode).level;
        if (level != before)
            leaf = black = 0;
        before = level;
        const ebpo_level *l = &model->level[level];
        if (n->type == EBPO_LEAF)
            n->winding = l->leaf_winding ? l->leaf_winding[leaf++] : 0;
        else if (n->type == EBPO_BLACK)
            n->winding = l->black_winding ? l->black_winding[black++] : 1;
    }
}

ebpo_status ebpo_lod_level(const ebpo_file *file, int level, const ebpo_lod_options *options,
                           ebpo_mesh *out, double *volume, ebpo_error *error)
{
    return ebpo_lod_level_nodes(file, level, options, out, NULL, volume, error);
}

ebpo_status ebpo_lod_level_nodes(const ebpo_file *file, int level, const ebpo_lod_options *options,
                                 ebpo_mesh *out, ebpo_lod_nodes *nodes, double *volume,
                                 ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_lod_options wanted = EBPO_LOD_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_lod_options, &wanted, options, error);
    if (out)
        memset(out, 0, sizeof *out);
    if (nodes)
        memset(nodes, 0, sizeof *nodes);
    if (status != EBPO_OK)
        return status;
    if (nodes && !out)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "a level's nodes are given only with its polygons");
    const ebpo_info *info = ebpo_file_info(file);
    if (level < 0 || level >= info->level_count)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "there is no level %d; this file has levels 0 to %d", level,
                         info->level_count - 1);
    unsigned threads = ebpo_thread_count(wanted.threads);
    ebpo_lod_model model;
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    read.threads = threads;
    read.workspace = wanted.workspace;
    status = ebpo_lod_model_read(&model, file, level, &read, error);
    if (status != EBPO_OK)
        return status;
    job j = {
        .model = &model, .walls = wanted.walls, .polygons = out != NULL, .nodes = nodes != NULL
    };
    status = prepare(&j, threads, error);
    if (status == EBPO_OK)
        status = walk(&j, threads, &wanted.progress, error);
    if (status == EBPO_OK)
        status = join(&j, out, nodes, volume, error);
    if (status == EBPO_OK && nodes) {
        add_windings(nodes, &model);
        ebpo_lod_add_colours(nodes, &model);
    }
    if (status != EBPO_OK)
        ebpo_lod_nodes_free(nodes);
    job_free(&j, threads);
    ebpo_lod_model_free(&model);
    return status;
}
