/* Verifies the table of subtrees (format-spec/README.md, section 9). Visits the whole tree once,
 * leaf by leaf in the order of the faces, and counts all items again.
 *
 * Every column of every row is recomputed: numbers of nodes, faces and vertices, and the chunks of
 * /mesh/faces and /mesh/vertices that a subtree needs from earlier subtrees. /subtrees/outer must
 * list exactly these chunks. As in the specification, these chunks are called *blocks* here; they
 * are not the blocks of eight faces.
 *
 * The writer and the reader of the library proceed level by level. This check is independent of
 * them: it shares only the reading of arrays with the reader. */
#include "verify/verify_parts.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "format/reader.h"

#define CHECK(condition, ...) ebpo_tally_check(tally, EBPO_VERIFY_STRUCTURE, condition, __VA_ARGS__)

/* Columns of the table, numbered as in the specification. The columns of the levels begin at
 * FIRST_LEVEL. GRAY to END_INCREASE are relative to the first column of a level. */
enum {
    FACES_BEFORE, /* faces between the previous subtree and this one */
    FACES,
    VERTICES_BEFORE,
    VERTICES,
    FACE_BLOCKS,   /* number of blocks of faces that the subtree needs from earlier subtrees */
    VERTEX_BLOCKS, /* number of such blocks of vertices */
    FIRST_LEVEL,
    GRAY = 0,
    LEAF,
    BLACK,
    PLANES,
    LEAF_PLANES,
    REFERENCES,
    END_INCREASE, /* increase of the end of the new faces (one past the last) in the level */
    OF_A_LEVEL,   /* number of columns of a level */
    MAX_COLS = FIRST_LEVEL + OF_A_LEVEL * EBPO_LEVELS_MAX
};
/* number of rows of a block of faces, and of a block of vertices */
enum { ROWS_OF_FACES = 2048, ROWS_OF_VERTICES = 1024 };
/* number of subtrees after which unused pages of memory are released */
enum { SUBTREES_A_TIME = 128 };
static const char *const names[] = { "faces before the subtree",
                                     "faces",
                                     "vertices before the subtree",
                                     "vertices",
                                     "blocks of faces",
                                     "blocks of vertices" };
static const char *const level_names[] = { "gray nodes",
                                           "leaves",
                                           "black nodes",
                                           "planes",
                                           "leaf planes",
                                           "references",
                                           "increase of the end of new faces" };

/* A list of indices of faces or numbers of blocks. */
typedef struct numbers {
    uint32_t *at;
    uint64_t count, capacity;
    uint64_t different; /* number of different items when add_block last removed duplicates */
} numbers;

/* The visit of the tree, and the counts so far. */
typedef struct recount {
    ebpo_tally *tally;
    const ebpo_reference_tree *view;
    int level; /* level of the subtrees' roots */
    /* the arrays of /subtrees, as stored */
    unsigned cols, rows_of_chunk; /* number of columns of `counts`, and of rows of its chunks */
    const uint32_t *counts, *shared;
    const uint64_t *index;
    uint64_t subtrees, shared_rows; /* shared_rows: number of rows of `shared` */
    /* numbers of subtrees, faces and vertices so far */
    uint64_t subtree, faces, vertices;
    uint64_t shared_done;          /* number of compared rows of `shared` */
    uint64_t end[EBPO_LEVELS_MAX]; /* end of the new faces, by level */
    /* for each column: sum over all subtrees before the current one; count in the current one */
    uint64_t sum[MAX_COLS], row[MAX_COLS];
    bool within;        /* the visit is within a subtree */
    numbers references; /* of the leaves of the current subtree, to faces of any subtree */
    bool no_memory;
} recount;

/* Appends a number, unless it is equal to the last one. Returns false if there is no memory. */
static bool add_number(ebpo_workspace *workspace, numbers *list, uint32_t number)
{
    if (list->count && list->at[list->count - 1] == number)
        return true;
    if (!ebpo_array_grow_late(workspace, &list->at, &list->capacity, list->count + 1,
                              sizeof *list->at))
        return false;
    list->at[list->count++] = number;
    return true;
}

static int compare_numbers(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

/* Sorts the list and removes duplicates. */
static void sort_once(numbers *list)
{
    uint64_t kept = 0;
    if (list->count)
        qsort(list->at, list->count, sizeof *list->at, compare_numbers);
    for (uint64_t i = 0; i < list->count; i++)
        if (!kept || list->at[kept - 1] != list->at[i])
            list->at[kept++] = list->at[i];
    list->count = kept;
}

/* Appends a block's number, which may be in the list already. Removes duplicates from time to time.
 * Returns false if there is no memory. */
static bool add_block(numbers *list, uint32_t block)
{
    if (list->count >= 2 * list->different + 4096) {
        sort_once(list);
        list->different = list->count;
    }
    return add_number(NULL, list, block);
}

/* Returns the name of a column. *level: the column's level, or -1 if it belongs to no level. */
static const char *column_name(const recount *c, unsigned column, int *level)
{
    if (column < FIRST_LEVEL)
        return *level = -1, names[column];
    *level = c->level + 1 + (int)((column - FIRST_LEVEL) / OF_A_LEVEL);
    return level_names[(column - FIRST_LEVEL) % OF_A_LEVEL];
}

/* --- comparing a subtree with its row --- */

/* Compares the needed blocks with the next rows of /subtrees/outer. A row is `from` minus the
 * number of a block. The rows of a subtree ascend, so its blocks descend. what: name of the blocks'
 * array. `column` gets the number of blocks. */
static void compare_blocks(recount *c, const char *what, uint64_t from, const numbers *needed,
                           unsigned column)
{
    ebpo_tally *tally = c->tally;
    uint64_t first = c->shared_done, i = 0;
    for (; i < needed->count; i++)
        if (first + i >= c->shared_rows || c->shared[first + i] > from ||
            from - c->shared[first + i] != needed->at[needed->count - 1 - i])
            break;
    if (i < needed->count)
        CHECK(false,
              "/subtrees/outer, subtree %" PRIu64 ": needs block %" PRIu32
              " of %s, which is not the next entry of the list",
              c->subtree, needed->at[needed->count - 1 - i], what);
    else
        CHECK(true, "%s", "");
    c->row[column] = needed->count;
    c->shared_done += needed->count;
}

/* Adds the blocks of those vertices of a face whose indices are below first_vertex. */
static void note_vertices(recount *c, numbers *blocks, uint64_t face, uint64_t first_vertex)
{
    for (int k = 0; k < 3; k++) {
        uint32_t vertex = c->view->tree->mesh.faces[3 * face + (uint64_t)k];
        if (vertex < first_vertex && !add_block(blocks, vertex / ROWS_OF_VERTICES))
            c->no_memory = true;
    }
}

/* Finds the blocks that the current subtree needs from earlier subtrees, and compares them with
 * /subtrees/outer. */
static void check_blocks(recount *c)
{
    numbers faces = { 0 }, vertices = { 0 };
    uint64_t first_face = c->faces - c->row[FACES], first_vertex = c->vertices - c->row[VERTICES];
    EBPO_FOR_ITEMS_SCATTERED(c->view->workspace, i, 0, c->references.count)
        if (c->references.at[i] < first_face) {
            if (!add_block(&faces, c->references.at[i] / ROWS_OF_FACES))
                c->no_memory = true;
            note_vertices(c, &vertices, c->references.at[i], first_vertex);
        }
    EBPO_FOR_ITEMS(c->view->workspace, face, first_face, c->faces)
        note_vertices(c, &vertices, face, first_vertex);
    sort_once(&faces);
    sort_once(&vertices);
    compare_blocks(c, "/mesh/faces", first_face / ROWS_OF_FACES, &faces, FACE_BLOCKS);
    compare_blocks(c, "/mesh/vertices", first_vertex / ROWS_OF_VERTICES, &vertices, VERTEX_BLOCKS);
    free(faces.at);
    free(vertices.at);
    c->references.count = 0;
}

/* Compares the counts of the current subtree with its row, and begins a new row. */
static void check_row(recount *c)
{
    ebpo_tally *tally = c->tally;
    const uint32_t *stated = c->counts + c->subtree * c->cols;
    int level;
    if (c->view->has_mesh)
        check_blocks(c);
    for (unsigned k = 0; k < c->cols; k++) {
        const char *name = column_name(c, k, &level);
        if (c->subtree % c->rows_of_chunk == 0)
            CHECK(c->index[c->subtree / c->rows_of_chunk * c->cols + k] == c->sum[k],
                  "/subtrees/index, before subtree %" PRIu64 ", column %u (%s): states %" PRIu64
                  ", there are %" PRIu64,
                  c->subtree, k, name, c->index[c->subtree / c->rows_of_chunk * c->cols + k],
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

/* Counts the next `count` faces, which are new in a leaf, and the vertices that no earlier face
 * uses. */
static void count_faces(recount *c, uint64_t count)
{
    const ebpo_mesh *mesh = &c->view->tree->mesh;
    uint64_t seen = c->vertices;
    EBPO_FOR_ITEMS(c->view->workspace, i, 3 * c->faces, 3 * (c->faces + count))
        seen += mesh->faces[i] == seen;
    c->row[c->within ? FACES : FACES_BEFORE] += count;
    c->row[c->within ? VERTICES : VERTICES_BEFORE] += seen - c->vertices;
    c->faces += count;
    c->vertices = seen;
}

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
        const uint32_t *face = ebpo_reference_refs(c->view, leaf, &references);
        uint64_t end = level->leaf_first[leaf->rank] + level->leaf_new[leaf->rank];
        EBPO_FOR_ITEMS(c->view->workspace, i, 0, references)
            if (!add_number(c->view->workspace, &c->references, face[i]))
                c->no_memory = true;
        row[REFERENCES] += references;
        row[END_INCREASE] += end - c->end[leaf->cell.level];
        c->end[leaf->cell.level] = end;
    }
    /* ebpo_check_structure checks that the leaves' new faces are consecutive */
    if (c->faces + level->leaf_new[leaf->rank] <= c->view->tree->mesh.face_count)
        count_faces(c, level->leaf_new[leaf->rank]);
}

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

static ebpo_status recount_table(recount *c, ebpo_error *error)
{
    ebpo_tally *tally = c->tally;
    ebpo_reference_node root = ebpo_reference_root(c->view);
    visit_node(c, &root);
    CHECK(c->shared_done == c->shared_rows,
          "/subtrees/outer has %" PRIu64 " rows, but %" PRIu64 " blocks are needed", c->shared_rows,
          c->shared_done);
    ebpo_array_free(c->view->workspace, c->references.at);
    return c->no_memory ? ebpo_workspace_fail_while(c->view->workspace, "counting subtrees", error)
                        : EBPO_OK;
}

ebpo_status ebpo_check_subtrees(ebpo_tally *tally, const ebpo_file *file,
                                const ebpo_reference_tree *view, const ebpo_verify_options *options,
                                ebpo_error *error)
{
    const ebpo_array_in *counts = ebpo_reader_array(file, EBPO_A_SUBTREE_COUNTS, 0),
                        *shared = ebpo_reader_array(file, EBPO_A_SUBTREE_SHARED, 0);
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_error own = EBPO_ERROR_INIT;
    recount c = { .tally = tally, .view = view, .level = file->info.subtree_level };
    read.threads = options->threads;
    read.workspace = options->workspace;
    if (!c.level)
        return EBPO_OK;
    c.cols = counts->shape.cols;
    c.rows_of_chunk = counts->shape.chunk_rows;
    c.shared_rows = shared->present ? shared->shape.rows : 0;
    ebpo_status status = ebpo_reader_make(file, EBPO_A_SUBTREE_COUNTS, 0, &read, sizeof *c.counts,
                                          (void *)&c.counts, &own);
    if (status == EBPO_OK)
        status = ebpo_reader_make(file, EBPO_A_SUBTREE_INDEX, 0, &read, sizeof *c.index,
                                  (void *)&c.index, &own);
    if (status == EBPO_OK)
        status = ebpo_reader_make(file, EBPO_A_SUBTREE_SHARED, 0, &read, sizeof *c.shared,
                                  (void *)&c.shared, &own);
    if (status == EBPO_OK)
        status = recount_table(&c, &own);
    ebpo_array_free(read.workspace, (void *)(uintptr_t)c.counts);
    ebpo_array_free(read.workspace, (void *)(uintptr_t)c.index);
    ebpo_array_free(read.workspace, (void *)(uintptr_t)c.shared);
    if (status != EBPO_E_FORMAT)
        return status == EBPO_OK ? EBPO_OK : ebpo_fail_with(error, &own);
    CHECK(false, "%s", own.message);
    return EBPO_OK;
}
