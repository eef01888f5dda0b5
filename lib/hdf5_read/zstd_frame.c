/* Source: RFC 8878, 3.1.1. */
#include "hdf5_read/zstd_frame.h"

#include <zstd.h>

#include "core/endian.h"

enum { RAW, RLE, COMPRESSED, RESERVED };
enum { DESCRIPTOR = 4 };
static const char unused_set[] = "an unused bit of the zstd frame is set";

/* How many bytes the literals of a compressed block take, with their header; 0: it is cut short. */
static size_t literals_bytes(const uint8_t *block, size_t size)
{
    unsigned kind = block[0] & 3, format = block[0] >> 2 & 3;
    if (kind < COMPRESSED) {
        size_t header = format == 1 ? 2 : format == 3 ? 3 : 1;
        if (size < header)
            return 0;
        size_t count = header == 1   ? block[0] >> 3
                       : header == 2 ? (block[0] | block[1] << 8) >> 4
                                     : (block[0] | block[1] << 8 | block[2] << 16) >> 4;
        return header + (kind == RLE ? 1 : count);
    }
    size_t header = format < 2 ? 3 : format + 2;
    unsigned width = format < 2 ? 10 : format == 2 ? 14 : 18;
    uint64_t bits = 0;
    if (size < header)
        return 0;
    for (size_t i = 0; i < header; i++)
        bits |= (uint64_t)block[i] << 8 * i;
    return header + (size_t)(bits >> (4 + width) & ((1u << width) - 1));
}

static bool block_has_unused(const uint8_t *block, size_t size)
{
    size_t at = size ? literals_bytes(block, size) : 0;
    if (at == 0 || at >= size || block[at] == 0) /* 0: no sequences, and no modes */
        return false;
    at += block[at] < 128 ? 1 : block[at] < 255 ? 2 : 3;
    return at < size && block[at] & 3;
}

static const char *block_fault(unsigned kind, const uint8_t *block, size_t stated)
{
    if (kind == RLE && stated == 1)
        return "a block of the zstd frame repeats its byte once";
    return kind == COMPRESSED && block_has_unused(block, stated) ? unused_set : NULL;
}

const char *ebpo_zstd_fault(const uint8_t *frame, size_t bytes)
{
    static const uint8_t id_bytes[4] = { 0, 1, 2, 4 };
    enum { UNUSED = 1 << 4, BLOCK_HEADER = 3 };
    const char *fault = NULL;
    if (bytes <= DESCRIPTOR)
        return NULL;
    unsigned d = frame[DESCRIPTOR], single = d >> 5 & 1, size_code = d >> 6;
    size_t at =
        DESCRIPTOR + 1 + !single + id_bytes[d & 3] + (size_code ? (size_t)1 << size_code : single);
    if (d & UNUSED)
        return unused_set;
    for (bool last = false; !last && !fault && at + BLOCK_HEADER <= bytes;) {
        uint32_t header = (uint32_t)(frame[at] | frame[at + 1] << 8 | frame[at + 2] << 16);
        unsigned kind = header >> 1 & 3;
        size_t size = kind == RLE ? 1 : header >> 3;
        at += BLOCK_HEADER;
        last = header & 1;
        if (kind == RESERVED || size > bytes - at)
            return NULL;
        fault = block_fault(kind, frame + at, header >> 3);
        at += size;
    }
    return fault;
}

bool ebpo_zstd_has_checksum(const uint8_t *frame, size_t bytes)
{
    enum { CONTENT_CHECKSUM = 1 << 2 };
    return bytes > DESCRIPTOR && ebpo_load32(frame) == ZSTD_MAGICNUMBER &&
           frame[DESCRIPTOR] & CONTENT_CHECKSUM;
}
