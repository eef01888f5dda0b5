/* SPDX-License-Identifier: MIT
 * Any bytes as the heads of a server's answers: what is taken as a part or as the whole file is
 * what was asked for, and what is not says why.
 *
 * Input: a byte of flags, two of the place that is asked for, then lines. */
#include "fuzz_kit.h"

#include <ebpo/http.h>

#include "io/http_answer.h"

static const ebpo_http_version version = { 100000, "\"tag\"", "Mon, 23 Nov 2026 09:00:00 GMT" };

static void judge(const ebpo_answer *answer, const ebpo_asked *asked)
{
    char why[EBPO_WHY_BYTES] = "";
    ebpo_status status = EBPO_OK;
    ebpo_verdict verdict = ebpo_answer_judge(answer, asked, &status, why);
    fuzz_must(memchr(why, 0, sizeof why) != NULL);
    switch (verdict) {
    case EBPO_ANSWER_PART:
        fuzz_must(answer->code == 206 && answer->has_range && answer->begin == asked->begin &&
                  answer->last >= answer->begin && answer->last < asked->end &&
                  answer->last < answer->total);
        fuzz_must(!asked->pinned || answer->total == asked->pinned->size);
        fuzz_must(!asked->pinned || strcmp(answer->etag, asked->pinned->etag) == 0);
        break;
    case EBPO_ANSWER_WHOLE: fuzz_must(answer->code == 200 && !asked->pinned); break;
    case EBPO_ANSWER_LATER: fuzz_must(*why); break;
    case EBPO_ANSWER_REFUSED: fuzz_must(*why && status != EBPO_OK); break;
    }
}

static void redact(const uint8_t *data, size_t size)
{
    char *name = fuzz_text(data, size);
    for (size_t room = 0; room < 40; room += 13) {
        char *out = fuzz_room(room + 1);
        out[room] = 'x';
        (void)ebpo_url_redact(name, out, room);
        fuzz_must(out[room] == 'x' && (room == 0 || memchr(out, 0, room)));
        free(out);
    }
    (void)ebpo_is_url(name);
    free(name);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size < 3)
        return 0;
    ebpo_asked asked = { .begin = data[1] | (uint64_t)data[2] << 8, .whole_limit = 65536 };
    asked.end = asked.begin + 1 + (data[0] >> 1) * UINT64_C(100);
    asked.pinned = data[0] & 1 ? &version : NULL;
    ebpo_answer answer = { .code = 0 };
    const uint8_t *at = data + 3, *end = data + size;
    while (at < end) {
        const uint8_t *next = memchr(at, '\n', (size_t)(end - at));
        next = next ? next + 1 : end;
        char *line = fuzz_copy(at, (size_t)(next - at));
        ebpo_answer_line(&answer, line, (size_t)(next - at));
        free(line);
        at = next;
    }
    fuzz_must(memchr(answer.etag, 0, sizeof answer.etag) &&
              memchr(answer.modified, 0, sizeof answer.modified));
    judge(&answer, &asked);
    redact(data + 3, size - 3);
    return 0;
}
