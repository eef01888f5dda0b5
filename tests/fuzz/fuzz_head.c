/* Any bytes as the header of a file: every object, attribute and array of the format is read. It is
 * refused or read, and data that is read keeps its guarantees. Tests build it twice: normally, and
 * with a reader that does not compare checksums (core/checksum.h). */
#include "fuzz_support.h"

#include "format/schema.h"
#include "hdf5_read/head.h"

static void query_attributes(ebpo_head *head, ebpo_head_object object)
{
    static const char *const names[] = { "format", "level_count", "box_min",   "coding",
                                         "unit",   "epsilon",     "file_bytes" };
    char text[64];
    int64_t number;
    uint64_t count;
    double real[6];
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        if (ebpo_head_get_text(head, object, "/", names[i], text, sizeof text, NULL) == EBPO_OK)
            fuzz_must(strlen(text) < sizeof text);
        (void)!ebpo_head_get_int(head, object, "/", names[i], &number, NULL);
        (void)!ebpo_head_get_count(head, object, "/", names[i], &count, NULL);
        (void)!ebpo_head_get_real(head, object, "/", names[i], real, 0, NULL);
        (void)!ebpo_head_get_real(head, object, "/", names[i], real, i % 2 ? 3 : 6, NULL);
    }
}

static void query_array(ebpo_head *head, const char *path, ebpo_head_rows rows)
{
    ebpo_shape shape;
    ebpo_chunk_location *places;
    uint64_t stored, sum = 0;
    char coding[EBPO_HEAD_CODING_BYTES];
    if (ebpo_head_read_array(head, path, UINT64_MAX, rows, &shape, coding, &places, &stored,
                             NULL) != EBPO_OK)
        return;
    for (uint64_t i = 0; i < ebpo_shape_chunks(&shape); i++) {
        sum += places[i].bytes;
        fuzz_must(places[i].bytes > 0 && places[i].address <= head->end &&
                  places[i].bytes <= head->end - places[i].address);
    }
    fuzz_must(sum == stored && stored <= head->end);
    free(places);
}

static void query_all(ebpo_head *head)
{
    char path[EBPO_PATH_BYTES];
    static const char *const groups[] = { "/",     "/levels", "/levels/00", "/levels/01",
                                          "/mesh", "/maps",   "/subtrees",  "/attributes" };
    ebpo_head_object object;
    for (size_t i = 0; i < sizeof groups / sizeof groups[0]; i++)
        if (ebpo_head_open_group(head, groups[i], &object, NULL) == EBPO_OK)
            query_attributes(head, object);
    for (int level = 0; level < 3; level++)
        for (int id = level ? 0 : EBPO_LEVEL_ARRAYS; id < (level ? EBPO_LEVEL_ARRAYS : EBPO_ARRAYS);
             id++) {
            ebpo_schema_path((ebpo_array_id)id, level ? level - 1 : 0, path);
            query_array(head, path, (ebpo_head_rows)(id % 3));
            if (ebpo_head_open_array(head, path, &object, NULL) == EBPO_OK)
                query_attributes(head, object);
        }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    uint8_t *own = fuzz_copy(data, size);
    ebpo_input input;
    ebpo_head head = EBPO_HEAD_INIT;
    ebpo_source source = ebpo_source_of_memory(own, size);
    if (ebpo_input_open(&input, &source, "fuzz", NULL) != EBPO_OK)
        exit(2);
    ebpo_status status = ebpo_head_open(&head, &input, NULL);
    if (status == EBPO_OK && size % 2) /* the second half of it is read in one go */
        ebpo_head_hint_index(&head, (ebpo_range){ size / 2, size - size / 2 });
    if (status == EBPO_OK)
        query_all(&head);
    fuzz_must(ebpo_head_close(&head, EBPO_OK, NULL) == EBPO_OK); /* reading memory never fails */
    ebpo_input_close(&input);
    free(own);
    return 0;
}
