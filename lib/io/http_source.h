/* What the layers above need of sources by URL: ebpo/http.h, and the figures of such a source. */
#ifndef EBPO_IO_HTTP_SOURCE_H
#define EBPO_IO_HTTP_SOURCE_H

#include <ebpo/http.h>

enum { EBPO_SHOWN_BYTES = 300 }; /* room for a URL in a message */

/* False when the source is not one of ebpo_source_of_url. */
bool ebpo_source_http_stats(const ebpo_source *source, ebpo_http_stats *out);

#endif
