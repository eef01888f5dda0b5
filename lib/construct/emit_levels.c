/* Turns finished pieces (subtrees that one thread builds) into the arrays of the levels.
 *
 * A depth-first walk of a piece visits the nodes of each level in the order of octcodes (locational
 * codes), so the piece's part of each array is one contiguous range, called a stretch. Stretches
 * are joined in the depth-first order of the pieces, which is also the order of octcodes. The nodes
 * of the top (the nodes above the pieces) have separate stretches. A leaf's references are the
 * faces in its list that an earlier leaf also lists. Until all pieces are done, references are the
 * faces' indices in the arranged mesh ("along the curve"), because the final indices of other
 * pieces' faces are not known yet.
 *
 * Arrays that the options exclude, and optional arrays with only default values, are omitted.
 * Volumes are added in a fixed order, so the number of threads does not change the result. */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "construct/planes.h"
#include "construct/construct_stages.h"
#include "construct/pieces.h"
#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "geometry/level_nodes.h"
#include "geometry/polytope.h"

/* --- a piece's stretches --- */

struct ebpo_emit_scratch {
    ebpo_envelope_scratch *envelope;
    ebpo_triangle *faces; /* faces of the leaf whose planes are being chosen */
    uint64_t faces_capacity;
    ebpo_workspace *workspace;
    /* [level][3] for the gray node of this level on the path: half of its envelope (cut along z), a
     * quarter (cut along z and y), and the envelope cut to a child's cell. These polytopes are too
     * large for the stack. NULL until needed. */
    ebpo_polytope (*half[EBPO_LEVELS_MAX])[3];
};

typedef struct emitter {
    const ebpo_builder *b;
    ebpo_branch *s; /* the piece */
    ebpo_emit_scratch *scratch;
    uint32_t next; /* final index of the next new face */
} emitter;

ebpo_status ebpo_emit_scratch_make(ebpo_emit_scratch **out, ebpo_workspace *workspace,
                                   ebpo_error *error)
{
    *out = ebpo_alloc_zero(1, sizeof **out);
    ebpo_status status =
        *out ? ebpo_scratch_make(&(*out)->envelope, error) : ebpo_fail_memory(error, sizeof **out);
    if (status != EBPO_OK) {
        free(*out);
        *out = NULL;
    } else {
        (*out)->workspace = workspace;
    }
    return status;
}

void ebpo_emit_scratch_free(ebpo_emit_scratch *scratch)
{
    if (!scratch)
        return;
    ebpo_scratch_free(scratch->envelope);
    ebpo_array_free(scratch->workspace, scratch->faces);
    for (int level = 0; level < EBPO_LEVELS_MAX; level++)
        free(scratch->half[level]);
    free(scratch);
}

/* Makes space for one more leaf with `refs` references. Returns false when out of memory. */
static bool grow_leaf_arrays(ebpo_piece_level *out, uint64_t refs)
{
    ebpo_level *l = &out->level;
    uint64_t n = l->leaf_count + 1, *c = out->capacity;
#define GROW(array, ID, need) \
    ebpo_array_grow_late(l->workspace, &l->array, &c[EBPO_A_##ID], need, sizeof *l->array)
    return GROW(leaf_winding, LEAF_WINDING, n) && GROW(leaf_first, LEAF_SKIP, n) &&
           GROW(leaf_new, LEAF_NEW, n) && GROW(leaf_ref_count, LEAF_REF_COUNT, n) &&
           GROW(leaf_plane_counts, LEAF_PLANE_COUNTS, n) &&
           GROW(leaf_refs, LEAF_REFS, l->ref_count + refs);
#undef GROW
}

/* Adds a leaf without faces. `next`: number of faces that leaves before it list; `volume`: volume
 * of its envelope. Returns false when out of memory. */
static bool add_empty_leaf(ebpo_piece_level *out, int32_t winding, uint32_t next, double volume)
{
    ebpo_level *l = &out->level;
    if (!grow_leaf_arrays(out, 0))
        return false;
    l->leaf_winding[l->leaf_count] = winding;
    l->leaf_first[l->leaf_count] = next;
    l->leaf_new[l->leaf_count] = 0;
    l->leaf_ref_count[l->leaf_count] = 0;
    l->leaf_plane_counts[l->leaf_count++] = 0;
    l->leaf_volume += volume;
    return true;
}

/* Adds a leaf's winding number, range of new faces, and references. Returns false when out of
 * memory. */
static bool emit_list(emitter *e, const ebpo_build_detail *d, ebpo_piece_level *out,
                      int32_t winding)
{
    ebpo_level *l = &out->level;
    uint64_t refs = d->entry_end - d->entry_begin - d->new_count;
    if (!grow_leaf_arrays(out, refs))
        return false;
    l->leaf_winding[l->leaf_count] = winding;
    l->leaf_first[l->leaf_count] = d->first;
    l->leaf_new[l->leaf_count] = d->new_count;
    l->leaf_ref_count[l->leaf_count] = (uint32_t)refs;
    for (uint64_t i = d->entry_begin, ref = l->ref_count; i < d->entry_end; i++) {
        uint32_t entry = e->s->entries[i], face = e->s->list[entry];
        if (!(e->s->fresh[entry / 8] >> entry % 8 & 1) || e->b->final_index[face] < d->first)
            l->leaf_refs[ref++] = face;
    }
    l->ref_count += refs;
    l->new_count += d->new_count;
    e->next = d->first + d->new_count;
    return true;
}

/* Sets scratch->faces to the faces of a leaf. Returns false when out of memory. */
static bool gather_faces(emitter *e, const ebpo_build_detail *d)
{
    ebpo_emit_scratch *scratch = e->scratch;
    uint64_t count = d->entry_end - d->entry_begin;
    if (!ebpo_array_grow_late(e->b->workspace, &scratch->faces, &scratch->faces_capacity, count,
                              sizeof *scratch->faces))
        return false;
    for (uint64_t i = 0; i < count; i++)
        ebpo_branch_triangle(e->b, e->s, e->s->entries[d->entry_begin + i], &scratch->faces[i]);
    return true;
}

/* Sets `codes` to the planes of a leaf, for a file that stores leaf planes, and cuts the envelope
 * by them. (If leaf planes are not stored, readers derive planes from the faces.) Returns the
 * number of planes, or -1 when out of memory. */
static int leaf_planes(emitter *e, uint32_t detail, ebpo_cell cell, int32_t winding,
                       ebpo_polytope *envelope, uint32_t *codes)
{
    const ebpo_builder *b = e->b;
    const ebpo_build_detail *d = &e->s->details[detail];
    int count;
    const uint32_t *proposed = ebpo_proposed(e->s, detail, &count);
    if (!proposed && !gather_faces(e, d))
        return -1;
    if (!proposed)
        return ebpo_leaf_planes(&b->box, cell, e->scratch->faces, d->entry_end - d->entry_begin,
                                ebpo_leaf_corners(b, cell, winding, d->delta), b->options->epsilon,
                                envelope, codes);
    memcpy(codes, proposed, (size_t)count * sizeof *codes);
    ebpo_planes_cut(envelope, codes, (uint64_t)count);
    return count;
}

/* The functions emit_leaf, emit_empty, emit_gray and emit_node add a node and all nodes below to
 * the piece's stretches. `winding`: winding number at the lowest corner of the cell. `envelope`: on
 * entry, the parent's envelope cut to the cell; the functions change this polytope. They return
 * false when out of memory. */
static bool emit_leaf(emitter *e, uint32_t detail, ebpo_cell cell, int32_t winding,
                      ebpo_polytope *envelope)
{
    const ebpo_builder *b = e->b;
    const ebpo_build_detail *d = &e->s->details[detail];
    ebpo_piece_level *out = &e->s->out[cell.level];
    ebpo_level *l = &out->level;
    if (!emit_list(e, d, out, winding))
        return false;
    uint32_t codes[EBPO_PLANES_STORED];
    bool stored = b->options->parts & EBPO_PART_LEAF_PLANES;
    int planes = stored ? leaf_planes(e, detail, cell, winding, envelope, codes) : 0;
    if (planes < 0)
        return false;
    l->leaf_volume += ebpo_polytope_volume(envelope) * ebpo_cell_volume(&b->box, cell.level);
    l->leaf_plane_counts[l->leaf_count++] = (uint8_t)planes;
    if (!stored)
        return true;
    if (!ebpo_array_grow_late(l->workspace, &l->leaf_planes, &out->capacity[EBPO_A_LEAF_PLANES],
                              l->leaf_plane_count + (uint64_t)planes, sizeof *l->leaf_planes))
        return false;
    if (planes)
        memcpy(l->leaf_planes + l->leaf_plane_count, codes, (size_t)planes * sizeof *codes);
    l->leaf_plane_count += (uint64_t)planes;
    return true;
}

/* Adds a node without faces, which has the type `type` in the file. */
static bool emit_empty(emitter *e, ebpo_node_type type, ebpo_cell cell, int32_t winding,
                       const ebpo_polytope *envelope)
{
    ebpo_piece_level *out = &e->s->out[cell.level];
    return type == EBPO_LEAF ? add_empty_leaf(out, winding, e->next,
                                              ebpo_polytope_volume(envelope) *
                                                  ebpo_cell_volume(&e->b->box, cell.level))
                             : ebpo_piece_level_add_empty(out, type == EBPO_BLACK, winding);
}

static bool emit_node(emitter *e, uint32_t index, ebpo_node_type type, ebpo_cell cell,
                      int32_t winding, ebpo_polytope *envelope);

/* Emits the children in the order of octants. Their envelopes are cut from halves and quarters of
 * the node's envelope, which neighbours share. If a half becomes empty by rounding errors,
 * ebpo_polytope_half replaces it by the whole cube: an envelope may be too large, never too small.
 */
static bool emit_children(emitter *e, uint32_t child, uint16_t types, ebpo_cell cell,
                          int32_t winding, const int32_t offset[8], const ebpo_polytope *envelope)
{
    unsigned filled = 0; /* bit o: child o is gray or a leaf */
    for (unsigned o = 0; o < 8; o++)
        filled |= (unsigned)(ebpo_group_type(types, o) >= EBPO_LEAF) << o;
    ebpo_polytope(**half)[3] = &e->scratch->half[cell.level];
    if (!*half && !(*half = ebpo_alloc(1, sizeof **half)))
        return false;
    ebpo_polytope *z = **half, *y = z + 1, *x = z + 2;
    for (unsigned o = 0; o < 8; o++) {
        if (o % 4 == 0 && filled >> o & 15)
            ebpo_polytope_half(envelope, 2, o >> 2 & 1, z);
        if (o % 2 == 0 && filled >> o & 3)
            ebpo_polytope_half(z, 1, o >> 1 & 1, y);
        if (filled >> o & 1)
            ebpo_polytope_half(y, 0, o & 1, x);
        if (!emit_node(e, child + o, ebpo_group_type(types, o), ebpo_cell_child(cell, o),
                       winding + offset[o], x))
            return false;
    }
    return true;
}

static bool emit_gray(emitter *e, const ebpo_build_node *node, ebpo_cell cell, int32_t winding,
                      ebpo_polytope *envelope)
{
    const ebpo_builder *b = e->b;
    uint32_t codes[EBPO_PLANES_STORED];
    int planes = 0;
    if (e->s->out[cell.level].level.gray_count % EBPO_ITEMS_SCATTERED == 0)
        ebpo_release_pages(b->workspace);
    if (b->options->parts & EBPO_PART_PLANES)
        planes = ebpo_gray_planes(b, e->scratch->envelope, e->s, node->detail, cell, winding,
                                  envelope, codes);
    if (planes < 0 || !ebpo_piece_level_add_gray(&e->s->out[cell.level], codes, planes,
                                                 ebpo_polytope_volume(envelope) *
                                                     ebpo_cell_volume(&b->box, cell.level)))
        return false;
    int32_t offset[8];
    ebpo_child_windings(b, e->s, cell, node->child, offset);
    uint16_t types = 0;
    for (uint32_t o = 0; o < 8; o++) {
        ebpo_node_type type = e->s->nodes[node->child + o].type;
        if (type == EBPO_WHITE)
            type = ebpo_empty_type(b, ebpo_cell_child(cell, o), winding + offset[o]);
        types |= ebpo_group_of(type, o);
    }
    if (!ebpo_piece_level_add_group(&e->s->out[cell.level + 1], types))
        return false;
    return emit_children(e, node->child, types, cell, winding, offset, envelope);
}

static bool emit_node(emitter *e, uint32_t index, ebpo_node_type type, ebpo_cell cell,
                      int32_t winding, ebpo_polytope *envelope)
{
    ebpo_build_node node = e->s->nodes[index];
    switch (node.type) {
    case EBPO_LEAF: return emit_leaf(e, node.detail, cell, winding, envelope);
    case EBPO_GRAY: return emit_gray(e, &node, cell, winding, envelope);
    default: return emit_empty(e, type, cell, winding, envelope);
    }
}

ebpo_status ebpo_emit_piece(const ebpo_builder *b, ebpo_emit_scratch *scratch, ebpo_branch *s,
                            ebpo_error *error)
{
    emitter e = { b, s, scratch, (uint32_t)s->first };
    ebpo_node_type type = s->nodes[0].type;
    if (type == EBPO_WHITE)
        type = ebpo_empty_type(b, s->cell, s->winding);
    s->out = ebpo_array_zero(b->workspace, EBPO_LEVELS_MAX, sizeof *s->out);
    for (int level = 0; s->out && level < EBPO_LEVELS_MAX; level++)
        s->out[level].level.workspace = b->workspace;
    if (!s->out || !emit_node(&e, 0, type, s->cell, s->winding, s->above))
        return ebpo_workspace_fail_while(b->workspace, "while computing envelopes", error);
    return EBPO_OK;
}

/* --- joining the stretches --- */

enum { JOIN_GRAIN = 64 }; /* number of stretches of a parallel task */

typedef struct joiner {
    ebpo_builder *b;
    /* [count][EBPO_LEVELS_MAX] stretches of pieces and of the top, depth first */
    ebpo_piece_level **stretch;
    uint64_t count, capacity;
    ebpo_piece_level *current; /* stretches of the top, if they are the last ones so far; NULL: the
                                * last ones are those of a piece */
    ebpo_level *level;         /* [EBPO_LEVELS_MAX] result */
    bool has[EBPO_LEVELS_MAX][EBPO_LEVEL_ARRAYS]; /* true: a stretch has this array */
    /* [block of JOIN_GRAIN stretches][level][unit] counts of the blocks before */
    uint64_t (*first)[EBPO_LEVELS_MAX][EBPO_PER_GROUP + 1];
    uint32_t next; /* final index of the next new face */
} joiner;

static const char stage[] = "joining levels";

static ebpo_status no_memory(const ebpo_builder *b, ebpo_error *error)
{
    return ebpo_workspace_fail_while(b->workspace, "while joining levels", error);
}

static bool push_stretch(joiner *j, ebpo_piece_level *out)
{
    if (!ebpo_grow(&j->stretch, &j->capacity, j->count + 1, sizeof *j->stretch))
        return false;
    j->stretch[j->count++] = out;
    return true;
}

/* Returns the stretches for the next node of the top, or NULL when out of memory. */
static ebpo_piece_level *current_stretch(joiner *j)
{
    if (j->current)
        return j->current;
    ebpo_piece_level *out = ebpo_array_zero(j->b->workspace, EBPO_LEVELS_MAX, sizeof *out);
    if (!out || !push_stretch(j, out)) {
        ebpo_array_free(j->b->workspace, out);
        return NULL;
    }
    for (int level = 0; level < EBPO_LEVELS_MAX; level++)
        out[level].level.workspace = j->b->workspace;
    return j->current = out;
}

/* Returns the type that the file stores for a node of the top. */
static ebpo_node_type type_of(const ebpo_builder *b, const ebpo_build_node *n, ebpo_cell cell,
                              int32_t winding)
{
    ebpo_node_type type = n->type == EBPO_LEAF ? b->piece[n->detail].root_type : n->type;
    return type == EBPO_WHITE ? ebpo_empty_type(b, cell, winding) : type;
}

/* Appends to the list the stretches below a node: those of its pieces and, between them, stretches
 * with the nodes of the top. `type`: the node's type in the file; `volume`: volume of its envelope,
 * if it is a leaf without faces. Returns false when out of memory. */
static bool collect_stretches(joiner *j, uint32_t index, ebpo_node_type type, ebpo_cell cell,
                              int32_t winding, double volume)
{
    ebpo_builder *b = j->b;
    ebpo_build_node node = b->top.nodes[index];
    if (node.type == EBPO_LEAF) {
        ebpo_branch *piece = &b->piece[node.detail];
        ebpo_piece_level *out = piece->out;
        piece->out = NULL;
        j->next = (uint32_t)(piece->first + piece->fresh_count);
        if (!push_stretch(j, out)) {
            ebpo_piece_levels_free(out);
            return false;
        }
        j->current = NULL;
        return true;
    }
    ebpo_piece_level *out = current_stretch(j);
    if (!out)
        return false;
    if (type == EBPO_LEAF)
        return add_empty_leaf(&out[cell.level], winding, j->next, volume);
    if (node.type == EBPO_WHITE)
        return ebpo_piece_level_add_empty(&out[cell.level], type == EBPO_BLACK, winding);
    const ebpo_top_envelope *t = &b->top_envelope[node.detail];
    int32_t offset[8];
    ebpo_child_windings(b, &b->top, cell, node.child, offset);
    uint16_t types = 0;
    for (uint32_t o = 0; o < 8; o++)
        types |= ebpo_group_of(type_of(b, &b->top.nodes[node.child + o], ebpo_cell_child(cell, o),
                                       winding + offset[o]),
                               o);
    if (!ebpo_piece_level_add_gray(&out[cell.level], t->codes, t->count, t->volume) ||
        !ebpo_piece_level_add_group(&out[cell.level + 1], types))
        return false;
    for (uint32_t o = 0; o < 8; o++)
        if (!collect_stretches(j, node.child + o, ebpo_group_type(types, o),
                               ebpo_cell_child(cell, o), winding + offset[o], t->empty_volume[o]))
            return false;
    return true;
}

/* Adds the counts and volumes of all stretches to the joined levels, in the order of the stretches,
 * and sets j->first and j->has. */
static void add_up_stretches(joiner *j)
{
    EBPO_FOR_ITEMS_EVERY(j->b->workspace, JOIN_GRAIN, i, 0, j->count)
        for (int level = 0; level < EBPO_LEVELS_MAX; level++) {
            const ebpo_level *from = &j->stretch[i][level].level;
            ebpo_level *out = &j->level[level];
            for (int unit = 0; unit <= EBPO_PER_GROUP; unit++) {
                uint64_t before = ebpo_level_count(out, (ebpo_per)unit);
                if (i % JOIN_GRAIN == 0)
                    j->first[i / JOIN_GRAIN][level][unit] = before;
                ebpo_level_set_count(out, (ebpo_per)unit,
                                     before + ebpo_level_count(from, (ebpo_per)unit));
            }
            for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++)
                j->has[level][id] |= ebpo_schema_is_held(id) && ebpo_level_array(from, id);
            out->gray_volume += from->gray_volume;
            out->leaf_volume += from->leaf_volume;
        }
}

/* Allocates the arrays of the joined levels; omits arrays that no stretch has. Returns false when
 * out of memory. */
static bool alloc_levels(joiner *j)
{
    for (int level = 0; level < EBPO_LEVELS_MAX; level++)
        for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++) {
            uint64_t rows = j->has[level][id] ? ebpo_level_rows(&j->level[level], id) : 0;
            void *array =
                rows ? ebpo_array_alloc(j->b->workspace, rows, ebpo_schema[id].held_size) : NULL;
            if (rows && !array)
                return false;
            if (rows)
                ebpo_level_set_array(&j->level[level], id, array);
        }
    return true;
}

/* Fills a part of an array with the array's default value. */
static void fill_default(const joiner *j, char *to, uint64_t bytes, int id)
{
    /* copies the low bytes of `value`: the machine is little-endian, like the files */
    int64_t value = ebpo_schema[id].default_value;
    EBPO_FOR_ITEMS(j->b->workspace, i, 0, bytes / ebpo_schema[id].held_size)
        memcpy(to + i * ebpo_schema[id].held_size, &value, ebpo_schema[id].held_size);
}

/* Moves the arrays of a stretch of a level to the joined level. at[unit]: the stretch's first row
 * in the arrays with one row for each `unit`; this function adds the stretch's counts. */
static void join_stretch(const joiner *j, ebpo_piece_level *stretch, const ebpo_level *out,
                         uint64_t at[EBPO_PER_GROUP + 1])
{
    ebpo_level *from = &stretch->level;
    for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++) {
        if (!ebpo_schema_is_held(id))
            continue;
        void *array = ebpo_level_array(from, id);
        char *to = ebpo_level_array(out, id);
        uint64_t size = ebpo_schema[id].held_size, bytes = ebpo_level_rows(from, id) * size;
        if (to)
            to += at[ebpo_schema[id].per] * size;
        if (to && array)
            ebpo_array_copy(j->b->workspace, to, array, bytes);
        else if (to) /* a stretch in which all elements have the default value */
            fill_default(j, to, bytes, id);
        if (!stretch->packed)
            ebpo_array_free(j->b->workspace, array);
        ebpo_level_set_array(from, id, NULL);
    }
    for (int unit = 0; unit <= EBPO_PER_GROUP; unit++)
        at[unit] += ebpo_level_count(from, (ebpo_per)unit);
}

/* Joins stretches begin .. end - 1 of all levels, and frees them. One pass over the stretches is
 * enough: they may be in files, and each pass would read these files again. */
static ebpo_status join_stretches(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                  ebpo_error *error)
{
    joiner *j = context;
    uint64_t at[EBPO_LEVELS_MAX][EBPO_PER_GROUP + 1];
    (void)worker, (void)error;
    memcpy(at, j->first[begin / JOIN_GRAIN], sizeof at);
    EBPO_FOR_ITEMS_EVERY(j->b->workspace, 1, i, begin, end) {
        for (int level = 0; level < EBPO_LEVELS_MAX; level++)
            join_stretch(j, &j->stretch[i][level], &j->level[level], at[level]);
        ebpo_piece_levels_free(j->stretch[i]);
        j->stretch[i] = NULL;
    }
    return EBPO_OK;
}

static int compare_indices(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

/* Sorts a list of indices. Most lists of leaves are short, and short lists are sorted by insertion.
 */
static void sort_indices(uint32_t *a, uint64_t n)
{
    static const uint64_t short_list = 32;
    if (n > short_list) {
        qsort(a, n, sizeof *a, compare_indices);
        return;
    }
    for (uint64_t i = 1; i < n; i++) {
        uint32_t v = a[i];
        uint64_t j = i;
        for (; j > 0 && a[j - 1] > v; j--)
            a[j] = a[j - 1];
        a[j] = v;
    }
}

enum { LEAF_GRAIN = 1 << 13 }; /* number of leaves of a parallel task */

/* The job of replacing the indices in a level's leaf_refs. */
typedef struct numbering {
    const ebpo_builder *b;
    ebpo_level *level;
    /* [block of LEAF_GRAIN leaves] index in leaf_refs of the block's first reference */
    uint64_t *first;
} numbering;

/* Replaces the indices along the curve by final indices in the references of a block of leaves. */
static ebpo_status number_block(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                ebpo_error *error)
{
    numbering *n = context;
    ebpo_level *l = n->level;
    uint32_t *refs = l->leaf_refs + n->first[begin / LEAF_GRAIN];
    (void)worker, (void)error;
    EBPO_FOR_ITEMS_SCATTERED(n->b->workspace, i, begin, end) {
        for (uint32_t k = 0; k < l->leaf_ref_count[i]; k++)
            refs[k] = n->b->final_index[refs[k]];
        sort_indices(refs, l->leaf_ref_count[i]);
        refs += l->leaf_ref_count[i];
    }
    return EBPO_OK;
}

/* Replaces the indices along the curve in a level's leaf_refs by final indices. `all` is the number
 * of references of all levels, of which `before` are done; both are used only to report progress.
 */
static ebpo_status number_refs(const ebpo_builder *b, ebpo_level *l, uint64_t before, uint64_t all,
                               ebpo_error *error)
{
    if (!l->ref_count)
        return EBPO_OK;
    numbering n = { b, l, ebpo_alloc(l->leaf_count / LEAF_GRAIN + 1, sizeof *n.first) };
    if (!n.first)
        return no_memory(b, error);
    uint64_t refs = 0;
    EBPO_FOR_ITEMS(b->workspace, i, 0, l->leaf_count) {
        if (i % LEAF_GRAIN == 0)
            n.first[i / LEAF_GRAIN] = refs;
        refs += l->leaf_ref_count[i];
    }
    ebpo_pass pass = { &b->options->progress, all + before, all + before + l->ref_count, 2 * all };
    ebpo_progress progress = ebpo_pass_progress(&pass);
    ebpo_status status = ebpo_parallel_for(b->threads, NULL, l->leaf_count, LEAF_GRAIN,
                                           number_block, &n, &progress, stage, error);
    free(n.first);
    return status;
}

/* Frees a level's arrays of unwanted parts, and arrays that have only default values. */
static void omit_arrays(const ebpo_builder *b, ebpo_level *l)
{
    uint32_t parts = b->options->parts;
    ebpo_level_drop(l, ~(parts | (b->solid ? EBPO_NEEDS_SOLID : 0) | EBPO_NEEDS_ALWAYS));
    for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++)
        if (ebpo_schema[id].if_needed && ebpo_level_is_default(l, id)) {
            ebpo_array_free(l->workspace, ebpo_level_array(l, id));
            ebpo_level_set_array(l, id, NULL);
        }
    if (!(parts & EBPO_PART_MESH))
        l->ref_count = l->new_count = 0;
}

/* Replaces the references of a level by final indices, and omits arrays. `before`, `all`: as for
 * number_refs. */
static ebpo_status finish_level(const joiner *j, int level, uint64_t before, uint64_t all,
                                ebpo_error *error)
{
    ebpo_level *out = &j->level[level];
    ebpo_status status = j->b->options->parts & EBPO_PART_MESH
                             ? number_refs(j->b, out, before, all, error)
                             : EBPO_OK;
    omit_arrays(j->b, out);
    return status;
}

/* Adds the group of level 0, which holds only the type of the root. */
static bool root_group(joiner *j)
{
    ebpo_builder *b = j->b;
    /* the group goes to a stretch of the top, because the arrays of a piece's stretch may be in the
     * store, where they cannot grow */
    ebpo_piece_level *first = current_stretch(j);
    return first && ebpo_piece_level_add_group(&first[0], (uint16_t)type_of(b, &b->top.nodes[0],
                                                                            b->top.cell, 0));
}

ebpo_status ebpo_build_levels(ebpo_builder *b, ebpo_tree *out, ebpo_error *error)
{
    joiner j = { .b = b, .level = out->level };
    ebpo_status status =
        root_group(&j) && collect_stretches(&j, 0, b->top.nodes[0].type, b->top.cell, 0, 0)
            ? EBPO_OK
            : no_memory(b, error);
    uint64_t blocks = j.count / JOIN_GRAIN + 1, refs = 0, all = 0;
    j.first = status == EBPO_OK ? ebpo_array_alloc(b->workspace, blocks, sizeof *j.first) : NULL;
    if (j.first)
        add_up_stretches(&j);
    if (status == EBPO_OK && (!j.first || !alloc_levels(&j)))
        status = no_memory(b, error);
    for (int level = 0; level < EBPO_LEVELS_MAX; level++)
        all += out->level[level].ref_count;
    ebpo_pass pass = { &b->options->progress, 0, all, 2 * all };
    ebpo_progress progress = ebpo_pass_progress(&pass);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(b->threads, NULL, j.count, JOIN_GRAIN, join_stretches, &j,
                                   &progress, stage, error);
    for (int level = 0; level < EBPO_LEVELS_MAX && status == EBPO_OK; level++) {
        uint64_t refs_of_level = out->level[level].ref_count;
        status = finish_level(&j, level, refs, all, error);
        refs += refs_of_level;
        if (out->level[level].group_count)
            out->info.level_count = level + 1;
        out->info.level[level] = ebpo_level_summarise(&out->level[level], ~0u);
    }
    for (uint64_t i = 0; i < j.count; i++)
        ebpo_piece_levels_free(j.stretch[i]);
    free(j.stretch);
    ebpo_array_free(b->workspace, j.first);
    ebpo_store_free(b->store);
    b->store = NULL;
    return status;
}
