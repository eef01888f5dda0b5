/* The superblock: what every file begins with. */
#include <string.h>

#include "hdf5_read/head_state.h"

static const char signature[8] = "\211HDF\r\n\032\n";

/* HDF5 allows what is not its own before the superblock, at these places. */
static bool has_user_block(ebpo_head_state *s)
{
    for (uint64_t at = 512; at <= s->bytes.first_bytes; at *= 2) {
        const uint8_t *there = ebpo_head_bytes_at(&s->bytes, at, sizeof signature);
        if (there && memcmp(there, signature, sizeof signature) == 0)
            return true;
    }
    return false;
}

bool ebpo_head_has_signature(ebpo_head_state *s)
{
    const uint8_t *first = ebpo_head_bytes_at(&s->bytes, 0, sizeof signature);
    return first && memcmp(first, signature, sizeof signature) == 0;
}

bool ebpo_head_read_superblock(ebpo_head_state *s)
{
    enum { BYTES = EBPO_HEAD_SUPERBLOCK_BYTES, OPEN_FOR_WRITING = 1 };
    const uint8_t *block = ebpo_head_bytes_at(&s->bytes, 0, BYTES);
    s->refusal = (ebpo_head_refusal){ NULL, false };
    if (!block)
        return false;
    if (!ebpo_head_has_signature(s))
        return has_user_block(s) ? ebpo_refuse(s, "the HDF5 file begins behind something else (a "
                                                  "user block), which this format does not allow")
                                 : false;
    ebpo_head_cursor c = { block + sizeof signature, block + BYTES, false };
    unsigned version = ebpo_cursor_u8(&c);
    if (version < 2)
        return ebpo_refuse_foreign(s, version ? "the HDF5 file has a superblock of version 1"
                                              : "the HDF5 file has a superblock of version 0");
    if (version > 3)
        return ebpo_refuse_foreign(s, "the HDF5 file has a superblock of a later version");
    bool sound = ebpo_head_sound(block, BYTES);
    unsigned sizes = ebpo_cursor_u16(&c), flags = ebpo_cursor_u8(&c);
    uint64_t base = ebpo_cursor_u64(&c), extension = ebpo_cursor_u64(&c), end = ebpo_cursor_u64(&c);
    s->root = ebpo_cursor_u64(&c);
    if (!sound || end == EBPO_NO_ADDRESS || end > s->bytes.input->source.size)
        return false;
    if (version == 3 && flags & OPEN_FOR_WRITING)
        return ebpo_refuse(s, "the HDF5 file was not finished by the program that wrote it");
    if (sizes != 0x0808 || base != 0)
        return ebpo_refuse_foreign(s, "the HDF5 file has addresses of another size or origin");
    if (extension != EBPO_NO_ADDRESS)
        return ebpo_refuse_foreign(s, "the HDF5 file's superblock has an extension");
    return true;
}
