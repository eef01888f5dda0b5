/* Finds the components of a mesh, joins cavities to the components around them, and extracts each
 * component as a separate mesh. Also extracts the groups of faces that a file names (OBJ groups).
 */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/disjoint_sets.h"
#include "core/workspace.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "core/sort.h"
#include "mesh/attributes.h"
#include "mesh/component_parts.h"
#include "mesh/mesh_parts.h"
#include "mesh/textures.h"

/* ---- faces connected by vertices ---- */

ebpo_status ebpo_components_check(const ebpo_mesh *mesh, ebpo_error *error)
{
    ebpo_status status = ebpo_mesh_check_shape(mesh, error);
    if (status != EBPO_OK)
        return status;
    if (mesh->face_count == 0)
        return ebpo_fail_file(error, EBPO_E_FORMAT, ebpo_mesh_label(mesh),
                              "has no faces; give a triangle mesh, not a point cloud");
    EBPO_FOR_ITEMS(mesh->workspace, i, 0, 3 * mesh->face_count) {
        if (mesh->faces[i] >= mesh->vertex_count)
            return ebpo_fail_file(error, EBPO_E_FORMAT, ebpo_mesh_label(mesh),
                                  "face %llu names vertex %lu, but there are %llu vertices; repair "
                                  "the file or drop the face",
                                  (unsigned long long)ebpo_mesh_source_face(mesh, i / 3),
                                  (unsigned long)mesh->faces[i],
                                  (unsigned long long)mesh->vertex_count);
    }
    return EBPO_OK;
}

/* Computes for each vertex its root, the lowest vertex of its component (core/disjoint_sets.h).
 * Ignores faces of closed shells. */
static void join_vertices(const ebpo_mesh *mesh, const uint32_t *closed, uint32_t *parent)
{
    EBPO_FOR_ITEMS(mesh->workspace, v, 0, mesh->vertex_count)
        parent[v] = (uint32_t)v;
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, f, 0, mesh->face_count) {
        const uint32_t *corner = mesh->faces + 3 * f;
        if (closed && closed[f] != EBPO_NO_INDEX)
            continue;
        ebpo_set_join(parent, corner[0], corner[1]);
        ebpo_set_join(parent, corner[0], corner[2]);
    }
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, v, 0, mesh->vertex_count)
        parent[v] = parent[parent[v]]; /* parent[v] <= v, and lower vertices already have their
                                          final root */
}

static int compare_first(const void *x, const void *y)
{
    const ebpo_found_component *a = x, *b = y;
    return a->first < b->first ? -1 : 1;
}

/* Adds face f to the component *number. If *number is EBPO_NO_INDEX, creates the component first.
 */
static ebpo_status add_face(ebpo_components *c, uint64_t f, uint32_t *number, uint64_t *capacity,
                            ebpo_error *error)
{
    uint64_t source = ebpo_mesh_source_face(c->mesh, f);
    if (*number == EBPO_NO_INDEX) {
        if (!ebpo_array_grow(c->mesh->workspace, &c->list, capacity, c->count + 1, sizeof *c->list))
            return ebpo_workspace_fail(c->mesh->workspace, (c->count + 1) * sizeof *c->list, error);
        *number = (uint32_t)c->count;
        c->list[c->count++] = (ebpo_found_component){ .first = UINT64_MAX };
    }
    if (source < c->list[*number].first) {
        c->list[*number].first = source;
        c->list[*number].face = (uint32_t)f;
    }
    return EBPO_OK;
}

/* Returns the address at which the index of face f's component is stored. A shell is identified by
 * its lowest face, so for a face of a shell this is the element of of_shell with this face's index.
 * For another face, this is the element of c->number for the root of the face's vertices. */
static uint32_t *component_address(const ebpo_components *c, const uint32_t *parent,
                                   uint32_t *of_shell, uint64_t f)
{
    return of_shell && c->of_face[f] != EBPO_NO_INDEX ? &of_shell[c->of_face[f]]
                                                      : &c->number[parent[c->mesh->faces[3 * f]]];
}

/* Numbers components by their first faces in the source. */
static ebpo_status list_components(ebpo_components *c, const uint32_t *parent, uint32_t *of_shell,
                                   ebpo_error *error)
{
    const ebpo_mesh *mesh = c->mesh;
    uint64_t capacity = 0;
    ebpo_status status = EBPO_OK;
    ebpo_array_fill(mesh->workspace, c->number, 0xff, mesh->vertex_count * sizeof *c->number);
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, f, 0, mesh->face_count) {
        status = add_face(c, f, component_address(c, parent, of_shell, f), &capacity, error);
        if (status != EBPO_OK)
            return status;
    }
    qsort(c->list, c->count, sizeof *c->list, compare_first);
    for (uint64_t i = 0; i < c->count; i++)
        *component_address(c, parent, of_shell, c->list[i].face) = (uint32_t)i;
    if (of_shell)
        EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, f, 0, mesh->face_count)
            c->of_face[f] = *component_address(c, parent, of_shell, f);
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, v, 0, mesh->vertex_count)
        c->number[v] = c->number[parent[v]];
    return EBPO_OK;
}

/* ---- groups ---- */

/* Returns the component or named group of face i (or of vertex i, if `faces` is false). */
static uint32_t component_of(const ebpo_components *c, bool faces, uint64_t i)
{
    if (c->named) /* only for faces */
        return ebpo_mesh_group_of(c->named, ebpo_mesh_source_face(c->mesh, i));
    if (faces && c->of_face)
        return c->of_face[i];
    return c->number[faces ? c->mesh->faces[3 * i] : i];
}

/* Stores the indices of each group, ascending within a group. g->begin first counts the indices of
 * each group, then becomes the position of each group's next index. */
static void fill_groups(const ebpo_components *c, bool faces, ebpo_number_groups *g)
{
    uint64_t items = faces ? c->mesh->face_count : c->mesh->vertex_count, sum = 0;
    memset(g->begin, 0, (c->count + 1) * sizeof *g->begin);
    EBPO_FOR_ITEMS_SCATTERED(c->mesh->workspace, i, 0, items) {
        uint32_t number = component_of(c, faces, i);
        if (number != EBPO_NO_INDEX)
            g->begin[number]++;
    }
    for (uint64_t i = 0; i <= c->count; i++) {
        uint64_t size = g->begin[i];
        g->begin[i] = sum;
        sum += size;
    }
    EBPO_FOR_ITEMS_SCATTERED(c->mesh->workspace, i, 0, items) {
        uint32_t number = component_of(c, faces, i);
        if (number != EBPO_NO_INDEX)
            g->members[g->begin[number]++] = (uint32_t)i;
    }
    memmove(g->begin + 1, g->begin, c->count * sizeof *g->begin);
    g->begin[0] = 0;
}

ebpo_status ebpo_components_group(const ebpo_components *c, bool faces, ebpo_number_groups *g,
                                  ebpo_error *error)
{
    uint64_t items = faces ? c->mesh->face_count : c->mesh->vertex_count;
    g->begin = ebpo_array_alloc(c->mesh->workspace, c->count + 1, sizeof *g->begin);
    g->members = ebpo_array_alloc(c->mesh->workspace, items, sizeof *g->members);
    if (!g->begin || !g->members)
        return ebpo_workspace_fail(c->mesh->workspace, items * sizeof *g->members, error);
    fill_groups(c, faces, g);
    return EBPO_OK;
}

/* ---- joining cavities to hosts ---- */

/* Numbers hosts by their first faces; the first face of a host may belong to one of its cavities.
 * new_index: [count] the new index of each component. A cavity gets the new index of its host. */
static void number_hosts(ebpo_components *c, uint32_t *new_index)
{
    uint64_t count = 0;
    memset(new_index, 0xff, c->count * sizeof *new_index);
    for (uint64_t i = 0; i < c->count; i++) {
        uint32_t host = c->list[i].host;
        if (new_index[host] == EBPO_NO_INDEX) {
            c->facts[count] = (ebpo_component){ .struct_size = sizeof *c->facts,
                                                .first_face = c->list[i].first,
                                                .closed = !c->list[host].open };
            new_index[host] = (uint32_t)count++;
        }
        c->facts[new_index[host]].cavities += host != i;
    }
    for (uint64_t i = 0; i < c->count; i++)
        new_index[i] = new_index[c->list[i].host]; /* a host maps to itself */
    c->count = count;
}

static ebpo_status join_cavities(ebpo_components *c, ebpo_error *error)
{
    ebpo_workspace *workspace = c->mesh->workspace;
    uint32_t *new_index = ebpo_array_alloc(workspace, c->count, sizeof *new_index);
    c->facts = ebpo_array_alloc(workspace, c->count, sizeof *c->facts);
    if (!new_index || !c->facts) {
        ebpo_array_free(workspace, new_index);
        return ebpo_workspace_fail(workspace, c->count * sizeof *c->facts, error);
    }
    number_hosts(c, new_index);
    EBPO_FOR_ITEMS_SCATTERED(workspace, v, 0, c->mesh->vertex_count) {
        if (c->number[v] != EBPO_NO_INDEX)
            c->number[v] = new_index[c->number[v]];
    }
    ebpo_array_free(workspace, new_index);
    return EBPO_OK;
}

/* ---- main functions ---- */

static ebpo_status find_components(ebpo_components *c, ebpo_error *error)
{
    const ebpo_mesh *mesh = c->mesh;
    uint64_t n = mesh->vertex_count;
    uint32_t *parent = ebpo_array_alloc(mesh->workspace, n, sizeof *parent);
    c->number = ebpo_array_alloc(mesh->workspace, n, sizeof *c->number);
    uint32_t *of_shell = NULL;
    bool made = parent && c->number;
    if (c->of_face) {
        of_shell = ebpo_array_alloc(mesh->workspace, mesh->face_count, sizeof *of_shell);
        made = made && of_shell;
    }
    ebpo_status status =
        made ? EBPO_OK : ebpo_workspace_fail(mesh->workspace, 2 * n * sizeof *parent, error);
    if (status == EBPO_OK) {
        if (of_shell)
            ebpo_array_fill(mesh->workspace, of_shell, 0xff, mesh->face_count * sizeof *of_shell);
        join_vertices(mesh, c->of_face, parent);
        status = list_components(c, parent, of_shell, error);
    }
    ebpo_array_free(mesh->workspace, of_shell);
    ebpo_array_free(mesh->workspace, parent);
    return status == EBPO_OK ? ebpo_components_group(c, true, &c->faces, error) : status;
}

/* Computes the position of each vertex among the vertices of its component. */
static ebpo_status number_vertices(ebpo_components *c, ebpo_error *error)
{
    const ebpo_mesh *mesh = c->mesh;
    ebpo_status status = ebpo_components_group(c, false, &c->vertices, error);
    if (status != EBPO_OK)
        return status;
    c->position = ebpo_array_alloc(mesh->workspace, mesh->vertex_count, sizeof *c->position);
    if (!c->position)
        return ebpo_workspace_fail(mesh->workspace, mesh->vertex_count * sizeof *c->position,
                                   error);
    for (uint64_t n = 0; n < c->count; n++) {
        uint64_t begin = c->vertices.begin[n];
        EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, begin, c->vertices.begin[n + 1])
            c->position[c->vertices.members[i]] = (uint32_t)(i - begin);
        c->facts[n].vertex_count = c->vertices.begin[n + 1] - begin;
        c->facts[n].face_count = c->faces.begin[n + 1] - c->faces.begin[n];
    }
    return EBPO_OK;
}

ebpo_status ebpo_components_find(const ebpo_mesh *mesh, uint32_t *closed, unsigned threads,
                                 const ebpo_progress *progress, ebpo_components **out,
                                 ebpo_error *error)
{
    *out = NULL;
    ebpo_status status = ebpo_components_check(mesh, error);
    if (status != EBPO_OK)
        return status;
    ebpo_components *c = *out = ebpo_alloc_zero(1, sizeof *c);
    if (!c)
        return ebpo_fail_memory(error, sizeof *c);
    c->mesh = mesh;
    c->of_face = closed;
    if (progress && !ebpo_progress_stage(progress, "components", error))
        return EBPO_E_CANCELLED;
    status = find_components(c, error);
    return status == EBPO_OK ? ebpo_components_measure(c, threads, progress, error) : status;
}

ebpo_status ebpo_components_number(const ebpo_mesh *mesh, uint32_t **number, ebpo_error *error)
{
    *number = NULL;
    ebpo_status status = ebpo_components_check(mesh, error);
    if (status != EBPO_OK)
        return status;
    ebpo_components *c = ebpo_alloc_zero(1, sizeof *c);
    if (!c)
        return ebpo_fail_memory(error, sizeof *c);
    c->mesh = mesh;
    status = find_components(c, error);
    if (status == EBPO_OK) {
        *number = c->number;
        c->number = NULL;
    }
    ebpo_components_free(c);
    return status;
}

/* Joins cavities to their hosts, and groups the faces and vertices of the joined components. */
static ebpo_status group_all(ebpo_components *c, ebpo_error *error)
{
    ebpo_status status = ebpo_cavities_place(c, error);
    if (status == EBPO_OK)
        status = join_cavities(c, error);
    if (status != EBPO_OK)
        return status;
    fill_groups(c, true, &c->faces);
    return number_vertices(c, error);
}

ebpo_status ebpo_components_new(const ebpo_mesh *mesh, unsigned threads, ebpo_progress progress,
                                ebpo_components **out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_status status = ebpo_components_find(mesh, NULL, threads, &progress, out, error);
    if (status == EBPO_OK)
        status = group_all(*out, error);
    if (status == EBPO_OK)
        return EBPO_OK;
    ebpo_components_free(*out);
    *out = NULL;
    return status;
}

void ebpo_components_free(ebpo_components *c)
{
    if (!c)
        return;
    ebpo_workspace *workspace = c->mesh->workspace;
    ebpo_array_free(workspace, c->number);
    ebpo_array_free(workspace, c->position);
    ebpo_array_free(workspace, c->faces.members);
    ebpo_array_free(workspace, c->vertices.members);
    ebpo_array_free(workspace, c->faces.begin);
    ebpo_array_free(workspace, c->vertices.begin);
    ebpo_array_free(workspace, c->list);
    ebpo_array_free(workspace, c->facts);
    free(c);
}

uint64_t ebpo_components_count(const ebpo_components *c) { return c ? c->count : 0; }

ebpo_status ebpo_components_get(const ebpo_components *c, uint64_t number, ebpo_component *out,
                                ebpo_error *error)
{
    static const ebpo_component nothing = EBPO_COMPONENT_INIT;
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_component, out, error);
    if (status != EBPO_OK)
        return status;
    bool exists = c && number < c->count;
    EBPO_GIVE(ebpo_component, out, exists ? &c->facts[number] : &nothing);
    return exists ? EBPO_OK
                  : ebpo_fail(error, EBPO_E_ARGUMENT, "there is no component %llu",
                              (unsigned long long)number);
}

/* --- a component as a separate mesh, which keeps source indices --- */
static void copy_vertices(const ebpo_components *c, uint64_t number, ebpo_mesh *out)
{
    const ebpo_mesh *mesh = c->mesh;
    const uint32_t *from = c->vertices.members + c->vertices.begin[number];
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, 0, out->vertex_count) {
        if (mesh->xyz32)
            memcpy(out->xyz32 + 3 * i, mesh->xyz32 + 3 * (uint64_t)from[i], 3 * sizeof(float));
        else
            memcpy(out->xyz64 + 3 * i, mesh->xyz64 + 3 * (uint64_t)from[i], 3 * sizeof(double));
        out->arrangement->vertex_source[i] = (uint32_t)ebpo_mesh_source_vertex(mesh, from[i]);
    }
}

/* Returns the position of vertex v among the vertices of the component. */
static uint32_t position_of(const ebpo_components *c, uint64_t number, uint32_t v)
{
    if (c->position)
        return c->position[v];
    const uint32_t *members = c->vertices.members + c->vertices.begin[number];
    uint64_t low = 0, high = c->vertices.begin[number + 1] - c->vertices.begin[number];
    while (high - low > 1) {
        uint64_t middle = low + (high - low) / 2;
        if (members[middle] <= v)
            low = middle;
        else
            high = middle;
    }
    return (uint32_t)low;
}

static void copy_faces(const ebpo_components *c, uint64_t number, ebpo_mesh *out)
{
    const ebpo_mesh *mesh = c->mesh;
    const uint32_t *from = c->faces.members + c->faces.begin[number];
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, 0, out->face_count) {
        for (uint64_t k = 0; k < 3; k++)
            out->faces[3 * i + k] = position_of(c, number, mesh->faces[3 * (uint64_t)from[i] + k]);
        out->arrangement->face_source[i] = (uint32_t)ebpo_mesh_source_face(mesh, from[i]);
    }
}

/* Adds the arrangement, which has the source indices. The mesh is not sorted for building a file.
 */
static bool make_arrangement(const ebpo_mesh *whole, ebpo_mesh *out)
{
    struct ebpo_arrangement *a = ebpo_alloc_zero(1, sizeof *a);
    out->arrangement = a;
    if (!a)
        return false;
    a->workspace = whole->workspace;
    a->referenced = out->vertex_count;
    a->level = -1;
    a->whole_vertices = ebpo_mesh_whole_vertices(whole);
    a->whole_faces = ebpo_mesh_whole_faces(whole);
    a->vertex_source = ebpo_array_alloc(a->workspace, out->vertex_count, sizeof *a->vertex_source);
    a->face_source = ebpo_array_alloc(a->workspace, out->face_count, sizeof *a->face_source);
    return a->vertex_source && a->face_source;
}

static bool make_arrays(const ebpo_mesh *whole, ebpo_mesh *out)
{
    if (whole->xyz32)
        out->xyz32 = ebpo_array_alloc(whole->workspace, out->vertex_count, 3 * sizeof *out->xyz32);
    else
        out->xyz64 = ebpo_array_alloc(whole->workspace, out->vertex_count, 3 * sizeof *out->xyz64);
    out->faces = ebpo_array_alloc(whole->workspace, out->face_count, 3 * sizeof *out->faces);
    return (out->xyz32 || out->xyz64) && out->faces;
}

ebpo_status ebpo_components_mesh(const ebpo_components *c, uint64_t number, ebpo_mesh *out,
                                 ebpo_error *error)
{
    memset(out, 0, sizeof *out);
    ebpo_component facts = EBPO_COMPONENT_INIT;
    ebpo_status status = ebpo_components_get(c, number, &facts, error);
    if (status != EBPO_OK)
        return status;
    *out = *c->mesh;
    out->xyz32 = NULL;
    out->xyz64 = NULL;
    out->faces = NULL;
    out->arrangement = NULL;
    out->attributes = NULL;
    out->vertex_count = facts.vertex_count;
    out->face_count = facts.face_count;
    if (!make_arrangement(c->mesh, out) || !make_arrays(c->mesh, out)) {
        /* with double positions: 24 + 4 bytes a vertex, 12 + 4 bytes a face */
        status = ebpo_workspace_fail(out->workspace,
                                     28 * facts.vertex_count + 16 * facts.face_count, error);
    }
    /* the rows stay in source order; the builder selects the rows of the component */
    if (status == EBPO_OK)
        status = ebpo_attributes_borrow(&out->attributes, c->mesh->attributes, error);
    if (status != EBPO_OK) {
        ebpo_mesh_free(out);
        return status;
    }
    copy_vertices(c, number, out);
    copy_faces(c, number, out);
    status = ebpo_textures_keep_named(out->attributes, out->arrangement->face_source,
                                      out->face_count, error);
    if (status != EBPO_OK)
        ebpo_mesh_free(out);
    return status;
}

/* Name of faces without a group, as in the OBJ format. */
static const char unnamed[] = "default";

/* The merging of runs into groups. */
typedef struct naming {
    const ebpo_named_run *runs;
    uint64_t count;        /* number of runs */
    uint32_t *order;       /* [count] runs, sorted by name, then in file order */
    uint32_t *first_alike; /* [count] for each run, the first run of the same name */
    uint32_t *number;      /* [count] group of each first run of a name; EBPO_NO_INDEX: none yet */
    ebpo_mesh_groups *out;
    uint64_t name_bytes; /* used bytes of out->names */
} naming;

/* Returns the run, with the name "default" in place of an empty name. */
static ebpo_named_run shown_name(const ebpo_named_run *run)
{
    return run->size ? *run : (ebpo_named_run){ unnamed, sizeof unnamed - 1, run->faces };
}

static int compare_names(const ebpo_named_run *x, const ebpo_named_run *y)
{
    ebpo_named_run a = shown_name(x), b = shown_name(y);
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

/* Computes n->first_alike. */
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
        n->first_alike[run] = same ? n->first_alike[before] : run;
    }
}

/* Creates a group for the run's name if it has none. */
static void name_group(naming *n, uint64_t run, uint64_t first_face)
{
    uint32_t *number = &n->number[n->first_alike[run]];
    if (*number != EBPO_NO_INDEX)
        return;
    ebpo_named_run name = shown_name(&n->runs[run]);
    char *to = n->out->names + n->name_bytes;
    memcpy(to, name.name, name.size);
    to[name.size] = 0;
    n->name_bytes += name.size + 1;
    *number = (uint32_t)n->out->count;
    n->out->list[n->out->count++] = (ebpo_mesh_group){ .struct_size = sizeof *n->out->list,
                                                       .name = to,
                                                       .first_face = first_face };
}

/* Numbers groups with faces first, then groups without faces. */
static void name_groups(naming *n)
{
    ebpo_mesh_groups *out = n->out;
    for (uint64_t i = 0; i < n->count; i++) {
        uint64_t faces = n->runs[i].faces;
        if (faces == 0)
            continue;
        name_group(n, i, out->face_count);
        uint32_t number = n->number[n->first_alike[i]];
        out->list[number].face_count += faces;
        out->face_count += faces;
        out->run_end[out->run_count] = out->face_count;
        out->run_group[out->run_count++] = number;
    }
    out->with_faces = out->count;
    for (uint64_t i = 1; i < n->count; i++) /* run 0 has no name in the file */
        name_group(n, i, 0);
}

static ebpo_status make_groups(naming *n, ebpo_error *error)
{
    uint64_t bytes = n->count * sizeof unnamed;
    for (uint64_t i = 0; i < n->count; i++)
        bytes += n->runs[i].size;
    n->order = ebpo_alloc(n->count, sizeof *n->order);
    n->first_alike = ebpo_alloc(n->count, sizeof *n->first_alike);
    n->number = ebpo_alloc(n->count, sizeof *n->number);
    n->out->list = ebpo_alloc(n->count, sizeof *n->out->list);
    n->out->names = ebpo_alloc(bytes, 1);
    n->out->run_end = ebpo_alloc(n->count, sizeof *n->out->run_end);
    n->out->run_group = ebpo_alloc(n->count, sizeof *n->out->run_group);
    if (!n->order || !n->first_alike || !n->number || !n->out->list || !n->out->names ||
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
        return ebpo_fail(error, EBPO_E_LIMIT, "there are too many group names");
    n.out = ebpo_alloc_zero(1, sizeof *n.out);
    ebpo_status status = n.out ? make_groups(&n, error) : ebpo_fail_memory(error, sizeof *n.out);
    free(n.order);
    free(n.first_alike);
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
    bool exists = number < ebpo_mesh_groups_count(groups);
    EBPO_GIVE(ebpo_mesh_group, out, exists ? &groups->list[number] : &nothing);
    return exists ? EBPO_OK
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

/* --- named groups in place of components; a vertex may be in several groups --- */

/* Lists each vertex of a group once, in the order of the group's faces. If c->vertices.members is
 * NULL, only counts the vertices. `last_group`: [vertex_count] last group that used the vertex. */
static void list_vertices(ebpo_components *c, uint32_t *last_group)
{
    const ebpo_mesh *mesh = c->mesh;
    uint64_t count = 0;
    ebpo_array_fill(mesh->workspace, last_group, 0xff, mesh->vertex_count * sizeof *last_group);
    for (uint64_t n = 0; n < c->count; n++) {
        c->vertices.begin[n] = count;
        EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, c->faces.begin[n], c->faces.begin[n + 1])
            for (uint64_t k = 0; k < 3; k++) {
                uint32_t v = mesh->faces[3 * (uint64_t)c->faces.members[i] + k];
                if (last_group[v] == (uint32_t)n)
                    continue;
                last_group[v] = (uint32_t)n;
                if (c->vertices.members)
                    c->vertices.members[count] = v;
                count++;
            }
    }
    c->vertices.begin[c->count] = count;
}

static int compare_vertices(const void *x, const void *y)
{
    uint32_t a = *(const uint32_t *)x, b = *(const uint32_t *)y;
    return a < b ? -1 : a > b;
}

/* Sets c->vertices: the vertices of each group, ascending. */
static ebpo_status gather_vertices(ebpo_components *c, ebpo_error *error)
{
    ebpo_workspace *workspace = c->mesh->workspace;
    ebpo_number_groups *v = &c->vertices;
    uint32_t *last_group = ebpo_array_alloc(workspace, c->mesh->vertex_count, sizeof *last_group);
    v->begin = ebpo_array_alloc(workspace, c->count + 1, sizeof *v->begin);
    if (last_group && v->begin) {
        list_vertices(c, last_group);
        v->members = ebpo_array_alloc(workspace, v->begin[c->count], sizeof *v->members);
    }
    if (v->members)
        list_vertices(c, last_group);
    ebpo_array_free(workspace, last_group);
    if (!v->members)
        return ebpo_workspace_fail(workspace, c->mesh->vertex_count * sizeof *v->members, error);
    for (uint64_t n = 0; n < c->count; n++)
        qsort(v->members + v->begin[n], v->begin[n + 1] - v->begin[n], sizeof *v->members,
              compare_vertices);
    return EBPO_OK;
}

/* Sets c->facts, the results for ebpo_components_get. */
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

static ebpo_status check_groups(const ebpo_mesh *mesh, const ebpo_mesh_groups *groups,
                                ebpo_error *error)
{
    ebpo_status status = ebpo_components_check(mesh, error);
    if (status != EBPO_OK)
        return status;
    if (!groups || groups->face_count != mesh->face_count ||
        ebpo_mesh_whole_faces(mesh) != mesh->face_count)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, ebpo_mesh_label(mesh),
                              "the groups do not match the mesh's %llu faces; fill holes in the "
                              "file of a group, not before",
                              (unsigned long long)mesh->face_count);
    return EBPO_OK;
}

ebpo_status ebpo_components_of_groups(const ebpo_mesh *mesh, const ebpo_mesh_groups *groups,
                                      ebpo_components **out, ebpo_error *error)
{
    *out = NULL;
    ebpo_status status = check_groups(mesh, groups, error);
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
