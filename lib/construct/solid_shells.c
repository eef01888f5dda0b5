/* Finds out if the closed components of a mesh are apart, and which of them bound the solid. A
 * shell is a closed component with a volume.
 *
 * Two components are apart if their faces have no common point. If all components are apart, each
 * component is completely inside or outside each other component. The nesting of components (which
 * component is inside which) then gives the winding numbers on both sides of all faces. Faces are
 * compared only if the boxes of components intersect. A first pass finds, for each component, the
 * faces whose boxes intersect the box of another component. A larger box that contains the
 * component's box is skipped, because all faces of the component would be found. Instead, the pass
 * finds the faces of the other component whose boxes intersect the component's box; these faces
 * suffice to find a contact. A second pass compares the found faces with faces of other components.
 * Both passes stop after a number of steps that is proportional to the number of faces; in this
 * case the components count as not apart. `ebpo check` prints the counts; ebpo_measure uses
 * ebpo_component_times. */
#include "core/strict_fp.h"

#include "construct/solid_shells.h"

#include <math.h>
#include <string.h>

#include "core/workspace.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "mesh/mesh_parts.h"
#include "mesh/shell_nesting.h"
#include "geometry/level_nodes.h"
#include "geometry/triangle_pair.h"

/* RULES: number of winding rules. GRAIN: number of faces of a parallel task. The limit of steps is
 * STEPS_AT_LEAST + STEPS_PER_FACE times the number of faces. */
enum { RULES = 3, GRAIN = 1 << 13, STEPS_PER_FACE = 64, STEPS_AT_LEAST = 1 << 22 };

typedef struct comparing {
    ebpo_solid_shells *s;
    /* [faces] 1: the face's box intersects the box of another shell. Larger boxes that contain the
     * box of the face's shell do not count */
    uint8_t *exposed;
    uint8_t *reached;          /* [shells] 1: a face of another shell intersects this shell's box */
    ebpo_box_tree faces;       /* faces of reached shells; value: the shell */
    uint64_t steps, steps_max; /* number of compared boxes and faces so far; its limit */
    bool apart;                /* no contact was found so far, and the limit was not reached */
} comparing;

/* The search for one face, which is compared with the boxes of shells or with other faces. */
typedef struct visitor {
    comparing *c;
    ebpo_point_box box;
    uint64_t steps;
    uint32_t face, shell;
} visitor;

static uint32_t shell_of_face(const comparing *c, uint64_t face)
{
    const ebpo_components *all = c->s->nesting.components;
    return c->s->shell_of[all->of_face[face]];
}

static bool boxes_intersect(const ebpo_point_box *a, const double min[3], const double max[3])
{
    for (int k = 0; k < 3; k++)
        if (a->min[k] > max[k] || a->max[k] < min[k])
            return false;
    return true;
}

static bool is_near(void *user, const ebpo_box_node *node)
{
    return boxes_intersect(&((const visitor *)user)->box, node->filled->min, node->filled->max);
}

/* Compares the face with the boxes of other shells, except larger boxes that contain the box of the
 * face's shell. If the face's box intersects such a box, marks the face as exposed and the other
 * shell as reached. Returns false at the limit of steps. */
static bool visit_shells(void *user, ebpo_tree_point *points, uint64_t count)
{
    visitor *v = user;
    const ebpo_shell *all = v->c->s->nesting.shells, *own = &all[v->shell];
    v->steps += count;
    for (uint64_t i = 0; i < count; i++) {
        const ebpo_shell *other = &all[points[i].number];
        bool inner = ebpo_shell_box_within(own, other) && !ebpo_shell_box_within(other, own);
        if (other == own || inner || !boxes_intersect(&v->box, other->min, other->max))
            continue;
        v->c->exposed[v->face] = 1;
        __atomic_store_n(&v->c->reached[points[i].number], 1, __ATOMIC_RELAXED);
    }
    return v->steps < v->c->steps_max;
}

/* Compares the face with faces of other shells. Returns false after a contact, or at the limit of
 * steps. */
static bool visit_faces(void *user, ebpo_tree_point *points, uint64_t count)
{
    visitor *v = user;
    const ebpo_mesh *mesh = v->c->s->mesh;
    double a[3][3], b[3][3];
    v->steps += count;
    ebpo_face_corners(mesh, v->face, a);
    for (uint64_t i = 0; i < count; i++) {
        ebpo_point_box box;
        if (points[i].value == (int32_t)v->shell)
            continue;
        ebpo_face_box(mesh, &points[i], &box);
        if (!boxes_intersect(&v->box, box.min, box.max))
            continue;
        ebpo_face_corners(mesh, points[i].number, b);
        if (ebpo_triangle_pair((const double(*)[3])a, (const double(*)[3])b) != EBPO_PAIR_APART) {
            __atomic_store_n(&v->c->apart, false, __ATOMIC_RELAXED);
            return false;
        }
    }
    return v->steps < v->c->steps_max;
}

/* Compares each face with the tree of shells (visit_shells), or each exposed face with the tree of
 * faces (visit_faces). */
static ebpo_status compare_faces(comparing *c, uint64_t begin, uint64_t end,
                                 const ebpo_box_tree *tree, ebpo_tree_points_fn visit)
{
    EBPO_FOR_ITEMS_SCATTERED(c->s->mesh->workspace, f, begin, end) {
        visitor v = { .c = c, .face = (uint32_t)f, .shell = shell_of_face(c, f) };
        ebpo_tree_point p = { .number = (uint32_t)f };
        if (v.shell == EBPO_NO_INDEX || (visit == visit_faces && !c->exposed[f]))
            continue;
        if (!__atomic_load_n(&c->apart, __ATOMIC_RELAXED))
            break;
        ebpo_face_box(c->s->mesh, &p, &v.box);
        (void)ebpo_box_tree_walk(tree, is_near, visit, &v);
        if (__atomic_add_fetch(&c->steps, v.steps, __ATOMIC_RELAXED) >= c->steps_max)
            __atomic_store_n(&c->apart, false, __ATOMIC_RELAXED);
    }
    return EBPO_OK;
}

static ebpo_status find_exposed(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                ebpo_error *error)
{
    comparing *c = context;
    (void)worker, (void)error;
    return compare_faces(c, begin, end, &c->s->nesting.tree, visit_shells);
}

static ebpo_status find_contacts(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    comparing *c = context;
    (void)worker, (void)error;
    return compare_faces(c, begin, end, &c->faces, visit_faces);
}

/* Makes the box tree of the faces of reached shells. */
static ebpo_status build_face_tree(comparing *c, ebpo_error *error)
{
    const ebpo_mesh *mesh = c->s->mesh;
    bool added = true;
    c->faces.workspace = mesh->workspace;
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, f, 0, mesh->face_count) {
        uint32_t shell = shell_of_face(c, f);
        if (added && shell != EBPO_NO_INDEX && c->reached[shell])
            added = ebpo_face_add(&c->faces, mesh, (uint32_t)f, (int32_t)shell);
    }
    return added && ebpo_box_tree_build(&c->faces, ebpo_face_box, mesh)
               ? EBPO_OK
               : ebpo_workspace_fail(mesh->workspace, c->faces.count * sizeof(ebpo_tree_point),
                                     error);
}

/* Runs both passes: sets c->apart to false if faces of two shells have a common point, or at the
 * limit of steps. */
static ebpo_status compare_shells(comparing *c, ebpo_error *error)
{
    const ebpo_nesting *n = &c->s->nesting;
    ebpo_workspace *workspace = c->s->mesh->workspace;
    uint64_t count = c->s->mesh->face_count;
    c->exposed = ebpo_array_alloc(workspace, count, sizeof *c->exposed);
    c->reached = ebpo_array_alloc(workspace, n->count, sizeof *c->reached);
    if (!c->exposed || !c->reached)
        return ebpo_workspace_fail(workspace, count * sizeof *c->exposed, error);
    ebpo_array_fill(workspace, c->exposed, 0, count);
    ebpo_array_fill(workspace, c->reached, 0, n->count);
    ebpo_status status =
        ebpo_parallel_for(n->threads, workspace, count, GRAIN, find_exposed, c, NULL, "", error);
    if (status == EBPO_OK && c->apart)
        status = build_face_tree(c, error);
    if (status == EBPO_OK && c->apart && c->faces.count)
        status = ebpo_parallel_for(n->threads, workspace, count, GRAIN, find_contacts, c, NULL, "",
                                   error);
    return status;
}

/* Finds out if the components are apart, and sets s->apart. All components must be simple
 * (is_simple). */
static ebpo_status find_apart(ebpo_solid_shells *s, ebpo_error *error)
{
    comparing c = { .s = s, .apart = true };
    c.steps_max = STEPS_PER_FACE * s->mesh->face_count + STEPS_AT_LEAST;
    ebpo_status status = s->nesting.count > 1 ? compare_shells(&c, error) : EBPO_OK;
    s->apart = c.apart;
    ebpo_box_tree_free(&c.faces);
    ebpo_array_free(s->mesh->workspace, c.exposed);
    ebpo_array_free(s->mesh->workspace, c.reached);
    return status;
}

/* Returns true if a component is simple: it is closed, and has a volume or is flat. (A component
 * with the volume 0 that is not flat bounds parts whose volumes cancel. A closed component of two
 * faces is flat, because its faces have the same corners.) */
static bool is_simple(const ebpo_components *c, uint64_t i)
{
    const ebpo_found_component *component = &c->list[i];
    bool flat = c->faces.begin[i + 1] - c->faces.begin[i] <= 2;
    for (int k = 0; k < 3; k++)
        flat |= component->min[k] == component->max[k];
    return !component->open && (component->volume != 0 || flat);
}

ebpo_status ebpo_solid_shells_find(ebpo_solid_shells *out, const ebpo_mesh *mesh, unsigned threads,
                                   const ebpo_progress *progress, ebpo_error *error)
{
    bool simple = true;
    *out = (ebpo_solid_shells){ .mesh = mesh };
    ebpo_nesting *n = &out->nesting;
    ebpo_status status = ebpo_components_check(mesh, error);
    if (status == EBPO_OK)
        status = ebpo_mesh_find_shells(mesh, threads, &out->closed, error);
    if (status == EBPO_OK)
        status = ebpo_nesting_find(n, mesh, out->closed, threads, progress, error);
    if (status != EBPO_OK)
        return status;
    uint64_t count = n->components->count;
    out->shell_of = ebpo_array_alloc(mesh->workspace, count, sizeof *out->shell_of);
    if (!out->shell_of)
        return ebpo_workspace_fail(mesh->workspace, count * sizeof *out->shell_of, error);
    for (uint64_t i = 0; i < count; i++) {
        out->shell_of[i] = EBPO_NO_INDEX;
        simple &= is_simple(n->components, i);
    }
    for (uint64_t i = 0; i < n->count; i++)
        out->shell_of[n->shells[i].component] = (uint32_t)i;
    return simple ? find_apart(out, error) : EBPO_OK;
}

void ebpo_solid_shells_free(ebpo_solid_shells *shells)
{
    ebpo_array_free(shells->mesh->workspace, shells->shell_of);
    ebpo_nesting_free(&shells->nesting, shells->mesh);
    ebpo_array_free(shells->mesh->workspace, shells->closed);
}

int ebpo_component_times(const ebpo_solid_shells *shells, uint32_t component, ebpo_rule rule)
{
    if (shells->shell_of[component] == EBPO_NO_INDEX)
        return 1;
    const ebpo_shell *shell = &shells->nesting.shells[shells->shell_of[component]];
    int sign = ebpo_shell_faces_inwards(&shells->nesting, shell) ? -1 : 1;
    return sign *
           (ebpo_rule_inside(rule, shell->around + sign) - ebpo_rule_inside(rule, shell->around));
}

/* --- counting --- */

/* Adds a shell to the counts. The number of shells around it decides if it is a cavity. */
static void count_shell(const ebpo_nesting *n, const ebpo_shell *shell, ebpo_shells *made)
{
    bool inwards = ebpo_shell_faces_inwards(n, shell), cavity = ebpo_shell_is_cavity(shell);
    made->inside_out += inwards && !cavity;
    made->cavities += inwards && cavity;
    made->nested += !inwards && cavity;
}

/* Sets volume_difference for each rule: the volume of the solid minus the integral of the winding
 * number over space. */
static void set_volume_differences(const ebpo_solid_shells *s, ebpo_shells *made)
{
    ebpo_mesh_frame frame = ebpo_mesh_frame_of(s->mesh);
    const ebpo_nesting *n = &s->nesting;
    int power = frame.scaled ? frame.exponent[0] + frame.exponent[1] + frame.exponent[2] : 0;
    for (int rule = 0; rule < RULES; rule++) {
        double sum = 0;
        for (uint64_t i = 0; i < n->count; i++) {
            uint32_t component = n->shells[i].component;
            int extra = ebpo_component_times(s, component, (ebpo_rule)rule) - 1;
            sum += extra * n->components->list[component].volume;
        }
        made->volume_difference[rule] = ldexp(sum, power);
    }
}

void ebpo_solid_shells_count(const ebpo_solid_shells *s, ebpo_shells *out)
{
    *out = (ebpo_shells){ .struct_size = sizeof *out, .closed = s->nesting.count };
    out->apart = s->apart;
    for (uint64_t i = 0; i < s->nesting.count; i++)
        count_shell(&s->nesting, &s->nesting.shells[i], out);
    if (s->apart)
        set_volume_differences(s, out);
}

ebpo_status ebpo_mesh_count_shells(const ebpo_mesh *mesh, unsigned threads, ebpo_progress progress,
                                   ebpo_shells *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    static const ebpo_shells none = EBPO_SHELLS_INIT;
    ebpo_shells made = EBPO_SHELLS_INIT;
    ebpo_solid_shells s = { .mesh = mesh };
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_shells, out, error);
    if (status == EBPO_OK)
        status = ebpo_solid_shells_find(&s, mesh, threads, &progress, error);
    if (status == EBPO_OK)
        ebpo_solid_shells_count(&s, &made);
    ebpo_solid_shells_free(&s);
    EBPO_GIVE(ebpo_shells, out, status == EBPO_OK ? &made : &none);
    return status;
}
