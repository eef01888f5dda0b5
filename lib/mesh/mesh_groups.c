#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/arrays.h"
#include "core/error.h"
#include "core/sized.h"
#include "core/sort_with.h"
#include "mesh/component_parts.h"
#include "mesh/mesh_parts.h"

/* Of faces under no name, as the OBJ format has it. */
static const char unnamed[] = "default";

typedef struct naming {
    const ebpo_named_run *runs;
    uint64_t count;
    uint32_t *order;  /* by names, then as in the file */
    uint32_t *alike;  /* the first run of the same name */
    uint32_t *number; /* of a first run: its group */
    ebpo_mesh_groups *out;
    uint64_t name_bytes;
} naming;

static ebpo_named_run shown(const ebpo_named_run *run)
{
    return run->size ? *run : (ebpo_named_run){ unnamed, sizeof unnamed - 1, run->faces };
}

static int compare_names(const ebpo_named_run *x, const ebpo_named_run *y)
{
    ebpo_named_run a = shown(x), b = shown(y);
    if (a.size != b.size)
        return a.size < b.size ? -1 : 1;
    return memcmp(a.name, b.name, a.size);
}

static int compare_runs(const void *x, const void *y, void *runs)
{
    uint32_t a = *(const uint32_t *)x, b = *(const uint32_t *)y;
    const ebpo_named_run *r = runs;
    int order = compare_names(&r[a], &r[b]);
    return order ? order : a < b ? -1 : 1;
}

static void find_alike(naming *n)
{
    for (uint64_t i = 0; i < n->count; i++) {
        n->order[i] = (uint32_t)i;
        n->number[i] = EBPO_NO_INDEX;
    }
    ebpo_sort_with(n->order, n->count, sizeof *n->order, compare_runs, (void *)(uintptr_t)n->runs);
    for (uint64_t i = 0; i < n->count; i++) {
        uint32_t run = n->order[i], before = i ? n->order[i - 1] : run;
        bool same = i && compare_names(&n->runs[run], &n->runs[before]) == 0;
        n->alike[run] = same ? n->alike[before] : run;
    }
}

/* A group for the run's name, unless it has one. */
static void name_group(naming *n, uint64_t run, uint64_t first_face)
{
    uint32_t *number = &n->number[n->alike[run]];
    if (*number != EBPO_NO_INDEX)
        return;
    ebpo_named_run name = shown(&n->runs[run]);
    char *to = n->out->names + n->name_bytes;
    memcpy(to, name.name, name.size);
    to[name.size] = 0;
    n->name_bytes += name.size + 1;
    *number = (uint32_t)n->out->count;
    n->out->list[n->out->count++] = (ebpo_mesh_group){ .struct_size = sizeof *n->out->list,
                                                       .name = to,
                                                       .first_face = first_face };
}

/* Those with faces, then the others. */
static void name_groups(naming *n)
{
    ebpo_mesh_groups *out = n->out;
    for (uint64_t i = 0; i < n->count; i++) {
        uint64_t faces = n->runs[i].faces;
        if (faces == 0)
            continue;
        name_group(n, i, out->face_count);
        uint32_t number = n->number[n->alike[i]];
        out->list[number].face_count += faces;
        out->face_count += faces;
        out->run_end[out->run_count] = out->face_count;
        out->run_group[out->run_count++] = number;
    }
    out->with_faces = out->count;
    for (uint64_t i = 1; i < n->count; i++)
        name_group(n, i, 0);
}

static ebpo_status make(naming *n, ebpo_error *error)
{
    uint64_t bytes = n->count * sizeof unnamed;
    for (uint64_t i = 0; i < n->count; i++)
        bytes += n->runs[i].size;
    n->order = ebpo_alloc(n->count, sizeof *n->order);
    n->alike = ebpo_alloc(n->count, sizeof *n->alike);
    n->number = ebpo_alloc(n->count, sizeof *n->number);
    n->out->list = ebpo_alloc(n->count, sizeof *n->out->list);
    n->out->names = ebpo_alloc(bytes, 1);
    n->out->run_end = ebpo_alloc(n->count, sizeof *n->out->run_end);
    n->out->run_group = ebpo_alloc(n->count, sizeof *n->out->run_group);
    if (!n->order || !n->alike || !n->number || !n->out->list || !n->out->names ||
        !n->out->run_end || !n->out->run_group)
        return ebpo_fail_memory(error, bytes + n->count * sizeof *n->out->list);
    find_alike(n);
    name_groups(n);
    return EBPO_OK;
}

ebpo_status ebpo_mesh_groups_new(const ebpo_named_run *runs, uint64_t count, ebpo_mesh_groups **out,
                                 ebpo_error *error)
{
    naming n = { .runs = runs, .count = count };
    *out = NULL;
    if (count >= EBPO_NO_INDEX)
        return ebpo_fail(error, EBPO_E_LIMIT, "there are too many names of groups");
    n.out = ebpo_alloc_zero(1, sizeof *n.out);
    ebpo_status status = n.out ? make(&n, error) : ebpo_fail_memory(error, sizeof *n.out);
    free(n.order);
    free(n.alike);
    free(n.number);
    if (status == EBPO_OK)
        *out = n.out;
    else
        ebpo_mesh_groups_free(n.out);
    return status;
}

void ebpo_mesh_groups_free(ebpo_mesh_groups *groups)
{
    if (!groups)
        return;
    free(groups->list);
    free(groups->names);
    free(groups->run_end);
    free(groups->run_group);
    free(groups);
}

uint64_t ebpo_mesh_groups_count(const ebpo_mesh_groups *groups)
{
    return groups ? groups->count : 0;
}

ebpo_status ebpo_mesh_groups_get(const ebpo_mesh_groups *groups, uint64_t number,
                                 ebpo_mesh_group *out, ebpo_error *error)
{
    static const ebpo_mesh_group nothing = EBPO_MESH_GROUP_INIT;
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_mesh_group, out, error);
    if (status != EBPO_OK)
        return status;
    bool there = number < ebpo_mesh_groups_count(groups);
    EBPO_GIVE(ebpo_mesh_group, out, there ? &groups->list[number] : &nothing);
    return there ? EBPO_OK
                 : ebpo_fail(error, EBPO_E_ARGUMENT, "there is no group %llu",
                             (unsigned long long)number);
}

uint32_t ebpo_mesh_group_of(const ebpo_mesh_groups *groups, uint64_t face)
{
    uint64_t low = 0, high = groups->run_count;
    while (low < high) {
        uint64_t middle = low + (high - low) / 2;
        if (groups->run_end[middle] <= face)
            low = middle + 1;
        else
            high = middle;
    }
    return low < groups->run_count ? groups->run_group[low] : EBPO_NO_INDEX;
}

/* Named groups in the form of components: a vertex may be in several. */

/* Each group's vertices once, as its faces name them; counted only where `of` is NULL. `seen`:
 * [vertex_count] the group that has named it last. */
static void list_vertices(ebpo_components *c, uint32_t *seen)
{
    const ebpo_mesh *mesh = c->mesh;
    uint64_t count = 0;
    ebpo_array_fill(mesh->workspace, seen, 0xff, mesh->vertex_count * sizeof *seen);
    for (uint64_t n = 0; n < c->count; n++) {
        c->vertices.begin[n] = count;
        EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, c->faces.begin[n], c->faces.begin[n + 1])
            for (uint64_t k = 0; k < 3; k++) {
                uint32_t v = mesh->faces[3 * (uint64_t)c->faces.of[i] + k];
                if (seen[v] == (uint32_t)n)
                    continue;
                seen[v] = (uint32_t)n;
                if (c->vertices.of)
                    c->vertices.of[count] = v;
                count++;
            }
    }
    c->vertices.begin[c->count] = count;
}

static int ascending(const void *x, const void *y)
{
    uint32_t a = *(const uint32_t *)x, b = *(const uint32_t *)y;
    return a < b ? -1 : a > b;
}

static ebpo_status gather_vertices(ebpo_components *c, ebpo_error *error)
{
    ebpo_workspace *workspace = c->mesh->workspace;
    mesh_groups *v = &c->vertices;
    uint32_t *seen = ebpo_array_alloc(workspace, c->mesh->vertex_count, sizeof *seen);
    v->begin = ebpo_array_alloc(workspace, c->count + 1, sizeof *v->begin);
    if (seen && v->begin) {
        list_vertices(c, seen);
        v->of = ebpo_array_alloc(workspace, v->begin[c->count], sizeof *v->of);
    }
    if (v->of)
        list_vertices(c, seen);
    ebpo_array_free(workspace, seen);
    if (!v->of)
        return ebpo_workspace_fail(workspace, c->mesh->vertex_count * sizeof *v->of, error);
    for (uint64_t n = 0; n < c->count; n++)
        qsort(v->of + v->begin[n], v->begin[n + 1] - v->begin[n], sizeof *v->of, ascending);
    return EBPO_OK;
}

static ebpo_status list_groups(ebpo_components *c, ebpo_error *error)
{
    c->facts = ebpo_array_alloc(c->mesh->workspace, c->count, sizeof *c->facts);
    if (!c->facts)
        return ebpo_workspace_fail(c->mesh->workspace, c->count * sizeof *c->facts, error);
    for (uint64_t n = 0; n < c->count; n++)
        c->facts[n] =
            (ebpo_component){ .struct_size = sizeof *c->facts,
                              .first_face = c->named->list[n].first_face,
                              .face_count = c->faces.begin[n + 1] - c->faces.begin[n],
                              .vertex_count = c->vertices.begin[n + 1] - c->vertices.begin[n] };
    return EBPO_OK;
}

static ebpo_status check(const ebpo_mesh *mesh, const ebpo_mesh_groups *groups, ebpo_error *error)
{
    ebpo_status status = ebpo_components_check(mesh, error);
    if (status != EBPO_OK)
        return status;
    if (!groups || groups->face_count != mesh->face_count ||
        ebpo_mesh_whole_faces(mesh) != mesh->face_count)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, ebpo_mesh_label(mesh),
                              "these are not the groups of its %llu faces; fill holes in the file "
                              "of a group, not before",
                              (unsigned long long)mesh->face_count);
    return EBPO_OK;
}

ebpo_status ebpo_components_of_groups(const ebpo_mesh *mesh, const ebpo_mesh_groups *groups,
                                      ebpo_components **out, ebpo_error *error)
{
    *out = NULL;
    ebpo_status status = check(mesh, groups, error);
    if (status != EBPO_OK)
        return status;
    ebpo_components *c = ebpo_alloc_zero(1, sizeof *c);
    if (!c)
        return ebpo_fail_memory(error, sizeof *c);
    c->mesh = mesh;
    c->named = groups;
    c->count = groups->with_faces;
    status = ebpo_components_group(c, true, &c->faces, error);
    if (status == EBPO_OK)
        status = gather_vertices(c, error);
    if (status == EBPO_OK)
        status = list_groups(c, error);
    if (status == EBPO_OK)
        *out = c;
    else
        ebpo_components_free(c);
    return status;
}
