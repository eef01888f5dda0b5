#include "base/text_stream.h"

#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"

static ssize_t keep(void *cookie, const char *data, size_t bytes)
{
    ebpo_text_stream *s = cookie;
    if (s->failed || !ebpo_grow(&s->text, &s->capacity, s->bytes + bytes + 1, 1)) {
        s->failed = true;
        return 0; /* which stdio takes for an error */
    }
    memcpy(s->text + s->bytes, data, bytes);
    s->bytes += bytes;
    return (ssize_t)bytes;
}

bool ebpo_text_stream_begin(ebpo_text_stream *s)
{
    memset(s, 0, sizeof *s);
    s->file = fopencookie(s, "w", (cookie_io_functions_t){ .write = keep });
    if (s->file)
        setvbuf(s->file, s->buffer, _IOFBF, sizeof s->buffer);
    return s->file != NULL;
}

bool ebpo_text_stream_end(ebpo_text_stream *s)
{
    bool whole = fclose(s->file) == 0 && !s->failed && ebpo_grow(&s->text, &s->capacity, 1, 1);
    s->file = NULL;
    if (whole) {
        s->text[s->bytes] = 0;
        return true;
    }
    free(s->text);
    s->text = NULL;
    return false;
}
