/* Counts the subtrees that an exact distance query must read.
 *
 *     needed_subtrees FILE.ebpo.h5 POINTS MEMORY [URL]
 *         POINTS: 3 doubles for each point, as written by `ebpo bench --save-points`
 *         MEMORY: budget in bytes
 *         URL: address of the same file; requests all needed subtrees together, as a query could
 *              that knew them in advance
 *
 * A subtree is needed if no envelope of the file shows that all of its faces are farther than the
 * nearest face. For each level, prints the number of subtrees that remain when the envelopes down
 * to this level are known; then the subtrees that the queries searched and loaded. All values are
 * means over the points. *different* is the number of different subtrees, divided by the number of
 * points: a method that keeps every subtree in memory, but knows only the envelopes, loads this
 * many subtrees for each point. With URL, prints the number of requested subtrees. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "query/model_parts.h"
#include "query/query_model.h"
#include "query/query_node.h"

static ebpo_error error = EBPO_ERROR_INIT;

static void check(ebpo_status status)
{
    if (status == EBPO_OK)
        return;
    fprintf(stderr, "needed_subtrees: %s\n", error.message);
    exit(EXIT_FAILURE);
}

static double *read_points(const char *path, uint64_t *count)
{
    FILE *stream = fopen(path, "rb");
    double *p = NULL;
    *count = 0;
    for (;;) {
        p = realloc(p, (*count + 1) * 3 * sizeof *p);
        if (!stream || !p) {
            perror(path);
            exit(EXIT_FAILURE);
        }
        if (fread(p + 3 * *count, sizeof *p, 3, stream) != 3)
            break;
        ++*count;
    }
    fclose(stream);
    return p;
}

/* A walk through the envelopes for one point. */
typedef struct walk {
    const ebpo_top *top;
    ebpo_ranking ranking;
    int cut_level;
    double limit;                 /* distance of the nearest face */
    uint64_t near;                /* number of subtrees that are not farther */
    const ebpo_node_table *nodes; /* of the model's top */
    bool *needed; /* [subtrees of the model] the subtree was not farther than the nearest face of a
                   * point */
    uint64_t different; /* number of such subtrees */
} walk;

/* Marks the subtree whose root has a cell. */
static void mark_subtree(walk *w, ebpo_cell cell)
{
    uint32_t entry = w->nodes->root;
    for (int level = 0; level < cell.level; level++)
        entry = ebpo_table_child(w->nodes, entry, ebpo_cell_octant(cell, level));
    bool *needed = &w->needed[ebpo_entry_value(entry)];
    w->different += !*needed;
    *needed = true;
}

/* Returns true if a node that is not farther than the limit has a leaf or a node of the deepest
 * known level that is not farther. Counts the subtrees of which this is true. */
static bool is_near(walk *w, uint32_t entry, ebpo_cell cell, ebpo_facing facing)
{
    ebpo_entry_kind kind = ebpo_entry_kind_of(entry);
    if (kind == EBPO_ENTRY_UNIFORM)
        return false;
    uint32_t value = ebpo_entry_value(entry);
    ebpo_top_planes p =
        kind == EBPO_ENTRY_SUBTREE_ROOT ? w->top->below_planes[value] : w->top->gray[value];
    if (ebpo_facing_distance(&w->ranking.box, cell, w->top->planes + p.first, p.count, w->ranking.p,
                             INFINITY, &facing) > w->limit)
        return false;
    bool near = kind != EBPO_ENTRY_GRAY;
    for (unsigned octant = 0; octant < 8 && kind == EBPO_ENTRY_GRAY; octant++)
        near |= is_near(w, ebpo_table_child(&w->top->nodes, entry, octant),
                        ebpo_cell_child(cell, octant), facing);
    if (near &&
        (cell.level == w->cut_level || (cell.level < w->cut_level && kind != EBPO_ENTRY_GRAY))) {
        w->near++;
        mark_subtree(w, cell);
    }
    return near;
}

/* Opens the file at `url`, and loads the needed subtrees after one hint for all of them. */
static void request_all(const char *url, const ebpo_model_options *how, const bool *needed)
{
    ebpo_file *file;
    ebpo_model *m;
    ebpo_context *c;
    check(ebpo_open(url, &file, &error));
    check(ebpo_model_new(file, how, &m, &error));
    check(ebpo_context_new(m, &c, &error));
    uint64_t count = 0;
    uint32_t *below = calloc(m->top->below_count, sizeof *below);
    for (uint32_t i = 0; below && i < m->top->below_count; i++)
        if (needed[i])
            below[count++] = i;
    ebpo_top_hint(m->top, m->chunks, below, count,
                  ebpo_subtree_needs(EBPO_ACCEL_NODES) | EBPO_NEEDS_MAPS, EBPO_LEVELS_MAX);
    for (uint64_t i = 0; i < count; i++) {
        ebpo_accel *subtree;
        check(ebpo_context_subtree(c, below[i], &subtree, &error));
    }
    printf("requested: %d subtrees\n", (int)count);
    free(below);
    ebpo_context_free(c);
    ebpo_model_free(m);
    ebpo_close(file);
}

int main(int argc, char **argv)
{
    ebpo_file *file;
    ebpo_model *m;
    ebpo_context *c;
    ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
    uint64_t count;
    if (argc != 4 && argc != 5) {
        fprintf(stderr, "usage: needed_subtrees FILE.ebpo.h5 POINTS MEMORY [URL]\n");
        return 2;
    }
    double *points = read_points(argv[2], &count), *distance = calloc(count + 1, sizeof *distance);
    how.memory = strtoull(argv[3], NULL, 10);
    check(ebpo_open(argv[1], &file, &error));
    check(ebpo_model_new(file, &how, &m, &error));
    check(ebpo_context_new(m, &c, &error));
    if (!m->top || !distance || !count) {
        fprintf(stderr, "needed_subtrees: no points, or the model fits into the memory\n");
        return EXIT_FAILURE;
    }
    for (uint64_t i = 0; i < count; i++) {
        ebpo_distance_result result;
        check(ebpo_distance(c, points + 3 * i, NULL, &result, &error));
        distance[i] = fabs(result.distance);
    }
    bool *needed = calloc(m->top->below_count, sizeof *needed);
    if (!needed) {
        perror("needed_subtrees");
        return EXIT_FAILURE;
    }
    for (int level = m->top->cut_level; level < m->info->level_count; level++) {
        memset(needed, false, m->top->below_count * sizeof *needed);
        walk w = { .cut_level = m->top->cut_level, .nodes = &m->top->nodes, .needed = needed };
        ebpo_top *top;
        check(ebpo_top_read_envelopes(&top, file, level, 0, &error));
        w.top = top;
        for (uint64_t i = 0; i < count; i++) {
            w.ranking = ebpo_ranking_of(m, points + 3 * i, NULL);
            w.limit = distance[i];
            is_near(&w, top->nodes.root, (ebpo_cell){ 0, { 0, 0, 0 } }, (ebpo_facing){ 0 });
        }
        printf("level %d: %.2f subtrees, different: %.2f\n", level, (double)w.near / (double)count,
               (double)w.different / (double)count);
        ebpo_top_free(top);
    }
    printf("searched: %.2f, loaded: %.2f\n", (double)c->searched / (double)count,
           (double)c->loaded / (double)count);
    if (argc == 5)
        request_all(argv[4], &how, needed);
    ebpo_context_free(c);
    ebpo_model_free(m);
    ebpo_close(file);
    free(points);
    free(distance);
    free(needed);
    return 0;
}
