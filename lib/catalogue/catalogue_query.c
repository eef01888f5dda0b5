/* Evaluates queries to a catalogue. Rows (points or rays) are divided into ranges (stretches). Each
 * range is processed by one thread, which queries each model once for all rows of the range.
 *
 * Points are processed in laps of some millions of points. The points of a lap are sorted along the
 * Morton curve of the catalogue's box, so that a range needs few models and few subtrees. If the
 * catalogue has a single model that is completely in memory, points are not sorted. Rays are
 * processed in the given order, because each model sorts its rays itself.
 *
 * The result of a row depends only on this row, not on its range, the threads, or the models that
 * are open. A thread has the results of only one range and one model in memory at a time. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "catalogue/catalogue_in.h"
#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "query/query_model.h"

/* STRETCH_LEAST, STRETCH_MAX: limits of the number of rows in a range. LAP: maximum number of rows
 * in a lap. UNORDERED: up to this number, points are not sorted, because sorting so few points
 * takes more time than it saves. */
enum { STRETCH_LEAST = 1 << 10, STRETCH_MAX = 1 << 16, LAP = 1 << 22, UNORDERED = 1 << 8 };
/* Number of ranges for each thread. With several ranges for each thread, no thread waits long for
 * the last range of another thread. */
enum { STRETCHES_EACH = 4 };

ebpo_status ebpo_catalogue_need_surface(const ebpo_catalogue *c, ebpo_error *error)
{
    return c->seen.levels ? EBPO_OK
                          : ebpo_fail_file(error, EBPO_E_ABSENT, ebpo_catalogue_shown(c),
                                           "contains caps only, no surface; query the catalogue "
                                           "of all parts");
}

/* --- queries of each model once --- */

static int by_model(const void *a, const void *b)
{
    const ebpo_catalogue_pair *x = a, *y = b;
    return x->box != y->box ? (x->box < y->box ? -1 : 1)
                            : (x->item > y->item) - (x->item < y->item);
}

/* Returns the largest number of pairs that have the same model. The pairs must be sorted by model.
 */
static uint64_t longest_run(const ebpo_catalogue_pairs *pairs)
{
    uint64_t longest = 0;
    for (uint64_t at = 0, begin = 0; at < pairs->count; at++) {
        if (pairs->pair[at].box != pairs->pair[begin].box)
            begin = at;
        longest = at + 1 - begin > longest ? at + 1 - begin : longest;
    }
    return longest;
}

ebpo_status ebpo_catalogue_query_runs(const ebpo_catalogue_batch *a, ebpo_catalogue_pairs *pairs,
                                      const double *rows, size_t width, bool surface,
                                      ebpo_catalogue_query run_query, void *user, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    if (pairs->count == 0)
        return EBPO_OK;
    qsort(pairs->pair, pairs->count, sizeof *pairs->pair, by_model);
    uint64_t longest = longest_run(pairs);
    double *input = ebpo_alloc(longest, width * sizeof *input);
    if (!input)
        return ebpo_fail_memory(error, longest * width * sizeof *input);
    for (uint64_t at = 0; at < pairs->count && status == EBPO_OK;) {
        const ebpo_catalogue_pair *pair = pairs->pair + at;
        ebpo_catalogue_run run = { .model = pair->box, .pair = pair, .rows = input, .user = user };
        for (; at < pairs->count && pairs->pair[at].box == run.model; at++, run.count++)
            memcpy(input + run.count * width, rows + pairs->pair[at].item * width,
                   width * sizeof *input);
        status = ebpo_catalogue_lend(a->models, a->c, run.model, surface, run_query, &run, error);
    }
    free(input);
    return status;
}

bool ebpo_catalogue_find_point(const ebpo_catalogue_boxes *boxes, const double *row, uint32_t item,
                               ebpo_catalogue_pairs *out)
{
    return ebpo_catalogue_boxes_holding(boxes, row, item, out);
}

bool ebpo_catalogue_find_ray(const ebpo_catalogue_boxes *boxes, const double *row, uint32_t item,
                             ebpo_catalogue_pairs *out)
{
    return ebpo_catalogue_boxes_on_ray(boxes, row, row + 3, item, out);
}

ebpo_status ebpo_catalogue_query_all(const ebpo_catalogue_batch *a, const double *rows,
                                     uint32_t count, size_t width, ebpo_catalogue_find find,
                                     bool surface, ebpo_catalogue_query run_query, void *user,
                                     ebpo_error *error)
{
    const ebpo_catalogue_boxes *boxes = surface ? &a->c->seen : &a->c->all;
    ebpo_catalogue_pairs pairs = { NULL, 0, 0 };
    ebpo_status status = EBPO_OK;
    for (uint32_t at = 0; at < count && status == EBPO_OK; pairs.count = 0) {
        for (; at < count && pairs.count < EBPO_CATALOGUE_PAIRS && status == EBPO_OK; at++)
            if (!find(boxes, rows + at * width, at, &pairs))
                status = ebpo_fail_memory(error, pairs.count * sizeof *pairs.pair);
        if (status == EBPO_OK)
            status =
                ebpo_catalogue_query_runs(a, &pairs, rows, width, surface, run_query, user, error);
    }
    free(pairs.pair);
    return status;
}

/* --- ranges of rows --- */

/* Copies of the rows and results of a range, in the order of the Morton curve. */
typedef struct gathered {
    double *rows;    /* [rows of the range][job.width] */
    char *out;       /* results, job.result bytes for each row */
    uint64_t *model; /* for each row: index of the model that gave the result */
} gathered;

static ebpo_status query_gathered(const ebpo_catalogue_job *j, const uint32_t *order,
                                  uint32_t count, gathered *g, ebpo_error *error)
{
    for (uint32_t i = 0; i < count; i++)
        memcpy(g->rows + i * j->width, j->rows + order[i] * j->width, j->width * sizeof *g->rows);
    ebpo_status status = j->run_query(&j->batch, g->rows, count, g->out, g->model, error);
    for (uint32_t i = 0; i < count && status == EBPO_OK; i++) {
        memcpy(j->out + order[i] * j->result, g->out + i * j->result, j->result);
        if (j->model)
            j->model[order[i]] = g->model[i];
    }
    return status;
}

static ebpo_status query_stretch(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    const ebpo_catalogue_job *j = context;
    uint32_t count = (uint32_t)(end - begin);
    (void)worker;
    if (!j->order)
        return j->run_query(&j->batch, j->rows + begin * j->width, count,
                            j->out + begin * j->result, j->model ? j->model + begin : NULL, error);
    gathered g = { ebpo_alloc(count, j->width * sizeof *g.rows), ebpo_alloc(count, j->result),
                   ebpo_alloc(count, sizeof *g.model) };
    ebpo_status status =
        g.rows && g.out && g.model
            ? query_gathered(j, j->order + begin, count, &g, error)
            : ebpo_fail_memory(error, count * (j->result + j->width * sizeof *g.rows));
    free(g.rows);
    free(g.out);
    free(g.model);
    return status;
}

/* --- laps --- */

/* Returns true if sorting the rows of this job, of which there are `count`, saves time. */
static bool needs_order(const ebpo_catalogue_job *j, uint64_t count)
{
    return j->ordered && count > UNORDERED &&
           !ebpo_catalogue_in_memory(j->batch.models, j->batch.c);
}

static ebpo_status query_lap(ebpo_catalogue_job *j, uint64_t count, bool in_order,
                             const ebpo_progress *progress, ebpo_error *error)
{
    const ebpo_catalogue_box *box = j->batch.c->all.box[j->batch.c->all.levels - 1];
    unsigned threads = ebpo_thread_count(j->batch.options->threads);
    uint64_t grain = count / ((uint64_t)threads * STRETCHES_EACH) + 1;
    uint32_t *order = in_order ? ebpo_alloc(count, sizeof *order) : NULL;
    if (in_order &&
        (!order || !ebpo_catalogue_morton_order(j->rows, count, box->min, box->max, order))) {
        free(order);
        return ebpo_fail_memory(error, count * sizeof *order);
    }
    if (threads == 1 || grain > STRETCH_MAX)
        grain = STRETCH_MAX;
    if (grain < STRETCH_LEAST)
        grain = STRETCH_LEAST;
    j->order = order;
    ebpo_status status =
        ebpo_parallel_for(threads, NULL, count, grain, query_stretch, j, progress, j->stage, error);
    free(order);
    return status;
}

ebpo_status ebpo_catalogue_query_rows(ebpo_catalogue_job *j, uint64_t count, ebpo_error *error)
{
    bool in_order = needs_order(j, count);
    ebpo_status status = EBPO_OK;
    for (uint64_t at = 0; at < count && status == EBPO_OK; at += LAP) {
        uint64_t lap_rows = count - at < LAP ? count - at : LAP;
        ebpo_pass pass = { &j->batch.options->progress, at, at + lap_rows, count };
        ebpo_progress reported = ebpo_pass_progress(&pass);
        status = query_lap(j, lap_rows, in_order, count > LAP ? &reported : pass.to, error);
        j->rows += lap_rows * j->width;
        j->out += lap_rows * j->result;
        j->model += j->model ? lap_rows : 0;
    }
    return status;
}

ebpo_status ebpo_catalogue_take_options(ebpo_catalogue_query_options *own,
                                        const ebpo_catalogue_query_options *given,
                                        ebpo_error *error)
{
    *own = (ebpo_catalogue_query_options)EBPO_CATALOGUE_QUERY_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_catalogue_query_options, own, given, error);
    if (status == EBPO_OK && !(own->max_distance >= 0))
        status = ebpo_fail(error, EBPO_E_ARGUMENT, "maximum distance %g is invalid; give 0 or more",
                           own->max_distance);
    if (status == EBPO_OK && (unsigned)own->sides > EBPO_RAY_BACK)
        status = ebpo_fail_value(error);
    return status;
}
