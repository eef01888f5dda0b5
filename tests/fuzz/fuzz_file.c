/* SPDX-License-Identifier: MIT
 * Any bytes as a file: opening and reading all of it, or the part in a box, ends in a status.
 * Further queries are in fuzz_queries.c, fuzz_levels.c, fuzz_pair.c, fuzz_verify.c and
 * fuzz_export.c. */
#include "fuzz_support.h"

#include <ebpo/file.h>

#include "known_leaks.h"
#include "read_by.h"
#include "derive/subset_parts.h"

static void read_attributes(ebpo_file *file)
{
    ebpo_attribute_facts facts = EBPO_ATTRIBUTE_FACTS_INIT;
    ebpo_array_facts array = EBPO_ARRAY_FACTS_INIT;
    ebpo_attribute_values values;
    for (unsigned n = 0; ebpo_file_attribute(file, n, &facts); n++)
        if (ebpo_file_read_attribute(file, n, READ_BY(1), &values, NULL) == EBPO_OK)
            ebpo_attribute_values_free(&values);
    for (unsigned n = 0; ebpo_file_array(file, n, &array); n++)
        ;
}

static void part_in_box(ebpo_file *file)
{
    ebpo_tree tree;
    ebpo_subset_options part = EBPO_SUBSET_OPTIONS_INIT;
    part.last_level = 2;
    part.boxed = true;
    part.max[0] = part.max[1] = part.max[2] = 0.3;
    part.threads = 1;
    if (ebpo_subset_tree(&tree, file, &part, NULL) == EBPO_OK)
        ebpo_tree_free(&tree);
}

static void read_mesh(ebpo_file *file)
{
    ebpo_mesh mesh;
    ebpo_maps maps;
    if (ebpo_file_read_source_mesh(file, READ_BY(1), &mesh, NULL, NULL) == EBPO_OK)
        ebpo_mesh_free(&mesh);
    if (ebpo_file_read_maps(file, READ_BY(1), &maps, NULL) == EBPO_OK)
        ebpo_maps_free(&maps);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    ebpo_file *file;
    if (ebpo_open_memory(data, size, "fuzzed", &file, NULL) != EBPO_OK)
        return 0;
    ebpo_tree tree;
    if (ebpo_file_read_tree(file, READ_BY(1), &tree, NULL) == EBPO_OK)
        ebpo_tree_free(&tree);
    read_mesh(file);
    (void)!ebpo_file_check_content(file, READ_BY(1), NULL);
    part_in_box(file);
    read_attributes(file);
    ebpo_close(file);
    return 0;
}
