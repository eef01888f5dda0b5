/* Visits the nodes of the tree from the root down, with the faces that touch each node, and checks
 * containment, lists and labels of each node.
 *
 * Nodes with many faces are visited first, one after the other; their faces are distributed to all
 * threads. The subtree below each of the other nodes is visited by one thread, depth first. Every
 * face is tested exactly against every cell that its bounding box intersects. The points for the
 * check by rays are collected during the visit, and their winding numbers are computed at the end.
 * The tally does not depend on the number of threads. */
#include "core/strict_fp.h"

#include "verify/verify_parts.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/workspace.h"
#include "verify/verify_geometry.h"
#include "verify/verify_labels.h"

enum {
    FACE_GRAIN = 4096, /* number of faces for each call of a thread's function */
    /* The maximum number of faces of a subtree that one thread visits is the number of all faces
     * divided by SUBTREES_WANTED, but at least SUBTREE_FACES and at most SUBTREE_FACES_MAX. */
    SUBTREES_WANTED = 64,
    SUBTREE_FACES = 1024,
    SUBTREE_FACES_MAX = 1 << 18
};

/* A stack of face indices: the faces of a node, then the faces of its child, and so on down. */
typedef struct face_stack {
    uint32_t *faces;
    uint8_t *octants; /* for each face, a mask of the children that the face touches */
    uint64_t capacity;
} face_stack;

/* The state of one thread. */
typedef struct worker {
    ebpo_tally tally;
    face_stack stack;
    ebpo_node_planes planes;
    ebpo_ray_points points;
    uint64_t visited; /* number of faces visited since pages were released, plus 64 for each node */
} worker;

/* A node of the upper part of the tree, which is visited by all threads, or the root of a subtree.
 */
typedef struct upper_node {
    ebpo_reference_node node;
    uint32_t *faces; /* faces that touch the node; NULL after the node has been visited */
    uint64_t face_count;
    /* index in `upper` of the first of eight children; 0: the node is the root of a subtree */
    uint64_t children;
    ebpo_node_windings corners; /* winding numbers of the corners, set after the visit */
} upper_node;

typedef struct walk {
    const ebpo_reference_tree *view;
    const ebpo_verify_options *options;
    unsigned threads;
    ebpo_label_plan plan; /* cells to check by rays */
    bool rays;            /* cells are checked by rays */
    worker *workers;      /* [threads] */
    upper_node *upper;
    uint64_t upper_count, upper_capacity;
    uint64_t *subtrees; /* [subtree_count] indices in `upper` of the subtrees' roots */
    uint64_t subtree_count;
    uint64_t subtree_limit; /* maximum number of faces of a subtree's root */
    /* the node whose faces are distributed to all threads */
    const upper_node *shared;
    uint8_t *shared_octants; /* [face of `shared`] a mask of the children that the face touches */
} walk;

/* The cells of a gray node and of its children. */
typedef struct family {
    ebpo_frame self, child[8];
    double middle[3]; /* coordinates of the middle planes */
} family;

static void family_make(family *out, const ebpo_box *box, const ebpo_reference_node *node)
{
    out->self = ebpo_frame_make(box, node->cell);
    for (int k = 0; k < 3; k++)
        out->middle[k] = ebpo_cell_face(box, k, node->cell.level + 1, 2 * node->cell.at[k] + 1);
    for (unsigned octant = 0; octant < 8; octant++)
        for (int k = 0; k < 3; k++) {
            bool upper = octant >> k & 1;
            out->child[octant].low[k] = upper ? out->middle[k] : out->self.low[k];
            out->child[octant].high[k] = upper ? out->self.high[k] : out->middle[k];
            out->child[octant].inverse[k] = 2 * out->self.inverse[k];
        }
}

/* Returns a mask of the octants that the face's bounding box intersects. Here, an octant is the
 * intersection of three half-spaces that are bounded by the middle planes. */
static unsigned near_octants(const family *f, const ebpo_corners *face)
{
    static const uint8_t upper[3] = { 0xaa, 0xcc, 0xf0 };
    unsigned octants = 255;
    for (int k = 0; k < 3; k++) {
        double a = face->at[0][k], b = face->at[1][k], c = face->at[2][k], m = f->middle[k];
        if (a < m && b < m && c < m)
            octants &= ~upper[k];
        else if (a > m && b > m && c > m)
            octants &= upper[k];
    }
    return octants & 255;
}

/* Returns a mask of the children that a face of the node touches. */
static unsigned touched_octants(const family *f, const ebpo_corners *face, ebpo_tally *tally)
{
    unsigned near = near_octants(f, face), touched = 0;
    if ((near & (near - 1)) == 0)
        return near; /* the face touches the node, so it touches the only possible child */
    for (unsigned octant = 0; octant < 8; octant++)
        if (near >> octant & 1)
            touched |= (unsigned)ebpo_face_touches(&f->child[octant], face, tally) << octant;
    return touched;
}

/* Checks that the planes of a gray node cut off no part of the faces, and sets octants[i] to a mask
 * of the children that face i touches. */
static void visit_faces(const walk *w, worker *self, const ebpo_reference_node *node,
                        const family *f, const uint32_t *faces, uint8_t *octants, uint64_t count)
{
    for (uint64_t i = 0; i < count; i++) {
        ebpo_corners face;
        ebpo_face_corners(&w->view->tree->mesh, faces[i], &face);
        if (self->planes.count)
            ebpo_check_face_contained(&self->tally, &self->planes, node, &f->self, &face, faces[i]);
        octants[i] = (uint8_t)touched_octants(f, &face, &self->tally);
    }
    /* each visited face uses pages of the workspace; a node uses about as many as 64 faces */
    if ((self->visited += count + 64) >= 1 << 15) {
        self->visited = 0;
        ebpo_release_pages(w->options->workspace);
    }
}

/* Checks that a gray node has more faces than a leaf may list. `touching`: number of faces that
 * touch the node. */
static void check_face_limit(const walk *w, ebpo_tally *tally, const ebpo_reference_node *node,
                             uint64_t touching)
{
    uint64_t limit = w->view->tree->info.leaf_faces;
    if (limit == 0 || !w->view->has_mesh ||
        w->view->tree->info.pruned) /* a subset may lack leaves */
        return;
    tally->checks[EBPO_VERIFY_STRUCTURE]++;
    if (touching <= limit && !ebpo_lists_more_faces(w->view, node, limit))
        ebpo_tally_violation(tally, EBPO_VERIFY_STRUCTURE,
                             &(ebpo_verify_place){ node->code, EBPO_NO_FACE, EBPO_NO_PLANE },
                             "the node is gray, but its leaves list at most leaf_faces faces");
}

/* Checks the corners of a gray node, after its children have been visited. */
static void finish_gray(const walk *w, worker *self, const ebpo_reference_node *node,
                        const ebpo_node_windings children[8], ebpo_node_windings *corners)
{
    if (!w->view->tree->info.solid)
        return;
    ebpo_check_links(&self->tally, node, children, corners);
    unsigned inside = ebpo_windings_inside(w->view, corners);
    if (inside == 0)
        return;
    ebpo_node_planes_of(&self->planes, w->view, node);
    ebpo_check_corners_contained(&self->tally, &self->planes, node, inside);
}

/* Returns true if the node has no children in the file. */
static bool is_terminal(const walk *w, const ebpo_reference_node *node)
{
    return node->type != EBPO_GRAY || ebpo_reference_is_pruned(w->view, node);
}

/* Runs all checks of a leaf, white, black or pruned node. */
static ebpo_status walk_terminal(const walk *w, worker *self, const ebpo_reference_node *node,
                                 const uint32_t *faces, uint64_t count, ebpo_node_windings *corners,
                                 ebpo_error *error)
{
    const ebpo_reference_tree *view = w->view;
    ebpo_frame frame = ebpo_frame_make(&view->box, node->cell);
    if (view->has_mesh && node->type != EBPO_GRAY) /* a gray node in this function is pruned */
        ebpo_check_terminal_lists(&self->tally, view, node, faces, count);
    ebpo_node_planes_of(&self->planes, view, node);
    EBPO_FOR_ITEMS_SCATTERED(w->options->workspace, i, 0, self->planes.count ? count : 0) {
        ebpo_corners face;
        ebpo_face_corners(&view->tree->mesh, faces[i], &face);
        ebpo_check_face_contained(&self->tally, &self->planes, node, &frame, &face, faces[i]);
    }
    *corners = (ebpo_node_windings){ { 0 }, 0 };
    bool solid = view->tree->info.solid;
    if ((!solid && !w->rays) || node->type == EBPO_GRAY)
        return EBPO_OK;
    if (solid)
        ebpo_check_terminal_label(&self->tally, view, node);
    if (w->rays && !ebpo_label_note(&self->points, view, node, &frame, &w->plan))
        return ebpo_workspace_fail(w->options->workspace,
                                   self->points.count * sizeof *self->points.point, error);
    if (!solid)
        return EBPO_OK;
    ebpo_terminal_windings(corners, view, node, &frame, faces, count);
    if (self->planes.count)
        ebpo_check_corners_contained(&self->tally, &self->planes, node,
                                     ebpo_windings_inside(view, corners));
    return EBPO_OK;
}

/* Makes space for `need` faces on the stack. Returns false when out of memory. */
static bool stack_reserve(face_stack *s, uint64_t need)
{
    if (need <= s->capacity)
        return true;
    uint64_t capacity = need + need / 2 + 256;
    uint32_t *faces = ebpo_realloc(s->faces, capacity, sizeof *faces);
    if (faces)
        s->faces = faces;
    uint8_t *octants = faces ? ebpo_realloc(s->octants, capacity, 1) : NULL;
    if (!octants)
        return false;
    s->octants = octants;
    s->capacity = capacity;
    return true;
}

/* Visits a node and all nodes below it. The faces that touch the node are faces[first .. first +
 * count - 1] of the stack. */
static ebpo_status walk_down(const walk *w, worker *self, const ebpo_reference_node *node,
                             uint64_t first, uint64_t count, ebpo_node_windings *corners,
                             ebpo_error *error)
{
    face_stack *s = &self->stack;
    if (is_terminal(w, node))
        return walk_terminal(w, self, node, count ? s->faces + first : NULL, count, corners, error);
    if (!stack_reserve(s, first + 2 * count + 1)) /* at least 1, so that the stack is not NULL */
        return ebpo_fail_memory(error, (first + 2 * count) * 5);
    family f;
    family_make(&f, &w->view->box, node);
    ebpo_node_planes_of(&self->planes, w->view, node);
    visit_faces(w, self, node, &f, s->faces + first, s->octants + first, count);
    check_face_limit(w, &self->tally, node, count);
    ebpo_node_windings children[8];
    for (unsigned octant = 0; octant < 8; octant++) {
        uint64_t in_child = 0;
        for (uint64_t i = 0; i < count; i++)
            if (s->octants[first + i] >> octant & 1)
                s->faces[first + count + in_child++] = s->faces[first + i];
        ebpo_reference_node child = ebpo_reference_child(w->view, node, octant);
        ebpo_status status =
            walk_down(w, self, &child, first + count, in_child, &children[octant], error);
        if (status != EBPO_OK)
            return status;
    }
    finish_gray(w, self, node, children, corners);
    return EBPO_OK;
}

static ebpo_status shared_task(void *context, uint64_t begin, uint64_t end, unsigned number,
                               ebpo_error *error)
{
    (void)error;
    const walk *w = context;
    worker *self = &w->workers[number];
    family f;
    family_make(&f, &w->view->box, &w->shared->node);
    ebpo_node_planes_of(&self->planes, w->view, &w->shared->node);
    visit_faces(w, self, &w->shared->node, &f, w->shared->faces + begin, w->shared_octants + begin,
                end - begin);
    return EBPO_OK;
}

/* Appends a child to w->upper, with those faces of the parent that touch the child. */
static ebpo_status add_child(walk *w, uint64_t parent, unsigned octant, ebpo_error *error)
{
    const upper_node *from = &w->upper[parent];
    upper_node *to = &w->upper[w->upper_count];
    *to = (upper_node){ .node = ebpo_reference_child(w->view, &from->node, octant) };
    EBPO_FOR_ITEMS(w->options->workspace, i, 0, from->face_count)
        to->face_count += w->shared_octants[i] >> octant & 1;
    to->faces = ebpo_array_alloc(w->options->workspace, to->face_count, sizeof *to->faces);
    if (!to->faces)
        return ebpo_workspace_fail(w->options->workspace, to->face_count * sizeof *to->faces,
                                   error);
    uint64_t own = 0;
    EBPO_FOR_ITEMS(w->options->workspace, i, 0, from->face_count)
        if (w->shared_octants[i] >> octant & 1)
            to->faces[own++] = from->faces[i];
    w->upper_count++;
    return EBPO_OK;
}

/* Visits the upper node `at` with all threads, and appends its children. */
static ebpo_status open_node(walk *w, uint64_t at, ebpo_error *error)
{
    if (!ebpo_grow(&w->upper, &w->upper_capacity, w->upper_count + 8, sizeof *w->upper))
        return ebpo_fail_memory(error, (w->upper_count + 8) * sizeof *w->upper);
    upper_node *n = &w->upper[at];
    w->shared = n;
    w->shared_octants = ebpo_array_alloc(w->options->workspace, n->face_count, 1);
    if (!w->shared_octants)
        return ebpo_workspace_fail(w->options->workspace, n->face_count, error);
    ebpo_status status =
        ebpo_parallel_for(w->threads, NULL, n->face_count, FACE_GRAIN, shared_task, w,
                          &w->options->progress, "verifying upper levels", error);
    check_face_limit(w, &w->workers[0].tally, &n->node, n->face_count);
    n->children = w->upper_count;
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++)
        status = add_child(w, at, octant, error);
    ebpo_array_free(w->options->workspace, w->shared_octants);
    w->shared_octants = NULL;
    ebpo_array_free(w->options->workspace, n->faces);
    n->faces = NULL;
    return status;
}

static ebpo_status add_root(walk *w, ebpo_error *error)
{
    uint64_t count = w->view->has_mesh ? w->view->tree->mesh.face_count : 0;
    if (!ebpo_grow(&w->upper, &w->upper_capacity, 1, sizeof *w->upper))
        return ebpo_fail_memory(error, sizeof *w->upper);
    upper_node root = { .node = ebpo_reference_root(w->view),
                        .face_count = count,
                        .faces =
                            ebpo_array_alloc(w->options->workspace, count, sizeof *root.faces) };
    if (!root.faces)
        return ebpo_workspace_fail(w->options->workspace, count * sizeof *root.faces, error);
    EBPO_FOR_ITEMS(w->options->workspace, i, 0, count)
        root.faces[i] = (uint32_t)i;
    w->upper[0] = root;
    w->upper_count = 1;
    return EBPO_OK;
}

/* Visits the upper nodes, breadth first, from the root down to nodes with few faces. Collects the
 * roots of the subtrees. */
static ebpo_status walk_upper(walk *w, ebpo_error *error)
{
    ebpo_status status = add_root(w, error);
    for (uint64_t at = 0; at < w->upper_count && status == EBPO_OK; at++)
        if (!is_terminal(w, &w->upper[at].node) && w->upper[at].face_count > w->subtree_limit)
            status = open_node(w, at, error);
    if (status != EBPO_OK)
        return status;
    w->subtrees = ebpo_alloc(w->upper_count, sizeof *w->subtrees);
    if (!w->subtrees)
        return ebpo_fail_memory(error, w->upper_count * sizeof *w->subtrees);
    for (uint64_t at = 0; at < w->upper_count; at++)
        if (w->upper[at].children == 0)
            w->subtrees[w->subtree_count++] = at;
    return EBPO_OK;
}

/* Visits a subtree. If its root is a leaf, the root may have very many faces, so they are not
 * copied to the stack. */
static ebpo_status walk_subtree(const walk *w, worker *self, upper_node *n, ebpo_error *error)
{
    if (is_terminal(w, &n->node))
        return walk_terminal(w, self, &n->node, n->faces, n->face_count, &n->corners, error);
    if (!stack_reserve(&self->stack, n->face_count))
        return ebpo_fail_memory(error, n->face_count * 5);
    if (n->face_count)
        memcpy(self->stack.faces, n->faces, n->face_count * sizeof *n->faces);
    return walk_down(w, self, &n->node, 0, n->face_count, &n->corners, error);
}

static ebpo_status subtree_task(void *context, uint64_t begin, uint64_t end, unsigned number,
                                ebpo_error *error)
{
    const walk *w = context;
    worker *self = &w->workers[number];
    for (uint64_t i = begin; i < end; i++) {
        upper_node *n = &w->upper[w->subtrees[i]];
        ebpo_status status = walk_subtree(w, self, n, error);
        ebpo_array_free(w->options->workspace, n->faces);
        n->faces = NULL;
        if (status != EBPO_OK)
            return status;
    }
    return EBPO_OK;
}

/* Calls finish_gray for the upper nodes in reverse order, so that children come before their
 * parents. */
static void finish_upper(walk *w)
{
    for (uint64_t at = w->upper_count; at-- > 0;) {
        upper_node *n = &w->upper[at];
        if (n->children == 0)
            continue;
        ebpo_node_windings children[8];
        for (unsigned octant = 0; octant < 8; octant++)
            children[octant] = w->upper[n->children + octant].corners;
        finish_gray(w, &w->workers[0], &n->node, children, &n->corners);
    }
    if (w->view->tree->info.solid)
        ebpo_check_root_corners(&w->workers[0].tally, &w->upper[0].corners);
}

static ebpo_status walk_prepare(walk *w, ebpo_error *error)
{
    w->workers = ebpo_alloc_zero(w->threads, sizeof *w->workers);
    if (!w->workers)
        return ebpo_fail_memory(error, w->threads * sizeof *w->workers);
    uint64_t faces = w->view->has_mesh ? w->view->tree->mesh.face_count : 0;
    /* each thread stores the faces of all nodes on its path: about 15 bytes for each face of the
     * subtree's root */
    uint64_t share = faces / SUBTREES_WANTED;
    w->subtree_limit = share < SUBTREE_FACES       ? SUBTREE_FACES
                       : share > SUBTREE_FACES_MAX ? SUBTREE_FACES_MAX
                                                   : share;
    /* rays need all faces, which a subset lacks */
    const ebpo_info *info = &w->view->tree->info;
    bool labelled = info->solid || info->parts & EBPO_PART_BORDER;
    w->rays = faces > 0 && labelled && !info->pruned;
    for (unsigned i = 0; i < w->threads; i++)
        w->workers[i].points.workspace = w->options->workspace;
    if (w->rays)
        ebpo_label_plan_make(&w->plan, w->view, w->options->label_samples);
    return EBPO_OK;
}

/* Moves the points that all threads have collected to one list, and checks their winding numbers by
 * rays. */
static ebpo_status follow_rays(walk *w, ebpo_error *error)
{
    ebpo_ray_points *all = &w->workers[0].points;
    for (unsigned i = 1; i < w->threads; i++) {
        ebpo_ray_points *own = &w->workers[i].points;
        EBPO_FOR_ITEMS(own->workspace, k, 0, own->count)
            if (!ebpo_rays_add(all, &own->point[k]))
                return ebpo_workspace_fail(all->workspace, all->count * sizeof *all->point, error);
        ebpo_array_free(own->workspace, own->point);
        *own = (ebpo_ray_points){ .workspace = all->workspace };
    }
    ebpo_status status = EBPO_OK;
    if (w->view->tree->info.parts & EBPO_PART_BORDER)
        status = ebpo_check_border_rays(&w->workers[0].tally, all, w->view, w->threads,
                                        &w->options->progress, error);
    if (status == EBPO_OK)
        status = ebpo_rays_follow(all, &w->view->tree->mesh, &w->view->box, w->threads,
                                  &w->options->progress, error);
    if (status == EBPO_OK)
        ebpo_check_rays(&w->workers[0].tally, all);
    return status;
}

static void walk_release(walk *w)
{
    for (unsigned i = 0; w->workers && i < w->threads; i++) {
        free(w->workers[i].stack.faces);
        free(w->workers[i].stack.octants);
        ebpo_array_free(w->options->workspace, w->workers[i].points.point);
    }
    for (uint64_t at = 0; at < w->upper_count; at++)
        ebpo_array_free(w->options->workspace, w->upper[at].faces);
    free(w->workers);
    free(w->upper);
    free(w->subtrees);
    ebpo_array_free(w->options->workspace, w->shared_octants);
}

ebpo_status ebpo_verify_walk(ebpo_tally *tally, const ebpo_reference_tree *view,
                             const ebpo_verify_options *options, ebpo_error *error)
{
    walk w = { .view = view, .options = options, .threads = ebpo_thread_count(options->threads) };
    ebpo_status status = walk_prepare(&w, error);
    if (status == EBPO_OK)
        status = walk_upper(&w, error);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(w.threads, NULL, w.subtree_count, 1, subtree_task, &w,
                                   &options->progress, "verifying subtrees", error);
    if (status == EBPO_OK && w.rays)
        status = follow_rays(&w, error);
    if (status == EBPO_OK) {
        finish_upper(&w);
        for (unsigned i = 0; i < w.threads; i++)
            ebpo_tally_merge(tally, &w.workers[i].tally);
    }
    walk_release(&w);
    return status;
}
