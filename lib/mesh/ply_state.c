/* What the parts of the PLY reader say: what is wrong and where, and how far they are. */
#include "mesh/ply_state.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>

#include "core/workspace.h"
#include "core/error.h"

enum { REPORT_BYTES = 1 << 22 };

ebpo_status ebpo_ply_fail(const ply_parser *p, const char *format, ...)
{
    char text[320];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    if (p->header.encoding == PLY_ASCII)
        return ebpo_fail_file(p->error, EBPO_E_FORMAT, p->name, "line %" PRIu64 ": %s", p->line,
                              text);
    return ebpo_fail_at(p->error, EBPO_E_FORMAT, p->name, "", (int64_t)p->at,
                        "byte %" PRIu64 ": %s", p->at, text);
}

ebpo_status ebpo_ply_notes(ply_parser *p)
{
    ebpo_mesh *mesh = p->mesh;
    if (!mesh->attributes && !(mesh->attributes = ebpo_attributes_make(mesh->workspace)))
        return ebpo_fail_memory(p->error, sizeof *mesh->attributes);
    return EBPO_OK;
}

const char *ebpo_ply_row_name(const ply_element *element)
{
    static const char *const names[] = { "element", "vertex", "face", "strip" };
    return names[element->kind];
}

ebpo_status ebpo_ply_fail_end(const ply_parser *p, const ply_element *element, uint64_t row)
{
    char name[PLY_WORD_TEXT];
    ebpo_ply_word_text(name, element->name);
    return ebpo_ply_fail(p,
                         "the file ends after %" PRIu64 " bytes within row %" PRIu64
                         " of the %" PRIu64 " of element '%s'; it is cut short, get it again",
                         p->size, row, element->count, name);
}

ebpo_status ebpo_ply_fail_stopped(const ply_parser *p)
{
    return ebpo_fail(p->error, EBPO_E_CANCELLED, "stopped on request while reading %s", p->name);
}

ebpo_status ebpo_ply_report(ply_parser *p)
{
    p->next_report = p->at + REPORT_BYTES;
    ebpo_release_pages(p->mesh->workspace);
    if (!p->progress || !p->progress->report ||
        p->progress->report(p->progress->user, "reading", p->at, p->size))
        return EBPO_OK;
    return ebpo_ply_fail_stopped(p);
}
