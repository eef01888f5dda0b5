#include "format/chunk_order.h"

#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "format/chunk_rows.h"

typedef struct ordering {
    const ebpo_plan *plan;
    ebpo_chunk_order *out;
} ordering;

static void add_array(ordering *o, unsigned array)
{
    const ebpo_array_out *a = &o->plan->array[array];
    uint64_t chunks = ebpo_shape_chunks(&a->shape);
    for (uint64_t k = 0; k < chunks; k++)
        o->out->chunk[o->out->count++] = (ebpo_ordered_chunk){ array, (uint32_t)k, 0 };
}

static int by_subtree(const void *a, const void *b)
{
    const ebpo_ordered_chunk *x = a, *y = b;
    if (x->subtree != y->subtree)
        return x->subtree < y->subtree ? -1 : 1;
    return x->array != y->array ? (x->array > y->array) - (x->array < y->array)
                                : (x->chunk > y->chunk) - (x->chunk < y->chunk);
}

/* Which arrays come next. */
typedef struct choice {
    int first_level, last_level; /* of the arrays of levels */
    enum { WHOLE, TOP_INDEXES, NODES, LISTS, MESH, MAPS, TABLE, OF_MESH, REST } kind;
} choice;

/* Else what nodes are. */
static bool is_of_faces(ebpo_array_id id)
{
    return id == EBPO_A_LEAF_SKIP || id == EBPO_A_LEAF_NEW || id == EBPO_A_LEAF_REF_COUNT ||
           id == EBPO_A_LEAF_REFS;
}

static bool is_chosen(const choice *c, const ebpo_array_out *a)
{
    bool of_level = a->id < EBPO_LEVEL_ARRAYS,
         here = of_level && a->level >= c->first_level && a->level <= c->last_level,
         index = of_level && ebpo_schema_is_index(a->id);
    switch (c->kind) {
    case WHOLE: return here;
    case TOP_INDEXES:
        return (here && index) || a->id == EBPO_A_SUBTREE_INDEX || a->id == EBPO_A_FACES_INDEX;
    case NODES: return here && !index && !is_of_faces(a->id);
    case LISTS: return here && is_of_faces(a->id);
    /* questions tell the source's faces, and read these numbers with the faces */
    case MESH:
        return a->id == EBPO_A_VERTICES || a->id == EBPO_A_FACES || a->id == EBPO_A_FACE_SOURCE;
    case MAPS: return a->id == EBPO_A_VERTEX_SOURCE;
    case OF_MESH: return a->id == EBPO_A_ATTRIBUTE && a->rows_of != EBPO_A_ATTRIBUTE;
    case REST: return a->id == EBPO_A_ATTRIBUTE && a->rows_of == EBPO_A_ATTRIBUTE;
    case TABLE: return a->id == EBPO_A_SUBTREE_COUNTS || a->id == EBPO_A_SUBTREE_OUTER;
    }
    return false;
}

static void add_chosen_chunks(ordering *o, const choice *c)
{
    for (unsigned i = 0; i < o->plan->count; i++)
        if (is_chosen(c, &o->plan->array[i]))
            add_array(o, i);
}

static void add_by_subtree(ordering *o, const choice *c)
{
    uint64_t begin = o->out->count;
    add_chosen_chunks(o, c);
    for (uint64_t i = begin; i < o->out->count; i++) {
        ebpo_ordered_chunk *chunk = &o->out->chunk[i];
        const ebpo_array_out *a = &o->plan->array[chunk->array];
        uint64_t row = (uint64_t)chunk->chunk * a->shape.chunk_rows;
        chunk->subtree =
            a->id == EBPO_A_ATTRIBUTE
                ? ebpo_subtree_of_row(&o->plan->subtrees, &o->plan->info, a->rows_of, 0, row)
                : ebpo_subtree_of_row(&o->plan->subtrees, &o->plan->info, a->id, a->level, row);
    }
    if (o->out->count > begin)
        qsort(o->out->chunk + begin, o->out->count - begin, sizeof *o->out->chunk, by_subtree);
}

static void order_subtrees(ordering *o)
{
    const ebpo_info *info = &o->plan->info;
    int whole = ebpo_last_whole_level(info), deep = ebpo_first_deep_level(info),
        last = info->level_count - 1;
    add_chosen_chunks(o, &(choice){ 0, whole, WHOLE });
    add_chosen_chunks(o, &(choice){ whole + 1, last, TOP_INDEXES });
    o->out->top = o->out->count;
    add_chosen_chunks(o, &(choice){ 0, 0, TABLE });
    for (int level = whole + 1; level < deep; level++)
        add_by_subtree(o, &(choice){ level, level, NODES });
    add_by_subtree(o, &(choice){ whole + 1, deep - 1, LISTS });
    add_by_subtree(o, &(choice){ deep, last, NODES });
    add_by_subtree(o, &(choice){ deep, last, LISTS });
    add_by_subtree(o, &(choice){ 0, 0, MESH });
    add_by_subtree(o, &(choice){ 0, 0, MAPS });
    add_by_subtree(o, &(choice){ 0, 0, OF_MESH });
    add_chosen_chunks(o, &(choice){ 0, 0, REST });
}

ebpo_status ebpo_chunk_order_make(ebpo_chunk_order *out, const ebpo_plan *plan, ebpo_error *error)
{
    ordering o = { plan, out };
    uint64_t chunks = 0;
    *out = (ebpo_chunk_order){ NULL, 0, 0 };
    for (unsigned i = 0; i < plan->count; i++)
        chunks += ebpo_shape_chunks(&plan->array[i].shape);
    out->chunk = ebpo_alloc(chunks, sizeof *out->chunk);
    if (!out->chunk)
        return ebpo_fail_memory(error, chunks * sizeof *out->chunk);
    if (plan->info.subtree_level)
        order_subtrees(&o);
    else
        for (unsigned i = 0; i < plan->count; i++)
            add_array(&o, i);
    return EBPO_OK;
}

void ebpo_chunk_order_free(ebpo_chunk_order *order)
{
    free(order->chunk);
    *order = (ebpo_chunk_order){ NULL, 0, 0 };
}
