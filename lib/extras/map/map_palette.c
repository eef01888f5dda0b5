/* Maps distances to colours, and adds distances with their colours as attributes of a mesh's
 * vertices.
 *
 * There are two palettes. The diverging palette is computed in the colour space OKLab (B. Ottosson,
 * 2020), whose lightness agrees with perception; the matrices below define OKLab. The thesis
 * palette is the palette of the thesis EBP 2017.
 *
 * Existing vertex attributes named distance, red, green or blue are replaced. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include <ebpo/map.h>

#include "core/error.h"
#include "core/fp_env.h"
#include "core/workspace.h"
#include "mesh/attributes.h"

static const char *const palette_names[EBPO_MAP_PALETTES] = { "diverging", "thesis" };

const char *ebpo_map_palette_name(ebpo_map_palette palette)
{
    return (unsigned)palette < EBPO_MAP_PALETTES ? palette_names[palette] : NULL;
}

/* Returns the byte for a share of the greatest intensity: 0 for 0, 255 for 1. */
static uint8_t byte_of(double share)
{
    return share <= 0 ? 0 : share >= 1 ? 255 : (uint8_t)(share * 255 + 0.5);
}

/* Returns the intensity in sRGB, which is not linear, for a linear intensity (IEC 61966-2-1). */
static double srgb_of(double linear)
{
    return linear <= 0.0031308 ? 12.92 * linear : 1.055 * pow(linear, 1 / 2.4) - 0.055;
}

/* Converts a colour from OKLab to sRGB. */
static void rgb_of_oklab(double light, double a, double b, uint8_t rgb[3])
{
    static const double to_cone[3][2] = { { 0.3963377774, 0.2158037573 },
                                          { -0.1055613458, -0.0638541728 },
                                          { -0.0894841775, -1.2914855480 } },
                        to_rgb[3][3] = { { 4.0767416621, -3.3077115913, 0.2309699292 },
                                         { -1.2684380046, 2.6097574011, -0.3413193965 },
                                         { -0.0041960863, -0.7034186147, 1.7076147010 } };
    double cone[3];
    for (int i = 0; i < 3; i++) {
        double root = light + to_cone[i][0] * a + to_cone[i][1] * b;
        cone[i] = root * root * root;
    }
    for (int i = 0; i < 3; i++)
        rgb[i] = byte_of(
            srgb_of(to_rgb[i][0] * cone[0] + to_rgb[i][1] * cone[1] + to_rgb[i][2] * cone[2]));
}

/* Computes a colour of the diverging palette. share: distance / range, -1 to 1. The hues are 255
 * degrees inside and 50 degrees outside, which colour-blind readers can distinguish. Distance 0 is
 * light grey. Greater distances have darker and stronger colours. */
static void palette_diverging(double share, uint8_t rgb[3])
{
    /* cosine and sine of the hues inside and outside */
    static const double cosine[2] = { -0.2588190451, 0.6427876097 },
                        sine[2] = { -0.9659258263, 0.7660444431 };
    double far = fabs(share), chroma = 0.12 * far * (2 - far), light = 0.93 - 0.48 * far;
    int outside = share > 0;
    rgb_of_oklab(light, chroma * cosine[outside], chroma * sine[outside], rgb);
}

/* Computes a colour of the thesis palette: from red close to distance 0 over yellow, green and cyan
 * to blue at the range. Distance 0 is black. */
static void palette_thesis(double share, uint8_t rgb[3])
{
    double far = fabs(share), hue = 4 * far; /* 0 red, 1 yellow, 2 green, 3 cyan, 4 blue */
    double red = hue < 1 ? 1 : 2 - hue, blue = hue < 3 ? hue - 2 : 1,
           green = hue < 1   ? hue
                   : hue < 3 ? 1
                             : 4 - hue;
    rgb[0] = byte_of(far == 0 ? 0 : red);
    rgb[1] = byte_of(far == 0 ? 0 : green);
    rgb[2] = byte_of(far == 0 ? 0 : blue);
}

void ebpo_map_colour(ebpo_map_palette palette, double distance, double range, uint8_t rgb[3])
{
    EBPO_DEFAULT_FP;
    rgb[0] = rgb[1] = rgb[2] = 128;
    if (!isfinite(distance) || !(range > 0))
        return;
    double share = fmax(-1, fmin(1, distance / range));
    if (share == 0 && distance != 0) /* the quotient underflows, but this is not distance 0 */
        share = copysign(0x1p-1022, distance);
    if (palette == EBPO_MAP_THESIS)
        palette_thesis(share, rgb);
    else
        palette_diverging(share, rgb);
}

/* --- attributes --- */

/* Returns true if `names`, whose words are separated by spaces, contains `name`. */
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

/* Returns true if the new attributes replace a. */
static bool is_replaced(const ebpo_attribute *a)
{
    static const char *const names[] = { "distance", "red", "green", "blue" };
    for (int i = 0; i < 4; i++)
        if (ebpo_attribute_is_of(a, "vertex") && has_name(a->names, names[i]))
            return true;
    return false;
}

/* Adds an attribute of all vertices, and returns it; returns NULL if memory is short. */
static ebpo_attribute *add_attribute(ebpo_mesh *mesh, const char *names, ebpo_attribute_type type,
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
                         "expected an ebpo_map_palette, and a range that is finite and above 0");
    if (!mesh->attributes)
        mesh->attributes = ebpo_attributes_make(mesh->workspace);
    for (uint64_t i = mesh->attributes ? mesh->attributes->count : 0; i-- > 0;)
        if (is_replaced(&mesh->attributes->array[i]))
            ebpo_attributes_remove(mesh->attributes, i);
    if (mesh->attributes && mesh->attributes->count > EBPO_ATTRIBUTE_ARRAYS - 2)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the mesh has too many attributes to add two more; omit some of them");
    ebpo_attribute *colour =
        mesh->attributes ? add_attribute(mesh, "red green blue", EBPO_ATTRIBUTE_UINT8, 3) : NULL;
    /* The address of the values is taken now, because the next call can move the attribute. */
    uint8_t *rgb = colour ? colour->values : NULL;
    ebpo_attribute *distance =
        colour ? add_attribute(mesh, "distance", EBPO_ATTRIBUTE_FLOAT64, 1) : NULL;
    if (!distance)
        return ebpo_fail_memory(error, mesh->vertex_count * (3 + sizeof *distances));
    memcpy(distance->values, distances, mesh->vertex_count * sizeof *distances);
    for (uint64_t i = 0; i < mesh->vertex_count; i++)
        ebpo_map_colour(palette, distances[i], range, rgb + 3 * i);
    return EBPO_OK;
}
