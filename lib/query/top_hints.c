/* Sends prefetch hints (which bytes will be read soon) for the subtrees of a model and for leaves
 * above them. The file's table of subtrees locates all data of a subtree. For a *lone leaf*, a leaf
 * that is in no subtree of the file, the table locates the faces and vertices that are new in the
 * lone leaves between two subtrees, and the leaf's list names its other faces. */
#include "query/model_parts.h"

#include <stdlib.h>

#include "core/alloc.h"
#include "format/pick_rows.h"
#include "format/reader.h"
#include "format/subtree_index.h"
#include "geometry/cells.h"

/* Returns the row, in the file's table of subtrees, of the subtree that contains the node
 * top->below[below]. (This node may be deeper than the root of the file's subtree.) Returns
 * UINT64_MAX if the node is in no subtree, or no row is found. */
static uint64_t table_row(const ebpo_top *top, ebpo_chunks *chunks, uint64_t below)
{
    const ebpo_info *info = &chunks->file->info;
    const ebpo_node *root = &top->below[below];
    int level = root->cell.level;
    if (level < info->subtree_level || root->pruned)
        return UINT64_MAX;
    if (level == info->subtree_level)
        return root->type == EBPO_GRAY ? root->rank : UINT64_MAX;
    ebpo_subtree_row row;
    unsigned column =
        ebpo_subtree_column(info, level, root->type == EBPO_GRAY ? EBPO_S_GRAY : EBPO_S_LEAF);
    return ebpo_subtree_table_find(chunks, column, root->rank, &row, NULL) == EBPO_OK ? row.subtree
                                                                                      : UINT64_MAX;
}

/* Returns true if top->below[below] is a lone leaf: a leaf at the level of the roots of the file's
 * subtrees, or above. */
static bool has_lone_leaf(const ebpo_top *top, const ebpo_info *info, uint32_t below)
{
    const ebpo_node *root = &top->below[below];
    return root->type == EBPO_LEAF && root->cell.level <= info->subtree_level;
}

/* Returns the first octcode, at the deepest level, of the cells in this cell. These codes are in
 * depth-first order. */
static uint64_t first_code(ebpo_cell cell)
{
    return ebpo_octcode_of_cell(cell) << 3 * (EBPO_MAX_LEVEL - cell.level);
}

/* Returns the index, in the file, of the first subtree after a lone leaf, depth first; the number
 * of subtrees if there is none. Returns UINT64_MAX if this is not known. */
static uint64_t subtree_after(const ebpo_top *top, ebpo_chunks *chunks, uint32_t below)
{
    const ebpo_info *info = &chunks->file->info;
    uint64_t subtrees = info->level[info->subtree_level].gray_count;
    if (top->cut_level < info->subtree_level || subtrees == 0)
        return UINT64_MAX;
    uint64_t code = first_code(top->below[below].cell), next = UINT64_MAX;
    uint32_t found = below;
    for (uint32_t i = 0; i < top->below_count; i++) {
        uint64_t other = first_code(top->below[i].cell);
        if (other > code && other < next && top->below[i].cell.level >= info->subtree_level &&
            !has_lone_leaf(top, info, i)) {
            next = other;
            found = i;
        }
    }
    const ebpo_node *root = &top->below[found];
    return found == below                            ? subtrees
           : root->cell.level == info->subtree_level ? root->rank /* also if it is pruned */
                                                     : table_row(top, chunks, found);
}

typedef struct lone_leaf {
    uint32_t below; /* index in top->below */
    uint64_t after; /* subtree_after */
} lone_leaf;

/* Returns the run that consists of a leaf. */
static ebpo_run run_of(const ebpo_node *leaf)
{
    ebpo_run run = { .groups = 0 };
    run.rank[EBPO_LEAF] = leaf->rank;
    run.count[EBPO_LEAF] = 1;
    return run;
}

/* Adds to `hints` the faces of a lone leaf, and vertices that these faces probably use. Reads the
 * leaf's list of faces, unless it is long. Returns false if the source fails: the next list could
 * again wait for a time-out, and the later read reports the error. */
static bool hint_lone_leaf(const ebpo_top *top, ebpo_chunks *chunks, const lone_leaf *leaf,
                           uint32_t needs, ebpo_hints *hints)
{
    enum { LIST_MAX = 1 << 20 }; /* bytes of a list, which counts toward no budget */
    const ebpo_node *root = &top->below[leaf->below];
    ebpo_run run = run_of(root);
    ebpo_level lists = { .group_count = 0 };
    ebpo_quota space = { .most = LIST_MAX };
    ebpo_subtrees_hint_before(chunks, hints, leaf->after, needs);
    ebpo_status status =
        ebpo_runs_read(chunks, root->cell.level, &run, 1, EBPO_NEEDS_MESH, &space, &lists, NULL);
    if (status == EBPO_OK && lists.ref_count) {
        const uint32_t *shared = lists.leaf_refs;
        ebpo_faces_hint(chunks, hints, shared, lists.ref_count, 0);
        for (uint64_t i = 0; needs & EBPO_NEEDS_MAPS && i < lists.ref_count; i++)
            if (i == 0 || shared[i] / EBPO_FACE_BLOCK != shared[i - 1] / EBPO_FACE_BLOCK)
                ebpo_chunks_hint(chunks, hints, EBPO_A_FACE_SOURCE, 0, shared[i], 1);
    }
    ebpo_level_free(&lists);
    return status != EBPO_E_IO;
}

static int compare_rows(const void *x, const void *y)
{
    uint64_t a = *(const uint64_t *)x, b = *(const uint64_t *)y;
    return (a > b) - (a < b);
}

/* Sorts rows in ascending order and removes repetitions; returns the new count. */
static uint64_t sort_rows(uint64_t *rows, uint64_t count)
{
    uint64_t kept = 0;
    if (count)
        qsort(rows, count, sizeof *rows, compare_rows);
    for (uint64_t i = 0; i < count; i++)
        if (i == 0 || rows[i] != rows[kept - 1])
            rows[kept++] = rows[i];
    return kept;
}

void ebpo_top_hint(const ebpo_top *top, ebpo_chunks *chunks, const uint32_t *below, uint64_t count,
                   uint32_t needs, int last_level)
{
    const ebpo_info *info = &chunks->file->info;
    ebpo_hints hints = EBPO_HINTS_INIT(chunks->file);
    if (info->subtree_level == 0 || !ebpo_input_prefetches(&chunks->file->in) || count == 0)
        return;
    uint64_t found = 0, leaves = 0, last = info->level[info->subtree_level].gray_count - 1;
    uint64_t *rows = ebpo_alloc(2 * count, sizeof *rows);
    lone_leaf *leaf = ebpo_alloc(count, sizeof *leaf);
    for (uint64_t i = 0; rows && leaf && i < count; i++) {
        bool is_lone = has_lone_leaf(top, info, below[i]);
        uint64_t row =
            is_lone ? subtree_after(top, chunks, below[i]) : table_row(top, chunks, below[i]);
        if (row != UINT64_MAX && is_lone)
            leaf[leaves++] = (lone_leaf){ below[i], row };
        else if (row != UINT64_MAX)
            rows[found++] = row;
    }
    found = sort_rows(rows, found);
    for (uint64_t i = 0; i < leaves; i++) /* the rows from which faces and vertices follow */
        rows[found + i] = leaf[i].after < last ? leaf[i].after : last;
    ebpo_subtree_table_hint(chunks, rows, found + leaves);
    for (uint64_t i = 0; i < leaves; i++) {
        ebpo_run run = run_of(&top->below[leaf[i].below]);
        ebpo_runs_hint(chunks, &hints, top->below[leaf[i].below].cell.level, &run, 1, needs);
    }
    ebpo_hint_all(&hints); /* in most files, the levels of lone leaves are already here */
    for (uint64_t i = 0; i < found; i++)
        ebpo_subtrees_hint(chunks, &hints, rows[i], 1, needs, last_level, needs & EBPO_NEEDS_MESH);
    for (uint64_t i = 0; i < leaves && hint_lone_leaf(top, chunks, &leaf[i], needs, &hints); i++)
        ;
    ebpo_hint_all(&hints);
    free(rows);
    free(leaf);
}
