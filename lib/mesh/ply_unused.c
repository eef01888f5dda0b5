/* Vertices that no face names and whose coordinates are not finite, as scanners write them for what
 * they have not seen: they are left out, as OBJ and OFF leave out all that no face names. */
#include "core/strict_fp.h"

#include "mesh/ply_unused.h"

#include <math.h>
#include <string.h>

#include "core/workspace.h"
#include "core/parallel.h"

enum { GRAIN = 1 << 15, WORD = 64 };

typedef struct leaving {
    ply_parser *p;
    bool found;   /* some coordinate is not finite */
    bool refused; /* such a vertex is used: the check will refuse the mesh, by the file's numbers */
    uint64_t *used; /* bit v: a face names vertex v */
    uint32_t *from; /* [kept] the vertices that stay */
    uint32_t *to;   /* [vertices] their new numbers */
    uint64_t kept;
} leaving;

static bool is_finite(const ebpo_mesh *mesh, uint64_t v)
{
    bool finite = true;
    for (uint64_t i = 3 * v; i < 3 * v + 3; i++)
        finite &= mesh->xyz32 ? isfinite(mesh->xyz32[i]) : isfinite(mesh->xyz64[i]);
    return finite;
}

static ebpo_status find(void *context, uint64_t begin, uint64_t end, unsigned worker,
                        ebpo_error *error)
{
    leaving *l = context;
    (void)worker, (void)error;
    bool finite = true;
    for (uint64_t v = begin; v < end; v++)
        finite &= is_finite(l->p->mesh, v);
    if (!finite)
        __atomic_store_n(&l->found, true, __ATOMIC_RELAXED);
    return EBPO_OK;
}

static ebpo_status choose(leaving *l)
{
    ebpo_mesh *mesh = l->p->mesh;
    ebpo_workspace *workspace = mesh->workspace;
    uint64_t n = mesh->vertex_count, words = n / WORD + 1;
    l->used = ebpo_array_zero(workspace, words, sizeof *l->used);
    l->from = ebpo_array_alloc(workspace, n, sizeof *l->from);
    l->to = ebpo_array_alloc(workspace, n, sizeof *l->to);
    if (!l->used || !l->from || !l->to)
        return ebpo_workspace_fail(workspace, n * 2 * sizeof *l->to + words * sizeof *l->used,
                                   l->p->error);
    EBPO_FOR_ITEMS_SCATTERED(workspace, f, 0, mesh->face_count) {
        for (uint64_t i = 3 * f; i < 3 * f + 3; i++)
            l->used[mesh->faces[i] / WORD] |= UINT64_C(1) << mesh->faces[i] % WORD;
    }
    EBPO_FOR_ITEMS(workspace, v, 0, n) {
        bool used = l->used[v / WORD] >> v % WORD & 1, finite = is_finite(mesh, v);
        l->to[v] = (uint32_t)l->kept;
        l->refused |= used && !finite;
        if (used || finite)
            l->from[l->kept++] = (uint32_t)v;
    }
    return EBPO_OK;
}

static void move(const leaving *l)
{
    ebpo_mesh *mesh = l->p->mesh;
    size_t size = 3 * (mesh->xyz32 ? sizeof *mesh->xyz32 : sizeof *mesh->xyz64);
    char *xyz = mesh->xyz32 ? (char *)mesh->xyz32 : (char *)mesh->xyz64;
    EBPO_FOR_ITEMS(mesh->workspace, i, 0, l->kept) {
        if (l->from[i] != i)
            memcpy(xyz + i * size, xyz + l->from[i] * size, size);
    }
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, f, 0, mesh->face_count) {
        for (uint64_t i = 3 * f; i < 3 * f + 3; i++)
            mesh->faces[i] = l->to[mesh->faces[i]];
    }
}

/* Elements of other names may name vertices by numbers, which have changed. */
static void move_attributes(const leaving *l)
{
    ebpo_attributes *attributes = l->p->mesh->attributes;
    uint64_t count = attributes ? attributes->count : 0;
    bool renumbered = l->from[l->kept - 1] != l->kept - 1;
    if (!attributes)
        return;
    ebpo_attributes_keep(attributes, "vertex", l->from, l->kept);
    if (renumbered)
        ebpo_attributes_drop_others(attributes);
    if (attributes->count < count)
        ebpo_attributes_lose(attributes, "elements but vertices and faces, which may name vertices "
                                         "by numbers that have changed");
}

static ebpo_status note(const leaving *l, uint64_t left)
{
    ebpo_status status = ebpo_ply_notes(l->p);
    if (status == EBPO_OK)
        ebpo_attributes_count_unread(
            l->p->mesh->attributes,
            "vertices whose coordinates are not finite, and that no face names", left);
    return status;
}

ebpo_status ebpo_ply_leave_unused(ply_parser *p)
{
    leaving l = { .p = p };
    ebpo_mesh *mesh = p->mesh;
    uint64_t count = mesh->vertex_count;
    ebpo_status status =
        ebpo_parallel_for(p->threads, mesh->workspace, count, GRAIN, find, &l, NULL, "", p->error);
    if (status == EBPO_OK && l.found)
        status = choose(&l);
    if (status == EBPO_OK && l.found && !l.refused && l.kept < count) {
        move(&l);
        move_attributes(&l);
        mesh->vertex_count = l.kept;
        status = note(&l, count - l.kept);
    }
    ebpo_array_free(mesh->workspace, l.used);
    ebpo_array_free(mesh->workspace, l.from);
    ebpo_array_free(mesh->workspace, l.to);
    return status;
}
