#include "io/redirect.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>

void ebpo_redirect_clear(ebpo_redirect *r)
{
    curl_url_cleanup(r->at);
    free(r->target);
    *r = (ebpo_redirect){ .at = NULL };
}

static bool same_part(CURLU *a, CURLU *b, CURLUPart part)
{
    char *x = NULL, *y = NULL;
    bool same = curl_url_get(a, part, &x, CURLU_DEFAULT_PORT) == CURLUE_OK &&
                curl_url_get(b, part, &y, CURLU_DEFAULT_PORT) == CURLUE_OK && strcasecmp(x, y) == 0;
    curl_free(x);
    curl_free(y);
    return same;
}

static bool same_server(CURLU *a, CURLU *b)
{
    return same_part(a, b, CURLUPART_SCHEME) && same_part(a, b, CURLUPART_HOST) &&
           same_part(a, b, CURLUPART_PORT);
}

/* False: it is another server, or nobody can tell. */
static bool stays(ebpo_redirect *r, const char *url)
{
    CURLU *first = curl_url();
    if (!r->at) {
        r->at = curl_url();
        if (r->at && curl_url_set(r->at, CURLUPART_URL, url, 0) != CURLUE_OK)
            r->elsewhere = true;
    }
    /* the second is relative to the first, if it is no whole address */
    bool stays = first && r->at && curl_url_set(first, CURLUPART_URL, url, 0) == CURLUE_OK &&
                 curl_url_set(r->at, CURLUPART_URL, r->target, CURLU_URLENCODE) == CURLUE_OK &&
                 same_server(first, r->at);
    curl_url_cleanup(first);
    return stays;
}

static void keep_target(ebpo_redirect *r, const char *from, size_t size)
{
    while (size && (*from == ' ' || *from == '\t')) {
        from++;
        size--;
    }
    while (size && strchr(" \t\r\n", from[size - 1]))
        size--;
    free(r->target);
    r->target = strndup(from, size);
    r->elsewhere = r->elsewhere || !r->target;
}

bool ebpo_redirect_line(ebpo_redirect *r, const char *url, int code, const char *line, size_t size)
{
    static const char name[] = "location:";
    bool ends = size <= 2 && (size == 0 || line[0] == '\r' || line[0] == '\n'),
         before = r->elsewhere;
    if (size >= sizeof name && strncasecmp(line, name, sizeof name - 1) == 0)
        keep_target(r, line + sizeof name - 1, size - (sizeof name - 1));
    if (!ends || !r->target)
        return r->elsewhere && !before;
    if (code / 100 == 3 && !stays(r, url))
        r->elsewhere = true;
    free(r->target);
    r->target = NULL;
    return r->elsewhere && !before;
}
