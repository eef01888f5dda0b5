/* Opens the head of an untrusted file, and finds objects by their paths. The head is the superblock
 * and the headers of all objects, at the start of the file. Objects are found by the names of
 * links, from the root group on. HDF5 features that this format does not allow are rejected with a
 * specific message. Source: HDF5 File Format Specification 3.0, sections II.A and IV.A.2.g;
 * format-spec/hdf5-messages.md. */
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "hdf5_read/head_parts.h"
#include "io/file_source.h"

/* --- the superblock, at the beginning of every file --- */

static const char signature[8] = "\211HDF\r\n\032\n";

/* Returns true if other data precede the superblock, which HDF5 allows. The superblock is then at
 * offset 512, 1024, 2048, and so on. */
static bool has_user_block(ebpo_head_state *s)
{
    for (uint64_t at = 512; at <= s->bytes.first_bytes; at *= 2) {
        const uint8_t *block = ebpo_head_bytes_at(&s->bytes, at, sizeof signature);
        if (block && memcmp(block, signature, sizeof signature) == 0)
            return true;
    }
    return false;
}

/* Returns true if the file begins with HDF5's signature. */
static bool has_signature(ebpo_head_state *s)
{
    const uint8_t *first = ebpo_head_bytes_at(&s->bytes, 0, sizeof signature);
    return first && memcmp(first, signature, sizeof signature) == 0;
}

/* Reads the superblock, which locates the root group and states the end of the file. Returns false
 * if the superblock is refused; then s->refusal has the reason. Also returns false if the
 * superblock is damaged or the file is not HDF5; then s->refusal has no reason. */
static bool read_superblock(ebpo_head *head)
{
    enum { BYTES = EBPO_HEAD_SUPERBLOCK_BYTES, OPEN_FOR_WRITING = 1 };
    ebpo_head_state *s = head->state;
    const uint8_t *block = ebpo_head_bytes_at(&s->bytes, 0, BYTES);
    s->refusal = (ebpo_head_refusal){ NULL, false };
    if (!block)
        return false;
    if (!has_signature(s))
        return has_user_block(s) ? ebpo_refuse(s, "the HDF5 file begins with other data (a user "
                                                  "block), which this format does not allow")
                                 : false;
    ebpo_head_cursor c = { block + sizeof signature, block + BYTES, false };
    unsigned version = ebpo_cursor_u8(&c);
    if (version < 2)
        return ebpo_refuse_foreign(s, version ? "the HDF5 file has a superblock of version 1"
                                              : "the HDF5 file has a superblock of version 0");
    if (version > 3)
        return ebpo_refuse_foreign(s, "the HDF5 file has a superblock of a later version");
    bool checksum_ok = ebpo_head_sound(block, BYTES);
    unsigned sizes = ebpo_cursor_u16(&c), flags = ebpo_cursor_u8(&c);
    uint64_t base = ebpo_cursor_u64(&c), extension = ebpo_cursor_u64(&c), end = ebpo_cursor_u64(&c);
    s->root = ebpo_cursor_u64(&c);
    head->end = end;
    if (!checksum_ok || end == EBPO_NO_ADDRESS || end > s->bytes.input->source.size)
        return false;
    if (version == 3 && flags & OPEN_FOR_WRITING)
        return ebpo_refuse(s, "the HDF5 file was not finished by the program that wrote it");
    if (sizes != 0x0808 || base != 0)
        return ebpo_refuse_foreign(s, "the HDF5 file has addresses of another size or origin");
    if (extension != EBPO_NO_ADDRESS)
        return ebpo_refuse_foreign(s, "the HDF5 file's superblock has an extension");
    return true;
}

/* --- opening, and finding objects by their paths --- */

ebpo_status ebpo_head_open(ebpo_head *head, ebpo_input *input, ebpo_error *error)
{
    *head = (ebpo_head){ input->shown, 0, NULL };
    ebpo_head_state *s = head->state = ebpo_alloc_zero(1, sizeof *s);
    if (!s)
        return ebpo_fail_memory(error, sizeof *s);
    ebpo_status status = ebpo_head_bytes_open(&s->bytes, input, error);
    if (status != EBPO_OK || read_superblock(head))
        return status;
    static const char unknown[] = "not a whole HDF5 file; check whether the file was truncated by "
                                  "copying, or is another kind "
                                  "of file";
    /* text of a message if the file is of another known kind, such as a compressed file; else NULL
     */
    const char *other_kind = ebpo_wrong_kind_of_file(s->bytes.first, s->bytes.first_bytes);
    if (other_kind && !s->refusal.what && !has_signature(s))
        return ebpo_fail_at(error, EBPO_E_FORMAT, head->shown, "", 0, "%s", other_kind);
    return ebpo_head_fail(head, "", s->refusal.what ? "" : unknown, error);
}

void ebpo_head_hint_index(ebpo_head *head, ebpo_range index) { head->state->bytes.index = index; }

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
    /* empties all slots, so that headers are read again and their ranges are recorded */
    for (int i = 0; i < EBPO_HEAD_SLOTS; i++)
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
    return s->kept_no_memory ? ebpo_fail_memory(error, *count * sizeof **ranges) : EBPO_OK;
}

/* Returns true if a link message has this name. Sets *address to the link's target, or to
 * EBPO_NO_ADDRESS for soft and external links, which are not followed. */
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

/* Finds the links with this name in a group. Returns their number, and the target of the last link
 * in *address. */
static unsigned follow_name(const ebpo_head_header *group, const char *name, size_t length,
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
        unsigned found = follow_name(h, path, length, object);
        path += length;
        if (found == 0) /* returns ABSENT only if the last name of the path is missing */
            return *path ? EBPO_HEAD_OTHER : EBPO_HEAD_ABSENT;
        if (found > 1)
            ebpo_refuse(s, "the name occurs twice in its group");
        if (found > 1 || *object == EBPO_NO_ADDRESS)
            return EBPO_HEAD_OTHER;
        h = ebpo_head_header_at(s, *object);
    }
    return h ? h->kind : EBPO_HEAD_OTHER;
}

ebpo_head_kind ebpo_head_find_kind(ebpo_head *head, const char *path)
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
                                                    : "the group is missing; get a fresh copy of "
                                                      "the file",
                          error);
}

ebpo_status ebpo_head_open_array(ebpo_head *head, const char *path, ebpo_head_object *object,
                                 ebpo_error *error)
{
    return ebpo_head_find(head->state, path, object) == EBPO_HEAD_ARRAY
               ? EBPO_OK
               : ebpo_head_fail(head, path, "the array is damaged", error);
}
