/* ebpo-generate: makes closed, scan-like models of any size for trials and benchmarks. Equal
 * arguments give equal files, byte for byte. */
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/mesh.h>

#include "embedded.h"
#include "shapes.h"

typedef struct settings {
    const char *base, *output;
    uint64_t subdivide, faces, seed;
    double roughness, relief;
    bool subdivide_given, relief_given;
} settings;

static const char usage[] =
    "usage: ebpo-generate [options] OUTPUT.ply\n"
    "Writes a closed scan-like triangle mesh as a binary PLY.\n"
    "  --base sphere|torus|FILE  base shape; a file must contain a closed mesh (default sphere)\n"
    "  --subdivide N             split every face into four, N times\n"
    "  --faces N                 instead: at least N faces (sphere, file: the next power of four; "
    "torus: about N)\n"
    "  --seed S                  random seed of the surface (default 1)\n"
    "  --roughness R             height of the fine relief in local edge lengths, 0 to 0.5 "
    "(default 0.15)\n"
    "  --relief H                height of the broad relief of sphere (radius 1) and torus (tube "
    "0.4), 0 to 0.2 (default 0.08)\n"
    "The output is a closed manifold if the base is one. Sphere and torus never intersect "
    "themselves: this is proved for each file\n"
    "before it is written. A mesh made from a FILE may intersect itself, if the base does or if "
    "parts of it are closer than the roughness;\n"
    "tests/integration/crossing_faces checks it.\n";

static bool parse_count(const char *name, const char *text, uint64_t most, uint64_t *out)
{
    char *end;
    unsigned long long value = strtoull(text, &end, 10);
    if (text[0] < '0' || text[0] > '9' || *end || value > most) {
        fprintf(stderr, "ebpo-generate: --%s: expected a whole number from 0 to %llu, got \"%s\"\n",
                name, (unsigned long long)most, text);
        return false;
    }
    *out = value;
    return true;
}

static bool parse_height(const char *name, const char *text, double most, double *out)
{
    char *end;
    double value = strtod(text, &end);
    if (end == text || *end || !(value >= 0 && value <= most)) {
        fprintf(stderr, "ebpo-generate: --%s: expected a number from 0 to %g, got \"%s\"\n", name,
                most, text);
        return false;
    }
    *out = value;
    return true;
}

/* Parses the command line. Returns 0 to continue, 1 to end with success, 2 for wrong usage. */
static int parse(int argc, char **argv, settings *s)
{
    static const struct option options[] = { { "base", required_argument, NULL, 'b' },
                                             { "subdivide", required_argument, NULL, 'n' },
                                             { "faces", required_argument, NULL, 'f' },
                                             { "seed", required_argument, NULL, 's' },
                                             { "roughness", required_argument, NULL, 'r' },
                                             { "relief", required_argument, NULL, 'l' },
                                             { "help", no_argument, NULL, 'h' },
                                             { NULL, 0, NULL, 0 } };
    *s = (settings){ .base = "sphere", .seed = 1, .roughness = 0.15, .relief = 0.08 };
    bool ok = true;
    for (int c; ok && (c = getopt_long(argc, argv, "h", options, NULL)) != -1;) {
        switch (c) {
        case 'b': s->base = optarg; break;
        case 'n':
            s->subdivide_given = ok = parse_count("subdivide", optarg, 16, &s->subdivide);
            break;
        case 'f': ok = parse_count("faces", optarg, UINT32_MAX - 1, &s->faces); break;
        case 's': ok = parse_count("seed", optarg, UINT64_MAX, &s->seed); break;
        case 'r': ok = parse_height("roughness", optarg, 0.5, &s->roughness); break;
        case 'l': s->relief_given = ok = parse_height("relief", optarg, 0.2, &s->relief); break;
        case 'h': fputs(usage, stdout); return 1;
        default: ok = false;
        }
    }
    if (ok && (argc - optind != 1 || (s->subdivide_given && s->faces))) {
        fprintf(stderr,
                "ebpo-generate: give one output file, and --subdivide or --faces, not both\n");
        ok = false;
    }
    s->output = ok ? argv[optind] : NULL;
    if (!ok)
        fputs(usage, stderr);
    return ok ? 0 : 2;
}

static bool fail_too_large(void)
{
    fprintf(stderr,
            "ebpo-generate: not enough memory, or more than 2^32 - 2 faces; request fewer faces\n");
    return false;
}

static bool refine(ebpo_mesh *mesh, const settings *s, bool round)
{
    for (uint64_t i = 0; s->faces ? mesh->face_count < s->faces : i < s->subdivide; i++) {
        if (!ebpo_subdivide(mesh))
            return fail_too_large();
        if (round)
            ebpo_to_unit_sphere(mesh);
    }
    return true;
}

static bool make_torus(ebpo_mesh *mesh, const settings *s)
{
    double m = 20 * pow(2, (double)s->subdivide), n = 50 * pow(2, (double)s->subdivide);
    if (s->faces) { /* about five squares around the axis for every two around the tube */
        m = ceil(sqrt((double)s->faces / 5));
        m = m < 3 ? 3 : m;
        n = ceil((double)s->faces / 2 / m);
        n = n < 8 ? 8 : n; /* with fewer squares the hole is too narrow for the proof */
    }
    return ebpo_make_torus(mesh, (uint32_t)n, (uint32_t)m) || fail_too_large();
}

static bool to_float(ebpo_mesh *mesh)
{
    if (mesh->xyz32)
        return true;
    mesh->xyz32 = malloc((mesh->vertex_count * 3 + 1) * sizeof *mesh->xyz32);
    if (!mesh->xyz32)
        return fail_too_large();
    for (uint64_t i = 0; i < 3 * mesh->vertex_count; i++)
        mesh->xyz32[i] = (float)mesh->xyz64[i];
    free(mesh->xyz64);
    mesh->xyz64 = NULL;
    return true;
}

static bool read_base(ebpo_mesh *mesh, const settings *s)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh_report report;
    if (s->relief_given) {
        fprintf(stderr,
                "ebpo-generate: --relief is only for the bases sphere and torus; omit it\n");
        return false;
    }
    if (ebpo_mesh_read(s->base, NULL, mesh, &error) != EBPO_OK ||
        ebpo_mesh_check(mesh, 0, (ebpo_progress){ NULL, NULL }, &report, &error) != EBPO_OK) {
        fprintf(stderr, "ebpo-generate: %s\n", error.message);
        return false;
    }
    if (!report.balanced || report.index_repeated_faces.count) {
        fprintf(stderr, "ebpo-generate: the mesh of %s is not closed; use a closed mesh\n",
                s->base);
        return false;
    }
    return to_float(mesh);
}

static bool report_proof(bool proved)
{
    if (!proved)
        fprintf(stderr, "ebpo-generate: the faces may intersect, as there are too few faces for "
                        "this relief; request more faces, or less --relief or --roughness\n");
    return proved;
}

static bool generate(ebpo_mesh *mesh, const settings *s)
{
    bool (*embedded)(const ebpo_mesh *) = NULL;
    double relief = s->relief;
    if (strcmp(s->base, "torus") == 0) {
        if (!make_torus(mesh, s))
            return false;
        embedded = ebpo_embedded_torus;
    } else if (strcmp(s->base, "sphere") == 0) {
        embedded = ebpo_embedded_sphere;
        if (!ebpo_make_icosahedron(mesh))
            return fail_too_large();
        if (!refine(mesh, s, true))
            return false;
    } else {
        relief = 0;
        if (!read_base(mesh, s) || !refine(mesh, s, false))
            return false;
    }
    if (!ebpo_displace(mesh, relief, s->roughness, s->seed))
        return fail_too_large();
    return !embedded || report_proof(embedded(mesh));
}

int main(int argc, char **argv)
{
    settings s;
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    int stop = parse(argc, argv, &s);
    if (stop)
        return stop == 1 ? EXIT_SUCCESS : 2;
    memset(&mesh, 0, sizeof mesh);
    bool ok = generate(&mesh, &s);
    if (ok && ebpo_mesh_write_ply(&mesh, s.output, &error) != EBPO_OK) {
        fprintf(stderr, "ebpo-generate: %s\n", error.message);
        ok = false;
    }
    if (ok)
        printf("%s: %llu vertices, %llu faces\n", s.output, (unsigned long long)mesh.vertex_count,
               (unsigned long long)mesh.face_count);
    ebpo_mesh_free(&mesh);
    return ok && fflush(stdout) == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
