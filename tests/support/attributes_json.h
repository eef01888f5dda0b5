/* Writes attributes as JSON: the content of the vectors' .attributes.json. Each value is written as
 * an integer with the same bits. */
#ifndef ATTRIBUTES_JSON_H
#define ATTRIBUTES_JSON_H

#include "mesh/attributes.h"
#include "tree_json.h"

/* Writes bytes as characters of Latin 1. */
static inline void aj_text(FILE *out, const char *text, uint64_t bytes)
{
    fputc('"', out);
    for (uint64_t i = 0; i < bytes; i++) {
        unsigned c = (unsigned char)text[i];
        if (c < 32 || c > 126 || c == '"' || c == '\\')
            fprintf(out, "\\u%04x", c);
        else
            fputc((int)c, out);
    }
    fputc('"', out);
}

static inline void aj_values(FILE *out, const ebpo_attribute *a)
{
    uint64_t count = ebpo_attribute_value_count(a);
    switch (ebpo_attribute_bytes(a->type)) {
    case 1: TJ_ARRAY(out, "bits", a->values, count, "%" PRIu8); break;
    case 2: TJ_ARRAY(out, "bits", (uint16_t *)(void *)a->values, count, "%" PRIu16); break;
    case 4: TJ_ARRAY(out, "bits", (uint32_t *)(void *)a->values, count, "%" PRIu32); break;
    default: TJ_ARRAY(out, "bits", (uint64_t *)(void *)a->values, count, "%" PRIu64);
    }
}

static inline void attributes_json(FILE *out, const ebpo_attributes *all)
{
    fprintf(out, "{\"header\": ");
    if (all->header)
        aj_text(out, all->header, all->header_bytes);
    else
        fprintf(out, "null");
    fprintf(out, ",\n \"arrays\": [");
    for (uint64_t i = 0; i < all->count; i++) {
        const ebpo_attribute *a = &all->array[i];
        fprintf(out,
                "%s\n  {\"element\": \"%s\", \"columns\": \"%s\", \"type\": \"%s\", \"list\": ",
                i ? "," : "", a->element, a->names, ebpo_attribute_type_name(a->type));
        if (a->list == EBPO_ATTRIBUTE_NO_LIST)
            fprintf(out, "null");
        else
            fprintf(out, "\"%s\"", ebpo_attribute_type_name((ebpo_attribute_type)a->list));
        fprintf(out, ",\n   \"rows\": %" PRIu64, a->rows);
        TJ_ARRAY(out, "ends", a->ends, a->rows, "%" PRIu64);
        aj_values(out, a);
        fprintf(out, "}");
    }
    fprintf(out, "]}\n");
}

#endif
