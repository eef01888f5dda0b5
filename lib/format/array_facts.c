/* What the head tells of each array. */
#include <stdio.h>

#include "core/sized.h"
#include "format/file_in.h"

static const ebpo_array_in *find_present_array(const ebpo_file *file, unsigned n)
{
    for (int level = 0; level < file->info.level_count; level++)
        for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++)
            if (file->level_array[level][id].present && n-- == 0)
                return &file->level_array[level][id];
    for (int id = EBPO_LEVEL_ARRAYS; id < EBPO_ARRAYS; id++)
        if (file->root_array[id].present && n-- == 0)
            return &file->root_array[id];
    for (int i = 0; i < file->attributes.arrays; i++)
        if (file->attributes.array[i].present && n-- == 0)
            return &file->attributes.array[i];
    return NULL;
}

/* Where the chunks of an array of several lie may be found by another thread just now. */
uint64_t ebpo_reader_stored_bytes(const ebpo_file *file, const ebpo_array_in *array)
{
    bool known =
        !array->present || ebpo_shape_chunks(&array->shape) == 1 || atomic_load(&file->located);
    return known ? array->stored_bytes : 0;
}

bool ebpo_file_array(const ebpo_file *file, unsigned n, ebpo_array_facts *out)
{
    const ebpo_array_in *array = find_present_array(file, n);
    if (!array)
        return false;
    ebpo_array_facts facts = { .rows = array->shape.rows,
                               .columns = array->shape.cols ? array->shape.cols : 1,
                               .element_bytes = array->shape.element_size,
                               .is_signed = array->shape.is_signed,
                               .stored_bytes = ebpo_reader_stored_bytes(file, array),
                               .coding =
                                   array->coding ? array->coding : ebpo_schema[array->id].coding,
                               .about = ebpo_schema[array->id].about };
    snprintf(facts.path, sizeof facts.path, "%s", array->path);
    return EBPO_GIVE(ebpo_array_facts, out, &facts) == EBPO_OK;
}
