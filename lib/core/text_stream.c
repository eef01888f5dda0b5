#include "core/text_stream.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"

#ifdef EBPO_HAVE_FOPENCOOKIE
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
#else
bool ebpo_text_stream_begin(ebpo_text_stream *s)
{
    memset(s, 0, sizeof *s);
    s->file = open_memstream(&s->text, &s->size);
    return s->file != NULL;
}
#endif

bool ebpo_text_stream_end(ebpo_text_stream *s)
{
    s->failed = s->failed || ferror(s->file);
    bool whole = fclose(s->file) == 0 && !s->failed;
    s->file = NULL;
#ifdef EBPO_HAVE_FOPENCOOKIE
    whole = whole && ebpo_grow(&s->text, &s->capacity, 1, 1);
#else
    whole = whole && s->text;
    s->bytes = s->size;
#endif
    if (whole) {
        s->text[s->bytes] = 0;
        return true;
    }
    free(s->text);
    s->text = NULL;
    return false;
}
