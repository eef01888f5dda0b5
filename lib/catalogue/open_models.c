/* Keeps models of any number of catalogues open, within one memory budget.
 *
 * A model is identified by the path and digest of its file, the options of opening, the path of its
 * face indices, and its share of the budget. All models of a catalogue have equal shares. A share
 * is an eighth of the budget, or more if the catalogue has fewer than eight models. A model is
 * opened by the first query that needs it. A thread that queries a model holds the model, and the
 * model's share is reserved while any thread holds the model. When the budget has no space for a
 * further share, models that no thread holds are closed, the least recently used first. If the
 * budget still has no space, the query waits until other queries end. A thread holds one model at a
 * time, so that no thread waits for itself.
 *
 * The file is compared with its catalogue: the digest when the file is opened, and the box whenever
 * the model is lent, because two entries may describe one file differently.
 *
 * Locks: one lock (ebpo_catalogue_models.lock) protects the list of models and the sums over the
 * models. A thread may keep this lock while it closes a file, but never during a query or while it
 * opens a file. Each model has a lock for opening and a lock for queries. */
#include "core/strict_fp.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#include "catalogue/catalogue_in.h"
#include "core/error.h"

/* SHARES: maximum number of shares into which the budget is divided. OPEN_MAX: maximum number of
 * open models; it is lower if the system allows fewer open files. DESCRIPTORS_EACH: number of file
 * descriptors that are counted for each model. CONTEXTS_KEPT: maximum number of idle contexts of a
 * model. */
enum { SHARES = 8, OPEN_MAX = 256, DESCRIPTORS_EACH = 4, CONTEXTS_KEPT = 256 };

/* Identity of a requested model. */
typedef struct model_key {
    const char *path, *numbers; /* path of the model; path of its face indices, or NULL */
    uint8_t digest[32];
    uint64_t share; /* maximum memory of the model in bytes; 0: no limit */
    ebpo_catalogue_open_fn open_file;
    ebpo_catalogue_close_fn close_file;
    void *user;
} model_key;

struct ebpo_catalogue_held {
    /* neighbours in the list of models, which begins with the most recently used model */
    ebpo_catalogue_held *before, *behind;
    model_key key; /* the model owns the texts of its key */
    /* ebpo_catalogue_models.lock protects `users` and `bytes` */
    unsigned users; /* number of threads that hold the model */
    uint64_t bytes; /* bytes of the budget that are counted for the model */
    /* protects `idle` and `idle_count`; until `model` is set, also protects `file`, `model` and
     * `numbers` */
    pthread_mutex_t opening;
    /* each query locks it for reading; a query that must run alone locks it for writing */
    pthread_rwlock_t query_lock;
    ebpo_file *file;
    /* NULL: the model is not open. Atomic, because statistics are read without the lock `opening`
     */
    ebpo_model *_Atomic model;
    ebpo_catalogue_numbers numbers;    /* face indices; not open if key.numbers is NULL */
    ebpo_context *idle[CONTEXTS_KEPT]; /* [idle_count] contexts that no thread uses */
    unsigned idle_count;
};

struct ebpo_catalogue_models {
    unsigned threads, open_max;        /* open_max: maximum number of models in the list */
    pthread_mutex_t lock;              /* protects all fields that follow */
    pthread_cond_t changed;            /* signalled when the budget may have more space */
    uint64_t memory;                   /* budget in bytes; 0: no limit */
    ebpo_catalogue_held *first, *last; /* list of all models */
    unsigned listed, busy;         /* number of models in the list; number of models with users */
    uint64_t taken;                /* sum of `bytes` of all models */
    uint64_t closed;               /* number of closed models */
    ebpo_model_stats closed_stats; /* sums of the statistics of the closed models */
};

/* --- one model --- */

static ebpo_status check_digest(const ebpo_catalogue *c, const ebpo_catalogue_held *m,
                                ebpo_error *error)
{
    const ebpo_info *info = ebpo_file_info(m->file);
    if (memcmp(info->content_sha256, m->key.digest, sizeof m->key.digest) == 0)
        return EBPO_OK;
    return ebpo_fail_file(error, EBPO_E_FORMAT, m->key.path,
                          "does not match the content_sha256 of %.150s: the file has changed; make "
                          "the catalogue again",
                          ebpo_catalogue_shown(c));
}

static ebpo_status check_box(const ebpo_catalogue *c, const ebpo_catalogue_entry *e,
                             const ebpo_catalogue_held *m, ebpo_error *error)
{
    const ebpo_mesh_report *found = &ebpo_file_info(m->file)->report;
    for (int k = 0; k < 3; k++)
        if (!(e->min[k] <= found->min[k] && found->max[k] <= e->max[k]))
            return ebpo_fail_file(error, EBPO_E_FORMAT, m->key.path,
                                  "is not within the box that %.150s has for it; make the "
                                  "catalogue again",
                                  ebpo_catalogue_shown(c));
    return EBPO_OK;
}

static ebpo_status open_numbers(ebpo_catalogue_held *m, ebpo_error *error)
{
    uint64_t faces = ebpo_file_info(m->file)->face_count;
    if (!m->key.numbers)
        return EBPO_OK;
    ebpo_status status = ebpo_catalogue_numbers_open(&m->numbers, m->key.numbers, error);
    if (status == EBPO_OK && m->numbers.count != faces)
        status = ebpo_fail_file(error, EBPO_E_FORMAT, m->key.numbers,
                                "expected an index for each face: %llu indices for %llu faces",
                                (unsigned long long)m->numbers.count, (unsigned long long)faces);
    return status;
}

static void close_model(ebpo_catalogue_held *m)
{
    while (m->idle_count)
        ebpo_context_free(m->idle[--m->idle_count]);
    ebpo_model_free(m->model);
    if (m->file && m->key.close_file)
        m->key.close_file(m->key.user, m->file);
    else
        ebpo_close(m->file);
    ebpo_catalogue_numbers_close(&m->numbers);
    m->model = NULL;
    m->file = NULL;
}

static ebpo_status open_file(ebpo_catalogue_held *m, ebpo_error *error)
{
    const model_key *key = &m->key;
    m->file = NULL;
    if (!key->open_file)
        return ebpo_open(key->path, &m->file, error);
    ebpo_status status = key->open_file(key->user, key->path, &m->file, error);
    return status == EBPO_OK && !m->file ? ebpo_fail_file(error, EBPO_E_ARGUMENT, key->path,
                                                          "the function that opens files returned "
                                                          "no file")
                                         : status;
}

static ebpo_status open_model(const ebpo_catalogue_models *models, const ebpo_catalogue *c,
                              ebpo_catalogue_held *m, ebpo_error *error)
{
    ebpo_error why = EBPO_ERROR_INIT;
    ebpo_model *model = NULL;
    ebpo_model_options o = EBPO_MODEL_OPTIONS_INIT;
    o.memory = m->key.share;
    o.threads = models->threads;
    ebpo_status status = open_file(m, &why);
    if (status == EBPO_OK)
        status = check_digest(c, m, &why);
    if (status == EBPO_OK)
        status = open_numbers(m, &why);
    if (status == EBPO_OK)
        status = ebpo_model_new(m->file, &o, &model, &why);
    if (status == EBPO_OK) {
        m->model = model;
        return EBPO_OK;
    }
    close_model(m);
    if (status == EBPO_E_LIMIT && c->count > 1)
        return ebpo_fail_file(error, status, m->key.path,
                              "%.380s (each model may use one part in %d of the memory budget)",
                              why.message, c->count < SHARES ? (int)c->count : SHARES);
    why.status = status;
    return ebpo_fail_with(error, &why);
}

/* Opens the model if it is not open, and sets *context to a context that no other thread uses. */
static ebpo_status prepare_model(const ebpo_catalogue_models *models, const ebpo_catalogue *c,
                                 ebpo_catalogue_held *m, ebpo_context **context, ebpo_error *error)
{
    pthread_mutex_lock(&m->opening);
    ebpo_status status = m->model ? EBPO_OK : open_model(models, c, m, error);
    *context = status == EBPO_OK && m->idle_count ? m->idle[--m->idle_count] : NULL;
    pthread_mutex_unlock(&m->opening);
    return status == EBPO_OK && !*context ? ebpo_context_new(m->model, context, error) : status;
}

/* Keeps a context for later queries, or frees it if there are too many. */
static void keep_context(ebpo_catalogue_held *m, ebpo_context *context)
{
    pthread_mutex_lock(&m->opening);
    bool kept = context && m->idle_count < CONTEXTS_KEPT;
    if (kept)
        m->idle[m->idle_count++] = context;
    pthread_mutex_unlock(&m->opening);
    if (!kept)
        ebpo_context_free(context);
}

static void held_free(ebpo_catalogue_held *m)
{
    close_model(m);
    pthread_mutex_destroy(&m->opening);
    pthread_rwlock_destroy(&m->query_lock);
    free((char *)m->key.path);
    free((char *)m->key.numbers);
    free(m);
}

static ebpo_catalogue_held *held_new(const model_key *key)
{
    ebpo_catalogue_held *m = calloc(1, sizeof *m);
    if (!m)
        return NULL;
    m->key = *key;
    m->key.path = strdup(key->path);
    m->key.numbers = key->numbers ? strdup(key->numbers) : NULL;
    m->numbers.fd = -1;
    pthread_mutex_init(&m->opening, NULL);
    pthread_rwlock_init(&m->query_lock, NULL);
    if (m->key.path && !m->key.numbers == !key->numbers)
        return m;
    held_free(m);
    return NULL;
}

/* --- all models, under the lock --- */

static bool same_key(const model_key *a, const model_key *b)
{
    return memcmp(a->digest, b->digest, sizeof a->digest) == 0 && a->share == b->share &&
           a->user == b->user && a->open_file == b->open_file && a->close_file == b->close_file &&
           strcmp(a->path, b->path) == 0 && !a->numbers == !b->numbers &&
           (!a->numbers || strcmp(a->numbers, b->numbers) == 0);
}

static void unlink_model(ebpo_catalogue_models *h, ebpo_catalogue_held *m)
{
    *(m->before ? &m->before->behind : &h->first) = m->behind;
    *(m->behind ? &m->behind->before : &h->last) = m->before;
    m->before = m->behind = NULL;
}

static void link_first(ebpo_catalogue_models *h, ebpo_catalogue_held *m)
{
    m->behind = h->first;
    *(h->first ? &h->first->before : &h->last) = m;
    h->first = m;
}

/* Adds the statistics of a model to the sums, if the model is open. */
static void add_stats(const ebpo_catalogue_held *m, ebpo_model_stats *sums)
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

/* Closes and removes a model that no thread holds. */
static void drop_model(ebpo_catalogue_models *h, ebpo_catalogue_held *m)
{
    if (m->model) {
        add_stats(m, &h->closed_stats);
        h->closed_stats.memory = 0;
        h->closed++;
    }
    h->taken -= m->bytes;
    h->listed--;
    unlink_model(h, m);
    held_free(m);
}

/* Returns true if the list has space for `more` further models, and the budget has space for `size`
 * further bytes. */
static bool has_capacity(const ebpo_catalogue_models *h, uint64_t size, unsigned more)
{
    return h->listed + more <= h->open_max && (!h->memory || h->taken + size <= h->memory);
}

/* Closes models that no thread holds, except `kept`, until the budget has space for `size` further
 * bytes. If `kept` is NULL, also makes space for a new model in the list. Returns true if there is
 * space. Returns true also if no thread holds any model, because then waiting would not make more
 * space. */
static bool reserve_space(ebpo_catalogue_models *h, uint64_t size, const ebpo_catalogue_held *kept)
{
    unsigned more = kept == NULL;
    for (ebpo_catalogue_held *m = h->last, *next; m && !has_capacity(h, size, more); m = next) {
        next = m->before;
        if (!m->users && m != kept)
            drop_model(h, m);
    }
    return has_capacity(h, size, more) || !h->busy;
}

static ebpo_catalogue_held *find_model(const ebpo_catalogue_models *h, const model_key *key)
{
    ebpo_catalogue_held *m = h->first;
    while (m && !same_key(&m->key, key))
        m = m->behind;
    return m;
}

static uint64_t share_of(const ebpo_catalogue_models *h, const ebpo_catalogue *c)
{
    uint64_t share = h->memory / (c->count < SHARES ? c->count : SHARES);
    return h->memory && !share ? 1 : share; /* not 0, because a share of 0 means no limit */
}

/* Returns the model with this key, which may be new, and counts the calling thread as its user.
 * Waits while the budget has no space for the model's share. Returns NULL when out of memory. */
static ebpo_catalogue_held *acquire_model(ebpo_catalogue_models *h, const ebpo_catalogue *c,
                                          model_key *key)
{
    ebpo_catalogue_held *m;
    pthread_mutex_lock(&h->lock);
    for (;;) {
        key->share = share_of(h, c);
        m = find_model(h, key);
        uint64_t more = !m ? key->share : m->bytes < key->share ? key->share - m->bytes : 0;
        if ((m && m->users) || reserve_space(h, more, m))
            break;
        pthread_cond_wait(&h->changed, &h->lock);
    }
    if (!m) {
        m = held_new(key);
        h->listed += m != NULL;
    } else {
        unlink_model(h, m);
    }
    if (m) {
        link_first(h, m);
        if (!m->users++) {
            h->busy++;
            /* while threads query the model, it may use any memory up to its share */
            h->taken += key->share - m->bytes;
            m->bytes = key->share;
        }
    }
    pthread_mutex_unlock(&h->lock);
    return m;
}

/* Ends the calling thread's use of a model. Removes the model if it could not be opened. */
static void release_model(ebpo_catalogue_models *h, ebpo_catalogue_held *m)
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

/* --- lending --- */

/* Runs a query while no other query of the model runs. Frees idle contexts first, because they keep
 * the last used subtrees in memory, and this query may need that memory. */
static ebpo_status query_alone(ebpo_catalogue_held *m, ebpo_catalogue_query run_query, void *user,
                               ebpo_error *error)
{
    ebpo_context *context = NULL;
    pthread_rwlock_wrlock(&m->query_lock);
    while (m->idle_count)
        ebpo_context_free(m->idle[--m->idle_count]);
    ebpo_status status = ebpo_context_new(m->model, &context, error);
    if (status == EBPO_OK)
        status = run_query(context, m, user, error);
    keep_context(m, context);
    pthread_rwlock_unlock(&m->query_lock);
    return status;
}

static model_key key_of(const ebpo_catalogue *c, const ebpo_catalogue_entry *e, bool surface)
{
    model_key key = { .path = surface ? e->surface : e->path,
                      .numbers = surface || !e->surface ? e->numbers : NULL,
                      .open_file = c->how.open_file,
                      .close_file = c->how.close_file,
                      .user = c->how.user };
    memcpy(key.digest, surface ? e->surface_digest : e->digest, sizeof key.digest);
    return key;
}

ebpo_status ebpo_catalogue_lend(ebpo_catalogue_models *models, const ebpo_catalogue *c,
                                uint64_t number, bool surface, ebpo_catalogue_query run_query,
                                void *user, ebpo_error *error)
{
    ebpo_context *context = NULL;
    const ebpo_catalogue_entry *e = &c->entry[number];
    model_key key = key_of(c, e, surface && e->surface);
    ebpo_catalogue_held *m = acquire_model(models, c, &key);
    if (!m)
        return ebpo_fail_memory(error, sizeof *m);
    pthread_rwlock_rdlock(&m->query_lock);
    ebpo_status status = prepare_model(models, c, m, &context, error);
    if (status == EBPO_OK)
        status = check_box(c, e, m, error);
    if (status == EBPO_OK)
        status = run_query(context, m, user, error);
    bool run_alone = status == EBPO_E_LIMIT && context;
    keep_context(m, context);
    pthread_rwlock_unlock(&m->query_lock);
    if (run_alone)
        status = query_alone(m, run_query, user, error);
    release_model(models, m);
    return status;
}

bool ebpo_catalogue_in_memory(ebpo_catalogue_models *models, const ebpo_catalogue *c)
{
    ebpo_model_stats s = EBPO_MODEL_STATS_INIT;
    model_key key = key_of(c, c->entry, false);
    pthread_mutex_lock(&models->lock);
    key.share = share_of(models, c);
    const ebpo_catalogue_held *m = c->count == 1 ? find_model(models, &key) : NULL;
    bool in_memory = m && m->model && ebpo_model_get_stats(m->model, &s) == EBPO_OK && s.resident;
    pthread_mutex_unlock(&models->lock);
    return in_memory;
}

ebpo_status ebpo_catalogue_held_face(const ebpo_catalogue_held *m, uint64_t *face,
                                     ebpo_error *error)
{
    return m->numbers.fd < 0 || *face == EBPO_NO_FACE
               ? EBPO_OK
               : ebpo_catalogue_numbers_get(&m->numbers, face, error);
}

/* --- creating and freeing --- */

/* Returns the maximum number of open models. The models may use half of the file descriptors that
 * the system allows this process. */
static unsigned max_open_models(void)
{
    struct rlimit limit;
    if (getrlimit(RLIMIT_NOFILE, &limit) != 0 ||
        limit.rlim_cur / (2 * DESCRIPTORS_EACH) >= OPEN_MAX)
        return OPEN_MAX;
    unsigned fit = (unsigned)limit.rlim_cur / (2 * DESCRIPTORS_EACH);
    return fit ? fit : 1;
}

ebpo_status ebpo_catalogue_models_new(const ebpo_catalogue_models_options *options,
                                      ebpo_catalogue_models **out, ebpo_error *error)
{
    ebpo_catalogue_models_options own = EBPO_CATALOGUE_MODELS_OPTIONS_INIT;
    *out = NULL;
    ebpo_status status = EBPO_TAKE(ebpo_catalogue_models_options, &own, options, error);
    if (status != EBPO_OK)
        return status;
    ebpo_catalogue_models *h = calloc(1, sizeof *h);
    if (!h)
        return ebpo_fail_memory(error, sizeof *h);
    h->memory = own.memory;
    h->threads = own.threads;
    h->closed_stats = (ebpo_model_stats)EBPO_MODEL_STATS_INIT;
    h->open_max = max_open_models();
    pthread_mutex_init(&h->lock, NULL);
    pthread_cond_init(&h->changed, NULL);
    *out = h;
    return EBPO_OK;
}

void ebpo_catalogue_models_free(ebpo_catalogue_models *h)
{
    if (!h)
        return;
    while (h->first)
        drop_model(h, h->first);
    pthread_mutex_destroy(&h->lock);
    pthread_cond_destroy(&h->changed);
    free(h);
}

void ebpo_catalogue_models_set_memory(ebpo_catalogue_models *h, uint64_t memory)
{
    pthread_mutex_lock(&h->lock);
    h->memory = memory;
    pthread_cond_broadcast(&h->changed);
    pthread_mutex_unlock(&h->lock);
}

void ebpo_catalogue_models_close_idle(ebpo_catalogue_models *h)
{
    pthread_mutex_lock(&h->lock);
    for (ebpo_catalogue_held *m = h->first, *next; m; m = next) {
        next = m->behind;
        if (!m->users)
            drop_model(h, m);
    }
    pthread_cond_broadcast(&h->changed);
    pthread_mutex_unlock(&h->lock);
}

ebpo_status ebpo_catalogue_models_get_stats(ebpo_catalogue_models *h,
                                            ebpo_catalogue_models_stats *out,
                                            ebpo_model_stats *sums)
{
    ebpo_catalogue_models_stats n = EBPO_CATALOGUE_MODELS_STATS_INIT;
    pthread_mutex_lock(&h->lock);
    ebpo_model_stats all = h->closed_stats;
    n.closed = h->closed;
    for (const ebpo_catalogue_held *m = h->first; m; m = m->behind) {
        add_stats(m, &all);
        n.open += m->model != NULL;
    }
    all.budget = h->memory;
    pthread_mutex_unlock(&h->lock);
    n.opened = n.closed + n.open;
    ebpo_status status = EBPO_GIVE(ebpo_catalogue_models_stats, out, &n);
    return status == EBPO_OK && sums ? EBPO_GIVE(ebpo_model_stats, sums, &all) : status;
}
