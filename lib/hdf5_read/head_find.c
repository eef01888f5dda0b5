/* Opening, and finding objects by their paths. */
#include "hdf5_read/head_state.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "io/foreign_bytes.h"

static ebpo_status fail_refused(const ebpo_head *head, const char *path, const char *what,
                                const ebpo_head_refusal *why, ebpo_error *error)
{
    if (why->foreign)
        return ebpo_fail_at(error, EBPO_E_UNSUPPORTED, head->shown, path, -1,
                            "%s, " EBPO_HEAD_FOREIGN, why->what);
    return why->what && *what ? ebpo_fail_at(error, EBPO_E_FORMAT, head->shown, path, -1, "%s: %s",
                                             what, why->what)
                              : ebpo_fail_at(error, EBPO_E_FORMAT, head->shown, path, -1, "%s",
                                             why->what ? why->what : what);
}

ebpo_status ebpo_head_fail(const ebpo_head *head, const char *path, const char *what,
                           ebpo_error *error)
{
    const ebpo_head_state *s = head->state;
    if (s->bytes.status != EBPO_OK)
        return ebpo_fail_with(error, &s->bytes.error);
    return fail_refused(head, path, what, &s->refusal, error);
}

ebpo_status ebpo_head_open(ebpo_head *head, ebpo_input *input, ebpo_error *error)
{
    *head = (ebpo_head){ input->shown, input->source.size, NULL };
    ebpo_head_state *s = head->state = ebpo_alloc_zero(1, sizeof *s);
    if (!s)
        return ebpo_fail_memory(error, sizeof *s);
    ebpo_status status = ebpo_head_bytes_open(&s->bytes, input, error);
    if (status != EBPO_OK || ebpo_head_read_superblock(s))
        return status;
    static const char unknown[] =
        "not a whole HDF5 file; was it cut off in copying, or is it something else?";
    const char *foreign = ebpo_foreign_bytes(s->bytes.first, s->bytes.first_bytes);
    if (foreign && !s->refusal.what && !ebpo_head_has_signature(s))
        return ebpo_fail_at(error, EBPO_E_FORMAT, head->shown, "", 0, "%s", foreign);
    return ebpo_head_fail(head, "", s->refusal.what ? "" : unknown, error);
}

void ebpo_head_expect_index(ebpo_head *head, ebpo_range index) { head->state->bytes.index = index; }

ebpo_status ebpo_head_close(ebpo_head *head, ebpo_status status, ebpo_error *error)
{
    ebpo_head_state *s = head->state;
    if (s && s->bytes.status != EBPO_OK)
        status = ebpo_fail_with(error, &s->bytes.error);
    if (s) {
        ebpo_head_headers_free(s);
        ebpo_head_bytes_close(&s->bytes);
        free(s->kept);
    }
    free(s);
    *head = (ebpo_head)EBPO_HEAD_INIT;
    return status;
}

void ebpo_head_keep_ranges(ebpo_head *head)
{
    head->state->keeps = true;
    for (int i = 0; i < EBPO_HEAD_SLOTS; i++) /* those are read again */
        head->state->slot[i].used = 0;
}

ebpo_status ebpo_head_take_ranges(ebpo_head *head, ebpo_range **ranges, uint64_t *count,
                                  ebpo_error *error)
{
    ebpo_head_state *s = head->state;
    *ranges = s->kept;
    *count = s->kept_count;
    s->kept = NULL;
    s->kept_count = s->kept_capacity = 0;
    return s->kept_short ? ebpo_fail_memory(error, *count * sizeof **ranges) : EBPO_OK;
}

/* Whether a link message has this name; then where it leads, EBPO_NO_ADDRESS for soft and external
 * ones, which are not followed. */
static bool link_is(ebpo_head_cursor c, const char *name, size_t length, uint64_t *address)
{
    enum { HARD = 0 };
    unsigned version = ebpo_cursor_u8(&c), flags = ebpo_cursor_u8(&c);
    unsigned type = flags & 8 ? ebpo_cursor_u8(&c) : HARD;
    ebpo_cursor_take(&c, (flags & 4 ? 8 : 0) + (flags & 16 ? 1 : 0));
    uint64_t bytes = ebpo_cursor_uint(&c, 1u << (flags & 3));
    if (version != 1 || bytes != length)
        return false;
    const uint8_t *text = ebpo_cursor_take(&c, length);
    if (!text || memcmp(text, name, length) != 0)
        return false;
    *address = type == HARD ? ebpo_cursor_u64(&c) : EBPO_NO_ADDRESS;
    if (c.cut)
        *address = EBPO_NO_ADDRESS;
    return true;
}

/* Of a group's links the one of this name: how many there are. */
static unsigned follow(const ebpo_head_header *group, const char *name, size_t length,
                       uint64_t *address)
{
    unsigned found = 0;
    for (uint64_t i = 0; i < group->count; i++)
        if (group->message[i].type == EBPO_M_LINK &&
            link_is(ebpo_head_message_cursor(group, &group->message[i]), name, length, address))
            found++;
    return found;
}

ebpo_head_kind ebpo_head_find(ebpo_head_state *s, const char *path, ebpo_head_object *object)
{
    s->refusal = (ebpo_head_refusal){ NULL, false };
    *object = s->root;
    const ebpo_head_header *h = ebpo_head_header_at(s, s->root);
    while (h && *(path += strspn(path, "/"))) {
        size_t length = strcspn(path, "/");
        if (h->kind != EBPO_HEAD_GROUP)
            return EBPO_HEAD_OTHER;
        unsigned found = follow(h, path, length, object);
        path += length;
        if (found == 0)
            return *path ? EBPO_HEAD_OTHER : EBPO_HEAD_ABSENT;
        if (found > 1)
            ebpo_refuse(s, "the name stands twice in its group");
        if (found > 1 || *object == EBPO_NO_ADDRESS)
            return EBPO_HEAD_OTHER;
        h = ebpo_head_header_at(s, *object);
    }
    return h ? h->kind : EBPO_HEAD_OTHER;
}

ebpo_head_kind ebpo_head_look(ebpo_head *head, const char *path)
{
    ebpo_head_object object;
    return ebpo_head_find(head->state, path, &object);
}

ebpo_status ebpo_head_open_group(ebpo_head *head, const char *path, ebpo_head_object *object,
                                 ebpo_error *error)
{
    if (ebpo_head_find(head->state, path, object) == EBPO_HEAD_GROUP)
        return EBPO_OK;
    return ebpo_head_fail(head, path,
                          head->state->refusal.what ? "the group is damaged"
                                                    : "a group is expected here and there is none",
                          error);
}

ebpo_status ebpo_head_open_array(ebpo_head *head, const char *path, ebpo_head_object *object,
                                 ebpo_error *error)
{
    return ebpo_head_find(head->state, path, object) == EBPO_HEAD_ARRAY
               ? EBPO_OK
               : ebpo_head_fail(head, path, "the array is damaged", error);
}
