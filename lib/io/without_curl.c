/* Replaces http_cache.c, http_source.c and http_transfer.c in a library that is built without
 * libcurl. */
#include "core/error.h"
#include "io/byte_source.h"

ebpo_status ebpo_source_of_url(const char *url, const ebpo_http_options *options, ebpo_source *out,
                               ebpo_error *error)
{
    (void)options;
    *out = (ebpo_source)EBPO_SOURCE_INIT;
    char shown[EBPO_SHOWN_BYTES];
    return ebpo_fail_file(
        error, EBPO_E_UNSUPPORTED, ebpo_url_redact(url, shown, sizeof shown),
        "this library was built without HTTP; install libcurl and build the library again, or "
        "download the file");
}

bool ebpo_source_http_stats(const ebpo_source *source, ebpo_http_stats *out)
{
    (void)source;
    *out = (ebpo_http_stats)EBPO_HTTP_STATS_INIT;
    return false;
}
