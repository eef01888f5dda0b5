#include "derive/kept_nodes.h"

#include "core/alloc.h"

static ebpo_per per_of(ebpo_node_type type)
{
    static const ebpo_per per[] = { [EBPO_WHITE] = EBPO_PER_WHITE,
                                    [EBPO_BLACK] = EBPO_PER_BLACK,
                                    [EBPO_LEAF] = EBPO_PER_LEAF,
                                    [EBPO_GRAY] = EBPO_PER_GRAY };
    return per[type];
}

static uint64_t capacity_of(const ebpo_level *from, ebpo_per per, const uint64_t more[4])
{
    int type = ebpo_schema_node_type(per);
    uint64_t leaf_planes = per == EBPO_PER_PLANE ? from->leaf_plane_count : 0;
    return ebpo_level_count(from, per) + leaf_planes + (type >= 0 ? more[type] : 0);
}

static void note_column(ebpo_kept_nodes *kept, int id, int type)
{
    kept->of_type[type].column[kept->of_type[type].columns++] =
        (ebpo_kept_column){ .from = ebpo_level_array(kept->from, id),
                            .to = ebpo_level_array(kept->to, id),
                            .size = ebpo_schema[id].held_size,
                            .usual = ebpo_schema[id].usual };
}

/* Place of the counts of a list, noted when first met. */
static unsigned note_counts(ebpo_kept_nodes *kept, ebpo_per per, const ebpo_list_spec *list)
{
    int type = ebpo_schema_node_type(list->of);
    unsigned i = 0, known = kept->of_type[type].counts;
    while (i < known && kept->of_type[type].count[i].per != per)
        i++;
    if (i == known)
        kept->of_type[type].count[kept->of_type[type].counts++] =
            (ebpo_kept_counts){ .per = per,
                                .counts = ebpo_level_array(kept->from, list->counts),
                                .size = ebpo_schema[list->counts].held_size };
    return i;
}

static void note_list(ebpo_kept_nodes *kept, int id, const ebpo_list_spec *list)
{
    int type = ebpo_schema_node_type(list->of);
    kept->of_type[type].list[kept->of_type[type].lists++] =
        (ebpo_kept_list){ .counts = note_counts(kept, ebpo_schema[id].per, list),
                          .from = ebpo_level_array(kept->from, id),
                          .to = ebpo_level_array(kept->to, id),
                          .size = ebpo_schema[id].held_size };
}

bool ebpo_kept_begin(ebpo_kept_nodes *kept, const ebpo_level *from, ebpo_level *to, uint32_t needs,
                     const uint64_t more[4])
{
    *kept = (ebpo_kept_nodes){ .from = from, .to = to };
    for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++) {
        const ebpo_array_spec *spec = &ebpo_schema[id];
        const ebpo_list_spec *list = ebpo_schema_list(spec->per);
        if (spec->per == EBPO_PER_GROUP || !ebpo_schema_is_held(id) || !(spec->needs & needs) ||
            (spec->if_needed && !ebpo_level_array(from, id)))
            continue;
        void *array = ebpo_alloc(capacity_of(from, spec->per, more), spec->held_size);
        if (!array)
            return false;
        ebpo_level_set_array(to, id, array);
        if (list)
            note_list(kept, id, list);
        else
            note_column(kept, id, ebpo_schema_node_type(spec->per));
    }
    return true;
}

static void copy_row(const ebpo_kept_column *c, uint64_t from, uint64_t to)
{
    switch (c->size) {
    case 1: c->to[to] = c->from[from]; break;
    case 4: memcpy(c->to + 4 * to, c->from + 4 * from, 4); break;
    default: memcpy(c->to + c->size * to, c->from + c->size * from, c->size);
    }
}

static void put_usual(const ebpo_kept_column *c, uint64_t to)
{
    int64_t value = c->usual;
    switch (c->size) {
    case 1: memcpy(c->to + to, &(int8_t){ c->usual }, 1); break;
    case 2: memcpy(c->to + 2 * to, &(int16_t){ c->usual }, 2); break;
    case 4: memcpy(c->to + 4 * to, &(int32_t){ c->usual }, 4); break;
    default: memcpy(c->to + 8 * to, &value, 8);
    }
}

static uint64_t kept_items(const ebpo_kept_counts *c, uint64_t rank)
{
    uint32_t count;
    if (!c->counts || c->size == 1)
        return c->counts ? c->counts[rank] : 0;
    memcpy(&count, c->counts + 4 * rank, 4);
    return count;
}

/* The place of a node that joins the level. */
static uint64_t grow_level(ebpo_level *level, ebpo_node_type type)
{
    uint64_t place = ebpo_level_count(level, per_of(type));
    ebpo_level_set_count(level, per_of(type), place + 1);
    return place;
}

/* The items of a node that stays, behind those that stay already. */
static void copy_items(const ebpo_kept_nodes *kept, const ebpo_kept_list *list,
                       const ebpo_kept_counts *c, uint64_t count)
{
    uint64_t end = ebpo_level_count(kept->to, c->per);
    memcpy(list->to + end * list->size, list->from + kept->read[c->per] * list->size,
           count * list->size);
}

void ebpo_kept_take(ebpo_kept_nodes *kept, ebpo_node_type type)
{
    uint64_t place = grow_level(kept->to, type), rank = kept->next[type];
    for (unsigned i = 0; i < kept->of_type[type].columns; i++)
        copy_row(&kept->of_type[type].column[i], rank, place);
    for (unsigned i = 0; i < kept->of_type[type].lists; i++) {
        const ebpo_kept_list *list = &kept->of_type[type].list[i];
        const ebpo_kept_counts *c = &kept->of_type[type].count[list->counts];
        uint64_t count = kept_items(c, rank);
        if (count)
            copy_items(kept, list, c, count);
    }
    for (unsigned i = 0; i < kept->of_type[type].counts; i++) {
        const ebpo_kept_counts *c = &kept->of_type[type].count[i];
        ebpo_level_set_count(kept->to, c->per, ebpo_level_count(kept->to, c->per) + kept_items(c, rank));
    }
    ebpo_kept_pass(kept, type);
}

void ebpo_kept_pass(ebpo_kept_nodes *kept, ebpo_node_type type)
{
    uint64_t rank = kept->next[type]++;
    for (unsigned i = 0; i < kept->of_type[type].counts; i++) {
        const ebpo_kept_counts *c = &kept->of_type[type].count[i];
        kept->read[c->per] += kept_items(c, rank);
    }
}

void ebpo_kept_add(ebpo_kept_nodes *kept, ebpo_node_type type)
{
    uint64_t place = grow_level(kept->to, type);
    for (unsigned i = 0; i < kept->of_type[type].columns; i++)
        put_usual(&kept->of_type[type].column[i], place);
}
