#include "format/headers_write.h"

#include <stdio.h>

#include "format/write_plan.h"
#include "format/head_facts.h"

/* HDF5 lets a header grow within its metadata block by a tenth of what is left there: room for that
 * where no other header follows. */
enum { ALONE_BYTES = 4096 };

static bool has_index(const ebpo_plan *plan)
{
    for (unsigned i = 0; i < plan->count; i++)
        if (ebpo_shape_chunks(&plan->array[i].shape) > 1)
            return true;
    return false;
}

static void plan_list(ebpo_headers *h, ebpo_list list, ebpo_array_id id, uint64_t rows)
{
    ebpo_array_out *a = &h->list[list];
    *a = (ebpo_array_out){ .id = id, .handle = -1 };
    ebpo_schema_path(id, 0, a->path);
    if (rows)
        a->shape = (ebpo_shape){ .rows = rows,
                                 .chunk_rows = (uint32_t)rows,
                                 .element_size = ebpo_schema[id].sizes,
                                 .pipeline = h->plan->array[0].shape.pipeline };
}

void ebpo_headers_plan(ebpo_headers *h, ebpo_plan *plan, uint64_t chunks,
                       const ebpo_write_options *options)
{
    bool summed = options->chunk_sums == EBPO_SUMS_USUAL;
    *h = (ebpo_headers){
        .plan = plan, .root = -1, .chunks = chunks, .codec_level = options->codec_level
    };
    h->out = (ebpo_h5_out)EBPO_H5_OUT_INIT;
    plan_list(h, EBPO_LIST_SUMS, EBPO_A_CHUNK_SUMS, summed ? chunks : 0);
    plan_list(h, EBPO_LIST_PLACES, EBPO_A_PLACES,
              plan->info.subtree_level ? chunks + has_index(plan) + summed : 0);
}

static ebpo_status make_level_groups(ebpo_headers *h, ebpo_error *error)
{
    const ebpo_info *info = &h->plan->info;
    ebpo_h5_id id;
    ebpo_status status =
        ebpo_h5_make_group(&h->out, "/levels", (unsigned)info->level_count, &id, error);
    ebpo_h5_close_id(&h->out, status == EBPO_OK ? id : -1);
    for (int level = 0; level < info->level_count && status == EBPO_OK; level++) {
        char path[EBPO_PATH_BYTES];
        unsigned links = 0;
        for (unsigned i = 0; i < h->plan->count; i++)
            links += h->plan->array[i].id < EBPO_LEVEL_ARRAYS && h->plan->array[i].level == level;
        snprintf(path, sizeof path, "/levels/%02d", level);
        status = ebpo_h5_make_group(&h->out, path, links, &id, error);
        if (status == EBPO_OK)
            status = ebpo_facts_put_level(&h->out, id, &info->level[level], error);
        ebpo_h5_close_id(&h->out, id);
    }
    return status;
}

/* A group of the root, if what it is there for is, with room for all arrays that it may have. */
static ebpo_status make_root_group(ebpo_headers *h, const char *path, uint32_t need,
                                   ebpo_error *error)
{
    unsigned links = 0;
    ebpo_h5_id id = -1;
    if (!(ebpo_schema_has(&h->plan->info) & need))
        return EBPO_OK;
    for (int k = EBPO_LEVEL_ARRAYS; k < EBPO_ARRAYS; k++)
        links += (ebpo_schema[k].needs & need) != 0;
    ebpo_status status = ebpo_h5_make_group(&h->out, path, links, &id, error);
    ebpo_h5_close_id(&h->out, id);
    return status;
}

ebpo_status ebpo_headers_put_holds(ebpo_headers *h, ebpo_list list, uint64_t file_bytes,
                                   uint64_t offset, ebpo_error *error)
{
    ebpo_h5_id id = h->list[list].handle;
    ebpo_status status = ebpo_h5_put_count(&h->out, id, "file_bytes", file_bytes, error);
    return status == EBPO_OK ? ebpo_h5_put_count(&h->out, id, "offset", offset, error) : status;
}

static ebpo_status make_array(ebpo_headers *h, ebpo_array_out *a, const ebpo_first_chunk *first,
                              ebpo_error *error)
{
    ebpo_shape shape = ebpo_stored_shape(&a->shape, a->gates);
    ebpo_status status = ebpo_h5_make_array(&h->out, a->path, &shape, &a->handle, error);
    if (status == EBPO_OK && first)
        status = ebpo_h5_put_chunk(&h->out, a->path, a->handle, &a->shape, 0, first->data,
                                   first->bytes, error);
    if (status == EBPO_OK && a->id == EBPO_A_ATTRIBUTE)
        return ebpo_attributes_put_array(&h->out, h->plan, a, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_text(&h->out, a->handle, "coding",
                                  a->gates ? EBPO_GATES_CODING : ebpo_schema[a->id].coding, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_text(&h->out, a->handle, "about", ebpo_schema[a->id].about, error);
    return status;
}

/* Everything but the chunks, and the first of these: before the first header grows by attributes:
 * HDF5 then cannot grow the metadata block at the end of the file, but only fill it. */
static ebpo_status lay_out(ebpo_headers *h, const char *path, const char *shown,
                           uint64_t head_bytes, ebpo_first_chunk first, ebpo_error *error)
{
    ebpo_plan *plan = h->plan;
    h->out.codec_level = h->codec_level;
    ebpo_status status =
        ebpo_h5_create(&h->out, path, shown, head_bytes,
                       3 + (h->list[EBPO_LIST_SUMS].shape.rows != 0) +
                           (plan->info.subtree_level != 0) + (plan->attributes != NULL),
                       error);
    if (status == EBPO_OK)
        status = ebpo_h5_root(&h->out, &h->root, error);
    if (status == EBPO_OK)
        status = ebpo_facts_put(&h->out, h->root, &plan->info, error);
    if (status == EBPO_OK)
        status = make_level_groups(h, error);
    if (status == EBPO_OK)
        status = make_root_group(h, "/mesh", EBPO_NEEDS_MESH, error);
    if (status == EBPO_OK)
        status = make_root_group(h, "/maps", EBPO_NEEDS_MAPS, error);
    if (status == EBPO_OK)
        status = make_root_group(h, "/subtrees", EBPO_NEEDS_SUBTREES, error);
    if (status == EBPO_OK)
        status = ebpo_attributes_put_group(&h->out, plan, error);
    for (unsigned i = 0; i < plan->count && status == EBPO_OK; i++)
        status = make_array(h, &plan->array[i], i == 0 ? &first : NULL, error);
    for (ebpo_list l = 0; l < EBPO_LISTS && status == EBPO_OK; l++) {
        if (h->list[l].shape.rows == 0)
            continue;
        status = make_array(h, &h->list[l], NULL, error);
        if (status == EBPO_OK)
            status = ebpo_headers_put_holds(h, l, 0, 0, error);
    }
    return status;
}

void ebpo_headers_close(ebpo_headers *h)
{
    for (unsigned i = 0; i < h->plan->count; i++) {
        ebpo_h5_close_id(&h->out, h->plan->array[i].handle);
        h->plan->array[i].handle = -1;
    }
    for (ebpo_list l = 0; l < EBPO_LISTS; l++) {
        ebpo_h5_close_id(&h->out, h->list[l].handle);
        h->list[l].handle = -1;
    }
    ebpo_h5_close_id(&h->out, h->root);
    h->root = -1;
}

ebpo_status ebpo_headers_lay_out(ebpo_headers *h, const char *path, const char *shown,
                                 ebpo_first_chunk first, ebpo_error *error)
{
    return lay_out(h, path, shown, h->head_bytes, first, error);
}

ebpo_status ebpo_headers_measure(ebpo_headers *h, const char *shown, ebpo_error *error)
{
    ebpo_plan *plan = h->plan;
    uint64_t capacity = (256 << 10) + (4 << 10) * (uint64_t)plan->count + 32 * h->chunks,
             headers = 0, all = 0;
    ebpo_status status = lay_out(h, NULL, shown, capacity, (ebpo_first_chunk){ "", 1 }, error);
    if (status == EBPO_OK)
        status = ebpo_h5_head_used(&h->out, capacity, &headers, error);
    for (unsigned i = 0; i < plan->count && status == EBPO_OK; i++) {
        const ebpo_array_out *a = &plan->array[i];
        for (uint64_t k = i == 0; k < ebpo_shape_chunks(&a->shape) && status == EBPO_OK; k++)
            status = ebpo_h5_put_chunk(&h->out, a->path, a->handle, &a->shape, k, "", 1, error);
    }
    ebpo_headers_close(h);
    if (status == EBPO_OK)
        status = ebpo_h5_head_used(&h->out, capacity, &all, error);
    ebpo_h5_discard(&h->out);
    h->head_bytes = (headers + 8 + 7) / 8 * 8; /* the last checksum may end in zero bytes */
    if (plan->count == 1)
        h->head_bytes += ALONE_BYTES;
    /* not by the sizes, which are too small where a checksum ends in zero bytes */
    h->index_bytes = has_index(plan) ? (all - headers + 8 + 7) / 8 * 8 : 0;
    return status;
}

ebpo_status ebpo_headers_begin_index(ebpo_headers *h, ebpo_error *error)
{
    ebpo_headers_close(h);
    ebpo_status status = ebpo_h5_reopen(&h->out, h->index_bytes, error);
    if (status == EBPO_OK)
        status = ebpo_h5_root(&h->out, &h->root, error);
    for (unsigned i = 0; i < h->plan->count && status == EBPO_OK; i++)
        status =
            ebpo_h5_open_array(&h->out, h->plan->array[i].path, &h->plan->array[i].handle, error);
    for (ebpo_list l = 0; l < EBPO_LISTS && status == EBPO_OK; l++)
        if (h->list[l].shape.rows)
            status = ebpo_h5_open_array(&h->out, h->list[l].path, &h->list[l].handle, error);
    return status;
}
