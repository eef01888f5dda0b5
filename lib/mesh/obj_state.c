#include "mesh/obj_state.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>

#include "core/workspace.h"
#include "core/error.h"

enum { RELEASE = 1 << 22 };

ebpo_status ebpo_obj_fail(const obj_reading *r, const char *format, ...)
{
    char text[320];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    return ebpo_fail_file(r->build->error, EBPO_E_FORMAT, r->build->name, "line %" PRIu64 ": %s",
                          r->line, text);
}

bool ebpo_obj_step(obj_reading *r, obj_word *word)
{
    uint64_t at = (uint64_t)(r->text.at - (const char *)r->data);
    if (at >= r->next_release) {
        ebpo_release_pages(r->build->mesh->workspace);
        r->next_release = at + RELEASE;
    }
    bool more = ebpo_obj_next_statement(&r->text, word);
    r->line = r->text.line;
    return more;
}
