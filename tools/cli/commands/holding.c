#include "cli/commands/holding.h"

#include <ebpo/query.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#include "cli/commands/face_numbers_file.h"
#include "cli/words.h"

/* Models that are asked at a time at most, where there are many; open ones at most, for which the
 * system may allow fewer: each has a file or two. */
enum { SHARES = 8, OPEN_MOST = 256, DESCRIPTORS_EACH = 4, CONTEXTS_KEPT = 256 };

struct held_model {
    held_model *before, *behind; /* in the order of use, the latest first */
    uint64_t key;                /* place in `slot` */
    unsigned users;              /* these are under the holding's lock */
    uint64_t bytes;              /* that are counted */
    pthread_mutex_t opening;     /* of what follows, until there is a model; and of the contexts */
    pthread_rwlock_t asking;     /* alone: to ask when nobody else does */
    ebpo_file *file;
    ebpo_model *model;
    face_numbers_file numbers;
    ebpo_context *idle[CONTEXTS_KEPT];
    unsigned idle_count;
};

struct held_models {
    const catalogue *c;
    holding_options options;
    uint64_t share; /* of a model that is asked */
    unsigned open_most;
    pthread_mutex_t lock; /* of all below */
    pthread_cond_t changed;
    held_model **slot; /* [2 * count] the model, and its surface */
    held_model *first, *last;
    unsigned open, busy;
    uint64_t taken;
    holding_counts gone;
};

/* --- one model --- */

static ebpo_status look_at(const held_models *h, held_model *m, const catalogue_entry *e,
                           bool surface, ebpo_error *error)
{
    const char *path = surface ? e->surface : e->path;
    const ebpo_info *info = ebpo_file_info(m->file);
    char found[CATALOGUE_DIGEST + 1];
    words_hex(info->content_sha256, found);
    if (strcmp(found, surface ? e->surface_digest : e->digest) != 0)
        return catalogue_fail(error, EBPO_E_FORMAT, path,
                              "is not the file that %.150s tells of, by its content_sha256; make "
                              "the catalogue anew",
                              h->c->path);
    for (int k = 0; k < 3; k++)
        if (!(e->min[k] <= info->report.min[k] && info->report.max[k] <= e->max[k]))
            return catalogue_fail(error, EBPO_E_FORMAT, path,
                                  "is not within the box that %.150s tells; make the catalogue "
                                  "anew",
                                  h->c->path);
    if (!e->numbers || (e->surface && !surface))
        return EBPO_OK;
    ebpo_status status = face_numbers_open(&m->numbers, e->numbers, error);
    if (status == EBPO_OK && m->numbers.count != info->face_count)
        status = catalogue_fail(error, EBPO_E_FORMAT, e->numbers, "%llu numbers of %llu faces",
                                (unsigned long long)m->numbers.count,
                                (unsigned long long)info->face_count);
    return status;
}

static void close_model(held_model *m)
{
    while (m->idle_count)
        ebpo_context_free(m->idle[--m->idle_count]);
    ebpo_model_free(m->model);
    ebpo_close(m->file);
    face_numbers_close(&m->numbers);
    m->model = NULL;
    m->file = NULL;
}

static ebpo_status open_model(const held_models *h, held_model *m, ebpo_error *error)
{
    const catalogue_entry *e = &h->c->entry[m->key / 2];
    bool surface = m->key % 2;
    const char *path = surface ? e->surface : e->path;
    ebpo_model_options o = EBPO_MODEL_OPTIONS_INIT;
    o.memory = h->share;
    o.threads = h->options.threads;
    ebpo_status status = remote_open(&m->file, path, h->options.remote, error);
    if (status == EBPO_OK)
        status = look_at(h, m, e, surface, error);
    if (status == EBPO_OK)
        status = ebpo_model_new(m->file, &o, &m->model, error);
    if (status == EBPO_E_LIMIT && h->c->count > 1) {
        ebpo_error why = *error;
        status = catalogue_fail(error, why.status, path,
                                "%.380s (of --memory each model may take one part in %d)",
                                why.message, h->c->count < SHARES ? (int)h->c->count : SHARES);
    }
    if (status != EBPO_OK)
        close_model(m);
    return status;
}

/* Once, by the first of those that want it. */
static ebpo_status ready_context(const held_models *h, held_model *m, ebpo_context **context,
                                 ebpo_error *error)
{
    pthread_mutex_lock(&m->opening);
    ebpo_status status = m->model ? EBPO_OK : open_model(h, m, error);
    *context = status == EBPO_OK && m->idle_count ? m->idle[--m->idle_count] : NULL;
    pthread_mutex_unlock(&m->opening);
    return status == EBPO_OK && !*context ? ebpo_context_new(m->model, context, error) : status;
}

static void put_by(held_model *m, ebpo_context *context)
{
    pthread_mutex_lock(&m->opening);
    bool kept = context && m->idle_count < CONTEXTS_KEPT;
    if (kept)
        m->idle[m->idle_count++] = context;
    pthread_mutex_unlock(&m->opening);
    if (!kept)
        ebpo_context_free(context);
}

static held_model *held_new(uint64_t key)
{
    held_model *m = calloc(1, sizeof *m);
    if (!m)
        return NULL;
    m->key = key;
    m->numbers.fd = -1;
    pthread_mutex_init(&m->opening, NULL);
    pthread_rwlock_init(&m->asking, NULL);
    return m;
}

static void held_free(held_model *m)
{
    close_model(m);
    pthread_mutex_destroy(&m->opening);
    pthread_rwlock_destroy(&m->asking);
    free(m);
}

/* --- all of them, under the lock --- */

static void unlink_model(held_models *h, held_model *m)
{
    *(m->before ? &m->before->behind : &h->first) = m->behind;
    *(m->behind ? &m->behind->before : &h->last) = m->before;
    m->before = m->behind = NULL;
}

static void link_first(held_models *h, held_model *m)
{
    m->behind = h->first;
    *(h->first ? &h->first->before : &h->last) = m;
    h->first = m;
}

static void add_up(const held_model *m, ebpo_model_stats *sums)
{
    ebpo_model_stats s = EBPO_MODEL_STATS_INIT;
    if (!m->model || ebpo_model_get_stats(m->model, &s) != EBPO_OK)
        return;
    sums->memory += s.memory;
    sums->hits += s.hits;
    sums->loads += s.loads;
    sums->evicted += s.evicted;
    sums->bytes_read += s.bytes_read;
    sums->reads += s.reads;
    sums->open_seconds += s.open_seconds;
    sums->load_seconds += s.load_seconds;
    sums->distances += s.distances;
    sums->distance_subtrees += s.distance_subtrees;
    sums->distance_loads += s.distance_loads;
}

static void drop_model(held_models *h, held_model *m)
{
    if (m->model) {
        add_up(m, &h->gone.sums);
        h->gone.sums.memory = 0;
        h->gone.closed++;
    }
    h->slot[m->key] = NULL;
    h->taken -= m->bytes;
    h->open--;
    unlink_model(h, m);
    held_free(m);
}

static bool has_room(const held_models *h, uint64_t size, unsigned more)
{
    return h->open + more <= h->open_most &&
           (!h->options.memory || h->taken + size <= h->options.memory);
}

/* Closes what is idle until there is room for `size` bytes more; whether there is, or nothing else
 * is used, so that waiting would not help. */
static bool make_room(held_models *h, uint64_t size, const held_model *but)
{
    unsigned more = but == NULL;
    for (held_model *m = h->last, *next; m && !has_room(h, size, more); m = next) {
        next = m->before;
        if (!m->users && m != but)
            drop_model(h, m);
    }
    return has_room(h, size, more) || !h->busy;
}

/* NULL: not enough memory. */
static held_model *take_model(held_models *h, uint64_t key)
{
    held_model *m;
    pthread_mutex_lock(&h->lock);
    for (;;) {
        m = h->slot[key];
        uint64_t more = !m ? h->share : m->bytes < h->share ? h->share - m->bytes : 0;
        if ((m && m->users) || make_room(h, more, m))
            break;
        pthread_cond_wait(&h->changed, &h->lock);
    }
    if (!m) {
        m = h->slot[key] = held_new(key);
        h->open += m != NULL;
    } else {
        unlink_model(h, m);
    }
    if (m) {
        link_first(h, m);
        if (!m->users++) {
            h->busy++;
            h->taken += h->share - m->bytes; /* what it takes now may become less, or more */
            m->bytes = h->share;
        }
    }
    pthread_mutex_unlock(&h->lock);
    return m;
}

/* What is of no use, as it could not be opened, goes. */
static void give_back(held_models *h, held_model *m)
{
    ebpo_model_stats s = EBPO_MODEL_STATS_INIT;
    pthread_mutex_lock(&h->lock);
    if (!--m->users) {
        h->busy--;
        if (!m->model || ebpo_model_get_stats(m->model, &s) != EBPO_OK) {
            drop_model(h, m);
        } else {
            h->taken += s.memory - m->bytes;
            m->bytes = s.memory;
        }
    }
    pthread_cond_broadcast(&h->changed);
    pthread_mutex_unlock(&h->lock);
}

/* --- asking --- */

/* Contexts hold what they were last asked about: they go, that there is room for one. */
static ebpo_status ask_alone(held_model *m, holding_question ask, void *user, ebpo_error *error)
{
    ebpo_context *context = NULL;
    pthread_rwlock_wrlock(&m->asking);
    while (m->idle_count)
        ebpo_context_free(m->idle[--m->idle_count]);
    ebpo_status status = ebpo_context_new(m->model, &context, error);
    if (status == EBPO_OK)
        status = ask(context, m, user, error);
    put_by(m, context);
    pthread_rwlock_unlock(&m->asking);
    return status;
}

ebpo_status holding_ask(held_models *h, uint64_t number, bool surface, holding_question ask,
                        void *user, ebpo_error *error)
{
    ebpo_context *context = NULL;
    held_model *m = take_model(h, 2 * number + (surface && h->c->entry[number].surface));
    if (!m)
        return catalogue_fail(error, EBPO_E_MEMORY, NULL, "not enough memory");
    pthread_rwlock_rdlock(&m->asking);
    ebpo_status status = ready_context(h, m, &context, error);
    if (status == EBPO_OK)
        status = ask(context, m, user, error);
    bool again = status == EBPO_E_LIMIT && context;
    put_by(m, context);
    pthread_rwlock_unlock(&m->asking);
    if (again)
        status = ask_alone(m, ask, user, error);
    give_back(h, m);
    return status;
}

ebpo_status held_face(const held_model *m, uint64_t *face, ebpo_error *error)
{
    return m->numbers.fd < 0 || *face == EBPO_NO_FACE ? EBPO_OK
                                                      : face_numbers_get(&m->numbers, face, error);
}

/* --- beginning and end --- */

static unsigned may_be_open(void)
{
    struct rlimit most;
    if (getrlimit(RLIMIT_NOFILE, &most) != 0 || most.rlim_cur / (2 * DESCRIPTORS_EACH) >= OPEN_MOST)
        return OPEN_MOST;
    unsigned fit = (unsigned)most.rlim_cur / (2 * DESCRIPTORS_EACH);
    return fit ? fit : 1;
}

held_models *holding_new(const catalogue *c, const holding_options *options)
{
    held_models *h = calloc(1, sizeof *h);
    if (!h)
        return NULL;
    h->c = c;
    h->options = *options;
    h->gone.sums = (ebpo_model_stats)EBPO_MODEL_STATS_INIT;
    h->open_most = may_be_open();
    h->share = options->memory / (c->count < SHARES ? c->count : SHARES);
    h->share += options->memory && !h->share; /* 0 would be without limit */
    pthread_mutex_init(&h->lock, NULL);
    pthread_cond_init(&h->changed, NULL);
    h->slot = calloc(2 * c->count, sizeof(held_model *));
    if (h->slot)
        return h;
    holding_free(h);
    return NULL;
}

void holding_free(held_models *h)
{
    if (!h)
        return;
    while (h->first)
        drop_model(h, h->first);
    free(h->slot);
    pthread_mutex_destroy(&h->lock);
    pthread_cond_destroy(&h->changed);
    free(h);
}

void holding_get_counts(held_models *h, holding_counts *out)
{
    pthread_mutex_lock(&h->lock);
    *out = h->gone;
    out->opened = out->closed;
    for (const held_model *m = h->first; m; m = m->behind) {
        add_up(m, &out->sums);
        out->opened += m->model != NULL;
    }
    pthread_mutex_unlock(&h->lock);
    out->sums.budget = h->options.memory;
}
