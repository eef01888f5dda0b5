/* Finds all locations of a mesh's findings. The mesh check records the locations, which are then
 * sorted. Each location is passed to the caller with the surrounding faces, and a PLY file (the
 * *picture*) can show all locations, with a colour for each kind of finding. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/findings.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/endian.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "core/sort.h"
#include "io/publish.h"
#include "mesh/component_parts.h"
#include "mesh/mesh_check_parts.h"

/* --- the picture --- */

typedef struct findings_picture {
    const ebpo_mesh *mesh;
    uint8_t *face; /* [face_count] kind of finding shown at each face; NOTHING: none */
    ebpo_publish target;
} findings_picture;

#define PICTURE_INIT                  \
    {                                 \
        NULL, NULL, EBPO_PUBLISH_INIT \
    }

static ebpo_status begin_picture(findings_picture *picture, const ebpo_mesh *mesh, const char *path,
                                 ebpo_error *error);
/* Shows a finding at these faces (indices in the current mesh). A face with several findings shows
 * the kind with the lowest number. */
static void record_in_picture(findings_picture *picture, const ebpo_found *found,
                              const uint64_t *faces, uint64_t count);
/* Writes the picture. `report` is for the legend. */
static ebpo_status write_picture(findings_picture *picture, const ebpo_mesh_report *report,
                                 ebpo_error *error);
static void end_picture(findings_picture *picture);

static const struct finding_kind {
    const char *name;
    uint8_t rgb[3];
} kinds[EBPO_FINDING_KINDS] = {
    [EBPO_FOUND_BOUNDARY_EDGE] = { "boundary_edges", { 255, 127, 14 } },
    [EBPO_FOUND_NONMANIFOLD_EDGE] = { "nonmanifold_edges", { 214, 39, 40 } },
    [EBPO_FOUND_MISORIENTED_EDGE] = { "misoriented_edges", { 148, 103, 189 } },
    [EBPO_FOUND_UNBALANCED_EDGE] = { "unbalanced_edges", { 140, 86, 75 } },
    [EBPO_FOUND_REPEATED_FACE] = { "repeated_faces", { 31, 119, 180 } },
    [EBPO_FOUND_INDEX_REPEATED_FACE] = { "index_repeated_faces", { 188, 189, 34 } },
    [EBPO_FOUND_ZERO_AREA_FACE] = { "zero_area_faces", { 255, 221, 0 } },
    [EBPO_FOUND_BOWTIE_VERTEX] = { "bowtie_vertices", { 227, 119, 194 } },
    [EBPO_FOUND_REPEATED_POSITION] = { "repeated_positions", { 44, 160, 44 } },
    [EBPO_FOUND_UNREFERENCED_VERTEX] = { "unreferenced_vertices", { 23, 190, 207 } },
};

const char *ebpo_finding_name(int32_t kind)
{
    return kind >= 0 && kind < EBPO_FINDING_KINDS ? kinds[kind].name : NULL;
}

void ebpo_finding_colour(int32_t kind, uint8_t rgb[3])
{
    static const uint8_t grey[3] = { 200, 200, 200 };
    memcpy(rgb, ebpo_finding_name(kind) ? kinds[kind].rgb : grey, 3);
}

static bool is_vertex(uint32_t kind) { return kind >= EBPO_FOUND_BOWTIE_VERTEX; }

/* ---- reporting ---- */

typedef struct finding_search {
    const ebpo_mesh *mesh;
    ebpo_findings_options options;
    ebpo_findings_fn take; /* receives each finding; NULL: none, or it has returned false */
    void *user;
    ebpo_found_list all; /* locations of all kinds, sorted */
    uint32_t *component; /* [vertex_count] component of each vertex */
    ebpo_stars stars;
    uint64_t *faces; /* faces around the current location */
    uint64_t face_count, face_capacity;
    findings_picture picture;
} finding_search;

/* A location with its sort key: its kind << 32 | the index in the report. */
typedef struct keyed {
    uint64_t key;
    uint64_t ends; /* source indices of an edge's vertices; otherwise 0 */
    ebpo_found found;
} keyed;

/* A key has at most 36 bits: 4 for the kind and 32 for the index. Shifted right by KEY_SHIFT, a key
 * is below EBPO_SORT_BINS, as ebpo_sort requires. */
enum { KEY_SHIFT = 18 };

typedef struct sorting {
    const ebpo_mesh *mesh;
    const ebpo_found *from; /* unsorted locations */
    ebpo_found *to;         /* receives the sorted locations */
} sorting;

/* Functions of ebpo_sort for the sort of locations. */
static ebpo_status make_keyed(void *context, uint64_t begin, uint64_t end, void *records,
                              ebpo_error *error)
{
    const sorting *s = context;
    keyed *out = records;
    (void)error;
    for (uint64_t i = begin; i < end; i++, out++) {
        *out = (keyed){ .key = (uint64_t)s->from[i].kind << 32 | s->from[i].location,
                        .found = s->from[i] };
        if (ebpo_found_is_edge(s->from[i].kind))
            out->ends = ebpo_mesh_source_vertex(s->mesh, s->from[i].a) << 32 |
                        ebpo_mesh_source_vertex(s->mesh, s->from[i].b);
    }
    return EBPO_OK;
}

static int compare_keyed(const void *x, const void *y)
{
    const keyed *a = x, *b = y;
    return a->ends < b->ends ? -1 : a->ends > b->ends;
}

static void store_keyed(void *context, uint64_t place, const void *records, uint64_t count)
{
    const sorting *s = context;
    const keyed *in = records;
    for (uint64_t i = 0; i < count; i++)
        s->to[place + i] = in[i].found;
}

/* Concatenates the lists of the workers. */
static ebpo_status join_lists(const finding_search *p, const ebpo_found_list *lists, unsigned count,
                              ebpo_found_list *out, ebpo_error *error)
{
    ebpo_workspace *workspace = p->mesh->workspace;
    uint64_t all = 0;
    for (unsigned t = 0; t < count; t++) {
        all += lists[t].count;
        if (lists[t].short_of_memory)
            return ebpo_workspace_fail(workspace, 2 * lists[t].count * sizeof *out->item, error);
    }
    out->item = ebpo_array_alloc(workspace, all + 1, sizeof *out->item);
    if (!out->item)
        return ebpo_workspace_fail(workspace, all * sizeof *out->item, error);
    for (unsigned t = 0; t < count; t++) {
        ebpo_array_copy(workspace, out->item + out->count, lists[t].item,
                        lists[t].count * sizeof *out->item);
        out->count += lists[t].count;
    }
    return EBPO_OK;
}

/* Gathers all locations in one sorted list, which does not depend on the number of threads. */
static ebpo_status gather_findings(finding_search *p, const ebpo_found_list *lists, unsigned count,
                                   ebpo_error *error)
{
    ebpo_workspace *workspace = p->mesh->workspace;
    ebpo_found_list joined = { NULL, 0, 0, false };
    ebpo_status status = join_lists(p, lists, count, &joined, error);
    if (status == EBPO_OK)
        p->all.item = ebpo_array_alloc(workspace, joined.count + 1, sizeof *p->all.item);
    if (status == EBPO_OK && !p->all.item)
        status = ebpo_workspace_fail(workspace, joined.count * sizeof *p->all.item, error);
    p->all.count = joined.count;
    sorting s = { p->mesh, joined.item, p->all.item };
    const ebpo_sort sort = { .workspace = workspace,
                             .threads = ebpo_thread_count(p->options.threads),
                             .progress = &p->options.progress,
                             .stage = "sorting findings",
                             .count = joined.count,
                             .record = sizeof(keyed),
                             .shift = KEY_SHIFT,
                             .context = &s,
                             .make = make_keyed,
                             .compare = compare_keyed,
                             .take = store_keyed };
    if (status == EBPO_OK && joined.count)
        status = ebpo_sort_run(&sort, error);
    ebpo_array_free(workspace, joined.item);
    return status;
}

static bool has_corner(const uint32_t face[3], uint32_t v)
{
    return face[0] == v || face[1] == v || face[2] == v;
}

static int compare_numbers(const void *x, const void *y)
{
    const uint64_t *a = x, *b = y;
    return *a < *b ? -1 : *a > *b;
}

/* Collects the faces that have all `count` corners, as indices in the current mesh. Searches the
 * faces at the corner with the fewest faces, because another corner may have very many faces.
 * Returns false when out of memory. */
static bool gather_faces(finding_search *p, const uint32_t *corner, int count)
{
    uint32_t vertex = corner[0];
    for (int i = 1; i < count; i++)
        if (ebpo_stars_degree(&p->stars, corner[i]) < ebpo_stars_degree(&p->stars, vertex))
            vertex = corner[i];
    p->face_count = 0;
    if (!ebpo_array_grow_late(p->mesh->workspace, &p->faces, &p->face_capacity,
                              ebpo_stars_degree(&p->stars, vertex), sizeof *p->faces))
        return false;
    for (uint64_t i = p->stars.first[vertex]; i < p->stars.first[vertex + (uint64_t)1]; i++) {
        const uint32_t *face = p->mesh->faces + 3 * (uint64_t)p->stars.face[i];
        bool all = true;
        for (int k = 0; k < count; k++)
            all = all && has_corner(face, corner[k]);
        if (all)
            p->faces[p->face_count++] = p->stars.face[i];
    }
    return true;
}

/* Collects the faces of a finding, as indices in the current mesh. Returns false when out of
 * memory. */
static bool faces_of(finding_search *p, const ebpo_found *f)
{
    if (ebpo_found_is_edge(f->kind))
        return gather_faces(p, (const uint32_t[2]){ f->a, f->b }, 2);
    if (is_vertex(f->kind))
        return gather_faces(p, &f->a, 1);
    if (!ebpo_array_grow_late(p->mesh->workspace, &p->faces, &p->face_capacity, 2,
                              sizeof *p->faces))
        return false;
    p->faces[0] = f->a;
    p->faces[1] = f->b;
    p->face_count = f->kind == EBPO_FOUND_REPEATED_FACE ? 2 : 1;
    return true;
}

/* Writes the vertices of a finding, as indices in the current mesh. Returns their number: two for
 * an edge, one for a vertex, three for a face. */
static int vertices_of(const finding_search *p, const ebpo_found *f, uint32_t out[3])
{
    if (!ebpo_found_is_edge(f->kind) && !is_vertex(f->kind)) {
        memcpy(out, p->mesh->faces + 3 * (uint64_t)f->a, 3 * sizeof *out);
        return 3;
    }
    out[0] = f->a;
    out[1] = f->b;
    return ebpo_found_is_edge(f->kind) ? 2 : 1;
}

/* Returns the finding in source indices. Converts p->faces to source indices. */
static ebpo_mesh_finding make_finding(finding_search *p, const ebpo_found *f)
{
    uint32_t v[3];
    int count = vertices_of(p, f, v);
    ebpo_mesh_finding finding = { .kind = (int32_t)f->kind, .component = p->component[v[0]] };
    for (int i = 0; i < count; i++) {
        double x[3];
        ebpo_mesh_position(p->mesh, v[i], x);
        for (int k = 0; k < 3; k++)
            finding.point[k] += x[k] / count;
    }
    for (int i = 0; i < 2; i++)
        finding.vertex[i] = ebpo_mesh_source_vertex(p->mesh, v[count == 1 ? 0 : i]);
    for (uint64_t i = 0; i < p->face_count; i++)
        p->faces[i] = ebpo_mesh_source_face(p->mesh, p->faces[i]);
    qsort(p->faces, p->face_count, sizeof *p->faces, compare_numbers);
    finding.faces = p->face_count ? p->faces : NULL;
    finding.face_count = p->face_count;
    return finding;
}

enum { BETWEEN_STEPS = 1 << 12 }; /* number of findings between two reports of progress */

/* Passes all findings to the caller and to the picture. */
static ebpo_status report_all(finding_search *p, ebpo_error *error)
{
    ebpo_workspace *workspace = p->mesh->workspace;
    EBPO_FOR_ITEMS(workspace, i, 0, p->all.count) {
        const ebpo_found *f = &p->all.item[i];
        if (!faces_of(p, f))
            return ebpo_workspace_fail(workspace, p->face_capacity * 2 * sizeof *p->faces, error);
        if (p->options.ply)
            record_in_picture(&p->picture, f, p->faces, p->face_count);
        if (i % BETWEEN_STEPS == 0 &&
            !ebpo_progress_step(&p->options.progress, "findings", i, p->all.count, error))
            return EBPO_E_CANCELLED;
        ebpo_mesh_finding finding = make_finding(p, f);
        if (p->take && !p->take(p->user, &finding)) {
            p->take = NULL;
            if (!p->options.ply)
                break;
        }
    }
    return EBPO_OK;
}

/* ---- entry point ---- */

/* Checks the mesh, and sets p->all to the locations that the check has recorded. */
static ebpo_status record_all(finding_search *p, ebpo_mesh_report *report, ebpo_error *error)
{
    unsigned threads = ebpo_thread_count(p->options.threads);
    ebpo_found_list *lists = ebpo_alloc_zero(threads, sizeof *lists);
    if (!lists)
        return ebpo_fail_memory(error, threads * sizeof *lists);
    ebpo_check check = { .mesh = p->mesh,
                         .threads = threads,
                         .progress = p->options.progress,
                         .report = report,
                         .found = lists };
    ebpo_status status = ebpo_check_run(&check, error);
    if (status == EBPO_OK)
        status = gather_findings(p, lists, threads, error);
    for (unsigned t = 0; t < threads; t++)
        ebpo_array_free(p->mesh->workspace, lists[t].item);
    free(lists);
    return status;
}

static ebpo_status find_all(finding_search *p, ebpo_mesh_report *report, ebpo_error *error)
{
    ebpo_status status = record_all(p, report, error);
    if (status == EBPO_OK)
        status = ebpo_components_number(p->mesh, &p->component, error);
    if (status == EBPO_OK)
        status = ebpo_stars_build(&p->stars, p->mesh, ebpo_thread_count(p->options.threads),
                                  &p->options.progress, error);
    if (status == EBPO_OK && p->options.ply)
        status = begin_picture(&p->picture, p->mesh, p->options.ply, error);
    if (status == EBPO_OK)
        status = report_all(p, error);
    if (status == EBPO_OK && p->options.ply)
        status = write_picture(&p->picture, report, error);
    return status;
}

ebpo_status ebpo_mesh_findings(const ebpo_mesh *mesh, const ebpo_findings_options *options,
                               ebpo_findings_fn take, void *user, ebpo_mesh_report *report,
                               ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    finding_search p = { .mesh = mesh,
                         .options = EBPO_FINDINGS_OPTIONS_INIT,
                         .take = take,
                         .user = user,
                         .picture = PICTURE_INIT };
    ebpo_mesh_report found = { .edges = 0 };
    ebpo_status status = EBPO_TAKE(ebpo_findings_options, &p.options, options, error);
    if (status == EBPO_OK)
        status = find_all(&p, &found, error);
    ebpo_array_free(mesh->workspace, p.all.item);
    ebpo_array_free(mesh->workspace, p.component);
    ebpo_array_free(mesh->workspace, p.faces);
    ebpo_stars_free(&p.stars);
    end_picture(&p.picture);
    if (report)
        *report = found;
    return status;
}

enum {
    NOTHING = UINT8_MAX, /* in findings_picture.face */
    /* bytes in the PLY file. A vertex has three doubles. A face has the number of corners, three
     * indices and a colour */
    VERTEX_BYTES = 3 * 8,
    FACE_BYTES = 1 + 3 * 4 + 3
};

static ebpo_status begin_picture(findings_picture *picture, const ebpo_mesh *mesh, const char *path,
                                 ebpo_error *error)
{
    picture->mesh = mesh;
    picture->face = ebpo_array_alloc(mesh->workspace, mesh->face_count, 1);
    if (!picture->face)
        return ebpo_workspace_fail(mesh->workspace, mesh->face_count, error);
    ebpo_array_fill(mesh->workspace, picture->face, NOTHING, mesh->face_count);
    return ebpo_publish_begin(&picture->target, path, error);
}

static void record_in_picture(findings_picture *picture, const ebpo_found *found,
                              const uint64_t *faces, uint64_t count)
{
    uint8_t kind = (uint8_t)found->kind;
    for (uint64_t i = 0; i < count; i++)
        if (kind < picture->face[faces[i]])
            picture->face[faces[i]] = kind;
}

/* Returns the number of findings of a kind. */
static uint64_t count_of(const ebpo_mesh_report *r, int kind)
{
    const uint64_t counts[EBPO_FINDING_KINDS] = {
        [EBPO_FOUND_BOUNDARY_EDGE] = r->boundary_edges.count,
        [EBPO_FOUND_NONMANIFOLD_EDGE] = r->nonmanifold_edges.count,
        [EBPO_FOUND_MISORIENTED_EDGE] = r->misoriented_edges.count,
        [EBPO_FOUND_UNBALANCED_EDGE] = r->unbalanced_edges.count,
        [EBPO_FOUND_REPEATED_FACE] = r->repeated_faces.count,
        [EBPO_FOUND_INDEX_REPEATED_FACE] = r->index_repeated_faces.count,
        [EBPO_FOUND_ZERO_AREA_FACE] = r->zero_area_faces.count,
        [EBPO_FOUND_BOWTIE_VERTEX] = r->bowtie_vertices.count,
        [EBPO_FOUND_REPEATED_POSITION] = r->repeated_positions.count,
        [EBPO_FOUND_UNREFERENCED_VERTEX] = r->unreferenced_vertices.count,
    };
    return counts[kind];
}

static void print_header(const findings_picture *p, FILE *f, const ebpo_mesh_report *report)
{
    fputs("ply\nformat binary_little_endian 1.0\n", f);
    for (int kind = 0; kind < EBPO_FINDING_KINDS; kind++) {
        uint8_t rgb[3];
        ebpo_finding_colour(kind, rgb);
        if (count_of(report, kind))
            fprintf(f, "comment %s %" PRIu64 ": %u %u %u\n", ebpo_finding_name(kind),
                    count_of(report, kind), rgb[0], rgb[1], rgb[2]);
    }
    fprintf(f,
            "element vertex %" PRIu64 "\nproperty double x\nproperty double y\nproperty double z\n"
            "element face %" PRIu64 "\nproperty list uchar uint vertex_indices\n"
            "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n",
            p->mesh->vertex_count, p->mesh->face_count);
}

/* Writes the colour of a kind; NOTHING is grey. */
static void put_colour(uint8_t kind, uint8_t rgb[3])
{
    ebpo_finding_colour(kind == NOTHING ? -1 : kind, rgb);
}

/* Returns the indices of vertices or faces, sorted by their source indices, or NULL when out of
 * memory. source: [count] source indices; the indices of dropped faces may be missing. */
static uint32_t *in_source_order(const ebpo_mesh *mesh, const uint32_t *source, uint64_t count)
{
    uint64_t size = count;
    EBPO_FOR_ITEMS(mesh->workspace, i, 0, count)
        size = source[i] >= size ? source[i] + (uint64_t)1 : size;
    uint32_t *order = ebpo_array_alloc(mesh->workspace, size, sizeof *order);
    if (!order)
        return NULL;
    ebpo_array_fill(mesh->workspace, order, 0xff, size * sizeof *order);
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, 0, count)
        order[source[i]] = (uint32_t)i;
    uint64_t kept = 0;
    EBPO_FOR_ITEMS(mesh->workspace, i, 0, size)
        if (order[i] != EBPO_NO_INDEX)
            order[kept++] = order[i];
    return order;
}

static bool put_vertex(const findings_picture *p, FILE *f, uint64_t v)
{
    uint8_t row[VERTEX_BYTES];
    double x[3];
    ebpo_mesh_position(p->mesh, v, x);
    for (int k = 0; k < 3; k++) {
        uint64_t bits;
        memcpy(&bits, &x[k], sizeof bits);
        ebpo_store64(row + 8 * k, bits);
    }
    return fwrite(row, 1, sizeof row, f) == sizeof row;
}

/* Writes a face. `rank`: position of each vertex in the written order; NULL: the order is
 * unchanged. */
static bool put_face(const findings_picture *p, FILE *f, uint64_t face, const uint32_t *rank)
{
    uint8_t row[FACE_BYTES] = { 3 };
    for (int k = 0; k < 3; k++) {
        uint32_t v = p->mesh->faces[3 * face + (unsigned)k];
        ebpo_store32(row + 1 + 4 * k, rank ? rank[v] : v);
    }
    put_colour(p->face[face], row + 13);
    return fwrite(row, 1, sizeof row, f) == sizeof row;
}

/* The order in which vertices and faces are written, and the position of each vertex in this order.
 * NULL: the order of the mesh. */
typedef struct written {
    uint32_t *vertices, *faces, *rank;
} written;

/* Sets *w to the order of the source. */
static ebpo_status order_all(const ebpo_mesh *mesh, written *w, ebpo_error *error)
{
    const struct ebpo_arrangement *a = mesh->arrangement;
    if (!a)
        return EBPO_OK;
    w->vertices = in_source_order(mesh, a->vertex_source, mesh->vertex_count);
    w->faces = in_source_order(mesh, a->face_source, mesh->face_count);
    w->rank = ebpo_array_alloc(mesh->workspace, mesh->vertex_count, sizeof *w->rank);
    if (!w->vertices || !w->faces || !w->rank)
        return ebpo_workspace_fail(mesh->workspace, mesh->face_count * sizeof *w->faces, error);
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, 0, mesh->vertex_count)
        w->rank[w->vertices[i]] = (uint32_t)i;
    return EBPO_OK;
}

static bool put_all(const findings_picture *p, FILE *f, const written *w)
{
    const ebpo_mesh *mesh = p->mesh;
    bool good = true;
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, 0, mesh->vertex_count)
        good = good && put_vertex(p, f, w->vertices ? w->vertices[i] : i);
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, 0, mesh->face_count)
        good = good && put_face(p, f, w->faces ? w->faces[i] : i, w->rank);
    return good;
}

static ebpo_status write_picture(findings_picture *picture, const ebpo_mesh_report *report,
                                 ebpo_error *error)
{
    const ebpo_mesh *mesh = picture->mesh;
    written w = { NULL, NULL, NULL };
    FILE *f = ebpo_publish_stream(&picture->target);
    ebpo_status status = f ? EBPO_OK : ebpo_fail_memory(error, BUFSIZ);
    if (status == EBPO_OK)
        status = order_all(mesh, &w, error);
    if (status == EBPO_OK) {
        print_header(picture, f, report);
        if (!put_all(picture, f, &w) || ferror(f))
            status = ebpo_fail_errno(error, picture->target.shown, "could not be written");
    }
    ebpo_array_free(mesh->workspace, w.vertices);
    ebpo_array_free(mesh->workspace, w.faces);
    ebpo_array_free(mesh->workspace, w.rank);
    return status == EBPO_OK ? ebpo_publish_commit(&picture->target, error) : status;
}

static void end_picture(findings_picture *picture)
{
    if (picture->mesh)
        ebpo_array_free(picture->mesh->workspace, picture->face);
    ebpo_publish_abort(&picture->target);
}
