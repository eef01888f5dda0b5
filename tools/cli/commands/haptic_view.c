/* Each page has a connection, on which it gets server-sent events:
 *     step    the last haptic step: device, proxy, contact, force
 *     paint   layers, and points of strokes that the page does not have yet
 *     end     the device has ended
 * The page sends messages: positions of the device to /device, commands of the pen to /pen. The
 * thread of the loop never waits for a page: it only tries to lock the position. */
#include "cli/commands/haptic_view.h"

#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "cli/command.h"
#include "cli/serve/http_request.h"
#include "cli/commands/site.h"
#include "cli/tool_clock.h"

/* TICK_NS: time between two looks for news. PING_TICKS: number of looks without news after which a
 * comment is sent, to detect a page that has left. END_NS: time for the last events. */
enum { TICK_NS = 12000000, PING_TICKS = 80, END_NS = 200000000, PAGE_SECONDS = 60 };

struct haptic_view {
    haptic_view_options options;
    site *site;
    int listener;
    int stop[2]; /* a pipe, which ends the server */
    pthread_t server;
    atomic_bool ended;
    atomic_int pages;
    pthread_mutex_t lock; /* guards `last` to `touch_clock` */
    haptic_sample last;
    uint64_t taken;            /* number of steps */
    uint64_t touch_clock;      /* clock at the first step of the present or last contact */
    pthread_mutex_t pose_lock; /* guards `pose` and `has_pose` */
    haptic_pose pose;          /* sent by a page */
    bool has_pose;
    haptic_pose read; /* used by the thread of the loop: the last pose that it has read */
};

/* --- events --- */

static double ms_since(uint64_t clock) { return 1e-6 * (double)(tool_clock() - clock); }

static double real_time_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_REALTIME, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

static void write_vector(FILE *f, const char *name, const double v[3])
{
    fprintf(f, "\"%s\":[%.9g,%.9g,%.9g],", name, v[0], v[1], v[2]);
}

/* Writes the event "step" if there are steps after number *taken. Ages are in milliseconds before
 * `now`, the time at which the event was written. */
static void write_step(haptic_view *view, uint64_t *taken, FILE *f)
{
    pthread_mutex_lock(&view->lock);
    haptic_sample s = view->last;
    uint64_t touch = view->touch_clock;
    bool is_new = view->taken > *taken;
    *taken = view->taken;
    pthread_mutex_unlock(&view->lock);
    if (!is_new)
        return;
    fputs("event: step\ndata: {", f);
    write_vector(f, "device", s.device);
    write_vector(f, "proxy", s.proxy);
    write_vector(f, "force", s.force);
    if (isnan(s.depth)) /* only bounds of the distance are known */
        fputs("\"depth\":null,", f);
    else
        fprintf(f, "\"depth\":%.9g,", s.depth);
    if (view->options.is_probe)
        fprintf(f, "\"colour\":\"#%02x%02x%02x\",", s.rgb[0], s.rgb[1], s.rgb[2]);
    fprintf(f, "\"contact\":%s,\"age\":%.3f,\"touch_age\":%.3f,\"now\":%.3f}\n\n",
            s.flags & EBPO_HAPTIC_CONTACT ? "true" : "false", ms_since(s.clock),
            touch ? ms_since(touch) : 0, real_time_ms());
}

/* Makes the news for a page. Returns an empty text if there are none; NULL without memory. The
 * caller frees it. */
static char *make_news(haptic_view *view, uint64_t *taken, haptic_paint_cursor *cursor)
{
    char *text = NULL;
    size_t size = 0;
    FILE *f = open_memstream(&text, &size);
    if (!f)
        return NULL;
    write_step(view, taken, f); /* the page learns of a contact before its first paint */
    if (view->options.paint)
        haptic_paints_write_news(view->options.paint, cursor, f);
    if (fclose(f) == 0)
        return text;
    free(text);
    return NULL;
}

/* Lifts the pen of a page that is the device. */
static void lift_pen(haptic_view *view)
{
    pthread_mutex_lock(&view->pose_lock);
    view->pose.lifted = true;
    pthread_mutex_unlock(&view->pose_lock);
}

/* An http_stream_fn. */
static void stream_news(void *user, http_stream *stream)
{
    haptic_view *view = user;
    haptic_paint_cursor *cursor =
        view->options.paint ? haptic_paints_cursor(view->options.paint) : NULL;
    uint64_t taken = 0;
    int quiet = 0;
    char begin[200];
    snprintf(begin, sizeof begin,
             "retry: 1000\nevent: hello\ndata: {\"radius\":%.9g,\"full_depth\":%.9g,\"device\":%s,"
             "\"paint\":%s}\n\n",
             view->options.radius, view->options.full_depth,
             view->options.is_device ? "true" : "false", view->options.paint ? "true" : "false");
    bool sent = (cursor || !view->options.paint) && http_stream_send(stream, begin, strlen(begin));
    atomic_fetch_add(&view->pages, 1);
    while (sent) {
        bool last = atomic_load(&view->ended);
        char *news = make_news(view, &taken, cursor);
        size_t length = news ? strlen(news) : 0;
        if (length)
            sent = http_stream_send(stream, news, length);
        free(news);
        if (!length && last)
            break;
        if (!length && ++quiet == PING_TICKS)
            sent = http_stream_send(stream, ":\n\n", 3);
        quiet = length || quiet == PING_TICKS ? 0 : quiet;
        tool_wait_until(tool_clock() + TICK_NS);
    }
    free(cursor);
    if (sent)
        (void)http_stream_send(stream, "event: end\ndata: {}\n\n", 21);
    else if (!atomic_load(&view->ended))
        fprintf(stderr, "ebpo haptic: a page of the viewer has left; the device continues\n");
    if (atomic_fetch_sub(&view->pages, 1) == 1)
        lift_pen(view);
}

/* --- the server --- */

static int find_path(void *user, const char *path, bool has_query, http_content *out)
{
    haptic_view *view = user;
    if (strcmp(path, "/live") != 0)
        return site_find(view->site, path, has_query, out);
    *out = (http_content){ .type = "text/event-stream", .file = -1, .stream = stream_news };
    return HTTP_OK;
}

static int take_pose(haptic_view *view, const char *text, size_t length)
{
    static const char *const words[] = { "press ", "hover " };
    haptic_pose pose;
    bool hovers = strncmp(text, words[1], 6) == 0;
    if ((!hovers && strncmp(text, words[0], 6) != 0) ||
        haptic_pose_read(text + 6, length - 6, &pose) < 3)
        return HTTP_BAD_REQUEST;
    pose.lifted |= hovers;
    pthread_mutex_lock(&view->pose_lock);
    view->pose = pose;
    view->has_pose = true;
    pthread_mutex_unlock(&view->pose_lock);
    return HTTP_NO_CONTENT;
}

static int take_message(void *user, const char *path, const char *bytes, size_t length)
{
    haptic_view *view = user;
    char text[HTTP_BODY_MAX + 1];
    if (memchr(bytes, 0, length))
        return HTTP_BAD_REQUEST;
    memcpy(text, bytes, length);
    text[length] = 0;
    if (strcmp(path, "/device") == 0 && view->options.is_device)
        return take_pose(view, text, length);
    if (strcmp(path, "/pen") == 0 && view->options.paint)
        return haptic_paints_command(view->options.paint, text) ? HTTP_NO_CONTENT
                                                                : HTTP_BAD_REQUEST;
    return HTTP_NOT_FOUND;
}

static void *run_server(void *user)
{
    haptic_view *view = user;
    const http_service service = { find_path, take_message, view, view->stop[0] };
    if (!http_server_run(view->listener, &service))
        fprintf(stderr, "ebpo haptic: the server of the viewer cannot run: %s\n", strerror(errno));
    return NULL;
}

static bool listen_at(haptic_view *view)
{
    int port = (int)view->options.port;
    view->listener = http_server_listen(&port);
    if (view->listener < 0 || pipe(view->stop) != 0) {
        fprintf(stderr,
                "ebpo haptic: port %d of 127.0.0.1 cannot be used: %s; choose another one with "
                "--port, or 0 for a free one\n",
                port, strerror(errno));
        return false;
    }
    fprintf(stderr, "ebpo haptic: open http://127.0.0.1:%d/ in a browser of this machine\n", port);
    return true;
}

/* Waits for the first page, and reports if none comes. */
static void wait_for_page(haptic_view *view)
{
    uint64_t end = tool_clock() + PAGE_SECONDS * UINT64_C(1000000000);
    while (atomic_load(&view->pages) == 0 && tool_clock() < end)
        tool_wait_until(tool_clock() + TICK_NS);
    if (atomic_load(&view->pages) == 0)
        fprintf(stderr,
                "ebpo haptic: no browser has opened the page in %d seconds; the device "
                "begins without it\n",
                PAGE_SECONDS);
}

/* Adds the model, or the scene and its models. Returns false after an error, which was reported. */
static bool add_models(site *s, const haptic_view_options *options)
{
    const haptic_scene *scene = options->scene;
    bool ok = scene || site_add(s, options->model) == EXIT_OK;
    for (uint64_t i = 0; scene && ok && i < scene->surface_count; i++)
        ok = site_add(s, scene->paths[i]) == EXIT_OK;
    if (ok && scene)
        ok = site_show_scene(s, haptic_scene_text(scene)) == EXIT_OK;
    return ok && site_finish(s) == EXIT_OK;
}

haptic_view *haptic_view_begin(const haptic_view_options *options)
{
    haptic_view *view = calloc(1, sizeof *view);
    const site_options of = { .command = "haptic",
                              .viewer = options->viewer,
                              .query = "&live=live",
                              .max_expansion = options->max_expansion };
    if (!view) {
        (void)command_no_memory("haptic");
        return NULL;
    }
    view->options = *options;
    view->listener = view->stop[0] = view->stop[1] = -1;
    pthread_mutex_init(&view->lock, NULL);
    pthread_mutex_init(&view->pose_lock, NULL);
    view->site = site_new(&of);
    bool ok = view->site && add_models(view->site, options) && listen_at(view);
    if (ok && command_thread(&view->server, run_server, view) == 0) {
        wait_for_page(view);
        return view;
    }
    if (ok)
        (void)command_no_memory("haptic");
    if (view->listener >= 0)
        close(view->listener);
    site_free(view->site);
    free(view);
    return NULL;
}

void haptic_view_take(void *user, const haptic_sample *samples, uint64_t count)
{
    haptic_view *view = user;
    pthread_mutex_lock(&view->lock);
    for (uint64_t i = 0; i < count; i++) {
        if (samples[i].flags & ~view->last.flags & EBPO_HAPTIC_CONTACT)
            view->touch_clock = samples[i].clock;
        view->last = samples[i];
    }
    view->taken += count;
    pthread_mutex_unlock(&view->lock);
}

void haptic_view_end(haptic_view *view)
{
    if (!view)
        return;
    atomic_store(&view->ended, true);
    for (uint64_t end = tool_clock() + END_NS; atomic_load(&view->pages) && tool_clock() < end;)
        tool_wait_until(tool_clock() + TICK_NS);
    (void)!write(view->stop[1], "", 1);
    pthread_join(view->server, NULL);
    close(view->stop[0]);
    close(view->stop[1]);
    site_free(view->site);
    pthread_mutex_destroy(&view->lock);
    pthread_mutex_destroy(&view->pose_lock);
    free(view);
}

/* --- the page as the device --- */

static bool begin_page(void *self, double seconds, haptic_pose *first)
{
    haptic_view *view = self;
    uint64_t end = tool_clock() + (uint64_t)(1e9 * (seconds < 1e9 ? seconds : 1e9));
    for (bool has = false; !has && tool_clock() < end;) {
        tool_wait_until(tool_clock() + TICK_NS);
        pthread_mutex_lock(&view->pose_lock);
        has = view->has_pose;
        *first = view->read = view->pose;
        pthread_mutex_unlock(&view->pose_lock);
        if (has)
            return true;
    }
    fprintf(stderr,
            "ebpo haptic: the page has sent no position in %g seconds; choose its tool "
            "Touch, and move the mouse over the model\n",
            seconds);
    return false;
}

static bool read_page(void *self, uint64_t step, haptic_pose *out)
{
    haptic_view *view = self;
    (void)step;
    if (pthread_mutex_trylock(&view->pose_lock) == 0) {
        view->read = view->pose;
        pthread_mutex_unlock(&view->pose_lock);
    }
    *out = view->read;
    return true;
}

static void end_page(void *self) { (void)self; }

void haptic_view_open_device(haptic_device *out, haptic_view *view)
{
    *out = (haptic_device){ begin_page, read_page, NULL, end_page, view, 0 };
}
