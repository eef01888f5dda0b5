/* SPDX-License-Identifier: MIT
 * Any bytes as response headers of a server, and as a body with several ranges: an accepted part or
 * whole file is the requested one, and others have a reason.
 *
 * Input: a byte of flags, two for the requested offset, then lines; the body begins after the first
 * empty line. */
#include "fuzz_support.h"

#include <ebpo/http.h>

#include "io/http_response.h"

static const ebpo_http_version version = { 100000, "\"tag\"", "Mon, 23 Nov 2026 09:00:00 GMT" };

static ebpo_verdict judge(const ebpo_http_response *result, const ebpo_http_request *request)
{
    char why[EBPO_WHY_BYTES] = "";
    ebpo_status status = EBPO_OK;
    ebpo_verdict verdict = ebpo_http_response_judge(result, request, &status, why);
    fuzz_must(memchr(why, 0, sizeof why) != NULL);
    switch (verdict) {
    case EBPO_HTTP_PART:
        fuzz_must(result->code == 206 && result->has_range && result->begin == request->begin &&
                  result->last >= result->begin && result->last < request->end &&
                  result->last < result->total);
        fuzz_must(!request->pinned || result->total == request->pinned->size);
        fuzz_must(!request->pinned || strcmp(result->etag, request->pinned->etag) == 0);
        break;
    case EBPO_HTTP_WHOLE: fuzz_must(result->code == 200 && !request->pinned); break;
    case EBPO_HTTP_LATER: fuzz_must(*why); break;
    case EBPO_HTTP_REFUSED: fuzz_must(*why && status != EBPO_OK); break;
    case EBPO_HTTP_PARTS:
        fuzz_must(request->several && result->code == 206 && *result->boundary);
        break;
    case EBPO_HTTP_SINGLY: fuzz_must(request->several); break;
    }
    return verdict;
}

/* Reads a body with several ranges; each part must be the requested range. */
static void read_parts(const ebpo_http_response *whole, const ebpo_http_request *request,
                       const uint8_t *at, const uint8_t *end)
{
    ebpo_part_head head = { .in_head = false };
    while (at < end) {
        bool complete;
        char *bytes = fuzz_copy(at, (size_t)(end - at));
        size_t step = ebpo_part_head_take(&head, whole, bytes, (size_t)(end - at), &complete);
        free(bytes);
        fuzz_must(step <= (size_t)(end - at) && head.length < sizeof head.line + 1);
        if (step == 0 || (complete && judge(&head.response, request) != EBPO_HTTP_PART))
            return;
        at += step;
        uint64_t size = complete ? head.response.last - head.response.begin + 1 : 0;
        at += size < (uint64_t)(end - at) ? size : (uint64_t)(end - at);
    }
}

static void redact(const uint8_t *data, size_t size)
{
    char *name = fuzz_text(data, size);
    for (size_t space = 0; space < 40; space += 13) {
        char *out = fuzz_capacity(space + 1);
        out[space] = 'x';
        (void)ebpo_url_redact(name, out, space);
        fuzz_must(out[space] == 'x' && (space == 0 || memchr(out, 0, space)));
        free(out);
    }
    (void)ebpo_is_url(name);
    free(name);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size < 3)
        return 0;
    ebpo_http_request request = { .begin = data[1] | (uint64_t)data[2] << 8, .whole_limit = 65536 };
    request.end = request.begin + 1 + (data[0] >> 1) * UINT64_C(100);
    request.pinned = data[0] & 1 ? &version : NULL;
    ebpo_http_response result = { .code = 0 };
    const uint8_t *at = data + 3, *end = data + size, *body = NULL;
    while (at < end) {
        const uint8_t *next = memchr(at, '\n', (size_t)(end - at));
        next = next ? next + 1 : end;
        char *line = fuzz_copy(at, (size_t)(next - at));
        ebpo_http_response_line(&result, line, (size_t)(next - at));
        free(line);
        if (!body && (*at == '\n' || (*at == '\r' && next == at + 2)))
            body = next;
        at = next;
    }
    fuzz_must(memchr(result.etag, 0, sizeof result.etag) &&
              memchr(result.modified, 0, sizeof result.modified));
    judge(&result, &request);
    request.several = true;
    ebpo_verdict verdict = judge(&result, &request);
    request.several = false;
    if (verdict == EBPO_HTTP_PARTS && body)
        read_parts(&result, &request, body, end);
    redact(data + 3, size - 3);
    return 0;
}
