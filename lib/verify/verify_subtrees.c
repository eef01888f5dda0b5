/* Verifies the table of subtrees (format-spec/subtrees.md). Visits the whole tree once, depth
 * first, which is the order of the faces, and counts all items again.
 *
 * Every column of every row is recomputed, except the two columns with numbers of shared chunks,
 * because /subtrees/shared_chunks is only a hint. The sum of these two columns over all subtrees
 * must be the number of rows of /subtrees/shared_chunks.
 *
 * This check is independent of the library's writer and reader, which proceed level by level. This
 * file shares with them only the code that reads arrays. */
#include "verify/verify_parts.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "format/reader.h"

#define CHECK(condition, ...) ebpo_tally_check(tally, EBPO_VERIFY_STRUCTURE, condition, __VA_ARGS__)

/* Columns of the table, numbered as in the specification. From FIRST_LEVEL on, each level has
 * OF_A_LEVEL columns. GRAY to END_GROWTH are the positions of the columns of one level. */
enum {
    FACES_BEFORE, /* number of new faces between the previous subtree and this one */
    FACES,
    VERTICES_BEFORE,
    VERTICES,
    SHARED_FACES, /* number of chunks with shared faces */
    SHARED_VERTICES,
    FIRST_LEVEL,
    GRAY = 0,
    LEAF,
    BLACK,
    PLANES,
    LEAF_PLANES,
    REFERENCES,
    END_GROWTH,
    OF_A_LEVEL,
    COLUMNS_MAX = FIRST_LEVEL + OF_A_LEVEL * EBPO_LEVELS_MAX
};
/* Number of subtrees after which pages of the workspace are released. */
enum { SUBTREES_A_TIME = 128 };
static const char *const names[] = { "faces before the subtree",    "faces",
                                     "vertices before the subtree", "vertices",
                                     "chunks of shared faces",      "chunks of shared vertices" };
static const char *const level_names[] = { "gray nodes",
                                           "leaves",
                                           "black nodes",
                                           "planes",
                                           "leaf planes",
                                           "references",
                                           "growth of the end of the new faces" };

typedef struct recount {
    ebpo_tally *tally;
    const ebpo_reference_tree *view;
    int level;              /* level of the subtrees' roots */
    const uint32_t *counts; /* [subtrees][columns] /subtrees/counts, as stored */
    /* number of columns of `counts`; number of rows in each of its chunks */
    unsigned columns, rows_of_chunk;
    const uint64_t *index;          /* [chunks][columns] /subtrees/index, as stored */
    uint64_t subtrees, shared_rows; /* shared_rows: number of rows of /subtrees/shared_chunks */
    /* numbers of subtrees, faces and vertices counted so far */
    uint64_t subtree, faces, vertices;
    /* sum of the two columns with numbers of shared chunks, over the subtrees so far */
    uint64_t shared_done;
    uint64_t end[EBPO_LEVELS_MAX]; /* [level] end of the last leaf's new faces */
    uint64_t sum[COLUMNS_MAX];     /* [column] sum over all subtrees before the current one */
    uint64_t row[COLUMNS_MAX];     /* [column] counts of the current subtree */
    bool within;                   /* the node that is visited is below the root of a subtree */
} recount;

/* Returns the name of a column. *level: the level to which it belongs, or -1. */
static const char *column_name(const recount *c, unsigned column, int *level)
{
    if (column < FIRST_LEVEL)
        return *level = -1, names[column];
    *level = c->level + 1 + (int)((column - FIRST_LEVEL) / OF_A_LEVEL);
    return level_names[(column - FIRST_LEVEL) % OF_A_LEVEL];
}

/* --- comparing a complete subtree with its row --- */

/* Compares the counts of the current subtree with its row, and begins a new row. */
static void check_row(recount *c)
{
    ebpo_tally *tally = c->tally;
    const uint32_t *stated = c->counts + c->subtree * c->columns;
    int level;
    /* these two columns are not checked, because they are hints, as is /subtrees/shared_chunks */
    c->row[SHARED_FACES] = stated[SHARED_FACES];
    c->row[SHARED_VERTICES] = stated[SHARED_VERTICES];
    c->shared_done += c->row[SHARED_FACES] + c->row[SHARED_VERTICES];
    for (unsigned k = 0; k < c->columns; k++) {
        const char *name = column_name(c, k, &level);
        if (c->subtree % c->rows_of_chunk == 0)
            CHECK(c->index[c->subtree / c->rows_of_chunk * c->columns + k] == c->sum[k],
                  "/subtrees/index, before subtree %" PRIu64 ", column %u (%s): states %" PRIu64
                  ", but the rows of /subtrees/counts before add up to %" PRIu64,
                  c->subtree, k, name, c->index[c->subtree / c->rows_of_chunk * c->columns + k],
                  c->sum[k]);
        CHECK(stated[k] == c->row[k],
              "/subtrees/counts, subtree %" PRIu64 ", column %u (%s%s): states %" PRIu32
              ", there are %" PRIu64,
              c->subtree, k, name, level < 0 ? "" : " of a level", stated[k], c->row[k]);
        c->sum[k] += c->row[k];
    }
    memset(c->row, 0, sizeof c->row);
}

/* --- visiting the tree --- */

/* Counts the next `count` faces of the mesh, which are the new faces of a leaf. Also counts the
 * vertices that no earlier face uses. */
static void count_faces(recount *c, uint64_t count)
{
    const ebpo_mesh *mesh = &c->view->tree->mesh;
    uint64_t used = c->vertices;
    EBPO_FOR_ITEMS(c->view->workspace, i, 3 * c->faces, 3 * (c->faces + count))
        used += mesh->faces[i] == used; /* a vertex used for the first time has the next index */
    c->row[c->within ? FACES : FACES_BEFORE] += count;
    c->row[c->within ? VERTICES : VERTICES_BEFORE] += used - c->vertices;
    c->faces += count;
    c->vertices = used;
}

/* Counts a leaf. `row`: counts of the leaf's level in the current subtree; NULL: the leaf is not in
 * a subtree. */
static void count_leaf(recount *c, const ebpo_reference_node *leaf, uint64_t *row)
{
    const ebpo_level *level = &c->view->tree->level[leaf->cell.level];
    uint32_t planes, references;
    if (c->within) {
        (void)ebpo_reference_planes(c->view, leaf, &planes);
        row[LEAF]++;
        row[LEAF_PLANES] += planes;
    }
    if (!c->view->has_mesh)
        return;
    if (c->within) {
        (void)ebpo_reference_refs(c->view, leaf, &references);
        uint64_t end = level->leaf_first[leaf->rank] + level->leaf_new[leaf->rank];
        row[REFERENCES] += references;
        row[END_GROWTH] += end - c->end[leaf->cell.level];
        c->end[leaf->cell.level] = end;
    }
    /* ebpo_check_structure checks that the leaves' new faces are consecutive */
    if (c->faces + level->leaf_new[leaf->rank] <= c->view->tree->mesh.face_count)
        count_faces(c, level->leaf_new[leaf->rank]);
}

/* Counts a node and the nodes below it. */
static void visit_node(recount *c, const ebpo_reference_node *node);

static void visit_children(recount *c, const ebpo_reference_node *node)
{
    if (!ebpo_reference_is_pruned(c->view, node))
        for (unsigned octant = 0; octant < 8; octant++) {
            ebpo_reference_node child = ebpo_reference_child(c->view, node, octant);
            visit_node(c, &child);
        }
}

static void visit_node(recount *c, const ebpo_reference_node *node)
{
    uint64_t *row =
        c->within ? c->row + FIRST_LEVEL + OF_A_LEVEL * (unsigned)(node->cell.level - c->level - 1)
                  : NULL;
    uint32_t planes;
    if (node->type == EBPO_LEAF)
        count_leaf(c, node, row);
    else if (node->type == EBPO_BLACK && c->within)
        row[BLACK]++;
    else if (node->type == EBPO_GRAY && c->within) {
        (void)ebpo_reference_planes(c->view, node, &planes);
        row[GRAY]++;
        row[PLANES] += planes;
        visit_children(c, node);
    } else if (node->type == EBPO_GRAY && node->cell.level == c->level) {
        c->within = true;
        visit_children(c, node);
        c->within = false;
        check_row(c);
        if (++c->subtree % SUBTREES_A_TIME == 0)
            ebpo_release_pages(c->view->workspace);
    } else if (node->type == EBPO_GRAY)
        visit_children(c, node);
}

static void recount_table(recount *c)
{
    ebpo_tally *tally = c->tally;
    ebpo_reference_node root = ebpo_reference_root(c->view);
    visit_node(c, &root);
    CHECK(c->shared_done == c->shared_rows,
          "/subtrees/counts counts %" PRIu64 " rows of /subtrees/shared_chunks, which has %" PRIu64,
          c->shared_done, c->shared_rows);
}

ebpo_status ebpo_check_subtrees(ebpo_tally *tally, const ebpo_file *file,
                                const ebpo_reference_tree *view, const ebpo_verify_options *options,
                                ebpo_error *error)
{
    const ebpo_array_in *counts = ebpo_reader_array(file, EBPO_A_SUBTREE_COUNTS, 0),
                        *shared = ebpo_reader_array(file, EBPO_A_SUBTREE_SHARED, 0);
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_error failure = EBPO_ERROR_INIT;
    recount c = { .tally = tally, .view = view, .level = file->info.subtree_level };
    read.threads = options->threads;
    read.workspace = options->workspace;
    if (!c.level)
        return EBPO_OK;
    c.columns = counts->shape.cols;
    c.rows_of_chunk = counts->shape.chunk_rows;
    c.shared_rows = shared->present ? shared->shape.rows : 0;
    ebpo_status status = ebpo_reader_make(file, EBPO_A_SUBTREE_COUNTS, 0, &read, sizeof *c.counts,
                                          (void *)&c.counts, &failure);
    if (status == EBPO_OK)
        status = ebpo_reader_make(file, EBPO_A_SUBTREE_INDEX, 0, &read, sizeof *c.index,
                                  (void *)&c.index, &failure);
    if (status == EBPO_OK)
        recount_table(&c);
    ebpo_array_free(read.workspace, (void *)(uintptr_t)c.counts);
    ebpo_array_free(read.workspace, (void *)(uintptr_t)c.index);
    if (status != EBPO_E_FORMAT)
        return status == EBPO_OK ? EBPO_OK : ebpo_fail_with(error, &failure);
    CHECK(false, "%s", failure.message);
    return EBPO_OK;
}
