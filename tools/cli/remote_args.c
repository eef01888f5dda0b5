#include "cli/remote_args.h"

#include <inttypes.h>
#include <stdio.h>

#include "cli/words.h"

static bool options_from(const remote_values *v, ebpo_http_options *o, ebpo_error *error)
{
    *o = (ebpo_http_options)EBPO_HTTP_OPTIONS_INIT;
    o->cache_folder = v->cache;
    o->cache_block = v->cache_block;
    if (v->cache_size && !words_read_size(v->cache_size, &o->cache_bytes)) {
        error->status = EBPO_E_ARGUMENT;
        snprintf(error->message, sizeof error->message,
                 "--http-cache-size: '%s' is not " WORDS_SIZE_EXPECTED, v->cache_size);
        return false;
    }
    o->time_limit = v->timeout > 0 ? v->timeout : o->time_limit;
    o->stall_timeout = v->stall > 0 ? v->stall : o->stall_timeout;
    o->retries = v->retries >= 0 ? (unsigned)v->retries : o->retries;
    o->connections = v->connections > 0 ? (unsigned)v->connections : o->connections;
    o->headers = v->headers.count ? v->headers.item : NULL;
    o->user = v->user;
    o->ca_file = v->ca_file;
    o->unversioned = v->unversioned;
    o->stop = v->stop;
    o->stop_user = v->stop_user;
    return true;
}

ebpo_status remote_open_own(const char *path, ebpo_file **out, ebpo_error *error)
{
    ebpo_open_options any = EBPO_OPEN_OPTIONS_INIT;
    any.max_expansion = UINT64_MAX;
    return ebpo_open_with(path, &any, out, error);
}

/* Verifies all of a file that another program has rewritten, so that no result is computed from
 * damaged data. Such a file has no checksums of chunks, and the checksum of the content does not
 * cover HDF5 attributes such as the root box. */
static ebpo_status verify_all(const ebpo_file *file, const char *name, ebpo_error *error)
{
    ebpo_verify_report r = EBPO_VERIFY_REPORT_INIT;
    ebpo_status status = ebpo_verify(file, NULL, &r, error);
    const ebpo_verify_count *counts[] = { &r.structure, &r.content, &r.containment,
                                          &r.nesting,   &r.labels,  &r.lists };
    for (size_t i = 0; i < sizeof counts / sizeof counts[0] && status == EBPO_OK; i++)
        if (counts[i]->violations) {
            status = error->status = EBPO_E_FORMAT;
            snprintf(error->message, sizeof error->message,
                     "%s: is damaged, and has no checksums that locate the damage: %s; get a "
                     "fresh copy of the file",
                     remote_shown(name), counts[i]->first);
        }
    return status;
}

static ebpo_status open_foreign(const char *name, const ebpo_open_options *open, ebpo_file **out,
                                ebpo_error *error)
{
    ebpo_compat_options compat = EBPO_COMPAT_OPTIONS_INIT;
    compat.http = open->http;
    compat.max_expansion = open->max_expansion;
    ebpo_status status = ebpo_open_compat(name, &compat, out, error);
    if (status == EBPO_OK)
        status = verify_all(*out, name, error);
    if (status != EBPO_OK) {
        ebpo_close(*out);
        *out = NULL;
    }
    return status;
}

ebpo_status remote_open(ebpo_file **out, const char *name, const remote_values *values,
                        ebpo_error *error)
{
    ebpo_http_options options;
    *out = NULL;
    if (!options_from(values, &options, error))
        return EBPO_E_ARGUMENT;
    ebpo_open_options open = EBPO_OPEN_OPTIONS_INIT;
    open.http = &options;
    open.max_expansion = (uint64_t)values->max_expansion;
    ebpo_status status = ebpo_open_with(name, &open, out, error);
    return status == EBPO_E_UNSUPPORTED && values->compat ? open_foreign(name, &open, out, error)
                                                          : status;
}

const char *remote_shown(const char *name)
{
    static char shown[1024];
    return ebpo_is_url(name) ? ebpo_url_redact(name, shown, sizeof shown) : name;
}

traffic traffic_of(const ebpo_file *file)
{
    traffic t = { .http = EBPO_HTTP_STATS_INIT };
    ebpo_file_stats stats = EBPO_FILE_STATS_INIT;
    ebpo_file_get_stats(file, &stats);
    t.bytes = stats.bytes_read;
    t.reads = stats.reads;
    t.remote = ebpo_file_get_http_stats(file, &t.http) == EBPO_OK;
    return t;
}

void remote_json(json *j, const traffic *t, const remote_values *values)
{
    if (!values->stats)
        return;
    json_object(j, "traffic");
    json_uint(j, "reads", t->reads);
    json_uint(j, "bytes_read", t->bytes);
    if (t->remote) {
        json_uint(j, "requests", t->http.requests);
        json_uint(j, "bytes", t->http.bytes);
        json_uint(j, "retries", t->http.retries);
        json_uint(j, "connections", t->http.connections);
        json_real(j, "seconds_waited", t->http.wait_seconds);
        json_uint(j, "cache_hits", t->http.cache_hits);
        json_uint(j, "cache_bytes", t->http.cache_bytes);
    }
    json_end(j);
}

void remote_report(const traffic *t, const remote_values *values, bool as_json)
{
    if (values->stats && as_json) {
        json j;
        json_begin(&j, stderr);
        json_object(&j, NULL);
        remote_json(&j, t, values);
        json_finish(&j);
    } else if (values->stats) {
        fprintf(stderr, "reads %" PRIu64 ", bytes read %" PRIu64, t->reads, t->bytes);
        if (t->remote)
            fprintf(stderr,
                    ", requests %" PRIu64 ", bytes %" PRIu64 ", retries %" PRIu64
                    ", connections %" PRIu64 ", seconds waited %.6f, cache hits %" PRIu64
                    ", cache bytes %" PRIu64,
                    t->http.requests, t->http.bytes, t->http.retries, t->http.connections,
                    t->http.wait_seconds, t->http.cache_hits, t->http.cache_bytes);
        fputc('\n', stderr);
    }
}
