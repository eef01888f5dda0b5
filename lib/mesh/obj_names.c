#include "core/strict_fp.h"

#include "mesh/obj_names.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "mesh/attributes.h"
#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "core/text.h"
#include "core/hash.h"

enum { RUNS_MOST = 100000000, MATERIALS_MOST = 10000000 };

void ebpo_obj_runs_free(ebpo_obj_runs *runs)
{
    free(runs->of);
    *runs = (ebpo_obj_runs){ 0 };
}

ebpo_status ebpo_obj_runs_add(ebpo_obj_runs *runs, obj_word run, const char *name,
                              ebpo_error *error)
{
    if (runs->count == RUNS_MOST)
        return ebpo_fail_file(error, EBPO_E_LIMIT, name,
                              "has more than %d lines that name groups; leave some out", RUNS_MOST);
    if (!ebpo_grow(&runs->of, &runs->capacity, runs->count + 1, sizeof *runs->of))
        return ebpo_fail_memory(error, (runs->count + 1) * sizeof *runs->of);
    runs->of[runs->count++] = (ebpo_named_run){ .name = run.s, .size = run.n };
    return EBPO_OK;
}

/* --- materials --- */

static uint64_t hash_of(obj_word word)
{
    uint64_t hash = word.n;
    for (size_t i = 0; i < word.n; i++)
        hash = hash * 31 + (uint8_t)word.s[i];
    return ebpo_hash_number(hash);
}

static bool same(obj_word a, obj_word b) { return a.n == b.n && memcmp(a.s, b.s, a.n) == 0; }

/* Place of the name in the table: where its number is, or would go. 0 is a free slot, as the number
 * 0 has no name. */
static uint64_t find(const obj_names *names, obj_word word)
{
    uint64_t at;
    EBPO_HASH_FIND(at, hash_of(word), names->slots - 1,
                   !names->slot[at] || same(names->material[names->slot[at]], word));
    return at;
}

static bool grow_table(obj_names *names)
{
    uint64_t slots = ebpo_hash_slots(4 * (names->count + 1));
    uint32_t *slot = ebpo_alloc_zero(slots, sizeof *slot);
    if (!slot)
        return false;
    free(names->slot);
    names->slot = slot;
    names->slots = slots;
    for (uint64_t i = 1; i < names->count; i++)
        slot[find(names, names->material[i])] = (uint32_t)i;
    return true;
}

ebpo_status ebpo_obj_use_material(obj_names *names, obj_word material, ebpo_error *error)
{
    if (names->count >= MATERIALS_MOST)
        return ebpo_fail(error, EBPO_E_LIMIT, "there are more than %d names of materials",
                         MATERIALS_MOST);
    uint64_t need = names->count ? names->count + 1 : 2;
    if (!ebpo_grow(&names->material, &names->capacity, need, sizeof *names->material) ||
        (2 * need > names->slots && !grow_table(names)))
        return ebpo_fail_memory(error, need * sizeof *names->material);
    if (!names->count)
        names->material[names->count++] = (obj_word){ "DefaultMaterial", 15 };
    uint64_t at = find(names, material);
    if (!names->slot[at]) {
        names->material[names->count] = material;
        names->slot[at] = (uint32_t)names->count++;
    }
    names->current = names->slot[at];
    return EBPO_OK;
}

ebpo_status ebpo_obj_give_material(obj_names *names, const ebpo_mesh *mesh, ebpo_error *error)
{
    if (!ebpo_array_grow(mesh->workspace, &names->of_face, &names->face_capacity, mesh->face_count,
                         sizeof *names->of_face))
        return ebpo_workspace_fail(mesh->workspace, mesh->face_count * sizeof *names->of_face,
                                   error);
    while (names->faces < mesh->face_count)
        names->of_face[names->faces++] = names->current;
    return EBPO_OK;
}

static void print_names(FILE *out, const obj_names *names)
{
    for (uint64_t i = 0; i < names->count; i++) {
        fprintf(out, "comment material %llu ", (unsigned long long)i);
        for (size_t k = 0; k < names->material[i].n; k++) {
            char c = names->material[i].s[k];
            fputc((unsigned char)c < ' ' || c == 127 ? '?' : c, out);
        }
        fputc('\n', out);
    }
}

static void print_properties(FILE *out, const ebpo_attributes *attributes, const char *element)
{
    for (uint64_t i = 0; i < attributes->count; i++) {
        const ebpo_attribute *a = &attributes->array[i];
        const char *type = a->type == EBPO_ATTRIBUTE_FLOAT32 ? "float" : "uint";
        const char *name = a->names;
        if (!ebpo_attribute_is_of(a, element))
            continue;
        if (a->list != EBPO_ATTRIBUTE_NO_LIST)
            fprintf(out, "property list uchar %s %s\n", type, name);
        else
            for (size_t n; (n = strcspn(name, " ")) > 0; name += n + (name[n] == ' '))
                fprintf(out, "property %s %.*s\n", type, (int)n, name);
    }
}

/* A header of PLY, as such files are written again. */
static ebpo_status make_header(const ebpo_mesh *mesh, const obj_names *names, ebpo_error *error)
{
    ebpo_attributes *attributes = mesh->attributes;
    const char *type = mesh->xyz64 ? "double" : "float";
    ebpo_text_stream text;
    if (!ebpo_text_stream_begin(&text))
        return ebpo_fail_memory(error, BUFSIZ);
    FILE *out = text.file;
    fputs("ply\nformat binary_little_endian 1.0\n", out);
    print_names(out, names);
    fprintf(out, "element vertex 0\nproperty %s x\nproperty %s y\nproperty %s z\n", type, type,
            type);
    print_properties(out, attributes, "vertex");
    fputs("element face 0\nproperty list uchar int vertex_indices\n", out);
    print_properties(out, attributes, "face");
    fputs("end_header\n", out);
    if (!ebpo_text_stream_end(&text))
        return ebpo_fail_memory(error, text.bytes);
    if (text.bytes > EBPO_ATTRIBUTE_HEADER) {
        free(text.text);
        ebpo_attributes_lose(attributes, "names of materials (more than 1 MiB)");
        return EBPO_OK;
    }
    attributes->header = text.text;
    attributes->header_bytes = text.bytes;
    return EBPO_OK;
}

ebpo_status ebpo_obj_keep_materials(obj_names *names, ebpo_mesh *mesh, ebpo_error *error)
{
    ebpo_attribute head = { .element = "face", .names = "material", .columns = 1 };
    if (!names->count)
        return EBPO_OK;
    head.type = EBPO_ATTRIBUTE_UINT32;
    head.list = EBPO_ATTRIBUTE_NO_LIST;
    head.rows = mesh->face_count;
    ebpo_attribute *a = ebpo_attributes_add(mesh->attributes, &head);
    if (!a)
        return ebpo_fail_memory(error, sizeof *a);
    a->values = ebpo_array_alloc(mesh->workspace, mesh->face_count, sizeof *names->of_face);
    if (!a->values)
        return ebpo_workspace_fail(mesh->workspace, mesh->face_count * sizeof *names->of_face,
                                   error);
    ebpo_array_copy(mesh->workspace, a->values, names->of_face,
                    mesh->face_count * sizeof *names->of_face);
    return make_header(mesh, names, error);
}

void ebpo_obj_names_free(obj_names *names, ebpo_workspace *workspace)
{
    free(names->material);
    free(names->slot);
    ebpo_array_free(workspace, names->of_face);
}
