#include "format/places.h"

#include "mesh/attributes.h"

enum { LEVEL_NUMBERS = 64, MESH_NUMBERS = 4096, TABLE_NUMBERS = 4112, ATTRIBUTE_NUMBERS = 8191 };
_Static_assert(EBPO_A_TYPES == 0 && EBPO_A_PLANES == 2 && EBPO_A_LEAF_REFS == 9 &&
                   EBPO_A_LEAF_INDEX == 12 && EBPO_A_LEAF_PLANES == 14 &&
                   EBPO_A_GRAY_COLOURS == 15 && EBPO_A_FACE_SOURCE - EBPO_A_VERTICES == 4 &&
                   EBPO_A_SUBTREE_OUTER - EBPO_A_SUBTREE_INDEX == 2,
               "arrays in files have these numbers: a new row of array_table.inc goes behind them");

uint32_t ebpo_place_number(ebpo_array_id id, int level)
{
    if (id == EBPO_A_ATTRIBUTE)
        return ATTRIBUTE_NUMBERS + (uint32_t)level;
    return id < EBPO_LEVEL_ARRAYS      ? (uint32_t)level * LEVEL_NUMBERS + (uint32_t)id
           : id < EBPO_A_SUBTREE_INDEX ? MESH_NUMBERS + (uint32_t)(id - EBPO_LEVEL_ARRAYS)
                                       : TABLE_NUMBERS + (uint32_t)(id - EBPO_A_SUBTREE_INDEX);
}

ebpo_array_id ebpo_place_array(uint32_t number, int *level)
{
    *level = 0;
    if (number < MESH_NUMBERS) {
        *level = (int)(number / LEVEL_NUMBERS);
        return number % LEVEL_NUMBERS < EBPO_LEVEL_ARRAYS && *level < EBPO_LEVELS_MAX
                   ? (ebpo_array_id)(number % LEVEL_NUMBERS)
                   : EBPO_ARRAYS;
    }
    if (number >= ATTRIBUTE_NUMBERS && number - ATTRIBUTE_NUMBERS <= 2 * EBPO_ATTRIBUTE_ARRAYS) {
        *level = (int)(number - ATTRIBUTE_NUMBERS);
        return EBPO_A_ATTRIBUTE;
    }
    for (int id = EBPO_LEVEL_ARRAYS; id < EBPO_A_PLACES; id++)
        if (ebpo_place_number((ebpo_array_id)id, 0) == number)
            return (ebpo_array_id)id;
    return EBPO_ARRAYS;
}
