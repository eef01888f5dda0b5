/* Prints the findings of a mesh report: edges, vertices and faces that are possible defects. */
#include "cli/mesh_findings.h"

#include <float.h>
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "cli/tables.h"
#include "cli/words.h"

/* Findings in the order of printing. */
static const struct finding_text {
    size_t offset;
    const char *key, *singular, *plural, *element;
} findings[] = {
    { offsetof(ebpo_mesh_report, boundary_edges), "boundary_edges",
      "boundary edge (used by one face only)", "boundary edges (used by one face only)", "face" },
    { offsetof(ebpo_mesh_report, nonmanifold_edges), "nonmanifold_edges",
      "edge shared by more than two faces", "edges shared by more than two faces", "face" },
    { offsetof(ebpo_mesh_report, misoriented_edges), "misoriented_edges",
      "edge whose two faces disagree in orientation",
      "edges whose two faces disagree in orientation", "face" },
    { offsetof(ebpo_mesh_report, unbalanced_edges), "unbalanced_edges", "unbalanced edge",
      "unbalanced edges", "face" },
    { offsetof(ebpo_mesh_report, bowtie_vertices), "bowtie_vertices",
      "non-manifold vertex (several fans of faces meet)",
      "non-manifold vertices (several fans of faces meet)", "vertex" },
    { offsetof(ebpo_mesh_report, zero_area_faces), "zero_area_faces", "face without area",
      "faces without area", "face" },
    { offsetof(ebpo_mesh_report, index_repeated_faces), "index_repeated_faces",
      "face that names a vertex twice", "faces that name a vertex twice", "face" },
    { offsetof(ebpo_mesh_report, repeated_faces), "repeated_faces", "repeated face",
      "repeated faces", "face" },
    { offsetof(ebpo_mesh_report, unreferenced_vertices), "unreferenced_vertices",
      "vertex that no face uses", "vertices that no face uses", "vertex" },
    { offsetof(ebpo_mesh_report, repeated_positions), "repeated_positions",
      "vertex at the position of an earlier one", "vertices at the position of an earlier one",
      "vertex" },
};
enum { FINDINGS = sizeof findings / sizeof *findings };

const char *findings_plural(const char *name)
{
    for (int i = 0; i < FINDINGS; i++)
        if (strcmp(findings[i].key, name) == 0)
            return findings[i].plural;
    return name;
}

static const ebpo_finding *finding_of(const ebpo_mesh_report *report, int i)
{
    return (const ebpo_finding *)(const void *)((const char *)report + findings[i].offset);
}

static int location_count(const ebpo_finding *f)
{
    return f->count < EBPO_FINDING_LOCATIONS ? (int)f->count : EBPO_FINDING_LOCATIONS;
}

static void print_locations(FILE *out, const ebpo_finding *f, const char *element)
{
    int shown = location_count(f);
    const char *plural = element[0] == 'v' ? "vertices" : "faces";
    fprintf(out, ": %s", shown == 1 ? element : plural);
    for (int i = 0; i < shown; i++)
        fprintf(out, "%s %llu", i ? "," : "", (unsigned long long)f->locations[i]);
    fprintf(out, "%s\n", f->count > (uint64_t)shown ? ", ..." : "");
}

static void print_findings(FILE *out, const ebpo_mesh_report *report)
{
    bool any = false;
    for (int i = 0; i < FINDINGS; i++) {
        const ebpo_finding *f = finding_of(report, i);
        if (f->count == 0)
            continue;
        any = true;
        fprintf(out, "  %llu %s", (unsigned long long)f->count,
                f->count == 1 ? findings[i].singular : findings[i].plural);
        print_locations(out, f, findings[i].element);
    }
    if (!any)
        fputs("  no problems found in vertices, edges and single faces\n", out);
}

static void print_reading(FILE *out, const ebpo_mesh *mesh)
{
    char text[80];
    if (mesh->xyz64 && mesh->source_format[0] && strncmp(mesh->source_format, "ply", 3) != 0)
        fputs("  coordinates are stored as double: float does not keep all digits of the text\n",
              out);
    if (mesh->polygons_triangulated) {
        fprintf(out, "  %s cut into triangles",
                words_plural(text, sizeof text, mesh->polygons_triangulated, "polygon",
                             "polygons"));
        if (mesh->polygons_concave)
            fprintf(out, " (%llu concave)", (unsigned long long)mesh->polygons_concave);
        if (mesh->polygons_guessed)
            fprintf(out, ", %llu of which by a guess, because the outline crosses itself",
                    (unsigned long long)mesh->polygons_guessed);
        fputc('\n', out);
    }
    if (mesh->strips)
        fprintf(out, "  %s unrolled\n",
                words_plural(text, sizeof text, mesh->strips, "triangle strip", "triangle strips"));
    if (mesh->polygons_dropped)
        fprintf(out, "  %s with fewer than three corners omitted\n",
                words_plural(text, sizeof text, mesh->polygons_dropped, "polygon", "polygons"));
}

static const char *kind_of_mesh(const ebpo_mesh_report *report)
{
    if (!report->balanced)
        return "a surface: its edges do not balance";
    return report->manifold ? "a solid, closed 2-manifold"
                            : "a solid: its edges balance, though it is not a 2-manifold";
}

const char *findings_extent(char *text, size_t size, double x, int power,
                            const ebpo_mesh_report *report)
{
    int dimensions = 0; /* number of axes on which the mesh extends */
    for (int k = 0; k < 3; k++)
        dimensions += report->max[k] > report->min[k];
    if (!isfinite(x))
        snprintf(text, size, "%s1.8e+308", signbit(x) ? "below -" : "beyond ");
    else if (fabs(x) < DBL_MIN && dimensions >= power)
        snprintf(text, size, signbit(x) ? "between -2.2e-308 and 0" : "below 2.2e-308");
    else
        snprintf(text, size, "%.6g", x);
    return text;
}

ebpo_solid_volume findings_solid(const ebpo_mesh_report *report, ebpo_rule rule,
                                 const ebpo_shells *shells, const ebpo_info *info)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_solid_volume solid = EBPO_SOLID_VOLUME_INIT;
    /* fails only if the library has another size of the struct */
    if (ebpo_solid_volume_of(report, rule, shells, info, &solid, &error) != EBPO_OK)
        solid.hi = INFINITY;
    return solid;
}

/* Writes a bound with six digits, rounded outward. */
static const char *bound_text(char text[40], double x, bool up)
{
    double step = x > 0 ? pow(10, floor(log10(x)) - 5) : 0;
    snprintf(text, 40, "%.6g", x);
    if (up ? strtod(text, NULL) < x : strtod(text, NULL) > x)
        snprintf(text, 40, "%.6g", up ? x + step : x - step);
    return text;
}

const char *findings_volume(char text[FINDINGS_VOLUME], const ebpo_solid_volume *solid,
                            const ebpo_mesh_report *report, const char *unit)
{
    char lo[40], hi[40], integral[40], cubed[TABLE_CELL];
    bool known = findings_volume_known(solid),
         none = known && solid->lo == 0 && solid->integral != 0;
    findings_extent(integral, sizeof integral, solid->integral, 3, report);
    findings_extent(lo, sizeof lo, solid->lo, 3, report);
    table_unit(cubed, unit, 3);
    if (known && solid->lo == solid->integral)
        snprintf(text, FINDINGS_VOLUME, "volume %s%s", lo, cubed);
    else if (known)
        snprintf(text, FINDINGS_VOLUME, "volume %s%s (integral of the winding number %s)",
                 none ? "0" : lo, cubed, integral);
    else if (isfinite(solid->hi))
        snprintf(text, FINDINGS_VOLUME, "volume %s to %s%s (integral of the winding number %s)",
                 bound_text(lo, solid->lo, false), bound_text(hi, solid->hi, true), cubed,
                 integral);
    else
        snprintf(text, FINDINGS_VOLUME, "integral of the winding number %s%s", integral, cubed);
    return text;
}

/* Returns a note to append if the area or volume x is beyond the range of doubles; else "". `text`:
 * result of findings_extent for x. */
static const char *beyond_text(double x, const char *text)
{
    bool printed = (isfinite(x) && fabs(x) >= DBL_MIN) || text[0] == '0';
    return printed ? "" : " (see ebpo measure, of the converted file)";
}

void findings_print(FILE *out, const char *path, const ebpo_mesh *mesh,
                    const ebpo_mesh_report *report, const ebpo_solid_volume *solid,
                    bool crossings_follow)
{
    char bytes[32], parts[64], volume[FINDINGS_VOLUME];
    fprintf(out, "%s: %llu vertices, %llu faces", path ? path : "after repair",
            (unsigned long long)mesh->vertex_count, (unsigned long long)mesh->face_count);
    if (path && mesh->source_format[0])
        fprintf(out, " (%s, %s, %s)", mesh->source_format,
                words_bytes(bytes, sizeof bytes, mesh->source_size),
                mesh->xyz32 ? "float" : "double");
    fprintf(out, "\n  %s\n", kind_of_mesh(report));
    fprintf(out, "  %s",
            words_plural(parts, sizeof parts, report->components, "component", "components"));
    if (report->boundary_loops)
        fprintf(out, ", %s",
                words_plural(parts, sizeof parts, report->boundary_loops, "hole", "holes"));
    if (report->genus_known)
        fprintf(out, ", genus %lld", (long long)report->genus);
    findings_extent(parts, sizeof parts, report->area, 2, report);
    fprintf(out, ", area %s%s", parts, beyond_text(report->area, parts));
    findings_extent(parts, sizeof parts, report->volume, 3, report);
    if (report->balanced)
        fprintf(out, ", %s%s", findings_volume(volume, solid, report, ""),
                beyond_text(report->volume, parts));
    fprintf(out, ", mean edge %.4g\n  box %.6g %.6g %.6g to %.6g %.6g %.6g\n", report->mean_edge,
            report->min[0], report->min[1], report->min[2], report->max[0], report->max[1],
            report->max[2]);
    if (path)
        print_reading(out, mesh);
    print_findings(out, report);
    if (!crossings_follow)
        fputs("  not checked: intersecting faces (ebpo check --crossings)\n", out);
}

void findings_print_repair(FILE *out, const ebpo_repair_record *r)
{
    char text[80];
    if (r->weld) {
        fprintf(out, "  welded: %s merged",
                words_plural(text, sizeof text, r->welded_vertices, "vertex", "vertices"));
        if (r->weld_distance > 0)
            fprintf(out, " within %.6g, moved by %.6g at most; %s", r->weld_distance, r->weld_moved,
                    words_plural(text, sizeof text, r->collapsed_faces,
                                 "face lost its area (it names a vertex twice)",
                                 "faces lost their area (they name a vertex twice)"));
        fputc('\n', out);
    }
    if (r->drop_duplicates) {
        fprintf(out, "  dropped: %s",
                words_plural(text, sizeof text, r->dropped_faces, "repeated face",
                             "repeated faces"));
        if (r->dropped_opposite)
            fprintf(out, ", %llu of which had the opposite orientation",
                    (unsigned long long)r->dropped_opposite);
        fputc('\n', out);
    }
    if (r->orient) {
        fprintf(out, "  oriented: %s turned",
                words_plural(text, sizeof text, r->flipped_faces, "face", "faces"));
        if (r->unorientable_components)
            fprintf(out, ", %s cannot be oriented",
                    words_plural(text, sizeof text, r->unorientable_components, "component",
                                 "components"));
        fputc('\n', out);
    }
    if (!r->orient && r->flipped_faces)
        fprintf(out, "  flipped: %s turned\n",
                words_plural(text, sizeof text, r->flipped_faces, "face", "faces"));
    if (r->fill_holes) {
        fprintf(out, "  filled: %s",
                words_plural(text, sizeof text, r->filled_holes, "hole", "holes"));
        fprintf(out, " with %s", words_plural(text, sizeof text, r->added_faces, "face", "faces"));
        if (r->unfilled_holes)
            fprintf(out, ", %s left (not simple loops)",
                    words_plural(text, sizeof text, r->unfilled_holes, "hole", "holes"));
        fputc('\n', out);
    }
}

/* --- JSON --- */

static void json_finding(json *j, const char *key, const ebpo_finding *f)
{
    json_object(j, key);
    json_uint(j, "count", f->count);
    json_array(j, "locations");
    for (int i = 0; i < location_count(f); i++)
        json_uint(j, NULL, f->locations[i]);
    json_end(j);
    json_end(j);
}

void findings_volume_json(json *j, const ebpo_solid_volume *solid)
{
    json_real(j, "volume", findings_volume_known(solid) ? solid->lo : NAN);
    json_real(j, "volume_lo", solid->lo);
    json_real(j, "volume_hi", solid->hi);
    json_real(j, "winding_integral", solid->integral);
}

void findings_json(json *j, const char *key, const ebpo_mesh_report *report,
                   const ebpo_solid_volume *solid)
{
    json_object(j, key);
    json_bool(j, "balanced", report->balanced);
    json_bool(j, "manifold", report->manifold);
    for (int i = 0; i < FINDINGS; i++)
        json_finding(j, findings[i].key, finding_of(report, i));
    json_uint(j, "edges", report->edges);
    json_uint(j, "components", report->components);
    json_uint(j, "boundary_loops", report->boundary_loops);
    if (report->genus_known)
        json_int(j, "genus", report->genus);
    else
        json_null(j, "genus");
    json_real(j, "area", report->area);
    findings_volume_json(j, solid);
    json_real(j, "mean_edge", report->mean_edge);
    json_reals(j, "min", report->min, 3);
    json_reals(j, "max", report->max, 3);
    json_end(j);
}

void findings_json_repair(json *j, const char *key, const ebpo_repair_record *r)
{
    json_object(j, key);
    json_bool(j, "weld", r->weld);
    json_uint(j, "welded_vertices", r->welded_vertices);
    json_real(j, "weld_distance", r->weld_distance);
    json_real(j, "weld_moved", r->weld_moved);
    json_uint(j, "collapsed_faces", r->collapsed_faces);
    json_bool(j, "drop_duplicates", r->drop_duplicates);
    json_uint(j, "dropped_faces", r->dropped_faces);
    json_bool(j, "orient", r->orient);
    json_uint(j, "flipped_faces", r->flipped_faces);
    json_uint(j, "unorientable_components", r->unorientable_components);
    json_bool(j, "fill_holes", r->fill_holes);
    json_uint(j, "filled_holes", r->filled_holes);
    json_uint(j, "added_faces", r->added_faces);
    json_uint(j, "unfilled_holes", r->unfilled_holes);
    json_end(j);
}

void findings_json_source(json *j, const char *key, const ebpo_mesh *mesh, const char *unread)
{
    char hex[65];
    words_hex(mesh->source_sha256, hex);
    json_object(j, key);
    json_text(j, "name", mesh->source_name);
    json_text(j, "format", mesh->source_format);
    json_uint(j, "bytes", mesh->source_size);
    json_text(j, "sha256", hex);
    json_bool(j, "double_coordinates", mesh->xyz64 != NULL);
    json_uint(j, "vertices", mesh->vertex_count);
    json_uint(j, "faces", mesh->face_count);
    json_uint(j, "polygons_triangulated", mesh->polygons_triangulated);
    json_uint(j, "polygons_concave", mesh->polygons_concave);
    json_uint(j, "polygons_guessed", mesh->polygons_guessed);
    json_uint(j, "polygons_dropped", mesh->polygons_dropped);
    json_uint(j, "strips", mesh->strips);
    if (unread[0])
        json_text(j, "omitted", unread);
    else
        json_null(j, "omitted");
    json_end(j);
}
