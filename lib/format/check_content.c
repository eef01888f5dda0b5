/* Recomputing a file's checksums. */
#include <string.h>

#include "core/error.h"
#include "core/parallel.h"
#include "core/sized.h"
#include "core/sums.h"
#include "format/read_attributes.h"
#include "format/content_checksum.h"
#include "format/head_facts.h"
#include "format/reader.h"

/* Arrays are independent, so threads take whole ones; chunks within one must come in order. */
typedef struct taking {
    const ebpo_info *info;
    ebpo_array_digest digest;
} taking;

typedef struct content_job {
    const ebpo_file *file;
    const ebpo_array_in *array[EBPO_LEVELS_MAX * EBPO_LEVEL_ARRAYS + EBPO_ARRAYS];
    uint8_t digest[EBPO_LEVELS_MAX * EBPO_LEVEL_ARRAYS + EBPO_ARRAYS][32];
    unsigned count;
    ebpo_read_options alone; /* chunks in order */
} content_job;

static ebpo_status digest_rows(void *context, const ebpo_array_in *array, uint64_t chunk, uint64_t row,
                        uint64_t rows, const uint8_t *bytes, ebpo_error *error)
{
    taking *t = context;
    (void)chunk;
    (void)error;
    ebpo_array_digest_add(&t->digest, t->info, array->id, &array->shape, row, rows, bytes);
    return EBPO_OK;
}

static ebpo_status digest_arrays(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    content_job *j = context;
    (void)worker;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++) {
        taking t = { .info = &j->file->info };
        ebpo_array_digest_begin(&t.digest);
        status = ebpo_reader_rows(j->file, j->array[i], &j->alone, digest_rows, &t, error);
        ebpo_array_digest_end(&t.digest, j->digest[i]);
    }
    return status;
}

static ebpo_status compare_digest(content_job *j, int which, const uint8_t stated[32], const char *name,
                           ebpo_error *error)
{
    ebpo_content content = { .entries = NULL };
    uint8_t digest[32];
    for (unsigned i = 0; i < j->count; i++)
        if (ebpo_content_of(j->array[i]->id) == which)
            ebpo_content_put(&content, j->array[i]->path, j->digest[i]);
    ebpo_status status = ebpo_content_end(&content, digest, error);
    ebpo_content_free(&content);
    if (status == EBPO_OK && ebpo_digest_differs(stated, digest))
        status = ebpo_fail_file(error, EBPO_E_FORMAT, j->file->in.shown,
                                "the content is not what %s says: the file was changed; "
                                "get a fresh copy",
                                name);
    return status;
}

ebpo_status ebpo_file_check_content(const ebpo_file *file, const ebpo_read_options *options,
                                    ebpo_error *error)
{
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_read_options, &read, options, error);
    if (status != EBPO_OK)
        return status;
    content_job j = { .file = file, .alone = read };
    j.alone.threads = 1;
    /* then in the order of the file, in which it comes; else the largest first */
    bool far = ebpo_input_expects(&file->in);
    for (int id = EBPO_ARRAYS - 1; id >= EBPO_LEVEL_ARRAYS; id--)
        if (file->root_array[id].present && ebpo_content_has(&file->info, (ebpo_array_id)id))
            j.array[j.count++] = &file->root_array[id];
    for (int level = file->info.level_count - 1; level >= 0; level--)
        for (int id = EBPO_LEVEL_ARRAYS - 1; id >= 0; id--)
            if (file->level_array[level][id].present)
                j.array[j.count++] = &file->level_array[level][id];
    for (unsigned i = 0; far && i < j.count / 2; i++) {
        const ebpo_array_in *other = j.array[i];
        j.array[i] = j.array[j.count - 1 - i];
        j.array[j.count - 1 - i] = other;
    }
    ebpo_expect_tree(file);
    status =
        ebpo_parallel_for(read.threads, NULL, j.count, 1, digest_arrays, &j, NULL, "check", error);
    if (status == EBPO_OK)
        status =
            compare_digest(&j, EBPO_DIGEST_CONTENT, file->info.content_sha256, "content_sha256", error);
    if (status == EBPO_OK && file->info.parts & EBPO_PART_COLOURS)
        status = compare_digest(&j, EBPO_DIGEST_COLOURS, file->info.colours_sha256, ebpo_colours_fact.name,
                         error);
    return status == EBPO_OK ? ebpo_attributes_check(file, &read, error) : status;
}
