#include "derive/subset_reads.h"

#include "format/file_nodes.h"
#include "format/subtree_index.h"
#include "geometry/cells.h"

enum { CHUNK_BUDGET = 16 << 20 };

typedef struct counting {
    const ebpo_file *file;
    const ebpo_subset_options *options;
    ebpo_box box;
    ebpo_chunks *top;   /* what is read to find subtrees */
    ebpo_chunks *below; /* a cache that has nothing of them: all of it counts */
    ebpo_expected expected;
    uint32_t needs;
    int last_level;
    ebpo_subset_reads *out;
    ebpo_error *error;
} counting;

static void count_subtree(counting *c, uint64_t number)
{
    c->out->subtrees++;
    ebpo_subtrees_expect(c->below, &c->expected, number, 1, c->needs, c->last_level,
                         c->needs & EBPO_NEEDS_MESH);
}

/* Gray nodes that meet the box, down to the subtrees' roots. */
static ebpo_status descend_to_subtrees(counting *c, const ebpo_node *gray)
{
    const ebpo_subset_options *o = c->options;
    uint16_t types;
    uint64_t ranks[4];
    if (o->boxed && !ebpo_cell_meets(&c->box, gray->cell, o->min, o->max))
        return EBPO_OK;
    if (gray->cell.level == c->file->info.subtree_level) {
        count_subtree(c, gray->rank);
        return EBPO_OK;
    }
    ebpo_status status = ebpo_chunks_children(c->top, gray, &types, ranks, c->error);
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++) {
        ebpo_node child = ebpo_node_child(gray, octant, types, ranks);
        if (child.type == EBPO_GRAY)
            status = descend_to_subtrees(c, &child);
    }
    return status;
}

static ebpo_status count_subtrees(counting *c)
{
    ebpo_node root;
    ebpo_status status = ebpo_chunks_make(&c->top, c->file, CHUNK_BUDGET, c->error);
    if (status == EBPO_OK)
        status = ebpo_chunks_make(&c->below, c->file, CHUNK_BUDGET, c->error);
    if (status == EBPO_OK)
        status = ebpo_chunks_root(c->top, &root, c->error);
    if (status == EBPO_OK && root.type == EBPO_GRAY)
        status = descend_to_subtrees(c, &root);
    ebpo_chunks_free(c->top);
    ebpo_chunks_free(c->below);
    return status;
}

static void count_levels(counting *c, int last)
{
    for (int level = 0; level <= last; level++)
        for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++)
            if (ebpo_schema[id].needs & c->needs)
                ebpo_expect_array(&c->expected, &c->file->level_array[level][id]);
}

ebpo_status ebpo_subset_count_reads(const ebpo_file *file, const ebpo_subset_options *options,
                                    ebpo_subset_reads *out, ebpo_error *error)
{
    const ebpo_info *info = ebpo_file_info(file);
    int deepest = info->level_count - 1;
    counting c = { .file = file,
                   .options = options,
                   .box = ebpo_root_box(info),
                   .expected = EBPO_EXPECTED_INIT(file),
                   .needs = (info->parts & options->parts) | EBPO_NEEDS_ALWAYS |
                            (info->solid ? EBPO_NEEDS_SOLID : 0),
                   .last_level = options->last_level,
                   .out = out,
                   .error = error };
    *out = (ebpo_subset_reads){ 0 };
    ebpo_status status = ebpo_file_locate(file, NULL, error);
    if (status != EBPO_OK)
        return status;
    if (c.last_level < 0 || c.last_level > deepest || c.needs & EBPO_NEEDS_MESH)
        c.last_level = deepest;
    c.expected.summed = true;
    bool divided = options->boxed && info->subtree_level && c.last_level > info->subtree_level;
    out->of_subtrees = info->subtree_level ? info->level[info->subtree_level].gray_count : 0;
    if (!divided && c.last_level > info->subtree_level)
        out->subtrees = out->of_subtrees;
    count_levels(&c, divided ? info->subtree_level : c.last_level);
    if (divided)
        status = count_subtrees(&c);
    else
        ebpo_expect_root(&c.expected, c.needs);
    out->bytes = ebpo_expected_bytes(&c.expected);
    return status;
}
