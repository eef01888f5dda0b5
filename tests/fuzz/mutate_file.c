/* SPDX-License-Identifier: MIT
 * The mutator of targets whose input is a whole file: changes numbers in the chunk of an array, and
 * encodes it again; or reads the tree, changes it and writes it again, perhaps in another layout.
 * This reaches the code behind the checks, which random bytes would not. */
#include "fuzz_support.h"
#include "mutate.h"

#include <ebpo/file.h>
#include <stdio.h>
#include <unistd.h>

#include "core/endian.h"
#include "core/checksum.h"
#include "hdf5_read/chunk.h"
#include "format/file_in.h"
#include "read_by.h"

size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t most, unsigned seed);
size_t LLVMFuzzerMutate(uint8_t *data, size_t size, size_t most);

static ebpo_file *open_bytes(const uint8_t *data, size_t size)
{
    ebpo_file *file = NULL;
    if (ebpo_open_memory(data, size, "mutated", &file, NULL) != EBPO_OK)
        return NULL;
    if (ebpo_file_locate(file, NULL, NULL) == EBPO_OK)
        return file;
    ebpo_close(file);
    return NULL;
}

/* --- numbers of a chunk --- */

static const ebpo_array_in *some_array(const ebpo_file *file, uint64_t *state)
{
    for (int tries = 0; tries < 40; tries++) {
        const ebpo_array_in *a = NULL;
        unsigned which = fuzz_below(state, 8);
        if (which < 5)
            a = &file->level_array[fuzz_below(state, (uint32_t)file->info.level_count)]
                                  [fuzz_below(state, EBPO_LEVEL_ARRAYS)];
        else if (which < 7)
            a = &file->root_array[fuzz_below(state, EBPO_ARRAYS)];
        else if (file->attributes.arrays > 0)
            a = &file->attributes.array[fuzz_below(state, (uint32_t)file->attributes.arrays)];
        if (a && a->present && a->chunks)
            return a;
    }
    return NULL;
}

static void change_number(uint8_t *raw, size_t count, size_t width, uint64_t *state)
{
    uint64_t value = 0, other = 0;
    uint8_t *at = raw + fuzz_below(state, (uint32_t)count) * width;
    memcpy(&value, at, width);
    memcpy(&other, raw + fuzz_below(state, (uint32_t)count) * width, width);
    switch (fuzz_below(state, 8)) {
    case 0: value++; break;
    case 1: value--; break;
    case 2: value = other; break;
    case 3: value = 0; break;
    case 4: value = ~UINT64_C(0) >> fuzz_below(state, 64); break;
    case 5: value ^= UINT64_C(1) << fuzz_below(state, (uint32_t)(8 * width)); break;
    case 6: value += other; break;
    default: value = fuzz_next(state); break;
    }
    memcpy(at, &value, width);
}

/* Puts a chunk whose size has changed behind the end of the file. The entry of its index is found
 * by the address: before it are the size and a filter mask (an array of one chunk), or the size is
 * after it. The checksums of headers are wrong then: for builds that compare none. Returns 0 when
 * it did not fit, or the entry was not found. */
static size_t put_elsewhere(uint8_t *data, size_t size, size_t most, ebpo_chunk_location old,
                            const uint8_t *chunk, size_t stored)
{
    enum { END_OF_FILE = 28, ONE_BEFORE = 12 };
    if (EBPO_CHECKSUMS_COMPARED || most < size || most - size < stored || stored > UINT16_MAX)
        return 0;
    for (size_t i = END_OF_FILE + 8; i + 10 <= size; i++) {
        if (ebpo_load64(data + i) != old.address)
            continue;
        if (ebpo_load64(data + i - ONE_BEFORE) == old.bytes)
            ebpo_store64(data + i - ONE_BEFORE, stored);
        else if (old.bytes <= UINT16_MAX && ebpo_load16(data + i + 8) == old.bytes)
            ebpo_store16(data + i + 8, (uint16_t)stored);
        else
            continue;
        ebpo_store64(data + i, size);
        ebpo_store64(data + END_OF_FILE, size + stored);
        memcpy(data + size, chunk, stored);
        return size + stored;
    }
    return 0;
}

/* Returns the decoded size of a chunk; the last one is as long as the others. */
static size_t plain_bytes(const ebpo_array_in *a, ebpo_chunk_location place)
{
    if (a->shape.pipeline == EBPO_PIPELINE_CHECKSUM)
        return place.bytes > 4 ? place.bytes - 4 : 0;
    return a->shape.pipeline > EBPO_PIPELINE_CHECKSUM
               ? place.bytes
               : a->shape.chunk_rows * ebpo_shape_row_bytes(&a->shape);
}

/* Decodes a chunk, changes some numbers, and encodes it again. Returns the new size of the file; 0:
 * unchanged. */
static size_t change_numbers(uint8_t *data, size_t size, size_t most, const ebpo_array_in *a,
                             uint64_t *state)
{
    static ebpo_chunk_coder coder;
    static uint8_t raw[EBPO_CHUNK_BYTES_MAX], again[2 * EBPO_CHUNK_BYTES_MAX];
    const char *why;
    size_t stored;
    ebpo_chunk_location place =
        a->chunks[fuzz_below(state, (uint32_t)ebpo_shape_chunks(&a->shape))];
    size_t width = a->shape.element_size, plain = plain_bytes(a, place);
    if (plain > sizeof raw || plain < width || plain % width ||
        ebpo_chunk_decode(&coder, a->shape.pipeline, width, data + place.address, place.bytes, raw,
                          plain, &why) != EBPO_OK)
        return 0;
    for (uint32_t times = 1 + fuzz_below(state, 3); times > 0; times--)
        change_number(raw, plain / width, width, state);
    if (ebpo_chunk_encode(&coder, a->shape.pipeline, 0, width, raw, plain, again, &stored) !=
        EBPO_OK)
        return 0;
    if (stored != place.bytes)
        return put_elsewhere(data, size, most, place, again, stored);
    memcpy(data + place.address, again, stored);
    return size;
}

static size_t change_chunk(uint8_t *data, size_t size, size_t most, uint64_t *state)
{
    uint8_t *copy = fuzz_copy(data, size);
    ebpo_file *file = open_bytes(copy, size);
    const ebpo_array_in *a = file ? some_array(file, state) : NULL;
    size_t made = a ? change_numbers(data, size, most, a, state) : 0;
    ebpo_close(file);
    free(copy);
    return made;
}

/* --- a tree --- */

static void change_types(ebpo_level *l, uint64_t *state)
{
    uint16_t *types = &l->types[fuzz_below(state, (uint32_t)l->group_count)];
    uint16_t *other = &l->types[fuzz_below(state, (uint32_t)l->group_count)];
    unsigned a = 2 * fuzz_below(state, 8), b = 2 * fuzz_below(state, 8), x = *types >> a & 3,
             y = *other >> b & 3;
    if (l->group_count == 1 && !(*types >> 2))
        return; /* the root */
    *types = (uint16_t)((*types & ~(3u << a)) | y << a);
    *other = (uint16_t)((*other & ~(3u << b)) | x << b);
}

static void move_count(uint8_t *counts, uint64_t count, uint64_t *state)
{
    uint8_t *a = &counts[fuzz_below(state, (uint32_t)count)],
            *b = &counts[fuzz_below(state, (uint32_t)count)];
    if (a != b && *a > 0 && *b < 255) {
        --*a;
        ++*b;
    }
}

static void change_level(ebpo_level *l, uint64_t *state)
{
    uint32_t leaf = l->leaf_count ? fuzz_below(state, (uint32_t)l->leaf_count) : 0;
    switch (fuzz_below(state, 9)) {
    case 0:
        if (l->group_count)
            change_types(l, state);
        break;
    case 1:
        if (l->planes)
            change_number((uint8_t *)l->planes, (size_t)l->plane_count, 4, state);
        break;
    case 2:
        if (l->plane_counts)
            move_count(l->plane_counts, l->gray_count, state);
        break;
    case 3:
        if (l->leaf_refs)
            change_number((uint8_t *)l->leaf_refs, (size_t)l->ref_count, 4, state);
        break;
    case 4:
        if (l->leaf_winding)
            change_number((uint8_t *)l->leaf_winding, (size_t)l->leaf_count, 4, state);
        break;
    case 5:
        if (l->leaf_ref_count && leaf && l->leaf_ref_count[leaf]) {
            l->leaf_ref_count[leaf]--;
            l->leaf_ref_count[leaf - 1]++;
        }
        break;
    case 6:
        if (l->leaf_new && leaf && l->leaf_new[leaf]) {
            l->leaf_new[leaf]--;
            l->leaf_new[leaf - 1]++;
            l->leaf_first[leaf]++;
        }
        break;
    case 7:
        if (l->leaf_planes)
            change_number((uint8_t *)l->leaf_planes, (size_t)l->leaf_plane_count, 4, state);
        break;
    default:
        if (l->leaf_plane_counts)
            move_count(l->leaf_plane_counts, l->leaf_count, state);
    }
}

static void change_mesh(ebpo_tree *tree, uint64_t *state)
{
    ebpo_mesh *m = &tree->mesh;
    if (m->faces && fuzz_below(state, 2)) {
        uint32_t *f = m->faces + 3 * (size_t)fuzz_below(state, (uint32_t)m->face_count),
                 corner = f[0];
        f[0] = f[1];
        f[1] = fuzz_below(state, 2) ? f[2] : corner;
        f[2] = corner;
    } else if (m->xyz32) {
        change_number((uint8_t *)m->xyz32, (size_t)(3 * m->vertex_count), 4, state);
    } else if (m->xyz64) {
        change_number((uint8_t *)m->xyz64, (size_t)(3 * m->vertex_count), 8, state);
    }
}

static void change_facts(ebpo_info *info, uint64_t *state)
{
    switch (fuzz_below(state, 5)) {
    case 0: info->solid = !info->solid; break;
    case 1: info->rule = (ebpo_rule)fuzz_below(state, 3); break;
    case 2: info->leaf_faces = (uint32_t)fuzz_next(state); break;
    case 3: info->box_origin[fuzz_below(state, 3)] *= 2; break;
    default: info->source_face_count += fuzz_below(state, 3);
    }
}

static size_t slurp(const char *path, uint8_t *data, size_t most)
{
    FILE *f = fopen(path, "rb");
    size_t size = f ? fread(data, 1, most, f) : 0;
    if (f && fgetc(f) != EOF)
        size = 0; /* it is too long */
    if (f)
        fclose(f);
    return size;
}

static size_t write_tree(const ebpo_tree *tree, uint8_t *data, size_t most, uint64_t *state)
{
    char path[64];
    ebpo_write_options options = EBPO_WRITE_OPTIONS_INIT;
    snprintf(path, sizeof path, "/dev/shm/fuzz_%ld.ebpo.h5", (long)getpid());
    options.codec = (ebpo_codec)fuzz_below(state, 3);
    options.threads = 1;
    options.parts = fuzz_below(state, 4) ? ~0u : (uint32_t)fuzz_next(state);
    options.subtree_faces = fuzz_below(state, 2) ? EBPO_NO_SUBTREES : 1 + fuzz_below(state, 9);
    options.face_coding = (ebpo_face_coding)fuzz_below(state, 3);
    ebpo_status status = ebpo_tree_write(tree, path, &options, NULL);
    size_t size = status == EBPO_OK ? slurp(path, data, most) : 0;
    (void)!unlink(path);
    return size;
}

/* Returns 0 when the result is no tree that can be written. */
static size_t change_tree(uint8_t *data, size_t size, size_t most, uint64_t *state)
{
    ebpo_tree tree;
    size_t made = 0;
    if (size == 0)
        return 0;
    uint8_t *copy = fuzz_copy(data, size);
    ebpo_file *file = open_bytes(copy, size);
    if (file && ebpo_file_info(file)->face_count < 100000 &&
        ebpo_file_read_tree(file, READ_BY(1), &tree, NULL) == EBPO_OK) {
        for (uint32_t times = fuzz_below(state, 4); times > 0; times--) {
            uint32_t what = fuzz_below(state, 8);
            if (what < 5)
                change_level(&tree.level[fuzz_below(state, (uint32_t)tree.info.level_count)],
                             state);
            else if (what < 7)
                change_mesh(&tree, state);
            else
                change_facts(&tree.info, state);
        }
        made = write_tree(&tree, data, most, state);
        ebpo_tree_free(&tree);
    }
    if (!made)
        memcpy(data, copy, size);
    ebpo_close(file);
    free(copy);
    return made;
}

size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t most, unsigned seed)
{
    uint64_t state = seed;
    uint32_t way = fuzz_below(&state, 8);
    size_t made = way < 4    ? change_chunk(data, size, most, &state)
                  : way == 4 ? change_tree(data, size, most, &state)
                             : 0;
    return made ? made : LLVMFuzzerMutate(data, size, most);
}
