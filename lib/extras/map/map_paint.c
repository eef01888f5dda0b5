/* Distances and their colours as attributes of a mesh's vertices. */
#include "core/strict_fp.h"

#include <ebpo/map.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "mesh/attributes.h"
#include "core/workspace.h"
#include "core/error.h"
#include "core/fp_env.h"

static bool has_name(const char *names, const char *name)
{
    size_t length = strlen(name);
    for (const char *at = names; *at;) {
        size_t n = strcspn(at, " ");
        if (n == length && memcmp(at, name, n) == 0)
            return true;
        at += n + (at[n] == ' ');
    }
    return false;
}

static bool replaced(const ebpo_attribute *a)
{
    static const char *const names[] = { "distance", "red", "green", "blue" };
    for (int i = 0; i < 4; i++)
        if (ebpo_attribute_is_of(a, "vertex") && has_name(a->names, names[i]))
            return true;
    return false;
}

static ebpo_attribute *add(ebpo_mesh *mesh, const char *names, ebpo_attribute_type type,
                           uint32_t columns)
{
    ebpo_attribute like = {
        .type = type, .list = EBPO_ATTRIBUTE_NO_LIST, .columns = columns, .rows = mesh->vertex_count
    };
    snprintf(like.element, sizeof like.element, "vertex");
    snprintf(like.names, sizeof like.names, "%s", names);
    ebpo_attribute *a = ebpo_attributes_add(mesh->attributes, &like);
    if (a && !ebpo_attribute_reserve(mesh->attributes->workspace, a, mesh->vertex_count, 0)) {
        ebpo_attributes_remove(mesh->attributes, mesh->attributes->count - 1);
        return NULL;
    }
    return a;
}

ebpo_status ebpo_map_paint(ebpo_mesh *mesh, const double *distances, ebpo_map_palette palette,
                           double range, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    if ((unsigned)palette >= EBPO_MAP_PALETTES || !(range > 0) || !isfinite(range))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "painting takes one of the palettes, and a finite range above 0");
    if (!mesh->attributes)
        mesh->attributes = ebpo_attributes_make(mesh->workspace);
    for (uint64_t i = mesh->attributes ? mesh->attributes->count : 0; i-- > 0;)
        if (replaced(&mesh->attributes->array[i]))
            ebpo_attributes_remove(mesh->attributes, i);
    if (mesh->attributes && mesh->attributes->count > EBPO_ATTRIBUTE_ARRAYS - 2)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the mesh has so many attributes that no more fit; leave some out");
    ebpo_attribute *colour =
        mesh->attributes ? add(mesh, "red green blue", EBPO_ATTRIBUTE_UINT8, 3) : NULL;
    uint8_t *rgb = colour ? colour->values : NULL; /* adding moves the struct */
    ebpo_attribute *distance = colour ? add(mesh, "distance", EBPO_ATTRIBUTE_FLOAT64, 1) : NULL;
    if (!distance)
        return ebpo_fail_memory(error, mesh->vertex_count * 11);
    memcpy(distance->values, distances, mesh->vertex_count * sizeof *distances);
    for (uint64_t i = 0; i < mesh->vertex_count; i++)
        ebpo_map_colour(palette, distances[i], range, rgb + 3 * i);
    return EBPO_OK;
}
