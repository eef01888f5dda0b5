/* Compares the mesh in a file with its source mesh.
 *
 * The recorded repairs are repeated on a copy of the source. Afterwards, the copy must be equal to
 * the file's mesh bit for bit. If the file's mesh is in the source's order, vertices and faces are
 * compared one by one. Otherwise they are compared as multisets. For a subset, or the file of one
 * component, faces and vertices are compared by their source indices. The file must have the
 * attributes of the source, in the same order, except for attributes of omitted elements. If an
 * earlier version of the program has rounded the coordinates, only this fact is reported. */
#include "verify/verify_parts.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "mesh/attributes.h"
#include "mesh/textures.h"
#include "core/alloc.h"
#include "core/error.h"
#include "core/workspace.h"
#include "core/sort.h"
#include "format/reader.h"
#include "mesh/mesh_parts.h"

#define CHECK(condition, ...) ebpo_tally_check(tally, EBPO_VERIFY_SOURCE, condition, __VA_ARGS__)

static size_t vertex_size(const ebpo_mesh *mesh)
{
    return mesh->xyz32 ? 3 * sizeof *mesh->xyz32 : 3 * sizeof *mesh->xyz64;
}

static const char *vertex_bytes(const ebpo_mesh *mesh, uint64_t i)
{
    return (mesh->xyz32 ? (const char *)mesh->xyz32 : (const char *)mesh->xyz64) +
           i * vertex_size(mesh);
}

/* Copies a mesh with its attributes. */
static ebpo_status copy_mesh(ebpo_mesh *out, const ebpo_mesh *mesh, ebpo_workspace *workspace,
                             ebpo_error *error)
{
    *out = *mesh;
    out->workspace = workspace;
    out->attributes = NULL; /* copied below */
    out->xyz32 = NULL;
    out->xyz64 = NULL;
    out->faces = ebpo_array_alloc(workspace, mesh->face_count, 3 * sizeof *out->faces);
    void *xyz = ebpo_array_alloc(workspace, mesh->vertex_count, vertex_size(mesh));
    if (mesh->xyz32)
        out->xyz32 = xyz;
    else
        out->xyz64 = xyz;
    if (!out->faces || !xyz) {
        ebpo_mesh_free(out);
        return ebpo_workspace_fail(workspace,
                                   mesh->vertex_count * vertex_size(mesh) + mesh->face_count * 12,
                                   error);
    }
    EBPO_FOR_ITEMS(workspace, i, 0, mesh->face_count)
        memcpy(out->faces + 3 * i, mesh->faces + 3 * i, 3 * sizeof *out->faces);
    EBPO_FOR_ITEMS(workspace, i, 0, mesh->vertex_count)
        memcpy((char *)xyz + i * vertex_size(mesh), vertex_bytes(mesh, i), vertex_size(mesh));
    ebpo_status status = ebpo_attributes_copy(&out->attributes, mesh->attributes, workspace, error);
    if (status != EBPO_OK)
        ebpo_mesh_free(out);
    return status;
}

/* Returns the repair steps that the record implies. (If faces were flipped without the step
 * `orient`, then the step `flip` has flipped all faces.) */
static unsigned steps_of(const ebpo_repair_record *to_repeat)
{
    return (to_repeat->weld ? EBPO_REPAIR_WELD : 0) | (to_repeat->orient ? EBPO_REPAIR_ORIENT : 0) |
           (to_repeat->dropped_faces ? EBPO_REPAIR_DROP : 0) |
           (!to_repeat->orient && to_repeat->flipped_faces ? EBPO_REPAIR_FLIP : 0) |
           (to_repeat->fill_holes ? EBPO_REPAIR_FILL : 0);
}

/* Sets *mesh to a copy of the source, repeats the recorded repairs on it, and sets *repeated to
 * their record. If the number of flipped faces differs from the recorded number, does this again
 * with the repairs of earlier versions of the program, which flipped fewer faces. */
static ebpo_status repair_again(ebpo_mesh *mesh, const ebpo_mesh *source,
                                const ebpo_repair_record *to_repeat, ebpo_repair_record *repeated,
                                ebpo_workspace *workspace, ebpo_error *error)
{
    const ebpo_repair_record fresh = *repeated;
    ebpo_status status = copy_mesh(mesh, source, workspace, error);
    if (status == EBPO_OK)
        status =
            ebpo_mesh_repair(mesh, steps_of(to_repeat), to_repeat->weld_distance, repeated, error);
    if (status != EBPO_OK || !to_repeat->orient ||
        repeated->flipped_faces == to_repeat->flipped_faces)
        return status;
    *repeated = fresh;
    ebpo_mesh_free(mesh);
    status = copy_mesh(mesh, source, workspace, error);
    return status == EBPO_OK ? ebpo_mesh_repair(mesh, steps_of(to_repeat) | EBPO_REPAIR_EARLIER,
                                                to_repeat->weld_distance, repeated, error)
                             : status;
}

static void check_record(ebpo_tally *tally, const ebpo_repair_record *stored,
                         const ebpo_repair_record *repeated)
{
    CHECK(stored->welded_vertices == repeated->welded_vertices,
          "%" PRIu64 " welded vertices are recorded, but repeating the repair welds %" PRIu64,
          stored->welded_vertices, repeated->welded_vertices);
    CHECK(stored->weld_moved == repeated->weld_moved &&
              stored->collapsed_faces == repeated->collapsed_faces,
          "welding by up to %g is recorded, but repeating the repair moves vertices by up to %g",
          stored->weld_moved, repeated->weld_moved);
    CHECK(stored->dropped_faces == repeated->dropped_faces,
          "%" PRIu64 " dropped faces are recorded, but repeating the repair drops %" PRIu64,
          stored->dropped_faces, repeated->dropped_faces);
    CHECK(stored->flipped_faces == repeated->flipped_faces &&
              stored->unorientable_components == repeated->unorientable_components,
          "%" PRIu64 " flipped faces are recorded, but repeating the repair flips %" PRIu64,
          stored->flipped_faces, repeated->flipped_faces);
    CHECK(stored->filled_holes == repeated->filled_holes &&
              stored->added_faces == repeated->added_faces &&
              stored->unfilled_holes == repeated->unfilled_holes,
          "%" PRIu64 " faces filling holes are recorded, but repeating the repair adds %" PRIu64,
          stored->added_faces, repeated->added_faces);
}

static void compare_in_order(ebpo_tally *tally, const ebpo_mesh *a, const ebpo_mesh *b)
{
    size_t size = vertex_size(a);
    tally->checks[EBPO_VERIFY_SOURCE] += a->vertex_count + a->face_count;
    EBPO_FOR_ITEMS(a->workspace, i, 0, a->vertex_count)
        if (memcmp(vertex_bytes(a, i), vertex_bytes(b, i), size) != 0)
            ebpo_tally_violation(tally, EBPO_VERIFY_SOURCE,
                                 &(ebpo_verify_place){ 0, EBPO_NO_FACE, EBPO_NO_PLANE },
                                 "vertex %" PRIu64
                                 " of the source has another position in the file",
                                 i);
    EBPO_FOR_ITEMS(a->workspace, i, 0, a->face_count)
        if (memcmp(a->faces + 3 * i, b->faces + 3 * i, 3 * sizeof *a->faces) != 0)
            ebpo_tally_violation(tally, EBPO_VERIFY_SOURCE,
                                 &(ebpo_verify_place){ 0, i, EBPO_NO_PLANE },
                                 "the face (by its source index) has other corners in the file");
}

/* Returns true if element, names and type of two arrays of attributes are equal. */
static bool same_head(const ebpo_attribute *a, const ebpo_attribute *b)
{
    return strcmp(a->element, b->element) == 0 && strcmp(a->names, b->names) == 0 &&
           a->type == b->type && a->list == b->list;
}

/* Returns true if the image of a texture is missing in the source (row `at`) or in the file (row
 * i), so that the rows cannot be compared. */
static bool image_unknown(const ebpo_attribute *source, uint64_t at, const ebpo_attribute *stored,
                          uint64_t i)
{
    return !ebpo_texture_list(source, at).count || !ebpo_texture_list(stored, i).count;
}

/* Compares each row i of the file's array with row source_row[i] of the source's array, or with row
 * i if `source_row` is NULL. Skips rows of faces that repairs have added; the source indices of
 * these faces are at least source->rows. */
static void compare_rows(ebpo_tally *tally, const ebpo_attribute *source,
                         const ebpo_attribute *stored, const uint32_t *source_row,
                         ebpo_workspace *workspace)
{
    bool textures = ebpo_attribute_is_of_textures(stored);
    uint64_t differ = 0;
    EBPO_FOR_ITEMS_SCATTERED(workspace, i, 0, stored->rows) {
        uint64_t at = source_row ? source_row[i] : i;
        differ += at < source->rows && !ebpo_attribute_same_row(source, at, stored, i) &&
                  !(textures && image_unknown(source, at, stored, i));
    }
    tally->checks[EBPO_VERIFY_SOURCE] += stored->rows - 1;
    CHECK(differ == 0, "%" PRIu64 " rows of the attribute %s of %s are not those of the source",
          differ, stored->names, stored->element);
}

/* Returns the source indices of an array's rows, or NULL if row i of the file is row i of the
 * source. For elements other than vertices and faces, every file has all rows of the source in
 * their order. */
static const uint32_t *source_rows(const ebpo_attribute *array, const ebpo_maps *maps)
{
    if (maps && ebpo_attribute_is_of(array, "vertex"))
        return maps->vertex_source;
    return maps && ebpo_attribute_is_of(array, "face") ? maps->face_source : NULL;
}

/* Checks that the file has the attribute arrays of the source, in the same order, except for arrays
 * of omitted elements. `maps`: source indices of the file's vertices and faces; NULL: they are in
 * the source's order. */
static void compare_attributes(ebpo_tally *tally, const ebpo_mesh *source, const ebpo_mesh *stored,
                               const ebpo_maps *maps)
{
    const ebpo_attributes *a = source->attributes, *b = stored->attributes;
    uint64_t k = 0;
    for (uint64_t i = 0; a && b && i < a->count; i++) {
        bool match = k < b->count && same_head(&a->array[i], &b->array[k]);
        if (match)
            compare_rows(tally, &a->array[i], &b->array[k++], source_rows(&a->array[i], maps),
                         stored->workspace);
        else if (ebpo_attribute_is_of_mesh(&a->array[i]))
            CHECK(false, "the attribute %s of %s is not in the source's order", a->array[i].names,
                  a->array[i].element);
    }
}

static int compare_vertices(const void *a, const void *b, void *mesh)
{
    return memcmp(vertex_bytes(mesh, *(const uint32_t *)a),
                  vertex_bytes(mesh, *(const uint32_t *)b), vertex_size(mesh));
}

/* Compares the positions of the corners of face i of m and face j of n. */
static int face_order(const ebpo_mesh *m, uint64_t i, const ebpo_mesh *n, uint64_t j)
{
    int order = 0;
    for (uint64_t c = 0; c < 3 && order == 0; c++)
        order = memcmp(vertex_bytes(m, m->faces[3 * i + c]), vertex_bytes(n, n->faces[3 * j + c]),
                       vertex_size(m));
    return order;
}

static int compare_faces(const void *a, const void *b, void *mesh)
{
    return face_order(mesh, *(const uint32_t *)a, mesh, *(const uint32_t *)b);
}

/* Returns the indices 0 .. count - 1, sorted by `compare`. Returns NULL when out of memory. */
static uint32_t *sorted_order(const ebpo_mesh *mesh, uint64_t count,
                              int (*compare)(const void *, const void *, void *))
{
    uint32_t *order = ebpo_array_alloc(mesh->workspace, count, sizeof *order);
    if (!order)
        return NULL;
    EBPO_FOR_ITEMS(mesh->workspace, i, 0, count)
        order[i] = (uint32_t)i;
    ebpo_sort_with(order, count, sizeof *order, compare, (void *)(uintptr_t)mesh);
    return order;
}

/* Compares the faces (or, if `faces` is false, the vertices) of two meshes as multisets: sorts the
 * elements of both meshes, and compares them one by one. */
static ebpo_status compare_as_sets(ebpo_tally *tally, const ebpo_mesh *a, const ebpo_mesh *b,
                                   bool faces, ebpo_error *error)
{
    uint64_t count = faces ? a->face_count : a->vertex_count, differ = 0;
    uint32_t *left = sorted_order(a, count, faces ? compare_faces : compare_vertices);
    uint32_t *right = sorted_order(b, count, faces ? compare_faces : compare_vertices);
    bool short_of_memory = !left || !right;
    EBPO_FOR_ITEMS_SCATTERED(a->workspace, i, 0, short_of_memory ? 0 : count)
        differ += faces ? face_order(a, left[i], b, right[i]) != 0
                        : memcmp(vertex_bytes(a, left[i]), vertex_bytes(b, right[i]),
                                 vertex_size(a)) != 0;
    ebpo_array_free(a->workspace, left);
    ebpo_array_free(b->workspace, right);
    if (short_of_memory)
        return ebpo_workspace_fail(a->workspace, count * sizeof *left, error);
    tally->checks[EBPO_VERIFY_SOURCE] += count - 1;
    CHECK(differ == 0, "compared as sets, the %s of source and file differ",
          faces ? "faces" : "vertices");
    return EBPO_OK;
}

/* Sets (*out)[i] to the index in `whole` of the face with the source index i, or to EBPO_NO_INDEX
 * if the face was dropped. If source indices are the indices in `whole`, *out remains NULL. Sets
 * *source_count to the number of source indices. */
static ebpo_status list_positions(const ebpo_mesh *whole, uint32_t **out, uint64_t *source_count,
                                  ebpo_error *error)
{
    const struct ebpo_arrangement *order = whole->arrangement;
    *source_count = whole->face_count + (order ? order->dropped_faces : 0);
    if (!order)
        return EBPO_OK;
    uint32_t *positions = *out =
        ebpo_array_alloc(whole->workspace, *source_count, sizeof *positions);
    if (!positions)
        return ebpo_workspace_fail(whole->workspace, *source_count * sizeof *positions, error);
    ebpo_array_fill(whole->workspace, positions, 0xff, *source_count * sizeof *positions);
    EBPO_FOR_ITEMS_SCATTERED(whole->workspace, i, 0, whole->face_count)
        positions[order->face_source[i]] = (uint32_t)i;
    return EBPO_OK;
}

/* Returns true if face i of `part` has the same corners as the face of `whole` with the same source
 * index. */
static bool same_corners(const ebpo_mesh *whole, const uint32_t *positions, uint64_t source_count,
                         const ebpo_mesh *part, const ebpo_maps *maps, uint64_t i)
{
    uint64_t number = maps->face_source[i];
    if (number >= source_count || (positions && positions[number] == EBPO_NO_INDEX))
        return false;
    const uint32_t *corners = whole->faces + 3 * (positions ? positions[number] : number);
    for (uint64_t c = 0; c < 3; c++)
        if (corners[c] != maps->vertex_source[part->faces[3 * i + c]])
            return false;
    return true;
}

/* Compares each face and vertex of the file by its source index. This is done for a subset, for the
 * file of one component, and for a mesh from which repairs have dropped faces. */
static ebpo_status compare_some(ebpo_tally *tally, const ebpo_file *file, const ebpo_mesh *whole,
                                const ebpo_read_options *read, ebpo_error *error)
{
    ebpo_mesh part = { 0 };
    ebpo_maps maps = { .vertex_source = NULL };
    uint32_t *positions = NULL;
    uint64_t source_count = 0;
    ebpo_status status = ebpo_file_read_mesh(file, read, &part, error);
    if (status == EBPO_OK)
        status = ebpo_file_read_maps(file, read, &maps, error);
    if (status == EBPO_OK)
        status = list_positions(whole, &positions, &source_count, error);
    if (status == EBPO_OK && CHECK(!whole->xyz32 == !part.xyz32,
                                   "the source and the file have different kinds of coordinates")) {
        tally->checks[EBPO_VERIFY_SOURCE] += part.vertex_count + part.face_count;
        EBPO_FOR_ITEMS_SCATTERED(part.workspace, i, 0, part.vertex_count)
            if (maps.vertex_source[i] >= whole->vertex_count ||
                memcmp(vertex_bytes(whole, maps.vertex_source[i]), vertex_bytes(&part, i),
                       vertex_size(&part)) != 0)
                ebpo_tally_violation(tally, EBPO_VERIFY_SOURCE,
                                     &(ebpo_verify_place){ 0, EBPO_NO_FACE, EBPO_NO_PLANE },
                                     "vertex %" PRIu32
                                     " of the source has another position in the file",
                                     maps.vertex_source[i]);
        EBPO_FOR_ITEMS_SCATTERED(part.workspace, i, 0, part.face_count)
            if (!same_corners(whole, positions, source_count, &part, &maps, i))
                ebpo_tally_violation(
                    tally, EBPO_VERIFY_SOURCE,
                    &(ebpo_verify_place){ 0, maps.face_source[i], EBPO_NO_PLANE },
                    "the face (by its source index) has other corners in the file");
        compare_attributes(tally, whole, &part, &maps);
    }
    ebpo_array_free(whole->workspace, positions);
    ebpo_maps_free(&maps);
    ebpo_mesh_free(&part);
    return status;
}

/* Checks the source file's digest and size. Returns true if they match or are unknown. */
static bool check_digest(ebpo_tally *tally, const ebpo_info *info, const ebpo_mesh *source)
{
    static const uint8_t none[32];
    return memcmp(source->source_sha256, none, 32) == 0 ||
           CHECK(memcmp(source->source_sha256, info->source_sha256, 32) == 0 &&
                     source->source_size == info->source_size,
                 "the source file's digest or size is not the recorded one");
}

/* Returns true if an earlier version of the program has written the file and rounded its
 * coordinates. Earlier versions rounded the coordinates of OBJ, OFF and text STL to floats, even if
 * the text had more digits. */
static bool was_rounded(const ebpo_info *info, const ebpo_mesh *source)
{
    return source->xyz64 && !info->double_coordinates && source->source_format[0] &&
           strncmp(source->source_format, "ply", 3) != 0;
}

static ebpo_status compare_meshes(ebpo_tally *tally, const ebpo_mesh *repaired,
                                  const ebpo_mesh *stored, bool ordered, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    bool comparable = CHECK(!repaired->xyz32 == !stored->xyz32,
                            "the source and the file have different kinds of coordinates") &&
                      CHECK(repaired->vertex_count == stored->vertex_count &&
                                repaired->face_count == stored->face_count,
                            "the repaired source has %" PRIu64 " vertices and %" PRIu64
                            " faces, the file %" PRIu64 " and %" PRIu64,
                            repaired->vertex_count, repaired->face_count, stored->vertex_count,
                            stored->face_count);
    if (comparable && ordered)
        compare_in_order(tally, repaired, stored);
    if (comparable && ordered)
        compare_attributes(tally, repaired, stored, NULL);
    if (comparable && !ordered)
        status = compare_as_sets(tally, repaired, stored, false, error);
    if (comparable && !ordered && status == EBPO_OK)
        status = compare_as_sets(tally, repaired, stored, true, error);
    return status;
}

/* Returns true for the file of one component: it records that the source has more faces than the
 * file. */
static bool is_part(const ebpo_info *info)
{
    return info->source_face_count + info->repair_record.added_faces -
               info->repair_record.dropped_faces >
           info->face_count;
}

ebpo_status ebpo_check_source(ebpo_tally *tally, const ebpo_file *file, const ebpo_mesh *stored,
                              bool ordered, const ebpo_mesh *source, const ebpo_read_options *read,
                              ebpo_error *error)
{
    const ebpo_info *info = ebpo_file_info(file);
    if (check_digest(tally, info, source) && was_rounded(info, source)) {
        /* nothing else is compared, because rounding may have made vertices equal, and may have
         * changed how polygons are cut into triangles */
        CHECK(false, "coordinates were rounded to single precision by an earlier version; convert "
                     "again");
        return EBPO_OK;
    }
    CHECK(info->source_vertex_count == source->vertex_count &&
              info->source_face_count == source->face_count,
          "the source has %" PRIu64 " vertices and %" PRIu64 " faces, but the file records %" PRIu64
          " and %" PRIu64,
          source->vertex_count, source->face_count, info->source_vertex_count,
          info->source_face_count);
    ebpo_mesh repaired = { 0 };
    const ebpo_repair_record *to_repeat = &info->repair_record;
    bool unchanged = steps_of(to_repeat) == 0;
    ebpo_repair_record repeated = { .weld = info->repair_record.weld,
                                    .orient = info->repair_record.orient,
                                    .fill_holes = info->repair_record.fill_holes };
    ebpo_status status =
        unchanged ? EBPO_OK
                  : repair_again(&repaired, source, to_repeat, &repeated, read->workspace, error);
    if (status == EBPO_E_ARGUMENT) { /* the file's record is invalid */
        CHECK(false,
              "welding within %g is recorded, but the source cannot be welded within this distance",
              to_repeat->weld_distance);
        ebpo_mesh_free(&repaired);
        return EBPO_OK;
    }
    const ebpo_mesh *expected = unchanged ? source : &repaired;
    if (status == EBPO_OK)
        check_record(tally, &info->repair_record, &repeated);
    bool mapped = info->parts & EBPO_PART_MAPS; /* without maps, source indices are unknown */
    bool by_number = is_part(info) || (info->repair_record.dropped_faces && mapped);
    if (status == EBPO_OK && stored && info->repair_record.dropped_faces && !is_part(info))
        CHECK(expected->vertex_count == stored->vertex_count &&
                  expected->face_count == stored->face_count,
              "the repaired source has %" PRIu64 " vertices and %" PRIu64
              " faces, the file %" PRIu64 " and %" PRIu64,
              expected->vertex_count, expected->face_count, stored->vertex_count,
              stored->face_count);
    if (status == EBPO_OK && stored && !by_number)
        status = compare_meshes(tally, expected, stored, ordered, error);
    else if (status == EBPO_OK && mapped)
        status = compare_some(tally, file, expected, read, error);
    else if (status == EBPO_OK && stored)
        CHECK(mapped, "the file has a part of the source, but no maps that identify this part");
    ebpo_mesh_free(&repaired);
    return status;
}
